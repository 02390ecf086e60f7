"""Numbers as instruments and spreadsheets print them: decimal point or comma, digits in groups of three."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

#: Signs that may stand between groups of three digits.
THOUSANDS = (".", ",", "'", "’", " ", "\u00a0", "\u202f")
# 1.234 and 12,345,678: one digit to three, none of them a leading zero, then groups of three.
_GROUPED = re.compile(r"[+-]?[1-9]\d{0,2}(?:([.,])\d{3})(?:\1\d{3})*$")
_NUMERAL = re.compile(r"[+-]?[\d.,]*\d[\d.,]*(?:[eE][+-]?\d+)?$")


@dataclass(frozen=True)
class Numerals:
    """How a file writes numbers.

    Attributes
    ----------
    decimal : str
        ``.`` or ``,``.
    thousands : str
        Sign between groups of three digits; empty where there is none.

    Examples
    --------
    >>> Numerals(",", ".").parse("-1.234,5")
    -1234.5
    >>> Numerals(",").parse("1.5") is None
    True
    """

    decimal: str = "."
    thousands: str = ""

    def parse(self, cell: str) -> float | None:
        """Value of a cell; None where it holds no number written so."""
        text = cell.strip()
        if self.thousands and self.thousands in text:
            whole, sign, rest = text.partition(self.decimal)
            first, *groups = whole.lstrip("+-").split(self.thousands)
            if not (1 <= len(first) <= 3 and all(len(group) == 3 and group.isdigit() for group in groups)):
                return None
            text = whole.replace(self.thousands, "") + sign + rest
        if self.decimal == ",":
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
    return any(Numerals(sign).parse(cell) is not None for sign in ".,") or seconds_of_day(cell) is not None


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
