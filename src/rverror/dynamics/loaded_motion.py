"""A reducer's parts in motion about their loaded state, over one period, and what each of its errors does there.

Everything is written in the frames of the parts; what moves far faster than it is driven follows as a spring.
`docs/theory/dynamics.md` derives both.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array, Flags, slope
from rverror.base.errors import InputError
from rverror.dynamics.harmonic_balance import Oscillator
from rverror.dynamics.time_integration import Forced
from rverror.dynamics.train import SUPPORTED, Train, loaded_reducer, natural_motions
from rverror.geartrain.contacts import pose
from rverror.geartrain.kinematics import frame_orders, fundamental_orders, samples_needed, true_period
from rverror.geartrain.mechanism import Reducer
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.model.readings import Stand, stand, unread
from rverror.statics.energy import Layout
from rverror.statics.loaded_state import Settled, statics_of

#: Output error, rad, shape (n,), at a speed of the output.
ErrorAtSpeed = Callable[[float], Array]


@dataclass(frozen=True)
class LoadedMotion:
    """Loaded state and stiffness of a gear train at n even angles of one period, in the frames of the parts.

    Attributes
    ----------
    train : Train
    theta : ndarray, shape (n,)
        Nominal output angle, rad.
    period : float
        rad.
    state : ndarray, shape (size, n)
        Equilibrium.
    course : ndarray, shape (size, n)
        The waves of it that n samples hold, without those that would fold onto them: what inertia follows.
    stiffness : ndarray, shape (n, size, size)
    damping : ndarray, shape (n, size, size), optional
        By contact; None where a ratio damps every mode.
    """

    train: Train
    theta: Array
    period: float
    state: Array
    course: Array
    stiffness: Array
    damping: Array | None

    @cached_property
    def _mean(self) -> tuple[Array, Array]:
        """Squares of the frequencies of the mean stiffness, and its modes, of mass 1, as columns."""
        return natural_motions(self.stiffness.mean(axis=0), self.train.mass)

    def mean_modes(self) -> tuple[Array, Flags]:
        """Frequencies of the mean stiffness, Hz, and which are of the sun's support."""
        value, shape = self._mean
        at = list(self.train.place("sun")[:2])  # the support is the same in any frame
        held = self.train.reducer.stiffness.sun_support * (shape[at] ** 2).sum(axis=0)
        return np.sqrt(value) / (2 * math.pi), (value > 0) & (held > SUPPORTED * value)

    @cached_property
    def inertia_force(self) -> Array:
        """Force of the parts' inertia against nominal motion and equilibrium per speed squared, (size, n)."""
        nominal = self.train.mass * self.train.turns**2 * _centres(self.train)
        return self.inertia_against(self.course) + nominal[:, None]

    def inertia_against(self, course: Array) -> Array:
        """Force of the parts' inertia against a course in their frames, (size, n), per speed squared."""
        turns, step = self.train.turns[:, None], 2 * math.pi / self.period
        first, second = (slope(course, step, power) for power in (1, 2))
        acceleration = second + 2 * turns * (self.train.quarter_turn @ first) - turns**2 * course
        return np.asarray(-self.train.mass[:, None] * acceleration)

    @cached_property
    def swing_force(self) -> Array:
        """Force of the parts' inertia per rad/s^2 of the output as the nominal motion is sped up, (size, n)."""
        turns = self.train.turns[:, None]
        swing = slope(self.course, 2 * math.pi / self.period) + turns * (self.train.quarter_turn @ self.course)
        return np.asarray(-self.train.mass[:, None] * (swing + _nominal_rate(self.train)[:, None]))

    def reduced(self, kept: int) -> ReducedMotion:
        """With the motions alone in which the lowest modes of the mean stiffness have their inertia."""
        value, vector = self._mean
        kept = min(kept, self.train.size)
        basis = vector[:, :kept]
        if kept == self.train.size:
            shapes = np.broadcast_to(basis, (self.theta.size, *basis.shape))
            return ReducedMotion(self, basis, shapes, basis.T @ self.stiffness @ basis, None)
        # a free motion has no flexibility: it is held meanwhile
        inertia, hold = self.train.mass[:, None] * basis, value[kept]
        flexibility = np.linalg.inv(self.stiffness + hold * inertia @ inertia.T)
        flexible = flexibility @ inertia
        stiff = np.linalg.inv(inertia.T @ flexible)
        return ReducedMotion(self, basis, flexible @ stiff, stiff - hold * np.eye(kept), flexibility)


@dataclass(frozen=True)
class ReducedMotion:
    """The same with as many coordinates as modes are kept.

    Attributes
    ----------
    whole : LoadedMotion
    basis : ndarray, shape (size, m)
        Modes of the mean stiffness, of mass 1.
    shapes : ndarray, shape (n, size, m)
        Pose per unit of each coordinate, of least energy.
    stiffness : ndarray, shape (n, m, m)
    flexibility : ndarray, shape (n, size, size), optional
        Of all modes, those that are kept held besides; None where all are kept.
    """

    whole: LoadedMotion
    basis: Array
    shapes: Array
    stiffness: Array
    flexibility: Array | None

    @cached_property
    def oscillator(self) -> Oscillator:
        """Its equations."""
        train = self.whole.train
        if self.whole.damping is None:
            value, vector = np.linalg.eigh(self.stiffness)
            frequency = np.sqrt(np.maximum(value, 0.0))
            damping = 2 * train.bench.ratio_of_modes * (vector * frequency[:, None]) @ np.swapaxes(vector, 1, 2)
        else:
            damping = np.swapaxes(self.shapes, 1, 2) @ self.whole.damping @ self.shapes
        weighted = train.mass[:, None] * self.basis
        turns = train.turns[:, None]
        return Oscillator(
            stiffness=_samples_last(self.stiffness),
            damping=_samples_last(damping),
            turning=2 * weighted.T @ train.quarter_turn @ (turns * self.basis),
            centrifugal=-weighted.T @ (turns**2 * self.basis),
            period=self.whole.period,
        )

    @cached_property
    def followed(self) -> tuple[Array, Array]:
        """Of nominal motion and equilibrium per speed squared: force of inertia on the coordinates, (m, n), and pose
        that the other modes take as springs, (size, n)."""
        return self._follow(self.whole.inertia_force)

    @cached_property
    def sped_up(self) -> tuple[Array, Array]:
        """The same per rad/s^2 of the output."""
        return self._follow(self.whole.swing_force)

    def _follow(self, given: Array) -> tuple[Array, Array]:
        """Force on the coordinates, and the pose that the other modes take as springs under a force, (size, n)."""
        force = np.einsum("nci,cn->in", self.shapes, given)
        if self.flexibility is None:
            return force, np.zeros_like(given)
        bent = (self.flexibility @ given.T[..., None])[..., 0]
        weighted = self.whole.train.mass[:, None] * self.basis
        own = (self.shapes @ (bent @ weighted)[..., None])[..., 0]  # of the modes that are kept
        return force, (bent - own).T

    @cached_property
    def forced(self) -> Forced:
        """Its equations with what drives them at any course of the speed."""
        return Forced(self.oscillator, self.followed[0], self.sped_up[0])

    def response(self, speed: float) -> Array:
        """Motion about the loaded state in these coordinates, (m, n), at a speed of the output, rad/s, of any sign."""
        return self.oscillator.response(speed**2 * self.followed[0], speed=speed)

    def error(self, moved: Array, speed: float) -> Array:
        """Output error of the loaded state and a motion about it at a speed, (n,)."""
        train = self.whole.train
        still = train.reading @ (self.whole.state + speed**2 * self.followed[1])
        return np.asarray(still + (self.reading * moved).sum(axis=0))

    def share(self, state: Array, course: Array) -> ErrorAtSpeed:
        """What a share of the equilibrium, (size, n), with the waves of it that inertia follows does at speed."""
        force, rest = self._follow(self.whole.inertia_against(course))
        still, follows = self.whole.train.reading @ state, self.whole.train.reading @ rest

        def error(speed: float) -> Array:
            moved = self.oscillator.response(speed**2 * force, speed=speed)
            return np.asarray(still + speed**2 * follows + (self.reading * moved).sum(axis=0))

        return error

    def pose(self, moved: Array, speed: float, at: slice) -> Array:
        """Motion of the parts about the loaded state in the housing frame, (size, n), at some of the angles."""
        whole = self.whole
        own = np.einsum("nci,in->cn", self.shapes[at], moved[:, at]) + speed**2 * self.followed[1][:, at]
        return in_frames(whole.train, own, -whole.theta[at])

    @cached_property
    def reading(self) -> Array:
        """How the output error follows the coordinates, (m, n)."""
        return np.asarray(np.einsum("c,nci->in", self.whole.train.reading, self.shapes))


def loaded_motion(
    train: Train, settled: Settled, theta: Array, period: float, between: Array | None = None
) -> LoadedMotion:
    """Loaded state and stiffness in the frames of the parts.

    Parameters
    ----------
    train : Train
    settled : Settled
        At all angles.
    theta : ndarray, shape (n,)
        Those angles, evenly spaced over one period.
    period : float
        rad.
    between : ndarray, shape (n, unknowns), optional
        Poses half a step further on, so that waves above half the samples do not fold.

    Returns
    -------
    LoadedMotion
    """
    state = in_frames(train, train.pose(settled.x).T, theta)
    groups = train.stiffness(settled)
    stiffness, damping = _turned(train, np.asarray(sum(groups.values())), theta), None
    if train.bench.damping_times:
        damping = _turned(train, np.broadcast_to(train.damping(groups), stiffness.shape), theta)
    course = state if between is None else held_waves(train, state, between, theta, period)
    return LoadedMotion(train, theta, period, state, course, stiffness, damping)


def held_waves(train: Train, state: Array, between: Array, theta: Array, period: float) -> Array:
    """The waves of a state, (size, n), that its samples hold, without those that would fold onto them.

    Parameters
    ----------
    train : Train
    state : ndarray, shape (size, n)
        In the frames of the parts.
    between : ndarray, shape (n, unknowns)
        Poses half a step further on.
    theta : ndarray, shape (n,)
    period : float
        rad.

    Returns
    -------
    ndarray, shape (size, n)
    """
    count = theta.size
    fine = np.empty((train.size, 2 * count))
    fine[:, ::2] = state
    fine[:, 1::2] = in_frames(train, train.pose(between).T, theta + period / (2 * count))
    waves = np.fft.rfft(fine)[:, : count // 2 + 1] / 2
    waves[:, -1] = 0
    return np.asarray(np.fft.irfft(waves, count))


def in_frames(train: Train, rows: Array, theta: Array) -> Array:
    """Rows of coordinates in the housing frame, (..., size, n), in those of the parts."""
    angle = train.turns[:, None] * theta
    return np.cos(angle) * rows - np.sin(angle) * (train.quarter_turn @ rows)


def _turned(train: Train, matrix: Array, theta: Array) -> Array:
    """Symmetric matrices in the housing frame, (n, size, size), in the frames of the parts: columns, then rows."""
    rows = in_frames(train, _samples_last(matrix), theta)
    return np.moveaxis(in_frames(train, np.swapaxes(rows, 0, 1), theta), -1, 0)


def _centres(train: Train) -> Array:
    """Where the parts' centres are in the nominal motion, mm, in the frames of the parts, (size,)."""
    reducer, made = train.reducer, np.zeros(train.size)
    layout = Layout(reducer)
    for circle, places in ((reducer.eccentricity, layout.disc), (reducer.crank_radius, layout.crank)):
        for number, at in enumerate(places):
            angle = 2 * math.pi * number / len(places)  # at theta = 0, and so in its frame
            made[at : at + 2] = circle * math.cos(angle), circle * math.sin(angle)
    return made


def _nominal_rate(train: Train) -> Array:
    """Rate of the nominal motion per unit of speed, in the frames of the parts, (size,)."""
    rate, turns = train.turns * (train.quarter_turn @ _centres(train)), frame_orders(train.reducer)
    for name, at in train.parts.items():
        if len(at) != 2:  # a sun whose angle is held has none
            rate[at[-1]] = turns[{"input": "sun", "load": "carrier"}.get(name, name.split()[0])]
    return np.asarray(rate)


def _samples_last(matrix: Array) -> Array:
    return np.ascontiguousarray(np.moveaxis(matrix, 0, -1))


#: Times the highest frequency that the meshes drive: modes up to there keep their inertia, the machine's first always.
REACH = 2.5
_MOST_ANGLES = 2**16  # of one period: two gigabytes
_AT_ONCE = 16  # effects whose poses are held together


@dataclass(frozen=True)
class MovingReducer:
    """A reducer in motion about its loaded state.

    Attributes
    ----------
    unit : Reducer
    torque, direction : float
        N*mm; +1 or -1.
    period : int
        Output turns.
    where : Stand
    motion : ReducedMotion
    frequency : ndarray, shape (m,)
        Of the mean stiffness, as far as modes keep their inertia, Hz.
    of_sun_support : ndarray of bool, shape (m,)
    settled, halfway : Settled
        Loaded state at these angles and half a step further on.
    """

    unit: Reducer
    torque: float
    direction: float
    period: int
    where: Stand
    motion: ReducedMotion
    frequency: Array
    of_sun_support: Flags
    settled: Settled
    halfway: Settled

    @property
    def theta(self) -> Array:
        """Nominal output angle as it is read, rad, (n,)."""
        return self.where.read.theta

    def turn(self, speed: float) -> float:
        """Speed of the output, signed, at an input speed."""
        return self.direction * speed / self.unit.ratio

    def shares(self, effects: Sequence[Effect]) -> Iterator[ErrorAtSpeed]:
        """What one unit of each parameter of effects does, the closed contacts held closed; sizes play no part.

        Effects that no contact feels do nothing here.
        """
        whole = self.motion.whole
        for first in range(0, len(effects), _AT_ONCE):
            some = tuple(effects[first : first + _AT_ONCE])
            at, between = (one.pose_changes(some) for one in (self.settled, self.halfway))
            for number in range(at.shape[2]):
                state = in_frames(whole.train, whole.train.pose(at[..., number]).T, whole.theta)
                course = held_waves(whole.train, state, between[..., number], whole.theta, whole.period)
                yield self.motion.share(state, course)


def moving_reducer(
    model: Model,
    *,
    torque: Any | None,
    direction: float,
    fastest: float,
    kept: int | None = None,
    causes: Sequence[Effect] = (),
) -> MovingReducer:
    """A reducer in motion about its loaded state.

    Parameters
    ----------
    model : Model
    torque : float or quantity, optional
        N*mm; the rated torque where left out.
    direction : float
        +1 or -1.
    fastest : float
        Highest input speed, rad/s: tells how many modes keep their inertia.
    kept : int, optional
        So many do.
    causes : sequence of Effect
        Others that the motion repeats with.

    Returns
    -------
    MovingReducer

    Raises
    ------
    InputError
        If the model is no reducer, there is no torque, or errors of the sun repeat after too many turns.
    NotConvergedError
        If there is no equilibrium at some angle.
    """
    unit, size = loaded_reducer(model, torque)
    period = _period((*unread(model).effects, *causes), unit)
    count = samples_needed(unit) * period
    theta = 2 * math.pi * period * np.arange(count) / count
    load = units.InCore(size)
    where, between = (
        stand(model, pose(unit, angle, torque=load, direction=direction)) for angle in (theta, theta + theta[1] / 2)
    )
    train = Train(unit, model.bench)
    settled, halfway = (statics_of(unit, one.gears).settled(model.effects) for one in (where, between))
    whole = loaded_motion(train, settled, where.gears.theta, 2 * math.pi * period, halfway.x)
    frequency, on_support = whole.mean_modes()
    if kept is None:
        first = int(np.flatnonzero((frequency > 0) & ~on_support)[0])
        kept = max(int((frequency <= REACH * driven_frequency(unit, fastest)).sum()), first + 1)
    kept = max(kept, 1)
    return MovingReducer(
        unit, size, direction, period, where, whole.reduced(kept), frequency[:kept], on_support[:kept], settled, halfway
    )


def driven_frequency(unit: Reducer, speed: float) -> float:
    """Highest frequency that the meshes drive at an input speed, Hz."""
    return max(fundamental_orders(unit).values()) * speed / unit.ratio / (2 * math.pi)


def _period(effects: Sequence[Effect], unit: Reducer) -> int:
    """Output turns after which the error repeats: one where nothing has a broken order, as the sun's may be."""
    turning = [(source(one.key), one.indices) for one in effects]
    orders = [order for entry, indices in turning for order in entry.orders(unit, indices)]
    # several planets hide some orders of the sun in what is told of it, and not in every error
    whole = all(float(order).is_integer() for order in orders) and all(entry.frame != "sun" for entry, _ in turning)
    period = 1 if whole else true_period(unit)
    if period * samples_needed(unit) > _MOST_ANGLES:
        raise InputError(
            f"ratio = {unit.ratio:g}: the error repeats after {period} output turns only, too many for one balance; "
            "leave out the errors that turn with the sun"
        )
    return period
