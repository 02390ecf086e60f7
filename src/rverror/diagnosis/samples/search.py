"""The search for what the model of a geared drive lacks.

Every effect is linear in its sizes, so a fit has one minimum and nothing is started again: effects are added one after
another, each is tested, and what later ones make needless is dropped.  Beside the catalogue compete slow curvature,
lost motion and free lines of any order.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rverror.diagnosis.journal import Journal
from rverror.diagnosis.policy import Policy
from rverror.diagnosis.result import Candidate
from rverror.diagnosis.samples.fit import SampleFit, fitted, held_out_gain, screened
from rverror.diagnosis.samples.lines import beats, best_line
from rverror.diagnosis.samples.regressors import BESIDE, BOW, DECLARED, EFFECT, LINE, NUISANCE, OFFSET, Term
from rverror.diagnosis.samples.runs import RunData
from rverror.model.catalogue import source


@dataclass(frozen=True, eq=False)
class DriveSearch:
    """A search among terms that are linear in their sizes.

    Attributes
    ----------
    data : RunData
    candidates, nuisances : tuple of Term
        Effects of the catalogue, and what it has no key for.
    policy : Policy
    journal : Journal
    """

    data: RunData
    candidates: tuple[Term, ...]
    nuisances: tuple[Term, ...]
    policy: Policy
    journal: Journal

    def best(self, found: SampleFit) -> SampleFit:
        """Add effects one after another until none is significant; lines that only competed are taken out again."""
        for _ in range(self.policy.rounds):
            more = self._next(found) or self._bow_of_drift(found)
            if more is None:
                break
            found = more
        kept = [t for t in found.terms if t.kind != LINE]
        return found if len(kept) == len(found.terms) else self._pruned(self.fitted(kept))

    def fitted(self, terms: Sequence[Term]) -> SampleFit:
        """Joint fit of terms."""
        return fitted(self.data, terms)

    @property
    def _accepted(self) -> float:
        """Chance at which one of all candidates passes."""
        return self.policy.false_alarm / max(len(self.candidates) + len(self.nuisances), 1)

    def _note(self, fate: str, term: Term, why: str) -> None:
        self.journal.note(fate, (term.name, term.indices), why)

    def _next(self, found: SampleFit) -> SampleFit | None:
        """The fit with the best candidate that holds, or with a stronger line beside it; none where none holds."""
        self.journal.round += 1
        for trial in self._with_one_more(found):
            term = trial.terms[-1]
            if why := self._fails(found, trial):
                self._note("fell", term, why)
                continue
            line = best_line(self.data, found)
            if line is not None and beats(self.data, line, trial):
                self._note("fell", term, "a stronger line beside it goes first")
                return line
            self.journal.tell(f"added {term.label}")
            self._note("added", term, "significant, and better on left-out data")
            return self._pruned(trial)
        return None

    def _with_one_more(self, found: SampleFit) -> Iterator[SampleFit]:
        """Everything refitted with one candidate more, the most telling first.

        Sizes that no workshop makes go after plausible ones.
        """
        count, added = (
            len(self.candidates) + len(self.nuisances),
            [t for t in found.terms if t.kind not in (OFFSET, DECLARED)],
        )
        self.journal.tell(f"fitting {count} candidates beside {len(added)} found")
        ranking, barred = screened(self.data, found, [*self.candidates, *self.nuisances])
        for term in barred:
            self._note("fell", term, "the runs cannot tell it from what is there")
        best = max((one.gain for one in ranking), default=0.0)
        for one in sorted(
            ranking, key=lambda one: bool(one.too_large) or one.gain < self.policy.plausible_first * best
        ):
            yield self.fitted([*found.terms, one.term])

    def _fails(self, found: SampleFit, trial: SampleFit) -> str:
        """Why the last term is not significant, or no help on left-out blocks; empty where it is both."""
        if not trial.significant(trial.terms[-1], self._accepted):
            return "not significant under the noise of the runs"
        return "" if held_out_gain(self.data, found, trial) > 0 else "left-out blocks fit worse with it"

    def _pruned(self, found: SampleFit) -> SampleFit:
        """The fit without terms, but the last, that are not significant any more."""
        while True:
            free = [t for t in found.terms[:-1] if t.kind in (EFFECT, NUISANCE, LINE)]
            weak = next((t for t in free if not found.significant(t, self._accepted)), None)
            if weak is None:
                return found
            self.journal.tell(f"dropped {weak.label}: needless beside what came later")
            self._note("dropped", weak, "needless beside what came later")
            found = self.fitted([t for t in found.terms if t is not weak])

    def _bow_of_drift(self, found: SampleFit) -> SampleFit | None:
        """The fit with a drift's bow: in one direction a slope may be one, and no drift is straight."""
        slopes = [t for t in found.terms if t.kind == EFFECT and not source(t.name).periodic]
        bow = next(t for t in self.nuisances if t.name == BOW)
        if not slopes or np.unique(self.data.direction).size > 1 or any(t.name == BOW for t in found.terms):
            return None
        parabola = bow.rows[::2]  # of each run; the cubic would run away on a left-out end
        return self.fitted([*found.terms, replace(bow, kind=BESIDE, rows=parabola)])

    def scored(self, found: SampleFit) -> tuple[Candidate, ...]:
        """Score candidates of the catalogue beside what was found on left-out blocks, the best first."""
        self.journal.tell("scoring candidates on left-out blocks")
        telling, _ = screened(self.data, found, self.candidates)
        scored = [
            Candidate(t.name, t.indices, held_out_gain(self.data, found, self.fitted([*found.terms, t])))
            for t in (one.term for one in telling)
        ]
        return tuple(sorted(scored, key=lambda one: -one.heldout_gain))
