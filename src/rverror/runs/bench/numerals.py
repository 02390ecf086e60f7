"""Numbers as instruments and spreadsheets print them: decimal point or comma, times of day."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

# 1.234 and 12,345,678: one digit to three, none of them a leading zero, then groups of three.
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(?:([.,])\d{3})(?:\1\d{3})*$")
_NUMERAL = re.compile(r"[+-]?[\d.,]*\d[\d.,]*(?:[eE][+-]?\d+)?$")


def number_in(cell: str, decimal: str = ".") -> float | None:
    """Value of a cell; None where it holds no number with this decimal sign, point or comma.

    Examples
    --------
    >>> number_in("-1234,5", ","), number_in("1.5", ",")
    (-1234.5, None)
    """
    text = cell.strip()
    if decimal == ",":
        if "." in text:
            return None
        text = text.replace(",", ".")
    try:
        return None if "_" in text else float(text)
    except ValueError:
        return None


_OF_DAY = re.compile(r"([01]?\d|2[0-3]):([0-5]\d):([0-5]\d(?:[.,]\d*)?)$")


def seconds_of_day(cell: str) -> float | None:
    """Seconds since midnight of a time of day such as ``12:34:56.789``; None of anything else.

    Examples
    --------
    >>> seconds_of_day("00:01:02,5"), seconds_of_day("24:00:00")
    (62.5, None)
    """
    match = _OF_DAY.match(cell)
    if match is None:
        return None
    return 3600 * int(match[1]) + 60 * int(match[2]) + float(match[3].replace(",", "."))


def is_number(cell: str) -> bool:
    """Tell a number, with point or comma, or a time of day.

    Examples
    --------
    >>> is_number("1,5"), is_number("12:00:01"), is_number("")
    (True, True, False)
    """
    return any(number_in(cell, sign) is not None for sign in ".,") or seconds_of_day(cell) is not None


@dataclass(frozen=True)
class Undecided:
    """A cell that leaves the decimal sign open.

    Attributes
    ----------
    place : int
        Its number in the order given.
    why : str
        What speaks against a decision.
    """

    place: int
    cell: str
    why: str


def found_decimal(cells: Iterable[str], *, point_is_decimal: bool = False) -> str | Undecided:
    """Decimal sign of cells; empty where no cell has one.

    A comma or point before exactly three digits may be a decimal sign or stand between thousands: ``1.234`` decides
    nothing, ``0.234``, ``1.23`` and ``1234.567`` do.

    Parameters
    ----------
    point_is_decimal : bool
        Whether a point can be nothing else, as where commas separate the columns.

    Examples
    --------
    >>> found_decimal(["1,5", "2,25"])
    ','
    >>> found_decimal(["1,234", "2,345"]).why
    'may be 1.234 or 1234'
    """
    seen = ""
    decided = False
    undecided: Undecided | None = None
    for place, cell in enumerate(map(str.strip, cells)):
        signs = [sign for sign in ".," if sign in cell]
        if not signs or not _NUMERAL.match(cell):
            continue  # words, such as a line of units, decide nothing
        sign = signs[0]
        if len(signs) > 1:
            return Undecided(place, cell, "holds a point and a comma")
        if cell.count(sign) > 1:
            return Undecided(place, cell, f"holds {sign!r} more than once")
        if seen and sign != seen:
            return Undecided(place, cell, f"holds {sign!r}, cells before it {seen!r}")
        seen = sign
        if not _GROUPED.match(cell) or (point_is_decimal and sign == "."):
            decided = True
        elif undecided is None:
            undecided = Undecided(place, cell, f"may be {cell.replace(',', '.')} or {cell.replace(sign, '')}")
    return undecided if undecided and not decided else seen
