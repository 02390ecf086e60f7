"""Mapping files of measured parts, TOML: which column is which component of which error, or which reading."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from rverror.base import units
from rverror.base.text import PathLike, did_you_mean, read_text, shown
from rverror.base.toml import Place, TomlText, read_toml
from rverror.geartrain.source import IndexValue
from rverror.model.catalogue import CATALOGUE
from rverror.parts.measured import KINDS
from rverror.runs.bench.mapping import ColumnRule, TextRules, Where, column_table, scaled_rule, text_rules

_TOP = ("name", "kind", "serial", "file", "error")
_COLUMN = ("name", "column", "unit", "sign", "scale", "nominal", "uncertainty")
#: Nominal value that the file states with the column.
OF_FILE = "file"
_DATUMS = {"places": ("fit", "axis", "given"), "circles": ("fit", "axis", "given"), "lobes": ("fit", "bores")}
#: Columns of each feature with their dimension, then the kinds of parts that have it, and the keys beside its columns.
FEATURES: dict[str, tuple[dict[str, str], tuple[str, ...], tuple[str, ...]]] = {
    "places": (
        {"number": "", "x": "length", "y": "length", "diameter": "length"},
        ("housing", "disc", "carrier", "crank"),
        ("datum", "common", "harmonics"),
    ),
    "circles": (
        {"number": "", "angle": "angle", "radius": "length"},
        ("crank", "disc", "carrier"),
        ("datum", "common"),
    ),
    "lobes": (
        {"angle": "angle", "radius": "length", "deviation": "length"},
        ("disc",),
        ("datum", "common", "harmonics", "lobe_harmonics", "place"),
    ),
    "teeth": (
        {"number": "", "pitch": "length", "cumulative": "length", "runout": "length"},
        ("sun", "planet", "disc"),
        ("zero", "common", "harmonics", "sense"),
    ),
}
#: Columns that a feature needs: of each group one.
_NEEDED = {
    "places": (("number",), ("x",), ("y",)),
    "circles": (("number",), ("angle",), ("radius",)),
    "lobes": (("angle",), ("radius", "deviation")),
    "teeth": (("number",), ("pitch", "cumulative")),
}
_HARMONICS, _LOBE_HARMONICS, _MOST_HARMONICS = 6, 3, 60


@dataclass(frozen=True, kw_only=True)
class PartColumn:
    """What makes a size of one of the file's columns: scale x (reading - nominal).

    Attributes
    ----------
    rule : ColumnRule
        Place, unit and sign.
    scale : float
        Above 0.
    nominal : float, optional
        Reading of a part without error, core unit; None where the file states it.
    sigma : float, optional
        Stated uncertainty of a reading, 1 sigma, core unit.
    """

    rule: ColumnRule
    scale: float = 1.0
    nominal: float | None = 0.0
    sigma: float | None = None


@dataclass(frozen=True, kw_only=True)
class ErrorColumns:
    """An error of which each row has the components."""

    key: str
    indices: Mapping[str, IndexValue]
    columns: Mapping[str, PartColumn]


@dataclass(frozen=True, kw_only=True)
class Feature:
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
        Which disc it is made for.
    """

    name: str
    columns: Mapping[str, PartColumn]
    datum: str = ""
    common: float = 0.0
    harmonics: int = 0
    lobe_harmonics: int = 0
    zero: float = 0.0
    sense: int = 1
    place: int | None = None


@dataclass(frozen=True, kw_only=True)
class PartsMapping:
    """Content of a mapping file; `serial` is None where the name of the file is the serial number."""

    path: str
    kind: str
    serial: Where | None
    text: TextRules
    errors: tuple[ErrorColumns, ...] = ()
    feature: Feature | None = None

    def groups(self) -> list[dict[str, tuple[PartColumn, str]]]:
        """Columns with their dimensions, of each error or of the feature."""
        found = []
        for error in self.errors:
            dimensions = {parameter.name: parameter.dimension for parameter in CATALOGUE[error.key].parameters}
            found.append({name: (column, dimensions[name]) for name, column in error.columns.items()})
        if self.feature:
            dimensions = FEATURES[self.feature.name][0]
            found.append({name: (column, dimensions[name]) for name, column in self.feature.columns.items()})
        return found


def load_parts_mapping(path: PathLike) -> PartsMapping:
    """Read a mapping file.

    Raises
    ------
    InputError
        If the file cannot be used; one line that names file, line, key and remedy.
    """
    toml = read_toml(str(path), read_text(path))
    content = toml.content
    toml.check_keys((), content, (*_TOP, *FEATURES), "key of a mapping of parts")
    kind = toml.string((), content, "kind", "")
    if kind not in KINDS:
        hint = did_you_mean(kind, KINDS)
        toml.refuse(("kind",), f"kind = {shown(kind)}: must be one of {', '.join(KINDS)};{hint} correct it")
    file = content.get("file", {})
    if not isinstance(file, dict):
        toml.refuse(("file",), "file is no table; write '[file]' and keys below it")
    toml.check_keys(("file",), file, ("encoding", "separator", "decimal", "thousands", "skip"), "key of [file]")
    features = [name for name in FEATURES if name in content]
    if len(features) + ("error" in content) != 1:
        known = ", ".join(f"[{name}]" for name in FEATURES)
        toml.refuse((features[-1],) if features else (), "a mapping has [[error]] tables, for a row for each part, or "
                    f"one of {known}, for a row for each reading; give one kind of them")  # fmt: skip
    errors = content.get("error", [])
    if not isinstance(errors, list):
        toml.refuse(("error",), "error is a single table; write '[[error]]', with two brackets, above each error")
    return PartsMapping(
        path=str(path),
        kind=kind,
        serial=_serial(toml, content["serial"]) if "serial" in content else None,
        text=text_rules(toml, file),
        errors=tuple(_error(toml, ("error", i), item, kind) for i, item in enumerate(errors)),
        feature=_feature(toml, features[0], content[features[0]], kind) if features else None,
    )


def _serial(toml: TomlText, value: object) -> Where:
    table = column_table(toml, ("serial",), value, 'name = "..."')
    toml.check_keys(("serial",), table, ("name", "column"), "key of serial")
    return scaled_rule(toml, ("serial",), table, 'name = "..."', "").where


def _error(toml: TomlText, place: Place, value: object, kind: str) -> ErrorColumns:
    table = value if isinstance(value, dict) else {}
    key = toml.string(place, table, "key", "")
    frame, counted = KINDS[kind]
    fitting = [
        entry.key
        for entry in CATALOGUE.values()
        if entry.frame == frame and (counted is None or counted in {index.name for index in entry.indices})
    ]
    if key not in fitting:
        hint = did_you_mean(key, fitting)
        toml.refuse((*place, "key"), f"key = {shown(key)}: no error of a {kind};{hint} it has {', '.join(fitting)}")
    names = [index.name for index in CATALOGUE[key].indices if index.name != counted]
    parameters = {parameter.name: parameter.dimension for parameter in CATALOGUE[key].parameters}
    toml.check_keys(place, table, ("key", *names, *parameters), f"key of {key}")
    indices: dict[str, IndexValue] = {}
    for name in names:
        number = table.get(name)
        if isinstance(number, bool) or not isinstance(number, int | str):
            toml.refuse((*place, name), f"{key}: {name} = {shown(number)}: must be a whole number or a name; give it")
        indices[name] = number
    columns = {
        name: _column(toml, (*place, name), table[name], parameters[name]) for name in parameters if name in table
    }
    if not columns:
        toml.refuse(place, f'{key} has no column; give {" or ".join(parameters)} = {{ name = "...", unit = "um" }}')
    return ErrorColumns(key=key, indices=MappingProxyType(indices), columns=columns)


def _column(toml: TomlText, place: Place, value: object, dimension: str) -> PartColumn:
    unit = f', unit = "{units.DISPLAY_UNITS[dimension]}"' if dimension else ""
    example = f'name = "..."{unit}'
    table = dict(column_table(toml, place, value, example))
    toml.check_keys(place, table, _COLUMN if dimension else ("name", "column"), f"key of {place[-1]}")
    scale, nominal, sigma = table.pop("scale", 1), table.pop("nominal", None), table.pop("uncertainty", None)
    if isinstance(scale, bool) or not isinstance(scale, int | float) or not 0 < scale < 1e6:
        toml.refuse((*place, "scale"), f"scale = {shown(scale)}: must be a number above 0; write 0.5 for a diameter")
    if nominal is not None and nominal != OF_FILE:
        nominal = toml.quantity((*place, "nominal"), nominal, dimension, f"6 {'deg' if dimension == 'angle' else 'mm'}")
    if sigma is not None:
        sigma = toml.quantity((*place, "uncertainty"), sigma, dimension, f"0.5 {units.DISPLAY_UNITS[dimension]}")
    return PartColumn(
        rule=scaled_rule(toml, place, table, example, dimension),
        scale=float(scale),
        nominal=None if nominal == OF_FILE else nominal or 0.0,
        sigma=sigma,
    )


def _feature(toml: TomlText, name: str, value: object, kind: str) -> Feature:
    dimensions, kinds, more = FEATURES[name]
    place: Place = (name,)
    if not isinstance(value, dict):
        toml.refuse(place, f"{name} is no table; write '[{name}]' and keys below it")
    if kind not in kinds:
        toml.refuse(place, f"[{name}] are of a {' or '.join(kinds)}, not of a {kind}; correct kind")
    toml.check_keys(place, value, (*dimensions, *more), f"key of [{name}]")
    for group in _NEEDED[name]:
        given = [column for column in group if column in value]
        if len(given) != 1:
            toml.refuse(place, f"[{name}] {'lacks' if not given else 'has both'} {' and '.join(given or group)}; "
                        f"give {'it' if len(group) == 1 else 'one of them'}")  # fmt: skip
    datum = toml.string(place, value, "datum", "")
    if name in _DATUMS and datum not in _DATUMS[name]:
        known = ", ".join(map(repr, _DATUMS[name]))
        toml.refuse((name, "datum"), f"datum = {shown(datum)}: must be one of {known}; say what the axes are")
    common = toml.quantity((name, "common"), value["common"], "length", "0.3 um") if "common" in value else 0.0
    zero = toml.quantity((name, "zero"), value["zero"], "angle", "0 deg") if "zero" in value else 0.0
    default = _HARMONICS if name in ("lobes", "teeth") else 0
    if value.get("sense", 1) not in (1, -1):
        toml.refuse((name, "sense"), f"sense = {shown(value['sense'])}: must be 1, or -1 where teeth count clockwise")
    if "diameter" in value and kind != "housing":
        toml.refuse((name, "diameter"), f"diameter: no error of a {kind} is told by it; leave it out")
    return Feature(
        name=name,
        columns={
            each: _column(toml, (name, each), value[each], dimensions[each]) for each in dimensions if each in value
        },
        datum=datum,
        common=abs(common),
        harmonics=_whole(toml, name, value, "harmonics", default),
        lobe_harmonics=_whole(toml, name, value, "lobe_harmonics", _LOBE_HARMONICS),
        zero=zero,
        sense=value.get("sense", 1),
        place=_whole(toml, name, value, "place", 0) if "place" in value else None,
    )


def _whole(toml: TomlText, name: str, table: Mapping[str, Any], key: str, default: int) -> int:
    value = table.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= _MOST_HARMONICS:
        toml.refuse((name, key), f"{key} = {shown(value)}: must be a whole number, 0 to {_MOST_HARMONICS}")
    return value
