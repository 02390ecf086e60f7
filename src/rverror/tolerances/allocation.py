"""Least cost: the widths of tolerances that keep the output error within limits, at the load or in closed form.

Pages ``theory/allocation.md`` and ``theory/at-the-load.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

from rverror.base import units
from rverror.base.directions import Direction
from rverror.base.errors import InputError, check_each, check_kind, renamed
from rverror.base.progress import Progress
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.tolerances.allocation_result import CLOSED_UNITS, Allocation, FrontPoint, described
from rverror.tolerances.constraints import WorstPeakToPeak
from rverror.tolerances.cost import CostModel, cost_model
from rverror.tolerances.declared import Tolerance
from rverror.tolerances.least_cost import Row, least_cost
from rverror.tolerances.loaded_yield import COUNT, ClosedFormUnits, loaded_units
from rverror.tolerances.specification import Limit
from rverror.tolerances.stacking import Stack, stack
from rverror.tolerances.width_search import UnreachableError, WidthSearch, idle_entries

#: Units on which a yield is optimised: at the load, and in closed form.
SAMPLE, CLOSED_SAMPLE = 384, 2**14


@renamed(speed="input_speed")
def allocate(
    model: Model,
    tolerances: Sequence[Tolerance],
    theta: Any | None = None,
    *,
    direction: Direction = "forward",
    torque: Any | None = None,
    input_speed: Any | None = None,
    limit: Any,
    kind: Literal["yield", "worst"] = "yield",
    level: float = 0.99,
    verify: int = CLOSED_UNITS,
    seed: int = 0,
    progress: Progress | None = None,
) -> Allocation:
    """Find the widths of least cost that keep the output error within a limit, in closed form: contacts closed.

    Parameters
    ----------
    model : Model
    tolerances : sequence of Tolerance
        With their costs, bounds and what is fixed.
    theta, direction, torque, input_speed
        As for `rverror.tolerances.stack`.
    limit : float, str or quantity
        Of the p-p, rad or with a unit.
    kind : {"yield", "worst"}
        What is limited: the quantile `level` of the p-p over units, or the p-p of the worst parts within their
        tolerances.
    level : float
        The quantile, above 0 and below 1; 0.99 for a yield of 99 %.
    verify : int
        Units that check a yield, drawn afresh.
    seed : int
        Fixes all draws.
    progress : callable, optional
        Called with a line of text as the work goes on.

    Returns
    -------
    Allocation

    Raises
    ------
    InputError
        If an argument is out of its bounds, or the limit cannot be met.

    Examples
    --------
    >>> import rverror
    >>> from rverror.tolerances.cost import Reciprocal
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> cams = [rverror.tolerance("crank.eccentricity", "5 um", cost=Reciprocal(12.0, 0.005))]
    >>> allocate(unit, cams, limit="40 arcsec", kind="worst").kind
    'worst'
    """
    laid = stack(model, tolerances, theta, direction=direction, torque=torque, input_speed=input_speed)
    loaded = input_speed is not None or any("torque" in source(part.key).needs for part in laid.components)
    if torque is not None and not loaded:
        raise InputError("torque: the closed form knows no load; leave it out, or use allocate_at_load")
    (point,) = cost_front(laid, [limit], kind=kind, level=level, verify=verify, seed=seed, progress=progress)
    if point.allocation is None:
        raise UnreachableError(point.reason)
    return point.allocation


def cost_front(
    laid: Stack,
    limits: Sequence[Any],
    *,
    kind: Literal["yield", "worst"] = "yield",
    level: float = 0.99,
    verify: int = CLOSED_UNITS,
    seed: int = 0,
    progress: Progress | None = None,
) -> tuple[FrontPoint, ...]:
    """Least cost for each of a row of limits, in closed form.

    Parameters
    ----------
    laid : Stack
        Of `rverror.tolerances.stack`.
    limits : sequence of float, str or quantity
    kind, level, verify, seed, progress
        As for `allocate`.

    Returns
    -------
    tuple of FrontPoint
        In the order of the limits; the same draws for all.

    Raises
    ------
    InputError
        If an argument is out of its bounds; a limit that cannot be met is no error here.

    Examples
    --------
    Two sources whose p-p are 2 and 1 rad per mm at equal prices: the stronger gets the finer tolerance.

    >>> import numpy as np
    >>> from rverror.tolerances.cost import Choice, Reciprocal
    >>> from rverror.tolerances.distribution import Uniform
    >>> from rverror.tolerances.sampling_rule import SamplingRule
    >>> waves = np.array([[1.0, -1.0], [0.5, -0.5]])
    >>> rules = tuple(SamplingRule(e, e, 1, 1, Uniform()) for e in range(2))
    >>> choices = (Choice(Reciprocal(1.0, 1.0)),) * 2
    >>> laid = Stack(np.zeros(2), waves, (), np.arange(2), np.ones(2), ("a", "b"), rules, choices=choices)
    >>> (point,) = cost_front(laid, [2.0], kind="worst")
    >>> [round(width, 6) for width in point.allocation.widths]  # as 1 : sqrt(2), 2 a + b = 2
    [0.585786, 0.828427]
    """
    check_kind("laid", laid, Stack, "make it with stack(model, tolerances)")
    check_each("limits", limits, object, "give a list of limits, such as ['40 arcsec', '60 arcsec']")
    if kind not in ("yield", "worst"):
        raise InputError(f"kind = {kind!r}: must be 'yield' or 'worst'")
    costs = cost_model(laid.labels, laid.width, laid.choices).relaxed(idle_entries(laid))
    worst, tell, points = WorstPeakToPeak(laid), progress or (lambda text: None), []
    for value in (units.named_core("limit", limit, "angle") for limit in limits):
        limit = Limit("transmission_error", value, None, level)
        try:
            if kind == "worst":
                found = _of_worst_case(worst, costs, value, level, seed)
            else:
                closed = ClosedFormUnits(laid, (limit,))
                found = WidthSearch(closed, costs, CLOSED_SAMPLE, verify, seed, tell).allocation()
            points.append(FrontPoint(value, found))
        except UnreachableError as error:
            points.append(FrontPoint(value, None, str(error)))
    return tuple(points)


def _of_worst_case(worst: WorstPeakToPeak, costs: CostModel, limit: float, level: float, seed: int) -> Allocation:
    """Least cost with which the worst parts make a p-p within a limit."""
    rows: list[Row] = []
    found = least_cost(costs, worst, limit, rows)
    if found is None:
        least, (slope, _) = worst.measure(costs.low)
        first = costs.labels[int((costs.low * slope).argmax())]
        raise UnreachableError(
            f"limit {limit / units.ARCSEC:.4g} arcsec: with every width at its least the worst-case p-p is "
            f"{least / units.ARCSEC:.4g} arcsec; raise the limit or allow finer widths, first of {first}"
        )
    before, (slope, _) = worst.measure(costs.given)
    return described(
        worst.stack,
        costs,
        found,
        kind="worst",
        level=level,
        limit=limit,
        used_before=(before / limit, slope / limit),
        used=worst.measure(found.widths)[0] / limit,
        binding=(limit, rows),
        seed=seed,
    )


def allocate_at_load(
    model: Model,
    tolerances: Sequence[Tolerance],
    limits: Sequence[Limit],
    *,
    direction: Direction = "forward",
    sample: int = SAMPLE,
    verify: int = COUNT,
    seed: int = 0,
    progress: Progress | None = None,
) -> Allocation:
    """Find the widths of least cost with which units meet limits at the load, contacts that open included.

    Parameters
    ----------
    model : Model
        Of a reducer.
    tolerances : sequence of Tolerance
        With their costs, bounds and what is fixed.
    limits : sequence of Limit
        Each holds for its share of the units; all of them together for the least of these shares.
    direction : {"forward", "reverse"} or +1 or -1
        Of the transmission error.
    sample, verify : int
        Units on which the widths are optimised and, drawn afresh, verified.
    seed : int
        Fixes all draws.
    progress : callable, optional
        Called with a line of text as the work goes on.

    Returns
    -------
    Allocation
        Of the kind ``"load"``.  The interval of each verified yield is at its level or above.

    Raises
    ------
    InputError
        If an argument is out of its bounds, or the limits cannot be met: the message says what holds them up.

    Notes
    -----
    The closed form begins.  Then every unit of a sample is solved at the loads, with the change of its largest turns
    with every width from the influences there, and the least cost of this linear form within a factor of the widths
    is taken, again and again.  Fresh units verify; where they do not, they tell how much is missing.

    Examples
    --------
    >>> import rverror
    >>> unit, cost = rverror.Model(rverror.reducer("RV-40E")), rverror.tolerances.cost.Reciprocal(12.0, 0.005)
    >>> cams = [rverror.tolerance("crank.eccentricity", "5 um", cost=cost)]
    >>> limits = [rverror.limit("transmission_error", "30 arcsec", torque="412 N*m")]
    >>> found = allocate_at_load(unit, cams, limits, sample=64, verify=500)
    >>> found.verified.limits[0].share > 0.99
    True
    """
    prepared = loaded_units(model, tolerances, limits, direction=direction)
    if any(one.value is None for one in prepared.limits):
        raise InputError("limits: one has no value; give it, such as limit('transmission_error', '60 arcsec')")
    costs = cost_model(prepared.stack.labels, prepared.stack.width, prepared.stack.choices)
    return WidthSearch(prepared, costs, sample, verify, seed, progress or (lambda text: None)).allocation()
