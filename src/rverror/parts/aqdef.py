"""Q-DAS ASCII transfer format (AQDEF), .dfq or .dfd beside .dfx: a table with a row for each piece.

aqdefreader, the reader that there is, leaves out serial numbers (K0014) and description files, so the few K-fields that
parts need are read here.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from rverror.base.errors import InputError
from rverror.base.numbers import count_of
from rverror.base.text import PathLike, read_bytes, shown, split_lines
from rverror.runs.bench.columns import BenchFile, Entry, RawArray
from rverror.runs.bench.numerals import Numerals

SUFFIXES = (".dfq", ".dfd", ".dfx")
_FIELD = re.compile(r"(K\d{4})(?:/(\d+))?(?:/(\d+))?(?:\s+(.*))?$")
#: Fields of a value that stands without K-fields, in order; K0014 follows in a line of its own.
_PORTIONS = ("K0001", "K0002", "K0004", "K0005", "K0006", "K0007", "K0008", "K0010", "K0011", "K0012")
_BETWEEN_VALUES, _BETWEEN_FIELDS = "\x0f", "\x14"
#: Of K0002: a value that was marked as none.
_NO_VALUE = ("255", "256")
#: Of K2004: counted, not measured.
_ATTRIBUTES = ("1", "5", "6")
#: Fields that become columns beside the characteristics: of the part, and of the value.
_OF_PART, _OF_VALUE = ("K1001", "K1002"), ("K0014", "K0006", "K0004")


@dataclass(frozen=True)
class _Characteristic:
    part: dict[str, str]
    fields: dict[str, str] = field(default_factory=dict)
    values: list[dict[str, str]] = field(default_factory=list)

    @property
    def name(self) -> str:
        return self.fields.get("K2002") or self.fields.get("K2001") or ""


def open_aqdef(path: PathLike) -> tuple[BenchFile, dict[str, str]]:
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
    name, lines = str(path), list(_lines(path))
    found = _characteristics(name, lines)
    measured = [each for each in found if each.fields.get("K2004", "0") not in _ATTRIBUTES]
    notes = []
    if len(measured) < len(found):
        notes.append(f"{count_of(len(found) - len(measured), 'characteristic')} left out, counted and not measured")
    marked = sum(value.get("K0002") in _NO_VALUE for each in measured for value in each.values)
    if marked:
        notes.append(f"{count_of(marked, 'value')} left out, marked as none by K0002")
    rows = [
        row for part in {id(each.part): each.part for each in measured}.values() for row in _rows(name, part, measured)
    ]
    if not rows:
        raise InputError(f"{name}: no measured values (K0001) in it; export them with the description")
    columns = list(dict.fromkeys([*(each.name for each in measured), *_OF_PART, *_OF_VALUE]))
    unit = {each.name: each.fields.get("K2142", "") for each in measured}
    entries = tuple(Entry(name=each, unit=unit.get(each, ""), size=len(rows)) for each in columns)

    def words(entry: Entry) -> list[str]:
        return [row.get(entry.name, "") for row in rows]

    def read(chosen: Sequence[Entry]) -> list[RawArray]:
        return [np.array([_number(word) for word in words(entry)]) for entry in chosen]

    nominal = {each.name: each.fields["K2101"] for each in measured if each.fields.get("K2101")}
    return BenchFile(
        path=name, kind="text", entries=entries, read=read, words=words, notes=tuple(notes), noun="piece",
        labels=np.arange(len(rows)) + 1, parse=Numerals(".").parse,
    ), nominal  # fmt: skip


def _number(word: str) -> float:
    value = Numerals(",").parse(word) if "," in word else Numerals(".").parse(word)
    return np.nan if value is None else value


def _lines(path: PathLike) -> Iterator[tuple[str, str]]:
    """Lines with their places."""
    given = Path(path)
    both = {".dfd": [given, given.with_suffix(".dfx")], ".dfx": [given.with_suffix(".dfd"), given]}
    for one in both.get(given.suffix.lower(), [given]):
        raw = read_bytes(one)
        try:
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError:
            text = raw.decode("cp1252", errors="replace")
        yield from ((f"{one}, line {i}", line.strip(" \t")) for i, line in enumerate(split_lines(text), 1))


def _characteristics(name: str, lines: Sequence[tuple[str, str]]) -> list[_Characteristic]:
    """All of them, with their values."""
    if not any(line.startswith(("K0100", "K1001", "K2001", "K2002")) for _, line in lines):
        raise InputError(f"{name}: no line begins with K0100, so this is no Q-DAS transfer file; export it as .dfq")
    parts: dict[int, dict[str, str]] = {}
    found: dict[int, _Characteristic] = {}
    common: dict[str, str] = {}
    part = parts.setdefault(1, {})
    for where, line in lines:
        match = _FIELD.match(line)
        if match is None:
            if line and (line[0] in "+-.0123456789" or _BETWEEN_FIELDS in line):
                _uncoded(where, line, found)
            elif line:
                raise InputError(f"{where}: {shown(line)} is neither a K-field nor a value; correct the line")
            continue
        key, at, of, text = match[1], int(match[2] or 1), match[3], (match[4] or "").strip()
        if not text or key.startswith("K01"):  # header of the file
            continue
        if key.startswith("K1"):
            part = parts.setdefault(at, {}) if at else part
            part[key] = text
        elif key.startswith("K2") and at:
            found.setdefault(at, _Characteristic(part, dict(common))).fields[key] = text
        elif key.startswith("K2"):
            common[key] = text
            for each in found.values():
                each.fields.setdefault(key, text)
        elif key.startswith("K0"):
            _coded(where, key, at, of, text, found)
    return [found[at] for at in sorted(found)]


def _coded(where: str, key: str, at: int, of: str | None, text: str, found: dict[int, _Characteristic]) -> None:
    """A field of a value: of the last one, of all characteristics at 0, or of the one that a second index tells."""
    if at and at not in found:
        raise InputError(f"{where}: a value of characteristic {at}, which is not described; add its K2002/{at}")
    for each in [found[at]] if at else found.values():
        begins = not each.values or (key in ("K0001", "K0020") and key in each.values[-1])
        number = len(each.values) + begins if of is None else int(of)
        if number < 1 or number > len(each.values) + 1:
            raise InputError(f"{where}: value {number} of {shown(each.name)}, which has {len(each.values)}; correct it")
        if number > len(each.values):
            each.values.append({})
        each.values[number - 1].setdefault(key, text)


def _uncoded(where: str, line: str, found: dict[int, _Characteristic]) -> None:
    """A line with a value of each characteristic."""
    values = line.split(_BETWEEN_VALUES)
    if len(values) > len(found):
        raise InputError(f"{where}: {len(values)} values, but {len(found)} characteristics; correct the line")
    for at, value in zip(sorted(found), values, strict=False):
        portions = value.split(_BETWEEN_FIELDS)
        names = ("K0020", "K0021", *_PORTIONS) if found[at].fields.get("K2004") in _ATTRIBUTES else _PORTIONS
        found[at].values.append({key: text.strip() for key, text in zip(names, portions, strict=False) if text.strip()})


def _rows(name: str, part: dict[str, str], measured: Sequence[_Characteristic]) -> Iterator[dict[str, str]]:
    """Pieces of one part number: values of one serial number (K0014), else values of one place in the order."""
    own = [each for each in measured if each.part is part and each.values]
    by_serial = all("K0014" in value for each in own for value in each.values)
    if not by_serial and len({len(each.values) for each in own}) > 1:
        counts = ", ".join(f"{len(each.values)} of {shown(each.name)}" for each in own[:4])
        raise InputError(
            f"{name}: values of {shown(part.get('K1001', ''))} are {counts}, and not all have a serial number (K0014); "
            "export it too, it says which values are of one piece"
        )
    rows: dict[str, dict[str, str]] = {}
    for each in own:
        for number, value in enumerate(each.values):
            key = value["K0014"] if by_serial else str(number)
            row = rows.setdefault(key, {name: part[name] for name in _OF_PART if name in part})
            for name_of, text in value.items():
                row.setdefault(name_of, text)
            if value.get("K0002") not in _NO_VALUE:
                if each.name in row:
                    raise InputError(f"{name}: serial number {shown(key)} has {shown(each.name)} twice; keep one")
                row[each.name] = value.get("K0001", "")
    yield from rows.values()
