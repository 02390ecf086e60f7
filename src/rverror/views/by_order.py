"""Turns and sampling of the runs of a diagnosis; names of frames, and the sidebands of their orders."""

from __future__ import annotations

import math

from rverror.base.arrays import Array
from rverror.diagnosis.result import Diagnosis
from rverror.geartrain.mechanism import Drive, Mechanism
from rverror.runs.spectrum import frames_of_order

_SIDEBANDS = (-1, 1, -2, 2)


def short_frame(frame: str) -> str:
    """Name of a frame as a picture has room for it."""
    short = frame.replace("carrier, disc or crank", "carrier/disc/crank")
    return short.replace("output side (encoder, coupling)", "output side")


def turns_of(theta: Array) -> float:
    """Output turns that even angles span, whole where they span whole turns."""
    turns = float(theta[-1] - theta[0] + theta[1] - theta[0]) / (2 * math.pi)
    return float(round(turns)) if abs(turns - round(turns)) < 1e-3 * turns else turns


def samples_per_turn(diagnosis: Diagnosis) -> float:
    """Samples an output turn of the coarsest run; infinite where traces do not keep it, as those of a drive."""
    if isinstance(diagnosis.declared.mechanism, Drive) or not diagnosis.traces:
        return math.inf
    return min(float(trace.theta.size / turns_of(trace.theta)) for trace in diagnosis.traces)


def sideband_frames(mechanism: Mechanism, order: float) -> tuple[str, ...]:
    """Frames of which an order that fits none is a sideband, once or twice an output turn away.

    Parameters
    ----------
    mechanism : Reducer or Drive
    order : float
        Per output turn.

    Returns
    -------
    tuple of str
        Empty where the order fits a frame itself, or where there is none beside it.

    Examples
    --------
    >>> from rverror import reducer
    >>> [sideband_frames(reducer("RV-40E"), order) for order in (77, 78, 36)]
    [('1 below housing 39 x 2',), (), ()]
    """
    if frames_of_order(mechanism, order):
        return ()
    for away in _SIDEBANDS:
        near = [f for f in frames_of_order(mechanism, order - away) if order - away > 2.5]
        if near:
            return (f"{abs(away)} {'above' if away > 0 else 'below'} {near[0]}",)
    return ()
