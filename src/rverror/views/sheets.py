"""Every kind of result as a sheet: title, small tables, lines and notes, which a notebook shows, a terminal prints.

One description a kind; `as_html` and `as_text` are the two ways to set it.  Every text is escaped there.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import singledispatch
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.errors import InputError
from rverror.base.numbers import brief, count_of, way, with_unit
from rverror.base.text import describe, joined
from rverror.base.units import ARCSEC
from rverror.diagnosis.result import Diagnosis
from rverror.geartrain.mechanism import Drive, Reducer
from rverror.model.catalogue import source
from rverror.model.compose import Influence
from rverror.model.effects import Effect, Model
from rverror.runs.measurement import Run
from rverror.statics.loaded_state import Equilibrium
from rverror.statics.rigidity import TorsionCurve
from rverror.tolerances.allocation import Allocation
from rverror.tolerances.closed_form import Budget
from rverror.tolerances.control_variate import LEVELS
from rverror.tolerances.full_budget import ErrorBudget
from rverror.tolerances.sampling import Size, VirtualUnits
from rverror.tolerances.sobol import SobolIndices
from rverror.tolerances.stacking import Stack, Tolerance
from rverror.views.budget_report import SIZES, worst_of
from rverror.views.by_order import beside
from rverror.views.html import escaped, table
from rverror.views.tables import NUMBER, columns, described

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
class Grid:
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


Block = Title | Sentence | Grid | Facts | Notes
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
    return (Grid(tuple(heads), listed),) if listed else ()


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


def _arcsec(value: float) -> float:
    return value / ARCSEC


def _optional(value: float | None, dimension: str) -> str:
    return "" if value is None else with_unit(value, dimension)


def _columns(thing: Any, names: Sequence[str], heads: Sequence[str], **options: Any) -> Sheet:
    """Columns of the result's table, in the units in which people read them."""
    found, told = columns(described(thing, **options), display=True)
    known = [_plain(told.get(name, "")) for name in names]
    titles = [f"{head}, {unit}" if unit else head for head, unit in zip(heads, known, strict=True)]
    found["unit"] = [_plain(unit) for unit in found["unit"]]
    return _grid(titles, zip(*(np.asarray(found[name]).tolist() for name in names), strict=True))


def _plain(unit: str) -> str:
    """Unit for people: numbers have none."""
    return "" if unit == NUMBER.core else unit


def _mechanism(unit: Reducer | Drive) -> str:
    return f"{unit.name}, ratio {unit.ratio:.8g}"


# --- the two ways to set a sheet --------------------------------------------------------------------------------------


def as_html(blocks: Sheet) -> str:
    """Sheet as HTML without script, links or colours of its own.

    Parameters
    ----------
    blocks : tuple of Title, Sentence, Grid, Facts or Notes

    Returns
    -------
    str
    """
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
        case Grid():
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
    """Sheet as text, its tables lined up.

    Parameters
    ----------
    blocks : tuple of Title, Sentence, Grid, Facts or Notes

    Returns
    -------
    str
        Ends with a line end.
    """
    lines: list[str] = []
    for block in blocks:
        if isinstance(block, Grid | Facts | Notes):
            lines.append("")
        lines += _text_of(block)
    return joined(lines)


def _text_of(block: Block) -> Iterator[str]:
    match block:
        case Title():
            yield f"{block.kind}: {', '.join(block.rest)}" if block.rest else block.kind
        case Sentence():
            yield block.text
        case Grid():
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

    Parameters
    ----------
    thing : Model, Run, Influence, Equilibrium, TorsionCurve, Diagnosis, Budget, ErrorBudget, VirtualUnits, Allocation
        Or a Reducer, Drive, Effect, Tolerance or Stack, or a list or tuple of which there is a table.

    Returns
    -------
    tuple of Title, Sentence, Grid, Facts or Notes

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
    grid = _columns(thing, ("parameter", "value", "unit"), ("parameter", "value", "unit"))
    return _title("Reducer", thing.name, f"ratio {thing.ratio:.8g}") + grid


@sheet.register
def _of_drive(thing: Drive) -> Sheet:
    rows = [(name, turns) for name, turns in thing.shafts.items()]
    return _title("Drive", thing.name, f"ratio {thing.ratio:.8g}") + _grid(("shaft", "turns per output turn"), rows)


@sheet.register
def _of_effect(thing: Effect) -> Sheet:
    return _title("Effect", describe(thing.key, thing.indices), thing.origin) + _grid(_EFFECT[1:], _sizes(thing, 1))


@sheet.register
def _of_model(thing: Model) -> Sheet:
    title = _title("Model", thing.name, _mechanism(thing.mechanism))
    if not thing.effects:
        return title + _line("no effect is declared")
    return title + _grid(_EFFECT, _sizes(thing, 0))


_EFFECT = ("effect", "parameter", "size", "1 sigma", "unit")


def _sizes(thing: Model | Effect, first: int) -> Iterable[Sequence[Any]]:
    """Parameters of effects, from the first cell of `_EFFECT` that is asked for."""
    found, _ = columns(described(thing), display=True)
    effects = thing.effects if isinstance(thing, Model) else (thing,)
    names = (describe(effect.key, effect.indices) for effect in effects for _ in effect.values)
    sigmas = ("exact" if math.isnan(sigma) else sigma for sigma in found["uncertainty"].tolist())
    rows = zip(names, found["parameter"], found["value"].tolist(), sigmas, found["unit"], strict=True)
    return (row[first:] for row in rows)


@sheet.register
def _of_run(thing: Run) -> Sheet:
    table = described(thing)
    angles = {name: getattr(thing, name) for name in ("input_angle", "output_angle")}
    facts = {
        "samples": str(thing.size),
        "direction": str(table.about["direction"]),
        **{
            name.replace("_", " "): f"{np.degrees(row.min()):.6g} to {np.degrees(row.max()):.6g} deg"
            for name, row in angles.items()
            if row is not None
        },
        "output torque": _optional(thing.torque, "torque"),
        "temperature": _optional(thing.temperature, "temperature"),
        "zero": {"": "aligned, offset of its own", "unknown": "not known"}.get(thing.index, f"shared, {thing.index}"),
        "columns": ", ".join(columns(table)[0]),
        **{f"# {key}": value for key, value in thing.metadata.items()},
    }
    return _title("Run", thing.path) + _facts(facts) + _notes(thing.notes)


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
        "transmission error, mean": f"{brief(_arcsec(float(error.mean())))} arcsec, windup and lost motion included",
        "transmission error, peak-to-peak": f"{brief(_arcsec(float(np.ptp(error))))} arcsec",
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


@sheet.register
def _of_torsion(thing: TorsionCurve) -> Sheet:
    angle = thing.angle / ARCSEC
    rows = zip(
        (thing.torque / 1e3).tolist(),
        angle.mean(axis=1).tolist(),
        map(_Interval, zip(angle.min(axis=1).tolist(), angle.max(axis=1).tolist(), strict=True)),
        strict=True,
    )
    where = count_of(angle.shape[1], "angle") + " of the output"
    return _title("Torsion curve", where) + _grid(("torque, N*m", "turn, arcsec", "over the angles, arcsec"), rows)


@sheet.register
def _of_diagnosis(thing: Diagnosis) -> Sheet:
    declared, unit = thing.declared, units.DISPLAY_UNITS[thing.quantity]
    stages = (
        ("as declared", thing.before),
        ("declared sizes refitted", thing.before_refitted),
        *((("with what was added", thing.after),) if thing.added else ()),
    )

    def size(value: float) -> float:
        return units.to_display(value, thing.quantity)

    rows: list[tuple[Any, ...]] = [
        (label, size(rest.rms), size(rest.peak_to_peak), size(rest.heldout_rms)) for label, rest in stages
    ]
    rows.append(("noise between revolutions", size(thing.noise_rms), math.nan, math.nan))
    tried = f"{len(thing.added)} added of {count_of(thing.tried, 'candidate')}"
    verdict = thing.verdict.replace("_", " ")
    lines = (
        (
            line.order,
            size(line.amplitude),
            _Interval((size(line.low), size(line.high))),
            "; ".join(line.frames or beside(declared.mechanism, line.order)) or "no frame of this drive",
        )
        for line in thing.unexplained
    )
    names = dict.fromkeys(trace.name for trace in thing.traces)
    return (
        *_title("Diagnosis", declared.name or declared.mechanism.name),
        Sentence(f"Verdict: {verdict}; {tried}", strong=verdict),
        *_grid((f"residual, {unit}", "rms", "peak-to-peak", "held-out rms"), rows),
        *_grid(("added", "parameter", "size", "95 % interval", "unit"), _added(thing)),
        *map(Sentence, _about_added(thing)),
        *_grid(("unexplained order", f"amplitude, {unit}", f"95 % interval, {unit}", "fits"), lines),
        *(_line("Runs: " + ", ".join(names)) if names else ()),
        *_notes(thing.notes),
    )


def _added(thing: Diagnosis) -> Iterable[tuple[Any, ...]]:
    for added in thing.added:
        for at, one in enumerate(added.estimates):
            value, low, high = (units.to_display(x, one.dimension) for x in (one.value, one.low, one.high))
            name = describe(added.effect.key, added.effect.indices) if at == 0 else ""
            yield name, one.name, value, _Interval((low, high)), units.DISPLAY_UNITS[one.dimension]


def _about_added(thing: Diagnosis) -> Iterable[str]:
    for added in thing.added:
        name = describe(added.effect.key, added.effect.indices)
        if added.indistinguishable:
            others = ", ".join(describe(key, indices) for key, indices in added.indistinguishable)
            yield f"These runs cannot tell {name} from: {others}"
        yield from (f"{name}: {note}" for note in added.notes)


def _contributions(closed: Budget, indices: SobolIndices | None) -> Sheet:
    """Tolerances, the largest share first."""
    entries = closed.contributions
    heads = ["tolerance", "width", "unit", "share of variance, %"]
    heads += [f"{what}, arcsec" for what in ("p-p alone, mean", "p-p alone, worst", "part of worst case")]
    rows: list[list[Any]] = []
    for at in sorted(range(len(entries)), key=lambda e: -entries[e].share):
        entry = entries[at]
        row: list[Any] = [
            entry.label,
            units.to_display(entry.width, entry.dimension),
            units.DISPLAY_UNITS[entry.dimension],
            100 * entry.share,
            *map(_arcsec, (entry.mean_peak_to_peak, entry.worst_peak_to_peak, entry.worst_part)),
        ]
        if indices is not None:
            half = (indices.total_high[at] - indices.total_low[at]) / 2
            row.append(f"{indices.total[at]:.2f} ± {half:.2f}" if entry.effect == "wave" else "")
        rows.append(row)
    return _grid([*heads, *(["Sobol total ± 95 %"] if indices is not None else [])], rows)


@sheet.register
def _of_budget(thing: Budget) -> Sheet:
    worst = thing.worst
    facts = {
        "worst-case peak-to-peak": with_unit(worst.peak_to_peak, "angle"),
        "root sum of squares of single peak-to-peaks": with_unit(thing.rss, "angle"),
        "expected rms": with_unit(thing.rms, "angle"),
        "offset": f"{with_unit(thing.offset_mean, 'angle')}, standard deviation "
        f"{with_unit(thing.offset_deviation, 'angle')}",
    }
    title = _title("Budget in closed form", count_of(len(thing.contributions), "tolerance"))
    return title + _facts(facts) + _contributions(thing, None)


def _quantiles(drawn: VirtualUnits, worst: Mapping[Size, float]) -> Sheet:
    """Sizes of the output error at several shares of the units, with what no unit exceeds where that is known."""
    rows = []
    for size, name, _ in SIZES:
        row: list[Any] = [name]
        for level in LEVELS:
            found = drawn.quantile(level, size)
            row += [_arcsec(found.value), _Interval((_arcsec(found.low), _arcsec(found.high)))]
        rows.append([*row, *([_arcsec(worst[size])] if worst else [])])
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
    if thing.contact is not None:
        found = thing.contact.peak_to_peak.quantile(0.99)
        value, low, high = (brief(_arcsec(x)) for x in (found.value, found.low, found.high))
        at_load = _line(
            f"At {with_unit(thing.contact.torque, 'torque')}, contacts that open included: P99 of the peak-to-peak "
            f"{value} arcsec, 95 % interval {low} to {high}"
        )
    title = _title("Error budget", thing.model.name or thing.model.mechanism.name, f"{way(thing.direction)}, {drawn}")
    return title + _quantiles(thing.units, bounds) + at_load + _contributions(thing.closed, thing.indices)


@sheet.register
def _of_allocation(thing: Allocation) -> Sheet:
    what = {"worst": "worst-case peak-to-peak", "yield": f"P{100 * thing.level:g} of the peak-to-peak", "rms": "rms"}
    rows = [
        ("cost", thing.cost_before, thing.cost, ""),
        (what[thing.kind], _arcsec(thing.value_before), _arcsec(thing.value), "arcsec"),
    ]
    shown = [map(units.to_display, widths, thing.dimensions) for widths in (thing.widths_before, thing.widths)]
    entries = zip(
        thing.labels,
        *shown,
        (units.DISPLAY_UNITS[dimension] for dimension in thing.dimensions),
        (grade or ("fixed" if fixed else "") for grade, fixed in zip(thing.grades, thing.fixed, strict=True)),
        thing.costs_before,
        thing.costs,
        strict=True,
    )
    heads = ("tolerance", "width before", "allocated", "unit", "grade", "cost before", "cost")
    gap = "" if thing.gap is None else f"; the gap is {100 * thing.gap:.2g} % of the cost"
    return (
        _title("Allocation", f"{what[thing.kind]} within {with_unit(thing.limit, 'angle')}")
        + _grid(("", "before", "allocated", "unit"), rows)
        + _grid(heads, entries)
        + _line(f"How good it is: {thing.proof}{gap}.")
    )


@sheet.register
def _of_stack(thing: Stack) -> Sheet:
    names = ("tolerance", "width", "unit", "distribution", "correlation")
    title = _title("Stack", count_of(len(thing.labels), "tolerance"), count_of(len(thing.components), "component"))
    return title + _columns(thing, names, names)


@sheet.register
def _of_tolerance(thing: Tolerance) -> Sheet:
    names = ("width", "unit", "distribution", "correlation", "random_phase", "fixed")
    heads = [name.replace("_", " ") for name in names]
    return _title("Tolerance", thing.label) + _columns(thing, names, heads)


@sheet.register(list)
@sheet.register(tuple)
def _of_row(thing: Sequence[Any]) -> Sheet:
    """Effects, tolerances or points of a front, as the columns of their table."""
    table = described(thing)
    found, told = columns(table, display=True)
    heads = [f"{name}, {unit}" if (unit := _plain(told.get(name, ""))) else name for name in found]
    rows = list(zip(*(np.asarray(values).tolist() for values in found.values()), strict=True))
    return _title(table.kind, count_of(len(rows), "row")) + _grid([head.replace("_", " ") for head in heads], rows)
