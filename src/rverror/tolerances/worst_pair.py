"""The exact worst-case peak-to-peak: the two angles between which parts at their limits make the largest difference.

The largest difference between two angles is a sum of the lengths ``|w(t1) - w(t2)|`` of each group's wave: a distance
of angles.  A walk from angle to farthest angle gives a good pair; by Cauchy and Schwarz one matrix product bounds all
pairs, and only those that the bound leaves open are computed.  Page ``theory/budget.md``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.tolerances.blocks import WorstGroup

Rows = npt.NDArray[np.intp]

_STARTS = 8
_ROWS = 256  # of pairs whose bounds, and
_PAIRS = 4096  # pairs whose sums, are held at a time
_SLACK = 1e-9  # rounding of a bound, relative
_DIRECTIONS = 128  # of a half turn


class GroupWaves:
    """Waves w of groups at their limits, whose distance ``sum |w(t1) - w(t2)|`` is the peak-to-peak that they can make.

    Boxes are waves of one number, shape (n, boxes); circles of two, shape (n, circles) each.
    """

    def __init__(self, groups: Sequence[WorstGroup], scaled: Array, nominal: Array | None = None) -> None:
        """Sum the rows of instances that move as one; the nominal error is a box that is always at its limit."""
        count = scaled.shape[1]
        waves = [group.radius * scaled[group.components].sum(axis=0) for group in groups]
        boxes = [wave[0] for wave in waves if wave.shape[0] == 1] + ([] if nominal is None else [nominal])
        circles = [wave for wave in waves if wave.shape[0] == 2]
        self.count = count
        self.box = np.array(boxes).reshape(-1, count).T.copy()
        self.x, self.y = (np.array([wave[axis] for wave in circles]).reshape(-1, count).T.copy() for axis in (0, 1))

    def distance(self, i: Rows, j: Rows) -> Array:
        """Distance of pairs of angles."""
        x, y = self.x[i] - self.x[j], self.y[i] - self.y[j]
        straight = np.abs(self.box[i] - self.box[j]).sum(axis=-1)
        return np.asarray(straight + np.sqrt(x * x + y * y).sum(axis=-1), dtype=np.float64)

    def size(self) -> Array:
        """Sum of ``|w|`` at each angle, shape (n,)."""
        return np.asarray(np.abs(self.box).sum(axis=1) + np.hypot(self.x, self.y).sum(axis=1), dtype=np.float64)

    def peak_to_peaks(self) -> Array:
        """Largest peak-to-peak of each group alone, boxes first; of circles seen from many directions, to 1e-4."""
        turns = np.pi * np.arange(_DIRECTIONS)[:, None] / _DIRECTIONS
        circles = [
            np.ptp(np.cos(turns) * x + np.sin(turns) * y, axis=1).max() for x, y in zip(self.x.T, self.y.T, strict=True)
        ]
        return np.concatenate([np.ptp(self.box, axis=0), circles])

    def farthest(self) -> tuple[float, int, int]:
        """Largest distance of two angles, exact, and their places."""
        best, first, second = self.walk()
        if best == 0:
            return 0.0, first, second
        features = self._features()
        square = np.einsum("nf,nf->n", features, features)
        for start in range(0, self.count, _ROWS):
            rows = slice(start, start + _ROWS)
            bound = square[rows, None] + square[start:] - 2 * features[rows] @ features[start:].T
            i, j = np.nonzero(bound > best**2 * (1 - _SLACK))
            later = j > i
            i, j = i[later] + start, j[later] + start
            for part in range(0, i.size, _PAIRS):
                pairs = slice(part, part + _PAIRS)
                found = self.distance(i[pairs], j[pairs])
                at = int(found.argmax())
                if found[at] > best:
                    best, first, second = float(found[at]), int(i[pairs][at]), int(j[pairs][at])
        return best, first, second

    def walk(self) -> tuple[float, int, int]:
        """Good pair: from some angles to the farthest one, and on from there as long as that helps."""
        every = np.arange(self.count)
        best = (0.0, 0, 0)
        for start in range(0, self.count, max(self.count // _STARTS, 1)):
            at, reached = start, -1.0
            while True:
                found = self.distance(np.full_like(every, at), every)
                to = int(found.argmax())
                if found[to] <= reached:
                    break
                reached = float(found[to])
                best = max(best, (reached, at, to))
                at = to
        return best

    def _features(self) -> Array:
        """Points whose Euclidean distance is a bound on `distance`, by Cauchy and Schwarz."""
        usual = [np.sqrt(2 * self.box.var(axis=0)), np.sqrt(2 * (self.x.var(axis=0) + self.y.var(axis=0)))]
        waves = np.concatenate([self.box, self.x, self.y], axis=1)
        weight = np.concatenate([usual[0], usual[1], usual[1]])
        moving = weight > 0
        total = float(usual[0].sum() + usual[1].sum())
        points = (waves - waves.mean(axis=0))[:, moving] * np.sqrt(total / weight[moving])
        return np.ascontiguousarray(points)
