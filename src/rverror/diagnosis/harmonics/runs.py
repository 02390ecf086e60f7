"""Runs cut into whole periods, and what they tell in units of their noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rverror.base.arrays import Array
from rverror.geartrain.kinematics import Conditions
from rverror.runs.spectrum import harmonics, noise_spectrum, noise_windows
from rverror.statics.prediction import Predictor


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
    zero : str
        Label of the index; runs of one label share their zero, so the difference of their means counts.
    mean_variance : float
        Variance of the mean of one period against another run's of the same zero, rad^2.
    """

    name: str
    predictor: Predictor
    values: Array
    noise: Array
    zero: str = ""
    mean_variance: float = np.inf

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


def whitened(runs: Sequence[FitRun], rows: Sequence[Array], periods: Sequence[int]) -> Array:
    """What runs tell, in standard deviations: the harmonics of each, then differences of means that share a zero.

    Parameters
    ----------
    runs : sequence of FitRun
    rows : sequence of ndarray, shape (..., n)
        Of each run, over one period.
    periods : sequence of int
        Of whose mean the rows are known.
    """
    parts = [run.whiten(row, count) for run, row, count in zip(runs, rows, periods, strict=True)]
    for label in sorted({run.zero for run in runs if run.zero}):
        group = [i for i, run in enumerate(runs) if run.zero == label]
        if len(group) < 2:
            continue
        means = np.stack([rows[i].mean(axis=-1) for i in group], axis=-1)
        variance = np.array([runs[i].mean_variance / periods[i] for i in group])
        against_first = np.diag(variance[1:]) + variance[0]
        parts.append(_divided(means[..., 1:] - means[..., :1], against_first))
    return np.concatenate(parts, axis=-1)


def _divided(rows: Array, covariance: Array) -> Array:
    """Rows (..., k) in standard deviations."""
    root = np.linalg.cholesky(covariance)
    return np.asarray(np.linalg.solve(root, rows[..., None])[..., 0], dtype=np.float64)


def coarse(run: FitRun, points: int) -> FitRun:
    """The run on fewer angles, without the harmonics that they could not hold.

    Parameters
    ----------
    run : FitRun
    points : int
        Angles a period to keep; the run itself where it has no more.
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
        run.conditions,
        theta=run.conditions.theta[::stride],
        time=None if time is None else time[::stride],
        folds=False,
    )
    predictor = Predictor(run.predictor.mechanism, conditions)
    return replace(run, predictor=predictor, values=values, noise=run.noise[: (kept - 1) // 2] / stride)


def fit_run(name: str, predictor: Predictor, values: Array) -> FitRun:
    """Make a `FitRun` and take its noise from what differs between the periods."""
    noise = noise_spectrum(values)
    least = max(float(noise.mean()) * 1e-6, 1e-30)  # noise-free simulated runs have no spread at all
    return FitRun(name, predictor, values, np.maximum(noise, least))


def independent_samples(runs: Sequence[FitRun], shares: Sequence[Array], known: float = 0.0) -> float:
    """Number of independent samples from which the variance of a sum of harmonics is known.

    The noise of a harmonic is the mean of the spread of its neighbours, each known from 2 (P - 1) differences between
    P periods.  A variance that is a sum of b_k times the spread of harmonic k has, by Satterthwaite's rule,

        (sum_k b_k)^2 / sum_k b_k^2 / (2 (P - 1))

    degrees of freedom: ten for one low order of one run of two periods, hundreds where many harmonics count.

    Parameters
    ----------
    runs : sequence of FitRun
    shares : sequence of ndarray, shape (m,)
        Of each run: what the noise of each harmonic adds to the variance.
    known : float
        What it has beside, which is known.
    """
    total, uncertain = known, 0.0
    for run, share in zip(runs, shares, strict=True):
        low, high = noise_windows(share.size)
        ends = np.zeros(share.size + 1)
        np.add.at(ends, low, share / (high - low))
        np.add.at(ends, high, -share / (high - low))
        spread = np.cumsum(ends)[:-1]
        total += float(share.sum())
        uncertain += float(spread @ spread) / (2 * (run.periods - 1))
    return total**2 / uncertain if uncertain > 0 else float(np.inf)
