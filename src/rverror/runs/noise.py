"""Autoregressive noise of a run: what a fit's residual is held against, and what faults must stand out of."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy

from rverror.base.arrays import Array

_TABLE = 8192
#: Of a tabulated spectrum, rad a sample.
FREQUENCIES = np.linspace(0, np.pi, _TABLE + 1)


@dataclass(frozen=True, eq=False)
class RunNoise:
    """Autoregressive noise, e[t] = sum of coefficients[k] e[t-1-k] + sigma w[t], and a random walk beside it.

    The walk's steps are `walk` times sigma: at a frequency, rad a sample, it has the power (walk sigma / frequency)^2.
    """

    coefficients: Array
    sigma: float
    walk: float = 0.0

    @property
    def filter(self) -> Array:
        """Whitening filter."""
        return np.concatenate([[1.0], -self.coefficients]) / self.sigma

    def spectrum(self, frequency: Array) -> Array:
        """Variance per unit of `frequency` / 2 pi, rad per sample."""
        plain = np.interp(frequency, FREQUENCIES, self._response)
        return np.asarray(plain + (self.step / frequency) ** 2 if self.walk else plain, dtype=np.float64)

    def excess(self, frequency: Array) -> Array:
        """Power of the walk over that of the noise without it."""
        plain = np.interp(frequency, FREQUENCIES, self._response)
        return np.asarray((self.step / frequency) ** 2 / plain, dtype=np.float64)

    @cached_property
    def _response(self) -> Array:
        return np.asarray(np.abs(np.fft.rfft(self.filter, 2 * _TABLE)) ** -2)

    @property
    def step(self) -> float:
        """Standard deviation of the steps of its walk, rad a sample."""
        return self.walk * self.sigma

    @cached_property
    def rms(self) -> float:
        """Standard deviation of the noise itself, a walk left out, which has none."""
        response = np.abs(np.fft.rfft(self.filter, 4096)) ** -2
        return float(np.sqrt(np.mean(np.concatenate([response, response[1:-1]]))))


def autoregressive(correlation: Array, lags: int, floor: float = 0.0) -> RunNoise:
    """Noise of so many lags with a correlation, and white noise beside it (Yule and Walker).

    Parameters
    ----------
    correlation : ndarray, shape (lags + 1 or more,)
        Of lag 0, the variance, and so on.
    lags : int
    floor : float
        Standard deviation of the white noise.

    Examples
    --------
    >>> noise = autoregressive(np.array([1.0, 0.5, 0.25]), 2)
    >>> noise.coefficients.round(9), round(noise.sigma**2, 9)
    (array([ 0.5, -0. ]), 0.75)
    """
    correlation = correlation[: lags + 1] + floor**2 * (np.arange(lags + 1) == 0)
    ahead = correlation[1:]
    coefficients = scipy.linalg.solve_toeplitz(correlation[:lags], ahead) if lags else np.zeros(0)
    return RunNoise(np.asarray(coefficients), float(np.sqrt(correlation[0] - coefficients @ ahead)))
