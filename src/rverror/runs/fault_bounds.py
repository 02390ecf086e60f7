"""What the two searches for faults share: their thresholds, what they return, and scatter that bears outliers."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from rverror.base.arrays import Array

#: Samples of one transition from level to level.
WIDEST_SLIP = 3
#: Rounds of a search: each takes the largest of a neighbourhood, so that it no longer spoils its neighbours.
ROUNDS = 12

# Samples by which a feature may lie elsewhere in another turn.
_JITTER = 1
# Median and 80 % quantile of the size of a standard normal.
_MEDIAN_SIZE = 0.67449
_MOST_SIZE = 1.28155


@dataclass(frozen=True, kw_only=True)
class FaultBounds:
    """Thresholds, each with its reason.

    Attributes
    ----------
    certain : float
        First pass: a spike or slip is larger than so many times the scatter, near it and in all, of what neighbours do
        not predict.  Gear error is no Gaussian noise, so this is no level of chance: in clean runs of the loaded
        equilibrium, with kinks and content near the Nyquist order, the largest was below 6.
    spike_chance, burst_chance, slip_chance : float
        Second pass: probability that a clean run gets a single sample, a burst or a slip set aside, shared by all
        positions and, for bursts, lengths.  A single sample costs least when it is none.
    longest_burst : int
        Samples.  A longer burst is a stretch between two slips.
    reach : int
        Samples on each side of which a slip is told.  More tells smaller slips, but lets in what changes slowly.
    straight : float
        A slip must also show beside a trend common to both sides, with so much of its threshold: a drift does not.
    least_side : int
        Samples that a slip has at least on each side; of fewer it cannot be told from a burst.
    counts : float
        A change of fewer counts of the encoder is its rounding.
    even_gap : float
        Where steps are even, one longer than so many usual ones has lost samples: 1 is usual, 2 is one sample lost.
    uneven_gap : float
        The same where steps are uneven, so that single lost samples cannot be told.
    standstill : int
        So many samples in a row at one angle, and ten times the usual number, are a standstill.
    most_spikes : float
        Largest share of spikes.  Scatter comes from the 80 % quantile in blocks; 5 % of outliers, one side in its tail,
        move it by some 15 %.  More is a channel that is broken, not one with outliers.
    most_slips : int
        Largest number of slips: each costs a level that is unknown, and a reading that slips oftener is none.
    """

    certain: float = 8.0
    spike_chance: float = 3e-3
    burst_chance: float = 5e-4
    slip_chance: float = 1e-3
    longest_burst: int = 5
    reach: int = 400
    straight: float = 0.6
    least_side: int = 12
    counts: float = 2.5
    even_gap: float = 1.5
    uneven_gap: float = 3.0
    standstill: int = 16
    most_spikes: float = 0.05
    most_slips: int = 20


BOUNDS = FaultBounds()


@dataclass(frozen=True)
class LevelStep:
    """A step from level to level.

    Attributes
    ----------
    first, last : int
        First sample that may be off the old level, and first one that is on the new.
    size, spread : float
        New level less old, and its standard deviation.
    """

    first: int
    last: int
    size: float
    spread: float


def scatter(values: Array) -> Array:
    """Standard deviation along the last axis by median and 80 % quantile of the sizes, the larger: bears outliers.

    Examples
    --------
    >>> noise = np.random.default_rng(1).standard_normal(10_000)
    >>> noise[:200] = 1e6
    >>> bool(0.95 < scatter(noise) < 1.1)
    True
    """
    middle, most = np.quantile(np.abs(values), [0.5, 0.8], axis=-1)
    return np.asarray(np.maximum(middle / _MEDIAN_SIZE, most / _MOST_SIZE), dtype=np.float64)


def scatter_of_changes(values: Array) -> Array:
    """Standard deviation of white noise from the changes between neighbours, of which a step of the level moves one."""
    return scatter(np.diff(values, axis=-1)) / math.sqrt(2)


def blockwise(values: Array, size: int, measure: Callable[[Array], Array]) -> tuple[Array, float]:
    """Measure blocks: the largest of three neighbours at every sample, and the median of all.

    Parameters
    ----------
    values : ndarray, shape (n,)
    size : int
        Samples of a block; what is left over belongs to none.
    measure : callable
        Along the last axis.

    Returns
    -------
    largest : ndarray, shape (n,)
    median : float
    """
    count = values.size // size
    if count < 2:
        one = float(measure(values[None])[0])
        return np.full(values.size, one), one
    blocks = measure(values[: count * size].reshape(count, size))
    largest = scipy.ndimage.maximum_filter1d(blocks, 3, mode="nearest")
    return largest[np.minimum(np.arange(values.size) // size, count - 1)], float(np.median(blocks))


def peaks(score: Array, bound: float, apart: int) -> list[int]:
    """Places above a bound, so far apart, the highest first."""
    above = np.flatnonzero(score > bound)
    taken: list[int] = []
    for k in above[np.argsort(-score[above], kind="stable")].tolist():
        if all(abs(k - other) > apart for other in taken):
            taken.append(k)
    return taken


def repeats(theta: Array, size: Array, k: int) -> bool:
    """Whether half of it or more stands at the same angle in most other turns too."""
    turns = (theta - theta[k]) / (2 * math.pi)
    others = np.arange(math.ceil(turns.min()), math.floor(turns.max()) + 1)
    order = np.argsort(turns, kind="stable")
    at = order[np.minimum(np.searchsorted(turns[order], others[others != 0]), turns.size - 1)]
    near = np.clip(at[:, None] + np.arange(-_JITTER, _JITTER + 1), 0, turns.size - 1)
    again = (size[near] * np.sign(size[k]) > 0.5 * abs(size[k])).any(axis=-1)
    return bool(2 * np.count_nonzero(again) > again.size)
