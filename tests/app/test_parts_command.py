"""The command parts: a draft, a table of parts, a unit of them; exit 2 and one line for what is wrong."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rverror
from rverror.app.command_line import main

CAMS = "crank;cam 0 [um];cam 1 [um]\nC1;1,5;-2\nC2;0,5;1\n"
MAPPING = """
kind = "crank"
serial = "crank"
[[error]]
key = "crank.eccentricity"
disc = 0
radial = { name = "cam 0 [um]", unit = "um", uncertainty = "0.3 um" }
[[error]]
key = "crank.eccentricity"
disc = 1
radial = { name = "cam 1 [um]", unit = "um", uncertainty = "0.3 um" }
"""


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("cams.csv").write_text(CAMS)
    Path("cams.toml").write_text(MAPPING)
    Path("model.toml").write_text('[reducer]\npreset = "RV-40E"  # as ordered\n')
    return tmp_path


def parts(*words: str) -> int:
    return main(["parts", *words, "--model", "model.toml"])


def test_from_a_file_to_a_unit(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert parts("cams.csv", "--mapping", "cams.toml", "-o", "parts.csv") == 0
    assert parts("parts.csv", "--place", "crank=C2,C1", "-o", "unit.toml") == 0
    printed = capsys.readouterr()
    assert "transmission error forward: " in printed.out
    assert "crank: C2, C1" in printed.err
    assert "decimal sign found in the rows: ','" in printed.err
    unit = rverror.load_model("unit.toml")
    assert [(e.indices["crank"], e.indices["disc"], round(e.values[0], 9)) for e in unit.effects] == [
        (0, 0, 5e-4), (0, 1, 1e-3), (1, 0, 1.5e-3), (1, 1, -2e-3),
    ]  # fmt: skip
    assert {e.uncertainty for e in unit.effects} == {3e-4}
    curve = rverror.transmission_error(unit)
    assert f"{np.ptp(curve) / rverror.ARCSEC:.4g} arcsec peak-to-peak" in printed.out
    assert parts("parts.csv", "-o", "unit.toml") == 0
    printed = capsys.readouterr()
    assert "crank: C1, C2, in the order of the files" in printed.err
    assert "replacing unit.toml" in printed.err


def test_a_draft(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert parts("cams.csv", "--draft") == 0
    assert 'name = "cam 1 [um]", unit = "um"' in capsys.readouterr().out
    assert parts("cams.csv", "--draft", "-o", "draft.toml") == 0
    assert 'name = "cam 1 [um]", unit = "um"' in Path("draft.toml").read_text()


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["cams.csv", "-o", "p.csv"], "cams.csv: no table of parts"),
        (["cams.csv", "--mapping", "cams.toml"], "-o : give PARTS.csv"),
        (["cams.csv", "--mapping", "cams.toml", "-o", "p.txt"], "-o p.txt: give PARTS.csv"),
        (["cams.csv", "--mapping", "cams.toml", "-o", "p.csv", "--place", "crank=C1,C2"], "-o p.csv: give"),
        (
            ["cams.csv", "--mapping", "cams.toml", "-o", "u.toml", "--place", "crank"],
            "--place crank: write each kind once",
        ),
        (["cams.csv", "--mapping", "cams.toml", "-o", "cams.csv"], "cams.csv: this output is also an input"),
        (["none.csv", "--mapping", "cams.toml", "-o", "p.csv"], "none.csv: there is no such file"),
        (["cams.csv", "--mapping", "cams.toml", "-o", "u.toml", "--place", "crank=C1,C9"], "'C9' is not among"),
    ],
)
def test_what_is_wrong_is_one_line(
    folder: Path, capsys: pytest.CaptureFixture[str], words: list[str], told: str
) -> None:
    before = sorted(path.name for path in folder.iterdir())
    assert parts(*words) == 2
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1].startswith("rverror: error: ")
    assert told in lines[-1]
    assert sum(line.startswith("rverror: error:") for line in lines) == 1
    assert sorted(path.name for path in folder.iterdir()) == before
