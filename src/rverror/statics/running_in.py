"""Running in and lasting wear from a measured course of the lost motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import scipy

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.viewed import OneLine
from rverror.model.effects import Model, check_model
from rverror.statics.worn_contacts import RunningIn, Wear, WearCoefficients, wear

#: What may be fitted.
FREE = ("depth", "running_in", "lasting")
_FURTHEST = 1e3  # by which a size may be larger or smaller than what it was begun with


@dataclass(frozen=True, kw_only=True)
class FittedRunningIn(OneLine):
    """Running in and lasting wear that explain a measured course.

    Attributes
    ----------
    coefficients : WearCoefficients
        All as they were begun with, times one factor.
    running_in : mapping of str to RunningIn
        All depths times a second factor, all coefficients times a third.
    growth : ndarray, shape (m,)
        Of the lost motion since the first of the hours, as measured, rad.
    wear : Wear
        At the same hours with what was fitted.
    free : tuple of str
        What was fitted; as many of the measured numbers are no test of it.
    """

    coefficients: WearCoefficients
    running_in: Mapping[str, RunningIn]
    growth: Array
    wear: Wear
    free: tuple[str, ...]

    @property
    def residual(self) -> Array:
        """Measured growth less that of `wear`, (m,), rad."""
        return np.asarray(self.growth - (self.wear.lost_motion - self.wear.lost_motion[0]))


def fit_running_in(
    model: Model,
    hours: Any,
    lost_motion: Any,
    *,
    coefficients: WearCoefficients,
    running_in: Mapping[str, RunningIn],
    free: Sequence[str] = FREE,
    **duty: Any,
) -> FittedRunningIn:
    """Depth and speed of running in, and the lasting wear, from a measured course of the lost motion.

    Parameters
    ----------
    model : Model
        Of a reducer, as it was at the first of the hours.
    hours : array_like, shape (m,)
        Of operation, from 0 on.
    lost_motion : array_like or quantity, shape (m,)
        Measured then, rad; only its growth counts.
    coefficients : WearCoefficients
        Where the search begins: bodies and joints keep their shares.
    running_in : mapping of str to RunningIn
        Likewise.
    free : sequence of {"depth", "running_in", "lasting"}
        What is fitted: depths and coefficients of running in, lasting coefficients; each by one factor for all.
    **duty
        The rest of what `wear` takes.

    Returns
    -------
    FittedRunningIn

    Raises
    ------
    ValueError
        As `wear`, or if the course does not begin at 0 or has no more growths than there are factors.

    Notes
    -----
    Least squares over the factors, within 0.001 to 1000.  A course whose first measured hour comes when the unit is run
    in tells the depth and not how fast: leave "running_in" out of `free` then.

    Examples
    --------
    >>> import rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> found = fit_running_in(
    ...     unit,
    ...     [0, 600, 1550],
    ...     [0, 10.6 * rverror.ARCSEC, 12.9 * rverror.ARCSEC],
    ...     coefficients=WearCoefficients(disc="1e-10 mm^3/(N*m)"),
    ...     running_in={"disc": RunningIn(depth="1 um", coefficient="5e-8 mm^3/(N*m)")},
    ...     free=["depth", "lasting"],
    ...     torque="412 N*m",
    ...     input_speed="1815 rpm",
    ...     disc_width="9 mm",
    ...     gear_width="8 mm",
    ... )
    >>> bool(abs(found.residual).max() < 0.01 * rverror.ARCSEC)
    True
    """
    check_model(model)
    times, measured = units.to_core_array(hours, "number"), units.to_core_array(lost_motion, "angle")
    chosen = tuple(free)
    if not set(chosen) <= set(FREE) or not chosen:
        raise ValueError(f"free = {free!r}: give some of {', '.join(FREE)}")
    if times.ndim != 1 or times.shape != measured.shape or times[0] != 0 or times.size <= len(chosen):
        raise ValueError(
            f"hours {times.shape} and lost_motion {measured.shape}: give both from 0 h on, and {len(chosen)} or more "
            f"measurements after it to fit {', '.join(chosen)}"
        )
    growth = measured - measured[0]

    def at(factors: Array) -> FittedRunningIn:
        factor = dict.fromkeys(FREE, 1.0) | dict(zip(chosen, factors.tolist(), strict=True))
        lasting = {item.name: factor["lasting"] * getattr(coefficients, item.name) for item in fields(coefficients)}
        by = WearCoefficients(**lasting)
        rough = {
            body: replace(one, depth=one.depth * factor["depth"], coefficient=one.coefficient * factor["running_in"])
            for body, one in running_in.items()
        }
        found = wear(model, hours=times, coefficients=by, running_in=rough, **duty)
        return FittedRunningIn(coefficients=by, running_in=rough, growth=growth, wear=found, free=chosen)

    found = scipy.optimize.least_squares(
        lambda factors: at(factors).residual / np.abs(growth).max(),
        np.ones(len(chosen)),
        bounds=(1 / _FURTHEST, _FURTHEST),
        diff_step=1e-2,  # far above what equilibria leave
        gtol=1e-4,  # some thousandths of the largest growth, and less after the last step
        xtol=1e-4,
    )
    return at(found.x)
