"""The equilibrium of a loaded gear train, made ready for `kernel`: unknowns, contacts, what errors close at them.

Carrier, discs, cranks (x, y, angle each) and sun (x, y) take the pose of least energy.  The closing of a pin, of a
flank and of each component of a bearing is J_c x + e_c: J_c holds the action lines of the nominal pose, e_c the same
error vectors as in the closed form.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array, Integers, cross, radial_and_tangential
from rverror.base.threads import each_part
from rverror.geartrain.action_line import BEARINGS, YIELDING, Clearance, Compliance, Contacts, Displacement
from rverror.geartrain.cycloid import pin_positions, roll_angles, trochoid_curvature
from rverror.geartrain.mechanism import REFERENCE_FORCE, Reducer
from rverror.model.catalogue import source
from rverror.model.effects import Effect

if TYPE_CHECKING:  # numba takes a while to import: the kernel is fetched when it is first needed
    from rverror.statics.kernel import Problem, Solution


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
    clearance: dict[str, float]  # of each of `BEARINGS`
    pin_compliance: Array  # (n or 1, discs, pins), mm/N more than nominal
    row_compliance: Array  # (n or 1, rows)


@dataclass(frozen=True)
class Closing:
    """What one unit of each parameter of an error closes, mm per mm or rad, (terms, n, axes of its contact).

    Attributes
    ----------
    motion : Contacts
    error : ErrorVector, ErrorWaves or ErrorSpots
    slides : bool
        Whether pins are meant not into the disc, but along its profile.
    """

    motion: Contacts
    error: Displacement
    slides: bool = False

    @property
    def contact(self) -> str:
        """What it closes: a crank that leads its planet holds the planet back on the line of action."""
        return "along" if self.slides else "mesh" if self.error.contact == "spline" else self.error.contact

    @property
    def at(self) -> tuple[slice, ...]:
        """Which of these contacts, all samples first."""
        return (slice(None), *self.error.at)

    @cached_property
    def rows(self) -> Array:
        """Along the action lines of its contacts; both components at bearings."""
        error, reducer = self.error, self.motion.reducer
        if error.contact in BEARINGS:
            return samples_first(error.vector, behind=1)
        if error.contact == "spline":
            lever = np.broadcast_to(flank_lever(reducer)[:, None], (reducer.cranks, 2, 1))
            return samples_first(-lever[error.at] * error.vector[..., 0, :], behind=1)
        pin_direction = profile_tangent(self.motion) if self.slides else self.motion.pin_normal
        direction = pin_direction if error.contact == "pin" else self.motion.mesh_normal
        return samples_first(error.along(direction[error.at]), behind=1)


def by_contact(reducer: Reducer, *, pin: Array, row: Array) -> dict[str, Array]:
    """Views of arrays of all contacts, samples first, by the contact that a `Closing` names, but ways along profiles.

    Parameters
    ----------
    reducer : Reducer
    pin : ndarray, shape (n, discs, pins)
    row : ndarray, shape (n, rows)
        Of flanks, and of x and y of bearings.

    Returns
    -------
    dict of str to ndarray
    """
    n, discs, cranks = len(row), reducer.discs, reducer.cranks
    cam, carrier = 2 * cranks, 2 * cranks + 2 * discs * cranks
    return {
        "pin": pin,
        "mesh": row[:, :cam].reshape(n, cranks, 2),
        "cam": row[:, cam:carrier].reshape(n, discs, cranks, 2),
        "carrier": row[:, carrier:-4].reshape(n, cranks, 2),
    }


def error_closing(contacts: Geometry, effects: Sequence[Effect], *, slides: bool = True) -> Errors:
    """Sum what effects close at the contacts along the action lines, and how they move pins along the profiles.

    Parameters
    ----------
    contacts : Geometry
    effects : sequence of Effect
    slides : bool
        Whether it counts how far pins move along the profiles; else that is left at 0.

    Returns
    -------
    Errors
    """
    reducer, found = contacts.motion.reducer, [(effect.values, contacts.closings(effect)) for effect in effects]
    n, pins, rows = contacts.motion.theta.size, (reducer.discs, reducer.pins), len(contacts.sparse[1])
    m = n if any(isinstance(one, Compliance) for _, one in found) else 1
    pin, along, row = (np.zeros((n, *shape)) for shape in (pins, pins, (rows,)))
    softer_pin, softer_row = (np.zeros((m, *shape)) for shape in (pins, (rows,)))
    closed = by_contact(reducer, pin=pin, row=row) | {"along": along}
    softer = by_contact(reducer, pin=softer_pin, row=softer_row)
    clearance = dict.fromkeys(BEARINGS, 0.0)
    for values, closings in found:
        if isinstance(closings, Clearance):
            clearance[closings.contact] += max(values[0], 0.0)
        elif isinstance(closings, Compliance):
            more = samples_first(np.tensordot(values, closings.share, axes=1))
            here = softer[closings.contact][(slice(None), *closings.at)]
            here += more[..., None] if closings.contact in BEARINGS else more
        else:
            for one in closings:
                if slides or not one.slides:
                    closed[one.contact][one.at] += _total(values, one.rows)
    return Errors(pin, along, row, clearance, softer_pin, softer_row)


def _total(values: Sequence[float], rows: Array) -> Array:
    """Sum over the terms of rows, (n, ...)."""
    return (np.array(values) @ rows.reshape(len(rows), -1)).reshape(rows.shape[1:])


def samples_first(row: Array, *, behind: int = 0) -> Array:
    """What has its samples last, as everything outside the statics, with its samples first, as one angle needs it.

    Parameters
    ----------
    row : ndarray, shape (..., n)
    behind : int
        Axes that stay before the samples: 1 of rows, each of a term.

    Returns
    -------
    ndarray, shape (n, ...)
        Contiguous.
    """
    return np.ascontiguousarray(np.moveaxis(row, -1, behind))


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
    _closings: dict[tuple[Any, ...], tuple[Closing, ...] | Clearance | Compliance] = field(
        default_factory=dict, repr=False
    )

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
        return -samples_first(cross(arm, profile_tangent(motion)))

    @cached_property
    def curvature(self) -> Array:
        """Curvature of the trochoid on which each pin's centre stands, 1/mm, (n, discs, pins)."""
        return samples_first(trochoid_curvature(self.motion.reducer, roll_angles(self.motion)))

    @cached_property
    def sparse(self) -> tuple[Array, Integers]:
        """How flanks (two of each crank) and bearings (x and y of each) close with the pose.

        Entries (n, rows, width) and their unknowns (rows, width), the last ones first.  A flank closes as the sun moves
        along its normal and the planet against it, and as the planet turns on its base circle; a bearing as its first
        part moves against its second.
        """
        motion = self.motion
        reducer, layout = motion.reducer, Layout(motion.reducer)
        bore = reducer.crank_radius * motion.crank_directions[1]
        cam = reducer.eccentricity * motion.eccentric_directions[1]
        made: list[dict[int, Any]] = [
            {layout.sun: x, layout.sun + 1: y, at: -x, at + 1: -y, at + 2: lever}
            for at, normals in zip(layout.crank, motion.mesh_normal, strict=True)
            for (x, y), lever in zip(normals, flank_lever(reducer), strict=True)
        ]
        # a part's first unknown and its arm, against those of the part that holds it
        pairs: list[tuple[tuple[int, Any], ...]] = [
            ((disc, bore[j]), (crank, cam[k]))
            for k, disc in enumerate(layout.disc)
            for j, crank in enumerate(layout.crank)
        ]
        pairs += [((crank, None), (0, bore[j])) for j, crank in enumerate(layout.crank)]
        # the motor, whose bearings hold the sun, stands on what is held
        pairs += [((0, None),), ((layout.sun, None), (0, None))[: 2 if reducer.held == "carrier" else 1]]
        for pair in pairs:
            for side in range(2):
                row: dict[int, Any] = {}
                for sign, (at, arm) in zip((1.0, -1.0), pair, strict=False):
                    row |= {at + side: sign} | ({} if arm is None else {at + 2: sign * arm[side]})
                made.append(row)
        width = max(map(len, made))
        entries, columns = np.zeros((motion.theta.size, len(made), width)), np.empty((len(made), width), dtype=np.intp)
        for r, row in enumerate(made):
            columns[r] = min(row)  # of entries that are none
            for w, at in enumerate(sorted(row, reverse=True)):
                entries[:, r, w], columns[r, w] = row[at], at
        return entries, columns

    @cached_property
    def envelope(self) -> Integers:
        """First column of each row of the stiffness matrix's lower triangle that is not empty, (unknowns,)."""
        first = np.arange(Layout(self.motion.reducer).size)
        for together in self.sparse[1].reshape(len(self.sparse[1]) // 2, -1):  # flanks of a crank, x and y of a bearing
            first[together] = np.minimum(first[together], together.min())
        return first

    @cached_property
    def whole_rows(self) -> Array:
        """The rows with all unknowns, (n, rows, unknowns)."""
        rows, columns = self.sparse
        which = columns[..., None] == np.arange(Layout(self.motion.reducer).size)
        return np.asarray(np.einsum("nrw,rwc->nrc", rows, which.astype(np.float64)))

    def closings(self, effect: Effect) -> tuple[Closing, ...] | Clearance | Compliance:
        """What an effect closes, made once; its size plays no part."""
        name = (effect.key, *sorted(effect.indices.items()))
        if name not in self._closings:
            error = source(effect.key).vector(self.motion, **effect.indices)
            if isinstance(error, (Clearance, Compliance)):
                self._closings[name] = error
            else:
                parts = error if isinstance(error, tuple) else (error,)
                across = [Closing(self.motion, part) for part in parts]
                along = [Closing(self.motion, part, slides=True) for part in parts if part.contact == "pin"]
                self._closings[name] = (*across, *along)
        return self._closings[name]


def profile_tangent(motion: Contacts) -> Array:
    """Along each profile, a quarter turn ahead of the normal, (discs, pins, 2, n)."""
    return np.stack([-motion.pin_normal[:, :, 1], motion.pin_normal[:, :, 0]], axis=2)


def flank_lever(reducer: Reducer) -> Array:
    """Lever of the planet's turn on each flank: its base circle."""
    return reducer.planet_pitch_radius * math.cos(reducer.pressure_angle) * np.array([1.0, -1.0])


# --- the problem and its solution -------------------------------------------------------------------------------------


def loaded_problem(
    contacts: Geometry, reducer: Reducer, effects: Sequence[Effect], torque: float | Array, *, response: bool = True
) -> Problem:
    """The equilibrium of a gear train with errors; a torque on the carrier resists its motion in the housing.

    Parameters
    ----------
    contacts : Geometry
        Its own reducer says where things are.
    reducer : Reducer
        Whose stiffness, backlash, preload and contact law count.
    effects : sequence of Effect
        Which contacts feel.
    torque : float or ndarray, shape (n,)
        Its size, N*mm, above 0; which motion it resists, the contacts know.
    response : bool
        Whether a response will be asked for, which needs to know how the profiles bend.

    Returns
    -------
    Problem

    Raises
    ------
    ValueError
        If a compliance makes some contact stiffer than rigid.

    Notes
    -----
    A compliance adds to that of the declared stiffness k, the secant of a contact law at its reference force.
    """
    from rverror.statics.kernel import Problem

    layout, sense, law = Layout(reducer), contacts.motion.sense, reducer.contact_law
    cranks, cams, preload = reducer.cranks, reducer.discs * reducer.cranks, reducer.bearing_preload
    bends, straight = response or law.profile_curvature > 0, np.zeros((1, reducer.discs, reducer.pins))
    errors, (rows, columns) = error_closing(contacts, effects, slides=bends), contacts.sparse
    declared = np.array([getattr(reducer.stiffness, item.name) for item in fields(reducer.stiffness)])
    kind = np.repeat([3, 1, 2, 5, 4], [2 * cranks, 2 * cams, 2 * cranks, 2, 2])
    soft = 1 + declared[0] * errors.pin_compliance, 1 + declared[kind] * errors.row_compliance
    for own, contact in enumerate(YIELDING):
        least = float(by_contact(reducer, pin=soft[0], row=soft[1])[contact].min())
        if not least > 0:
            unit = 1e6 / declared[own]
            raise ValueError(
                f"{contact}: compliances of {(least - 1) * unit:.4g} um/kN in all make a contact stiffer than rigid; "
                f"they must be above {-unit:.4g} um/kN: make them less negative, or the declared stiffness lower"
            )
    free = errors.clearance["cam"] - preload.crank_bearing, errors.clearance["carrier"] - preload.carrier_bearing
    load, push = np.zeros((sense.size, layout.size)), np.zeros(layout.size)
    load[:, 2], push[2] = -sense * torque, reducer.output_turn
    size = np.atleast_1d(np.asarray(torque, dtype=np.float64))
    return Problem(
        pin_rows=contacts.pin_rows,
        profile_lever=contacts.profile_lever if bends else straight,
        curvature=contacts.curvature if bends else straight,
        rows=rows,
        columns=columns,
        envelope=contacts.envelope,
        pin_error=errors.pin,
        slide_error=errors.along,
        row_error=errors.row - np.repeat([reducer.gear_backlash / 2, 0.0], [2 * cranks, len(kind) - 2 * cranks]),
        clearance=np.repeat([*free, 0.0], [cams, cranks, 2]),
        pin_stiffness=declared[0] / soft[0],
        row_stiffness=declared[kind] / soft[1],
        kind=kind,
        declared=declared,
        pin_exponent=float(law.pin_exponent),
        flank_exponent=float(law.flank_exponent),
        reference_force=REFERENCE_FORCE,
        share=float(law.profile_curvature),
        load=load,
        sense=sense,
        push=push,
        longest=reducer.eccentricity,
        tolerance=GRADIENT_TOLERANCE * size / reducer.crank_radius,
        heavy=_FULL_LOAD * declared[0] * reducer.pin_circle_radius**2 / size,
        most=(_MAX_STEPS_NEAR, _MAX_STEPS, _MAX_STEPS_UNLOADING),
    )


def solve(
    problem: Problem,
    *,
    near: Array | None = None,
    given: Array | None = None,
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
    matrix, response : bool
        Whether to find the second derivative of the energy, and changes per unit of the push.

    Returns
    -------
    Solution
        What was not asked for is empty.
    """
    from rverror.statics import kernel

    (n, size), pins, rows = problem.load.shape, problem.pin_error.shape[1:], problem.row_error.shape[1:]
    bent, whole, changed = n * (problem.share > 0), n * matrix, n * response
    start = kernel.GIVEN if given is not None else kernel.COLD if near is None else kernel.NEAR
    first = near if given is None else given
    made: list[npt.NDArray[Any]] = [
        np.empty((n, size)) if first is None else np.array(first, dtype=np.float64, order="C"),
        np.empty(n, dtype=np.intp),
        np.empty(n, dtype=np.bool_),
        *(np.empty((count, *pins)) for count in (n, bent)),
        *(np.empty((n, *shape)) for shape in (rows, pins, rows, pins, rows, problem.clearance.shape, (), (size,), ())),
        np.empty((whole, size, size)),
        *(np.empty((count, *pins)) for count in (changed, bent * response)),
        *(np.empty((changed, *shape)) for shape in (rows, (size,), (10,))),
    ]
    found = kernel.Solution._make(made)

    def some(part: slice) -> None:
        kernel.solve(problem, start, part.start, part.stop, found, kernel.scratch(problem))

    each_part(some, n, kernel.BLOCK)
    return found
