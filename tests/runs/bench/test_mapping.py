"""Mapping files: what they say, and in which words they are refused."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from pages import ROOT
from rverror.base.errors import InputError
from rverror.runs.bench.mapping import load_mapping, unit_scale

GOOD = """
name = "bench 3"
[file]
group = "/Messung/"
encoding = "cp1252"
separator = ";"
decimal = ","
skip = 4
[columns]
input_angle = { name = "Geber", unit = "counts", counts_per_turn = 4000, sign = -1, wraps_at = 65536 }
output_angle = "Winkel [deg]"
te = { column = 4, unit = "mrad", scale = 2.5, sign = -1 }
[columns.time]
name = "Zeit"
unit = "ms"
[header]
direction = "Forward"
output_torque = { property = "M", unit = "N*m" }
temperature = { property = "T" }
index = "A"
"""


def load(tmp_path: Path, text: str):  # type: ignore[no-untyped-def]
    file = tmp_path / "bench.toml"
    file.write_text(text, encoding="utf-8")
    return load_mapping(file)


def test_good_file(tmp_path: Path) -> None:
    mapping = load(tmp_path, GOOD)
    assert mapping.group == "Messung"
    text = mapping.text
    assert (text.encoding, text.separator, text.decimal, text.skip) == ("cp1252", ";", ",", 4)
    geber, winkel, te, time = (mapping.columns[key] for key in ("input_angle", "output_angle", "te", "time"))
    assert geber.factor == pytest.approx(-math.tau / 4000)
    assert (geber.counts, geber.wraps_at, geber.where.name) == (True, 65536, "Geber")
    assert geber.where.stated_at == f"mapping {tmp_path / 'bench.toml'}, line 10"
    assert (winkel.where.name, winkel.unit, winkel.factor) == ("Winkel [deg]", "", 0)
    assert (te.where.column, te.factor, te.scaled) == (4, pytest.approx(-2.5e-3), True)
    assert time.factor == pytest.approx(1e-3)
    assert mapping.header["direction"].text == "Forward"
    assert mapping.header["output_torque"].where.name == "M"
    assert mapping.header["temperature"].where.name == "T"


def test_the_shipped_mapping_is_one() -> None:
    mapping = load_mapping(ROOT / "examples" / "bench-mapping.toml")
    assert mapping.columns["output_angle"].sign == -1


def test_an_empty_mapping_leaves_the_names_of_a_run_file(tmp_path: Path) -> None:
    assert load(tmp_path, "").columns == {}


COLUMN = "[columns]\ninput_angle = "
BAD = {
    "no toml": ("[columns\n", ["line 1", "no valid TOML"]),
    "top-level key": ('\ncolumn = "x"\n', ["line 2", "unknown table", "'column'", "did you mean 'columns'"]),
    "no table": ("columns = 3\n", ["line 1", "columns = 3", "write '[columns]'"]),
    "file key": ('[file]\nseperator = ";"\n', ["line 2", "'seperator'", "did you mean 'separator'"]),
    "column key": ('[columns]\ninput = "x"\n', ["line 2", "unknown column 'input'", "input_angle, output_angle"]),
    "header key": ('[header]\ntorque = "20 N*m"\n', ["line 2", "'torque'", "did you mean 'output_torque'"]),
    "rule key": (COLUMN + '{ name = "x", units = "deg" }', ["line 2", "'units'", "did you mean 'unit'"]),
    "separator": ('[file]\nseparator = ";;"\n', ["line 2", "separator = ';;'", "must be one of ';', ','"]),
    "decimal": ('[file]\ndecimal = "x"\n', ["line 2", "decimal = 'x'", "'.', ','"]),
    "decimal no text": ("[file]\ndecimal = 1\n", ["line 2", "decimal = 1", "must be a text"]),
    "encoding": ('[file]\nencoding = "cp1525"\n', ["line 2", "'cp1525'", "did you mean 'cp1252'"]),
    "no text encoding": ('[file]\nencoding = "zip"\n', ["line 2", "'zip'", "no such text encoding"]),
    "empty encoding": ('[file]\nencoding = ""\n', ["line 2", "no such text encoding"]),
    "skip": ("[file]\nskip = -1\n", ["line 2", "skip = -1", "0 or more"]),
    "skip true": ("[file]\nskip = true\n", ["line 2", "skip = True", "whole number"]),
    "no name": (COLUMN + '{ unit = "deg" }', ["line 2", "lacks name, column", 'name = "..."']),
    "name and column": (COLUMN + '{ name = "x", column = 2 }', ["line 2", "more than one of name, column"]),
    "empty name": (COLUMN + '""', ["line 2", "name is empty", "as the file has it"]),
    "column 0": (COLUMN + "{ column = 0 }", ["line 2", "column = 0", "counted from 1"]),
    "list": (COLUMN + "[1]", ["line 2", "must be a table", 'unit = "deg"']),
    "unit": (COLUMN + '{ name = "x", unit = "mm" }', ["line 2", "'mm' is no unit of angle"]),
    "unknown unit": (COLUMN + '{ name = "x", unit = "furlongs" }', ["line 2", "input_angle", "angle"]),
    "German unit": (COLUMN + '{ name = "x", unit = "Grad" }', ["line 2", "'Grad'", "did you mean 'deg'"]),
    "unit without dimension": (COLUMN + '{ name = "x", unit = "dimensionless" }', ["line 2", "no unit of angle"]),
    "ticks": (COLUMN + '{ name = "x", unit = "ticks" }', ["line 2", "'ticks'", "counts_per_turn"]),
    "sign": (COLUMN + '{ name = "x", unit = "deg", sign = 2 }', ["line 2", "sign = 2", "1 or -1"]),
    "sign true": (COLUMN + '{ name = "x", unit = "deg", sign = true }', ["line 2", "sign = True"]),
    "scale": (COLUMN + '{ name = "x", unit = "deg", scale = -2 }', ["line 2", "scale = -2", "above 0", "sign = -1"]),
    "scale nan": (COLUMN + '{ name = "x", unit = "deg", scale = nan }', ["line 2", "scale = nan", "above 0"]),
    "scale alone": (COLUMN + '{ name = "x", scale = 2 }', ["line 2", "a scale but no unit"]),
    "counts alone": (COLUMN + '{ name = "x", unit = "counts" }', ["line 2", "lacks counts_per_turn", "4 * lines"]),
    "counts and scale": (COLUMN + '{ name = "x", unit = "counts", counts_per_turn = 4, scale = 2 }', ["no scale"]),
    "counts of time": ('[columns]\ntime = { name = "t", unit = "counts", counts_per_turn = 4 }', ["time in counts"]),
    "counts of te": ('[columns]\nte = { name = "t", unit = "counts", counts_per_turn = 4 }', ["te in counts"]),
    "per turn of deg": (COLUMN + '{ name = "x", unit = "deg", counts_per_turn = 4 }',
                        ["counts_per_turn belongs to counts", 'unit = "counts"']),
    "wraps of deg": (COLUMN + '{ name = "x", unit = "deg", wraps_at = 4 }', ["wraps_at belongs to counts"]),
    "torque": ('[header]\noutput_torque = "20"\n', ["line 2", "output_torque", "no unit", "20 N*m"]),
    "torque number": ("[header]\noutput_torque = 20\n", ["line 2", "output_torque = 20", "must be a text"]),
    "torque unit": ('[header]\noutput_torque = { property = "M", unit = "Nn" }', ["line 2", "'Nn'", "N*m"]),
    "direction": ('[header]\ndirection = "forwards"\n', ["line 2", "'forwards'", "did you mean 'forward'"]),
    "direction column": ('[header]\ndirection = { name = "x" }\n', ["line 2", "'name'", "property"]),
    "index": ('[header]\nindex = ""\n', ["line 2", "index is empty"]),
    "column number": ('[columns]\ntorque = 3\n', ["line 2", "torque = 3", "name of a column"]),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_refused_in_one_line(tmp_path: Path, name: str) -> None:
    text, words = BAD[name]
    with pytest.raises(InputError) as caught:
        load(tmp_path, text)
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(str(tmp_path / "bench.toml"))
    for word in words:
        assert word in message


def test_a_mapping_that_cannot_be_read(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        load_mapping(tmp_path / "none.toml")
    (tmp_path / "bench.toml").write_bytes('[columns]\ninput_angle = "Öl"'.encode("cp1252"))
    with pytest.raises(InputError, match="line 2: byte 0xd6 is no UTF-8 text; save the file as UTF-8"):
        load_mapping(tmp_path / "bench.toml")


@pytest.mark.parametrize(
    ("unit", "dimension", "factor"),
    [
        ("°", "angle", math.pi / 180),
        ("rad", "angle", 1.0),
        ("radian", "angle", 1.0),
        ("turn", "angle", math.tau),
        ("us", "time", 1e-6),
    ],
)
def test_units_of_benches(unit: str, dimension: str, factor: float) -> None:
    assert unit_scale(unit, dimension)[0] == pytest.approx(factor, rel=1e-14)
