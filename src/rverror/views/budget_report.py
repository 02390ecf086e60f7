"""Budgets, in closed form and of virtual units: what is told of each."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.errors import InputError
from rverror.base.numbers import at_input_speed, brief, count_of, in_arcsec, rounded, way, with_unit
from rverror.base.units import ARCSEC
from rverror.geartrain.mechanism import Reducer
from rverror.model.catalogue import source
from rverror.tolerances.closed_form import Budget, Contribution
from rverror.tolerances.full_budget import ErrorBudget
from rverror.tolerances.loaded_budget import LoadedBudget
from rverror.tolerances.sampling import Size, VirtualUnits
from rverror.tolerances.sobol import SobolIndices
from rverror.views.blocks import Sentence, Sheet, facts, line, section, title
from rverror.views.describing import content, sheet, table
from rverror.views.fields import (
    COUNT,
    OWN,
    Column,
    Field,
    alike,
    arrays,
    entry,
    for_people,
    in_json,
    in_table,
    listing,
    rows,
)
from rverror.views.model_report import angles, name_of
from rverror.views.variables import ANGLE, NUMBER, PERCENT, SQUARE, Each, Table, Variable, unit_of
from rverror.views.yield_report import LEVELS, together_entry, yield_entries, yield_sheet, yields

#: Of all intervals that are told: of the estimate, where other draws of as many units would put it.
CONFIDENCE = 0.95
_OF_ESTIMATE = f"{100 * CONFIDENCE:g} % interval of the Monte Carlo estimate"
#: Sizes of an output error: name in the code, for people, and key in JSON.
_SIZES: tuple[tuple[Size, str, str], ...] = (
    ("peak_to_peak", "peak-to-peak", "peak_to_peak_arcsec"),
    ("max", "max |TE - offset|", "max_arcsec"),
    ("rms", "rms", "rms_arcsec"),
    ("offset", "offset", "offset_arcsec"),
)
_ENDS: Mapping[str, str] = {"value": "", "low": "_low", "high": "_high"}
_ESTIMATE = alike(ANGLE, "value", "low", "high")


# --- tables -----------------------------------------------------------------------------------------------------------


_CONTRIBUTION = (
    Column("tolerance", "label", "label", "tolerance"),
    Column("width", OWN, "width", "width"),
    Column("", lambda one: units.DISPLAY_UNITS[one.dimension], "unit", "unit"),
    Column("components", COUNT),
    Column("", "components", "components"),
    Column("mean_square", SQUARE),
    Column("share", NUMBER, "share_of_variance"),
    Column("", ("share", PERCENT), head="share of variance, %"),
    Column("worst_peak_to_peak", ANGLE, "worst_peak_to_peak_alone_arcsec", "p-p alone, worst, arcsec"),
    Column("worst_part", ANGLE, "part_of_worst_case_arcsec", "part of worst case, arcsec"),
    Column("rss", ANGLE),
    Column("offset_deviation", ANGLE, "offset_deviation_arcsec"),
    Column("worst_offset", ANGLE, "worst_offset_arcsec"),
    Column("effect", key="effect"),
)


@table.register
def _budget_table(result: Budget) -> Table:
    variables = {
        **rows("tolerance", result.contributions, "", ("unit", "dimension"), **in_table(_CONTRIBUTION)),
        **angles(result.theta, result.mean.size),
        **arrays(
            "theta",
            result,
            **alike(ANGLE, "mean", "standard_deviation", "deviation_standard_deviation"),
            **alike(ANGLE, "lower", "upper", within="worst."),
        ),
        **arrays(
            "",
            result,
            "total_",
            **alike(ANGLE, "offset_mean", "offset_deviation", "nominal_peak_to_peak"),
            **alike(SQUARE, "nominal_mean_square", "mean_square"),
            **alike(ANGLE, "rms", "rss"),
        ),
        **arrays(
            "",
            result.worst,
            "total_worst_",
            **alike(ANGLE, "peak_to_peak", "peak_to_peak_nominal", "maximum"),
            offset_low=("offset.0", ANGLE),
            offset_high=("offset.1", ANGLE),
        ),
    }
    return Table("Budget", "tolerance", variables)


@table.register
def _error_budget_table(result: ErrorBudget) -> Table:
    components = result.stack.components
    own = Each("component_unit", tuple(unit_of(component.dimension) for component in components))
    drawn = table(result.units)
    variables = {
        **table(result.closed).variables,
        **rows("component", components, component=str),
        **arrays("component", result.closed.worst, "worst_", **alike(own, "peak_to_peak_values")),
        **drawn.variables,
    }
    if result.indices is not None:
        names: dict[str, Field] = {f"{which}{end}": NUMBER for which in ("first", "total") for end in _ENDS.values()}
        variables |= arrays("tolerance", result.indices, "sobol_", **names)
    about = {"model": name_of(result.model), "direction": way(result.direction), **drawn.about}
    if (loaded := result.at_load) is not None:
        variables |= yields(loaded.verified)
        variables |= arrays("limit_at_load", loaded, closed_form_yield=("closed_form", NUMBER), worst_parts=ANGLE)
        about["units_without_equilibrium"] = "\n".join(loaded.verified.failures)
        none = np.full(len(result.tolerances), np.nan)
        for name in ("total", "total_low", "total_high"):
            shares = np.array([none if one is None else getattr(one, name) for one in loaded.shares])
            variables[f"loaded_sobol_{name}"] = Variable(("limit_at_load", "tolerance"), shares, NUMBER)
    return Table("ErrorBudget", "tolerance", variables, about)


@table.register
def _units_table(result: VirtualUnits) -> Table:
    variables = arrays("virtual_unit", result, peak_to_peak=ANGLE, max=ANGLE, rms=ANGLE, offset=ANGLE)
    return Table("VirtualUnits", "virtual_unit", variables, {"seed": result.seed})


# --- for programs -----------------------------------------------------------------------------------------------------


def _nominal_and_worst(closed: Budget, size: Size) -> tuple[float, float]:
    """Size with every toleranced value at its mean, and the exact worst case, of which none is known of the rms."""
    worst = closed.worst
    return {
        "peak_to_peak": (closed.nominal_peak_to_peak, worst.peak_to_peak),
        "max": (float(np.abs(closed.mean - closed.offset_mean).max()), worst.maximum),
        "rms": (math.sqrt(closed.nominal_mean_square), math.nan),
        "offset": (closed.offset_mean, max(worst.offset, key=abs)),
    }[size]


@content.register
def _budget_content(found: Budget, *, limit: Any | None = None) -> dict[str, Any]:
    if limit is not None:
        raise InputError("limit: a budget in closed form knows no yield; leave it out, or give an error_budget")
    return {"angles": found.mean.size, **_sizes(found, None), "contributions": _contributed(found, None)}


@content.register
def _error_budget_content(found: ErrorBudget, *, limit: Any | None = None) -> dict[str, Any]:
    """`limit` of the peak-to-peak is that at which the yield is told; numbers that are not determined are None."""
    at = None if limit is None else units.named_core("limit", limit, "angle")
    each = zip(found.tolerances, _contributed(found.closed, found.indices), strict=True)
    speed, passed = found.stack.speed, None if at is None else found.units.yield_at(at)
    return {
        "model": name_of(found.model),
        "confidence": CONFIDENCE,
        "direction": way(found.direction),
        "angles": found.closed.mean.size,
        "input_speed_rpm": None if speed is None else rounded(units.to_display(speed, "angular_speed")),
        "components": len(found.stack.components),
        "units": found.units.count,
        "seed": found.units.seed,
        **_sizes(found.closed, found.units),
        "limit_arcsec": in_arcsec(at),
        "yield": passed and entry(passed, value=NUMBER, low=NUMBER, high=NUMBER),
        "contributions": [
            {**told, "key": tolerance.key, **_cause_of(found, e)} for e, (tolerance, told) in enumerate(each)
        ],
        "limits": [] if found.at_load is None else list(_loaded_entries(found, found.at_load)),
        **({} if found.at_load is None else together_entry(found.at_load.verified)),
    }


def _sizes(closed: Budget, drawn: VirtualUnits | None) -> dict[str, Any]:
    sizes: dict[str, dict[str, Any]] = {}
    for size, _, key in _SIZES:
        nominal, worst = _nominal_and_worst(closed, size)
        sizes[key] = {"nominal": in_arcsec(nominal), "worst_case": in_arcsec(worst)}
        if drawn is not None:
            sizes[key] |= {f"p{100 * level:g}": entry(drawn.quantile(level, size), **_ESTIMATE) for level in LEVELS}
            sizes[key]["mean"] = in_arcsec(float(getattr(drawn, size).mean()))
    sizes["peak_to_peak_arcsec"]["root_sum_of_squares"] = in_arcsec(closed.rss)
    sizes["rms_arcsec"]["root_of_expected_mean_square"] = in_arcsec(closed.rms)
    return sizes


def _loaded_entries(found: ErrorBudget, loaded: LoadedBudget) -> Iterator[dict[str, Any]]:
    """Entries of the limits in JSON, with what the closed form says and the share of each tolerance."""
    labels = [item.label for item in found.closed.contributions]
    beside = zip(yield_entries(loaded.verified), loaded.closed_form, loaded.worst_parts, loaded.shares, strict=True)
    for told, share, worst, indices in beside:
        each = enumerate(labels) if indices is not None else ()
        yield {
            **told,
            "closed_form_yield": rounded(share),
            "worst_parts_arcsec": in_arcsec(worst),
            "shares": [{"label": label, **(_sobol(indices, "total", e) or {})} for e, label in each],
        }


def _cause_of(found: ErrorBudget, at: int) -> dict[str, Any]:
    """Where the error of a tolerance sits, its orders, its limits, and what one unit of it makes."""
    item, stack = found.tolerances[at], found.stack
    cause, mechanism = source(item.key), found.model.mechanism
    orders = {order for indices in item.instances(mechanism) for order in cause.orders(mechanism, indices)}
    first = item.chosen[0]
    middle = item.mean.get(first.name, 0.0) + item.distribution.middle * item.width
    one = len(item.chosen) == 1 and not item.distribution.vector
    ends = (middle - item.width, middle + item.width) if one else (None, None)
    waves = float(np.ptp(stack.influence[stack.blocks[at].components], axis=1).max(initial=0.0))
    return {
        "frame": cause.frame,
        "orders": sorted(orders),
        "distribution": item.distribution.name,
        **entry(ends, first.dimension, lower_limit=("0", OWN), upper_limit=("1", OWN)),
        "peak_to_peak_per_unit_arcsec": in_arcsec(waves / units.to_display(1.0, first.dimension)),
    }


def _sobol(indices: SobolIndices | None, which: str, at: int) -> dict[str, float | None] | None:
    if indices is None:
        return None
    return {name: rounded(float(getattr(indices, f"{which}{end}")[at])) for name, end in _ENDS.items()}


def _contributed(closed: Budget, indices: SobolIndices | None) -> list[dict[str, Any]]:
    return [
        entry(one, one.dimension, **in_json(_CONTRIBUTION))
        | {f"sobol_{which}": _sobol(indices, which, e) for which in ("first", "total")}
        for e, one in enumerate(closed.contributions)
    ]


# --- for people -------------------------------------------------------------------------------------------------------


def _angle(value: float) -> str:
    return with_unit(value, "angle")


@sheet.register
def _budget_sheet(thing: Budget) -> Sheet:
    stated = {
        "root sum of squares of single peak-to-peaks": _angle(thing.rss),
        "expected rms": _angle(thing.rms),
        "standard deviation of the offset": _angle(thing.offset_deviation),
    }
    return (
        *title("Budget in closed form", _counts(thing)),
        *_quantiles(None, thing),
        *facts(stated),
        *_contributions(thing, None),
    )


def _counts(closed: Budget) -> str:
    each = closed.contributions
    return f"{count_of(len(each), 'tolerance')}, {count_of(sum(e.components for e in each), 'component')}"


def _quantiles(drawn: VirtualUnits | None, closed: Budget | None = None) -> Sheet:
    """Sizes of the output error at several shares of the units, with what no unit exceeds where that is known."""
    heads: dict[str, Field] = {"size, arcsec": "1"}
    if closed is not None:
        heads["nominal"] = (lambda row: _nominal_and_worst(closed, row[0])[0], ANGLE)
    if drawn is not None:
        for level in LEVELS:
            name = f"P{level * 100:g}"
            heads |= {name: (f"2.{name}.value", ANGLE), f"{name}, 95 %": (f"2.{name}", ANGLE)}
    if closed is not None:
        heads["worst case"] = (lambda row: _nominal_and_worst(closed, row[0])[1], ANGLE)
    quantiles = {
        size: {f"P{level * 100:g}": drawn.quantile(level, size) for level in LEVELS} if drawn else {}
        for size, *_ in _SIZES
    }
    return listing([(size, name, quantiles[size]) for size, name, _ in _SIZES], heads)


@sheet.register
def _units_sheet(thing: VirtualUnits) -> Sheet:
    return title("Virtual units", f"{thing.count}, seed {thing.seed}") + _quantiles(thing)


@sheet.register
def _error_budget_sheet(thing: ErrorBudget, *, limit: Any | None = None) -> Sheet:
    drawn, p99, speed = thing.units, thing.units.quantile(0.99), thing.stack.speed
    rigid = "" if speed is None else f" about the loaded state{at_input_speed(speed)}"
    if speed is None and isinstance(thing.model.mechanism, Reducer):
        rigid = ": rigid bearings, all loaded pins carry"
    size, *ends = (brief(value / ARCSEC) for value in (p99.value, p99.low, p99.high))
    strong = f"99 % of the units stay within {size} arcsec peak-to-peak"
    first = max(thing.closed.contributions, key=lambda one: one.share)
    most = " No tolerance changes more than the offset."
    if first.share > 0:
        most = f" {first.label} makes most of it, {100 * first.share:.0f} % of the variance."
    return (
        *title("Error budget", name_of(thing.model), _counts(thing.closed), way(thing.direction)),
        Sentence(f"{strong} ({ends[0]} to {ends[1]}).{most}", strong=strong),
        *line(_yield_at(drawn, limit)),
        *line(f"Closed form{rigid}; {thing.closed.mean.size} angles; {drawn.count} virtual units, seed {drawn.seed}."),
        *_quantiles(drawn, thing.closed),
        *line(f"P99: what 99 % of the units do not exceed. Intervals: the {_OF_ESTIMATE}, not how far units scatter."),
        *line(
            f"Root sum of squares of the single peak-to-peaks {_angle(thing.closed.rss)}; expected rms "
            f"{_angle(thing.closed.rms)}."
        ),
        *section("At the load, contacts that open included", *_at_load(thing)),
        *section("What each tolerance contributes", *_contributions(thing.closed, thing.indices)),
        *section("Where each tolerance acts", *_where(thing)),
    )


def _contributions(closed: Budget, indices: SobolIndices | None) -> Sheet:
    """Tolerances, the largest share first."""
    each = closed.contributions
    order = sorted(range(len(each)), key=lambda e: -each[e].share)
    heads = for_people(_CONTRIBUTION)
    if indices is not None:
        heads |= {f"Sobol {which} ± 95 %": partial(_index_of, each, indices, which) for which in ("first", "total")}
    quiet = ", ".join(one.label for one in each if one.effect != "wave")
    return (
        *listing([each[e] for e in order], heads),
        *line(
            f"Sobol index: share of the variance of the peak-to-peak; ±: half of the {_OF_ESTIMATE}."
            if indices is not None
            else ""
        ),
        *line(
            f"In closed form these change the offset of the output angle alone, or nothing: {quiet}." if quiet else ""
        ),
    )


def _index(indices: SobolIndices, which: str, at: int) -> str:
    """Sobol index; none of what is correlated with others and so no cause by itself."""
    value, low, high = (float(getattr(indices, f"{which}{end}")[at]) for end in _ENDS.values())
    return "" if math.isnan(value) else f"{value:.2f} ± {(high - low) / 2:.2f}"


def _index_of(each: Sequence[Contribution], indices: SobolIndices, which: str, one: Contribution) -> str:
    """Sobol index; none of what makes no wave."""
    return _index(indices, which, list(map(id, each)).index(id(one))) if one.effect == "wave" else ""


def _where(thing: ErrorBudget) -> Sheet:
    def limits(row: Mapping[str, Any]) -> str:
        low, high = row["lower_limit"], row["upper_limit"]
        return "within the width" if low is None or high is None else f"{brief(low)} to {brief(high)}"

    heads: dict[str, Field] = {
        "tolerance": lambda row: row["label"],
        "fixed in": lambda row: row["frame"],
        "orders": lambda row: ", ".join(brief(order) for order in row["orders"][:4]) or "–",
        "limits": limits,
        "p-p of 1 unit, arcsec": lambda row: row["peak_to_peak_per_unit_arcsec"],
    }
    return listing([{"label": label, **_cause_of(thing, at)} for at, label in enumerate(thing.stack.labels)], heads)


def _yield_at(drawn: VirtualUnits, limit: Any | None) -> str:
    if limit is None:
        return ""
    size = units.named_core("limit", limit, "angle")
    share, low, high = (100 * getattr(drawn.yield_at(size), name) for name in _ENDS)
    return f"Yield at {size / ARCSEC:g} arcsec peak-to-peak: {share:.4g} % ({low:.4g} to {high:.4g})."


def _at_load(thing: ErrorBudget) -> Sheet:
    """Yields at the load, the worst parts of the closed form solved there, and what each tolerance makes."""
    loaded = thing.at_load
    if loaded is None:
        return ()
    limits = loaded.verified.limits
    worst = [
        f"{one.limit.label} {_angle(size)}"
        for one, size in zip(limits, loaded.worst_parts, strict=True)
        if size is not None
    ]
    told = {one.limit.label: found for one, found in zip(limits, loaded.shares, strict=True) if found is not None}
    order = np.argsort(-np.max([found.total for found in told.values()], axis=0)).tolist() if told else []
    heads: dict[str, Field] = {
        "Sobol index, total, at the load": lambda e: thing.closed.contributions[e].label,
        **{label: partial(_index, found, "total") for label, found in told.items()},
    }
    return (
        *yield_sheet(loaded.verified, loaded.closed_form),
        *line(f"The worst parts of the closed form make, at the load: {', '.join(worst)}." if worst else ""),
        *listing(order, heads),
    )
