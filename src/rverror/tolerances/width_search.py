"""Search of the widths of least cost whose yield holds, verified by units drawn afresh.

Page ``theory/at-the-load.md``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from rverror.base.arrays import Array, Flags
from rverror.base.errors import InputError
from rverror.base.progress import Progress
from rverror.tolerances.allocation_result import Allocation, described
from rverror.tolerances.constraints import LOST, SETTLED, SampleQuantile
from rverror.tolerances.cost import CostModel
from rverror.tolerances.least_cost import CLOSE, Found, least_cost
from rverror.tolerances.loaded_units import CLEAR, LoadedUnits, Solved
from rverror.tolerances.loaded_yield import ClosedFormUnits, Units, Verified, counted, standard_draws, verified
from rverror.tolerances.sampling import share_interval
from rverror.tolerances.stacking import Stack

_CONFIDENCE = 0.95  # of the verified intervals
_ROUNDS = 10  # of linearisation
_FEW = 128  # units of the sample on which the first rounds at the load are
_REACH, _LEAST_REACH = 2.0, 1.15  # factor by which a round may change a width, at first and at least
_FARTHEST = 0.05  # relative; from what the linear form predicted, at which the next round goes less far
_ATTEMPTS = 6  # at a verification; each has half of what the confidence leaves of the one before
_LEAST_SPREAD = 0.01  # of what a unit uses: less tells nothing of the spread of others
_HOPELESS = 1.1  # times the spread that a limit leaves room for: what the sample tells is less certain than that
_STUCK = 1e-3  # relative: where no step makes a quantile smaller by more, none does
_SCALINGS = 8  # most of all widths alike
_SLACK = 0.05  # of the cost, which a verified list may be dearer than it seems to need be; at the load, and
_CLOSED_SLACK = 0.005  # in closed form, where a verification takes no time
_IDLE = 1e-12  # of the largest wave: rounding, where a tolerance only moves the offset
_CLOSED_SAMPLE = 2**10  # units of the closed form with which a search at the load begins


class UnreachableError(InputError):
    """The limits cannot be met."""


@dataclass
class WidthSearch:
    """Rounds of linearisation, and verifications, for one set of limits.

    Attributes
    ----------
    units : LoadedUnits or ClosedFormUnits
    costs : CostModel
    sample, verify : int
        Units on which the widths are optimised and, drawn afresh, verified.
    seed : int
    progress : callable
        Called with a line of text as the work goes on.
    """

    units: Units
    costs: CostModel
    sample: int
    verify: int
    seed: int
    progress: Progress

    def __post_init__(self) -> None:
        """Draw the sample, and see how many bad units a verification may have."""
        units, verify = self.units, self.verify
        self.level = min(one.level for one in units.limits)
        self.bad, self.most = -1, max(one.level for one in units.limits)
        while share_interval(verify - self.bad - 1, verify, 1 - _leaves(0))[0] >= self.most:
            self.bad += 1
        if self.bad < 0:
            needed = math.ceil(math.log(_leaves(0) / 2) / math.log(self.most))
            raise InputError(
                f"verify = {verify}: too few units to verify a yield of {100 * self.most:g} %; give {needed} or more"
            )
        #: Units that may be beyond the limits at the widths aimed at: of those with which a verification still succeeds
        #: half, or all but two standard deviations, so that chance seldom makes it fail.
        self.beyond = max(self.bad // 2, int(self.bad - 2 * math.sqrt(self.bad)))
        #: And for each limit, as others may have other bad units.
        self.beyond_each = self.beyond // len(units.limits)
        self.drawn = standard_draws(units.stack, self.sample, seed=self.seed, stream=0)
        self.loaded = isinstance(units, LoadedUnits)
        self.few, self.slack = (min(_FEW, self.sample), _SLACK) if self.loaded else (self.sample, _CLOSED_SLACK)
        turns = units.solved(np.zeros((1, self.drawn.shape[1])), self.costs.given).turns[0]
        self.still = turns / np.array([one.allowed for one in units.limits])
        self.ratios: list[Array] = []
        self._solved: Solved | None = None

    def allocation(self) -> Allocation:
        """Widths of least cost that fresh units verify."""
        given = self._local(self.costs.given, "the widths as given", self.few)
        value, (slope, _) = given.measure(self.costs.given)
        found = self._first_found()
        found, local = self._settled(found, self._local(found.widths, "the first widths", self.few), rounds=_ROUNDS)
        if self.few < self.sample:
            found, local = self._settled(found, self._local(found.widths, "all units", self.sample), rounds=2)
        any_smooth = bool((self.costs.smooth & (self.costs.high > self.costs.low)).any())
        best: tuple[Found, SampleQuantile, Verified] | None = None
        for attempt in range(_ATTEMPTS):
            fresh = self._verified(found.widths, attempt)
            if not self._met(fresh) and best is not None:
                break
            if self._met(fresh) and (best is None or self._cost(found) < self._cost(best[0])):
                best = found, local, fresh
            local = self._calibrated(local, found.widths, fresh)
            ahead = self._step(local, found, _REACH, hold=any_smooth)
            change = self._change(found, ahead)
            enough = self.loaded and attempt > 1  # a verification takes most of the time there
            if best is not None and (enough or change < self.slack or self._cost(ahead) > self._cost(found)):
                break
            found, local = (ahead, local) if change < 2 * _FARTHEST else self._settled(found, local, rounds=2)
        if best is None:
            raise InputError(
                f"limits: after {_ATTEMPTS} verifications the yield of fresh units is {100 * fresh.together:.4g} %, "
                f"not verified at {100 * self.level:g} %; give {4 * self.verify} units that verify"
            )
        found, local, fresh = best
        aimed, row = local.measure(found.widths)
        return described(
            self.units.stack,
            self.costs,
            found,
            kind="load" if self.loaded else "yield",
            level=self.level,
            limit=None if self.loaded else self.units.limits[0].value,
            used_before=(value, slope),
            used=_used(fresh, round((1 - self.level) * fresh.limits[0].units)),
            binding=(aimed, [row]),
            uniform_cost=self._uniform_cost(found.widths),
            verified=fresh if self.loaded else None,
            seed=self.seed,
        )

    def _first_found(self) -> Found:
        """Widths of the closed form; those as given where it knows none of the limits, or cannot meet them."""
        stack, given = self.units.stack, self.costs.given
        grades = tuple(
            min(max(table.index(max(given[e], table.widths[0])), allowed[0]), allowed[-1])
            for e, table, allowed in self.costs.tables
        )
        costs = self.costs.holding(grades)
        widths = np.clip(costs.given, costs.low, costs.high)
        errors = [one for one in self.units.limits if one.quantity == "transmission_error"]
        idle = idle_entries(stack)  # what does nothing there may do much here
        if errors and self.loaded and (costs.smooth & ~idle).any():
            low, high = (np.where(idle, widths, end) for end in (costs.low, costs.high))
            closed = ClosedFormUnits(stack, (min(errors, key=lambda one: one.allowed),))
            costs = replace(costs, given=widths, low=low, high=high)
            search = replace(self, units=closed, costs=costs, sample=_CLOSED_SAMPLE)
            with suppress(UnreachableError):  # contacts that open may help
                local = search._local(widths, "closed form", _CLOSED_SAMPLE)
                widths = search._settled(Found(widths, ()), local, rounds=_ROUNDS)[0].widths
        return Found(widths, grades)

    def _local(self, widths: Array, what: str, count: int) -> SampleQuantile:
        """The first units of the sample solved at some widths."""
        tell = counted(lambda text: self.progress(f"{what}: {text}"), "units of the sample", count)
        solved = self.units.solved(self.drawn[:count], widths, slopes=True, near=self._solved, progress=tell)
        self._solved = solved  # the starts of the next one
        level = 1 - max(self.beyond_each, 0.5) / self.verify
        local = SampleQuantile.of(self.units, solved, widths, self.still, level)
        return replace(local, ratios=np.mean(self.ratios, axis=0)) if self.ratios else local

    def _calibrated(self, local: SampleQuantile, widths: Array, fresh: Verified) -> SampleQuantile:
        """The sample with the spread that fresh units have in place of what it predicted at their widths."""
        predicted = replace(local, ratios=np.ones(len(local.still))).parts(widths)[0] - local.still
        used = np.array([_used(replace(fresh, limits=(one,)), self.beyond_each) for one in fresh.limits])
        # where the first angles decided, a peak-to-peak is known too low
        known = (used >= CLEAR) & (predicted > _LEAST_SPREAD * used)
        ratios = np.where(known, (used - local.still) / np.where(known, predicted, 1.0), 1.0)
        self.ratios.append(np.clip(ratios, 0.5, 2.0))
        return replace(local, ratios=np.mean(self.ratios, axis=0))

    def _settled(self, found: Found, local: SampleQuantile, *, rounds: int) -> tuple[Found, SampleQuantile]:
        """Least cost with the quantiles of the sample within the limits, by rounds of linear forms; the last one."""
        count = local.offsets.shape[2]
        reach, tried = _REACH, dict[tuple[int, ...], float]()
        for number in range(rounds):
            ahead = self._next(local, found, reach, tried)
            predicted = local.measure(ahead.widths)[0]
            near = self._change(found, ahead) <= SETTLED and predicted <= 1 + CLOSE
            found = ahead
            if near:
                return found, local
            local = self._local(found.widths, f"round {number + 1}", count)
            if abs(local.measure(found.widths)[0] / predicted - 1) > _FARTHEST:  # the form does not hold as far
                reach = max(math.sqrt(reach), _LEAST_REACH)
        return self._step(local, found, reach, hold=bool(self.costs.tables)), local

    def _change(self, one: Found, other: Found) -> float:
        """Relative change of the cost, of which other grades are a whole one."""
        if one.grades != other.grades:
            return 1.0
        before, after = self._cost(one), self._cost(other)
        return abs(after - before) / max(before, after) if before != after else 0.0

    def _next(self, local: SampleQuantile, found: Found, reach: float, tried: dict[tuple[int, ...], float]) -> Found:
        """The next widths; grades that were tried count by the cost that they came to where they were."""
        costs = self.costs.holding(found.grades)
        if self.costs.tables and local.measure(local.best(costs))[0] > 1:
            return self._step(local, found, reach, hold=False)  # these grades do not lead there
        held = self._step(local, found, reach, hold=True)
        if not self.costs.tables or local.measure(held.widths)[0] > 1 + CLOSE:
            return held
        tried[held.grades] = self._cost(held)
        free = self._step(local, found, reach, hold=False)
        return free if tried.get(free.grades, self._cost(free)) < tried[held.grades] else held

    def _step(self, local: SampleQuantile, at: Found, reach: float, *, hold: bool) -> Found:
        """Least cost of the linear form within reach of the widths; as near to the limits as that leads."""
        costs = self.costs.holding(at.grades) if hold else self.costs
        widths, smooth = at.widths, costs.smooth
        low = np.where(smooth, np.clip(widths / reach, costs.low, costs.high), costs.low)
        high = np.where(smooth, np.clip(widths * reach, costs.low, costs.high), costs.high)
        tables = tuple(
            (e, table, _within(table.widths, allowed, widths[e], reach)) for e, table, allowed in costs.tables
        )
        for e, table, allowed in tables:
            low[e], high[e] = table.widths[allowed[0]], table.widths[allowed[-1]]
        near = replace(costs, given=np.where(smooth, widths, costs.given), low=low, high=high, tables=tables)
        best = local.best(near)
        least = local.measure(best)[0]
        used = replace(local, level=self.level).parts(best)[0]  # what is aimed at has fewer bad units than it may have
        spread = (used - local.still) / np.maximum(1 - local.still, CLOSE)
        stuck = least > local.measure(np.clip(widths, low, high))[0] * (1 - _STUCK)
        if (local.still > 1).any() or (stuck and spread.max() > _HOPELESS):
            raise self._unreachable(replace(local, level=self.level), best)
        found = least_cost(near, local, max(1.0, least * (1 + CLOSE)), [])
        if found is None:  # none of the grades that were tried
            return self._step(local, at, reach, hold=True) if not hold else at
        return found._replace(grades=at.grades) if hold else found

    def _uniform_cost(self, widths: Array) -> float | None:
        """Cost of the widths as given, all free ones scaled alike until a sample is as good; None where none is."""
        costs, free = self.costs, ~self.costs.fixed
        finest = np.zeros(widths.size)
        for e, table, _ in costs.tables:
            finest[e] = table.widths[0]
        aim = self._local(widths, "the widths found", self.few).measure(widths)[0]
        scale = 1.0
        for number in range(_SCALINGS):
            scaled = np.where(free, np.maximum(scale * costs.given, finest), costs.given)
            local = self._local(scaled, f"scaled alike, {number + 1}", self.few)
            value, (slope, _) = local.measure(scaled)
            ahead = scale + (aim - value) / float(slope @ np.where(free, costs.given, 0.0))
            if abs(ahead / scale - 1) <= SETTLED:
                return costs.total(scaled)
            scale = float(np.clip(ahead, scale / 2, 2 * scale))
        return None

    def _verified(self, widths: Array, attempt: int) -> Verified:
        count = self.verify  # or more: as many bad units as at first must do
        while share_interval(count - self.bad, count, 1 - _leaves(attempt))[0] < self.most:
            count = math.ceil(1.05 * count)
        return verified(
            self.units,
            widths,
            count=count,
            seed=self.seed,
            stream=attempt + 1,
            confidence=1 - _leaves(attempt),
            decide=True,
            progress=lambda text: self.progress(f"verification {attempt + 1}: {text}"),
        )

    def _met(self, fresh: Verified) -> bool:
        return fresh.together_interval[0] >= self.level and all(one.met for one in fresh.limits)

    def _cost(self, found: Found) -> float:
        return self.costs.total(found.widths)

    def _unreachable(self, local: SampleQuantile, widths: Array) -> UnreachableError:
        """Why the limits cannot be met: which of them, and what holds it up."""
        values, slopes = local.parts(widths)
        worst = int(np.argmax(values))
        one, still = self.units.limits[worst], self.units.limits[worst].allowed * self.still[worst]
        assert one.value is not None
        said = f"{one.label} within {one.shown(one.value):.4g} {one.unit}: with every width at its best "
        said += f"{100 * self.level:g} % of the units use {100 * values[worst]:.4g} % of this limit"
        if still > one.allowed:
            said += (
                f"; without any spread it is {one.shown(one.turned(still)):.4g} {one.unit}: raise the limit, or change "
                "the means of the tolerances (clearances) or the declared model"
            )
        else:
            label = self.costs.labels[int((slopes[worst] * widths).argmax())]
            said += f"; raise the limit or allow finer widths, first of {label}"
        return UnreachableError(said)


def idle_entries(stack: Stack) -> Flags:
    """Entries that make no wave in closed form, rounding apart."""
    waves = np.ptp(stack.influence, axis=1) * stack.width[stack.entry]
    size = np.array([waves[rule.components].max(initial=0.0) for rule in stack.rules])
    return np.asarray(size <= _IDLE * size.max())


def _used(fresh: Verified, beyond: int) -> float:
    """Share of the limits that no more than so many fresh units exceed."""
    shares = [one.limit.turned(one.values) / one.limit.allowed for one in fresh.limits]
    used = np.sort(np.nan_to_num(np.max(shares, axis=0), nan=LOST))
    return float(used[-1 - beyond])


def _leaves(attempt: int) -> float:
    """What the confidence of an attempt leaves: half of what that of all before it leaves, so that all hold."""
    return (1 - _CONFIDENCE) * 0.5 ** (attempt + 1)


def _within(offered: Sequence[float], allowed: tuple[int, ...], width: float, reach: float) -> tuple[int, ...]:
    """Grades within reach of a width, and the next one to either side."""
    near = [g for g in allowed if width / reach <= offered[g] <= width * reach]
    below = [g for g in allowed if offered[g] < width / reach][-1:]
    above = [g for g in allowed if offered[g] > width * reach][:1]
    return (*below, *near, *above)
