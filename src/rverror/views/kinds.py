"""Every kind of result described once, as variables along named dimensions.

From here a result's tables, its JSON where it has none of its own, and the numbers of its notebook page are made.
"""

from __future__ import annotations

import dataclasses
import inspect
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import singledispatch
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import way
from rverror.base.text import describe
from rverror.base.units import ARCSEC
from rverror.compensation.outcome import Compensation
from rverror.diagnosis.result import Diagnosis
from rverror.dynamics.at_speed import SpeedResponse
from rverror.dynamics.natural_modes import Modes
from rverror.dynamics.running_up import RunUp
from rverror.geartrain.mechanism import DIMENSIONS, FRICTION_DIMENSIONS, INERTIA_DIMENSIONS, ContactLaw, Drive, Reducer
from rverror.life.result import Changed, RunsCompared, Trend
from rverror.lots.of_drives import DriveLot
from rverror.lots.result import Lot, Shift
from rverror.matching.result import Matched, MountedPart
from rverror.model.catalogue import source
from rverror.model.compose import transmission_error_by_effect
from rverror.model.effects import Effect, Model
from rverror.model.results import Equilibrium, Influence
from rverror.runs.measurement import Run
from rverror.runs.order_table import OrderTable
from rverror.statics.duty import DutyEfficiency, DutyPhase
from rverror.statics.friction import Efficiency, Hysteresis
from rverror.statics.hertz import CONTACT_INDICES, ContactPressure
from rverror.statics.rigidity import TorsionCurve
from rverror.statics.worn_contacts import Wear
from rverror.tolerances.allocation import Allocation, FrontPoint
from rverror.tolerances.closed_form import Budget
from rverror.tolerances.declared import Tolerance
from rverror.tolerances.full_budget import ErrorBudget
from rverror.tolerances.loaded_yield import Verified
from rverror.tolerances.sampling import VirtualUnits
from rverror.tolerances.stacking import Stack
from rverror.views.lot_words import process_name, shift_name
from rverror.views.variables import (
    ANGLE,
    FORCE,
    LENGTH,
    NUMBER,
    PER_ARCSEC,
    PERCENT,
    POSITION,
    SIZE,
    SPEED,
    SQUARE,
    STIFFNESS,
    TEMPERATURE,
    TIME,
    TORQUE,
    Each,
    Table,
    Unit,
    Variable,
    unit_of,
)
from rverror.views.yield_report import LEVELS

#: Of a torsional stiffness, as makers print it.
STIFFENED = Unit("N*mm/rad", "N*m/arcmin", 1e3 / (60 * ARCSEC))

_SIGNAL = {"angle": ANGLE, "torque": TORQUE}
_GEOMETRY = {"length": SIZE, "angle": POSITION, "torque": TORQUE}
_CONTACTS = {
    "pin": ("disc", "pin", "xy"),
    "cam": ("disc", "crank", "xy"),
    "carrier": ("crank", "xy"),
    "mesh": ("crank", "flank", "xy"),
}


def described(result: Any, /, **options: Any) -> Table:
    """Description of a result, from which every kind of table is made.

    Parameters
    ----------
    result, **options
        As for `to_xarray`.

    Returns
    -------
    Table

    Raises
    ------
    InputError
        If no table is made of such a result, or an option is not one of its.
    """
    known = list(inspect.signature(_table.dispatch(type(result))).parameters)[1:]
    for name in options:
        if name not in known:
            takes = f"it takes {', '.join(known)}" if known else "it takes none"
            raise InputError(f"{type(result).__name__}: no option {name!r}; {takes}")
    return _table(result, **options)


# --- pieces -----------------------------------------------------------------------------------------------------------


def _along(dim: str, prefix: str = "", /, **columns: Any) -> dict[str, Variable]:
    """Variables along one dimension; each is values, or numbers with their unit, of which None is not determined."""
    made = {}
    for name, given in columns.items():
        values, unit = given if isinstance(given, tuple) else (given, None)
        if unit is not None and not isinstance(values, np.ndarray):
            values = np.array(list(values), dtype=np.float64)
        made[f"{prefix}{name}"] = Variable((dim,), values, unit)
    return made


def _fields(things: Iterable[Any], unit: Unit | Each, *names: str) -> dict[str, Any]:
    """Attributes of things that stand in a row, for `_along`."""
    listed = list(things)
    return {name: ([getattr(thing, name) for thing in listed], unit) for name in names}


def _single(**values: tuple[Any, Unit]) -> dict[str, Variable]:
    """Variables of one value; those that are None are left out."""
    return {name: Variable((), value, unit) for name, (value, unit) in values.items() if value is not None}


def _each(name: str, dimensions: Iterable[str]) -> Each:
    return Each(name, tuple(map(unit_of, dimensions)))


def _influences(dimensions: Iterable[str]) -> Each:
    """Units of the output error per unit of parameters."""

    def per(unit: Unit) -> Unit:
        core, shown = (f"({text})" if "/" in text or "*" in text else text for text in (unit.core, unit.shown))
        return Unit(f"rad/{core}", f"arcsec/{shown}", ARCSEC / unit.size)

    return Each("influence_unit", tuple(per(unit_of(dimension)) for dimension in dimensions))


def _integers(values: Iterable[int]) -> tuple[Any, Unit]:
    return np.array(list(values), dtype=int), NUMBER


def _inside(indices: Mapping[str, Any]) -> str:
    return ", ".join(f"{name} {value}" for name, value in indices.items())


def _ways(direction: Array) -> str:
    """Word for the directions of all samples."""
    found = {way(one) for one in direction.tolist()}
    return found.pop() if len(found) == 1 else "mixed"


def _name(model: Model) -> str:
    return model.name or model.mechanism.name


def _angles(theta: Any | None, count: int, *, dim: str = "theta") -> dict[str, Variable]:
    """Nominal output angles of a result that does not hold them itself."""
    if theta is None:
        return {}
    try:
        row = units.to_core_array(theta, "angle")
    except ValueError as error:
        raise InputError(f"theta: {error}") from error
    if row.shape != (count,):
        raise InputError(f"theta has the shape {row.shape}; give the {count} angles that the result was made for")
    return {"theta": Variable((dim,), row, POSITION)}


def _load(torque: Any | None) -> dict[str, Variable]:
    try:
        return _single(torque=(None if torque is None else units.to_core(torque, "torque"), TORQUE))
    except ValueError as error:
        raise InputError(f"torque: {error}") from error


# --- one entry a kind -------------------------------------------------------------------------------------------------


@singledispatch
def _table(result: Any) -> Table:
    """Description of a result."""
    kinds = sorted(kind.__name__ for kind in _table.registry if kind is not object)
    raise InputError(f"{type(result).__name__}: no table is made of it; give one of {', '.join(kinds)}")


@_table.register
def _of_run(result: Run, *, ratio: Reducer | Drive | Model | float | None = None) -> Table:
    given = {
        "time": (result.time, TIME),
        "input_angle": (result.input_angle, POSITION),
        "output_angle": (result.output_angle, POSITION),
        "te": (result.te_column, ANGLE),
        "output_torque": (result.load_column, TORQUE),
        "direction": (result.direction, NUMBER),
    }
    if ratio is not None:
        given |= {"theta": (result.nominal_angle(ratio), POSITION), "transmission_error": (result.error(ratio), ANGLE)}
    variables = _along("sample", **{name: pair for name, pair in given.items() if pair[0] is not None})
    if result.extra:
        tags = tuple(Unit(unit, unit) for unit in map(_bracket, result.extra))
        variables |= _along("column", column=list(result.extra))
        extra = np.array(list(result.extra.values()))
        variables["extra"] = Variable(("column", "sample"), extra, Each("column_unit", tags), bare=True)
    variables |= _single(torque=(result.torque, TORQUE), temperature=(result.temperature, TEMPERATURE))
    about = {
        "path": result.path,
        "direction": _ways(result.direction),
        "index": result.index,
        "metadata": dict(result.metadata),
        "notes": "\n".join(result.notes),
    }
    return Table("Run", "sample", variables, about, frozenset({"theta", "time"}))


@_table.register
def _of_orders(result: OrderTable) -> Table:
    each = [(at, case.condition, row) for at, case in enumerate(result.cases) for row in range(case.orders.size)]
    waves = np.concatenate([np.zeros(0, complex), *(case.waves for case in result.cases)])
    sigma = [math.nan if (of := result.cases[at].sigma) is None else float(of[row]) for at, _, row in each]
    variables = _along("wave", case=_integers(at for at, *_ in each))
    conditions = [condition for _, condition, _ in each]
    known = {"direction": NUMBER, "input_speed": SPEED, "temperature": TEMPERATURE, "torque": TORQUE}
    for name, unit in known.items():
        if any(getattr(condition, name) is not None for condition in conditions):
            variables |= _along("wave", **_fields(conditions, unit, name))
    variables |= _along(
        "wave",
        order=([float(result.cases[at].orders[row]) for at, _, row in each], NUMBER),
        amplitude=(np.abs(waves), ANGLE),
        phase=(np.angle(waves), POSITION),
        cos=(waves.real, ANGLE),
        sin=(-waves.imag, ANGLE),
    )
    if not np.isnan(sigma).all():
        variables |= _along("wave", sigma=(sigma, ANGLE))
    about = {
        "path": result.path,
        "index": result.index,
        "metadata": dict(result.metadata),
        "notes": "\n".join(result.notes),
    }
    return Table("OrderTable", "wave", variables, about)


def _bracket(name: str) -> str:
    """Unit that a column's name ends with."""
    return name[name.rindex("[") + 1 : -1] if name.endswith("]") and "[" in name else ""


#: What a reducer has one number of for each kind of contact or part.
_BY_PART = ("stiffness", "stiffness_uncertainty", "contact_law", "bearing_preload", "friction", "inertia")


@_table.register
def _of_reducer(result: Reducer) -> Table:
    rows: list[tuple[str, float, Unit]] = []
    for item in dataclasses.fields(result):
        value = getattr(result, item.name)
        if item.name in ("name", "output", *_BY_PART) or value is None:
            continue
        rows.append((item.name, value, _GEOMETRY[DIMENSIONS[item.name]] if item.name in DIMENSIONS else NUMBER))
    springs, law = dataclasses.asdict(result.stiffness), dataclasses.asdict(result.contact_law)
    usual = dataclasses.asdict(ContactLaw())
    rows += [(f"stiffness.{name}", value, STIFFNESS) for name, value in springs.items()]
    rows += [(f"contact_law.{name}", value, NUMBER) for name, value in law.items() if value != usual[name]]
    pressed = dataclasses.asdict(result.bearing_preload)
    rows += [(f"bearing_preload.{name}", value, _GEOMETRY["length"]) for name, value in pressed.items() if value]
    rubs = {name: value for name, value in dataclasses.asdict(result.friction).items() if value}
    rows += [
        (f"friction.{name}", value, _GEOMETRY.get(FRICTION_DIMENSIONS[name], NUMBER)) for name, value in rubs.items()
    ]
    weights = {name: value for name, value in dataclasses.asdict(result.inertia).items() if value is not None}
    rows += [(f"inertia.{name}", value, unit_of(INERTIA_DIMENSIONS[name])) for name, value in weights.items()]
    table = _of_values(result, rows)
    return dataclasses.replace(table, about={**table.about, "output": result.output})


@_table.register
def _of_drive(result: Drive) -> Table:
    shafts = ((f"shafts.{name}", turns, NUMBER) for name, turns in result.shafts.items())
    return _of_values(result, [("ratio", result.ratio, NUMBER), *shafts])


def _of_values(result: Reducer | Drive, rows: Sequence[tuple[str, float, Unit]]) -> Table:
    names, values, own = zip(*rows, strict=True)
    variables = _along("parameter", parameter=list(names), value=(list(values), Each("unit", own)))
    return Table(type(result).__name__, "parameter", variables, {"name": result.name, "ratio": result.ratio})


@_table.register
def _of_effect(result: Effect) -> Table:
    return Table("Effect", "parameter", _sizes([result]))


@_table.register
def _of_model(
    result: Model, *, theta: Any = None, direction: Any = None, torque: Any = None, time: Any = None
) -> Table:
    variables = _sizes(result.effects)
    if theta is not None:
        parts = transmission_error_by_effect(result, theta, direction=direction, torque=torque, time=time)
        variables |= _angles(theta, parts.shape[1])
        variables |= _along("effect", effect=[describe(e.key, e.indices) for e in result.effects])
        variables["transmission_error"] = Variable(("theta",), parts.sum(axis=0), ANGLE)
        variables["by_effect"] = Variable(("effect", "theta"), parts, ANGLE)
        variables |= _load(torque)
    return Table("Model", "parameter", variables, {"model": _name(result), "mechanism": result.mechanism.name})


def _sizes(effects: Sequence[Effect]) -> dict[str, Variable]:
    """Every parameter of every effect."""
    rows = [
        (at, effect, parameter, value)
        for at, effect in enumerate(effects)
        for parameter, value in zip(source(effect.key).parameters, effect.values, strict=True)
    ]
    own = _each("unit", (parameter.dimension for *_, parameter, _ in rows))
    return _along(
        "parameter",
        number=_integers(at for at, *_ in rows),
        key=[effect.key for _, effect, *_ in rows],
        indices=[_inside(effect.indices) for _, effect, *_ in rows],
        parameter=[parameter.name for *_, parameter, _ in rows],
        value=([value for *_, value in rows], own),
        uncertainty=([effect.uncertainty for _, effect, *_ in rows], own),
        origin=[effect.origin for _, effect, *_ in rows],
    )


@_table.register
def _of_influence(result: Influence) -> Table:
    own = _influences(parameter.dimension for parameter in source(result.key).parameters)
    variables = {
        "theta": Variable(("theta",), result.theta, POSITION),
        **_along("parameter", parameter=list(result.labels)),
        "influence": Variable(("parameter", "theta"), result.matrix, own, bare=True),
    }
    return Table("Influence", "theta", variables, {"key": result.key})


@_table.register
def _of_equilibrium(result: Equilibrium, *, torque: Any | None = None, model: Model | None = None) -> Table:
    variables = _along(
        "theta",
        theta=(result.theta, POSITION),
        transmission_error=(result.transmission_error, ANGLE),
        steps=(result.steps, NUMBER),
        residual=(result.residual, NUMBER),
    )
    variables["loaded_pins"] = Variable(("disc", "theta"), result.loaded_pins, NUMBER)
    for part, moved in result.pose.items():
        own = ("disc",) if part == "disc" else ("crank",) if part == "crank" else ()
        variables[f"{part}_displacement"] = Variable((*own, "xy", "theta"), moved[..., :2, :], LENGTH)
        if moved.shape[-2] == 3:
            variables[f"{part}_rotation"] = Variable((*own, "theta"), moved[..., 2, :], ANGLE)
    for contact, axes in _CONTACTS.items():
        variables[f"{contact}_force"] = Variable((*axes, "theta"), result.contact_forces[contact], FORCE)
    spline = result.contact_forces["spline"][:, :, 0]
    variables["spline_torque"] = Variable(("crank", "flank", "theta"), spline, TORQUE)
    variables |= _along("xy", xy=["x", "y"]) | _load(torque)
    return Table("Equilibrium", "theta", variables, {} if model is None else {"model": _name(model)})


@_table.register
def _of_torsion(result: TorsionCurve, *, theta: Any | None = None) -> Table:
    variables = {
        **_along("torque", torque=(result.torque, TORQUE)),
        **_angles(theta, result.angle.shape[1], dim="place"),
        "angle": Variable(("torque", "place"), result.angle, ANGLE),
    }
    return Table("TorsionCurve", "torque", variables, {}, frozenset({"theta"}))


@_table.register
def _of_hysteresis(result: Hysteresis, *, theta: Any | None = None) -> Table:
    branches = {"rising": result.rising, "falling": result.falling, "width": result.width}
    variables = {
        **_along("torque", torque=(result.torque, TORQUE)),
        **_angles(theta, result.rising.shape[1], dim="place"),
        **{name: Variable(("torque", "place"), branch, ANGLE) for name, branch in branches.items()},
    }
    return Table("Hysteresis", "torque", variables, {}, frozenset({"theta"}))


@_table.register
def _of_efficiency(result: Efficiency) -> Table:
    shares = result.by_part
    variables = {
        **_along(
            "theta",
            theta=(result.theta, POSITION),
            efficiency=(result.efficiency, PERCENT),
            input_torque=(result.input_torque, TORQUE),
            error_change=(result.error_change, ANGLE),
        ),
        **_along("part", part=list(shares), share=(shares.values(), PERCENT)),
        "loss": Variable(("part", "theta"), np.array(list(result.losses.values())), TORQUE),
        **_single(torque=(result.torque, TORQUE), mean_efficiency=(result.mean, PERCENT)),
    }
    about = {"drives": result.drives, "direction": _ways(result.direction), "self_locking": result.self_locking}
    return Table("Efficiency", "theta", variables, about)


def _of_efficiencies(result: Sequence[Efficiency]) -> Table:
    shares = [one.by_part for one in result]
    variables = {
        **_along(
            "case",
            **_fields(result, TORQUE, "torque"),
            drives=[one.drives for one in result],
            direction=[_ways(one.direction) for one in result],
            efficiency=([one.mean for one in result], PERCENT),
        ),
        **_along("part", part=list(shares[0])),
        "lost": Variable(("case", "part"), np.array([list(one.values()) for one in shares]), PERCENT),
        **_along(
            "case",
            input_torque=([float(one.input_torque.mean()) for one in result], TORQUE),
            error_change=([float(one.error_change.mean()) for one in result], ANGLE),
            self_locking=np.array([one.self_locking for one in result], dtype=bool),
        ),
    }
    return Table("Efficiencies", "case", variables)


_PRESSURE = unit_of("pressure")


@_table.register
def _of_pressure(result: ContactPressure) -> Table:
    peaks = result.peaks()
    variables = _along("theta", theta=(result.theta, POSITION))
    for contact, axes in CONTACT_INDICES.items():
        if contact in result.pressure:
            for name, of, unit in (
                ("pressure", result.pressure, _PRESSURE),
                ("force", result.force, FORCE),
                ("half_width", result.half_width, LENGTH),
            ):
                variables[f"{contact}_{name}"] = Variable((*axes, "theta"), of[contact], unit)
    variables["pin_place"] = Variable(("disc", "pin", "theta"), result.place, POSITION)
    variables |= _along(
        "peak",
        "peak_",
        contact=[peak.contact for peak in peaks],
        indices=[_inside(peak.indices) for peak in peaks],
        **_fields(peaks, _PRESSURE, "pressure"),
        **_fields(peaks, FORCE, "force"),
        **_fields(peaks, POSITION, "theta"),
        **_fields(peaks, PERCENT, "ripple"),
    )
    return Table("ContactPressure", "peak", variables)


_HERTZ = Unit("Hz", "Hz")
_HOURS = Unit("h", "h")
_VOLUME = Unit("mm**3", "mm**3")
#: Units of a shape at a modal mass of 1 kg.
_SHAPE = {"x": NUMBER, "y": NUMBER, "angle": Unit("rad/mm", "arcsec/um", ARCSEC * 1e3)}


@_table.register
def _of_modes(result: Modes) -> Table:
    sheared = [
        (part, motion, row)
        for part, rows in result.shape.items()
        for motion, row in zip(("angle",) if len(rows) == 1 else ("x", "y", "angle"), rows, strict=False)
    ]
    variables = {
        **_along(
            "mode",
            mode=_integers(range(result.frequency.size)),
            frequency=(result.frequency, _HERTZ),
            damping_ratio=(result.damping_ratio, NUMBER),
            of_sun_support=result.of_sun_support,
        ),
        **_along("motion", motion=[f"{part} {motion}" for part, motion, _ in sheared]),
        "shape": Variable(
            ("motion", "mode"),
            np.array([row for *_, row in sheared]),
            Each("shape_unit", tuple(_SHAPE[motion] for _, motion, _ in sheared)),
            bare=True,
        ),
        **_shares("spring", "strain_energy", result.strain_energy, NUMBER),
        **_shares("weight", "kinetic_energy", result.kinetic_energy, NUMBER),
        **_shares("cause", "sensitivity", result.sensitivity, _HERTZ),
        **_single(torque=(result.torque, TORQUE), theta=(result.theta, POSITION)),
    }
    about = {"direction": way(result.direction), "estimated": ", ".join(result.estimated)}
    return Table("Modes", "mode", variables, about)


@_table.register
def _of_speeds(result: SpeedResponse) -> Table:
    critical, waves = result.critical_speeds, result.waves
    parts: dict[str, Variable] = {}
    if result.by_effect is not None:
        names = [*(describe(e.key, e.indices) for e in result.effects), "load"]
        parts = _along("effect", effect=names)
        for name, of, unit in (("amplitude", np.abs, ANGLE), ("phase", np.angle, POSITION)):
            parts[f"{name}_by_effect"] = Variable(("effect", "speed", "order"), of(result.effect_waves), unit)
    variables = {
        **_along(
            "speed",
            speed=(result.speed, SPEED),
            peak_to_peak=(result.peak_to_peak, ANGLE),
            rms=(result.rms, ANGLE),
            **{f"pulled_{name}": (share, NUMBER) for name, share in result.pulled.items()},
        ),
        **_along(
            "order",
            order=(result.order, NUMBER),
            crawl_amplitude=(np.abs(result.crawl_waves), ANGLE),
            crawl_phase=(np.angle(result.crawl_waves), POSITION),
        ),
        "amplitude": Variable(("speed", "order"), np.abs(waves), ANGLE),
        "phase": Variable(("speed", "order"), np.angle(waves), POSITION),
        **parts,
        **_along(
            "critical",
            "critical_",
            **_fields(critical, SPEED, "speed"),
            **_fields(critical, NUMBER, "order"),
            **_fields(critical, ANGLE, "amplitude"),
            **_fields(critical, NUMBER, "growth"),
            **_fields(critical, _HERTZ, "frequency"),
            of_sun_support=np.array([one.of_sun_support for one in critical], dtype=bool),
        ),
        **_along("mode", "natural_", frequency=(result.frequency, _HERTZ), of_sun_support=result.of_sun_support),
        **_along("theta", theta=(result.theta, POSITION), crawl=(result.crawl, ANGLE)),
        "transmission_error": Variable(("speed", "theta"), result.transmission_error, ANGLE),
        **_single(torque=(result.torque, TORQUE)),
    }
    return Table("SpeedResponse", "speed", variables, {"direction": way(result.direction)})


@_table.register
def _of_run_up(result: RunUp) -> Table:
    variables = {
        **_along(
            "sample",
            time=(result.time, TIME),
            theta=(result.theta, POSITION),
            speed=(result.speed, SPEED),
            load=(result.load, TORQUE),
            transmission_error=(result.transmission_error, ANGLE),
            crawl=(result.crawl, ANGLE),
            windup=(result.windup, ANGLE),
            vibration=(result.vibration, ANGLE),
            output_torque=(result.output_torque, TORQUE),
        ),
        **_along("mode", "natural_", frequency=(result.frequency, _HERTZ), of_sun_support=result.of_sun_support),
        **_single(torque=(result.torque, TORQUE)),
    }
    return Table("RunUp", "sample", variables, {"direction": way(result.direction)})


def _of_duty(duty: Sequence[DutyPhase]) -> dict[str, Variable]:
    """Phases of a duty."""
    return _along(
        "duty_phase",
        **_fields(duty, TORQUE, "torque"),
        input_speed=([one.speed for one in duty], SPEED),
        duty_hours=([one.hours for one in duty], _HOURS),
    )


_WATT = Unit("N*mm/s", "W", 1e3)


@_table.register
def _of_duty_efficiency(result: DutyEfficiency) -> Table:
    out, into = result.power
    variables = {
        **_of_duty(result.duty),
        **_along(
            "duty_phase",
            efficiency=([one.mean for one in result.phases], PERCENT),
            input_torque=([float(one.input_torque.mean()) for one in result.phases], TORQUE),
            drag=([float(one.losses["drag"].mean()) for one in result.phases], TORQUE),
        ),
        **_along("part", part=list(result.losses), power_lost=(list(result.losses.values()), _WATT)),
        **_single(mean_efficiency=(result.mean, PERCENT), power_out=(out, _WATT), power_in=(into, _WATT)),
        **_single(**{name: (getattr(result, name), TEMPERATURE) for name in ("ambient", "housing", "inside")}),
    }
    return Table("DutyEfficiency", "duty_phase", variables, {"drives": result.phases[0].drives})


@_table.register
def _of_wear(result: Wear) -> Table:
    variables = {
        **_along(
            "hour",
            hours=(result.hours, _HOURS),
            peak_to_peak=(result.peak_to_peak, ANGLE),
            lost_motion=(result.lost_motion, ANGLE),
            deepest_of_lobe=(result.lobe_depth.max(axis=1), LENGTH),
            deepest_of_pin=(result.pin_depth.max(axis=1), LENGTH),
            **{f"{member}_thinning": (row, LENGTH) for member, row in result.thinning.items()},
            **{f"{body}_volume": (row, _VOLUME) for body, row in result.volume.items()},
            **{f"{joint}_clearance": (row, LENGTH) for joint, row in result.clearance.items()},
        ),
        "roll_angle": Variable(("phase",), result.roll_angle, POSITION),
        "lobe_depth": Variable(("hour", "phase"), result.lobe_depth, LENGTH),
        "pin_depth": Variable(("hour", "phase"), result.pin_depth, LENGTH),
        "each_pin": Variable(("hour", "pin"), result.each_pin, LENGTH),
        **_of_duty(result.duty),
    }
    return Table("Wear", "hour", variables, {"model": _name(result.model)}, frozenset({"hours", "roll_angle"}))


def _shares(dim: str, name: str, rows: Mapping[str, Array], unit: Unit) -> dict[str, Variable]:
    """A row over the modes for each of some names."""
    return {**_along(dim, **{dim: list(rows)}), name: Variable((dim, "mode"), np.array(list(rows.values())), unit)}


@_table.register
def _of_diagnosis(result: Diagnosis) -> Table:
    signal = _SIGNAL[result.quantity]
    residuals = (result.before, result.before_refitted, result.after)
    variables = {
        **_added(result, signal),
        **_along(
            "stage",
            stage=["declared", "refitted", "after"],
            **_fields(residuals, signal, "rms", "peak_to_peak", "heldout_rms"),
        ),
        **_single(noise_rms=(result.noise_rms, signal)),
        **_along(
            "unexplained",
            "unexplained_",
            **_fields(result.unexplained, NUMBER, "order"),
            **_fields(result.unexplained, signal, "amplitude", "low", "high", "cos", "sin"),
            frames=["; ".join(line.frames) for line in result.unexplained],
        ),
        **_along(
            "candidate",
            "candidate_",
            key=[candidate.key for candidate in result.candidates],
            indices=[_inside(candidate.indices) for candidate in result.candidates],
            **_fields(result.candidates, NUMBER, "heldout_gain"),
        ),
        **_elastic(result),
        **_traces(result, signal),
        **_set_aside(result),
    }
    about = {
        "model": _name(result.declared),
        "verdict": result.verdict,
        "quantity": result.quantity,
        "candidates_tried": result.tried,
        "notes": "\n".join(result.notes),
    }
    return Table("Diagnosis", "added", variables, about, frozenset({"sample_run", "sample_theta"}))


def _added(result: Diagnosis, signal: Unit) -> dict[str, Variable]:
    rows = [(at, added, size) for at, added in enumerate(result.added) for size in added.estimates]
    own = _each("added_unit", (size.dimension for *_, size in rows))
    return _along(
        "added",
        "added_",
        number=_integers(at for at, *_ in rows),
        key=[added.effect.key for _, added, _ in rows],
        indices=[_inside(added.effect.indices) for _, added, _ in rows],
        parameter=[size.name for *_, size in rows],
        **_fields((size for *_, size in rows), own, "value", "low", "high"),
        orders=[", ".join(f"{order:g}" for order in added.orders) for _, added, _ in rows],
        **_fields((added for _, added, _ in rows), signal, "heldout_rms"),
        indistinguishable_from=["; ".join(describe(*one) for one in added.indistinguishable) for _, added, _ in rows],
        notes=["\n".join(added.notes) for _, added, _ in rows],
    )


def _elastic(result: Diagnosis) -> dict[str, Variable]:
    """What the runs say of stiffness, backlash and contact law."""
    rows = result.elastic
    own = _each("elastic_unit", (row.dimension for row in rows))
    return _along(
        "elastic",
        "elastic_",
        name=[row.name for row in rows],
        **_fields(rows, own, "declared", "value", "low", "high"),
        told=np.array([row.told for row in rows], dtype=bool),
    )


def _set_aside(result: Diagnosis) -> dict[str, Variable]:
    """Angles, as travelled, of samples set aside and of slips, with the number of their run."""
    made: dict[str, Variable] = {}
    for dim, name in (("set_aside", "set_aside"), ("slip", "slips")):
        rows = [(at, found) for at, trace in enumerate(result.traces) if (found := getattr(trace, name)) is not None]
        made |= _along(
            dim,
            f"{dim}_",
            run=_integers(at for at, found in rows for _ in range(found.size)),
            theta=(np.concatenate([np.zeros(0), *(found for _, found in rows)]), POSITION),
        )
    return made


def _traces(result: Diagnosis, signal: Unit) -> dict[str, Variable]:
    """Waveforms of all runs one after another, for each has angles of its own."""
    traces = result.traces

    def joined(rows: Iterable[Array]) -> Array:
        return np.concatenate([np.zeros(0), *rows])

    return {
        **_along(
            "run",
            "run_",
            name=[trace.name for trace in traces],
            **_fields(traces, NUMBER, "direction"),
            **_fields(traces, TORQUE, "torque"),
            index=[trace.index for trace in traces],
        ),
        **_along(
            "sample",
            "sample_",
            run=(np.repeat(np.arange(len(traces)), [trace.theta.size for trace in traces]), NUMBER),
            theta=(joined(trace.theta for trace in traces), POSITION),
            measured=(joined(trace.measured for trace in traces), signal),
            before=(joined(trace.before for trace in traces), signal),
            after=(joined(trace.after for trace in traces), signal),
            residual_before=(joined(trace.residual[0] for trace in traces), signal),
            residual_after=(joined(trace.residual[1] for trace in traces), signal),
        ),
    }


@_table.register
def _of_compensation(result: Compensation) -> Table:
    stages = (result.before, result.after)
    sizes = (result.unseen, ANGLE)
    variables = {
        **_along(
            "order",
            **_fields(result.orders, NUMBER, "order"),
            **_fields(result.orders, ANGLE, "amplitude", "left"),
            law=[one.law for one in result.orders],
            frames=["; ".join(one.frames) for one in result.orders],
        ),
        **_along("stage", stage=["before", "after"], **_fields(stages, ANGLE, "rms", "low", "high")),
        **_along("unseen", "unseen_", file=[one.file for one in result.unseen], **_fields(*sizes, "before", "after")),
    }
    about = {
        "model": _name(result.model),
        "index": result.index,
        "stays": "\n".join(result.stays),
        "notes": "\n".join(result.notes),
    }
    return Table("Compensation", "order", variables, about)


@_table.register
def _of_lot(result: Lot) -> Table:
    variables = {
        **_of_processes(result),
        **_of_shifts("shift", "shift_", result.shifts),
        **_of_shifts(
            "outlier",
            "outlier_",
            [cause for one in result.outsiders for cause in one.causes],
            unit=[one.serial for one in result.outsiders for _ in one.causes],
        ),
        **_of_shifts(
            "group",
            "group_",
            [cause for one in result.differences for cause in one.causes],
            label=[one.label for one in result.differences for _ in one.causes],
            value=[one.value for one in result.differences for _ in one.causes],
        ),
        **_of_shifts(
            "change",
            "change_",
            [one.cause for one in result.changes],
            since=[one.since for one in result.changes],
            course=[one.course for one in result.changes],
        ),
        **_along(
            "condition",
            condition=[one.condition for one in result.predicted],
            mean=([one.mean for one in result.predicted], ANGLE),
            p95=([one.quantile.value for one in result.predicted], ANGLE),
            p95_low=([one.quantile.low for one in result.predicted], ANGLE),
            p95_high=([one.quantile.high for one in result.predicted], ANGLE),
            measured_mean=([one.seen[0] for one in result.predicted], ANGLE),
            measured_p95=([one.seen[1] for one in result.predicted], ANGLE),
        ),
        **_along("order", order=(np.asarray(result.orders, dtype=np.float64), NUMBER)),
        "measured": Variable(("order", "run"), result.amplitudes.T, ANGLE),
        "made": Variable(("order", "run"), result.made.T, ANGLE),
    }
    about = {
        "model": result.model,
        "units": result.units,
        "conditions": "\n".join(result.conditions),
        "chance": result.chance,
        "notes": "\n".join(result.notes),
    }
    return Table("Lot", "process", variables, about)


@_table.register
def _of_drive_lot(result: DriveLot) -> Table:
    orders, own, pairs = result.orders, result.own, result.pairs
    means = (("mean", "value"), ("mean_low", "low"), ("mean_high", "high"))
    variables = {
        **_along(
            "place",
            **_fields(orders, NUMBER, "order", "chance"),
            condition=[one.condition for one in orders],
            **_fields(orders, ANGLE, "least", "median", "most", "phase", "spread"),
            **{name: ([getattr(one.mean, end) for one in orders], ANGLE) for name, end in means},
        ),
        **_along(
            "own",
            "own_",
            unit=[one.serial for one in own],
            **_fields(own, NUMBER, "order", "distance", "chance"),
            condition=[one.condition for one in own],
            **_fields(own, ANGLE, "amplitude", "difference"),
        ),
        **_along(
            "pair",
            "pair_",
            one=[pair.serials[0] for pair in pairs],
            other=[pair.serials[1] for pair in pairs],
            **_fields(pairs, ANGLE, "difference", "usual"),
            **_fields(pairs, NUMBER, "chance"),
        ),
        **_along("unit", unit=list(result.serials)),
        "amplitude": Variable(("unit", "place"), result.amplitudes, ANGLE),
    }
    about = {"model": result.model, "conditions": "\n".join(result.conditions), "notes": "\n".join(result.notes)}
    return Table("DriveLot", "place", variables, about)


def _of_processes(result: Lot) -> dict[str, Variable]:
    made = result.processes
    own = _each("process_unit", (one.dimension for one in made))
    none = (math.nan,) * 3
    sizes = [none if d is None else (d.value, d.low, d.high) for d in (one.deviation for one in made)]
    return _along(
        "process",
        process=[process_name(one) for one in made],
        key=[one.key for one in made],
        indices=[_inside(one.indices) for one in made],
        parameters=[", ".join(one.parameters) for one in made],
        deviation=([value for value, _, _ in sizes], own),
        deviation_low=([low for _, low, _ in sizes], own),
        deviation_high=([high for _, _, high in sizes], own),
        above_zero=np.array([one.above_zero for one in made], dtype=bool),
        share=([one.share for one in made], NUMBER),
        alike=["; ".join(one.alike) for one in made],
        units_needed=([_or_nan(one.units_needed) for one in made], NUMBER),
        tolerance=[one.tolerance for one in made],
        cp=([_or_nan(one.capability) for one in made], NUMBER),
        cpk=([_or_nan(one.capability_centred) for one in made], NUMBER),
        least_difference=([_or_nan(one.least_difference) for one in made], own),
        least_error=([_or_nan(one.least_error) for one in made], own),
    )


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value


def _of_shifts(dim: str, prefix: str, shifts: Sequence[Shift], **beside: list[str]) -> dict[str, Variable]:
    """Systematic errors as rows, behind the columns of what they belong to."""
    own = _each(f"{prefix}size_unit", (one.dimension for one in shifts))
    return _along(
        dim,
        prefix,
        **beside,
        source=[shift_name(one) for one in shifts],
        parameter=[one.parameter for one in shifts],
        size=([one.size.value for one in shifts], own),
        low=([one.size.low for one in shifts], own),
        high=([one.size.high for one in shifts], own),
    )


@_table.register
def _of_trend(result: Trend) -> Table:
    variables = {
        **_of_changes(result.changed),
        **_along("session", at=(result.at, NUMBER)),
        "peak_to_peak": Variable(("session", "run"), result.peak_to_peak, ANGLE),
        "lost_motion": Variable(("session", "load"), result.lost_motion, ANGLE),
        "explained": Variable(("session", "load"), result.explained, ANGLE),
    }
    about = {
        "model": result.model,
        "time_unit": result.unit,
        "conditions": "\n".join(result.conditions),
        "chance": result.chance,
        "notes": "\n".join(result.notes),
    }
    return Table("Trend", "change", variables, about)


@_table.register
def _of_compared(result: RunsCompared) -> Table:
    variables = {
        **_along(
            "order",
            order=(np.array([one.order for one in result.orders], dtype=np.float64), NUMBER),
            condition=[one.condition for one in result.orders],
            before=([one.before for one in result.orders], ANGLE),
            after=([one.after for one in result.orders], ANGLE),
            low=([one.interval.low for one in result.orders], ANGLE),
            high=([one.interval.high for one in result.orders], ANGLE),
            difference=([one.difference for one in result.orders], ANGLE),
            chance=([one.chance for one in result.orders], NUMBER),
        ),
        **_of_changes(result.changed),
    }
    about = {"conditions": "\n".join(result.conditions), "noise": result.noise, "notes": "\n".join(result.notes)}
    return Table("RunsCompared", "order", variables, about)


@_table.register
def _of_matched(result: Matched) -> Table:
    units, left = result.units, [(kind, serial) for kind, serials in result.left.items() for serial in serials]
    at = {place_name(part): place for place, part in enumerate(units[0].parts)}
    placed: dict[str, Any] = {name: [unit.parts[place].serial for unit in units] for name, place in at.items()}
    for name, place in at.items():
        if any(unit.parts[place].turn for unit in units):
            placed[f"{name}_turn"] = _integers(unit.parts[place].turn for unit in units)
    variables = {
        **_along("unit", unit=_integers(range(1, len(units) + 1)), **placed),
        **_along("quantity", quantity=[one.label for one in result.quantities], limit=(result.allowed, ANGLE)),
        "turn": Variable(("unit", "quantity"), np.array([unit.turns for unit in units]), ANGLE, bare=True),
        **_along(
            "way",
            way=[way.name for way in result.ways],
            units=_integers(way.errors.size for way in result.ways),
            **{
                "yield": ([way.share for way in result.ways], PERCENT),
                "p95": ([way.p95 for way in result.ways], PERCENT),
            },
            cost=([way.cost for way in result.ways], NUMBER),
        ),
        **_along("left", "left_", kind=[kind for kind, _ in left], serial=[serial for _, serial in left]),
    }
    about = {
        "model": result.model,
        "possible": result.possible,
        "bound": result.bound,
        "doubt": result.doubt,
        "notes": "\n".join(result.notes),
    }
    return Table("Matched", "unit", variables, about)


def place_name(part: MountedPart) -> str:
    """Column of a part's place: ``disc_1``."""
    return part.kind if part.place is None else f"{part.kind}_{part.place}"


def _of_changes(changed: Sequence[Changed]) -> dict[str, Variable]:
    """Parameters of causes that changed, a row for each."""
    rows = [(one, grown) for one in changed for grown in one.parameters]
    own = _each("change_unit", (grown.dimension for _, grown in rows))
    return _along(
        "change",
        source=[describe(one.key, one.indices) for one, _ in rows],
        key=[one.key for one, _ in rows],
        indices=[_inside(one.indices) for one, _ in rows],
        parameter=[grown.name for _, grown in rows],
        course=[one.course for one, _ in rows],
        since=([one.since for one, _ in rows], NUMBER),
        size=([grown.change.value for _, grown in rows], own),
        size_low=([grown.change.low for _, grown in rows], own),
        size_high=([grown.change.high for _, grown in rows], own),
        evidence=([one.evidence for one, _ in rows], NUMBER),
    )


@_table.register
def _of_tolerance(result: Tolerance) -> Table:
    return Table("Tolerance", "tolerance", _widths([result]))


def _widths(tolerances: Sequence[Tolerance]) -> dict[str, Variable]:
    own = _each("unit", (item.chosen[0].dimension for item in tolerances))
    return _along(
        "tolerance",
        tolerance=[item.label for item in tolerances],
        key=[item.key for item in tolerances],
        **_fields(tolerances, own, "width"),
        distribution=[item.distribution.name for item in tolerances],
        **_fields(tolerances, NUMBER, "correlation", "classes"),
        random_phase=np.array([item.random_phase for item in tolerances], dtype=bool),
        fixed=np.array([item.fixed for item in tolerances], dtype=bool),
        least=([item.span[0] for item in tolerances], own),
        largest=([item.span[1] for item in tolerances], own),
    )


@_table.register
def _of_stack(result: Stack) -> Table:
    parts = [component.dimension for component in result.components]
    own = _each("unit", (parts[block.components.start] for block in result.blocks))
    variables = {
        **_angles(result.theta, result.nominal.size),
        **_along("theta", nominal=(result.nominal, ANGLE)),
        **_along(
            "component",
            component=[str(component) for component in result.components],
            component_tolerance=(result.entry, NUMBER),
        ),
        "influence": Variable(("component", "theta"), result.influence, _influences(parts), bare=True),
        **_along(
            "tolerance",
            tolerance=list(result.labels),
            width=(result.width, own),
            distribution=[block.distribution.name for block in result.blocks],
            **_fields(result.blocks, NUMBER, "correlation", "classes"),
        ),
    }
    return Table("Stack", "tolerance", variables)


@_table.register
def _of_budget(result: Budget) -> Table:
    entries, worst = result.contributions, result.worst
    variables = {
        **_along(
            "tolerance",
            tolerance=[entry.label for entry in entries],
            **_fields(entries, _each("unit", (entry.dimension for entry in entries)), "width"),
            components=_integers(entry.components for entry in entries),
            **_fields(entries, SQUARE, "mean_square"),
            **_fields(entries, NUMBER, "share"),
            **_fields(entries, ANGLE, "worst_peak_to_peak", "worst_part", "rss"),
            **_fields(entries, ANGLE, "mean_peak_to_peak", "mean_peak_to_peak_error"),
            **_fields(entries, ANGLE, "offset_deviation", "worst_offset"),
            effect=[entry.effect for entry in entries],
        ),
        **_angles(result.theta, result.mean.size),
        **_along(
            "theta",
            mean=(result.mean, ANGLE),
            standard_deviation=(result.standard_deviation, ANGLE),
            deviation_standard_deviation=(result.deviation_standard_deviation, ANGLE),
            lower=(worst.lower, ANGLE),
            upper=(worst.upper, ANGLE),
        ),
        **_single(
            total_offset_mean=(result.offset_mean, ANGLE),
            total_offset_deviation=(result.offset_deviation, ANGLE),
            total_nominal_peak_to_peak=(result.nominal_peak_to_peak, ANGLE),
            total_nominal_mean_square=(result.nominal_mean_square, SQUARE),
            total_mean_square=(result.mean_square, SQUARE),
            total_rms=(result.rms, ANGLE),
            total_rss=(result.rss, ANGLE),
            total_worst_peak_to_peak=(worst.peak_to_peak, ANGLE),
            total_worst_peak_to_peak_nominal=(worst.peak_to_peak_nominal, ANGLE),
            total_worst_maximum=(worst.maximum, ANGLE),
            total_worst_offset_low=(worst.offset[0], ANGLE),
            total_worst_offset_high=(worst.offset[1], ANGLE),
        ),
    }
    return Table("Budget", "tolerance", variables)


@_table.register
def _of_error_budget(result: ErrorBudget) -> Table:
    own = _each("component_unit", (component.dimension for component in result.stack.components))
    worst, drawn = result.closed.worst, _table(result.units)
    variables = {
        **_table(result.closed).variables,
        **_along(
            "component",
            component=[str(component) for component in result.stack.components],
            worst_peak_to_peak_values=(worst.peak_to_peak_values, own),
            worst_maximum_values=(worst.maximum_values, own),
        ),
        **drawn.variables,
    }
    if result.indices is not None:
        ends = [f"{which}{end}" for which in ("first", "total") for end in ("", "_low", "_high")]
        shares = {f"sobol_{name}": (getattr(result.indices, name), NUMBER) for name in ends}
        variables |= _along("tolerance", **shares)
    about = {"model": _name(result.model), "direction": way(result.direction), **drawn.about}
    if (loaded := result.at_load) is not None:
        variables |= _yields(loaded.verified)
        beside = {"closed_form_yield": (loaded.closed_form, NUMBER), "worst_parts": (loaded.worst_parts, ANGLE)}
        variables |= _along("limit_at_load", **beside)
        about["units_without_equilibrium"] = "\n".join(loaded.verified.failures)
        for name in ("total", "total_low", "total_high"):
            rows = [
                np.full(len(result.tolerances), np.nan) if one is None else getattr(one, name) for one in loaded.shares
            ]
            variables[f"loaded_sobol_{name}"] = Variable(("limit_at_load", "tolerance"), np.array(rows), NUMBER)
    return Table("ErrorBudget", "tolerance", variables, about)


@_table.register
def _of_virtual_units(result: VirtualUnits) -> Table:
    sizes = {name: (getattr(result, name), ANGLE) for name in ("peak_to_peak", "max", "rms", "offset")}
    variables = {**_along("virtual_unit", **sizes), **_single(error_bound=(result.error_bound, ANGLE))}
    about = {"draws": result.draws, "seed": result.seed, "chunk": result.chunk}
    return Table("VirtualUnits", "virtual_unit", variables, about)


@_table.register
def _of_allocation(result: Allocation, *, stack: Stack | None = None) -> Table:
    if stack is not None and stack.labels != result.labels:
        raise InputError("stack: its tolerances are not those of the allocation; give the stack that was allocated")
    own = _each("unit", result.dimensions)
    prices = Each("bound_price_unit", tuple(Unit(f"1/{u.core}", f"1/{u.shown}", 1 / u.size) for u in own.units))
    checks = (result.closed_form_before, result.closed_form)
    per, price, limited = ("percent_of_limits", NUMBER, NUMBER) if result.verified else ("arcsec", PER_ARCSEC, ANGLE)
    rates = {
        f"saved_per_{per}_given_up": ([rate.relax for rate in result.rates], price),
        f"cost_per_{per}_gained": ([rate.tighten for rate in result.rates], price),
    }
    variables = {
        **_along(
            "tolerance",
            tolerance=list(result.labels),
            width_before=(result.widths_before, own),
            width=(result.widths, own),
            grade=[grade or "" for grade in result.grades],
            fixed=np.array(result.fixed, dtype=bool),
            cost_before=(result.costs_before, NUMBER),
            cost=(result.costs, NUMBER),
            bound_price=(result.bound_prices, prices),
            **rates,
        ),
        **_along(
            "stage",
            stage=["before", "after"],
            value=([result.value_before, result.value], limited),
            total_cost=([result.cost_before, result.cost], NUMBER),
            closed_form=([check.quantile for check in checks], ANGLE),
            closed_form_low=([check.low for check in checks], ANGLE),
            closed_form_high=([check.high for check in checks], ANGLE),
        ),
        **_single(limit=(result.limit, limited), gap=(result.gap, NUMBER), shadow_price=(result.shadow_price, price)),
        **({} if result.verified is None else _yields(result.verified)),
    }
    about = {"limited": result.kind, "level": result.level, "proof": result.proof}
    return Table("Allocation", "tolerance", variables, about)


def _yields(found: Verified) -> dict[str, Variable]:
    """Rows of limits at the load."""
    rows = found.limits
    own = Each("limit_unit", tuple(STIFFENED if one.limit.quantity == "stiffness" else ANGLE for one in rows))
    shares = [(one.share, *one.interval) if one.limit.value is not None else (math.nan,) * 3 for one in rows]
    return _along(
        "limit_at_load",
        limit_at_load=[one.limit.label for one in rows],
        limit_value=([one.limit.value for one in rows], own),
        **{f"p{100 * level:g}": ([one.quantile(level).value for one in rows], own) for level in LEVELS},
        **{
            name: ([share[at] for share in shares], NUMBER)
            for at, name in enumerate(("yield", "yield_low", "yield_high"))
        },
    )


def _of_front(result: Sequence[FrontPoint]) -> Table:
    best = [point.allocation for point in result]
    variables = _along(
        "limit",
        **_fields(result, ANGLE, "limit"),
        cost=([found and found.cost for found in best], NUMBER),
        value=([found and found.value for found in best], ANGLE),
        reason=[point.reason for point in result],
    )
    return Table("Front", "limit", variables)


_SEQUENCES: Mapping[type, Callable[[Any], Table]] = {
    Effect: lambda row: Table("Effects", "parameter", _sizes(row)),
    Tolerance: lambda row: Table("Tolerances", "tolerance", _widths(row)),
    FrontPoint: _of_front,
    Efficiency: _of_efficiencies,
}


@_table.register
def _of_sequence(result: Sequence) -> Table:  # type: ignore[type-arg]
    kinds = {type(item) for item in result}
    entry = _SEQUENCES.get(kinds.pop()) if len(kinds) == 1 else None
    if entry is None:
        names = ", ".join(kind.__name__ for kind in _SEQUENCES)
        raise InputError(f"{type(result).__name__}: a table is made of a row of results of one kind: {names}")
    return entry(result)
