"""Empirical orders: a line of the output error described by its size alone, in the frame whose order it follows.

For what is measured and not yet understood.  No part stands behind it, so no size of a part follows from it, and it
predicts nothing of another load or another unit.
"""

from __future__ import annotations

import numpy as np

from rverror.base.arrays import Array
from rverror.geartrain.action_line import Contacts, ErrorVector, output_wave
from rverror.geartrain.kinematics import Pose, fundamental_orders, stated_load
from rverror.geartrain.mechanism import Mechanism
from rverror.geartrain.source import Indices, Source, angles, every, harmonics, leads, windups


def order(pose: Pose, *, frame: str, harmonic: int) -> ErrorVector:
    """One order in the reading of the output: c cos(h o theta) + s sin(h o theta), o the fundamental order of a frame.

    Parameters
    ----------
    pose : Pose
    frame : str
        A key of `fundamental_orders`; ``"output"`` has the order 1, so that h is any whole order.
    harmonic : int
        h.

    Returns
    -------
    ErrorVector
        Terms cos, sin, as angles of the output, the same in both directions.

    Raises
    ------
    ValueError
        If the pose is not that of a reducer and the frame is not the output.

    Notes
    -----
    It describes and does not explain.  Frames of one order, as carrier, disc and crank, give the same wave: the name is
    a note of where the cause is looked for.
    """
    return output_wave(_angle(pose, frame, harmonic))


def order_by_direction(pose: Pose, *, frame: str, harmonic: int) -> ErrorVector:
    """One order that changes its sign with the direction of motion: half of what forward and reverse differ by.

    Parameters
    ----------
    pose : Pose
    frame : str
    harmonic : int
        As in `order`.

    Returns
    -------
    ErrorVector
        Terms cos, sin, as angles of the output, positive forward.
    """
    return output_wave(_angle(pose, frame, harmonic), pose.direction)


def order_by_load(pose: Pose, *, frame: str, harmonic: int, sense: str) -> ErrorVector:
    """One order in proportion to the load.

    Parameters
    ----------
    pose : Pose
    frame : str
    harmonic : int
        As in `order`.
    sense : str
        ``"alike"`` in both directions, or ``"opposite"``: positive forward.

    Returns
    -------
    ErrorVector
        Terms cos, sin, rad per N*mm.

    Raises
    ------
    ValueError
        If the pose has no torque.
    """
    load = stated_load(pose, "empirical.order_by_load")
    return output_wave(_angle(pose, frame, harmonic), load if sense == "opposite" else np.abs(load))


def _angle(pose: Pose, frame: str, harmonic: int) -> Array:
    """Phase of the order, rad."""
    if frame == "output":  # a turn of the reading itself, of any mechanism
        return harmonic * pose.theta
    if not isinstance(pose, Contacts):
        raise ValueError(f"empirical.order: frame {frame!r} needs the pose of a reducer; only 'output' does without")
    return harmonic * fundamental_orders(pose.reducer)[frame] * pose.theta


def _orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    return leads(str(indices["frame"]))(mechanism, indices)


_FRAME = every("frame", lambda unit: tuple(fundamental_orders(unit)))

ORDER = Source(
    "empirical.order", order, (_FRAME, harmonics(1, 1)), angles(60, "cos", "sin"),
    "output", _orders, "none: what was measured",
    "an order as measured, in a frame; describes and does not explain: no size of a part follows from it",
    acts="output", tried=False,
    equation=r"$\delta = c\cos ho\theta + s\sin ho\theta$, $o$ the order of the frame",
)  # fmt: skip

_SENSE = every("sense", lambda unit: ("alike", "opposite"))

BY_DIRECTION = Source(
    "empirical.order_by_direction", order_by_direction, (_FRAME, harmonics(1, 1)), angles(60, "cos", "sin"),
    "output", _orders, "none: what was measured",
    "an order as measured, of opposite sign forward and reverse; describes and does not explain",
    acts="output", tried=False,
    equation=r"$\delta = \pm(c\cos ho\theta + s\sin ho\theta)$, $o$ the order of the frame",
)  # fmt: skip

BY_LOAD = Source(
    "empirical.order_by_load", order_by_load, (_FRAME, harmonics(1, 1), _SENSE), windups(60, "cos", "sin"),
    "output", _orders, "none: what was measured",
    "an order as measured, in proportion to the load; describes and does not explain",
    acts="output", needs=("torque",), tried=False,
    equation=r"$\delta = T(c\cos ho\theta + s\sin ho\theta)$, alike or of opposite sign forward and reverse",
)  # fmt: skip

# Laws of an order over load and direction, the simplest first.
LAWS = (ORDER, BY_DIRECTION, BY_LOAD)

SOURCES = LAWS


def tells_directions(law: Source, indices: Indices) -> bool:
    """Tell whether a law differs between forward and reverse, so that one direction alone cannot tell it."""
    return law is BY_DIRECTION or indices.get("sense") == "opposite"
