"""Cycloid-pin mesh: profile, contact normals, load sharing, and the error sources of discs, pins and disc bores."""

from __future__ import annotations

import numpy as np

from rverror.base.arrays import Array, dot, norms, only, radial_and_tangential
from rverror.geartrain.action_line import Compliance, Contacts, ErrorSpots, ErrorVector, ErrorWaves
from rverror.geartrain.feedback import feedback_factor
from rverror.geartrain.kinematics import fundamental_orders
from rverror.geartrain.mechanism import Mechanism, Reducer
from rverror.geartrain.source import (
    AROUND,
    CRANK,
    DISC,
    EITHER_WAY,
    PIN,
    IndexValue,
    Indices,
    Source,
    axes_and_corners,
    bore_orders,
    chosen,
    compliances,
    every,
    harmonics,
    leads,
    lengths,
    or_all,
    pin_wave_orders,
    rv,
)

#: Sources of which other rooms make errors: those of wear, and those that machines measure.
LOBE_PROFILE, DISC_PROFILE, PIN_RADIUS = "cycloid.lobe_profile", "cycloid.disc_profile", "cycloid.pin_radius"
PIN_POSITION, PIN_CIRCLE, DISC_BORE = "cycloid.pin_position", "cycloid.pin_circle", "cycloid.disc_bore_position"
DISC_PITCH, DISC_LOBE = "cycloid.disc_pitch", "cycloid.disc_lobe"


def pin_positions(reducer: Reducer) -> Array:
    """Angles of the pins on the pin circle, 2 pi i / z_p, rad.

    Parameters
    ----------
    reducer : Reducer

    Returns
    -------
    ndarray, shape (pins,)
    """
    return 2 * np.pi * np.arange(reducer.pins) / reducer.pins


def roll_angles(contacts: Contacts) -> Array:
    """Angle phi by which the eccentric direction of each disc leads each pin.

    Parameters
    ----------
    contacts : Contacts

    Returns
    -------
    ndarray, shape (discs, pins, n)
        rad.
    """
    return contacts.eccentric[:, None] - pin_positions(contacts.reducer)[:, None]


def pin_contacts(reducer: Reducer, eccentric: Array) -> tuple[Array, Array, Array]:
    """Contact normals, arms and contact points, from the disc's centre, of all pins on all discs.

    The pitch circles, of radius a z_c on the disc and a z_p in the housing, touch at the pitch point P, a z_p along the
    eccentric direction from the housing centre.  Every contact normal passes through its pin and P; its arm about the
    disc centre is a z_c times the sine of its angle to the eccentric direction.

    Parameters
    ----------
    reducer : Reducer
    eccentric : ndarray, shape (discs, n)
        Angle of each disc's eccentric direction in the housing, rad.

    Returns
    -------
    normal, arm, point : ndarray, shape (discs, pins, 2, n), (discs, pins, n), (discs, pins, 2, n)
        Normals point from the pin into the disc.

    Notes
    -----
    Source 000, section 3 (n13), without its pressure angle: P makes it superfluous.  Source 003 prints the profile
    with e in place of K; source 002 prints K inverted.
    """
    along, across = radial_and_tangential(eccentric)
    pin, _ = radial_and_tangential(pin_positions(reducer)[:, None])
    pin = reducer.pin_circle_radius * pin
    normal = reducer.eccentricity * reducer.pins * along[:, None] - pin  # towards the pitch point
    normal /= norms(normal)
    arm = dot(reducer.eccentricity * reducer.disc_lobes * across[:, None], normal)
    point = reducer.pin_radius * normal + pin - reducer.eccentricity * along[:, None]
    return normal, arm, point


def trochoid_curvature(reducer: Reducer, roll_angle: Array) -> Array:
    r"""Curvature of the curve that a pin's centre draws on a disc,

    .. math:: \kappa = (1 + z_p K^2 - K (z_p + 1) \cos\phi) / (R_p (1 + K^2 - 2K\cos\phi)^{3/2}).

    Parameters
    ----------
    reducer : Reducer
    roll_angle : ndarray
        Angle phi by which the eccentric direction leads the pin, rad.

    Returns
    -------
    ndarray
        1/mm, positive where the disc is convex; in the shape of the angles.

    Notes
    -----
    In none of the sources; from z' and z'' of z = (R_p - a e^{i phi}) e^{i phi / z_c}.
    """
    K, z, distance = reducer.short_width_coefficient, reducer.pins, pitch_distance(reducer, roll_angle)
    bend = 1 + z * K**2 - K * (z + 1) * np.cos(roll_angle)
    return np.asarray(bend / (reducer.pin_circle_radius * distance * distance * distance))


def profile(reducer: Reducer, roll_angle: Array) -> Array:
    """Nominal profile of a disc, the offset by the pin radius of the curve that a pin centre draws on the disc.

    Parameters
    ----------
    reducer : Reducer
    roll_angle : ndarray, shape (n,)
        Angle phi by which the eccentric direction leads the pin, rad; one lobe per turn, the whole disc in z_c turns.

    Returns
    -------
    ndarray, shape (2, n)
        Points in a frame at the disc centre in which a lobe's root lies on +x, mm.

    Notes
    -----
    Source 003 (its x and y swap sine and cosine, lose K/z_p and carry the wrong sign before the second term) and
    source 001 (its e cos((Z_p + 1) phi) belongs to a disc that it does not describe).
    """
    a = reducer.eccentricity
    position = roll_angle / reducer.disc_lobes  # angle of the pin on the disc, which turns a z_c-th of the crank
    pin, _ = radial_and_tangential(position)
    ahead, _ = radial_and_tangential(position + roll_angle)
    centre = reducer.pin_circle_radius * pin - a * ahead
    pitch_point = a * reducer.disc_lobes * ahead
    normal = pitch_point - centre
    normal /= norms(normal)
    return centre + reducer.pin_radius * normal


def loaded_share(reducer: Reducer, roll_angle: Array) -> Array:
    r"""Approach of a pin contact over the largest one when the disc turns, sin(phi) / sqrt(S).

    It is the arm of the contact normal over the longest arm, l / (a z_c), with S = 1 + K^2 - 2 K cos(phi).

    Parameters
    ----------
    reducer : Reducer
    roll_angle : ndarray, shape (n,)
        Angle phi by which the eccentric direction leads the pin, rad.

    Returns
    -------
    ndarray, shape (n,)
        1 where cos(phi) = K; negative on the other side.

    Notes
    -----
    Source 002 (delta_i) without its square root.
    """
    return np.asarray(np.sin(roll_angle) / pitch_distance(reducer, roll_angle))


def normal_gap(reducer: Reducer, roll_angle: Array, *, equidistant: float, shift: float) -> Array:
    r"""Gap that profile modification opens along the common normal, the disc in its nominal place.

        equidistant + shift (1 - K cos(phi)) / sqrt(S),    S = 1 + K^2 - 2 K cos(phi).

    Parameters
    ----------
    reducer : Reducer
    roll_angle : ndarray, shape (n,)
        Angle phi by which the eccentric direction leads the pin, rad.
    equidistant, shift : float
        Offset of the profile along its normal, and of the grinding tool's pin circle towards the centre; positive
        removes material, mm.

    Returns
    -------
    ndarray, shape (n,)
        mm.
    """
    inward = (1 - reducer.short_width_coefficient * np.cos(roll_angle)) / pitch_distance(reducer, roll_angle)
    return np.asarray(equidistant + shift * inward)


def pitch_distance(reducer: Reducer, roll_angle: Array) -> Array:
    """Distance from pin to pitch point over the pin circle's radius, sqrt(1 + K^2 - 2 K cos(phi)).

    Parameters
    ----------
    reducer : Reducer
    roll_angle : ndarray
        Angle phi by which the eccentric direction leads the pin, rad.

    Returns
    -------
    ndarray
        In the shape of the angles.
    """
    K = reducer.short_width_coefficient
    return np.asarray(np.sqrt(1 + K**2 - 2 * K * np.cos(roll_angle)), dtype=np.float64)


def pin_forces(contacts: Contacts) -> Array:
    """Force of each pin on each disc per unit of output torque, rigid bearings and equal contact stiffness.

    Only pins on the loaded side carry, those whose normal turns the disc in the direction of motion.  Turning the
    output by dTheta with the sun held closes pin i by l_i dTheta / F, so equal springs share the torque as

        lambda_i = F l_i / sum(l^2),    sum over the loaded pins of all discs.

    Parameters
    ----------
    contacts : Contacts

    Returns
    -------
    ndarray, shape (discs, pins, 2, n)
        1/mm.

    Notes
    -----
    (F / n_discs) l_i / sum(l_i^2) over the pins of one disc is the same wherever the discs mesh in phase, as they do
    when n_discs divides z_p; this form is the rigid limit in every case.
    """
    size = contacts.pin_arm * contacts.sense
    np.maximum(size, 0.0, out=size)
    turn = contacts.reducer.output_turn * feedback_factor(contacts.reducer)
    size *= turn * contacts.sense / np.einsum("kpn,kpn->n", size, size)
    return np.asarray(size[..., None, :] * contacts.pin_normal, dtype=np.float64)


def disc_profile(contacts: Contacts, *, disc: int, harmonic: int) -> ErrorWaves:
    """Error of a disc's profile along its normal, c cos(h psi) + s sin(h psi) over the contact angle psi.

    Parameters
    ----------
    contacts : Contacts
    disc, harmonic : int
        Which disc; h, waves around it.

    Returns
    -------
    ErrorWaves
        Terms cos, sin; positive is more material.

    Notes
    -----
    Sources 000 (delta_31) and 002 (its e_pd projects by the angle of the pin, not of the normal).
    """
    here = only(disc)
    phase, direction = contacts.pin_phase[here], contacts.pin_normal[here]
    return ErrorWaves(contact="pin", phase=phase, harmonic=harmonic, direction=direction, at=(here,))


def first_root(reducer: Reducer, disc: int) -> float:
    """Root from which the lobes of a disc are counted, in pitches from the disc's bore 0.

    It is the root into which the eccentric points at theta = 0, or the next one where it points into none: at
    2 pi k/n_d the eccentric lies z_p times its angle from the root ahead of it on the disc.

    Parameters
    ----------
    reducer : Reducer
    disc : int

    Returns
    -------
    float
    """
    return -(-disc * reducer.pins // reducer.discs) - disc / reducer.discs


def disc_lobe(contacts: Contacts, *, disc: int, lobe: int) -> ErrorSpots:
    """Local defect of a disc: one lobe worn or raised along its normal, most at its crest, nothing at its roots.

        deviation cos^2(z_c (psi - psi_l) / 2) within half a pitch of its crest at psi_l.

    Parameters
    ----------
    contacts : Contacts
    disc, lobe : int
        Which disc; which lobe, counter-clockwise from the root into which the eccentric points at theta = 0, or from
        the next root where it points into none.

    Returns
    -------
    ErrorSpots
        Term deviation, mm; positive is more material.

    Notes
    -----
    A lobe meets one pin with each turn of the crank against the carrier, so the defect is seen once a turn of it and
    shows at all multiples of that order.  No source has it; 001 and 002 describe errors of the profile as waves.
    """
    unit, here = contacts.reducer, only(disc)
    lobes = unit.disc_lobes
    away = contacts.pin_pitch[here] - (first_root(unit, disc) + lobe) % lobes  # from the lobe's first root, in pitches
    met = np.flatnonzero(((away >= 0) & (away < 1)) | (away < 1 - lobes))
    where = np.unravel_index(met, away.shape)  # `nonzero` of three axes takes three times as long
    size = np.sin(np.pi * away[where]) ** 2
    return ErrorSpots(contact="pin", where=where, size=size, direction=contacts.pin_normal[here], at=(here,))


def lobe_profile(contacts: Contacts, *, disc: int, harmonic: int) -> ErrorWaves:
    """Error of a disc's profile along its normal that is alike on all lobes, c cos(h phi) + s sin(h phi).

    Parameters
    ----------
    contacts : Contacts
    disc, harmonic : int
        Which disc; h, waves from one root to the next over the roll angle phi by which the eccentric direction leads
        the pin that touches there.  0 is the whole profile, by cos.

    Returns
    -------
    ErrorWaves
        Terms cos, sin; positive is more material.

    Notes
    -----
    What wear leaves (`wear`), and any correction of the profile.  No source has it; 002 corrects profiles by their
    normal and a shift alone.
    """
    here = only(disc)
    phase = np.exp(1j * roll_angles(contacts)[here])
    return ErrorWaves(contact="pin", phase=phase, harmonic=harmonic, direction=contacts.pin_normal[here], at=(here,))


def disc_pitch(contacts: Contacts, *, disc: int, harmonic: int) -> ErrorWaves:
    """Pitch error of a disc: its flanks lead tangentially by c cos(h psi) + s sin(h psi) over the contact angle psi.

    Parameters
    ----------
    contacts : Contacts
    disc, harmonic : int
        Which disc; h, waves around it.

    Returns
    -------
    ErrorWaves
        Terms cos, sin; counter-clockwise positive.

    Notes
    -----
    Sources 001 (cumulative pitch error) and 002 (e_Apd).
    """
    here = only(disc)
    phase, direction = contacts.pin_phase[here], contacts.pin_behind[here]
    return ErrorWaves(contact="pin", phase=phase, harmonic=harmonic, direction=direction, at=(here,))


def pin_position(contacts: Contacts, *, pin: int) -> ErrorVector:
    """Displacement of one pin in the housing.

    Parameters
    ----------
    contacts : Contacts
    pin : int
        Which pin.

    Returns
    -------
    ErrorVector
        Terms radial (away from the housing centre), tangential (counter-clockwise).

    Notes
    -----
    Sources 001, 002 (E_R and E_AR, projected there by the pin's angle instead of the normal's) and 004, whose
    z_c dr / r is wrong by a factor of about 50.
    """
    angle = pin_positions(contacts.reducer)[pin : pin + 1, None]
    vector = np.stack(radial_and_tangential(angle))[:, None]
    return ErrorVector(contact="pin", vector=vector, at=(slice(None), only(pin)))


def pin_circle(contacts: Contacts, *, harmonic: int) -> ErrorVector:
    """Displacement of all pins by a wave over the pin's angle gamma in the housing.

    Parameters
    ----------
    contacts : Contacts
    harmonic : int
        h, waves around the pin circle; 0 changes the radius, or turns the ring.

    Returns
    -------
    ErrorVector
        Terms radial_cos, radial_sin, tangential_cos, tangential_sin.

    Notes
    -----
    Source 001 (pin circle diameter, cumulative pitch error of the pins).
    """
    gamma = pin_positions(contacts.reducer)[:, None]
    radial, tangential = radial_and_tangential(gamma)
    cos, sin = np.cos(harmonic * gamma)[:, None], np.sin(harmonic * gamma)[:, None]
    vector = np.stack([cos * radial, sin * radial, cos * tangential, sin * tangential])
    return ErrorVector(contact="pin", vector=vector[:, None])


def pin_circle_tilt(contacts: Contacts) -> ErrorVector:
    """Tilt of the pin circle's axis against that of the output: a shift of the pins that differs from disc to disc.

    Parameters
    ----------
    contacts : Contacts

    Returns
    -------
    ErrorVector
        Terms x, y: shift at the first disc; at the last it is as far the other way, between them evenly spaced.

    Notes
    -----
    A shift that all discs share turns no output, because the discs push the pins in opposite directions; a tilt, as of
    the housing's seat or the main bearing, does so once a turn of the eccentric in the housing.  No source text has it.
    """
    along_axis = np.linspace(1.0, -1.0, contacts.reducer.discs) if contacts.reducer.discs > 1 else np.zeros(1)
    return ErrorVector(contact="pin", vector=np.eye(2)[:, None, None, :, None] * along_axis[:, None, None, None])


def pin_radius(contacts: Contacts, *, pin: int | str) -> ErrorVector:
    """Deviation of the radius of one pin, or of all of them.

    Parameters
    ----------
    contacts : Contacts
    pin : int or "all"
        Which pin.

    Returns
    -------
    ErrorVector
        Term deviation; positive is more material.

    Notes
    -----
    Sources 000 (named as missing), 001 and 004 (pin diameter, groove radius).
    """
    at = (slice(None), chosen(pin))
    return ErrorVector(contact="pin", vector=contacts.pin_normal[at][None], at=at)


def profile_modification(contacts: Contacts) -> ErrorVector:
    """Modification of the profile of all discs, equidistant and by shift of the grinding tool's pin circle.

    Parameters
    ----------
    contacts : Contacts

    Returns
    -------
    ErrorVector
        Terms equidistant (along the normal), shift (the tool's pin circle towards the centre, times the normal's
        component towards it); positive removes material, negative adds.

    Notes
    -----
    Sources 000 (named as missing) and 002, whose cos(tau) serves both terms.  It removes equidistant as thinner pins
    would, and shift as a wider pin circle would: in the transmission error it cannot be told from these.  What is
    nonlinear is which pins still carry, and that the equilibrium finds; the closed form takes the whole loaded half to
    stay loaded.
    """
    normal = contacts.pin_normal
    radial, _ = radial_and_tangential(pin_positions(contacts.reducer)[:, None])
    return ErrorVector(contact="pin", vector=np.stack([-normal, np.broadcast_to(radial, normal.shape)]))


def disc_bore_position(contacts: Contacts, *, disc: int, crank: int) -> ErrorVector:
    """Displacement of one crank bore in a disc.

    Parameters
    ----------
    contacts : Contacts
    disc, crank : int
        Which disc, and which of its bores.

    Returns
    -------
    ErrorVector
        Terms radial (away from the disc centre), tangential (counter-clockwise).

    Notes
    -----
    Sources 000 (named as missing) and 001 (crank hole errors).
    """
    vector = np.stack(contacts.crank_directions)[:, crank]
    return ErrorVector(contact="cam", vector=vector[:, None, None], at=(only(disc), only(crank)))


def pin_compliance(contacts: Contacts, *, pin: int | str) -> Compliance:
    """Compliance of one pin's contacts, or of all of them, more than nominal.

    Parameters
    ----------
    contacts : Contacts
    pin : int or "all"
        Which pin, against every disc.

    Returns
    -------
    Compliance
        Term compliance; positive is softer.

    Notes
    -----
    Source 001 counts the stiffness of the pins without an error of its own.  "all" is how far the declared
    ``pin_contact`` is off.
    """
    return Compliance(contact="pin", share=np.ones((1, 1, 1, 1)), at=(slice(None), chosen(pin)))


def pin_compliance_wave(contacts: Contacts, *, harmonic: int) -> Compliance:
    """Wave of the pins' compliance over their angle gamma in the housing: a housing that bends between its feet.

    Parameters
    ----------
    contacts : Contacts
    harmonic : int
        h, waves around the pin circle.

    Returns
    -------
    Compliance
        Terms cos, sin.

    Notes
    -----
    Its wave in the output grows in proportion to the load, lagging forward and leading in reverse.
    """
    gamma = pin_positions(contacts.reducer)
    waves = np.stack([np.cos(harmonic * gamma), np.sin(harmonic * gamma)])
    return Compliance(contact="pin", share=waves[:, None, :, None])


def _one_pin_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    """Discs pass a pin one after another: only multiples of the number of discs stay."""
    if indices.get("pin") == "all":
        return pin_wave_orders(mechanism, indices)
    unit = rv(mechanism)
    return (unit.discs * fundamental_orders(unit)["housing"],)


def _tilt_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    """One disc has no other to be tilted against."""
    return (fundamental_orders(rv(mechanism))["housing"],) if rv(mechanism).discs > 1 else ()


def _mesh_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    """All pins pass all lobes alike."""
    return (fundamental_orders(rv(mechanism))["cycloid mesh"],)


def _lobes_beside(mechanism: Mechanism, value: IndexValue) -> list[tuple[IndexValue, float]]:
    return [((int(value) + step) % rv(mechanism).disc_lobes, 1.0) for step in (1, -1)]


_LOBE = every("lobe", lambda unit: range(unit.disc_lobes), _lobes_beside)
_PIN_OR_ALL = every("pin", lambda unit: [*range(unit.pins), "all"], PIN.equivalents)

SOURCES = (
    Source(
        DISC_PROFILE, disc_profile, (DISC, harmonics(1, 4)), lengths(30, "cos", "sin"),
        "disc", leads("disc"), "000, delta_31; 002, e_pd", "profile error of a disc, normal",
        starts=AROUND,
        equation=r"$\delta = (c\cos h\psi_i + s\sin h\psi_i)\, n_i$",
    ),
    Source(
        DISC_PITCH, disc_pitch, (DISC, harmonics(1, 4)), lengths(30, "cos", "sin"),
        "disc", leads("disc"), "001; 002, e_Apd", "pitch error of a disc, tangential",
        starts=AROUND,
        equation=r"$\delta = -(c\cos h\psi_i + s\sin h\psi_i)\, \tau_i$",
    ),
    Source(
        DISC_LOBE, disc_lobe, (DISC, _LOBE), lengths(50, "deviation"),
        "disc", leads("disc"), "none: a local defect", "one worn or damaged lobe of a disc", in_tables=False,
        starts=EITHER_WAY,
        equation=r"$\delta = e \cos^2(z_c(\psi_i - \psi_l)/2)\, n_i$ where $\lvert\psi_i - \psi_l\rvert < \pi/z_c$",
    ),
    Source(
        LOBE_PROFILE, lobe_profile, (DISC, harmonics(0, 4)), lengths(20, "cos", "sin"),
        "disc", _mesh_orders, "none: wear", "profile error alike on all lobes of a disc",
        alike_at_pins=lambda indices: True, tried=False,
        equation=r"$\delta = (c\cos h\varphi_i + s\sin h\varphi_i)\, n_i$",
    ),
    Source(
        PIN_POSITION, pin_position, (PIN,), lengths(50, "radial", "tangential"),
        "housing", _one_pin_orders, "001; 002, e_R and e_AR; 004", "displacement of one pin",
        # inward, and 51 and 120 deg to either side: discs touch a pin up to asin K_1, some 50 deg, beside its radius,
        # so what points up to 140 deg from inward closes gaps there
        starts=((-0.2, 0.0), (-0.2, 0.25), (-0.2, -0.25), (0.2, 0.35), (0.2, -0.35)),
        equation=r"$\delta = e_r\, p_i + e_t\, p_i^\perp$",
    ),
    Source(
        PIN_CIRCLE, pin_circle, (harmonics(0, 6),),
        lengths(50, "radial_cos", "radial_sin", "tangential_cos", "tangential_sin"),
        "housing", pin_wave_orders, "001, table 1", "wave of all pins around the pin circle",
        alike_at_pins=lambda indices: indices["harmonic"] == 0,
        starts=axes_and_corners(0.1, 4), in_lots=False,
        equation=(
            r"$\delta = (c_r\cos h\gamma_i + s_r\sin h\gamma_i)\, p_i + (c_t\cos h\gamma_i + s_t\sin "
            r"h\gamma_i)\, p_i^\perp$"
        ),
        hidden="evenly spaced discs cancel harmonics that are no multiple of their number",
    ),
    Source(
        "cycloid.pin_circle_tilt", pin_circle_tilt, (), lengths(30, "x", "y"),
        "housing", _tilt_orders, "none: geometry", "pin circle tilted against the output's axis",
        tried=False, in_tables=True,
        equation=r"$\delta = a_k\, (x, y)$, $a_k$ from 1 at the first disc evenly to -1 at the last",
    ),
    Source(
        PIN_RADIUS, pin_radius, (_PIN_OR_ALL,), lengths(30, "deviation"),
        "housing", _one_pin_orders, "000; 001; 004", "radius of one pin or of all",
        alike_at_pins=lambda indices: indices["pin"] == "all",
        starts=EITHER_WAY,
        equation=r"$\delta = e\, n_i$",
    ),
    Source(
        "cycloid.pin_compliance", pin_compliance, (or_all(PIN),), compliances(5, "compliance"),
        "housing", _one_pin_orders, "001, K x = F + E", "contacts of one pin, or of all, softer than nominal",
        alike_at_pins=lambda indices: indices["pin"] == "all",
        needs=("torque",), tried=False,
        equation=r"$\delta = -e\, f_i\, n_i$",
    ),
    Source(
        "cycloid.pin_compliance_wave", pin_compliance_wave, (harmonics(1, 4),), compliances(3, "cos", "sin"),
        "housing", pin_wave_orders, "001, K x = F + E", "wave of the pins' compliance around the pin circle",
        needs=("torque",),
        equation=r"$\delta = -(c\cos h\gamma_i + s\sin h\gamma_i)\, f_i\, n_i$",
        hidden="evenly spaced discs cancel harmonics that are no multiple of their number",
    ),
    Source(
        "cycloid.profile_modification", profile_modification, (), lengths(50, "equidistant", "shift"),
        "disc", pin_wave_orders, "000, outlook; 002, e_rrp and e_rp",
        "profile of all discs ground off, equidistant and by shift of the tool's pin circle",
        starts=AROUND, in_lots=False,
        equation=r"$\delta = -\Delta_e\, n_i + \Delta_s\, p_i$",
    ),
    Source(
        DISC_BORE, disc_bore_position, (DISC, CRANK), lengths(30, "radial", "tangential"),
        "disc", bore_orders, "000, outlook; 001", "displacement of one crank bore in a disc",
        starts=AROUND,
        equation=r"$\delta = e_r\, r_j + e_t\, t_j$",
    ),
)  # fmt: skip
