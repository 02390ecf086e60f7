"""Joint fit of a model to whole periods of several runs, weighted by the noise between the periods."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.diagnosis.harmonics.runs import FitRun, whitened
from rverror.diagnosis.policy import POLICY, Policy
from rverror.model.catalogue import source
from rverror.model.compose import effect_values
from rverror.model.effects import Effect, Model
from rverror.statics.loaded_state import NotConvergedError
from rverror.statics.prediction import Prediction

_LONGEST_STEP = 0.5  # of the size that a workshop can make
_REWEIGHTED = 6
_NO_GAIN = 0.02  # of the sum of squares: a seventh of a standard deviation
_NO_STEP = 2e-4  # that one more step promises


@dataclass(frozen=True)
class Misfit:
    """Weighted squares of the residual harmonics and of the declared sizes' changes, and the number of harmonics.

    `chance` is the policy's `by_chance`.
    """

    data: float
    prior: float
    count: int
    chance: float = POLICY.by_chance

    @property
    def by_chance(self) -> float:
        """Sum of squares that noise alone hardly exceeds."""
        return self.count + self.chance * math.sqrt(2 * self.count)

    @property
    def scale(self) -> float:
        """How many times more than noise alone the residual has; 1 where it may be noise."""
        return max(1.0, self.data / self.by_chance)

    @property
    def objective(self) -> float:
        """Twice the negative logarithm of the likelihood, the residual's variance being the noise's or more.

        What is not explained yet is noise too: as plain squares it would drive declared sizes away by many times their
        uncertainty, to make up for what the model lacks.
        """
        return self.data / self.scale + self.by_chance * math.log(self.scale) + self.prior


@dataclass(frozen=True)
class Fit:
    """A model fitted to runs.

    Attributes
    ----------
    model : Model
        With the fitted sizes.
    free : ndarray of bool, shape (parameters,)
        Which parameters were varied; the others were declared without uncertainty.
    covariance : ndarray, shape (parameters, parameters)
        Zero for fixed parameters, infinite on the diagonal for those that the runs do not determine.
    misfit : Misfit
    prospect : Misfit
        What one linear step of all free parameters would leave: what a fit of all of them may reach.
    predictions : tuple of Prediction
        One per run.
    converged : bool
    """

    model: Model
    free: npt.NDArray[np.bool_]
    covariance: Array
    misfit: Misfit
    prospect: Misfit
    predictions: tuple[Prediction, ...]
    converged: bool

    @property
    def objective(self) -> float:
        """That of the misfit: the less, the better."""
        return self.misfit.objective


def with_values(effects: Sequence[Effect], values: Array) -> tuple[Effect, ...]:
    """Effects with the values of all parameters replaced, in order."""
    result, at = [], 0
    for effect in effects:
        count = len(effect.values)
        result.append(replace(effect, values=tuple(float(v) for v in values[at : at + count])))
        at += count
    return tuple(result)


def priors(declared: Sequence[Effect], added: Sequence[Effect]) -> Array:
    """Standard deviation of each parameter before the fit: the declared uncertainty, infinite for added effects."""
    sigmas = [e.uncertainty or 0.0 for e in declared for _ in e.values]
    return np.array(sigmas + [np.inf for e in added for _ in e.values], dtype=np.float64)


def joint_fit(
    model: Model,
    added: Sequence[Effect],
    runs: Sequence[FitRun],
    *,
    start: Array | None = None,
    near: Sequence[Prediction | None] = (),
    vary_last: int | None = None,
    most_steps: int = 25,
    policy: Policy = POLICY,
) -> Fit:
    """Fit added effects freely, and declared ones within their uncertainty, to all runs at once.

    Levenberg-Marquardt steps on harmonics in units of their noise; the offset of a run drops out with its mean, but for
    runs that share a zero.

    Parameters
    ----------
    model : Model
        The declared model.
    added : sequence of Effect
        Effects to add, with starting sizes.
    runs : sequence of FitRun
    start : ndarray, shape (parameters,), optional
        Sizes to start from; those of the effects where left out.  The declared sizes stay the centre of their
        uncertainty.
    near : sequence of Prediction, optional
        Of a similar model, one per run: the equilibrium starts from there.
    vary_last : int, optional
        Hold everything but so many of the last added effects.  Parts of one frame look alike to first order, so a new
        effect that is fitted at once with all others can lodge them in a false minimum; fitted alone first, it does
        not.  It is then held to sizes that a workshop can make, as by a measurement of that uncertainty.
    most_steps : int
        Steps after which the fit gives up as not converged.
    policy : Policy
        `by_chance` and `seen`.
    """
    effects = (*model.effects, *added)
    sigma = priors(model.effects, added)
    varied = free = sigma > 0
    last = slice(sum(len(e.values) for e in effects[: len(effects) - (vary_last or 0)]), None)
    if vary_last is not None:
        varied = np.zeros_like(free)
        varied[last] = free[last]
    declared = effect_values(effects)
    prior_weight = np.where(np.isfinite(sigma) & free, 1 / np.where(free, sigma, 1.0), 0.0)
    plausible = np.array([p.plausible for e in effects for p in source(e.key).parameters])
    if vary_last is not None:  # or parameters that act alike run away from each other
        declared[last], prior_weight[last] = 0.0, 1 / plausible[last]
    periods = [run.periods for run in runs]
    measured = whitened(runs, [run.values.mean(axis=0) for run in runs], periods)
    reach = plausible * _LONGEST_STEP

    def state(values: Array, near: Sequence[Prediction | None]) -> _State:
        trial = replace(model, effects=with_values(effects, values))
        predictions = tuple(run.predictor.predict(trial, start) for run, start in zip(runs, near, strict=True))
        residual = measured - whitened(runs, [p.transmission_error for p in predictions], periods)
        matrix = whitened(runs, [p.matrix for p in predictions], periods).T
        return _State(predictions, residual, matrix, declared - values, prior_weight, plausible, policy)

    values, damping, converged = (effect_values(effects) if start is None else start).copy(), 0.0, not varied.any()
    now = state(values, near or [None] * len(runs))
    for _ in range(most_steps):
        if converged:
            break
        step = now.step(varied, damping)
        step *= min(1.0, 1 / max(float((np.abs(step) / reach).max()), 1e-300))
        if now.misfit.objective - now.after(step).objective < _NO_STEP:
            converged = True
            break
        try:
            trial = state(values + step, now.predictions)
        except NotConvergedError:
            trial = None
        if trial is not None and trial.misfit.objective < now.misfit.objective:
            converged = now.misfit.objective - trial.misfit.objective < _NO_GAIN
            values, now = values + step, trial
            damping = damping / 10 if damping > 1e-6 else 0.0
        else:
            damping = max(damping * 10, 1e-3)
            if damping > 1e4:
                break
    covariance = np.zeros((values.size, values.size))
    if free.any():
        matrix, _ = now.weighted(now.misfit.scale)
        covariance[np.ix_(free, free)] = covariance_of(matrix[:, free], plausible[free], seen=policy.seen)
    fitted = replace(model, effects=with_values(effects, values))
    prospect = now.after(now.step(free, 0.0))
    return Fit(fitted, free, covariance, now.misfit, prospect, now.predictions, converged)


@dataclass(frozen=True)
class _State:
    """Predictions, residual and its change with the parameters, in standard deviations; apart for data and priors."""

    predictions: tuple[Prediction, ...]
    residual: Array
    matrix: Array  # (values, parameters)
    change: Array  # of each parameter from where it was declared
    weight: Array  # of it
    plausible: Array  # size of each parameter
    policy: Policy

    @cached_property
    def misfit(self) -> Misfit:
        return self.after(np.zeros(self.change.size))

    def after(self, step: Array) -> Misfit:
        """Misfit that a step leaves, as far as the predictions are linear."""
        left, change = self.residual - self.matrix @ step, (self.change - step) * self.weight
        return Misfit(float(left @ left), float(change @ change), self.residual.size, self.policy.by_chance)

    def step(self, varied: npt.NDArray[np.bool_], damping: float) -> Array:
        """Change of the varied parameters that lowers the objective most, as far as the predictions are linear."""
        step, scale = np.zeros(self.change.size), self.misfit.scale
        # what shows in nothing would take any size
        seen = np.hypot(np.linalg.norm(self.matrix, axis=0), self.weight) * self.plausible > self.policy.seen
        varied = varied & seen
        if not varied.any():
            return step
        for _ in range(_REWEIGHTED):  # what the step explains is noise no more
            matrix, residual = self.weighted(scale)
            step[varied] = _damped_step(matrix[:, varied], residual, damping)
            before, scale = scale, self.after(step).scale
            if scale > 0.99 * before:
                break
        return step

    def weighted(self, scale: float) -> tuple[Array, Array]:
        """Matrix and residual of least squares with so many times the noise's variance."""
        root = math.sqrt(scale)
        return (
            np.concatenate([self.matrix / root, np.diag(self.weight)]),
            np.concatenate([self.residual / root, self.change * self.weight]),
        )


def _damped_step(matrix: Array, residual: Array, damping: float) -> Array:
    scale = np.linalg.norm(matrix, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    normal = (matrix / scale).T @ (matrix / scale) + damping * np.eye(scale.size)
    step = np.linalg.lstsq(normal, (matrix / scale).T @ residual, rcond=1e-10)[0] / scale
    return np.asarray(step, dtype=np.float64)


def covariance_of(matrix: Array, plausible: Array | float = 1.0, *, seen: float = POLICY.seen) -> Array:
    """Covariance of least-squares parameters; infinite variance where the data hold nothing of a parameter.

    That is where a size that a workshop can make changes the data by no more than `seen` of their noise.
    """
    scale = np.linalg.norm(matrix, axis=0)
    known = scale * plausible > seen
    covariance = np.zeros((scale.size, scale.size))
    covariance[~known, ~known] = np.inf
    if known.any():
        scaled = matrix[:, known] / scale[known]
        inverse = np.linalg.pinv(scaled.T @ scaled, rcond=1e-12, hermitian=True)
        covariance[np.ix_(known, known)] = inverse / np.outer(scale[known], scale[known])
    return covariance
