"""What a model predicts under the conditions of a run: output error, and its change with each parameter."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from rverror.action_line import Array, ContactForces
from rverror.catalogue import source
from rverror.compose import closed_form_forces, effect_matrix, effect_values, pose, source_matrix
from rverror.equilibrium import linearise
from rverror.kinematics import Pose, fundamental_orders
from rverror.model import Effect, Model
from rverror.reducer import Reducer

#: Frames whose errors meet their contacts again after one turn of the crank against the carrier.
_CARRIER_SIDE = {"carrier", "disc", "crank", "planet", "bearing", "direction"}
_POINTS_PER_REPEAT = 256


@dataclass(frozen=True)
class Conditions:
    """Where and how a run was measured.

    Attributes
    ----------
    theta : ndarray, shape (n,)
        Nominal output angle, rad.
    direction : float
        +1 forward, -1 reverse.
    torque : float, optional
        Size of the output torque, N*mm; without one the closed form predicts.
    time : ndarray, shape (n,), optional
        Time, s.
    """

    theta: Array
    direction: float
    torque: float | None = None
    time: Array | None = None


@dataclass(frozen=True)
class Prediction:
    """Predicted output error, shape (n,), rad, and its change per parameter of each effect, shape (parameters, n)."""

    transmission_error: Array
    matrix: Array


def uses_equilibrium(model: Model, conditions: Conditions) -> bool:
    """Tell whether the loaded equilibrium predicts, as it does for a reducer under a known torque."""
    return isinstance(model.mechanism, Reducer) and bool(conditions.torque)


def contact_state(model: Model, conditions: Conditions) -> tuple[Pose, ContactForces]:
    """Motion and contact forces per unit torque at every sample, for the influence of any source.

    Parameters
    ----------
    model : Model
    conditions : Conditions

    Returns
    -------
    Pose, mapping of str to ndarray
    """
    if uses_equilibrium(model, conditions):
        loaded = linearise(model, conditions.theta, torque=conditions.torque, direction=conditions.direction)
        return replace(loaded.motion, time=conditions.time), loaded.forces
    motion = pose(
        model.mechanism,
        conditions.theta,
        direction=conditions.direction,
        time=conditions.time,
        torque=conditions.torque,
    )
    return motion, closed_form_forces(motion)


def predict(model: Model, conditions: Conditions) -> Prediction:
    """Predict the output error and its change with every parameter.

    Parameters
    ----------
    model : Model
    conditions : Conditions

    Returns
    -------
    Prediction

    Raises
    ------
    NotConvergedError
        If the equilibrium was not reached at some angle.

    Notes
    -----
    What is not fixed in the housing repeats with every turn of the crank against the carrier, 40 times a turn for the
    RV-40E; then the equilibrium is solved over one repeat and carried over by its Fourier series.
    """
    if not uses_equilibrium(model, conditions):
        motion, forces = contact_state(model, conditions)
        matrix = effect_matrix(motion, forces, model.effects)
        return Prediction(effect_values(model.effects) @ matrix, matrix)
    gears = tuple(e for e in model.effects if not _is_reading(e))
    geared = replace(model, effects=gears)
    if all(repeats_with_crank(e.key) for e in gears):
        loaded = _predict_by_repeat(geared, conditions)
    else:
        loaded = _predict_loaded(geared, conditions)
    return _with_readings(model, conditions, loaded)


def repeats_with_crank(key: str) -> bool:
    """Tell whether a source's effect on the gear train repeats with every turn of the crank against the carrier."""
    return key.startswith("sensor.") or source(key).frame in _CARRIER_SIDE


def _is_reading(effect: Effect) -> bool:
    return effect.key.startswith("sensor.")


def _predict_loaded(model: Model, conditions: Conditions) -> Prediction:
    loaded = linearise(model, conditions.theta, torque=conditions.torque, direction=conditions.direction)
    matrix = effect_matrix(loaded.motion, loaded.forces, model.effects)
    return Prediction(loaded.state.transmission_error, matrix)


def _predict_by_repeat(model: Model, conditions: Conditions) -> Prediction:
    assert isinstance(model.mechanism, Reducer)
    order = fundamental_orders(model.mechanism)["crank"]
    start = conditions.theta[0]
    theta = start + 2 * math.pi / order / _POINTS_PER_REPEAT * np.arange(_POINTS_PER_REPEAT)
    one = _predict_loaded(model, replace(conditions, theta=theta, time=None))
    lines = np.fft.rfft(np.vstack([one.transmission_error, one.matrix]), axis=1)[:, :-1] / _POINTS_PER_REPEAT
    lines[:, 1:] *= 2
    if conditions.theta.size > 2:  # what the angles asked for could not hold would fold onto lower orders
        highest = math.pi / abs(float(conditions.theta[1] - conditions.theta[0])) / order
        lines[:, math.ceil(highest) :] = 0
    phase = np.exp(1j * order * np.outer(np.arange(lines.shape[1]), conditions.theta - start))
    rows = (lines @ phase).real
    return Prediction(rows[0], rows[1:])


def _with_readings(model: Model, conditions: Conditions, loaded: Prediction) -> Prediction:
    """Put the readings of the measuring chain back among the gear train's effects, in the model's order."""
    motion = Pose(
        ratio=model.mechanism.ratio,
        theta=conditions.theta,
        direction=np.full_like(conditions.theta, conditions.direction),
        time=conditions.time,
    )
    reading = closed_form_forces(motion)
    error, rows, at = loaded.transmission_error.copy(), [], 0
    for effect in model.effects:
        count = len(effect.values)
        if _is_reading(effect):
            matrix = source_matrix(motion, reading, effect.key, effect.indices)
            error = error + np.array(effect.values) @ matrix
        else:
            matrix, at = loaded.matrix[at : at + count], at + count
        rows.append(matrix)
    matrix = np.concatenate(rows) if rows else np.zeros((0, conditions.theta.size))
    return Prediction(error, np.asarray(matrix, dtype=np.float64))
