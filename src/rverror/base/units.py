"""The units edge: the only module that knows pint.

Inside rverror every number is a float in mm, rad, N, N*mm, s or K; masses are in tonnes, which are N*s^2/mm.  Here
quantities and strings with a unit become such floats, and floats become numbers that people read.  pint is loaded for
what `EVERYDAY` does not hold: making its registry takes longer than many a diagnosis.
"""

from __future__ import annotations

import functools
import math
import re
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from rverror.base.errors import InputError

if TYPE_CHECKING:
    import pint

_DEG = math.pi / 180.0
#: One second of arc in rad.
ARCSEC = _DEG / 3600.0

#: Of each dimension the unit that people read, and the factor to the core unit of those that people write most; the
#: first of these is the core unit.  Units are written as pint does.
EVERYDAY: Mapping[str, tuple[str, Mapping[str, float]]] = {
    "length": ("um", {"mm": 1.0, "um": 1e-3}),
    "angle": ("arcsec", {"rad": 1.0, "mrad": 1e-3, "deg": _DEG, "arcmin": 60.0 * ARCSEC, "arcsec": ARCSEC}),
    "torque": ("N*m", {"N*mm": 1.0, "N*m": 1e3}),
    "stiffness": ("N/mm", {"N/mm": 1.0, "N/um": 1e3}),
    "time": ("ms", {"s": 1.0, "ms": 1e-3, "h": 3600.0}),
    "temperature": ("degC", {"kelvin": 1.0, "K": 1.0, "degC": 1.0}),
    "temperature_rise": ("K", {"kelvin": 1.0, "K": 1.0}),
    "angular_speed": ("rpm", {"rad/s": 1.0, "deg/s": _DEG, "rpm": math.pi / 30.0}),
    "compliance": ("arcsec/(N*m)", {"rad/(N*mm)": 1.0, "arcsec/(N*m)": 1e-3 * ARCSEC}),
    "contact_compliance": ("um/kN", {"mm/N": 1.0, "um/N": 1e-3, "um/kN": 1e-6}),
    "mass": ("kg", {"tonne": 1.0, "kg": 1e-3, "g": 1e-6}),
    "acceleration": ("m/s^2", {"mm/s^2": 1.0, "m/s^2": 1e3}),
    "inertia": ("kg*m^2", {"tonne*mm^2": 1.0, "kg*m^2": 1e3, "kg*cm^2": 0.1}),
    "torsional_stiffness": ("N*m/rad", {"N*mm/rad": 1.0, "N*m/rad": 1e3}),
    "pressure": ("MPa", {"N/mm^2": 1.0, "MPa": 1.0, "GPa": 1e3}),
    "wear_coefficient": ("mm^3/(N*m)", {"mm^2/N": 1.0, "mm^3/(N*m)": 1e-3}),
    "thermal_resistance": ("kelvin/W", {"kelvin*s/(N*mm)": 1.0, "kelvin/W": 1e-3, "K/W": 1e-3}),
    "viscosity": ("mm^2/s", {"mm^2/s": 1.0, "cSt": 1.0}),
    "slope": ("arcsec/turn", {"dimensionless": 1.0, "arcsec/turn": ARCSEC / (2.0 * math.pi)}),
    "number": ("dimensionless", {"dimensionless": 1.0}),
}
_ZERO = {"degC": 273.15}  # of temperatures that are no rises, in the core unit

#: Unit of each dimension inside the library, and the one in which a value is printed for people.
CORE_UNITS = {dimension: next(iter(factors)) for dimension, (_, factors) in EVERYDAY.items()}
DISPLAY_UNITS = {dimension: shown for dimension, (shown, _) in EVERYDAY.items()}

#: Torques as people write them: pint takes "Nm" for a number of metres.
_NEWTON_METRE = re.compile(r"(?<![A-Za-z])([kM]?N)[ ·⋅.]?(mm|cm|m)(?![A-Za-z])")

#: Root units of what is made of angles, which have no dimension: counts and percent would pass for rad, Hz for rad/s.
_OF_ANGLES = {"angle": "radian", "angular_speed": "radian / second"}
_LARGEST_ANGLE = 1e4  # rad in one unit: 'Grad' would pass for a thousand million of them

# Without the unit: a pattern for both would try every split of a long text that has none.
_NUMBER = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")


class InCore(float):
    """A number that is known to be in the core unit: computed, or given with a unit.  Nobody doubts it."""

    __slots__ = ()


@functools.cache
def _registry() -> pint.UnitRegistry[float]:
    import pint

    return pint.UnitRegistry()


def is_quantity(value: object) -> bool:
    """Tell whether a value is a pint quantity, of any registry.

    Examples
    --------
    >>> is_quantity(5.0)
    False
    """
    pint = sys.modules.get("pint")  # who has a quantity has loaded it
    return pint is not None and isinstance(value, pint.Quantity)


def _spelled(unit: str) -> str:
    """Unit with its newton metres, in whatever spelling, as pint writes them."""
    whole = _NEWTON_METRE.fullmatch(unit)
    return f"{whole[1]}*{whole[2]}" if whole else _NEWTON_METRE.sub(r"(\1*\2)", unit)


def _checked_unit(unit: str, dimension: str) -> Any:
    try:
        parsed = _registry().Unit(unit)
    except Exception as error:
        raise ValueError(f"unknown unit {unit!r}; write it as pint does, e.g. {DISPLAY_UNITS[dimension]!r}") from error
    if not parsed.is_compatible_with(CORE_UNITS[dimension]):
        raise ValueError(_no_unit(repr(unit), dimension))
    _refuse_own_zero(parsed, dimension, unit)
    if dimension in _OF_ANGLES:
        root = _registry().Quantity(1.0, parsed).to_root_units()
        if str(root.units) != _OF_ANGLES[dimension]:
            raise ValueError(_no_unit(repr(unit), dimension))
        if dimension == "angle" and root.magnitude > _LARGEST_ANGLE:
            raise ValueError(f"{unit!r} is {root.magnitude:.3g} rad; write 'deg' for degrees")
    return parsed


def _no_unit(unit: str, dimension: str) -> str:
    return f"{unit} is no unit of {dimension.replace('_', ' ')}; use one like {DISPLAY_UNITS[dimension]!r}"


def _refuse_own_zero(unit: Any, dimension: str, written: str) -> None:
    """A rise is a difference: 10 degC would be taken for 283 K."""
    if dimension == "temperature_rise" and _registry().Quantity(0.0, str(unit)).to("kelvin").magnitude != 0:
        raise ValueError(f"{written!r} is a temperature, not a rise; write the difference, like '10 K'")


def unit_factor(unit: str, dimension: str) -> float:
    """Factor that turns numbers in `unit` into the core unit of `dimension`.

    Raises
    ------
    ValueError
        If the unit is unknown or of another dimension.

    Examples
    --------
    >>> unit_factor("um", "length")
    0.001
    """
    return unit_scale(unit, dimension)[0]


def unit_scale(unit: str, dimension: str) -> tuple[float, float]:
    """Factor that turns numbers in `unit` into the core unit of `dimension`, and the zero of `unit` in it.

    Raises
    ------
    ValueError
        If the unit is unknown or of another dimension.

    Examples
    --------
    >>> unit_scale("degC", "temperature")
    (1.0, 273.15)
    """
    unit = _spelled(unit)
    factors = EVERYDAY[dimension][1]
    if unit in factors:
        return factors[unit], _ZERO.get(unit, 0.0)
    parsed, core = _checked_unit(unit, dimension), CORE_UNITS[dimension]
    zero, one = (float(_registry().Quantity(number, parsed).to(core).magnitude) for number in (0.0, 1.0))
    return one - zero, zero


def parse(text: str, dimension: str) -> float:
    """Read a string such as ``"5 um"`` as a float in the core unit of its dimension.

    Raises
    ------
    ValueError
        If there is no number, no unit, an unknown unit or one of another dimension, or the value is not finite.

    Examples
    --------
    >>> parse("412 N*m", "torque")
    412000.0
    """
    match = _NUMBER.match(text.strip())
    number = match[0] if match else ""
    unit = text.strip()[len(number) :].strip()
    if match is None or "\n" in unit:
        raise ValueError(f"{text!r} is no number with a unit; write it like '5 {DISPLAY_UNITS[dimension]}'")
    if not unit:
        if dimension not in ("slope", "number"):
            raise ValueError(f"{text!r} has no unit; write it like '{number} {DISPLAY_UNITS[dimension]}'")
        unit = "dimensionless"
    factor, zero = unit_scale(unit, dimension)
    value = float(number) * factor + zero
    if not math.isfinite(value):
        raise ValueError(f"{text!r} is not a finite value; give a number that is")
    return value


def to_core(value: Any, dimension: str) -> float:
    """Turn a quantity, a string with a unit or a plain number into a float in the core unit.

    Parameters
    ----------
    value : pint.Quantity or str or float
        Plain numbers are taken to be in the core unit already (mm, rad, N*mm, N/mm, s).
    dimension : str
        One of the keys of `CORE_UNITS`.

    Returns
    -------
    float
        The value in the core unit.

    Raises
    ------
    ValueError
        If the value is no number, not finite, or of another dimension.

    Examples
    --------
    >>> to_core("90 deg", "angle") == math.pi / 2
    True
    """
    if type(value) in (float, InCore) and math.isfinite(value):
        return float(value)
    if isinstance(value, str):
        return parse(value, dimension)
    if isinstance(value, bool) or np.ndim(getattr(value, "magnitude", value)) != 0:
        raise ValueError(f"{value!r} is no single number; give a number in {CORE_UNITS[dimension]} or a quantity")
    return float(to_core_array(value, dimension))


def named_core(name: str, value: Any, dimension: str) -> float:
    """`to_core` of a value whose name a refusal begins with.

    Raises
    ------
    InputError
        As `to_core`.

    Examples
    --------
    >>> named_core("module", "1.5 mm", "length")
    1.5
    """
    try:
        return to_core(value, dimension)
    except ValueError as error:
        raise InputError(f"{name}: {error}") from error


def to_core_array(value: Any, dimension: str) -> npt.NDArray[np.float64]:
    """Turn an array-like, a quantity that holds an array or a string into a float64 array in the core unit.

    The array is a new one, of the same shape, () for a string; plain numbers are taken as in `to_core`.

    Raises
    ------
    ValueError
        If the values are no numbers, not finite, or of another dimension.
    """
    if isinstance(value, str):
        return np.array(parse(value, dimension))
    if is_quantity(value):
        if not value.is_compatible_with(CORE_UNITS[dimension]):
            raise ValueError(_no_unit(str(value.units), dimension))
        _refuse_own_zero(value.units, dimension, str(value.units))
        value = value.to(CORE_UNITS[dimension]).magnitude
    try:
        array = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{value!r} is no number; give a number in {CORE_UNITS[dimension]} or a quantity") from error
    if not np.isfinite(array).all():
        raise ValueError(f"values in {CORE_UNITS[dimension]} must be finite")
    return array


def to_display(value: float, dimension: str) -> float:
    """Turn a float in the core unit into the unit in which people read it (um, arcsec, N*m).

    Parameters
    ----------
    value : float
        In the core unit.
    dimension : str
        One of the keys of `DISPLAY_UNITS`.

    Returns
    -------
    float
        In the unit for people.

    Examples
    --------
    >>> to_display(0.005, "length")
    5.0
    """
    factor, zero = unit_scale(DISPLAY_UNITS[dimension], dimension)
    return (value - zero) / factor
