"""Checks of a run: rows without a number, time, angles kept within one turn, gaps, direction of motion."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from rverror.base.arrays import Array, Flags
from rverror.base.numbers import count_of, way
from rverror.geartrain.kinematics import motion_direction
from rverror.runs.reading import Reading, check_needed

#: Fewest usable samples of a run.
LEAST_SAMPLES = 16
#: Largest share of rows without a number that is left out; a run with more is refused.
MOST_UNUSABLE = 0.1
#: A step longer than this many median steps is a gap.
GAP = 3.0
#: A step of so many median steps while the other angle makes no gap is a jump of a counter, unless there are many.
JUMP = 10.0
MOST_JUMPS = 20

# Angles beyond this are no reading of an encoder, and their products overflow.
_LARGEST = 1e15


def checked(reading: Reading, ratio: float | None) -> tuple[Reading, Array]:
    """Leave out what cannot be used, count it in the notes, and find the direction of motion.

    Parameters
    ----------
    ratio : float, optional
        Input turns per output turn; its sign tells the direction of a run of input angle and error.

    Returns
    -------
    reading : Reading
        Usable rows, angles unwrapped.
    direction : ndarray, shape (n,)
        +1 or -1.

    Raises
    ------
    InputError
        If the run cannot be used.
    """
    notes = list(reading.notes)
    check_needed(reading.path, "columns", list(reading.columns))
    reading = _without_doubles(_usable_rows(reading, notes), notes)
    columns = dict(reading.columns)
    time = columns.get("time")
    if time is not None:
        _check_time(reading, time, notes)
    for name in ("input_angle", "output_angle"):
        if name in columns:
            columns[name] = _unwrapped(reading, name, columns[name], notes)
    leading = "input_angle" if "input_angle" in columns else "output_angle"
    jumped = _note_counters(reading, columns, notes)
    if leading in jumped and "output_angle" not in jumped:
        leading = "output_angle"  # the other tells the direction
    if time is not None:
        _note_gaps(reading, "time", time, "s", notes)
    elif leading not in jumped:
        _note_gaps(reading, leading, np.rad2deg(columns[leading]), "deg", notes)
    sense, sure = _sense(columns, ratio, jumped) if leading == "input_angle" else (1.0, True)
    direction = _direction(reading, leading, sense * columns[leading], sure=sure, notes=notes)
    return replace(reading, columns=columns, notes=tuple(notes)), direction


def _usable_rows(reading: Reading, notes: list[str]) -> Reading:
    usable = np.logical_and.reduce([np.abs(values) < _LARGEST for values in reading.columns.values()])  # false for NaN
    dropped = int(np.count_nonzero(~usable))
    if dropped:
        where = reading.listed(~usable)
        if dropped > MOST_UNUSABLE * usable.size:
            reading.refuse(
                f"{dropped} of {usable.size} rows hold no number in a needed column {where}, at most "
                f"{100 * MOST_UNUSABLE:.0f} % may be left out; repair or export the file again",
            )
        notes.append(f"{count_of(dropped, 'row')} without a number left out {where}")
    count = int(np.count_nonzero(usable))
    if count < LEAST_SAMPLES:
        reading.refuse(f"{count} usable samples; {LEAST_SAMPLES} or more are needed: measure a longer run")
    return _picked(reading, usable)


def _without_doubles(reading: Reading, notes: list[str]) -> Reading:
    """Leave out rows that repeat the one before in every column: they add weight, not knowledge."""
    table = np.stack(list(reading.columns.values()))
    new = np.concatenate([[True], (np.diff(table) != 0).any(axis=0)])
    count = int(np.count_nonzero(~new))
    if not count or np.count_nonzero(new) < LEAST_SAMPLES:  # a standstill is refused as such
        return reading
    notes.append(f"{count_of(count, 'doubled row')} left out {reading.listed(~new)}")
    return _picked(reading, new)


def _picked(reading: Reading, rows: Flags) -> Reading:
    columns = {name: values[rows] for name, values in reading.columns.items()}
    return replace(reading, columns=columns, labels=reading.labels[rows])


def _check_time(reading: Reading, time: Array, notes: list[str]) -> None:
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0)
    if back.size:
        reading.refuse(
            f"{reading.at(back[0] + 1)}: time runs back from {time[back[0]]:.9g} s to {time[back[0] + 1]:.9g} s; "
            "put the rows in order, and each run in a file of its own",
        )
    repeated = np.flatnonzero(steps == 0)
    if repeated.size == steps.size:
        reading.refuse(f"time stands still at {time[0]:.9g} s; leave the column out or repair it")
    if repeated.size:
        listed = reading.listed(repeated + 1)
        notes.append(f"{count_of(repeated.size, 'repeated time stamp')} {listed}")


def _unwrapped(reading: Reading, name: str, angle: Array, notes: list[str]) -> Array:
    """Undo the jumps of an angle that is kept within one turn."""
    jumps = np.abs(np.diff(angle)) > np.pi
    if not jumps.any() or np.ptp(angle) > 2 * np.pi * (1 + 1e-9):
        return angle
    whole = np.unwrap(angle)
    steps = np.abs(np.diff(whole))
    if not (steps[jumps] <= 10 * np.median(steps[steps > 0]) if steps.any() else jumps).any():
        return angle  # a gap, not a jump by a whole turn
    if np.median(steps) > np.pi / 2:
        reading.refuse(
            f"{name} stays within one turn and moves {np.rad2deg(np.median(steps)):.0f} deg between samples, at most "
            "90 deg can be unwrapped safely; write the angle that counts turns, or sample more often"
        )
    notes.append(f"{name} unwrapped: {count_of(int(np.count_nonzero(jumps)), 'jump')} by a turn removed")
    return np.asarray(whole, dtype=np.float64)


def _note_counters(reading: Reading, columns: Mapping[str, Array], notes: list[str]) -> set[str]:
    """Angles whose counter jumps in one step while the other angle goes on as before."""
    if not {"input_angle", "output_angle"} <= columns.keys():
        return set()
    jumped = set()
    steps = {name: np.diff(columns[name]) for name in ("input_angle", "output_angle")}
    usual = {name: float(np.median(np.abs(each[each != 0]))) if each.any() else 0.0 for name, each in steps.items()}
    for name, other in (("input_angle", "output_angle"), ("output_angle", "input_angle")):
        alone = (np.abs(steps[name]) > JUMP * usual[name]) & (np.abs(steps[other]) < GAP * usual[other])
        places = np.flatnonzero(alone)
        if 0 < places.size <= MOST_JUMPS:
            jumped.add(name)
            first = int(places[0])
            around = np.delete(steps[name][max(first - 3, 0) : first + 4], min(first, 3))
            size = np.rad2deg(steps[name][first] - np.median(around))
            oftener = f", and {places.size - 1} times more" if places.size > 1 else ""
            notes.append(
                f"{name} jumps by {size:.4g} deg at {reading.at(first + 1)}{oftener}, {other} does not: its counter "
                "has jumped"
            )
    return jumped


def _note_gaps(reading: Reading, name: str, values: Array, unit: str, notes: list[str]) -> None:
    steps = np.abs(np.diff(values))
    if not steps.any():
        return
    median = float(np.median(steps[steps > 0]))
    gaps = np.flatnonzero(steps > GAP * median * (1 + 1e-9))
    if gaps.size:
        longest = gaps[np.argmax(steps[gaps])]
        notes.append(
            f"{count_of(gaps.size, 'gap')} in {name} (step above {GAP:g} times the median of {median:.4g} {unit}; "
            f"the longest, {steps[longest]:.4g} {unit}, after {reading.at(longest)})"
        )


def fitted_slope(x: Array, y: Array) -> float:
    """Least-squares slope of y over x; 0 where x does not move.

    Examples
    --------
    >>> fitted_slope(np.array([0.0, 1.0, 2.0]), np.array([5.0, 7.0, 9.0]))
    2.0
    """
    x = x - np.mean(x)
    power = float(x @ x)
    return float(x @ y) / power if power > 0 else 0.0


def _sense(columns: Mapping[str, Array], ratio: float | None, jumped: set[str]) -> tuple[float, bool]:
    """Sign that turns the leading angle into one that grows with theta, and whether it is known."""
    if "output_angle" in columns:
        # The measured sign, not the model's: a ratio of the wrong sign is refused later, by name.
        slope = fitted_slope(columns["input_angle"], columns["output_angle"])
        if jumped:  # steps know it all the same
            slope = float(np.median(np.diff(columns["input_angle"]) * np.diff(columns["output_angle"])))
        return (-1.0 if slope < 0 else 1.0), True
    return (1.0, False) if ratio is None else (float(np.sign(ratio)), True)


def _direction(reading: Reading, name: str, angle: Array, *, sure: bool, notes: list[str]) -> Array:
    reach = float(np.ptp(angle))
    if reach == 0:
        reading.refuse(f"{name} does not move, so there is nothing to compare; give the run of a turning drive")
    steps = np.abs(np.diff(angle))
    # Less than ten typical steps back and forth is jitter of the encoder, not a reversal.
    jitter = min(10 * float(np.median(steps[steps > 0])), reach / 4)
    _check_one_run(reading, name, angle)
    stated = reading.value("direction")
    if stated:
        if sure:
            _check_direction(reading, name, angle, stated, jitter)
        return np.full(angle.size, stated)
    direction = smooth_direction(angle, jitter)
    if stated is None:
        turns = int(np.count_nonzero(np.diff(direction)))
        found = f"{turns} reversals" if turns else way(direction[0])
        notes.append(f"no direction in the header; read from {name}: {found}")
    if not sure:
        notes.append(
            "direction read from input_angle for a positive ratio; give load_run the ratio where it is negative"
        )
    return direction


def _check_one_run(reading: Reading, name: str, angle: Array) -> None:
    """Refuse an angle that jumps back in one step and goes on as before, with no gap in time that would explain it."""
    steps = np.diff(angle)
    usual = float(np.median(np.abs(steps[steps != 0])))
    back = np.flatnonzero(np.abs(steps) > JUMP * usual)
    time = reading.columns.get("time")
    if time is not None:
        passed = np.diff(time)
        back = back[passed[back] <= GAP * np.median(passed[passed > 0])]
    for i in back.tolist():
        before, after = steps[max(i - 5, 0) : i].sum(), steps[i + 1 : i + 6].sum()
        if before * after > 0 and before * steps[i] < 0:
            reading.refuse(
                f"{reading.at(i + 1)}: {name} jumps back by {np.rad2deg(abs(steps[i])):.4g} deg and "
                "goes on as before, so there are two runs in one; put each in a file of its own"
            )


def _check_direction(reading: Reading, name: str, angle: Array, stated: float, jitter: float) -> None:
    word, opposite = ("forward", "reverse") if stated > 0 else ("reverse", "forward")
    way = stated * angle
    if way[-1] < way[0]:
        verb = "falls" if stated > 0 else "grows"
        where = reading.stated["direction"][1]
        reading.refuse(
            f"{where}{': ' * bool(where)}direction says {word}, but the output angle {verb} from first to last row; "
            f"write {opposite}"
        )
    back = np.maximum.accumulate(way) - way
    worst = int(np.argmax(back))
    bound = max(jitter, 0.01 * float(np.ptp(angle)))
    if back[worst] > bound:
        turned = reading.labels[int(np.argmax(way[: worst + 1]))]
        reading.refuse(
            f"{reading.at(worst)}: direction says {word}, but {name} has gone back by "
            f"{np.rad2deg(back[worst]):.4g} deg (bound {np.rad2deg(bound):.3g} deg) since {reading.noun} {turned}; "
            "write 'mixed' or split the run"
        )


def reversals(angle: Array, jitter: float) -> tuple[list[int], int]:
    """Samples at which an angle that jitters turns back, and its last extreme.

    Parameters
    ----------
    angle : ndarray, shape (n,)
    jitter : float
        A way back counts as a reversal only where it is longer than this.

    Returns
    -------
    list of int, int
    """
    extremes: list[int] = []
    sense = low = high = 0
    values = angle.tolist()
    for i, value in enumerate(values):
        high = i if value >= values[high] else high
        low = i if value <= values[low] else low
        if sense >= 0 and values[high] - value > jitter:
            extremes += [high] if sense else []  # before the first way longer than the jitter there is no reversal
            sense, low = -1, i
        elif sense <= 0 and value - values[low] > jitter:
            extremes += [low] if sense else []
            sense, high = 1, i
    return extremes, high if sense > 0 else low if sense < 0 else angle.size - 1


def smooth_direction(angle: Array, jitter: float) -> Array:
    """Direction of motion of an angle that jitters.

    Parameters
    ----------
    angle : ndarray, shape (n,)
        rad.
    jitter : float
        A way back counts as a reversal only where it is longer than this, rad.

    Returns
    -------
    ndarray, shape (n,)
        +1 or -1, turning at the extreme itself, not where the way back has grown long enough.
    """
    extremes, last = reversals(angle, jitter)
    places = np.unique([0, *extremes, last])
    # A line through the extremes moves as the angle does, without its jitter.
    return motion_direction(np.interp(np.arange(angle.size), places, angle[places]))
