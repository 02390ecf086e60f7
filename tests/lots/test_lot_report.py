"""A lot as text, JSON, page, spreadsheet and tolerance file: nothing lost, everything escaped."""

from __future__ import annotations

import csv
import io
import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rverror
from every_kind import HOSTILE, MODEL, lot
from rverror import to_html, to_json, to_text
from rverror.base.units import ARCSEC
from rverror.lots.as_made import tolerances_as_made
from rverror.lots.result import Interval, Lot, MadeBy, Outsider, Shift
from rverror.views import to_csv
from stack_covariance import of_stack

EMPTY = Lot("unit", 5, ("forward at 20 N*m",), (), (), (), {}, (), (), (), (), 0.5)


def row(told: str, first: str) -> str:
    """Line of a table by how it begins, its gaps one space each."""
    (found,) = [line for line in told.splitlines() if line.startswith(first)]
    return re.sub(" +", " ", found)


def test_the_text_says_who_makes_what() -> None:
    told = to_text(lot())
    assert told.splitlines()[0].endswith(", 40 units")
    assert row(told, "conditions ") == "conditions forward at 20 N*m; reverse at 20 N*m"
    assert "The processes account for the lot (p = 0.25)." in told
    assert re.search(r"^crank.eccentricity +2 +1.6 to 2.6 +um +yes +75 +1.25 +1.125 +30$", told, re.M)
    assert row(told, "crank.index ") == "crank.index 4 3.2 to 5.2 arcsec yes 20 – – 50"
    assert row(told, "cycloid.pin_position radial") == "cycloid.pin_position radial 1 0.8 to 1.3 um no 0 – – –"
    assert "These conditions do not show cycloid.pin_radius" in told
    assert f"crank.eccentricity cannot be distinguished from {HOSTILE}" in told
    assert row(told, "crank.eccentricity (crank 0, disc 1)") == (
        "crank.eccentricity (crank 0, disc 1) tangential 5 4 to 6.5 um"
    )
    assert re.search(r"1e-06 +crank.eccentricity \(crank 1, disc 0\) +radial +20 +16 to 26 +um", told)
    assert re.search(r"step +0.001 +crank.eccentricity +tangential +-7", told)
    assert "For machine" in told
    assert row(told, "reverse at 20 N*m") == "reverse at 20 N*m 32 54 43 to 70 33 55"
    assert "second note" in told


def test_what_was_not_found_is_said_in_one_line() -> None:
    told = to_text(EMPTY)
    assert (
        "Looked for and not found: units that do not belong to the lot, systematic errors, groups that differ, changes "
        "over the serial numbers." in told
    )
    assert "lacks" not in told


def test_a_lot_that_the_model_does_not_describe_is_told_so() -> None:
    told = to_text(replace(EMPTY, chance=1e-5))
    assert "The model lacks something" in told
    assert "<strong>The model lacks something</strong>" in to_html(replace(EMPTY, chance=1e-5))


def test_a_unit_with_a_gross_error_of_several_kinds_has_no_cause_and_they_are_named() -> None:
    unit = Outsider("7", 50.0, 1e-9, (), ("crank.eccentricity (crank 0)", "cycloid.disc_bore_position"))
    one = replace(EMPTY, outsiders=(unit,))
    told = " ".join(to_text(one).split())
    assert f"Unit 7 has a gross error of one of these: {', '.join(unit.rivals)}." in told
    assert "fit as well" not in told
    (data,) = to_json(one)["outliers"]
    assert (data["added"], data["one_of"]) == ([], list(unit.rivals))


def test_the_json_has_an_entry_for_each_process_and_parameter() -> None:
    data = json.loads(json.dumps(to_json(lot()), allow_nan=False))
    first, part, second = data["processes"][:3]
    assert (first["key"], first["parameter"], second["parameter"]) == ("crank.eccentricity", "radial", "tangential")
    assert (first["mean"], first["mean_interval"]) == (3.0, [2.4, 3.9])
    assert (part["indices"], part["mean"], part["sd"]) == ({"crank": 0, "disc": 1}, 5.0, first["sd"])
    assert second["indices"] == {}
    unknown = next(one for one in data["processes"] if one["key"] == "crank.index")
    assert (unknown["mean"], unknown["mean_interval"]) == (None, None)
    assert (first["sd"], first["sd_interval"], first["unit"]) == (2.0, [1.6, 2.6], "um")
    assert (first["share"], first["with"], first["cpk"]) == (0.75, [HOSTILE], 1.125)
    hidden = next(one for one in data["processes"] if one["key"] == "cycloid.pin_radius")
    assert (hidden["sd"], hidden["sd_interval"]) == (None, None)
    assert len(data["processes"]) == 7 + 2
    (added,) = data["outliers"][0]["added"]
    assert added["parameters"]["radial"] == {"value": 20.0, "unit": "um", "low": 16.0, "high": 26.0}
    assert set(added["parameters"]) == {"radial", "tangential"}
    assert added["indistinguishable_from"] == [HOSTILE]
    (group,), (change,) = data["groups"], data["changes"]
    assert (group["label"], group["value"], group["difference"]) == ("machine", HOSTILE, 6.0)
    assert (change["since"], change["difference"], change["interval"]) == (HOSTILE, -7.0, [-8.4, -4.9])
    assert change["since_interval"] == [HOSTILE, HOSTILE]
    assert data["predicted"]["condition"] == "reverse at 20 N*m"
    assert (data["predicted"]["mean_arcsec"], data["predicted"]["p95_arcsec"]) == (32.0, 54.0)
    variables = data["variables"]
    assert variables["condition"]["values"] == list(lot().conditions)
    assert [each[1] for each in variables["measured"]["values"]] == pytest.approx([3.5, 1.5, 2.5])
    assert to_json(EMPTY)["predicted"] is None


def test_two_causes_of_one_source_are_two_entries_of_a_unit() -> None:
    found = lot()
    (one,) = found.outsiders
    twice = replace(
        one, causes=(*one.causes, *(replace(cause, indices={"crank": 0, "disc": 0}) for cause in one.causes))
    )
    added = to_json(replace(found, outsiders=(twice,)))["outliers"][0]["added"]
    assert [entry["indices"] for entry in added] == [{"crank": 1, "disc": 0}, {"crank": 0, "disc": 0}]
    assert all(set(entry["parameters"]) == {"radial", "tangential"} for entry in added)


def test_the_page_has_pictures_and_escapes_every_name() -> None:
    page = to_html(lot())
    assert page.count("<svg") == 2  # processes, shares
    assert "<script" not in page
    assert "<img" not in page
    assert to_html(EMPTY).startswith("<!doctype html>")


def test_the_table_for_spreadsheets_has_a_row_for_each_process() -> None:
    rows = list(csv.DictReader(io.StringIO(to_csv(lot(), rows="process"))))
    assert [one["key"] for one in rows] == [one.key for one in lot().processes]
    assert (rows[0]["deviation"], rows[0]["unit"], rows[0]["above_zero"], rows[0]["cp"]) == ("2", "um", "yes", "1.25")
    assert (rows[-1]["deviation"], rows[-1]["cp"]) == ("", "")
    assert rows[0]["alike"] == HOSTILE


# --- the tolerance file -----------------------------------------------------------------------------------------------


def read_back(result: Lot, tmp_path: Path) -> tuple[rverror.tolerances.Tolerance, ...]:
    path = tmp_path / "made.toml"
    path.write_text(tolerances_as_made(result), encoding="utf-8")
    return rverror.load_tolerances(path, MODEL)


def test_the_file_gives_back_the_standard_deviations(tmp_path: Path) -> None:
    """Of every component of the stack, vectors and scalars."""
    made = [one for one in lot().processes if one.above_zero and one.deviation]
    found = read_back(lot(), tmp_path)
    assert [(one.key, dict(one.indices)) for one in found] == [(one.key, dict(one.indices)) for one in made]
    stacked = rverror.tolerances.stack(MODEL, found, theta=np.linspace(0, 1, 8))
    deviations = np.sqrt(np.diag(of_stack(stacked))) * stacked.width[stacked.entry]
    wanted = [one.deviation.value for one in made if one.deviation]
    np.testing.assert_allclose(deviations, np.array(wanted)[stacked.entry], rtol=1e-3)
    assert found[0].mean == pytest.approx({"radial": 0.003})
    assert {one.distribution.name for one in found} == {"rayleigh", "normal"}


def test_what_is_not_above_zero_stands_in_comments_with_its_bound(tmp_path: Path) -> None:
    text = tolerances_as_made(lot())
    before, bounds = text.split("takes to be usual:\n")
    (tmp_path / "prior.toml").write_text(before + re.sub("^# ?", "", bounds, flags=re.M), encoding="utf-8")
    *_, last = rverror.load_tolerances(tmp_path / "prior.toml", MODEL)
    assert (last.key, last.parameters) == ("cycloid.pin_position", ("radial",))
    assert last.width == pytest.approx(3 * 1.3e-3)


def test_a_size_with_a_least_value_keeps_above_it(tmp_path: Path) -> None:
    size = Interval(1e-3, 0.5e-3, 2e-3)
    one = MadeBy("involute.spline_clearance", {}, ("clearance",), "length", size, True, 1.0)
    some = MadeBy("cycloid.pin_position", {}, ("radial",), "length", size, True, 1.0)
    (clear, radial) = read_back(replace(EMPTY, processes=(one, some)), tmp_path)
    assert clear.mean["clearance"] == pytest.approx(3e-3)
    assert (radial.parameters, radial.width) == (("radial",), pytest.approx(3e-3))


def test_hostile_names_stand_in_comments_alone(tmp_path: Path) -> None:
    wild = 'x"\n[[tolerance]]\nkey = "\x07'
    first = replace(lot().processes[0], tolerance=wild, alike=(wild,))
    assert len(read_back(replace(lot(), model=wild, processes=(first,)), tmp_path)) == 1


def test_of_nothing_above_zero_there_is_no_file() -> None:
    assert tolerances_as_made(EMPTY) == ""


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_not_determined_is_no_number_of_json(value: float) -> None:
    shift: Any = Shift("crank.index", {"crank": 0}, "angle", "angle", Interval(ARCSEC, -value, value))
    data = to_json(replace(EMPTY, shifts=(shift,)))
    assert [data["variables"][f"shift_size_{end}"]["values"] for end in ("low", "high")] == [[None], [None]]
