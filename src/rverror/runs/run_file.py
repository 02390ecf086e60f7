"""Run files as rverror writes them: comma-separated text, ``# key: value`` lines above the names, units in brackets."""

from __future__ import annotations

import numpy as np

from rverror.base.arrays import Array
from rverror.base.text import PathLike, did_you_mean, shown
from rverror.runs.checks import LEAST_SAMPLES
from rverror.runs.reading import (
    COLUMNS,
    DIRECTIONS,
    EXAMPLES,
    HEADER_KEYS,
    Reading,
    check_needed,
    checked_value,
    refuse,
)
from rverror.runs.text_table import (
    NUMERALS,
    TextTable,
    cells_of,
    column_names,
    column_unit,
    header_number,
    opened,
)

_MAPPING = ", or describe the file in a mapping (rverror read FILE --draft begins one)"
_NAMES = "input_angle[deg],output_angle[deg]"


def read_run_file(path: PathLike) -> Reading:
    """Read a run file.

    Raises
    ------
    InputError
        If the text cannot be used; one line that names file, line, column, bound and remedy.
    """
    text = opened(
        path,
        keys=HEADER_KEYS,
        names=_NAMES,
        needed=f"{LEAST_SAMPLES} samples or more are needed",
        remedy=", and each run in a file of its own",
        otherwise=_MAPPING,
    )
    factors = _columns(text)
    table = _numbers(text, len(factors))
    columns: dict[str, Array] = {}
    extra: dict[str, Array] = {}
    for (label, factor), values in zip(factors.items(), table.T, strict=True):
        if factor is None:
            extra[label] = values
        else:
            with np.errstate(over="ignore"):  # what overflows is left out later, and counted
                columns[label] = values * factor
    return Reading(
        path=text.path,
        columns=columns,
        extra=extra,
        labels=np.array(text.rows) + 1,
        noun="line",
        stated=_stated_direction(text),
        stated_at=f"line {text.header['direction'].line}: " if "direction" in text.header else "",
        torque=_header_value(text, "output_torque", "torque"),
        temperature=_header_value(text, "temperature", "temperature"),
        index=text.header["index"].value if "index" in text.header else "",
        metadata=text.metadata,
        notes=text.notes(HEADER_KEYS),
    )


def _header_value(text: TextTable, key: str, dimension: str) -> float | None:
    number = header_number(text, key, dimension)
    where = f"line {text.header[key].line}: {key}" if key in text.header else ""
    return None if number is None else checked_value(text.path, where, number, dimension)


def _stated_direction(text: TextTable) -> float | None:
    """+1, -1, 0 for mixed, None where nothing is said."""
    if "direction" not in text.header:
        return None
    stated = text.header["direction"]
    if stated.value.lower() not in DIRECTIONS:
        hint = did_you_mean(stated.value, DIRECTIONS)
        refuse(
            text.path,
            f"line {stated.line}: direction = {shown(stated.value)}: must be forward, reverse or mixed;"
            f"{hint or ' use one'}",
        )
    return DIRECTIONS[stated.value.lower()]


def _columns(text: TextTable) -> dict[str, float | None]:
    """Columns by name, in their order: core units for one of a known column's numbers, None for the others."""
    factors: dict[str, float | None] = {}
    for at, cell, name in column_names(text, names=_NAMES, example="input_angle[deg]", otherwise=_MAPPING):
        known = name if name in COLUMNS else None
        key = known or cell
        if key in factors:
            refuse(text.path, f"{at}: {key} stands in column {list(factors).index(key) + 1} too; leave one of them")
        if known is None:
            factors[key] = None
            continue
        factors[key], _ = column_unit(
            text.path, at, cell=cell, name=known, example=EXAMPLES[known], dimension=COLUMNS[known]
        )
    check_needed(text.path, f"line {text.first + 1}", list(factors), _MAPPING)
    return factors


def _numbers(text: TextTable, width: int) -> Array:
    """Parse all rows at once; only where that fails look at each line."""
    try:
        lines = [text.lines[i] for i in text.rows]
        table: Array = np.loadtxt(lines, delimiter=",", dtype=np.float64, ndmin=2)
        if table.shape == (len(lines), width):
            return table
    except ValueError:
        pass
    table = np.full((len(text.rows), width), np.nan)
    for row, place in enumerate(text.rows):
        for column, cell in enumerate(cells_of(text, place, width)):
            value = NUMERALS.parse(cell)
            if value is not None:
                table[row, column] = value
    return table
