"""What is said of a reducer's search: sizes with intervals, doubts, notes and waveforms."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rverror.base.arrays import Array
from rverror.base.text import describe
from rverror.diagnosis.harmonics.fit import Fit
from rverror.diagnosis.harmonics.likelihood import PeriodFit
from rverror.diagnosis.harmonics.periods import Periods, left_out
from rverror.diagnosis.harmonics.runs import independent_samples, whitened
from rverror.diagnosis.result import Addition, Candidate, Estimate, Trace
from rverror.diagnosis.search import Outcome
from rverror.model.catalogue import source
from rverror.runs.measurement import Run


def samples_behind(periods: Periods, fit: Fit, at: int) -> float:
    """Number of independent samples from which the noise of a fitted size is known.

    Parameters
    ----------
    periods : Periods
    fit : Fit
    at : int
        Place of the parameter.

    Returns
    -------
    float
        By `independent_samples`, with the weight that each harmonic has in the size; priors count as known.
    """
    runs = periods.runs
    seen = fit.free & np.isfinite(np.diag(fit.covariance))
    matrix = whitened(runs, [p.matrix[seen] for p in fit.predictions], [run.periods for run in runs])
    weights = (fit.covariance[at, seen] @ matrix) ** 2 / fit.misfit.scale
    shares, end = [], 0
    for run in runs:
        first, end = end, end + 2 * run.noise.size
        shares.append(weights[first:end].reshape(2, -1).sum(axis=0))
    known = float(fit.covariance[at, at]) - sum(float(share.sum()) for share in shares)
    return independent_samples(runs, shares, max(known, 0.0))


def addition_of(periods: Periods, found: PeriodFit, number: int) -> Addition:
    """Describe an effect that was added.

    Parameters
    ----------
    periods : Periods
    found : PeriodFit
    number : int
        Of the addition, from 0.
    """
    fit, record = found.fit, found.records[number]
    at = len(periods.model.effects) + number
    effect = fit.model.effects[at]
    first = sum(len(e.values) for e in fit.model.effects[:at])
    scale = periods.noise_scale(fit)
    estimates, notes = [], []
    for place, (parameter, value) in enumerate(zip(source(effect.key).parameters, effect.values, strict=True), first):
        variance, reach = float(fit.covariance[place, place]) * scale, math.nan
        if math.isfinite(variance):
            reach = periods.reach(variance, samples_behind(periods, fit, place))
        estimates.append(Estimate(parameter.name, parameter.dimension, value, value - reach, value + reach))
        if abs(value) > parameter.plausible:
            notes.append(f"{parameter.name}: larger than a workshop makes; the cause may be another of the same order")
    origin = "found by rverror diagnose in " + ", ".join(run.name for run in periods.runs)
    return Addition(
        replace(effect, origin=origin), tuple(estimates), record.alike, periods.orders(fit, at), record.heldout_rms,
        tuple(notes), record.candidates,
    )  # fmt: skip


def doubts(periods: Periods, outcome: Outcome[PeriodFit, Candidate]) -> tuple[str, ...]:
    """Why the last candidates were not named."""
    unsure = outcome.last.added[len(outcome.found.added) :]
    if unsure:
        names = " with ".join(describe(effect.key, effect.indices) for effect in unsure)
        orders = ", ".join(f"{line.order:g}" for line in outcome.left[:4])
        return (f"the best candidate, {names}, leaves lines of its own frame at order {orders}: not named",)
    if outcome.ranking and periods.lines(outcome.last.fit):
        nearest = describe(outcome.ranking[0].key, outcome.ranking[0].indices)
        return (f"no candidate holds at the load of the runs: not named; the nearest is {nearest}",)
    return ()


def strained(periods: Periods, fit: Fit) -> list[str]:
    """Declared sizes that the fit moved further than they are uncertain."""
    notes = []
    for declared, fitted in zip(periods.model.effects, fit.model.effects, strict=False):
        moved = max(abs(np.subtract(fitted.values, declared.values)))
        if declared.uncertainty and moved > periods.policy.strained_size * declared.uncertainty:
            name = describe(declared.key, declared.indices)
            notes.append(
                f"declared {name} moved by {moved / declared.uncertainty:.1f} of its uncertainty: measure it again"
            )
    return notes


def offset_note(periods: Periods, fit: Fit) -> str:
    """Where the gear's marks are, which the model has as its last declared effect."""
    place = periods.declared - 1
    value = fit.model.effects[len(periods.model.effects) - 1].values[0]
    spread = math.sqrt(fit.covariance[place, place])
    if not math.isfinite(spread) or spread > periods.policy.marks_placed:
        return "index unknown: nothing that shows is declared or found, so the gear's marks cannot be placed"
    reach = periods.reach(spread**2, samples_behind(periods, fit, place))
    return (
        f"index unknown: the gear's marks are {math.degrees(value):.4g} +- {math.degrees(reach):.2g} deg ahead "
        "of the bench's zero, fitted together with all sizes; all runs are taken to have the same zero"
    )


def traces(periods: Periods, runs: Sequence[Run], printed: Fit, fit: Fit, beside: Sequence[Array]) -> tuple[Trace, ...]:
    """Averaged waveforms of each run, before and after.

    Parameters
    ----------
    periods : Periods
    runs : sequence of Run
        As measured.
    printed, fit : Fit
        Before and after.
    beside : sequence of ndarray, shape (periods, n)
        What was taken off each run beforehand, which the residual before has.
    """
    before, after = left_out(periods, printed, hold=True, beside=beside), left_out(periods, fit)
    return tuple(
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
            periods.runs, runs, printed.predictions, fit.predictions, before, after, strict=True
        )
    )


def _centred(values: Array) -> Array:
    return np.asarray(values - values.mean(), dtype=np.float64)
