"""Motion in time of the same equations, at any course of the speed: for checks, and for running up.

As the speed changes by Omega', inertia has more terms: of Euler's force, and of the nominal motion that is sped up,

    y'' + (C + Omega G) y' + (K + Omega^2 S + Omega' G / 2) y = Omega^2 f(theta) + Omega' g(theta).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.dynamics.harmonic_balance import Oscillator

#: Of angle, speed and acceleration at a time: rad, rad/s, rad/s^2.
Course = Callable[[float], tuple[float, float, float]]


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

    def in_time(
        self, course: Course, times: Array, *, start: tuple[Array, Array] | None = None, tolerance: float = 1e-8
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

        Returns
        -------
        y, rate : ndarray, shape (m, k)

        Raises
        ------
        InputError
            If the integration fails: the motion grows without bound.

        Notes
        -----
        Stiffness, damping and forces between their angles are periodic cubic splines; scipy's DOP853 takes the steps.
        """
        system, m = self.oscillator, self.oscillator.size
        parts = (system.stiffness.reshape(m * m, -1), system.damping.reshape(m * m, -1))
        rows = np.concatenate([*parts, self.by_speed, self.by_acceleration])
        angle = system.period * np.arange(system.count + 1) / system.count
        spline = CubicSpline(angle, np.concatenate([rows, rows[:, :1]], axis=1), axis=1, bc_type="periodic")

        def rates(time: float, state: Array) -> Array:
            theta, speed, acceleration = course(time)
            now = spline(theta % system.period)
            stiffness, damping = now[: 2 * m * m].reshape(2, m, m)
            stiffness = stiffness + speed**2 * system.centrifugal + acceleration / 2 * system.turning
            force = speed**2 * now[-2 * m : -m] + acceleration * now[-m:]
            force = force - stiffness @ state[:m] - (damping + speed * system.turning) @ state[m:]
            return np.concatenate([state[m:], force])

        first = np.zeros(2 * m) if start is None else np.concatenate(start)
        # what a coordinate is driven to is the measure of what counts
        scale = max(float(np.abs(first).max()), self._size(course, times), np.finfo(np.float64).tiny)
        found = solve_ivp(
            rates, (times[0], times[-1]), first, "DOP853", t_eval=times, rtol=tolerance, atol=tolerance * scale
        )
        if not found.success:
            raise InputError(f"the motion in time could not be followed ({found.message}); take a shorter time")
        return found.y[:m], found.y[m:]

    def _size(self, course: Course, times: Array) -> float:
        """How far the forces would move the softest coordinate."""
        value, _ = self.oscillator.mean_modes
        states = [course(float(time)) for time in np.linspace(times[0], times[-1], 9)]
        speed, acceleration = (max(abs(one[at]) for one in states) for at in (1, 2))
        force = speed**2 * np.abs(self.by_speed).max() + acceleration * np.abs(self.by_acceleration).max()
        return float(force / value[value > 0].max()) if (value > 0).any() else float(force)
