"""Planar equilibrium of an RV gear train at exact poses, compiled; `load_trial.kernel` has the unknowns and the energy.

That folder's equilibrium is of the first order in the errors.  It is where this one starts.  At each angle all contacts
are taken at the pose that was found, their energy, which is convex in a step from there, is brought to its least value,
and the contacts are taken anew, until the output rests:

- a pin meets the curve that an errorless pin draws on its disc at the foot of the perpendicular to it;
- bearings of discs, cranks and carrier turn with their parts, bores and cams with their errors as arms;
- sun and planets mesh as involutes at the distance and direction of the centres of their toothings.

    train = train_of(rverror.load_model("model.toml").mechanism)
    solve(train, build(train, errors), theta, 60e3).output   # forward at 60 N m, rad
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from benchmarks.load_trial import newton, planar
from benchmarks.load_trial.kernel import Train, Unit, add_bearing, compiled, inner
from benchmarks.load_trial.newton import BALANCE, STEPS, newton_step
from benchmarks.load_trial.planar import Array, Solved, unknowns

ROUNDS = 30  # times that the contacts are taken anew, at most
PATIENCE = 6  # rounds after which it is enough that the output rests: a disc that carries nothing may go to and fro
RESTS = 1.2e-8  # rad, 0.0025 arcsec: last move of the output
CLOSE = 1e-4  # mm, of anything else: a contact bends by that squared over some mm


class Law(NamedTuple):
    """Force of a pin or a flank that is pressed in by p: reference (stiffness p / reference)^exponent."""

    exponent: float = 1.0
    reference: float = 100.0  # N, at which the stiffness is what it is said to be


LINEAR = Law()


class Contacts(NamedTuple):
    """All contacts, linear in the pose; the first six as `kernel.closings` has them, of which two are filled here."""

    pin: Array  # (nd, zp, 4)
    flank: Array  # (nc, 2, 4)
    eps: Array
    radial: Array
    cam: Array
    bore: Array
    gap: Array  # (nc, nd + 1, 2): crank less disc, or less carrier, in the pose of all zeros
    arm: Array  # (nc, nd + 1, 4): what the angle of disc or carrier moves, and that of the crank
    foot: npt.NDArray[np.complex128]  # (nd, zp, 2): where pins meet the curve, as `curve` has it
    around: npt.NDArray[np.complex128]  # (zp,): directions of the pins from the housing's centre


class Work(NamedTuple):
    """Arrays of `newton`."""

    g: Array
    v: Array
    blocks: Array
    coupling: Array
    crank: Array
    closing: Array
    rate: Array
    x: Array
    before: Array  # the pose before the last round


class Springs(NamedTuple):
    """The train; what of it `newton` takes as it stands, which are its linear contacts; the laws of the others."""

    train: Train
    rest: Train
    law: Law  # of the pins
    flank_law: Law
    open: Array  # (2,): a clearance that nothing crosses


@inner
def unit_vector(angle: float) -> complex:
    """Unit vector at an angle."""
    return complex(np.cos(angle), np.sin(angle))


@inner
def dot(a: complex, b: complex) -> float:
    """Scalar product of two plane vectors."""
    return a.real * b.real + a.imag * b.imag


@inner
def small_turn(angle: float) -> complex:
    """Unit vector at an angle that is mostly small."""
    if abs(angle) > 0.05:
        return unit_vector(angle)
    x = angle * angle
    return complex(1 - x / 2 * (1 - x / 12 * (1 - x / 30)), angle * (1 - x / 6 * (1 - x / 20)))


@inner
def curve(t: Any, pin: complex, cam: complex) -> tuple[complex, complex, complex]:
    """Point of the curve that pin 0 draws on a disc which turns by s, with two derivatives; in the disc's frame.

    The pin is at R e^(-i s), the eccentric at a e^(i (phase - (z_c + 1) s)): while the disc turns by s its centre goes
    round by -z_c s, which its frame sees as -(z_c + 1) s.
    """
    n = t.lobes + 1
    return pin - cam, 1j * (n * cam - pin), n * n * cam - pin


@inner
def find_foot(t: Any, seen: complex, pin: complex, cam: complex, steps: int) -> tuple[complex, complex]:
    """Foot of the perpendicular from where a pin is seen on a disc, by so many of Newton's steps from a near one."""
    for _ in range(steps):
        point, first, second = curve(t, pin, cam)
        off = seen - point
        s = dot(first, off) / (dot(second, off) - dot(first, first))
        pin *= small_turn(s)
        cam *= small_turn((t.lobes + 1) * s)
    return pin, cam


@inner
def touched(t: Any, pin: complex, cam: complex) -> tuple[complex, complex, complex]:
    """Point of the curve, normal into the pin, and where the pin touches the disc."""
    point, first, _ = curve(t, pin, cam)
    outwards = 1j * first * (1 / np.sqrt(dot(first, first)))  # as complex numbers are slow to divide
    return point, outwards, point - t.pin_radius * outwards


@inner
def wave(u: Any, k: int, pitch: int, place: complex) -> float:
    """Waves of disc k at a place in its frame: of the pitch, or of the profile."""
    total, direction = 0.0, place * (1 / np.sqrt(dot(place, place)))
    for w in range(u.disc_waves.shape[0]):
        if int(u.disc_waves[w, 0]) == k and int(u.disc_waves[w, 1]) == pitch:
            turn = complex(1.0, 0.0)
            for _ in range(int(u.disc_waves[w, 2])):
                turn *= direction
            total += u.disc_waves[w, 3] * turn.real + u.disc_waves[w, 4] * turn.imag
    return total


@inner
def lobe(t: Any, u: Any, k: int, place: complex) -> float:
    """Material of the lobe of disc k at a place in its frame; counted as `kernel` says."""
    first = np.ceil(k * t.pins / t.discs - 1e-9) - k / t.discs + 0.5
    at = t.lobes / (2 * np.pi) * np.arctan2(place.imag, place.real) - first
    near = np.floor(at + 0.5)
    return u.lobes[k, int(near) % t.lobes] * np.cos(np.pi * (at - near)) ** 2  # type: ignore[no-any-return]


@inner
def start_feet(t: Any, theta: float, c: Any) -> None:
    """Feet of pins that meet the discs where all is nominal: s is theta less the pin's angle."""
    for k in range(t.discs):
        cam = t.eccentricity * unit_vector(2 * np.pi * k / t.discs - t.pins * theta)
        for i in range(t.pins):
            c.foot[k, i, 0] = t.pin_circle * unit_vector(-theta) * c.around[i]
            c.foot[k, i, 1] = cam


@inner
def take_pins(t: Any, u: Any, theta: float, x: Array, c: Any, steps: int) -> None:
    """Rows and closings of all pins at a pose; feet by so many steps from the last ones."""
    for k in range(t.discs):
        waves, lobes = False, False
        for w in range(u.disc_waves.shape[0]):
            waves = waves or int(u.disc_waves[w, 0]) == k
        for i in range(t.lobes):
            lobes = lobes or u.lobes[k, i] != 0.0
        x0, x1, x2 = x[3 * k], x[3 * k + 1], x[3 * k + 2]
        centre = complex(x0, x1) + t.eccentricity * unit_vector(2 * np.pi * k / t.discs - t.lobes * theta)
        turned = unit_vector(theta + x2)
        for i in range(t.pins):
            pin, cam = c.foot[k, i, 0], c.foot[k, i, 1]
            off = complex(t.pin_circle + u.pin_place[i, 0] + u.grinding[1], u.pin_place[i, 1])
            arm = off * c.around[i] - centre
            seen = arm * turned.conjugate()
            if waves:  # a flank that moves one way is a pin that moves the other; the last foot is near enough for it
                _, _, place = touched(t, pin, cam)
                seen -= 1j * place * (wave(u, k, 1, place) / np.sqrt(dot(place, place)))
            pin, cam = find_foot(t, seen, pin, cam, steps)
            point, outwards, place = touched(t, pin, cam)
            depth = u.pin_radius[i] - u.grinding[0] - dot(outwards, seen - point)
            if waves:
                depth += wave(u, k, 0, place)
            if lobes:
                depth += lobe(t, u, k, place)
            normal = -outwards * turned
            n2 = dot(normal, 1j * arm)
            c.foot[k, i, 0], c.foot[k, i, 1] = pin, cam
            c.pin[k, i, 0], c.pin[k, i, 1], c.pin[k, i, 2] = normal.real, normal.imag, n2
            c.pin[k, i, 3] = depth + normal.real * x0 + normal.imag * x1 + n2 * x2


@inner
def chord(angle: float) -> complex:
    """Unit vector at an angle, less that at none, with all its digits."""
    return complex(-2 * np.sin(angle / 2) ** 2, np.sin(angle))


@inner
def take_bearings(t: Any, u: Any, theta: float, x: Array, c: Any) -> None:
    """Arms and gaps of all bearings at a pose."""
    carrier, nd = 3 * t.discs + 2, t.discs
    for j in range(t.cranks):
        at, ahead = carrier + 3 + 3 * j, 2 * np.pi * j / t.cranks
        for k in range(nd + 1):
            part = 3 * k if k < nd else carrier
            wrong = complex(u.carrier_bores[j, 0], u.carrier_bores[j, 1])
            on_crank, crank_arm = complex(0.0, 0.0), complex(0.0, 0.0)
            if k < nd:
                wrong, cam = complex(u.bores[k, j, 0], u.bores[k, j, 1]), complex(u.cams[j, k, 0], u.cams[j, k, 1])
                eccentric, turn = unit_vector(2 * np.pi * k / nd - t.lobes * theta), chord(x[at + 2])
                crank_arm = eccentric * (1 + turn) * (t.eccentricity + cam)
                on_crank = eccentric * (turn * t.eccentricity + (1 + turn) * cam)
            wrong *= unit_vector(ahead)
            if k == nd:
                wrong += complex(u.runout[0], u.runout[1])
            place, turn = t.crank_circle * unit_vector(ahead), chord(x[part + 2])
            part_arm = 1j * unit_vector(theta) * (1 + turn) * (place + wrong)
            on_part = unit_vector(theta) * (turn * place + (1 + turn) * wrong)
            crank_arm *= 1j
            gap = on_crank - crank_arm * x[at + 2] - on_part + part_arm * x[part + 2]
            c.gap[j, k, 0], c.gap[j, k, 1] = gap.real, gap.imag
            c.arm[j, k, 0], c.arm[j, k, 1] = part_arm.real, part_arm.imag
            c.arm[j, k, 2], c.arm[j, k, 3] = crank_arm.real, crank_arm.imag


@inner
def pressed(law: Any, stiffness: float, p: float) -> tuple[float, float]:
    """Force of a pin or a flank and its derivative."""
    if p <= 0.0:
        return 0.0, 0.0
    k = stiffness * (stiffness * p / law.reference) ** (law.exponent - 1)
    return k * p, law.exponent * k


@inner
def lead(t: Any, u: Any, j: int, sun: float, planet: float) -> float:
    """Way by which teeth are ahead in mesh j, which sun and planet j see in these directions."""
    total = 0.0
    for w in range(u.sun_waves.shape[0]):
        chi = u.sun_waves[w, 0] * sun
        total += u.sun_waves[w, 1] * np.cos(chi) + u.sun_waves[w, 2] * np.sin(chi)
    for w in range(u.planet_waves.shape[0]):
        if int(u.planet_waves[w, 0]) == j:
            chi = u.planet_waves[w, 1] * planet
            total += u.planet_waves[w, 2] * np.cos(chi) + u.planet_waves[w, 3] * np.sin(chi)
    return total


@inner
def take_flanks(t: Any, law: Any, u: Any, theta: float, x: Array, c: Any) -> float:
    """Rows and closings of both flanks of each mesh at a pose; moment that they put on the carrier there.

    Involutes of base radii b1, b2 with centres at the distance d in the direction delta, alpha = acos((b1 + b2) / d):
    the planet's turn phi closes them by b2 phi - (b1 + b2) delta, forward, and by the opposite on the other flank; both
    open by (b1 + b2) inv(alpha).  Of the carrier they take hold by the errors of the planets' axes alone.
    """
    moment = 0.0
    base, cosine = t.sun_base + t.planet_base, np.cos(t.pressure_angle)
    sun, carrier, first, distance = 3 * t.discs, 3 * t.discs + 2, 3 * t.discs + 5, base / cosine
    sun_angle = t.ratio * theta + u.input_turn[0]
    toothing = complex(u.sun_eccentricity[0], u.sun_eccentricity[1]) * unit_vector(sun_angle)
    toothing += complex(u.sun_offset[0], u.sun_offset[1])
    for j in range(t.cranks):
        at, beta = first + 3 * j, theta + 2 * np.pi * j / t.cranks
        place, planet_turn = unit_vector(beta), x[at + 2] - u.crank_lead[j]
        planet_angle = planet_turn - t.lobes * theta
        on_planet = complex(u.planet_eccentricity[j, 0], u.planet_eccentricity[j, 1]) * unit_vector(planet_angle)
        on_carrier = complex(u.centre_distance[j, 0], u.centre_distance[j, 1]) * place * small_turn(x[carrier + 2])
        apart = complex(x[at] - x[sun], x[at + 1] - x[sun + 1])
        line = 1 + (apart + on_carrier + on_planet - toothing) * place.conjugate() / distance
        size = np.sqrt(dot(line, line))
        delta, alpha = np.arctan2(line.imag, line.real), np.arccos(base / (distance * size))
        slack = base * (np.tan(alpha) - alpha - np.tan(t.pressure_angle) + t.pressure_angle)
        slack += 0.5 * (t.backlash + cosine * u.thinning[j])
        if u.spline[j] > 0.0:
            slack += t.planet_base * u.spline[j] / (2 * t.spline_radius)
        teeth = lead(t, u, j, beta + delta - sun_angle, beta + delta + np.pi - planet_angle)
        ahead = t.sun_base * u.input_turn[0] + t.planet_base * planet_turn - base * delta + cosine * teeth
        away = place * line / size
        for side in range(2):
            s = 1.0 - 2 * side
            n = base / (distance * size) * (s * 1j + np.tan(alpha)) * away
            n2 = dot(n, 1j * on_planet) - s * t.planet_base
            c.flank[j, side, 0], c.flank[j, side, 1], c.flank[j, side, 2] = n.real, n.imag, n2
            c.flank[j, side, 3] = s * ahead - slack + dot(n, apart) + n2 * x[at + 2]
            moment += pressed(law, t.k_mesh, s * ahead - slack)[0] * dot(n, 1j * on_carrier)
    return moment


@inner
def add_pins(t: Any, law: Any, x: Array, c: Any, w: Any) -> None:
    """Add pins of a power law to gradient and matrices."""
    for k in range(t.discs):
        at, block = 3 * k, w.blocks[k]
        for i in range(t.pins):
            n = c.pin[k, i]
            force, stiffness = pressed(law, t.k_pin, n[3] - n[0] * x[at] - n[1] * x[at + 1] - n[2] * x[at + 2])
            for q in range(3):
                w.g[at + q] -= force * n[q]
                for r in range(q, 3):
                    block[q, r] += stiffness * n[q] * n[r]


@inner
def add_flanks(t: Any, law: Any, x: Array, c: Any, w: Any) -> None:
    """Add flanks of a power law to gradient and matrices."""
    sun, first, block, coupling = 3 * t.discs, 3 * t.discs + 5, w.blocks[t.discs], w.coupling[t.discs]
    for j in range(t.cranks):
        o, q = first + 3 * j, 3 * j
        for side in range(2):
            n = c.flank[j, side]
            p = n[3] + n[0] * (x[sun] - x[o]) + n[1] * (x[sun + 1] - x[o + 1]) - n[2] * x[o + 2]
            force, stiffness = pressed(law, t.k_mesh, p)
            for r in range(3):
                w.g[o + r] -= force * n[r]
                for s in range(r, 3):
                    w.crank[q + r, q + s] += stiffness * n[r] * n[s]
            for r in range(2):
                w.g[sun + r] += force * n[r]
                for s in range(r, 2):
                    block[r, s] += stiffness * n[r] * n[s]
                for s in range(3):
                    coupling[r, q + s] -= stiffness * n[r] * n[s]


@inner
def assemble(springs: Any, x: Array, load: float, clearance: Array, c: Any, w: Any) -> None:
    """Gradient and second derivative of the energy at x."""
    t, nd = springs.train, springs.train.discs
    newton.assemble(
        springs.rest, x, c.pin, c.flank, c.eps, c.radial, c.cam, c.bore, springs.open, load, w.g, w.blocks, w.coupling,
        w.crank,
    )  # fmt: skip
    if springs.law.exponent != 1.0:
        add_pins(t, springs.law, x, c, w)
    if springs.flank_law.exponent != 1.0:
        add_flanks(t, springs.flank_law, x, c, w)
    for j in range(t.cranks):
        o = 3 * nd + 5 + 3 * j
        for k in range(nd + 1):
            at, b, a = (3 * k, k, c.arm[j, k]) if k < nd else (3 * nd + 2, nd + 1, c.arm[j, k])
            d0 = c.gap[j, k, 0] + x[o] + a[2] * x[o + 2] - x[at] - a[0] * x[at + 2]
            d1 = c.gap[j, k, 1] + x[o + 1] + a[3] * x[o + 2] - x[at + 1] - a[1] * x[at + 2]
            stiffness, play = (t.k_cam, clearance[0]) if k < nd else (t.k_bore, clearance[1])
            add_bearing(
                stiffness, play, d0, d1, a[0], a[1], a[2], a[3], at, o, w.g, w.blocks[b], w.coupling[b], w.crank, j
            )


@inner
def along(t: Any, x: Array, c: Any, w: Any) -> None:
    """Closings of all contacts at x and their change along the step."""
    nd, v = t.discs, w.v
    newton.along(t, x, c.pin, c.flank, c.eps, c.radial, c.cam, c.bore, v, w.closing, w.rate)
    at = nd * t.pins + 2 * t.cranks
    for j in range(t.cranks):
        o = 3 * nd + 5 + 3 * j
        for k in range(nd + 1):
            q, a = 3 * k if k < nd else 3 * nd + 2, c.arm[j, k]
            for r in range(2):
                w.closing[at + r] = c.gap[j, k, r] + x[o + r] + a[2 + r] * x[o + 2] - x[q + r] - a[r] * x[q + 2]
                w.rate[at + r] = v[o + r] + a[2 + r] * v[o + 2] - v[q + r] - a[r] * v[q + 2]
            at += 2


@inner
def slope(springs: Any, x: Array, load: float, clearance: Array, w: Any, s: float) -> float:
    """Slope of the energy along the step at s of it, N mm."""
    t, law, flank_law, pins = springs.train, springs.law, springs.flank_law, springs.train.discs * springs.train.pins
    total: float = newton.slope(springs.rest, x, w.v, load, clearance, w.closing, w.rate, s)
    if law.exponent != 1.0:
        for i in range(pins):
            total += pressed(law, t.k_pin, w.closing[i] + s * w.rate[i])[0] * w.rate[i]
    if flank_law.exponent != 1.0:
        for i in range(pins, pins + 2 * t.cranks):
            total += pressed(flank_law, t.k_mesh, w.closing[i] + s * w.rate[i])[0] * w.rate[i]
    return total


@inner
def length(springs: Any, x: Array, load: float, clearance: Array, w: Any, start: float) -> float:
    """How far to go along the step: to where the slope, which grows, is small against that at its start."""
    low, high, s = 0.0, 0.0, 1.0
    slope_low, slope_high = start, 0.0
    for _ in range(40):
        here = slope(springs, x, load, clearance, w, s)
        if abs(here) <= 0.3 * abs(start) or (high > 0.0 and high - low < 1e-12 * high):
            break
        if here < 0.0:
            low, slope_low = s, here
        else:
            high, slope_high = s, here
        if high > 0.0:  # between the secant and the middle, so that either end moves
            secant = low - slope_low * (high - low) / (slope_high - slope_low)
            s = 0.5 * (0.5 * (low + high) + secant)
        else:
            s = 2.0 * s
    return s


@inner
def largest(t: Any, g: Array, turning: float) -> float:
    """Largest entry of a vector over the unknowns, those of angles times a factor; what is no number wins."""
    most, carrier = 0.0, 3 * t.discs + 2
    for i in range(g.size):
        turns = i % 3 == 2 if i < carrier - 2 else i >= carrier and (i - carrier) % 3 == 2
        size = abs(g[i]) * turning if turns else abs(g[i])
        if not size <= most:
            most = size
    return most


@inner
def settle(springs: Any, x: Array, load: float, clearance: Array, c: Any, w: Any) -> bool:
    """Move x to the least energy of contacts that stay linear; False where that is not reached."""
    t, ridge, count = springs.train, 0.0, 0
    while True:
        assemble(springs, x, load, clearance, c, w)
        if largest(t, w.g, 1 / t.crank_circle) <= BALANCE * abs(load) / t.crank_circle:
            return True
        if count == 4 * STEPS or ridge > 1e6 * t.k_pin:
            return False
        if not newton_step(t, w.g, w.blocks, w.coupling, w.crank, ridge, w.v):
            ridge = max(10 * ridge, 1e-7 * t.k_pin)
            continue
        ridge, count, start = 0.0, count + 1, 0.0
        for i in range(x.size):
            start += w.g[i] * w.v[i]
        along(t, x, c, w)
        s = length(springs, x, load, clearance, w, start)
        for i in range(x.size):
            x[i] += s * w.v[i]


@inner
def rest(springs: Any, u: Any, theta: float, load: float, x: Array, c: Any, w: Any) -> int:
    """Move x to the equilibrium at one angle; rounds taken, -1 where the output does not rest."""
    t, turned, before = springs.train, 3 * springs.train.discs + 4, w.before
    for turn in range(ROUNDS):
        take_pins(t, u, theta, x, c, 1 if turn else 2)
        take_bearings(t, u, theta, x, c)
        moment = take_flanks(t, springs.flank_law, u, theta, x, c)
        for i in range(x.size):  # loops, as numba compiles them faster than slices
            before[i] = x[i]
        if not settle(springs, x, load + moment, u.clearance, c, w):
            return -1
        for i in range(x.size):
            before[i] -= x[i]
        if abs(before[turned]) < RESTS and (turn >= PATIENCE or largest(t, before, t.crank_circle) < CLOSE):
            return turn + 1
    return -1


@compiled
def over_angles(
    springs: Any, u: Any, thetas: Array, loads: Array, near: Array, c: Any, w: Any, poses: Array, rounds: Any
) -> None:
    """Solve at each angle; ``near``, the poses of the first order, show how the pose goes on from the neighbour's."""
    t, x = springs.train, w.x
    for m in range(thetas.size):
        start_feet(t, thetas[m], c)
        warm = m > 0 and rounds[m - 1] > 0
        for q in range(x.size):
            x[q] = near[m, q] + (x[q] - near[m - 1, q] if warm else 0.0)
        rounds[m] = rest(springs, u, thetas[m], loads[m], x, c, w)
        for q in range(x.size):
            poses[m, q] = x[q]


def solve(
    train: Train, unit: Unit, theta: Array, load: float | Array, law: Law = LINEAR, flank_law: Law = LINEAR
) -> Solved:
    """Solve the statics at the angles theta, rad, with the input held at its nominal angle.

    Parameters
    ----------
    load : float or ndarray
        Torque on the output that resists forward motion, N mm; below 0 for reverse; one, or one for each angle.
    law, flank_law : Law
        Of the pins, and of the flanks of the gears.

    Returns
    -------
    Solved
        Its ``steps`` are the times that the contacts were taken; below 0 where the output does not rest.
    """
    nd, nc, zp, n = train.discs, train.cranks, train.pins, unknowns(train)
    near = planar.solve(train, unit, theta, load)
    contacts = Contacts(
        pin=np.zeros((nd, zp, 4)),
        flank=np.zeros((nc, 2, 4)),
        eps=np.zeros((nd, 2)),
        radial=np.zeros((nc, 2)),
        cam=np.zeros((nc, nd, 2)),
        bore=np.zeros((nc, 2)),
        gap=np.zeros((nc, nd + 1, 2)),
        arm=np.zeros((nc, nd + 1, 4)),
        foot=np.zeros((nd, zp, 2), dtype=complex),
        around=np.exp(2j * np.pi * np.arange(zp) / zp),
    )
    count = nd * zp + 2 * nc + 2 * nc * (nd + 1)
    work = Work(
        g=np.zeros(n),
        v=np.zeros(n),
        blocks=np.zeros((nd + 2, 3, 3)),
        coupling=np.zeros((nd + 2, 3, 3 * nc)),
        crank=np.zeros((3 * nc, 3 * nc)),
        closing=np.zeros(count),
        rate=np.zeros(count),
        x=np.zeros(n),
        before=np.zeros(n),
    )
    bare = train._replace(
        k_pin=train.k_pin if law.exponent == 1 else 0.0, k_mesh=train.k_mesh if flank_law.exponent == 1 else 0.0
    )
    springs = Springs(train, bare, law, flank_law, np.full(2, np.inf))
    poses, rounds = np.zeros((theta.size, n)), np.zeros(theta.size, dtype=np.int64)
    over_angles(
        springs,
        unit,
        np.asarray(theta, dtype=float),
        np.zeros(theta.size) - load,
        near.poses,
        contacts,
        work,
        poses,
        rounds,
    )
    return Solved(poses[:, 3 * nd + 4].copy(), poses, rounds)
