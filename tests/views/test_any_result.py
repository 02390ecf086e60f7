"""Every kind of result as text, JSON and page: told in full, escaped, and refused in one line where there is none."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from typing import Any

import pytest

import rverror
from every_kind import DRIVE, HOSTILE, KINDS, MODEL, every_kind
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
    state = to_json(every_kind()["Equilibrium"][0], torque="412 N*m")["variables"]
    assert state["torque"] == {"dimensions": [], "units": "N*m", "values": 412.0}


def test_an_order_table_says_once_what_holds_for_all_rows() -> None:
    told = to_text(every_kind()["OrderTable"][0])
    for fact, text in (
        ("conditions", "3"),
        ("direction", "forward and reverse"),
        ("torque", "20 to 60 N*m"),
        ("input speed", "95.49 rpm"),
        ("temperature", "31.5 degC"),
        ("orders", "1, 39"),
        ("zero", "shared, A"),
    ):
        assert re.search(rf"^{fact} +{re.escape(text)}$", told, re.M), fact
    assert "direction  torque, N*m  order  amplitude, arcsec  phase, deg  sigma, arcsec" in told
    assert re.search(r"^reverse +20 +39 +1\.5 +0 +0\.1$", told, re.M)
    same = rverror.runs.orders_from_arrays(direction=-1, torque=5e3, order=[1, 2], cos=[ARCSEC] * 2, sin=[0.0] * 2)
    assert "\norder  amplitude, arcsec  phase, deg\n" in to_text(same)


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
    low, high = (f"{100 * share:.4g}" for share in (found.efficiency.min(), found.efficiency.max()))
    assert re.search(rf"^efficiency +{100 * found.mean:.4g} %, {low} to {high} over the angles$", told, re.M)
    assert re.search(rf"^torque at the input, mean +{found.input_torque.mean() / 1e3:.4g} N\*m$", told, re.M)
    for part, share in found.by_part.items():
        lost = found.losses[part].mean() / 1e3
        assert re.search(rf"^{part.replace('_', ' ')} +{lost:.4g} +{100 * share:.4g}$", told, re.M), part
    assert "self-locking" not in told
    stuck = replace(found, drives="output", input_torque=-found.input_torque)
    assert "self-locking: at some angle the output cannot drive it" in to_text(stuck)


def test_a_loop_and_contact_pressures_are_told() -> None:
    loop = every_kind()["Hysteresis"][0]
    rising, width = loop.rising[0] / ARCSEC, loop.width[0] / ARCSEC
    row = [*to_text(loop).splitlines()[3].split()]
    assert row[:2] == ["-412", f"{rising.mean():.4g}"]
    assert row[3:] == [f"{width.mean():.4g}", f"{width.min():.4g}", "to", f"{width.max():.4g}"]
    found = every_kind()["ContactPressure"][0]
    peak = found.peaks()[0]
    (line,) = [line for line in to_text(found).splitlines() if line.startswith(f"{peak.contact} (")]
    sizes = (peak.pressure, peak.force, math.degrees(peak.theta), 100 * peak.ripple)
    assert line.split()[-4:] == [f"{size:.4g}" for size in sizes]


def test_inputs_are_listed(tmp_path: Any) -> None:
    path = tmp_path / "model.toml"
    rverror.save_model(path, rverror.Model(rverror.reducer("RV-40E")))
    files = rverror.views.input_files([path])
    for kind, key in (("Model", "inputs"), ("Budget", "inputs"), ("Allocation", "inputs"), ("Diagnosis", "files")):
        assert to_json(every_kind()[kind][0], files=files)[key] == [
            {"path": str(path), "sha256": files[0].sha256, "bytes": path.stat().st_size}
        ]


def test_a_budget_in_closed_form_is_told_as_the_error_budget_tells_it() -> None:
    found = every_kind()["ErrorBudget"][0]
    text, whole = to_text(found.closed), to_text(found)
    assert text.startswith("Budget in closed form: 3 tolerances, 54 components\n")
    for name in ("peak-to-peak", "max |TE - offset|", "rms", "offset"):
        short, long = (re.search(rf"^{re.escape(name)} .*", told, re.M) for told in (text, whole))
        assert short is not None
        assert long is not None
        assert [short[0].split()[-2], short[0].split()[-1]] == [long[0].split()[-14], long[0].split()[-1]]
    data, all_of_it = to_json(found.closed), to_json(found)
    for key in ("peak_to_peak_arcsec", "max_arcsec", "rms_arcsec", "offset_arcsec"):
        assert data[key].items() <= all_of_it[key].items()
    assert [entry["label"] for entry in data["contributions"]] == [e["label"] for e in all_of_it["contributions"]]


@pytest.mark.parametrize("tell", [to_text, to_json, to_html])
def test_a_budget_in_closed_form_knows_no_yield(tell: Any) -> None:
    with pytest.raises(InputError, match="limit"):
        tell(every_kind()["Budget"][0], limit=40 * ARCSEC)


def test_an_allocation_names_its_tolerances() -> None:
    found = every_kind()["Allocation"][0]
    for entry, label, component in zip(to_json(found)["entries"], found.labels, found.keys, strict=True):
        assert entry["label"] == label
        assert entry["key"] == component


@pytest.mark.parametrize("thing", [3.5, "text", None, {"a": 1}, HOSTILE])
def test_other_things_are_refused_with_the_kinds_that_have_a_text(thing: Any) -> None:
    for tell in (to_text, to_html):
        with pytest.raises(InputError, match=f"{type(thing).__name__} has no text; these have: Allocation, Budget, "):
            tell(thing)
    with pytest.raises(InputError, match="table is made of"):
        to_json(thing)


@pytest.mark.parametrize("tell", [to_text, to_html])
def test_what_a_result_does_not_take_is_refused(tell: Any) -> None:
    with pytest.raises(InputError, match="Drive: no option 'limit'; it takes none"):
        tell(DRIVE, limit=1.0)


def test_columns_of_a_text_are_lined_up() -> None:
    lines = to_text(rverror.reducer("RV-40E")).splitlines()[2:]
    assert len({line.index(value) + len(value) for line in lines for value in [line.split()[1]]}) == 1
