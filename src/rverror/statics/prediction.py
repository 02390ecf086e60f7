"""What a model predicts under the conditions of a run: output error, and its change with each parameter."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rverror.base.arrays import Array, slope
from rverror.geartrain.contacts import closed_form_forces, motion
from rverror.geartrain.kinematics import OperatingConditions, Pose, frame_orders, true_period
from rverror.geartrain.mechanism import Mechanism, Reducer
from rverror.model import sensor
from rverror.model.catalogue import source
from rverror.model.compose import effect_matrix, effect_values, source_matrix
from rverror.model.effects import Model
from rverror.model.readings import felt
from rverror.statics.energy import Layout
from rverror.statics.loaded_state import Prediction, statics_of


def predict(model: Model, conditions: OperatingConditions) -> Prediction:
    """Predict the output error and its change with every parameter: of a reducer under a known torque at the load.

    Parameters
    ----------
    model : Model
    conditions : OperatingConditions

    Returns
    -------
    Prediction

    Raises
    ------
    NotConvergedError
        If the equilibrium was not reached at some angle.
    """
    gears = felt(model.effects)
    if any(source(e.key).acts == "marks" for e in model.effects):
        _check_whole_periods(model.mechanism, conditions.theta)
        ahead = conditions.at(conditions.theta + model.index_offset)  # where the gear train stands
        turned = predict(replace(model, effects=gears), ahead)
        return _as_read(model, motion(model.mechanism, conditions), turned)
    if not isinstance(model.mechanism, Reducer) or (conditions.load is None and not conditions.torque):
        where = motion(model.mechanism, conditions)
        matrix = effect_matrix(where, closed_form_forces(where), model.effects)
        return Prediction(effect_values(model.effects) @ matrix, matrix)
    statics = statics_of(model.mechanism, replace(conditions, time=None))
    return _as_read(model, replace(statics.motion, time=conditions.time), statics.predict(gears))


def _check_whole_periods(mechanism: Mechanism, theta: Array) -> None:
    step = np.diff(theta)
    periods = theta.size * float(step.mean()) / (2 * math.pi * true_period(mechanism)) if step.size else 0.0
    if not step.size or np.ptp(step) > 1e-6 * abs(step.mean()) or abs(periods - round(periods)) > 1e-6 or not periods:
        raise ValueError(f"{sensor.MARKS.key} is predicted over even angles of whole periods; cut the run into them")


def turned(reducer: Reducer, poses: Array, angle: Array) -> Array:
    """Poses (n, unknowns) of a gear train that is turned as a whole about its axis with the output's angle (n,)."""
    layout, result = Layout(reducer), poses.copy()
    x = np.array([0, *layout.disc, *layout.crank, layout.sun])
    place = (poses[:, x] + 1j * poses[:, x + 1]) * np.exp(1j * frame_orders(reducer)["carrier"] * angle)[:, None]
    result[:, x], result[:, x + 1] = place.real, place.imag
    return result


def _as_read(model: Model, read: Pose, loaded: Prediction) -> Prediction:
    """Put what acts beyond the gear train back among its effects, in the model's order."""
    reading = {"output": np.ones((1, read.theta.size))}
    error, rows, at = loaded.transmission_error.copy(), [], 0
    for effect in model.effects:
        count = len(effect.values)
        if source(effect.key).acts == "marks":
            travel = read.theta.size * float(read.theta[1] - read.theta[0])
            matrix = slope(loaded.transmission_error, 2 * math.pi / travel)[None]
        elif source(effect.key).at_output:
            matrix = source_matrix(read, reading, effect.key, effect.indices)
            error = error + np.array(effect.values) @ matrix
        else:
            matrix, at = loaded.matrix[at : at + count], at + count
        rows.append(matrix)
    matrix = np.concatenate(rows) if rows else np.zeros((0, read.theta.size))
    return replace(loaded, transmission_error=error, matrix=np.asarray(matrix, dtype=np.float64))
