"""Involute stage: lines of action, mesh forces, and the error sources of sun, planets and splines."""

from __future__ import annotations

import math

import numpy as np

from rverror.base.arrays import Array, only, radial_and_tangential
from rverror.geartrain.action_line import Compliance, Contacts, ErrorVector, ErrorWaves
from rverror.geartrain.mechanism import Mechanism, Reducer
from rverror.geartrain.source import (
    AROUND,
    CRANK,
    Indices,
    Source,
    chosen,
    compliances,
    constant,
    every,
    harmonics,
    leads,
    lengths,
    or_all,
    rv,
)

#: The source that wear makes.
SUN_ECCENTRICITY, PLANET_ECCENTRICITY = "involute.sun_eccentricity", "involute.planet_eccentricity"
SUN_PITCH, PLANET_PITCH = "involute.sun_pitch", "involute.planet_pitch"
TOOTH_THINNING, SPLINE_CLEARANCE = "involute.tooth_thinning", "involute.spline_clearance"
#: Sign of the tangential motion that each flank drives: flank 0 forward, flank 1 reverse.
_FLANK_SIGN = np.array([1.0, -1.0])


def mesh_normal(reducer: Reducer, crank_position: Array) -> Array:
    """Unit vectors along the lines of action, from the sun into each planet.

    The sun's loaded flank pushes the planet along the tangent of its motion, tilted outwards by the pressure angle:

        n = +-cos(alpha) t_j + sin(alpha) r_j.

    Parameters
    ----------
    reducer : Reducer
    crank_position : ndarray, shape (cranks, n)
        Angle of each crank axis about the housing axis, rad.

    Returns
    -------
    ndarray, shape (cranks, 2, 2, n)
        Flank 0 drives in forward motion, flank 1 in reverse.

    Notes
    -----
    Source 000, section 1, prints n11 = (-cos alpha, -sin alpha) for one angle of the carrier; it turns with it.
    """
    radial, tangential = radial_and_tangential(crank_position)
    along = math.cos(reducer.pressure_angle) * _FLANK_SIGN[:, None, None] * tangential[:, None]
    return np.asarray(along + math.sin(reducer.pressure_angle) * radial[:, None], dtype=np.float64)


def mesh_forces(contacts: Contacts) -> Array:
    """Force of the sun on each planet per unit of output torque, equal share of the input torque 1/R.

        lambda_j = (z2/z1) / (R n_cranks r2 cos(alpha)) along the loaded line of action.

    Parameters
    ----------
    contacts : Contacts

    Returns
    -------
    ndarray, shape (cranks, 2, 2, n)
        1/mm.

    Notes
    -----
    Source 000, section 1, divides by r2 cos(alpha) as here.  A floating sun shares the torque of two or three planets
    equally.
    """
    reducer = contacts.reducer
    share = 1 / (reducer.ratio * reducer.cranks * reducer.sun_pitch_radius * math.cos(reducer.pressure_angle))
    loaded = np.stack([contacts.sense > 0, contacts.sense <= 0]) * _FLANK_SIGN[:, None]
    return np.asarray(share * loaded[:, None] * contacts.mesh_normal, dtype=np.float64)


def center_distance(contacts: Contacts, *, crank: int) -> ErrorVector:
    """Displacement of a planet gear's axis against its crank, fixed in the carrier, felt by the gear mesh alone.

    Parameters
    ----------
    contacts : Contacts
    crank : int
        Which planet.

    Returns
    -------
    ErrorVector
        Terms radial (away from the sun), tangential (counter-clockwise about the sun).

    Notes
    -----
    Source 000, delta_11.  A bore error of the carrier moves the whole crank: ``coupling.carrier_bore_position``.
    """
    vector = -np.stack(contacts.crank_directions)[:, crank]
    return ErrorVector(contact="mesh", vector=vector[:, None, None], at=(only(crank),))


def sun_eccentricity(contacts: Contacts) -> ErrorVector:
    """Eccentricity of the sun's toothing, fixed in the sun.

    Parameters
    ----------
    contacts : Contacts

    Returns
    -------
    ErrorVector
        Terms x, y in the sun's frame.

    Notes
    -----
    Source 004.  A sun that floats between evenly spaced planets gives way, and nothing reaches the output; source
    004's (Z_r / Z_s) e / r_s holds a fixed sun to one planet and takes the pins for a ring gear.
    """
    angle = contacts.turns["sun"]
    return ErrorVector(contact="mesh", vector=np.stack(radial_and_tangential(angle))[:, None, None])


def sun_offset(contacts: Contacts) -> ErrorVector:
    """Offset of the sun's axis, fixed in the part that is held: the housing, or the carrier where that stands still.

    Parameters
    ----------
    contacts : Contacts

    Returns
    -------
    ErrorVector
        Terms x, y in the frame of the held part.

    Notes
    -----
    Source 004 (sun gear assembly error).
    """
    angle = contacts.turns[contacts.reducer.held]
    return ErrorVector(contact="mesh", vector=np.stack(radial_and_tangential(angle))[:, None, None])


def planet_eccentricity(contacts: Contacts, *, crank: int) -> ErrorVector:
    """Eccentricity of one planet's toothing, fixed in the planet.

    Parameters
    ----------
    contacts : Contacts
    crank : int
        Which planet.

    Returns
    -------
    ErrorVector
        Terms x, y in the planet's frame, which lies on the housing's at theta = 0.

    Notes
    -----
    Source 004.
    """
    vector = -np.stack(radial_and_tangential(contacts.turns["planet"]))
    return ErrorVector(contact="mesh", vector=vector[:, None, None], at=(only(crank),))


def sun_pitch(contacts: Contacts, *, harmonic: int) -> ErrorWaves:
    """Cumulative pitch error of the sun, c cos(h chi) + s sin(h chi) over the angle chi on the sun.

    Parameters
    ----------
    contacts : Contacts
    harmonic : int
        h, waves around the gear.

    Returns
    -------
    ErrorWaves
        Terms cos, sin: tangential lead of the teeth at the pitch circle, counter-clockwise positive.

    Notes
    -----
    Source 001.  Taken at the pitch point; the contact's walk along the line of action is left out.  Harmonics that are
    no multiple of the number of planets cancel.
    """
    _, tangential = contacts.crank_directions
    phase = contacts.sun_phase[:, None]
    return ErrorWaves(contact="mesh", phase=phase, harmonic=harmonic, direction=tangential[:, None])


def planet_pitch(contacts: Contacts, *, crank: int, harmonic: int) -> ErrorWaves:
    """Cumulative pitch error of one planet, c cos(h chi) + s sin(h chi) over the angle chi on the planet.

    Parameters
    ----------
    contacts : Contacts
    crank, harmonic : int
        Which planet; h, waves around the gear.

    Returns
    -------
    ErrorWaves
        Terms cos, sin: tangential lead of the teeth at the pitch circle, counter-clockwise about the planet.

    Notes
    -----
    Source 001.  Taken at the pitch point, as in `sun_pitch`.
    """
    here = only(crank)
    _, tangential = contacts.crank_directions
    # at the pitch point the planet's counter-clockwise tangent is -t, and the planet is the driven part: +t
    phase, direction = contacts.planet_phase[here, None], tangential[here, None]
    return ErrorWaves(contact="mesh", phase=phase, harmonic=harmonic, direction=direction, at=(here,))


def tooth_thinning(contacts: Contacts, *, member: str) -> ErrorVector:
    """Tooth thickness that wear or grinding took off a gear, half on either flank.

    Parameters
    ----------
    contacts : Contacts
    member : {"sun", "planet"}
        Which gear; "planet" thins all planets alike.

    Returns
    -------
    ErrorVector
        Term thinning, along the pitch circle.  The output lags by thinning / (2 r1 R) in either direction, so the
        lost motion between the directions is thinning / (r1 R).

    Notes
    -----
    Source 003 (157 arcsec/mm of wear against 1/(r1 R) = 170).  The effect is the same for sun and planets; `member`
    records which.
    """
    _, tangential = contacts.crank_directions
    vector = -0.5 * _FLANK_SIGN[:, None, None] * tangential[:, None]
    return ErrorVector(contact="mesh", vector=vector[None])


def spline_clearance(contacts: Contacts, *, crank: int) -> ErrorVector:
    """Circumferential clearance of the spline between a planet and its crank, half to either side.

    Parameters
    ----------
    contacts : Contacts
    crank : int
        Which crank.

    Returns
    -------
    ErrorVector
        Term clearance, along the spline's pitch circle.

    Raises
    ------
    ValueError
        If the reducer has no spline_radius.

    Notes
    -----
    Source 003: 0.046 to 0.097 mm raise the error from 45 to 80 arcsec, 686 arcsec/mm (its text says 500); the lost
    motion of all cranks is clearance / r_s * (z2/z1) / R = 729 arcsec/mm.
    """
    radius = contacts.reducer.spline_radius
    if radius is None:
        raise ValueError("involute.spline_clearance needs the reducer's spline_radius; give it, e.g. '7 mm'")
    vector = (0.5 / radius * _FLANK_SIGN)[None, None, :, None, None]
    return ErrorVector(contact="spline", vector=vector, at=(only(crank),))


def mesh_compliance(contacts: Contacts, *, crank: int | str) -> Compliance:
    """Compliance of one planet's mesh with the sun, or of all of them, more than nominal.

    Parameters
    ----------
    contacts : Contacts
    crank : int or "all"
        Which planet.

    Returns
    -------
    Compliance
        Term compliance, along the line of action, either flank; positive is softer.

    Notes
    -----
    Source 001 counts the stiffness of the meshes without an error of its own.  "all" is how far the declared
    ``gear_mesh`` is off.
    """
    return Compliance(contact="mesh", share=np.ones((1, 1, 1, 1)), at=(chosen(crank),))


def sun_compliance_wave(contacts: Contacts, *, harmonic: int) -> Compliance:
    """Wave of the mesh compliance over the angle on the sun, c cos(h chi) + s sin(h chi).

    Parameters
    ----------
    contacts : Contacts
    harmonic : int
        h, waves around the gear.

    Returns
    -------
    Compliance
        Terms cos, sin.

    Notes
    -----
    Taken at the pitch point, as in `sun_pitch`.
    """
    chi = contacts.crank_position - contacts.turns["sun"]
    return Compliance(contact="mesh", share=_waves(harmonic, chi)[:, :, None])


def planet_compliance_wave(contacts: Contacts, *, crank: int, harmonic: int) -> Compliance:
    """Wave of one mesh's compliance over the angle chi on the planet, c cos(h chi) + s sin(h chi).

    Parameters
    ----------
    contacts : Contacts
    crank, harmonic : int
        Which planet; h, waves around the gear.

    Returns
    -------
    Compliance
        Terms cos, sin.

    Notes
    -----
    Taken at the pitch point, as in `planet_pitch`.
    """
    chi = contacts.crank_position[only(crank)] + np.pi - contacts.turns["planet"]
    return Compliance(contact="mesh", share=_waves(harmonic, chi)[:, :, None], at=(only(crank),))


def _waves(harmonic: int, angle: Array) -> Array:
    return np.stack([np.cos(harmonic * angle), np.sin(harmonic * angle)])


def _sun_pitch_orders(mechanism: Mechanism, indices: Indices) -> tuple[float, ...]:
    cancels = int(indices["harmonic"]) % rv(mechanism).cranks != 0
    return () if cancels else leads("sun")(mechanism, indices)


_MEMBER = every("member", lambda unit: ("sun", "planet"))

SOURCES = (
    Source(
        "involute.center_distance", center_distance, (CRANK,), lengths(30, "radial", "tangential"),
        "carrier", constant, "000, delta_11", "planet axis against its crank", starts=AROUND,
        equation=r"$\delta = -(e_r\, r_j + e_t\, t_j)$",
        hidden="turns with the carrier, as the line of action does",
    ),
    Source(
        SUN_ECCENTRICITY, sun_eccentricity, (), lengths(50, "x", "y"),
        "sun", constant, "004, table 2", "eccentricity of the sun's toothing",
        equation=r"$\delta = C(R\theta)\,(x, y)$",
        hidden="a floating sun between evenly spaced planets gives way",
    ),
    Source(
        "involute.sun_offset", sun_offset, (), lengths(100, "x", "y"),
        "housing", constant, "004, table 2", "offset of the sun's axis",
        equation=r"$\delta = (x, y)$",
        hidden="the sun floats",
    ),
    Source(
        PLANET_ECCENTRICITY, planet_eccentricity, (CRANK,), lengths(50, "x", "y"),
        "planet", leads("planet"), "004, table 2", "eccentricity of a planet's toothing",
        equation=r"$\delta = -C(\nu\theta)\,(x, y)$",
    ),
    Source(
        SUN_PITCH, sun_pitch, (harmonics(1, 4),), lengths(50, "cos", "sin"),
        "sun", _sun_pitch_orders, "001, section 2", "cumulative pitch error of the sun",
        equation=r"$\delta = (c\cos h\chi + s\sin h\chi)\, t_j$, $\chi = \beta_j - R\theta$",
        hidden="the meshes cancel what is no multiple of the number of planets",
    ),
    Source(
        PLANET_PITCH, planet_pitch, (CRANK, harmonics(1, 3)), lengths(50, "cos", "sin"),
        "planet", leads("planet"), "001, section 2", "cumulative pitch error of a planet",
        equation=r"$\delta = (c\cos h\chi + s\sin h\chi)\, t_j$, $\chi = \beta_j + \pi - \nu\theta$",
    ),
    Source(
        "involute.mesh_compliance", mesh_compliance, (or_all(CRANK),), compliances(5, "compliance"),
        "carrier", constant, "001, K x = F + E", "mesh of a planet with the sun softer than nominal",
        needs=("torque",), tried=False,
        equation=r"$\delta = -e\, f_j\, n_j$",
        hidden="the force on a flank is constant",
    ),
    Source(
        "involute.sun_compliance_wave", sun_compliance_wave, (harmonics(1, 4),), compliances(2, "cos", "sin"),
        "sun", _sun_pitch_orders, "001, K x = F + E", "wave of the mesh compliance around the sun",
        needs=("torque",), tried=False, in_tables=True,
        equation=r"$\delta = -(c\cos h\chi + s\sin h\chi)\, f_j\, n_j$, $\chi = \beta_j - R\theta$",
        hidden="the meshes cancel what is no multiple of the number of planets",
    ),
    Source(
        "involute.planet_compliance_wave", planet_compliance_wave, (CRANK, harmonics(1, 3)),
        compliances(2, "cos", "sin"),
        "planet", leads("planet"), "001, K x = F + E", "wave of a mesh's compliance around the planet",
        needs=("torque",), tried=False, in_tables=True,
        equation=r"$\delta = -(c\cos h\chi + s\sin h\chi)\, f_j\, n_j$, $\chi = \beta_j + \pi - \nu\theta$",
    ),
    Source(
        TOOTH_THINNING, tooth_thinning, (_MEMBER,), lengths(150, "thinning"),
        "direction", constant, "003, wear tables", "tooth thickness lost to wear or backlash, half a flank",
        equation=r"$\delta = \mp\tfrac{1}{2} e\, t_j$",
        hidden="sets the place of the loaded flank only; which gear lost the tooth is never visible",
    ),
    Source(
        SPLINE_CLEARANCE, spline_clearance, (CRANK,), lengths(100, "clearance", least=0.0),
        "direction", constant, "003, T_e = k_c C + b", "play of the planet's spline, half to either side",
        needs=("spline_radius",),
        equation=r"$\delta = \pm e / (2 r_s)$, an angle",
        hidden="sets the place of the loaded flank only",
    ),
)  # fmt: skip
