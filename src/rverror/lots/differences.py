"""Groups of a lot that differ, and means that change over its serial numbers: which parts' shift does it.

Page ``theory/lots.md``.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array
from rverror.base.chance import student
from rverror.lots.result import Change, Difference
from rverror.lots.shifts import Fits, ShiftedUnits, ShiftEffect, ShiftSource, explained

_VALUES = (2, 20)  # of a label: one tells nothing, and more are serial numbers under another name
_LEAST = 5  # units of a value, and of the others: a mean of fewer is that of one odd unit
_SHUFFLES, _COURSE_SHUFFLES = 499, 199  # the tail is fitted to a fifth of them: a hundred and forty
_ROWS = 64  # contrasts of these together: as many as a product of matrices takes to be fast
_TAIL = 0.2  # of what chance makes, to which its tail is fitted
_DIFFERENCES, _CHANGES = 4, 3  # at most: beyond these a lot is no lot
_EDGE, _POSITIONS = 0.05, 60  # of the units at either end, where a mean is that of few; and positions between
# deviance that the true beginning of a step exceeds in 5 %: (1 - exp(-x / 2))^2 is its distribution (Hansen 2000); that
# of a ramp, a chi-square, in 0.7 %
_BEGINNING = -2 * math.log(1 - math.sqrt(0.95))


def tail_chance(seen: Array, value: float) -> float:
    """How often chance exceeds a value: counted, and beyond what was seen an exponential fitted to the largest.

    Parameters
    ----------
    seen : ndarray
        What chance made.
    value : float

    Returns
    -------
    float
        With what the fit does not know of the exponential's mean.
    """
    start = float(np.quantile(seen, 1 - _TAIL))
    if value <= start:
        return float((1 + np.sum(seen >= value)) / (1 + len(seen)))
    beyond = seen[seen > start] - start
    total = max(float(beyond.sum()), 1e-9)  # where all are the same, whatever is beyond is no chance
    return float(_TAIL * (1 + (value - start) / total) ** -len(beyond))


# --- groups -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Group:
    """Units with a value of a label, against those with others."""

    label: str
    value: str
    inside: npt.NDArray[np.bool_]
    outside: npt.NDArray[np.bool_]

    @property
    def contrast(self) -> Array:
        """Weights of units whose sum is of unit variance: the difference of the means over its standard deviation."""
        n, m = self.inside.sum(), self.outside.sum()
        return np.asarray((self.inside / n - self.outside / m) * math.sqrt(n * m / (n + m)))


def group_differences(
    values: Array,
    labels: Mapping[str, tuple[str, ...]],
    weight: Array,
    candidates: Sequence[ShiftSource],
    *,
    shifted: ShiftedUnits,
    level: float = 0.01,
    seed: int = 0,
) -> tuple[tuple[Difference, ShiftEffect], ...]:
    """Values of labels whose units differ from those of the other values, and the parts that make it so.

    Of each candidate the chi-square of its fit to the difference of the means; the most surprising over labels, values
    and candidates is compared with what units make that are shuffled against their labels.  What is found is removed,
    and the rest searched again.

    Parameters
    ----------
    values : ndarray, shape (units, d)
        Whitened amplitudes.
    labels : mapping of str to tuple of str
        Of each unit, by name; empty where a unit has none.
    weight : ndarray, shape (d, d)
        Inverse covariance of a unit's amplitudes.
    candidates : sequence of ShiftSource
    shifted : ShiftedUnits
    level : float
        Chance of a difference where there is none, over all of them.
    seed : int

    Returns
    -------
    tuple of (Difference, ShiftEffect)
        The clearest first.
    """
    fits, groups = Fits.of(candidates, weight), _groups(labels)
    if not groups or not fits.candidates:
        return ()
    contrasts = np.array([group.contrast for group in groups])
    rng, left = np.random.default_rng(seed), np.array(values, dtype=np.float64)
    found = list[tuple[Difference, ShiftEffect]]()
    while len(found) < _DIFFERENCES:
        at, chance = _most_surprising(fits, contrasts, left, _SHUFFLES, rng)
        if chance >= level:
            break
        group = groups[at]
        share, some = group.inside.astype(np.float64), group.inside | group.outside
        cause = explained(fits, share[None, some], left[some], weight, shifted)
        left -= cause.effect.of(share)
        errors, times = _difference_error(left @ cause.sizing, group)
        sizes = cause.effect.sizes
        far = np.hypot(times * errors * math.sqrt(cause.misfit), 1.96 * cause.estimate_errors)
        causes = cause.source.shifts(sizes, sizes - far, sizes + far)
        told = Difference(group.label, group.value, int(group.inside.sum()), chance, causes, cause.rivals)
        found.append((told, cause.effect))
    return tuple(found)


def _groups(labels: Mapping[str, tuple[str, ...]]) -> list[_Group]:
    """Values of labels that have enough units; of two values the later one, for the other differs as much."""
    found = []
    for label, of_units in labels.items():
        counts = Counter(value for value in of_units if value)
        if not _VALUES[0] <= len(counts) <= _VALUES[1]:
            continue
        has = np.array(of_units)
        for value in sorted(counts)[1 if len(counts) == _VALUES[0] else 0 :]:
            inside, outside = has == value, (has != value) & (has != "")
            if min(inside.sum(), outside.sum()) >= _LEAST:
                found.append(_Group(label, value, inside, outside))
    return found


def _difference_error(sized: Array, group: _Group) -> tuple[Array, float]:
    """Standard errors of sizes by the spread within each side, and how many of these make 95 %."""
    inside, outside = sized[group.inside], sized[group.outside]
    own, others = (side.var(axis=0, ddof=1) / len(side) for side in (inside, outside))
    freedom = float(np.min((own + others) ** 2 / (own**2 / (len(inside) - 1) + others**2 / (len(outside) - 1))))
    return np.sqrt(own + others), student(0.025, freedom)


def _most_surprising(
    fits: Fits, contrasts: Array, values: Array, shuffles: int, rng: np.random.Generator
) -> tuple[int, float]:
    """The contrast of units that surprises most, and the chance of it.

    Chance is what the contrasts make of units in any order.  Their weights are shuffled, some orders at a time: one
    product of matrices for all of these.
    """
    projected, units, seen = values @ fits.basis, contrasts.shape[1], list[float]()
    surprises = fits.surprise(fits.chi_squares(contrasts @ projected))
    while len(seen) < shuffles:
        orders = [rng.permutation(units) for _ in range(min(shuffles - len(seen), -(-_ROWS // len(contrasts))))]
        weights = np.concatenate([contrasts[:, np.argsort(order)] for order in orders])
        largest = fits.chi_squares((weights @ projected).reshape(len(orders), len(contrasts), -1)).max(axis=1)
        seen += fits.surprise(largest).tolist()
    at = int(np.argmax(surprises))
    return at, tail_chance(np.array(seen), float(surprises[at]))


# --- changes ----------------------------------------------------------------------------------------------------------


def changes_over_serial(
    values: Array,
    serials: Sequence[str],
    weight: Array,
    candidates: Sequence[ShiftSource],
    *,
    shifted: ShiftedUnits,
    level: float = 0.01,
    seed: int = 0,
) -> tuple[tuple[Change, ShiftEffect], ...]:
    """Steps and ramps of a mean over the serial numbers, and the parts that make them.

    Candidates of one parameter count.  The most surprising over candidates, courses and beginnings is compared with
    what units in any order make.  Of what is found the search goes on in the steady part alone (`steady`): what is
    known of a shift takes it off in the mean, not from each unit.

    Parameters
    ----------
    values : ndarray, shape (units, d)
        Whitened amplitudes, in the order of the serial numbers.
    serials : sequence of str
    weight : ndarray, shape (d, d)
        Inverse covariance of a unit's amplitudes.
    candidates : sequence of ShiftSource
    shifted : ShiftedUnits
    level : float
        Chance of a change where there is none, over all of them.
    seed : int

    Returns
    -------
    tuple of (Change, ShiftEffect)
        Each in the steady part that those before it leave.
    """
    fits = Fits.of([one for one in candidates if len(one.parameters) == 1], weight)
    rng, found, part = np.random.default_rng(seed), list[tuple[Change, ShiftEffect]](), slice(0, len(serials))
    while len(found) < _CHANGES and part.stop - part.start >= 2 * _LEAST and fits.candidates:
        some, names = values[part], serials[part]
        beginnings, courses = _courses(len(some))
        contrasts = courses - courses.mean(axis=1, keepdims=True)
        contrasts /= np.linalg.norm(contrasts, axis=1, keepdims=True)
        at, chance = _most_surprising(fits, contrasts, some, _COURSE_SHUFFLES, rng)
        if chance >= level:
            break
        cause = explained(fits, courses, some, weight, shifted, at)
        share, sizes = courses[cause.course], cause.effect.sizes
        rest = ((some - cause.effect.of(share)) @ cause.sizing)[:, 0]
        wide, wider = (max(cause.misfit, one / float(cause.covariance[0, 0])) for one in _scatter(rest, share))
        kinds, begins = np.divmod(cause.courses(wider * _BEGINNING), len(beginnings))
        freedom = len(np.unique(kinds))  # a ramp that may be a step has two sizes
        most = wide * freedom * float(scipy.special.fdtri(freedom, len(some) - 2, 0.95))
        (shift,) = cause.source.shifts(sizes, *cause.sizes(most))
        tried = np.r_[-1, beginnings, len(some)]  # those between two are neither
        kind, first = divmod(cause.course, len(beginnings))
        since, earliest, latest = (
            names[at] for at in (tried[first + 1], tried[begins.min()] + 1, tried[begins.max() + 2] - 1)
        )
        told = Change(since, (earliest, latest), ("step", "ramp")[kind], chance, shift, cause.rivals)
        found.append((told, cause.effect))
        part = steady([change for change, _ in found], serials)
    return tuple(found)


def course(kind: str, first: int, end: int, units: int) -> Array:
    """Share of a change that each unit has: none before the first; of a step all, of a ramp all from the end on.

    Parameters
    ----------
    kind : str
        ``"step"`` or ``"ramp"``.
    first, end : int
        First unit with any of it, and the unit behind the one with all of a ramp.
    units : int

    Returns
    -------
    ndarray, shape (units,)

    Examples
    --------
    >>> course("ramp", 2, 4, 6), course("step", 2, 4, 6)
    (array([0. , 0. , 0.5, 1. , 1. , 1. ]), array([0., 0., 1., 1., 1., 1.]))
    """
    length = end - first if kind == "ramp" else 1
    return np.clip((np.arange(1, units + 1) - first) / length, 0.0, 1.0)


def steady(changes: Sequence[Change], serials: Sequence[str]) -> slice:
    """Units of one and the same process: before a ramp, and on the longer side of a step.

    Parameters
    ----------
    changes : sequence of Change
        As `changes_over_serial` found them.
    serials : sequence of str

    Returns
    -------
    slice
    """
    start, stop = 0, len(serials)
    for change in changes:
        at = serials.index(change.since)
        start, stop = (at, stop) if change.course == "step" and stop - at > at - start else (start, at)
    return slice(start, stop)


def _courses(units: int) -> tuple[npt.NDArray[np.intp], Array]:
    """First changed units; and steps, then ramps from them on, shape (2 * beginnings, units)."""
    ends = max(1, math.ceil(_EDGE * units)), min(units - 1, math.floor((1 - _EDGE) * units))
    first = np.unique(np.linspace(*ends, _POSITIONS).round().astype(np.intp))
    return first, np.array([course(kind, at, units, units) for kind in ("step", "ramp") for at in first])


def _scatter(rest: Array, course: Array) -> tuple[float, float]:
    """Variance of what a course leaves of the units' sizes: as its own size weighs units, and the largest of that and
    those on either side of its middle."""
    about, left = course - course.mean(), rest - rest.mean()
    size = float(about @ about)
    taken = 1 / len(rest) + about**2 / size  # of each unit's variance, by the fit (MacKinnon, White 1985: HC2)
    own = float(about**2 @ (left**2 / (1 - taken))) / size
    sides = (rest[about > 0], rest[about <= 0])
    return own, max(own, *(float(side.var(ddof=1)) for side in sides if len(side) > 1))
