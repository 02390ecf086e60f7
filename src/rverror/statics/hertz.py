r"""How contacts share the load, and how hard they press: Hertz's line contact on the forces of the equilibrium.

Two cylinders of equal steel that press with F over a length b, their radii R_1 and R_2 (below 0 where hollow), touch
over a strip of half-width a with the largest pressure p:

.. math::

    \frac{1}{R} = \frac{1}{R_1} + \frac{1}{R_2},\quad
    E' = \frac{E}{2 (1 - \nu^2)},\quad
    p = \sqrt{\frac{F E'}{\pi b R}},\quad a = \frac{2 F}{\pi b p} .

A pin of radius r on a disc whose pin centres draw a curve of curvature kappa there: the profile is that curve's offset,
of radius 1/kappa - r, and R = r (1 - kappa r).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from rverror.base.arrays import Array
from rverror.base.quantities import COUNT, Checked, above_zero, quantity
from rverror.base.viewed import Viewed
from rverror.geartrain.action_line import Contacts
from rverror.geartrain.contacts import motion
from rverror.geartrain.cycloid import roll_angles, trochoid_curvature
from rverror.geartrain.kinematics import OperatingConditions
from rverror.model.effects import Model, check_model
from rverror.model.results import Equilibrium
from rverror.statics.loaded_state import equilibrium, reducer_of

#: Indices of each kind of contact, in the order of its axes.
CONTACT_INDICES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {"pin": ("disc", "pin"), "mesh": ("crank",), "cam": ("disc", "crank"), "carrier": ("crank",)}
)
#: F over Z times the force of the most loaded of Z rollers: without clearance or preload they close by cos(psi) over
#: half the bearing and carry by the power 10/9 of a line contact (Stribeck; 4.08 F / Z on that roller).
_STRIBECK = math.gamma(14 / 9) / math.gamma(37 / 18) / (2 * math.sqrt(math.pi))

_STEEL = (206e3, 0.3)  # Young's modulus, N/mm^2, and Poisson's ratio


_LENGTH = quantity("length", above=0.0)


@dataclass(frozen=True, kw_only=True)
class RollerBearing(Checked):
    """Rollers between a cam, or a journal, and its bore.

    Parameters
    ----------
    rollers : int
        How many.
    roller_diameter, roller_length : float or quantity
        mm.
    race_diameter : float or quantity
        Of the inner race, on which they press hardest, mm.

    Raises
    ------
    ValueError
        If a value is not above 0, or there are fewer than three rollers.

    Examples
    --------
    >>> RollerBearing(rollers=14, roller_diameter="5 mm", roller_length="8 mm", race_diameter="20 mm").race_diameter
    20.0
    """

    rollers: int = field(metadata=quantity(COUNT, least=3))
    roller_diameter: float = field(metadata=_LENGTH)
    roller_length: float = field(metadata=_LENGTH)
    race_diameter: float = field(metadata=_LENGTH)


@dataclass(frozen=True, kw_only=True)
class PressurePeak:
    """Where contacts of one kind press hardest.

    Attributes
    ----------
    contact : str
        ``"pin"``, ``"mesh"``, ``"cam"`` or ``"carrier"``.
    indices : mapping of str to int
        Which of them.
    theta : float
        Output angle at which it does, rad.
    pressure : float
        N/mm^2.
    force : float
        N.
    ripple : float
        Largest less smallest over the angles, of the hardest pressed contact at each, as a share of the mean.
    """

    contact: str
    indices: Mapping[str, int]
    theta: float
    pressure: float
    force: float
    ripple: float


@dataclass(frozen=True, kw_only=True)
class ContactPressure(Viewed):
    """Force and largest Hertz pressure of each contact along a motion.

    Attributes
    ----------
    theta : ndarray, shape (n,)
        Output angle, rad.
    force, pressure, half_width : mapping of str to ndarray
        N, N/mm^2 and mm; ``"pin"`` (discs, pins, n), ``"mesh"`` (cranks, n), and where the bearings are known ``"cam"``
        (discs, cranks, n) and ``"carrier"`` (cranks, n).  0 where open.
    place : ndarray, shape (discs, pins, n)
        Where on its disc each pin touches: angle about the disc's centre in the disc's frame, rad.
    """

    theta: Array
    force: Mapping[str, Array]
    pressure: Mapping[str, Array]
    half_width: Mapping[str, Array]
    place: Array

    def peaks(self) -> tuple[PressurePeak, ...]:
        """Hardest pressed contact of each kind, the hardest pressed kind first.

        Returns
        -------
        tuple of PressurePeak
        """
        found = []
        for contact, pressure in self.pressure.items():
            *where, at = (int(i) for i in np.unravel_index(int(np.argmax(pressure)), pressure.shape))
            hardest = pressure.max(axis=tuple(range(pressure.ndim - 1)))
            found.append(
                PressurePeak(
                    contact=contact,
                    indices=dict(zip(CONTACT_INDICES[contact], where, strict=True)),
                    theta=float(self.theta[at]),
                    pressure=float(pressure[*where, at]),
                    force=float(self.force[contact][*where, at]),
                    ripple=float(np.ptp(hardest) / hardest.mean()) if hardest.any() else 0.0,
                )
            )
        return tuple(sorted(found, key=lambda one: -one.pressure))


def contact_pressure(
    model: Model,
    theta: Any,
    *,
    torque: Any | None = None,
    direction: Any | None = None,
    disc_width: Any,
    gear_width: Any,
    cam_bearing: RollerBearing | None = None,
    carrier_bearing: RollerBearing | None = None,
    youngs_modulus: Any = _STEEL[0],
    poisson_ratio: float = _STEEL[1],
) -> ContactPressure:
    """Load of each contact and the pressure under it.

    Parameters
    ----------
    model : Model
        Of a reducer; its errors, stiffnesses and play share the load.
    theta : array_like, str or quantity, shape (n,) or one angle, or OperatingConditions
        Nominal output angle, rad; or the conditions of a run, in place of torque and direction.
    torque, direction
        As in `equilibrium`.
    disc_width, gear_width : float or quantity
        Length over which a pin touches one disc, and a planet the sun, mm.
    cam_bearing, carrier_bearing : RollerBearing, optional
        Rollers of the cranks in the discs and in the carrier; their forces alone do not tell a pressure.
    youngs_modulus : float or quantity
        Of all parts, N/mm^2; steel's where left out.
    poisson_ratio : float
        Of all parts.

    Returns
    -------
    ContactPressure

    Raises
    ------
    ValueError
        If a width or the modulus is not above 0, or Poisson's ratio not between 0 and 0.5.
    NotConvergedError
        As in `equilibrium`.

    Notes
    -----
    Straight contacts of equal materials: no crowning, no tilt, no edges, which press harder.  The gear mesh is taken at
    the pitch point with one pair of teeth.  No source text has it; Hertz (1881), Stribeck (1901).

    Examples
    --------
    >>> import numpy as np, rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> theta = np.linspace(0, 2 * np.pi / 40, 16)
    >>> found = contact_pressure(unit, theta, torque="412 N*m", disc_width="9 mm", gear_width="8 mm")
    >>> found.peaks()[0].contact
    'pin'
    """
    check_model(model)
    widths = [above_zero("disc_width", disc_width, "length"), above_zero("gear_width", gear_width, "length")]
    modulus = above_zero("youngs_modulus", youngs_modulus, "pressure")
    if not 0 <= poisson_ratio < 0.5:
        raise ValueError(f"poisson_ratio = {poisson_ratio:g}: must lie between 0 and 0.5")
    state = equilibrium(model, theta, torque=torque, direction=direction)
    unit = reducer_of(model.mechanism)
    stands = motion(unit, OperatingConditions(state.theta + model.index_offset, 1.0))
    assert isinstance(stands, Contacts)
    size, pin = pressing(state), pin_contact_radius(stands)
    sine, sun, planet = math.sin(unit.pressure_angle), unit.sun_pitch_radius, unit.planet_pitch_radius
    mesh = np.array(sine * sun * planet / (sun + planet))
    pressed = {"pin": (size["pin"], widths[0], pin), "mesh": (size["mesh"], widths[1], mesh)}
    for contact, bearing in (("cam", cam_bearing), ("carrier", carrier_bearing)):
        if bearing is not None:
            roller = np.array(0.5 / (1 / bearing.roller_diameter + 1 / bearing.race_diameter))
            most = size[contact] / (_STRIBECK * bearing.rollers)
            pressed[contact] = most, bearing.roller_length, roller
    stiff = _plane_stiffness(modulus, poisson_ratio)
    return ContactPressure(
        theta=state.theta,
        force={contact: force for contact, (force, _, _) in pressed.items()},
        pressure={contact: np.sqrt(force * stiff / (math.pi * w * r)) for contact, (force, w, r) in pressed.items()},
        half_width={contact: strip_half_width(force / w, r, stiff) for contact, (force, w, r) in pressed.items()},
        place=stands.pin_angle,
    )


def pressing(state: Equilibrium) -> dict[str, Array]:
    """Size of each contact's force, N, keyed and shaped as `ContactPressure.force`."""
    size = {key: np.sqrt((state.contact_forces[key] ** 2).sum(axis=-2)) for key in CONTACT_INDICES}
    size["mesh"] = size["mesh"].sum(axis=1)  # of two flanks one carries, but for preload
    return size


def pin_contact_radius(stands: Contacts) -> Array:
    """Radius R of Hertz's formula of each pin on its disc, mm, (discs, pins, n)."""
    unit = stands.reducer
    return unit.pin_radius * (1 - unit.pin_radius * trochoid_curvature(unit, roll_angles(stands)))


def strip_half_width(load: Array, radius: Array, stiff: float | None = None) -> Array:
    """Half-width of the strip of contact under a load per length, N/mm, mm; of steel where E' is left out."""
    return np.asarray(2 * np.sqrt(load * radius / (math.pi * (stiff or _plane_stiffness(*_STEEL)))))


def _plane_stiffness(modulus: float, poisson_ratio: float) -> float:
    """E' of two equal materials."""
    return modulus / (2 * (1 - poisson_ratio**2))
