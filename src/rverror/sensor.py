"""Measuring chain: what encoders, couplings and clocks add to a reading.  These need no reducer, only the motion."""

from __future__ import annotations

import numpy as np

from rverror.action_line import Array, ErrorVector
from rverror.kinematics import Pose


def encoder_eccentricity(pose: Pose) -> ErrorVector:
    """Eccentric output encoder or coupling: c cos(theta) + s sin(theta) in the reading of the output.

    Parameters
    ----------
    pose : Pose

    Returns
    -------
    ErrorVector
        Terms cos, sin.

    Notes
    -----
    Order 1 comes from outside the gear train: the only source of the catalogue that gives it, whatever 000 and 003
    ascribe to it.
    """
    return _reading(_waves(pose.theta))


def encoder_ellipticity(pose: Pose) -> ErrorVector:
    """Elliptic scale or tilted output encoder: c cos(2 theta) + s sin(2 theta) in the reading of the output.

    Parameters
    ----------
    pose : Pose

    Returns
    -------
    ErrorVector
        Terms cos, sin.
    """
    return _reading(_waves(2 * pose.theta))


def input_coupling(pose: Pose, *, harmonic: int) -> ErrorVector:
    """Input coupling or input encoder: the sun leads its reading by c cos(h phi) + s sin(h phi), phi the input angle.

    Parameters
    ----------
    pose : Pose
    harmonic : int
        1 for eccentricity or a parallel offset, 2 for a bent universal joint.

    Returns
    -------
    ErrorVector
        Terms cos, sin, as angles of the input shaft; the output moves by a ratio-th of them at the order h R.
    """
    return _reading(_waves(harmonic * pose.ratio * pose.theta) / pose.ratio)


def ratio_error(pose: Pose) -> ErrorVector:
    """Error that grows with the output angle: a wrong nominal ratio or encoder scale.

    Parameters
    ----------
    pose : Pose

    Returns
    -------
    ErrorVector
        Term slope, angle per angle.
    """
    return _reading(pose.theta[None])


def drift(pose: Pose) -> ErrorVector:
    """Slow drift of the reading, proportional to time (or to the sample's place where there is no time).

    Parameters
    ----------
    pose : Pose

    Returns
    -------
    ErrorVector
        Term total: angle from the first sample to the last.
    """
    clock = np.arange(pose.theta.size, dtype=np.float64) if pose.time is None else pose.time
    span = np.ptp(clock)
    return _reading(((clock - clock[0]) / (span if span > 0 else 1.0))[None])


def time_offset(pose: Pose) -> ErrorVector:
    """Delay between the two encoders: the output is read later than the input by the offset.

    Parameters
    ----------
    pose : Pose

    Returns
    -------
    ErrorVector
        Term offset, s: the error is offset times output speed.

    Raises
    ------
    ValueError
        If the pose has no time.
    """
    if pose.time is None:
        raise ValueError("sensor.time_offset needs time; give time, or a run file with a time[s] column")
    unique, first = np.unique(pose.time, return_index=True)
    if unique.size < 2:
        raise ValueError("sensor.time_offset needs at least two different times")
    speed = np.gradient(pose.theta[first], unique)
    return _reading(np.interp(pose.time, unique, speed)[None])


def _waves(angle: Array) -> Array:
    return np.stack([np.cos(angle), np.sin(angle)])


def _reading(vector: Array) -> ErrorVector:
    return ErrorVector(contact="output", vector=vector[:, None])
