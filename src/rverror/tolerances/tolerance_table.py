"""Tolerances in a table, CSV or a spreadsheet: a row for each, read as a tolerance file is."""

from __future__ import annotations

import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rverror.base import units
from rverror.base.errors import InputError
from rverror.base.spreadsheet import sheet_rows
from rverror.base.text import PathLike, did_you_mean, read_text, shown
from rverror.base.toml import Place, TomlText
from rverror.model.catalogue import CATALOGUE

#: Columns of texts, of bare numbers, and of the rest of a row; those of the indices have the names of the catalogue.
_TEXTS = ("name", "key", "tolerance", "grade", "size", "diameter", "module", "distribution", "mean", "phase", "at")
_NUMBERS = ("capability", "shape", "correlation", "classes", "price", "base")
_OTHERS = ("lower", "upper", "parameter", "correlated_with", "fit", "least", "largest", "fixed", "curve")
_INDICES = tuple(dict.fromkeys(index.name for entry in CATALOGUE.values() for index in entry.indices))
_WITH_UNIT = ("tolerance", "lower", "upper", "mean", "size", "diameter", "module", "at", "least", "largest")
_CURVE = ("curve", "price", "at", "base")
_YES, _NO = ("true", "yes", "1", "x"), ("false", "no", "0", "")
_EXAMPLE = "write a first line such as 'key, tolerance[um], distribution'"


def is_table(name: str) -> bool:
    """Whether a file of this name is a table, not a TOML text."""
    return Path(name).suffix.lower() in _READERS


def read_table(path: PathLike) -> TomlText:
    """Read a table of tolerances: the same content as a TOML text has, with the row of each.

    Parameters
    ----------
    path : str or path-like
        Its first row has the names of the columns, a unit in brackets where the cells have none; ``key`` is needed.
        Rows that begin with # are left out, and so are empty ones.

    Raises
    ------
    InputError
        If the file cannot be read, a column is not known, or a cell cannot be what its column says.
    """
    name = str(path)
    rows = _rows(path)
    if not rows:
        raise InputError(f"{name}: the table is empty; {_EXAMPLE}")
    (line, heads), *body = rows
    columns = [_column(name, line, head) for head in heads]
    if "key" not in [column for column, _ in columns]:
        raise InputError(f"{name}, line {line}: no column 'key'; {_EXAMPLE}")
    if not body:
        raise InputError(f"{name}: no tolerance below the first line; add a row for each")
    lines: dict[Place, int] = {}
    listed = []
    for i, (number, row) in enumerate(body):
        if any(cell for cell in row[len(columns) :]):
            raise InputError(f"{name}, line {number}: {len(row)} cells for {len(columns)} columns; correct the row")
        given = {column: (cell, unit) for (column, unit), cell in zip(columns, row, strict=False) if column and cell}
        listed.append(_entry(f"{name}, line {number}", given))
        lines |= {("tolerance", i): number, ("tolerance",): number}
    return TomlText(name, {"tolerance": listed}, lines)


def _column(name: str, line: int, head: str) -> tuple[str, str]:
    """Column and unit of a title."""
    title, _, unit = head.partition("[")
    title = title.strip().lower().replace(" ", "_")
    known = (*_TEXTS, *_NUMBERS, *_OTHERS, *_INDICES)
    if title and title not in known:
        hint = did_you_mean(title, known)
        raise InputError(
            f"{name}, line {line}: unknown column {shown(title)};{hint} the columns are {', '.join(known)}"
        )
    return title, unit.rstrip("] ")


def _entry(where: str, given: Mapping[str, tuple[str, str]]) -> dict[str, Any]:
    """Content of a ``[[tolerance]]`` table."""
    cells = {name: _with_unit(cell, unit) if name in _WITH_UNIT else cell for name, (cell, unit) in given.items()}
    entry: dict[str, Any] = {name: cells[name] for name in _TEXTS if name in cells and name not in _CURVE}
    entry |= {name: _number(where, name, cells[name]) for name in _NUMBERS if name in cells and name not in _CURVE}
    for ends, name in ((("lower", "upper"), "tolerance"), (("least", "largest"), "bounds")):
        pair = [cells[end] for end in ends if end in cells]
        if len(pair) == 1 or (pair and name in entry):
            raise InputError(f"{where}: {' and '.join(ends)} are two, in place of {name}; give both or neither")
        if pair:
            entry[name] = pair
    if "parameter" in cells:
        entry["parameters"] = [part.strip() for part in cells["parameter"].split(",")]
    indices = {name: _indices(cells[name]) for name in _INDICES if name in cells}
    if indices:
        entry["indices"] = indices
    if "correlated_with" in cells:
        entry["correlated_with"] = _correlations(where, cells["correlated_with"])
    if "fit" in cells:
        entry["fit"] = _fit(where, cells["fit"])
    if "fixed" in cells:
        if cells["fixed"].lower() not in (*_YES, *_NO):
            raise InputError(f"{where}: fixed is {shown(cells['fixed'])}; write yes or no")
        entry["fixed"] = cells["fixed"].lower() in _YES
    cost = {
        name: _number(where, name, cells[name]) if name in _NUMBERS else cells[name] for name in _CURVE if name in cells
    }
    if cost:
        entry["cost"] = {"curve": "reciprocal", **cost}
    return entry


def _with_unit(cell: str, unit: str) -> str:
    """Cell with the unit of its column, where it has none itself."""
    return f"{cell} {unit}" if unit and not any(letter.isalpha() for letter in cell.replace("e", "")) else cell


def _number(where: str, name: str, cell: str) -> float:
    try:
        return float(cell)
    except ValueError as error:
        raise InputError(f"{where}: {name} is {shown(cell)}; give a number") from error


def _indices(cell: str) -> Any:
    found = [int(part) if part.strip().lstrip("-").isdigit() else part.strip() for part in cell.split(",")]
    return found[0] if len(found) == 1 else found


def _correlations(where: str, cell: str) -> dict[str, float]:
    """Names and numbers of ``cams: 0.6; bores: -0.2``."""
    pairs = [part.rpartition(":") for part in cell.split(";") if part.strip()]
    if not all(colon for _, colon, _ in pairs):
        raise InputError(f"{where}: correlated_with is {shown(cell)}; write it like 'cams: 0.6; bores: -0.2'")
    return {name.strip(): _number(where, "correlated_with", value) for name, _, value in pairs}


def _fit(where: str, cell: str) -> dict[str, Any]:
    """Other tolerance, classes and order of ``bores: 3 opposite``."""
    name, _, rest = cell.rpartition(":")
    number, _, order = rest.strip().partition(" ")
    if not name or not number.isdigit() or order.strip() not in ("", "opposite"):
        raise InputError(f"{where}: fit is {shown(cell)}; write it like 'bores: 3' or 'bores: 3 opposite'")
    return {"with": name.strip(), "classes": int(number), "opposite": bool(order)}


def column_of(path: Path, name: str | None, dimension: str) -> list[float]:
    """Values of a column ``name[unit]`` of a table, core units; of the only one where no name is given."""
    rows = _rows(path)
    example = f"size[{units.DISPLAY_UNITS[dimension]}]"
    if not rows:
        raise InputError(
            f"{path}: the file is empty; write the column's name and unit, like '{example}', and values below"
        )
    (line, heads), *body = rows
    titles = [head.partition("[")[0].strip() for head in heads]
    if name is None and len(titles) > 1:
        raise InputError(
            f"{path}: {len(titles)} columns; say which: samples = {{ file = ..., column = '{titles[0]}' }}"
        )
    if name is not None and name not in titles:
        raise InputError(
            f"{path}: no column {shown(name)};{did_you_mean(name, titles)} the columns are {', '.join(titles)}"
        )
    at = 0 if name is None else titles.index(name)
    unit = heads[at].partition("[")[2].rstrip("] ")
    if not unit:
        raise InputError(f"{path}, line {line}: {shown(heads[at])} has no unit; write it like '{example}'")
    try:
        factor = units.unit_factor(unit, dimension)
    except ValueError as error:
        raise InputError(f"{path}, line {line}: {error}") from error
    values = []
    for number, row in body:
        try:
            values.append(float(row[at]) * factor)
        except (IndexError, ValueError) as error:
            said = f"{shown(','.join(row))} has no number in column {at + 1}; correct it"
            raise InputError(f"{path}, line {number}: {said}") from error
    return values


def _rows(path: PathLike) -> list[tuple[int, list[str]]]:
    """Rows that hold anything, with their numbers."""
    rows = _READERS.get(Path(str(path)).suffix.lower(), _csv_rows)(path)
    return [(number, row) for number, row in rows if any(row) and not row[0].startswith("#")]


def _csv_rows(path: PathLike) -> list[tuple[int, list[str]]]:
    text = read_text(path)
    head = next((line for line in text.splitlines() if line.strip() and not line.startswith("#")), "")
    reader = csv.reader(text.splitlines(), delimiter=";" if head.count(";") > head.count(",") else ",")
    return [(reader.line_num, [cell.strip() for cell in row]) for row in reader]


_READERS = {".csv": _csv_rows, ".xlsx": sheet_rows}
