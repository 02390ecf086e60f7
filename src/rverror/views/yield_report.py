"""Yields at the load for people and for programs: lines of text, and the entries of JSON."""

from __future__ import annotations

import math
from typing import Any

from rverror.base.numbers import brief, rounded
from rverror.tolerances.loaded_yield import LimitYield, Verified

#: Quantiles that are told.
LEVELS = (0.5, 0.95, 0.99)


def yield_lines(found: Verified) -> list[str]:
    """Lines of a table: each limit, quantiles of what the units have, and the yield with its interval."""
    limited = [one for one in found.limits if one.limit.value is not None]
    heads = [f"P{100 * level:g}" for level in LEVELS]
    lines = [
        f"At the load, contacts that open included: {found.limits[0].units} units drawn afresh, seed {found.seed}; "
        f"[..] is the {100 * found.limits[0].confidence:g} % interval",
        f"{'':34s} {'limit':>20s} " + " ".join(f"{head:>7s}" for head in heads) + "   yield, %",
    ]
    for one in found.limits:
        value = "-" if one.limit.value is None else _value(one, one.limit.value)
        values = [one.limit.shown(one.quantile(level).value) for level in LEVELS]
        quantiles = " ".join(f"{brief(value) if math.isfinite(value) else '-':>7s}" for value in values)
        told = "" if one.limit.value is None else _share(one.share, one.interval)
        lines.append(f"{one.limit.label:34s} {value:>20s} {quantiles}   {told}".rstrip())
    if len(limited) > 1:
        lines.append(f"{'all limits together':77s}    {_share(found.together, found.together_interval)}".rstrip())
    if found.failures:
        lines.append(f"{len(found.failures)} units have no equilibrium and count as bad: {found.failures[0]}")
    return lines


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


def _share(share: float, interval: tuple[float, float]) -> str:
    return f"{100 * share:.4g} [{100 * interval[0]:.4g}, {100 * interval[1]:.4g}]"
