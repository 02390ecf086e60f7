"""Limits as drawings write them: ``±5 um``, ``+0.02/-0.01 mm``, or a pair of the lower and the upper one."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from rverror.base import units
from rverror.base.errors import InputError

_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_BOTH_WAYS = re.compile(rf"\s*(?:±|\+/?-)\s*({_NUMBER}.*)$")
#: A unit behind the first number alone holds no digit, so the slash of ``arcsec/turn`` is not taken for that of limits.
_TWO = re.compile(rf"\s*([-+]?{_NUMBER})\s*([^\d/+-]*)/\s*([-+]?{_NUMBER})\s*([^\d\s].*)?$")


def width_and_centre(value: Any, dimension: str) -> tuple[float, float | None]:
    """Width T of a tolerance, half of what its limits leave, and where their middle is.

    Parameters
    ----------
    value : float, str, quantity or sequence of two
        T itself; ``"±5 um"``, ``"+-5 um"``, ``"+/-5 um"``; ``"+0.02/-0.01 mm"``, the upper limit first or last; or the
        lower and the upper limit.
    dimension : str
        A key of `units.CORE_UNITS`.

    Returns
    -------
    width : float
        Core unit.
    centre : float or None
        Middle of two limits, core unit; None where the limits are alike to both sides.

    Raises
    ------
    ValueError
        If a number or unit cannot be read, or the limits leave nothing.

    Examples
    --------
    >>> width_and_centre("±5 um", "length")
    (0.005, None)
    >>> [round(size, 9) for size in width_and_centre("+0.02/-0.01 mm", "length")]
    [0.015, 0.005]
    """
    if isinstance(value, str):
        text = value.replace("\N{MINUS SIGN}", "-")
        if match := _BOTH_WAYS.match(text):
            return units.to_core(match[1], dimension), None
        if match := _TWO.match(text):
            unit = match[4] or ""
            texts = f"{match[1]} {match[2].strip() or unit}", f"{match[3]} {unit}"
            return _of(sorted(units.to_core(one.strip(), dimension) for one in texts), value)
        return units.to_core(text, dimension), None
    if isinstance(value, Sequence):
        if len(value) != 2:
            raise InputError(f"{value!r}: {len(value)} limits; give two, the lower one first")
        return _of([units.to_core(one, dimension) for one in value], value)
    return units.to_core(value, dimension), None


def _of(pair: Sequence[float], value: Any) -> tuple[float, float]:
    low, high = pair
    if not low < high:
        raise InputError(f"{value!r}: the limits leave nothing between them; give the lower one, then a larger one")
    return (high - low) / 2, (high + low) / 2
