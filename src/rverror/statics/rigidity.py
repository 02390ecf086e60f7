"""Lost motion, backlash and torsional stiffness of a reducer, as its makers define them.

The input is held, a torque is put on the output in either sense, and the turn of the output is drawn over it: the
hysteresis curve.  The makers read three figures from it: the lost motion between +-3 % of the rated torque, at the
midpoints of the loop's width; the backlash at no torque; the torsional rigidity b / a, the slope of the loaded branch.

The model knows no friction, so its loop has no width: the curve is single-valued but for the play at no torque, and is
the line of midpoints itself.  The backlash is then all play, without the share of friction that a measured one holds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.quantities import row
from rverror.base.viewed import Viewed
from rverror.geartrain.mechanism import doubt_torque
from rverror.model.effects import Model, check_model
from rverror.model.readings import unread
from rverror.statics.loaded_state import equilibrium, reducer_of

_ASKS = "the torsion of a reducer"
#: Of the rated torque, at which makers read the lost motion.
MAKERS_SHARE = 0.03
_ROUNDING = 1e-15  # rad: what is left of the difference of two equal angles, 2e-10 arcsec


@dataclass(frozen=True)
class TorsionCurve(Viewed):
    """Turn of the output under a torque, input held.

    Attributes
    ----------
    torque : ndarray, shape (m,)
        Torque on the output, N*mm, in the order in which it was asked for; positive turns it counter-clockwise.
    angle : ndarray, shape (m, n)
        Turn of the output from the middle of the play, rad.
    """

    torque: Array
    angle: Array

    def stiffness(self, *, low: Any, high: Any) -> Array:
        """Slope of the curve between two torques.

        Parameters
        ----------
        low, high : float or quantity
            Torques on the output, N*mm, signed; the curve is taken as straight between its points.

        Returns
        -------
        ndarray, shape (n,)
            N*mm/rad.

        Raises
        ------
        ValueError
            If the torques are equal or lie outside the curve.
        """
        least, most = self.torque.min(), self.torque.max()
        ends = [units.to_core(value, "torque") for value in (low, high)]
        for value in ends:
            if not least <= value <= most:
                raise ValueError(
                    f"{value / 1e3:g} N*m lies outside the curve, {least / 1e3:g} to {most / 1e3:g} N*m; "
                    "compute it for more torques"
                )
        if ends[0] == ends[1]:
            raise ValueError(f"low and high are both {ends[0] / 1e3:g} N*m; a slope needs two torques")
        first, last = (_between(self.torque, self.angle, value) for value in ends)
        return np.asarray((ends[1] - ends[0]) / (last - first), dtype=np.float64)


def lost_motion(model: Model, theta: Any | None = None, *, percent: float = 3.0) -> Array:
    """Lost motion: turn of the output from a small torque in one sense to the same torque in the other, input held.

    Parameters
    ----------
    model : Model
        Of a reducer with a rated torque.
    theta : array_like, str or quantity, shape (n,) or one angle, optional
        Nominal output angle at which the input is held, rad; `Model.angles` where left out.
    percent : float
        The torque, in percent of the rated torque; the makers' 3 where left out.

    Returns
    -------
    ndarray, shape (n,)
        rad.

    Raises
    ------
    ValueError
        If the model is no reducer, has no rated torque, or the percentage is below 0.

    Notes
    -----
    The makers take the midpoints of the hysteresis loop's width at either torque.  Without friction the loop has no
    width, and the curve is its own midpoint.  At 0 % it is the `backlash`; each percent more adds windup.

    Examples
    --------
    >>> import numpy as np, rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> lost = lost_motion(unit, [0.0, 0.1])
    >>> windup = 2 * 0.03 * 412e3 / torsional_stiffness(unit, [0.0, 0.1])
    >>> bool(np.allclose(lost, backlash(unit, [0.0, 0.1]) + windup, rtol=0.01))
    True
    """
    check_model(model)
    size = float(percent)
    if not (math.isfinite(size) and size >= 0):
        raise ValueError(f"percent = {percent}: must be 0 or more, in percent of the rated torque")
    lower, upper = _ends(model, theta, size / 100 * _rated_torque(model))
    return upper - lower


def backlash(model: Model, theta: Any | None = None) -> Array:
    """Backlash: how far the output turns freely, input held.

    Parameters
    ----------
    model : Model
        Of a reducer.
    theta : array_like, str or quantity, shape (n,) or one angle, optional
        Nominal output angle at which the input is held, rad; `Model.angles` where left out.

    Returns
    -------
    ndarray, shape (n,)
        rad.

    Raises
    ------
    ValueError
        If the model is no reducer.

    Notes
    -----
    The width of the hysteresis curve at no torque.  A measured one holds friction too; here it is the limit of a
    vanishing load from either side, as near as `equilibrium` comes to that limit.

    Examples
    --------
    Each of two gear meshes of the RV-40E has 20 um of play along its line of action:

    >>> import math, rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> mesh = 0.020 / (121 * 6.75 * math.cos(math.radians(20)))  # 5.4 arcsec
    >>> bool(abs(backlash(unit, [0.0])[0] - mesh) < 1e-7)
    True
    """
    check_model(model)
    lower, upper = _ends(model, theta, 0.0)
    play = upper - lower
    return np.where(np.abs(play) > _ROUNDING, play, 0.0)


def torsion_curve(model: Model, theta: Any | None = None, *, torques: Any) -> TorsionCurve:
    """Turn of the output under each of some torques, input held.

    Parameters
    ----------
    model : Model
        Of a reducer.
    theta : array_like, str or quantity, shape (n,) or one angle, optional
        Nominal output angle at which the input is held, rad; `Model.angles` where left out.
    torques : array_like or quantity, shape (m,)
        Torques on the output, N*mm, of either sign; a list may hold strings such as ``"-20 N*m"``.

    Returns
    -------
    TorsionCurve
        Its angles are counted from the mean of the two positions without load, and 0 at no torque.

    Raises
    ------
    ValueError
        If the model is no reducer or the torques are not a row of finite numbers.

    Examples
    --------
    >>> import rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> curve = torsion_curve(unit, [0.0, 0.1], torques=["-412 N*m", "-206 N*m", 0, "206 N*m", "412 N*m"])
    >>> curve.angle.shape
    (5, 2)
    >>> stiffness = curve.stiffness(low="206 N*m", high="412 N*m")  # N*mm/rad
    """
    check_model(model)
    size = row("torques", torques, "torque")
    doubt_torque(model.mechanism, torques, name="torques")
    lower, upper = _ends(model, theta, 0.0)
    middle = (lower + upper) / 2
    angle = [np.zeros(middle.size) if value == 0 else _position(model, theta, value) - middle for value in size]
    return TorsionCurve(size, np.array(angle))


def torsional_stiffness(model: Model, theta: Any | None = None, *, low: float = 50.0, high: float = 100.0) -> Array:
    """Torsional stiffness: slope of the loaded branches of the torsion curve, input held.

    Parameters
    ----------
    model : Model
        Of a reducer with a rated torque.
    theta : array_like, str or quantity, shape (n,) or one angle, optional
        Nominal output angle at which the input is held, rad; `Model.angles` where left out.
    low, high : float
        The part of either branch from which the slope is taken, in percent of the rated torque.

    Returns
    -------
    ndarray, shape (n,)
        N*mm/rad; the torque over the mean turn of both branches.

    Raises
    ------
    ValueError
        If the model is no reducer, has no rated torque, or not 0 <= low < high.

    Notes
    -----
    The makers' torsional rigidity b / a.  The upper half of the branch keeps play and the first contacts out of it.

    Examples
    --------
    >>> import math, rverror
    >>> bearings = dict(crank_bearing=1e12, pin_contact=1e12, gear_mesh=1e12, carrier_bearing=3e5, main_bearing=1e12)
    >>> unit = rverror.reducer("RV-40E", stiffness=rverror.geartrain.Stiffness(**bearings))
    >>> stiffness = torsional_stiffness(rverror.Model(unit), [0.0])
    >>> bool(math.isclose(stiffness[0], 2 * 3e5 * 27**2, rel_tol=1e-3))  # two bearings at 27 mm
    True
    """
    check_model(model)
    if not 0 <= low < high < math.inf:
        raise ValueError(f"low = {low}, high = {high}: must be 0 <= low < high, in percent of the rated torque")
    rated = _rated_torque(model)
    inner, outer = (_ends(model, theta, percent / 100 * rated) for percent in (low, high))
    turn = (outer[1] - outer[0]) - (inner[1] - inner[0])
    return np.asarray(2 * (high - low) / 100 * rated / turn, dtype=np.float64)


def _ends(model: Model, theta: Any | None, size: float) -> tuple[Array, Array]:
    """Output under a torque clockwise and counter-clockwise, rad."""
    return _position(model, theta, -size), _position(model, theta, size)


def _position(model: Model, theta: Any | None, torque: float) -> Array:
    """Output under a torque on it, rad; the sign of a zero counts, as the side from which no load is reached.

    A torque that turns the output counter-clockwise drives it the way a load does that resists the reverse motion.
    What only misreads it is no turn of the output; the gear train stands where its marks are.
    """
    reducer_of(model.mechanism, _ASKS)
    found = equilibrium(unread(model), theta, torque=units.InCore(abs(torque)), direction=-math.copysign(1.0, torque))
    return found.transmission_error


def on_its_branch(torque: Array, angle: Array, at: float) -> Array:
    """Turn at a torque, straight between the torques of its own sense: across none lies the play.

    Parameters
    ----------
    torque : ndarray, shape (m,)
        N*mm, in any order.
    angle : ndarray, shape (m, ...)
        Turn under each.
    at : float
        Torque other than 0, N*mm.

    Returns
    -------
    ndarray, shape (...)

    Raises
    ------
    ValueError
        If the torques of that sense do not reach it, on either side.
    """
    own = np.sign(torque) == np.sign(at)
    if not own.any() or not torque[own].min() <= at <= torque[own].max():
        raise ValueError(f"there are no torques on both sides of {at / 1e3:g} N*m; compute it for more torques")
    return _between(torque[own], angle[own], at)


def _between(torque: Array, angle: Array, at: float) -> Array:
    order = np.argsort(torque, kind="stable")
    columns = angle[order].reshape(torque.size, -1).T
    return np.array([np.interp(at, torque[order], column) for column in columns]).reshape(angle.shape[1:])


def _rated_torque(model: Model) -> float:
    unit = reducer_of(model.mechanism, _ASKS)
    if unit.rated_torque is None:
        raise ValueError(
            f"reducer {unit.name!r} has no rated_torque, of which the percentage is taken; "
            "give it, e.g. rated_torque = '412 N*m'"
        )
    return unit.rated_torque
