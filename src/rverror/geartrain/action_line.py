"""The principle: error vectors at contacts, projected onto action lines and transferred to the output.

Source 000 moves a follower by (n1 . delta) / (n1 . n2) for one contact.  For a mechanism with many contacts the same
follows from virtual work: with the sun held, an error delta at contact c turns the output by

    dTheta = sum over c of lambda_c (n_c . C_c delta_c),

where lambda_c n_c is the force that the driving part puts on the driven part at c per unit of output torque, and C_c
turns the error from the frame in which it is fixed into the housing frame.  So a source says only where its vector
sits, in which frame, and its components: it returns an `ErrorVector`.  What carries force is a
`ContactForces`, whether it comes from the closed form or from an equilibrium.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array, dot, norms, radial_and_tangential
from rverror.geartrain.kinematics import Pose
from rverror.geartrain.mechanism import Reducer

Phases = npt.NDArray[np.complex128]

#: Contacts, each named driving part -> driven part, with the axes of its arrays (before the sample axis).
#: Flank 0 of a gear mesh and of a spline carries in forward motion, flank 1 in reverse.
CONTACT_AXES: Mapping[str, str] = {
    "pin": "pin of the housing -> disc: (disc, pin, xy)",
    "cam": "disc bore -> cam of the crank: (disc, crank, xy)",
    "carrier": "crank journal -> carrier bore: (crank, xy)",
    "mesh": "sun -> planet: (crank, flank, xy)",
    "spline": "planet -> crank, a torque: (crank, flank, 1)",
    "output": "carrier -> reading of the output error, an angle: (1,)",
}


@dataclass(frozen=True, kw_only=True)
class Contacts(Pose):
    """Nominal geometry of every contact of a reducer at n samples, in the housing frame.

    Attributes
    ----------
    reducer : Reducer
        Whose geometry it is.
    turns : mapping of str to ndarray, shape (n,)
        How far each part of `kinematics.frame_orders` has turned in the housing, rad.
    sense : ndarray, shape (n,)
        Direction in which the carrier turns in the housing in the motion that the load resists: that at hand unless
        the load drives it, or the opposite where the housing is the output.  Which flanks and pins carry follows it.
    eccentric : ndarray, shape (discs, n)
        Angle of the eccentric direction of each disc, rad.
    crank_position : ndarray, shape (cranks, n)
        Angle of each crank axis about the housing axis, rad.
    pin_normal : ndarray, shape (discs, pins, 2, n)
        Unit vector from each pin into the disc along the contact normal.
    pin_arm : ndarray, shape (discs, pins, n)
        Arm of that normal about the disc centre, mm, counter-clockwise positive.
    pin_point : ndarray, shape (discs, pins, 2, n)
        Contact point from the disc's centre, in the housing, mm.
    mesh_normal : ndarray, shape (cranks, 2, 2, n)
        Unit vector along the line of action from sun to planet, per flank.
    """

    reducer: Reducer
    turns: Mapping[str, Array]
    sense: Array
    eccentric: Array
    crank_position: Array
    pin_normal: Array
    pin_arm: Array
    pin_point: Array
    mesh_normal: Array

    @cached_property
    def pin_angle(self) -> Array:
        """Angle psi of each contact point about its disc's centre in the disc's frame, rad, (discs, pins, n)."""
        return np.arctan2(self.pin_point[..., 1, :], self.pin_point[..., 0, :]) - self.turns["disc"]

    @cached_property
    def pin_pitch(self) -> Array:
        """The same in pitches of the disc, from 0 to all of its lobes, (discs, pins, n)."""
        lobes = self.reducer.disc_lobes
        return np.asarray(np.mod(self.pin_angle * lobes / (2 * np.pi), lobes))

    @cached_property
    def pin_phase(self) -> Phases:
        """e^(i psi) of the contact angles `pin_angle`: its powers are the waves around a disc, (discs, pins, n)."""
        behind = self.pin_behind
        return np.asarray((1j * behind[..., 0, :] - behind[..., 1, :]) * np.exp(-1j * self.turns["disc"]))

    @cached_property
    def pin_behind(self) -> Array:
        """Unit vector behind each contact point about its disc's centre, in the housing, (discs, pins, 2, n)."""
        behind = self.pin_point[..., ::-1, :] / norms(self.pin_point)
        behind[..., 1, :] *= -1
        return behind

    @cached_property
    def eccentric_directions(self) -> tuple[Array, Array]:
        """Unit vectors along each disc's eccentric and a quarter turn ahead, in the housing, (discs, 2, n) each."""
        return radial_and_tangential(self.eccentric)

    @cached_property
    def crank_directions(self) -> tuple[Array, Array]:
        """Unit vectors at each crank, away from the housing axis and a quarter turn ahead, (cranks, 2, n) each."""
        return radial_and_tangential(self.crank_position)

    @cached_property
    def sun_phase(self) -> Phases:
        """e^(i chi), chi the angle of each mesh on the sun, (cranks, n)."""
        return np.asarray(np.exp(1j * (self.crank_position - self.turns["sun"])))

    @cached_property
    def planet_phase(self) -> Phases:
        """e^(i chi), chi the angle of each mesh on its planet, (cranks, n)."""
        return np.asarray(np.exp(1j * (self.crank_position + np.pi - self.turns["planet"])))


#: Bearings, whose force has no fixed direction: ``"cam direction"`` and ``"carrier direction"`` hold it.
BEARINGS = ("cam", "carrier")
#: Contacts that can be more compliant than nominal.
YIELDING = ("pin", "cam", "carrier", "mesh")

#: Force of the driving on the driven part at each contact per unit of output torque, 1/mm (torques: 1), keyed and
#: shaped as in `CONTACT_AXES` with the sample axis last; for each of `BEARINGS` also the unit vector along which the
#: force acts in the motion at hand, and under a known load ``"pin carried"`` and the like for each of `YIELDING`: the
#: force under which it gives way, N, by a power law of contact the one that would press a linear contact in as far.
ContactForces = Mapping[str, Array]


@dataclass(frozen=True, kw_only=True)
class ErrorVector:
    """Where the error of one source sits, and its components in the housing frame.

    Attributes
    ----------
    contact : str
        A key of `CONTACT_AXES`.
    vector : ndarray, shape (terms, axes of the contact, n)
        Displacement of the driving surface less that of the driven surface, per unit of each parameter.  Axes of
        length 1 stand for all entries of that axis.
    at : tuple of slice
        Which entries of the contact's leading axes it touches; all where empty.
    """

    contact: str
    vector: Array
    at: tuple[slice, ...] = ()

    def along(self, directions: Array) -> Array:
        """Components along vectors at its contacts, (terms, axes of the contact but xy, n)."""
        return dot(self.vector, directions)


def output_terms(*terms: Array) -> ErrorVector:
    """Terms that turn the output or its reading, each of shape (n,)."""
    return ErrorVector(contact="output", vector=np.stack(terms)[:, None])


def output_wave(angle: Array, size: Array | float = 1.0) -> ErrorVector:
    """Cosine and sine of an angle, of a size, that turn the output or its reading."""
    return output_terms(size * np.cos(angle), size * np.sin(angle))


@dataclass(frozen=True, kw_only=True)
class _AlongOneDirection(ABC):
    """Error along one direction at each contact."""

    contact: str
    direction: Array
    at: tuple[slice, ...] = ()

    @property
    @abstractmethod
    def sizes(self) -> Array:
        """Size along the direction, per unit of each parameter, (terms, axes of the contact but the last, n)."""

    @property
    def vector(self) -> Array:
        """As of `ErrorVector`, (terms, axes of the contact, n)."""
        return self.sizes[..., None, :] * self.direction

    def along(self, directions: Array) -> Array:
        """Components along vectors at its contacts, (terms, axes of the contact but xy, n)."""
        return np.asarray(self.sizes * dot(self.direction, directions))


@dataclass(frozen=True, kw_only=True)
class ErrorWaves(_AlongOneDirection):
    """Error of two terms, cos and sin of a harmonic of some phase along one direction at each contact.

    Of sources that share arrays, or views of the same entries, `project_all` makes all harmonics in one walk.

    Attributes
    ----------
    contact : str
        A key of `CONTACT_AXES`.
    phase : ndarray of complex, shape (axes of the contact but the last, n or 1)
        e^(i psi) of the angle psi over which the wave runs.
    harmonic : int
        h of cos(h psi) and sin(h psi), 0 or more.
    direction : ndarray, shape (axes of the contact, n or 1)
        Unit vectors in the housing frame.
    at : tuple of slice
        As of `ErrorVector`.
    """

    phase: Phases
    harmonic: int

    @property
    def sizes(self) -> Array:
        """Cosine and sine of the wave, (2, axes of the contact but the last, n)."""
        wave = _power(self.phase, self.harmonic)
        return np.stack([wave.real, wave.imag])


@dataclass(frozen=True, kw_only=True)
class ErrorSpots(_AlongOneDirection):
    """Error of one term, along one direction at each contact, that is met in few places: nothing everywhere else.

    Attributes
    ----------
    contact : str
        A key of `CONTACT_AXES`.
    where : tuple of ndarray, shape (places,) each
        Of each axis of the contact but xy, within `at`, and of the samples: the places that are met.
    size : ndarray, shape (places,)
        Displacement there per unit of the parameter.
    direction : ndarray, shape (axes of the contact, n)
        Unit vectors in the housing frame.
    at : tuple of slice
        As of `ErrorVector`.
    """

    where: tuple[npt.NDArray[np.intp], ...]
    size: Array

    @property
    def sizes(self) -> Array:
        """Size everywhere, (1, axes of the contact but the last, n)."""
        sizes = np.zeros((1, *self.direction.shape[:-2], self.direction.shape[-1]))
        sizes[0][self.where] = self.size
        return sizes

    def project(self, force: Array) -> Array:
        """Work of forces at its contacts, (axes of the contact, n), summed over them, (1, n)."""
        forces, directions = (np.moveaxis(rows, -2, -1)[self.where] for rows in (force, self.direction))
        work = self.size * np.sum(forces * directions, axis=-1)
        return np.asarray(np.bincount(self.where[-1], work, force.shape[-1])[None], dtype=np.float64)


def _power(phase: Phases, exponent: int) -> Phases:
    """Whole power, by products, which take a tenth of the time of cos and sin."""
    power = phase if exponent else np.ones_like(phase)
    for digit in f"{exponent:b}"[1:]:
        power = power * power if digit == "0" else power * power * phase
    return power


@dataclass(frozen=True, kw_only=True)
class Clearance:
    """Radial clearance of all bearings of one kind: the journal lies off centre along the force that it carries.

    Attributes
    ----------
    contact : str
        One of `BEARINGS`.
    """

    contact: str


@dataclass(frozen=True, kw_only=True)
class Compliance:
    """Contacts that give way more than their stiffness says: an error along the force that they carry, of its size.

    Attributes
    ----------
    contact : str
        ``"pin"``, ``"cam"``, ``"carrier"`` or ``"mesh"``.
    share : ndarray, shape (terms, axes of the contact but xy, n or 1)
        Compliance more than nominal, mm/N per unit of each parameter.  Axes of length 1 stand for all entries.
    at : tuple of slice
        Which entries of the contact's leading axes it touches; all where empty.
    """

    contact: str
    share: Array
    at: tuple[slice, ...] = ()


#: What displaces the surfaces of a contact, whatever it carries.
Displacement = ErrorVector | ErrorWaves | ErrorSpots
#: What a source returns: a part that grows shifts more than one contact, so it has one error vector for each.
SourceVector = Displacement | Clearance | Compliance | tuple[ErrorVector, ...]


def project(forces: ContactForces, error: SourceVector, samples: int) -> Array:
    """Influence of an error on the output angle: sum over contacts of force per unit torque times displacement.

    Parameters
    ----------
    forces : mapping of str to ndarray
        Contact forces per unit of output torque.
    error : ErrorVector, ErrorWaves, ErrorSpots, Clearance, Compliance or tuple of ErrorVector
        The error of one source.
    samples : int
        n, the number of samples.

    Returns
    -------
    ndarray, shape (terms, n)
        rad per mm for errors in mm, rad per rad for angles.

    Notes
    -----
    The action-line increment of source 000 with all contacts at once: the force direction is the action line, and the
    virtual work replaces its division by n1 . n2.  A clearance c displaces the driven part by c along the force, so it
    costs c times the force whatever its direction: the output lags.  A compliance c moves the driven part by c times
    the force that is carried, against it: the output by -T lambda^2 c in the closed form, T signed as the motion.
    """
    if isinstance(error, tuple):
        return np.asarray(sum(project(forces, part, samples) for part in error), dtype=np.float64)
    if isinstance(error, Clearance):
        along = dot(forces[error.contact], forces[f"{error.contact} direction"])
        return -np.broadcast_to(along.sum(axis=tuple(range(along.ndim - 1))), (1, samples))
    if isinstance(error, Compliance):
        work = dot(forces[error.contact][error.at], _carried(forces, error.contact)[error.at])
        given = (error.share * work).sum(axis=tuple(range(1, work.ndim)))
        return -np.array(np.broadcast_to(given, (len(error.share), samples)), dtype=np.float64)
    if isinstance(error, ErrorWaves):
        return np.asarray(_project_waves(forces, error, [error.harmonic], samples)[0])
    force = forces[error.contact][error.at]
    if isinstance(error, ErrorSpots):
        return error.project(force)
    if error.vector.shape[-1] == 1:  # alike at all samples: one matrix product
        vector = np.broadcast_to(error.vector[..., 0], (len(error.vector), *force.shape[:-1]))
        row = vector.reshape(len(vector), -1) @ force.reshape(-1, force.shape[-1])
        return np.array(np.broadcast_to(row, (len(row), samples)), dtype=np.float64)
    axes = "abcd"[: force.ndim - 1]
    columns = [np.einsum(f"{axes}n,{axes}n->n", force, term) for term in error.vector]
    return np.array(np.broadcast_to(columns, (len(columns), samples)), dtype=np.float64)


def project_all(forces: ContactForces, errors: Iterable[SourceVector], influence: Array) -> None:
    """`project` of many errors: harmonics of waves that share their arrays together, which takes a third of the time.

    Parameters
    ----------
    forces : mapping of str to ndarray
        As for `project`.
    errors : iterable of ErrorVector, ErrorWaves, ErrorSpots, Clearance, Compliance or tuple of ErrorVector
        One of each source.
    influence : ndarray, shape (terms of all errors, n)
        Overwritten: the influences, one under another in their order.
    """
    samples, row = influence.shape[1], 0
    alike: dict[Any, list[tuple[int, ErrorWaves]]] = {}
    for error in errors:
        if isinstance(error, ErrorWaves):
            same = (error.contact, repr(error.at), _entries(error.phase), _entries(error.direction))
            alike.setdefault(same, []).append((row, error))
            row += 2
        else:
            made = project(forces, error, samples)
            influence[row : row + len(made)] = made
            row += len(made)
    for group in alike.values():
        pairs = _project_waves(forces, group[0][1], [error.harmonic for _, error in group], samples)
        for (first, _), pair in zip(group, pairs, strict=True):
            influence[first : first + 2] = pair


def _entries(array: Array | Phases) -> tuple[Any, ...]:
    """What two views of the same entries have in common, as long as both are kept."""
    return array.__array_interface__["data"], array.shape, array.strides


def _project_waves(forces: ContactForces, like: ErrorWaves, harmonics: Sequence[int], samples: int) -> Array:
    """Influences of waves that differ by their harmonic alone, (harmonics, 2, n)."""
    work = dot(forces[like.contact][like.at], like.direction)
    wave = np.array(
        np.broadcast_to(work, np.broadcast_shapes(work.shape, like.phase.shape)), dtype=np.complex128, order="C"
    )
    by_contact = wave.view(np.float64).reshape(-1, 2 * wave.shape[-1])
    pairs, every, reached = np.empty((len(harmonics), 2, samples)), np.ones(len(by_contact)), 0
    for place in np.argsort(harmonics):
        if harmonics[place] > reached:
            wave *= _power(like.phase, harmonics[place] - reached)
            reached = harmonics[place]
        pairs[place] = (every @ by_contact).reshape(-1, 2).T
    return pairs


def _carried(forces: ContactForces, contact: str) -> Array:
    """Force under which a contact gives way, N."""
    own = forces.get(f"{contact} carried")
    if own is not None:
        return own
    if "load" not in forces:
        raise ValueError("a compliance needs the torque; give torque, or a run file with output_torque")
    return np.asarray(forces["load"] * forces[contact])
