"""The whole budget, its report and plots, and the two commands: the same numbers everywhere, bad input in one line."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rverror
from pages import ROOT
from rverror.app import command_line as cli
from rverror.base.units import ARCSEC
from rverror.views.plots.figure import to_bytes
from rverror.views.plots.page_figures import figure_of

EXAMPLES = ROOT / "examples"
MODEL = '[reducer]\npreset = "RV-40E"\n'
TOLERANCES = """\
[[tolerance]]  # the cams
key = "crank.eccentricity"
tolerance = "5 um"
cost = { curve = "reciprocal", price = 10.0, at = "5 um" }

[[tolerance]]
key = "cycloid.disc_bore_position"
tolerance = "6 um"
cost = { curve = "reciprocal", price = 8.0, at = "6 um" }

[[tolerance]]
key = "coupling.carrier_bore_position"  # constant: the zero of the joint takes it
tolerance = "4 um"
fixed = true
"""
FEW = ["--units", "2048"]


@pytest.fixture
def files(tmp_path: Path) -> tuple[str, str]:
    paths = tmp_path / "model.toml", tmp_path / "tolerances.toml"
    for path, text in zip(paths, (MODEL, TOLERANCES), strict=True):
        path.write_text(text, encoding="utf-8")
    return str(paths[0]), str(paths[1])


@pytest.fixture(scope="module")
def found() -> rverror.tolerances.ErrorBudget:
    model = rverror.Model(rverror.reducer("RV-40E"))
    tolerances = [
        rverror.tolerance("crank.eccentricity", "5 um"),
        rverror.tolerance("coupling.carrier_bore_position", "4 um"),
    ]
    return rverror.error_budget(model, tolerances, count=2048, index_count=1024)


def test_the_parts_of_a_budget_agree_with_each_other(found: rverror.tolerances.ErrorBudget) -> None:
    """Mean square and offset of many units are those of the closed form; no unit is beyond the worst case."""
    assert np.mean(found.units.rms**2) == pytest.approx(found.closed.mean_square, rel=0.02)
    assert found.units.offset.mean() == pytest.approx(found.closed.offset_mean, abs=0.1 * found.closed.offset_deviation)
    assert found.units.offset.std() == pytest.approx(found.closed.offset_deviation, rel=0.02)
    assert found.units.peak_to_peak.max() < found.closed.worst.peak_to_peak
    assert found.units.max.max() < found.closed.worst.maximum
    assert [c.effect for c in found.closed.contributions] == ["wave", "offset"]
    assert found.indices is not None
    assert found.indices.total_low[0] <= 1 <= found.indices.total_high[0]
    assert found.indices.total[1] == 0
    assert found.at_load is None


def test_without_indices_the_rest_is_as_with_them(found: rverror.tolerances.ErrorBudget) -> None:
    asked = [rverror.limit("transmission_error", "30 arcsec", torque="412 N*m")]
    bare = rverror.error_budget(found.model, found.tolerances, count=2048, index_count=0, limits=asked, loaded_count=16)
    assert bare.indices is None
    assert bare.at_load is not None
    assert bare.at_load.shares == (None,)
    assert (bare.units.peak_to_peak == found.units.peak_to_peak).all()
    assert "412 N*m" in rverror.to_text(bare)
    assert "<table" in bare._repr_html_()


@pytest.mark.usefixtures("few_angles")
def test_limits_add_units_at_the_load(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cams keep all loaded pins closed at the rated torque: the linear result stands but for what bearings give way."""
    model = rverror.Model(rverror.reducer("RV-40E"))
    cams = [rverror.tolerance("crank.eccentricity", "5 um"), rverror.tolerance("crank.eccentricity", "2 um", disc=0)]
    limits = [rverror.limit("transmission_error", "20 arcsec"), rverror.limit("lost_motion")]
    monkeypatch.setattr("rverror.tolerances.full_budget.POINTS", 8)
    found = rverror.error_budget(model, cams, count=1024, index_count=256, limits=limits, loaded_count=200)
    assert found.at_load is not None
    error, lost = found.at_load.verified.limits
    low, high = error.quantile(0.5).low, error.quantile(0.5).high
    assert 0.98 * low < found.units.quantile(0.5).value < 1.02 * high
    assert found.at_load.closed_form[0] == found.units.yield_at("20 arcsec").value
    assert error.interval[0] - 0.05 < found.at_load.closed_form[0] < error.interval[1] + 0.05
    assert found.at_load.worst_parts[0] == pytest.approx(found.closed.worst.peak_to_peak, rel=0.1)
    assert found.at_load.shares[0] is not None
    assert found.at_load.shares[0].total[0] > 0.5 > found.at_load.shares[0].total[1]
    assert lost.limit.value is None
    text, content = rverror.to_text(found), rverror.to_json(found)["limits"]
    (row,) = [line for line in text.splitlines() if line.startswith("transmission error at 412 N*m  ")]
    low, high = (100 * end for end in error.interval)
    assert re.search(r" \d+ to \d+ +\d+", row)
    assert low <= 100 * error.share <= high
    assert [one["quantity"] for one in content] == ["transmission_error", "lost_motion"]
    assert [one["torque"] for one in content] == ["412 N*m", "12.36 N*m"]
    assert [one["limit"] for one in content] == ["20 arcsec", None]
    assert content[0]["interval"][0] <= content[0]["yield"] <= content[0]["interval"][1]
    assert (content[0]["units"], content[0]["method"]) == (200, "equilibrium")
    json.dumps(content, allow_nan=False)


def test_a_torque_alone_asks_for_the_distribution_at_that_load() -> None:
    cams = [rverror.tolerance("crank.eccentricity", "5 um")]
    model = rverror.Model(rverror.reducer("RV-40E"))
    found = rverror.error_budget(model, cams, count=256, index_count=0, torque="20 N*m", loaded_count=16)
    assert found.at_load is not None
    assert [one.limit.label for one in found.at_load.verified.limits] == ["transmission error at 20 N*m"]


def test_nothing_that_moves_the_waveform_has_no_indices() -> None:
    model = rverror.Model(rverror.reducer("RV-40E"))
    bores = [rverror.tolerance("coupling.carrier_bore_position", "4 um")]
    found = rverror.error_budget(model, bores, count=256)
    assert found.indices is None
    assert found.units.peak_to_peak.max() < 1e-12
    text = rverror.to_text(found, limit=ARCSEC)
    assert "change the offset of the output angle alone, or nothing: coupling.carrier_bore_position" in text
    assert "Yield at 1 arcsec peak-to-peak: 100 %" in text


def test_text_and_json_tell_the_same(found: rverror.tolerances.ErrorBudget) -> None:
    limit = found.units.quantile(0.9).value
    content = json.loads(json.dumps(rverror.to_json(found, limit=limit), allow_nan=False))
    text, told = rverror.to_text(found, limit=limit), content["variables"]
    assert content["yield"]["value"] == pytest.approx(0.9, abs=1e-3)
    sizes = told["size"]["values"]
    for name in ("p50", "p95", "p99"):
        expected = np.quantile(found.units.peak_to_peak, int(name[1:]) / 100) / ARCSEC
        assert told[f"size_{name}"]["values"][sizes.index("peak-to-peak")] == pytest.approx(expected, rel=1e-5)
    assert f"Yield at {limit / ARCSEC:g} arcsec" in text
    worst = dict(zip(sizes, told["size_worst_case"]["values"], strict=True))
    assert worst["peak-to-peak"] == pytest.approx(found.closed.worst.peak_to_peak / ARCSEC)
    assert worst["rms"] is None
    largest = (found.closed.worst.upper - found.closed.worst.lower).max() / 2  # of TE itself, its offset included
    assert worst["max |TE - offset|"] == pytest.approx(found.closed.worst.maximum / ARCSEC, rel=1e-5)
    assert worst["max |TE - offset|"] < largest / ARCSEC
    assert abs(worst["offset"]) == pytest.approx(
        sum(entry.worst_offset for entry in found.closed.contributions) / ARCSEC, rel=1e-5
    )
    assert sum(told["share"]["values"]) == pytest.approx(100)
    assert (told["tolerance"]["values"][0], told["width"]["values"][0]) == ("crank.eccentricity", 5.0)
    assert told["width"]["units"][0] == "um"
    assert told["worst_offset"]["values"][1] == pytest.approx(4e-3 / 27 / ARCSEC, rel=1e-4)


def test_reverse_is_said_and_computed() -> None:
    model = rverror.Model(rverror.reducer("RV-40E"))
    cams = [rverror.tolerance("crank.bearing_clearance", "2 um", mean="5 um")]
    ways = [rverror.error_budget(model, cams, direction=way, count=256, index_count=64) for way in (1.0, -1.0)]
    offsets = [one.closed.offset_mean for one in ways]
    assert offsets[0] == pytest.approx(-offsets[1])  # the output lags in either direction
    assert "reverse" in rverror.to_text(ways[1])


def test_plots_have_units_on_their_axes(found: rverror.tolerances.ErrorBudget) -> None:
    limit = found.units.quantile(0.9).value
    figure = figure_of(found, limit=limit)
    bars, histogram = figure.axes
    assert bars.get_xlabel().endswith("%")
    assert histogram.get_xlabel().endswith("arcsec")
    assert [tick.get_text() for tick in bars.get_yticklabels()] == ["crank.eccentricity"]  # waves only
    assert len(to_bytes(figure, "png")) > 10_000


def run(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    code = cli.main(arguments)
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_budget_command_writes_what_it_prints(
    files: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, plot = tmp_path / "b.json", tmp_path / "b.png"
    code, text, _ = run(
        ["budget", *files, *FEW, "--limit", "60 arcsec", "--json", str(out), "--plot", str(plot)], capsys
    )
    assert code == 0
    content = json.loads(out.read_text(encoding="utf-8"))
    assert f"Yield at 60 arcsec peak-to-peak: {100 * content['yield']['value']:.4g} %" in text
    assert [len(file["sha256"]) for file in content["inputs"]] == [64, 64]
    assert plot.read_bytes().startswith(b"\x89PNG")


def test_budget_command_in_reverse(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Clearance lags in either direction, so the mean offset changes its sign; the farther worst offset is told."""
    model, tolerances, out = (tmp_path / name for name in ("model.toml", "tolerances.toml", "out.json"))
    model.write_text(MODEL, encoding="utf-8")
    text = '[[tolerance]]\nkey = "coupling.bearing_clearance"\ntolerance = "2 um"\nmean = "5 um"\n'
    tolerances.write_text(text, encoding="utf-8")
    found = []
    for direction in ("forward", "reverse"):
        code, printed, _ = run(
            ["budget", str(model), str(tolerances), *FEW, "--direction", direction, "--json", str(out)], capsys
        )
        assert code == 0
        assert direction in printed
        told = json.loads(out.read_text(encoding="utf-8"))["variables"]
        at = told["size"]["values"].index("offset")
        found.append({name: told[f"size_{name}"]["values"][at] for name in ("nominal", "worst_case")})
    forward, reverse = found
    assert forward["nominal"] == pytest.approx(-38.2, abs=0.01)  # 38.2 arcsec of lag for 5 um
    assert reverse["nominal"] == pytest.approx(38.2, abs=0.01)
    assert forward["worst_case"] == pytest.approx(-38.2 * 7 / 5, abs=0.01)  # 7 um, the farthest from zero
    assert reverse["worst_case"] == pytest.approx(38.2 * 7 / 5, abs=0.01)


def test_allocate_command_saves_a_file_that_meets_the_limit(
    files: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, new = tmp_path / "a.json", tmp_path / "new.toml"
    code, text, _ = run(
        ["allocate", *files, *FEW, "--kind", "worst", "--limit", "60 arcsec", "--json", str(out), "--save", str(new)],
        capsys,
    )
    assert code == 0
    assert "least cost for the worst-case peak-to-peak within 60 arcsec" in text
    content = json.loads(out.read_text(encoding="utf-8"))
    assert content["variables"]["used"]["values"][1] == pytest.approx(1, rel=1e-4)
    saved = rverror.load_tolerances(new)
    assert [item.fixed for item in saved] == [False, False, True]
    assert saved[2].width == 4e-3
    stack = rverror.tolerances.stack(rverror.load_model(files[0]), saved)
    worst = rverror.tolerances.budget(stack).worst.peak_to_peak / ARCSEC
    assert 59.9 < worst <= 60 * (1 + 1e-9)
    assert "# the cams" in new.read_text(encoding="utf-8")


def test_allocate_command_with_a_yield_and_a_front(
    files: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plot = tmp_path / "front.png"
    out = tmp_path / "a.json"
    code, text, _ = run(
        ["allocate", *files, *FEW, "--kind", "yield", "--limit", "60 arcsec", "--yield", "95 %", "--json", str(out)],
        capsys,
    )
    assert code == 0
    content = json.loads(out.read_text(encoding="utf-8"))
    assert content["level"] == 0.95
    assert content["verified"] == []  # the closed form verifies nothing
    assert content["variables"]["closed_form_high"]["values"] <= 60
    assert "P95 of the peak-to-peak" in text
    assert "verified" not in text
    code, *_ = run(["allocate", *files, *FEW, "--kind", "worst", "--limit", "60 arcsec", "--plot", str(plot)], capsys)
    assert code == 0
    assert plot.read_bytes().startswith(b"\x89PNG")


@pytest.mark.usefixtures("few_angles")
def test_allocate_command_verifies_at_the_load(
    files: tuple[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, new, page, plot = (tmp_path / name for name in ("a.json", "new.toml", "a.html", "a.png"))
    told = ["--json", str(out), "--save", str(new), "--html", str(page), "--plot", str(plot)]
    asked = ["--limit", "30 arcsec", "--lost-motion", "30 arcsec", "--torque", "412 N*m", "--yield", "90 %"]
    code, text, _ = run(["allocate", *files, *asked, "--units", "200", *told], capsys)
    assert code == 0
    content = json.loads(out.read_text(encoding="utf-8"))
    error, lost = content["verified"]
    assert (error["quantity"], error["torque"], error["limit"]) == ("transmission_error", "412 N*m", "30 arcsec")
    assert (lost["quantity"], lost["torque"], lost["limit"]) == ("lost_motion", "12.36 N*m", "30 arcsec")
    for one in (error, lost, content["all_limits"]):
        assert 0.9 <= one["interval"][0] <= one["yield"] <= one["interval"][1]
    assert error["method"] == "equilibrium"
    assert error["units"] >= 200  # more where the first verification failed
    assert content["limited"] == "load"
    assert f"Under load: {error['units']} new virtual units" in text
    assert "Closed form, contacts closed" in text
    saved = rverror.load_tolerances(new)
    assert [item.width for item in saved][:2] == pytest.approx(
        [1e-3 * width for width in content["variables"]["width"]["values"]][:2], rel=1e-3
    )
    assert "of the units meet all limits together" in page.read_text(encoding="utf-8")
    assert plot.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["allocate", "{model}", "{tolerances}", "--torque", "20 N*m"], ["--limit '60 arcsec'"]),
        (["allocate", "{model}", "{tolerances}", "--kind", "worst", "--limit", "9 arcsec", "--at", "20 N*m"], ["--at"]),
        (["allocate", "{model}", "{tolerances}", "--limit", "9 arcsec", "--stiffness", "3 arcsec"], ["--stiffness"]),
        (["budget", "{model}", "{tolerances}", "--speed", "600 rpm", "--backlash", "9 arcsec"], ["--backlash"]),
        (["budget", "{model}", "{tolerances}", "--limit", "60"], ["--limit", "no unit", "'60 arcsec'"]),
        (["budget", "{model}", "{tolerances}", "--limit", "-1 arcsec"], ["--limit", "not above 0"]),
        (["budget", "{model}", "{tolerances}", "--torque", "20 mm"], ["--at", "'20 N*m'"]),
        (["budget", "{model}", "{tolerances}", "--units", "0"], ["--units", "1 or more"]),
        (["budget", "{model}", "{tolerances}", "--seed", "-1"], ["--seed", "0 or more"]),
        (["budget", "{model}", "{tolerances}", "--json", "{model}"], ["also an input"]),
        (["budget", "{model}", "none.toml"], ["none.toml"]),
        (["budget", "{model}", "{model}"], ["model.toml", "reducer"]),
        (["allocate", "{model}", "{tolerances}"], ["--limit"]),
        (["allocate", "{model}", "{tolerances}", "--limit", "60 arcsec", "--yield", "much"], ["--yield", "'99 %'"]),
        (["allocate", "{model}", "{tolerances}", "--limit", "60 arcsec", "--yield", "101 %"], ["--yield"]),
        (["allocate", "{model}", "{tolerances}", "--limit", "0.01 arcsec", "--kind", "worst"], ["least", "arcsec"]),
        (["allocate", "{model}", "{tolerances}", "--limit", "9 arcsec", "--json", "x", "--save", "x"], ["two outputs"]),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str],
    words: list[str],
    files: tuple[str, str],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.chdir(tmp_path)
    given: dict[str, Any] = {"model": files[0], "tolerances": files[1]}
    try:
        code = cli.main([word.format(**given) for word in arguments])
    except SystemExit as stop:  # of the parser
        code = stop.code
    error = capsys.readouterr().err
    assert code == 2
    assert len(error.splitlines()) == 1
    for word in words:
        assert word in error


def test_a_tolerance_without_cost_cannot_be_allocated(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, tolerances = tmp_path / "model.toml", tmp_path / "tolerances.toml"
    model.write_text(MODEL, encoding="utf-8")
    tolerances.write_text(TOLERANCES.replace("fixed = true\n", ""), encoding="utf-8")
    code, _, error = run(["allocate", str(model), str(tolerances), "--limit", "60 arcsec"], capsys)
    assert code == 2
    assert "coupling.carrier_bore_position" in error
    assert "cost" in error


def test_what_may_be_bought_is_that_of_the_file(files: tuple[str, str]) -> None:
    choices = [item.choice for item in rverror.load_tolerances(files[1])]
    assert [choice.fixed for choice in choices] == [False, False, True]
    assert choices[2].cost is None


def test_the_shipped_example_is_read_and_budgeted() -> None:
    model = rverror.load_model(EXAMPLES / "rv40e.toml")
    tolerances = rverror.load_tolerances(EXAMPLES / "rv40e-tolerances.toml", model)
    found = rverror.error_budget(model, tolerances, count=256, index_count=64)
    shares = {entry.label: entry.share for entry in found.closed.contributions}
    assert max(shares, key=lambda label: shares[label]) == "crank.eccentricity.radial"


def test_a_drive_has_a_budget_too() -> None:
    drive = rverror.Model(rverror.Drive(ratio=-14.0, shafts={"motor": 14.0}))
    motor = rverror.tolerance("shaft.eccentricity", "60 arcsec", shaft="motor", harmonic=1)
    found = rverror.error_budget(drive, [motor], count=1024, index_count=256)
    assert found.closed.worst.peak_to_peak == pytest.approx(120 * ARCSEC)
    text = rverror.to_text(found)
    assert "1 tolerance, 2 components" in text
    assert "pins" not in text
    with pytest.raises(rverror.InputError, match="no contacts to be loaded"):
        rverror.error_budget(drive, [motor], count=1024, index_count=256, torque="1 N*m")
