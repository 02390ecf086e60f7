"""Output error while the speed or the load changes: running up, braking, steps, by integration in time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.directions import Direction, direction_sign
from rverror.base.errors import InputError, renamed
from rverror.base.viewed import Viewed
from rverror.dynamics.harmonic_balance import slope
from rverror.dynamics.loaded_motion import ReducedMotion
from rverror.dynamics.moving_reducer import moving_reducer
from rverror.dynamics.time_integration import Periodic, periodic
from rverror.dynamics.train import loaded_reducer
from rverror.geartrain.kinematics import fundamental_orders
from rverror.geartrain.mechanism import doubt_torque
from rverror.model.effects import Model, check_model
from rverror.model.readings import added, unread

#: Samples of the shortest period that is followed.
_SAMPLES = 8
_TOLERANCE = 1e-6  # of each step: contacts are known far less well


@dataclass(frozen=True)
class RunUp(Viewed):
    """Output error of a reducer while its speed or its load changes.

    Attributes
    ----------
    time : ndarray, shape (n,)
        s, even.
    theta : ndarray, shape (n,)
        Nominal output angle, rad; it falls in reverse.
    speed : ndarray, shape (n,)
        Of the input, rad/s.
    load : ndarray, shape (n,)
        Torque of the load, N*mm, that resists the motion.
    transmission_error : ndarray, shape (n,)
        rad.
    crawl : ndarray, shape (n,)
        The equilibrium's at the same angles, at `torque`.
    windup : ndarray, shape (n,)
        What the inertia of a changing speed, and the load beyond `torque`, would twist the train by at rest, rad.
    output_torque : ndarray, shape (n,)
        Torque that the gear train carries at its output, N*mm: the load and the inertia of carrier and load.  Where it
        is below 0 the contacts would have to pull: they open, and from there on the error is no prediction.
    frequency : ndarray, shape (m,)
        Natural frequencies of the mean stiffness, as far as they keep their inertia, Hz.
    of_sun_support : ndarray of bool, shape (m,)
        Which of them are modes of the sun's support.
    ratio, torque, direction : float
        Input turns per output turn; N*mm, the load about which contacts are taken; +1 or -1.
    """

    time: Array
    theta: Array
    speed: Array
    load: Array
    transmission_error: Array
    crawl: Array
    windup: Array
    output_torque: Array
    frequency: Array
    of_sun_support: npt.NDArray[np.bool_]
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
        s, growing.  The same time twice is a step.
    input_speeds : array_like or quantity, shape (k,)
        Of the input then, rad/s, 0 or more: what is prescribed is the input side of ``[bench]``, before its control.
    torque : float or array_like or quantity, shape (k,), optional
        Size of the output torque, N*mm, that resists the motion, one or then; the rated torque where left out.
    direction : {"forward", "reverse"} or +1 or -1
    smooth : bool
        Whether speed and torque go over by 3 s^2 - 2 s^3, the STEP function of multibody programs, or straight.
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
        If the model is no reducer, there is no torque, times, speeds and torques are no course, nothing holds the input
        (``position_control_stiffness`` of 0), errors of the sun repeat after too many turns, no periodic motion is
        found at the first speed, or the motion grows without bound.
    NotConvergedError
        If there is no equilibrium at some angle.

    Notes
    -----
    M y'' + C y' + K(theta) y = -M (X'' + x_s'') - T e about the equilibrium x_s(theta) at the last torque, T what the
    load has beyond it.  Begins at theta = 0, with the periodic motion of the first speed and torque.  Source 004 has
    J x'' + C x' + K x of the output alone.

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
    profile = _profile(model, times, input_speeds, torque=torque, direction=direction, smooth=smooth)
    load = units.InCore(profile.reference)
    unit, size = loaded_reducer(model, load)
    if model.bench.position_control_stiffness == 0:
        raise InputError(
            "position_control_stiffness = 0: nothing makes the input follow a speed; give a control, or leave it out "
            "for an input that does"
        )
    fastest = float(np.abs(profile.turn).max())
    made = moving_reducer(model, torque=load, direction=direction, fastest=fastest * unit.ratio, kept=kept)
    moving, beyond = made.motion, added(unread(model).effects, made.where.read)
    driven = max(fundamental_orders(unit).values()) * fastest / (2 * math.pi)
    followed = slice(moving.basis.shape[1])
    frequency, on_support = made.frequency[followed], made.of_sun_support[followed]
    begin, end = profile.time[[0, -1]]
    if samples is None:
        samples = 1 + math.ceil(_SAMPLES * max(float(frequency.max()), driven) * (end - begin))
    if samples < 2:
        raise InputError(f"samples = {samples}: give 2 times or more")
    time = np.linspace(begin, end, samples)
    moved, rate, course = _followed(moving, profile, time)
    theta, turn, _, beside = course
    told = _Told(moving, beyond)
    windup, output_torque = told.windup(course), told.output_torque(course, moved, rate)
    return RunUp(
        time=time,
        theta=theta,
        speed=np.abs(turn) * unit.ratio,
        load=size + direction * beside,
        transmission_error=told.error(course, moved),
        crawl=told.crawl(theta),
        windup=windup,
        output_torque=size + direction * (beside + output_torque),
        frequency=frequency,
        of_sun_support=on_support,
        ratio=unit.ratio,
        torque=size,
        direction=direction,
    )


#: Nominal output angle, its first and second derivative, and the load beyond the reference against the angle.
_Course = tuple[Array, Array, Array, Array]


@dataclass(frozen=True)
class _Profile:
    """Output speed and load against the angle beyond a reference, both signed, at some times."""

    time: Array
    turn: Array
    load: Array
    reference: float
    smooth: bool

    @cached_property
    def angle(self) -> Array:
        """At the times, rad: between two the speed is their mean on average."""
        travelled = np.diff(self.time) * (self.turn[1:] + self.turn[:-1]) / 2
        return np.concatenate([[0.0], np.cumsum(travelled)])

    def piece(self, number: int) -> Callable[[Any], tuple[Any, Any, Any, Any]]:
        """Course from one time on to the next, at a time or at several."""
        begin, end = self.time[number : number + 2].tolist()
        (first, last), (load, last_load) = (row[number : number + 2].tolist() for row in (self.turn, self.load))
        start, long, more, more_load = float(self.angle[number]), end - begin, last - first, last_load - load

        def course(time: Any) -> tuple[Any, Any, Any, Any]:
            share = (time - begin) / long
            if self.smooth:
                whole, gone, steep = share**3 - share**4 / 2, share**2 * (3 - 2 * share), 6 * share * (1 - share)
            else:
                whole, gone, steep = share**2 / 2, share, 1.0 + 0 * share
            angle = start + long * (first * share + more * whole)
            return angle, first + more * gone, more / long * steep, load + more_load * gone

        return course


def _profile(model: Model, times: Any, speeds: Any, *, torque: Any, direction: float, smooth: bool) -> _Profile:
    time, speed = _row("times", times, "time"), _row("input_speeds", speeds, "angular_speed")
    if time.size < 2 or not time[0] < time[-1] or not (np.diff(time) >= 0).all():
        raise InputError("times: give two or more that grow; the same time twice is a step")
    if speed.shape != time.shape or not (speed >= 0).all():
        raise InputError("input_speeds: give as many as times, each 0 or more; the direction is said by itself")
    several = isinstance(torque, Sequence) and not isinstance(torque, str)
    if not several and np.ndim(getattr(torque, "magnitude", torque) if torque is not None else 0) == 0:
        unit, reference = loaded_reducer(model, torque)
        load = np.full(time.shape, reference)
    else:
        load = _row("torque", torque, "torque")
        if load.shape != time.shape or not (load >= 0).all():
            raise InputError("torque: give one, or as many as times, each 0 or more")
        unit, reference = loaded_reducer(model, units.InCore(load[-1]))
        doubt_torque(unit, torque)
    return _Profile(time, direction * speed / unit.ratio, direction * (load - reference), reference, smooth)


def _row(name: str, values: Any, dimension: str) -> Array:
    """Values in a row, in the core unit."""
    try:
        if isinstance(values, Sequence) and not isinstance(values, str):
            row = np.array([units.to_core(one, dimension) for one in values], dtype=np.float64)
        else:
            row = np.atleast_1d(units.to_core_array(values, dimension))
    except ValueError as error:
        raise InputError(f"{name}: {error}") from error
    if row.ndim != 1:
        raise InputError(f"{name}: give them in a row")
    return row


def _followed(moving: ReducedMotion, profile: _Profile, time: Array) -> tuple[Array, Array, _Course]:
    """Coordinates and rates, (m, n), and the course at times, piece by piece."""
    forced, m = moving.forced, moving.basis.shape[1]
    y, rate = _begun(moving, profile)
    found, courses = np.empty((2 * m, time.size)), np.empty((4, time.size))
    for piece in range(profile.time.size - 1):
        begin, end = profile.time[piece : piece + 2]
        if begin == end:
            # a blow: what is sped up in no time, and Euler's force
            _, (_, by_acceleration, _) = forced.at(profile.angle[piece])
            turning = forced.oscillator.turning
            rate = rate + np.diff(profile.turn)[piece] * (by_acceleration - turning @ y / 2)
            continue
        own = (time >= begin) & ((time < end) | (end == time[-1]))
        stops = np.concatenate([[begin], time[own][time[own] > begin], [end]])
        stops = stops[: -1 if stops[-2] == end else None]

        course = profile.piece(piece)
        moved, rates = forced.in_time(course, stops, start=(y, rate), tolerance=_TOLERANCE)
        y, rate = moved[:, -1], rates[:, -1]
        found[:, own] = np.concatenate([moved, rates])[:, np.searchsorted(stops, time[own])]
        courses[:, own] = course(time[own])
    theta, turn, acceleration, beside = courses
    return found[:m], found[m:], (theta, turn, acceleration, beside)


def _begun(moving: ReducedMotion, profile: _Profile) -> tuple[Array, Array]:
    """Coordinates and rates at theta = 0 of the periodic motion at the first speed and load."""
    forced, turn, load = moving.forced, float(profile.turn[0]), float(profile.load[0])
    assert forced.by_load is not None
    force = turn**2 * forced.by_speed + load * forced.by_load
    if turn == 0:
        y = np.linalg.solve(forced.oscillator.stiffness[..., 0], force[:, 0])
        return np.asarray(y), np.zeros(y.size)
    moved = forced.oscillator.response(force, speed=turn)
    return moved[:, 0], turn * slope(moved, 2 * math.pi / forced.oscillator.period)[:, 0]


@dataclass(frozen=True)
class _Told:
    """What is told of the motion, over any angles."""

    moving: ReducedMotion
    beyond: Array

    @cached_property
    def _ends(self) -> list[int]:
        """Angles of carrier and load."""
        train = self.moving.whole.train
        return [at for part in ("carrier", "load") for at in train.place(part)[-1:]]

    @cached_property
    def _rows(self) -> Periodic:
        moving, whole = self.moving, self.moving.whole
        reading = whole.train.reading
        rest = [reading @ rows for rows in moving.rest]
        inertia = [rows[self._ends].sum(axis=0) for rows in (whole.inertia_force, whole.swing_force)]
        return periodic(np.stack([reading @ whole.state + self.beyond, *rest, *inertia, *moving.reading]), whole.period)

    def _at(self, theta: Array) -> Array:
        return self._rows(theta).T

    def crawl(self, theta: Array) -> Array:
        """Output error of the equilibrium."""
        return np.asarray(self._at(theta)[0])

    def error(self, course: _Course, moved: Array) -> Array:
        """Output error of a motion."""
        theta, turn, acceleration, load = course
        rows = self._at(theta)
        rest = turn**2 * rows[1] + acceleration * rows[2] + load * rows[3]
        return np.asarray(rows[0] + rest + (rows[6:] * moved).sum(axis=0))

    def windup(self, course: _Course) -> Array:
        """Output error that forces of acceleration and load would make at rest."""
        theta, _, acceleration, load = course
        rows = self._at(theta)
        matrices, forces = self.moving.forced.at(theta)
        force = acceleration[:, None] * forces[:, 1] + load[:, None] * forces[:, 2]
        twisted = np.linalg.solve(matrices[:, 0], force[..., None])[..., 0]
        return np.asarray(acceleration * rows[2] + load * rows[3] + (rows[6:] * twisted.T).sum(axis=0))

    def output_torque(self, course: _Course, moved: Array, rate: Array) -> Array:
        """Torque against the angle that inertia of carrier and load asks of the gear train."""
        theta, turn, acceleration, load = course
        rows = self._at(theta)
        (stiffness, damping), forces = (np.moveaxis(one, 1, 0) for one in self.moving.forced.at(theta))
        driving = turn**2 * forces[0].T + acceleration * forces[1].T + load * forces[2].T
        left = driving - np.einsum("nij,jn->in", stiffness, moved) - np.einsum("nij,jn->in", damping, rate)
        weighted = (self.moving.whole.train.mass[:, None] * self.moving.basis)[self._ends].sum(axis=0)
        return np.asarray(weighted @ left - turn**2 * rows[4] - acceleration * rows[5])
