"""Joint least squares of terms under coloured noise, and what a term takes off samples left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rverror.base.arrays import Array
from rverror.base.chance import student
from rverror.diagnosis.samples.coloured import (
    Labels,
    distance,
    kept_share,
    lengths,
    normal,
    orthonormal,
    significant,
    solve,
    spectrum_freedom,
)
from rverror.diagnosis.samples.regressors import DECLARED, Term, implausible
from rverror.diagnosis.samples.runs import RunData


@dataclass(frozen=True, eq=False)
class SampleFit:
    """Terms and their joint fit.

    Attributes
    ----------
    terms : tuple of Term
    all_values : ndarray, shape (k,)
        Of all terms, one after another, core units.
    spread : ndarray, shape (k, k)
        Covariance of the values.
    residual : ndarray, shape (n,)
    weights : ndarray, shape (runs,)
        Of each run's squares.
    samples : ndarray, shape (k,)
        Number of independent samples, as each value sees the noise.
    confidence : float
        Of intervals.
    """

    terms: tuple[Term, ...]
    all_values: Array
    spread: Array
    residual: Array
    weights: Array
    samples: Array
    confidence: float

    def at(self, term: Term) -> slice:
        """Place of a term's values."""
        first = sum(t.size for t in self.terms[: self.terms.index(term)])
        return slice(first, first + term.size)

    def values(self, term: Term) -> Array:
        """Values of a term, core units."""
        return self.all_values[self.at(term)]

    def own_spread(self, term: Term) -> Array:
        """Covariance of a term's values."""
        return self.spread[self.at(term), self.at(term)]

    def own_samples(self, term: Term) -> float:
        """Number of independent samples behind a term."""
        return float(self.samples[self.at(term)].min())

    def significant(self, term: Term, accepted: float) -> bool:
        """Tell whether a term differs from 0 more than it does by chance."""
        return significant(self.values(term), self.own_spread(term), accepted, self.own_samples(term))

    def reach(self, term: Term, spread: Array) -> Array:
        """Half width of the interval of a value, or a sum of a term's values, with a variance."""
        return np.asarray(
            np.sqrt(spread) * student((1 - self.confidence) / 2, self.own_samples(term)), dtype=np.float64
        )

    def distance(self, term: Term) -> float:
        """Squared distance of a term from 0 in standard deviations."""
        return distance(self.values(term), self.own_spread(term))


def fitted(data: RunData, terms: Sequence[Term], *, noise: SampleFit | None = None) -> SampleFit:
    """Fit terms to all runs by least squares.

    Parameters
    ----------
    data : RunData
    terms : sequence of Term
    noise : SampleFit, optional
        Fit whose residual is the noise and whose weights the runs have; left out, those of this fit itself.
    """
    rows, signal = np.concatenate([t.rows for t in terms]), data.signal
    scale = lengths(rows)
    weights = np.ones(len(data.slices)) if noise is None else noise.weights
    if noise is None:
        residual = signal - solve(*_sums(data, rows / scale[:, None], weights)) / scale @ rows
        if len(data.slices) > 1:
            weights = _run_weights(data, residual)
            residual = signal - solve(*_sums(data, rows / scale[:, None], weights)) / scale @ rows
    else:
        residual = noise.residual
    equations = normal(rows, residual, data.slices, weights, floor=data.floor)
    means, sigmas = _priors(terms)
    prior = equations.prior_weights(sigmas)
    gram, moment = _sums(data, rows / scale[:, None], weights)
    values = solve(gram + np.diag(prior), moment + prior * means * scale) / scale
    left = signal - values @ rows
    squares = float((_root_weights(data, weights) * residual) @ (_root_weights(data, weights) * residual))
    most = sum(spectrum_freedom(at.stop - at.start) for at in data.slices)
    samples = np.clip(squares / np.maximum(equations.seen, 1e-300), data.policy.least_samples, most)
    return SampleFit(tuple(terms), values, equations.covariance(sigmas), left, weights, samples, data.policy.confidence)


@dataclass(frozen=True, eq=False)
class ScreenedTerm:
    """A term that the runs can tell from what is there.

    Attributes
    ----------
    term : Term
    gain : float
        Share of the residual's squares that it would take off.
    too_large : list of str
        Its parameters that would be larger than a workshop makes.
    """

    term: Term
    gain: float
    too_large: list[str]


def screened(data: RunData, fit: SampleFit, pool: Sequence[Term]) -> tuple[list[ScreenedTerm], list[Term]]:
    """Terms with what each would take off, the most telling first; and those that what is there makes up."""
    root = _root_weights(data, fit.weights)
    # a declared size that was measured wrong is missing too, so declared terms do not bar one of their waveform
    free = orthonormal(root * np.concatenate([t.rows for t in fit.terms if t.kind != DECLARED]))
    every = orthonormal(root * np.concatenate([t.rows for t in fit.terms]))
    found, barred = [], []
    for term in pool:
        rows, rest = root * term.rows, root * fit.residual
        if term in fit.terms:
            continue
        if kept_share(free, rows) < data.policy.apart:
            barred.append(term)
            continue
        left = rows - (rows @ free) @ free.T
        values = np.linalg.lstsq(left.T, rest - free @ (free.T @ rest), rcond=None)[0]
        gain = 1 - float(np.mean((rest - values @ left) ** 2)) / max(float(np.mean(rest**2)), 1e-300)
        too_large = implausible(term, np.asarray(values, dtype=np.float64), data.quantity)
        if not too_large or kept_share(every, rows) > data.policy.apart_implausible:
            found.append(ScreenedTerm(term, gain, too_large))
        else:
            barred.append(term)
    # rounded, so that of equal ones the first goes first
    return sorted(found, key=lambda s: -round(s.gain, 9)), barred


def held_out_gain(data: RunData, fit: SampleFit, trial: SampleFit) -> float:
    """What a trial takes off the squares of blocks of samples that its fit did not see.

    Returns
    -------
    float
        In variances of the trial's residual.
    """
    variance = float(np.mean(trial.residual**2)) + data.floor**2
    before, after = (held_out_squares(data, f.terms, trial) for f in (fit, trial))
    return (before - after) / variance


def held_out_squares(data: RunData, terms: Sequence[Term], noise: SampleFit) -> float:
    """Sum of squares of all blocks of samples, each left out of the fit that predicts it.

    Parameters
    ----------
    data : RunData
    terms : sequence of Term
    noise : SampleFit
        As in `fitted`.
    """
    rows = np.concatenate([t.rows for t in terms])
    means, sigmas = _priors(terms)
    scale, prior = lengths(rows), np.zeros(len(rows))
    if np.isfinite(sigmas).any():
        prior = normal(rows, noise.residual, data.slices, noise.weights, floor=data.floor).prior_weights(sigmas)
    unit = rows / scale[:, None]
    parts = [np.flatnonzero(data.labels == block) for block in range(int(data.labels.max()) + 1)]
    sums = [_sums(data, unit, noise.weights, part) for part in parts]
    gram, moment = sum(g for g, _ in sums) + np.diag(prior), sum(m for _, m in sums) + prior * means * scale
    squares = 0.0
    for (own, seen), part in zip(sums, parts, strict=True):
        values = solve(gram - own, moment - seen)
        squares += float(((data.signal[part] - values @ unit[:, part]) ** 2).sum())
    return squares


def _sums(data: RunData, rows: Array, weights: Array, used: Labels | None = None) -> tuple[Array, Array]:
    """Normal equations of rows, of all samples or of some of them."""
    of_run = _root_weights(data, weights) ** 2
    part, signal = (rows, data.signal) if used is None else (rows[:, used], data.signal[used])
    weighted = part * (of_run if used is None else of_run[used])
    return weighted @ part.T, weighted @ signal


def _root_weights(data: RunData, weights: Array) -> Array:
    sizes = [at.stop - at.start for at in data.slices]
    return np.asarray(np.repeat(np.sqrt(weights), sizes), dtype=np.float64)


def _run_weights(data: RunData, residual: Array) -> Array:
    """A run counts by the noise that it has, beside the others'."""
    power = np.array([np.mean(residual[at] ** 2) for at in data.slices]) + data.floor**2
    return np.asarray(np.min(power) / power, dtype=np.float64)


def _priors(terms: Sequence[Term]) -> tuple[Array, Array]:
    """Mean and standard deviation of each value beforehand; infinite where nothing is known."""
    means = np.concatenate([np.array(t.means) if t.means else np.zeros(t.size) for t in terms])
    return means, np.concatenate([np.full(t.size, t.sigma) for t in terms])
