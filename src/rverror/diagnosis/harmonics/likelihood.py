"""What the harmonics of a reducer's whole periods say to a search.

Sizes act through the loaded equilibrium, so a fit is nonlinear: candidates are refitted at the load, from several
places, and the noise is what differs between the periods.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rverror.base.chance import chi_square
from rverror.diagnosis.harmonics.fit import Fit, priors
from rverror.diagnosis.harmonics.periods import Periods, ranked, residual
from rverror.diagnosis.harmonics.trials import Alikes, Refits, Trial, bends
from rverror.diagnosis.policy import Policy
from rverror.diagnosis.result import Alike, Candidate, Line
from rverror.diagnosis.search import Journal, Likelihood, Name, Stage
from rverror.model.catalogue import CATALOGUE, source
from rverror.model.compose import effect_values
from rverror.model.effects import Effect

_LISTED = 20  # candidates of a round that are kept


@dataclass(frozen=True)
class Record:
    """What is kept of an addition: rms of periods left out, what fits as well, and the round's candidates."""

    heldout_rms: float
    alike: Alike
    candidates: tuple[Candidate, ...] = ()


@dataclass(frozen=True)
class PeriodFit:
    """Effects that were added, their fit, and a record for each."""

    fit: Fit
    added: tuple[Effect, ...] = ()
    records: tuple[Record, ...] = ()


@dataclass(frozen=True, eq=False)
class HarmonicLikelihood(Likelihood[PeriodFit, Candidate]):
    """Likelihood of the harmonics of whole periods, in units of the noise between them.

    Attributes
    ----------
    periods : Periods
    policy : Policy
    journal : Journal
    alikes : Alikes
        Where candidates are that look like one.
    candidates, rare : tuple of Name
        In play, and those that wait for the last pass.
    workshop : bool
        Whether candidates start from workshop sizes too.
    """

    periods: Periods
    policy: Policy
    journal: Journal
    alikes: Alikes
    candidates: tuple[Name, ...]
    rare: tuple[Name, ...] = ()
    workshop: bool = False

    @staticmethod
    def of(periods: Periods, journal: Journal) -> HarmonicLikelihood:
        """Likelihood with the candidates of the catalogue that the runs can show."""
        every = [
            (key, indices)
            for key, entry in CATALOGUE.items()
            if entry.applies_to(periods.unit) and entry.periodic and periods.policy.tries(entry)
            if not any(entry.lacks(periods.unit, run.conditions) for run in periods.runs)
            for indices in entry.candidates(periods.unit)
        ]
        common, rare = (tuple(one for one in every if source(one[0]).late == late) for late in (False, True))
        alikes = Alikes(periods.unit, common, periods.policy)
        return HarmonicLikelihood(periods, periods.policy, journal, alikes, common, rare)

    # --- propose, refit, test -----------------------------------------------------------------------------------------

    def added(self, found: PeriodFit) -> Sequence[Name]:
        """Name what was added, in order."""
        return [(e.key, e.indices) for e in found.added]

    def full(self, found: PeriodFit) -> bool:
        """Tell whether nothing more may be added."""
        return len(found.added) >= self.policy.most_effects

    def rank(self, found: PeriodFit) -> tuple[Candidate, ...]:
        """Score every candidate by its linear influence on periods left out."""
        self.journal.tell(f"scoring {len(self.candidates)} candidates on left-out revolutions")
        taken = [(e.key, dict(e.indices)) for e in found.added]
        open_ = [(key, indices) for key, indices in self.candidates if (key, dict(indices)) not in taken]
        return ranked(self.periods, open_, self.start(found), found.added) if open_ else ()

    def refit(self, found: PeriodFit, ranking: Sequence[Candidate]) -> Iterator[PeriodFit]:
        """Refit the leading candidates at the load; the best one alone, since nothing after it fits better."""
        if not ranking:
            return
        # once no line is left, what workshop sizes could still find is below the noise
        workshop = self.workshop and bool(self.periods.lines(found.fit))
        floor = chi_square(self.policy.false_alarm / len(self.candidates), 2) * self.periods.noise_scale(found.fit)
        least = max(floor / 2, self.policy.negligible * ranking[0].heldout_gain)
        shortlist = self._shortlist(ranking, least, workshop)
        refits = Refits(self.periods, self.alikes, found.added, workshop, self.journal)
        joint = refits.best(shortlist, self.start(found))
        # a larger block fits better by chance
        joint.sort(key=lambda fit: fit.objective + 2 * len(fit.model.effects[-1].values))
        for fit in joint[1:]:
            gap = fit.objective - joint[0].objective
            last = fit.model.effects[-1]
            self.journal.note("fell", (last.key, last.indices), f"jointly with everything: leaves {gap:.3g} more")
        for fit in joint[:1]:
            record = Record(residual(self.periods, fit).heldout_rms, self._alike(joint), tuple(ranking[:_LISTED]))
            yield PeriodFit(fit, (*found.added, fit.model.effects[-1]), (*found.records, record))

    def fails(self, found: PeriodFit, trial: PeriodFit) -> str:
        """Tell why the last effect is not significant, or no help on periods left out; empty where it is both."""
        gain, needed = found.fit.objective - trial.fit.objective, self._needed(trial.added[-1], found.fit)
        if gain < needed:
            return f"not significant: takes off {gain:.3g}, chance may {needed:.3g}"
        before, after = residual(self.periods, found.fit).heldout_rms, trial.records[-1].heldout_rms
        return "periods left out fit worse with it" if after > self.policy.no_worse * before else ""

    def shown_way(self, found: PeriodFit, trial: PeriodFit) -> PeriodFit | None:
        """Refit without the last effect: it may only have shown all others the way out of a false minimum."""
        start = effect_values(trial.fit.model.effects)[: -len(trial.added[-1].values)]
        fit = self.periods.fit(found.added, start=start, near=trial.fit.predictions)
        needless = fit.objective - trial.fit.objective < self._needed(trial.added[-1], found.fit)
        return replace(found, fit=fit) if needless else None

    def better(self, one: PeriodFit, other: PeriodFit, by: float) -> bool:
        """Tell whether one fit is better than another by so much of the objective."""
        return one.fit.objective < other.fit.objective - by

    # --- compare with lines, choose again, prune ----------------------------------------------------------------------

    def lines(self, found: PeriodFit) -> tuple[Line, ...]:
        """Significant lines that are left, the strongest first."""
        return self.periods.lines(found.fit)

    def own_lines(self, found: PeriodFit) -> list[Line]:
        """Significant lines left in the frames of what was added, which it should have explained."""
        return self.periods.own_lines(found.fit, found.added)

    def explains_much(self, found: PeriodFit, trial: PeriodFit) -> bool:
        """Tell whether a trial explained a good part: lines left in its frame may then be another effect's."""
        before = found.fit.misfit
        return before.data - trial.fit.misfit.data > self.policy.good_part * (before.data - before.count)

    def second_alone(self, settled: PeriodFit, found: PeriodFit) -> PeriodFit:
        """Return what was settled with the last effect of what was found, fitted with all else held."""
        second, record = found.added[-1], found.records[-1]
        added = (*settled.added, second)
        start = np.concatenate([effect_values(settled.fit.model.effects), second.values])
        fit = self.periods.fit(added, start=start, near=settled.fit.predictions, vary_last=1)
        record = replace(record, heldout_rms=residual(self.periods, fit).heldout_rms)
        return PeriodFit(fit, added, (*settled.records, record))

    def lighter(self, found: PeriodFit) -> PeriodFit | None:
        """Return the fit without an effect that later ones have made needless."""
        for at, effect in enumerate(found.added[:-1]):
            added = (*found.added[:at], *found.added[at + 1 :])
            first = sum(len(e.values) for e in (*self.periods.model.effects, *found.added[:at]))
            start = np.delete(effect_values(found.fit.model.effects), np.s_[first : first + len(effect.values)])
            fit = self.periods.fit(added, start=start, near=found.fit.predictions)
            if fit.objective - found.fit.objective < self._needed(effect, found.fit):
                return PeriodFit(fit, added, (*found.records[:at], *found.records[at + 1 :]))
        return None

    def placed_again(self, found: PeriodFit) -> PeriodFit:
        """Choose the last effect again among those that look like it: one that stood beside it is gone."""
        *before, last = found.added
        refits = Refits(self.periods, self.alikes, before, self.workshop, self.journal)
        own = Trial(last, self.periods.runs, 0.0, found.fit.misfit.count, found.fit)
        joint = [own, *(t for twin in refits.twins(own, [last]) if (t := refits.jointly(twin)))]
        fits = sorted((trial.fit for trial in joint), key=lambda fit: fit.objective)
        heldout = residual(self.periods, fits[0]).heldout_rms
        record = replace(found.records[-1], heldout_rms=heldout, alike=self._alike(fits))
        return PeriodFit(fits[0], (*before, fits[0].model.effects[-1]), (*found.records[:-1], record))

    # --- further passes -----------------------------------------------------------------------------------------------

    def stages(self) -> tuple[Stage, ...]:
        """Name further passes: one that explains all from workshop sizes before two of a frame, rare sources last."""
        two = self.policy.together
        return (
            Stage("from workshop sizes", 1, restarted=True),
            Stage("for two effects of one frame", two),
            Stage("for two effects of one frame from workshop sizes", two, restarted=True),
            Stage(f"with {len(self.rare)} rare candidates", two, restarted=True, rare=bool(self.rare)),
        )

    def suits(self, stage: Stage, lines: Sequence[Line]) -> bool:
        """Tell whether a pass can explain lines that are left: workshop sizes help waves of the discs alone."""
        return not stage.restarted or self.periods.of_discs(lines)

    def at(self, stage: Stage) -> HarmonicLikelihood:
        """Return the likelihood with what a pass puts in play."""
        if not stage.rare:
            return replace(self, workshop=stage.restarted)
        every = (*self.candidates, *self.rare)
        alikes = replace(self.alikes, candidates=every)
        return replace(self, candidates=every, alikes=alikes, workshop=stage.restarted)

    def start(self, found: PeriodFit) -> Fit:
        """Where the search goes on from: the last fit, but as declared where that moved further than it is uncertain.

        Sizes that make up for what is missing hide it, and every candidate is then measured beside them.
        """
        fit, periods = found.fit, self.periods
        effects = periods.model.effects
        known = int(np.isfinite(priors(effects, ())[fit.free[: periods.declared]]).sum())
        if fit.misfit.prior <= known + self.policy.strained_prior * math.sqrt(2 * known):
            return fit
        start = np.concatenate([effect_values(effects), effect_values(fit.model.effects)[periods.declared :]])
        return periods.fit(found.added, start=start, near=fit.predictions, vary_last=len(found.added))

    def _needed(self, effect: Effect, fit: Fit) -> float:
        """What an effect must lower the objective by, so that no candidate of all does by chance."""
        chance = self.policy.false_alarm / len(self.candidates)
        return chi_square(chance, len(effect.values)) * self.periods.noise_scale(fit)

    def _alike(self, fits: Sequence[Fit]) -> Alike:
        """Last effects of fits that the runs cannot tell from that of the first."""
        winner, *others = fits
        limit = chi_square(self.policy.alike, 2) * self.periods.noise_scale(winner)
        last = [f.model.effects[-1] for f in others if f.objective - winner.objective < limit]
        return tuple((effect.key, dict(effect.indices)) for effect in last)

    def _shortlist(self, ranking: Sequence[Candidate], least: float, workshop: bool) -> list[Candidate]:
        """All that one repeat of the crank can predict, quickly, and the leaders of what needs a whole turn.

        Linear waveforms rank parts of one frame at random where contacts open, so those are not cut by rank.
        """
        whole = [c for c in ranking if not source(c.key).repeats_with_crank(self.periods.unit, c.indices)]
        worthy = [c for c in ranking if c.heldout_gain > least or (workshop and bends(c.key))]
        slow = [c for c in worthy if c in whole]
        for c in ranking:
            took = f"takes {c.heldout_gain:.3g} off periods left out"
            if c not in worthy:
                self.journal.note("fell", (c.key, c.indices), f"{took}, {least:.3g} are needed")
            elif c in slow[self.policy.slow_candidates :]:
                self.journal.note("fell", (c.key, c.indices), f"{took}, others that need a whole turn take more")
        return [c for c in worthy if c not in slow[self.policy.slow_candidates :]]
