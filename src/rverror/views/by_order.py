"""Turns that angles span, and names of frames as pictures have room for them."""

from __future__ import annotations

import math

from rverror.base.arrays import Array


def short_frame(frame: str) -> str:
    """Name of a frame as a picture has room for it."""
    short = frame.replace("carrier, disc or crank", "carrier/disc/crank")
    return short.replace("output side (encoder, coupling)", "output side")


def turns_of(theta: Array) -> float:
    """Output turns that even angles span, whole where they span whole turns."""
    turns = float(theta[-1] - theta[0] + theta[1] - theta[0]) / (2 * math.pi)
    return float(round(turns)) if abs(turns - round(turns)) < 1e-3 * turns else turns
