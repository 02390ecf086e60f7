"""Numbers of a bench in core units: unit, sign, scale, counts of an encoder, a counter that starts again."""

from __future__ import annotations

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import refusing
from rverror.base.numbers import count_of
from rverror.base.text import shown
from rverror.runs.bench.columns import BenchFile, Entry, RawArray, as_samples
from rverror.runs.bench.mapping import ColumnRule, meant_unit, unit_scale
from rverror.runs.reading import DIMENSIONS, UNITS

_DAY = 86400.0  # s


def core_values(file: BenchFile, key: str, rule: ColumnRule, entry: Entry, array: RawArray, notes: list[str]) -> Array:
    """Known column in its core unit.

    Parameters
    ----------
    key : str
        Name of a column of a run, like ``te``, or of an order table, like ``phase``.
    array : ndarray
        As stored.
    notes : list of str
        Gets what was assumed or changed.

    Returns
    -------
    ndarray, shape (n,)
        Core units; NaN where there is no number.

    Raises
    ------
    InputError
        If its unit is missing or contradicts the mapping, or a counter cannot be followed.
    """
    what = f"{key} ({shown(entry.name, 60)})"
    samples = as_samples(file.path, what, array, time=key == "time")
    if array.dtype.kind == "m" and file.kind == "text":
        return _over_midnight(samples, what, notes)
    if array.dtype.kind in "Mm":
        notes.append(f"time counted from the first time stamp of {shown(entry.name, 60)}")
        return samples
    factor, zero = core_scale(file, key, rule, entry, DIMENSIONS[key], UNITS[key], notes)
    if rule.wraps_at:
        samples = _without_restarts(file, key, rule.wraps_at, samples, notes)
    if rule.counts:
        size = abs(rule.factor) / units.unit_factor(UNITS[key], DIMENSIONS[key])
        notes.append(f"one count of {key} is {size:.4g} {UNITS[key]}")
    with np.errstate(over="ignore", invalid="ignore"):  # what overflows or is no number is left out later
        return samples * factor + zero


def _over_midnight(seconds: Array, what: str, notes: list[str]) -> Array:
    """Times of day as time since the first one: a step back by more than half a day is midnight."""
    valid = np.isfinite(seconds)
    of_day = seconds[valid]
    nights = np.concatenate([[0], np.cumsum(np.diff(of_day) < -_DAY / 2)])
    whole = seconds.copy()
    whole[valid] = of_day - of_day[0] + _DAY * nights
    passed = f", midnight passed {count_of(int(nights[-1]), 'time')}" if nights[-1] else ""
    notes.append(f"{what} is a time of day, counted from the first one{passed}")
    return whole


def core_scale(
    file: BenchFile, key: str, rule: ColumnRule, entry: Entry, dimension: str, unit: str, notes: list[str]
) -> tuple[float, float]:
    """Core units for one of a column's numbers, and the zero of its unit.

    Parameters
    ----------
    key : str
        Name of the column in the mapping.
    dimension : str
        Of the numbers.
    unit : str
        One of it, for messages.
    notes : list of str
        Gets what was taken from the file.

    Raises
    ------
    InputError
        If neither mapping nor file says the unit, or they say different ones.
    """
    at = f" ({rule.where.stated_at})" if rule.where.stated_at else ""
    what = f"{key} ({shown(entry.name, 60)})"
    if rule.factor:
        _check_unit(file, rule, entry, dimension, what)
        return rule.factor, rule.zero
    if not entry.unit:
        file.refuse(f'{what} has no unit{at}; write unit = "{unit}" or another beside its name')
    with refusing(f"{file.path}: {what}{at}: ", "; state the unit beside its name in the mapping"):
        factor, zero = unit_scale(entry.unit, dimension)
    notes.append(f"unit of {key} taken from the file: {entry.unit}")
    return factor * rule.sign, zero


def _check_unit(file: BenchFile, rule: ColumnRule, entry: Entry, dimension: str, what: str) -> None:
    """Refuse a mapping that says another unit of the same kind than the file does."""
    if rule.scaled or not rule.unit or not entry.unit:
        return
    try:
        said = unit_scale(meant_unit(entry.unit), dimension)
    except ValueError:
        return  # a word that says nothing here, such as V of a sensor
    if not np.allclose((abs(rule.factor), rule.zero), said, rtol=1e-9):
        file.refuse(
            f"{what} is in {rule.unit} by the mapping, but the file says {shown(entry.unit)}; correct the unit, or "
            "write scale = 1 beside it if the file is wrong"
        )


def _without_restarts(file: BenchFile, key: str, size: float, counts: Array, notes: list[str]) -> Array:
    """Undo the restarts of a counter after so many counts; those of one turn are undone later, as of any angle."""
    valid = np.isfinite(counts)
    steps = np.abs(np.diff(counts[valid]))
    usual = float(np.median(steps[steps != 0])) if steps.any() else 0.0
    if usual > size / 4:
        file.refuse(
            f"{key} moves {usual:.6g} counts between samples, at most a quarter of wraps_at = {size:.6g} can be "
            "unwrapped safely; sample more often, or use a wider counter"
        )
    if valid.any() and np.ptp(counts[valid]) > size * (1 + 1e-9):
        file.refuse(
            f"{key} covers {np.ptp(counts[valid]):.6g} counts, more than wraps_at = {size:.6g}; correct wraps_at, or "
            "leave it out"
        )
    whole = counts.copy()
    whole[valid] = np.unwrap(counts[valid], period=size)
    if jumps := int(np.count_nonzero(steps > size / 2)):
        notes.append(f"{key}: {count_of(jumps, 'restart')} of the counter by {size:.6g} removed")
    return whole
