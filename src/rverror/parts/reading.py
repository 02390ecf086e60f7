"""Measured parts from files: plain tables of parts, and files of measuring machines by a mapping."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rverror.base.arrays import Array
from rverror.base.errors import InputError, check_kind
from rverror.base.numbers import count_of, with_unit
from rverror.base.text import PathLike, check_name, describe, file_name, shown, some
from rverror.geartrain.mechanism import Mechanism, Reducer
from rverror.geartrain.source import BEYOND_WORKSHOPS, rv
from rverror.model.catalogue import source
from rverror.model.effects import Effect
from rverror.parts.collected import Finding, collected
from rverror.parts.features import Readings, feature_errors
from rverror.parts.machine_file import PartRows, head_of, read_rows
from rverror.parts.mapping import ErrorColumns, Feature, PartsMapping, load_parts_mapping
from rverror.parts.measured import MeasuredPart
from rverror.parts.parts_table import is_parts_table, read_parts_table


@dataclass(frozen=True)
class PartsRead:
    """Measured parts, and what was not used of their files.

    Attributes
    ----------
    parts : tuple of MeasuredPart
        In the order of the files.
    notes : tuple of str
        What was dropped, counted; what was assumed.
    """

    parts: tuple[MeasuredPart, ...]
    notes: tuple[str, ...] = ()


def load_parts(
    paths: PathLike | Sequence[PathLike], mechanism: Mechanism, *, mapping: PathLike | None = None
) -> PartsRead:
    """Read measured parts.

    Parameters
    ----------
    paths : str, path-like or sequence of them
        Tables of parts as ``rverror parts`` writes them, or files of a measuring machine: CSV or any other text, xlsx,
        Q-DAS (.dfq, .dfd, .dfx).  What several files say of one serial number is joined.
    mechanism : Mechanism
        For nominal sizes, and the indices that are allowed.
    mapping : str or path-like, optional
        Mapping file, which says what the columns are; not for tables of parts.

    Returns
    -------
    PartsRead

    Raises
    ------
    InputError
        If a file cannot be used; one line with file, line, bound and remedy.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from rverror.geartrain.mechanism import reducer
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     size = Path(folder, "cranks.csv").write_text("No;cam 0 [um];cam 1 [um]\\nC1;1,5;-2\\nC2;0,4;0,1\\n")
    ...     size = Path(folder, "cranks.toml").write_text('''
    ...         kind = "crank"
    ...         serial = "No"
    ...         [[error]]
    ...         key = "crank.eccentricity"
    ...         disc = 1
    ...         radial = { name = "cam 1 [um]", unit = "um", uncertainty = "0.3 um" }
    ...         ''')
    ...     read = load_parts(Path(folder, "cranks.csv"), reducer("RV-40E"), mapping=Path(folder, "cranks.toml"))
    >>> read.parts[0].errors
    (<Effect crank.eccentricity (disc 1): radial -2 um>,)
    """
    check_kind("mechanism", mechanism, Reducer, "give reducer('RV-40E') or the mechanism of a model")
    reducer = rv(mechanism)
    rules = None if mapping is None else load_parts_mapping(mapping)
    notes: list[str] = []
    findings: list[Finding] = []
    for path in [paths] if isinstance(paths, (str, os.PathLike)) else paths:
        check_name(path)
        if is_parts_table(head_of(path)):
            findings += read_parts_table(path)
        elif rules is None:
            raise InputError(
                f"{path}: no table of parts as `rverror parts` writes it; give a mapping of its columns too "
                "(`rverror parts FILE --draft` begins one)"
            )
        else:
            own: list[str] = []
            findings += _findings(path, rules, reducer, own)
            notes += [f"{file_name(str(path))}: {note}" for note in own]
    parts = collected(findings, mechanism)
    if not parts:
        raise InputError("there are no parts in the files; give some with a row for each part, or for each reading")
    return PartsRead(parts, tuple(notes))


def _findings(path: PathLike, rules: PartsMapping, reducer: Reducer, notes: list[str]) -> list[Finding]:
    """What a machine's file says of its parts."""
    rows = read_rows(path, rules, notes)
    if rules.feature is not None:
        return list(_of_feature(rules.feature, rules.kind, rows, reducer, notes))
    pairs = zip(rules.errors, rows.sizes, strict=True)
    return [finding for error, sizes in pairs for finding in _of_rows(error, sizes, rules.kind, rows, notes)]


def _of_rows(
    error: ErrorColumns, sizes: Mapping[str, Array], kind: str, rows: PartRows, notes: list[str]
) -> Iterator[Finding]:
    """An error of which each row has the components."""
    given = _given(sizes, rows, f" for {describe(error.key, error.indices)}", notes)
    stated = [column.scale * column.sigma for column in error.columns.values() if column.sigma is not None]
    names = [parameter.name for parameter in source(error.key).parameters]
    for row in given:
        values = tuple(float(sizes[name][row]) if name in sizes else 0.0 for name in names)
        made = Effect(error.key, error.indices, values, max(stated, default=None))
        serial = rows.serials[row].strip()
        yield _finding(rows.place(row), kind, serial, file_name(rows.file.path), made)


def _of_feature(feature: Feature, kind: str, rows: PartRows, reducer: Reducer, notes: list[str]) -> Iterator[Finding]:
    """Errors that the readings of each part tell."""
    columns = rows.sizes[0]
    parts: dict[str, list[int]] = {}
    for row in _given(columns, rows, "", notes):
        parts.setdefault(rows.serials[row].strip(), []).append(row)
    sigmas = {name: column.scale * column.sigma for name, column in feature.columns.items() if column.sigma is not None}
    left: dict[str, list[tuple[float, str]]] = {}
    for serial, own in parts.items():
        where = f"{rows.place(own[0])}, {kind} {shown(serial)}"
        readings = Readings(where, {name: values[own] for name, values in columns.items()}, sigmas)
        fitted = feature_errors(feature, kind, readings, reducer)
        for what, size in fitted.left.items():
            left.setdefault(what, []).append(size)
        for error in fitted.errors:
            yield _finding(where, kind, serial, f"{file_name(rows.file.path)}, {feature.name}", error)
    notes += [_summary(what, sizes, kind) for what, sizes in left.items()]


def _given(columns: Mapping[str, Array], rows: PartRows, of: str, notes: list[str]) -> list[int]:
    """Rows with a number in every column; the others are noted."""
    given = np.isfinite(list(columns.values())).all(axis=0)
    lost: list[int] = np.flatnonzero(~given).tolist()
    if lost:
        labels = some(rows.label(row) for row in lost)
        notes.append(f"{count_of(len(lost), 'row')} left out{of}, a cell holds no number: {rows.file.noun} {labels}")
    return list(np.flatnonzero(given).tolist())


def _finding(where: str, kind: str, serial: str, origin: str, error: Effect) -> Finding:
    """A finding that a workshop can have made."""
    for parameter, value in zip(source(error.key).parameters, error.values, strict=True):
        if abs(value) > BEYOND_WORKSHOPS * parameter.plausible:
            size, usual = (with_unit(each, parameter.dimension) for each in (value, parameter.plausible))
            raise InputError(
                f"{where}: {describe(error.key, error.indices)}: {parameter.name} would be {size}, beyond "
                f"{BEYOND_WORKSHOPS:g} times what a workshop makes ({usual}); correct the unit, sign or nominal value"
            )
    return Finding(where, kind, serial, origin, error)


def _summary(what: str, sizes: list[tuple[float, str]], kind: str) -> str:
    """What was not made an error, over all parts."""
    of = f"{len(sizes)} {kind}{'s' if len(sizes) > 1 else ''}"
    numbers = [number for number, _ in sizes if np.isfinite(number)]
    if not numbers:
        return f"{what} ({of})"
    low, high = (with_unit(each, sizes[0][1]) for each in (min(numbers), max(numbers)))
    return f"{what}: {low if low == high else f'{low} to {high}'} ({of})"
