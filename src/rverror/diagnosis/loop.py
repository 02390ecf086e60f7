"""The closed loop: find what a model lacks in measured runs, name it, and show the error before and after."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.diagnosis.drive_search import diagnose_drive
from rverror.diagnosis.fit import Fit, FitRun, fit_run
from rverror.diagnosis.growing import Growth, growing_errors, growth_rows
from rverror.diagnosis.reducer_search import Outcome, promise, searched
from rverror.diagnosis.result import Addition as Addition
from rverror.diagnosis.result import Candidate as Candidate
from rverror.diagnosis.result import Diagnosis as Diagnosis
from rverror.diagnosis.result import Estimate as Estimate
from rverror.diagnosis.result import Line as Line
from rverror.diagnosis.result import Progress
from rverror.diagnosis.result import Residual as Residual
from rverror.diagnosis.result import Trace as Trace
from rverror.diagnosis.result import describe as describe
from rverror.diagnosis.shared_zero import lost_motion_notes, with_shared_zeros
from rverror.diagnosis.unknown_index import index_offsets
from rverror.geartrain.kinematics import Conditions, fundamental_orders, samples_needed, true_period
from rverror.geartrain.mechanism import Drive, Reducer
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.runs.measurement import Run
from rverror.runs.spectrum import noise_rms, revolutions
from rverror.statics.prediction import Predictor, uses_equilibrium

_ZEROS = 2  # likely zeros of runs whose index is unknown, each with a search of its own


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
    docs/theory/diagnosis.md.  Runs must have two whole periods or more.  Every run has an offset of its own, but for
    those of one index label; where the index is unknown, the angle of the gear's marks is fitted.

    Examples
    --------
    A drive of which only the motor's order is known; what it lacks is an eccentric motor shaft.

    >>> import rverror
    >>> theta, rng = np.linspace(0, 8 * np.pi, 4001), np.random.default_rng(1)
    >>> error = 2e-5 * np.cos(14 * theta) + 1e-6 * rng.standard_normal(theta.size)
    >>> run = rverror.run_from_arrays(input_angle=14 * theta, te=error)
    >>> found = diagnose(Model(rverror.Drive(ratio=14.0, shafts={"motor": 14.0})), [run])
    >>> found.verdict, found.added[0].effect.key, dict(found.added[0].effect.indices)
    ('explained', 'shaft.eccentricity', {'shaft': 'motor', 'harmonic': 1})
    """
    tell = progress or (lambda text: None)
    unit = model.mechanism
    if isinstance(unit, Drive):
        return diagnose_drive(model, runs, tell)
    declared = model
    fit_runs, growth, notes = _prepare(declared, unit, runs)
    model = replace(declared, effects=tuple(e for e in declared.effects if source(e.key).periodic))
    notes += _condition_notes(model, unit, fit_runs)
    likely, unaligned = _with_zeros(model, unit, runs, fit_runs)
    best = min((searched(one, unit, fit_runs, tell) for one in likely), key=Outcome.cost)
    search, fit, printed = best.search, best.fit, best.printed
    if unaligned:
        notes.append(_offset_note(best))
    grown = [
        replace(one, heldout_rms=search.residual(best.refitted, beside=growth.missed(count)).heldout_rms)
        for count, one in enumerate(growth.added, 1)
    ]
    settled = "explained" if growth.added or best.added else "nothing_missing"
    notes += _strained(search.model, fit) + lost_motion_notes(fit_runs, printed, fit)
    if not fit.converged:
        notes.append("the last fit stopped before it settled: sizes may be off by more than their intervals")
    return Diagnosis(
        verdict="unexplained" if best.lines else settled,
        noise_rms=float(np.sqrt(np.mean([noise_rms(run.values) ** 2 for run in fit_runs]))),
        before=search.residual(printed, hold=True, beside=growth.missed()),
        before_refitted=search.residual(best.refitted, beside=growth.missed(0)),
        after=search.residual(fit),
        added=(*grown, *best.added),
        unexplained=best.lines,
        model=_with_growing(declared, fit.model, growth, best.added),
        declared=declared,
        candidates=best.candidates,
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
                measured.index,
                (first_left.mean(axis=0), last_left.mean(axis=0)),
            )
            for run, measured, first, last, first_left, last_left in zip(
                fit_runs,
                runs,
                printed.predictions,
                fit.predictions,
                search.left_out(printed, hold=True, beside=growth.missed()),
                search.left_out(fit),
                strict=True,
            )
        ),
        notes=(*notes, *best.notes),
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


def _centred(values: Array) -> Array:
    return np.asarray(values - values.mean(), dtype=np.float64)


def _prepare(model: Model, unit: Reducer, runs: Sequence[Run]) -> tuple[list[FitRun], Growth, list[str]]:
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
    growth = growing_errors(model, names, values, rows)
    result = [
        fit_run(name, Predictor(unit, where), measured - grown)
        for name, where, measured, grown in zip(names, conditions, values, growth.fitted(), strict=True)
    ]
    result, unshared = with_shared_zeros(unit, result, ["" if run.index == "unknown" else run.index for run in runs])
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
    model: Model, unit: Reducer, runs: Sequence[Run], fit_runs: Sequence[FitRun]
) -> tuple[list[Model], bool]:
    """The model with each likely offset of the gear's marks, where the runs' zero is not on them."""
    if runs[0].index != "unknown" or any(source(e.key).acts == "marks" for e in model.effects):
        return [model], False
    first, *others = (model.with_effects(offset) for offset in index_offsets(model, unit, fit_runs))
    return [first, *sorted(others, key=lambda one: promise(one, unit, fit_runs))[: _ZEROS - 1]], True


def _offset_note(best: Outcome) -> str:
    at = len(best.search.model.effects) - 1
    first = sum(len(e.values) for e in best.search.model.effects[:at])
    value, spread = best.fit.model.effects[at].values[0], math.sqrt(best.fit.covariance[first, first])
    if not math.isfinite(spread) or spread > 1:
        return "index unknown: nothing that shows is declared or found, so the gear's marks cannot be placed"
    return (
        f"index unknown: the gear's marks are {math.degrees(value):.4g} +- {math.degrees(1.96 * spread):.2g} deg ahead "
        "of the bench's zero, fitted together with all sizes; all runs are taken to have the same zero"
    )
