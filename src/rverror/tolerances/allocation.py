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
from typing import Any, Literal, cast, get_args

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError, check_each, check_kind
from rverror.base.units import ARCSEC
from rverror.base.viewed import Viewed
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.tolerances.cost import Cost, Grades
from rverror.tolerances.limited_error import MeanSquare, Quantile, WorstPeakToPeak
from rverror.tolerances.loaded_yield import Verified
from rverror.tolerances.market import (
    CLOSE,
    ROUNDS,
    Found,
    Limited,
    Market,
    Row,
    least_cost,
    market_of,
    multipliers_of,
    slope_of,
)
from rverror.tolerances.sampling import check_share, virtual_units
from rverror.tolerances.stacking import Stack, Tolerance, check_tolerances, laid_out

Kind = Literal["worst", "yield", "rms", "load"]

#: Units on which a yield is optimised, and fresh units that check the result; in closed form both.
SAMPLE, VERIFY = 2**14, 2**16

_KINDS = ("worst", "yield", "rms")
_NEAR = 5e-4  # relative; of a quantile of fresh units to its limit
_FEWEST_BEYOND = 10  # units beyond a quantile that make it worth computing
_IDLE = 1e-12  # of the largest wave: rounding, where a tolerance only moves the offset
_AT_BOUND = 1e-7  # of a width to its bound, relative
_ATTEMPTS = 12  # to bring a quantile of fresh units close to its limit, once it is met


_COSTS = "give a cost for each entry, as of terms(tolerances)['costs']"


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


def allocate(
    model: Model | Stack | None = None,
    tolerances: Sequence[Tolerance] | Sequence[Cost | None] | None = None,
    theta: Any | None = None,
    *,
    direction: float = 1.0,
    torque: Any | None = None,
    speed: Any | None = None,
    limit: Any,
    stack: Stack | None = None,
    costs: Sequence[Cost | None] | None = None,
    kind: Kind = "yield",
    level: float = 0.99,
    bounds: Sequence[tuple[float, float] | None] | None = None,
    fixed: Sequence[bool] | None = None,
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
    model : Model
        Or its `stack`; the costs may then stand second.
    tolerances : sequence of Tolerance
        Costs, bounds and what is fixed are theirs where nothing else is given.
    theta, direction, torque, speed
        As for `rverror.stack`.
    limit : float, str or quantity
        Of the p-p or rms, rad or with a unit.
    stack : Stack, optional
        In place of model, tolerances and all that was said above.
    costs : sequence of Reciprocal, ReciprocalSquare, Grades or None, optional
        Cost of each entry; None, no cost, for fixed entries only.  Needed beside a stack.
    kind : str
        What is limited: ``"worst"`` the p-p of the worst parts within their tolerances, ``"yield"`` the quantile
        `level` of the p-p over units, ``"rms"`` the root of the mean square over angles and units.
    level : float
        The quantile, above 0 and below 1; 0.99 for a yield of 99 %.
    bounds : sequence of (float, float) or None, optional
        Least and largest width of each entry, core units.  Where None: a tenth to ten times the width as given for
        smooth costs, all its grades for a table.
    fixed : sequence of bool, optional
        Entries that keep their width.
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

    >>> from rverror.tolerances.cost import Reciprocal
    >>> from rverror.tolerances.distribution import Uniform
    >>> from rverror.tolerances.stacking import Block
    >>> waves = np.array([[1.0, -1.0], [0.5, -0.5]])
    >>> blocks = tuple(Block(e, e, 1, 1, Uniform()) for e in range(2))
    >>> stack = Stack(np.zeros(2), waves, (), np.arange(2), np.ones(2), ("a", "b"), blocks)
    >>> found = allocate(stack, [Reciprocal(1.0, 1.0)] * 2, limit=2.0, kind="worst", verify=1000)
    >>> [round(width, 6) for width in found.widths]  # as 1 : sqrt(2), 2 a + b = 2
    [0.585786, 0.828427]

    Of a model and tolerances that have their costs:

    >>> import rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> cams = [rverror.tolerance("crank.eccentricity", "5 um", cost=Reciprocal(12.0, 0.005))]
    >>> allocate(unit, cams, limit="40 arcsec", kind="worst", verify=1000).kind
    'worst'
    """
    said: dict[str, Any] = {"costs": costs, "bounds": bounds, "fixed": fixed}
    if stack is None and not isinstance(model, Stack):
        laid = laid_out(model, tolerances, theta, None, direction=direction, torque=torque, speed=speed)
        items = cast("Sequence[Tolerance]", tolerances)
        if torque is not None and speed is None and not any("torque" in source(item.key).needs for item in items):
            raise InputError("torque: the closed form knows no load; leave it out, or use allocate_at_load")
        said = {name: own if said[name] is None else said[name] for name, own in terms(items).items()}
    else:
        laid = laid_out(model, None, theta, stack, direction=direction, torque=torque, speed=speed)
        said["costs"] = tolerances if costs is None else costs
        check_each("costs", said["costs"], (*get_args(Cost), type(None)), _COSTS)
    task = _task(
        laid,
        **said,
        kind=kind,
        level=level,
        sample=sample,
        verify=verify,
        confidence=confidence,
        seed=seed,
        executor=executor,
        progress=progress,
    )
    return _solve(task, _angle(limit))


def terms(tolerances: Sequence[Tolerance]) -> dict[str, Any]:
    """Costs, bounds and what is fixed, of tolerances, as `allocate` and `cost_front` take them.

    Parameters
    ----------
    tolerances : sequence of Tolerance
        Those of the stack, in its order.

    Returns
    -------
    dict
        ``costs``, ``bounds`` and ``fixed``.

    Examples
    --------
    >>> from rverror.tolerances.cost import Reciprocal
    >>> from rverror.tolerances.stacking import tolerance
    >>> terms([tolerance("crank.eccentricity", 0.005, cost=Reciprocal(12.0, 0.005))])["bounds"]
    [(0.0005, 0.03)]
    """
    check_tolerances(tolerances)
    return {
        "costs": [item.cost for item in tolerances],
        "bounds": [_span(item) for item in tolerances],
        "fixed": [item.fixed for item in tolerances],
    }


def _span(item: Tolerance) -> tuple[float, float]:
    """Bounds of a tolerance; grades that are not bounded may all be bought, but for clearances that would vanish."""
    low, high = item.span
    if item.bounds is not None or not isinstance(item.cost, Grades):
        return low, high
    room = high if high < 10 * item.width else math.inf
    return item.cost.widths[0], min(max(item.cost.widths), room)


def cost_front(
    stack: Stack, costs: Sequence[Cost | None], limits: Sequence[Any], **options: Any
) -> tuple[FrontPoint, ...]:
    """Least cost for each of a row of limits.

    Parameters
    ----------
    stack, costs
        As for `allocate`.
    limits : sequence of float, str or quantity
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
    >>> from rverror.tolerances.cost import Reciprocal
    >>> from rverror.tolerances.distribution import Uniform
    >>> from rverror.tolerances.stacking import Block
    >>> block, wave = Block(0, 0, 1, 1, Uniform()), np.array([[1.0, -1.0]])
    >>> one = Stack(np.zeros(2), wave, (), np.zeros(1, int), np.ones(1), ("a",), (block,))
    >>> front = cost_front(one, [Reciprocal(1.0, 1.0)], [2.0, 1.0], kind="worst", verify=1000)
    >>> [round(point.allocation.cost, 6) for point in front]  # half the limit, twice the price
    [1.0, 2.0]
    """
    check_kind("stack", stack, Stack, "make it with stack(model, tolerances)")
    check_each("costs", costs, (*get_args(Cost), type(None)), _COSTS)
    check_each("limits", limits, object, "give a list of limits, such as ['40 arcsec', '60 arcsec']")
    task = _task(stack, costs, **options)
    points = []
    for limit in map(_angle, limits):
        try:
            points.append(FrontPoint(limit, _solve(task, limit)))
        except _UnreachableError as error:
            points.append(FrontPoint(limit, None, str(error)))
    return tuple(points)


class _UnreachableError(InputError):
    """The limit cannot be met."""


# --- one task, any limit -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Task:
    """All but the limit."""

    stack: Stack
    market: Market
    limited: Limited
    kind: Kind
    level: float
    verify: int
    confidence: float
    seed: int
    executor: Executor | None
    progress: Callable[[str], None]

    def checked(self, widths: Array) -> ClosedFormQuantile:
        """Quantile of the p-p of fresh units, the same ones at every call."""
        stack = replace(self.stack, width=widths)
        seed = self.seed + 1  # the sample has the seed itself
        drawn = virtual_units(
            stack,
            self.verify,
            seed=seed,
            draws="random",
            executor=self.executor,
            progress=lambda text: self.progress(f"checking by {text}"),
        )
        found = drawn.quantile(self.level, confidence=self.confidence)
        return ClosedFormQuantile(self.level, found.value, found.low, found.high, self.confidence, self.verify, seed)

    def counted(self, widths: Array, checked: ClosedFormQuantile) -> float:
        """What is compared with the limit, rad."""
        return checked.high if self.kind == "yield" else self.limited.measure(widths)[0]

    @cached_property
    def checked_before(self) -> ClosedFormQuantile:
        """With the widths as given."""
        return self.checked(self.market.given)

    @cached_property
    def value_before(self) -> float:
        """What is limited, with the widths as given."""
        return self.counted(self.market.given, self.checked_before)

    @cached_property
    def least_value(self) -> float:
        """What is limited, with all widths at their least."""
        low = self.market.low
        return self.checked(low).high if self.kind == "yield" else self.limited.measure(low)[0]

    @cached_property
    def rates(self) -> tuple[Rate, ...]:
        """Exchange of cost against the limited error at the widths as given."""
        return rates_of(self.market, slope_of(self.limited, self.market.given), step=step_of(self.kind))

    def unreachable(self, limit: float) -> _UnreachableError:
        """Why the limit cannot be met, and what can be done."""
        market = self.market
        part = market.low * slope_of(self.limited, market.low)
        label = market.labels[int(part.argmax())]
        name = {"worst": "worst-case p-p", "rms": "rms", "yield": f"p-p at {100 * self.level:g} % yield (closed form)"}
        return _UnreachableError(
            f"limit {limit / ARCSEC:.4g} arcsec: with every width at its least the {name[self.kind]} is "
            f"{self.least_value / ARCSEC:.4g} arcsec; raise the limit or allow finer widths, first of {label}"
        )


def _angle(limit: Any) -> float:
    try:
        value = units.to_core(limit, "angle")
    except ValueError as error:
        raise InputError(f"limit: {error}") from error
    if value <= 0:
        raise InputError(f"limit = {limit!r}: must be above 0; give an angle such as '60 arcsec'")
    return value


def _task(
    stack: Stack,
    costs: Sequence[Cost | None],
    *,
    kind: Kind = "yield",
    level: float = 0.99,
    bounds: Sequence[tuple[float, float] | None] | None = None,
    fixed: Sequence[bool] | None = None,
    sample: int = SAMPLE,
    verify: int = VERIFY,
    confidence: float = 0.95,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Callable[[str], None] | None = None,
) -> _Task:
    if kind not in _KINDS:
        raise InputError(f"kind = {kind!r}: must be one of {', '.join(map(repr, _KINDS))}")
    if kind == "rms" and stack.dependence is not None:
        raise InputError("kind = 'rms': not with correlation between tolerances; use kind = 'yield' or 'worst'")
    for name, share in (("level", level), ("confidence", confidence)):
        check_share(name, share, 0.99)
    fewest = math.ceil(_FEWEST_BEYOND / min(level, 1 - level))
    ending = math.ceil(math.log((1 - confidence) / 2) / math.log(level))  # units for an interval that ends
    for name, number, least in (("sample", sample, fewest), ("verify", verify, max(fewest, ending))):
        if number < least:
            raise InputError(f"{name} = {number}: too few units for the level {level:g}; give {least} or more")
    waves = np.ptp(stack.influence, axis=1) * stack.width[stack.entry]
    size = np.array([waves[block.components].max(initial=0.0) for block in stack.blocks])
    market = market_of(stack.labels, stack.width, costs, bounds, fixed).relaxed(size <= _IDLE * size.max())
    limited: Limited = MeanSquare(stack)
    if kind == "yield":
        limited = Quantile(stack, level=level, sample=sample, seed=seed)
    if kind == "worst":
        limited = WorstPeakToPeak(stack)
    tell = progress or (lambda text: None)
    return _Task(stack, market, limited, kind, level, verify, confidence, seed, executor, tell)


def _solve(task: _Task, limit: float) -> Allocation:
    """Least cost for one limit."""
    if task.least_value > limit:
        raise task.unreachable(limit)
    rows: list[Row] = []
    if task.kind == "yield":
        found, target, checked = _checked(task, limit, rows)
    else:
        exact = least_cost(task.market, task.limited, limit, rows)
        if exact is None:
            raise task.unreachable(limit)
        found, target, checked = exact, limit, task.checked(exact.widths)
    return _described(task, limit, target, found, rows, checked)


def _checked(task: _Task, limit: float, rows: list[Row]) -> tuple[Found, float, ClosedFormQuantile]:
    """Least cost whose quantile of fresh units meets the limit, the target that led there, and the check."""
    market, target = task.market, limit
    best: tuple[Found, float, ClosedFormQuantile] | None = None
    for attempt in range(ROUNDS):
        task.progress(f"least cost within {limit / ARCSEC:g} arcsec, solution {attempt + 1}")
        found = least_cost(market, task.limited, target, rows)
        if found is None:
            break
        held = market.holding(found.grades)
        checked = task.checked(found.widths)
        high = checked.high
        if limit < high <= limit * (1 + _NEAR) and held.smooth.any():  # a hair above needs no new solution
            found, checked = _shrunk(task, held, found, limit, checked)
        if checked.high <= limit and (best is None or market.total(found.widths) < market.total(best[0].widths)):
            best = found, target, checked
        room = bool((held.smooth & (found.widths < held.high)).any())
        met = limit * (1 - _NEAR if room else 0) <= checked.high <= limit
        if best is not None and (met or attempt >= _ATTEMPTS):
            break
        target *= limit / high * (1 - CLOSE)
        if not room:  # the next combination of grades, not this one again
            target = min(target, task.limited.measure(found.widths)[0] * (1 - 2 * CLOSE))
        market = replace(market, given=np.where(market.smooth, found.widths, market.given))
    if best is not None:
        return best
    raise task.unreachable(limit)


def _shrunk(
    task: _Task, market: Market, found: Found, limit: float, checked: ClosedFormQuantile
) -> tuple[Found, ClosedFormQuantile]:
    """Smooth widths made smaller until the quantile of fresh units meets the limit, further at each step."""
    for step in range(10):
        factor = (limit / checked.high * (1 - CLOSE)) ** (2**step)
        widths = np.where(market.smooth, np.clip(found.widths * factor, market.low, market.high), found.widths)
        found = replace(found, widths=widths)
        checked = task.checked(widths)
        if checked.high <= limit:
            break
    return found, checked


def _described(
    task: _Task, limit: float, target: float, found: Found, rows: list[Row], checked: ClosedFormQuantile
) -> Allocation:
    """The result for people."""
    if task.kind == "yield":  # what the check brought the sample to
        value, row = task.limited.measure(found.widths)
        target, rows = min(target, value), [row]
    return described(
        task.stack,
        task.market,
        task.limited,
        found,
        kind=task.kind,
        level=task.level,
        limit=limit,
        target=target,
        rows=rows,
        value_before=task.value_before,
        value=task.counted(found.widths, checked),
        closed_form_before=task.checked_before,
        closed_form=checked,
        rates=task.rates,
    )


def described(
    stack: Stack,
    market: Market,
    limited: Limited,
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
    market : Market
    limited : Limited
    found : Found
    kind, level, limit
        As in `Allocation`.
    target : float
        What `limited` was brought to, where that is not the limit.
    rows : list of Row
        That may bind.
    **told
        The other fields of `Allocation` that do not follow from these.

    Returns
    -------
    Allocation
    """
    widths = found.widths
    held = market.holding(found.grades)
    grades: list[str | None] = [None] * widths.size
    for (entry, table, _), grade in zip(market.tables, found.grades, strict=True):
        grades[entry] = table.names[grade]
    _, row = limited.measure(widths)
    multipliers = multipliers_of(held, limited, target, [*rows, row], widths)
    # a row's target is the limit, or its square; that of the sample goes with the limit
    price = float(multipliers.values.sum()) * (2 * limit if limited.power == 2 else target / limit)
    cost = market.total(widths)
    lower = max(found.lower, -math.inf if market.tables else multipliers.lower)
    exact = kind in ("worst", "rms")
    first = [stack.components[block.components.start] for block in stack.blocks] if stack.components else []
    return Allocation(
        labels=market.labels,
        keys=tuple(component.key for component in first),
        dimensions=tuple(component.dimension for component in first),
        speed=stack.speed,
        held_by=_held_by(market, widths),
        model=stack.model,
        kind=kind,
        limit=limit,
        level=level,
        widths_before=_floats(market.given),
        widths=_floats(widths),
        grades=tuple(grades),
        fixed=market.fixed,
        costs_before=_floats(market.before),
        costs=_floats(market.each(widths)),
        shadow_price=price * step_of(kind) if held.smooth.any() else None,
        bound_prices=_floats(np.abs(multipliers.bounds)),
        gap=(max(0.0, (cost - lower) / cost) if cost else 0.0) if exact else None,
        proof=found.proof,
        **told,
    )


def _held_by(market: Market, widths: Array) -> tuple[str, ...]:
    """What keeps each entry where it is."""
    said = np.full(len(market.labels), "limit", dtype=object)
    said[market.smooth & (widths <= market.low * (1 + _AT_BOUND))] = "lower bound"
    said[market.smooth & (widths >= market.high * (1 - _AT_BOUND))] = "upper bound"
    said[[e for e, _, _ in market.tables]] = "grade"
    said[np.array(market.fixed)] = "fixed"
    return tuple(map(str, said))


def _floats(values: Array) -> tuple[float, ...]:
    return tuple(map(float, values))


def rates_of(market: Market, slope: Array, *, step: float) -> tuple[Rate, ...]:
    """Of each entry, from the derivative of what is limited by the widths as given; per step of it."""
    slopes = market.slopes(market.given)
    rates = [Rate(label, None, None) for label in market.labels]
    for e in map(int, np.flatnonzero(market.smooth)):
        rate = _rate(-float(slopes[e]), float(slope[e]), step)
        relax = rate if market.given[e] < market.high[e] else None
        rates[e] = Rate(market.labels[e], relax, rate if market.given[e] > market.low[e] else None)
    for e, table, allowed in market.tables:
        if not table.holds(float(market.given[e])):
            continue
        here = table.index(float(market.given[e]))
        wider, finer = ([g for g in allowed if g > here], [g for g in allowed if g < here])
        steps = []
        for others in (wider[:1], finer[-1:]):
            gain = [(table.prices[here] - table.prices[g], table.widths[g] - table.widths[here]) for g in others]
            steps.append(_rate(gain[0][0] / gain[0][1], float(slope[e]), step) if gain else None)
        rates[e] = Rate(market.labels[e], *steps)
    return tuple(rates)


def _rate(saved: float, given_up: float, step: float) -> float:
    """Cost per step from cost and what is limited per width; without bound where the width does not matter."""
    return saved / given_up * step if given_up > 0 else math.inf
