"""The plain table of parts: one row for each component of each error, which reads back exactly."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from types import MappingProxyType

from rverror.base import units
from rverror.base.errors import InputError
from rverror.base.text import PathLike, did_you_mean, read_text, shown, split_lines, write_text
from rverror.geartrain.source import IndexValue
from rverror.model.catalogue import CATALOGUE
from rverror.model.effects import Effect
from rverror.parts.collected import Finding
from rverror.parts.measured import MeasuredPart

_INDICES = ("crank", "disc", "pin", "lobe", "harmonic")
#: Columns of the table; what a source has no index of stays empty.
COLUMNS = ("kind", "serial", "key", *_INDICES, "parameter", "value", "uncertainty", "unit", "origin")


def is_parts_table(text: str) -> bool:
    """Tell a table of parts by the names of its columns."""
    return [cell.strip() for cell in split_lines(text)[0].split(",")] == list(COLUMNS)


def save_parts(path: PathLike, parts: Iterable[MeasuredPart], *, overwrite: bool = False) -> None:
    """Write a table of parts, in one step or not at all.

    Parameters
    ----------
    path : str or path-like
    parts : iterable of MeasuredPart
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    InputError
        If the file exists or cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from rverror.model.effects import effect
    >>> crank = MeasuredPart("crank", "C3", (effect("crank.eccentricity", disc=1, radial="2 um", uncertainty="1 um"),))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_parts(Path(folder, "parts.csv"), [crank])
    ...     print(Path(folder, "parts.csv").read_text().splitlines()[1])
    crank,C3,crank.eccentricity,,1,,,,radial,2.0,1.0,um,
    """
    written = io.StringIO()
    table = csv.writer(written, lineterminator="\n")
    table.writerow(COLUMNS)
    for part in parts:
        head, tail = [part.kind, part.serial], part.origin
        for error in part.errors:
            entry = CATALOGUE[error.key]
            indices = [error.indices.get(name, "") for name in _INDICES]
            for parameter, value in zip(entry.parameters, error.values, strict=True):
                unit, sizes = _printed(parameter.dimension, value, error.uncertainty)
                table.writerow([*head, error.key, *indices, parameter.name, *sizes, unit, tail])
        if not part.errors:
            table.writerow([*head, *[""] * (len(COLUMNS) - 3), tail])
    write_text(path, written.getvalue(), overwrite=overwrite)


def _printed(dimension: str, *values: float | None) -> tuple[str, list[str]]:
    """Unit and numbers that read back as the same floats: those for people where these do, else the core unit's."""
    for unit in (units.DISPLAY_UNITS[dimension], units.CORE_UNITS[dimension]):
        factor = units.unit_factor(unit, dimension)
        texts = ["" if value is None else repr(float(value) / factor) for value in values]
        if all(value is None or float(text) * factor == value for value, text in zip(values, texts, strict=True)):
            break
    return unit, texts


def read_parts_table(path: PathLike) -> Iterator[Finding]:
    """What a table says of its parts.

    Raises
    ------
    InputError
        If a cell cannot be what its column says; the line and the column are named.
    """
    rows = csv.reader(split_lines(read_text(path)), strict=True)
    next(rows)
    group: list[tuple[str, list[str]]] = []
    try:
        for cells in rows:
            where = f"{path}, line {rows.line_num}"
            if not any(cells):
                continue
            if len(cells) != len(COLUMNS):
                raise InputError(f"{where}: {len(cells)} cells for {len(COLUMNS)} columns; correct the row")
            if group and _error_of(group[0][1]) != _error_of(cells):
                yield _finding(group)
                group = []
            group.append((where, cells))
    except csv.Error as error:
        raise InputError(f"{path}, line {rows.line_num}: {error}; write the table again") from error
    if group:
        yield _finding(group)


def _error_of(cells: Sequence[str]) -> Sequence[str]:
    return cells[: COLUMNS.index("parameter")]


def _finding(group: Sequence[tuple[str, list[str]]]) -> Finding:
    """One error of its rows, a row for each component."""
    where, first = group[0]
    row = dict(zip(COLUMNS, first, strict=True))
    part = where, row["kind"], row["serial"], row["origin"]
    if not row["key"]:
        return Finding(*part, None)
    if row["key"] not in CATALOGUE:
        hint = did_you_mean(row["key"], CATALOGUE)
        raise InputError(f"{where}: no error source {shown(row['key'])};{hint} `rverror sources` lists them")
    entry = CATALOGUE[row["key"]]
    indices: dict[str, IndexValue] = {
        name: int(row[name]) if row[name].isdigit() else row[name] for name in _INDICES if row[name]
    }
    dimensions = {parameter.name: parameter.dimension for parameter in entry.parameters}
    values: dict[str, float] = {}
    sigmas: set[float | None] = set()
    for place, cells in group:
        row = dict(zip(COLUMNS, cells, strict=True))
        name = row["parameter"]
        if name not in dimensions or name in values:
            problem = "given twice" if name in values else "unknown"
            raise InputError(f"{place}: parameter {shown(name)} of {entry.key} is {problem}; give each of "
                             f"{', '.join(dimensions)} once")  # fmt: skip
        values[name] = _size(place, row, "value", dimensions[name])
        sigmas.add(_size(place, row, "uncertainty", dimensions[name]) if row["uncertainty"] else None)
    if len(sigmas) > 1:
        raise InputError(f"{where}: {entry.key} has {len(sigmas)} uncertainties; give all its components the same")
    sizes = tuple(values.get(name, 0.0) for name in dimensions)
    return Finding(*part, Effect(entry.key, MappingProxyType(indices), sizes, sigmas.pop()))


def _size(where: str, row: Mapping[str, str], column: str, dimension: str) -> float:
    try:
        size = float(row[column]) * units.unit_factor(row["unit"], dimension)
    except ValueError as error:
        raise InputError(f"{where}: {column} {shown(row[column])} in {shown(row['unit'])}: {error}; correct the cell"
                         ) from error  # fmt: skip
    if not math.isfinite(size) or (column == "uncertainty" and size < 0):
        bound = "a finite number, an uncertainty 0 or more"
        raise InputError(f"{where}: {column} {shown(row[column])}: must be {bound}; correct the cell")
    return size
