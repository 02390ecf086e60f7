"""Sobol indices: how much of a size's variance each entry makes, alone and together with the others.

Page ``theory/virtual-units.md``.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array, Integers
from rverror.base.chance import student
from rverror.base.errors import InputError
from rverror.base.progress import Progress
from rverror.tolerances.sampling import Sampler, check_seed, check_share, computed, sampler, uniforms
from rverror.tolerances.stacking import Stack

#: Points that indices are estimated from where no number is given.
COUNT = 2**13

_REPLICATES = 16
_FEWEST = 8  # points of a replicate


@dataclass(frozen=True)
class SobolIndices:
    """First-order and total indices of groups of variates, with intervals."""

    first: Array  #: (groups,); share of the variance that the group makes alone: what would be gained if it were known
    first_low: Array  #: (groups,); lower end of its interval
    first_high: Array  #: (groups,); upper end
    #: (groups,); share that the group makes alone and together with others: what would be left if all others were known
    total: Array
    total_low: Array  #: (groups,); lower end of its interval
    total_high: Array  #: (groups,); upper end
    variance: float  #: of the function
    points: int  #: points A and B each; the function was evaluated points * (groups + 2) times


def _replicate(function: Callable[[Array], Array], groups: Integers, points: int, seed: int, index: int) -> Array:
    """Values on one scramble: of A, of B, and of A with each group from B, shape (groups + 2, points, outputs)."""
    numbers, blocks = range(int(groups.max(initial=-1)) + 1), []
    for block in uniforms(points, 2 * groups.size, seed=seed, index=index):
        a, b = (np.ascontiguousarray(half) for half in np.split(block, 2, axis=1))
        mixed = (np.where(groups == group, b, a) for group in numbers)
        blocks.append([function(drawn).reshape(len(block), -1) for drawn in (a, b, *mixed)])
    return np.concatenate(blocks, axis=1)


def _peak_to_peaks(sampler: Sampler, points: Array) -> Array:
    """Peak-to-peaks of units by their uniform variates, shape (units,), rad."""
    return sampler.sizes(points).peak_to_peak


def sobol_indices(
    function: Callable[[Array], Array],
    groups: npt.ArrayLike,
    *,
    count: int = COUNT,
    seed: int = 0,
    confidence: float = 0.95,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> tuple[SobolIndices | None, ...]:
    """Indices of any function of independent uniform variates.

    Parameters
    ----------
    function : callable
        ``function(uniforms)``, shape (points, dimensions) -> (points,) or (points, outputs).
    groups : array_like of int, shape (dimensions,)
        Group to which each variate belongs, 0 to groups - 1; a group's variates are exchanged together.
    count : int
        Points, rounded down to a power of two for each of 16 scrambles, which have 16 at least.
    confidence : float
        Of the intervals.
    executor : concurrent.futures.Executor, optional
        Where the scrambles are computed; the numbers are the same with any.
    progress : callable, optional
        Called with a line of text after each scramble.

    Returns
    -------
    tuple of SobolIndices or None
        Of each output; None of one that does not vary.

    Raises
    ------
    InputError
        If a setting is unusable.

    Notes
    -----
    First order: mean of f(B) (f(A_g) - f(A)) over the variance, with f taken off its mean (Saltelli et al. 2010).
    Total: half the mean of (f(A) - f(A_g))**2 over the variance (Jansen 1999).  A_g is A with the group's variates
    from B; A and B are the halves of the coordinates of a scrambled Sobol sequence.  Intervals by Student's t from the
    scatter of the linearised ratios between the scrambles.

    Examples
    --------
    >>> (found,) = sobol_indices(lambda u: 2 * u[:, 0] + u[:, 1], [0, 1])
    >>> found.first.round(2).tolist(), found.total.round(2).tolist()
    ([0.8, 0.2], [0.8, 0.2])
    """
    check_share("confidence", confidence)
    check_seed(seed)
    belongs = np.asarray(groups, dtype=np.intp)
    points = max(_FEWEST, 1 << max(0, (count // _REPLICATES).bit_length() - 1))
    task = partial(_replicate, function, belongs, points, int(seed))
    replicates = computed(task, range(_REPLICATES), executor, progress, "Sobol indices")
    values = np.array([found for _, found in replicates])
    return tuple(_indices(output, confidence) for output in np.moveaxis(values, -1, 0))


def _indices(values: Array, confidence: float) -> SobolIndices | None:
    """Indices from the values of A, of B, and of A with each group from B, shape (replicates, groups + 2, points)."""
    values = values - values[:, :2].mean()
    a, b, mixed = values[:, :1], values[:, 1:2], values[:, 2:]
    variances = (a**2 + b**2).mean(axis=2) / 2  # (replicates, 1)
    variance = float(variances.mean())
    if not variance > 0:
        return None
    first = _ratio((b * (mixed - a)).mean(axis=2), variances, confidence)
    total = _ratio(((mixed - a) ** 2).mean(axis=2) / 2, variances, confidence)
    return SobolIndices(*first, *total, variance=variance, points=values.shape[0] * values.shape[2])


def stack_indices(stack: Stack, **settings: Any) -> SobolIndices:
    """Indices of the peak-to-peak, one group for each tolerance entry, in their order.

    All variates of an entry are exchanged together, its instances, phases and common parts included.  The settings are
    those of `sobol_indices`.  Entries that are correlated or matched with others are no independent
    causes: theirs are nan.

    Raises
    ------
    InputError
        If it does not vary, or a setting is unusable.
    """
    (found,) = sobol_indices(partial(_peak_to_peaks, sampler(stack)), stack.variate_entry, **settings)
    if found is None:
        raise InputError("the output does not vary, so nothing has a share of its variance; check the tolerances")
    return without_joined(found, stack)


def without_joined(found: SobolIndices, stack: Stack) -> SobolIndices:
    """The same, not a number for entries that are correlated with others, and so are no cause by themselves."""
    if stack.dependence is None:
        return found
    joined = np.isin(np.arange(len(stack.rules)), stack.entry[stack.dependence.between.any(axis=1)])
    ends = ("first", "first_low", "first_high", "total", "total_low", "total_high")
    known: dict[str, Any] = {name: np.where(joined, np.nan, getattr(found, name)) for name in ends}
    return replace(found, **known)


def _ratio(numerators: Array, variances: Array, confidence: float) -> tuple[Array, Array, Array]:
    """Ratio of the means of replicates, shapes (replicates, groups) and (replicates, 1), with its interval."""
    replicates = len(numerators)
    value = numerators.mean(axis=0) / variances.mean()
    spread = (numerators - value * variances).std(axis=0, ddof=1) / variances.mean()
    margin = student((1 - confidence) / 2, replicates - 1) * spread / math.sqrt(replicates)
    return value, value - margin, value + margin
