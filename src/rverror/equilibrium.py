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
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rverror import units
from rverror.action_line import Array, ContactForces, Contacts, dot, radial_and_tangential
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
    angle = x[:, 2] + closing.output
    pins, meshes = system.closing_of(x, closing)
    forces = system.forces_per_torque(pins > 0, meshes > 0)
    return Equilibrium(angle, forces, (pins > 0).sum(axis=2).T, steps)


@dataclass(frozen=True)
class _Closing:
    """What the errors close at each contact, mm, samples first; `output` is what sensors add, rad."""

    pin: Array  # (n, discs, pins)
    mesh: Array  # (n, cranks, 2)
    joint: Array  # (n, joints), elastic joints that cannot open
    output: Array  # (n,)


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
        weighted = self.joint_rows * self.joint_stiffness[:, None]
        self.joint_matrix = np.matmul(np.swapaxes(self.joint_rows, 1, 2), weighted)

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
        """Rows of the elastic joints: cams (disc, crank, xy), carrier bores (crank, xy), main bearing, sun support."""
        motion, reducer, stiffness = self.motion, self.reducer, self.reducer.stiffness
        bore = reducer.crank_radius * np.moveaxis(radial_and_tangential(motion.crank_position)[1], -1, 0)
        cam = reducer.eccentricity * np.moveaxis(radial_and_tangential(motion.eccentric)[1], -1, 0)
        rows, stiffnesses = [], []

        def add(k: float) -> Array:
            row = np.zeros((self.samples, self.size))
            rows.append(row)
            stiffnesses.append(k)
            return row

        for k, disc in enumerate(self.disc):
            for j, crank in enumerate(self.crank):
                for xy in range(2):
                    row = add(stiffness.crank_bearing)
                    row[:, disc + xy], row[:, disc + 2] = 1, bore[:, j, xy]
                    row[:, crank + xy], row[:, crank + 2] = -1, -cam[:, k, xy]
        for j, crank in enumerate(self.crank):
            for xy in range(2):
                row = add(stiffness.carrier_bearing)
                row[:, crank + xy], row[:, xy], row[:, 2] = 1, -1, -bore[:, j, xy]
        for at, support in ((0, stiffness.main_bearing), (self.sun, stiffness.sun_support)):
            for xy in range(2):
                add(support)[:, at + xy] = 1
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
        for effect in effects:
            error = source(effect.key).vector(motion, **effect.indices)
            for value, term in zip(effect.values, error.vector, strict=True):
                total[error.contact][error.at] += value * term
        mesh = dot(total["mesh"], motion.mesh_normal)
        # a crank that leads its planet holds the planet back on the line of action
        mesh -= self._base_radius * np.array([1.0, -1.0])[:, None] * total["spline"][:, :, 0]
        joint = np.concatenate([total["cam"].reshape(-1, n), total["carrier"].reshape(-1, n), np.zeros((4, n))])
        return _Closing(
            pin=np.moveaxis(dot(total["pin"], motion.pin_normal), -1, 0),
            mesh=np.moveaxis(mesh, -1, 0) - reducer.gear_backlash / 2,
            joint=joint.T,
            output=total["output"][0],
        )

    def closing_of(self, x: Array, error: _Closing, at: Any = slice(None)) -> tuple[Array, Array]:
        """Closing of pins and of gear flanks in the pose `x`, mm."""
        discs = np.stack([x[:, d : d + 3] for d in self.disc], axis=1)
        pins = np.einsum("nkid,nkd->nki", self.pin_rows[at], discs) + error.pin[at]
        meshes = np.einsum("njfd,nd->njf", self.mesh_rows[at], x) + error.mesh[at]
        return pins, meshes

    def stiffness_matrix(self, pins: npt.NDArray[np.bool_], meshes: npt.NDArray[np.bool_], at: Any) -> Array:
        """Stiffness of the joints and of the contacts that are closed."""
        matrix = self.joint_matrix[at].copy()
        rows = self.pin_rows[at]
        for k, d in enumerate(self.disc):
            closed = rows[:, k] * (self.reducer.stiffness.pin_contact * pins[:, k])[..., None]
            matrix[:, d : d + 3, d : d + 3] += np.matmul(np.swapaxes(rows[:, k], 1, 2), closed)
        flanks = self.mesh_rows[at].reshape(matrix.shape[0], -1, self.size)
        closed = flanks * (self.reducer.stiffness.gear_mesh * meshes.reshape(matrix.shape[0], -1))[..., None]
        matrix += np.matmul(np.swapaxes(flanks, 1, 2), closed)
        return np.asarray(matrix, dtype=np.float64)

    def gradient_and_energy(self, x: Array, error: _Closing, load: Array, at: Any) -> tuple[Array, Array, Array, Array]:
        """Gradient and energy of the pose `x`, and the closing of pins and flanks."""
        stiffness = self.reducer.stiffness
        pins, meshes = self.closing_of(x, error, at)
        pin_force = stiffness.pin_contact * np.maximum(pins, 0)
        mesh_force = stiffness.gear_mesh * np.maximum(meshes, 0)
        joint = np.einsum("ncd,nd->nc", self.joint_rows[at], x) + error.joint[at]
        joint_force = self.joint_stiffness * joint
        gradient = np.einsum("ncd,nc->nd", self.joint_rows[at], joint_force) - load[at]
        gradient += np.einsum("njfd,njf->nd", self.mesh_rows[at], mesh_force)
        for k, d in enumerate(self.disc):
            gradient[:, d : d + 3] += np.einsum("nid,ni->nd", self.pin_rows[at][:, k], pin_force[:, k])
        energy = 0.5 * (
            (pin_force * np.maximum(pins, 0)).sum(axis=(1, 2))
            + (mesh_force * np.maximum(meshes, 0)).sum(axis=(1, 2))
            + (joint_force * joint).sum(axis=1)
        )
        return gradient, energy - np.einsum("nd,nd->n", load[at], x), pins, meshes

    def minimise(self, error: _Closing, torque: float) -> tuple[Array, int]:
        """Pose of least energy at every angle, and the Newton steps of the slowest one."""
        load = np.zeros((self.samples, self.size))
        load[:, 2] = -self.motion.direction * torque
        # start from the pose in which the loaded side of all pins and flanks carries, as the closed form has it
        arms = np.moveaxis(self.motion.pin_arm * self.motion.direction, -1, 0)
        flank = np.stack([self.motion.direction > 0, self.motion.direction <= 0], axis=1)
        flanks = np.broadcast_to(flank[:, None], (self.samples, self.reducer.cranks, 2))
        everywhere = np.arange(self.samples)
        x = np.zeros((self.samples, self.size))
        start = _Closing(error.pin * (arms > 0), error.mesh * flanks, error.joint, error.output)
        gradient = np.einsum("ncd,nc->nd", self.joint_rows, self.joint_stiffness * start.joint) - load
        gradient += np.einsum("njfd,njf->nd", self.mesh_rows, self.reducer.stiffness.gear_mesh * start.mesh)
        for k, d in enumerate(self.disc):
            pin_force = self.reducer.stiffness.pin_contact * start.pin[:, k]
            gradient[:, d : d + 3] += np.einsum("nid,ni->nd", self.pin_rows[:, k], pin_force)
        x = x - _solve(self.stiffness_matrix(arms > 0, flanks, everywhere), gradient)

        at = everywhere
        for step in range(1, _MAX_STEPS + 1):
            gradient, energy, pins, meshes = self.gradient_and_energy(x[at], error, load, at)
            open_ = np.abs(gradient).max(axis=1) > _GRADIENT_TOLERANCE * torque / self.reducer.crank_radius
            at, gradient, energy = at[open_], gradient[open_], energy[open_]
            if at.size == 0:
                return x, step
            descent = -_solve(self.stiffness_matrix(pins[open_] > 0, meshes[open_] > 0, at), gradient)
            x[at] += self._line_search(x[at], descent, gradient, energy, error, load, at)[:, None] * descent
        where = ", ".join(f"{math.degrees(a):.4g}" for a in self.motion.theta[at[:5]])
        raise NotConvergedError(
            f"no equilibrium after {_MAX_STEPS} steps at {at.size} of {self.samples} angles (theta = {where} deg ...); "
            "raise the torque, or check for errors far above 0.1 mm"
        )

    def _line_search(
        self, x: Array, descent: Array, gradient: Array, energy: Array, error: _Closing, load: Array, at: Any
    ) -> Array:
        """Halve each step until the energy falls; the full step is exact once no contact opens or closes."""
        length = np.ones(at.size)
        slope = (gradient * descent).sum(axis=1)
        for _ in range(40):
            _, trial, _, _ = self.gradient_and_energy(x + length[:, None] * descent, error, load, at)
            rising = trial > energy + 1e-4 * length * slope + 1e-12 * np.abs(energy)
            if not rising.any():
                break
            length[rising] /= 2
        return length

    def forces_per_torque(self, pins: npt.NDArray[np.bool_], meshes: npt.NDArray[np.bool_]) -> ContactForces:
        """Change of the contact forces per unit of output torque with the closed contacts held closed."""
        reducer, n = self.reducer, self.samples
        unit = np.zeros((n, self.size))
        unit[:, 2] = 1
        answer = -_solve(self.stiffness_matrix(pins, meshes, np.arange(n)), unit)
        discs = np.stack([answer[:, d : d + 3] for d in self.disc], axis=1)
        pin = reducer.stiffness.pin_contact * pins * np.einsum("nkid,nkd->nki", self.pin_rows, discs)
        mesh = reducer.stiffness.gear_mesh * meshes * np.einsum("njfd,nd->njf", self.mesh_rows, answer)
        joint = (self.joint_stiffness * np.einsum("ncd,nd->nc", self.joint_rows, answer)).T
        cams = 2 * reducer.discs * reducer.cranks
        lever = self._base_radius * np.array([1.0, -1.0])
        return {
            "pin": np.moveaxis(pin, 0, -1)[..., None, :] * self.motion.pin_normal,
            "cam": joint[:cams].reshape(reducer.discs, reducer.cranks, 2, n),
            "carrier": joint[cams : cams + 2 * reducer.cranks].reshape(reducer.cranks, 2, n),
            "mesh": np.moveaxis(mesh, 0, -1)[..., None, :] * self.motion.mesh_normal,
            "spline": -np.moveaxis(mesh * lever, 0, -1)[..., None, :],
            "output": closed_form_forces(self.motion)["output"],
        }


def _solve(matrix: Array, right: Array) -> Array:
    """Solve a stack of symmetric systems; a trace of stiffness holds what no closed contact holds.

    The trace alone would cost 3e-8 of the answer; one step of refinement takes it out of what contacts do hold.
    """
    held = matrix + 1e-12 * np.einsum("nii->ni", matrix).max(axis=1)[:, None, None] * np.eye(matrix.shape[1])
    first = np.linalg.solve(held, right[..., None])
    rest = right[..., None] - np.matmul(matrix, first)
    return np.asarray((first + np.linalg.solve(held, rest))[..., 0], dtype=np.float64)
