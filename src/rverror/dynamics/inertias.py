"""Mass and moment of inertia of every part, estimated from the geometry where they are not given."""

from __future__ import annotations

import dataclasses
import math

from rverror.geartrain.mechanism import Inertia, Reducer

DENSITY = 7.85e-9  # of steel, tonne/mm^3
#: Sizes that a reducer's parameters do not tell, as shares of its pin circle's radius.
_DISC_WIDTH = 0.15
_PLATE_WIDTH = 0.25  # of each of the carrier's two
_GEAR_WIDTH = 8.0  # of a planet, in modules
_SHAFT_OF_BORE = 0.7  # radius of a crankshaft
_BORE_OF_RIM = 0.8  # at most, of what a disc has between crank circle and rim
_HOLE_OVER_SUN = 2.0  # of a disc, in modules


def whole_inertia(reducer: Reducer) -> Inertia:
    """Mass and moment of inertia of every part: as given, or estimated.

    Parameters
    ----------
    reducer : Reducer

    Returns
    -------
    Inertia
        Without a value that is left out.

    Notes
    -----
    Steel plates and cylinders whose sizes follow from the pin circle, the crank circle and the gears; the table on the
    page of the dynamics has them.  True to some 30 %.

    Examples
    --------
    >>> from rverror.geartrain.mechanism import reducer
    >>> whole = whole_inertia(reducer("RV-40E"))
    >>> 0.5e-3 < whole.disc_mass < 1.2e-3  # a disc of a reducer of this size has a kilogram or less
    True
    """
    given = {name: value for name, value in dataclasses.asdict(reducer.inertia).items() if value is not None}
    return Inertia(**_estimated(reducer) | given)


def _estimated(reducer: Reducer) -> dict[str, float]:
    width = _DISC_WIDTH * reducer.pin_circle_radius
    plate = reducer.pin_circle_radius - reducer.pin_radius
    # neither bores nor the hole meet one another or the rim, so that some disc is left in any geometry
    apart = reducer.crank_radius / 2 * math.sin(math.pi / max(reducer.cranks, 3))
    bore = min(apart, _BORE_OF_RIM * (plate - reducer.crank_radius))
    over_sun = min(reducer.sun_pitch_radius + _HOLE_OVER_SUN * reducer.module, reducer.crank_radius - bore)
    disc, polar = _cylinder(plate, width)
    bored, bored_polar = _cylinder(bore, width)
    hole, hole_polar = _cylinder(over_sun, width)
    shaft, shaft_polar = _cylinder(_SHAFT_OF_BORE * bore, (reducer.discs + 2) * width)
    planet, planet_polar = _cylinder(reducer.planet_pitch_radius, _GEAR_WIDTH * reducer.module)
    carrier, carrier_polar = _cylinder(plate - 2 * reducer.eccentricity, 2 * _PLATE_WIDTH * reducer.pin_circle_radius)
    sun, sun_polar = _cylinder(reducer.sun_pitch_radius, reducer.pin_circle_radius)
    return {
        "carrier_mass": carrier,
        "carrier_inertia": carrier_polar,
        "disc_mass": disc - hole - reducer.cranks * bored,
        "disc_inertia": polar - hole_polar - reducer.cranks * (bored_polar + bored * reducer.crank_radius**2),
        "crank_mass": shaft + planet,
        "crank_inertia": shaft_polar + planet_polar,
        "sun_mass": sun,
        "sun_inertia": sun_polar,
    }


def _cylinder(radius: float, length: float) -> tuple[float, float]:
    """Mass, and moment of inertia about the axis."""
    mass = DENSITY * math.pi * radius**2 * length
    return mass, mass * radius**2 / 2
