"""Mapping files, TOML: how a bench names, scales and signs its columns, its units, and where header values stand."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from rverror.base import units
from rverror.base.directions import DIRECTIONS
from rverror.base.text import PathLike, did_you_mean, read_text, shown
from rverror.base.toml import KeyPath, TomlText, is_number, is_whole, read_toml
from rverror.runs.reading import (
    DIMENSIONS,
    HEADER_KEYS,
    ORDER_COLUMNS,
    ORDER_CONDITIONS,
    RUN_COLUMNS,
    SPEEDS,
    STATED,
    UNITS,
)

#: Words of the trade that pint reads as something else, or not at all.
_SPELT = {
    "Grad": "deg", "Deg": "deg", "DEG": "deg", "Umdrehung": "turn", "U": "turn", "rev": "turn", "revs": "turn",
    "Nm": "N*m", "Ncm": "N*cm", "Nmm": "N*mm", "kNm": "kN*m", "Sek": "s", "Sekunden": "s",
    "'": "arcmin", "′": "arcmin", "''": "arcsec", '"': "arcsec", "″": "arcsec",
    "1/min": "rpm", "U/min": "rpm", "min-1": "rpm", "min^-1": "rpm",
}  # fmt: skip
#: Words for the counts of an encoder; the first is the mapping's.
COUNTS = ("counts", "count", "ticks", "increments", "Inkremente", "pulses")


def meant_unit(word: str) -> str:
    """Unit in pint's notation that a word of the trade means.

    Examples
    --------
    >>> meant_unit("Nm"), meant_unit("deg")
    ('N*m', 'deg')
    """
    return _SPELT.get(word, word)


def unit_scale(unit: str, dimension: str) -> tuple[float, float]:
    """Core units for one of a bench's unit, and its zero in core units: other than 0 of temperatures alone.

    Parameters
    ----------
    unit : str
        pint's notation.
    dimension : str
        ``angle``, ``time``, ``torque``, ``angular_speed`` or ``temperature``.

    Raises
    ------
    ValueError
        If the unit is unknown, of another dimension, or a word that pint takes for something else.

    Examples
    --------
    >>> unit_scale("ms", "time"), unit_scale("degC", "temperature")
    ((0.001, 0.0), (1.0, 273.15))
    """
    if unit in COUNTS:
        raise ValueError(f"{unit!r} are no {dimension} without counts_per_turn; state both in the mapping")
    if unit in _SPELT:
        raise ValueError(f"{unit!r} is no unit that is understood; did you mean {_SPELT[unit]!r}?")
    return units.unit_scale(unit, dimension)


_TOP = ("name", "file", "columns", "orders", "header")
_FILE = ("group", "encoding", "separator", "decimal", "skip")
_COLUMN = ("name", "column", "unit", "sign", "scale", "counts_per_turn", "wraps_at")
_ORDER_COLUMN = ("name", "column", "unit", "scale")
_WAVES = ("amplitude", "phase", "cos", "sin")  # each may count the other way
_UNITLESS = ("name", "column", "scale")
_SEPARATORS = (";", ",", "\t", "|", " ")
_HEADER_EXAMPLES = {
    "output_torque": "20 N*m",
    "temperature": "20 degC",
    "input_speed": "100 rpm",
    "direction": "forward",
    "index": "A",
}


@dataclass(frozen=True, kw_only=True)
class Where:
    """Where a value stands in the bench's file.

    Attributes
    ----------
    name : str
        Of a column, data set or channel, with the group before it, as in ``group/channel``; of a header's value, of an
        attribute, property or line of the preamble.
    column : int
        Of a text file, from 1; 0 where the name tells.
    stated_at : str
        Place in the mapping, for messages.
    """

    name: str = ""
    column: int = 0
    stated_at: str = ""

    def __str__(self) -> str:
        """Name it as the mapping does."""
        return f"column {self.column}" if self.column else shown(self.name, 60)


@dataclass(frozen=True, kw_only=True)
class ColumnRule:
    """What makes a known column of one of the bench's.

    Attributes
    ----------
    unit : str
        pint's notation; empty where the file says it.
    factor : float
        Core units for one of the file's numbers, sign included; 0 where it waits for the file's unit.
    zero : float
        Zero of the unit, core units: of a temperature.
    scaled : bool
        Whether `factor` holds a scale, so that the file's own unit says nothing of it.
    sign : float
        +1 or -1.
    counts : bool
        Whether the numbers are counts of an encoder.
    wraps_at : float
        Counts after which the counter starts again; 0 where nothing is said.
    words : mapping of str to str
        Of the directions in an order table: the bench's words for forward and reverse, in lower case; empty where these
        are the words.
    """

    where: Where
    unit: str = ""
    factor: float = 0.0
    zero: float = 0.0
    scaled: bool = False
    sign: float = 1.0
    counts: bool = False
    wraps_at: float = 0.0
    words: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class HeaderRule:
    """Value of a header key: stated, or where it stands in the file.

    Attributes
    ----------
    text : str
        As stated; empty where the file says it.
    unit : str
        Of a number without one.
    words : mapping of str to str
        The bench's words for forward and reverse, in lower case; empty where these are the words.
    """

    text: str = ""
    where: Where = field(default_factory=Where)
    unit: str = ""
    words: Mapping[str, str] = field(default_factory=dict)


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
    orders : mapping of str to ColumnRule
        Columns of an order table, by its names; empty where the files are runs.
    """

    path: str = ""
    group: str = ""
    text: TextRules = field(default_factory=TextRules)
    columns: Mapping[str, ColumnRule] = field(default_factory=dict)
    orders: Mapping[str, ColumnRule] = field(default_factory=dict)
    header: Mapping[str, HeaderRule] = field(default_factory=dict)


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
    toml.string((), toml.content, "name")
    tables = {name: toml.table(name) for name in _TOP[1:]}
    toml.check_keys(("file",), tables["file"], _FILE, "key of [file]")
    toml.check_keys(("columns",), tables["columns"], (*RUN_COLUMNS, *SPEEDS), "column")
    for speed, angle in SPEEDS.items():
        if {speed, angle} <= tables["columns"].keys():
            toml.refuse(("columns", speed), f"{speed} beside {angle}: it would be integrated to it; leave one of them")
    of_run = "orders" not in toml.content
    if "columns" in toml.content and not of_run:
        toml.refuse(("columns",), "[columns] beside [orders]: a file is a run or a table; leave out one of them")
    toml.check_keys(("orders",), tables["orders"], ORDER_COLUMNS, "column")
    keys = HEADER_KEYS if of_run else (*HEADER_KEYS, "input_speed")
    toml.check_keys(("header",), tables["header"], keys, "key of [header]")
    for key in filter(tables["header"].__contains__, tables["orders"]):
        toml.refuse(("header", key), f"{key} stands in [orders] too; leave one of them")
    return BenchMapping(
        path=str(path),
        group=toml.string(("file",), tables["file"], "group").strip("/"),
        text=text_rules(toml),
        columns={key: _column_rule(toml, key, value) for key, value in tables["columns"].items()},
        orders={key: _order_rule(toml, key, value) for key, value in tables["orders"].items()},
        header={key: _header_rule(toml, key, value, of_run=of_run) for key, value in tables["header"].items()},
    )


def given_mapping(mapping: PathLike | BenchMapping | None) -> BenchMapping | None:
    """Mapping as it is, or read from its file; None where none is given."""
    return mapping if mapping is None or isinstance(mapping, BenchMapping) else load_mapping(mapping)


def text_rules(toml: TomlText) -> TextRules:
    """How a text file is written, of the keys of ``[file]``.

    Raises
    ------
    InputError
        If a value is none that a text can have.
    """
    place, table = ("file",), toml.table("file")
    given = {key: toml.string(place, table, key) for key in ("encoding", "separator", "decimal")}
    for key, known in (("separator", _SEPARATORS), ("decimal", (".", ","))):
        toml.checked(place, table, key, known.__contains__, f"one of {', '.join(map(repr, known))}")
    if "encoding" in table:
        _check_encoding(toml, given["encoding"])
    must = "a whole number of lines, 0 or more"
    skip = toml.checked(place, table, "skip", lambda lines: is_whole(lines) and lines >= 0, must, -1)
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


def _where(
    toml: TomlText, place: KeyPath, table: Mapping[str, Any], example: str, kinds: Sequence[str] = ("name", "column")
) -> Where:
    """The one key of name, column and property that a table holds."""
    given = [key for key in kinds if key in table]
    if len(given) != 1:
        what = "lacks" if not given else "has more than one of"
        toml.refuse(place, f"{place[-1]} {what} {', '.join(kinds)}; write {place[-1]} = {{ {example} }}")
    stated_at = _stated_at(toml, place)
    if given == ["column"]:
        must = "a whole number, counted from 1"
        number = toml.checked(place, table, "column", lambda column: is_whole(column) and column > 0, must)
        return Where(column=number, stated_at=stated_at)
    text = toml.string(place, table, given[0]).strip()
    if not text:
        toml.refuse((*place, given[0]), f'{given[0]} is empty; write {given[0]} = "..." as the file has it')
    return Where(name=text, stated_at=stated_at)


def _stated_at(toml: TomlText, place: KeyPath) -> str:
    return f"mapping {toml.path}" + (f", line {toml.lines[place]}" if place in toml.lines else "")


def _number(toml: TomlText, place: KeyPath, table: Mapping[str, Any], key: str) -> float | None:
    """A number above 0; None where the key is not given."""
    must = "a number above 0" + ("; a column that counts the other way gets sign = -1" if key == "scale" else "")
    value = toml.checked(place, table, key, lambda number: is_number(number) and 0 < number < 1e300, must)
    return None if value is None else float(value)


def _column_rule(toml: TomlText, key: str, value: object) -> ColumnRule:
    place: KeyPath = ("columns", key)
    example = f'name = "...", unit = "{UNITS[key]}"'
    table = column_table(toml, place, value, example, _COLUMN)
    per_turn, wraps_at = (_number(toml, place, table, name) for name in ("counts_per_turn", "wraps_at"))
    if toml.string(place, table, "unit").strip() == "counts":
        if DIMENSIONS[key] != "angle" or key == "te":
            toml.refuse((*place, "unit"), f"{key} in counts; only input_angle and output_angle may be counts")
        if per_turn is None:
            toml.refuse(place, f"{key} in counts lacks counts_per_turn; write counts_per_turn = 4 * lines of the disc")
        if "scale" in table:
            toml.refuse((*place, "scale"), "counts have counts_per_turn and no scale; leave scale out")
        in_angle = scaled_rule(toml, place, {**table, "unit": "rad", "scale": math.tau / per_turn}, example, "angle")
        return replace(in_angle, counts=True, wraps_at=wraps_at or 0.0)
    for name, number in (("counts_per_turn", per_turn), ("wraps_at", wraps_at)):
        if number is not None:
            toml.refuse((*place, name), f'{name} belongs to counts; write unit = "counts", or leave {name} out')
    return scaled_rule(toml, place, table, example, DIMENSIONS[key])


def column_table(toml: TomlText, place: KeyPath, value: object, example: str, keys: Sequence[str]) -> dict[str, Any]:
    """Table of a column; its name alone stands for one that holds only this.

    Raises
    ------
    InputError
        If it is neither, or holds a key of none of these names.
    """
    table = {"name": value} if isinstance(value, str) else value
    if not isinstance(table, dict):
        what = f"{place[-1]} = {shown(value)}: must be a table, or the name of a column"
        toml.refuse(place, f"{what}; write {place[-1]} = {{ {example} }}")
    toml.check_keys(place, table, keys, f"key of {place[-1]}")
    return table


def is_sign(value: object) -> bool:
    """Tell 1 and -1."""
    return is_number(value) and value in (1, -1)


def scaled_rule(toml: TomlText, place: KeyPath, table: Mapping[str, Any], example: str, dimension: str) -> ColumnRule:
    """Rule of a column with a unit, a sign and a scale.

    Parameters
    ----------
    place : tuple
        Of the column in the mapping.
    example : str
        How it is written, for messages.
    dimension : str
        Of its numbers; empty where these have none.

    Raises
    ------
    InputError
        If it is not said which column is meant, or a key has no value of its kind.
    """
    key = place[-1]
    where = _where(toml, place, table, example)
    unit = toml.string(place, table, "unit").strip()
    sign = float(toml.checked(place, table, "sign", is_sign, "1 or -1; write -1 where it counts the other way", 1))
    scale = _number(toml, place, table, "scale")
    if not dimension:
        return ColumnRule(where=where, factor=scale or 1.0, scaled=True)
    if scale is not None and not unit:
        named = UNITS.get(str(key), units.DISPLAY_UNITS[dimension])
        toml.refuse(place, f'{key} has a scale but no unit; write unit = "{named}", that of scaled numbers')
    factor = zero = 0.0
    if unit:
        with toml.refusing((*place, "unit"), f"{key}: "):
            factor, zero = unit_scale(unit, dimension)
            factor *= sign * (scale or 1.0)
    return ColumnRule(where=where, unit=unit, factor=factor, zero=zero, scaled=scale is not None, sign=sign)


def _direction_words(toml: TomlText, place: KeyPath, table: Mapping[str, Any]) -> dict[str, str]:
    """The bench's words for the directions, in lower case; empty where the table has none."""
    given = {key: toml.string(place, table, key).strip().lower() for key in ("forward", "reverse") if key in table}
    for one, other in (("forward", "reverse"), ("reverse", "forward")):
        if one in given and not given.get(other):
            toml.refuse(place, f'{place[-1]} has no word for {other}; write {other} = "..." as the file has it')
    if len(set(given.values())) < len(given):
        toml.refuse((*place, "reverse"), f"forward and reverse are both {shown(given['reverse'])}; correct one of them")
    return {word: key for key, word in given.items()}


def _order_rule(toml: TomlText, key: str, value: object) -> ColumnRule:
    place: KeyPath = ("orders", key)
    if key == "direction":
        example = 'name = "...", forward = "...", reverse = "..."'
        table = column_table(toml, place, value, example, ("name", "column", "forward", "reverse"))
        return ColumnRule(where=_where(toml, place, table, example), words=_direction_words(toml, place, table))
    dimension = DIMENSIONS[key]
    example = 'name = "..."' + (f', unit = "{UNITS[key]}"' if dimension else "")
    keys = (*_ORDER_COLUMN, "sign") if key in _WAVES else _ORDER_COLUMN if dimension else _UNITLESS
    return scaled_rule(toml, place, column_table(toml, place, value, example, keys), example, dimension)


def _header_rule(toml: TomlText, key: str, value: object, *, of_run: bool) -> HeaderRule:
    place: KeyPath = ("header", key)
    example = _HEADER_EXAMPLES[key]
    dimension = DIMENSIONS[key] if key in ORDER_CONDITIONS else ""
    if isinstance(value, dict):
        more = ("unit",) if dimension else ("forward", "reverse") if key == "direction" else ()
        toml.check_keys(place, value, ("property", *more), f"key of {key}")
        where = _where(toml, place, value, 'property = "..."', ("property",))
        unit = toml.string(place, value, "unit").strip()
        if unit and dimension:
            with toml.refusing((*place, "unit"), f"{key}: "):
                units.unit_scale(unit, dimension)
        return HeaderRule(where=where, unit=unit, words=_direction_words(toml, place, value))
    text = toml.string(("header",), toml.table("header"), key).strip()
    if dimension:
        toml.quantity(place, text, dimension, example)
    elif key == "direction" and text.lower() not in (known := STATED if of_run else DIRECTIONS):
        remedy = "without it the angles tell" if of_run else "waves are of one direction: write it, or name a column"
        must = f"must be one of {', '.join(known)};{did_you_mean(text, known)}"
        toml.refuse(place, f"direction = {shown(text)}: {must} {remedy}")
    elif not text:
        toml.refuse(place, f'{key} is empty; write {key} = "{example}" or leave it out')
    return HeaderRule(text=text, where=Where(stated_at=_stated_at(toml, place)))
