"""Comma-separated text with ``# key: value`` lines above the names: what run files and order tables share."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from rverror.base import units
from rverror.base.numbers import count_of
from rverror.base.text import PathLike, did_you_mean, read_text, shown, split_lines
from rverror.runs.bench.numerals import Numerals
from rverror.runs.reading import COLUMN_NAME, refuse

#: A line of the header.
HEADER_LINE = re.compile(r"#+\s*([A-Za-z_][\w .\-/]*?)\s*:\s*(.*?)\s*$")
#: How such a text writes numbers.
NUMERALS = Numerals()


@dataclass(frozen=True, kw_only=True)
class Stated:
    """One line of the header.

    Attributes
    ----------
    value : str
    line : int
        Its number in the file.
    key : str
        As written.
    """

    value: str
    line: int
    key: str


@dataclass(frozen=True, kw_only=True)
class TextTable:
    """Lines of a text, told apart.

    Attributes
    ----------
    path : str
    lines : tuple of str
        All of them.
    first : int
        Place of the line of column names.
    rows : tuple of int
        Places of the rows below it.
    header : mapping of str to Stated
        By key: known ones in lower case.
    """

    path: str
    lines: tuple[str, ...]
    first: int
    rows: tuple[int, ...]
    header: Mapping[str, Stated]

    def notes(self, keys: Collection[str]) -> tuple[str, ...]:
        """What is to be noted of header keys that have no meaning but are written much like one that has."""
        return tuple(
            f"header key {shown(key)} in line {stated.line} has no meaning here and is only kept;{hint}"
            for key, stated in self.header.items()
            if key not in keys and (hint := did_you_mean(key, keys))
        )

    @property
    def metadata(self) -> dict[str, str]:
        """Every header key, as written."""
        return {stated.key: stated.value for stated in self.header.values()}


def opened(
    path: PathLike, *, keys: Collection[str], names: str, needed: str, remedy: str, otherwise: str = ""
) -> TextTable:
    """Read a text and tell its header, names and rows apart.

    Parameters
    ----------
    keys : collection of str
        Header keys that have a meaning.
    names : str
        Column names to write, for messages.
    needed : str
        How many rows are needed, for messages.
    remedy : str
        What to do with a header key that stands among the rows.
    otherwise : str
        Another remedy for a text that cannot be read.

    Raises
    ------
    InputError
        If there are no names or no rows, or a header key says two things or stands among the rows.
    """
    name = str(path)
    lines = split_lines(read_text(path, otherwise=otherwise))
    first = next((i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")), None)
    if first is None:
        what = "has no columns" if any(line.strip() for line in lines) else "is empty"
        refuse(name, f"the file {what}; write '{names}' and rows of numbers")
    header = _header(name, lines[:first], keys)
    rows = [i for i in range(first + 1, len(lines)) if lines[i].strip() and not lines[i].lstrip().startswith("#")]
    if not rows:
        refuse(name, f"line {first + 1}: no rows below the column names; {needed}")
    for number in range(first + 1, len(lines)):
        line = lines[number].strip()
        if line.startswith("#") and (match := HEADER_LINE.match(line)) and match[1].lower() in keys:
            refuse(
                name, f"line {number + 1}: {match[1]} stands among the rows; write it above the column names{remedy}"
            )
    return TextTable(path=name, lines=tuple(lines), first=first, rows=tuple(rows), header=header)


def _header(path: str, lines: Sequence[str], keys: Collection[str]) -> dict[str, Stated]:
    found: dict[str, Stated] = {}
    for number, line in enumerate(lines, 1):
        match = HEADER_LINE.match(line.strip())
        if match is None:
            continue
        key, value = match.groups()
        known = key.lower() if key.lower() in keys else key
        if known in found and known in keys and found[known].value != value:
            before = found[known]
            refuse(
                path,
                f"line {number}: {key} = {shown(value)}, but line {before.line} says {shown(before.value)}; "
                "leave one of them",
            )
        found[known] = Stated(value=value, line=number, key=key)
    return found


def header_number(text: TextTable, key: str, dimension: str) -> float | None:
    """Value of a header key, core units; None where it is not there.

    Raises
    ------
    InputError
        If it is no number with a unit of its dimension.
    """
    if key not in text.header:
        return None
    stated = text.header[key]
    try:
        return units.parse(stated.value, dimension)
    except ValueError as error:
        refuse(text.path, f"line {stated.line}: {key}: {error}")


def column_names(text: TextTable, *, names: str, example: str, otherwise: str = "") -> Iterator[tuple[str, str, str]]:
    """Place, for messages, cell and name in lower case of each column.

    Parameters
    ----------
    names : str
        Column names to write, for messages.
    example : str
        One of them.
    otherwise : str
        Another remedy, for the end of messages.

    Raises
    ------
    InputError
        If the line holds numbers, is separated by another sign, or a column has no name.
    """
    path, line = text.path, text.lines[text.first]
    where = f"line {text.first + 1}"
    for sign, word in ((";", "semicolons"), ("\t", "tabs")):
        if sign in line and line.count(sign) >= line.count(","):
            refuse(
                path,
                f"{where}: the columns are separated by {word}; use ',' between cells and '.' as decimal sign"
                f"{otherwise}",
            )
    cells = [cell.strip().strip('"').strip() for cell in line.split(",")]
    if all(NUMERALS.parse(cell) is not None for cell in cells):
        refuse(path, f"{where}: numbers where the column names should be; write '{names}' first")
    for place, cell in enumerate(cells, 1):
        at = f"{where}, column {place}"
        if not cell:
            refuse(path, f"{at}: the column has no name; name it or delete the comma")
        match = COLUMN_NAME.match(cell)
        if match is None:
            refuse(path, f"{at}: {shown(cell)} is no column name; write it like '{example}'")
        yield at, cell, match[1].strip().lower()


def column_unit(path: str, at: str, *, cell: str, name: str, example: str, dimension: str) -> tuple[float, float]:
    """Factor to core units of a column, and the zero of its unit in them.

    Parameters
    ----------
    at : str
        Place of the column, for messages.
    cell : str
        Its name as written, with the unit.
    name : str
        The known name.
    example : str
        A unit to write.

    Raises
    ------
    InputError
        If there is no unit, or none of the dimension.
    """
    match = COLUMN_NAME.match(cell)
    unit = ((match[2] if match else None) or "").strip()
    if not unit:
        refuse(path, f"{at}: {name} has no unit; write '{name}[{example}]'")
    try:
        return units.unit_scale(unit, dimension)
    except ValueError as error:
        # The remedy of the units edge knows the dimension only, this one the column.
        refuse(path, f"{at}: {name}: {str(error).partition(';')[0]}; write '{name}[{example}]'")


def cells_of(text: TextTable, place: int, width: int) -> list[str]:
    """Cells of a row.

    Raises
    ------
    InputError
        If they are not as many as the column names.
    """
    line = text.lines[place]
    cells = line.partition("#")[0].split(",")
    if len(cells) != width:
        if ";" in line:
            remedy = "use ',' between cells and '.' as decimal sign"
        elif len(cells) == 2 * width:
            remedy = "if the comma is the decimal sign, write '.' for it"
        else:
            remedy = "complete the row or delete it"
        refuse(text.path, f"line {place + 1}: {count_of(len(cells), 'cell')}, but {width} column names; {remedy}")
    return cells
