"""Results as small HTML tables for notebooks: what `Viewed` shows where a cell ends with a result.

Colours, letters and background are the notebook's own, so light and dark both fit.  Every text is escaped here.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import singledispatch
from typing import Any

import numpy as np

from rverror import units
from rverror.allocate import Allocation
from rverror.budget import Budget
from rverror.by_order import beside
from rverror.catalogue import source
from rverror.compose import Influence
from rverror.diagnosis import Diagnosis, describe
from rverror.equilibrium import Equilibrium
from rverror.error_budget import ErrorBudget
from rverror.html_report import brief
from rverror.measurement import Run
from rverror.model import Effect, Model
from rverror.reducer import Drive, Reducer
from rverror.rigidity import TorsionCurve
from rverror.sobol import SobolIndices
from rverror.svg import escaped
from rverror.tables import NUMBER, columns, described
from rverror.tolerance import Stack, Tolerance
from rverror.units import ARCSEC
from rverror.virtual_units import Size, VirtualUnits

#: Rows that a table shows before it says how many more there are.
MOST_ROWS = 24

_LEVELS = (0.5, 0.95, 0.99)
_SIZES: Mapping[Size, str] = {
    "peak_to_peak": "peak-to-peak",
    "max": "max |TE - offset|",
    "rms": "rms",
    "offset": "offset",
}
_NONE = "–"

_STYLE = (
    "<style>"
    ".rverror-page{line-height:1.45;overflow-x:auto}"
    ".rverror-page p,.rverror-page table{margin:.25em 0 .5em}"
    ".rverror-page table{border-collapse:collapse;border:none;width:auto;font-variant-numeric:tabular-nums}"
    ".rverror-page th,.rverror-page td{padding:.15em 1.1em .15em .2em;border:none;text-align:left;"
    "border-bottom:1px solid rgba(128,128,128,.35);max-width:36em;white-space:normal;vertical-align:top}"
    ".rverror-page thead th{border-bottom:2px solid rgba(128,128,128,.55);font-weight:600}"
    ".rverror-page tbody th{font-weight:400}"
    ".rverror-page .n{text-align:right}.rverror-page td.n{white-space:nowrap}.rverror-page th.n{max-width:8em}"
    ".rverror-page .soft{opacity:.85;font-size:.95em}.rverror-page .soft .soft{opacity:1;font-size:1em}"
    "</style>"
)


def page(thing: Any) -> str:
    """Result as a small piece of HTML: names, values with units and intervals.

    Parameters
    ----------
    thing : Model, Run, Influence, Equilibrium, TorsionCurve, Diagnosis, Budget, ErrorBudget, VirtualUnits, Allocation
        Or anything that `rverror.to_pandas` takes; of other things what Python says of them.

    Returns
    -------
    str
        HTML without script, links or colours of its own.

    Examples
    --------
    >>> import rverror
    >>> "<td>eccentricity</td>" in page(rverror.reducer("RV-40E"))
    True
    """
    return f'<div class="rverror-page">{_STYLE}\n{_body(thing)}\n</div>'


# --- pieces -----------------------------------------------------------------------------------------------------------


def _title(kind: str, name: str, rest: str = "") -> str:
    words = [f"<strong>{escaped(kind)}</strong>", *(escaped(text) for text in (name, rest) if text)]
    return f"<p>{', '.join(words)}</p>"


def _line(text: str) -> str:
    return f'<p class="soft">{escaped(text)}</p>'


def _grid(heads: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """Table of texts and numbers; a column of numbers alone is set flush right."""
    listed = [list(row) for row in rows]
    if not listed:
        return ""
    flush = [all(isinstance(row[at], (float, int, _Interval)) for row in listed) for at in range(len(heads))]
    marks = [' class="n"' if right else "" for right in flush]
    head = "".join(f'<th scope="col"{mark}>{escaped(text)}</th>' for text, mark in zip(heads, marks, strict=True))
    body = [
        "<tr>" + "".join(f"<td{mark}>{_cell(cell)}</td>" for cell, mark in zip(row, marks, strict=True)) + "</tr>"
        for row in listed[:MOST_ROWS]
    ]
    more = len(listed) - MOST_ROWS
    table = f"<table><thead><tr>{head}</tr></thead>\n<tbody>{chr(10).join(body)}</tbody></table>"
    return table + (_line(f"and {more} more") if more > 0 else "")


class _Interval(tuple[float, float]):
    """Ends of an interval."""

    __slots__ = ()


def _cell(value: Any) -> str:
    if isinstance(value, _Interval):
        if any(math.isnan(end) for end in value):
            return "not determined"
        return f"{_number(value[0])} to {_number(value[1])}"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return _number(value) if isinstance(value, (int, float)) else escaped(str(value))


def _number(value: float) -> str:
    if math.isnan(value):
        return _NONE
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    return escaped(brief(float(value)))


def _notes(notes: Sequence[str]) -> str:
    """What was noticed, folded away."""
    if not notes:
        return ""
    listed = "".join(_line(note) for note in notes)
    return f'<details class="soft"><summary>{_count(len(notes), "note")}</summary>{listed}</details>'


def _facts(facts: Mapping[str, str]) -> str:
    """Names and texts, one under another; those without text are left out."""
    rows = [
        f'<tr><th scope="row">{escaped(name)}</th><td>{escaped(text)}</td></tr>' for name, text in facts.items() if text
    ]
    return f"<table><tbody>{chr(10).join(rows)}</tbody></table>"


def _with_unit(value: float | None, dimension: str) -> str:
    if value is None:
        return ""
    return f"{brief(units.to_display(value, dimension))} {units.DISPLAY_UNITS[dimension]}"


def _arcsec(value: float) -> float:
    return value / ARCSEC


def _columns(thing: Any, names: Sequence[str], heads: Sequence[str], **options: Any) -> str:
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


def _count(number: int, what: str) -> str:
    return f"{number} {what}" + ("" if number == 1 else "s")


# --- one entry a kind -------------------------------------------------------------------------------------------------


@singledispatch
def _body(thing: Any) -> str:
    """HTML of one kind of result."""
    return f"<pre>{escaped(repr(thing))}</pre>"


@_body.register
def _of_reducer(thing: Reducer) -> str:
    grid = _columns(thing, ("parameter", "value", "unit"), ("parameter", "value", "unit"))
    return _title("Reducer", thing.name, f"ratio {thing.ratio:.8g}") + grid


@_body.register
def _of_drive(thing: Drive) -> str:
    rows = [(name, turns) for name, turns in thing.shafts.items()]
    return _title("Drive", thing.name, f"ratio {thing.ratio:.8g}") + _grid(("shaft", "turns per output turn"), rows)


@_body.register
def _of_effect(thing: Effect) -> str:
    return _title("Effect", describe(thing.key, thing.indices), thing.origin) + _grid(_EFFECT[1:], _sizes(thing, 1))


@_body.register
def _of_model(thing: Model) -> str:
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


@_body.register
def _of_run(thing: Run) -> str:
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
        "output torque": _with_unit(thing.torque, "torque"),
        "temperature": _with_unit(thing.temperature, "temperature"),
        "zero": {"": "aligned, offset of its own", "unknown": "not known"}.get(thing.index, f"shared, {thing.index}"),
        "columns": ", ".join(columns(table)[0]),
        **{f"# {key}": value for key, value in thing.metadata.items()},
    }
    return _title("Run", thing.path) + _facts(facts) + _notes(thing.notes)


@_body.register
def _of_influence(thing: Influence) -> str:
    matrix = thing.matrix
    rows = zip(thing.labels, np.ptp(matrix, axis=1).tolist(), matrix.mean(axis=1).tolist(), strict=True)
    heads = ("parameter", "peak-to-peak", "mean")
    note = f"rad of output per {units.CORE_UNITS[source(thing.key).parameters[0].dimension]} of each parameter"
    return _title("Influence", f"{thing.key}, {_count(matrix.shape[1], 'angle')}") + _grid(heads, rows) + _line(note)


@_body.register
def _of_equilibrium(thing: Equilibrium) -> str:
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
        "largest spline torque": _with_unit(float(np.abs(thing.contact_forces["spline"]).max()), "torque"),
        "out of balance": f"{thing.residual.max():.1e} of the load at the most",
    }
    return _title("Equilibrium", _count(error.size, "angle")) + _facts(facts)


@_body.register
def _of_torsion(thing: TorsionCurve) -> str:
    angle = thing.angle / ARCSEC
    rows = zip(
        (thing.torque / 1e3).tolist(),
        angle.mean(axis=1).tolist(),
        map(_Interval, zip(angle.min(axis=1).tolist(), angle.max(axis=1).tolist(), strict=True)),
        strict=True,
    )
    where = _count(angle.shape[1], "angle") + " of the output"
    return _title("Torsion curve", where) + _grid(("torque, N*m", "turn, arcsec", "over the angles, arcsec"), rows)


@_body.register
def _of_diagnosis(thing: Diagnosis) -> str:
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
    tried = f"{len(thing.added)} added of {_count(thing.tried, 'candidate')}"
    return "\n".join(
        [
            _title("Diagnosis", declared.name or declared.mechanism.name),
            f"<p>Verdict: <strong>{escaped(thing.verdict.replace('_', ' '))}</strong>; {escaped(tried)}</p>",
            _grid((f"residual, {unit}", "rms", "peak-to-peak", "held-out rms"), rows),
            _grid(("added", "parameter", "size", "95 % interval", "unit"), _added(thing)),
            *(_line(text) for text in _about_added(thing)),
            _grid(
                ("unexplained order", f"amplitude, {unit}", f"95 % interval, {unit}", "fits"),
                (
                    (
                        line.order,
                        size(line.amplitude),
                        _Interval((size(line.low), size(line.high))),
                        "; ".join(line.frames or beside(declared.mechanism, line.order)) or "no frame of this drive",
                    )
                    for line in thing.unexplained
                ),
            ),
            _line("Runs: " + ", ".join(dict.fromkeys(trace.name for trace in thing.traces))) if thing.traces else "",
            _notes(thing.notes),
        ]
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


def _contributions(closed: Budget, indices: SobolIndices | None) -> str:
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


@_body.register
def _of_budget(thing: Budget) -> str:
    worst = thing.worst
    facts = {
        "worst-case peak-to-peak": _with_unit(worst.peak_to_peak, "angle"),
        "root sum of squares of single peak-to-peaks": _with_unit(thing.rss, "angle"),
        "expected rms": _with_unit(thing.rms, "angle"),
        "offset": f"{_with_unit(thing.offset_mean, 'angle')}, standard deviation "
        f"{_with_unit(thing.offset_deviation, 'angle')}",
    }
    title = _title("Budget in closed form", _count(len(thing.contributions), "tolerance"))
    return title + _facts(facts) + _contributions(thing, None)


def _quantiles(drawn: VirtualUnits, worst: Mapping[str, float]) -> str:
    """Sizes of the output error at several shares of the units, with what no unit exceeds where that is known."""
    rows = []
    for size, name in _SIZES.items():
        row: list[Any] = [name]
        for level in _LEVELS:
            found = drawn.quantile(level, size)
            row += [_arcsec(found.value), _Interval((_arcsec(found.low), _arcsec(found.high)))]
        rows.append([*row, *([_arcsec(worst[size])] if worst else [])])
    heads = [text for level in _LEVELS for text in (f"P{level * 100:g}", "95 % interval")]
    return _grid(["size, arcsec", *heads, *(["worst case"] if worst else [])], rows)


@_body.register
def _of_virtual_units(thing: VirtualUnits) -> str:
    return _title("Virtual units", f"{thing.count}, {thing.draws}, seed {thing.seed}") + _quantiles(thing, {})


@_body.register
def _of_error_budget(thing: ErrorBudget) -> str:
    closed, worst = thing.closed, thing.closed.worst
    bounds = {
        "peak_to_peak": worst.peak_to_peak,
        "max": worst.maximum,
        "rms": math.nan,
        "offset": max(worst.offset, key=abs),
    }
    way = "forward" if thing.direction > 0 else "reverse"
    drawn = f"{thing.units.count} virtual units, seed {thing.units.seed}"
    at_load = ""
    if thing.contact is not None:
        found = thing.contact.peak_to_peak.quantile(0.99)
        value, low, high = (brief(_arcsec(x)) for x in (found.value, found.low, found.high))
        at_load = _line(
            f"At {_with_unit(thing.contact.torque, 'torque')}, contacts that open included: P99 of the peak-to-peak "
            f"{value} arcsec, 95 % interval {low} to {high}"
        )
    title = _title("Error budget", thing.model.name or thing.model.mechanism.name, f"{way}, {drawn}")
    return title + _quantiles(thing.units, bounds) + at_load + _contributions(closed, thing.indices)


@_body.register
def _of_allocation(thing: Allocation) -> str:
    what = {"worst": "worst-case peak-to-peak", "yield": f"P{100 * thing.level:g} of the peak-to-peak", "rms": "rms"}
    rows = [
        ("cost", thing.cost_before, thing.cost, ""),
        (what[thing.kind], _arcsec(thing.value_before), _arcsec(thing.value), "arcsec"),
    ]
    entries = zip(
        thing.labels,
        thing.widths_before,
        thing.widths,
        (grade or ("fixed" if fixed else "") for grade, fixed in zip(thing.grades, thing.fixed, strict=True)),
        thing.costs_before,
        thing.costs,
        strict=True,
    )
    heads = ("tolerance", "width before", "allocated", "grade", "cost before", "cost")
    gap = "" if thing.gap is None else f"; the gap is {100 * thing.gap:.2g} % of the cost"
    return (
        _title("Allocation", f"{what[thing.kind]} within {_with_unit(thing.limit, 'angle')}")
        + _grid(("", "before", "allocated", "unit"), rows)
        + _grid(heads, entries)
        + _line("Widths in core units: mm or rad.")
        + _line(f"How good it is: {thing.proof}{gap}.")
    )


@_body.register
def _of_stack(thing: Stack) -> str:
    names = ("tolerance", "width", "unit", "distribution", "correlation")
    title = _title("Stack", _count(len(thing.labels), "tolerance"), _count(len(thing.components), "component"))
    return title + _columns(thing, names, names)


@_body.register
def _of_tolerance(thing: Tolerance) -> str:
    names = ("width", "unit", "distribution", "correlation", "random_phase", "fixed")
    heads = [name.replace("_", " ") for name in names]
    return _title("Tolerance", thing.label) + _columns(thing, names, heads)
