"""Joint least squares of a drive's terms under coloured noise, and what a term takes off samples left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rverror.base.arrays import Array
from rverror.base.chance import student
from rverror.diagnosis.coloured import (
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
from rverror.diagnosis.drive_runs import RunData
from rverror.diagnosis.drive_terms import DECLARED, EFFECT, LINE, NUISANCE, Term, implausible

#: Chance that any candidate passes by luck.
FALSE_ALARM = 3e-3
_LEAST_SAMPLES = 4.0
_APART = 1e-4  # a candidate keeps this share of its power beside what is there, or is not tried
_APART_IMPLAUSIBLE = 0.05


@dataclass(frozen=True, eq=False)
class DriveFit:
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
    """

    terms: tuple[Term, ...]
    all_values: Array
    spread: Array
    residual: Array
    weights: Array
    samples: Array

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
        """Half width of the 95 % interval of a value, or a sum of a term's values, with a variance."""
        return np.asarray(np.sqrt(spread) * student(0.025, self.own_samples(term)), dtype=np.float64)

    def distance(self, term: Term) -> float:
        """Squared distance of a term from 0 in standard deviations."""
        return distance(self.values(term), self.own_spread(term))


def fitted(data: RunData, terms: Sequence[Term], *, noise: DriveFit | None = None) -> DriveFit:
    """Fit terms to all runs by least squares.

    Parameters
    ----------
    data : RunData
    terms : sequence of Term
    noise : DriveFit, optional
        Fit whose residual is the noise and whose weights the runs have; left out, those of this fit itself.

    Returns
    -------
    DriveFit
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
    samples = np.clip(squares / np.maximum(equations.seen, 1e-300), _LEAST_SAMPLES, most)
    return DriveFit(tuple(terms), values, equations.covariance(sigmas), left, weights, samples)


def screened(data: RunData, fit: DriveFit, pool: Sequence[Term]) -> list[tuple[Term, float, list[str]]]:
    """Terms that the runs can tell from what is there, with what each would take off.

    Parameters
    ----------
    data : RunData
    fit : DriveFit
    pool : sequence of Term

    Returns
    -------
    list of (Term, float, list of str)
        Share of the residual's squares that it takes off, and its parameters that would be implausible; the most
        telling first.
    """
    root = _root_weights(data, fit.weights)
    # a declared size that was measured wrong is missing too, so declared terms do not bar one of their waveform
    free = orthonormal(root * np.concatenate([t.rows for t in fit.terms if t.kind != DECLARED]))
    every = orthonormal(root * np.concatenate([t.rows for t in fit.terms]))
    found = []
    for term in pool:
        rows, rest = root * term.rows, root * fit.residual
        if term in fit.terms or kept_share(free, rows) < _APART:
            continue
        left = rows - (rows @ free) @ free.T
        values = np.linalg.lstsq(left.T, rest - free @ (free.T @ rest), rcond=None)[0]
        gain = 1 - float(np.mean((rest - values @ left) ** 2)) / max(float(np.mean(rest**2)), 1e-300)
        too_large = implausible(term, np.asarray(values, dtype=np.float64), data.quantity)
        if not too_large or kept_share(every, rows) > _APART_IMPLAUSIBLE:
            found.append((term, gain, too_large))
    # rounded, so that of equal ones the first goes first
    return sorted(found, key=lambda s: -round(s[1], 9))


def held_out_gain(data: RunData, fit: DriveFit, trial: DriveFit) -> float:
    """What a trial takes off the squares of blocks of samples that its fit did not see.

    Parameters
    ----------
    data : RunData
    fit, trial : DriveFit

    Returns
    -------
    float
        In variances of the trial's residual.
    """
    variance = float(np.mean(trial.residual**2)) + data.floor**2
    before, after = (held_out_squares(data, f.terms, trial) for f in (fit, trial))
    return (before - after) / variance


def held_out_squares(data: RunData, terms: Sequence[Term], noise: DriveFit) -> float:
    """Sum of squares of all blocks of samples, each left out of the fit that predicts it.

    Parameters
    ----------
    data : RunData
    terms : sequence of Term
    noise : DriveFit
        As in `fitted`.

    Returns
    -------
    float
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


def pruned(data: RunData, fit: DriveFit, accepted: float) -> DriveFit:
    """Fit without the terms that later ones have made needless.

    Parameters
    ----------
    data : RunData
    fit : DriveFit
    accepted : float
        Chance at which a term that is none may stay.

    Returns
    -------
    DriveFit
    """
    while True:
        free = [t for t in fit.terms[:-1] if t.kind in (EFFECT, NUISANCE, LINE)]
        weak = [t for t in free if not fit.significant(t, accepted)]
        if not weak:
            return fit
        fit = fitted(data, [t for t in fit.terms if t is not weak[0]])


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
