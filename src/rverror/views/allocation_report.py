"""Tolerances, stacks of them, and what an allocation makes of them: what is told of each."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import zip_longest
from typing import Any

from rverror.base import units
from rverror.base.errors import InputError
from rverror.base.numbers import at_input_speed, brief, count_of, in_arcsec, rounded, with_unit
from rverror.base.units import ARCSEC
from rverror.tolerances.allocation import Allocation, ClosedFormQuantile, FrontPoint, Rate
from rverror.tolerances.declared import Tolerance
from rverror.tolerances.stacking import Stack
from rverror.views.blocks import Sentence, Sheet, grid, line, section, title
from rverror.views.describing import content, entries_of, own_columns, sheet, shown, table
from rverror.views.fields import OWN, Field, arrays, bare, entry, listing, rows
from rverror.views.model_report import angles, influence_units
from rverror.views.variables import ANGLE, NUMBER, PER_ARCSEC, Each, Table, Unit, Variable, unit_of
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
def _allocation_table(result: Allocation, *, stack: Stack | None = None) -> Table:
    if stack is not None and stack.labels != result.labels:
        raise InputError("stack: its tolerances are not those of the allocation; give the stack that was allocated")
    own = Each("unit", tuple(map(unit_of, result.dimensions)))
    prices = Each("bound_price_unit", tuple(Unit(f"1/{u.core}", f"1/{u.shown}", 1 / u.size) for u in own.units))
    price, limited = (NUMBER, NUMBER) if result.verified else (PER_ARCSEC, ANGLE)
    saved, cost = _rate_names(result)
    rates: dict[str, Field] = {saved: ("relax", price), cost: ("tighten", price)}
    stages = (
        ("before", result.value_before, result.cost_before, result.closed_form_before),
        ("after", result.value, result.cost, result.closed_form),
    )
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
            bound_price=("bound_prices", prices),
        ),
        **rows("tolerance", result.rates, **rates),
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
        **arrays("", result, limit=limited, gap=NUMBER, shadow_price=price),
        **({} if result.verified is None else yields(result.verified)),
    }
    about = {"limited": result.kind, "level": result.level, "proof": result.proof}
    return Table("Allocation", "tolerance", variables, about)


def _rate_names(found: Allocation) -> tuple[str, str]:
    """Names of what a width saves and what it costs, per what is given up or gained."""
    return f"saved_per_{_per(found)}_given_up", f"cost_per_{_per(found)}_gained"


def _per(found: Allocation) -> str:
    return "percent_of_limits" if found.verified else "arcsec"


@content.register
def _allocation_content(found: Allocation) -> dict[str, Any]:
    names = ("width_before", "width", "unit", "fixed", "cost_before", "cost", *_rate_names(found))
    given = zip(found.labels, found.keys, found.grades, entries_of(found, {name: name for name in names}), strict=True)
    entries = [{"label": label, "key": key, **told, "grade": grade} for label, key, grade, told in given]
    for told, held in zip(entries, found.held_by, strict=False):
        told["held_by"] = held
    if found.verified is None:
        speed = None if found.speed is None else rounded(units.to_display(found.speed, "angular_speed"))
        own = entry(found, limit_arcsec=("limit", ANGLE), value_arcsec=("value", ANGLE))
        own |= {"input_speed_rpm": speed, "value_before_arcsec": in_arcsec(found.value_before), "verified": []}
    else:
        own = {
            "limit_arcsec": None,
            "input_speed_rpm": None,
            "used_before_percent": rounded(100 * found.value_before),
            "used_percent": rounded(100 * found.value),
            "verified": yield_entries(found.verified),
            **together_entry(found.verified),
            "cost_scaled_alike": rounded(found.uniform_cost),
        }
    return {
        "model": found.model or None,
        **entry(
            found, kind=None, level=None, cost_before=NUMBER, cost=NUMBER, optimality_gap=("gap", NUMBER), proof=None
        ),
        **own,
        "confidence": found.closed_form.confidence,
        f"shadow_price_per_{_per(found)}": rounded(found.shadow_price),
        "entries": entries,
        "closed_form_before": _closed_form(found.closed_form_before),
        "closed_form": _closed_form(found.closed_form),
        "tighten_first": [rate.label for rate in found.tighten_first],
        "relax_first": [rate.label for rate in found.relax_first],
    }


def _closed_form(found: ClosedFormQuantile) -> dict[str, Any]:
    sizes: dict[str, Field] = {f"{name}_arcsec": (name, ANGLE) for name in ("quantile", "low", "high")}
    return {"method": "closed form, contacts closed", **entry(found, level=None, units=None, seed=None, **sizes)}


@sheet.register
def _allocation_sheet(thing: Allocation) -> Sheet:
    loaded, check = thing.verified is not None, thing.closed_form
    stages, _ = shown(thing, "stage")
    per = "% of all limits" if loaded else "arcsec"
    more = "1 % more of all limits" if loaded else "One arcsec more"
    binds = "The limit holds some widths." if "limit" in thing.held_by else "Bounds and grades alone hold the widths."
    strong = f"Cost {brief(thing.cost_before)} → {brief(thing.cost)}"
    alike = thing.uniform_cost
    upper = ", upper end of its interval" if thing.kind == "yield" else ""
    value = f"{_limited_by(thing)}{upper}, {'of the limits' if loaded else 'arcsec'}"
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
        *grid(("", "before", "allocated"), [("cost", *stages["total_cost"]), (value, *stages["value"])]),
        *line("" if alike is None else f"For comparison: {brief(alike)}, all widths scaled alike to the same yield."),
        *section("At the load, contacts that open included", *(yield_sheet(thing.verified) if thing.verified else ())),
        *section(
            "Widths and costs",
            *listing(zip_longest(each, thing.held_by, fillvalue=""), widths, own="0.1"),
            *line(f"{more} would save {brief(thing.shadow_price)}." if thing.shadow_price is not None else ""),
            *_rates(f"to tighten first (cost of 1 {per} gained)", "cost", thing.tighten_first, "tighten"),
            *_rates(f"to relax first (cost saved by 1 {per} given up)", "saved", thing.relax_first, "relax"),
        ),
        *section(
            "How good it is",
            *line(f"{thing.proof}{'' if thing.gap is None else f'; the gap is {100 * thing.gap:.2g} % of the cost'}."),
            *line(
                f"Closed form, contacts closed: P{100 * check.level:g} of the peak-to-peak "
                f"{with_unit(check.quantile, 'angle')} ({brief(check.low / ARCSEC)} to {brief(check.high / ARCSEC)}), "
                f"{check.units} units, seed {check.seed}."
            ),
        ),
    )


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
        value=("allocation.value", ANGLE),
        reason=None,
    )
    return Table("Front", "limit", variables)
