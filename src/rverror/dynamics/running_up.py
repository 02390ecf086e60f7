"""Output error while the speed changes: running up and braking, by integration in time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from rverror.base.arrays import Array, Flags, slope
from rverror.base.directions import Direction, direction_sign
from rverror.base.errors import InputError, renamed
from rverror.base.quantities import row
from rverror.base.viewed import Viewed
from rverror.dynamics.loaded_motion import driven_frequency, moving_reducer
from rverror.dynamics.time_integration import periodic
from rverror.model.effects import Model, check_model
from rverror.model.readings import added, unread

#: Samples of the shortest period that is followed.
_SAMPLES = 8
_TOLERANCE = 1e-6  # of each step: contacts are known far less well


@dataclass(frozen=True)
class RunUp(Viewed):
    """Output error of a reducer while its speed changes.

    Attributes
    ----------
    time : ndarray, shape (n,)
        s, even.
    theta : ndarray, shape (n,)
        Nominal output angle, rad; it falls in reverse.
    speed : ndarray, shape (n,)
        Of the input, rad/s.
    transmission_error : ndarray, shape (n,)
        rad.
    crawl : ndarray, shape (n,)
        The equilibrium's at the same angles, at `torque`.
    windup : ndarray, shape (n,)
        What the inertia of a changing speed would twist the train by at rest, rad.
    output_torque : ndarray, shape (n,)
        Torque that the gear train carries at its output, N*mm: the load and the inertia of carrier and load.  Where it
        is below 0 the contacts would have to pull: they open, and from there on the error is no prediction.
    frequency : ndarray, shape (m,)
        Natural frequencies of the mean stiffness, as far as they keep their inertia, Hz.
    of_sun_support : ndarray of bool, shape (m,)
        Which of them are modes of the sun's support.
    ratio, torque, direction : float
        Input turns per output turn; N*mm; +1 or -1.
    """

    time: Array
    theta: Array
    speed: Array
    transmission_error: Array
    crawl: Array
    windup: Array
    output_torque: Array
    frequency: Array
    of_sun_support: Flags
    ratio: float
    torque: float
    direction: float

    @property
    def vibration(self) -> Array:
        """What is left of the error without `crawl` and `windup`: the answer to errors at speed, and transients."""
        return self.transmission_error - self.crawl - self.windup


@renamed(speeds="input_speeds")
def run_up(
    model: Model,
    times: Any,
    input_speeds: Any,
    *,
    torque: Any | None = None,
    direction: Direction = "forward",
    smooth: bool = True,
    kept: int | None = None,
    samples: int | None = None,
) -> RunUp:
    """Output error of a reducer whose input follows a course of speeds, by integration in time.

    Parameters
    ----------
    model : Model
        Of a reducer; its effects, stiffness, inertia and bench count.  What only misreads the output does not.
    times : array_like or quantity, shape (k,)
        s, growing.
    input_speeds : array_like or quantity, shape (k,)
        Of the input then, rad/s, 0 or more: what is prescribed is the input side of ``[bench]``, before its control.
    torque : float or str or quantity, optional
        Size of the output torque, N*mm, that resists the motion; the rated torque where left out.
    direction : {"forward", "reverse"} or +1 or -1
    smooth : bool
        Whether the speed goes over by 3 s^2 - 2 s^3, the STEP function of multibody programs, or straight.
    kept : int, optional
        How many modes of the mean stiffness keep their inertia; where left out those up to two and a half times the
        highest frequency that the meshes drive, and one of the machine at least.
    samples : int, optional
        How many even times; where left out eight of the shortest period that is driven or kept.

    Returns
    -------
    RunUp

    Raises
    ------
    InputError
        If the model is no reducer, there is no torque, times and speeds are no course, nothing holds the input
        (``position_control_stiffness`` of 0), errors of the sun repeat after too many turns, no periodic motion is
        found at the first speed, or the motion grows without bound.
    NotConvergedError
        If there is no equilibrium at some angle.

    Notes
    -----
    M y'' + C y' + K(theta) y = -M (X'' + x_s'') about the equilibrium x_s(theta).  Begins at theta = 0, with the
    periodic motion of the first speed.  Source 004 has J x'' + C x' + K x of the output alone.

    Examples
    --------
    >>> import rverror
    >>> bench = rverror.model.Bench(load_inertia="2 kg*m^2")
    >>> model = rverror.Model(rverror.reducer("RV-40E"), bench=bench)
    >>> found = run_up(model, ["0 s", "0.1 s", "0.2 s"], ["0 rpm", "600 rpm", "600 rpm"], torque="100 N*m")
    >>> most = 100e3 + 1.5 * 2000 * (600 / 121 * 0.10472) / 0.1  # 3 s^2 - 2 s^3 is at most half as steep again
    >>> bool(abs(found.output_torque.max() / most - 1) < 0.1)
    True
    """
    check_model(model)
    direction = direction_sign(direction)
    if model.bench.position_control_stiffness == 0:
        raise InputError(
            "position_control_stiffness = 0: nothing makes the input follow a speed; give a control, or leave it out "
            "for an input that does"
        )
    stops, speeds = _stops(times, input_speeds)
    fastest = float(speeds.max())
    made = moving_reducer(model, torque=torque, direction=direction, fastest=fastest, kept=kept)
    unit, moving, forced = made.unit, made.motion, made.motion.forced
    at_stops = direction * speeds / unit.ratio
    if samples is None:
        highest = max(float(made.frequency.max()), driven_frequency(unit, fastest))
        samples = 1 + math.ceil(_SAMPLES * highest * float(stops[-1] - stops[0]))
    if samples < 2:
        raise InputError(f"samples = {samples}: give 2 times or more")
    time = np.linspace(stops[0], stops[-1], samples)
    course = _course(stops, at_stops, smooth=smooth)
    whole, first, shortest = moving.whole, float(at_stops[0]), float(np.diff(stops).min())
    begun = moving.response(first)  # over one period
    start = begun[:, 0], first * slope(begun, 2 * math.pi / whole.period)[:, 0]
    moved, rate = forced.in_time(course, time, start=start, tolerance=_TOLERANCE, longest=shortest)
    theta, turn, acceleration = course(time).T

    read, ends = whole.train.reading, [at for part in ("carrier", "load") for at in whole.train.place(part)[-1:]]
    still = read @ whole.state + added(unread(model).effects, made.where.read)
    rest = [read @ rows for _, rows in (moving.followed, moving.sped_up)]
    inertia = [rows[ends].sum(axis=0) for rows in (whole.inertia_force, whole.swing_force)]
    rows = periodic(np.stack([still, *rest, *inertia, *moving.reading]), whole.period)(theta).T
    (crawl, by_speed, by_acceleration, heavy, swung), reading = rows[:5], rows[5:]
    matrices, forces = forced.at(theta)
    twisted = np.linalg.solve(matrices[:, 0], acceleration[:, None, None] * forces[:, 1, :, None])[..., 0]
    # what inertia of carrier and load asks of the gear train
    left = turn**2 * forces[:, 0].T + acceleration * forces[:, 1].T
    left -= np.einsum("nij,jn->in", matrices[:, 0], moved) + np.einsum("nij,jn->in", matrices[:, 1], rate)
    weighted = (whole.train.mass[:, None] * moving.basis)[ends].sum(axis=0)
    inertia_torque = weighted @ left - turn**2 * heavy - acceleration * swung
    return RunUp(
        time=time,
        theta=theta,
        speed=np.abs(turn) * unit.ratio,
        transmission_error=crawl + turn**2 * by_speed + acceleration * by_acceleration + (reading * moved).sum(axis=0),
        crawl=crawl,
        windup=acceleration * by_acceleration + (reading * twisted.T).sum(axis=0),
        output_torque=made.torque + direction * inertia_torque,
        frequency=made.frequency,
        of_sun_support=made.of_sun_support,
        ratio=unit.ratio,
        torque=made.torque,
        direction=direction,
    )


def _stops(times: Any, speeds: Any) -> tuple[Array, Array]:
    """Times and input speeds of a course."""
    time, speed = row("times", times, "time"), row("input_speeds", speeds, "angular_speed")
    if time.size < 2 or not (np.diff(time) > 0).all():
        raise InputError("times: give two or more that grow")
    if speed.shape != time.shape or not (speed >= 0).all():
        raise InputError("input_speeds: give as many as times, each 0 or more; the direction is said by itself")
    return time, speed


def _course(time: Array, turn: Array, *, smooth: bool) -> Any:
    """Angle, speed and acceleration of the output over time, (..., 3), from its speeds at some times."""
    if smooth:
        speed = scipy.interpolate.CubicHermiteSpline(time, turn, np.zeros_like(turn))
    else:
        speed = scipy.interpolate.PPoly(np.stack([np.diff(turn) / np.diff(time), turn[:-1]]), time)
    rows = [speed.antiderivative().c, speed.c, speed.derivative().c]
    # one polynomial of all three: an integration asks for them some ten thousand times
    padded = [np.concatenate([np.zeros((len(rows[0]) - len(one), one.shape[1])), one]) for one in rows]
    return scipy.interpolate.PPoly(np.stack(padded, axis=-1), time)
