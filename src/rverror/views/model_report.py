"""Reducers, drives, effects, models, influences, runs and order tables: what is told of each."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import brief, count_of, way, with_unit
from rverror.base.quantities import COUNT as COUNT_OF, quantities
from rverror.base.text import describe
from rverror.base.units import ARCSEC
from rverror.geartrain.mechanism import (
    OUTPUTS,
    ContactLaw,
    Drive,
    Reducer,
)
from rverror.model.catalogue import source
from rverror.model.compose import transmission_error_by_effect
from rverror.model.effects import Effect, Model
from rverror.model.results import Influence
from rverror.runs.measurement import Run
from rverror.runs.order_table import OrderTable
from rverror.views.blocks import Sheet, columns_of, facts, grid, line, notes, title
from rverror.views.describing import described, own_columns, sheet, shown, table
from rverror.views.fields import COUNT, OWN, Field, arrays, bare, rows
from rverror.views.variables import (
    ANGLE,
    NUMBER,
    POSITION,
    SIZE,
    SPEED,
    STIFFNESS,
    TEMPERATURE,
    TIME,
    TORQUE,
    Each,
    Table,
    Unit,
    Variable,
    columns,
    unit_of,
)

_GEOMETRY = {"length": SIZE, "angle": POSITION, "torque": TORQUE, "stiffness": STIFFNESS}


# --- pieces -----------------------------------------------------------------------------------------------------------


def influence_units(dimensions: Iterable[str]) -> Each:
    """Units of the output error per unit of parameters."""

    def per(unit: Unit) -> Unit:
        core, display = (f"({text})" if "/" in text or "*" in text else text for text in (unit.core, unit.shown))
        return Unit(f"rad/{core}", f"arcsec/{display}", ARCSEC / unit.size)

    return Each("influence_unit", tuple(per(unit_of(dimension)) for dimension in dimensions))


def inside(indices: Mapping[str, Any]) -> str:
    """Indices of a place as a column holds them."""
    return ", ".join(f"{name} {value}" for name, value in indices.items())


def ways(direction: Array) -> str:
    """Word for the directions of all samples."""
    found = {way(one) for one in direction.tolist()}
    return found.pop() if len(found) == 1 else "mixed"


def name_of(model: Model) -> str:
    """Name of a model, or of what it is."""
    return model.name or model.mechanism.name


def angles(theta: Any | None, count: int, *, dim: str = "theta") -> dict[str, Variable]:
    """Nominal output angles of a result that does not hold them itself, as its variable."""
    if theta is None:
        return {}
    try:
        row = units.to_core_array(theta, "angle")
    except ValueError as error:
        raise InputError(f"theta: {error}") from error
    if row.shape != (count,):
        raise InputError(f"theta has the shape {row.shape}; give the {count} angles that the result was made for")
    return arrays(dim, row, theta=("", POSITION))


def load(torque: Any | None) -> dict[str, Variable]:
    """Torque of a result that does not hold it itself, as its variable."""
    try:
        return arrays("", None if torque is None else units.to_core(torque, "torque"), torque=("", TORQUE))
    except ValueError as error:
        raise InputError(f"torque: {error}") from error


# --- reducers and drives ----------------------------------------------------------------------------------------------

#: What a reducer has one number of for each kind of contact or part: the unit of each, and what is not told.
_BY_PART = ("stiffness", "contact_law", "bearing_preload", "friction", "inertia")


@table.register
def _reducer_table(result: Reducer) -> Table:
    def unit(part: str, name: str) -> Unit:
        own = quantities(getattr(result, part) if part else result).get(name)
        if own is None or own.dimension in (COUNT_OF, "number"):
            return NUMBER
        return _GEOMETRY.get(own.dimension) or unit_of(own.dimension)

    given = [
        ("", item.name, value)
        for item in dataclasses.fields(result)
        if isinstance(value := getattr(result, item.name), int | float)
    ]
    usual = {"contact_law": dataclasses.asdict(ContactLaw()), "stiffness": {}, "inertia": {}}
    for part in _BY_PART:
        for name, value in dataclasses.asdict(getattr(result, part)).items():
            if value is not None and value != usual.get(part, {name: 0.0}).get(name):
                given.append((f"{part}.", name, value))
    values = [(f"{part}{name}", value, unit(part[:-1], name)) for part, name, value in given]
    return _of_values(result, values, output=result.output)


@table.register
def _drive_table(result: Drive) -> Table:
    shafts = ((f"shafts.{name}", turns, NUMBER) for name, turns in result.shafts.items())
    return _of_values(result, [("ratio", result.ratio, NUMBER), *shafts])


def _of_values(result: Reducer | Drive, values: Sequence[tuple[str, float, Unit]], **about: str) -> Table:
    own = Each("unit", tuple(unit for *_, unit in values))
    variables = rows("parameter", values, parameter="0", value=("1", own))
    return Table(type(result).__name__, "parameter", variables, {"name": result.name, "ratio": result.ratio, **about})


@sheet.register
def _reducer_sheet(thing: Reducer) -> Sheet:
    return title("Reducer", thing.name, _ratio(thing)) + own_columns(thing, "parameter", "value", "unit")


@sheet.register
def _drive_sheet(thing: Drive) -> Sheet:
    return title("Drive", thing.name, _ratio(thing)) + grid(("shaft", "turns per output turn"), thing.shafts.items())


def _ratio(unit: Reducer | Drive) -> str:
    turned = f", {unit.output} as output" if isinstance(unit, Reducer) and unit.output != OUTPUTS[0] else ""
    return f"R = {unit.ratio:.8g}{turned}"


# --- models -----------------------------------------------------------------------------------------------------------


@table.register
def _effect_table(result: Effect) -> Table:
    return Table("Effect", "parameter", _of_effects([result]))


def effects_table(result: Sequence[Effect]) -> Table:
    """Effects in a row."""
    return Table("Effects", "parameter", _of_effects(result))


@table.register
def _model_table(
    result: Model, *, theta: Any = None, direction: Any = None, torque: Any = None, time: Any = None
) -> Table:
    variables = _of_effects(result.effects)
    if theta is not None:
        parts = transmission_error_by_effect(result, theta, direction=direction, torque=torque, time=time)
        variables |= {
            **angles(theta, parts.shape[1]),
            **rows("effect", result.effects, effect=lambda one: describe(one.key, one.indices)),
            **arrays("theta", parts, transmission_error=(lambda all_of: all_of.sum(axis=0), ANGLE)),
            **arrays("effect theta", parts, by_effect=("", ANGLE)),
            **load(torque),
        }
    return Table("Model", "parameter", variables, {"model": name_of(result), "mechanism": result.mechanism.name})


def _of_effects(effects: Sequence[Effect]) -> dict[str, Variable]:
    """Every parameter of every effect, as variables."""
    each = [
        (at, effect, parameter, value)
        for at, effect in enumerate(effects)
        for parameter, value in zip(source(effect.key).parameters, effect.values, strict=True)
    ]
    return rows(
        "parameter",
        each,
        "",
        ("unit", "2.dimension"),
        number=("0", COUNT),
        key="1.key",
        indices=lambda row: inside(row[1].indices),
        parameter="2.name",
        value=("3", OWN),
        uncertainty=("1.uncertainty", OWN),
        origin="1.origin",
    )


@table.register
def _influence_table(result: Influence) -> Table:
    own = influence_units(parameter.dimension for parameter in source(result.key).parameters)
    variables = {
        **arrays("theta", result, theta=POSITION),
        **arrays("parameter", result, parameter=lambda one: list(one.labels)),
        **bare(arrays("parameter theta", result, influence=("matrix", own))),
    }
    return Table("Influence", "theta", variables, {"key": result.key})


@sheet.register
def _effect_sheet(thing: Effect) -> Sheet:
    return title("Effect", describe(thing.key, thing.indices), thing.origin) + _sizes(thing, 1)


@sheet.register
def _model_sheet(thing: Model) -> Sheet:
    ends = {}
    for end in (thing.bench, thing.encoders):
        for name, value in end.given().items():
            dimension = quantities(end)[name].dimension
            told = brief(value) if dimension == "number" else with_unit(value, dimension)
            ends[f"bench: {name.replace('_', ' ')}"] = told
    return (
        *title("Model", thing.name, f"{thing.mechanism.name}, {_ratio(thing.mechanism)}"),
        *(_sizes(thing, 0) if thing.effects else line("no effect is declared")),
        *(facts(ends) if ends else ()),
    )


def _sizes(thing: Model | Effect, first: int) -> Sheet:
    """Parameters of effects, from a column on."""
    found, _ = shown(thing)
    names = [f"{key} ({at})" if at else key for key, at in zip(found["key"], found["indices"], strict=True)]
    sigmas = ["exact" if math.isnan(sigma) else sigma for sigma in found["uncertainty"]]
    listed = zip(names, found["parameter"], found["value"], sigmas, found["unit"], strict=True)
    return grid(("effect", "parameter", "size", "1 sigma", "unit")[first:], (row[first:] for row in listed))


@sheet.register
def _influence_sheet(thing: Influence) -> Sheet:
    matrix = thing.matrix
    listed = zip(thing.labels, np.ptp(matrix, axis=1).tolist(), matrix.mean(axis=1).tolist(), strict=True)
    note = f"rad of output per {units.CORE_UNITS[source(thing.key).parameters[0].dimension]} of each parameter"
    return (
        *title("Influence", f"{thing.key}, {count_of(matrix.shape[1], 'angle')}"),
        *grid(("parameter", "peak-to-peak", "mean"), listed),
        *line(note),
    )


# --- runs -------------------------------------------------------------------------------------------------------------


@table.register
def _run_table(result: Run, *, ratio: Reducer | Drive | Model | float | None = None) -> Table:
    variables = arrays(
        "sample",
        result,
        time=TIME,
        input_angle=POSITION,
        output_angle=POSITION,
        te=("te_column", ANGLE),
        output_torque=("load_column", TORQUE),
        direction=NUMBER,
    )
    if ratio is not None:
        nominal = result.nominal_angle(ratio), result.error(ratio)
        variables |= arrays("sample", nominal, theta=("0", POSITION), transmission_error=("1", ANGLE))
    if result.extra:
        own = Each("column_unit", tuple(Unit(unit, unit) for unit in map(_bracket, result.extra)))
        variables |= arrays("column", list(result.extra), column="")
        variables |= bare(arrays("column sample", np.array(list(result.extra.values())), extra=("", own)))
    variables |= arrays("", result, torque=TORQUE, temperature=TEMPERATURE)
    about = {"path": result.path, "direction": ways(result.direction), **_of_file(result)}
    return Table("Run", "sample", variables, about, frozenset({"theta", "time"}))


def _of_file(result: Run | OrderTable) -> dict[str, Any]:
    """What a file says of the whole."""
    return {"index": result.index, "metadata": dict(result.metadata), "notes": "\n".join(result.notes)}


def _bracket(name: str) -> str:
    """Unit that a column's name ends with."""
    return name[name.rindex("[") + 1 : -1] if name.endswith("]") and "[" in name else ""


#: Dimension and unit of each condition of an order table that is a number.
_CONDITIONS = {
    "input_speed": ("angular_speed", SPEED),
    "temperature": ("temperature", TEMPERATURE),
    "torque": ("torque", TORQUE),
}


@table.register
def _orders_table(result: OrderTable) -> Table:
    each = [(at, case.condition, case, row) for at, case in enumerate(result.cases) for row in range(case.orders.size)]
    waves = np.concatenate([np.zeros(0, complex), *(case.waves for case in result.cases)])
    known = {"direction": NUMBER, **{name: unit for name, (_, unit) in _CONDITIONS.items()}}
    told: dict[str, Field] = {
        name: (f"1.{name}", unit)
        for name, unit in known.items()
        if any(getattr(condition, name) is not None for _, condition, *_ in each)
    }
    spread = any(case.sigma is not None for case in result.cases)
    variables = {
        **rows("wave", each, case=("0", COUNT), **told, order=(lambda row: row[2].orders[row[3]], NUMBER)),
        **arrays(
            "wave",
            waves,
            amplitude=(np.abs, ANGLE),
            phase=(np.angle, POSITION),
            cos=("real", ANGLE),
            sin=(lambda all_of: -all_of.imag, ANGLE),
        ),
    }
    if spread:
        variables |= rows(
            "wave", each, sigma=(lambda row: None if row[2].sigma is None else row[2].sigma[row[3]], ANGLE)
        )
    return Table("OrderTable", "wave", variables, {"path": result.path, **_of_file(result)})


@sheet.register
def _run_sheet(thing: Run) -> Sheet:
    made = described(thing)
    turned = {"input angle": thing.input_angle, "output angle": thing.output_angle}
    ends = [] if thing.torque is None else [thing.torque]
    if thing.load_column is not None:
        ends = [float(thing.load_column.min()), float(thing.load_column.max())]
    stated = {
        "samples": str(thing.size),
        "direction": str(made.about["direction"]),
        **{
            name: f"{np.degrees(row.min()):.6g} to {np.degrees(row.max()):.6g} deg"
            for name, row in turned.items()
            if row is not None
        },
        "output torque": " to ".join(with_unit(end, "torque") for end in ends),
        "temperature": "" if thing.temperature is None else with_unit(thing.temperature, "temperature"),
        "zero": _zero(thing.index),
        "columns": ", ".join(columns(made)[0]),
        **{f"# {key}": value for key, value in thing.metadata.items()},
    }
    return title("Run", thing.path) + facts(stated) + notes(thing.notes)


def _zero(index: str) -> str:
    """What the label of a zero says."""
    return {"": "aligned, offset of its own", "unknown": "not known"}.get(index, f"shared, {index}")


@sheet.register
def _orders_sheet(thing: OrderTable) -> Sheet:
    found, told = shown(thing)
    senses = dict.fromkeys(way(case.condition.direction) for case in thing.cases)
    stated = {"conditions": str(len(thing.cases)), "direction": " and ".join(senses)}
    listed: dict[str, list[Any]] = {}
    if len(senses) > 1:
        listed["direction"] = [way(sense) for sense in found["direction"]]
    for name in ("torque", "input_speed", "temperature"):
        dimension, heading = _CONDITIONS[name][0], name.replace("_", " ")
        each = [getattr(case.condition, name) for case in thing.cases for _ in case.orders]
        values = [math.nan if value is None else units.to_display(value, dimension) for value in each]
        unit, known = units.DISPLAY_UNITS[dimension], sorted(value for value in values if not math.isnan(value))
        if known:
            low, high = brief(known[0]), brief(known[-1])
            stated[heading] = f"{low} {unit}" if low == high else f"{low} to {high} {unit}"
            if low != high or len(known) < len(values):  # what is the same in all rows is said above
                listed[f"{heading}, {unit}"] = values
    for name in ("order", "amplitude", "phase", "sigma"):
        if name in found:
            listed[f"{name}, {told[name]}" if told[name] else name] = found[name]
    stated |= {
        "orders": ", ".join(brief(order) for order in sorted(set(found["order"]))),
        "zero": _zero(thing.index),
        **{f"# {key}": value for key, value in thing.metadata.items()},
    }
    return title("Order table", thing.path) + facts(stated) + columns_of(listed) + notes(thing.notes)
