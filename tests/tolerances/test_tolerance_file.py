"""Tolerance files: what is read, and what is refused at which line."""

from __future__ import annotations

import contextlib
import csv
import re
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings, strategies as st

import rverror
from pages import ROOT
from rverror.base.errors import InputError
from rverror.tolerances.cost import Grades, Reciprocal, ReciprocalSquare
from rverror.tolerances.declared import tolerance
from rverror.tolerances.distribution import Circle, Normal, Rayleigh, Samples
from rverror.tolerances.tolerance_file import load_tolerances, save_widths

UNIT = rverror.Model(rverror.reducer("RV-40E"))
FULL = """\
name = "drawing 12"

[[tolerance]]
key = "crank.eccentricity"
indices = { disc = 0 }
tolerance = "5 um"
capability = 1.33
correlation = 0.8
phase = "random"
fixed = true
bounds = ["2 um", "20 um"]
cost = { curve = "reciprocal", price = 12.0, at = "5 um", base = 3.0 }

[[tolerance]]
key = "cycloid.disc_pitch"
indices = { harmonic = [1, 2] }
parameters = ["sin"]
grade = "IT5"
size = "32 mm"
mean = "2 um"
distribution = "normal"
cost = { grades = { IT4 = 40.0, IT5 = 22, IT6 = 12.0 }, size = "32 mm" }

[[tolerance]]
key = "coupling.carrier_bore_position"
tolerance = "0.004 mm"
distribution = "circle"
cost = { table = [["3 um", 30.0], ["5 um", 18.0], ["10 um", 9.0]] }

[[tolerance]]
key = "thermal.growth"
tolerance = "3 K"
mean = { discs = "5 K" }
cost = { curve = "reciprocal_square", price = 1, at = "5 K" }

[[tolerance]]
key = "crank.index"
samples = ["10 arcsec", "-20 arcsec", "0 arcsec"]
"""


def table(*lines: str) -> str:
    return "\n".join(["[[tolerance]]", *lines, ""])


ECCENTRIC = ('key = "crank.eccentricity"', 'tolerance = "5 um"')


@pytest.fixture
def written(tmp_path: Path):  # type: ignore[no-untyped-def]
    def write(text: str, name: str = "tolerances.toml") -> Path:
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_a_file_with_everything(written) -> None:  # type: ignore[no-untyped-def]
    cams, pitch, bores, warm, index = load_tolerances(written(FULL), UNIT)
    assert cams == tolerance(
        "crank.eccentricity",
        "5 um",
        disc=0,
        capability=1.33,
        correlation=0.8,
        phase="random",
        fixed=True,
        bounds=("2 um", "20 um"),
        cost=Reciprocal(price=12.0, at=5e-3, base=3.0),
    )
    assert cams.distribution == Rayleigh(1.33)
    assert pitch.distribution == Normal()
    assert pitch.width == pytest.approx(5.5e-3)  # IT5 of 30 to 50 mm is 11 um
    assert pitch.mean == pytest.approx({"sin": 2e-3})
    assert [i["harmonic"] for i in pitch.instances(UNIT.mechanism)] == [1, 2, 1, 2]
    assert isinstance(pitch.cost, Grades)
    assert pitch.cost.names == ("IT4", "IT5", "IT6")
    assert pitch.cost.widths == pytest.approx((3.5e-3, 5.5e-3, 8e-3))
    assert bores.distribution == Circle()
    assert isinstance(bores.cost, Grades)
    assert bores.cost.widths == pytest.approx((3e-3, 5e-3, 10e-3))
    assert bores.cost.prices == (30.0, 18.0, 9.0)
    assert (warm.width, warm.mean) == (3.0, {"discs": 5.0})
    assert warm.cost == ReciprocalSquare(price=1.0, at=5.0)
    assert isinstance(index.distribution, Samples)
    arcsec = rverror.base.units.ARCSEC
    assert index.width == pytest.approx((20 - 10 / 3) * arcsec)


@pytest.mark.parametrize("indent", [" " * 5000, "\t" * 5000])
def test_long_lines_without_a_key_are_passed_over(written, tmp_path: Path, indent: str) -> None:  # type: ignore[no-untyped-def]
    """A pattern that tries every way of splitting such a line would never return."""
    lines = f'[\n{indent}"10 arcsec",  # first\n{indent}"-20 arcsec",\n{indent}# last\n{indent}"0 arcsec"]'
    wrapped = FULL.replace('["10 arcsec", "-20 arcsec", "0 arcsec"]', lines)
    items = load_tolerances(written(wrapped), UNIT)
    assert items == load_tolerances(written(FULL, "plain.toml"), UNIT)
    save_widths(written(wrapped), tmp_path / "new.toml", [item.width for item in items])
    assert (tmp_path / "new.toml").read_text(encoding="utf-8") == wrapped


def test_files_of_the_repository_and_of_the_page_read(written) -> None:  # type: ignore[no-untyped-def]
    model = rverror.load_model(ROOT / "examples" / "rv40e.toml")
    assert model.mechanism == UNIT.mechanism
    items = load_tolerances(ROOT / "examples" / "rv40e-tolerances.toml", model)
    assert all(item.cost is not None for item in items)
    page = (ROOT / "docs" / "theory" / "budget.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```toml\n(.*?)```", page, flags=re.DOTALL)
    # its means and its phase exclude each other
    without = [
        re.sub(r"^phase.*\n", "", block, flags=re.M),
        re.sub(r"^(mean|parameters|distribution).*\n", "", block, flags=re.M),
    ]
    first, second = (load_tolerances(written(text), UNIT)[0] for text in without)
    assert (first.correlation, first.mean, second.random_phase) == (0.8, {"radial": 2e-3}, True)


# --- writing ----------------------------------------------------------------------------------------------------------


def test_new_widths_leave_all_else_as_written(written, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    text = FULL.replace('tolerance = "0.004 mm"', "  tolerance = '0.004 mm'  # drawing").replace("\n", "\r\n")
    source = tmp_path / "old.toml"
    source.write_bytes(text.encode())
    target = tmp_path / "new.toml"
    before = load_tolerances(source)
    new = [0.0031234567, 3.5e-3, before[2].width / 3, 3.0, before[4].width]
    save_widths(source, target, new, grades=[None, "IT4", "3 um", None, None])
    after = load_tolerances(target, UNIT)
    assert [item.width for item in after] == pytest.approx([0.003123, 3.5e-3, 0.001333, 3.0, before[4].width])
    assert [replace(a, width=1.0) for a in after] == [replace(b, width=1.0) for b in before]
    read = target.read_bytes().decode()
    assert '  tolerance = "1.333 um"  # drawing\r\n' in read
    assert 'grade = "IT4"\r\nsize = "32 mm"\r\n' in read
    old, changed = (set(t.split("\r\n")) for t in (text, read))
    assert len(changed - old) == 3
    save_widths(source, source, [b.width for b in before], overwrite=True)
    assert source.read_bytes().decode() == text


def test_a_grade_gives_way_to_a_width_that_is_none(written, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    text = table('key = "crank.eccentricity"', 'grade = "IT5"', 'size = "32 mm"', "fixed = true")
    target = tmp_path / "new.toml"
    save_widths(written(text), target, [2e-3], grades=["own name"])
    assert target.read_text(encoding="utf-8") == text.replace('grade = "IT5"', 'tolerance = "2 um"')


@given(st.floats(1e-6, 10))
def test_a_written_width_is_never_wider(tmp_path_factory, width: float) -> None:  # type: ignore[no-untyped-def]
    folder = tmp_path_factory.getbasetemp()
    (folder / "one.toml").write_text(table(*ECCENTRIC), encoding="utf-8")
    save_widths(folder / "one.toml", folder / "two.toml", [width], overwrite=True)
    (after,) = load_tolerances(folder / "two.toml")
    assert width * (1 - 1e-3) <= after.width <= width * (1 + 1e-8)


@pytest.mark.parametrize(
    ("text", "widths", "said"),
    [
        (table(*ECCENTRIC), [1e-3, 2e-3], "2 widths for 1 tolerances"),
        (table('key = "crank.index"', 'samples = ["1 arcsec", "2 arcsec"]'), [1.0], "line 3: .*fixed = true"),
        (table(*ECCENTRIC), [-1e-3], "width = -0.001 for crank.eccentricity: must be above 0"),
        ('tolerance = [{ key = "crank.index", tolerance = "1 arcsec" }]', [1.0], "line 1: .*line of its own"),
        (table(ECCENTRIC[0], 'tolerance = """5 um"""'), [1e-3], "line 3: .*line of its own"),
    ],
)
def test_widths_that_cannot_be_written_are_refused(
    written, tmp_path: Path, text: str, widths: list[float], said: str
) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match=said):
        save_widths(written(text), tmp_path / "new.toml", widths)
    assert not (tmp_path / "new.toml").exists()


def test_an_existing_file_is_kept(written) -> None:  # type: ignore[no-untyped-def]
    path = written(table(*ECCENTRIC))
    with pytest.raises(InputError, match="the file exists"):
        save_widths(path, path, [1e-3])


# --- refusals ---------------------------------------------------------------------------------------------------------


REFUSED = [
    ("", "the file is empty"),
    ("name = 1", "line 1: name = 1: must be a text"),
    ("[tolerance]\nkey = 'crank.index'", "line 1: tolerance is a single table"),
    ("name = 'x'\n", "no tolerance; write"),
    ("tolerances = []", "line 1: unknown top-level key 'tolerances'; did you mean 'tolerance'"),
    ("[[tolerance]\n", "no valid TOML"),
    (table('key = "crank.index"', "tolerance = 5 um"), "line 3.* no valid TOML.*with quotes"),
    (table('tolerance = "5 um"'), "line 1: .* lacks key"),
    (table('key = "crank.excentricity"'), "line 2: no error source .* did you mean 'crank.eccentricity'"),
    (table(*ECCENTRIC, "tolerence = 1"), "line 4: unknown key .* did you mean 'tolerance'"),
    (table('key = "crank.eccentricity"'), "line 2: crank.eccentricity: no tolerance; give one of"),
    (table(*ECCENTRIC, 'grade = "IT5"'), "line 4: crank.eccentricity: tolerance and grade side by side"),
    (table('key = "crank.eccentricity"', "tolerance = 5"), "line 3: tolerance = 5 has no unit"),
    (table('key = "crank.eccentricity"', 'tolerance = "5 arcsec"'), "line 3: .*tolerance: .*use one like 'um'"),
    (table('key = "crank.eccentricity"', 'tolerance = "0 um"'), "line 3: .*must be above 0"),
    (table('key = "crank.eccentricity"', 'grade = "IT5"'), "line 3: a grade needs the size"),
    (table('key = "crank.eccentricity"', 'grade = "IT99"', 'size = "3 mm"'), "line 3: no tolerance grade 'IT99'"),
    (table('key = "crank.eccentricity"', 'grade = "IT5"', 'size = "3 m"'), "line 3: size 3000 mm"),
    (table('key = "crank.index"', 'grade = "IT5"', 'size = "3 mm"'), "line 3: .*a grade is of a length"),
    (table(*ECCENTRIC, "indices = 3"), "line 4: indices = 3: must be a table; write indices = { crank = 0 }"),
    (table(*ECCENTRIC, "indices = { dics = 0 }"), "line 4: .*no index 'dics'; did you mean 'disc'"),
    (table(*ECCENTRIC, "indices = { disc = 2 }"), "line 2: .*disc = 2; it must be one of 0, 1"),
    (table(*ECCENTRIC, "indices = { disc = 0.5 }"), "line 4: disc = 0.5: must be a whole number"),
    (table(*ECCENTRIC, "indices = { disc = [] }"), "line 4: disc = .*: must be a whole number"),
    (table('key = "cycloid.disc_pitch"', 'tolerance = "5 um"'), "line 2: .*no harmonic; give which ones"),
    (
        table(*ECCENTRIC, 'parameters = ["radail"]'),
        "line 4: crank.eccentricity: parameters: no parameter 'radail'; did you mean 'radial'",
    ),
    (table(*ECCENTRIC, 'parameters = "radial"'), "line 4: .*must be a list"),
    (table(*ECCENTRIC, "parameters = []"), "line 4: .*must be a list"),
    (table(*ECCENTRIC, 'distribution = "gauss"'), "line 2: .*no distribution 'gauss'"),
    (table(*ECCENTRIC, "distribution = 1"), "line 4: distribution = 1: must be a text"),
    (table(*ECCENTRIC, 'capability = "1"'), "line 4: capability = '1': must be a bare number"),
    (table(*ECCENTRIC, "capability = 0"), "line 4: capability = 0: must be above 0"),
    (table(*ECCENTRIC, "capability = true"), "line 4: capability = True: must be a bare number"),
    (table(*ECCENTRIC, "correlation = nan"), "line 4: .*correlation = nan: must be from 0 to 1"),
    (table(*ECCENTRIC, "correlation = 2"), "line 4: .*correlation = 2"),
    (table(*ECCENTRIC, 'distribution = "ring"', "correlation = 0.5"), "line 5: .*use 'rayleigh'"),
    (table(*ECCENTRIC, 'phase = "any"'), "line 4: .*must be 'random'"),
    (table(*ECCENTRIC, 'phase = "random"', 'mean = { radial = "1 um" }'), "line 2: .*is no mean"),
    (table(*ECCENTRIC, 'mean = "1 um"'), "line 4: .*which parameter"),
    (table(*ECCENTRIC, 'mean = { x = "1 um" }'), "line 4: .*mean of 'x'"),
    (table(*ECCENTRIC, "fixed = 1"), "line 4: fixed = 1: must be true or false"),
    (table(*ECCENTRIC, 'bounds = ["1 um"]'), "line 4: .*two widths"),
    (table(*ECCENTRIC, 'bounds = ["4 um", "1 um"]'), "line 4: .*the smaller first"),
    (table(*ECCENTRIC, "cost = 3"), "line 4: cost = 3: no kind of cost"),
    (table(*ECCENTRIC, "cost = { price = 3 }"), "line 4: .*no kind of cost"),
    (table(*ECCENTRIC, 'cost = { curve = "line", price = 3 }'), "line 4: no cost curve 'line'"),
    (table(*ECCENTRIC, 'cost = { curve = "reciprocal", price = 3 }'), "line 4: the cost has no at"),
    (table(*ECCENTRIC, 'cost = { curve = "reciprocal", price = "3", at = "1 um" }'), "line 4: price = '3'"),
    (table(*ECCENTRIC, 'cost = { curve = "reciprocal", price = -3, at = "1 um" }'), "line 4: cost: price"),
    (table(*ECCENTRIC, 'cost = { curve = "reciprocal", prise = 3, at = "1 um" }'), "line 4: unknown key .*'price'"),
    (table(*ECCENTRIC, "cost = { grades = { IT5 = 3 } }"), "line 4: a grade needs the size"),
    (table(*ECCENTRIC, "cost = { grades = [1] }"), "line 4: .*must be a table"),
    (
        table(*ECCENTRIC, 'cost = { grades = { IT5 = 3, IT6 = 9 }, size = "32 mm" }'),
        "line 4: cost: grade IT6 .*costs more",
    ),
    (table(*ECCENTRIC, 'cost = { table = ["3 um"] }'), "line 4: .*must be pairs"),
    (table(*ECCENTRIC, 'cost = { table = [["3 um", "x"]] }'), "line 4: price = 'x'"),
    (table('key = "crank.index"', "samples = 3"), "line 3: samples = 3: must be a list of measured values"),
    (table('key = "crank.index"', "samples = []"), "line 3: samples: there are none"),
    (table('key = "crank.index"', 'samples = ["1 arcsec", "1 arcsec"]'), "line 3: samples: all 2 values are equal"),
    (table('key = "crank.index"', 'samples = ["1 um"]'), "line 3: crank.index: samples: .*no unit of angle"),
    (table('key = "crank.bearing_clearance"', 'tolerance = "5 um"'), "line 3: .*give a mean of 5 um or more"),
    (table('key = "shaft.eccentricity"', 'tolerance = "5 arcsec"'), "line 2: shaft.eccentricity does not act"),
    (table(*ECCENTRIC) + "[[tolerance]]\nkey = 3\n", "line 5: key = 3: must be a text"),
    ("tolerance = [3]", "line 1: tolerance holds 3, which is no table"),
]


@pytest.mark.parametrize(("text", "said"), REFUSED, ids=[said for _, said in REFUSED])
def test_what_is_wrong_is_named_with_its_line(written, text: str, said: str) -> None:  # type: ignore[no-untyped-def]
    path = written(text)
    with pytest.raises(InputError) as caught:
        load_tolerances(path, UNIT)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert message.count(str(path)) == 1
    assert "\n" not in message
    assert re.search(said, message), message


WORDS = st.sampled_from(
    [
        '"5 um"',
        '"ISO 1328 5"',
        '"9 mm"',
        '"x"',
        "1",
        "-1.5",
        "true",
        "nan",
        "inf",
        "[]",
        '["1 um"]',
        "{}",
        '{ a = "1 um" }',
        "1979-05-27",
    ]
)


@given(
    st.dictionaries(
        st.sampled_from(
            [
                "indices",
                "parameters",
                "tolerance",
                "grade",
                "size",
                "diameter",
                "module",
                "samples",
                "distribution",
                "capability",
                "mean",
                "correlation",
                "phase",
                "fixed",
                "bounds",
                "cost",
            ]
        ),
        WORDS,
        max_size=4,
    ),
    st.sampled_from(["crank.eccentricity", "crank.index", "crank.bearing_clearance", "involute.sun_pitch"]),
)
@settings(deadline=None, max_examples=300)
def test_nothing_but_an_input_error_comes_of_a_bad_file(tmp_path_factory, keys: dict[str, str], key: str) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path_factory.getbasetemp() / "fuzz.toml"
    path.write_text(table(f'key = "{key}"', *(f"{name} = {value}" for name, value in keys.items())), encoding="utf-8")
    with contextlib.suppress(InputError):  # whatever else comes up fails the test
        assert load_tolerances(path, UNIT)[0].width > 0


# --- limits, names, tables ------------------------------------------------------------------------------------------

WITH_LIMITS = """\
[[tolerance]]
name = "cams"
key = "crank.eccentricity"
parameters = ["radial"]
tolerance = "±5 um"
cost = { curve = "reciprocal", price = 12, at = "5 um", base = 1 }

[[tolerance]]
name = "bores"
key = "cycloid.disc_bore_position"
indices = { disc = [0, 1] }
parameters = ["radial"]
tolerance = ["-0.003 mm", "0.009 mm"]  # drawing 7
distribution = "uniform"
correlated_with = { cams = 0.6 }
fixed = true

[[tolerance]]
key = "crank.bearing_clearance"
tolerance = "+16/+4 um"
distribution = "lognormal"
shape = 0.2310490601866484
bounds = ["1 um", "7 um"]
cost = { curve = "reciprocal_square", price = 3, at = "6 um" }
"""
AS_TABLE = """\
# of drawing 7
name,key,parameter,tolerance[um],lower,upper,distribution,shape,disc,correlated with,fixed,price,at,base,curve,least,largest
cams,crank.eccentricity,radial,5,,,,,,,,12,5 um,1,,,
bores,cycloid.disc_bore_position,radial,,-0.003 mm,0.009 mm,uniform,,"0, 1",cams: 0.6,yes,,,,,,

,crank.bearing_clearance,,,4 um,16 um,lognormal,0.2310490601866484,,,no,3,6 um,,reciprocal_square,1 um,7 um
"""  # noqa: E501


def test_a_table_says_what_a_tolerance_file_says(tmp_path: Path) -> None:
    toml, table = tmp_path / "t.toml", tmp_path / "t.csv"
    toml.write_text(WITH_LIMITS, encoding="utf-8")
    table.write_text(AS_TABLE, encoding="utf-8")
    assert load_tolerances(table, UNIT) == load_tolerances(toml, UNIT)
    cams, bores, clearance = load_tolerances(toml, UNIT)
    assert (cams.width, cams.label, cams.mean) == (pytest.approx(5e-3), "cams", {})
    assert bores.mean["radial"] == pytest.approx(3e-3)
    assert bores.correlated_with == {"cams": 0.6}
    assert clearance.width == pytest.approx(6e-3)
    semicolons = AS_TABLE.replace('"0, 1"', "0").replace(",", ";")  # as spreadsheets of some countries save it
    table.write_text(semicolons, encoding="utf-8")
    assert load_tolerances(table, UNIT)[0] == cams


def test_a_spreadsheet_says_what_a_table_says(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    table, book = tmp_path / "t.csv", openpyxl.Workbook()
    table.write_text(AS_TABLE, encoding="utf-8")
    for row in csv.reader(AS_TABLE.splitlines()):
        book.active.append([float(cell) if cell.isdigit() else cell or None for cell in row])
    book.save(tmp_path / "t.xlsx")
    assert load_tolerances(tmp_path / "t.xlsx", UNIT) == load_tolerances(table, UNIT)
    (tmp_path / "u.xlsx").write_text("no workbook")
    with pytest.raises(InputError, match="no workbook that can be read"):
        load_tolerances(tmp_path / "u.xlsx")


def test_a_spreadsheet_without_its_library_tells_the_remedy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    (tmp_path / "t.xlsx").write_bytes(b"PK")
    with pytest.raises(InputError, match=r"rverror\[io\].*CSV") as caught:
        load_tolerances(tmp_path / "t.xlsx")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("before", "after", "words"),
    [
        ("lower,", "lwoer,", ["line 2", "'lwoer'", "did you mean 'lower'"]),
        ("name,key", "name,name", ["line 2", "no column 'key'"]),
        ("0.009 mm", "", ["line 4", "lower and upper", "both or neither"]),
        ("cams: 0.6", "cams 0.6", ["line 4", "'cams: 0.6; bores: -0.2'"]),
        ("cams: 0.6", "cam: 0.6", ["t.csv", "'cam'", "did you mean 'cams'"]),
        ("yes", "maybe", ["line 4", "yes or no"]),
        ("12,5 um,1,", "much,5 um,1,", ["line 3", "price", "number"]),
        ("12,5 um,1,,,", "12,5 um,1,,,,7", ["line 3", "cells"]),
        ("radial,5", "radial,five", ["line 3", "five", "5 um"]),
        ("crank.eccentricity", "crank.eccentrcity", ["line 3", "crank.eccentricity"]),
    ],
)
def test_a_wrong_cell_is_told_with_its_row(before: str, after: str, words: list[str], tmp_path: Path) -> None:
    table = tmp_path / "t.csv"
    assert before in AS_TABLE
    table.write_text(AS_TABLE.replace(before, after, 1), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_tolerances(table, UNIT)
    assert "\n" not in str(caught.value)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize("text", ["", "# nothing\n", "key,tolerance[um]\n"])
def test_an_empty_table_is_refused(text: str, tmp_path: Path) -> None:
    table = tmp_path / "t.csv"
    table.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"empty|no tolerance"):
        load_tolerances(table)


def test_two_limits_are_saved_as_two_limits_about_the_same_mean(tmp_path: Path) -> None:
    old, new = tmp_path / "old.toml", tmp_path / "new.toml"
    old.write_text(WITH_LIMITS, encoding="utf-8")
    before = load_tolerances(old)
    save_widths(old, new, [4e-3, 2e-3, 3e-3])
    after = load_tolerances(new)
    assert [item.width for item in after] == pytest.approx([4e-3, 2e-3, 3e-3])
    for one, other in zip(before, after, strict=True):
        assert dict(other.mean) == pytest.approx(dict(one.mean))
        assert other.distribution.variance == pytest.approx(one.distribution.variance)
    text = new.read_text(encoding="utf-8")
    assert 'tolerance = "+5/+1 um"  # drawing 7' in text
    (tmp_path / "t.csv").write_text(AS_TABLE, encoding="utf-8")
    with pytest.raises(InputError, match="TOML"):
        save_widths(tmp_path / "t.csv", new, [4e-3, 2e-3, 3e-3], overwrite=True)
