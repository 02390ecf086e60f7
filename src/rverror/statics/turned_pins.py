r"""Pins that have moved along their discs' profiles: where a profile bends, they touch with another normal.

In the frame of a disc the centre of a pin stands on a trochoid, of which both profiles are offsets.  Moved into the
disc by p and along the profile by s, the pin closes by second order

.. math:: p - \kappa s^2 / 2,

kappa being the trochoid's curvature, positive where it is convex.  About a place s_0 that is

.. math:: p - \kappa s_0 s + \kappa s_0^2 / 2,

the closing of a pin whose normal has turned by kappa s_0, and an offset: the energy stays that of straight contacts.
At a lobe's root the trochoid's radius is below 0.1 mm, and 5 um turn a normal by 4 degrees.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rverror.base.arrays import Array
from rverror.statics.energy import Errors, Geometry, System

_SETTLED = 1e-6  # mm by which closings may be off, and turned ones by their turn: 0.003 arcsec, were all pins so


def moved(contacts: Geometry, system: System, errors: Errors, x: Array) -> Array:
    """How far errors and pose move each pin along its disc's profile, mm, (n, discs, pins)."""
    return np.asarray(errors.along + (contacts.profile_rows * system.discs(x)).sum(axis=1))


def turned(contacts: Geometry, nominal: System, errors: Errors, x: Array, share: float) -> TurnedPins:
    """Pins that have moved along the profiles.

    Parameters
    ----------
    contacts : Geometry
    nominal : System
        With the normals of the error-free pose.
    errors : Errors
    x : ndarray, shape (n, size)
        Pose.
    share : float
        Of the curvature.

    Returns
    -------
    TurnedPins
    """
    along = moved(contacts, nominal, errors, x)
    turn = share * contacts.curvature * along
    system = replace(
        nominal,
        pin_rows=nominal.pin_rows - turn[:, None] * contacts.profile_rows,
        pin_error=nominal.pin_error - turn * errors.along + turn * along / 2,
    )
    return TurnedPins(system, along, contacts.curvature)


@dataclass(frozen=True)
class TurnedPins:
    """Energy with normals that have turned, and where that is right.

    Attributes
    ----------
    system : System
    moved : ndarray, shape (n, discs, pins)
        Along the profile, mm.
    curvature : ndarray, shape (n, discs, pins)
    """

    system: System
    moved: Array
    curvature: Array

    def same(self, other: TurnedPins, closing: Array) -> bool:
        """Tell whether another place would close no pin that carries otherwise."""
        apart = np.abs(self.moved - other.moved)
        off = np.abs(self.curvature) * apart * (apart / 2 + closing)
        return bool(np.where(closing > 0, off, 0.0).max() < _SETTLED)
