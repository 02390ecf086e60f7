"""Q-DAS ASCII transfer format (AQDEF), .dfq or .dfd with .dfx: a table with a row for each piece.

aqdefreader, the reader that there is, leaves out serial numbers (K0014) and description files, so the few K-fields that
parts need are read here.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from rverror.base.errors import InputError
from rverror.base.numbers import count_of
from rverror.base.text import PathLike, read_bytes, shown, split_lines
from rverror.runs.bench.columns import BenchFile, Entry, RawArray
from rverror.runs.bench.text import number_in

SUFFIXES = (".dfq", ".dfd", ".dfx")
_FIELD = re.compile(r"(K\d{4})(?:/(\d+))?(?:/(\d+))?(?:\s+(.*))?$")
#: Fields of a value that stands without their names; K0014 follows in a line of its own.
_PORTIONS = ("K0001", "K0002", "K0004", "K0005", "K0006", "K0007", "K0008", "K0010", "K0011", "K0012")
_BETWEEN_VALUES, _BETWEEN_FIELDS = "\x0f", "\x14"
#: Of K0002: a value that was marked as none.  Of K2004: counted, not measured.
_NO_VALUE, _COUNTED = ("255", "256"), ("1", "5", "6")
#: Fields that are columns in addition to the characteristics: of the part, and of the value.
_OF_PART, _OF_VALUE = ("K1001", "K1002"), ("K0014", "K0006", "K0004")
#: Fields of a characteristic or a value, by their names.
_Fields = dict[str, str]


def open_aqdef(path: PathLike) -> tuple[BenchFile, _Fields]:
    """Read a file: a column for each characteristic, by its name (K2002, else K2001), a row for each piece.

    Parameters
    ----------
    path : str or path-like
        Of a description (.dfd) or of its values (.dfx) the other is read too.

    Returns
    -------
    BenchFile
    dict of str to str
        Nominal value (K2101) of each column, in its unit.

    Raises
    ------
    InputError
        If the file is no such file, or its values cannot be put in rows.
    """
    name, found = str(path), _characteristics(str(path), list(_lines(Path(path))))
    measured = [each for each in found if each[1].get("K2004") not in _COUNTED]
    marked = sum(value.get("K0002") in _NO_VALUE for _, _, values in measured for value in values)
    counts = (
        (len(found) - len(measured), "characteristic", "counted, not measured"),
        (marked, "value", "K0002 says so"),
    )
    notes = tuple(f"{count_of(count, what)} left out, {why}" for count, what, why in counts if count)
    rows = [row for part in {id(part): part for part, _, _ in measured}.values() for row in _rows(name, part, measured)]
    if not rows:
        raise InputError(f"{name}: no measured values (K0001) in it; export them with their description")
    unit: _Fields = {}
    nominal: _Fields = {}
    for _, fields, _ in measured:
        for held, key, what in ((unit, "K2142", "unit"), (nominal, "K2101", "nominal value")):
            if held.setdefault(_name(fields), fields.get(key, "")) != fields.get(key, ""):
                raise InputError(f"{name}: {shown(_name(fields))} has more than one {what} ({key}); split the file")
    columns = [
        *unit,
        *(each for each in (*_OF_PART, *_OF_VALUE) if each == "K0014" or any(each in row for row in rows)),
    ]

    def cells(place: int) -> list[str]:
        return [row.get(columns[place], "") for row in rows]

    def read(places: Sequence[int]) -> list[RawArray]:
        numbers = ([number_in(word.replace(",", ".")) for word in cells(place)] for place in places)
        return [np.array(each, dtype=np.float64) for each in numbers]  # None is NaN

    entries = tuple(Entry(name=each, unit=unit.get(each, "")) for each in columns)
    return BenchFile(
        path=name, kind="text", entries=entries, columns=read, cells=cells, notes=notes, noun="piece",
        labels=np.arange(len(rows)) + 1,
    ), nominal  # fmt: skip


def _name(fields: _Fields) -> str:
    return fields.get("K2002") or fields.get("K2001") or ""


def _lines(path: Path) -> Iterator[tuple[str, str]]:
    """Lines with their places."""
    both = path.suffix.lower() in (".dfd", ".dfx")
    for one in [path.with_suffix(".dfd"), path.with_suffix(".dfx")] if both else [path]:
        raw = read_bytes(one)
        try:
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = raw.decode("cp1252", errors="replace")
        yield from ((f"{one}, line {i}", line.strip(" \t")) for i, line in enumerate(split_lines(text), 1))


def _characteristics(name: str, lines: Sequence[tuple[str, str]]) -> list[tuple[_Fields, _Fields, list[_Fields]]]:
    """Part, fields and values of each characteristic."""
    if not any(line.startswith(("K0100", "K1001", "K2001", "K2002")) for _, line in lines):
        raise InputError(f"{name}: no line begins with K0100, so this is no Q-DAS transfer file; export it as .dfq")
    parts: dict[int, _Fields] = {}
    found: dict[int, tuple[_Fields, _Fields, list[_Fields]]] = {}
    common: _Fields = {}
    part = parts.setdefault(1, {})
    for where, line in lines:
        match = _FIELD.match(line)
        if match is None:
            portions = line.split(_BETWEEN_VALUES)
            if line and (len(portions) > len(found) or line[0] not in "+-.,0123456789"):
                raise InputError(
                    f"{where}: {shown(line)} is no K-field, nor values of {len(found)} characteristics; correct it"
                )
            for at, portion in zip(sorted(found), portions if line else (), strict=False):
                names = ("K0020", "K0021", *_PORTIONS) if found[at][1].get("K2004") in _COUNTED else _PORTIONS
                given = zip(names, portion.split(_BETWEEN_FIELDS), strict=False)
                found[at][2].append({key: text.strip() for key, text in given if text.strip()})
            continue
        key, at, text = match[1], int(match[2] or 1), (match[4] or "").strip()
        if not text or key.startswith("K01"):  # header of the file
            continue
        if key.startswith("K1"):
            part = parts.setdefault(at, {}) if at else part
            part[key] = text
        elif key.startswith("K2") and at:
            found.setdefault(at, (part, dict(common), []))[1][key] = text
        elif key.startswith("K2"):  # of all
            common[key] = text
            for _, fields, _ in found.values():
                fields.setdefault(key, text)
        elif key.startswith("K0"):
            if at and at not in found:
                raise InputError(f"{where}: a value of characteristic {at}, which is not described; add its K2002/{at}")
            for _, _, values in [found[at]] if at else found.values():
                begins = not values or (key in ("K0001", "K0020") and key in values[-1])
                number = int(match[3] or len(values) + begins)
                if not 0 < number <= len(values) + 1:
                    raise InputError(
                        f"{where}: value {number} of characteristic {at}, which has {len(values)}; correct it"
                    )
                values += [{}] * (number > len(values))
                values[number - 1] = {key: text, **values[number - 1]}
    return [found[at] for at in sorted(found)]


def _rows(name: str, part: _Fields, measured: Sequence[tuple[_Fields, _Fields, list[_Fields]]]) -> Iterator[_Fields]:
    """Pieces of one part number: values of one serial number (K0014), else values of one place in the order."""
    names = [_name(fields) for one, fields, values in measured if one is part and values]
    if twice := [each for each in names if names.count(each) > 1]:
        raise InputError(f"{name}: two characteristics of a part are named {shown(twice[0])}; give each its own K2002")
    own = {_name(fields): values for one, fields, values in measured if one is part and values}
    by_serial = all("K0014" in value for values in own.values() for value in values)
    if not by_serial and len({len(values) for values in own.values()}) > 1:
        counts = ", ".join(f"{len(values)} of {shown(each)}" for each, values in own.items())
        raise InputError(f"{name}: values of a part are {counts[:200]}, and not all have a serial number (K0014); "
                         "export it too, for it tells the values of one piece")  # fmt: skip
    rows: dict[str, _Fields] = {}
    for each, values in own.items():
        for number, value in enumerate(values):
            key = value["K0014"] if by_serial else str(number)
            row = rows.setdefault(key, {field: part[field] for field in _OF_PART if field in part})
            if each in row:
                raise InputError(f"{name}: serial number {shown(key)} has {shown(each)} twice; keep one")
            row |= {field: text for field, text in value.items() if field in _OF_VALUE and field not in row}
            row[each] = "" if value.get("K0002") in _NO_VALUE else value.get("K0001", "")
    yield from rows.values()
