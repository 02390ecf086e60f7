"""Comma-separated text with ``# key: value`` lines above the names: what run files and order tables share."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from rverror.base import units
from rverror.base.numbers import count_of
from rverror.base.text import PathLike, did_you_mean, read_text, shown, split_lines
from rverror.runs.bench.numerals import Numerals
from rverror.runs.reading import COLUMN_NAME, OfFile, refuse

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
class TextKind:
    """What a kind of text holds, and how its messages name it.

    Attributes
    ----------
    keys : collection of str
        Header keys that have a meaning.
    dimensions : mapping of str to str
        Of each known column; empty where it has no unit.
    examples : mapping of str to str
        Unit in which people write it.
    names, example : str
        Column names to write, and one of them.
    needed : str
        How many rows are needed.
    remedy : str
        What to do with a header key that stands among the rows.
    otherwise : str
        Another remedy for a text that cannot be read.
    """

    keys: Collection[str]
    dimensions: Mapping[str, str]
    examples: Mapping[str, str]
    names: str
    example: str
    needed: str
    remedy: str
    otherwise: str = ""


@dataclass(frozen=True, kw_only=True)
class TextTable(OfFile):
    """Lines of a text, told apart.

    Attributes
    ----------
    path : str
    kind : TextKind
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
    kind: TextKind
    lines: tuple[str, ...]
    first: int
    rows: tuple[int, ...]
    header: Mapping[str, Stated]

    @property
    def notes(self) -> tuple[str, ...]:
        """Header keys that look like known ones, in words."""
        return tuple(
            f"header key {shown(key)} in line {stated.line} has no meaning here and is only kept;{hint}"
            for key, stated in self.header.items()
            if key not in self.kind.keys and (hint := did_you_mean(key, self.kind.keys))
        )

    @property
    def metadata(self) -> dict[str, str]:
        """Every header key, as written."""
        return {stated.key: stated.value for stated in self.header.values()}

    @property
    def index(self) -> str:
        """Label of the zero; empty where nothing is said."""
        return self.header["index"].value if "index" in self.header else ""

    def number(self, key: str, dimension: str) -> float | None:
        """Value of a header key, core units; None where it is not there.

        Raises
        ------
        InputError
            If it is no number with a unit of its dimension.
        """
        if key not in self.header:
            return None
        stated = self.header[key]
        try:
            return units.parse(stated.value, dimension)
        except ValueError as error:
            self.refuse(f"line {stated.line}: {key}: {error}")

    def scales(self) -> dict[str, tuple[float, float] | None]:
        """Columns in their order: factor to core units and zero of a known one by its name, None of others by the cell.

        Raises
        ------
        InputError
            If they are no column names, one stands there twice, or a known one has not its unit.
        """
        known, found = self.kind.dimensions, dict[str, tuple[float, float] | None]()
        for at, cell, name, unit in self._names():
            key = name if name in known else cell
            if key in found:
                self.refuse(f"{at}: {key} stands in column {list(found).index(key) + 1} too; leave one of them")
            found[key] = None if name not in known else (1.0, 0.0)
            if known.get(name):
                written = f"write '{name}[{self.kind.examples[name]}]'"
                if not unit:
                    self.refuse(f"{at}: {name} has no unit; {written}")
                try:
                    found[key] = units.unit_scale(unit, known[name])
                except ValueError as error:
                    # The remedy of the units edge knows the dimension only, this one the column.
                    self.refuse(f"{at}: {name}: {str(error).partition(';')[0]}; {written}")
            elif name in known and name != cell.lower():
                self.refuse(f"{at}: {name} has no unit; write '{name}'")
        return found

    def _names(self) -> Iterator[tuple[str, str, str, str]]:
        """Place, for messages, cell, name in lower case and unit of each column."""
        line, where = self.lines[self.first], f"line {self.first + 1}"
        for sign, word in ((";", "semicolons"), ("\t", "tabs")):
            if sign in line and line.count(sign) >= line.count(","):
                self.refuse(
                    f"{where}: the columns are separated by {word}; use ',' between cells and '.' as decimal sign"
                    f"{self.kind.otherwise}"
                )
        cells = [cell.strip().strip('"').strip() for cell in line.split(",")]
        if all(NUMERALS.parse(cell) is not None for cell in cells):
            self.refuse(f"{where}: numbers where the column names should be; write '{self.kind.names}' first")
        for place, cell in enumerate(cells, 1):
            at = f"{where}, column {place}"
            if not cell:
                self.refuse(f"{at}: the column has no name; name it or delete the comma")
            match = COLUMN_NAME.match(cell)
            if match is None:
                self.refuse(f"{at}: {shown(cell)} is no column name; write it like '{self.kind.example}'")
            yield at, cell, match[1].strip().lower(), (match[2] or "").strip()

    def cells(self, width: int) -> list[list[str]]:
        """Cells of all rows.

        Raises
        ------
        InputError
            If those of a row are not as many as the column names.
        """
        return [self._cells(place, width) for place in self.rows]

    def _cells(self, place: int, width: int) -> list[str]:
        line = self.lines[place]
        cells = line.partition("#")[0].split(",")
        if len(cells) != width:
            if ";" in line:
                remedy = "use ',' between cells and '.' as decimal sign"
            elif len(cells) == 2 * width:
                remedy = "if the comma is the decimal sign, write '.' for it"
            else:
                remedy = "complete the row or delete it"
            self.refuse(f"line {place + 1}: {count_of(len(cells), 'cell')}, but {width} column names; {remedy}")
        return cells


def opened(path: PathLike, kind: TextKind) -> TextTable:
    """Read a text and tell its header, names and rows apart.

    Parameters
    ----------
    kind : TextKind

    Raises
    ------
    InputError
        If there are no names or no rows, or a header key says two things or stands among the rows.
    """
    name = str(path)
    lines = split_lines(read_text(path, otherwise=kind.otherwise))
    first = next((i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")), None)
    if first is None:
        what = "has no columns" if any(line.strip() for line in lines) else "is empty"
        refuse(name, f"the file {what}; write '{kind.names}' and rows of numbers")
    header = _header(name, lines[:first], kind.keys)
    rows = [i for i in range(first + 1, len(lines)) if lines[i].strip() and not lines[i].lstrip().startswith("#")]
    if not rows:
        refuse(name, f"line {first + 1}: no rows below the column names; {kind.needed}")
    for number, line in enumerate(lines[first + 1 :], first + 2):
        if (match := HEADER_LINE.match(line.strip())) and match[1].lower() in kind.keys:
            where = f"line {number}: {match[1]} stands among the rows"
            refuse(name, f"{where}; write it above the column names{kind.remedy}")
    return TextTable(path=name, kind=kind, lines=tuple(lines), first=first, rows=tuple(rows), header=header)


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


def header_lines(path: str, values: Mapping[str, str]) -> list[str]:
    """Lines of a header.

    Raises
    ------
    InputError
        If one would not read back.
    """
    head = [f"# {key}: {value}" for key, value in values.items()]
    for line, (key, value) in zip(head, values.items(), strict=True):
        match = HEADER_LINE.match(line)
        if len(split_lines(line)) > 1 or match is None or match.groups() != (key, value.strip()):
            refuse(path, f"the header {shown(line)} would not read back; use a plain word for the key and one line")
    return head
