"""The plain table of parts, a row for each component of each error, which reads back exactly; parts of findings."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby
from typing import Any

from rverror.base.errors import InputError, refusing
from rverror.base.text import PathLike, describe, did_you_mean, read_text, shown, split_lines, write_file
from rverror.base.units import CORE_UNITS
from rverror.geartrain.mechanism import Mechanism
from rverror.model.catalogue import source
from rverror.model.effects import Effect, effect
from rverror.parts.measured import KINDS, MeasuredPart

_INDICES = ("crank", "disc", "pin", "lobe", "harmonic")
#: Columns of the table; what a source has no index of stays empty.
COLUMNS = ("kind", "serial", "origin", "made_for", "key", *_INDICES, "parameter", "value", "uncertainty", "unit")
#: One more behind them, where rollers are in classes.
_COUNTED = (*COLUMNS, "count")
_ERROR = COLUMNS[: COLUMNS.index("parameter")]


@dataclass(frozen=True)
class Finding:
    """What one place of a file says of a part: an error, or none.

    Attributes
    ----------
    where : str
        File and line, for messages.
    kind, serial : str
        Of the part.
    origin : str
        File, and what was measured.
    error : Effect, optional
    made_for, count : int
        As of `MeasuredPart`.
    """

    where: str
    kind: str
    serial: str
    origin: str
    error: Effect | None
    made_for: int = 0
    count: int = 1


def collected(findings: Iterable[Finding], mechanism: Mechanism) -> tuple[MeasuredPart, ...]:
    """Parts in the order found, each with the errors that all files have of it.

    Raises
    ------
    InputError
        If a kind is unknown, a serial number is missing, an error is no error of such a part of the mechanism, or a
        part has the same error twice.
    """
    parts: dict[tuple[str, str], list[Finding]] = {}
    given: dict[tuple[str, str, str], Finding] = {}
    checked: set[tuple[str, str]] = set()
    for one in findings:
        if one.kind not in KINDS:
            hint = did_you_mean(one.kind, KINDS)
            raise InputError(f"{one.where}: kind {shown(one.kind)} is none of {', '.join(KINDS)};{hint} correct it")
        if not one.serial:
            raise InputError(f"{one.where}: no serial number; give every {one.kind} one")
        parts.setdefault((one.kind, one.serial), []).append(one)
        if one.error is None:
            continue
        name = describe(one.error.key, one.error.indices)
        before = given.setdefault((one.kind, one.serial, name), one)
        if before is not one:
            raise InputError(f"{one.where}: {one.kind} {shown(one.serial)} has {name} already, from "
                             f"{before.where}; keep one, or correct the serial number")  # fmt: skip
        if (one.kind, name) not in checked:
            checked |= {(one.kind, name)}
            entry = source(one.error.key)
            with refusing(f"{one.where}: ", "; correct it"):
                MeasuredPart(one.kind, one.serial, (one.error,))
                entry.check_indices(mechanism, {index.name: 0 for index in entry.indices} | dict(one.error.indices))
    return tuple(
        MeasuredPart(
            *part,
            tuple(one.error for one in own if one.error),
            "; ".join(filter(None, dict.fromkeys(one.origin for one in own))),
            max(one.made_for for one in own),
            max(one.count for one in own),
        )
        for part, own in parts.items()
    )


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
    >>> crank = MeasuredPart("crank", "C3", (effect("crank.eccentricity", disc=1, radial="2 um", uncertainty="1 um"),))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_parts(Path(folder, "parts.csv"), [crank])
    ...     print(Path(folder, "parts.csv").read_text().splitlines()[1])
    crank,C3,,,crank.eccentricity,,1,,,,radial,0.002,0.001,mm
    """
    written = io.StringIO()
    table = csv.writer(written, lineterminator="\n")
    every = list(parts)
    counted = any(part.count > 1 for part in every)
    table.writerow(_COUNTED if counted else COLUMNS)
    for part in every:
        last = [part.count] * counted
        head = [part.kind, part.serial, part.origin, part.made_for or ""]
        for error in part.errors:
            indices = [error.indices.get(name, "") for name in _INDICES]
            sigma = "" if error.uncertainty is None else repr(float(error.uncertainty))
            for parameter, value in zip(source(error.key).parameters, error.values, strict=True):
                own = [parameter.name, repr(float(value)), sigma, CORE_UNITS[parameter.dimension]]
                table.writerow([*head, error.key, *indices, *own, *last])
        if not part.errors:
            table.writerow([*head, *[""] * (len(COLUMNS) - len(head)), *last])
    write_file(path, written.getvalue(), overwrite=overwrite)


def is_parts_table(text: str) -> bool:
    """Tell a table of parts by the names of its columns."""
    return text.startswith(",".join(COLUMNS[:4]))


def read_parts_table(path: PathLike) -> Iterator[Finding]:
    """What a table says of its parts.

    Raises
    ------
    InputError
        If a cell cannot be what its column says; the line is named.
    """
    rows = csv.DictReader(split_lines(read_text(path)))
    if tuple(rows.fieldnames or ()) not in (COLUMNS, _COUNTED):
        raise InputError(f"{path}, line 1: the columns of a table of parts are {', '.join(COLUMNS)}; write it again")
    numbered = ((rows.line_num, row) for row in rows if any(row.values()))
    for error, group in groupby(numbered, lambda each: [each[1][name] or "" for name in _ERROR]):
        lines = list(group)
        where = f"{path}, line {lines[0][0]}"
        kind, serial, origin, made_for, key, *_ = error
        try:
            found = _error([row for _, row in lines]) if key else None
            count = int(lines[0][1].get("count") or 1)
            yield Finding(where, kind, serial, origin, found, int(made_for or 0), count)
        except (TypeError, ValueError) as problem:
            raise InputError(f"{where}: {problem}; correct the row") from problem


def _error(rows: list[dict[str, str]]) -> Effect:
    """The error of a row for each of its components."""
    first = rows[0]
    named: dict[str, Any] = {
        name: int(first[name]) if first[name].isdigit() else first[name] for name in _INDICES if first[name]
    }
    sizes = {row["parameter"]: f"{row['value']} {row['unit']}" for row in rows}
    if len(sizes) < len(rows) or len({row["uncertainty"] for row in rows}) > 1 or None in first:
        raise ValueError(f"{len(rows)} rows of {first['key']} give a parameter twice, several uncertainties or more "
                         "cells than columns")  # fmt: skip
    sigma = f"{first['uncertainty']} {first['unit']}" if first["uncertainty"] else None
    return effect(first["key"], uncertainty=sigma, **named, **sizes)
