"""Run files as rverror writes them: comma-separated text, ``# key: value`` lines above the names, units in brackets."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.numbers import count_of
from rverror.base.text import PathLike, did_you_mean, read_text, shown, split_lines
from rverror.runs.bench.numerals import Numerals
from rverror.runs.checks import LEAST_SAMPLES
from rverror.runs.reading import (
    COLUMN_NAME,
    COLUMNS,
    DIRECTIONS,
    EXAMPLES,
    HEADER_KEYS,
    Reading,
    check_needed,
    checked_value,
    refuse,
)

#: A line of the header.
HEADER_LINE = re.compile(r"#+\s*([A-Za-z_][\w .\-/]*?)\s*:\s*(.*?)\s*$")
_NUMERALS = Numerals()
_MAPPING = ", or describe the file in a mapping (rverror read FILE --draft begins one)"


def read_run_file(path: PathLike) -> Reading:
    """Read a run file.

    Raises
    ------
    InputError
        If the text cannot be used; one line that names file, line, column, bound and remedy.
    """
    name = str(path)
    lines = split_lines(read_text(path, otherwise=_MAPPING))
    first = next((i for i, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")), None)
    if first is None:
        what = "has no columns" if any(line.strip() for line in lines) else "is empty"
        refuse(name, f"the file {what}; write 'input_angle[deg],output_angle[deg]' and rows of numbers")
    header = _header(name, lines[:first])
    factors = _columns(name, lines[first], first + 1)
    rows = [i for i in range(first + 1, len(lines)) if lines[i].strip() and not lines[i].lstrip().startswith("#")]
    if not rows:
        refuse(name, f"line {first + 1}: no rows below the column names; {LEAST_SAMPLES} samples or more are needed")
    _check_later_comments(name, lines, first)
    table = _numbers(name, lines, rows, len(factors))
    columns: dict[str, Array] = {}
    extra: dict[str, Array] = {}
    for (label, factor), values in zip(factors.items(), table.T, strict=True):
        if factor is None:
            extra[label] = values
        else:
            with np.errstate(over="ignore"):  # what overflows is left out later, and counted
                columns[label] = values * factor
    return Reading(
        path=name,
        columns=columns,
        extra=extra,
        labels=np.array(rows) + 1,
        noun="line",
        stated=_stated_direction(name, header),
        stated_at=f"line {header['direction'][1]}: " if "direction" in header else "",
        torque=_header_value(name, header, "output_torque", "torque"),
        temperature=_header_value(name, header, "temperature", "temperature"),
        index=header["index"][0] if "index" in header else "",
        metadata={text: value for value, _, text in header.values()},
        notes=tuple(
            f"header key {shown(key)} in line {line} has no meaning here and is only kept;{hint}"
            for key, (_, line, _) in header.items()
            if key not in HEADER_KEYS and (hint := did_you_mean(key, HEADER_KEYS))
        ),
    )


# --- the header -------------------------------------------------------------------------------------------------------

_Header = dict[str, tuple[str, int, str]]  # lower-case key: value, line, key as written


def _header(path: str, lines: Sequence[str]) -> _Header:
    found: _Header = {}
    for number, line in enumerate(lines, 1):
        match = HEADER_LINE.match(line.strip())
        if match is None:
            continue
        key, value = match.groups()
        known = key.lower() if key.lower() in HEADER_KEYS else key
        if known in found and known in HEADER_KEYS and found[known][0] != value:
            refuse(
                path,
                f"line {number}: {key} = {shown(value)}, but line {found[known][1]} says {shown(found[known][0])}; "
                "leave one of them",
            )
        found[known] = (value, number, key)
    return found


def _header_value(path: str, header: _Header, key: str, dimension: str) -> float | None:
    if key not in header:
        return None
    value, line, _ = header[key]
    try:
        number = units.parse(value, dimension)
    except ValueError as error:
        refuse(path, f"line {line}: {key}: {error}")
    return checked_value(path, f"line {line}: {key}", number, dimension)


def _stated_direction(path: str, header: _Header) -> float | None:
    """+1, -1, 0 for mixed, None where nothing is said."""
    if "direction" not in header:
        return None
    value, line, _ = header["direction"]
    if value.lower() not in DIRECTIONS:
        hint = did_you_mean(value, DIRECTIONS)
        refuse(path, f"line {line}: direction = {shown(value)}: must be forward, reverse or mixed;{hint or ' use one'}")
    return DIRECTIONS[value.lower()]


def _check_later_comments(path: str, lines: Sequence[str], first: int) -> None:
    for number in range(first + 1, len(lines)):
        line = lines[number].strip()
        if line.startswith("#") and (match := HEADER_LINE.match(line)) and match[1].lower() in HEADER_KEYS:
            refuse(
                path,
                f"line {number + 1}: {match[1]} stands among the rows; write it above the column names, and each run "
                "in a file of its own",
            )


# --- the columns ------------------------------------------------------------------------------------------------------


def _columns(path: str, line: str, number: int) -> dict[str, float | None]:
    """Columns by name, in their order: core units for one of a known column's numbers, None for the others."""
    where = f"line {number}"
    for sign, word in ((";", "semicolons"), ("\t", "tabs")):
        if sign in line and line.count(sign) >= line.count(","):
            refuse(
                path,
                f"{where}: the columns are separated by {word}; use ',' between cells and '.' as decimal sign"
                f"{_MAPPING}",
            )
    cells = [cell.strip().strip('"').strip() for cell in line.split(",")]
    if all(_NUMERALS.parse(cell) is not None for cell in cells):
        refuse(
            path, f"{where}: numbers where the column names should be; write 'input_angle[deg],output_angle[deg]' first"
        )
    factors: dict[str, float | None] = {}
    for place, cell in enumerate(cells, 1):
        at = f"{where}, column {place}"
        if not cell:
            refuse(path, f"{at}: the column has no name; name it or delete the comma")
        match = COLUMN_NAME.match(cell)
        if match is None:
            refuse(path, f"{at}: {shown(cell)} is no column name; write it like 'input_angle[deg]'")
        name, unit = match[1].strip(), match[2]
        known = name.lower() if name.lower() in COLUMNS else None
        key = known or cell
        if key in factors:
            refuse(path, f"{at}: {key} stands in column {list(factors).index(key) + 1} too; leave one of them")
        if known is None:
            factors[key] = None
            continue
        if not (unit or "").strip():
            refuse(path, f"{at}: {known} has no unit; write '{known}[{EXAMPLES[known]}]'")
        try:
            factors[key] = units.unit_factor(str(unit).strip(), COLUMNS[known])
        except ValueError as error:
            # The remedy of the units edge knows the dimension only, this one the column.
            refuse(path, f"{at}: {known}: {str(error).partition(';')[0]}; write '{known}[{EXAMPLES[known]}]'")
    check_needed(path, where, list(factors), _MAPPING)
    return factors


# --- the rows ---------------------------------------------------------------------------------------------------------


def _numbers(path: str, lines: Sequence[str], rows: Sequence[int], width: int) -> Array:
    """Parse all rows at once; only where that fails look at each line."""
    try:
        table: Array = np.loadtxt([lines[i] for i in rows], delimiter=",", dtype=np.float64, ndmin=2)
        if table.shape == (len(rows), width):
            return table
    except ValueError:
        pass
    table = np.full((len(rows), width), np.nan)
    for row, i in enumerate(rows):
        cells = lines[i].partition("#")[0].split(",")
        if len(cells) != width:
            if ";" in lines[i]:
                remedy = "use ',' between cells and '.' as decimal sign"
            elif len(cells) == 2 * width:
                remedy = "if the comma is the decimal sign, write '.' for it"
            else:
                remedy = "complete the row or delete it"
            refuse(path, f"line {i + 1}: {count_of(len(cells), 'cell')}, but {width} column names; {remedy}")
        for column, cell in enumerate(cells):
            value = _NUMERALS.parse(cell)
            if value is not None:
                table[row, column] = value
    return table
