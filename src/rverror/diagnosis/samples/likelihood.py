"""What the samples of a drive's runs say to a search.

Every effect is linear in its sizes, so a fit has one minimum: nothing is started again.
Beside the catalogue compete slow curvature, lost motion and free lines of any order.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rverror.diagnosis.policy import Policy
from rverror.diagnosis.result import Candidate
from rverror.diagnosis.samples.fit import SampleFit, ScreenedTerm, fitted, held_out_gain, screened
from rverror.diagnosis.samples.lines import beats, best_line
from rverror.diagnosis.samples.regressors import BESIDE, BOW, DECLARED, EFFECT, LINE, NUISANCE, OFFSET, Term
from rverror.diagnosis.samples.runs import RunData
from rverror.diagnosis.search import Journal, Likelihood, Name
from rverror.model.catalogue import source


@dataclass(frozen=True, eq=False)
class SampleLikelihood(Likelihood[SampleFit, ScreenedTerm]):
    """Likelihood of samples under coloured noise.

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

    @property
    def accepted(self) -> float:
        """Chance at which one of all candidates passes."""
        return self.policy.false_alarm / max(len(self.candidates) + len(self.nuisances), 1)

    def fitted(self, terms: Sequence[Term]) -> SampleFit:
        """Joint fit of terms."""
        return fitted(self.data, terms)

    def added(self, found: SampleFit) -> Sequence[Name]:
        """Name what was added, in order."""
        return [(t.name, t.indices) for t in found.terms if t.kind not in (OFFSET, DECLARED)]

    def rank(self, found: SampleFit) -> list[ScreenedTerm]:
        """Share of the residual's squares that each candidate takes off."""
        count = len(self.candidates) + len(self.nuisances)
        self.journal.tell(f"fitting {count} candidates beside {len(self.added(found))} found")
        telling, barred = screened(self.data, found, [*self.candidates, *self.nuisances])
        for term in barred:
            self.journal.note("fell", (term.name, term.indices), "the runs cannot tell it from what is there")
        return telling

    def refit(self, found: SampleFit, ranking: Sequence[ScreenedTerm]) -> Iterator[SampleFit]:
        """Refit everything with one candidate more; sizes that no workshop makes go after plausible ones."""
        best = max((one.gain for one in ranking), default=0.0)
        for one in sorted(
            ranking, key=lambda one: bool(one.too_large) or one.gain < self.policy.plausible_first * best
        ):
            yield self.fitted([*found.terms, one.term])

    def fails(self, found: SampleFit, trial: SampleFit) -> str:
        """Tell why the last term is not significant, or no help on left-out blocks; empty where it is both."""
        if not trial.significant(trial.terms[-1], self.accepted):
            return "not significant under the noise of the runs"
        return "" if held_out_gain(self.data, found, trial) > 0 else "left-out blocks fit worse with it"

    def rival_line(self, found: SampleFit, trial: SampleFit) -> SampleFit | None:
        """Return the fit with a stronger line near by, which a short run smears over its neighbours."""
        line = best_line(self.data, found)
        return line if line is not None and beats(self.data, line, trial) else None

    def lighter(self, found: SampleFit) -> SampleFit | None:
        """Return the fit without the first term, but the last, that is not significant any more."""
        free = [t for t in found.terms[:-1] if t.kind in (EFFECT, NUISANCE, LINE)]
        weak = next((t for t in free if not found.significant(t, self.accepted)), None)
        return None if weak is None else self.fitted([t for t in found.terms if t is not weak])

    def goes_along(self, found: SampleFit) -> SampleFit | None:
        """Return the fit with a drift's bow: in one direction a slope may be one, and no drift is straight."""
        slopes = [t for t in found.terms if t.kind == EFFECT and not source(t.name).periodic]
        bow = next(t for t in self.nuisances if t.name == BOW)
        if not slopes or np.unique(self.data.direction).size > 1 or any(t.name == BOW for t in found.terms):
            return None
        parabola = bow.rows[::2]  # of each run; the cubic would run away on a left-out end
        return self.fitted([*found.terms, replace(bow, kind=BESIDE, rows=parabola)])

    def without_lines(self, found: SampleFit) -> SampleFit | None:
        """Return the fit without the lines that only competed."""
        kept = [t for t in found.terms if t.kind != LINE]
        return None if len(kept) == len(found.terms) else self.fitted(kept)

    def scored(self, found: SampleFit) -> tuple[Candidate, ...]:
        """Score candidates of the catalogue beside what was found on left-out blocks, the best first."""
        self.journal.tell("scoring candidates on left-out blocks")
        telling, _ = screened(self.data, found, self.candidates)
        scored = [
            Candidate(t.name, t.indices, held_out_gain(self.data, found, self.fitted([*found.terms, t])))
            for t in (one.term for one in telling)
        ]
        return tuple(sorted(scored, key=lambda one: -one.heldout_gain))
