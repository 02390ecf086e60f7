"""Runs computed from a model, in the form in which a bench writes them."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rverror.action_line import Array
from rverror.compose import transmission_error
from rverror.errors import InputError
from rverror.kinematics import samples_needed
from rverror.measurement import Run, run_from_arrays
from rverror.model import Model
from rverror.prediction import Conditions, predict
from rverror.reducer import Reducer

_LARGEST = 5_000_000


def simulate(
    model: Model,
    *,
    points: int | None = None,
    revolutions: int = 1,
    torque: float | None = None,
    method: str = "closed",
    direction: float = 1.0,
) -> Run:
    """Compute the run that a bench without noise would record.

    Parameters
    ----------
    model : Model
    points : int, optional
        Samples per output turn; what the highest mesh order needs where left out.
    revolutions : int
        Output turns.
    torque : float, optional
        Size of the output torque, N*mm; needed by the equilibrium, and written into the run.
    method : {"closed", "equilibrium"}
        Closed form, or the loaded equilibrium.
    direction : float
        +1 forward, -1 reverse.

    Returns
    -------
    Run

    Raises
    ------
    InputError
        If a number is out of range or the method cannot be used with the model.

    Examples
    --------
    >>> import rverror
    >>> run = simulate(rverror.Model(rverror.reducer("RV-40E")), points=64)
    >>> run.input_angle.size
    64
    """
    unit = model.mechanism
    if points is None:
        points = samples_needed(unit) if isinstance(unit, Reducer) else 4096
    if points < 16:
        raise InputError(f"points = {points}: must be 16 or more per output turn")
    if revolutions < 1:
        raise InputError(f"revolutions = {revolutions}: must be 1 or more")
    if points * revolutions > _LARGEST:
        raise InputError(f"points * revolutions = {points * revolutions}: must be {_LARGEST} or fewer; ask for fewer")
    if torque is not None and not torque > 0:
        raise InputError(f"torque = {torque / 1e3:g} N*m: must be above 0; the direction comes from the motion")
    turn = 2 * math.pi * np.arange(points * revolutions) / points
    theta = turn if direction > 0 else 2 * math.pi * revolutions - turn
    if method == "closed":
        error = transmission_error(model, theta, direction=direction)
    elif method == "equilibrium":
        if not isinstance(unit, Reducer):
            raise InputError("method = equilibrium: a [drive] has no geometry; use --method closed")
        if torque is None:
            raise InputError("method = equilibrium: needs a torque; give one, e.g. --torque '20 N*m'")
        error = _loaded(model, theta, Conditions(theta[:points], direction, torque))
    else:
        raise InputError(f"method = {method!r}: must be 'closed' or 'equilibrium'")
    run = run_from_arrays(
        input_angle=theta * unit.ratio,
        output_angle=theta + error,
        direction="forward" if direction > 0 else "reverse",
        torque=torque,
    )
    return replace(run, metadata={**run.metadata, "simulated": f"rverror, {method}; not a measurement"})


def _loaded(model: Model, theta: Array, one_turn: Conditions) -> Array:
    """Solve one turn where every turn is alike, else all of them."""
    alike = isinstance(model.mechanism, Reducer) and model.mechanism.exact_ratio.denominator == 1
    grows = any(e.key in ("sensor.ratio_error", "sensor.drift") for e in model.effects)
    conditions = one_turn if alike and not grows else replace(one_turn, theta=theta)
    error = predict(model, conditions).transmission_error
    return np.resize(error, theta.size)
