"""Statics of the whole gear train under load: floating parts on elastic contacts, pins and gear flanks that can open.

The pose of least energy is found in `energy`; here are the questions that users ask of it.

Kinematics about the nominal pose is of first order in errors and displacements.  What that leaves out grows with their
square, some 0.1 arcsec rms for a dozen errors of 5 um: it comes from pins near a lobe's root, where the profile is
sharply curved.  `ContactLaw.profile_curvature` lets pins follow it: `turned_pins`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rverror.base import units
from rverror.base.arrays import Array, unit_vectors
from rverror.base.viewed import OneLine
from rverror.geartrain.action_line import YIELDING, Clearance, Compliance, ContactForces, Contacts, project
from rverror.geartrain.contacts import motion, pose
from rverror.geartrain.kinematics import Conditions
from rverror.geartrain.mechanism import Mechanism, Reducer, check_same_geometry
from rverror.model.asked import Equilibrium
from rverror.model.effects import Effect, Model, check_model
from rverror.model.readings import added, felt, stand
from rverror.statics.condensation import Condensed, Stretch
from rverror.statics.energy import (
    GRADIENT_TOLERANCE,
    Closed,
    Errors,
    Geometry,
    State,
    Steps,
    System,
    error_closing,
    flank_lever,
    geometry,
    held,
    loaded_system,
    minimise,
    preloaded,
    refined,
    samples_first,
    samples_last,
    with_discs,
)
from rverror.statics.turned_pins import moved, turned

_AT_ONCE = 1024  # angles solved together: bounds the memory
_MOST_TURNS = 4  # of pins' normals: each leaves less than a tenth of what the last one left
_MOST_KEPT = 4096  # angles whose contact geometry is kept for the next solution
_NO_LOAD = 1e-10  # torque that stands for none, of pin stiffness times pin circle radius squared


#: What else the output depends on, in the order of rows of `Solved.softening`: the logarithm of the compliance (one
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
    statics = replace(statics_of(model.mechanism, where.gears), read_at=where.read.theta)
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
    if conditions.torque is None:
        raise ValueError("the equilibrium needs a torque; give torque='20 N*m', or the reducer its rated_torque")
    size = units.to_core(conditions.torque, "torque")
    if not size >= 0:
        raise ValueError(f"torque = {size / 1e3:g} N*m: must be 0 or more; the direction comes from the motion")
    where = motion(mechanism, conditions)
    assert isinstance(where, Contacts)
    return Statics(Travel(where), where.reducer, size)


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
    def _kept(self) -> tuple[Geometry, ...]:
        return tuple(self._made())

    def _made(self) -> Iterator[Geometry]:
        whole = self.motion
        for first in range(0, whole.theta.size, _AT_ONCE):
            part = slice(first, first + _AT_ONCE)
            where = motion(whole.reducer, Conditions(whole.theta[part], whole.direction[part], whole.torque))
            assert isinstance(where, Contacts)
            yield geometry(where)

    @property
    def short(self) -> bool:
        """Whether what belongs to its angles is few enough to be kept."""
        return self.motion.theta.size <= _MOST_KEPT

    def geometries(self) -> Iterable[Geometry]:
        """Geometry of one stretch of angles after another; that of few angles is kept."""
        return self._kept if self.short else self._made()


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

    @cached_property
    def _kept(self) -> tuple[Stretch, ...]:
        return tuple(self._made())

    def _made(self) -> Iterator[Stretch]:
        on_carrier = abs(self.reducer.output_turn) * self.torque
        return (Stretch(where, self.reducer, on_carrier or _trace(self.reducer)) for where in self.travel.geometries())

    def stretches(self) -> Iterable[Stretch]:
        """One stretch of angles after another; few are kept with what they condense to for the next errors."""
        return self._kept if self.travel.short else self._made()

    def solutions(
        self, effects: tuple[Effect, ...], start: Array | None = None, *, quick: bool = False
    ) -> Iterator[Settled]:
        """Settled poses of one stretch after another; `start` holds poses of the same angles that are likely near.

        Quickly, what is condensed is trusted wherever the loaded flanks, and no others, carry.
        """
        first = 0
        for stretch in self.stretches():
            last = first + stretch.contacts.motion.theta.size
            near = None if start is None else start[first:last]
            solution = _settle(stretch, felt(effects), near, quick=quick)
            yield solution if self.torque else solution.unloaded()
            first = last

    def predict(self, effects: tuple[Effect, ...], start: Array | None = None) -> Solved:
        """Turn of the output and its changes with all parameters, from one solution."""
        parts = [
            Solved(part.transmission_error, part.influences(effects), part.softening(), part.x)
            for part in self.solutions(effects, start, quick=True)
        ]
        return parts[0] if len(parts) == 1 else Solved.joined(parts)

    def forces(self, effects: tuple[Effect, ...], start: Array | None = None) -> ContactForces:
        """Change of the contact forces per unit of output torque, to some 1e-10 of the largest influence."""
        return _side_by_side(
            [part.forces_per_torque(quick=True) for part in self.solutions(effects, start, quick=True)]
        )

    def equilibrium(self, effects: tuple[Effect, ...]) -> Equilibrium:
        """`equilibrium` for these errors."""
        return self._read([part.equilibrium() for part in self.solutions(effects)], effects)

    def tangents(self, effects: tuple[Effect, ...]) -> Iterator[Tangent]:
        """Loaded state and stiffness of every contact, one stretch of angles after another."""
        return (part.tangent() for part in self.solutions(effects))

    def linearise(self, effects: tuple[Effect, ...]) -> Linearisation:
        """`linearise` for these errors."""
        solved, forces = [], []
        for part in self.solutions(effects):
            solved.append(part.equilibrium())
            forces.append(part.forces_per_torque())
        return Linearisation(self._read(solved, effects), self.motion, _side_by_side(forces))

    def _read(self, parts: list[Equilibrium], effects: tuple[Effect, ...]) -> Equilibrium:
        """States of all stretches as one, as they are read."""
        state = _joined(parts)
        read = self.motion if self.read_at is None else self.motion.at(self.read_at)
        turned = state.transmission_error + added(effects, read)
        return replace(state, transmission_error=turned, theta=read.theta)


@dataclass(frozen=True)
class Solved(OneLine):
    """Turn of the output at n angles, and its change with all that it depends on.

    Attributes
    ----------
    transmission_error : ndarray, shape (n,)
        rad.
    matrix : ndarray, shape (parameters, n)
        Change per parameter of each effect.
    softening : ndarray, shape (10, n)
        Change per unit of each of `SOFTENING`.
    poses : ndarray, shape (n, unknowns)
    """

    transmission_error: Array
    matrix: Array
    softening: Array
    poses: Array

    @classmethod
    def joined(cls, parts: list[Solved]) -> Solved:
        """Of all stretches."""
        return cls(
            np.concatenate([part.transmission_error for part in parts]),
            np.concatenate([part.matrix for part in parts], axis=1),
            np.concatenate([part.softening for part in parts], axis=1),
            np.concatenate([part.poses for part in parts]),
        )


def _side_by_side(forces: list[ContactForces]) -> ContactForces:
    return {key: np.concatenate([one[key] for one in forces], axis=-1) for key in forces[0]}


def _trace(reducer: Reducer) -> float:
    """Torque on the carrier that stands for none, N*mm."""
    return _NO_LOAD * reducer.stiffness.pin_contact * reducer.pin_circle_radius**2


def _settle(stretch: Stretch, effects: tuple[Effect, ...], start: Array | None, *, quick: bool) -> Settled:
    errors = preloaded(error_closing(stretch.contacts, effects), stretch.reducer)
    try:
        stretch = stretch.softer(errors.compliance)
        stretch.elasticity  # noqa: B018 - refuses what is stiffer than rigid
    except ValueError as error:
        raise NotConvergedError(str(error)) from error
    contacts, nominal = stretch.contacts, loaded_system(stretch, errors, stretch.torque)
    share = stretch.reducer.contact_law.profile_curvature
    condensed = None if nominal.clearance.size else stretch.condensed
    if not share:
        return Settled(stretch, errors, nominal, condensed, *_least(stretch, nominal, condensed, start, quick=quick))
    steps = np.zeros(contacts.motion.theta.size, dtype=np.intp)
    pins = turned(contacts, nominal, errors, np.zeros_like(nominal.load) if start is None else start, share)
    for _ in range(_MOST_TURNS):
        held = None if condensed is None else condensed.with_pins(pins.system.pin_rows)
        x, closed, more = _least(stretch, pins.system, held, start, quick=quick)
        start, steps = x, steps + more
        last, pins = pins, turned(contacts, nominal, errors, x, share)
        if last.same(pins, closed.pins):
            break
    return Settled(stretch, errors, last.system, held, x, closed, steps)


def _least(
    stretch: Stretch, energy: System, condensed: Condensed | None, start: Array | None, *, quick: bool
) -> tuple[Array, Closed, Steps]:
    """Pose of least energy, its contacts, and Newton steps."""
    theta, torque = stretch.contacts.motion.theta, stretch.torque
    steps, found = np.zeros(theta.size, dtype=np.intp), np.zeros(theta.size, dtype=np.bool_)
    if condensed is not None:
        start, steps, found = condensed.settled(energy, torque, start)
        closed = energy.closed(start) if quick else energy.state(start)
        # final where the loaded flanks, and no others, carry
        if isinstance(closed, State):
            found &= closed.imbalance <= np.maximum(energy.tolerance(torque), closed.unbalanced)
        else:
            found &= ((closed.flanks > 0) == energy.driving_flanks).all(axis=1)
        if found.all():
            return start, closed, steps
    x, more, found = minimise(energy, torque, start)
    steps = steps + more
    if not found.all():
        where = ", ".join(f"{math.degrees(a):.4g}" for a in theta[~found][:5])
        loaded = ", or take a greater load" if torque > _trace(stretch.reducer) else ""
        raise NotConvergedError(
            f"no equilibrium after {steps[~found].min()} steps at {(~found).sum()} of {found.size} angles (theta = "
            f"{where} deg ...); check for errors and clearances far above 0.1 mm{loaded}"
        )
    return x, energy.state(x), steps


@dataclass(frozen=True)
class Settled:
    """Settled pose of one stretch of angles, its contacts, and what it was found with."""

    stretch: Stretch
    errors: Errors
    energy: System
    condensed: Condensed | None
    x: Array
    closed: Closed
    steps: Steps
    unloading: Array | float = 0.0  # what taking the load off adds to the pose

    @property
    def contacts(self) -> Geometry:
        """Geometry of the contacts."""
        return self.stretch.contacts

    def unloaded(self) -> Settled:
        """Take the load off with the closed contacts held closed; forces and contacts stay those of the load."""
        return replace(self, unloading=-self._answer(self.energy.load))

    def _answer(self, force: Array, *, quick: bool = False) -> Array:
        """Change of the pose with a force, the closed contacts held closed; quickly, to some 1e-10 of the largest."""
        system, closed = self.energy, self.closed
        if quick and self.condensed is not None and ((closed.flanks > 0) == system.driving_flanks).all():
            return self.condensed.answer(system, closed, force, self._turning)
        return refined(with_discs(system.newton_matrix(closed), self._turning, system.first_disc), force)

    @cached_property
    def _pressed(self) -> Array:
        """Force of each pin, (n, discs, pins)."""
        return np.asarray(self.energy.pin_law.force(self.closed.pins, self.energy.pin_stiffness))

    @cached_property
    def _turn(self) -> Array:
        """How far the force of each pin turns for what it moves along the profile, N/mm, (n, discs, pins)."""
        return np.asarray(self.stretch.reducer.contact_law.profile_curvature * self.contacts.curvature * self._pressed)

    @cached_property
    def _turning(self) -> Array:
        """Stiffness that each disc has by the turn of its pins' forces, (n, discs, 3, 3)."""
        rows = self.contacts.profile_rows
        return np.asarray(-np.einsum("nbki,ncki->nkbc", self._turn[:, None] * rows, rows))

    @property
    def transmission_error(self) -> Array:
        """Turn of the output."""
        return np.asarray(self.stretch.reducer.output_turn * (self.x + self.unloading)[:, 2], dtype=np.float64)

    def equilibrium(self) -> Equilibrium:
        """What users see of it."""
        reducer, n = self.contacts.motion.reducer, len(self.x)
        parts = samples_last(self.x + self.unloading)
        bodies = parts[3:-2].reshape(-1, 3, n)
        state = self.closed if isinstance(self.closed, State) else self.energy.state(self.x)
        residual = GRADIENT_TOLERANCE * state.imbalance / self.energy.tolerance(self.stretch.torque)
        return Equilibrium(
            transmission_error=self.transmission_error,
            pose={
                "carrier": parts[:3],
                "disc": bodies[: reducer.discs],
                "crank": bodies[reducer.discs :],
                "sun": parts[-2:],
            },
            contact_forces=self._contact_forces(),
            loaded_pins=(self.closed.pins > 0).sum(axis=2).T,
            steps=self.steps,
            residual=residual,
            theta=self.contacts.motion.theta,
        )

    def tangent(self) -> Tangent:
        """Stiffness of every contact."""
        system, closed, where = self.energy, self.closed, self._journals()
        n, force = len(self.x), self._joint_forces()
        stiffness = np.broadcast_to(self.stretch.elasticity.joint, (n, where.size))
        joint, pressed = stiffness[..., None, None] * np.eye(2), np.sqrt((force**2).sum(axis=-1))
        if where.any():
            joint[:, where] = system.journal_matrices(closed.journals)
            pressed[:, where] += 2 * system.journal_stiffness * system.behind(closed.journals)
        return Tangent(
            contacts=self.contacts,
            x=self.x + self.unloading,
            pin=system.pin_law.tangent(closed.pins, system.pin_stiffness),
            flank=system.flank_law.tangent(closed.flanks, system.flank_stiffness),
            joint=joint,
            pin_force=self._pressed,
            flank_force=system.flank_law.force(closed.flanks, system.flank_stiffness),
            joint_force=force,
            joint_pressed=pressed,
        )

    def _journals(self) -> npt.NDArray[np.bool_]:
        return np.asarray(self.errors.clearance != 0)

    def _joints(self) -> Array:
        """Closing of each bearing, (n, joints, 2)."""
        return np.asarray(np.einsum("nqcd,nd->nqc", self.contacts.joint_rows, self.x) + self.errors.joint)

    def _joint_forces(self) -> Array:
        """Force of each bearing, (n, joints, 2)."""
        force = self.stretch.elasticity.joint[..., None] * self._joints()
        if self._journals().any():
            force[:, self._journals()] = self.energy.journal_forces(self.closed.journals)[1]
        return np.asarray(force, dtype=np.float64)

    def _contact_forces(self) -> dict[str, Array]:
        system = self.energy
        return self._by_contact(
            pins=self._pressed,
            flanks=system.flank_law.force(self.closed.flanks, system.flank_stiffness),
            joints=self._joint_forces(),
        )

    def _carried(self) -> dict[str, Array]:
        """Forces under which contacts give way: by a power law those that press a linear contact in as far."""
        system = self.energy
        carried = self._by_contact(
            pins=system.pin_stiffness * np.maximum(self.closed.pins, 0.0),
            flanks=system.flank_stiffness * np.maximum(self.closed.flanks, 0.0),
            joints=self._joint_forces(),
        )
        return {f"{key} carried": carried[key] for key in YIELDING}

    def _by_contact(self, *, pins: Array, flanks: Array, joints: Array) -> dict[str, Array]:
        """Sizes of forces, samples first, as vectors of the driving on the driven part, samples last."""
        reducer, n = self.contacts.motion.reducer, len(self.x)
        flank = samples_last(flanks.reshape(n, reducer.cranks, 2))
        return {
            "pin": samples_last(pins)[..., None, :] * self._pin_normal,
            **self._bearings(joints),
            "mesh": flank[..., None, :] * self.contacts.motion.mesh_normal,
            "spline": -(flank * flank_lever(reducer)[:, None])[..., None, :],
        }

    @property
    def _pin_normal(self) -> Array:
        """From the pins into the discs, (discs, pins, 2, n), by first order in how far it has turned."""
        return -np.moveaxis(self.energy.pin_rows[:, :2], (0, 1), (-1, -2))

    def _bearings(self, joints: Array) -> dict[str, Array]:
        """Vectors of cams and carrier bores, samples last, from those of all joints, samples first."""
        reducer, vectors = self.contacts.motion.reducer, samples_last(joints)
        cams = reducer.discs * reducer.cranks
        return {
            "cam": vectors[:cams].reshape(reducer.discs, reducer.cranks, 2, -1),
            "carrier": vectors[cams:-2],
        }

    def _directions(self) -> dict[str, Array]:
        """Unit vectors along which bearings carry; 0 where rollers on both sides do, and a clearance moves nothing."""
        joints, floats = self._joints(), self._journals()
        if floats.any():
            joints[:, floats] *= ~self.energy.pressed_around(self.closed.journals)[..., None]
        return {f"{key} direction": unit_vectors(carried) for key, carried in self._bearings(joints).items()}

    def pose_changes(self, effects: tuple[Effect, ...]) -> Array:
        """Change of the pose per parameter (n, unknowns, parameters), the closed contacts held closed.

        What an effect closes presses on every part; effects that no contact feels change nothing.
        """
        pressed = [np.zeros((*self.x.shape, 0))]
        for effect in effects:
            for unit in np.eye(len(effect.values)):
                one = felt((replace(effect, values=tuple(unit)),))
                pressed.append(self._pressing(error_closing(self.contacts, one))[..., None])
        force = -np.concatenate(pressed, axis=2)
        matrix, inverse = self._stiffness_and_inverse
        first = inverse @ force
        return np.asarray(first + inverse @ (force - matrix @ first), dtype=np.float64)

    @cached_property
    def _stiffness_and_inverse(self) -> tuple[Array, Array]:
        matrix = with_discs(self.energy.newton_matrix(self.closed), self._turning, self.energy.first_disc)
        return matrix, np.asarray(np.linalg.inv(held(matrix)), dtype=np.float64)

    def _pressing(self, errors: Errors) -> Array:
        """Force of errors on the pose, (n, unknowns), the closed contacts held closed."""
        system, tangent, n = self.energy, self.tangent(), len(self.x)
        carried, more = self._joint_forces(), errors.compliance
        flanks, joints = errors.flank.copy(), errors.joint.copy()
        # a normal that has turned sees a little of what goes along the profile
        tilt = samples_first((self._pin_normal * self.contacts.profile_tangent).sum(axis=2))
        pins = errors.pin + tilt * errors.along
        # what gives way opens by as much
        if "pin" in more:
            pins -= more["pin"] * system.pin_stiffness * np.maximum(self.closed.pins, 0.0)
        if "mesh" in more:
            flanks -= more["mesh"] * system.flank_stiffness * np.maximum(self.closed.flanks, 0.0)
        cams = self.stretch.reducer.discs * self.stretch.reducer.cranks
        for contact, at in (("cam", slice(0, cams)), ("carrier", slice(cams, -2))):
            if contact in more:
                joints[:, at] -= more[contact][..., None] * carried[:, at]
        if errors.clearance.any():
            joints -= errors.clearance[:, None] * samples_first(unit_vectors(samples_last(self._joints())))
        force = np.einsum("nqd,nq->nd", system.flank_rows, tangent.flank * flanks)
        force += np.einsum("nqcd,nqc->nd", self.contacts.joint_rows, (tangent.joint @ joints[..., None])[..., 0])
        on_discs = np.einsum("nki,ncki->nkc", tangent.pin * pins, system.pin_rows)
        on_discs -= np.einsum("nki,ncki->nkc", self._turn * errors.along, self.contacts.profile_rows)
        force[:, 3 : 3 + on_discs[0].size] += on_discs.reshape(n, -1)
        return np.asarray(force)

    @cached_property
    def _quick_per_torque(self) -> tuple[Array, Array, Array, Array]:
        return self._per_torque(quick=True)

    def _per_torque(self, *, quick: bool) -> tuple[Array, Array, Array, Array]:
        """Change per unit of output torque, samples first: of the force of pins, flanks, joints, and along profiles."""
        closed, system = self.closed, self.energy
        unit = np.zeros_like(self.x)
        unit[:, 2] = self.stretch.reducer.output_turn  # on the carrier
        answer = -self._answer(unit, quick=quick)
        pins = (system.pin_rows * system.discs(answer)).sum(axis=1)
        flanks = (system.flank_rows @ answer[..., None])[..., 0]
        joints = np.einsum("nqcd,nd->nqc", self.contacts.joint_rows, answer)
        change = self.stretch.elasticity.joint[..., None] * joints
        where = self._journals()
        if where.any():
            matrices = system.journal_matrices(closed.journals)
            change[:, where] = (matrices @ joints[:, where][..., None])[..., 0]
        return (
            system.pin_law.tangent(closed.pins, system.pin_stiffness) * pins,
            system.flank_law.tangent(closed.flanks, system.flank_stiffness) * flanks,
            np.asarray(change, dtype=np.float64),
            np.asarray((self.contacts.profile_rows * system.discs(answer)).sum(axis=1)),
        )

    def softening(self) -> Array:
        """Change of the output angle per unit of each of `SOFTENING`, (10, n).

        A contact that gives way by dp more under the force that it carries opens by dp: the output moves by -lambda dp,
        lambda the change of its force per unit of output torque.  What turns with a profile's curvature besides is the
        pins' force.
        """
        pins, flanks, joints, turning = self._quick_per_torque
        system, closed, reducer = self.energy, self.closed, self.stretch.reducer
        stiffness, cams = reducer.stiffness, reducer.discs * reducer.cranks
        forces, floats = self._joint_forces(), self._journals()
        if floats.any():  # rollers on both sides give way half as far
            forces[:, floats] /= 1 + system.pressed_around(closed.journals)[..., None]
        work = (joints * forces).sum(axis=2)
        yielded = pins * np.maximum(closed.pins, 0.0) * system.pin_stiffness
        shut = flanks * np.maximum(closed.flanks, 0.0) * system.flank_stiffness
        by_pin_exponent = pins * system.pin_law.change_with_exponent(closed.pins, system.pin_stiffness)
        by_flank_exponent = flanks * system.flank_law.change_with_exponent(closed.flanks, system.flank_stiffness)
        along = moved(self.contacts, system, self.errors, self.x)
        by_curvature = self.contacts.curvature * along * (pins * along / 2 + self._pressed * turning)
        rows = {
            "pin_contact": yielded.sum(axis=(1, 2)) / stiffness.pin_contact,
            "crank_bearing": work[:, :cams].sum(axis=1) / stiffness.crank_bearing,
            "carrier_bearing": work[:, cams:-2].sum(axis=1) / stiffness.carrier_bearing,
            "gear_mesh": shut.sum(axis=1) / stiffness.gear_mesh,
            "sun_support": work[:, -1] / stiffness.sun_support,
            "main_bearing": work[:, -2] / stiffness.main_bearing,
            "gear_backlash": flanks.sum(axis=1) / 2,
            "pin_exponent": by_pin_exponent.sum(axis=(1, 2)),
            "flank_exponent": by_flank_exponent.sum(axis=1),
            "profile_curvature": by_curvature.sum(axis=(1, 2)),
        }
        return -np.stack([rows[name] for name in SOFTENING])

    def forces_per_torque(self, *, quick: bool = False) -> ContactForces:
        """Change of the contact forces per unit of output torque with the closed contacts held closed."""
        return {
            **self._changes(quick=quick),
            **self._directions(),
            **self._carried(),
            "output": np.ones((1, len(self.x))),
        }

    def _changes(self, *, quick: bool) -> dict[str, Array]:
        pins, flanks, joints, along = self._quick_per_torque if quick else self._per_torque(quick=False)
        changes = self._by_contact(pins=pins, flanks=flanks, joints=joints)
        # a pin's force turns with its normal
        changes["pin"] = changes["pin"] - samples_last(self._turn * along)[..., None, :] * self.contacts.profile_tangent
        return changes

    def influences(self, effects: tuple[Effect, ...]) -> Array:
        """Change of the output angle per parameter (parameters, n)."""
        n, forces = len(self.x), self._changes(quick=True)
        errors = [self.contacts.error(effect) for effect in effects]
        if any(isinstance(error, Clearance) for error in errors):
            forces |= self._directions()
        if any(isinstance(error, Compliance) for error in errors):
            forces |= self._carried()
        rows = [project(forces, error, n) for error in errors]
        return np.concatenate([np.zeros((0, n)), *rows])
