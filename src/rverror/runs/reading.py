"""What readers hand over, columns in core units before any check, and the words of run files and order tables."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NoReturn

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array, Flags, Integers
from rverror.base.directions import DIRECTIONS
from rverror.base.errors import InputError, refusing
from rverror.base.text import did_you_mean, shown, some, split_lines

#: Dimension of every column that a file may have, and the unit in which people write it; orders and words have none.
_COLUMNS = {
    "input_angle": ("angle", "deg"),
    "output_angle": ("angle", "deg"),
    "te": ("angle", "arcsec"),
    "time": ("time", "s"),
    "output_torque": ("torque", "N*m"),
    "torque": ("torque", "N*m"),
    "input_speed": ("angular_speed", "rpm"),
    "output_speed": ("angular_speed", "rpm"),
    "temperature": ("temperature", "degC"),
    "direction": ("", ""),
    "order": ("", ""),
    "amplitude": ("angle", "arcsec"),
    "phase": ("angle", "deg"),
    "cos": ("angle", "arcsec"),
    "sin": ("angle", "arcsec"),
    "sigma": ("angle", "arcsec"),
}
DIMENSIONS = {name: dimension for name, (dimension, _) in _COLUMNS.items()}
UNITS = {name: unit for name, (_, unit) in _COLUMNS.items()}
RUN_COLUMNS = ("input_angle", "output_angle", "te", "time", "output_torque", "torque")
#: Columns of a bench that are integrated over time, and the columns that they make.
SPEEDS = {"input_speed": "input_angle", "output_speed": "output_angle"}
#: Conditions of an order table that are numbers.
ORDER_CONDITIONS = ("input_speed", "temperature", "output_torque")
ORDER_COLUMNS = ("direction", *ORDER_CONDITIONS, "order", "amplitude", "phase", "cos", "sin", "sigma")
#: Keys of the header that have a meaning.
HEADER_KEYS = ("direction", "output_torque", "temperature", "index")
#: Those that have one in order tables.
ORDER_KEYS = ("kind", *HEADER_KEYS, "input_speed")
#: What may be stated of the direction.
STATED = {**DIRECTIONS, "mixed": 0.0}
#: Name of a column, with its unit in brackets or without.
COLUMN_NAME = re.compile(r"([^\[\]]*?)\s*(?:\[([^\[\]]*)\])?$")
#: A line of the header.
HEADER_LINE = re.compile(r"#+\s*([A-Za-z_][\w .\-/]*?)\s*:\s*(.*?)\s*$")


def bare_name(name: str) -> str:
    """Name of a column in lower case, without its unit in brackets.

    Examples
    --------
    >>> bare_name("Output_Angle [deg]")
    'output_angle'
    """
    match = COLUMN_NAME.match(name)
    return match[1].strip().lower() if match else ""


@dataclass(frozen=True, kw_only=True)
class Stated:
    """A value that a header states.

    Attributes
    ----------
    text : str
        As written.
    at : str
        Where it stands, for messages.
    """

    text: str
    at: str


def header_lines(path: str, values: Mapping[str, str]) -> list[str]:
    """Lines of a header.

    Raises
    ------
    InputError
        If one would not read back.
    """
    head = [f"# {key}: {value}" for key, value in values.items()]
    for line, (key, value) in zip(head, values.items(), strict=True):
        match = HEADER_LINE.match(line)
        if len(split_lines(line)) > 1 or match is None or match.groups() != (key, value.strip()):
            refuse(path, f"the header {shown(line)} would not read back; use a plain word for the key and one line")
    return head


class OfFile:
    """What was read of a file, `path`, and is refused by the file's name."""

    path: str

    def refuse(self, message: str) -> NoReturn:
        """Refuse it, in one line that begins with its file.

        Raises
        ------
        InputError
            Always.
        """
        refuse(self.path, message)


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading(OfFile):
    """Columns of a run or an order table as read, in core units, and what was said of them.

    Attributes
    ----------
    path : str
        File, as given, or what messages call rows that were made in memory; empty for a run.
    columns : mapping of str to ndarray, shape (n,)
        Known columns; NaN where a cell holds no number.
    labels : ndarray of int, shape (n,)
        What messages call each row.
    noun : str
        ``line``, ``sample`` or ``row``: what the labels count.
    stated : mapping of str to (float, str)
        Direction (+1 or -1; 0 for mixed) and conditions of all rows, each with the place that says it.
    index : str
        Label of the zero.
    metadata : mapping of str to str
        All of the header, as written.
    notes : tuple of str
    """

    path: str = ""
    columns: Mapping[str, Array]
    labels: np.ndarray[Any, np.dtype[Any]]
    noun: str
    stated: Mapping[str, tuple[float, str]] = field(default_factory=dict)
    index: str = ""
    metadata: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    def value(self, name: str) -> float | None:
        """What is stated of all rows; None where nothing is."""
        return self.stated[name][0] if name in self.stated else None

    def at(self, row: int) -> str:
        """Place of a row, for messages."""
        return f"{self.noun} {self.labels[row]}"

    def listed(self, rows: Integers | Flags | list[int]) -> str:
        """The first of some rows, by their numbers or a mask, in brackets, for messages.

        Examples
        --------
        >>> Reading(labels=np.array([2, 4, 7]), noun="line", columns={}).listed([1, 2])
        '(lines 4, 7)'
        """
        labels = self.labels[rows].tolist()
        return f"({self.noun}{'' if len(labels) == 1 else 's'} {some(labels)})"


def refuse(path: str, message: str) -> NoReturn:
    """Refuse a run, in one line that begins with its file.

    Raises
    ------
    InputError
        Always.
    """
    comma = path and message.startswith("line ")
    raise InputError(f"{path or 'run'}{', ' if comma else ': '}{message}")


def stated_value(path: str, what: str, value: Any, dimension: str) -> float:
    """Condition of a run in its core unit: the size of a torque, a temperature above absolute zero.

    Parameters
    ----------
    what : str
        Place and key, for the message.
    value : float, str or quantity

    Raises
    ------
    InputError
        If it has no unit, one of another dimension, or cannot be.
    """
    try:
        number = units.to_core(value, dimension)
    except ValueError as error:
        refuse(path, f"{what}: {error}")
    if dimension == "temperature" and number < 0:
        refuse(path, f"{what}: {number:g} K lies below absolute zero; check the sign and the unit")
    return abs(number) if dimension == "torque" else number


def row_of(name: str, value: Any, dimension: str, *, path: str = "") -> Array:
    """One column given in memory, core units; values that are not finite stay for the check of the rows.

    Parameters
    ----------
    name : str
    value : array_like or quantity, shape (n,)
    dimension : str
        Empty for plain numbers.
    path : str
        What messages call the whole; empty for a run.

    Raises
    ------
    InputError
        If it is no row of numbers, or its unit is of another dimension.
    """
    factor, zero = 1.0, 0.0
    if dimension and units.is_quantity(value):
        with refusing(f"{path or 'run'}: {name}: "):
            factor, zero = units.unit_scale(str(value.units), dimension)
    try:
        array = np.array(getattr(value, "magnitude", value), dtype=np.float64)
    except (TypeError, ValueError):
        refuse(path, f"{name} holds something that is no number; give an array of numbers or a quantity")
    if array.ndim != 1:
        refuse(path, f"{name} has the shape {array.shape}; give one row of numbers")
    with np.errstate(over="ignore"):  # what overflows is left out later, and counted
        return np.asarray(array * factor + zero, dtype=np.float64)


def check_lengths(path: str, sizes: Mapping[str, int], remedy: str) -> None:
    """Refuse columns that differ in length.

    Parameters
    ----------
    sizes : mapping of str to int
        Length of each.
    remedy : str

    Raises
    ------
    InputError
    """
    if len(set(sizes.values())) > 1:
        listed = ", ".join(f"{name} {size}" for name, size in sizes.items())
        refuse(path, f"the columns differ in length ({listed}); {remedy}")


def check_needed(path: str, where: str, names: Sequence[str], otherwise: str = "") -> None:
    """Refuse columns that hold no transmission error and are no torque record.

    Parameters
    ----------
    where : str
        Place in the file, for the message.
    names : sequence of str
        Of all columns: known ones bare, others as written.
    otherwise : str
        Another remedy, for the end of the message.

    Raises
    ------
    InputError
    """
    have = [name for name in names if name in RUN_COLUMNS and DIMENSIONS[name] == "angle"]
    if len(have) >= 2 or (have in (["input_angle"], ["output_angle"]) and "torque" in names):
        return
    missing = [name for name in ("input_angle", "output_angle", "te") if name not in have]
    likely = [f"{name}[{UNITS[name]}]" for name in missing]
    others = [re.split(r"[\[(]", name)[0].strip() for name in names if name not in RUN_COLUMNS]
    hint = next(filter(None, (did_you_mean(name, likely) for name in others)), "")
    what = f"besides {have[0]} there is no" if have else "there is no"
    listed = " and no ".join(missing) if have else "input_angle, output_angle or te"
    refuse(
        path,
        f"{where}: {what} {listed}, so the transmission error cannot be told;{hint} give input_angle[deg] and "
        f"output_angle[deg], or te[arcsec] and one of them{otherwise}",
    )
