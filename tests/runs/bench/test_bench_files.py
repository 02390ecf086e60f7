"""Files of benches: the same run through every format, what is found and noted, what is refused, hostile files."""

from __future__ import annotations

import io
import math
import os
import sys
import warnings
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import numpy as np
import pytest
import scipy.io
from hypothesis import given, strategies as st
from nptdms import ChannelObject

from bench_files import INPUT, OUTPUT, RATIO, TE, THETA, TIME, N, hdf5, mat, tdms
from rverror.base.errors import InputError
from rverror.runs.bench import binary as bench_binary, columns as bench_columns
from rverror.runs.bench.draft import draft_mapping
from rverror.runs.bench.mapping import BenchMapping, load_mapping
from rverror.runs.measurement import Run, load_run, run_from_arrays, run_text

TORQUE = 20 + 0.5 * np.sin(THETA)

MAPPING = """
[columns]
input_angle = { name = "in", unit = "deg" }
output_angle = { name = "out", unit = "deg" }
"""


def write(folder: Path, name: str, content: str | bytes) -> Path:
    file = folder / name
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    return file


def load(file: Path, mapping: str = MAPPING, **keywords: Any) -> Run:
    return load_run(file, mapping=write(file.parent, "bench.toml", mapping), **keywords)


def standard(folder: Path) -> Run:
    """The same run from a run file."""
    rows = "\n".join(f"{a!r},{b!r}" for a, b in zip(INPUT.tolist(), OUTPUT.tolist(), strict=True))
    return load_run(write(folder, "standard.csv", f"input_angle[deg],output_angle[deg]\n{rows}\n"))


def same(run: Run, other: Run, *, rtol: float = 1e-12, atol: float = 1e-12) -> None:
    for name in ("input_angle", "output_angle"):
        np.testing.assert_allclose(getattr(run, name), getattr(other, name), rtol=rtol, atol=atol)
    np.testing.assert_array_equal(run.direction, other.direction)


def refusal(call: Any, *words: str) -> str:
    with pytest.raises(InputError) as caught:
        call()
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message
    return message


@pytest.fixture
def mat_in_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """MAT files are read by the same lines in this process; that one of their own bears damage is tested below."""

    def run(command: list[str], **_: Any) -> SimpleNamespace:
        *_, code, path = command
        with io.BytesIO() as out, warnings.catch_warnings(), monkeypatch.context() as patch:
            patch.setattr(sys, "argv", ["-c", path])
            patch.setattr(sys, "stdout", SimpleNamespace(buffer=out))
            exec(code, {})
            return SimpleNamespace(returncode=0, stdout=out.getvalue())

    monkeypatch.setattr(bench_binary, "subprocess", SimpleNamespace(run=run))


def columns(rows: int = N, *, separator: str = ";", names: str = "in;out", decimal: str = ",") -> str:
    body = "\n".join(f"{a:.12f}{separator}{b:.12f}" for a, b in zip(INPUT[:rows], OUTPUT[:rows], strict=True))
    return names + "\n" + body.replace(".", decimal) + "\n"


# --- the same run through every format --------------------------------------------------------------------------------

UNITS = {"deg": 1.0, "turn": 1 / 360, "arcmin": 60.0, "mrad": math.pi / 180 * 1000}


@given(
    separator=st.sampled_from([";", ",", "\t", "|", " "]),
    decimal=st.sampled_from([".", ","]),
    signs=st.tuples(*[st.sampled_from([1, -1])] * 2),
    unit=st.sampled_from(sorted(UNITS)),
    encoding=st.sampled_from(["", "utf-8", "cp1252", "latin-1", "utf-16", "utf-8-sig"]),
    preamble=st.lists(st.sampled_from(["Prüfstand: 3", "Datum;1.2.2026;;", "", "# Rem, ark", "1;2"]), max_size=5),
    end=st.sampled_from(["\n", "\r\n", "\r"]),
    stated=st.booleans(),
    trailing=st.booleans(),
    units_row=st.booleans(),
)
def test_text_of_any_make(
    tmp_path_factory: pytest.TempPathFactory, separator: str, decimal: str, signs: tuple[int, int],
    unit: str, encoding: str, preamble: list[str], end: str, stated: bool, trailing: bool, units_row: bool,
) -> None:  # fmt: skip
    """Whatever the clothes: if it is read, it is the run of the standard file."""
    folder = tmp_path_factory.mktemp("text")
    quoted = separator == decimal
    if separator == " ":
        preamble = [line.replace(" ", "") for line in preamble]

    def cell(value: float) -> str:
        text = f"{value:.9f}".replace(".", decimal)
        return f'"{text}"' if quoted else text

    names = ["t", "Antrieb [°]", "Abtrieb [°]", "Öl"]
    if separator == " ":
        names = [name.replace(" ", "") for name in names]
    table = [names] + ([["s", "unit.", "unit,", ""]] if units_row and separator not in (",", " ") else [])
    factor = UNITS[unit]
    for i in range(N):
        values = [TIME[i], signs[0] * INPUT[i] * factor, signs[1] * OUTPUT[i] * factor, 40.0]
        table.append([cell(value) for value in values])
    lines = [*preamble, *(separator.join(row) + (separator if trailing and separator != " " else "") for row in table)]
    content = end.join(lines)
    file = folder / "run.txt"
    file.write_bytes(content.encode(encoding or "utf-8"))
    keys = [f'encoding = "{encoding}"'] if encoding not in ("", "utf-8-sig") else []
    keys += [f"separator = '{separator}'"] if stated or separator == " " else []
    keys += [f"decimal = '{decimal}'"] if stated else []
    mapping = "\n".join(
        [
            "[file]",
            *keys,
            "[columns]",
            f'input_angle = {{ name = "{names[1]}", unit = "{unit}", scale = 1, sign = {signs[0]} }}',
            f'output_angle = {{ name = "{names[2]}", unit = "{unit}", scale = 1, sign = {signs[1]} }}',
        ]
    )
    run = load(file, mapping)
    same(run, standard(folder), atol=1e-8)
    assert run.size == N
    assert any("left out (line" in note for note in run.notes) == (units_row and separator not in (",", " "))
    assert any("2 columns of the file left out" in note for note in run.notes)


def variants(folder: Path, kind: str) -> tuple[Path, str]:
    """One file of a kind, with the mapping that it needs."""
    column = {"in": INPUT[:, None], "out": OUTPUT[:, None]}
    table = np.zeros(N, dtype=[("in", "f8"), ("out", ">f8"), ("name", "S3")])
    table["in"], table["out"] = INPUT, OUTPUT
    file = folder / f"run.{kind.partition(' ')[0]}"
    match kind:
        case "mat rows":
            return mat(folder), MAPPING
        case "mat columns":
            return mat(folder, **column), MAPPING
        case "mat compressed":
            return mat(folder, keywords={"do_compression": True}), MAPPING
        case "mat 4":
            return mat(folder, keywords={"format": "4"}), MAPPING
        case "mat structure":
            scipy.io.savemat(file, {"run": {"a": {"in": INPUT, "out": OUTPUT[:, None]}, "who": "x"}})
            return file, MAPPING.replace('"in"', '"run/a/in"').replace('"out"', '"/run/a/out"')
        case "mat 7.3":  # as MATLAB writes it: a header of its own before the HDF5
            with h5py.File(file, "w", userblock_size=512) as out:
                for key, values in (("in", INPUT[None, :]), ("out", OUTPUT[None, :])):
                    out.create_dataset(key, data=values).attrs["MATLAB_class"] = np.bytes_("double")
                out.create_group("#refs#")["a"] = 1.0
            header = b"MATLAB 7.3 MAT-file, Platform: X".ljust(124) + b"\x00\x02IM"
            file.write_bytes(header.ljust(512, b"\0") + file.read_bytes()[512:])
            return file, MAPPING
        case "h5 groups":
            return hdf5(folder, **{"m/1/in2": INPUT, "m/1/out2": OUTPUT[:, None]}), (
                '[file]\ngroup = "m/1"' + MAPPING.replace('"in"', '"in2"').replace('"out"', '"out2"')
            )
        case "h5 bare names":
            with h5py.File(file, "w") as out:
                out["m/in"], out["k/out"] = INPUT, OUTPUT
            return file, MAPPING
        case "h5 table":
            with h5py.File(file, "w") as out:
                out["run/table"] = table
            return file, '[file]\ngroup = "run/table"' + MAPPING
        case "h5 chunks":
            with h5py.File(file, "w") as out:
                for key, values in (("in", INPUT), ("out", OUTPUT)):
                    out.create_dataset(key, data=values, chunks=(17,), compression="gzip", shuffle=True)
            return file, MAPPING
        case "tdms":
            return tdms(folder), MAPPING
        case "tdms segments":
            return tdms(folder, segments=4), '[file]\ngroup = "G"' + MAPPING
        case "tdms odd names":
            channels = ChannelObject("Gruppe / 1", "in / °", INPUT), ChannelObject("Gruppe / 1", "out", OUTPUT)
            return tdms(folder, *channels), MAPPING.replace('"in"', '"Gruppe / 1/in / °"')
        case _:  # the name says nothing, the content does
            return hdf5(folder, "run.csv"), MAPPING


KINDS = [
    "mat rows", "mat columns", "mat compressed", "mat 4", "mat structure", "mat 7.3", "h5 groups", "h5 bare names",
    "h5 table", "h5 chunks", "tdms", "tdms segments", "tdms odd names", "csv that is none",
]  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_run_through_every_format(tmp_path: Path, kind: str) -> None:
    file, mapping = variants(tmp_path, kind)
    run = load(file, mapping)
    same(run, standard(tmp_path), rtol=1e-14)
    assert not any("#" in note for note in run.notes)  # what MATLAB keeps for itself is no column


@pytest.mark.parametrize("kind", ["mat", "h5", "tdms"])
def test_integers_and_single_precision(tmp_path: Path, kind: str) -> None:
    counts = np.round(INPUT * 1e4 / 360)
    data = {"in": counts.astype(np.int32), "out": OUTPUT.astype(np.float32)}
    channels = [ChannelObject("G", key, values) for key, values in data.items()]
    file = {"mat": lambda: mat(tmp_path, **data), "h5": lambda: hdf5(tmp_path, **data),
            "tdms": lambda: tdms(tmp_path, *channels)}[kind]()  # fmt: skip
    run = load(file, MAPPING.replace('unit = "deg" }', 'unit = "counts", counts_per_turn = 10000 }', 1))
    np.testing.assert_allclose(run.input_angle, counts / 1e4 * math.tau, rtol=1e-15)
    assert "one count of input_angle is 0.036 deg" in run.notes


def test_names_of_a_run_file_need_no_mapping(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "run.h5", "w") as out:
        out["input_angle[deg]"] = INPUT
        out["Output_angle"] = np.radians(OUTPUT)
        out["Output_angle"].attrs["Units"] = "rad"
        out["time"] = TIME * 1000
        out["time"].attrs["unit"] = b"ms"
        out.attrs.update({"direction": "Forward", "output_torque": "20 N*m", "index": "A"})
    run = load_run(tmp_path / "run.h5")
    same(run, standard(tmp_path))
    np.testing.assert_allclose(run.time, TIME, atol=1e-15)
    assert (run.torque, run.index, run.notes) == (pytest.approx(20e3), "A", ())
    assert run.metadata == {"direction": "Forward", "output_torque": "20 N*m", "index": "A"}

    file = tdms(
        tmp_path,
        ChannelObject("G", "input_angle", INPUT, {"unit_string": "deg"}),
        ChannelObject("G", "output_angle", OUTPUT, {"unit_string": "deg"}),
    )
    same(load_run(file), standard(tmp_path))
    text = "# direction: forward\n# temperature: 20 degC\n" + columns(names="input_angle[deg];output_angle[deg]")
    run = load(write(tmp_path, "run.txt", text), "[file]\nseparator = ';'\n")
    same(run, standard(tmp_path), atol=1e-9)
    assert run.temperature == pytest.approx(293.15)
    assert run.notes == ("decimal sign found in the rows: ','",)


def test_a_mapping_may_be_given_as_read(tmp_path: Path) -> None:
    mapping = load_mapping(write(tmp_path, "bench.toml", MAPPING))
    assert isinstance(mapping, BenchMapping)
    same(load_run(hdf5(tmp_path), RATIO, mapping), standard(tmp_path), rtol=1e-14)


@pytest.mark.usefixtures("mat_in_process")
def test_error_columns_and_the_ratio(tmp_path: Path) -> None:
    file = mat(tmp_path, te=np.degrees(TE) * 3600)
    mapping = MAPPING.replace("output_angle", "te").replace('"out", unit = "deg"', '"te", unit = "arcsec"')
    run = load(file, mapping, ratio=RATIO)
    np.testing.assert_allclose(run.error(RATIO), TE, rtol=1e-12)
    refusal(lambda: load(file, ratio=1.0), "ratio is about 121", "check the units")


# --- text: what is found and noted ------------------------------------------------------------------------------------


def test_notes_of_a_german_file(tmp_path: Path) -> None:
    text = "Prüfstand 3\n\n" + columns(names="Antrieb [°];Abtrieb [°]")
    mapping = '[file]\nencoding = "cp1252"\n[columns]\ninput_angle = "Antrieb [°]"\noutput_angle = "Abtrieb [°]"\n'
    run = load(write(tmp_path, "run.csv", text.encode("cp1252")), mapping)
    assert run.notes == (
        "separator found in line 3: semicolon",
        "column names found in line 3; what stands above is the preamble",
        "decimal sign found in the rows: ','",
        "unit of input_angle taken from the file: °",
        "unit of output_angle taken from the file: °",
        "no direction in the header; read from input_angle: forward",
    )


def test_columns_by_number(tmp_path: Path) -> None:
    mapping = (
        "[file]\nseparator = ';'\n[columns]\ninput_angle = { column = 1, unit = 'deg' }\n"
        "output_angle = { column = 2, unit = 'deg' }\n"
    )
    same(load(write(tmp_path, "run.txt", columns().partition("\n")[2]), mapping), standard(tmp_path), atol=1e-9)
    run = load(write(tmp_path, "run.txt", columns()), mapping)  # the names are a row without numbers
    assert "1 row without a number left out (line 1)" in run.notes
    file = write(tmp_path, "run.txt", "made by: 1;2\n" + columns().partition("\n")[2])
    same(load(file, mapping.replace("[columns]", "skip = 1\n[columns]")), standard(tmp_path), atol=1e-9)
    refusal(lambda: load(file, mapping.replace("column = 2", "column = 3")), "no column 3", "line 5", "2 cells")
    refusal(lambda: load(file, mapping.replace("separator = ';'", "")), "need the separator", 'separator = ";"')


def test_skip_chooses_among_lines_of_names(tmp_path: Path) -> None:
    file = write(tmp_path, "run.txt", "in;out\n1,5;2,5\n\n" + columns())
    run = load(file, "[file]\nskip = 2\n" + MAPPING)
    same(run, standard(tmp_path), atol=1e-9)
    refusal(lambda: load(file, "[file]\nskip = 1\n" + MAPPING), "no line holds column names such as 'in'")
    refusal(lambda: load(file, "[file]\nskip = 999\n" + MAPPING), "skip = 999", "correct skip")


def test_rows_that_are_short_or_blank_or_words(tmp_path: Path) -> None:
    lines = columns().split("\n")
    lines[5], lines[9], lines[12] = "12,5", "word;1,5", "# a remark"
    lines.insert(20, "")
    run = load(write(tmp_path, "run.txt", "\n".join(lines)))
    assert "2 rows without a number left out (lines 6, 10)" in run.notes
    assert run.size == N - 3


def test_comment_sign_before_the_names(tmp_path: Path) -> None:
    same(load(write(tmp_path, "run.txt", "# " + columns())), standard(tmp_path), atol=1e-9)


TEXTS = {
    "empty": ("\n \n", "", ["file is empty"]),
    "no rows": ("in;out\n", "", ["line 1: no rows"]),
    "unknown bytes": (b"in;out\n1;2\n\xb0\n", "", ["line 3: byte 0xb0 is no UTF-8", 'encoding = "cp1252"']),
    "wrong encoding": (b"in;out\n\x81\n", 'encoding = "cp1252"',
                       ["line 2: byte 0x81 is no cp1252", "correct encoding"]),
    "utf-16": (columns().encode("utf-16"), "", ["UTF-16", 'encoding = "utf-16"']),
    "binary": (b"\0\1\2" * 50, "", ["no text file", "MAT, HDF5 or TDMS"]),
    "misspelt": (columns(names="in;aut"), "",
                 ["line 1: there is no column 'out'", "did you mean 'aut'", "'in', 'aut'"]),
    "misspelt both": (columns(names="ins;outs"), "", ["line 1: there is no column 'in'"]),
    "strange": ("a;b\n1;2\n", "", ["no line holds column names such as 'in'", "tried: semicolon, tab, comma, bar"]),
    "wrong separator": (columns(), 'separator = "\\t"', ["line 1: there is no column 'in'", "the names are 'in;out'"]),
    "twice": (columns(names="in;out;in"), "", ["line 1: 'in' names columns 1, 3", "column = 1"]),
    "too many cells": (columns().replace("\n", ";1\n").replace("out;1", "out"), "", ["line 2: 3 cells, but 2"]),
    "comma and comma": (columns(separator=",", names="in,out"), "", ["line 2: 4 cells", "with ';' between"]),
    "open sign": ("in;out\n" + "1,234;2,345\n" * 20, "", ["line 2, column 1: '1,234' may be 1.234 or 1234", "decimal"]),
    "open in quotes": ('in,out\n' + '"1,234","2,345"\n' * 20, "", ["'1,234' may be", "decimal = '.' or ','"]),
    "both signs": ("in;out\n1,5;2.25\n", "", ["line 2, column 2: '2.25' holds '.', cells before it ','"]),
    "grouped": ("in;out\n1.234,5;2\n", "", ["line 2, column 1", "holds a point and a comma", "between thousands"]),
    "points in a comma file": (columns(decimal="."), "decimal = ','",
                               ["line 2, column 1", "is no number", "correct decimal", "now ','"]),
    "commas in a point file": (columns(), "decimal = '.'", ["is no number", "now '.'"]),
    "words": ("in;out\n" + "12 h 3;1\n" * 20, "",
              ["line 2, column 1: '12 h 3' is no number, nor is any cell of 'in'"]),
    "time of day for an angle": ("in;out\n" + "12:03:45;1\n" * 20, "",
                                 ["input_angle ('in') holds time stamps; only time"]),
    "time of day among few": ("in;out\n" + "1;x\n" * 5 + "1;2\n" * 20, "", ["5 of 25 rows", "lines 2, 3, 4"]),
}  # fmt: skip


@pytest.mark.parametrize("name", TEXTS)
def test_text_refused_in_one_line(tmp_path: Path, name: str) -> None:
    content, keys, words = TEXTS[name]
    file = write(tmp_path, "run.csv", content)
    message = refusal(lambda: load(file, f"[file]\n{keys}\n" + MAPPING), *words)
    assert message.startswith(str(file))


def test_both_separators_fit(tmp_path: Path) -> None:
    """One name alone fits any separator that is not in it; two that each split the line are asked for."""
    text = "in;a,in\n1;2\n"
    mapping = "[columns]\ninput_angle = { name = 'in', unit = 'deg' }\ntorque = { name = 'in', unit = 'N*m' }\n"
    refusal(lambda: load(write(tmp_path, "run.csv", text), mapping), "line 1: semicolon and comma both separate")


def test_a_text_without_mapping_says_how_to_write_one(tmp_path: Path) -> None:
    file = write(tmp_path, "run.csv", columns())
    refusal(lambda: load_run(file), "no line holds column names", "--draft")
    refusal(lambda: load_run(write(tmp_path, "run.csv", "Öl".encode("cp1252"))), "no UTF-8", "--draft")
    refusal(lambda: load_run(write(tmp_path, "run.csv", "te[deg],b\n1,2\n")), "no input_angle", "--draft")


# --- columns that are none --------------------------------------------------------------------------------------------

NO_COLUMNS: dict[str, tuple[Any, str]] = {
    "matrix": (np.zeros((N, N)), "is a matrix of 240 x 240; store a channel in each column"),
    "empty": (np.zeros((0,)), "is empty"),
    "complex": (OUTPUT + 1j, "holds complex numbers"),
    "flags": (OUTPUT > 1, "holds true and false"),
}


@pytest.mark.parametrize(
    ("kind", "name"),
    # a channel of TDMS has one dimension, and scipy reads flags of MATLAB as 0 and 1
    [
        (kind, name)
        for kind in ("mat", "h5", "tdms")
        for name in NO_COLUMNS
        if (kind, name) not in (("tdms", "matrix"), ("mat", "flags"))
    ],
)
def test_no_column(tmp_path: Path, kind: str, name: str) -> None:
    values, words = NO_COLUMNS[name]
    file = {
        "mat": lambda: mat(tmp_path, out=values),
        "h5": lambda: hdf5(tmp_path, out=values),
        "tdms": lambda: tdms(tmp_path, ChannelObject("G", "in", INPUT), ChannelObject("G", "out", values)),
    }[kind]()
    seen_on_listing = (kind, name) != ("mat", "complex")
    message = refusal(lambda: load(file), words, "out'", *(["line 4"] if seen_on_listing else []))
    assert message.startswith(f"{file}: ")


MATRIX = np.column_stack([TIME, INPUT, OUTPUT])
BY_NUMBER = """
[columns]
time = { column = 1, unit = "s" }
input_angle = { column = 2, unit = "deg" }
output_angle = { column = 3, unit = "deg" }
"""


def matrix_file(folder: Path, kind: str, **more: Any) -> Path:
    """A matrix with a channel in each column, as each format has it."""
    file = folder / f"run.{kind.partition(' ')[0]}"
    if kind == "h5":
        with h5py.File(file, "w") as out:
            for key, values in ({"data": MATRIX} | more).items():
                out[key] = values
    elif kind == "mat 7.3":  # MATLAB stores a matrix column by column
        with h5py.File(file, "w", userblock_size=512) as out:
            for key, values in ({"data": MATRIX} | more).items():
                out[key] = np.asarray(values).T
                out[key].attrs["MATLAB_class"] = np.bytes_("double")
        raw = file.read_bytes()
        file.write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + raw[128:])
    else:
        scipy.io.savemat(file, {"data": MATRIX} | more, format="4" if kind == "mat 4" else "5")
    return file


@pytest.mark.usefixtures("mat_in_process")
@pytest.mark.parametrize("kind", ["mat", "mat 4", "mat 7.3", "h5"])
def test_matrix_with_a_channel_in_each_column(tmp_path: Path, kind: str) -> None:
    file = matrix_file(tmp_path, kind, note=np.zeros((4, 4)))
    run = load(file, BY_NUMBER)
    same(run, standard(tmp_path))
    np.testing.assert_allclose(run.time, TIME, rtol=1e-12)
    named = MAPPING.replace('"in"', '"data/2"').replace('"out"', '"data/3"')
    same(load(file, named), standard(tmp_path))
    file = matrix_file(tmp_path, kind, other=MATRIX[:, ::-1])
    refusal(lambda: load(file, BY_NUMBER), "column 1 (mapping", "may be 'data/1' or 'other/1'", "in full")
    same(load(file, '[file]\ngroup = "data"\n' + BY_NUMBER), standard(tmp_path))
    refusal(lambda: load(file, MAPPING.replace('"in"', '"data"')), "'data'", "holds 'data/1', 'data/2', 'data/3'")
    file = matrix_file(tmp_path, kind)
    beyond = BY_NUMBER.replace("column = 3", "column = 7")
    refusal(lambda: load(file, beyond), "there is no column 7", "line 5", "'data/3'")


@pytest.mark.usefixtures("mat_in_process")
@pytest.mark.parametrize("kind", ["mat", "mat 4", "mat 7.3", "h5"])
def test_matrix_with_a_channel_in_each_row(tmp_path: Path, kind: str) -> None:
    """As Simulink's file blocks write it, one channel above the other."""
    file = matrix_file(tmp_path, kind, data=MATRIX.T)
    run = load(file, BY_NUMBER)
    same(run, standard(tmp_path))
    np.testing.assert_allclose(run.time, TIME, rtol=1e-12)
    assert all(f'"data/{number}"  {N} samples' in draft_mapping(file) for number in (1, 2, 3))


def scope(*, separator: str = "\t", decimal: str = ",", slow: int = 1, ended: int = 0) -> str:
    """A TwinCAT Scope export: a time column for each group of one sample time, 17 lines about the columns."""
    keys = {
        "Name": ("phi_in", "phi_out"), "SymbolComment": ("", ""), "Data-Type": ("REAL64", "INT32"),
        "SampleTime[ms]": ("10", f"{10 * slow}"), "VariableSize": ("8", "4"), "SymbolBased": ("True", "True"),
        "IndexGroup": ("16448", "16448"), "IndexOffset": ("385312", "385000"), "SymbolName": ("MAIN.in", "MAIN.out"),
        "NetID": ("192.168.178.20.1.1",) * 2, "Port": ("851", "851"), "Offset": ("0", "0"), "ScaleFactor": ("1", "1"),
        "BitMask": ("0xffffffffffffffff",) * 2, "Unit": ("deg (Angle)", "(None)"), "Unit ScaleFactor": ("1", "1"),
        "Unit Offset": ("0", "0"),
    }  # fmt: skip
    head = [["Name", "drive"], ["File", "c:\\drive.csv"], ["Starttime of export", "132959733843760000"], [], []]
    told = [[key, one, key, two] for key, (one, two) in keys.items()]
    times = [f"{1e3 * t:.12g}" for t in TIME]
    rows = [[t, f"{a:.12f}", t, f"{b:.12f}"] for t, a, b in zip(times, INPUT, OUTPUT, strict=True)]
    rows += [["", "", "", ""]] * ended  # a group that is sampled more often goes on
    told, rows = ([[*row, row[0], "2"] for row in told], [[*row, f"{i}", "7"] for i, row in enumerate(rows)])
    rows = [[cell.replace(".", decimal) for cell in row] for row in rows]
    return "\n".join(separator.join(row) for row in [*head, *told, [], *rows, ["EOF"]])


@pytest.mark.parametrize(("separator", "decimal", "ended"), [("\t", ",", 0), (";", ".", 900), (",", ".", 900)])
def test_twincat_scope_needs_only_names(tmp_path: Path, separator: str, decimal: str, ended: int) -> None:
    """Offsets, ports and indices above the numbers are no samples; unit and time come from there."""
    file = write(tmp_path, "scope.csv", scope(separator=separator, decimal=decimal, ended=ended))
    draft = draft_mapping(file)
    assert '#   "phi_in"  unit deg, every 0.01 s' in draft
    assert '#   "phi_out"  every 0.01 s' in draft
    assert "851" not in draft
    run = load(file, draft.replace('unit = ""', 'unit = "deg"'))
    same(run, standard(tmp_path), rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(run.time, TIME, rtol=1e-12)
    assert "16 lines below the names that describe the columns" in run.notes
    assert any(note.startswith(f"{ended + 1} row") for note in run.notes)  # and the last line, EOF


def test_twincat_scope_with_groups_of_two_rates_is_refused(tmp_path: Path) -> None:
    """A row of it is then no instant."""
    file = write(tmp_path, "scope.csv", scope(slow=2))
    refusal(lambda: load(file, MAPPING.replace('"in"', '"phi_in"').replace('"out"', '"phi_out"')), "one rate")


def times_of_day(start: float, step: float = 0.01, decimal: str = ".") -> list[str]:
    """Cells of a clock that shows milliseconds."""
    shown = []
    for i in range(N):
        left = round(1000 * (start + step * i)) % 86_400_000
        seconds = f"{left // 1000 % 60:02d}{decimal}{left % 1000:03d}"
        shown.append(f"{left // 3_600_000:02d}:{left // 60_000 % 60:02d}:{seconds}")
    return shown


@pytest.mark.parametrize(("start", "decimal", "nights"), [(45296.789, ".", 0), (45296.789, ",", 0), (86399.5, ",", 1)])
def test_time_of_day(tmp_path: Path, start: float, decimal: str, nights: int) -> None:
    """A clock is read as seconds from its first time, midnight or not."""
    cells = times_of_day(start, decimal=decimal)
    rows = [f"{t};{a:.9f};{b:.9f}".replace(".", decimal) for t, a, b in zip(cells, INPUT, OUTPUT, strict=True)]
    rows[7] = rows[7].replace(cells[7], "--")  # a row without its time is left out, as without any number
    file = write(tmp_path, "run.txt", "\n".join(["Uhr;in;out", *rows]))
    run = load(file, MAPPING + 'time = "Uhr"\n')
    np.testing.assert_allclose(run.time, np.delete(TIME, 7), atol=6e-4)  # the clock's digits
    said = [note for note in run.notes if "time of day" in note]
    assert len(said) == 1
    assert ("midnight passed 1 time" in said[0]) == bool(nights)


def test_a_clock_that_was_set_back_is_no_midnight(tmp_path: Path) -> None:
    cells = times_of_day(45296.0, step=1.0)
    cells[100:] = times_of_day(45296.0, step=1.0)[: N - 100]
    rows = [f"{t};{a:.9f};{b:.9f}" for t, a, b in zip(cells, INPUT, OUTPUT, strict=True)]
    file = write(tmp_path, "run.txt", "\n".join(["Uhr;in;out", *rows]))
    mapping = '[file]\ndecimal = "."\n' + MAPPING + 'time = "Uhr"\n'
    refusal(lambda: load(file, mapping), "time", "line 102")


MATLAB = {
    "cell": (np.array([OUTPUT, "x"], dtype=object), "holds objects, cells or structures"),
    "structures": (np.zeros(3, dtype=[("a", "f8")]), "holds objects, cells or structures"),
    "text": ("hello", "holds text"),
    "sparse": (scipy.sparse.eye(5).tocsc(), "sparse matrix"),
}


@pytest.mark.usefixtures("mat_in_process")
@pytest.mark.parametrize("name", MATLAB)
def test_what_matlab_holds_beside_numbers(tmp_path: Path, name: str) -> None:
    value, words = MATLAB[name]
    refusal(lambda: load(mat(tmp_path, out=value)), "'out'", words)
    if name != "sparse":
        nested = mat(tmp_path, s={"out": value})
        refusal(lambda: load(nested, MAPPING.replace('"out"', '"s/out"')), "'s/out'")


def test_objects_are_not_made(tmp_path: Path) -> None:
    """A field of Python objects, whatever they are, is listed with a refusal, not used."""
    file = mat(tmp_path, s={"out": np.array([[1, 2], "x", None], dtype=object)[:2]})
    refusal(lambda: load(file, MAPPING.replace('"out"', '"s/out"')), "holds objects, cells or structures")


def test_hdf5_of_other_places_is_not_followed(tmp_path: Path) -> None:
    other = hdf5(tmp_path, "other.h5")
    OUTPUT.tofile(tmp_path / "raw.bin")
    file = tmp_path / "run.h5"
    with h5py.File(file, "w") as out:
        out["in"] = INPUT
        out["soft"] = h5py.SoftLink("/in")
        out["external"] = h5py.ExternalLink(str(other), "/out")
        layout = h5py.VirtualLayout((N,), "f8")
        layout[:] = h5py.VirtualSource(str(other), "out", (N,))
        out.create_virtual_dataset("virtual", layout)
        out.create_dataset("stored", (N,), "f8", external=[(str(tmp_path / "raw.bin"), 0, 8 * N)])
        out["names"] = ["a", "b"]
        out.create_dataset("claims", (10**12,), "f8", chunks=(1000,))
        out.create_dataset("nothing", data=h5py.Empty("f8"))
        out["cell"] = np.zeros(N)
        out["cell"].attrs["MATLAB_class"] = np.bytes_("cell")
        out["void"] = np.zeros(2)
        out["void"].attrs["MATLAB_empty"] = 1
        out["complex"] = np.zeros(N, dtype=[("real", "f8"), ("imag", "f8")])
    for name, words in {
        "soft": "no column 'soft'",
        "external": "no column 'external'",
        "virtual": "in another file",
        "stored": "in another file",
        "names": "holds",
        "claims": "claims 1,000,000,000,000 samples, at most 20,000,000",
        "nothing": "is empty",
        "cell": "is a MATLAB cell",
        "void": "is empty",
        "complex": "complex",
    }.items():
        refusal(lambda name=name: load(file, MAPPING.replace('"out"', f'"{name}"')), f"'{name}'", words)


def test_groups_in_a_circle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = hdf5(tmp_path)
    with h5py.File(file, "a") as out:
        for i in range(3):
            out[f"g/{i}"] = np.zeros(3)
        out["g/again"] = out["/"]
    assert load(file).size == N
    monkeypatch.setattr(bench_binary, "MOST_COLUMNS", 2)
    refusal(lambda: load(file), "more than 2 data sets")


def test_as_samples_on_its_own() -> None:
    as_samples = bench_columns.as_samples
    np.testing.assert_array_equal(as_samples("f", "x", np.array([[1], [2]], dtype="u1")), [1.0, 2.0])
    assert as_samples("f", "x", np.array(3.5)).tolist() == [3.5]
    big = np.array([2**60 + 1000, 2**60 + 2000], dtype=np.int64)
    refusal(lambda: as_samples("f", "x", big), f"x holds {2**60 + 2000}, at most 2**53 is exact")
    assert as_samples("f", "x", big, time=True).tolist() == [0.0, 1000.0]
    stamps = np.array(["2026-01-01T00:00:00", "2026-01-01T00:00:01.5", "NaT"], dtype="M8[ms]")
    np.testing.assert_array_equal(as_samples("f", "x", stamps, time=True), [0.0, 1.5, np.nan])
    refusal(lambda: as_samples("f", "x", stamps), "only time can be read")
    refusal(lambda: as_samples("f", "x", np.array([None, 1])), "objects")


# --- which column -----------------------------------------------------------------------------------------------------


def test_names_that_fit_none_or_several(tmp_path: Path) -> None:
    file = hdf5(tmp_path, **{"a/out2": OUTPUT, "b/out2": OUTPUT})
    refusal(lambda: load(file, MAPPING.replace('"out"', '"out2"')), "may be 'a/out2' or 'b/out2'", "in full")
    refusal(lambda: load(file, MAPPING.replace('"out"', '"aut"')), "no column 'aut'", "did you mean 'out'", "'a/out2'",
            "bench.toml, line 4")  # fmt: skip
    refusal(lambda: load(file, '[file]\ngroup = "c"' + MAPPING), "no column 'c/in'")
    number = MAPPING.replace('name = "out"', "column = 2")
    refusal(lambda: load(file, number), "HDF5 columns have names, no numbers", "write name")


def test_columns_that_are_missing_in_the_mapping(tmp_path: Path) -> None:
    one = "[columns]\ninput_angle = { name = 'in', unit = 'deg' }\n"
    refusal(lambda: load(hdf5(tmp_path), one), "besides input_angle there is no output_angle and no te", "[columns]")
    message = refusal(lambda: load_run(hdf5(tmp_path)), "there is no input_angle", "--draft", "'in', 'out'")
    assert message.startswith(str(tmp_path / "run.h5"))


def test_two_columns_of_a_standard_name(tmp_path: Path) -> None:
    file = hdf5(tmp_path, **{"a/te[deg]": TE, "b/te[deg]": TE})
    refusal(lambda: load_run(file), "'b/te[deg]' and 'a/te[deg]' are both te")
    with h5py.File(file, "a") as out:
        out["a/input_angle[deg]"] = INPUT
    same_as = load(file, "[file]\ngroup = 'a'\n")
    np.testing.assert_allclose(same_as.te_column, np.radians(TE))


@pytest.mark.usefixtures("mat_in_process")
def test_torque_records(tmp_path: Path) -> None:
    file = mat(tmp_path, M=TORQUE)
    mapping = MAPPING + "torque = { name = 'M', unit = 'N*m' }\n"
    np.testing.assert_allclose(load(file, mapping).torque_record, 1e3 * TORQUE)
    record = load(file, mapping.replace("input_angle", "# input_angle"))
    assert record.input_angle is None
    refusal(lambda: record.error(13.0), "torque record")


def test_columns_of_different_length(tmp_path: Path) -> None:
    refusal(lambda: load(hdf5(tmp_path, out=OUTPUT[:-1])), "differ in length", "input_angle ('in') 240",
            "output_angle ('out') 239")  # fmt: skip


# --- units, signs, counts ---------------------------------------------------------------------------------------------


def test_units_that_are_missing_or_contradict(tmp_path: Path) -> None:
    file = hdf5(tmp_path)
    bare = MAPPING.replace('name = "out", unit = "deg"', 'name = "out"')
    refusal(lambda: load(file, bare), "output_angle ('out') has no unit", "line 4", 'unit = "deg"')
    with h5py.File(file, "a") as out:
        out["out"].attrs["units"] = "rad"
    refusal(lambda: load(file), "in deg by the mapping, but the file says 'rad'", "scale = 1")
    same(load(file, MAPPING.replace('"out", unit = "deg"', '"out", unit = "deg", scale = 1')), standard(tmp_path))
    np.testing.assert_allclose(load(file, bare).output_angle, OUTPUT)
    np.testing.assert_allclose(load(file, bare.replace('"out"', '"out", sign = -1')).output_angle, -OUTPUT)
    with h5py.File(file, "a") as out:
        out["out"].attrs["units"] = "V"  # of a sensor: it says nothing of what the mapping makes of it
    same(load(file), standard(tmp_path))
    refusal(lambda: load(file, bare), "'V'", "state the unit beside its name")
    with h5py.File(file, "w") as out:
        out["input_angle"], out["te[furlong]"] = INPUT, TE
    refusal(lambda: load_run(file), "input_angle has no unit", "write 'input_angle[deg]'")
    with h5py.File(file, "a") as out:
        out["input_angle"].attrs["unit"] = "deg"
    refusal(lambda: load_run(file), "te", "'furlong'")


@pytest.mark.parametrize("bits", [16, 24, 32])
@pytest.mark.parametrize("sense", [1, -1])
def test_a_counter_that_starts_again(tmp_path: Path, bits: int, sense: int) -> None:
    """Restarts are undone where stated, asked for where not; a restart a turn is one of any angle."""
    size = 2**bits
    per_turn = float(size * 360 / (INPUT[-1] - INPUT[0]) * 3.3)  # 3.3 times round in the run
    counts = np.round(sense * INPUT / 360 * per_turn)
    file = hdf5(tmp_path, **{"in": np.mod(counts, size), "out": sense * OUTPUT})
    mapping = MAPPING.replace('"in", unit = "deg"', f'"in", unit = "counts", counts_per_turn = {per_turn!r}')
    jumps = int(np.count_nonzero(np.abs(np.diff(np.mod(counts, size))) > size / 2))
    run = load(file, mapping.replace("counts_per_turn", f"wraps_at = {size}, counts_per_turn"))
    assert f"input_angle: {jumps} restarts of the counter by {float(size):.6g} removed" in run.notes
    np.testing.assert_allclose(np.diff(run.input_angle), np.diff(counts) / per_turn * math.tau, rtol=1e-9)
    assert any("its counter has jumped" in note for note in load(file, mapping).notes)


def test_an_encoder_of_one_turn(tmp_path: Path) -> None:
    counts = np.round(OUTPUT / 360 * 2**20 + 2**20 * 0.8).astype(np.int64) % 2**20
    file = hdf5(tmp_path, out=counts)
    run = load(file, MAPPING.replace('"out", unit = "deg"', '"out", unit = "counts", counts_per_turn = 1048576'))
    assert "output_angle unwrapped: 1 jump by a turn removed" in run.notes
    np.testing.assert_allclose(np.ptp(run.output_angle), np.radians(np.ptp(OUTPUT)), atol=1e-5)


def test_counters_that_cannot_be_followed(tmp_path: Path) -> None:
    counts = np.arange(N) * 300.0
    keys = '"in", unit = "counts", counts_per_turn = 4000, wraps_at = '
    mapping = MAPPING.replace('"in", unit = "deg"', keys + "1000")
    refusal(lambda: load(hdf5(tmp_path, **{"in": counts % 1000}), mapping), "moves 300 counts between samples",
            "a quarter of wraps_at = 1000")  # fmt: skip
    mapping = MAPPING.replace('"in", unit = "deg"', keys + "65536")
    refusal(lambda: load(hdf5(tmp_path, **{"in": counts}), mapping), "covers 71700 counts", "more than wraps_at")


def test_a_gap_in_a_counter_stays_one(tmp_path: Path) -> None:
    """NaN among wrapping counts: the rest is followed across it."""
    counts = np.arange(N) * 900.0
    wrapped = counts % 65536
    wrapped[50] = np.nan
    keys = '"in", unit = "counts", counts_per_turn = 5000, wraps_at = 65536'
    run = load(hdf5(tmp_path, **{"in": wrapped}), MAPPING.replace('"in", unit = "deg"', keys))
    np.testing.assert_allclose(run.input_angle, np.delete(counts, 50) / 5000 * math.tau, rtol=1e-12)


# --- time -------------------------------------------------------------------------------------------------------------


def test_time_of_a_waveform(tmp_path: Path) -> None:
    wave = {"wf_increment": 0.01}
    file = tdms(tmp_path, ChannelObject("G", "in", INPUT, wave), ChannelObject("G", "out", OUTPUT, wave))
    run = load(file)
    np.testing.assert_allclose(run.time, TIME, atol=1e-12)
    assert "time made from the interval that the file states, 0.01 s" in run.notes
    file = tdms(tmp_path, ChannelObject("G", "in", INPUT, wave), ChannelObject("G", "out", OUTPUT))
    assert load(file).time is None
    other = {"wf_increment": 0.02}
    file = tdms(tmp_path, ChannelObject("G", "in", INPUT, wave), ChannelObject("G", "out", OUTPUT, other))
    refusal(lambda: load(file), "every 0.01 and every 0.02 s", "at one rate")


def test_time_stamps(tmp_path: Path) -> None:
    stamps = np.datetime64("2026-03-01T10:00:00", "us") + (TIME * 1e6).astype("m8[us]")
    file = tdms(
        tmp_path, ChannelObject("G", "in", INPUT), ChannelObject("G", "out", OUTPUT), ChannelObject("G", "t", stamps)
    )
    run = load(file, MAPPING + "time = { name = 't', unit = 's' }\n")
    np.testing.assert_allclose(run.time, TIME, atol=1e-6)
    assert "time counted from the first time stamp of 'G/t'" in run.notes


# --- the header -------------------------------------------------------------------------------------------------------


@pytest.mark.usefixtures("mat_in_process")
def test_values_of_the_header(tmp_path: Path) -> None:
    head = "[header]\ndirection = 'forward'\ntemperature = '-5 degC'\nindex = 'A'\n"
    load_of = "output_torque = { property = 'load', unit = 'N*m' }\n"
    run = load(mat(tmp_path, load=-30.0), MAPPING + head + load_of)
    assert run.torque == pytest.approx(30e3)  # the size, whatever the sign
    assert run.temperature == pytest.approx(268.15)
    assert run.index == "A"
    refusal(lambda: load(tmp_path / "run.mat", MAPPING + "[header]\ndirection = 'reverse'\n"),
            "bench.toml, line 6: direction says reverse", "grows", "write forward")  # fmt: skip


def test_properties(tmp_path: Path) -> None:
    header = "[header]\noutput_torque = { property = 'Last', unit = 'N*m' }\ntemperature = { property = 'G/T' }\n"
    file = tdms(tmp_path, root={"Last": 20.5, "Way": "Reverse"}, group={"T": "21 degC", "who": "x"})
    run = load(file, MAPPING + header)
    assert (run.torque, run.temperature) == (pytest.approx(20.5e3), pytest.approx(294.15))
    refusal(lambda: load(file, MAPPING + header.replace("'Last'", "'last'")), "no property 'last'", "did you mean",
            "'Way'")  # fmt: skip
    refusal(lambda: load(file, MAPPING + header.replace(", unit = 'N*m'", "")), "line 6: output_torque", "no unit")
    refusal(lambda: load(file, MAPPING + "[header]\ndirection = { property = 'Way' }\n"), "direction says reverse")
    refusal(lambda: load(file, MAPPING + "[header]\ndirection = { property = 'G/who' }\n"),
            "direction = 'x'", "forward, reverse or mixed")  # fmt: skip
    refusal(lambda: load(file, MAPPING + "[header]\noutput_torque = { property = 'G/T', unit = 'N*m' }\n"),
            "'21 degC'", "the mapping says N*m")  # fmt: skip
    with h5py.File(hdf5(tmp_path), "a") as out:
        out.create_group("g").attrs["load"] = np.array([20.0])
        out.attrs["direction"] = "CW"  # not asked for: a mapping with its own columns asks for what it means
    run = load(tmp_path / "run.h5", MAPPING + "[header]\noutput_torque = { property = 'g/load', unit = 'kN*mm' }\n")
    assert run.torque == pytest.approx(20e3)


@pytest.mark.parametrize(
    ("line", "keys"),
    [
        ("Last: 20,5 N*m", ""),
        ("# Last = 20,5", ", unit = 'N*m'"),
        ("Last;20,5;;;", ", unit = 'N*m'"),
        ('"Last";"20,5 Nm"', ", unit = 'N*m'"),
        ("Last\t20,5 N*m", ", unit = 'N*m'"),
    ],
)
def test_values_of_a_preamble(tmp_path: Path, line: str, keys: str) -> None:
    file = write(tmp_path, "run.csv", f"Prüfstand: 3\n{line}\nDirection: CW\n" + columns())
    run = load(file, MAPPING + f"[header]\noutput_torque = {{ property = 'Last'{keys} }}\n")
    assert run.torque == pytest.approx(20.5e3)


# --- hostile files ----------------------------------------------------------------------------------------------------


def test_files_that_are_cut_off(tmp_path: Path) -> None:
    """Any beginning of a file gives a run or one line, and never another exception."""
    many = {"wide": np.zeros((3, 4)), "s": {"x": OUTPUT}}
    files = {
        "run.mat": mat(tmp_path, keywords={"do_compression": True}, **many).read_bytes(),
        "run.h5": hdf5(tmp_path).read_bytes(),
        "run.tdms": tdms(tmp_path, segments=3).read_bytes(),
    }
    for name, raw in files.items():
        sizes = [*range(0, 600, 40), *np.linspace(600, len(raw) - 1, 25).astype(int)]
        for size in sizes[::8] if name == "run.mat" else sizes:  # each MAT file starts a process
            message = ""
            try:
                run = load(write(tmp_path, name, raw[:size]))
            except InputError as error:
                message = str(error)
                assert "\n" not in message
                assert message.startswith(str(tmp_path / name))
            else:
                assert name == "run.tdms"
                assert run.size < N
                assert run.size % (N // 3) == 0  # it ends where a part ends, which nobody can tell
    refusal(lambda: load(write(tmp_path, "run.mat", files["run.mat"][:900])), "could not read", "export it again")
    refusal(
        lambda: load(write(tmp_path, "run.h5", files["run.h5"][:900])), "as HDF5", "damaged or cut off", "truncated"
    )
    refusal(lambda: load(write(tmp_path, "run.h5", "in;out\n")), "as HDF5")


@given(place=st.integers(0, 2**31), byte=st.integers(0, 255))
def test_damaged_files(tmp_path_factory: pytest.TempPathFactory, place: int, byte: int) -> None:
    folder = tmp_path_factory.mktemp("damaged")
    file = tdms(folder)
    raw = bytearray(file.read_bytes())
    raw[place % min(len(raw), 700)] = byte
    message = ""
    try:
        load(write(folder, file.name, bytes(raw)))
    except InputError as error:
        message = str(error)
    assert "\n" not in message


@pytest.mark.parametrize(("place", "byte"), [(145, 127), (172, 14), (184, 255), (307, 1), (400, 128)])
def test_damage_that_ends_the_process_of_scipy(tmp_path: Path, place: int, byte: int) -> None:
    out = io.BytesIO()
    scipy.io.savemat(out, {"vector": np.arange(10.0), "structure": {"a": np.arange(3.0)}})
    raw = bytearray(out.getvalue())
    raw[place] = byte
    refusal(lambda: load(write(tmp_path, "run.mat", bytes(raw))), "cannot be read as MAT", "damaged or cut off")


@given(st.binary(max_size=300), st.sampled_from(["", "decimal = ','", "encoding = 'latin-1'", "separator = ' '"]))
def test_any_bytes_give_a_run_or_one_line(tmp_path_factory: pytest.TempPathFactory, content: bytes, keys: str) -> None:
    folder = tmp_path_factory.mktemp("any")
    mapping = load_mapping(write(folder, "bench.toml", f"[file]\n{keys}\n" + MAPPING))
    for before, after in ((b"", b""), (b"in;out\n", b""), (b"", columns().encode()), (columns().encode(), b"")):
        message = ""
        try:
            load_run(write(folder, "run.csv", before + content + after), mapping=mapping)
        except InputError as error:
            message = str(error)
        assert "\n" not in message


def test_other_files_by_mistake(tmp_path: Path) -> None:
    for raw in (b"PK\x03\x04" + b"\0" * 100, b"\xd0\xcf\x11\xe0" + b"\0" * 100):
        refusal(
            lambda raw=raw: load(write(tmp_path, "run.xlsx", raw)), "workbook or an archive", "save the sheet as CSV"
        )
        refusal(lambda raw=raw: load_run(write(tmp_path, "run.csv", raw)), "workbook")
    refusal(lambda: load(tmp_path / "none.tdms"), "no such file")
    refusal(lambda: load(tmp_path), "folder")
    refusal(lambda: load(write(tmp_path, "run.mat", b"\0" * 2000)), "run.mat")
    refusal(lambda: load(write(tmp_path, "run.tdms", "in;out\n1;2\n")), "cannot be read as TDMS")


def test_variables_that_stand_twice(tmp_path: Path) -> None:
    one, two = io.BytesIO(), io.BytesIO()
    scipy.io.savemat(one, {"in": INPUT, "out": OUTPUT})
    scipy.io.savemat(two, {"out": OUTPUT})
    file = write(tmp_path, "run.mat", one.getvalue() + two.getvalue()[128:])
    refusal(lambda: load(file), 'Duplicate variable name "out"')


@pytest.mark.parametrize(("module", "kind", "words"), [("h5py", "h5", "HDF5 files need h5py"),
                                                       ("nptdms", "tdms", "TDMS files need npTDMS")])  # fmt: skip
def test_without_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str, kind: str, words: str) -> None:
    file = hdf5(tmp_path) if kind == "h5" else tdms(tmp_path)
    monkeypatch.setitem(sys.modules, module, None)
    refusal(lambda: load(file), words, "pip install 'rverror[io]'")
    same(load(mat(tmp_path)), standard(tmp_path), rtol=1e-14)


def test_an_index_file_of_another_recording_is_not_used(tmp_path: Path) -> None:
    file = tdms(tmp_path)
    index = tmp_path / "run.tdms_index"
    write(tmp_path, "run.tdms_index", b"TDSh" + os.urandom(300))
    assert index.exists()
    same(load(file), standard(tmp_path), rtol=1e-14)


def test_a_run_read_so_is_written_as_a_run_file(tmp_path: Path) -> None:
    run = load(tdms(tmp_path), MAPPING + "[header]\nindex = 'A'\n")
    back = load_run(write(tmp_path, "back.csv", run_text(run)))
    same(back, run, rtol=1e-13)
    assert back.index == "A"
    memory = run_from_arrays(input_angle=RATIO * THETA, output_angle=THETA + TE)
    same(back, memory, rtol=1e-12)
