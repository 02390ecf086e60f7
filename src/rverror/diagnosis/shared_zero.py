"""Runs that share a zero: the difference of their means, the lost motion, counts as far as the model can know it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rverror.base.units import ARCSEC
from rverror.diagnosis.fit import Fit, FitRun
from rverror.geartrain.mechanism import Reducer
from rverror.model.effects import Model

#: Not known of a lost motion: a share of what the gear backlash makes of it, a nominal size that wears, and of the
#: elastic windup, for no stiffness is known better.
BACKLASH_SHARE, WINDUP_SHARE = 0.5, 0.05


def backlash_lost_motion(reducer: Reducer) -> float:
    """Lost motion at the output, input held, that the gear backlash makes.

    Parameters
    ----------
    reducer : Reducer

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


def with_shared_zeros(unit: Reducer, runs: Sequence[FitRun], labels: Sequence[str]) -> tuple[list[FitRun], list[str]]:
    """Runs that know which of them share a zero, and how well the model knows their means.

    Parameters
    ----------
    unit : Reducer
    runs : sequence of FitRun
    labels : sequence of str
        Index label of each run, empty for a zero of its own.

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
        result.append(replace(run, zero=label, mean_variance=_mean_variance(unit, run)) if label else run)
    return result, notes


def _mean_variance(unit: Reducer, run: FitRun) -> float:
    """Variance of the mean of one period: of the noise, and of what the model does not know."""
    means = run.values.mean(axis=1)
    slow = float(run.noise[:3].mean()) / run.conditions.theta.size
    noise = max(slow, float(means.var(ddof=1)))
    windup = abs(float(run.predictor.predict(Model(unit)).transmission_error.mean()))
    backlash = backlash_lost_motion(unit)
    # of the difference of two runs, so half of it each
    unknown = ((BACKLASH_SHARE * backlash) ** 2 + (WINDUP_SHARE * (2 * windup - backlash)) ** 2) / 2
    return noise + run.periods * unknown


def lost_motion_notes(runs: Sequence[FitRun], declared: Fit, fitted: Fit) -> list[str]:
    """Lost motion between runs of one zero and opposite directions, as measured and as predicted.

    Parameters
    ----------
    runs : sequence of FitRun
    declared, fitted : Fit
        Before and after what was added.

    Returns
    -------
    list of str
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
