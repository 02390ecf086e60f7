"""Lots of units, of drives and of matched parts: what is told of each."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from rverror.base.numbers import brief, count_of, with_unit
from rverror.base.text import describe
from rverror.base.units import DISPLAY_UNITS, to_display
from rverror.diagnosis.result import Diagnosis, Estimate
from rverror.geartrain.source import IndexValue
from rverror.lots.of_drives import DriveLot
from rverror.lots.result import Lot, MadeBy, Shift
from rverror.matching.result import Matched, MountedPart
from rverror.model.catalogue import source
from rverror.views.blocks import Sentence, Sheet, facts, line, notes, title
from rverror.views.describing import content, own_columns, sheet, shown, table
from rverror.views.diagnosis_report import diagnosis_json
from rverror.views.fields import (
    COUNT,
    OWN,
    Column,
    Field,
    about,
    alike,
    arrays,
    bare,
    entry,
    for_people,
    in_json,
    in_table,
    listing,
    rows,
    sized,
)
from rverror.views.model_report import inside
from rverror.views.variables import ANGLE, NUMBER, PERCENT, POSITION, Table, Variable

_LACKING = 0.001  # chance below which the model lacks something
_UNIT: Field = lambda one: DISPLAY_UNITS[one.dimension]  # noqa: E731


# --- a lot: table -----------------------------------------------------------------------------------------------------


def process_name(one: MadeBy) -> str:
    """Process, with its parameters where not all of the source's are meant."""
    named = describe(one.key, one.indices)
    few = len(one.parameters) < len(source(one.key).parameters)
    return f"{named} {', '.join(one.parameters)}" if few else named


_PROCESS = (
    Column("process", process_name, head="process"),
    Column("key", key="key"),
    Column("indices", lambda one: inside(one.indices)),
    Column("parameters", lambda one: ", ".join(one.parameters)),
    *sized("deviation", OWN, "deviation", keys=("sd", "sd_interval"), head="standard deviation"),
    Column("", _UNIT, "unit", "unit"),
    Column("above_zero", key="above_zero"),
    Column("share", NUMBER, "share"),
    Column("", ("share", PERCENT), head="share of variance, %"),
    Column("alike", lambda one: "; ".join(one.alike)),
    Column("", "alike", "with"),
    Column("units_needed", NUMBER),
    Column("tolerance"),
    Column("", lambda one: one.tolerance or None, "tolerance"),
    Column("cp", ("capability", NUMBER), "cp", "Cp"),
    Column("cpk", ("capability_centred", NUMBER), "cpk", "Cpk"),
    Column("", "units_needed", "units_needed", "units for ± 25 %"),
)
#: Of a systematic error, a row of what has it and the error.
_SHIFT = (
    Column("source", lambda row: describe(row[1].key, row[1].indices), head="cause"),
    Column("parameter", "1.parameter", "parameter", "parameter"),
    Column("size", ("1.size.value", OWN), head="size"),
    Column("low", ("1.size.low", OWN)),
    Column("high", ("1.size.high", OWN)),
    Column("", "1.key", "key"),
    Column("", "1.indices", "indices"),
    Column("", ("1.size", OWN), "interval", "95 % interval"),
    Column("", lambda row: DISPLAY_UNITS[row[1].dimension], "unit", "unit"),
)
_OUTLIER = (
    Column("unit", "0.serial", "unit", "unit that is no member"),
    Column("", ("0.distance", NUMBER), "distance"),
    Column("", ("0.chance", NUMBER), "chance", "chance"),
)
_GROUP = (
    Column("", lambda row: f"{row[0].label} {row[0].value}", head="group that differs"),
    Column("label", "0.label", "label"),
    Column("value", "0.value", "value"),
    Column("", "0.units", "units", "units"),
    Column("", ("0.chance", NUMBER), "chance", "chance"),
    Column("", "0.rivals", "indistinguishable_from"),
)
_CHANGE = (
    Column("since", "0.since", "since", "change since"),
    Column("course", "0.course", "course", "course"),
    Column("", ("0.chance", NUMBER), "chance", "chance"),
    Column("", "0.rivals", "indistinguishable_from"),
)
#: Peak-to-peak error of the units to come, beside that of those that were measured.
_PREDICTED = (
    Column("condition", key="condition", head="peak-to-peak, arcsec"),
    Column("mean", ANGLE, "mean_arcsec", "mean, to come"),
    *sized("p95", ANGLE, "quantile", keys=("p95_arcsec", "p95_interval"), head="P95, to come"),
    Column("measured_mean", ("seen.0", ANGLE), "measured_mean_arcsec", "mean, measured"),
    Column("measured_p95", ("seen.1", ANGLE), "measured_p95_arcsec", "P95, measured"),
)


@table.register
def _lot_table(result: Lot) -> Table:
    variables = {
        **rows("process", result.processes, "", ("process_unit", "dimension"), **in_table(_PROCESS)),
        **_shifts("shift", (), [(None, one) for one in result.shifts]),
        **_shifts("outlier", _OUTLIER, _with_causes(result.outsiders)),
        **_shifts("group", _GROUP, _with_causes(result.differences)),
        **_shifts("change", _CHANGE, [(one, one.cause) for one in result.changes]),
        **rows("condition", result.predicted, **in_table(_PREDICTED)),
        "order": Variable(("order",), np.asarray(result.orders, dtype=np.float64), NUMBER),
        **arrays("order run", result, measured=("amplitudes.T", ANGLE), made=("made.T", ANGLE)),
    }
    return Table("Lot", "process", variables, about(result, "model", "units", "conditions", "chance", "notes"))


def _with_causes(found: Sequence[Any]) -> list[tuple[Any, Shift]]:
    return [(one, cause) for one in found for cause in one.causes]


def _shifts(dim: str, before: Sequence[Column], found: Sequence[tuple[Any, Shift]]) -> dict[str, Variable]:
    """Systematic errors as rows, behind the columns of what they belong to."""
    return rows(dim, found, f"{dim}_", (f"{dim}_size_unit", "1.dimension"), **in_table((*before, *_SHIFT)))


# --- a lot: for programs ----------------------------------------------------------------------------------------------


@content.register
def _lot_content(result: Lot) -> dict[str, Any]:
    """None where something is not determined."""
    predicted = [entry(one, **in_json(_PREDICTED)) for one in result.predicted]
    worst = max(range(len(predicted)), key=lambda at: result.predicted[at].quantile.value, default=None)
    by_order = zip(result.conditions, result.amplitudes, result.made, strict=False)
    return {
        **entry(result, model=None, units=None, conditions=None, chance=NUMBER, notes=None),
        "processes": list(_processes(result)),
        "shifts": [_shift((), (None, one), "value") for one in result.shifts],
        "stiffness": {
            name: entry(one, ratio=("value", NUMBER), interval=("", NUMBER)) for name, one in result.stiffness.items()
        },
        "outliers": [
            {
                **entry((one,), **in_json(_OUTLIER)),
                "added": _added(one.causes, one.rivals),
                "diagnosis": None if one.diagnosis is None else _of_unit(one.diagnosis),
            }
            for one in result.outsiders
        ],
        "groups": [_shift(_GROUP, row, "difference") for row in _with_causes(result.differences)],
        "changes": [_shift(_CHANGE, (one, one.cause), "difference") for one in result.changes],
        "predicted": None if worst is None else predicted[worst],
        "predicted_by_condition": predicted,
        "orders": [int(order) for order in result.orders],
        "rms_by_order": [
            entry(row, condition="0", measured_arcsec=("1", ANGLE), made_arcsec=("2", ANGLE)) for row in by_order
        ],
    }


def _processes(result: Lot) -> Iterator[dict[str, Any]]:
    """An entry for each process and parameter; and for each part whose mean is told by itself."""
    means = {_place(one.key, one.indices, one.parameter): one for one in result.means}
    for one in result.processes:
        for name in one.parameters:
            yield _process(one, name, one.indices, means.get(_place(one.key, one.indices, name)))
            for shift in result.means:
                part = shift.key == one.key and shift.parameter == name and dict(shift.indices) != dict(one.indices)
                if part and one.indices.items() <= shift.indices.items():
                    yield _process(one, name, shift.indices, shift)


def _place(key: str, indices: Mapping[str, IndexValue], parameter: str) -> tuple[Any, ...]:
    return key, frozenset(indices.items()), parameter


def _process(one: MadeBy, parameter: str, indices: Mapping[str, IndexValue], mean: Shift | None) -> dict[str, Any]:
    return {
        "parameter": parameter,
        "indices": dict(indices),
        **entry(mean, one.dimension, mean=("size.value", OWN), mean_interval=("size", OWN)),
        **entry(one, one.dimension, **in_json(_PROCESS)),
    }


def _shift(before: Sequence[Column], row: tuple[Any, Shift], called: str) -> dict[str, Any]:
    size: dict[str, Field] = {called: ("1.size.value", OWN)}
    return entry(row, row[1].dimension, **in_json((*before, *_SHIFT)), **size)


def _added(causes: Sequence[Shift], rivals: Sequence[str]) -> list[dict[str, Any]]:
    """Causes by their place, each with its parameters."""
    parts: dict[tuple[Any, ...], list[Shift]] = {}
    for cause in causes:
        parts.setdefault(_place(cause.key, cause.indices, ""), []).append(cause)
    sizes = alike(OWN, "value", "low", "high", within="size.")
    return [
        {
            "key": some[0].key,
            "indices": dict(some[0].indices),
            "parameters": {one.parameter: entry(one, one.dimension, unit=_UNIT, **sizes) for one in some},
            "indistinguishable_from": list(rivals),
        }
        for some in parts.values()
    ]


def _of_unit(found: Diagnosis) -> dict[str, Any]:
    whole = diagnosis_json(found)
    return {name: whole[name] for name in ("verdict", "added")}


# --- a lot: for people ------------------------------------------------------------------------------------------------

_NOT_MADE: Mapping[str, Field] = {
    "not above zero": process_name,
    "standard deviation below": ("deviation.high", OWN),
    "unit": _UNIT,
}
_COME = "Peak-to-peaks are those without the differences and changes named above."


@sheet.register
def _lot_sheet(thing: Lot) -> Sheet:
    made = thing.processes
    unseen = [process_name(one) for one in made if one.deviation is None]
    looked: dict[str, Sequence[object]] = {
        **({"systematic error": thing.shifts} if thing.marked else {}),
        "unit that is no member": thing.outsiders,
        **({"group that differs": thing.differences, "change over the serials": thing.changes} if thing.marked else {}),
    }
    none = [what for what, found in looked.items() if not found]
    return (
        *title("Lot", thing.model, count_of(thing.units, "unit")),
        *line(f"Conditions: {'; '.join(thing.conditions)}" if thing.conditions else ""),
        Sentence(*_lot_verdict(thing)),
        *listing([one for one in made if one.above_zero], for_people(_PROCESS)),
        *listing([one for one in made if not one.above_zero and one.deviation], _NOT_MADE),
        *map(Sentence, _not_told_apart(thing)),
        *line(f"Do not show under these conditions: {', '.join(unseen)}" if unseen else ""),
        *_causes((), [(None, one) for one in thing.shifts], "systematic error"),
        *listing(
            thing.stiffness.items(),
            {"stiffness": "0", "times what is stated": "1.value", "95 % interval": ("1", NUMBER)},
        ),
        *_causes(_OUTLIER, _with_causes(thing.outsiders)),
        *_causes(_GROUP, _with_causes(thing.differences)),
        *_causes(_CHANGE, [(one, one.cause) for one in thing.changes]),
        *map(Sentence, _lot_rivals(thing)),
        *map(Sentence, _diagnosed(thing)),
        *line(f"Found: no {', no '.join(none)}" if none else ""),
        *listing(thing.predicted, for_people(_PREDICTED)),
        *line(_COME if thing.differences or thing.changes else ""),
        *notes(thing.notes),
    )


def _causes(before: Sequence[Column], found: Sequence[tuple[Any, Shift]], head: str = "cause") -> Sheet:
    """Systematic errors in the rows of a table, behind what they belong to."""
    first, *rest = _SHIFT
    return listing(found, for_people((*before, replace(first, head=head), *rest)), own="1.dimension")


def _lot_verdict(lot: Lot) -> tuple[str, str]:
    """Whether the processes describe the lot, and the words of it to be read first."""
    if lot.chance < _LACKING:
        strong = "The model lacks something"
        rest = f"lots of these processes are as far from what they make with a chance of {brief(lot.chance, 2)}"
        return (
            f"{strong}: {rest}; sizes below may stand for what it lacks, and their intervals are wider for it: measure "
            "at a greater torque, or declare what all units share",
            strong,
        )
    strong = "The processes describe the lot"
    return f"{strong} (chance {brief(lot.chance, 2)})", strong


def _not_told_apart(lot: Lot) -> Iterator[str]:
    """A sentence for each process that stands for others too."""
    for one in lot.processes:
        if one.alike and one.deviation is not None:
            yield f"{process_name(one)} is not told apart from {', '.join(one.alike)}: the size is that of all together"


def _lot_rivals(lot: Lot) -> Iterator[str]:
    """A sentence for each finding that something else would do as well."""
    found: list[tuple[str, Sequence[str]]] = [
        *((f"unit {one.serial}", one.rivals) for one in lot.outsiders),
        *((f"{one.label} {one.value}", one.rivals) for one in lot.differences),
        *((f"change since {one.since}", one.rivals) for one in lot.changes),
    ]
    yield from (f"As well for {what}: {', '.join(others)}" for what, others in found if others)


def _diagnosed(lot: Lot) -> Iterator[str]:
    """A sentence for each unit that was diagnosed by itself."""
    for one in lot.outsiders:
        if one.diagnosis is not None:
            added = [
                f"{describe(a.effect.key, a.effect.indices)} ({', '.join(map(_size, a.estimates))})"
                for a in one.diagnosis.added
            ]
            yield f"Unit {one.serial} by itself, {one.diagnosis.verdict}: {'; '.join(added) or 'nothing named'}"


def _size(one: Estimate) -> str:
    value, low, high = (brief(to_display(x, one.dimension)) for x in (one.value, one.low, one.high))
    return f"{one.name} {value} {DISPLAY_UNITS[one.dimension]}, {low} to {high}"


# --- drives -----------------------------------------------------------------------------------------------------------


_ORDER = (
    Column("order", NUMBER, head="order"),
    Column("chance", NUMBER, head="chance"),
    Column("condition", head="condition"),
    Column("least", ANGLE, head="least, arcsec"),
    Column("median", ANGLE, head="median"),
    Column("most", ANGLE, head="most"),
    Column("phase", ANGLE),
    Column("", ("phase", POSITION), head="phase, deg"),
    Column("spread", ANGLE, head="spread"),
    *sized("mean", ANGLE, "mean", head="mean wave"),
)
_OWN = (
    Column("unit", "serial", head="unit that is off"),
    Column("order", NUMBER, head="order"),
    Column("distance", NUMBER, head="standard deviations"),
    Column("chance", NUMBER, head="chance"),
    Column("condition", head="condition"),
    Column("amplitude", ANGLE, head="amplitude, arcsec"),
    Column("difference", ANGLE, head="off by"),
)
_PAIR = (
    Column("one", "serials.0", head="nearly equal"),
    Column("other", "serials.1", head="and"),
    Column("difference", ANGLE, head="difference, arcsec rms"),
    Column("usual", ANGLE, head="of usual pairs"),
    Column("chance", NUMBER, head="chance"),
)


@table.register
def _drive_lot_table(result: DriveLot) -> Table:
    variables = {
        **rows("place", result.orders, **in_table(_ORDER)),
        **rows("own", result.own, "own_", **in_table(_OWN)),
        **rows("pair", result.pairs, "pair_", **in_table(_PAIR)),
        **arrays("unit", result, unit=lambda lot: list(lot.serials)),
        **arrays("unit place", result, amplitude=("amplitudes", ANGLE)),
    }
    return Table("DriveLot", "place", variables, about(result, "model", "conditions", "notes"))


@sheet.register
def _drive_lot_sheet(thing: DriveLot) -> Sheet:
    shared = ", ".join(str(one.order) for one in thing.orders if one.shared) or "none"
    strong = f"Order in which the units' phases agree: {shared}"
    units_off = count_of(len({one.serial for one in thing.own}), "unit")
    return (
        *title("Lot of drives", thing.model, count_of(len(thing.serials), "unit")),
        Sentence(f"{strong}; {units_off} off the others; pairs nearly equal: {len(thing.pairs)}", strong=strong),
        *listing(thing.orders, for_people(_ORDER)),
        *listing(thing.own, for_people(_OWN)),
        *listing(thing.pairs, for_people(_PAIR)),
        *notes(thing.notes),
    )


# --- matched units ----------------------------------------------------------------------------------------------------


_WAY = (
    Column("way", "name", head="way to build"),
    Column("units", ("errors.size", COUNT), head="units"),
    Column("yield", ("share", PERCENT), head="yield, %"),
    Column("p95", PERCENT, head="P95, % of the limit"),
    Column("cost", NUMBER, head="cost a unit"),
)


@table.register
def _matched_table(result: Matched) -> Table:
    units = result.units
    left = [(kind, serial) for kind, serials in result.left.items() for serial in serials]
    at = {place_name(part): place for place, part in enumerate(units[0].parts)}
    placed: dict[str, Field] = {name: f"parts.{place}.serial" for name, place in at.items()}
    for name, place in at.items():
        if any(unit.parts[place].turn for unit in units):
            placed[f"{name}_turn"] = (f"parts.{place}.turn", COUNT)
    variables = {
        **arrays("unit", np.arange(1, len(units) + 1), unit=("", NUMBER)),
        **rows("unit", units, **placed),
        **(rows("unit", units, chance=("chance", PERCENT)) if any(unit.chance < 1 for unit in units) else {}),
        **rows("quantity", result.quantities, quantity="label"),
        **arrays("quantity", result, limit=("allowed", ANGLE)),
        **bare(arrays("unit quantity", np.array([unit.turns for unit in units]), turn=("", ANGLE))),
        **rows("way", result.ways, **in_table(_WAY)),
        **rows("left", left, "left_", kind="0", serial="1"),
    }
    return Table("Matched", "unit", variables, about(result, "model", "possible", "bound", "doubt", "notes"))


def place_name(part: MountedPart) -> str:
    """Column of a part's place: ``disc_1``."""
    return part.kind if part.place is None else f"{part.kind}_{part.place}"


@sheet.register
def _matched_sheet(thing: Matched) -> Sheet:
    names = [
        name for name in shown(thing)[0] if not name.startswith("roller")
    ]  # forty grooves: the spreadsheet has them
    verdict = f"{len(thing.units)} of {thing.possible} units"
    limits = zip(thing.quantities, thing.allowed, strict=True)
    left = {}
    for kind, some in thing.left.items():
        serials = [serial + f" ({count})" * (count > 1) for serial, count in Counter(some).items()]
        left[f"{kind}, {len(some)} stay"] = ", ".join(serials[:8]) + ", ..." * (len(serials) > 8)
    good = sum(unit.chance for unit in thing.units)
    expected = f" As the sizes are uncertain, {brief(good, 3)} of them are expected to be."
    return (
        *title("Matched units", thing.model, "; ".join(f"{one.label}: {with_unit(x, 'angle')}" for one, x in limits)),
        Sentence(
            f"{verdict} that the parts allow are within the limits, each solved at the load; by the linear influences "
            f"no assembly of these parts has more than {thing.bound}." + expected * (good < len(thing.units)),
            verdict,
        ),
        *listing(thing.ways, for_people(_WAY)),
        *own_columns(thing, *names),
        *facts(left),
        *notes(thing.notes),
    )
