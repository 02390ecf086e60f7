"""Tolerances in a table, CSV or a spreadsheet: a row for each, read as a tolerance file is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from rverror.base.errors import InputError
from rverror.base.spreadsheet import TABLES, table_rows
from rverror.base.text import PathLike, did_you_mean, shown
from rverror.base.toml import KeyPath, TomlText
from rverror.model.catalogue import CATALOGUE

_WITH_UNIT = ("tolerance", "lower", "upper", "mean", "size", "diameter", "module", "at", "least", "largest")
_CURVE = ("curve", "price", "at", "base")
_YES, _NO = ("true", "yes", "1", "x"), ("false", "no", "0", "")
_EXAMPLE = "write a first line such as 'key, tolerance[um], distribution'"


def is_table(name: str) -> bool:
    """Whether a file of this name is a table, not a TOML text."""
    return Path(name).suffix.lower() in TABLES


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
    rows = table_rows(path)
    if not rows:
        raise InputError(f"{name}: the table is empty; {_EXAMPLE}")
    (line, heads), *body = rows
    columns = [_column(name, line, head) for head in heads]
    if "key" not in [column for column, _ in columns]:
        raise InputError(f"{name}, line {line}: no column 'key'; {_EXAMPLE}")
    if not body:
        raise InputError(f"{name}: no tolerance below the first line; add a row for each")
    lines: dict[KeyPath, int] = {}
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
    if title and title not in _READ:
        hint = did_you_mean(title, _READ)
        raise InputError(
            f"{name}, line {line}: unknown column {shown(title)};{hint} the columns are {', '.join(_READ)}"
        )
    return title, unit.rstrip("] ")


def _entry(where: str, given: Mapping[str, tuple[str, str]]) -> dict[str, Any]:
    """Content of a ``[[tolerance]]`` table."""
    entry = {
        name: _READ[name](where, name, _with_unit(cell, unit) if name in _WITH_UNIT else cell)
        for name, (cell, unit) in given.items()
    }
    for ends, name in ((("lower", "upper"), "tolerance"), (("least", "largest"), "bounds")):
        pair = [entry.pop(end) for end in ends if end in entry]
        if len(pair) == 1 or (pair and name in entry):
            raise InputError(f"{where}: {' and '.join(ends)} are two, in place of {name}; give both or neither")
        if pair:
            entry[name] = pair
    indices, cost = ({name: entry.pop(name) for name in names if name in entry} for names in (_INDICES, _CURVE))
    if indices:
        entry["indices"] = indices
    if cost:
        entry["cost"] = {"curve": "reciprocal", **cost}
    if "parameter" in entry:
        entry["parameters"] = entry.pop("parameter")
    return entry


def _with_unit(cell: str, unit: str) -> str:
    """Cell with the unit of its column, where it has none itself."""
    return f"{cell} {unit}" if unit and not any(letter.isalpha() for letter in cell.replace("e", "")) else cell


def _text(where: str, name: str, cell: str) -> str:
    return cell


def _number(where: str, name: str, cell: str) -> float:
    try:
        return float(cell)
    except ValueError as error:
        raise InputError(f"{where}: {name} is {shown(cell)}; give a number") from error


def _flag(where: str, name: str, cell: str) -> bool:
    if cell.lower() not in (*_YES, *_NO):
        raise InputError(f"{where}: {name} is {shown(cell)}; write yes or no")
    return cell.lower() in _YES


def _parts(where: str, name: str, cell: str) -> list[str]:
    return [part.strip() for part in cell.split(",")]


def _index(where: str, name: str, cell: str) -> Any:
    found = [int(part) if part.lstrip("-").isdigit() else part for part in _parts(where, name, cell)]
    return found[0] if len(found) == 1 else found


def _correlations(where: str, name: str, cell: str) -> dict[str, float]:
    """Names and numbers of ``cams: 0.6; bores: -0.2``."""
    pairs = [part.rpartition(":") for part in cell.split(";") if part.strip()]
    if not all(colon for _, colon, _ in pairs):
        raise InputError(f"{where}: {name} is {shown(cell)}; write it like 'cams: 0.6; bores: -0.2'")
    return {other.strip(): _number(where, name, value) for other, _, value in pairs}


def _fit(where: str, name: str, cell: str) -> dict[str, Any]:
    """Other tolerance, classes and order of ``bores: 3 opposite``."""
    other, _, rest = cell.rpartition(":")
    number, _, order = rest.strip().partition(" ")
    if not other or not number.isdigit() or order.strip() not in ("", "opposite"):
        raise InputError(f"{where}: {name} is {shown(cell)}; write it like 'bores: 3' or 'bores: 3 opposite'")
    return {"with": other.strip(), "classes": int(number), "opposite": bool(order)}


_INDICES = tuple(dict.fromkeys(index.name for entry in CATALOGUE.values() for index in entry.indices))
#: How the cells of each column are read; those of the indices have the names of the catalogue.
_READ: Mapping[str, Callable[[str, str, str], Any]] = {
    **dict.fromkeys(("name", "key", "tolerance", "grade", "size", "diameter", "module", "distribution"), _text),
    **dict.fromkeys(("mean", "phase", "at", "lower", "upper", "least", "largest", "curve"), _text),
    **dict.fromkeys(("capability", "shape", "correlation", "classes", "price", "base"), _number),
    **{"parameter": _parts, "correlated_with": _correlations, "fit": _fit, "fixed": _flag},
    **dict.fromkeys(_INDICES, _index),
}
