"""Shafts of any geared drive of which only the orders are known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rverror.action_line import ErrorVector
from rverror.kinematics import Pose
from rverror.reducer import Drive


@dataclass(frozen=True, kw_only=True)
class DrivePose(Pose):
    """Nominal motion of a `Drive`.

    Attributes
    ----------
    drive : Drive
        Whose motion it is.
    """

    drive: Drive


def eccentricity(pose: DrivePose, *, shaft: str, harmonic: int) -> ErrorVector:
    """One shaft's error in the reading of the output, c cos(h o theta) + s sin(h o theta), o its turns per output turn.

    Parameters
    ----------
    pose : DrivePose
    shaft : str
        Name of the shaft in the drive.
    harmonic : int
        h, waves per turn of the shaft.

    Returns
    -------
    ErrorVector
        Terms cos, sin, as angles of the output.
    """
    angle = harmonic * pose.drive.shafts[shaft] * pose.theta
    return ErrorVector(contact="output", vector=np.stack([np.cos(angle), np.sin(angle)])[:, None])
