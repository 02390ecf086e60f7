"""The whole error budget of tolerances: closed form, virtual units, Sobol indices, units at the load."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from rverror.base.arrays import Array
from rverror.base.directions import Direction, direction_sign
from rverror.base.errors import InputError, renamed
from rverror.base.progress import Progress
from rverror.base.text import PathLike
from rverror.base.units import InCore
from rverror.base.viewed import OneLine, Viewed
from rverror.geartrain.torque_over_turn import peak_torque
from rverror.model.effects import Model
from rverror.tolerances.closed_form import Budget, budget
from rverror.tolerances.declared import Tolerance
from rverror.tolerances.loaded_units import LoadedUnits
from rverror.tolerances.loaded_yield import COUNT as LOADED_COUNT, Verified, loaded_units, verified
from rverror.tolerances.sampling import COUNT, VirtualUnits, virtual_units
from rverror.tolerances.sobol import COUNT as INDEX_COUNT, SobolIndices, sobol_indices, stack_indices, without_joined
from rverror.tolerances.specification import Limit, limit
from rverror.tolerances.stacking import Stack, stack

#: Points of the Sobol indices at the load: (entries + 2) units each.
POINTS = 128

_FEWEST = 16  # units


@dataclass(frozen=True)
class LoadedBudget(OneLine):
    """What tolerances make of each limited quantity at the load.

    Attributes
    ----------
    verified : Verified
        Distribution and yield of each limit.
    shares : tuple of SobolIndices or None
        Of each limit, one share for each tolerance; None where the quantity does not vary or none was asked.
    closed_form : tuple of float or None
        Yield that the closed form, contacts closed, tells of each limit; None where it does not know the quantity.
    worst_parts : tuple of float or None
        rad; peak-to-peak that the worst parts of the closed form make at the load of each transmission error.
    """

    verified: Verified
    shares: tuple[SobolIndices | None, ...]
    closed_form: tuple[float | None, ...]
    worst_parts: tuple[float | None, ...]


def _turns(units: LoadedUnits, points: Array) -> Array:
    """Turns of units by their variates, shape (units, limits); the mean one of a unit without an equilibrium."""
    found = units.solved(units.stack.standard(points), units.stack.width).turns
    known = np.isfinite(found)
    return np.where(known, found, np.mean(found, axis=0, where=known))


@dataclass(frozen=True)
class ErrorBudget(Viewed):
    """What tolerances make of the output error.

    Attributes
    ----------
    model : Model
    tolerances : tuple of Tolerance
    stack : Stack
        The two as arrays.
    direction : float
        +1 forward, -1 reverse.
    closed : Budget
        Mean, variance, worst case and root sum of squares.
    units : VirtualUnits
        Peak-to-peak, max, rms and offset of many units.
    indices : SobolIndices, optional
        Of the peak-to-peak, one for each tolerance; None where no tolerance moves it.
    at_load : LoadedBudget, optional
        Units solved at the loads of limits, contacts that open included; None without limits.
    """

    model: Model
    tolerances: tuple[Tolerance, ...]
    stack: Stack
    direction: float
    closed: Budget
    units: VirtualUnits
    indices: SobolIndices | None
    at_load: LoadedBudget | None


@renamed(speed="input_speed")
def error_budget(
    model: Model,
    tolerances: Sequence[Tolerance],
    theta: Any | None = None,
    *,
    direction: Direction = "forward",
    torque: Any | None = None,
    input_speed: Any | None = None,
    count: int = COUNT,
    index_count: int = INDEX_COUNT,
    limits: Sequence[Limit] = (),
    loaded_count: int = LOADED_COUNT,
    seed: int = 0,
    executor: Executor | None = None,
    folder: PathLike | None = None,
    progress: Progress | None = None,
) -> ErrorBudget:
    """Compute the error budget of a model and its tolerances.

    Parameters
    ----------
    model : Model
    tolerances : sequence of Tolerance
        From `load_tolerances` or `tolerance`.
    theta, direction
        As for `stack`.
    torque : float, quantity or callable, optional
        Size of the output torque, N*mm: at a speed the load.  Without input_speed and limits, units are solved
        under it; it may then be a function of the output angle such as a `GravityArm`, of which the closed form takes
        the largest.
    input_speed : float or quantity, optional
        Of the input, rad/s: influences of the loaded reducer in motion, as for `stack`.  The torque is then its load.
    count : int
        Virtual units.
    index_count : int
        Points of the Sobol indices; 0 for none, also at the load, where they take most of the time.
    limits : sequence of Limit, optional
        Of transmission error, lost motion, backlash or stiffness at loads; one without a value asks for its
        distribution.  Units are solved at each load by the equilibrium, contacts that open included.
    loaded_count : int
        Units that are.
    seed, executor, folder
        As for `virtual_units`.
    progress : callable, optional
        Called with a line of text as the work goes on.

    Returns
    -------
    ErrorBudget

    Raises
    ------
    InputError, ValueError
        If a tolerance, an angle or a number cannot be used.

    Examples
    --------
    >>> import rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> found = error_budget(unit, [rverror.tolerance("crank.eccentricity", "5 um")], count=512, index_count=256)
    >>> found.closed.contributions[0].share
    1.0
    """
    direction = direction_sign(direction)
    tell = progress or (lambda text: None)
    if torque is not None and input_speed is None and not limits:
        limits = [limit("transmission_error", torque=torque)]
    if callable(torque):
        if input_speed is not None:
            raise InputError("torque: at a speed the load is one for all angles; give a number such as '20 N*m'")
        torque = InCore(peak_torque(torque))
    laid_out = stack(model, tolerances, theta=theta, direction=direction, torque=torque, input_speed=input_speed)
    tell(f"closed form of {len(laid_out.components)} components")
    closed = budget(laid_out)
    units = virtual_units(laid_out, count, seed=seed, executor=executor, folder=folder, progress=progress)
    indices = None
    if index_count and any(entry.effect == "wave" for entry in closed.contributions):
        indices = stack_indices(laid_out, count=index_count, seed=seed, executor=executor, progress=progress)
    at_load = None
    if limits:
        if loaded_count < _FEWEST:
            raise InputError(
                f"count = {loaded_count}: too few units under load for an interval; give {_FEWEST} or more"
            )
        loaded = loaded_units(model, tolerances, limits, direction=direction)
        width, drawn_by = loaded.stack.width, loaded.stack.variate_entry
        found = verified(loaded, width, count=loaded_count, seed=seed, progress=progress)
        shares: tuple[SobolIndices | None, ...] = (None,) * len(limits)
        if index_count:
            turns = partial(_turns, loaded)
            shares = sobol_indices(turns, drawn_by, count=POINTS, seed=seed, progress=progress)
        errors = [one.quantity == "transmission_error" for one in loaded.limits]
        worst = loaded.solved((closed.worst.peak_to_peak_values / width[loaded.stack.entry])[None], width).turns[0]
        known = [
            units.yield_at(one.value).value if error and one.value is not None else None
            for one, error in zip(loaded.limits, errors, strict=True)
        ]
        at_load = LoadedBudget(
            found,
            tuple(None if one is None else without_joined(one, loaded.stack) for one in shares),
            tuple(known),
            tuple(float(turn) if error else None for turn, error in zip(worst, errors, strict=True)),
        )
    return ErrorBudget(model, tuple(tolerances), laid_out, direction, closed, units, indices, at_load)
