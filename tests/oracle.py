"""An independent planar model of an RV reducer, to check the closed-form influences by finite difference.

It shares no physics with the package: it reads the numbers of a `Reducer` and nothing else.  Bodies (carrier, discs,
cranks with their planet gears, floating sun) have positions and finite rotations; contacts are springs; errors are put
into the geometry; the pose of least energy under the load torque is found by Newton's method.  Nowhere does it use
action lines of the cycloid mesh, pitch points, load shares, feedback factors or virtual work.  An influence is the
difference of two such poses over the size of the error.

Plane vectors are complex numbers.  Unknowns are displacements from the error-free, load-free pose, in which every
bearing is centred and every contact just touches (`assembly_gaps` shows that it is so): the differences of nearly equal
lengths that would lose the stiff bearings' digits then never appear.

Shapes: (case, angle, ...); errors are (case, ...).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

WAVES = 5  #: harmonics 0 to 4 of waves on gears and discs


@dataclass(frozen=True, kw_only=True)
class Springs:
    """Stiffness of each contact, N/mm."""

    pin: float
    cam: float
    carrier: float
    mesh: float
    sun: float
    main: float


#: What the closed form stands for.  Cam bearings are 1e4 times as stiff as pins (their forces are some 20 times as
#: hard on the output, so 2e-3 is left of their compliance), carrier bearings take the gears' separating force all but
#: 2 cams/carrier = 2e-3 of it, and the sun floats.
RIGID = Springs(pin=2e6, cam=2e10, carrier=2e13, mesh=2e9, sun=1e4, main=2e13)

#: As compliant as a reducer of that size is.
REALISTIC = Springs(pin=2e5, cam=3e5, carrier=3e5, mesh=2e5, sun=1e2, main=1e6)


@dataclass(frozen=True, kw_only=True)
class Rubbing:
    """Coefficient of friction of pins, and of the others times the lever at which it counts, mm."""

    pin: float
    mesh: float
    cam: float
    carrier: float


class Errors:
    """Sizes of every error, one row per case, each in the frame where it is fixed; all zero at first."""

    def __init__(self, unit: Any, cases: int) -> None:
        z, discs, cranks = unit.pins, unit.discs, unit.cranks
        self.pin_centre = np.zeros((cases, z), complex)  # housing
        self.pins_at_disc = np.zeros((cases, discs), complex)  # shift of all pins where they meet a disc, housing
        self.pin_radius = np.zeros((cases, z))
        self.profile = np.zeros(
            (cases, discs, WAVES), complex
        )  # c - i s: c cos(h psi) + s sin(h psi), along the normal
        self.flanks = np.zeros((cases, discs, WAVES), complex)  # the same, counter-clockwise about the disc
        self.disc_bore = np.zeros((cases, discs, cranks), complex)  # disc
        self.cam = np.zeros((cases, discs, cranks), complex)  # along and across the eccentric direction
        self.lead = np.zeros((cases, cranks))  # crank over planet, rad
        self.planet_axis = np.zeros((cases, cranks), complex)  # carrier
        self.planet_toothing = np.zeros((cases, cranks), complex)  # planet
        self.planet_waves = np.zeros((cases, cranks, WAVES), complex)
        self.sun_axis = np.zeros(cases, complex)  # housing
        self.sun_toothing = np.zeros(cases, complex)  # sun
        self.sun_waves = np.zeros((cases, WAVES), complex)
        self.sun_turn = np.zeros(cases)  # rad, beyond R theta
        self.thinning = np.zeros(cases)  # of sun and planet teeth together
        self.spline_play = np.zeros((cases, cranks))  # rad, all of it
        self.carrier_bore = np.zeros((cases, cranks), complex)  # carrier
        self.carrier_axis = np.zeros(cases, complex)  # main bearing, housing


def put(errors: Errors, unit: Any, case: int, term: tuple[str, dict[str, Any], str], size: float) -> None:
    """Add one parameter of one source to a case.

    The meanings are those of the design's conventions: radial away from the part's own centre, tangential
    counter-clockwise of it, harmonics over the angle in the part's own frame, positive is more material.
    """
    key, index, name = term
    vector = size * {"x": 1, "y": 1j, "radial": 1, "tangential": 1j, "cos": 1, "sin": -1j}.get(name, 1)
    crank, disc, pin, h = (index.get(k, 0) for k in ("crank", "disc", "pin", "harmonic"))
    bore = np.exp(2j * np.pi * crank / unit.cranks)  # direction of the bore in its carrier or disc
    gamma = 2 * np.pi * np.arange(unit.pins) / unit.pins
    match key:
        case "involute.center_distance":
            errors.planet_axis[case, crank] += vector * bore
        case "involute.sun_eccentricity":
            errors.sun_toothing[case] += vector
        case "involute.sun_offset":
            errors.sun_axis[case] += vector
        case "involute.planet_eccentricity":
            errors.planet_toothing[case, crank] += vector
        case "involute.sun_pitch":
            errors.sun_waves[case, h] += vector
        case "involute.planet_pitch":
            errors.planet_waves[case, crank, h] += vector
        case "involute.tooth_thinning":
            errors.thinning[case] += size
        case "involute.spline_clearance":
            errors.spline_play[case, crank] += size / unit.spline_radius
        case "crank.eccentricity":
            errors.cam[case, disc, crank] += vector
        case "crank.index":
            errors.lead[case, crank] += size
        case "cycloid.disc_profile":
            errors.profile[case, disc, h] += vector
        case "cycloid.disc_pitch":
            errors.flanks[case, disc, h] += vector
        case "cycloid.pin_position":
            errors.pin_centre[case, pin] += vector * np.exp(1j * gamma[pin])
        case "cycloid.pin_circle":
            axis, wave = name.split("_")
            along = np.exp(1j * gamma) * {"radial": 1, "tangential": 1j}[axis]
            errors.pin_centre[case] += size * along * {"cos": np.cos, "sin": np.sin}[wave](h * gamma)
        case "cycloid.pin_circle_tilt":  # about the middle of the discs, which stand evenly along the axis
            middle = (unit.discs - 1) / 2
            errors.pins_at_disc[case] += vector * (middle - np.arange(unit.discs)) / max(middle, 0.5)
        case "cycloid.pin_radius":
            errors.pin_radius[case, slice(None) if pin == "all" else pin] += size
        case "cycloid.profile_modification" if name == "equidistant":
            errors.profile[case, :, 0] -= size
        case "cycloid.profile_modification":  # ground by a tool nearer to the centre: as pins farther out
            errors.pin_centre[case] += size * np.exp(1j * gamma)
        case "cycloid.disc_bore_position":
            errors.disc_bore[case, disc, crank] += vector * bore
        case "coupling.carrier_bore_position":
            errors.carrier_bore[case, crank] += vector * bore
        case "coupling.carrier_runout":
            errors.carrier_bore[case] += vector
        case _:
            raise KeyError(f"the oracle has no error {key}: say in put, tests/oracle.py, where it sits")


class _Rows:
    """Springs of one pose: compression, its gradient over the unknowns, stiffness, and whether it can only push."""

    def __init__(self, shape: tuple[int, int], unknowns: int) -> None:
        self.shape, self.unknowns = shape, unknowns
        self.compression: list[np.ndarray] = []
        self.gradient: list[np.ndarray] = []
        self.stiffness: list[float] = []
        self.one_sided: list[bool] = []

    def push(self, stiffness: float, compression: np.ndarray, columns: dict[int, Any]) -> None:
        """Contacts that only push; `compression` has the shape (case, angle, contacts)."""
        count = compression.shape[-1]
        gradient = np.zeros((*self.shape, count, self.unknowns))
        for column, value in columns.items():
            gradient[..., column] = value
        self._add(stiffness, compression, gradient, True)

    def centre(self, stiffness: float, gap: np.ndarray, columns: dict[int, Any]) -> None:
        """Bearing that pulls a complex gap to zero, the same in all directions."""
        gradient = np.zeros((*self.shape, 2, self.unknowns))
        for column, value in columns.items():
            gradient[..., 0, column], gradient[..., 1, column] = np.real(value), np.imag(value)
        gap = np.broadcast_to(gap, self.shape)
        self._add(stiffness, np.stack([gap.real, gap.imag], axis=-1), gradient, False)

    def _add(self, stiffness: float, compression: np.ndarray, gradient: np.ndarray, one_sided: bool) -> None:
        self.compression.append(np.broadcast_to(compression, gradient.shape[:-1]))
        self.gradient.append(gradient)
        self.stiffness += [stiffness] * gradient.shape[-2]
        self.one_sided += [one_sided] * gradient.shape[-2]


def _along(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return (np.conj(a) * b).real


def _turned(angle: np.ndarray) -> np.ndarray:
    """exp(i angle) - 1 without loss of digits."""
    return -2 * np.sin(angle / 2) ** 2 + 1j * np.sin(angle)


def _wave(coefficients: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Sum of c cos(h angle) + s sin(h angle); coefficients c - i s, harmonics on the last axis."""
    return sum(
        ((coefficients[..., h] * np.exp(1j * h * angle)).real for h in range(WAVES) if coefficients[..., h].any()),
        np.zeros(angle.shape),
    )


def trochoid(unit: Any, disc: int, s: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Curve that pin 0 draws on a disc, in the disc's frame, with two derivatives; s is the disc's angle.

    As the disc turns by s its centre goes round the housing by -z_c s from where it stood, so
    P = exp(-i s) (R_p - a exp(i (phase - z_c s))).  It runs clockwise.  Pin i is on it at s less its own angle.
    """
    pin = unit.pin_circle_radius * np.exp(-1j * s)
    cam = unit.eccentricity * np.exp(1j * (2 * np.pi * disc / unit.discs - (unit.disc_lobes + 1) * s))
    n = unit.disc_lobes + 1
    return pin - cam, -1j * pin + 1j * n * cam, -pin + n**2 * cam


class Oracle:
    """One reducer at some angles, moving one way under load.

    `solve` gives the pose of every case, `influence` the finite differences.
    """

    def __init__(
        self, unit: Any, theta: Sequence[float], *, sense: int, torque: float = 412e3, springs: Springs = RIGID
    ) -> None:
        self.unit, self.theta, self.sense = unit, np.asarray(theta, float), sense
        self.torque, self.springs = torque, springs
        self.unknowns = 3 + 3 * unit.discs + 3 * unit.cranks + 2
        self.crank_turn = -unit.disc_lobes * self.theta  # a disc turns back by 1/z_c of what its centre goes round
        # a planet that rolls on the sun: z1 (sun - carrier) = -z2 (planet - carrier)
        self.ratio = 1 + unit.planet_teeth / unit.sun_teeth * (unit.disc_lobes + 1)
        self._base: np.ndarray | None = None
        self._base_open: np.ndarray | bool = False

    def _disc(self, disc: int) -> int:
        return 3 + 3 * disc

    def _crank(self, crank: int) -> int:
        return 3 + 3 * self.unit.discs + 3 * crank

    def _pin_contacts(self, u: np.ndarray, errors: Errors, disc: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """From the disc's centre to each pin's, normal from the disc to the pin, and how deep they overlap."""
        unit, at = self.unit, self._disc(disc)
        gamma = 2 * np.pi * np.arange(unit.pins) / unit.pins
        eccentric = self.crank_turn + 2 * np.pi * disc / unit.discs
        centre = unit.eccentricity * np.exp(1j * eccentric) + u[..., at] + 1j * u[..., at + 1]
        turn = (self.theta + u[..., at + 2])[..., None]
        pin = unit.pin_circle_radius * np.exp(1j * gamma) + errors.pin_centre[:, None]
        pin = pin + errors.pins_at_disc[:, disc, None, None]
        arm = pin - centre[..., None]
        seen = arm * np.exp(-1j * turn)  # the pin's centre in the disc's frame

        def foot(seen: np.ndarray, s: np.ndarray) -> np.ndarray:
            for _ in range(3):  # of the perpendicular; it starts within micrometres
                point, first, second = trochoid(unit, disc, s)
                off = seen - point
                s = s - _along(first, off) / (_along(second, off) - abs(first) ** 2)
            return s

        s = foot(seen, self.theta[:, None] - gamma)
        point, first, _ = trochoid(unit, disc, s)
        if errors.flanks[:, disc].any():  # a flank that moves one way is a pin that moves the other, round the curve
            touched = point - 1j * unit.pin_radius * first / abs(first)
            moved = _wave(errors.flanks[:, None, None, disc], np.angle(touched))
            seen = seen - moved * 1j * touched / abs(touched)
            s = foot(seen, s)
        point, first, _ = trochoid(unit, disc, s)
        outwards = 1j * first / abs(first)
        depth = -_along(outwards, seen - point) + errors.pin_radius[:, None]
        psi = np.angle(point - unit.pin_radius * outwards)
        # the errors' own slope along the flank is left out of the gradient: it tilts the normal by 1e-4
        depth = depth + _wave(errors.profile[:, None, None, disc], psi)
        return arm, outwards * np.exp(1j * turn), depth

    def _pins(self, rows: _Rows, u: np.ndarray, errors: Errors, disc: int) -> None:
        at = self._disc(disc)
        arm, normal, depth = self._pin_contacts(u, errors, disc)
        columns = {at: normal.real, at + 1: normal.imag, at + 2: _along(normal, 1j * arm)}
        rows.push(self.springs.pin, depth, columns)

    def _bearings(self, rows: _Rows, u: np.ndarray, errors: Errors) -> None:
        unit, springs = self.unit, self.springs
        carrier = np.exp(1j * self.theta)
        lean = u[..., 2]
        for j in range(unit.cranks):
            q = self._crank(j)
            crank, crank_lean = u[..., q] + 1j * u[..., q + 1], u[..., q + 2]
            bore = unit.crank_radius * np.exp(2j * np.pi * j / unit.cranks)
            for k in range(unit.discs):
                d = self._disc(k)
                disc, disc_lean = u[..., d] + 1j * u[..., d + 1], u[..., d + 2]
                wrong, wrong_cam = errors.disc_bore[:, None, k, j], errors.cam[:, None, k, j]
                eccentric = np.exp(1j * (self.crank_turn + 2 * np.pi * k / unit.discs))
                on_disc = carrier * (_turned(disc_lean) * bore + np.exp(1j * disc_lean) * wrong)
                on_crank = eccentric * (_turned(crank_lean) * unit.eccentricity + np.exp(1j * crank_lean) * wrong_cam)
                bore_arm = carrier * np.exp(1j * disc_lean) * (bore + wrong)
                cam_arm = eccentric * np.exp(1j * crank_lean) * (unit.eccentricity + wrong_cam)
                columns = {d: 1, d + 1: 1j, d + 2: 1j * bore_arm, q: -1, q + 1: -1j, q + 2: -1j * cam_arm}
                rows.centre(springs.cam, disc + on_disc - crank - on_crank, columns)
            wrong = errors.carrier_bore[:, None, j]
            on_carrier = u[..., 0] + 1j * u[..., 1] + carrier * (_turned(lean) * bore + np.exp(1j * lean) * wrong)
            columns = {
                0: 1, 1: 1j, 2: 1j * carrier * np.exp(1j * lean) * (bore + wrong), q: -1, q + 1: -1j,
            }  # fmt: skip
            rows.centre(springs.carrier, on_carrier - crank, columns)
        rows.centre(springs.main, u[..., 0] + 1j * u[..., 1] - errors.carrier_axis[:, None], {0: 1, 1: 1j})
        sun = self.unknowns - 2
        gap = u[..., sun] + 1j * u[..., sun + 1] - errors.sun_axis[:, None]
        rows.centre(springs.sun, gap, {sun: 1, sun + 1: 1j})

    def _meshes(self, rows: _Rows, u: np.ndarray, errors: Errors) -> None:
        """Loaded flanks of sun and planets; the other flanks have all the play they need.

        Two involutes of base radii b1, b2, at the distance d = (b1 + b2)/cos(alpha) in the direction delta, overlap
        along their line of action by b1 phi1 + b2 phi2 - (b1 + b2)(delta + inv(alpha)) when the sun's
        counter-clockwise flank pushes, and by the mirror image of it when the other does: the sun's flank has run off
        its base circle by b1 (phi1 - delta + alpha), the planet's by b2 (phi2 - delta + alpha), counted towards each
        other, and the tangent between the base circles, (b1 + b2) tan(alpha), lies between them.
        """
        unit, sense, sun = self.unit, self.sense, self.unknowns - 2
        alpha0 = unit.pressure_angle
        b1, b2 = (unit.module * z / 2 * np.cos(alpha0) for z in (unit.sun_teeth, unit.planet_teeth))
        distance = unit.module * (unit.sun_teeth + unit.planet_teeth) / 2
        sun_turn = errors.sun_turn[:, None]
        sun_angle = self.ratio * self.theta + sun_turn
        sun_centre = u[..., sun] + 1j * u[..., sun + 1] + errors.sun_toothing[:, None] * np.exp(1j * sun_angle)
        for j in range(unit.cranks):
            q = self._crank(j)
            place = self.theta + 2 * np.pi * j / unit.cranks
            # the crank leads its planet; play of the spline lets it lag behind the turn (clockwise in forward motion)
            behind = sense * errors.spline_play[:, None, j] / 2
            planet_turn = u[..., q + 2] - errors.lead[:, None, j] - behind
            planet_angle = self.crank_turn + planet_turn
            on_carrier = errors.planet_axis[:, None, j] * np.exp(1j * (self.theta + u[..., 2]))
            on_planet = errors.planet_toothing[:, None, j] * np.exp(1j * planet_angle)
            moved = u[..., q] + 1j * u[..., q + 1] + on_carrier + on_planet - sun_centre
            line = 1 + moved * np.exp(-1j * place) / distance  # centre line over its nominal
            delta, d = np.angle(line), distance * abs(line)
            alpha = np.arccos((b1 + b2) / d)
            involute = np.tan(alpha) - alpha - (np.tan(alpha0) - alpha0)
            overlap = sense * (b1 * sun_turn + b2 * planet_turn - (b1 + b2) * delta) - (b1 + b2) * involute
            # teeth ahead by w turn their flank by w over the pitch radius
            teeth = _wave(errors.sun_waves[:, None], place + delta - sun_angle)
            teeth = teeth + _wave(errors.planet_waves[:, None, j], place + delta + np.pi - planet_angle)
            overlap = overlap + np.cos(alpha0) * (sense * teeth - errors.thinning[:, None] / 2)
            radial = np.exp(1j * place) * line / abs(line)
            pull = -(b1 + b2) / d * (sense * 1j * radial + np.tan(alpha) * radial)  # gradient over the planet's centre
            columns = {
                q: pull.real, q + 1: pull.imag, q + 2: sense * b2 + _along(pull, 1j * on_planet),
                sun: -pull.real, sun + 1: -pull.imag, 2: _along(pull, 1j * on_carrier),
            }  # fmt: skip
            columns = {column: value[..., None] for column, value in columns.items()}
            rows.push(self.springs.mesh, overlap[..., None], columns)

    def contacts(self, u: np.ndarray, errors: Errors) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Compression, gradient, stiffness and one-sidedness of every spring, pins first."""
        rows = _Rows(u.shape[:2], self.unknowns)
        for disc in range(self.unit.discs):
            self._pins(rows, u, errors, disc)
        self._bearings(rows, u, errors)
        self._meshes(rows, u, errors)
        return (
            np.concatenate(rows.compression, axis=-1),
            np.concatenate(rows.gradient, axis=-2),
            np.array(rows.stiffness),
            np.array(rows.one_sided),
        )

    def assembly_gaps(self) -> np.ndarray:
        """Distances that the error-free pose must close, from absolute positions, mm."""
        unit, gaps = self.unit, []
        errors = Errors(unit, 1)
        rows = _Rows((1, self.theta.size), self.unknowns)
        for disc in range(unit.discs):
            self._pins(rows, np.zeros((1, self.theta.size, self.unknowns)), errors, disc)
            eccentric = unit.eccentricity * np.exp(1j * (self.crank_turn + 2 * np.pi * disc / unit.discs))
            for j in range(unit.cranks):
                axis = np.exp(1j * (self.theta + 2 * np.pi * j / unit.cranks)) * unit.crank_radius
                bore = eccentric + np.exp(1j * self.theta) * unit.crank_radius * np.exp(2j * np.pi * j / unit.cranks)
                gaps.append(abs(bore - (axis + eccentric)))
        rolled = unit.sun_teeth * (self.ratio - 1) * self.theta + unit.planet_teeth * (self.crank_turn - self.theta)
        gaps.append(abs(rolled) * unit.module / 2)
        return np.concatenate([*(abs(c).ravel() for c in rows.compression), *gaps])

    def solve(self, errors: Errors, *, extra: np.ndarray | float = 0.0) -> np.ndarray:
        """Displacements of least energy, (case, angle, unknowns); fails where Newton's method does not converge.

        Forces on the unknowns beside the load torque may be given.

        Starts from the loaded pose without errors, if that is known, with the contacts that carry there held shut for
        one step: an error may first open a stiff contact by more than the load closes it.  Without one, the first
        step lets every contact pull, which tells the loaded side from the other.
        """
        cases = errors.sun_turn.size
        u = np.zeros((cases, self.theta.size, self.unknowns))
        open_: np.ndarray | bool = False
        if self._base is not None:
            u, open_ = u + self._base, self._base_open
        load = np.zeros(u.shape) + extra
        load[..., 2] -= self.sense * self.torque  # resists the motion
        for turn in range(40):
            compression, gradient, stiffness, one_sided = self.contacts(u, errors)
            if turn:
                open_ = one_sided & (compression <= 0)
            k = np.where(open_, 0.0, stiffness)
            force = np.einsum("cam,camq->caq", k * compression, gradient) - load
            hessian = np.swapaxes(gradient * k[..., None], -1, -2) @ gradient
            step = np.linalg.solve(hessian, force[..., None])[..., 0]
            u = u - step
            largest = abs(step).max()
            if not largest < 1:
                break
            if turn and largest < 1e-12:
                return u
        raise ArithmeticError(f"the oracle's Newton iteration stopped at a step of {largest:.1e}; try smaller errors")

    def base(self) -> np.ndarray:
        """Pose without errors, (1, angle, unknowns), found once."""
        if self._base is None:
            pose = self.solve(Errors(self.unit, 1))
            compression, _, _, one_sided = self.contacts(pose, Errors(self.unit, 1))
            self._base, self._base_open = pose, one_sided & (compression <= 0)
        return self._base

    def output(self, errors: Errors) -> np.ndarray:
        """Output angle less that of the reducer without errors under the same load, rad, (case, angle)."""
        base = self.base()
        return np.asarray(self.solve(errors)[..., 2] - base[..., 2])

    def influence(self, terms: Sequence[tuple[str, dict[str, Any], str]], *, step: float = 2e-6) -> np.ndarray:
        """Finite difference of the output angle over each parameter, (term, angle), rad per mm or rad."""
        errors = Errors(self.unit, len(terms))
        for case, term in enumerate(terms):
            put(errors, self.unit, case, term, step)
        return self.output(errors) / step

    def rub(self, u: np.ndarray, by: Rubbing, *, motion: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Coulomb friction on bodies at a pose without errors: forces on the unknowns, power lost, torque at the sun.

        Speeds are differences of the exact nominal poses a little earlier and later, per unit of output speed along
        `motion`.  On a pin the material of the disc slides at the point of contact; the pin stands still.  The power
        has the kinds pin, mesh, cam, carrier on its first axis, then (angle,); so has the torque, counter-clockwise,
        that the input must put on the sun.
        """
        unit, step, errors = self.unit, 1e-5, Errors(self.unit, 1)
        earlier, later = (self.theta + way * motion * step for way in (-1, 1))

        def speed(stands: Any) -> Any:
            return (stands(later) - stands(earlier)) / (2 * step)

        compression, _, stiffness, one_sided = self.contacts(u, errors)
        carried = (stiffness * np.where(one_sided, np.maximum(compression, 0), compression))[0]
        pins = unit.discs * unit.pins
        joints = carried[:, pins : pins + 2 * unit.cranks * (unit.discs + 1)]
        joints = np.hypot(*np.moveaxis(joints.reshape(self.theta.size, unit.cranks, unit.discs + 1, 2), -1, 0))
        flanks = carried[:, -unit.cranks :]
        turning = speed(lambda theta: theta)  # of carrier and discs
        rolling = speed(lambda theta: -unit.disc_lobes * theta)  # of cranks and planets
        on_sun = speed(lambda theta: self.ratio * theta)
        force, lost = np.zeros(u.shape), np.zeros((4, self.theta.size))
        for k in range(unit.discs):
            phase, at = 2 * np.pi * k / unit.discs, self._disc(k)
            centre = speed(lambda theta, p=phase: unit.eccentricity * np.exp(1j * (p - unit.disc_lobes * theta)))
            arm, normal, _ = self._pin_contacts(u, errors, k)
            touch = (arm - unit.pin_radius * normal)[0]
            across = 1j * normal[0]
            slip = _along(across, centre[:, None] + 1j * turning[:, None] * touch)
            size = by.pin * carried[:, k * unit.pins : (k + 1) * unit.pins]
            push = -size * np.sign(slip) * across
            lost[0] += (size * abs(slip)).sum(axis=1)
            for row, value in enumerate((push.real, push.imag, _along(1j * touch, push))):
                force[0, :, at + row] += value.sum(axis=1)
        for j in range(unit.cranks):
            crank = self._crank(j) + 2
            for place, (other, lever, kind) in enumerate(
                [*((self._disc(k) + 2, by.cam, 2) for k in range(unit.discs)), (2, by.carrier, 3)]
            ):
                couple = lever * joints[:, j, place] * np.sign(rolling - turning)
                force[0, :, crank] -= couple
                force[0, :, other] += couple
                lost[kind] += abs(couple * (rolling - turning))
            couple = by.mesh * flanks[:, j] * np.sign(rolling - on_sun)
            force[0, :, crank] -= couple
            lost[1] += abs(couple * (rolling - on_sun))
        base = unit.module * unit.sun_teeth / 2 * np.cos(unit.pressure_angle)
        at_sun = flanks.sum(axis=1) * (self.sense * base - by.mesh * np.sign(rolling - on_sun))
        return force, lost, at_sun

    def rubbed(self, by: Rubbing, *, motion: int) -> tuple[np.ndarray, np.ndarray]:
        """Power lost and torque at the sun of the pose in which forces and friction balance, as `rub` tells them."""
        u, before = self.base(), np.zeros(1)
        for _ in range(60):
            force, lost, at_sun = self.rub(u, by, motion=motion)
            if abs(at_sun - before).max() < 1e-6 * abs(at_sun).max():
                return lost, at_sun
            u, before = self.solve(Errors(self.unit, 1), extra=force), at_sun
        raise ArithmeticError("friction and forces of the oracle do not settle; try smaller coefficients")
