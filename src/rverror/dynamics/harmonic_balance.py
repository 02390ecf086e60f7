"""Periodic answer of a linear system whose stiffness and damping turn with an angle, at constant speed.

    M y'' + C(theta) y' + K(theta) y = f(theta),    theta = Omega t,

with y in Fourier series over one period: the equation holds at every sampled angle, and each derivative is that of the
series.  `docs/theory/dynamics.md` says where its terms come from.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array
from rverror.base.errors import InputError

TOLERANCE = 1e-10  # of the force: what is left of the equation
#: Where rounding leaves more: a second derivative has (n / 2)^2 times the rounding of what it is taken of.
_ENOUGH = 1e-8
_AT_MEAN = 60  # directions of GMRES from the mean system; where it does not settle in these it does not in many
_AT_ONCE, _RESTARTS = 200, 3  # from differences of neighbours, and how often it begins anew
_REACH = 3  # neighbours to either side
_TOP = 0.98  # of the shortest wave that the samples hold: so far differences are fitted


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
    def in_mean_modes(self) -> tuple[Array, Array]:
        """Stiffness and damping in the modes of the mean stiffness, (m, m, n)."""
        _, vector = self.mean_modes
        stiffness, damping = (
            np.einsum("ai,abn,bj->ijn", vector, one, vector, optimize=True) for one in (self.stiffness, self.damping)
        )
        return stiffness, damping

    def response(self, force: Array, *, speed: float) -> Array:
        """Periodic motion under a force that turns with the angle.

        Parameters
        ----------
        force : ndarray, shape (m, n)
        speed : float
            dtheta/dt, rad/s, of either sign.

        Returns
        -------
        ndarray, shape (m, n)
            A free motion of the mean has no mean.

        Raises
        ------
        InputError
            If the mean is undamped at a natural frequency, or no answer was found.
        """
        _, vector = self.mean_modes
        balance = _Balance(self, speed)
        right = balance.held(vector.T @ force)
        enough = np.linalg.norm(right)
        for approximate, directions, restarts in (
            (balance.by_mean, _AT_MEAN, 1),
            (balance.by_neighbours, _AT_ONCE, _RESTARTS),
        ):
            answer, preconditioned = approximate()

            def apply(row: Array, preconditioned: Callable[[Array], Array] = preconditioned) -> Array:
                return preconditioned(row.reshape(right.shape)).reshape(-1)

            operator = scipy.sparse.linalg.LinearOperator((right.size, right.size), matvec=apply, dtype=np.float64)
            found, failed = scipy.sparse.linalg.gmres(
                operator, right.reshape(-1), rtol=0.0, atol=TOLERANCE * enough, restart=directions, maxiter=restarts
            )
            moved = answer(found.reshape(right.shape))
            if not failed:
                break
        else:
            missed = float(np.linalg.norm(right - balance.equation(moved)) / enough)
            if not missed <= _ENOUGH:
                raise InputError(
                    f"speed = {speed:.6g} rad/s of the output: no periodic motion was found, {missed:.1g} of the force "
                    "is left; choose another speed, more damping, or fewer modes that keep their inertia"
                )
        return np.asarray(vector @ scipy.fft.irfft(moved, self.count))


#: Waves of an approximate answer to a force, (m, n // 2 + 1), and the force that the equation asks for it, (m, n).
_Approximate = tuple[Callable[[Array], npt.NDArray[np.complex128]], Callable[[Array], Array]]


@dataclass(frozen=True)
class _Balance:
    """The equation at one speed, in the modes of the mean stiffness, and two approximate answers."""

    system: Oscillator
    speed: float

    @cached_property
    def _both(self) -> Array:
        """Stiffness and damping side by side, with what the turning adds, (m, 2 m, n)."""
        _, vector = self.system.mean_modes
        steady = self.speed**2 * self.system.centrifugal, self.speed * self.system.turning
        pairs = zip(self.system.in_mean_modes, steady, strict=True)
        return np.concatenate([one + (vector.T @ more @ vector)[..., None] for one, more in pairs], axis=1)

    @cached_property
    def _rate(self) -> npt.NDArray[np.complex128]:
        """First derivative of each wave over time."""
        rate = 1j * self.speed * self.system.orders
        if self.system.count % 2 == 0:
            rate[-1] = 0  # the shortest wave has no slope at its samples
        return np.asarray(rate)

    def held(self, rows: Array) -> Array:
        """Rows without the mean of free motions, which nothing balances."""
        free = self.system.mean_modes[0] == 0
        return rows - np.where(free, rows.mean(axis=1), 0.0)[:, None] if free.any() else rows

    def equation(self, waves: npt.NDArray[np.complex128]) -> Array:
        """What force waves of a motion ask for, (m, n)."""
        curved = -((self.speed * self.system.orders) ** 2) * waves
        rows = scipy.fft.irfft(np.concatenate([waves, self._rate * waves, curved]), self.system.count)
        m = self.system.size
        return self.held(rows[2 * m :] + np.einsum("ijn,jn->in", self._both, rows[: 2 * m]))

    def by_mean(self) -> _Approximate:
        """Answer of the mean stiffness and damping, wave by wave."""
        value, _ = self.system.mean_modes
        damped = np.einsum("iin->i", self.system.in_mean_modes[1]) / self.system.count
        impedance = value[:, None] - (self.speed * self.system.orders) ** 2 + damped[:, None] * self._rate
        free = (value == 0)[:, None] & (self.speed * self.system.orders == 0)
        if not np.all(impedance[~free]):
            raise InputError(
                f"speed = {self.speed:.6g} rad/s: undamped at a natural frequency; give a damping ratio above 0"
            )
        admittance = np.where(free, 0.0, 1 / np.where(free, 1.0, impedance))
        varying = self._both.copy()
        every = np.arange(self.system.size)
        varying[every, every] -= value[:, None]
        varying[every, self.system.size + every] -= damped[:, None]

        def answer(rows: Array) -> npt.NDArray[np.complex128]:
            return np.asarray(admittance * scipy.fft.rfft(rows))

        def preconditioned(rows: Array) -> Array:
            waves = answer(rows)
            moved = scipy.fft.irfft(np.concatenate([waves, self._rate * waves]), self.system.count)
            return rows + self.held(np.einsum("ijn,jn->in", varying, moved))

        return answer, preconditioned

    def by_neighbours(self) -> _Approximate:
        """Answer of compact differences between neighbours: a band, with stiffness and damping as they are.

        With y the mean `smooth` of w over neighbours, y'' and y' are differences of w.
        """
        m, n = self.system.size, self.system.count
        smooth, second, first = _compact_differences()
        value, _ = self.system.mean_modes
        step = self.system.period / n
        # a free motion is held by less than the longest wave's inertia
        hold = np.diag(np.where(value == 0, -((self.speed * self.system.orders[1] / 2) ** 2), 0.0))
        both = np.moveaxis(self._both, -1, 0)
        stiffness, damping = both[:, :, :m] + hold, self.speed / step * both[:, :, m:]
        offsets = np.arange(-_REACH, _REACH + 1)
        blocks = [
            smooth[abs(at)] * stiffness
            + np.sign(at) * first[abs(at)] * damping
            + (self.speed / step) ** 2 * second[abs(at)] * np.eye(m)
            for at in offsets
        ]
        columns = (np.arange(n)[:, None] + offsets) % n
        ends = np.arange(0, columns.size + 1, offsets.size)
        band = scipy.sparse.bsr_array((np.stack(blocks, axis=1).reshape(-1, m, m), columns.ravel(), ends))
        factors = scipy.sparse.linalg.splu(band.tocsc())
        waves = smooth[0] + 2 * np.cos(np.outer(self.system.orders * step, np.arange(1, _REACH + 1))) @ smooth[1:]

        def answer(rows: Array) -> npt.NDArray[np.complex128]:
            found = factors.solve(rows.T.ravel()).reshape(n, m)
            return np.asarray(waves * scipy.fft.rfft(found.T))

        return answer, lambda rows: self.equation(answer(rows))


def _compact_differences() -> tuple[Array, Array, Array]:
    """Weights of neighbours for a mean, and for its second and first derivative in steps: by distance.

    Fitted to the derivatives of waves by least squares; what they miss costs directions of GMRES, and no accuracy.
    """
    wave = np.linspace(0, _TOP * np.pi, 1000)[1:, None]
    cos, sin = (of(wave * np.arange(1, _REACH + 1)) for of in (np.cos, np.sin))
    smooth = np.zeros(_REACH)
    for _ in range(10):  # the misfit counts beside the mean's own size
        weight = 1 / (wave**2 * (1 + 2 * cos @ smooth)[:, None])
        fit = np.linalg.lstsq(weight * np.hstack([2 * wave**2 * cos, 2 * (cos - 1)]), -(weight * wave**2)[:, 0])[0]
        smooth, second = fit[:_REACH], fit[_REACH:]
    mean = (1 + 2 * cos @ smooth)[:, None] * wave
    first = np.linalg.lstsq(2 * sin / mean, np.ones(len(wave)))[0]
    return np.append(1, smooth), np.append(-2 * second.sum(), second), np.append(0, first)
