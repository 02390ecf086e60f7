"""What cannot be in a run: spikes, slips of the reading, gaps, doubled rows, jumps of a counter, standstill.

Two passes: on the transmission error as read only what is certain is taken, on the residual of a fitted model the rest,
with the noise's own size.  See docs page ``theory/faults.md``.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from rverror.base.arrays import Array, Flags, Integers
from rverror.base.numbers import brief, count_of
from rverror.base.text import some
from rverror.base.units import ARCSEC
from rverror.runs.checks import reversals
from rverror.runs.fault_bounds import BOUNDS, WIDEST_SLIP, LevelStep, blockwise
from rverror.runs.faults_as_read import NEAR, certain_faults, far_off
from rverror.runs.faults_in_noise import faults_in_noise


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
    of_input : bool
        Whether the nominal angle jumps by as much the other way: the counter of the input has, so that the angles on
        one side are wrong.  Those of the shorter side are set aside.
    """

    index: int
    theta: float
    size: float
    uncertainty: float
    of_input: bool = False


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
    kept: Flags
    spikes: Integers
    sizes: Array
    slips: tuple[Slip, ...] = ()
    gaps: tuple[Gap, ...] = ()
    doubled: int = 0
    still: tuple[tuple[int, int], ...] = ()
    turned: tuple[int, ...] = ()
    count: float = 0.0

    def shift(self) -> Array:
        """Sum of the slips before each sample, rad, shape (n,)."""
        steps = np.zeros(self.theta.size)
        steps[[slip.index for slip in self.slips]] = [slip.size for slip in self.slips]
        return np.cumsum(steps)

    def notes(self) -> tuple[str, ...]:
        """One line for each kind of fault: how many, where, how large; empty for a clean run."""
        lines = []
        if self.spikes.size:
            largest = float(np.max(np.abs(self.sizes))) / ARCSEC
            what, upto = ("samples", "up to ") if self.spikes.size > 1 else ("sample", "")
            lines.append(
                f"{count_of(self.spikes.size, 'spike')} set aside ({what} {some(self.spikes.tolist())}, "
                f"{upto}{brief(largest, 3)} arcsec)"
            )
        for slip in self.slips:
            size = f"{brief(slip.size / ARCSEC, 4)} +- {brief(slip.uncertainty / ARCSEC, 2)} arcsec"
            place = f"sample {slip.index} ({brief(math.degrees(slip.theta), 6)} deg)"
            if slip.of_input:
                lines.append(
                    f"the counter of the input jumps at {place}, by {size} of the output: the angles behind it are "
                    "wrong, so the shorter side is left out"
                )
            else:
                lines.append(f"the reading slips by {size} at {place}: every later sample is shifted")
        lost = [gap for gap in self.gaps if gap.samples]
        if lost:
            widest = max(lost, key=lambda gap: gap.span)
            lines.append(
                f"{count_of(len(lost), 'gap')}, {count_of(sum(gap.samples for gap in lost), 'sample')} missing "
                f"(the widest, {brief(math.degrees(widest.span), 3)} deg, before sample {widest.index})"
            )
        for gap in self.gaps:
            if not gap.samples:
                by = f"{brief(math.degrees(-gap.span), 4)} deg"
                lines.append(
                    f"the angle jumps back by {by} at sample {gap.index}: two runs in one, or a counter that starts "
                    "again"
                )
        if self.doubled:
            lines.append(f"{count_of(self.doubled, 'doubled row')} left out")
        for first, number in self.still:
            lines.append(f"the angle stands still for {number} samples from sample {first}; one of them is kept")
        return tuple(lines)


def find_faults(
    theta: Array,
    error: Array,
    *,
    residual: bool = False,
    earlier: Faults | None = None,
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
    ('1 spike set aside (sample 321, 20.5 arcsec)',)
    """
    theta, error = np.asarray(theta, dtype=np.float64), np.asarray(error, dtype=np.float64)
    if theta.ndim != 1 or theta.shape != error.shape or not (np.isfinite(theta).all() and np.isfinite(error).all()):
        raise ValueError("angle and error have to be rows of finite numbers, of the same length")
    found = _series(theta, error) if earlier is None else earlier
    have, floor = error[found.kept], BOUNDS.counts * found.count
    far = far_off(have, floor)
    if earlier is None:
        _check(found, far)
    searches = [_as_read, _in_noise] if residual else [_as_read]
    if residual and not far and not far_off(np.diff(have), floor):
        searches = [_in_noise]  # nothing here is large
    values = error
    for search in searches:
        for stretch in _stretches(found):
            known = found
            found = search(found, values, stretch)
            _check(found)
            if found is not known:  # the next search sees no step of this one
                values = values - (found.shift() - known.shift())
    return found


# Counts below this, rad, do not show.
_FINEST = 1e-3 * ARCSEC

# --- the series of angles ---------------------------------------------------------------------------------------------


def _series(theta: Array, error: Array) -> Faults:
    """What the angles alone tell: doubled rows, standstill, gaps, changes of direction."""
    n = theta.size
    kept = np.ones(n, dtype=bool)
    again = _again(theta)
    starts = np.append(np.flatnonzero(~again), n)  # of runs of one angle
    lengths = np.diff(starts)
    long = lengths >= max(BOUNDS.standstill, 10 * float(np.mean(lengths)))
    still = tuple(zip(starts[:-1][long].tolist(), lengths[long].tolist(), strict=True))
    for first, number in still:
        kept[first + 1 : first + number] = False
    doubled = again & kept & _again(error)
    kept &= ~doubled
    places = np.flatnonzero(kept)
    moved = np.flatnonzero(kept & ~again)
    turned = [int(places[i]) for i in _turned(theta[places])]
    return Faults(
        theta,
        kept,
        np.zeros(0, dtype=np.intp),
        np.zeros(0),
        gaps=tuple(_gaps(theta, moved, turned)),
        doubled=int(np.count_nonzero(doubled)),
        still=still,
        turned=tuple(turned),
        count=_count(theta + error),
    )


def _again(values: Array) -> Flags:
    """Where a value is that of the sample before."""
    return np.concatenate([[False], np.diff(values) == 0])


def _turned(theta: Array) -> list[int]:
    """First samples of another direction, behind the extremes of an angle that goes back by more than jitter."""
    steps = np.diff(theta)
    if (steps >= 0).all() or (steps <= 0).all():
        return []
    # Less than ten typical steps back and forth is jitter of the encoder, and one long step back is no reversal.
    typical = float(np.median(np.abs(steps[steps != 0])))
    way = np.concatenate([[0.0], np.cumsum(np.clip(steps, -5 * typical, 5 * typical))])
    jitter = min(10 * typical, float(np.ptp(way)) / 4)
    return [extreme + 1 for extreme in reversals(way, jitter)[0]]


def _gaps(theta: Array, moved: Integers, turned: list[int]) -> list[Gap]:
    """Steps too long for their neighbours, and long steps back, of the samples whose angle is not the one before."""
    steps = np.diff(theta[moved])
    size = np.abs(steps)
    if size.size < NEAR:
        return []
    usual = blockwise(size, 64, lambda blocks: np.asarray(np.median(blocks, axis=-1)))[0]
    even = np.quantile(np.abs(size / usual - 1), 0.75) < 0.1
    if not even:  # a drive that starts has steps that grow, and the nearest ones know
        padded = np.pad(size, 3, mode="edge")
        usual = np.maximum(usual, np.median([padded[i : i + size.size] for i in (0, 1, 2, 4, 5, 6)], axis=0))
    ratio = size / usual
    gaps = []
    for i in np.flatnonzero(ratio > (BOUNDS.even_gap if even else BOUNDS.uneven_gap) * (1 + 1e-9)).tolist():
        sense = np.sign(np.delete(steps[max(i - 3, 0) : i + 4], min(i, 3))).sum()
        back = sense * steps[i] < 0 and moved[i + 1] not in turned
        span, samples = (-float(size[i]), 0) if back else (float(size[i] - usual[i]), round(ratio[i]) - 1)
        gaps.append(Gap(int(moved[i + 1]), float(theta[moved[i]]), span, samples))
    return gaps


def _stretches(found: Faults) -> list[slice]:
    """Samples between changes of direction, where the reading rightly jumps by the lost motion."""
    return [slice(a, b) for a, b in pairwise([0, *found.turned, found.theta.size]) if b > a]


def _count(reading: Array) -> float:
    """Count to which a reading is rounded, rad; 0 where its steps are whole multiples of nothing."""
    apart = np.diff(np.unique(reading))
    apart = apart[apart > _FINEST]
    if apart.size < 4 * NEAR:
        return 0.0
    # Even angles far apart on the grid share most of their distance, so that only what differs tells the count.
    differ = np.diff(np.unique(apart))
    differ = differ[differ > _FINEST]
    if not differ.size:
        return 0.0
    count = float(np.quantile(differ, 0.1))
    multiples = (apart - np.median(apart)) / count
    return count if np.mean(np.abs(multiples - np.rint(multiples)) < 0.05) > 0.98 else 0.0


# --- the two searches -------------------------------------------------------------------------------------------------


def _as_read(found: Faults, error: Array, stretch: slice) -> Faults:
    places = np.flatnonzero(found.kept[stretch]) + stretch.start
    # No parabola bridges a long gap.
    cuts = [gap.index for gap in found.gaps if gap.samples == 0 or gap.samples > WIDEST_SLIP]
    pieces = np.split(places, np.searchsorted(places, cuts))
    for piece in pieces:
        found = _joined(found, piece, *certain_faults(found.theta[piece], error[piece], BOUNDS.counts * found.count))
    at_gaps = _steps_at_gaps([piece for piece in pieces if piece.size >= NEAR], error - found.shift())
    return _without_wrong_angles(_joined(found, np.arange(error.size), {}, at_gaps), stretch)


def _steps_at_gaps(pieces: list[Integers], error: Array) -> list[LevelStep]:
    """Steps over a gap that are three times what the error makes anywhere: what is less may be the gear's."""
    if len(pieces) < 2:
        return []
    usual = max(float(np.subtract(*np.quantile(error[piece], [0.95, 0.05]))) for piece in pieces)
    steps = []
    for before, after in pairwise(pieces):
        size = float(np.median(error[after[: 4 * NEAR]]) - np.median(error[before[-4 * NEAR :]]))
        if abs(size) > 3 * usual:
            steps.append(LevelStep(int(after[0]), int(after[0]), size, usual / 4))
    return steps


def _without_wrong_angles(found: Faults, stretch: slice) -> Faults:
    """Of a stretch whose nominal angle jumps as the error does, the other way, only the longest part is kept."""
    if not found.slips:
        return found
    steps = np.diff(found.theta)
    usual = float(np.median(steps[stretch.start : stretch.stop - 1]))
    jumps = [
        slip.index
        for slip in found.slips
        if stretch.start < slip.index < stretch.stop
        and abs(slip.size) > abs(usual) / 2
        and abs(steps[slip.index - 1] - usual + slip.size) < 4 * slip.uncertainty + 0.02 * abs(slip.size)
    ]
    if not jumps:
        return found
    first, last = max(pairwise([stretch.start, *jumps, stretch.stop]), key=lambda part: part[1] - part[0])
    kept = found.kept.copy()
    kept[stretch.start : first] = kept[last : stretch.stop] = False
    return replace(
        found,
        kept=kept,
        slips=tuple(replace(slip, of_input=slip.index in jumps or slip.of_input) for slip in found.slips),
        gaps=tuple(gap for gap in found.gaps if gap.index not in jumps),
    )


def _in_noise(found: Faults, error: Array, stretch: slice) -> Faults:
    samples, place, pieces = _grid(found, stretch)
    if not samples.size:
        return found
    values, good = np.zeros(pieces[-1][1]), np.zeros(pieces[-1][1], dtype=bool)
    values[place], good[place] = error[samples], True
    inside = [slip.index for slip in found.slips if samples[0] < slip.index <= samples[-1]]
    known = place[np.searchsorted(samples, inside)].tolist()
    theta = np.interp(np.arange(good.size), place, found.theta[samples])
    places = samples[np.minimum(np.searchsorted(place, np.arange(good.size)), samples.size - 1)]
    have = faults_in_noise(theta, values, good, pieces, known, BOUNDS.counts * found.count)
    return _joined(found, places, *have)


def _grid(found: Faults, stretch: slice) -> tuple[Integers, Integers, list[tuple[int, int]]]:
    """Samples kept, their places in a series of even steps, and its unbroken pieces.

    Where one to three samples are missing the series has a hole, longer gaps break it.
    """
    takes = np.ones(found.theta.size, dtype=np.intp)
    takes[~found.kept & _again(found.theta)] = 0  # a doubled row takes no time
    cuts = [first + 1 for first, _ in found.still]
    for gap in found.gaps:
        if 1 <= gap.samples <= WIDEST_SLIP:
            takes[gap.index] += gap.samples
        else:
            cuts.append(gap.index)
    place = np.cumsum(takes[stretch]) - takes[stretch.start]
    samples = np.flatnonzero(found.kept[stretch])
    inside = {int(place[cut - stretch.start]) for cut in cuts if stretch.start < cut < stretch.stop}
    edges = [0, *sorted(inside - {0}), int(place[-1]) + 1]
    return samples + stretch.start, place[samples], list(pairwise(edges))


def _joined(found: Faults, places: Integers, outliers: dict[int, float], steps: list[LevelStep]) -> Faults:
    """Add what a search has found; `places` are the samples it counts by."""
    if not outliers and not steps:
        return found
    kept = found.kept.copy()
    slips = {slip.index: slip for slip in found.slips}
    for step in steps:
        kept[places[step.first] : places[step.last]] = False
        index = int(places[step.last])
        # What is left of a slip that is known adds to it.
        index = next((known for known in slips if abs(known - index) <= WIDEST_SLIP), index)
        before = slips[index].size if index in slips else 0.0
        slips[index] = Slip(
            index, float(found.theta[index]), before + step.size, step.spread, index in slips and slips[index].of_input
        )
    sizes = dict(zip(found.spikes.tolist(), found.sizes.tolist(), strict=True))
    sizes |= {int(places[at]): size for at, size in outliers.items()}
    kept[list(sizes)] = False
    # A sample off beside a slip is of its transition.
    apart = {i: size for i, size in sizes.items() if all(abs(i - slip) > WIDEST_SLIP for slip in slips)}
    at = sorted(apart)
    return replace(
        found,
        kept=kept,
        spikes=np.array(at, dtype=np.intp),
        sizes=np.array([apart[i] for i in at], dtype=np.float64),
        slips=tuple(slips[i] for i in sorted(slips)),
    )


# --- what is refused --------------------------------------------------------------------------------------------------


def _check(found: Faults, spikes: int = 0) -> None:
    spikes, slips, n = max(spikes, found.spikes.size), len(found.slips), found.theta.size
    if spikes > max(BOUNDS.most_spikes * n, 3):
        raise ValueError(
            f"{spikes} of {n} samples ({100 * spikes / n:.2g} %) are spikes, at most {100 * BOUNDS.most_spikes:g} % "
            "may be set aside: the channel is broken; check cable, earth and encoder, and measure again"
        )
    if slips > BOUNDS.most_slips:
        raise ValueError(
            f"the reading slips {slips} times, at most {BOUNDS.most_slips} times may be borne; check the coupling of "
            "the encoder and its counter, or where the load is light take a larger one, and measure again"
        )
