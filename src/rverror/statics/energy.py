"""The elastic energy of a loaded gear train, and the pose in which it is least.

Carrier, discs, cranks (x, y, angle each) and sun (x, y) take the pose of least energy,

    E(x) = 1/2 sum k_c p_c(x)^2 - f . x,

over contacts c that close by p_c, 0 where an open pin or flank has p_c < 0 and where a journal floats in its clearance;
pins and flanks that close by a power law hold another energy each (`elasticity`).
It is convex, so a semismooth Newton method with a line search finds it.  The closing of a pin, of a flank and of each
component of a bearing is J_c x + e_c: J_c holds the action lines of the nominal pose, e_c the same error vectors as in
the closed form.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array, cross, radial_and_tangential, unit_vectors
from rverror.geartrain.action_line import (
    BEARINGS,
    Clearance,
    Compliance,
    Contacts,
    Displacement,
    SourceVector,
)
from rverror.geartrain.contacts import closed_form_forces
from rverror.geartrain.cycloid import pin_positions, trochoid_curvature
from rverror.geartrain.mechanism import Reducer
from rverror.model.catalogue import source
from rverror.model.effects import Effect
from rverror.statics.elasticity import Elasticity, PowerLaw, elasticity

Steps = npt.NDArray[np.intp]
Flags = npt.NDArray[np.bool_]

GRADIENT_TOLERANCE = 1e-9  # of the applied torque
_MAX_STEPS = 40
_MAX_STEPS_NEAR = 10  # from a pose that is likely near
_UNLOADING = (8.0, 3.0)  # factors between loads on the way down, the second for angles that the first leaves
_MAX_STEPS_UNLOADING = 2000  # at each load; each few lower a convex energy, so only time runs out
_LOOSER_UNLOADING = 1e4  # than the tolerance at the last load
_FULL_LOAD = 5e-4  # torque at which all contacts settle easily, of pin stiffness times pin circle radius squared
_TINY = float(np.finfo(np.float64).tiny)
_EPSILON = float(np.finfo(np.float64).eps)
_ROUNDING = 2e-14  # of stiffness times displacement, in sums of which the parts cancel
_OF_ALL_ANGLES = ("reducer", "pin_law", "flank_law", "first_disc")  # of a system
_KEPT = 4  # energies of the last steps: below the highest of them each step falls
#: mm.  Work of a whole Newton step, over the tolerance, below which a pose creeps along on rounding alone.  An output
#: that gives way by less than 1 mrad under its torque is then within 1e-10 rad of its place.
_CREEPING = 1e-8
_STRIDE = 8  # every so many angles is solved first; those between start from their neighbours


@dataclass(frozen=True)
class Errors:
    """What the errors close at each contact, mm, samples first."""

    pin: Array  # (n, discs, pins)
    along: Array  # (n, discs, pins), by which pins move along the discs' profiles
    flank: Array  # (n, 2 cranks)
    joint: Array  # (n, joints, 2): cams (disc by crank), carrier bores, main bearing, sun support
    clearance: Array  # (joints,); below 0 an interference
    compliance: Mapping[str, Array] = field(
        default_factory=dict
    )  # mm/N more than nominal, where any, as `elasticity` takes


@dataclass(frozen=True)
class Closing:
    """How far one unit of each parameter of an effect closes contacts of one kind.

    Attributes
    ----------
    contact : str
        A key of `CONTACT_AXES`, bearings with both components; or "along": not into a disc, but along its profile.
    at : tuple of slice
        Which of its entries.
    rows : ndarray, shape (terms, axes of the contact but for the xy of pins and flanks, n)
        mm per mm or rad.
    """

    contact: str
    at: tuple[slice, ...]
    rows: Array


def closing_of(motion: Contacts, error: Displacement) -> Closing:
    """Project an error vector onto the action lines of its contacts."""
    at = error.at
    if error.contact in BEARINGS:
        return Closing(error.contact, at, error.vector)
    if error.contact == "spline":
        # a crank that leads its planet holds the planet back on the line of action
        lever = np.broadcast_to(flank_lever(motion.reducer)[:, None], (motion.reducer.cranks, 2, 1))
        return Closing("mesh", at, -lever[at] * error.vector[..., 0, :])
    normal = motion.pin_normal if error.contact == "pin" else motion.mesh_normal
    return Closing(error.contact, at, error.along(normal[at]))


def error_closing(contacts: Geometry, effects: tuple[Effect, ...]) -> Errors:
    """Sum what effects close at the contacts of the gear train, along the action lines."""
    reducer, n = contacts.motion.reducer, contacts.motion.theta.size
    discs, cranks = reducer.discs, reducer.cranks
    total = {
        "pin": np.zeros((discs, reducer.pins, n)),
        "along": np.zeros((discs, reducer.pins, n)),
        "mesh": np.zeros((cranks, 2, n)),
        "cam": np.zeros((discs, cranks, 2, n)),
        "carrier": np.zeros((cranks, 2, n)),
    }
    clearance = dict.fromkeys(BEARINGS, 0.0)
    softer: dict[str, Array] = {}
    for effect in effects:
        closings = contacts.closings(effect)
        if isinstance(closings, Clearance):
            clearance[closings.contact] += max(effect.values[0], 0.0)
            continue
        if isinstance(closings, Compliance):
            shape = total[closings.contact].shape
            whole = softer.setdefault(
                closings.contact, np.zeros((*shape[:-2], n) if closings.contact in BEARINGS else shape)
            )
            whole[closings.at] += np.tensordot(effect.values, closings.share, axes=1)
            continue
        for one in closings:
            for value, row in zip(effect.values, one.rows, strict=True):
                total[one.contact][one.at] += value * row
    held = np.zeros((2, 2, n))  # main bearing and sun support
    joints = np.concatenate([total["cam"].reshape(-1, 2, n), total["carrier"], held])
    bearings = np.repeat([clearance["cam"], clearance["carrier"], 0.0], [discs * cranks, cranks, 2])
    return Errors(
        samples_first(total["pin"]),
        samples_first(total["along"]),
        samples_first(total["mesh"].reshape(-1, n)),
        samples_first(joints),
        bearings,
        {contact: samples_first(more if contact == "pin" else more.reshape(-1, n)) for contact, more in softer.items()},
    )


def samples_first(row: Array) -> Array:
    """What has its samples last, as everything outside the statics, for stacked systems of equations, one a sample."""
    return np.ascontiguousarray(np.moveaxis(row, -1, 0))


def samples_last(row: Array) -> Array:
    """Undo `samples_first`."""
    return np.moveaxis(row, 0, -1)


def flank_lever(reducer: Reducer) -> Array:
    """Lever of the planet's turn on each flank: its base circle."""
    return reducer.planet_pitch_radius * math.cos(reducer.pressure_angle) * np.array([1.0, -1.0])


def flank_rows(motion: Contacts) -> Array:
    """Rows (n, 2 cranks, size): the sun closes along n, the planet opens and turns on its base circle."""
    reducer, n = motion.reducer, motion.theta.size
    layout = Layout(reducer)
    normal = samples_first(motion.mesh_normal)
    rows = np.zeros((n, reducer.cranks, 2, layout.size))
    rows[..., layout.sun : layout.sun + 2] = normal
    for j, at in enumerate(layout.crank):
        rows[:, j, :, at : at + 2] = -normal[:, j]
        rows[:, j, :, at + 2] = flank_lever(reducer)
    return rows.reshape(n, -1, layout.size)


def joint_rows(motion: Contacts) -> Array:
    """Rows (n, joints, xy, size) of cams (disc by crank), carrier bores, main bearing and sun support."""
    reducer, n = motion.reducer, motion.theta.size
    layout = Layout(reducer)
    bore = reducer.crank_radius * samples_first(radial_and_tangential(motion.crank_position)[1])
    cam = reducer.eccentricity * samples_first(radial_and_tangential(motion.eccentric)[1])
    parts: list[list[tuple[int, float, Array | None]]] = [
        [(disc, 1, bore[:, j]), (crank, -1, cam[:, k])]
        for k, disc in enumerate(layout.disc)
        for j, crank in enumerate(layout.crank)
    ]
    parts += [[(crank, 1, None), (0, -1, bore[:, j])] for j, crank in enumerate(layout.crank)]
    # the motor, whose bearings hold the sun, stands on what is held
    held: list[tuple[int, float, Array | None]] = [(0, -1, None)] if reducer.held == "carrier" else []
    parts += [[(0, 1, None)], [(layout.sun, 1, None), *held]]
    rows = np.zeros((n, len(parts), 2, layout.size))
    for q, sides in enumerate(parts):
        for at, sign, lever in sides:
            rows[:, q, 0, at] = rows[:, q, 1, at + 1] = sign
            if lever is not None:
                rows[:, q, :, at + 2] = sign * lever
    return rows


@dataclass(frozen=True)
class Springs:
    """Bearings without clearance: stiffness matrix, rows times stiffness, largest row sum of the matrix."""

    matrix: Array  # (n, size, size)
    rows: Array  # (n, 2 bearings, size)
    scale: Array  # (n,)


@dataclass(frozen=True)
class Geometry:
    """What errors leave as it is at n angles: how far each contact closes with the pose, and which of them drive."""

    motion: Contacts
    pin_rows: Array  # (n, 3, discs, pins), on x, y and angle of the disc
    flank_rows: Array  # (n, 2 cranks, size)
    joint_rows: Array  # (n, joints, 2, size)
    driving_pins: Flags  # (n, discs, pins)
    driving_flanks: Flags  # (n, 2 cranks)

    def error(self, effect: Effect) -> SourceVector:
        """Error vector of an effect's source, made once; its size plays no part."""
        name = (effect.key, *sorted(effect.indices.items()))
        if name not in self._errors:
            self._errors[name] = source(effect.key).vector(self.motion, **effect.indices)
        return self._errors[name]

    def closings(self, effect: Effect) -> tuple[Closing, ...] | Clearance | Compliance:
        """What it closes, made once."""
        name = (effect.key, *sorted(effect.indices.items()))
        if name not in self._closings:
            self._closings[name] = self._closing(self.error(effect))
        return self._closings[name]

    def _closing(self, error: SourceVector) -> tuple[Closing, ...] | Clearance | Compliance:
        if isinstance(error, (Clearance, Compliance)):
            return error
        parts = error if isinstance(error, tuple) else (error,)
        along = [Closing("along", p.at, p.along(self.profile_tangent[p.at])) for p in parts if p.contact == "pin"]
        return (*(closing_of(self.motion, part) for part in parts), *along)

    @cached_property
    def curvature(self) -> Array:
        """Curvature of the trochoid on which each pin's centre stands, 1/mm, (n, discs, pins)."""
        motion = self.motion
        lead = motion.eccentric[:, None] - pin_positions(motion.reducer)[:, None]
        return samples_first(trochoid_curvature(motion.reducer, lead))

    @cached_property
    def profile_rows(self) -> Array:
        """How far each pin moves along its disc's profile with x, y and angle of the disc, (n, 3, discs, pins)."""
        motion = self.motion
        pins, _ = radial_and_tangential(pin_positions(motion.reducer)[:, None])
        eccentric, _ = radial_and_tangential(motion.eccentric)
        arm = motion.reducer.pin_circle_radius * pins - motion.reducer.eccentricity * eccentric[:, None]
        along = self.profile_tangent
        return -samples_first(np.stack([along[:, :, 0], along[:, :, 1], cross(arm, along)]))

    @cached_property
    def profile_tangent(self) -> Array:
        """Along each profile, a quarter turn ahead of the normal, (discs, pins, 2, n)."""
        normal = self.motion.pin_normal
        return np.stack([-normal[:, :, 1], normal[:, :, 0]], axis=2)

    @cached_property
    def pins_by_disc(self) -> Array:
        """How each pin closes with x, y and angle of its disc, (n, discs, 3, pins)."""
        return np.ascontiguousarray(self.pin_rows.transpose(0, 2, 1, 3))

    @cached_property
    def _errors(self) -> dict[tuple[Any, ...], SourceVector]:
        return {}

    @cached_property
    def _closings(self) -> dict[tuple[Any, ...], tuple[Closing, ...] | Clearance | Compliance]:
        return {}


@dataclass(frozen=True)
class Elastic:
    """A gear train whose contacts give way, at n angles: a geometry and how stiff it is.

    The geometry's own reducer says where things are; stiffness, backlash and contact law are those of `reducer`.

    Attributes
    ----------
    contacts : Geometry
    reducer : Reducer
    more : mapping of str to ndarray
        Compliance of contacts more than nominal, as `elasticity.elasticity` takes it.
    """

    contacts: Geometry
    reducer: Reducer
    more: Mapping[str, Array] = field(default_factory=dict, kw_only=True)

    @cached_property
    def elasticity(self) -> Elasticity:
        """Stiffness of every contact."""
        return elasticity(self.reducer, self.more)

    @cached_property
    def all_springs(self) -> Springs:
        """`springs` where none floats."""
        return self._springs(np.ones(self.contacts.joint_rows.shape[1], dtype=np.bool_))

    def springs(self, floats: Flags) -> Springs:
        """Bearings that do not float in a clearance."""
        return self._springs(~floats) if floats.any() else self.all_springs

    def _springs(self, chosen: Flags) -> Springs:
        n, size = len(self.contacts.joint_rows), self.contacts.joint_rows.shape[-1]
        rows = self.contacts.joint_rows[:, chosen].reshape(n, -1, size)
        weighted = np.repeat(self.elasticity.joint[:, chosen], 2, axis=1)[..., None] * rows
        matrix = np.swapaxes(rows, 1, 2) @ weighted
        return Springs(matrix, weighted, np.abs(matrix).sum(axis=2).max(axis=1))


class Layout:
    """Where each part stands in the pose."""

    def __init__(self, reducer: Reducer) -> None:
        """Count x, y and angle of each part, x and y of the sun."""
        self.disc = [3 + 3 * k for k in range(reducer.discs)]
        self.crank = [3 + 3 * (reducer.discs + j) for j in range(reducer.cranks)]
        self.sun = 3 + 3 * (reducer.discs + reducer.cranks)
        self.size = self.sun + 2


@dataclass(frozen=True)
class System:
    """The energy at n angles.

    Springs are the bearings without clearance or preload: a matrix and a vector hold all of them.  Journals are those
    with one.
    """

    reducer: Reducer
    pin_law: PowerLaw
    flank_law: PowerLaw
    first_disc: int  # column of its x
    load: Array  # (n, size)
    spring_matrix: Array  # (n, size, size)
    spring_force: Array  # (n, size)
    spring_scale: Array  # (n,), largest row sum of the matrix
    pin_rows: Array  # (n, 3, discs, pins), on x, y and angle of the disc
    pin_error: Array  # (n, discs, pins)
    pin_stiffness: Array  # (n, discs or 1, pins or 1)
    flank_rows: Array  # (n, 2 cranks, size)
    flank_error: Array
    flank_stiffness: Array  # (n, 2 cranks or 1)
    journal_rows: Array  # (n, journals, 2, size), of bearings with clearance
    journal_error: Array  # (n, journals, 2)
    clearance: Array  # (n, journals); below 0 an interference, where rollers on both sides carry
    journal_stiffness: Array  # (n, journals)
    driving_pins: Flags  # on the loaded side
    driving_flanks: Flags
    driving_force: Array  # (n, journals, 2), its direction

    def tolerance(self, torque: float) -> float:
        """What may be out of balance under a torque, N and N*mm."""
        return GRADIENT_TOLERANCE * torque / self.reducer.crank_radius

    def take(self, at: Any) -> System:
        """The same at some of the angles."""
        names = [f.name for f in fields(self) if f.name not in _OF_ALL_ANGLES]
        return replace(self, **{name: getattr(self, name)[at] for name in names})

    @property
    def _of_discs(self) -> slice:
        return slice(self.first_disc, self.first_disc + 3 * self.reducer.discs)

    def discs(self, x: Array) -> Array:
        """x, y and angle of the discs, (n, 3, discs, 1)."""
        return x[:, self._of_discs].reshape(len(x), -1, 3).swapaxes(1, 2)[..., None]

    def closed(self, x: Array) -> Closed:
        """Contacts in the pose `x`, of a system without clearance."""
        pins = (self.pin_rows * self.discs(x)).sum(axis=1)
        pins += self.pin_error
        flanks = (self.flank_rows @ x[..., None])[..., 0] + self.flank_error
        return Closed(pins, flanks, np.zeros((len(x), 0, 2)))

    def state(self, x: Array) -> State:
        """Contacts, energy and its gradient in the pose `x`."""
        disc, rows = self.discs(x), self.pin_rows
        pins = rows[:, 0] * disc[:, 0] + rows[:, 1] * disc[:, 1] + rows[:, 2] * disc[:, 2] + self.pin_error
        flanks = (self.flank_rows @ x[..., None])[..., 0] + self.flank_error
        spring = (self.spring_matrix @ x[..., None])[..., 0]
        pin_force = self.pin_law.force(pins, self.pin_stiffness)
        flank_force = self.flank_law.force(flanks, self.flank_stiffness)
        gradient = spring + self.spring_force - self.load
        gradient += (flank_force[:, None] @ self.flank_rows)[:, 0]
        on_discs = np.einsum("nki,ncki->nkc", pin_force, rows)
        gradient[:, self._of_discs] += on_discs.reshape(len(x), -1)
        terms = [
            0.5 * (x * spring).sum(axis=1),
            (x * self.spring_force).sum(axis=1),
            -(x * self.load).sum(axis=1),
            np.einsum("nki,nki->n", pin_force, pins) / (self.pin_law.exponent + 1),
            (flank_force * flanks).sum(axis=1) / (self.flank_law.exponent + 1),
        ]
        journals = self.journal_rows @ x[:, None, :, None]
        journals = journals[..., 0] + self.journal_error
        if journals.size:
            squares, force = self.journal_forces(journals)
            gradient += np.einsum("nqcd,nqc->nd", self.journal_rows, force)
            terms.append(0.5 * (self.journal_stiffness * squares).sum(axis=1))
        far = np.abs(x).max(axis=1)
        rounding = _ROUNDING * self.spring_scale * far
        return State(
            energy=np.sum(terms, axis=0),
            rounding=rounding * far + 4 * _EPSILON * np.abs(terms).sum(axis=0),
            gradient=gradient,
            unbalanced=rounding,
            pins=pins,
            flanks=flanks,
            journals=journals,
        )

    def journal_forces(self, journals: Array) -> tuple[Array, Array]:
        """Squares of the closings and force of each journal, which floats in its clearance or is pressed all around."""
        distance = np.sqrt((journals**2).sum(axis=-1))
        closing, behind = np.maximum(distance - self.clearance, 0.0), self.behind(journals)
        share = self._journal_share(distance, closing)
        return closing**2 + behind**2, (self.journal_stiffness * share)[..., None] * journals

    def _journal_share(self, distance: Array, closing: Array) -> Array:
        """Force of a journal over its stiffness and distance: 2 where rollers on both sides carry."""
        return np.where(distance < -self.clearance, 2.0, closing / np.where(distance > 0, distance, 1.0))

    def behind(self, journals: Array) -> Array:
        """How far each journal's rollers away from its force are still closed."""
        return np.asarray(np.maximum(-self.clearance - np.sqrt((journals**2).sum(axis=-1)), 0.0))

    def pressed_around(self, journals: Array) -> Flags:
        """Journals whose rollers carry on both sides."""
        return np.asarray(np.sqrt((journals**2).sum(axis=-1)) < -self.clearance)

    def journal_matrices(self, journals: Array) -> Array:
        """Stiffness (n, journals, 2, 2) of the journals: full along the force, F / distance across it."""
        distance = np.sqrt((journals**2).sum(axis=-1))
        closing = np.maximum(distance - self.clearance, 0.0)
        share = self._journal_share(distance, closing)
        sides = (closing > 0) + np.where(distance < -self.clearance, 1.0, 0.0)
        along = journals / np.where(distance > 0, distance, 1.0)[..., None]
        radial = along[..., :, None] * along[..., None, :]
        across = share[..., None, None] * np.eye(2)
        matrix = across + (sides - share)[..., None, None] * radial
        return np.asarray(self.journal_stiffness[..., None, None] * matrix, dtype=np.float64)

    def matrix(self, *, pins: Array, flanks: Array, journals: Array) -> Array:
        """Stiffness with that of each pin, of each flank and of each journal."""
        rows = self.pin_rows
        blocks = np.einsum("nbki,ncki->nkbc", pins[:, None] * rows, rows)
        matrix = with_discs(self.spring_matrix, blocks, self.first_disc)
        matrix += np.swapaxes(self.flank_rows, 1, 2) @ (flanks[..., None] * self.flank_rows)
        if journals.size:
            n, size = self.load.shape
            weighted = (journals @ self.journal_rows).reshape(n, -1, size)
            matrix += np.swapaxes(self.journal_rows.reshape(n, -1, size), 1, 2) @ weighted
        return matrix

    def newton_matrix(self, state: Closed) -> Array:
        """Second derivative of the energy."""
        return self.matrix(
            pins=self.pin_law.tangent(state.pins, self.pin_stiffness),
            flanks=self.flank_law.tangent(state.flanks, self.flank_stiffness),
            journals=self.journal_matrices(state.journals),
        )

    def held(self, *, pins: Flags, flanks: Flags, along: Array) -> Array:
        """Pose with the contacts in `pins` and `flanks` held closed and each journal at its clearance's end `along`.

        Contacts of a power law are taken at their declared stiffness: it is a place to start from.
        """
        away = self.journal_error - self.clearance[..., None] * along
        springs = self.journal_stiffness[..., None, None] * np.eye(2)
        gradient = self.spring_force - self.load
        gradient = gradient + np.einsum("nqcd,nqc->nd", self.journal_rows, self.journal_stiffness[..., None] * away)
        pin_stiffness, flank_stiffness = self.pin_stiffness * pins, self.flank_stiffness * flanks
        gradient += ((flank_stiffness * self.flank_error)[:, None] @ self.flank_rows)[:, 0]
        on_discs = np.einsum("nki,ncki->nkc", pin_stiffness * self.pin_error, self.pin_rows)
        gradient[:, self._of_discs] += on_discs.reshape(len(gradient), -1)
        return -solved(self.matrix(pins=pin_stiffness, flanks=flank_stiffness, journals=springs), gradient)

    def driven(self) -> Array:
        """Pose with all of the loaded side held closed: where each solution starts."""
        return self.held(pins=self.driving_pins, flanks=self.driving_flanks, along=self.driving_force)

    def on_the_rim(self, x: Array) -> Array:
        """Pose near `x` with its contacts held closed and each journal on the rim of its clearance."""
        state = self.state(x)
        along = samples_first(unit_vectors(samples_last(state.journals)))
        return self.held(pins=state.pins > 0, flanks=state.flanks > 0, along=along)


def with_discs(matrix: Array, blocks: Array, first: int = 0) -> Array:
    """A stiffness with more of each disc, (n, discs, 3, 3), whose columns begin at the first."""
    total = matrix.copy()
    for k in range(blocks.shape[1]):
        at = slice(first + 3 * k, first + 3 * k + 3)
        total[:, at, at] += blocks[:, k]
    return total


@dataclass(frozen=True)
class Closed:
    """Closing of every contact, mm: negative where a pin or flank is open."""

    pins: Array
    flanks: Array
    journals: Array


@dataclass(frozen=True)
class State(Closed):
    """Energy, gradient and closing of every contact.

    `rounding` and `unbalanced` bound what floating-point numbers leave of energy and gradient.
    """

    energy: Array
    rounding: Array
    gradient: Array
    unbalanced: Array

    @property
    def imbalance(self) -> Array:
        """Largest force or moment out of balance, (n,)."""
        return np.asarray(np.abs(self.gradient).max(axis=1))

    def take(self, at: Any) -> State:
        """The same at some of the angles."""
        return State(**{f.name: getattr(self, f.name)[at] for f in fields(self)})

    def put(self, at: Any, other: State) -> None:
        """Write the state of some of the angles."""
        for f in fields(self):
            getattr(self, f.name)[at] = getattr(other, f.name)


def geometry(motion: Contacts) -> Geometry:
    """Rows of every contact along a motion."""
    # a pin closes as the disc moves against the normal
    pins = -np.stack([motion.pin_normal[:, :, 0], motion.pin_normal[:, :, 1], motion.pin_arm])
    flank = np.stack([motion.sense > 0, motion.sense <= 0], axis=1)
    return Geometry(
        motion=motion,
        pin_rows=samples_first(pins),
        flank_rows=flank_rows(motion),
        joint_rows=joint_rows(motion),
        driving_pins=samples_first(motion.pin_arm * motion.sense) > 0,
        driving_flanks=np.tile(flank, motion.reducer.cranks),
    )


def loaded_system(elastic: Elastic, errors: Errors, torque: float) -> System:
    """Energy of a gear train with errors, under a torque on the carrier that resists its motion in the housing."""
    contacts, reducer, stiff = elastic.contacts, elastic.reducer, elastic.elasticity
    n, cams, floats = contacts.motion.theta.size, reducer.discs * reducer.cranks, errors.clearance != 0
    springs = elastic.springs(floats)
    load = np.zeros((n, springs.rows.shape[-1]))
    load[:, 2] = -contacts.motion.sense * torque
    along = np.zeros((len(floats), 2, n))
    if floats.any():
        forces = closed_form_forces(contacts.motion)
        along[:cams] = forces["cam direction"].reshape(cams, 2, n)
        along[cams:-2] = forces["carrier direction"]
    return System(
        reducer=reducer,
        pin_law=stiff.pin_law,
        flank_law=stiff.flank_law,
        first_disc=Layout(reducer).disc[0],
        load=load,
        spring_matrix=springs.matrix,
        spring_scale=springs.scale,
        spring_force=(errors.joint[:, ~floats].reshape(n, 1, -1) @ springs.rows)[:, 0],
        pin_rows=contacts.pin_rows,
        pin_error=errors.pin,
        pin_stiffness=_at_each(stiff.pin, n),
        flank_rows=contacts.flank_rows,
        flank_error=errors.flank - reducer.gear_backlash / 2,
        flank_stiffness=_at_each(stiff.flank, n),
        journal_rows=contacts.joint_rows[:, floats],
        journal_error=errors.joint[:, floats],
        clearance=np.tile(errors.clearance[floats], (n, 1)),
        journal_stiffness=_at_each(stiff.joint[:, floats], n),
        driving_pins=contacts.driving_pins,
        driving_flanks=contacts.driving_flanks,
        driving_force=samples_first(along[floats]),
    )


def preloaded(errors: Errors, reducer: Reducer) -> Errors:
    """Errors whose clearances are less by the preload of a reducer's bearings."""
    cams, preload = reducer.discs * reducer.cranks, reducer.bearing_preload
    pressed = np.repeat([preload.crank_bearing, preload.carrier_bearing, 0.0], [cams, reducer.cranks, 2])
    return replace(errors, clearance=errors.clearance - pressed) if pressed.any() else errors


def _at_each(stiffness: Array, n: int) -> Array:
    """Stiffness at each of n angles."""
    return np.broadcast_to(stiffness, (n, *stiffness.shape[1:]))


def minimise(system: System, torque: float, start: Array | None = None) -> tuple[Array, Steps, Flags]:
    """Pose of least energy at every angle.

    Parameters
    ----------
    system : System
    torque : float
        Size of the load in `system`, N*mm, above 0.
    start : ndarray, shape (n, size), optional
        Poses that are likely near.

    Returns
    -------
    x : ndarray, shape (n, size)
        Pose.
    steps : ndarray of int, shape (n,)
        Newton steps that each angle took.
    found : ndarray of bool, shape (n,)
        Whether the forces balance.
    """
    tolerance = system.tolerance(torque)
    if start is None:
        x, steps, found = _minimise_by_neighbours(system, tolerance)
    else:
        x, steps, found = _minimise(system, start, tolerance, _MAX_STEPS_NEAR)
        left = np.flatnonzero(~found)
        if left.size and system.clearance.size:
            part = system.take(left)
            x[left], more, found[left] = _minimise(part, part.on_the_rim(start[left]), tolerance, _MAX_STEPS_NEAR)
            steps[left] += more
            left = left[~found[left]]
        if left.size:
            x[left], more, found[left] = _minimise_by_neighbours(system.take(left), tolerance)
            steps[left] += more
    for factor in _UNLOADING:
        left = np.flatnonzero(~found)
        if left.size:
            x[left], more, found[left] = _unload(system.take(left), torque, factor)
            steps[left] += more
    return x, steps, found


def _minimise_by_neighbours(system: System, tolerance: float) -> tuple[Array, Steps, Flags]:
    """Poses as of `_minimise`, at a few angles first, then from there at those between."""
    n = len(system.load)
    x, steps, found = np.zeros_like(system.load), np.zeros(n, dtype=np.intp), np.zeros(n, dtype=np.bool_)
    first = np.unique(np.append(np.arange(0, n, _STRIDE), n - 1))
    part = system.take(first)
    x[first], steps[first], found[first] = _minimise(part, part.driven(), tolerance, _MAX_STEPS)
    rest = np.setdiff1d(np.arange(n), first)
    if rest.size:
        after = np.searchsorted(first, rest)
        share = ((rest - first[after - 1]) / (first[after] - first[after - 1]))[:, None]
        start = (1 - share) * x[first[after - 1]] + share * x[first[after]]
        part = system.take(rest)
        if system.clearance.size:  # half-way between two places on a circle is inside it
            start, other = part.on_the_rim(start), part.driven()
            lower = part.state(start).energy < part.state(other).energy
            start = np.where(lower[:, None], start, other)
        x[rest], steps[rest], found[rest] = _minimise(part, start, tolerance, _MAX_STEPS)
    return x, steps, found


def _unload(system: System, torque: float, factor: float) -> tuple[Array, Steps, Flags]:
    """Poses as of `_minimise`, from a heavy load downwards.

    At light load a journal slides along the rim of its clearance on next to no force: Newton steps are short there,
    and the place where a somewhat greater load put it is close.
    """
    stiff = system.reducer.stiffness.pin_contact * system.reducer.pin_circle_radius**2
    stages = math.ceil(max(math.log(_FULL_LOAD * stiff / torque, factor), 0.0))
    total = np.zeros(len(system.load), dtype=np.intp)
    x: Array | None = None
    for power in range(stages, -1, -1):
        loaded = replace(system, load=system.load * factor**power)
        start = loaded.driven() if x is None else loaded.on_the_rim(x)
        tolerance = system.tolerance(torque * factor**power) * (_LOOSER_UNLOADING if power else 1.0)
        x, steps, found = _minimise(loaded, start, tolerance, _MAX_STEPS_UNLOADING)
        total += steps
    assert x is not None
    return x, total, found


def _minimise(system: System, start: Array, tolerance: float, most: int) -> tuple[Array, Steps, Flags]:
    """Pose of least energy, the Newton steps that each angle took, and whether it was found within `most` of them."""
    x, now, part = start.copy(), system.state(start), system
    at, steps = np.arange(len(x)), np.zeros(len(x), dtype=np.intp)
    before, above = np.full(len(x), np.inf), np.full(len(x), np.inf)
    recent = np.full((len(x), _KEPT), -np.inf)
    for step in range(most + 1):
        left = now.imbalance
        # what is as small as rounding is let go once it shrinks no more
        moving = (left > tolerance) & ((left > now.unbalanced) | (left < 0.5 * before[at]))
        moving &= (above[at] > _CREEPING * tolerance) | (step < _MAX_STEPS)
        before[at] = left
        if not moving.all():
            at, part, now = at[moving], part.take(moving), now.take(moving)
        if at.size == 0 or step == most:
            break
        steps[at] += 1
        recent[at, step % _KEPT] = now.energy
        descent = -solved(part.newton_matrix(now), now.gradient)
        above[at] = -(now.gradient * descent).sum(axis=1)
        x[at], now = _line_search(part, x[at], _within_reach(part, descent), now, recent[at].max(axis=1))
    found = np.ones(len(x), dtype=np.bool_)
    found[at] = False
    return x, steps, found


def _within_reach(system: System, descent: Array) -> Array:
    """Steps no longer than the eccentricity: farther goes only what nothing holds, until it meets something.

    Where journals float and flanks are open, the trace of stiffness that is left leads some 1e10 mm away, from where
    the halvings of the line search do not come back.
    """
    far = np.abs(descent).max(axis=1, keepdims=True)
    return np.asarray(descent * np.minimum(1.0, system.reducer.eccentricity / np.maximum(far, _TINY)))


def _line_search(system: System, x: Array, descent: Array, state: State, highest: Array) -> tuple[Array, State]:
    """Halve each step until the energy falls; the full step is exact once no contact opens or closes.

    It falls below `highest`, the most that the last steps had: a journal that slides along the curved rim of its
    clearance is pressed into it by each straight step, and comes out by the next one.  Where rounding hides the fall,
    the slope at the end of the step must not be as steep upwards as it was downwards.
    """
    slope = (state.gradient * descent).sum(axis=1)
    length = np.ones(len(x))
    reached = x + descent
    found = system.state(reached)
    for _ in range(40):
        level = found.energy < state.energy + state.rounding
        ahead = (found.gradient * descent).sum(axis=1)
        falling = (found.energy <= highest + 1e-4 * length * slope) | (level & (ahead <= -0.8 * slope))
        if falling.all():
            break
        rising = ~falling
        length[rising] /= 2
        reached[rising] = x[rising] + length[rising, None] * descent[rising]
        found.put(rising, system.take(rising).state(reached[rising]))
    return reached, found


def held(matrix: Array) -> Array:
    """Stiffness with a trace more, which holds what no closed contact holds."""
    own = np.einsum("nii->ni", matrix)
    trace = 1e-12 * np.maximum(own, 1e-9 * own.max(axis=1, keepdims=True))  # each in its own unit
    return np.asarray(matrix + trace[:, :, None] * np.eye(matrix.shape[1]), dtype=np.float64)


def solved(matrix: Array, right: Array) -> Array:
    """Solve a stack of symmetric systems, held."""
    return np.asarray(np.linalg.solve(held(matrix), right[..., None])[..., 0])


def refined(matrix: Array, right: Array) -> Array:
    """The same less what the trace of stiffness costs, some 1e-8 of the answer, by one step of refinement."""
    first = solved(matrix, right)
    return first + solved(matrix, right - (matrix @ first[..., None])[..., 0])
