"""Least cost: the widths of a stack's tolerances that keep the output error within a limit.

The cost is a sum over entries; the limit is on the worst-case p-p, on the rms, or on a quantile of the p-p over units.
Page ``theory/allocation.md``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.directions import Direction
from rverror.base.errors import InputError, check_each, renamed
from rverror.base.units import ARCSEC
from rverror.base.viewed import Viewed
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.tolerances.constraints import MeanSquare, Quantile, WorstPeakToPeak
from rverror.tolerances.cost_model import CostModel, cost_model
from rverror.tolerances.declared import Tolerance
from rverror.tolerances.least_cost import CLOSE, ROUNDS, Constraint, Found, Row, least_cost, multipliers_of
from rverror.tolerances.loaded_yield import Verified
from rverror.tolerances.sampling import check_share, virtual_units
from rverror.tolerances.stacking import Stack, laid_out

Kind = Literal["worst", "yield", "rms", "load"]

#: Units on which a yield is optimised, and fresh units that check the result; in closed form both.
SAMPLE, VERIFY = 2**14, 2**16

_NEAR = 5e-4  # relative; of a quantile of fresh units to its limit
_FEWEST_BEYOND = 10  # units beyond a quantile that make it worth computing
_IDLE = 1e-12  # of the largest wave: rounding, where a tolerance only moves the offset
_AT_BOUND = 1e-7  # of a width to its bound, relative
_ATTEMPTS = 12  # to bring a quantile of fresh units close to its limit, once it is met


@dataclass(frozen=True)
class ClosedFormQuantile:
    """Quantile of the p-p in closed form, contacts closed, of units that took no part in finding the widths."""

    level: float  #: which quantile, such as 0.99
    quantile: float  #: rad
    low: float  #: rad; the interval is by order statistics, whatever the distribution
    high: float  #: rad
    confidence: float  #: of the interval
    units: int  #: ``virtual_units(stack, units, seed=seed, draws="random")`` draws them again
    seed: int  #: of these units


@dataclass(frozen=True)
class Rate:
    """Exchange of cost against what is limited at the widths as given, for one entry, per `Allocation.step`.

    Both are None where an entry is fixed, or the width as given finer than all its grades.
    """

    label: str
    #: Cost saved per step given up by a wider tolerance; infinite where the width does not matter.  None where no
    #: wider one may be had.
    relax: float | None
    #: Cost of a step gained by a finer tolerance.  None where no finer one may be had, or gains nothing.
    tighten: float | None


@dataclass(frozen=True)
class Allocation(Viewed):
    """Widths of least cost.

    Attributes
    ----------
    labels : tuple of str
        Name of each entry, as in the stack.
    kind : str
        ``"worst"``, ``"yield"`` or ``"rms"``, as in `allocate`; ``"load"`` of `allocate_at_load`.
    limit : float
        rad; 1 for ``"load"``, of which the share of its limits that a unit uses is limited.
    level : float
        The quantile, of the limit where the kind is ``"yield"`` and of the verification.
    widths_before, widths : tuple of float
        Core units.
    grades : tuple of str or None
        Grade of each entry whose cost is a table.
    fixed : tuple of bool
    costs_before : tuple of float
        Of each entry; not a number where the width as given is finer than all its grades.
    costs : tuple of float
        Of each entry.
    value_before, value : float
        What is limited, rad; for ``"load"`` a share.  For ``"yield"`` the upper end of the interval of the quantile: it
        is this that meets the limit.
    closed_form_before, closed_form : ClosedFormQuantile
        Of the widths as given and of those found.
    shadow_price : float or None
        Cost saved per `step` by which the limit is raised, grades held.  None where only grades are free.
    bound_prices : tuple of float
        Cost saved per core unit by which a bound that holds is pushed out, 0 where none holds; positive also for a
        lower bound.
    rates : tuple of Rate
        Of each entry.
    gap : float or None
        How much cheaper, relatively, any other widths could be at the most; None where that is not proven.
    proof : str
        What is proven, one sentence.
    keys, dimensions : tuple of str
        Catalogue key of each entry, and dimension of its width; empty for a stack that does not tell its components.
    speed : float, optional
        Of the input, rad/s, as in the stack.
    held_by : tuple of str
        What keeps each entry at its width: ``"limit"`` of the error, ``"upper bound"``, ``"lower bound"``,
        ``"grade"`` of a table, ``"fixed"``.
    model : str
        Name of the unit, as in the stack.
    uniform_cost : float, optional
        Of ``"load"``: cost of the widths as given, all free ones scaled alike until a sample of units is as good; None
        where no scale makes it so.
    verified : Verified, optional
        Fresh units at the loads of all limits; of ``"load"`` alone, for a closed form verifies nothing.
    """

    labels: tuple[str, ...]
    kind: Kind
    limit: float
    level: float
    widths_before: tuple[float, ...]
    widths: tuple[float, ...]
    grades: tuple[str | None, ...]
    fixed: tuple[bool, ...]
    costs_before: tuple[float, ...]
    costs: tuple[float, ...]
    value_before: float
    value: float
    closed_form_before: ClosedFormQuantile
    closed_form: ClosedFormQuantile
    shadow_price: float | None
    bound_prices: tuple[float, ...]
    rates: tuple[Rate, ...]
    gap: float | None
    proof: str
    keys: tuple[str, ...] = ()
    dimensions: tuple[str, ...] = ()
    speed: float | None = None
    held_by: tuple[str, ...] = ()
    model: str = ""
    uniform_cost: float | None = None
    verified: Verified | None = None

    @property
    def step(self) -> float:
        """Of what is limited, by which prices and rates count: an arcsec, or a per cent of all limits."""
        return step_of(self.kind)

    @property
    def cost_before(self) -> float:
        """Cost of all entries at the widths as given; not a number where that of one is not known."""
        return math.fsum(self.costs_before)

    @property
    def cost(self) -> float:
        """Cost of all entries."""
        return math.fsum(self.costs)

    @property
    def tighten_first(self) -> tuple[Rate, ...]:
        """Entries that may be tightened, the cheapest arcsec first."""
        return tuple(sorted((r for r in self.rates if r.tighten is not None), key=lambda r: r.tighten or 0.0))

    @property
    def relax_first(self) -> tuple[Rate, ...]:
        """Entries that may be relaxed, the largest saving per arcsec first."""
        return tuple(sorted((r for r in self.rates if r.relax is not None), key=lambda r: -(r.relax or 0.0)))


def step_of(kind: Kind) -> float:
    """`Allocation.step` of a kind."""
    return 0.01 if kind == "load" else ARCSEC


@dataclass(frozen=True)
class FrontPoint:
    """Least cost for one limit.

    Attributes
    ----------
    limit : float
        rad.
    allocation : Allocation or None
        None where the limit cannot be met.
    reason : str
        Why it cannot be met, else empty.
    """

    limit: float
    allocation: Allocation | None
    reason: str = ""


@renamed(speed="input_speed")
def allocate(
    model: Model | Stack,
    tolerances: Sequence[Tolerance] | None = None,
    theta: Any | None = None,
    *,
    direction: Direction = "forward",
    torque: Any | None = None,
    input_speed: Any | None = None,
    limit: Any,
    kind: Kind = "yield",
    level: float = 0.99,
    sample: int = SAMPLE,
    verify: int = VERIFY,
    confidence: float = 0.95,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Callable[[str], None] | None = None,
) -> Allocation:
    """Find the widths of least cost that keep the output error within a limit.

    Parameters
    ----------
    model : Model or Stack
        A stack, of `rverror.tolerances.stack`, stands for model, tolerances and how they are asked.
    tolerances : sequence of Tolerance
        With their costs, bounds and what is fixed.
    theta, direction, torque, input_speed
        As for `rverror.tolerances.stack`.
    limit : float, str or quantity
        Of the p-p or rms, rad or with a unit.
    kind : str
        What is limited: ``"worst"`` the p-p of the worst parts within their tolerances, ``"yield"`` the quantile
        `level` of the p-p over units, ``"rms"`` the root of the mean square over angles and units.
    level : float
        The quantile, above 0 and below 1; 0.99 for a yield of 99 %.
    sample, verify : int
        Units on which a yield is optimised and, drawn afresh, checked: in closed form, contacts closed, both.
    confidence : float
        Of the interval of the quantile in closed form.
    seed : int
        Fixes all draws.
    executor : concurrent.futures.Executor, optional
        Where the units that check are drawn, as for `virtual_units`.
    progress : callable, optional
        Called with a line of text as the work goes on.

    Returns
    -------
    Allocation
        For ``"yield"`` the upper end of the quantile's interval is not above the limit.

    Raises
    ------
    InputError
        If an argument is out of its bounds, or the limit cannot be met.

    Examples
    --------
    Two sources whose p-p are 2 and 1 rad per mm at equal prices: the stronger gets the finer tolerance.

    >>> from rverror.tolerances.cost import Choice, Reciprocal
    >>> from rverror.tolerances.distribution import Uniform
    >>> from rverror.tolerances.blocks import Block
    >>> waves = np.array([[1.0, -1.0], [0.5, -0.5]])
    >>> blocks = tuple(Block(e, e, 1, 1, Uniform()) for e in range(2))
    >>> choices = (Choice(Reciprocal(1.0, 1.0)),) * 2
    >>> stack = Stack(np.zeros(2), waves, (), np.arange(2), np.ones(2), ("a", "b"), blocks, choices=choices)
    >>> found = allocate(stack, limit=2.0, kind="worst", verify=1000)
    >>> [round(width, 6) for width in found.widths]  # as 1 : sqrt(2), 2 a + b = 2
    [0.585786, 0.828427]

    Of a model and tolerances that have their costs:

    >>> import rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> cams = [rverror.tolerance("crank.eccentricity", "5 um", cost=Reciprocal(12.0, 0.005))]
    >>> allocate(unit, cams, limit="40 arcsec", kind="worst", verify=1000).kind
    'worst'
    """
    laid = laid_out(model, tolerances, theta, direction=direction, torque=torque, input_speed=input_speed)
    if (
        torque is not None
        and input_speed is None
        and not any("torque" in source(part.key).needs for part in laid.components)
    ):
        raise InputError("torque: the closed form knows no load; leave it out, or use allocate_at_load")
    task = _Task(laid, kind, level, sample, verify, confidence, seed, executor, progress or (lambda text: None))
    return task.solved(_angle(limit))


def cost_front(
    model: Model | Stack,
    tolerances: Sequence[Tolerance] | None = None,
    theta: Any | None = None,
    *,
    direction: float = 1.0,
    torque: Any | None = None,
    input_speed: Any | None = None,
    limits: Sequence[Any],
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> tuple[FrontPoint, ...]:
    """Least cost for each of a row of limits.

    Parameters
    ----------
    model, tolerances, theta, direction, torque, input_speed
        As for `allocate`.
    limits : sequence of float, str or quantity
    progress : callable, optional
        Called with a line of text as the work goes on.
    **options
        Everything else that `allocate` takes.

    Returns
    -------
    tuple of FrontPoint
        In the order of the limits; the same draws for all.

    Raises
    ------
    InputError
        If an argument is out of its bounds; a limit that cannot be met is no error here.

    Examples
    --------
    >>> from rverror.tolerances.cost import Choice, Reciprocal
    >>> from rverror.tolerances.distribution import Uniform
    >>> from rverror.tolerances.blocks import Block
    >>> block, wave = Block(0, 0, 1, 1, Uniform()), np.array([[1.0, -1.0]])
    >>> costs = (Choice(Reciprocal(1.0, 1.0)),)
    >>> one = Stack(np.zeros(2), wave, (), np.zeros(1, int), np.ones(1), ("a",), (block,), choices=costs)
    >>> front = cost_front(one, limits=[2.0, 1.0], kind="worst", verify=1000)
    >>> [round(point.allocation.cost, 6) for point in front]  # half the limit, twice the price
    [1.0, 2.0]
    """
    check_each("limits", limits, object, "give a list of limits, such as ['40 arcsec', '60 arcsec']")
    laid = laid_out(model, tolerances, theta, direction=direction, torque=torque, input_speed=input_speed)
    task = _Task(laid, progress=progress or (lambda text: None), **options)
    points = []
    for limit in map(_angle, limits):
        try:
            points.append(FrontPoint(limit, task.solved(limit)))
        except _UnreachableError as error:
            points.append(FrontPoint(limit, None, str(error)))
    return tuple(points)


class _UnreachableError(InputError):
    """The limit cannot be met."""


def _angle(limit: Any) -> float:
    value = units.named_core("limit", limit, "angle")
    if value <= 0:
        raise InputError(f"limit = {limit!r}: must be above 0; give an angle such as '60 arcsec'")
    return value


# --- one task, any limit -----------------------------------------------------------------------------------------


#: What each kind limits, and its name for people.
_KINDS: dict[str, tuple[Callable[[_Task], Constraint], str]] = {
    "worst": (lambda task: WorstPeakToPeak(task.stack), "worst-case p-p"),
    "yield": (
        lambda task: Quantile(task.stack, level=task.level, sample=task.sample, seed=task.seed),
        "p-p at {:g} % yield (closed form)",
    ),
    "rms": (lambda task: MeanSquare(task.stack), "rms"),
}


@dataclass(frozen=True)
class _Task:
    """All but the limit."""

    stack: Stack
    kind: Kind = "yield"
    level: float = 0.99
    sample: int = SAMPLE
    verify: int = VERIFY
    confidence: float = 0.95
    seed: int = 0
    executor: Executor | None = None
    progress: Callable[[str], None] = print

    def __post_init__(self) -> None:
        """Check the settings."""
        if self.kind not in _KINDS:
            raise InputError(f"kind = {self.kind!r}: must be one of {', '.join(map(repr, _KINDS))}")
        if self.kind == "rms" and self.stack.dependence is not None:
            raise InputError("kind = 'rms': not with correlation between tolerances; use kind = 'yield' or 'worst'")
        for name, share in (("level", self.level), ("confidence", self.confidence)):
            check_share(name, share, 0.99)
        fewest = math.ceil(_FEWEST_BEYOND / min(self.level, 1 - self.level))
        ending = math.ceil(math.log((1 - self.confidence) / 2) / math.log(self.level))  # for an interval that ends
        for name, number, least in (("sample", self.sample, fewest), ("verify", self.verify, max(fewest, ending))):
            if number < least:
                raise InputError(f"{name} = {number}: too few units for the level {self.level:g}; give {least} or more")

    @cached_property
    def costs(self) -> CostModel:
        """What may be bought; of what makes no wave the widest alone."""
        stack = self.stack
        waves = np.ptp(stack.influence, axis=1) * stack.width[stack.entry]
        size = np.array([waves[block.components].max(initial=0.0) for block in stack.blocks])
        return cost_model(stack.labels, stack.width, stack.choices).relaxed(size <= _IDLE * size.max())

    @cached_property
    def constraint(self) -> Constraint:
        """What is limited."""
        return _KINDS[self.kind][0](self)

    def checked(self, widths: Array) -> ClosedFormQuantile:
        """Quantile of the p-p of fresh units, the same ones at every call."""
        return closed_form_quantile(
            replace(self.stack, width=widths),
            self.level,
            self.confidence,
            self.verify,
            seed=self.seed + 1,  # the sample has the seed itself
            executor=self.executor,
            progress=lambda text: self.progress(f"checking by {text}"),
        )

    def counted(self, widths: Array, checked: ClosedFormQuantile | None = None) -> float:
        """What is compared with the limit, rad."""
        if self.kind != "yield":
            return self.constraint.measure(widths)[0]
        return (checked or self.checked(widths)).high

    @cached_property
    def checked_before(self) -> ClosedFormQuantile:
        """With the widths as given."""
        return self.checked(self.costs.given)

    @cached_property
    def least_value(self) -> float:
        """What is limited, with all widths at their least."""
        return self.counted(self.costs.low)

    @cached_property
    def rates(self) -> tuple[Rate, ...]:
        """Exchange of cost against what is limited at the widths as given."""
        return rates_of(self.costs, self.constraint.measure(self.costs.given)[1][0], step=step_of(self.kind))

    def unreachable(self, limit: float) -> _UnreachableError:
        """Why the limit cannot be met, and what can be done."""
        low = self.costs.low
        label = self.costs.labels[int((low * self.constraint.measure(low)[1][0]).argmax())]
        return _UnreachableError(
            f"limit {limit / ARCSEC:.4g} arcsec: with every width at its least the "
            f"{_KINDS[self.kind][1].format(100 * self.level)} is {self.least_value / ARCSEC:.4g} arcsec; raise the "
            f"limit or allow finer widths, first of {label}"
        )

    def solved(self, limit: float) -> Allocation:
        """Least cost for one limit."""
        rows: list[Row] = []
        if self.least_value > limit:
            raise self.unreachable(limit)
        if self.kind == "yield":
            found, target, checked = self._verified(limit, rows)
            value, row = self.constraint.measure(found.widths)  # what the check brought the sample to
            target, rows = min(target, value), [row]
        else:
            exact = least_cost(self.costs, self.constraint, limit, rows)
            if exact is None:
                raise self.unreachable(limit)
            found, target, checked = exact, limit, self.checked(exact.widths)
        return described(
            self.stack,
            self.costs,
            self.constraint,
            found,
            kind=self.kind,
            level=self.level,
            limit=limit,
            target=target,
            rows=rows,
            value_before=self.counted(self.costs.given, self.checked_before),
            value=self.counted(found.widths, checked),
            closed_form_before=self.checked_before,
            closed_form=checked,
            rates=self.rates,
        )

    def _verified(self, limit: float, rows: list[Row]) -> tuple[Found, float, ClosedFormQuantile]:
        """Least cost whose quantile of fresh units meets the limit, the target that led there, and the check."""
        costs, target = self.costs, limit
        best: tuple[Found, float, ClosedFormQuantile] | None = None
        for attempt in range(ROUNDS):
            self.progress(f"least cost within {limit / ARCSEC:g} arcsec, solution {attempt + 1}")
            found = least_cost(costs, self.constraint, target, rows)
            if found is None:
                break
            held = costs.holding(found.grades)
            checked = self.checked(found.widths)
            high = checked.high
            if limit < high <= limit * (1 + _NEAR) and held.smooth.any():  # a hair above needs no new solution
                found, checked = self._shrunk(held, found, limit, checked)
            if checked.high <= limit and (best is None or costs.total(found.widths) < costs.total(best[0].widths)):
                best = found, target, checked
            room = bool((held.smooth & (found.widths < held.high)).any())
            met = limit * (1 - _NEAR if room else 0) <= checked.high <= limit
            if best is not None and (met or attempt >= _ATTEMPTS):
                break
            target *= limit / high * (1 - CLOSE)
            if not room:  # the next combination of grades, not this one again
                target = min(target, self.constraint.measure(found.widths)[0] * (1 - 2 * CLOSE))
            costs = replace(costs, given=np.where(costs.smooth, found.widths, costs.given))
        if best is None:
            raise self.unreachable(limit)
        return best

    def _shrunk(
        self, costs: CostModel, found: Found, limit: float, checked: ClosedFormQuantile
    ) -> tuple[Found, ClosedFormQuantile]:
        """Smooth widths made smaller until the quantile of fresh units meets the limit, further at each step."""
        for step in range(10):
            factor = (limit / checked.high * (1 - CLOSE)) ** (2**step)
            widths = np.where(costs.smooth, np.clip(found.widths * factor, costs.low, costs.high), found.widths)
            found, checked = replace(found, widths=widths), self.checked(widths)
            if checked.high <= limit:
                break
        return found, checked


def closed_form_quantile(
    stack: Stack, level: float, confidence: float, count: int, *, seed: int, **how: Any
) -> ClosedFormQuantile:
    """Quantile of the p-p of units drawn plainly; `how` goes to `virtual_units`."""
    drawn = virtual_units(stack, count=count, seed=seed, draws="random", **how)
    found = drawn.quantile(level, confidence=confidence)
    return ClosedFormQuantile(level, found.value, found.low, found.high, confidence, count, seed)


# --- the result for people -----------------------------------------------------------------------------------------


def described(
    stack: Stack,
    costs: CostModel,
    constraint: Constraint,
    found: Found,
    *,
    kind: Kind,
    level: float,
    limit: float,
    target: float,
    rows: list[Row],
    **told: Any,
) -> Allocation:
    """An allocation with its prices and what is proven of it.

    Parameters
    ----------
    stack : Stack
    costs : CostModel
    constraint : Constraint
    found : Found
    kind, level, limit
        As in `Allocation`.
    target : float
        What the constraint was brought to, where that is not the limit.
    rows : list of Row
        That may bind.
    **told
        The other fields of `Allocation` that do not follow from these.

    Returns
    -------
    Allocation
    """
    widths = found.widths
    held = costs.holding(found.grades)
    grades: list[str | None] = [None] * widths.size
    for (entry, table, _), grade in zip(costs.tables, found.grades, strict=True):
        grades[entry] = table.names[grade]
    multipliers = multipliers_of(held, target, [*rows, constraint.measure(widths)[1]], widths)
    price = multipliers.total * target / limit  # the target of the sample goes with the limit
    cost = costs.total(widths)
    lower = max(found.lower, -math.inf if costs.tables else multipliers.lower)
    exact = kind in ("worst", "rms")
    first = [stack.components[block.components.start] for block in stack.blocks] if stack.components else []
    return Allocation(
        labels=costs.labels,
        keys=tuple(component.key for component in first),
        dimensions=tuple(component.dimension for component in first),
        speed=stack.speed,
        held_by=_held_by(costs, widths),
        model=stack.model,
        kind=kind,
        limit=limit,
        level=level,
        widths_before=_floats(costs.given),
        widths=_floats(widths),
        grades=tuple(grades),
        fixed=tuple(map(bool, costs.fixed)),
        costs_before=_floats(costs.before),
        costs=_floats(costs.each(widths)),
        shadow_price=price * step_of(kind) if held.smooth.any() else None,
        bound_prices=_floats(np.abs(multipliers.bounds)),
        gap=(max(0.0, (cost - lower) / cost) if cost else 0.0) if exact else None,
        proof=found.proof,
        **told,
    )


def _held_by(costs: CostModel, widths: Array) -> tuple[str, ...]:
    """What keeps each entry where it is."""
    said = np.full(len(costs.labels), "limit", dtype=object)
    said[costs.smooth & (widths <= costs.low * (1 + _AT_BOUND))] = "lower bound"
    said[costs.smooth & (widths >= costs.high * (1 - _AT_BOUND))] = "upper bound"
    said[[e for e, _, _ in costs.tables]] = "grade"
    said[costs.fixed] = "fixed"
    return tuple(map(str, said))


def _floats(values: Array) -> tuple[float, ...]:
    return tuple(map(float, values))


def rates_of(costs: CostModel, slope: Array, *, step: float) -> tuple[Rate, ...]:
    """Of each entry, from the derivative of what is limited by the widths as given; per step of it."""
    slopes = costs.slopes(costs.given)
    rates = [Rate(label, None, None) for label in costs.labels]
    for e in map(int, np.flatnonzero(costs.smooth)):
        rate = _rate(-float(slopes[e]), float(slope[e]), step)
        relax = rate if costs.given[e] < costs.high[e] else None
        rates[e] = Rate(costs.labels[e], relax, rate if costs.given[e] > costs.low[e] else None)
    for e, table, allowed in costs.tables:
        if not table.holds(float(costs.given[e])):
            continue
        here = table.index(float(costs.given[e]))
        wider, finer = ([g for g in allowed if g > here], [g for g in allowed if g < here])
        steps = []
        for others in (wider[:1], finer[-1:]):
            gain = [(table.prices[here] - table.prices[g], table.widths[g] - table.widths[here]) for g in others]
            steps.append(_rate(gain[0][0] / gain[0][1], float(slope[e]), step) if gain else None)
        rates[e] = Rate(costs.labels[e], *steps)
    return tuple(rates)


def _rate(saved: float, given_up: float, step: float) -> float:
    """Cost per step from cost and what is limited per width; without bound where the width does not matter."""
    return saved / given_up * step if given_up > 0 else math.inf
