"""What runs over a unit's life say: a trend, two measurements compared."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import astuple
from typing import Any

from rverror.base.numbers import brief, count_of, rounded
from rverror.base.text import describe
from rverror.base.units import ARCSEC
from rverror.life.result import Changed, Grown, RunsCompared, Trend
from rverror.lots.result import Interval
from rverror.views.blocks import some_of
from rverror.views.describing import described, entries
from rverror.views.fields import OWN, OWN_NAME, Field, about, arrays, entry, rows, same_unit, sized
from rverror.views.shown_units import ANGLE, HOURS, NUMBER, Unit
from rverror.views.variables import Table, Variable

_LACKING = 0.001  # chance below which what is left is more than noise
_SHOWN = ("source", "parameter", "course", "since", "size", "size_interval", "unit")


def _each(changed: Sequence[Changed]) -> list[tuple[Changed, Grown]]:
    """Causes with each of their parameters."""
    return [(one, grown) for one in changed for grown in one.parameters]


# --- tables -----------------------------------------------------------------------------------------------------------


@described.register
def _trend_table(result: Trend) -> Table:
    per = f"per_1000_{result.unit}s"
    variables = {
        **_changes(result.changed, HOURS if result.unit == "hour" else NUMBER),
        **rows(
            "change",
            [(grown, Interval(*(1000 * end for end in astuple(grown.rate)))) for _, grown in _each(result.changed)],
            "",
            ("change_unit", "0.dimension"),
            **sized(per, OWN, "1"),
        ),
        **arrays("session", result, at=NUMBER),
        **arrays("session run", result, peak_to_peak=ANGLE),
        **arrays("session load", result, lost_motion=ANGLE, explained=ANGLE),
        **arrays("", result.remaining, limit=ANGLE, now=ANGLE),
    }
    sessions = count_of(len(result.at), "session")
    span = f"{sessions}, {brief(result.at[0])} to {brief(result.at[-1])} {result.unit}s"
    remains = (remaining_words(result),) if result.remaining else ()
    return Table(
        variables,
        about(result, "model", "conditions", "chance", "notes", time_unit=result.unit),
        title=(result.model, span),
        verdict=_trend_verdict(result),
        facts={"conditions": "; ".join(result.conditions)},
        sentences=(*_rivals(result.changed), *remains),
        shown={"change": (*_SHOWN, per, f"{per}_interval"), "session": (), "": ()},
    )


@described.register
def _compared_table(result: RunsCompared) -> Table:
    after = sized("after", ANGLE, "interval")
    variables = {
        **rows("order", result.orders, order=NUMBER, condition=None, before=ANGLE, **after),
        **rows("order", result.orders, difference=ANGLE, chance=NUMBER),
        **_changes(result.changed),
    }
    orders = len({one.order for one in result.orders})
    strong = f"{count_of(orders, 'order')} {'differs' if orders == 1 else 'differ'}" if orders else "No order differs"
    return Table(
        variables,
        about(result, "conditions", "noise", "notes"),
        title=("; ".join(result.conditions),),
        verdict=(strong, f" by more than the noise, {brief(result.noise / ARCSEC, 2)} arcsec per order."),
        sentences=tuple(_rivals(result.changed)),
        shown={"change": [name for name in _SHOWN if name not in ("course", "since")]},
    )


def _changes(changed: Sequence[Changed], since: Unit = NUMBER) -> dict[str, Variable]:
    """Parameters of causes that changed, a row for each."""
    return rows(
        "change",
        _each(changed),
        "",
        ("change_unit", "1.dimension"),
        source=lambda row: describe(row[0].key, row[0].indices),
        key="0.key",
        indices="0.indices",
        parameter="1.name",
        course="0.course",
        since=("0.since", since),
        **sized("size", OWN, "1.change"),
        evidence=("0.evidence", NUMBER),
    )


# --- for programs -----------------------------------------------------------------------------------------------------


@entries.register
def _trend_content(result: Trend) -> dict[str, Any]:
    """None where something is not determined."""
    left, per = result.remaining, result.unit
    time = None if left is None or left.time is None else left.time
    growing: dict[str, Field] = {
        "course": "0.course",
        f"rate_per_{per}": ("1.rate.value", OWN),
        "interval": ("1.rate", OWN),
        "since": ("0.since", NUMBER),
        "since_interval": (lambda row: (row[0].earliest, row[0].latest), NUMBER),
        "time_constant": (lambda row: row[0].settling or None, NUMBER),
    }
    return {
        "growing": [_changed(row, **growing) for row in _each(result.growing)],
        "jumps": [
            _changed(row, at=("0.since", NUMBER), size=("1.change.value", OWN), interval=("1.change", OWN))
            for row in _each(result.jumps)
        ],
        f"remaining_{per}s": None if time is None else [rounded(end) for end in (time.low, time.high)],
    }


@entries.register
def _compared_content(result: RunsCompared) -> dict[str, Any]:
    orders = [
        entry(
            one,
            order=None,
            condition=None,
            **same_unit(ANGLE, "before", "after", "interval", "difference"),
            chance=NUMBER,
        )
        for one in result.orders
    ]
    causes = [
        {"before": 0.0, **_changed(row, after=("1.change.value", OWN), interval=("1.change", OWN))}
        for row in _each(result.changed)
    ]
    return {"changed": orders + causes}


def _changed(row: tuple[Changed, Grown], **fields: Field) -> dict[str, Any]:
    """Cause, parameter, what changed, and what would do as well."""
    one, grown = row
    place: dict[str, Field] = {"key": "0.key", "indices": "0.indices", "parameter": "1.name", "unit": OWN_NAME}
    return {
        **entry(row, grown.dimension, **place, **fields, measuring="0.measuring", evidence=("0.evidence", NUMBER)),
        "indistinguishable_from": [{"key": key, "indices": dict(indices)} for key, indices in one.rivals],
    }


# --- for people -------------------------------------------------------------------------------------------------------


def _trend_verdict(trend: Trend) -> tuple[str, str]:
    """What grows and jumped."""
    chance = f"(p = {brief(trend.chance, 2)})"
    if not trend.changed:
        rest = "beyond noise" if trend.chance >= _LACKING else "that a cause explains, yet sessions differ beyond noise"
        return "Nothing has changed", f" {rest} {chance}."
    grows, jumped = len(trend.growing), len(trend.jumps)
    parts = [f"{count_of(grows, 'cause')} {'grows' if grows == 1 else 'grow'}"] if grows else []
    parts += [count_of(jumped, "jump")] if jumped else []
    if trend.chance >= _LACKING:
        return " and ".join(parts), f"; what is left between sessions is noise {chance}."
    return " and ".join(parts), f"; more than noise is left between sessions {chance}: the model lacks something."


def _rivals(changed: Sequence[Changed]) -> Iterator[str]:
    """A sentence for each cause that others would replace, and one for each that is of the bench."""
    for one in changed:
        name = describe(one.key, one.indices)
        if one.measuring:
            yield f"{name} is an error of the measuring chain, not of the unit."
        if one.rivals:
            others = some_of([describe(key, dict(indices)) for key, indices in one.rivals])
            yield f"These measurements cannot tell {name} from {others}."


def remaining_words(trend: Trend) -> str:
    """How long the limit is met."""
    left = trend.remaining
    assert left is not None
    name, now, most = left.quantity.replace("_", " "), left.now / ARCSEC, left.limit / ARCSEC
    what = f"{name.capitalize()}: {brief(now, 3)} arcsec now, limit {brief(most, 3)} arcsec."
    if left.time is None:
        return f"{what} Nothing that grows is known to reach it: the time that remains is not determined."
    low, middle, high = (brief(float(f"{t:.3g}"), 3) for t in (left.time.low, left.time.value, left.time.high))
    if math.isinf(left.time.value):
        when = f"at the earliest {low} {trend.unit}s after the last session (95 %)"
    else:
        ends = f"{low} or more" if math.isinf(left.time.high) else f"{low} to {high}"
        when = f"about {middle} {trend.unit}s after the last session (95 % interval: {ends})"
    longer = left.time.low / (trend.at.max() - trend.at.min())
    beyond = f" That is at least {brief(longer, 2)} times the time measured so far." if longer > 1 else ""
    return f"{what} It is reached {when}.{beyond}"
