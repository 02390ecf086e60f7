"""The diagnosis of the shipped example, as files and as text: right, complete, and safe to open.

The truth is the virtual bench's own: it added an encoder eccentricity to a unit that declares none, and noise.
"""

from __future__ import annotations

import contextlib
import functools
import io
import json
import math
import re
from dataclasses import dataclass, replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any, NoReturn
from xml.etree import ElementTree as ET

import numpy as np
import pytest

import rverror
from rverror import Diagnosis, Effect, Model, cli, diagnose, equilibrium, load_model, load_run, reducer
from rverror.diagnose import Candidate, Line
from rverror.plot import diagnosis_figure, svg_element, to_bytes
from rverror.report import to_html, to_json, to_text
from rverror.units import ARCSEC

DEMO = Path(rverror.__file__).parent / "data" / "demo"
COS, SIN = 4.1, -2.7  # arcsec, undeclared
NOISE = 0.4856  # arcsec rms
POINTS, TURNS = 2048, 3
RUNS = (("forward.csv", 1.0), ("reverse.csv", -1.0))


@dataclass(frozen=True)
class Outcome:
    """What one `rverror diagnose` of the shipped example gave."""

    folder: Path
    code: int
    out: str
    err: str
    diagnosis: Diagnosis

    def json(self) -> dict[str, Any]:
        return strict_json((self.folder / "found.json").read_text(encoding="utf-8"))


@functools.cache
def outcome(folder: Path) -> Outcome:
    """Run it, once in a session for all test files: it takes some ten seconds."""
    folder.mkdir()
    for name in ("model.toml", "forward.csv", "reverse.csv"):
        (folder / name).write_bytes((DEMO / name).read_bytes())
    found: list[Diagnosis] = []

    def keep(*args: Any, **keywords: Any) -> Diagnosis:
        found.append(diagnose(*args, **keywords))
        return found[0]

    named = {"--json": "found.json", "--save": "new.toml", "--report": "page.html", "--plot": "picture.png"}
    arguments = ["diagnose", *(str(folder / name) for name in ("model.toml", "forward.csv", "reverse.csv"))]
    for option, name in named.items():
        arguments += [option, str(folder / name)]
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        patch.setattr(cli, "diagnose", keep)
        code = cli.main(arguments)
    return Outcome(folder, code, out.getvalue(), err.getvalue(), found[0])


@pytest.fixture(scope="session")
def result(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    return outcome(tmp_path_factory.getbasetemp() / "diagnosis-of-the-example")


def strict_json(text: str) -> dict[str, Any]:
    """JSON as every program reads it: NaN and Infinity are Python's own."""

    def refuse(word: str) -> NoReturn:
        raise AssertionError(f"{word} is no JSON")

    loaded: dict[str, Any] = json.loads(text, parse_constant=refuse)
    return loaded


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


def test_noise_is_what_differs_between_revolutions(result: Outcome) -> None:
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
    assert row(result.out, "noise between revolutions") == pytest.approx([data["noise_rms_arcsec"]], abs=6e-4)
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
    assert data == strict_json(json.dumps(to_json(found)))
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
    assert "reverse" in text.splitlines()[way_on + 1]
    assert len(data["unexplained_orders"]) == 15
    assert data["unexplained_orders"][0] == {
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
    assert "another load" in text
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
    text = (result.folder / "page.html").read_text(encoding="utf-8")
    assert text.startswith("<!doctype html>")
    assert_self_contained(text)
    page = Page(text)
    assert page.pieces["title"] == page.pieces["h1"] == "rverror: explained"
    assert page.pieces["pre"] == result.out  # the same words as the text report
    assert page.tags.count("svg") == 1
    assert ("charset", "utf-8") in page.attributes


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
    text = to_html(found, [svg_element(diagnosis_figure(found))])
    assert_self_contained(text)
    page = Page(text)
    assert "b" not in page.tags
    assert page.tags.count("svg") == 1
    assert page.pieces["pre"] == to_text(found)
    assert name in page.pieces["pre"]
    svg = text[text.index("<svg") : text.index("</svg>") + 6]
    ET.fromstring(svg)  # well-formed


def test_the_title_is_escaped(result: Outcome) -> None:
    text = to_html(replace(result.diagnosis, verdict="unexplained"), [])
    assert Page(text).pieces["title"] == "rverror: unexplained"
    assert "<figure>" not in text


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
    page = (result.folder / "page.html").read_text(encoding="utf-8")
    assert svg_element(diagnosis_figure(result.diagnosis)).strip() in page
    assert "<metadata" not in page


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


def test_a_declared_model_without_name_is_called_by_its_reducer(result: Outcome) -> None:
    plain = replace(result.diagnosis, declared=Model(reducer("RV-40E")))
    assert "Declared: RV-40E, 0 effects" in to_text(plain)
