"""Measured parts from files: plain tables of parts, and files of measuring machines by a mapping."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rverror.base.arrays import Array
from rverror.base.errors import InputError, check_kind
from rverror.base.numbers import count_of, with_unit
from rverror.base.spreadsheet import sheet_rows
from rverror.base.text import PathLike, check_name, describe, file_head, file_name, read_bytes, shown, some
from rverror.base.units import DISPLAY_UNITS
from rverror.geartrain.mechanism import Mechanism, Reducer
from rverror.geartrain.source import BEYOND_WORKSHOPS
from rverror.model.catalogue import source
from rverror.model.effects import Effect
from rverror.parts.aqdef import SUFFIXES, open_aqdef
from rverror.parts.features import Readings, feature_errors
from rverror.parts.mapping import ErrorColumns, Feature, PartColumn, PartsMapping, load_parts_mapping
from rverror.parts.measured import MeasuredPart
from rverror.parts.parts_table import Finding, collected, is_parts_table, read_parts_table
from rverror.runs.bench.columns import BenchFile, as_samples
from rverror.runs.bench.file import found_entry, left_out_columns
from rverror.runs.bench.mapping import TextRules, Where
from rverror.runs.bench.text import number_in, open_lines, open_text
from rverror.runs.bench.values import core_scale

#: Endings of spreadsheets.
SHEETS = (".xlsx", ".xlsm")


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
    assert isinstance(mechanism, Reducer)
    rules = None if mapping is None else load_parts_mapping(mapping)
    notes: list[str] = []
    findings: list[Finding] = []
    for path in [paths] if isinstance(paths, (str, os.PathLike)) else paths:
        check_name(path)
        own: list[str] = []
        check_no_xml(path)
        if is_parts_table(_head(path)):
            findings += read_parts_table(path)
        elif rules is None:
            raise InputError(f"{path}: no table of parts as `rverror parts` writes it; give a mapping of its columns, "
                             "which `rverror parts FILE --draft` begins")  # fmt: skip
        else:
            findings += _findings(path, rules, mechanism, own)
        notes += [f"{file_name(str(path))}: {note}" for note in own]
    parts = collected(findings, mechanism)
    if not parts:
        raise InputError("there are no parts in the files; give some with a row for each part, or for each reading")
    return PartsRead(parts, tuple(notes))


def _head(path: PathLike) -> str:
    """Beginning of a file as text, whatever it is."""
    raw = file_head(path, 1000) or read_bytes(path)  # which says why not
    return raw.decode("utf-8", errors="replace").removeprefix("\ufeff")


def check_no_xml(path: PathLike) -> None:
    """Refuse XML, such as GDE of VDI/VDE 2610: of this there is no public schema or sample to test a reader with."""
    if Path(path).suffix.lower() in (".gde", ".xml") or _head(path).lstrip().startswith("<"):
        raise InputError(
            f"{path}: XML, such as GDE (VDI/VDE 2610), is not read; give the chart as CSV, a row for each tooth, "
            "and map it by [teeth]"
        )


def sheet_lines(path: PathLike) -> list[str]:
    """Lines of a spreadsheet, with tabs between its cells.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    return ["\t".join(" ".join(cell.split()).replace('"', "''") for cell in row) for _, row in sheet_rows(path)]


def _opened(path: PathLike, text: TextRules, wanted: Sequence[str | int]) -> tuple[BenchFile, Mapping[str, str]]:
    """Columns of a file, and the nominal values that it states of them."""
    suffix = Path(path).suffix.lower()
    if suffix in SUFFIXES:
        return open_aqdef(path)
    if suffix in SHEETS:
        return open_lines(str(path), sheet_lines(path), replace(text, separator="\t"), wanted), {}
    return open_text(path, text, wanted), {}


def _findings(path: PathLike, rules: PartsMapping, reducer: Reducer, notes: list[str]) -> Iterator[Finding]:
    """What a machine's file says of its parts."""
    serial = rules.serial or (Where(name="K0014") if Path(path).suffix.lower() in SUFFIXES else None)
    places = [column.rule.where for group in rules.groups for column in group.columns.values()]
    places += [where for where in (serial, rules.count) if where]
    file, nominal = _opened(path, rules.text, [where.column or where.name for where in places])
    notes += file.notes
    entries = [found_entry(file, where) for where in places]
    labels = file.labels
    assert labels is not None  # of a text

    def at(row: int) -> str:
        return f"{file.path}, {file.noun} {labels[row]}"

    notes += left_out_columns(file, entries)
    counts = np.ones(len(labels))
    if rules.count:
        counts = as_samples(file.path, "count", file.read([found_entry(file, rules.count)])[0])
    odd = ~(counts >= 1) | (counts != np.rint(counts))
    if odd.any():
        raise InputError(f"{at(int(odd.argmax()))}: count of rollers: must be a whole number, 1 or more; correct it")
    for group in rules.groups:
        columns = {key: _sizes(file, key, column, nominal, notes) for key, column in group.columns.items()}
        given = np.isfinite(list(columns.values())).all(axis=0)
        serials = (
            [word.strip() for word in file.words(found_entry(file, serial))]
            if serial
            else [Path(path).stem] * given.size
        )
        if not given.all():
            what = "" if isinstance(group, Feature) else f" for {describe(group.key, group.indices)}"
            lost = f"{count_of(int((~given).sum()), 'row')} left out{what}"
            notes.append(f"{lost}, a cell holds no number: {file.noun} {some(labels[~given])}")
        rows: list[int] = np.flatnonzero(given).tolist()
        found: Iterable[tuple[int, str, Effect, int]]
        if isinstance(group, ErrorColumns):
            nothing, sigma = np.zeros(given.size), max(group.sigmas.values(), default=None)
            names = [parameter.name for parameter in source(group.key).parameters]
            sizes = zip(*(columns.get(name, nothing)[rows].tolist() for name in names), strict=True)
            effects = (Effect(group.key, group.indices, each, sigma) for each in sizes)
            found = ((row, "", effect, 0) for row, effect in zip(rows, effects, strict=True))
        else:
            parts: dict[str, list[int]] = {}
            for row in rows:
                parts.setdefault(serials[row], []).append(row)
            found = _of_feature(group, rules.kind, parts, at, columns, reducer, notes)
        for row, name, error, place in found:
            _check_size(at(row), error)
            origin = file_name(file.path) + name
            yield Finding(at(row), rules.kind, serials[row], origin, error, place, int(counts[row]))


def _of_feature(
    feature: Feature, kind: str, rows: Mapping[str, list[int]], at: Callable[[int], str], columns: Mapping[str, Array],
    reducer: Reducer, notes: list[str],
) -> Iterator[tuple[int, str, Effect, int]]:  # fmt: skip
    """Errors of each part with its first row."""
    left: dict[str, list[tuple[float, str]]] = {}
    for serial, own in rows.items():
        where = f"{at(own[0])}, {kind} {shown(serial)}"
        readings = Readings(where, {key: values[own] for key, values in columns.items()}, feature.sigmas)
        errors, rest, place = feature_errors(feature, kind, readings, reducer)
        for what, size in rest.items():
            left.setdefault(what, []).append(size)
        yield from ((own[0], f", {feature.name}", error, place) for error in errors)
    notes += [_summary(what, sizes) for what, sizes in left.items()]


def _sizes(file: BenchFile, key: str, column: PartColumn, nominal: Mapping[str, str], notes: list[str]) -> Array:
    """A column in core units, NaN where a cell holds no number."""
    entry = found_entry(file, column.rule.where)
    samples = as_samples(file.path, f"{key} ({shown(entry.name, 60)})", file.read([entry])[0])
    if not column.dimension:
        return samples
    unit = DISPLAY_UNITS[column.dimension]
    factor, zero = core_scale(file, key, column.rule, entry, column.dimension, unit, notes)
    expected = column.nominal
    if expected is None:
        stated = number_in(nominal.get(entry.name, "").replace(",", "."))
        if stated is None:
            file.refuse(f"it states no nominal value (K2101) of {shown(entry.name)}; write it in the mapping")
        expected = stated * abs(factor)
    return column.scale * (samples * factor + zero - column.rule.sign * expected)


def _check_size(where: str, error: Effect) -> None:
    """Refuse what no workshop can have made."""
    for parameter, value in zip(source(error.key).parameters, error.values, strict=True):
        if abs(value) > BEYOND_WORKSHOPS * parameter.plausible:
            size, usual = (with_unit(each, parameter.dimension) for each in (value, parameter.plausible))
            raise InputError(
                f"{where}: {describe(error.key, error.indices)}: {parameter.name} would be {size}, beyond "
                f"{BEYOND_WORKSHOPS:g} times what a workshop makes ({usual}); correct the unit, sign or nominal value"
            )


def _summary(what: str, sizes: list[tuple[float, str]]) -> str:
    """What was not made an error, over all parts."""
    of = f"({count_of(len(sizes), 'part')})"
    numbers = [number for number, _ in sizes if np.isfinite(number)]
    if not numbers:
        return f"{what} {of}"
    low, high = (with_unit(each, sizes[0][1]) for each in (min(numbers), max(numbers)))
    return f"{what}: {low if low == high else f'{low} to {high}'} {of}"
