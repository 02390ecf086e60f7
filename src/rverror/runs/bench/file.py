"""A bench's own file by way of a mapping: which format it is, its header, and what the columns that are meant hold."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import count_of
from rverror.base.text import PathLike, did_you_mean, file_head, shown
from rverror.runs.bench.binary import HDF5_SIGNATURE, TDMS_SIGNATURE, open_hdf5, open_mat, open_tdms
from rverror.runs.bench.columns import BenchFile, Entry, some_names
from rverror.runs.bench.mapping import BenchMapping, ColumnRule, HeaderRule, Where, meant_unit, unit_scale
from rverror.runs.bench.text import number_in, open_text
from rverror.runs.bench.values import core_values
from rverror.runs.integration import integrated
from rverror.runs.reading import (
    COLUMN_NAME,
    DIMENSIONS,
    HEADER_KEYS,
    ORDER_CONDITIONS,
    RUN_COLUMNS,
    SPEEDS,
    STATED,
    UNITS,
    Reading,
    Stated,
    bare_name,
    check_lengths,
    check_needed,
    refuse,
    stated_value,
)

_MAT_HEADER = 128
_SUFFIXES = {".mat": "MAT", ".h5": "HDF5", ".hdf5": "HDF5", ".hdf": "HDF5", ".tdms": "TDMS"}
#: Endings of names of files that can be runs.
RUN_SUFFIXES = (".csv", ".txt", ".asc", ".dat", *_SUFFIXES)


def folders_of_runs(root: Path, suffixes: str | tuple[str, ...]) -> dict[Path, tuple[str, ...]]:
    """Files with these endings in each subfolder; hidden files and folders are left out.

    Raises
    ------
    InputError
        If the folder cannot be read.
    """
    try:
        folders = sorted(path for path in root.iterdir() if path.is_dir() and not path.name.startswith("."))
        files = {each: sorted(path for path in each.iterdir() if path.is_file()) for each in folders}
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{root}: cannot read the folder ({reason}); check the path") from error
    return {
        each: tuple(str(p) for p in own if p.name.lower().endswith(suffixes) and not p.name.startswith("."))
        for each, own in files.items()
    }


def is_bench_file(path: PathLike) -> bool:
    """Tell a MAT, HDF5 or TDMS file, by content, or by name where the content says nothing.

    Returns
    -------
    bool
        False too for what cannot be read: whoever reads it says why.
    """
    return _kind(path) != "text"


def open_bench_file(path: PathLike, mapping: BenchMapping, standard: Sequence[str] = RUN_COLUMNS) -> BenchFile:
    """List what a file holds.

    Parameters
    ----------
    mapping : BenchMapping
        Of a text file, how it is written and which names are looked for.
    standard : sequence of str
        Names that are looked for where the mapping has none.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    kind = _kind(path)
    if kind == "archive":
        refuse(str(path), "this is a workbook or an archive; save the sheet as CSV, or unpack it")
    if kind == "text":
        rules = [*mapping.columns.values(), *mapping.orders.values()]
        return open_text(path, mapping.text, [rule.where.column or rule.where.name for rule in rules], standard)
    if kind in ("MAT", "TDMS"):
        return open_mat(path) if kind == "MAT" else open_tdms(path)
    return open_hdf5(path, kind.removesuffix(" 7.3"))


def read_bench_file(path: PathLike, mapping: BenchMapping) -> Reading:
    """Read a run: a bench's file by its mapping, or one whose columns are named as in a run file.

    Raises
    ------
    InputError
        If it cannot be used; one line that names file, line or data set, bound and remedy.
    """
    if mapping.orders:
        refuse(str(path), f"{mapping.path} describes an order table by [orders], which holds no samples, and only "
                          "diagnose takes one; give a run file here, or a mapping with [columns]")  # fmt: skip
    file = open_bench_file(path, mapping)
    rules = dict(mapping.columns) or standard_rules(file, mapping, RUN_COLUMNS)
    others = [] if mapping.columns else [entry.name for entry in file.entries if bare_name(entry.name) not in rules]
    names = [*(SPEEDS.get(key, key) for key in rules), *others]
    remedy = ", in [columns] of the mapping"
    if not mapping.columns:
        remedy = ", or name the columns of the bench in a mapping (rverror read FILE --draft begins one); the file has "
        remedy += some_names(entry.name for entry in file.entries)
    check_needed(file.path, mapping.path or file.place or "columns", names, remedy)
    read, entries, header = contents(file, mapping, rules, HEADER_KEYS)
    columns, stated, notes = dict(read.columns), dict(read.stated), list(read.notes)
    if "time" not in columns:
        columns |= _clock(file, list(entries.values()), read.labels.size, notes)
    if "direction" in header:
        stated["direction"] = _direction(file, header["direction"]), header["direction"].at
    return integrated(replace(read, columns=columns, stated=stated, notes=tuple(notes)))


def contents(
    file: BenchFile, mapping: BenchMapping, rules: Mapping[str, ColumnRule], keys: Sequence[str]
) -> tuple[Reading, dict[str, Entry], dict[str, Stated]]:
    """Known columns and header of a file, before the checks of a run or an order table.

    Parameters
    ----------
    rules : mapping of str to ColumnRule
        Of the known columns.
    keys : sequence of str
        Of the header, that have a meaning.

    Returns
    -------
    read : Reading
        Its conditions without the direction, which words tell.
    entries : dict of str to Entry
        Of the known columns.
    header : dict of str to Stated

    Raises
    ------
    InputError
        If a column cannot be used, they differ in length, or a value of the header is missing or has no unit.
    """
    notes = list(file.notes)
    entries = {key: found_entry(file, rule.where, mapping.group) for key, rule in rules.items()}
    numbers = [key for key in rules if key != "direction"]
    stored = dict(zip(numbers, file.read(entries[key] for key in numbers), strict=True))
    sizes = {f"{key} ({shown(entries[key].name, 60)})": array.size for key, array in stored.items()}
    check_lengths(file.path, sizes, "record them at one rate, or export them again")
    columns = {key: core_values(file, key, rules[key], entries[key], array, notes) for key, array in stored.items()}
    header = header_values(file, mapping, keys, notes)
    read = Reading(
        path=file.path,
        columns=columns,
        labels=np.arange(next(iter(columns.values())).size) if file.labels is None else file.labels,
        noun=file.noun,
        stated={
            key: (stated_value(file.path, f"{stated.at}: {key}", stated.text, DIMENSIONS[key]), stated.at)
            for key, stated in header.items()
            if key in keys and key in ORDER_CONDITIONS
        },
        index=header["index"].text if "index" in header else "",
        metadata={key: value.text for key, value in header.items()},
        notes=(*notes, *left_out_columns(file, list(entries.values()))),
    )
    return read, entries, header


def left_out_columns(file: BenchFile, used: Sequence[Entry]) -> list[str]:
    """What is to be noted of columns that no one asked for."""
    unused = [entry.name for entry in file.entries if entry not in used and entry.name]
    if not unused:
        return []
    count = count_of(len(unused), "column")
    return [f"{count} of the file left out, not asked for: {some_names(unused)}"]


# --- which format -----------------------------------------------------------------------------------------------------


def _kind(path: PathLike) -> str:
    head = file_head(path, 1024)
    if not head:
        return "text"
    mat = head[124:128] in (b"\x00\x01IM", b"\x01\x00MI", b"\x00\x02IM", b"\x02\x00MI")
    if HDF5_SIGNATURE in (head[:8], head[512:520]):
        return "MAT 7.3" if head.startswith(b"MATLAB 7.3") else "HDF5"
    if head.startswith(TDMS_SIGNATURE):
        return "TDMS"
    if mat and len(head) > _MAT_HEADER:
        return "MAT"
    if head.startswith((b"PK\x03\x04", b"\xd0\xcf\x11\xe0")):
        return "archive"
    return _SUFFIXES.get(Path(path).suffix.lower(), "text")


# --- which columns ----------------------------------------------------------------------------------------------------


def standard_rules(file: BenchFile, mapping: BenchMapping, standard: Sequence[str]) -> dict[str, ColumnRule]:
    """Rules for columns with the names of a run file or an order table, in the stated group.

    Parameters
    ----------
    standard : sequence of str
        Those names.

    Raises
    ------
    InputError
        If one stands there twice, or lacks its unit.
    """
    rules: dict[str, ColumnRule] = {}
    text = file.kind == "text"
    above = f"{mapping.group}/" if mapping.group and not text else ""
    for number, entry in enumerate(file.entries, 1):
        last = entry.name if text else entry.name.rpartition("/")[2]
        key = bare_name(last)
        if key not in standard or not entry.name.startswith(above):
            continue
        place = f"{file.place}, column {number}: " if file.place else ""
        if key in rules:
            file.refuse(f"{place}{shown(entry.name, 60)} and {rules[key].where} are both {key}; leave one of them, or "
                        "name it in [columns] of a mapping")  # fmt: skip
        where = Where(name=entry.name.removeprefix(above), column=number if text else 0)
        stated = COLUMN_NAME.match(last)
        unit = (stated[2] if stated and stated[2] else entry.unit).strip()
        rules[key] = _standard_rule(file, key, place, where, unit)
    return rules


def _standard_rule(file: BenchFile, key: str, place: str, where: Where, unit: str) -> ColumnRule:
    dimension = DIMENSIONS[key]
    example = f"{key}[{UNITS[key]}]" if dimension else key
    remedy = f"write {example!r}, or state the unit in a mapping (rverror read FILE --draft begins one)"
    if not dimension:
        if unit:
            file.refuse(f"{place}{key} has no unit; write {key!r}")
        return ColumnRule(where=where, factor=1.0, scaled=True)
    if not unit:
        file.refuse(f"{place}{key} has no unit; {remedy}")
    try:
        factor, zero = unit_scale(meant_unit(unit), dimension)
    except ValueError as error:
        file.refuse(f"{place}{key}: {str(error).partition(';')[0]}; {remedy}")
    return ColumnRule(where=where, unit=unit, factor=factor, zero=zero)


def found_entry(file: BenchFile, where: Where, group: str = "") -> Entry:
    """The entry that a mapping means.

    Raises
    ------
    InputError
        If there is none, it is one of several, or no column.
    """
    at, text = f" ({where.stated_at})" if where.stated_at else "", file.kind == "text"
    if where.column and text:
        if where.column > len(file.entries):
            file.refuse(f"there is no column {where.column}{at}; the rows have {len(file.entries)} cells")
        return file.entries[where.column - 1]
    if where.column and not any(entry.name.rpartition("/")[2] == "1" for entry in file.entries):  # of a matrix
        file.refuse(f"column {where.column}{at}: {file.kind} columns have names, no numbers; write name")
    name = str(where.column or (where.name if text else where.name.strip("/")))
    full = f"{group}/{name}" if group and not text else name
    fitting = [entry for entry in file.entries if entry.name == full]
    if not (fitting or group or text):
        fitting = [entry for entry in file.entries if entry.name.endswith(f"/{name}")]
    inside = [entry.name for entry in file.entries if not text and entry.name.startswith(f"{full}/")]
    if inside and not fitting:
        file.refuse(f"{shown(full, 60)}{at} holds {some_names(inside)}; write the name of one of them in full")
    if not fitting:
        hint = did_you_mean(full, [entry.name for entry in file.entries])
        place = f"{file.place}: " if file.place else ""
        names = some_names(entry.name for entry in file.entries)
        wanted = where.column or shown(full, 60)
        file.refuse(f"{place}there is no column {wanted}{at};{hint} the file has {names}")
    if len(fitting) > 1:
        either = " or ".join(shown(entry.name, 60) for entry in fitting[:3])
        file.refuse(f"{where}{at} may be {either}; write one of them in full")
    if fitting[0].problem:
        file.refuse(f"{shown(fitting[0].name, 60)}{at} {fitting[0].problem}")
    return fitting[0]


def _clock(file: BenchFile, found: Sequence[Entry], size: int, notes: list[str]) -> dict[str, Array]:
    """Time from the interval between samples, where the file states it of every column."""
    intervals = sorted({entry.increment for entry in found})
    if intervals[0] == 0:
        return {}
    if len(intervals) > 1:
        file.refuse(
            f"the columns were sampled every {' and every '.join(f'{each:g}' for each in intervals)} s; record them at "
            "one rate"
        )
    notes.append(f"time made from the interval that the file states, {intervals[0]:g} s")
    return {"time": np.arange(size, dtype=np.float64) * intervals[0]}


def _direction(file: BenchFile, stated: Stated) -> float:
    if stated.text.lower() not in STATED:
        hint = did_you_mean(stated.text, STATED)
        file.refuse(
            f"{stated.at}: direction = {shown(stated.text)}: must be forward, reverse or mixed;"
            f"{hint or ' without it the angles tell'}"
        )
    return STATED[stated.text.lower()]


def header_values(file: BenchFile, mapping: BenchMapping, keys: Sequence[str], notes: list[str]) -> dict[str, Stated]:
    """Values of the header by key, as written.

    Parameters
    ----------
    keys : sequence of str
        Those that have a meaning.
    notes : list of str
        Gets what has none but may be meant.

    Raises
    ------
    InputError
        If a value is missing.
    """
    # A file whose columns have names of its own may say "Direction: CW" or "Index: 3": there only a mapping tells.
    stated: dict[str, Stated] = {}
    if not mapping.columns and not mapping.orders:
        properties = {key.lower(): Stated(text=text, at=f"{key} in the file") for key, text in file.properties.items()}
        stated = dict(file.header) or {key: properties[key] for key in keys if key in properties}
    notes += [
        f"header key {shown(key)} in {value.at} has no meaning here and is only kept;{hint}"
        for key, value in stated.items()
        if key not in keys and (hint := did_you_mean(key, keys))
    ]
    for key, rule in mapping.header.items():
        stated[key] = Stated(text=rule.text or _property(file, key, rule), at=rule.where.stated_at)
    return stated


def _property(file: BenchFile, key: str, rule: HeaderRule) -> str:
    """Text of a property, with the mapping's unit where it has none."""
    name, at = rule.where.name, rule.where.stated_at
    if name not in file.properties:
        hint = did_you_mean(name, list(file.properties))
        file.refuse(f"there is no property {shown(name, 60)} ({at});{hint} the file has {some_names(file.properties)}")
    text = file.properties[name]
    if rule.words:
        if text.strip().lower() not in rule.words:
            file.refuse(f"{key}: the property {shown(name, 60)} is {shown(text)}, {unknown_word(rule.words, at)}")
        return rule.words[text.strip().lower()]
    number, _, unit = text.partition(" ")
    value = number_in(number, file.decimal)
    if value is None or key not in ORDER_CONDITIONS:
        return text
    unit = meant_unit(unit.strip())
    if rule.unit and unit not in ("", rule.unit):
        file.refuse(
            f"{key}: the property {shown(name, 60)} is {shown(text)}, the mapping says {rule.unit} ({at}); leave unit "
            "out, or correct it"
        )
    return f"{value!r} {rule.unit or unit}".strip()


def unknown_word(words: Mapping[str, str], at: str) -> str:
    """What a word that means no direction ought to be, for messages.

    Examples
    --------
    >>> unknown_word({"cw": "forward", "ccw": "reverse"}, "mapping bench.toml, line 3")
    "must be 'cw' or 'ccw' (mapping bench.toml, line 3); correct the words there"
    """
    return f"must be {' or '.join(shown(word) for word in words)}{f' ({at})' if at else ''}; correct the words there"
