"""Budgets and an allocation for programs, and how their sizes are called."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.errors import InputError
from rverror.base.numbers import at_input_speed, in_arcsec, rounded, way
from rverror.base.units import ARCSEC
from rverror.model.catalogue import source
from rverror.tolerances.allocation import Allocation, ClosedFormQuantile
from rverror.tolerances.closed_form import Budget
from rverror.tolerances.full_budget import ErrorBudget
from rverror.tolerances.loaded_budget import LoadedBudget
from rverror.tolerances.sampling import IntervalEstimate, Size, VirtualUnits
from rverror.tolerances.sobol import SobolIndices
from rverror.views.envelope import InputFile, enveloped
from rverror.views.kinds import described
from rverror.views.variables import columns
from rverror.views.yield_report import LEVELS, together_entry, yield_entries

_ROUNDING = 1e-9 * ARCSEC
#: Of all intervals that are told: of the estimate, where other draws of as many units would put it.
CONFIDENCE = 0.95
OF_ESTIMATE = f"{100 * CONFIDENCE:g} % interval of the Monte Carlo estimate"
#: Sizes of an output error: name in the code, for people, and key in JSON.
SIZES: tuple[tuple[Size, str, str], ...] = (
    ("peak_to_peak", "peak-to-peak", "peak_to_peak_arcsec"),
    ("max", "max |TE - offset|", "max_arcsec"),
    ("rms", "rms", "rms_arcsec"),
    ("offset", "offset", "offset_arcsec"),
)


def _parts(found: ErrorBudget | Budget) -> tuple[Budget, VirtualUnits | None, SobolIndices | None]:
    return (found, None, None) if isinstance(found, Budget) else (found.closed, found.units, found.indices)


def _check_no_limit(limit: float | None) -> None:
    if limit is not None:
        raise InputError("limit: a budget in closed form knows no yield; leave it out, or give an error_budget")


def nominal_of(closed: Budget, size: Size) -> float:
    """Of the model with every toleranced value at its mean."""
    return {
        "peak_to_peak": closed.nominal_peak_to_peak,
        "max": float(np.abs(closed.mean - closed.offset_mean).max()),
        "rms": math.sqrt(closed.nominal_mean_square),
        "offset": closed.offset_mean,
    }[size]


def worst_of(closed: Budget, size: Size) -> float:
    """Exact worst case; not a number for the rms, of which none is known."""
    worst = closed.worst
    return {
        "peak_to_peak": worst.peak_to_peak,
        "max": worst.maximum,
        "rms": math.nan,
        "offset": max(worst.offset, key=abs),
    }[size]


def _interval(estimate: IntervalEstimate, scale: float = ARCSEC) -> dict[str, float | None]:
    return {name: rounded(getattr(estimate, name) / scale) for name in ("value", "low", "high")}


def budget_json(
    found: ErrorBudget | Budget, *, limit: Any | None = None, files: Sequence[InputFile] = ()
) -> dict[str, Any]:
    """Budget as plain data for `json.dump`; keys are only ever added.

    Parameters
    ----------
    found : ErrorBudget or Budget
    limit : float or str or quantity, optional
        Of the peak-to-peak, rad: the yield of an `ErrorBudget` is told at it.
    files : sequence of InputFile, optional
        What it was made from.

    Returns
    -------
    dict
        Sizes in arcsec and um; numbers that are not determined are None.

    Raises
    ------
    InputError
        If a limit is given for a budget in closed form, which knows no yield.

    Examples
    --------
    >>> import rverror
    >>> cams = [rverror.tolerance("crank.eccentricity", "5 um", crank=0, disc=0)]
    >>> found = rverror.error_budget(rverror.Model(rverror.reducer("RV-40E")), cams, count=512, index_count=0)
    >>> round(budget_json(found)["peak_to_peak_arcsec"]["worst_case"], 2)
    18.51
    """
    limit = None if limit is None else units.named_core("limit", limit, "angle")
    closed, drawn, indices = _parts(found)
    sizes = {
        key: {
            "nominal": in_arcsec(nominal_of(closed, size)),
            **({} if drawn is None else _drawn_json(drawn, size)),
            "worst_case": in_arcsec(worst_of(closed, size)),
        }
        for size, _, key in SIZES
    }
    sizes["peak_to_peak_arcsec"]["root_sum_of_squares"] = in_arcsec(closed.rss)
    sizes["rms_arcsec"]["root_of_expected_mean_square"] = in_arcsec(closed.rms)
    entries = _entries(closed, _CONTRIBUTION)
    for at, entry in enumerate(entries):
        entry |= {f"sobol_{which}": _sobol_json(indices, which, at) for which in ("first", "total")}
    if isinstance(found, Budget):
        _check_no_limit(limit)
        return enveloped("Budget", {"angles": closed.mean.size, **sizes, "contributions": entries}, files)
    content = {
        "model": found.model.name or found.model.mechanism.name,
        "confidence": CONFIDENCE,
        "direction": way(found.direction),
        "angles": closed.mean.size,
        "input_speed_rpm": _rpm(found.stack.speed),
        "components": len(found.stack.components),
        "units": found.units.count,
        "seed": found.units.seed,
        **sizes,
        "limit_arcsec": in_arcsec(limit),
        "yield": None if limit is None else _interval(found.units.yield_at(limit), 1.0),
        "contributions": [
            {"label": entry["label"], "key": tolerance.key, **entry, **cause_of(found, at)}
            for at, (tolerance, entry) in enumerate(zip(found.tolerances, entries, strict=True))
        ],
        "limits": [] if found.at_load is None else _loaded_entries(found, found.at_load),
        **({} if found.at_load is None else together_entry(found.at_load.verified)),
    }
    return enveloped("ErrorBudget", content, files)


def _loaded_entries(found: ErrorBudget, loaded: LoadedBudget) -> list[dict[str, Any]]:
    """Entries of the limits in JSON, with what the closed form says and the share of each tolerance."""
    labels = [item.label for item in found.closed.contributions]
    beside = zip(yield_entries(loaded.verified), loaded.closed_form, loaded.worst_parts, loaded.shares, strict=True)
    return [
        {
            **entry,
            "closed_form_yield": rounded(share),
            "worst_parts_arcsec": in_arcsec(worst),
            "shares": []
            if indices is None
            else [{"label": label, **(_sobol_json(indices, "total", e) or {})} for e, label in enumerate(labels)],
        }
        for entry, share, worst, indices in beside
    ]


def cause_of(found: ErrorBudget, at: int) -> dict[str, Any]:
    """Where the error of a tolerance sits, its orders, its limits, and what one unit of it makes."""
    item, stack = found.tolerances[at], found.stack
    entry, mechanism = source(item.key), found.model.mechanism
    orders = {order for indices in item.instances(mechanism) for order in entry.orders(mechanism, indices)}
    dimension = item.chosen[0].dimension
    waves = stack.influence[stack.blocks[at].components]
    middle = item.mean.get(item.chosen[0].name, 0.0) + item.distribution.middle * item.width
    one = len(item.chosen) == 1 and not item.distribution.vector
    ends = (middle - item.width, middle + item.width) if one else (None, None)
    return {
        "frame": entry.frame,
        "orders": sorted(orders),
        "distribution": item.distribution.name,
        **{
            name: None if end is None else rounded(units.to_display(end, dimension))
            for name, end in zip(("lower_limit", "upper_limit"), ends, strict=True)
        },
        "peak_to_peak_per_unit_arcsec": in_arcsec(
            float(np.ptp(waves, axis=1).max(initial=0.0)) / units.to_display(1.0, dimension)
        ),
    }


def _rpm(speed: float | None) -> float | None:
    return None if speed is None else rounded(units.to_display(speed, "angular_speed"))


def _drawn_json(drawn: VirtualUnits, size: Size) -> dict[str, Any]:
    return {
        **{f"p{level * 100:g}": _interval(drawn.quantile(level, size)) for level in LEVELS},
        "mean": in_arcsec(float(getattr(drawn, size).mean())),
    }


def _sobol_json(indices: SobolIndices | None, which: str, at: int) -> dict[str, float | None] | None:
    if indices is None:
        return None
    ends = (("value", ""), ("low", "_low"), ("high", "_high"))
    return {name: rounded(float(getattr(indices, f"{which}{end}")[at])) for name, end in ends}


#: Keys of a contribution, and the columns of its table.
_CONTRIBUTION = {
    "label": "tolerance",
    "width": "width",
    "unit": "unit",
    "components": "components",
    "effect": "effect",
    "share_of_variance": "share",
    "mean_peak_to_peak_alone_arcsec": "mean_peak_to_peak",
    "worst_peak_to_peak_alone_arcsec": "worst_peak_to_peak",
    "part_of_worst_case_arcsec": "worst_part",
    "offset_deviation_arcsec": "offset_deviation",
    "worst_offset_arcsec": "worst_offset",
}


def _entries(found: Budget | Allocation, names: Mapping[str, str]) -> list[dict[str, Any]]:
    """Rows of a result's table as people read them, columns under other names."""
    shown, _ = columns(described(found), display=True)
    rows = zip(*(np.asarray(shown[name]).tolist() for name in names.values()), strict=True)
    return [
        {key: rounded(value) if isinstance(value, float) else value for key, value in zip(names, row, strict=True)}
        for row in rows
    ]


def limited_by(found: Allocation) -> str:
    """What an allocation limits, in words."""
    quantile = f"P{100 * found.level:g} of the peak-to-peak"
    used = f"share of its limits that a unit uses, P{100 * found.level:g}"
    return {"worst": "worst-case peak-to-peak", "yield": quantile, "rms": "expected rms", "load": used}[found.kind]


def within(found: Allocation) -> str:
    """What an allocation is for, to stand behind "Least cost"."""
    if found.kind == "load":
        return f"at which {100 * found.level:g} % of the units meet all limits at the load"
    return f"for {limited_by(found)} within {found.limit / ARCSEC:.4g} arcsec{at_input_speed(found.speed)}"


def allocation_json(found: Allocation, *, files: Sequence[InputFile] = ()) -> dict[str, Any]:
    """Allocation as plain data for `json.dump`; keys are only ever added.

    Parameters
    ----------
    found : Allocation
    files : sequence of InputFile, optional
        What it was made from.

    Returns
    -------
    dict
        Sizes in arcsec and um.

    Examples
    --------
    >>> import rverror
    >>> from rverror.tolerances.cost import Reciprocal
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> cams = [rverror.tolerance("crank.eccentricity", "5 um", cost=Reciprocal(12.0, 0.005))]
    >>> found = rverror.allocate(unit, cams, limit="37 arcsec", kind="worst", verify=1000)
    >>> [(entry["width_before"], entry["unit"]) for entry in allocation_json(found)["entries"]]
    [(5.0, 'um')]
    """
    widths = ("width_before", "width", "unit", "grade", "fixed", "cost_before", "cost")
    loaded = found.verified is not None
    per = "percent_of_limits" if loaded else "arcsec"
    names = (*widths, f"saved_per_{per}_given_up", f"cost_per_{per}_gained")
    shown = _entries(found, {name: name for name in names})
    named = zip(found.labels, found.keys, found.grades, shown, strict=True)
    entries = [{"label": label, "key": key, **entry, "grade": grade} for label, key, grade, entry in named]
    for entry, held in zip(entries, found.held_by, strict=False):
        entry["held_by"] = held
    if found.verified is None:
        sizes = {
            "limit_arcsec": in_arcsec(found.limit),
            "input_speed_rpm": _rpm(found.speed),
            "value_before_arcsec": in_arcsec(found.value_before),
            "value_arcsec": in_arcsec(found.value),
        }
        verified: dict[str, Any] = {"verified": []}
    else:
        sizes = {
            "limit_arcsec": None,
            "input_speed_rpm": None,
            "used_before_percent": rounded(100 * found.value_before),
            "used_percent": rounded(100 * found.value),
        }
        verified = {
            "verified": yield_entries(found.verified),
            **together_entry(found.verified),
            "cost_scaled_alike": rounded(found.uniform_cost),
        }
    content = {
        "model": found.model or None,
        "kind": found.kind,
        "level": found.level,
        **sizes,
        "cost_before": rounded(found.cost_before),
        "cost": rounded(found.cost),
        "confidence": found.closed_form.confidence,
        f"shadow_price_per_{per}": rounded(found.shadow_price),
        "optimality_gap": rounded(found.gap),
        "proof": found.proof,
        "entries": entries,
        **verified,
        "closed_form_before": _closed_form_json(found.closed_form_before),
        "closed_form": _closed_form_json(found.closed_form),
        "tighten_first": [rate.label for rate in found.tighten_first],
        "relax_first": [rate.label for rate in found.relax_first],
    }
    return enveloped("Allocation", content, files)


def _closed_form_json(found: ClosedFormQuantile) -> dict[str, Any]:
    return {
        "method": "closed form, contacts closed",
        "level": found.level,
        "quantile_arcsec": in_arcsec(found.quantile),
        "low_arcsec": in_arcsec(found.low),
        "high_arcsec": in_arcsec(found.high),
        "units": found.units,
        "seed": found.seed,
    }
