"""The diagnosis of the shipped example, as files and as text: right, complete, and safe to open.

The truth is the virtual bench's own: it added an encoder eccentricity to a unit that declares none, and noise.
"""

from __future__ import annotations

import functools
import html
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
from hypothesis import given, settings, strategies as st

import rverror
from diagnosed_example import COS, DEMO, SIN, Outcome, outcome, strict_json
from every_kind import DRIVE, ELASTIC, diagnosis
from pages import without_scripts
from rverror import Diagnosis, Effect, Model, diagnose, equilibrium, load_model, load_run, reducer
from rverror.base.units import ARCSEC
from rverror.diagnosis.result import Addition, Candidate, Estimate, Line
from rverror.views.describing import InputFile, input_files
from rverror.views.diagnosis_report import coverage_of
from rverror.views.plots.figure import svg_element, to_bytes
from rverror.views.plots.page_figures import figure_of
from rverror.views.plots.spectra import lines_of
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
    [("as declared", "before"), ("declared sizes refitted", "before_refitted"), ("with what was added", "after")],
)
def test_text_says_the_sizes_of_the_json(result: Outcome, label: str, key: str) -> None:
    wanted = result.json()[key]
    numbers = [wanted["rms_arcsec"], wanted["peak_to_peak_arcsec"], wanted["heldout_rms_arcsec"]]
    assert row(result.out, label) == pytest.approx(numbers, rel=6e-4)


def test_text_says_what_the_json_says(result: Outcome) -> None:
    data, (added,) = result.json(), result.json()["added"]
    assert result.out == to_text(result.diagnosis)
    assert result.out.endswith("\n")
    assert result.out.splitlines()[1].startswith(f"{data['verdict'].capitalize()}: the model lacks {added['key']}")
    assert "rms, arcsec" in result.out
    assert row(result.out, "noise  ") == pytest.approx([data["noise_rms_arcsec"]], rel=6e-4)
    for name, estimate in added["parameters"].items():
        line = next(line for line in result.out.splitlines() if f" {name} " in line and estimate["unit"] in line)
        numbers = [float(word) for word in re.findall(r"-?\d+\.\d+", line)]
        half = (estimate["high"] - estimate["low"]) / 2  # told to two digits of what the interval leaves open
        assert numbers == pytest.approx([estimate["value"], estimate["low"], estimate["high"]], abs=0.1 * half)
    assert "remounted by 90 degrees" in result.out
    for note in data["notes"]:
        assert note in result.out


def test_the_fall_is_credited_to_what_made_it(result: Outcome) -> None:
    """Mean squares of 25, 16 and 1: refitting takes 9 of 24, what was added 15."""
    sizes = {"before": 5.0, "before_refitted": 4.0, "after": 1.0}
    parts = {name: replace(result.diagnosis.after, heldout_rms=size * ARCSEC) for name, size in sizes.items()}
    assert "62 % is due to what was added" in to_text(replace(result.diagnosis, **parts))
    parts["before_refitted"] = parts["before"]
    assert "is due to what was added" not in to_text(replace(result.diagnosis, **parts))


def test_json_is_the_diagnosis_to_six_digits(result: Outcome, monkeypatch: pytest.MonkeyPatch) -> None:
    data, found = result.json(), result.diagnosis
    monkeypatch.chdir(result.folder)
    files = input_files([item["path"] for item in data["files"]])
    assert [item["path"] for item in data["files"]] == ["model.toml", "forward.csv", "reverse.csv"]
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
    assert text.splitlines()[1].startswith("Unexplained: no source of the catalogue accounts for orders 36, 37")
    assert re.search(r"^ +36 +2 +1 to 3", text, re.MULTILINE)
    assert "adding-an-effect" in text
    assert "run in reverse" in text
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
    assert "cannot tell crank.eccentricity (crank 0, disc 0) from crank.eccentricity (crank 1, disc 0)" in text
    assert "a run at a much lighter load" in text  # which crank: only contact at light load breaks the tie
    assert "crank.eccentricity (crank 0, disc 0): a remark." in text
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
    assert text.count("not determined") == 2
    assert "nan" not in text.lower()


def test_nothing_missing_says_so(result: Outcome) -> None:
    none = replace(result.diagnosis, verdict="nothing_missing", added=(), candidates=(), notes=())
    text = to_text(none)
    assert text.splitlines()[1].startswith("Nothing missing: the declared model accounts")
    assert "added" not in text
    assert "Notes" not in text
    assert to_json(none)["added"] == []


# --- stiffness, backlash and contact law; what was set aside ---------------------------------------------------------


def test_text_says_what_the_runs_tell_of_stiffness_and_names_the_rest() -> None:
    lines = to_text(diagnosis()).splitlines()
    at = lines.index("Stiffness, backlash and contact law")
    assert [line.split() for line in lines[at + 2 : at + 6]] == [
        ["name", "declared", "unit", "value", "interval", "determined"],
        ["pin_contact", "250000", "N/mm", "225000", "200000", "to", "250000", "yes"],
        ["crank_bearing", "300000", "N/mm", "310000", "200000", "to", "400000", "no"],
        ["gear_backlash", "20", "um", "31", "29", "to", "33", "yes"],
    ]
    assert "These runs do not determine crank_bearing, flank_exponent." in lines
    whole = to_text(replace(diagnosis(), elastic=tuple(replace(row, determined=True) for row in ELASTIC)))
    assert "do not determine" not in whole
    assert "Stiffness" not in to_text(diagnosis(mechanism=DRIVE))


def test_json_holds_all_of_it_in_the_units_of_people() -> None:
    # as comparing arrays makes it
    elastic = tuple(replace(row, determined=np.bool_(row.determined)) for row in ELASTIC)
    rows = strict_json(json.dumps(to_json(replace(diagnosis(), elastic=elastic))))["stiffness"]
    keys = ("name", "unit", "declared", "value", "low", "high", "determined")
    assert all(tuple(row) == keys for row in rows)
    assert [tuple(row.values()) for row in rows] == [
        ("pin_contact", "N/mm", 2.5e5, 2.25e5, 2e5, 2.5e5, True),
        ("crank_bearing", "N/mm", 3e5, 3.1e5, 2e5, 4e5, False),
        ("gear_backlash", "um", 20.0, 31.0, 29.0, 33.0, True),
        ("pin_exponent", "dimensionless", 1.0, 1.125, None, None, True),
        ("flank_exponent", "dimensionless", 1.0, 1.0, 1.0, 1.25, False),
    ]
    assert to_json(diagnosis(mechanism=DRIVE))["stiffness"] == []


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


@functools.cache
def page_of_the_example(folder: Path) -> str:
    return (folder / "page.html").read_text(encoding="utf-8")


def assert_self_contained(text: str) -> None:
    text = without_scripts(text)
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
    text = page_of_the_example(result.folder)
    assert text.startswith("<!doctype html>")
    assert_self_contained(text)
    page = Page(text)
    assert page.pieces["title"] == f"rverror: {page.pieces['h1']}"
    assert ("charset", "utf-8") in page.attributes
    assert ("content", "width=device-width, initial-scale=1") in page.attributes


def test_the_page_holds_what_the_text_says(result: Outcome) -> None:
    """Every word of the text, and a picture of waveform, residual and spectrum of each run."""
    text = page_of_the_example(result.folder)
    bare = re.sub(r"<svg.*?</svg>|</?strong>", "", text, flags=re.DOTALL)
    words = set(html.unescape(re.sub(r"<[^>]+>", " ", bare)).split())
    assert {word for word in to_text(result.diagnosis).split() if set(word) != {"-"}} <= words
    svgs = re.findall(r"<svg.*?</svg>", text, re.DOTALL)
    assert len(svgs) == 3 * len(result.diagnosis.traces)
    for svg in svgs:
        ET.fromstring(svg)  # well-formed


def test_the_page_has_both_themes_paper_and_phone(result: Outcome) -> None:
    for rule in ("prefers-color-scheme: dark", "@media print", "max-width: 46rem"):
        assert rule in page_of_the_example(result.folder)


def contrast(one: str, other: str) -> float:
    """Contrast ratio of two colours as WCAG defines it."""

    def luminance(colour: str) -> float:
        channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    high, low = sorted((luminance(one), luminance(other)), reverse=True)
    return (high + 0.05) / (low + 0.05)


def test_letters_and_lines_stand_out_in_both_themes(result: Outcome) -> None:
    style = Page(page_of_the_example(result.folder)).pieces["style"]
    themes = [dict(re.findall(r"--(\w+): (#[0-9a-f]{6})", part)) for part in style.split("@media")[:2]]
    assert len(themes) == 2
    for theme in themes:
        for letters in ("ink", "soft"):
            for ground in ("page", "panel"):
                assert contrast(theme[letters], theme[ground]) >= 4.5


def test_the_input_files_are_named_with_their_hashes(result: Outcome, tmp_path: Path) -> None:
    (tmp_path / "abc.csv").write_bytes(b"abc")
    (item,) = input_files([tmp_path / "abc.csv"])
    # FIPS 180-4's own example
    assert item.sha256 == "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"
    assert item.bytes == 3
    bare = replace(result.diagnosis, traces=())
    text, page = to_text(bare, files=[item]), to_html(bare, files=[item])
    for report in (text, page):
        assert item.sha256 in report
        assert f"rverror {rverror.__version__}" in report
    data = to_json(result.diagnosis, files=[item])
    assert data["files"] == [{"path": item.path, "sha256": item.sha256, "bytes": 3}]
    assert data["version"] == rverror.__version__
    with pytest.raises(rverror.InputError, match=r"gone\.csv.*check the path"):
        input_files([tmp_path / "gone.csv"])


def test_over_a_part_of_a_turn_the_orders_are_still_found(result: Outcome) -> None:
    """A line of known size beside a ramp a thousand times larger, over 40 degrees: no bin holds either."""
    theta = np.radians(np.linspace(3, 43, 2000, endpoint=False))
    wave, ramp = 20 * ARCSEC * np.cos(28 * theta + 0.4), 0.1 * theta
    trace = replace(result.diagnosis.traces[0], theta=theta, measured=wave + ramp, before=0 * theta, after=ramp)
    trace = replace(trace, left_out=None)
    drive = Model(rverror.Drive(ratio=14.0, shafts={"motor": 14.0}))
    part = replace(result.diagnosis, traces=(trace,), declared=drive, model=drive, added=())
    before, after = (lines_of(theta, rest) for rest in trace.residual)
    at = np.abs(before.order - 28.0).argmin()
    assert before.size[at] / ARCSEC == pytest.approx(20, rel=0.05)
    assert after.size[at] / ARCSEC == pytest.approx(20, rel=0.05)
    assert before.size.argmax() == at
    assert to_json(part)["variables"]["run_samples_per_turn"]["values"] == [None]  # a drive's mean does not keep it
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
            assert f"over 40 deg {added.effect.key} cannot be distinguished from sensor.drift" in step["why"]
            assert [cause["key"] for cause in step["separates"]] == ["sensor.drift", "sensor.ratio_error"]


def test_declared_sizes_are_listed_with_what_the_fit_made_of_them(result: Outcome) -> None:
    declared = rverror.to_pandas(result.diagnosis, rows="declared", display=True)
    model = load_model(DEMO / "model.toml")
    assert set(declared["unit"]) == {"um"}
    for name, of in (("value", model), ("refitted", result.diagnosis.model)):
        sizes = [value for effect in of.effects[: len(model.effects)] for value in effect.values]
        assert (declared[name] / 1e3).tolist() == pytest.approx(sizes, rel=1e-5)
    sigmas = [effect.uncertainty for effect in model.effects for _ in effect.values]
    assert (declared["sigma"] / 1e3).tolist() == pytest.approx(sigmas, rel=1e-5)


def test_a_torque_ripple_is_not_called_arcsec(result: Outcome) -> None:
    ripple = replace(result.diagnosis, quantity="torque", noise_rms=250.0)
    data = to_json(ripple)
    assert data["noise_rms_newton_metre"] == 0.25
    assert not [key for key in data if "arcsec" in key]
    assert "rms, N*m" in to_text(ripple)
    assert "arcsec" not in to_text(ripple).splitlines()[1]


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


BREAKING = (
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "]]>--></pre></title><b>bold</b><!--",
    "&lt;b&gt; & so on",
)


@pytest.mark.parametrize("name", [*BREAKING, " ".join(BREAKING)])
def test_names_cannot_break_out_of_the_page(result: Outcome, name: str) -> None:
    """Each by itself in the words; in the pictures, which take long, all of them in one name."""
    found = hostile(result.diagnosis, name)
    found = replace(found, traces=() if name in BREAKING else found.traces[:1])
    text = to_html(found, files=[InputFile(name, name, 1)])
    assert_self_contained(text)
    page = Page(text)
    assert "b" not in page.tags
    assert name in page.pieces["td"]
    for svg in re.findall(r"<svg.*?</svg>", text, re.DOTALL):
        ET.fromstring(svg)


@given(name=st.text(min_size=1, max_size=40))
@settings(max_examples=10, deadline=None)
def test_no_name_changes_what_the_page_is_made_of(result: Outcome, name: str) -> None:
    """The same tags and attributes as with a plain name, and no character that is not to be printed."""
    found = replace(result.diagnosis, traces=())  # no picture: matplotlib escapes what it writes
    pages = []
    for word in ("plain", name):
        text = to_html(hostile(found, word), files=[InputFile(word, word, 1)])
        assert all(letter.isprintable() or letter == "\n" for letter in text)
        page = Page(text)
        pages.append((page.tags, [n for n, _ in page.attributes]))
    assert pages[0] == pages[1]
    assert all(letter.isprintable() or letter == "\n" for letter in to_text(hostile(found, name)))


def test_control_characters_are_shown_not_sent_to_the_terminal(result: Outcome) -> None:
    text = to_text(hostile(result.diagnosis, "a\x1b[31m\u202e\r\nNothing missing"))
    assert "\x1b" not in text
    assert r"a\x1b[31m\u202e\r\nNothing missing" in text
    assert text.count("\nNothing missing") == 0


def test_each_verdict_has_its_page(result: Outcome) -> None:
    line = Line(80.0, 2 * ARCSEC, 1.5 * ARCSEC, 2.5 * ARCSEC, ("carrier, disc or crank 40 x 2",))
    bare = replace(result.diagnosis, elastic=(), traces=())
    pages = {
        "Explained": bare,
        "Nothing missing": replace(bare, verdict="nothing_missing", added=()),
        "Unexplained": replace(bare, verdict="unexplained", added=(), unexplained=(line,)),
    }
    common = {"Before and after", "What was declared", "Notes"}
    for strong, found in pages.items():
        text = to_html(found)
        assert f"<strong>{strong}</strong>" in text
        heads = set(re.findall(r"<h2>(.*?)</h2>", text)) - common
        assert heads == ({"Lines that no source of the catalogue explains"} if strong == "Unexplained" else set())
    assert "docs/adding-an-effect.md" in to_text(pages["Unexplained"])


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
    assert to_bytes(figure_of(result.diagnosis), "png") == (result.folder / "picture.png").read_bytes()
    first, second = (svg_element(figure_of(diagnosis())) for _ in range(2))
    assert first == second


def test_a_diagnosis_of_a_drive_is_reported_the_same_way(tmp_path: Path) -> None:
    """A second, small diagnosis: a worm drive whose idler's eccentricity was not declared."""
    drive = rverror.Drive(ratio=-14.0, shafts={"motor": 14.0, "idler": 3.5})
    idler = rverror.effect("shaft.eccentricity", shaft="idler", harmonic=1, cos="12 arcsec", sin="7 arcsec")
    run = rverror.simulate(Model(drive, (idler,)), points=256, revolutions=4)
    rverror.runs.write_run(tmp_path / "run.csv", run)
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
    assert to_text(plain).startswith("Diagnosis: RV-40E\n")


def test_what_to_measure_next_knows_the_zero_of_the_runs(result: Outcome) -> None:
    """Marks that are known or not, and whether forward and reverse share their zero."""

    def bench(*labels: str) -> tuple[bool, bool]:
        traces = tuple(replace(t, index=label) for t, label in zip(result.diagnosis.traces, labels, strict=True))
        found = coverage_of(replace(result.diagnosis, traces=traces))
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
    assert re.search(r"cos +0\.00602  0\.00579 to 0\.00625  arcsec/\(N\*m\)", text)
    assert re.search(r"sin +0 +0 to 0  arcsec/\(N\*m\)", text)
