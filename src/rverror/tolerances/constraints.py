"""What allocation limits, as functions of the widths: the worst-case p-p, and quantiles of units that were solved.

Pages ``theory/allocation.md`` and ``theory/at-the-load.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from rverror.base.arrays import Array
from rverror.tolerances.closed_form import worst_pair
from rverror.tolerances.cost import CostModel
from rverror.tolerances.least_cost import ROUNDS, Constraint, Row, minimised
from rverror.tolerances.loaded_units import Solved
from rverror.tolerances.loaded_yield import Units
from rverror.tolerances.stacking import Stack

#: Share of its limits that a unit without an equilibrium uses.
LOST = 1e3
#: Relative change of the cost at which rounds of linear forms end.
SETTLED = 0.02

_BAND = 4.0  # shares of units beyond a quantile, over and under, between which units count for its smoothed mean
_KNOWN = 64  # units beyond a quantile from which the sample tells it: their number is then known to an eighth
_ACCURACY = 1e-9  # of the cost, relative, to which smooth widths are found
_MIDDLE, _TAIL = (0.3, 0.6), (0.75, 0.98)  # ranks of the units through which the quantiles of a sample are drawn


class WorstPeakToPeak(Constraint):
    """P-p of the worst parts: one row for each pair of angles, of which those that matter are found as needed."""

    def __init__(self, stack: Stack) -> None:
        """Of a stack, whatever its widths."""
        self.stack = stack
        self.known: dict[bytes, Row] = {}  # by widths: searching all pairs is dear

    def measure(self, widths: Array) -> tuple[float, Row]:
        """Largest p-p over all pairs of angles, and the row of its pair."""
        key = widths.tobytes()
        if key not in self.known:
            stack = self.stack
            _, high, low, _, own = worst_pair(stack, stack.scaled(widths), stack.at_middle(widths), stack.influence)
            self.known[key] = own, float(stack.nominal[high] - stack.nominal[low])
        own, offset = self.known[key]
        return float(own @ widths + offset), (own, offset)

    def cheapest(self, costs: CostModel, limit: float, rows: list[Row]) -> Array:
        """By the rows so far, and those that this solution turns out to need, until it needs no other."""
        for _ in range(ROUNDS):
            widths = self._for_rows(costs, limit, rows)
            new = self.exceeding(widths, limit)
            if not new:
                break
            rows.extend(new)
        return widths

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


@dataclass(frozen=True)
class SampleQuantile(Constraint):
    """Share of its limits that a unit uses: its quantiles over a sample, about the widths at which it was solved.

    Each turn of a unit is a linear row in the widths.  A quantile is the mean of the units around it; where few are
    beyond, that of a normal distribution through the mean of the units in the middle and of those in the tail: a small
    sample knows these two well, and its own extremes badly.

    Attributes
    ----------
    slopes : ndarray, shape (limits, kept, units, entries)
    offsets : ndarray, shape (limits, kept, units)
    at : ndarray, shape (entries,)
        Widths at which the sample was solved.
    still : ndarray, shape (limits,)
        Share of each limit that a unit without spread uses.
    level : float
        Share of the units that each limit must let pass.
    ratios : ndarray, shape (limits,)
        By how many times the spread about `still` differs from that of the sample.
    """

    slopes: Array
    offsets: Array
    at: Array
    still: Array
    level: float
    ratios: Array

    gap = SETTLED / 2
    rounds = 20  # each a program and a solution of 0.2 s; the next linear form tells of better grades anyway

    @classmethod
    def of(cls, units: Units, solved: Solved, widths: Array, still: Array, level: float) -> SampleQuantile:
        """Quantiles of units that were solved at some widths with their slopes."""
        allowed = np.array([one.allowed for one in units.limits])[:, None]
        known = np.isfinite(solved.turns)[:, :, None]
        near = np.where(known, solved.near / allowed, LOST)
        changes = np.where(known[..., None], solved.slopes / allowed[..., None], 0.0)
        slopes = np.ascontiguousarray(changes.transpose(1, 2, 0, 3))
        return cls(slopes, near.transpose(1, 2, 0) - slopes @ widths, widths, still, level, np.ones(len(still)))

    @cached_property
    def _weight(self) -> Array:
        """Weight of each unit of the sample, from the one that uses least, in the quantile."""
        count = self.offsets.shape[2]
        rank = (np.arange(count) + 0.5) / count
        if (1 - self.level) * count >= _KNOWN:
            distance = np.abs(np.log((1 - rank) / (1 - self.level)))
            taper = np.maximum(0.0, 1 - distance / math.log(_BAND))
            return np.asarray(taper / taper.sum())
        score = scipy.special.ndtri(rank)
        bands = [((rank > first) & (rank < last)) for first, last in (_MIDDLE, _TAIL)]
        middle, tail = (band / band.sum() for band in bands)
        share = (scipy.special.ndtri(self.level) - score @ middle) / (score @ tail - score @ middle)
        return np.asarray((1 - share) * middle + share * tail)

    def parts(self, widths: Array) -> tuple[Array, Array]:
        """Quantile of each limit, and its change with the widths, shapes (limits,) and (limits, entries)."""
        values, slopes = np.empty(len(self.still)), np.empty((len(self.still), widths.size))
        for limit, (changes, offsets) in enumerate(zip(self.slopes, self.offsets, strict=True)):
            turns = changes @ widths + offsets
            counted = np.argsort(turns.max(axis=0))[self._weight != 0]
            largest, weight = turns[:, counted].argmax(axis=0), self._weight[self._weight != 0]
            values[limit] = weight @ turns[largest, counted]
            slopes[limit] = weight @ changes[largest, counted]
        return self.still + self.ratios * (values - self.still), self.ratios[:, None] * slopes

    def measure(self, widths: Array) -> tuple[float, Row]:
        """The largest quantile, and the row that is equal to it here."""
        values, slopes = self.parts(widths)
        worst = int(values.argmax())
        return float(values[worst]), (slopes[worst], float(values[worst] - slopes[worst] @ widths))

    def cheapest(self, costs: CostModel, limit: float, rows: list[Row]) -> Array:
        """By all quantiles at once, which need no rows."""
        if self.measure(costs.high)[0] <= limit:
            return costs.high

        def room(widths: Array) -> tuple[Array, Array]:
            values, slopes = self.parts(widths)
            return 1 - values / limit, -slopes / limit

        start = np.clip(costs.given, costs.low, costs.high)
        return minimised(costs, start, room, accuracy=_ACCURACY)

    def best(self, costs: CostModel) -> Array:
        """Widths with the least largest quantile: what helps one limit may harm another, as pins take up play.

        Towards those of the linear program of the quantiles' slopes, or the least ones where these are better.
        """
        here = np.clip(self.at, costs.low, costs.high)
        values, slopes = self.parts(here)
        found = scipy.optimize.linprog(
            [*np.zeros(here.size), 1.0],
            A_ub=np.column_stack([slopes * here, -np.ones(len(values))]),  # in shares of the widths, alike in size
            b_ub=slopes @ here - values,
            bounds=[*zip(costs.low / here, costs.high / here, strict=True), (None, None)],
        )
        moved = here if found.x is None else np.clip(found.x[:-1] * here, costs.low, costs.high)
        nearer = [here + share * (moved - here) for share in (0.0, 0.03, 0.1, 0.3, 1.0)]  # another turn may be largest
        return min((*nearer, costs.low), key=lambda widths: self.measure(widths)[0])
