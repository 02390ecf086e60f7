"""Every kind of result as a sheet: title, small tables, lines and notes, which a notebook shows, a terminal prints.

Which columns of a result's table are shown, and under which words, is said here; their values and units come from
`kinds`.  `as_html` and `as_text` are the two ways to set a sheet, and every text is escaped there.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import singledispatch
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.errors import InputError
from rverror.base.numbers import at_input_speed, brief, count_of, way, with_unit
from rverror.base.text import describe, joined
from rverror.base.units import ARCSEC
from rverror.compensation.outcome import Compensation
from rverror.diagnosis.result import Diagnosis
from rverror.dynamics.at_speed import CRITICAL, PULLED, SpeedResponse
from rverror.dynamics.natural_modes import Modes
from rverror.dynamics.running_up import RunUp
from rverror.geartrain.mechanism import OUTPUTS, Drive, Reducer
from rverror.life.result import Changed, RunsCompared, Trend
from rverror.lots.of_drives import DriveLot
from rverror.lots.result import Interval, Lot, MadeBy, Shift
from rverror.model.asked import Equilibrium, Influence
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.model.ends import BENCH_DIMENSIONS, ENCODER_DIMENSIONS
from rverror.runs.measurement import Run
from rverror.runs.measuring_chain import uncertainty_of
from rverror.runs.order_table import OrderTable
from rverror.statics.duty import DutyEfficiency, duty_words
from rverror.statics.friction import Efficiency, Hysteresis
from rverror.statics.hertz import ContactPressure
from rverror.statics.rigidity import TorsionCurve
from rverror.statics.worn_contacts import Wear
from rverror.tolerances.allocation import Allocation
from rverror.tolerances.closed_form import Budget
from rverror.tolerances.full_budget import ErrorBudget
from rverror.tolerances.sampling import Size, VirtualUnits
from rverror.tolerances.stacking import Stack, Tolerance
from rverror.views.bench_report import BESIDE
from rverror.views.budget_report import SIZES, limited_by, within, worst_of
from rverror.views.by_order import beside
from rverror.views.html import escaped, table
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
from rverror.views.yield_report import LEVELS

#: Rows that a table shows before it says how many more there are.
MOST_ROWS = 24

_NONE = "–"
_WIDEST = 36  # letters of a fact's name or a text cell that others are lined up with


# --- pieces -----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Title:
    """Kind of result, and what is told of it in a few words."""

    kind: str
    rest: tuple[str, ...]


@dataclass(frozen=True)
class Sentence:
    """A sentence; a strong one is read first."""

    text: str
    strong: str = ""


@dataclass(frozen=True)
class Listing:
    """Table of texts and numbers."""

    heads: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]

    def cells(self) -> list[list[str]]:
        """Rows as texts, as many as are shown."""
        return [[_cell(value) for value in row] for row in self.rows[:MOST_ROWS]]

    def flush(self) -> list[int]:
        """Columns of numbers alone, which are set flush right."""
        numbers = (float, int, _Interval)
        return [at for at in range(len(self.heads)) if all(isinstance(row[at], numbers) for row in self.rows)]

    def more(self) -> str:
        """How many rows are not shown."""
        left = len(self.rows) - MOST_ROWS
        return f"and {left} more" if left > 0 else ""


@dataclass(frozen=True)
class Facts:
    """Names and texts, one under another."""

    facts: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class Notes:
    """What was noticed; folded away where that can be."""

    notes: tuple[str, ...]


Block = Title | Sentence | Listing | Facts | Notes
Sheet = tuple[Block, ...]


class _Interval(tuple[float, float]):
    """Ends of an interval."""

    __slots__ = ()


def _title(kind: str, name: str, rest: str = "") -> Sheet:
    return (Title(kind, tuple(text for text in (name, rest) if text)),)


def _line(text: str) -> Sheet:
    return (Sentence(text),)


def _grid(heads: Sequence[str], rows: Iterable[Sequence[Any]]) -> Sheet:
    listed = tuple(tuple(row) for row in rows)
    return (Listing(tuple(heads), listed),) if listed else ()


def _beside(columns: Mapping[str, Iterable[Any]]) -> Sheet:
    """Listing of columns by their heads."""
    return _grid(list(columns), zip(*columns.values(), strict=True))


def _notes(notes: Sequence[str]) -> Sheet:
    return (Notes(tuple(notes)),) if notes else ()


def _facts(facts: Mapping[str, str]) -> Sheet:
    """Those without text are left out."""
    return (Facts(tuple((name, text) for name, text in facts.items() if text)),)


def _cell(value: Any) -> str:
    if isinstance(value, _Interval):
        if any(math.isnan(end) for end in value):
            return "not determined"
        return f"{_number(value[0])} to {_number(value[1])}"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return _number(value) if isinstance(value, (int, float)) else str(value)


def _number(value: float) -> str:
    if math.isnan(value):
        return _NONE
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    return brief(float(value))


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
    return _beside({head.replace("_", " "): found[name] for name, head in heads.items()})


def _effects(found: Mapping[str, list[Any]]) -> list[str]:
    """Names of the effects in the rows of a table."""
    return [f"{key} ({inside})" if inside else key for key, inside in zip(found["key"], found["indices"], strict=True)]


def _intervals(low: Sequence[float], high: Sequence[float]) -> list[_Interval]:
    return [_Interval(ends) for ends in zip(low, high, strict=True)]


# --- the two ways to set a sheet --------------------------------------------------------------------------------------


def as_html(blocks: Sheet) -> str:
    """Sheet as HTML without script, links or colours of its own."""
    return "\n".join(_html_of(block) for block in blocks)


def _html_of(block: Block) -> str:
    match block:
        case Title():
            return f"<p>{', '.join([f'<strong>{escaped(block.kind)}</strong>', *map(escaped, block.rest)])}</p>"
        case Sentence(strong=""):
            return _soft(block.text)
        case Sentence():
            before, _, after = block.text.partition(block.strong)
            return f"<p>{escaped(before)}<strong>{escaped(block.strong)}</strong>{escaped(after)}</p>"
        case Listing():
            rows = [[escaped(cell) for cell in row] for row in block.cells()]
            more = _soft(block.more()) if block.more() else ""
            return table(block.heads, rows, numbers=block.flush()) + more
        case Facts():
            facts = (
                f'<tr><th scope="row">{escaped(name)}</th><td>{escaped(text)}</td></tr>' for name, text in block.facts
            )
            return "<table><tbody>" + "\n".join(facts) + "</tbody></table>"
        case Notes():
            listed = "".join(map(_soft, block.notes))
            heading = count_of(len(block.notes), "note")
            return f'<details class="soft"><summary>{heading}</summary>{listed}</details>'


def _soft(text: str) -> str:
    return f'<p class="soft">{escaped(text)}</p>'


def as_text(blocks: Sheet) -> str:
    """Sheet as text that ends with a line end, its tables lined up."""
    lines: list[str] = []
    for block in blocks:
        if isinstance(block, Listing | Facts | Notes):
            lines.append("")
        lines += _text_of(block)
    return joined(lines)


def _text_of(block: Block) -> Iterator[str]:
    match block:
        case Title():
            yield f"{block.kind}: {', '.join(block.rest)}" if block.rest else block.kind
        case Sentence():
            yield block.text
        case Listing():
            rows, flush = [list(block.heads), *block.cells()], block.flush()
            widths = [min(_WIDEST, max(len(row[at]) for row in rows)) for at in range(len(block.heads))]
            for row in rows:
                cells = (
                    cell.rjust(width) if at in flush else cell.ljust(width)
                    for at, (cell, width) in enumerate(zip(row, widths, strict=True))
                )
                yield "  ".join(cells).rstrip()
            if block.more():
                yield block.more()
        case Facts():
            width = min(_WIDEST, max((len(name) for name, _ in block.facts), default=0))
            yield from (f"{name:{width}}  {text}" for name, text in block.facts)
        case Notes():
            yield "Notes"
            yield from (f"  {note}" for note in block.notes)


# --- one entry a kind -------------------------------------------------------------------------------------------------


@singledispatch
def sheet(thing: Any) -> Sheet:
    """Sheet of one kind of result.

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
    return _title("Reducer", thing.name, _ratio(thing)) + _columns(thing, "parameter", "value", "unit")


@sheet.register
def _of_drive(thing: Drive) -> Sheet:
    return _title("Drive", thing.name, _ratio(thing)) + _grid(("shaft", "turns per output turn"), thing.shafts.items())


def _ratio(unit: Reducer | Drive) -> str:
    turned = f", {unit.output} as output" if isinstance(unit, Reducer) and unit.output != OUTPUTS[0] else ""
    return f"R = {unit.ratio:.8g}{turned}"


@sheet.register
def _of_effect(thing: Effect) -> Sheet:
    return _title("Effect", describe(thing.key, thing.indices), thing.origin) + _sizes(thing, 1)


@sheet.register
def _of_model(thing: Model) -> Sheet:
    title = _title("Model", thing.name, f"{thing.mechanism.name}, {_ratio(thing.mechanism)}")
    stated = ((thing.bench, BENCH_DIMENSIONS), (thing.encoders, ENCODER_DIMENSIONS))
    ends = {
        f"bench: {name.replace('_', ' ')}": _told_of_bench(value, dimensions[name])
        for things, dimensions in stated
        for name, value in things.given().items()
    }
    return (
        title + (_sizes(thing, 0) if thing.effects else _line("no effect is declared")) + (_facts(ends) if ends else ())
    )


def _told_of_bench(value: float, dimension: str) -> str:
    return brief(value) if dimension == "number" else with_unit(value, dimension)


def _sizes(thing: Model | Effect, first: int) -> Sheet:
    """Parameters of effects, from a column on."""
    found, _ = _shown(thing)
    sigmas = ["exact" if math.isnan(sigma) else sigma for sigma in found["uncertainty"]]
    rows = zip(_effects(found), found["parameter"], found["value"], sigmas, found["unit"], strict=True)
    return _grid(("effect", "parameter", "size", "1 sigma", "unit")[first:], (row[first:] for row in rows))


@sheet.register
def _of_run(thing: Run) -> Sheet:
    table = described(thing)
    angles = {"input angle": thing.input_angle, "output angle": thing.output_angle}
    facts = {
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
    return _title("Run", thing.path) + _facts(facts) + _notes(thing.notes)


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
    facts = {"conditions": str(len(thing.cases))}
    columns_shown: dict[str, list[Any]] = {}
    senses = dict.fromkeys(way(case.condition.direction) for case in thing.cases)
    facts["direction"] = " and ".join(senses)
    if len(senses) > 1:
        columns_shown["direction"] = [way(sense) for sense in found["direction"]]
    for name, dimension in _CONDITIONS.items():
        each = [getattr(case.condition, name) for case in thing.cases for _ in case.orders]
        values = [math.nan if value is None else units.to_display(value, dimension) for value in each]
        unit, known = units.DISPLAY_UNITS[dimension], sorted(value for value in values if not math.isnan(value))
        heading = name.replace("_", " ")
        if known:
            low, high = brief(known[0]), brief(known[-1])
            facts[heading] = f"{low} {unit}" if low == high else f"{low} to {high} {unit}"
        if known and (low != high or len(known) < len(values)):  # what is the same in all rows is said above
            columns_shown[f"{heading}, {unit}"] = values
    for name in ("order", "amplitude", "phase", "sigma"):
        if name in found:
            columns_shown[f"{name}, {told[name]}" if told[name] else name] = found[name]
    facts |= {
        "orders": ", ".join(brief(order) for order in sorted(set(found["order"]))),
        "zero": _zero(thing.index),
        **{f"# {key}": value for key, value in thing.metadata.items()},
    }
    return _title("Order table", thing.path) + _facts(facts) + _beside(columns_shown) + _notes(thing.notes)


@sheet.register
def _of_influence(thing: Influence) -> Sheet:
    matrix = thing.matrix
    rows = zip(thing.labels, np.ptp(matrix, axis=1).tolist(), matrix.mean(axis=1).tolist(), strict=True)
    heads = ("parameter", "peak-to-peak", "mean")
    note = f"rad of output per {units.CORE_UNITS[source(thing.key).parameters[0].dimension]} of each parameter"
    return _title("Influence", f"{thing.key}, {count_of(matrix.shape[1], 'angle')}") + _grid(heads, rows) + _line(note)


@sheet.register
def _of_equilibrium(thing: Equilibrium) -> Sheet:
    error, pins = thing.transmission_error, thing.loaded_pins
    facts = {
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
    return _title("Equilibrium", count_of(error.size, "angle")) + _facts(facts)


def _angle(value: float) -> str:
    return with_unit(value, "angle")


@sheet.register
def _of_torsion(thing: TorsionCurve) -> Sheet:
    found, angle = described(thing).variables, thing.angle / ARCSEC
    spread = _intervals(angle.min(axis=1).tolist(), angle.max(axis=1).tolist())
    rows = zip(found["torque"].shown(display=True).tolist(), angle.mean(axis=1).tolist(), spread, strict=True)
    where = count_of(angle.shape[1], "angle") + " of the output"
    return _title("Torsion curve", where) + _grid(("torque, N*m", "turn, arcsec", "over the angles, arcsec"), rows)


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
    return _title("Hysteresis", where) + _beside(columns_shown) + _line("turns are means over the angles")


@sheet.register
def _of_efficiency(thing: Efficiency) -> Sheet:
    at_input, change = thing.input_torque, thing.error_change
    mean, least, most = (brief(100 * share) for share in (thing.mean, thing.efficiency.min(), thing.efficiency.max()))
    facts = {
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
    notes = ["self-locking: at some angle the output cannot drive it"] if thing.self_locking else []
    return (
        _title("Efficiency", where, count_of(thing.theta.size, "angle")) + _facts(facts) + _beside(lost) + _notes(notes)
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
    return _title("Contact pressure", count_of(thing.theta.size, "angle")) + _beside(columns_shown) + _line(note)


@sheet.register
def _of_duty_efficiency(thing: DutyEfficiency) -> Sheet:
    facts = {"efficiency of the cycle": f"{brief(100 * thing.mean)} %"}
    facts |= {f"lost to {part.replace('_', ' ')}": f"{brief(power / 1e3)} W" for part, power in thing.losses.items()}
    facts |= {where: with_unit(getattr(thing, where), "temperature") for where in ("ambient", "housing", "inside")}
    rows = _columns(thing, "torque", "input_speed", "duty_hours", "efficiency", "input_torque", "drag")
    return _title("Duty", f"the {thing.phases[0].drives} drives") + _facts(facts) + rows


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
    return _title("Wear", duty_words(thing.duty)) + _beside({head: found[name] for head, name in heads.items()})


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
    notes = []
    if thing.of_sun_support.any():
        notes.append(
            "a mode of the sun's support is none of the machine: that spring only gives a floating sun a place"
        )
    if thing.estimated:
        notes.append(f"estimated from the geometry, to some 30 %: {', '.join(thing.estimated)}")
    return _title("Modes", where) + _beside(columns_shown) + _notes(notes)


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
        _title("Error against speed", where)
        + _beside(columns_shown)
        + _line("amplitudes by order in arcsec; the first line is the equilibrium's, at a crawl")
        + _critical(thing)
        + _notes(_cautions(thing))
    )


def _critical(thing: SpeedResponse) -> Sheet:
    critical, _ = _shown(thing, "critical")
    if not thing.critical_speeds:
        return _line(f"no critical speed: no order peaks at {CRITICAL:g} times its amplitude at a crawl")
    names = {
        "speed": "critical speed, rpm",
        "order": "order",
        "amplitude": "amplitude, arcsec",
        "growth": "times that at a crawl",
        "frequency": "natural frequency, Hz",
    }
    return _beside({head: critical[name] for name, head in names.items()})


def _cautions(thing: SpeedResponse) -> list[str]:
    notes = []
    for name, share in thing.pulled.items():
        over = thing.speed[share > PULLED]
        if over.size:
            low, high = (units.to_display(end, "angular_speed") for end in (over.min(), over.max()))
            between = (
                f"at {brief(low)} rpm"
                if over.size == 1
                else f"at {over.size} speeds of {brief(low)} to {brief(high)} rpm"
            )
            notes.append(
                f"closed {name} would have to pull {between}, by up to {brief(100 * float(share.max()))} % of their "
                "force: they open, and the error there is no prediction"
            )
    if any(one.of_sun_support for one in thing.critical_speeds):
        notes.append("a peak at a mode of the sun's support is none of the machine")
    return notes


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
    notes = []
    if thing.output_torque.min() < 0:
        first = thing.time[np.argmax(thing.output_torque < 0)]
        notes.append(
            f"from {brief(float(first))} s on contacts would have to pull: they open, and the error is no prediction"
        )
    where = f"{with_unit(thing.torque, 'torque')}, {way(thing.direction)}, {brief(float(np.ptp(thing.time)))} s"
    return (
        _title("Run-up", where)
        + _beside(columns_shown)
        + _line(f"peak-to-peak {brief(spread)} arcsec, of it vibration {brief(shaken)}, windup {brief(twisted)}")
        + _line(f"the output carries {low} to {high}")
        + _notes(notes)
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


@sheet.register
def _of_diagnosis(thing: Diagnosis) -> Sheet:
    unit = units.DISPLAY_UNITS[thing.quantity]
    noise = units.to_display(thing.noise_rms, thing.quantity)
    stages, _ = _shown(thing, "stage")
    labels = ["as declared", "declared sizes refitted", *(["with what was added"] if thing.added else [])]
    added, _ = _shown(thing, "added")
    elastic, _ = _shown(thing, "elastic")
    lines, _ = _shown(thing, "unexplained")
    fits = (
        frames or "; ".join(beside(thing.declared.mechanism, order)) or "no frame of this drive"
        for order, frames in zip(lines["order"], lines["frames"], strict=True)
    )
    verdict, names = thing.verdict.replace("_", " "), dict.fromkeys(trace.name for trace in thing.traces)
    tried = f"{len(thing.added)} added of {count_of(thing.tried, 'candidate')}"
    return (
        *_title("Diagnosis", thing.declared.name or thing.declared.mechanism.name),
        Sentence(f"Verdict: {verdict}; {tried}", strong=verdict),
        *_beside(
            {
                f"residual, {unit}": [*labels, "noise"],
                "rms": [*stages["rms"][: len(labels)], noise],
                "peak-to-peak": [*stages["peak_to_peak"][: len(labels)], math.nan],
                "held-out rms": [*stages["heldout_rms"][: len(labels)], math.nan],
            }
        ),
        *_beside(
            {
                "added": _once(_effects(added), added["number"]),
                "parameter": added["parameter"],
                "size": added["value"],
                "95 % interval": _intervals(added["low"], added["high"]),
                "unit": added["unit"],
            }
        ),
        *map(Sentence, _about_added(thing)),
        *_beside(_told(elastic)),
        *_not_told(thing),
        *_beside(
            {
                "unexplained order": lines["order"],
                f"amplitude, {unit}": lines["amplitude"],
                f"95 % interval, {unit}": _intervals(lines["low"], lines["high"]),
                "fits": fits,
            }
        ),
        *(_line("Runs: " + ", ".join(names)) if names else ()),
        *_notes(thing.notes),
    )


def _told(elastic: Mapping[str, Sequence[Any]]) -> dict[str, list[Any]]:
    """Stiffness, backlash and contact law of which the runs say something."""
    shown = {
        "stiffness, backlash, contact law": elastic["name"],
        "declared": elastic["declared"],
        "fitted": elastic["value"],
        "95 % interval": _intervals(elastic["low"], elastic["high"]),
        "unit": elastic["unit"],
    }
    return {name: list(itertools.compress(row, elastic["told"])) for name, row in shown.items()}


def _not_told(thing: Diagnosis) -> Sheet:
    rest = ", ".join(elastic.name for elastic in thing.elastic if not elastic.told)
    return _line(f"Stiffness, backlash and contact law not told by these runs: {rest}") if rest else ()


def _once(names: Sequence[str], numbers: Sequence[int]) -> list[str]:
    """Names, each only in the first of the rows of its number."""
    return [name if at == 0 or numbers[at - 1] != numbers[at] else "" for at, name in enumerate(names)]


def _about_added(thing: Diagnosis) -> Iterable[str]:
    for added in thing.added:
        name = describe(added.effect.key, added.effect.indices)
        if added.indistinguishable:
            others = ", ".join(describe(key, indices) for key, indices in added.indistinguishable)
            yield f"These runs cannot tell {name} from: {others}"
        yield from (f"{name}: {note}" for note in added.notes)


_BENCH_REPEATS = "The bench's own error repeats as the gears' does, so the table holds it, and the output keeps it."


def _of_bench(sizes: Sequence[float]) -> dict[str, Sequence[float]]:
    """Column of the bench's uncertainty, where one is stated."""
    return {f"± {BESIDE}": sizes} if sizes else {}


@sheet.register
def _of_compensation(thing: Compensation) -> Sheet:
    stages, _ = _shown(thing, "stage")
    orders, _ = _shown(thing, "order")
    unseen, _ = _shown(thing, "unseen")
    verdict = f"{count_of(len(thing.orders), 'order')} compensated" if thing.worth else "nothing to compensate"
    bench = uncertainty_of(thing.model.encoders, thing.model.mechanism.ratio)
    of_rms = [] if bench is None else [bench.of("rms") / ARCSEC]
    of_orders = [] if bench is None else [bench.of_order(one.order) / ARCSEC for one in thing.orders]
    return (
        *_title("Compensation", thing.model.name or thing.model.mechanism.name),
        Sentence(verdict),
        *_beside(
            {
                "error of data left out, arcsec": ["without", "with"],
                "rms": stages["rms"],
                **_of_bench(2 * of_rms),
                "one more, 95 %": _intervals(stages["low"], stages["high"]),
            }
        ),
        *_beside(
            {
                "seen by no fit, rms, arcsec": unseen["file"],
                "without": unseen["before"],
                "with": unseen["after"],
                **_of_bench(len(thing.unseen) * of_rms),
            }
        ),
        *_beside(
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
        *_notes(thing.notes),
    )


@sheet.register
def _of_trend(thing: Trend) -> Sheet:
    hours = f"{thing.unit}s"
    times = f"{count_of(len(thing.at), 'session')}, {brief(thing.at[0])} to {brief(thing.at[-1])} {hours}"
    heads = ("grows", "parameter", "course", "since", "change", "95 % interval", f"per 1000 {hours}", "95 % interval")
    return (
        *_title("Trend", thing.model, times),
        *(_line(f"Conditions: {'; '.join(thing.conditions)}") if thing.conditions else ()),
        Sentence(*trend_verdict(thing)),
        *_grid(
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
        *(_line(remaining_words(thing)) if thing.remaining else ()),
        *_notes(thing.notes),
    )  # fmt: skip


@sheet.register
def _of_compared(thing: RunsCompared) -> Sheet:
    return (
        *_title("Runs compared", "; ".join(thing.conditions)),
        Sentence(*compared_verdict(thing)),
        *_grid(
            ("order", "condition", "before, arcsec", "after, arcsec", "95 % interval", "chance"),
            [
                (one.order, one.condition, one.before / ARCSEC, *_sized(one.interval, "angle"), one.chance)
                for one in thing.orders
            ],
        ),
        *_jumped((), thing.changed),
        *map(Sentence, life_rivals(thing.changed)),
        *_notes(thing.notes),
    )


def _sized(size: Interval, dimension: str, times: float = 1.0) -> tuple[float, _Interval]:
    """Size and interval in the unit for people."""
    value, low, high = (times * units.to_display(x, dimension) for x in (size.value, size.low, size.high))
    return value, _Interval((low, high))


def _jumped(heads: tuple[str, ...], changed: Sequence[Changed]) -> Sheet:
    """Causes that are another size at once, behind the time of each where there is a head for it."""
    return _grid(
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
        *_title("Lot", thing.model, size_of(thing)),
        *(_line(f"Conditions: {'; '.join(thing.conditions)}") if thing.conditions else ()),
        Sentence(said, strong=strong),
        *_made_by([one for one in thing.processes if one.above_zero]),
        *_at_most([one for one in thing.processes if not one.above_zero]),
        *map(Sentence, not_told_apart(thing)),
        *(_line(unseen) if unseen else ()),
        *_shifted(("systematic error",), [((), one) for one in thing.shifts]),
        *_grid(
            ("stiffness", "times what is stated", "95 % interval"),
            [(name, one.value, _Interval((one.low, one.high))) for name, one in thing.stiffness.items()],
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
        *(_line(ruled_out) if ruled_out else ()),
        *_limits(thing.processes),
        *_beside(_foretold(thing)),
        *(_line(COME) if thing.differences or thing.changes else ()),
        *_notes(thing.notes),
    )


@sheet.register
def _of_drive_lot(thing: DriveLot) -> Sheet:
    shared = ", ".join(str(one.order) for one in thing.orders if one.shared) or "none"
    strong = f"Order in which the units' phases agree: {shared}"
    units_off = count_of(len({one.serial for one in thing.own}), "unit")
    return (
        *_title("Lot of drives", thing.model, count_of(len(thing.serials), "unit")),
        Sentence(f"{strong}; {units_off} off the others; pairs nearly equal: {len(thing.pairs)}", strong=strong),
        *_grid(
            ("order", "condition", "least, arcsec", "median", "most", "spread", "mean wave", "95 % interval",
             "phase, deg", "chance"),
            [(one.order, one.condition, *(x / ARCSEC for x in (one.least, one.median, one.most, one.spread)),
              *_sized(one.mean, "angle"), math.degrees(one.phase), one.chance) for one in thing.orders],
        ),
        *_grid(
            ("unit that is off", "order", "condition", "amplitude, arcsec", "off by", "standard deviations", "chance"),
            [(o.serial, o.order, o.condition, o.amplitude / ARCSEC, o.difference / ARCSEC, o.distance, o.chance)
             for o in thing.own],
        ),
        *_grid(
            ("nearly equal", "and", "difference, arcsec rms", "of usual pairs", "chance"),
            [(*one.serials, one.difference / ARCSEC, one.usual / ARCSEC, one.chance) for one in thing.pairs],
        ),
        *_notes(thing.notes),
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
    return _beside(shown)


def _at_most(processes: Sequence[MadeBy]) -> Sheet:
    """Processes that are not told from none, and what they are below."""
    told = [(one, one.deviation) for one in processes if one.deviation is not None]
    return _grid(
        ("not above zero", "standard deviation below", "unit"),
        [
            (process_name(one), units.to_display(size.high, one.dimension), units.DISPLAY_UNITS[one.dimension])
            for one, size in told
        ],
    )


def _limits(processes: Sequence[MadeBy]) -> Sheet:
    """What one part has to be off to be found."""
    return _grid(
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
    return _beside(found)


def _sizes_of(sizes: Iterable[tuple[Interval | None, str]], name: str) -> dict[str, list[Any]]:
    """Columns of sizes with their intervals, each in the unit of its dimension."""
    found: dict[str, list[Any]] = {name: [], "95 % interval": [], "unit": []}
    for size, dimension in sizes:
        each = (math.nan,) * 3 if size is None else (size.value, size.low, size.high)
        value, low, high = (units.to_display(one, dimension) for one in each)
        found[name].append(value)
        found["95 % interval"].append(_Interval((low, high)))
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
        "95 % interval": [_Interval((one.quantile.low / ARCSEC, one.quantile.high / ARCSEC)) for one in found],
        "mean, measured": [one.seen[0] / ARCSEC for one in found],
        "P95, measured": [one.seen[1] / ARCSEC for one in found],
    }


def _contributions(thing: Budget | ErrorBudget) -> Sheet:
    """Tolerances, the largest share first."""
    found, _ = _shown(thing)
    shown = {
        "tolerance": found["tolerance"],
        "width": found["width"],
        "unit": found["unit"],
        "share of variance, %": [100 * share for share in found["share"]],
        "p-p alone, mean, arcsec": found["mean_peak_to_peak"],
        "p-p alone, worst, arcsec": found["worst_peak_to_peak"],
        "part of worst case, arcsec": found["worst_part"],
    }
    if "sobol_total" in found:
        shares = zip(*(found[f"sobol_total{end}"] for end in ("", "_low", "_high")), found["effect"], strict=True)
        shown["Sobol total ± 95 %"] = [
            f"{total:.2f} ± {(high - low) / 2:.2f}" if effect == "wave" else "" for total, low, high, effect in shares
        ]
    rows = list(zip(*shown.values(), strict=True))
    return _grid(list(shown), sorted(rows, key=lambda row: -row[3]))


@sheet.register
def _of_budget(thing: Budget) -> Sheet:
    facts = {
        "worst-case peak-to-peak": _angle(thing.worst.peak_to_peak),
        "root sum of squares of single peak-to-peaks": _angle(thing.rss),
        "expected rms": _angle(thing.rms),
        "offset": f"{_angle(thing.offset_mean)}, standard deviation {_angle(thing.offset_deviation)}",
    }
    title = _title("Budget in closed form", count_of(len(thing.contributions), "tolerance"))
    return title + _facts(facts) + _contributions(thing)


def _quantiles(drawn: VirtualUnits, worst: Mapping[Size, float]) -> Sheet:
    """Sizes of the output error at several shares of the units, with what no unit exceeds where that is known."""
    rows = []
    for size, name, _ in SIZES:
        row: list[Any] = [name]
        for level in LEVELS:
            found = drawn.quantile(level, size)
            row += [found.value / ARCSEC, _Interval((found.low / ARCSEC, found.high / ARCSEC))]
        rows.append([*row, *([worst[size] / ARCSEC] if worst else [])])
    heads = [text for level in LEVELS for text in (f"P{level * 100:g}", "95 % interval")]
    return _grid(["size, arcsec", *heads, *(["worst case"] if worst else [])], rows)


@sheet.register
def _of_virtual_units(thing: VirtualUnits) -> Sheet:
    return _title("Virtual units", f"{thing.count}, {thing.draws}, seed {thing.seed}") + _quantiles(thing, {})


@sheet.register
def _of_error_budget(thing: ErrorBudget) -> Sheet:
    bounds = {size: worst_of(thing.closed, size) for size, _, _ in SIZES}
    drawn = f"{thing.units.count} virtual units, seed {thing.units.seed}"
    at_load: Sheet = ()
    if thing.at_load is not None:
        at_load = _yields(thing)
    where = f"{way(thing.direction)}{at_input_speed(thing.stack.speed)}, {drawn}"
    title = _title("Error budget", thing.model.name or thing.model.mechanism.name, where)
    return title + _quantiles(thing.units, bounds) + at_load + _contributions(thing)


def _yields(thing: ErrorBudget | Allocation) -> Sheet:
    """Limits at the load: quantiles of what the units have, and yields."""
    heads = (
        "limit_value",
        *(f"p{100 * level:g}" for level in LEVELS),
        "limit_unit",
        "yield",
        "yield_low",
        "yield_high",
    )
    found, _ = _shown(thing, "limit_at_load")
    named = {"at the load": found["limit_at_load"]} | {head.replace("_", " "): found[head] for head in heads}
    return _beside(named)


@sheet.register
def _of_allocation(thing: Allocation) -> Sheet:
    loaded = thing.verified is not None
    stages, _ = _shown(thing, "stage")
    found, _ = _shown(thing)
    grades = (grade or ("fixed" if fixed else "") for grade, fixed in zip(found["grade"], thing.fixed, strict=True))
    gap = "" if thing.gap is None else f"; the gap is {100 * thing.gap:.2g} % of the cost"
    return (
        _title("Allocation", f"least cost {within(thing)}")
        + _grid(
            ("", "before", "allocated", "unit"),
            [
                ("cost", *stages["total_cost"], ""),
                (limited_by(thing), *stages["value"], "of the limits" if loaded else "arcsec"),
            ],
        )
        + (_yields(thing) if loaded else ())
        + _beside(
            {
                "tolerance": found["tolerance"],
                "width before": found["width_before"],
                "allocated": found["width"],
                "unit": found["unit"],
                "grade": grades,
                "cost before": found["cost_before"],
                "cost": found["cost"],
            }
        )
        + _line(f"How good it is: {thing.proof}{gap}.")
    )


@sheet.register
def _of_stack(thing: Stack) -> Sheet:
    title = _title("Stack", count_of(len(thing.labels), "tolerance"), count_of(len(thing.components), "component"))
    return title + _columns(thing, "tolerance", "width", "unit", "distribution", "correlation")


@sheet.register
def _of_tolerance(thing: Tolerance) -> Sheet:
    names = ("width", "unit", "distribution", "correlation", "random_phase", "fixed")
    return _title("Tolerance", thing.label) + _columns(thing, *names)


@sheet.register(list)
@sheet.register(tuple)
def _of_row(thing: Sequence[Any]) -> Sheet:
    """Effects, tolerances, points of a front or efficiencies, as the columns of their table."""
    listed = _columns(thing)
    count = sum(len(block.rows) for block in listed if isinstance(block, Listing))
    return _title(described(thing).kind, count_of(count, "row")) + listed
