"""Mapping files of measured parts, TOML: which column is which component of which error, or which reading."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from rverror.base import units
from rverror.base.text import PathLike, did_you_mean, read_text, shown
from rverror.base.toml import KeyPath, TomlText, is_number, is_whole, read_toml
from rverror.geartrain.source import IndexValue
from rverror.model.catalogue import CATALOGUE
from rverror.parts.measured import KINDS
from rverror.runs.bench.mapping import ColumnRule, TextRules, Where, column_table, is_sign, scaled_rule, text_rules

_COLUMN = ("name", "column", "unit", "sign", "scale", "nominal", "uncertainty")
#: Nominal value that the file states with the column.
_OF_FILE = "file"
#: Columns of each feature with their dimension; those of which it needs one each; kinds of parts; its other keys.
FEATURES: dict[str, tuple[dict[str, str], tuple[tuple[str, ...], ...], tuple[str, ...], tuple[str, ...]]] = {
    "circles": (
        {"number": "", "angle": "angle", "radius": "length"}, (("number",), ("angle",), ("radius",)),
        ("crank", "disc", "carrier"), ("datum", "common"),
    ),
    "lobes": (
        {"angle": "angle", "radius": "length", "deviation": "length"}, (("angle",), ("radius", "deviation")),
        ("disc",), ("datum", "common", "harmonics", "lobe_harmonics", "place"),
    ),
    "places": (
        {"number": "", "x": "length", "y": "length", "diameter": "length"}, (("number",), ("x",), ("y",)),
        ("housing", "disc", "carrier", "crank"), ("datum", "common", "harmonics"),
    ),
    "teeth": (
        {"number": "", "pitch": "length", "cumulative": "length", "runout": "length"},
        (("number",), ("pitch", "cumulative")), ("planet", "sun", "disc"), ("common", "harmonics", "zero", "sense"),
    ),
}  # fmt: skip
#: What the axes of a feature can be.
DATUMS = {"circles": ("fit", "axis", "given"), "lobes": ("fit", "bores"), "places": ("fit", "axis", "given")}
#: Waves where nothing is said, and most of them.
_HARMONICS, _LOBE_HARMONICS, _MOST_HARMONICS = {"lobes": 6, "teeth": 6}, 3, 60


@dataclass(frozen=True, kw_only=True)
class PartColumn:
    """What makes a size of one of the file's columns: scale x (reading - nominal).

    Attributes
    ----------
    rule : ColumnRule
        Place, unit and sign.
    dimension : str
        Of the readings; empty for whole numbers.
    scale : float
        Above 0.
    nominal : float, optional
        Reading of a part without error, core unit; None where the file states it.
    sigma : float, optional
        Stated uncertainty of the size, 1 sigma, core unit.
    """

    rule: ColumnRule
    dimension: str
    scale: float
    nominal: float | None
    sigma: float | None


@dataclass(frozen=True, kw_only=True)
class PartColumns:
    """Columns by their names in the mapping."""

    columns: Mapping[str, PartColumn]

    @property
    def sigmas(self) -> dict[str, float]:
        """Stated uncertainties of those that have one."""
        return {key: column.sigma for key, column in self.columns.items() if column.sigma is not None}


@dataclass(frozen=True, kw_only=True)
class ErrorColumns(PartColumns):
    """An error of which each row has the components."""

    key: str
    indices: Mapping[str, IndexValue]


@dataclass(frozen=True, kw_only=True)
class Feature(PartColumns):
    """A feature of which each row is a reading.

    Attributes
    ----------
    name : str
        One of `FEATURES`.
    datum : str
    common : float
        Uncertainty that all readings of a part share, mm.
    harmonics, lobe_harmonics : int
        0 where places stay single.
    zero : float
        Angle of the first tooth, rad.
    sense : int
        -1 where teeth are counted clockwise.
    place : int, optional
        Which disc of a unit it is made for.
    """

    name: str
    datum: str
    common: float
    zero: float
    sense: int
    harmonics: int
    lobe_harmonics: int
    place: int | None


@dataclass(frozen=True, kw_only=True)
class PartsMapping:
    """Content of a mapping file; `serial` is None where the name of the file is it, `count` where parts are single."""

    kind: str
    serial: Where | None
    count: Where | None
    text: TextRules
    groups: tuple[ErrorColumns, ...] | tuple[Feature]


def load_parts_mapping(path: PathLike) -> PartsMapping:
    """Read a mapping file.

    Raises
    ------
    InputError
        If the file cannot be used; one line that names file, line, key and remedy.
    """
    toml = read_toml(str(path), read_text(path))
    content = toml.content
    toml.check_keys(
        (), content, ("name", "kind", "serial", "count", "file", "error", *FEATURES), "key of a mapping of parts"
    )
    kind = toml.string((), content, "kind")
    if kind not in KINDS:
        hint = did_you_mean(kind, KINDS)
        toml.refuse(("kind",), f"kind = {shown(kind)}: must be one of {', '.join(KINDS)};{hint} correct it")
    given = [name for name in ("error", *FEATURES) if name in content]
    if len(given) != 1:
        listed = ", ".join(f"[{name}]" for name in FEATURES)
        toml.refuse(tuple(given[-1:]), "a mapping has [[error]] tables, where each row is a part, or one of "
                    f"{listed}, where each row is a reading; give one of them")  # fmt: skip
    toml.check_keys(("file",), toml.table("file"), ("encoding", "separator", "decimal", "skip"), "key of [file]")
    if "count" in content and kind != "roller":
        toml.refuse(("count",), f"count: only rollers come in classes, not a {kind}; leave it out")
    named: dict[str, Where | None] = dict.fromkeys(("serial", "count"))
    for name in named.keys() & content.keys():
        table = column_table(toml, (name,), content[name], 'name = "..."', ("name", "column"))
        named[name] = scaled_rule(toml, (name,), table, 'name = "..."', "").where
    features = (_feature(toml, given[0], kind),) if given != ["error"] else ()
    groups = features or tuple(_error(toml, place, table, kind) for place, table in toml.tables("error"))
    return PartsMapping(kind=kind, text=text_rules(toml), groups=groups, **named)


def _error(toml: TomlText, place: KeyPath, table: Mapping[str, Any], kind: str) -> ErrorColumns:
    key = toml.string(place, table, "key")
    frame, counted = KINDS[kind]
    fitting = {
        entry.key: names
        for entry in CATALOGUE.values()
        for names in [[index.name for index in entry.indices]]
        if entry.frame == frame and (counted is None or counted in names)
    }
    if key not in fitting:
        hint = did_you_mean(key, fitting)
        toml.refuse(
            (*place, "key"), f"key = {shown(key)}: no error of a {kind};{hint} choose one of {', '.join(fitting)}"
        )
    names = [name for name in fitting[key] if name != counted]
    dimensions = {parameter.name: parameter.dimension for parameter in CATALOGUE[key].parameters}
    toml.check_keys(place, table, ("key", *names, *dimensions), f"key of {key}")
    for name in names:
        if isinstance(table.get(name), bool) or not isinstance(table.get(name), int | str):
            toml.refuse((*place, name), f"{key}: {name} = {shown(table.get(name))}: must be a whole number; give it")
    columns = {
        each: _column(toml, (*place, each), table[each], dimensions[each]) for each in dimensions if each in table
    }
    if not columns:
        toml.refuse(place, f'{key} has no column; give {" or ".join(dimensions)} = {{ name = "...", unit = "um" }}')
    return ErrorColumns(key=key, indices=MappingProxyType({name: table[name] for name in names}), columns=columns)


def _column(toml: TomlText, place: KeyPath, value: object, dimension: str) -> PartColumn:
    unit = units.DISPLAY_UNITS[dimension] if dimension else ""
    example = 'name = "..."' + (f', unit = "{unit}"' if unit else "")
    table = dict(column_table(toml, place, value, example, _COLUMN if dimension else _COLUMN[:2]))
    must = "a number above 0; write 0.5 for a diameter"
    scale = toml.checked(place, table, "scale", lambda number: is_number(number) and 0 < number < 1e6, must, 1)
    nominal, sigma = table.pop("nominal", None), table.pop("uncertainty", None)
    table.pop("scale", None)
    if nominal is not None and nominal != _OF_FILE:
        nominal = toml.quantity((*place, "nominal"), nominal, dimension, "30 deg" if dimension == "angle" else "6 mm")
    if sigma is not None:
        sigma = toml.quantity((*place, "uncertainty"), sigma, dimension, f"0.5 {unit}") * scale
    rule = scaled_rule(toml, place, table, example, dimension)
    expected = None if nominal == _OF_FILE else nominal or 0.0
    return PartColumn(rule=rule, dimension=dimension, scale=float(scale), nominal=expected, sigma=sigma)


def _feature(toml: TomlText, name: str, kind: str) -> Feature:
    dimensions, needed, kinds, more = FEATURES[name]
    table = toml.table(name)
    if kind not in kinds:
        toml.refuse((name,), f"[{name}] is of a {' or '.join(kinds)}, not of a {kind}; correct kind")
    toml.check_keys((name,), table, (*dimensions, *more), f"key of [{name}]")
    for group in needed:
        given = [column for column in group if column in table]
        if len(given) != 1:
            toml.refuse(
                (name,), f"[{name}] {'has both' if given else 'lacks'} {' and '.join(given or group)}; give one"
            )
    datum = toml.string((name,), table, "datum")
    if datum not in DATUMS.get(name, ("",)):
        known = ", ".join(map(repr, DATUMS[name]))
        toml.refuse((name, "datum"), f"datum = {shown(datum)}: must be one of {known}; say what the axes are")
    pins = name != "places" or kind == "housing"
    for key, fits in (("diameter", pins), ("harmonics", pins), ("runout", kind != "disc")):
        if key in table and not fits:
            toml.refuse((name, key), f"{key}: it makes no error of a {kind}; leave it out")
    return Feature(
        name=name,
        columns={key: _column(toml, (name, key), table[key], dimensions[key]) for key in dimensions if key in table},
        datum=datum,
        common=abs(toml.quantity((name, "common"), table.get("common", "0 um"), "length", "0.3 um")),
        zero=toml.quantity((name, "zero"), table.get("zero", "0 deg"), "angle", "0 deg"),
        sense=toml.checked((name,), table, "sense", is_sign, "1, or -1 where teeth count clockwise", 1),
        harmonics=_whole(toml, name, table, "harmonics", _HARMONICS.get(name, 0)),
        lobe_harmonics=_whole(toml, name, table, "lobe_harmonics", _LOBE_HARMONICS),
        place=_whole(toml, name, table, "place", 0) if "place" in table else None,
    )


def _whole(toml: TomlText, name: str, table: Mapping[str, Any], key: str, default: int) -> int:
    must = f"a whole number, 0 to {_MOST_HARMONICS}"
    found: int = toml.checked((name,), table, key, lambda n: is_whole(n) and 0 <= n <= _MOST_HARMONICS, must, default)
    return found
