"""Budgets, in closed form and of virtual units: what is told of each."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.numbers import at_input_speed, brief, count_of, rounded, way
from rverror.base.units import ARCSEC
from rverror.geartrain.mechanism import Reducer
from rverror.tolerances.closed_form import Budget
from rverror.tolerances.full_budget import ErrorBudget, LoadedBudget
from rverror.tolerances.sampling import Size, VirtualUnits
from rverror.tolerances.sobol import SobolIndices
from rverror.views.blocks import Sheet
from rverror.views.describing import content, content_of, sheet, sheet_of, table
from rverror.views.fields import COUNT, OWN, alike, arrays, entry, rows, sized
from rverror.views.model_report import name_of
from rverror.views.variables import ANGLE, NUMBER, PERCENT, POSITION, SQUARE, Table, Variable
from rverror.views.yield_report import LEVELS, together_entry, yield_entries, yield_words, yields

#: Sizes of an output error, and what people call them.
_SIZES: Mapping[Size, str] = {
    "peak_to_peak": "peak-to-peak",
    "max": "max |TE - offset|",
    "rms": "rms",
    "offset": "offset",
}
_SHOWN = ("tolerance", "width", "unit", "share", "worst_peak_to_peak", "worst_part")


# --- in closed form ---------------------------------------------------------------------------------------------------


@table.register
def _budget_table(result: Budget) -> Table:
    return Table(
        "Budget",
        "tolerance",
        {**_nominal_and_worst(result), **_of_tolerances(result), **_of_angles(result)},
        title=(_counts(result),),
        sentences=_quiet(result),
        shown={"tolerance": _SHOWN},
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
        **alike(ANGLE, "worst_peak_to_peak", "worst_part", "rss"),
        **alike(ANGLE, "offset_deviation", "worst_offset"),
        effect=None,
    )


def _of_angles(closed: Budget) -> dict[str, Variable]:
    """Waveforms of the error, and what the tolerances make together."""
    return {
        **arrays("theta", closed, theta=("theta", POSITION)),
        **arrays("theta", closed, **alike(ANGLE, "mean", "standard_deviation", "deviation_standard_deviation")),
        **arrays("theta", closed.worst, **alike(ANGLE, "lower", "upper")),
        **arrays("", closed, root_sum_of_squares=("rss", ANGLE), expected_rms=("rms", ANGLE)),
        **arrays("", closed, standard_deviation_of_offset=("offset_deviation", ANGLE)),
    }


def _nominal_and_worst(closed: Budget) -> dict[str, Variable]:
    """Sizes of the output error with every toleranced value at its mean, and what no unit exceeds, as far as known."""
    worst, peak = closed.worst, float(np.abs(closed.mean - closed.offset_mean).max())
    nominal = [closed.nominal_peak_to_peak, peak, math.sqrt(closed.nominal_mean_square), closed.offset_mean]
    farthest = [worst.peak_to_peak, worst.maximum, math.nan, max(worst.offset, key=abs)]
    return {
        "size": Variable(("size",), list(_SIZES.values())),
        "size_nominal": Variable(("size",), nominal, ANGLE),
        "size_worst_case": Variable(("size",), farthest, ANGLE),
    }


def _quantiles(drawn: VirtualUnits) -> dict[str, Variable]:
    """Sizes of the output error that shares of the units do not exceed."""
    made = {"size": Variable(("size",), list(_SIZES.values()))}
    for level in LEVELS:
        found = [(drawn.quantile(level, size),) for size in _SIZES]
        made |= rows("size", found, **sized(f"size_p{100 * level:g}", ANGLE, "0"))
    return made


def _counts(closed: Budget) -> str:
    each = closed.contributions
    return f"{count_of(len(each), 'tolerance')}, {count_of(sum(e.components for e in each), 'component')}"


def _quiet(closed: Budget) -> tuple[str, ...]:
    """What makes no wave."""
    quiet = ", ".join(one.label for one in closed.contributions if one.effect != "wave")
    told = f"In closed form these change the offset of the output angle alone, or nothing: {quiet}."
    return (told,) if quiet else ()


# --- of virtual units -------------------------------------------------------------------------------------------------


@table.register
def _units_table(result: VirtualUnits) -> Table:
    variables = {
        **_quantiles(result),
        **arrays("virtual_unit", result, peak_to_peak=ANGLE, max=ANGLE, rms=ANGLE, offset=ANGLE),
    }
    title = (f"{result.count}, seed {result.seed}",)
    return Table("VirtualUnits", "size", variables, {"seed": result.seed}, title=title)


@table.register
def _error_budget_table(result: ErrorBudget) -> Table:
    return _told(result, None)


def _told(result: ErrorBudget, limit: Any | None) -> Table:
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
    speed = result.stack.speed
    sentences = [
        f"Closed form{_state(result)}; {closed.mean.size} angles; {drawn.count} virtual units, seed {drawn.seed}."
    ]
    sentences.append(
        "P99: what 99 % of the units do not exceed. Low to high: the 95 % interval of the Monte Carlo estimate, not "
        "how far units scatter. Sobol index: share of the variance of the peak-to-peak."
    )
    sentences += _quiet(closed)
    if loaded is not None:
        variables |= yields(loaded.verified, loaded.closed_form)
        variables |= arrays("limit_at_load", loaded, worst_parts=ANGLE)
        for one, found in zip(loaded.verified.limits, loaded.shares, strict=True):
            name = f"sobol_total, {one.limit.label}"
            shown += [name, f"{name}_interval"]
            if found is not None:
                variables |= _sobol(name, found, "total", order, [True] * len(order))
        about["units_without_equilibrium"] = "\n".join(loaded.verified.failures)
        sentences += yield_words(loaded.verified)
        sentences.append("Worst parts: those of the closed form, solved at the load.")
    return Table(
        "ErrorBudget",
        "tolerance",
        {**variables, **_of_angles(closed)},
        about if speed is None else {**about, "input_speed_rpm": units.to_display(speed, "angular_speed")},
        title=(name_of(result.model), _counts(closed), way(result.direction)),
        verdict=_verdict(result, limit),
        sentences=tuple(sentences),
        shown={"tolerance": shown},
    )


def _sobol(
    name: str, indices: SobolIndices, which: str, order: Sequence[int], known: Sequence[bool]
) -> dict[str, Variable]:
    """Indices of the tolerances; none of what makes no wave."""

    def of(end: str) -> Variable:
        values: Array = getattr(indices, f"{which}{end}")[order]
        return Variable(("tolerance",), np.where(known, values, np.nan), NUMBER)

    return {f"{name}{end}": of(end) for end in ("", "_low", "_high")}


def _state(result: ErrorBudget) -> str:
    """About which state the closed form is one."""
    if result.stack.speed is not None:
        return f" about the loaded state{at_input_speed(result.stack.speed)}"
    return ": rigid bearings, all loaded pins carry" if isinstance(result.model.mechanism, Reducer) else ""


def _verdict(result: ErrorBudget, limit: Any | None) -> tuple[str, str]:
    """What most units stay within, what makes most of it, the yield at a limit; and the words to be read first."""
    p99 = result.units.quantile(0.99)
    size, low, high = (brief(value / ARCSEC) for value in (p99.value, p99.low, p99.high))
    strong = f"99 % of the units stay within {size} arcsec peak-to-peak"
    first = max(result.closed.contributions, key=lambda one: one.share)
    most = " No tolerance changes more than the offset."
    if first.share > 0:
        most = f" {first.label} makes most of it, {100 * first.share:.0f} % of the variance."
    within = ""
    if limit is not None:
        at = units.named_core("limit", limit, "angle")
        found = result.units.yield_at(at)
        share, least, largest = (100 * one for one in (found.value, found.low, found.high))
        within = f" Yield at {at / ARCSEC:g} arcsec peak-to-peak: {share:.4g} % ({least:.4g} to {largest:.4g})."
    return f"{strong} ({low} to {high}).{most}{within}", strong


@sheet.register
def _error_budget_sheet(thing: ErrorBudget, *, limit: Any | None = None) -> Sheet:
    return sheet_of(_told(thing, limit))


@content.register
def _error_budget_content(found: ErrorBudget, *, limit: Any | None = None) -> dict[str, Any]:
    """`limit` of the peak-to-peak is that at which the yield is told."""
    passed = None if limit is None else found.units.yield_at(limit)
    return {
        **content_of(table(found)),
        "units": found.units.count,
        "seed": found.units.seed,
        "yield": passed and entry(passed, value=NUMBER, low=NUMBER, high=NUMBER),
        "limits": [] if found.at_load is None else _loaded_entries(found.at_load),
        **({} if found.at_load is None else together_entry(found.at_load.verified)),
    }


def _loaded_entries(loaded: LoadedBudget) -> list[dict[str, Any]]:
    """Entries of the limits in JSON, with what the closed form says."""
    each = zip(yield_entries(loaded.verified), loaded.closed_form, strict=True)
    return [{**told, "closed_form_yield": rounded(share)} for told, share in each]
