"""The search for what a model lacks: sets of causes, moves between them, and one score.

Page ``theory/diagnosis.md``.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import product
from typing import TypeVar

import numpy as np

from rverror.base.arrays import Array
from rverror.base.chance import chi_square
from rverror.base.text import describe
from rverror.base.threads import each
from rverror.diagnosis.gears.fit import Fit, RunSet, as_compared, counted, evaluated, fitted, onto_samples
from rverror.diagnosis.gears.ranking import Block, Offer, pairs, singles
from rverror.diagnosis.gears.spectrum import best_lines, explained
from rverror.diagnosis.gears.twins import Gaps
from rverror.diagnosis.gears.waveform import Named, Waveform
from rverror.diagnosis.policy import Policy
from rverror.diagnosis.search import Journal
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.statics.loaded_state import NotConvergedError

T = TypeVar("T")

_WIDEST = 8  # beam
_FEW_PLACES = 12  # of a source: harmonics of two discs, not single pins or lobes


def identity(name: Named) -> tuple[object, ...]:
    """Key and indices, to compare."""
    return (name[0], *sorted(name[1].items()))


def named(effect: Effect) -> tuple[object, ...]:
    """`identity` of an effect."""
    return identity((effect.key, effect.indices))


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A set of causes, fitted.

    Attributes
    ----------
    fit : Fit
    lines : tuple of float
        Orders of free lines.
    slow : bool
        Whether each run drifts and settles by itself.
    score : float
        Minus twice the logarithm of its posterior probability, but for a constant: the less, the better.
    """

    fit: Fit
    lines: tuple[float, ...]
    slow: bool
    score: float

    @property
    def names(self) -> frozenset[object]:
        """Causes, to compare."""
        return (
            frozenset(named(e) for e in self.fit.added)
            | frozenset(round(o, 2) for o in self.lines)
            | ({"slow"} if self.slow else set())
        )


@dataclass(frozen=True, eq=False)
class Trial:
    """A state on few angles, and the score that a fit of everything may reach from there."""

    fit: Fit
    prospect: float


class Search:
    """Sets of causes that were looked at, under one estimate of the noise."""

    def __init__(
        self, candidates: Sequence[Named], policy: Policy, journal: Journal, *, offsets: Sequence[float] = ()
    ) -> None:
        """Begin with nothing known.

        `offsets` are where the gear's marks may be, where that is not known, the likeliest first, rad.
        """
        self.candidates, self.policy, self.journal, self.offsets = tuple(candidates), policy, journal, tuple(offsets)
        self.known: dict[frozenset[object], Hypothesis] = {}
        self.spent = 0  # solutions
        self.width = 1  # of the beam
        self._places = places = Counter(key for key, _ in candidates)
        self._cost = {key: 2 * math.log(len(places) * count) for key, count in places.items()}
        self._coarse: dict[object, RunSet] = {}
        self._complete: dict[int, tuple[Fit, bool]] = {}
        self._parts: dict[int, tuple[Fit, list[Hypothesis]]] = {}
        self._looked: set[tuple[frozenset[object], bool]] = set()
        self._gaps: Gaps | None = None
        self._starts: dict[object, list[tuple[Named, Array, list[Waveform]]]] = {}

    # --- score --------------------------------------------------------------------------------------------------------

    def cost(self, name: Named) -> float:
        """Minus twice the logarithm of the chance that a candidate is missing, before the runs are seen.

        Every source is as likely as every other, and each of its places as the others.
        """
        return self._cost.get(name[0], 2 * math.log(len(self._cost) + 1))

    def score(self, fit: Fit, lines: Sequence[float] = (), slow: bool = False) -> float:
        """Objective, what every added size must be worth (its prior's width over what is left of it), and `cost`."""
        total, policy = fit.objective, self.policy
        covariance, end = fit.covariance, sum(len(e.values) for e in fit.declared.effects)
        for effect in fit.added:
            at = slice(end, end := end + len(effect.values))
            prior = np.array([policy.workshop * p.plausible for p in source(effect.key).parameters])
            total -= np.linalg.slogdet(covariance[at, at] / np.outer(prior, prior))[1]
            total += self.cost((effect.key, effect.indices))
        regular = 2 * len(lines) + (4 if slow else 0)
        return as_compared(float(total + regular * policy.row_cost * len(fit.bench.records)))

    def hypothesis(self, fit: Fit, like: Hypothesis | None = None) -> Hypothesis:
        """A fit with the lines and drift of another hypothesis."""
        lines, slow = (like.lines, like.slow) if like else ((), False)
        return Hypothesis(fit, lines, slow, self.score(fit, lines, slow))

    @cached_property
    def sure(self) -> float:
        """Score by which a cause must do better than none to be named.

        If nothing is missing, the chance that any set comes to be so much more probable is no larger than `false_alarm`
        (Markov's inequality for the ratio of the probabilities).
        """
        return -2 * math.log(self.policy.false_alarm)

    def better(self, more: Hypothesis, less: Hypothesis) -> bool:
        """Tell whether a set with more in it is more probable by far than chance and the model's own error make it."""
        return more.score < less.score - self.sure - inexact(less.fit) * (more.slow <= less.slow)

    # --- moves --------------------------------------------------------------------------------------------------------

    def coarse(self, one: Hypothesis) -> RunSet:
        """The runs in few numbers, on few angles: near enough to choose what to refit."""
        bench = one.fit.bench
        key = tuple((id(r.noise), r.orders, r.slow, int(r.kept.sum()), r.slips) for r in bench.records)
        if key not in self._coarse:
            made = RunSet.of(
                bench.unit, bench.records, self.policy, points=self.policy.coarse, anywhere=bench.anywhere,
                exponents=False,
            )  # fmt: skip
            beyond = tuple(
                c for c in (*self.candidates, *((e.key, e.indices) for e in one.fit.declared.effects))
                if source(c[0]).acts != "marks" and (source(c[0]).at_output or source(c[0]).frame == "sun")
            )  # fmt: skip
            self._coarse[key] = replace(made, few=beyond or (("", {}),))
        return self._coarse[key]

    def free(self, fit: Fit) -> list[Named]:
        """Candidates that a model does not have."""
        taken = {named(e) for e in fit.model.effects}
        return [c for c in self.candidates if identity(c) not in taken]

    def blocks(self, fit: Fit) -> list[Block]:
        """The influence of every candidate at a state."""
        names = self.free(fit)
        rows = fit.bench.influences(fit.model, fit.waves, names)
        ends = np.cumsum([0, *(len(source(key).parameters) for key, _ in names)])
        white = fit.bench.of_each(lambda number: fit.bench.sights[number].whiten(rows[number]))
        return [
            Block(name, np.eye(last - first), tuple(one[first:last] for one in white))
            for name, first, last in zip(names, ends[:-1], ends[1:], strict=True)
        ]

    def start_blocks(self, root: Fit, fit: Fit, *, everywhere: bool) -> list[Block]:
        """The change that each start makes, from nothing to its size, beside what is declared.

        Of sources with many places, each of which is improbable, only where they are wanted `everywhere`.
        """
        name = id(root.waves[0]), everywhere
        if name not in self._starts:
            self._starts[name] = self._started(root, everywhere=everywhere)
        taken, bench = {named(e) for e in fit.model.effects}, fit.bench
        offset = fit.model.index_offset
        made = self._starts[name]
        rows_of = []
        for number, which in enumerate(bench.which):
            sight, base = bench.sights[number], root.waves[which]
            rows: list[Array] = []
            by_grid: dict[object, list[Array]] = {}
            for _, _, waves in made:
                by_grid.setdefault(waves[which].grid, []).append(waves[which].error)
            read = {
                grid: iter(sight.of_grid(grid, np.array(errors), offset))  # type: ignore[arg-type]
                for grid, errors in by_grid.items()
            }
            plain = sight.of_wave(base, base.error[None], offset)
            rows = [next(read[waves[which].grid]) for _, _, waves in made]
            rows_of.append(sight.whiten(np.array(rows).reshape(len(made), -1) - plain))
        return [
            Block(name, sizes[None], tuple(rows[at][None] for rows in rows_of), start=True)
            for at, (name, sizes, _) in enumerate(made)
            if identity(name) not in taken
        ]

    def _started(self, root: Fit, *, everywhere: bool) -> list[tuple[Named, Array, list[Waveform]]]:
        """Waveforms of the declared model with each start."""
        offers = [
            (name, np.array(start) * [p.plausible for p in source(name[0]).parameters])
            for name in self.free(root) if everywhere or self._places[name[0]] <= _FEW_PLACES
            for start in source(name[0]).starts
        ]  # fmt: skip

        def wave(offer: tuple[Named, Array]) -> list[Waveform] | None:
            (key, indices), sizes = offer
            effect = Effect(key, dict(indices), tuple(map(float, sizes)))
            try:
                return root.bench.solve(root.model.with_effects(effect), root.waves)
            except NotConvergedError:
                return None

        self.spent += len(offers)
        return [(*offer, waves) for offer, waves in zip(offers, each(wave, offers), strict=True) if waves]

    def race(self, fit: Fit, models: Sequence[Model], *, kept: int) -> list[Trial]:
        """Models solved at the load, then the most promising refitted further and further, by a third each time."""
        unit = {tuple((named(e), e.values) for e in model.effects): model for model in models}
        trials = self._all(partial(self._trial, fit), list(unit.values()))
        for steps, most in ((1, 3 * kept), (2, 2 * kept), (12, kept)):
            trials = distinct(sorted(trials, key=lambda t: t.prospect), most)
            self.spent += steps * len(trials)
            trials = each(partial(self._stepped, steps=steps), trials)
        return sorted(trials, key=lambda t: t.prospect)

    def _all(self, function: Callable[[T], Trial | None], items: Sequence[T]) -> list[Trial]:
        self.spent += len(items)
        return [trial for trial in each(function, items) if trial]

    def _trial(self, fit: Fit, model: Model) -> Trial | None:
        try:
            return self._promising(evaluated(fit.bench, model, fit.declared, fit.waves))
        except NotConvergedError:
            return None

    def _promising(self, fit: Fit) -> Trial:
        return Trial(fit, as_compared(self.score(fit) - fit.proposal[1]))

    def _stepped(self, trial: Trial, *, steps: int) -> Trial:
        return self._promising(fitted(trial.fit, steps=steps, enough=0.5))

    def fine(self, one: Hypothesis, trials: Sequence[Trial]) -> list[Hypothesis]:
        """The best of a race, fitted to every sample; those behind only where they are near."""
        policy = self.policy
        found: list[Hypothesis] = []
        for number, trial in enumerate(trials):
            behind = trial.prospect - trials[0].prospect
            if number and behind > policy.close:
                break
            steps = 30 if number == 0 else 10
            self.spent += steps
            fit = fitted(onto(one.fit.bench, trial.fit), steps=steps, enough=0.3)
            found.append(self.hypothesis(fit, one))
        return found

    def added(self, one: Hypothesis, root: Hypothesis) -> list[Hypothesis]:
        """A hypothesis with one cause more, or two at once."""
        policy = self.policy
        if one.fit.data <= one.fit.bound:
            found = self._direct(one)
            if any(map(self.complete, found)):
                return found
        else:
            found = []
        fit = onto(self.coarse(one), one.fit)
        plain, bare = as_declared(fit), as_declared(onto(self.coarse(one), root.fit))
        room = policy.most_effects - len(fit.added)
        linear = self.blocks(plain)
        offers = singles(plain, linear, self.cost)[: policy.evaluated]
        if fit.data <= fit.bound:
            offers += singles(fit, self.blocks(fit), self.cost)[: policy.evaluated // 2]
            offers += singles(plain, linear, self.cost, hold=True)[: policy.evaluated // 2]
        if room > 1:
            offers += pairs(plain, linear, self.cost, most=policy.evaluated)
        found += self._raced(one, plain, offers)
        if any(map(self.complete, found)):
            return found
        starts = self.start_blocks(bare, plain, everywhere=self.width > 1)
        ranked = singles(plain, starts, self.cost)
        offers = ranked[: policy.evaluated]
        if room > 1:
            offers += pairs(plain, linear + starts, self.cost, most=policy.evaluated)
        return found + self._raced(one, plain, offers)

    def _raced(self, one: Hypothesis, plain: Fit, offers: Sequence[Offer]) -> list[Hypothesis]:
        models = [with_offer(plain.model, offer) for offer in offers]
        return self.fine(one, self.race(plain, models, kept=self.policy.refitted))

    def _direct(self, one: Hypothesis) -> list[Hypothesis]:
        """With what leads over every sample: few angles are too few where a set fits."""
        offers = self.leading(one.fit)[: self.policy.direct]
        trials = self._all(partial(self._trial, one.fit), [with_offer(one.fit.model, offer) for offer in offers])
        self.spent += 30 * len(trials)
        fits = each(lambda trial: fitted(trial.fit, steps=30, enough=0.3), trials)
        return [self.hypothesis(fit, one) for fit in fits]

    def moved(self, one: Hypothesis) -> list[Hypothesis]:
        """A hypothesis with its causes in equivalent places, or begun anew from their starts."""
        if not one.fit.added:
            return []
        fit = as_declared(onto(self.coarse(one), one.fit))
        declared, unit = fit.model.effects[: len(fit.declared.effects)], fit.bench.unit
        free = {identity(name) for name in self.free(fit)} | {named(e) for e in fit.added}
        places = [[e, *(p for p in equivalents(e, unit) if named(p) in free)] for e in fit.added]
        sets = [s for s in product(*places) if len({named(e) for e in s}) == len(s)]
        sets.sort(key=lambda s: sum(a is not b for a, b in zip(s, fit.added, strict=True)))
        sets = sets[1 : 2 * self.policy.evaluated]
        for at, effect in enumerate(fit.added):
            for begun in (s for place in places[at] for s in started(place)):
                sets.append((*fit.added[:at], begun, *fit.added[at + 1 :]))
        models = [replace(fit.model, effects=(*declared, *one_set)) for one_set in sets]
        models += [marked(fit.model, offset) for offset in self.offsets]
        return self.fine(one, self.race(fit, models, kept=self.policy.refitted))

    def dropped(self, one: Hypothesis) -> list[Hypothesis]:
        """A hypothesis without each of its causes, lines, or drift; made once."""
        if id(one.fit) not in self._parts:
            self._parts[id(one.fit)] = one.fit, self._dropped(one)
        return self._parts[id(one.fit)][1]

    def _dropped(self, one: Hypothesis) -> list[Hypothesis]:
        found = each(partial(self._without, one), range(len(one.fit.added)))
        self.spent += 12 * len(found)
        records = one.fit.bench.records
        for order in one.lines:
            kept = tuple(o for o in one.lines if o != order)
            lined = [replace(r, orders=tuple(o for o in r.orders if o != order)) for r in records]
            fit = fitted(onto(one.fit.bench.with_records(lined), one.fit))
            found.append(Hypothesis(fit, kept, one.slow, self.score(fit, kept, one.slow)))
        if one.slow:
            fit = fitted(onto(one.fit.bench.with_records([replace(r, slow=False) for r in records]), one.fit))
            found.append(Hypothesis(fit, one.lines, False, self.score(fit, one.lines)))
        return found

    def _without(self, one: Hypothesis, number: int) -> Hypothesis:
        effects, at = one.fit.model.effects, len(one.fit.declared.effects) + number
        model = replace(one.fit.model, effects=effects[:at] + effects[at + 1 :])
        fit = fitted(evaluated(one.fit.bench, model, one.fit.declared, one.fit.waves), steps=4)
        if fit.objective - fit.proposal[1] < one.fit.objective + 5 * self.policy.close:
            fit = fitted(fit)
        return self.hypothesis(fit, one)

    def regular(self, one: Hypothesis) -> list[Hypothesis]:
        """A hypothesis with what is regular and no part's: the strongest free line, or runs that drift and settle."""
        found, records = [], one.fit.bench.records
        if self._settles(one):
            bench = one.fit.bench.with_records([replace(r, slow=True) for r in records])
            fit = fitted(onto(bench, one.fit))
            found.append(Hypothesis(fit, one.lines, True, self.score(fit, one.lines, True)))
        for line in best_lines(one.fit, self.policy, outside=True)[:1]:
            lined = [replace(r, orders=(*r.orders, line.order)) for r in records]
            fit = fitted(onto(one.fit.bench.with_records(lined), one.fit))
            lines = (*one.lines, line.order)
            found.append(Hypothesis(fit, lines, one.slow, self.score(fit, lines, one.slow)))
        return found

    def _settles(self, one: Hypothesis) -> bool:
        """Tell whether drift or settling is left of runs that are long enough to tell it from an encoder's error."""
        records = one.fit.bench.records
        if one.slow or any(r.turns <= self.policy.settles for r in records):
            return False
        slow = [r.settling for r in records]
        chance = chi_square(self.policy.false_alarm / max(len(self.candidates), 1), sum(map(len, slow)))
        return explained(records, onto_samples(one.fit), slow)[0] > chance

    # --- complete -----------------------------------------------------------------------------------------------------

    def complete(self, one: Hypothesis) -> bool:
        """Tell whether nothing is left but noise, and nothing declared is strained to make up for what is missing."""
        if id(one.fit) not in self._complete:
            self._complete[id(one.fit)] = one.fit, one.fit.data <= one.fit.bound and self.nothing_left(one)
        return self._complete[id(one.fit)][1]

    def nothing_left(self, one: Hypothesis) -> bool:
        """Tell whether no candidate or line is missing, whatever the squares."""
        fit = one.fit
        if strained(fit) or self._line_left(fit) or self._settles(one):
            return False
        enough = fit.objective - inexact(fit)
        near = [offer for offer in self.leading(fit)[: self.policy.direct] if offer.score < enough]
        if any(offer.score < enough - self.sure for offer in near):
            return False
        # a linear step promises too little where sizes have moved to make up for a cause
        trials = self._all(partial(self._trial, fit), [with_offer(fit.model, offer) for offer in near])
        self.spent += 30 * len(trials)
        ends = each(lambda trial: fitted(trial.fit, steps=30, enough=0.3), trials)
        return not any(self.better(self.hypothesis(end, one), one) for end in ends)

    def _line_left(self, fit: Fit) -> bool:
        """Tell whether a line is left that noise hardly ever makes; what it makes in one of a thousand runs is told."""
        chance = math.erfc(self.policy.by_chance / math.sqrt(2)) / 2
        return bool(best_lines(fit, replace(self.policy, false_alarm=chance), outside=False))

    def leading(self, fit: Fit) -> list[Offer]:
        """Candidates by a linear step over every sample."""
        return singles(fit, self.blocks(fit), self.cost)

    # --- the loop -----------------------------------------------------------------------------------------------------

    def best(self, roots: Iterable[Hypothesis], budget: int) -> tuple[Hypothesis, bool]:
        """The most probable set, and whether it is complete, by a beam that widens until it is or the budget is spent."""
        roots = list(roots)
        root = min(roots, key=lambda one: len(one.names))
        self.known |= {one.names: one for one in roots}
        while self.spent <= budget and self.width <= _WIDEST:
            best = self._closed(root, budget)
            if best:
                return best, True
            following = self._following()
            if following:
                self.look(following, root)
            else:
                self.width *= 2
        return self._end(self._closed(root, budget))

    def _following(self) -> Hypothesis | None:
        """The most promising set that was not looked at, of the best of each size."""
        front: list[Hypothesis] = []
        for size in range(self.policy.most_effects + 1):
            alike = sorted((one for one in self.known.values() if len(one.fit.added) == size), key=outlook)
            front += alike[: self.width]
        return min((one for one in front if not self._was_looked(one)), key=outlook, default=None)

    def _was_looked(self, one: Hypothesis) -> bool:
        return (one.names, True) in self._looked or (self.width == 1 and (one.names, False) in self._looked)

    def _end(self, best: Hypothesis | None) -> tuple[Hypothesis, bool]:
        found = best or self.pruned(min(self.known.values(), key=lambda one: one.score))
        return found, self.complete(found)

    def _closed(self, root: Hypothesis, budget: int) -> Hypothesis | None:
        """The best set, if it is complete and no better one is beside its parts."""
        while self.spent <= budget:
            best = self.pruned(min(self.known.values(), key=lambda one: one.score))
            if not self.complete(best):
                return None
            parts = [one for one in self.dropped_known(best) if (one.names, False) not in self._looked]
            if not parts:
                return best
            width, self.width = self.width, 1
            for part in parts:
                self.look(part, root)
            self.width = width
            if min(self.known.values(), key=lambda one: one.score).score >= best.score:
                return best
        return None

    def dropped_known(self, one: Hypothesis) -> list[Hypothesis]:
        """Its parts with one cause less, fitted once."""
        found = []
        for part in self.dropped(one):
            self.keep([part])
            found.append(self.known[part.names])
        return found

    def keep(self, found: Iterable[Hypothesis]) -> None:
        """Keep the best fit of each set."""
        for one in found:
            before = self.known.get(one.names)
            if before is None or one.score < before.score - 1:
                self.known[one.names] = one

    def look(self, one: Hypothesis, root: Hypothesis) -> None:
        """All moves from a hypothesis."""
        if self._was_looked(one):
            return
        self._looked.add((one.names, self.width > 1))
        self.journal.tell(
            f"{self.spent} solutions; best of {len(self.known)} sets: "
            + (said(min(self.known.values(), key=lambda h: h.score).fit) or "what was declared")
        )
        self.journal.round += 1
        if one.fit.data <= 2 * one.fit.bound and not self.complete(one):
            self.keep(self.moved(one))
            one = self.known[one.names]
        regular = self.regular(one)
        self.keep(regular)
        if any(map(self.complete, regular)):
            return
        if len(one.fit.added) < self.policy.most_effects:
            self.keep(self.added(one, root))

    def pruned(self, one: Hypothesis) -> Hypothesis:
        """A hypothesis without what others have made needless."""
        while True:
            less = self.dropped(one)
            self.keep(less)
            needless = [part for part in less if not self.better(one, part)]
            if not needless:
                return one
            one = min(needless, key=lambda part: part.score)


    # --- what fits as well --------------------------------------------------------------------------------------------

    def as_good(self, one: Hypothesis, number: int) -> tuple[Named, ...]:
        """Other causes that fit as well in one's place, by score or by objective."""
        behind = -2 * math.log(self.policy.alike)
        return tuple(
            (rival.fit.added[-1].key, dict(rival.fit.added[-1].indices))
            for rival in self.rivals(one, number)
            if min(rival.score - one.score, rival.fit.objective - one.fit.objective) < behind
        )

    def rivals(self, one: Hypothesis, number: int) -> list[Hypothesis]:
        """A hypothesis with other causes in one's place, that fit nearly as well, the best first."""
        policy, coarse = self.policy, onto(self.coarse(one), one.fit)
        rest, effect = lifted(coarse, number), coarse.added[number]
        free = self.free(coarse)
        self._gaps = self._gaps or Gaps(coarse.bench.unit, policy.same_gaps)
        taken = {identity(name) for name in free}
        others = self._gaps.twins(effect, free) + self._gaps.near(effect, free, policy.near_gaps)
        others += [e for e in equivalents(effect, coarse.bench.unit) if named(e) in taken]
        blocks = [block for block in self.blocks(rest) if identity(block.name) in taken]
        for hold in (False, True):
            for offer in singles(rest, blocks, self.cost, hold=hold)[: policy.rivals]:
                (key, indices), (sizes,) = offer.names[0], offer.sizes
                others.append(Effect(key, dict(indices), tuple(map(float, sizes))))
        models = [rest.model.with_effects(other) for other in others]
        trials = self._all(partial(self._trial, coarse), models)
        far = self.score(coarse) + 5 * policy.close
        trials = distinct(sorted((t for t in trials if t.prospect < far), key=lambda t: t.prospect), policy.rivals)
        self.spent += 8 * len(trials)
        ends = each(partial(self._stepped, steps=8), trials)
        near = [end for end in ends if end.prospect < min(self.score(coarse), *(e.prospect for e in ends)) + policy.close]
        self.spent += 12 * len(near)
        fits = each(lambda end: fitted(onto(one.fit.bench, end.fit)), near)
        found = dict[object, Hypothesis]()
        for rival in sorted((self.hypothesis(fit, one) for fit in fits), key=lambda h: h.score):
            found.setdefault(rival.names, rival)
        return list(found.values())

    def ranking(self, fit: Fit) -> list[Offer]:
        """Candidates by what a linear step promises beside a fit."""
        return sorted(self.leading(fit), key=lambda offer: offer.objective)

    def alternatives(self, one: Hypothesis) -> list[Fit]:
        """Fits of the same causes at other sizes that chance does not tell from these: intervals hold theirs too."""
        most = one.fit.objective + chi_square(1 - self.policy.confidence, 1)
        found = [other.fit for other in self.moved(one) if other.names == one.names and other.fit.objective < most]
        return [fit for fit in found if fit.objective > one.fit.objective - 1]


def lifted(fit: Fit, number: int) -> Fit:
    """The state without one of the added effects' part, the contacts as they are with it."""
    effects = fit.model.effects
    at = len(fit.declared.effects) + number
    first = sum(len(e.values) for e in effects[:at])
    own = np.arange(first, first + len(effects[at].values))
    values = np.array(effects[at].values)
    rows, data = [], 0.0
    kept = np.delete(np.arange(fit.moment.size), own)
    for white in fit.rows:
        rest = white[0] + values @ white[1 + own]
        rows.append(np.concatenate([rest[None], white[1 + kept]]))
        data += float(rest @ rest)
    model = replace(fit.model, effects=effects[:at] + effects[at + 1 :])
    return replace(
        fit, model=model, rows=tuple(rows), data=data, gram=fit.gram[np.ix_(kept, kept)],
        moment=(fit.moment + fit.gram[:, own] @ values)[kept],
    )  # fmt: skip


def said(fit: Fit) -> str:
    """What was added, in words."""
    return ", ".join(describe(e.key, e.indices) for e in fit.added)


def with_offer(model: Model, offer: Offer) -> Model:
    """The model with candidates at the sizes of an offer, none far beyond what a workshop makes."""
    effects = []
    for (key, indices), sizes in zip(offer.names, offer.sizes, strict=True):
        most = np.array([0.7 * p.plausible for p in source(key).parameters])
        within = sizes / max(1.0, float((np.abs(sizes) / most).max()))
        effects.append(Effect(key, dict(indices), tuple(map(float, within))))
    return model.with_effects(*effects)


def equivalents(effect: Effect, unit: object) -> list[Effect]:
    """The same sizes, or the opposite, where contacts alone tell them from these."""
    entry, found = source(effect.key), []
    if entry.starts and all(p.least < 0 for p in entry.parameters):
        found.append(replace(effect, values=tuple(-v for v in effect.values)))
    choices = []
    for index in entry.indices:
        value = effect.indices[index.name]
        choices.append([(value, 1.0), *index.equivalents(unit, value)])  # type: ignore[arg-type]
    for combined in list(product(*choices))[1:]:
        indices = {index.name: value for index, (value, _) in zip(entry.indices, combined, strict=True)}
        sign = math.prod(s for _, s in combined)
        found.append(replace(effect, indices=indices, values=tuple(sign * v for v in effect.values)))
    return found


def started(effect: Effect) -> list[Effect]:
    """The cause at each of its starts."""
    plausible = [p.plausible for p in source(effect.key).parameters]
    return [
        replace(effect, values=tuple(float(s * p) for s, p in zip(start, plausible, strict=True)))
        for start in source(effect.key).starts
    ]


def distinct(trials: Sequence[Trial], most: int) -> list[Trial]:
    """So many at most, in order, of each set no more than two, whose last cause points elsewhere."""
    ahead: dict[object, list[Array]] = {}
    kept: list[Trial] = []
    for trial in trials:
        added = trial.fit.added
        sizes = np.concatenate([np.array(e.values) / [p.plausible for p in source(e.key).parameters] for e in added])
        way = sizes / max(float(np.linalg.norm(sizes)), 1e-300)
        name = frozenset(map(named, added)), round(trial.fit.model.index_offset / 0.1)
        others = ahead.setdefault(name, [])
        order = np.argsort([str(named(e)) for e in added])
        way = np.concatenate([np.split(way, np.cumsum([len(e.values) for e in added])[:-1])[i] for i in order])
        if len(others) < 2 and all(way @ other < 0.5 for other in others):
            others.append(way)
            kept.append(trial)
        if len(kept) == most:
            break
    return kept


def outlook(one: Hypothesis) -> tuple[bool, float]:
    """What the search goes by: a cause that no workshop makes, in a fit that is none, goes after all that one makes."""
    fit = one.fit
    sizes = [(abs(v), p.plausible) for e in fit.added for v, p in zip(e.values, source(e.key).parameters, strict=True)]
    odd = any(size > 2 * plausible for size, plausible in sizes)
    return odd and (fit.data > fit.bound or strained(fit)), one.score


def strained(fit: Fit) -> bool:
    """Tell whether sizes and stiffnesses lie farther from where they were declared than chance would put them."""
    first = sum(len(e.values) for e in fit.declared.effects)
    weights = fit.pull.copy()
    weights[first : sum(len(e.values) for e in fit.model.effects)] = 0.0
    return float(weights @ fit.off**2) > chi_square(fit.bench.policy.strained, max(int((weights > 0).sum()), 1))


def unsure(fit: Fit, policy: Policy) -> float:
    """Squares that the errors of the equilibrium itself leave."""
    return sum(float(r.kept.sum()) * (policy.model_error / r.noise.rms) ** 2 for r in fit.bench.records if r.noise)


def inexact(fit: Fit) -> float:
    """What the squares that the model's own errors leave count where a fit stands."""
    policy, data = fit.bench.policy, max(fit.data, fit.bound)
    own = unsure(fit, policy) + bent(fit, policy)
    return counted(data + own, fit.bound, policy) - counted(data, fit.bound, policy)


def bent(fit: Fit, policy: Policy) -> float:
    """Squares that the model's error about what was added leaves, a share of what it makes through the gear train."""
    seen = zip(fit.bench.sights, fit.added_parts, strict=True)
    return policy.added_share**2 * sum(float(np.sum(sight.whiten(part[None]) ** 2)) for sight, part in seen)


def marked(model: Model, offset: float) -> Model:
    """The model with its marks at an offset."""
    effects = tuple(replace(e, values=(offset,)) if source(e.key).acts == "marks" else e for e in model.effects)
    return replace(model, effects=effects)


def onto(bench: RunSet, fit: Fit) -> Fit:
    """The same sizes on another bench."""
    if fit.bench is bench:
        return fit
    near = all(a.turn == b.turn for a, b in zip(bench.conditions, fit.bench.conditions, strict=True))
    return evaluated(bench, fit.model, fit.declared, fit.waves if near else None)


def as_declared(fit: Fit) -> Fit:
    """Declared sizes and stiffness back at what was declared, if they can be; what was added stays."""
    count = len(fit.declared.effects)
    kept = [
        now if source(now.key).acts == "marks" else then
        for now, then in zip(fit.model.effects[:count], fit.declared.effects, strict=True)
    ]
    model = replace(fit.declared, effects=(*kept, *fit.model.effects[count:]))
    try:
        return evaluated(fit.bench, model, fit.declared, fit.waves)
    except NotConvergedError:  # what was added stands on the stiffness that was fitted with it
        return fit
