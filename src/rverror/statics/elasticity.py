"""How much each contact of a gear train carries for how far it closes: declared stiffness and power laws.

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
from rverror.geartrain.mechanism import REFERENCE_FORCE, Reducer

#: Of the reference force: below that closing the tangent, which falls to nothing, is held, so that Newton's matrix is
#: regular.  What closes less, below 1e-9 of 0.5 um at the defaults, carries nothing that counts.
_LEAST_SHARE = 1e-9


@dataclass(frozen=True)
class PowerLaw:
    """f = F0 (k p / F0)^n of contacts that only push.

    Attributes
    ----------
    exponent : float
        n, 1 or more.
    """

    exponent: float = 1.0

    @property
    def linear(self) -> bool:
        """Whether force is proportional to closing."""
        return self.exponent == 1.0

    def pressed(self, closing: Array, stiffness: Array) -> tuple[Array, Array]:
        """Force, N, and tangent stiffness, N/mm, of contacts that close by `closing`, mm; both 0 where open.

        Parameters
        ----------
        closing : ndarray
        stiffness : ndarray, broadcast against it
        """
        closed = closing > 0
        if self.linear:
            return stiffness * np.maximum(closing, 0.0), np.where(closed, stiffness, 0.0)
        force, tangent = np.zeros_like(closing), np.zeros_like(closing)
        k = np.broadcast_to(stiffness, closing.shape)[closed]
        share = k * closing[closed] / REFERENCE_FORCE
        secant = k * share ** (self.exponent - 1)
        force[closed] = secant * closing[closed]
        tangent[closed] = self.exponent * secant
        slight = share < _LEAST_SHARE
        if slight.any():
            tangent[closed] = np.where(slight, self.exponent * k * _LEAST_SHARE ** (self.exponent - 1), tangent[closed])
        return force, tangent

    def force(self, closing: Array, stiffness: Array) -> Array:
        """Force alone."""
        if self.linear:
            return np.asarray(stiffness * np.maximum(closing, 0.0))
        return self.pressed(closing, stiffness)[0]

    def tangent(self, closing: Array, stiffness: Array) -> Array:
        """Tangent stiffness alone."""
        if self.linear:
            return np.where(closing > 0, stiffness, 0.0)
        return self.pressed(closing, stiffness)[1]

    def closing(self, force: Array | float, stiffness: Array) -> Array:
        """How far a contact closes under a force, mm."""
        return np.asarray(REFERENCE_FORCE / stiffness * (force / REFERENCE_FORCE) ** (1 / self.exponent))

    def change_with_exponent(self, closing: Array, stiffness: Array) -> Array:
        """Change of the closing with the exponent at constant force, mm; 0 where open."""
        closed, change = closing > 0, np.zeros_like(closing)
        pushed = closing[closed]
        share = np.broadcast_to(stiffness, closing.shape)[closed] * pushed / REFERENCE_FORCE
        change[closed] = -pushed * np.log(share) / self.exponent
        return change


@dataclass(frozen=True)
class Elasticity:
    """Stiffness of every contact, N/mm, samples first; axes of length 1 stand for all.

    Attributes
    ----------
    pin : ndarray, shape (n, discs, pins)
    flank : ndarray, shape (n, 2 cranks)
    joint : ndarray, shape (n, joints)
        Cams (disc by crank), carrier bores, main bearing, sun support.
    pin_law, flank_law : PowerLaw
    """

    pin: Array
    flank: Array
    joint: Array
    pin_law: PowerLaw
    flank_law: PowerLaw


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
    stiffness, law = reducer.stiffness, reducer.contact_law
    bearings = np.repeat(
        [stiffness.crank_bearing, stiffness.carrier_bearing], [reducer.discs * reducer.cranks, reducer.cranks]
    )
    return Elasticity(
        pin=_softened("pin", np.full((1, 1, 1), stiffness.pin_contact), more),
        flank=_softened("mesh", np.full((1, 1), stiffness.gear_mesh), more),
        joint=_softened_bearings(reducer, np.append(bearings, [stiffness.main_bearing, stiffness.sun_support]), more),
        pin_law=PowerLaw(law.pin_exponent),
        flank_law=PowerLaw(law.flank_exponent),
    )


def _softened_bearings(reducer: Reducer, declared: Array, more: Mapping[str, Array]) -> Array:
    cams = reducer.discs * reducer.cranks
    parts = {"cam": declared[None, :cams], "carrier": declared[None, cams:-2]}
    if not parts.keys() & more.keys():
        return declared[None]
    n = max(len(one) for one in more.values())
    softened = [_softened(contact, part, more) for contact, part in parts.items()]
    return np.concatenate(
        [np.broadcast_to(part, (n, part.shape[1])) for part in (*softened, declared[None, -2:])], axis=1
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
