"""An error budget and an allocation for people and for programs: text and JSON."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

import rverror
from rverror import units
from rverror.allocate import Allocation, Rate, Verification
from rverror.error_budget import ErrorBudget
from rverror.reducer import Reducer
from rverror.report import InputFile
from rverror.sobol import SobolIndices
from rverror.tolerance import Stack
from rverror.units import ARCSEC
from rverror.virtual_units import Estimate, Size

_ROUNDING = 1e-9 * ARCSEC
#: Quantiles that are reported.
LEVELS = (0.5, 0.95, 0.99)
_SIZES: tuple[tuple[Size, str, str], ...] = (
    ("peak_to_peak", "peak-to-peak", "peak_to_peak_arcsec"),
    ("max", "max |TE - offset|", "max_arcsec"),
    ("rms", "rms", "rms_arcsec"),
    ("offset", "offset", "offset_arcsec"),
)


def budget_text(found: ErrorBudget, *, limit: float | None = None) -> str:
    """Error budget as text.

    Parameters
    ----------
    found : ErrorBudget
    limit : float, optional
        Of the peak-to-peak, rad: the yield is told at it.

    Returns
    -------
    str
        Angles in arcsec.

    Examples
    --------
    >>> import rverror
    >>> cams = [rverror.tolerance("crank.eccentricity", "5 um")]
    >>> found = rverror.error_budget(rverror.Model(rverror.reducer("RV-40E")), cams, count=512, index_count=0)
    >>> print(budget_text(found).splitlines()[0])
    Error budget of RV-40E: 1 tolerance, 8 components, forward
    """
    closed, drawn = found.closed, found.units
    way = "forward" if found.direction > 0 else "reverse"
    bearings = ": rigid bearings, all loaded pins carry" if isinstance(found.model.mechanism, Reducer) else ""
    lines = [
        f"Error budget of {found.model.name or found.model.mechanism.name or 'the model'}: "
        f"{_count(len(closed.contributions), 'tolerance')}, {_count(len(found.stack.components), 'component')}, {way}",
        f"Closed form{bearings}; {closed.mean.size} angles; {drawn.count} virtual units, "
        f"seed {drawn.seed}. All in arcsec.",
        "",
        f"{'':20s} {'nominal':>9s} " + " ".join(f"{f'P{level * 100:g}':>9s}" for level in LEVELS) + f" {'worst':>9s}",
    ]
    for size, name, _ in _SIZES:
        at = [drawn.quantile(level, size).value for level in LEVELS]
        lines.append(
            f"{name:20s} " + " ".join(_cell(value) for value in (_nominal(found, size), *at, _worst(found, size)))
        )
    p99 = drawn.quantile(0.99)
    lines += [
        "",
        f"P99 of the peak-to-peak: {_of(p99)}; root sum of squares of the single peak-to-peaks: "
        f"{closed.rss / ARCSEC:.4g}; expected rms {closed.rms / ARCSEC:.4g}",
    ]
    if limit is not None:
        share = drawn.yield_at(limit)
        lines.append(
            f"Yield at {limit / ARCSEC:g} arcsec peak-to-peak: {100 * share.value:.4g} % "
            f"[{100 * share.low:.4g}, {100 * share.high:.4g}]"
        )
    lines += ["", *_contribution_lines(found)]
    if found.contact is not None:
        lines += ["", *found.contact.lines(limit=limit)]
    if quiet := [entry.label for entry in closed.contributions if entry.effect != "wave"]:
        lines += ["", "Moves the offset alone, or nothing: " + ", ".join(quiet)]
    return "\n".join(lines) + "\n"


def _contribution_lines(found: ErrorBudget) -> list[str]:
    entries = found.closed.contributions
    order = sorted(range(len(entries)), key=lambda e: -entries[e].share)
    width = max(len(entry.label) for entry in entries)
    heads = (
        ("tolerance", "width", "share of", "p-p", "alone", "part of", "Sobol index", "of the p-p"),
        ("", "", "variance", "mean", "worst", "worst", "first", "total"),
    )
    lines = [
        f"{name:{width}s} {size:>12s} {share:>9s} {mean:>9s} {worst:>9s} {part:>8s} {first:>13s} {total:>13s}".rstrip()
        for name, size, share, mean, worst, part, first, total in heads
    ]
    for e in order:
        entry, waves = entries[e], entries[e].effect == "wave"
        size = f"{units.to_display(entry.width, entry.dimension):.4g} {units.DISPLAY_UNITS[entry.dimension]}"
        first, total = (_share(found.indices, which, e, waves=waves) for which in ("first", "total"))
        lines.append(
            f"{entry.label:{width}s} {size:>12s} {100 * entry.share:8.1f}% {_cell(entry.mean_peak_to_peak)} "
            f"{_cell(entry.worst_peak_to_peak)} {_cell(entry.worst_part, 8)} {first:>13s} {total:>13s}"
        )
    return lines


def _share(indices: SobolIndices | None, which: str, entry: int, *, waves: bool) -> str:
    if indices is None or not waves:
        return "-"
    value, low, high = (float(getattr(indices, f"{which}{end}")[entry]) for end in ("", "_low", "_high"))
    return f"{value:.2f} +- {(high - low) / 2:.2f}"


def _count(number: int, what: str) -> str:
    return f"{number} {what}" + ("" if number == 1 else "s")


def _cell(value: float, width: int = 9) -> str:
    if abs(value) < _ROUNDING:
        return " " * (width - 1) + "0"
    return f"{value / ARCSEC:{width}.4g}" if math.isfinite(value) else " " * (width - 1) + "-"


def _of(estimate: Estimate) -> str:
    return f"{estimate.value / ARCSEC:.4g} [{estimate.low / ARCSEC:.4g}, {estimate.high / ARCSEC:.4g}]"


def _nominal(found: ErrorBudget, size: Size) -> float:
    """Of the model with every toleranced value at its mean."""
    closed = found.closed
    return {
        "peak_to_peak": closed.nominal_peak_to_peak,
        "max": float(np.abs(closed.mean - closed.offset_mean).max()),
        "rms": math.sqrt(closed.nominal_mean_square),
        "offset": closed.offset_mean,
    }[size]


def _worst(found: ErrorBudget, size: Size) -> float:
    """Exact worst case; not a number for the rms, of which none is known."""
    worst = found.closed.worst
    return {
        "peak_to_peak": worst.peak_to_peak,
        "max": worst.maximum,
        "rms": math.nan,
        "offset": max(worst.offset, key=abs),
    }[size]


def _number(value: float | None, digits: int = 6) -> float | None:
    return None if value is None or not math.isfinite(value) else float(f"{value:.{digits}g}")


def _arcsec(value: float) -> float | None:
    return _number(value / ARCSEC)


def _interval(estimate: Estimate, scale: float = ARCSEC) -> dict[str, float | None]:
    return {name: _number(getattr(estimate, name) / scale) for name in ("value", "low", "high")}


def _files(files: Sequence[InputFile]) -> list[dict[str, Any]]:
    return [asdict(file) for file in files]


def budget_json(found: ErrorBudget, *, limit: float | None = None, files: Sequence[InputFile] = ()) -> dict[str, Any]:
    """Error budget as plain data for `json.dump`; keys are only ever added.

    Parameters
    ----------
    found : ErrorBudget
    limit : float, optional
        Of the peak-to-peak, rad.
    files : sequence of InputFile, optional
        What it was made from.

    Returns
    -------
    dict
        Sizes in arcsec and um; numbers that are not determined are None.

    Examples
    --------
    >>> import rverror
    >>> cams = [rverror.tolerance("crank.eccentricity", "5 um", crank=0, disc=0)]
    >>> found = rverror.error_budget(rverror.Model(rverror.reducer("RV-40E")), cams, count=512, index_count=0)
    >>> round(budget_json(found)["peak_to_peak_arcsec"]["worst_case"], 2)
    18.51
    """
    drawn, closed = found.units, found.closed
    sizes = {
        key: {
            "nominal": _arcsec(_nominal(found, size)),
            **{f"p{level * 100:g}": _interval(drawn.quantile(level, size)) for level in LEVELS},
            "mean": _arcsec(float(getattr(drawn, size).mean())),
            "worst_case": _arcsec(_worst(found, size)),
        }
        for size, _, key in _SIZES
    }
    sizes["peak_to_peak_arcsec"]["root_sum_of_squares"] = _arcsec(closed.rss)
    sizes["rms_arcsec"]["root_of_expected_mean_square"] = _arcsec(closed.rms)
    return {
        "model": found.model.name or found.model.mechanism.name,
        "direction": "forward" if found.direction > 0 else "reverse",
        "angles": closed.mean.size,
        "components": len(found.stack.components),
        "units": drawn.count,
        "seed": drawn.seed,
        **sizes,
        "limit_arcsec": None if limit is None else _arcsec(limit),
        "yield": None if limit is None else _interval(drawn.yield_at(limit), 1.0),
        "contributions": [_contribution_json(found, e) for e in range(len(closed.contributions))],
        "contact": None if found.contact is None else found.contact.as_json(limit=limit),
        "inputs": _files(files),
        "version": rverror.__version__,
    }


def _contribution_json(found: ErrorBudget, e: int) -> dict[str, Any]:
    entry, indices = found.closed.contributions[e], found.indices
    sobol = {
        f"sobol_{which}": None
        if indices is None
        else {
            name: _number(float(getattr(indices, f"{which}{end}")[e]))
            for name, end in (("value", ""), ("low", "_low"), ("high", "_high"))
        }
        for which in ("first", "total")
    }
    return {
        "label": entry.label,
        "key": found.tolerances[e].key,
        "width": _number(units.to_display(entry.width, entry.dimension)),
        "unit": units.DISPLAY_UNITS[entry.dimension],
        "components": entry.components,
        "effect": entry.effect,
        "share_of_variance": _number(entry.share),
        "mean_peak_to_peak_alone_arcsec": _arcsec(entry.mean_peak_to_peak),
        "worst_peak_to_peak_alone_arcsec": _arcsec(entry.worst_peak_to_peak),
        "part_of_worst_case_arcsec": _arcsec(entry.worst_part),
        "offset_deviation_arcsec": _arcsec(entry.offset_deviation),
        "worst_offset_arcsec": _arcsec(entry.worst_offset),
        **sobol,
    }


_KIND_WORDS = {
    "worst": "worst-case peak-to-peak",
    "yield": "peak-to-peak",
    "rms": "expected rms",
}


def allocation_text(found: Allocation, stack: Stack) -> str:
    """Allocation as text.

    Parameters
    ----------
    found : Allocation
    stack : Stack
        Whose tolerances were allocated.

    Returns
    -------
    str
        Angles in arcsec, widths in the units that people read.

    Examples
    --------
    Half the peak-to-peak costs twice as much.

    >>> import rverror
    >>> from rverror.cost import Reciprocal
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> cams = rverror.stack(unit, [rverror.tolerance("crank.eccentricity", "5 um")])
    >>> found = rverror.allocate(cams, [Reciprocal(12.0, 0.005)], limit="37 arcsec", kind="worst", verify=1000)
    >>> print(allocation_text(found, cams).splitlines()[0])
    Least cost for worst-case peak-to-peak within 37 arcsec
    """
    dimensions = _dimensions(stack)
    what = f"P{100 * found.level:g} of the peak-to-peak" if found.kind == "yield" else _KIND_WORDS[found.kind]
    width = max(len(label) for label in found.labels)
    lines = [
        f"Least cost for {what} within {found.limit / ARCSEC:g} arcsec",
        "",
        f"{'cost':12s} {found.cost_before:12.4g} -> {found.cost:.4g}",
        f"{what[:40]:12s} {found.value_before / ARCSEC:12.4g} -> {found.value / ARCSEC:.4g} arcsec"
        + (" (upper end of its interval)" if found.kind == "yield" else ""),
        f"{'verified':12s} {_verified(found.verified)}",
        "",
        f"{'tolerance':{width}s} {'before':>12s} {'allocated':>12s} {'cost':>9s} {'':>9s}",
    ]
    for e, label in enumerate(found.labels):
        before, after = (_shown(widths[e], dimensions[e]) for widths in (found.widths_before, found.widths))
        mark = "fixed" if found.fixed[e] else found.grades[e] or ""
        costs = f"{found.costs_before[e]:9.4g} {found.costs[e]:9.4g}"
        lines.append(f"{label:{width}s} {before:>12s} {after:>12s} {costs}  {mark}".rstrip())
    if found.shadow_price is not None:
        lines += ["", f"One arcsec more would save {found.shadow_price:.4g}."]
    for title, rates, which in (
        ("From the widths as given, tighten first (cost of an arcsec gained)", found.tighten_first, "tighten"),
        ("From the widths as given, relax first (cost saved per arcsec given up)", found.relax_first, "relax"),
    ):
        if rates:
            lines += ["", f"{title}:", *(f"  {rate.label:{width}s} {_price(rate, which)}" for rate in rates)]
    lines += ["", f"How good it is: {found.proof}."]
    return "\n".join(lines) + "\n"


def _price(rate: Rate, which: str) -> str:
    value = getattr(rate, which)
    return "the width does not matter" if math.isinf(value) else f"{value:.4g}"


def _verified(verified: Verification) -> str:
    level = f"P{100 * verified.level:g}"
    return (
        f"{level} of the peak-to-peak {verified.quantile / ARCSEC:.4g} arcsec [{verified.low / ARCSEC:.4g}, "
        f"{verified.high / ARCSEC:.4g}] in {verified.units} fresh units, seed {verified.seed}"
    )


def _shown(width: float, dimension: str) -> str:
    return f"{units.to_display(width, dimension):.4g} {units.DISPLAY_UNITS[dimension]}"


def _dimensions(stack: Stack) -> list[str]:
    return [stack.components[block.components.start].dimension for block in stack.blocks]


def allocation_json(found: Allocation, stack: Stack, *, files: Sequence[InputFile] = ()) -> dict[str, Any]:
    """Allocation as plain data for `json.dump`; keys are only ever added.

    Parameters
    ----------
    found : Allocation
    stack : Stack
        Whose tolerances were allocated.
    files : sequence of InputFile, optional
        What it was made from.

    Returns
    -------
    dict
        Sizes in arcsec and um.

    Examples
    --------
    >>> import rverror
    >>> from rverror.cost import Reciprocal
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> cams = rverror.stack(unit, [rverror.tolerance("crank.eccentricity", "5 um")])
    >>> found = rverror.allocate(cams, [Reciprocal(12.0, 0.005)], limit="37 arcsec", kind="worst", verify=1000)
    >>> [(entry["width_before"], entry["unit"]) for entry in allocation_json(found, cams)["entries"]]
    [(5.0, 'um')]
    """
    entries = []
    for e, (label, dimension) in enumerate(zip(found.labels, _dimensions(stack), strict=True)):
        rate = found.rates[e]
        entries.append(
            {
                "label": label,
                "key": stack.components[stack.blocks[e].components.start].key,
                "width_before": _number(units.to_display(found.widths_before[e], dimension)),
                "width": _number(units.to_display(found.widths[e], dimension)),
                "unit": units.DISPLAY_UNITS[dimension],
                "grade": found.grades[e],
                "fixed": found.fixed[e],
                "cost_before": _number(found.costs_before[e]),
                "cost": _number(found.costs[e]),
                "saved_per_arcsec_given_up": _number(rate.relax),
                "cost_per_arcsec_gained": _number(rate.tighten),
            }
        )
    return {
        "kind": found.kind,
        "level": found.level,
        "limit_arcsec": _arcsec(found.limit),
        "value_before_arcsec": _arcsec(found.value_before),
        "value_arcsec": _arcsec(found.value),
        "cost_before": _number(found.cost_before),
        "cost": _number(found.cost),
        "shadow_price_per_arcsec": _number(found.shadow_price),
        "optimality_gap": _number(found.gap),
        "proof": found.proof,
        "entries": entries,
        "verified_before": _verification_json(found.verified_before),
        "verified": _verification_json(found.verified),
        "tighten_first": [rate.label for rate in found.tighten_first],
        "relax_first": [rate.label for rate in found.relax_first],
        "inputs": _files(files),
        "version": rverror.__version__,
    }


def _verification_json(verified: Verification) -> dict[str, Any]:
    return {
        "level": verified.level,
        "quantile_arcsec": _arcsec(verified.quantile),
        "low_arcsec": _arcsec(verified.low),
        "high_arcsec": _arcsec(verified.high),
        "units": verified.units,
        "seed": verified.seed,
    }
