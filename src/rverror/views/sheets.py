"""Every kind of result as a report: title, sentences, tables and notes, of which text, page and notebook are made.

Which columns of a result's table are shown, and under which words, is said here; their values and units come from
`kinds`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import singledispatch
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.errors import InputError
from rverror.base.numbers import at_input_speed, brief, count_of, way, with_unit
from rverror.base.text import describe
from rverror.base.units import ARCSEC
from rverror.compensation.outcome import Compensation
from rverror.compensation.table_files import WrittenTable, table_told
from rverror.diagnosis.result import Diagnosis
from rverror.dynamics.at_speed import CRITICAL, PULLED, SpeedResponse
from rverror.dynamics.natural_modes import Modes
from rverror.dynamics.running_up import RunUp
from rverror.geartrain.mechanism import OUTPUTS, Drive, Reducer
from rverror.life.result import Changed, RunsCompared, Trend
from rverror.lots.of_drives import DriveLot
from rverror.lots.result import Interval, Lot, MadeBy, Shift
from rverror.matching.result import Matched
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.model.ends import BENCH_DIMENSIONS, ENCODER_DIMENSIONS
from rverror.model.results import Equilibrium, Influence
from rverror.runs.measurement import Run
from rverror.runs.measuring_chain import uncertainty_of
from rverror.runs.order_table import OrderTable
from rverror.statics.duty import DutyEfficiency, duty_words
from rverror.statics.friction import Efficiency, Hysteresis
from rverror.statics.hertz import ContactPressure
from rverror.statics.rigidity import TorsionCurve
from rverror.statics.worn_contacts import Wear
from rverror.tolerances.allocation import Allocation, Rate
from rverror.tolerances.closed_form import Budget
from rverror.tolerances.declared import Tolerance
from rverror.tolerances.full_budget import ErrorBudget
from rverror.tolerances.sampling import VirtualUnits
from rverror.tolerances.stacking import Stack
from rverror.views.bench_report import BESIDE
from rverror.views.blocks import Ends, Listing, Sentence, Sheet, columns_of, facts, grid, line, notes, section, title
from rverror.views.budget_report import OF_ESTIMATE, SIZES, cause_of, limited_by, nominal_of, within, worst_of
from rverror.views.diagnosis_report import diagnosis_sheet
from rverror.views.kinds import described
from rverror.views.life_words import compared_verdict, life_rivals, remaining_words, trend_verdict
from rverror.views.lot_words import (
    COME,
    clean,
    diagnosed,
    not_told_apart,
    process_name,
    rivals,
    shift_name,
    silent,
    size_of,
    verdict,
)
from rverror.views.variables import NUMBER, columns
from rverror.views.yield_report import LEVELS, yield_sheet

_NONE = "–"


# --- pieces -----------------------------------------------------------------------------------------------------------


def _shown(thing: Any, rows: str = "") -> tuple[dict[str, list[Any]], dict[str, str]]:
    """Columns of a result's table as people read them, and the unit of each; numbers have none."""
    found, told = columns(described(thing), rows=rows, display=True)
    listed = {name: np.asarray(values).tolist() for name, values in found.items()}
    if "unit" in listed:
        listed["unit"] = [_plain(unit) for unit in listed["unit"]]
    return listed, {name: _plain(unit) for name, unit in told.items()}


def _plain(unit: str) -> str:
    return "" if unit == NUMBER.core else unit


def _columns(thing: Any, *names: str) -> Sheet:
    """Columns of a result's table under their own names, all where none is named."""
    found, told = _shown(thing)
    heads = {name: f"{name}, {unit}" if (unit := told.get(name, "")) else name for name in names or found}
    return columns_of({head.replace("_", " "): found[name] for name, head in heads.items()})


def _effects(found: Mapping[str, list[Any]]) -> list[str]:
    """Names of the effects in the rows of a table."""
    return [f"{key} ({inside})" if inside else key for key, inside in zip(found["key"], found["indices"], strict=True)]


def _intervals(low: Sequence[float], high: Sequence[float]) -> list[Ends]:
    return [Ends(ends) for ends in zip(low, high, strict=True)]


# --- one entry a kind -------------------------------------------------------------------------------------------------


@singledispatch
def sheet(thing: Any, **options: Any) -> Sheet:
    """Report of one kind of result; an `ErrorBudget` takes the `limit` at which its yield is told.

    Raises
    ------
    InputError
        If there is none of such a thing.
    """
    raise InputError(f"a {type(thing).__name__} has no sheet")


def has_sheet(thing: Any) -> bool:
    """Whether `sheet` knows the kind of a thing."""
    return sheet.dispatch(type(thing)) is not sheet.dispatch(object)


@sheet.register
def _of_reducer(thing: Reducer) -> Sheet:
    return title("Reducer", thing.name, _ratio(thing)) + _columns(thing, "parameter", "value", "unit")


@sheet.register
def _of_drive(thing: Drive) -> Sheet:
    return title("Drive", thing.name, _ratio(thing)) + grid(("shaft", "turns per output turn"), thing.shafts.items())


def _ratio(unit: Reducer | Drive) -> str:
    turned = f", {unit.output} as output" if isinstance(unit, Reducer) and unit.output != OUTPUTS[0] else ""
    return f"R = {unit.ratio:.8g}{turned}"


@sheet.register
def _of_effect(thing: Effect) -> Sheet:
    return title("Effect", describe(thing.key, thing.indices), thing.origin) + _sizes(thing, 1)


@sheet.register
def _of_model(thing: Model) -> Sheet:
    headed = title("Model", thing.name, f"{thing.mechanism.name}, {_ratio(thing.mechanism)}")
    stated = ((thing.bench, BENCH_DIMENSIONS), (thing.encoders, ENCODER_DIMENSIONS))
    ends = {
        f"bench: {name.replace('_', ' ')}": _told_of_bench(value, dimensions[name])
        for things, dimensions in stated
        for name, value in things.given().items()
    }
    return (
        headed + (_sizes(thing, 0) if thing.effects else line("no effect is declared")) + (facts(ends) if ends else ())
    )


def _told_of_bench(value: float, dimension: str) -> str:
    return brief(value) if dimension == "number" else with_unit(value, dimension)


def _sizes(thing: Model | Effect, first: int) -> Sheet:
    """Parameters of effects, from a column on."""
    found, _ = _shown(thing)
    sigmas = ["exact" if math.isnan(sigma) else sigma for sigma in found["uncertainty"]]
    rows = zip(_effects(found), found["parameter"], found["value"], sigmas, found["unit"], strict=True)
    return grid(("effect", "parameter", "size", "1 sigma", "unit")[first:], (row[first:] for row in rows))


@sheet.register
def _of_run(thing: Run) -> Sheet:
    table = described(thing)
    angles = {"input angle": thing.input_angle, "output angle": thing.output_angle}
    stated = {
        "samples": str(thing.size),
        "direction": str(table.about["direction"]),
        **{
            name: f"{np.degrees(row.min()):.6g} to {np.degrees(row.max()):.6g} deg"
            for name, row in angles.items()
            if row is not None
        },
        "output torque": _loads(thing),
        "temperature": "" if thing.temperature is None else with_unit(thing.temperature, "temperature"),
        "zero": _zero(thing.index),
        "columns": ", ".join(columns(table)[0]),
        **{f"# {key}": value for key, value in thing.metadata.items()},
    }
    return title("Run", thing.path) + facts(stated) + notes(thing.notes)


def _loads(run: Run) -> str:
    """One torque, or its range over the turn."""
    if run.load_column is not None:
        return " to ".join(with_unit(float(end), "torque") for end in (run.load_column.min(), run.load_column.max()))
    return "" if run.torque is None else with_unit(run.torque, "torque")


def _zero(index: str) -> str:
    """What the label of a zero says."""
    return {"": "aligned, offset of its own", "unknown": "not known"}.get(index, f"shared, {index}")


#: Dimension of each condition of an order table that is a number.
_CONDITIONS = {"torque": "torque", "input_speed": "angular_speed", "temperature": "temperature"}


@sheet.register
def _of_orders(thing: OrderTable) -> Sheet:
    found, told = _shown(thing)
    stated = {"conditions": str(len(thing.cases))}
    columns_shown: dict[str, list[Any]] = {}
    senses = dict.fromkeys(way(case.condition.direction) for case in thing.cases)
    stated["direction"] = " and ".join(senses)
    if len(senses) > 1:
        columns_shown["direction"] = [way(sense) for sense in found["direction"]]
    for name, dimension in _CONDITIONS.items():
        each = [getattr(case.condition, name) for case in thing.cases for _ in case.orders]
        values = [math.nan if value is None else units.to_display(value, dimension) for value in each]
        unit, known = units.DISPLAY_UNITS[dimension], sorted(value for value in values if not math.isnan(value))
        heading = name.replace("_", " ")
        if known:
            low, high = brief(known[0]), brief(known[-1])
            stated[heading] = f"{low} {unit}" if low == high else f"{low} to {high} {unit}"
        if known and (low != high or len(known) < len(values)):  # what is the same in all rows is said above
            columns_shown[f"{heading}, {unit}"] = values
    for name in ("order", "amplitude", "phase", "sigma"):
        if name in found:
            columns_shown[f"{name}, {told[name]}" if told[name] else name] = found[name]
    stated |= {
        "orders": ", ".join(brief(order) for order in sorted(set(found["order"]))),
        "zero": _zero(thing.index),
        **{f"# {key}": value for key, value in thing.metadata.items()},
    }
    return title("Order table", thing.path) + facts(stated) + columns_of(columns_shown) + notes(thing.notes)


@sheet.register
def _of_influence(thing: Influence) -> Sheet:
    matrix = thing.matrix
    rows = zip(thing.labels, np.ptp(matrix, axis=1).tolist(), matrix.mean(axis=1).tolist(), strict=True)
    heads = ("parameter", "peak-to-peak", "mean")
    note = f"rad of output per {units.CORE_UNITS[source(thing.key).parameters[0].dimension]} of each parameter"
    return title("Influence", f"{thing.key}, {count_of(matrix.shape[1], 'angle')}") + grid(heads, rows) + line(note)


@sheet.register
def _of_equilibrium(thing: Equilibrium) -> Sheet:
    error, pins = thing.transmission_error, thing.loaded_pins
    stated = {
        "transmission error, mean": f"{_angle(float(error.mean()))}, windup and lost motion included",
        "transmission error, peak-to-peak": _angle(float(np.ptp(error))),
        **{f"pins that carry, disc {disc}": f"{row.min()} to {row.max()}" for disc, row in enumerate(pins)},
        **{
            f"largest {contact} force": f"{brief(float(np.sqrt((force**2).sum(axis=-2)).max()))} N"
            for contact, force in thing.contact_forces.items()
            if contact != "spline"
        },
        "largest spline torque": with_unit(float(np.abs(thing.contact_forces["spline"]).max()), "torque"),
        "out of balance": f"{thing.residual.max():.1e} of the load at the most",
    }
    return title("Equilibrium", count_of(error.size, "angle")) + facts(stated)


def _angle(value: float) -> str:
    return with_unit(value, "angle")


@sheet.register
def _of_torsion(thing: TorsionCurve) -> Sheet:
    found, angle = described(thing).variables, thing.angle / ARCSEC
    spread = _intervals(angle.min(axis=1).tolist(), angle.max(axis=1).tolist())
    rows = zip(found["torque"].shown(display=True).tolist(), angle.mean(axis=1).tolist(), spread, strict=True)
    where = count_of(angle.shape[1], "angle") + " of the output"
    return title("Torsion curve", where) + grid(("torque, N*m", "turn, arcsec", "over the angles, arcsec"), rows)


@sheet.register
def _of_hysteresis(thing: Hysteresis) -> Sheet:
    branches = {"rising": thing.rising, "falling": thing.falling, "width": thing.width}
    spread = (thing.width / ARCSEC).T
    columns_shown = {
        "torque, N*m": described(thing).variables["torque"].shown(display=True).tolist(),
        **{f"{name}, arcsec": (branch.mean(axis=1) / ARCSEC).tolist() for name, branch in branches.items()},
        "width over the angles, arcsec": _intervals(spread.min(axis=0).tolist(), spread.max(axis=0).tolist()),
    }
    where = count_of(thing.width.shape[1], "angle") + " of the output"
    return title("Hysteresis", where) + columns_of(columns_shown) + line("turns are means over the angles")


@sheet.register
def _of_efficiency(thing: Efficiency) -> Sheet:
    at_input, change = thing.input_torque, thing.error_change
    mean, least, most = (brief(100 * share) for share in (thing.mean, thing.efficiency.min(), thing.efficiency.max()))
    stated = {
        "efficiency": f"{mean} %, {least} to {most} over the angles",
        "torque at the input, mean": with_unit(float(at_input.mean()), "torque"),
        "torque at the input, peak-to-peak": with_unit(float(np.ptp(at_input)), "torque"),
        "added output error, mean": _angle(float(change.mean())),
        "added output error, peak-to-peak": _angle(float(np.ptp(change))),
    }
    lost: dict[str, list[Any]] = {
        "lost to": [part.replace("_", " ") for part in thing.losses],
        "torque at the output, N*m": [units.to_display(float(row.mean()), "torque") for row in thing.losses.values()],
        "of the work put in, %": [100 * share for share in thing.by_part.values()],
    }
    about = described(thing).about
    where = f"{with_unit(thing.torque, 'torque')}, {about['direction']}, the {thing.drives} drives"
    noticed = ["self-locking: at some angle the output cannot drive it"] if thing.self_locking else []
    return (
        title("Efficiency", where, count_of(thing.theta.size, "angle"))
        + facts(stated)
        + columns_of(lost)
        + notes(noticed)
    )


@sheet.register
def _of_pressure(thing: ContactPressure) -> Sheet:
    found, _ = _shown(thing)
    columns_shown = {
        "hardest pressed": [
            f"{contact} ({inside})" for contact, inside in zip(found["contact"], found["indices"], strict=True)
        ],
        "pressure, MPa": found["pressure"],
        "force, N": found["force"],
        "at, deg": found["theta"],
        "ripple, %": found["ripple"],
    }
    note = "ripple: of the hardest pressed contact of each angle, largest less smallest over the mean"
    return title("Contact pressure", count_of(thing.theta.size, "angle")) + columns_of(columns_shown) + line(note)


@sheet.register
def _of_duty_efficiency(thing: DutyEfficiency) -> Sheet:
    stated = {"efficiency of the cycle": f"{brief(100 * thing.mean)} %"}
    stated |= {f"lost to {part.replace('_', ' ')}": f"{brief(power / 1e3)} W" for part, power in thing.losses.items()}
    stated |= {where: with_unit(getattr(thing, where), "temperature") for where in ("ambient", "housing", "inside")}
    rows = _columns(thing, "torque", "input_speed", "duty_hours", "efficiency", "input_torque", "drag")
    return title("Duty", f"the {thing.phases[0].drives} drives") + facts(stated) + rows


@sheet.register
def _of_wear(thing: Wear) -> Sheet:
    found, _ = _shown(thing)
    heads = {
        "hours": "hours",
        "lost motion, arcsec": "lost_motion",
        "peak-to-peak, arcsec": "peak_to_peak",
        "lobe, um": "deepest_of_lobe",
        "pin, um": "deepest_of_pin",
        "sun thinner, um": "sun_thinning",
        "planets thinner, um": "planet_thinning",
    }
    gained = {joint: f"{joint}_clearance" for joint, row in thing.clearance.items() if row.any()}
    heads |= {f"{joint.replace('_', ' ')} looser, um": name for joint, name in gained.items()}
    return title("Wear", duty_words(thing.duty)) + columns_of({head: found[name] for head, name in heads.items()})


@sheet.register
def _of_modes(thing: Modes) -> Sheet:
    strain, kinetic = (_most_of(shares) for shares in (thing.strain_energy, thing.kinetic_energy))
    columns_shown = {
        "mode": range(thing.frequency.size),
        "frequency, Hz": thing.frequency.tolist(),
        "damping, %": (100 * thing.damping_ratio).tolist(),
        "held by": [name for name, _ in strain],
        "by, %": [share for _, share in strain],
        "what moves": [name for name, _ in kinetic],
        "of it, %": [share for _, share in kinetic],
        "of the machine": ["no" if of else "yes" for of in thing.of_sun_support],
    }
    where = f"{with_unit(thing.torque, 'torque')}, {way(thing.direction)}, at {math.degrees(thing.theta):.6g} deg"
    noticed = []
    if thing.of_sun_support.any():
        noticed.append(
            "a mode of the sun's support is none of the machine: that spring only gives a floating sun a place"
        )
    if thing.estimated:
        noticed.append(f"estimated from the geometry, to some 30 %: {', '.join(thing.estimated)}")
    return title("Modes", where) + columns_of(columns_shown) + notes(noticed)


#: Speeds and orders that are shown of an error against speed: as many as stand on a page.
_SPEEDS, _ORDERS = 20, 5


@sheet.register
def _of_speeds(thing: SpeedResponse) -> Sheet:
    found, _ = _shown(thing)
    chosen = np.unique(np.linspace(0, thing.speed.size - 1, _SPEEDS).round().astype(int))
    size = np.abs(np.vstack([thing.crawl_waves, thing.waves])) / ARCSEC
    leading = np.sort(np.argsort(-size.max(axis=0), kind="stable")[:_ORDERS])
    columns_shown: dict[str, list[Any]] = {
        "input speed, rpm": [0.0, *(found["speed"][at] for at in chosen)],
        "peak-to-peak, arcsec": [float(np.ptp(thing.crawl)) / ARCSEC, *(found["peak_to_peak"][at] for at in chosen)],
        **{f"order {thing.order[at]:g}": [size[0, at].item(), *size[1 + chosen, at].tolist()] for at in leading},
    }
    where = f"{with_unit(thing.torque, 'torque')}, {way(thing.direction)}, {count_of(thing.speed.size, 'input speed')}"
    return (
        title("Error against speed", where)
        + columns_of(columns_shown)
        + line("amplitudes by order in arcsec; the first line is the equilibrium's, at a crawl")
        + _critical(thing)
        + notes(_cautions(thing))
    )


def _critical(thing: SpeedResponse) -> Sheet:
    critical, _ = _shown(thing, "critical")
    if not thing.critical_speeds:
        return line(f"no critical speed: no order peaks at {CRITICAL:g} times its amplitude at a crawl")
    names = {
        "speed": "critical speed, rpm",
        "order": "order",
        "amplitude": "amplitude, arcsec",
        "growth": "times that at a crawl",
        "frequency": "natural frequency, Hz",
    }
    return columns_of({head: critical[name] for name, head in names.items()})


def _cautions(thing: SpeedResponse) -> list[str]:
    noticed = []
    for name, share in thing.pulled.items():
        over = thing.speed[share > PULLED]
        if over.size:
            low, high = (units.to_display(end, "angular_speed") for end in (over.min(), over.max()))
            between = (
                f"at {brief(low)} rpm"
                if over.size == 1
                else f"at {over.size} speeds of {brief(low)} to {brief(high)} rpm"
            )
            noticed.append(
                f"closed {name} would have to pull {between}, by up to {brief(100 * float(share.max()))} % of their "
                "force: they open, and the error there is no prediction"
            )
    if any(one.of_sun_support for one in thing.critical_speeds):
        noticed.append("a peak at a mode of the sun's support is none of the machine")
    return noticed


@sheet.register
def _of_run_up(thing: RunUp) -> Sheet:
    found, _ = _shown(thing)
    chosen = np.unique(np.linspace(0, thing.time.size - 1, _SPEEDS).round().astype(int))
    columns_shown = {
        head: [found[name][at] for at in chosen]
        for name, head in {
            "time": "time, s",
            "speed": "input speed, rpm",
            "load": "load, N*m",
            "transmission_error": "error, arcsec",
            "windup": "windup, arcsec",
            "vibration": "vibration, arcsec",
            "output_torque": "output torque, N*m",
        }.items()
    }
    spread, shaken, twisted = (float(np.ptp(row)) / ARCSEC for row in _parts(thing))
    low, high = (with_unit(float(end), "torque") for end in (thing.output_torque.min(), thing.output_torque.max()))
    noticed = []
    if thing.output_torque.min() < 0:
        first = thing.time[np.argmax(thing.output_torque < 0)]
        noticed.append(
            f"from {brief(float(first))} s on contacts would have to pull: they open, and the error is no prediction"
        )
    where = f"{with_unit(thing.torque, 'torque')}, {way(thing.direction)}, {brief(float(np.ptp(thing.time)))} s"
    return (
        title("Run-up", where)
        + columns_of(columns_shown)
        + line(f"peak-to-peak {brief(spread)} arcsec, of it vibration {brief(shaken)}, windup {brief(twisted)}")
        + line(f"the output carries {low} to {high}")
        + notes(noticed)
    )


def _parts(thing: RunUp) -> tuple[Any, Any, Any]:
    return thing.transmission_error, thing.vibration, thing.windup


def _most_of(shares: Mapping[str, Any]) -> list[tuple[str, float]]:
    """What has most of each mode's energy, and how many percent; a free motion is held by nothing."""
    found = []
    for of in zip(*(row.tolist() for row in shares.values()), strict=True):
        share, name = max(zip(of, shares, strict=True))
        found.append((name, round(100 * share, 1)) if share > 0 else ("nothing", math.nan))
    return found


sheet.register(Diagnosis, diagnosis_sheet)


_BENCH_REPEATS = "The bench's own error repeats as the gears' does, so the table holds it, and the output keeps it."


def _of_bench(sizes: Sequence[float]) -> dict[str, Sequence[float]]:
    """Column of the bench's uncertainty, where one is stated."""
    return {f"± {BESIDE}": sizes} if sizes else {}


@sheet.register
def _of_compensation(thing: Compensation, *, table: WrittenTable | None = None) -> Sheet:
    stages, _ = _shown(thing, "stage")
    orders, _ = _shown(thing, "order")
    unseen, _ = _shown(thing, "unseen")
    verdict = f"{count_of(len(thing.orders), 'order')} compensated" if thing.worth else "nothing to compensate"
    bench = uncertainty_of(thing.model.encoders, thing.model.mechanism.ratio)
    of_rms = [] if bench is None else [bench.of("rms") / ARCSEC]
    of_orders = [] if bench is None else [bench.of_order(one.order) / ARCSEC for one in thing.orders]
    return (
        *title("Compensation", thing.model.name or thing.model.mechanism.name),
        Sentence(verdict),
        *columns_of(
            {
                "error of data left out, arcsec": ["without", "with"],
                "rms": stages["rms"],
                **_of_bench(2 * of_rms),
                "one more, 95 %": _intervals(stages["low"], stages["high"]),
            }
        ),
        *columns_of(
            {
                "seen by no fit, rms, arcsec": unseen["file"],
                "without": unseen["before"],
                "with": unseen["after"],
                **_of_bench(len(thing.unseen) * of_rms),
            }
        ),
        *columns_of(
            {
                "order": orders["order"],
                "amplitude, arcsec": orders["amplitude"],
                "left, arcsec": orders["left"],
                **_of_bench(of_orders),
                "over direction and condition": orders["law"],
                "fits": orders["frames"],
            }
        ),
        *(Sentence(f"Stays: {text}") for text in thing.stays),
        *(Sentence(_BENCH_REPEATS) for _ in of_rms if thing.worth),
        *(() if table is None else map(Sentence, table_told(table))),
        *notes(thing.notes),
    )


@sheet.register
def _of_trend(thing: Trend) -> Sheet:
    hours = f"{thing.unit}s"
    times = f"{count_of(len(thing.at), 'session')}, {brief(thing.at[0])} to {brief(thing.at[-1])} {hours}"
    heads = ("grows", "parameter", "course", "since", "change", "95 % interval", f"per 1000 {hours}", "95 % interval")
    return (
        *title("Trend", thing.model, times),
        *(line(f"Conditions: {'; '.join(thing.conditions)}") if thing.conditions else ()),
        Sentence(*trend_verdict(thing)),
        *grid(
            (*heads, "unit"),
            [
                (
                    describe(one.key, one.indices), grown.name, one.course, one.since,
                    *_sized(grown.change, grown.dimension), *_sized(grown.rate, grown.dimension, 1000),
                    units.DISPLAY_UNITS[grown.dimension],
                )
                for one in thing.growing
                for grown in one.parameters
            ],
        ),
        *_jumped(("jump at",), thing.jumps),
        *map(Sentence, life_rivals(thing.changed)),
        *(line(remaining_words(thing)) if thing.remaining else ()),
        *notes(thing.notes),
    )  # fmt: skip


@sheet.register
def _of_compared(thing: RunsCompared) -> Sheet:
    return (
        *title("Runs compared", "; ".join(thing.conditions)),
        Sentence(*compared_verdict(thing)),
        *grid(
            ("order", "condition", "before, arcsec", "after, arcsec", "95 % interval", "chance"),
            [
                (one.order, one.condition, one.before / ARCSEC, *_sized(one.interval, "angle"), one.chance)
                for one in thing.orders
            ],
        ),
        *_jumped((), thing.changed),
        *map(Sentence, life_rivals(thing.changed)),
        *notes(thing.notes),
    )


@sheet.register
def _of_matched(thing: Matched) -> Sheet:
    found, told = _shown(thing)
    names = [name for name in found if not name.startswith("roller")]  # forty grooves: the spreadsheet has them
    heads = {name: f"{name.replace('_', ' ')}{', ' + told[name] if told.get(name) else ''}" for name in names}
    verdict = f"{len(thing.units)} of {thing.possible} units"
    limits = zip(thing.quantities, thing.allowed, strict=True)
    return (
        *title("Matched units", thing.model, "; ".join(f"{one.label}: {with_unit(x, 'angle')}" for one, x in limits)),
        Sentence(
            f"{verdict} that the parts allow are within the limits, each solved at the load; by the linear influences "
            f"no assembly of these parts has more than {thing.bound}.",
            verdict,
        ),
        *columns_of(
            {
                "way to build": [way.name for way in thing.ways],
                "units": [way.errors.size for way in thing.ways],
                "yield, %": [100 * way.share for way in thing.ways],
                "P95, % of the limit": [100 * way.p95 for way in thing.ways],
                "cost a unit": [way.cost for way in thing.ways],
            }
        ),
        *columns_of({head: found[name] for name, head in heads.items()}),
        *facts({f"{kind}, {len(some)} stay": ", ".join(some[:8]) + ", ..." * (len(some) > 8)
                 for kind, some in thing.left.items()}),
        *notes(thing.notes),
    )  # fmt: skip


def _sized(size: Interval, dimension: str, times: float = 1.0) -> tuple[float, Ends]:
    """Size and interval in the unit for people."""
    value, low, high = (times * units.to_display(x, dimension) for x in (size.value, size.low, size.high))
    return value, Ends((low, high))


def _jumped(heads: tuple[str, ...], changed: Sequence[Changed]) -> Sheet:
    """Causes that are another size at once, behind the time of each where there is a head for it."""
    return grid(
        (*heads, "cause", "parameter", "by", "95 % interval", "unit"),
        [
            (
                *(one.since for _ in heads), describe(one.key, one.indices), grown.name,
                *_sized(grown.change, grown.dimension), units.DISPLAY_UNITS[grown.dimension],
            )
            for one in changed
            for grown in one.parameters
        ],
    )  # fmt: skip


@sheet.register
def _of_lot(thing: Lot) -> Sheet:
    said, strong = verdict(thing)
    unseen, ruled_out = silent(thing), clean(thing)
    return (
        *title("Lot", thing.model, size_of(thing)),
        *(line(f"Conditions: {'; '.join(thing.conditions)}") if thing.conditions else ()),
        Sentence(said, strong=strong),
        *_made_by([one for one in thing.processes if one.above_zero]),
        *_at_most([one for one in thing.processes if not one.above_zero]),
        *map(Sentence, not_told_apart(thing)),
        *(line(unseen) if unseen else ()),
        *_shifted(("systematic error",), [((), one) for one in thing.shifts]),
        *grid(
            ("stiffness", "times what is stated", "95 % interval"),
            [(name, one.value, Ends((one.low, one.high))) for name, one in thing.stiffness.items()],
        ),
        *_shifted(
            ("unit that is no member", "chance", "cause"),
            [((one.serial, one.chance), cause) for one in thing.outsiders for cause in one.causes],
        ),
        *_shifted(
            ("group that differs", "units", "chance", "cause"),
            [
                ((f"{one.label} {one.value}", one.units, one.chance), cause)
                for one in thing.differences
                for cause in one.causes
            ],
        ),
        *_shifted(
            ("change since", "course", "chance", "cause"),
            [((one.since, one.course, one.chance), one.cause) for one in thing.changes],
        ),
        *map(Sentence, rivals(thing)),
        *map(Sentence, diagnosed(thing)),
        *(line(ruled_out) if ruled_out else ()),
        *_limits(thing.processes),
        *columns_of(_foretold(thing)),
        *(line(COME) if thing.differences or thing.changes else ()),
        *notes(thing.notes),
    )


@sheet.register
def _of_drive_lot(thing: DriveLot) -> Sheet:
    shared = ", ".join(str(one.order) for one in thing.orders if one.shared) or "none"
    strong = f"Order in which the units' phases agree: {shared}"
    units_off = count_of(len({one.serial for one in thing.own}), "unit")
    return (
        *title("Lot of drives", thing.model, count_of(len(thing.serials), "unit")),
        Sentence(f"{strong}; {units_off} off the others; pairs nearly equal: {len(thing.pairs)}", strong=strong),
        *grid(
            ("order", "condition", "least, arcsec", "median", "most", "spread", "mean wave", "95 % interval",
             "phase, deg", "chance"),
            [(one.order, one.condition, *(x / ARCSEC for x in (one.least, one.median, one.most, one.spread)),
              *_sized(one.mean, "angle"), math.degrees(one.phase), one.chance) for one in thing.orders],
        ),
        *grid(
            ("unit that is off", "order", "condition", "amplitude, arcsec", "off by", "standard deviations", "chance"),
            [(o.serial, o.order, o.condition, o.amplitude / ARCSEC, o.difference / ARCSEC, o.distance, o.chance)
             for o in thing.own],
        ),
        *grid(
            ("nearly equal", "and", "difference, arcsec rms", "of usual pairs", "chance"),
            [(*one.serials, one.difference / ARCSEC, one.usual / ARCSEC, one.chance) for one in thing.pairs],
        ),
        *notes(thing.notes),
    )  # fmt: skip


def _made_by(processes: Sequence[MadeBy]) -> Sheet:
    """Processes that are told from none, with their capability where there are tolerances."""
    shown: dict[str, list[Any]] = {
        "process": [process_name(one) for one in processes],
        **_sizes_of([(one.deviation, one.dimension) for one in processes], "standard deviation"),
        "share of variance, %": [100 * one.share for one in processes],
    }
    if any(one.capability is not None for one in processes):
        shown["Cp"] = [_or_nan(one.capability) for one in processes]
        shown["Cpk"] = [_or_nan(one.capability_centred) for one in processes]
    shown["units for ± 25 %"] = [_or_nan(one.units_needed) for one in processes]
    return columns_of(shown)


def _at_most(processes: Sequence[MadeBy]) -> Sheet:
    """Processes that are not told from none, and what they are below."""
    told = [(one, one.deviation) for one in processes if one.deviation is not None]
    return grid(
        ("not above zero", "standard deviation below", "unit"),
        [
            (process_name(one), units.to_display(size.high, one.dimension), units.DISPLAY_UNITS[one.dimension])
            for one, size in told
        ],
    )


def _limits(processes: Sequence[MadeBy]) -> Sheet:
    """What one part has to be off to be found."""
    return grid(
        ("one part, found in 95 %", "off in half of the lot by", "off in one unit by", "unit"),
        [
            (
                process_name(one),
                *(units.to_display(_or_nan(limit), one.dimension) for limit in (one.least_difference, one.least_error)),
                units.DISPLAY_UNITS[one.dimension],
            )
            for one in processes
            if one.least_difference is not None
        ],
    )


def _shifted(heads: Sequence[str], rows: Sequence[tuple[tuple[Any, ...], Shift]]) -> Sheet:
    """Systematic errors in the rows of a table, what stands before them under its own heads."""
    shifts = [shift for _, shift in rows]
    found = {
        **{head: [before[at] for before, _ in rows] for at, head in enumerate(heads[:-1])},
        heads[-1]: [shift_name(shift) for shift in shifts],
        "parameter": [shift.parameter for shift in shifts],
        **_sizes_of([(shift.size, shift.dimension) for shift in shifts], "size"),
    }
    return columns_of(found)


def _sizes_of(sizes: Iterable[tuple[Interval | None, str]], name: str) -> dict[str, list[Any]]:
    """Columns of sizes with their intervals, each in the unit of its dimension."""
    found: dict[str, list[Any]] = {name: [], "95 % interval": [], "unit": []}
    for size, dimension in sizes:
        each = (math.nan,) * 3 if size is None else (size.value, size.low, size.high)
        value, low, high = (units.to_display(one, dimension) for one in each)
        found[name].append(value)
        found["95 % interval"].append(Ends((low, high)))
        found["unit"].append(units.DISPLAY_UNITS[dimension])
    return found


def _or_nan(value: float | None) -> float:
    return math.nan if value is None else value


def _foretold(thing: Lot) -> dict[str, list[Any]]:
    """Peak-to-peak error of the units to come, beside that of those that were measured."""
    found = thing.predicted
    return {
        "peak-to-peak, arcsec": [one.condition for one in found],
        "mean, to come": [one.mean / ARCSEC for one in found],
        "P95, to come": [one.quantile.value / ARCSEC for one in found],
        "95 % interval": [Ends((one.quantile.low / ARCSEC, one.quantile.high / ARCSEC)) for one in found],
        "mean, measured": [one.seen[0] / ARCSEC for one in found],
        "P95, measured": [one.seen[1] / ARCSEC for one in found],
    }


def _contributions(thing: Budget | ErrorBudget) -> Sheet:
    """Tolerances, the largest share first."""
    found, _ = _shown(thing)
    closed = thing if isinstance(thing, Budget) else thing.closed
    shown = {
        "tolerance": found["tolerance"],
        "width": found["width"],
        "unit": found["unit"],
        "share of variance, %": [100 * share for share in found["share"]],
        "p-p alone, mean, arcsec": found["mean_peak_to_peak"],
        "p-p alone, worst, arcsec": found["worst_peak_to_peak"],
        "part of worst case, arcsec": found["worst_part"],
    }
    drawn = "sobol_total" in found
    if drawn:
        for which in ("first", "total"):
            sizes = zip(*(found[f"sobol_{which}{end}"] for end in ("", "_low", "_high")), found["effect"], strict=True)
            shown[f"Sobol {which} ± 95 %"] = [_index(*size, effect=effect) for *size, effect in sizes]
    rows = list(zip(*shown.values(), strict=True))
    quiet = ", ".join(entry.label for entry in closed.contributions if entry.effect != "wave")
    return (
        *grid(list(shown), sorted(rows, key=lambda row: -row[3])),
        *line(
            f"Sobol index: share of the variance of the peak-to-peak; ±: half of the {OF_ESTIMATE}." if drawn else ""
        ),
        *line(
            f"In closed form these change the offset of the output angle alone, or nothing: {quiet}." if quiet else ""
        ),
    )


def _index(value: float, low: float, high: float, *, effect: str) -> str:
    """Sobol index; none of what makes no wave, or is correlated with others and so no cause by itself."""
    return "" if effect != "wave" or math.isnan(value) else f"{value:.2f} ± {(high - low) / 2:.2f}"


@sheet.register
def _of_budget(thing: Budget) -> Sheet:
    stated = {
        "root sum of squares of single peak-to-peaks": _angle(thing.rss),
        "expected rms": _angle(thing.rms),
        "standard deviation of the offset": _angle(thing.offset_deviation),
    }
    return (
        *title("Budget in closed form", _counts(thing)),
        *_quantiles(None, thing),
        *facts(stated),
        *_contributions(thing),
    )


def _counts(closed: Budget) -> str:
    entries = closed.contributions
    return f"{count_of(len(entries), 'tolerance')}, {count_of(sum(e.components for e in entries), 'component')}"


def _quantiles(drawn: VirtualUnits | None, closed: Budget | None = None) -> Sheet:
    """Sizes of the output error at several shares of the units, with what no unit exceeds where that is known."""
    rows, levels = [], LEVELS if drawn else ()
    for size, name, _ in SIZES:
        row: list[Any] = [name] if closed is None else [name, nominal_of(closed, size) / ARCSEC]
        for level in levels:
            assert drawn is not None
            found = drawn.quantile(level, size)
            row += [found.value / ARCSEC, Ends((found.low / ARCSEC, found.high / ARCSEC))]
        rows.append(row if closed is None else [*row, worst_of(closed, size) / ARCSEC])
    heads = [text for level in levels for text in (f"P{level * 100:g}", "95 % interval")]
    known = ([], []) if closed is None else (["nominal"], ["worst case"])
    return grid(["size, arcsec", *known[0], *heads, *known[1]], rows)


@sheet.register
def _of_virtual_units(thing: VirtualUnits) -> Sheet:
    return title("Virtual units", f"{thing.count}, {thing.draws}, seed {thing.seed}") + _quantiles(thing)


@sheet.register
def _of_error_budget(thing: ErrorBudget, *, limit: Any | None = None) -> Sheet:
    drawn, p99 = thing.units, thing.units.quantile(0.99)
    rigid = "" if thing.stack.speed is None else f" about the loaded state{at_input_speed(thing.stack.speed)}"
    if thing.stack.speed is None and isinstance(thing.model.mechanism, Reducer):
        rigid = ": rigid bearings, all loaded pins carry"
    size, ends = p99.value / ARCSEC, [brief(end / ARCSEC) for end in (p99.low, p99.high)]
    strong = f"99 % of the units stay within {brief(size)} arcsec peak-to-peak"
    first = max(thing.closed.contributions, key=lambda one: one.share)
    most = " No tolerance changes more than the offset."
    if first.share > 0:
        most = f" {first.label} makes most of it, {100 * first.share:.0f} % of the variance."
    return (
        *title(
            "Error budget", thing.model.name or thing.model.mechanism.name, _counts(thing.closed), way(thing.direction)
        ),
        Sentence(f"{strong} ({ends[0]} to {ends[1]}).{most}", strong=strong),
        *line(_yield_at(drawn, limit)),
        *line(f"Closed form{rigid}; {thing.closed.mean.size} angles; {drawn.count} virtual units, seed {drawn.seed}."),
        *_quantiles(drawn, thing.closed),
        *line(f"P99: what 99 % of the units do not exceed. Intervals: the {OF_ESTIMATE}, not how far units scatter."),
        *line(
            f"Root sum of squares of the single peak-to-peaks {_angle(thing.closed.rss)}; expected rms "
            f"{_angle(thing.closed.rms)}."
        ),
        *section("At the load, contacts that open included", *_at_load(thing)),
        *section("What each tolerance contributes", *_contributions(thing)),
        *section("Where each tolerance acts", *_where(thing)),
    )


def _where(thing: ErrorBudget) -> Sheet:
    causes = [cause_of(thing, at) for at in range(len(thing.tolerances))]
    return columns_of(
        {
            "tolerance": thing.stack.labels,
            "fixed in": [one["frame"] for one in causes],
            "orders": [", ".join(brief(order) for order in one["orders"][:4]) or _NONE for one in causes],
            "limits": [_ends(one["lower_limit"], one["upper_limit"]) for one in causes],
            "p-p of 1 unit, arcsec": [one["peak_to_peak_per_unit_arcsec"] for one in causes],
        }
    )


def _ends(low: float | None, high: float | None) -> str:
    return "within the width" if low is None or high is None else f"{brief(low)} to {brief(high)}"


def _yield_at(drawn: VirtualUnits, limit: Any | None) -> str:
    if limit is None:
        return ""
    size = units.named_core("limit", limit, "angle")
    share, low, high = (100 * getattr(drawn.yield_at(size), name) for name in ("value", "low", "high"))
    return f"Yield at {size / ARCSEC:g} arcsec peak-to-peak: {share:.4g} % ({low:.4g} to {high:.4g})."


def _at_load(thing: ErrorBudget) -> Sheet:
    """Yields at the load, the worst parts of the closed form solved there, and what each tolerance makes."""
    loaded = thing.at_load
    if loaded is None:
        return ()
    worst = [
        f"{one.limit.label} {with_unit(size, 'angle')}"
        for one, size in zip(loaded.verified.limits, loaded.worst_parts, strict=True)
        if size is not None
    ]
    every = [(one.limit.label, indices) for one, indices in zip(loaded.verified.limits, loaded.shares, strict=True)]
    told = [(label, indices) for label, indices in every if indices is not None]
    order = np.argsort(-np.max([indices.total for _, indices in told], axis=0)).tolist() if told else []
    labels = [entry.label for entry in thing.closed.contributions]
    shares = {
        label: [_index(i.total[e], i.total_low[e], i.total_high[e], effect="wave") for e in order] for label, i in told
    }
    return (
        *yield_sheet(loaded.verified, loaded.closed_form),
        *line(f"The worst parts of the closed form make, at the load: {', '.join(worst)}." if worst else ""),
        *(columns_of({"Sobol index, total, at the load": [labels[e] for e in order], **shares}) if told else ()),
    )


@sheet.register
def _of_allocation(thing: Allocation) -> Sheet:
    loaded, check = thing.verified is not None, thing.closed_form
    stages, _ = _shown(thing, "stage")
    found, _ = _shown(thing)
    per = "% of all limits" if loaded else "arcsec"
    more = "1 % more of all limits" if loaded else "One arcsec more"
    binds = "The limit holds some widths." if "limit" in thing.held_by else "Bounds and grades alone hold the widths."
    strong = f"Cost {brief(thing.cost_before)} → {brief(thing.cost)}"
    low, high = check.low / ARCSEC, check.high / ARCSEC
    alike = (
        "" if thing.uniform_cost is None else f"{brief(thing.uniform_cost)}, all widths scaled alike to the same yield"
    )
    upper = ", upper end of its interval" if thing.kind == "yield" else ""
    value = f"{limited_by(thing)}{upper}, {'of the limits' if loaded else 'arcsec'}"
    return (
        *title("Allocation", f"least cost {within(thing)}"),
        Sentence(f"{strong}. {binds}", strong=strong),
        *grid(("", "before", "allocated"), [("cost", *stages["total_cost"]), (value, *stages["value"])]),
        *line(f"For comparison: {alike}." if alike else ""),
        *section("At the load, contacts that open included", *(yield_sheet(thing.verified) if thing.verified else ())),
        *section(
            "Widths and costs",
            *columns_of(
                {
                    "tolerance": found["tolerance"],
                    "width before": found["width_before"],
                    "allocated": found["width"],
                    "unit": found["unit"],
                    "times": [b / a for a, b in zip(found["width_before"], found["width"], strict=True)],
                    "cost before": found["cost_before"],
                    "cost": found["cost"],
                    "held by": [_held(*pair) for pair in zip(_padded(thing), thing.grades, strict=True)],
                }
            ),
            *line(f"{more} would save {brief(thing.shadow_price)}." if thing.shadow_price is not None else ""),
            *grid((f"to tighten first (cost of 1 {per} gained)", "cost"), _rates(thing.tighten_first, "tighten")),
            *grid((f"to relax first (cost saved by 1 {per} given up)", "saved"), _rates(thing.relax_first, "relax")),
        ),
        *section(
            "How good it is",
            *line(f"{thing.proof}{'' if thing.gap is None else f'; the gap is {100 * thing.gap:.2g} % of the cost'}."),
            *line(
                f"Closed form, contacts closed: P{100 * check.level:g} of the peak-to-peak "
                f"{_angle(check.quantile)} ({brief(low)} to {brief(high)}), {check.units} units, seed {check.seed}."
            ),
        ),
    )


def _padded(thing: Allocation) -> list[str]:
    """What holds each width, nothing where that is not known."""
    return [*thing.held_by, *[""] * (len(thing.labels) - len(thing.held_by))]


def _held(by: str, grade: str | None) -> str:
    return f"{by}: {grade}" if grade else by


def _rates(rates: Sequence[Rate], which: str) -> list[tuple[str, Any]]:
    values = [(rate.label, getattr(rate, which)) for rate in rates]
    return [(label, "the width does not matter" if math.isinf(value) else value) for label, value in values]


@sheet.register
def _of_stack(thing: Stack) -> Sheet:
    headed = title("Stack", count_of(len(thing.labels), "tolerance"), count_of(len(thing.components), "component"))
    return headed + _columns(thing, "tolerance", "width", "unit", "distribution", "correlation")


@sheet.register
def _of_tolerance(thing: Tolerance) -> Sheet:
    names = ("width", "unit", "distribution", "correlation", "random_phase", "fixed")
    return title("Tolerance", thing.label) + _columns(thing, *names)


@sheet.register(list)
@sheet.register(tuple)
def _of_row(thing: Sequence[Any]) -> Sheet:
    """Effects, tolerances, points of a front or efficiencies, as the columns of their table."""
    listed = _columns(thing)
    count = sum(len(block.rows) for block in listed if isinstance(block, Listing))
    return title(described(thing).kind, count_of(count, "row")) + listed
