"""Lots of units, of drives and of matched parts: what is told of each."""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from rverror.base.numbers import brief, count_of, in_arcsec, with_unit
from rverror.base.text import describe
from rverror.base.units import DISPLAY_UNITS, to_display
from rverror.diagnosis.result import Estimate
from rverror.geartrain.source import IndexValue
from rverror.lots.of_drives import DriveLot
from rverror.lots.processes import label_of
from rverror.lots.result import Lot, MadeBy, Shift
from rverror.matching.result import Matched, MountedPart
from rverror.views.blocks import some_of
from rverror.views.describing import described, entries
from rverror.views.diagnosis_report import added_json
from rverror.views.fields import COUNT, OWN, OWN_NAME, Field, about, arrays, entry, rows, same_unit, sized
from rverror.views.shown_units import ANGLE, NUMBER, PERCENT, POSITION
from rverror.views.variables import Table, Variable

_LACKING = 0.001  # chance below which the model lacks something


# --- a lot: table -----------------------------------------------------------------------------------------------------


def process_name(one: MadeBy) -> str:
    """Its name for people, as `Process.label`."""
    return label_of(one.key, one.indices, one.parameters)


def _with_causes(found: Sequence[Any]) -> list[tuple[Any, Shift]]:
    return [(one, cause) for one in found for cause in one.causes]


@described.register
def lot_table(result: Lot) -> Table:
    """Processes, what differs and what the lot makes, as variables."""
    chance: dict[str, Field] = {"chance": ("0.chance", NUMBER)}
    of_group: dict[str, Field] = {"label": "0.label", "value": "0.value", "units": ("0.units", COUNT), **chance}
    ends: dict[str, Field] = {"earliest": "0.since_interval.0", "latest": "0.since_interval.1"}
    since: dict[str, Field] = {"since": "0.since", **ends, "course": "0.course"}
    variables = {
        **rows(
            "process",
            result.processes,
            "",
            ("process_unit", "dimension"),
            process=process_name,
            key=None,
            indices=None,
            parameters=lambda one: ", ".join(one.parameters),
            **sized("deviation", OWN, "deviation"),
            above_zero=lambda one: None if one.deviation is None else one.above_zero,
            share=(lambda one: None if one.deviation is None else one.share, PERCENT),
            alike=None,
            tolerance=None,
            cp=("capability", NUMBER),
            cpk=("capability_centred", NUMBER),
            units_needed=NUMBER,
        ),
        **_shifts("shift", [(None, one) for one in result.shifts]),
        **_shifts("outlier", _with_causes(result.outsiders), unit="0.serial", **chance),
        **_shifts("group", _with_causes(result.differences), **of_group),
        **_shifts("change", [(one, one.cause) for one in result.changes], **since, **chance),
        **rows("stiffness", result.stiffness.items(), "stiffness_", name="0", **sized("ratio", NUMBER, "1")),
        **rows(
            "condition",
            result.predicted,
            condition=None,
            mean=ANGLE,
            **sized("p95", ANGLE, "quantile"),
            measured_mean=("seen.0", ANGLE),
            measured_p95=("seen.1", ANGLE),
        ),
        "order": Variable(("order",), np.asarray(result.orders, dtype=np.float64), NUMBER),
        **arrays("order run", result, measured=("amplitudes.T", ANGLE), made=("made.T", ANGLE)),
    }
    process = "process deviation deviation_interval unit above_zero share cp cpk units_needed"
    return Table(
        variables,
        about(result, "model", "units", "conditions", "chance", "notes"),
        title=(result.model, count_of(result.units, "unit")),
        verdict=_lot_verdict(result),
        facts={"conditions": "; ".join(result.conditions)},
        sentences=tuple(_lot_sentences(result)),
        shown={"process": process.split()},
    )


def _shifts(dim: str, found: Sequence[tuple[Any, Shift]], **before: Field) -> dict[str, Variable]:
    """Systematic errors, each behind what has it: rows of that and the error."""
    return rows(
        dim,
        found,
        f"{dim}_",
        (f"{dim}_size_unit", "1.dimension"),
        **before,
        source=lambda row: describe(row[1].key, row[1].indices),
        parameter="1.parameter",
        **sized("size", OWN, "1.size"),
    )


# --- a lot: for programs ----------------------------------------------------------------------------------------------


@entries.register
def _lot_content(result: Lot) -> dict[str, Any]:
    """None where something is not determined."""
    predicted = [
        entry(
            one,
            condition=None,
            mean_arcsec=("mean", ANGLE),
            p95_arcsec=("quantile.value", ANGLE),
            p95_interval=("quantile", ANGLE),
        )
        for one in result.predicted
    ]
    worst = max(range(len(predicted)), key=lambda at: result.predicted[at].quantile.value, default=None)
    named: dict[str, Field] = {"chance": ("0.chance", NUMBER), "indistinguishable_from": "0.rivals"}
    return {
        **entry(result, units=None, conditions=None, notes=None),
        "processes": list(_processes(result)),
        "outliers": [
            {
                **entry(one, unit="serial", distance=NUMBER, chance=NUMBER),
                "added": _added(one.causes, one.rivals),
                "one_of": [] if one.causes else list(one.rivals),
                "diagnosis": (own := one.diagnosis) and {"verdict": own.verdict, "added": added_json(own)},
            }
            for one in result.outsiders
        ],
        "groups": [
            _difference(row, label="0.label", value="0.value", units="0.units", **named)
            for row in _with_causes(result.differences)
        ],
        "changes": [
            _difference(
                (one, one.cause), since="0.since", since_interval="0.since_interval", course="0.course", **named
            )
            for one in result.changes
        ],
        "predicted": None if worst is None else predicted[worst],
        "predicted_by_condition": predicted,
    }


def _processes(result: Lot) -> Iterator[dict[str, Any]]:
    """An entry for each process and parameter; and for each part whose mean is told by itself."""
    for one in result.processes:
        shared = one.indices.items()
        for name in one.parameters:
            means = [mean for mean in result.means if (mean.key, mean.parameter) == (one.key, name)]
            own = [mean for mean in means if mean.indices.items() == shared]
            yield _process(one, name, one.indices, own[-1] if own else None)
            yield from (_process(one, name, part.indices, part) for part in means if part.indices.items() > shared)


def _process(one: MadeBy, parameter: str, indices: Mapping[str, IndexValue], mean: Shift | None) -> dict[str, Any]:
    sizes: dict[str, Field] = {"sd": ("deviation.value", OWN), "sd_interval": ("deviation", OWN), "unit": OWN_NAME}
    return {
        "parameter": parameter,
        "indices": dict(indices),
        **entry(mean, one.dimension, mean=("size.value", OWN), mean_interval=("size", OWN)),
        **entry(
            one, one.dimension, **sizes, key=None, above_zero=None, share=NUMBER, cpk=("capability_centred", NUMBER)
        ),
        "with": list(one.alike),
    }


def _difference(row: tuple[Any, Shift], **before: Field) -> dict[str, Any]:
    """What has a systematic error, and the error."""
    difference, interval = ("1.size.value", OWN), ("1.size", OWN)
    place = same_unit(None, "key", "indices", "parameter", within="1.")
    return entry(row, row[1].dimension, **before, **place, difference=difference, interval=interval, unit=OWN_NAME)


def _added(causes: Sequence[Shift], rivals: Sequence[str]) -> list[dict[str, Any]]:
    """Causes by their place, each with its parameters."""
    sizes = same_unit(OWN, "value", "low", "high", within="size.")
    return [
        {
            "key": key,
            "indices": indices,
            "parameters": {one.parameter: entry(one, one.dimension, unit=OWN_NAME, **sizes) for one in some},
            "indistinguishable_from": list(rivals),
        }
        for (key, indices), some in itertools.groupby(causes, lambda one: (one.key, dict(one.indices)))
    ]


# --- a lot: for people ------------------------------------------------------------------------------------------------


def _lot_verdict(lot: Lot) -> tuple[str, str]:
    """Whether the processes describe the lot."""
    chance = brief(lot.chance, 2)
    if lot.chance >= _LACKING:
        return "The processes account for the lot", f" (p = {chance})."
    return "The model lacks something", (
        f": a lot that these processes make departs as far from them with p = {chance}. Sizes below may stand for what "
        "is lacking; their intervals are widened for it. Measure at a greater torque, or declare what all units share."
    )


def _lot_sentences(lot: Lot) -> Iterator[str]:
    """What is not told apart, what does not show, what was looked for and not found."""
    for one in lot.processes:
        if one.alike and one.deviation is not None:
            others = some_of(one.alike)
            yield f"{process_name(one)} cannot be distinguished from {others}: the size is that of all together."
    unseen = [process_name(one) for one in lot.processes if one.deviation is None]
    if unseen:
        yield f"These conditions do not show {', '.join(unseen)}."
    found: list[tuple[str, Sequence[str]]] = [
        *((f"unit {one.serial}", one.rivals) for one in lot.outsiders if one.causes),
        *((f"{one.label} {one.value}", one.rivals) for one in lot.differences),
        *((f"change since {one.since}", one.rivals) for one in lot.changes),
    ]
    yield from (f"For {what} these fit as well: {some_of(others)}." for what, others in found if others)
    unclear = [one for one in lot.outsiders if one.rivals and not one.causes]
    yield from (f"Unit {one.serial} has a gross error of one of these: {some_of(one.rivals)}." for one in unclear)
    yield from _diagnosed(lot)
    looked: dict[str, Sequence[object]] = {"units that do not belong to the lot": lot.outsiders}
    if lot.marked:
        looked |= {"systematic errors": lot.shifts, "groups that differ": lot.differences}
        looked |= {"changes over the serial numbers": lot.changes}
    none = [what for what, some in looked.items() if not some]
    if none:
        yield f"Looked for and not found: {', '.join(none)}."
    for one in lot.processes:
        if one.above_zero and one.capability_centred is not None and one.capability_centred < 1:
            yield (
                f"Next: reduce the scatter of {process_name(one)}, or widen its tolerance: Cpk "
                f"{brief(one.capability_centred, 2)} is below 1."
            )
    if lot.differences or lot.changes:
        yield "Peak-to-peaks are those without the differences and changes named above."


def _diagnosed(lot: Lot) -> Iterator[str]:
    """A sentence for each unit that was diagnosed by itself."""
    for one in lot.outsiders:
        if one.diagnosis is not None:
            added = [
                f"{describe(a.effect.key, a.effect.indices)} ({', '.join(map(_size, a.estimates))})"
                for a in one.diagnosis.added
            ]
            verdict = one.diagnosis.verdict.replace("_", " ")
            yield f"Diagnosis of unit {one.serial} alone: {verdict}; {'; '.join(added) or 'no cause named'}."


def _size(one: Estimate) -> str:
    value, low, high = (brief(to_display(x, one.dimension)) for x in (one.value, one.low, one.high))
    return f"{one.name} {value} {DISPLAY_UNITS[one.dimension]}, {low} to {high}"


# --- drives -----------------------------------------------------------------------------------------------------------


@described.register
def _drive_lot_table(result: DriveLot) -> Table:
    sizes = same_unit(ANGLE, "least", "median", "most")
    own: dict[str, Field] = {"unit": "serial", "order": NUMBER, "distance": NUMBER, "chance": NUMBER, "condition": None}
    variables = {
        **rows("place", result.orders, order=NUMBER, chance=NUMBER, condition=None, **sizes, phase=POSITION),
        **rows("place", result.orders, spread=ANGLE, **sized("mean", ANGLE, "mean")),
        **rows("own", result.own, "own_", **own, amplitude=ANGLE, difference=ANGLE),
        **rows(
            "pair",
            result.pairs,
            "pair_",
            one="serials.0",
            other="serials.1",
            **same_unit(ANGLE, "difference", "usual"),
            chance=NUMBER,
        ),
        **arrays("unit", result, unit="serials"),
        **arrays("unit place", result, amplitude=("amplitudes", ANGLE)),
    }
    shared = [str(one.order) for one in result.orders if one.shared]
    orders = f"Order {shared[0]} has" if len(shared) == 1 else f"Orders {', '.join(shared)} have"
    strong = f"{orders if shared else 'No order has'} the same phase in all units"
    different = count_of(len({one.serial for one in result.own}), "unit")
    pairs = count_of(len(result.pairs), "pair")
    return Table(
        variables,
        about(result, "model", "conditions", "notes"),
        title=(result.model, count_of(len(result.serials), "unit")),
        verdict=(strong, f". Differing from the others: {different}; nearly equal: {pairs}."),
    )


# --- matched units ----------------------------------------------------------------------------------------------------


@described.register
def _matched_table(result: Matched) -> Table:
    units = result.units
    left = [(kind, serial) for kind, serials in result.left.items() for serial in serials]
    at = {place_name(part): place for place, part in enumerate(units[0].parts)}
    placed: dict[str, Field] = {name: f"parts.{place}.serial" for name, place in at.items()}
    for name, place in at.items():
        if any(unit.parts[place].turn for unit in units):
            placed[f"{name}_turn"] = (f"parts.{place}.turn", COUNT)
    if any(unit.chance < 1 for unit in units):
        placed["probability"] = ("chance", PERCENT)
    turns = {one.label: ([unit.turns[at] for unit in units], ANGLE) for at, one in enumerate(result.quantities)}
    yields: dict[str, Field] = {"yield": ("share", PERCENT), "p95": PERCENT, "cost": NUMBER}
    variables = {
        **arrays("unit", np.arange(1, len(units) + 1), unit=("", COUNT)),
        **rows("unit", units, **placed),
        **{label: Variable(("unit",), of, unit) for label, (of, unit) in turns.items()},
        **rows("quantity", result.quantities, quantity="label"),
        **arrays("quantity", result, limit=("allowed", ANGLE)),
        **rows("way", result.ways, way="name", units=("errors.size", COUNT), **yields),
        **rows("left", left, "left_", kind="0", serial="1"),
    }
    limits = zip(result.quantities, result.allowed, strict=True)
    named = [name for name in ("unit", *placed, *turns) if not name.startswith("roller")]  # the spreadsheet has those
    good = sum(unit.chance for unit in units)
    expected = f" With the uncertainty of the sizes {brief(good, 3)} are expected to meet them." * (good < len(units))
    return Table(
        variables,
        about(result, "model", "possible", "bound", "doubt", "notes"),
        title=(result.model, "; ".join(f"{one.label}: {with_unit(x, 'angle')}" for one, x in limits)),
        verdict=(
            f"{len(units)} of {result.possible} possible units meet the limits",
            f"; each is solved under load. By linear influences no way to assemble these parts gives more than "
            f"{result.bound}.{expected}",
        ),
        facts={f"{kind}, {len(some)} left over": _serials(some) for kind, some in result.left.items()},
        shown={"unit": named, "left": (), "quantity": ()},
    )


@entries.register
def _matched_content(result: Matched) -> dict[str, Any]:
    of_error = [at for at, one in enumerate(result.quantities) if one.span]
    return {
        "units": [
            {
                "parts": {place_name(part): part.serial for part in unit.parts},
                "turns": {place_name(part): part.turn for part in unit.parts},
                "peak_to_peak_arcsec": in_arcsec(max((unit.turns[at] for at in of_error), default=None)),
            }
            for unit in result.units
        ],
        "left": {kind: list(serials) for kind, serials in result.left.items()},
        "yield": result.share,
        "yield_at_random": result.ways[0].share,
        "bound": result.bound,
    }


def _serials(some: Sequence[str]) -> str:
    """Serial numbers of parts that stay."""
    return some_of([serial + f" ({count})" * (count > 1) for serial, count in Counter(some).items()])


def place_name(part: MountedPart) -> str:
    """Column of a part's place: ``disc_1``."""
    return part.kind if part.place is None else f"{part.kind}_{part.place}"
