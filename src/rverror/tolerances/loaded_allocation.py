"""Least cost for limits at the load: widths whose yield holds where contacts open, verified by units drawn afresh.

Page ``theory/at-the-load.md``.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from rverror.base.arrays import Array
from rverror.base.directions import Direction
from rverror.base.errors import InputError
from rverror.model.effects import Model
from rverror.tolerances.allocation import Allocation, closed_form_quantile, described, rates_of, step_of
from rverror.tolerances.constraints import Quantile, ranked
from rverror.tolerances.cost_model import CostModel, cost_model
from rverror.tolerances.declared import Tolerance
from rverror.tolerances.least_cost import CLOSE, Constraint, Found, least_cost
from rverror.tolerances.loaded_units import CLEAR, LoadedUnits, Solved
from rverror.tolerances.loaded_yield import COUNT, Verified, counted, loaded_units, standard_draws, verified
from rverror.tolerances.sampling import share_interval
from rverror.tolerances.specification import Limit

#: Units on which the widths are optimised.
SAMPLE = 384

_ROUNDS = 10  # of linearisation
_FEW = 128  # units of the sample on which the first rounds are
_REACH, _LEAST_REACH = 2.0, 1.15  # factor by which a round may change a width, at first and at least
_SETTLED = 0.02  # relative change of the cost at which rounds end
_FARTHEST = 0.05  # relative; from what the linear form predicted, at which the next round goes less far
_ATTEMPTS = 6  # at a verification; each has half of what the confidence leaves of the one before
_LEAST_SPREAD = 0.01  # of what a unit uses: less tells nothing of the spread of others
_HOPELESS = 1.1  # times the spread that a limit leaves room for: what the sample tells is less certain than that
_STUCK = 1e-3  # relative: where no step makes a quantile smaller by more, none does
_SCALINGS = 8  # most of all widths alike
_SLACK = 0.05  # of the cost, which a verified list may be dearer than it seems to need be
_MIDDLE, _TAIL = (0.3, 0.6), (0.75, 0.98)  # ranks of the units through which the quantiles of a sample are drawn
_LOST = 1e3  # share of its limits that a unit without an equilibrium uses
_CLOSED_SAMPLE, _CLOSED_UNITS = 2**10, 2**14  # units of the closed form


def allocate_at_load(
    model: Model,
    tolerances: Sequence[Tolerance],
    limits: Sequence[Limit],
    *,
    direction: Direction = "forward",
    sample: int = SAMPLE,
    verify: int = COUNT,
    confidence: float = 0.95,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Allocation:
    """Find the widths of least cost with which units meet limits at the load, contacts that open included.

    Parameters
    ----------
    model : Model
        Of a reducer.
    tolerances : sequence of Tolerance
        With their costs, bounds and what is fixed.
    limits : sequence of Limit
        Each holds for its share of the units; all of them together for the least of these shares.
    direction : {"forward", "reverse"} or +1 or -1
        Of the transmission error.
    sample, verify : int
        Units on which the widths are optimised and, drawn afresh, verified.
    confidence : float
        Of the verified intervals.
    seed : int
        Fixes all draws.
    progress : callable, optional
        Called with a line of text as the work goes on.

    Returns
    -------
    Allocation
        Of the kind ``"load"``.  The interval of each verified yield is at its level or above.

    Raises
    ------
    InputError
        If an argument is out of its bounds, or the limits cannot be met: the message says what holds them up.

    Notes
    -----
    The closed form begins.  Then every unit of a sample is solved at the loads, with the change of its largest turns
    with every width from the influences there, and the least cost of this linear form within a factor of the widths
    is taken, again and again.  Fresh units verify; where they do not, they tell how much is missing.

    Examples
    --------
    >>> import rverror
    >>> unit, cost = rverror.Model(rverror.reducer("RV-40E")), rverror.tolerances.cost.Reciprocal(12.0, 0.005)
    >>> cams = [rverror.tolerance("crank.eccentricity", "5 um", cost=cost)]
    >>> limits = [rverror.limit("transmission_error", "30 arcsec", torque="412 N*m")]
    >>> found = allocate_at_load(unit, cams, limits, sample=64, verify=500)
    >>> found.verified.limits[0].share > 0.99
    True
    """
    units = loaded_units(model, tolerances, limits, direction=direction)
    if any(one.value is None for one in units.limits):
        raise InputError("limits: one has no value; give it, such as limit('transmission_error', '60 arcsec')")
    costs = cost_model(units.stack.labels, units.stack.width, units.stack.choices)
    return _Search(units, costs, sample, verify, confidence, seed, progress or (lambda text: None)).allocation()


# --- quantiles of what units use of their limits ----------------------------------------------------------------------


class LoadedQuantile(Constraint):
    """Share of its limits that a unit uses: its quantiles over a sample, about the widths at which it was solved.

    Each turn of a unit is a linear row in the widths.  A quantile is that of a normal distribution through the mean of
    the units in the middle and of those in the tail: a sample knows these two well, and its own extremes badly.
    """

    proof = "no small change of the widths costs less, by the influences at the load; nothing more is proven"
    gap = _SETTLED / 2
    accuracy = 1e-9
    rounds = 20  # each a program and a solution of 0.2 s; the next linear form tells of better grades anyway

    def __init__(self, units: LoadedUnits, solved: Solved, widths: Array, target: float, still: Array) -> None:
        """Take the rows of a sample.

        `target` is the share of the units that each limit must let pass; `still` the share of each that a unit without
        spread uses.
        """
        assert solved.near is not None
        assert solved.slopes is not None
        allowed = np.array([one.allowed for one in units.limits])[:, None]
        known = np.isfinite(solved.turns)[:, :, None]
        near = np.where(known, solved.near / allowed, _LOST)
        slopes = np.where(known[..., None], solved.slopes / allowed[..., None], 0.0)
        self.slopes = np.ascontiguousarray(slopes.transpose(1, 2, 0, 3))  # (limits, kept, units, entries)
        self.offsets = near.transpose(1, 2, 0) - self.slopes @ widths
        self.at, self.count = widths, len(near)
        self.weight = self._weight(target)
        self.still = still
        self.ratios = np.ones(len(still))

    def calibrated(self, ratios: Array) -> LoadedQuantile:
        """The same with so many times the spread, about a unit without any, in the quantile of each limit."""
        same = copy.copy(self)
        same.ratios = ratios
        return same

    def at_level(self, level: float) -> LoadedQuantile:
        """The same for another share of the units."""
        same = copy.copy(self)
        same.weight = self._weight(level)
        return same

    def _weight(self, level: float) -> Array:
        """Weight of each unit of the sample, from the one that uses least, in the quantile at a level."""
        rank = (np.arange(self.count) + 0.5) / self.count
        score = scipy.special.ndtri(rank)
        bands = [((rank > first) & (rank < last)) for first, last in (_MIDDLE, _TAIL)]
        middle, tail = (band / band.sum() for band in bands)
        share = (scipy.special.ndtri(level) - score @ middle) / (score @ tail - score @ middle)
        return np.asarray((1 - share) * middle + share * tail)

    def parts(self, widths: Array) -> tuple[Array, Array]:
        """Quantile of each limit, and its change with the widths, shapes (limits,) and (limits, entries)."""
        pairs = zip(self.slopes, self.offsets, strict=True)
        found = [ranked(slopes, offsets, widths, slice(None), self.weight) for slopes, offsets in pairs]
        values, slopes = np.array([value for value, _ in found]), np.array([slope for _, slope in found])
        return self.still + self.ratios * (values - self.still), self.ratios[:, None] * slopes

    def start(self, costs: CostModel) -> Array:
        """The widths at hand."""
        return np.clip(self.at, costs.low, costs.high)

    def best(self, costs: CostModel) -> Array:
        """Widths with the least largest quantile: what helps one limit may harm another, as pins take up play.

        Towards those of the linear program of the quantiles' slopes, or the least ones where these are better.
        """
        here = self.start(costs)
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


# --- the search -------------------------------------------------------------------------------------------------------


@dataclass
class _Search:
    """Rounds of linearisation, and verifications, for one set of limits."""

    units: LoadedUnits
    costs: CostModel
    sample: int
    verify: int
    confidence: float
    seed: int
    progress: Callable[[str], None]

    def __post_init__(self) -> None:
        """Draw the sample, and see how many bad units a verification may have."""
        units, verify = self.units, self.verify
        self.level = min(one.level for one in units.limits)
        self.bad, self.most = -1, max(one.level for one in units.limits)
        while share_interval(verify - self.bad - 1, verify, 1 - self._leaves(0))[0] >= self.most:
            self.bad += 1
        if self.bad < 0:
            needed = math.ceil(math.log(self._leaves(0) / 2) / math.log(self.most))
            raise InputError(
                f"verify = {verify}: too few units to verify a yield of {100 * self.most:g} %; give {needed} or more"
            )
        #: Units that may be beyond the limits at the widths aimed at: half of those with which a verification still
        #: succeeds, so that chance seldom makes it fail.
        self.beyond = self.bad // 2
        #: And for each limit, as others may have other bad units.
        self.beyond_each = self.beyond // len(units.limits)
        self.drawn = standard_draws(units.stack, self.sample, seed=self.seed, stream=0)
        turns = units.solved(np.zeros((1, self.drawn.shape[1])), self.costs.given).turns[0]
        self.still = turns / np.array([one.allowed for one in units.limits])
        self.ratios: list[Array] = []
        self._solved: Solved | None = None

    def _leaves(self, attempt: int) -> float:
        """What the confidence of an attempt leaves: half of what that of all before it leaves, so that all hold."""
        return (1 - self.confidence) * 0.5 ** (attempt + 1)

    def allocation(self) -> Allocation:
        """Widths of least cost that fresh units verify."""
        few = self._local(self.costs.given, "the widths as given", _FEW)
        value_before, (slope, _) = few.measure(self.costs.given)
        found = self._begun()
        found, _ = self._settled(found, self._local(found.widths, "the closed form", _FEW), rounds=_ROUNDS)
        found, local = self._settled(found, self._local(found.widths, "all units", len(self.drawn)), rounds=2)
        best: tuple[Found, LoadedQuantile, Verified] | None = None
        for attempt in range(_ATTEMPTS):
            fresh = self._verified(found.widths, attempt)
            if not self._met(fresh) and best is not None:
                break
            if self._met(fresh) and (best is None or self._cost(found) < self._cost(best[0])):
                best = found, local, fresh
            local = self._calibrated(local, found.widths, fresh)
            ahead = self._step(local, found, _REACH, hold=self._any_smooth(found))
            change = self._change(found, ahead)
            if best is not None and (attempt > 1 or change < _SLACK or self._cost(ahead) > self._cost(found)):
                break
            found, local = (ahead, local) if change < 2 * _FARTHEST else self._settled(found, local, rounds=2)
        if best is None:
            raise InputError(
                f"limits: after {_ATTEMPTS} verifications the yield of fresh units is {100 * fresh.together:.4g} %, "
                f"not verified at {100 * self.level:g} %; give {4 * self.verify} units that verify"
            )
        found, local, fresh = best
        closed = [
            closed_form_quantile(
                replace(self.units.stack, width=widths), self.level, self.confidence, _CLOSED_UNITS, seed=self.seed
            )
            for widths in (self.costs.given, found.widths)
        ]
        return described(
            self.units.stack,
            self.costs,
            local,
            found,
            kind="load",
            level=self.level,
            limit=1.0,
            target=local.measure(found.widths)[0],
            rows=[],
            value_before=value_before,
            value=self._used(fresh, round((1 - self.level) * fresh.limits[0].units)),
            closed_form_before=closed[0],
            closed_form=closed[1],
            rates=rates_of(self.costs, slope, step=step_of("load")),
            uniform_cost=self._uniform_cost(found.widths),
            verified=fresh,
        )

    def _begun(self) -> Found:
        """Widths of the closed form by the mean square; those as given where it knows none of the limits."""
        stack, given = self.units.stack, self.costs.given
        grades = tuple(
            min(max(table.index(max(given[e], table.widths[0])), allowed[0]), allowed[-1])
            for e, table, allowed in self.costs.tables
        )
        costs = self.costs.holding(grades)
        widths = np.clip(costs.given, costs.low, costs.high)
        # what does nothing there may do much here
        waves = np.ptp(stack.influence, axis=1) * stack.width[stack.entry]
        idle = np.array([not waves[block.components].any() for block in stack.blocks]) & costs.smooth
        angles = [one.allowed for one in self.units.limits if one.quantity == "transmission_error"]
        if angles and stack.dependence is None and (costs.smooth & ~idle).any():
            low, high = (np.where(idle, widths, end) for end in (costs.low, costs.high))
            closed = Quantile(stack, level=self.level, sample=_CLOSED_SAMPLE, seed=self.seed)
            widths = closed.of_mean_square(replace(costs, low=low, high=high), min(angles), widths)
        return Found(widths, grades)

    def _local(self, widths: Array, what: str, count: int) -> LoadedQuantile:
        """The first units of the sample solved at some widths."""
        tell = counted(lambda text: self.progress(f"{what}: {text}"), "units of the sample", count)
        solved = self.units.solved(self.drawn[:count], widths, slopes=True, near=self._solved, progress=tell)
        self._solved = solved  # the starts of the next one
        local = LoadedQuantile(self.units, solved, widths, 1 - max(self.beyond_each, 0.5) / self.verify, self.still)
        return local.calibrated(np.mean(self.ratios, axis=0)) if self.ratios else local

    def _calibrated(self, local: LoadedQuantile, widths: Array, fresh: Verified) -> LoadedQuantile:
        """The sample with the spread that fresh units have in place of what it predicted at their widths."""
        predicted = local.calibrated(np.ones(len(local.still))).parts(widths)[0] - local.still
        used = np.array([self._used(fresh, self.beyond_each, [number]) for number in range(len(local.still))])
        # where the first angles decided, a peak-to-peak is known too low
        known = (used >= CLEAR) & (predicted > _LEAST_SPREAD * used)
        ratios = np.where(known, (used - local.still) / np.where(known, predicted, 1.0), 1.0)
        self.ratios.append(np.clip(ratios, 0.5, 2.0))
        return local.calibrated(np.mean(self.ratios, axis=0))

    def _settled(self, found: Found, local: LoadedQuantile, *, rounds: int) -> tuple[Found, LoadedQuantile]:
        """Least cost with the quantiles of the sample within the limits, by rounds of linear forms; the last one."""
        count = local.count
        reach, tried = _REACH, dict[tuple[int, ...], float]()
        for number in range(rounds):
            ahead = self._next(local, found, reach, tried)
            predicted = local.measure(ahead.widths)[0]
            near = self._change(found, ahead) <= _SETTLED and predicted <= 1 + CLOSE
            found = ahead
            if near:
                return found, local
            local = self._local(found.widths, f"round {number + 1}", count)
            if abs(local.measure(found.widths)[0] / predicted - 1) > _FARTHEST:  # the form does not hold as far
                reach = max(math.sqrt(reach), _LEAST_REACH)
        return self._step(local, found, reach, hold=bool(self.costs.tables)), local

    def _change(self, one: Found, other: Found) -> float:
        """Relative change of the cost, of which other grades are a whole one."""
        before, after = self._cost(one), self._cost(other)
        return (
            abs(after - before) / max(before, after)
            if one.grades == other.grades and before != after
            else float(one.grades != other.grades)
        )

    def _next(self, local: LoadedQuantile, found: Found, reach: float, tried: dict[tuple[int, ...], float]) -> Found:
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

    def _step(self, local: LoadedQuantile, at: Found, reach: float, *, hold: bool) -> Found:
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
        used = local.at_level(self.level).parts(best)[0]  # what is aimed at has fewer bad units than it may have
        spread = (used - local.still) / np.maximum(1 - local.still, CLOSE)
        stuck = least > local.measure(np.clip(widths, low, high))[0] * (1 - _STUCK)
        if (local.still > 1).any() or (stuck and spread.max() > _HOPELESS):
            raise self._unreachable(local.at_level(self.level), best)
        found = least_cost(near, local, max(1.0, least * (1 + CLOSE)), [])
        if found is None:  # none of the grades that were tried
            return self._step(local, at, reach, hold=True) if not hold else at
        return replace(found, grades=at.grades) if hold else found

    def _uniform_cost(self, widths: Array) -> float | None:
        """Cost of the widths as given, all free ones scaled alike until a sample is as good; None where none is."""
        costs, free = self.costs, ~self.costs.fixed
        finest = np.zeros(widths.size)
        for e, table, _ in costs.tables:
            finest[e] = table.widths[0]
        aim = self._local(widths, "the widths found", _FEW).measure(widths)[0]
        scale = 1.0
        for number in range(_SCALINGS):
            scaled = np.where(free, np.maximum(scale * costs.given, finest), costs.given)
            local = self._local(scaled, f"scaled alike, {number + 1}", _FEW)
            value, (slope, _) = local.measure(scaled)
            ahead = scale + (aim - value) / float(slope @ np.where(free, costs.given, 0.0))
            if abs(ahead / scale - 1) <= _SETTLED:
                return costs.total(scaled)
            scale = float(np.clip(ahead, scale / 2, 2 * scale))
        return None

    def _verified(self, widths: Array, attempt: int) -> Verified:
        count = self.verify  # or more: as many bad units as at first must do
        while share_interval(count - self.bad, count, 1 - self._leaves(attempt))[0] < self.most:
            count = math.ceil(1.05 * count)
        return verified(
            self.units,
            widths,
            count=count,
            seed=self.seed,
            stream=attempt + 1,
            confidence=1 - self._leaves(attempt),
            decide=True,
            progress=lambda text: self.progress(f"verification {attempt + 1}: {text}"),
        )

    def _met(self, fresh: Verified) -> bool:
        return fresh.together_interval[0] >= self.level and all(one.met for one in fresh.limits)

    def _used(self, fresh: Verified, beyond: int, numbers: Sequence[int] = ()) -> float:
        """Share of some limits, of all where left out, that no more than so many fresh units exceed."""
        some = [fresh.limits[number] for number in numbers] or fresh.limits
        shares = [one.limit.turned(one.values) / one.limit.allowed for one in some]
        used = np.sort(np.nan_to_num(np.max(shares, axis=0), nan=_LOST))
        return float(used[-1 - beyond])

    def _any_smooth(self, found: Found) -> bool:
        costs = self.costs.holding(found.grades)
        return bool((costs.smooth & (costs.high > costs.low)).any())

    def _cost(self, found: Found) -> float:
        return self.costs.total(found.widths)

    def _unreachable(self, local: LoadedQuantile, widths: Array) -> InputError:
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
        return InputError(said)


def _within(offered: Sequence[float], allowed: tuple[int, ...], width: float, reach: float) -> tuple[int, ...]:
    """Grades within reach of a width, and the next one to either side."""
    near = [g for g in allowed if width / reach <= offered[g] <= width * reach]
    below = [g for g in allowed if offered[g] < width / reach][-1:]
    above = [g for g in allowed if offered[g] > width * reach][:1]
    return (*below, *near, *above)
