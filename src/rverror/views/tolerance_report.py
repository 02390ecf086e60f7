"""Tolerances, their budgets and yields, and what an allocation makes of them: what is told of each."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.numbers import at_input_speed, brief, count_of, rounded, way
from rverror.base.units import ARCSEC
from rverror.geartrain.mechanism import Reducer
from rverror.lots.result import Interval
from rverror.tolerances.allocation_result import Allocation, FrontPoint
from rverror.tolerances.closed_form import Budget
from rverror.tolerances.declared import Tolerance
from rverror.tolerances.full_budget import ErrorBudget
from rverror.tolerances.loaded_yield import LimitYield, Verified
from rverror.tolerances.sampling import Size, VirtualUnits
from rverror.tolerances.sobol import SobolIndices
from rverror.views.describing import described, entries, interval_words
from rverror.views.fields import COUNT, OWN, Field, arrays, entry, rows, same_unit, sized
from rverror.views.model_report import name_of
from rverror.views.shown_units import ANGLE, NUMBER, PERCENT, POSITION, SPEED, SQUARE, Unit, unit_of
from rverror.views.variables import Each, Table, Variable

#: Quantiles that are told.
LEVELS = (0.5, 0.95, 0.99)
_YIELD: dict[str, Field] = {"yield": ("value", NUMBER), "interval": ("", NUMBER)}
#: Of a torsional stiffness, as makers print it.
_STIFFENED = Unit("N*mm/rad", "N*m/arcmin", 1e3 / (60 * ARCSEC))


# --- yields at the load -----------------------------------------------------------------------------------------------


def _share(one: LimitYield) -> Interval | None:
    return None if one.limit.value is None else Interval(one.share, *one.interval)


def yields(found: Verified, closed: Sequence[float | None]) -> dict[str, Variable]:
    """Rows of limits at the load, with the yield in closed form beside each; a quantity without a limit has none."""
    quantiles: dict[str, Field] = {f"p{100 * level:g}": (f"3.{at}", OWN) for at, level in enumerate(LEVELS)}
    return rows(
        "limit_at_load",
        [
            (one, _share(one), share, [one.quantile(level).value for level in LEVELS])
            for one, share in zip(found.limits, closed, strict=True)
        ],
        "",
        ("limit_at_load_unit", lambda row: _STIFFENED if row[0].limit.quantity == "stiffness" else ANGLE),
        limit_at_load="0.limit.label",
        limit_value=("0.limit.value", OWN),
        **quantiles,
        **sized("yield", PERCENT, "1"),
        yield_in_closed_form=("2", PERCENT),
    )


def yield_words(found: Verified) -> Iterator[str]:
    """How many units were solved, and what the quantiles are of."""
    if found.failures:
        yield f"Bad, as they have no equilibrium: {count_of(len(found.failures), 'unit')}, {found.failures[0]}."
    first = found.limits[0]
    yield (
        f"Under load: {first.units} new virtual units, seed {found.seed}, each solved by the equilibrium, contacts "
        f"that open included; intervals: {100 * first.confidence:g} %. A quantile far within its limit may not be "
        "known. P99 of a stiffness: 99 % of the units are at least as stiff."
    )


def _yield_entry(one: LimitYield) -> dict[str, Any]:
    """Entry of JSON of a limit: the quantity, its torque and limit with their units, the yield."""
    limit = one.limit
    return {
        **entry(one, quantity="limit.quantity", level="limit.level", confidence=None, units=None),
        "torque": None if limit.torque is None else limit.load(6),
        "limit": None if limit.value is None else f"{brief(limit.shown(limit.value), 6)} {limit.unit}",
        **entry(_share(one), **_YIELD),
        "method": "equilibrium",
    }


def together_entry(found: Verified) -> dict[str, Any]:
    """Entry of JSON: the yield of all limits together, and units without an equilibrium."""
    return {
        "all_limits": entry(Interval(found.together, *found.together_interval), **_YIELD),
        "units_without_equilibrium": len(found.failures),
        "seed": found.seed,
    }


# --- tolerances -------------------------------------------------------------------------------------------------------


@described.register
def _tolerance_table(result: Tolerance) -> Table:
    return Table(_widths([result]), title=(result.label,))


def tolerances_table(result: Sequence[Tolerance]) -> Table:
    """Tolerances in a row."""
    return Table(_widths(result), kind="Tolerances")


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


@described.register
def _allocation_table(result: Allocation) -> Table:
    own = Each("unit", tuple(map(unit_of, result.dimensions)))
    loaded = result.verified
    rates: dict[str, Field] = {
        "saved_per_percent_of_limits_given_up": ("relax", NUMBER),
        "cost_per_percent_of_limits_gained": ("tighten", NUMBER),
    }
    stages = ("before", result.used_before, result.cost_before), ("after", result.used, result.cost)
    variables = {
        **rows("stage", stages, stage="0", used=("1", NUMBER), total_cost=("2", NUMBER)),
        **arrays(
            "tolerance",
            result,
            tolerance="labels",
            width_before=("widths_before", own),
            width=("widths", own),
            cost_before=("costs_before", NUMBER),
            cost=("costs", NUMBER),
            held_by=None,
            grade=lambda one: [grade or "" for grade in one.grades],
            fixed=None,
        ),
        **rows("tolerance", result.rates, **rates),
        **arrays("", result, limit=ANGLE, shadow_price=NUMBER, cost_scaled_alike=("uniform_cost", NUMBER)),
        **arrays("", result.closed_form, "closed_form_", **same_unit(ANGLE, "value", "low", "high")),
        **({} if loaded is None else yields(loaded, [None] * len(loaded.limits))),
    }
    binds = "The limit sets some widths" if "limit" in result.held_by else "Bounds and grades alone set the widths"
    verified = "" if loaded is None else f" {_verdict_at_load(loaded)}"
    shown = ("tolerance", "width_before", "width", "unit", "cost_before", "cost", "held_by", "grade", *rates)
    return Table(
        variables,
        {"limited": result.kind, "level": result.level},
        title=(f"least cost {within(result)}",),
        verdict=(f"Cost {brief(result.cost_before)} → {brief(result.cost)}", f". {binds}.{verified}"),
        sentences=tuple(_sentences(result)),
        shown={"tolerance": shown},
        rows="tolerance",
    )


def _sentences(found: Allocation) -> Iterator[str]:
    """What is limited, what the rates are, how good the widths are."""
    check = found.closed_form
    size, ends = interval_words(*ANGLE.of(np.array([check.value, check.low, check.high])))
    limits = "all limits" if found.kind == "load" else "the limit"
    yield f"Costs are in the unit of the cost curves. Used: share of {limits} that {_limited_by(found)} uses."
    if found.shadow_price is not None:
        yield f"1 % more of {limits} would save {brief(found.shadow_price)}."
    if any(rate.relax is not None and math.isinf(rate.relax) for rate in found.rates):
        yield "Where the saving is infinite, the width does not matter."
    if found.verified is not None:
        yield from yield_words(found.verified)
    yield f"Closed form, contacts closed: P{100 * found.level:g} of the peak-to-peak {size} arcsec ({ends})."


@entries.register
def _allocation_content(found: Allocation) -> dict[str, Any]:
    loaded = found.verified
    return {
        "model": found.model or None,
        "cost_before": rounded(found.cost_before),
        "cost": rounded(found.cost),
        **entry(found, input_speed_rpm=("speed", SPEED)),
        "verified": [_yield_entry(one) for one in loaded.limits] if loaded else [],
        **(together_entry(loaded) if loaded else {}),
    }


def _limited_by(found: Allocation) -> str:
    """What an allocation limits, in words."""
    quantile = f"P{100 * found.level:g} of the peak-to-peak"
    unit = f"the unit at P{100 * found.level:g}"
    return {"worst": "the worst-case peak-to-peak", "yield": quantile, "load": unit}[found.kind]


def within(found: Allocation) -> str:
    """What an allocation is for, to stand behind "least cost"."""
    if found.limit is None:
        return f"at which {100 * found.level:g} % of the units meet all limits under load"
    return f"for {_limited_by(found)} within {found.limit / ARCSEC:.4g} arcsec{at_input_speed(found.speed)}"


def front_table(result: Sequence[FrontPoint]) -> Table:
    """Least costs of several limits."""
    variables = rows("limit", result, limit=ANGLE, cost=("allocation.cost", NUMBER), reason=None)
    return Table(variables, kind="Front")


#: Sizes of an output error, and what people call them.
_SIZES: Mapping[Size, str] = {
    "peak_to_peak": "peak-to-peak",
    "max": "max |TE - offset|",
    "rms": "rms",
    "offset": "offset",
}
_SHOWN = ("tolerance", "width", "unit", "share", "worst_peak_to_peak", "worst_part")


# --- in closed form ---------------------------------------------------------------------------------------------------


@described.register
def _budget_table(result: Budget) -> Table:
    return Table(
        {**_nominal_and_worst(result), **_of_tolerances(result), **_of_angles(result)},
        title=(_counts(result),),
        verdict=(_largest(result), ""),
        sentences=_quiet(result),
        shown={"tolerance": _SHOWN},
        rows="tolerance",
    )


def _order(closed: Budget) -> list[int]:
    """Tolerances, the largest share first."""
    return sorted(range(len(closed.contributions)), key=lambda at: -closed.contributions[at].share)


def _of_tolerances(closed: Budget) -> dict[str, Variable]:
    return rows(
        "tolerance",
        [closed.contributions[at] for at in _order(closed)],
        "",
        ("tolerance_unit", "dimension"),
        tolerance="label",
        width=OWN,
        components=COUNT,
        mean_square=SQUARE,
        share=PERCENT,
        **same_unit(ANGLE, "worst_peak_to_peak", "worst_part", "rss", "offset_deviation", "worst_offset"),
        effect=None,
    )


def _of_angles(closed: Budget) -> dict[str, Variable]:
    """Waveforms of the error, and what the tolerances make together."""
    return {
        **arrays("theta", closed, theta=POSITION),
        **arrays("theta", closed, **same_unit(ANGLE, "mean", "standard_deviation", "deviation_standard_deviation")),
        **arrays("theta", closed.worst, **same_unit(ANGLE, "lower", "upper")),
        **arrays("", closed, root_sum_of_squares=("rss", ANGLE), expected_rms=("rms", ANGLE)),
        **arrays("", closed, standard_deviation_of_offset=("offset_deviation", ANGLE)),
    }


def _nominal_and_worst(closed: Budget) -> dict[str, Variable]:
    """Sizes of the output error with every toleranced value at its mean, and what no unit exceeds, as far as known."""
    worst, peak = closed.worst, float(np.abs(closed.mean - closed.offset_mean).max())
    nominal = [closed.nominal_peak_to_peak, peak, math.sqrt(closed.nominal_mean_square), closed.offset_mean]
    farthest = [worst.peak_to_peak, worst.maximum, math.nan, max(worst.offset, key=abs)]
    each = zip(_SIZES.values(), nominal, farthest, strict=True)
    return rows("size", each, size="0", size_nominal=("1", ANGLE), size_worst_case=("2", ANGLE))


def _quantiles(drawn: VirtualUnits) -> dict[str, Variable]:
    """Sizes of the output error that shares of the units do not exceed."""
    quantiles: dict[str, Field] = {"size": "0"}
    for at, level in enumerate(LEVELS, start=1):
        quantiles |= sized(f"size_p{100 * level:g}", ANGLE, str(at))
    each = ((words, *(drawn.quantile(level, size) for level in LEVELS)) for size, words in _SIZES.items())
    return rows("size", each, **quantiles)


def _counts(closed: Budget) -> str:
    each = closed.contributions
    return f"{count_of(len(each), 'tolerance')}, {count_of(sum(e.components for e in each), 'component')}"


def _quiet(closed: Budget) -> tuple[str, ...]:
    """What makes no wave."""
    quiet = ", ".join(one.label for one in closed.contributions if one.effect != "wave")
    sentence = f"In closed form these change the offset of the output angle alone, or nothing: {quiet}."
    return (sentence,) if quiet else ()


# --- of virtual units -------------------------------------------------------------------------------------------------


@described.register
def _units_table(result: VirtualUnits) -> Table:
    variables = {
        **_quantiles(result),
        **arrays("virtual_unit", result, peak_to_peak=ANGLE, max=ANGLE, rms=ANGLE, offset=ANGLE),
    }
    title = (f"{result.count}, seed {result.seed}",)
    strong, ends = _most(result)
    return Table(variables, {"seed": result.seed}, title=title, verdict=(strong, f" ({ends})."))


@described.register
def _error_budget_table(result: ErrorBudget, *, limit: Any | None = None) -> Table:
    """Table of a budget, with the yield at a limit of the peak-to-peak in its verdict."""
    closed, drawn, loaded = result.closed, result.units, result.at_load
    order = _order(closed)
    variables = {**_nominal_and_worst(closed), **_quantiles(drawn), **_of_tolerances(closed)}
    shown = [*_SHOWN]
    if result.indices is not None:
        waves = [closed.contributions[at].effect == "wave" for at in order]
        shown += ["sobol_total", "sobol_total_interval"]
        for which in ("first", "total"):
            variables |= _sobol(f"sobol_{which}", result.indices, which, order, waves)
    about = {"model": name_of(result.model), "direction": way(result.direction)}
    if result.stack.speed is not None:
        about["input_speed_rpm"] = SPEED.of(result.stack.speed)
    sentences = [
        f"Closed form{_state(result)}; {closed.mean.size} angles; {drawn.count} virtual units, seed {drawn.seed}.",
        "P99: 99 % of the units do not exceed it. Intervals: 95 %, of the Monte Carlo estimate, not of the scatter of "
        "units. Sobol index: share of the variance of the peak-to-peak.",
        *_quiet(closed),
    ]
    if loaded is not None:
        variables |= yields(loaded.verified, loaded.closed_form)
        variables |= arrays("limit_at_load", loaded, worst_parts=ANGLE)
        for one, found in zip(loaded.verified.limits, loaded.shares, strict=True):
            name = f"sobol_total, {one.limit.label}"
            shown += [name, f"{name}_interval"]
            if found is not None:
                variables |= _sobol(name, found, "total", order, [True] * len(order))
        about["units_without_equilibrium"] = "\n".join(loaded.verified.failures)
        sentences += [*yield_words(loaded.verified), "Worst parts: those of the closed form, solved under load."]
    return Table(
        {**variables, **_of_angles(closed)},
        about,
        title=(name_of(result.model), _counts(closed), way(result.direction)),
        verdict=_verdict(result, limit),
        sentences=tuple(sentences),
        shown={"tolerance": shown},
        rows="tolerance",
    )


def _sobol(
    name: str, indices: SobolIndices, which: str, order: Sequence[int], known: Sequence[bool]
) -> dict[str, Variable]:
    """Indices of the tolerances; none of what makes no wave."""
    ends = {f"{name}{end}": getattr(indices, f"{which}{end}")[order] for end in ("", "_low", "_high")}
    return arrays(
        "tolerance", {end: np.where(known, of, np.nan) for end, of in ends.items()}, **same_unit(NUMBER, *ends)
    )


def _state(result: ErrorBudget) -> str:
    """About which state the closed form is one."""
    if result.stack.speed is not None:
        return f" about the loaded state{at_input_speed(result.stack.speed)}"
    return ": rigid bearings, all loaded pins carry" if isinstance(result.model.mechanism, Reducer) else ""


def _verdict(result: ErrorBudget, limit: Any | None) -> tuple[str, str]:
    """What most units stay within, what makes most of it, the yield at a limit."""
    (strong, ends), within = _most(result.units), ""
    if limit is not None:
        at = units.named_core("limit", limit, "angle")
        found = result.units.yield_at(at)
        share, least, largest = (100 * one for one in (found.value, found.low, found.high))
        within = f" Yield at {at / ARCSEC:g} arcsec peak-to-peak: {share:.4g} % ({least:.4g} to {largest:.4g})."
    closed = f"({ends}). {_largest(result.closed)}{within}"
    if result.at_load is None or all(one.limit.value is None for one in result.at_load.verified.limits):
        return strong, f" {closed}"
    return _verdict_at_load(result.at_load.verified), f" Closed form: {strong} {closed}"


def _most(drawn: VirtualUnits) -> tuple[str, str]:
    """What most units stay within, and the ends of its interval."""
    p99 = drawn.quantile(0.99)
    size, ends = interval_words(*(value / ARCSEC for value in (p99.value, p99.low, p99.high)))
    return f"99 % of the units stay within {size} arcsec peak-to-peak", ends


def _largest(closed: Budget) -> str:
    """What makes most of the error."""
    first = max(closed.contributions, key=lambda one: one.share)
    if not first.share > 0:
        return "No tolerance changes more than the offset."
    return f"{first.label} has the largest share, {100 * first.share:.0f} % of the variance."


def _verdict_at_load(found: Verified) -> str:
    """Share of the units that meet all limits under load, and the limit that most of them exceed."""
    share, interval = interval_words(*(100 * one for one in (found.together, *found.together_interval)))
    limited = [one for one in found.limits if one.limit.value is not None]
    hardest = min(limited, key=lambda one: one.share)
    what = "all limits together" if len(limited) > 1 else f"the limit of the {hardest.limit.label}"
    worst = f"; {100 * hardest.share:.4g} % meet the hardest, the {hardest.limit.label}" if len(limited) > 1 else ""
    return f"{share} % of the units meet {what} under load ({interval}){worst}."


@entries.register
def _error_budget_content(found: ErrorBudget, *, limit: Any | None = None) -> dict[str, Any]:
    """`limit` of the peak-to-peak is that at which the yield is told."""
    passed, loaded = None if limit is None else found.units.yield_at(limit), found.at_load
    limits = [] if loaded is None else zip(loaded.verified.limits, loaded.closed_form, strict=True)
    return {
        "units": found.units.count,
        "seed": found.units.seed,
        "yield": passed and entry(passed, value=NUMBER, low=NUMBER, high=NUMBER),
        "limits": [{**_yield_entry(one), "closed_form_yield": rounded(share)} for one, share in limits],
        **({} if loaded is None else together_entry(loaded.verified)),
    }
