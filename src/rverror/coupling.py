"""Output coupling: forces between the cranks and the carrier, and the error sources of the carrier."""

from __future__ import annotations

import numpy as np

from rverror.action_line import Array, Clearance, Contacts, ErrorVector, only, radial_and_tangential


def carrier_forces(*, cam_forces: Array, mesh_forces: Array) -> Array:
    """Force of each crank on its carrier bore per unit of output torque: what the discs and the sun put on the crank.

    Parameters
    ----------
    cam_forces : ndarray, shape (discs, cranks, 2, n)
        Forces of the discs on the cams, 1/mm.
    mesh_forces : ndarray, shape (cranks, 2, 2, n)
        Forces of the sun on the planets per flank, 1/mm.

    Returns
    -------
    ndarray, shape (cranks, 2, n)
        1/mm; the tangential parts add up to 1/r6.

    Notes
    -----
    Cam bearings and carrier bearings share the separating force of the gears by their stiffness; here the carrier
    bearings take all of it, as if they were the stiffer ones.  It is radial and constant.
    """
    return np.asarray(cam_forces.sum(axis=0) + mesh_forces.sum(axis=1), dtype=np.float64)


def carrier_bore_position(contacts: Contacts, *, crank: int) -> ErrorVector:
    """Displacement of one crank bore in the carrier.

    Parameters
    ----------
    contacts : Contacts
    crank : int
        Which bore.

    Returns
    -------
    ErrorVector
        Terms radial (away from the carrier centre), tangential (counter-clockwise).

    Notes
    -----
    Source 000, delta_41, whose 30.5 arcsec once per revolution it cannot give: error and action line turn together, so
    the output shift is constant, -1/(n_cranks r6) per tangential unit.
    """
    vector = -np.stack(radial_and_tangential(contacts.crank_position[crank]))
    return ErrorVector(contact="carrier", vector=vector[:, None], at=(only(crank),))


def bearing_clearance(contacts: Contacts) -> Clearance:
    """Radial clearance of every crank bearing in the carrier.

    Parameters
    ----------
    contacts : Contacts

    Returns
    -------
    Clearance
        Term clearance: how far a crank can move off its bearing's centre in any direction.

    Notes
    -----
    Sources 000 (named as missing) and 004.  The forces on the bores are constant in the carrier, so the output lags by
    about c / r6 in either direction, without ripple.
    """
    return Clearance(contact="carrier")


def carrier_runout(contacts: Contacts) -> ErrorVector:
    """Offset of the bore circle against the carrier's axis of rotation, fixed in the carrier.

    Parameters
    ----------
    contacts : Contacts

    Returns
    -------
    ErrorVector
        Terms x, y in the carrier's frame.

    Notes
    -----
    Source 001 (output wheel eccentricity).  The forces on all bores cancel while the discs balance, so with evenly
    spaced discs that mesh in phase nothing reaches the output.
    """
    vector = -np.stack(radial_and_tangential(contacts.theta))
    return ErrorVector(contact="carrier", vector=vector[:, None])
