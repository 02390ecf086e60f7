"""Lots of units, of drives and of matched parts: what is told of each."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
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
from rverror.views.fields import COUNT, OWN, Field, alike, arrays, bare, ends, entry, listing, rows
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


def _shift_name(one: Shift) -> str:
    """Source and place of a systematic error; the parameter stands in a column of its own."""
    return describe(one.key, one.indices)


@table.register
def _lot_table(result: Lot) -> Table:
    variables = {
        **rows(
            "process",
            result.processes,
            "",
            ("process_unit", "dimension"),
            process=process_name,
            key=None,
            indices=lambda one: inside(one.indices),
            parameters=lambda one: ", ".join(one.parameters),
            **ends("deviation", OWN),
            above_zero=None,
            share=NUMBER,
            alike=lambda one: "; ".join(one.alike),
            units_needed=NUMBER,
            tolerance=None,
            cp=("capability", NUMBER),
            cpk=("capability_centred", NUMBER),
            least_difference=OWN,
            least_error=OWN,
        ),
        **_shifts("shift", [(None, one) for one in result.shifts]),
        **_shifts("outlier", _with_causes(result.outsiders), unit="0.serial"),
        **_shifts("group", _with_causes(result.differences), label="0.label", value="0.value"),
        **_shifts("change", [(one, one.cause) for one in result.changes], since="0.since", course="0.course"),
        **rows(
            "condition",
            result.predicted,
            condition=None,
            mean=ANGLE,
            **ends("p95", ANGLE, "quantile"),
            measured_mean=("seen.0", ANGLE),
            measured_p95=("seen.1", ANGLE),
        ),
        "order": Variable(("order",), np.asarray(result.orders, dtype=np.float64), NUMBER),
        **arrays("order run", result, measured=("amplitudes.T", ANGLE), made=("made.T", ANGLE)),
    }
    about = {
        "model": result.model,
        "units": result.units,
        "conditions": "\n".join(result.conditions),
        "chance": result.chance,
        "notes": "\n".join(result.notes),
    }
    return Table("Lot", "process", variables, about)


def _with_causes(found: Sequence[Any]) -> list[tuple[Any, Shift]]:
    return [(one, cause) for one in found for cause in one.causes]


def _shifts(dim: str, found: Sequence[tuple[Any, Shift]], **beside: Field) -> dict[str, Variable]:
    """Systematic errors as rows, behind the columns of what they belong to."""
    return rows(
        dim,
        found,
        f"{dim}_",
        (f"{dim}_size_unit", "1.dimension"),
        **beside,
        source=lambda row: _shift_name(row[1]),
        parameter="1.parameter",
        size=("1.size.value", OWN),
        **alike(OWN, "low", "high", within="1.size."),
    )


# --- a lot: for programs ----------------------------------------------------------------------------------------------


@content.register
def _lot_content(result: Lot) -> dict[str, Any]:
    """None where something is not determined."""
    predicted = [
        entry(
            one,
            condition=None,
            mean_arcsec=("mean", ANGLE),
            p95_arcsec=("quantile.value", ANGLE),
            p95_interval=("quantile", ANGLE),
            measured_mean_arcsec=("seen.0", ANGLE),
            measured_p95_arcsec=("seen.1", ANGLE),
        )
        for one in result.predicted
    ]
    worst = max(range(len(predicted)), key=lambda at: result.predicted[at].quantile.value, default=None)
    by_order = zip(result.conditions, result.amplitudes, result.made, strict=False)
    return {
        **entry(result, model=None, units=None, conditions=None, chance=NUMBER, notes=None),
        "processes": list(_processes(result)),
        "shifts": [_shift(one, "value") for one in result.shifts],
        "stiffness": {
            name: entry(one, ratio=("value", NUMBER), interval=("", NUMBER)) for name, one in result.stiffness.items()
        },
        "outliers": [
            {
                **entry(one, unit="serial", distance=NUMBER, chance=NUMBER),
                "added": _added(one.causes, one.rivals),
                "diagnosis": None if one.diagnosis is None else _of_unit(one.diagnosis),
            }
            for one in result.outsiders
        ],
        "groups": [
            {
                **entry(one, label=None, value=None, units=None, chance=NUMBER, indistinguishable_from="rivals"),
                **_shift(cause, "difference"),
            }
            for one, cause in _with_causes(result.differences)
        ],
        "changes": [
            {
                **entry(one, since=None, course=None, chance=NUMBER, indistinguishable_from="rivals"),
                **_shift(one.cause, "difference"),
            }
            for one in result.changes
        ],
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
        **entry(
            one,
            one.dimension,
            key=None,
            unit=_UNIT,
            sd=("deviation.value", OWN),
            sd_interval=("deviation", OWN),
            above_zero=None,
            share=NUMBER,
            **{"with": "alike"},
            units_needed=None,
            tolerance=lambda made: made.tolerance or None,
            cp=("capability", NUMBER),
            cpk=("capability_centred", NUMBER),
            least_difference=OWN,
            least_error=OWN,
        ),
    }


def _shift(one: Shift, called: str) -> dict[str, Any]:
    sizes: dict[str, Field] = {called: ("size.value", OWN), "interval": ("size", OWN)}
    return entry(one, one.dimension, key=None, indices=None, parameter=None, **sizes, unit=_UNIT)


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

_MADE: Mapping[str, Field] = {
    "process": process_name,
    "standard deviation": ("deviation.value", OWN),
    "95 % interval": ("deviation", OWN),
    "unit": _UNIT,
    "share of variance, %": ("share", PERCENT),
    "Cp": "capability",
    "Cpk": "capability_centred",
    "units for ± 25 %": "units_needed",
}
_NOT_MADE: Mapping[str, Field] = {
    "not above zero": process_name,
    "standard deviation below": ("deviation.high", OWN),
    "unit": _UNIT,
}
#: What one part has to be off to be found.
_FOUND: Mapping[str, Field] = {
    "one part, found in 95 %": process_name,
    "off in half of the lot by": ("least_difference", OWN),
    "off in one unit by": ("least_error", OWN),
    "unit": _UNIT,
}
#: Peak-to-peak error of the units to come, beside that of those that were measured.
_TO_COME: Mapping[str, Field] = {
    "peak-to-peak, arcsec": "condition",
    "mean, to come": ("mean", ANGLE),
    "P95, to come": ("quantile.value", ANGLE),
    "95 % interval": ("quantile", ANGLE),
    "mean, measured": ("seen.0", ANGLE),
    "P95, measured": ("seen.1", ANGLE),
}
_COME = "Peak-to-peaks are those without the differences and changes named above."


@sheet.register
def _lot_sheet(thing: Lot) -> Sheet:
    made = thing.processes
    unseen = [process_name(one) for one in made if one.deviation is None]
    looked = {
        "systematic error": thing.shifts,
        "unit that is no member": thing.outsiders,
        "group that differs": thing.differences,
        "change over the serials": thing.changes,
    }
    none = [what for what, found in looked.items() if not found]
    return (
        *title("Lot", thing.model, count_of(thing.units, "unit")),
        *line(f"Conditions: {'; '.join(thing.conditions)}" if thing.conditions else ""),
        Sentence(*_lot_verdict(thing)),
        *listing([one for one in made if one.above_zero], _MADE),
        *listing([one for one in made if not one.above_zero and one.deviation], _NOT_MADE),
        *map(Sentence, _not_told_apart(thing)),
        *line(f"Do not show under these conditions: {', '.join(unseen)}" if unseen else ""),
        *_causes([(None, one) for one in thing.shifts], "systematic error"),
        *listing(
            thing.stiffness.items(),
            {"stiffness": "0", "times what is stated": "1.value", "95 % interval": ("1", NUMBER)},
        ),
        *_causes(_with_causes(thing.outsiders), "cause", {"unit that is no member": "0.serial", "chance": "0.chance"}),
        *_causes(
            _with_causes(thing.differences),
            "cause",
            {
                "group that differs": lambda row: f"{row[0].label} {row[0].value}",
                "units": "0.units",
                "chance": "0.chance",
            },
        ),
        *_causes(
            [(one, one.cause) for one in thing.changes],
            "cause",
            {"change since": "0.since", "course": "0.course", "chance": "0.chance"},
        ),
        *map(Sentence, _lot_rivals(thing)),
        *map(Sentence, _diagnosed(thing)),
        *line(f"Found: no {', no '.join(none)}" if none else ""),
        *listing([one for one in made if one.least_difference is not None], _FOUND),
        *listing(thing.predicted, _TO_COME),
        *line(_COME if thing.differences or thing.changes else ""),
        *notes(thing.notes),
    )


def _causes(found: Sequence[tuple[Any, Shift]], head: str, before: Mapping[str, Field] | None = None) -> Sheet:
    """Systematic errors in the rows of a table, behind what they belong to."""
    heads: dict[str, Field] = {
        **(before or {}),
        head: lambda row: _shift_name(row[1]),
        "parameter": "1.parameter",
        "size": ("1.size.value", OWN),
        "95 % interval": ("1.size", OWN),
        "unit": lambda row: DISPLAY_UNITS[row[1].dimension],
    }
    return listing(found, heads, own="1.dimension")


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


@table.register
def _drive_lot_table(result: DriveLot) -> Table:
    variables = {
        **rows(
            "place",
            result.orders,
            **alike(NUMBER, "order", "chance"),
            condition=None,
            **alike(ANGLE, "least", "median", "most", "phase", "spread"),
            **ends("mean", ANGLE),
        ),
        **rows(
            "own",
            result.own,
            "own_",
            unit="serial",
            **alike(NUMBER, "order", "distance", "chance"),
            condition=None,
            **alike(ANGLE, "amplitude", "difference"),
        ),
        **rows(
            "pair",
            result.pairs,
            "pair_",
            one="serials.0",
            other="serials.1",
            difference=ANGLE,
            usual=ANGLE,
            chance=NUMBER,
        ),
        **arrays("unit", result, unit=lambda lot: list(lot.serials)),
        **arrays("unit place", result, amplitude=("amplitudes", ANGLE)),
    }
    about = {"model": result.model, "conditions": "\n".join(result.conditions), "notes": "\n".join(result.notes)}
    return Table("DriveLot", "place", variables, about)


@sheet.register
def _drive_lot_sheet(thing: DriveLot) -> Sheet:
    shared = ", ".join(str(one.order) for one in thing.orders if one.shared) or "none"
    strong = f"Order in which the units' phases agree: {shared}"
    units_off = count_of(len({one.serial for one in thing.own}), "unit")
    orders: dict[str, Field] = {
        "order": None,
        "condition": None,
        "least, arcsec": ("least", ANGLE),
        "median": ANGLE,
        "most": ANGLE,
        "spread": ANGLE,
        "mean wave": ("mean.value", ANGLE),
        "95 % interval": ("mean", ANGLE),
        "phase, deg": ("phase", POSITION),
        "chance": None,
    }
    own: dict[str, Field] = {
        "unit that is off": "serial",
        "order": None,
        "condition": None,
        "amplitude, arcsec": ("amplitude", ANGLE),
        "off by": ("difference", ANGLE),
        "standard deviations": "distance",
        "chance": None,
    }
    pairs: dict[str, Field] = {
        "nearly equal": "serials.0",
        "and": "serials.1",
        "difference, arcsec rms": ("difference", ANGLE),
        "of usual pairs": ("usual", ANGLE),
        "chance": None,
    }
    return (
        *title("Lot of drives", thing.model, count_of(len(thing.serials), "unit")),
        Sentence(f"{strong}; {units_off} off the others; pairs nearly equal: {len(thing.pairs)}", strong=strong),
        *listing(thing.orders, orders),
        *listing(thing.own, own),
        *listing(thing.pairs, pairs),
        *notes(thing.notes),
    )


# --- matched units ----------------------------------------------------------------------------------------------------


@table.register
def _matched_table(result: Matched) -> Table:
    units = result.units
    left = [(kind, serial) for kind, serials in result.left.items() for serial in serials]
    at = {place_name(part): place for place, part in enumerate(units[0].parts)}
    placed: dict[str, Field] = {name: f"parts.{place}.serial" for name, place in at.items()}
    for name, place in at.items():
        if any(unit.parts[place].turn for unit in units):
            placed[f"{name}_turn"] = (f"parts.{place}.turn", COUNT)
    share: dict[str, Field] = {"yield": ("share", PERCENT), "p95": PERCENT}
    variables = {
        **arrays("unit", np.arange(1, len(units) + 1), unit=("", NUMBER)),
        **rows("unit", units, **placed),
        **rows("quantity", result.quantities, quantity="label"),
        **arrays("quantity", result, limit=("allowed", ANGLE)),
        **bare(arrays("unit quantity", np.array([unit.turns for unit in units]), turn=("", ANGLE))),
        **rows("way", result.ways, way="name", units=("errors.size", COUNT), **share, cost=NUMBER),
        **rows("left", left, "left_", kind="0", serial="1"),
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


@sheet.register
def _matched_sheet(thing: Matched) -> Sheet:
    names = [
        name for name in shown(thing)[0] if not name.startswith("roller")
    ]  # forty grooves: the spreadsheet has them
    verdict = f"{len(thing.units)} of {thing.possible} units"
    limits = zip(thing.quantities, thing.allowed, strict=True)
    ways: dict[str, Field] = {
        "way to build": "name",
        "units": "errors.size",
        "yield, %": ("share", PERCENT),
        "P95, % of the limit": ("p95", PERCENT),
        "cost a unit": "cost",
    }
    left = {
        f"{kind}, {len(some)} stay": ", ".join(some[:8]) + ", ..." * (len(some) > 8)
        for kind, some in thing.left.items()
    }
    return (
        *title("Matched units", thing.model, "; ".join(f"{one.label}: {with_unit(x, 'angle')}" for one, x in limits)),
        Sentence(
            f"{verdict} that the parts allow are within the limits, each solved at the load; by the linear influences "
            f"no assembly of these parts has more than {thing.bound}.",
            verdict,
        ),
        *listing(thing.ways, ways),
        *own_columns(thing, *names),
        *facts(left),
        *notes(thing.notes),
    )
