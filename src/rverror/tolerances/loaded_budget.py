"""The budget at the load: distribution, yield, shares of the variance and worst parts of each limited quantity."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.viewed import OneLine
from rverror.tolerances.closed_form import Budget
from rverror.tolerances.loaded_units import LoadedUnits
from rverror.tolerances.loaded_yield import Verified, verified
from rverror.tolerances.sampling import VirtualUnits
from rverror.tolerances.sobol import SobolIndices, sobol_indices, without_joined

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


def loaded_budget(
    units: LoadedUnits,
    closed: Budget,
    linear: VirtualUnits,
    *,
    count: int,
    points: int,
    seed: int,
    progress: Callable[[str], None] | None,
) -> LoadedBudget:
    """Solve units at the loads of limits and tell what their tolerances make of each quantity.

    Parameters
    ----------
    units : LoadedUnits
        A limit without a value asks for the distribution alone.
    closed : Budget
        Of the same tolerances in closed form: whose worst parts are tried.
    linear : VirtualUnits
        Of the closed form, for the yield beside.
    count : int
        Units, 16 or more.
    points : int
        Of the Sobol indices; 0 for none.
    seed : int
    progress : callable, optional
        Called with a line of text as the work goes on.

    Returns
    -------
    LoadedBudget

    Raises
    ------
    InputError
        If a setting is unusable.
    """
    if count < _FEWEST:
        raise InputError(f"count = {count}: too few units at the load for an interval; give {_FEWEST} or more")
    stack = units.stack
    found = verified(units, stack.width, count=count, seed=seed, progress=progress)
    indices: tuple[SobolIndices | None, ...] = (None,) * len(units.limits)
    if points:
        indices = sobol_indices(
            partial(_turns, units), stack.variate_entry, len(units.limits), count=points, seed=seed, progress=progress
        )
    errors = [one.quantity == "transmission_error" for one in units.limits]
    worst = units.solved((closed.worst.peak_to_peak_values / stack.width[stack.entry])[None], stack.width).turns[0]
    known = [
        linear.yield_at(one.value).value if error and one.value is not None else None
        for one, error in zip(units.limits, errors, strict=True)
    ]
    return LoadedBudget(
        found,
        tuple(None if one is None else without_joined(one, stack) for one in indices),
        tuple(known),
        tuple(float(turn) if error else None for turn, error in zip(worst, errors, strict=True)),
    )
