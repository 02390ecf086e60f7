"""Candidates refitted at the load of the runs: alone first, everything else held, then jointly with everything.

What looks like the best of them comes along: elsewhere in the gear train, or of the same gaps or linear waveform.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rverror.base.arrays import Array
from rverror.base.text import describe
from rverror.diagnosis.harmonics.fit import Fit, Misfit
from rverror.diagnosis.harmonics.periods import Periods
from rverror.diagnosis.harmonics.runs import FitRun, whitened
from rverror.diagnosis.policy import Policy
from rverror.diagnosis.result import Candidate
from rverror.diagnosis.search import Journal, Name
from rverror.geartrain.action_line import Clearance, Compliance, Contacts
from rverror.geartrain.contacts import pose
from rverror.geartrain.mechanism import Reducer
from rverror.geartrain.source import IndexValue
from rverror.model.catalogue import source
from rverror.model.compose import effect_values
from rverror.model.effects import Effect
from rverror.statics.energy import Errors, error_closing, geometry

_ANGLES, _GOLDEN = 16, 0.6180339887  # irregular against every order


@dataclass(frozen=True)
class Alikes:
    """Looks among candidates for those that the best one cannot be told from to first order."""

    unit: Reducer
    candidates: Sequence[Name]
    policy: Policy

    def of(self, runs: Sequence[FitRun], fit: Fit, taken: Sequence[Name]) -> list[Effect]:
        """Effects that look like the last one of a fit, in the size that does, the nearest first."""
        *before, effect = fit.model.effects
        sets = [(key, indices) for key, indices in self.candidates if (key, dict(indices)) not in taken]
        if not sets:
            return []
        without = replace(fit.model, effects=tuple(before))
        waves = [
            fitted.transmission_error - run.predictor.predict(without, fitted).transmission_error
            for run, fitted in zip(runs, fit.predictions, strict=True)
        ]
        once = [1] * len(waves)
        wave = whitened(runs, waves, once)
        pairs = zip(runs, fit.predictions, strict=True)
        blocks = whitened(runs, [run.predictor.influences(fit.model, sets, fitted) for run, fitted in pairs], once)
        found, end = [], 0
        for key, indices in sets:
            first, end = end, end + len(source(key).parameters)
            sizes = np.linalg.lstsq(blocks[first:end].T, wave, rcond=1e-6)[0]
            left = float(np.sum((wave - sizes @ blocks[first:end]) ** 2)) / float(wave @ wave)
            other = Effect(key, indices, tuple(float(size) for size in sizes))
            elsewhere = _differ_in_place(other, effect)
            if (left < self.policy.twin_share or elsewhere) and exists(other):
                found.append((not elsewhere, left, other))
        found.sort(key=lambda one: one[:2])
        return [*self._same_gaps(effect), *(other for *_, other in found)]

    def _same_gaps(self, effect: Effect) -> list[Effect]:
        """Other sources that close the same gaps as an effect, or some that its source can; in the nearest size.

        No run can tell such apart but by what the one can do and the other cannot.
        """
        own = self._gaps.get((effect.key, tuple(effect.indices.items())))
        if own is None:
            return []
        gaps, found = effect_values((effect,)) @ own, []
        for (key, indices), rows in self._gaps.items():
            if (key, dict(indices)) != (effect.key, dict(effect.indices)):
                sizes = np.linalg.lstsq(rows.T, gaps, rcond=1e-9)[0]
                if self._lies_in(gaps[None], rows) or self._lies_in(rows, own):
                    found.append(Effect(key, dict(indices), tuple(float(size) for size in sizes)))
        return found

    @cached_property
    def _gaps(self) -> dict[tuple[str, tuple[tuple[str, IndexValue], ...]], Array]:
        """What each source of the gear train closes at all contacts, per parameter, at some angles."""
        motion = pose(self.unit, 2 * np.pi * np.mod(_GOLDEN * np.arange(_ANGLES), 1), direction=1.0, torque=1.0)
        assert isinstance(motion, Contacts)
        contacts = geometry(motion)
        zero = _flat(error_closing(contacts, ()))
        result = {}
        for key, indices in self.candidates:
            entry = source(key)
            if entry.at_output or isinstance(entry.vector(motion, **indices), (Clearance, Compliance)):
                continue
            units = [Effect(key, indices, tuple(row)) for row in np.eye(len(entry.parameters))]
            rows = [_flat(error_closing(contacts, (unit,))) - zero for unit in units]
            result[key, tuple(indices.items())] = np.array(rows)
        return result

    def _lies_in(self, rows: Array, others: Array) -> bool:
        """Tell whether rows are combinations of others."""
        sizes = np.linalg.lstsq(others.T, rows.T, rcond=1e-9)[0]
        return bool(np.linalg.norm(rows - sizes.T @ others) < self.policy.same_gaps * np.linalg.norm(rows))


def _differ_in_place(one: Effect, other: Effect) -> bool:
    """Tell whether two effects are of one source on different cranks or discs."""
    places = ("crank", "disc")
    kept = [{k: v for k, v in effect.indices.items() if k not in places} for effect in (one, other)]
    return one.key == other.key and kept[0] == kept[1] and dict(one.indices) != dict(other.indices)


def _flat(errors: Errors) -> Array:
    return np.concatenate([errors.pin.ravel(), errors.flank.ravel(), errors.joint.ravel()])


def exists(effect: Effect) -> bool:
    """Tell whether every size can exist: no clearance is negative."""
    parameters = source(effect.key).parameters
    return all(value >= p.least for value, p in zip(effect.values, parameters, strict=True))


_ALONE = "alone at the load: may leave"


@dataclass(frozen=True, eq=False)
class Trial:
    """A candidate fitted to runs; `unseen` is the sum of squares that runs of fewer angles leave out.

    `count` is the number of harmonics of all angles.
    """

    effect: Effect
    runs: Sequence[FitRun]
    unseen: float
    count: int
    fit: Fit

    @property
    def name(self) -> Name:
        """Key and indices of the candidate."""
        return self.effect.key, self.effect.indices

    def promise(self) -> float:
        """Objective that a fit of everything may reach: small is good."""
        return self._of_all(self.fit.prospect)

    def reached(self) -> float:
        """Objective of the fit, as it would be of all angles."""
        return self._of_all(self.fit.misfit)

    def _of_all(self, misfit: Misfit) -> float:
        return replace(misfit, data=misfit.data + self.unseen, count=self.count).objective


@dataclass(frozen=True)
class Refits:
    """Refits beside effects that were added before; `workshop` tells whether candidates start from such sizes too."""

    periods: Periods
    alikes: Alikes
    added: Sequence[Effect]
    workshop: bool
    journal: Journal

    @property
    def policy(self) -> Policy:
        """That of the runs."""
        return self.periods.policy

    def best(self, shortlist: Sequence[Candidate], state: Fit) -> list[Fit]:
        """Fits of everything with one candidate each, on all angles, of those that come close to the best."""
        return self._together(self._alone(shortlist, state))

    def _alone(self, shortlist: Sequence[Candidate], state: Fit) -> list[Trial]:
        """Fit each candidate with everything else held: one step each, then more for the promising."""
        start = effect_values(state.model.effects)
        near, levels = state.predictions, self.periods.levels
        base = [self.periods.fit(self.added, runs=runs, start=start, near=near, most_steps=0) for runs in levels]
        trials = []
        for at, candidate in enumerate(shortlist):
            name = describe(candidate.key, candidate.indices)
            self.journal.tell(f"refitting candidate {at + 1} of {len(shortlist)}: {name}")
            zero = Effect(candidate.key, candidate.indices, (0.0,) * len(source(candidate.key).parameters))
            level = self._level(zero)
            unseen = base[-1].misfit.data - base[level].misfit.data
            begun = Trial(zero, levels[level], unseen, base[-1].misfit.count, base[level])
            first = np.concatenate([start, zero.values])
            if self.workshop and bends(candidate.key):
                sizes = [np.zeros(len(zero.values)), *self._workshop_sizes(candidate.key)]
                starts = [self._fitted(begun, np.concatenate([start, size]), 0) for size in sizes]
                first = effect_values(min(starts, key=Trial.reached).fit.model.effects)
            trials.append(self._fitted(begun, first, 1))
        for steps, most, far in self.policy.refit_rounds:
            trials = self._most_promising(trials, far, most)
            trials = [self._fitted(t, effect_values(t.fit.model.effects), steps) for t in trials]
        trials.sort(key=Trial.promise)
        for at, trial in enumerate(trials[: self.policy.restarted]):
            trials[at] = self._restarted(trial)
            if not self._is_poor(trials[at]):
                break
        return sorted(trials, key=Trial.promise)

    def _fitted(self, trial: Trial, values: Array, steps: int) -> Trial:
        """Fit the effect of a trial from these sizes with everything else held."""
        effects, near = [*self.added, trial.effect], trial.fit.predictions
        fit = self.periods.fit(effects, runs=trial.runs, start=values, near=near, vary_last=1, most_steps=steps)
        return replace(trial, fit=fit)

    def _most_promising(self, trials: Sequence[Trial], far: float, most: int) -> list[Trial]:
        """The best first, without those that may leave so many times the squares of the best one."""
        ordered = sorted(trials, key=Trial.promise)
        kept = [t for t in ordered if t.promise() - ordered[0].promise() < math.log(far) * t.count][:most]
        for trial in ordered:
            if trial not in kept:
                self._fell(trial, _ALONE, trial.promise() - ordered[0].promise(), ordered[0])
        return kept

    def _fell(self, trial: Trial, why: str, more: float, best: Trial) -> None:
        self.journal.note("fell", trial.name, f"{why} {more:.3g} more than {describe(*best.name)}")

    def _restarted(self, trial: Trial) -> Trial:
        """Start again from workshop sizes in several directions where the fit is far from the noise.

        Pins that open and close make a wave look like another one of the opposite sign: a fit from nothing can end
        there.
        """
        if not self._is_poor(trial) or not source(trial.effect.key).false_minima:
            return trial
        self.journal.tell(f"starting again with {describe(*trial.name)}")
        held = effect_values(trial.fit.model.effects)[: -len(trial.effect.values)]
        sizes = self._workshop_sizes(trial.effect.key)
        starts = [self._fitted(trial, np.concatenate([held, size]), 0) for size in sizes]
        starts.sort(key=lambda start: start.fit.objective)
        best_starts = starts[: self.policy.best_starts]
        again = [self._fitted(s, effect_values(s.fit.model.effects), 3) for s in best_starts]
        best = min(again, key=lambda found: found.fit.objective)
        best = self._fitted(best, effect_values(best.fit.model.effects), 5)
        return min([trial, best], key=lambda found: found.fit.objective)

    def _together(self, trials: Sequence[Trial]) -> list[Fit]:
        """Fit the most promising candidates jointly with everything; those that come close, on all angles.

        What looks like the best of them to first order comes along: contact alone tells those apart.
        """
        first = []
        for place, trial in enumerate(trials):
            behind = trial.promise() - trials[0].promise()
            leads = place < self.policy.refitted or behind < self.policy.level
            if leads and behind < math.log(self.policy.hopeless) * trial.count:
                first.append(trial)
            else:
                self._fell(trial, _ALONE, behind, trials[0])
        joint = [found for trial in first if (found := self.jointly(trial)) is not None]
        if joint:
            known = [trial.effect for trial in first]
            others = self.twins(min(joint, key=Trial.reached), known)
            joint += [found for trial in others if (found := self.jointly(trial)) is not None]
            joint.sort(key=Trial.reached, reverse=True)
            joint = list({(trial.effect.key, *trial.effect.indices.items()): trial for trial in joint}.values())
        fits = []
        for trial in joint:
            best = min(joint, key=Trial.reached)
            behind = trial.reached() - best.reached()
            if behind >= self.policy.close:
                self._fell(trial, "jointly with everything: leaves", behind, best)
                continue
            start, effect = effect_values(trial.fit.model.effects), trial.fit.model.effects[-1]
            near = trial.fit.predictions
            fits.append(self.periods.fit([*self.added, effect], start=start, near=near, most_steps=12))
        return fits

    def jointly(self, trial: Trial) -> Trial | None:
        """Fit the effect of a trial and everything else together; None where it comes to a size that cannot exist."""
        self.journal.tell(f"refitting everything with {describe(*trial.name)}")
        start, near = effect_values(trial.fit.model.effects), trial.fit.predictions
        effects = [*self.added, trial.effect]
        fit = self.periods.fit(effects, runs=trial.runs, start=start, near=near, most_steps=12)
        if exists(fit.model.effects[-1]):
            return replace(trial, fit=fit)
        self.journal.note("fell", trial.name, "comes to a size that cannot exist")
        return None

    def twins(self, best: Trial, known: Sequence[Effect]) -> list[Trial]:
        """Candidates that look like the best one, in the size that does; without those that are known."""
        taken = [(e.key, dict(e.indices)) for e in (*known, *self.added)]
        effects = best.fit.model.effects
        alike = self.alikes.of(best.runs, best.fit, taken)[: self.policy.twins]
        models = [replace(best.fit.model, effects=(*effects[:-1], effect)) for effect in alike]
        return [replace(best, effect=m.effects[-1], fit=replace(best.fit, model=m)) for m in models]

    def _level(self, effect: Effect) -> int:
        """Which of the levels is the coarsest that holds the orders with which the effect leads."""
        orders = source(effect.key).orders(self.periods.unit, effect.indices)
        highest = max(orders, default=0.0) * self.periods.turns
        coarse, share = self.policy.coarse, self.policy.coarse_share
        return next((i for i, points in enumerate(coarse) if highest < share * points / 2), len(coarse))

    def _is_poor(self, trial: Trial) -> bool:
        """Tell whether a fit of everything would stay far above the noise."""
        expected = sum(2 * run.noise.size for run in trial.runs)
        return trial.fit.prospect.data > expected + self.policy.poor * math.sqrt(2 * expected)

    def _workshop_sizes(self, key: str) -> list[Array]:
        """Ordinary sizes of a source, one parameter each, in either direction that exists."""
        parameters = source(key).parameters
        reach = self.policy.workshop * np.array([p.plausible for p in parameters])
        signs = (1, -1) if all(p.least < 0 for p in parameters) else (1,)
        return [sign * reach * axis for axis in np.eye(reach.size) for sign in signs]


def bends(key: str) -> bool:
    """Tell whether contacts that open make the influence at nothing a poor guide: clearances, waves of a disc."""
    frame = source(key).frame
    return frame == "bearing" or (frame == "disc" and "harmonic" in [index.name for index in source(key).indices])
