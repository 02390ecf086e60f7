"""Model files: what is read, what is refused at which line, and that what is written reads back equal."""

from __future__ import annotations

import dataclasses
import math
import os
import re
import tomllib
import warnings
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, strategies as st

from recordings import bench, recording
from rverror import CATALOGUE, Drive, Effect, Model, Reducer, effect, reducer
from rverror.base.errors import InputError
from rverror.base.quantities import COUNT, quantities
from rverror.geartrain import ContactLaw, Friction, Inertia, Stiffness, StiffnessUncertainty
from rverror.geartrain.mechanism import presets
from rverror.model import Bench, Encoders
from rverror.model.model_file import load_model, save_model
from strategies import reducers, variant

GOOD = """\
# what the shop floor measured
name = "unit 7"

[reducer]
preset = "RV-40E"   # 000
gear_backlash = "20 um"

[reducer.stiffness]
pin_contact = "250000 N/mm"

[[effect]]
key = "crank.eccentricity"
crank = 1
disc = 0
radial = "-0.2477 um"
tangential = "0.2939 um"
uncertainty = "0.3000 um"

[[effect]]
key = "cycloid.pin_radius"
pin = "all"
deviation = "2 um"
origin = "drawing"
"""
FULL = """\
[reducer]
sun_teeth = 9
planet_teeth = 27
module = "1.5 mm"
pressure_angle = "20 deg"
disc_lobes = 39
pins = 40
pin_circle_radius = "64 mm"
pin_radius = "3 mm"
eccentricity = "1.25 mm"
cranks = 2
discs = 2
"""
DRIVE = """\
[drive]
ratio = -14.0

[drive.shafts]
motor = 14.0
"""
EFFECT = """\
[reducer]
preset = "RV-40E"

[[effect]]
key = "crank.eccentricity"
crank = 0
disc = 0
radial = "5 um"
"""


def load(tmp_path: Path, content: str | bytes) -> Model:
    file = tmp_path / "model.toml"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return load_model(file)


# --- what is read -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("change", [str, lambda t: "\ufeff" + t, lambda t: t.replace("\n", "\r\n")])
def test_good_file(tmp_path: Path, change: Any) -> None:
    model = load(tmp_path, change(GOOD))
    assert model == Model(
        reducer("RV-40E", gear_backlash="20 um", stiffness=Stiffness(pin_contact=2.5e5)),
        (
            effect("crank.eccentricity", crank=1, disc=0, radial=-0.2477e-3, tangential="0.2939 um",
                   uncertainty="0.3 um"),
            effect("cycloid.pin_radius", pin="all", deviation="2 um", origin="drawing"),
        ),
        "unit 7",
    )  # fmt: skip


def test_stiffness_uncertainty_and_contact_law(tmp_path: Path) -> None:
    file = tmp_path / "model.toml"
    file.write_text(
        '[reducer]\npreset = "RV-40E"\n[reducer.stiffness_uncertainty]\npin_contact = "40 %"\ncrank_bearing = 0\n'
        "gear_mesh = 0.1\n[reducer.contact_law]\npin_exponent = 1.11\n"
    )
    unit = load_model(file).mechanism
    assert unit == reducer(
        "RV-40E",
        stiffness_uncertainty=StiffnessUncertainty(pin_contact=0.4, crank_bearing=0.0, gear_mesh=0.1),
        contact_law=ContactLaw(pin_exponent=1.11),
    )
    assert isinstance(unit, Reducer)
    assert unit.stiffness_uncertainty.main_bearing == 0.25
    save_model(file, Model(unit), overwrite=True)
    text = file.read_text()
    assert "[reducer.stiffness_uncertainty]\npin_contact = 0.4\ncrank_bearing = 0.0\ngear_mesh = 0.1\n\n" in text
    assert text.endswith("[reducer.contact_law]\npin_exponent = 1.11\n")
    save_model(file, Model(reducer("RV-40E")), overwrite=True)
    assert "stiffness" not in file.read_text()
    assert "contact_law" not in file.read_text()


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ("[reducer.contact_law]\npin_exponent = 2", "line 4: pin_exponent = 2: must be from 1 to 1.5; 1 is linear"),
        ("[reducer.contact_law]\npin_exponent = '10/9'", "line 4: pin_exponent = '10/9': must be a bare number; write"),
        ("[reducer.contact_law]\npins = 1", "line 4: unknown key of [reducer.contact_law] 'pins'"),
        (
            "[reducer.stiffness_uncertainty]\npin_contact = '-1 %'",
            "line 4: pin_contact = -0.01: must be 0 or more, a share",
        ),
        (
            "[reducer.stiffness_uncertainty]\npin_contact = '1 N'",
            "line 4: pin_contact = '1 N': must be a number or a per",
        ),
        (
            "[reducer.stiffness_uncertainty]\npin_contact = inf",
            "line 4: pin_contact: values in dimensionless must",
        ),
        ("stiffness_uncertainty = 0.1", "line 3: stiffness_uncertainty = 0.1 is no table"),
    ],
)
def test_mistakes_in_them_are_named_with_their_line(tmp_path: Path, lines: str, message: str) -> None:
    file = tmp_path / "model.toml"
    file.write_text(f'[reducer]\npreset = "RV-40E"\n{lines}\n')
    with pytest.raises(InputError) as caught:
        load_model(file)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_all_parameters(tmp_path: Path) -> None:
    assert load(tmp_path, FULL).mechanism == Reducer(
        sun_teeth=9, planet_teeth=27, module=1.5, pressure_angle=math.radians(20), disc_lobes=39, pins=40,
        pin_circle_radius=64, pin_radius=3, eccentricity=1.25, cranks=2, discs=2,
    )  # fmt: skip


def test_stiffness_beside_a_preset_leaves_the_rest_of_the_preset(tmp_path: Path) -> None:
    unit = load(tmp_path, '[reducer]\npreset = "RV-320E"\n[reducer.stiffness]\npin_contact = "500 kN/mm"').mechanism
    assert isinstance(unit, Reducer)
    assert unit.stiffness == dataclasses.replace(reducer("RV-320E").stiffness, pin_contact=5e5)


def test_preset_with_values_beside_it(tmp_path: Path) -> None:
    unit = load(
        tmp_path,
        '[reducer]\npreset = "RV-40E"\nmodule = "1.4 mm"\ncranks = 3\nrated_torque = "400 N*m"\nspline_radius = "6 mm"',
    ).mechanism
    assert isinstance(unit, Reducer)
    assert (unit.module, unit.cranks, unit.spline_radius) == (1.4, 3, 6.0)
    assert unit.crank_radius == pytest.approx(1.4 * 36 / 2)
    assert unit.rated_torque == pytest.approx(400e3)


def test_drive(tmp_path: Path) -> None:
    model = load(
        tmp_path, DRIVE + '\n[[effect]]\nkey = "shaft.eccentricity"\nshaft = "motor"\nharmonic = 2\ncos = "1 deg"'
    )
    assert model.mechanism == Drive(ratio=-14.0, shafts={"motor": 14.0})
    assert model.effects[0].values == (pytest.approx(math.radians(1)), 0.0)
    assert load(tmp_path, "[drive]\nratio = 225").mechanism == Drive(ratio=225.0)


def test_inline_and_dotted_tables(tmp_path: Path) -> None:
    plain = load(tmp_path, EFFECT)
    assert load(tmp_path, 'reducer.preset = "RV-40E"\n' + EFFECT.split("\n\n", 1)[1]) == plain
    inline = '{key = "crank.eccentricity", crank = 0, disc = 0, radial = "5 um"}'
    assert load(tmp_path, f'effect = [{inline}]\nreducer = {{preset = "RV-40E"}}\n') == plain


def test_slope_has_no_unit_and_may_be_bare(tmp_path: Path) -> None:
    for value in ("1e-5", '"1e-5"', '"12.96 arcsec/turn"'):
        model = load(tmp_path, DRIVE + f'[[effect]]\nkey = "sensor.ratio_error"\nslope = {value}\n')
        assert model.effects[0].values[0] == pytest.approx(1e-5)


def test_effects_of_profile_temperature_and_load(tmp_path: Path) -> None:
    effects = """
[[effect]]
key = "cycloid.profile_modification"
equidistant = "12 um"
shift = "-8 um"

[[effect]]
key = "thermal.growth"
housing = "10 K"
discs = "25 delta_degC"
uncertainty = "1 K"

[[effect]]
key = "load.torsion"
compliance = "0.5 arcsec/(N*m)"
"""
    model = load(tmp_path, FULL + effects)
    modified, warm, soft = (item.values for item in model.effects)
    assert modified == pytest.approx((0.012, -0.008))
    assert warm == pytest.approx((10, 25, 0, 0, 0))
    assert model.effects[1].uncertainty == pytest.approx(1)
    assert soft == pytest.approx((0.5 * math.pi / 648000 / 1000,))
    save_model(tmp_path / "back.toml", model)
    assert load_model(tmp_path / "back.toml") == model
    text = (tmp_path / "back.toml").read_text()
    for words in ('housing = "10 K"', 'discs = "25 K"', 'compliance = "0.5 arcsec/(N*m)"', 'shift = "-8 um"'):
        assert words in text


def test_inertia_and_bench(tmp_path: Path) -> None:
    path = tmp_path / "m.toml"
    path.write_text(
        '[reducer]\npreset = "RV-40E"\n[reducer.inertia]\ndisc_mass = "800 g"\ncrank_inertia = "0.9 kg*cm^2"\n'
        '[bench]\nload_inertia = "2 kg*m^2"\nload_coupling_stiffness = "300 kN*m/rad"\n'
        'position_control_stiffness = "50 N*m/rad"\ndamping_ratio = "4 %"\n'
    )
    model = load_model(path)
    assert isinstance(model.mechanism, Reducer)
    # a tonne is N*s^2/mm: 0.8 kg = 0.8e-3; 0.9 kg*cm^2 = 0.9e-3 t * 100 mm^2; 2 kg*m^2 = 2e-3 t * 1e6 mm^2
    weights = model.mechanism.inertia
    assert (weights.disc_mass, weights.crank_inertia) == pytest.approx((0.8e-3, 0.09), rel=1e-12)
    assert weights.carrier_mass is None
    expected = Bench(load_inertia=2e3, load_coupling_stiffness=3e8, position_control_stiffness=5e4, damping_ratio=0.04)
    assert model.bench == expected
    assert model.with_effects(effect("crank.index", crank=0, angle=1e-3)).bench == expected
    save_model(tmp_path / "back.toml", model)
    assert load_model(tmp_path / "back.toml") == model


def test_encoders_of_a_reducer_and_of_a_drive(tmp_path: Path) -> None:
    stated = '[bench.encoders]\noutput_encoder = "1.24 arcsec"\noutput_counts = 8388608\n'
    expected = Encoders(output_encoder=1.24 / 206264.80624709636, output_counts=8388608)
    for number, text in enumerate((DRIVE, FULL + '[bench]\nload_inertia = "2 kg*m^2"\n')):
        model = load(tmp_path, text + stated)
        assert model.encoders.output_encoder == pytest.approx(expected.output_encoder, rel=1e-12)
        assert model.encoders.given().keys() == {"output_encoder", "output_counts"}
        assert model.bench == (Bench(load_inertia=2e3) if number else Bench())
        assert model.with_effects().encoders == model.encoders
        save_model(tmp_path / "back.toml", model, overwrite=True)
        assert load_model(tmp_path / "back.toml") == model


def test_friction_of_a_reducer(tmp_path: Path) -> None:
    lines = """[reducer.friction]
pin = 0.05
mesh = 0
crank_bearing = 0.0025
crank_bearing_radius = "1 cm"
drag = "4 N*m"
"""
    unit = load(tmp_path, FULL + lines).mechanism
    assert isinstance(unit, Reducer)
    assert unit.friction == Friction(pin=0.05, crank_bearing=0.0025, crank_bearing_radius=10.0, drag=4e3)
    assert unit == dataclasses.replace(load(tmp_path, FULL).mechanism, friction=unit.friction)
    save_model(tmp_path / "back.toml", Model(unit))
    assert load_model(tmp_path / "back.toml").mechanism == unit
    text = (tmp_path / "back.toml").read_text()
    assert (
        '[reducer.friction]\npin = 0.05\ncrank_bearing = 0.0025\ncrank_bearing_radius = "10 mm"\ndrag = "4 N*m"' in text
    )
    save_model(tmp_path / "none.toml", load(tmp_path, FULL))
    assert "friction" not in (tmp_path / "none.toml").read_text()


def test_every_parameter_of_the_reducer_has_a_key() -> None:
    names = {f.name for f in dataclasses.fields(Reducer)}
    tables = {"stiffness", "stiffness_uncertainty", "contact_law", "bearing_preload", "friction", "inertia"}
    sizes = quantities(Reducer)
    assert {*sizes, *tables, "name", "output"} == names
    for what in sizes.values():
        assert re.fullmatch(r"\d+" if what.dimension == COUNT else r"[\d.]+ \S+", what.example)


# --- what is refused --------------------------------------------------------------------------------------------------


def swapped(old: str, new: str, content: str = EFFECT) -> str:
    assert old in content
    return content.replace(old, new)


BAD: dict[str, tuple[str | bytes, list[str]]] = {
    "empty": ("", ["the file is empty", "preset"]),
    "binary": (b"\x00\xff\x00", ["no text file"]),
    "not utf-8": (b'name = "\xe9"\n', ["line 1", "0xe9", "UTF-8"]),
    "unquoted quantity": (swapped('"5 um"', "5 um"),
                          ["line 8, column", "no valid TOML", 'write radial = "5 um", with quotes']),
    "syntax": (EFFECT + "x = [1,\n", ["line 9", "no valid TOML", "correct this line"]),
    "twice": (swapped("disc = 0", "crank = 1"), ["line 7", "no valid TOML"]),
    "top level": ("nmae = 'x'\n" + EFFECT, ["line 1", "unknown top-level key 'nmae'", "did you mean 'name'"]),
    "top level table": (EFFECT + "[reduzer]\npins = 40\n", ["line 9", "'reduzer'", "did you mean 'reducer'"]),
    "name is a number": ("name = 3\n" + EFFECT, ["line 1", "name = 3", "must be a text", "quotes"]),
    "neither": ("name = 'x'\n", ["neither [reducer] nor [drive]", "exactly one"]),
    "both": (EFFECT + DRIVE, ["line 9", "both [reducer] and [drive]", "exactly one"]),
    "reducer is a text": ('reducer = "RV-40E"\n', ["line 1", "no table", "write '[reducer]'"]),
    "key of reducer": (swapped("sun_teeth", "sun_teth", FULL),
                       ["line 2", "'sun_teth'", "did you mean 'sun_teeth'", "[reducer]"]),
    "preset": (swapped("RV-40E", "RV-40"), ["line 2", "no preset 'RV-40'", "did you mean 'RV-40E'", "RV-003"]),
    "preset in lower case": (swapped("RV-40E", "rv-40e"), ["line 2", "did you mean 'RV-40E'"]),
    "preset is a number": (swapped('"RV-40E"', "40"), ["line 2", "preset = 40", "must be a text"]),
    "missing": (swapped("pins = 40\n", "", FULL), ["line 1", "no pins", "name a preset", "RV-40E"]),
    "all missing": ("[reducer]\n", ["line 1", "no sun_teeth, planet_teeth, module", "preset"]),
    "bare length": (swapped('"1.5 mm"', "1.5", FULL), ["line 4", "module = 1.5 has no unit", "like '1.5 mm'"]),
    "bare angle": (swapped('"20 deg"', "20", FULL), ["line 5", "pressure_angle = 20 has no unit", "like '20 deg'"]),
    "bare torque": (FULL + "rated_torque = 412\n", ["line 13", "no unit", "like '412 N*m'"]),
    "length without unit": (swapped('"1.5 mm"', '"1.5"', FULL), ["line 4", "module", "no unit", "'1.5 mm'"]),
    "length in deg": (swapped('"1.5 mm"', '"1.5 deg"', FULL), ["line 4", "module", "'deg'", "length", "'1.5 mm'"]),
    "length is a date": (swapped('"1.5 mm"', "2020-01-01", FULL), ["line 4", "module", "text with a unit"]),
    "length is a switch": (swapped('"1.5 mm"', "true", FULL), ["line 4", "module", "text with a unit"]),
    "count is a text": (swapped("pins = 40", 'pins = "40"', FULL),
                        ["line 7", "pins = '40'", "whole number", "like pins = 40"]),
    "count is a fraction": (swapped("pins = 40", "pins = 40.0", FULL), ["line 7", "pins = 40.0", "whole number"]),
    "count is a switch": (swapped("pins = 40", "pins = true", FULL), ["line 7", "pins = True", "whole number"]),
    "geometry": (swapped('"3 mm"', '"6 mm"', FULL), ["line 9", "pin_radius = 6 mm", "must be below"]),
    "geometry of a preset": (swapped('"RV-40E"\n', '"RV-40E"\neccentricity = "2 mm"\n'),
                             ["line 3", "eccentricity = 2 mm", "below 1.6 mm"]),
    "geometry of no line": (swapped('"RV-40E"\n', '"RV-40E"\nmodule = "4 mm"\n'), ["line 3", "module = 4 mm"]),
    "stiffness key": (FULL + "[reducer.stiffness]\npin_contakt = '1 N/mm'\n",
                      ["line 14", "'pin_contakt'", "did you mean 'pin_contact'"]),
    "stiffness number": (FULL + "[reducer.stiffness]\npin_contact = 2e5\n", ["line 14", "no unit", "N/mm"]),
    "stiffness zero": (FULL + "[reducer.stiffness]\npin_contact = '0 N/mm'\n", ["line 14", "above 0"]),
    "stiffness text": (FULL + "stiffness = 'high'\n", ["line 13", "no table", "[reducer.stiffness]"]),
    "inertia key": (FULL + "[reducer.inertia]\ndisk_mass = '1 kg'\n",
                    ["line 14", "'disk_mass'", "did you mean 'disc_mass'", "[reducer.inertia]"]),
    "mass without unit": (FULL + "[reducer.inertia]\ndisc_mass = 0.8\n", ["line 14", "no unit", "like '0.8 kg'"]),
    "mass in mm": (FULL + "[reducer.inertia]\ndisc_mass = '1 mm'\n", ["line 14", "'mm'", "mass", "'0.8 kg'"]),
    "inertia zero": (FULL + "[reducer.inertia]\nsun_inertia = '0 kg*m^2'\n",
                     ["line 14", "sun_inertia = 0 kg*m^2", "above 0", "leave it out"]),
    "friction key": (FULL + "[reducer.friction]\npins = 0.05\n", ["line 14", "'pins'", "did you mean 'pin'"]),
    "friction below 0": (FULL + "[reducer.friction]\npin = -0.05\n",
                         ["line 14", "pin = -0.05", "0 or more"]),
    "friction is a text": (FULL + "[reducer.friction]\nmesh = '5 %'\n", ["line 14", "mesh = '5 %'", "a bare number"]),
    "friction of no radius": (FULL + "[reducer.friction]\ncrank_bearing = 0.0025\n",
                              ["line 13", "crank_bearing_radius is missing", "0.0025", "like '10 mm'"]),
    "friction at radius 0": (FULL + "[reducer.friction]\ncarrier_bearing_radius = '0 mm'\n",
                             ["line 14", "carrier_bearing_radius = 0 mm", "above 0"]),
    "drag of a force": (FULL + "[reducer.friction]\ndrag = '4 N'\n", ["line 14", "'N'", "torque", "'4 N*m'"]),
    "friction of a drive": (DRIVE + "[drive.friction]\npin = 0.05\n", ["'friction'", "[drive]"]),
    "bench key": (FULL + "[bench]\nload_inertai = '1 kg*m^2'\n", ["line 14", "'load_inertai'", "'load_inertia'"]),
    "bench below 0": (FULL + "[bench]\ninput_inertia = '-1 kg*m^2'\n",
                      ["line 14", "input_inertia = -1 kg*m^2", "0 or more"]),
    "coupling zero": (FULL + "[bench]\ninput_coupling_stiffness = '0 N*m/rad'\n", ["line 14", "leave it out"]),
    "coupling of no load": (FULL + "[bench]\nload_coupling_stiffness = '9 N*m/rad'\n",
                            ["line 14", "give load_inertia too"]),
    "damping": (FULL + "[bench]\ndamping_ratio = 3\n", ["line 14", "damping_ratio = 3", "below 1", "like '3 %'"]),
    "damping twice": (
        FULL + "[bench]\ndamping_ratio = '3 %'\ngear_mesh_damping = '0.02 ms'\n",
        ["line 14", "beside damping by contact", "give one of them"],
    ),
    "damping is a text": (FULL + "[bench]\ndamping_ratio = 'low'\n", ["line 14", "a number or a percentage"]),
    "bench of a drive": (DRIVE + "[bench]\nload_inertia = '1 kg*m^2'\n", ["[bench]", "[reducer]", "take it out"]),
    "encoders' key": (DRIVE + "[bench.encoders]\noutput = '1 arcsec'\n", ["line 7", "'output'", "output_encoder"]),
    "encoders misspelt": (DRIVE + "[bench.encoder]\n", ["line 6", "'encoder'", "'encoders'"]),
    "encoder in mm": (DRIVE + "[bench.encoders]\noutput_encoder = '1 mm'\n", ["line 7", "output_encoder", "arcsec"]),
    "encoder below 0": (DRIVE + "[bench.encoders]\ninput_encoder = '-1 deg'\n", ["line 7", "plus or minus"]),
    "runout alone": (DRIVE + "[bench.encoders]\ncoupling_runout = '0.1 mm'\n", ["line 7", "coupling_radius", "both"]),
    "bench is a text": ("bench = 'old'\n" + FULL, ["line 1", "no table", "[bench]"]),
    "drive without ratio": ("name = 'x'\n[drive.shafts]\nmotor = 14\n", ["line 2", "lacks ratio", "ratio = -14.0"]),
    "drive key": (DRIVE.replace("ratio", "ratoi"), ["line 2", "'ratoi'", "did you mean 'ratio'"]),
    "ratio is a text": (swapped("-14.0", '"14:1"', DRIVE), ["line 2", "ratio = '14:1'", "finite number"]),
    "ratio is zero": (swapped("-14.0", "0", DRIVE), ["line 2", "ratio = 0:", "other than 0"]),
    "ratio is nan": (swapped("-14.0", "nan", DRIVE), ["line 2", "ratio = nan", "finite"]),
    "ratio is huge": (swapped("-14.0", "1" + "0" * 400, DRIVE), ["line 2", "ratio = ", "finite"]),
    "shaft is a text": (swapped("14.0\n", '"x"\n', DRIVE.replace("-14.0", "-1")), ["line 5", "motor = 'x'", "number"]),
    "shaft is zero": (swapped("motor = 14.0", "motor = 0", DRIVE), ["line 5", "motor = 0:", "other than 0"]),
    "shafts is a number": ("[drive]\nratio = 2\nshafts = 3\n", ["line 3", "no table", "[drive.shafts]"]),
    "single effect": (swapped("[[effect]]", "[effect]"), ["line 4", "single table", "[[effect]]"]),
    "effect is a number": ("effect = [3]\n" + FULL, ["line 1", "effect holds 3", "no table", "[[effect]]"]),
    "no key": (swapped('key = "crank.eccentricity"\n', ""), ["line 4", "lacks key", "crank.eccentricity"]),
    "key is a number": (swapped('"crank.eccentricity"', "3"), ["line 5", "key = 3", "text"]),
    "unknown key": (swapped("crank.ecc", "crank.exc"), ["line 5", "no error source", "mean 'crank.eccentricity'"]),
    "strange key": (swapped("crank.eccentricity", "zzz"), ["line 5", "'zzz'", "`rverror sources`"]),
    "index name": (swapped("disc = 0", "disk = 0"), ["line 7", "'disk'", "did you mean 'disc'"]),
    "index missing": (swapped("disc = 0\n", ""), ["line 5", "'disc' is missing", "0, 1"]),
    "index out of range": (swapped("disc = 0", "disc = 2"), ["line 7", "disc = 2", "0, 1"]),
    "index negative": (swapped("crank = 0", "crank = -1"), ["line 6", "crank = -1", "0, 1"]),
    "index is a fraction": (swapped("disc = 0", "disc = 1.0"), ["line 7", "disc = 1.0", "0, 1"]),
    "index is a switch": (swapped("disc = 0", "disc = true"), ["line 7", "disc = True", "0, 1"]),
    "index is a text": (swapped("disc = 0", 'disc = "0"'), ["line 7", "disc = '0'", "0, 1"]),
    "no size": (swapped('radial = "5 um"\n', ""), ["line 5", "no parameter given", "radial, tangential"]),
    "bare size": (swapped('"5 um"', "5"), ["line 8", "radial = 5 has no unit", "like '5 um'"]),
    "size in deg": (swapped('"5 um"', '"5 deg"'), ["line 8", "radial", "'deg'", "length"]),
    "size in an unknown unit": (swapped('"5 um"', '"5 mikron"'), ["line 8", "radial", "'mikron'", "um"]),
    "size without number": (swapped('"5 um"', '"um"'), ["line 8", "radial", "no number"]),
    "size of infinity": (swapped('"5 um"', '"1e999 um"'), ["line 8", "radial", "finite"]),
    "bare angle size": (DRIVE + '[[effect]]\nkey = "sensor.drift"\ntotal = 3\n', ["line 8", "like '10 arcsec'"]),
    "temperature for a rise": (FULL + '[[effect]]\nkey = "thermal.growth"\nhousing = "10 degC"\n',
                               ["line 15", "housing", "'degC' is a temperature, not a rise", "like '10 K'"]),
    "bare rise": (FULL + '[[effect]]\nkey = "thermal.growth"\ndiscs = 10\n', ["line 15", "no unit", "like '10 K'"]),
    "rise in mm": (FULL + '[[effect]]\nkey = "thermal.growth"\ndiscs = "1 mm"\n', ["line 15", "'mm'", "'10 K'"]),
    "uncertainty of a rise": (FULL + '[[effect]]\nkey = "thermal.growth"\ndiscs = "9 K"\nuncertainty = "1 degC"\n',
                              ["line 16", "uncertainty", "not a rise", "like '0.3 K'"]),
    "stiffness for a compliance": (FULL + '[[effect]]\nkey = "load.torsion"\ncompliance = "9 N*m/rad"\n',
                                   ["line 15", "compliance", "'0.5 arcsec/(N*m)'"]),
    "negative compliance": (FULL + '[[effect]]\nkey = "load.torsion"\ncompliance = "-1 arcsec/(N*m)"\n',
                            ["line 14", "compliance = -1 arcsec/(N*m): must be 0 or more"]),
    "bare uncertainty": (EFFECT + "uncertainty = 0.3\n", ["line 9", "uncertainty = 0.3 has no unit", "'0.3 um'"]),
    "negative uncertainty": (EFFECT + 'uncertainty = "-1 um"\n', ["line 9", "uncertainty = '-1 um'", "0 or more"]),
    "origin": (EFFECT + "origin = 3\n", ["line 9", "origin = 3", "text"]),
    "second effect": (EFFECT + '\n# a remark\n[[effect]]\nkey = "crank.index"\ncrank = 0\nangel = "1 arcsec"\n',
                      ["line 14", "'angel'", "did you mean 'angle'"]),
    "after a long text": ('name = """\n[[effect]]\n"""\n' + swapped("disc = 0", "disc = 2"), ["line 10", "disc = 2"]),
    "source of the other kind": (DRIVE + '[[effect]]\nkey = "crank.index"\ncrank = 0\nangle = "1 arcsec"\n',
                                 ["line 7", "does not act in a [drive] model"]),
    "unknown shaft": (DRIVE + '[[effect]]\nkey = "shaft.eccentricity"\nshaft = "moter"\nharmonic = 1\ncos = "1 deg"\n',
                      ["line 8", "shaft = 'moter'", "'motor'"]),
    "spline without radius": (FULL + '[[effect]]\nkey = "involute.spline_clearance"\ncrank = 3\nclearance = "5 um"\n',
                              ["line 15", "crank = 3"]),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_refused_in_one_line(tmp_path: Path, name: str) -> None:
    content, words = BAD[name]
    with pytest.raises(InputError) as caught:
        load(tmp_path, content)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(str(tmp_path / "model.toml"))
    for word in words:
        assert re.search(re.escape(word) + (r"(?!\d)" if word[-1].isdigit() else ""), message), message


def test_negative_clearance_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    text = '[reducer]\npreset = "RV-40E"\n[[effect]]\nkey = "crank.bearing_clearance"\nclearance = "-5 um"\n'
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match="clearance = -5 um: must be 0 or more"):
        load_model(path)


@pytest.mark.parametrize("line", [" " * 5000, " " * 5000 + "# remark", "\t " * 2500 + "# a = 1"])
def test_long_lines_without_a_key_are_passed_over(tmp_path: Path, line: str) -> None:
    """A pattern that tries every way of splitting such a line would never return."""
    assert load(tmp_path, swapped("[[effect]]", f"{line}\n[[effect]]", GOOD)) == load(tmp_path, GOOD)


@pytest.mark.parametrize("words", ["word " * 1000, "word" * 1000, " " * 5000 + "'word'" * 1000])
def test_long_wrapped_lines_are_passed_over(tmp_path: Path, words: str) -> None:
    with pytest.raises(InputError, match=r"line 1: name = \[.*\]: must be a text"):
        load(tmp_path, f'name = [\n"""\n{words}\n"""]\n' + FULL)


@pytest.mark.parametrize("value", ["1a" * 10000 + "!", "1" + "a" * 20000 + "!", "1a" + " " * 20000 + "!"])
def test_long_values_without_quotes_are_refused(tmp_path: Path, value: str) -> None:
    with pytest.raises(InputError, match=r"line 1.* no valid TOML: .*; correct this line$"):
        load(tmp_path, f"name = {value}\n" + FULL)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="there is no such file"):
        load_model(tmp_path / "none.toml")
    with pytest.raises(InputError, match="this is a folder"):
        load_model(tmp_path)


@given(st.text(max_size=200), st.integers(0, len(GOOD)), st.integers(0, 30))
def test_any_text_gives_a_model_or_one_line(
    tmp_path_factory: pytest.TempPathFactory, text: str, place: int, length: int
) -> None:
    file = tmp_path_factory.mktemp("any") / "model.toml"
    for content in (text, GOOD[:place] + text + GOOD[place + length :], GOOD[:place] + GOOD[place + length :]):
        file.write_bytes(content.encode("utf-8", "surrogatepass"))
        message = ""
        try:
            load_model(file)
        except InputError as error:
            message = str(error)
        assert "\n" not in message


# --- what is written --------------------------------------------------------------------------------------------------

TEXTS = st.text(st.characters(codec="utf-8"), max_size=12)
LENGTHS = st.floats(-1, 1, allow_subnormal=True) | st.sampled_from([0.005, -0.0, 1e-300, 0.1 + 0.2])


@st.composite
def effects(draw: st.DrawFn, mechanism: Reducer | Drive) -> Effect:
    usable = [s for s in CATALOGUE.values() if s.applies_to(mechanism)]
    usable = [s for s in usable if all(index.allowed(mechanism) for index in s.indices)]
    entry = draw(st.sampled_from(usable))
    named = {index.name: draw(st.sampled_from(list(index.allowed(mechanism))[:50])) for index in entry.indices}
    named |= {
        parameter.name: draw(LENGTHS.filter(lambda v, p=parameter: v >= p.least)) for parameter in entry.parameters
    }
    sigma = draw(st.none() | st.floats(0, 1))
    origin = draw(TEXTS)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # no workshop makes them
        return effect(entry.key, uncertainty=sigma, origin=origin, **named)


numbers = st.fixed_dictionaries(
    {},
    optional={
        "stiffness_uncertainty": st.builds(StiffnessUncertainty, pin_contact=st.floats(0, 10), gear_mesh=st.just(0.1)),
        "contact_law": st.builds(ContactLaw, pin_exponent=st.floats(1, 1.5), flank_exponent=st.floats(1, 1.5)),
        "friction": st.builds(
            Friction,
            pin=st.floats(0, 1),
            crank_bearing=st.floats(0, 1),
            crank_bearing_radius=st.floats(1e-3, 1e3),
            carrier_bearing_radius=st.none() | st.floats(1e-3, 1e3),
            drag=st.floats(0, 1e6),
        ),
        "inertia": st.builds(Inertia, disc_mass=st.floats(1e-6, 1), sun_inertia=st.none() | st.floats(1e-6, 1e6)),
    },
)


benches = st.builds(
    Bench,
    input_inertia=st.floats(0, 1e6),
    position_control_stiffness=st.none() | st.floats(0, 1e9),
    input_coupling_stiffness=st.none() | st.floats(1e-3, 1e9),
    load_inertia=st.floats(1e-3, 1e9),
    load_coupling_stiffness=st.none() | st.floats(1e-3, 1e9),
    damping_ratio=st.none() | st.floats(0, 0.5),
) | st.builds(Bench, gear_mesh_damping=st.floats(0, 1), load_coupling_damping=st.none() | st.floats(0, 1))


readers = st.builds(
    Encoders,
    output_encoder=st.floats(0, 1),
    input_encoder=st.just(0.0) | st.floats(0, 1),
    output_counts=st.none() | st.integers(1, 2**30),
    coupling_runout=st.floats(0, 1),
    coupling_radius=st.floats(1, 100),
)


@st.composite
def models(draw: st.DrawFn) -> Model:
    mechanism: Reducer | Drive
    kind = draw(st.sampled_from(["random", "preset", "drive"]))
    if kind == "random":
        stiffness = Stiffness(pin_contact=draw(st.floats(1, 1e7)), sun_support=draw(st.floats(1, 1e7)))
        unit = draw(reducers(discs=(2, 4)))
        name, backlash = draw(TEXTS | st.just("RV-40E")), draw(st.floats(0, 0.2))
        torque = draw(st.none() | st.floats(1, 1e7))
        own = {"stiffness": stiffness, "gear_backlash": backlash, "rated_torque": torque} | draw(numbers)
        mechanism = variant(unit, name=name, **own)
    elif kind == "preset":
        changes: dict[str, Any] = draw(
            st.fixed_dictionaries(
                {},
                optional={
                    "module": st.floats(0.5, 1.6),
                    "cranks": st.integers(2, 4),
                    "pin_radius": st.floats(1, 3),
                    "rated_torque": st.none() | st.floats(1, 1e6),
                    "stiffness": st.just(Stiffness(gear_mesh=1.23456789e5)),
                },
            )
        )
        mechanism = reducer(draw(st.sampled_from(sorted(presets()))), **changes, **draw(numbers))
    else:
        turns = st.floats(-1e6, 1e6).filter(bool)
        mechanism = Drive(
            ratio=draw(turns),
            shafts=draw(st.dictionaries(TEXTS, turns, max_size=3)),
            name=draw(st.just("drive") | TEXTS),
        )
    hanging = draw(benches) if kind != "drive" else Bench()
    declared = tuple(draw(st.lists(effects(mechanism), max_size=4)))
    return Model(mechanism, declared, draw(TEXTS), hanging, draw(readers))


@given(models())
def test_saved_model_reads_back_equal(tmp_path_factory: pytest.TempPathFactory, model: Model) -> None:
    file = tmp_path_factory.mktemp("models") / "model.toml"
    save_model(file, model)
    assert load_model(file) == model


def test_saved_file_is_for_people(tmp_path: Path) -> None:
    unit = reducer("RV-40E", cranks=3)
    model = Model(unit, (effect("crank.index", crank=2, angle="12.5 arcsec", uncertainty="1 arcsec"),), "x")
    save_model(tmp_path / "m.toml", model)
    assert (tmp_path / "m.toml").read_text() == (
        'name = "x"\n\n[reducer]\npreset = "RV-40E"\ncranks = 3\n\n'
        '[[effect]]\nkey = "crank.index"\ncrank = 2\nangle = "12.5 arcsec"\nuncertainty = "1 arcsec"\n'
    )
    save_model(tmp_path / "full.toml", Model(variant(unit, name="custom")))
    table = tomllib.loads((tmp_path / "full.toml").read_text())["reducer"]
    assert table["module"] == "1.5 mm"
    assert table["pressure_angle"] == "20 deg"
    assert table["gear_backlash"] == "20 um"
    assert table["rated_torque"] == "412 N*m"


@pytest.mark.parametrize(
    "model",
    [
        Model(reducer("RV-40E"), (Effect("crank.index", {"crank": 0}, (math.nan,)),)),
        Model(reducer("RV-40E"), (Effect("crank.index", {"crank": 0}, (math.inf,)),)),
        Model(reducer("RV-40E"), (Effect("crank.index", {"crank": 0}, (1.0,), -1.0),)),
        Model(reducer("RV-40E"), name="\ud800"),
    ],
)
def test_what_no_file_can_hold_is_not_written(tmp_path: Path, model: Model) -> None:
    with pytest.raises(InputError):
        save_model(tmp_path / "m.toml", model)
    assert os.listdir(tmp_path) == []


def test_existing_file_stays_unless_overwriting_is_allowed(tmp_path: Path) -> None:
    file = tmp_path / "m.toml"
    file.write_text("precious")
    with pytest.raises(InputError, match=r"m\.toml: the file exists"):
        save_model(file, Model(reducer("RV-40E")))
    assert file.read_text() == "precious"
    save_model(file, Model(reducer("RV-40E")), overwrite=True)
    assert load_model(file) == Model(reducer("RV-40E"))


# --- the data at hand -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("unit", range(1, 7))
def test_bench_models(tmp_path: Path, unit: int) -> None:
    path = bench(f"train-{unit}", "model.toml")
    model = load_model(path)
    assert model.mechanism == reducer("RV-40E")  # the file states the defaults
    assert model.name == f"unit {100 + unit} as declared"
    content = tomllib.loads(path.read_text())
    assert len(model.effects) == len(content["effect"]) == 7
    for item, table in zip(model.effects, content["effect"], strict=True):
        names = [parameter.name for parameter in CATALOGUE[item.key].parameters]
        assert item.values == pytest.approx([float(table[name].removesuffix(" um")) / 1000 for name in names])
        assert item.uncertainty == pytest.approx(0.3e-3)
        assert dict(item.indices) == {k: table[k] for k in table if k in ("crank", "disc", "harmonic")}
    save_model(tmp_path / "m.toml", model)
    assert load_model(tmp_path / "m.toml") == model


@pytest.mark.parametrize(
    ("folder", "ratio", "shafts"),
    [
        ("planetary-14to1", -14.0, {"motor": 14.0}),
        ("worm-225", 225.0, {"worm": 225.0}),
        ("worm-360", 360.0, {"worm": 360.0}),
        ("cycloidal-13to1", -13.0, {"crank": 13.0, "crank_to_disc": 14.0}),
    ],
)
def test_data_models(folder: str, ratio: float, shafts: dict[str, float]) -> None:
    model = load_model(recording(folder, "model.toml"))
    assert model == Model(Drive(ratio=ratio, shafts=shafts), (), folder)
