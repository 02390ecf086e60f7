"""Reference cases: their numbers and their files."""

from __future__ import annotations

import io
import json
import math

import numpy as np
import pytest

from pages import ROOT
from reference_cases import CASES, TURN, command, solved_cases, wave, write
from remedy import REMEDY
from rverror.base.errors import InputError
from rverror.base.units import ARCSEC
from rverror.reference.cases import (
    ARRAYS,
    case_files,
    case_json,
    pick,
    read_case,
    solve,
)

N = 4096


@pytest.fixture(scope="module")
def solved():
    return solved_cases()


@pytest.fixture(scope="module")
def folder(tmp_path_factory, solved):
    """Folders as the command writes them, but of the coarse cases."""
    top = tmp_path_factory.mktemp("cases")
    for name, case in solved.items():
        write(top / name, case_files(case))
    return top


# --- numbers of the cases ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.known])
def test_cases_hold_the_known_numbers(name, solved):
    arrays = solved[name].arrays
    for known in CASES[name].known:
        te = arrays[f"transmission_error_{known['method']}"]
        order = known["order"]
        size = te.mean() if order == 0 else 2 * abs(np.mean(te * np.exp(1j * order * arrays["theta"])))
        assert size == pytest.approx(known["arcsec"] * ARCSEC, rel=known["tolerance"], abs=1e-15)
        assert (ROOT / known["where"]).is_file()


@pytest.mark.parametrize("name", CASES)
def test_output_torque_is_what_the_carrier_gets(name, solved):
    """Moment of the crank journals' forces on the carrier about its axis: an equation that no solver step uses."""
    case, unit = solved[name], CASES[name].model.mechanism
    at = case.arrays["force_theta"] + TURN * np.arange(unit.cranks)[:, None] / unit.cranks
    force = case.arrays["force_carrier"]
    torque = unit.crank_radius * (np.cos(at) * force[:, 1] - np.sin(at) * force[:, 0]).sum(axis=0)
    np.testing.assert_allclose(torque, CASES[name].direction * CASES[name].torque, rtol=1e-6)


@pytest.mark.parametrize("name", CASES)
def test_influences_times_sizes_are_the_closed_form(name, solved):
    arrays = solved[name].arrays
    sizes = np.array([value for effect in CASES[name].model.effects for value in effect.values])
    assert len(arrays["influence_labels"]) == len(sizes) == len(arrays["influence_equilibrium"])
    assert ("influence_closed" in arrays) == bool(CASES[name].closed_form)
    if CASES[name].closed_form:
        total = sizes @ arrays["influence_closed"]
        np.testing.assert_allclose(total, arrays["transmission_error_closed"], atol=1e-18)


def test_equilibrium_influence_is_the_slope_of_the_equilibrium(solved):
    """One planet's eccentricity moves the flanks linearly, so its influence times its size is the whole wave."""
    arrays = solved["planet-eccentricity"].arrays
    alone = arrays["transmission_error_equilibrium"] - solved["perfect-unit"].arrays["transmission_error_equilibrium"]
    np.testing.assert_allclose(arrays["influence_equilibrium"][0] * 5e-3, alone, atol=1e-4 * ARCSEC)


# --- files ------------------------------------------------------------------------------------------------------------


def test_the_same_bytes_every_time(solved):
    again = solve(CASES["one-cam"], points=512)
    assert case_files(again) == case_files(solved["one-cam"])
    assert again is not solved["one-cam"]


@pytest.mark.parametrize("name", CASES)
def test_json_tells_the_model_in_numbers(name, solved):
    content = json.loads(case_files(solved[name])["case.json"])
    model = CASES[name].model
    unit = content["model"]["reducer"]
    assert unit["pin_circle_radius"] == model.mechanism.pin_circle_radius
    assert unit["stiffness"]["pin_contact"] == model.mechanism.stiffness.pin_contact
    values = [p["value"] for e in content["model"]["effects"] for p in e["parameters"].values()]
    assert values == [value for effect in model.effects for value in effect.values]
    assert content["arrays"].keys() == solved[name].arrays.keys() <= ARRAYS.keys()


@pytest.mark.parametrize("name", CASES)
def test_json_tells_how_far_the_closed_form_is_from_the_equilibrium_at_the_same_angles(name, solved):
    """In reverse the angles of a case fall."""
    arrays = solved[name].arrays
    told = json.loads(case_files(solved[name])["case.json"])["closed_form"]["rms_from_equilibrium_arcsec"]
    if "transmission_error_closed" in arrays:
        away = arrays["transmission_error_equilibrium"] - arrays["transmission_error_closed"]
        assert told == pytest.approx(np.std(away) / ARCSEC, rel=1e-5)
    else:
        assert told is None


def test_json_tells_orders_with_phase():
    """The orders of case.json put together again are the waveform, but for what is too small to be told."""
    case = solve(CASES["disc-pitch"], points=512)
    content = case_json(case)
    for word, method in (("closed_form", "closed"), ("equilibrium", "equilibrium")):
        told = content[word]
        lines = [(o["order"], o["amplitude_arcsec"], math.radians(o["phase_deg"])) for o in told["orders"]]
        rest = case.arrays[f"transmission_error_{method}"] - wave(case.arrays["theta"], *lines)
        assert np.std(rest) < 0.02 * told["rms_arcsec"] * ARCSEC
        assert rest.mean() == pytest.approx(told["offset_arcsec"] * ARCSEC, abs=1e-6 * ARCSEC)


def test_a_case_is_read_by_folder_or_file(folder):
    by_folder, by_file = read_case(folder / "one-pin"), read_case(folder / "one-pin" / "case.json")
    assert by_folder.name == by_file.name == "one-pin"
    assert by_folder.direction == 1.0
    assert read_case(folder / "several-errors-reverse").direction == -1.0
    assert by_folder.ratio == 121.0


def test_tampered_arrays_are_refused(solved, tmp_path):
    files = case_files(solved["one-cam"])
    write(tmp_path, files)
    changed = dict(solved["one-cam"].arrays)
    changed["transmission_error_equilibrium"] = changed["transmission_error_equilibrium"] * (1 + 1e-12)
    np.savez(tmp_path / "case.npz", **changed)
    with pytest.raises(InputError, match="hash differs"):
        read_case(tmp_path)


def changed_json(change):
    def apply(path):
        content = json.loads((path / "case.json").read_text())
        change(content)
        (path / "case.json").write_text(json.dumps(content))

    return apply


def one_array():
    content = io.BytesIO()
    np.save(content, np.ones(3))
    return content.getvalue()


BROKEN = {
    "no such case": (lambda p: (p / "case.json").unlink(), "no such file"),
    "no arrays": (lambda p: (p / "case.npz").unlink(), "no such file"),
    "cut arrays": (lambda p: (p / "case.npz").write_bytes((p / "case.npz").read_bytes()[:5000]), "hash differs"),
    "no zip": (lambda p: (p / "case.npz").write_bytes(b"hello"), "hash differs"),
    "one array": (lambda p: (p / "case.npz").write_bytes(one_array()), "hash differs"),
    "pickled": (lambda p: np.savez(p / "case.npz", theta=np.array([{}], dtype=object)), "hash differs"),
    "no JSON": (lambda p: (p / "case.json").write_text("{"), "no JSON"),
    "a list": (lambda p: (p / "case.json").write_text("[]"), "no reference case"),
    "another JSON": (lambda p: (p / "case.json").write_text('{"a": 1}'), "no reference case"),
    "other format": (changed_json(lambda c: c.update(format=2)), "format 2, this rverror reads 1"),
    "other hash": (changed_json(lambda c: c.update(npz_sha256="0")), "hash differs"),
    "no model": (changed_json(lambda c: c.pop("model")), "missing or changed"),
    "odd direction": (changed_json(lambda c: c.update(direction="up")), "missing or changed"),
}


@pytest.mark.parametrize("what", BROKEN)
def test_broken_cases_are_refused_in_one_line(what, solved, tmp_path):
    break_it, message = BROKEN[what]
    write(tmp_path, case_files(solved["one-cam"]))
    break_it(tmp_path)
    with pytest.raises(InputError, match=message) as caught:
        read_case(tmp_path)
    assert "\n" not in str(caught.value)
    assert REMEDY.search(str(caught.value)) or "keep" in str(caught.value)


# --- the commands -----------------------------------------------------------------------------------------------------


def test_command_writes_what_it_says_and_tells_what_it_replaces(tmp_path, capsys):
    out = tmp_path / "new" / "cases"
    command("reference-cases", "--out", out, "--case", "one-cam")
    first = {p.name: p.read_bytes() for p in (out / "one-cam").iterdir()}
    told = capsys.readouterr()
    assert first.keys() == {"case.json", "case.npz"}
    assert [p.name for p in out.iterdir()] == ["one-cam"]
    assert "one cam" in told.out
    assert "replacing" not in told.err
    (out / "one-cam" / "case.json").write_text("mine")
    command("reference-cases", "--out", out, "--case", "one-cam")
    assert f"replacing {out / 'one-cam' / 'case.json'}" in capsys.readouterr().err
    assert {p.name: p.read_bytes() for p in (out / "one-cam").iterdir()} == first


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["reference-cases", "--out", "{t}/x", "--case", "one-cams"], "did you mean 'one-cam'"),
        (["reference-cases", "--out", " "], "has no name; give one"),
        (["reference-cases", "--out", "{t}/a file"], "cannot make the folder"),
    ],
)
def test_bad_words_are_refused_in_one_line(words, message, tmp_path):
    (tmp_path / "a file").touch()
    with pytest.raises(InputError, match=message) as caught:
        command(*(word.format(t=tmp_path) for word in words))
    assert "\n" not in str(caught.value)
    assert REMEDY.search(str(caught.value))
    assert not (tmp_path / "x").exists()


def test_pick_keeps_the_order_and_takes_each_once():
    assert [case.name for case in pick(["one-pin", "one-cam", "one-pin"])] == ["one-cam", "one-pin"]
    assert len(pick([])) == len(CASES) == 10
