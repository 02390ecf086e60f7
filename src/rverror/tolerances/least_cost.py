"""Widths of least cost under a constraint: smooth costs by SLSQP, grades by an integer program.

Page ``theory/allocation.md``.  Knows costs and what is linear in the widths, not where it comes from.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.tolerances.cost import CostModel

#: Of a value to its limit, relative.
CLOSE = 1e-9
#: Most rounds of a loop that adds rows.
ROUNDS = 200

_TANGENTS = 12  # of a smooth cost in a program with grades, to begin with

_FAILED = 4  # status of `scipy.optimize.milp` that says nothing of the program: not that no grades meet the limit

#: Row R and offset: ``R @ T + offset`` is what is limited, or below it.
Row = tuple[Array, float]


class Constraint(ABC):
    """What is limited: a function of the widths that rows support from below."""

    gap = CLOSE  #: of the cost, relative, at which a search among grades ends
    rounds = ROUNDS  #: most combinations of grades that it tries

    @abstractmethod
    def measure(self, widths: Array) -> tuple[float, Row]:
        """What is limited, and the row that is equal to it here."""

    @abstractmethod
    def cheapest(self, costs: CostModel, limit: float, rows: list[Row]) -> Array:
        """Smooth widths of least cost that meet the limit, or nearly; adds the rows that it needs."""

    def best(self, costs: CostModel) -> Array:
        """Widths at which the least is used of the limit: mostly the least ones."""
        return costs.low

    def exceeding(self, widths: Array, limit: float) -> list[Row]:
        """Rows above the limit here; none where the widths meet it."""
        value, row = self.measure(widths)
        return [row] if value > limit * (1 + CLOSE) else []

    def least(self, costs: CostModel, limit: float, rows: list[Row]) -> Array | None:
        """Smooth widths of least cost, None where no widths meet the limit; adds the rows that it needs.

        The cheapest are drawn towards the best ones until they meet the limit exactly; a hair, where they nearly do.
        What is limited is convex, or nearly so, so that it falls at least as the chord does.
        """
        best = self.best(costs)
        least = self.measure(best)[0]
        if least > limit:
            return None
        widths = self.cheapest(costs, limit, rows)
        for _ in range(ROUNDS):
            value = self.measure(widths)[0]
            if value <= limit:
                break
            share = (limit - least) / (value - least) if value > least else 0.0
            widths = best + share * (1 - 1e-13) * (widths - best)
        return widths


# --- smooth costs ------------------------------------------------------------------------------------------------


def minimised(
    costs: CostModel, start: Array, room: Callable[[Array], tuple[Array, Array]], *, accuracy: float = 1e-15
) -> Array:
    """Least cost by SLSQP in the logarithm of the widths.

    `room(widths)` gives values that must not be negative, and their derivatives by the widths.
    """
    free = costs.smooth & (costs.high > costs.low)
    scale = float(np.sum(costs.factor / start**costs.power)) or 1.0

    def full(x: Array) -> Array:
        widths = start.copy()
        widths[free] = np.exp(x)
        return widths

    def cost(x: Array) -> tuple[float, Array]:
        own = costs.factor[free] * np.exp(-costs.power[free] * x) / scale
        return float(own.sum()), -costs.power[free] * own

    bounds = np.log(np.stack([costs.low[free], costs.high[free]], axis=1))
    found = scipy.optimize.minimize(
        cost,
        np.clip(np.log(start[free]), *bounds.T),
        jac=True,
        method="SLSQP",
        bounds=bounds,
        constraints={
            "type": "ineq",
            "fun": lambda x: room(full(x))[0],
            "jac": lambda x: room(full(x))[1][:, free] * np.exp(x),
        },
        options={"maxiter": 500, "ftol": accuracy},
    )
    return np.clip(full(found.x), costs.low, costs.high)


def shadow_price(costs: CostModel, limit: float, rows: list[Row], widths: Array) -> float:
    """Cost saved per unit by which the limit is raised: the multipliers of the rows that bind, by least squares."""
    binding = [row for row, offset in rows if row @ widths + offset >= limit * (1 - 1e-7)]
    inside = costs.smooth & (widths > costs.low * (1 + 1e-7)) & (widths < costs.high * (1 - 1e-7))
    if not binding or not inside.any():
        return 0.0
    # in logarithmic widths, and with rows of one size, all numbers are alike
    pull = np.array(binding) * widths
    size = np.max(np.abs(pull), axis=1)
    slopes = -costs.slopes(widths)[inside] * widths[inside]
    return float((scipy.optimize.nnls((pull[:, inside] / size[:, None]).T, slopes)[0] / size).sum())


# --- grades: the mixed-integer program ---------------------------------------------------------------------------


class Found(NamedTuple):
    """Widths, and the grade of each table."""

    widths: Array
    grades: tuple[int, ...]


def least_cost(costs: CostModel, constraint: Constraint, limit: float, rows: list[Row]) -> Found | None:
    """Least cost over smooth widths and grades, None where none meets the limit; adds the rows that it needs."""
    if not costs.tables:
        widths = constraint.least(costs, limit, rows)
        return None if widths is None else Found(widths, ())
    if constraint.measure(constraint.best(costs))[0] > limit:
        return None
    best: Found | None = None
    curved = [int(e) for e in np.flatnonzero(costs.smooth & (costs.factor > 0))]
    tangents = [(e, float(width)) for e in curved for width in np.geomspace(costs.low[e], costs.high[e], _TANGENTS)]
    tried: list[tuple[int, ...]] = []
    for _ in range(constraint.rounds):
        program = _program(costs, limit, rows, tangents, tried)
        if program is None:
            break  # all others are known
        grades, lower = program
        if best is not None and lower >= costs.total(best.widths) * (1 - constraint.gap):
            break
        tried.append(grades)
        held = costs.holding(grades)
        widths = constraint.least(held, limit, rows) if held.smooth.any() else held.low
        new = constraint.exceeding(held.low if widths is None else widths, limit)
        rows.extend(new)
        if widths is None or new:
            continue
        tangents.extend((e, float(widths[e])) for e in curved)
        if best is None or costs.total(widths) < costs.total(best.widths):
            best = Found(widths, grades)
    return best


def _program(
    costs: CostModel, limit: float, rows: list[Row], tangents: list[tuple[int, float]], tried: list[tuple[int, ...]]
) -> tuple[tuple[int, ...], float] | None:
    """Grades of least cost for the rows and tangents so far, without those tried; and a cost that none undercut.

    Unknowns: width and cost of each smooth entry in units of their largest, then one 0 or 1 for each grade.
    """
    smooth = np.flatnonzero(costs.smooth)
    choices = [(t, e, g) for t, (e, _, allowed) in enumerate(costs.tables) for g in allowed]
    table_of, owners, _ = np.array(choices).T
    prices = np.array([costs.tables[t][1].prices[g] for t, _, g in choices])
    grade_widths = np.array([costs.tables[t][1].widths[g] for t, _, g in choices])
    unit = costs.high[smooth]
    size = math.fsum(costs.factor / costs.low**costs.power) + float(prices.max()) or 1.0
    count = smooth.size
    columns = {"widths": slice(0, count), "spent": slice(count, 2 * count), "grades": slice(2 * count, None)}
    constraints: list[scipy.optimize.LinearConstraint] = []

    def add(number: int, low: Any, high: Any, **parts: Any) -> None:
        if number:
            matrix = np.zeros((number, 2 * count + len(choices)))
            for name, part in parts.items():
                matrix[:, columns[name]] = part
            constraints.append(scipy.optimize.LinearConstraint(matrix, low, high))

    add(len(costs.tables), 1.0, 1.0, grades=np.arange(len(costs.tables))[:, None] == table_of)
    own = np.array([row for row, _ in rows]).reshape(len(rows), costs.given.size)
    held = ~costs.smooth
    held[owners] = False
    room = limit - np.array([offset for _, offset in rows]) - own[:, held] @ costs.given[held]
    of_widths, of_grades = own[:, smooth] * unit, own[:, owners] * grade_widths
    norm = np.abs(np.hstack([of_widths, of_grades])).max(axis=1, initial=1e-300)
    add(len(rows), -np.inf, room / norm, widths=of_widths / norm[:, None], grades=of_grades / norm[:, None])
    at = np.array([e for e, _ in tangents], dtype=np.intp)
    width = np.array([w for _, w in tangents])
    value, mine = costs.factor[at] / width ** costs.power[at] / size, at[:, None] == smooth
    slope = (costs.power[at] * value / width)[:, None] * unit
    add(len(at), value * (1 + costs.power[at]), np.inf, widths=mine * slope, spent=mine)
    again = [[grades[t] == g for t, _, g in choices] for grades in tried]
    add(len(tried), -np.inf, len(costs.tables) - 1, grades=again)
    bounds = scipy.optimize.Bounds(
        np.concatenate([costs.low[smooth] / unit, np.zeros(count + len(choices))]),
        np.concatenate([np.ones(count), np.full(count, np.inf), np.ones(len(choices))]),
    )
    for rows_in_order in (constraints, constraints[::-1]):  # the solver may fail on one order of the rows
        found = scipy.optimize.milp(
            np.concatenate([np.zeros(count), np.ones(count), prices / size]),
            constraints=rows_in_order,
            bounds=bounds,
            integrality=np.concatenate([np.zeros(2 * count), np.ones(len(choices))]),
            options={"mip_rel_gap": 1e-9},
        )
        if found.status != _FAILED:
            break
    else:
        raise InputError(f"grades: the integer program failed, {found.message}; change the limit a little")
    if found.x is None:
        return None
    chosen = {t: g for (t, _, g), taken in zip(choices, found.x[2 * count :], strict=True) if taken > 0.5}
    finest = math.fsum(table.prices[allowed[0]] for _, table, allowed in costs.tables)
    paid_anyway = costs.total(costs.low) - math.fsum(costs.factor / costs.low**costs.power) - finest
    return tuple(chosen[t] for t in range(len(costs.tables))), paid_anyway + size * float(found.mip_dual_bound)
