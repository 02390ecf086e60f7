"""Pages of a budget and of an allocation: by the command line, the numbers of the JSON, labelled intervals."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import rverror
from pages import without_scripts
from rverror.app.command_line import main
from rverror.app.terminal import ProgressLine
from rverror.base.units import ARCSEC

MODEL = 'name = "joint 3 <b>"\n[reducer]\npreset = "RV-40E"\n'
TOLERANCES = """\
[[tolerance]]
name = "cams & lobes"
key = "crank.eccentricity"
parameters = ["radial"]
tolerance = "+7/-3 um"
cost = { curve = "reciprocal", price = 10.0, at = "5 um" }

[[tolerance]]
key = "cycloid.disc_bore_position"
tolerance = "6 um"
cost = { table = [["3 um", 20.0], ["6 um", 8.0]] }

[[tolerance]]
key = "involute.planet_eccentricity"
tolerance = "6 um"
cost = { curve = "reciprocal", price = 0.001, at = "6 um" }

[[tolerance]]
key = "coupling.carrier_bore_position"
tolerance = "4 um"
fixed = true
"""
FEW = ["--units", "2048"]


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pages")
    (folder / "model.toml").write_text(MODEL, encoding="utf-8")
    (folder / "tolerances.toml").write_text(TOLERANCES, encoding="utf-8")
    inputs = [str(folder / "model.toml"), str(folder / "tolerances.toml")]
    for command, *more in (["budget"], ["allocate", "--kind", "worst"]):
        files = ["--html", str(folder / f"{command}.html"), "--json", str(folder / f"{command}.json")]
        assert main([command, *inputs, *FEW, "--limit", "60 arcsec", *more, *files]) == 0
    return folder


@pytest.mark.parametrize("command", ["budget", "allocate"])
def test_a_page_needs_nothing_else(command: str, written: Path) -> None:
    page = without_scripts((written / f"{command}.html").read_text(encoding="utf-8"))
    data = json.loads((written / f"{command}.json").read_text(encoding="utf-8"))
    assert page.startswith("<!doctype html>")
    assert not re.search(r"<script|<link|<img|src=|@import|url\((?!#)", page)
    assert not [link for link in re.findall(r'href="(.*?)"', page) if not link.startswith("#")]
    assert "<b>" not in page
    assert page.count("<figure>") == (1 if command == "allocate" else 2)
    assert "cams &amp; lobes" in page
    assert [file["sha256"] in page for file in data["inputs"]] == [True, True]


def test_a_budget_page_tells_the_yield_and_what_an_interval_is_of(written: Path) -> None:
    page = (written / "budget.html").read_text(encoding="utf-8")
    data = json.loads((written / "budget.json").read_text(encoding="utf-8"))
    assert set(data["variables"]["width"]["units"]) == {"um"}
    assert "Error budget: joint 3 &lt;b&gt;" in page
    for words in (
        "Yield at 60 arcsec peak-to-peak",
        "of the Monte Carlo estimate, not of the scatter of units",
        "change the offset of the output angle alone, or nothing: coupling.carrier_bore_position",
    ):
        assert words in page
    value = data["yield"]
    assert f"{100 * value['value']:.4g} % ({100 * value['low']:.4g} to {100 * value['high']:.4g})" in page


def test_an_allocation_page_tells_which_limit_binds(written: Path) -> None:
    page = (written / "allocate.html").read_text(encoding="utf-8")
    data = json.loads((written / "allocate.json").read_text(encoding="utf-8"))
    assert data["variables"]["held_by"]["values"] == ["limit", "grade", "lower bound", "fixed"]
    assert data["variables"]["used"]["values"][1] == pytest.approx(1)
    assert data["variables"]["limit"]["values"] == pytest.approx(60)
    assert "least cost for the worst-case peak-to-peak within 60 arcsec" in page
    assert "The limit sets some widths" in page
    for held in ("limit", "grade", "3 um", "lower bound", "fixed"):
        assert f"<td>{held}</td>" in page


def test_bounds_are_told_where_they_bind(written: Path) -> None:
    """A limit that everything meets: the smooth widths stand at their upper bounds, and the text says so."""
    model = rverror.load_model(written / "model.toml")
    tolerances = rverror.load_tolerances(written / "tolerances.toml", model)
    found = rverror.allocate(model, tolerances, limit="2000 arcsec", kind="worst")
    assert found.held_by == ("upper bound", "grade", "upper bound", "fixed")
    assert rverror.to_text(found).count("upper bound") == 2
    assert "Bounds and grades alone set the widths" in rverror.to_html(found)


@pytest.mark.usefixtures("few_angles")
def test_text_and_progress_of_a_budget_at_the_load() -> None:
    model = rverror.Model(rverror.reducer("RV-40E"))
    cams = [rverror.tolerance("crank.eccentricity", "5 um")]
    said: list[str] = []
    options = {"index_count": 64, "torque": "412 N*m", "loaded_count": 16, "progress": said.append}
    found = rverror.error_budget(model, cams, count=512, **options)
    for start in ("closed form", "512 virtual units: 100 %", "Sobol indices: 100 %", "16 units under load: 100 %"):
        assert any(line.startswith(start) for line in said)
    text = rverror.to_text(found, limit=20 * ARCSEC)
    assert "512 virtual units" in text
    assert "Intervals: 95 %, of the Monte Carlo estimate" in text
    page = rverror.to_html(found, limit=20 * ARCSEC)
    assert "transmission error at 412 N*m" in page
    assert "Sobol total, transmission error at 412 N*m" in page


def test_what_does_not_move_has_no_share() -> None:
    bores = [rverror.tolerance("coupling.carrier_bore_position", "4 um")]
    constant = rverror.error_budget(rverror.Model(rverror.reducer("RV-40E")), bores, count=256)
    assert "No tolerance changes more than the offset" in rverror.to_text(constant)


def test_progress_is_one_line_of_a_terminal_else_lines(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a terminal one line, cleared at the end; on a file or pipe a line."""
    clock = [0.0]
    monkeypatch.setattr("rverror.app.terminal.time.monotonic", lambda: clock[0])
    for terminal, expected in (
        (False, "[   3 s] 65536 virtual units: 6 %\n"),
        (True, "\r[   3 s] 65536 virtual units: 6 %"),
    ):
        monkeypatch.setattr("sys.stderr.isatty", lambda terminal=terminal: terminal)
        clock[0] = 0.0
        with ProgressLine() as progress:
            clock[0] = 3.0
            progress("65536 virtual units: 6 %")
        said = capsys.readouterr().err
        assert said.startswith(expected)
        assert ("\n" in said) != terminal


def test_every_step_of_an_allocation_is_told() -> None:
    cams = [rverror.tolerance("crank.eccentricity", "5 um", cost=rverror.tolerances.cost.Reciprocal(1.0, 0.005))]
    said: list[str] = []
    few = {"verify": 1024, "progress": said.append}
    rverror.allocate(rverror.Model(rverror.reducer("RV-40E")), cams, limit="60 arcsec", **few)
    assert "verification 1: 1024 units in closed form: 100 %" in said


def test_tied_tolerances_from_a_table_by_the_command_line(
    written: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Rows tied by a correlation: no Sobol index of theirs anywhere; what contradicts itself is told in one line."""
    head = "name,key,parameter,lower[um],upper[um],pin,correlated_with\n"
    rows = "a,involute.sun_offset,x,-5,5,,\nb,crank.eccentricity,radial,-2,6,,{}\nc,cycloid.pin_radius,,-4,0,all,\n"
    table, out = tmp_path / "drawing.csv", tmp_path / "out.html"
    table.write_text(head + rows.format("c: 0.1"), encoding="utf-8")
    call = ["budget", str(written / "model.toml"), str(table), "--units", "256", "--limit", "40 arcsec"]
    assert main([*call, "--html", str(out), "--plot", str(tmp_path / "out.png")]) == 0
    text = capsys.readouterr().out
    assert "nan" not in text
    assert "sobol" not in text
    page = out.read_text(encoding="utf-8")
    assert ">nan<" not in page
    table.write_text(head + rows.format("a: -0.9; c: 0.9"), encoding="utf-8")
    assert (
        main(call) == 2
    )  # four cams, each 0.9 with two values: 1 - 0.9 sqrt(8) is below 0, and 1 / 2.55 of it would do
    said = capsys.readouterr().err
    assert re.fullmatch(r"rverror: error: .*'a', 'b', 'c' contradict one another.*; give smaller ones\n", said)
