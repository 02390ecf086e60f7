"""The search for what the model of a reducer lacks: candidates, scores on left-out revolutions, refits at the load."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.chance import chi_square
from rverror.base.units import ARCSEC
from rverror.diagnosis.fit import Fit, FitRun, Misfit, coarse, joint_fit, priors, whitened
from rverror.diagnosis.result import Addition, Alike, Candidate, Estimate, Line, Progress, Residual, describe
from rverror.geartrain.action_line import Clearance, Contacts
from rverror.geartrain.contacts import pose
from rverror.geartrain.kinematics import fundamental_orders, true_period
from rverror.geartrain.mechanism import Reducer
from rverror.geartrain.source import IndexValue
from rverror.model.catalogue import CATALOGUE, source
from rverror.model.compose import effect_values
from rverror.model.effects import Effect, Model
from rverror.runs.spectrum import amplitude, frames_of_order, harmonics
from rverror.statics.energy import Errors, error_closing, geometry
from rverror.statics.prediction import Prediction

#: Lines of a residual below this are not called unexplained: the prediction does not claim to be better.
MODEL_ACCURACY = 0.03 * ARCSEC
_FALSE_ALARM = 1e-3  # chance that any candidate, or any order, passes by luck
_MAX_ADDED = 4
_STRAINED = 3.0  # standard deviations of the declared sizes' sum of squares
_UNSURE = 2  # effects of one frame that are tried together
_LARGE = 0.1  # of the strongest line
_GOOD_PART = 0.25  # of what is not noise
_SLOW = 6  # candidates fixed in the housing that are refitted at the load
_REFITTED = 4
_TWINS = 3  # that look like the best candidate
_SAME = 1e-6  # share of the gaps that sources lack at most which close the very same ones
_ANGLES, _GOLDEN = 16, 0.6180339887  # irregular against every order
_TWIN = 0.02  # share of its power that those lack at most
_RESTARTED = 2  # of them
_BEST_STARTS = 3
_POOR = 4.0  # standard deviations of the noise's sum of squares: the fit may have ended in the wrong place
_WORKSHOP = 0.2  # of the largest plausible size
#: Rounds of steps after the first one: how many, for how many candidates, and times the squares of the best of them at
#: which a candidate is dropped beforehand.
_ROUNDS = ((1, 1000, 4.0), (4, 12, 3.0))
_LEVEL = 10.0  # of the sums of squares within which more than those are
_HOPELESS = 2.0  # a candidate that may leave so many times the best one's squares is not refitted
_CLOSE = 300.0  # of the coarse sums of squares within which candidates are compared on all angles
_NEGLIGIBLE = 0.005  # of the leader's gain
_NO_WORSE = 1.002  # declared sizes may have moved far to fit as well: then only they gain
_COARSE = (512, 1024)  # angles a period for the first fit of a candidate


@dataclass(frozen=True)
class Outcome:
    """What a search came to.

    Attributes
    ----------
    search : Search
    printed, refitted, fit : Fit
        Declared sizes as printed, within their uncertainty, and with what was added.
    added : tuple of Addition
    lines : tuple of Line
        Significant lines that remain.
    candidates : tuple of Candidate
        Of the last round, the best first.
    notes : tuple of str
    """

    search: Search
    printed: Fit
    refitted: Fit
    fit: Fit
    added: tuple[Addition, ...]
    lines: tuple[Line, ...]
    candidates: tuple[Candidate, ...]
    notes: tuple[str, ...]

    def cost(self) -> float:
        """Objective of the fit, and what every added parameter must be worth."""
        parameters = sum(len(addition.effect.values) for addition in self.added)
        return self.fit.objective + parameters * chi_square(_FALSE_ALARM, 1)


def searched(model: Model, unit: Reducer, runs: Sequence[FitRun], tell: Progress) -> Outcome:
    """Search for what a model lacks.

    Parameters
    ----------
    model : Model
        Declared; effects that repeat with the drive only.
    unit : Reducer
    runs : sequence of FitRun
    tell : callable
        Called with a line of text as the work goes on.

    Returns
    -------
    Outcome
    """
    tell("predicting the declared model")
    # where the gear's marks are is no size of a part: it is found for the model as printed too
    fixed = replace(
        model,
        effects=tuple(e if source(e.key).acts == "marks" else replace(e, uncertainty=None) for e in model.effects),
    )
    printed = joint_fit(fixed, (), runs)
    tell("refitting declared sizes within their uncertainty")
    refitted = joint_fit(model, (), runs, near=printed.predictions)
    search = Search(model, unit, runs, tell)
    result = search.run(refitted)
    lines = search.significant_lines(result.fit)
    return Outcome(search, printed, refitted, result.fit, result.added, lines, result.candidates, result.notes)


def promise(model: Model, unit: Reducer, runs: Sequence[FitRun]) -> float:
    """Sum of squares that a model and its best candidate may leave, by one linear step: small is good.

    Parameters
    ----------
    model : Model
    unit : Reducer
    runs : sequence of FitRun

    Returns
    -------
    float
    """
    search, fit = Search(model, unit, runs, lambda text: None), joint_fit(model, (), runs)
    ranking = search.rank(fit, ())
    return fit.misfit.data + fit.misfit.prior - max(ranking[0].heldout_gain, 0.0)


@dataclass(frozen=True)
class _Trial:
    """A candidate fitted to runs; `unseen` is the sum of squares that runs of fewer angles leave out.

    `count` is the number of harmonics of all angles.
    """

    effect: Effect
    runs: Sequence[FitRun]
    unseen: float
    count: int
    fit: Fit

    def promise(self) -> float:
        """Objective that a fit of everything may reach: small is good."""
        return self._of_all(self.fit.prospect)

    def reached(self) -> float:
        """Objective of the fit, as it would be of all angles."""
        return self._of_all(self.fit.misfit)

    def _of_all(self, misfit: Misfit) -> float:
        return Misfit(misfit.data + self.unseen, misfit.prior, self.count).objective


@dataclass(frozen=True)
class _Found:
    """Effects that were added, their fit, and for each its held-out rms, what fits as well and the ranking."""

    fit: Fit
    added: tuple[Effect, ...] = ()
    records: tuple[tuple[float, Alike, tuple[Candidate, ...]], ...] = ()


@dataclass(frozen=True)
class _Result:
    """What one search came to; `doubtful` where its last candidates left lines of their own frame and are unnamed."""

    added: tuple[Addition, ...]
    fit: Fit
    candidates: tuple[Candidate, ...]
    notes: tuple[str, ...]
    doubtful: bool


@dataclass(frozen=True)
class _Fold:
    """Normal equations of the seen and of the left-out revolutions, and the declared sizes' priors."""

    gram: Array
    moment: Array
    test_gram: Array
    test_moment: Array
    known: npt.NDArray[np.bool_]  # which of the first parameters were declared
    change: Array  # declared less current size of those
    weight: Array  # of a squared change

    def score(self, at: npt.NDArray[np.intp]) -> float:
        """Weighted squares of the left-out data, less a constant, and of the declared sizes' changes."""
        step = _solve(self.gram[np.ix_(at, at)], self.moment[at])
        data = step @ self.test_gram[np.ix_(at, at)] @ step - 2 * step @ self.test_moment[at]
        return float(data + self.weight @ (self.change - step[: self.known.size][self.known]) ** 2)


class Search:
    """One diagnosis: candidates, scores and what was decided."""

    def __init__(self, model: Model, unit: Reducer, runs: Sequence[FitRun], tell: Progress) -> None:
        """Set up the candidates that apply and the runs on fewer angles."""
        self.model, self.unit, self.runs, self.tell = model, unit, runs, tell
        self.levels = [*([coarse(run, points) for run in runs] for points in _COARSE), list(runs)]
        every = [
            (key, indices)
            for key, entry in CATALOGUE.items()
            if entry.applies_to(unit) and entry.periodic and entry.tried
            if not any(entry.lacks(unit, run.conditions) for run in runs)
            for indices in entry.candidates(unit)
        ]
        self.sets = [one for one in every if not source(one[0]).late]
        self.late = [one for one in every if source(one[0]).late]
        self.thorough = False
        self._fits: dict[tuple[Any, ...], Fit] = {}

    def _fit(
        self,
        added: Sequence[Effect],
        runs: Sequence[FitRun],
        *,
        start: Array,
        near: Sequence[Prediction | None] = (),
        vary_last: int | None = None,
        most_steps: int = 25,
    ) -> Fit:
        """`joint_fit`, made once: searches of more candidates, or from more sizes, come by the same places."""
        names = tuple((e.key, *e.indices.items()) for e in added)
        angles = tuple(run.conditions.theta.size for run in runs)
        where = (names, angles, start.tobytes(), vary_last, most_steps)
        if where not in self._fits:
            self._fits[where] = joint_fit(
                self.model, added, runs, start=start, near=near, vary_last=vary_last, most_steps=most_steps
            )
        return self._fits[where]

    @property
    def tried(self) -> int:
        """Number of candidates."""
        return len(self.sets)

    def run(self, refitted: Fit) -> _Result:
        """Search; what stays open is searched again with more in play, until no significant line is left.

        One effect that explains all from workshop sizes comes before two of one frame, and rare sources come last.
        """
        result = self._run(refitted, together=1)
        doubtful = {False: result.doubtful}
        for words, thorough, together, more in (
            ("from workshop sizes", True, 1, []),
            ("for two effects of one frame", False, _UNSURE, []),
            ("for two effects of one frame from workshop sizes", True, _UNSURE, []),
            (f"with {len(self.late)} rare candidates", True, _UNSURE, self.late),
        ):
            lines = self.significant_lines(result.fit)
            if not lines:
                break
            needless = together > 1 and not more and not doubtful.get(thorough, False)
            if needless or (thorough and not self._of_discs(lines)):
                continue
            self.tell(f"searching again {words}")
            self.sets, self.thorough = [*self.sets, *more], thorough
            again = self._run(refitted, together=together)
            doubtful.setdefault(thorough, again.doubtful)
            if not thorough or not self.significant_lines(again.fit):
                result = again
        return result

    def _of_discs(self, lines: Sequence[Line]) -> bool:
        """Tell whether the large ones of some lines are of the discs' frame; small ones may be folded."""
        base = fundamental_orders(self.unit)["disc"]
        return all(_is_multiple(line.order, base) for line in lines if line.amplitude > _LARGE * lines[0].amplitude)

    def _run(self, refitted: Fit, *, together: int) -> _Result:
        """Add effects one after another until none is significant, or the best one does not explain its own orders."""
        found = settled = _Found(refitted)
        ranking: tuple[Candidate, ...] = ()
        left: Sequence[Line] = ()
        while len(found.added) < _MAX_ADDED:
            more, ranking = self._next(found)
            if more is None:
                break
            if more.added == found.added:
                if more.fit.objective > found.fit.objective - _LEVEL:
                    break
                settled, found = more if settled is found else settled, more
                continue
            self.tell(f"added {describe(more.added[-1].key, more.added[-1].indices)}")
            # what is left may belong to another effect of the same frame
            left = self.own_lines(more.fit, more.added)
            unsure = len(more.added) - len(settled.added)
            if left and unsure == together > 1:
                more, left = self._first_again(more, settled, left)
            if left and (unsure == together or not self._gains(found.fit, more)):
                found = more
                break
            found = more if left else self._pruned(more)
            if not left:
                settled = found
        notes = self._doubts(ranking, found.added[len(settled.added) :], left, found.fit)
        count = len(self.model.effects)
        additions = tuple(self.addition(settled.fit, count + i, *record) for i, record in enumerate(settled.records))
        return _Result(additions, settled.fit, ranking[:20], notes, doubtful=len(found.added) > len(settled.added))

    def _next(self, found: _Found) -> tuple[_Found | None, tuple[Candidate, ...]]:
        """What was found with one more effect, if any is significant, and the candidates' ranking."""
        state = self._start(found.fit, found.added)
        ranking = self.rank(state, found.added)
        # once no line is left, what workshop sizes could still find is below the noise
        thorough = self.thorough and bool(self.significant_lines(found.fit))
        best = self.best(ranking, found.added, state, found.fit, thorough=thorough)
        if best is None:
            return None, ranking
        if isinstance(best, Fit):
            return replace(found, fit=best), ranking
        effect, fit, alike = best
        record = (self.residual(fit).heldout_rms, alike, ranking[:20])
        return _Found(fit, (*found.added, effect), (*found.records, record)), ranking

    def _pruned(self, found: _Found) -> _Found:
        """Without effects that later ones have made needless."""
        for at, effect in enumerate(found.added[:-1]):
            added = (*found.added[:at], *found.added[at + 1 :])
            first = sum(len(e.values) for e in (*self.model.effects, *found.added[:at]))
            start = np.delete(effect_values(found.fit.model.effects), np.s_[first : first + len(effect.values)])
            fit = self._fit(added, self.runs, start=start, near=found.fit.predictions)
            if fit.objective - found.fit.objective < self._needed(effect, found.fit):
                self.tell(f"dropped {describe(effect.key, effect.indices)}: needless beside what came later")
                return self._pruned(
                    self._place_again(_Found(fit, added, (*found.records[:at], *found.records[at + 1 :])))
                )
        return found

    def _place_again(self, found: _Found) -> _Found:
        """Choose the last effect again among those that look like it: an effect stood beside it that is gone."""
        *before, last = found.added
        own = _Trial(last, self.runs, 0.0, found.fit.misfit.count, found.fit)
        joint = [own, *(t for twin in self._twins(own, [last], before) if (t := self._jointly(twin, before)))]
        fits = sorted((trial.fit for trial in joint), key=lambda fit: fit.objective)
        record = (self.residual(fits[0]).heldout_rms, self._alike(fits), found.records[-1][2])
        return _Found(fits[0], (*before, fits[0].model.effects[-1]), (*found.records[:-1], record))

    def _needed(self, effect: Effect, fit: Fit) -> float:
        """What an effect must lower the objective by."""
        return chi_square(_FALSE_ALARM / self.tried, len(effect.values)) * self._noise_scale(fit)

    def _gains(self, before: Fit, found: _Found) -> bool:
        """Tell whether a candidate explained a good part: lines left in its frame may then be another effect's."""
        excess = before.misfit.data - before.misfit.count
        return before.misfit.data - found.fit.misfit.data > _GOOD_PART * excess

    def _first_again(self, found: _Found, settled: _Found, left: Sequence[Line]) -> tuple[_Found, Sequence[Line]]:
        """Choose the first of two unsure effects again beside the second: alone it had to stand for both."""
        second = found.added[-1]
        self.tell(f"choosing again beside {describe(second.key, second.indices)}")
        added = (*settled.added, second)
        start = np.concatenate([effect_values(settled.fit.model.effects), second.values])
        near = settled.fit.predictions
        fit = self._fit(added, self.runs, start=start, near=near, vary_last=1)
        record = (self.residual(fit).heldout_rms, found.records[-1][1], found.records[-1][2])
        again, _ = self._next(_Found(fit, added, (*settled.records, record)))
        if again is None or again.fit.objective >= found.fit.objective:
            return found, left
        return again, self.own_lines(again.fit, again.added)

    def _start(self, fit: Fit, added: Sequence[Effect]) -> Fit:
        """Where the search goes on from: the last fit, but as declared where that moved further than it is uncertain.

        Sizes that make up for what is missing hide it, and every candidate is then measured beside them.
        """
        known = int(np.isfinite(priors(self.model.effects, ())[fit.free[: self._declared]]).sum())
        if fit.misfit.prior <= known + _STRAINED * math.sqrt(2 * known):
            return fit
        start = np.concatenate([effect_values(self.model.effects), effect_values(fit.model.effects)[self._declared :]])
        return self._fit(added, self.runs, start=start, near=fit.predictions, vary_last=len(added))

    @property
    def _declared(self) -> int:
        """Number of declared parameters."""
        return sum(len(e.values) for e in self.model.effects)

    def _doubts(
        self, ranking: Sequence[Candidate], unsure: Sequence[Effect], left: Sequence[Line], fit: Fit
    ) -> tuple[str, ...]:
        """Why the last candidates were not named."""
        if unsure:
            names = " with ".join(describe(effect.key, effect.indices) for effect in unsure)
            orders = ", ".join(f"{line.order:g}" for line in left[:4])
            return (f"the best candidate, {names}, leaves lines of its own frame at order {orders}: not named",)
        if ranking and self.significant_lines(fit):
            nearest = describe(ranking[0].key, ranking[0].indices)
            return (f"no candidate holds at the load of the runs: not named; the nearest is {nearest}",)
        return ()

    def rank(self, state: Fit, added: Sequence[Effect]) -> tuple[Candidate, ...]:
        """Score every candidate, jointly with all free parameters, on revolutions left out."""
        self.tell(f"scoring {self.tried} candidates on left-out revolutions")
        taken = {(e.key, tuple(sorted(e.indices.items()))) for e in added}
        sets = [s for s in self.sets if (s[0], tuple(sorted(s[1].items()))) not in taken]
        pairs = zip(self.runs, state.predictions, strict=True)
        blocks = [run.predictor.influences(state.model, sets, prediction) for run, prediction in pairs]
        size = [len(source(key).parameters) for key, _ in sets]
        ends = np.cumsum(size)
        sigma = priors(self.model.effects, added)
        free = sigma > 0
        declared = effect_values((*self.model.effects, *added))
        offset = declared - effect_values(state.model.effects)
        first, known = int(free.sum()), np.isfinite(sigma[free])
        change, weight = offset[free][known], state.misfit.scale * sigma[free][known] ** -2
        known_rows = [prediction.matrix[free] for prediction in state.predictions]
        columns = [np.concatenate(rows) for rows in zip(known_rows, blocks, strict=True)]
        once, others = [1] * len(self.runs), [run.periods - 1 for run in self.runs]
        train, test = whitened(self.runs, columns, others), whitened(self.runs, columns, once)
        gram, test_gram = train @ train.T, test @ test.T
        gram[np.arange(first)[known], np.arange(first)[known]] += weight
        folds = max(run.periods for run in self.runs)
        gains = np.zeros((folds, len(sets)))
        for fold in range(folds):
            kept, left = [], []
            for run, prediction in zip(self.runs, state.predictions, strict=True):
                rest = run.values - prediction.transmission_error
                keep = np.arange(run.periods) != fold % run.periods
                kept.append(rest[keep].mean(axis=0))
                left.append(rest[~keep][0])
            moment = train @ whitened(self.runs, kept, others)
            moment[:first][known] += weight * change
            test_moment = test @ whitened(self.runs, left, once)
            left_out = _Fold(gram, moment, test_gram, test_moment, known, change, weight / folds)
            base = left_out.score(np.arange(first))
            for i, (end, count) in enumerate(zip(ends, size, strict=True)):
                at = np.concatenate([np.arange(first), first + np.arange(end - count, end)])
                gains[fold, i] = base - left_out.score(at)
        total = gains.sum(axis=0)
        order = np.argsort(-total, kind="stable")
        return tuple(
            Candidate(sets[i][0], sets[i][1], float(total[i]), tuple(float(g) for g in gains[:, i])) for i in order
        )

    def best(
        self, ranking: Sequence[Candidate], added: Sequence[Effect], state: Fit, fit: Fit, *, thorough: bool
    ) -> tuple[Effect, Fit, Alike] | Fit | None:
        """Refit the leading candidates at the load; the best one if it is significant, or a better fit without it."""
        scale = self._noise_scale(fit)
        floor = chi_square(_FALSE_ALARM / self.tried, 2) * scale
        leader = ranking[0].heldout_gain if ranking else 0.0
        least = max(floor / 2, _NEGLIGIBLE * leader)
        worthy = [c for c in ranking if c.heldout_gain > least or (thorough and _bends(c))]
        alone = self._alone(self._shortlist(worthy), added, state, thorough=thorough)
        joint = self._together(alone, added)
        if not joint:
            return None
        # a larger block fits better by chance
        joint.sort(key=lambda found: found.objective + 2 * len(found.model.effects[-1].values))
        winner = joint[0]
        effect = winner.model.effects[-1]
        worse = self.residual(winner).heldout_rms > _NO_WORSE * self.residual(fit).heldout_rms
        if fit.objective - winner.objective < self._needed(effect, fit) or worse:
            return None
        # the effect may only have shown all others the way out of a false minimum
        start = effect_values(winner.model.effects)[: -len(effect.values)]
        without = self._fit(added, self.runs, start=start, near=winner.predictions)
        if without.objective - winner.objective < self._needed(effect, fit):
            return without
        return effect, winner, self._alike(joint)

    def _alike(self, fits: Sequence[Fit]) -> Alike:
        """Last effects of fits that the runs cannot tell from that of the first."""
        winner, *others = fits
        limit = chi_square(0.01, 2) * self._noise_scale(winner)
        return tuple(
            (f.model.effects[-1].key, dict(f.model.effects[-1].indices))
            for f in others
            if f.objective - winner.objective < limit
        )

    def _alone(
        self, shortlist: Sequence[Candidate], added: Sequence[Effect], state: Fit, *, thorough: bool
    ) -> list[_Trial]:
        """Fit each candidate with everything else held: one step each, then more for the promising."""
        start = effect_values(state.model.effects)
        near = state.predictions
        base = [self._fit(added, runs, start=start, near=near, most_steps=0) for runs in self.levels]
        trials = []
        for at, candidate in enumerate(shortlist):
            name = describe(candidate.key, candidate.indices)
            self.tell(f"refitting candidate {at + 1} of {len(shortlist)}: {name}")
            zero = Effect(candidate.key, candidate.indices, (0.0,) * len(source(candidate.key).parameters))
            level = self._level(zero)
            unseen = base[-1].misfit.data - base[level].misfit.data
            begun = _Trial(zero, self.levels[level], unseen, base[-1].misfit.count, base[level])
            first = np.concatenate([start, zero.values])
            if thorough and _bends(candidate):
                sizes = [np.zeros(len(zero.values)), *_workshop_sizes(candidate.key)]
                starts = [self._fitted(begun, added, np.concatenate([start, size]), 0) for size in sizes]
                first = effect_values(min(starts, key=_Trial.reached).fit.model.effects)
            trials.append(self._fitted(begun, added, first, 1))
        for steps, most, far in _ROUNDS:
            trials = _most_promising(trials, far)[:most]
            trials = [self._fitted(t, added, effect_values(t.fit.model.effects), steps) for t in trials]
        trials.sort(key=_Trial.promise)
        for at, trial in enumerate(trials[:_RESTARTED]):
            trials[at] = self._restarted(trial, added)
            if not _is_poor(trials[at]):
                break
        return sorted(trials, key=_Trial.promise)

    def _fitted(self, trial: _Trial, added: Sequence[Effect], values: Array, steps: int) -> _Trial:
        """Fit the effect of a trial from these sizes with everything else held."""
        effects, near = [*added, trial.effect], trial.fit.predictions
        fit = self._fit(effects, trial.runs, start=values, near=near, vary_last=1, most_steps=steps)
        return replace(trial, fit=fit)

    def _restarted(self, trial: _Trial, added: Sequence[Effect]) -> _Trial:
        """Start again from workshop sizes in several directions where the fit is far from the noise.

        Pins that open and close make a wave look like another one of the opposite sign: a fit from nothing can end
        there.
        """
        if not _is_poor(trial) or not source(trial.effect.key).false_minima:
            return trial
        self.tell(f"starting again with {describe(trial.effect.key, trial.effect.indices)}")
        held = effect_values(trial.fit.model.effects)[: -len(trial.effect.values)]
        sizes = _workshop_sizes(trial.effect.key)
        starts = [self._fitted(trial, added, np.concatenate([held, size]), 0) for size in sizes]
        starts.sort(key=lambda start: start.fit.objective)
        again = [self._fitted(s, added, effect_values(s.fit.model.effects), 3) for s in starts[:_BEST_STARTS]]
        best = min(again, key=lambda found: found.fit.objective)
        best = self._fitted(best, added, effect_values(best.fit.model.effects), 5)
        return min([trial, best], key=lambda found: found.fit.objective)

    def _together(self, trials: Sequence[_Trial], added: Sequence[Effect]) -> list[Fit]:
        """Fit the most promising candidates jointly with everything; those that come close, on all angles.

        What looks like the best of them to first order comes along: contact alone tells those apart.
        """
        first = [
            trial
            for place, trial in enumerate(trials)
            if (place < _REFITTED or trial.promise() - trials[0].promise() < _LEVEL)
            and trial.promise() - trials[0].promise() < math.log(_HOPELESS) * trial.count
        ]
        joint = [found for trial in first if (found := self._jointly(trial, added)) is not None]
        if joint:
            others = self._twins(min(joint, key=_Trial.reached), [trial.effect for trial in first], added)
            joint += [found for trial in others if (found := self._jointly(trial, added)) is not None]
            joint.sort(key=_Trial.reached, reverse=True)
            joint = list({(trial.effect.key, *trial.effect.indices.items()): trial for trial in joint}.values())
        least = min((trial.reached() for trial in joint), default=0.0)
        fits = []
        for trial in joint:
            if trial.reached() - least < _CLOSE:
                start, effect = effect_values(trial.fit.model.effects), trial.fit.model.effects[-1]
                near = trial.fit.predictions
                fits.append(self._fit([*added, effect], self.runs, start=start, near=near, most_steps=12))
        return fits

    def _twins(self, best: _Trial, known: Sequence[Effect], added: Sequence[Effect]) -> list[_Trial]:
        """Candidates that look like the best one, in the size that does: elsewhere, or of the same linear waveform."""
        effects = best.fit.model.effects
        without = replace(best.fit.model, effects=effects[:-1])
        waves = [
            fitted.transmission_error - run.predictor.predict(without, fitted).transmission_error
            for run, fitted in zip(best.runs, best.fit.predictions, strict=True)
        ]
        once = [1] * len(waves)
        wave = whitened(best.runs, waves, once)
        taken = [(e.key, dict(e.indices)) for e in (*known, *added)]
        sets = [one for one in self.sets if (one[0], dict(one[1])) not in taken]
        pairs = zip(best.runs, best.fit.predictions, strict=True)
        rows = [run.predictor.influences(best.fit.model, sets, fitted) for run, fitted in pairs]
        blocks = whitened(best.runs, rows, once)
        found, end = [], 0
        for key, indices in sets:
            first, end = end, end + len(source(key).parameters)
            sizes = np.linalg.lstsq(blocks[first:end].T, wave, rcond=1e-6)[0]
            left = float(np.sum((wave - sizes @ blocks[first:end]) ** 2)) / float(wave @ wave)
            effect = Effect(key, indices, tuple(float(size) for size in sizes))
            elsewhere = _differ_in_place(effect, effects[-1])
            if (left < _TWIN or elsewhere) and _exists(effect):
                found.append((not elsewhere, left, effect))
        found.sort(key=lambda one: one[:2])
        twins = [*self._same_gaps(effects[-1]), *(effect for *_, effect in found)]
        models = [replace(best.fit.model, effects=(*effects[:-1], effect)) for effect in twins[:_TWINS]]
        return [replace(best, effect=m.effects[-1], fit=replace(best.fit, model=m)) for m in models]

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
                if _lies_in(gaps[None], rows) or _lies_in(rows, own):
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
        for key, indices in self.sets:
            entry = source(key)
            if entry.at_output or isinstance(entry.vector(motion, **indices), Clearance):
                continue
            units = [Effect(key, indices, tuple(row)) for row in np.eye(len(entry.parameters))]
            rows = [_flat(error_closing(contacts, (unit,))) - zero for unit in units]
            result[key, tuple(indices.items())] = np.array(rows)
        return result

    def _jointly(self, trial: _Trial, added: Sequence[Effect]) -> _Trial | None:
        """Fit the effect of a trial and everything else together; None where it comes to a size that cannot exist."""
        self.tell(f"refitting everything with {describe(trial.effect.key, trial.effect.indices)}")
        start, near = effect_values(trial.fit.model.effects), trial.fit.predictions
        fit = self._fit([*added, trial.effect], trial.runs, start=start, near=near, most_steps=12)
        return replace(trial, fit=fit) if _exists(fit.model.effects[-1]) else None

    def _level(self, effect: Effect) -> int:
        """Which of `levels` is the coarsest that holds the orders with which the effect leads."""
        orders = source(effect.key).orders(self.unit, effect.indices)
        highest = max(orders, default=0.0) * true_period(self.unit)
        return next((i for i, points in enumerate(_COARSE) if highest < 0.45 * points), len(_COARSE))

    def _shortlist(self, worthy: Sequence[Candidate]) -> list[Candidate]:
        """All that one repeat of the crank can predict, quickly, and the leaders of what needs a whole turn.

        Linear waveforms rank parts of one frame at random where contacts open, so those are not cut by rank.
        """
        quick = [source(c.key).repeats_with_crank(self.unit, c.indices) for c in worthy]
        slow = [c for c, repeats in zip(worthy, quick, strict=True) if not repeats][:_SLOW]
        return [c for c, repeats in zip(worthy, quick, strict=True) if repeats or c in slow]

    def _whitened(self, fit: Fit) -> list[Array]:
        """Residual of each run's mean period in standard deviations, shape (2, m) each."""
        result = []
        for run, prediction in zip(self.runs, fit.predictions, strict=True):
            rest = run.values.mean(axis=0) - prediction.transmission_error
            result.append(run.whiten(rest, run.periods).reshape(2, -1))
        return result

    def _noise_scale(self, fit: Fit) -> float:
        """How much larger than estimated the noise is, from the bulk of the residual lines; 1 or more."""
        power = np.concatenate([(w**2).sum(axis=0) for w in self._whitened(fit)])
        return max(1.0, float(np.median(power)) / chi_square(0.5, 2))

    def significant_lines(self, fit: Fit) -> tuple[Line, ...]:
        """Lines of the residual that noise does not explain, the strongest first."""
        whitened = self._whitened(fit)
        count = min(w.shape[1] for w in whitened)
        power = sum((w[:, :count] ** 2).sum(axis=0) for w in whitened)
        limit = chi_square(_FALSE_ALARM / count, 2 * len(whitened)) * self._noise_scale(fit)
        sizes, spreads, waves = [], [], []
        turns = true_period(self.unit)
        for run, prediction in zip(self.runs, fit.predictions, strict=True):
            n = run.conditions.theta.size
            lines = harmonics(run.values.mean(axis=0) - prediction.transmission_error)[:, :count]
            sizes.append(amplitude(lines, n))
            spreads.append((run.noise / run.periods * 2 / n)[:count])
            to_zero = np.exp(-1j * np.arange(1, count + 1) / turns * run.conditions.theta[0])
            waves.append((lines[0] + 1j * lines[1]) * np.sqrt(2 / n) * to_zero)
        wave = np.mean(waves, axis=0)  # of cos, and of -sin
        size = np.mean(sizes, axis=0)
        spread = 1.96 * np.sqrt(np.sum(spreads, axis=0)) / len(spreads)
        found = np.flatnonzero((power > limit) & (size > MODEL_ACCURACY))
        significant = [
            Line(
                float((h + 1) / turns),
                float(size[h]),
                float(max(size[h] - spread[h], 0.0)),
                float(size[h] + spread[h]),
                tuple(frames_of_order(self.unit, (h + 1) / turns)),
                float(wave[h].real),
                float(-wave[h].imag),
            )
            for h in found
        ]
        return tuple(sorted(significant, key=lambda line: -line.amplitude))

    def own_lines(self, fit: Fit, added: Sequence[Effect]) -> list[Line]:
        """Significant lines that one of the added effects should have explained: of its frame, or where it shows."""
        first = len(fit.model.effects) - len(added)
        claimed, bases = [], []
        for at, effect in enumerate(added, first):
            entry = source(effect.key)
            claimed += [*entry.orders(self.unit, effect.indices), *self._orders(fit, at)]
            if not entry.at_output and entry.frame in fundamental_orders(self.unit):
                bases.append(fundamental_orders(self.unit)[entry.frame])
        return [
            line
            for line in self.significant_lines(fit)
            if any(abs(line.order - order) < 0.02 for order in claimed)
            or any(_is_multiple(line.order, base) for base in bases)
        ]

    def residual(self, fit: Fit, *, hold: bool = False, beside: Sequence[Array] = ()) -> Residual:
        """Size of the residual, and of revolutions left out of the fit (nothing is fitted but offsets where `hold`).

        `beside` is what was taken off each run beforehand, and counts as residual.
        """
        more = beside or [np.zeros_like(run.values) for run in self.runs]
        rests = [
            run.values + part - prediction.transmission_error
            for run, part, prediction in zip(self.runs, more, fit.predictions, strict=True)
        ]
        rest = np.concatenate([(rest - rest.mean()).ravel() for rest in rests])
        left = np.concatenate([part.ravel() for part in self.left_out(fit, hold=hold, beside=beside)])
        return Residual(float(np.sqrt(np.mean(rest**2))), float(np.ptp(rest)), float(np.sqrt(np.mean(left**2))))

    def left_out(self, fit: Fit, *, hold: bool = False, beside: Sequence[Array] = ()) -> list[Array]:
        """Residual of each run's revolutions, each with sizes and offset from the others alone, (periods, n) each."""
        runs = list(self.runs)
        if beside:
            runs = [replace(run, values=run.values + part) for run, part in zip(runs, beside, strict=True)]
        free = fit.free if not hold else np.zeros_like(fit.free)
        effects = self.model.effects
        added = fit.model.effects[len(effects) :]
        sigma = priors(effects, added)[free]
        known = np.isfinite(sigma)
        weight = fit.misfit.scale * sigma**-2
        change = (effect_values((*effects, *added)) - effect_values(fit.model.effects))[free]
        others = [run.periods - 1 for run in runs]
        matrix = whitened(runs, [prediction.matrix[free] for prediction in fit.predictions], others)
        gram = matrix @ matrix.T
        gram[known, known] += weight[known]
        left = [np.zeros_like(run.values) for run in runs]
        for fold in range(max(run.periods for run in runs)):
            kept = []
            for run, prediction in zip(runs, fit.predictions, strict=True):
                keep = np.arange(run.periods) != fold % run.periods
                kept.append((run.values - prediction.transmission_error)[keep].mean(axis=0))
            moment = matrix @ whitened(runs, kept, others)
            moment[known] += weight[known] * change[known]
            step = _solve(gram, moment)
            for out, run, prediction in zip(left, runs, fit.predictions, strict=True):
                if fold < run.periods:
                    rest = run.values - prediction.transmission_error - step @ prediction.matrix[free]
                    out[fold] = rest[fold] - rest[np.arange(run.periods) != fold].mean()
        return left

    def addition(self, fit: Fit, at: int, heldout: float, alike: Alike, ranking: tuple[Candidate, ...]) -> Addition:
        """Describe the effect at a place of the fitted model."""
        effect = fit.model.effects[at]
        first = sum(len(e.values) for e in fit.model.effects[:at])
        spread = np.sqrt(np.diag(fit.covariance)[first : first + len(effect.values)] * self._noise_scale(fit))
        estimates, notes = [], []
        for parameter, value, sigma in zip(source(effect.key).parameters, effect.values, spread, strict=True):
            reach = 1.96 * float(sigma) if np.isfinite(sigma) else float("nan")
            estimates.append(Estimate(parameter.name, parameter.dimension, value, value - reach, value + reach))
            if abs(value) > parameter.plausible:
                notes.append(
                    f"{parameter.name}: larger than a workshop makes; the cause may be another of the same order"
                )
        origin = "found by rverror diagnose in " + ", ".join(run.name for run in self.runs)
        effect = replace(effect, origin=origin)
        orders = self._orders(fit, at)
        return Addition(effect, tuple(estimates), alike, orders, heldout, tuple(notes), candidates=ranking)

    def _orders(self, fit: Fit, at: int) -> tuple[float, ...]:
        """Orders at which an effect changes the prediction, the strongest first."""
        effects = fit.model.effects
        without = replace(fit.model, effects=effects[:at] + effects[at + 1 :])
        run, prediction = self.runs[0], fit.predictions[0]
        wave = prediction.transmission_error - run.predictor.predict(without, prediction).transmission_error
        size = amplitude(harmonics(wave), wave.size)
        strong = np.flatnonzero(size > max(0.3 * size.max(), 1e-3 * MODEL_ACCURACY))
        turns = true_period(self.unit)
        return tuple(float((h + 1) / turns) for h in strong[np.argsort(-size[strong])][:4])


def _bends(candidate: Candidate) -> bool:
    """Tell whether contacts that open make the influence at nothing a poor guide: clearances, waves of a disc."""
    frame = source(candidate.key).frame
    return frame == "bearing" or (frame == "disc" and "harmonic" in candidate.indices)


def _workshop_sizes(key: str) -> list[Array]:
    """Ordinary sizes of a source, one parameter each, in either direction that exists."""
    parameters = source(key).parameters
    reach = _WORKSHOP * np.array([p.plausible for p in parameters])
    signs = (1, -1) if all(p.least < 0 for p in parameters) else (1,)
    return [sign * reach * axis for axis in np.eye(reach.size) for sign in signs]


def _differ_in_place(one: Effect, other: Effect) -> bool:
    """Tell whether two effects are of one source on different cranks or discs."""
    places = ("crank", "disc")
    kept = [{k: v for k, v in effect.indices.items() if k not in places} for effect in (one, other)]
    return one.key == other.key and kept[0] == kept[1] and dict(one.indices) != dict(other.indices)


def _is_multiple(order: float, base: float) -> bool:
    return order > base / 2 and abs(order - base * round(order / base)) < 0.02


def _most_promising(trials: Sequence[_Trial], far: float) -> list[_Trial]:
    """The best first, without those that may leave so many times the squares of the best one."""
    least = min((trial.promise() for trial in trials), default=0.0)
    near = [trial for trial in trials if trial.promise() - least < math.log(far) * trial.count]
    return sorted(near, key=_Trial.promise)


def _is_poor(trial: _Trial) -> bool:
    """Tell whether a fit of everything would stay far above the noise."""
    expected = sum(2 * run.noise.size for run in trial.runs)
    return trial.fit.prospect.data > expected + _POOR * math.sqrt(2 * expected)


def _exists(effect: Effect) -> bool:
    """Tell whether every size can exist: no clearance is negative."""
    parameters = source(effect.key).parameters
    return all(value >= p.least for value, p in zip(effect.values, parameters, strict=True))


def _lies_in(rows: Array, others: Array) -> bool:
    """Tell whether rows are combinations of others."""
    sizes = np.linalg.lstsq(others.T, rows.T, rcond=1e-9)[0]
    return bool(np.linalg.norm(rows - sizes.T @ others) < _SAME * np.linalg.norm(rows))


def _flat(errors: Errors) -> Array:
    return np.concatenate([errors.pin.ravel(), errors.flank.ravel(), errors.joint.ravel()])


def _solve(gram: Array, moment: Array) -> Array:
    scale = np.sqrt(np.diag(gram))
    scale = np.where(scale > 0, scale, 1.0)
    step = np.linalg.lstsq(gram / np.outer(scale, scale), moment / scale, rcond=1e-10)[0] / scale
    return np.asarray(step, dtype=np.float64)
