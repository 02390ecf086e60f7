"""A lot for programs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from rverror.base.numbers import in_arcsec, rounded
from rverror.base.units import DISPLAY_UNITS, to_display
from rverror.diagnosis.result import Diagnosis
from rverror.geartrain.source import IndexValue
from rverror.lots.result import Interval, Lot, MadeBy, Predicted, Shift
from rverror.views.diagnosis_report import diagnosis_json
from rverror.views.envelope import InputFile, enveloped

# --- for programs -----------------------------------------------------------------------------------------------------


def lot_json(result: Lot, *, files: Sequence[InputFile] = ()) -> dict[str, Any]:
    """Lot as plain data for `json.dump`: um and arcsec, None where something is not determined."""
    worst = max(result.predicted, key=lambda one: one.quantile.value, default=None)
    return enveloped(
        "Lot",
        {
            "model": result.model,
            "units": result.units,
            "conditions": list(result.conditions),
            "chance": rounded(result.chance),
            "processes": _processes(result),
            "shifts": [_shift(one) for one in result.shifts],
            "stiffness": {
                name: {"ratio": rounded(one.value), "interval": _ends(one)} for name, one in result.stiffness.items()
            },
            "outliers": [
                {
                    "unit": one.serial,
                    "distance": rounded(one.distance),
                    "chance": rounded(one.chance),
                    "added": _added(one.causes, one.rivals),
                    "diagnosis": None if one.diagnosis is None else _of_unit(one.diagnosis),
                }
                for one in result.outsiders
            ],
            "groups": [
                {
                    "label": one.label,
                    "value": one.value,
                    "units": one.units,
                    "chance": rounded(one.chance),
                    **_difference(cause),
                    "indistinguishable_from": list(one.rivals),
                }
                for one in result.differences
                for cause in one.causes
            ],
            "changes": [
                {
                    "since": one.since,
                    "course": one.course,
                    "chance": rounded(one.chance),
                    **_difference(one.cause),
                    "indistinguishable_from": list(one.rivals),
                }
                for one in result.changes
            ],
            "predicted": None if worst is None else _predicted(worst),
            "predicted_by_condition": [_predicted(one) for one in result.predicted],
            "orders": [int(order) for order in result.orders],
            "rms_by_order": [
                {
                    "condition": condition,
                    "measured_arcsec": [in_arcsec(float(x)) for x in measured],
                    "made_arcsec": [in_arcsec(float(x)) for x in made],
                }
                for condition, measured, made in zip(result.conditions, result.amplitudes, result.made, strict=False)
            ],
            "notes": list(result.notes),
        },
        files,
    )


def _processes(result: Lot) -> list[dict[str, Any]]:
    """An entry for each process and parameter; and for each part whose mean is told by itself."""
    means: dict[tuple[Any, ...], Shift] = {_place(s.key, s.indices, s.parameter): s for s in result.means}
    found = []
    for one in result.processes:
        for name in one.parameters:
            found.append(_process(one, name, one.indices, means.get(_place(one.key, one.indices, name))))
            for shift in result.means:
                part = shift.key == one.key and shift.parameter == name and dict(shift.indices) != dict(one.indices)
                if part and one.indices.items() <= shift.indices.items():
                    found.append(_process(one, name, shift.indices, shift))
    return found


def _place(key: str, indices: Mapping[str, IndexValue], parameter: str) -> tuple[Any, ...]:
    return key, frozenset(indices.items()), parameter


def _process(one: MadeBy, parameter: str, indices: Mapping[str, IndexValue], mean: Shift | None) -> dict[str, Any]:
    dimension, deviation = one.dimension, one.deviation
    return {
        "key": one.key,
        "parameter": parameter,
        "indices": dict(indices),
        "unit": DISPLAY_UNITS[dimension],
        **_mean(mean),
        "sd": None if deviation is None else _shown(deviation.value, dimension),
        "sd_interval": None if deviation is None else _ends(deviation, dimension),
        "above_zero": one.above_zero,
        "share": rounded(one.share),
        "with": list(one.alike),
        "units_needed": one.units_needed,
        "tolerance": one.tolerance or None,
        "cp": rounded(one.capability),
        "cpk": rounded(one.capability_centred),
        "least_difference": None if one.least_difference is None else _shown(one.least_difference, dimension),
        "least_error": None if one.least_error is None else _shown(one.least_error, dimension),
    }


def _mean(shift: Shift | None) -> dict[str, Any]:
    if shift is None:
        return {"mean": None, "mean_interval": None}
    return {"mean": _shown(shift.size.value, shift.dimension), "mean_interval": _ends(shift.size, shift.dimension)}


def _shift(one: Shift) -> dict[str, Any]:
    return {
        "key": one.key,
        "indices": dict(one.indices),
        "parameter": one.parameter,
        "value": _shown(one.size.value, one.dimension),
        "interval": _ends(one.size, one.dimension),
        "unit": DISPLAY_UNITS[one.dimension],
    }


def _difference(one: Shift) -> dict[str, Any]:
    told = _shift(one)
    return {"difference" if name == "value" else name: value for name, value in told.items()}


def _added(causes: Sequence[Shift], rivals: Sequence[str]) -> list[dict[str, Any]]:
    """Causes by their place, each with its parameters."""
    parts: dict[tuple[Any, ...], list[Shift]] = {}
    for cause in causes:
        parts.setdefault(_place(cause.key, cause.indices, ""), []).append(cause)
    return [
        {
            "key": some[0].key,
            "indices": dict(some[0].indices),
            "parameters": {one.parameter: _bounded(one) for one in some},
            "indistinguishable_from": list(rivals),
        }
        for some in parts.values()
    ]


def _of_unit(found: Diagnosis) -> dict[str, Any]:
    whole = diagnosis_json(found)
    return {name: whole[name] for name in ("verdict", "added")}


def _bounded(one: Shift) -> dict[str, Any]:
    value, low, high = (_shown(x, one.dimension) for x in (one.size.value, one.size.low, one.size.high))
    return {"value": value, "unit": DISPLAY_UNITS[one.dimension], "low": low, "high": high}


def _predicted(one: Predicted) -> dict[str, Any]:
    return {
        "condition": one.condition,
        "mean_arcsec": in_arcsec(one.mean),
        "p95_arcsec": in_arcsec(one.quantile.value),
        "p95_interval": _ends(one.quantile, "angle"),
        "measured_mean_arcsec": in_arcsec(one.seen[0]),
        "measured_p95_arcsec": in_arcsec(one.seen[1]),
    }


def _shown(value: float, dimension: str) -> float | None:
    return rounded(to_display(value, dimension))


def _ends(one: Interval, dimension: str = "number") -> list[float | None]:
    return [_shown(end, dimension) for end in (one.low, one.high)]
