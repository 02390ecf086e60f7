"""Shifts of parts: which they may be, what they do to a unit's amplitudes, and which of them makes a contrast of units.

Page ``theory/lots.md``.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import NamedTuple, Protocol

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array
from rverror.base.text import describe
from rverror.diagnosis.policy import POLICY
from rverror.geartrain.source import IndexValue
from rverror.lots.processes import UnitParts
from rverror.lots.result import Interval, Shift
from rverror.model.catalogue import source

_INSTANCES = 12  # of a process that are told apart: one fixture for a single pin of forty is not what a workshop has
_SILENT = 1e-3  # of the noise that a workshop's spread makes: a thousand units would show a hundred spreads at best
_APART = 1e-6  # of two columns' information, in the direction that both leave: less is rounding
_ASYMPTOTIC = 500.0  # chi-square from which on the tail's first term is right to a part in 200; its own underflows
_VECTOR = 6.6  # chi-square of one parameter that chance exceeds in 1 %: a second parameter has to be worth it
RIVAL = 9.2  # = -2 ln 0.01: what is a hundred times less likely is no rival
# units in which candidates are solved, and how many of them, the likeliest; the last ones at half their size too, which
# asks for more units; and anew where the size has changed by so much since
_SOLVED, _CHANGED = ((8, None), (50, 16), (200, 4), (200, 4)), 0.1
_SIZED = 400  # units in which the one that is told is sized: a lot rarely has as many with the shift
_NOISE = 0.5  # share of an effect's square that is taken off as noise at most: a square of noise alone has none left
_LARGEST = 3.0  # plausible sizes at which a source is solved at most: influences may ask for metres
_ORDERS = np.arange(1, 5)  # powers of a share that solved shares tell: its own, half of it, and their opposites
_TIMES = np.linspace(-3.0, 3.0, 2401)  # of the size at which a source was solved: a lot shows no shift to 1/400
_POWERS = _TIMES ** _ORDERS[:, None]


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

    def shifts(self, sizes: Array, low: Array, high: Array) -> tuple[Shift, ...]:
        """A shift for each parameter, with the ends of its interval."""
        sized = zip(self.parameters, sizes.tolist(), low.tolist(), high.tolist(), strict=True)
        return tuple(Shift(self.key, self.indices, name, self.dimension, Interval(*size)) for name, *size in sized)


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
    every = [parts.effects[number] for number in effects]
    common = {name: at for name, at in every[0].indices.items() if all(one.indices[name] == at for one in every)}
    key, dimension = every[0].key, parameters[0].dimension
    return [
        ShiftSource(key, common, tuple(parameters[k].name for k in some), dimension, columns[:, some])
        for some in (*([k] for k in shown), *([shown] if len(shown) > 1 else []))
    ]


def _alike(instances: Sequence[Mapping[str, IndexValue]]) -> list[tuple[int, ...]]:
    """Sets of instances that share what some of their indices are, each set once; all together first."""
    names = [name for name in instances[0] if name != "harmonic"]
    most = len(names) if len(instances) <= _INSTANCES else 0  # indices that are asked for: without any all are alike
    found = dict[tuple[int, ...], None]()
    for count in range(most + 1):
        for chosen in combinations(names, count):
            sets = dict[tuple[IndexValue, ...], list[int]]()
            for number, one in enumerate(instances):
                sets.setdefault(tuple(one[name] for name in chosen), []).append(number)
            found.update({tuple(some): None for some in sets.values()})
    return list(found)


class ShiftEffect(NamedTuple):
    """What a shift does to a unit's whitened amplitudes in the mean: a share of it does a sum of its powers.

    Attributes
    ----------
    sizes : ndarray, shape (parameters,)
        Of the shift, core units.
    powers : ndarray, shape (4, d)
        Changes with the first power of a share and the next ones.
    errors : ndarray, shape (units, 4, d)
        What each unit in which it was solved adds to the errors of these means: sums of products are their covariance.
    """

    sizes: Array
    powers: Array
    errors: Array

    def of(self, share: Array) -> Array:
        """What shares of it do, shape (n,) to (n, d)."""
        return np.asarray(share[:, None] ** _ORDERS @ self.powers)

    def times(self, factor: float) -> ShiftEffect:
        """That of a shift so many times as large."""
        powers = (factor**_ORDERS)[:, None]
        return ShiftEffect(factor * self.sizes, powers * self.powers, powers * self.errors)

    def noise(self, weight: Array) -> float:
        """Share of its square m'Wm that comes from the scatter of the units in which it was solved; half at most."""
        errors, mean = self.errors.sum(axis=1), self.powers.sum(axis=0)
        return min(float(np.sum((errors @ weight) * errors)) / max(float(mean @ weight @ mean), 1e-300), _NOISE)


class ShiftedUnits(Protocol):
    """Units solved with shifts of their parts."""

    def effects(self, sources: Sequence[ShiftSource], sizes: Sequence[Array], units: int) -> Array:
        """What each shift and its opposite do to the amplitudes of so many units, (units, sources, 2, d)."""

    def covariance(self, source: ShiftSource, sizes: Array) -> Array:
        """Covariance of the amplitudes of a unit with a shift, shape (d, d)."""

    def uncertainty(self, source: ShiftSource, sizes: Array) -> Array:
        """What the estimate's errors do to the mean change by a shift, as rows R with the covariance R'R, (k, d)."""


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
        Amplitudes of a unit times it are the candidate's sizes.
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

    def likely(self, chi: Array, sizes: Sequence[Array], misfit: float = 1.0) -> Array:
        """Chi-squares less what the prior of shifts takes off, of each candidate's sizes.

        The prior is that of a cause in a diagnosis.  Where influences leave a misfit, differences of chi-squares say as
        much less.
        """
        pairs = zip(sizes, self.candidates, strict=True)
        over = np.array([float(np.sum((size / one.plausible) ** 2)) for size, one in pairs])
        return np.maximum(chi - misfit * over / POLICY.workshop**2, 0.0)

    def best(self, chi: Array, misfit: float = 1.0) -> int:
        """Number of the candidate that explains most; all parameters of its parts only where one does not do, for which
        a difference counts in units of the misfit."""
        found = int(np.argmax([surprise(np.array(t), q) for t, q in zip(chi, self.freedom, strict=True)]))
        own = [number for number in range(len(chi)) if self._same(number, found)]
        whole = max(own, key=lambda number: (self.freedom[number], chi[number]))
        single = max(own, key=lambda number: (-self.freedom[number], chi[number]))
        return whole if chi[whole] - chi[single] >= _VECTOR * misfit else single

    def rivals(self, chi: Array, best: int, misfit: float = 1.0, errors: Array | None = None) -> tuple[str, ...]:
        """Other parts that do it nearly as well, the nearest first, and all mirror images; more where the best leaves
        a misfit itself, or chi-squares have standard errors."""
        unsure = 0.0 if errors is None else 1.96 * np.hypot(errors, errors[best])
        near = {best, *np.flatnonzero(chi + unsure > chi[best] - RIVAL * misfit).tolist()}
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


def misfit(left: Array, freedom: int) -> float:
    """Chi-square of what a cause leaves of a contrast of units, over its degrees of freedom; 1 where it is less.

    What is known of a shift is not all that it does, and what is lacking must not decide between parts.

    Parameters
    ----------
    left : ndarray, shape (d,)
        Independent, of unit variance.
    freedom : int
        Of the cause.

    Returns
    -------
    float
    """
    return max(1.0, float(left @ left) / max(len(left) - freedom, 1))


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


class Cause(NamedTuple):
    """What makes a contrast of units."""

    source: ShiftSource
    effect: ShiftEffect
    course: int  # its number
    sizing: Array  # (d, parameters): small changes of amplitudes times it are those of the sizes
    covariance: Array  # (parameters, parameters): of the sizes of one unit, were units as their covariance says
    estimate_errors: Array  # (parameters,): standard errors of the sizes by the errors of the estimate
    misfit: float
    rivals: tuple[str, ...]
    deviance: Array  # (courses, times): of each course and multiple of the effect, were units as their covariance says

    def courses(self, most: float) -> npt.NDArray[np.intp]:
        """Numbers of the courses whose deviance is no larger, each with the size that suits it."""
        return np.flatnonzero(self.deviance.min(axis=1) <= most)

    def sizes(self, most: float) -> tuple[Array, Array]:
        """Least and largest sizes whose deviance is no larger, each with the course that suits it, (parameters,)."""
        times = _TIMES[self.deviance.min(axis=0) <= most]
        ends = np.outer([times[0], times[-1]], self.effect.sizes)
        return ends.min(axis=0), ends.max(axis=0)


class _Ranking(NamedTuple):
    """Candidates with one course."""

    effects: list[ShiftEffect]
    likely: Array  # chi-square of each less what its prior takes off
    errors: Array  # standard errors of these by the units in which they were solved
    best: int
    misfit: float  # that the best leaves


@dataclass(frozen=True)
class _Courses:
    """Units, and the shares of a shift that they may have.

    Attributes
    ----------
    fits : Fits
    weight : ndarray, shape (d, d)
    values : ndarray, shape (units, d)
    shares : ndarray, shape (4, courses, units)
        Powers of each unit's share, about their means.
    unknown : ndarray, shape (k, d)
        Independent changes, each with a standard deviation of one, that the estimate's errors make of the shift's.
    """

    fits: Fits
    weight: Array
    values: Array
    shares: Array
    unknown: Array

    def chi_squares(self, effect: ShiftEffect) -> Array:
        """Of multiples of an effect with each course and the likeliest of what is unknown of it, (courses, times).

        Of its square what the scatter of the units adds, in which it was solved, is taken off.
        """
        pressed, lines = self.weight @ effect.powers.T, self.weight @ self.unknown.T
        along = np.einsum("pcu,up->cp", self.shares, self.values @ pressed)
        gram = np.einsum("pcu,qcu->cpq", self.shares, self.shares)
        own = gram * (effect.powers @ pressed)
        seen = self.shares[0] @ (self.values @ lines)
        shared = gram[:, 0, :, None] * (effect.powers @ lines)
        known = np.linalg.inv(np.eye(len(self.unknown)) + gram[:, 0, :1, None] * (self.unknown @ lines))
        along -= np.einsum("cpi,cij,cj->cp", shared, known, seen)
        own = (own - np.einsum("cpi,cij,cqj->cpq", shared, known, shared)) * (1 - effect.noise(self.weight))
        alone = np.einsum("ci,cij,cj->c", seen, known, seen)
        return np.asarray(alone[:, None] + 2 * along @ _POWERS - np.einsum("cpt,pt->ct", own @ _POWERS, _POWERS))

    def scattered(self, course: int, shifted: Array) -> _Courses:
        """The same by the covariance that the contrast of a course has: its units', between those with and without."""
        share = self.shares[0, course]
        part = float(share**2 @ (share - share.min())) / float(share @ share) / float(np.ptp(share))
        covariance = (1 - part) * np.linalg.inv(self.weight) + part * shifted
        return replace(self, weight=np.asarray(np.linalg.inv(covariance)))

    def whole_weight(self, course: int) -> Array:
        """Inverse covariance of a course's contrast, what is unknown included, shape (d, d)."""
        share, lines = self.shares[0, course], self.weight @ self.unknown.T
        known = np.eye(len(self.unknown)) / float(share @ share) + self.unknown @ lines
        return np.asarray(self.weight - lines @ np.linalg.solve(known, lines.T))

    def ranked(self, course: int, solved: Mapping[int, ShiftEffect]) -> _Ranking:
        """Candidates with one course, to first order where they were not solved."""
        fits, share = self.fits, self.shares[0, course]
        size = float(np.linalg.norm(share))
        contrast = share @ self.values / size
        chi = fits.chi_squares(contrast @ fits.basis)
        linear = [contrast @ sizing / size for sizing in fits.sizing]
        pairs = zip(linear, fits.candidates, strict=True)
        exact = np.empty((0, len(_ORDERS), len(self.weight)))
        effects = [ShiftEffect(sizes, np.outer(_ORDERS == 1, one.columns @ sizes), exact) for sizes, one in pairs]
        only = replace(self, shares=self.shares[:, [course]])
        for number, effect in solved.items():
            of_times = only.chi_squares(effect)[0]
            chi[number], effects[number] = of_times.max(), effect.times(_TIMES[of_times.argmax()])
        sizes, errors = [one.sizes for one in effects], np.array([self.error(course, one) for one in effects])
        first = fits.best(fits.likely(chi, sizes))
        beyond = self.misfit(course, effects[first], int(fits.freedom[first]))
        likely = fits.likely(chi, sizes, beyond)
        return _Ranking(effects, likely, errors, fits.best(likely, beyond), beyond)

    def misfit(self, course: int, effect: ShiftEffect, freedom: int) -> float:
        """What an effect leaves of the contrast of a course, as `misfit` has it."""
        share = self.shares[0, course]
        left = share @ self.values - self.shares[:, course] @ share @ effect.powers
        return misfit(left / np.linalg.norm(share) @ np.linalg.cholesky(self.whole_weight(course)), freedom)

    def error(self, course: int, effect: ShiftEffect) -> float:
        """Standard error of an effect's chi-square with a course, by the units in which it was solved."""
        share = self.shares[0, course]
        given = self.shares[:, course] @ share
        left = share @ self.values - given @ effect.powers
        return 2 * float(np.linalg.norm(given @ effect.errors @ self.weight @ left)) / float(share @ share)


def explained(fits: Fits, courses: Array, values: Array, weight: Array, units: ShiftedUnits, at: int = 0) -> Cause:
    """The candidate that makes a difference of units, and its course.

    Influences find a shift, but where it opens or closes contacts they tell neither its part nor its size nor its
    beginning.  So all candidates are solved with it in few units, and the likeliest in more; and the likeliest of these
    in many, as a shift changes the units' scatter too.

    Parameters
    ----------
    fits : Fits
    courses : ndarray, shape (courses, units)
        Share of the shift that each unit has.
    values : ndarray, shape (units, d)
        Whitened amplitudes.
    weight : ndarray, shape (d, d)
        Inverse covariance of a unit's amplitudes.
    units : ShiftedUnits
    at : int
        The course that was found.

    Returns
    -------
    Cause
    """
    shares = np.array([courses**power - np.mean(courses**power, axis=1, keepdims=True) for power in _ORDERS])
    of = _Courses(fits, weight, values, shares, np.empty((0, len(weight))))
    solved, counts = dict[int, ShiftEffect](), dict[int, int]()
    unshifted, found = of, of.ranked(at, solved)
    scattered: tuple[int, Array] | None = None  # the candidate, and its sizes, whose scatter is known
    for count, most in _SOLVED:
        likeliest = list(dict.fromkeys([found.best, *np.argsort(-found.likely).tolist()]))[:most]
        few = [n for n in likeliest if counts.get(n, 0) < count]
        asked = [n for n in likeliest if n in few or _far(found.effects[n].sizes, solved[n].sizes)]
        if not asked:
            break
        some = [fits.candidates[n] for n in asked]
        sizes = [_bounded(found.effects[n].sizes, fits.candidates[n]) for n in asked]
        solved.update(zip(asked, _solved(some, sizes, units, count, halves=count == _SOLVED[-1][0]), strict=True))
        counts |= dict.fromkeys(asked, count)
        found = of.ranked(at, solved)
        if most is not None:
            one, own = fits.candidates[found.best], found.effects[found.best].sizes
            if scattered is None or scattered[0] != found.best or _far(own, scattered[1]):
                scattered = found.best, own
                shifted = units.covariance(one, _bounded(own, one))
            of = unshifted.scattered(at, shifted)
            found = of.ranked(at, solved)
        for _ in range(2):  # what is best with one course may have another, and with that not be best
            at = int(np.argmax(of.chi_squares(found.effects[found.best]).max(axis=1)))
            found = of.ranked(at, solved)
    one, rivals = fits.candidates[found.best], fits.rivals(found.likely, found.best, found.misfit, found.errors)
    size = _bounded(found.effects[found.best].sizes, one)
    (effect,) = _solved([one], [size], units, _SIZED, halves=True)
    of = replace(of, unknown=units.uncertainty(one, size))
    chi = of.chi_squares(effect)
    at, times = (int(place) for place in np.unravel_index(chi.argmax(), chi.shape))
    effect = effect.times(_TIMES[times])
    slope = (2 - _ORDERS % 2) @ effect.powers  # of a line and a square: with higher powers it has their noise thrice
    columns = one.columns + np.outer(slope - one.columns @ effect.sizes, effect.sizes) / (effect.sizes @ effect.sizes)
    pressed = of.whole_weight(at) @ columns
    sizing = np.asarray(np.linalg.solve(columns.T @ pressed, pressed.T).T)
    covariance = sizing.T @ np.linalg.solve(of.weight, sizing)
    errors = np.asarray(np.linalg.norm(of.unknown @ sizing, axis=0))
    beyond, deviance = of.misfit(at, effect, len(one.parameters)), -of.chi_squares(effect)
    return Cause(one, effect, at, sizing, covariance, errors, beyond, rivals, deviance - deviance.min())


def _solved(
    some: Sequence[ShiftSource], sizes: Sequence[Array], units: ShiftedUnits, count: int, *, halves: bool
) -> list[ShiftEffect]:
    """Effects of sources, solved with their sizes and the opposites in so many units, and with halves of both."""
    whole, *half = (units.effects(some, [times * one for one in sizes], count) for times in (1.0, 0.5)[: 1 + halves])
    odd, even = ([(one[:, :, 0] + sign * one[:, :, 1]) / 2 for one in (whole, *half)] for sign in (-1, 1))
    third, fourth = (4 / 3 * (of[0] - times * of[-1]) * halves for of, times in ((odd, 2), (even, 4)))
    powers = np.stack([odd[0] - third, even[0] - fourth, third, fourth], axis=2)
    means = powers.mean(axis=0)
    errors = (powers - means) / math.sqrt(len(powers) * max(len(powers) - 1, 1))
    return [
        ShiftEffect(size, mean, own) for size, mean, own in zip(sizes, means, np.moveaxis(errors, 1, 0), strict=True)
    ]


def _bounded(sizes: Array, one: ShiftSource) -> Array:
    """Sizes in the same direction, none beyond its bound."""
    return np.asarray(sizes / max(1.0, float(np.max(np.abs(sizes) / one.plausible)) / _LARGEST))


def _far(sizes: Array, solved: Array) -> bool:
    """Whether sizes are so far from those that were solved that what was found there may not hold."""
    return float(np.linalg.norm(sizes - solved)) > _CHANGED * float(np.linalg.norm(sizes))
