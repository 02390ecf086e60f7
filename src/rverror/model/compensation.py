"""Compensation: what a controller adds to the command of the input, as a table over the output angle."""

from __future__ import annotations

import math

from rverror.geartrain.action_line import ErrorVector, output_wave
from rverror.geartrain.kinematics import Pose
from rverror.geartrain.mechanism import Mechanism
from rverror.geartrain.source import Index, IndexValue, Indices, Source, angles

_SENSES = ("alike", "opposite")


#: Orders below it are whole numbers, as other indices are; of any size as their text.
_MOST = 1000


class _Orders(list[IndexValue]):
    """Whole orders, as listed, and any other above 0 as its text."""

    def __contains__(self, value: object) -> bool:
        """Whether a value is one of them."""
        if not isinstance(value, str):
            return super().__contains__(value)
        try:
            return 0 < float(value) < math.inf
        except ValueError:
            return False


_ORDERS = _Orders(range(1, _MOST))


def wave(pose: Pose, *, order: IndexValue, sense: str) -> ErrorVector:
    """One wave of a compensation table: c cos(k theta) + s sin(k theta) added to the command, as an output angle.

    Parameters
    ----------
    pose : Pose
    order : int or str
        k, waves per output turn: a whole number below 1000, or any as its text, ``"73.857"``.
    sense : str
        ``"alike"`` in both directions, or ``"opposite"``: positive forward.  A table has half the sum and half the
        difference of its two directions.

    Returns
    -------
    ErrorVector
        Terms cos, sin, as angles of the output: the input is turned R times as far.

    Notes
    -----
    Runs of a unit that is compensated hold the command as the input's angle, so that what the table adds is part of
    their error.  docs page ``theory/compensation.md``.
    """
    return output_wave(float(order) * pose.theta, pose.direction if sense == "opposite" else 1.0)


def order_index(order: float) -> IndexValue:
    """Order as the index of a wave has it.

    Examples
    --------
    >>> order_index(40.0), order_index(73.857)
    (40, '73.857')
    """
    return round(order) if order.is_integer() and order < _MOST else repr(order)


def _own_order(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    return (float(indices["order"]),)


WAVE = Source(
    "compensation.wave", wave,
    (
        Index("order", lambda mechanism: _ORDERS, lambda mechanism: range(1, 2)),
        Index("sense", lambda mechanism: _SENSES, lambda mechanism: _SENSES),
    ),
    angles(300, "cos", "sin"),
    "output", _own_order, "none: what a controller adds", "a wave of a compensation table in the path of the command",
    acts="output", in_drives=True, tried=False,
    equation=r"$\delta = c\cos k\theta + s\sin k\theta$, alike or of opposite sign forward and reverse",
)  # fmt: skip

SOURCES = (WAVE,)
