"""A reducer's parts in motion about their loaded state, over one period of the gear train.

Everything is written in the frames of the parts; what moves far faster than it is driven follows as a spring.
`docs/theory/dynamics.md` derives both.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.dynamics.harmonic_balance import Oscillator, slope
from rverror.dynamics.time_integration import Forced
from rverror.dynamics.train import FREE, SUPPORTED, Train
from rverror.geartrain.contacts import pose
from rverror.geartrain.kinematics import frame_orders, samples_needed, true_period
from rverror.geartrain.mechanism import Reducer
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.model.readings import added, stand, unread
from rverror.statics.energy import Layout
from rverror.statics.loaded_state import Tangent, statics_of

_MOST_ANGLES = 2**16  # of one period: two gigabytes


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
    """

    train: Train
    theta: Array
    period: float
    state: Array
    course: Array
    stiffness: Array

    @cached_property
    def _mean(self) -> tuple[Array, Array]:
        """Squares of the frequencies of the mean stiffness, and its modes, of mass 1, as columns."""
        root = np.sqrt(self.train.mass)
        value, vector = np.linalg.eigh(self.stiffness.mean(axis=0) / np.outer(root, root))
        return np.where(value < FREE * value[-1], 0.0, value), vector / root[:, None]

    def mean_modes(self) -> tuple[Array, npt.NDArray[np.bool_]]:
        """Frequencies of the mean stiffness, Hz, and which are of the sun's support."""
        value, shape = self._mean
        at = list(self.train.place("sun")[:2])  # the support is the same in any frame
        held = self.train.reducer.stiffness.sun_support * (shape[at] ** 2).sum(axis=0)
        return np.sqrt(value) / (2 * math.pi), (value > 0) & (held > SUPPORTED * value)

    @cached_property
    def inertia_force(self) -> Array:
        """Force of the parts' inertia against nominal motion and equilibrium per speed squared, (size, n)."""
        turns, step = self.train.turns[:, None], 2 * math.pi / self.period
        first, second = (slope(self.course, step, power) for power in (1, 2))
        acceleration = second + 2 * turns * _ahead(self.train, first) - turns**2 * self.course
        return np.asarray(-self.train.mass[:, None] * (acceleration + _centripetal(self.train)[:, None]))

    @cached_property
    def swing_force(self) -> Array:
        """Force of the parts' inertia per rad/s^2 of the output as the nominal motion is sped up, (size, n)."""
        turns = self.train.turns[:, None]
        swing = slope(self.course, 2 * math.pi / self.period) + turns * _ahead(self.train, self.course)
        return np.asarray(-self.train.mass[:, None] * (swing + _nominal_rate(self.train)[:, None]))

    @cached_property
    def load_force(self) -> Array:
        """Force of a load's torque against the angles, per unit, (size, n)."""
        made = np.zeros_like(self.state)
        made[list(self.train.place("load") or self.train.place("carrier")[2:])] = -1.0
        return made

    def reduced(self, kept: int) -> ReducedMotion:
        """With the motions alone in which the lowest modes of the mean stiffness have their inertia."""
        value, vector = self._mean
        kept = min(kept, self.train.size)
        basis = vector[:, :kept]
        if kept == self.train.size:
            shapes = np.broadcast_to(basis, (self.theta.size, *basis.shape))
            none = np.zeros_like(self.state)
            return ReducedMotion(self, basis, shapes, basis.T @ self.stiffness @ basis, none, none, none)
        # a free motion has no flexibility: it is held meanwhile
        inertia, hold = self.train.mass[:, None] * basis, value[kept]
        forces = np.stack([self.inertia_force.T, self.swing_force.T, self.load_force.T], axis=2)
        right = np.concatenate([np.broadcast_to(inertia, (self.theta.size, *inertia.shape)), forces], axis=2)
        yielded = np.linalg.solve(self.stiffness + hold * inertia @ inertia.T, right)
        flexible, rest = yielded[..., :kept], yielded[..., kept:]
        stiff = np.linalg.inv(inertia.T @ flexible)
        shapes = flexible @ stiff
        rest = rest - shapes @ (inertia.T @ rest)
        return ReducedMotion(self, basis, shapes, stiff - hold * np.eye(kept), *np.moveaxis(rest, 2, 0).swapaxes(1, 2))


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
    rest : ndarray, shape (size, n)
        Pose per speed squared that the other modes take as springs under the inertia of the equilibrium's motion.
    rest_by_acceleration, rest_by_load : ndarray, shape (size, n)
        The same per rad/s^2 of the output, and per unit of load.
    """

    whole: LoadedMotion
    basis: Array
    shapes: Array
    stiffness: Array
    rest: Array
    rest_by_acceleration: Array
    rest_by_load: Array

    @cached_property
    def oscillator(self) -> Oscillator:
        """Its equations."""
        train = self.whole.train
        value, vector = np.linalg.eigh(self.stiffness)
        frequency = np.sqrt(np.maximum(value, 0.0))
        ratio = train.bench.damping_ratio
        damping = 2 * ratio * (vector * frequency[:, None]) @ np.swapaxes(vector, 1, 2)
        weighted = train.mass[:, None] * self.basis
        turns = train.turns[:, None]
        return Oscillator(
            stiffness=_samples_last(self.stiffness),
            damping=_samples_last(damping),
            turning=2 * weighted.T @ _ahead(train, turns * self.basis),
            centrifugal=-weighted.T @ (turns**2 * self.basis),
            period=self.whole.period,
        )

    @cached_property
    def _force(self) -> Array:
        """Force of inertia on the coordinates per speed squared, (m, n)."""
        return self._on_coordinates(self.whole.inertia_force)

    def _on_coordinates(self, force: Array) -> Array:
        return np.asarray(np.einsum("nci,cn->in", self.shapes, force))

    @cached_property
    def forced(self) -> Forced:
        """Its equations with what drives them at any course of the speed."""
        by_acceleration, by_load = map(self._on_coordinates, (self.whole.swing_force, self.whole.load_force))
        return Forced(self.oscillator, self._force, by_acceleration, by_load)

    def response(self, speed: float, near: Array | None = None) -> Array:
        """Motion about the loaded state in these coordinates, (m, n).

        Parameters
        ----------
        speed : float
            Of the output, rad/s, of either sign.
        near : ndarray, shape (m, n), optional
            A motion that is likely near.
        """
        return self.oscillator.response(speed**2 * self._force, speed=speed, near=near)

    def error(self, moved: Array, speed: float) -> Array:
        """Output error of the loaded state and a motion about it at a speed, (n,)."""
        train = self.whole.train
        still = train.reading @ (self.whole.state + speed**2 * self.rest)
        return np.asarray(still + (self.reading * moved).sum(axis=0))

    def pose(self, moved: Array, speed: float, at: slice) -> Array:
        """Motion of the parts about the loaded state in the housing frame, (size, n), at some of the angles."""
        whole = self.whole
        own = np.einsum("nci,in->cn", self.shapes[at], moved[:, at]) + speed**2 * self.rest[:, at]
        return _in_frames(whole.train, own, -whole.theta[at])

    @cached_property
    def reading(self) -> Array:
        """How the output error follows the coordinates, (m, n)."""
        return np.asarray(np.einsum("c,nci->in", self.whole.train.reading, self.shapes))


def loaded_motion(
    train: Train, tangents: list[Tangent], theta: Array, period: float, between: Array | None = None
) -> LoadedMotion:
    """Loaded state and stiffness in the frames of the parts.

    Parameters
    ----------
    train : Train
    tangents : list of Tangent
        Of all angles, stretch by stretch.
    theta : ndarray, shape (n,)
        Those angles, evenly over one period.
    period : float
        rad.
    between : ndarray, shape (n, unknowns), optional
        Poses half a step further on, so that waves above half the samples do not fold.

    Returns
    -------
    LoadedMotion
    """
    state = _in_frames(train, train.pose(np.concatenate([one.x for one in tangents])).T, theta)
    stops = np.cumsum([0, *(len(one.x) for one in tangents)])
    parts = zip(tangents, np.split(theta, stops[1:-1]), strict=True)
    stiffness = np.concatenate([_turned(train, _summed(train.stiffness(one)), angle) for one, angle in parts])
    if between is None:
        return LoadedMotion(train, theta, period, state, state, stiffness)
    count = theta.size
    fine = np.empty((train.size, 2 * count))
    fine[:, ::2] = state
    fine[:, 1::2] = _in_frames(train, train.pose(between).T, theta + period / (2 * count))
    waves = np.fft.rfft(fine)[:, : count // 2 + 1] / 2
    waves[:, -1] = 0
    return LoadedMotion(train, theta, period, state, np.fft.irfft(waves, count), stiffness)


def motion_over_a_period(
    model: Model, unit: Reducer, *, torque: float, direction: float
) -> tuple[LoadedMotion, list[Tangent], Array]:
    """A reducer in motion over the turns after which its errors repeat.

    Parameters
    ----------
    model : Model
        Of the reducer.
    unit : Reducer
    torque : float
        N*mm.
    direction : float

    Returns
    -------
    LoadedMotion
    list of Tangent
        Its contacts, stretch by stretch.
    ndarray, shape (n,)
        What the output turns beyond the gear train, rad.

    Raises
    ------
    InputError
        If errors of the sun repeat after too many turns.
    NotConvergedError
        If there is no equilibrium at some angle.
    """
    period = _turns_until_it_repeats(model, unit)
    count = samples_needed(unit) * period
    theta = 2 * math.pi * period * np.arange(count) / count
    where, halfway = (
        stand(model, pose(unit, angle, torque=torque, direction=direction)) for angle in (theta, theta + theta[1] / 2)
    )
    tangents = list(statics_of(unit, where.gears).tangents(model.effects))
    between = np.concatenate([one.x for one in statics_of(unit, halfway.gears).tangents(model.effects)])
    whole = loaded_motion(Train(unit, model.bench), tangents, where.gears.theta, 2 * math.pi * period, between)
    return whole, tangents, np.asarray(added(unread(model).effects, where.read))


def _turns_until_it_repeats(model: Model, unit: Reducer) -> int:
    """Output turns after which the error repeats: one where nothing has a broken order, as the sun's may be."""
    turning = [(source(one.key), one.indices) for one in unread(model).effects]
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


def _summed(groups: Mapping[str, Array]) -> Array:
    """Stiffness of all contacts and springs."""
    total = np.zeros_like(groups["pin_contact"])
    for matrix in groups.values():
        total += matrix
    return total


def _in_frames(train: Train, rows: Array, theta: Array) -> Array:
    """Rows of coordinates in the housing frame, (size, n), in those of the parts."""
    angle = train.turns[:, None] * theta
    return np.cos(angle) * rows - np.sin(angle) * _ahead(train, rows)


def _turned(train: Train, matrix: Array, theta: Array) -> Array:
    """Matrices in the housing frame, (n, size, size), in the frames of the parts."""
    angle = train.turns * theta[:, None]
    cos, sin = np.cos(angle), np.sin(angle)

    def rows(matrix: Array) -> Array:
        ahead = np.moveaxis(_ahead(train, np.moveaxis(matrix, 1, 0)), 0, 1)
        return cos[..., None] * matrix - sin[..., None] * ahead

    return rows(np.swapaxes(rows(matrix), 1, 2))


def _ahead(train: Train, rows: Array) -> Array:
    """Rows of coordinates, each pair of x and y turned a quarter ahead: (-y, x); 0 for angles."""
    made = np.zeros_like(rows)
    for part in train.parts:
        if part.mass:
            x, y = part.at[:2]
            made[x], made[y] = -rows[y], rows[x]
    return made


def _centres(train: Train) -> Array:
    """Where the parts' centres are in the nominal motion, mm, in the frames of the parts, (size,)."""
    reducer, made = train.reducer, np.zeros(train.size)
    layout = Layout(reducer)
    for circle, places in ((reducer.eccentricity, layout.disc), (reducer.crank_radius, layout.crank)):
        for number, at in enumerate(places):
            angle = 2 * math.pi * number / len(places)  # at theta = 0, and so in its frame
            made[at : at + 2] = circle * math.cos(angle), circle * math.sin(angle)
    return made


def _centripetal(train: Train) -> Array:
    """Acceleration of the nominal motion per speed squared, in the frames of the parts, (size,)."""
    return np.asarray(-(train.turns**2) * _centres(train))


def _nominal_rate(train: Train) -> Array:
    """Rate of the nominal motion per unit of speed, in the frames of the parts, (size,)."""
    rate, turns = train.turns * _ahead(train, _centres(train)), frame_orders(train.reducer)
    for part in train.parts:
        if part.inertia:
            kind = {"input": "sun", "load": "carrier"}.get(part.name, part.name.split()[0])
            if len(part.at) != 2:  # a sun whose angle is held has none
                rate[part.at[-1]] = turns[kind]
    return np.asarray(rate)


def _samples_last(matrix: Array) -> Array:
    return np.ascontiguousarray(np.moveaxis(matrix, 0, -1))
