"""Joint fit of a model to whole periods of several runs, weighted by the noise between the periods."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from rverror.action_line import Array
from rverror.catalogue import source
from rverror.compose import effect_values
from rverror.equilibrium import NotConvergedError
from rverror.model import Effect, Model
from rverror.prediction import Conditions, Prediction, Predictor
from rverror.spectrum import harmonics, noise_spectrum

_LONGEST_STEP = 0.5  # of the size that a workshop can make
_NO_GAIN = 0.02  # of the sum of squares: a seventh of a standard deviation


@dataclass(frozen=True)
class FitRun:
    """One run, cut into whole periods.

    Attributes
    ----------
    name : str
    predictor : Predictor
        At the samples of one period.
    values : ndarray, shape (periods, n)
        Measured transmission error of each period, rad.
    noise : ndarray, shape (m,)
        Variance of one harmonic coefficient of one period, rad^2.
    """

    name: str
    predictor: Predictor
    values: Array
    noise: Array

    @property
    def conditions(self) -> Conditions:
        """Where and how the run was measured."""
        return self.predictor.conditions

    @property
    def periods(self) -> int:
        """Number of whole periods."""
        return len(self.values)

    def weight(self, periods: int) -> Array:
        """Inverse standard deviation of a coefficient of the mean of that many periods, shape (m,)."""
        return np.asarray(np.sqrt(periods / self.noise), dtype=np.float64)

    def whiten(self, values: Array, periods: int) -> Array:
        """Harmonics of rows over one period, in standard deviations of a mean of that many, shape (..., 2 m)."""
        scaled = harmonics(values) * self.weight(periods)
        return scaled.reshape(*scaled.shape[:-2], 2 * scaled.shape[-1])


def coarse(run: FitRun, points: int) -> FitRun:
    """The run on fewer angles, without the harmonics that they could not hold.

    Parameters
    ----------
    run : FitRun
    points : int
        Angles a period to keep; the run itself where it has no more.

    Returns
    -------
    FitRun
    """
    n = run.conditions.theta.size
    stride = n // points
    if stride < 2 or n % stride:
        return run
    kept = n // stride
    lines = np.fft.rfft(run.values, axis=1)[:, : kept // 2 + 1] / stride
    values = np.fft.irfft(lines, kept, axis=1)
    time = run.conditions.time
    conditions = replace(
        run.conditions, theta=run.conditions.theta[::stride], time=None if time is None else time[::stride]
    )
    predictor = Predictor(run.predictor.mechanism, conditions)
    return FitRun(run.name, predictor, values, run.noise[: (kept - 1) // 2] / stride)


def fit_run(name: str, predictor: Predictor, values: Array) -> FitRun:
    """Make a `FitRun` and take its noise from what differs between the periods."""
    noise = noise_spectrum(values)
    least = max(float(noise.mean()) * 1e-6, 1e-30)  # noise-free simulated runs have no spread at all
    return FitRun(name, predictor, values, np.maximum(noise, least))


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
    chi2 : float
        Weighted sum of squares of the residual harmonics, plus that of the declared sizes' changes.
    prospect : float
        Sum of squares that one linear step of all free parameters would leave: what a fit of all of them may reach.
    predictions : tuple of Prediction
        One per run.
    converged : bool
    """

    model: Model
    free: npt.NDArray[np.bool_]
    covariance: Array
    chi2: float
    prospect: float
    predictions: tuple[Prediction, ...]
    converged: bool


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
    vary_last_only: bool = False,
    most_steps: int = 25,
) -> Fit:
    """Fit added effects freely, and declared ones within their uncertainty, to all runs at once.

    Levenberg-Marquardt steps on harmonics in units of their noise; the offset of each run drops out with its mean.

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
    vary_last_only : bool
        Hold everything but the last added effect.  Parts of one frame look alike to first order, so a new effect
        that is fitted at once with all others can lodge them in a false minimum; fitted alone first, it does not.
        It is then held to sizes that a workshop can make, as by a measurement of that uncertainty.
    most_steps : int
        Steps after which the fit gives up as not converged.

    Returns
    -------
    Fit
    """
    effects = (*model.effects, *added)
    sigma = priors(model.effects, added)
    varied = free = sigma > 0
    if vary_last_only:
        varied = free.copy()
        varied[: -len(added[-1].values)] = False
    declared = effect_values(effects)
    prior_weight = np.where(np.isfinite(sigma) & free, 1 / np.where(free, sigma, 1.0), 0.0)
    plausible = np.array([p.plausible for e in effects for p in source(e.key).parameters])
    if vary_last_only:  # or parameters that act alike run away from each other
        last = slice(-len(added[-1].values), None)
        declared[last], prior_weight[last] = 0.0, 1 / plausible[last]
    measured = np.concatenate([run.whiten(run.values.mean(axis=0), run.periods) for run in runs])
    reach = plausible * _LONGEST_STEP

    def state(values: Array, near: Sequence[Prediction | None]) -> _State:
        trial = replace(model, effects=with_values(effects, values))
        predictions = tuple(run.predictor.predict(trial, start) for run, start in zip(runs, near, strict=True))
        pairs = list(zip(runs, predictions, strict=True))
        residual = measured - np.concatenate([r.whiten(p.transmission_error, r.periods) for r, p in pairs])
        matrix = np.concatenate([r.whiten(p.matrix, r.periods) for r, p in pairs], axis=1).T
        residual = np.concatenate([residual, (declared - values) * prior_weight])
        return _State(predictions, residual, np.concatenate([matrix, np.diag(prior_weight)]))

    values, damping, converged = (effect_values(effects) if start is None else start).copy(), 0.0, not varied.any()
    now = state(values, near or [None] * len(runs))
    for _ in range(most_steps):
        if converged:
            break
        step = np.zeros(values.size)
        step[varied] = _damped_step(now.matrix[:, varied], now.residual, damping)
        step *= min(1.0, 1 / max(float((np.abs(step) / reach).max()), 1e-300))
        if now.chi2 - float(((now.residual - now.matrix @ step) ** 2).sum()) < _NO_GAIN:
            converged = True
            break
        try:
            trial = state(values + step, now.predictions)
        except NotConvergedError:
            trial = None
        if trial is not None and trial.chi2 < now.chi2:
            converged = now.chi2 - trial.chi2 < _NO_GAIN
            values, now = values + step, trial
            damping = damping / 10 if damping > 1e-6 else 0.0
        else:
            damping = max(damping * 10, 1e-3)
            if damping > 1e4:
                break
    covariance = np.zeros((values.size, values.size))
    left = now.chi2
    if free.any():
        covariance[np.ix_(free, free)] = covariance_of(now.matrix[:, free], reach[free] / _LONGEST_STEP)
        step = _damped_step(now.matrix[:, free], now.residual, 0.0)
        left = float(((now.residual - now.matrix[:, free] @ step) ** 2).sum())
    fitted = replace(model, effects=with_values(effects, values))
    return Fit(fitted, free, covariance, now.chi2, left, now.predictions, converged)


@dataclass(frozen=True)
class _State:
    """Predictions, residual and its change with the parameters, in standard deviations; the last rows are priors."""

    predictions: tuple[Prediction, ...]
    residual: Array
    matrix: Array

    @property
    def chi2(self) -> float:
        return float(self.residual @ self.residual)


def _damped_step(matrix: Array, residual: Array, damping: float) -> Array:
    scale = np.linalg.norm(matrix, axis=0)
    scale = np.where(scale > 0, scale, 1.0)
    normal = (matrix / scale).T @ (matrix / scale) + damping * np.eye(scale.size)
    step = np.linalg.lstsq(normal, (matrix / scale).T @ residual, rcond=1e-10)[0] / scale
    return np.asarray(step, dtype=np.float64)


def covariance_of(matrix: Array, plausible: Array | float = 1.0) -> Array:
    """Covariance of least-squares parameters; infinite variance where the data hold nothing of a parameter.

    That is where a size that a workshop can make changes the data by less than a thousandth of their noise.
    """
    scale = np.linalg.norm(matrix, axis=0)
    known = scale * plausible > 1e-3
    covariance = np.zeros((scale.size, scale.size))
    covariance[~known, ~known] = np.inf
    if known.any():
        scaled = matrix[:, known] / scale[known]
        inverse = np.linalg.pinv(scaled.T @ scaled, rcond=1e-12, hermitian=True)
        covariance[np.ix_(known, known)] = inverse / np.outer(scale[known], scale[known])
    return covariance
