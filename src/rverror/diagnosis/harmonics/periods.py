"""A reducer's runs beside its declared model: fits made once, the residual's noise and lines, and periods left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.chance import chi_square, student
from rverror.diagnosis.harmonics.fit import Fit, joint_fit, priors
from rverror.diagnosis.harmonics.runs import FitRun, coarse, independent_samples, whitened
from rverror.diagnosis.policy import Policy
from rverror.diagnosis.result import Candidate, Line, Residual
from rverror.diagnosis.search import Name
from rverror.geartrain.kinematics import fundamental_orders, true_period
from rverror.geartrain.mechanism import Reducer
from rverror.model.catalogue import source
from rverror.model.compose import effect_values
from rverror.model.effects import Effect, Model
from rverror.runs.spectrum import amplitude, frames_of_order, harmonics
from rverror.statics.prediction import Prediction


@dataclass(frozen=True, eq=False)
class Periods:
    """Runs in whole periods, and the declared model that is fitted to them."""

    model: Model
    unit: Reducer
    runs: Sequence[FitRun]
    policy: Policy
    _made: dict[tuple[Any, ...], Fit] = field(default_factory=dict, repr=False)

    @property
    def turns(self) -> int:
        """Output turns of one period."""
        return true_period(self.unit)

    @property
    def declared(self) -> int:
        """Number of declared parameters."""
        return sum(len(e.values) for e in self.model.effects)

    @cached_property
    def levels(self) -> list[Sequence[FitRun]]:
        """The runs on few angles, on more, and as they are."""
        return [*([coarse(run, points) for run in self.runs] for points in self.policy.coarse), list(self.runs)]

    def fit(
        self,
        added: Sequence[Effect],
        *,
        start: Array,
        runs: Sequence[FitRun] | None = None,
        near: Sequence[Prediction | None] = (),
        vary_last: int | None = None,
        most_steps: int = 25,
    ) -> Fit:
        """`joint_fit`, made once: searches of more candidates, or from more sizes, come by the same places."""
        runs = self.runs if runs is None else runs
        names = tuple((e.key, *e.indices.items()) for e in added)
        angles = tuple(run.conditions.theta.size for run in runs)
        where = (names, angles, start.tobytes(), vary_last, most_steps)
        if where not in self._made:
            self._made[where] = joint_fit(
                self.model, added, runs, start=start, near=near, vary_last=vary_last, most_steps=most_steps,
                policy=self.policy,
            )  # fmt: skip
        return self._made[where]

    def rests(self, fit: Fit, beside: Sequence[Array] = ()) -> list[Array]:
        """Residual of each run's periods, shape (periods, n); `beside` was taken off beforehand and counts too."""
        more = beside or [np.zeros_like(run.values) for run in self.runs]
        return [
            run.values + part - prediction.transmission_error
            for run, part, prediction in zip(self.runs, more, fit.predictions, strict=True)
        ]

    def _white(self, fit: Fit) -> list[Array]:
        """Residual of each run's mean period in standard deviations, shape (2, m) each."""
        means = [rest.mean(axis=0) for rest in self.rests(fit)]
        return [run.whiten(mean, run.periods).reshape(2, -1) for run, mean in zip(self.runs, means, strict=True)]

    def noise_scale(self, fit: Fit) -> float:
        """How much larger than estimated the noise is, from the bulk of the residual lines; 1 or more."""
        power = np.concatenate([(w**2).sum(axis=0) for w in self._white(fit)])
        return max(1.0, float(np.median(power)) / chi_square(0.5, 2))

    def lines(self, fit: Fit) -> tuple[Line, ...]:
        """Lines of the residual that noise does not explain, the strongest first."""
        whitened = self._white(fit)
        count = min(w.shape[1] for w in whitened)
        power = sum((w[:, :count] ** 2).sum(axis=0) for w in whitened)
        limit = chi_square(self.policy.false_alarm / count, 2 * len(whitened)) * self.noise_scale(fit)
        sizes, waves = [], []
        for run, rest in zip(self.runs, self.rests(fit), strict=True):
            n = run.conditions.theta.size
            lines = harmonics(rest.mean(axis=0))[:, :count]
            sizes.append(amplitude(lines, n))
            to_zero = np.exp(-1j * np.arange(1, count + 1) / self.turns * run.conditions.theta[0])
            waves.append((lines[0] + 1j * lines[1]) * np.sqrt(2 / n) * to_zero)
        size, wave = np.mean(sizes, axis=0), np.mean(waves, axis=0)  # wave: of cos, and of -sin
        found = np.flatnonzero((power > limit) & (size > self.policy.accuracy))
        significant = [self._line(int(h), float(size[h]), complex(wave[h])) for h in found]
        return tuple(sorted(significant, key=lambda line: -line.amplitude))

    def _line(self, at: int, size: float, wave: complex) -> Line:
        order = (at + 1) / self.turns
        shares = [np.zeros(run.noise.size) for run in self.runs]
        for share, run in zip(shares, self.runs, strict=True):
            share[at] = run.noise[at] / run.periods * 2 / run.conditions.theta.size / len(self.runs) ** 2
        reach = self.reach(sum(float(share[at]) for share in shares), independent_samples(self.runs, shares))
        frames = frames_of_order(self.unit, order, tolerance=self.policy.order_tolerance)
        return Line(order, size, max(size - reach, 0.0), size + reach, tuple(frames), wave.real, -wave.imag)

    def reach(self, variance: float, samples: float) -> float:
        """Half width of the interval of a value whose variance is known from so many independent samples."""
        return float(np.sqrt(variance)) * student((1 - self.policy.confidence) / 2, samples)

    def own_lines(self, fit: Fit, added: Sequence[Effect]) -> list[Line]:
        """Significant lines that one of the added effects should have explained: of its frame, or where it shows."""
        claimed, bases = [], []
        for at, effect in enumerate(added, len(fit.model.effects) - len(added)):
            entry = source(effect.key)
            claimed += [*entry.orders(self.unit, effect.indices), *self.orders(fit, at)]
            if not entry.at_output and entry.frame in fundamental_orders(self.unit):
                bases.append(fundamental_orders(self.unit)[entry.frame])
        return [
            line
            for line in self.lines(fit)
            if any(abs(line.order - order) < self.policy.order_tolerance for order in claimed)
            or any(self._is_multiple(line.order, base) for base in bases)
        ]

    def orders(self, fit: Fit, at: int) -> tuple[float, ...]:
        """Orders at which an effect changes the prediction, the strongest first."""
        effects = fit.model.effects
        without = replace(fit.model, effects=effects[:at] + effects[at + 1 :])
        run, prediction = self.runs[0], fit.predictions[0]
        wave = prediction.transmission_error - run.predictor.predict(without, prediction).transmission_error
        size = amplitude(harmonics(wave), wave.size)
        strong = np.flatnonzero(size > max(self.policy.leading * size.max(), 1e-3 * self.policy.accuracy))
        leading = strong[np.argsort(-size[strong])][: self.policy.leading_orders]
        return tuple(float((h + 1) / self.turns) for h in leading)

    def of_discs(self, lines: Sequence[Line]) -> bool:
        """Tell whether the large ones of some lines are of the discs' frame; small ones may be folded."""
        large = [line for line in lines if line.amplitude > self.policy.large_line * lines[0].amplitude]
        return all(self._is_multiple(line.order, fundamental_orders(self.unit)["disc"]) for line in large)

    def _is_multiple(self, order: float, base: float) -> bool:
        return order > base / 2 and abs(order - base * round(order / base)) < self.policy.order_tolerance


@dataclass(frozen=True)
class FoldSums:
    """Normal equations of the seen and of the left-out periods, and the declared sizes' priors."""

    gram: Array
    moment: Array
    test_gram: Array
    test_moment: Array
    known: npt.NDArray[np.bool_]  # which of the first parameters were declared
    change: Array  # declared less current size of those
    weight: Array  # of a squared change

    def score(self, at: npt.NDArray[np.intp]) -> float:
        """Weighted squares of the left-out data, less a constant, and of the declared sizes' changes."""
        step = _solve(self.gram[np.ix_(at, at)], self.moment[at])
        data = step @ self.test_gram[np.ix_(at, at)] @ step - 2 * step @ self.test_moment[at]
        return float(data + self.weight @ (self.change - step[: self.known.size][self.known]) ** 2)


def ranked(periods: Periods, candidates: Sequence[Name], state: Fit, added: Sequence[Effect]) -> tuple[Candidate, ...]:
    """Score candidates by their linear influence, jointly with all free parameters, on periods left out.

    Parameters
    ----------
    periods : Periods
    candidates : sequence of Name
    state : Fit
        Where the influences are taken.
    added : sequence of Effect
        That the fit has beside the declared ones.

    Returns
    -------
    tuple of Candidate
        The best first.
    """
    runs = periods.runs
    pairs = list(zip(runs, state.predictions, strict=True))
    blocks = [run.predictor.influences(state.model, candidates, prediction) for run, prediction in pairs]
    size = [len(source(key).parameters) for key, _ in candidates]
    ends = np.cumsum(size)
    sigma = priors(periods.model.effects, added)
    free = sigma > 0
    offset = effect_values((*periods.model.effects, *added)) - effect_values(state.model.effects)
    first, known = int(free.sum()), np.isfinite(sigma[free])
    change, weight = offset[free][known], state.misfit.scale * sigma[free][known] ** -2
    columns = [np.concatenate([p.matrix[free], rows]) for p, rows in zip(state.predictions, blocks, strict=True)]
    once, others = [1] * len(runs), [run.periods - 1 for run in runs]
    train, test = whitened(runs, columns, others), whitened(runs, columns, once)
    gram, test_gram = train @ train.T, test @ test.T
    gram[np.arange(first)[known], np.arange(first)[known]] += weight
    folds = max(run.periods for run in runs)
    gains = np.zeros((folds, len(candidates)))
    for fold in range(folds):
        kept, left = [], []
        for run, rest in zip(runs, periods.rests(state), strict=True):
            keep = np.arange(run.periods) != fold % run.periods
            kept.append(rest[keep].mean(axis=0))
            left.append(rest[~keep][0])
        moment = train @ whitened(runs, kept, others)
        moment[:first][known] += weight * change
        test_moment = test @ whitened(runs, left, once)
        left_out = FoldSums(gram, moment, test_gram, test_moment, known, change, weight / folds)
        base = left_out.score(np.arange(first))
        for i, (end, count) in enumerate(zip(ends, size, strict=True)):
            at = np.concatenate([np.arange(first), first + np.arange(end - count, end)])
            gains[fold, i] = base - left_out.score(at)
    total = gains.sum(axis=0)
    # rounded, so that of equal ones the first of the catalogue goes first on every machine
    order = np.argsort(-np.round(total / max(float(np.abs(total).max()), 1.0), 9), kind="stable")
    return tuple(
        Candidate(key, indices, float(total[i]), tuple(float(gain) for gain in gains[:, i]))
        for i in order
        for key, indices in [candidates[i]]
    )


def residual(periods: Periods, fit: Fit, *, hold: bool = False, beside: Sequence[Array] = ()) -> Residual:
    """Size of the residual, and of periods left out of the fit (nothing is fitted but offsets where `hold`).

    `beside` is what was taken off each run beforehand, and counts as residual.
    """
    rest = np.concatenate([(rest - rest.mean()).ravel() for rest in periods.rests(fit, beside)])
    left = np.concatenate([part.ravel() for part in left_out(periods, fit, hold=hold, beside=beside)])
    return Residual(float(np.sqrt(np.mean(rest**2))), float(np.ptp(rest)), float(np.sqrt(np.mean(left**2))))


def left_out(periods: Periods, fit: Fit, *, hold: bool = False, beside: Sequence[Array] = ()) -> list[Array]:
    """Residual of each run's periods, each with sizes and offset from the others alone, (periods, n) each."""
    runs = list(periods.runs)
    if beside:
        runs = [replace(run, values=run.values + part) for run, part in zip(runs, beside, strict=True)]
    rests = periods.rests(fit, beside)
    free = fit.free if not hold else np.zeros_like(fit.free)
    effects = periods.model.effects
    added = fit.model.effects[len(effects) :]
    sigma = priors(effects, added)[free]
    known = np.isfinite(sigma)
    weight = fit.misfit.scale * sigma**-2
    change = (effect_values((*effects, *added)) - effect_values(fit.model.effects))[free]
    others = [run.periods - 1 for run in runs]
    matrix = whitened(runs, [prediction.matrix[free] for prediction in fit.predictions], others)
    gram = matrix @ matrix.T
    gram[known, known] += weight[known]
    left = [np.zeros_like(run.values) for run in runs]
    for fold in range(max(run.periods for run in runs)):
        kept = [rest[np.arange(len(rest)) != fold % len(rest)].mean(axis=0) for rest in rests]
        moment = matrix @ whitened(runs, kept, others)
        moment[known] += weight[known] * change[known]
        step = _solve(gram, moment)
        for out, rest, prediction in zip(left, rests, fit.predictions, strict=True):
            if fold < len(rest):
                last = rest - step @ prediction.matrix[free]
                out[fold] = last[fold] - last[np.arange(len(rest)) != fold].mean()
    return left


def _solve(gram: Array, moment: Array) -> Array:
    scale = np.sqrt(np.diag(gram))
    scale = np.where(scale > 0, scale, 1.0)
    step = np.linalg.lstsq(gram / np.outer(scale, scale), moment / scale, rcond=1e-10)[0] / scale
    return np.asarray(step, dtype=np.float64)
