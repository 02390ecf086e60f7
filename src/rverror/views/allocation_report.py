"""Tolerances, stacks of them, and what an allocation makes of them: what is told of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import zip_longest
from typing import Any

from rverror.base import units
from rverror.base.numbers import at_input_speed, brief, count_of, rounded, with_unit
from rverror.base.units import ARCSEC
from rverror.tolerances.allocation_result import Allocation, FrontPoint, Rate
from rverror.tolerances.declared import Tolerance
from rverror.tolerances.stacking import Stack
from rverror.views.blocks import Sentence, Sheet, grid, line, section, title
from rverror.views.describing import content, entries_of, own_columns, sheet, shown, table
from rverror.views.fields import OWN, Field, alike, arrays, bare, entry, listing, rows
from rverror.views.model_report import angles, influence_units
from rverror.views.variables import ANGLE, NUMBER, Each, Table, Variable, unit_of
from rverror.views.yield_report import together_entry, yield_entries, yield_sheet, yields

# --- tolerances -------------------------------------------------------------------------------------------------------


@table.register
def _tolerance_table(result: Tolerance) -> Table:
    return Table("Tolerance", "tolerance", _widths([result]))


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


@table.register
def _stack_table(result: Stack) -> Table:
    parts = [component.dimension for component in result.components]
    own = Each("unit", tuple(unit_of(parts[block.components.start]) for block in result.blocks))
    variables = {
        **angles(result.theta, result.nominal.size),
        **arrays("theta", result, nominal=ANGLE),
        **rows("component", result.components, component=str),
        **arrays("component", result, component_tolerance=("entry", NUMBER)),
        **bare(arrays("component theta", result, influence=("influence", influence_units(parts)))),
        **arrays("tolerance", result, tolerance=lambda one: list(one.labels), width=("width", own)),
        **rows("tolerance", result.blocks, distribution="distribution.name", correlation=NUMBER, classes=NUMBER),
    }
    return Table("Stack", "tolerance", variables)


@sheet.register
def _stack_sheet(thing: Stack) -> Sheet:
    headed = title("Stack", count_of(len(thing.labels), "tolerance"), count_of(len(thing.components), "component"))
    return headed + own_columns(thing, "tolerance", "width", "unit", "distribution", "correlation")


@sheet.register
def _tolerance_sheet(thing: Tolerance) -> Sheet:
    names = ("width", "unit", "distribution", "correlation", "random_phase", "fixed")
    return title("Tolerance", thing.label) + own_columns(thing, *names)


# --- allocations ------------------------------------------------------------------------------------------------------


@table.register
def _allocation_table(result: Allocation) -> Table:
    own = Each("unit", tuple(map(unit_of, result.dimensions)))
    rates: dict[str, Field] = {_SAVED: ("relax", NUMBER), _COST: ("tighten", NUMBER)}
    stages = ("before", result.used_before, result.cost_before), ("after", result.used, result.cost)
    variables = {
        **arrays(
            "tolerance",
            result,
            tolerance=lambda one: list(one.labels),
            width_before=("widths_before", own),
            width=("widths", own),
            grade=lambda one: [grade or "" for grade in one.grades],
            fixed=lambda one: list(one.fixed),
            cost_before=("costs_before", NUMBER),
            cost=("costs", NUMBER),
        ),
        **rows("tolerance", result.rates, **rates),
        **rows(
            "stage",
            stages,
            stage="0",
            used=("1", NUMBER),
            total_cost=("2", NUMBER),
        ),
        **arrays("", result, limit=ANGLE, shadow_price=NUMBER),
        **arrays("", result.closed_form, "closed_form_", **alike(ANGLE, "value", "low", "high")),
        **({} if result.verified is None else yields(result.verified)),
    }
    about = {"limited": result.kind, "level": result.level}
    return Table("Allocation", "tolerance", variables, about)


#: Names of what a width saves and what it costs.
_SAVED, _COST = "saved_per_percent_of_limits_given_up", "cost_per_percent_of_limits_gained"


@content.register
def _allocation_content(found: Allocation) -> dict[str, Any]:
    names = ("width_before", "width", "unit", "fixed", "cost_before", "cost", _SAVED, _COST)
    given = zip(found.labels, found.keys, found.grades, entries_of(found, {name: name for name in names}), strict=True)
    entries = [{"label": label, "key": key, **told, "grade": grade} for label, key, grade, told in given]
    for told, held in zip(entries, found.held_by, strict=False):
        told["held_by"] = held
    speed = None if found.speed is None else rounded(units.to_display(found.speed, "angular_speed"))
    return {
        "model": found.model or None,
        **entry(found, kind=None, level=None, cost_before=NUMBER, cost=NUMBER, limit_arcsec=("limit", ANGLE)),
        "input_speed_rpm": speed,
        "used_before_percent": rounded(100 * found.used_before),
        "used_percent": rounded(100 * found.used),
        "verified": [] if found.verified is None else yield_entries(found.verified),
        **({} if found.verified is None else together_entry(found.verified)),
        "cost_scaled_alike": rounded(found.uniform_cost),
        "shadow_price_per_percent_of_limits": rounded(found.shadow_price),
        "entries": entries,
        "closed_form": {
            "method": "closed form, contacts closed",
            **entry(
                found.closed_form,
                quantile_arcsec=("value", ANGLE),
                low_arcsec=("low", ANGLE),
                high_arcsec=("high", ANGLE),
            ),
        },
        "tighten_first": [rate.label for rate in found.tighten_first],
        "relax_first": [rate.label for rate in found.relax_first],
    }


@sheet.register
def _allocation_sheet(thing: Allocation) -> Sheet:
    closed, limit = thing.closed_form, "of all limits" if thing.kind == "load" else "of the limit"
    stages, _ = shown(thing, "stage")
    compared = [("cost", *stages["total_cost"]), (f"{_limited_by(thing)}, share {limit}", *stages["used"])]
    price = "" if thing.shadow_price is None else f"1 % more {limit} would save {brief(thing.shadow_price)}."
    binds = "The limit holds some widths." if "limit" in thing.held_by else "Bounds and grades alone hold the widths."
    strong = f"Cost {brief(thing.cost_before)} → {brief(thing.cost)}"
    alike = thing.uniform_cost
    each = zip(
        thing.labels,
        thing.dimensions,
        thing.widths_before,
        thing.widths,
        thing.costs_before,
        thing.costs,
        thing.grades,
        strict=True,
    )
    widths: dict[str, Field] = {
        "tolerance": "0.0",
        "width before": ("0.2", OWN),
        "allocated": ("0.3", OWN),
        "unit": lambda row: units.DISPLAY_UNITS[row[0][1]],
        "times": lambda row: float(row[0][3] / row[0][2]),
        "cost before": "0.4",
        "cost": "0.5",
        "held by": lambda row: ": ".join(filter(None, (row[1], row[0][6]))),
    }
    return (
        *title("Allocation", f"least cost {_within(thing)}"),
        Sentence(f"{strong}. {binds}", strong=strong),
        *grid(("", "before", "allocated"), compared),
        *line("" if alike is None else f"For comparison: {brief(alike)}, all widths scaled alike to the same yield."),
        *section("At the load, contacts that open included", *(yield_sheet(thing.verified) if thing.verified else ())),
        *section(
            "Widths and costs",
            *listing(zip_longest(each, thing.held_by, fillvalue=""), widths, own="0.1"),
            *line(price),
            *_rates(f"to tighten first (cost of 1 % {limit} gained)", "cost", thing.tighten_first, "tighten"),
            *_rates(f"to relax first (cost saved by 1 % {limit} given up)", "saved", thing.relax_first, "relax"),
        ),
        *line(
            f"Closed form, contacts closed: P{100 * thing.level:g} of the peak-to-peak "
            f"{with_unit(closed.value, 'angle')} ({brief(closed.low / ARCSEC)} to {brief(closed.high / ARCSEC)})."
        ),
    )


def _limited_by(found: Allocation) -> str:
    """What an allocation limits, in words."""
    quantile = f"P{100 * found.level:g} of the peak-to-peak"
    return {"worst": "worst-case peak-to-peak", "yield": quantile, "load": f"P{100 * found.level:g} of units"}[
        found.kind
    ]


def _within(found: Allocation) -> str:
    """What an allocation is for, to stand behind "Least cost"."""
    if found.limit is None:
        return f"at which {100 * found.level:g} % of the units meet all limits at the load"
    return f"for {_limited_by(found)} within {found.limit / ARCSEC:.4g} arcsec{at_input_speed(found.speed)}"


def _rates(head: str, of: str, rates: Sequence[Rate], which: str) -> Sheet:
    def told(rate: Rate) -> Any:
        value = getattr(rate, which)
        return "the width does not matter" if math.isinf(value) else value

    return listing(rates, {head: "label", of: told})


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
