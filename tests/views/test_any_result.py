"""Every kind of result as text, JSON and page: told in full, escaped, and refused in one line where there is none."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from typing import Any

import pytest

import rverror
from every_kind import HOSTILE, KINDS, MODEL, every_kind
from pages import without_scripts
from rverror import InputError, to_html, to_json, to_text
from rverror.base.units import ARCSEC


def test_these_are_all_kinds() -> None:
    assert set(KINDS) == set(every_kind())


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_a_text(kind: str) -> None:
    told = to_text(every_kind()[kind][0])
    assert told.endswith("\n")
    assert len(told.splitlines()) >= 3
    assert all(line.isprintable() for line in told.splitlines())
    assert not re.search(r"\bnan\b|\[nan", told)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_plain_data_in_one_envelope(kind: str) -> None:
    thing = every_kind()[kind][0]
    data = json.loads(json.dumps(to_json(thing), allow_nan=False))
    assert data["version"] == rverror.__version__
    names = {"Effects", "Tolerances", "Front", "Efficiencies"} & {kind} or {type(thing).__name__}
    assert {data["result"]} == names


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_has_a_page_that_needs_nothing_else(kind: str) -> None:
    page = to_html(every_kind()[kind][0])
    assert page.startswith("<!doctype html>")
    assert page.rstrip().endswith("</html>")
    page = without_scripts(page)
    assert "<script" not in page
    assert "<img" not in page


def test_what_a_table_holds_is_told_in_the_units_of_people() -> None:
    variables = to_json(MODEL)["variables"]
    at = variables["parameter"]["values"].index("radial")
    assert variables["value"]["values"][at] == 4.0
    assert variables["value"]["units"][at] == "um"
    assert variables["uncertainty"]["values"][-1] is None
    curve = to_json(every_kind()["Efficiency"][0])["variables"]
    assert curve["torque"] == {"dimensions": [], "units": "N*m", "values": 412.0}


def test_an_order_table_has_a_row_for_each_wave() -> None:
    told = to_text(every_kind()["OrderTable"][0])
    assert told.startswith("Order table: 3 conditions\n")
    assert re.search(r"^zero +shared, A$", told, re.M)
    assert "temperature, degC  torque, N*m  order  amplitude, arcsec  phase, deg" in told
    assert re.search(r"^ +1 +reverse +95\.49 +31\.5 +20 +39 +1\.5 +0 +1\.5 +0 +0\.1$", told, re.M)


def test_a_model_tells_what_hangs_on_its_ends() -> None:
    told = to_text(
        rverror.Model(MODEL.mechanism, bench=rverror.model.Bench(load_inertia="5 kg*m^2", damping_ratio=0.02))
    )
    assert re.search(r"^bench: load inertia +5 kg\*m\^2$", told, re.M)
    assert re.search(r"^bench: damping ratio +0.02$", told, re.M)
    assert "bench" not in to_text(MODEL).replace(HOSTILE, "")


def test_an_efficiency_is_told_with_what_takes_it() -> None:
    found = every_kind()["Efficiency"][0]
    told = to_text(found)
    assert told.startswith("Efficiency: 412 N*m, forward, the input drives, 6 angles\n")
    assert re.search(rf"^mean efficiency +{100 * found.mean:.4g} %$", told, re.M)
    assert re.search(rf"^mean input torque +{found.input_torque.mean() / 1e3:.4g} N\*m$", told, re.M)
    for part, share in found.by_part.items():
        lost = found.losses[part].mean() / 1e3
        assert re.search(rf"^{part.replace('_', ' ')} +{round(100 * share, 2):.4g} +{lost:.4g}$", told, re.M), part
    assert "self-locking" not in told
    stuck = replace(found, drives="output", input_torque=-found.input_torque)
    assert "self-locking: at some angle the output cannot drive it" in to_text(stuck)


def test_a_loop_and_contact_pressures_are_told() -> None:
    loop = every_kind()["Hysteresis"][0]
    means = [row[0].mean() / ARCSEC for row in (loop.rising, loop.falling, loop.width)]
    assert to_text(loop).splitlines()[4].split() == ["-412", *(f"{mean:.4g}" for mean in means)]
    found = every_kind()["ContactPressure"][0]
    peak = found.peaks()[0]
    (line,) = [line for line in to_text(found).splitlines() if line.startswith(f"{peak.contact} ")]
    sizes = (peak.pressure, peak.force, math.degrees(peak.theta), round(100 * peak.ripple, 2))
    assert line.split()[-4:] == [f"{size:.4g}" for size in sizes]


def test_inputs_are_listed(tmp_path: Any) -> None:
    path = tmp_path / "model.toml"
    rverror.save_model(path, rverror.Model(rverror.reducer("RV-40E")))
    files = rverror.views.input_files([path])
    for kind, key in (("Model", "inputs"), ("Budget", "inputs"), ("Allocation", "inputs"), ("Diagnosis", "files")):
        assert to_json(every_kind()[kind][0], files=files)[key] == [
            {"path": str(path), "sha256": files[0].sha256, "bytes": path.stat().st_size}
        ]


def test_an_allocation_names_its_tolerances() -> None:
    found = every_kind()["Allocation"][0]
    assert to_json(found)["variables"]["tolerance"]["values"] == list(found.labels)


@pytest.mark.parametrize("thing", [3.5, "text", None, {"a": 1}, HOSTILE])
def test_other_things_are_refused(thing: Any) -> None:
    for tell in (to_text, to_html, to_json):
        with pytest.raises(InputError, match=f"{type(thing).__name__}: no table is made of it; give "):
            tell(thing)


def test_columns_of_a_text_are_lined_up() -> None:
    lines = to_text(rverror.reducer("RV-40E")).splitlines()[2:]
    assert len({line.index(value) + len(value) for line in lines for value in [line.split()[1]]}) == 1
