"""Numbers for people and for other programs: so many digits, a unit, a count, the word for a direction."""

from __future__ import annotations

import math

from rverror.base.units import ARCSEC, DISPLAY_UNITS, to_display


def brief(value: float, digits: int = 4) -> str:
    """Few digits, without an exponent where that can be read.

    Examples
    --------
    >>> brief(0.48731), brief(1468.44), brief(36.0), brief(-0.0)
    ('0.4873', '1468', '36', '0')
    >>> brief(2604.3, 3), brief(0.28134, 3)
    ('2604', '0.281')
    """
    text = f"{value + 0.0:.{digits}g}"
    return f"{value:.0f}" if "e+" in text and abs(value) < 1e7 else text


def with_unit(value: float, dimension: str) -> str:
    """Value in the core unit as people read it, with its unit.

    Examples
    --------
    >>> with_unit(0.005, "length")
    '5 um'
    """
    return f"{brief(to_display(value, dimension))} {DISPLAY_UNITS[dimension]}"


def at_input_speed(speed: float | None) -> str:
    """Where a result is one of a speed: " at 600 rpm", to stand behind it; nothing where it is of no speed.

    Examples
    --------
    >>> at_input_speed(20 * math.pi)
    ' at 600 rpm'
    """
    return "" if speed is None else f" at {with_unit(speed, 'angular_speed')}"


def rounded(value: float | None, digits: int = 6) -> float | None:
    """Number for JSON, to so many digits; None where it is not determined.

    Examples
    --------
    >>> rounded(1 / 3), rounded(math.nan), rounded(None)
    (0.333333, None, None)
    """
    return None if value is None or not math.isfinite(value) else float(f"{value:.{digits}g}")


def in_arcsec(value: float | None, digits: int = 6) -> float | None:
    """Angle, rad, as `rounded` arcsec."""
    return None if value is None else rounded(value / ARCSEC, digits)


def count_of(number: int, what: str) -> str:
    """Count with its noun.

    Examples
    --------
    >>> count_of(1, "angle"), count_of(3, "angle")
    ('1 angle', '3 angles')
    """
    return f"{number} {what}" + ("" if number == 1 else "s")


def way(direction: float) -> str:
    """Word for a direction of motion."""
    return "forward" if direction > 0 else "reverse"
