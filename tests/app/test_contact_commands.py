"""Commands on friction and contact pressure: what they print and write is what the functions give."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rverror
from every_kind import FRICTION
from rverror import ARCSEC, Model, lost_motion
from rverror.app.command_line import main
from rverror.statics import RollerBearing, contact_pressure, efficiency, hysteresis

MODEL = Model(
    replace(rverror.reducer("RV-40E"), friction=FRICTION),
    (rverror.effect("cycloid.pin_position", pin=3, radial="4 um"),),
    "unit 7",
)


@pytest.fixture
def path(tmp_path: Path) -> str:
    rverror.save_model(tmp_path / "m.toml", MODEL)
    return str(tmp_path / "m.toml")


def values(out: Path) -> dict[str, list[float]]:
    return {name: of["values"] for name, of in json.loads(out.read_text())["variables"].items()}


def test_efficiencies_of_a_file(path: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, picture = tmp_path / "e.json", tmp_path / "e.png"
    loads = ["--torque", "3 N*m", "--torque", "100 N*m"]
    assert main(["efficiency", path, *loads, "--count", "5", "--json", str(out), "--plot", str(picture)]) == 0
    told, theta = values(out), 2 * math.pi / 5 * np.arange(5)
    cases = [(3e3, "input"), (100e3, "input"), (100e3, "output")]  # 3 N*m cannot drive against 4 N*m of drag
    found = [efficiency(MODEL, theta, torque=t, direction=1.0, drives=side) for t, side in cases]
    assert told["efficiency"] == pytest.approx([100 * one.mean for one in found])
    assert told["drives"] == [side for _, side in cases]
    for part, share in found[1].by_part.items():
        assert told[f"lost_{part}"][1] == pytest.approx(100 * share)
    assert told["input_torque"] == pytest.approx([one.input_torque.mean() / 1e3 for one in found])
    assert json.loads(out.read_text())["inputs"][0]["path"] == path
    assert picture.read_bytes()[:4] == b"\x89PNG"
    printed = capsys.readouterr()
    assert printed.out.startswith("Efficiencies\n")
    assert "3 N*m: the output drives with more than the drag, 4 N*m; left out" in printed.err


def test_one_efficiency_at_the_rated_torque_both_ways(
    path: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["efficiency", path, "--drives", "output", "--direction", "reverse", "--count", "3"]) == 0
    assert capsys.readouterr().out.startswith("Efficiency: 412 N*m, reverse, the output drives, 3 angles\n")
    out = tmp_path / "e.json"
    ways = ["--drives", "input", "--direction", "both"]
    assert main(["efficiency", path, *ways, "--count", "3", "--json", str(out)]) == 0
    assert values(out)["direction"] == ["forward", "reverse"]


def test_a_duty_and_its_heat(path: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, picture, saved = (tmp_path / name for name in ("d.json", "d.png", "warm.toml"))
    asked = ["--phase", "412 N*m, 1815 rpm, 1 h", "--phase", "0 N*m, 3630 rpm, 120 min", "--count", "5"]
    asked += ["--lubricant", "150 cSt", "15 cSt", "20 degC", "1815 rpm", "--ambient", "15 degC"]
    asked += ["--thermal-resistance", "0.3 K/W", "--inside-resistance", "0.1 K/W"]
    files = ["--json", str(out), "--plot", str(picture), "--save", str(saved)]
    assert main(["efficiency", path, *asked, *files]) == 0
    found = rverror.statics.duty_efficiency(
        MODEL,
        2 * math.pi / 5 * np.arange(5),
        duty=[
            rverror.statics.DutyPhase(torque="412 N*m", speed="1815 rpm", hours=1),
            rverror.statics.DutyPhase(torque=0, speed="3630 rpm", hours=2),
        ],
        direction=1.0,
        lubricant=rverror.statics.Lubricant(
            viscosity_40="150 cSt", viscosity_100="15 cSt", temperature="20 degC", speed="1815 rpm"
        ),
        ambient="15 degC",
        thermal_resistance="0.3 K/W",
        inside_resistance="0.1 K/W",
    )
    told = values(out)
    assert told["mean_efficiency"] == pytest.approx(100 * found.mean)
    assert told["housing"] == pytest.approx(found.housing - 273.15)
    assert told["power_lost"] == pytest.approx([power / 1e3 for power in found.losses.values()])
    assert sum(told["power_lost"]) == pytest.approx(told["power_in"] - told["power_out"], rel=1e-6)
    assert rverror.load_model(saved).effects[-1].values == pytest.approx(found.growth.values, rel=1e-4)
    assert picture.read_bytes()[:4] == b"\x89PNG"
    assert "15 degC" in capsys.readouterr().out


def test_a_loop_of_a_file(path: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, picture = tmp_path / "h.json", tmp_path / "h.png"
    assert main(["hysteresis", path, "--angle", "12 deg", "--json", str(out), "--plot", str(picture)]) == 0
    told = values(out)
    found = hysteresis(MODEL, [math.radians(12)], torques=1e3 * np.array(told["torque"]))
    assert told["torque"][0] == -412
    assert told["torque"][-1] == 412
    assert told["torque"] == sorted(told["torque"])
    np.testing.assert_allclose(told["width"], found.width / ARCSEC)
    size = float(found.lost_motion("12.36 N*m")[0]) / ARCSEC
    widest = int(found.width[:, 0].argmax())
    at = f"{found.width[widest, 0] / ARCSEC:.4g} arcsec at {found.torque[widest] / 1e3:.4g} N*m"
    verdict = f"Lost motion {size:.4g} arcsec at ±3 % of the rated torque; largest width of the loop {at}."
    assert capsys.readouterr().out.splitlines()[1] == verdict
    # without friction the same to some per cent: the loop lies about that curve
    assert size == pytest.approx(lost_motion(MODEL, [math.radians(12)])[0] / ARCSEC, rel=0.02)
    assert picture.stat().st_size > 10_000
    assert main(["hysteresis", path, "--torque", "5 N*m", "--plot", str(picture)]) == 0  # below 3 % of the rated
    assert capsys.readouterr().out.splitlines()[1].startswith("Largest width of the loop ")


def test_pressure_of_a_file(path: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, picture = tmp_path / "p.json", tmp_path / "p.png"
    rollers = ["14", "5 mm", "8 mm", "20 mm"]
    options = ["--disc-width", "9 mm", "--gear-width", "8 mm", "--cam-bearing", *rollers, "--count", "7"]
    both = [*options, "--direction", "reverse", "--torque", "100 N*m", "--json", str(out), "--plot", str(picture)]
    assert main(["pressure", path, *both]) == 0
    found = contact_pressure(
        MODEL,
        2 * math.pi / 7 * np.arange(7),
        torque="100 N*m",
        direction=-1.0,
        disc_width=9.0,
        gear_width=8.0,
        cam_bearing=RollerBearing(rollers=14, roller_diameter=5.0, roller_length=8.0, race_diameter=20.0),
    )
    told = values(out)
    for contact in ("pin", "mesh", "cam"):
        np.testing.assert_allclose(told[f"{contact}_pressure"], found.pressure[contact])
    assert "carrier_pressure" not in told
    assert told["peak_pressure"] == pytest.approx([peak.pressure for peak in found.peaks()])
    assert capsys.readouterr().out.startswith("Contact pressure: 7 angles\n")
    assert main(["pressure", path, *options]) == 0  # at the rated torque, forward
    assert picture.stat().st_size > 10_000


REFUSED = {
    ("efficiency", "--torque", "3"): "--torque: '3' has no unit; write it like '20 N*m'",
    ("efficiency", "--torque", "3 N*m", "--drives", "output"): "m.toml: torque = 3 N*m: the output drives with more",
    ("efficiency", "--phase", "3 N*m, 9 rpm"): "'3 N*m, 9 rpm' is not torque, speed and time; write it like",
    ("efficiency", "--phase", "3 N*m, 9 rpm, 0 h"): "hours = 0: must be above 0; write it like",
    ("efficiency", "--phase", "3 N*m, 9 rpm, 1 h", "--torque", "3 N*m"): "--torque: the phases of a duty have theirs",
    ("efficiency", "--phase", "3 N*m, 9 rpm, 1 h", "--direction", "both"): "a duty cycle has one direction",
    ("efficiency", "--ambient", "20 degC"): "--ambient: for a duty cycle only; give its phases with --phase",
    ("efficiency", "--phase", "3 N*m, 9 rpm, 1 h", "--lubricant", *["9 cSt"] * 2, "20 degC", "9 rpm"): (
        "--lubricant: viscosity_100 = 9 mm^2/s: must be below viscosity_40"
    ),
    ("efficiency", "--count", "0"): "--count: 0 is below 1; give 1 or more",
    ("efficiency", "--plot", "m.toml"): "this output is also an input",
    ("hysteresis", "--torque", "0 N*m"): "--torque: '0 N*m' is not above 0; write it like '412 N*m'",
    ("hysteresis", "--angle", "1 mm"): "--angle: ",
    ("pressure", "--disc-width", "9", "--gear-width", "8 mm"): "--disc-width: '9' has no unit; write it like '9 mm'",
    ("pressure", "--disc-width", "9 mm", "--gear-width", "0 mm"): "m.toml: gear_width = 0 mm: must be above 0",
    ("pressure", "--disc-width", "9 mm", "--gear-width", "8 mm", "--cam-bearing", "x", *["1 mm"] * 3): "'x' rollers",
    ("pressure", "--disc-width", "9 mm", "--gear-width", "8 mm", "--carrier-bearing", "2", *["1 mm"] * 3): (
        "--carrier-bearing: rollers = 2: must be 3 or more"
    ),
}


@pytest.mark.parametrize(
    ("asked", "said"), REFUSED.items(), ids=lambda one: one[0] if isinstance(one, tuple) else one[:40]
)
def test_what_makes_no_sense_is_refused_in_one_line(
    asked: tuple[str, ...], said: str, path: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(Path(path).parent)
    command, *options = asked
    assert main([command, "m.toml", *options]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_models_that_say_too_little_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "m.toml"
    for text, said in (
        ('[reducer]\npreset = "RV-40E"\n', "m.toml: friction: no coefficients are stated; give them in [red"),
        ('[reducer]\npreset = "RV-003"\n[reducer.friction]\npin = 0.1\n', "m.toml: [reducer] has no rated_torque"),
        ("[drive]\nratio = 14.0\n", "m.toml: contacts under load need a [reducer] model"),
    ):
        path.write_text(text)
        for command in ("efficiency", "hysteresis"):
            assert main([command, str(path)]) == 2
            assert said in capsys.readouterr().err


def test_without_matplotlib_nothing_is_computed(
    path: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    assert main(["efficiency", path, "--plot", str(tmp_path / "e.png")]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert "pip install 'rverror[plot]'" in printed.err
