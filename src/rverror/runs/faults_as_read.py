"""First search for faults: samples and steps of a run as read that the neighbours on neither side predict."""

from __future__ import annotations

import numpy as np
import scipy

from rverror.base.arrays import Array, Flags, Integers
from rverror.runs.fault_bounds import (
    BOUNDS,
    ROUNDS,
    WIDEST_SLIP,
    LevelStep,
    blockwise,
    peaks,
    repeats,
    scatter,
)

#: Neighbours of one side; their parabola bears orders up to some 200 at 2048 samples a turn.
NEAR = 8

# Times its scatter beyond which a difference may be a fault.
_DOUBTFUL = 4.0
# Times a step's size from which a burst beside it makes it none: a slip itself makes bursts of its own size.
_LARGER = 4.0
# Samples over which scatter is told: it follows what a part of the turn has more of than others.
_BLOCK = 64


def certain_faults(theta: Array, error: Array, floor: float) -> tuple[dict[int, float], list[LevelStep]]:
    """Find spikes and slips that are certain whatever the gear error is.

    Parameters
    ----------
    theta : ndarray, shape (n,)
        Nominal output angle of a stretch without gaps and reversals, rad.
    error : ndarray, shape (n,)
        Transmission error, rad.
    floor : float
        What is smaller is none, rad.

    Returns
    -------
    outliers : dict of int to float
        How far each sample that is off by itself is off.
    steps : list of LevelStep
    """
    if theta.size < 4 * NEAR:
        return {}, []
    sides, beyond = Sides(theta), NEAR + BOUNDS.longest_burst
    sides_beyond = Sides(_mirrored(theta, beyond, theta[0], theta[-1]))
    values = error.copy()
    outliers: set[int] = set()
    doubtful = _apart(values, (5, 11))
    for _ in range(ROUNDS):
        clean = np.where(np.isnan(doubtful), values, doubtful)
        more = _bursts(sides, values, clean, floor)
        ends, last = (_end(clean), _end(clean[::-1])), theta.size - 1
        as_read, as_clean = (_mirrored(row, beyond, *ends) for row in (values, clean))
        places_beyond = (at - beyond for at in _bursts(sides_beyond, as_read, as_clean, floor))
        folded = {abs(at) if at <= last else 2 * last - at for at in places_beyond}
        more |= {at for at in folded - outliers if not NEAR <= at <= last - NEAR and _stands_out(values, clean, at)}
        if not more:
            break
        outliers |= more
        # What neighbours predict stands in for them: from those that are left first, then by the parabolas.
        places = np.array(sorted(outliers), dtype=np.intp)
        doubtful[places] = np.nan
        left = np.setdiff1d(np.flatnonzero(np.isnan(doubtful)), places)
        values[places] = clean[places] = np.interp(places, left, values[left])
        inside = places[(places >= NEAR) & (places < theta.size - NEAR)]
        before, after = sides.fitted(clean)
        x = sides.at[inside]
        values[inside] = 0.5 * (sides.along(before, inside, x) + sides.along(after, inside + 1, x))
    apart = error - scipy.ndimage.median_filter(error, 2 * BOUNDS.longest_burst + 1, mode="mirror")
    # what comes again in other turns is the gear's
    found = {at: float(error[at] - values[at]) for at in sorted(outliers) if not repeats(theta, apart, at)}
    away = {at: abs(float(error[at] - values[at])) for at in outliers}

    def is_made_up(step: LevelStep) -> bool:
        """It borders on a burst of several times its size: beside a sharp lobe what stands in for that may step."""
        first, last = step.first - 1, step.last
        while first in away:
            first -= 1
        while last in away:
            last += 1
        return any(away.get(at, 0.0) > _LARGER * abs(step.size) for at in range(first, last + 1))

    read, rises = values.copy(), np.zeros(values.size)  # rises: the step in front of every sample
    rises[NEAR : 1 - NEAR] = sides.steps(sides.fitted(values), 0)[1]
    steps: list[LevelStep] = []
    for _ in range(ROUNDS):
        further = [step for step in _steps(sides, values, floor) if not is_made_up(step)]
        for step in further:
            values[step.last :] -= step.size
        steps += further
        if not further:
            break
    apart_from_gear = [step for step in steps if not repeats(theta, rises, step.first)]
    return found, _set_apart(apart_from_gear, read)


def _set_apart(steps: list[LevelStep], read: Array) -> list[LevelStep]:
    """Steps that are certain and last, and are so much larger than all others that no gear error makes them.

    At light load a gear train jumps from contact to contact, by sizes that go down gradually, and what lies between
    takes the jumps back: without them the reading would range farther.  (In less than two turns none comes again.)
    """
    steps = sorted(steps, key=lambda step: -abs(step.size))
    sizes = [*(abs(step.size) for step in steps), 0.0]
    level, taken, least = read.copy(), 0, float(np.ptp(read))
    for i, step in enumerate(steps):
        if abs(step.size) <= BOUNDS.certain * step.spread:
            break
        level[step.last :] -= step.size
        if sizes[i] > 2 * sizes[i + 1] and (i == 0 or np.ptp(level) <= least):
            taken, least = i + 1, float(np.ptp(level))
    return steps[:taken]


def far_off(error: Array, floor: float) -> int:
    """Count samples far from the median of five neighbours, by a scatter that bears almost a third of them."""
    if error.size < 4 * NEAR:
        return 0
    rest = np.abs(error - scipy.ndimage.median_filter(error, 5, mode="mirror"))
    usual = float(np.median(rest[rest > 0])) / 0.6745 if rest.any() else 0.0
    return int(np.count_nonzero(rest > max(BOUNDS.certain * usual, floor)))


def _apart(values: Array, widths: tuple[int, ...]) -> Array:
    """Medians of the neighbourhood where a sample is far from them, else NaN.

    Those stand in for what may be faults while scatter is told: each fault would spoil what 16 neighbours predict.
    """
    found = np.full(values.size, np.nan)
    for width in widths:
        middle = scipy.ndimage.median_filter(values, width, mode="mirror")
        rest = values - middle
        far = np.abs(rest) > _DOUBTFUL * np.maximum(*blockwise(rest, _BLOCK, scatter))
        found[far] = middle[far]
    return found


def _stands_out(values: Array, clean: Array, at: int) -> bool:
    """Whether a sample beside an end is farther off than all that is near: an end turned over predicts but roughly.

    Off a line, since the error may rise there as steeply as a spike is large; and by a jump, since what bends away from
    that line does so gradually.
    """
    first = min(max(at - NEAR, 0), values.size - 2 * NEAR)
    near = slice(first, first + 2 * NEAR)
    line = _line(clean[near])
    rest = np.delete(clean[near] - line, at - first)
    excess = abs(values[at] - line[at - first] - np.median(rest))
    return bool(excess > 3 * np.ptp(rest) and np.abs(np.diff(values[near])).max() > excess / 2)


def _line(values: Array) -> Array:
    """The line through a few values that bears outliers."""
    along = np.arange(values.size)
    slope = float(np.median(np.diff(values)))
    level = float(np.median(values - slope * along))
    return np.asarray(level + slope * along, dtype=np.float64)


def _end(values: Array) -> float:
    """Where a series begins, by a line that bears outliers."""
    return float(_line(values[: NEAR + 1])[0])


def _mirrored(values: Array, count: int, first: float, last: float) -> Array:
    """A series with its ends turned over, so that its first and last samples have neighbours on both sides."""
    return np.concatenate([2 * first - values[count:0:-1], values, 2 * last - values[-2 : -count - 2 : -1]])


class Sides:
    """Least-squares parabolas through the neighbours on each side of every sample.

    Parameters
    ----------
    theta : ndarray, shape (n,)
        Angles of the samples, rad.
    """

    def __init__(self, theta: Array) -> None:
        """Solve them once for all values."""
        steps = np.abs(np.diff(theta))
        usual = float(np.median(steps[steps > 0])) if steps.any() else 1.0
        self.at = (theta - theta[0]) / usual
        self.size = theta.size
        even = bool(np.max(np.abs(steps / usual - 1)) < 0.02)
        self._before = self._solved(-NEAR, even)
        self._after = self._solved(0, even)

    def _solved(self, first: int, even: bool) -> Array:
        """Matrices from neighbours to coefficients over the distance from k, shape (n or 1, 3, near)."""
        if even:
            x = np.sign(self.at[-1]) * np.arange(first, first + NEAR, dtype=np.float64)[None]
        else:
            windows = np.lib.stride_tricks.sliding_window_view(self.at, NEAR)
            centres = self.at[NEAR:] if first else self.at[: windows.shape[0]]
            x = windows[: centres.size] - centres[:, None]
        powers = np.stack([np.ones_like(x), x, x * x], axis=1)
        normal = powers @ np.swapaxes(powers, 1, 2)
        normal[:, range(3), range(3)] += 1e-9  # several samples at one angle
        return np.asarray(np.linalg.inv(normal) @ powers, dtype=np.float64)

    def fitted(self, values: Array) -> tuple[Array, Array]:
        """Coefficients, shape (3, n) each: through the samples before k, through those from k on; 0 at the ends."""
        windows = np.lib.stride_tricks.sliding_window_view(values, NEAR)
        before, after = np.zeros((3, self.size)), np.zeros((3, self.size))
        before[:, NEAR:] = np.einsum("kcn,kn->ck", self._before, windows[:-1])
        after[:, : windows.shape[0]] = np.einsum("kcn,kn->ck", self._after, windows)
        return before, after

    def steps(self, fits: tuple[Array, Array], width: int) -> tuple[Integers, Array]:
        """First samples of all transitions of so many, and the steps between the parabolas on both sides of each."""
        k = np.arange(NEAR, self.size - width - NEAR + 1)
        x = 0.5 * (self.at[k - 1] + self.at[k + width])
        return k, self.along(fits[1], k + width, x) - self.along(fits[0], k, x)

    def along(self, coefficients: Array, k: Integers | slice, x: Array) -> Array:
        """Values of the parabolas of samples k at places x."""
        a, b, c = coefficients[:, k]
        d = x - self.at[k]
        return np.asarray(a + d * (b + d * c), dtype=np.float64)


def _bursts(sides: Sides, values: Array, clean: Array, floor: float) -> set[int]:
    """First samples of bursts that both sides say are off; of neighbours the worst only.

    The next round finds those behind them.  `clean` has no doubtful samples.
    """
    before, after = sides.fitted(clean)
    best = np.zeros(sides.size)
    rest = clean - values
    for length in range(1, BOUNDS.longest_burst + 1):
        # its first samples, its second ones .., and those behind it: of bursts that have neighbours on both sides
        *burst, behind = (slice(NEAR + j, sides.size - NEAR - length + 1 + j) for j in range(length + 1))
        first = burst[0]
        excess, by_before, by_after = np.empty((3, length, first.stop - first.start))
        cleaned = np.zeros(excess.shape[1])
        for j, k in enumerate(burst):
            x, value = sides.at[k], values[k]
            by_before[j] = value - sides.along(before, first, x)
            by_after[j] = value - sides.along(after, behind, x)
            # The two parabolas err by a cubic, in opposite senses, so that their mean hardly errs.
            share = (j + 1) / (length + 1)
            excess[j] = (1 - share) * by_before[j] + share * by_after[j]
            cleaned += rest[k] / length
        mean = excess.mean(axis=0)
        sense, half = np.sign(mean), 0.5 * np.abs(mean)
        # A kink is predicted from one of its sides, and so is a slip.
        alone = np.min([sense * by_before, sense * by_after, sense * excess], axis=(0, 1)) > half
        best[first] = np.maximum(best[first], _score(mean, mean + cleaned, alone, floor, BOUNDS.certain))
    return set(peaks(best, 0.0, NEAR))


def _steps(sides: Sides, values: Array, floor: float) -> list[LevelStep]:
    """Steps between the parabolas of both sides; of neighbours the largest only."""
    fits = sides.fitted(values)
    change = np.diff(values, prepend=values[0])
    # Scatter is told without the changes that may be slips.
    smooth = _apart(change, (5,))
    clean = values - np.cumsum(np.where(np.isnan(smooth), 0.0, change - smooth))
    clean_fits = sides.fitted(clean)
    best, sizes, widths = np.zeros(sides.size), np.zeros(sides.size), np.zeros(sides.size, dtype=np.intp)
    for width in range(WIDEST_SLIP + 1):
        (k, size), (_, usual) = sides.steps(fits, width), sides.steps(clean_fits, width)
        # The change has to be as sudden as none near it: gear error rises over several samples.
        rise = np.abs(values[k + width] - values[k - 1])
        sudden = rise > np.maximum(2 * (width + 1) * _largest_near(np.abs(change), width)[k], 0.5 * np.abs(size))
        score = _score(size, usual, sudden, floor, _DOUBTFUL)
        better = score > 1.1 * best[k]  # the narrower one unless the wider is clearly better
        at = k[better]
        best[at], sizes[at], widths[at] = score[better], size[better], width
    return [
        LevelStep(first, first + int(widths[first]), float(sizes[first]), abs(float(sizes[first])) / float(best[first]))
        for first in peaks(best, 0.0, 2 * NEAR)
    ]


def _score(size: Array, usual: Array, able: Flags, floor: float, bound: float) -> Array:
    """Size against the scatter of what is usual, where above a floor and a bound, else 0."""
    spread = np.maximum(*blockwise(usual, _BLOCK, scatter))
    sure = able & (np.abs(size) > floor) & (np.abs(size) > bound * spread)
    return np.where(sure, np.abs(size) / np.maximum(spread, np.finfo(np.float64).tiny), 0.0)


def _largest_near(change: Array, width: int) -> Array:
    """Largest change from one sample to the next near k, but for those from k - 1 to k + width."""
    near = np.repeat([True, False, True], [NEAR - 1, width + 1, NEAR - 1])
    found: Array = scipy.ndimage.maximum_filter(change, footprint=near, mode="constant", origin=-((width + 1) // 2))
    return found
