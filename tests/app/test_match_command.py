"""rverror match: from tables of parts to the list for the assembly shop, and what is refused in one line."""

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import rverror
from rverror.app.command_line import main

UNIT = rverror.Reducer(
    sun_teeth=9, planet_teeth=27, module="1.5 mm", pressure_angle="20 deg", disc_lobes=15, pins=16,
    pin_circle_radius="64 mm", pin_radius="5 mm", eccentricity="2.4 mm", cranks=2, discs=2, name="small unit",
)  # fmt: skip
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
    assert "3 of 3 units that the parts allow are within the limits" in told
    assert "housing, 1 stay" in told
    data = json.loads((folder / "m.json").read_text())
    assert (data["result"], data["possible"], data["bound"]) == ("Matched", 3, 3)
    assert [one["path"] for one in data["inputs"]] == ["cranks.csv", "housings.csv", "unit.toml"]
    assert "matched" in (folder / "m.html").read_text()
    rows = list(csv.DictReader((folder / "units.csv").read_text().splitlines()))
    assert [row["unit"] for row in rows] == ["1", "2", "3"]
    assert {row[name] for row in rows for name in ("crank_0", "crank_1")} == {f"C{n}" for n in range(6)}
    limited = [float(size) for row in rows for name, size in row.items() if name.endswith("[arcsec]")]
    assert len(limited) == 6
    assert max(limited) <= 60


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
