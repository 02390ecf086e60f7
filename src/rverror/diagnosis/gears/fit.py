"""The joint fit of a reducer's sizes to all samples of all runs, under every prior.

Minimised is D + P: the squares of the whitened residual, less what offsets, slips and lines make of it, and those of
the priors.  Declared sizes have their uncertainty, stiffness a quarter (of its logarithm), backlash half, what was
added the size that a workshop makes, or a lot had.  What is not explained yet has any size, but few independent
values: beyond N, what noise alone hardly exceeds, D counts as N + M ln(1 + (D - N)/M).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, TypeVar

import numpy as np

from rverror.base.arrays import Array, Flags
from rverror.base.chance import student
from rverror.base.threads import each
from rverror.base.units import ARCSEC
from rverror.diagnosis.causes import Named
from rverror.diagnosis.gears.observation import EverySample, MeanSamples, Observation
from rverror.diagnosis.gears.record import Record, conditions_of
from rverror.diagnosis.gears.waveform import SOFT_BOUNDS, LoadCase, Waveform, soft_values, softened
from rverror.diagnosis.noise import noise_of, walking
from rverror.diagnosis.policy import Policy
from rverror.diagnosis.size_prior import WORKSHOP, SizePrior
from rverror.geartrain.action_line import ContactForces
from rverror.geartrain.kinematics import fundamental_orders
from rverror.geartrain.mechanism import BACKLASH_SPREAD, LAW_SPREAD, Mechanism, Reducer
from rverror.geartrain.source import Indices
from rverror.model.catalogue import source
from rverror.model.compose import source_matrices
from rverror.model.effects import Effect, Model
from rverror.runs.noise import RunNoise
from rverror.runs.spectrum import frames_of_order
from rverror.statics.loaded_state import SOFTENING, NotConvergedError

R = TypeVar("R")


#: Angles a turn on which sets are compared before they are fitted to every sample, and means of samples: half of those
#: of the fit, and of what order 156 says three quarters.
_ANGLES, _MEANS = 1024, 512
#: Share of the promised fall from which longer steps are trusted; below one less it, shorter ones.
_TRUE = 0.75
#: Of each value's own entry: what holds values that nothing tells apart.
_TRACE = 1e-12


@dataclass(frozen=True, eq=False)
class RunSet:
    """All runs, under one set of grids.

    Attributes
    ----------
    unit : Reducer or Drive
        As declared.
    records : tuple of Record
    conditions : tuple of LoadCase
    which : tuple of int
        Condition of each record.
    policy : Policy
    soft : ndarray of bool, shape (10,)
        Which of `SOFTENING` are refitted.
    anywhere : bool
        Whether the gear's marks may be at any angle.
    prior : SizePrior
        How large added sizes are taken to be.
    together : tuple of int
        How many samples of each record are averaged; all are looked at where it is empty.
    sampled : bool
        Whether the records are samples, which may hold lines that no one has named.
    linear : bool
        Whether everything is linear in all sizes, so that what one cause makes does not hang on the others.
    """

    unit: Mechanism
    records: tuple[Record, ...]
    conditions: tuple[LoadCase, ...]
    which: tuple[int, ...]
    policy: Policy
    soft: Flags
    anywhere: bool = False
    prior: SizePrior = WORKSHOP
    together: tuple[int, ...] = ()
    sampled: ClassVar[bool] = True
    linear: ClassVar[bool] = False

    @staticmethod
    def of(unit: Mechanism, records: Sequence[Record], policy: Policy, *, points: int, anywhere: bool) -> RunSet:
        """Runs with grids of so many angles a turn."""
        conditions, which = conditions_of(records, points, anywhere=anywhere)
        soft = soft_flags(policy, loaded=any(r.torque for r in records))
        return RunSet(unit, tuple(records), tuple(conditions), tuple(which), policy, soft, anywhere=anywhere)

    def with_records(self, records: Sequence[Record]) -> RunSet:
        """The same with other noise, lines or samples set aside."""
        return replace(self, records=tuple(records))

    @property
    def lines(self) -> tuple[float, ...]:
        """Orders of the free lines, which all runs have; a table names all its lines."""
        return self.records[0].orders if self.sampled else ()

    @property
    def slow(self) -> bool:
        """Whether each run drifts and settles by itself."""
        return self.sampled and self.records[0].slow

    def with_free(self, lines: Sequence[float], *, slow: bool) -> RunSet:
        """The same with free lines of these orders in all runs, which drift and settle or do not."""
        return self.with_records([replace(r, orders=tuple(lines), slow=slow) for r in self.records])

    @property
    def bare(self) -> RunSet:
        """The same without free lines, and with nothing that drifts."""
        return self.with_free((), slow=False)

    def slow_notes(self, record: Record, rest: Array) -> list[str]:
        """What the residual of a record that settles does so by, in words."""
        slow = replace(record, slips=()).slow_part(rest)
        return [f"{record.name}: the reading drifts and settles by {np.ptp(slow) / ARCSEC:.3g} arcsec; taken off"]

    def coarser(self, points: int) -> RunSet:
        """The same on grids of so many angles a turn, where they have more."""
        coarser = tuple(one.coarser(points) for one in self.conditions)
        return replace(self, conditions=coarser) if coarser != self.conditions else self

    def anchored(self, offset: float) -> RunSet:
        """The same with grids that begin at a sample with the marks so far ahead, so that even samples lie on them.

        Between the angles of a grid no spline follows a contact that opens: of a pin 5 um thick that cost 65 squares.
        """
        if not self.anywhere:
            return self
        start = float(self.records[0].theta.min()) + offset
        turns = [LoadCase(c.direction, c.torque, replace(c.turn, start=start)) for c in self.conditions]
        return replace(self, conditions=tuple(turns))

    @cached_property
    def coarse(self) -> RunSet:
        """The same on fewer angles and through means of samples: near enough to choose what is fitted to all.

        What is a table's is few already, and of what is linear a step is the fit.
        """
        if not self.sampled or self.linear:
            return self
        # of a short run no fewer, or a fit to them has more sizes than they are
        together = [max(int(r.theta.size / max(r.turns, 1.0)) // _MEANS, 1) for r in self.records]
        return replace(self.coarser(_ANGLES), together=tuple(together))

    def deviation(self, key: str, indices: Indices) -> tuple[float, ...]:
        """Standard deviation of each parameter of a source at a place, before the runs are seen."""
        return self.prior.deviation(key, indices, self.policy.workshop)

    def half_width(self, variance: float) -> float:
        """Half the width of an interval."""
        return math.sqrt(variance) * student((1 - self.policy.confidence) / 2, max(self.freedom / 8, 4.0))

    @cached_property
    def freedom(self) -> int:
        """Independent values of all runs."""
        return sum(observation.freedom for observation in self.observations)

    @cached_property
    def allowance(self) -> float:
        """Squares beyond their number that noise alone hardly makes; of means that of the samples, so that what is
        left beyond noise is the same."""
        values = sum(r.whiten.freedom for r in self.records) if self.together else self.freedom
        return self.policy.by_chance * math.sqrt(2 * values)

    @cached_property
    def soft_sigmas(self) -> list[float]:
        """`soft_spread`, 0 where it is not refitted."""
        spread = soft_spread(self.gears) if self.soft.any() else [0.0] * len(SOFTENING)
        return [sigma * bool(on) for sigma, on in zip(spread, self.soft, strict=True)]

    @property
    def gears(self) -> Reducer:
        """The reducer, as declared."""
        return _gears(self.unit)

    @property
    def settles(self) -> bool:
        """Whether all runs are long enough to tell drift and settling from an encoder's error, as a drive's bow is."""
        return self.linear or (self.sampled and all(r.turns > self.policy.least_cycles for r in self.records))

    def noise_in(self, record: Record, rest: Array, fitted: float, *, calm: bool = False) -> RunNoise:
        """Noise of what so many sizes leave of a run, `calm` where nothing else is left."""
        # of less than half a turn of the crank the wave is a bow, as noise with memory makes
        bow = self.sampled and not self.linear and 2 * record.turns * fundamental_orders(self.gears)["crank"] < 1
        return noise_of(
            rest,
            record.kept,
            fitted,
            floor=self.policy.model_error,
            calm=calm,
            by_criterion=self.linear,
            parts=record.sides,
            white=bow,
        )

    def framed(self, order: float, apart: float) -> bool:
        """Tell whether an order is that of a part, or lies nearer to one than so much."""
        return bool(frames_of_order(self.unit, order, tolerance=apart))

    @cached_property
    def zeros(self) -> tuple[str, ...]:
        """Labels of shared zeros."""
        return tuple(sorted({r.zero for r in self.records if r.zero}))

    def around(self, model: Model) -> tuple[Effect, ...]:
        """Effects of the gear train that are solved; a sun's whose turns do not close are added by their influence."""
        return tuple(e for e in model.effects if self.on_grid(e.key))

    def on_grid(self, key: str) -> bool:
        """Whether the waveform of a source is one of the gear train's, on its grid."""
        return not source(key).at_output and not self.apart(key)

    def apart(self, key: str) -> bool:
        """Whether a source is added by its influence: to samples a sun's, where it does not repeat with the turns."""
        far = self.sampled and not self.linear and self.gears.exact_ratio.denominator > 1
        return far and source(key).frame == "sun" and not source(key).at_output

    def solve(self, model: Model, near: Sequence[Waveform] | None = None) -> list[Waveform]:
        """Waveform of each condition."""
        unit, effects = _gears(model.mechanism), self.around(model)
        starts: Sequence[Waveform | None] = near if near is not None else [None] * len(self.conditions)
        return [one.solve(unit, effects, start) for one, start in zip(self.conditions, starts, strict=True)]

    def influences(self, model: Model, waves: Sequence[Waveform], named: Sequence[Named]) -> list[Array]:
        """Influences of sources as each record sees them, (parameters, width), in the state of waveforms."""
        offset = model.index_offset
        on_grid = [name for name in named if self.on_grid(name[0])]
        at = np.array([self.on_grid(key) for key, _ in named for _ in source(key).parameters], dtype=np.bool_)
        beyond = [name for name in named if not self.on_grid(name[0])]
        by_contacts = any(not source(key).at_output for key, _ in named)

        def made(number: int) -> tuple[ContactForces, Array]:
            """Under one condition: forces, and the influences on its grid."""
            motion, forces = self.conditions[number].forces(waves[number])
            return forces, source_matrices(motion, forces, on_grid)

        under = each(made, range(len(self.conditions))) if by_contacts else []

        def seen(number: int) -> Array:
            observation, which = self.observations[number], self.which[number]
            turn, (forces, part) = self.conditions[which].turn, under[which] if under else ({}, None)
            rows = np.zeros((at.size, observation.width))
            if part is not None:
                rows[at] = observation.of_grid(turn, part, offset)
            if beyond:
                read = [observation.beyond(model.mechanism, turn, name, forces, offset) for name in beyond]
                rows[~at] = np.concatenate(read)
            return rows

        return self.of_each(seen)

    def of_each(self, function: Callable[[int], R]) -> list[R]:
        """What a function makes of the number of each record, side by side."""
        return each(function, range(len(self.records)))

    @cached_property
    def observations(self) -> tuple[Observation, ...]:
        """How each record is looked at."""
        both = zip(self.records, self.together or (1,) * len(self.records), strict=True)
        return tuple(MeanSamples(r, count) if count > 1 else EverySample(r) for r, count in both)


@dataclass(frozen=True, eq=False)
class Fit:
    """Sizes, and how they fit.

    Attributes
    ----------
    run_set : RunSet
    model : Model
        Its mechanism has the refitted stiffness, its effects (declared first) the fitted sizes.
    declared : Model
        As given.
    waves : tuple of Waveform
    residual : tuple of ndarray
        Of each record, offset and lines still in it, rad.
    data : float
        Squares.
    gram : ndarray, shape (k, k)
        Of the data, in units of the noise; of all values, soft ones and zeros.
    moment : ndarray, shape (k,)
    """

    run_set: RunSet
    model: Model
    declared: Model
    waves: tuple[Waveform, ...]
    residual: tuple[Array, ...]
    rows: tuple[Array, ...]
    raw: tuple[Array, ...]
    data: float
    gram: Array
    moment: Array
    converged: bool = True

    @property
    def without_rows(self) -> Fit:
        """The same without its rows, which are large; `onto` its set of runs has them again."""
        return replace(self, rows=(), raw=())

    @property
    def added(self) -> tuple[Effect, ...]:
        """Effects beside the declared ones."""
        return self.model.effects[len(self.declared.effects) :]

    @property
    def printed(self) -> tuple[Effect, ...]:
        """Declared effects as printed; where the gear's marks are is no size of a part: it is the fitted one."""
        both = zip(self.model.effects, self.declared.effects, strict=False)
        return tuple(now if source(now.key).acts == "marks" else then for now, then in both)

    def model_with(self, *others: Effect, instead_of: int) -> Model:
        """The model with some effects, or none, in the place of an added one."""
        effects, at = self.model.effects, len(self.declared.effects) + instead_of
        return replace(self.model, effects=(*effects[:at], *others, *effects[at + 1 :]))

    def places(self, number: int) -> slice:
        """Where the values of an added effect stand among all values."""
        first = sum(len(e.values) for e in self.model.effects[: len(self.declared.effects) + number])
        return slice(first, first + len(self.added[number].values))

    @property
    def added_linearly(self) -> list[list[Array]]:
        """What each added effect makes of each record, (width,), as far as it is linear."""
        return [[np.array(e.values) @ raw[self.places(n)] for raw in self.raw] for n, e in enumerate(self.added)]

    @cached_property
    def added_parts(self) -> list[Array]:
        """What the added effects make of each record through the gear train, (width,): the reading less that without.

        What lets contacts go makes other than its influence says.  What is read at the output is exact.
        """
        run_set, first = self.run_set, len(self.declared.effects)
        within = {i for i, e in enumerate(self.model.effects) if i >= first and not source(e.key).at_output}
        if not within:
            return [np.zeros(observation.width) for observation in run_set.observations]
        rest = replace(self.model, effects=tuple(e for i, e in enumerate(self.model.effects) if i not in within))
        try:
            waves = run_set.solve(rest)
        except NotConvergedError:  # the rest stands on it: as far as it is linear
            values = np.array([v * (i in within) for i, e in enumerate(self.model.effects) for v in e.values])
            return [values @ rows[: values.size] for rows in onto(run_set, self).raw]
        apart = np.array(
            [v * (i in within and run_set.apart(e.key)) for i, e in enumerate(self.model.effects) for v in e.values]
        )
        offset, result, raw = self.model.index_offset, [], onto(run_set, self).raw
        for observation, which, rows in zip(run_set.observations, run_set.which, raw, strict=True):
            both, less = (observation.of_wave(w[which], w[which].error[None], offset)[0] for w in (self.waves, waves))
            result.append(both - less + apart @ rows[: apart.size])
        return result

    @property
    def bound(self) -> float:
        """Squares that noise alone hardly exceeds."""
        return self.run_set.freedom + self.run_set.allowance

    @property
    def scale(self) -> float:
        """By how much less than noise's a square counts; 1 or more."""
        return scale_of(self.data, self.bound, self.run_set.policy)

    @property
    def objective(self) -> float:
        """The less, the better."""
        return counted(self.data, self.bound, self.run_set.policy) + self.prior

    @property
    def deviance(self) -> float:
        """Minus twice the logarithm of the likelihood, sizes and noise, with the squares of the priors."""
        return self.data + self.prior + sum(r.whiten.log_variance for r in self.run_set.records)

    @cached_property
    def weights(self) -> Array:
        """Inverse variance of each value's prior, 0 where there is none, infinite where it is fixed."""
        sigmas = [e.uncertainty or 0.0 for e in self.declared.effects for _ in e.values]
        sigmas += [sigma for e in self.added for sigma in self.run_set.deviation(e.key, e.indices)]
        sigmas += self.run_set.soft_sigmas
        return np.array([1 / sigma**2 if sigma else math.inf for sigma in sigmas] + [0.0] * len(self.run_set.zeros))

    @cached_property
    def free(self) -> Flags:
        """Which values may move."""
        return np.isfinite(self.weights)

    @cached_property
    def pull(self) -> Array:
        """`weights`, 0 where a value is fixed too."""
        return np.where(self.free, self.weights, 0.0)

    @cached_property
    def departure(self) -> Array:
        """How far each value is from the middle of its prior."""
        sizes, middle = ([v for e in model.effects for v in e.values] for model in (self.model, self.declared))
        middle += [0.0] * (len(sizes) - len(middle))  # of what was added
        soft = soft_values(self.model.mechanism) - soft_values(self.run_set.unit)
        return np.concatenate([np.subtract(sizes, middle), soft, np.zeros(len(self.run_set.zeros))])

    @cached_property
    def prior(self) -> float:
        """Squares of the priors."""
        return float(self.pull @ self.departure**2)

    @cached_property
    def proposal(self) -> tuple[Array, float]:
        """`proposed`, undamped."""
        return proposed(self)

    @cached_property
    def covariance(self) -> Array:
        """Covariance of all values, shape (k, k): 0 where fixed; every other value has a prior, or is a shared zero."""
        gram, free = self.gram / self.scale, self.free
        result = np.zeros_like(gram)
        if free.any():
            result[np.ix_(free, free)] = inverted(gram[np.ix_(free, free)] + np.diag(self.weights[free]), 1e-13)
        return result


def inverted(matrix: Array, least: float) -> Array:
    """Inverse of a Gram matrix with priors, all values in units of their own: what shares less than `least` is none."""
    size = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    scale = np.outer(size, size)
    return np.asarray(np.linalg.pinv(matrix / scale, rcond=least, hermitian=True) / scale)


def as_compared(objective: float) -> float:
    """To a millionth: where nothing but rounding differs the catalogue's order decides, on every machine."""
    return round(objective, 6)


def counted(data: float, bound: float, policy: Policy) -> float:
    """Squares as they count: what is not explained yet has few independent values, of any size."""
    return data if data <= bound else bound + policy.regular * math.log1p((data - bound) / policy.regular)


def scale_of(data: float, bound: float, policy: Policy) -> float:
    """Inverse of how much `counted` changes with the squares."""
    return max(1.0, 1 + (data - bound) / policy.regular)


def _gears(unit: Mechanism) -> Reducer:
    """The reducer whose contacts give way."""
    assert isinstance(unit, Reducer)
    return unit


def soft_flags(policy: Policy, *, loaded: bool) -> Flags:
    """Which of `SOFTENING` are refitted: none without a load, and under one the curvature of profiles in any case."""
    return np.array([loaded and policy.refit_stiffness] * 9 + [loaded])


def soft_spread(unit: Reducer) -> list[float]:
    """Standard deviations of `SOFTENING` before the fit; 0 where it is exact."""
    stiffness = [getattr(unit.stiffness_uncertainty, name) for name in SOFTENING[:6]]
    return [*stiffness, BACKLASH_SPREAD * unit.gear_backlash, *LAW_SPREAD.values()]


def evaluated(run_set: RunSet, model: Model, declared: Model, near: Sequence[Waveform] | None = None) -> Fit:
    """A fit's state at given sizes: prediction, residual, changes."""
    waves = run_set.solve(model, near)
    offset = model.index_offset

    def kind(effect: Effect) -> str:
        return "grid" if run_set.on_grid(effect.key) else "marks" if source(effect.key).acts == "marks" else "beyond"

    kinds = [kind(e) for e in model.effects for _ in e.values] + ["grid"] * len(SOFTENING)
    row_of = np.array([*kinds, *(f"zero {label}" for label in run_set.zeros)])
    beyond = [e for e in model.effects if kind(e) == "beyond"]
    influences = run_set.influences(model, waves, [(e.key, e.indices) for e in beyond])
    sizes = np.array([v for e in beyond for v in e.values])

    def seen(number: int) -> tuple[Array, Array, Array, float, Array, Array]:
        """Of one record: residual, whitened rows, rows, squares, Gram matrix and moment."""
        observation, wave = run_set.observations[number], waves[run_set.which[number]]
        felt = observation.of_wave(wave, np.concatenate([wave.error[None], wave.rows, wave.soft]), offset)
        rows = np.zeros((row_of.size, observation.width))
        rows[row_of == "grid"] = felt[1:]
        rows[row_of == "beyond"] = influences[number]
        rows[row_of == f"zero {run_set.records[number].zero}"] = 1.0
        if "marks" in kinds:
            rows[row_of == "marks"] = observation.change(wave, offset)
        rest = observation.measured - (felt[0] + sizes @ influences[number])
        white = _whitened(observation, np.concatenate([rest[None], rows]))
        return rest, white, rows, float(white[0] @ white[0]), white[1:] @ white[1:].T, white[1:] @ white[0]

    residuals, all_rows, raw, squares, grams, moments = zip(*run_set.of_each(seen), strict=True)
    data, gram, moment = sum(squares), sum(grams), sum(moments)
    if run_set.zeros:  # a shared zero has any size: the best one is taken off here
        z = slice(row_of.size - len(run_set.zeros), row_of.size)
        best = np.linalg.lstsq(gram[z, z], moment[z], rcond=None)[0]
        data -= float(best @ moment[z])
        moment -= best @ gram[z]
        for rest, white, rows in zip(residuals, all_rows, raw, strict=True):
            rest -= best @ rows[z]
            white[0] -= best @ white[1:][z]
    return Fit(run_set, model, declared, tuple(waves), residuals, all_rows, raw, data, gram, moment)


def _whitened(observation: Observation, rows: Array) -> Array:
    """Rows under the noise; what is nothing, as stiffness is without a load, costs nothing."""
    shows = rows.any(axis=1)
    white = observation.whiten(rows[shows])
    if shows.all():
        return white
    result = np.zeros((len(rows), white.shape[1]))
    result[shows] = white
    return result


def stepped(model: Model, step: Array) -> Model:
    """The model with all values and compliances changed by a step."""
    effects, at = [], 0
    for effect in model.effects:
        least = [p.least for p in source(effect.key).parameters]
        values = np.maximum(np.add(effect.values, step[at : at + len(effect.values)]), least)
        effects.append(replace(effect, values=tuple(values.tolist())))
        at += len(effect.values)
    unit, change = model.mechanism, step[at : at + len(SOFTENING)]
    return replace(model, mechanism=softened(_gears(unit), change) if change.any() else unit, effects=tuple(effects))


def fitted(fit: Fit, *, steps: int = 12, free: Flags | None = None, enough: float = 0.05) -> Fit:
    """Levenberg-Marquardt steps from a state.

    Parameters
    ----------
    fit : Fit
    steps : int
        At most.
    free : ndarray of bool, shape (k,), optional
        Which values may move; all that have a prior that lets them.
    enough : float
        Fall of the objective below which it has settled.
    """
    backlash = soft_values(fit.run_set.unit)[SOFTENING.index("gear_backlash")]
    reach = np.array(
        [0.5 * p.plausible for e in fit.model.effects for p in source(e.key).parameters] + [0.35] * 6
        + [backlash + 1e-3, 0.1, 0.1, 0.5] + [np.inf] * len(fit.run_set.zeros)
    )  # fmt: skip
    damping = 0.0
    for _ in range(steps):
        step, gain = fit.proposal if free is None and not damping else proposed(fit, free, damping)
        part = min(1.0, 1 / max(float((np.abs(step) / reach).max()), 1e-300))
        if gain < enough:
            return replace(fit, converged=True)
        try:
            trial = evaluated(fit.run_set, stepped(fit.model, part * step), fit.declared, fit.waves)
        except NotConvergedError:
            trial = None
        fallen = -math.inf if trial is None else fit.objective - trial.objective
        expected = promised(fit, part * step)
        if fallen > _TRUE * expected:
            damping = damping / 10 if damping > 1e-6 else 0.0
        elif fallen < (1 - _TRUE) * expected:
            damping = max(damping * (3 if fallen > 0 else 10), 1e-3)
        if trial is not None and fallen > 0:
            fit = trial
            if fallen < enough:
                return replace(fit, converged=True)
        elif damping > 1e3:
            break
    return replace(fit, converged=False)


def fitted_from_coarse(fit: Fit) -> Fit:
    """The fit to every sample, by way of the coarse grid."""
    coarse = fitted(onto(fit.run_set.coarse, fit))
    return fitted(evaluated(fit.run_set, coarse.model, fit.declared))


def bounds(fit: Fit) -> tuple[Array, Array]:
    """How far each value may go down and up: sizes that have no sign, backlash, exponents, shape (k,) each."""
    soft, zeros = SOFT_BOUNDS - soft_values(fit.model.mechanism)[:, None], [math.inf] * len(fit.run_set.zeros)
    down = [p.least - v for e in fit.model.effects for p, v in zip(source(e.key).parameters, e.values, strict=True)]
    low = np.array([*down, *soft[:, 0], *(-end for end in zeros)])
    high = np.array([*(math.inf for _ in down), *soft[:, 1], *zeros])
    return np.minimum(low, 0.0), np.maximum(high, 0.0)


def proposed(fit: Fit, free: Flags | None = None, damping: float = 0.0) -> tuple[Array, float]:
    """Step that lowers the objective most, as far as the prediction is linear, and by how much it should fall.

    A value that would go beyond its bound goes that far, and the others make the best of it.
    """
    weights, departure = fit.pull, fit.departure
    vary = fit.free if free is None else free & fit.free
    low, high = bounds(fit)
    step, scale = np.zeros(weights.size), fit.scale
    for _ in range(4):
        held, step = vary.copy(), np.zeros(weights.size)
        while held.any():
            right = (fit.moment - fit.gram @ np.where(held, 0.0, step))[held] / scale - weights[held] * departure[held]
            step[held] = solved(fit.gram[held][:, held] / scale, right, weights[held], damping)
            beyond = held & ((step < low) | (step > high))
            if not beyond.any():
                break
            step = np.clip(step, low, high)
            held &= ~beyond
        again = scale_of(left_by(fit, step), fit.bound, fit.run_set.policy)
        if again > 0.99 * scale:
            break
        scale = again
    return step, promised(fit, step)


def solved(gram: Array, moment: Array, weights: Array, damping: float | Array = 0.0) -> Array:
    """Step that a Gram matrix and priors' weights make of a moment, all values in units of their own; or a stack.

    Parameters
    ----------
    gram : ndarray, shape (..., k, k)
    moment, weights : ndarray, shape (..., k)
    damping : float
        Share by which each value's own entry is more.
    """
    own = gram.copy()
    diagonal = np.einsum("...ii->...i", own)
    diagonal += weights
    diagonal *= 1 + damping
    size = np.sqrt(np.maximum(diagonal, 1e-300))
    own /= size[..., :, None] * size[..., None, :]
    diagonal += _TRACE
    return np.asarray(np.linalg.solve(own, (moment / size)[..., None])[..., 0] / size)


def left_by(fit: Fit, step: Array) -> float:
    """Squares that a step leaves, as far as the prediction is linear."""
    return max(float(fit.data - 2 * step @ fit.moment + step @ fit.gram @ step), 1e-9)


def promised(fit: Fit, step: Array) -> float:
    """Fall of the objective after a step, as far as the prediction is linear."""
    left = counted(left_by(fit, step), fit.bound, fit.run_set.policy)
    return fit.objective - left - float(fit.pull @ (fit.departure + step) ** 2)


def with_estimated_noise(fit: Fit, *, calm: bool = False) -> Fit:
    """The same sizes under the noise that their residual shows, `calm` where nothing else is left."""
    records, rests = fit.run_set.records, _left_as_noise(fit)
    total, used = float(sum(r.kept.sum() for r in records)), float(fit.free.sum())
    shares = [used * float(r.kept.sum()) / total + len(r.nuisance) for r in records]
    three = zip(records, rests, shares, strict=True)
    return _with_noises(fit, [fit.run_set.noise_in(*one, calm=calm) for one in three])


def with_walk(fit: Fit, like: Fit) -> Fit:
    """The same sizes under the noise of a fit, with the random walk beside it that their residual shows."""
    three = zip(like.run_set.records, fit.run_set.records, _left_as_noise(fit), strict=True)
    return _with_noises(fit, [walking(one.noise, rest, r.kept) for one, r, rest in three if one.noise])


def with_noise_of(fit: Fit, like: Fit) -> Fit:
    """The same sizes under the noise of another fit."""
    return _with_noises(fit, [record.noise for record in like.run_set.records])


def _with_noises(fit: Fit, noises: Sequence[RunNoise | None]) -> Fit:
    records = [replace(record, noise=noise) for record, noise in zip(fit.run_set.records, noises, strict=True)]
    return evaluated(fit.run_set.with_records(records), fit.model, fit.declared, fit.waves)


def _left_as_noise(fit: Fit) -> list[Array]:
    """Residual of each run, less what offset, slips and lines make of it."""
    return [r.told_as_noise(rest) for r, rest in zip(fit.run_set.records, fit.residual, strict=True)]


def first_state(run_set: RunSet, model: Model, declared: Model) -> Fit:
    """The first state: noise of what the model leaves as it stands."""
    flat = [replace(r, noise=run_set.noise_in(r, r.told_as_noise(r.error), len(r.nuisance))) for r in run_set.records]
    return with_estimated_noise(evaluated(run_set.with_records(flat), model, declared))


def onto(run_set: RunSet, fit: Fit) -> Fit:
    """The same sizes on another set of runs, or on its own with its rows."""
    if fit.run_set is run_set and fit.rows:
        return fit
    near = all(a.turn == b.turn for a, b in zip(run_set.conditions, fit.run_set.conditions, strict=True))
    return evaluated(run_set, fit.model, fit.declared, fit.waves if near else None)


def as_declared(fit: Fit) -> Fit:
    """Declared sizes and stiffness back at what was declared, if they can be; what was added stays."""
    model = replace(fit.declared, effects=(*fit.printed, *fit.added))
    try:
        return evaluated(fit.run_set, model, fit.declared, fit.waves)
    except NotConvergedError:  # what was added stands on the stiffness that was fitted with it
        return fit


def without_effect(fit: Fit, number: int) -> Fit:
    """The state without one of the added effects' part, the contacts as they are with it."""
    own = np.arange(fit.moment.size)[fit.places(number)]
    values, kept = np.array(fit.added[number].values), np.delete(np.arange(fit.moment.size), own)
    rows = [np.concatenate([(white[0] + values @ white[1 + own])[None], white[1 + kept]]) for white in fit.rows]
    return replace(
        fit, model=fit.model_with(instead_of=number), rows=tuple(rows),
        residual=tuple(rest + values @ raw[own] for rest, raw in zip(fit.residual, fit.raw, strict=True)),
        raw=tuple(raw[kept] for raw in fit.raw), data=sum(float(white[0] @ white[0]) for white in rows),
        gram=fit.gram[np.ix_(kept, kept)], moment=(fit.moment + fit.gram[:, own] @ values)[kept],
    )  # fmt: skip
