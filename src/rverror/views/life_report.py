"""What runs of a unit over its life say, for programs: um and arcsec."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from rverror.base.numbers import in_arcsec, rounded
from rverror.base.units import DISPLAY_UNITS, to_display
from rverror.life.result import Changed, Grown, RunsCompared, Trend
from rverror.lots.result import Interval
from rverror.views.envelope import InputFile, enveloped


def trend_json(result: Trend, *, files: Sequence[InputFile] = ()) -> dict[str, Any]:
    """Trend as plain data for `json.dump`; None where something is not determined."""
    left = result.remaining
    per = result.unit
    return enveloped(
        "Trend",
        {
            "model": result.model,
            "time_unit": per,
            "sessions": [rounded(float(x)) for x in result.at],
            "conditions": list(result.conditions),
            "chance": rounded(result.chance),
            "growing": [
                {
                    **_place(one, grown),
                    "course": one.course,
                    f"rate_per_{per}": _shown(grown.rate.value, grown.dimension),
                    "interval": _ends(grown.rate, grown.dimension),
                    "change": _shown(grown.change.value, grown.dimension),
                    "change_interval": _ends(grown.change, grown.dimension),
                    "since": rounded(one.since),
                    "since_interval": [rounded(one.earliest), rounded(one.latest)],
                    "time_constant": rounded(one.settling) if one.settling else None,
                    **_beside(one),
                }
                for one in result.growing
                for grown in one.parameters
            ],
            "jumps": [
                {
                    "at": rounded(one.since),
                    **_place(one, grown),
                    "size": _shown(grown.change.value, grown.dimension),
                    "interval": _ends(grown.change, grown.dimension),
                    **_beside(one),
                }
                for one in result.jumps
                for grown in one.parameters
            ],
            f"remaining_{per}s": None
            if left is None or left.time is None
            else [_time(left.time.low), _time(left.time.high)],
            "limit": None
            if left is None
            else {"quantity": left.quantity, "limit_arcsec": in_arcsec(left.limit), "now_arcsec": in_arcsec(left.now)},
            "peak_to_peak_arcsec": [[in_arcsec(float(x)) for x in row] for row in result.peak_to_peak],
            "lost_motion_arcsec": [[in_arcsec(float(x)) for x in row] for row in result.lost_motion],
            "notes": list(result.notes),
        },
        files,
    )


def compared_json(result: RunsCompared, *, files: Sequence[InputFile] = ()) -> dict[str, Any]:
    """Two measurements compared, as plain data for `json.dump`."""
    return enveloped(
        "RunsCompared",
        {
            "conditions": list(result.conditions),
            "noise_arcsec": in_arcsec(result.noise),
            "changed": [
                {
                    "order": one.order,
                    "condition": one.condition,
                    "unit": DISPLAY_UNITS["angle"],
                    "before": in_arcsec(one.before),
                    "after": in_arcsec(one.after),
                    "interval": _ends(one.interval, "angle"),
                    "difference": in_arcsec(one.difference),
                    "chance": rounded(one.chance),
                }
                for one in result.orders
            ]
            + [
                {
                    **_place(one, grown),
                    "before": 0.0,
                    "after": _shown(grown.change.value, grown.dimension),
                    "interval": _ends(grown.change, grown.dimension),
                    **_beside(one),
                }
                for one in result.changed
                for grown in one.parameters
            ],
            "notes": list(result.notes),
        },
        files,
    )


def _place(one: Changed, grown: Grown) -> dict[str, Any]:
    return {
        "key": one.key,
        "indices": dict(one.indices),
        "parameter": grown.name,
        "unit": DISPLAY_UNITS[grown.dimension],
    }


def _beside(one: Changed) -> dict[str, Any]:
    return {
        "measuring": one.measuring,
        "evidence": rounded(one.evidence),
        "indistinguishable_from": [{"key": key, "indices": dict(indices)} for key, indices in one.rivals],
    }


def _shown(value: float, dimension: str) -> float | None:
    return rounded(to_display(value, dimension))


def _ends(one: Interval, dimension: str) -> list[float | None]:
    return [_shown(end, dimension) for end in (one.low, one.high)]


def _time(value: float) -> float | None:
    return None if math.isinf(value) else rounded(value)
