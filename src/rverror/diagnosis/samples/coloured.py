"""Least squares under coloured noise: estimates need no model of the noise, their covariance knows its colour.

For trends and waves least squares is, on long even runs, as good as any estimate that knows the noise (Grenander and
Rosenblatt), and where the noise model errs it stays harmless.  So the colour enters only the covariance.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array
from rverror.base.chance import variance_ratio
from rverror.diagnosis.noise import RunNoise, burg, without_lines

Labels = npt.NDArray[np.intp]

_MOST_LAGS = 12  # of a residual that may hold lines yet: more would follow them
_LEAST_BINS = 8  # neighbours on each side in the smoothed spectrum of the whitened residual


def noise_of_samples(residual: Array, *, floor: float) -> RunNoise:
    """Noise of a residual, as many lags, up to 12, as the Bayesian criterion allows.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    floor : float
        Standard deviation of white noise that is there in any case.
    """
    n = residual.size
    found = burg(residual, min(_MOST_LAGS, n // 20), floor=floor)
    return min(found, key=lambda one: 2 * n * math.log(one.sigma) + one.coefficients.size * math.log(n))


def whiten(row: Array, noise: RunNoise) -> Array:
    """Filter a row of one run so that its noise becomes white of variance 1; the first samples, which lack lags, go."""
    return np.asarray(np.convolve(row, noise.filter, "valid"), dtype=np.float64)


def smooth_spectrum(error: Array) -> Array:
    """Power per frequency bin of a row, without lines and smoothed over neighbours; 1 for white noise of variance 1.

    A line is no noise of the orders beside it: a worm's second line had hidden its first on a random walk.
    """
    power = without_lines(np.abs(np.fft.rfft(error)) ** 2 / error.size)
    half = min(_half_width(error.size), (power.size - 1) // 2)
    mirrored = np.concatenate([power[half:0:-1], power, power[-2 : -half - 2 : -1]])
    total = np.concatenate([[0.0], np.cumsum(mirrored)])
    return np.asarray((total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Normal equations of rows of unit length, with the noise that their sums carry.

    Attributes
    ----------
    gram, carried : ndarray, shape (k, k)
        X W X^T, and X W S W X^T for the covariance S of the noise.
    scale : ndarray, shape (k,)
        Length of each row before.
    """

    gram: Array
    carried: Array
    scale: Array

    @property
    def seen(self) -> Array:
        """Variance of the noise as each row sees it: at its frequencies, as if the noise were white."""
        return np.asarray(np.diag(self.carried) / np.maximum(np.diag(self.gram), 1e-300), dtype=np.float64)

    def prior_weights(self, sigmas: Array) -> Array:
        """Weight of each value's prior in the squares: the noise's variance as its row sees it, over the prior's."""
        return np.asarray(self.seen / (sigmas * self.scale) ** 2, dtype=np.float64)

    def covariance(self, sigmas: Array) -> Array:
        """Covariance of the values, the sandwich A^-1 B A^-1, with priors of standard deviations (inf: none)."""
        weight = self.prior_weights(sigmas)
        inverse = np.linalg.pinv(self.gram + np.diag(weight), rcond=1e-13, hermitian=True)
        meat = self.carried + np.diag(weight**2 * (np.where(np.isfinite(sigmas), sigmas, 0.0) * self.scale) ** 2)
        return np.asarray(inverse @ meat @ inverse / np.outer(self.scale, self.scale), dtype=np.float64)


def normal(rows: Array, residual: Array, slices: Sequence[slice], weights: Array, *, floor: float) -> NormalEquations:
    """Normal equations under the noise that a residual shows.

    Parameters
    ----------
    rows : ndarray, shape (k, n)
        All runs one after another.
    residual : ndarray, shape (n,)
    slices : sequence of slice
        Where each run lies.
    weights : ndarray, shape (runs,)
        Weight of each run's squares.
    floor : float
        White noise that is there in any case.

    Notes
    -----
    S is that of an autoregressive model times the smoothed spectrum of what the model leaves, but at least 1: a model
    that misses part of the colour widens the intervals and claims no more.
    """
    scale = lengths(rows)
    scaled = rows / scale[:, None]
    gram, carried = np.zeros((len(rows), len(rows))), np.zeros((len(rows), len(rows)))
    for at, weight in zip(slices, weights, strict=True):
        part, rest = scaled[:, at], residual[at]
        n = rest.size
        noise = noise_of_samples(rest, floor=floor)
        excess = np.maximum(smooth_spectrum(whiten(rest, noise)), 1.0)
        padded = scipy.fft.next_fast_len(2 * n, real=True)  # so that the two ends of a run are no neighbours
        lines = scipy.fft.rfft(part, padded, axis=1)
        frequency = np.linspace(0, 2 * np.pi * (lines.shape[1] - 1) / padded, lines.shape[1])
        response = scipy.fft.rfft(np.concatenate([[1.0], -noise.coefficients]), padded)
        spectrum = noise.sigma**2 / np.abs(response) ** 2 / padded * n / max(n - len(rows), 1)
        spectrum *= np.interp(frequency, np.linspace(0, np.pi, excess.size), excess)
        spectrum[1 : -1 if padded % 2 == 0 else None] *= 2
        root = np.sqrt(spectrum)
        real, imaginary = lines.real * root, lines.imag * root
        carried += weight**2 * (real @ real.T + imaginary @ imaginary.T)
        gram += weight * part @ part.T
    return NormalEquations(gram, carried, scale)


def _half_width(samples: int) -> int:
    return int(max(_LEAST_BINS, round(np.sqrt(samples) / 2)))


def spectrum_freedom(samples: int) -> int:
    """Degrees of freedom of the noise's power at one frequency, from its neighbours in the spectrum."""
    return 2 * (2 * _half_width(samples) + 1)


def lengths(rows: Array) -> Array:
    """Length of each row, 1 where it is 0."""
    size = np.linalg.norm(rows, axis=1)
    return np.asarray(np.where(size > 0, size, 1.0), dtype=np.float64)


def solve(gram: Array, moment: Array) -> Array:
    """Solution of normal equations of rows of unit length; the least where they do not determine it."""
    return np.asarray(np.linalg.lstsq(gram, moment, rcond=1e-13)[0], dtype=np.float64)


def distance(values: Array, covariance: Array) -> float:
    """Squared distance of values from 0 in standard deviations."""
    scale = np.sqrt(np.diag(covariance))
    scale = np.where(scale > 0, scale, 1.0)
    unit = values / scale
    return float(unit @ np.linalg.pinv(covariance / np.outer(scale, scale), rcond=1e-10, hermitian=True) @ unit)


def significant(values: Array, covariance: Array, accepted: float, samples: float) -> bool:
    """Tell whether values differ from 0 more than they do by chance `accepted`.

    `samples` is the number of independent ones from which their noise is known: few where it is slow.
    """
    return distance(values, covariance) > values.size * variance_ratio(accepted, values.size, samples)


def orthonormal(rows: Array) -> Array:
    """Columns that span the rows, shape (n, k)."""
    size = np.maximum(np.linalg.norm(rows, axis=1), 1e-300)
    return np.asarray(np.linalg.qr((rows / size[:, None]).T)[0], dtype=np.float64)


def kept_share(basis: Array, rows: Array) -> float:
    """Smallest share of its power that any combination of rows keeps beside a basis: squared sine of the angle.

    Parameters
    ----------
    basis : ndarray, shape (n, k)
        From `orthonormal`.
    rows : ndarray, shape (m, n)

    Examples
    --------
    >>> round(kept_share(orthonormal(np.array([[1.0, 0.0]])), np.array([[1.0, 1.0]])), 12)
    0.5
    """
    own, size = np.linalg.qr((rows / np.maximum(np.linalg.norm(rows, axis=1), 1e-300)[:, None]).T)
    if np.min(np.abs(np.diag(size))) < 1e-9:
        return 0.0
    left = own - basis @ (basis.T @ own)
    return float(max(np.linalg.eigvalsh(left.T @ left)[0], 0.0))
