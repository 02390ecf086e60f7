"""Crank linkage: forces in the cam bearings and the error sources of the crankshafts."""

from __future__ import annotations

import numpy as np

from rverror.base.arrays import Array, dot, only
from rverror.geartrain.action_line import Clearance, Compliance, Contacts, ErrorVector
from rverror.geartrain.mechanism import Reducer
from rverror.geartrain.source import (
    CRANK,
    DISC,
    EITHER_WAY,
    OPENS,
    Source,
    angles,
    bearing_compliance_orders,
    chosen,
    clearance_orders,
    compliances,
    constant,
    leads,
    lengths,
    or_all,
)

BEARING_CLEARANCE, ECCENTRICITY = "crank.bearing_clearance", "crank.eccentricity"


def cam_forces(contacts: Contacts, *, pin_forces: Array) -> Array:
    """Force of each disc on each cam per unit of output torque, rigid bearings.

    The pins push disc k with the force Q_k and the moment M_k about its centre.  Its cams share both:

        G_kj = Q_k / n_cranks + M_k / (n_cranks r6) t_j,    t_j the tangent at bore j.

    Parameters
    ----------
    contacts : Contacts
    pin_forces : ndarray, shape (discs, pins, 2, n)
        Forces of the pins on the discs per unit of output torque, 1/mm.

    Returns
    -------
    ndarray, shape (discs, cranks, 2, n)
        1/mm.

    Notes
    -----
    That leaves each crank the torque (a / (n_cranks r6)) m . r_j, m = sum(M_k u_k) over the discs, u_k the eccentric
    direction.  It is none where evenly spaced discs mesh in phase.  Elsewhere, with one disc or a number of discs that
    does not divide the pins, the meshes of a floating sun still put equal torques on the cranks, and the cams make up
    for it with the least forces that put none on the discs, p_k a quarter turn ahead of u_k:

        a ((c . r_j) p_k - (c . u_k) t_j / 2),    (n_discs - sum(u_k u_k^T) / 2) c = -m / (a n_cranks r6).

    Two cranks are left without it: at the dead centres of two discs they could not make up for anything.
    """
    reducer = contacts.reducer
    _, tangential = contacts.crank_directions
    moment = np.einsum("kpn,kpn->kn", contacts.pin_arm, dot(pin_forces, contacts.pin_normal))
    force = pin_forces.sum(axis=1)[:, None] / reducer.cranks
    couple = moment[:, None, None, :] / (reducer.cranks * reducer.crank_radius) * tangential
    even = _evening_forces(contacts, moment) if reducer.cranks > 2 else 0.0
    return np.asarray(force + couple + even, dtype=np.float64)


def _evening_forces(contacts: Contacts, moment: Array) -> Array:
    """Least forces on the cams (discs, cranks, 2, n) that take the unequal part of the cranks' torques."""
    reducer = contacts.reducer
    radial, tangential = contacts.crank_directions
    along, across = contacts.eccentric_directions
    uneven = (moment[:, None] * along).sum(axis=0)
    matrix = reducer.discs * np.eye(2) - np.einsum("kan,kbn->nab", along, along) / 2
    right = -uneven / (reducer.eccentricity * reducer.cranks * reducer.crank_radius)
    even = np.linalg.solve(matrix, right.T[..., None])[..., 0].T
    forward = dot(even, radial)[None, :, None] * across[:, None]
    back = dot(even, along)[:, None, None] * tangential / 2
    return np.asarray(reducer.eccentricity * (forward - back), dtype=np.float64)


def spline_torque(reducer: Reducer, direction: Array) -> Array:
    """Torque of each planet on its crank per unit of output torque, -(z2/z1) / (R n_cranks) on the loaded flank.

    Parameters
    ----------
    reducer : Reducer
    direction : ndarray, shape (n,)
        +1 forward, -1 reverse.

    Returns
    -------
    ndarray, shape (cranks, 2, 1, n)
        Flank 0 carries in forward motion, flank 1 in reverse.
    """
    share = -(reducer.planet_teeth / reducer.sun_teeth) / (reducer.ratio * reducer.cranks)
    flank = np.stack([direction > 0, direction <= 0]).astype(np.float64)
    return np.broadcast_to(share * flank[:, None], (reducer.cranks, 2, 1, direction.size))


def eccentricity(contacts: Contacts, *, crank: int, disc: int) -> ErrorVector:
    """Displacement of one cam of one crank.

    Parameters
    ----------
    contacts : Contacts
    crank, disc : int
        Which crank, and the cam for which disc.

    Returns
    -------
    ErrorVector
        Terms radial (along the eccentric direction of that cam), tangential (across it, counter-clockwise).

    Notes
    -----
    Sources 000 (delta_21; its 8.2 arcsec once per revolution cannot be had from its own formula), 001 and 004.
    """
    vector = -np.stack(contacts.eccentric_directions)[:, disc]
    return ErrorVector(contact="cam", vector=vector[:, None, None], at=(only(disc), only(crank)))


def bearing_clearance(contacts: Contacts) -> Clearance:
    """Radial clearance of every cam bearing.

    Parameters
    ----------
    contacts : Contacts

    Returns
    -------
    Clearance
        Term clearance: how far a cam can move off its bearing's centre in any direction.

    Notes
    -----
    Source 004 (bearing clearance, the largest share in its table 4); source 000 names it as missing.  The force of each
    bearing turns against the carrier, so the lag c sum|G_kj| ripples at multiples of 40 times the least common multiple
    of cranks and discs: 80 for two of each.
    """
    return Clearance(contact="cam")


def bearing_compliance(contacts: Contacts, *, crank: int | str, disc: int | str) -> Compliance:
    """Compliance of one cam bearing, of all of a crank or a disc, or of all, more than nominal.

    Parameters
    ----------
    contacts : Contacts
    crank, disc : int or "all"
        Which bearing.

    Returns
    -------
    Compliance
        Term compliance; positive is softer.

    Notes
    -----
    Source 001 counts the stiffness of the bearings without an error of its own.  The force of one bearing turns and
    changes its size once a turn of the crank against the carrier, and so does what it gives way by.  "all" for both is
    how far the declared ``crank_bearing`` is off.
    """
    return Compliance(contact="cam", share=np.ones((1, 1, 1, 1)), at=(chosen(disc), chosen(crank)))


def index(contacts: Contacts, *, crank: int) -> ErrorVector:
    """Angle by which a crank leads its planet gear.

    Parameters
    ----------
    contacts : Contacts
    crank : int
        Which crank.

    Returns
    -------
    ErrorVector
        Term angle, counter-clockwise positive.

    Notes
    -----
    Source 001 (circumferential error of the crankshafts).
    """
    return ErrorVector(contact="spline", vector=np.ones((1, 1, 2, 1, 1)), at=(only(crank),))


SOURCES = (
    Source(
        ECCENTRICITY, eccentricity, (CRANK, DISC), lengths(30, "radial", "tangential"),
        "crank", leads("crank"), "000, delta_21; 001; 004", "displacement of one cam",
        equation=r"$\delta = -(e_r\, \epsilon_k + e_t\, \epsilon_k^\perp)$",
    ),
    Source(
        BEARING_CLEARANCE, bearing_clearance, (), lengths(30, "clearance", least=0.0),
        "bearing", clearance_orders, "000, outlook; 004, tables 2 and 4", "radial clearance of all cam bearings",
        starts=OPENS,
        equation=r"$e$ along each bearing's force: $\Delta\Theta = \mp e \sum_{k,j} \lambda_{kj}$",
    ),
    Source(
        "crank.bearing_compliance", bearing_compliance, (or_all(CRANK), or_all(DISC)), compliances(3, "compliance"),
        "bearing", bearing_compliance_orders, "001, K x = F + E", "cam bearing softer than nominal",
        needs=("torque",), starts=EITHER_WAY,
        equation=r"$\delta = -e\, f_{kj}$",
    ),
    Source(
        "crank.index", index, (CRANK,), angles(600, "angle"),
        "crank", constant, "001, section 2", "lead of a crank over its planet gear",
        equation=r"$\delta = e$, an angle",
        hidden="the crank stays turned by it",
    ),
)  # fmt: skip
