"""rverror match: from tables of parts to the list for the assembly shop, and what is refused in one line."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest

import rverror
from rverror.app.command_line import main

SIZES = {
    "sun_teeth": 9, "planet_teeth": 27, "module": "1.5 mm", "pressure_angle": "20 deg", "disc_lobes": 15, "pins": 16,
    "pin_circle_radius": "64 mm", "pin_radius": "5 mm", "eccentricity": "2.4 mm", "cranks": 2, "discs": 2,
}  # fmt: skip
UNIT = rverror.Reducer(**SIZES, name="small unit")
AT = ["--limit", "60 arcsec", "--at", "150 N*m"]


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Three units' cranks and four housings, with a model."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(3)
    cranks = [
        rverror.parts.MeasuredPart("crank", f"C{n}", (rverror.effect("crank.eccentricity", disc=0, radial=x),))
        for n, x in enumerate(rng.normal(0, 4e-3, 6))
    ]
    housings = [
        rverror.parts.MeasuredPart(
            "housing", f"H{n}", (rverror.effect("cycloid.pin_circle", harmonic=2, radial_cos=x),)
        )
        for n, x in enumerate(rng.normal(0, 2e-3, 4))
    ]
    rverror.save_model(Path("unit.toml"), rverror.Model(UNIT))
    rverror.parts.save_parts("cranks.csv", cranks)
    rverror.parts.save_parts("housings.csv", housings)
    return tmp_path


def test_from_tables_to_the_list(folder, capsys):
    words = ["match", "cranks.csv", "housings.csv", "--model", "unit.toml", *AT, "--cost", "matching=2.5"]
    assert main([*words, "--json", "m.json", "--html", "m.html", "--save", "units.csv"]) == 0
    told = capsys.readouterr().out
    assert "3 of 3 possible units meet the limits" in told
    assert "housing, 1 left over" in told
    data = json.loads((folder / "m.json").read_text())
    assert (data["result"], data["possible"], data["bound"]) == ("Matched", 3, 3)
    assert {serial for unit in data["units"] for serial in unit["parts"].values()} >= {f"C{n}" for n in range(6)}
    assert set(data["units"][0]["turns"].values()) == {0}
    assert 0 < data["units"][0]["peak_to_peak_arcsec"] <= 60
    assert len(data["left"]["housing"]) == 1
    assert data["yield"] == 1 >= data["yield_at_random"]
    assert [one["path"] for one in data["inputs"]] == ["cranks.csv", "housings.csv", "unit.toml"]
    assert "matched" in (folder / "m.html").read_text()
    rows = list(csv.DictReader((folder / "units.csv").read_text().splitlines()))
    assert [row["unit"] for row in rows] == ["1", "2", "3"]
    assert {row[name] for row in rows for name in ("crank_0", "crank_1")} == {f"C{n}" for n in range(6)}
    limited = [float(size) for row in rows for name, size in row.items() if name.endswith("[arcsec]")]
    assert len(limited) == 6
    assert max(limited) <= 60


def test_a_unit_of_the_list_is_the_one_that_was_verified(tmp_path, monkeypatch, capsys):
    """Three cranks, discs that can be turned, rollers by groove: the equilibrium of the rebuilt model has its error."""
    monkeypatch.chdir(tmp_path)
    reducer, rng = rverror.Reducer(**{**SIZES, "cranks": 3}), np.random.default_rng(1)

    def drawn(key, size, **at):
        return rverror.Effect(key, at, tuple(rng.normal(0, size, len(rverror.CATALOGUE[key].parameters))), 1e-4)

    def part(kind, number, *errors, made_for=0):
        return rverror.parts.MeasuredPart(kind, f"{kind[0].upper()}{number}", errors, "", made_for)

    parts = [part("crank", n, *(drawn("crank.eccentricity", 3e-3, disc=d) for d in (0, 1))) for n in range(6)]
    for n in range(4):
        bores = (drawn("cycloid.disc_bore_position", 3e-3, crank=c) for c in range(3))
        parts.append(part("disc", n, *bores, drawn("cycloid.disc_pitch", 3e-3, harmonic=1), made_for=n % 2))
    parts += [part("roller", n, drawn("cycloid.pin_radius", 5e-4)) for n in range(32)]
    parts += [part("sun", n, drawn("involute.sun_pitch", 8e-3, harmonic=3)) for n in range(3)]
    rverror.save_model(Path("unit.toml"), rverror.Model(reducer))
    rverror.parts.save_parts("parts.csv", parts)
    assert main(["match", "parts.csv", "--model", "unit.toml", *AT, "--turns", "--save", "units.csv"]) == 0
    rows = list(csv.DictReader(Path("units.csv").read_text().splitlines()))
    for kind in ("disc", "sun"):
        assert any(size != "0" for row in rows for name, size in row.items() if re.match(f"{kind}.*_turn", name))
    theta = 2 * np.pi * np.arange(2000) / 2000
    for row in rows:
        words = ["parts", "parts.csv", "--model", "unit.toml", "--units", "units.csv", "--unit", row["unit"]]
        assert main([*words, "-o", "built.toml"]) == 0
        assert f"disc: {row['disc_0']}, {row['disc_1']}" in capsys.readouterr().err
        built = rverror.load_model("built.toml")
        assert len(built.effects) == 3 * 2 + 2 * 4 + 16 + 1
        assert all(effect.uncertainty == 1e-4 for effect in built.effects)
        told = [float(size) for name, size in row.items() if name.endswith("[arcsec]")]
        for direction, size in zip((1.0, -1.0), told, strict=True):
            state = rverror.equilibrium(built, theta, torque="150 N*m", direction=direction)
            assert np.ptp(state.transmission_error) / rverror.ARCSEC == pytest.approx(size, rel=0.02)
    for wrong in (
        ["--unit", "1"],
        ["--units", "units.csv"],
        ["--unit", "1", "--units", "units.csv", "--place", "disc=D0,D1"],
    ):
        assert main(["parts", "parts.csv", "--model", "unit.toml", *wrong, "-o", "other.toml"]) == 2
        assert "--units ASSEMBLY.csv and --unit N go together" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "line"),
    [
        (["cranks.csv", "housings.csv"], "no limit; give --limit"),
        (["cranks.csv", "cranks.csv", "housings.csv", *AT], "C0"),
        (["housings.csv", *AT], "parts of the kind housing alone"),
        (["nowhere.csv", *AT], "nowhere.csv: there is no such file"),
        (["cranks.csv", "housings.csv", *AT, "--limit", "60 mm"], "--limit: "),
        (["cranks.csv", "housings.csv", "--limit", "60 arcsec"], "at which torque"),
        (["cranks.csv", "housings.csv", *AT, "--cost", "luck=1"], "--cost: 'luck=1'; write each way once"),
        (["cranks.csv", "housings.csv", *AT, "--seed", "-1"], "seed = -1: must be 0 or more"),
        (["cranks.csv", "housings.csv", *AT, "--save", "cranks.csv"], "this output is also an input"),
        (["cranks.csv", "housings.csv", *AT, "--model", "drive.toml"], "drive"),
    ],
)
def test_one_line_and_nothing_written(folder, capsys, words, line):
    Path("drive.toml").write_text('name = "d"\n[drive]\nratio = 50.0\n')
    before = set(folder.iterdir())
    model = [] if "--model" in words else ["--model", "unit.toml"]
    assert main(["match", *words, *model]) == 2
    told = capsys.readouterr().err
    assert line in told
    assert told.count("\n") == 1
    assert set(folder.iterdir()) == before
