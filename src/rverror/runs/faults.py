"""What cannot be in a run: spikes, slips of the reading, gaps, doubled rows, jumps of a counter, standstill.

Two passes: on the transmission error as read only what is certain is taken, on the residual of a fitted model the rest,
with the noise's own size.  See docs page ``theory/faults.md``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.chance import chi_square
from rverror.base.numbers import brief, count_of
from rverror.base.text import some
from rverror.base.units import ARCSEC

Index = npt.NDArray[np.intp]
Mask = npt.NDArray[np.bool_]

_TURN = 2 * math.pi
# Median and 80 % quantile of the size of a standard normal.
_MEDIAN_SIZE = 0.67449
_MOST_SIZE = 1.28155
# Neighbours on one side of the parabola that predicts a sample as read: bears orders up to some 200 at 2048 samples.
_NEAR = 8
_WIDEST_SLIP = 3  # samples in transition
# Rounds of finding: each takes the largest of a neighbourhood, so that it no longer spoils its neighbours.
_ROUNDS = 12


@dataclass(frozen=True, kw_only=True)
class FaultBounds:
    """Thresholds, each with its reason.

    Attributes
    ----------
    certain : float
        First pass: a spike or slip is larger than so many times the local scatter of what neighbours predict.  Gear
        error is no Gaussian noise, so this is no level of chance: in clean runs of the loaded equilibrium, with kinks
        and content near the Nyquist order, the largest seen was below 6.
    chance : float
        Second pass: probability that a clean run gets a spike, and that it gets a slip, shared over all positions and
        lengths of a burst.
    longest_burst : int
        A burst of more samples is a stretch between two slips.
    reach : int
        Samples on each side whose mean levels a slip is told from, together with a common trend.  With the trend free,
        200 tell as much as 50 would without it; a longer reach would see slow changes of the gear error as slips.
    least_side : int
        A slip has so many samples at least on each side of it: of fewer, one cannot tell it from a burst.
    counts : float
        A jump of fewer counts of the encoder is its rounding.
    even_gap : float
        Where steps are even, one above so many usual steps has lost samples: 1 is usual, 2 is one sample lost.
    uneven_gap : float
        The same where steps are uneven, so that single lost samples cannot be told.
    standstill : int
        So many samples in a row at one angle, or ten times the usual number, are a standstill, not doubled rows.
    most_spikes : float
        Largest share of spikes.  Robust scatter is taken from the 80 % quantile in blocks; a share of 5 % moves it by
        less than a tenth.  More is a channel that is broken, not one with outliers.
    most_slips : int
        Largest number of slips: each costs an unknown level, and a reading that slips oftener is not to be trusted.
    """

    certain: float = 8.0
    chance: float = 1e-3
    longest_burst: int = 5
    reach: int = 200
    least_side: int = 12
    counts: float = 2.5
    even_gap: float = 1.5
    uneven_gap: float = 3.0
    standstill: int = 16
    most_spikes: float = 0.05
    most_slips: int = 20


@dataclass(frozen=True)
class Slip:
    """A step of the reading: every later sample is shifted.

    Attributes
    ----------
    index : int
        First sample after it.
    theta : float
        Nominal output angle there, rad.
    size : float
        Reading after less reading before, rad.
    uncertainty : float
        One standard deviation of the size, rad.
    """

    index: int
    theta: float
    size: float
    uncertainty: float


@dataclass(frozen=True)
class Gap:
    """A place where the angle goes on by more than a step, or jumps back.

    Attributes
    ----------
    index : int
        First sample after it.
    theta : float
        Last angle before it, rad.
    span : float
        Angle that is missing, rad: the step less a usual one; negative where the angle jumps back.
    samples : int
        How many samples that would have been; 0 for a jump back.
    """

    index: int
    theta: float
    span: float
    samples: int


@dataclass(frozen=True, eq=False)
class Faults:
    """What cannot be in a run, by index into the samples as given.

    Attributes
    ----------
    theta : ndarray, shape (n,)
        Nominal output angle, rad.
    kept : ndarray of bool, shape (n,)
        Samples to use: no spike, no doubled row, no transition of a slip, no standstill.
    spikes : ndarray of int
        Samples off by themselves, bursts included.
    sizes : ndarray
        How far each spike is off, rad.
    slips : tuple of Slip
        Their shifts are not undone: a fit gives each a level of its own from `Slip.index` on.
    gaps : tuple of Gap
    doubled : int
        Rows that repeat the one before.
    still : tuple of (int, int)
        First sample and number of samples of each standstill; the first is kept.
    turned : tuple of int
        First samples after the direction has changed.
    count : float
        Count of the encoder, rad; 0 where the reading is not on counts.
    """

    theta: Array
    kept: Mask
    spikes: Index
    sizes: Array
    slips: tuple[Slip, ...] = ()
    gaps: tuple[Gap, ...] = ()
    doubled: int = 0
    still: tuple[tuple[int, int], ...] = ()
    turned: tuple[int, ...] = ()
    count: float = 0.0

    @property
    def segments(self) -> list[slice]:
        """Unbroken stretches of the samples that are kept, as slices of ``theta[kept]``: a noise filter restarts at each.

        A gap, a sample set aside, a change of direction and a slip break the series; a doubled row does not.
        """
        return _segments(self)

    def levels(self) -> npt.NDArray[np.intp]:
        """Number of the level at each sample, shape (n,): 0 before the first slip, one more after each."""
        places = np.array([slip.index for slip in self.slips], dtype=np.intp)
        return np.searchsorted(places, np.arange(self.theta.size), side="right")

    def notes(self) -> tuple[str, ...]:
        """One line for each kind of fault: how many, where, how large; empty for a clean run."""
        return _notes(self)


def find_faults(
    theta: Array,
    error: Array,
    *,
    residual: bool = False,
    earlier: Faults | None = None,
    bounds: FaultBounds | None = None,
) -> Faults:
    """Find what cannot be in a run.

    Parameters
    ----------
    theta : ndarray, shape (n,)
        Nominal output angle in order of time, rad.
    error : ndarray, shape (n,)
        Transmission error, rad; with `residual` what a fitted model leaves of it.
    residual : bool
        Whether `error` is a residual, so that what neighbours share is noise: the second pass.
    earlier : Faults, optional
        What the first pass found; its samples are not looked at again, and the result holds both.  The fit that left
        the residual has to give each of its slips a level of its own: what is left of a step adds to it.
    bounds : FaultBounds, optional

    Returns
    -------
    Faults

    Raises
    ------
    ValueError
        If more is wrong than can be left out; one line with count, bound and remedy.

    Examples
    --------
    >>> theta = np.linspace(0.0, 6.0, 600)
    >>> error = 1e-5 * np.sin(9 * theta) + 1e-7 * np.random.default_rng(1).standard_normal(600)
    >>> error[321] += 1e-4
    >>> find_faults(theta, error).notes()
    ('1 spike set aside (sample 321, 20.6 arcsec)',)
    """
    bounds = bounds or FaultBounds()
    theta, error = np.asarray(theta, dtype=np.float64), np.asarray(error, dtype=np.float64)
    if theta.ndim != 1 or theta.shape != error.shape or not (np.isfinite(theta).all() and np.isfinite(error).all()):
        raise ValueError("angle and error have to be rows of finite numbers, of the same length")
    found = _series(theta, error, bounds) if earlier is None else earlier
    for stretch in _stretches(found):
        if np.count_nonzero(found.kept[stretch]) >= 4 * _NEAR:
            found = (_left_over if residual else _certain)(found, error, stretch, bounds)
            _check_shares(found, bounds)
    return found


# --- the series of angles ---------------------------------------------------------------------------------------------


def _series(theta: Array, error: Array, bounds: FaultBounds) -> Faults:
    """What the angles alone tell: doubled rows, standstill, gaps, changes of direction."""
    n = theta.size
    kept = np.ones(n, dtype=bool)
    none = Faults(theta, kept, np.zeros(0, dtype=np.intp), np.zeros(0), count=_count(theta, error))
    if n < 2 * _NEAR:
        return none
    same = np.concatenate([[False], np.diff(theta) == 0])
    starts = np.flatnonzero(np.diff(np.concatenate([same, [False]]).astype(np.int8), prepend=0) == 1)
    ends = np.flatnonzero(np.diff(np.concatenate([same, [False]]).astype(np.int8), prepend=0) == -1)
    lengths = ends - starts + 1  # the first of them does not repeat anything
    usual = n / np.count_nonzero(~same)
    long = lengths >= max(bounds.standstill, 10 * usual)
    still = tuple((int(a) - 1, int(b)) for a, b in zip(starts[long], lengths[long], strict=True))
    for first, number in still:
        kept[first + 1 : first + number] = False
    doubled = same & kept & np.concatenate([[False], np.diff(error) == 0])
    kept &= ~doubled
    places = np.flatnonzero(kept)
    turned = _turned(theta[places])
    gaps = _gaps(theta[places], turned, bounds)
    return replace(
        none,
        kept=kept,
        gaps=tuple(replace(gap, index=int(places[gap.index])) for gap in gaps),
        doubled=int(np.count_nonzero(doubled)),
        still=still,
        turned=tuple(int(places[i]) for i in turned),
    )


def _turned(theta: Array) -> list[int]:
    """First samples of another direction: the extremes of an angle that goes back by more than jitter."""
    steps = np.abs(np.diff(theta))
    if not steps.any():
        return []
    jitter = min(10 * float(np.median(steps[steps > 0])), float(np.ptp(theta)) / 4)
    sense = np.sign(np.diff(theta))
    if (sense >= 0).all() or (sense <= 0).all():
        return []
    # From the running extreme of each side; few values are left once small steps back are out.
    turned: list[int] = []
    way, extreme = 0, 0
    low = high = 0
    for i in range(theta.size):
        if way == 0:
            low = i if theta[i] < theta[low] else low
            high = i if theta[i] > theta[high] else high
            if theta[high] - theta[low] > jitter:
                way = 1 if high > low else -1
                extreme = i
        elif way * (theta[i] - theta[extreme]) >= 0:
            extreme = i
        elif way * (theta[extreme] - theta[i]) > jitter:
            turned.append(extreme + 1)
            way, extreme = -way, i
    return turned


def _gaps(theta: Array, turned: list[int], bounds: FaultBounds) -> list[Gap]:
    """Steps too long for their neighbourhood, and steps back."""
    steps = np.diff(theta)
    size = np.abs(steps)
    if not size.any():
        return []
    usual = np.maximum(_blockwise(size, 64, _median_of)[0], float(np.median(size[size > 0])) * 1e-3)
    padded = np.pad(size, 3, mode="edge")
    near = np.median(np.stack([padded[i : i + size.size] for i in (0, 1, 2, 4, 5, 6)]), axis=0)
    usual = np.maximum(usual, near)
    ratio = size / usual
    even = np.quantile(np.abs(ratio - 1), 0.9) < 0.1
    bound = bounds.even_gap if even else bounds.uneven_gap
    gaps = []
    for i in np.flatnonzero(ratio > bound * (1 + 1e-9)):
        around = steps[max(i - 3, 0) : i + 4]
        back = i + 1 not in turned and steps[i] * (np.sum(np.sign(around)) - np.sign(steps[i])) < 0
        if back:
            gaps.append(Gap(int(i) + 1, float(theta[i]), -float(size[i]), 0))
        else:
            span = float(size[i] - usual[i])
            gaps.append(Gap(int(i) + 1, float(theta[i]), span, round(ratio[i]) - 1))
    return gaps


def _stretches(found: Faults) -> list[slice]:
    """Samples between changes of direction: there the reading jumps by the lost motion, and rightly."""
    edges = [0, *found.turned, found.theta.size]
    return [slice(a, b) for a, b in zip(edges, edges[1:], strict=False) if b > a]


def _segments(found: Faults) -> list[slice]:
    n = found.theta.size
    broken = np.zeros(n + 1, dtype=bool)
    for i in (*found.turned, *(gap.index for gap in found.gaps), *(slip.index for slip in found.slips)):
        broken[i] = True
    # A sample set aside leaves a hole behind it, unless it only repeats its neighbour's angle.
    again = np.concatenate([[False], np.diff(found.theta) == 0])
    broken[1:] |= ~found.kept & ~again
    passed = np.cumsum(broken[:n])[found.kept]
    edges = [0, *(np.flatnonzero(np.diff(passed)) + 1).tolist(), passed.size]
    return [slice(a, b) for a, b in zip(edges, edges[1:], strict=False) if b > a]


def _count(theta: Array, error: Array) -> float:
    """Count to which the reading theta + error is rounded, rad; 0 where its values lie on no grid."""
    values = np.unique(theta + error)
    apart = np.diff(values)
    apart = apart[apart > 1e-9 * ARCSEC + 8 * np.spacing(np.max(np.abs(values), initial=1.0))]
    if apart.size < 2 * _NEAR:
        return 0.0
    least = float(np.quantile(apart, 0.02))
    apart = apart[apart < 20 * least]
    off = np.abs(apart - least * np.rint(apart / least))
    # On a grid of even nominal angles the reading is off by the error's own changes, on counts by printed digits.
    on_counts = off.mean() < 0.1 * np.abs(np.diff(error)).mean() and np.mean(off < 0.05 * least) > 0.98
    return least if apart.size >= _NEAR and on_counts else 0.0


# --- scatter ----------------------------------------------------------------------------------------------------------


def _median_of(values: Array) -> Array:
    return np.asarray(np.median(values, axis=-1), dtype=np.float64)


def _scatter_of(values: Array) -> Array:
    """Standard deviation by median and 80 % quantile of the sizes, the larger: bears a tenth of outliers."""
    middle, most = np.quantile(np.abs(values), [0.5, 0.8], axis=-1)
    return np.asarray(np.maximum(middle / _MEDIAN_SIZE, most / _MOST_SIZE), dtype=np.float64)


def _scatter_about_level(values: Array) -> Array:
    return _scatter_of(values - np.median(values, axis=-1, keepdims=True))


def _blockwise(values: Array, size: int, measure: Callable[[Array], Array]) -> tuple[Array, float]:
    """Measure blocks: the largest of three neighbours at every sample, and the median of all."""
    count = values.size // size
    if count < 2:
        one = float(measure(values[None])[0])
        return np.full(values.size, one), one
    blocks = measure(values[: count * size].reshape(count, size))
    wide = np.pad(blocks, 1, mode="edge")
    largest = np.maximum(np.maximum(wide[:-2], wide[1:-1]), wide[2:])
    at = np.minimum(np.arange(values.size) // size, count - 1)  # what is left over belongs to the last block
    return largest[at], float(np.median(blocks))


# --- first pass: what neighbours cannot predict -----------------------------------------------------------------------


def _certain(found: Faults, error: Array, stretch: slice, bounds: FaultBounds) -> Faults:
    """Spikes and slips in a run as read, against parabolas through the neighbours on each side."""
    kept = found.kept.copy()
    spikes: dict[int, float] = {}
    slips: list[Slip] = []
    pieces = _pieces(found, stretch)
    for places in pieces:
        if places.size < 4 * _NEAR:
            continue
        values = error[places].copy()
        sides = _Sides(found.theta[places])
        floor = bounds.counts * found.count
        for _ in range(_ROUNDS):
            off = _bursts(sides, values, floor, bounds)
            if not off:
                break
            for at, size in off.items():
                spikes[int(places[at])] = spikes.get(int(places[at]), 0.0) + size
                # a stand-in from both sides, so that it no longer spoils its neighbours; it is not used otherwise
                values[at] -= size
        for at, width, size, spread in _steps(sides, values, floor, bounds):
            slips.append(Slip(int(places[at + width]), float(found.theta[places[at + width]]), size, spread))
            kept[places[at : at + width]] = False
    at = np.array(sorted(spikes), dtype=np.intp)
    kept[at] = False
    return _joined(found, kept, {i: spikes[i] for i in at.tolist()}, slips)


def _pieces(found: Faults, stretch: slice) -> list[Index]:
    """Indices of the samples kept in a stretch, cut at long gaps and jumps back: no parabola bridges those."""
    places = np.flatnonzero(found.kept[stretch]) + stretch.start
    cuts = [gap.index for gap in found.gaps if gap.samples == 0 or gap.samples > 2]
    return np.split(places, np.searchsorted(places, cuts))


class _Sides:
    """Least-squares parabolas through the neighbours on each side of every sample of a piece."""

    def __init__(self, theta: Array) -> None:
        steps = np.abs(np.diff(theta))
        usual = float(np.median(steps[steps > 0])) if steps.any() else 1.0
        self.at = (theta - theta[0]) / usual
        even = bool(np.max(np.abs(steps / usual - 1)) < 0.02)
        self._before = self._solved(-_NEAR, even)
        self._after = self._solved(0, even)
        self.size = theta.size

    def _solved(self, first: int, even: bool) -> Array:
        """Matrices from neighbours to coefficients over the distance from k, shape (n or 1, degree + 1, near)."""
        if even:
            x = np.sign(self.at[-1]) * np.arange(first, first + _NEAR, dtype=np.float64)[None]
        else:
            windows = np.lib.stride_tricks.sliding_window_view(self.at, _NEAR)
            centres = self.at[_NEAR:] if first else self.at[: windows.shape[0]]
            x = windows[: centres.size] - centres[:, None]
        v = np.stack([np.ones_like(x), x, x * x], axis=-1)
        normal = np.swapaxes(v, 1, 2) @ v
        normal[:, range(3), range(3)] += 1e-9  # several samples at one angle
        return np.asarray(np.linalg.solve(normal, np.swapaxes(v, 1, 2)), dtype=np.float64)

    def fitted(self, values: Array) -> tuple[Array, Array]:
        """Coefficients, shape (n, 3) each: through the samples before k, through those from k on; 0 at the ends."""
        windows = np.lib.stride_tricks.sliding_window_view(values, _NEAR)
        before, after = np.zeros((self.size, 3)), np.zeros((self.size, 3))
        before[_NEAR:] = np.einsum(
            "kij,kj->ki", np.broadcast_to(self._before, (self.size - _NEAR, 3, _NEAR)), windows[: self.size - _NEAR]
        )
        after[: windows.shape[0]] = np.einsum(
            "kij,kj->ki", np.broadcast_to(self._after, (windows.shape[0], 3, _NEAR)), windows
        )
        return before, after


def _along(coefficients: Array, x: Array) -> Array:
    return np.asarray(coefficients[:, 0] + x * (coefficients[:, 1] + x * coefficients[:, 2]), dtype=np.float64)


def _bursts(sides: _Sides, values: Array, floor: float, bounds: FaultBounds) -> dict[int, float]:
    """Samples that both sides say are off, with how far; of neighbours the worst only."""
    before, after = sides.fitted(values)
    best, off_by = np.zeros(sides.size), {}
    lengths = np.zeros(sides.size, dtype=np.intp)
    for length in range(1, bounds.longest_burst + 1):
        k = np.arange(_NEAR, sides.size - length - _NEAR + 1)  # first of the burst
        if not k.size:
            break
        off, by_left, by_right = np.empty((3, length, k.size))
        for j in range(length):
            x, value = sides.at[k + j], values[k + j]
            by_left[j] = value - _along(before[k], x - sides.at[k])
            by_right[j] = value - _along(after[k + length], x - sides.at[k + length])
            # The errors of the two parabolas are of odd degree, so that the mean of both has little.
            share = (j + 1) / (length + 1)
            off[j] = (1 - share) * by_left[j] + share * by_right[j]
        mean = off.mean(axis=0)
        sense, half = np.sign(mean), 0.5 * np.abs(mean)
        # A kink is foreseen from one of its sides, and so is a slip: only what neither foresees is off by itself.
        alone = (np.minimum(sense * by_left, sense * by_right).min(axis=0) > half) & ((sense * off).min(axis=0) > half)
        scatter = np.maximum(*_blockwise(mean, 64, _scatter_of))
        sure = alone & (np.abs(mean) > floor) & (np.abs(mean) > bounds.certain * scatter)
        score = np.where(sure, np.abs(mean) / np.where(sure, scatter, 1.0), 0.0)
        better = score > best[k]
        best[k[better]], lengths[k[better]] = score[better], length
        off_by[length] = off
    found: dict[int, float] = {}
    for first in _peaks(best, 0.0, 2 * _NEAR):
        length = int(lengths[first])
        found |= {first + j: float(off_by[length][j, first - _NEAR]) for j in range(length)}
    return found


def _peaks(score: Array, bound: float, apart: int) -> list[int]:
    """Places above a bound, the largest first, so far apart."""
    above = np.flatnonzero(score > bound)
    taken: list[int] = []
    for k in above[np.argsort(-score[above], kind="stable")].tolist():
        if all(abs(k - other) > apart for other in taken):
            taken.append(k)
    return taken


def _steps(sides: _Sides, values: Array, floor: float, bounds: FaultBounds) -> list[tuple[int, int, float, float]]:
    """Slips: first sample off the old level, samples in transition, size and its standard deviation."""
    values = values.copy()
    found: list[tuple[int, int, float, float]] = []
    for _ in range(_ROUNDS):
        before, after = sides.fitted(values)
        best, sizes, spreads = np.zeros(sides.size), np.zeros(sides.size), np.zeros(sides.size)
        widths = np.zeros(sides.size, dtype=np.intp)
        change = np.abs(np.diff(values, prepend=values[0]))
        for width in range(_WIDEST_SLIP + 1):
            k = np.arange(_NEAR, sides.size - width - _NEAR + 1)
            if not k.size:
                break
            x = 0.5 * (sides.at[k - 1] + sides.at[k + width])
            step = _along(after[k + width], x - sides.at[k + width]) - _along(before[k], x - sides.at[k])
            # The change itself has to be as abrupt as nothing near it: gear error rises over several samples.
            rise = np.abs(values[k + width] - values[k - 1])
            sudden = rise > np.maximum(2 * (width + 1) * _largest_near(change, width)[k], 0.5 * np.abs(step))
            scatter = np.maximum(*_blockwise(step, 64, _scatter_of))
            sure = sudden & (np.abs(step) > floor) & (np.abs(step) > bounds.certain * scatter)
            score = np.where(sure, np.abs(step) / np.where(sure, scatter, 1.0), 0.0)
            better = score > 1.1 * best[k]  # the narrower one unless the wider is clearly better
            at = k[better]
            best[at], widths[at], sizes[at], spreads[at] = score[better], width, step[better], scatter[better]
        taken = _peaks(best, 0.0, 2 * _NEAR)
        if not taken:
            break
        for first in taken:
            values[first + widths[first] :] -= sizes[first]
            found.append((first, int(widths[first]), float(sizes[first]), float(spreads[first])))
    return found


def _largest_near(change: Array, width: int) -> Array:
    """Largest change from one sample to the next near k, but for those from k - 1 to k + width."""
    n, reach = change.size, _NEAR - 1
    padded = np.pad(change, (reach, reach + width))
    offsets = (*range(-reach, 0), *range(width + 1, width + reach + 1))
    return np.asarray(np.max([padded[reach + o : reach + o + n] for o in offsets], axis=0), dtype=np.float64)


# --- second pass: what coloured noise cannot do -----------------------------------------------------------------------

_ORDER = 24  # of the autoregressive filter: white noise beside a correlation over 40 samples is forgotten over 6
_BLOCK = 512  # samples whose mean and trend are taken off before the noise's colour is read: slips spoil one block only


def _left_over(found: Faults, error: Array, stretch: slice, bounds: FaultBounds) -> Faults:
    """Spikes and slips in the residual of a model: likelihood ratios against the coloured noise."""
    grid, pieces = _grid(found, stretch)
    size = pieces[-1][1]
    values = np.zeros(size)
    values[grid[:, 1]] = error[grid[:, 0]]
    good = np.zeros(size, dtype=bool)
    good[grid[:, 1]] = True
    back = np.full(size + 1, -1)
    back[grid[:, 1]] = grid[:, 0]
    if np.ptp(values[good]) == 0:
        return found
    floor = bounds.counts * found.count
    kept = found.kept.copy()
    spikes: dict[int, float] = {}
    tests = np.count_nonzero(good)
    spike_bound = math.sqrt(chi_square(bounds.chance / (tests * bounds.longest_burst), 1))
    slip_bound = math.sqrt(chi_square(bounds.chance / tests, 1))
    slip_at: dict[int, tuple[float, float]] = {}  # by place in the series: size, standard deviation
    for _ in range(_ROUNDS):
        colour = _colour(values, good, pieces)
        white = _whitened(values, good, pieces, colour)
        off, step = _spike_scores(white, bounds), _slip_scores(white, bounds)
        for k, (size_, _) in slip_at.items():  # sizes of known slips follow the colour, now that it is better known
            values[k:] -= step.size[k]
            slip_at[k] = (size_ + float(step.size[k]), float(step.spread[k]))
        off_score = np.where(np.abs(off.size) > floor, off.score / spike_bound, 0.0)
        step_score = np.where(np.abs(step.size) > floor, step.score / slip_bound, 0.0)
        new = [(off_score[k], k, True) for k in _peaks(off_score, 1.0, _ORDER)]
        new += [(step_score[k], k, False) for k in _peaks(step_score, 1.0, bounds.reach)]
        taken: list[tuple[int, int]] = []
        for _, k, single in sorted(new, reverse=True):
            # What is near a larger one waits until that is out.
            if any(abs(k - other) <= wait for other, wait in taken):
                continue
            if single:
                taken.append((k, _ORDER))
                for j in range(k, min(k + int(off.length[k]), size)):
                    if good[j]:
                        good[j] = False
                        spikes[int(back[j])] = float(off.size[k])
                continue
            taken.append((k, bounds.reach))
            doubtful = step.score**2 < step.score[k] ** 2 - _DOUBT
            first = k - int(np.argmax(doubtful[k::-1])) + 1
            last = k + int(np.argmax(doubtful[k:]))
            good[first:last] = False
            inside = back[first:last]
            kept[inside[inside >= 0]] = False
            values[k:] -= step.size[k]
            slip_at[k] = (float(step.size[k]), float(step.spread[k]))
        if not taken:
            break
    kept[list(spikes)] = False
    slips = []
    for k, (size_, spread) in slip_at.items():
        index = int(back[k:][back[k:] >= 0][0])
        slips.append(Slip(index, float(found.theta[index]), size_, spread))
    return _joined(found, kept, spikes, slips)


_DOUBT = 6.0  # a slip may be where twice the log likelihood is less by no more: 98.6 % of chance for one unknown


def _grid(found: Faults, stretch: slice) -> tuple[npt.NDArray[np.intp], list[tuple[int, int]]]:
    """Samples kept and their places in a series of even steps, shape (m, 2); the series' unbroken pieces.

    One to three samples missing between neighbours leave a hole that the filter bridges; a longer gap breaks the series.
    """
    steps = np.ones(found.theta.size + 1, dtype=np.intp)
    again = np.concatenate([[False], np.diff(found.theta) == 0]) & ~found.kept
    steps[:-1][again] = 0  # doubled rows take no time; of a standstill nothing is known
    cuts = []
    for gap in found.gaps:
        if stretch.start < gap.index < stretch.stop:
            if 1 <= gap.samples <= 3:
                steps[gap.index] += gap.samples
            else:
                cuts.append(gap.index)
    cuts += [first for first, _ in found.still if stretch.start < first < stretch.stop]
    place = np.cumsum(steps[stretch]) - steps[stretch.start]
    samples = np.flatnonzero(found.kept[stretch])
    grid = np.column_stack([samples + stretch.start, place[samples]]).astype(np.intp)
    size = int(place[-1]) + 1
    edges = [0, *sorted({int(place[cut - stretch.start]) for cut in cuts} - {0}), size]
    return grid, [(a, b) for a, b in zip(edges, edges[1:], strict=False) if b > a]


@dataclass(frozen=True, eq=False)
class _Colour:
    """Autoregressive model of the noise.

    Attributes
    ----------
    filters : ndarray, shape (order + 1, order + 1)
        Row p: the prediction error filter of order p, 1 first.
    spread : ndarray, shape (order + 1,)
        Standard deviation of its output.
    """

    filters: Array
    spread: Array


def _colour(values: Array, good: Mask, pieces: list[tuple[int, int]]) -> _Colour:
    """Read the noise's colour: autocovariance of blocks without mean and trend, large values cut."""
    order = min(_ORDER, max(np.count_nonzero(good) // 8, 1))
    level = np.zeros(order + 1)
    count = 0
    for first, last in pieces:
        number = max(round((last - first) / _BLOCK), 1)
        for a, b in zip(
            np.linspace(first, last, number + 1).astype(int)[:-1],
            np.linspace(first, last, number + 1).astype(int)[1:],
            strict=True,
        ):
            use = good[a:b]
            if np.count_nonzero(use) < 2 * _NEAR:
                continue
            x = np.linspace(-1, 1, b - a)
            part = values[a:b]
            level_, slope = part[use].mean(), 0.0
            slope = float(((part[use] - level_) @ x[use]) / (x[use] @ x[use]))
            rest = np.where(use, part - level_ - slope * (x - x[use].mean()), 0.0)
            cut = 4 * float(_scatter_of(rest[use]))
            rest = np.clip(rest, -cut, cut)
            padded = np.concatenate([rest, np.zeros(order)])
            level += np.array([rest @ padded[h : h + rest.size] for h in range(order + 1)])
            count += int(np.count_nonzero(use))
    level /= max(count, 1)
    filters, spread = np.zeros((order + 1, order + 1)), np.zeros(order + 1)
    filters[:, 0] = 1.0
    variance = level[0] if level[0] > 0 else 1.0
    spread[0] = math.sqrt(variance)
    for p in range(1, order + 1):  # Levinson's recursion: filters of every order on the way
        last = filters[p - 1, :p]
        reflection = -float(last @ level[p:0:-1]) / variance
        filters[p, : p + 1] = np.append(last, 0.0) + reflection * np.append(last, 0.0)[::-1]
        variance *= max(1.0 - reflection * reflection, 1e-6)
        spread[p] = math.sqrt(variance)
    return _Colour(filters, spread)


@dataclass(frozen=True, eq=False)
class _Whitened:
    """Innovations of the residual, of a constant and of a trend, in units of their scatter; 0 where no sample is.

    Attributes
    ----------
    values, level, trend : ndarray, shape (n,)
    good : ndarray of bool, shape (n,)
    local : ndarray, shape (n,)
        Scatter near each sample, 1 or more.
    filter : ndarray, shape (order + 1,)
        What makes the innovations of the residual.
    """

    values: Array
    level: Array
    trend: Array
    good: Mask
    local: Array
    filter: Array


def _whitened(values: Array, good: Mask, pieces: list[tuple[int, int]], colour: _Colour) -> _Whitened:
    columns = np.stack([values, np.ones(values.size), np.linspace(-1, 1, values.size)])
    order = colour.spread.size - 1
    out = np.zeros_like(columns)
    for first, last in pieces:
        part = columns[:, first:last].copy()
        for k in np.flatnonzero(~good[first:last]).tolist():
            p = min(k, order)  # a hole is what its past says, so that it adds nothing
            part[:, k] = -part[:, k - p : k] @ colour.filters[p, p:0:-1] if p else 0.0
        for row, into in zip(part, out[:, first:last], strict=True):
            into[:] = np.convolve(row, colour.filters[order])[: row.size] / colour.spread[order]
        for k in range(min(order, last - first)):
            out[:, first + k] = part[:, k::-1][:, : k + 1] @ colour.filters[k, : k + 1] / colour.spread[k]
    out[:, ~good] = 0.0
    have = np.flatnonzero(good)
    local, scatter = _blockwise(out[0, have], 256, _scatter_about_level)
    scatter = scatter or 1.0
    out /= scatter
    local = np.maximum(local / scatter, 1.0)[np.minimum(np.searchsorted(have, np.arange(good.size)), have.size - 1)]
    return _Whitened(out[0], out[1], out[2], good, local, colour.filters[order] / (colour.spread[order] * scatter))


@dataclass(frozen=True, eq=False)
class _Scores:
    """Size of a fault at each sample by generalised least squares, its standard deviation, their quotient."""

    size: Array
    spread: Array
    score: Array
    length: Index


def _ahead(values: Array, kernel: Array) -> Array:
    """Sum over j of kernel_j values_(k + j), at every k."""
    return np.asarray(np.convolve(values, kernel[::-1])[kernel.size - 1 :], dtype=np.float64)


def _between(values: Array, first: Index, last: Index) -> Array:
    """Sum of the values from one place to before another."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    return np.asarray(total[last] - total[np.minimum(first, last)], dtype=np.float64)


def _spike_scores(white: _Whitened, bounds: FaultBounds) -> _Scores:
    n = white.values.size
    size, spread, score = np.zeros(n), np.ones(n), np.zeros(n)
    length = np.ones(n, dtype=np.intp)
    k = np.arange(n)
    low, high = np.maximum(k - bounds.reach, 0), np.minimum(k + bounds.reach, n)
    with np.errstate(divide="ignore", invalid="ignore"):
        level = _between(white.level * white.values, low, high) / _between(white.level**2, low, high)
    about = white.values - np.where(np.isfinite(level), level, 0.0) * white.level
    for number in range(1, bounds.longest_burst + 1):
        kernel = np.convolve(white.filter, np.ones(number))
        power = _ahead(white.good * 1.0, kernel**2)
        got = _ahead(about, kernel)
        with np.errstate(divide="ignore", invalid="ignore"):
            this = np.where((power > 0.25 * (kernel @ kernel)) & white.good, np.abs(got) / np.sqrt(power), 0.0)
        this = this / white.local
        better = this > score
        score[better], length[better] = this[better], number
        size[better] = (got / np.where(power > 0, power, 1.0))[better]
        spread[better] = (white.local / np.sqrt(np.where(power > 0, power, 1.0)))[better]
    return _Scores(size, spread, score, length)


def _slip_scores(white: _Whitened, bounds: FaultBounds) -> _Scores:
    """Step at each sample, fitted together with a level and a trend over `reach` samples on each side."""
    n = white.values.size
    k = np.arange(n)
    low, high = np.maximum(k - bounds.reach, 0), np.minimum(k + bounds.reach, n)

    # The whitened step rises as the running sum of the filter, and is the whitened level from there on.
    rise = np.cumsum(white.filter)
    order = rise.size
    settled = np.minimum(k + order, high)
    good = white.good * 1.0

    def with_step(values: Array) -> Array:
        return _ahead(values * good, rise) + _between(values * white.level, settled, high)

    own = _ahead(good, rise**2) + _between(white.level**2, settled, high)
    by_level, by_trend, by_value = with_step(white.level), with_step(white.trend), with_step(white.values)
    a, b, c = (
        _between(x * y, low, high)
        for x, y in ((white.level, white.level), (white.level, white.trend), (white.trend, white.trend))
    )
    p, q = _between(white.level * white.values, low, high), _between(white.trend * white.values, low, high)
    with np.errstate(divide="ignore", invalid="ignore"):
        turned = by_trend - by_level * b / a
        rest = c - b * b / a
        power = own - by_level**2 / a - turned**2 / rest
        got = by_value - by_level * p / a - turned * (q - p * b / a) / rest
        before, behind = _between(good, low, k), _between(good, k, high)
        sure = (np.minimum(before, behind) >= bounds.least_side) & (power > 1e-6 * own)
        score = np.where(sure & white.good, np.abs(got) / np.sqrt(power), 0.0) / white.local
        size = np.where(sure, got / power, 0.0)
        spread = np.where(sure, white.local / np.sqrt(power), 1.0)
    return _Scores(size, spread, score, np.ones(n, dtype=np.intp))


# --- what is said -----------------------------------------------------------------------------------------------------


def _joined(found: Faults, kept: Mask, spikes: dict[int, float], slips: list[Slip]) -> Faults:
    """Add spikes and slips to those that are known; a slip found again adds to it, a spike beside it is part of it."""
    known = {slip.index: slip for slip in found.slips}
    for slip in slips:
        near = next((i for i in known if abs(i - slip.index) <= _WIDEST_SLIP), None)
        if near is None:
            known[slip.index] = slip
        else:
            known[near] = replace(known[near], size=known[near].size + slip.size, uncertainty=slip.uncertainty)
    places = np.array(sorted(known), dtype=np.intp)
    sizes = dict(zip(found.spikes.tolist(), found.sizes.tolist(), strict=True)) | spikes
    for i in [i for i in sizes if places.size and np.min(np.abs(places - i)) <= _WIDEST_SLIP]:
        del sizes[i]  # it is out, as the slip's transition
    at = np.array(sorted(sizes), dtype=np.intp)
    return replace(
        found,
        kept=kept,
        spikes=at,
        sizes=np.array([sizes[i] for i in at.tolist()], dtype=np.float64),
        slips=tuple(known[i] for i in places.tolist()),
    )


def _check_shares(found: Faults, bounds: FaultBounds) -> None:
    count, n = found.spikes.size, found.theta.size
    if count > max(bounds.most_spikes * n, 3):
        raise ValueError(
            f"{count} of {n} samples ({100 * count / n:.1f} %) are spikes, at most {100 * bounds.most_spikes:g} % may be "
            "set aside: the channel is broken; check cable, earth and encoder, and measure again"
        )
    if len(found.slips) > bounds.most_slips:
        raise ValueError(
            f"the reading slips {len(found.slips)} times, at most {bounds.most_slips} may be borne: check the coupling of "
            "the encoder and its counter, and measure again"
        )


def _notes(found: Faults) -> tuple[str, ...]:
    lines = []
    if found.spikes.size:
        largest = float(np.max(np.abs(found.sizes))) / ARCSEC
        upto = "up to " if found.spikes.size > 1 else ""
        what = "sample" + ("s" if found.spikes.size > 1 else "")
        lines.append(
            f"{count_of(found.spikes.size, 'spike')} set aside ({what} {some(found.spikes.tolist())}, "
            f"{upto}{brief(largest, 3)} arcsec)"
        )
    for slip in found.slips:
        lines.append(
            f"the reading slips by {brief(slip.size / ARCSEC, 4)} +- {brief(slip.uncertainty / ARCSEC, 2)} arcsec at "
            f"sample {slip.index} ({brief(math.degrees(slip.theta), 6)} deg): every later sample is shifted"
        )
    lost = [gap for gap in found.gaps if gap.samples]
    if lost:
        widest = max(lost, key=lambda gap: gap.span)
        lines.append(
            f"{count_of(len(lost), 'gap')}, {count_of(sum(gap.samples for gap in lost), 'sample')} missing "
            f"(the widest, {brief(math.degrees(widest.span), 3)} deg, before sample {widest.index})"
        )
    for gap in found.gaps:
        if not gap.samples:
            lines.append(
                f"the angle jumps back by {brief(math.degrees(-gap.span), 4)} deg at sample {gap.index}: two runs in one, "
                "or a counter that starts again"
            )
    if found.doubled:
        lines.append(f"{count_of(found.doubled, 'doubled row')} left out")
    for first, number in found.still:
        lines.append(f"the angle stands still for {number} samples from sample {first}; one of them is kept")
    return tuple(lines)
