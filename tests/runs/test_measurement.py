"""Run files: what is read, what is refused and in which words, what is written."""

from __future__ import annotations

import math
import os
import pickle
import time
from pathlib import Path
from typing import Any

import numpy as np
import pint
import pytest
from hypothesis import given, strategies as st

import rverror
from recordings import bench, recording
from rverror import Drive, Model, reducer
from rverror.base.errors import InputError
from rverror.base.text import read_text, split_lines, write_file
from rverror.base.units import ARCSEC
from rverror.geartrain.kinematics import motion_direction
from rverror.runs.checks import smooth_direction
from rverror.runs.measurement import Run, load_run, run_from_arrays, write_run

HEAD = "# direction: forward\n# output_torque: 20 N*m\n"
COLUMNS = "input_angle[deg],output_angle[deg]\n"
N = 40


def rows(n: int = N, *, ratio: float = 100.0, error: float = 0.01, back: bool = False) -> list[str]:
    """Rows of a drive whose output leads by a constant error, deg."""
    inputs = [10.0 * i for i in range(n)]
    return [f"{x:g},{x / ratio + error:g}" for x in (reversed(inputs) if back else inputs)]


def text(lines: list[str] | None = None, *, head: str = HEAD, columns: str = COLUMNS) -> str:
    return head + columns + "\n".join(rows() if lines is None else lines) + "\n"


def with_row(number: int, row: str, n: int = N) -> str:
    """The good file with one row replaced; rows start at line 4."""
    lines = rows(n)
    lines[number - 4] = row
    return text(lines)


def load(tmp_path: Path, content: str | bytes, **keywords: object) -> Run:
    file = tmp_path / "run.csv"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return load_run(file, **keywords)  # type: ignore[arg-type]


# --- what is read -----------------------------------------------------------------------------------------------------


def test_good_file(tmp_path: Path) -> None:
    run = load(tmp_path, "# temperature: 20 degC\n# index: A\n# Bench: north: 2\n# input_speed: slow\n" + text())
    assert run.path == str(tmp_path / "run.csv")
    assert run.size == N
    assert run.torque == pytest.approx(20e3)
    assert run.temperature == pytest.approx(293.15)
    assert run.index == "A"
    assert run.metadata == {
        "temperature": "20 degC", "index": "A", "Bench": "north: 2", "input_speed": "slow", "direction": "forward",
        "output_torque": "20 N*m",
    }  # fmt: skip
    assert run.notes == ()
    assert (run.direction == 1).all()
    np.testing.assert_allclose(run.nominal_angle(100.0), np.radians(np.arange(N) / 10), atol=1e-15)
    np.testing.assert_allclose(run.error(100.0), math.radians(0.01), atol=1e-15)


@pytest.mark.parametrize(
    "change",
    [
        lambda t: b"\xef\xbb\xbf" + t.encode(),
        lambda t: t.replace("\n", "\r\n").encode(),
        lambda t: t.replace("\n", "\r").encode(),
        lambda t: (t + "\n\n  \n").encode(),
        lambda t: t.rstrip("\n").encode(),
        lambda t: t.replace(",", "  , ").replace("[deg]", " [ deg ] ").encode(),
        lambda t: t.replace("\n100,", "\n# a remark\n\n100,").encode(),
        lambda t: t.replace("# direction", "#direction").replace("forward", " Forward ").encode(),
        lambda t: t.replace("input_angle[deg],output_angle[deg]", '"Input_angle[deg]","output_angle[degree]"').encode(),
    ],
    ids=["bom", "crlf", "cr", "blank-end", "no-newline", "spaces", "remarks", "header", "quotes"],
)
def test_the_same_run_in_other_clothes(tmp_path: Path, change) -> None:  # type: ignore[no-untyped-def]
    plain, other = load(tmp_path, text()), load(tmp_path, change(text()))
    assert other.notes == ()
    assert other.torque == plain.torque
    for name in ("input_angle", "output_angle", "direction"):
        np.testing.assert_array_equal(getattr(other, name), getattr(plain, name))


@pytest.mark.parametrize(("unit", "per_turn"), [("deg", 360), ("turn", 1), ("rad", math.tau), ("arcsec", 1296000)])
def test_units(tmp_path: Path, unit: str, per_turn: float) -> None:
    lines = [f"{i / 50 * per_turn!r},{i / 5000 * per_turn!r},{i}" for i in range(N)]
    run = load(tmp_path, text(lines, columns=f"input_angle[{unit}],output_angle[{unit}],time[ms]\n"))
    assert run.time is not None
    np.testing.assert_allclose(run.input_angle, np.arange(N) / 50 * math.tau, rtol=1e-14)
    np.testing.assert_allclose(run.time, np.arange(N) / 1000, rtol=1e-14)
    np.testing.assert_allclose(run.error(100), 0, atol=1e-14)


def test_error_column_with_either_angle(tmp_path: Path) -> None:
    with_input = load(tmp_path, text([f"{10 * i},36" for i in range(N)], columns="input_angle[deg],te[arcsec]\n"))
    with_output = load(
        tmp_path, text([f"36,{i / 10 + 0.01:g}" for i in range(N)], columns="te[arcsec],output_angle[deg]\n")
    )
    for run in (with_input, with_output):
        np.testing.assert_allclose(run.error(100), 36 * ARCSEC, rtol=1e-14)
        np.testing.assert_allclose(run.nominal_angle(100), np.radians(np.arange(N) / 10), atol=1e-15)


def test_all_three_columns_must_agree(tmp_path: Path) -> None:
    columns = "input_angle[deg],output_angle[deg],te[arcsec]\n"
    te = [36 * math.sin(i) for i in range(N)]
    lines = [f"{10 * i},{i / 10 + te[i] / 3600!r},{te[i] + 5!r}" for i in range(N)]  # an offset may differ
    np.testing.assert_allclose(load(tmp_path, text(lines, columns=columns)).error(100), (np.array(te) + 5) * ARCSEC)
    lines[7] = f"70,0.7,{te[7] + 8!r}"
    with pytest.raises(InputError, match=r"te differs .* by up to .* leave out te"):
        load(tmp_path, text(lines, columns=columns)).error(100)


def test_other_columns_are_left_out_and_named(tmp_path: Path) -> None:
    lines = [f"{row},{i / 2},{'hot' if i == 3 else i}" for i, row in enumerate(rows())]
    run = load(tmp_path, text(lines, columns=COLUMNS.rstrip() + ",torque[N*m],state\n"))
    np.testing.assert_allclose(run.torque_record, 500 * np.arange(N), rtol=1e-14)
    assert run.size == N  # a word in a column that nobody needs costs no row
    assert run.notes == ("1 column of the file left out, not asked for: 'state'",)


def test_ratio_of_every_kind() -> None:
    unit = reducer("RV-40E")
    theta = np.linspace(0, 6, 50)
    run = run_from_arrays(input_angle=121 * theta, output_angle=theta + 1e-5)
    for ratio in (unit, Model(unit), Drive(ratio=121.0), 121, 121.0):
        np.testing.assert_allclose(run.error(ratio), 1e-5, rtol=1e-9)


@pytest.mark.parametrize("cell", ["", "nan", "inf", "-inf", "abc", "1_0", "1e300"])
def test_rows_without_a_number_are_left_out_and_counted(tmp_path: Path, cell: str) -> None:
    lines = rows()
    for line in (17, 40):
        lines[line - 4] = f"{cell},0.5"
    run = load(tmp_path, text(lines))
    assert run.size == N - 2
    assert run.notes[0] == "2 rows without a number left out (lines 17, 40)"
    np.testing.assert_allclose(run.error(100.0), math.radians(0.01), atol=1e-15)


def test_a_row_short_of_time_is_left_out_but_not_one_short_of_what_nobody_needs(tmp_path: Path) -> None:
    lines = [f"{row},{i},{i}" for i, row in enumerate(rows())]
    lines[5] = rows()[5] + ",,5"
    lines[6] = rows()[6] + ",6,"
    run = load(tmp_path, text(lines, columns=COLUMNS.rstrip() + ",time[s],load[N]\n"))
    assert run.notes[-1] == "1 row without a number left out (line 9)"
    assert run.size == N - 1


def test_ten_per_cent_is_the_bound(tmp_path: Path) -> None:
    lines = rows()
    for i in range(4):
        lines[3 * i] = "nan,1"
    assert load(tmp_path, text(lines)).size == 36
    lines[20] = "nan,1"
    with pytest.raises(InputError, match=r"5 of 40 rows .* \(lines 4, 7, 10, 13, 24\).* at most 10 %"):
        load(tmp_path, text(lines))


def test_sixteen_samples_are_the_bound(tmp_path: Path) -> None:
    assert load(tmp_path, text(rows(16))).size == 16
    with pytest.raises(InputError, match="15 usable samples; 16 or more"):
        load(tmp_path, text(rows(15)))


def test_gaps_and_repeated_time_stamps_are_noted(tmp_path: Path) -> None:
    clock = [float(i) for i in range(N)]
    clock[10] = clock[9]
    for i in range(20, N):
        clock[i] += 5
    lines = [f"{row},{t:g}" for row, t in zip(rows(), clock, strict=True)]
    run = load(tmp_path, text(lines, columns=COLUMNS.rstrip() + ",time[s]\n"))
    repeated, gap = run.notes
    assert repeated == "1 repeated time stamp (line 14)"
    assert gap.startswith("1 gap in time")
    assert "6 s, after line 23" in gap
    run = load(tmp_path, text(rows()[:10] + rows()[15:]))
    assert run.notes[0].startswith("1 gap in input_angle")
    assert "60 deg, after line 13" in run.notes[0]


@pytest.mark.parametrize("low", [0.0, -180.0])
@pytest.mark.parametrize("sense", [1, -1])
def test_wrapped_angles_are_unwrapped(tmp_path: Path, low: float, sense: int) -> None:
    running = sense * np.arange(200) * 12.0
    wrapped = (running - low) % 360 + low
    word = "forward" if sense > 0 else "reverse"
    lines = [f"{w:g},{r / 100 + 0.01:.6f}" for w, r in zip(wrapped, running, strict=True)]
    run = load(tmp_path, text(lines, head=f"# direction: {word}\n"))
    jumps = np.count_nonzero(np.abs(np.diff(wrapped)) > 180)
    assert jumps >= 6
    assert run.notes == (f"input_angle unwrapped: {jumps} jumps by a turn removed",)
    assert run.input_angle is not None
    np.testing.assert_allclose(np.diff(run.input_angle), math.radians(sense * 12), rtol=1e-9)


def test_a_gap_of_more_than_half_a_turn_is_no_jump(tmp_path: Path) -> None:
    degrees = np.concatenate([np.linspace(0, 100, 51), np.linspace(300, 360, 31)])
    run = load(tmp_path, text([f"{100 * d:.9g},{d:.9g}" for d in degrees]))
    assert run.output_angle is not None
    np.testing.assert_allclose(np.degrees(run.output_angle), degrees, rtol=1e-12)
    assert not any("unwrapped" in note for note in run.notes)


def test_wrapped_angle_too_fast_to_unwrap(tmp_path: Path) -> None:
    lines = [f"{(150.0 * i) % 360:g},{1.5 * i:g}" for i in range(100)]
    with pytest.raises(InputError, match=r"input_angle stays within one turn and moves 150 deg .* counts turns"):
        load(tmp_path, text(lines))


# --- direction --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("head", "sense"), [("# direction: reverse\n", -1), ("# direction: mixed\n", -1), ("", -1)])
def test_direction_of_a_reverse_run(tmp_path: Path, head: str, sense: int) -> None:
    run = load(tmp_path, text(rows(back=True), head=head))
    assert (run.direction == sense).all()
    assert run.notes == (() if head else ("no direction in the header; read from input_angle: reverse",))


def test_direction_of_a_negative_ratio_follows_the_output(tmp_path: Path) -> None:
    """Input up, output down: the nominal output angle falls, so the run is reverse."""
    lines = [f"{10 * i},{-10 * i / 14:.9f}" for i in range(N)]
    assert (load(tmp_path, text(lines, head="# direction: mixed\n")).direction == -1).all()
    assert (load(tmp_path, text(lines, head="# direction: reverse\n"), ratio=-14).direction == -1).all()
    with pytest.raises(InputError, match=r"direction says forward, but the output angle falls .* write reverse"):
        load(tmp_path, text(lines))


def test_input_and_error_alone_need_the_sign_of_the_ratio(tmp_path: Path) -> None:
    content = text([f"{10 * i},3" for i in range(N)], head="", columns="input_angle[deg],te[arcsec]\n")
    run = load(tmp_path, content)
    assert (run.direction == 1).all()
    assert "positive ratio" in run.notes[-1]
    with pytest.raises(InputError, match="runs against the run's direction"):
        run.nominal_angle(-14.0)
    run = load(tmp_path, content, ratio=-14.0)
    assert (run.direction == -1).all()
    np.testing.assert_allclose(run.nominal_angle(-14.0), np.radians(np.arange(N) * -10 / 14), atol=1e-14)
    with pytest.raises(InputError, match="direction says forward"):
        load(tmp_path, HEAD + content, ratio=-14.0)


@given(
    periods=st.integers(1, 5),
    per_leg=st.integers(60, 200),
    noise=st.floats(0, 2),
    seed=st.integers(0, 2**32 - 1),
    first=st.sampled_from([1.0, -1.0]),
)
def test_smooth_direction_finds_the_legs_of_a_jittering_triangle(
    periods: int, per_leg: int, noise: float, seed: int, first: float
) -> None:
    """Truth: the legs of the triangle; noise may move each turning point by its own height at most."""
    legs = np.concatenate([np.full(per_leg, first * (-1) ** k) for k in range(2 * periods)])
    clean = np.concatenate([[0.0], np.cumsum(legs)])
    jitter = np.random.default_rng(seed).uniform(-noise, noise, clean.size)
    found = smooth_direction(clean + jitter, 2 * noise + 5)
    assert np.count_nonzero(np.diff(found)) == 2 * periods - 1
    wrong = np.flatnonzero(found[1:] != legs)
    turns = np.arange(1, 2 * periods) * per_leg
    assert all(np.abs(turns - i).min() <= 2 * noise + 1 for i in wrong)


@given(st.lists(st.floats(-1, 1), min_size=2, max_size=60))
def test_smooth_direction_without_jitter_is_motion_direction(values: list[float]) -> None:
    angle = np.round(np.array(values), 2)
    np.testing.assert_array_equal(smooth_direction(angle, 0.0), motion_direction(angle))


def test_mixed_run_keeps_its_turning_points_apart_from_jitter(tmp_path: Path) -> None:
    t = np.arange(400)
    angle = 90 * np.sin(2 * np.pi * t / 200 - np.pi / 2)
    jitter = 0.4 * (-1.0) ** t
    lines = [f"{100 * a:.6f},{a + j:.6f}" for a, j in zip(angle, jitter, strict=True)]
    run = load(tmp_path, text(lines, head="# direction: mixed\n"))
    np.testing.assert_array_equal(np.flatnonzero(np.diff(run.direction)), [100, 200, 300])


def test_doubled_rows_are_left_out_and_counted(tmp_path: Path) -> None:
    lines = rows()
    run = load(tmp_path, text([*lines[:10], lines[9], *lines[10:20], lines[19], lines[19], *lines[20:]]))
    assert run.notes == ("3 doubled rows left out (lines 14, 25, 26)",)
    np.testing.assert_array_equal(run.input_angle, load(tmp_path, text()).input_angle)
    other = load(tmp_path, text([*lines[:10], "90,0.9101", *lines[10:]]))  # the same angle, another reading
    assert other.size == N + 1
    assert other.notes == ()


@pytest.mark.parametrize("head", [HEAD, "", "# direction: mixed\n"])
def test_two_runs_in_one_file(tmp_path: Path, head: str) -> None:
    with pytest.raises(InputError, match=r"input_angle jumps back by 390 deg .* two runs in one; put each in a file"):
        load(tmp_path, text(rows() + rows(), head=head))
    both_ways = rows() + rows(back=True)
    if head == HEAD:
        with pytest.raises(InputError, match=r"gone back by 390 deg .* since line 43; write 'mixed'"):
            load(tmp_path, text(both_ways, head=head))
    else:
        run = load(tmp_path, text(both_ways, head=head))
        assert np.count_nonzero(np.diff(run.direction)) == 1


def test_a_hole_in_a_run_that_goes_both_ways_is_no_second_run(tmp_path: Path) -> None:
    """Where time has passed too, the angle may have come back meanwhile."""
    lines = [
        f"{x:g},{x / 100:g},{t}"
        for t, x in enumerate(np.tile([*range(0, 400, 10), *range(400, 0, -10)], 2))
        if not 30 < t < 90
    ]
    run = load(tmp_path, text(lines, head="", columns=COLUMNS.rstrip() + ",time[s]\n"))
    assert any(note.startswith("1 gap in time") for note in run.notes)


@pytest.mark.parametrize(("column", "turns"), [(0, 1), (0, -1), (0, 30), (1, 1), (1, -2)])
def test_a_counter_that_jumps_is_noted(tmp_path: Path, column: int, turns: int) -> None:
    cells = [[float(cell) for cell in row.split(",")] for row in rows(200)]
    for row in cells[120:]:
        row[column] += 360 * turns
    run = load(tmp_path, text([",".join(f"{cell:g}" for cell in row) for row in cells]))
    (note,) = run.notes
    name, other = ("input_angle", "output_angle") if column == 0 else ("output_angle", "input_angle")
    assert note == f"{name} jumps by {360 * turns:.4g} deg at line 124, {other} does not: its counter has jumped"
    assert (run.direction == 1).all()
    for row in cells:
        row[0] *= -1
    against = load(tmp_path, text([",".join(f"{cell:g}" for cell in row) for row in cells], head=""))
    assert (against.direction == 1).all()


# --- what is refused --------------------------------------------------------------------------------------------------

BAD: dict[str, tuple[str | bytes, list[str]]] = {
    "empty": ("", ["the file is empty"]),
    "only blank": ("\n \n", ["the file is empty"]),
    "only header": (HEAD, ["no line holds column names", "--draft"]),
    "no rows": (HEAD + COLUMNS, ["line 3", "no rows"]),
    "zero bytes": (b"\x00\x01\x02" * 100, ["no text file", "export"]),
    "not utf-8": (text().encode() + b"# 20 \xb0C\n", ["line 44", "0xb0", "save the file as UTF-8"]),
    "utf-16": (text().encode("utf-16"), ["UTF-16", "save it as UTF-8"]),
    "decimal comma": (with_row(9, "50,0,0,51"), ["line 9", "4 cells", "2 column", "decimal sign"]),
    "few cells": (with_row(17, "130"), ["line 17", "1 cell,", "2 column names", "complete the row"]),
    "many cells": (with_row(17, "130,1.3,5"), ["line 17", "3 cells", "2 column names", "delete the cells"]),
    "no names": ("\n".join(rows()), ["no line holds column names"]),
    "unknown unit": (text().replace("output_angle[deg]", "output_angle[ticks]"),
                     ["line 3, column 2", "output_angle", "'ticks'", "write 'output_angle[deg]'"]),
    "unit of another kind": (text().replace("output_angle[deg]", "output_angle[mm]"),
                             ["line 3, column 2", "'mm'", "angle"]),
    "no unit": (text().replace("input_angle[deg]", "input_angle"),
                ["line 3, column 1", "input_angle has no unit", "write 'input_angle[deg]'"]),
    "empty unit": (text().replace("input_angle[deg]", "input_angle[]"), ["line 3, column 1", "no unit"]),
    "broken brackets": (text().replace("input_angle[deg]", "input_angle[deg"), ["line 3", "there is no input_angle"]),
    "round brackets": (text().replace("input_angle[deg]", "input_angle (deg)"),
                       ["line 3", "did you mean 'input_angle[deg]'"]),
    "misspelt column": (text().replace("output_angle", "outputangle"), ["line 3", "did you mean 'output_angle[deg]'"]),
    "duplicate": (text().replace("output_angle", "input_angle"), ["line 3, column 2", "are both input_angle"]),
    "output only": ("time[s],output_angle[deg]\n" + "1,2\n" * 20,
                    ["line 1", "no input_angle and no te", "give input_angle[deg]"]),
    "error only": ("te[arcsec]\n" + "1\n" * 20, ["no input_angle and no output_angle"]),
    "time only": ("time[s]\n" + "1\n" * 20, ["no line holds column names such as 'input_angle'"]),
    "direction": (text(head="# direction: forwards\n"),
                  ["line 1", "'forwards'", "forward, reverse or mixed", "did you mean 'forward'"]),
    "two directions": (text(head=HEAD + "# direction: reverse\n"), ["line 3", "'reverse'", "line 1", "leave one"]),
    "direction among rows": (text([*rows(20), "# direction: reverse", *rows(20, back=True)]),
                             ["line 24", "among the rows", "file of its own"]),
    "reverse says header": (text(head="# direction: reverse\n"),
                            ["line 1: direction says reverse", "grows", "write forward"]),
    "forward says header": (text(rows(back=True)), ["direction says forward", "falls", "write reverse"]),
    "there and back": (text(rows(60) + rows(30, back=True)),
                       ["line 93", "gone back by 590 deg", "bound 100 deg", "write 'mixed'"]),
    "standstill": (text(["5,0.05"] * 30), ["input_angle does not move", "turning drive"]),
    "torque without unit": (text(head="# output_torque: 20\n"), ["line 1", "output_torque", "'20 N*m'"]),
    "torque of another kind": (text(head="# output_torque: 20 mm\n"), ["line 1", "output_torque", "torque"]),
    "torque of none": (text(head="# output_torque:\n"), ["line 1", "output_torque", "no number"]),
    "temperature without unit": (text(head="# temperature: 20\n"), ["line 1", "temperature", "degC"]),
    "below absolute zero": (text(head="# temperature: -300 degC\n"), ["line 1", "absolute zero", "check"]),
    "time back": (text([f"{row},{abs(i - 10)}" for i, row in enumerate(rows())],
                       columns=COLUMNS.rstrip() + ",time[s]\n"),
                  ["line 5", "time runs back from 10 s to 9 s", "in order"]),
    "time stands": (text([f"{row},7" for row in rows()], columns=COLUMNS.rstrip() + ",time[s]\n"),
                    ["time stands still", "leave the column out"]),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_refused_in_one_line(tmp_path: Path, name: str) -> None:
    content, words = BAD[name]
    with pytest.raises(InputError) as caught:
        load(tmp_path, content)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(str(tmp_path / "run.csv"))
    for word in words:
        assert word in message


def test_paths_that_cannot_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(InputError, match=r"none\.csv: there is no such file; check the path"):
        load_run(tmp_path / "none.csv")
    with pytest.raises(InputError, match="this is a folder; give a file"):
        load_run(tmp_path)
    (tmp_path / "run.csv").write_text(text())
    with pytest.raises(InputError, match="a part of the path is a file"):
        load_run(tmp_path / "run.csv" / "x.csv")
    with pytest.raises(InputError, match="cannot read it"):
        load_run("run\0.csv")

    def denied(self: Path) -> bytes:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_bytes", denied)
    with pytest.raises(InputError, match=r"run\.csv: no permission to read it"):
        load_run(tmp_path / "run.csv")


@given(st.binary(max_size=300))
def test_any_bytes_give_a_run_or_one_line(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    file = tmp_path_factory.mktemp("any") / "run.csv"
    for prefix in (b"", COLUMNS.encode(), text().encode()):
        file.write_bytes(prefix + content)
        message = ""
        try:
            load_run(file)
        except InputError as error:
            message = str(error)
        assert "\n" not in message


@pytest.mark.parametrize(
    ("ratio", "words"),
    [
        (-100.0, "ratio is about 100: change the sign"),
        (1.0, r"the run's ratio is about 100, the model's 1 .* check the units"),
        (0.0, "ratio = 0: must be a finite number other than 0"),
        (math.nan, "must be a finite number"),
    ],
)
def test_ratio_that_contradicts_the_run(tmp_path: Path, ratio: float, words: str) -> None:
    with pytest.raises(InputError, match=words):
        load(tmp_path, text()).error(ratio)
    with pytest.raises(InputError, match=words):
        load(tmp_path, text(), ratio=ratio)
    angle = np.linspace(0.0, 1.0, N)
    loaded = run_from_arrays(input_angle=100 * angle, output_angle=angle, direction=1.0, torque=1e4 * (1 + angle))
    with pytest.raises(InputError, match=words) as refused:
        loaded.torque_waves(ratio)
    assert str(refused.value).count("run: ") <= 1


def test_misspelt_header_key_is_kept_and_noted(tmp_path: Path) -> None:
    run = load(tmp_path, text(head="# direction: forward\n# output_torqe: 20 N*m\n"))
    assert run.torque is None
    assert run.metadata["output_torqe"] == "20 N*m"
    assert "line 2" in run.notes[0]
    assert "did you mean 'output_torque'" in run.notes[0]


# --- in memory --------------------------------------------------------------------------------------------------------


def test_quantities_are_converted() -> None:
    ureg = pint.UnitRegistry()
    degrees = np.arange(N, dtype=float)
    run = run_from_arrays(
        input_angle=ureg.Quantity(100 * degrees, "deg"),
        output_angle=ureg.Quantity(degrees / 360, "turn"),
        time=ureg.Quantity(degrees, "ms"),
        torque=ureg.Quantity(-20, "N*m"),
        temperature="20 degC",
        direction="forward",
        index="A",
        metadata={"bench": "north"},
    )
    assert run.torque == pytest.approx(20e3)
    assert run.temperature == pytest.approx(293.15)
    assert (run.path, run.index, run.metadata) == ("", "A", {"bench": "north"})
    np.testing.assert_allclose(run.error(100), 0, atol=1e-14)
    assert run.time is not None
    assert run.time[-1] == pytest.approx((N - 1) / 1000)


GOOD = {"input_angle": np.arange(N) * 1.0, "output_angle": np.arange(N) / 100}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"output_angle": None}, "besides input_angle there is no output_angle and no te"),
        ({"output_angle": np.arange(5.0)}, "differ in length .*input_angle 40, output_angle 5"),
        ({"torque_record": np.zeros(3)}, "differ in length"),
        ({"output_angle": np.zeros((N, 1))}, "shape"),
        ({"output_angle": ["a"] * N}, "output_angle holds something that is no number"),
        ({"output_angle": pint.UnitRegistry().Quantity(np.arange(N), "mm")}, "output_angle: .*angle"),
        ({"output_angle": np.full(N, np.nan)}, "40 of 40 rows .*samples 0, 1, 2, 3, 4, ..."),
        ({"direction": "sideways"}, "direction = 'sideways'"),
        ({"direction": 2}, r"direction = 2"),
        ({"direction": 0}, r"direction = 0"),
        ({"direction": -1}, "direction says reverse"),
        ({"torque": "20"}, "torque: .*no unit"),
        ({"temperature": -1.0}, "absolute zero"),
        ({"time": np.arange(N)[::-1]}, "sample 1: time runs back"),
    ],
)  # fmt: skip
def test_arrays_are_checked_like_files(change: dict[str, object], words: str) -> None:
    with pytest.raises(InputError, match=words) as caught:
        run_from_arrays(**(GOOD | change))  # type: ignore[arg-type]
    assert str(caught.value).startswith("run: ")


def test_arrays_lose_single_bad_samples_and_are_not_changed() -> None:
    inputs = GOOD["input_angle"].copy()
    inputs[3] = np.nan
    run = run_from_arrays(input_angle=inputs, output_angle=GOOD["output_angle"], direction=1)
    assert run.size == N - 1
    assert run.notes[0] == "1 row without a number left out (sample 3)"
    assert np.isnan(inputs[3])


def test_run_pickles() -> None:
    run = run_from_arrays(**GOOD, metadata={"a": "b"})
    copy = pickle.loads(pickle.dumps(run))
    np.testing.assert_array_equal(copy.input_angle, run.input_angle)
    assert copy.metadata == run.metadata


# --- what is written --------------------------------------------------------------------------------------------------

WORDS = st.text(st.characters(codec="ascii", categories=("L", "N")), min_size=1, max_size=12)


@given(
    seed=st.integers(0, 2**32 - 1),
    n=st.integers(16, 60),
    ratio=st.floats(1, 300),
    sense=st.sampled_from([1, -1, 0]),
    torque=st.none() | st.floats(0, 1e7),
    temperature=st.none() | st.floats(200, 400),
    index=st.sampled_from(["", "unknown", "A"]),
    value=WORDS,
    clock=st.booleans(),
    columns=st.sampled_from(["angles", "input", "output"]),
)
def test_written_run_reads_back(
    tmp_path_factory: pytest.TempPathFactory,
    seed: int, n: int, ratio: float, sense: int, torque: float | None, temperature: float | None, index: str,
    value: str, clock: bool, columns: str,
) -> None:  # fmt: skip
    rng = np.random.default_rng(seed)
    theta = np.cumsum(rng.uniform(0.1, 0.2, n)) * (sense or 1)
    te = rng.normal(size=n) * 1e-5
    given = {
        "angles": {"input_angle": theta * ratio, "output_angle": theta + te},
        "input": {"input_angle": theta * ratio, "te": te},
        "output": {"output_angle": theta + te, "te": te},
    }[columns]
    run = run_from_arrays(
        **given,
        direction=sense or "mixed",
        time=np.cumsum(rng.uniform(0.1, 0.2, n)) if clock else None,
        torque=torque,
        temperature=temperature,
        index=index,
        metadata={"Bench no": value},
    )  # type: ignore[arg-type]
    file = tmp_path_factory.mktemp("runs") / "run.csv"
    write_run(file, run, comments=["made by a test", "two\nlines"])
    back = load_run(file, ratio)
    np.testing.assert_allclose(back.error(ratio), run.error(ratio), atol=2e-13 * ratio)
    np.testing.assert_allclose(back.nominal_angle(ratio), run.nominal_angle(ratio), rtol=1e-13, atol=1e-13)
    np.testing.assert_array_equal(back.direction, run.direction)
    assert (back.time is None) == (run.time is None)
    assert back.index == run.index
    assert back.metadata["Bench no"] == value
    for got, wanted in ((back.torque, run.torque), (back.temperature, run.temperature)):
        assert got == (None if wanted is None else pytest.approx(wanted, rel=1e-11, abs=1e-12))


def test_written_in_the_units_of_the_design(tmp_path: Path) -> None:
    file = tmp_path / "out.csv"
    write_run(file, load(tmp_path, "# temperature: 20 degC\n" + text()), comments=["from a test"])
    assert file.read_text().split("\n")[:7] == [
        "# from a test",
        "# direction: forward",
        "# output_torque: 20 N*m",
        "# temperature: 20 degC",
        "input_angle[deg],output_angle[deg]",
        "0,0.01",
        "10,0.11",
    ]


def test_existing_file_stays_unless_overwriting_is_allowed(tmp_path: Path) -> None:
    run = run_from_arrays(**GOOD)
    file = tmp_path / "out.csv"
    file.write_text("precious")
    with pytest.raises(InputError, match=r"out\.csv: the file exists; choose another name"):
        write_run(file, run)
    assert file.read_text() == "precious"
    write_run(file, run, overwrite=True)
    assert load_run(file).size == N
    assert os.listdir(tmp_path) == ["out.csv"]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"comments": ["direction: forward"]}, "would be read as a header key"),
        ({"metadata": {"a": "b\nc"}}, "would not read back"),
        ({"metadata": {"a: b": "c"}}, "would not read back"),
        ({"metadata": {"": "c"}}, "would not read back"),
        ({"index": "a\n1,2"}, "would not read back"),
    ],
)  # fmt: skip
def test_what_would_not_read_back_is_not_written(tmp_path: Path, change: dict[str, object], words: str) -> None:
    comments = change.pop("comments", ())
    run = run_from_arrays(**(GOOD | change))  # type: ignore[arg-type]
    with pytest.raises(InputError, match=words):
        write_run(tmp_path / "out.csv", run, comments=comments)  # type: ignore[arg-type]
    assert os.listdir(tmp_path) == []


# --- text files -------------------------------------------------------------------------------------------------------


def test_failed_write_leaves_the_old_file_and_no_litter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "a.txt"
    write_file(file, "old", overwrite=False)

    def full(self: Path, target: Path) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(InputError, match=r"a\.txt: cannot write it \(No space left on device\)"):
        write_file(file, "new", overwrite=True)
    assert read_text(file) == "old"
    assert os.listdir(tmp_path) == ["a.txt"]


def test_places_that_cannot_be_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder; make it first"):
        write_file(tmp_path / "none" / "a.txt", "x", overwrite=False)
    with pytest.raises(InputError, match="this is a folder"):
        write_file(tmp_path, "x", overwrite=True)
    with pytest.raises(InputError, match="no UTF-8"):
        write_file(tmp_path / "a.txt", "\ud800", overwrite=False)
    assert os.listdir(tmp_path) == []


def test_overwriting_follows_links_and_keeps_the_mode(tmp_path: Path) -> None:
    file, link = tmp_path / "a.txt", tmp_path / "link.txt"
    file.write_text("old")
    file.chmod(0o640)
    link.symlink_to(file)
    write_file(link, "new", overwrite=True)
    assert link.is_symlink()
    assert file.read_text() == "new"
    assert file.stat().st_mode & 0o777 == 0o640


def test_lines_are_those_of_an_editor() -> None:
    assert split_lines("a\r\nb\rc\nd\x0be\u2028f") == ["a", "b", "c", "d\x0be\u2028f"]


# --- speed and the data at hand ---------------------------------------------------------------------------------------


def test_a_hundred_thousand_rows_are_read_in_half_a_second(tmp_path: Path) -> None:
    n = 100_000
    theta = np.linspace(0, 100, n)
    run = run_from_arrays(input_angle=121 * theta, output_angle=theta + 1e-5 * np.sin(theta), direction="forward")
    file = tmp_path / "long.csv"
    write_run(file, run)
    best = math.inf
    for _ in range(3):  # the machine may be busy
        start = time.process_time()
        assert load_run(file).size == n
        best = min(best, time.process_time() - start)
    assert best < 0.5


@pytest.mark.parametrize("unit", range(1, 7))
@pytest.mark.parametrize("way", ["forward", "reverse"])
def test_bench_runs(unit: int, way: str) -> None:
    run = load_run(bench(f"train-{unit}", f"{way}.csv"), reducer("RV-40E"))
    assert run.size == 3 * 2048
    assert run.notes == ()
    assert run.torque == pytest.approx(20e3)
    assert run.temperature == pytest.approx(293.15)
    assert (run.direction == (1 if way == "forward" else -1)).all()
    error = run.error(121)
    assert np.ptp(error) < 120 * ARCSEC
    assert np.ptp(run.nominal_angle(121)) == pytest.approx(3 * math.tau, rel=1e-3)


def test_planetary_data() -> None:
    """The known facts: ratio about -13.16, residual about 7.3 arcmin with it, ten periods of 2 s, repeated rows."""
    run = load_run(recording("planetary-14to1", "run.csv"), Drive(ratio=-14.0))
    assert run.torque == 0
    assert any("20 repeated time stamps" in note for note in run.notes)
    assert run.time is not None
    assert np.count_nonzero(np.diff(run.direction)) == pytest.approx(np.ptp(run.time), abs=1)  # two reversals in 2 s
    slope = np.polyfit(run.nominal_angle(-14.0), run.error(-14.0), 1)[0]
    assert -14 / (1 + slope) == pytest.approx(-13.16, abs=0.02)
    true = run.error(-14 / (1 + slope))
    assert np.std(true) / ARCSEC / 60 == pytest.approx(7.3, rel=0.05)
    with pytest.raises(InputError, match="change the sign of the ratio"):
        run.error(14.0)


@pytest.mark.parametrize(("wheel", "period", "turns"), [(225, 382.95, 5.7), (360, 239.34, 6.6)])
def test_worm_data(wheel: int, period: float, turns: float) -> None:
    run = load_run(recording(f"worm-{wheel}", "run.csv"), Drive(ratio=float(wheel)))
    assert (run.direction == 1).all()
    assert run.metadata["reference"] == "star"
    assert run.time is not None
    assert run.input_angle is not None
    assert np.ptp(run.input_angle) / math.tau == pytest.approx(turns, abs=0.05)
    speed = np.polyfit(run.time, run.input_angle, 1)[0]
    assert math.tau / speed == pytest.approx(period, rel=1e-4)


def test_cycloidal_data_are_a_torque_record() -> None:
    """One angle and a torque: no transmission error can be had from it."""
    run = load_run(recording("cycloidal-13to1", "run.csv"))
    assert run.input_angle is None
    assert run.te_column is None
    with pytest.raises(InputError, match=r"torque record holds one angle.*only a \[drive\] model"):
        run.error(13.0)


@pytest.mark.parametrize(
    ("key", "size", "words"),
    [
        ("sensor.time_offset", {"offset": "1 ms"}, "a time.s. column; add it to the file"),
        ("load.torsion", {"compliance": 1e-9}, "the output_torque; add it to the file"),
        (
            "involute.spline_clearance",
            {"crank": 0, "clearance": "20 um"},
            "the reducer's spline_radius; add it to the model",
        ),
    ],
)
def test_what_a_declared_effect_lacks_is_asked_for_where_it_belongs(key: str, size: dict[str, Any], words: str) -> None:
    unit = rverror.Model(rverror.reducer("RV-40E", spline_radius=None), (rverror.effect(key, **size),))
    run = rverror.run_from_arrays(input_angle=121 * np.linspace(0, 1, 64), te=np.zeros(64))
    with pytest.raises(InputError, match=f"one.csv: {key} needs {words} or remove the effect"):
        run.check_effects(unit, "one.csv")
