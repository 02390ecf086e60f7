"""Rates of a motion in time, compiled: a second of motion asks for them some twenty thousand times."""

from __future__ import annotations

import numpy as np

from rverror.base.arrays import Array
from rverror.base.compiled import compiled, inlined


@inlined
def _value(coefficients: Array, at: int, row: int, ahead: float) -> float:
    """Polynomial of one row in one interval."""
    found = 0.0
    for power in range(len(coefficients)):
        found = found * ahead + coefficients[power, at, row]
    return found


@compiled
def rates(
    state: Array,
    course: Array,
    period: float,
    forces: Array,
    matrices: Array,
    centrifugal: Array,
    turning: Array,
    found: Array,
) -> None:
    """Find rates and accelerations of y'' + (C + Omega G) y' + (K + Omega^2 S + Omega' G / 2) y = f.

    Parameters
    ----------
    state : ndarray, shape (2 m,)
        Coordinates and their rates.
    course : ndarray, shape (4,)
        Angle theta, rad, speed Omega, rad/s, acceleration Omega', rad/s^2, and load.
    period : float
        rad.
    forces : ndarray, shape (degree + 1, intervals, 3 m)
        As of `Periodic`: force per speed squared, per acceleration, and per load.
    matrices : ndarray, shape (degree + 1, intervals, 2 m^2)
        Likewise: stiffness K and damping C.
    centrifugal, turning : ndarray, shape (m, m)
        S and G.
    found : ndarray, shape (2 m,)
        Overwritten.
    """
    m, theta, speed, acceleration, load = len(turning), course[0], course[1], course[2], course[3]
    place = theta / period - np.floor(theta / period)
    at = min(int(place * forces.shape[1]), forces.shape[1] - 1)
    ahead = (place - at / forces.shape[1]) * period
    among = min(int(place * matrices.shape[1]), matrices.shape[1] - 1)
    along = (place - among / matrices.shape[1]) * period
    for i in range(m):
        force = speed**2 * _value(forces, at, i, ahead) + acceleration * _value(forces, at, m + i, ahead)
        force += load * _value(forces, at, 2 * m + i, ahead)
        for j in range(m):
            stiffness = _value(matrices, among, m * i + j, along)
            stiffness += speed**2 * centrifugal[i, j] + acceleration / 2.0 * turning[i, j]
            damping = _value(matrices, among, m * (m + i) + j, along) + speed * turning[i, j]
            force -= stiffness * state[j] + damping * state[m + j]
        found[i], found[m + i] = state[m + i], force
