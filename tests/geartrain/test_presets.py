"""The presets: every number has its origin, and what is derived or assumed follows its rule."""

from __future__ import annotations

import math
import re
from fractions import Fraction

import numpy as np
import pytest

import rverror
from pages import DOCS, text
from rverror.base.quantities import COUNT, quantities
from rverror.base.units import CORE_UNITS, DISPLAY_UNITS, to_display
from rverror.geartrain import Stiffness
from rverror.geartrain.mechanism import preset_parameters, presets

#: Ratios of the maker's table, shaft rotation; what is printed with decimals is cut off or rounded.
PRINTED = {
    "RV-20E": ("57", "81", "105", "121", "141", "161"),
    "RV-40E": ("57", "81", "105", "121", "153"),
    "RV-80E": ("57", "81", "101", "121", "153"),
    "RV-110E": ("81", "111", "127.7", "161", "175.2"),
    "RV-160E": ("66", "81", "101", "129", "145", "171"),
    "RV-320E": ("66", "81", "101", "118.5", "129", "141", "171", "185"),
}
#: From which size the lengths are taken.
BASE = {"RV-20E": "RV-40E", "RV-110E": "RV-80E", "RV-320E": "RV-80E"}
MODULES = (1, 1.125, 1.25, 1.375, 1.5, 1.75, 2, 2.25, 2.5)  # ISO 54, both series
N_M_PER_ARCMIN = 1e3 * 60 * 180 / math.pi  # N*mm/rad

DIMENSIONS = {name: what.dimension for name, what in quantities(rverror.Reducer).items()}


def suns(printed: str, pins: np.ndarray, teeth: np.ndarray) -> np.ndarray:
    """Sun teeth that make a ratio with so many pins and teeth of sun and planet together; 0 where none do."""
    sun = np.rint(teeth / (1 + (float(printed) - 1) / pins)).astype(int)
    turns, decimals = sun + (teeth - sun) * pins, 10 ** len(printed.partition(".")[2])  # ratio = turns / sun
    shown = int(Fraction(printed) * decimals)
    if decimals == 1:
        fits = turns == shown * sun
    else:  # cut off or rounded
        fits = (turns * decimals // sun == shown) | ((2 * turns * decimals + sun) // (2 * sun) == shown)
    return np.where(fits & (sun > 5), sun, 0)


def fitting(size: str, pins: int, teeth: int) -> dict[str, tuple[int, int]]:
    """Sun and planet teeth of that sum by the ratio that they make."""
    found = {printed: int(suns(printed, np.array(pins), np.array(teeth))) for printed in PRINTED[size]}
    return {printed: (sun, teeth - sun) for printed, sun in found.items() if sun}


def best(size: str) -> list[tuple[int, int]]:
    """Pins and sums of teeth that make most of a size's ratios, the smallest sum first."""
    teeth, pins = np.meshgrid(np.arange(30, 111), np.arange(20, 81), indexing="ij")
    count = sum((suns(printed, pins, teeth) > 0).astype(int) for printed in PRINTED[size])
    most = count == count.max()
    return list(zip(pins[most].tolist(), teeth[most].tolist(), strict=True))


@pytest.mark.parametrize("size", BASE)
def test_teeth_are_the_only_ones_that_make_the_printed_ratios(size: str) -> None:
    unit = rverror.reducer(size)
    pins, teeth = best(size)[0]
    assert (pins, teeth) == (unit.pins, unit.sun_teeth + unit.planet_teeth)
    # other solutions are the same gears with finer teeth
    assert all(other == (pins, k * teeth) for k, other in enumerate(best(size), 1))
    fits = fitting(size, pins, teeth)
    words = ("none", "one", "two", "three", "four", "five", "six", "seven", "eight")
    assert f"{words[len(fits)]} of {words[len(PRINTED[size])]}" in rverror.geartrain.preset_origins(size)["sun_teeth"]
    # of the ratios that fit and are whole, the nearest to the RV-40E's
    nearest = min((abs(int(printed) - 121), printed) for printed in fits if "." not in printed)[1]
    assert fits[nearest] == (unit.sun_teeth, unit.planet_teeth)
    assert unit.exact_ratio == int(nearest)


def test_the_rule_finds_teeth_that_are_printed() -> None:
    """Of the two sizes whose teeth are known: with the sum that is printed most ratios of the size come out whole."""
    assert fitting("RV-40E", 40, 9 + 27) == {"57": (15, 21), "81": (12, 24), "105": (10, 26), "121": (9, 27)}
    assert fitting("RV-80E", 40, 10 + 38) == {"57": (20, 28), "81": (16, 32), "121": (12, 36), "153": (10, 38)}
    assert best("RV-80E")[0] == (40, 48)
    # the fifth is source 003's unit: the same crank circle with another module
    assert fitting("RV-80E", 40, 12 + 30)["101"] == (12, 30)
    assert rverror.reducer("RV-003").crank_radius == rverror.reducer("RV-80E").crank_radius == 42


def test_a_size_whose_ratios_leave_the_teeth_open_is_no_preset() -> None:
    assert {teeth for _, teeth in best("RV-160E")} >= {42, 63}
    assert "RV-160E" not in presets()


@pytest.mark.parametrize("name", [name for name in PRINTED if name in presets()])
def test_ratio_is_one_that_the_maker_prints(name: str) -> None:
    assert str(rverror.reducer(name).exact_ratio) in PRINTED[name]


@pytest.mark.parametrize("size", BASE)
def test_lengths_are_those_of_a_similar_unit(size: str) -> None:
    unit, base = rverror.reducer(size), rverror.reducer(BASE[size])
    scale = (unit.rated_torque / base.rated_torque) ** (1 / 3)
    for name in ("pin_circle_radius", "pin_radius", "eccentricity"):
        value = getattr(unit, name)
        assert value == round(scale * getattr(base, name), 2)
        assert f"{scale:.4f}" in rverror.geartrain.preset_origins(size)[name]
    for name in ("cranks", "discs", "pressure_angle"):
        assert getattr(unit, name) == getattr(base, name)
    wished = 2 * scale * base.crank_radius / (unit.sun_teeth + unit.planet_teeth)
    assert f"{wished:.4f} mm" in rverror.geartrain.preset_origins(size)["module"]
    assert unit.module == min(MODULES, key=lambda module: abs(module - wished))


@pytest.mark.parametrize("name", [name for name in presets() if "stiffness" in preset_parameters(name)])
def test_stiffness_gives_the_windup_of_the_rv40e_under_rated_torque(name: str) -> None:
    unit = rverror.reducer(name)
    wished = 108 * unit.rated_torque / rverror.reducer("RV-40E").rated_torque
    found = rverror.statics.torsional_stiffness(rverror.Model(unit), np.array([0.3])) / N_M_PER_ARCMIN
    np.testing.assert_allclose(found, wished, rtol=0.005)  # the scale has three digits
    assert f"{wished:.4g} N*m/arcmin" in rverror.geartrain.preset_origins(name)["stiffness"]
    proportions = [getattr(unit.stiffness, key) / getattr(Stiffness(), key) for key in vars(unit.stiffness)]
    np.testing.assert_allclose(proportions, proportions[0], rtol=0.005)


@pytest.mark.parametrize("name", ["RV-80E", "RV-110E", "RV-320E"])
def test_rated_torque_is_the_number_in_the_name(name: str) -> None:
    """The maker's older unit, kgf*m of 9.8 N*m: what confirms numbers that are known from quotations alone."""
    assert rverror.reducer(name).rated_torque == pytest.approx(9.8e3 * int(name[3:-1]), rel=1e-12)


@pytest.mark.parametrize("name", presets())
def test_equilibrium_under_rated_torque_holds_the_load(name: str) -> None:
    """The housing carries what the input does not, T (1 - 1/R), by its pins alone: a moment about its centre."""
    unit = rverror.reducer(name)
    torque = unit.rated_torque or 784e3  # of source 003's unit none is printed
    state = rverror.equilibrium(rverror.Model(unit), np.array([0.7]), torque=torque)
    force = state.contact_forces["pin"][..., 0].sum(axis=0)
    angle = 2 * math.pi * np.arange(unit.pins) / unit.pins
    moment = unit.pin_circle_radius * (np.cos(angle) * force[:, 1] - np.sin(angle) * force[:, 0]).sum()
    assert abs(moment) == pytest.approx(torque * (1 - 1 / unit.ratio), rel=1e-3)


@pytest.mark.parametrize("name", presets())
def test_bores_turn_the_output_as_in_any_reducer(name: str) -> None:
    """All bores shifted alike around their part: -e/r6 of the carrier's, F e/r6 of the discs', at rated torque too."""
    unit, shift = rverror.reducer(name), 0.005
    torque, theta = unit.rated_torque or 784e3, np.array([0.7])
    feedback = unit.disc_lobes * unit.planet_teeth / unit.sun_teeth / unit.ratio
    carrier = [rverror.effect("coupling.carrier_bore_position", crank=j, tangential=shift) for j in range(unit.cranks)]
    discs = [
        rverror.effect("cycloid.disc_bore_position", disc=k, crank=j, tangential=shift)
        for k in range(unit.discs)
        for j in range(unit.cranks)
    ]
    nominal = rverror.equilibrium(rverror.Model(unit), theta, torque=torque).transmission_error
    for effects, turn in ((carrier, -1.0), (discs, feedback)):
        model = rverror.Model(unit, tuple(effects))
        expected = turn * shift / unit.crank_radius
        np.testing.assert_allclose(rverror.transmission_error(model, theta), expected, rtol=1e-9)
        loaded = rverror.equilibrium(model, theta, torque=torque).transmission_error
        np.testing.assert_allclose(loaded - nominal, expected, rtol=1e-6)


@pytest.mark.parametrize("name", presets())
def test_every_number_has_an_origin_that_the_bibliography_or_a_rule_tells(name: str) -> None:
    origins = rverror.geartrain.preset_origins(name)
    assert set(origins) == set(preset_parameters(name)) - {"name"}
    headings = re.findall(r"^## (.+)$", text(DOCS / "bibliography.md"), re.MULTILINE)
    known = (*headings, "inferred:", "derived:", "assumed:")
    assert all(origin.startswith(known) for origin in origins.values())
    with pytest.raises(ValueError, match="no preset 'RV-20'; did you mean 'RV-20E'"):
        rverror.geartrain.preset_origins("RV-20")


def written(name: str, value: object) -> str:
    if isinstance(value, Stiffness):
        return ", ".join(f"{key} {number / 1e3:g}" for key, number in vars(value).items()) + " kN/mm"
    if name not in DIMENSIONS or DIMENSIONS[name] == COUNT:
        return str(value)
    shown = {"length": "mm"}.get(DIMENSIONS[name], DISPLAY_UNITS[DIMENSIONS[name]])
    core = shown == CORE_UNITS[DIMENSIONS[name]]
    number = math.degrees(value) if name == "pressure_angle" else value if core else to_display(value, DIMENSIONS[name])
    return f"{number:g} {'deg' if name == 'pressure_angle' else shown}"


def table_of(name: str) -> str:
    origins = {
        key: said.replace("*", r"\*") for key, said in rverror.geartrain.preset_origins(name).items()
    }  # no emphasis
    rows = [
        f"| `{key}` | {written(key, value)} | {origins[key]} |"
        for key, value in preset_parameters(name).items()
        if key != "name"
    ]
    return "\n".join(["| parameter | value | origin |", "|---|---|---|", *rows])


@pytest.mark.parametrize("name", presets())
def test_page_lists_every_number_with_its_origin(name: str) -> None:
    section = re.search(rf"^## {name}\n(.*?)(?=^## |\Z)", text(DOCS / "presets.md"), re.MULTILINE | re.DOTALL)
    assert section is not None
    assert table_of(name) in section[1]


@pytest.mark.parametrize("size", [size for size in PRINTED if size in presets()])
def test_page_lists_the_teeth_of_the_other_ratios(size: str) -> None:
    unit = rverror.reducer(size)
    pairs = fitting(size, 40, unit.sun_teeth + unit.planet_teeth)
    row = ", ".join(f"{ratio}: {sun}/{planet}" for ratio, (sun, planet) in pairs.items())
    assert f"| {size} | {row} |" in text(DOCS / "presets.md")
    for sun, planet in pairs.values():
        other = rverror.reducer(size, sun_teeth=sun, planet_teeth=planet)
        assert other.crank_radius == pytest.approx(unit.crank_radius, rel=1e-12)
