"""Crank linkage: forces in the cam bearings and the error sources of the crankshafts."""

from __future__ import annotations

import numpy as np

from rverror.action_line import Array, Clearance, Contacts, ErrorVector, cross, dot, only, radial_and_tangential
from rverror.reducer import Reducer


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
    With two or more evenly spaced discs the cranks' own torques balance.  With one disc the meshes of a floating sun
    still put equal torques on the cranks, so its cams carry the moment by forces along the eccentric direction u:

        G_j = Q / n_cranks + M c_j / (r6 sum(c_j^2)) u,    c_j = r_j x u.
    """
    reducer = contacts.reducer
    _, tangential = radial_and_tangential(contacts.crank_position)
    moment = (contacts.pin_arm * dot(pin_forces, contacts.pin_normal)).sum(axis=1)
    force = pin_forces.sum(axis=1)[:, None] / reducer.cranks
    couple = moment[:, None, None, :] / (reducer.cranks * reducer.crank_radius) * tangential
    if reducer.discs == 1:
        couple = _single_disc_couple(contacts, moment)
    return np.asarray(force + couple, dtype=np.float64)


def _single_disc_couple(contacts: Contacts, moment: Array) -> Array:
    radial, _ = radial_and_tangential(contacts.crank_position)
    along, _ = radial_and_tangential(contacts.eccentric[0])
    lever = contacts.reducer.crank_radius * cross(radial, along)
    return np.asarray((moment * lever / (lever**2).sum(axis=0))[None, :, None, :] * along, dtype=np.float64)


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
    vector = -np.stack(radial_and_tangential(contacts.eccentric[disc]))
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
