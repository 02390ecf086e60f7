"""Second search for faults: spikes and slips in a fit's residual, by likelihood ratios against its coloured noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import scipy

from rverror.base.arrays import Array, Flags, Integers
from rverror.base.chance import chi_square
from rverror.runs.fault_bounds import (
    BOUNDS,
    ROUNDS,
    LevelStep,
    blockwise,
    peaks,
    repeats,
    scatter,
    scatter_of_changes,
)
from rverror.runs.noise import RunNoise, autoregressive

# Of the filter: white noise beside a correlation over 40 samples is forgotten over 6.
_LAGS = 24
# Samples of which the noise's colour is read at a time, so that a slip spoils one block only; such a block has so many
# times the power of the usual one.
_BLOCK = 1024
_WILD = 2.0
# White noise that is there in any case, of the power: all of a clean run may be predicted.
_TINY = 1e-9
# Times that the noise is estimated where samples are missing, each time with what the last one makes of them.
_FILLED = 4
# Samples over which scatter is told, and by how much it exceeds the usual where that is no chance.
_NEAR = 512
_LOUDER = 1.15
# Scatter of a clean run's scores for a slip, which hang together over a reach: 9 of 10 have less.
_RESTLESS = 1.2
# Where twice the log likelihood is less by no more than this a slip may be too: 98.6 % for one unknown.
_DOUBT = 6.0


def faults_in_noise(
    theta: Array,
    values: Array,
    good: Flags,
    pieces: Sequence[tuple[int, int]],
    known: Sequence[int],
    floor: float,
) -> tuple[dict[int, float], list[LevelStep]]:
    """Find spikes and slips in a residual.

    Parameters
    ----------
    theta : ndarray, shape (n,)
        Nominal output angle, monotonic, rad.
    values : ndarray, shape (n,)
        Residual on a series of even steps, rad.
    good : ndarray of bool, shape (n,)
        Where there is a sample; other values are not looked at.
    pieces : sequence of (int, int)
        First and one after the last place of each unbroken part; together the whole series.
    known : sequence of int
        Places of slips that are known: what is left of them is told first.
    floor : float
        What is smaller is none, rad.

    Returns
    -------
    outliers : dict of int to float
        How far each sample that is off by itself is off.
    steps : list of LevelStep
        A slip's transition is where it may have happened; of known slips what was left.
    """
    values, good = np.where(good, values, 0.0), good.copy()
    tests = int(np.count_nonzero(good))
    if tests < 4 * BOUNDS.least_side or np.ptp(values[good]) == 0:
        return {}, []
    outliers: dict[int, float] = {}
    steps = {k: LevelStep(k, k, 0.0, math.nan) for k in known}
    for _ in range(ROUNDS):
        white = _whitened(values, good, pieces)
        spikes, slips = _spike_scores(white, tests), _slip_scores(white, tests)
        taken: list[tuple[int, int]] = []
        for k, step in steps.items():
            # The colour is better known now, and with it the size; of two that are near one would take the other's.
            if all(k == other or abs(k - other) > BOUNDS.reach for other in steps):
                more, spread = float(slips.size[k]), float(slips.spread[k])
                values[k:] -= more
                steps[k] = LevelStep(step.first, step.last, step.size + more, spread)
                if abs(more) > spread:
                    taken.append((k, BOUNDS.reach))
        new = [(spikes.score[k], k, True) for k in peaks(spikes.score * (np.abs(spikes.size) > floor), 1, _LAGS)]
        new += [(slips.score[k], k, False) for k in peaks(slips.score * (np.abs(slips.size) > floor), 1, BOUNDS.reach)]
        for score, k, single in sorted(new, reverse=True):
            # What is near a larger one waits until that is out; what comes once a turn is the gear's.
            near = any(abs(k - other) <= wait for other, wait in taken)
            if near or repeats(theta, (spikes if single else slips).size, k):
                continue
            taken.append((k, _LAGS if single else BOUNDS.reach))
            if single:
                for j in range(k, min(k + int(spikes.length[k]), good.size)):
                    if good[j]:
                        good[j], outliers[j] = False, float(spikes.size[k])
                continue
            doubtful = (slips.score * slips.threshold) ** 2 > (score * slips.threshold) ** 2 - _DOUBT
            first = k - int(np.argmin(np.append(doubtful[k::-1], False))) + 1
            last = k + max(int(np.argmin(np.append(doubtful[k:], False))) - 1, 0)
            good[first:last] = False
            values[k:] -= slips.size[k]
            steps[k] = LevelStep(first, last, float(slips.size[k]), float(slips.spread[k]))
        if not taken:
            break
    return outliers, [step for step in steps.values() if not math.isnan(step.spread)]


# --- the noise --------------------------------------------------------------------------------------------------------


def _noises(values: Array, good: Flags, pieces: Sequence[tuple[int, int]]) -> list[RunNoise]:
    """Noise of no lag, of one, and so on, from the correlation of blocks about their means.

    Large values are cut, wild blocks left out.
    """
    lags = min(_LAGS, int(np.count_nonzero(good)) // 8)
    sums: list[list[float]] = []
    counts: list[int] = []
    for first, last in pieces:
        for a, b in pairwise(np.linspace(first, last, max(round((last - first) / _BLOCK), 1) + 1).astype(int).tolist()):
            use = good[a:b]
            count = int(np.count_nonzero(use))
            if count < 2 * lags:
                continue
            about = np.where(use, values[a:b] - values[a:b][use].mean(), 0.0)
            cut = 4 * float(scatter(about[use]))
            padded = np.pad(np.clip(about, -cut, cut), (0, lags))
            sums.append([float(padded[: b - a] @ padded[h : h + b - a]) for h in range(lags + 1)])
            counts.append(count)
    if not sums:  # crumbs only: white
        sums, counts = [[float(values[good] @ values[good]), *[0.0] * lags]], [int(np.count_nonzero(good))]
    table, number = np.array(sums), np.array(counts)
    power = table[:, 0] / number
    usual = power <= _WILD * np.median(power)  # a slip inside a block looks like slow noise
    correlation = table[usual].sum(axis=0) / number[usual].sum()
    correlation[0] = correlation[0] * (1 + _TINY) or 1.0
    return [autoregressive(correlation, p) for p in range(lags + 1)]


@dataclass(frozen=True, eq=False)
class _Whitened:
    """Innovations of the residual, of a constant and of a trend, in units of their scatter.

    A missing sample is an unknown: what any value of it could make is taken out.

    Attributes
    ----------
    values, level, trend : ndarray, shape (n,)
    good : ndarray of bool, shape (n,)
    louder : ndarray, shape (n,)
        Scatter near each sample where it is more than usual, else 1.
    filter : ndarray, shape (lags + 1,)
        What makes the innovations of the residual.
    made : sparse matrix, shape (n, n)
        Innovations that a value of one makes, in the column of its sample.
    """

    values: Array
    level: Array
    trend: Array
    good: Flags
    louder: Array
    filter: Array
    made: scipy.sparse.csc_array

    def squares(self, columns: scipy.sparse.csc_array) -> Array:
        """Squares of columns of innovations, less what missing samples could make of each, shape (n,)."""
        result = np.asarray(columns.power(2).sum(axis=0), dtype=np.float64)
        missing, reach = np.flatnonzero(~self.good), 4 * self.filter.size
        for first in range(0, self.good.size, _NEAR):
            near = missing[(missing > first - reach) & (missing < first + _NEAR + reach)]
            if near.size:
                unknown = self.made[:, near]
                shared = (unknown.T @ columns[:, first : first + _NEAR]).toarray()
                own = (unknown.T @ unknown).toarray()
                result[first : first + _NEAR] -= np.sum(shared * np.linalg.solve(own, shared), axis=0)
        return result


def _whitened(values: Array, good: Flags, pieces: Sequence[tuple[int, int]]) -> _Whitened:
    missing = np.flatnonzero(~good)
    about = np.where(good, values - values[good].mean(), 0.0)
    rows = np.stack([about, np.ones(values.size), np.linspace(-1, 1, values.size)], axis=1)
    known = good
    for _ in range(_FILLED if missing.size else 1):
        noises = _noises(rows[:, 0], known, pieces)
        made = scipy.sparse.block_diag([_filters(noises, last - first) for first, last in pieces], format="csc")
        if missing.size:
            unknown = made[:, missing]
            own = scipy.sparse.linalg.splu((unknown.T @ unknown).tocsc())
            rows[missing] -= own.solve(unknown.T @ (made @ rows))
            known = np.ones_like(good)
    rows = made @ rows
    near, usual = blockwise(rows[good, 0], _NEAR, scatter_of_changes)
    usual = usual or 1.0
    louder = np.where(near > _LOUDER * usual, near / usual, 1.0)
    at = np.minimum(np.cumsum(good) - good, louder.size - 1)
    out = np.ascontiguousarray(rows.T / usual)
    return _Whitened(out[0], out[1], out[2], good, louder[at], noises[-1].filter / usual, made / usual)


def _filters(noises: Sequence[RunNoise], samples: int) -> scipy.sparse.csc_array:
    """Matrix that makes innovations of a series; its first samples have a shorter past."""
    last = noises[-1].filter
    later = scipy.sparse.diags_array(
        [np.full(samples, tap) for tap in last], offsets=-np.arange(last.size), shape=(samples, samples), format="csr"
    )
    count = min(last.size - 1, samples)
    first = np.zeros((count, count))
    for k, noise in enumerate(noises[:count]):
        first[k, : k + 1] = noise.filter[::-1]
    begun = scipy.sparse.csr_array(first)
    begun.resize(count, samples)
    return scipy.sparse.vstack([begun, later[count:]], format="csc")


# --- the likelihood ratios --------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Scores:
    """Faults at every sample by generalised least squares.

    Attributes
    ----------
    size, spread : ndarray, shape (n,)
        Estimate and its standard deviation.
    score : ndarray, shape (n,)
        Size over spread, in units of the threshold.
    threshold : float
    length : ndarray of int, shape (n,)
        Samples of the burst.
    """

    size: Array
    spread: Array
    score: Array
    threshold: float
    length: Integers


def _spike_scores(white: _Whitened, tests: int) -> _Scores:
    """Bursts that begin at each sample, of the length that stands out most."""
    n = white.values.size
    level = np.zeros(n)
    power = _near(white.level**2, BOUNDS.reach)
    np.divide(_near(white.level * white.values, BOUNDS.reach), power, out=level, where=power > 0)
    about = white.values - level * white.level
    best = _Scores(np.zeros(n), np.ones(n), np.zeros(n), 1.0, np.ones(n, dtype=np.intp))
    columns = scipy.sparse.csc_array((n, n))
    for length in range(1, BOUNDS.longest_burst + 1):
        chance = BOUNDS.spike_chance if length == 1 else BOUNDS.burst_chance / (BOUNDS.longest_burst - 1)
        threshold = math.sqrt(chi_square(chance / tests, 1))
        kernel = np.convolve(white.filter, np.ones(length))
        columns = columns + white.made @ scipy.sparse.eye_array(n, k=1 - length, format="csc")
        power = white.squares(columns)
        sure = white.good & (power > 0.25 * float(kernel @ kernel))
        power = np.where(sure, power, 1.0)
        size = np.where(sure, columns.T @ about / power, 0.0)
        spread = white.louder / np.sqrt(power)
        score = np.abs(size) / spread / threshold
        better = score > best.score
        for old, new in ((best.size, size), (best.spread, spread), (best.score, score)):
            old[better] = new[better]
        best.length[better] = length
    return best


def _slip_scores(white: _Whitened, tests: int) -> _Scores:
    """Steps at each sample, from a level over `reach` samples on each side, and once more from a common trend too."""
    n, reach = white.values.size, BOUNDS.reach
    k = np.arange(n)
    good = white.good.astype(np.float64)
    # The whitened step rises as the running sum of the filter, and is the whitened level from there on.
    rise = np.asarray(np.cumsum(white.filter), dtype=np.float64)

    def after(values: Array) -> Array:
        """Sum of the step's product with values over its side."""
        return _ahead(values * good, rise) + _between(values * white.level, k + rise.size, k + reach)

    own = _ahead(good, rise * rise) + _between(white.level**2, k + rise.size, k + reach)
    by_level, by_trend, by_value = after(white.level), after(white.trend), after(white.values)
    level, both = _near(white.level**2, reach), _near(white.level * white.trend, reach)
    trend = _near(white.trend**2, reach)
    value, slope = _near(white.level * white.values, reach), _near(white.trend * white.values, reach)
    sides = np.minimum(_between(good, k - reach, k), _between(good, k, k + reach))
    with np.errstate(divide="ignore", invalid="ignore"):
        power, got = own - by_level**2 / level, by_value - by_level * value / level
        across, left = by_trend - by_level * both / level, trend - both**2 / level
        straight = (got - across * (slope - both * value / level) / left) / np.sqrt(power - across**2 / left)
    sure = (sides >= BOUNDS.least_side) & (power > 1e-6 * own)
    threshold = math.sqrt(chi_square(BOUNDS.slip_chance / tests, 1))
    power = np.where(sure, power, 1.0)
    size = np.where(sure, got / power, 0.0)
    spread = white.louder / np.sqrt(power)
    if n > 4 * reach:
        # Drift and lines that no fit took are no noise of this colour: then all scores scatter by more than 1.
        spread *= max(1.0, float(scatter((size / spread)[sure])) / _RESTLESS)
    able = white.good & (np.abs(straight) > BOUNDS.straight * threshold * white.louder)
    score = np.where(able, np.abs(size) / spread / threshold, 0.0)
    return _Scores(size, spread, score, threshold, np.ones(n, dtype=np.intp))


def _ahead(values: Array, kernel: Array) -> Array:
    """Sum over j of kernel_j values_(k + j), at every k."""
    return np.asarray(np.convolve(values, kernel[::-1])[kernel.size - 1 :], dtype=np.float64)


def _between(values: Array, first: Integers, last: Integers) -> Array:
    """Sum of the values from one place to before another, of those that there are; 0 where that lies before it."""
    total = np.concatenate([[0.0], np.cumsum(values)])
    first, last = np.clip([np.minimum(first, last), last], 0, values.size)
    return np.asarray(total[last] - total[first], dtype=np.float64)


def _near(values: Array, reach: int) -> Array:
    """Sum of the values from `reach` before each place to before `reach` after it."""
    k = np.arange(values.size)
    return _between(values, k - reach, k + reach)
