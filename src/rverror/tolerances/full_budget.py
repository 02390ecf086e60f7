"""The whole error budget of a model and its tolerances: closed form, virtual units, Sobol indices, contact."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

from rverror.base.text import PathLike
from rverror.base.viewed import Viewed
from rverror.model.effects import Model
from rverror.tolerances.closed_form import Budget, budget
from rverror.tolerances.control_variate import ContactCorrection, contact_correction
from rverror.tolerances.sampling import COUNT, VirtualUnits, virtual_units
from rverror.tolerances.sobol import SobolIndices, stack_indices
from rverror.tolerances.stacking import Stack, Tolerance, stack

#: Points of the Sobol indices, and units solved at the load, where no number is given.
INDEX_COUNT, CONTACT_COUNT = 2**13, 64


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
    contact : ContactCorrection, optional
        What contacts that open at a load change; None without a load, and at a speed.
    """

    model: Model
    tolerances: tuple[Tolerance, ...]
    stack: Stack
    direction: float
    closed: Budget
    units: VirtualUnits
    indices: SobolIndices | None
    contact: ContactCorrection | None


def error_budget(
    model: Model,
    tolerances: Sequence[Tolerance],
    theta: Any | None = None,
    *,
    direction: float = 1.0,
    torque: Any | None = None,
    speed: Any | None = None,
    count: int = COUNT,
    index_count: int = INDEX_COUNT,
    contact_count: int = CONTACT_COUNT,
    seed: int = 0,
    executor: Executor | None = None,
    folder: PathLike | None = None,
    progress: Callable[[str], None] | None = None,
) -> ErrorBudget:
    """Compute the error budget of a model and its tolerances.

    Parameters
    ----------
    model : Model
    tolerances : sequence of Tolerance
        From `load_tolerances` or `tolerance`.
    theta, direction
        As for `stack`.
    torque : float or quantity, optional
        Size of the output torque, N*mm.  With one, a sample of the units is solved at that load, contacts that open
        included, and corrects the linear result.
    speed : float or quantity, optional
        Of the input, rad/s: influences of the loaded reducer in motion, as for `stack`.  The torque is then its load,
        and no unit is solved by itself.
    count : int
        Virtual units.
    index_count : int
        Points of the Sobol indices.
    contact_count : int
        Units solved at the load.
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
    tell = progress or (lambda text: None)
    laid_out = stack(model, tolerances, theta=theta, direction=direction, torque=torque, speed=speed)
    tell(f"closed form of {len(laid_out.components)} components")
    closed = budget(laid_out, seed=seed)
    units = virtual_units(laid_out, count, seed=seed, executor=executor, folder=folder, progress=progress)
    indices = None
    if any(entry.effect == "wave" for entry in closed.contributions):
        indices = stack_indices(laid_out, count=index_count, seed=seed, executor=executor, progress=progress)
    contact = None
    if torque is not None and speed is None:
        contact = contact_correction(
            model,
            tolerances,
            laid_out,
            units,
            torque=torque,
            direction=direction,
            count=contact_count,
            seed=seed,
            executor=executor,
            progress=progress,
        )
    return ErrorBudget(model, tuple(tolerances), laid_out, direction, closed, units, indices, contact)
