"""The command that tells wear: what it prints and writes, and what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import rverror
from rverror.app.command_line import main

DUTY = ["--torque", "412 N*m", "--speed", "1815 rpm", "--hours", "600", "--disc-width", "9 mm", "--gear-width", "8 mm"]
ONE_WAY = ["--direction", "forward"]


@pytest.fixture
def model(tmp_path: Path) -> str:
    path = tmp_path / "unit.toml"
    path.write_text('[reducer]\npreset = "RV-40E"\n', encoding="utf-8")
    return str(path)


def test_what_it_prints_and_writes(model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """One coefficient of all bodies and another of one, in any order; the saved model is the worn one."""
    told, saved, drawn = tmp_path / "wear.json", tmp_path / "worn.toml", tmp_path / "wear.png"
    by = ["--coefficient", "pin=3e-10 mm^3/(N*m)", "--coefficient", "1e-10 mm^3/(N*m)"]
    files = ["--json", str(told), "--save", str(saved), "--plot", str(drawn)]
    assert main(["wear", model, *DUTY, *ONE_WAY, *by, *files]) == 0
    assert "Wear: 412 N*m, 1815 rpm at the input" in capsys.readouterr().out
    found = json.loads(told.read_text(encoding="utf-8"))["variables"]
    assert found["hours"]["values"][-1] == 600
    volume = {body: found[f"{body}_volume"]["values"][-1] for body in ("disc", "pin", "sun", "planet")}
    assert volume["pin"] == pytest.approx(3 * volume["disc"])
    assert volume["sun"] == pytest.approx(volume["planet"])
    assert volume["sun"] > 0
    worn = rverror.load_model(saved)
    lost = rverror.lost_motion(worn, [0.0])[0] / rverror.ARCSEC
    assert lost == pytest.approx(found["lost_motion"]["values"][-1], rel=1e-2)  # of one place, not the mean
    assert drawn.read_bytes().startswith(b"\x89PNG")


def test_phases_running_in_and_joints(model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two equal phases are the one duty; a later word of one body counts before that of all."""
    told = [str(tmp_path / name) for name in ("one.json", "two.json")]
    by = ["--coefficient", "1e-10 mm^3/(N*m)", "--coefficient", "spline=1e-8 um/kN", *ONE_WAY]
    by += ["--running-in", "pin=1 um, 1e-8 mm^3/(N*m)", "--running-in", "0.5 um, 1e-9 mm^3/(N*m)"]
    half = ["--phase", "412 N*m, 1815 rpm, 30 min"]
    assert main(["wear", model, *DUTY, *by, "--json", told[0]]) == 0
    assert main(["wear", model, *half, *half, *DUTY[4:], *by, "--json", told[1]]) == 0
    said = capsys.readouterr().out
    assert "Wear: 412 N*m, 1815 rpm at the input, 0.5 h; 412 N*m" in said
    assert "spline clearance, um" in said
    one, two = (json.loads(Path(name).read_text(encoding="utf-8"))["variables"] for name in told)
    assert one["lost_motion"]["values"] == pytest.approx(two["lost_motion"]["values"])
    assert one["deepest_of_pin"]["values"][-1] > 1
    assert 0.5 < one["deepest_of_lobe"]["values"][-1] < 1
    assert two["duty_hours"]["values"] == [0.5, 0.5]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (
            ["--coefficient", "spline=1e-10 mm^3/(N*m)"],
            "spline: 'mm^3/(N*m)' is no unit of contact compliance; use one like 'um/kN'",
        ),
        (["--coefficient", "1e-10 mm^3/(N*m)", "--running-in", "1 um"], "write it like '0.5 um, 1e-10 mm^3/(N*m)'"),
        (
            ["--coefficient", "1e-10 mm^3/(N*m)", "--phase", "1 N*m, 1 rpm, 1 h"],
            "give --torque and --speed, or --phase",
        ),
        (["--coefficient", "pni=1e-10 mm^3/(N*m)"], "no body 'pni'; did you mean 'pin'?"),
        (["--coefficient", "1e-10"], "--coefficient: disc: '1e-10' has no unit; write it like '1e-10 mm^3/(N*m)'"),
        (["--coefficient", "1e-4 mm^3/(N*m)"], "mm would be worn off"),
    ],
)
def test_what_is_refused(model: str, given: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["wear", model, *DUTY, *ONE_WAY, *given]) == 2
    assert said in capsys.readouterr().err
