"""Comparison of another tool with a reference case: what it finds, what it refuses."""

from __future__ import annotations

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from reference_cases import CASES, TURN, command, solved_cases, wave, write
from remedy import REMEDY
from rverror import load_run, run_from_arrays, to_html, to_json, to_text
from rverror.base.errors import InputError
from rverror.base.units import ARCSEC
from rverror.reference.cases import StoredCase, case_files, read_case
from rverror.reference.comparison import compare
from rverror.runs import write_run
from rverror.views import to_csv

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


LINES = ((40, 9.0, 0.4), (78, 4.0, -1.1), (120, 1.0, 2.0), (2, 0.5, 0.3))
CLOSED = ((40, 8.0, 0.9), (78, 3.0, -0.4), (120, 1.5, 1.0))


def synthetic(direction=1.0, lines=LINES, points=N):
    """Case whose waveform is known at every angle."""
    turn = TURN * np.arange(points) / points
    theta = turn if direction > 0 else TURN - turn
    return StoredCase(
        name="synthetic",
        version="0",
        ratio=121.0,
        direction=direction,
        arrays={
            "theta": theta,
            "transmission_error_equilibrium": wave(theta, *lines) - 300 * ARCSEC,
            "transmission_error_closed": wave(theta, *CLOSED),
        },
    )


def their_run(theta, error):
    return run_from_arrays(
        input_angle=121 * theta, te=error, ratio=121.0, direction=float(np.sign(theta[-1] - theta[0]))
    )


def grid(points=N, *, first=0.0, turns=1):
    return first + TURN * np.arange(points * turns) / points


# --- the comparison ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", CASES)
def test_our_own_waveform_compares_to_nothing(name, folder, solved, tmp_path):
    arrays = solved[name].arrays
    write_run(tmp_path / "run.csv", their_run_of(CASES[name], arrays))
    found = run_compare(tmp_path / "run.csv", folder / name)
    assert found.rms < 1e-8 * ARCSEC
    assert abs(found.offset) < 1e-8 * ARCSEC
    assert not found.notes
    assert "No order differs" in to_text(found)


def their_run_of(case, arrays):
    theta, error = arrays["theta"], arrays["transmission_error_equilibrium"]
    ratio = case.model.mechanism.ratio
    return run_from_arrays(input_angle=ratio * theta, te=error, ratio=ratio, direction=case.direction)


def run_compare(path, case_path, **rest):
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
    # de Boor's bound for a spline that closes; one whose end is none errs by the square of the step there
    step = 1.5 * np.diff(theta)[0]
    assert abs(found.largest) < 5 / 384 * step**4 * sum(abs(size) * order**4 for order, size, _ in LINES) * ARCSEC


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


def test_direction_of_the_run_is_noted_where_it_is_not_the_cases():
    theta = grid()
    found = compare(their_run(-theta, wave(-theta, *LINES)), synthetic())
    assert found.notes == ("the run goes reverse, the case forward; compared at the same angles",)
    assert found.rms < 1e-8 * ARCSEC


def test_a_measured_run_has_its_benchs_uncertainty_beside_its_figures(tmp_path, folder, capsys):
    """k = 2 over the square root of three of the encoder's accuracy for an rms, twice that for a peak-to-peak."""
    bench, path = tmp_path / "bench.toml", tmp_path / "their.csv"
    bench.write_text("[drive]\nratio = 121\n[bench.encoders]\noutput_encoder = '3 arcsec'\n")
    write_run(path, their_run(grid(), wave(grid(), *LINES)))
    command("compare", path, folder / "one-cam", "--bench", bench, "--json", tmp_path / "out.json")
    told = capsys.readouterr().out
    assert re.search(r"peak-to-peak, theirs +[\d.]+ +6.928$", told, re.MULTILINE)
    assert re.search(r"rms of the difference, without the offset +[\d.]+ +3.464$", told, re.MULTILINE)
    assert "Combined and expanded, k = 2: one angle ± 3.464, peak-to-peak ± 6.928, rms ± 3.464 arcsec" in told
    stated = json.loads((tmp_path / "out.json").read_text())["bench_uncertainty"]
    assert stated["peak_to_peak_arcsec"] == pytest.approx(12 / math.sqrt(3), rel=1e-5)
    plain = compare(their_run(grid(), wave(grid(), *LINES)), synthetic())
    assert "±" not in to_text(plain)
    assert to_json(plain)["bench_uncertainty"] is None
    bench.write_text("[drive]\nratio = 121\n")
    with pytest.raises(InputError, match=r"bench.toml: it has no \[bench.encoders\]; write them, like"):
        command("compare", path, folder / "one-cam", "--bench", bench)


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


# --- the command ------------------------------------------------------------------------------------------------------


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
    assert re.search(r"^ +36 +0.5 +0 +[\d.e-]+ +0.5 +0$", text, re.M)
    content = json.loads((tmp_path / "out.json").read_text())
    assert content["orders"][0]["order"] == 36
    assert content["orders"][0]["difference"]["amplitude_arcsec"] == pytest.approx(0.5, rel=1e-6)
    assert content["rms_difference_arcsec"] == pytest.approx(0.5 / math.sqrt(2), rel=1e-6)
    assert content["orders"][0]["case"]["phase_deg"] is None
    inputs = [path, folder / "one-cam" / "case.json", folder / "one-cam" / "case.npz"]
    assert [entry["path"] for entry in content["inputs"]] == [str(name) for name in inputs]


def test_command_compares_a_file_by_its_mapping(folder, tmp_path, capsys):
    """The same waveform under a bench's own names, in its own units and sign, compares as the run file does."""
    their_file(folder, "one-cam", tmp_path, plus=0.5)
    run = load_run(tmp_path / "their.csv")
    rows = zip(np.degrees(run.input_angle), -np.degrees(run.te_column) * 60, strict=True)
    lines = ["Motor [°];Fehler [arcmin]", *(f"{a:.9f};{e:.12f}".replace(".", ",") for a, e in rows)]
    (tmp_path / "bench.txt").write_text("\n".join(lines), encoding="utf-8")
    mapping = tmp_path / "bench.toml"
    mapping.write_text(
        '[columns]\ninput_angle = { name = "Motor [°]", unit = "deg" }\n'
        'te = { name = "Fehler [arcmin]", unit = "arcmin", sign = -1 }\n[header]\ndirection = "forward"\n',
        encoding="utf-8",
    )
    told = {}
    for name, words in (("their.csv", []), ("bench.txt", ["--mapping", mapping])):
        command("compare", tmp_path / name, folder / "one-cam", "--json", tmp_path / "out.json", *words)
        told[name] = json.loads((tmp_path / "out.json").read_text())
    capsys.readouterr()
    bench, plain = told["bench.txt"], told["their.csv"]
    assert bench["rms_difference_arcsec"] == pytest.approx(plain["rms_difference_arcsec"], rel=1e-6)
    assert [Path(entry["path"]).name for entry in bench["inputs"]] == [
        "bench.txt",
        "case.json",
        "case.npz",
        "bench.toml",
    ]
    with pytest.raises(InputError, match="also an input"):
        command("compare", tmp_path / "bench.txt", folder / "one-cam", "--mapping", mapping, "--json", mapping)


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
        (["compare", "{t}/their.csv", "{f}/one-cam", "--within", "1 mm"], "--within"),
        (["compare", "{t}/their.csv", "{f}/one-cam", "--within=-1 arcsec"], "is not above 0"),
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


def test_json_of_a_comparison_is_plain():
    content = to_json(compare(their_run(grid(), wave(grid(), *LINES)), synthetic()))
    assert json.loads(json.dumps(content, allow_nan=False)) == content


def test_a_comparison_is_told_as_any_result():
    found = compare(their_run(grid(), 1.1 * wave(grid(), *LINES)), synthetic())
    frame = to_csv(found, rows="order").splitlines()
    assert frame[0] == "order,theirs,case,difference,theirs_phase,case_phase,difference_phase"
    assert frame[1].startswith("40,9.9,9,0.9,22.9183,22.9183,")
    assert "case&#x27;s own rms is 7.009 arcsec" in to_html(found)
