"""Thermal growth: parts that are warmer than the reference temperature grow in proportion to their size."""

from __future__ import annotations

import numpy as np

from rverror.base.arrays import Array, radial_and_tangential
from rverror.geartrain.action_line import Contacts, ErrorVector
from rverror.geartrain.source import Parameter, Source, pin_wave_orders

#: Thermal expansion of steel, 1/K.  For a part of another material scale its rise: 2 for aluminium.
EXPANSION = 11.5e-6

GROWTH = "thermal.growth"

#: Parts that have a temperature of their own, in the order of the terms.
_PARTS = ("housing", "discs", "cranks", "carrier", "gears")


def growth(contacts: Contacts) -> tuple[ErrorVector, ...]:
    r"""Growth of each part by its temperature rise, as steel.

    A rise dT makes a part larger by the factor 1 + eps, eps = alpha dT, about its own centre.  With r the radial unit
    vectors of pins and cranks, u the eccentric direction and n the normals, the contacts move by

    - housing: eps (R_p r_i + r_p n_i), the pin circle and the pins;
    - discs: profile eps rho, rho = R_p r_i + r_p n_i - a u_k from the disc's centre; bores eps r6 r_j;
    - cranks: eps a u_k, their eccentricity;
    - carrier: eps r6 r_j, its bores;
    - gears: eps (r1 + r2) r_j = eps r6 r_j between sun and planet, which closes both flanks by eps r6 sin(alpha).

    Parameters
    ----------
    contacts : Contacts

    Returns
    -------
    tuple of ErrorVector
        Terms housing, discs, cranks, carrier, gears, K above the reference temperature, at the pins, cams, carrier
        bores and meshes.

    Notes
    -----
    Sources 000 and 001 name thermal deformation as missing, source 003 in its outlook.  The same rise of all five is a
    similarity: every part grows about a centre that moves with the rest, and the output does not move.
    """
    reducer = contacts.reducer
    pin, _ = radial_and_tangential(2 * np.pi * np.arange(reducer.pins)[:, None] / reducer.pins)
    crank, _ = contacts.crank_directions
    eccentric, _ = contacts.eccentric_directions
    point = reducer.pin_circle_radius * pin + reducer.pin_radius * contacts.pin_normal
    offset = reducer.eccentricity * eccentric[:, None]
    bore = reducer.crank_radius * crank
    return (
        _grown("pin", housing=point, discs=offset - point),
        _grown("cam", discs=bore[None], cranks=-offset),
        _grown("carrier", carrier=-bore),
        _grown("mesh", gears=bore[:, None]),
    )


def _grown(contact: str, **parts: Array) -> ErrorVector:
    """Vector of one contact per kelvin of each part; parts that do not touch it have none."""
    shape = np.broadcast_shapes(*(part.shape for part in parts.values()))
    vector = np.zeros((len(_PARTS), *shape))
    for name, part in parts.items():
        vector[_PARTS.index(name)] = EXPANSION * part
    return ErrorVector(contact=contact, vector=vector)


SOURCES = (
    Source(
        GROWTH, growth, (),
        tuple(Parameter(part, "temperature_rise", 60.0) for part in _PARTS),
        "direction", pin_wave_orders, "000 and 001, named as missing; 003, outlook",
        "temperature rise of each part, grown as steel", tried=False,
        equation=(
            r"with $\eta = \alpha\,\Delta T$ of each part and $q_i = R_p\, p_i + r_p\, n_i$: pin "
            r"$\eta_{housing}\, q_i - \eta_{discs}\, (q_i - a\,\epsilon_k)$, cam $\eta_{discs}\, r_6\, r_j - "
            r"\eta_{cranks}\, a\,\epsilon_k$, carrier $-\eta_{carrier}\, r_6\, r_j$, mesh $\eta_{gears}\, "
            r"r_6\, r_j$"
        ),
        hidden="changes play alone; the same rise of all parts leaves nothing",
    ),
)  # fmt: skip
