"""Angles of every frame, orders, samples needed and the true period."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from fractions import Fraction
from typing import Self

import numpy as np

from rverror.base.arrays import Array
from rverror.base.errors import check_kind
from rverror.geartrain.mechanism import Drive, Mechanism, Reducer


@dataclass(frozen=True)
class OperatingConditions:
    """Where and how a run was measured: one object, all the way from a run's file to the contacts.

    Attributes
    ----------
    theta : ndarray, shape (n,)
        Nominal output angle, input angle / ratio, rad.
    direction : float or ndarray, shape (n,)
        +1 forward, where theta grows; -1 reverse, where it falls.  The load torque resists.
    torque : float, optional
        Size of the output torque, N*mm; without one, and without a load, the closed form predicts.
    time : ndarray, shape (n,), optional
        Time of each sample, s.
    speed : float, optional
        Size of the output speed, rad/s.
    temperature : float, optional
        K.
    load : ndarray, shape (n,), optional
        In place of `torque`: output torque at each angle, N*mm, positive where it resists forward motion, whichever way
        the motion goes.

    Examples
    --------
    Every prediction takes them in place of angles:

    >>> import numpy as np, rverror
    >>> where = OperatingConditions(np.linspace(0, 1, 5), direction=-1.0, torque=20e3)
    >>> model = rverror.Model(rverror.reducer("RV-40E"))
    >>> rverror.equilibrium(model, where).transmission_error.shape
    (5,)
    """

    theta: Array
    direction: float | Array
    torque: float | None = None
    time: Array | None = None
    speed: float | None = None
    temperature: float | None = None
    load: Array | None = None

    def at(self, theta: Array) -> Self:
        """The same conditions at as many other angles."""
        return replace(self, theta=theta)


@dataclass(frozen=True, kw_only=True)
class Pose(OperatingConditions):
    """Nominal motion of a drive at n samples.

    Attributes
    ----------
    ratio : float
        Input turns per output turn.
    direction : ndarray, shape (n,)
        One for every sample.
    """

    ratio: float
    direction: Array

    @property
    def resisted(self) -> Array:
        """Motion that the load resists, +1 or -1, shape (n,): that at hand, unless a load drives it."""
        return resisted_motion(self.direction, self.load)


def resisted_motion(direction: Array, load: Array | None) -> Array:
    """Motion that a load resists; the one at hand where it vanishes.

    Parameters
    ----------
    direction : ndarray, shape (n,)
        +1 forward, -1 reverse.
    load : ndarray, shape (n,), optional
        Positive where it resists forward motion; left out where it resists the motion.

    Returns
    -------
    ndarray, shape (n,)

    Examples
    --------
    >>> resisted_motion(np.array([1.0, 1.0, 1.0]), np.array([2.0, 0.0, -2.0])).tolist()
    [1.0, 1.0, -1.0]
    """
    return direction if load is None else np.where(load == 0, direction, np.sign(load))


@dataclass(frozen=True, kw_only=True)
class DrivePose(Pose):
    """Nominal motion of a `Drive`.

    Attributes
    ----------
    drive : Drive
        Whose motion it is.
    """

    drive: Drive


def stated_load(pose: Pose, what: str) -> Array:
    """Output torque of a motion that resists it forward, for a source that needs it.

    Parameters
    ----------
    pose : Pose
    what : str
        Who needs it, for the message.

    Returns
    -------
    ndarray, shape (n,)
        N*mm; below 0 where it resists reverse motion.

    Raises
    ------
    ValueError
        If the pose has none.
    """
    if pose.load is not None:
        return pose.load
    if pose.torque is None:
        raise ValueError(f"{what} needs the torque; give torque, or a run file with output_torque")
    return abs(pose.torque) * pose.direction


def motion_direction(theta: Array) -> Array:
    """Direction of motion read from the angles: +1 where they grow, -1 where they fall.

    Parameters
    ----------
    theta : ndarray, shape (n,)
        Angles in the order in which they were passed, rad.

    Returns
    -------
    ndarray, shape (n,)
        +1 or -1; a standstill keeps the direction before it, and a single angle counts as forward.
    """
    step = np.sign(np.diff(theta))
    moving = np.flatnonzero(step)
    if moving.size == 0:
        return np.ones_like(theta)
    step = step[np.maximum.accumulate(np.where(step != 0, np.arange(step.size), moving[0]))]
    return np.concatenate([step[:1], step])


def frame_orders(reducer: Reducer) -> dict[str, float]:
    """Turns of each part per output turn, seen from the housing (source 001's and 003's ratios).

    Where the housing is the output it turns away under them: all signs are the opposite.

    Parameters
    ----------
    reducer : Reducer

    Returns
    -------
    dict
        Keys ``housing``, ``carrier``, ``disc``, ``crank``, ``planet``, ``sun``.  Relative to the carrier each is less
        by one: crank and planet -40, sun +120 for the RV-40E, against -39 and +121 in the housing.

    Examples
    --------
    >>> from rverror import reducer
    >>> frame_orders(reducer("RV-40E"))["crank"]
    -39.0
    """
    check_kind("reducer", reducer, Reducer, "give reducer('RV-40E') or model.mechanism")
    carrier = 1.0 if reducer.output == "carrier" else -1.0
    crank = -carrier * reducer.disc_lobes / (reducer.pins - reducer.disc_lobes)
    return {
        "housing": 0.0,
        "carrier": carrier,
        "disc": carrier,
        "crank": crank,
        "planet": crank,
        "sun": carrier * float(reducer.exact_carrier_ratio),
    }


def fundamental_orders(reducer: Reducer) -> dict[str, float]:
    """Order, per output turn, of which an error fixed in each part shows whole multiples.

    An error repeats when its part meets the contact that carries it again: the crank's eccentric direction relative to
    the housing for pins, the crank relative to the carrier for whatever turns with carrier or crank, the sun relative
    to the carrier for the sun.

    Parameters
    ----------
    reducer : Reducer

    Returns
    -------
    dict
        ``housing`` 39, ``carrier``, ``disc``, ``crank``, ``planet`` and ``bearing`` 40, ``sun`` 120, ``output`` 1,
        ``gear mesh`` 1080 and ``cycloid mesh`` 1560 for the RV-40E.

    Examples
    --------
    >>> from rverror import reducer
    >>> orders = fundamental_orders(reducer("RV-40E"))
    >>> orders["housing"], orders["disc"], orders["sun"]
    (39.0, 40.0, 120.0)
    """
    turns = frame_orders(reducer)
    relative = abs(turns["crank"] - turns["carrier"])
    return {
        "output": 1.0,
        "housing": abs(turns["crank"]),
        **dict.fromkeys(("carrier", "disc", "crank", "planet", "bearing"), relative),
        "sun": abs(turns["sun"] - turns["carrier"]),
        "gear mesh": reducer.planet_teeth * relative,
        "cycloid mesh": reducer.pins * abs(turns["crank"]),
    }


#: Samples of the wave of the highest order, over the two of its Nyquist limit, in a row of angles that nobody chose.
OVERSAMPLING = 1.25
_FEWEST = 4096
_HARMONICS = 4  # of a drive's shafts, whose meshes nobody knows


def whole_turn(mechanism: Mechanism, orders: Iterable[float] = ()) -> Array:
    """Angles of one output turn, evenly spaced, a power of two that holds the highest order.

    Parameters
    ----------
    mechanism : Reducer or Drive
    orders : iterable of float, optional
        Of its errors, beside those of its meshes or shafts.

    Returns
    -------
    ndarray, shape (n,)
        rad, from 0 on, the end of the turn left out.

    Notes
    -----
    Of a drive, whose meshes are not known, four harmonics of the fastest shaft count; there are 4096 angles or more.

    Examples
    --------
    >>> from rverror import reducer
    >>> whole_turn(reducer("RV-40E")).size, whole_turn(Drive(ratio=14.0), [2000.0]).size
    (4096, 8192)
    """
    if isinstance(mechanism, Reducer):
        highest = max(fundamental_orders(mechanism).values())
    else:
        highest = _HARMONICS * max(map(abs, (mechanism.ratio, *mechanism.shafts.values())))
    needed = math.ceil(math.log2(2 * OVERSAMPLING * max((highest, *map(abs, orders)))))
    count = max(2**needed, _FEWEST)
    return np.asarray(2 * math.pi * np.arange(count) / count, dtype=np.float64)


def samples_needed(reducer: Reducer) -> int:
    """Samples per output turn, a power of two, that keep the highest mesh order below the Nyquist order.

    Examples
    --------
    >>> from rverror import reducer
    >>> samples_needed(reducer("RV-40E"))
    4096
    """
    highest = max(fundamental_orders(reducer).values())
    return int(2 ** math.ceil(math.log2(2 * highest + 1)))


def folded_order(order: float, samples_per_turn: float) -> float:
    """Order at which a line appears when it is sampled so many times an output turn.

    Parameters
    ----------
    order, samples_per_turn : float

    Returns
    -------
    float

    Examples
    --------
    >>> folded_order(1080, 1000), folded_order(1560, 1000)
    (80.0, 440.0)
    """
    remainder = order % samples_per_turn
    return float(min(remainder, samples_per_turn - remainder))


def true_period(mechanism: Mechanism) -> int:
    """Output turns after which every part of the drive stands as before.

    Parameters
    ----------
    mechanism : Reducer or Drive

    Returns
    -------
    int
        The smallest whole number of output turns that makes the input turns, and each shaft's, whole.

    Examples
    --------
    >>> from rverror import reducer
    >>> true_period(reducer("RV-40E")), true_period(reducer("RV-40E", planet_teeth=26))
    (1, 9)
    """
    if isinstance(mechanism, Reducer):
        return mechanism.exact_ratio.denominator
    turns = [mechanism.ratio, *mechanism.shafts.values()]
    return math.lcm(*(Fraction(t).limit_denominator(1000).denominator for t in turns))
