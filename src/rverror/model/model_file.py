"""Model files, TOML: reading with the line of every mistake, writing so that they read back equal."""

from __future__ import annotations

import dataclasses
import math
import re
from collections.abc import Mapping
from typing import Any, TypeVar, cast

from rverror.base import units
from rverror.base.errors import InputError
from rverror.base.quantities import COUNT, Checked, NumberField, quantities
from rverror.base.text import PathLike, check_path, read_text, write_file
from rverror.base.toml import EXAMPLES, KeyPath, TomlText, is_number, is_text, is_whole, quoted, read_toml
from rverror.geartrain.mechanism import Drive, Mechanism, Reducer, preset_parameters, presets, reducer
from rverror.geartrain.source import Source
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model, check_model, effect
from rverror.model.ends import Bench, Encoders

C = TypeVar("C", bound=Checked)

#: Tables within that of a reducer: its fields that have fields of their own, each with its class.
_TABLES: Mapping[str, type[Checked]] = {
    item.name: type(item.default_factory())
    for item in dataclasses.fields(Reducer)
    if item.default_factory is not dataclasses.MISSING
}
_SIZES = quantities(Reducer)
_PERCENT = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*%")


def load_model(path: PathLike) -> Model:
    """Read a model file.

    Parameters
    ----------
    path : str or path-like

    Returns
    -------
    Model

    Raises
    ------
    InputError
        If the file cannot be used; one line that names file, line, key and remedy.

    Examples
    --------
    >>> from importlib.resources import files
    >>> load_model(str(files("rverror") / "data" / "demo" / "model.toml")).name
    'RV-40E example, as declared'
    """
    return _model(str(path), read_text(path))


def save_model(path: PathLike, model: Model, *, overwrite: bool = False) -> None:
    """Write a model file that reads back equal, in one step or not at all.

    Parameters
    ----------
    path : str or path-like
    model : Model
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    InputError
        If the file exists, cannot be written, or the model cannot be held by a file.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from rverror.geartrain.mechanism import reducer
    >>> unit = Model(reducer("RV-40E"), name="unit 17")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_model(Path(folder, "unit.toml"), unit)
    ...     load_model(Path(folder, "unit.toml")) == unit
    True
    """
    check_path(path)
    check_model(model)
    sections = [f"name = {quoted(model.name)}"] if model.name else []
    mechanism = model.mechanism
    sections.append(_drive_text(mechanism) if isinstance(mechanism, Drive) else _reducer_text(mechanism))
    if hanging := model.bench.given():
        sections.append("\n".join(["[bench]", *_lines(hanging, Bench)]))
    if reading := model.encoders.given():
        sections.append("\n".join(["[bench.encoders]", *_lines(reading, Encoders)]))
    sections += [_effect_text(item) for item in model.effects]
    text = "\n\n".join(sections) + "\n"
    if _model(str(path), text) != model:
        raise InputError(f"{path}: the model would not read back equal; make it with reducer() or Drive, and effect()")
    write_file(path, text, overwrite=overwrite)


# --- reading ----------------------------------------------------------------------------------------------------------


def _model(path: str, text: str) -> Model:
    if not text.strip():
        raise InputError(f"{path}: the file is empty; write '[reducer]' and 'preset = \"RV-40E\"'")
    where = read_toml(path, text)
    content = where.content
    where.check_keys((), content, ("name", "reducer", "drive", "bench", "effect"), "top-level key")
    name = where.string((), content, "name")
    kinds = [kind for kind in ("reducer", "drive") if kind in content]
    if len(kinds) != 1:
        problem = "both [reducer] and [drive]" if kinds else "neither [reducer] nor [drive]"
        where.refuse(("drive",) if kinds else (), f"the model has {problem}; it takes exactly one of them")
    mechanism: Mechanism = _reducer(where) if kinds == ["reducer"] else _drive(where)
    effects = tuple(_effect(where, place, table, mechanism) for place, table in where.tables("effect"))
    ends = _made(where, ("bench",), Bench, tables=("encoders",))
    encoders = _made(where, ("bench", "encoders"), Encoders)
    hanging = [key for key in where.table("bench") if key != "encoders"]
    if isinstance(mechanism, Drive) and hanging:
        where.refuse(
            ("bench", hanging[0]),
            "[bench] is for the dynamics of a [reducer]; take it out of a model with [drive], all but [bench.encoders]",
        )
    with where.refusing(()):
        return Model(mechanism, effects, name, ends, encoders)


def _reducer(where: TomlText) -> Reducer:
    place, table = ("reducer",), where.table("reducer")
    known = ("preset", "name", "output", *_SIZES, *_TABLES)
    where.check_keys(place, table, known, "key of [reducer]")
    preset, own = None, {}
    if "preset" in table:
        preset = where.string(place, table, "preset")
        with where.refusing((*place, "preset")):
            own = preset_parameters(preset)
    values: dict[str, Any] = {}
    for key in table:
        if key in _SIZES:
            values[key] = _size(where, place, table, key, _SIZES[key])
        elif key in _TABLES:
            # what the table leaves out is the preset's own, not that of any unit
            values[key] = _made(where, (*place, key), _TABLES[key], own.get(key, _TABLES[key]()))
        elif key != "preset":
            values[key] = where.string(place, table, key)
    with where.refusing(lambda said: _first_word(place, said)):
        return reducer(preset, **values)


def _made(
    where: TomlText, place: tuple[str, ...], kind: type[C], base: C | None = None, *, tables: tuple[str, ...] = ()
) -> C:
    """What a table of quantities describes; what it leaves out is that of a base, and tables within it are others'."""
    table, known = where.table(*place), quantities(kind)
    where.check_keys(place, table, (*known, *tables), f"key of [{'.'.join(place)}]")
    given = {key: _size(where, place, table, key, known[key]) for key in table if key in known}
    with where.refusing(lambda said: _first_word(place, said)):
        return kind(**given) if base is None else dataclasses.replace(base, **given)


def _size(where: TomlText, place: KeyPath, table: Mapping[str, Any], key: str, what: NumberField) -> float:
    """Value of a quantity: a text with a unit, a whole number, or a bare number or percentage."""
    if what.dimension not in (COUNT, "number"):
        return where.quantity((*place, key), table[key], what.dimension, what.example)
    fits, wanted = (is_whole, "a whole number") if what.dimension == COUNT else (is_number, "a bare number")
    if "%" in what.example:
        wanted = "a number or a percentage"
        if is_text(table[key]) and (match := _PERCENT.fullmatch(table[key].strip())):
            return float(match[1]) / 100
    return cast(float, where.checked(place, table, key, fits, f"{wanted}; write it like {key} = {what.example}"))


def _first_word(place: KeyPath, message: str) -> KeyPath:
    """Place of the key that a message of the geometry check begins with."""
    return (*place, *re.split(r"[ :]", message, maxsplit=1)[:1])


def _drive(where: TomlText) -> Drive:
    place, table = ("drive",), where.table("drive")
    where.check_keys(place, table, ("ratio", "name", "shafts"), "key of [drive]")
    if "ratio" not in table:
        where.refuse(place, "[drive] lacks ratio; write the input turns per output turn, like ratio = -14.0")
    shafts = where.table("drive", "shafts")
    named = {"name": where.string(place, table, "name")} if "name" in table else {}

    def blamed(said: str) -> KeyPath:
        return next(((*place, "shafts", name) for name in shafts if said.startswith(f"{name} = ")), (*place, "ratio"))

    with where.refusing(blamed):
        return Drive(ratio=table["ratio"], shafts=shafts, **named)


def source_of(where: TomlText, place: KeyPath, table: Mapping[str, Any]) -> Source:
    """Error source that a table of an array names by its key.

    Raises
    ------
    InputError
        If there is no key, or none of the catalogue.
    """
    if "key" not in table:
        example = 'key = "crank.eccentricity", or another key of the catalogue'
        where.refuse(place, f"[[{place[0]}]] lacks key; write {example}")
    key = where.string(place, table, "key")
    with where.refusing((*place, "key")):
        return source(key)


def _effect(where: TomlText, place: KeyPath, table: Mapping[str, Any], mechanism: Mechanism) -> Effect:
    entry = source_of(where, place, table)
    key = entry.key
    sizes = {item.name: item.dimension for item in entry.parameters} | {"uncertainty": entry.parameters[0].dimension}
    indices = [item.name for item in entry.indices]
    where.check_keys(place, table, ("key", *indices, *sizes, "origin"), f"key of {key}")
    for name in table:
        if name in sizes:
            example = EXAMPLES[sizes[name]]
            example = f"0.3 {example.split()[1]}" if name == "uncertainty" else example
            where.quantity((*place, name), table[name], sizes[name], example)
    where.string(place, table, "origin")
    named = {name: item for name, item in table.items() if name != "key"}

    def blamed(said: str) -> KeyPath:
        return (*place, next((n for n in (*indices, "uncertainty") if re.search(rf"\b{n}\b( = |:)", said)), "key"))

    with where.refusing(blamed):
        entry.check_indices(mechanism, {name: named[name] for name in indices if name in named})
        return effect(key, **named)


# --- writing ----------------------------------------------------------------------------------------------------------


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else quoted(name)


def _written(value: float, dimension: str, unit: str | None = None) -> str:
    """Text with a unit that reads back as the same float, as short as that allows."""
    core = units.CORE_UNITS[dimension]
    if not math.isfinite(value):
        raise InputError(f"the value {value!r} cannot be written to a file; give a finite number")
    for name in (unit or units.DISPLAY_UNITS[dimension], core):
        factor = units.unit_factor(name, dimension)
        for digits in range(4, 18):
            text = f"{value / factor:.{digits}g} {name}"
            if units.parse(text, dimension) == value:
                return quoted(text)
    raise InputError(f"the value {value!r} {core} cannot be written so that it reads back equal; round it")


def _reducer_text(unit: Reducer) -> str:
    values = {f.name: getattr(unit, f.name) for f in dataclasses.fields(Reducer)}
    if unit.name in presets():
        base = reducer(unit.name)
        changed = {name: value for name, value in values.items() if value != getattr(base, name)}
        if None not in changed.values() and reducer(unit.name, **changed) == unit:
            return _reducer_table({"preset": unit.name, **changed})
    return _reducer_table({name: value for name, value in values.items() if value is not None})


def _reducer_table(values: Mapping[str, Any]) -> str:
    sizes = {key: value for key, value in values.items() if key in _SIZES}
    words = [f"{key} = {quoted(values[key])}" for key in ("preset", "name", "output") if key in values]
    usual = ('name = "custom"', 'output = "carrier"')
    lines = ["[reducer]", *(line for line in words if line not in usual), *_lines(sizes, Reducer)]
    for key, kind in _TABLES.items():
        own = values.get(key, kind())
        # stiffnesses are written in full: who changes one wants to see the others
        values_given = dataclasses.asdict(own) if key == "stiffness" and key in values else own.given()
        if values_given:
            lines += ["", f"[reducer.{key}]", *_lines(values_given, kind)]
    return "\n".join(lines)


def _lines(values: Mapping[str, float], kind: type[Checked]) -> list[str]:
    """Lines of a table of quantities."""
    lines, known = [], quantities(kind)
    for name, value in values.items():
        what = known[name]
        bare = what.dimension in (COUNT, "number")
        text = repr(value) if bare else _written(value, what.dimension, what.example.split()[1])
        lines.append(f"{name} = {text}")
    return lines


def _drive_text(drive: Drive) -> str:
    lines = ["[drive]", f"ratio = {float(drive.ratio)!r}"]
    if drive.name != "drive":
        lines.append(f"name = {quoted(drive.name)}")
    if drive.shafts:
        lines += ["", "[drive.shafts]", *(f"{_key(k)} = {float(v)!r}" for k, v in drive.shafts.items())]
    return "\n".join(lines)


def _effect_text(item: Effect) -> str:
    entry = source(item.key)
    lines = ["[[effect]]", f"key = {quoted(item.key)}"]
    for index in entry.indices:
        value = item.indices[index.name]
        lines.append(f"{index.name} = {value if isinstance(value, int) else quoted(value)}")
    pairs = zip(entry.parameters, item.values, strict=True)
    lines += [f"{parameter.name} = {_written(value, parameter.dimension)}" for parameter, value in pairs]
    if item.uncertainty is not None:
        lines.append(f"uncertainty = {_written(item.uncertainty, entry.parameters[0].dimension)}")
    if item.origin:
        lines.append(f"origin = {quoted(item.origin)}")
    return "\n".join(lines)
