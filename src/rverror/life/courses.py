"""Courses of a cause over the sessions of a unit: a growth in proportion to time, one that settles, a jump.

Page ``theory/trend.md``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rverror.base.arrays import Array

_COARSE, _FINE = 4, 16  # time constants of growths that settle that are tried, and in between
_SETTLING = (0.03, 0.6)  # the shortest and longest, as shares of the time from the first session to the last
_BETWEEN = 6  # times between two sessions from which a growth may start
_GROWN = 2  # sessions that show a growth: one that the last session alone has may be a jump as well


@dataclass(frozen=True)
class Course:
    """How a cause of size 1 has grown.

    Attributes
    ----------
    kind : str
        ``"linear"``, ``"settling"`` or ``"step"``.
    since : float
        Time from which on it grows; of a jump that of the first session that has it, hours or cycles.
    end : float
        Time of the last session, at which it is 1.
    settling : float
        Time constant of a growth that settles, hours or cycles.
    cost : float
        Minus twice the logarithm of its prior probability.
    """

    kind: str
    since: float
    end: float
    settling: float = 0.0
    cost: float = 0.0

    def grown(self, at: Array) -> Array:
        """Size at some times."""
        after, span = np.maximum(at - self.since, 0.0), self.end - self.since
        if self.kind == "step":
            return np.where(at >= self.since, 1.0, 0.0)
        if self.kind == "linear":
            return np.asarray(after / span)
        return np.asarray(np.expm1(-after / self.settling) / math.expm1(-span / self.settling))

    def centred(self, at: Array) -> Array:
        """The same about its mean: what does not change is not asked for."""
        values = self.grown(at)
        return np.asarray(values - values.mean())

    def bend(self, at: Array) -> Array:
        """How a growth is off that bends between none and all of it, about its mean; 0 of a jump."""
        grown = self.grown(at)
        values = 4 * grown * (1 - grown)
        return np.asarray(values - values.mean())

    @property
    def rate(self) -> float:
        """Growth per hour or cycle at the end, over the size there; 0 of a jump."""
        span = self.end - self.since
        if self.kind == "step":
            return 0.0
        if self.kind == "linear":
            return 1 / span
        return math.exp(-span / self.settling) / self.settling / -math.expm1(-span / self.settling)


def courses_of(at: Array, *, fine: bool = False) -> tuple[Course, ...]:
    """Courses that sessions can tell apart.

    Parameters
    ----------
    at : ndarray, shape (sessions,)
        Hours or cycles, growing.
    fine : bool
        Whether growths start between sessions as well, and more time constants are tried.

    Returns
    -------
    tuple of Course
        A jump at each session but the first; of three and more a growth from each session that two follow; of four
        and more growths that settle.  Each kind is as probable as another, and so is each session of a kind, but that
        half of the linear growths go on from the first.

    Examples
    --------
    >>> [(one.kind, one.since) for one in courses_of(np.array([0.0, 10, 20]))]
    [('step', 10.0), ('step', 20.0), ('linear', 0.0)]
    >>> courses_of(np.array([0.0, 10, 20]))[2].grown(np.array([0.0, 10, 20]))
    array([0. , 0.5, 1. ])
    """
    count, first, end = len(at), float(at[0]), float(at[-1])
    hinges = [float(time) for time in at[1 : count - _GROWN]]
    kinds = 1 + (count > _GROWN) + (count > _GROWN + 1)

    def cost(members: float) -> float:
        return 2 * math.log(kinds * members)

    found = [Course("step", float(time), end, 0.0, cost(count - 1)) for time in at[1:]]
    if count > _GROWN:
        found.append(Course("linear", first, end, 0.0, cost(2 if hinges else 1)))
        starts = _between([first, *hinges])[1:] if fine else hinges
        found += [Course("linear", time, end, 0.0, cost(2 * len(hinges))) for time in starts]
    if count > _GROWN + 1:
        times = np.geomspace(*_SETTLING, _FINE if fine else _COARSE) * (end - first)
        found += [Course("settling", first, end, float(time), cost(_COARSE)) for time in times]
    return tuple(found)


def _between(times: Sequence[float]) -> list[float]:
    """Times, and some between each two."""
    every = np.interp(np.arange((len(times) - 1) * _BETWEEN + 1) / _BETWEEN, np.arange(len(times)), times)
    return [float(time) for time in every]
