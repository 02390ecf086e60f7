"""The closed loop: find what a model lacks in measured runs, name it, and show the error before and after."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.stats import chi2

from rverror.action_line import Array
from rverror.catalogue import CATALOGUE, IndexValue, source
from rverror.compose import effect_values, pose, source_matrix
from rverror.diagnosis import Addition as Addition
from rverror.diagnosis import Alike, Progress
from rverror.diagnosis import Candidate as Candidate
from rverror.diagnosis import Diagnosis as Diagnosis
from rverror.diagnosis import Estimate as Estimate
from rverror.diagnosis import Line as Line
from rverror.diagnosis import Residual as Residual
from rverror.diagnosis import Trace as Trace
from rverror.diagnosis import describe as describe
from rverror.drive_search import diagnose_drive
from rverror.errors import InputError
from rverror.fit import Fit, FitRun, coarse, fit_run, joint_fit, priors
from rverror.kinematics import fundamental_orders, samples_needed, true_period
from rverror.measurement import Run
from rverror.model import Effect, Model
from rverror.prediction import Conditions, Predictor, repeats_with_crank, uses_equilibrium
from rverror.reducer import Drive, Reducer
from rverror.spectrum import amplitude, frames_of_order, harmonics, noise_rms, revolutions
from rverror.units import ARCSEC

#: Lines of a residual below this are not called unexplained: the prediction does not claim to be better.
MODEL_ACCURACY = 0.03 * ARCSEC
_FALSE_ALARM = 1e-3  # chance that any candidate, or any order, passes by luck
_MAX_ADDED = 4
_SLOW = 6  # candidates fixed in the housing that are refitted at the load
_REFITTED = 4
_SIBLINGS = 3  # of the best candidate's source
_RESTARTED = 2  # of them
_BEST_STARTS = 3
_POOR = 4.0  # standard deviations of the noise's sum of squares: the fit may have ended in the wrong place
_WORKSHOP = 0.2  # of the largest plausible size
_PROMISING = 12  # candidates that are fitted further after two steps
_HOPELESS = 2.0  # a candidate with so many times the best one's prospect is not refitted
_CLOSE = 300.0  # of the coarse sums of squares within which candidates are compared on all angles
_NEGLIGIBLE = 0.005  # of the leader's gain
_NO_WORSE = 1.002  # declared sizes may have moved far to fit as well: then only they gain
_COARSE = (512, 1024)  # angles a period for the first fit of a candidate


def diagnose(model: Model, runs: Sequence[Run], *, progress: Progress | None = None) -> Diagnosis:
    """Find the effect that a model lacks in measured runs.

    Each run is cut into whole periods; what differs between them is noise, with its colour.  The declared model is
    refitted within its uncertainty.  Every source of the catalogue is then scored, jointly with the declared ones and
    over all runs, on revolutions left out; the leading ones are refitted at the load of the runs, and the best is added
    if it is significant and leaves nothing at the orders of its own frame.  A cause that explains only part of its own
    orders is not named.

    Parameters
    ----------
    model : Model
        What was declared, with its uncertainty.
    runs : sequence of Run
        Measured runs, each in one direction.
    progress : callable, optional
        Called with a line of text as the work goes on.

    Returns
    -------
    Diagnosis

    Raises
    ------
    InputError
        If a run cannot be used; the message says why.

    Notes
    -----
    docs/theory/diagnosis.md.  Runs must have the gear's zero and two whole periods or more; every run has an offset of
    its own.
    """
    tell = progress or (lambda text: None)
    unit = model.mechanism
    if isinstance(unit, Drive):
        return diagnose_drive(model, runs, tell)
    declared = model
    fit_runs, notes = _prepare(declared, runs)
    model = replace(declared, effects=tuple(e for e in declared.effects if source(e.key).periodic))
    notes += _condition_notes(model, unit, fit_runs)
    tell("predicting the declared model")
    fixed = replace(model, effects=tuple(replace(e, uncertainty=None) for e in model.effects))
    printed = joint_fit(fixed, (), fit_runs)
    tell("refitting declared sizes within their uncertainty")
    refitted = joint_fit(model, (), fit_runs)
    search = _Search(model, unit, fit_runs, tell)
    added, fit, candidates, rejected = search.run(printed, refitted)
    lines = search.significant_lines(fit)
    settled = "explained" if added else "nothing_missing"
    notes += _strained(model, fit)
    if not fit.converged:
        notes.append("the last fit stopped before it settled: sizes may be off by more than their intervals")
    return Diagnosis(
        verdict="unexplained" if lines else settled,
        noise_rms=float(np.sqrt(np.mean([noise_rms(run.values) ** 2 for run in fit_runs]))),
        before=search.residual(printed, hold=True),
        before_refitted=search.residual(refitted),
        after=search.residual(fit),
        added=added,
        unexplained=lines,
        model=_with_growing(declared, fit.model),
        declared=declared,
        candidates=candidates,
        tried=search.tried,
        traces=tuple(
            Trace(
                run.name,
                run.conditions.direction,
                run.conditions.theta,
                _centred(run.values.mean(axis=0)),
                _centred(first.transmission_error),
                _centred(last.transmission_error),
                run.conditions.torque,
            )
            for run, first, last in zip(fit_runs, printed.predictions, fit.predictions, strict=True)
        ),
        notes=(*notes, *rejected),
    )


def _strained(model: Model, fit: Fit) -> list[str]:
    """Declared sizes that the fit moved by more than four of their standard deviations."""
    notes = []
    for declared, fitted in zip(model.effects, fit.model.effects, strict=False):
        moved = max(abs(np.subtract(fitted.values, declared.values)))
        if declared.uncertainty and moved > 4 * declared.uncertainty:
            name = describe(declared.key, declared.indices)
            notes.append(
                f"declared {name} moved by {moved / declared.uncertainty:.1f} of its uncertainty: measure it again"
            )
    return notes


def _with_growing(declared: Model, fitted: Model) -> Model:
    """Put the declared errors that grow along a run, which were taken off beforehand, back in their places."""
    effects = list(fitted.effects)
    for at, effect in enumerate(declared.effects):
        if not source(effect.key).periodic:
            effects.insert(at, effect)
    return replace(fitted, effects=tuple(effects))


def _centred(values: Array) -> Array:
    return np.asarray(values - values.mean(), dtype=np.float64)


def _prepare(model: Model, runs: Sequence[Run]) -> tuple[list[FitRun], list[str]]:
    if not runs:
        raise InputError("no run given; diagnose needs one or more run files")
    ratio, turns = model.mechanism.ratio, true_period(model.mechanism)
    result, notes = [], []
    for number, run in enumerate(runs):
        name = run.path or f"run {number + 1}"
        if run.index == "unknown":
            raise InputError(
                f"{name}: index is 'unknown'; this version needs the bench's zero on the gear's marks: align them and "
                "leave the line out"
            )
        theta, error = run.nominal_angle(ratio), run.error(ratio)
        if np.unique(run.direction).size > 1:
            raise InputError(f"{name}: the run turns both ways; write one file per direction")
        if run.time is None and any(e.key == "sensor.time_offset" for e in model.effects):
            raise InputError(f"{name}: sensor.time_offset needs a time[s] column; add it or remove the effect")
        if not run.torque and any(e.key == "load.torsion" for e in model.effects):
            raise InputError(f"{name}: load.torsion needs the output_torque; add it to the file or remove the effect")
        grown = pose(model.mechanism, theta, direction=run.direction, time=run.time)
        for effect in model.effects:
            if not source(effect.key).periodic:
                rows = source_matrix(grown, {"output": np.ones((1, theta.size))}, effect.key, effect.indices)
                error = error - np.array(effect.values) @ rows
        try:
            cut = revolutions(theta, error, turns=turns)
        except ValueError as problem:
            raise InputError(f"{name}: {problem}") from problem
        notes += [f"{name}: {note}" for note in run.notes]
        if run.index:
            notes.append(
                f"{name}: index {run.index}: the shared zero is not used by this version, each run has its offset"
            )
        if cut.left_out:
            notes.append(f"{name}: {cut.left_out} samples beyond the last whole period left out")
        if cut.resampled:
            notes.append(f"{name}: samples are uneven; interpolated onto {cut.theta.size} even angles a period")
        torque = run.torque if run.torque else None
        conditions = Conditions(cut.theta, float(run.direction[0]), torque)
        result.append(fit_run(name, Predictor(model.mechanism, conditions), cut.values))
    return result, notes


def _condition_notes(model: Model, unit: Reducer, runs: Sequence[FitRun]) -> list[str]:
    notes = []
    needed = samples_needed(unit)
    for run in runs:
        count = run.conditions.theta.size / true_period(unit)
        mesh = {name: fundamental_orders(unit)[name] for name in ("gear mesh", "cycloid mesh")}
        folded = [f"{name} {order:g}" for name, order in mesh.items() if order > count / 2]
        if folded:
            notes.append(
                f"{run.name}: {count:g} samples a turn fold {' and '.join(folded)} onto lower orders; {needed} or "
                "more keep them apart"
            )
        if not uses_equilibrium(model, run.conditions):
            notes.append(
                f"{run.name}: no output_torque; predicted by the closed form (rigid, all loaded pins in contact)"
            )
    if len({run.conditions.direction for run in runs}) == 1:
        notes.append("runs in one direction only: causes that share an order cannot be told apart; add a reverse run")
    return notes


@dataclass(frozen=True)
class _Trial:
    """A candidate fitted to runs; `unseen` is the sum of squares that runs of fewer angles leave out."""

    effect: Effect
    runs: Sequence[FitRun]
    unseen: float
    fit: Fit

    def promise(self) -> float:
        """Sum of squares that a fit of everything may reach: small is good."""
        return self.fit.prospect + self.unseen


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


class _Search:
    """One diagnosis: candidates, scores and what was decided."""

    def __init__(self, model: Model, unit: Reducer, runs: Sequence[FitRun], tell: Progress) -> None:
        self.model, self.unit, self.runs, self.tell = model, unit, runs, tell
        self.levels = [*([coarse(run, points) for run in runs] for points in _COARSE), list(runs)]
        self.sets = [
            (key, indices)
            for key, entry in CATALOGUE.items()
            if entry.applies_to(unit) and entry.periodic and entry.tried and not self._lacks_data(key)
            for indices in entry.candidates(unit)
        ]
        self.tried = len(self.sets)

    def _lacks_data(self, key: str) -> bool:
        return key == "involute.spline_clearance" and self.unit.spline_radius is None

    def run(
        self, printed: Fit, refitted: Fit
    ) -> tuple[tuple[Addition, ...], Fit, tuple[Candidate, ...], tuple[str, ...]]:
        """Add effects one after another until none is significant, or the best one does not explain its own orders."""
        fit, state = refitted, printed
        added: list[Effect] = []
        records: list[tuple[float, Alike, tuple[Candidate, ...]]] = []
        notes: list[str] = []
        while True:
            ranking = self.rank(state, added, fit)
            found = self.best(ranking, added, state, fit) if len(added) < _MAX_ADDED else None
            if found is None:
                if ranking and self.significant_lines(fit):
                    nearest = describe(ranking[0].key, ranking[0].indices)
                    notes.append(f"no candidate holds at the load of the runs: not named; the nearest is {nearest}")
                break
            effect, trial, alike = found
            left = self.own_lines(effect, trial)
            if left:
                orders = ", ".join(f"{line.order:g}" for line in left[:4])
                notes.append(
                    f"the best candidate, {describe(effect.key, effect.indices)}, leaves lines of its own frame "
                    f"at order {orders}: not named"
                )
                break
            added = [*added, effect]
            fit = state = trial
            records.append((self.residual(trial).heldout_rms, alike, ranking[:20]))
            self.tell(f"added {describe(effect.key, effect.indices)}")
        count = len(self.model.effects)
        additions = tuple(self.addition(fit, count + i, *record) for i, record in enumerate(records))
        return additions, fit, ranking[:20], tuple(notes)

    def rank(self, state: Fit, added: Sequence[Effect], fit: Fit) -> tuple[Candidate, ...]:
        """Score every candidate, jointly with all free parameters, on revolutions left out."""
        self.tell(f"scoring {self.tried} candidates on left-out revolutions")
        taken = {(e.key, tuple(sorted(e.indices.items()))) for e in added}
        sets = [s for s in self.sets if (s[0], tuple(sorted(s[1].items()))) not in taken]
        blocks = [self._columns(run, state, sets) for run in self.runs]
        size = [len(source(key).parameters) for key, _ in sets]
        ends = np.cumsum(size)
        sigma = priors(self.model.effects, added)
        free = sigma > 0
        declared = effect_values((*self.model.effects, *added))
        offset = declared - effect_values(state.model.effects)
        folds = max(run.periods for run in self.runs)
        gains = np.zeros((folds, len(sets)))
        for fold in range(folds):
            train_rows, train_right, test_rows, test_right = [], [], [], []
            for run, block, prediction in zip(self.runs, blocks, state.predictions, strict=True):
                columns = np.concatenate([prediction.matrix[free], block])
                rest = run.values - prediction.transmission_error
                keep = np.arange(run.periods) != fold % run.periods
                train_rows.append(run.whiten(columns, run.periods - 1))
                train_right.append(run.whiten(rest[keep].mean(axis=0), run.periods - 1))
                test_rows.append(run.whiten(columns, 1))
                test_right.append(run.whiten(rest[~keep][0], 1))
            train, test = np.concatenate(train_rows, axis=1), np.concatenate(test_rows, axis=1)
            right, seen = np.concatenate(train_right), np.concatenate(test_right)
            gram, moment = train @ train.T, train @ right
            test_gram, test_moment = test @ test.T, test @ seen
            first = int(free.sum())
            known = np.isfinite(sigma[free])
            gram[np.arange(first)[known], np.arange(first)[known]] += sigma[free][known] ** -2
            moment[:first][known] += (offset[free] / sigma[free] ** 2)[known]
            change, weight = offset[free][known], sigma[free][known] ** -2 / folds
            left_out = _Fold(gram, moment, test_gram, test_moment, known, change, weight)
            base = left_out.score(np.arange(first))
            for i, (end, count) in enumerate(zip(ends, size, strict=True)):
                at = np.concatenate([np.arange(first), first + np.arange(end - count, end)])
                gains[fold, i] = base - left_out.score(at)
        total = gains.sum(axis=0)
        order = np.argsort(-total, kind="stable")
        return tuple(
            Candidate(sets[i][0], sets[i][1], float(total[i]), tuple(float(g) for g in gains[:, i])) for i in order
        )

    def _columns(self, run: FitRun, state: Fit, sets: Sequence[tuple[str, Mapping[str, IndexValue]]]) -> Array:
        motion, forces = run.predictor.contact_state(state.model)
        rows = [source_matrix(motion, forces, key, indices) for key, indices in sets]
        return np.concatenate(rows)

    def best(
        self, ranking: Sequence[Candidate], added: Sequence[Effect], state: Fit, fit: Fit
    ) -> tuple[Effect, Fit, Alike] | None:
        """Refit the leading candidates at the runs' load; the best one if it is significant."""
        scale = self._noise_scale(fit)
        floor = chi2.isf(_FALSE_ALARM / self.tried, 2) * scale
        leader = ranking[0].heldout_gain if ranking else 0.0
        worthy = [c for c in ranking if c.heldout_gain > max(floor / 2, _NEGLIGIBLE * leader)]
        joint = self._together(self._alone(self._shortlist(worthy), added, state), added)
        if not joint:
            return None
        joint.sort(key=lambda f: f.chi2 + 2 * len(f.model.effects[-1].values))  # a larger block fits better by chance
        winner = joint[0]
        effect = winner.model.effects[-1]
        needed = chi2.isf(_FALSE_ALARM / self.tried, len(effect.values)) * scale
        worse = self.residual(winner).heldout_rms > _NO_WORSE * self.residual(fit).heldout_rms
        if fit.chi2 - winner.chi2 < needed or worse:
            return None
        alike = chi2.isf(0.01, 2) * self._noise_scale(winner)
        others = tuple(
            (f.model.effects[-1].key, dict(f.model.effects[-1].indices))
            for f in joint[1:]
            if f.chi2 - winner.chi2 < alike
        )
        return effect, winner, others

    def _alone(self, shortlist: Sequence[Candidate], added: Sequence[Effect], state: Fit) -> list[_Trial]:
        """Fit each candidate with everything else held: two steps each, then more for the most promising."""
        start = effect_values(state.model.effects)
        base = [joint_fit(self.model, added, runs, start=start, most_steps=0) for runs in self.levels]

        trials = []
        for at, candidate in enumerate(shortlist):
            name = describe(candidate.key, candidate.indices)
            self.tell(f"refitting candidate {at + 1} of {len(shortlist)}: {name}")
            zero = Effect(candidate.key, candidate.indices, (0.0,) * len(source(candidate.key).parameters))
            level = self._level(zero)
            begun = _Trial(zero, self.levels[level], base[-1].chi2 - base[level].chi2, base[level])
            trials.append(self._fitted(begun, added, np.concatenate([start, zero.values]), 2))
        trials.sort(key=_Trial.promise)
        trials = [self._fitted(t, added, effect_values(t.fit.model.effects), 4) for t in trials[:_PROMISING]]
        trials.sort(key=_Trial.promise)
        trials[:_RESTARTED] = [self._restarted(trial, added) for trial in trials[:_RESTARTED]]
        return sorted(trials, key=_Trial.promise)

    def _fitted(self, trial: _Trial, added: Sequence[Effect], values: Array, steps: int) -> _Trial:
        """Fit the effect of a trial from these sizes with everything else held."""
        effects, near = [*added, trial.effect], trial.fit.predictions
        fit = joint_fit(self.model, effects, trial.runs, start=values, near=near, vary_last_only=True, most_steps=steps)
        return replace(trial, fit=fit)

    def _restarted(self, trial: _Trial, added: Sequence[Effect]) -> _Trial:
        """Start again from workshop sizes in several directions where the fit is far from the noise.

        Pins that open and close make a wave look like another one of the opposite sign: a fit from nothing can end
        there.
        """
        expected = sum(2 * run.noise.size for run in trial.runs)
        poor = expected + _POOR * math.sqrt(2 * expected)
        if trial.fit.prospect < poor or not trial.effect.key.startswith("cycloid."):
            return trial
        self.tell(f"starting again with {describe(trial.effect.key, trial.effect.indices)}")
        reach = np.array([p.plausible for p in source(trial.effect.key).parameters]) * _WORKSHOP
        held = effect_values(trial.fit.model.effects)[: -reach.size]
        sizes = [sign * reach * axis for axis in np.eye(reach.size) for sign in (1, -1)]
        starts = [self._fitted(trial, added, np.concatenate([held, size]), 0) for size in sizes]
        starts.sort(key=lambda start: start.fit.chi2)
        again = [self._fitted(s, added, effect_values(s.fit.model.effects), 8) for s in starts[:_BEST_STARTS]]
        return min([trial, *again], key=lambda found: found.fit.chi2)

    def _together(self, trials: Sequence[_Trial], added: Sequence[Effect]) -> list[Fit]:
        """Fit the most promising candidates jointly with everything; those that come close, on all angles.

        The same source elsewhere comes along with the best of them: which crank or disc it is, contact alone tells.
        """
        first = [t for t in trials[:_REFITTED] if t.promise() <= _HOPELESS * trials[0].promise()]
        joint = [found for trial in first if (found := self._jointly(trial, added)) is not None]
        if joint:
            key = min(joint, key=lambda trial: trial.fit.chi2 + trial.unseen).effect.key
            others = [t for t in trials if t.effect.key == key and t not in first][:_SIBLINGS]
            joint += [found for trial in others if (found := self._jointly(trial, added)) is not None]
        least = min((trial.fit.chi2 + trial.unseen for trial in joint), default=0.0)
        fits = []
        for trial in joint:
            if trial.fit.chi2 + trial.unseen - least < _CLOSE:
                start, effect = effect_values(trial.fit.model.effects), trial.fit.model.effects[-1]
                fits.append(joint_fit(self.model, [*added, effect], self.runs, start=start, most_steps=12))
        return fits

    def _jointly(self, trial: _Trial, added: Sequence[Effect]) -> _Trial | None:
        """Fit the effect of a trial and everything else together; None where it comes to a size that cannot exist."""
        self.tell(f"refitting everything with {describe(trial.effect.key, trial.effect.indices)}")
        start, near = effect_values(trial.fit.model.effects), trial.fit.predictions
        fit = joint_fit(self.model, [*added, trial.effect], trial.runs, start=start, near=near, most_steps=12)
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
        quick = [repeats_with_crank(self.unit, c.key, c.indices) for c in worthy]
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
        return max(1.0, float(np.median(power)) / float(chi2.median(2)))

    def significant_lines(self, fit: Fit) -> tuple[Line, ...]:
        """Lines of the residual that noise does not explain, the strongest first."""
        whitened = self._whitened(fit)
        count = min(w.shape[1] for w in whitened)
        power = sum((w[:, :count] ** 2).sum(axis=0) for w in whitened)
        limit = chi2.isf(_FALSE_ALARM / count, 2 * len(whitened)) * self._noise_scale(fit)
        sizes, spreads = [], []
        for run, prediction in zip(self.runs, fit.predictions, strict=True):
            n = run.conditions.theta.size
            rest = run.values.mean(axis=0) - prediction.transmission_error
            sizes.append(amplitude(harmonics(rest), n)[:count])
            spreads.append((run.noise / run.periods * 2 / n)[:count])
        size = np.mean(sizes, axis=0)
        spread = 1.96 * np.sqrt(np.sum(spreads, axis=0)) / len(spreads)
        turns = true_period(self.unit)
        found = np.flatnonzero((power > limit) & (size > MODEL_ACCURACY))
        lines = [
            Line(
                float((h + 1) / turns),
                float(size[h]),
                float(max(size[h] - spread[h], 0.0)),
                float(size[h] + spread[h]),
                tuple(frames_of_order(self.unit, (h + 1) / turns)),
            )
            for h in found
        ]
        return tuple(sorted(lines, key=lambda line: -line.amplitude))

    def own_lines(self, effect: Effect, fit: Fit) -> list[Line]:
        """Significant lines that the last effect should have explained: of its frame, or where it shows."""
        entry = source(effect.key)
        claimed = (*entry.orders(self.unit, effect.indices), *self._orders(fit, len(fit.model.effects) - 1))
        base = 0.0 if entry.at_output else fundamental_orders(self.unit).get(entry.frame, 0.0)
        return [
            line
            for line in self.significant_lines(fit)
            if any(abs(line.order - order) < 0.02 for order in claimed)
            or (base and line.order > base / 2 and abs(line.order - base * round(line.order / base)) < 0.02)
        ]

    def residual(self, fit: Fit, *, hold: bool = False) -> Residual:
        """Size of the residual, and of revolutions left out of the fit (nothing is fitted but offsets where `hold`)."""
        total, squares, samples, low, high = 0.0, 0.0, 0, np.inf, -np.inf
        for run, prediction in zip(self.runs, fit.predictions, strict=True):
            rest = run.values - prediction.transmission_error
            rest = rest - rest.mean()
            total += float((rest**2).sum())
            samples += rest.size
            low, high = min(low, float(rest.min())), max(high, float(rest.max()))
        peak = high - low
        free = fit.free if not hold else np.zeros_like(fit.free)
        effects = self.model.effects
        added = fit.model.effects[len(effects) :]
        sigma = priors(effects, added)[free]
        known = np.isfinite(sigma)
        change = (effect_values((*effects, *added)) - effect_values(fit.model.effects))[free]
        for fold in range(max(run.periods for run in self.runs)):
            rows, right = [np.zeros((int(free.sum()), 0))], [np.zeros(0)]
            for run, prediction in zip(self.runs, fit.predictions, strict=True):
                keep = np.arange(run.periods) != fold % run.periods
                rest = (run.values - prediction.transmission_error)[keep].mean(axis=0)
                rows.append(run.whiten(prediction.matrix[free], run.periods - 1))
                right.append(run.whiten(rest, run.periods - 1))
            matrix = np.concatenate(rows, axis=1)
            gram, moment = matrix @ matrix.T, matrix @ np.concatenate(right)
            gram[known, known] += sigma[known] ** -2
            moment[known] += change[known] / sigma[known] ** 2
            step = _solve(gram, moment)
            for run, prediction in zip(self.runs, fit.predictions, strict=True):
                if fold >= run.periods:
                    continue
                rest = run.values - prediction.transmission_error - step @ prediction.matrix[free]
                keep = np.arange(run.periods) != fold
                squares += float(((rest[fold] - rest[keep].mean()) ** 2).sum())
        return Residual(float(np.sqrt(total / samples)), peak, float(np.sqrt(squares / samples)))

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
        wave = prediction.transmission_error - run.predictor.predict(without).transmission_error
        size = amplitude(harmonics(wave), wave.size)
        strong = np.flatnonzero(size > 0.3 * size.max())
        turns = true_period(self.unit)
        return tuple(float((h + 1) / turns) for h in strong[np.argsort(-size[strong])][:4])


def _exists(effect: Effect) -> bool:
    """Tell whether every size can exist: no clearance is negative."""
    parameters = source(effect.key).parameters
    return all(value >= p.least for value, p in zip(effect.values, parameters, strict=True))


def _solve(gram: Array, moment: Array) -> Array:
    scale = np.sqrt(np.diag(gram))
    scale = np.where(scale > 0, scale, 1.0)
    step = np.linalg.lstsq(gram / np.outer(scale, scale), moment / scale, rcond=1e-10)[0] / scale
    return np.asarray(step, dtype=np.float64)
