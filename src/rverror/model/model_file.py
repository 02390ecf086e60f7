"""Model files, TOML: reading with the line of every mistake, writing so that they read back equal."""

from __future__ import annotations

import dataclasses
import functools
import math
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from rverror.base import units
from rverror.base.errors import InputError
from rverror.base.text import PathLike, check_path, did_you_mean, read_text, shown, split_lines, write_text
from rverror.base.toml import EXAMPLES, Place, TomlText, quoted, read_toml
from rverror.geartrain.mechanism import (
    FRICTION_DIMENSIONS,
    INERTIA_DIMENSIONS,
    BearingPreload,
    ContactLaw,
    Drive,
    Friction,
    Inertia,
    Mechanism,
    Reducer,
    Stiffness,
    StiffnessUncertainty,
    preset_parameters,
    presets,
    reducer,
)
from rverror.geartrain.source import Parameter
from rverror.model.catalogue import CATALOGUE, source
from rverror.model.effects import Effect, Model, check_model, effect
from rverror.model.ends import BENCH_DIMENSIONS, ENCODER_DIMENSIONS, Bench, Encoders

# Dimension of each quantity of [reducer], and how people write it; then an example of each count.
QUANTITIES = {
    "module": ("length", "1.5 mm"),
    "pressure_angle": ("angle", "20 deg"),
    "pin_circle_radius": ("length", "64 mm"),
    "pin_radius": ("length", "3 mm"),
    "eccentricity": ("length", "1.25 mm"),
    "gear_backlash": ("length", "20 um"),
    "rated_torque": ("torque", "412 N*m"),
    "spline_radius": ("length", "7 mm"),
    "crank_circle_radius": ("length", "27 mm"),
}
COUNTS = {"sun_teeth": 9, "planet_teeth": 27, "disc_lobes": 39, "pins": 40, "cranks": 2, "discs": 2}
_REQUIRED = tuple(f.name for f in dataclasses.fields(Reducer) if f.default is f.default_factory is dataclasses.MISSING)
_MOMENT = "0.002 kg*m^2"
_TORSION = "500 N*m/rad"
#: Tables below [reducer], and dimension of each of their values and how people write it.
_TABLES: Mapping[str, tuple[type[Any], Mapping[str, tuple[str, str]]]] = {
    "stiffness": (Stiffness, {f.name: ("stiffness", "200000 N/mm") for f in dataclasses.fields(Stiffness)}),
    "stiffness_uncertainty": (
        StiffnessUncertainty,
        {f.name: ("number", "'25 %'") for f in dataclasses.fields(StiffnessUncertainty)},
    ),
    "contact_law": (ContactLaw, {f.name: ("number", "1.11") for f in dataclasses.fields(ContactLaw)}),
    "bearing_preload": (BearingPreload, {f.name: ("length", "2 um") for f in dataclasses.fields(BearingPreload)}),
    "friction": (
        Friction,
        {
            name: (kind, {"number": "0.05", "length": "10 mm", "torque": "4 N*m"}[kind])
            for name, kind in FRICTION_DIMENSIONS.items()
        },
    ),
    "inertia": (
        Inertia,
        {name: (kind, "0.8 kg" if kind == "mass" else _MOMENT) for name, kind in INERTIA_DIMENSIONS.items()},
    ),
}
_BENCH = {
    name: (kind, {"inertia": _MOMENT, "torsional_stiffness": _TORSION, "number": "'3 %'", "time": "0.02 ms"}[kind])
    for name, kind in BENCH_DIMENSIONS.items()
}
_ENCODERS = {
    name: (kind, {"angle": "1.24 arcsec", "length": "0.1 mm", "number": "8388608"}[kind])
    for name, kind in ENCODER_DIMENSIONS.items()
}
_KEYS_OF_REDUCER = ("preset", "name", "output", *COUNTS, *QUANTITIES, *_TABLES)
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


def save_model(
    path: PathLike, model: Model, *, source: str | None = None, header: Iterable[str] = (), overwrite: bool = False
) -> None:
    """Write a model file that reads back equal, in one step or not at all.

    Parameters
    ----------
    path : str or path-like
    model : Model
    source : str, optional
        Where the model comes from; a comment.
    header : iterable of str
        More comment lines, put first.
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
    comments = [*header, *([] if source is None else [f"source: {source}"])]
    head = [f"# {_clean(line)}".rstrip() for text in comments for line in split_lines(text)]
    head += [f"name = {quoted(model.name)}"] if model.name else []
    sections = ["\n".join(head)] if head else []
    mechanism = model.mechanism
    sections.append(_drive_text(mechanism) if isinstance(mechanism, Drive) else _reducer_text(mechanism))
    if hanging := model.bench.given():
        sections.append("\n".join(_table_lines("bench", hanging, _BENCH)))
    if reading := model.encoders.given():
        sections.append("\n".join(_table_lines("bench.encoders", reading, _ENCODERS)))
    sections += [_effect_text(item) for item in model.effects]
    text = "\n\n".join(sections) + "\n"
    _check_equal(str(path), _model(str(path), text), model)
    write_text(path, text, overwrite=overwrite)


def append_effects(
    source_path: PathLike, target_path: PathLike, effects: Sequence[Effect], *, overwrite: bool = False
) -> None:
    """Copy a model file, comments and all, and append effects to it.

    Parameters
    ----------
    source_path, target_path : str or path-like
        The same file only with `overwrite`.
    effects : sequence of Effect
    overwrite : bool
        Whether an existing target may be replaced.

    Raises
    ------
    InputError
        If the source is no model file, an effect does not fit it, or the target exists or cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from rverror.model.effects import effect
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     old, new = Path(folder, "unit.toml"), Path(folder, "with-cause.toml")
    ...     size = old.write_text('[reducer]\\npreset = "RV-40E"  # as ordered\\n')
    ...     append_effects(old, new, [effect("crank.index", crank=0, angle="2 mrad")])
    ...     "# as ordered" in new.read_text(), load_model(new).effects[0].key
    (True, 'crank.index')
    """
    text = read_text(source_path)
    before = _model(str(source_path), text)
    try:
        wanted = before.with_effects(*effects)
    except ValueError as error:
        raise InputError(f"{source_path}: the effect cannot be added: {error}") from error
    added = "\n".join(f"\n{_effect_text(item)}" for item in effects) + "\n" if effects else ""
    newline = "\r\n" if "\r\n" in text else "\n"
    if added and not text.endswith("\n"):
        text += newline
    text += added.replace("\n", newline)
    try:
        after = _model(str(target_path), text)
    except InputError as error:
        raise InputError(
            f"{source_path}: no [[effect]] table can be appended; write its effects as [[effect]] tables too ({error})"
        ) from error
    _check_equal(str(target_path), after, wanted)
    write_text(target_path, text, overwrite=overwrite)


def _check_equal(path: str, got: Model, wanted: Model) -> None:
    """Nothing is written that would read back as another model."""
    if got != wanted:
        raise InputError(f"{path}: the model would not read back equal; make it with reducer() or Drive, and effect()")


# --- reading ----------------------------------------------------------------------------------------------------------


def _model(path: str, text: str) -> Model:
    if not text.strip():
        raise InputError(f"{path}: the file is empty; write '[reducer]' and 'preset = \"RV-40E\"'")
    where = read_toml(path, text)
    content = where.content
    where.check_keys((), content, ("name", "reducer", "drive", "bench", "effect"), "top-level key")
    name = where.string((), content, "name", "")
    kinds = [kind for kind in ("reducer", "drive") if kind in content]
    if len(kinds) != 1:
        problem = "both [reducer] and [drive]" if kinds else "neither [reducer] nor [drive]"
        where.refuse(("drive",) if kinds else (), f"the model has {problem}; it takes exactly one of them")
    table = _table(where, (kinds[0],), content[kinds[0]])
    mechanism: Mechanism = _reducer(where, table) if kinds == ["reducer"] else _drive(where, table)
    listed = content.get("effect", [])
    if not isinstance(listed, list):
        where.refuse(("effect",), "effect is a single table; write '[[effect]]', with two brackets, above each effect")
    effects = tuple(_effect(where, ("effect", i), item, mechanism) for i, item in enumerate(listed))
    hanging = dict(_table(where, ("bench",), content.get("bench", {})))
    where.check_keys(("bench",), hanging, [*_BENCH, "encoders"], "key of [bench]")
    read_with = hanging.pop("encoders", {})
    encoders = _made(where, ("bench", "encoders"), read_with, Encoders, _ENCODERS)
    if isinstance(mechanism, Drive) and hanging:
        where.refuse(
            ("bench", next(iter(hanging))),
            "[bench] is for the dynamics of a [reducer]; take it out of a model with [drive], all but [bench.encoders]",
        )
    ends = _made(where, ("bench",), hanging, Bench, _BENCH)
    try:
        return Model(mechanism, effects, name, ends, encoders)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from error


def _table(where: TomlText, place: Place, value: object) -> dict[str, Any]:
    if not isinstance(value, dict):
        where.refuse(place, f"{place[-1]} = {shown(value)} is no table; write '[{'.'.join(map(str, place))}]'")
    return value


def _reducer(where: TomlText, table: dict[str, Any]) -> Reducer:
    place = ("reducer",)
    where.check_keys(place, table, _KEYS_OF_REDUCER, "key of [reducer]")
    preset, own = None, {}
    if "preset" in table:
        preset = where.string(place, table, "preset", "")
        if preset not in presets():
            hint = did_you_mean(preset, {name.lower(): name for name in presets()})
            for name in presets():
                hint = hint.replace(name.lower(), name)
            where.refuse((*place, "preset"), f"no preset {shown(preset)};{hint} the presets are {', '.join(presets())}")
        own = preset_parameters(preset)
    values: dict[str, Any] = {}
    for key, value in table.items():
        if key in QUANTITIES:
            values[key] = where.quantity((*place, key), value, *QUANTITIES[key])
        elif key in COUNTS:
            if isinstance(value, bool) or not isinstance(value, int):
                where.refuse(
                    (*place, key),
                    f"{key} = {shown(value)}: must be a whole number; write it bare, like {key} = {COUNTS[key]}",
                )
            values[key] = value
    values |= {key: where.string(place, table, key, "") for key in ("name", "output") if key in table}
    for key, (kind, keys) in _TABLES.items():
        if key in table:
            # what the table leaves out is the preset's own, not that of any unit
            base = own.get(key, kind())
            values[key] = _made(where, (*place, key), table[key], functools.partial(dataclasses.replace, base), keys)
    if preset is None:
        missing = [key for key in _REQUIRED if key not in values]
        if missing:
            where.refuse(
                place,
                f"[reducer] lacks {', '.join(missing)}; give {'them' if len(missing) > 1 else 'it'} or a preset, "
                f"one of {', '.join(presets())}",
            )
    try:
        return Reducer(**values) if preset is None else reducer(preset, **values)
    except ValueError as error:
        where.refuse(_first_word(where, place, str(error)), str(error))


def _made(where: TomlText, place: Place, value: object, kind: Any, keys: Mapping[str, tuple[str, str]]) -> Any:
    """What a table of quantities and numbers describes."""
    table = _table(where, place, value)
    where.check_keys(place, table, list(keys), f"key of [{'.'.join(map(str, place))}]")
    given = {}
    for key, item in table.items():
        dimension, example = keys[key]
        read = _number if dimension == "number" else functools.partial(_sized, dimension=dimension)
        given[key] = read(where, (*place, key), item, example=example)
    try:
        return kind(**given)
    except ValueError as error:
        at = _first_word(where, place, str(error))
        dimension, example = keys.get(str(at[-1]), ("", ""))
        where.refuse(at, f"{error}; write it like {example}" if dimension == "number" else str(error))


def _sized(where: TomlText, place: Place, value: object, *, dimension: str, example: str) -> float:
    return where.quantity(place, value, dimension, example)


def _number(where: TomlText, place: Place, value: object, *, example: str) -> float:
    """A bare number, or a percentage where the example is one."""
    percent = "%" in example
    if isinstance(value, str) and percent and (match := _PERCENT.fullmatch(value.strip())):
        return float(match[1]) / 100
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        kind = "a number or a percentage" if percent else "a bare number"
        where.refuse(place, f"{place[-1]} = {shown(value)}: must be {kind}; write it like {example}")
    return float(value)


def _first_word(where: TomlText, place: Place, message: str) -> Place:
    """Place of the key that a message of the geometry check begins with."""
    return (*place, *re.split(r"[ :]", message, maxsplit=1)[:1])


def _drive(where: TomlText, table: dict[str, Any]) -> Drive:
    place = ("drive",)
    where.check_keys(place, table, ("ratio", "name", "shafts"), "key of [drive]")
    if "ratio" not in table:
        where.refuse(place, "[drive] lacks ratio; write the input turns per output turn, like ratio = -14.0")
    shafts = _table(where, (*place, "shafts"), table.get("shafts", {}))
    ratio = _turns(where, (*place, "ratio"), table["ratio"])
    turns = {key: _turns(where, (*place, "shafts", key), value) for key, value in shafts.items()}
    named = {"name": where.string(place, table, "name", "")} if "name" in table else {}
    return Drive(ratio=ratio, shafts=turns, **named)


def _turns(where: TomlText, place: Place, value: object) -> float:
    key = place[-1]
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        where.refuse(place, f"{key} = {shown(value)}: must be a bare number of turns; write {key} = 14.0")
    if not 0 < abs(value) <= sys.float_info.max:  # false for nan; a whole number may be larger than any float
        where.refuse(
            place,
            f"{key} = {shown(value)}: must be a finite number other than 0, in turns per output turn; "
            f"write {key} = 14.0",
        )
    return float(value)


def _effect(where: TomlText, place: Place, value: object, mechanism: Mechanism) -> Effect:
    if not isinstance(value, dict):
        where.refuse(place, f"effect holds {shown(value)}, which is no table; write each effect below '[[effect]]'")
    table: dict[str, Any] = value
    if "key" not in table:
        where.refuse(place, '[[effect]] lacks key; write key = "crank.eccentricity", or another key of the catalogue')
    key = where.string(place, table, "key", "")
    if key not in CATALOGUE:
        hint = did_you_mean(key, list(CATALOGUE))
        where.refuse((*place, "key"), f"no error source {shown(key)};{hint or ' `rverror sources` lists them'}")
    entry = source(key)
    parameters = {item.name: item for item in entry.parameters}
    indices = [item.name for item in entry.indices]
    where.check_keys(place, table, ("key", *indices, *parameters, "uncertainty", "origin"), f"key of {key}")
    named: dict[str, Any] = {}
    for name, item in table.items():
        at = (*place, name)
        if name in parameters or name == "uncertainty":
            dimension = parameters.get(name, entry.parameters[0]).dimension
            where.quantity(at, item, dimension, _example(name, dimension))
            named[name] = item
        elif name in indices:
            if isinstance(item, bool) or not isinstance(item, (int, str)):
                where.refuse(at, f"{key}: {name} = {shown(item)}: must be a whole number or a name, without unit")
            named[name] = item
    named["origin"] = where.string(place, table, "origin", "")
    if not parameters.keys() & table.keys():
        first = entry.parameters[0]
        where.refuse(
            place,
            f"{key} has no size; give {' or '.join(parameters)}, like "
            f'{first.name} = "{_example(first.name, first.dimension)}"',
        )
    try:
        entry.check_indices(mechanism, {name: named[name] for name in indices if name in named})
        return effect(key, **named)
    except ValueError as error:
        blamed = next((n for n in (*indices, "uncertainty") if re.search(rf"\b{n}\b( = |:)", str(error))), "key")
        where.refuse((*place, blamed), str(error))


def _example(name: str, dimension: str) -> str:
    example = EXAMPLES[dimension]
    return f"0.3 {example.split()[1]}" if name == "uncertainty" else example


# --- writing ----------------------------------------------------------------------------------------------------------


def _clean(comment: str) -> str:
    """TOML comments hold no control characters."""
    return "".join(c if (ord(c) >= 32 and ord(c) != 127) or c == "\t" else " " for c in comment)


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
            near = abs(float(text.split()[0]) * factor - value) <= 1e-15 * abs(value)
            if near and units.parse(text, dimension) == value:
                return quoted(text)
    raise InputError(f"the value {value!r} {core} cannot be written so that it reads back equal; round it")


def _reducer_text(unit: Reducer) -> str:
    values = {f.name: getattr(unit, f.name) for f in dataclasses.fields(Reducer)}
    if unit.name in presets():
        base = reducer(unit.name)
        changed = {name: value for name, value in values.items() if value != getattr(base, name)}
        changed.pop("crank_circle_radius", None)  # follows from the module and the teeth
        if None not in changed.values() and reducer(unit.name, **changed) == unit:
            return _reducer_table({"preset": unit.name, **changed})
    return _reducer_table({name: value for name, value in values.items() if value is not None})


def _reducer_table(values: Mapping[str, Any]) -> str:
    lines = ["[reducer]"]
    for key, value in values.items():
        if key in QUANTITIES:
            dimension, example = QUANTITIES[key]
            lines.append(f"{key} = {_written(value, dimension, example.split()[1])}")
        elif key in COUNTS:
            lines.append(f"{key} = {value}")
        elif key not in _TABLES and (key, value) not in {("name", "custom"), ("output", "carrier")}:
            lines.append(f"{key} = {quoted(value)}")
    for key, (kind, keys) in _TABLES.items():
        own, usual = values.get(key, kind()), kind()
        # stiffnesses are written in full: who changes one wants to see the others
        told = [name for name in keys if getattr(own, name) != getattr(usual, name)]
        told = list(keys) if key == "stiffness" and key in values else told
        if told:
            lines += ["", *_table_lines(f"reducer.{key}", {name: getattr(own, name) for name in told}, keys)]
    return "\n".join(lines)


def _table_lines(head: str, values: Mapping[str, float], keys: Mapping[str, tuple[str, str]]) -> list[str]:
    texts = {
        name: repr(value) if keys[name][0] == "number" else _written(value, keys[name][0], keys[name][1].split()[1])
        for name, value in values.items()
    }
    return [f"[{head}]", *(f"{name} = {text}" for name, text in texts.items())]


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
    pairs: Iterable[tuple[Parameter, float]] = zip(entry.parameters, item.values, strict=True)
    lines += [f"{parameter.name} = {_written(value, parameter.dimension)}" for parameter, value in pairs]
    if item.uncertainty is not None:
        lines.append(f"uncertainty = {_written(item.uncertainty, entry.parameters[0].dimension)}")
    if item.origin:
        lines.append(f"origin = {quoted(item.origin)}")
    return "\n".join(lines)
