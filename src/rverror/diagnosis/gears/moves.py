"""Moves from a set of causes: one more, others in its place, the same elsewhere.

Page ``theory/search.md``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from operator import add
from typing import TypeVar

import numpy as np

from rverror.base.arrays import Array
from rverror.base.threads import each
from rverror.diagnosis.causes import Named, caused, identity, named
from rverror.diagnosis.gears.contact_gaps import ContactGaps
from rverror.diagnosis.gears.fit import Fit, RunSet, as_compared, as_declared, evaluated, onto, without_effect
from rverror.diagnosis.gears.ranking import Columns, Offer, columns_of, pairs, singles
from rverror.diagnosis.gears.score import Hypothesis, Score
from rverror.diagnosis.gears.trial import Trial
from rverror.diagnosis.gears.waveform import Waveform
from rverror.geartrain.mechanism import Mechanism
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.statics.loaded_state import each_solved

T = TypeVar("T")

_OFFERED = 30  # trials of each kind that a set offers
_STARTS = 512  # angles a turn on which starts are solved
_FEW_PLACES = 12  # of a source whose starts over a whole turn rival a cause: harmonics of two discs, not single pins
_NEARLY = 2.0  # times what noise hardly exceeds, up to which a set may only have a cause in a wrong place
_MOST_MOVES = 60  # sets of equivalent places: three causes, each in three others, are 63


def with_offer(model: Model, offer: Offer) -> Model:
    """The model with candidates at the sizes of an offer, none far beyond what a workshop makes."""
    effects = []
    for name, sizes in zip(offer.names, offer.sizes, strict=True):
        most = np.array([0.7 * p.plausible for p in source(name[0]).parameters])
        effects.append(caused(name, sizes / max(1.0, float((np.abs(sizes) / most).max()))))
    return model.with_effects(*effects)


def equivalents(effect: Effect, unit: Mechanism) -> list[Effect]:
    """The same sizes, or the opposite, where contacts alone tell them from these."""
    entry, found = source(effect.key), []
    if entry.starts and all(p.least < 0 for p in entry.parameters):
        found.append(replace(effect, values=tuple(-v for v in effect.values)))
    at = [(index, effect.indices[index.name]) for index in entry.indices]
    choices = [[(value, 1.0), *index.equivalents(unit, value)] for index, value in at]
    for combined in list(product(*choices))[1:]:
        indices = {index.name: value for index, (value, _) in zip(entry.indices, combined, strict=True)}
        sign = math.prod(s for _, s in combined)
        found.append(replace(effect, indices=indices, values=tuple(sign * v for v in effect.values)))
    return list({(named(other), other.values): other for other in found}.values())


def started(name: Named) -> list[Effect]:
    """A candidate at each of its starts."""
    plausible = [p.plausible for p in source(name[0]).parameters]
    return [caused(name, np.multiply(start, plausible)) for start in source(name[0]).starts]


class Once:
    """What is made of an object, once; it is kept, so that its identity stays its own.  Of a fit that is its Gram
    matrix, which it has without its rows too."""

    def __init__(self) -> None:
        """Nothing is made yet."""
        self._made = dict[object, tuple[object, object]]()

    def __call__(self, what: object, about: object, make: Callable[[], T]) -> T:
        """What was made, or is."""
        about = about.gram if isinstance(about, Fit) else about
        name = what, id(about)
        if name not in self._made:
            self._made[name] = about, make()
        return self._made[name][1]  # type: ignore[return-value]


class Starts:
    """What the declared model does at each start of its candidates, solved once, wherever the marks are.

    Parameters
    ----------
    declared : Model

    Attributes
    ----------
    solved : int
        How many had to be solved.
    """

    def __init__(self, declared: Model) -> None:
        """Nothing is solved yet."""
        self.declared, self.solved = declared, 0
        self._plain: dict[object, list[Waveform]] = {}
        self._made: dict[object, list[Waveform] | None] = {}

    def of(self, run_set: RunSet, names: Sequence[Named]) -> tuple[list[Waveform], list[tuple[Effect, list[Waveform]]]]:
        """Waveforms of what is declared, and those with each start of which there is an equilibrium."""
        where = tuple((c.direction, c.torque, None if c.turn.closed else c.turn) for c in run_set.conditions)
        effects = [effect for name in names for effect in started(name)]
        starts: dict[object, Effect] = {(where, named(effect), effect.values): effect for effect in effects}
        new = [name for name in starts if name not in self._made]
        base = run_set.solve(self.declared) if new or where not in self._plain else []
        plain = self._plain.setdefault(where, [wave.bare for wave in base])

        def solve(name: object) -> tuple[object, list[Waveform]]:
            return name, [wave.bare for wave in run_set.solve(self.declared.with_effects(starts[name]), base)]

        self._made |= dict.fromkeys(new) | dict(each_solved(solve, new))
        self.solved += len(new)
        return plain, [(effect, waves) for name, effect in starts.items() if (waves := self._made[name])]


def marked(model: Model, offset: float) -> Model:
    """The model with its marks at an offset."""
    effects = tuple(replace(e, values=(offset,)) if source(e.key).acts == "marks" else e for e in model.effects)
    return replace(model, effects=effects)


def turned_to(fit: Fit, offset: float) -> Fit:
    """The same sizes with the marks at an offset."""
    return evaluated(fit.run_set, marked(fit.model, offset), fit.declared, fit.waves)


def _enlarged(model: Model, by: Effect) -> Model:
    """The model with one of its effects larger by sizes of its own kind."""
    effects = [
        replace(e, values=tuple(map(add, e.values, by.values))) if named(e) == named(by) else e for e in model.effects
    ]
    return replace(model, effects=tuple(effects))


class Moves:
    """What sets of causes offer: trials of sets that differ from them.

    Parameters
    ----------
    root : Hypothesis
        What is declared.
    candidates : sequence of Named
    score : Score
    offsets : sequence of float
        Where the gear's marks may be, where that is not known, the likeliest first, rad.
    starts : Starts
    """

    def __init__(
        self, root: Hypothesis, candidates: Sequence[Named], score: Score, offsets: Sequence[float], starts: Starts
    ) -> None:
        """Nothing is offered yet."""
        self.root, self.candidates, self.score = root, tuple(candidates), score
        self.offsets, self.starts = tuple(offsets), starts
        self._leading: list[Offer] = []
        self._last = dict[bool, tuple[Array, tuple[Fit, list[Columns]]]]()
        self._once = Once()

    def anew(self, root: Hypothesis) -> Moves:
        """Moves under other noise; starts that were solved are solved, and what leads beside what is declared leads."""
        other = Moves(root, self.candidates, self.score, self.offsets, self.starts)
        other._leading = self._leading
        return other

    # --- one cause more, or two ---------------------------------------------------------------------------------------

    def one_more(self, one: Hypothesis) -> Iterator[Trial]:
        """One cause more, by linear steps and from starts.

        Linear steps begin at the sizes as declared, since fitted ones have moved to make up for what is missing; of a
        set that nearly fits at the fitted ones as well.
        """
        (plain, linear), cost = self.influences(one, declared=True), self.score.cost
        offers = singles(plain, linear, cost)
        if not one.names:
            self._leading = offers
        yield from self._offered(one, plain.model, offers)
        if self.nearly(one):
            coarse, blocks = self.influences(one)
            yield from self._offered(one, coarse.model, singles(coarse, blocks, cost))
        yield from self._from_starts(one, self.starting(with_crank=True))
        if not one.fit.added:
            yield from self._at_other_marks(one, plain, self.blocks)

    def two_more(self, one: Hypothesis) -> Iterator[Trial]:
        """Two causes more at once."""
        if self._room(one) > 1:
            plain, linear = self.influences(one, declared=True)
            both = linear + self._starts(plain, self.starting(with_crank=True))
            yield from self._offered(one, plain.model, pairs(plain, both, self.score.cost, most=_OFFERED))

    def single_place_sources(self, one: Hypothesis) -> Iterator[Trial]:
        """A source of one place beside a set, at all its starts: what it does hangs on the bearings' loads, and so on
        the other causes."""
        if one.fit.added and self._room(one):
            fit = one.coarse
            yield from (Trial(fit.model.with_effects(e), one.score, one.without_rows) for e in self._single_places(fit))

    def from_all_starts(self, one: Hypothesis) -> Iterator[Trial]:
        """One cause more, or two, from all starts."""
        yield from self._from_starts(one, self.starting(), in_pairs=True)

    def _from_starts(self, one: Hypothesis, names: tuple[Named, ...], *, in_pairs: bool = False) -> Iterator[Trial]:
        """One cause more, or two, of which one at least begins at a start of some candidates."""
        if not names:
            return
        (plain, linear), cost = self.influences(one, declared=True), self.score.cost
        starts = self._starts(plain, names)
        yield from self._offered(one, plain.model, singles(plain, starts, cost))
        if in_pairs and self._room(one) > 1:
            both = pairs(plain, linear + starts, cost, most=_OFFERED)
            yield from self._offered(one, plain.model, both)
        if not one.fit.added:
            yield from self._at_other_marks(one, plain, partial(self._starts, names=names))

    def _at_other_marks(self, one: Hypothesis, fit: Fit, blocks: Callable[[Fit], list[Columns]]) -> Iterator[Trial]:
        """Single causes with the marks elsewhere: what is missing decides where they are too."""

        def at(offset: float) -> list[Trial]:
            state = turned_to(fit, offset)
            offers = singles(state, blocks(state), self.score.cost)[:2]
            away = state.objective - fit.objective
            return [replace(t, score=t.score + away) for t in self._offered(one, state.model, offers)]

        found = [trial for trials in each(at, self._angles) for trial in trials]
        yield from sorted(found, key=lambda trial: trial.score)[:_OFFERED]

    # --- others in place of what is there -----------------------------------------------------------------------------

    def other_places(self, one: Hypothesis) -> Iterator[Trial]:
        """A set with its causes in equivalent places, begun anew from their starts, or with the marks elsewhere."""
        fit = as_declared(one.coarse)
        declared, added, unit = fit.model.effects[: len(fit.declared.effects)], fit.added, fit.run_set.unit
        free = {identity(name) for name in self.free(fit)} | {named(e) for e in added}
        places = [[e, *(p for p in equivalents(e, unit) if named(p) in free)] for e in added]
        sets = list(product(*places))
        sets.sort(key=lambda s: sum(a is not b for a, b in zip(s, added, strict=True)))
        sets = sets[1 : 1 + _MOST_MOVES]
        for at, own in enumerate(places):
            there = {named(place): (place.key, place.indices) for place in own}  # either sign begins alike
            sets += [(*added[:at], e, *added[at + 1 :]) for place in there.values() for e in started(place)]
        sets = [one_set for one_set in sets if len(set(map(named, one_set))) == len(one_set)]
        models = [replace(fit.model, effects=(*declared, *one_set)) for one_set in sets]
        models += [marked(fit.model, offset) for offset in self._angles]
        yield from (Trial(model, one.score, one.without_rows) for model in models)

    def other_marks(self, one: Hypothesis) -> Iterator[Trial]:
        """A set with the marks elsewhere, where they are not known, and one of its causes in an equivalent place."""
        fit = one.coarse
        free = {identity(name) for name in self.free(fit)}
        models = [fit.model] + [
            fit.model_with(other, instead_of=at)
            for at, effect in enumerate(fit.added)
            for other in equivalents(effect, fit.run_set.unit)
            if named(other) in free
        ]
        yield from (Trial(marked(m, offset), one.score, one.without_rows) for offset in self._angles for m in models)

    def masked(self, one: Hypothesis) -> Iterator[Trial]:
        """One cause more that sizes and stiffness hide, which have moved to make up for it: seen from where they were
        declared, and from where they are."""
        if self._room(one):
            (fit, blocks), (plain, linear) = self.influences(one), self.influences(one, declared=True)
            starts = self._starts(plain, self.starting(with_crank=True))
            for state, some in ((fit, blocks), (plain, linear), (plain, starts)):
                offers = [o for o in singles(state, some, self.score.cost) if o.score < o.without]
                yield from self._offered(one, state.model, offers)

    def same_gaps(self, one: Hypothesis) -> Iterator[Trial]:
        """Others in the place of each cause: such as close the same gaps or half of them, and equivalent places."""
        fit, _ = self.influences(one)
        unit, free = fit.run_set.unit, self.free(fit)
        gaps = self._once("gaps", self.candidates, lambda: ContactGaps(fit.run_set.gears))
        for number, effect in enumerate(fit.added):
            rest = without_effect(fit, number)
            able = {identity(other) for other in free} | {named(effect)}
            others = [e for e in equivalents(effect, unit) if named(e) in able]
            for other in (*gaps.equivalents(effect, free), *gaps.near(effect, free), *others):
                yield Trial(rest.model.with_effects(other), one.score, one.without_rows)
            # another cause of the set may be all of it, with the sizes of both
            for other in gaps.near(effect, [(e.key, e.indices) for e in rest.added]):
                yield Trial(_enlarged(rest.model, other), one.score, one.without_rows)

    def swaps(self, one: Hypothesis) -> Iterator[Trial]:
        """Others in the place of each cause by linear steps, and starts of what repeats with the crank as the cause
        does, or does not."""
        fit, blocks = self.influences(one)
        for number, effect in enumerate(fit.added):
            with_crank = source(effect.key).repeats_with_crank(fit.run_set.unit, effect.indices)
            from_starts = self._starts(fit, self.starting(with_crank=with_crank))
            yield from self._in_place_of(one, fit, number, (blocks, from_starts), most=_OFFERED)

    def exchanges(self, one: Hypothesis) -> Iterator[Trial]:
        """Another cause in the place of each, the first by linear steps and starts from the fitted sizes of the others.

        Where two of three causes are right, their sizes are nearly so, and the step that replaces the third says more
        than one that adds a cause to the two: the declared sizes have not moved to make up for it.  How much better it
        is than the step of the cause that is there it does not say, so each place has as many trials.
        """
        fit, blocks = self.influences(one)
        starts = self._starts(fit, self.starting(with_crank=True))
        for number in range(len(fit.added)):
            yield from self._in_place_of(one, fit, number, (blocks, starts), most=_OFFERED // len(fit.added))

    def _in_place_of(
        self, one: Hypothesis, fit: Fit, number: int, kinds: Sequence[Sequence[Columns]], *, most: int
    ) -> Iterator[Trial]:
        """Others in the place of a cause by linear steps, so many of each kind of columns: beside what it promises
        itself by the same step, or has where that leads to sizes which cannot be."""
        name, cost = (fit.added[number].key, fit.added[number].indices), self.score.cost
        rest, own = without_effect(fit, number), columns_of(fit, [name])
        for blocks in kinds:
            offers = singles(rest, [*blocks, *own], cost)
            mine = next((o.score for o in offers if o.names[0] == name), fit.objective + cost(name))
            yield from self._offered(one, rest.model, [o for o in offers if o.names[0] != name], mine)[:most]

    def single_place_alone(self, one: Hypothesis) -> Iterator[Trial]:
        """A source of one place from all its starts, in the place of a cause of its frame, and of two causes or more.

        Its wave grows with the square of its size, so no linear step tells that it may stand for them.
        """
        fit = one.coarse
        for number, effect in enumerate(fit.added):
            rest = fit.model_with(instead_of=number)
            for start in self._single_places(fit):
                if source(start.key).frame == source(effect.key).frame:
                    yield Trial(rest.with_effects(start), one.score, one.without_rows)
        if len(fit.added) > 1:
            root = self.root.coarse
            for start in self._single_places(root):
                yield Trial(root.model.with_effects(start), one.score, self.root)

    # --- what offers are made of --------------------------------------------------------------------------------------

    def _offered(
        self, one: Hypothesis, model: Model, offers: Sequence[Offer], mine: float | None = None
    ) -> list[Trial]:
        """Trials of the best offers beside a set, by what they promise to be better than what is there without them, or
        than a score of its own by the same step."""
        best = offers[:_OFFERED]
        scores = [as_compared(one.score + o.score - (o.without if mine is None else mine)) for o in best]
        both = zip(best, scores, strict=True)
        return [Trial(with_offer(model, offer), score, one.without_rows) for offer, score in both]

    @staticmethod
    def nearly(one: Hypothesis) -> bool:
        """Tell whether a set fits so well that it may only have a cause in a wrong place."""
        return one.fit.data <= _NEARLY * one.fit.bound

    def mostly(self, one: Hypothesis) -> bool:
        """Tell whether a set nearly fits, or leaves half of what the declared model does at most: that much a cause
        takes off in the place of its neighbour."""
        return self.nearly(one) or one.fit.data <= self.root.fit.data / 2

    @property
    def _angles(self) -> tuple[float, ...]:
        """Where the marks are tried."""
        return self.offsets[: self.score.policy.offsets]

    def _room(self, one: Hypothesis) -> int:
        return self.score.policy.most_effects - len(one.fit.added)

    def influences(self, one: Hypothesis, *, declared: bool = False) -> tuple[Fit, list[Columns]]:
        """A set on few angles, or with all declared sizes as declared, and every candidate's influence there.

        Kept until they are made of another: influences are large.
        """
        kept = self._last.get(declared)
        if kept is None or kept[0] is not one.fit.gram:
            fit = onto(one.fit.run_set.coarse, one.fit)
            fit = as_declared(fit) if declared else fit
            kept = self._last[declared] = one.fit.gram, (fit, self.blocks(fit))
        return kept[1]

    def free(self, fit: Fit) -> list[Named]:
        """Candidates that a model does not have; of what is linear a declared size that was measured wrong too."""
        taken = {named(e) for e in (fit.added if fit.run_set.linear else fit.model.effects)}
        return [c for c in self.candidates if identity(c) not in taken]

    def blocks(self, fit: Fit) -> list[Columns]:
        """The influence of every candidate at a state."""
        return columns_of(fit, self.free(fit))

    @property
    def leading(self) -> list[Offer]:
        """Candidates beside what is declared by a linear step, the best first."""
        if not self._leading:
            self._leading = singles(*self.influences(self.root, declared=True), self.score.cost)
        return self._leading

    def starting(self, *, with_crank: bool | None = None) -> tuple[Named, ...]:
        """Candidates with starts: all, or those that repeat with the crank, or of the others those of few places."""
        unit, places = self.root.fit.run_set.unit, self.score.places
        some = [(source(key), key, indices) for key, indices in self.candidates if source(key).starts]
        return tuple(
            (key, indices)
            for entry, key, indices in some
            if with_crank is None
            or (entry.repeats_with_crank(unit, indices) == with_crank and (with_crank or places[key] <= _FEW_PLACES))
        )

    def _single_places(self, fit: Fit) -> list[Effect]:
        """Candidates of sources with one place, at each of their starts."""
        return [effect for name in self.free(fit) if not name[1] for effect in started(name)]

    def _starts(self, fit: Fit, names: tuple[Named, ...]) -> list[Columns]:
        """The change that each start of some candidates makes beside what is declared, if a model has them not."""
        taken, run_set, offset = {named(e) for e in fit.model.effects}, fit.run_set, fit.model.index_offset
        which = tuple(map(identity, names))
        plain, made = self._once(
            ("starts", which), self.candidates, lambda: self.starts.of(run_set.coarser(_STARTS), names)
        )
        if not made:
            return []

        def seen(number: int) -> Array:
            """What the starts make as a record sees it, whitened."""
            observation, at = run_set.observations[number], run_set.which[number]
            every = (plain, *(waves for _, waves in made))
            rows = [observation.of_wave(waves[at], waves[at].error[None], offset) for waves in every]
            return observation.whiten(np.concatenate(rows[1:]) - rows[0])

        read = partial(run_set.of_each, seen)
        at_root = self.root.fit.model.index_offset == offset
        rows = self._once(("rows", which), run_set, read) if at_root else read()
        return [
            Columns((e.key, e.indices), np.array([e.values]), tuple(own[at][None] for own in rows), start=True)
            for at, (e, _) in enumerate(made)
            if named(e) not in taken
        ]
