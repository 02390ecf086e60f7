"""The search for what a model lacks: sets of causes, moves between them, and one score.

Page ``theory/search.md``.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from functools import partial, wraps
from itertools import product
from typing import Concatenate, ParamSpec, TypeVar

import numpy as np

from rverror.base.arrays import Array
from rverror.base.chance import chi_square
from rverror.base.text import describe
from rverror.base.threads import each
from rverror.diagnosis.gears.fit import Fit, RunSet, as_declared, evaluated, fitted, lifted, onto
from rverror.diagnosis.gears.late_faults import nearly_noise
from rverror.diagnosis.gears.moves import (
    Starts,
    Trial,
    distinct,
    equivalents,
    marked,
    started,
    with_offer,
)
from rverror.diagnosis.gears.ranking import Columns, Offer, columns_of, pairs, singles
from rverror.diagnosis.gears.record import Record
from rverror.diagnosis.gears.score import Hypothesis, Score, identity, inexact, named, outlook, strained
from rverror.diagnosis.gears.spectrum import best_lines, explained
from rverror.diagnosis.gears.twins import Gaps
from rverror.diagnosis.gears.waveform import Named, Waveform
from rverror.diagnosis.journal import Journal
from rverror.diagnosis.policy import Policy
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.statics.loaded_state import NotConvergedError

T = TypeVar("T")
P = ParamSpec("P")

_SOLVED = 20  # singles, and pairs, at the load: of 52 units the answers were the same with half as many again
_REFITTED = 3  # of these to their end
_DIRECT = 3  # that lead over every sample and are fitted there, where what is left is no more than noise
_CLOSE = 60.0  # objective within which fits on few angles are compared on all: few angles often cost some 50
_RIVALS = 16  # that are solved in the place of a cause; half of them are fitted to every sample
_COARSE = 1024  # angles a turn on which sets are raced: half of those of the fit
_STARTS = 512  # angles a turn at which starts are solved, to be ranked
_FEW_PLACES = 12  # of a source, whose starts are tried first: harmonics of two discs, not single pins or lobes
_NARROW, _WIDEST = 2, 8  # beam: up to which starts of few places are tried, in a race; and at most
_RACE = ((1, 3), (2, 2), (12, 1))  # steps of each round, and how many times those that end it are in it
_PATIENCE = 12  # steps of all before any is dropped
_PATIENT = 3  # starts of a source that are followed to their end, and causes beside each start
_NEARLY = 2  # times what noise hardly exceeds, up to which a set may only have a cause in a wrong place
_MOST_MOVES = 60  # sets of equivalent places: three causes, each on two discs or cranks with either sign, are 63


def _made_once(
    moves: Callable[Concatenate[Search, Hypothesis, P], list[Hypothesis]],
) -> Callable[Concatenate[Search, Hypothesis, P], list[Hypothesis]]:
    """Moves that are made once from every fit; the sets that they gave are kept without their rows."""

    @wraps(moves)
    def made(self: Search, one: Hypothesis, /, *args: P.args, **options: P.kwargs) -> list[Hypothesis]:
        name = moves.__name__, args, *options.items()
        return self._once(name, one.fit, lambda: [found.slim for found in moves(self, one, *args, **options)])

    return made


class Search:
    """Sets of causes that were looked at, under one estimate of the noise.

    Parameters
    ----------
    root : Fit
        Of what is declared.
    candidates : sequence of Named
    policy : Policy
    journal : Journal
    offsets : sequence of float
        Where the gear's marks may be, where that is not known, the likeliest first, rad.

    Attributes
    ----------
    root : Hypothesis
    known : dict
        The best fit of every set, by its names.
    spent : int
        Solutions of the equilibrium under all conditions.
    widest : int
        Of the beam.
    """

    widest = _WIDEST

    def __init__(
        self, root: Fit, candidates: Sequence[Named], policy: Policy, journal: Journal, offsets: Sequence[float] = ()
    ) -> None:
        """Begin with what is declared."""
        self.candidates, self.policy, self.journal, self.offsets = tuple(candidates), policy, journal, tuple(offsets)
        self.score = Score(candidates, policy)
        self.known: dict[frozenset[object], Hypothesis] = {}
        self.spent, self._width = 0, 1
        self._expanded = set[tuple[frozenset[object], bool]]()
        self._last: tuple[Array, tuple[Fit, Fit, list[Columns]]] | None = None
        self._made = dict[object, tuple[object, object]]()
        self.root, self.starts = self.score.of(root), Starts(root.declared)

    def anew(self, root: Fit) -> Search:
        """A search from what is declared under other noise, which knows no set yet."""
        other = self.__class__(root, self.candidates, self.policy, self.journal, self.offsets)
        other.spent, other.starts = self.spent, self.starts
        return other

    def _once(self, what: object, about: object, make: Callable[[], T]) -> T:
        """What is made of an object, once; it is kept, so that its identity stays its own.  Of a fit that is its Gram
        matrix, which it has without its rows too."""
        about = about.gram if isinstance(about, Fit) else about
        name = what, id(about)
        if name not in self._made:
            self._made[name] = about, make()
        return self._made[name][1]  # type: ignore[return-value]

    # --- the loop -----------------------------------------------------------------------------------------------------

    def best(self, *also: Hypothesis, swap: bool = True) -> tuple[Hypothesis, bool]:
        """Search from what is declared, and from other sets.

        Of the best sets of each size, as many as the beam is wide, the most promising is expanded.  Where all were,
        the beam doubles.

        Parameters
        ----------
        *also : Hypothesis
        swap : bool
            Whether a complete set must be better than those with another cause in one's place.

        Returns
        -------
        best : Hypothesis
            The most probable set, without what is needless in it.
        complete : bool
            Whether nothing is left beside it.
        """
        self.keep((self.root, *also))
        while self.spent <= self.policy.budget and self._width <= self.widest:
            best = self.pruned(self._leader)
            if self.complete(best):
                best = self._whole(best)
                if not swap:
                    return best, True
                leader = self._leader
                self.keep(rival for number in range(len(best.fit.added)) for rival in self.rivals(best, number))
                self.keep(self.replaced(best))
                self.keep(self.hidden(best))
                for part in self.parts(best):  # one that nearly fits may have ended in a false minimum
                    if part.fit.data <= _NEARLY * part.fit.bound:
                        self.keep(self.moved(part))
                # fits that have settled differ by less
                if self._leader.score > leader.score - 1 and self.pruned(best).names == best.names:
                    return best, True
                continue
            if nearly_noise(best.fit) and self.nothing_left(best):  # but for faults of the readings
                return self._whole(best), False
            beam = [one for one in self._beam() if not self._was_expanded(one, self._width)]
            if beam:
                # a wider beam begins at the bottom again: a wrong cause with a second beats the right one alone
                self.expand(
                    min(beam, key=lambda one: (len(one.fit.added) * (self._width > 1), outlook(one))), self._width
                )
            else:
                self._width *= 2
        best = self._whole(self.pruned(self._leader))
        return best, self.complete(best)

    @staticmethod
    def _whole(one: Hypothesis) -> Hypothesis:
        """A set with the rows of its fit."""
        return replace(one, fit=onto(one.fit.bench, one.fit))

    @property
    def _leader(self) -> Hypothesis:
        return min(self.known.values(), key=lambda one: one.score)

    def _beam(self) -> Iterable[Hypothesis]:
        """The best sets of each size."""
        for size in range(self.policy.most_effects + 1):
            alike = sorted((one for one in self.known.values() if len(one.fit.added) == size), key=outlook)
            yield from alike[: self._width]

    def _was_expanded(self, one: Hypothesis, width: int) -> bool:
        return (one.names, True) in self._expanded or (width <= _NARROW and (one.names, False) in self._expanded)

    def keep(self, found: Iterable[Hypothesis]) -> None:
        """Keep the best fit of each set."""
        for one in found:
            before = self.known.get(one.names)
            if before is None or one.score < before.score - 1:  # fits that have settled differ by less
                self.known[one.names] = one.slim

    def expand(self, one: Hypothesis, width: int) -> None:
        """Make all moves from a set, until one of them is complete."""
        self._expanded.add((one.names, width > _NARROW))
        leading = ", ".join(describe(e.key, e.indices) for e in self._leader.fit.added) or "what was declared"
        self.journal.tell(
            f"{self.spent} of {self.policy.budget} solutions, {len(self.known)} sets; the best: {leading}"
        )
        self.journal.round += 1
        if one.fit.data <= _NEARLY * one.fit.bound and not self.complete(one):
            self.keep(self.moved(one))
            one = self.known[one.names]
        one = self._whole(one)
        for moves in (self.added_linearly, self.regular, partial(self.added_from_starts, everywhere=width > _NARROW)):
            found = moves(one)
            self.keep(found)
            if self._ends(one, found):
                return

    def _ends(self, one: Hypothesis, found: Sequence[Hypothesis]) -> bool:
        """Tell whether one of the sets that were found beside another is complete and better."""
        better = [more for more in found if self.score.better(more, one, exact=True)]
        return any(self.complete(more) for more in sorted(better, key=lambda more: more.score))

    def parts(self, one: Hypothesis) -> list[Hypothesis]:
        """The best fits of a set without each of what it has."""
        found = self.dropped(one)
        self.keep(found)
        return [self.known[part.names] for part in found]

    def pruned(self, one: Hypothesis) -> Hypothesis:
        """A set without what others have made needless; one that is complete gives way to complete ones only.

        Of what is left beside a set that is not complete, the model's own error is no reason.
        """
        while True:
            needless = [
                part
                for part in self.parts(one)
                if not self.score.better(one, part, exact=self.complete(one) and not self.complete(part))
            ]
            if not needless:
                return one
            one = min(needless, key=lambda part: part.score)

    # --- complete -----------------------------------------------------------------------------------------------------

    def complete(self, one: Hypothesis) -> bool:
        """Tell whether nothing is left but noise, and nothing declared is strained to make up for what is missing."""
        return one.fit.data <= one.fit.bound and self.nothing_left(one)

    def nothing_left(self, one: Hypothesis) -> bool:
        """Tell whether no candidate or line is missing, whatever the squares."""
        return self._once("nothing left", one.fit, lambda: self._nothing_left(one))

    def _nothing_left(self, one: Hypothesis) -> bool:
        one = self._whole(one)
        fit = one.fit
        if strained(fit) or self._line_left(fit) or self._settles(one):
            return False
        enough = fit.objective - inexact(fit)
        near = [offer for offer in self.leading(fit)[:_DIRECT] if offer.score < fit.objective]
        if any(offer.score < enough - self.score.sure for offer in near):
            return False
        # a linear step promises too little where sizes have moved to make up for a cause
        return not any(self.score.better(more, one) for more in self._fitted_with(one, near))

    def _line_left(self, fit: Fit) -> bool:
        """Tell whether a line is left that noise hardly ever makes; what it makes in one of a thousand runs is told."""
        chance = math.erfc(self.policy.by_chance / math.sqrt(2)) / 2
        return fit.bench.sampled and bool(best_lines(fit, replace(self.policy, false_alarm=chance), outside=False))

    def _settles(self, one: Hypothesis) -> bool:
        """Tell whether drift or settling is left of runs that are long enough to tell it from an encoder's error."""
        records = one.fit.bench.records
        if one.slow or not one.fit.bench.settles:
            return False
        slow = [r.settling for r in records]
        return (
            explained(records, one.fit.residual, slow)[0] > self.score.regular(one.fit, (), slow=True) + self.score.sure
        )

    # --- moves: what is added -----------------------------------------------------------------------------------------

    def regular(self, one: Hypothesis) -> list[Hypothesis]:
        """A set with what is regular and no part's: the strongest free line, or runs that drift and settle."""
        found, records = list[Hypothesis](), one.fit.bench.records
        if not one.fit.bench.sampled:  # a table names all its lines
            return found
        if self._settles(one):
            found.append(self._with_records(one, [replace(r, slow=True) for r in records], one.lines, slow=True))
        for line in best_lines(one.fit, self.policy, outside=True)[:1]:
            lined = [replace(r, orders=(*r.orders, line.order)) for r in records]
            found.append(self._with_records(one, lined, (*one.lines, line.order), slow=one.slow))
        return found

    def _with_records(
        self, one: Hypothesis, records: Sequence[Record], lines: Sequence[float], *, slow: bool
    ) -> Hypothesis:
        return self.score.of(fitted(onto(one.fit.bench.with_records(records), one.fit)), lines, slow)

    def added_linearly(self, one: Hypothesis) -> list[Hypothesis]:
        """A set with one cause more, or two at once, that linear steps propose.

        They are made from the sizes as declared: fitted ones have moved to make up for what is missing.  Where a set
        fits, and hides what is missing by that, steps are also made from the fitted sizes, and with all others held.
        """
        room = self.policy.most_effects - len(one.fit.added)
        if room < 1:
            return []
        found: list[Hypothesis] = []
        fits = one.fit.data <= one.fit.bound
        if fits:  # few angles are too few
            found = self._fitted_with(one, self.leading(one.fit)[:_DIRECT])
            if self._ends(one, found):
                return found
        fit, plain, linear = self._beside(one)
        cost, most = self.score.cost, _SOLVED
        offers = [(plain.model, offer) for offer in singles(plain, linear, cost)[:most]]
        if fits:
            offers += [(plain.model, offer) for offer in singles(fit, self.blocks(fit), cost)[: most // 2]]
            offers += [(plain.model, offer) for offer in singles(plain, linear, cost, hold=True)[: most // 2]]
        if room > 1:
            offers += [(plain.model, offer) for offer in pairs(plain, linear, cost, most=most)]
        if not one.fit.added:
            offers += self._at_other_marks(plain, self.blocks)
        return found + self._raced(one, plain, [with_offer(model, offer) for model, offer in offers])

    def _at_other_marks(self, fit: Fit, blocks: Callable[[Fit], list[Columns]]) -> list[tuple[Model, Offer]]:
        """Single causes with the marks elsewhere, the best first.

        What is missing decides where the marks are as much as what was declared.
        """

        def at(offset: float) -> list[tuple[Model, Offer]]:
            state = evaluated(fit.bench, marked(fit.model, offset), fit.declared, fit.waves)
            return [(state.model, offer) for offer in singles(state, blocks(state), self.score.cost)[:2]]

        found = [both for offers in each(at, self.offsets[: self.policy.offsets]) for both in offers]
        return sorted(found, key=lambda both: round(both[1].score, 6))[:_SOLVED]

    def added_from_starts(self, one: Hypothesis, *, everywhere: bool) -> list[Hypothesis]:
        """A set with one cause more, or two at once, of what no linear step tells the size of.

        Of sources with many places, each of which is improbable, only where they are wanted `everywhere`.  Then, beside
        what opens no contact, the best starts of every source are followed to their end, since a few steps drop what is
        about to fit, and so are causes that show only beside what lets all contacts go.
        """
        room = self.policy.most_effects - len(one.fit.added)
        if room < 1:
            return []
        (_, plain, linear), cost, most = self._beside(one), self.score.cost, _SOLVED
        names = self._begun(everywhere=everywhere)
        starts = self._starts(plain, names)
        ranked = singles(plain, starts, cost)
        patient = everywhere and all(source(e.key).at_output for e in one.fit.added)
        offers = [(plain.model, offer) for offer in (_of_each(ranked, _PATIENT) if patient else ranked[: 2 * most])]
        if room > 1:
            offers += [(plain.model, offer) for offer in pairs(plain, linear + starts, cost, most=most)]
        if room > 1 and patient:
            offers += self._behind(plain)
        if not one.fit.added:
            offers += self._at_other_marks(plain, partial(self._starts, names=names))
        return self._raced(one, plain, [with_offer(model, offer) for model, offer in offers], patient=patient)

    def _behind(self, fit: Fit) -> list[tuple[Model, Offer]]:
        """Single causes by a linear step beside the starts of what is the same everywhere."""
        effects = self._begun_alone(fit)

        def beside(effect: Effect) -> list[tuple[Model, Offer]]:
            try:
                state = evaluated(fit.bench, fit.model.with_effects(effect), fit.declared, fit.waves)
            except NotConvergedError:
                return []
            return [(state.model, offer) for offer in singles(state, self.blocks(state), self.score.cost)[:_PATIENT]]

        self.spent += len(effects)
        found = [both for offers in each(beside, effects) for both in offers]
        return sorted(found, key=lambda both: round(both[1].score, 6))[:_SOLVED]

    def _beside(self, one: Hypothesis) -> tuple[Fit, Fit, list[Columns]]:
        """A set on few angles, the same with all declared sizes as declared, and every candidate's influence there."""
        if self._last is None or self._last[0] is not one.fit.gram:  # of one set only: influences are large
            fit = onto(self.coarse(one), one.fit)
            plain = as_declared(fit)
            self._last = one.fit.gram, (fit, plain, self.blocks(plain))
        return self._last[1]

    def coarse(self, one: Hypothesis) -> RunSet:
        """The runs on few angles: near enough to choose what to refit.  Numbers of a table are few already."""
        bench = one.fit.bench
        return self._once("coarse", bench, lambda: bench.coarser(_COARSE)) if bench.sampled else bench

    def free(self, fit: Fit) -> list[Named]:
        """Candidates that a model does not have."""
        taken = {named(e) for e in fit.model.effects}
        return [c for c in self.candidates if identity(c) not in taken]

    def blocks(self, fit: Fit) -> list[Columns]:
        """The influence of every candidate at a state."""
        return columns_of(fit, self.free(fit))

    def _repeats(self, name: Named) -> bool:
        """Tell whether what a candidate makes repeats with the crank."""
        unit = self.root.fit.bench.unit
        return source(name[0]).repeats_with_crank(unit, name[1])

    def leading(self, fit: Fit) -> list[Offer]:
        """Candidates by a linear step over every sample, made once."""
        return self._once("leading", fit, lambda: singles(fit, self.blocks(fit), self.score.cost))

    def _begun(self, *, everywhere: bool) -> tuple[Named, ...]:
        """Candidates with starts, of sources with few places or of all."""
        places = self.score.places
        return tuple(
            name
            for name in self.candidates
            if source(name[0]).starts and (everywhere or places[name[0]] <= _FEW_PLACES)
        )

    def _starts(self, fit: Fit, names: tuple[Named, ...]) -> list[Columns]:
        """The change that each start of some candidates makes beside what is declared, if a model has them not."""
        taken, bench, offset = {named(e) for e in fit.model.effects}, fit.bench, fit.model.index_offset
        which = tuple(map(identity, names))
        plain, made = self._once(("starts", which), self.candidates, lambda: self._started(bench, names))

        def read() -> list[Array]:
            return bench.of_each(partial(self._read, bench, offset, plain, [waves for _, waves in made]))

        at_root = self.root.fit.model.index_offset == offset
        rows = self._once(("rows", which), bench, read) if at_root else read()
        return [
            Columns((e.key, e.indices), np.array([e.values]), tuple(own[at][None] for own in rows), start=True)
            for at, (e, _) in enumerate(made)
            if named(e) not in taken
        ]

    def _started(
        self, bench: RunSet, names: Sequence[Named]
    ) -> tuple[list[Waveform], list[tuple[Effect, list[Waveform]]]]:
        """Waveforms of the declared model, and with each start."""
        effects = [
            effect
            for key, indices in names
            for effect in started(Effect(key, dict(indices), (0.0,) * len(source(key).parameters)))
        ]  # fmt: skip
        plain, made, new = self.starts.of(bench.coarser(_STARTS), effects)
        self.spent += new
        return plain, [(e, waves) for e, waves in zip(effects, made, strict=True) if waves]

    @staticmethod
    def _read(
        bench: RunSet, offset: float, plain: Sequence[Waveform], made: Sequence[Sequence[Waveform]], number: int
    ) -> Array:
        """What waveforms differ by from that of the declared model, as a record sees it, whitened."""
        sight, which = bench.sights[number], bench.which[number]
        rows = [sight.of_wave(waves[which], waves[which].error[None], offset) for waves in (plain, *made)]
        return sight.whiten(np.concatenate(rows[1:]) - rows[0]) if made else np.empty((0, sight.width))

    # --- moves: what is replaced, and dropped -------------------------------------------------------------------------

    @_made_once
    def moved(self, one: Hypothesis) -> list[Hypothesis]:
        """A set with its causes in equivalent places, begun anew from their starts, or with the marks elsewhere."""
        if not one.fit.added:
            return []
        fit = self._beside(one)[1]
        declared, added, unit = fit.model.effects[: len(fit.declared.effects)], fit.added, fit.bench.unit
        free = {identity(name) for name in self.free(fit)} | {named(e) for e in added}
        places = [[e, *(p for p in equivalents(e, unit) if named(p) in free)] for e in added]
        sets = list(product(*places))
        sets.sort(key=lambda s: sum(a is not b for a, b in zip(s, added, strict=True)))
        sets = sets[1 : 1 + _MOST_MOVES]
        sets += [
            (*added[:at], begun, *added[at + 1 :])
            for at in range(len(added)) for place in places[at] for begun in started(place)
        ]  # fmt: skip
        sets = [s for s in sets if len({named(e) for e in s}) == len(s)]
        models = [replace(fit.model, effects=(*declared, *one_set)) for one_set in sets]
        models += [marked(fit.model, offset) for offset in self.offsets[: self.policy.offsets]]
        return self._raced(one, fit, models)

    @_made_once
    def dropped(self, one: Hypothesis) -> list[Hypothesis]:
        """A set without each of its causes, lines, or drift, refitted."""
        found = each(partial(self._without, one), range(len(one.fit.added)))
        self.spent += 12 * len(found)
        records = one.fit.bench.records
        for order in one.lines:
            kept = tuple(o for o in one.lines if o != order)
            lined = [replace(r, orders=tuple(o for o in r.orders if o != order)) for r in records]
            found.append(self._with_records(one, lined, kept, slow=one.slow))
        if one.slow:
            found.append(self._with_records(one, [replace(r, slow=False) for r in records], one.lines, slow=False))
        return found

    def _without(self, one: Hypothesis, number: int) -> Hypothesis:
        """The set without one cause; a few steps tell where not even a linear one promises enough."""
        effects, at = one.fit.model.effects, len(one.fit.declared.effects) + number
        model = replace(one.fit.model, effects=effects[:at] + effects[at + 1 :])
        fit = fitted(evaluated(one.fit.bench, model, one.fit.declared, one.fit.waves), steps=4)
        if fit.objective - fit.proposal[1] < one.fit.objective + 5 * _CLOSE:
            fit = fitted(fit)
        return self.score.of(fit, one.lines, one.slow)

    # --- the race -----------------------------------------------------------------------------------------------------

    def _raced(
        self, one: Hypothesis, fit: Fit, models: Sequence[Model], *, patient: bool = False, below: float = math.inf
    ) -> list[Hypothesis]:
        """Models solved at the load, the most promising refitted further and further; the best over every sample, and
        such as promise a lower score than some."""
        trials = self._solved(fit, models)
        if patient:
            trials = self._stepped(trials, _PATIENCE)
        for steps, times in _RACE:
            trials = distinct(sorted(trials, key=lambda t: t.prospect), times * _REFITTED)
            trials = self._stepped(trials, steps)
        trials.sort(key=lambda t: t.prospect)
        most = min(below, min((trial.prospect for trial in trials), default=0.0) + _CLOSE)
        near = [trial.fit for trial in trials if trial.prospect < most]
        first = self._refitted(one, near[:1])
        return first if self._ends(one, first) else first + self._refitted(one, near[1:])

    def _solved(self, fit: Fit, models: Sequence[Model]) -> list[Trial]:
        """Each model once, where there is an equilibrium."""
        different = list({tuple((named(e), e.values) for e in model.effects): model for model in models}.values())
        self.spent += len(different)

        def solve(model: Model) -> Trial | None:
            try:
                return self._trial(evaluated(fit.bench, model, fit.declared, fit.waves))
            except NotConvergedError:
                return None

        return [trial for trial in each(solve, different) if trial]

    def _trial(self, fit: Fit) -> Trial:
        return Trial(fit.slim, round(self.score.of(fit).score - fit.proposal[1], 6))

    def _stepped(self, trials: Sequence[Trial], steps: int) -> list[Trial]:
        self.spent += steps * len(trials)
        return each(lambda trial: self._trial(fitted(trial.fit, steps=steps, enough=0.5)), trials)

    def _fitted_with(self, one: Hypothesis, offers: Sequence[Offer]) -> list[Hypothesis]:
        """A set with each of some offers, fitted over every sample."""
        trials = self._solved(one.fit, [with_offer(one.fit.model, offer) for offer in offers])
        return self._refitted(one, [trial.fit for trial in trials])

    def _refitted(self, one: Hypothesis, fits: Sequence[Fit]) -> list[Hypothesis]:
        """Fits over every sample of a set's runs."""
        bench, steps = one.fit.bench, 30
        self.spent += steps * len(fits)
        ends = each(lambda fit: fitted(onto(bench, fit), steps=steps, enough=0.3), fits)
        return [self.score.of(end, one.lines, one.slow) for end in ends]

    # --- what fits as well --------------------------------------------------------------------------------------------

    def as_good(self, one: Hypothesis, number: int) -> tuple[Named, ...]:
        """Other causes that fit as well in one's place, by score or by objective."""
        behind = -2 * math.log(self.policy.alike)
        return tuple(
            (rival.fit.added[-1].key, dict(rival.fit.added[-1].indices))
            for rival in self.rivals(one, number)
            if min(rival.score - one.score, rival.fit.objective - one.fit.objective) < behind
        )

    @_made_once
    def rivals(self, one: Hypothesis, number: int) -> list[Hypothesis]:
        """A set with other causes in one's place that come near: such as close the same gaps, equivalent places, and
        what a linear step or a start puts there.

        Sources of one place in its frame, whose orders it shares, are begun at all their starts: another cause of the
        frame may stand for a runout of which no linear step tells.
        """
        coarse = onto(self.coarse(one), one.fit)
        rest, effect = lifted(coarse, number), coarse.added[number]
        free = self.free(coarse)
        gaps = self._once("gaps", self.candidates, lambda: Gaps(coarse.bench.gears))
        others = gaps.twins(effect, free) + gaps.near(effect, free)
        others += [e for e in equivalents(effect, coarse.bench.unit) if named(e) in map(identity, free)]
        blocks = [block for block in self.blocks(rest) if identity(block.name) != named(effect)]
        # what does not repeat with the crank is none for what does
        starts = self._starts(coarse, self._begun_like((effect.key, effect.indices)))
        near = self._near(one, coarse, rest, others, self._offers(rest, blocks, starts, _RIVALS))
        alone = [e for e in self._begun_alone(coarse) if source(e.key).frame == source(effect.key).frame]
        models, below = [rest.model.with_effects(e) for e in alone], self._trial(coarse).prospect + _CLOSE
        near += self._raced(one, rest, models, below=below)
        found = dict[object, Hypothesis]()
        for rival in sorted(near, key=lambda h: h.score):
            if rival.names != one.names:
                found.setdefault(rival.names, rival)
        return list(found.values())

    @_made_once
    def replaced(self, one: Hypothesis) -> list[Hypothesis]:
        """One cause in the place of two or three, each start followed to its end: they may stand for a runout."""
        if len(one.fit.added) < 2:
            return []
        coarse = onto(self.coarse(one), one.fit)
        plain = as_declared(coarse)
        bare = replace(plain.model, effects=plain.model.effects[: len(plain.declared.effects)])
        fit = evaluated(plain.bench, bare, plain.declared)
        models = [bare.with_effects(effect) for effect in self._begun_alone(fit)]
        return self._raced(one, fit, models, patient=True, below=self._trial(coarse).prospect)

    def _begun_alone(self, fit: Fit) -> list[Effect]:
        """Candidates of sources with one place, at each of their starts."""
        names = [name for name in self.free(fit) if not name[1] and source(name[0]).starts]
        return [e for key, _ in names for e in started(Effect(key, {}, (0.0,) * len(source(key).parameters)))]

    @_made_once
    def hidden(self, one: Hypothesis) -> list[Hypothesis]:
        """A set with a cause more that its declared sizes and stiffness hide: they have moved to make up for it.

        Seen from the declared sizes, by a linear step or its starts.  What does not repeat with the crank cannot hide
        behind what does.
        """
        if len(one.fit.added) == self.policy.most_effects:
            return []
        coarse = onto(self.coarse(one), one.fit)
        plain = as_declared(coarse)
        all_repeat = all(self._repeats((e.key, e.indices)) for e in plain.bench.around(plain.model))
        names = tuple(name for name in self._begun(everywhere=False) if self._repeats(name) or not all_repeat)
        columns = self.blocks(plain), self._starts(plain, names)
        offers = [o for some in columns for o in singles(plain, some, self.score.cost)[:_SOLVED]]
        models = [with_offer(plain.model, o) for o in offers if o.score < o.without]
        return self._raced(one, plain, models, below=self._trial(coarse).prospect)

    def _begun_like(self, name: Named) -> tuple[Named, ...]:
        """Candidates with starts that repeat with the crank, or not, as another does."""
        return tuple(other for other in self._begun(everywhere=False) if self._repeats(other) == self._repeats(name))

    def _offers(self, rest: Fit, blocks: Sequence[Columns], starts: Sequence[Columns], most: int) -> list[Offer]:
        """Single causes by linear steps with all else free and held, and by starts."""
        return [
            offer
            for columns, hold, count in ((blocks, False, most), (blocks, True, most), (starts, False, 2 * most))
            for offer in singles(rest, columns, self.score.cost, hold=hold)[:count]
        ]

    def _near(
        self, one: Hypothesis, coarse: Fit, rest: Fit, others: Sequence[Effect], offers: Sequence[Offer]
    ) -> list[Hypothesis]:
        """Other sets that come near one, from what is left of it and effects or offers beside that."""
        models = [rest.model.with_effects(other) for other in others]
        models += [with_offer(rest.model, offer) for offer in offers]
        own = self.score.of(coarse).score
        trials = sorted(self._solved(coarse, models), key=lambda t: t.prospect)
        ends = self._stepped(distinct([t for t in trials if t.prospect < own + 5 * _CLOSE], _RIVALS), 8)
        least = min([own, *(end.prospect for end in ends)])
        ends = sorted((end for end in ends if end.prospect < least + _CLOSE), key=lambda end: end.prospect)
        return self._refitted(one, [e.fit for e in ends[: _RIVALS // 2]])

    def opposites(self, one: Hypothesis) -> list[Fit]:
        """Fits at the opposite of a cause that chance does not tell from these: intervals hold theirs too.

        Where all that shows of a cause is quadratic, as of a carrier whose discs balance, other errors tell its sign.
        """
        coarse, most = onto(self.coarse(one), one.fit), one.fit.objective + chi_square(1 - self.policy.confidence, 1)
        first, models = len(coarse.declared.effects), []
        for at, effect in enumerate(coarse.added):
            models += [
                replace(coarse.model, effects=(*coarse.model.effects[: first + at], other, *coarse.added[at + 1 :]))
                for other in equivalents(effect, coarse.bench.unit)
                if named(other) == named(effect)
            ]
        ends = self._stepped(self._solved(coarse, models), 12)
        near = [end.fit for end in ends if end.fit.objective < coarse.objective + _CLOSE]
        away = [end.fit for end in self._refitted(one, near) if end.fit.objective < most]
        pairs_of = [(fit, zip(fit.added, one.fit.added, strict=True)) for fit in away]
        return [fit for fit, both in pairs_of if any(np.dot(a.values, b.values) < 0 for a, b in both)]


def _of_each(offers: Sequence[Offer], most: int) -> list[Offer]:
    """So many offers of each source, in order."""
    counts = Counter[str]()
    found = []
    for offer in offers:
        counts[offer.names[0][0]] += 1
        if counts[offer.names[0][0]] <= most:
            found.append(offer)
    return found
