"""The diagnosis of the shipped example, as files and as text: right, complete, and safe to open.

The truth is the virtual bench's own: it added an encoder eccentricity to a unit that declares none, and noise.
"""

from __future__ import annotations

import functools
import json
import math
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rverror
from diagnosed_example import COS, DEMO, SIN, Outcome, outcome, strict_json
from every_kind import DRIVE, ELASTIC, diagnosis
from rverror import Diagnosis, Effect, Model, diagnose, equilibrium, load_model, load_run, reducer
from rverror.base.units import ARCSEC
from rverror.diagnosis.result import Addition, Candidate, Estimate, Line, Trace
from rverror.views.diagnosis_report import bench_of
from rverror.views.envelope import InputFile, input_files
from rverror.views.plots.drawing import diagnosis_figure, svg_element, to_bytes
from rverror.views.report import to_html, to_json, to_text

NOISE = 0.4856  # arcsec rms
POINTS, TURNS = 2048, 3
RUNS = (("forward.csv", 1.0), ("reverse.csv", -1.0))


@pytest.fixture(scope="session")
def result(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    return outcome(tmp_path_factory.getbasetemp() / "diagnosis-of-the-example")


@functools.cache
def bench(name: str) -> tuple[np.ndarray[Any, np.dtype[np.float64]], ...]:
    """Nominal angle of one turn and the error of each turn, arcsec, read without the package."""
    rows = np.loadtxt(DEMO / name, delimiter=",", skiprows=5)
    theta = np.deg2rad(rows[:, 0]) / 121
    error = (np.deg2rad(rows[:, 1]) - theta) / ARCSEC
    order = np.argsort(theta)
    return theta[order][:POINTS], error[order].reshape(TURNS, POINTS)


def left(model: Model, stride: int = 1) -> list[Any]:
    """Residual of each run against the pointwise equilibrium, offset removed, arcsec."""
    rest = []
    for name, direction in RUNS:
        theta, error = bench(name)
        predicted = equilibrium(model, theta[::stride], torque="20 N*m", direction=direction).transmission_error
        difference = error[:, ::stride] - predicted / ARCSEC
        rest.append(difference - difference.mean())
    return rest


def rms(values: list[Any]) -> float:
    return float(np.sqrt(np.mean(np.square(np.array(values)))))


# --- JSON -------------------------------------------------------------------------------------------------------------


def test_it_ends_well_and_writes_only_what_was_asked(result: Outcome) -> None:
    assert result.code == 0
    assert "Traceback" not in result.err
    names = {path.name for path in result.folder.iterdir()}
    assert names == {*("model.toml", "forward.csv", "reverse.csv"),
                     *("found.json", "new.toml", "page.html", "picture.png")}  # fmt: skip
    for name in ("model.toml", "forward.csv", "reverse.csv"):
        assert (result.folder / name).read_bytes() == (DEMO / name).read_bytes()


def test_json_holds_every_key_with_its_type(result: Outcome) -> None:
    data = result.json()
    sizes = {"rms_arcsec": float, "peak_to_peak_arcsec": float, "heldout_rms_arcsec": float}
    tops = {"verdict": str, "noise_rms_arcsec": float, "before": dict, "before_refitted": dict, "after": dict,
            "added": list, "unexplained_orders": list}  # fmt: skip
    assert {key: type(data[key]) for key in tops} == tops
    assert data["verdict"] in ("explained", "nothing_missing", "unexplained")
    for key in ("before", "before_refitted", "after"):
        assert {name: type(value) for name, value in data[key].items()} == sizes
    for added in data["added"]:
        fields = {"key": str, "indices": dict, "parameters": dict, "indistinguishable_from": list, "orders": list,
                  "heldout_rms_arcsec": float}  # fmt: skip
        assert {name: type(added[name]) for name in fields} == fields
        assert added["key"] in rverror.CATALOGUE
        for estimate in added["parameters"].values():
            assert {name: type(value) for name, value in estimate.items()} == {
                "value": float, "unit": str, "low": float, "high": float,
            }  # fmt: skip
            assert estimate["low"] <= estimate["value"] <= estimate["high"]


def test_json_names_the_cause_with_its_size(result: Outcome) -> None:
    data = result.json()
    assert data["verdict"] == "explained"
    assert data["unexplained_orders"] == []
    (added,) = data["added"]
    assert (added["key"], added["indices"], added["orders"]) == ("sensor.encoder_eccentricity", {}, [1.0])
    assert added["indistinguishable_from"] == []
    for name, truth in (("cos", COS), ("sin", SIN)):
        estimate = added["parameters"][name]
        assert estimate["unit"] == "arcsec"
        assert estimate["value"] == pytest.approx(truth, rel=0.02)
        # twice as far as 95 % goes: chance of 1e-4
        assert abs(estimate["value"] - truth) < estimate["high"] - estimate["low"]


def test_the_interval_is_as_wide_as_the_noise_makes_it(result: Outcome) -> None:
    """The amplitude of a line in N samples of noise s has the deviation s sqrt(2 / N) where the noise is white.

    The bench's noise is coloured and declared sizes are free as well, so only the size of the interval is checked.
    """
    (added,) = result.json()["added"]
    white = 1.96 * NOISE * math.sqrt(2 / (2 * TURNS * POINTS))
    for estimate in added["parameters"].values():
        assert white < estimate["high"] - estimate["value"] < 10 * white


def test_noise_is_the_benchs_own(result: Outcome) -> None:
    noise = result.json()["noise_rms_arcsec"]
    assert noise == pytest.approx(NOISE, rel=0.05)
    spread = [error - error.mean(axis=0) for _, error in map(bench, ("forward.csv", "reverse.csv"))]
    assert noise == pytest.approx(rms(spread) * math.sqrt(TURNS / (TURNS - 1)), rel=0.03)


def test_before_is_the_declared_model_as_printed(result: Outcome) -> None:
    data, rest = result.json(), left(load_model(DEMO / "model.toml"))
    assert data["before"]["rms_arcsec"] == pytest.approx(rms(rest), rel=0.005)
    reach = max(r.max() for r in rest) - min(r.min() for r in rest)
    assert data["before"]["peak_to_peak_arcsec"] == pytest.approx(reach, rel=0.01)
    assert 3.7 < data["before"]["heldout_rms_arcsec"] < 3.9


def test_after_is_down_to_the_noise_on_revolutions_left_out(result: Outcome) -> None:
    data = result.json()
    assert data["after"]["heldout_rms_arcsec"] < 0.6
    assert data["after"]["heldout_rms_arcsec"] == data["added"][-1]["heldout_rms_arcsec"]
    assert data["after"]["heldout_rms_arcsec"] >= data["after"]["rms_arcsec"]
    assert data["after"]["rms_arcsec"] == pytest.approx(NOISE, rel=0.05)
    # the fitted model itself, angle by angle in the equilibrium
    fitted = rms(left(result.diagnosis.model, stride=4))
    assert data["after"]["rms_arcsec"] == pytest.approx(fitted, rel=0.02)


def test_refitting_within_the_declared_uncertainty_cannot_explain_it(result: Outcome) -> None:
    data = result.json()
    steps = [data[key]["rms_arcsec"] for key in ("before", "before_refitted", "after")]
    assert steps == sorted(steps, reverse=True)
    assert steps[1] == pytest.approx(math.hypot(math.hypot(COS, SIN) / math.sqrt(2), steps[2]), rel=0.02)


# --- the new model ----------------------------------------------------------------------------------------------------


def test_the_new_model_holds_the_added_effect_and_its_origin(result: Outcome) -> None:
    declared, new = load_model(DEMO / "model.toml"), load_model(result.folder / "new.toml")
    assert new.mechanism == declared.mechanism
    assert [(e.key, dict(e.indices)) for e in new.effects[:-1]] == [(e.key, dict(e.indices)) for e in declared.effects]
    added = new.effects[-1]
    assert added.key == "sensor.encoder_eccentricity"
    assert "rverror" in added.origin
    assert "forward.csv" in added.origin
    assert "reverse.csv" in added.origin
    sizes = result.json()["added"][0]["parameters"]
    assert np.array(added.values) / ARCSEC == pytest.approx([sizes["cos"]["value"], sizes["sin"]["value"]], rel=1e-5)


def test_the_new_model_makes_the_residual_fall(result: Outcome) -> None:
    """Order 1 stands apart from all other orders, so taking it away takes its power away, no less."""
    before = rms(left(load_model(DEMO / "model.toml"), stride=4))
    after = rms(left(load_model(result.folder / "new.toml"), stride=4))
    assert after < before / 2
    assert after < 1.03 * math.sqrt(before**2 - (COS**2 + SIN**2) / 2)


# --- text -------------------------------------------------------------------------------------------------------------


def row(text: str, label: str) -> list[float]:
    line = next(line for line in text.splitlines() if line.startswith(label))
    return [float(word) for word in re.findall(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?", line[len(label) :])]


@pytest.mark.parametrize(
    ("label", "key"),
    [("before (as declared)", "before"), ("before, sizes refitted", "before_refitted"), ("after ", "after")],
)
def test_text_says_the_sizes_of_the_json(result: Outcome, label: str, key: str) -> None:
    wanted = result.json()[key]
    numbers = [wanted["rms_arcsec"], wanted["peak_to_peak_arcsec"], wanted["heldout_rms_arcsec"]]
    assert row(result.out, label) == pytest.approx(numbers, abs=0.006)


def test_text_says_what_the_json_says(result: Outcome) -> None:
    data, (added,) = result.json(), result.json()["added"]
    assert result.out == to_text(result.diagnosis)
    assert result.out.endswith("\n")
    assert result.out.startswith(f"Verdict: {data['verdict']}")
    assert "residual, arcsec" in result.out
    assert row(result.out, "noise ") == pytest.approx([data["noise_rms_arcsec"]], abs=6e-4)
    assert f"Added 1: {added['key']}" in result.out
    for name, estimate in added["parameters"].items():
        numbers = [estimate["value"], 95, estimate["low"], estimate["high"]]
        assert row(result.out, f"  {name}") == pytest.approx(numbers, abs=6e-4)
        line = next(line for line in result.out.splitlines() if line.startswith(f"  {name}"))
        assert estimate["unit"] in line
    assert "remounted by 90 degrees" in result.out
    for note in data["notes"]:
        assert note in result.out


def test_json_is_the_diagnosis_to_six_digits(result: Outcome) -> None:
    data, found = result.json(), result.diagnosis
    files = input_files([item["path"] for item in data["files"]])
    assert [Path(item["path"]).name for item in data["files"]] == ["model.toml", "forward.csv", "reverse.csv"]
    assert data == strict_json(json.dumps(to_json(found, files=files)))
    assert data["noise_rms_arcsec"] * ARCSEC == pytest.approx(found.noise_rms, rel=1e-5)
    for key, residual in (("before", found.before), ("after", found.after)):
        sizes = (residual.rms, residual.peak_to_peak, residual.heldout_rms)
        assert [v * ARCSEC for v in data[key].values()] == pytest.approx(sizes, rel=1e-5)


# --- other outcomes, made from this one -------------------------------------------------------------------------------


def test_lines_that_remain_are_listed_with_a_way_on(result: Outcome) -> None:
    lines = tuple(
        Line(36.0 + i, (2.0 - i / 10) * ARCSEC, 1.0 * ARCSEC, 3.0 * ARCSEC, ("a frame",) if i else ())
        for i in range(15)
    )
    one_way = replace(
        result.diagnosis, verdict="unexplained", added=(), unexplained=lines, traces=result.diagnosis.traces[:1]
    )
    text, data = to_text(one_way), to_json(one_way)
    assert text.startswith("Verdict: unexplained")
    assert re.search(r"^ +36  2\.000 arcsec \[1\.000, 3\.000\]  no frame", text, re.MULTILINE)
    assert "and 3 more" in text
    way_on = next(i for i, line in enumerate(text.splitlines()) if "adding-an-effect" in line)
    assert any("run in reverse" in line for line in text.splitlines()[way_on:])
    assert len(data["unexplained_orders"]) == 15
    first = data["unexplained_orders"][0]
    assert {key: first[key] for key in ("order", "amplitude_arcsec", "low", "high", "frames")} == {
        "order": 36.0, "amplitude_arcsec": 2.0, "low": 1.0, "high": 3.0, "frames": [],
    }  # fmt: skip
    assert data["unexplained_orders"][1]["frames"] == ["a frame"]


def test_what_cannot_be_told_apart_is_named_with_a_test_that_would(result: Outcome) -> None:
    (added,) = result.diagnosis.added
    twin = ("crank.eccentricity", {"crank": 1, "disc": 0})
    effect = Effect("crank.eccentricity", {"crank": 0, "disc": 0}, (0.005, -0.001))
    sizes = tuple(
        replace(e, name=name, dimension="length", value=value, low=value - 1e-3, high=value + 1e-3)
        for e, name, value in zip(added.estimates, ("radial", "tangential"), effect.values, strict=True)
    )
    told = replace(added, effect=effect, estimates=sizes, indistinguishable=(twin,), notes=("a remark",))
    both = replace(result.diagnosis, added=(added, told))
    text, data = to_text(both), to_json(both)
    assert "Added 2: crank.eccentricity (crank 0, disc 0)" in text
    assert "cannot tell it from: crank.eccentricity (crank 1, disc 0)" in text
    assert "a run at a much lighter load" in text  # which crank: only contact at light load breaks the tie
    assert "note: a remark" in text
    assert data["added"][1]["indistinguishable_from"] == [{"key": twin[0], "indices": twin[1]}]
    assert data["added"][1]["parameters"]["radial"] == {"value": 5.0, "unit": "um", "low": 4.0, "high": 6.0}


def test_a_size_that_is_not_determined_is_null_not_nan(result: Outcome) -> None:
    (added,) = result.diagnosis.added
    open_ended = tuple(replace(e, low=math.nan, high=math.nan) for e in added.estimates)
    vague = replace(result.diagnosis, added=(replace(added, estimates=open_ended),),
                    candidates=(Candidate("sensor.encoder_ellipticity", {}, math.inf),))  # fmt: skip
    data = strict_json(json.dumps(to_json(vague)))
    assert data["added"][0]["parameters"]["cos"]["low"] is None
    assert data["added"][0]["parameters"]["sin"]["high"] is None
    text = to_text(vague)
    assert text.count("not determined by these runs") == 2
    assert "nan" not in text.lower()


def test_nothing_missing_says_so(result: Outcome) -> None:
    none = replace(result.diagnosis, verdict="nothing_missing", added=(), candidates=(), notes=())
    text = to_text(none)
    assert text.startswith("Verdict: nothing missing")
    assert "Added" not in text
    assert "Notes" not in text
    assert to_json(none)["added"] == []


# --- stiffness, backlash and contact law; what was set aside ---------------------------------------------------------


def test_text_says_what_the_runs_tell_of_stiffness_and_names_the_rest() -> None:
    lines = to_text(diagnosis()).splitlines()
    at = lines.index("Stiffness, backlash and contact law as the runs tell them")
    assert [line.split() for line in lines[at + 1 : at + 5]] == [
        ["declared", "fitted"],
        ["pin_contact", "250000", "225000", "N/mm", "95", "%", "[200000,", "250000]"],
        ["gear_backlash", "20", "31", "um", "95", "%", "[29,", "33]"],
        ["pin_exponent", "1", "1.125", "not", "determined", "by", "these", "runs"],
    ]
    assert lines[at + 5 : at + 7] == ["  not told by these runs: crank_bearing, flank_exponent", ""]
    whole = to_text(replace(diagnosis(), elastic=tuple(replace(row, told=True) for row in ELASTIC)))
    assert "not told" not in whole
    none = to_text(replace(diagnosis(), elastic=tuple(replace(row, told=False) for row in ELASTIC)))
    assert "not told by these runs: pin_contact, crank_bearing, gear_backlash, pin_exponent, flank_exponent" in none
    assert "declared      fitted" not in none
    assert "Stiffness" not in to_text(diagnosis(mechanism=DRIVE))


def test_json_holds_all_of_it_in_the_units_of_people() -> None:
    told = tuple(replace(row, told=np.bool_(row.told)) for row in ELASTIC)  # as comparing arrays makes it
    rows = strict_json(json.dumps(to_json(replace(diagnosis(), elastic=told))))["stiffness"]
    keys = ("name", "unit", "declared", "value", "low", "high", "told")
    assert all(tuple(row) == keys for row in rows)
    assert [tuple(row.values()) for row in rows] == [
        ("pin_contact", "N/mm", 2.5e5, 2.25e5, 2e5, 2.5e5, True),
        ("crank_bearing", "N/mm", 3e5, 3.1e5, 2e5, 4e5, False),
        ("gear_backlash", "um", 20.0, 31.0, 29.0, 33.0, True),
        ("pin_exponent", "dimensionless", 1.0, 1.125, None, None, True),
        ("flank_exponent", "dimensionless", 1.0, 1.0, 1.0, 1.25, False),
    ]
    assert to_json(diagnosis(mechanism=DRIVE))["stiffness"] == []


def test_the_page_has_the_stiffness_of_the_json() -> None:
    page = to_html(diagnosis())
    table = page.partition("<h2>Stiffness, backlash and contact law as the runs tell them</h2>")[2].partition("<h3>")[0]
    cells = re.findall(r'<data value="([^"]*)">', table)
    assert [float(cell) for cell in cells] == [2.5e5, 2.25e5, 2e5, 2.5e5, 20.0, 31.0, 29.0, 33.0, 1.0, 1.125]
    assert table.count("not determined by these runs") == 1
    assert "dimensionless" not in table
    assert "Not told by these runs: <code>crank_bearing</code>, <code>flank_exponent</code>." in table
    assert "<h2>Stiffness" not in to_html(diagnosis(mechanism=DRIVE))
    assert_self_contained(page)


def test_json_lists_what_was_set_aside_where_something_was() -> None:
    found = diagnosis()
    (row,) = to_json(found)["set_aside"]
    assert row == {
        "run": found.traces[0].name,
        "label": "1 forward",
        "angles_deg": [30.0, 31.0, 750.0],
        "slips_deg": [-90.0, 400.0],
    }
    assert to_json(diagnosis(mechanism=DRIVE))["set_aside"] == []
    far = replace(found.traces[0], set_aside=np.radians([36000.001, 36000.002]), slips=None)
    (row,) = to_json(replace(found, traces=(far,)))["set_aside"]
    assert row["angles_deg"] == [36000.001, 36000.002]
    assert row["slips_deg"] == []


def waveform_pictures(page: str) -> list[ET.Element]:
    return [ET.fromstring(svg) for svg in re.findall(r"<svg role=.*?</svg>", page, re.S) if "over the output" in svg]


def marked(picture: ET.Element, kind: str) -> list[float]:
    """Angles, deg, at which a picture of a run from 0 to 360 deg has marks, each on both panels."""
    paths = [path.get("d", "") for path in picture.iter("path") if path.get("class") == kind]
    assert len(paths) in (0, 2)
    places = [[float(x) for x in re.findall(r"M([\d.]+) ", path)] for path in paths]
    assert places[:1] == places[1:]
    ticks = {item.text: float(item.get("x", "")) for item in picture.iter("text") if item.get("class") == "tick"
             and item.get("text-anchor") == "middle"}  # fmt: skip
    degree = (ticks["90"] - ticks["0"]) / 90
    return [(x - ticks["0"]) / degree for x in places[0]] if places else []


def on_a_turn(**faults: Any) -> Trace:
    theta = np.radians(np.arange(0, 360.0, 0.5))
    wave = ARCSEC * np.cos(3 * theta)
    return Trace("run.csv", 1.0, theta, wave, 0.5 * wave, 0.9 * wave, **faults)


def test_the_pictures_mark_what_was_set_aside_and_slips() -> None:
    trace = on_a_turn(set_aside=np.radians([30.0, 720 + 100]), slips=np.radians([45.0, -80.0]))
    page = to_html(replace(diagnosis(), traces=(trace, on_a_turn())))
    wide, narrow, bare_wide, bare_narrow = waveform_pictures(page)
    assert marked(wide, "aside") == pytest.approx([30, 100], abs=0.3)
    assert marked(wide, "slip") == pytest.approx([45, 280], abs=0.3)
    assert marked(narrow, "aside") == pytest.approx([30], abs=0.3)  # the first 90 degrees are drawn
    assert marked(narrow, "slip") == pytest.approx([45], abs=0.3)
    assert "marked: sample set aside, 2; marked: slip of the reading, 2" in wide.get("aria-label", "")
    assert "marked" not in bare_wide.get("aria-label", "")
    assert not [
        marked(bare, kind) for bare in (bare_wide, bare_narrow) for kind in ("aside", "slip") if marked(bare, kind)
    ]
    keys = re.findall(r'<div class="key">(.*?)</div>', page, re.S)
    assert ["sample set aside" in key and "slip of the reading" in key for key in keys] == [True, False, False, False]


def test_over_a_part_of_a_turn_marks_stay_where_they_are() -> None:
    whole = on_a_turn(set_aside=np.radians([5.0, 50.0, 500.0]))
    part = replace(whole, **{name: getattr(whole, name)[:200] for name in ("theta", "measured", "before", "after")})
    wide, _ = waveform_pictures(to_html(replace(diagnosis(), traces=(part,))))
    assert marked(wide, "aside") == pytest.approx([5, 50], abs=0.3)


def test_marks_that_would_cover_each_other_are_one() -> None:
    crowd = on_a_turn(set_aside=np.linspace(0, 6, 50_000))
    wide, _ = waveform_pictures(to_html(replace(diagnosis(), traces=(crowd,))))
    assert len(marked(wide, "aside")) < 960


# --- the page ---------------------------------------------------------------------------------------------------------


class Page(HTMLParser):
    """Tags, attributes and text of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str]] = []
        self.pieces: dict[str, str] = {}
        self.within = ""
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [(name, value or "") for name, value in attrs]
        self.within = tag

    def handle_endtag(self, tag: str) -> None:
        self.within = ""

    def handle_data(self, data: str) -> None:
        self.pieces[self.within] = self.pieces.get(self.within, "") + data


def assert_self_contained(text: str) -> None:
    page = Page(text)
    assert not {"script", "img", "link", "iframe", "object", "embed", "base"} & set(page.tags)
    for name, value in page.attributes:
        assert not name.startswith("on"), name
        assert name not in ("src", "srcset", "action", "data"), name
        if name in ("href", "xlink:href"):
            assert value.startswith("#")
        if not name.startswith("xmlns"):
            assert "http:" not in value
            assert "https:" not in value
    outside = re.sub(r'xmlns(:\w+)?="[^"]*"', "", text)
    assert "http://" not in outside
    assert "https://" not in outside
    assert not re.search(r"url\((?!#)|@import", outside)


def test_the_page_is_self_contained(result: Outcome) -> None:
    """Of the command line, and the page alone: it needs no namespace either, so it holds no address at all."""
    assert_self_contained((result.folder / "page.html").read_text(encoding="utf-8"))
    text = to_html(result.diagnosis, files=input_files([DEMO / "model.toml"]))
    assert text.startswith("<!doctype html>")
    assert_self_contained(text)
    assert "://" not in text
    page = Page(text)
    assert not {name for name, _ in page.attributes} & {"href", "xlink:href", "style"}
    assert page.pieces["title"] == page.pieces["h1"] == "rverror: explained"
    assert ("charset", "utf-8") in page.attributes
    assert ("content", "default-src 'none'; style-src 'unsafe-inline'") in page.attributes
    assert ("content", "width=device-width, initial-scale=1") in page.attributes


def test_the_page_holds_the_text_report(result: Outcome) -> None:
    assert Page(to_html(result.diagnosis)).pieces["pre"] == to_text(result.diagnosis)


def test_the_page_has_both_themes_paper_and_phone(result: Outcome) -> None:
    text = to_html(result.diagnosis)
    for rule in ("prefers-color-scheme: dark", "@media print", "max-width: 46rem"):
        assert rule in text
    svgs = re.findall(r"<svg role=.*?</svg>", text, re.DOTALL)
    pictures = 2 * (1 + 1) * len(result.diagnosis.traces)  # waveform and spectrum of each run, wide and narrow
    assert len(svgs) == pictures
    widths = [int(re.search(r'viewBox="0 0 (\d+) ', svg)[1]) for svg in svgs]  # type: ignore[index]
    assert sorted(set(widths)) == [400, 960]
    for svg in svgs:
        root = ET.fromstring(svg)  # well-formed
        assert root.get("aria-label")
        assert not [item for item in root.iter() if item.get("fill") or item.get("stroke")]  # the theme colours all


def contrast(one: str, other: str) -> float:
    """Contrast ratio of two colours as WCAG defines it."""

    def luminance(colour: str) -> float:
        channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def test_letters_and_lines_stand_out_in_both_themes(result: Outcome) -> None:
    style = Page(to_html(result.diagnosis)).pieces["style"]
    themes = [dict(re.findall(r"--(\w+): (#[0-9a-f]{6})", part)) for part in style.split("@media")[:2]]
    assert len(themes) == 2
    for theme in themes:
        for letters in ("ink", "soft"):
            for ground in ("page", "panel"):
                assert contrast(theme[letters], theme[ground]) >= 4.5
        for line in ("before", "after"):
            assert contrast(theme[line], theme["page"]) >= 3


def numbers_of(data: Any) -> set[float]:
    if isinstance(data, dict):
        return set().union(*map(numbers_of, data.values())) if data else set()
    if isinstance(data, list):
        return set().union(*map(numbers_of, data)) if data else set()
    return {float(data)} if isinstance(data, int | float) and not isinstance(data, bool) else set()


def test_every_number_of_the_page_is_one_of_the_json(result: Outcome) -> None:
    files = input_files([result.folder / "model.toml"])
    data = to_json(result.diagnosis, files=files)
    cells = re.findall(r'<data value="([^"]*)">([^<]*)</data>', to_html(result.diagnosis, files=files))
    assert len(cells) > 50
    known = numbers_of(data)
    for exact, seen in cells:
        assert float(exact) in known
        assert float(seen) == pytest.approx(float(exact), rel=6e-4)
    shown = {float(exact) for exact, _ in cells}
    for key in ("before", "before_refitted", "after"):
        assert set(data[key].values()) <= shown
    for added in data["added"]:
        assert numbers_of(added["parameters"]) <= shown


def test_the_input_files_are_named_with_their_hashes(result: Outcome, tmp_path: Path) -> None:
    (tmp_path / "abc.csv").write_bytes(b"abc")
    (item,) = input_files([tmp_path / "abc.csv"])
    # FIPS 180-4's own example
    assert item.sha256 == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert item.bytes == 3
    text, page = to_text(result.diagnosis, files=[item]), to_html(result.diagnosis, files=[item])
    for report in (text, page):
        assert item.sha256 in report
        assert f"rverror {rverror.__version__}" in report
    data = to_json(result.diagnosis, files=[item])
    assert data["files"] == [{"path": item.path, "sha256": item.sha256, "bytes": 3}]
    assert data["version"] == rverror.__version__
    with pytest.raises(rverror.InputError, match=r"gone\.csv.*check the path"):
        input_files([tmp_path / "gone.csv"])


def test_orders_before_and_after_are_those_of_the_runs(result: Outcome) -> None:
    """Order 1 against a projection of the bench's own residual, written out."""
    (row,) = [row for row in to_json(result.diagnosis)["by_order"] if row["order"] == 1.0]
    assert row["frames"] == ["output side (encoder, coupling)"]
    rest = left(load_model(DEMO / "model.toml"))
    for at, (name, _) in enumerate(RUNS):
        theta = bench(name)[0]
        size = abs(2 * np.mean(rest[at].mean(axis=0) * np.exp(1j * theta)))
        assert row["runs"][at]["before_arcsec"] == pytest.approx(size, rel=0.01)
        assert row["runs"][at]["after_arcsec"] < 0.1
    sizes = [r["before_arcsec"] for r in row["runs"]]
    assert row["before_arcsec"] == pytest.approx(math.sqrt(np.mean(np.square(sizes))), rel=1e-4)


def test_over_a_part_of_a_turn_the_orders_are_still_found(result: Outcome) -> None:
    """A line of known size beside a ramp a thousand times larger, over 40 degrees: no bin holds either."""
    theta = np.radians(np.linspace(3, 43, 2000, endpoint=False))
    wave, ramp = 20 * ARCSEC * np.cos(28 * theta + 0.4), 0.1 * theta
    trace = replace(result.diagnosis.traces[0], theta=theta, measured=wave + ramp, before=0 * theta, after=ramp)
    trace = replace(trace, left_out=None)
    drive = Model(rverror.Drive(ratio=14.0, shafts={"motor": 14.0}))
    part = replace(result.diagnosis, traces=(trace,), declared=drive, model=drive, added=())
    rows = {row["order"]: row for row in to_json(part)["by_order"]}
    assert rows[28.0]["before_arcsec"] == pytest.approx(20, rel=0.05)
    assert rows[28.0]["after_arcsec"] == pytest.approx(20, rel=0.05)
    assert max(rows, key=lambda order: rows[order]["before_arcsec"]) == 28.0
    assert to_json(part)["runs"][0]["samples_per_turn"] is None  # the mean of a drive's run does not keep it
    assert_self_contained(to_html(part))


def test_over_a_part_of_a_turn_a_whole_one_is_asked_for(result: Outcome) -> None:
    (added,) = result.diagnosis.added
    twins = (("sensor.drift", {}), ("sensor.ratio_error", {}))
    theta = np.radians(np.linspace(3, 43, result.diagnosis.traces[0].theta.size, endpoint=False))
    part, turn = (replace(result.diagnosis.traces[0], theta=angles) for angles in (theta, 9 * theta))
    for traces, wanted in (((part,), True), ((part, turn), False)):
        found = replace(
            result.diagnosis,
            added=(replace(added, indistinguishable=twins),),
            declared=Model(rverror.Drive(ratio=14.0)),
            traces=traces,
        )
        steps = [step for step in to_json(found)["next_measurements"] if step["name"] == "whole turn"]
        assert bool(steps) is wanted
        for step in steps:
            assert f"over 40 deg {added.effect.key} cannot be told from sensor.drift" in step["why"]
            assert [cause["key"] for cause in step["separates"]] == ["sensor.drift", "sensor.ratio_error"]


def test_score_differences_have_the_standard_errors_of_paired_folds(result: Outcome) -> None:
    """By hand: folds 3, 5, 7 add up to 15 with s.e. sqrt(3) 2; to the leader's 10, 4, 7 they lack 7, -1, 0."""

    class Folded(Candidate):
        fold_gains: tuple[float, ...] = ()

    best, second = Folded("crank.index", {"crank": 0}, 21.0), Folded("crank.index", {"crank": 1}, 15.0)
    object.__setattr__(best, "fold_gains", (10.0, 4.0, 7.0))
    object.__setattr__(second, "fold_gains", (3.0, 5.0, 7.0))
    rows = to_json(replace(result.diagnosis, candidates=(best, second)))["candidates"]
    assert rows[1]["standard_error"] == pytest.approx(math.sqrt(3) * 2, rel=5e-3)
    assert rows[1]["behind_best"] == 6.0
    spread = math.sqrt(((7 - 2) ** 2 + (-1 - 2) ** 2 + (0 - 2) ** 2) / 2)
    assert rows[1]["behind_best_standard_error"] == pytest.approx(math.sqrt(3) * spread, rel=5e-3)
    assert rows[0]["behind_best"] == 0.0
    assert rows[0]["behind_best_standard_error"] is None
    for row in to_json(result.diagnosis)["candidates"]:
        assert row["behind_best"] >= 0


def test_declared_sizes_are_listed_with_what_the_fit_made_of_them(result: Outcome) -> None:
    declared = to_json(result.diagnosis)["declared"]
    model = load_model(DEMO / "model.toml")
    assert declared["name"] == model.name
    assert [(e["key"], e["indices"]) for e in declared["effects"]] == [(e.key, dict(e.indices)) for e in model.effects]
    for entry, given_, fitted in zip(declared["effects"], model.effects, result.diagnosis.model.effects, strict=False):
        sizes = list(entry["parameters"].values())
        assert all(size["unit"] == "um" for size in sizes)
        assert [size["value"] / 1e3 for size in sizes] == pytest.approx(given_.values, rel=1e-5)
        assert [size["refitted"] / 1e3 for size in sizes] == pytest.approx(fitted.values, rel=1e-5)
        assert entry["uncertainty"]["value"] / 1e3 == pytest.approx(given_.uncertainty, rel=1e-5)


def test_a_torque_ripple_is_not_called_arcsec(result: Outcome) -> None:
    ripple = replace(result.diagnosis, quantity="torque", noise_rms=250.0)
    data = to_json(ripple)
    assert data["noise_rms_newton_metre"] == 0.25
    assert not [key for key in data if "arcsec" in key]
    assert "residual, N*m" in to_text(ripple)
    assert "arcsec" not in re.sub(r"<tr>.*?</tr>", "", Page(to_html(ripple)).pieces["h1"])


def hostile(found: Diagnosis, name: str) -> Diagnosis:
    """The diagnosis as if its runs, model, notes and added shaft bore that name."""
    traces = tuple(replace(trace, name=name) for trace in found.traces)
    (added,) = found.added
    bad = replace(
        added, effect=replace(added.effect, key=name), notes=(name,), indistinguishable=((name, {"a": name}),)
    )
    line = Line(36.0, ARCSEC, ARCSEC, ARCSEC, (name,))
    return replace(found, traces=traces, added=(bad,), notes=(name,), declared=replace(found.declared, name=name),
                   unexplained=(line,), candidates=(Candidate(name, {}, 1.0),), verdict="unexplained")  # fmt: skip


@pytest.mark.parametrize(
    "name",
    [
        "<script>alert(1)</script>",
        '"><img src=x onerror=alert(1)>',
        "]]>--></pre></title><b>bold</b><!--",
        "&lt;b&gt; & so on",
    ],
)
def test_names_cannot_break_out_of_the_page(result: Outcome, name: str) -> None:
    found = hostile(result.diagnosis, name)
    text = to_html(found, files=[InputFile(name, name, 1)])
    assert_self_contained(text)
    page = Page(text)
    assert "b" not in page.tags or page.tags.count("b") == 4  # those of the tiles
    assert page.pieces["pre"] == to_text(found, files=[InputFile(name, name, 1)])
    assert name in page.pieces["pre"]
    for svg in re.findall(r"<svg.*?</svg>", text, re.DOTALL):
        ET.fromstring(svg)


@given(name=st.text(max_size=40))
@settings(max_examples=10, deadline=None)
def test_no_name_changes_what_the_page_is_made_of(result: Outcome, name: str) -> None:
    """The same tags and attributes as with a plain name, and no character that is not to be printed."""
    small = tuple(
        replace(t, left_out=None, **{key: getattr(t, key)[:64] for key in ("theta", "measured", "before", "after")})
        for t in result.diagnosis.traces
    )
    found = replace(result.diagnosis, traces=small)
    pages = []
    for word in ("plain", name):
        text = to_html(hostile(found, word), files=[InputFile(word, word, 1)])
        assert all(letter.isprintable() or letter == "\n" for letter in text)
        page = Page(text)
        pages.append((page.tags, [n for n, _ in page.attributes]))
    assert pages[0] == pages[1]
    assert all(letter.isprintable() or letter == "\n" for letter in to_text(hostile(found, name)))


def test_control_characters_are_shown_not_sent_to_the_terminal(result: Outcome) -> None:
    text = to_text(hostile(result.diagnosis, "a\x1b[31m\u202e\r\nVerdict: nothing missing"))
    assert "\x1b" not in text
    assert r"a\x1b[31m\u202e\r\nVerdict: nothing missing" in text
    assert text.count("\nVerdict:") == 0


def test_each_verdict_has_its_page(result: Outcome) -> None:
    line = Line(80.0, 2 * ARCSEC, 1.5 * ARCSEC, 2.5 * ARCSEC, ("carrier, disc or crank 40 x 2",))
    bare = replace(result.diagnosis, elastic=())
    pages = {
        "explained": bare,
        "nothing_missing": replace(bare, verdict="nothing_missing", added=()),
        "unexplained": replace(bare, verdict="unexplained", added=(), unexplained=(line,)),
    }
    heads = {}
    for verdict, found in pages.items():
        text = to_html(found)
        heads[verdict] = set(re.findall(r"<h2>(.*?)</h2>", text))
        assert Page(text).pieces["title"] == f"rverror: {verdict.replace('_', ' ')}"
    common = {"Before and after", "Candidates", "What was declared", "Notes", "Inputs and version"}
    assert all(common <= found for found in heads.values())
    assert heads["explained"] - common == {"What was added", "What to measure next"}
    assert heads["nothing_missing"] == common
    assert heads["unexplained"] - common == {"Lines that nothing in the catalogue explains", "What to measure next"}
    assert "docs/adding-an-effect.md" in to_html(pages["unexplained"])


# --- the picture ------------------------------------------------------------------------------------------------------


def test_the_picture_is_a_png_of_a_size_to_look_at(result: Outcome) -> None:
    from matplotlib.image import imread

    raw = (result.folder / "picture.png").read_bytes()
    assert raw[:8] == b"\x89PNG\r\n\x1a\n"
    assert raw[-8:-4] == b"IEND"
    width, height = int.from_bytes(raw[16:20]), int.from_bytes(raw[20:24])
    assert 800 <= width <= 2400
    assert 800 <= height <= 2400
    pixels = imread(result.folder / "picture.png")
    assert pixels.shape[:2] == (height, width)
    dark = (pixels[..., :3].min(axis=-1) < 0.5).mean()
    assert 0.005 < dark < 0.5  # lines on paper: neither blank nor black


def test_pictures_are_the_same_each_time(result: Outcome) -> None:
    assert to_bytes(diagnosis_figure(result.diagnosis), "png") == (result.folder / "picture.png").read_bytes()
    assert svg_element(diagnosis_figure(result.diagnosis)) == svg_element(diagnosis_figure(result.diagnosis))
    assert to_html(result.diagnosis) == to_html(result.diagnosis)


def test_a_diagnosis_of_a_drive_is_reported_the_same_way(tmp_path: Path) -> None:
    """A second, small diagnosis: a worm drive whose idler's eccentricity was not declared."""
    drive = rverror.Drive(ratio=-14.0, shafts={"motor": 14.0, "idler": 3.5})
    idler = rverror.effect("shaft.eccentricity", shaft="idler", harmonic=1, cos="12 arcsec", sin="7 arcsec")
    run = rverror.simulate(Model(drive, (idler,)), points=256, revolutions=4)
    rverror.write_run(tmp_path / "run.csv", run)
    found = diagnose(Model(drive), [load_run(tmp_path / "run.csv")])
    data = to_json(found)
    (added,) = data["added"]
    assert (added["key"], added["indices"]) == ("shaft.eccentricity", {"shaft": "idler", "harmonic": 1})
    assert added["orders"] == [3.5]
    values = [added["parameters"][name]["value"] for name in ("cos", "sin")]
    assert values == pytest.approx([12.0, 7.0], abs=1e-5)
    assert "shaft.eccentricity (shaft idler, harmonic 1)" in to_text(found)
    assert "reverse run" in to_text(found)
    assert_self_contained(to_html(found))


def test_a_declared_model_without_name_is_called_by_its_reducer(result: Outcome) -> None:
    plain = replace(result.diagnosis, declared=Model(reducer("RV-40E")))
    assert "Declared: RV-40E, 0 effects" in to_text(plain)


def test_what_to_measure_next_knows_the_zero_of_the_runs(result: Outcome) -> None:
    """Marks that are known or not, and whether forward and reverse share their zero."""

    def bench(*labels: str) -> tuple[bool, bool]:
        traces = tuple(replace(t, index=label) for t, label in zip(result.diagnosis.traces, labels, strict=True))
        found = bench_of(replace(result.diagnosis, traces=traces))
        return found.marks, found.shared_zero

    assert [t.direction for t in result.diagnosis.traces] == [1.0, -1.0]
    assert bench("", "") == (True, False)
    assert bench("A", "A") == (True, True)
    assert bench("A", "B") == (True, False)
    assert bench("unknown", "unknown") == (False, False)


def test_a_size_far_below_one_of_its_unit_is_told_with_two_digits_of_its_interval() -> None:
    """6.02 arcsec at 1000 N m, told in arcsec/(N m); an interval of no width is told as it is."""
    unit = ARCSEC / 1e6  # rad per N*mm for each arcsec at 1000 N*m
    wave = Effect("load.torsion_wave", {"harmonic": 3}, (6.019 * unit, 0.0))
    sizes = (
        Estimate("cos", "compliance", 6.019 * unit, 5.793 * unit, 6.248 * unit),
        Estimate("sin", "compliance", 0.0, 0.0, 0.0),
    )
    text = rverror.to_text(replace(diagnosis(), added=(Addition(wave, sizes, (), (3.0,), 0.0, ()),)))
    assert "0.00602 arcsec/(N*m) 95 % [0.00579, 0.00625]" in text
    assert "0.000 arcsec/(N*m) 95 % [0.000, 0.000]" in text
