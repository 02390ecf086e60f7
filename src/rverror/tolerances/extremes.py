"""Peak-to-peak, max and rms of very many linear combinations of waveforms.  Page ``theory/virtual-units.md``."""

from __future__ import annotations

import bisect
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import dropwhile
from typing import NamedTuple

import numpy as np

from rverror.base.arrays import Array, Integers
from rverror.base.units import ARCSEC

#: Largest difference of a peak-to-peak that leaving out small waves may make, rad.
TOLERANCE = 1e-6 * ARCSEC

_REACH = 10.0  # draws, in widths, up to which it is kept
_ROUNDING = 1e-15  # of a mean: a waveform that leaves it by less is constant
_BLOCK = 2**16  # samples of a block of units, 0.5 MB: sums and peaks stay in a core's cache


class Extremes(NamedTuple):
    """Sizes of the output error of many units over one revolution."""

    peak_to_peak: Array  #: (units,); largest less smallest value
    max: Array  #: (units,); largest distance from the mean over the angles
    rms: Array  #: (units,); about the mean over the angles
    offset: Array  #: (units,); the mean over the angles, which the others leave out


@dataclass(frozen=True)
class Kernel:
    """Waveforms made ready for very many combinations ``nominal + values @ waveforms``.

    Waves that repeat within the revolution are summed on the angles of one repeat alone.
    """

    offsets: Array  #: (m,); mean of each waveform, which is kept apart from it
    nominal_offset: float  #: mean of the nominal
    factor: Array  #: (m, r); coordinates of the waveforms in the waves of all levels
    nominal_factor: Array  #: (r,); coordinates of the nominal
    #: (r_v, h_v); orthonormal waves of each level.  Those of all but the last change their sign after h_v samples,
    #: those of the last repeat; level v + 1 is added to the first and to the second half of what level v leaves of the
    #: revolution.
    levels: tuple[Array, ...]
    weights: Array  #: (r,); mean square over the revolution of each wave

    def extremes(self, values: Array) -> Extremes:
        """Sizes of ``nominal + values @ waveforms`` in its unit, for each row of values, shape (units, m)."""
        high, low, rms = np.empty((3, len(values)))
        for part, coordinates, even, odd in self._folds(values):
            swing = np.abs(odd, out=odd)
            high[part] = (even + swing).max(axis=1)
            low[part] = np.subtract(even, swing, out=even).min(axis=1)
            rms[part] = np.sqrt(np.square(coordinates) @ self.weights)
        return Extremes(high - low, np.maximum(high, -low), rms, self.nominal_offset + values @ self.offsets)

    def places(self, values: Array) -> tuple[Integers, Integers]:
        """Samples of the highest and of the lowest value of each combination, shape (units,) each; the first repeat."""
        high, low = np.empty((2, len(values)), dtype=np.intp)
        for part, _, even, odd in self._folds(values):
            swing, every, half = np.abs(odd), np.arange(len(even)), even.shape[1]
            top, bottom = (even + swing).argmax(axis=1), (even - swing).argmin(axis=1)
            high[part] = top + half * (odd[every, top] < 0)
            low[part] = bottom + half * (odd[every, bottom] > 0)
        return high, low

    def _folds(self, values: Array) -> Iterator[tuple[slice, Array, Array, Array]]:
        """Coordinates of the combinations, what of them repeats after the longest half, and what changes its sign."""
        ends = np.cumsum([len(level) for level in self.levels])[:-1]
        rows = max(16, _BLOCK // self.levels[0].shape[1])
        for start in range(0, len(values), rows):
            part = slice(start, min(start + rows, len(values)))
            coordinates = values[part] @ self.factor + self.nominal_factor
            by_level = np.split(coordinates, ends, axis=1)
            waves = [numbers @ level for numbers, level in zip(by_level, self.levels, strict=True)]
            even = waves.pop()
            while len(waves) > 1:
                odd = waves.pop()
                both = np.empty((len(odd), 2, odd.shape[1]))
                np.add(even, odd, out=both[:, 0])
                np.subtract(even, odd, out=both[:, 1])
                even = both.reshape(len(odd), -1)
            yield part, coordinates, even, waves[0] if waves else np.zeros_like(even)


def kernel(waveforms: Array, nominal: Array) -> Kernel:
    """Make waveforms ready.

    Parameters
    ----------
    waveforms : ndarray, shape (m, n)
        Such as `Stack.scaled`, rad per standard draw.
    nominal : ndarray, shape (n,)

    Raises
    ------
    ValueError
        If the shapes do not fit or a number is not finite.

    Notes
    -----
    No peak-to-peak is off by more than `TOLERANCE` by waves left out, as long as no value exceeds ten.

    With h half the angles, (TE(i) + TE(i + h)) / 2 holds the even orders and (TE(i) - TE(i + h)) / 2 the odd ones; the
    even ones are folded again.  On each level the waveforms are written by as few waves as their rank.

    Examples
    --------
    >>> theta = 2 * np.pi * np.arange(4096) / 4096
    >>> waves = 5 * ARCSEC * np.array([np.cos(40 * theta), np.sin(40 * theta), np.ones(4096)])
    >>> ready = kernel(waves, np.zeros(4096))
    >>> ready.levels[0].shape  # order 40 changes its sign after a sixteenth of the revolution
    (2, 256)
    >>> sizes = ready.extremes(np.array([[3.0, 4.0, 7.0]]))
    >>> [round(float(size[0] / ARCSEC), 3) for size in (sizes.max, sizes.rms, sizes.offset)]
    [25.0, 17.678, 35.0]
    """
    if waveforms.ndim != 2 or nominal.shape != waveforms.shape[1:] or not nominal.size:
        raise ValueError(f"waveforms {waveforms.shape} and nominal {nominal.shape}: give (m, n) and (n,) with n > 0")
    rows = np.concatenate([waveforms, nominal[None]], dtype=np.float64)
    if not np.isfinite(rows).all():
        raise ValueError("the waveforms or the nominal hold numbers that are not finite; check the model")
    means = rows.mean(axis=1)
    rows -= means[:, None]
    rows[np.abs(rows).max(axis=1) <= _ROUNDING * np.abs(means)] = 0
    folded = _folded(rows)
    limits = np.append(np.full(len(means) - 1, _REACH), 1.0)  # of what multiplies each row
    found = [_truncated(level, limits, TOLERANCE / (4 * len(folded))) for level in folded]
    # a common repeat leaves nothing on the first levels
    kept = [*dropwhile(lambda of_level: not len(of_level[1]), found[:-1]), found[-1]]
    factors, levels = zip(*kept, strict=True)
    factor = np.concatenate(factors, axis=1)
    return Kernel(
        offsets=means[:-1],
        nominal_offset=float(means[-1]),
        factor=factor[:-1],
        nominal_factor=factor[-1],
        levels=levels,
        weights=np.concatenate([np.full(len(level), 1 / level.shape[1]) for level in levels]),
    )


def _folded(rows: Array) -> list[Array]:
    """Parts that change their sign after half of what is left, then what repeats."""
    parts = []
    while rows.shape[1] % 2 == 0 and rows.shape[1] // 2 >= rows.shape[0]:
        first, second = np.split(rows, 2, axis=1)
        parts.append((first - second) / 2)
        rows = (first + second) / 2
    return [*parts, rows]


def _truncated(rows: Array, limits: Array, most: float) -> tuple[Array, Array]:
    """Factors of the least rank whose rest, each row times its limit, adds up to no more than `most`."""
    left, values, waves = np.linalg.svd(rows, full_matrices=False)
    left *= values

    def rest(rank: int) -> float:
        return float(limits @ np.abs(rows - left[:, :rank] @ waves[:rank]).max(axis=1))

    rank = bisect.bisect_left(range(len(values)), True, key=lambda r: rest(r) <= most)
    return left[:, :rank], np.ascontiguousarray(waves[:rank])
