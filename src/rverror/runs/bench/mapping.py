"""Mapping files, TOML: how a bench names, scales and signs its columns, and where the header's values stand."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from rverror.base import units
from rverror.base.text import PathLike, did_you_mean, read_text, shown
from rverror.base.toml import Place, TomlText, read_toml
from rverror.runs.bench.numerals import THOUSANDS
from rverror.runs.reading import COLUMN_NAME, COLUMNS, DIRECTIONS, EXAMPLES, HEADER_KEYS

_TOP = ("name", "file", "columns", "header", "keep")
_FILE = ("group", "encoding", "separator", "decimal", "thousands", "skip")
_COLUMN = ("name", "column", "unit", "sign", "scale", "counts_per_turn", "wraps_at")
_VALUE = ("name", "column", "property", "unit")
_SEPARATORS = (";", ",", "\t", "|", " ")
_HEADER_EXAMPLES = {"output_torque": "20 N*m", "temperature": "20 degC", "direction": "forward", "index": "A"}
_DIMENSIONS = {"output_torque": "torque", "temperature": "temperature"}
#: Words of the trade that pint reads as something else, or not at all.
_SPELT = {
    "Grad": "deg", "Deg": "deg", "DEG": "deg", "Umdrehung": "turn", "U": "turn", "rev": "turn", "revs": "turn",
    "Nm": "N*m", "Ncm": "N*cm", "Nmm": "N*mm", "Sek": "s", "Sekunden": "s",
}  # fmt: skip
_COUNTS = ("counts", "count", "ticks", "increments", "Inkremente", "pulses")


@dataclass(frozen=True, kw_only=True)
class Where:
    """Where a value stands in the bench's file.

    Attributes
    ----------
    name : str
        Of a column, data set or channel; with the group before it, as in ``group/channel``.
    column : int
        Of a text file, from 1; 0 where the name tells.
    property : str
        Name of an attribute, property or line of the preamble.
    stated_at : str
        Place in the mapping, for messages.
    """

    name: str = ""
    column: int = 0
    property: str = ""
    stated_at: str = ""

    def __str__(self) -> str:
        """Name it as the mapping does."""
        return f"column {self.column}" if self.column else shown(self.name or self.property, 60)


@dataclass(frozen=True, kw_only=True)
class ColumnRule:
    """What makes a known column of one of the bench's.

    Attributes
    ----------
    unit : str
        pint's notation; empty where the file says it.
    factor : float
        rad or s for one of the file's numbers, sign included; 0 where it waits for the file's unit.
    scaled : bool
        Whether `factor` holds a scale, so that the file's own unit says nothing of it.
    sign : float
        +1 or -1.
    counts : bool
        Whether the numbers are counts of an encoder.
    wraps_at : float
        Counts after which the counter starts again; 0 where nothing is said.
    """

    where: Where
    unit: str = ""
    factor: float = 0.0
    scaled: bool = False
    sign: float = 1.0
    counts: bool = False
    wraps_at: float = 0.0


@dataclass(frozen=True, kw_only=True)
class HeaderRule:
    """Value of a header key: stated, or where it stands in the file.

    Attributes
    ----------
    text : str
        As stated; empty where the file says it.
    unit : str
        Of a number without one.
    """

    text: str = ""
    where: Where = field(default_factory=Where)
    unit: str = ""


@dataclass(frozen=True, kw_only=True)
class TextRules:
    """How a text file is written; what is empty is found in the file and noted.

    Attributes
    ----------
    skip : int
        Lines above the column names; -1 where the names themselves tell.
    """

    encoding: str = ""
    separator: str = ""
    decimal: str = ""
    thousands: str = ""
    skip: int = -1


@dataclass(frozen=True, kw_only=True)
class BenchMapping:
    """Content of a mapping file; without one, columns are named as in a run file.

    Attributes
    ----------
    path : str
        File of the mapping; empty where there is none.
    group : str
        Group of HDF5 and TDMS files, or structure of MAT files, in which the names stand.
    columns : mapping of str to ColumnRule
        By the names of a run file; empty where the bench uses these.
    keep : mapping of str to Where
        Other columns that are kept, by their name in the run.
    """

    path: str = ""
    group: str = ""
    text: TextRules = field(default_factory=TextRules)
    columns: Mapping[str, ColumnRule] = field(default_factory=dict)
    header: Mapping[str, HeaderRule] = field(default_factory=dict)
    keep: Mapping[str, Where] = field(default_factory=dict)


def load_mapping(path: PathLike) -> BenchMapping:
    """Read a mapping file.

    Parameters
    ----------
    path : str or path-like

    Returns
    -------
    BenchMapping

    Raises
    ------
    InputError
        If the file cannot be used; one line that names file, line, key and remedy.

    Notes
    -----
    The keys stand in docs page ``bench-files.md``.
    """
    toml = read_toml(str(path), read_text(path))
    toml.check_keys((), toml.content, _TOP, "table of a mapping")
    toml.string((), toml.content, "name", "")
    tables = {name: _table(toml, (name,), toml.content.get(name, {})) for name in _TOP[1:]}
    toml.check_keys(("file",), tables["file"], _FILE, "key of [file]")
    toml.check_keys(("columns",), tables["columns"], tuple(COLUMNS), "column")
    toml.check_keys(("header",), tables["header"], HEADER_KEYS, "key of [header]")
    return BenchMapping(
        path=str(path),
        group=toml.string(("file",), tables["file"], "group", "").strip("/"),
        text=_text_rules(toml, tables["file"]),
        columns={key: _column_rule(toml, key, value) for key, value in tables["columns"].items()},
        header={key: _header_rule(toml, key, value) for key, value in tables["header"].items()},
        keep={key: _kept(toml, key, value) for key, value in tables["keep"].items()},
    )


def unit_factor(unit: str, dimension: str) -> float:
    """Core units for one of a bench's unit.

    Parameters
    ----------
    unit : str
        pint's notation.
    dimension : str
        ``angle``, ``time``, ``torque`` or ``temperature``.

    Raises
    ------
    ValueError
        If the unit is unknown, of another dimension, or a word that pint takes for something else.

    Examples
    --------
    >>> unit_factor("ms", "time")
    0.001
    """
    if unit in _COUNTS:
        raise ValueError(f"{unit!r} are no {dimension} without counts_per_turn; state both in the mapping")
    if unit in _SPELT:
        raise ValueError(f"{unit!r} is no unit that is understood; did you mean {_SPELT[unit]!r}?")
    factor = units.unit_factor(unit, dimension)
    # pint takes every number without a dimension for rad: ratio, percent, bits.
    if dimension == "angle" and factor == 1.0 and not unit.lower().startswith("rad"):
        raise ValueError(f"{unit!r} is no unit of angle; use one like 'deg'")
    return factor


def _table(toml: TomlText, place: Place, value: object) -> dict[str, Any]:
    if not isinstance(value, dict):
        toml.refuse(place, f"{place[-1]} = {shown(value)}: must be a table; write '[{place[-1]}]' and keys below it")
    return value


def _text_rules(toml: TomlText, table: Mapping[str, Any]) -> TextRules:
    place = ("file",)
    given = {key: toml.string(place, table, key, "") for key in ("encoding", "separator", "decimal", "thousands")}
    for key, known in (("separator", _SEPARATORS), ("decimal", (".", ",")), ("thousands", THOUSANDS)):
        if key in table and given[key] not in known:
            listed = ", ".join(repr(sign) for sign in known)
            toml.refuse((*place, key), f"{key} = {shown(given[key])}: must be one of {listed}")
    if "encoding" in table:
        _check_encoding(toml, given["encoding"])
    if given["thousands"] and not given["decimal"]:
        toml.refuse((*place, "thousands"), "thousands needs decimal beside it; write decimal = ',' or '.'")
    if given["thousands"] and given["thousands"] == given["decimal"]:
        toml.refuse((*place, "thousands"), f"thousands and decimal are both {given['decimal']!r}; correct one of them")
    skip = table.get("skip", -1)
    if "skip" in table and (isinstance(skip, bool) or not isinstance(skip, int) or skip < 0):
        toml.refuse((*place, "skip"), f"skip = {shown(skip)}: must be a whole number of lines, 0 or more")
    return TextRules(skip=skip, **given)


def _check_encoding(toml: TomlText, name: str) -> None:
    try:
        "1".encode(name)
    except (LookupError, ValueError):
        known = ("utf-8", "cp1252", "latin-1", "utf-16", "gb18030", "shift_jis")
        hint = did_you_mean(name, known)
        toml.refuse(
            ("file", "encoding"),
            f"encoding = {shown(name)}: no such text encoding;{hint} write one like {', '.join(map(repr, known))}",
        )


def _where(toml: TomlText, place: Place, table: Mapping[str, Any], kinds: tuple[str, ...], example: str) -> Where:
    """The one key of name, column and property that a table holds."""
    given = [key for key in kinds if key in table]
    if len(given) != 1:
        what = "lacks" if not given else "has more than one of"
        toml.refuse(place, f"{place[-1]} {what} {', '.join(kinds)}; write {place[-1]} = {{ {example} }}")
    stated_at = _stated_at(toml, place)
    if given == ["column"]:
        number = table["column"]
        if isinstance(number, bool) or not isinstance(number, int) or number < 1:
            toml.refuse((*place, "column"), f"column = {shown(number)}: must be a whole number, counted from 1")
        return Where(column=number, stated_at=stated_at)
    text = toml.string(place, table, given[0], "").strip()
    if not text:
        toml.refuse((*place, given[0]), f'{given[0]} is empty; write {given[0]} = "..." as the file has it')
    name, property_ = (text, "") if given == ["name"] else ("", text)
    return Where(name=name, property=property_, stated_at=stated_at)


def _stated_at(toml: TomlText, place: Place) -> str:
    return f"mapping {toml.path}" + (f", line {toml.lines[place]}" if place in toml.lines else "")


def _number(toml: TomlText, place: Place, table: Mapping[str, Any], key: str) -> float | None:
    """A number above 0; None where the key is not given."""
    if key not in table:
        return None
    value = table[key]
    if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < 1e300:
        remedy = "; a column that counts the other way gets sign = -1" if key == "scale" else ""
        toml.refuse((*place, key), f"{key} = {shown(value)}: must be a number above 0{remedy}")
    return float(value)


def _column_rule(toml: TomlText, key: str, value: object) -> ColumnRule:
    place: Place = ("columns", key)
    example = f'name = "...", unit = "{EXAMPLES[key]}"'
    table = {"name": value} if isinstance(value, str) else value
    if not isinstance(table, dict):
        toml.refuse(place, f"{key} = {shown(value)}: must be a table; write {key} = {{ {example} }}")
    toml.check_keys(place, table, _COLUMN, f"key of {key}")
    where = _where(toml, place, table, ("name", "column"), example)
    unit = toml.string(place, table, "unit", "").strip()
    sign = table.get("sign", 1)
    if isinstance(sign, bool) or sign not in (1, -1):
        toml.refuse((*place, "sign"), f"sign = {shown(sign)}: must be 1 or -1; write -1 where it counts the other way")
    scale = _number(toml, place, table, "scale")
    per_turn, wraps_at = (_number(toml, place, table, name) for name in ("counts_per_turn", "wraps_at"))
    if unit == "counts":
        if COLUMNS[key] != "angle" or key == "te":
            toml.refuse((*place, "unit"), f"{key} in counts; only input_angle and output_angle may be counts")
        if per_turn is None:
            toml.refuse(place, f"{key} in counts lacks counts_per_turn; write counts_per_turn = 4 * lines of the disc")
        if scale is not None:
            toml.refuse((*place, "scale"), "counts have counts_per_turn and no scale; leave scale out")
        factor = sign * units.unit_factor("turn", "angle") / per_turn
        return ColumnRule(
            where=where, unit=unit, factor=factor, scaled=True, sign=sign, counts=True, wraps_at=wraps_at or 0.0
        )
    for name, number in (("counts_per_turn", per_turn), ("wraps_at", wraps_at)):
        if number is not None:
            toml.refuse((*place, name), f'{name} belongs to counts; write unit = "counts", or leave {name} out')
    if scale is not None and not unit:
        toml.refuse(place, f'{key} has a scale but no unit; write unit = "{EXAMPLES[key]}", that of scaled numbers')
    factor = 0.0
    if unit:
        try:
            factor = unit_factor(unit, COLUMNS[key]) * sign * (scale or 1.0)
        except ValueError as error:
            toml.refuse((*place, "unit"), f"{key}: {error}")
    return ColumnRule(where=where, unit=unit, factor=factor, scaled=scale is not None, sign=float(sign))


def _header_rule(toml: TomlText, key: str, value: object) -> HeaderRule:
    place: Place = ("header", key)
    example = _HEADER_EXAMPLES[key]
    dimension = _DIMENSIONS.get(key)
    if isinstance(value, dict):
        toml.check_keys(place, value, _VALUE if dimension else ("property",), f"key of {key}")
        kinds = _VALUE[:3] if dimension else ("property",)
        where = _where(toml, place, value, kinds, 'property = "..."')
        unit = toml.string(place, value, "unit", "").strip()
        if unit and dimension:
            try:
                units.parse(f"1 {unit}", dimension)
            except ValueError as error:
                message = str(error).partition(";")[0].replace(f"1 {unit}", unit)
                hint = f"did you mean {_SPELT[unit]!r}?" if unit in _SPELT else f"write one like {example!r}"
                toml.refuse((*place, "unit"), f"{key}: {message}; {hint}")
        return HeaderRule(where=where, unit=unit)
    text = toml.string(("header",), toml.content["header"], key, "").strip()
    if dimension:
        toml.quantity(place, text, dimension, example)
    elif key == "direction" and text.lower() not in DIRECTIONS:
        hint = did_you_mean(text, DIRECTIONS)
        toml.refuse(place, f"direction = {shown(text)}: must be forward, reverse or mixed;{hint} without it the angles "
                           "tell")  # fmt: skip
    elif not text:
        toml.refuse(place, f'{key} is empty; write {key} = "{example}" or leave it out')
    return HeaderRule(text=text, where=Where(stated_at=_stated_at(toml, place)))


def _kept(toml: TomlText, key: str, value: object) -> Where:
    place: Place = ("keep", key)
    match = COLUMN_NAME.match(key)
    if match is None or not match[1] or match[1].lower() in COLUMNS or re.search(r"[,;\r\n#]", key):
        toml.refuse(place, f"{shown(key)} cannot name a kept column; use a plain word and [unit], like 'oil[degC]'")
    table = {"name": value} if isinstance(value, str) else value
    if not isinstance(table, dict):
        toml.refuse(place, f'{key} = {shown(value)}: must be the name of a column; write "{key}" = "..."')
    toml.check_keys(place, table, ("name", "column"), f"key of {key}")
    return _where(toml, place, table, ("name", "column"), 'name = "..."')
