"""The search for what a model lacks: best first among sets of causes, under one score.

Page ``theory/search.md``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from rverror.base.text import describe
from rverror.base.threads import each
from rverror.diagnosis.causes import Named, named
from rverror.diagnosis.gears.fit import Fit, evaluated, fitted, onto
from rverror.diagnosis.gears.moves import Moves, Once, Starts, equivalents
from rverror.diagnosis.gears.ranking import singles
from rverror.diagnosis.gears.residual_faults import nearly_noise
from rverror.diagnosis.gears.score import Hypothesis, Score, inexact, strained
from rverror.diagnosis.gears.spectrum import best_lines, explained
from rverror.diagnosis.gears.trial import Trial, distinct
from rverror.diagnosis.journal import Journal
from rverror.diagnosis.policy import Policy
from rverror.model.effects import Model
from rverror.statics.loaded_state import each_solved

_TOGETHER = 8  # trials of each number of causes that are raced
_TO_THE_END = 3  # trials of a race
_LOOKED_AT = 40  # more that are solved once, where those did not complete a set
_AS_GOOD = 4  # times the sets of a beam: beside them sources of one place are tried from their starts
_DOUBT = (1, 2, 1, 0)  # times _CLOSE, of what a trial promises that is not solved, solved, and took steps
_CLOSE = 60.0  # by which fits on few angles and linear steps may be off


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
    moves : Moves
    widest, rounds : int
        Sets of the widest beam, and rounds of a beam for each set of it.
    """

    widest, rounds = 2, 4  # no unit of the trial was completed by a wider beam

    def __init__(
        self, root: Fit, candidates: Sequence[Named], policy: Policy, journal: Journal, offsets: Sequence[float] = ()
    ) -> None:
        """Begin with what is declared."""
        self.candidates, self.policy, self.journal = tuple(candidates), policy, journal
        self.score = Score(candidates, policy)
        self.known: dict[frozenset[object], Hypothesis] = {}
        self.root = self.score.of(root).without_rows
        self.moves = Moves(self.root, candidates, self.score, offsets, Starts(root.declared))
        self._width, self._rounds, self._solved = 1, 0, 0
        self._queue: list[Trial] = []
        self._expanded = set[tuple[frozenset[object], str]]()
        self._once = Once()
        self.keep([self.root])

    def anew(self, root: Fit) -> Search:
        """A search from what is declared under other noise, which knows no set yet."""
        other = self.__class__(root, self.candidates, self.policy, self.journal, self.moves.offsets)
        other.moves = self.moves.anew(other.root)
        other._solved = self._solved
        return other

    @property
    def spent(self) -> int:
        """Solutions of the equilibrium under all conditions."""
        return self._solved + self.moves.starts.solved

    # --- the loop -----------------------------------------------------------------------------------------------------

    def best(self, *also: Hypothesis, swap: bool = True) -> tuple[Hypothesis, bool]:
        """Search from what is declared, and from other sets.

        Parameters
        ----------
        *also : Hypothesis
        swap : bool
            Whether a complete set must be better than all that come near it.

        Returns
        -------
        best : Hypothesis
            The most probable set, without what is needless in it.
        complete : bool
            Whether nothing is left beside it.
        """
        self.keep(also)
        while self.spent <= self.policy.budget:
            best = self.pruned(self._leader)
            if self.complete(best):
                if not swap:
                    return best.with_rows, True
                if not (self.expand(best, self.challengers) or self.compare(best) or self._race_all_places(best)):
                    return best.with_rows, True
            # the widest beam is through, or nothing is left but faults of the readings
            elif self._width > self.widest or (nearly_noise(best.fit) and self.nothing_left(best)):
                return best.with_rows, False
            else:
                going, self._rounds = self.expand_beam() | self.race_each(), self._rounds + 1
                if not going or self._rounds == self.rounds * self._width:
                    self._width, self._rounds = 2 * self._width, 0
        best = self.pruned(self._leader)
        return best.with_rows, self.complete(best)

    def compare(self, best: Hypothesis) -> bool:
        """Take each trial that may come near a complete set a step further; false where there is none."""
        limit = best.score + self.margin
        trials = [trial for trial in self._queue if self._may_reach(trial, limit)]
        self._queue = [trial for trial in self._queue if not self._may_reach(trial, limit)]
        further = self._all_further(distinct(trials, len(trials)))
        ends = [trial for trial in further if trial.finished]
        self._queue += [trial for trial in further if not trial.finished]
        self._fit_all([trial for trial in ends if trial.score < limit])
        return bool(trials)

    def race_each(self) -> bool:
        """Race the most promising trials of each number of causes; false where there is none."""
        raced = False
        for size in range(1, self.policy.most_effects + 1):
            trials = self._promising(size)
            if trials:  # of one cause even beside a complete set: a line that completes it stands against causes
                raced = True
                self._queue += self.race(trials)
                if self.complete(self._leader):
                    break
        return raced

    def _promising(self, size: int) -> list[Trial]:
        """Trials, from the queue, of so many causes that may be the best of that number, and, where the first of them
        completed no set, some that were not solved yet: of what bends a linear step promises too little.  These are
        left alone where more causes leave no more than noise already: what is missing is then among those."""
        known = [one.score for one in self.known.values() if len(one.fit.added) == size]
        limit = min(known, default=math.inf) + _CLOSE * (self._width - 1)
        same = sorted((t for t in self._queue if len(t.added) == size), key=lambda t: t.score)
        first = distinct([trial for trial in same if trial.score <= limit], _TOGETHER)
        fits = any(len(one.fit.added) > size and one.fit.data <= one.fit.bound for one in self.known.values())
        more = 0 if fits or (not self._rounds and self._width == 1) else _LOOKED_AT
        ahead = set(map(id, first))
        unsolved = [trial for trial in same if not trial.taken and id(trial) not in ahead]
        chosen = distinct([*first, *unsolved], len(first) + more)
        self._queue = [trial for trial in self._queue if not any(trial is one for one in chosen)]
        return [replace(trial, first=id(trial) in ahead) for trial in chosen]

    def race(self, trials: Sequence[Trial]) -> list[Trial]:
        """Take trials further, twelve once they are solved and half of them each time; the last are followed to their
        end and fitted to every sample.  Those that fell behind are given back.

        The first are compared once they took three steps: where jumps have moved, the solved one says little of what a
        step promised.
        """
        ends, behind, kept = list[Trial](), list[Trial](), 3 * _TOGETHER
        while trials:
            further = sorted(self._all_further(trials), key=lambda trial: (not trial.ahead, trial.score))
            ends += [trial for trial in further if trial.finished]
            going = [trial for trial in further if not trial.finished]
            kept = max(_TO_THE_END, kept // 2)
            places = max(kept, sum(trial.ahead for trial in going) + kept // 2)
            behind += going[places:]
            trials = going[:places]
        ends.sort(key=lambda trial: trial.score)
        near = [trial for trial in ends if trial.score < ends[0].score + _CLOSE]
        self._fit_all(near[:1])
        if self.complete(self._leader):
            limit = self._leader.score + self.margin
            near = [trial for trial in near if trial.score < limit]
        self._fit_all(near[1:])
        return behind

    @staticmethod
    def _may_reach(trial: Trial, limit: float) -> bool:
        """Tell whether a trial may come to a score: the fewer steps it took, the less its promise says."""
        return trial.score < limit + _CLOSE * _DOUBT[min(trial.taken, len(_DOUBT) - 1)]

    @property
    def margin(self) -> float:
        """Score within which sets are compared: what counts as alike, and as much for a linear step's error."""
        return -4 * math.log(self.policy.alike)

    def _fit_all(self, trials: Sequence[Trial]) -> None:
        """Fit trials to every sample."""

        def fit(trial: Trial) -> Hypothesis:
            assert trial.fit is not None
            end = fitted(onto(trial.origin.fit.run_set, trial.fit), steps=30, enough=0.3)
            return self.score.of(end)

        self._solved += 8 * len(trials)
        self.keep(each(fit, trials))

    def _all_further(self, trials: Sequence[Trial]) -> list[Trial]:
        """Trials solved, or a few steps further, those that have an equilibrium."""
        if trials:
            leading = ", ".join(describe(e.key, e.indices) for e in self._leader.fit.added) or "what was declared"
            self.journal.tell(
                f"{self.spent} of {self.policy.budget} equilibria, {len(self.known)} sets; the best: {leading}"
            )
        further = each_solved(partial(Trial.further, score=self.score), trials)
        self._solved += sum(one.spent for one in further)
        return further

    @property
    def _leader(self) -> Hypothesis:
        return min(self.known.values(), key=lambda one: one.score)

    def keep(self, found: Iterable[Hypothesis]) -> None:
        """Keep the best fit of each set."""
        for one in found:
            before = self.known.get(one.names)
            if before is None or one.score < before.score - 1:  # fits that have settled differ by less
                self.known[one.names] = one.without_rows

    # --- complete -----------------------------------------------------------------------------------------------------

    def complete(self, one: Hypothesis) -> bool:
        """Tell whether nothing is left but noise, and nothing declared is strained to make up for what is missing."""
        return one.fit.data <= one.fit.bound and self.nothing_left(one)

    def nothing_left(self, one: Hypothesis) -> bool:
        """Tell whether no candidate or line is missing, whatever the squares."""
        return self._once("nothing left", one.fit, lambda: self._nothing_left(one))

    def _nothing_left(self, one: Hypothesis) -> bool:
        if strained(one.fit):
            return False
        one = one.with_rows
        if self._line_left(one.fit) or self._settles(one):
            return False
        offers = singles(*self.moves.influences(one), self.score.cost)
        return not any(o.score < o.without - self.score.sure - inexact(one.fit) for o in offers[:1])

    def _line_left(self, fit: Fit) -> bool:
        """Tell whether a line is left that noise hardly ever makes; what it makes in one of a thousand runs is told."""
        chance = math.erfc(self.policy.by_chance / math.sqrt(2)) / 2
        return fit.run_set.sampled and bool(best_lines(fit, replace(self.policy, false_alarm=chance), outside=False))

    def _settles(self, one: Hypothesis) -> bool:
        """Tell whether drift or settling is left of runs that are long enough to tell it from an encoder's error."""
        records = one.fit.run_set.records
        if one.slow or not one.fit.run_set.settles:
            return False
        squares, _ = explained(records, one.fit.residual, [r.settling for r in records])
        return squares > self.score.regular(one.fit, 0, slow=True) + self.score.sure

    def pruned(self, one: Hypothesis) -> Hypothesis:
        """A set without what does not stand in it, even if what is left is not complete.

        What makes the set complete needs no margin for the model's own error.
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

    def parts(self, one: Hypothesis) -> list[Hypothesis]:
        """The best fits of a set without each of what it has."""
        found = self._once("parts", one.fit, lambda: self.dropped(one))
        self.keep(found)
        return [self.known[part.names] for part in found]

    def dropped(self, one: Hypothesis) -> list[Hypothesis]:
        """A set without each of its causes, lines, or drift, refitted."""
        found = each(partial(self._without, one), range(len(one.fit.added)))
        self._solved += 4 * len(found)
        for order in one.lines:
            found.append(self.with_free(one, [o for o in one.lines if o != order], slow=one.slow))
        if one.slow:
            found.append(self.with_free(one, one.lines, slow=False))
        return [part.without_rows for part in found]

    def _without(self, one: Hypothesis, number: int) -> Hypothesis:
        """The set without one cause; a few steps tell where not even a linear one promises enough."""
        if one.names == {named(one.fit.added[number])}:
            return self.root
        base = one.coarse
        few = fitted(evaluated(base.run_set, base.model_with(instead_of=number), base.declared, base.waves))
        fit = onto(one.fit.run_set, few)
        if fit.objective < one.fit.objective + 5 * _CLOSE:
            fit = fitted(fit)
        return self.score.of(fit)

    # --- what a set offers --------------------------------------------------------------------------------------------

    def expand_beam(self) -> bool:
        """Expand the best sets of each number of causes, as many as the beam is wide, by the next kind of move; false
        where all were made."""
        found = False
        for size in range(self.policy.most_effects + 1):
            # a set with a higher score than the root leads nowhere: what it leads to is found from the root
            gains = [one for one in self.known.values() if one.score <= self.root.score]
            alike = sorted((one for one in gains if len(one.fit.added) == size), key=lambda one: one.score)
            for one in alike[: self._width]:
                # a set that mostly fits is raced with its causes elsewhere
                if one.fit.added and self.moves.mostly(one) and self.expand(one, self._other_places):
                    found = True
                    if self.complete(self._leader):
                        return True
                found = any(self.expand(one, kind) for kind in self._kinds(one)) or found
            for one in alike[: _AS_GOOD * self._width] if self._rounds else ():
                found = self.expand(one, self._single_place_sources) or found
        return found

    def _kinds(self, one: Hypothesis) -> list[Callable[[Hypothesis], Iterator[Trial]]]:
        """Moves from a set, in their order."""
        moves = self.moves
        if len(one.fit.added) < self.policy.most_effects:
            return [self._one_more, moves.two_more, moves.from_all_starts, self._with_late_line]
        return [self._exchanges, self._with_late_line] if moves.mostly(one) else [self._with_late_line]

    def expand(self, one: Hypothesis, kind: Callable[[Hypothesis], Iterator[Trial]]) -> bool:
        """Put moves from a set into the queue, once."""
        name = one.names, kind.__name__
        if name in self._expanded:
            return False
        self._expanded.add(name)
        self.journal.round += 1
        self._queue += kind(one)
        return True

    def _other_places(self, one: Hypothesis) -> Iterator[Trial]:
        """A set that mostly fits, with its causes in equivalent places or restarted."""
        yield from self.race(list(self.moves.other_places(one)))

    def _exchanges(self, one: Hypothesis) -> Iterator[Trial]:
        """A full set that mostly fits, with another cause in the place of each."""
        yield from self.race(list(self.moves.exchanges(one)))

    def _one_more(self, one: Hypothesis) -> Iterator[Trial]:
        """One cause more; drift and settling, which look like no part of the gears; a line, if nothing is left then."""
        self.keep(self.with_settling(one))
        self.keep(found for found in self.with_line(one) if self.complete(found))
        yield from self.moves.one_more(one)

    def _single_place_sources(self, one: Hypothesis) -> Iterator[Trial]:
        """A source of one place at all its starts, solved beside a set.

        What it does may show beside the right one of several sets alone, all of which leave as much.
        """
        yield from self._all_further(list(self.moves.single_place_sources(one)))

    def _with_late_line(self, one: Hypothesis) -> Iterator[Trial]:
        """A line that no part has, late: a wave of the pins has side orders that look like lines."""
        self.keep(self.with_line(one))
        yield from ()

    def challengers(self, one: Hypothesis) -> Iterator[Trial]:
        """What a complete set must stand beside; a part that nearly fits may have ended in a false minimum."""
        yield from self.race(list(self.moves.masked(one)))
        yield from self.race(list(self.moves.same_gaps(one)))
        yield from self.moves.swaps(one)
        yield from self.race(list(self.moves.single_place_alone(one)))
        yield from self.race(list(self.moves.other_marks(one)))
        for part in self.parts(one):
            if part.fit.added and self.moves.nearly(part):
                yield from self.race(list(self.moves.other_places(part)))
            if one.slow and not part.slow and len(part.fit.added) < self.policy.most_effects:
                yield from self.moves.one_more(part)  # settling was added before causes were tried in its place

    def _race_all_places(self, one: Hypothesis) -> bool:
        """Race a complete set of several causes with some in equivalent places at once: one at a time they were swapped
        already."""
        return len(one.fit.added) > 1 and self.expand(one, self._other_places)

    def with_settling(self, one: Hypothesis) -> list[Hypothesis]:
        """A set with runs that drift and settle, if they do."""
        return [self.with_free(one, one.lines, slow=True)] if self._settles(one.with_rows) else []

    def with_line(self, one: Hypothesis) -> list[Hypothesis]:
        """A set with the strongest line that no part has."""
        if not one.fit.run_set.sampled:  # a table names all its lines
            return []
        lines = best_lines(one.with_rows.fit, self.policy, outside=True)
        return [self.with_free(one, (*one.lines, line.order), slow=one.slow) for line in lines]

    def with_free(self, one: Hypothesis, lines: Sequence[float], *, slow: bool) -> Hypothesis:
        """The causes of a set with free lines of these orders, and with runs that drift and settle or do not."""
        return self.score.of(fitted(onto(one.fit.run_set.with_free(lines, slow=slow), one.fit)))

    # --- what fits as well --------------------------------------------------------------------------------------------

    def rivals(self, one: Hypothesis, number: int) -> list[Hypothesis]:
        """Sets that were fitted with another cause in one's place, the best first."""
        rest = one.names - {named(one.fit.added[number])}
        found = [
            other
            for other in self.known.values()
            if rest < other.names and len(other.names) == len(one.names) and other.names != one.names
            and len(other.fit.added) == len(one.fit.added)
        ]  # fmt: skip
        return sorted(found, key=lambda other: other.score)

    def as_good(self, one: Hypothesis, number: int) -> tuple[Named, ...]:
        """Other causes that fit as well in one's place, by score or by objective; also those of its source in sets of
        which several causes are elsewhere."""
        effect, own = one.fit.added[number], {named(e) for e in one.fit.added}
        behind, keys = -2 * math.log(self.policy.alike), sorted(e.key for e in one.fit.added)
        elsewhere = [
            other
            for other in sorted(self.known.values(), key=lambda other: other.score)
            if named(effect) not in other.names
            and sorted(e.key for e in other.fit.added) == keys
            and (other.lines, other.slow) == (one.lines, one.slow)
        ]
        found = [
            e
            for some, wanted in ((self.rivals(one, number), None), (elsewhere, effect.key))
            for other in some
            if min(other.score - one.score, other.fit.objective - one.fit.objective) < behind
            for e in other.fit.added
            if named(e) not in own and wanted in (None, e.key)
        ]
        return tuple((e.key, dict(e.indices)) for e in {named(e): e for e in found}.values())

    def opposites(self, one: Hypothesis) -> list[Fit]:
        """Fits at the opposite of a cause within the odds of `alike`: intervals hold theirs too.

        Where all that shows of a cause is quadratic, as of a carrier whose discs balance, other errors tell its sign.
        """
        coarse, most = one.coarse, one.fit.objective - 2 * math.log(self.policy.alike)
        trials = [
            coarse.model_with(other, instead_of=at)
            for at, effect in enumerate(coarse.added)
            for other in equivalents(effect, coarse.run_set.unit)
            if named(other) == named(effect)
        ]

        def fit_of(model: Model) -> Fit | None:
            fit = fitted(evaluated(coarse.run_set, model, coarse.declared, coarse.waves), steps=12, enough=0.5)
            return fitted(onto(one.fit.run_set, fit), steps=30) if fit.objective < coarse.objective + _CLOSE else None

        away = [fit for fit in each_solved(fit_of, trials) if fit.objective < most]
        pairs_of = [(fit, zip(fit.added, one.fit.added, strict=True)) for fit in away]
        return [fit for fit, both in pairs_of if any(np.dot(a.values, b.values) < 0 for a, b in both)]
