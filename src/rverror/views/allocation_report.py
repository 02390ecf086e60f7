"""Tolerances, stacks of them, and what an allocation makes of them: what is told of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from rverror.base import units
from rverror.base.numbers import at_input_speed, brief, rounded, with_unit
from rverror.base.units import ARCSEC
from rverror.tolerances.allocation import Allocation, FrontPoint
from rverror.tolerances.declared import Tolerance
from rverror.views.describing import content, content_of, table
from rverror.views.fields import OWN, Field, arrays, rows
from rverror.views.variables import ANGLE, NUMBER, PER_ARCSEC, Each, Table, Unit, Variable, unit_of
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
    prices = Each("bound_price_unit", tuple(Unit(f"1/{u.core}", f"1/{u.shown}", 1 / u.size) for u in own.units))
    loaded = result.verified
    price, limited = (NUMBER, NUMBER) if loaded else (PER_ARCSEC, ANGLE)
    per = "percent_of_limits" if loaded else "arcsec"
    rates: dict[str, Field] = {f"saved_per_{per}_given_up": ("relax", price)}
    rates |= {f"cost_per_{per}_gained": ("tighten", price)}
    stages = (
        ("before", result.value_before, result.cost_before, result.closed_form_before),
        ("after", result.value, result.cost, result.closed_form),
    )
    variables = {
        **rows(
            "stage",
            stages,
            stage="0",
            value=("1", limited),
            total_cost=("2", NUMBER),
            closed_form=("3.quantile", ANGLE),
            closed_form_low=("3.low", ANGLE),
            closed_form_high=("3.high", ANGLE),
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
            bound_price=("bound_prices", prices),
        ),
        **rows("tolerance", result.rates, **rates),
        **arrays("", result, limit=limited, shadow_price=price, cost_scaled_alike=("uniform_cost", NUMBER)),
        **({} if loaded is None else yields(loaded, [None] * len(loaded.limits))),
    }
    binds = "The limit holds some widths." if "limit" in result.held_by else "Bounds and grades alone hold the widths."
    strong = f"Cost {brief(result.cost_before)} → {brief(result.cost)}"
    shown = ("tolerance", "width_before", "width", "unit", "cost_before", "cost", "held_by", "grade", *rates)
    return Table(
        "Allocation",
        "tolerance",
        variables,
        {"limited": result.kind, "level": result.level, "proof": result.proof},
        title=(f"least cost {_within(result)}",),
        verdict=(f"{strong}. {binds}", strong),
        sentences=_sentences(result),
        shown={"tolerance": shown},
    )


def _sentences(found: Allocation) -> tuple[str, ...]:
    """What is limited, what the rates are, how good the widths are."""
    check, loaded = found.closed_form, found.verified
    upper = ", upper end of its interval" if found.kind == "yield" else ""
    gap = "" if found.gap is None else f"; the gap is {100 * found.gap:.2g} % of the cost"
    told = [f"Value: {_limited_by(found)}{upper}."]
    if any(rate.relax is not None and math.isinf(rate.relax) for rate in found.rates):
        told.append("Where infinitely much is saved, the width does not matter.")
    told += yield_words(loaded) if loaded else ()
    told.append(f"{found.proof}{gap}.")
    told.append(
        f"Closed form, contacts closed: P{100 * check.level:g} of the peak-to-peak "
        f"{with_unit(check.quantile, 'angle')} ({brief(check.low / ARCSEC)} to {brief(check.high / ARCSEC)}), "
        f"{check.units} units, seed {check.seed}."
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
    used = f"share of its limits that a unit uses, P{100 * found.level:g}"
    return {"worst": "worst-case peak-to-peak", "yield": quantile, "rms": "expected rms", "load": used}[found.kind]


def _within(found: Allocation) -> str:
    """What an allocation is for, to stand behind "Least cost"."""
    if found.kind == "load":
        return f"at which {100 * found.level:g} % of the units meet all limits at the load"
    return f"for {_limited_by(found)} within {found.limit / ARCSEC:.4g} arcsec{at_input_speed(found.speed)}"


def front_table(result: Sequence[FrontPoint]) -> Table:
    """Least costs of several limits."""
    variables = rows(
        "limit",
        result,
        limit=ANGLE,
        cost=("allocation.cost", NUMBER),
        value=("allocation.value", ANGLE),
        reason=None,
    )
    return Table("Front", "limit", variables)
