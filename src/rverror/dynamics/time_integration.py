"""Motion in time of the same equations, at any course of the speed: for checks, and for running up.

As the speed changes by Omega', inertia has more terms: of Euler's force, and of the nominal motion that is sped up,

    y'' + (C + Omega G) y' + (K + Omega^2 S + Omega' G / 2) y = Omega^2 f(theta) + Omega' g(theta).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.dynamics.harmonic_balance import Oscillator

#: Angle, speed and acceleration at a time: rad, rad/s, rad/s^2.
Speeding = Callable[[float], tuple[float, float, float]]
#: So many points between two samples: the shortest wave that the samples hold has eight.
_FINER = 4
_SWING = 0.5  # of the least stiffness at the samples, by which it may fall between them


def periodic(rows: Array, period: float) -> Any:
    """Rows between their angles: a cubic spline through many more points of their Fourier series.

    Parameters
    ----------
    rows : ndarray, shape (r, n)
        At even angles of one period.
    period : float
        rad.

    Returns
    -------
    scipy.interpolate.CubicSpline
        From angles, any shape, to rows, shape (..., r).
    """
    fine = scipy.signal.resample(rows, _FINER * rows.shape[-1], axis=-1)
    angle = np.linspace(0, period, fine.shape[-1] + 1)
    return scipy.interpolate.CubicSpline(angle, np.append(fine, fine[:, :1], axis=1).T, bc_type="periodic")


@dataclass(frozen=True)
class Forced:
    """A system and what drives it.

    Attributes
    ----------
    oscillator : Oscillator
    by_speed, by_acceleration : ndarray, shape (m, n)
        Force per speed squared, and per rad/s^2, at the angles of the oscillator.
    """

    oscillator: Oscillator
    by_speed: Array
    by_acceleration: Array

    @cached_property
    def _rows(self) -> Any:
        """Stiffness, damping and the two forces over the angle, below one another.

        Where stiffness jumps, as flanks close, its series swings beside the jump, and below nothing; then stiffness and
        damping go straight from sample to sample.
        """
        system, m = self.oscillator, self.oscillator.size
        rows = np.concatenate([system.stiffness.reshape(m * m, -1), system.damping.reshape(m * m, -1)])
        smooth = periodic(np.concatenate([rows, self.by_speed, self.by_acceleration]), system.period)
        between = system.period * (np.arange(_FINER * system.count) + 0.5) / (_FINER * system.count)
        least, greatest = (
            np.linalg.eigvalsh(matrices.reshape(-1, m, m)).min()
            for matrices in (smooth(between)[:, : m * m], np.moveaxis(system.stiffness, -1, 0))
        )
        if least >= greatest - _SWING * abs(greatest):
            return smooth
        slope = (np.roll(rows, -1, axis=1) - rows) * (system.count / system.period)
        ahead = system.period / system.count * np.arange(_FINER) / _FINER
        straight = smooth.c.copy()
        straight[:-2, :, : len(rows)] = 0
        straight[-2, :, : len(rows)] = np.repeat(slope, _FINER, axis=1).T
        straight[-1, :, : len(rows)] = (rows[..., None] + slope[..., None] * ahead).reshape(len(rows), -1).T
        return scipy.interpolate.PPoly(straight, smooth.x, extrapolate="periodic")

    def at(self, theta: Any) -> tuple[Array, Array]:
        """Stiffness and damping, (..., 2, m, m), and the two forces, (..., 2, m), at any angles."""
        m, shape, rows = self.oscillator.size, np.shape(theta), self._rows(theta)
        return rows[..., : 2 * m * m].reshape(*shape, 2, m, m), rows[..., 2 * m * m :].reshape(*shape, 2, m)

    def in_time(
        self,
        course: Speeding,
        times: Array,
        *,
        start: tuple[Array, Array] | None = None,
        tolerance: float = 1e-8,
        longest: float = np.inf,
    ) -> tuple[Array, Array]:
        """Motion from a start on.

        Parameters
        ----------
        course : callable
            Angle, speed and acceleration at a time.
        times : ndarray, shape (k,)
            s, growing; the motion starts at the first.
        start : tuple of ndarray, optional
            Coordinates and their rates then, (m,) each; at rest about the equilibrium where left out.
        tolerance : float
            Relative, of each step.
        longest : float
            Step, s.

        Returns
        -------
        y, rate : ndarray, shape (m, k)

        Raises
        ------
        InputError
            If the integration fails: the motion grows without bound.

        Notes
        -----
        Stiffness, damping and forces between their angles are those of their Fourier series, where that keeps
        the stiffness above nothing; scipy's DOP853 takes the steps.
        """
        from rverror.dynamics.rates import rates  # numba takes a while to import

        system, m = self.oscillator, self.oscillator.size
        rows = np.ascontiguousarray(np.moveaxis(self._rows.c, 0, -1))

        def derivative(time: float, state: Array) -> Array:
            found = np.empty_like(state)
            rates(state, *course(time), rows, system.period, system.centrifugal, system.turning, found)
            return found

        first = np.zeros(2 * m) if start is None else np.concatenate(start)
        # what a coordinate is driven to is the measure of what counts
        scale = max(float(np.abs(first).max()), self._size(course, times), np.finfo(np.float64).tiny)
        found = scipy.integrate.solve_ivp(
            derivative,
            (times[0], times[-1]),
            first,
            "DOP853",
            times,
            max_step=longest,
            rtol=tolerance,
            atol=tolerance * scale,
        )
        if not found.success:
            raise InputError(f"the motion in time could not be followed ({found.message}); take a shorter time")
        return found.y[:m], found.y[m:]

    def _size(self, course: Speeding, times: Array) -> float:
        """How far the forces would move the softest coordinate."""
        value, _ = self.oscillator.mean_modes
        moments = np.linspace(times[0], times[-1], 9).tolist()
        speed, acceleration = (max(abs(course(time)[at]) for time in moments) for at in (1, 2))
        force = speed**2 * np.abs(self.by_speed).max() + acceleration * np.abs(self.by_acceleration).max()
        return float(force / value[value > 0].min()) if (value > 0).any() else float(force)
