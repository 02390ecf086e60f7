"""Which cause grows or jumped: courses over the sessions, and a search over these and all sources.

Page ``theory/trend.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy

from rverror.base.arrays import Array, Integers
from rverror.base.errors import InputError
from rverror.life.sessions import FEW, repeated
from rverror.life.unit_state import UnitState, known_to
from rverror.lots.shifts import RIVAL, ShiftSource, candidates_of, single_parts
from rverror.model.catalogue import source

_COARSE, _FINE = 4, 16  # time constants of growths that settle that are tried, and in between
_SETTLING = (0.03, 0.6)  # the shortest and longest, as shares of the time from the first session to the last
_BETWEEN = 6  # times between two sessions from which a growth may start
_GROWN = 2  # sessions that show a growth: one that the last session alone has may be a jump as well


@dataclass(frozen=True)
class Course:
    """How a cause of size 1 has grown.

    Attributes
    ----------
    kind : str
        ``"linear"``, ``"settling"`` or ``"step"``.
    since : float
        Time from which on it grows; of a jump that of the first session that has it, hours or cycles.
    end : float
        Time of the last session, at which it is 1.
    settling : float
        Time constant of a growth that settles, hours or cycles.
    cost : float
        Minus twice the logarithm of its prior probability.
    """

    kind: str
    since: float
    end: float
    settling: float = 0.0
    cost: float = 0.0

    def grown(self, at: Array) -> Array:
        """Size at some times."""
        after, span = np.maximum(at - self.since, 0.0), self.end - self.since
        if self.kind == "step":
            return np.where(at >= self.since, 1.0, 0.0)
        if self.kind == "linear":
            return np.asarray(after / span)
        return np.asarray(np.expm1(-after / self.settling) / math.expm1(-span / self.settling))

    def centred(self, at: Array) -> Array:
        """The same about its mean: what does not change is not asked for."""
        values = self.grown(at)
        return np.asarray(values - values.mean())

    def bend(self, at: Array) -> Array:
        """How a growth is off that bends between none and all of it, about its mean; 0 of a jump."""
        grown = self.grown(at)
        values = 4 * grown * (1 - grown)
        return np.asarray(values - values.mean())

    @property
    def rate(self) -> float:
        """Growth per hour or cycle at the end, over the size there; 0 of a jump."""
        span = self.end - self.since
        if self.kind == "step":
            return 0.0
        if self.kind == "linear":
            return 1 / span
        return math.exp(-span / self.settling) / self.settling / -math.expm1(-span / self.settling)


def courses_of(at: Array, *, fine: bool = False) -> tuple[Course, ...]:
    """Courses that sessions can tell apart.

    Parameters
    ----------
    at : ndarray, shape (sessions,)
        Hours or cycles, growing.
    fine : bool
        Whether growths start between sessions as well, and more time constants are tried.

    Returns
    -------
    tuple of Course
        A jump at each session but the first; of three and more a growth from each session that two follow; of four
        and more growths that settle.  Each kind is as probable as another, and so is each session of a kind, but that
        half of the linear growths go on from the first.

    Examples
    --------
    >>> [(one.kind, one.since) for one in courses_of(np.array([0.0, 10, 20]))]
    [('step', 10.0), ('step', 20.0), ('linear', 0.0)]
    >>> courses_of(np.array([0.0, 10, 20]))[2].grown(np.array([0.0, 10, 20]))
    array([0. , 0.5, 1. ])
    """
    count, first, end = len(at), float(at[0]), float(at[-1])
    hinges = at[1 : count - _GROWN].tolist()
    kinds = 1 + (count > _GROWN) + (count > _GROWN + 1)

    def cost(members: float) -> float:
        return 2 * math.log(kinds * members)

    found = [Course("step", float(time), end, 0.0, cost(count - 1)) for time in at[1:]]
    if count > _GROWN:
        found.append(Course("linear", first, end, 0.0, cost(2 if hinges else 1)))
        places = np.arange(1, len(hinges) * _BETWEEN + 1) / _BETWEEN  # 0 is the first session, 1 the first hinge
        starts = np.interp(places, np.arange(len(hinges) + 1), [first, *hinges]).tolist() if fine else hinges
        found += [Course("linear", time, end, 0.0, cost(2 * len(hinges))) for time in starts]
    if count > _GROWN + 1:
        times = np.geomspace(*_SETTLING, _FINE if fine else _COARSE) * (end - first)
        found += [Course("settling", first, end, float(time), cost(_COARSE)) for time in times]
    return tuple(found)


_DOUBTED = 0.01  # of units in which nothing changed, those that are given a cause at most
EVIDENCE = -2 * math.log(_DOUBTED)  # by which a cause lowers minus twice the log posterior
#: Of the evidence of a cause: what further causes of the same orders must exceed, as states drawn about a unit tell a
#: fifth of an influence at light load no better; and within which another cause is a rival.  A model that misses 4 % of
#: an influence, which may look like the difference of two causes, moves their evidence by (2 * 2 * 0.04)^2 of it: two
#: standard errors.
_BESIDE, _ALIKE = 0.05, 0.03
_MOST = 4  # causes
_TRIED, _SOLVED = 24, 4  # causes that are fitted to the first order with what the model misses, and at the load
_ANY = 1e12  # variance over that of noise: any
_SHARES = np.linspace(0, 1, 5)  # of a cause that are solved: a contact that opens stops to answer half way
_BENT = 0.3  # of how a cause bends, that the unit's own state leaves open
_OPEN = (0.01, 0.03, 0.1, 0.2, 0.4, 0.7, 1.0, 1.5, 2.5, 4.0)  # shares of what an influence may miss
_NONE = 0.01  # of a plausible size, which is none
_REFITS, _MOVED = 4, 0.1  # of sizes whose causes are solved at the load, until they move by so many standard errors
_RELATIVE = 0.1  # of a size: influences of states that fit alike are off by that from those of the unit, see the page
_NEARLY = 0.05  # of sizes, by which they differ from those that were solved at the load


@dataclass(frozen=True)
class Term:
    """A cause, by its number, with its course: one of a set."""

    cause: int
    course: Course


@dataclass(frozen=True)
class AtLoad:
    """What shares of a cause do beyond the first order, weighted.

    Attributes
    ----------
    sizes : ndarray, shape (parameters,)
    rows : ndarray, shape (shares, d)
    """

    sizes: Array
    rows: Array

    def near(self, sizes: Array) -> bool:
        """Whether it may stand for other sizes."""
        return bool(np.linalg.norm(sizes - self.sizes) < _NEARLY * np.linalg.norm(self.sizes))

    @property
    def bent(self) -> Array:
        """Variance of how a cause bends between none and all of it, of what the load makes of its half."""
        middle = len(self.rows) // 2 - 1
        return np.asarray((_BENT * (self.rows[middle] - self.rows[-1] / 2)) ** 2)

    def grown(self, course: Course, at: Array) -> Array:
        """At some sessions about their mean, shape (sessions, d)."""
        every = np.concatenate([np.zeros((1, self.rows.shape[1])), self.rows])
        found = scipy.interpolate.make_interp_spline(_SHARES, every, k=1)(course.grown(at))
        return np.asarray(found - found.mean(axis=0))


@dataclass(frozen=True)
class Fitted:
    """A set of causes, fitted.

    Attributes
    ----------
    terms : tuple of Term
    sizes : tuple of ndarray
        Of each at the last session, core units.
    covariance : tuple of ndarray
        Of the sizes of each, with what the state of the unit leaves open of its influence as a whole.
    score : float
        Minus twice the logarithm of the posterior over that of no cause.
    left : ndarray, shape (sessions, d)
        What is left of the rows about their mean.
    missed : ndarray, shape (d,)
        Variance that the model misses of the causes, over that of noise, summed over the sessions.
    nodes : mapping of int to AtLoad
        What the load makes of causes, by their numbers: of those that were solved there.
    """

    terms: tuple[Term, ...]
    sizes: tuple[Array, ...]
    covariance: tuple[Array, ...]
    score: float
    left: Array
    missed: Array
    nodes: Mapping[int, AtLoad] = field(default_factory=dict)


@dataclass(frozen=True)
class GrowthSearch:
    """Sets of causes by their posterior.

    Attributes
    ----------
    unit : UnitState
    """

    unit: UnitState

    @cached_property
    def mounted(self) -> tuple[Array, Array]:
        """Directions in which a mounting of the bench is read, (d, m), and their variance over sessions, over noise.

        It may be any where sessions are too few to tell it.
        """
        reads = np.array([source(e.key).acts == "reading" for e in self.unit.parts.effects])
        columns = self.unit.history.whitening @ self.unit.influences[0][:, reads[self.unit.parts.effect]]
        basis, size, _ = np.linalg.svd(columns, full_matrices=False)
        basis = basis[:, size > size.max(initial=0.0) * 1e-6]
        if len(self.at) < FEW:
            return basis, np.full(basis.shape[1], _ANY)
        return basis, np.maximum(repeated(self.unit.history.values @ basis, self.at) - 1.0, 0.0)

    # --- what may change ----------------------------------------------------------------------------------------------

    @cached_property
    def causes(self) -> tuple[ShiftSource, ...]:
        """Every part by itself, and parts of a kind that change alike; each parameter, and all of them."""
        influence = self.unit.history.whitening @ self.unit.influences.mean(axis=0)
        found: dict[tuple[object, ...], ShiftSource] = {}
        parts = self.unit.parts
        for one in (*single_parts(influence, parts), *candidates_of(influence, parts)):
            found.setdefault((one.key, tuple(sorted(one.indices.items())), one.parameters), one)
        return tuple(found.values())

    @cached_property
    def at(self) -> Array:
        """Times of the sessions."""
        return self.unit.history.at

    @cached_property
    def courses(self) -> tuple[Course, ...]:
        """Courses that are tried."""
        return courses_of(self.at)

    @cached_property
    def places(self) -> tuple[Integers, ...]:
        """Columns of each cause."""
        ends = np.cumsum([len(one.parameters) for one in self.causes])
        return tuple(np.arange(end - len(one.parameters), end) for one, end in zip(self.causes, ends, strict=True))

    @cached_property
    def components(self) -> Array:
        """What one of each size of each cause is of all components, shape (components, columns)."""
        parts = self.unit.parts
        columns = [parts.shifted(c.key, c.indices, {name: 1.0}) for c in self.causes for name in c.parameters]
        return np.array(columns).T

    @cached_property
    def columns(self) -> Array:
        """Rows that one of each size of each cause makes, in the mean of the states, weighted, shape (d, columns)."""
        return np.asarray(self._in_states.mean(axis=0))

    @cached_property
    def missing(self) -> Array:
        """Variance of `columns`: what is not known of the unit, shape (d, columns)."""
        return known_to(self._in_states)

    @cached_property
    def _in_states(self) -> Array:
        made = self.unit.history.whitening @ (self.unit.influences @ self.components)
        return np.stack([self.weighted(one.T).T for one in made])

    @cached_property
    def prior(self) -> Array:
        """Standard deviation of each column's size, core units: a third of the largest that surprises no one."""
        return np.concatenate([one.plausible for one in self.causes]) / 3

    @cached_property
    def least(self) -> Array:
        """Least size of each column, core units: play that lessens where there is none is no cause."""
        parts, own = self.unit.parts, self.components > 0
        least = (parts.least - self.unit.values)[:, None]
        return np.asarray(np.where(own, least, -math.inf).max(axis=0)) - 1e-12

    @cached_property
    def start(self) -> Array:
        """Rows of the sessions about their mean, weighted, shape (sessions, d)."""
        return self.weighted(self.unit.history.values - self.unit.history.values.mean(axis=0))

    def weighted(self, rows: Array) -> Array:
        """Rows times a root of the inverse covariance of a session, shape (..., d)."""
        basis, variance = self.mounted
        return np.asarray(rows - (rows @ basis) * (1 - 1 / np.sqrt(1 + variance)) @ basis.T)

    # --- the search ---------------------------------------------------------------------------------------------------

    def found(self) -> Fitted:
        """The most probable set of causes, grown one by one, each judged again beside the others."""
        best = self.fitted(())
        while len(best.terms) < _MOST:
            more = self.best(best)
            if more is None or best.score - more.score < self.needed(best, more, len(best.terms)):
                break
            best = self._settled(more)
        return best

    def needed(self, others: Fitted, now: Fitted, number: int) -> float:
        """By how much a cause of a set must lower the score of the others: the more the more these do in its orders."""
        power = np.zeros(self.start.shape[1])
        for term, sizes in zip(others.terms, others.sizes, strict=True):
            grown = term.course.centred(self.at)
            power += (self.columns[:, self.places[term.cause]] @ sizes) ** 2 * float(grown @ grown)
        own = (self.columns[:, self.places[now.terms[number].cause]] @ now.sizes[number]) ** 2
        return EVIDENCE + _BESIDE * float(np.sqrt(power * own / own.sum()).sum()) ** 2

    def _settled(self, now: Fitted) -> Fitted:
        """Each cause exchanged for the best in its place, until none is better; what is then needless goes."""
        for _ in range(2):
            for number in range(len(now.terms)):
                others = self.fitted(now.terms[:number] + now.terms[number + 1 :], now)
                if others.score - now.score < self.needed(others, now, number):
                    now = others
                    break
                other = self.best(others) if others.terms else None
                if other is not None and other.score < now.score - 1.0:  # less is no matter of the data
                    now = other
                    break
            else:
                return now
        return now

    def best(self, beside: Fitted) -> Fitted | None:
        """The set with the one cause more that makes it most probable."""
        scores, course = self._promises(beside)
        if beside.score - scores.min() < EVIDENCE / 2:  # the load gives no cause that the first order does not
            return None
        taken = {term.cause for term in beside.terms}
        near = [int(c) for c in np.argsort(scores) if c not in taken and math.isfinite(scores[c])][:_TRIED]
        rough = [self.fitted((*beside.terms, Term(c, self.courses[course[c]])), beside, at_load=False) for c in near]
        rough.sort(key=lambda one: one.score)
        single = [one for one in rough[_SOLVED:] if self._width(one) == 1]
        solved = [self.fitted(one.terms, beside) for one in (*rough[:_SOLVED], *single[: _SOLVED // 2])]
        best = min((one.score for one in solved), default=math.inf)
        if not math.isfinite(best):
            return None
        # of what the model does not tell apart the one of fewest sizes: more of them fit what the model misses
        alike = [one for one in solved if one.score <= best + _ALIKE * max(beside.score - best, 0.0)]
        return self._finest(min(alike, key=lambda one: (self._width(one), one.score)))

    def _width(self, now: Fitted) -> int:
        """Number of sizes of the last cause."""
        return len(self.places[now.terms[-1].cause])

    def _finest(self, now: Fitted) -> Fitted:
        """The last cause of a set with the best of all courses of its kind."""
        term = now.terms[-1]
        if term.course.kind == "step":
            return now
        around = [c for c in courses_of(self.at, fine=True) if c.kind == term.course.kind]
        best = min(self._over(now, len(now.terms) - 1, around), key=lambda one: one.score)
        other = self.fitted(best.terms, now)
        return other if other.score < now.score else now

    def _over(self, now: Fitted, number: int, courses: Sequence[Course]) -> list[Fitted]:
        """The set with other courses of one cause."""
        before, term, after = now.terms[:number], now.terms[number], now.terms[number + 1 :]
        sets = [(*before, replace(term, course=course), *after) for course in courses]
        return [self.fitted(terms, now, at_load=False) for terms in sets]

    def _promises(self, beside: Fitted) -> tuple[Array, Integers]:
        """Score of each cause beside a set by a linear step, and the course with which it has it."""
        scale = 1 / np.sqrt(1 + beside.missed)
        columns, left = self.columns * scale[:, None], beside.left * scale
        gram, products = columns.T @ columns, columns.T @ left.T
        known = [self.places[t.cause] for t in beside.terms]
        at = np.concatenate(known) if known else np.empty(0, np.intp)
        grown = [t.course.centred(self.at) for t, p in zip(beside.terms, known, strict=True) for _ in p]
        waves = np.array(grown).reshape(len(grown), len(self.at))
        inverse = np.linalg.inv((waves @ waves.T) * gram[np.ix_(at, at)] + np.diag(1 / self.prior[at] ** 2))
        widths = np.array([len(p) for p in self.places])
        found = np.full((len(self.courses), len(self.causes)), math.inf)
        for number, course in enumerate(self.courses):
            wave = course.centred(self.at)
            right, cross = products @ wave, (waves @ wave)[:, None] * gram[at]
            for width in np.unique(widths):
                chosen = np.flatnonzero(widths == width)
                some = np.array([self.places[c] for c in chosen])
                shared = cross[:, some]
                own = float(wave @ wave) * gram[some[:, :, None], some[:, None, :]]
                own -= np.einsum("knp,kl,lnq->npq", shared, inverse, shared, optimize=True)
                gain = _evidence(own, right[some], self.prior[some])
                if width == 1:  # what would have to be less than nothing
                    single = some[:, 0]
                    gain[(right[single] < 0) & (self.least[single] > -_NONE * self.prior[single])] = -math.inf
                found[number, chosen] = course.cost + 2 * math.log(len(self.causes)) - gain
        return beside.score + found.min(axis=0), found.argmin(axis=0)

    def fitted(self, terms: Sequence[Term], near: Fitted | None = None, *, at_load: bool = True) -> Fitted:
        """Sizes of a set of causes with its score.

        Parameters
        ----------
        terms : sequence of Term
        near : Fitted, optional
            A set that has some of the causes: what the load makes of them is taken from there, where sizes are near.
        at_load : bool
            Whether the other causes are solved at the load, else to the first order.

        Returns
        -------
        Fitted
        """
        chosen, d = tuple(terms), self.start.shape[1]
        if not chosen:
            return Fitted((), (), (), 0.0, self.start, np.zeros(d))
        at = np.concatenate([self.places[t.cause] for t in chosen])
        of = np.concatenate([np.full(len(self.places[t.cause]), n) for n, t in enumerate(chosen)])
        waves = np.array([t.course.centred(self.at) for t in chosen])
        ends = np.cumsum(np.bincount(of))[:-1]
        columns, prior, sizes, extra = self.columns[:, at], self.prior[at], np.zeros(len(at)), np.zeros_like(self.start)
        bends = np.array([t.course.bend(self.at) for t in chosen])
        both = np.concatenate([waves, bends[np.abs(bends).max(axis=1) > _NONE]])
        way, _ = np.linalg.qr(both.T)  # of the sessions' contrasts those that the causes reach
        reach, bent_reach = way.T @ waves.T, way.T @ bends.T
        made = np.einsum("wk,dk->wdk", reach[:, of], columns)
        nodes = {} if near is None else dict(near.nodes)
        variance = np.ones((way.shape[1], d))
        for _ in range(_REFITS):
            weighted = made / variance[:, :, None]
            normal = np.einsum("wdk,wdl->kl", weighted, made, optimize=True)
            covariance = np.linalg.inv(normal + np.diag(1 / prior**2))
            moved = covariance @ np.einsum("wdk,wd->k", weighted, way.T @ (self.start - extra)) - sizes
            sizes = sizes + moved
            parts = np.split(sizes, ends)
            if np.any(sizes < self.least[at]):
                return Fitted(chosen, (), (), math.inf, self.start, np.zeros(d))
            extra = np.zeros_like(self.start)
            for term, some in zip(chosen, parts, strict=True):
                known = nodes.get(term.cause)
                if at_load and (known is None or not known.near(some)):
                    known = self._at_load(term, some)
                    if known is None:  # no unit holds such errors
                        return Fitted(chosen, (), (), math.inf, self.start, np.zeros(d))
                    nodes[term.cause] = known
                if known is not None:
                    extra += known.grown(term.course, self.at)
            left = self.start - extra - np.einsum("nk,dk->nd", waves.T[:, of] * sizes, columns)
            missed = (self.missing[:, at] * sizes**2 @ (of[:, None] == np.arange(len(chosen)))).T
            bent = missed / 4 + np.array([nodes[t.cause].bent if t.cause in nodes else np.zeros(d) for t in chosen])
            shares = _shares(missed, bent, reach, bent_reach, way.T @ left)[:, None]
            missed, bent = shares * missed, shares * bent
            variance = 1 + reach**2 @ missed + bent_reach**2 @ bent
            if np.all(np.abs(moved) < _MOVED * np.sqrt(np.diag(covariance))):
                break
        reached = way.T @ left
        gain = float(np.sum((way.T @ self.start) ** 2) - np.sum(reached**2 / variance) - np.sum(np.log(variance)))
        gain -= float(np.sum((sizes / prior) ** 2))
        gain -= float(np.linalg.slogdet(normal * prior * prior[:, None] + np.eye(len(at)))[1])
        cost = sum(t.course.cost + 2 * math.log(len(self.causes)) for t in chosen)
        open_size = [_RELATIVE**2 * np.outer(some, some) for some in parts]
        blocks = tuple(covariance[np.ix_(of == n, of == n)] + more for n, more in enumerate(open_size))
        total = (waves**2).sum(axis=1) @ missed + (bends**2).sum(axis=1) @ bent
        kept = {t.cause: nodes[t.cause] for t in chosen if t.cause in nodes}
        return Fitted(chosen, tuple(parts), blocks, cost - gain, left, total, kept)

    def _at_load(self, term: Term, sizes: Array) -> AtLoad | None:
        """What shares of a cause do at the load beyond the first order; None where a unit has no equilibrium."""
        change = self.spread(term.cause, sizes)
        try:
            found = self.unit.with_changes(_SHARES[1:, None] * change) - self.unit.amplitudes
        except InputError:
            return None
        beyond = found - _SHARES[1:, None] * (self.unit.influences[0] @ change)
        return AtLoad(sizes, self.weighted(beyond @ self.unit.history.whitening.T))

    def spread(self, cause: int, sizes: Array) -> Array:
        """Sizes of a cause as changes of all components, shape (components,)."""
        return np.asarray(self.components[:, self.places[cause]] @ sizes)

    # --- what is said of a set ----------------------------------------------------------------------------------------

    def rivals(self, now: Fitted, number: int, others: Fitted) -> list[Fitted]:
        """The set with other causes in place of one: no less likely than a hundredth, equivalent, or alike.

        The others are the set without the one.

        What sources declare to be told apart by the contacts alone is a rival as long as it explains half as much:
        which contacts carry is inferred, not known.  What does the same to the first order is one whatever its score:
        causes that only shift the output are a class, and what parts them is the model's error.
        """
        scores, course = self._promises(others)
        own, evidence = now.terms[number].cause, others.score - now.score
        within = RIVAL + _ALIKE * evidence
        near = [int(c) for c in np.argsort(scores) if scores[c] < scores[own] + 2 * within and c != own][: 2 * _TRIED]
        equivalent, alike = self._equivalents(own), self._alike(now, number)
        found = []
        for cause in dict.fromkeys((*near, *equivalent, *alike)):
            both = now.terms[number].course, self.courses[course[cause]]
            tried = [self.fitted((*others.terms, Term(cause, c)), others, at_load=False) for c in both]
            found.append(min(tried, key=lambda one: one.score))
        found.sort(key=lambda one: one.score)
        kept = []
        for at, one in enumerate(found):
            cause = one.terms[-1].cause
            if at < 3 * _SOLVED or cause in equivalent:  # others by the first order
                one = self.fitted(one.terms, others)
            most = math.inf if cause in alike else evidence / 2 if cause in equivalent else 0.0
            if one.score <= now.score + max(within, most):
                kept.append(one)
        return sorted(kept, key=lambda one: one.score)

    def _alike(self, now: Fitted, number: int) -> list[int]:
        """Other causes that do what one of a set does but for noise, by the angle between what they do."""
        term = now.terms[number]
        wave = term.course.centred(self.at)
        columns = self.columns * np.sqrt(wave @ wave / (1 + now.missed))[:, None]
        made, found = columns[:, self.places[term.cause]] @ now.sizes[number], []
        for cause, at in enumerate(self.places):
            some = columns[:, at]
            sizes = np.linalg.solve(some.T @ some + np.diag(1 / self.prior[at] ** 2), some.T @ made)
            left = float(made @ (made - some @ sizes))
            if cause != term.cause and left < RIVAL + _ALIKE * made @ made and np.all(sizes >= self.least[at]):
                found.append(cause)
        return found

    def _equivalents(self, cause: int) -> tuple[int, ...]:
        """Causes of the same source at places where it does what only the contacts tell from it."""
        one, unit = self.causes[cause], self.unit.simulator.model.mechanism
        known = {index.name: index.equivalents for index in source(one.key).indices}
        places = {name: {at, *(other for other, _ in known[name](unit, at))} for name, at in one.indices.items()}
        same = [n for n, other in enumerate(self.causes) if (other.key, other.parameters) == (one.key, one.parameters)]
        alike = [n for n in same if n != cause and self.causes[n].indices.keys() == places.keys()]
        return tuple(n for n in alike if all(at in places[name] for name, at in self.causes[n].indices.items()))

    def ways(self, now: Fitted, number: int) -> tuple[Array, list[Fitted]]:
        """Probabilities of the courses of a cause, of jumps or of growths, and the set's fit with each."""
        step = now.terms[number].course.kind == "step"
        found = self._over(now, number, [c for c in courses_of(self.at, fine=True) if (c.kind == "step") == step])
        scores = np.array([one.score for one in found])
        weights = np.exp(-0.5 * (scores - scores.min()))
        likely = np.flatnonzero(weights > 1e-4 * weights.sum())
        return weights[likely] / weights[likely].sum(), [found[at] for at in likely]


def _shares(missed: Array, bent: Array, reach: Array, bent_reach: Array, left: Array) -> Array:
    """Share of what each cause's influence may miss that makes what is left most probable.

    States drawn about the unit tell in which orders an influence is open, and how far only roughly.
    """
    found = np.ones(len(missed))
    for _ in range(1 + (len(missed) > 1)):
        for number in range(len(missed)):
            costs = []
            for share in _OPEN:
                found[number] = share
                variance = 1 + reach**2 @ (found[:, None] * missed) + bent_reach**2 @ (found[:, None] * bent)
                costs.append(float(np.sum(left**2 / variance + np.log(variance))))
            found[number] = _OPEN[int(np.argmin(costs))]
    return found


def _evidence(own: Array, right: Array, prior: Array) -> Array:
    """Twice the log of the evidence over none, of normal sizes, shape (n,)."""
    scaled = own * prior[:, :, None] * prior[:, None, :] + np.eye(own.shape[1])
    pressed = right * prior
    gain = np.einsum("np,np->n", pressed, np.linalg.solve(scaled, pressed[:, :, None])[:, :, 0])
    return np.asarray(gain - np.linalg.slogdet(scaled)[1])
