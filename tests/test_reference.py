"""Reference cases: their numbers, their files, and what the comparison with another tool finds."""

from __future__ import annotations

import argparse
import io
import json
import math
import zipfile
from pathlib import Path

import numpy as np
import pytest

from rverror import cli_reference, load_model, run_from_arrays, write_run
from rverror.errors import InputError
from rverror.reference import (
    ARRAYS,
    StoredCase,
    arrays_hash,
    case_files,
    case_json,
    case_npz,
    compare,
    comparison_json,
    comparison_text,
    definitions,
    pick,
    read_case,
    solve,
)
from rverror.units import ARCSEC
from test_cli import REMEDY

CASES = {case.name: case for case in definitions()}
TURN = 2 * math.pi
N = 4096


@pytest.fixture(scope="module")
def solved():
    """Every case, on a coarser turn."""
    return {name: solve(case, points=512) for name, case in CASES.items()}


@pytest.fixture(scope="module")
def folder(tmp_path_factory, solved):
    """Folders as the command writes them, but of the coarse cases."""
    top = tmp_path_factory.mktemp("cases")
    for name, case in solved.items():
        write(top / name, case_files(case))
    return top


def write(path, files):
    path.mkdir(exist_ok=True)
    for name, content in files.items():
        (path / name).write_bytes(content)


def wave(theta, *lines):
    """Sum of amplitude * cos(order * theta - phase), arcsec."""
    return ARCSEC * sum(size * np.cos(order * theta - phase) for order, size, phase in lines)


LINES = ((40, 9.0, 0.4), (78, 4.0, -1.1), (120, 1.0, 2.0), (2, 0.5, 0.3))
CLOSED = ((40, 8.0, 0.9), (78, 3.0, -0.4), (120, 1.5, 1.0))
OPPOSITE = ((40, 9.0, -0.7), (78, 4.0, 0.9), (120, 1.0, -1.4))


def synthetic(direction=1.0, lines=LINES, points=N):
    """Case whose waveform is known at every angle."""
    turn = TURN * np.arange(points) / points
    theta = turn if direction > 0 else TURN - turn
    return StoredCase(
        name="synthetic",
        version="0",
        ratio=121.0,
        direction=direction,
        turns={"carrier": 1.0, "crank": -39.0, "sun": 121.0},
        arrays={
            "theta": theta,
            "transmission_error_equilibrium": wave(theta, *lines) - 300 * ARCSEC,
            "transmission_error_closed": wave(theta, *CLOSED),
            "opposite_equilibrium": wave(theta, *OPPOSITE) + 300 * ARCSEC,
        },
    )


def their_run(theta, error):
    return run_from_arrays(
        input_angle=121 * theta, te=error, ratio=121.0, direction=float(np.sign(theta[-1] - theta[0]))
    )


def grid(points=N, *, first=0.0, turns=1):
    return first + TURN * np.arange(points * turns) / points


# --- numbers of the cases ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", [name for name, case in CASES.items() if case.known])
def test_cases_hold_the_known_numbers(name, solved):
    arrays = solved[name].arrays
    for known in CASES[name].known:
        te = arrays[f"transmission_error_{known.method}"]
        size = te.mean() if known.order == 0 else 2 * abs(np.mean(te * np.exp(1j * known.order * arrays["theta"])))
        assert size == pytest.approx(known.size, rel=known.tolerance, abs=1e-15)
        assert (Path(__file__).parents[1] / known.where).is_file()


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


def test_the_other_direction_is_that_of_the_reverse_case(solved):
    one, other = solved["several-errors"].arrays, solved["several-errors-reverse"].arrays
    there = np.argsort(other["theta"] % TURN)
    for method in ("closed", "equilibrium"):
        np.testing.assert_allclose(
            one[f"opposite_{method}"], other[f"transmission_error_{method}"][there], atol=1e-5 * ARCSEC
        )


# --- files ------------------------------------------------------------------------------------------------------------


def test_the_same_bytes_every_time(solved):
    again = solve(CASES["one-cam"], points=512)
    assert case_files(again) == case_files(solved["one-cam"])
    assert again is not solved["one-cam"]


def test_npz_has_no_clock(solved):
    with zipfile.ZipFile(io.BytesIO(case_npz(solved["one-pin"]))) as archive:
        assert {item.date_time for item in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}


@pytest.mark.parametrize("name", CASES)
def test_json_tells_the_model_in_text_and_numbers(name, solved, tmp_path):
    content = json.loads(case_files(solved[name])["case.json"])
    (tmp_path / "model.toml").write_text(content["model_toml"], encoding="utf-8")
    model = load_model(tmp_path / "model.toml")
    assert model == CASES[name].model
    unit = content["model"]["reducer"]
    assert unit["pin_circle_radius"] == model.mechanism.pin_circle_radius
    assert unit["stiffness"]["pin_contact"] == model.mechanism.stiffness.pin_contact
    values = [p["value"] for e in content["model"]["effects"] for p in e["parameters"].values()]
    assert values == [value for effect in model.effects for value in effect.values]
    assert content["arrays"].keys() == solved[name].arrays.keys() <= ARRAYS.keys()


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


def test_hash_knows_contents_and_names_not_the_container(solved, folder, tmp_path):
    arrays = dict(solved["one-cam"].arrays)
    files = case_files(solved["one-cam"])
    write(tmp_path, files)
    np.savez_compressed(tmp_path / "case.npz", **arrays)
    read = read_case(tmp_path)
    np.testing.assert_array_equal(read.arrays["theta"], arrays["theta"])
    whole = arrays_hash(arrays)
    assert whole == json.loads(files["case.json"])["arrays_sha256"]
    nudged = arrays["theta"].copy()
    nudged[17] = np.nextafter(nudged[17], 9.0)
    assert arrays_hash(arrays | {"theta": nudged}) != whole
    assert arrays_hash({("x" if k == "theta" else k): v for k, v in arrays.items()}) != whole
    assert arrays_hash(arrays | {"influence_closed": arrays["influence_closed"].T}) != whole


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
    "no arrays": (lambda p: (p / "case.npz").unlink(), "keep case.json and case.npz together"),
    "cut arrays": (lambda p: (p / "case.npz").write_bytes((p / "case.npz").read_bytes()[:5000]), "cannot read"),
    "no zip": (lambda p: (p / "case.npz").write_bytes(b"hello"), "cannot read"),
    "one array": (lambda p: (p / "case.npz").write_bytes(one_array()), "cannot read"),
    "pickled": (lambda p: np.savez(p / "case.npz", theta=np.array([{}], dtype=object)), "cannot read"),
    "no JSON": (lambda p: (p / "case.json").write_text("{"), "no JSON"),
    "a list": (lambda p: (p / "case.json").write_text("[]"), "no reference case"),
    "another JSON": (lambda p: (p / "case.json").write_text('{"a": 1}'), "no reference case"),
    "other format": (changed_json(lambda c: c.update(format=2)), "format 2, this rverror reads 1"),
    "other hash": (changed_json(lambda c: c.update(arrays_sha256="0")), "hash differs"),
    "no model": (changed_json(lambda c: c.pop("model")), "missing or changed"),
    "odd direction": (changed_json(lambda c: c.update(direction="up")), "missing or changed"),
    "list of turns": (changed_json(lambda c: c["model"].update(turns_per_output_turn=[])), "missing or changed"),
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


# --- the comparison ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CASES)
def test_our_own_waveform_compares_to_nothing(name, folder, solved, tmp_path):
    arrays = solved[name].arrays
    write_run(tmp_path / "run.csv", their_run_of(CASES[name], arrays))
    found = run_compare(tmp_path / "run.csv", folder / name)
    assert found.rms < 1e-8 * ARCSEC
    assert abs(found.offset) < 1e-8 * ARCSEC
    assert not found.hints
    assert not found.notes
    assert "No order differs" in comparison_text(found)


def their_run_of(case, arrays):
    theta, error = arrays["theta"], arrays["transmission_error_equilibrium"]
    ratio = case.model.mechanism.ratio
    return run_from_arrays(input_angle=ratio * theta, te=error, ratio=ratio, direction=case.direction)


def run_compare(path, case_path, **rest):
    from rverror import load_run

    case = read_case(case_path)
    return compare(load_run(path, case.ratio), case, **rest)


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize(
    "theta",
    [
        grid(),
        grid(first=TURN * 1001 / N),
        grid(first=-TURN),
        grid(turns=3),
        np.append(grid(), TURN),
        grid(2 * N),
    ],
    ids=["same", "another start", "a turn before", "three turns", "end twice", "twice as many"],
)
def test_angles_of_the_case_are_taken_as_they_are(theta, direction):
    case = synthetic(direction)
    run = their_run(direction * theta, wave(direction * theta, *LINES) - 300 * ARCSEC)
    found = compare(run, case)
    assert found.rms < 1e-8 * ARCSEC
    assert not any("interpolated" in note for note in found.notes)
    assert any("3 whole turns" in note for note in found.notes) == (theta[-1] > 2 * TURN)
    assert any("left out" in note for note in found.notes) == (theta.size % N == 1 or theta.size == 2 * N)


@pytest.mark.parametrize(
    "theta",
    [grid(5000), grid(3000, first=0.123), grid() + 2e-4, grid(turns=2) * 1.07],
    ids=["more", "fewer", "beside", "uneven end"],
)
def test_other_angles_are_interpolated_and_told(theta):
    found = compare(their_run(theta, wave(theta, *LINES)), synthetic())
    assert any("interpolated by a cubic spline" in note for note in found.notes)
    assert found.rms < 5e-4 * found.case_rms
    assert found.offset == pytest.approx(300 * ARCSEC, abs=0.01 * ARCSEC)


def test_the_mean_of_several_turns_is_compared():
    theta = grid(turns=2)
    swing = np.where(np.arange(theta.size) < N, 1.0, -1.0) * wave(theta, (7, 3.0, 0.0))
    assert compare(their_run(theta, wave(theta, *LINES) + swing), synthetic()).rms < 1e-8 * ARCSEC


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_an_added_wave_is_found_at_its_order_with_size_and_phase(direction):
    theta = direction * grid()
    extra = wave(theta, (36, 0.7, 1.2))
    found = compare(their_run(theta, wave(theta, *LINES) + extra - 290 * ARCSEC), synthetic(direction))
    worst = found.orders[0]
    assert worst.order == 36
    assert worst.difference == pytest.approx(0.7 * ARCSEC * np.exp(1.2j), rel=1e-6)
    assert abs(worst.case) < 1e-9 * ARCSEC
    assert all(abs(line.difference) < 1e-8 * ARCSEC for line in found.orders[1:])
    assert found.rms == pytest.approx(0.7 * ARCSEC / math.sqrt(2), rel=1e-6)
    assert found.largest == pytest.approx(0.7 * ARCSEC, rel=1e-3)
    assert np.cos(36 * found.largest_at - 1.2) ** 2 == pytest.approx(1, abs=1e-3)
    assert found.offset == pytest.approx(10 * ARCSEC, rel=1e-6)
    assert not found.hints


def test_both_waves_of_an_order_are_told_where_the_case_has_one():
    theta = grid()
    lines = [(40, 9.0, 0.6), *LINES[1:]]
    found = compare(their_run(theta, wave(theta, *lines)), synthetic())
    worst = found.orders[0]
    assert worst.order == 40
    assert worst.theirs == pytest.approx(9 * ARCSEC * np.exp(0.6j), rel=1e-6)
    assert worst.case == pytest.approx(9 * ARCSEC * np.exp(0.4j), rel=1e-6)
    assert abs(worst.difference) == pytest.approx(2 * 9 * ARCSEC * math.sin(0.1), rel=1e-6)


def test_peak_to_peak_of_both():
    theta = grid()
    found = compare(their_run(theta, wave(theta, (39, 3.0, 0.0))), synthetic(lines=((40, 5.0, 0.0),)))
    assert found.peak_to_peak == pytest.approx(6 * ARCSEC, rel=1e-3)
    assert found.case_peak_to_peak == pytest.approx(10 * ARCSEC, rel=1e-3)


# --- hints ------------------------------------------------------------------------------------------------------------

THETA = grid()
CRANK_IN_CARRIER, CRANK_IN_HOUSING, INPUT_TURN = TURN / 40, TURN / 39, TURN / 121
MIX_UPS = {
    "sign": (-wave(THETA, *LINES), ["sign turned"]),
    "mirrored": (wave(-THETA, *LINES), ["angles mirrored"]),
    "both": (-wave(-THETA, *LINES), ["sign and angles turned"]),
    "direction": (wave(THETA, *OPPOSITE), ["other direction"]),
    "method": (wave(THETA, *CLOSED), ["closed form fits"]),
    "crank turn in the carrier": (wave(THETA - CRANK_IN_CARRIER, *LINES), ["by 9 deg", "1 crank turns against the"]),
    "crank turn back": (wave(THETA + CRANK_IN_HOUSING, *LINES), ["by -9.231 deg", "1 crank turns in the housing"]),
    "input turn": (wave(THETA - INPUT_TURN, *LINES), ["by 2.97", "1 sun turns in the housing"]),
    "zero": (wave(THETA - 0.05, *LINES), ["by 2.8", "deg of the output (rms", "check where theta = 0 lies"]),
}


@pytest.mark.parametrize("what", MIX_UPS)
@pytest.mark.parametrize("noise", [0.0, 0.2])
def test_a_mix_up_is_named_and_no_other(what, noise):
    theirs, words = MIX_UPS[what]
    theirs = theirs + noise * ARCSEC * np.random.default_rng(1).standard_normal(N)
    found = compare(their_run(THETA, theirs), synthetic())
    assert len(found.hints) == 1, found.hints
    for word in words:
        assert word in found.hints[0]
    assert f"hint: {found.hints[0]}" in comparison_text(found)


@pytest.mark.parametrize(
    "theirs",
    [
        wave(THETA, *LINES),
        1.3 * wave(THETA, *LINES),
        0.5 * wave(THETA, *LINES),
        0 * THETA,
        wave(THETA, *LINES, (36, 3.0, 0.1)),
        wave(THETA, *LINES) + ARCSEC * np.random.default_rng(2).standard_normal(N),
        wave(THETA, (17, 5.0, 0.0)),
    ],
    ids=["right", "too large", "half", "nothing", "one more", "noise", "other"],
)
def test_no_hint_where_nothing_is_mixed_up(theirs):
    assert compare(their_run(THETA, theirs), synthetic()).hints == ()


def test_waves_that_look_the_same_turned_and_mirrored_get_both_hints():
    """A sine about 0 is odd: its negative is its mirror image."""
    odd = ((40, 5.0, math.pi / 2), (78, 2.0, math.pi / 2))
    found = compare(their_run(THETA, -wave(THETA, *odd)), synthetic(lines=odd))
    assert [("sign turned" in hint, "mirrored" in hint) for hint in found.hints] == [(True, False), (False, True)]


def test_hints_on_a_solved_case(folder, solved):
    """The sign of the error and the direction, on the case of several errors itself."""
    case, arrays = read_case(folder / "several-errors"), solved["several-errors"].arrays
    te, theta = arrays["transmission_error_equilibrium"], arrays["theta"]
    for theirs, word in (
        (-te, "sign turned"),
        (arrays["opposite_equilibrium"], "other direction"),
        (arrays["transmission_error_closed"], "closed form"),
    ):
        (hint,) = compare(their_run(theta, theirs), case).hints
        assert word in hint


def test_direction_of_the_run_is_noted_where_it_is_not_the_cases():
    theta = grid()
    found = compare(their_run(-theta, wave(-theta, *LINES)), synthetic())
    assert found.notes == ("the run goes reverse, the case forward; compared at the same angles",)
    assert found.rms < 1e-8 * ARCSEC


# --- runs that cannot be compared -------------------------------------------------------------------------------------


def turning_back():
    there = grid(N)
    theta = np.concatenate([there, there[::-1]])
    return run_from_arrays(input_angle=121 * theta, te=wave(theta, *LINES), ratio=121.0)


def with_a_hole():
    theta = np.delete(grid(5000), slice(700, 760))
    return their_run(theta, wave(theta, *LINES))


BAD_RUNS = {
    "part of a turn": (lambda: their_run(grid()[:-1], wave(grid()[:-1], *LINES)), "whole turn"),
    "too few": (lambda: their_run(grid(300), wave(grid(300), *LINES)), r"largest order 40 needs 1.12 deg or less"),
    "a hole": (with_a_hole, "deg apart"),
    "back and forth": (turning_back, "one direction"),
}


@pytest.mark.parametrize("what", BAD_RUNS)
def test_unusable_runs_are_refused_in_one_line(what):
    make, message = BAD_RUNS[what]
    with pytest.raises(InputError, match=message) as caught:
        compare(make(), synthetic())
    assert "\n" not in str(caught.value)
    assert REMEDY.search(str(caught.value))


def test_angles_just_fine_enough_pass():
    theta = grid(321)
    lines = ((40, 5.0, 0.3),)
    assert compare(their_run(theta, wave(theta, *lines)), synthetic(lines=lines)).rms < 2e-3 * 5 * ARCSEC


# --- the commands -----------------------------------------------------------------------------------------------------


def command(*words):
    parser = argparse.ArgumentParser()
    cli_reference.add_commands(parser.add_subparsers(required=True))
    options = parser.parse_args([str(word) for word in words])
    options.run(options)


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


def their_file(folder, name, tmp_path, *, plus=0.0):
    case = read_case(folder / name)
    theta = case.arrays["theta"]
    error = case.arrays["transmission_error_equilibrium"] + wave(theta, (36, plus, 0.0))
    path = tmp_path / "their.csv"
    write_run(path, run_from_arrays(input_angle=case.ratio * theta, te=error, ratio=case.ratio, direction="forward"))
    return path


def test_command_compares(folder, tmp_path, capsys):
    path = their_file(folder, "one-cam", tmp_path, plus=0.5)
    command("compare", path, folder / "one-cam", "--json", tmp_path / "out.json", "--within", "0.36 arcsec")
    text = capsys.readouterr().out
    assert "theirs" in text
    assert "   36         0.5     0.00" in text
    content = json.loads((tmp_path / "out.json").read_text())
    assert content["orders"][0]["order"] == 36
    assert content["orders"][0]["difference"]["amplitude_arcsec"] == pytest.approx(0.5, rel=1e-6)
    assert content["rms_difference_arcsec"] == pytest.approx(0.5 / math.sqrt(2), rel=1e-6)
    assert content["orders"][0]["case"]["phase_deg"] is None


def test_within_is_the_exit_code(folder, tmp_path, capsys):
    path = their_file(folder, "one-cam", tmp_path, plus=0.5)
    command("compare", path, folder / "one-cam")  # compared: done, whatever the difference
    with pytest.raises(SystemExit) as caught:
        command("compare", path, folder / "one-cam", "--within", "0.35 arcsec")
    assert caught.value.code == 1
    assert "is above 0.35 arcsec" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["reference-cases", "--out", "{t}/x", "--case", "one-cams"], "did you mean 'one-cam'"),
        (["reference-cases", "--out", " "], "give a folder"),
        (["reference-cases", "--out", "{t}/their.csv"], "cannot make the folder"),
        (["compare", "{t}/their.csv", "{f}/one-cam", "--within", "1 mm"], "--within"),
        (["compare", "{t}/their.csv", "{f}/one-cam", "--within=-1 arcsec"], "below 0"),
        (["compare", "{t}/their.csv", "{f}/nothing"], "no such file"),
        (["compare", "{t}/none.csv", "{f}/one-cam"], "no such file"),
        (["compare", "{t}/their.csv", "{f}/one-cam", "--json", "{t}/their.csv"], "also an input"),
        (["compare", "{t}/their.csv", "{f}/one-cam", "--json", "{f}/one-cam/case.json"], "also an input"),
        (["compare", "{t}/their.csv", "{f}/bearing-clearance", "--method", "closed"], "no closed form"),
    ],
)
def test_bad_words_are_refused_in_one_line(words, message, folder, tmp_path):
    their_file(folder, "bearing-clearance" if "bearing" in " ".join(words) else "one-cam", tmp_path)
    with pytest.raises(InputError, match=message) as caught:
        command(*(word.format(t=tmp_path, f=folder) for word in words))
    assert "\n" not in str(caught.value)
    assert REMEDY.search(str(caught.value))
    assert not (tmp_path / "x").exists()


def test_pick_keeps_the_order_and_takes_each_once():
    assert [case.name for case in pick(["one-pin", "one-cam", "one-pin"])] == ["one-cam", "one-pin"]
    assert len(pick([])) == len(CASES) == 10


def test_json_of_a_comparison_is_plain():
    content = comparison_json(compare(their_run(THETA, wave(THETA, *LINES)), synthetic()))
    assert json.loads(json.dumps(content, allow_nan=False)) == content
