"""Reducers, drives, effects, models, influences, runs and order tables: what is told of each."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from rverror.base.arrays import Array
from rverror.base.numbers import brief, count_of, way, with_unit
from rverror.base.quantities import COUNT as COUNT_OF, NumberField, quantities
from rverror.base.text import describe
from rverror.base.units import ARCSEC
from rverror.geartrain.mechanism import OUTPUTS, Drive, Reducer
from rverror.geartrain.source import Parameter
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.model.results import Influence
from rverror.runs.measurement import Run
from rverror.runs.order_table import OrderTable
from rverror.views.describing import described
from rverror.views.fields import COUNT, OWN, Field, arrays, rows
from rverror.views.shown_units import ANGLE, NUMBER, POSITION, SIZE, SPEED, TEMPERATURE, TIME, TORQUE, Unit, unit_of
from rverror.views.variables import Each, Table, Variable

_GEOMETRY = {"length": SIZE, "angle": POSITION}


# --- pieces -----------------------------------------------------------------------------------------------------------


def influence_unit(dimension: str) -> Unit:
    """Unit of the output error per unit of a parameter."""
    unit = unit_of(dimension)
    core, display = (f"({text})" if "/" in text or "*" in text else text for text in (unit.core, unit.shown))
    return Unit(f"rad/{core}", f"arcsec/{display}", ARCSEC / unit.size)


def ways(direction: Array) -> str:
    """Word for the directions of all samples."""
    found = {way(one) for one in direction.tolist()}
    return found.pop() if len(found) == 1 else "mixed"


def name_of(model: Model) -> str:
    """Name of a model, or of what it is."""
    return model.name or model.mechanism.name


# --- reducers and drives ----------------------------------------------------------------------------------------------

#: What a reducer has some numbers of for its kinds of contact or part; those of which nothing is said are not told.
_BY_PART = ("contact_law", "bearing_preload", "friction", "inertia")


@described.register
def _reducer_table(result: Reducer) -> Table:
    held = {item.name: getattr(result, item.name) for item in dataclasses.fields(result)}
    numbers = {name: value for name, value in held.items() if isinstance(value, int | float)}
    told = [("", result, numbers), ("stiffness.", result.stiffness, dataclasses.asdict(result.stiffness))]
    told += [(f"{part}.", held[part], held[part].given()) for part in _BY_PART]
    values = [
        (f"{prefix}{name}", value, _unit_of_part(quantities(of).get(name)))
        for prefix, of, given in told
        for name, value in given.items()
    ]
    return _of_values(result, values)


def _unit_of_part(quantity: NumberField | None) -> Unit:
    if quantity is None or quantity.dimension in (COUNT_OF, "number"):
        return NUMBER
    return _GEOMETRY.get(quantity.dimension) or unit_of(quantity.dimension)


@described.register
def _drive_table(result: Drive) -> Table:
    shafts = ((f"shafts.{name}", turns, NUMBER) for name, turns in result.shafts.items())
    return _of_values(result, [("ratio", result.ratio, NUMBER), *shafts])


def _of_values(result: Reducer | Drive, values: Sequence[tuple[str, float, Unit]]) -> Table:
    variables = rows("parameter", values, "", ("unit", "2"), parameter="0", value=("1", OWN))
    about = {"name": result.name, "ratio": result.ratio}
    return Table(variables, about, title=(result.name, _ratio(result)))


def _ratio(unit: Reducer | Drive) -> str:
    turned = f", {unit.output} as output" if isinstance(unit, Reducer) and unit.output != OUTPUTS[0] else ""
    return f"R = {unit.ratio:.8g}{turned}"


# --- models -----------------------------------------------------------------------------------------------------------


@described.register
def _effect_table(result: Effect) -> Table:
    named = describe(result.key, result.indices)
    return Table(_of_effects([result]), title=(named, result.origin))


def effects_table(result: Sequence[Effect]) -> Table:
    """Effects in a row."""
    return Table(_of_effects(result), kind="Effects")


@described.register
def _model_table(result: Model) -> Table:
    ends = {}
    for end in (result.bench, result.encoders):
        for name, value in end.given().items():
            dimension = quantities(end)[name].dimension
            shown = brief(value) if dimension == "number" else with_unit(value, dimension)
            ends[f"bench: {name.replace('_', ' ')}"] = shown
    unit = result.mechanism
    return Table(
        _of_effects(result.effects),
        {"model": name_of(result), "mechanism": unit.name},
        title=(result.name, f"{unit.name}, {_ratio(unit)}", count_of(len(result.effects), "effect")),
        facts=ends,
    )


def sizes_of(effects: Sequence[Effect]) -> list[tuple[int, Effect, Parameter, float]]:
    """Every parameter of every effect: number of the effect, effect, parameter, size."""
    return [
        (at, effect, parameter, value)
        for at, effect in enumerate(effects)
        for parameter, value in zip(source(effect.key).parameters, effect.values, strict=True)
    ]


def _of_effects(effects: Sequence[Effect]) -> dict[str, Variable]:
    """Every parameter of every effect, as variables."""
    return rows(
        "parameter",
        sizes_of(effects),
        "",
        ("unit", "2.dimension"),
        number=("0", COUNT),
        key="1.key",
        indices="1.indices",
        parameter="2.name",
        value=("3", OWN),
        uncertainty=("1.uncertainty", OWN),
        origin="1.origin",
    )


@described.register
def _influence_table(result: Influence) -> Table:
    own = Each("influence_unit", tuple(influence_unit(one.dimension) for one in source(result.key).parameters))
    variables = {
        **arrays("theta", result, theta=POSITION),
        **arrays("parameter", result, parameter="labels"),
        **arrays("parameter theta", result, influence=("matrix", own)),
        **arrays(
            "parameter",
            result,
            peak_to_peak=(lambda one: np.ptp(one.matrix, axis=1), own),
            mean=(lambda one: one.matrix.mean(axis=1), own),
        ),
    }
    return Table(variables, {"key": result.key}, title=(result.key, count_of(result.matrix.shape[1], "angle")))


# --- runs -------------------------------------------------------------------------------------------------------------


@described.register
def _run_table(result: Run) -> Table:
    variables = arrays(
        "sample",
        result,
        time=TIME,
        input_angle=POSITION,
        output_angle=POSITION,
        te=("te_column", ANGLE),
        output_torque=("load_column", TORQUE),
        torque_record=TORQUE,
        direction=NUMBER,
    )
    variables |= arrays("", result, torque=TORQUE, temperature=TEMPERATURE)
    about = {"path": result.path, "direction": ways(result.direction), **_of_file(result)}
    title = (result.path, count_of(result.size, "sample"))
    facts = {"direction": ways(result.direction), **_facts_of_file(result)}
    return Table(variables, about, title=title, facts=facts)


def _of_file(result: Run | OrderTable) -> dict[str, Any]:
    """What a file says of the whole."""
    return {"index": result.index, "metadata": dict(result.metadata), "notes": "\n".join(result.notes)}


def _facts_of_file(result: Run | OrderTable) -> dict[str, str]:
    """What the label of the zero says, and the metadata."""
    known = {"": "aligned, offset of its own", "unknown": "not known"}
    zero = known.get(result.index, f"shared, {result.index}")
    return {"zero": zero, **{f"# {key}": value for key, value in result.metadata.items()}}


#: Unit of each condition of an order table that is a number.
_CONDITIONS = {"direction": NUMBER, "input_speed": SPEED, "temperature": TEMPERATURE, "torque": TORQUE}


@described.register
def _orders_table(result: OrderTable) -> Table:
    each = [(at, case.condition, case, row) for at, case in enumerate(result.cases) for row in range(case.orders.size)]
    waves = np.concatenate([np.zeros(0, complex), *(case.waves for case in result.cases)])
    fields: dict[str, Field] = {
        name: (f"1.{name}", unit)
        for name, unit in _CONDITIONS.items()
        if any(getattr(condition, name) is not None for _, condition, *_ in each)
    }
    variables = {
        **rows("wave", each, case=("0", COUNT), **fields, order=(lambda row: row[2].orders[row[3]], NUMBER)),
        **arrays(
            "wave",
            waves,
            amplitude=(np.abs, ANGLE),
            phase=(np.angle, POSITION),
            cos=("real", ANGLE),
            sin=(lambda all_of: -all_of.imag, ANGLE),
        ),
    }
    if any(case.sigma is not None for case in result.cases):
        sigma = lambda row: None if row[2].sigma is None else row[2].sigma[row[3]]  # noqa: E731
        variables |= rows("wave", each, sigma=(sigma, ANGLE))
    return Table(
        variables,
        {"path": result.path, **_of_file(result)},
        title=(result.path, count_of(len(result.cases), "condition")),
        facts=_facts_of_file(result),
    )
