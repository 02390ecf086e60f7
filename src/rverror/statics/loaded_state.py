"""Statics of the whole gear train under load: floating parts on elastic contacts, pins and gear flanks that can open.

The pose of least energy is found by `kernel`; here are the questions that users ask of it.

Kinematics about the nominal pose is of first order in errors and displacements.  What that leaves out grows with their
square, some 0.1 arcsec rms for a dozen errors of 5 um: it comes from pins near a lobe's root, where the profile is
sharply curved.  `ContactLaw.profile_curvature` lets pins follow it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from rverror.base.arrays import Array
from rverror.base.viewed import OneLine
from rverror.geartrain.action_line import BEARINGS, YIELDING, Clearance, Compliance, ContactForces, Contacts
from rverror.geartrain.contacts import motion, pose
from rverror.geartrain.kinematics import Conditions
from rverror.geartrain.mechanism import Mechanism, Reducer, check_same_geometry
from rverror.model.asked import Equilibrium
from rverror.model.effects import Effect, Model, check_model
from rverror.model.readings import added, felt, stand
from rverror.statics.energy import (
    GRADIENT_TOLERANCE,
    Errors,
    Geometry,
    by_contact,
    error_closing,
    flank_lever,
    loaded_problem,
    preloaded,
    refined,
    samples_last,
    solve,
)

if TYPE_CHECKING:
    from rverror.statics.kernel import Problem, Solution

_AT_ONCE = 4096  # angles solved together, and kept for the next solution: bounds the memory
_NO_LOAD = 1e-10  # torque that stands for none, of pin stiffness times pin circle radius squared


#: What else the output depends on, in the order of rows of `Prediction.softening`: the logarithm of the compliance (one
#: over the stiffness) of each kind of contact, backlash in mm, exponents of the contact law.
SOFTENING = (
    "pin_contact",
    "crank_bearing",
    "carrier_bearing",
    "gear_mesh",
    "sun_support",
    "main_bearing",
    "gear_backlash",
    "pin_exponent",
    "flank_exponent",
    "profile_curvature",
)


class NotConvergedError(RuntimeError):
    """The equilibrium was not found at some angles; the message names them."""


@dataclass(frozen=True)
class Linearisation(OneLine):
    """Influences about a loaded state.

    Attributes
    ----------
    state : Equilibrium
    motion : Contacts
        Nominal motion, for `compose.source_matrix`.
    forces : mapping of str to ndarray
        Change of each contact force per unit of output torque with the closed contacts held closed, in the shape of
        `compose.closed_form_forces`: for `influence` and `transmission_error`.
    """

    state: Equilibrium
    motion: Contacts
    forces: ContactForces


@dataclass(frozen=True)
class Tangent(OneLine):
    """Loaded state at n angles and how stiff each contact is there, the closed ones held closed.

    Attributes
    ----------
    contacts : Geometry
    x : ndarray, shape (n, unknowns)
        Pose, in the layout of `energy.Layout`.
    pin : ndarray, shape (n, discs, pins)
        N/mm; 0 where open.
    flank : ndarray, shape (n, 2 cranks)
    joint : ndarray, shape (n, joints, 2, 2)
        Cams (disc by crank), carrier bores, main bearing, sun support.
    pin_force : ndarray, shape (n, discs, pins)
        N.
    flank_force : ndarray, shape (n, 2 cranks)
    joint_force : ndarray, shape (n, joints, 2)
    joint_pressed : ndarray, shape (n, joints)
        What the rollers of each bearing press in all, N: more than its force where those on both sides carry.
    """

    contacts: Geometry
    x: Array
    pin: Array
    flank: Array
    joint: Array
    pin_force: Array
    flank_force: Array
    joint_force: Array
    joint_pressed: Array


def equilibrium(
    model: Model,
    theta: Any | None = None,
    *,
    torque: Any | None = None,
    direction: Any | None = None,
    time: Any | None = None,
) -> Equilibrium:
    """Solve the statics of a reducer at each angle.

    Parameters
    ----------
    model : Model
        Of a reducer; its stiffnesses and backlash count.
    theta : array_like, str or quantity, shape (n,) or one angle, or Conditions, optional
        Nominal output angle, rad; or the conditions of a run, in place of torque, direction and time.  `Model.angles`
        where left out.
    torque : float, str or quantity, optional
        Size of the output torque, N*mm; it resists the motion.  The reducer's rated torque where left out beside
        angles.  0 is the limit of a vanishing load, which still keeps the driving side closed; forces are then those
        of a trace of load.
    direction : float or array_like, optional
        +1 forward, -1 reverse; read from the angles where left out.
    time : array_like or quantity, shape (n,), optional
        Needed by ``sensor.time_offset``.

    Returns
    -------
    Equilibrium

    Raises
    ------
    ValueError
        If the model is no reducer, or the torque is below 0 or neither given nor rated.
    NotConvergedError
        If the energy minimum was not reached at some angle.

    Notes
    -----
    Source 001, K x = F + E, with unilateral contacts; its twenty degrees of freedom are three for each of one carrier,
    two discs and three cranks, and two for the sun.

    Examples
    --------
    >>> import rverror
    >>> state = equilibrium(rverror.Model(rverror.reducer("RV-40E")), [0.0, 0.1], torque="412 N*m")
    >>> bool((state.loaded_pins < 20).all())  # at most the half of the pins that drives
    True
    """
    statics, read = _statics_of(model, theta, torque=torque, direction=direction, time=time)
    return replace(statics.equilibrium(model.effects), model=model, conditions=read)


def linearise(
    model: Model,
    theta: Any | None = None,
    *,
    torque: Any | None = None,
    direction: Any | None = None,
    time: Any | None = None,
) -> Linearisation:
    """Influences of every contact on the output at a loaded state: the Jacobian with the closed contacts held closed.

    By virtual work the influence of a contact is its force per unit of output torque, so one solution with a unit
    torque gives all of them.

    Parameters
    ----------
    model, theta, torque, direction, time
        As in `equilibrium`.

    Returns
    -------
    Linearisation

    Raises
    ------
    ValueError, NotConvergedError
        As in `equilibrium`.

    Examples
    --------
    >>> import numpy as np, rverror
    >>> unit = rverror.reducer("RV-40E")
    >>> loaded = linearise(rverror.Model(unit), [0.0, 0.1], torque="412 N*m")
    >>> pin = rverror.influence(unit, [0.0, 0.1], "cycloid.pin_position", pin=3, forces=loaded.forces)
    >>> pin.matrix.shape
    (2, 2)
    """
    statics, read = _statics_of(model, theta, torque=torque, direction=direction, time=time)
    found = statics.linearise(model.effects)
    return replace(found, state=replace(found.state, model=model, conditions=read))


def _statics_of(model: Model, theta: Any, **conditions: Any) -> tuple[Statics, Conditions]:
    """Statics where the gear train stands when the bench reads theta, and the conditions as it reads them."""
    check_model(model)
    unit, angles = reducer_of(model.mechanism), model.angles if theta is None else theta
    if conditions["torque"] is None and not isinstance(angles, Conditions):
        conditions["torque"] = unit.rated_torque
    where = stand(model, pose(unit, angles, **conditions))
    assert isinstance(where.gears, Contacts)
    statics = replace(_along(where.gears), read_at=where.read.theta)
    return statics, Conditions(**{field.name: getattr(where.read, field.name) for field in fields(Conditions)})


def _joined(parts: list[Equilibrium]) -> Equilibrium:
    if len(parts) == 1:
        return parts[0]

    def join(name: str) -> Any:
        values = [getattr(part, name) for part in parts]
        if values[0] is None:  # told by who asked for it
            return None
        if isinstance(values[0], Mapping):
            return {key: np.concatenate([v[key] for v in values], axis=-1) for key in values[0]}
        return np.concatenate(values, axis=-1)

    return Equilibrium(**{field.name: join(field.name) for field in fields(Equilibrium)})


def statics_of(mechanism: Mechanism, conditions: Conditions) -> Statics:
    """Prepare what a reducer's statics need whatever the errors are, for many solutions along one motion.

    Parameters
    ----------
    mechanism : Reducer or Drive
    conditions : Conditions
        Of the gear train, with a torque.

    Returns
    -------
    Statics

    Raises
    ------
    ValueError
        If the mechanism is no reducer, or the torque is missing or below 0.
    """
    reducer_of(mechanism)
    where = motion(mechanism, conditions)
    assert isinstance(where, Contacts)
    return _along(where)


def _along(where: Contacts) -> Statics:
    """Statics along a motion under its torque."""
    if where.torque is None:
        raise ValueError("the equilibrium needs a torque; give torque='20 N*m', or the reducer its rated_torque")
    if not where.torque >= 0:
        raise ValueError(f"torque = {where.torque / 1e3:g} N*m: must be 0 or more; the direction comes from the motion")
    return Statics(Travel(where), where.reducer, where.torque)


def reducer_of(mechanism: Mechanism, what: str = "the equilibrium") -> Reducer:
    """The reducer that a question of the statics is about.

    Parameters
    ----------
    mechanism : Reducer or Drive
    what : str
        Asks, for the message.

    Returns
    -------
    Reducer

    Raises
    ------
    ValueError
        If it is a drive.
    """
    if not isinstance(mechanism, Reducer):
        raise ValueError(f"{what} needs a [reducer] model; a [drive] has no geometry")
    return mechanism


@dataclass(frozen=True)
class Travel:
    """Contact geometry along one motion, whatever errors and stiffnesses are: shared by all that is solved along it.

    Attributes
    ----------
    motion : Contacts
    """

    motion: Contacts

    @cached_property
    def output_turn(self) -> float:
        """Turn of the output per turn of the carrier."""
        return self.motion.reducer.output_turn

    @cached_property
    def _kept(self) -> tuple[Geometry, ...]:
        return tuple(self._made())

    def _made(self) -> Iterator[Geometry]:
        whole = self.motion
        if whole.theta.size <= _AT_ONCE:
            yield Geometry(whole)
            return
        for first in range(0, whole.theta.size, _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            where = motion(whole.reducer, Conditions(whole.theta[part], whole.direction[part], whole.torque))
            assert isinstance(where, Contacts)
            yield Geometry(where)

    def geometries(self) -> Iterable[Geometry]:
        """Geometry of one stretch of angles after another; that of few angles is kept."""
        return self._kept if self.motion.theta.size <= _AT_ONCE else self._made()


@dataclass(frozen=True)
class Statics:
    """Statics of a reducer along one motion, prepared once for many sets of errors.

    Attributes
    ----------
    travel : Travel
    reducer : Reducer
        Whose stiffness, backlash and contact law count.
    torque : float
        Size of the output torque, N*mm.
    read_at : ndarray, shape (n,), optional
        Angles of the bench where they are not the gear's, rad.
    """

    travel: Travel
    reducer: Reducer
    torque: float
    read_at: Array | None = None

    @property
    def motion(self) -> Contacts:
        """Nominal motion."""
        return self.travel.motion

    def elastic(self, reducer: Reducer) -> Statics:
        """The same motion of a reducer with other stiffness, backlash or contact law, and the same geometry.

        What the geometry gives, error vectors and closings among it, is made once for both.

        Parameters
        ----------
        reducer : Reducer

        Returns
        -------
        Statics

        Raises
        ------
        ValueError
            If anything but stiffness, backlash and contact law differs.
        """
        if reducer == self.reducer:
            return self
        check_same_geometry(self.reducer, reducer)
        return replace(self, reducer=reducer)

    def solutions(
        self,
        effects: tuple[Effect, ...],
        start: Array | None = None,
        *,
        forces: bool = False,
        matrix: bool = False,
        response: bool = False,
    ) -> Iterator[Settled]:
        """Settled poses of one stretch of angles after another.

        Parameters
        ----------
        effects : tuple of Effect
        start : ndarray, shape (n, unknowns), optional
            Poses at all angles that are likely near.
        forces, matrix, response : bool
            Whether these are wanted; the first two can be asked for later, at the cost of finding the contacts again.

        Yields
        ------
        Settled

        Raises
        ------
        NotConvergedError
            If the equilibrium was not found at some angle.
        """
        first, felt_effects, idle = 0, felt(effects), not self.torque
        response = response or idle
        slides = response or self.reducer.contact_law.profile_curvature > 0
        torque = abs(self.travel.output_turn) * self.torque or trace_of_load(self.reducer)
        for contacts in self.travel.geometries():
            errors = error_closing(contacts, felt_effects, slides=slides)
            errors = preloaded(errors, self.reducer)
            try:
                problem = loaded_problem(contacts, self.reducer, errors, torque, response=response)
            except ValueError as error:
                raise NotConvergedError(str(error)) from error
            last = first + len(problem.load)
            near = None if start is None else start[first:last]
            solution = solve(problem, near=near, forces=forces, matrix=matrix, response=response)
            check_found(solution, contacts.motion.theta, idle=idle)
            settled = Settled(contacts, self.reducer, torque, errors, problem, solution)
            yield settled.unloaded() if idle else settled
            first = last

    def predict(self, effects: tuple[Effect, ...], start: Array | None = None) -> Prediction:
        """Turn of the output and its changes with all parameters, from one solution."""
        parts = [
            (part.transmission_error, part.influences(effects), part.softening(), part.x.T)
            for part in self.solutions(effects, start, response=True)
        ]
        error, matrix, softening, poses = (np.concatenate(one, axis=-1) for one in zip(*parts, strict=True))
        return Prediction(error, matrix, softening, poses.T)

    def forces(self, effects: tuple[Effect, ...], start: Array | None = None) -> ContactForces:
        """Change of the contact forces per unit of output torque."""
        return _side_by_side([part.forces_per_torque() for part in self.solutions(effects, start, response=True)])

    def equilibrium(self, effects: tuple[Effect, ...]) -> Equilibrium:
        """`equilibrium` for these errors."""
        return self._read([part.equilibrium() for part in self.solutions(effects, forces=True)], effects)

    def tangents(self, effects: tuple[Effect, ...]) -> Iterator[Tangent]:
        """Loaded state and stiffness of every contact, one stretch of angles after another."""
        return (part.tangent() for part in self.solutions(effects, forces=True))

    def linearise(self, effects: tuple[Effect, ...]) -> Linearisation:
        """`linearise` for these errors."""
        parts = list(self.solutions(effects, forces=True, response=True))
        state = self._read([part.equilibrium() for part in parts], effects)
        return Linearisation(state, self.motion, _side_by_side([part.forces_per_torque() for part in parts]))

    def _read(self, parts: list[Equilibrium], effects: tuple[Effect, ...]) -> Equilibrium:
        """States of all stretches as one, as they are read."""
        state = _joined(parts)
        read = self.motion if self.read_at is None else self.motion.at(self.read_at)
        turned = state.transmission_error + added(effects, read)
        return replace(state, transmission_error=turned, theta=read.theta)


@dataclass(frozen=True)
class Prediction(OneLine):
    """Output error at n angles, and its change with all that it depends on.

    Attributes
    ----------
    transmission_error : ndarray, shape (n,)
        rad.
    matrix : ndarray, shape (parameters, n)
        Change per parameter of each effect.
    softening : ndarray, shape (10, n), optional
        Change per unit of each of `SOFTENING`: of the logarithm of each compliance, of the backlash, mm, and of what
        the contact law holds.  None where the closed form predicts, which knows none of them.
    poses : ndarray, shape (n, unknowns), optional
        Where the equilibrium predicts.
    """

    transmission_error: Array
    matrix: Array
    softening: Array | None = None
    poses: Array | None = None


def _side_by_side(forces: list[ContactForces]) -> ContactForces:
    return {key: np.concatenate([one[key] for one in forces], axis=-1) for key in forces[0]}


def trace_of_load(reducer: Reducer) -> float:
    """Torque on the carrier that stands for none, N*mm."""
    return _NO_LOAD * reducer.stiffness.pin_contact * reducer.pin_circle_radius**2


def check_found(solution: Solution, theta: Array, *, idle: bool) -> None:
    """Refuse angles at which no equilibrium was found."""
    lost = ~solution.found
    if lost.any():
        where = ", ".join(f"{math.degrees(a):.4g}" for a in theta[lost][:5])
        loaded = "" if idle else ", or take a greater load"
        raise NotConvergedError(
            f"no equilibrium after {solution.steps[lost].min()} steps at {lost.sum()} of {lost.size} angles (theta = "
            f"{where} deg ...); check for errors and clearances far above 0.1 mm{loaded}"
        )


@dataclass(frozen=True)
class Settled:
    """Settled pose of one stretch of angles, its contacts, and what it was found with.

    Attributes
    ----------
    contacts : Geometry
    reducer : Reducer
    torque : float
        Size of the load on the carrier, N*mm.
    errors : Errors
    problem : kernel.Problem
    solution : kernel.Solution
        What was found.
    unloading : ndarray, shape (n, unknowns), or 0
        What taking the load off adds to the pose.
    """

    contacts: Geometry
    reducer: Reducer
    torque: float
    errors: Errors
    problem: Problem
    solution: Solution
    unloading: Array | float = 0.0

    @property
    def x(self) -> Array:
        """Pose under the load, (n, unknowns)."""
        return self.solution.x

    @cached_property
    def forces(self) -> Solution:
        """The same with what the contacts carry, how stiff they are, and what is out of balance."""
        return self.solution if len(self.solution.energy) else solve(self.problem, given=self.x, forces=True)

    @cached_property
    def matrix(self) -> Array:
        """Second derivative of the energy, (n, unknowns, unknowns)."""
        return (self.solution if len(self.solution.matrix) else solve(self.problem, given=self.x, matrix=True)).matrix

    def at(self, x: Array) -> Settled:
        """The same in other poses, whether or not forces balance there."""
        return replace(self, solution=solve(self.problem, given=x, matrix=True), unloading=0.0)

    def unloaded(self) -> Settled:
        """Take the load off with the closed contacts held closed; forces and contacts stay those of the load."""
        return replace(
            self, unloading=self.problem.load[:, 2:3] / self.contacts.output_turn * self.solution.pose_change
        )

    @property
    def transmission_error(self) -> Array:
        """Turn of the output."""
        return np.asarray(self.contacts.output_turn * (self.x + self.unloading)[:, 2], dtype=np.float64)

    def equilibrium(self) -> Equilibrium:
        """What users see of it."""
        reducer, n = self.reducer, len(self.x)
        parts = samples_last(self.x + self.unloading)
        bodies = parts[3:-2].reshape(-1, 3, n)
        normal = self.contacts.motion.pin_normal
        if self.problem.share:
            normal = normal - samples_last(self._turn)[:, :, None] * self.contacts.profile_tangent
        return Equilibrium(
            transmission_error=self.transmission_error,
            pose={
                "carrier": parts[:3],
                "disc": bodies[: reducer.discs],
                "crank": bodies[reducer.discs :],
                "sun": parts[-2:],
            },
            contact_forces={
                **self._vectors(self.solution.row_force),
                "pin": np.ascontiguousarray(samples_last(self.forces.pin_force))[:, :, None] * normal,
            },
            loaded_pins=(self.solution.pins > 0).sum(axis=2).T,
            steps=self.solution.steps,
            residual=GRADIENT_TOLERANCE * np.abs(self.forces.gradient).max(axis=1) / self.problem.tolerance,
            theta=self.contacts.motion.theta,
        )

    @property
    def _turn(self) -> Array:
        """How far the normal of each pin has turned, (n, discs, pins)."""
        return np.asarray(self.problem.share * self.contacts.curvature * self.solution.slides)

    def _split(self, rows: Array) -> tuple[Array, Array]:
        """Rows of flanks, (n, 2 cranks), and of bearings, (n, bearings, 2)."""
        flanks = 2 * self.reducer.cranks
        return rows[:, :flanks], rows[:, flanks:].reshape(len(rows), -1, 2)

    def tangent(self) -> Tangent:
        """Stiffness of every contact."""
        forces, stiffness = self.forces, self.problem.bearing_stiffness
        (flank, own), (flank_force, force) = self._split(forces.row_tangent), self._split(self.solution.row_force)
        behind = np.maximum(
            -self.errors.clearance - np.sqrt((self._split(self.solution.rows)[1] ** 2).sum(axis=-1)), 0.0
        )
        return Tangent(
            contacts=self.contacts,
            x=self.x + self.unloading,
            pin=forces.pin_tangent,
            flank=flank,
            joint=own[..., None] * np.eye(2) + forces.coupling[..., None, None] * (1 - np.eye(2)),
            pin_force=forces.pin_force,
            flank_force=flank_force,
            joint_force=force,
            joint_pressed=np.sqrt((force**2).sum(axis=-1)) + 2 * stiffness * behind,
        )

    def _vectors(self, rows: Array) -> dict[str, Array]:
        """Vectors of the driving on the driven part, samples last, from sizes on flanks and vectors of bearings."""
        reducer, n = self.reducer, len(rows)
        flanks, joints = self._split(rows)
        flank = samples_last(flanks.reshape(n, reducer.cranks, 2))
        return {
            **self._bearings(joints),
            "mesh": flank[..., None, :] * self.contacts.motion.mesh_normal,
            "spline": -(flank * flank_lever(reducer)[:, None])[..., None, :],
        }

    def _bearings(self, joints: Array) -> dict[str, Array]:
        """Vectors of cams and carrier bores, samples last, from those of all bearings, samples first."""
        reducer, vectors = self.reducer, samples_last(joints)
        cams = reducer.discs * reducer.cranks
        return {
            "cam": vectors[:cams].reshape(reducer.discs, reducer.cranks, 2, -1),
            "carrier": vectors[cams:-2],
        }

    def _directions(self) -> Array:
        """Unit vectors along which bearings carry, (n, bearings, 2); 0 where rollers behind do, too."""
        joints = self._split(self.solution.rows)[1]
        far = np.sqrt((joints**2).sum(axis=-1))
        return np.asarray(
            joints * ((far > 0) & (far >= -self.errors.clearance))[..., None] / np.where(far, far, 1)[..., None]
        )

    def _pressed_in(self) -> tuple[Array, Array]:
        """Forces on pins, and on rows, that would press linear contacts in as far as they are."""
        flanks, rows = self.problem.flank_stiffness.shape[1], self.solution.row_force.copy()
        rows[:, :flanks] = self.problem.flank_stiffness * np.maximum(self.solution.rows[:, :flanks], 0.0)
        return self.problem.pin_stiffness * np.maximum(self.solution.pins, 0.0), rows

    def pose_changes(self, effects: tuple[Effect, ...]) -> Array:
        """Change of the pose per parameter (n, unknowns, parameters), the closed contacts held closed.

        What an effect closes presses on every part; effects that no contact feels change nothing.
        """
        pressed = [np.zeros((*self.x.shape, 0))]
        for effect in effects:
            for unit in np.eye(len(effect.values)):
                one = felt((replace(effect, values=tuple(unit)),))
                pressed.append(self._pressing(error_closing(self.contacts, one))[..., None])
        return refined(self.matrix, -np.concatenate(pressed, axis=2))

    def _pressing(self, errors: Errors) -> Array:
        """Force of errors on the pose, (n, unknowns), the closed contacts held closed."""
        contacts, forces, turn = self.contacts, self.forces, self._turn
        pins, rows = errors.pin - turn * errors.along, errors.row.copy()
        # what gives way opens by as much
        pressed_pins, pressed = self._pressed_in()
        pins -= errors.compliance.get("pin", 0.0) * pressed_pins
        of_rows = by_contact(self.reducer, pin=pins, along=pins, row=rows)
        carried = by_contact(self.reducer, pin=pins, along=pins, row=pressed)
        for contact, more in errors.compliance.items():
            if contact != "pin":
                shape = of_rows[contact].shape
                more = more.reshape(shape) if contact == "mesh" else more.reshape(shape[:-1])[..., None]
                of_rows[contact] -= more * carried[contact]
        flanks, joints = self._split(rows)
        joints = joints - errors.clearance[:, None] * self._directions()
        tangent = self.tangent()
        force = np.einsum("nqd,nq->nd", contacts.flank_rows, tangent.flank * flanks)
        force += np.einsum("nqcd,nqc->nd", contacts.joint_rows, (tangent.joint @ joints[..., None])[..., 0])
        into = forces.pin_tangent * pins
        sideways = -turn * into
        if self.problem.share:
            sideways = sideways - self.problem.share * contacts.curvature * forces.pin_force * errors.along
        profile = np.stack([-contacts.pin_rows[:, :, 1], contacts.pin_rows[:, :, 0], contacts.profile_lever], axis=2)
        on_discs = np.einsum("nki,nkci->nkc", into, contacts.pin_rows)
        on_discs += np.einsum("nki,nkci->nkc", sideways, profile)
        force[:, 3 : 3 + on_discs[0].size] += on_discs.reshape(len(force), -1)
        return np.asarray(force)

    def softening(self) -> Array:
        """Change of the output angle per unit of each of `SOFTENING`, (10, n)."""
        return np.ascontiguousarray(self.solution.softening.T)

    def forces_per_torque(self) -> ContactForces:
        """Change of the contact forces per unit of output torque with the closed contacts held closed."""
        solution, normal = self.solution, self.contacts.motion.pin_normal
        pins = samples_last(solution.pin_change)[:, :, None] * normal
        if self.problem.share:  # a pin's force turns with its normal
            pins = pins + samples_last(solution.slide_change)[:, :, None] * self.contacts.profile_tangent
        pressed_pins, pressed = self._pressed_in()
        carried = {**self._vectors(pressed), "pin": samples_last(pressed_pins)[:, :, None] * normal}
        return {
            **self._vectors(solution.row_change),
            "pin": pins,
            **{f"{key} direction": along for key, along in self._bearings(self._directions()).items()},
            **{f"{key} carried": carried[key] for key in YIELDING},
            "output": np.ones((1, len(self.x))),
        }

    def influences(self, effects: tuple[Effect, ...]) -> Array:
        """Change of the output angle per parameter (parameters, n): what an effect closes times the forces there."""
        solution, rows = self.solution, [np.zeros((0, len(self.x)))]
        changes = by_contact(
            self.reducer, pin=solution.pin_change, along=solution.slide_change, row=solution.row_change
        )
        for effect in effects:
            closings = self.contacts.closings(effect)
            if isinstance(closings, (Clearance, Compliance)):
                rows.append(self.yielding(closings))
                continue
            parts = [one.work(changes[one.contact]) for one in closings]
            if self.problem.share:
                parts += [one.work(changes[one.contact]) for one in self.contacts.slides(effect)]
            rows.append(parts[0] if len(parts) == 1 else np.sum(parts, axis=0))
        return np.concatenate(rows)

    def yielding(self, part: Clearance | Compliance) -> Array:
        """`influences` of what lets a contact give way along its own force, and so against the motion."""
        solution = self.solution
        if isinstance(part, Clearance):
            bearings = self._bearings(self._split(solution.row_change)[1] * self._directions())[part.contact]
            return np.asarray(-bearings.reshape(1, -1, len(self.x)).sum(axis=1))
        pins, rows = self._pressed_in()
        work = by_contact(self.reducer, pin=solution.pin_change * pins, along=pins, row=solution.row_change * rows)
        here = samples_last(work[part.contact])
        here = (here.sum(axis=-2) if part.contact in BEARINGS else here)[part.at]
        return np.asarray(-np.sum(part.share * here, axis=tuple(range(1, here.ndim))))
