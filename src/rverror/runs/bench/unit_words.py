"""Units as benches write them: which words pint reads as something else, and the scale of a unit."""

from __future__ import annotations

from rverror.base import units

#: Words of the trade that pint reads as something else, or not at all.
_SPELT = {
    "Grad": "deg", "Deg": "deg", "DEG": "deg", "Umdrehung": "turn", "U": "turn", "rev": "turn", "revs": "turn",
    "Nm": "N*m", "Ncm": "N*cm", "Nmm": "N*mm", "kNm": "kN*m", "Sek": "s", "Sekunden": "s",
    "'": "arcmin", "′": "arcmin", "''": "arcsec", '"': "arcsec", "″": "arcsec",
    "1/min": "rpm", "U/min": "rpm", "min-1": "rpm", "min^-1": "rpm",
}  # fmt: skip
#: Words for the counts of an encoder; the first is the mapping's.
COUNTS = ("counts", "count", "ticks", "increments", "Inkremente", "pulses")


def meant_unit(word: str) -> str:
    """Unit in pint's notation that a word of the trade means.

    Examples
    --------
    >>> meant_unit("Nm"), meant_unit("deg")
    ('N*m', 'deg')
    """
    return _SPELT.get(word, word)


def unit_scale(unit: str, dimension: str) -> tuple[float, float]:
    """Core units for one of a bench's unit, and its zero in core units: other than 0 of temperatures alone.

    Parameters
    ----------
    unit : str
        pint's notation.
    dimension : str
        ``angle``, ``time``, ``torque``, ``angular_speed`` or ``temperature``.

    Raises
    ------
    ValueError
        If the unit is unknown, of another dimension, or a word that pint takes for something else.

    Examples
    --------
    >>> unit_scale("ms", "time"), unit_scale("degC", "temperature")
    ((0.001, 0.0), (1.0, 273.15))
    """
    if unit in COUNTS:
        raise ValueError(f"{unit!r} are no {dimension} without counts_per_turn; state both in the mapping")
    if unit in _SPELT:
        raise ValueError(f"{unit!r} is no unit that is understood; did you mean {_SPELT[unit]!r}?")
    factor, zero = units.unit_scale(unit, dimension)
    # pint takes every number without a dimension for rad: ratio, percent, bits.
    if dimension == "angle" and factor == 1.0 and not unit.lower().startswith("rad"):
        raise ValueError(f"{unit!r} is no unit of angle; use one like 'deg'")
    return factor, zero
