"""Tolerances, stacks of them, and what an allocation makes of them: what is told of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from rverror.base import units
from rverror.base.numbers import at_input_speed, brief, rounded, with_unit
from rverror.base.units import ARCSEC
from rverror.tolerances.allocation_result import Allocation, FrontPoint
from rverror.tolerances.declared import Tolerance
from rverror.views.describing import content, content_of, table
from rverror.views.fields import OWN, Field, alike, arrays, rows
from rverror.views.variables import ANGLE, NUMBER, Each, Table, Variable, unit_of
from rverror.views.yield_report import together_entry, yield_entries, yield_words, yields

# --- tolerances -------------------------------------------------------------------------------------------------------


@table.register
def _tolerance_table(result: Tolerance) -> Table:
    return Table("Tolerance", "tolerance", _widths([result]), title=(result.label,))


def tolerances_table(result: Sequence[Tolerance]) -> Table:
    """Tolerances in a row."""
    return Table("Tolerances", "tolerance", _widths(result))


def _widths(tolerances: Sequence[Tolerance]) -> dict[str, Variable]:
    return rows(
        "tolerance",
        tolerances,
        "",
        ("unit", "chosen.0.dimension"),
        tolerance="label",
        key=None,
        width=OWN,
        distribution="distribution.name",
        correlation=NUMBER,
        classes=NUMBER,
        random_phase=None,
        fixed=None,
        least=("span.0", OWN),
        largest=("span.1", OWN),
    )


# --- allocations ------------------------------------------------------------------------------------------------------


@table.register
def _allocation_table(result: Allocation) -> Table:
    own = Each("unit", tuple(map(unit_of, result.dimensions)))
    loaded = result.verified
    rates: dict[str, Field] = {
        "saved_per_percent_of_limits_given_up": ("relax", NUMBER),
        "cost_per_percent_of_limits_gained": ("tighten", NUMBER),
    }
    stages = ("before", result.used_before, result.cost_before), ("after", result.used, result.cost)
    variables = {
        **rows(
            "stage",
            stages,
            stage="0",
            used=("1", NUMBER),
            total_cost=("2", NUMBER),
        ),
        **arrays(
            "tolerance",
            result,
            tolerance=lambda one: list(one.labels),
            width_before=("widths_before", own),
            width=("widths", own),
            cost_before=("costs_before", NUMBER),
            cost=("costs", NUMBER),
            held_by=lambda one: list(one.held_by),
            grade=lambda one: [grade or "" for grade in one.grades],
            fixed=lambda one: list(one.fixed),
        ),
        **rows("tolerance", result.rates, **rates),
        **arrays("", result, limit=ANGLE, shadow_price=NUMBER, cost_scaled_alike=("uniform_cost", NUMBER)),
        **arrays("", result.closed_form, "closed_form_", **alike(ANGLE, "value", "low", "high")),
        **({} if loaded is None else yields(loaded, [None] * len(loaded.limits))),
    }
    binds = "The limit holds some widths." if "limit" in result.held_by else "Bounds and grades alone hold the widths."
    strong = f"Cost {brief(result.cost_before)} → {brief(result.cost)}"
    shown = ("tolerance", "width_before", "width", "unit", "cost_before", "cost", "held_by", "grade", *rates)
    return Table(
        "Allocation",
        "tolerance",
        variables,
        {"limited": result.kind, "level": result.level},
        title=(f"least cost {_within(result)}",),
        verdict=(f"{strong}. {binds}", strong),
        sentences=_sentences(result),
        shown={"tolerance": shown},
    )


def _sentences(found: Allocation) -> tuple[str, ...]:
    """What is limited, what the rates are, how good the widths are."""
    check, loaded = found.closed_form, found.verified
    limits = "all limits" if found.kind == "load" else "the limit"
    told = [f"Used: share of {limits} that {_limited_by(found)} uses."]
    if found.shadow_price is not None:
        told.append(f"1 % more of {limits} would save {brief(found.shadow_price)}.")
    if any(rate.relax is not None and math.isinf(rate.relax) for rate in found.rates):
        told.append("Where infinitely much is saved, the width does not matter.")
    told += yield_words(loaded) if loaded else ()
    told.append(
        f"Closed form, contacts closed: P{100 * found.level:g} of the peak-to-peak "
        f"{with_unit(check.value, 'angle')} ({brief(check.low / ARCSEC)} to {brief(check.high / ARCSEC)})."
    )
    return tuple(told)


@content.register
def _allocation_content(found: Allocation) -> dict[str, Any]:
    speed, loaded = found.speed, found.verified
    return {
        **content_of(table(found)),
        "model": found.model or None,
        "cost_before": rounded(found.cost_before),
        "cost": rounded(found.cost),
        "input_speed_rpm": None if speed is None else rounded(units.to_display(speed, "angular_speed")),
        "verified": yield_entries(loaded) if loaded else [],
        **(together_entry(loaded) if loaded else {}),
    }


def _limited_by(found: Allocation) -> str:
    """What an allocation limits, in words."""
    quantile = f"P{100 * found.level:g} of the peak-to-peak"
    unit = f"the unit at P{100 * found.level:g}"
    return {"worst": "the worst-case peak-to-peak", "yield": quantile, "load": unit}[found.kind]


def _within(found: Allocation) -> str:
    """What an allocation is for, to stand behind "Least cost"."""
    if found.limit is None:
        return f"at which {100 * found.level:g} % of the units meet all limits at the load"
    return f"for {_limited_by(found)} within {found.limit / ARCSEC:.4g} arcsec{at_input_speed(found.speed)}"


def front_table(result: Sequence[FrontPoint]) -> Table:
    """Least costs of several limits."""
    variables = rows(
        "limit",
        result,
        limit=ANGLE,
        cost=("allocation.cost", NUMBER),
        reason=None,
    )
    return Table("Front", "limit", variables)
