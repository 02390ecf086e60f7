"""Coloured noise of one run, from what is left when all that is regular is out: also from a single pass."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array, Flags
from rverror.runs.noise import FREQUENCIES, RunNoise, autoregressive

_MOST_LAGS = 32
_LEAST_LAGS = 4  # of means of samples: those of noise of one lag have more than one
_BANDS = 3.0  # bands of the spectrum an octave: narrow beside the colour of noise, wide beside lines
_LEAST_BINS = 16  # in a band: a median of fewer says little
#: Of a model of the noise, each bin over what the last one makes of it: a random walk falls so steeply within a band
#: that its slowest waves pass for lines at first; more change its order 1 by less than a twentieth.
_ROUNDS = 4
_LAGS, _FEWER_WALKS = (0, 1, 2, 3, 4, 5, 6, 8, 12), 24  # that are tried of a run with few lags, and sizes of walks
_MOST_WAVES = 400  # of a walk beside few lags: those of a larger one cost much, and lags tell it
_WALKS = 60  # sizes of a random walk that are tried, a factor of 1.2 apart
_SHOWN = 5.0  # times the wave at which a walk is as large as the noise: beyond it is a twenty-fifth
_FAR = 8.0  # times the median of noise: above it lies one bin in 256
_BELOW_FAR = 1 - 2**-_FAR  # mean of what is cut there, of its mean: noise has an exponential distribution in each bin


def noise_of(
    residual: Array, kept: Flags, fitted: float, *, floor: float, calm: bool = False, by_criterion: bool = False,
    parts: Sequence[slice] = (), white: bool = False,
) -> RunNoise:  # fmt: skip
    """Noise of a residual, robust against lines and bends that no model has explained yet.

    Where nothing but noise is left it is `burg`'s.  Else the periodogram is cut where it stands far above the median of
    its band, a third of an octave, which lines of a few bins do not move, and turned into an autoregressive model by
    its correlation; and so again, each bin over what that model makes of it.

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
        Whether nothing but noise is left.
    by_criterion : bool
        Whether it has as many lags as the Bayesian criterion allows, in place of as many as may be, and, where nothing
        but noise is left, a random walk beside it as far as that is likelier by the same criterion.
    parts : sequence of slice
        Stretches on which what no model explains yet is regular, each by itself; the whole where there are none.
    white : bool
        Whether it has no memory as long as more than noise may be left: a memory takes up a wave of which the run holds
        a bow.
    """
    n = residual.size
    used = float(kept.sum())
    rest = _filled(residual, kept) * math.sqrt(used / max(used - fitted, 0.5 * used))
    if calm:
        by_lags = burg(rest, min(_MOST_LAGS, n // 20), floor=floor)
        few = [by_lags[lags] for lags in _LAGS if lags < len(by_lags)]
        return _wandering(few, rest) if by_criterion else by_lags[-1]
    pieces = [rest[part] - rest[part].mean() for part in parts] or [rest]
    spectra, least = [_periodogram(piece) for piece in pieces], min(piece.size for piece in pieces)
    # of a short run fewer: many lags would follow a line that no model explains
    count = 0 if white else max(min(_MOST_LAGS, least // 64), min(4, least // 20))
    found = RunNoise(np.zeros(0), 1.0)
    for _ in range(_ROUNDS):
        correlation = np.zeros(count + 1)
        for piece, (frequency, power) in zip(pieces, spectra, strict=True):
            shape = found.spectrum(frequency)
            own = np.fft.irfft(without_lines(power / shape) * shape, piece.size)[: count + 1]
            correlation += own * (piece.size / sum(one.size for one in pieces))
        orders = range(count + 1) if by_criterion else (count,)
        by_lags = [autoregressive(correlation, lags, floor) for lags in orders]  # by the Bayesian criterion
        found = min(by_lags, key=lambda one: 2 * n * math.log(one.sigma) + one.coefficients.size * math.log(n))
    return found


def _periodogram(values: Array) -> tuple[Array, Array]:
    """Frequencies, rad a sample, and power of values, through a window."""
    n = values.size
    window = (1 - np.cos(2 * np.pi * np.arange(1, n + 1) / (n + 1))) / 2
    power = np.abs(np.fft.rfft(values * window)) ** 2 / float((window**2).sum())
    return 2 * np.pi * np.arange(power.size) / n, power


def _filled(residual: Array, kept: Flags) -> Array:
    """A residual about its mean, neighbours in the place of what is set aside: holes would scatter strong lines over
    the spectrum."""
    rest = residual if kept.all() else np.interp(np.arange(residual.size), np.flatnonzero(kept), residual[kept])
    return np.asarray(rest - rest.mean())


def walking(noise: RunNoise, residual: Array, kept: Flags) -> RunNoise:
    """Noise with the random walk beside it that is likeliest in a residual.

    Parameters
    ----------
    noise : RunNoise
    residual : ndarray, shape (n,)
    kept : ndarray of bool, shape (n,)
    """
    squares, shape = _waves_of_walk(noise, _filled(residual, kept))

    def gain(size: float) -> float:
        excess = size * shape
        return float((squares * excess / (1 + excess)).sum() - np.log1p(excess).sum())

    sizes = np.geomspace(0.1, squares.size, _WALKS) ** 2 / shape[0]
    return replace(noise, walk=math.sqrt(max((0.0, *sizes), key=gain)))


def _waves_of_walk(noise: RunNoise, residual: Array) -> tuple[Array, Array]:
    """Squared sizes of the waves of a walk in a residual that noise whitens, and what a walk of size 1 adds to each.

    They are cos(pi k (t + 1/2) / n), half a cycle a run and multiples, with a variance of 1 and their `excess`.
    """
    white = np.convolve(residual, noise.filter, "valid")
    squares = scipy.fft.dct(white, norm="ortho")[1:] ** 2
    return squares, replace(noise, walk=1.0).excess(math.pi / white.size * np.arange(1, squares.size + 1))


def _wandering(found: Sequence[RunNoise], residual: Array) -> RunNoise:
    """Of noises with more and more lags, each with a random walk beside it and its size as that leaves it, the one that
    the Bayesian criterion allows: a small walk takes many lags, a large one few."""
    best, least, n = found[0], math.inf, residual.size
    for one in found:
        squares, shape = _waves_of_walk(one, residual)
        most = _SHOWN**-2 / float(shape[min(_MOST_WAVES, squares.size) - 1])
        sizes = np.geomspace(0.01 / shape[0], most, _FEWER_WALKS)
        for size in (0.0, *sizes[sizes <= most]):
            excess = size * shape
            variance = float(np.mean(squares / (1 + excess)))
            criterion = n * (math.log(variance) + 2 * math.log(one.sigma) + float(np.log1p(excess).mean()))
            criterion += (one.coefficients.size + (size > 0)) * math.log(n)
            if criterion < least:
                best, least = RunNoise(one.coefficients, one.sigma * math.sqrt(variance), math.sqrt(size)), criterion
    return best


def averaged(noise: RunNoise, together: int) -> RunNoise:
    """Noise of means over so many samples, one after another.

    Their correlation is r'[k] = sum over i, j of r[q k + i - j] / q^2, i and j from 0 to q - 1, from the correlation r
    of the samples: the Fourier transform of their spectrum.  A walk's steps from mean to mean are so many of its own.
    """
    plain = np.fft.irfft(replace(noise, walk=0.0).spectrum(FREQUENCIES))
    lags = max(min(_MOST_LAGS, noise.coefficients.size), _LEAST_LAGS)
    shift = np.arange(1 - together, together)
    weight = (together - np.abs(shift)) / together**2
    correlation = np.array([weight @ plain[np.abs(together * k + shift)] for k in range(lags + 1)])
    means = autoregressive(correlation, lags, 0.0)
    return replace(means, walk=noise.step * math.sqrt(together) / means.sigma)


def burg(residual: Array, most: int, *, floor: float = 0.0) -> list[RunNoise]:
    """Autoregressive noise of no lag, of one, and so on, that predicts a residual best, forward and backward (Burg).

    No window and no end of the run makes a walk pass for less than it is: with the correlation of a run of one turn
    order 1 of a random walk came to six times its noise.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    most : int
        Number of lags.
    floor : float
        Standard deviation of white noise that is there in any case, so that a perfect fit is no certainty.

    Examples
    --------
    >>> from scipy.signal import lfilter
    >>> white = np.random.default_rng(0).normal(size=4000)
    >>> red = lfilter([1.0], [1.0, -0.9], white)
    >>> [bool(abs(c - 0.9) < 0.02) for c in burg(red, 1)[-1].coefficients]
    [True]
    """
    forward, backward = residual, residual
    power, coefficients = float(residual @ residual) / residual.size + floor**2, np.zeros(0)
    found = [RunNoise(coefficients, math.sqrt(power))]
    for _ in range(most):
        ahead, behind = forward[1:], backward[:-1]
        # the floor adds to the variance, not to the correlation
        energy = float(ahead @ ahead + behind @ behind) + 2 * ahead.size * floor**2
        reflection = 2 * float(ahead @ behind) / energy
        coefficients = np.append(coefficients - reflection * coefficients[::-1], reflection)
        forward, backward = ahead - reflection * behind, behind - reflection * ahead
        power *= 1 - reflection**2
        found.append(RunNoise(coefficients, math.sqrt(power)))
    return found


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
    doubtful : ndarray, shape (k, n), optional
        What may be in this run by a normal chance, each row one standard deviation, rad.
    """

    noise: RunNoise
    kept: Flags
    starts: tuple[int, ...]
    nuisance: Array
    doubtful: Array | None = None

    @cached_property
    def _basis(self) -> Array:
        """Of what is to be taken out, shape (b, n)."""
        dropped = np.flatnonzero(~self.kept)[:, None] == np.arange(self.kept.size)  # a unit row of each
        rows = self.filtered(np.concatenate([self.nuisance, dropped.astype(np.float64)]))
        size = np.linalg.norm(rows, axis=1)
        shows = size > 1e-9 * max(float(size.max(initial=0.0)), 1e-300)
        return np.ascontiguousarray(np.linalg.qr((rows[shows] / size[shows, None]).T)[0].T)

    @cached_property
    def _doubts(self) -> tuple[Array, Array] | None:
        """Waves of what is doubtful, and its variance along each beside noise of variance 1: large along a few."""
        if self.doubtful is None:
            return None
        _, size, waves = np.linalg.svd(self._without_nuisances(self.filtered(self.doubtful)), full_matrices=False)
        return np.ascontiguousarray(waves), size**2

    def _without_nuisances(self, white: Array) -> Array:
        """Whitened rows less what nuisances make of them."""
        return np.asarray(white - (white @ self._basis.T) @ self._basis)

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
        white = np.asarray(out[:, self._used])
        return _evened(white, *self._walk) if self.noise.walk else white

    @cached_property
    def _walk(self) -> tuple[Array, Array]:
        """Waves of a random walk that show, of unit length, and by how much their variance exceeds 1."""
        n = self.usable.size
        excess = self.noise.excess(np.asarray(np.arange(1, n) * (math.pi / n), dtype=np.float64))
        number = np.flatnonzero(excess > (1 - 1e-9) * _SHOWN**-2) + 1
        waves = math.sqrt(2 / n) * np.cos(math.pi / n * np.outer(number, np.arange(n) + 0.5))
        return waves, excess[number - 1]

    @property
    def log_variance(self) -> float:
        """Sum of the logarithms of the variances of all values, given those before."""
        more = float(np.log1p(self._walk[1]).sum()) if self.noise.walk else 0.0
        more += 0.0 if self._doubts is None else float(np.log1p(self._doubts[1]).sum())
        return 2 * self.freedom * math.log(self.noise.sigma) + more

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
        white = self._without_nuisances(self.filtered(rows))
        return white if self._doubts is None else _evened(white, *self._doubts)


def _evened(white: Array, waves: Array, excess: Array) -> Array:
    """Rows whose variance along waves of unit length exceeds 1, made of variance 1."""
    return np.asarray(white - ((white @ waves.T) * (1 - 1 / np.sqrt(1 + excess))) @ waves)
