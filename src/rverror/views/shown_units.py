"""Units of results: those of the core, and those in which people read them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from rverror.base import units
from rverror.base.units import ARCSEC


@dataclass(frozen=True)
class Unit:
    """Core unit, unit for people, both in pint's notation, how many of the first make one of the second, its zero."""

    core: str
    shown: str
    size: float = 1.0
    zero: float = 0.0

    def text(self, *, display: bool) -> str:
        """Its name, for people or of the core."""
        return self.shown if display else self.core

    def of(self, value: Any) -> Any:
        """Values in the core unit as people read them."""
        return (value - self.zero) / self.size


NUMBER = Unit("dimensionless", "dimensionless")
PERCENT = Unit("dimensionless", "percent", 0.01)
POSITION = Unit("rad", "deg", math.radians(1))
ANGLE = Unit("rad", "arcsec", ARCSEC)
SQUARE = Unit("rad**2", "arcsec**2", ARCSEC**2)
LENGTH = Unit("mm", "um", 1e-3)
SIZE = Unit("mm", "mm")
TORQUE = Unit("N*mm", "N*m", 1e3)
FORCE = Unit("N", "N")
TIME = Unit("s", "s")
TEMPERATURE = Unit("kelvin", "degC", 1.0, 273.15)
SPEED = Unit("rad/s", "rpm", math.pi / 30)
HERTZ = Unit("Hz", "Hz")
HOURS = Unit("h", "h")
VOLUME = Unit("mm**3", "mm**3")
WATT = Unit("N*mm/s", "W", 1e3)


def unit_of(dimension: str) -> Unit:
    """Unit of an error of that dimension, a key of `units.CORE_UNITS`."""
    shown = units.DISPLAY_UNITS[dimension]
    return Unit(units.CORE_UNITS[dimension], shown, units.unit_factor(shown, dimension))


PRESSURE = unit_of("pressure")


def unit_for_people(unit: str) -> str:
    """Name of a unit in a report; numbers have none."""
    return {NUMBER.core: "", "percent": "%", "mm**3": "mm³"}.get(unit, unit)
