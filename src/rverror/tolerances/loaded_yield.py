"""Yield: virtual units drawn afresh, at the load or in closed form, and the share of them that each limit lets pass."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rverror.base.arrays import Array
from rverror.base.directions import Direction, direction_sign
from rverror.base.progress import Progress
from rverror.base.units import InCore
from rverror.base.viewed import OneLine
from rverror.model.effects import Model, check_model
from rverror.tolerances.declared import Tolerance
from rverror.tolerances.extremes import Kernel, kernel
from rverror.tolerances.loaded_units import CLEAR, LoadedUnits, Solved
from rverror.tolerances.sampling import IntervalEstimate, check_share, order_statistics, share_interval, uniforms
from rverror.tolerances.specification import Limit, check_limits
from rverror.tolerances.stacking import Stack, stack

_CHUNK = 1_000_000  # numbers in the draws of one chunk of units


@dataclass(frozen=True)
class ClosedFormUnits:
    """Units of a stack in closed form, to be solved as `LoadedUnits` are.

    Attributes
    ----------
    stack : Stack
    limits : tuple of Limit
        One, of the transmission error.
    """

    stack: Stack
    limits: tuple[Limit, ...]

    @cached_property
    def _kernel(self) -> Kernel:
        return kernel(self.stack.scaled(), self.stack.nominal)

    def solved(self, drawn: Array, widths: Array, *, progress: Callable[[int], None] | None = None, **_: Any) -> Solved:
        """Peak-to-peaks of units; the parameters are those of `LoadedUnits.solved`.

        Of these the others change nothing: slopes are always told, all units are solved to the end, none sooner.
        """
        stack, count = self.stack, len(drawn)
        ratio, by_angle = (widths / stack.width)[stack.entry], np.ascontiguousarray(stack.influence.T)
        belongs = (stack.entry[:, None] == np.arange(widths.size)).astype(np.float64)
        slope, nominal = np.empty((count, widths.size)), np.empty(count)
        step = max(1, _CHUNK // stack.entry.size)
        for first in range(0, count, step):
            part = slice(first, min(first + step, count))
            high, low = self._kernel.places(drawn[part] * ratio)
            slope[part] = (drawn[part] * (by_angle[high] - by_angle[low])) @ belongs
            nominal[part] = stack.nominal[high] - stack.nominal[low]
            if progress is not None:
                progress(part.stop)
        turns = (slope @ widths + nominal)[:, None]
        return Solved(turns, (), turns[..., None], slope[:, None, None])


#: Units that are solved where no number is given: a yield of 99 % is known to half a per cent by them.
COUNT = 2000

#: Units that can be solved for limits.
Units = LoadedUnits | ClosedFormUnits

_FIRST_STREAM = 2**32 - 1  # of draws; chunks of virtual units count from 0


@dataclass(frozen=True)
class LimitYield(OneLine):
    """What units make of one limit at the load.

    Attributes
    ----------
    limit : Limit
        With its torque; its value is None where only the distribution was asked for.
    values : ndarray, shape (units,)
        rad, or N*mm/rad of the stiffness; not a number where no equilibrium was found, which counts as a bad unit.
    confidence : float
        Of the intervals.
    known_from : float
        Of units below this value it is known only that they are within the limit.
    """

    limit: Limit
    values: Array
    confidence: float
    known_from: float = -math.inf

    @property
    def units(self) -> int:
        """Units that were drawn."""
        return self.values.size

    @property
    def good(self) -> Any:
        """Whether each unit is within the limit, shape (units,)."""
        value = math.nan if self.limit.value is None else self.limit.value
        return self.values >= value if self.limit.quantity == "stiffness" else self.values <= value

    @property
    def share(self) -> float:
        """Yield: share of the units within the limit."""
        return float(self.good.mean())

    @property
    def interval(self) -> tuple[float, float]:
        """Interval of the yield by Clopper and Pearson."""
        return share_interval(int(self.good.sum()), self.units, self.confidence)

    @property
    def met(self) -> bool:
        """Whether the whole interval is at the level of the limit or above."""
        return self.interval[0] >= self.limit.level

    def quantile(self, probability: float) -> IntervalEstimate:
        """Value that so large a share of the units does not exceed; of the stiffness, does not fall below.

        Not a number where it is below `known_from`.
        """
        check_share("probability", probability)
        known = np.sort(self.values[np.isfinite(self.values)])
        if self.limit.quantity != "stiffness":
            found = order_statistics(known, probability, self.confidence)
            return found if found.value >= self.known_from else IntervalEstimate(math.nan, math.nan, math.nan)
        turned = order_statistics(-known[::-1], probability, self.confidence)
        return IntervalEstimate(-turned.value, -turned.high, -turned.low)


@dataclass(frozen=True)
class Verified(OneLine):
    """Fresh units at the loads of all limits.

    Attributes
    ----------
    limits : tuple of LimitYield
    together : float
        Share of the units within all limits, and its interval.
    together_interval : tuple of float
    failures : tuple of str
        Units without an equilibrium, and why.
    seed : int
    stream : int
        Which draws of this seed.
    """

    limits: tuple[LimitYield, ...]
    together: float
    together_interval: tuple[float, float]
    failures: tuple[str, ...]
    seed: int
    stream: int


def loaded_units(
    model: Model, tolerances: Sequence[Tolerance], limits: Sequence[Limit], *, direction: Direction = "forward"
) -> LoadedUnits:
    """Make a model and its tolerances ready to be solved at the loads of limits.

    Parameters
    ----------
    model : Model
        Of a reducer.
    tolerances : sequence of Tolerance
    limits : sequence of Limit
    direction : {"forward", "reverse"} or +1 or -1
        Of the transmission error.

    Returns
    -------
    LoadedUnits

    Raises
    ------
    InputError
        If a tolerance or a limit does not fit the model.
    """
    check_model(model)
    read = check_limits(limits, model.mechanism)
    laid = stack(model, tolerances, direction=direction, torque=InCore(max(one.largest for one in read)) or None)
    means = [tolerances[e].mean.get(c.parameter, 0.0) for c, e in zip(laid.components, laid.entry, strict=True)]
    return LoadedUnits(model, laid, np.array(means), read, (direction_sign(direction),) * len(read))


def standard_draws(laid: Stack, count: int, *, seed: int, stream: int) -> Array:
    """Standard draws of units, shape (count, components): plain random ones of one of many streams of a seed."""
    blocks = uniforms(count, laid.dimensions, seed=seed, index=_FIRST_STREAM - stream, plain=True)
    return np.concatenate([laid.standard(block) for block in blocks])


def verified(
    units: Units,
    widths: Array,
    *,
    count: int = COUNT,
    seed: int = 0,
    stream: int = 0,
    confidence: float = 0.95,
    decide: bool = False,
    progress: Progress | None = None,
) -> Verified:
    """Draw units afresh and solve them at the loads of all limits.

    Parameters
    ----------
    units : Units
    widths : ndarray, shape (entries,)
        Core units.
    count : int
        Units.
    seed, stream : int
        Other ones give independent units.
    confidence : float
        Of the intervals.
    decide : bool
        As for `LoadedUnits.solved`.
    progress : callable, optional
        Called with a line of text as units are solved.

    Returns
    -------
    Verified
    """
    drawn = standard_draws(units.stack, count, seed=seed, stream=stream)
    what = "units in closed form" if isinstance(units, ClosedFormUnits) else "units under load"
    found = units.solved(drawn, widths, decide=decide, progress=counted(progress, what, count))
    known = np.isfinite(found.turns)
    rows = []
    for number, one in enumerate(units.limits):
        turns = np.where(known[:, number], found.turns[:, number], math.nan)
        known_from = CLEAR * one.allowed if decide and not one.loads else -math.inf
        rows.append(LimitYield(one, np.asarray(one.turned(turns), dtype=np.float64), confidence, known_from))
    limited = [row.good for row in rows if row.limit.value is not None]
    good = np.all(limited, axis=0) if limited else known.all(axis=1)
    interval = share_interval(int(good.sum()), good.size, confidence)
    return Verified(tuple(rows), float(good.mean()), interval, found.failures, seed, stream)


def counted(progress: Progress | None, what: str, count: int) -> Callable[[int], None] | None:
    """Progress in per cent from the numbers of units."""
    if progress is None:
        return None
    step = max(count // 50, 1)

    def tell(number: int) -> None:
        if number % step == 0 or number == count:
            progress(f"{count} {what}: {100 * number / count:.0f} %")

    return tell
