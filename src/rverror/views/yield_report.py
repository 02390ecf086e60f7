"""Yields at the load for people and for programs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from rverror.base.numbers import brief, rounded
from rverror.tolerances.loaded_yield import LimitYield, Verified
from rverror.views.blocks import Ends, Sheet, columns_of, line

#: Quantiles that are told.
LEVELS = (0.5, 0.95, 0.99)


def yield_sheet(found: Verified, closed: Sequence[float | None] = ()) -> Sheet:
    """Yields at the load as a report: each limit, quantiles of what the units have, and the yield with its interval.

    Parameters
    ----------
    found : Verified
    closed : sequence of float or None
        Yield of each limit in closed form, where that is compared.
    """
    limited = [one for one in found.limits if one.limit.value is not None]
    shown: dict[str, list[Any]] = {
        "at the load": [one.limit.label for one in found.limits],
        "limit": [None if one.limit.value is None else one.limit.shown(one.limit.value) for one in found.limits],
    }
    for level in LEVELS:
        each = [one.limit.shown(one.quantile(level).value) for one in found.limits]
        shown[f"P{100 * level:g}"] = [value if math.isfinite(value) else None for value in each]
    shown["unit"] = [one.limit.unit for one in found.limits]
    shown["yield, %"] = [None if one.limit.value is None else 100 * one.share for one in found.limits]
    shown[f"{100 * found.limits[0].confidence:g} % interval"] = [
        None if one.limit.value is None else _percent(one.interval) for one in found.limits
    ]
    if closed:
        shown["yield in closed form, %"] = [None if share is None else 100 * share for share in closed]
    low, high = _percent(found.together_interval)
    together = f"All limits together are met by {_short(100 * found.together)} % of the units, {low:.4g} to {high:.4g}."
    failed = f"{len(found.failures)} units have no equilibrium and count as bad: {(*found.failures, '')[0]}."
    return (
        *columns_of(shown),
        *line(together if len(limited) > 1 else ""),
        *line(failed if found.failures else ""),
        *line(
            f"{found.limits[0].units} units drawn afresh, seed {found.seed}, solved by the equilibrium. A quantile far "
            "within the limit may not be known; P99 of a stiffness is what 99 % of the units do not fall below."
        ),
    )


def _percent(interval: tuple[float, float]) -> Ends:
    return Ends((100 * interval[0], 100 * interval[1]))


def _short(value: float) -> str:
    return f"{value:.4g}"


def yield_entries(found: Verified) -> list[dict[str, Any]]:
    """Entries of JSON, one for each limit: the quantity, its torque and limit with their units, the yield."""
    return [
        {
            "quantity": one.limit.quantity,
            "torque": None if one.limit.torque is None else one.limit.load(6),
            "limit": None if one.limit.value is None else _value(one, one.limit.value, 6),
            "level": one.limit.level,
            "yield": None if one.limit.value is None else rounded(one.share),
            "interval": None if one.limit.value is None else [rounded(end) for end in one.interval],
            "confidence": one.confidence,
            "units": one.units,
            "method": "equilibrium",
            "unit": one.limit.unit,
            **{f"p{100 * level:g}": _quantile(one, level) for level in LEVELS},
        }
        for one in found.limits
    ]


def together_entry(found: Verified) -> dict[str, Any]:
    """Entry of JSON: the yield of all limits together, and units without an equilibrium."""
    ends = [rounded(end) for end in found.together_interval]
    return {
        "all_limits": {"yield": rounded(found.together), "interval": ends},
        "units_without_equilibrium": len(found.failures),
        "seed": found.seed,
    }


def _quantile(one: LimitYield, level: float) -> dict[str, float | None]:
    found = one.quantile(level)
    values = {"value": found.value, "low": found.low, "high": found.high}
    return {name: rounded(one.limit.shown(x)) if math.isfinite(x) else None for name, x in values.items()}


def _value(one: LimitYield, value: float, digits: int = 4) -> str:
    return f"{brief(one.limit.shown(value), digits)} {one.limit.unit}"
