"""Coloured noise of one run, from what is left when all that is regular is out: also from a single pass."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array

Flags = npt.NDArray[np.bool_]

_MOST_LAGS = 32
_TABLE = 8192  # frequencies of a tabulated spectrum
_BANDS = 3.0  # bands of the spectrum an octave: narrow beside the colour of noise, wide beside lines
_LEAST_BINS = 16  # in a band: a median of fewer says little
#: Of a run of nothing but noise; Hann's window makes it count as half as long, and a slow wave in a short run stands
#: out of noise that is not known then.
_CALM_ENDS = 0.1
_FAR = 8.0  # times the median of noise: above it lies one bin in 256
_BELOW_FAR = 1 - 2**-_FAR  # mean of what is cut there, of its mean: noise has an exponential distribution in each bin


@dataclass(frozen=True, eq=False)
class RunNoise:
    """Autoregressive noise, e[t] = sum of coefficients[k] e[t-1-k] + sigma w[t], w white of variance 1."""

    coefficients: Array
    sigma: float

    @property
    def filter(self) -> Array:
        """Whitening filter."""
        return np.concatenate([[1.0], -self.coefficients]) / self.sigma

    def spectrum(self, frequency: Array) -> Array:
        """Variance per unit of `frequency` / 2 pi, rad per sample."""
        return np.asarray(np.interp(frequency, np.linspace(0, np.pi, _TABLE + 1), self._response), dtype=np.float64)

    @cached_property
    def _response(self) -> Array:
        return np.asarray(np.abs(np.fft.rfft(self.filter, 2 * _TABLE)) ** -2)

    @cached_property
    def rms(self) -> float:
        """Standard deviation of the noise itself."""
        response = np.abs(np.fft.rfft(self.filter, 4096)) ** -2
        return float(np.sqrt(np.mean(np.concatenate([response, response[1:-1]]))))


def noise_of(residual: Array, kept: Flags, fitted: float, *, floor: float, calm: bool = False) -> RunNoise:
    """Noise of a residual, robust against lines and bends that no model has explained yet.

    The periodogram is cut where it stands far above the median of its band, a third of an octave, which lines of a few
    bins do not move, and turned into an autoregressive model by its correlation (Yule and Walker).

    Parameters
    ----------
    residual : ndarray, shape (n,)
    kept : ndarray of bool, shape (n,)
        Samples that were not set aside.
    fitted : float
        Number of parameters that this residual was fitted with.
    floor : float
        White noise that is there in any case.
    calm : bool
        Whether nothing but noise is left, so that nothing strong leaks from one bin to the others, and nearly all
        samples can count.
    """
    n = residual.size
    used = float(kept.sum())
    # holes would scatter strong lines over the spectrum; here, and only here, neighbours stand for what is set aside
    rest = residual if kept.all() else np.interp(np.arange(n), np.flatnonzero(kept), residual[kept])
    window = _window(n, _CALM_ENDS if calm else 1.0)
    rest = (rest - rest.mean()) * window
    power = np.abs(np.fft.rfft(rest)) ** 2 / float((window**2).sum())
    power *= used / max(used - fitted, 0.5 * used)
    lags = np.fft.irfft(without_lines(power), n)[: _MOST_LAGS + 1]
    lags[0] += floor**2
    # of a short run fewer: many lags would follow a line that no model explains
    count = max(min(_MOST_LAGS, n // 64), min(4, n // 20))
    coefficients = scipy.linalg.solve_toeplitz(lags[:count], lags[1 : count + 1]) if count else np.zeros(0)
    return RunNoise(np.asarray(coefficients), float(np.sqrt(lags[0] - coefficients @ lags[1 : count + 1])))


def _window(n: int, share: float) -> Array:
    """Rises and falls as a cosine over a share of a run (Tukey); over all of it it is Hann's."""
    at = np.arange(1, n + 1) / (n + 1)
    return np.asarray((1 - np.cos(np.pi * np.minimum(2 * np.minimum(at, 1 - at) / share, 1))) / 2)


def without_lines(power: Array) -> Array:
    """A periodogram of which no bin stands far above the median of its band: lines, and what no model explains yet.

    Parameters
    ----------
    power : ndarray, shape (bins,)
        From that of the mean on.

    Returns
    -------
    ndarray, shape (bins,)
    """
    edges = [1]
    while edges[-1] < power.size:
        edges.append(max(edges[-1] + _LEAST_BINS, round(edges[-1] * 2 ** (1 / _BANDS))))
    edges[-1] = power.size
    if len(edges) > 2 and edges[-1] - edges[-2] < _LEAST_BINS:
        del edges[-2]
    result = power.copy()
    for first, last in pairwise(edges):
        result[first:last] = np.minimum(power[first:last], _FAR * np.median(power[first:last])) / _BELOW_FAR
    result[0] = result[1 : edges[1]].mean()  # the mean was taken off
    return result


@dataclass(frozen=True, eq=False)
class Whitening:
    """How a run's rows are turned into independent values of variance 1, free of what is not asked for.

    Attributes
    ----------
    noise : RunNoise
    kept : ndarray of bool, shape (n,)
        Samples that count; one that is set aside is as if it were unknown.
    starts : tuple of int
        Where the series begins anew: the first sample, and those after gaps.
    nuisance : ndarray, shape (k, n)
        What may have any size in this run: its offset, slips, lines.
    """

    noise: RunNoise
    kept: Flags
    starts: tuple[int, ...]
    nuisance: Array
    _basis: Array = field(init=False)

    def __post_init__(self) -> None:
        """Span what is to be taken out."""
        dropped = np.flatnonzero(~self.kept)
        units = np.zeros((dropped.size, self.kept.size))
        units[np.arange(dropped.size), dropped] = 1
        rows = self.filtered(np.concatenate([self.nuisance, units]))
        size = np.linalg.norm(rows, axis=1)
        shows = size > 1e-9 * max(float(size.max(initial=0.0)), 1e-300)
        basis = np.linalg.qr((rows[shows] / size[shows, None]).T)[0]
        object.__setattr__(self, "_basis", np.ascontiguousarray(basis.T))

    @cached_property
    def usable(self) -> npt.NDArray[np.intp]:
        """Samples whose whitened value has all its lags."""
        lags, n = self.noise.coefficients.size, self.kept.size
        flags = np.ones(n, dtype=np.bool_)
        for start in self.starts:
            flags[start : start + lags] = False
        return np.flatnonzero(flags)

    def filtered(self, rows: Array) -> Array:
        """Rows (k, n) through the whitening filter, each series by itself; its first samples lack lags and go."""
        from rverror.base.filtering import filtered_into

        out = np.empty_like(rows)
        filtered_into(out, np.ascontiguousarray(rows), self.noise.filter)
        return np.asarray(out[:, self._used])

    @cached_property
    def _used(self) -> npt.NDArray[np.intp] | slice:
        """`usable`, as a slice where it is one: that need not be copied."""
        at = self.usable
        return slice(at[0], at[-1] + 1) if at.size and np.ptp(at) == at.size - 1 else at

    @property
    def freedom(self) -> int:
        """Number of independent values."""
        return int(self.kept.sum()) - len(self.starts) * self.noise.coefficients.size

    def __call__(self, rows: Array) -> Array:
        """Rows (k, n) whitened, less what nuisances make of them."""
        white = self.filtered(rows)
        white -= (white @ self._basis.T) @ self._basis
        return white
