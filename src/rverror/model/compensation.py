"""Compensation: what a controller adds to the command of the input, as a table over the output angle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import overload

import numpy as np

from rverror.geartrain.action_line import ErrorVector
from rverror.geartrain.kinematics import Pose
from rverror.geartrain.mechanism import Mechanism
from rverror.geartrain.source import Index, IndexValue, Indices, Source, angles

_SENSES = {"forward": 1.0, "reverse": -1.0}


class _Orders(Sequence[IndexValue]):
    """Any order above 0: a whole number, or the text of another one; listed are the whole ones below a thousand."""

    def __len__(self) -> int:
        return 999

    @overload
    def __getitem__(self, at: int) -> IndexValue: ...
    @overload
    def __getitem__(self, at: slice) -> Sequence[IndexValue]: ...
    def __getitem__(self, at: int | slice) -> IndexValue | Sequence[IndexValue]:
        return range(1, 1000)[at]

    def __contains__(self, value: object) -> bool:
        try:
            number = float(value)  # type: ignore[arg-type]
        except (TypeError, ValueError):
            return False
        return math.isfinite(number) and number > 0


_ORDERS = _Orders()


def wave(pose: Pose, *, direction: str, order: IndexValue) -> ErrorVector:
    """One wave of a compensation table: c cos(k theta) + s sin(k theta) added to the command in one direction.

    Parameters
    ----------
    pose : Pose
    direction : str
        ``"forward"`` or ``"reverse"``: the motion in which the controller adds it.
    order : int or str
        k, waves per output turn; a number that is not whole is given as its text, ``"73.857"``.

    Returns
    -------
    ErrorVector
        Terms cos, sin, as angles of the output: the input is turned R times as far.

    Notes
    -----
    Runs of a unit that is compensated hold the command as the input's angle, so that what the table adds is part of
    their error.  docs page ``theory/compensation.md``.
    """
    along = np.asarray(pose.direction) == _SENSES[direction]
    phase = float(order) * pose.theta
    return ErrorVector(contact="output", vector=(along * np.stack([np.cos(phase), np.sin(phase)]))[:, None])


def order_index(order: float) -> IndexValue:
    """Order as the index of a wave has it.

    Examples
    --------
    >>> order_index(40.0), order_index(73.857)
    (40, '73.857')
    """
    return round(order) if order.is_integer() else repr(order)


def _own_order(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    return (float(indices["order"]),)


WAVE = Source(
    "compensation.wave", wave,
    (
        Index("direction", lambda mechanism: tuple(_SENSES), lambda mechanism: tuple(_SENSES)),
        Index("order", lambda mechanism: _ORDERS, lambda mechanism: range(1, 2)),
    ),
    angles(300, "cos", "sin"),
    "output", _own_order, "none: what a controller adds", "a wave of a compensation table in the path of the command",
    acts="output", in_drives=True, tried=False,
    equation=r"$\delta = c\cos k\theta + s\sin k\theta$ in the direction in which the table is applied",
)  # fmt: skip

SOURCES = (WAVE,)
