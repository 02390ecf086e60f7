"""What allocation limits: the rms, the worst-case p-p and a quantile of the p-p, as functions of the widths.

Each is supported from below by rows that are linear in the widths or in their squares.  Page ``theory/allocation.md``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import reduce

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.tolerances.extremes import kernel
from rverror.tolerances.market import CLOSE, ROUNDS, Found, Limited, Market, Mask, Row, minimised, pulled_in
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


class MeanSquare(Limited):
    """Root of the mean square over angles and units: one row in the squares of the widths."""

    power = 2

    def __init__(self, stack: Stack) -> None:
        """Take the mean squares of the influences, tolerance by tolerance."""
        waves = stack.influence - stack.influence.mean(axis=1, keepdims=True)
        self.share = np.zeros(len(stack.labels))
        for e, block in enumerate(stack.blocks):
            own = waves[block.components]
            self.share[e] = max(0.0, float(np.sum((block.covariance() @ own) * own)) / waves.shape[1])
        self.nominal = float(np.var(stack.nominal))

    def measure(self, widths: Array) -> tuple[float, Row]:
        """Rms, and the only row."""
        return math.sqrt(self.nominal + float(self.share @ widths**2)), (self.share, self.nominal)


class WorstPeakToPeak(Limited):
    """P-p of the worst parts: one row for each pair of angles, of which those that matter are found as needed."""

    def __init__(self, stack: Stack) -> None:
        """Lay out the waves of all that the worst case chooses."""
        self.stack, groups = stack, stack.worst_groups
        waves = [stack.influence[group.components].sum(axis=0) * group.radius for group in groups]  # (1 or 2, n) each
        owners = np.array([stack.entry[group.components[0, 0]] for group in groups], dtype=np.intp)
        number = np.array([len(wave) == 1 for wave in waves], dtype=bool)
        angles = stack.nominal.size
        self.entries = len(stack.labels)
        self.nominal = stack.nominal
        # TE of a unit of each width with its values in the middle of their limits; 0 but for skewed distributions
        self.middle = np.zeros((self.entries, angles))
        np.add.at(self.middle, stack.entry, stack.middle[:, None] * stack.influence)
        self.numbers = np.array([w[0] for w, one in zip(waves, number, strict=True) if one]).reshape(-1, angles)
        self.vectors = np.array([w for w, one in zip(waves, number, strict=True) if not one]).reshape(-1, 2, angles)
        self.number_owner, self.vector_owner = owners[number], owners[~number]
        # ascents begin at the highest and lowest angle of each wave, and of the nominal error
        begin = np.concatenate([self.numbers, self.vectors.reshape(-1, angles), self.nominal[None]])
        self.pairs = np.unique(np.stack([begin.argmax(axis=1), begin.argmin(axis=1)], axis=1), axis=0)
        self.known: dict[bytes, tuple[int, int]] = {}  # worst pair by widths: searching all is dear

    def measure(self, widths: Array) -> tuple[float, Row]:
        """Largest p-p over all pairs of angles, and the row of its pair."""
        key = widths.tobytes()
        if key not in self.known:
            self.known[key] = self._worst_of_all(widths)
        own, offset = self._rows(np.array([self.known[key]]))[0]
        return float(own @ widths + offset), (own, offset)

    def exceeding(self, widths: Array, limit: float) -> list[Row]:
        """Rows that ascents reach; only where none is above the limit, that of the worst of all pairs."""
        bound = limit * (1 + CLOSE)
        climbed = self._rows(self._climbed(widths))
        found = [(own, offset) for own, offset in climbed if own @ widths + offset > bound]
        return found or super().exceeding(widths, limit)

    def _rows(self, pairs: Ints) -> list[Row]:
        """Row of each pair."""
        i, j = pairs.T
        lengths = np.zeros((self.entries, len(pairs)))
        np.add.at(lengths, self.number_owner, np.abs(self.numbers[:, i] - self.numbers[:, j]))
        between = self.vectors[:, :, i] - self.vectors[:, :, j]
        np.add.at(lengths, self.vector_owner, np.hypot(between[:, 0], between[:, 1]))
        lengths += self.middle[:, i] - self.middle[:, j]
        return list(zip(lengths.T, (self.nominal[i] - self.nominal[j]).tolist(), strict=True))

    def _climbed(self, widths: Array) -> Ints:
        """Pairs from which taking the worst parts and the highest and lowest angle by turns leads no higher."""
        pairs, best = self.pairs, np.full(len(self.pairs), -np.inf)
        at_middle = self.nominal + widths @ self.middle
        for _ in range(ROUNDS):
            single = self.numbers[:, pairs[:, 0]] - self.numbers[:, pairs[:, 1]]
            double = self.vectors[:, :, pairs[:, 0]] - self.vectors[:, :, pairs[:, 1]]
            length = np.hypot(double[:, 0], double[:, 1])
            along = double / np.where(length > 0, length, 1.0)[:, None]
            waves = at_middle + (np.sign(single) * widths[self.number_owner, None]).T @ self.numbers
            turned = (along * widths[self.vector_owner, None, None]).reshape(-1, len(pairs))
            waves += turned.T @ self.vectors.reshape(-1, self.nominal.size)
            pairs = np.stack([waves.argmax(axis=1), waves.argmin(axis=1)], axis=1)
            reached = np.ptp(waves, axis=1)
            if not (reached > best * (1 + 1e-12)).any():
                break
            best = np.maximum(best, reached)
        return np.unique(pairs, axis=0)

    def _worst_of_all(self, widths: Array) -> tuple[int, int]:
        """Worst pair of all, the higher angle of what no part's error can change first."""
        at_middle = self.stack.at_middle(widths)
        _, i, j = GroupWaves(self.stack.worst_groups, self.stack.scaled(widths), at_middle).farthest()
        return (i, j) if at_middle[i] >= at_middle[j] else (j, i)


class Quantile(Limited):
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
        self.slopes: list[Array] = []  # (sample, entries) each
        self.offsets: list[Array] = []  # (sample,) each

    def measure(self, widths: Array) -> tuple[float, Row]:
        """Quantile, and the row of the units around it."""
        key = widths.tobytes()
        if key not in self.known:
            self.known[key] = float(np.partition(self._peak_to_peak(widths), self.rank)[self.rank])
        value = self.known[key]
        smoothed, slope = self._smoothed(widths)
        slope = slope * (value / smoothed if smoothed else 1.0)
        return value, (slope, value - float(slope @ widths))

    def least(self, market: Market, limit: float, rows: list[Row]) -> Array | None:
        """By the sample average from several starts, the best of which is followed to the end."""
        if self.measure(market.low)[0] > limit:
            return None
        if self.measure(market.high)[0] <= limit:
            return market.high
        solved = self.solutions.setdefault(np.concatenate([market.low, market.high]).tobytes(), {})
        if solved:  # the quantile is nearly in proportion to the widths
            near = min(solved, key=lambda other: abs(math.log(other / limit)))
            starts = [np.clip(solved[near] * limit / near, market.low, market.high)]
        else:
            given = np.clip(market.given, market.low, market.high)
            even = self.of_mean_square(market, limit, given)
            starts = [given, even, np.sqrt(even * given)]
        widths = min((self._step(market, limit, start) for start in starts), key=market.total)
        for _ in range(_REFINEMENTS):
            before, widths = market.total(widths), self._step(market, limit, widths)
            if abs(market.total(widths) - before) <= 1e-5 * before:
                break
        widths = pulled_in(market, self, limit, widths)
        solved[limit] = widths
        return widths

    def refined(self, market: Market, limit: float, found: Found) -> Found:
        """Cheapest combination that meets the limit, by trying all that cost less, where they are not too many."""
        number = math.prod(len(allowed) for _, _, allowed in market.tables)
        if (market.smooth & (market.high > market.low)).any() or number > MOST_COMBINATIONS:
            return found
        proven = "the cheapest grades on the sample: all that cost less were tried"
        places = np.indices([len(allowed) for _, _, allowed in market.tables]).reshape(len(market.tables), -1)
        chosen = [np.array(allowed)[place] for (_, _, allowed), place in zip(market.tables, places, strict=True)]
        prices = sum(
            np.array(table.prices)[grades] for (_, table, _), grades in zip(market.tables, chosen, strict=True)
        )
        here = sum(table.prices[grade] for (_, table, _), grade in zip(market.tables, found.grades, strict=True))
        cheaper = np.flatnonzero(prices < here * (1 - CLOSE))
        cheaper = cheaper[np.argsort(prices[cheaper], kind="stable")]
        allowed = self.draws.shape[0] - 1 - self.rank
        worst = np.argsort(self._kept(found.widths))[-8 * (allowed + 1) :]  # units that mostly decide
        for first in range(0, cheaper.size, _TRIES):
            tries = cheaper[first : first + _TRIES]
            widths = np.tile(market.low, (tries.size, 1))
            for (entry, table, _), grades in zip(market.tables, chosen, strict=True):
                widths[:, entry] = np.array(table.widths)[grades[tries]]
            for k in np.flatnonzero(self._open(widths, limit, worst, allowed)):
                # what was met on the way may have closed it
                if self._open(widths[k : k + 1], limit, worst, allowed)[0] and not self.exceeding(widths[k], limit):
                    return Found(widths[k], tuple(int(grades[tries[k]]) for grades in chosen), proof=proven)
        return replace(found, proof=proven)

    def _open(self, widths: Array, limit: float, units: Ints, allowed: int) -> Mask:
        """Whether the kept rows of some units leave it open that widths, shape (tries, entries), meet the limit."""
        values = self._kept(widths.T, units)
        return np.asarray((values > limit * (1 + CLOSE)).sum(axis=0) <= allowed)

    def of_mean_square(self, market: Market, limit: float, widths: Array) -> Array:
        """Least cost for the rms that the limit of the quantile comes to; within reach of the limit, and soon found."""
        for _ in range(3):
            value, _ = self.measure(widths)
            rms = limit * self.mean_square.measure(widths)[0] / value
            found = self.mean_square.least(market, rms, [])
            if found is None:
                return market.low
            widths = found
        return widths

    def _step(self, market: Market, limit: float, start: Array) -> Array:
        """Least cost for the kept rows, with those of all units at the start among them."""
        value, _ = self.measure(start)
        factor = value / self._smoothed(start)[0]

        def constraint(widths: Array) -> tuple[Array, Array]:
            smoothed, slope = self._smoothed(widths)
            return np.array([1 - factor * smoothed / limit]), -factor / limit * slope[None]

        return minimised(market, start, constraint, accuracy=1e-9)

    def _kept(self, widths: Array, units: Ints | slice = _ALL) -> Array:
        """Largest of the kept rows of units, for widths of the shape (entries,) or (entries, tries)."""
        rows = zip(self.slopes, self.offsets, strict=True)
        values = (slope[units] @ widths + offset[units].reshape(-1, *[1] * (widths.ndim - 1)) for slope, offset in rows)
        return reduce(np.maximum, values)

    def _smoothed(self, widths: Array) -> tuple[float, Array]:
        """Weighted mean of the ordered p-p's around the quantile, and its derivative, from the kept rows."""
        values = np.stack([slope @ widths + offset for slope, offset in zip(self.slopes, self.offsets, strict=True)])
        leading = values.argmax(axis=0)
        values = np.take_along_axis(values, leading[None], axis=0)[0]
        first = int(self.ranks[0])
        upper = np.argpartition(values, first)[first:]
        chosen = upper[np.argsort(values[upper])][self.ranks - first]
        weight = self.weight
        slope = np.zeros(widths.size)
        for k, slopes in enumerate(self.slopes):
            of_k = leading[chosen] == k
            slope += weight[of_k] @ slopes[chosen[of_k]]
        return float(weight @ values[chosen]), slope

    def _peak_to_peak(self, widths: Array) -> Array:
        """P-p of every unit; keeps the rows of their highest and lowest angles."""
        stack = self.stack
        ratio = (widths / stack.width)[stack.entry]
        slopes, offsets = [], []
        for part in _chunks(len(self.draws), stack.entry.size):
            high, low = self.kernel.places(self.draws[part] * ratio)
            slopes.append((self.draws[part] * (self.by_angle[high] - self.by_angle[low])) @ self.belongs)
            offsets.append(stack.nominal[high] - stack.nominal[low])
        slope, offset = np.concatenate(slopes), np.concatenate(offsets)
        values = np.asarray(slope @ widths + offset)
        if not self.slopes or (values > self._kept(widths) * (1 + 1e-12)).any():
            self.slopes, self.offsets = [*self.slopes, slope][-_KEPT:], [*self.offsets, offset][-_KEPT:]
        return values


def _chunks(number: int, components: int) -> Iterator[slice]:
    step = max(1, _CHUNK // components)
    return (slice(first, min(first + step, number)) for first in range(0, number, step))
