"""Text of a bench: any separator and encoding, a preamble above the column names, numbers as instruments print them."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, zip_longest
from typing import NoReturn

import numpy as np

from rverror.base.numbers import count_of
from rverror.base.text import PathLike, decoded, did_you_mean, read_bytes, shown, some, split_lines
from rverror.runs.bench.columns import BenchFile, Entry, RawArray, some_names
from rverror.runs.bench.mapping import TextRules
from rverror.runs.reading import DIMENSIONS, HEADER_LINE, ORDER_KEYS, RUN_COLUMNS, Stated, bare_name, refuse

# 1.234 and 12,345,678: one digit to three, none of them a leading zero, then groups of three.
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(?:([.,])\d{3})(?:\1\d{3})*$")
_NUMERAL = re.compile(r"[+-]?[\d.,]*\d[\d.,]*(?:[eE][+-]?\d+)?$")


def number_in(cell: str, decimal: str = ".") -> float | None:
    """Value of a cell; None where it holds no number with this decimal sign, point or comma.

    Examples
    --------
    >>> number_in("-1234,5", ","), number_in("1.5", ",")
    (-1234.5, None)
    """
    text = cell.strip()
    if decimal == ",":
        if "." in text:
            return None
        text = text.replace(",", ".")
    try:
        return None if "_" in text else float(text)
    except ValueError:
        return None


_OF_DAY = re.compile(r"([01]?\d|2[0-3]):([0-5]\d):([0-5]\d(?:[.,]\d*)?)$")


def seconds_of_day(cell: str) -> float | None:
    """Seconds since midnight of a time of day such as ``12:34:56.789``; None of anything else.

    Examples
    --------
    >>> seconds_of_day("00:01:02,5"), seconds_of_day("24:00:00")
    (62.5, None)
    """
    match = _OF_DAY.match(cell)
    if match is None:
        return None
    return 3600 * int(match[1]) + 60 * int(match[2]) + float(match[3].replace(",", "."))


def is_number(cell: str) -> bool:
    """Tell a number, with point or comma, or a time of day.

    Examples
    --------
    >>> is_number("1,5"), is_number("12:00:01"), is_number("")
    (True, True, False)
    """
    return any(number_in(cell, sign) is not None for sign in ".,") or seconds_of_day(cell) is not None


@dataclass(frozen=True)
class Undecided:
    """A cell that leaves the decimal sign open.

    Attributes
    ----------
    place : int
        Its number in the order given.
    why : str
        What speaks against a decision.
    """

    place: int
    cell: str
    why: str


def found_decimal(cells: Iterable[str], *, point_is_decimal: bool = False) -> str | Undecided:
    """Decimal sign of cells; empty where no cell has one.

    A comma or point before exactly three digits may be a decimal sign or stand between thousands: ``1.234`` decides
    nothing, ``0.234``, ``1.23`` and ``1234.567`` do.

    Parameters
    ----------
    point_is_decimal : bool
        Whether a point can be nothing else, as where commas separate the columns.

    Examples
    --------
    >>> found_decimal(["1,5", "2,25"])
    ','
    >>> found_decimal(["1,234", "2,345"]).why
    'may be 1.234 or 1234'
    """
    seen = ""
    decided = False
    undecided: Undecided | None = None
    for place, cell in enumerate(map(str.strip, cells)):
        signs = [sign for sign in ".," if sign in cell]
        if not signs or not _NUMERAL.match(cell):
            continue  # words, such as a line of units, decide nothing
        sign = signs[0]
        if len(signs) > 1:
            return Undecided(place, cell, "holds a point and a comma")
        if cell.count(sign) > 1:
            return Undecided(place, cell, f"holds {sign!r} more than once")
        if seen and sign != seen:
            return Undecided(place, cell, f"holds {sign!r}, cells before it {seen!r}")
        seen = sign
        if not _GROUPED.match(cell) or (point_is_decimal and sign == "."):
            decided = True
        elif undecided is None:
            undecided = Undecided(place, cell, f"may be {cell.replace(',', '.')} or {cell.replace(sign, '')}")
    return undecided if undecided and not decided else seen


#: Separators that are tried, in this order; blanks only for a draft.
SEPARATORS = (";", "\t", ",", "|", " ")
_WORDS = {";": "semicolon", "\t": "tab", ",": "comma", "|": "bar", " ": "blanks"}
_OR_ENCODING = ', or write encoding = "{}" or another in [file] of a mapping (rverror read FILE --draft begins one)'
_UNIT = re.compile(r"[\[(]\s*([^\[\]()]+?)\s*[\])]\s*$")
_PROPERTY = re.compile(r"[#%;\s\"]*([^:=\t;,|]+?)[\"\s]*[:=\t;,|]\s*(.*)$")
_FAMILY = re.compile(r"(?<=\S)\s+\(.*\)$")  # of a unit: "deg (Angle)"
_BLANKS = re.compile(r"[ \t]+")


@dataclass(frozen=True)
class _Names:
    """The line of the column names; line -1 where there is none and columns are counted."""

    line: int
    separator: str
    cells: tuple[str, ...]


def open_text(
    path: PathLike, rules: TextRules, wanted: Sequence[str | int], standard: Sequence[str] = RUN_COLUMNS
) -> BenchFile:
    """Read a text file and find its column names.

    Parameters
    ----------
    rules : TextRules
        What is stated of it.
    wanted : sequence of str or int
        Names of columns, or their numbers from 1; where there is none, the standard ones are looked for, and what the
        file says of itself in lines ``# key: value`` counts.
    standard : sequence of str
        Columns of a run file or of an order table.

    Raises
    ------
    InputError
        If the text cannot be decoded, or its names, separator or decimal sign cannot be told.
    """
    name = str(path)
    formats = "an export as text, MAT, HDF5 or TDMS"
    text = decoded(name, read_bytes(path), rules.encoding, otherwise=_OR_ENCODING, wanted=formats)
    return open_lines(name, split_lines(text), rules, wanted, standard)


def open_lines(
    name: str,
    lines: Sequence[str],
    rules: TextRules,
    wanted: Sequence[str | int],
    standard: Sequence[str] = RUN_COLUMNS,
) -> BenchFile:
    """The same of lines, for other formats that are tables too.

    Parameters
    ----------
    name : str
        Of the file, for messages.
    lines : sequence of str
    rules, wanted, standard
        As for `open_text`.

    Raises
    ------
    InputError
        As `open_text`.
    """
    if not any(line.strip() for line in lines):
        refuse(name, "the file is empty; give one with rows of numbers")
    names = _found_names(name, lines, rules, wanted, standard)
    header = {} if wanted else _header(name, lines, names.line)
    first = names.line + 1 if names.cells else max(rules.skip, 0)
    rows = [i for i in range(first, len(lines)) if lines[i].strip() and not lines[i].lstrip().startswith("#")]
    place = f"line {names.line + 1}" if names.cells else ""
    if not rows:
        refuse(name, f"{place or 'the file'}: no rows below the column names; measure or export it again")
    table = [split_cells(lines[i], names.separator) for i in rows]
    facts = table[: described_columns(table)] if names.cells else []
    rows, table = rows[len(facts) :], table[len(facts) :]
    width = len(names.cells) or max(map(len, table))
    if names.cells:
        _check_widths(name, rows, table, names, complete=not wanted)
    used = _used(name, names, wanted, standard)
    more = _ended(table, used) if facts else 0  # where other columns were sampled more often
    rows, table = rows[: len(rows) - more], table[: len(table) - more]
    decimal, decimal_note = _decimal(name, rows, table, [i for i in used if i < width], rules, names.separator)
    cells = names.cells or tuple(f"column {i + 1}" for i in range(width))
    entries = tuple(replace(entry, size=len(rows)) for entry in column_facts(cells, facts))

    def cells_at(place: int) -> list[str]:
        return [row[place] if place < len(row) else "" for row in table]

    def columns(places: Sequence[int]) -> list[RawArray]:
        found = [_column(cells_at(place), decimal) for place in places]
        for place, values in zip(places, found, strict=True):
            if wanted and np.isnan(values.astype(np.float64)).all():
                at = f"line {rows[0] + 1}, column {place + 1}: {shown(cells_at(place)[0])}"
                refuse(
                    name,
                    f"{at} is no number, nor is any cell of {shown(cells[place], 60)}; choose another column, or "
                    f"correct decimal in [file] of the mapping (now {decimal!r})",
                )
        return found

    notes = []
    above = [line for line in lines[: max(names.line, 0)] if line.strip()]
    if names.cells and not rules.separator and (names.separator != "," or wanted):
        notes.append(f"separator found in {place}: {_WORDS[names.separator]}")
    if above and not all(line.lstrip().startswith("#") for line in above):
        notes.append(f"column names found in {place}; what stands above is the preamble")
    if facts:
        notes.append(f"{count_of(len(facts), 'line')} below the names that describe the columns")
    if more:
        notes.append(f"{count_of(more, 'row')} of faster columns left out, which begin where the mapping's columns end")
    return BenchFile(
        path=name,
        kind="text",
        entries=entries,
        columns=columns,
        properties=_properties(lines[: names.line] if names.cells else lines[: rows[0]]),
        header=header,
        notes=(*notes, *decimal_note),
        place=place,
        noun="line",
        labels=np.array(rows) + 1,
        decimal=decimal,
        cells=cells_at,
    )


def split_cells(line: str, separator: str) -> list[str]:
    """Cells of a line, without blanks and quotes around them.

    Parameters
    ----------
    separator : str
        A blank stands for any number of blanks and tabs.

    Examples
    --------
    >>> split_cells('1,5; "a;b" ;', ";")
    ['1,5', 'a;b', '']
    """
    if separator == " ":
        return _BLANKS.split(line.strip(" \t"))
    if '"' not in line:
        return [cell.strip() for cell in line.split(separator)]
    try:
        return [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]
    except csv.Error:  # a cell beyond csv's limit
        return [cell.strip() for cell in line.split(separator)]


# --- the column names -------------------------------------------------------------------------------------------------


def _found_names(
    path: str, lines: Sequence[str], rules: TextRules, wanted: Sequence[str | int], standard: Sequence[str]
) -> _Names:
    tried = (rules.separator,) if rules.separator else SEPARATORS[:-1]
    texts = [name for name in wanted if isinstance(name, str)]
    if wanted and not texts:
        if not rules.separator:
            refuse(path, 'columns given by number need the separator; write separator = ";" or another in [file]')
        return _Names(-1, rules.separator, ())
    # Time or a torque may stand in any preamble.
    telling = [name for name in standard if DIMENSIONS[name] in ("angle", "")]

    def fits(cells: Sequence[str]) -> bool:
        if texts:
            return set(texts) <= set(cells)
        return any(bare_name(cell) in telling for cell in cells)

    filled = [i for i, line in enumerate(lines) if line.strip() and i >= rules.skip]
    if not filled:
        refuse(path, f"skip = {rules.skip}, but the file has {len(lines)} lines; correct skip in [file]")
    candidates = filled[:1] if rules.skip >= 0 else filled

    def names_at(i: int) -> list[_Names]:
        return [_Names(i, sign, tuple(names_in(lines[i], sign))) for sign in tried]

    for i in candidates:
        fitting = [names for names in names_at(i) if fits(names.cells)]
        # A single name holds no separator: every sign fits then, and the one that splits the line is meant.
        split = [names for names in fitting if len(names.cells) > 1] or fitting[:1]
        if len(split) > 1:
            words = " and ".join(_WORDS[names.separator] for names in split)
            refuse(path, f"line {i + 1}: {words} both separate the column names; write separator = ... in [file]")
        if split:
            return split[0]
    _refuse_names(path, [names for i in candidates[:1000] for names in names_at(i)], texts or telling)


def names_in(line: str, separator: str) -> list[str]:
    """Names in a line, without the comment sign that some programs put before them.

    Examples
    --------
    >>> names_in("# Antrieb; Abtrieb;;", ";")
    ['Antrieb', 'Abtrieb']
    """
    bare = line.lstrip().lstrip("#%").strip(" ") if line.lstrip().startswith(("#", "%")) else line
    return trimmed(split_cells(bare, separator))


def trimmed(cells: Sequence[str]) -> list[str]:
    """Cells without the empty ones that separators at the end make.

    Examples
    --------
    >>> trimmed(["a", "", "b", "", ""])
    ['a', '', 'b']
    """
    return list(cells[: max((i + 1 for i, cell in enumerate(cells) if cell), default=0)])


def _used(path: str, names: _Names, wanted: Sequence[str | int], standard: Sequence[str]) -> list[int]:
    """Places of the columns that are read."""
    if not wanted:
        return [i for i, cell in enumerate(names.cells) if bare_name(cell) in standard]
    found = []
    for name in wanted:
        places = [name] if isinstance(name, int) else [i + 1 for i, cell in enumerate(names.cells) if cell == name]
        if len(places) > 1:
            remedy = f"write column = {places[0]} instead of name in the mapping"
            refuse(path, f"line {names.line + 1}: {shown(name)} names columns {some(places)}; {remedy}")
        found.append(places[0] - 1)
    return found


def _refuse_names(path: str, tried: Sequence[_Names], wanted: Sequence[str]) -> NoReturn:
    """Say which name is missing in the line that has most of them or the like."""

    def near(names: _Names) -> int:
        return sum(bool(did_you_mean(text, filter(None, names.cells))) for text in wanted)

    best = max(tried, key=near)
    if not near(best):
        signs = ", ".join(dict.fromkeys(_WORDS[names.separator] for names in tried))
        refuse(
            path,
            f"no line holds column names such as {some_names(wanted)} (separators tried: {signs}); check the names and "
            "the encoding, or describe the file in a mapping (rverror read FILE --draft begins one)",
        )
    missing = next(text for text in wanted if text not in best.cells)
    hint = did_you_mean(missing, [cell for cell in best.cells if cell and cell not in wanted])
    names = some_names(best.cells)
    refuse(path, f"line {best.line + 1}: there is no column {shown(missing, 60)};{hint} the names are {names}")


def unit_in_name(cell: str) -> str:
    """Unit that stands in brackets at the end of a name; empty where there is none.

    Examples
    --------
    >>> unit_in_name("Winkel Abtrieb [°]"), unit_in_name("angle (deg)"), unit_in_name("angle")
    ('°', 'deg', '')
    """
    match = _UNIT.search(cell)
    return match[1] if match else ""


def described_columns(rows: Sequence[Sequence[str]]) -> int:
    """Rows below the names that describe the columns: a word in the first cell, where those below have a number.

    TwinCAT Scope writes some 16 of them, such as ``SampleTime[ms];1;1``, most of which hold numbers too.  Of a single
    one, a line of units, the rows without numbers tell.

    Examples
    --------
    >>> described_columns([["Port", "851"], ["Unit", "deg"], ["0", "1.5"]])
    2
    >>> described_columns([["s", "deg"], ["0", "1.5"]])
    0
    """
    count = next((i for i, row in enumerate(rows) if not row[0] or is_number(row[0])), 0)
    return count if count > 1 and rows[count][0] else 0


def _ended(table: Sequence[Sequence[str]], used: Sequence[int]) -> int:
    """Rows at the end in which none of the columns that are used has a cell."""
    filled = (i for i in reversed(range(len(table))) if any(table[i][at : at + 1] not in ([], [""]) for at in used))
    return len(table) - 1 - next(filled, len(table) - 1)


def column_facts(names: Sequence[str], rows: Sequence[Sequence[str]]) -> list[Entry]:
    """Columns with the unit and the interval between samples that rows with a key in front state of them.

    Parameters
    ----------
    names : sequence of str
    rows : sequence of sequence of str
        The key first, such as ``Unit`` or ``SampleTime[ms]``, then a cell for each column.

    Examples
    --------
    >>> column_facts(["Name", "phi"], [["Unit", "deg (Angle)"], ["SampleTime[ms]", "0,5"]])[1]
    Entry(name='phi', unit='deg', size=-1, problem='', increment=0.0005)
    """
    header = {row[0].lower(): row for row in rows}
    units = [_FAMILY.sub("", cell).strip("[]() ") for cell in header.get("unit", ())]
    intervals = [number_in(cell.replace(",", ".")) for cell in header.get("sampletime[ms]", ())]
    return [
        Entry(
            name=name,
            unit=unit_in_name(name) or (unit if unit and unit not in ("None", "Unit") else ""),
            increment=(interval or 0.0) * 1e-3,
        )
        for name, unit, interval in islice(zip_longest(names, units, intervals), len(names))
    ]


def _header(path: str, lines: Sequence[str], names: int) -> dict[str, Stated]:
    """What lines ``# key: value`` above the names state; known keys in lower case."""
    found: dict[str, Stated] = {}
    for number, line in enumerate(lines, 1):
        match = HEADER_LINE.match(line.strip())
        if match is None:
            continue
        known = match[1].lower() in ORDER_KEYS
        key, stated = match[1].lower() if known else match[1], Stated(text=match[2], at=f"line {number}")
        if known and number > names:
            refuse(path, f"{stated.at}: {key} stands among the rows; write it above the column names, and each run in "
                         "a file of its own")  # fmt: skip
        if known and found.get(key, stated).text != stated.text:
            before = found[key]
            refuse(path, f"{stated.at}: {key} = {shown(stated.text)}, but {before.at} says {shown(before.text)}; leave "
                         "one of them")  # fmt: skip
        if number <= names:
            found[key] = stated
    return found


def _properties(lines: Sequence[str]) -> Mapping[str, str]:
    """Lines of the preamble that name a value, ``Load: 20 N*m`` or ``Load;20``; the first of a name counts."""
    found: dict[str, str] = {}
    for line in lines:
        if match := _PROPERTY.match(line.strip()):
            found.setdefault(match[1].strip(), match[2].strip(' \t;,|"'))
    return found


# --- the rows ---------------------------------------------------------------------------------------------------------


def _check_widths(path: str, rows: Sequence[int], table: list[list[str]], names: _Names, *, complete: bool) -> None:
    """Refuse rows with cells that no column names, or with another separator: their numbers may be in wrong columns.

    Parameters
    ----------
    complete : bool
        Whether each row must have all cells.
    """
    width = len(names.cells)
    others = [sign for sign in SEPARATORS[:-1] if sign != names.separator]
    for i, cells in zip(rows, table, strict=True):
        if len(cells) > width and any(cells[width:]):
            remedy = "complete the names or delete the cells"
            if names.separator == "," and len(cells) == 2 * width:
                remedy = (
                    "if the comma is the decimal sign too, the file cannot be read: export it with ';' between cells"
                )
        elif len(cells) == 1 < width - 1 and any(cells[0].count(sign) >= width - 1 for sign in others):
            remedy = "correct the line, which has another separator"
        elif len(cells) < width and complete:
            remedy = "complete the row or delete it"
        else:
            continue
        refuse(path, f"line {i + 1}: {count_of(len(cells), 'cell')}, but {width} column names; {remedy}")


def _decimal(
    path: str, rows: Sequence[int], table: list[list[str]], used: Sequence[int], rules: TextRules, separator: str
) -> tuple[str, list[str]]:
    """Decimal sign, and a note where that was found and not stated."""
    if rules.decimal:
        return rules.decimal, []
    if separator == "," and not any("," in cell for cells in table for cell in cells):  # nothing is left to be found
        return ".", []
    where = [(row, place) for row, cells in enumerate(table) for place in used if place < len(cells)]
    found = found_decimal((table[row][place] for row, place in where), point_is_decimal=separator == ",")
    if isinstance(found, Undecided):
        row, place = where[found.place]
        refuse(
            path,
            f"line {rows[row] + 1}, column {place + 1}: {shown(found.cell)} {found.why}; write decimal = '.' or ',' in "
            "[file] of the mapping, and export numbers without signs between thousands",
        )
    told = found and not (found == "." and separator == ",")
    return found or ".", [f"decimal sign found in the rows: {found!r}"] if told else []


def _column(cells: Sequence[str], decimal: str) -> RawArray:
    """Numbers of a column, NaN where a cell holds none; or its times of day, where its cells are such."""
    if seconds_of_day(next(filter(None, cells), "")) is not None:
        times = ["NaT" if (of_day := seconds_of_day(cell)) is None else round(1e9 * of_day) for cell in cells]
        return np.array(times, dtype="timedelta64[ns]")
    if decimal == "." and "_" not in "".join(cells):  # which Python reads over
        try:
            return np.array(cells, dtype=np.float64)
        except ValueError:  # some cell is no number
            pass
    return np.array([number_in(cell, decimal) for cell in cells], dtype=np.float64)  # None is NaN
