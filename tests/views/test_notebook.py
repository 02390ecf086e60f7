"""Notebook pages of every kind of result: its numbers, hostile names as text, no colours of their own."""

from __future__ import annotations

import re
from dataclasses import dataclass, field, replace
from html.parser import HTMLParser
from typing import Any

import numpy as np
import pytest

import rverror
from every_kind import DRIVE, HOSTILE, MODEL, diagnosis, every_kind, run
from rverror.base.units import ARCSEC
from rverror.base.viewed import Viewed
from rverror.diagnosis.result import Diagnosis
from rverror.views.blocks import MOST_ROWS
from rverror.views.notebook import page

PAGES = (
    "Reducer", "Drive", "Effect", "Model", "Run", "OrderTable", "Influence", "Equilibrium", "TorsionCurve",
    "Hysteresis", "Efficiency", "ContactPressure",
    "Wear", "Modes", "SpeedResponse", "RunUp", "Tolerance", "Budget",
    "VirtualUnits", "ErrorBudget", "Allocation", "Compensation", "Lot", "Trend", "RunsCompared", "DriveLot", "Matched",
    "Diagnosis", "Diagnosis, nothing missing",
    "Diagnosis, torque",
)  # fmt: skip
VOID = {"img", "br", "hr", "meta", "link", "input"}


@dataclass
class Read(HTMLParser):
    """A page as a browser reads it: tags that close, cells by table, and all text outside the style."""

    tags: set[str] = field(default_factory=set)
    attributes: set[str] = field(default_factory=set)
    tables: list[list[list[str]]] = field(default_factory=list)
    text: str = ""
    style: str = ""
    _open: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: Any) -> None:
        self.tags.add(tag)
        self.attributes |= {name for name, _ in attrs}
        assert tag not in VOID
        self._open.append(tag)
        if tag == "table":
            self.tables.append([])
        if tag == "tr":
            self.tables[-1].append([])
        if tag in ("td", "th"):
            self.tables[-1][-1].append("")

    def handle_endtag(self, tag: str) -> None:
        assert self._open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self._open[-1:] == ["style"]:
            self.style += data
            return
        self.text += data
        if self._open[-1:] in (["td"], ["th"]):
            self.tables[-1][-1][-1] += data

    def rows(self, first: str) -> list[list[str]]:
        """Rows of the table whose head begins so; a wide one stands in parts, each with the first column."""
        parts = [table[1:] for table in self.tables if table[0][0] == first]
        assert parts
        assert all([row[0] for row in part] == [row[0] for row in parts[0]] for part in parts)
        return [[one[0][0], *(cell for row in one for cell in row[1:])] for one in zip(*parts, strict=True)]

    def fact(self, name: str) -> str:
        """Text beside a name."""
        (found,) = [row[1] for table in self.tables for row in table if row[0] == name]
        return found


def read(thing: Any) -> Read:
    found = Read()
    found.feed(page(thing))
    found.close()
    assert not found._open
    return found


@pytest.mark.parametrize("kind", PAGES)
def test_a_page_is_small_well_formed_and_without_script_or_links(kind: str) -> None:
    thing = every_kind()[kind][0]
    found = read(thing)
    assert found.tags <= {
        "div",
        "style",
        "p",
        "strong",
        "table",
        "thead",
        "tbody",
        "tr",
        "th",
        "td",
        "details",
        "summary",
    }
    assert found.attributes <= {"class", "scope", "tabindex"}
    assert len(page(thing)) < 20_000
    for table in found.tables:
        assert len({len(row) for row in table}) == 1


@pytest.mark.parametrize("kind", PAGES)
def test_colours_and_background_are_the_notebooks(kind: str) -> None:
    style = read(every_kind()[kind][0]).style
    assert not re.search(r"background|(?<![-\w])color\s*:|url|@import", style)
    assert all(".rverror-page" in rule for rule in re.findall(r"[^{}]+(?={)", style))


@pytest.mark.parametrize(
    "kind",
    [
        "Drive",
        "Model",
        "Run",
        "OrderTable",
        "ErrorBudget",
        "Allocation",
        "Compensation",
        "Lot",
        "Trend",
        "RunsCompared",
        "Matched",
        "DriveLot",
        "Diagnosis",
        "Diagnosis, nothing missing",
        "Diagnosis, torque",
    ],
)
def test_a_hostile_name_is_read_as_it_was_written(kind: str) -> None:
    """The tags above tell that it was not read as HTML; here that nothing of it was lost."""
    assert HOSTILE in read(every_kind()[kind][0]).text


def test_every_result_that_can_be_looked_at_has_a_page() -> None:
    for kind in PAGES:
        thing = every_kind()[kind][0]
        assert read(thing).tables
        if isinstance(thing, Viewed):
            assert thing._repr_html_() == page(thing)
    assert set(Viewed.__subclasses__()) <= {type(every_kind()[kind][0]) for kind in PAGES}


# --- numbers ----------------------------------------------------------------------------------------------------------


def test_a_model_in_um_with_its_uncertainty() -> None:
    cam = ["0", "crank.eccentricity", "crank 0, disc 1"]
    rows = read(MODEL).rows("number")
    assert [row[:7] for row in rows[:3]] == [
        [*cam, "radial", "4", "um", "1"],
        [*cam, "tangential", "1", "um", "1"],
        ["1", "cycloid.pin_position", "pin 3", "radial", "-2", "um", "–"],
    ]
    assert rows[4][:7] == ["2", "crank.index", "crank 1", "angle", "3", "arcsec", "–"]
    assert "0 effects" in read(rverror.Model(DRIVE)).text


def test_a_long_table_says_how_much_more_there_is() -> None:
    pins = [rverror.effect("cycloid.pin_radius", pin=pin, deviation="1 um") for pin in range(40)]
    found = read(rverror.Model(MODEL.mechanism, tuple(pins)))
    assert len(found.rows("number")) == MOST_ROWS
    assert f"and {40 - MOST_ROWS} more" in found.text
    few = read(rverror.Model(MODEL.mechanism, tuple(pins[:MOST_ROWS])))
    assert "more" not in few.text


def test_a_run_with_its_conditions() -> None:
    found = read(run())
    assert "512 samples" in found.text
    assert found.fact("direction") == "mixed"
    assert found.fact("torque") == "20 N*m"
    assert found.fact("temperature") == "31.5 degC"
    assert found.fact("zero") == "shared, A"
    assert found.fact("# bench") == HOSTILE
    assert found.fact(f"# {HOSTILE}") == "Ä. Ö."
    angle = np.linspace(0, 6, 32)
    bare = rverror.run_from_arrays(input_angle=angle, output_angle=angle, direction=1.0)
    assert read(bare).fact("zero") == "aligned, offset of its own"
    assert "torque" not in read(bare).text
    unknown = rverror.run_from_arrays(input_angle=angle, output_angle=angle, index="unknown")
    assert read(unknown).fact("zero") == "not known"


@pytest.mark.parametrize("quantity", ["angle", "torque"])
@pytest.mark.parametrize("verdict", ["explained", "nothing_missing", "unexplained"])
def test_a_diagnosis_before_and_after(verdict: str, quantity: str) -> None:
    unit = {"angle": "arcsec", "torque": "N*m"}[quantity]
    found = read(diagnosis(verdict, quantity=quantity, mechanism=DRIVE))
    assert f"{verdict.replace('_', ' ').capitalize()}: " in found.text
    sizes = {row[0]: row[1:] for row in found.rows("stage")}
    assert sizes["as declared"] == ["11", "61", "12"]
    assert sizes["declared sizes refitted"] == ["9", "51", "10"]
    assert sizes["noise"] == ["1.5", "–", "–"]
    assert ("with what was added" in sizes) == (verdict != "nothing_missing")
    if verdict != "nothing_missing":
        assert sizes["with what was added"] == ["2", "13", "3"]
        assert found.rows("effect") == [
            ["sensor.encoder_eccentricity", "cos", "5", "4 to 6", unit],
            ["sensor.encoder_eccentricity", "sin", "-2", "-3 to -1", unit],
        ]
        assert "cannot tell sensor.encoder_eccentricity from sensor.encoder_ellipticity, " + HOSTILE in found.text
    if verdict == "unexplained":
        lines = next(table[1:] for table in found.tables if table[0][:2] == ["order", "amplitude, " + unit])
        assert [row[:3] for row in lines] == [["36", "7", "6 to 8"], ["39.5", "2", "1 to 3"]]
        assert f"{HOSTILE}; input shaft" in lines[1]
    assert "Notes" in found.text
    assert "second note" in found.text


def test_a_size_that_the_runs_do_not_determine() -> None:
    found = read(diagnosis(determined=False))
    assert found.rows("effect")[0][3] == "not determined"


def test_what_the_runs_say_of_stiffness_and_what_they_do_not() -> None:
    found = read(diagnosis())
    rows = next(table[1:] for table in found.tables if table[0][:2] == ["name", "declared"])
    assert [row for row in rows if row[-1] == "yes"] == [
        ["pin_contact", "250000", "N/mm", "225000", "200000 to 250000", "yes"],
        ["gear_backlash", "20", "um", "31", "29 to 33", "yes"],
        ["pin_exponent", "1", "", "1.125", "not determined", "yes"],
    ]
    assert "These runs do not determine crank_bearing, flank_exponent." in found.text
    drive = read(diagnosis(mechanism=DRIVE)).text
    assert "contact law" not in drive
    assert "do not determine" not in drive


def test_a_diagnosis_of_nothing() -> None:
    bare = replace(diagnosis("nothing_missing"), traces=(), notes=(), candidates=(), tried=0)
    assert read(bare).rows("stage")


def test_a_line_beside_a_frame_says_so() -> None:
    """As the report does: order 38 is one carrier turn beside the pins' 39."""
    line = replace(diagnosis("unexplained").unexplained[0], order=38.0)
    one: Diagnosis = replace(diagnosis("unexplained"), unexplained=(line,))
    (row,) = next(table[1:] for table in read(one).tables if table[0][:2] == ["order", "amplitude, arcsec"])
    assert any("below" in cell and "39" in cell for cell in row)


def test_an_equilibrium_in_newtons_and_arcsec() -> None:
    state = every_kind()["Equilibrium"][0]
    found = read(state)
    mean, size = (float(found.fact(what).split()[0]) for what in ("mean", "peak-to-peak"))
    assert mean == pytest.approx(state.transmission_error.mean() / ARCSEC, rel=1e-3)
    assert size == pytest.approx(np.ptp(state.transmission_error) / ARCSEC, rel=1e-3)
    x, y = state.contact_forces["pin"].transpose(2, 0, 1, 3)
    assert float(found.rows("contact")[0][1]) == pytest.approx(np.hypot(x, y).max(), rel=1e-3)
    assert found.rows("disc")[1] == ["1", str(state.loaded_pins[1].min()), str(state.loaded_pins[1].max())]


def test_a_torsion_curve_in_newton_metres() -> None:
    curve = every_kind()["TorsionCurve"][0]
    rows = read(curve).rows("torque, N*m")
    assert [float(row[0]) for row in rows] == [-412, 0, 206]
    assert float(rows[0][1]) == pytest.approx(curve.angle[0].mean() / ARCSEC, rel=1e-3)


def test_a_budget_has_the_largest_share_first() -> None:
    for kind in ("Budget", "ErrorBudget"):
        rows = next(t[1:] for t in read(every_kind()[kind][0]).tables if t[0][:2] == ["tolerance", "width"])
        shares = [float(row[3]) for row in rows]
        assert shares == sorted(shares, reverse=True)
        assert sum(shares) == pytest.approx(100, abs=0.1)
        assert rows[0][:3] == ["crank.eccentricity", "5", "um"]
    found = every_kind()["ErrorBudget"][0].indices
    at = [entry.label for entry in every_kind()["ErrorBudget"][0].closed.contributions].index("crank.eccentricity")
    column = next(t[0] for t in read(every_kind()["ErrorBudget"][0]).tables if t[0][0] == "tolerance").index(
        "Sobol total"
    )
    assert float(rows[0][column]) == pytest.approx(found.total[at], rel=0.02)


def test_sizes_of_virtual_units_with_their_intervals() -> None:
    result = every_kind()["ErrorBudget"][0]
    (row,) = [row for row in read(result).rows("size") if row[0] == "peak-to-peak"]
    p95 = result.units.quantile(0.95)
    assert float(row[1]) == pytest.approx(result.closed.nominal_peak_to_peak / ARCSEC, rel=1e-3)
    assert float(row[5]) == pytest.approx(p95.value / ARCSEC, rel=0.02)  # two digits of the interval
    low, high = map(float, row[6].split(" to "))
    assert (low, high) == pytest.approx((p95.low / ARCSEC, p95.high / ARCSEC), rel=0.02)
    assert float(row[2]) == pytest.approx(result.closed.worst.peak_to_peak / ARCSEC, rel=1e-3)
    few = replace(result.units, **{name: getattr(result.units, name)[:8] for name in ("peak_to_peak", "max", "rms")})
    assert "∞" in read(few).text  # eight units set no upper end


def test_an_allocation_before_and_after() -> None:
    result = every_kind()["Allocation"][0]
    found = read(result)
    costs = [float(row[2]) for row in found.rows("stage")]
    assert costs == pytest.approx([result.cost_before, result.cost], rel=1e-3)
    assert any(HOSTILE in row for row in found.rows("tolerance"))
