"""Statics of the whole gear train under load: floating parts on elastic contacts, pins and gear flanks that can open.

The pose of least energy is found by `kernel`; here are the questions that users ask of it.

Kinematics about the nominal pose is of first order in errors and displacements.  What that leaves out grows with their
square, some 0.1 arcsec rms for a dozen errors of 5 um: it comes from pins near a lobe's root, where the profile is
sharply curved.  `ContactLaw.profile_curvature` lets pins follow it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from rverror.base.arrays import Array
from rverror.base.quantities import quantities
from rverror.base.threads import each
from rverror.base.viewed import OneLine
from rverror.geartrain.action_line import BEARINGS, YIELDING, Clearance, Compliance, ContactForces, Contacts
from rverror.geartrain.contacts import motion, pose
from rverror.geartrain.kinematics import OperatingConditions, Pose
from rverror.geartrain.mechanism import ContactLaw, Mechanism, Reducer, Stiffness, check_same_geometry
from rverror.model.effects import Effect, Model, check_model
from rverror.model.readings import added, felt, stand
from rverror.model.results import Equilibrium
from rverror.statics.energy import (
    GRADIENT_TOLERANCE,
    Geometry,
    by_contact,
    flank_lever,
    loaded_problem,
    profile_tangent,
    samples_last,
    solve,
)

if TYPE_CHECKING:
    from rverror.statics.kernel import Problem, Solution

T = TypeVar("T")
R = TypeVar("R")

_NO_LOAD = 1e-10  # torque on the carrier that stands for none, of pin stiffness times pin circle radius squared


#: What else the output depends on, in the order of rows of `Prediction.softening`: the logarithm of the compliance (one
#: over the stiffness) of each kind of contact, backlash in mm, exponents of the contact law.
SOFTENING = (*quantities(Stiffness), "gear_backlash", *quantities(ContactLaw))


class NotConvergedError(RuntimeError):
    """The equilibrium was not found at some angles; the message names them."""


def each_solved(function: Callable[[T], R | None], items: Sequence[T]) -> list[R]:
    """What a function makes of each item, side by side, without those of which there is no equilibrium.

    Parameters
    ----------
    function : callable
        None is left out too.
    items : sequence
    """

    def solved(item: T) -> R | None:
        try:
            return function(item)
        except NotConvergedError:
            return None

    return [found for found in each(solved, items) if found is not None]


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
    theta : array_like, str or quantity, shape (n,) or one angle, or OperatingConditions, optional
        Nominal output angle, rad; or the conditions of a run, in place of torque, direction and time.  `Model.angles`
        where left out.
    torque : float, str, quantity, array_like or callable, optional
        Size of the output torque, N*mm; it resists the motion.  The reducer's rated torque where left out beside
        angles.  0 is the limit of a vanishing load, which still keeps the driving side closed; forces are then those
        of a trace of load.  Or the torque at each angle, or a function of the angle such as a `GravityArm`: signed,
        positive where it resists forward motion, whatever the direction; below 0 in forward motion it drives, and
        the other side carries.  Where it is 0 the side of the motion does, as the limit.
    direction : {"forward", "reverse"} or +1 or -1, or array_like of them, optional
        Read from the angles where left out.
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

    Under an arm's weight the output lags while it is lifted, and leads while it comes down:

    >>> arm = rverror.geartrain.GravityArm(mass="20 kg", lever="0.5 m")
    >>> swung = equilibrium(rverror.Model(rverror.reducer("RV-40E")), [0.0, 3.14], torque=arm, direction=1.0)
    >>> np.sign(swung.transmission_error).tolist()
    [-1.0, 1.0]
    """
    return _solved(model, theta, torque=torque, direction=direction, time=time)[1]


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
    found, state = _solved(model, theta, torque=torque, direction=direction, time=time, response=True)
    return Linearisation(state, found.contacts.motion, found.forces_per_torque())


def _solved(
    model: Model, theta: Any, *, torque: Any, direction: Any, time: Any, response: bool = False
) -> tuple[Settled, Equilibrium]:
    """Settled pose where the gear train stands when the bench reads theta, and its state as the bench reads it."""
    check_model(model)
    unit, angles = reducer_of(model.mechanism), model.angles if theta is None else theta
    if torque is None and not isinstance(angles, OperatingConditions):
        torque = unit.rated_torque
    where = stand(model, pose(unit, angles, torque=torque, direction=direction, time=time))
    found = statics_along(where.gears).settled(model.effects, response=response)
    state, read = found.equilibrium(), where.read
    return found, replace(
        state,
        # what acts beyond the contacts keeps to the bench's zero, with all that stands there
        transmission_error=state.transmission_error + added(model.effects, read),
        theta=read.theta,
        model=model,
        conditions=OperatingConditions(**{item.name: getattr(read, item.name) for item in fields(OperatingConditions)}),
    )


def statics_of(mechanism: Mechanism, conditions: OperatingConditions) -> Statics:
    """Prepare what a reducer's statics need whatever the errors are, for many solutions along one motion.

    Parameters
    ----------
    mechanism : Reducer or Drive
    conditions : OperatingConditions
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
    return statics_along(motion(mechanism, conditions))


def statics_along(where: Pose) -> Statics:
    """Statics along a reducer's motion under its torque."""
    assert isinstance(where, Contacts)
    if where.load is not None:
        return Statics(Geometry(where), where.reducer, np.abs(where.load))
    if where.torque is None:
        raise ValueError("the equilibrium needs a torque; give torque='20 N*m', or the reducer its rated_torque")
    if not where.torque >= 0:
        raise ValueError(f"torque = {where.torque / 1e3:g} N*m: must be 0 or more; the direction comes from the motion")
    return Statics(Geometry(where), where.reducer, where.torque)


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
class Statics:
    """Statics of a reducer along one motion, prepared once for many sets of errors.

    Attributes
    ----------
    contacts : Geometry
        Of the motion, whatever errors and stiffnesses are.
    reducer : Reducer
        Whose stiffness, backlash and contact law count.
    torque : float or ndarray, shape (n,)
        Size of the output torque, N*mm.
    """

    contacts: Geometry
    reducer: Reducer
    torque: float | Array

    @property
    def motion(self) -> Contacts:
        """Nominal motion."""
        return self.contacts.motion

    @property
    def idle(self) -> bool:
        """Whether the load vanishes."""
        return not np.any(self.torque)

    def problem(self, effects: tuple[Effect, ...], *, response: bool) -> Problem:
        """Equilibrium with these errors, of which those count that the contacts feel."""
        load = carried_torque(self.reducer, self.torque)
        return loaded_problem(self.contacts, self.reducer, felt(effects), load, response=response or self.idle)

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

    def settled(self, effects: tuple[Effect, ...], start: Array | None = None, *, response: bool = False) -> Settled:
        """Settled pose at every angle.

        Parameters
        ----------
        effects : tuple of Effect
        start : ndarray, shape (n, unknowns), optional
            Poses at all angles that are likely near.
        response : bool
            Whether changes per unit of output torque are wanted.

        Returns
        -------
        Settled

        Raises
        ------
        NotConvergedError
            If the equilibrium was not found at some angle.
        """
        try:
            problem = self.problem(effects, response=response)
        except ValueError as error:
            raise NotConvergedError(str(error)) from error
        solution = solve(problem, near=start, response=response or self.idle)
        check_found(solution, self.motion.theta, idle=self.idle)
        found = Settled(self.contacts, self.reducer, problem, solution)
        return found.unloaded() if self.idle else found

    def predict(self, effects: tuple[Effect, ...], start: Array | None = None) -> Prediction:
        """Turn of the output and its changes with all parameters, from one solution."""
        found = self.settled(effects, start, response=True)
        softening = np.ascontiguousarray(found.solution.softening.T)
        return Prediction(found.transmission_error, found.influences(effects), softening, found.solution.x)


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


def carried_torque(reducer: Reducer, torque: float | Array) -> float | Array:
    """Torque on the carrier under one on the output, or one at each angle, N*mm; a trace of load where that is less."""
    carried = abs(reducer.output_turn) * torque
    trace = _NO_LOAD * reducer.stiffness.pin_contact * reducer.pin_circle_radius**2
    return np.maximum(carried, trace) if isinstance(carried, np.ndarray) else carried or trace


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
class Settled(OneLine):
    """Settled pose at n angles, its contacts, and what it was found with.

    Attributes
    ----------
    contacts : Geometry
    reducer : Reducer
    problem : kernel.Problem
    solution : kernel.Solution
        What was found.
    unloading : ndarray, shape (n, unknowns), or 0
        What taking the load off adds to the pose.
    """

    contacts: Geometry
    reducer: Reducer
    problem: Problem
    solution: Solution
    unloading: Array | float = 0.0

    @property
    def x(self) -> Array:
        """Pose, mm and rad, (n, unknowns), in the layout of `energy.Layout`."""
        return self.solution.x + self.unloading

    @property
    def flank(self) -> Array:
        """Tangent stiffness of each flank, (n, 2 cranks)."""
        return self.split(self.solution.row_tangent)[0]

    @property
    def joint(self) -> Array:
        """Tangent stiffness of cams (disc by crank), carrier bores, main bearing, sun support, (n, bearings, 2, 2)."""
        own = self.split(self.solution.row_tangent)[1]
        return own[..., None] * np.eye(2) + self.solution.coupling[..., None, None] * (1 - np.eye(2))

    def split(self, rows: Array) -> tuple[Array, Array]:
        """Rows of flanks, (n, 2 cranks, ...), and of bearings, (n, bearings, 2, ...)."""
        flanks = 2 * self.reducer.cranks
        return rows[:, :flanks], rows[:, flanks:].reshape(len(rows), -1, 2, *rows.shape[2:])

    def unloaded(self) -> Settled:
        """Take the load off with the closed contacts held closed; forces and contacts stay those of the load."""
        unloading = self.problem.load[:, 2:3] / self.reducer.output_turn * self.solution.pose_change
        return replace(self, unloading=unloading)

    @property
    def transmission_error(self) -> Array:
        """Turn of the output."""
        return np.asarray(self.reducer.output_turn * self.x[:, 2], dtype=np.float64)

    def equilibrium(self) -> Equilibrium:
        """What users see of it."""
        solution, parts = self.solution, samples_last(self.x)
        bodies = parts[3:-2].reshape(-1, 3, len(self.x))
        turned = None
        if self.problem.share:  # a pin's force turns with its normal
            turned = -self.problem.share * self.contacts.curvature * solution.slides * solution.pin_force
        vectors = self._vectors(solution.pin_force, solution.row_force, turned)
        return Equilibrium(
            transmission_error=self.transmission_error,
            pose={
                "carrier": parts[:3],
                "disc": bodies[: self.reducer.discs],
                "crank": bodies[self.reducer.discs :],
                "sun": parts[-2:],
            },
            contact_forces=vectors,
            loaded_pins=(solution.pins > 0).sum(axis=2).T,
            steps=solution.steps,
            residual=GRADIENT_TOLERANCE * np.abs(solution.gradient).max(axis=1) / self.problem.tolerance,
            theta=self.contacts.motion.theta,
        )

    def _vectors(self, pins: Array, rows: Array, along: Array | None = None) -> dict[str, Array]:
        """Vectors of the driving on the driven part, samples last, from sizes at contacts and vectors of bearings.

        Pins may have a part along the profile.
        """
        where = self.contacts.motion
        sizes = {key: samples_last(one) for key, one in by_contact(self.reducer, pin=pins, row=rows).items()}
        on_pins = np.ascontiguousarray(sizes["pin"])[:, :, None] * where.pin_normal
        if along is not None:
            on_pins += samples_last(along)[:, :, None] * profile_tangent(where)
        return {
            **sizes,
            "pin": on_pins,
            "mesh": sizes["mesh"][..., None, :] * where.mesh_normal,
            "spline": -(sizes["mesh"] * flank_lever(self.reducer)[:, None])[..., None, :],
        }

    def _directions(self) -> Array:
        """Unit vectors along which bearings carry, (n, rows); 0 for flanks and where rollers behind carry, too."""
        made = np.zeros_like(self.solution.rows)
        joints, units = self.split(self.solution.rows)[1], self.split(made)[1]
        far = np.sqrt((joints**2).sum(axis=-1))
        carries = (far > 0) & (far >= -self.problem.clearance)
        units += joints * carries[..., None] / np.where(far, far, 1)[..., None]
        return made

    def _pressed_in(self) -> tuple[Array, Array]:
        """Forces on pins, and on rows, that would press linear contacts in as far as they are.

        Half of the force of a preloaded bearing, while the rollers behind carry too.
        """
        problem, flanks, rows = self.problem, 2 * self.reducer.cranks, self.solution.row_force.copy()
        both = np.linalg.norm(self.split(self.solution.rows)[1], axis=2) < -problem.clearance
        rows[:, flanks:] /= 1 + np.repeat(both, 2, axis=1)
        rows[:, :flanks] = (problem.row_stiffness * np.maximum(self.solution.rows, 0.0))[:, :flanks]
        return problem.pin_stiffness * np.maximum(self.solution.pins, 0.0), rows

    def pose_changes(self, effects: tuple[Effect, ...]) -> Array:
        """Change of the pose per parameter (n, unknowns, parameters), the closed contacts held closed.

        By virtual work a coordinate follows an error as the forces of contacts follow a load on it.  Effects that no
        contact feels change nothing.
        """
        acting, (n, size) = felt(effects), self.x.shape
        moving = np.concatenate([[one in acting] * len(one.values) for one in effects]) if effects else np.zeros(0)
        changes = np.zeros((n, size, moving.size))
        for coordinate, push in enumerate(np.eye(size)):
            alone = solve(self.problem._replace(push=push), given=self.solution.x, response=True)
            changes[:, coordinate, moving > 0] = replace(self, solution=alone).influences(acting).T
        return changes

    def forces_per_torque(self) -> ContactForces:
        """Change of the contact forces per unit of output torque with the closed contacts held closed."""
        solution, along = self.solution, by_contact(self.reducer, pin=self.solution.pins, row=self._directions())
        carried, slides = self._vectors(*self._pressed_in()), solution.slide_change if self.problem.share else None
        return {
            **self._vectors(solution.pin_change, solution.row_change, slides),
            **{f"{key} direction": samples_last(along[key]) for key in BEARINGS},
            **{f"{key} carried": carried[key] for key in YIELDING},
            "output": np.ones((1, len(solution.x))),
        }

    def influences(self, effects: tuple[Effect, ...]) -> Array:
        """Change of the output angle per parameter (parameters, n): what an effect closes times the forces there."""
        solution, rows = self.solution, [np.zeros((0, len(self.solution.x)))]
        changes = by_contact(self.reducer, pin=solution.pin_change, row=solution.row_change)
        changes["along"] = solution.slide_change
        for effect in effects:
            closings = self.contacts.closings(effect)
            if isinstance(closings, (Clearance, Compliance)):
                rows.append(self.yielding(closings))
                continue
            acting = [one for one in closings if self.problem.share or not one.slides]
            parts = [_work(one.rows, changes[one.contact][one.at]) for one in acting]
            rows.append(parts[0] if len(parts) == 1 else np.sum(parts, axis=0))
        return np.concatenate(rows)

    def yielding(self, part: Clearance | Compliance) -> Array:
        """`influences` of what lets a contact give way along its own force, and so against the motion."""
        solution = self.solution
        pins, rows = self._pressed_in() if isinstance(part, Compliance) else (solution.pins, self._directions())
        work = by_contact(self.reducer, pin=solution.pin_change * pins, row=solution.row_change * rows)[part.contact]
        here = samples_last(work.sum(axis=-1) if part.contact in BEARINGS else work)
        share, at = (part.share, part.at) if isinstance(part, Compliance) else (np.ones((1, *[1] * here.ndim)), ())
        return np.asarray(-np.sum(share * here[at], axis=tuple(range(1, here.ndim))))


def _work(rows: Array, forces: Array) -> Array:
    """Work of forces at contacts, (n, ...), by one unit of each parameter, (terms, n)."""
    axes = "abc"[: forces.ndim - 1]
    return np.asarray(np.einsum(f"tn{axes},n{axes}->tn", rows, forces))
