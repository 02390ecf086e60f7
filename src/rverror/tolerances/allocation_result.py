"""What an allocation found: widths of least cost, their costs and prices, and what the units made to them use."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from rverror.base.arrays import Array
from rverror.base.viewed import Viewed
from rverror.tolerances.cost import CostModel
from rverror.tolerances.least_cost import Found, Row, shadow_price
from rverror.tolerances.loaded_yield import ClosedFormUnits, Verified, verified
from rverror.tolerances.sampling import IntervalEstimate
from rverror.tolerances.specification import Limit
from rverror.tolerances.stacking import Stack

Kind = Literal["load", "yield", "worst"]

#: Units of the closed form that an allocation is told beside.
CLOSED_UNITS = 2**15

_STEP = 0.01  # of a limit, to which prices refer
_AT_BOUND = 1e-7  # of a width to its bound, relative


@dataclass(frozen=True)
class Rate:
    """Exchange of cost against the limits at the widths as given, for one entry, per 1 % of all limits.

    Both are None where an entry is fixed, or the width as given finer than all its grades.
    """

    label: str
    #: Cost saved by a wider tolerance; infinite where the width does not matter.  None where no wider one may be had.
    relax: float | None
    #: Cost of a finer tolerance.  None where no finer one may be had, or gains nothing.
    tighten: float | None


@dataclass(frozen=True)
class Allocation(Viewed):
    """Widths of least cost.

    Attributes
    ----------
    labels : tuple of str
        Name of each entry, as in the stack.
    kind : str
        ``"worst"`` or ``"yield"``, as in `allocate`; ``"load"`` of `allocate_at_load`.
    limit : float or None
        rad, of the closed forms.
    level : float
        Share of the units that meet the limits.
    widths_before, widths : tuple of float
        Core units.
    grades : tuple of str or None
        Grade of each entry whose cost is a table.
    fixed : tuple of bool
    costs_before : tuple of float
        Of each entry; not a number where the width as given is finer than all its grades.
    costs : tuple of float
        Of each entry.
    used_before, used : float
        Share of the limits that the worst unit uses, or of yields the unit at the level: of fresh units, those that
        verify, with the widths found.
    closed_form : IntervalEstimate
        Quantile at the level of the p-p of fresh units in closed form, contacts closed, rad.
    shadow_price : float or None
        Cost saved by 1 % more of all limits, grades held.  None where only grades are free.
    rates : tuple of Rate
        Of each entry.
    keys, dimensions : tuple of str
        Catalogue key of each entry, and dimension of its width; empty for a stack that does not tell its components.
    speed : float, optional
        Of the input, rad/s, as in the stack.
    held_by : tuple of str
        What keeps each entry at its width: ``"limit"`` of the error, ``"upper bound"``, ``"lower bound"``,
        ``"grade"`` of a table, ``"fixed"``.
    model : str
        Name of the unit, as in the stack.
    uniform_cost : float, optional
        Of yields: cost of the widths as given, all free ones scaled alike until a sample of units is as good; None
        where no scale makes it so.
    verified : Verified, optional
        Fresh units at the loads of all limits; of ``"load"`` alone, for a closed form verifies nothing.
    """

    labels: tuple[str, ...]
    kind: Kind
    limit: float | None
    level: float
    widths_before: tuple[float, ...]
    widths: tuple[float, ...]
    grades: tuple[str | None, ...]
    fixed: tuple[bool, ...]
    costs_before: tuple[float, ...]
    costs: tuple[float, ...]
    used_before: float
    used: float
    closed_form: IntervalEstimate
    shadow_price: float | None
    rates: tuple[Rate, ...]
    keys: tuple[str, ...] = ()
    dimensions: tuple[str, ...] = ()
    speed: float | None = None
    held_by: tuple[str, ...] = ()
    model: str = ""
    uniform_cost: float | None = None
    verified: Verified | None = None

    @property
    def cost_before(self) -> float:
        """Cost of all entries at the widths as given; not a number where that of one is not known."""
        return math.fsum(self.costs_before)

    @property
    def cost(self) -> float:
        """Cost of all entries."""
        return math.fsum(self.costs)

    @property
    def tighten_first(self) -> tuple[Rate, ...]:
        """Entries that may be tightened, the cheapest first."""
        return tuple(sorted((r for r in self.rates if r.tighten is not None), key=lambda r: r.tighten or 0.0))

    @property
    def relax_first(self) -> tuple[Rate, ...]:
        """Entries that may be relaxed, the largest saving first."""
        return tuple(sorted((r for r in self.rates if r.relax is not None), key=lambda r: -(r.relax or 0.0)))


@dataclass(frozen=True)
class FrontPoint:
    """Least cost for one limit.

    Attributes
    ----------
    limit : float
        rad.
    allocation : Allocation or None
        None where the limit cannot be met.
    reason : str
        Why it cannot be met, else empty.
    """

    limit: float
    allocation: Allocation | None
    reason: str = ""


def described(
    stack: Stack,
    costs: CostModel,
    found: Found,
    *,
    used_before: tuple[float, Array],
    binding: tuple[float, list[Row]],
    seed: int,
    level: float,
    **stated: Any,
) -> Allocation:
    """An allocation with its costs, prices and closed form.

    Parameters
    ----------
    stack : Stack
    costs : CostModel
    found : Found
    used_before : (float, ndarray)
        Share of the limits that is used with the widths as given, and its change with them.
    binding : (float, list of Row)
        Value that a constraint was brought to, and its rows that may bind.
    seed : int
        Of the units in closed form.
    level : float
    **stated
        The other fields of `Allocation` that do not follow from these.

    Returns
    -------
    Allocation
    """
    widths, held, (target, rows) = found.widths, costs.holding(found.grades), binding
    grades = {e: table.names[grade] for (e, table, _), grade in zip(costs.tables, found.grades, strict=True)}
    closed = ClosedFormUnits(stack, (Limit("transmission_error", None, None, level),))
    first = [stack.components[rule.components.start] for rule in stack.rules] if stack.components else []
    return Allocation(
        labels=costs.labels,
        keys=tuple(component.key for component in first),
        dimensions=tuple(component.dimension for component in first),
        speed=stack.speed,
        held_by=_held_by(costs, widths),
        model=stack.model,
        level=level,
        widths_before=_floats(costs.given),
        widths=_floats(widths),
        grades=tuple(map(grades.get, range(widths.size))),
        fixed=tuple(map(bool, costs.fixed)),
        costs_before=_floats(costs.each(costs.given)),
        costs=_floats(costs.each(widths)),
        used_before=used_before[0],
        closed_form=verified(closed, widths, count=CLOSED_UNITS, seed=seed).limits[0].quantile(level),
        shadow_price=_STEP * target * shadow_price(held, target, rows, widths) if held.smooth.any() else None,
        rates=_rates(costs, used_before[1]),
        **stated,
    )


def _held_by(costs: CostModel, widths: Array) -> tuple[str, ...]:
    """What keeps each entry where it is."""
    said = np.full(len(costs.labels), "limit", dtype=object)
    said[costs.smooth & (widths <= costs.low * (1 + _AT_BOUND))] = "lower bound"
    said[costs.smooth & (widths >= costs.high * (1 - _AT_BOUND))] = "upper bound"
    said[[e for e, _, _ in costs.tables]] = "grade"
    said[costs.fixed] = "fixed"
    return tuple(map(str, said))


def _floats(values: Array) -> tuple[float, ...]:
    return tuple(map(float, values))


def _rates(costs: CostModel, slope: Array) -> tuple[Rate, ...]:
    """Of each entry, from the change of the share used with the widths as given."""
    slopes = costs.slopes(costs.given)
    rates = [Rate(label, None, None) for label in costs.labels]
    for e in map(int, np.flatnonzero(costs.smooth)):
        rate = _rate(-float(slopes[e]), float(slope[e]))
        relax = rate if costs.given[e] < costs.high[e] else None
        rates[e] = Rate(costs.labels[e], relax, rate if costs.given[e] > costs.low[e] else None)
    for e, table, allowed in costs.tables:
        if not table.holds(float(costs.given[e])):
            continue
        here = table.index(float(costs.given[e]))
        steps: list[float | None] = []
        for others in ([g for g in allowed if g > here][:1], [g for g in allowed if g < here][-1:]):
            gain = [(table.prices[here] - table.prices[g], table.widths[g] - table.widths[here]) for g in others]
            steps.append(_rate(gain[0][0] / gain[0][1], float(slope[e])) if gain else None)
        rates[e] = Rate(costs.labels[e], *steps)
    return tuple(rates)


def _rate(saved: float, given_up: float) -> float:
    """Cost per step from cost and share per width; without bound where the width does not matter."""
    return saved / given_up * _STEP if given_up > 0 else math.inf
