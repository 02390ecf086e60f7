"""Files of measured parts: tables, spreadsheets, Q-DAS, what mappings say of them, and what is refused in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from openpyxl import Workbook

import rverror
from remedy import REMEDY
from rverror.base.errors import InputError
from rverror.parts.draft import draft_parts_mapping
from rverror.parts.mapping import load_parts_mapping

UNIT = rverror.reducer("RV-40E")
DISCS = """
kind = "disc"
serial = "Teil"
[file]
encoding = "cp1252"
[[error]]
key = "cycloid.disc_bore_position"
crank = 1
radial = { name = "Bohrung 1 r [µm]", unit = "um", uncertainty = "0.4 um" }
tangential = { name = "Bohrung 1 t [µm]", unit = "um", sign = -1, nominal = "1 um", uncertainty = "0.7 um" }
[[error]]
key = "cycloid.disc_pitch"
harmonic = 1
cos = { name = "Fp1 [mm]", unit = "mm", nominal = "2 um", scale = 0.5, uncertainty = "1 um" }
"""
HEADS = "Teil;Prüfer;Bohrung 1 r [µm];Bohrung 1 t [µm];Fp1 [mm]"
ROWS = ("D17;Huber;1,5;-2;0,004", "D18;Huber;0,25;1;-0,001", "D19;Huber;;1;0,002")
PLACES = """
kind = "carrier"
serial = "S"
[places]
number = "bore"
x = { name = "x", unit = "mm" }
y = { name = "y", unit = "mm" }
datum = "given"
"""


def read(folder: Path, mapping: str, lines: str, name: str = "parts.csv") -> rverror.parts.PartsRead:
    (folder / "mapping.toml").write_text(mapping, encoding="utf-8")
    (folder / name).write_text(lines, encoding="cp1252" if "cp1252" in mapping else "utf-8")
    return rverror.load_parts(folder / name, UNIT, mapping=folder / "mapping.toml")


def test_a_row_for_each_part(tmp_path: Path) -> None:
    found = read(tmp_path, DISCS, "\n".join(["Messprotokoll;;;;", HEADS, *ROWS]))
    assert [(part.kind, part.serial) for part in found.parts] == [("disc", "D17"), ("disc", "D18"), ("disc", "D19")]
    bore, pitch = found.parts[0].errors
    assert (bore.key, dict(bore.indices), bore.uncertainty) == ("cycloid.disc_bore_position", {"crank": 1}, 0.7e-3)
    assert bore.values == pytest.approx((1.5e-3, -(-2e-3 - 1e-3)))
    assert pitch.values == pytest.approx((0.5 * (4e-3 - 2e-3), 0.0))
    assert pitch.uncertainty == pytest.approx(0.5e-3)
    assert [error.key for error in found.parts[2].errors] == ["cycloid.disc_pitch"]
    assert any(
        "1 row left out for cycloid.disc_bore_position (crank 1), a cell holds no number: line 5" in note
        for note in found.notes
    )
    assert any("1 column of the file left out, not asked for: 'Prüfer'" in note for note in found.notes)


def test_a_spreadsheet_says_the_same(tmp_path: Path) -> None:
    book = Workbook()
    for row in ("", HEADS, *ROWS):
        cells = row.split(";")
        book.active.append([float(c.replace(",", ".")) if c[-1:].isdigit() and c[0] != "D" else c for c in cells])
    book.save(tmp_path / "parts.xlsx")
    text = read(tmp_path, DISCS, "\n".join([HEADS, *ROWS]))
    sheet = rverror.load_parts(tmp_path / "parts.xlsx", UNIT, mapping=tmp_path / "mapping.toml")
    assert [part.errors for part in sheet.parts] == [part.errors for part in text.parts]


def test_several_files_of_one_part_are_joined_and_read_back_exactly(tmp_path: Path) -> None:
    bores = read(tmp_path, DISCS, "\n".join([HEADS, *ROWS])).parts
    rverror.parts.save_parts(tmp_path / "one.csv", bores)
    more = [
        rverror.parts.MeasuredPart(
            "disc", "D18", (rverror.effect("cycloid.disc_lobe", lobe=3, deviation=-np.pi / 1000, uncertainty=1e-7 / 3),)
        ),
        rverror.parts.MeasuredPart("crank", "C, 1", (rverror.effect("crank.index", angle=1e-4 / 3),), "a; b.csv"),
        rverror.parts.MeasuredPart(
            "housing", "H1", (rverror.effect("cycloid.pin_radius", pin="all", deviation="1 um"),)
        ),
        rverror.parts.MeasuredPart("sun", "S1", ()),
    ]
    rverror.parts.save_parts(tmp_path / "two.csv", more)
    assert rverror.load_parts(tmp_path / "two.csv", UNIT) == rverror.parts.PartsRead(tuple(more))
    both = rverror.load_parts([tmp_path / "one.csv", tmp_path / "two.csv"], UNIT).parts
    assert both[1].errors == (*bores[1].errors, *more[0].errors)
    assert both[2:] == (bores[2], *more[1:])
    with pytest.raises(InputError, match="exists"):
        rverror.parts.save_parts(tmp_path / "two.csv", more)


COMMON = """K0100 2
K1001/1 planet
K2002/1 pitch
K2142/1 µm
K2002/2 bore
K2101/2 22
K2142/2 mm
"""
CODED = """K0001/1 1,5
K0001/2 22.003
K0014/0 P7
K0001/1 -2
K0002/1 256
K0001/2 21,999
K0014/0 P8
K0001/1 0.25
K0014/1 P9
"""
UNCODED = (
    "1.5\x140\x1401.01.2026/10:00:00\x0f22.003\x140\nK0014/1 P7\nK0014/2 P7\n"
    "-2\x14256\x0f21.999\nK0014/1 P8\nK0014/2 P8\n0.25\nK0014/1 P9\n"
)
PLANETS = """
kind = "planet"
[[error]]
key = "involute.planet_pitch"
harmonic = 1
cos = { name = "pitch", unit = "um" }
[[error]]
key = "involute.planet_eccentricity"
x = { name = "bore", nominal = "file", uncertainty = "1 um" }
"""


@pytest.mark.parametrize("values", [CODED, UNCODED])
@pytest.mark.parametrize("apart", [False, True])
def test_q_das_in_both_layouts_and_in_two_files(tmp_path: Path, values: str, apart: bool) -> None:
    (tmp_path / "mapping.toml").write_text(PLANETS, encoding="utf-8")
    files = {"p.dfd": COMMON, "p.dfx": values} if apart else {"p.dfq": COMMON + values}
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="cp1252")
    for name in files:
        found = rverror.load_parts(tmp_path / name, UNIT, mapping=tmp_path / "mapping.toml")
        sizes = {p.serial: [(e.key, round(e.values[0], 9)) for e in p.errors] for p in found.parts}
        pitch, bore = "involute.planet_pitch", "involute.planet_eccentricity"
        assert sizes == {"P7": [(pitch, 1.5e-3), (bore, 3e-3)], "P9": [(pitch, 2.5e-4)], "P8": [(bore, -1e-3)]}
        assert any("1 value left out, K0002 says so" in note for note in found.notes)


def test_a_draft_is_refused_until_it_is_filled_in(tmp_path: Path) -> None:
    (tmp_path / "scan.csv").write_text("SN;Winkel [°];Radius [mm]\nD1;0,5;62,1\nD1;1;62,3\nD1;1,5;62,4\n")
    draft = draft_parts_mapping(tmp_path / "scan.csv")
    (tmp_path / "mapping.toml").write_text(draft)
    with pytest.raises(InputError, match="datum = ''"):
        load_parts_mapping(tmp_path / "mapping.toml")
    (tmp_path / "mapping.toml").write_text(draft.replace('datum = ""', 'datum = "fit"'))
    with pytest.raises(InputError, match="uncertainty"):
        load_parts_mapping(tmp_path / "mapping.toml")
    filled = draft.replace('uncertainty = ""', 'uncertainty = "0.3 um"').replace('datum = ""', 'datum = "fit"')
    (tmp_path / "mapping.toml").write_text(filled)
    mapping = load_parts_mapping(tmp_path / "mapping.toml")
    assert (mapping.kind, mapping.text.separator, mapping.text.decimal) == ("disc", ";", ",")
    assert {key: column.rule.where.name for key, column in mapping.groups[0].columns.items()} == {
        "angle": "Winkel [°]", "radius": "Radius [mm]",
    }  # fmt: skip


def test_drafts_of_other_tables(tmp_path: Path) -> None:
    for heads, told in (
        ("pin,x,y,d", 'kind = "housing"'),
        ("tooth,fp [um],Fr [um]", "[teeth]"),
        ("cam,phi,r", "[circles]"),
        ("No,length,width", "[[error]]"),
    ):
        rows = [",".join(f"{row}.{column}" for column in range(heads.count(",") + 1)) for row in range(3)]
        (tmp_path / "a.csv").write_text("\n".join([heads, *rows]))
        assert told in draft_parts_mapping(tmp_path / "a.csv")
    (tmp_path / "p.dfq").write_text(COMMON + CODED)
    assert 'name = "bore", unit = "mm"' in draft_parts_mapping(tmp_path / "p.dfq")


def lobes(angles: str, unit: str = "deg") -> tuple[str, str]:
    mapping = f"""
kind = "disc"
serial = "S"
[lobes]
angle = {{ name = "a", unit = "{unit}" }}
radius = {{ name = "r", unit = "mm" }}
datum = "fit"
"""
    return mapping, f"S,a,r\n{angles}"


WHOLE = "".join(f"D1,{angle:.2f},62\n" for angle in np.linspace(0, 360, 700, endpoint=False))
HALF = "".join(f"D1,{angle:.2f},62\n" for angle in np.linspace(0, 180, 700))
BORES = "".join(f"K1,{i},{x:.4f},0\n" for i, x in enumerate((40.5, -40.5)))
HOSTILE = {
    "duplicate serials": (
        DISCS, "\n".join([HEADS, ROWS[0], ROWS[0]]),
        r"line 3: disc 'D17' has .* already, from .*line 2; keep one",
    ),
    "a missing column": (DISCS, "\n".join([HEADS.replace("Fp1", "Fp2"), *ROWS]), "line 1: there is no column 'Fp1"),
    "another unit": (DISCS, "\n".join([HEADS, *ROWS]).replace("[µm]", "[mm]"), "there is no column"),
    "a unit of the file": (
        DISCS.replace('r [µm]", unit = "um"', 'r [µm]", unit = "mm"'), "\n".join([HEADS, *ROWS]),
        r"is in mm by the mapping, but the file says 'µm'",
    ),
    "a size of no workshop": (
        DISCS, "\n".join([HEADS, ROWS[0].replace("1,5", "1500")]),
        r"line 2: .* radial would be 1500 um, beyond 10 times .*30 um",
    ),
    "no serial number": (DISCS, "\n".join([HEADS, ROWS[0].replace("D17", "")]), "line 2: no serial number"),
    "mixed decimals": (
        DISCS, "\n".join([HEADS, ROWS[0], ROWS[1].replace("0,25", "0.25")]), r"line 3, column 3: '0.25' holds '.'",
    ),
    "mixed separators": (
        DISCS, "\n".join([HEADS, ROWS[0], ROWS[1].replace(";", ",")]),
        "line 3: 1 cell, but 5 column names",
    ),
    "no rows": (DISCS, HEADS, "no rows"),
    "half a turn": (*lobes(HALF), r"line 2, disc 'D1': no readings from 180.0 to 360.0 deg, at most 9.2 deg"),
    "degrees as radians": (*lobes(HALF.replace("D1,", "D1,0"), "arcmin"), "no readings from .* scan a whole turn"),
    "crests alone": (
        *lobes("".join(f"D1,{(i + 0.5) / 39 * 360:.6f},62.5\n" for i in range(39))), "do not tell the errors apart",
    ),
    "no disc of the unit": (*lobes(WHOLE), "lobes of the unit are not found|would be"),
    "a missing bore": (PLACES, "S,bore,x,y\nK1,0,40.5,0\n", r"carrier 'K1': cranks 1 of 2 missing; measure all"),
    "a bore twice": (PLACES, "S,bore,x,y\n" + BORES + "K1,1,0,0\n", "cranks 1 of 2 measured twice"),
    "a bore that is none": (PLACES, "S,bore,x,y\n" + BORES + "K1,5,0,0\n", "number 5: a unit has cranks 0 to 1"),
    "XML": (
        PLACES, '<?xml version="1.0"?><gear_data/>', r"XML, such as GDE .VDI/VDE 2610., is not read; give the chart as",
    ),
    "kind": ('kind = "wheel"\n', "", "line 1: kind = 'wheel': must be one of crank"),
    "no table": ('kind = "disc"\n', "", r"a mapping has \[\[error\]\] tables"),
    "foreign error": (
        DISCS.replace("cycloid.disc_pitch", "crank.index"), "", r"line 12: key = 'crank.index': no error of a disc",
    ),
    "all discs at once": (
        DISCS.replace("cycloid.disc_pitch", "cycloid.profile_modification"), "", "no error of a disc",
    ),
    "foreign feature": (PLACES.replace("carrier", "sun"), "", r"\[places\] is of a housing or disc"),
    "no datum": (PLACES.replace('datum = "given"', ""), "", "datum = '': must be one of 'fit', 'axis'"),
    "no unit": (PLACES.replace('"x", unit = "mm"', '"x"'), "S,bore,x,y\n" + BORES, "x .'x'. has no unit"),
    "length in degrees": (PLACES.replace('"x", unit = "mm"', '"x", unit = "deg"'), "", "line 6: .*no unit of length"),
}  # fmt: skip


@pytest.mark.parametrize("name", HOSTILE)
def test_what_is_wrong_is_one_line_with_a_remedy(tmp_path: Path, name: str) -> None:
    mapping, lines, told = HOSTILE[name]
    with pytest.raises(InputError, match=told) as caught:
        read(tmp_path, mapping, lines)
    assert "\n" not in str(caught.value)
    assert REMEDY.search(str(caught.value)) or "scan" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("1;2;3\n", "no line begins with K0100"),
        ("K0100 1\nK2002/1 a\n", "no measured values"),
        (COMMON + "K0001/3 1\n", "line 8: a value of characteristic 3, which is not described"),
        (COMMON + "1\x0f2\x0f3\n", "line 8: .* nor values of 2 characteristics"),
        (COMMON + "K0001/1 1\nK0001/1 2\nK0001/2 3\n", "2 of 'pitch', 1 of 'bore', and not all have a serial number"),
        (COMMON + "K0001/1 1\nK0014/1 P1\nK0001/1 2\nK0014/1 P1\n", "'P1' has 'pitch' twice"),
        (
            "K1001/1 a\nK2002/1 pitch\nK2142/1 mm\nK0001/1 1\nK1001/2 b\nK2002/2 pitch\nK2142/2 um\nK0001/2 1\n",
            "'pitch' has more than one unit",
        ),
        (
            COMMON.replace("bore", "pitch").replace("K2101/2 22\nK2142/2 mm\n", "K2142/2 µm\n")
            + "K0001/1 1\nK0001/2 2\n",
            "two characteristics of a part are named 'pitch'",
        ),
        (COMMON + "K0001/1/9 1\n", "line 8: value 9 of characteristic 1, which has 0"),
        (COMMON + "K0001/1 1\nK0001/2 22.001\n", "no serial number"),
    ],
)
def test_a_wrong_q_das_file_is_one_line(tmp_path: Path, text: str, told: str) -> None:
    with pytest.raises(InputError, match=told):
        read(
            tmp_path,
            PLANETS.replace("involute.center_distance", "involute.planet_eccentricity").replace("radial", "x"),
            text,
            "p.dfq",
        )


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("crank,C1", "wheel,C1", "line 2: kind 'wheel' is none of"),
        ("crank.eccentricity", "crank.excentricity", "line 2: .*crank.eccentricity"),
        (",1,,,,radial", ",7,,,,radial", "line 2: .*disc = 7"),
        ("radial,0.002", "radial,?", "line 2: .*'. mm'"),
        (",tangential", ",radial", "line 2: 2 rows of crank.eccentricity give a parameter twice"),
        ("0.001,mm\n", "0.001,mm,9\n", "line 2: "),
        ("0.001,mm\n", "-0.001,mm\n", "line 2: .*uncertain"),
        ("parameter", "Parameter", "line 1: the columns of a table of parts"),
    ],
)  # fmt: skip
def test_a_changed_table_of_parts_is_one_line(tmp_path: Path, old: str, new: str, told: str) -> None:
    crank = rverror.effect("crank.eccentricity", disc=1, radial=0.002, uncertainty=0.001)
    rverror.parts.save_parts(tmp_path / "good.csv", [rverror.parts.MeasuredPart("crank", "C1", (crank,))])
    (tmp_path / "bad.csv").write_text((tmp_path / "good.csv").read_text().replace(old, new))
    with pytest.raises(InputError, match=told) as caught:
        rverror.load_parts(tmp_path / "bad.csv", UNIT)
    assert "\n" not in str(caught.value)
