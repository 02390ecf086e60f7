"""The search: propose, refit at the load, compare by evidence, keep rivals until the data decide."""

from __future__ import annotations

import math
import operator
from collections import Counter, deque
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import combinations, product, takewhile
from typing import TypeVar

import numpy as np

from rverror.base.arrays import Array
from rverror.base.chance import chi_square
from rverror.base.text import describe
from rverror.base.threads import each
from rverror.diagnosis.gears.fit import (
    Fit,
    RunSet,
    as_compared,
    counted,
    evaluated,
    fitted,
    onto_samples,
)
from rverror.diagnosis.gears.jumps import fall
from rverror.diagnosis.gears.screen import Proposal, screened
from rverror.diagnosis.gears.spectrum import best_lines, explained
from rverror.diagnosis.gears.twins import Gaps
from rverror.diagnosis.gears.waveform import Named
from rverror.diagnosis.journal import Journal
from rverror.diagnosis.policy import Policy
from rverror.geartrain.kinematics import fundamental_orders
from rverror.geartrain.mechanism import Reducer
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.statics.loaded_state import NotConvergedError

T = TypeVar("T")
R = TypeVar("R")

_MARKS_APART = 0.1  # rad between marks from which a fit ends elsewhere
_RIPPLES = 3  # to either side of marks that were found: declared sizes are seldom known less well
_NOTHING = 1e-9  # of a size, core units: rounding
_BY_NOISE = 4.0  # standard deviations: noise goes beyond once in 16,000 values
_ELSEWHERE = 0.5  # cosine between sizes below which they are other sizes of one cause: 60 degrees


def identity(name: Named) -> tuple[object, ...]:
    """Key and indices, to compare."""
    return (name[0], *sorted(name[1].items()))


def named(effect: Effect) -> tuple[object, ...]:
    """`identity` of an effect."""
    return identity((effect.key, effect.indices))


@dataclass(frozen=True, eq=False)
class Node:
    """A set of causes, fitted.

    Attributes
    ----------
    fit : Fit
    lines : tuple of float
        Orders of free lines.
    slow : bool
        Whether each run drifts and settles by itself.
    score : float
        Minus twice the logarithm of the evidence, but for a constant: the less, the better.
    """

    fit: Fit
    lines: tuple[float, ...] = ()
    slow: bool = False

    @property
    def score(self) -> float:
        """Objective, and what every added size must be worth: its prior's width over what the runs leave of it."""
        fit, policy = self.fit, self.fit.bench.policy
        total, covariance = fit.objective, fit.covariance
        end = sum(len(e.values) for e in fit.declared.effects)
        for effect in fit.added:
            at = slice(end, end := end + len(effect.values))
            prior = np.array([policy.workshop * p.plausible for p in source(effect.key).parameters])
            total -= np.linalg.slogdet(covariance[at, at] / np.outer(prior, prior))[1]
        regular = 2 * len(self.lines) + (4 if self.slow else 0)
        return as_compared(float(total + regular * policy.row_cost * len(fit.bench.records)))

    @property
    def names(self) -> frozenset[object]:
        """Causes, to compare."""
        return (
            frozenset(named(e) for e in self.fit.added)
            | frozenset(round(o, 2) for o in self.lines)
            | ({"slow"} if self.slow else set())
        )


@dataclass(frozen=True, eq=False)
class Hunt:
    """What a search has at hand.

    Attributes
    ----------
    candidates : tuple of Named
    policy : Policy
    journal : Journal
    late : tuple of Named
        Candidates that are tried in place of two others, or last.
    pins : bool
        Whether pins too start from sizes that a workshop makes.
    offsets : tuple of float
        Where the gear's marks may be, where that is not known, the likeliest first, rad.
    patient : bool
        Whether, beside what was declared, the best of every source is fitted to its end before any falls.
    """

    candidates: tuple[Named, ...]
    policy: Policy
    journal: Journal
    late: tuple[Named, ...] = ()
    pins: bool = False
    offsets: tuple[float, ...] = ()
    patient: bool = False
    _coarse: dict[object, RunSet] = field(default_factory=dict, repr=False)
    _completed: dict[int, tuple[Fit, bool]] = field(default_factory=dict, repr=False)
    _ranked: dict[int, tuple[Fit, list[Proposal]]] = field(default_factory=dict, repr=False)
    _kept_gaps: list[Gaps] = field(default_factory=list, repr=False)
    _rivals: dict[object, list[Node]] = field(default_factory=dict, repr=False)
    _turned: dict[str, Node] = field(default_factory=dict, repr=False)

    def with_candidates(self, candidates: tuple[Named, ...], *, pins: bool = False) -> Hunt:
        """The same with other candidates, none late; what was said of a fit under these does not hold under those."""
        return replace(
            self, candidates=candidates, late=(), pins=pins, _completed={}, _ranked={}, _rivals={}, _turned={}
        )

    def widened(self) -> Hunt:
        """The same with more candidates in each race, and patience."""
        policy = self.policy
        more = {name: policy.wider * getattr(policy, name) for name in ("evaluated", "stepped", "refitted")}
        return replace(self, policy=replace(policy, **more), patient=True)

    def coarse(self, node: Node) -> RunSet:
        """The runs in few numbers, on few angles: near enough to choose whom to refit."""
        bench = node.fit.bench
        key = tuple((id(r.noise), r.orders, r.slow, int(r.kept.sum()), r.slips) for r in bench.records)
        if key not in self._coarse:
            made = RunSet.of(
                bench.unit, bench.records, self.policy, points=self.policy.coarse, anywhere=bench.anywhere,
                exponents=False,
            )  # fmt: skip
            beyond = tuple(
                c for c in (*self.candidates, *((e.key, e.indices) for e in node.fit.declared.effects))
                if source(c[0]).acts != "marks" and (source(c[0]).at_output or source(c[0]).frame == "sun")
            )  # fmt: skip
            self._coarse[key] = replace(made, few=beyond or (("", {}),))
        return self._coarse[key]

    # --- propose ------------------------------------------------------------------------------------------------------

    def free(self, fit: Fit, *, late: bool = False) -> list[Named]:
        """Candidates that a model does not have."""
        taken = {named(e) for e in fit.model.effects}
        return [c for c in (*self.candidates, *(self.late if late else ())) if identity(c) not in taken]

    def proposals(self, settled: Fit, plains: Sequence[Fit]) -> list[tuple[Fit, Proposal]]:
        """Candidates by what a linear step promises, the best first: from the sizes as declared, and from the fitted.

        Fitted sizes are of use only where they fit: elsewhere they have moved to make up for what is missing.  They may
        have where they fit, too, and hide it: there a step is also made with everything held as declared, and what is
        tried last is among the candidates.
        """
        fits = settled.data < settled.bound
        free = self.free(settled, late=fits)
        offers = each(lambda state: screened(state, free), plains)
        pairs = [(state, one) for state, found in zip(plains, offers, strict=True) for one in found]
        pairs.sort(key=lambda pair: pair[1].objective)
        if not fits:
            return pairs
        near = [(settled, one) for one in screened(settled, free)]
        held = [(plains[0], one) for one in screened(plains[0], free, hold=True)]
        return [pair for three in zip(pairs, near, held, strict=False) for pair in three]

    def significant(self, fit: Fit, gain: float, parameters: int) -> bool:
        """Tell whether neither chance nor what the model is not right to lowers the objective as much."""
        return gain > self._chance(parameters) + inexact(fit)

    def _chance(self, parameters: int) -> float:
        """What chance alone hardly lowers the objective by."""
        return chi_square(self.policy.false_alarm / max(len(self.candidates), 1), parameters)

    def _better(self, less: Node, more: Node, judged: Fit) -> bool:
        """Tell whether a set with more in it is significantly better; the model's error at a fit never settles."""
        own = 0.0 if more.slow > less.slow else inexact(judged)
        return fall(less.fit, more.fit) > self._chance(self._sizes(more, less)) + own

    # --- refit at the load --------------------------------------------------------------------------------------------

    def children(self, node: Node) -> list[Node]:
        """The node with one cause more, for the leading ones, refitted, the best first."""
        policy = self.policy
        nodes = self._direct(node)
        if self._found(nodes):
            return nodes
        regular = self._regular(node)
        if node.fit.data <= node.fit.bound and any(map(self.complete, regular)):
            return sorted(nodes + regular, key=lambda n: n.score)
        settled = onto(self.coarse(node), node.fit)
        plain = as_declared(settled)
        # what is missing decides where the marks are as much as what was declared
        offsets = () if node.fit.added else self.offsets[: policy.offsets]
        plains = each(partial(turned_to, plain), offsets) or [plain]
        offers = self.proposals(settled, plains)
        most = policy.evaluated * min(len(plains), 3)
        trials = self._tried(offers[:most])
        ahead = {identity(one.name) for _, one in offers[:most]}
        for _, one in offers[most:]:
            if identity(one.name) not in ahead:
                first = offers[0][1]
                self._fell(one.name, "a linear step may leave", one.objective - first.objective, first.name)
        nodes = sorted(nodes + self._fine(node, self._raced(trials)), key=lambda n: n.score)
        if nodes and not self.complete(nodes[0]):
            nodes[0] = self.remarked(nodes[0])
        # what is added at the output alone opens no contact: beside it all is as beside nothing
        bare = all(source(e.key).at_output for e in node.fit.added)
        if self.patient and bare and not self._found(nodes):
            ends = distinct(self._settled(self._tried(leading_of_each(offers, policy.of_each))), 2)
            nodes = sorted(nodes + self._fine(node, ends), key=lambda n: n.score)
        lost = bare and not nearly_noise(node.fit)
        lost = lost and not any(explains_most(child.fit, node.fit) for child in (*nodes, *regular))
        if (lost or (self.patient and bare)) and not self._found(nodes):
            nodes = sorted(nodes + self._fine(node, self.loosened(plain)), key=lambda n: n.score)
        if not self._found(nodes):
            plain = min(plains, key=lambda p: p.objective)
            found = {named(n.fit.added[-1]) for n in nodes}
            every = offers + self._barred(plain, offers)
            pins = [
                offer for offer in every
                if identity(offer[1].name) in found or ((lost or self.patient) and "pin" not in offer[1].name[1])
            ]  # fmt: skip
            more = workshop(every, pins=False) + workshop(offers[: policy.evaluated] if self.pins else pins, pins=True)
            more += mirrored(nodes, offers)
            ends = self._raced(self._tried([(plain, one) for one in more])) + self.alike(plain)
            nodes += self._fine(node, distinct(in_order(ends), 2))
        return sorted(nodes + regular, key=lambda n: n.score)

    def _found(self, nodes: Sequence[Node]) -> bool:
        """Tell whether the best of nodes is complete."""
        return bool(nodes) and self.complete(nodes[0])

    def _barred(self, plain: Fit, offers: Sequence[tuple[Fit, Proposal]]) -> list[tuple[Fit, Proposal]]:
        """Candidates of which a linear step makes less than nothing, as a clearance: far from it they may do well."""
        offered = {identity(one.name) for _, one in offers}
        return [(plain, unsized(name)) for name in self.free(plain) if identity(name) not in offered]

    def alike(self, plain: Fit, *, below: float = math.inf) -> list[Trial]:
        """What is the same at all pins and cranks, from the sizes of a workshop, each at the best place it ends at.

        A modified profile makes but a ripple of the mesh, and of a carrier whose discs balance only what is quadratic
        is left: both show by the contacts that open.  No linear step tells their size, and a race of a few steps drops
        them where they are about to fit.  Material that comes on all over would jam the mesh.
        """
        names = [name for name in self.free(plain) if self._everywhere(name)]
        starts = workshop([(plain, unsized(name)) for name in names], pins=False)
        offers = [(plain, one) for one in starts if one.sizes.max() > _NOTHING]
        return distinct(self._settled(self._tried(offers), below=below), 1)

    def loosened(self, plain: Fit) -> list[Trial]:
        """What opens contacts everywhere, of sizes that a workshop makes, with one cause more: alone neither may show.

        A profile that was ground off or a clearance leaves a pin to carry what several would; without it the pin's fit
        ends elsewhere, and alone a clearance is driven back to nothing.  Of a carrier's runout no linear step tells, so
        that is for patience.
        """
        clearances = [name for name in self.free(plain) if all(p.least == 0 for p in source(name[0]).parameters)]
        names = clearances + [name for name in self.free(plain) if self._everywhere(name)]
        starts = workshop([(plain, unsized(name)) for name in names], pins=False)
        bases = [trial.fit for trial in self._tried([(plain, one) for one in starts])]
        offers = [(base, one) for base in bases for one in screened(base, self.free(base))]
        offers.sort(key=lambda offer: offer[1].objective)
        ends = self._raced(self._tried(offers[: self.policy.evaluated]))
        if self.patient:
            cleared = [base for base in bases if (base.added[-1].key, base.added[-1].indices) in clearances]
            ends += [end for base in cleared for end in self.alike(base, below=plain.objective)]
        return in_order(ends)

    @staticmethod
    def _everywhere(name: Named) -> bool:
        """Tell whether a cause is the same at all pins and cranks and lets contacts go."""
        return not name[1] and source(name[0]).false_minima

    def hidden(self, node: Node) -> Node | None:
        """A complete node with what is the same at all pins and cranks, where it stands behind what was fitted."""
        coarse = fitted(onto(self.coarse(node), node.fit))
        ends = self.alike(as_declared(coarse))[:1]
        if not ends or not self.significant(coarse, coarse.objective - ends[0].fit.objective, 1):
            return None
        (found,) = self._fine(node, ends)
        return found if self._better(node, found, node.fit) else None

    def _direct(self, node: Node) -> list[Node]:
        """The node with what leads over every sample, refitted: few angles are too few where it fits."""
        if node.fit.data > node.fit.bound:
            return []
        fits = self._each_fitted(node.fit, self.ranking(node.fit)[: self.policy.direct])
        return sorted((Node(fit, node.lines, node.slow) for fit in fits), key=lambda n: n.score)

    def _tried(self, offers: Sequence[tuple[Fit, Proposal]]) -> list[Trial]:
        """Each candidate at the size that it would take, where there is an equilibrium."""
        return [trial for trial in each(lambda offer: tried(*offer), offers) if trial]

    def _each_fitted(self, fit: Fit, leading: Sequence[Proposal]) -> list[Fit]:
        """The fit with each of the candidates, everything refitted."""
        trials = self._tried([(fit, one) for one in leading])
        return each(lambda trial: fitted(trial.fit, steps=30, enough=0.3), trials)

    def _stepped(self, trials: Sequence[Trial], steps: int) -> list[Trial]:
        return each(lambda trial: stepped(trial, steps), trials)

    def _raced(self, trials: Sequence[Trial]) -> list[Trial]:
        """Successive halving: one joint step for the most promising, all steps for the best of these."""
        policy = self.policy
        kept = self._ahead(trials, policy.stepped, 3, "solved at the load: may leave")
        kept = self._ahead(self._stepped(kept, 1), policy.refitted + 3, 2, "after one joint step: may leave")
        kept = self._ahead(self._stepped(kept, 2), policy.refitted, 2, "after three joint steps: may leave")
        return in_order(self._stepped(kept, 12))

    def _settled(self, trials: Sequence[Trial], *, below: float = math.inf) -> list[Trial]:
        """Where trials end, the best first: a race of a few steps drops what opens contacts when it is about to fit.

        What promises no objective below a bound after half of the steps falls.
        """
        halfway = in_order(self._stepped(trials, self.policy.halfway))[: self.policy.stepped]
        return in_order(self._stepped([trial for trial in halfway if trial.prospect < below], self.policy.halfway))

    def _ahead(self, trials: Sequence[Trial], most: int, of_each: int, why: str) -> list[Trial]:
        """The most promising trials; it is written down why the others fell."""
        ordered = distinct(sorted(trials, key=lambda t: t.prospect), of_each)
        kept = {named(t.fit.added[-1]) for t in ordered[:most]}
        for trial in distinct(ordered[most:], 1):
            last, best = trial.fit.added[-1], ordered[0].fit.added[-1]
            if named(last) not in kept:
                self._fell(
                    (last.key, last.indices), why, trial.prospect - ordered[0].prospect, (best.key, best.indices)
                )
        return ordered[:most]

    def _fell(self, name: Named, why: str, more: float, best: Named) -> None:
        self.journal.note("fell", name, f"{why} {more:.3g} more than {describe(*best)}")

    def _fine(self, node: Node, raced: Sequence[Trial]) -> list[Node]:
        """The best of a race, fitted to every sample; those behind only where they are near, or it leaves something."""

        def fine(trial: Trial) -> Node:
            steps = 30 if trial is raced[0] else 10
            return Node(fitted(onto(node.fit.bench, trial.fit), steps=steps, enough=0.3), node.lines, node.slow)

        policy = self.policy
        behind = [trial.fit.objective - raced[0].fit.objective for trial in raced]
        near = len(list(takewhile(lambda more: more <= policy.close, behind)))
        nodes = each(fine, raced[:near])
        for trial, more in list(zip(raced, behind, strict=True))[near : policy.finest]:
            fits = any(node.fit.data <= node.fit.bound for node in nodes)
            if any(map(self.complete, nodes)) or (fits and more > 5 * policy.close):
                break
            nodes.append(fine(trial))
        return sorted(nodes, key=lambda n: n.score)

    def _regular(self, node: Node) -> list[Node]:
        """The node with what is regular and no part's: the strongest free line, or runs that drift and settle."""
        found = []
        records = node.fit.bench.records
        if self._settles(node):
            bench = node.fit.bench.with_records([replace(r, slow=True) for r in records])
            found.append(Node(fitted(onto(bench, node.fit)), node.lines, slow=True))
        for line in best_lines(node.fit, self.policy, outside=True)[:1]:
            lined = [replace(r, orders=(*r.orders, line.order)) for r in records]
            fit = onto(node.fit.bench.with_records(lined), node.fit)
            found.append(Node(fitted(fit), (*node.lines, line.order), node.slow))
        return found

    def _settles(self, node: Node) -> bool:
        """Tell whether drift or settling is left of runs that are long enough to tell it from an encoder's error."""
        records = node.fit.bench.records
        if node.slow or any(r.turns <= self.policy.settles for r in records):
            return False
        slow = [r.settling for r in records]
        return explained(records, onto_samples(node.fit), slow)[0] > self._chance(sum(map(len, slow)))

    # --- compare ------------------------------------------------------------------------------------------------------

    def complete(self, node: Node) -> bool:
        """Tell whether nothing significant is left for any candidate or line, and no declared size is strained."""
        if id(node.fit) not in self._completed:
            self._completed[id(node.fit)] = (node.fit, self._is_complete(node))
        return self._completed[id(node.fit)][1]

    def _is_complete(self, node: Node) -> bool:
        return node.fit.data <= node.fit.bound and self._nothing_left(node)

    def _nothing_left(self, node: Node) -> bool:
        fit = node.fit
        if strained(fit) or self._line_left(fit) or self._settles(node):
            return False
        leading = self.ranking(fit)[:5]
        if any(self.significant(fit, fit.objective - one.objective, one.sizes.size) for one in leading):
            return False
        # a linear step promises too little where sizes have moved to make up for a cause: what comes near is fitted
        near = [
            one for one in leading[: self.policy.direct]
            if fit.objective - one.objective > chi_square(self.policy.false_alarm, one.sizes.size)
        ]  # fmt: skip
        return not any(
            self.significant(fit, fall(fit, more), len(more.added[-1].values)) for more in self._each_fitted(fit, near)
        )

    def only_faults(self, node: Node) -> bool:
        """Tell whether a set that is not noise leaves nothing to look for but faults of the readings."""
        return bool(node.fit.added) and nearly_noise(node.fit) and self._nothing_left(node)

    def _line_left(self, fit: Fit) -> bool:
        """Tell whether a line is left that noise hardly ever makes; what it makes in one of a thousand runs is told."""
        chance = math.erfc(self.policy.by_chance / math.sqrt(2)) / 2
        return bool(best_lines(fit, replace(self.policy, false_alarm=chance), outside=False))

    def ranking(self, fit: Fit) -> list[Proposal]:
        """Candidates by what a linear step promises beside a fit, made once."""
        if id(fit) not in self._ranked:
            self._ranked[id(fit)] = (fit, screened(fit, self.free(fit)))
        return self._ranked[id(fit)][1]

    def swapped(self, node: Node) -> Node:
        """The node with each cause, or two of them, replaced by one that fits better in their place, if any does."""
        (node,) = self._refitted([node.fit], node)  # as far as its rivals are, or a twin would win by steps alone
        for _ in range(self.policy.most_effects):
            count = range(len(node.fit.added))
            others = [rival for at in count for rival in self.rivals(node, at)]
            if improved(node, others) is node:
                others += [one for pair in combinations(count, 2) for one in self.rivals(node, *pair)]
                others.append(self.remarked(node))
            better = improved(node, others)
            if better is node:
                return node
            node = self.pruned(better)  # with it others may be needless
        return node

    def restarted(self, node: Node) -> Node:
        """The node with its pins' causes begun anew at workshop sizes, if they end at a better place then.

        Beside what another cause had spoilt they may have come to where they are, and contacts that open keep them.  So
        does a pin that stands for the one beside it.  What one of them has found lets another go on.
        """
        waiting = deque(e for e in node.fit.added if source(e.key).frame == "housing")  # what turns was, in every race
        idle = 0
        for _ in range(self.policy.most_effects * len(waiting)):
            if idle == len(waiting) or self.complete(node):  # no other one has moved since each was begun
                break
            effect, before = waiting.popleft(), node
            node = self._begun_anew(node, effect)
            idle = idle + 1 if node is before else 1
            waiting.append(effect if node is before else node.fit.added[-1])
        return node

    def _begun_anew(self, node: Node, effect: Effect) -> Node:
        others = tuple(other for other in node.fit.model.effects if named(other) != named(effect))
        plain = begun_at(self.coarse(node), replace(node.fit.model, effects=others), node.fit.declared)
        if plain is None:  # the others stand on it
            return node
        whole_turn = any(record.turns >= 1 for record in plain.bench.records)
        where = places(effect, plain.bench.unit, self.free(plain), whole_turn=whole_turn)
        offers = [(plain, one) for one in screened(plain, where)]
        more = [(plain, one) for one in workshop(offers, pins=True)]
        below = fitted(onto(self.coarse(node), node.fit)).objective - 1
        settled = [end for end in self._settled(self._tried(more), below=below) if end.fit.objective < below]
        return improved(node, self._fine(node, distinct(settled, 2)))

    def transposed(self, node: Node) -> Node:
        """The node with its causes on other discs and cranks or the opposite, all at once, if they do better there.

        Contacts alone tell such places apart.  Of causes that were found beside one another the first holds the next in
        a wrong place with it: neither does better there alone.
        """
        if len(node.fit.added) < 2 or self.complete(node):
            return node
        fit = as_declared(onto(self.coarse(node), node.fit))
        unit, kept = fit.bench.unit, fit.model.effects[: len(fit.declared.effects)]
        others = [elsewhere(e, unit, [*self.free(fit), (e.key, e.indices)]) for e in fit.added]
        sets = [one for one in product(*others) if len(set(map(named, one))) == len(one) and one != fit.added]
        sets.sort(key=lambda one: sum(map(operator.ne, one, fit.added)))
        # three causes, each on two discs or cranks with either sign, are 63 such sets: nearly all are tried
        models = [replace(fit.model, effects=(*kept, *one)) for one in sets[: 2 * self.policy.evaluated]]
        trials = [trial for trial in each(partial(trial_of, fit), models) if trial]
        trials = sorted(trials, key=lambda trial: trial.prospect)[: self.policy.stepped]
        return improved(node, self._fine(node, in_order(self._stepped(trials, self.policy.halfway))[:2]))

    def remarked(self, node: Node) -> Node:
        """The node with the gear's marks elsewhere, if they are not known and its one cause does better then.

        A cause of one order is turned by wrong marks as it is by its own angle: only what was declared, and contacts,
        tell them.  All causes of a key are tried at all marks, so another one of that key has the same answer.  So is
        the cause as it was fitted: what is fixed in the housing hardly turns with the marks.
        """
        fit = node.fit
        if not self.offsets or len(fit.added) != 1:
            return node
        key = fit.added[0].key
        alike = [one for one in self.candidates if one[0] == key]
        if key not in self._turned or self._turned[key].fit.bench is not fit.bench:
            coarse = evaluated(self.coarse(node), fit.declared, fit.declared)
            own = as_declared(onto(self.coarse(node), fit))

            def at(offset: float) -> list[Trial]:
                state = turned_to(coarse, offset)
                trials = [tried(state, one) for one in screened(state, alike)[:2]]
                return [trial for trial in (*trials, stood(own, offset)) if trial]

            trials = [trial for found in each(at, self.offsets) for trial in found]
            self._turned[key] = min([node, *self._fine(node, self._raced(trials))], key=lambda n: n.score)
        found = min(node, self._turned[key], key=lambda n: n.score)
        return found if self.complete(found) else self._rippled(found, alike)

    def _rippled(self, node: Node, alike: Sequence[Named]) -> Node:
        """The node with its cause, if it is fixed in the housing, some ripples of the marks apart, in its place there.

        As pins begin and cease to carry the error ripples, and few angles do not tell one ripple from another.
        """
        fit = node.fit
        if source(fit.added[0].key).frame != "housing":
            return node
        less = replace(fit.model, effects=fit.model.effects[:-1])

        def at(angle: float) -> Node | None:
            offset = fit.model.index_offset + angle
            state = begun_at(fit.bench.anchored(offset), marked(less, offset), fit.declared, fresh=False)
            leading = screened(state, alike)[:1] if state else []
            trial = tried(state, leading[0]) if state and leading else None
            return Node(fitted(trial.fit, steps=30, enough=0.3), node.lines, node.slow) if trial else None

        others = [at(angle) for angle in (0.0, *ripples(fit.bench.unit))]
        return improved(node, [other for other in others if other])

    def ripples_apart(self, node: Node) -> tuple[Node, list[Fit]]:
        """The node at the best of marks that are ripples of the cycloid mesh apart, and fits that chance does not tell.

        As pins begin and cease to carry the error ripples, and the objective has a minimum at every ripple: what was
        declared and found turns with the marks, within what is known of it.
        """
        fit = node.fit
        found = each(partial(turned_by, fit), ripples(fit.bench.unit))
        fits = [fit, *(one for one in found if one)]
        best = min(fits, key=lambda one: as_compared(one.objective))
        chance = chi_square(1 - self.policy.confidence, 1)
        alike = [one for one in fits if one is not best and one.objective - best.objective < chance]
        return Node(best, node.lines, node.slow), alike

    def opposites(self, node: Node) -> list[Fit]:
        """Fits at the opposite of what was added that chance does not tell from it.

        Where all that shows of a cause is quadratic, as of a carrier whose discs balance, other errors tell its sign.
        """
        coarse, found = onto(self.coarse(node), node.fit), []
        chance = node.fit.objective + chi_square(1 - self.policy.confidence, 1)
        for number, effect in enumerate(coarse.model.effects):
            if number < len(coarse.declared.effects) or not source(effect.key).false_minima:
                continue
            turned = replace(effect, values=tuple(-value for value in effect.values))
            effects = (*coarse.model.effects[:number], turned, *coarse.model.effects[number + 1 :])
            near = begun_at(coarse.bench, replace(coarse.model, effects=effects), coarse.declared, fresh=False)
            near = fitted(near, steps=self.policy.halfway) if near else coarse
            stays = np.dot(near.model.effects[number].values, effect.values) < 0
            if stays and near.objective < coarse.objective + self.policy.close:
                found += [end.fit for end in self._refitted([near], node) if end.fit.objective < chance]
        return found

    def pruned(self, node: Node) -> Node:
        """The node without causes and lines that later ones have made needless."""
        while True:
            less = each(partial(self.without, node), range(len(node.fit.added)))
            less += [self.without_line(node, order) for order in node.lines]
            less += [self.without_drift(node)] if node.slow else []
            needless = [one for one in less if not self._better(one, node, node.fit)]
            if not needless:
                return node
            node = min(needless, key=lambda n: n.score)

    def _sizes(self, node: Node, less: Node) -> int:
        """Number of sizes that one node has more than another."""
        more = sum(len(e.values) for e in node.fit.added) - sum(len(e.values) for e in less.fit.added)
        regular = 2 * (len(node.lines) - len(less.lines)) + 4 * (node.slow - less.slow)
        return more + regular * len(node.fit.bench.records)

    def without(self, node: Node, number: int) -> Node:
        """The node without one cause, refitted; a few steps tell where not even a linear one promises enough."""
        effects, at = node.fit.model.effects, len(node.fit.declared.effects) + number
        model = replace(node.fit.model, effects=effects[:at] + effects[at + 1 :])
        fit = fitted(evaluated(node.fit.bench, model, node.fit.declared), steps=4)
        if fit.objective - fit.proposal[1] < node.fit.objective + 5 * self.policy.close:
            fit = fitted(fit)
        return Node(fit, node.lines, node.slow)

    def without_line(self, node: Node, order: float) -> Node:
        """The node without one free line, refitted."""
        records = [replace(r, orders=tuple(o for o in r.orders if o != order)) for r in node.fit.bench.records]
        fit = fitted(onto(node.fit.bench.with_records(records), node.fit))
        return Node(fit, tuple(o for o in node.lines if o != order), node.slow)

    def without_drift(self, node: Node) -> Node:
        """The node without what drifts and settles, refitted."""
        records = [replace(r, slow=False) for r in node.fit.bench.records]
        return Node(fitted(onto(node.fit.bench.with_records(records), node.fit)), node.lines)

    def rivals(self, node: Node, *numbers: int) -> list[Node]:
        """The node with other causes in one's place, or one in two's, that fit nearly as well, the best first.

        They are looked for once; under noise that is known better they are only refitted.
        """
        key = (node.names, frozenset(named(node.fit.added[n]) for n in numbers))
        known = self._rivals.get(key)
        if known is None:
            known = self._found_rivals(node, *numbers)
        elif any(rival.fit.bench is not node.fit.bench for rival in known):
            known = self._refitted([rival.fit for rival in known], node)
        self._rivals[key] = sorted(known, key=lambda n: n.score)
        return self._rivals[key]

    def as_good(self, node: Node, number: int) -> tuple[Named, ...]:
        """Other causes that fit as well in one's place, by evidence or by objective."""
        behind = -2 * math.log(self.policy.alike)
        return tuple(
            (rival.fit.added[-1].key, dict(rival.fit.added[-1].indices))
            for rival in self.rivals(node, number)
            if min(rival.score - node.score, rival.fit.objective - node.fit.objective) < behind
        )

    def _found_rivals(self, node: Node, *numbers: int) -> list[Node]:
        """Causes of the same gaps, elsewhere, or alike to first order; refitted where they come close."""
        coarse = onto(self.coarse(node), node.fit)
        rest, free = coarse, self.free(coarse, late=True)
        for number in sorted(numbers, reverse=True):
            rest = lifted(rest, number)
        exact: list[Effect] = []
        others: list[Effect] = []
        if len(numbers) == 1:
            effect = coarse.added[numbers[0]]
            exact = self._gaps(coarse.bench.unit).twins(effect, free)
            others = elsewhere(effect, coarse.bench.unit, free)
            others += self._gaps(coarse.bench.unit).near(effect, free, self.policy.near_gaps)
        rows = rest.bench.influences(rest.model, rest.waves, free)
        for hold in (False, True):
            leading = screened(rest, free, rows, hold=hold)[: self.policy.rivals]
            others += [Effect(one.name[0], dict(one.name[1]), tuple(map(float, one.sizes))) for one in leading]

        def instead(other: Effect) -> Trial | None:
            trial = trial_of(coarse, replace(rest.model, effects=(*rest.model.effects, other)))
            return replace(trial, prospect=-math.inf) if trial and other in exact else trial

        trials = [trial for trial in each(instead, [*exact, *others]) if trial]
        far = coarse.objective + 5 * self.policy.close
        ordered = distinct(sorted((t for t in trials if t.prospect < far), key=lambda t: t.prospect), 1)
        ordered = ordered[: self.policy.rivals // 2]
        ends = self._stepped(ordered, 8)
        twins = ends[: sum(trial.prospect == -math.inf for trial in ordered)]  # they are where they belong
        gone = [coarse.added[number] for number in numbers]
        felt_alone = len(gone) == 1 and not source(gone[0].key).at_output  # a ripple stands for nothing at the output
        bare = begun_at(coarse.bench, rest.model, coarse.declared) if felt_alone else None
        more = self.alike(bare, below=far) if bare else []
        fits = [end.fit for end in (*twins, *distinct(in_order([*ends[len(twins) :], *more]), 1))]
        least = min((fit.objective for fit in fits), default=math.inf)
        near = [
            fit for fit in fits
            if named(fit.added[-1]) not in map(named, gone)
            and fit.objective < min(coarse.objective, least) + self.policy.close
        ]  # fmt: skip
        found = dict[object, Node]()
        for rival in sorted(self._refitted(near, node), key=lambda n: n.score):
            found.setdefault(rival.names, rival)
        return list(found.values())

    def _refitted(self, fits: Sequence[Fit], node: Node) -> list[Node]:
        """Fits over every sample of a node's runs."""
        bench = node.fit.bench
        return each(lambda fit: Node(fitted(onto(bench, fit)), node.lines, node.slow), fits)

    def _gaps(self, unit: Reducer) -> Gaps:
        if not self._kept_gaps:
            self._kept_gaps.append(Gaps(unit, self.policy.same_gaps))
        return self._kept_gaps[0]

    def best(self, roots: Sequence[Node], expansions: int) -> tuple[Node, bool]:
        """Search from roots, in their order: the node with the most evidence, and whether nothing is left beside it."""
        waiting, seen = list(roots), list(roots)
        last = self.with_candidates(self.late) if self.late else None
        looked: dict[frozenset[object], float] = {}
        while waiting and len(looked) < expansions:
            node = self.pruned(waiting.pop(0))
            if last and node.fit.added and node.fit.data < node.fit.bound and not self.complete(node):
                # what strains or leaves a little may be one cause of a kind that is tried last, before it is two
                bare = min(roots, key=lambda n: len(n.names))
                waiting = sorted([*waiting, node, *last.beside(bare, seen)], key=outlook)
                first, last = waiting.pop(0), None
                node = node if first is node else self.pruned(first)
            if node.fit.data <= node.fit.bound:  # what fits, but only by what it strains, has a cause in a wrong place
                node = self.transposed(node)
            if node.score > looked.get(node.names, math.inf) - 1:
                continue  # several ways lead to one set
            looked[node.names] = node.score
            if not self.complete(node):
                node = self.restarted(node)
            full = len(node.fit.added) == self.policy.most_effects and node.fit.data <= node.fit.bound
            if full and not self.complete(node):
                node = self.swapped(node)
            seen.append(node)
            if self.complete(node):
                more = self.hidden(node) if len(node.fit.added) < self.policy.most_effects else None
                if more is None:
                    return self.swapped(node), True
                waiting.insert(0, more)
                continue
            if self.only_faults(node):
                return node, False
            waiting = self._in_turn([*waiting, *self.beside(node, seen)], looked)[: self.policy.branches]
        best, least = min(seen, key=lambda n: n.score), min(roots, key=lambda n: len(n.names))
        if explains_most(best.fit, least.fit):  # one of its causes may be a wrong one
            best = self.swapped(best)
        return best, self.complete(best)

    def _in_turn(self, waiting: Sequence[Node], looked: Collection[frozenset[object]]) -> list[Node]:
        """Sets in the order in which they are looked beside: the most promising first, but where a search is patient.

        There several single causes go before any pair: the wrong one and a second nearly always beat the right one.
        """
        few = self.patient and sum(len(names) == 1 for names in looked) < self.policy.breadth

        def turn(node: Node) -> tuple[bool, tuple[bool, float]]:
            return few and len(node.names) > 1 and node.fit.data > node.fit.bound, outlook(node)

        return sorted(waiting, key=turn)

    def beside(self, node: Node, seen: list[Node]) -> list[Node]:
        """Children that are better than a node by more than chance and new; all better ones are added to those seen."""
        self.journal.tell(
            f"looking beside {', '.join(describe(e.key, e.indices) for e in node.fit.added) or 'what was declared'}"
        )
        self.journal.round += 1
        found = []
        most = len(node.fit.added) == self.policy.most_effects
        for child in self._regular(node) if most else self.children(node):
            if self._better(node, child, node.fit):
                if all(child.names != other.names for other in seen):
                    found.append(child)
                seen.append(child)
        return found


def improved(node: Node, others: Sequence[Node]) -> Node:
    """The best of other nodes, if it is better than one by more than fits that have settled differ; else that one."""
    best = min(others, key=lambda n: n.score, default=node)
    return best if best.score < node.score - 1 else node


def outlook(node: Node) -> tuple[bool, float]:
    """What the search goes by: a cause that no workshop makes, in a fit that is none, goes after all that one makes."""
    fit = node.fit
    sizes = [(abs(v), p.plausible) for e in fit.added for v, p in zip(e.values, source(e.key).parameters, strict=True)]
    odd = any(size > 2 * plausible for size, plausible in sizes)
    return odd and (fit.data > fit.bound or strained(fit)), node.score


def strained(fit: Fit) -> bool:
    """Tell whether sizes and stiffnesses lie farther from where they were declared than chance would put them."""
    first = sum(len(e.values) for e in fit.declared.effects)
    weights = fit.pull.copy()
    weights[first : sum(len(e.values) for e in fit.model.effects)] = 0.0
    return float(weights @ fit.off**2) > chi_square(fit.bench.policy.strained, max(int((weights > 0).sum()), 1))


def explains_most(fit: Fit, before: Fit) -> bool:
    """Tell whether a fit takes off more than half of what another leaves beyond noise."""
    return fit.data - fit.bound < (before.data - before.bound) / 2


def nearly_noise(fit: Fit) -> bool:
    """Tell whether faults of the readings that were not seen before may be all that is left beside noise.

    A fault is large in few values and what is missing shows in all, so none counts as more than noise makes it.
    """
    squares = sum(float(np.minimum(white[0] ** 2, _BY_NOISE**2).sum()) for white in fit.rows)
    return squares <= fit.bench.policy.nearly_noise * fit.bound


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


def distinct(trials: Sequence[Trial], most: int) -> list[Trial]:
    """So many of each cause, with marks about one angle, at most, whose sizes point elsewhere, in order."""
    ahead: dict[object, list[Array]] = {}
    kept = []
    for trial in trials:
        last = trial.fit.added[-1]
        sizes = np.array(last.values) / [p.plausible for p in source(last.key).parameters]
        way = sizes / max(float(np.linalg.norm(sizes)), 1e-300)
        marks = round(trial.fit.model.index_offset / _MARKS_APART)
        others = ahead.setdefault((named(last), marks), [])
        if len(others) < most and all(way @ other < _ELSEWHERE for other in others):
            others.append(way)
            kept.append(trial)
    return kept


def places(effect: Effect, unit: Reducer, free: Sequence[Named], *, whole_turn: bool) -> list[Named]:
    """The same cause, and of a pin all that is free of it and of those beside it, which carry next.

    Of a wave of the pins also those of other harmonics, where no run goes round: over a part of a turn they look alike.
    """
    pin, own = effect.indices.get("pin"), (effect.key, effect.indices)
    near = {(pin + step) % unit.pins for step in (-1, 0, 1)} if isinstance(pin, int) else set[int]()
    others = [
        (key, indices) for key, indices in free
        if indices.get("pin") in near or (key == effect.key and "harmonic" in indices and not whole_turn)
    ]  # fmt: skip
    return [own, *(name for name in others if identity(name) != identity(own))]


def elsewhere(effect: Effect, unit: Reducer, free: Sequence[Named]) -> list[Effect]:
    """The same cause of the same or the opposite sizes on other cranks and discs: contacts alone tell such apart.

    Of a pin the one that another disc meets as this disc meets it.
    """
    places = ("crank", "disc", "pin")
    kept = {k: v for k, v in effect.indices.items() if k not in places}
    found = []
    for key, indices in free:
        if key != effect.key or {k: v for k, v in indices.items() if k not in places} != kept:
            continue
        if isinstance(indices.get("pin"), int) and isinstance(effect.indices.get("pin"), int):
            apart = (int(indices["pin"]) - int(effect.indices["pin"])) * unit.discs
            if apart % unit.pins:
                continue
        signs = (1.0, -1.0) if all(p.least < 0 for p in source(key).parameters) and "pin" not in indices else (1.0,)
        found += [Effect(key, dict(indices), tuple(sign * v for v in effect.values)) for sign in signs]
    return found


def leading_of_each(offers: Sequence[tuple[Fit, Proposal]], most: int) -> list[tuple[Fit, Proposal]]:
    """So many offers of each source, in order."""
    counts = Counter[str]()
    result = []
    for state, one in offers:
        counts[one.name[0]] += 1
        if counts[one.name[0]] <= most:
            result.append((state, one))
    return result


def unsized(name: Named) -> Proposal:
    """A candidate of which no linear step tells the size."""
    return Proposal(name, math.inf, np.zeros(len(source(name[0]).parameters)), np.zeros(0))


def mirrored(nodes: Sequence[Node], offers: Sequence[tuple[Fit, Proposal]]) -> list[Proposal]:
    """The opposite of what was fitted: pins that are drawn back only unload themselves, so a wave can look like another
    one of the opposite sign, and a fit end there."""
    named_offers: dict[object, Proposal] = {identity(one.name): one for _, one in offers}
    result = []
    for node in nodes:
        effect = node.fit.added[-1]
        if source(effect.key).false_minima and named(effect) in named_offers:
            sizes = np.array(effect.values)
            result += [replace(named_offers[named(effect)], sizes=-times * sizes) for times in (1.0, 2.0)]
    return result


def workshop(offers: Sequence[tuple[Fit, Proposal]], *, pins: bool) -> list[Proposal]:
    """Sizes that a workshop makes, in several directions, of sources whose waveforms bend as contacts open."""
    result = []
    each = {identity(one.name): one for _, one in reversed(offers)}
    for one in each.values():
        entry = source(one.name[0])
        fixed = entry.frame == "housing"
        if not (entry.false_minima or entry.frame == "bearing") or fixed != pins:
            continue
        reach = np.array([p.plausible for p in entry.parameters])
        if len(reach) == 1:
            directions = np.array([[0.2], [-0.2]]) if entry.parameters[0].least < 0 else np.array([[0.1], [0.3]])
        elif len(reach) == 2 and "pin" in one.name[1]:
            directions = np.array([[-0.2, 0.0], [-0.2, 0.25], [-0.2, -0.25]])
        elif len(reach) == 2:
            angle = np.arange(6) * math.pi / 3
            directions = 0.17 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        else:
            axes, corners = np.eye(len(reach)), list(product((1.0, -1.0), repeat=len(reach)))
            directions = 0.1 * np.concatenate([axes, -axes, corners])
        result += [replace(one, sizes=direction * reach) for direction in directions]
    return result


def marked(model: Model, offset: float) -> Model:
    """The model with its marks at an offset."""
    effects = tuple(replace(e, values=(offset,)) if source(e.key).acts == "marks" else e for e in model.effects)
    return replace(model, effects=effects)


def turned_to(fit: Fit, offset: float) -> Fit:
    """The same sizes with the marks at an offset."""
    return evaluated(fit.bench, marked(fit.model, offset), fit.declared, fit.waves)


def turned_by(fit: Fit, angle: float) -> Fit | None:
    """A fit from the same sizes with the marks turned, if there is an equilibrium."""
    offset = fit.model.index_offset + angle
    try:
        return fitted(evaluated(fit.bench.anchored(offset), marked(fit.model, offset), fit.declared), steps=30)
    except NotConvergedError:
        return None


def onto(bench: RunSet, fit: Fit) -> Fit:
    """The same sizes on another bench."""
    if fit.bench is bench:
        return fit
    near = all(a.turn == b.turn for a, b in zip(bench.conditions, fit.bench.conditions, strict=True))
    return evaluated(bench, fit.model, fit.declared, fit.waves if near else None)


def begun_at(bench: RunSet, model: Model, declared: Model, *, fresh: bool = True) -> Fit | None:
    """A model's state where it has an equilibrium, fresh with declared sizes and stiffness as declared."""
    try:
        fit = evaluated(bench, model, declared)
        return as_declared(fit) if fresh else fit
    except NotConvergedError:
        return None


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


@dataclass(frozen=True, eq=False)
class Trial:
    """A state with one candidate more, and the objective that a fit of everything may reach from there."""

    fit: Fit
    prospect: float

    @staticmethod
    def of(fit: Fit) -> Trial:
        """A state, and what its next step promises."""
        return Trial(fit, as_compared(fit.objective - fit.proposal[1]))


def trial_of(fit: Fit, model: Model) -> Trial | None:
    """Another model's sizes in place of a fit's, where there is an equilibrium."""
    try:
        return Trial.of(evaluated(fit.bench, model, fit.declared, fit.waves))
    except NotConvergedError:
        return None


def tried(fit: Fit, one: Proposal) -> Trial | None:
    """The candidate at the size that it would take, everything else held."""
    parameters = source(one.name[0]).parameters
    most = np.array([0.7 * p.plausible for p in parameters])
    sizes = one.sizes / max(1.0, float((np.abs(one.sizes) / most).max()))
    effect = Effect(one.name[0], dict(one.name[1]), tuple(map(float, sizes)))
    return trial_of(fit, replace(fit.model, effects=(*fit.model.effects, effect)))


def ripples(unit: Reducer) -> list[float]:
    """Angles to the next ripples of the cycloid mesh, rad."""
    ripple = 2 * math.pi / fundamental_orders(unit)["cycloid mesh"]
    return [step * ripple for step in range(-_RIPPLES, _RIPPLES + 1) if step]


def stood(fit: Fit, offset: float) -> Trial | None:
    """The same sizes with the marks at an offset."""
    return trial_of(fit, marked(fit.model, offset))


def in_order(trials: Sequence[Trial]) -> list[Trial]:
    """The trials as far as they got, the best first."""
    return sorted(trials, key=lambda trial: as_compared(trial.fit.objective))


def stepped(trial: Trial, steps: int) -> Trial:
    """So many joint steps more."""
    return Trial.of(fitted(trial.fit, steps=steps, enough=0.5))
