"""Where runs have their zero: shared, so that the lost motion between them counts, or not on the gear's marks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rverror.base.arrays import Array
from rverror.base.units import ARCSEC
from rverror.diagnosis.harmonics.fit import Fit
from rverror.diagnosis.harmonics.runs import FitRun
from rverror.diagnosis.policy import POLICY, Policy
from rverror.geartrain.kinematics import fundamental_orders, true_period
from rverror.geartrain.mechanism import Reducer
from rverror.model import sensor
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.model.readings import beyond, felt


def backlash_lost_motion(reducer: Reducer) -> float:
    """Lost motion at the output, input held, that the gear backlash makes.

    Returns
    -------
    float
        b / (R r1 cos(alpha)) for a backlash b along the line of action of each mesh, rad.

    Examples
    --------
    >>> from rverror import reducer
    >>> round(backlash_lost_motion(reducer("RV-40E")) / ARCSEC, 2)
    5.38
    """
    return reducer.gear_backlash / (reducer.ratio * reducer.sun_pitch_radius * math.cos(reducer.pressure_angle))


def with_shared_zeros(
    unit: Reducer, runs: Sequence[FitRun], labels: Sequence[str], *, policy: Policy = POLICY
) -> tuple[list[FitRun], list[str]]:
    """Runs that know which of them share a zero, and how well the model knows their means.

    Parameters
    ----------
    unit : Reducer
    runs : sequence of FitRun
    labels : sequence of str
        Index label of each run, empty for a zero of its own.
    policy : Policy

    Returns
    -------
    list of FitRun, list of str
        Runs and notes.
    """
    result, notes = [], []
    for run, label in zip(runs, labels, strict=True):
        if labels.count(label) > 1 and label and not run.conditions.torque:
            notes.append(
                f"{run.name}: index {label}: without output_torque its windup is unknown; it has its own offset"
            )
            label = ""
        result.append(replace(run, zero=label, mean_variance=_mean_variance(unit, run, policy)) if label else run)
    return result, notes


def _mean_variance(unit: Reducer, run: FitRun, policy: Policy) -> float:
    """Variance of the mean of one period: of the noise, and of what the model does not know."""
    means = run.values.mean(axis=1)
    slow = float(run.noise[:3].mean()) / run.conditions.theta.size
    noise = max(slow, float(means.var(ddof=1)))
    windup = abs(float(run.predictor.predict(Model(unit)).transmission_error.mean()))
    backlash = backlash_lost_motion(unit)
    # of the difference of two runs, so half of it each
    unknown = ((policy.backlash_share * backlash) ** 2 + (policy.windup_share * (2 * windup - backlash)) ** 2) / 2
    return noise + run.periods * unknown


def lost_motion_notes(runs: Sequence[FitRun], declared: Fit, fitted: Fit) -> list[str]:
    """Lost motion between runs of one zero and opposite directions, as measured and as predicted.

    Parameters
    ----------
    runs : sequence of FitRun
    declared, fitted : Fit
        Before and after what was added.
    """
    notes = []
    for i, one in enumerate(runs):
        for j, other in enumerate(runs):
            ways = (one.conditions.direction, other.conditions.direction)
            if not one.zero or one.zero != other.zero or ways != (1.0, -1.0):
                continue
            if one.conditions.torque != other.conditions.torque:
                continue
            pairs = [(one.values, other.values)] + [
                (fit.predictions[i].transmission_error, fit.predictions[j].transmission_error)
                for fit in (declared, fitted)
            ]
            measured, before, after = (float(np.mean(b) - np.mean(a)) / ARCSEC for a, b in pairs)
            notes.append(
                f"{one.name} and {other.name} share the zero {one.zero}: lost motion {measured:.4g} arcsec, declared "
                f"model {before:.4g}, with what was added {after:.4g}; half of the gear backlash and a twentieth of "
                "the windup count as unknown"
            )
    return notes


_POINTS = 2**15  # angles a period at which the declared waveform is laid over the measured one
_ANYWHERE = math.pi  # uncertainty of an offset of which nothing is known, rad


def index_offsets(model: Model, unit: Reducer, runs: Sequence[FitRun], *, policy: Policy = POLICY) -> list[Effect]:
    """Likely offsets of the gear's marks from the bench's zero, the likeliest first.

    The declared waveform is turned against the measured one; the sum of squares over all runs, in units of their
    noise, has a minimum at each likely angle:

        sum_k w_k |Y_k - G_k exp(i k phi)|^2 = const - 2 Re sum_k w_k conj(Y_k) G_k exp(i k phi).

    Parameters
    ----------
    model : Model
        Declared, with its zero on the marks.
    unit : Reducer
    runs : sequence of FitRun
        All of one zero.
    policy : Policy

    Returns
    -------
    list of Effect
        ``sensor.index_offset``; one of 0 where nothing that is declared shows.

    Notes
    -----
    The gear train has one degree of freedom, so one angle is all that can be unknown.  Where all that is declared
    repeats with the crank it is known but for whole turns of the crank against the carrier, which differ in no
    declared waveform: the least one is given.
    """
    gears = replace(model, effects=felt(model.effects))
    read = replace(model, effects=beyond(model.effects))
    turns = true_period(unit)
    match = np.zeros(_POINTS)
    for run in runs:
        wave = run.predictor.predict(gears).transmission_error
        rest = run.values.mean(axis=0) - run.predictor.predict(read).transmission_error
        count = min(run.noise.size, _POINTS // 2 - 1)
        product = np.conj(np.fft.rfft(rest))[1 : count + 1] * np.fft.rfft(wave)[1 : count + 1]
        lines = np.zeros(_POINTS, dtype=np.complex128)
        lines[1 : count + 1] = product * run.periods / run.noise[:count] * 2 / wave.size
        match += (np.fft.ifft(lines) * _POINTS).real
    if np.ptp(match) < policy.marks_show:
        return [_offset(0.0)]
    repeat = math.ceil(_POINTS / fundamental_orders(unit)["crank"] / turns)
    if all(source(e.key).repeats_with_crank(unit, e.indices) for e in gears.effects):
        match = match[:repeat]
    # what is missing may turn the match: angles around the best one compete too
    count = policy.angles_around
    around = [(_peaks(match)[0] + i * repeat // count) % match.size for i in range(1, count)]
    places = list(dict.fromkeys([*_peaks(match)[:count], *around]))
    return [_offset(2 * math.pi * turns * at / _POINTS) for at in places]


def _peaks(match: Array) -> list[int]:
    """Places of the local maxima of a row that closes on itself, the highest first."""
    high = np.flatnonzero((match >= np.roll(match, 1)) & (match > np.roll(match, -1)))
    return [int(at) for at in high[np.argsort(-match[high], kind="stable")]]


def _offset(angle: float) -> Effect:
    return Effect(sensor.MARKS.key, {}, (angle,), _ANYWHERE, "found by rverror diagnose: index unknown")
