"""What the tolerances of a stack cost together: curves, bounds and grades as arrays.  Page ``theory/allocation.md``."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.tolerances.cost import SAME_WIDTH, Choice, Cost, Grades

Mask = npt.NDArray[np.bool_]

#: Share of the width as given that bounds allow where none are given, downwards and upwards.
BOUNDS = (0.1, 10.0)


@dataclass(frozen=True)
class CostModel:
    """Costs, bounds and grades of all entries as arrays.

    A smooth cost is ``base + factor / T**power``; factor 0 where an entry is fixed or has a table.
    """

    labels: tuple[str, ...]
    choices: tuple[Choice, ...]
    given: Array
    low: Array
    high: Array
    smooth: Mask
    factor: Array
    power: Array
    tables: tuple[tuple[int, Grades, tuple[int, ...]], ...]  # entry, its cost, the grades that the bounds allow

    @property
    def fixed(self) -> Mask:
        """Which entries keep their width."""
        return np.array([choice.fixed for choice in self.choices], dtype=bool)

    def each(self, widths: Array) -> Array:
        """Cost of every entry."""
        pairs = zip(self.choices, widths, strict=True)
        return np.array([choice.cost.cost(float(width)) if choice.cost else 0.0 for choice, width in pairs])

    @property
    def before(self) -> Array:
        """Cost of every entry at the widths as given, not a number where no grade is as fine."""
        known = np.array([_is_sold(choice.cost, w) for choice, w in zip(self.choices, self.given, strict=True)])
        return np.where(known, self.each(np.where(known, self.given, self.low)), np.nan)

    def total(self, widths: Array) -> float:
        """Cost of all entries."""
        return math.fsum(self.each(widths))

    def slopes(self, widths: Array) -> Array:
        """Derivative of the smooth costs, 0 elsewhere."""
        return -self.power * self.factor / widths ** (self.power + 1)

    def relaxed(self, idle: Mask) -> CostModel:
        """The same with the largest widths alone where the width does not matter."""
        free = idle & ~self.fixed
        tables = tuple((e, table, allowed[-1:] if free[e] else allowed) for e, table, allowed in self.tables)
        return replace(self, low=np.where(free, self.high, self.low), tables=tables)

    def holding(self, grades: Sequence[int]) -> CostModel:
        """The same with each table held at one of its grades."""
        held = self.given.copy()
        for (entry, table, _), grade in zip(self.tables, grades, strict=True):
            held[entry] = table.widths[grade]
        low, high = np.where(self.smooth, self.low, held), np.where(self.smooth, self.high, held)
        return replace(self, given=held, low=low, high=high, tables=())


def cost_model(labels: Sequence[str], given: Array, choices: Sequence[Choice]) -> CostModel:
    """Lay out what may be bought.

    Parameters
    ----------
    labels : sequence of str
        Names of the entries.
    given : ndarray, shape (entries,)
        Widths as given, core units.
    choices : sequence of Choice

    Raises
    ------
    InputError
        If one has no cost or unusable bounds, or none is free.
    """
    low, high = given.astype(np.float64), given.astype(np.float64)
    smooth, factor, power = np.zeros(len(labels), dtype=bool), np.zeros(len(labels)), np.ones(len(labels))
    tables = []
    for e, (label, choice) in enumerate(zip(labels, choices, strict=True)):
        cost, bounds = choice.cost, choice.bounds
        if choice.fixed:
            if not _is_sold(cost, float(given[e])):
                raise InputError(
                    f"{label}: fixed, and finer than its finest grade; add a finer grade or leave the cost out"
                )
            continue
        if cost is None:
            raise InputError(f"{label}: has no cost; give it one, or fixed = true")
        if isinstance(cost, Grades):
            allowed = _allowed(label, cost, bounds)
            tables.append((e, cost, allowed))
            low[e], high[e] = cost.widths[allowed[0]], cost.widths[allowed[-1]]
            continue
        low[e], high[e] = bounds or tuple(given[e] * share for share in BOUNDS)
        smooth[e], power[e], factor[e] = True, cost.power, cost.price * cost.at**cost.power
        if cost.price == 0:  # what costs nothing is as fine as may be and leaves the limit to the others
            high[e] = low[e]
    if not smooth.any() and not tables:
        raise InputError("all tolerances are fixed; leave fixed = true out where the width may change")
    return CostModel(
        tuple(labels), tuple(choices), given.astype(np.float64), low, high, smooth, factor, power, tuple(tables)
    )


def _is_sold(cost: Cost | None, width: float) -> bool:
    """Whether a cost is known of a width: not of one finer than all grades."""
    return not isinstance(cost, Grades) or cost.holds(width)


def _allowed(label: str, table: Grades, bounds: tuple[float, float] | None) -> tuple[int, ...]:
    low, high = bounds or (0.0, math.inf)
    allowed = tuple(g for g, w in enumerate(table.widths) if low * (1 - SAME_WIDTH) <= w <= high * (1 + SAME_WIDTH))
    if not allowed:
        raise InputError(f"{label}: no grade has a width within the bounds {low:g} to {high:g}; widen the bounds")
    return allowed
