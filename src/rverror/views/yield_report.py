"""Yields at the load: their table, for people and for programs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial
from itertools import zip_longest
from typing import Any

from rverror.base.numbers import brief, rounded
from rverror.base.units import ARCSEC
from rverror.tolerances.loaded_yield import LimitYield, Verified
from rverror.views.blocks import Ends, Sheet, line
from rverror.views.fields import OWN, Field, entry, listing, rows, value_at
from rverror.views.variables import ANGLE, NUMBER, PERCENT, Unit, Variable

#: Quantiles that are told.
LEVELS = (0.5, 0.95, 0.99)
#: Of a torsional stiffness, as makers print it.
_STIFFENED = Unit("N*mm/rad", "N*m/arcmin", 1e3 / (60 * ARCSEC))


def _unit(one: LimitYield) -> Unit:
    return _STIFFENED if one.limit.quantity == "stiffness" else ANGLE


def _if_limited(name: str, one: LimitYield) -> Any:
    """What is known of a quantity that has a limit alone."""
    return None if one.limit.value is None else getattr(one, name)


_share, _interval = partial(_if_limited, "share"), partial(_if_limited, "interval")


def _quantile(level: float, one: LimitYield) -> float:
    return one.quantile(level).value


def yields(found: Verified) -> dict[str, Variable]:
    """Rows of limits at the load."""
    quantiles: dict[str, Field] = {f"p{100 * level:g}": (partial(_quantile, level), OWN) for level in LEVELS}
    shares: dict[str, Field] = {
        "yield": (_share, NUMBER),
        "yield_low": (lambda one: value_at(_interval(one), "0"), NUMBER),
        "yield_high": (lambda one: value_at(_interval(one), "1"), NUMBER),
    }
    return rows(
        "limit_at_load",
        found.limits,
        "",
        ("limit_unit", _unit),
        limit_at_load="limit.label",
        limit_value=("limit.value", OWN),
        **quantiles,
        **shares,
    )


def yield_sheet(found: Verified, closed: Sequence[float | None] = ()) -> Sheet:
    """Yields at the load as a report: each limit, quantiles of what the units have, and the yield with its interval.

    Parameters
    ----------
    found : Verified
    closed : sequence of float or None
        Yield of each limit in closed form, where that is compared.
    """

    def quantile(level: float, row: tuple[LimitYield, Any]) -> float | None:
        value = float(row[0].limit.shown(row[0].quantile(level).value))
        return value if math.isfinite(value) else None

    first = found.limits[0]
    heads: dict[str, Field] = {
        "at the load": "0.limit.label",
        "limit": ("0.limit.value", OWN),
        **{f"P{100 * level:g}": partial(quantile, level) for level in LEVELS},
        "unit": "0.limit.unit",
        "yield, %": (lambda row: _share(row[0]), PERCENT),
        f"{100 * first.confidence:g} % interval": lambda row: (ends := _interval(row[0])) and Ends(map(_percent, ends)),
        "yield in closed form, %": ("1", PERCENT),
    }
    low, high = map(_percent, found.together_interval)
    together = f"All limits together are met by {_percent(found.together):.4g} % of the units, {low:.4g} to {high:.4g}."
    failed = f"{len(found.failures)} units have no equilibrium and count as bad: {(*found.failures, '')[0]}."
    limited = [one for one in found.limits if one.limit.value is not None]
    return (
        *listing(zip_longest(found.limits, closed), heads, own=lambda row: _unit(row[0])),
        *line(together if len(limited) > 1 else ""),
        *line(failed if found.failures else ""),
        *line(
            f"{first.units} units drawn afresh, seed {found.seed}, solved by the equilibrium. A quantile far "
            "within the limit may not be known; P99 of a stiffness is what 99 % of the units do not fall below."
        ),
    )


def _percent(share: float) -> float:
    return 100 * share


def yield_entries(found: Verified) -> list[dict[str, Any]]:
    """Entries of JSON, one for each limit: the quantity, its torque and limit with their units, the yield."""
    ends: dict[str, Field] = dict.fromkeys(("value", "low", "high"), OWN)
    return [
        {
            "torque": None if one.limit.torque is None else one.limit.load(6),
            "limit": None
            if one.limit.value is None
            else f"{brief(one.limit.shown(one.limit.value), 6)} {one.limit.unit}",
            "method": "equilibrium",
            **entry(
                one,
                quantity="limit.quantity",
                level="limit.level",
                interval=(_interval, NUMBER),
                confidence=None,
                units=None,
                unit="limit.unit",
                **{"yield": (_share, NUMBER)},
            ),
            **{f"p{100 * level:g}": entry(one.quantile(level), _unit(one), **ends) for level in LEVELS},
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
