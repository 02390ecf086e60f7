"""How stiff each contact of a gear train is: as declared, and less where it gives way more than nominal.

A pin or a flank that closes by p > 0 carries

    f = F0 (k p / F0)^n,

with the declared stiffness k, which is the secant at the reference force F0, and the exponent n: 1 is linear.  Its
tangent stiffness is n f / p, its energy f p / (n + 1), and at constant force its closing changes with the exponent by
-p ln(k p / F0) / n.  Bearings are linear.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rverror.base.arrays import Array
from rverror.geartrain.mechanism import Reducer


@dataclass(frozen=True)
class Elasticity:
    """Stiffness of every contact, N/mm; the first axis is 1 where it is alike at all angles, else n.

    Attributes
    ----------
    pin : ndarray, shape (n or 1, discs, pins)
    flank : ndarray, shape (n or 1, 2 cranks)
    bearing : ndarray, shape (n or 1, bearings)
        Cams (disc by crank), carrier bores, main bearing, sun support.
    """

    pin: Array
    flank: Array
    bearing: Array


def elasticity(reducer: Reducer, more: Mapping[str, Array]) -> Elasticity:
    """Stiffness of every contact of a reducer: as declared, and less where it gives way `more`.

    Parameters
    ----------
    reducer : Reducer
    more : mapping of str to ndarray
        Compliance more than nominal, mm/N, samples first, of contacts of ``"pin"`` (n, discs, pins), ``"mesh"``
        (n, 2 cranks), ``"cam"`` (n, discs cranks) and ``"carrier"`` (n, cranks), where any is.

    Returns
    -------
    Elasticity

    Raises
    ------
    ValueError
        If some contact would be stiffer than rigid.
    """
    stiffness, cranks, cams = reducer.stiffness, reducer.cranks, reducer.discs * reducer.cranks
    bearings = [
        _softened("cam", np.full((1, cams), stiffness.crank_bearing), more),
        _softened("carrier", np.full((1, cranks), stiffness.carrier_bearing), more),
        np.array([[stiffness.main_bearing, stiffness.sun_support]]),
    ]
    n = max(len(one) for one in bearings)
    return Elasticity(
        pin=_softened("pin", np.full((1, reducer.discs, reducer.pins), stiffness.pin_contact), more),
        flank=_softened("mesh", np.full((1, 2 * cranks), stiffness.gear_mesh), more),
        bearing=np.concatenate([np.broadcast_to(one, (n, one.shape[1])) for one in bearings], axis=1),
    )


def _softened(contact: str, declared: Array, more: Mapping[str, Array]) -> Array:
    if contact not in more:
        return declared
    compliance = 1 / declared + more[contact]
    if not (compliance > 0).all():
        least = float(more[contact].min())
        raise ValueError(
            f"{contact}: compliances of {least * 1e6:.4g} um/kN in all make a contact stiffer than rigid; they must be "
            f"above {-1e6 / float(declared.max()):.4g} um/kN: make them less negative, or the declared stiffness lower"
        )
    return np.asarray(1 / compliance)
