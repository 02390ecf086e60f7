"""Empirical orders: a line of the output error described by its size alone, in the frame whose order it follows.

For what is measured and not yet understood.  No part stands behind it, so no size of a part follows from it, and it
foretells nothing of another load or another unit.
"""

from __future__ import annotations

import numpy as np

from rverror.geartrain.action_line import Contacts, ErrorVector
from rverror.geartrain.kinematics import Pose, fundamental_orders
from rverror.geartrain.mechanism import Mechanism
from rverror.geartrain.source import Indices, Source, angles, every, harmonics, rv


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
    wave = harmonic * _fundamental(pose, frame) * pose.theta
    return ErrorVector(contact="output", vector=np.stack([np.cos(wave), np.sin(wave)])[:, None])


def _fundamental(pose: Pose, frame: str) -> float:
    if frame == "output":  # a turn of the reading itself, of any mechanism
        return 1.0
    if not isinstance(pose, Contacts):
        raise ValueError(f"empirical.order: frame {frame!r} needs the pose of a reducer; only 'output' does without")
    return fundamental_orders(pose.reducer)[frame]


def _orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    return (int(indices["harmonic"]) * fundamental_orders(rv(mechanism))[str(indices["frame"])],)


_FRAME = every("frame", lambda unit: tuple(fundamental_orders(unit)))

ORDER = Source(
    "empirical.order", order, (_FRAME, harmonics(1, 1)), angles(60, "cos", "sin"),
    "output", _orders, "none: what was measured",
    "an order as measured, in a frame; describes and does not explain: no size of a part follows from it",
    acts="output", tried=False,
    equation=r"$\delta = c\cos ho\theta + s\sin ho\theta$, $o$ the order of the frame",
)  # fmt: skip

SOURCES = (ORDER,)
