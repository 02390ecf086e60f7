"""What is said of a simulated unit's life beside what is true, what could be seen of it, and what plain limits see."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from benchmarks.load_trial.planar import Array
from benchmarks.lot_trial.make import ARCSEC, ENCODER, SAMPLES
from benchmarks.trend_trial.make import THETA, Life
from scipy.stats import norm, t

Row = dict[str, Any]
FALSE = 0.01  # chance of an alarm in a sound unit
BASE = 6  # sessions that set the limits of a control chart
LOOK = 4  # sessions through which a line is first laid
SOURCES = 300  # instances of sources that compete for a name, about
WATCHED = (1, 2, 39, 40, 78, 80, 120, 156)  # orders that an RV-40E's maker knows of

#: Chi-square of a change at which a test of its very shape, among all sources, finds it in nine units of ten.
SEEABLE = float((norm.ppf(1 - FALSE / (2 * SOURCES)) + norm.ppf(0.9)) ** 2)


def beyond(unit: Life, sessions: int) -> float:
    """Chi-square of the true change in the noise, over the first sessions.

    Free are what stays over the sessions, a zero of each session where they do not share one, and order 1 of each
    session, alike in both directions, where the encoder is mounted anew.
    """
    waves = np.fft.fft(unit.true[:sessions], axis=2) / ARCSEC
    waves -= waves.mean(axis=0)
    free = [] if unit.truth["shared_zero"] else [0]
    for order in free + [1, -1] * unit.truth["remounted"]:
        waves[:, :, order] -= waves[:, :, order].mean(axis=1, keepdims=True)
    memory = unit.plan.memory
    density = unit.plan.noise**2 * (1 - memory**2) / np.abs(1 - memory * np.exp(-1j * THETA)) ** 2
    return float(np.sum(np.abs(waves) ** 2 / (SAMPLES * density)))


def charts(unit: Life) -> dict[str, Array]:
    """Series that plain monitors watch, arcsec, each (sessions, channels)."""
    errors = (np.radians(unit.outputs) - THETA) / ARCSEC
    waves = 2 / SAMPLES * np.abs(np.fft.rfft(errors, axis=2))[:, :, WATCHED]
    return {
        "peak_to_peak": np.ptp(errors, axis=2),
        "order": waves.reshape(len(waves), -1),
        "lost_motion": np.diff(errors.mean(axis=2), axis=1),
    }


def alarms(unit: Life) -> dict[str, dict[str, int | None]]:
    """Session at which each plain monitor has its first alarm, by limits and by a straight line."""
    return {
        name: {"limits": outside(series), "line": sloping(series, unit.hours)} for name, series in charts(unit).items()
    }


def outside(series: Array) -> int | None:
    """Session, counted from 1, that is first outside the limits that the first ones set; None if none is.

    Limits of a prediction from few values, shared among all later sessions and channels: false in `FALSE` of units.
    """
    first, later = series[:BASE], series[BASE:]
    if not later.size:
        return None
    k = t.ppf(1 - FALSE / (2 * later.size), BASE - 1) * np.sqrt(1 + 1 / BASE)
    out = np.any(np.abs(later - first.mean(axis=0)) > k * first.std(axis=0, ddof=1), axis=1)
    return BASE + 1 + int(np.argmax(out)) if out.any() else None


def sloping(series: Array, hours: Array) -> int | None:
    """Sessions, counted from the first, whose straight line over the hours first has a slope; None if never.

    As limits from the first sessions do not know that what they are set from grows already.  Shared as those are.
    """
    looks = range(LOOK, len(series) + 1)
    for count in looks:
        x, y = hours[:count] - hours[:count].mean(), series[:count] - series[:count].mean(axis=0)
        slope = x @ y / (x @ x)
        error = np.sqrt(np.sum((y - np.outer(x, slope)) ** 2, axis=0) / (count - 2) / (x @ x))
        if np.any(np.abs(slope) > t.ppf(1 - FALSE / (2 * slope.size * len(looks)), count - 2) * error):
            return count
    return None


def place(one: Mapping[str, Any]) -> tuple[str, tuple[tuple[str, str], ...]]:
    """Source and part of an entry; an index that is left out stands for all parts."""
    indices = (one.get("indices") or {}).items()
    return one["key"], tuple(sorted((name, str(value)) for name, value in indices if value != "all"))


def is_listed(entries: Iterable[Row], right: Any) -> bool:
    """Whether an entry names this source and part, or has it among those that it cannot tell from it."""
    return any(right in (place(one), *map(place, one.get("indistinguishable_from") or ())) for one in entries)


def rates(change: Row, hours: list[float]) -> dict[str, dict[str, float]]:
    """True rate of each parameter: the mean, and of what settles that at the first and at the last session too."""
    found = {"mean": change["rate_per_hour"]}
    if change["course"] == "settling":
        first = {name: size / change["tau_hours"] for name, size in change["sizes"].items()}
        left = float(np.exp(-hours[-1] / change["tau_hours"]))
        found |= {"first": first, "last": {name: left * rate for name, rate in first.items()}}
    return found


def compared(told: Row, truth: Row) -> Row:
    """Compare an answer with the truth.

    ``named``: source and part are those of the truth, in the right list; ``listed``: or among the rivals of one that is
    named, of ``rivals``; ``crossed``: in the other list; ``false``: names without the truth among them or their rivals;
    ``mounting``: jumps of an encoder that was mounted anew, which are true and count as nothing; ``held``: of the
    entries named rightly, how many intervals have the true rate, or size, of how many.  Another part of the same source
    that is named with the truth among its rivals has the true size as well, or its opposite.
    """
    growing, jumps, change = told["growing"], told["jumps"], truth["change"]
    mounting = [one for one in jumps if truth["remounted"] and one["key"] == ENCODER]
    jumps = [one for one in jumps if one not in mounting]
    every = [*growing, *jumps]
    if change is None:
        return {"false": [place(one)[0] for one in every], "mounting": len(mounting)}
    right, is_jump = place(change), change["course"] == "jump"
    mine, others = (jumps, growing) if is_jump else (growing, jumps)
    near = [one for one in mine if is_listed([one], right)]
    exact = [one for one in near if place(one) == right]
    true = {"size": change["sizes"]} if is_jump else rates(change, truth["hours"])
    sized = [one for one in near if one["key"] == change["key"] and set(one["indices"]) == set(dict(right[1]))]
    held = {name: [sum(has(one, values) for one in sized), len(sized)] for name, values in true.items()}
    if is_jump:
        low, high = change["between"]
        held["at"] = [sum(low <= float(one["at"]) <= high for one in near), len(near)]
    return {
        "named": bool(exact),
        "listed": bool(near),
        "rivals": max((len(one.get("indistinguishable_from") or ()) for one in near), default=0),
        "crossed": is_listed(others, right),
        "false": [place(one)[0] for one in every if not is_listed([one], right)],
        "mounting": len(mounting),
        "held": held,
    }


def has(one: Row, values: Mapping[str, float]) -> bool:
    """Whether the interval of an entry has the true value of its parameter, or the opposite of a part alike."""
    low, high = one["interval"]
    true = values.get(one["parameter"], 0.0)
    return bool(low <= true <= high or low <= -true <= high)
