"""Yields at the load: their variables, their entries in JSON, what is to be read beside them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from rverror.base.numbers import brief, rounded
from rverror.base.units import ARCSEC
from rverror.tolerances.loaded_yield import LimitYield, Verified
from rverror.views.fields import OWN, Field, entry, rows
from rverror.views.variables import ANGLE, PERCENT, Unit, Variable

#: Quantiles that are told.
LEVELS = (0.5, 0.95, 0.99)
#: Of a torsional stiffness, as makers print it.
_STIFFENED = Unit("N*mm/rad", "N*m/arcmin", 1e3 / (60 * ARCSEC))


def _unit(one: LimitYield) -> Unit:
    return _STIFFENED if one.limit.quantity == "stiffness" else ANGLE


def _quantile(level: float, row: tuple[LimitYield, Any]) -> float:
    return row[0].quantile(level).value


def yields(found: Verified, closed: Sequence[float | None]) -> dict[str, Variable]:
    """Rows of limits at the load, with the yield in closed form beside each; a quantity without a limit has none."""
    each = [
        (one, None if one.limit.value is None else (one.share, *one.interval), share)
        for one, share in zip(found.limits, closed, strict=True)
    ]
    quantiles: dict[str, Field] = {f"p{100 * level:g}": (partial(_quantile, level), OWN) for level in LEVELS}
    shares: dict[str, Field] = {
        name: (f"1.{at}", PERCENT) for at, name in enumerate(("yield", "yield_low", "yield_high"))
    }
    return rows(
        "limit_at_load",
        each,
        "",
        ("limit_at_load_unit", lambda row: _unit(row[0])),
        limit_at_load="0.limit.label",
        limit_value=("0.limit.value", OWN),
        **quantiles,
        **shares,
        yield_in_closed_form=("2", PERCENT),
    )


def yield_words(found: Verified) -> tuple[str, ...]:
    """Yield of all limits together, how many units were solved, and what the quantiles are of."""
    share, low, high = (100 * one for one in (found.together, *found.together_interval))
    limited = [one for one in found.limits if one.limit.value is not None]
    told = []
    if len(limited) > 1:
        told.append(f"All limits together are met by {share:.4g} % of the units, {low:.4g} to {high:.4g}.")
    if found.failures:
        told.append(f"{len(found.failures)} units have no equilibrium and count as bad: {found.failures[0]}.")
    first = found.limits[0]
    told.append(
        f"At the load: {first.units} units drawn afresh, seed {found.seed}, solved by the equilibrium, contacts that "
        f"open included; interval: {100 * first.confidence:g} %. A quantile far within the limit may not be known; P99 "
        "of a stiffness is what 99 % of the units do not fall below."
    )
    return tuple(told)


def yield_entries(found: Verified) -> list[dict[str, Any]]:
    """Entries of JSON, one for each limit: the quantity, its torque and limit with their units, the yield."""
    return [_yield_entry(one) for one in found.limits]


def _yield_entry(one: LimitYield) -> dict[str, Any]:
    limit = one.limit
    told: dict[str, Any] = {"limit": None, "yield": None, "interval": None}
    if limit.value is not None:
        told["limit"] = f"{brief(limit.shown(limit.value), 6)} {limit.unit}"
        told |= {"yield": rounded(one.share), "interval": [rounded(end) for end in one.interval]}
    return {
        **entry(one, quantity="limit.quantity", level="limit.level", confidence=None, units=None),
        "torque": None if limit.torque is None else limit.load(6),
        **told,
        "method": "equilibrium",
    }


def together_entry(found: Verified) -> dict[str, Any]:
    """Entry of JSON: the yield of all limits together, and units without an equilibrium."""
    ends = [rounded(end) for end in found.together_interval]
    return {
        "all_limits": {"yield": rounded(found.together), "interval": ends},
        "units_without_equilibrium": len(found.failures),
        "seed": found.seed,
    }
