"""Run files as rverror writes them: comma-separated text, ``# key: value`` lines above the names, units in brackets."""

from __future__ import annotations

import numpy as np

from rverror.base.arrays import Array
from rverror.base.text import PathLike, did_you_mean, shown
from rverror.runs.checks import LEAST_SAMPLES
from rverror.runs.reading import (
    COLUMNS,
    EXAMPLES,
    HEADER_KEYS,
    STATED,
    Reading,
    check_needed,
    checked_value,
)
from rverror.runs.text_table import NUMERALS, TextKind, TextTable, opened

_RUN = TextKind(
    keys=HEADER_KEYS,
    dimensions=COLUMNS,
    examples=EXAMPLES,
    names="input_angle[deg],output_angle[deg]",
    example="input_angle[deg]",
    needed=f"{LEAST_SAMPLES} samples or more are needed",
    remedy=", and each run in a file of its own",
    otherwise=", or describe the file in a mapping (rverror read FILE --draft begins one)",
)


def read_run_file(path: PathLike) -> Reading:
    """Read a run file.

    Raises
    ------
    InputError
        If the text cannot be used; one line that names file, line, column, bound and remedy.
    """
    text = opened(path, _RUN)
    scales = text.scales()
    check_needed(text.path, f"line {text.first + 1}", list(scales), _RUN.otherwise)
    columns: dict[str, Array] = {}
    extra: dict[str, Array] = {}
    for (label, scale), values in zip(scales.items(), _numbers(text, len(scales)).T, strict=True):
        if scale is None:
            extra[label] = values
        else:
            with np.errstate(over="ignore"):  # what overflows is left out later, and counted
                columns[label] = values * scale[0]
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
        index=text.index,
        metadata=text.metadata,
        notes=text.notes,
    )


def _header_value(text: TextTable, key: str, dimension: str) -> float | None:
    number = text.number(key, dimension)
    where = f"line {text.header[key].line}: {key}" if key in text.header else ""
    return None if number is None else checked_value(text.path, where, number, dimension)


def _stated_direction(text: TextTable) -> float | None:
    """+1, -1, 0 for mixed, None where nothing is said."""
    if "direction" not in text.header:
        return None
    stated = text.header["direction"]
    if stated.value.lower() not in STATED:
        hint = did_you_mean(stated.value, STATED)
        text.refuse(
            f"line {stated.line}: direction = {shown(stated.value)}: must be forward, reverse or mixed;"
            f"{hint or ' use one'}"
        )
    return STATED[stated.value.lower()]


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
    for row, cells in enumerate(text.cells(width)):
        for column, cell in enumerate(cells):
            value = NUMERALS.parse(cell)
            if value is not None:
                table[row, column] = value
    return table
