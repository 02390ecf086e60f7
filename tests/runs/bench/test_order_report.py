"""Order tables as reports of benches print them: what a mapping makes of them, and in which words they are refused."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pytest
import scipy.io
from nptdms import ChannelObject, TdmsWriter

from remedy import REMEDY
from rverror import Model, effect, load_run, reducer, save_model
from rverror.app.command_line import main
from rverror.base.errors import InputError
from rverror.base.units import ARCSEC
from rverror.runs import load_orders
from rverror.runs.bench.draft import draft_mapping
from rverror.runs.bench.mapping import load_mapping, unit_scale
from rverror.runs.measurement import read_run
from rverror.runs.order_table import OrderTable

#: The waves that every file below prints: direction, torque in N m, order, amplitude in arcmin, phase in deg.
ROWS = (
    (1.0, 400.0, 39.0, 0.05, -81.9),
    (1.0, 400.0, 78.0, 0.02, -35.6),
    (1.0, 900.0, 39.0, 0.07, -60.0),
    (1.0, 900.0, 78.0, 0.03, 12.5),
    (-1.0, 400.0, 39.0, 0.048, 102.4),
    (-1.0, 400.0, 78.0, 0.021, 170.0),
)
REPORT = "Ordnung;Amplitude;Phase;Drehmoment;Richtung\n" + "".join(
    f"{order:g};{amplitude:g};{phase:g};{torque:g};{'vor' if sense > 0 else 'rück'}\n".replace(".", ",")
    for sense, torque, order, amplitude, phase in ROWS
)
MAPPING = """
[orders]
order = "Ordnung"
amplitude = { name = "Amplitude", unit = "arcmin" }
phase = { name = "Phase", unit = "deg" }
output_torque = { name = "Drehmoment", unit = "N*m" }
direction = { name = "Richtung", forward = "vor", reverse = "rück" }
"""


def read(folder: Path, report: str = REPORT, mapping: str = MAPPING) -> OrderTable:
    (folder / "bench.toml").write_text(mapping, encoding="utf-8")
    (folder / "report.csv").write_text(report, encoding="utf-8")
    return load_orders(folder / "report.csv", folder / "bench.toml")


def flat(table: OrderTable) -> list[tuple[float, float, float, complex]]:
    """Direction, torque in N m, order and wave in arcsec of every row."""
    return [
        (case.condition.direction, (case.condition.torque or 0.0) / 1e3, order, wave / ARCSEC)
        for case in table.cases
        for order, wave in zip(case.orders.tolist(), case.waves.tolist(), strict=True)
    ]


def check(table: OrderTable) -> None:
    """The table holds the waves above: at every angle they make A cos(k theta + phi)."""
    theta = np.linspace(0.0, 1.0, 7)
    for found, (sense, torque, order, amplitude, phase) in zip(flat(table), ROWS, strict=True):
        assert found[:3] == (sense, pytest.approx(torque), pytest.approx(order))
        error = 60 * amplitude * np.cos(order * theta + math.radians(phase))
        np.testing.assert_allclose((found[3] * np.exp(1j * order * theta)).real, error, atol=1e-9)


def changed(*pairs: tuple[str, str], text: str = MAPPING) -> str:
    for old, new in pairs:
        assert text.count(old) == 1
        text = text.replace(old, new)
    return text


def test_a_report_is_the_table_that_it_prints(tmp_path: Path) -> None:
    table = read(tmp_path)
    check(table)
    assert table.path == str(tmp_path / "report.csv")
    assert "separator found in line 1: semicolon" in table.notes
    assert "decimal sign found in the rows: ','" in table.notes
    again = load_run(tmp_path / "report.csv", mapping=tmp_path / "bench.toml")
    assert isinstance(again, OrderTable)
    check(again)


@pytest.mark.parametrize(
    ("unit", "size"),
    [("arcsec", 1), ("arcmin", 60), ("deg", 3600), ("mrad", 648 / math.pi), ("urad", 0.648 / math.pi),
     ("rad", 648000 / math.pi), ("turn", 1296000), ("°", 3600)],
)  # fmt: skip
def test_every_unit_of_an_angle(tmp_path: Path, unit: str, size: float) -> None:
    """`size` is in arcsec: of amplitudes, of cos and sin, of sigma, and of phases."""
    report = f"k;A;s\n39;{2 / size:.15g};{0.1 / size:.15g}\n".replace(".", ",")
    columns = ('order = "k"', f'cos = {{ name = "A", unit = "{unit}" }}', f'sin = {{ name = "A", unit = "{unit}" }}')
    mapping = "\n".join(("[orders]", *columns, f'sigma = {{ name = "s", unit = "{unit}" }}'))
    mapping += '\n[header]\ndirection = "forward"\n'
    (case,) = read(tmp_path, report, mapping).cases
    assert case.waves[0] / ARCSEC == pytest.approx(2 - 2j, rel=1e-12)
    assert case.sigma is not None
    assert case.sigma[0] / ARCSEC == pytest.approx(0.1, rel=1e-12)
    report = f"k;A;p\n39;1;{90 * 3600 / size:.15g}\n".replace(".", ",")
    mapping = f'[orders]\norder="k"\namplitude={{name="A",unit="arcsec"}}\nphase={{name="p",unit="{unit}"}}\n'
    (case,) = read(tmp_path, report, mapping + '[header]\ndirection = "reverse"\n').cases
    assert case.waves[0] / ARCSEC == pytest.approx(1j, rel=1e-9)
    assert case.condition.direction == -1.0


@pytest.mark.parametrize(
    ("name", "unit", "value", "core"),
    [("output_torque", "N*m", 20, 20e3), ("output_torque", "kN*m", 0.5, 500e3), ("output_torque", "N*cm", 7, 70.0),
     ("input_speed", "rpm", 60, math.tau), ("input_speed", "deg/s", 180, math.pi), ("input_speed", "rad/s", 3, 3.0),
     ("temperature", "degC", 25, 298.15), ("temperature", "K", 300, 300.0), ("temperature", "degF", 212, 373.15)],
)  # fmt: skip
def test_every_unit_of_a_condition_as_column_as_value_and_as_property(
    tmp_path: Path, name: str, unit: str, value: float, core: float
) -> None:
    attribute = {"output_torque": "torque"}.get(name, name)
    wave = '[orders]\norder = "k"\namplitude = { name = "A", unit = "arcsec" }\nphase = { name = "p", unit = "deg" }\n'
    head = '[header]\ndirection = "forward"\n'
    number = f"{value:g}".replace(".", ",")
    by_column = read(
        tmp_path, f"k;A;p;x\n39;1;0;{number}\n", wave + f'{name} = {{ name = "x", unit = "{unit}" }}\n' + head
    )
    of_file = read(tmp_path, f"k;A;p;x [{unit}]\n39;1;0;{number}\n", wave + f'{name} = "x [{unit}]"\n' + head)
    stated = read(tmp_path, "k;A;p\n39;1;0\n", wave + head + f'{name} = "{value:g} {unit}"\n')
    preamble = f"Wert: {number}\nk;A;p\n39;1,5;0\n"
    by_property = read(tmp_path, preamble, wave + head + f'{name} = {{ property = "Wert", unit = "{unit}" }}\n')
    for table in (by_column, of_file, stated, by_property):
        (case,) = table.cases
        assert getattr(case.condition, attribute) == pytest.approx(core, rel=1e-12)
    assert f"unit of {name} taken from the file: {unit}" in of_file.notes


def test_a_zero_of_one_s_own_is_read_from_the_preamble(tmp_path: Path) -> None:
    for line, header in (("", 'index = "unknown"'), ("Marke: unknown\n", 'index = { property = "Marke" }')):
        table = read(tmp_path, line + REPORT, MAPPING + f"[header]\n{header}\n")
        check(table)
        assert table.index == "unknown"
        assert table.metadata == {"index": "unknown"}


def in_words(forward: str, reverse: str) -> str:
    return REPORT.replace("rück", reverse).replace("vor", forward)


RULE = '{ name = "Richtung", forward = "vor", reverse = "rück" }'
DIRECTIONS: dict[str, tuple[str, str]] = {
    "words of another case": (in_words("VOR", "Rück"), MAPPING),
    "the words of a table": (in_words("forward", "Reverse"), changed((RULE, '"Richtung"'))),
    "one and minus one": (in_words("1", "-1"), changed((RULE, '"Richtung"'))),
    "a signed speed": (in_words("100,5", "-99,5"), changed((RULE, '"Richtung"'))),
    "numbers as words": (in_words("0", "1"),
                         changed((RULE, '{ name = "Richtung", forward = "0", reverse = "1" }'))),
    "a column by its number": (
        REPORT.split("\n", 1)[1],
        '[file]\nseparator = ";"\n[orders]\norder = { column = 1 }\namplitude = { column = 2, unit = "arcmin" }\n'
        'phase = { column = 3, unit = "deg" }\noutput_torque = { column = 4, unit = "N*m" }\n'
        'direction = { column = 5, forward = "vor", reverse = "rück" }\n',
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", DIRECTIONS)
def test_every_way_to_tell_the_direction(tmp_path: Path, name: str) -> None:
    check(read(tmp_path, *DIRECTIONS[name]))


@pytest.mark.parametrize(
    ("header", "preamble"),
    [('direction = "Reverse"', ""), ('direction = { property = "Lauf" }', "Lauf: reverse\n"),
     ('direction = { property = "Lauf", forward = "cw", reverse = "ccw" }', "Lauf: CCW\n")],
)  # fmt: skip
def test_a_direction_of_all_rows(tmp_path: Path, header: str, preamble: str) -> None:
    only = REPORT.splitlines(keepends=True)
    mapping = changed((f"direction = {RULE}\n", "")) + f"[header]\n{header}\n"
    table = read(tmp_path, preamble + "".join(only[:3]), mapping)
    assert [row[0] for row in flat(table)] == [-1.0, -1.0]
    assert [case.condition.torque for case in table.cases] == [400e3]


TURNED: dict[str, tuple[Callable[[float, float, float], tuple[float, float, float]], str]] = {
    # the report prints (order, amplitude, phase) of the same wave in another way
    "phases that lag": (lambda k, a, p: (k, a, -p), changed(('unit = "deg"', 'unit = "deg", sign = -1'))),
    "a wave of the other sign": (
        lambda k, a, p: (k, a, p + 180), changed(('"Amplitude", unit', '"Amplitude", sign = -1, unit'))
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", TURNED)
def test_waves_that_are_printed_in_another_way(tmp_path: Path, name: str) -> None:
    """sin(x + 90 deg) is cos x, cos(k theta - p) has the phase -p, a wave of the other sign stands half a turn on."""
    printed, mapping = TURNED[name]
    report = "Ordnung;Amplitude;Phase;Drehmoment;Richtung\n" + "".join(
        ";".join(f"{value:.15g}" for value in (*printed(order, amplitude, phase), torque))
        + (";vor\n" if sense > 0 else ";rück\n")
        for sense, torque, order, amplitude, phase in ROWS
    )
    check(read(tmp_path, report, '[file]\ndecimal = "."' + mapping))


def test_sizes_of_signed_torques_are_taken_where_each_direction_has_one_sign(tmp_path: Path) -> None:
    lines = REPORT.splitlines(keepends=True)
    report = "".join(line.replace(";400;rück", ";-400;rück") for line in lines)
    table = read(tmp_path, report)
    check(table)
    assert "output_torque has the sign of the motion; its size is taken" in table.notes


def test_a_line_of_units_and_a_footer_are_no_rows(tmp_path: Path) -> None:
    lines = REPORT.splitlines(keepends=True)
    table = read(tmp_path, "".join([lines[0], "-;arcmin;deg;Nm;\n", *lines[1:], "Ende;;;;\n"]))
    check(table)
    assert "2 rows without any number left out (lines 2, 9)" in table.notes


@pytest.mark.parametrize("kind", ["mat", "hdf5", "tdms"])
def test_a_table_in_a_file_of_numbers(tmp_path: Path, kind: str) -> None:
    names = ("Richtung", "Drehmoment", "Ordnung", "Amplitude", "Phase")
    data = dict(zip(names, np.array(ROWS).T, strict=True))
    file = tmp_path / f"report.{kind}"
    if kind == "mat":
        scipy.io.savemat(file, data)
    elif kind == "hdf5":
        with h5py.File(file, "w") as out:
            for name, values in data.items():
                out[name] = values
    else:
        with TdmsWriter(file) as writer:
            writer.write_segment([ChannelObject("G", name, values) for name, values in data.items()])
    for rule in ('"Richtung"', '{ name = "Richtung", forward = "1", reverse = "-1" }'):
        (tmp_path / "bench.toml").write_text(changed((RULE, rule)))
        check(load_orders(file, tmp_path / "bench.toml"))


def test_a_draft_names_columns_beside_words_and_shows_how_a_table_is_mapped(tmp_path: Path) -> None:
    lines = REPORT.splitlines(keepends=True)
    for units in ("", "-;arcmin;deg;Nm;\n"):
        (tmp_path / "report.csv").write_text("".join(["Stand 3;;;;\n", lines[0], units, *lines[1:]]))
        draft = draft_mapping(tmp_path / "report.csv")
        assert 'separator = ";"' in draft
        assert 'decimal = ","' in draft
        assert all(f'#   "{name}"' in draft for name in ("Ordnung", "Amplitude", "Phase", "Drehmoment", "Richtung"))
    # filled in as it says it is the mapping of the report
    text = changed(
        ('# order = { name = "" }', 'order = { name = "Ordnung" }'),
        ('# amplitude = { name = "", unit = "arcsec" }', 'amplitude = { name = "Amplitude", unit = "arcmin" }'),
        ('# phase = { name = "",', 'phase = { name = "Phase",'),
        ('# output_torque = { name = "",', 'output_torque = { name = "Drehmoment",'),
        ('# direction = { name = "", forward = "...", reverse = "..." }',
         'direction = { name = "Richtung", forward = "vor", reverse = "rück" }'),
        ("# [orders]", "[orders]"),
        text=draft,
    )  # fmt: skip
    first, last = text.index("[columns]"), text.index("# Of a table")
    check(read(tmp_path, REPORT, text[:first] + text[last:]))


# --- refused in one line ----------------------------------------------------------------------------------------------

HEAD = '[header]\ndirection = "forward"\n'
BAD_MAPPINGS: dict[str, tuple[str, list[str]]] = {
    "columns too": ('[columns]\nte = "x"\n' + MAPPING, ["line 1", "[columns] beside [orders]"]),
    "no table": ("orders = 3\n", ["line 1", "write '[orders]'"]),
    "column": (changed(("phase =", "fase =")), ["line 5", "'fase'", "did you mean 'phase'"]),
    "key": (changed(('unit = "deg"', 'units = "deg"')), ["line 5", "'units'", "did you mean 'unit'"]),
    "counts": (changed(('unit = "deg"', "counts_per_turn = 4")), ["line 5", "'counts_per_turn'"]),
    "sign of an order": (changed(('"Ordnung"', '{ name = "Ordnung", sign = -1 }')), ["line 3", "'sign'"]),
    "unit of an order": (changed(('"Ordnung"', '{ name = "Ordnung", unit = "Hz" }')), ["line 3", "'unit'"]),
    "scale": (changed(('"Ordnung"', '{ name = "Ordnung", scale = 0 }')), ["line 3", "scale = 0", "above 0"]),
    "scale alone": (changed((', unit = "arcmin"', ", scale = 2")), ["line 4", 'unit = "arcsec"']),
    "unit": (changed(('unit = "arcmin"', 'unit = "mm"')), ["line 4", "'mm' is no unit of angle"]),
    "unit of trade": (changed(('unit = "N*m"', 'unit = "kNm"')), ["line 6", "did you mean 'kN*m'"]),
    "minutes of arc": (changed(('unit = "arcmin"', "unit = \"'\"")), ["line 4", "did you mean 'arcmin'"]),
    "one word": (changed((', reverse = "rück"', "")), ["line 7", "no word for reverse"]),
    "one word for both": (changed(('"rück"', '"Vor"')), ["line 7", "forward and reverse are both 'vor'"]),
    "sign of words": (changed(('reverse = "rück"', 'reverse = "rück", sign = -1')), ["line 7", "'sign'"]),
    "direction of nothing": (changed((RULE, "3")), ["line 7", "direction = 3", "forward ="]),
    "twice": (MAPPING + HEAD, ["line 9", "direction stands in [orders] too"]),
    "mixed": (changed((f"direction = {RULE}\n", "")) + '[header]\ndirection = "mixed"\n', ["line 8", "'mixed'"]),
    "mean": (changed(("output_torque", "# output_torque")) + '[header]\noutput_torque = { name = "M", unit = "N*m" }\n',
             ["line 9", "'name'", "property"]),
    "speed of what": (MAPPING + '[header]\ninput_speed = "100 Hz"\n', ["line 9", "input_speed", "100 rpm"]),
    "no phase": (changed(('phase = { name = "Phase", unit = "deg" }\n', "")), ["[orders]", "amplitude without phase"]),
    "no order": (changed(('order = "Ordnung"\n', "")), ["[orders]", "there is no order"]),
    "both forms": (changed(("output_torque", "cos")).replace("N*m", "rad"), ["cos without sin"]),
}  # fmt: skip
BAD_REPORTS: dict[str, tuple[str, str, list[str]]] = {
    "name": (REPORT.replace("Phase", "Phasse"), MAPPING, ["line 1", "'Phase'", "did you mean 'Phasse'"]),
    "word": (REPORT.replace("400;rück", "400;zurück", 1), MAPPING,
             ["line 6", "direction = 'zurück'", "'vor' or 'rück'", "line 7"]),
    "no word": (REPORT.replace("400;rück", "400;", 1), MAPPING, ["line 6", "direction = ''"]),
    "words unsaid": (REPORT, changed((RULE, '"Richtung"')), ["line 2", "direction = 'vor'", "forward ="]),
    "standing": (in_words("0", "1"), changed((RULE, '"Richtung"')), ["line 2", "direction = '0'"]),
    "nan": (in_words("nan", "1"), changed((RULE, '"Richtung"')), ["line 2", "direction = 'nan'"]),
    "no unit": (REPORT, changed((', unit = "arcmin"', "")), ["'Amplitude'", "has no unit", 'unit = "arcsec"']),
    "other unit": (REPORT.replace("Amplitude", "Amplitude [arcsec]"), changed(('"Amplitude"', '"Amplitude [arcsec]"')),
                   ["in arcmin by the mapping", "'arcsec'"]),
    "other torque": (REPORT.replace("Drehmoment", "M [kNm]"), changed(('"Drehmoment"', '"M [kNm]"')),
                     ["in N*m by the mapping", "'kNm'"]),
    "other zero": (REPORT.replace("Drehmoment", "T [K]"),
                   changed(('output_torque = { name = "Drehmoment", unit = "N*m" }',
                            'temperature = { name = "T [K]", unit = "degC" }')), ["in degC by the mapping", "'K'"]),
    "negative amplitude": (REPORT.replace("0,05", "-0,05", 1), MAPPING, ["line 2", "amplitude = -3 arcsec"]),
    "order 0": (REPORT.replace("\n39", "\n0", 1), MAPPING, ["line 2", "order = 0"]),
    "no order": (REPORT.replace("\n39", "\n-", 1), MAPPING, ["line 2", "order is no number"]),
    "no phase": (REPORT.replace("-81,9", "", 1), MAPPING, ["line 2", "amplitude without phase"]),
    "twice": (REPORT + "39;0,06;1;400;vor\n", MAPPING, ["line 8", "order 39 stands in line 2"]),
    "absolute zero": (REPORT, MAPPING + '[header]\ntemperature = "-300 degC"\n', ["temperature", "absolute zero"]),
    "no property": (REPORT, MAPPING + '[header]\ntemperature = { property = "T" }\n', ["no property 'T'", "none"]),
    "property of no direction": ("Lauf: hin\n" + REPORT, changed((f"direction = {RULE}\n", "")) +
                                 '[header]\ndirection = { property = "Lauf" }\n', ["direction = 'hin'", "forward ="]),
    "property of no word": ("Lauf: hin\n" + REPORT, changed((f"direction = {RULE}\n", "")) +
                            '[header]\ndirection = { property = "Lauf", forward = "cw", reverse = "ccw" }\n',
                            ["'Lauf' is 'hin'", "'cw' or 'ccw'"]),
    "undecided": (REPORT.replace("0,0", "1,0").replace(",9", "").replace(",4", "").replace(",5", "").replace(",6", "")
                  .replace("1,05", "1,050").replace("1,07", "1,070").replace("1,02", "1,020").replace("1,03", "1,030")
                  .replace("1,0201", "1,021"), MAPPING, ["may be 1.050 or 1050", "decimal ="]),
    "too wide": (REPORT.replace("400;vor", "400;vor;3", 1), MAPPING, ["line 2", "6 cells, but 5 column names"]),
    "no direction": (REPORT, changed((f"direction = {RULE}\n", "")), ["there is no direction", "[orders]"]),
    "empty": ("\n", MAPPING, ["empty"]),
    "no rows": (REPORT.splitlines()[0] + "\n", MAPPING, ["no rows"]),
}  # fmt: skip


#: Or what can be written, listed.
LISTED = re.compile(r"\b(the keys are|the file has|record the run again)\b")


def refused(folder: Path, capsys: pytest.CaptureFixture[str], report: str, mapping: str, words: list[str]) -> None:
    """Of the command line: exit 2, one line on the error output, nothing written."""
    (folder / "bench.toml").write_text(mapping, encoding="utf-8")
    (folder / "report.csv").write_text(report, encoding="utf-8")
    assert main(["read", str(folder / "report.csv"), "--mapping", str(folder / "bench.toml")]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    (line,) = err.splitlines()
    for word in words:
        assert word in line
    assert REMEDY.search(line) or LISTED.search(line)


@pytest.mark.parametrize("name", BAD_MAPPINGS)
def test_a_wrong_mapping_gets_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    mapping, words = BAD_MAPPINGS[name]
    refused(tmp_path, capsys, REPORT, mapping, [str(tmp_path / "bench.toml"), *words])


@pytest.mark.parametrize("name", BAD_REPORTS)
def test_a_wrong_report_gets_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    report, mapping, words = BAD_REPORTS[name]
    refused(tmp_path, capsys, report, mapping, [str(tmp_path / "report.csv"), *words])


def test_a_mapping_of_tables_reads_no_run(tmp_path: Path) -> None:
    read(tmp_path)
    with pytest.raises(InputError, match=r"describes an order table by \[orders\]"):
        read_run(tmp_path / "report.csv", mapping=tmp_path / "bench.toml")


@pytest.mark.parametrize("unit", ["1/min", "U/min", "min-1"])
def test_words_for_speed_are_understood_in_the_refusal(unit: str) -> None:
    with pytest.raises(ValueError, match="did you mean 'rpm'"):
        unit_scale(unit, "angular_speed")
    assert unit_scale("rpm", "angular_speed")[1] == 0.0


# --- the command line -------------------------------------------------------------------------------------------------


def test_read_writes_the_table_and_diagnose_takes_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    read(tmp_path)
    assert main(["read", "report.csv", "--mapping", "bench.toml", "-o", "orders.csv"]) == 0
    capsys.readouterr()
    check(load_orders("orders.csv"))
    lines = Path("orders.csv").read_text().splitlines()
    assert lines[:2] == ["# kind: orders", "# (read from report.csv by bench.toml)"]
    assert main(["read", "orders.csv"]) == 2
    assert "an order table holds no samples" in capsys.readouterr().err
    mapping = load_mapping("bench.toml")
    assert isinstance(load_run("orders.csv", mapping=mapping), OrderTable)  # what says itself what it is needs none
    model = Model(reducer("RV-40E"), (effect("sensor.index_offset", offset="0.1 deg"),))
    save_model("model.toml", model)
    assert main(["diagnose", "model.toml", "report.csv", "--mapping", "bench.toml", "--json", "told.json"]) == 0
    assert "per 1000 N*m of load" not in capsys.readouterr().err
    assert Path("told.json").exists()
