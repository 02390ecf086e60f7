"""The reducer: presets, conversion, and one test per check of its geometry."""

from __future__ import annotations

import dataclasses
import math
import pickle
import re
from typing import Any

import pint
import pytest
from hypothesis import given

import rverror
from rverror import Drive, Reducer
from rverror.geartrain import Friction, Stiffness
from rverror.geartrain.mechanism import check_same_geometry, preset_parameters, presets
from strategies import reducers, variant

UNIT = rverror.reducer("RV-40E")


@pytest.mark.parametrize(
    ("preset", "ratio", "crank_circle", "cranks", "K"),
    [("RV-40E", 121, 27, 2, 1.25 * 40 / 64), ("RV-003", 101, 42, 3, 1.3 * 40 / 76.5)],
)
def test_presets(preset: str, ratio: float, crank_circle: float, cranks: int, K: float) -> None:
    unit = rverror.reducer(preset)
    assert unit.name == preset
    assert unit.ratio == ratio
    assert unit.exact_ratio == ratio
    assert unit.crank_radius == crank_circle
    assert unit.sun_pitch_radius + unit.planet_pitch_radius == crank_circle
    assert (unit.cranks, unit.discs, unit.pins, unit.disc_lobes) == (cranks, 2, 40, 39)
    assert unit.short_width_coefficient == pytest.approx(K)
    assert math.degrees(unit.pressure_angle) == pytest.approx(20)


def test_rv40e_values() -> None:
    assert (UNIT.sun_teeth, UNIT.planet_teeth, UNIT.module) == (9, 27, 1.5)
    assert (UNIT.pin_circle_radius, UNIT.pin_radius, UNIT.eccentricity) == (64, 3, 1.25)
    assert UNIT.rated_torque == 412e3
    assert UNIT.gear_backlash == 0.020


def test_preset_parameters_are_the_callers_own() -> None:
    for name in presets():
        preset_parameters(name)["pins"] = 0
        assert preset_parameters(name)["pins"] == 40


def test_plain_numbers_strings_and_quantities_say_the_same() -> None:
    registry = pint.UnitRegistry()
    lengths = {"module": 1.5, "pin_circle_radius": 64.0, "pin_radius": 3.0, "eccentricity": 1.25, "spline_radius": 7.0}
    texts: dict[str, Any] = {name: f"{value / 10} cm" for name, value in lengths.items()}
    quantities: dict[str, Any] = {name: registry.Quantity(1e3 * value, "um") for name, value in lengths.items()}
    texts |= {"pressure_angle": "20 deg", "rated_torque": "412 N*m", "gear_backlash": "20 um"}
    quantities |= {"pressure_angle": registry.Quantity(20, "degree"), "rated_torque": registry.Quantity(0.412, "kN*m")}
    for changed in (texts, quantities):
        unit = variant(UNIT, **changed)
        for name in dataclasses.asdict(UNIT):
            one, other = getattr(unit, name), getattr(UNIT, name)
            assert one == (pytest.approx(other, rel=1e-12) if isinstance(other, float) else other)
            assert type(one) is type(other)


def test_stiffness_converts() -> None:
    assert Stiffness(pin_contact="200 N/um").pin_contact == pytest.approx(2e5)
    assert Stiffness(gear_mesh=1).gear_mesh == 1.0


@pytest.mark.parametrize("name", [field.name for field in dataclasses.fields(Stiffness)])
@pytest.mark.parametrize(("value", "message"), [(0, r"= 0 N/mm: .*above 0"), (-3.0, "= -3 N/mm"), ("5 mm", "no unit")])
def test_stiffness_refuses(name: str, value: Any, message: str) -> None:
    with pytest.raises(ValueError, match=f"{name}.*{message}"):
        Stiffness(**{name: value})


REFUSALS: list[tuple[dict[str, Any], str]] = [
    *(
        ({name: value}, rf"{name} = {value!r}: must be a whole number, {least} or more")
        for name, least in (
            ("sun_teeth", 5),
            ("planet_teeth", 5),
            ("disc_lobes", 3),
            ("pins", 4),
            ("cranks", 2),
            ("discs", 1),
        )
        for value in (2.0, "9", True, None)
    ),
    ({"sun_teeth": 4}, "sun_teeth = 4: must be 5 or more"),
    ({"planet_teeth": 4}, "planet_teeth = 4: must be 5 or more"),
    ({"disc_lobes": 2, "pins": 3}, "disc_lobes = 2: must be 3 or more"),
    ({"disc_lobes": 3, "pins": 3}, "pins = 3: must be 4 or more"),
    ({"cranks": 1}, "cranks = 1: must be 2 or more"),
    ({"discs": 0}, "discs = 0: must be 1 or more"),
    *(
        ({name: value}, f"{name} = {value:g} mm: must be above 0")
        for name in ("module", "pin_circle_radius", "pin_radius", "eccentricity", "spline_radius")
        for value in (0, -1.5)
    ),
    ({"rated_torque": -1e3}, r"rated_torque = -1 N\*m: must be above 0"),
    ({"gear_backlash": -0.01}, "gear_backlash = -0.01 mm: must be 0 or more"),
    ({"pressure_angle": 0}, "pressure_angle = 0 deg: must lie between 0 and 45 deg"),
    ({"pressure_angle": 20.0}, "pressure_angle = 1145.92 deg: must lie between 0 and 45 deg; .*write '20 deg'"),
    ({"pressure_angle": "45 deg"}, "pressure_angle = 45 deg: must lie between"),
    ({"pins": 41}, "pins = 41 with disc_lobes = 39: .*use pins = 40 or disc_lobes = 40"),
    ({"disc_lobes": 40}, "pins = 40 with disc_lobes = 40: .*use pins = 41 or disc_lobes = 39"),
    ({"discs": 1}, "discs = 1 with cranks = 2: .*dead centres.*; use discs = 2 or cranks = 3"),
    ({"module": 3.3}, "module = 3.3 mm: the crank circle of 59.4 mm must lie inside the root circle of 58.5 mm"),
    ({"eccentricity": 1.6}, r"eccentricity = 1.6 mm: K = a z_p / R_p = 1 must be below 1, .* below 1.6 mm"),
    ({"eccentricity": 1.7}, r"eccentricity = 1.7 mm: K = .* = 1.062 must be below 1"),
    ({"pin_radius": 5.03, "eccentricity": 0.2}, "pin_radius = 5.03 mm: neighbouring pins overlap; .*below 5.021 mm"),
    ({"module": "20 deg"}, "module: 'deg' is no unit of length"),
    ({"module": "1.5"}, "module: '1.5' has no unit"),
    ({"module": None}, "module"),
    ({"module": math.nan}, "module.*finite"),
    ({"pin_circle_radius": math.inf}, "pin_circle_radius.*finite"),
    ({"rated_torque": "412 N"}, "rated_torque: 'N' is no unit of torque"),
]


@pytest.mark.parametrize(("changed", "message"), REFUSALS, ids=[str(changed) for changed, _ in REFUSALS])
def test_refuses_and_says_value_and_bound(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        variant(UNIT, **changed)


@given(reducers())
def test_undercut_bound(unit: Reducer) -> None:
    """Just under the smallest convex radius is allowed, the radius itself is not, unless pins touch before."""
    bound = unit.smallest_convex_radius
    overlap = unit.pin_circle_radius * math.sin(math.pi / unit.pins)
    if bound > 0.99 * overlap:
        return
    small = variant(unit, module=unit.module / 4)  # out of the way of the crank circle check
    variant(small, pin_radius=0.999 * bound)
    with pytest.raises(ValueError, match=rf"pin_radius = .* undercut; .*{re.escape(f'{bound:.4g}')} mm"):
        variant(small, pin_radius=1.001 * bound)


def test_rv40e_undercut_bound() -> None:
    """K = 0.78125 lies above (z_p - 2) / (2 z_p - 1): the sharpest place is on the flank, not at the tip."""
    K = 0.78125
    flank = 64 * math.sqrt(27 * (1 - K**2) * 39 / 41**3)
    assert flank < 64 * (1 + K) ** 2 / (1 + 40 * K)  # at the tip
    assert UNIT.smallest_convex_radius == pytest.approx(flank, rel=1e-12)
    with pytest.raises(ValueError, match="undercut"):
        rverror.reducer("RV-40E", pin_radius=4.96)
    gentle = variant(UNIT, eccentricity=0.5)
    assert gentle.smallest_convex_radius == pytest.approx(64 * (1 + 0.3125) ** 2 / (1 + 40 * 0.3125), rel=1e-12)


def test_overrides_of_a_preset() -> None:
    assert rverror.reducer("RV-40E", cranks=3).cranks == 3
    assert rverror.reducer("RV-40E", planet_teeth=26).crank_radius == pytest.approx(1.5 * 35 / 2)
    with pytest.raises(ValueError, match=r"no reducer parameter 'crancs'; did you mean 'cranks'\?"):
        rverror.reducer("RV-40E", crancs=3)
    with pytest.raises(ValueError, match=r"no preset 'RV40E'; did you mean 'RV-40E'\? the presets are RV-40E, RV-003"):
        rverror.reducer("RV40E")


def test_reducer_is_a_value() -> None:
    assert rverror.reducer("RV-40E") == UNIT
    assert hash(rverror.reducer("RV-40E")) == hash(UNIT)
    assert pickle.loads(pickle.dumps(UNIT)) == UNIT
    with pytest.raises(dataclasses.FrozenInstanceError):
        UNIT.cranks = 3  # type: ignore[misc]
    with pytest.raises(TypeError):
        Reducer(9, 27, 1.5)  # type: ignore[call-arg, misc]


@pytest.mark.parametrize("bad", [0, 0.0, math.nan, math.inf, "14", True, None])
def test_drive_refuses(bad: Any) -> None:
    with pytest.raises(ValueError, match=rf"ratio = {bad!r}: must be a finite number other than 0"):
        Drive(ratio=bad)
    with pytest.raises(ValueError, match=rf"motor = {bad!r}: must be a finite number other than 0"):
        Drive(ratio=-14.0, shafts={"motor": bad})


def test_friction_leaves_the_geometry_as_it_is() -> None:
    check_same_geometry(UNIT, dataclasses.replace(UNIT, friction=Friction(pin=0.05)))
    with pytest.raises(ValueError, match=r"pin_radius = 2\.5, here 3\.0: only .*friction"):
        check_same_geometry(UNIT, dataclasses.replace(UNIT, pin_radius=2.5))


def test_drive_pickles() -> None:
    drive = Drive(ratio=-14.0, shafts={"motor": 14.0})
    assert pickle.loads(pickle.dumps(drive)) == drive
