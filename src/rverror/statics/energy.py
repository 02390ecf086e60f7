"""The equilibrium of a loaded gear train, made ready for `kernel`: unknowns, contacts, what errors close at them.

Carrier, discs, cranks (x, y, angle each) and sun (x, y) take the pose of least energy.  The closing of a pin, of a
flank and of each component of a bearing is J_c x + e_c: J_c holds the action lines of the nominal pose, e_c the same
error vectors as in the closed form.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array, cross, radial_and_tangential
from rverror.base.threads import each_part
from rverror.geartrain.action_line import (
    BEARINGS,
    Clearance,
    Compliance,
    Contacts,
    Displacement,
    SourceVector,
)
from rverror.geartrain.cycloid import pin_positions, trochoid_curvature
from rverror.geartrain.mechanism import REFERENCE_FORCE, Reducer
from rverror.model.catalogue import source
from rverror.model.effects import Effect
from rverror.statics.elasticity import elasticity

if TYPE_CHECKING:  # numba takes a while to import: the kernel is fetched when it is first needed
    from rverror.statics.kernel import Problem, Solution

Integers = npt.NDArray[np.intp]
Flags = npt.NDArray[np.bool_]

GRADIENT_TOLERANCE = 1e-9  # of the applied torque
_MAX_STEPS = 40
_MAX_STEPS_NEAR = 10  # from a pose that is likely near
_MAX_STEPS_UNLOADING = 2000  # at each load; each few lower a convex energy, so only time runs out
_FULL_LOAD = 5e-4  # torque at which all contacts settle easily, of pin stiffness times pin circle radius squared


@dataclass(frozen=True)
class Errors:
    """What the errors close at each contact, mm, samples first."""

    pin: Array  # (n, discs, pins)
    along: Array  # (n, discs, pins), by which pins move along the discs' profiles
    row: Array  # (n, rows): flanks, and x and y of bearings
    clearance: Array  # (bearings,); below 0 an interference
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
    rows : ndarray, shape (terms, n, axes of the contact but for the xy of pins and flanks)
        mm per mm or rad.
    """

    contact: str
    at: tuple[slice, ...]
    rows: Array

    def total(self, sizes: tuple[float, ...]) -> Array:
        """How far an effect of these sizes closes them, mm, (n, ...)."""
        rows = self.rows
        return (np.array(sizes) @ rows.reshape(len(rows), -1)).reshape(rows.shape[1:])

    def work(self, forces: Array) -> Array:
        """Work of forces of all these contacts, (n, ...), by one unit of each parameter, (terms, n)."""
        here = forces[(slice(None), *self.at)]
        axes = "abc"[: here.ndim - 1]
        return np.asarray(np.einsum(f"tn{axes},n{axes}->tn", self.rows, here))


def by_contact(reducer: Reducer, *, pin: Array, along: Array, row: Array) -> dict[str, Array]:
    """Views of arrays of all contacts, samples first, by the contact that a `Closing` names.

    Parameters
    ----------
    reducer : Reducer
    pin, along : ndarray, shape (n, discs, pins)
    row : ndarray, shape (n, rows)
        Of flanks, and of x and y of bearings.

    Returns
    -------
    dict of str to ndarray
    """
    n, discs, cranks = len(pin), reducer.discs, reducer.cranks
    cam, carrier = 2 * cranks, 2 * cranks + 2 * discs * cranks
    return {
        "pin": pin,
        "along": along,
        "mesh": row[:, :cam].reshape(n, cranks, 2),
        "cam": row[:, cam:carrier].reshape(n, discs, cranks, 2),
        "carrier": row[:, carrier:-4].reshape(n, cranks, 2),
    }


def error_closing(contacts: Geometry, effects: tuple[Effect, ...], *, slides: bool = True) -> Errors:
    """Sum what effects close at the contacts along the action lines, and how they move pins along the profiles.

    Parameters
    ----------
    contacts : Geometry
    effects : tuple of Effect
    slides : bool
        Whether it counts how far pins move along the profiles; else that is left at 0.

    Returns
    -------
    Errors
    """
    reducer, n = contacts.motion.reducer, contacts.motion.theta.size
    discs, cranks = reducer.discs, reducer.cranks
    made = {
        "pin": np.zeros((n, discs, reducer.pins)),
        "along": np.zeros((n, discs, reducer.pins)),
        "row": np.zeros((n, len(contacts.columns))),
    }
    total = by_contact(reducer, **made)
    clearance = dict.fromkeys(BEARINGS, 0.0)
    softer: dict[str, Array] = {}
    for effect in effects:
        closings = contacts.closings(effect)
        if isinstance(closings, Clearance):
            clearance[closings.contact] += max(effect.values[0], 0.0)
            continue
        if isinstance(closings, Compliance):
            shape = total[closings.contact].shape
            if closings.contact in BEARINGS:
                shape = shape[:-1]  # alike in x and y
            more = softer.setdefault(closings.contact, np.zeros(shape))
            more[(slice(None), *closings.at)] += samples_first(np.tensordot(effect.values, closings.share, axes=1))
            continue
        for one in (*closings, *(contacts.slides(effect) if slides else ())):
            total[one.contact][(slice(None), *one.at)] += one.total(effect.values)
    return Errors(
        **made,
        clearance=np.repeat([clearance["cam"], clearance["carrier"], 0.0], [discs * cranks, cranks, 2]),
        compliance={contact: more if contact == "pin" else more.reshape(n, -1) for contact, more in softer.items()},
    )


def preloaded(errors: Errors, reducer: Reducer) -> Errors:
    """Errors whose clearances are less by the preload of a reducer's bearings."""
    cams, preload = reducer.discs * reducer.cranks, reducer.bearing_preload
    pressed = np.repeat([preload.crank_bearing, preload.carrier_bearing, 0.0], [cams, reducer.cranks, 2])
    return replace(errors, clearance=errors.clearance - pressed) if pressed.any() else errors


def samples_first(row: Array) -> Array:
    """What has its samples last, as everything outside the statics, with its samples first, as one angle needs it."""
    return np.ascontiguousarray(np.moveaxis(row, -1, 0))


def samples_last(row: Array) -> Array:
    """Undo `samples_first`."""
    return np.moveaxis(row, 0, -1)


class Layout:
    """Where each part stands in the pose."""

    def __init__(self, reducer: Reducer) -> None:
        """Count x, y and angle of each part, x and y of the sun."""
        self.disc = [3 + 3 * k for k in range(reducer.discs)]
        self.crank = [3 + 3 * (reducer.discs + j) for j in range(reducer.cranks)]
        self.sun = 3 + 3 * (reducer.discs + reducer.cranks)
        self.size = self.sun + 2


@dataclass(frozen=True)
class Geometry:
    """What errors leave as it is at n angles: how far each contact closes with the pose."""

    motion: Contacts

    @cached_property
    def pin_rows(self) -> Array:
        """How each pin closes with x, y and angle of its disc, which moves against the normal, (n, discs, 3, pins)."""
        motion = self.motion
        discs, pins, _, n = motion.pin_normal.shape
        rows = np.empty((n, discs, 3, pins))
        np.negative(motion.pin_normal.transpose(3, 0, 2, 1), out=rows[:, :, :2])
        np.negative(motion.pin_arm.transpose(2, 0, 1), out=rows[:, :, 2])
        return rows

    @cached_property
    def profile_lever(self) -> Array:
        """How far each pin moves along its disc's profile with the disc's angle, mm, (n, discs, pins)."""
        motion = self.motion
        pins, _ = radial_and_tangential(pin_positions(motion.reducer)[:, None])
        eccentric, _ = motion.eccentric_directions
        arm = motion.reducer.pin_circle_radius * pins - motion.reducer.eccentricity * eccentric[:, None]
        return -samples_first(cross(arm, self.profile_tangent))

    @cached_property
    def curvature(self) -> Array:
        """Curvature of the trochoid on which each pin's centre stands, 1/mm, (n, discs, pins)."""
        motion = self.motion
        lead = motion.eccentric[:, None] - pin_positions(motion.reducer)[:, None]
        return samples_first(trochoid_curvature(motion.reducer, lead))

    @cached_property
    def profile_tangent(self) -> Array:
        """Along each profile, a quarter turn ahead of the normal, (discs, pins, 2, n)."""
        normal = self.motion.pin_normal
        return np.stack([-normal[:, :, 1], normal[:, :, 0]], axis=2)

    @cached_property
    def _sparse(self) -> tuple[Array, Integers]:
        """Rows of flanks and bearings: entries (n, rows, width) and their columns (rows, width), the last ones first.

        A flank closes as the sun moves along its normal and the planet against it, and as the planet turns on its base
        circle; a bearing as its first part moves against its second.
        """
        motion = self.motion
        reducer, layout = motion.reducer, Layout(motion.reducer)
        bore = reducer.crank_radius * motion.crank_directions[1]
        cam = reducer.eccentricity * motion.eccentric_directions[1]
        made: list[dict[int, Any]] = []
        for j, at in enumerate(layout.crank):
            for (x, y), lever in zip(motion.mesh_normal[j], flank_lever(reducer), strict=True):
                made.append({layout.sun: x, layout.sun + 1: y, at: -x, at + 1: -y, at + 2: lever})
        pairs: list[tuple[int, Array | None, int | None, Array | None]] = [
            (disc, bore[j], crank, cam[k]) for k, disc in enumerate(layout.disc) for j, crank in enumerate(layout.crank)
        ]
        pairs += [(crank, None, 0, bore[j]) for j, crank in enumerate(layout.crank)]
        # the motor, whose bearings hold the sun, stands on what is held
        pairs += [(0, None, None, None), (layout.sun, None, 0 if reducer.held == "carrier" else None, None)]
        for one, arm, other, lever in pairs:
            for side in range(2):
                row: dict[int, Any] = {one + side: 1.0}
                if arm is not None:
                    row[one + 2] = arm[side]
                if other is not None:
                    row[other + side] = -1.0
                if other is not None and lever is not None:
                    row[other + 2] = -lever[side]
                made.append(row)
        width = max(map(len, made))
        entries, columns = np.zeros((motion.theta.size, len(made), width)), np.empty((len(made), width), dtype=np.intp)
        for r, row in enumerate(made):
            columns[r] = min(row)  # of entries that are none
            for w, at in enumerate(sorted(row, reverse=True)):
                entries[:, r, w], columns[r, w] = row[at], at
        return entries, columns

    @property
    def rows(self) -> Array:
        """How flanks (two of each crank) and bearings (x and y of each) close with the pose, (n, rows, width)."""
        return self._sparse[0]

    @property
    def columns(self) -> Integers:
        """Unknowns to which the entries of the rows belong, (rows, width)."""
        return self._sparse[1]

    @cached_property
    def envelope(self) -> Integers:
        """First column of each row of the stiffness matrix's lower triangle that is not empty, (unknowns,)."""
        layout, flanks = Layout(self.motion.reducer), 2 * self.motion.reducer.cranks
        first, bearings = np.arange(layout.size), self.columns[flanks:].reshape(-1, 2 * self.columns.shape[1])
        discs = [np.arange(at, at + 3) for at in layout.disc]
        for together in (*self.columns[:flanks], *bearings, *discs):
            first[together] = np.minimum(first[together], together.min())
        return first

    @cached_property
    def whole_rows(self) -> Array:
        """The rows with all unknowns, (n, rows, unknowns)."""
        which = self.columns[..., None] == np.arange(Layout(self.motion.reducer).size)
        return np.asarray(np.einsum("nrw,rwc->nrc", self.rows, which.astype(np.float64)))

    @property
    def flank_rows(self) -> Array:
        """How each flank closes with all unknowns, (n, 2 cranks, unknowns)."""
        return self.whole_rows[:, : 2 * self.motion.reducer.cranks]

    @property
    def joint_rows(self) -> Array:
        """How x and y of each bearing close with all unknowns, (n, bearings, 2, unknowns)."""
        rows = self.whole_rows[:, 2 * self.motion.reducer.cranks :]
        return rows.reshape(len(rows), -1, 2, rows.shape[2])

    @cached_property
    def output_turn(self) -> float:
        """Turn of the output per turn of the carrier."""
        return self.motion.reducer.output_turn

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
        return tuple(self._across(part) for part in (error if isinstance(error, tuple) else (error,)))

    def slides(self, effect: Effect) -> tuple[Closing, ...]:
        """How it moves pins along the profiles, made once."""
        name = (effect.key, *sorted(effect.indices.items()))
        if name not in self._slides:
            error = self.error(effect)
            parts = (
                () if isinstance(error, (Clearance, Compliance)) else error if isinstance(error, tuple) else (error,)
            )
            on_pins = [part for part in parts if part.contact == "pin"]
            self._slides[name] = tuple(
                _closing("along", part.at, part.along(self.profile_tangent[part.at])) for part in on_pins
            )
        return self._slides[name]

    def _across(self, error: Displacement) -> Closing:
        """Projection of an error vector onto the action lines of its contacts."""
        if error.contact in BEARINGS:
            return _closing(error.contact, error.at, error.vector)
        if error.contact == "spline":
            # a crank that leads its planet holds the planet back on the line of action
            reducer = self.motion.reducer
            lever = np.broadcast_to(flank_lever(reducer)[:, None], (reducer.cranks, 2, 1))
            return _closing("mesh", error.at, -lever[error.at] * error.vector[..., 0, :])
        normal = self.motion.pin_normal if error.contact == "pin" else self.motion.mesh_normal
        return _closing(error.contact, error.at, error.along(normal[error.at]))

    @cached_property
    def _errors(self) -> dict[tuple[Any, ...], SourceVector]:
        return {}

    @cached_property
    def _slides(self) -> dict[tuple[Any, ...], tuple[Closing, ...]]:
        return {}

    @cached_property
    def _closings(self) -> dict[tuple[Any, ...], tuple[Closing, ...] | Clearance | Compliance]:
        return {}


def _closing(contact: str, at: tuple[slice, ...], rows: Array) -> Closing:
    """From rows that have their samples last."""
    return Closing(contact, at, np.ascontiguousarray(np.moveaxis(rows, -1, 1)))


def flank_lever(reducer: Reducer) -> Array:
    """Lever of the planet's turn on each flank: its base circle."""
    return reducer.planet_pitch_radius * math.cos(reducer.pressure_angle) * np.array([1.0, -1.0])


# --- the problem and its solution -------------------------------------------------------------------------------------


def loaded_problem(
    contacts: Geometry, reducer: Reducer, errors: Errors, torque: float, *, response: bool = True
) -> Problem:
    """The equilibrium of a gear train with errors; a torque on the carrier resists its motion in the housing.

    Parameters
    ----------
    contacts : Geometry
        Its own reducer says where things are.
    reducer : Reducer
        Whose stiffness, backlash and contact law count.
    errors : Errors
    torque : float
        Its size, N*mm, above 0.
    response : bool
        Whether a response will be asked for, which needs to know how the profiles bend.

    Returns
    -------
    Problem

    Raises
    ------
    ValueError
        If a compliance makes some contact stiffer than rigid.
    """
    from rverror.statics.kernel import Problem

    layout, stiff, sense = Layout(reducer), elasticity(reducer, errors.compliance), contacts.motion.sense
    load = np.zeros((sense.size, layout.size))
    load[:, 2] = -sense * torque
    stiffness, law = reducer.stiffness, reducer.contact_law
    bends, straight = response or law.profile_curvature > 0, np.zeros((1, reducer.discs, reducer.pins))
    full = _FULL_LOAD * stiffness.pin_contact * reducer.pin_circle_radius**2
    kinds = [1] * reducer.discs * reducer.cranks + [2] * reducer.cranks + [5, 4]
    return Problem(
        pin_rows=contacts.pin_rows,
        profile_lever=contacts.profile_lever if bends else straight,
        curvature=contacts.curvature if bends else straight,
        rows=contacts.rows,
        columns=contacts.columns,
        envelope=contacts.envelope,
        pin_error=errors.pin,
        slide_error=errors.along,
        row_error=errors.row - np.repeat([reducer.gear_backlash / 2, 0.0], [2 * reducer.cranks, 2 * len(kinds)]),
        clearance=errors.clearance,
        pin_stiffness=stiff.pin,
        flank_stiffness=stiff.flank,
        bearing_stiffness=stiff.bearing,
        kind=np.array(kinds),
        declared=np.array([getattr(stiffness, item.name) for item in fields(stiffness)]),
        pin_exponent=float(law.pin_exponent),
        flank_exponent=float(law.flank_exponent),
        reference_force=REFERENCE_FORCE,
        share=float(law.profile_curvature),
        load=load,
        sense=sense,
        output_turn=contacts.output_turn,
        longest=reducer.eccentricity,
        tolerance=GRADIENT_TOLERANCE * torque / reducer.crank_radius,
        heavy=full / torque,
        most_near=_MAX_STEPS_NEAR,
        most_cold=_MAX_STEPS,
        most_unloading=_MAX_STEPS_UNLOADING,
    )


def solve(
    problem: Problem,
    *,
    near: Array | None = None,
    given: Array | None = None,
    forces: bool = False,
    matrix: bool = False,
    response: bool = False,
) -> Solution:
    """Pose of least energy at every angle, and what is asked of it.

    Parameters
    ----------
    problem : Problem
    near : ndarray, shape (n, unknowns), optional
        Poses that are likely near.
    given : ndarray, shape (n, unknowns), optional
        Poses whose contacts are asked for, in place of those of least energy.
    forces, matrix, response : bool
        Whether to find forces, the matrix beside them, and changes per unit of output torque.

    Returns
    -------
    Solution
        Groups that were not asked for are empty.
    """
    from rverror.statics import kernel

    (n, size), pins = problem.load.shape, problem.pin_error.shape[1:]
    rows, bearings = (problem.row_error.shape[1],), problem.clearance.shape
    stated, whole, changed = (n if wanted else 0 for wanted in (forces or matrix, matrix, response))
    start = kernel.GIVEN if given is not None else kernel.COLD if near is None else kernel.NEAR
    first = near if given is None else given
    made: list[npt.NDArray[Any]] = [
        np.empty((n, size)) if first is None else np.array(first, dtype=np.float64, order="C"),
        np.empty(n, dtype=np.intp),
        np.empty(n, dtype=np.bool_),
        np.empty((n, *pins)),
        np.zeros((n, *pins)),
        *(np.empty((n, *shape)) for shape in (rows, rows)),
        *(np.empty((stated, *shape)) for shape in (pins, pins, rows, bearings, (), (size,), ())),
        np.empty((whole, size, size)),
        *(np.empty((changed, *shape)) for shape in (pins, pins, rows, (size,), (10,))),
    ]

    def some(part: slice) -> None:
        own = kernel.Solution._make(one[part] for one in made)
        kernel.solve(part_of(problem, part), start, own, kernel.scratch(problem))

    each_part(some, n, kernel.BLOCK)
    return kernel.Solution._make(made)


_PER_ANGLE = frozenset(
    {
        "pin_rows", "profile_lever", "curvature", "rows", "pin_error", "slide_error", "row_error", "pin_stiffness",
        "flank_stiffness", "bearing_stiffness", "load", "sense",
    }
)  # fmt: skip


def part_of(problem: Problem, part: slice | Integers) -> Problem:
    """The same at some of the angles."""
    n = len(problem.load)
    if isinstance(part, slice) and part == slice(0, n):
        return problem
    rows = {name: getattr(problem, name) for name in _PER_ANGLE}
    return problem._replace(**{name: row[part] for name, row in rows.items() if len(row) == n})


# --- stacks of linear equations ---------------------------------------------------------------------------------------


def with_discs(matrix: Array, blocks: Array, first: int) -> Array:
    """A stiffness with more of each disc, (n, discs, 3, 3), whose columns begin at the first."""
    total = matrix.copy()
    for k in range(blocks.shape[1]):
        at = slice(first + 3 * k, first + 3 * k + 3)
        total[:, at, at] += blocks[:, k]
    return total


def held(matrix: Array) -> Array:
    """Stiffness with a trace more, which holds what no closed contact holds."""
    own = np.einsum("nii->ni", matrix)
    trace = 1e-12 * np.maximum(own, 1e-9 * own.max(axis=1, keepdims=True))  # each in its own unit
    return np.asarray(matrix + trace[:, :, None] * np.eye(matrix.shape[1]), dtype=np.float64)


def refined(matrix: Array, right: Array) -> Array:
    """Answers to a stack of systems, held, less what the trace costs, some 1e-8, by one step of refinement.

    Parameters
    ----------
    matrix : ndarray, shape (n, size, size)
    right : ndarray, shape (n, size) or (n, size, columns)

    Returns
    -------
    ndarray, of the shape of the right-hand sides
    """
    columns = right.reshape(*right.shape[:2], -1)
    inverse = np.linalg.inv(held(matrix))
    first = inverse @ columns
    return np.asarray((first + inverse @ (columns - matrix @ first)).reshape(right.shape), dtype=np.float64)
