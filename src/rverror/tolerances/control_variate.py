"""What contacts that open and bearings that give way make of the linear sizes: a control-variate correction.

A sample of virtual units is solved by the loaded equilibrium and linearly; what the two have in common carries the
result over to all units that were computed linearly.  Page ``theory/contact-correction.md``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from rverror.base.arrays import Array
from rverror.base.chance import student
from rverror.base.errors import InputError, check_kind
from rverror.base.units import to_core
from rverror.base.viewed import OneLine
from rverror.geartrain.contacts import motion
from rverror.geartrain.kinematics import Conditions, Pose, true_period
from rverror.geartrain.mechanism import Reducer
from rverror.geartrain.source import IndexValue
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model, check_model
from rverror.model.readings import added, felt, stand
from rverror.statics.loaded_state import NotConvergedError
from rverror.statics.prediction import Predictor
from rverror.tolerances.sampling import VirtualUnits, check_seed, check_share, computed, share_interval, told, uniforms
from rverror.tolerances.stacking import Stack, Tolerance, check_tolerances

#: Units that the equilibrium solves where no number is given.
COUNT = 64
#: Angles of a revolution at which it is solved.
POINTS = 2048

#: Quantiles that are told.
LEVELS = (0.5, 0.95, 0.99)

#: Sizes of an output error that are corrected.
SIZES = ("peak_to_peak", "max", "rms")
_FEWEST = 16  # units that a correction needs
_COARSEST = 64  # angles
_BLOCK = 4  # units of a task
SAMPLE_CHUNK = 2**32 - 1  # seeds the sample: no chunk of virtual units has this number
_KNOTS = 128  # of the ranks between 0 and 1
_NEIGHBOURHOOD = 0.35  # of ranks, for one unit; falls with the fifth root of their number
_KNOT_RANKS = np.linspace(0, 1, _KNOTS + 1)
_WIDTHS = (0.4, 0.2, 0.1, 0.05)  # of the curve's neighbourhood, in ranks
_NO_SUPPORT = 10.0  # difference of the criterion that leaves a model no support (Burnham and Anderson 2002)
_TINY = 1e-300
_ROUNDING = 1e-12  # relative: what varies less does not vary
_HALVINGS = 60
_EVEN = 1e-6  # of a step or a period


@dataclass(frozen=True)
class Corrected:
    """A mean, quantile or yield with contacts that open, beside the linear one."""

    value: float
    low: float  #: lower end of the interval
    high: float  #: its upper end
    linear: float  #: what all the linear units give

    @property
    def correction(self) -> float:
        """Value less the linear one."""
        return self.value - self.linear

    @property
    def relative(self) -> float:
        """Correction as a share of the linear value; not a number where that is 0."""
        return self.correction / self.linear if self.linear else math.nan


@dataclass(frozen=True)
class ControlVariate:
    """Distribution of a dear quantity, known for a sample, with the help of a cheap one, known for many.

    Raises
    ------
    InputError
        If there are too few units, or a number is not finite.

    Notes
    -----
    The mean is that of a straight regression line.  For quantiles and yields, the dear quantity of a unit is a rising
    curve in the cheap one, straight unless the sample speaks against it, and the residual of one of the sample's units
    near in rank.
    """

    many: Array  #: (N,); the cheap quantity of many independent units
    cheap: Array  #: (n,); the same of a sample of units of the same kind
    dear: Array  #: (n,); the dear quantity of that sample

    def __post_init__(self) -> None:
        """Check the arrays."""
        if self.cheap.shape != self.dear.shape or self.cheap.ndim != 1:
            raise InputError(f"sample: shapes {self.cheap.shape} and {self.dear.shape}; give one number of each a unit")
        if self.cheap.size < _FEWEST:
            raise InputError(f"sample: {self.cheap.size} units are too few for an interval; give {_FEWEST} or more")
        if not all(row.size and np.isfinite(row).all() for row in (self.many, self.cheap, self.dear)):
            raise InputError("sample: a number is not finite, or there are no linear units")

    @property
    def slope(self) -> float:
        """beta, change of the dear with the cheap quantity: least squares, not below 0."""
        return _slope(self.cheap, self.dear)

    @property
    def correlation(self) -> float:
        """Pearson correlation of both over the sample; not a number where one of them does not vary."""
        if not _varies(self.cheap) or not _varies(self.dear):
            return math.nan
        across = (self.cheap - self.cheap.mean()) @ (self.dear - self.dear.mean()) / self.cheap.size
        return float(across / (self.cheap.std() * self.dear.std()))

    @property
    def unexplained(self) -> float:
        """Share of the dear quantity's variance that the line leaves."""
        count = self.dear.size
        if not _varies(self.dear):
            return 0.0
        left = float((self.dear - self.slope * self.cheap).var() / self.dear.var())
        return min(1.0, left * (count - 1) / (count - 2))

    @property
    def variance_reduction(self) -> float:
        """How many times more units the dear quantity alone would take for the same mean; nan if it does not vary."""
        if not _varies(self.dear):
            return math.nan
        alone = float(self.dear.var(ddof=1)) / self.dear.size
        left = self.unexplained * alone + (self.slope * self._scatter) ** 2
        return alone / left if left else math.inf

    def mean(self, *, confidence: float = 0.95) -> Corrected:
        """Mean of the dear quantity."""
        check_share("confidence", confidence)
        count, middle = self.dear.size, float(self.many.mean())

        def found(keep: Any) -> float:
            beta = _slope(self.cheap[keep], self.dear[keep])
            return float(self.dear[keep].mean() + beta * (middle - self.cheap[keep].mean()))

        value = found(slice(None))
        without = np.array([found(np.arange(count) != i) for i in range(count)])
        variance = _jackknife(without) + (self.slope * self._scatter) ** 2
        margin = student((1 - confidence) / 2, count - 2) * math.sqrt(variance)
        return Corrected(value, value - margin, value + margin, middle)

    def quantile(self, probability: float, *, confidence: float = 0.95) -> Corrected:
        """Size that so large a share of the units does not exceed; a probability of 0.99 for P99."""
        check_share("probability", probability)
        value = float(self._inverse(np.array([probability]))[0])
        low, high = self._inverse(self._limits(value, probability, confidence))
        linear = float(np.quantile(self.many, probability))
        return Corrected(value, min(float(low), value), max(float(high), value), linear)

    def yield_at(self, limit: float, *, confidence: float = 0.95) -> Corrected:
        """Share of the units that do not exceed a limit."""
        value = float(self._all.share(np.array([limit]))[0])
        low, high = self._limits(limit, value, confidence)
        linear = float((self.many <= limit).mean())
        return Corrected(value, float(low), float(high), linear)

    @property
    def _scatter(self) -> float:
        """Standard error of the mean of the many."""
        return float(self.many.std()) / math.sqrt(self.many.size)

    @cached_property
    def _sorted(self) -> Array:
        return np.sort(self.many)

    @cached_property
    def _knots(self) -> Array:
        """Cheap quantities at even ranks."""
        return np.asarray(np.quantile(self._sorted, _KNOT_RANKS), dtype=np.float64)

    @cached_property
    def _ranks(self) -> Array:
        """Share of the many below each unit of the sample, those alike by half."""
        below, up_to = (np.searchsorted(self._sorted, self.cheap, side=side) for side in ("left", "right"))
        return np.asarray((below + up_to) / (2 * self.many.size), dtype=np.float64)

    @cached_property
    def _width(self) -> float:
        """Neighbourhood of the curve, in ranks, by the information criterion; infinite where a straight line may do."""
        line, *others = (_criterion(self._ranks, self.cheap, self.dear, width) for width in (math.inf, *_WIDTHS))
        best = int(np.argmin(others))
        return _WIDTHS[best] if others[best] < line - _NO_SUPPORT else math.inf

    @cached_property
    def _swell(self) -> float:
        """What the residuals lost to the curve's freedom."""
        freedom = float(np.trace(_smoother(self._ranks, self.cheap, self._ranks, self.cheap, self._width)))
        return math.sqrt(self.cheap.size / (self.cheap.size - freedom))

    def _distribution(self, keep: Any) -> _Distribution:
        """Distribution of the dear quantity from some units of the sample."""
        ranks, cheap, dear = self._ranks[keep], self.cheap[keep], self.dear[keep]
        curve = _smoother(_KNOT_RANKS, self._knots, ranks, cheap, self._width) @ dear
        curve = np.maximum.accumulate(curve)
        weight = _nearness(_KNOT_RANKS, ranks, _NEIGHBOURHOOD * cheap.size**-0.2)
        steps = (weight[1:] + weight[:-1]) / (2 * _KNOTS)
        share = np.concatenate([np.zeros((1, cheap.size)), np.cumsum(steps, axis=0)])
        rest = (dear - np.interp(cheap, self._knots, curve)) * self._swell
        return _Distribution(self._sorted, self._knots, curve, rest, share)

    @cached_property
    def _all(self) -> _Distribution:
        return self._distribution(slice(None))

    @cached_property
    def _without(self) -> list[_Distribution]:
        """Distributions that leave out one unit each."""
        count = self.cheap.size
        return [self._distribution(np.arange(count) != i) for i in range(count)]

    def _inverse(self, shares: Array) -> Array:
        """Sizes below which lie the given shares."""
        ends = self._all.ends
        low, high = np.full(shares.size, ends[0]), np.full(shares.size, ends[1])
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            above = self._all.share(middle) >= shares
            low, high = np.where(above, low, middle), np.where(above, middle, high)
        return high

    def _limits(self, size: float, share: float, confidence: float) -> Array:
        """Interval of the share of units up to a size: Clopper and Pearson's for as many units as its scatter tells.

        A share is taken to be known no better than the mean: the jackknife does not see what lies beyond the sample.
        """
        check_share("confidence", confidence)
        binomial = share * (1 - share)
        scatter = _jackknife(np.array([one.share(np.array([size]))[0] for one in self._without]))
        most = 1 / (self.unexplained / self.cheap.size + 1 / self.many.size)
        variance = scatter + binomial / self.many.size
        trials = min(most, binomial / variance) if binomial and variance else most
        return np.array(share_interval(share * trials, trials, confidence))


@dataclass(frozen=True)
class ContactCorrection(OneLine):
    """Sizes of the output error at a load, with contacts that open and bearings that give way.

    Attributes
    ----------
    peak_to_peak, max, rms : ControlVariate
        rad, as in `VirtualUnits`; the cheap quantity is the linear size, the dear one that of the equilibrium.
    torque : float
        Size of the output torque, N*mm.
    direction : float
        +1 forward, -1 reverse.
    count : int
        Units of the sample, those that failed included.
    failures : tuple of str
        Units whose equilibrium was not found and why; they are in none of the sizes.
    points : int
        Angles at which the equilibrium was asked for.
    thinning : float
        rad; mean change of the peak-to-peak where every other of these angles is left out, and `thinning_most` the
        largest: what the number of angles does is less.
    thinning_most : float
    lag : float
        rad; mean offset of the equilibrium less that of the linear result: windup mostly.  No size holds it.
    """

    peak_to_peak: ControlVariate
    max: ControlVariate
    rms: ControlVariate
    torque: float
    direction: float
    count: int
    failures: tuple[str, ...]
    points: int
    thinning: float
    thinning_most: float
    lag: float


def contact_correction(
    model: Model,
    tolerances: Sequence[Tolerance],
    stack: Stack,
    units: VirtualUnits,
    *,
    torque: Any,
    direction: float = 1.0,
    count: int = COUNT,
    points: int = POINTS,
    seed: int = 0,
    executor: Executor | None = None,
    progress: Callable[[str], None] | None = None,
) -> ContactCorrection:
    """Solve a sample of virtual units by the loaded equilibrium and correct the linear sizes of many.

    Parameters
    ----------
    model : Model
        Of a reducer.
    tolerances : sequence of Tolerance
        Those of the stack: their means are in the units solved here.
    stack : Stack
        At the same direction; its widths are used.
    units : VirtualUnits
        Linear sizes of many units of the stack.
    torque : float or quantity
        Size of the output torque, N*mm, above 0.
    direction : float
        +1 forward, -1 reverse.
    count : int
        Units of the sample, 16 or more.
    points : int
        Least number of angles at which the equilibrium is solved; of the stack's angles every second, fourth ... are
        left out, and their errors drawn from the Fourier series of the others.  All angles are used where they are not
        even over whole periods.
    seed : int
        The first units are the same whatever the count.
    executor : concurrent.futures.Executor, optional
        Where units are solved; the numbers are the same with any.
    progress : callable, optional
        Called with a line of text as units are solved.

    Returns
    -------
    ContactCorrection

    Raises
    ------
    InputError
        If a setting is unusable, or too few units have an equilibrium.

    Examples
    --------
    >>> import rverror
    >>> from rverror.tolerances.stacking import stack, tolerance
    >>> from rverror.tolerances.sampling import virtual_units
    >>> unit, cams = rverror.Model(rverror.reducer("RV-40E")), [tolerance("crank.eccentricity", "5 um")]
    >>> linear = stack(unit, cams)
    >>> found = contact_correction(unit, cams, linear, virtual_units(linear, 1024), torque="412 N*m", count=16)
    >>> abs(found.peak_to_peak.mean().relative) < 0.01  # no pin lifts off
    True
    """
    check_tolerances(tolerances)
    check_kind("stack", stack, Stack, "make it with stack(model, tolerances)")
    check_kind("units", units, VirtualUnits, "make them with virtual_units(stack, count)")
    check_model(model)
    mechanism, load = model.mechanism, to_core(torque, "torque")
    if not isinstance(mechanism, Reducer):
        raise InputError("a [drive] has no contacts that open; the linear result stands")
    if not load > 0:
        raise InputError(f"torque = {load / 1e3:g} N*m: must be above 0; without a load nothing holds contacts closed")
    if count < _FEWEST:
        raise InputError(f"count = {count}: too few units for an interval; give {_FEWEST} or more")
    if points < _COARSEST:
        raise InputError(f"points = {points}: too few angles for a peak-to-peak; give {_COARSEST} or more")
    check_seed(seed)
    if len(tolerances) != len(stack.blocks):
        raise InputError(f"{len(tolerances)} tolerances for a stack of {len(stack.blocks)}; give those of the stack")
    if stack.theta is None:
        raise InputError("the stack has no angles; make it with `rverror.tolerances.stacking.stack`")

    blocks = uniforms(count, stack.dimensions, seed=seed, index=SAMPLE_CHUNK, draws="random")
    drawn = np.concatenate([stack.standard(block) for block in blocks]) * stack.width[stack.entry]
    even = _is_even(mechanism, stack.theta)
    job = _Job(
        model,
        Conditions(stack.theta, direction, load),
        _stride(stack.theta.size, points) if even else 1,
        even,
        _places(stack),
        drawn + [tolerances[e].mean.get(c.parameter, 0.0) for c, e in zip(stack.components, stack.entry, strict=True)],
    )
    blocks_of_units = range(-(-count // _BLOCK))
    results = computed(job, blocks_of_units, executor)
    solved = dict(told(results, progress, f"{count} units at the load", len(blocks_of_units)))
    found = [unit for block in sorted(solved) for unit in solved[block]]
    failures = tuple(unit for unit in found if isinstance(unit, str))
    settled = [i for i, unit in enumerate(found) if not isinstance(unit, str)]
    if len(settled) < _FEWEST:
        raise InputError(
            f"only {len(settled)} of {count} units have an equilibrium, {_FEWEST} are needed; {failures[0]}"
        )
    dear = np.array([unit for unit in found if not isinstance(unit, str)])
    cheap = np.array([_sizes_of(stack.nominal + row @ stack.influence) for row in drawn[settled]])
    peak_to_peak, largest, rms = (
        ControlVariate(many, cheap[:, i], dear[:, i])
        for i, many in enumerate((units.peak_to_peak, units.max, units.rms))
    )
    thinned = dear[:, -1] - dear[:, 0]
    return ContactCorrection(
        peak_to_peak,
        largest,
        rms,
        torque=load,
        direction=direction,
        count=count,
        failures=failures,
        points=stack.theta.size // job.stride,
        thinning=float(thinned.mean()),
        thinning_most=float(np.abs(thinned).max()),
        lag=float((dear[:, 3] - cheap[:, 3]).mean()),
    )


@dataclass(frozen=True)
class _Place:
    """Where the drawn components of one instance of a source stand among its parameters."""

    key: str
    indices: Mapping[str, IndexValue]
    parameters: int
    at: tuple[tuple[int, int], ...]  # parameter, component

    def effect(self, values: Array) -> Effect:
        """Effect of the components' values."""
        own = [0.0] * self.parameters
        for parameter, component in self.at:
            own[parameter] = float(values[component])
        return Effect(self.key, self.indices, tuple(own))


def _places(stack: Stack) -> tuple[_Place, ...]:
    """Where each component stands, an instance of an entry at a time."""
    found: dict[tuple[Any, ...], _Place] = {}
    for number, (component, entry) in enumerate(zip(stack.components, stack.entry, strict=True)):
        names = [parameter.name for parameter in source(component.key).parameters]
        indices = dict(component.indices)
        name = (int(entry), *sorted(indices.items()))
        place = found.get(name, _Place(component.key, indices, len(names), ()))
        found[name] = replace(place, at=(*place.at, (names.index(component.parameter), number)))
    return tuple(found.values())


@dataclass(frozen=True)
class _Job:
    """What a worker needs to solve units."""

    model: Model
    conditions: Conditions
    stride: int
    even: bool
    places: tuple[_Place, ...]
    values: Array  # (units, components)

    def __call__(self, block: int) -> list[tuple[float, ...] | str]:
        """Sizes, offset and coarser peak-to-peak of each unit of a block, or what went wrong."""
        numbers = range(block * _BLOCK, min((block + 1) * _BLOCK, len(self.values)))
        return [self._unit(number) for number in numbers]

    def _unit(self, number: int) -> tuple[float, ...] | str:
        effects = (*self.model.effects, *(place.effect(self.values[number]) for place in self.places))
        try:
            loaded = self._predictor.predict(replace(self.model, effects=felt(effects))).transmission_error
        except NotConvergedError as problem:
            return f"unit {number}: {problem}"
        read = added(effects, self._read)
        full = (between(loaded, self._read.theta.size) if self.even else loaded) + read
        halves = self.even and loaded.size % 2 == 0
        thinned = between(loaded[::2], self._read.theta.size) + read if halves else full[::2]
        return (*_sizes_of(full), float(np.ptp(thinned)))

    @cached_property
    def _read(self) -> Pose:
        return motion(self.model.mechanism, self.conditions)

    @cached_property
    def _predictor(self) -> Predictor:
        """Gear train where it stands at some of the angles."""
        gears = stand(self.model, self._read).gears
        return Predictor(self.model.mechanism, self.conditions.at(gears.theta[:: self.stride]))


def between(row: Array, angles: int) -> Array:
    """Row at more even angles of the same periods, by its Fourier series."""
    if row.size == angles:
        return row
    lines = np.fft.rfft(row)
    if row.size % 2 == 0:
        lines[-1] /= 2  # stands for both signs of its order
    return np.asarray(np.fft.irfft(lines, angles), dtype=np.float64) * (angles / row.size)


def _sizes_of(te: Array) -> tuple[float, float, float, float]:
    """Peak-to-peak, max and rms about the mean, and the mean, rad."""
    offset = float(te.mean())
    away = te - offset
    return float(np.ptp(te)), float(np.abs(away).max()), math.sqrt(float(away @ away) / te.size), offset


def _is_even(mechanism: Reducer, theta: Array) -> bool:
    """Whether the angles are even over whole periods, so that errors of the gear train have a Fourier series."""
    step = np.diff(theta)
    if not step.size or np.ptp(step) > _EVEN * abs(step[0]):
        return False
    periods = theta.size * abs(float(step.mean())) / (2 * math.pi * true_period(mechanism))
    return round(periods) >= 1 and abs(periods - round(periods)) < _EVEN


def _stride(angles: int, points: int) -> int:
    """Every how many angles the equilibrium is solved."""
    return max((d for d in range(1, angles // points + 1) if angles % d == 0), default=1)


@dataclass(frozen=True)
class _Distribution:
    """Distribution function sum_i A_i(U(m^-1(t - residual_i))): m the curve, U the distribution of the many."""

    many: Array  # sorted
    knots: Array  # cheap quantities
    curve: Array  # m at the knots, rising
    residual: Array  # (n,)
    weight: Array  # A, (knots, n): weight of each residual up to each rank

    @property
    def ends(self) -> tuple[float, float]:
        """Sizes at which the share is 0 and 1."""
        room = 1e-9 * float(np.abs(self.curve).max() + np.abs(self.residual).max())
        return (
            float(self.curve[0] + self.residual.min()) - room,
            float(self.curve[-1] + self.residual.max()) + room,
        )

    def share(self, sizes: Array) -> Array:
        """Share of units up to each size, shape of `sizes`."""
        over = sizes[:, None] - self.residual
        at = np.searchsorted(self.curve, over, side="right") - 1
        left, right = np.clip(at, 0, _KNOTS), np.clip(at + 1, 0, _KNOTS)
        rise = self.curve[right] - self.curve[left]
        part = (over - self.curve[left]) / np.where(rise > 0, rise, 1.0)
        cheap = self.knots[left] + np.where(rise > 0, part, 0.0) * (self.knots[right] - self.knots[left])
        rank = np.searchsorted(self.many, cheap, side="right") / self.many.size
        rank = np.where(at < 0, 0.0, np.where(at == _KNOTS, 1.0, rank))
        knot = np.minimum((rank * _KNOTS).astype(np.intp), _KNOTS - 1)
        part, column = rank * _KNOTS - knot, np.arange(self.residual.size)
        found = (1 - part) * self.weight[knot, column] + part * self.weight[knot + 1, column]
        return np.asarray(np.clip(found.sum(axis=1), 0, 1), dtype=np.float64)


def _nearness(at: Array, ranks: Array, width: float) -> Array:
    """Weights of units by their ranks at other ranks, shape (at, units), that add up to 1."""
    weight = np.exp(-0.5 * ((at[:, None] - ranks) / width) ** 2)
    return np.asarray(weight / weight.sum(axis=1, keepdims=True), dtype=np.float64)


def _smoother(at: Array, places: Array, ranks: Array, cheap: Array, width: float) -> Array:
    """Matrix (at, units) of the local straight line at ranks `at`, where the cheap quantity is `places`."""
    weight = _nearness(at, ranks, width)
    middle = weight @ cheap
    away = cheap - middle[:, None]
    square = (weight * away**2).sum(axis=1)
    varies = square > _ROUNDING**2 * middle**2
    lever = np.where(varies, places - middle, 0.0) / np.where(varies, square, 1.0)
    return np.asarray(weight * (1 + lever[:, None] * away), dtype=np.float64)


def _criterion(ranks: Array, cheap: Array, dear: Array, width: float) -> float:
    """Corrected Akaike criterion of a local straight line (Hurvich, Simonoff and Tsai 1998)."""
    matrix = _smoother(ranks, cheap, ranks, cheap, width)
    rest, freedom = dear - matrix @ dear, dear.size - float(np.trace(matrix)) - 2
    if freedom <= 0:
        return math.inf
    return dear.size * (math.log(max(float(rest @ rest), _TINY)) + 2 * (dear.size - 1 - freedom) / freedom)


def _varies(row: Array) -> bool:
    return bool(np.ptp(row) > _ROUNDING * np.abs(row).max())


def _slope(cheap: Array, dear: Array) -> float:
    if not _varies(cheap):
        return 0.0
    away = cheap - cheap.mean()
    return max(float(away @ (dear - dear.mean())) / float(away @ away), 0.0)


def _jackknife(without: Array) -> float:
    """Variance from the values that leave out one unit each."""
    return float((without.size - 1) * without.var())
