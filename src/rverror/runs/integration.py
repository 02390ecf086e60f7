"""Angles from speeds: the integral over time, and the straight line that it leaves open."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rverror.base.arrays import Array
from rverror.base.text import shown
from rverror.runs.checks import GAP, LEAST_SAMPLES, fitted_slope
from rverror.runs.reading import SPEEDS, Reading

#: Key of a run's metadata that tells which of its angles are integrals.
INTEGRATED = "integrated"
#: Turns from which on a line is told from what repeats.
LEAST_TURNS = 2
_TURN = 2 * math.pi


def integrated(reading: Reading) -> Reading:
    """Replace each speed of a run by its integral over time, that of a cubic spline through its samples.

    Parameters
    ----------
    reading : Reading
        ``input_speed`` and ``output_speed`` in rad/s, ``time`` in s, others as they are.

    Returns
    -------
    Reading
        With angles, rad, from 0 at the first sample; its header tells which they are, and that they have no zero.

    Raises
    ------
    InputError
        If there is no time, time does not grow or has a gap, or a speed is missing: no integral goes across; or if the
        header states a zero.

    Notes
    -----
    A wave of x = omega h, h the time between samples, comes out 1 - x^4/720 as high as it is;
    `docs/theory/test-bench.md` has the derivation, and what the integral makes of noise.
    """
    columns, given = reading.columns, [name for name in SPEEDS if name in reading.columns]
    if not given:
        return reading
    listed = " and ".join(given)
    if "time" not in columns:
        reading.refuse(f"{listed}: there is no time to integrate over; name the time column in [columns]")
    if reading.index not in ("", "unknown"):
        reading.refuse(
            f"index = {shown(reading.index)}: an angle integrated from {listed} has no zero; leave index out, or write "
            "'unknown'"
        )
    _check_unbroken(reading, given, listed)
    from scipy.interpolate import CubicSpline  # loads slowly, and few runs have speeds

    found = {name: values for name, values in columns.items() if name not in SPEEDS}
    notes = list(reading.notes)
    for name in given:
        angle = CubicSpline(columns["time"], columns[name]).antiderivative()(columns["time"])
        found[SPEEDS[name]] = np.asarray(angle, dtype=np.float64)
        notes.append(f"{SPEEDS[name]} is the integral of {name} over time: its start is not known")
    line = "taken off the error is the straight line in time that an offset of a speed makes"
    if "output_angle" in found and np.ptp(found["output_angle"]) < (LEAST_TURNS - 0.01) * _TURN:
        line += f"; over less than {LEAST_TURNS} output turns some of the slow orders goes with it"
    return replace(
        reading,
        columns=found,
        index="unknown",
        metadata={**reading.metadata, INTEGRATED: ", ".join(given)},
        notes=(*notes, line),
    )


def _check_unbroken(reading: Reading, given: list[str], listed: str) -> None:
    time = reading.columns["time"]
    if time.size < LEAST_SAMPLES:
        reading.refuse(f"{time.size} samples of {listed}; {LEAST_SAMPLES} or more are needed: measure a longer run")
    for name in ("time", *given):
        if (missing := np.flatnonzero(~np.isfinite(reading.columns[name]))).size:
            where = f"{reading.at(missing[0])}: {name} holds no number"
            reading.refuse(f"{where}, and {listed} cannot be integrated across; split the run there")
    steps = np.diff(time)
    if (still := np.flatnonzero(steps <= 0)).size:
        reading.refuse(f"{reading.at(still[0] + 1)}: time does not grow, so {listed} cannot be integrated; repair it")
    usual = float(np.median(steps))
    if (long := np.flatnonzero(steps > GAP * usual * (1 + 1e-9))).size:
        reading.refuse(
            f"{reading.at(long[0] + 1)}: a gap of {steps[long[0]]:.4g} s after steps of {usual:.4g} s, at most "
            f"{GAP:g} of them: {listed} cannot be integrated across; split the run there"
        )


def without_line(error: Array, *, theta: Array, time: Array) -> Array:
    """Error less its straight line in time, about the mean: of whole output turns the line of their means.

    What repeats with the output has the same mean over each turn, so the means grow by the line alone.  Of less than
    two turns, or of a run that turns back, it is the line of least squares, which takes some of the slow orders along.

    Parameters
    ----------
    error, theta, time : ndarray, shape (n,)
        rad, rad and s.

    Returns
    -------
    ndarray, shape (n,)

    Examples
    --------
    >>> theta = np.linspace(0, 4 * np.pi, 101)
    >>> left = without_line(np.sin(theta) + 0.5 * theta, theta=theta, time=theta)
    >>> bool(np.allclose(left - left.mean(), np.sin(theta), atol=1e-3))
    True
    """
    way = np.abs(theta - theta[0])
    turns = int(way[-1] / _TURN * (1 + 1.5 / theta.size))  # a run of whole turns may end a sample before it closes
    slope = fitted_slope(time, error)
    if turns >= LEAST_TURNS and (np.diff(way) > 0).all():
        ends = np.minimum(_TURN * np.arange(turns + 1), way[-1])
        means = [_means(way, values - values[0], ends) for values in (time, error)]
        slope = fitted_slope(means[0], means[1])
    return np.asarray(error - slope * (time - time.mean()), dtype=np.float64)


def _means(way: Array, values: Array, ends: Array) -> Array:
    """Mean of values over each stretch of the way between ends."""
    sums = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(way))])
    return np.asarray(np.diff(np.interp(ends, way, sums)) / np.diff(ends), dtype=np.float64)
