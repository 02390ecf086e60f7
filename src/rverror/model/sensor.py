"""Measuring chain: what encoders, couplings and clocks add to a reading.  These need no reducer, only the motion."""

from __future__ import annotations

import numpy as np

from rverror.base.arrays import Array, dot, radial_and_tangential
from rverror.geartrain.action_line import Contacts, ErrorVector, output_terms, output_wave
from rverror.geartrain.cycloid import pin_forces
from rverror.geartrain.kinematics import Pose, fundamental_orders, stated_load
from rverror.geartrain.mechanism import Mechanism
from rverror.geartrain.source import (
    Indices,
    Orders,
    Parameter,
    Source,
    angles,
    constant,
    harmonics,
    input_order,
    own_order,
    rv,
    windups,
)

_SPEED_SAMPLES = 5  # on each side, for a speed from angles and times that jitter


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
    return output_wave(pose.theta)


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
    return output_wave(2 * pose.theta)


def encoder_distortion(pose: Pose, *, harmonic: int) -> ErrorVector:
    """Distorted output encoder, c cos(h theta) + s sin(h theta) in the reading: a ring that is held at h places.

    Parameters
    ----------
    pose : Pose
    harmonic : int
        h, 3 or more.

    Returns
    -------
    ErrorVector
        Terms cos, sin.

    Notes
    -----
    The same at every load and in both directions.  Three screws make order 3; so does a flange of three cranks, which
    grows with the load: see ``load.torsion_wave``.
    """
    return output_wave(harmonic * pose.theta)


def output_tilt(pose: Pose) -> ErrorVector:
    """Tilt of the output under the couple of the discs, read by one head: e . u times the size of the torque.

    Parameters
    ----------
    pose : Pose

    Returns
    -------
    ErrorVector
        Terms x, y, rad per N*mm: where on the held part the head stands, and how far the reading goes.

    Raises
    ------
    ValueError
        If the pose is not that of a reducer, or has no torque.

    Notes
    -----
    The pins push the first disc by Q for each unit of torque and the others back, at a distance along the axis: a
    couple that turns as the cranks do, seen from the held part, once in -z_c/(z_p - z_c) of an output turn where that
    is the housing, and tilts the output in its main bearing.  One reading head takes the tilt towards it for an angle;
    two that stand opposite do not.  u is the direction of Q, from the rigid closed form.  Reversed torque mirrors Q in
    the eccentric direction: what Q has along it is alike in both directions, what it has across it, most of it, is
    opposite.  No source text has it.
    """
    if not isinstance(pose, Contacts):
        raise ValueError("sensor.output_tilt needs the pose of a reducer: it reads the force of the pins on a disc")
    load = np.abs(stated_load(pose, "sensor.output_tilt"))
    push = (pin_forces(pose)[0] * pose.resisted).sum(axis=0)
    seen = dot(np.stack(radial_and_tangential(pose.turns[pose.reducer.held])), push)
    return output_terms(*(load * seen / np.hypot(*push)))


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
    return output_wave(harmonic * pose.ratio * pose.theta, 1 / pose.ratio)


def index_offset(pose: Pose) -> ErrorVector:
    """Angle by which the gear's marks are ahead of the bench's zero: the gear train stands at theta + offset.

    Parameters
    ----------
    pose : Pose

    Returns
    -------
    ErrorVector
        Term offset.

    Notes
    -----
    By itself it makes no error, so its influence is zero here; it turns the waveform of everything else in the gear
    train, and the composers do that with `Model.index_offset`.  What the bench reads (encoders, couplings) keeps to
    the bench's zero.
    """
    return output_terms(np.zeros(pose.theta.size))


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
    return output_terms(pose.theta)


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
    return output_terms((clock - clock[0]) / (span if span > 0 else 1.0))


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

    Notes
    -----
    The speed is that of `slope`.
    """
    if pose.time is None:
        raise ValueError("sensor.time_offset needs time; give time, or a run file with a time[s] column")
    if not np.ptp(pose.time) > 0:
        raise ValueError("sensor.time_offset needs at least two different times")
    order = np.argsort(pose.time, kind="stable")
    speed = np.empty_like(pose.theta)
    speed[order] = slope(pose.theta[order], pose.time[order])
    return output_terms(speed)


def slope(values: Array, clock: Array) -> Array:
    """Rate of change from straight lines through neighbouring samples.

    Differences of single samples would carry the jitter of angle and time, and the size of an effect that is
    proportional to the speed would come out too small (the attenuation of a regressor with errors).

    Parameters
    ----------
    values, clock : ndarray, shape (n,)
        Times may repeat.

    Returns
    -------
    ndarray, shape (n,)

    Examples
    --------
    >>> slope(np.array([0.0, 1.0, 2.0, 2.0]), np.array([0.0, 0.5, 1.0, 1.0]))
    array([2., 2., 2., 2.])
    """
    span = float(np.ptp(clock))
    mean = float(values[np.argmax(clock)] - values[np.argmin(clock)]) / span if span > 0 else 0.0
    rest = values - mean * clock  # so that a constant speed is exact
    near, far = (_line_slope(rest, clock, reach) for reach in (_SPEED_SAMPLES, 2 * _SPEED_SAMPLES))
    # what bends within the samples makes an error that grows with the square of their number
    return np.asarray(mean + near + (near - far) / 3, dtype=np.float64)


def _line_slope(values: Array, clock: Array, reach: int) -> Array:
    """Slope of the straight line through so many neighbours on each side."""
    at = np.arange(values.size)
    reach_here = np.minimum(reach, np.minimum(at, values.size - 1 - at))
    reach_here = np.maximum(reach_here, min(reach, 2))
    low, high = np.maximum(at - reach_here, 0), np.minimum(at + reach_here + 1, values.size)
    time, angle = clock - clock.mean(), values - values.mean()

    def mean(row: Array) -> Array:
        total = np.concatenate([[0.0], np.cumsum(row)])
        return np.asarray((total[high] - total[low]) / (high - low), dtype=np.float64)

    spread = mean(time * time) - mean(time) ** 2
    moved = spread > 1e-12 * float(np.ptp(clock)) ** 2
    product = mean(time * angle) - mean(time) * mean(angle)
    return np.where(moved, product / np.where(moved, spread, 1.0), 0.0)


def _fixed(*orders: float) -> Orders:
    return lambda mechanism, indices: orders


def _eccentric_order(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    return (fundamental_orders(rv(mechanism))[rv(mechanism).held],)


MARKS = Source(
    "sensor.index_offset", index_offset, (), angles(3600, "offset"),
    "output", constant, "measuring chain",
    "gear's marks ahead of the bench's zero; turns the waveform of all other gear errors",
    acts="marks", tried=False,
    equation=r"none of its own: all other gear errors are taken at $\theta + e$",
)  # fmt: skip

SOURCES = (
    Source(
        "sensor.encoder_eccentricity", encoder_eccentricity, (), angles(300, "cos", "sin"),
        "output", _fixed(1.0), "measuring chain", "output encoder or coupling, once a turn",
        acts="reading", in_drives=True,
        equation=r"$\delta = c\cos\theta + s\sin\theta$",
    ),
    Source(
        "sensor.encoder_ellipticity", encoder_ellipticity, (), angles(100, "cos", "sin"),
        "output", _fixed(2.0), "measuring chain", "output encoder, twice a turn",
        acts="reading", in_drives=True,
        equation=r"$\delta = c\cos 2\theta + s\sin 2\theta$",
    ),
    Source(
        "sensor.encoder_distortion", encoder_distortion, (harmonics(3, 6),), angles(30, "cos", "sin"),
        "output", own_order, "measuring chain", "output encoder held at some places, as often a turn",
        acts="reading", in_drives=True, tried=False, in_tables=True,
        equation=r"$\delta = c\cos h\theta + s\sin h\theta$",
    ),
    Source(
        "sensor.output_tilt", output_tilt, (), windups(10, "x", "y"),
        "housing", _eccentric_order, "measuring chain", "tilt of the output under the discs' couple, read by one head",
        acts="reading", needs=("torque",), tried=False, in_tables=True,
        equation=r"$\delta = T\, (e_x u_x + e_y u_y)$, $u$ the direction in which the pins push the first disc",
    ),
    Source(
        "sensor.input_coupling", input_coupling, (harmonics(1, 2),), angles(7200, "cos", "sin"),
        "sun", input_order, "measuring chain", "input coupling or encoder, an angle of the input shaft",
        acts="reading", in_drives=True,
        equation=r"$\delta = (c\cos hR\theta + s\sin hR\theta)/R$",
    ),
    MARKS,
    Source(
        "sensor.ratio_error", ratio_error, (), (Parameter("slope", "slope", 0.1),),
        "output", constant, "measuring chain", "error that grows with the output angle", periodic=False,
        acts="reading", in_drives=True,
        equation=r"$\delta = e\,\theta$",
    ),
    Source(
        "sensor.drift", drift, (), angles(600, "total"),
        "output", constant, "measuring chain", "slow drift of a run, first to last sample", periodic=False,
        acts="reading", in_drives=True, follows="time",
        equation=r"$\delta = e\,(t - t_0)/(t_1 - t_0)$ over the time $t$ of a run",
    ),
    Source(
        "sensor.time_offset", time_offset, (), (Parameter("offset", "time", 0.1),),
        "output", constant, "measuring chain", "delay between the two encoders", periodic=False,
        acts="reading", in_drives=True, follows="speed", needs=("time",),
        equation=r"$\delta = e\,\dot\theta$",
        hidden="at constant speed the reading lags by a constant angle, each way",
    ),
)  # fmt: skip
