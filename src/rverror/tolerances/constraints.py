"""What allocation limits: the rms, the worst-case p-p and a quantile of the p-p, as functions of the widths.

Page ``theory/allocation.md``.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.tolerances.closed_form import by_entry, towards
from rverror.tolerances.cost_model import CostModel, Mask
from rverror.tolerances.extremes import kernel
from rverror.tolerances.least_cost import CLOSE, ROUNDS, Constraint, Found, Row, minimised, pulled_in
from rverror.tolerances.stacking import Stack
from rverror.tolerances.worst_pair import GroupWaves

Ints = npt.NDArray[np.intp]

#: Combinations of grades up to which the least cost at a yield is proven by trying all that cost less.
MOST_COMBINATIONS = 200_000

_ALL = slice(None)
_CHUNK = 1_000_000  # numbers in the draws of one chunk of units
_BAND = 4.0  # shares of units beyond the quantile, over and under, between which ranks count for its smoothed mean
_KEPT = 16  # rows kept of each unit
_REFINEMENTS = 12  # rounds of a solution on a sample
_TRIES = 256  # combinations of grades at a time


class MeanSquare(Constraint):
    """Root of the mean square over angles and units."""

    def __init__(self, stack: Stack) -> None:
        """Take the mean squares of the influences, tolerance by tolerance."""
        waves = stack.influence - stack.influence.mean(axis=1, keepdims=True)
        self.share = by_entry(stack.blocks, waves).mean(axis=1)
        self.nominal = float(np.var(stack.nominal))

    def parts(self, widths: Array) -> tuple[Array, Array]:
        """The rms."""
        rms = math.sqrt(self.nominal + float(self.share @ widths**2))
        return np.array([rms]), (self.share * widths / (rms or 1.0))[None]

    def least(self, costs: CostModel, limit: float, rows: list[Row]) -> Array | None:
        """With the row at the widths that are found, which tells of other grades."""
        widths = super().least(costs, limit, rows)
        if widths is not None:
            rows.append(self.measure(widths)[1])
        return widths


class WorstPeakToPeak(Constraint):
    """P-p of the worst parts: one row for each pair of angles, of which those that matter are found as needed."""

    def __init__(self, stack: Stack) -> None:
        """Lay out the waves of all that the worst case chooses."""
        self.stack = stack
        self.owners = np.array([stack.entry[group.components[0, 0]] for group in stack.worst_groups], dtype=np.intp)
        # TE of a unit of each width with its values in the middle of their limits; 0 but for skewed distributions
        self.middle = np.zeros((len(stack.labels), stack.nominal.size))
        np.add.at(self.middle, stack.entry, stack.middle[:, None] * stack.influence)
        self.known: dict[bytes, Row] = {}  # by widths: searching all pairs is dear

    def parts(self, widths: Array) -> tuple[Array, Array]:
        """Largest p-p over all pairs of angles."""
        own, offset = self.measure(widths)[1]
        return np.array([own @ widths + offset]), own[None]

    def measure(self, widths: Array) -> tuple[float, Row]:
        """Largest p-p over all pairs of angles, and the row of its pair."""
        key = widths.tobytes()
        if key not in self.known:
            self.known[key] = self._worst(widths)
        own, offset = self.known[key]
        return float(own @ widths + offset), (own, offset)

    def _worst(self, widths: Array) -> Row:
        """Row of the worst pair, the higher angle of what no part's error can change first."""
        stack = self.stack
        at_middle = stack.at_middle(widths)
        _, i, j = GroupWaves(stack.worst_groups, stack.scaled(widths), at_middle).farthest()
        i, j = (i, j) if at_middle[i] >= at_middle[j] else (j, i)
        between = stack.influence[:, i] - stack.influence[:, j]
        own = self.middle[:, i] - self.middle[:, j]
        np.add.at(own, self.owners, towards(stack.worst_groups, between)[1])
        return own, float(stack.nominal[i] - stack.nominal[j])

    def least(self, costs: CostModel, limit: float, rows: list[Row]) -> Array | None:
        """By the rows so far, and those that this solution turns out to need, until it needs no other."""
        if self.measure(costs.low)[0] > limit:
            return None
        for _ in range(ROUNDS):
            widths = self._for_rows(costs, limit, rows)
            new = self.exceeding(widths, limit)
            if not new:
                break
            rows.extend(new)
        return pulled_in(costs, self, limit, widths)

    def _for_rows(self, costs: CostModel, limit: float, rows: list[Row]) -> Array:
        """Widths of least cost for the rows alone."""
        shares = np.array([own for own, _ in rows]).reshape(len(rows), costs.given.size)
        room = limit - np.array([offset for _, offset in rows])
        if (shares @ costs.high <= room).all():
            return costs.high
        # from below the rows: the least widths, spread as far towards the largest as the rows leave room
        steps = np.linspace(0.0, 1.0, 65)[:, None]
        spread = costs.low ** (1 - steps) * costs.high**steps
        inside = (spread @ shares.T <= room).all(axis=1)
        start = spread[max(0, int(inside.sum()) - 1)]
        return minimised(costs, start, lambda widths: (1 - shares @ widths / room, -shares / room[:, None]))


def ranked(slopes: Array, offsets: Array, widths: Array, ranks: Ints | slice, weight: Array) -> tuple[float, Array]:
    """Weighted mean of the ordered p-p's of units and its derivative, each p-p the largest of linear rows.

    Parameters
    ----------
    slopes : ndarray, shape (rows, units, entries)
    offsets : ndarray, shape (rows, units)
    widths : ndarray, shape (entries,)
    ranks : ndarray of int or slice
        Which of the ordered units count.
    weight : ndarray, shape (ranks,)
    """
    values = slopes @ widths + offsets
    leading = values.argmax(axis=0)
    largest = values.max(axis=0)
    chosen = np.argsort(largest)[ranks]
    return float(weight @ largest[chosen]), weight @ slopes[leading[chosen], chosen]


class Quantile(Constraint):
    """Quantile of the p-p over units drawn once: each p-p is the largest of linear rows, kept as they are met."""

    proof = "the best of several searches on the sample; that nothing costs less is not proven"

    def __init__(self, stack: Stack, *, level: float, sample: int, seed: int) -> None:
        """Draw the units."""
        self.stack = stack
        self.rank = math.ceil(level * sample) - 1
        self.mean_square = MeanSquare(stack)
        self.draws = stack.standard(np.random.default_rng((seed, 0)).random((sample, stack.dimensions)))
        beyond = 1 - (np.arange(sample) + 0.5) / sample
        distance = np.abs(np.log(beyond / (1 - level)))
        taper = np.maximum(0.0, 1 - distance / math.log(_BAND))
        self.ranks = np.flatnonzero(taper)  # that count for the smoothed quantile, and their weight
        self.weight = taper[self.ranks] / taper.sum()
        self.kernel = kernel(stack.scaled(), stack.nominal)
        self.by_angle = np.ascontiguousarray(stack.influence.T)
        self.belongs = (stack.entry[:, None] == np.arange(len(stack.labels))).astype(np.float64)
        self.known: dict[bytes, float] = {}  # quantile by widths
        self.solutions: dict[bytes, dict[float, Array]] = {}  # widths of least cost by bounds and limit
        self.slopes = np.empty((0, sample, len(stack.labels)))
        self.offsets = np.empty((0, sample))

    def parts(self, widths: Array) -> tuple[Array, Array]:
        """The quantile, with the derivative of the units around it."""
        key = widths.tobytes()
        if key not in self.known:
            self.known[key] = float(np.partition(self._peak_to_peak(widths), self.rank)[self.rank])
        value = self.known[key]
        smoothed, slope = self._smoothed(widths)
        return np.array([value]), slope[None] * (value / smoothed if smoothed else 1.0)

    def least(self, costs: CostModel, limit: float, rows: list[Row]) -> Array | None:
        """By the sample average from several starts, the best of which is followed to the end."""
        if self.measure(costs.low)[0] > limit:
            return None
        if self.measure(costs.high)[0] <= limit:
            return costs.high
        solved = self.solutions.setdefault(np.concatenate([costs.low, costs.high]).tobytes(), {})
        if solved:  # the quantile is nearly in proportion to the widths
            near = min(solved, key=lambda other: abs(math.log(other / limit)))
            starts = [np.clip(solved[near] * limit / near, costs.low, costs.high)]
        else:
            given = self.start(costs)
            even = self.of_mean_square(costs, limit, given)
            starts = [given, even, np.sqrt(even * given)]
        widths = min((self._step(costs, limit, start) for start in starts), key=costs.total)
        for _ in range(_REFINEMENTS):
            before, widths = costs.total(widths), self._step(costs, limit, widths)
            if abs(costs.total(widths) - before) <= 1e-5 * before:
                break
        widths = pulled_in(costs, self, limit, widths)
        solved[limit] = widths
        return widths

    def refined(self, costs: CostModel, limit: float, found: Found) -> Found:
        """Cheapest combination that meets the limit, by trying all that cost less, where they are not too many."""
        counts = [len(allowed) for _, _, allowed in costs.tables]
        if (costs.smooth & (costs.high > costs.low)).any() or math.prod(counts) > MOST_COMBINATIONS:
            return found
        proven = "the cheapest grades on the sample: all that cost less were tried"
        places = np.indices(counts).reshape(len(counts), -1)
        grades = np.array([np.array(allowed)[at] for (_, _, allowed), at in zip(costs.tables, places, strict=True)])
        tables = [table for _, table, _ in costs.tables]
        prices = sum(np.array(table.prices)[chosen] for table, chosen in zip(tables, grades, strict=True))
        here = sum(table.prices[grade] for table, grade in zip(tables, found.grades, strict=True))
        cheaper = np.flatnonzero(prices < here * (1 - CLOSE))
        cheaper = cheaper[np.argsort(prices[cheaper], kind="stable")]
        allowed = self.draws.shape[0] - 1 - self.rank
        worst = np.argsort(self._kept(found.widths[:, None])[:, 0])[-8 * (allowed + 1) :]  # that mostly decide
        for first in range(0, cheaper.size, _TRIES):
            tries = grades[:, cheaper[first : first + _TRIES]]
            widths = np.tile(costs.low, (tries.shape[1], 1))
            for (entry, table, _), chosen in zip(costs.tables, tries, strict=True):
                widths[:, entry] = np.array(table.widths)[chosen]
            for k in np.flatnonzero(self._open(widths, limit, worst, allowed)):
                # what was met on the way may have closed it
                if self._open(widths[k : k + 1], limit, worst, allowed)[0] and not self.exceeding(widths[k], limit):
                    return Found(widths[k], tuple(map(int, tries[:, k])), proof=proven)
        return replace(found, proof=proven)

    def _open(self, widths: Array, limit: float, units: Ints, allowed: int) -> Mask:
        """Whether the kept rows of some units leave it open that widths, shape (tries, entries), meet the limit."""
        values = self._kept(widths.T, units)
        return np.asarray((values > limit * (1 + CLOSE)).sum(axis=0) <= allowed)

    def of_mean_square(self, costs: CostModel, limit: float, widths: Array) -> Array:
        """Least cost for the rms that the limit of the quantile comes to; within reach of the limit, and soon found."""
        for _ in range(3):
            value, _ = self.measure(widths)
            rms = limit * self.mean_square.measure(widths)[0] / value
            found = self.mean_square.least(costs, rms, [])
            if found is None:
                return costs.low
            widths = found
        return widths

    def _step(self, costs: CostModel, limit: float, start: Array) -> Array:
        """Least cost for the kept rows, with those of all units at the start among them."""
        factor = self.measure(start)[0] / self._smoothed(start)[0] / limit

        def room(widths: Array) -> tuple[Array, Array]:
            smoothed, slope = self._smoothed(widths)
            return np.array([1 - factor * smoothed]), -factor * slope[None]

        return minimised(costs, start, room, accuracy=1e-9)

    def _kept(self, widths: Array, units: Ints | slice = _ALL) -> Array:
        """Largest of the kept rows of units, shape (units, tries), for widths of the shape (entries, tries)."""
        return np.asarray((self.slopes[:, units] @ widths + self.offsets[:, units, None]).max(axis=0))

    def _smoothed(self, widths: Array) -> tuple[float, Array]:
        """Weighted mean of the ordered p-p's around the quantile, and its derivative, from the kept rows."""
        return ranked(self.slopes, self.offsets, widths, self.ranks, self.weight)

    def _peak_to_peak(self, widths: Array) -> Array:
        """P-p of every unit; keeps the rows of their highest and lowest angles."""
        stack = self.stack
        ratio = (widths / stack.width)[stack.entry]
        slope, offset = np.empty(self.slopes.shape[1:]), np.empty(len(self.draws))
        step = max(1, _CHUNK // stack.entry.size)
        for part in (slice(first, first + step) for first in range(0, len(self.draws), step)):
            high, low = self.kernel.places(self.draws[part] * ratio)
            slope[part] = (self.draws[part] * (self.by_angle[high] - self.by_angle[low])) @ self.belongs
            offset[part] = stack.nominal[high] - stack.nominal[low]
        values = np.asarray(slope @ widths + offset)
        if not len(self.slopes) or (values > self._kept(widths[:, None])[:, 0] * (1 + 1e-12)).any():
            self.slopes = np.concatenate([self.slopes, slope[None]])[-_KEPT:]
            self.offsets = np.concatenate([self.offsets, offset[None]])[-_KEPT:]
        return values
