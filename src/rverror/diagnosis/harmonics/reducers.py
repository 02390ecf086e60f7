"""The closed loop for a reducer: whole periods of runs in one direction each, at their loads."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rverror.base.chance import chi_square
from rverror.base.errors import InputError
from rverror.diagnosis.harmonics.account import addition_of, doubts, offset_note, strained, traces
from rverror.diagnosis.harmonics.fit import Fit, joint_fit
from rverror.diagnosis.harmonics.likelihood import HarmonicLikelihood, PeriodFit
from rverror.diagnosis.harmonics.periods import Periods, ranked, residual
from rverror.diagnosis.harmonics.runs import FitRun, fit_run
from rverror.diagnosis.harmonics.zeros import index_offsets, lost_motion_notes, with_shared_zeros
from rverror.diagnosis.policy import POLICY, Policy
from rverror.diagnosis.result import Addition, Candidate, Diagnosis, Line, Progress
from rverror.diagnosis.samples.growing import Growth, growing_errors, growth_rows
from rverror.diagnosis.search import Journal, find_missing
from rverror.geartrain.kinematics import Conditions, fundamental_orders, samples_needed, true_period
from rverror.geartrain.mechanism import Reducer
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.runs.measurement import Run
from rverror.runs.spectrum import noise_rms, revolutions
from rverror.statics.prediction import Predictor, uses_equilibrium


def diagnose_reducer(declared: Model, runs: Sequence[Run], tell: Progress, *, policy: Policy = POLICY) -> Diagnosis:
    """Find what the model of a reducer lacks.

    Parameters
    ----------
    declared : Model
        Of a `Reducer`.
    runs : sequence of Run
        Each in one direction, over two whole periods or more.
    tell : callable
        Called with a line of text as the work goes on.
    policy : Policy

    Raises
    ------
    InputError
        If a run cannot be used; the message says why.
    """
    unit = declared.mechanism
    assert isinstance(unit, Reducer)
    journal = Journal(tell)
    fit_runs, growth, notes = _prepare(declared, unit, runs, journal, policy)
    model = replace(declared, effects=tuple(e for e in declared.effects if source(e.key).periodic))
    notes += _condition_notes(model, unit, fit_runs)
    starts = [Periods(one, unit, fit_runs, policy) for one in _with_zeros(model, unit, runs, fit_runs, policy)]
    best = min((searched(one, journal) for one in starts), key=Searched.cost)
    periods, printed, refitted, fit = best.periods, best.printed, best.refitted, best.fit
    if starts[0].model is not model:
        notes.append(offset_note(periods, fit))
    grown = [
        replace(one, heldout_rms=residual(periods, refitted, beside=growth.missed(count)).heldout_rms)
        for count, one in enumerate(growth.added, 1)
    ]
    notes += strained(periods, fit) + lost_motion_notes(fit_runs, printed, fit)
    if not fit.converged:
        notes.append("the last fit stopped before it settled: sizes may be off by more than their intervals")
    settled = "explained" if growth.added or best.added else "nothing_missing"
    return Diagnosis(
        verdict="unexplained" if best.lines else settled,
        noise_rms=float(np.sqrt(np.mean([noise_rms(run.values) ** 2 for run in fit_runs]))),
        before=residual(periods, printed, hold=True, beside=growth.missed()),
        before_refitted=residual(periods, refitted, beside=growth.missed(0)),
        after=residual(periods, fit),
        added=(*grown, *best.added),
        unexplained=best.lines,
        model=_with_growing(declared, fit.model, growth, best.added),
        declared=declared,
        candidates=best.candidates,
        tried=best.tried,
        traces=traces(periods, runs, printed, fit, growth.missed()),
        notes=(*notes, *best.notes),
        history=journal.history,
    )


@dataclass(frozen=True)
class Searched:
    """What the search beside one model came to.

    Attributes
    ----------
    periods : Periods
    printed, refitted, fit : Fit
        Declared sizes as printed, within their uncertainty, and with what was added.
    added : tuple of Addition
    lines : tuple of Line
        Significant lines that remain.
    candidates : tuple of Candidate
        Of the last round, the best first.
    tried : int
        Number of candidates.
    notes : tuple of str
    """

    periods: Periods
    printed: Fit
    refitted: Fit
    fit: Fit
    added: tuple[Addition, ...]
    lines: tuple[Line, ...]
    candidates: tuple[Candidate, ...]
    tried: int
    notes: tuple[str, ...]

    def cost(self) -> float:
        """Objective of the fit, and what every added parameter must be worth."""
        parameters = sum(len(addition.effect.values) for addition in self.added)
        return self.fit.objective + parameters * chi_square(self.periods.policy.false_alarm, 1)


def searched(periods: Periods, journal: Journal) -> Searched:
    """Search for what a model lacks.

    Parameters
    ----------
    periods : Periods
        Runs, and the declared model with effects that repeat with the drive only.
    journal : Journal
    """
    model = periods.model
    journal.tell("predicting the declared model")
    # where the gear's marks are is no size of a part: it is found for the model as printed too
    fixed = replace(
        model,
        effects=tuple(e if source(e.key).acts == "marks" else replace(e, uncertainty=None) for e in model.effects),
    )
    printed = joint_fit(fixed, (), periods.runs, policy=periods.policy)
    journal.tell("refitting declared sizes within their uncertainty")
    refitted = joint_fit(model, (), periods.runs, near=printed.predictions, policy=periods.policy)
    likelihood, outcome = find_missing(HarmonicLikelihood.of(periods, journal), PeriodFit(refitted))
    found = outcome.found
    lines = periods.lines(found.fit)
    added = tuple(addition_of(periods, found, at) for at in range(len(found.added)))
    assert isinstance(likelihood, HarmonicLikelihood)
    return Searched(
        periods, printed, refitted, found.fit, added, lines, tuple(outcome.ranking[:20]),
        len(likelihood.candidates), doubts(periods, outcome),
    )  # fmt: skip


def _with_growing(declared: Model, fitted: Model, growth: Growth, added: Sequence[Addition]) -> Model:
    """The fitted model with the errors that grow along a run, which were taken off beforehand, and with origins.

    The declared effects come first, in their places.
    """
    effects, grown = list(fitted.effects), iter(growth.declared)
    for at, effect in enumerate(declared.effects):
        if not source(effect.key).periodic:
            effects.insert(at, next(grown))
    known = effects[: len(effects) - len(added)]
    return replace(fitted, effects=(*known, *(addition.effect for addition in (*growth.added, *added))))


def _prepare(
    model: Model,
    unit: Reducer,
    runs: Sequence[Run],
    journal: Journal,
    policy: Policy,
) -> tuple[list[FitRun], Growth, list[str]]:
    if not runs:
        raise InputError("no run given; diagnose needs one or more run files")
    ratio, turns = unit.ratio, true_period(unit)
    names, conditions, values, rows, notes = [], [], [], [], []
    for number, run in enumerate(runs):
        name = run.path or f"run {number + 1}"
        if (run.index == "unknown") != (runs[0].index == "unknown"):
            raise InputError(
                f"{name}: index is {run.index or 'aligned'!r}, that of {runs[0].path or 'run 1'} "
                f"{runs[0].index or 'aligned'!r}; all runs or none may have a zero that is not on the gear's marks"
            )
        theta, error = run.nominal_angle(ratio), run.error(ratio)
        if np.unique(run.direction).size > 1:
            raise InputError(f"{name}: the run turns both ways; write one file per direction")
        run.check_effects(model, name)
        try:
            cut = revolutions(theta, error, turns=turns)
        except ValueError as problem:
            raise InputError(f"{name}: {problem}") from problem
        notes += [f"{name}: {note}" for note in run.notes]
        if cut.left_out:
            notes.append(f"{name}: {cut.left_out} samples beyond the last whole period left out")
        if cut.resampled:
            notes.append(f"{name}: samples are uneven; interpolated onto {cut.theta.size} even angles a period")
        torque = run.torque if run.torque else None
        conditions.append(Conditions(cut.theta, float(run.direction[0]), torque, folds=not cut.resampled))
        names.append(name)
        values.append(cut.values)
        rows.append(growth_rows(unit, run, theta, partial(revolutions, theta, turns=turns)))
    growth = growing_errors(model, names, values, rows, journal=journal, policy=policy)
    result = [
        fit_run(name, Predictor(unit, where), measured - grown)
        for name, where, measured, grown in zip(names, conditions, values, growth.fitted(), strict=True)
    ]
    labels = ["" if run.index == "unknown" else run.index for run in runs]
    result, unshared = with_shared_zeros(unit, result, labels, policy=policy)
    return result, growth, notes + unshared


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


def _with_zeros(
    model: Model,
    unit: Reducer,
    runs: Sequence[Run],
    fit_runs: Sequence[FitRun],
    policy: Policy,
) -> list[Model]:
    """The model with each likely offset of the gear's marks, where the runs' zero is not on them."""
    if runs[0].index != "unknown" or any(source(e.key).acts == "marks" for e in model.effects):
        return [model]
    offsets = index_offsets(model, unit, fit_runs, policy=policy)
    first, *others = (model.with_effects(offset) for offset in offsets)

    def promise(one: Model) -> float:
        """Squares that a model and its best candidate may leave, by one linear step."""
        periods = Periods(one, unit, fit_runs, policy)
        fit = joint_fit(one, (), fit_runs, policy=policy)
        candidates = HarmonicLikelihood.of(periods, Journal(lambda text: None)).candidates
        gains = [one.heldout_gain for one in ranked(periods, candidates, fit, ())[:1]] if candidates else []
        return fit.misfit.data + fit.misfit.prior - max([0.0, *gains])

    return [first, *sorted(others, key=promise)[: policy.likely_zeros - 1]]
