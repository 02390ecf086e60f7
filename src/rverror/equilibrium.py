"""Statics of the whole gear train under load: floating parts on elastic contacts, pins and gear flanks that can open.

Carrier, discs, cranks (x, y, angle each) and sun (x, y) take the pose of least energy,

    E(x) = 1/2 sum k_c p_c(x)^2 - f . x,    p_c = closing of contact c, 0 where an open pin or flank has p_c < 0,

which is convex, so a semismooth Newton method with a line search finds it.  The closing is p_c = J_c x + e_c: J_c holds
the action lines of the nominal pose, e_c the same error vectors as in the closed form.

Kinematics about the nominal pose is of first order in errors and displacements.  What that leaves out grows with their
square, some 0.1 arcsec rms for a dozen errors of 5 um: it comes from pins near a lobe's root, where the profile is
sharply curved.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rverror import units
from rverror.action_line import (
    BEARINGS,
    Array,
    Clearance,
    ContactForces,
    Contacts,
    dot,
    radial_and_tangential,
    unit_vectors,
)
from rverror.catalogue import source
from rverror.compose import closed_form_forces, pose
from rverror.model import Effect, Model
from rverror.reducer import Reducer

_MAX_STEPS = 60
_GRADIENT_TOLERANCE = 1e-7  # of the applied torque


class NotConvergedError(RuntimeError):
    """The equilibrium was not found at some angles; the message names them."""


@dataclass(frozen=True)
class Equilibrium:
    """Loaded state of a reducer at n angles.

    Attributes
    ----------
    transmission_error : ndarray, shape (n,)
        rad; holds the elastic windup, a lag of the output against the load.
    forces : mapping of str to ndarray
        Change of each contact force per unit of output torque: the influences at this state, for
        `compose.source_matrix`.
    loaded_pins : ndarray of int, shape (discs, n)
        Pins that carry on each disc.
    steps : int
        Newton steps of the slowest angle.
    """

    transmission_error: Array
    forces: ContactForces
    loaded_pins: npt.NDArray[np.intp]
    steps: int


def equilibrium(model: Model, theta: Any, *, torque: Any, direction: Any | None = None) -> Equilibrium:
    """Solve the statics of a reducer at each angle.

    Parameters
    ----------
    model : Model
        Of a reducer; its stiffnesses and backlash count.
    theta : array_like or quantity, shape (n,)
        Nominal output angle, rad.
    torque : float or quantity
        Size of the output torque, N*mm, above 0; it resists the motion.
    direction : float or array_like, optional
        +1 forward, -1 reverse; read from the angles where left out.

    Returns
    -------
    Equilibrium

    Raises
    ------
    ValueError
        If the model is no reducer or the torque is not above 0.
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
    if not isinstance(model.mechanism, Reducer):
        raise ValueError("the equilibrium needs a [reducer] model; a [drive] has no geometry")
    size = units.to_core(torque, "torque")
    if not size > 0:
        raise ValueError(f"torque = {size / 1e3:g} N*m: must be above 0; without load the contacts are not determined")
    motion = pose(model.mechanism, theta, direction=direction)
    assert isinstance(motion, Contacts)
    system = _System(motion)
    closing = system.error_closing(model.effects)
    x, steps = system.minimise(closing, size)
    contact = system.contact(x, closing)
    loaded = (contact.pins > 0).sum(axis=2).T
    return Equilibrium(x[:, 2] + closing.output, system.forces_per_torque(contact, closing), loaded, steps)


@dataclass(frozen=True)
class _Closing:
    """What the errors close at each contact, mm, samples first; `output` is what sensors add, rad."""

    pin: Array  # (n, discs, pins)
    mesh: Array  # (n, cranks, 2)
    joint: Array  # (n, joints, 2), elastic bearings, xy
    clearance: Array  # (joints,), radial
    output: Array  # (n,)


@dataclass(frozen=True)
class _Contact:
    """Closing of every contact in a pose, mm, samples first: negative where a pin or flank is open."""

    pins: Array
    meshes: Array
    joints: Array  # (n, joints, 2)


class _System:
    """Contact matrices of one reducer along its motion."""

    def __init__(self, motion: Contacts) -> None:
        reducer = motion.reducer
        self.motion, self.reducer = motion, reducer
        self.samples = motion.theta.size
        self.size = 3 + 3 * reducer.discs + 3 * reducer.cranks + 2
        self.disc = [3 + 3 * k for k in range(reducer.discs)]
        self.crank = [3 + 3 * reducer.discs + 3 * j for j in range(reducer.cranks)]
        self.sun = self.size - 2
        # a pin closes as the disc moves against the normal: rows (-n_x, -n_y, -arm) on x, y and angle of its disc
        normal = np.moveaxis(motion.pin_normal, -1, 0)
        self.pin_rows = -np.concatenate([normal, np.moveaxis(motion.pin_arm, -1, 0)[..., None]], axis=-1)
        self.mesh_rows = self._mesh_rows()
        self.joint_rows, self.joint_stiffness = self._joint_rows()
        weighted = self.joint_rows * self.joint_stiffness[:, None, None]
        self.joint_matrix = _gram(self.joint_rows, weighted)

    def _mesh_rows(self) -> Array:
        """Rows (n, cranks, flanks, size): the sun closes along n, the planet opens and turns on its base circle."""
        reducer = self.reducer
        normal = np.moveaxis(self.motion.mesh_normal, -1, 0)
        rows = np.zeros((self.samples, reducer.cranks, 2, self.size))
        rows[..., self.sun : self.sun + 2] = normal
        for j, at in enumerate(self.crank):
            rows[:, j, :, at : at + 2] = -normal[:, j]
            rows[:, j, :, at + 2] = self._base_radius * np.array([1.0, -1.0])
        return rows

    @property
    def _base_radius(self) -> float:
        return self.reducer.planet_pitch_radius * math.cos(self.reducer.pressure_angle)

    def _joint_rows(self) -> tuple[Array, Array]:
        """Rows (n, joints, xy, size) of cams (disc by crank), carrier bores, main bearing and sun support."""
        motion, reducer, stiffness = self.motion, self.reducer, self.reducer.stiffness
        bore = reducer.crank_radius * np.moveaxis(radial_and_tangential(motion.crank_position)[1], -1, 0)
        cam = reducer.eccentricity * np.moveaxis(radial_and_tangential(motion.eccentric)[1], -1, 0)
        rows, stiffnesses = [], []

        def add(k: float, parts: Sequence[tuple[int, float, Array | None]]) -> None:
            row = np.zeros((self.samples, 2, self.size))
            for at, sign, lever in parts:
                row[:, 0, at] = row[:, 1, at + 1] = sign
                if lever is not None:
                    row[:, :, at + 2] = sign * lever
            rows.append(row)
            stiffnesses.append(k)

        for k, disc in enumerate(self.disc):
            for j, crank in enumerate(self.crank):
                add(stiffness.crank_bearing, [(disc, 1, bore[:, j]), (crank, -1, cam[:, k])])
        for j, crank in enumerate(self.crank):
            add(stiffness.carrier_bearing, [(crank, 1, None), (0, -1, bore[:, j])])
        add(stiffness.main_bearing, [(0, 1, None)])
        add(stiffness.sun_support, [(self.sun, 1, None)])
        return np.stack(rows, axis=1), np.array(stiffnesses)

    def error_closing(self, effects: tuple[Effect, ...]) -> _Closing:
        """Sum the error vectors of all effects at their contacts and project them onto the action lines."""
        motion, reducer, n = self.motion, self.reducer, self.samples
        total = {
            "pin": np.zeros((reducer.discs, reducer.pins, 2, n)),
            "cam": np.zeros((reducer.discs, reducer.cranks, 2, n)),
            "carrier": np.zeros((reducer.cranks, 2, n)),
            "mesh": np.zeros((reducer.cranks, 2, 2, n)),
            "spline": np.zeros((reducer.cranks, 2, 1, n)),
            "output": np.zeros((1, n)),
        }
        clearance = dict.fromkeys(BEARINGS, 0.0)
        for effect in effects:
            error = source(effect.key).vector(motion, **effect.indices)
            if isinstance(error, Clearance):
                clearance[error.contact] += max(effect.values[0], 0.0)
                continue
            for part in error if isinstance(error, tuple) else (error,):
                for value, term in zip(effect.values, part.vector, strict=True):
                    total[part.contact][part.at] += value * term
        mesh = dot(total["mesh"], motion.mesh_normal)
        # a crank that leads its planet holds the planet back on the line of action
        mesh -= self._base_radius * np.array([1.0, -1.0])[:, None] * total["spline"][:, :, 0]
        cams, bores = reducer.discs * reducer.cranks, reducer.cranks
        joint = [total["cam"].reshape(cams, 2, n), total["carrier"], np.zeros((2, 2, n))]
        return _Closing(
            pin=np.moveaxis(dot(total["pin"], motion.pin_normal), -1, 0),
            mesh=np.moveaxis(mesh, -1, 0) - reducer.gear_backlash / 2,
            joint=np.moveaxis(np.concatenate(joint), -1, 0),
            clearance=np.repeat([clearance["cam"], clearance["carrier"], 0.0], [cams, bores, 2]),
            output=total["output"][0],
        )

    def contact(self, x: Array, error: _Closing, at: Any = slice(None)) -> _Contact:
        """Closing of every contact in the pose `x`."""
        discs = np.stack([x[:, d : d + 3] for d in self.disc], axis=1)
        return _Contact(
            np.einsum("nkid,nkd->nki", self.pin_rows[at], discs) + error.pin[at],
            np.einsum("njfd,nd->njf", self.mesh_rows[at], x) + error.mesh[at],
            np.einsum("nqcd,nd->nqc", self.joint_rows[at], x) + error.joint[at],
        )

    def bearings(self, joints: Array, error: _Closing) -> tuple[Array, Array, Array]:
        """Closing, force and stiffness matrix (n, joints, 2, 2) of each bearing; a journal floats in its clearance."""
        distance = np.sqrt((joints**2).sum(axis=2))
        safe = np.where(distance > 0, distance, 1.0)
        closing = np.maximum(distance - error.clearance, 0.0)
        along = joints / safe[..., None]
        share = np.where(error.clearance > 0, closing / safe, 1.0)[..., None, None]
        radial = along[..., :, None] * along[..., None, :]
        k = self.joint_stiffness[:, None, None]
        touching = ((closing > 0) | (error.clearance == 0))[..., None, None]
        stiffness = np.where(touching, k * (share * np.eye(2) + (1 - share) * radial), 0.0)
        return closing, self.joint_stiffness[:, None] * closing[..., None] * along, stiffness

    def stiffness_matrix(self, contact: _Contact, error: _Closing, at: Any) -> Array:
        """Stiffness of the bearings and of the contacts that are closed."""
        if error.clearance.any():
            rows = self.joint_rows[at]
            matrix = _gram(rows, np.matmul(self.bearings(contact.joints, error)[2], rows))
        else:
            matrix = self.joint_matrix[at].copy()
        stiffness = self.reducer.stiffness
        rows = self.pin_rows[at]
        for k, d in enumerate(self.disc):
            closed = stiffness.pin_contact * (contact.pins[:, k] > 0)
            matrix[:, d : d + 3, d : d + 3] += _gram(rows[:, k], rows[:, k] * closed[..., None])
        flanks = self.mesh_rows[at]
        matrix += _gram(flanks, flanks * (stiffness.gear_mesh * (contact.meshes > 0))[..., None])
        return np.asarray(matrix, dtype=np.float64)

    def gradient_and_energy(self, x: Array, error: _Closing, load: Array, at: Any) -> tuple[Array, Array, _Contact]:
        """Gradient and energy of the pose `x`, and its contacts."""
        stiffness = self.reducer.stiffness
        contact = self.contact(x, error, at)
        pins, meshes = np.maximum(contact.pins, 0), np.maximum(contact.meshes, 0)
        bearing, bearing_force, _ = self.bearings(contact.joints, error)
        gradient = np.einsum("nqcd,nqc->nd", self.joint_rows[at], bearing_force) - load[at]
        gradient += np.einsum("njfd,njf->nd", self.mesh_rows[at], stiffness.gear_mesh * meshes)
        for k, d in enumerate(self.disc):
            gradient[:, d : d + 3] += np.einsum(
                "nid,ni->nd", self.pin_rows[at][:, k], stiffness.pin_contact * pins[:, k]
            )
        energy = 0.5 * (
            stiffness.pin_contact * (pins**2).sum(axis=(1, 2))
            + stiffness.gear_mesh * (meshes**2).sum(axis=(1, 2))
            + (self.joint_stiffness * bearing**2).sum(axis=1)
        )
        return gradient, energy - np.einsum("nd,nd->n", load[at], x), contact

    def minimise(self, error: _Closing, torque: float) -> tuple[Array, int]:
        """Pose of least energy at every angle, and the Newton steps of the slowest one."""
        load = np.zeros((self.samples, self.size))
        load[:, 2] = -self.motion.direction * torque
        at = np.arange(self.samples)
        x = self._start(error, load)
        for step in range(1, _MAX_STEPS + 1):
            gradient, energy, contact = self.gradient_and_energy(x[at], error, load, at)
            open_ = np.abs(gradient).max(axis=1) > _GRADIENT_TOLERANCE * torque / self.reducer.crank_radius
            at, gradient, energy = at[open_], gradient[open_], energy[open_]
            if at.size == 0:
                return x, step
            contact = _Contact(contact.pins[open_], contact.meshes[open_], contact.joints[open_])
            descent = -_solve(self.stiffness_matrix(contact, error, at), gradient)
            x[at] += self._line_search(x[at], descent, gradient, energy, error, load, at)[:, None] * descent
        where = ", ".join(f"{math.degrees(a):.4g}" for a in self.motion.theta[at[:5]])
        raise NotConvergedError(
            f"no equilibrium after {_MAX_STEPS} steps at {at.size} of {self.samples} angles (theta = {where} deg ...); "
            "raise the torque, or check for errors far above 0.1 mm"
        )

    def _start(self, error: _Closing, load: Array) -> Array:
        """Pose in which the loaded side of all pins and flanks carries, journals at the end of their clearance."""
        motion, everywhere = self.motion, np.arange(self.samples)
        loaded = np.moveaxis(motion.pin_arm * motion.direction, -1, 0) > 0
        flank = np.stack([motion.direction > 0, motion.direction <= 0], axis=1)
        flanks = np.broadcast_to(flank[:, None], (self.samples, self.reducer.cranks, 2))
        joint = error.joint
        if error.clearance.any():
            forces = closed_form_forces(motion)
            along = [forces["cam direction"].reshape(-1, 2, self.samples), forces["carrier direction"]]
            along = [*along, np.zeros((2, 2, self.samples))]
            joint = joint - error.clearance[:, None] * np.moveaxis(np.concatenate(along), -1, 0)
        rigid = _Closing(error.pin, error.mesh, joint, np.zeros_like(error.clearance), error.output)
        sides = _Contact(np.where(loaded, 1.0, -1.0), np.where(flanks, 1.0, -1.0), joint)
        stiffness = self.reducer.stiffness
        gradient = np.einsum("nqcd,nqc->nd", self.joint_rows, self.joint_stiffness[:, None] * joint) - load
        gradient += np.einsum("njfd,njf->nd", self.mesh_rows, stiffness.gear_mesh * error.mesh * flanks)
        for k, d in enumerate(self.disc):
            pin_force = stiffness.pin_contact * error.pin[:, k] * loaded[:, k]
            gradient[:, d : d + 3] += np.einsum("nid,ni->nd", self.pin_rows[:, k], pin_force)
        return -_solve(self.stiffness_matrix(sides, rigid, everywhere), gradient)

    def _line_search(
        self, x: Array, descent: Array, gradient: Array, energy: Array, error: _Closing, load: Array, at: Any
    ) -> Array:
        """Halve each step until the energy falls; the full step is exact once no contact opens or closes."""
        length = np.ones(at.size)
        slope = (gradient * descent).sum(axis=1)
        for _ in range(40):
            _, trial, _ = self.gradient_and_energy(x + length[:, None] * descent, error, load, at)
            rising = trial > energy + 1e-4 * length * slope + 1e-12 * np.abs(energy)
            if not rising.any():
                break
            length[rising] /= 2
        return length

    def forces_per_torque(self, contact: _Contact, error: _Closing) -> ContactForces:
        """Change of the contact forces per unit of output torque with the closed contacts held closed."""
        reducer, n = self.reducer, self.samples
        unit = np.zeros((n, self.size))
        unit[:, 2] = 1
        answer = -_solve(self.stiffness_matrix(contact, error, np.arange(n)), unit)
        discs = np.stack([answer[:, d : d + 3] for d in self.disc], axis=1)
        pin = reducer.stiffness.pin_contact * (contact.pins > 0) * np.einsum("nkid,nkd->nki", self.pin_rows, discs)
        mesh = reducer.stiffness.gear_mesh * (contact.meshes > 0)
        mesh = mesh * np.einsum("njfd,nd->njf", self.mesh_rows, answer)
        _, force, stiffness = self.bearings(contact.joints, error)
        change = np.einsum("nqce,nqed,nd->nqc", stiffness, self.joint_rows, answer, optimize=True)
        change, along = np.moveaxis(change, 0, -1), unit_vectors(np.moveaxis(force, 0, -1))
        cams, bores = (reducer.discs, reducer.cranks, 2, n), (reducer.cranks, 2, n)
        last = reducer.discs * reducer.cranks
        lever = self._base_radius * np.array([1.0, -1.0])
        return {
            "pin": np.moveaxis(pin, 0, -1)[..., None, :] * self.motion.pin_normal,
            "cam": change[:last].reshape(cams),
            "cam direction": along[:last].reshape(cams),
            "carrier": change[last:-2].reshape(bores),
            "carrier direction": along[last:-2].reshape(bores),
            "mesh": np.moveaxis(mesh, 0, -1)[..., None, :] * self.motion.mesh_normal,
            "spline": -np.moveaxis(mesh * lever, 0, -1)[..., None, :],
            "output": closed_form_forces(self.motion)["output"],
        }


def _gram(rows: Array, weighted: Array) -> Array:
    """Rows transposed times weighted rows, all contact axes summed: (n, ..., size) twice to (n, size, size)."""
    n, size = rows.shape[0], rows.shape[-1]
    product = np.matmul(np.swapaxes(rows.reshape(n, -1, size), 1, 2), weighted.reshape(n, -1, size))
    return np.asarray(product, dtype=np.float64)


def _solve(matrix: Array, right: Array) -> Array:
    """Solve a stack of symmetric systems; a trace of stiffness holds what no closed contact holds.

    The trace alone would cost 3e-8 of the answer; one step of refinement takes it out of what contacts do hold.
    """
    held = matrix + 1e-12 * np.einsum("nii->ni", matrix).max(axis=1)[:, None, None] * np.eye(matrix.shape[1])
    first = np.linalg.solve(held, right[..., None])
    rest = right[..., None] - np.matmul(matrix, first)
    return np.asarray((first + np.linalg.solve(held, rest))[..., 0], dtype=np.float64)
