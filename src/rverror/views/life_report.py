"""What runs over a unit's life say: a trend, two measurements compared."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

from rverror.base.numbers import brief, count_of, rounded
from rverror.base.text import describe
from rverror.base.units import ARCSEC, DISPLAY_UNITS
from rverror.life.result import Changed, Grown, RunsCompared, Trend
from rverror.lots.result import Interval
from rverror.views.blocks import Sentence, Sheet, line, notes, title
from rverror.views.describing import content, sheet, table
from rverror.views.fields import (
    OWN,
    Column,
    Field,
    about,
    alike,
    arrays,
    entry,
    for_people,
    in_json,
    in_table,
    listing,
    rows,
    sized,
)
from rverror.views.model_report import inside
from rverror.views.variables import ANGLE, NUMBER, Table, Variable

_LACKING = 0.001  # chance below which what is left is more than noise
_NAMED = 4  # rivals


def _each(changed: Sequence[Changed]) -> list[tuple[Changed, Grown]]:
    """Causes with each of their parameters."""
    return [(one, grown) for one in changed for grown in one.parameters]


def _name(row: tuple[Changed, Grown]) -> str:
    return describe(row[0].key, row[0].indices)


def _unit(row: tuple[Changed, Grown]) -> str:
    return DISPLAY_UNITS[row[1].dimension]


_CHANGED = (
    Column("source", _name, head="cause"),
    Column("key", "0.key"),
    Column("indices", lambda row: inside(row[0].indices)),
    Column("parameter", "1.name", head="parameter"),
    Column("course", "0.course"),
    Column("since", ("0.since", NUMBER)),
    *sized("size", OWN, "1.change", keys=("change", "change_interval"), head="by"),
    Column("", _unit, head="unit"),
    Column("evidence", ("0.evidence", NUMBER)),
)
_ORDER = (
    Column("order", NUMBER),
    Column("", "order", "order", "order"),
    Column("condition", key="condition", head="condition"),
    Column("before", ANGLE, "before", "before, arcsec"),
    Column("after", ANGLE, "after"),
    Column("", ("interval.value", ANGLE), head="after, arcsec"),
    Column("low", ("interval.low", ANGLE)),
    Column("high", ("interval.high", ANGLE)),
    Column("", ("interval", ANGLE), "interval", "95 % interval"),
    Column("difference", ANGLE, "difference"),
    Column("chance", NUMBER, "chance", "chance"),
)


# --- tables -----------------------------------------------------------------------------------------------------------


@table.register
def _trend_table(result: Trend) -> Table:
    variables = {
        **_changes(result.changed),
        **arrays("session", result, at=NUMBER),
        **arrays("session run", result, peak_to_peak=ANGLE),
        **arrays("session load", result, lost_motion=ANGLE, explained=ANGLE),
    }
    told = about(result, "model", "conditions", "chance", "notes", time_unit=result.unit)
    return Table("Trend", "change", variables, told)


@table.register
def _compared_table(result: RunsCompared) -> Table:
    orders = rows("order", result.orders, **in_table(_ORDER))
    told = about(result, "conditions", "noise", "notes")
    return Table("RunsCompared", "order", {**orders, **_changes(result.changed)}, told)


def _changes(changed: Sequence[Changed]) -> dict[str, Variable]:
    """Parameters of causes that changed, a row for each."""
    return rows("change", _each(changed), "", ("change_unit", "1.dimension"), **in_table(_CHANGED))


# --- for programs -----------------------------------------------------------------------------------------------------


@content.register
def _trend_content(result: Trend) -> dict[str, Any]:
    """None where something is not determined."""
    left, per = result.remaining, result.unit
    time = None if left is None or left.time is None else left.time
    growing = {
        **in_json(_CHANGED),
        **alike(None, "course", within="0."),
        f"rate_per_{per}": ("1.rate.value", OWN),
        "interval": ("1.rate", OWN),
        "since": ("0.since", NUMBER),
        "since_interval": (lambda row: (row[0].earliest, row[0].latest), NUMBER),
        "time_constant": (lambda row: row[0].settling or None, NUMBER),
    }
    jumps: dict[str, Field] = {
        "at": ("0.since", NUMBER),
        "size": ("1.change.value", OWN),
        "interval": ("1.change", OWN),
    }
    return {
        **entry(result, model=None, time_unit="unit", sessions=("at", NUMBER), conditions=None, chance=NUMBER),
        "growing": [_changed(row, **growing) for row in _each(result.growing)],
        "jumps": [_changed(row, **jumps) for row in _each(result.jumps)],
        f"remaining_{per}s": None if time is None else [rounded(end) for end in (time.low, time.high)],
        "limit": left and entry(left, quantity=None, limit_arcsec=("limit", ANGLE), now_arcsec=("now", ANGLE)),
        **entry(
            result,
            peak_to_peak_arcsec=("peak_to_peak", ANGLE),
            lost_motion_arcsec=("lost_motion", ANGLE),
            notes=None,
        ),
    }


@content.register
def _compared_content(result: RunsCompared) -> dict[str, Any]:
    orders = [{"unit": DISPLAY_UNITS["angle"], **entry(one, **in_json(_ORDER))} for one in result.orders]
    causes = [
        {"before": 0.0, **_changed(row, after=("1.change.value", OWN), interval=("1.change", OWN))}
        for row in _each(result.changed)
    ]
    told = entry(result, conditions=None, noise_arcsec=("noise", ANGLE), notes=None)
    return {**told, "changed": orders + causes}


def _changed(row: tuple[Changed, Grown], **fields: Field) -> dict[str, Any]:
    """Cause, parameter, what changed, and what would do as well."""
    one, grown = row
    place = entry(row, key="0.key", indices="0.indices", parameter="1.name")
    return {
        **place,
        "unit": DISPLAY_UNITS[grown.dimension],
        **entry(row, grown.dimension, **fields, measuring="0.measuring", evidence=("0.evidence", NUMBER)),
        "indistinguishable_from": [{"key": key, "indices": dict(indices)} for key, indices in one.rivals],
    }


# --- for people -------------------------------------------------------------------------------------------------------


@sheet.register
def _trend_sheet(thing: Trend) -> Sheet:
    hours = f"{thing.unit}s"
    heads: dict[str, Field] = {
        "grows": _name,
        "parameter": "1.name",
        "course": "0.course",
        "since": "0.since",
        "change": ("1.change.value", OWN),
        "95 % interval": ("1.change", OWN),
        f"per 1000 {hours}": (lambda row: _per_thousand(row).value, OWN),
        "95 % interval of it": (_per_thousand, OWN),
        "unit": _unit,
    }
    return (
        *title(
            "Trend",
            thing.model,
            f"{count_of(len(thing.at), 'session')}, {brief(thing.at[0])} to {brief(thing.at[-1])} {hours}",
        ),
        *line(f"Conditions: {'; '.join(thing.conditions)}" if thing.conditions else ""),
        Sentence(*_trend_verdict(thing)),
        *listing(_each(thing.growing), heads, own="1.dimension"),
        *_jumped({"jump at": "0.since"}, thing.jumps),
        *map(Sentence, _rivals(thing.changed)),
        *(line(remaining_words(thing)) if thing.remaining else ()),
        *notes(thing.notes),
    )


def _per_thousand(row: tuple[Changed, Grown]) -> Interval:
    rate = row[1].rate
    return Interval(1000 * rate.value, 1000 * rate.low, 1000 * rate.high)


@sheet.register
def _compared_sheet(thing: RunsCompared) -> Sheet:
    orders = len({one.order for one in thing.orders})
    strong = f"{count_of(orders, 'order')} {'differs' if orders == 1 else 'differ'}" if orders else "No order differs"
    return (
        *title("Runs compared", "; ".join(thing.conditions)),
        Sentence(f"{strong} beyond noise of {brief(thing.noise / ARCSEC, 2)} arcsec an order", strong),
        *listing(thing.orders, for_people(_ORDER)),
        *_jumped({}, thing.changed),
        *map(Sentence, _rivals(thing.changed)),
        *notes(thing.notes),
    )


def _jumped(first: dict[str, Field], changed: Sequence[Changed]) -> Sheet:
    """Causes that are another size at once, behind the time of each where there is a head for it."""
    return listing(_each(changed), {**first, **for_people(_CHANGED)}, own="1.dimension")


def _trend_verdict(trend: Trend) -> tuple[str, str]:
    """What grows and jumped, and the words of it to be read first."""
    if not trend.changed:
        strong = "Nothing has changed"
        rest = "beyond noise" if trend.chance >= _LACKING else "that a cause explains, yet sessions differ beyond noise"
        return f"{strong} {rest} (chance {brief(trend.chance, 2)})", strong
    grows, jumped = len(trend.growing), len(trend.jumps)
    parts = [f"{count_of(grows, 'cause')} {'grows' if grows == 1 else 'grow'}"] if grows else []
    parts += [count_of(jumped, "jump")] if jumped else []
    strong = " and ".join(parts)
    left = (
        f"what is left between sessions is noise (chance {brief(trend.chance, 2)})"
        if trend.chance >= _LACKING
        else f"more than noise is left between sessions (chance {brief(trend.chance, 2)}): the model lacks something"
    )
    return f"{strong}; {left}", strong


def _rivals(changed: Sequence[Changed]) -> Iterator[str]:
    """A sentence for each cause that others would replace, and one for each that is of the bench."""
    for one in changed:
        name = describe(one.key, one.indices)
        if one.measuring:
            yield f"{name} is of the measuring chain, not of the unit"
        if one.rivals:
            others = [describe(key, dict(indices)) for key, indices in one.rivals]
            more = f" and {len(others) - _NAMED} more" if len(others) > _NAMED else ""
            yield f"{name} is not told apart from {', '.join(others[:_NAMED])}{more}"


def remaining_words(trend: Trend) -> str:
    """How long the limit is met."""
    left = trend.remaining
    assert left is not None
    name, now, most = left.quantity.replace("_", " "), left.now / ARCSEC, left.limit / ARCSEC
    what = f"{name} {brief(now, 3)} arcsec now, limit {brief(most, 3)}"
    if left.time is None:
        return f"{what}: nothing that grows is known to reach it, so the time that remains is not to be told"
    times = left.time.low, left.time.value, left.time.high
    low, middle, high = ("no end" if math.isinf(t) else brief(float(f"{t:.3g}"), 3) for t in times)
    some = "" if math.isinf(left.time.value) else f"some {middle} "
    longer = left.time.low / (trend.at.max() - trend.at.min())
    beyond = f"; that is {brief(longer, 2)} times as long as was measured, or more" if longer > 1 else ""
    return f"{what}: reached in {some}{trend.unit}s from the last session on (95 %: {low} to {high}){beyond}"
