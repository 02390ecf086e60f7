"""Periodic answer of a linear system whose stiffness and damping turn with an angle, at constant speed.

    M y'' + C(theta) y' + K(theta) y = f(theta),    theta = Omega t,

with y in Fourier series over one period: the equation holds at every sampled angle, and each derivative is that of the
series.  `docs/theory/dynamics.md` says where its terms come from.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import fft
from scipy.sparse.linalg import LinearOperator, gmres

from rverror.base.arrays import Array
from rverror.base.errors import InputError

TOLERANCE = 1e-7  # of the answer that the mean system gives
_ENOUGH = 1e-5  # where that takes too long: with many stiff modes steps grow small
_AT_ONCE, _RESTARTS = 200, 3  # directions of GMRES, and how often it begins anew


def slope(rows: Array, step: float, power: int = 1) -> Array:
    """Derivative of periodic rows over the angle, by their Fourier series.

    Parameters
    ----------
    rows : ndarray, shape (..., n)
        At even angles of one period.
    step : float
        Waves per radian of the longest wave.
    power : int
        Which derivative.

    Returns
    -------
    ndarray, shape (..., n)
    """
    count = rows.shape[-1]
    waves = fft.rfft(rows) * (1j * step * np.arange(count // 2 + 1)) ** power
    if power % 2 and count % 2 == 0:
        waves[..., -1] = 0  # the shortest wave has no slope at its samples
    return np.asarray(fft.irfft(waves, count))


@dataclass(frozen=True)
class Oscillator:
    """A system with mass 1 in every coordinate, at n even angles of one period.

    Attributes
    ----------
    stiffness, damping : ndarray, shape (m, m, n)
    turning : ndarray, shape (m, m)
        What the damping has more per unit of speed, rad/s: Coriolis forces.
    centrifugal : ndarray, shape (m, m)
        What the stiffness has more per unit of speed squared.
    period : float
        rad.
    """

    stiffness: Array
    damping: Array
    turning: Array
    centrifugal: Array
    period: float

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return len(self.turning)

    @property
    def count(self) -> int:
        """Number of angles."""
        return int(self.stiffness.shape[-1])

    @cached_property
    def orders(self) -> Array:
        """Waves per radian of the Fourier series, (n // 2 + 1,)."""
        return np.asarray(2 * np.pi / self.period * np.arange(self.count // 2 + 1), dtype=np.float64)

    @cached_property
    def mean_modes(self) -> tuple[Array, Array]:
        """Squares of the frequencies of the mean stiffness, and its modes as columns."""
        value, vector = np.linalg.eigh(self.stiffness.mean(axis=-1))
        return np.where(value < 1e-14 * value[-1], 0.0, value), vector

    @cached_property
    def varying(self) -> tuple[Array, Array]:
        """In the modes of the mean stiffness: mean damping of each mode, and what stiffness and damping have more.

        Stiffness and damping stand side by side, (m, 2 m, n).
        """
        value, vector = self.mean_modes
        stiffness = np.einsum("ai,abn,bj->ijn", vector, self.stiffness, vector, optimize=True)
        damping = np.einsum("ai,abn,bj->ijn", vector, self.damping, vector, optimize=True)
        mean = np.einsum("iin->i", damping) / self.count
        stiffness -= np.diag(value)[..., None]
        damping -= np.diag(mean)[..., None]
        return mean, np.concatenate([stiffness, damping], axis=1)

    def response(self, force: Array, *, speed: float, near: Array | None = None) -> Array:
        """Periodic motion under a force that turns with the angle.

        Parameters
        ----------
        force : ndarray, shape (m, n)
        speed : float
            dtheta/dt, rad/s, of either sign.
        near : ndarray, shape (m, n), optional
            A motion that is likely near, such as that at a speed beside it.

        Returns
        -------
        ndarray, shape (m, n)
            A free motion of the mean has no mean.

        Raises
        ------
        InputError
            If no answer was found: the stiffness varies too much beside its mean.
        """
        value, vector = self.mean_modes
        damped, varying = self.varying
        steady = np.concatenate([speed**2 * self.centrifugal @ vector, speed * self.turning @ vector], axis=1)
        varying = varying + (vector.T @ steady)[..., None]
        rate = 1j * speed * self.orders
        if self.count % 2 == 0:
            rate[-1] = 0
        impedance = value[:, None] - (speed * self.orders) ** 2 + damped[:, None] * rate
        free = (value == 0)[:, None] & (speed * self.orders == 0)
        if not np.all(impedance[~free]):
            raise InputError(
                f"speed = {speed:.6g} rad/s: undamped at a natural frequency; give a damping ratio above 0"
            )
        admittance = np.where(free, 0.0, 1 / np.where(free, 1.0, impedance))

        def answered(rows: Array) -> Array:
            return np.asarray(admittance * fft.rfft(rows), dtype=np.complex128)

        def apply(packed: Array) -> Array:
            waves = packed.view(np.complex128).reshape(self.size, -1)
            moved = fft.irfft(np.concatenate([waves, rate * waves]), self.count)
            more = answered(np.einsum("ijn,jn->in", varying, moved))
            return np.asarray((waves + more).reshape(-1).view(np.float64))

        right = answered(vector.T @ force).reshape(-1).view(np.float64)
        operator = LinearOperator((right.size, right.size), matvec=apply, dtype=np.float64)
        begin = None if near is None else fft.rfft(vector.T @ near).reshape(-1).view(np.float64)
        found, failed = gmres(operator, right, begin, rtol=TOLERANCE, atol=0.0, restart=_AT_ONCE, maxiter=_RESTARTS)
        if failed and not np.linalg.norm(apply(found) - right) <= _ENOUGH * np.linalg.norm(right):
            raise InputError(
                f"speed = {speed:.6g} rad/s of the output: no periodic motion was found, the stiffness varies too "
                "much beside its mean; choose another speed, more damping, or fewer modes that keep their inertia"
            )
        return np.asarray(vector @ fft.irfft(found.view(np.complex128).reshape(self.size, -1), self.count))
