"""Peak-to-peak, max and rms of very many linear combinations of waveforms.  Page ``theory/virtual-units.md``."""

from __future__ import annotations

import bisect
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.units import ARCSEC

#: Largest difference of a peak-to-peak that leaving out small waves may make, rad.
TOLERANCE = 1e-6 * ARCSEC
#: Draws, in widths, up to which `TOLERANCE` is kept.
REACH = 10.0

_UNIT_ROUNDOFF = 2.0**-53
_WORTHWHILE = 2 / 3  # of the multiplications of the whole product, for `kernel` to take the form by orders
_DIRECT_SAMPLES = 2**21  # of a block of units: 16 MB, where the product is at its fastest
_FOLDED_SAMPLES = 2**17  # 1 MB: sums and peaks stay in a core's cache
_FOLDED_UNITS = 256
_TILE = 128  # samples: what is summed of a few units stays in the fastest cache


Ints = npt.NDArray[np.intp]


@dataclass(frozen=True)
class Extremes:
    """Sizes of the output error of many units over one revolution."""

    peak_to_peak: Array  #: (units,); largest less smallest value
    max: Array  #: (units,); largest distance from the mean over the angles
    rms: Array  #: (units,); about the mean over the angles
    offset: Array  #: (units,); the mean over the angles, which the others leave out


@dataclass(frozen=True)
class Kernel(ABC):
    """Waveforms made ready for very many combinations ``nominal + values @ waveforms``."""

    offsets: Array  #: (m,); mean of each waveform, which is kept apart from it
    nominal_offset: float  #: mean of the nominal
    factor: Array  #: (m, r); coordinates of the waveforms in an orthonormal basis
    nominal_factor: Array  #: (r,); coordinates of the nominal
    slack: Array  #: (m,); what any sample may be off by, for a value of 1 of each waveform
    nominal_slack: float  #: the same for the nominal

    @abstractmethod
    def _fill(self, values: Array, high: Array, low: Array, rms: Array) -> None:
        """Write maximum, minimum and rms of each combination, its mean taken off."""

    @abstractmethod
    def places(self, values: Array) -> tuple[Ints, Ints]:
        """Samples of the highest and of the lowest value of each combination, shape (units,) each."""

    @property
    @abstractmethod
    def work(self) -> int:
        """Multiplications that one combination takes."""

    def extremes(self, values: Array) -> Extremes:
        """Sizes of ``nominal + values @ waveforms`` in its unit, for each row of values, shape (units, m)."""
        high, low, rms = np.empty((3, values.shape[0]))
        self._fill(values, high, low, rms)
        return Extremes(high - low, np.maximum(high, -low), rms, self.nominal_offset + values @ self.offsets)

    def bound(self, values: Array) -> Array:
        """Bound on the error of each peak-to-peak, of waves left out and of rounding, for each row of values."""
        return np.asarray(2 * (np.abs(values) @ self.slack + self.nominal_slack), dtype=np.float64)

    def bound_within(self, reach: float) -> float:
        """Bound on the error of any peak-to-peak whose values lie within +-reach."""
        return 2 * (reach * float(self.slack.sum()) + self.nominal_slack)


@dataclass(frozen=True)
class DirectKernel(Kernel):
    """The straightforward form: the matrix product in blocks, then its maxima and minima."""

    waveforms: Array  #: (m, n); without their means
    nominal: Array  #: (n,); without its mean

    @property
    def work(self) -> int:
        """Multiplications that one combination takes."""
        return self.waveforms.size

    def _fill(self, values: Array, high: Array, low: Array, rms: Array) -> None:
        for part, te in self._waves(values):
            te.max(axis=1, out=high[part])
            te.min(axis=1, out=low[part])
            coordinates = values[part] @ self.factor + self.nominal_factor
            rms[part] = np.sqrt(np.einsum("ur,ur->u", coordinates, coordinates) / self.nominal.size)

    def places(self, values: Array) -> tuple[Ints, Ints]:
        """Samples of the highest and of the lowest value of each combination."""
        high, low = np.empty((2, values.shape[0]), dtype=np.intp)
        for part, te in self._waves(values):
            te.argmax(axis=1, out=high[part])
            te.argmin(axis=1, out=low[part])
        return high, low

    def _waves(self, values: Array) -> Iterator[tuple[slice, Array]]:
        """Combinations without their means, a block at a time; the next block overwrites it."""
        samples = self.nominal.size
        buffer = np.empty((_rows(_DIRECT_SAMPLES, samples, values.shape[0]), samples))
        shifted = self.nominal.any()
        for part in _blocks(values.shape[0], buffer.shape[0]):
            te = np.matmul(values[part], self.waveforms, out=buffer[: part.stop - part.start])
            if shifted:
                te += self.nominal
            yield part, te


@dataclass(frozen=True)
class FoldedKernel(Kernel):
    """The form by orders: waves that repeat within the revolution are summed on the angles of one repeat alone."""

    #: (r_v, h_v); orthonormal waves of each level.  Those of all but the last change their sign after h_v samples,
    #: those of the last repeat; level v + 1 is added to the first and to the second half of what level v leaves of the
    #: revolution.
    levels: tuple[Array, ...]
    weights: Array  #: (r,); mean square over the revolution of each wave

    @property
    def work(self) -> int:
        """Multiplications that one combination takes."""
        return self.factor.size + sum(level.size for level in self.levels)

    def _fill(self, values: Array, high: Array, low: Array, rms: Array) -> None:
        from rverror.tolerances import loops

        tiles, ranks, factor, nominal, weights = self._tiles
        together, samples = loops.TOGETHER, tiles.shape[2]
        units = -(-min(_FOLDED_UNITS, len(values)) // together) * together
        coordinates = np.zeros((units, len(weights)))
        even, odd = np.empty((2 ** max(0, len(ranks) - 2), together, samples)), np.empty((together, samples))
        tops, bottoms = np.empty((2, units, samples))
        for part in _blocks(len(values), units):
            used = slice(0, part.stop - part.start)
            np.matmul(values[part], factor, out=coordinates[used])
            coordinates[used] += nominal
            tops[:], bottoms[:] = -np.inf, np.inf
            loops.extremes(tiles, ranks, coordinates, even, odd, tops, bottoms)
            tops[used].max(axis=1, out=high[part])
            bottoms[used].min(axis=1, out=low[part])
            rms[part] = np.sqrt(np.square(coordinates[used]) @ weights)

    @cached_property
    def _tiles(self) -> tuple[Array, Ints, Array, Array, Array]:
        """Waves and ranks as `loops.extremes` takes them, and their coordinates' factor, nominal and weights.

        Ranks are filled up by waves of nothing, the last tile by its last sample.
        """
        from rverror.tolerances.loops import TOGETHER

        length = self.levels[-1].shape[1]
        count = -(-length // _TILE)
        samples = -(-length // count)
        rows: list[Array] = []
        columns: list[Ints] = []  # of each wave's coordinate; -1 of none
        first = len(self.weights)
        for level in reversed(self.levels):
            rank, missing = len(level), -len(level) % TOGETHER
            first -= rank
            columns.append(np.pad(np.arange(first, first + rank), (0, missing), constant_values=-1))
            parts = level.reshape(rank, level.shape[1] // length, length)
            sets = np.zeros((rank + missing, parts.shape[1], count * samples))
            sets[:rank] = np.pad(parts, ((0, 0), (0, 0), (0, count * samples - length)), "edge")
            tiles = sets.reshape(*sets.shape[:2], count, samples)
            rows.append(tiles.transpose(2, 1, 0, 3).reshape(count, -1, samples))
        order = np.concatenate(columns)
        factor, nominal, weights = (
            np.where(order < 0, 0.0, part[..., order]) for part in (self.factor, self.nominal_factor, self.weights)
        )
        ranks = np.array([len(numbers) for numbers in columns], dtype=np.intp)
        return np.concatenate(rows, axis=1), ranks, factor, nominal, weights

    def places(self, values: Array) -> tuple[Ints, Ints]:
        """Samples of the highest and of the lowest value of each combination, in the first repeat."""
        high, low = np.empty((2, values.shape[0]), dtype=np.intp)
        for part, even, odd in self._folds(values):
            if odd is None:
                even.argmax(axis=1, out=high[part])
                even.argmin(axis=1, out=low[part])
                continue
            swing, every, half = np.abs(odd), np.arange(len(even)), even.shape[1]
            top, bottom = (even + swing).argmax(axis=1), (even - swing).argmin(axis=1)
            high[part] = top + half * (odd[every, top] < 0)
            low[part] = bottom + half * (odd[every, bottom] > 0)
        return high, low

    def _folds(self, values: Array) -> Iterator[tuple[slice, Array, Array | None]]:
        """What of the combinations repeats after the longest half, and what changes its sign.

        A block at a time; the next one overwrites it.  The second part is None where everything repeats.
        """
        lengths = [level.shape[1] for level in self.levels]
        ends = np.cumsum([level.shape[0] for level in self.levels]).tolist()
        rows = _rows(_FOLDED_SAMPLES, lengths[0], values.shape[0])
        products = [np.empty((rows, length)) for length in lengths]
        sums = [np.empty((rows, 2 * length)) for length in lengths[1:-1]]
        for part in _blocks(values.shape[0], rows):
            used = slice(0, part.stop - part.start)
            coordinates = values[part] @ self.factor
            coordinates += self.nominal_factor
            by_level = np.split(coordinates, ends[:-1], axis=1)
            waves = [
                np.matmul(numbers, level, out=product[used])
                for numbers, level, product in zip(by_level, self.levels, products, strict=True)
            ]
            even = waves.pop()
            for odd, both in zip(waves[:0:-1], reversed(sums), strict=True):
                np.add(even, odd, out=both[used, : odd.shape[1]])
                np.subtract(even, odd, out=both[used, odd.shape[1] :])
                even = both[used]
            yield part, even, waves[0] if waves else None


def direct_kernel(waveforms: Array, nominal: Array) -> DirectKernel:
    """Make waveforms ready for the straightforward form; what they are and what is refused as for `kernel`."""
    rows, means, left_out = _centred(waveforms, nominal)
    count = rows.shape[0]
    triangle: Array = np.asarray(np.linalg.qr(rows.T, mode="r"))
    left, values, _ = np.linalg.svd(triangle.T, full_matrices=False)
    noise = 2 * _UNIT_ROUNDOFF * max(rows.shape) * values[0]  # as numpy.linalg.matrix_rank has it
    factor = (left * values)[:, values > noise]
    slack = left_out + _gamma(count + 4) * np.abs(rows).max(axis=1)
    return DirectKernel(*_common(means, factor, slack), waveforms=rows[:-1], nominal=rows[-1])


def folded_kernel(
    waveforms: Array, nominal: Array, *, reach: float = REACH, tolerance: float = TOLERANCE
) -> FoldedKernel:
    """Make waveforms ready for the form by orders; what they are and what is refused as for `kernel`.

    Its `bound_within(reach)` tells whether the tolerance was to be had: rounding may not allow it.

    Notes
    -----
    With h half the angles, (TE(i) + TE(i + h)) / 2 holds the even orders and (TE(i) - TE(i + h)) / 2 the odd ones; the
    even ones are folded again.  On each level the waveforms are written by as few waves as their rank.
    """
    rows, means, left_out = _centred(waveforms, nominal)
    count = rows.shape[0]
    folded = _folded(rows)
    limits = np.append(np.full(count - 1, reach), 1.0)  # of what multiplies each row
    share = tolerance / (4 * len(folded))  # half of the bound is left to rounding
    factors: list[Array] = []
    levels: list[Array] = []
    weights: list[Array] = []
    sizes = np.zeros(count)
    for level in folded:
        factor, basis, rest = _truncated(level, limits, share)
        left_out += rest
        sizes += (np.abs(factor) @ np.abs(basis)).max(axis=1)
        if levels or len(basis) or level is folded[-1]:  # a common repeat leaves nothing on the first levels
            factors.append(factor)
            levels.append(basis)
            weights.append(np.full(len(basis), 1 / level.shape[1]))
    rank = max(len(level) for level in levels)
    slack = left_out + _gamma(count + 2 * rank + 2 * len(folded) + 4) * (sizes + left_out)
    common = _common(means, np.concatenate(factors, axis=1), slack)
    return FoldedKernel(*common, levels=tuple(levels), weights=np.concatenate(weights))


def kernel(waveforms: Array, nominal: Array, *, reach: float = REACH, tolerance: float = TOLERANCE) -> Kernel:
    """Make waveforms ready: the form by orders where it is exact enough and cheaper, else the straightforward one.

    Parameters
    ----------
    waveforms : ndarray, shape (m, n)
        Such as `Stack.scaled`, rad per standard draw.
    nominal : ndarray, shape (n,)
    reach : float
        Largest value that will multiply a waveform.
    tolerance : float
        Bound on the error of a peak-to-peak, as long as no value exceeds `reach`; in the unit of the waveforms.  0 asks
        for the straightforward form.

    Raises
    ------
    ValueError
        If the shapes do not fit or a number is not finite.

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
    if tolerance > 0:
        folded = folded_kernel(waveforms, nominal, reach=reach, tolerance=tolerance)
        if folded.bound_within(reach) <= tolerance and folded.work < _WORTHWHILE * waveforms.size:
            return folded
    return direct_kernel(waveforms, nominal)


def _common(means: Array, factor: Array, slack: Array) -> tuple[Array, float, Array, Array, Array, float]:
    """What every kernel has, the nominal taken off the rows."""
    rows = np.ascontiguousarray(factor[:-1])
    return means[:-1], float(means[-1]), rows, np.ascontiguousarray(factor[-1]), slack[:-1], float(slack[-1])


def _centred(waveforms: Array, nominal: Array) -> tuple[Array, Array, Array]:
    """Waveforms with the nominal below them, without their means; the means; and what that leaves out of each."""
    if waveforms.ndim != 2 or nominal.shape != waveforms.shape[1:] or not nominal.size:
        raise ValueError(f"waveforms {waveforms.shape} and nominal {nominal.shape}: give (m, n) and (n,) with n > 0")
    rows = np.concatenate([waveforms, nominal[None]], dtype=np.float64)
    if not np.isfinite(rows).all():
        raise ValueError("the waveforms or the nominal hold numbers that are not finite; check the model")
    means = rows.mean(axis=1)
    rows -= means[:, None]
    size = np.abs(rows).max(axis=1)
    constant = size <= 8 * _UNIT_ROUNDOFF * np.abs(means)  # but for rounding
    rows[constant] = 0
    return rows, means, np.where(constant, size, 0)


def _folded(rows: Array) -> list[Array]:
    """Parts that change their sign after half of what is left, then what repeats."""
    parts = []
    while rows.shape[1] % 2 == 0 and rows.shape[1] // 2 >= rows.shape[0]:
        first, second = np.split(rows, 2, axis=1)
        parts.append((first - second) / 2)
        rows = (first + second) / 2
    return [*parts, rows]


def _truncated(rows: Array, limits: Array, most: float) -> tuple[Array, Array, Array]:
    """Factors of the least rank whose rest, each row times its limit, adds up to no more than `most`; and the rest."""
    left, values, waves = np.linalg.svd(rows, full_matrices=False)
    left *= values

    def rest(rank: int) -> Array:
        size: Array = np.abs(rows - left[:, :rank] @ waves[:rank]).max(axis=1)
        return size

    rank = bisect.bisect_left(range(len(values)), True, key=lambda r: float(limits @ rest(r)) <= most)
    return left[:, :rank], np.ascontiguousarray(waves[:rank]), rest(rank)


def _gamma(count: int) -> float:
    """Largest relative error of a sum of so many products."""
    return count * _UNIT_ROUNDOFF / (1 - count * _UNIT_ROUNDOFF)


def _rows(most: int, length: int, count: int) -> int:
    """Units in a block of no more than so many samples."""
    return min(count, max(16, most // length))


def _blocks(count: int, size: int) -> list[slice]:
    return [slice(start, min(start + size, count)) for start in range(0, count, size)]
