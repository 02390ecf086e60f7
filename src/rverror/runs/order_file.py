"""Order tables as text and from arrays: ``# kind: orders`` above a run file's kind of rows, each one wave.

Units in brackets.  Whatever is wrong is refused in one line, or, where the rest is usable, left out and counted in
`notes`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array, Flags
from rverror.base.directions import direction_signs
from rverror.base.errors import check_kind, refusing
from rverror.base.numbers import count_of, way, with_unit
from rverror.base.text import PathLike, check_path, file_head, split_lines, write_file
from rverror.runs.bench.mapping import BenchMapping, given_mapping
from rverror.runs.bench.order_rows import KIND, check_order_columns, read_order_rows
from rverror.runs.order_table import OrderCase, OrderTable, TableCondition, Waves
from rverror.runs.reading import (
    DIMENSIONS,
    HEADER_LINE,
    ORDER_CONDITIONS,
    ORDER_KEYS,
    UNITS,
    Reading,
    check_lengths,
    header_lines,
    refuse,
    row_of,
)

#: Attribute of a condition that has the number of a column.
_ATTRIBUTES = {name: name for name in ("direction", *ORDER_CONDITIONS)} | {"output_torque": "torque"}
_SAME = 1e-9  # relative: numbers that are the same but for their digits
_HEAD_BYTES = 65536
_MADE = "order table"  # what messages call one that was made in memory


# --- reading ----------------------------------------------------------------------------------------------------------


def is_order_file(path: PathLike) -> bool:
    """Tell whether the header of a file says ``# kind: orders``.

    Returns
    -------
    bool
        False too for what cannot be read: whoever reads it says why.

    Examples
    --------
    >>> is_order_file("no-such-file.csv")
    False
    """
    check_path(path)
    for line in split_lines(file_head(path, _HEAD_BYTES).decode("utf-8-sig", "replace")):
        text = line.strip()
        if text and not text.startswith("#"):
            return False
        match = HEADER_LINE.match(text)
        if match is not None and match[1].lower() == "kind":
            return match[2].lower() == KIND
    return False


def refuse_order_file(path: PathLike) -> None:
    """Refuse an order table where samples are needed.

    Raises
    ------
    InputError
        If the file is one.
    """
    if is_order_file(path):
        refuse(str(path), "an order table holds no samples, and only diagnose takes one; give a run file here")


def load_orders(path: PathLike, mapping: PathLike | BenchMapping | None = None) -> OrderTable:
    """Read an order table.

    Parameters
    ----------
    path : str or path-like
        A text whose header says ``# kind: orders``; with a mapping, a table as a bench's report has it.
    mapping : str, path-like or BenchMapping, optional
        The bench's names, units and words; see docs page ``bench-files.md``.

    Returns
    -------
    OrderTable
        Cases in the order in which they appear, each with its orders growing.

    Raises
    ------
    InputError
        If the file cannot be used; one line that names file, line, column, bound and remedy.

    Notes
    -----
    Columns: ``order``; ``amplitude[arcsec]`` and ``phase[deg]``, or ``cos[arcsec]`` and ``sin[arcsec]``; optionally
    ``sigma[arcsec]``, the standard deviation of each of the last two.  The conditions ``direction``,
    ``output_torque[N*m]``, ``input_speed[rpm]`` and ``temperature[degC]`` are columns or, where one value holds for all
    rows, lines of the header like ``# output_torque: 20 N*m``.  Only the direction is needed.

    The transmission error is the sum of amplitude cos(order theta + phase) over the rows of a condition; theta, the
    output angle, grows in both directions.  Orders that are not listed are not known, not zero.
    """
    mapping = given_mapping(mapping)
    if mapping is None or is_order_file(path):
        mapping = BenchMapping()
    return _table(read_order_rows(path, mapping))


# --- rows become a table ----------------------------------------------------------------------------------------------


#: Columns whose numbers have a bound of 0, those that must lie above it, and what to do.
_BOUNDED = {
    "order": "must be above 0, in waves per output turn",
    "output_torque": "must be 0 or more; give its size, the direction stands in a column",
    "input_speed": "must be 0 or more; give its size, the direction stands in a column",
    "temperature": "lies below absolute zero; check the sign and the unit",
    "amplitude": "must be 0 or more; write the size, and 180 deg more in the phase",
    "sigma": "must be above 0; leave the column out where it is not known",
}
_ABOVE = ("order", "sigma")


def _table(rows: Reading) -> OrderTable:
    notes = list(rows.notes)
    columns = {name: np.where(np.isfinite(values), values, np.nan) for name, values in rows.columns.items()}
    _check_stated(rows, columns)
    columns |= {name: np.full(len(rows.labels), value) for name, (value, _) in rows.stated.items()}
    if (missing := np.isnan(columns["order"])).any():
        at = rows.at(int(np.argmax(missing)))
        rows.refuse(f"{at}: order is no number; write the waves per output turn, or delete the row")
    _check_bounds(rows, columns)
    waves = _waves(rows, columns)
    sigma = _sigma(rows, columns, waves, notes)
    conditions = [name for name in _ATTRIBUTES if name in columns]
    usable = np.isfinite(waves) & np.isfinite([columns[name] for name in conditions]).all(axis=0)
    _note_left_out(rows, ~usable, notes)
    cases: dict[TableCondition, dict[float, int]] = {}
    doubled = []
    for row in np.flatnonzero(usable).tolist():
        order = float(columns["order"][row])
        known = {_ATTRIBUTES[name]: float(columns[name][row]) for name in conditions}
        case = cases.setdefault(TableCondition(**known), {})
        first = case.setdefault(order, row)
        if first == row:
            continue
        same = abs(waves[row] - waves[first]) <= _SAME * abs(waves[first])
        if not same or (sigma is not None and abs(sigma[row] - sigma[first]) > _SAME * sigma[first]):
            rows.refuse(
                f"{rows.at(row)}: order {order:g} stands in {rows.at(first)} with another wave under the same "
                "condition; leave one of them"
            )
        doubled.append(row)
    if doubled:
        notes.append(f"{count_of(len(doubled), 'doubled row')} left out {rows.listed(doubled)}")
    made = []
    for condition, case in cases.items():
        picked = [case[order] for order in sorted(case)]
        spread = None if sigma is None else sigma[picked]
        made.append(OrderCase(condition=condition, orders=np.array(sorted(case)), waves=waves[picked], sigma=spread))
    return OrderTable(path=rows.path, cases=tuple(made), index=rows.index, metadata=rows.metadata, notes=tuple(notes))


def _check_bounds(rows: Reading, columns: Mapping[str, Array]) -> None:
    for name, remedy in _BOUNDED.items():
        values = columns.get(name, np.zeros(0))
        wrong = values <= 0 if name in _ABOVE else values < 0
        if wrong.any():
            row = int(np.argmax(wrong))
            at = rows.stated[name][1] if name in rows.stated else rows.at(row)
            rows.refuse(f"{at}: {name} = {_printed(name, values[row])}: {remedy}")


def _check_stated(rows: Reading, columns: Mapping[str, Array]) -> None:
    """Refuse a condition whose column says something else than the header."""
    for name, (value, where) in rows.stated.items():
        if name not in columns:
            continue
        other = np.abs(columns[name] - value) > _SAME * max(abs(value), 1.0)  # false for NaN
        if other.any():
            row = int(np.argmax(other))
            found, said = _printed(name, columns[name][row]), _printed(name, value)
            rows.refuse(f"{rows.at(row)}: {name} = {found}, but {where} says {said}; leave one of them")


def _printed(name: str, value: float) -> str:
    """Value of a column for people."""
    if name == "direction":
        return way(value)
    return with_unit(value, DIMENSIONS[name]) if DIMENSIONS[name] else f"{value:g}"


def _waves(rows: Reading, columns: Mapping[str, Array]) -> Waves:
    """z of each row; NaN where neither of its two numbers is there."""
    one, other = ("cos", "sin") if "cos" in columns else ("amplitude", "phase")
    first, second = columns[one], columns[other]
    half = np.isnan(first) != np.isnan(second)
    if one == "amplitude":
        half &= np.isnan(second)  # a phase alone tells of no wave
    if half.any():
        row = int(np.argmax(half))
        there, missing = (one, other) if math.isnan(second[row]) else (other, one)
        rows.refuse(f"{rows.at(row)}: {there} without {missing}; give {missing} as a number, or delete the row")
    if one == "cos":
        return np.asarray(first - 1j * second, dtype=np.complex128)
    with np.errstate(invalid="ignore"):
        return np.asarray(first * np.exp(1j * second), dtype=np.complex128)


def _sigma(rows: Reading, columns: Mapping[str, Array], waves: Waves, notes: list[str]) -> Array | None:
    if "sigma" not in columns:
        return None
    sigma = columns["sigma"]
    empty = np.isnan(sigma[np.isfinite(waves)])
    if empty.all():
        notes.append("sigma holds no number and is left out")
        return None
    if empty.any():
        at = rows.at(int(np.argmax(np.isfinite(waves) & np.isnan(sigma))))
        rows.refuse(f"{at}: no sigma, but other rows have one; give it in every row or in none")
    return sigma


def _note_left_out(rows: Reading, left: Flags, notes: list[str]) -> None:
    count = int(np.count_nonzero(left))
    if count == left.size:
        listed = f" {rows.listed(left)}" if count else ""
        rows.refuse(f"no usable rows{listed}; give 1 or more with a number in every column")
    if count:
        notes.append(f"{count_of(count, 'row')} without a number left out {rows.listed(left)}")


# --- tables in memory -------------------------------------------------------------------------------------------------


def orders_from_arrays(
    *,
    direction: Any,
    order: Any,
    amplitude: Any | None = None,
    phase: Any | None = None,
    cos: Any | None = None,
    sin: Any | None = None,
    sigma: Any | None = None,
    torque: Any | None = None,
    input_speed: Any | None = None,
    temperature: Any | None = None,
    index: str = "",
    metadata: Mapping[str, str] | None = None,
) -> OrderTable:
    """Make an order table in memory, with the checks of a file.

    Parameters
    ----------
    direction : {"forward", "reverse"} or +1 or -1, or sequence of them, shape (n,)
        One for all rows, or one for each.
    order : array_like, shape (n,)
        Waves per output turn.
    amplitude, phase : array_like or quantity, shape (n,), optional
        The error is the sum of amplitude cos(order theta + phase); plain numbers are rad.
    cos, sin : array_like or quantity, shape (n,), optional
        Sizes of cos(order theta) and sin(order theta), in place of amplitude and phase.
    sigma : array_like or quantity, shape (n,), optional
        Standard deviation of either size.
    torque, input_speed, temperature : float, str or quantity, or array_like of shape (n,), optional
        One for all rows, or one for each; plain numbers are N*mm, rad/s and K.
    index : str, optional
        Label of the zero, as a run has it.
    metadata : mapping of str to str, optional

    Returns
    -------
    OrderTable

    Raises
    ------
    InputError
        If the values cannot be used.

    Examples
    --------
    >>> table = orders_from_arrays(direction="forward", torque="20 N*m", order=[40, 39], cos=[2e-5, 1e-5], sin=[0, 0])
    >>> table.cases[0].orders, table.cases[0].condition.torque
    (array([39., 40.]), 20000.0)
    """
    conditions = {"input_speed": input_speed, "temperature": temperature, "output_torque": torque}
    waves = {"order": order, "amplitude": amplitude, "phase": phase, "cos": cos, "sin": sin, "sigma": sigma}
    row = partial(row_of, path=_MADE)
    columns = {name: row(name, value, DIMENSIONS[name]) for name, value in waves.items() if value is not None}
    check_order_columns(_MADE, "columns", columns)
    stated = {}
    for name, value in conditions.items():
        if value is None:
            continue
        if np.ndim(getattr(value, "magnitude", value)):
            columns[name] = row(_ATTRIBUTES[name], value, DIMENSIONS[name])
        else:
            stated[name] = units.named_core(f"{_MADE}: {_ATTRIBUTES[name]}", value, DIMENSIONS[name]), "all rows"
    with refusing(f"{_MADE}: "):
        signs = direction_signs(direction)
    if signs.ndim:
        columns["direction"] = signs
    else:
        stated["direction"] = (float(signs), "all rows")
    sizes = {_ATTRIBUTES.get(name, name): values.size for name, values in columns.items()}
    check_lengths(_MADE, sizes, "give all the same number of rows")
    rows = _rows(columns, stated=stated, index=index, metadata=dict(metadata or {}))
    return replace(_table(rows), path="")


def _rows(columns: Mapping[str, Array], **stated: Any) -> Reading:
    """Rows in memory."""
    return Reading(path=_MADE, labels=np.arange(columns["order"].size), noun="row", columns=columns, **stated)


# --- writing ----------------------------------------------------------------------------------------------------------


def write_orders(path: PathLike, table: OrderTable, *, overwrite: bool = False) -> None:
    """Write an order table, in one step or not at all.

    Parameters
    ----------
    path : str or path-like
    table : OrderTable
        Its waves are written as amplitude and phase with 15 digits; its notes are not.
    overwrite : bool
        Whether an existing file may be replaced.

    Raises
    ------
    InputError
        If the file exists, cannot be written, or the table would not read back.
    """
    check_path(path)
    check_kind("table", table, OrderTable, "write it as write_orders(path, table)")
    write_file(path, orders_text(table, path=str(path)), overwrite=overwrite)


def orders_text(table: OrderTable, *, path: str = "", comments: Sequence[str] = ()) -> str:
    """Text of an order table, as `write_orders` writes it.

    Parameters
    ----------
    table : OrderTable
    path : str
        Of the file, for messages.
    comments : sequence of str
        Lines above the names that are no header.

    Raises
    ------
    InputError
        If the table would not read back.

    Examples
    --------
    >>> table = orders_from_arrays(direction="reverse", torque="20 N*m", order=[40.0], cos=[0.0], sin=[-1e-5])
    >>> print(orders_text(table), end="")
    # kind: orders
    direction,output_torque[N*m],order,amplitude[arcsec],phase[deg]
    reverse,20,40,2.06264806247096,90
    """
    values = {"kind": KIND} | ({"index": table.index} if table.index else {})
    values |= {key: value for key, value in table.metadata.items() if key.lower() not in ORDER_KEYS}
    path = path or _MADE
    head = [*header_lines(path, values), *(f"# {comment}" for comment in comments)]
    columns = _written(path, table)
    cells = {"direction": list(map(way, columns.pop("direction")))}
    for name, numbers in columns.items():
        unit = UNITS[name]
        factor, zero = units.unit_scale(unit, DIMENSIONS[name]) if unit else (1.0, 0.0)
        digits = 14 if zero else 15
        cells[f"{name}[{unit}]" if unit else name] = [f"{(number - zero) / factor:.{digits}g}" for number in numbers]
    rows = map(",".join, zip(*cells.values(), strict=True))
    return "\n".join([*head, ",".join(cells), *rows, ""])


def _written(path: str, table: OrderTable) -> dict[str, Array]:
    """Columns of a table, core units, once the checks of a file have passed them."""
    cases, columns = table.cases, dict[str, Array]()
    found: dict[str, list[Any]] = {
        name: [getattr(case.condition, of) for case in cases] for name, of in _ATTRIBUTES.items()
    }
    found["order"] = [case.orders for case in cases]
    found["amplitude"], found["phase"] = ([of(case.waves) for case in cases] for of in (np.abs, np.angle))
    found["sigma"] = [case.sigma for case in cases]
    for name, values in found.items():
        missing = sum(value is None for value in values)
        if 0 < missing < len(cases):
            what = f"{missing} of {len(cases)} cases have no {_ATTRIBUTES.get(name, name)}, others have"
            refuse(path, f"{what}; complete them, or write a file of each kind")
        if not missing:
            each = (
                np.full(case.orders.size, value) if np.ndim(value) == 0 else value
                for case, value in zip(cases, values, strict=True)
            )
            columns[name] = np.concatenate([np.zeros(0), *each])
    sizes = {name: values.size for name, values in columns.items()}
    check_lengths(path, sizes, "give each order one wave and one sigma")
    direction_signs(columns["direction"])
    if not all(np.isfinite(values).all() for values in columns.values()):
        refuse(path, "the table holds values that are not finite; leave those orders out")
    _table(_rows(columns))
    return columns
