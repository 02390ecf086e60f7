"""Whole revolutions of a run, their order spectrum, and the noise between repeats."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rverror.base.arrays import Array
from rverror.geartrain.kinematics import fundamental_orders
from rverror.geartrain.mechanism import Drive, Reducer
from rverror.runs.order_table import Waves

_TURN = 2 * math.pi
_MOST_MULTIPLE = 30
_SAMPLED = 0.95  # of the Nyquist order: a wave of nearly two samples is a beat that uneven steps tear apart


def revolutions(theta: Array, values: Array, *, turns: int = 1) -> tuple[Array, Array] | None:
    """Cut a run into whole periods, two or more; None where there are fewer.

    Samples that already lie on an even grid that fits the period are only reshaped; others are interpolated linearly
    onto one of as many points.

    Parameters
    ----------
    theta : ndarray, shape (n,)
        Nominal output angle, rad, in one direction.
    values : ndarray, shape (n,)
        The signal.
    turns : int
        Output turns after which the drive stands as before.

    Returns
    -------
    theta : ndarray, shape (n,)
        Nominal output angle of the first period, rad, growing.
    values : ndarray, shape (periods, n)
        The signal of each period; samples beyond the last whole one are left out.
    """
    order = np.argsort(theta, kind="stable")
    angle, signal = theta[order], values[order]
    period = turns * _TURN
    step = (angle[-1] - angle[0]) / (angle.size - 1)
    count = int((angle[-1] - angle[0] + 1.5 * step) / period)
    if count < 2:
        return None
    points = round(period / step)
    grid = angle[0] + period / points * np.arange(points)
    used = count * points
    even = angle[0] + period / points * np.arange(used)
    if used <= angle.size and np.abs(angle[:used] - even).max() < 1e-3 * step:
        return grid, signal[:used].reshape(count, points)
    # the last point lies beyond the last sample by half a step at most, and takes its value
    unique, first = np.unique(angle, return_index=True)
    return grid, np.interp(even, unique, signal[first]).reshape(count, points)


def even_travel(theta: Array, values: Array) -> tuple[Array, Array]:
    """A signal at even angles over the whole turns of a run, or over its travel where that is less than a turn.

    Parameters
    ----------
    theta : ndarray, shape (n,)
        Angle in order of time, rad, of one pass or several, which are averaged.
    values : ndarray, shape (n,)

    Returns
    -------
    theta, values : ndarray, shape (m,)
        Growing; m steps make the whole turns, or the travel and one step more.

    Examples
    --------
    >>> theta = np.arange(250) * 2 * np.pi / 100
    >>> [row.size for row in even_travel(theta, np.cos(theta))]
    [200, 200]
    """
    steps, travel = np.abs(np.diff(theta)), float(np.ptp(theta))
    step = float(np.median(steps[steps > 0]))
    turns = math.floor((travel + 1.5 * step) / _TURN)
    span = turns * _TURN if turns else travel + step
    points = round(span / step)
    nearest = np.floor((theta - theta.min()) / span * points + 0.5).astype(np.intp)
    inside = nearest < points
    count = np.bincount(nearest[inside], minlength=points)
    total = np.bincount(nearest[inside], values[inside], points)
    at = np.arange(points)
    return theta.min() + span / points * at, np.interp(at, at[count > 0], total[count > 0] / count[count > 0])


def harmonics(values: Array) -> Waves:
    """Waves of rows of one period, without mean and Nyquist line.

    Parameters
    ----------
    values : ndarray, shape (..., n)
        Rows over one period.

    Returns
    -------
    ndarray of complex, shape (..., m), m = (n - 1) // 2
        z of harmonic k = 1 to m: a row holds Re(z exp(2 pi i k j / n)) at sample j.
    """
    n = values.shape[-1]
    return np.asarray(np.fft.rfft(values, axis=-1)[..., 1 : (n + 1) // 2] * 2 / n, dtype=np.complex128)


def noise_spectrum(values: Array) -> Array:
    """Power of the noise at each harmonic, from what differs between periods: its variance where it is white.

    Parameters
    ----------
    values : ndarray, shape (periods, n)
        The signal of each period.

    Returns
    -------
    ndarray, shape (m,)
        Smoothed over neighbouring harmonics, a wider span at higher ones, so that coloured noise keeps its colour.
    """
    spread = values.shape[-1] / 4 * harmonics(values).var(axis=0, ddof=1)  # white noise has waves of 4 variance / n
    total = np.concatenate([[0.0], np.cumsum(spread)])
    at = np.arange(spread.size)
    half = np.clip(at // 4, 4, 40)
    low, high = np.maximum(at - half, 0), np.minimum(at + half + 1, spread.size)
    return np.asarray((total[high] - total[low]) / (high - low), dtype=np.float64)


def highest_order(angles: Sequence[Array]) -> float:
    """Order up to which every run has two samples a wave, also where it turns fastest.

    Parameters
    ----------
    angles : sequence of ndarray, shape (n,)
        Of the samples of each run, rad.

    Returns
    -------
    float
        Per turn.
    """
    steps = [np.abs(np.diff(theta)) for theta in angles]
    return _SAMPLED * min(np.pi / float(np.quantile(s[s > 0], 0.9)) for s in steps)


def frames_of_order(mechanism: Reducer | Drive, order: float, *, tolerance: float = 0.02) -> list[str]:
    """Frames whose fixed errors show at an order, as ``"housing 39 x 2"``.

    Parameters
    ----------
    order : float
        Per output turn.
    tolerance : float
        How far a measured order may lie from a multiple.

    Returns
    -------
    list of str
        Parts of the gear train whose fundamental order divides it at most thirty times, shafts of a drive, and the
        output side for orders 1 and 2; empty where none fits.
    """
    if isinstance(mechanism, Reducer):
        table = fundamental_orders(mechanism)
        groups = {
            "housing": table["housing"],
            "carrier, disc or crank": table["crank"],
            "sun": table["sun"],
            "gear mesh": table["gear mesh"],
            "cycloid mesh": table["cycloid mesh"],
            "input shaft": abs(mechanism.ratio),
        }
    else:
        groups = {"input shaft": abs(mechanism.ratio)} | {n: abs(v) for n, v in mechanism.shafts.items()}
    found = []
    if min(abs(order - 1), abs(order - 2)) <= tolerance:
        found.append("output side (encoder, coupling)")
    for name, base in groups.items():
        multiple = round(order / base)
        if 1 <= multiple <= _MOST_MULTIPLE and abs(order - multiple * base) <= tolerance:
            found.append(f"{name} {base:g} x {multiple}" if multiple > 1 else f"{name} {base:g}")
    return found
