"""Crank linkage: forces in the cam bearings and the error sources of the crankshafts."""

from __future__ import annotations

import numpy as np

from rverror.action_line import Array, Contacts, ErrorVector, dot, only, radial_and_tangential
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
    With two or more evenly spaced discs the cranks' own torques balance.  A single disc loads its cranks unevenly,
    and the meshes take the difference, so the split between its cranks is then only an even share; sums over all
    cranks stay exact.
    """
    reducer = contacts.reducer
    _, tangential = radial_and_tangential(contacts.crank_position)
    moment = (contacts.pin_arm * dot(pin_forces, contacts.pin_normal)).sum(axis=1)
    force = pin_forces.sum(axis=1)[:, None] / reducer.cranks
    couple = moment[:, None, None, :] / (reducer.cranks * reducer.crank_radius) * tangential
    return np.asarray(force + couple, dtype=np.float64)


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
