"""A virtual test bench that shares no physics with the package: the tests' oracle with what real reducers do.

`Bench` takes bodies, exact poses, profiles and finite rotations from `oracle` and adds

- contacts of pins and flanks whose force grows with a power of what they close by, f = F0 (k p / F0)^n;
- radial clearance of cam and carrier bearings, which push along their line of centres once it is used up;
- both flanks of each gear tooth, with play between them;
- a defect of one lobe;
- a solver that always ends: the exact geometry is linearised at a pose, the energy of its springs, which is convex, is
  brought to its minimum by Newton's method with a line search (from heavier loads downwards where that takes long), and
  the geometry taken anew there, until the pose stays where it is.

Lengths mm, forces N, angles rad.
"""

from __future__ import annotations

import copy
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[2] / "tests"))

from oracle import Errors, Oracle, Springs, _along, _wave, put, trochoid

SETTLED = 2e-9  #: mm, a step after which the springs of a linearised pose are at rest
RESTING = 1e-15  #: N*mm, what a step would save: parts that float freely drift in rounding alone
UNSEEN = 3e-8  #: rad, 0.006 arcsec of the output
PATIENCE = 6  #: turns after which the geometry is taken as found where the output no longer changes
CLOSED = 2e-8  #: mm or rad, change of the pose with which its geometry is no longer taken anew
CHUNK = 512  #: angles that are solved together: their rows stay in the processor's cache


@dataclass(frozen=True, kw_only=True)
class Law:
    """Force of a contact that closes by p: reference (stiffness p / reference)^exponent."""

    exponent: float = 1.0
    reference: float = 100.0  # N, at which the stiffness is what it is said to be


@dataclass(frozen=True, kw_only=True)
class Reality:
    """What a real reducer has beside its geometry and its part errors."""

    springs: Springs
    pin_law: Law = Law()
    flank_law: Law = Law()
    backlash: float = 0.02  # along the line of action, each mesh
    #: Whether pins meet the discs along the normals of the error-free pose: what is quadratic in errors is left out.
    first_order: bool = False


class PartErrors(Errors):
    """Sizes of every error of one unit."""

    def __init__(self, unit: Any) -> None:
        super().__init__(unit, 1)
        self.cam_clearance = self.carrier_clearance = 0.0
        self.lobes: list[tuple[int, int, float]] = []  # disc, lobe, deviation


def put_effect(errors: PartErrors, unit: Any, key: str, indices: dict[str, Any], sizes: dict[str, float]) -> None:
    """Add one effect of the gear train, sizes in mm and rad."""
    for name, size in sizes.items():
        match key:
            case "crank.bearing_clearance":
                errors.cam_clearance += size
            case "coupling.bearing_clearance":
                errors.carrier_clearance += size
            case "cycloid.disc_lobe":
                errors.lobes.append((indices["disc"], indices["lobe"], size))
            case _:
                put(errors, unit, 0, (key, indices, name), size)


class _Springs:
    """Springs of the poses at some angles: how far they close, and the rows of that over the unknowns.

    It is handed to the oracle's own geometry in place of its `_Rows`.
    """

    def __init__(self, angles: int, unknowns: int) -> None:
        self.angles, self.unknowns = angles, unknowns
        self.pins: list[tuple[int, np.ndarray, np.ndarray]] = []  # column, depth, rows over x, y and turn of a disc
        self.flanks: list[np.ndarray] = []
        self.flank_rows: list[np.ndarray] = []
        self.joints: list[np.ndarray] = []
        self.joint_rows: list[np.ndarray] = []
        self.joint_stiffness: list[float] = []

    def push(self, stiffness: float, compression: np.ndarray, columns: dict[int, Any]) -> None:
        row = np.zeros((self.angles, self.unknowns))
        for column, value in columns.items():
            row[:, column] = np.broadcast_to(value, (1, self.angles, 1))[0, :, 0]
        self.flanks.append(compression[0, :, 0])
        self.flank_rows.append(row)

    def centre(self, stiffness: float, gap: np.ndarray, columns: dict[int, Any]) -> None:
        rows = np.zeros((self.angles, 2, self.unknowns))
        for column, value in columns.items():
            rows[:, 0, column], rows[:, 1, column] = np.real(value), np.imag(value)
        gap = np.broadcast_to(gap, (1, self.angles))[0]
        self.joints.append(np.stack([gap.real, gap.imag], axis=-1))
        self.joint_rows.append(rows)
        self.joint_stiffness.append(stiffness)


@dataclass(frozen=True)
class Linear:
    """Contacts linearised at one pose of each angle; the angle is the first axis of everything."""

    reality: Reality
    columns: tuple[int, ...]  # of each disc's x
    pins: np.ndarray  # (n, discs, z) depth
    pin_rows: np.ndarray  # (n, discs, z, 3)
    flanks: np.ndarray  # (n, f)
    flank_rows: np.ndarray  # (n, f, unknowns)
    joints: np.ndarray  # (n, q, 2)
    joint_rows: np.ndarray  # (n, q, 2, unknowns)
    stiffness: np.ndarray  # (q,)
    clearance: np.ndarray  # (q,)
    load: np.ndarray  # (n, unknowns)

    def take(self, at: np.ndarray) -> Linear:
        """The same at some of the angles."""
        names = ("pins", "pin_rows", "flanks", "flank_rows", "joints", "joint_rows", "load")
        return replace(self, **{name: getattr(self, name)[at] for name in names})

    def closing(self, step: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What pins, flanks and joints close by after a step from the pose."""
        discs = np.stack([step[:, c : c + 3] for c in self.columns], axis=1)
        pins = self.pins + (self.pin_rows @ discs[..., None])[..., 0]
        flanks = self.flanks + (self.flank_rows @ step[..., None])[..., 0]
        joints = self.joints + (self.joint_rows @ step[:, None, :, None])[..., 0]
        return pins, flanks, joints

    def forces(self, step: np.ndarray) -> tuple[np.ndarray, Any]:
        """Gradient of the energy, and what its second derivative is made of."""
        pins, flanks, joints = self.closing(step)
        springs, reality = self.reality.springs, self.reality
        pin_force, pin_stiffness = _power(pins, springs.pin, reality.pin_law)
        flank_force, flank_stiffness = _power(flanks, springs.mesh, reality.flank_law)
        distance = np.hypot(joints[..., 0], joints[..., 1])
        share = np.maximum(distance - self.clearance, 0) / np.where(distance > 0, distance, 1)
        share[:, self.clearance == 0] = 1.0
        joint_force = (self.stiffness * share)[..., None] * joints
        gradient = np.einsum("nfu,nf->nu", self.flank_rows, flank_force) - self.load
        n, q, _, size = self.joint_rows.shape
        gradient += (joint_force.reshape(n, 1, 2 * q) @ self.joint_rows.reshape(n, 2 * q, size))[:, 0]
        on_discs = (pin_force[..., None, :] @ self.pin_rows)[..., 0, :]
        for k, c in enumerate(self.columns):
            gradient[:, c : c + 3] += on_discs[:, k]
        return gradient, (pin_stiffness, flank_stiffness, joints, distance, share)

    def matrix(self, parts: Any) -> np.ndarray:
        """Second derivative of the energy, held by a trace of stiffness where nothing touches."""
        pin_stiffness, flank_stiffness, joints, distance, share = parts
        n, q, _, size = self.joint_rows.shape
        along = joints / np.where(distance > 0, distance, 1)[..., None]
        touching = np.where(self.clearance == 0, 1.0, share > 0)
        across = (self.stiffness * share)[..., None, None] * np.eye(2)
        radial = (self.stiffness * (touching - share))[..., None, None] * along[..., :, None] * along[..., None, :]
        weighted = (across + radial) @ self.joint_rows
        rows = self.joint_rows.reshape(n, 2 * q, size)
        matrix = np.swapaxes(rows, 1, 2) @ weighted.reshape(n, 2 * q, size)
        matrix += np.swapaxes(self.flank_rows, 1, 2) @ (flank_stiffness[..., None] * self.flank_rows)
        blocks = np.swapaxes(self.pin_rows, -1, -2) @ (pin_stiffness[..., None] * self.pin_rows)
        for k, c in enumerate(self.columns):
            matrix[:, c : c + 3, c : c + 3] += blocks[:, k]
        own = np.einsum("nuu->nu", matrix)
        own += 1e-11 * np.maximum(own, 1e-6 * own.max(axis=1, keepdims=True))
        return matrix


def _power(closing: np.ndarray, stiffness: float, law: Law) -> tuple[np.ndarray, np.ndarray]:
    """Force of contacts that only push, and its derivative."""
    shut = closing > 0
    if law.exponent == 1:
        return stiffness * np.where(shut, closing, 0.0), np.where(shut, stiffness, 0.0)
    scaled = stiffness / law.reference * np.where(shut, closing, 1.0)
    slope = law.exponent * stiffness * scaled ** (law.exponent - 1)
    return np.where(shut, slope * closing / law.exponent, 0.0), np.where(shut, slope, 0.0)


def _foot(unit: Any, disc: int, seen: np.ndarray, s: np.ndarray, turns: int) -> np.ndarray:
    """Foot of the perpendicular from where pins are seen on a disc to the curve that they draw there."""
    for _ in range(turns):
        point, first, second = trochoid(unit, disc, s)
        off = seen - point
        s = s - _along(first, off) / (_along(second, off) - abs(first) ** 2)
    return s


def lobe_shape(unit: Any, disc: int, lobe: int, psi: np.ndarray) -> np.ndarray:
    """Defect of one lobe over the disc's angle: 1 at its crest, 0 at the roots beside it and elsewhere.

    Lobes are counted counter-clockwise from the root into which the eccentric points at theta = 0, or from the next
    one.  Roots are where the curve of `trochoid` is nearest to the disc's centre.
    """
    eccentric, pitch = 2 * np.pi * disc / unit.discs, 2 * np.pi / unit.disc_lobes
    root = -eccentric / unit.disc_lobes
    root += pitch * np.ceil((eccentric - root) / pitch - 1e-9)
    away = np.angle(np.exp(1j * (psi - root - (lobe + 0.5) * pitch)))
    return np.where(abs(away) < pitch / 2, np.cos(np.pi * away / pitch) ** 2, 0.0)


class Bench(Oracle):
    """One reducer with its errors at some angles, moving one way under a load."""

    def __init__(
        self,
        unit: Any,
        theta: Sequence[float] | np.ndarray,
        errors: PartErrors,
        reality: Reality,
        *,
        sense: int,
        torque: float,
    ) -> None:
        """Take a unit, angles of the output, its errors, what it really has, the direction and the load."""
        super().__init__(unit, theta, sense=sense, torque=torque, springs=reality.springs)
        self.errors, self.reality = copy.copy(errors), reality
        # the oracle has no play; thinner teeth leave the same
        self.errors.thinning = errors.thinning + reality.backlash / np.cos(unit.pressure_angle)
        self._feet: dict[int, np.ndarray] = {}

    def _pins(self, rows: _Springs, u: np.ndarray, errors: PartErrors, disc: int) -> None:
        """Depth of every pin in a disc, as in the oracle, from the last feet of the perpendiculars onwards."""
        if self.reality.first_order:
            self._pins_of_first_order(rows, u, errors, disc)
            return
        unit, at = self.unit, self._disc(disc)
        gamma = 2 * np.pi * np.arange(unit.pins) / unit.pins
        eccentric = self.crank_turn + 2 * np.pi * disc / unit.discs
        centre = unit.eccentricity * np.exp(1j * eccentric) + u[0, :, at] + 1j * u[0, :, at + 1]
        turned = np.exp(1j * (self.theta + u[0, :, at + 2]))[:, None]
        arm = unit.pin_circle_radius * np.exp(1j * gamma) + errors.pin_centre[0] - centre[:, None]
        seen = arm * np.conj(turned)
        s = self._feet.get(disc)
        turns = 1 if s is not None else 4
        if s is None:
            s = _foot(unit, disc, seen, self.theta[:, None] - gamma, turns)
        waves = errors.flanks[0, disc]
        for _ in range(turns if waves.any() else 0):
            # a flank that moves one way is a pin that moves the other; the wave counts where the pin touches it
            point, first, _ = trochoid(unit, disc, s)
            touched = point - 1j * unit.pin_radius * first / abs(first)
            shifted = seen - _wave(waves, np.angle(touched)) * 1j * touched / abs(touched)
            s = _foot(unit, disc, shifted, s, 1)
        if waves.any():
            seen = shifted
        else:
            s = _foot(unit, disc, seen, s, 1)
        self._feet[disc] = s
        point, first, _ = trochoid(unit, disc, s)
        outwards = 1j * first / abs(first)
        depth = -_along(outwards, seen - point) + errors.pin_radius[0]
        depth = depth + self._raised(errors, disc, point - unit.pin_radius * outwards)
        normal = outwards * turned
        rows.pins.append((at, depth, np.stack([normal.real, normal.imag, _along(normal, 1j * arm)], axis=-1)))

    def _raised(self, errors: PartErrors, disc: int, touched: np.ndarray) -> np.ndarray | float:
        """Material of a disc's profile beyond the nominal, where pins touch it."""
        lobes = [(lobe, deviation) for k, lobe, deviation in errors.lobes if k == disc]
        if not lobes and not errors.profile[0, disc].any():
            return 0.0
        psi = np.angle(touched)
        raised = _wave(errors.profile[0, disc], psi)
        for lobe, deviation in lobes:
            raised = raised + deviation * lobe_shape(self.unit, disc, lobe, psi)
        return raised

    def _pins_of_first_order(self, rows: _Springs, u: np.ndarray, errors: PartErrors, disc: int) -> None:
        """Depth of every pin in a disc along the normals of the pose without errors and load."""
        unit, at = self.unit, self._disc(disc)
        gamma = 2 * np.pi * np.arange(unit.pins) / unit.pins
        eccentric = self.crank_turn + 2 * np.pi * disc / unit.discs
        point, first, _ = trochoid(unit, disc, self.theta[:, None] - gamma)
        outwards, turned = 1j * first / abs(first), np.exp(1j * self.theta)[:, None]
        normal = outwards * turned
        arm = unit.pin_circle_radius * np.exp(1j * gamma) - (unit.eccentricity * np.exp(1j * eccentric))[:, None]
        touched = point - unit.pin_radius * outwards
        lever = _along(normal, 1j * arm)
        depth = _along(normal, (u[0, :, at] + 1j * u[0, :, at + 1])[:, None]) + lever * u[0, :, at + 2, None]
        depth = depth - _along(normal, errors.pin_centre[0]) + errors.pin_radius[0]
        depth = depth + self._raised(errors, disc, touched)
        led = _wave(errors.flanks[0, disc], np.angle(touched))
        depth = depth + led * _along(outwards, 1j * touched / abs(touched))
        rows.pins.append((at, depth, np.stack([normal.real, normal.imag, lever], axis=-1)))

    def linear(self, u: np.ndarray) -> Linear:
        """Every contact, linearised at a pose (angle, unknowns)."""
        unit, n = self.unit, len(u)
        rows = _Springs(n, self.unknowns)
        for disc in range(unit.discs):
            self._pins(rows, u[None], self.errors, disc)
        self._bearings(rows, u[None], self.errors)
        self._meshes(rows, u[None], self.errors)
        back = copy.copy(self)
        back.sense = -self.sense
        back._meshes(rows, u[None], self.errors)
        load = np.zeros((n, self.unknowns))
        load[:, 2] = -self.sense * self.torque
        one_crank = [self.errors.cam_clearance] * unit.discs + [self.errors.carrier_clearance]
        return Linear(
            reality=self.reality,
            columns=tuple(at for at, _, _ in rows.pins),
            pins=np.stack([depth for _, depth, _ in rows.pins], axis=1),
            pin_rows=np.stack([row for _, _, row in rows.pins], axis=1),
            flanks=np.stack(rows.flanks, axis=1),
            flank_rows=np.stack(rows.flank_rows, axis=1),
            joints=np.stack(rows.joints, axis=1),
            joint_rows=np.stack(rows.joint_rows, axis=1),
            stiffness=np.array(rows.joint_stiffness),
            clearance=np.array(one_crank * unit.cranks + [0.0, 0.0]),
            load=load,
        )

    def poses(self, start: np.ndarray | None = None) -> np.ndarray:
        """Pose of least energy, (angle, unknowns).

        Raises
        ------
        ArithmeticError
            Where none is found.
        """
        u = np.zeros((self.theta.size, self.unknowns)) if start is None else start.copy()
        for turn in range(30):
            linear = self.linear(u)
            step = at_rest(linear, driven_first=turn == 0 and start is None)
            u = u + step * (1.0 if turn < PATIENCE else 0.5)
            still = abs(step).max(axis=1) >= CLOSED
            if turn >= PATIENCE:  # a disc that carries nothing may go to and fro
                still &= abs(step[:, 2]) >= UNSEEN
            if not still.any():
                return u
        raise ArithmeticError(f"the pose still moves by {abs(step).max():.1e} mm")


def held(linear: Linear, pins: np.ndarray, flanks: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Step to where springs that may pull, of the contacts given, balance the load.

    Each joint is held at the end of its clearance in the direction `along`.
    """
    springs = linear.reality.springs
    away = linear.joints - linear.clearance[:, None] * along
    straight = replace(linear, joints=away, clearance=np.zeros_like(linear.clearance))
    n, q, _, size = linear.joint_rows.shape
    force = (linear.stiffness[:, None] * away).reshape(n, 1, 2 * q) @ linear.joint_rows.reshape(n, 2 * q, size)
    gradient = force[:, 0] - linear.load
    gradient += np.einsum("nfu,nf->nu", linear.flank_rows, springs.mesh * flanks * linear.flanks)
    on_discs = ((springs.pin * pins * linear.pins)[..., None, :] @ linear.pin_rows)[..., 0, :]
    for k, c in enumerate(linear.columns):
        gradient[:, c : c + 3] += on_discs[:, k]
    distance = np.hypot(away[..., 0], away[..., 1])
    parts = (springs.pin * pins, springs.mesh * flanks, away, distance, np.ones_like(distance))
    return -np.linalg.solve(straight.matrix(parts), gradient[..., None])[..., 0]


def driven(linear: Linear) -> np.ndarray:
    """Step to where the side that the load drives is held shut, told from the gear train without errors."""
    blank = replace(
        linear,
        pins=np.zeros_like(linear.pins),
        flanks=np.zeros_like(linear.flanks),
        joints=np.zeros_like(linear.joints),
    )
    shut = np.ones_like(linear.pins, bool), np.arange(linear.flanks.shape[1]) < linear.flanks.shape[1] // 2
    flanks = np.broadcast_to(shut[1], linear.flanks.shape)
    pins, _, joints = blank.closing(held(blank, shut[0], flanks, np.zeros_like(linear.joints)))
    distance = np.hypot(joints[..., 0], joints[..., 1])[..., None]
    return held(linear, pins > 0, flanks, joints / np.where(distance > 0, distance, 1))


def at_rest(linear: Linear, *, driven_first: bool) -> np.ndarray:
    """Step of each angle to the least energy of its linearised contacts."""
    step = driven(linear) if driven_first else np.zeros_like(linear.load)
    step, left = newton(linear, step, 40)
    for factor in (4.0, 1.7):  # from heavier loads downwards
        if not left.size:
            break
        part = linear.take(left)
        stages = int(np.ceil(np.log(1e6 / abs(part.load).max()) / np.log(factor)))
        heavy = replace(part, load=part.load * factor**stages)
        here = driven(heavy)
        for stage in range(stages, -1, -1):
            here, still = newton(replace(part, load=part.load * factor**stage), here, 200 if stage == 0 else 60)
        step[left] = here
        left = left[still]
    if left.size:
        raise ArithmeticError(f"{left.size} poses do not come to rest")
    return step


def newton(linear: Linear, step: np.ndarray, most: int) -> tuple[np.ndarray, np.ndarray]:
    """Least energy by Newton's method; the steps, and which angles are not at rest after so many turns."""
    step, at, part = step.copy(), np.arange(len(step)), linear
    gradient, parts = part.forces(step)
    for _ in range(most):
        move = -np.linalg.solve(part.matrix(parts), gradient[..., None])[..., 0]
        slope = -(gradient * move).sum(axis=1)  # of the energy downwards
        move[slope < RESTING] = 0.0
        length = np.ones(len(at))
        here = step[at] + move
        gradient, parts = part.forces(here)
        for _ in range(12):  # until the energy does not climb steeply again at the end of the step
            past = (gradient * move).sum(axis=1) > 0.1 * slope
            past &= abs(move).max(axis=1) * length > SETTLED
            if not past.any():
                break
            some = np.flatnonzero(past)
            length[some] /= 2
            here[some] = step[at[some]] + length[some, None] * move[some]
            some_gradient, some_parts = part.take(some).forces(here[some])
            gradient[some] = some_gradient
            for whole, piece in zip(parts, some_parts, strict=True):
                whole[some] = piece
        step[at] = here
        moving = abs(move).max(axis=1) > SETTLED
        if not moving.all():
            at, part = at[moving], part.take(moving)
            gradient, parts = gradient[moving], tuple(whole[moving] for whole in parts)
        if not at.size:
            break
    return step, at


def transmission_error(
    unit: Any,
    theta: np.ndarray,
    errors: PartErrors,
    reality: Reality,
    *,
    sense: int,
    torque: float,
    start: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Turn of the carrier beyond `theta`, rad, and the poses, from which another one may start."""
    parts = []
    for at in chunks(theta.size):
        bench = Bench(unit, theta[at], errors, reality, sense=sense, torque=torque)
        parts.append(bench.poses(None if start is None else start[at]))
    poses = np.concatenate(parts)
    return poses[:, 2], poses


def chunks(count: int) -> Iterator[slice]:
    """Angles that are solved together."""
    return (slice(first, min(first + CHUNK, count)) for first in range(0, count, CHUNK))
