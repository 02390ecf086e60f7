"""What a lot says, in words: names of processes and shifts, sentences for people."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rverror.base.numbers import brief, count_of
from rverror.base.text import describe
from rverror.base.units import DISPLAY_UNITS, to_display
from rverror.diagnosis.result import Estimate
from rverror.lots.result import Lot, MadeBy, Shift
from rverror.model.catalogue import source

#: Below it the model lacks something.
LACKING = 0.001
COME = "Peak-to-peaks are those without the differences and changes named above."


def process_name(one: MadeBy) -> str:
    """Process, with its parameters where not all of the source's are meant."""
    named = describe(one.key, one.indices)
    few = len(one.parameters) < len(source(one.key).parameters)
    return f"{named} {', '.join(one.parameters)}" if few else named


def shift_name(one: Shift) -> str:
    """Source and place of a systematic error; the parameter stands in a column of its own."""
    return describe(one.key, one.indices)


def verdict(lot: Lot) -> tuple[str, str]:
    """Whether the processes describe the lot, and the words of it to be read first."""
    if lot.chance < LACKING:
        strong = "The model lacks something"
        rest = f"lots of these processes are as far from what they make with a chance of {brief(lot.chance, 2)}"
        return (
            f"{strong}: {rest}; sizes below may stand for what it lacks, and their intervals are wider for it: measure "
            "at a greater torque, or declare what all units share",
            strong,
        )
    strong = "The processes describe the lot"
    return f"{strong} (chance {brief(lot.chance, 2)})", strong


def silent(lot: Lot) -> str:
    """Processes that do not show; empty where all do."""
    names = [process_name(one) for one in lot.processes if one.deviation is None]
    return f"Do not show under these conditions: {', '.join(names)}" if names else ""


def not_told_apart(lot: Lot) -> Iterator[str]:
    """A sentence for each process that stands for others too."""
    for one in lot.processes:
        if one.alike and one.deviation is not None:
            yield f"{process_name(one)} is not told apart from {', '.join(one.alike)}: the size is that of all together"


def rivals(lot: Lot) -> Iterator[str]:
    """A sentence for each finding that something else would do as well."""
    found: list[tuple[str, Sequence[str]]] = [
        *((f"unit {one.serial}", one.rivals) for one in lot.outsiders),
        *((f"{one.label} {one.value}", one.rivals) for one in lot.differences),
        *((f"change since {one.since}", one.rivals) for one in lot.changes),
    ]
    yield from (f"As well for {what}: {', '.join(others)}" for what, others in found if others)


def diagnosed(lot: Lot) -> Iterator[str]:
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


def clean(lot: Lot) -> str:
    """What was looked for and not found; empty where everything was."""
    looked = {
        "systematic error": lot.shifts,
        "unit that is no member": lot.outsiders,
        "group that differs": lot.differences,
        "change over the serials": lot.changes,
    }
    none = [what for what, found in looked.items() if not found]
    return f"Found: no {', no '.join(none)}" if none else ""


def size_of(lot: Lot) -> str:
    """How many units were used."""
    return count_of(lot.units, "unit")
