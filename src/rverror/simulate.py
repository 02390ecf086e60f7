"""Runs computed from a model, in the form in which a bench writes them."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from rverror import units
from rverror.action_line import Array
from rverror.compose import transmission_error
from rverror.equilibrium import equilibrium
from rverror.errors import InputError
from rverror.kinematics import samples_needed
from rverror.measurement import Run, run_from_arrays
from rverror.model import Model
from rverror.reducer import Drive, Reducer

_LARGEST = 5_000_000
_LARGEST_TORQUE = 1e12  # N*mm
_AT_ONCE = 4096  # angles solved together: bounds the memory


def simulate(
    model: Model,
    *,
    points: int | None = None,
    revolutions: int = 1,
    torque: Any | None = None,
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
    torque : float or quantity, optional
        Size of the output torque, plain numbers N*mm; needed by the equilibrium, and written into the run.
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
    size = None if torque is None else _torque(torque)
    if any(effect.key == "sensor.time_offset" for effect in model.effects):
        raise InputError("sensor.time_offset needs time, which a simulated run has not; remove the effect")
    turn = 2 * math.pi * np.arange(points * revolutions) / points
    theta = turn if direction > 0 else 2 * math.pi * revolutions - turn
    if method == "equilibrium":
        if not isinstance(unit, Reducer):
            raise InputError("method = equilibrium: a [drive] has no geometry; use --method closed")
        if size is None:
            raise InputError("method = equilibrium: needs a torque; give one, e.g. --torque '20 N*m'")
    elif method != "closed":
        raise InputError(f"method = {method!r}: must be 'closed' or 'equilibrium'")
    load = size if method == "equilibrium" else None
    error = _error(model, theta, points=points, torque=load, direction=direction)
    run = run_from_arrays(
        input_angle=theta * unit.ratio,
        output_angle=theta + error,
        direction="forward" if direction > 0 else "reverse",
        torque=size,
    )
    return replace(run, metadata={**run.metadata, "simulated": f"rverror, {method}; not a measurement"})


def _torque(value: Any) -> float:
    try:
        size = units.to_core(value, "torque")
    except ValueError as problem:
        raise InputError(f"torque: {str(problem).partition(';')[0]}; write it like '20 N*m'") from problem
    if not 0 < size <= _LARGEST_TORQUE:
        raise InputError(
            f"torque = {size / 1e3:g} N*m: must be above 0 and {_LARGEST_TORQUE / 1e3:g} N*m or less; "
            "the direction comes from the motion"
        )
    return size


def _error(model: Model, theta: Array, *, points: int, torque: float | None, direction: float) -> Array:
    """Gear train at every angle of one turn where every turn is alike, else of all; loaded where there is a torque.

    Readings of the measuring chain may drift from turn to turn, so they are added at all angles.
    """
    unit = model.mechanism
    readings = tuple(e for e in model.effects if e.key.startswith("sensor."))
    gears = replace(model, effects=tuple(e for e in model.effects if e not in readings))
    alike = isinstance(unit, Reducer) and unit.exact_ratio.denominator == 1
    wanted = theta[:points] if alike else theta
    solved = [
        transmission_error(gears, part, direction=direction)
        if torque is None
        else equilibrium(gears, part, torque=torque, direction=direction).transmission_error
        for part in np.array_split(wanted, math.ceil(wanted.size / _AT_ONCE))
    ]
    chain = Model(Drive(ratio=unit.ratio), readings)  # what is read needs no contacts
    return np.resize(np.concatenate(solved), theta.size) + transmission_error(chain, theta, direction=direction)
