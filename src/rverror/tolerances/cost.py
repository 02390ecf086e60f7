"""What a tolerance costs: smooth curves of its width, or a table of grades.

Widths are in the core unit of the tolerance (mm, rad), costs in any currency, the same for all tolerances.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import ClassVar

import numpy as np

from rverror.base.arrays import Array, Flags
from rverror.base.errors import InputError

#: Widths nearer than this, relatively, are one width: they come from texts with units.
SAME_WIDTH = 1e-9


@dataclass(frozen=True)
class _Curve:
    """Smooth cost: ``base + price * (at / T)**power``."""

    price: float
    at: float
    base: float = 0.0
    power: ClassVar[int]

    def __post_init__(self) -> None:
        """Check the values."""
        _check("price of a cost", self.price)
        _check("width of a cost ('at')", self.at, above_zero=True)
        _check("base of a cost", self.base)

    def cost(self, width: float) -> float:
        """Cost of a width, core unit."""
        return self.base + self.price * (self.at / _positive(width)) ** self.power


@dataclass(frozen=True)
class Reciprocal(_Curve):
    """Cost that grows as one over the width: ``cost(T) = base + price * at / T``.

    Attributes
    ----------
    price : float
        Cost above `base` at the width `at`, not negative.
    at : float
        Width to which `price` belongs, core unit.
    base : float
        Cost at any width, not negative.

    Raises
    ------
    InputError
        If a value is not finite or out of its bound.

    Examples
    --------
    >>> Reciprocal(price=12.0, at=0.005, base=3.0).cost(0.0025)  # half the width, twice the price
    27.0
    """

    power: ClassVar[int] = 1


@dataclass(frozen=True)
class ReciprocalSquare(_Curve):
    """Cost that grows as one over the square of the width: ``cost(T) = base + price * (at / T)**2``.

    Its values are those of `Reciprocal`.

    Examples
    --------
    >>> ReciprocalSquare(price=12.0, at=0.005, base=3.0).cost(0.0025)  # half the width, four times the price
    51.0
    """

    power: ClassVar[int] = 2


@dataclass(frozen=True)
class Grades:
    """Cost by a table: only these widths can be bought.

    Raises
    ------
    InputError
        If the lists differ in length or are empty, a value is not finite or out of its bound, a width comes twice, or a
        wider grade costs more than a finer one.

    Examples
    --------
    >>> table = Grades((0.005, 0.003), (18.0, 30.0), ("IT5", "IT4"))
    >>> table.names, table.cost(0.003)
    (('IT4', 'IT5'), 30.0)
    >>> table.cost(0.004)  # is held by the next finer grade
    30.0
    """

    widths: tuple[float, ...]  #: core unit; kept finest first, whatever the order given
    prices: tuple[float, ...]  #: cost of each width, not negative; a wider grade costs no more than a finer one
    names: tuple[str, ...]  #: what people call each grade, such as ``"IT5"``

    def __post_init__(self) -> None:
        """Check the grades and put the finest first."""
        counts = len(self.widths), len(self.prices), len(self.names)
        if not self.widths or len(set(counts)) != 1:
            given = "widths {}, prices {}, names {}".format(*counts)
            raise InputError(f"grades of a cost: {given}; give one width, price and name per grade, at least one grade")
        for name, width, price in zip(self.names, self.widths, self.prices, strict=True):
            _check(f"width of the grade {name}", width, above_zero=True)
            _check(f"price of the grade {name}", price)
        rows = sorted(zip(self.widths, self.prices, self.names, strict=True), key=lambda row: row[0])
        for finer, wider in pairwise(rows):
            if wider[0] <= finer[0] * (1 + SAME_WIDTH):
                raise InputError(f"grades {finer[2]} and {wider[2]} have one width, {wider[0]:.6g}; keep one of them")
            if wider[1] > finer[1]:
                raise InputError(
                    f"grade {wider[2]} is wider than {finer[2]} and costs more, {wider[1]:g} against {finer[1]:g}; "
                    "a wider grade costs no more: exchange the prices or leave the grade out"
                )
        # hold the order of the widths: a dataclass is frozen only after this
        for field, column in zip(("widths", "prices", "names"), zip(*rows, strict=True), strict=True):
            object.__setattr__(self, field, tuple(column))

    def holds(self, width: float) -> bool:
        """Whether a grade is as fine as a width."""
        return self.widths[0] <= _positive(width) * (1 + SAME_WIDTH)

    def index(self, width: float) -> int:
        """Place in the table of the grade that holds a width: the widest not above it; an error where none holds it."""
        if not self.holds(width):
            raise InputError(
                f"width {width:.6g} is finer than the finest grade {self.names[0]}, {self.widths[0]:.6g}; "
                "add a finer grade or give a wider tolerance"
            )
        return max(place for place, grade in enumerate(self.widths) if grade <= width * (1 + SAME_WIDTH))

    def cost(self, width: float) -> float:
        """Cost of the grade that holds a width, core unit."""
        return self.prices[self.index(width)]


#: What a tolerance may cost by.
Cost = Reciprocal | ReciprocalSquare | Grades


@dataclass(frozen=True)
class Choice:
    """What may be bought for one tolerance.

    Attributes
    ----------
    cost : Reciprocal, ReciprocalSquare, Grades or None
        None, no cost, where it is fixed.
    bounds : tuple of float, optional
        Least and largest width, core unit.  Where left out: a tenth to ten times the width as given for smooth costs,
        all its grades for a table.
    fixed : bool
        Whether it keeps its width.
    """

    cost: Cost | None
    bounds: tuple[float, float] | None = None
    fixed: bool = False


def _check(name: str, value: float, *, above_zero: bool = False) -> None:
    least = "above 0" if above_zero else "0 or more"
    if not math.isfinite(value) or value < 0 or (above_zero and value == 0):
        raise InputError(f"{name} is {value:g}; give a finite number {least}")


def _positive(width: float) -> float:
    if not (math.isfinite(width) and width > 0):
        raise InputError(f"a cost was asked for the width {width:g}; give a finite width above 0")
    return width


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
    smooth: Flags
    factor: Array
    power: Array
    tables: tuple[tuple[int, Grades, tuple[int, ...]], ...]  # entry, its cost, the grades that the bounds allow

    @property
    def fixed(self) -> Flags:
        """Which entries keep their width."""
        return np.array([choice.fixed for choice in self.choices], dtype=bool)

    def each(self, widths: Array) -> Array:
        """Cost of every entry; not a number where no grade is as fine."""
        return np.array([_cost_of(choice.cost, float(w)) for choice, w in zip(self.choices, widths, strict=True)])

    def total(self, widths: Array) -> float:
        """Cost of all entries."""
        return math.fsum(self.each(widths))

    def slopes(self, widths: Array) -> Array:
        """Derivative of the smooth costs, 0 elsewhere."""
        return -self.power * self.factor / widths ** (self.power + 1)

    def relaxed(self, idle: Flags) -> CostModel:
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
            if math.isnan(_cost_of(cost, float(given[e]))):
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


def _cost_of(cost: Cost | None, width: float) -> float:
    """Cost of a width, 0 where none is said; not a number of one that is finer than all grades."""
    if isinstance(cost, Grades) and not cost.holds(width):
        return math.nan
    return 0.0 if cost is None else cost.cost(width)


def _allowed(label: str, table: Grades, bounds: tuple[float, float] | None) -> tuple[int, ...]:
    low, high = bounds or (0.0, math.inf)
    allowed = tuple(g for g, w in enumerate(table.widths) if low * (1 - SAME_WIDTH) <= w <= high * (1 + SAME_WIDTH))
    if not allowed:
        raise InputError(f"{label}: no grade has a width within the bounds {low:g} to {high:g}; widen the bounds")
    return allowed
