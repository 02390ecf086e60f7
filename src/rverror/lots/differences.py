"""Groups of a lot that differ, and means that change over its serial numbers: which parts' shift does it.

Page ``theory/lots.md``.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array
from rverror.base.chance import student
from rverror.base.text import describe
from rverror.diagnosis.policy import POLICY
from rverror.geartrain.source import IndexValue
from rverror.lots.processes import UnitParts
from rverror.lots.result import Change, Difference, Interval, Shift
from rverror.model.catalogue import source

_INSTANCES = 12  # of a process that are told apart: one fixture for a single pin of forty is not what a workshop has
_SILENT = 1e-3  # of the noise that a workshop's spread makes: a thousand units would show a hundred spreads at best
_APART = 1e-6  # of two columns' information, in the direction that both leave: less is rounding
_ASYMPTOTIC = 500.0  # chi-square from which on the tail's first term is right to a part in 200; its own underflows
_VECTOR = 6.6  # chi-square of one parameter that chance exceeds in 1 %: a second parameter has to be worth it
RIVAL = 9.2  # = -2 ln 0.01: what is a hundred times less likely is no rival
_VALUES = (2, 20)  # of a label: one tells nothing, and more are serial numbers under another name
_LEAST = 5  # units of a value, and of the others: a mean of fewer is that of one odd unit
_SHUFFLES, _COURSE_SHUFFLES = 499, 199  # the tail is fitted to a fifth of them: a hundred and forty
_ROWS = 64  # contrasts of these together: as many as a product of matrices takes to be fast
_TAIL = 0.2  # of what chance makes, to which its tail is fitted
_DIFFERENCES, _CHANGES = 4, 3  # at most: beyond these a lot is no lot
_EDGE, _POSITIONS = 0.05, 60  # of the units at either end, where a mean is that of few; and positions between


@dataclass(frozen=True)
class ShiftSource:
    """A source of a shift: parts that move alike, in one parameter or in all of them.

    Attributes
    ----------
    key : str
        A key of the catalogue.
    indices : mapping of str to int or str
        What its parts have in common.
    parameters : tuple of str
    dimension : str
        A key of `units.CORE_UNITS`.
    columns : ndarray, shape (d, parameters)
        Change of a unit's whitened amplitudes per core unit.
    """

    key: str
    indices: Mapping[str, IndexValue]
    parameters: tuple[str, ...]
    dimension: str
    columns: Array

    @property
    def label(self) -> str:
        """Its name for people."""
        return describe(self.key, self.indices)

    @property
    def plausible(self) -> Array:
        """Largest shift of each parameter that surprises no one, core units."""
        known = {p.name: p.plausible for p in source(self.key).parameters}
        return np.array([known[name] for name in self.parameters])

    def shifts(self, sizes: Array, errors: Array, times: float) -> tuple[Shift, ...]:
        """A shift for each parameter, with intervals of so many standard errors to either side."""
        return tuple(
            Shift(
                self.key, self.indices, name, self.dimension, Interval(size, size - times * error, size + times * error)
            )
            for name, size, error in zip(self.parameters, sizes.tolist(), errors.tolist(), strict=True)
        )


def candidates_of(influence: Array, parts: UnitParts) -> tuple[ShiftSource, ...]:
    """Sources of shifts: of each process the parts that share some of their indices, and all parts.

    A process of many parts has all of them alike only.

    Parameters
    ----------
    influence : ndarray, shape (d, components)
        Change of a unit's whitened amplitudes per core unit of each component.
    parts : UnitParts

    Returns
    -------
    tuple of ShiftSource
        Of what shows; each parameter by itself, and then all of them.
    """
    found, first = list[ShiftSource](), 0
    for process in parts.processes:
        for some in _alike(process.instances):
            found += _sources(influence, parts, [first + number for number in some])
        first += len(process.instances)
    return tuple(found)


def single_parts(influence: Array, parts: UnitParts) -> tuple[ShiftSource, ...]:
    """Sources of one unit's error: every part by itself, as `candidates_of`.

    Parameters
    ----------
    influence : ndarray, shape (d, components)
    parts : UnitParts

    Returns
    -------
    tuple of ShiftSource
    """
    return tuple(one for number in range(len(parts.effects)) for one in _sources(influence, parts, [number]))


def _sources(influence: Array, parts: UnitParts, effects: Sequence[int]) -> list[ShiftSource]:
    """Effects of one process that move alike, by each parameter and by all, where a workshop's spread shows."""
    places = np.array([np.flatnonzero(parts.effect == number) for number in effects])
    parameters = [parts.parameters[place] for place in places[0]]
    columns = influence[:, places].sum(axis=1)
    shown = np.flatnonzero(np.linalg.norm(columns, axis=0) * parts.plausible[places[0, 0]] > _SILENT).tolist()
    found = []
    for some in (*([k] for k in shown), *([shown] if len(shown) > 1 else [])):
        names = tuple(parameters[k].name for k in some)
        key, common = parts.effects[effects[0]].key, _common([parts.effects[number].indices for number in effects])
        found.append(ShiftSource(key, common, names, parameters[0].dimension, columns[:, some]))
    return found


def _alike(instances: Sequence[Mapping[str, IndexValue]]) -> list[tuple[int, ...]]:
    """Sets of instances that share what some of their indices are, each set once; all together first."""
    everyone = tuple(range(len(instances)))
    if len(instances) > _INSTANCES:
        return [everyone]
    names = [name for name in instances[0] if name != "harmonic"]
    found = {everyone: None}
    for count in range(1, len(names) + 1):
        for chosen in combinations(names, count):
            sets = dict[tuple[IndexValue, ...], list[int]]()
            for number, one in enumerate(instances):
                sets.setdefault(tuple(one[name] for name in chosen), []).append(number)
            found.update({tuple(some): None for some in sets.values()})
    return list(found)


def _common(instances: Sequence[Mapping[str, IndexValue]]) -> dict[str, IndexValue]:
    first = instances[0]
    return {name: value for name, value in first.items() if all(one[name] == value for one in instances)}


@dataclass(frozen=True)
class Fits:
    """Candidates, and what of a unit's amplitudes each of them explains.

    Attributes
    ----------
    candidates : tuple of ShiftSource
        Those whose parameters are told apart.
    freedom : ndarray of int, shape (candidates,)
        Parameters of each.
    basis : ndarray, shape (d, sum of freedom)
        Amplitudes times it are independent and of unit variance, as many of them for a candidate as it has parameters.
    sizing : tuple of ndarray, shape (d, parameters)
        Amplitudes times it are the candidate's sizes.
    """

    candidates: tuple[ShiftSource, ...]
    freedom: npt.NDArray[np.intp]
    basis: Array
    sizing: tuple[Array, ...]

    @classmethod
    def of(cls, candidates: Iterable[ShiftSource], weight: Array) -> Fits:
        """Of candidates, where the inverse covariance of a unit's amplitudes is known."""
        kept, basis, sizing = list[ShiftSource](), list[Array]([np.empty((len(weight), 0))]), list[Array]()
        for one in candidates:
            pressed = weight @ one.columns
            gram = one.columns.T @ pressed
            size = np.sqrt(np.diag(gram))
            if np.linalg.eigvalsh(gram / np.outer(size, size))[0] < _APART:
                continue
            kept.append(one)
            basis.append(np.asarray(np.linalg.solve(np.linalg.cholesky(gram), pressed.T).T))
            sizing.append(np.asarray(np.linalg.solve(gram, pressed.T).T))
        freedom = np.array([len(one.parameters) for one in kept], dtype=np.intp)
        return cls(tuple(kept), freedom, np.concatenate(basis, axis=1), tuple(sizing))

    def chi_squares(self, projected: Array) -> Array:
        """Chi-square of each candidate, of amplitudes times the basis, shape (..., basis) to (..., candidates)."""
        starts = np.cumsum(self.freedom) - self.freedom
        return np.asarray(np.add.reduceat(projected**2, starts, axis=-1))

    def surprise(self, chi: Array) -> Array:
        """Largest `surprise` of a candidate, of chi-squares of all, shape (..., candidates) to (...)."""
        of_each = [surprise(chi[..., self.freedom == q].max(axis=-1), q) for q in np.unique(self.freedom)]
        return np.asarray(np.max(of_each, axis=0))

    def likely(self, chi: Array, away: Array, misfit: float = 1.0) -> Array:
        """Chi-squares less what the prior of shifts takes off, of amplitudes that are so far away, (d,).

        The prior is that of a cause in a diagnosis.  Where influences leave a misfit, differences of chi-squares say as
        much less.
        """
        usual = [POLICY.workshop * one.plausible for one in self.candidates]
        sizes = [(away @ sizing) / one for one, sizing in zip(usual, self.sizing, strict=True)]
        return np.maximum(chi - misfit * np.array([float(size @ size) for size in sizes]), 0.0)

    def best(self, chi: Array) -> int:
        """Number of the candidate that explains most; all parameters of its parts only where one does not do."""
        found = int(np.argmax([surprise(np.array(t), q) for t, q in zip(chi, self.freedom, strict=True)]))
        own = [number for number in range(len(chi)) if self._same(number, found)]
        whole = max(own, key=lambda number: (self.freedom[number], chi[number]))
        single = max(own, key=lambda number: (-self.freedom[number], chi[number]))
        return whole if chi[whole] - chi[single] >= _VECTOR else single

    def rivals(self, chi: Array, best: int, misfit: float = 1.0) -> tuple[str, ...]:
        """Other parts that do it nearly as well, the nearest first, and all mirror images; more where the best leaves
        a misfit itself."""
        near = {best, *np.flatnonzero(chi > chi[best] - RIVAL * misfit).tolist()}
        near = near.union(*map(self._mirrored, near))
        rivals = [n for n in np.argsort(-chi).tolist() if n in near and not self._same(n, best)]
        return tuple(dict.fromkeys(self.candidates[n].label for n in rivals))

    def _mirrored(self, number: int) -> set[int]:
        """Mirror images of a candidate, other crank and other disc, which contacts alone distinguish."""
        one = self.candidates[number]
        named = {n: its.indices for n, its in enumerate(self.candidates) if its.key == one.key}
        alike = {n: at for n, at in named.items() if at.keys() == one.indices.keys()}
        if not one.indices.keys() - {"harmonic"} or len({tuple(at.values()) for at in alike.values()}) > _INSTANCES:
            return set()
        return {n for n, at in alike.items() if all((at[i] == one.indices[i]) == (i == "harmonic") for i in at)}

    def _same(self, one: int, other: int) -> bool:
        """Whether two candidates are about the same parts."""
        a, b = self.candidates[one], self.candidates[other]
        return a.key == b.key and a.indices == b.indices


def misfit(contrast: Array, weight: Array, chi: float, freedom: int) -> float:
    """Chi-square of what a cause leaves of a contrast of units, over its degrees of freedom; 1 where it is less.

    A large shift is more than influences of the first order, and what they lack must not decide between parts.

    Parameters
    ----------
    contrast : ndarray, shape (d,)
        Sum of units' whitened amplitudes, of unit variance.
    weight : ndarray, shape (d, d)
    chi : float
        What the cause explains.
    freedom : int
        Of the cause.

    Returns
    -------
    float
    """
    return max(1.0, (float(contrast @ weight @ contrast) - chi) / max(len(contrast) - freedom, 1))


def surprise(chi: Array, freedom: float) -> Array:
    """Minus the logarithm of how often chance exceeds a chi-square.

    Parameters
    ----------
    chi : ndarray
    freedom : float

    Returns
    -------
    ndarray

    Examples
    --------
    >>> np.round(surprise(np.array([2.0, 6.6, 2000.0]), 2), 6)  # half of it, of two parameters
    array([   1. ,    3.3, 1000. ])
    """
    near = -np.log(scipy.special.chdtrc(freedom, np.minimum(chi, _ASYMPTOTIC)))
    half = np.maximum(chi, _ASYMPTOTIC) / 2
    far = half - (freedom / 2 - 1) * np.log(half) + scipy.special.gammaln(freedom / 2)
    return np.asarray(np.where(chi < _ASYMPTOTIC, near, far))


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
    level: float = 0.01,
    seed: int = 0,
) -> tuple[Difference, ...]:
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
    level : float
        Chance of a difference where there is none, over all of them.
    seed : int

    Returns
    -------
    tuple of Difference
        The clearest first.
    """
    fits, groups = Fits.of(candidates, weight), _groups(labels)
    if not groups or not fits.candidates:
        return ()
    contrasts = np.array([group.contrast for group in groups])
    rng, left, found = np.random.default_rng(seed), np.array(values, dtype=np.float64), list[Difference]()
    while len(found) < _DIFFERENCES:
        at, chi, chance = _most_surprising(fits, contrasts, left, _SHUFFLES, rng)
        if chance >= level:
            break
        group = groups[at]
        away = left[group.inside].mean(axis=0) - left[group.outside].mean(axis=0)
        best, beyond, rivals = _explained(fits, chi, contrasts[at] @ left, away, weight)
        one = fits.candidates[best]
        sizes, errors, times = _difference(left @ fits.sizing[best], group)
        causes = one.shifts(sizes, errors * math.sqrt(beyond), times)
        found.append(Difference(group.label, group.value, int(group.inside.sum()), chance, causes, rivals))
        left[group.inside] -= one.columns @ sizes
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


def _difference(sized: Array, group: _Group) -> tuple[Array, Array, float]:
    """Sizes, their standard errors by the spread within each side, and how many of these make 95 %."""
    inside, outside = sized[group.inside], sized[group.outside]
    own, others = (side.var(axis=0, ddof=1) / len(side) for side in (inside, outside))
    freedom = float(np.min((own + others) ** 2 / (own**2 / (len(inside) - 1) + others**2 / (len(outside) - 1))))
    return inside.mean(axis=0) - outside.mean(axis=0), np.sqrt(own + others), student(0.025, freedom)


def _most_surprising(
    fits: Fits, contrasts: Array, values: Array, shuffles: int, rng: np.random.Generator
) -> tuple[int, Array, float]:
    """The contrast of units that surprises most, chi-squares of the candidates there, and the chance of it.

    Chance is what the contrasts make of units in any order.  Their weights are shuffled, some orders at a time: one
    product of matrices for all of these.
    """
    projected, units, seen = values @ fits.basis, contrasts.shape[1], list[float]()
    chi = fits.chi_squares(contrasts @ projected)
    surprises = fits.surprise(chi)
    while len(seen) < shuffles:
        orders = [rng.permutation(units) for _ in range(min(shuffles - len(seen), -(-_ROWS // len(contrasts))))]
        weights = np.concatenate([contrasts[:, np.argsort(order)] for order in orders])
        largest = fits.chi_squares((weights @ projected).reshape(len(orders), len(contrasts), -1)).max(axis=1)
        seen += fits.surprise(largest).tolist()
    at = int(np.argmax(surprises))
    return at, chi[at], tail_chance(np.array(seen), float(surprises[at]))


def _explained(
    fits: Fits, chi: Array, contrast: Array, away: Array, weight: Array
) -> tuple[int, float, tuple[str, ...]]:
    """The candidate that makes a contrast, the misfit that it leaves, and its rivals."""
    first = fits.best(fits.likely(chi, away))
    beyond = misfit(contrast, weight, float(chi[first]), int(fits.freedom[first]))
    likely = fits.likely(chi, away, beyond)
    best = fits.best(likely)
    return best, beyond, fits.rivals(likely, best, beyond)


# --- changes ----------------------------------------------------------------------------------------------------------


def changes_over_serial(
    values: Array,
    serials: Sequence[str],
    weight: Array,
    candidates: Sequence[ShiftSource],
    *,
    level: float = 0.01,
    seed: int = 0,
) -> tuple[Change, ...]:
    """Steps and ramps of a mean over the serial numbers, and the parts that make them.

    Candidates of one parameter count.  The most surprising over candidates, courses and beginnings is compared with
    what units in any order make.  Of what is found the search goes on in the steady part alone (`steady`): a shift that
    is large enough to be seen is not taken off to the last bit by influences of the first order.

    Parameters
    ----------
    values : ndarray, shape (units, d)
        Whitened amplitudes, in the order of the serial numbers.
    serials : sequence of str
    weight : ndarray, shape (d, d)
        Inverse covariance of a unit's amplitudes.
    candidates : sequence of ShiftSource
    level : float
        Chance of a change where there is none, over all of them.
    seed : int

    Returns
    -------
    tuple of Change
        Each in the steady part that those before it leave.
    """
    fits = Fits.of([one for one in candidates if len(one.parameters) == 1], weight)
    rng, found, part = np.random.default_rng(seed), list[Change](), slice(0, len(serials))
    while len(found) < _CHANGES and part.stop - part.start >= 2 * _LEAST and fits.candidates:
        some, names = values[part], serials[part]
        beginnings, courses = _courses(len(some))
        contrasts = courses - courses.mean(axis=1, keepdims=True)
        contrasts /= np.linalg.norm(contrasts, axis=1, keepdims=True)
        at, chi, chance = _most_surprising(fits, contrasts, some, _COURSE_SHUFFLES, rng)
        if chance >= level:
            break
        about = courses[at] - courses[at].mean()
        best, beyond, rivals = _explained(fits, chi, contrasts[at] @ some, about @ some / (about @ about), weight)
        size, error = _slope((some @ fits.sizing[best])[:, 0], courses[at])
        errors = np.array([error * math.sqrt(beyond)])
        cause = fits.candidates[best].shifts(np.array([size]), errors, student(0.025, len(some) - 2))[0]
        kind = "step" if at < len(beginnings) else "ramp"
        since = names[beginnings[at % len(beginnings)]]
        found.append(Change(since, kind, chance, cause, rivals))
        part = steady(found, serials)
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


def _slope(sized: Array, course: Array) -> tuple[float, float]:
    """Size of a course and its standard error, by the spread about it."""
    about = course - course.mean()
    squares = float(about @ about)
    size = float(about @ sized) / squares
    rest = sized - sized.mean() - size * about
    return size, math.sqrt(float(about**2 @ rest**2) * len(sized) / (len(sized) - 2)) / squares
