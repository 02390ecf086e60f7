"""Pages of a budget and of an allocation: by the command line, the numbers of the JSON, labelled intervals."""

from __future__ import annotations

import html
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rverror
from rverror.app.command_line import main
from rverror.app.terminal import Progress
from rverror.base.units import ARCSEC
from rverror.views.svg import Bar, bars, histogram

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


def numbers_in(content: Any) -> set[float]:
    """All numbers of a JSON."""
    if isinstance(content, dict):
        return set().union(*map(numbers_in, content.values()), set())
    if isinstance(content, list):
        return set().union(*map(numbers_in, content), set())
    return {float(content)} if isinstance(content, (int, float)) else set()


@pytest.mark.parametrize("command", ["budget", "allocate"])
def test_a_page_needs_nothing_else_and_its_numbers_are_those_of_the_json(command: str, written: Path) -> None:
    page = (written / f"{command}.html").read_text(encoding="utf-8")
    data = json.loads((written / f"{command}.json").read_text(encoding="utf-8"))
    assert page.startswith("<!doctype html>")
    assert not re.search(r"<script|<link|<img|src=|href=|@import|url\(", page)
    assert 'name="viewport"' in page
    assert "prefers-color-scheme: dark" in page
    assert "<b>" not in page.replace("<b><data", "").replace("<b>–", "").replace("<b>none", "").replace("<b>100", "")
    known = numbers_in(data)
    known |= {round(100 * value, 1) for value in known}  # shares in per cent
    known |= {a / b for a in known for b in known if b}  # how many times wider
    for one in data.get("contributions", ()):
        total = one["sobol_total"]
        known |= {float(f"{(total['high'] - total['low']) / 2:.3g}")} if total else set()
    for value, shown in re.findall(r'<data value="([^"]*)">([^<]*)</data>', page):
        assert float(value) in known
        assert float(shown) == pytest.approx(float(value), rel=1e-3)
    for name in ("wide", "narrow"):
        assert page.count(f'<div class="{name}"><svg') == (2 if command == "budget" else 1)
    for width in map(int, re.findall(r'<div class="narrow"><svg[^>]* width="(\d+)"', page)):
        assert width <= 390 - 2 * 16  # what a telephone of 390 px leaves beside the page's margins
    assert "cams &amp; lobes" in page
    assert [file["sha256"] in page for file in data["inputs"]] == [True, True]


def test_a_budget_page_tells_cause_frame_order_and_what_an_interval_is_of(written: Path) -> None:
    page = (written / "budget.html").read_text(encoding="utf-8")
    data = json.loads((written / "budget.json").read_text(encoding="utf-8"))
    cams, _, planets, carrier = data["contributions"]
    assert (cams["frame"], cams["orders"], cams["unit"]) == ("crank", [40], "um")
    assert (cams["lower_limit"], cams["upper_limit"]) == (-3, 7)
    assert (planets["lower_limit"], planets["distribution"]) == (None, "rayleigh")
    # 004's and 000's case: 5 um of one cam make 18.467 arcsec peak-to-peak of order 40
    assert cams["peak_to_peak_per_unit_arcsec"] == pytest.approx(18.467 / 5, rel=3e-3)
    assert carrier["peak_to_peak_per_unit_arcsec"] == 0
    assert "joint 3 &lt;b&gt;; forward; closed form, contacts closed" in page
    assert "-3</data> to <data" in page
    for words in (
        "yield at the limit, 95 % interval of the estimate",
        "95 % interval of the Monte Carlo estimate, of 2048 drawn units",
        "it tells how well the quantile is known, not how far units scatter",
        "limit 60",
        "In closed form moves the offset alone, or nothing: coupling.carrier_bore_position",
    ):
        assert words in page
    assert html.unescape(re.findall(r"<pre>(.*?)</pre>", page, re.DOTALL)[0]).startswith("Error budget of joint 3 <b>")


def test_an_allocation_page_tells_which_limit_binds(written: Path) -> None:
    page = (written / "allocate.html").read_text(encoding="utf-8")
    data = json.loads((written / "allocate.json").read_text(encoding="utf-8"))
    assert [entry["held_by"] for entry in data["entries"]] == ["limit", "grade", "lower bound", "fixed"]
    assert data["value_arcsec"] == pytest.approx(60)
    assert "joint 3 &lt;b&gt;; for worst-case peak-to-peak within 60 arcsec; closed form, contacts closed" in page
    assert "The limit holds some widths" in page
    assert "<td>limit of the error</td>" in page
    assert "<td>fixed</td>" in page
    picture = page.split('<div class="narrow">')[1]
    long = [float(width) for width in re.findall(r'<rect class="(?:before|after)" x="[^>]*width="([\d.]+)"', picture)]
    costs = [[entry["cost_before"], entry["cost"]] for entry in data["entries"]]
    drawn = np.sort(np.array(long)) / max(long)
    np.testing.assert_allclose(drawn, np.sort(np.ravel(costs)) / np.max(costs), atol=0.005)


def test_bounds_are_told_where_they_bind(written: Path) -> None:
    """A limit that everything meets: the smooth widths stand at their upper bounds, and the text says so."""
    model = rverror.load_model(written / "model.toml")
    tolerances = rverror.load_tolerances(written / "tolerances.toml", model)
    given = rverror.stack(model, tolerances)
    found = rverror.allocate(given, limit="2000 arcsec", kind="worst", verify=1000, **rverror.terms(tolerances))
    assert found.held_by == ("upper bound", "grade", "upper bound", "fixed")
    assert rverror.to_text(found).count("upper bound") == 2
    assert "Bounds and grades alone hold the widths" in rverror.to_html(found)


def test_text_and_progress_of_a_budget_at_the_load(written: Path) -> None:
    model = rverror.Model(rverror.reducer("RV-40E"))
    cams = [rverror.tolerance("crank.eccentricity", "5 um")]
    said: list[str] = []
    options = {"index_count": 64, "torque": "412 N*m", "loaded_count": 16, "progress": said.append}
    found = rverror.error_budget(model, cams, count=512, **options)
    for start in ("closed form", "512 virtual units: 100 %", "Sobol indices: 100 %", "16 units at the load: 100 %"):
        assert any(line.startswith(start) for line in said)
    text = rverror.to_text(found, limit=20 * ARCSEC)
    assert "* [..] is the 95 % interval of the Monte Carlo estimate: of 512 drawn units" in text
    assert "+- of a Sobol index: half of the 95 % interval of the Monte Carlo estimate" in text
    page = rverror.to_html(found, limit=20 * ARCSEC)
    assert "At the load, contacts that open included" in page
    assert "transmission error at 412 N*m" in page
    assert "What each tolerance makes at the load" in page


def test_nothing_is_drawn_of_what_does_not_move() -> None:
    bores = [rverror.tolerance("coupling.carrier_bore_position", "4 um")]
    constant = rverror.error_budget(rverror.Model(rverror.reducer("RV-40E")), bores, count=256)
    page = rverror.to_html(constant)
    assert "<figure>" not in page
    assert "No tolerance moves more than the offset" in page


def test_bars_and_histogram_are_to_scale() -> None:
    drawn = bars([("a" * 99, [Bar(look="after", value=20), Bar(look="before", value=10, low=5, high=15)])],
                 width=340, title="t", caption="c")  # fmt: skip
    long, short = (float(width) for width in re.findall(r'rect class="\w+" [^>]*width="([\d.]+)"', drawn))
    assert long == pytest.approx(2 * short, abs=0.2)
    left, right = map(float, re.findall(r'whisker" d="M([\d.]+) [\d.]+H([\d.]+)', drawn)[0])
    assert right - left == pytest.approx(short, abs=0.2)
    assert "…" in drawn
    values = np.repeat([1.0, 2.0, 3.0], [10, 20, 30])
    shown = histogram(values, [("limit", 2.5, "limit 2.5")], width=340, title="t", label="l", caption="c")
    x = float(re.findall(r'class="limit" d="M([\d.]+)', shown)[0])
    inner = 340 - 52 - 16
    assert (x - 52) / inner == pytest.approx((2.5 - 0.96) / (3.04 - 0.96), abs=0.01)
    base = float(re.findall(r'class="area" d="M52 ([\d.]+)', shown)[0])
    tops = sorted({base - float(y) for y in re.findall(r"V([\d.]+)H", shown)})
    assert tops[1:] == pytest.approx([tops[-1] / 3, 2 * tops[-1] / 3, tops[-1]], abs=0.2)


def test_progress_is_for_a_terminal_unless_asked(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The commands of tolerances tell nothing on a file or pipe; on a terminal one line, cleared at the end."""
    clock = [0.0]
    monkeypatch.setattr("rverror.app.terminal.time.monotonic", lambda: clock[0])
    for terminal, expected in ((False, ""), (True, "\r[   3 s] 65536 virtual units: 6 %")):
        monkeypatch.setattr("sys.stderr.isatty", lambda terminal=terminal: terminal)
        clock[0] = 0.0
        progress = Progress(terminal_only=True)
        clock[0] = 3.0
        progress("65536 virtual units: 6 %")
        progress.close()
        said = capsys.readouterr().err
        assert said.startswith(expected)
        assert bool(said) == terminal
        assert "\n" not in said


def test_every_step_of_an_allocation_is_told() -> None:
    cams = [rverror.tolerance("crank.eccentricity", "5 um", cost=rverror.costs.Reciprocal(1.0, 0.005))]
    said: list[str] = []
    few = {"sample": 1024, "verify": 1024, "progress": said.append, **rverror.terms(cams)}
    rverror.allocate(rverror.stack(rverror.Model(rverror.reducer("RV-40E")), cams), limit="60 arcsec", **few)
    assert "least cost within 60 arcsec, solution 1" in said
    assert "checking by 1024 virtual units: 100 %" in said


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
    line = next(line for line in text.splitlines() if line.startswith("b "))
    assert line.split()[-2:] == ["-", "-"]
    page = out.read_text(encoding="utf-8")
    assert ">nan<" not in page
    assert "-2</data> to <data" in page
    table.write_text(head + rows.format("a: -0.9; c: 0.9"), encoding="utf-8")
    assert (
        main(call) == 2
    )  # four cams, each 0.9 with two values: 1 - 0.9 sqrt(8) is below 0, and 1 / 2.55 of it would do
    said = capsys.readouterr().err
    assert re.fullmatch(
        r"rverror: error: .*'a', 'b', 'c' contradict one another.* but 0\.39 times each they can have\n", said
    )
