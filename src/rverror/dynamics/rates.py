"""Rates of a motion in time, compiled: a second of motion asks for them some ten thousand times."""

from __future__ import annotations

import math

from rverror.base.arrays import Array
from rverror.base.compiled import compiled, inlined


@inlined
def _value(coefficients: Array, ahead: float) -> float:
    """Polynomial, the highest power first."""
    found = 0.0
    for coefficient in coefficients:
        found = found * ahead + coefficient
    return found


@compiled
def rates(
    state: Array,
    theta: float,
    speed: float,
    acceleration: float,
    rows: Array,
    period: float,
    centrifugal: Array,
    turning: Array,
    found: Array,
) -> None:
    """Find rates and accelerations of y'' + (C + Omega G) y' + (K + Omega^2 S + Omega' G / 2) y = Omega^2 f + Omega' g.

    Parameters
    ----------
    state : ndarray, shape (2 m,)
        Coordinates and their rates.
    theta, speed, acceleration : float
        rad, rad/s, rad/s^2.
    rows : ndarray, shape (intervals, 2 m^2 + 2 m, degree + 1)
        Of K, C, f and g: polynomials of the angle since the begin of each even interval of a period.
    period : float
        rad.
    centrifugal, turning : ndarray, shape (m, m)
        S and G.
    found : ndarray, shape (2 m,)
        Overwritten.
    """
    m, count = len(turning), len(rows)
    place = (theta / period - math.floor(theta / period)) * count
    at = min(int(place), count - 1)
    ahead, forces = (place - at) * period / count, 2 * m * m
    for i in range(m):
        force = speed**2 * _value(rows[at, forces + i], ahead)
        force += acceleration * _value(rows[at, forces + m + i], ahead)
        for j in range(m):
            stiffness = _value(rows[at, m * i + j], ahead)
            stiffness += speed**2 * centrifugal[i, j] + acceleration / 2 * turning[i, j]
            damping = _value(rows[at, m * (m + i) + j], ahead) + speed * turning[i, j]
            force -= stiffness * state[j] + damping * state[m + j]
        found[i], found[m + i] = state[m + i], force
