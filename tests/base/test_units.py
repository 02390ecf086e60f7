"""The units edge: text and quantities become plain floats in mm, rad, N*mm, s, K and back."""

from __future__ import annotations

import math
import subprocess
import sys
from typing import Any

import numpy as np
import pint
import pytest
from hypothesis import given, strategies as st

from rverror.base import units

REGISTRY = pint.UnitRegistry()


@pytest.mark.parametrize(
    ("text", "dimension", "value"),
    [
        ("5 um", "length", 0.005),
        ("5um", "length", 0.005),
        (" -5e-3 mm ", "length", -0.005),
        ("+.5 m", "length", 500.0),
        ("3. inch", "length", 76.2),
        ("20 deg", "angle", math.pi / 9),
        ("1 arcsec", "angle", math.pi / 648000),
        ("2 arcmin", "angle", math.pi / 5400),
        ("1 mrad", "angle", 1e-3),
        ("1 turn", "angle", 2 * math.pi),
        ("20 N*m", "torque", 20e3),
        ("1 kN*m", "torque", 1e6),
        ("200 N/um", "stiffness", 2e5),
        ("5 ms", "time", 5e-3),
        ("20 degC", "temperature", 293.15),
        ("300 kelvin", "temperature", 300.0),
        ("10 K", "temperature_rise", 10.0),
        ("-10 delta_degC", "temperature_rise", -10.0),
        ("18 delta_degF", "temperature_rise", 10.0),
        ("0.5 arcsec/(N*m)", "compliance", 0.5e-3 * math.pi / 648000),
        ("2 kg", "mass", 2e-3),
        ("3 kg*m^2", "inertia", 3e3),
        ("5 g*cm^2", "inertia", 5e-4),
        ("5 N*m/rad", "torsional_stiffness", 5e3),
        ("1 N*m/arcmin", "torsional_stiffness", 1e3 * 10800 / math.pi),
        ("0.01", "slope", 0.01),
        ("360 arcsec/turn", "slope", 1 / 3600),
        ("1 percent", "slope", 0.01),
    ],
)
def test_parse(text: str, dimension: str, value: float) -> None:
    assert units.parse(text, dimension) == pytest.approx(value, rel=1e-12)
    assert type(units.parse(text, dimension)) is float
    assert units.to_core(text, dimension) == units.parse(text, dimension)


@pytest.mark.parametrize(
    ("text", "dimension", "message"),
    [
        ("five um", "length", "'five um' is no number with a unit; write it like '5 um'"),
        ("", "length", "'' is no number with a unit"),
        ("nan mm", "length", "is no number with a unit"),
        ("5", "length", "'5' has no unit; write it like '5 um'"),
        ("20", "angle", "'20' has no unit; write it like '20 arcsec'"),
        ("20 counts", "angle", "'counts' is no unit of angle; use one like 'arcsec'"),
        ("20 percent", "angle", "'percent' is no unit of angle"),
        ("20 Grad", "angle", "'Grad' is 1e[+]09 rad; write 'deg' for degrees"),
        ("5 umm", "length", "unknown unit 'umm'; write it as pint does, e.g. 'um'"),
        ("5 5 mm", "length", "unknown unit|no unit"),
        ("5 ???", "length", r"unknown unit '\?\?\?'"),
        ("5 deg", "length", "'deg' is no unit of length; use one like 'um'"),
        ("5 N", "torque", r"'N' is no unit of torque; use one like 'N\*m'"),
        ("10 degC", "temperature_rise", "'degC' is a temperature, not a rise; write the difference, like '10 K'"),
        ("10 degF", "temperature_rise", "'degF' is a temperature, not a rise"),
        ("10 mm", "temperature_rise", "'mm' is no unit of temperature rise; use one like 'K'"),
        ("10", "temperature_rise", "'10' has no unit; write it like '10 K'"),
        ("1 N*m/rad", "compliance", r"is no unit of compliance; use one like 'arcsec/\(N\*m\)'"),
        ("1e999 mm", "length", "'1e999 mm' is not a finite value"),
    ],
)
def test_parse_refuses(text: str, dimension: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        units.parse(text, dimension)


@pytest.mark.parametrize("value", [5, 5.0, np.float32(5), np.int64(5), "5 mm", pint.UnitRegistry().Quantity(0.5, "cm")])
def test_to_core_takes_numbers_text_and_quantities(value: Any) -> None:
    assert units.to_core(value, "length") == pytest.approx(5, rel=1e-12)
    assert type(units.to_core(value, "length")) is float


@pytest.mark.parametrize("value", [math.nan, math.inf, None, [], [1.0, 2.0], {}, object(), "x", True])
def test_to_core_refuses(value: Any) -> None:
    with pytest.raises(ValueError, match=r"."):
        units.to_core(value, "length")


def test_to_core_refuses_a_quantity_of_another_dimension() -> None:
    with pytest.raises(ValueError, match="degree is no unit of length; use one like 'um'"):
        units.to_core(pint.UnitRegistry().Quantity(5, "deg"), "length")


def test_rises_are_differences() -> None:
    """A quantity in degrees Celsius has its own zero; the difference of two has none."""
    registry = pint.UnitRegistry()
    warm, cold = registry.Quantity(35.0, "degC"), registry.Quantity(20.0, "degC")
    assert units.to_core(warm - cold, "temperature_rise") == pytest.approx(15)
    assert units.to_core(15, "temperature_rise") == 15
    with pytest.raises(ValueError, match="'degree_Celsius' is a temperature, not a rise"):
        units.to_core(warm, "temperature_rise")
    assert units.to_core(warm, "temperature") == pytest.approx(308.15)


def test_arrays() -> None:
    theta = np.array([0, 90, 180])
    found = units.to_core_array(pint.UnitRegistry().Quantity(theta, "deg"), "angle")
    np.testing.assert_allclose(found, [0, math.pi / 2, math.pi])
    plain = np.array([1.0, 2.0])
    copy = units.to_core_array(plain, "length")
    copy[0] = 9
    assert plain[0] == 1  # a new array
    assert units.to_core_array([1, 2], "length").dtype == np.float64
    with pytest.raises(ValueError, match="must be finite"):
        units.to_core_array([1.0, math.nan], "length")
    with pytest.raises(ValueError, match="is no number"):
        units.to_core_array(["a"], "length")
    with pytest.raises(ValueError, match="no unit of length"):
        units.to_core_array(pint.UnitRegistry().Quantity(theta, "deg"), "length")


def test_factors_and_display() -> None:
    assert units.unit_factor("um", "length") == pytest.approx(1e-3)
    assert units.unit_factor("arcsec", "angle") == pytest.approx(units.ARCSEC, rel=1e-12)
    assert units.unit_factor("N*m", "torque") == pytest.approx(1000)
    assert units.to_display(0.005, "length") == pytest.approx(5)
    assert units.to_display(math.pi / 180, "angle") == pytest.approx(3600)
    assert units.to_display(412e3, "torque") == pytest.approx(412)
    assert units.to_display(1e-3, "time") == pytest.approx(1)
    with pytest.raises(ValueError, match="unknown unit 'furlongg'"):
        units.unit_factor("furlongg", "length")
    with pytest.raises(ValueError, match="is no unit of length"):
        units.unit_factor("s", "length")


def test_every_dimension_has_both_units() -> None:
    assert units.CORE_UNITS.keys() == units.DISPLAY_UNITS.keys()


@given(st.sampled_from(sorted(units.CORE_UNITS)), st.floats(0.1, 1e4))
def test_what_is_printed_reads_back(dimension: str, value: float) -> None:
    """Also for temperatures, whose display unit has another zero."""
    shown = units.to_display(value, dimension)
    assert units.parse(f"{shown!r} {units.DISPLAY_UNITS[dimension]}", dimension) == pytest.approx(value, rel=1e-9)


def test_a_number_needs_no_unit() -> None:
    assert units.parse("1.125", "number") == units.parse("1.125 dimensionless", "number") == 1.125
    with pytest.raises(ValueError, match="is no unit of number"):
        units.parse("1.125 mm", "number")


def test_is_quantity() -> None:
    assert units.is_quantity(pint.UnitRegistry().Quantity(5, "mm"))
    assert not units.is_quantity(5.0)
    assert not units.is_quantity("5 mm")


@pytest.mark.parametrize("text", ["1" * 5000 + "x\nx", "1" + " " * 5000 + "x\nx", "1" * 5000 + " " * 5000 + "x\nx"])
def test_a_long_text_that_is_no_quantity_is_refused(text: str) -> None:
    """A pattern that tries every split of such a text would never return."""
    with pytest.raises(ValueError, match="no number with a unit"):
        units.parse(text, "length")


@pytest.mark.parametrize(("dimension", "unit"), [(d, u) for d, (_, known) in units.EVERYDAY.items() for u in known])
def test_everyday_units_are_what_pint_says(dimension: str, unit: str) -> None:
    expected = REGISTRY.Quantity(7.0, unit).to(units.CORE_UNITS[dimension]).magnitude
    assert units.parse(f"7 {unit}", dimension) == pytest.approx(expected, rel=1e-15)


def test_each_dimension_is_read_and_shown_in_everyday_units() -> None:
    for dimension, (_, known) in units.EVERYDAY.items():
        assert {units.CORE_UNITS[dimension], units.DISPLAY_UNITS[dimension]} <= set(known)


def test_pint_is_loaded_for_other_units_only() -> None:
    code = (
        "import sys, rverror.base.units\n"
        "for text in ('5 um', '1 inch'):\n"
        "    rverror.base.units.parse(text, 'length')\n"
        "    print('pint' in sys.modules)"
    )
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert told.split() == ["False", "True"]
