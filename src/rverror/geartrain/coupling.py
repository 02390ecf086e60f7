"""Output coupling: forces between the cranks and the carrier, and the error sources of the carrier."""

from __future__ import annotations

import numpy as np

from rverror.base.arrays import Array, only, radial_and_tangential
from rverror.geartrain.action_line import Clearance, Compliance, Contacts, ErrorVector
from rverror.geartrain.source import (
    AROUND,
    CRANK,
    OPENS,
    Orders,
    Source,
    bearing_compliance_orders,
    bore_orders,
    chosen,
    clearance_orders,
    compliances,
    leads,
    lengths,
    or_all,
    rv,
)

BEARING_CLEARANCE, CARRIER_BORE = "coupling.bearing_clearance", "coupling.carrier_bore_position"


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
    vector = -np.stack(contacts.crank_directions)[:, crank]
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


def bearing_compliance(contacts: Contacts, *, crank: int | str) -> Compliance:
    """Compliance of one crank bearing in the carrier, or of all of them, more than nominal.

    Parameters
    ----------
    contacts : Contacts
    crank : int or "all"
        Which bearing.

    Returns
    -------
    Compliance
        Term compliance; positive is softer.

    Notes
    -----
    Source 001 counts the stiffness of the bearings without an error of its own.  "all" is how far the declared
    ``carrier_bearing`` is off.
    """
    return Compliance(contact="carrier", share=np.ones((1, 1, 1)), at=(chosen(crank),))


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
    vector = -np.stack(radial_and_tangential(contacts.turns["carrier"]))
    return ErrorVector(contact="carrier", vector=vector[:, None])


def _with_one_disc(orders: Orders) -> Orders:
    """Orders with a single disc; none where two or more balance."""
    return lambda mechanism, indices: orders(mechanism, indices) if rv(mechanism).discs == 1 else ()


SOURCES = (
    Source(
        CARRIER_BORE, carrier_bore_position, (CRANK,),
        lengths(30, "radial", "tangential"), "carrier", _with_one_disc(bore_orders), "000, delta_41; 004",
        "displacement of one crank bore in the carrier",
        equation=r"$\delta = -(e_r\, r_j + e_t\, t_j)$",
        hidden="turns with the carrier, as the force on the bore does",
        starts=AROUND,
    ),
    Source(
        BEARING_CLEARANCE, bearing_clearance, (), lengths(30, "clearance", least=0.0),
        "bearing", _with_one_disc(clearance_orders), "000, outlook; 004, tables 2 and 4",
        "radial clearance of all crank bearings in the carrier",
        starts=OPENS,
        equation=r"$e$ along each bearing's force: $\Delta\Theta = \mp e \sum_j \lambda_j$",
        hidden="the force on a bore is constant in the carrier, and so is its journal's place",
    ),
    Source(
        "coupling.bearing_compliance", bearing_compliance, (or_all(CRANK),), compliances(3, "compliance"),
        "bearing", _with_one_disc(bearing_compliance_orders), "001, K x = F + E",
        "crank bearing in the carrier softer than nominal",
        needs=("torque",), tried=False,
        equation=r"$\delta = -e\, f_j$",
        hidden="the force on a bore is constant in the carrier",
    ),
    Source(
        "coupling.carrier_runout", carrier_runout, (), lengths(50, "x", "y"),
        "carrier", _with_one_disc(leads("carrier")), "001, table 3", "bore circle against the carrier's axis",
        equation=r"$\delta = -C(\theta)\,(x, y)$",
        hidden="the forces on all bores cancel",
        starts=AROUND,
    ),
)  # fmt: skip
