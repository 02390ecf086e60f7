"""Widths of least cost under a limit that rows support: smooth costs by SLSQP, grades by an integer program.

Page ``theory/allocation.md``.  Knows costs and rows, not where they come from.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.tolerances.cost import SAME_WIDTH, Cost, Grades, ReciprocalSquare

Mask = npt.NDArray[np.bool_]

#: Share of the width as given that bounds allow where none are given, downwards and upwards.
BOUNDS = (0.1, 10.0)
#: Of a value to its limit, relative.
CLOSE = 1e-9
#: Most rounds of a loop that adds rows.
ROUNDS = 200

_TANGENTS = 12  # of a smooth cost in a program with grades, to begin with

#: Row R and offset: ``R @ T**power + offset`` is what is limited, or below it.
Row = tuple[Array, float]


def slope_of(limited: Limited, widths: Array) -> Array:
    """Derivative of what is limited by the widths."""
    value, (own, _) = limited.measure(widths)
    return own * widths / (value or 1.0) if limited.power == 2 else own


class Limited(ABC):
    """What is limited: a function of the widths that rows support from below.

    Unless a kind says otherwise it is convex: `least` solves the convex problem, and `refined` has nothing to add.
    """

    power = 1
    proof = "nothing costs less, by more than the gap"  #: what is known of the widths that `least` finds
    gap = CLOSE  #: of the cost, relative, at which a search among grades ends
    rounds = ROUNDS  #: most combinations of grades that it tries

    def target(self, limit: float) -> float:
        """What the rows must not exceed for a limit in rad."""
        return limit**self.power

    def best(self, market: Market) -> Array:
        """Widths at which the least is used of the limit: mostly the least ones."""
        return market.low

    @abstractmethod
    def measure(self, widths: Array) -> tuple[float, Row]:
        """What is limited, rad, and the row that is equal to it here."""

    def exceeding(self, widths: Array, limit: float) -> list[Row]:
        """Rows above the limit here; none where the widths meet it."""
        value, row = self.measure(widths)
        return [row] if value > limit * (1 + CLOSE) else []

    def least(self, market: Market, limit: float, rows: list[Row]) -> Array | None:
        """Smooth widths of least cost, None where the least ones exceed the limit; adds the rows that it needs."""
        return convex(market, self, limit, rows)

    def refined(self, market: Market, limit: float, found: Found) -> Found:
        """What is found with grades, or better where that can be proven to be missing."""
        return found


# --- what may be bought ------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Market:
    """Costs, bounds and grades of all entries as arrays.

    A smooth cost is ``base + factor / T**power``; both 0 where an entry is fixed or has a table.
    """

    labels: tuple[str, ...]
    costs: tuple[Cost | None, ...]
    given: Array
    low: Array
    high: Array
    smooth: Mask
    factor: Array
    power: Array
    fixed: tuple[bool, ...]
    tables: tuple[tuple[int, Grades, tuple[int, ...]], ...]  # entry, its cost, the grades that the bounds allow

    def each(self, widths: Array) -> Array:
        """Cost of every entry."""
        pairs = zip(self.costs, widths, strict=True)
        return np.array([0.0 if cost is None else cost.cost(float(width)) for cost, width in pairs])

    @property
    def before(self) -> Array:
        """Cost of every entry at the widths as given, not a number where no grade is as fine."""
        pairs = zip(self.costs, self.given, strict=True)
        known = np.array([not isinstance(cost, Grades) or cost.holds(float(width)) for cost, width in pairs])
        return np.where(known, self.each(np.where(known, self.given, self.low)), np.nan)

    def total(self, widths: Array) -> float:
        """Cost of all entries."""
        return math.fsum(self.each(widths))

    def slopes(self, widths: Array) -> Array:
        """Derivative of the smooth costs, 0 elsewhere."""
        return -self.power * self.factor / widths ** (self.power + 1)

    def relaxed(self, idle: Mask) -> Market:
        """The same with the largest widths alone where the width does not matter."""
        free = idle & ~np.array(self.fixed)
        tables = tuple((e, table, allowed[-1:] if free[e] else allowed) for e, table, allowed in self.tables)
        return replace(self, low=np.where(free, self.high, self.low), tables=tables)

    def holding(self, grades: Sequence[int]) -> Market:
        """The same with each table held at one of its grades."""
        widths = self.given.copy()
        for (entry, table, _), grade in zip(self.tables, grades, strict=True):
            widths[entry] = table.widths[grade]
        held = np.where(self.smooth, self.given, widths)
        low, high = np.where(self.smooth, self.low, held), np.where(self.smooth, self.high, held)
        return replace(self, given=held, low=low, high=high, tables=())


def market_of(
    labels: Sequence[str],
    given: Array,
    costs: Sequence[Cost | None],
    bounds: Sequence[tuple[float, float] | None] | None,
    fixed: Sequence[bool] | None,
) -> Market:
    """Costs, bounds and grades, as for `rverror.tolerances.allocation.allocate`, laid out as arrays."""
    entries = len(labels)
    limits = [None] * entries if bounds is None else list(bounds)
    kept = [False] * entries if fixed is None else [bool(keep) for keep in fixed]
    for name, row in (("costs", costs), ("bounds", limits), ("fixed", kept)):
        if len(row) != entries:
            raise InputError(f"{name}: {len(row)} given; give one for each of the {entries} tolerances")
    low, high = given.astype(np.float64), given.astype(np.float64)
    smooth, factor, power = np.zeros(entries, dtype=bool), np.zeros(entries), np.ones(entries)
    tables = []
    for e, (label, cost, bound, keep) in enumerate(zip(labels, costs, limits, kept, strict=True)):
        if keep:
            if isinstance(cost, Grades) and not cost.holds(float(given[e])):
                raise InputError(
                    f"{label}: fixed, and finer than its finest grade; add a finer grade or leave the cost out"
                )
            continue
        if cost is None:
            raise InputError(f"{label}: has no cost; give it one, or fixed = true")
        if bound is not None and not 0 < bound[0] <= bound[1] < math.inf:
            raise InputError(
                f"{label}: bounds {bound[0]:g} to {bound[1]:g}; give a least width above 0, then the largest"
            )
        if isinstance(cost, Grades):
            allowed = _allowed(label, cost, bound)
            tables.append((e, cost, allowed))
            low[e], high[e] = cost.widths[allowed[0]], cost.widths[allowed[-1]]
            continue
        low[e], high[e] = bound or tuple(given[e] * share for share in BOUNDS)
        smooth[e] = True
        power[e] = 2.0 if isinstance(cost, ReciprocalSquare) else 1.0
        factor[e] = cost.price * cost.at ** power[e]
        if cost.price == 0:  # what costs nothing is as fine as may be and leaves the limit to the others
            high[e] = low[e]
    if not smooth.any() and not tables:
        raise InputError("all tolerances are fixed; leave fixed = true out where the width may change")
    return Market(
        tuple(labels),
        tuple(costs),
        given.astype(np.float64),
        low,
        high,
        smooth,
        factor,
        power,
        tuple(kept),
        tuple(tables),
    )


def _allowed(label: str, table: Grades, bound: tuple[float, float] | None) -> tuple[int, ...]:
    low, high = bound or (0.0, math.inf)
    allowed = tuple(g for g, w in enumerate(table.widths) if low * (1 - SAME_WIDTH) <= w <= high * (1 + SAME_WIDTH))
    if not allowed:
        raise InputError(f"{label}: no grade has a width within the bounds {low:g} to {high:g}; widen the bounds")
    return allowed


# --- smooth costs: the convex problem ----------------------------------------------------------------------------


def convex(market: Market, limited: Limited, limit: float, rows: list[Row]) -> Array | None:
    """Widths of least cost, tables held; adds the rows that it needs."""
    if limited.measure(market.low)[0] > limit:
        return None
    for _ in range(ROUNDS):
        widths = _least_for_rows(market, limited, limit, rows)
        new = limited.exceeding(widths, limit)
        if not new:
            break
        rows.extend(new)
    return pulled_in(market, limited, limit, widths)


def _least_for_rows(market: Market, limited: Limited, limit: float, rows: list[Row]) -> Array:
    """Widths of least cost for the rows alone."""
    if not rows:
        return market.high
    q = limited.power
    shares = np.array([own for own, _ in rows])
    room = limited.target(limit) - np.array([offset for _, offset in rows])
    if (shares @ market.high**q <= room).all():
        return market.high

    def constraint(widths: Array) -> tuple[Array, Array]:
        return 1 - shares @ widths**q / room, -shares * q * widths ** (q - 1) / room[:, None]

    # from below the rows: the least widths, spread as far towards the largest as the rows leave room
    steps = np.linspace(0.0, 1.0, 65)
    spread = market.low ** (1 - steps[:, None]) * market.high ** steps[:, None]
    inside = (spread**q @ shares.T <= room).all(axis=1)
    return minimised(market, spread[max(0, int(inside.sum()) - 1)], constraint, accuracy=1e-15)


def minimised(
    market: Market, start: Array, constraint: Callable[[Array], tuple[Array, Array]], *, accuracy: float
) -> Array:
    """Least cost by SLSQP in the logarithm of the widths.

    `constraint(widths)` gives values that must not be negative, and their derivatives by the widths.
    """
    free = market.smooth & (market.high > market.low)
    scale = float(np.sum(market.factor / start**market.power)) or 1.0

    def full(x: Array) -> Array:
        widths = start.copy()
        widths[free] = np.exp(x)
        return widths

    def cost(x: Array) -> tuple[float, Array]:
        own = market.factor[free] * np.exp(-market.power[free] * x) / scale
        return float(own.sum()), -market.power[free] * own

    bounds = np.log(np.stack([market.low[free], market.high[free]], axis=1))
    found = scipy.optimize.minimize(
        cost,
        np.clip(np.log(start[free]), *bounds.T),
        jac=True,
        method="SLSQP",
        bounds=bounds,
        constraints={
            "type": "ineq",
            "fun": lambda x: constraint(full(x))[0],
            "jac": lambda x: constraint(full(x))[1][:, free] * np.exp(x),
        },
        options={"maxiter": 500, "ftol": accuracy},
    )
    return np.clip(full(found.x), market.low, market.high)


def pulled_in(market: Market, limited: Limited, limit: float, widths: Array) -> Array:
    """Widths drawn towards the best ones until they meet the limit exactly; a hair, where they nearly do.

    What is limited is convex, or nearly so, so that it falls at least as the chord does.
    """
    best = limited.best(market)
    least = limited.measure(best)[0]
    for _ in range(ROUNDS):
        value = limited.measure(widths)[0]
        if value <= limit:
            break
        share = (limit - least) / (value - least) if value > least else 0.0
        widths = best + share * (1 - 1e-13) * (widths - best)
    return widths


@dataclass(frozen=True)
class Multipliers:
    """Multipliers of the rows that bind, and what follows from them.

    `bounds` is the change of the cost per unit of width where a bound holds, `lower` a cost that no widths undercut.
    """

    rows: list[Row]
    values: Array
    bounds: Array
    lower: float


def multipliers_of(market: Market, limited: Limited, limit: float, rows: list[Row], widths: Array) -> Multipliers:
    """Multipliers by least squares of the conditions at the least cost; the bound from below by weak duality."""
    q, target = limited.power, limited.target(limit)
    binding = [row for row in rows if row[0] @ widths**q + row[1] >= target * (1 - 1e-7)]
    inside = market.smooth & (widths > market.low * (1 + 1e-7)) & (widths < market.high * (1 - 1e-7))
    slopes = market.slopes(widths)
    shares = np.array([own for own, _ in binding]).reshape(len(binding), widths.size)
    pull = shares * q * widths ** (q - 1)
    values = np.zeros(len(binding))
    if binding and inside.any():
        # in logarithmic widths, and with rows of one size, all numbers are alike
        weight, size = widths[inside], np.max(np.abs(pull * widths), axis=1)
        values = scipy.optimize.nnls((pull[:, inside] * weight / size[:, None]).T, -slopes[inside] * weight)[0] / size
    bounds = np.where(market.smooth & ~inside, slopes + values @ pull, 0.0)
    price = values @ shares
    power, factor = market.power, market.factor
    with np.errstate(divide="ignore", invalid="ignore"):
        best = np.where(price > 0, (power * factor / (q * price)) ** (1 / (q + power)), np.inf)
    best = np.clip(best, market.low, market.high)
    smooth = np.where(market.smooth, factor / best**power, 0.0) + price * best**q
    held = market.total(widths) - float(np.sum(factor / widths**power))
    lower = held + math.fsum(smooth) - float(values @ (target - np.array([offset for _, offset in binding])))
    return Multipliers(binding, values, bounds, lower)


# --- grades: the mixed-integer program ---------------------------------------------------------------------------


@dataclass(frozen=True)
class Found:
    """Widths, the grade of each table, a cost that none undercut (-inf where that is not known), what is proven."""

    widths: Array
    grades: tuple[int, ...]
    lower: float = -math.inf
    proof: str = ""


def least_cost(market: Market, limited: Limited, limit: float, rows: list[Row]) -> Found | None:
    """Least cost over smooth widths and grades; None where none meets the limit."""
    if limited.measure(limited.best(market))[0] > limit:
        return None
    if not market.tables:
        widths = limited.least(market, limit, rows)
        return None if widths is None else Found(widths, (), proof=limited.proof)
    best: Found | None = None
    curved = [int(e) for e in np.flatnonzero(market.smooth & (market.factor > 0))]
    tangents = [(e, float(width)) for e in curved for width in np.geomspace(market.low[e], market.high[e], _TANGENTS)]
    tried: list[tuple[int, ...]] = []
    lower = -math.inf
    for _ in range(limited.rounds):
        program = _program(market, limited, limit, rows, tangents, tried)
        if program is None:
            lower = math.inf  # all others are known
            break
        grades, lower = program
        if best is not None and lower >= market.total(best.widths) * (1 - limited.gap):
            break
        tried.append(grades)
        held = market.holding(grades)
        widths = limited.least(held, limit, rows) if held.smooth.any() else held.low
        new = limited.exceeding(held.low if widths is None else widths, limit)
        rows.extend(new)
        if widths is None or new:
            continue
        tangents.extend((e, float(widths[e])) for e in curved)
        if best is None or market.total(widths) < market.total(best.widths):
            best = Found(widths, grades, proof=limited.proof)
    if best is None:
        return None
    return limited.refined(market, limit, replace(best, lower=min(lower, market.total(best.widths))))


def _program(
    market: Market,
    limited: Limited,
    limit: float,
    rows: list[Row],
    tangents: list[tuple[int, float]],
    tried: list[tuple[int, ...]],
) -> tuple[tuple[int, ...], float] | None:
    """Grades of least cost for the rows and tangents so far, without those tried; and a cost that none undercut.

    Unknowns: width**q and cost of each smooth entry in units of their largest, then one 0 or 1 for each grade.
    """
    q = limited.power
    smooth = np.flatnonzero(market.smooth)
    choices = [(t, e, g) for t, (e, _, allowed) in enumerate(market.tables) for g in allowed]
    unit = market.high[smooth] ** q
    prices = np.array([market.tables[t][1].prices[g] for t, _, g in choices])
    size = math.fsum(market.factor / market.low**market.power) + float(prices.max()) or 1.0
    first_cost, first_grade = smooth.size, 2 * smooth.size
    unknowns = first_grade + len(choices)

    table_rows = np.zeros((len(market.tables), unknowns))
    for column, (t, _, _) in enumerate(choices):
        table_rows[t, first_grade + column] = 1.0
    constraints = [scipy.optimize.LinearConstraint(table_rows, 1.0, 1.0)]

    owners = np.array([e for _, e, _ in choices])
    grade_widths = np.array([market.tables[t][1].widths[g] for t, _, g in choices]) ** q
    held = ~market.smooth
    held[owners] = False
    for own, offset in rows:
        room = limited.target(limit) - offset - float(own[held] @ market.given[held] ** q)
        row = np.zeros(unknowns)
        row[:first_cost] = own[smooth] * unit
        row[first_grade:] = own[owners] * grade_widths
        norm = float(np.abs(row).max()) or 1.0
        constraints.append(scipy.optimize.LinearConstraint(row / norm, -np.inf, room / norm))
    place = {int(e): column for column, e in enumerate(smooth)}
    for e, width in tangents:
        column = place[e]
        share = market.power[e] / q
        value = market.factor[e] / width ** market.power[e] / size
        slope = -share * value / width**q * unit[column]
        row = np.zeros(unknowns)
        row[column], row[first_cost + column] = -slope, 1.0
        constraints.append(scipy.optimize.LinearConstraint(row, value * (1 + share), np.inf))
    for grades in tried:
        row = np.zeros(unknowns)
        for column, (t, _, g) in enumerate(choices):
            row[first_grade + column] = float(grades[t] == g)
        constraints.append(scipy.optimize.LinearConstraint(row, -np.inf, len(market.tables) - 1))

    objective = np.concatenate([np.zeros(smooth.size), np.ones(smooth.size), prices / size])
    ones = np.ones(len(choices))
    found = scipy.optimize.milp(
        objective,
        constraints=constraints,
        bounds=scipy.optimize.Bounds(
            np.concatenate([market.low[smooth] ** q / unit, np.zeros(smooth.size), 0 * ones]),
            np.concatenate([np.ones(smooth.size), np.full(smooth.size, np.inf), ones]),
        ),
        integrality=np.concatenate([np.zeros(first_grade), ones]),
        options={"mip_rel_gap": 1e-9},
    )
    if found.x is None:
        return None
    chosen = [0] * len(market.tables)
    for column, (t, _, g) in enumerate(choices):
        if found.x[first_grade + column] > 0.5:
            chosen[t] = g
    bases = [
        cost.base for e, cost in enumerate(market.costs) if market.smooth[e] and not isinstance(cost, Grades | None)
    ]
    kept = [cost.cost(float(market.given[e])) for e, cost in enumerate(market.costs) if market.fixed[e] and cost]
    fixed = math.fsum(bases) + math.fsum(kept)
    return tuple(chosen), fixed + size * float(found.mip_dual_bound)
