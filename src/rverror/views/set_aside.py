"""Where the pictures of a run show the samples that were set aside and the slips of its reading."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from rverror.base.arrays import Array
from rverror.diagnosis.result import Trace
from rverror.views.by_order import turns_of

#: What each kind of mark is called in a legend.
LABELS = {"aside": "sample set aside", "slip": "slip of the reading"}


@dataclass(frozen=True)
class Marks:
    """Angles at which a picture marks something, rad; `kind` is a key of `LABELS`."""

    kind: str
    angles: Array


def marks(trace: Trace) -> tuple[Marks, ...]:
    """Samples set aside and slips at the angles of the waveform, the kinds that there are.

    Where the waveform spans whole turns, angles of later turns are folded onto it; else those beyond its ends are not
    shown.

    Examples
    --------
    >>> theta = np.radians(np.arange(0.0, 360.0, 10.0))
    >>> trace = Trace("run.csv", 1.0, theta, theta, theta, theta, slips=np.radians([5.0, 730.0]))
    >>> [(one.kind, np.degrees(one.angles).round(6).tolist()) for one in marks(trace)]
    [('slip', [5.0, 10.0])]
    """
    given = (("aside", trace.set_aside), ("slip", trace.slips))
    shown = (Marks(kind, _within(trace, angles)) for kind, angles in given if angles is not None)
    return tuple(one for one in shown if one.angles.size)


def _within(trace: Trace, angles: Array) -> Array:
    low, high = float(trace.theta.min()), float(trace.theta.max())
    turns = abs(turns_of(trace))
    if turns and turns == round(turns):
        return np.asarray(low + np.mod(angles - low, 2 * math.pi * turns), dtype=np.float64)
    return np.asarray(angles[(angles >= low) & (angles <= high)], dtype=np.float64)
