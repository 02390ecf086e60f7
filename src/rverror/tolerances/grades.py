"""Standard grades: widths of IT01 to IT18 of ISO 286-1, to 500 mm, and flank classes 1 to 11 of ISO 1328-1.

ISO 286-1:2010, table 1, and for IT01 and IT0 the table of its annex; the formulas behind them in ISO 286-1:1988,
annex A.  Page ``theory/allocation.md``.

ISO 1328-1:2013 was not at hand.  The formulas of single and cumulative pitch stand alike in three public programs, two
of which cite the standard's formula numbers; the rounding stands in two of them, that of runout and the range of
application in one.  Class 5 is the reference, each further class is wider by sqrt(2).  Page ``theory/budget.md``.
"""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

from rverror.base.errors import InputError
from rverror.base.text import did_you_mean
from rverror.geartrain.involute import PLANET_ECCENTRICITY, PLANET_PITCH, SUN_ECCENTRICITY, SUN_PITCH

_TABLE = tomllib.loads(Path(__file__).parents[1].joinpath("data", "iso-286.toml").read_text(encoding="utf-8"))
#: Upper end of each band of sizes, mm; a size on the end belongs to the band below.
BANDS: tuple[float, ...] = tuple(_TABLE["bands"])
#: Width of each grade in each band, um.
WIDTHS: Mapping[str, tuple[float, ...]] = {grade: tuple(row) for grade, row in _TABLE["widths"].items()}
_COARSE = ("IT14", "IT15", "IT16", "IT17", "IT18")


def it_width(grade: str, size: float) -> float:
    """Full width of a standard tolerance grade; a value that may lie on either side of its mean has half of it.

    Parameters
    ----------
    grade : str
        ``"IT01"``, ``"IT0"``, ``"IT1"`` to ``"IT18"``.
    size : float
        Nominal size of the feature, mm, above 0 and up to 500; above 1 for IT14 and coarser.

    Returns
    -------
    float
        mm.

    Raises
    ------
    InputError
        If there is no such grade or the size is out of its bounds.

    Examples
    --------
    >>> round(it_width("IT5", 32.0), 6)
    0.011
    """
    if grade not in WIDTHS:
        hint = did_you_mean(grade.replace(" ", ""), WIDTHS) or " grades are IT01, IT0, IT1 to IT18"
        raise InputError(f"no tolerance grade {grade!r};{hint}")
    if not (math.isfinite(size) and 0 < size <= BANDS[-1]):
        raise InputError(f"size {size:g} mm of a tolerance grade: ISO 286-1 is known here above 0 and up to 500 mm")
    if grade in _COARSE and size <= 1:
        raise InputError(f"grade {grade} at the size {size:g} mm: ISO 286-1 gives IT14 and coarser above 1 mm only")
    band = next(place for place, end in enumerate(BANDS) if size <= end)
    return WIDTHS[grade][band] * 1e-3


# --- ISO 1328-1 -------------------------------------------------------------------------------------------------------

#: What of a toothing is measured.
Deviation = Literal["single pitch", "cumulative pitch", "runout"]

#: Deviation that a class limits, by the catalogue's keys.
KEYS: Mapping[str, Deviation] = {
    SUN_ECCENTRICITY: "runout",
    PLANET_ECCENTRICITY: "runout",
    SUN_PITCH: "cumulative pitch",
    PLANET_PITCH: "cumulative pitch",
}

CLASSES = range(1, 12)
_NAME = re.compile(r"ISO\s*1328(?:-1)?\s+(\d{1,2})", re.IGNORECASE)
#: Ends of the range of application, mm, and of the numbers of teeth.
_DIAMETERS, _MODULES, _TEETH = (5.0, 15e3), (0.5, 70.0), (5, 1000)


def class_of(grade: str) -> int | None:
    """Class of a grade such as ``"ISO 1328 5"``; None where it names another standard.

    Raises
    ------
    InputError
        If there is no such class.

    Examples
    --------
    >>> class_of("ISO 1328 5"), class_of("IT5")
    (5, None)
    """
    found = _NAME.fullmatch(grade.strip())
    if found is None:
        return None
    if int(found[1]) not in CLASSES:
        raise InputError(f"no tolerance grade {grade!r}; the classes of ISO 1328-1 are 1 to 11, as in 'ISO 1328 5'")
    return int(found[1])


def gear_tolerance(deviation: Deviation, number: int, *, diameter: float, module: float) -> float:
    """Tolerance of one toothing, rounded as the standard does.

    Parameters
    ----------
    deviation : {"single pitch", "cumulative pitch", "runout"}
    number : int
        Flank tolerance class A, 1 to 11.
    diameter : float
        Reference diameter d, mm.
    module : float
        Normal module m, mm.

    Returns
    -------
    float
        mm.

    Raises
    ------
    InputError
        If the class or a size is out of the standard's range, beyond which it is not to be extrapolated.

    Notes
    -----
    In um, with d and m in mm, at class 5::

        f_p = 0.001 d + 0.4 m + 5
        F_p = 0.002 d + 0.55 sqrt(d) + 0.7 m + 12
        F_r = 0.9 F_p

    times sqrt(2)**(A - 5).  Rounded to whole um above 10, to 0.5 um from 5 to 10, to 0.1 um below.

    Examples
    --------
    >>> round(gear_tolerance("cumulative pitch", 6, diameter=120.0, module=3.0), 6)
    0.029
    """
    if number not in CLASSES:
        raise InputError(f"class {number}: the classes of ISO 1328-1 are 1 to 11")
    for name, size, (low, high) in (("diameter", diameter, _DIAMETERS), ("module", module, _MODULES)):
        if not low <= size <= high:
            raise InputError(
                f"{name} {size:g} mm of a gear grade: ISO 1328-1 holds from {low:g} to {high:g} mm; give a tolerance"
            )
    teeth = diameter / module
    if not _TEETH[0] - 0.5 <= teeth < _TEETH[1] + 0.5:
        raise InputError(
            f"diameter {diameter:g} mm and module {module:g} mm make {teeth:.3g} teeth: ISO 1328-1 holds from "
            f"{_TEETH[0]} to {_TEETH[1]}; give the reference diameter, module times teeth"
        )
    cumulative = 0.002 * diameter + 0.55 * math.sqrt(diameter) + 0.7 * module + 12
    reference = {
        "single pitch": 0.001 * diameter + 0.4 * module + 5,
        "cumulative pitch": cumulative,
        "runout": 0.9 * cumulative,
    }
    return _rounded(reference[deviation] * math.sqrt(2) ** (number - 5)) * 1e-3


def gear_limit(key: str, number: int, *, diameter: float, module: float, harmonics: Sequence[int] = (1,)) -> float:
    """Largest size of an error source whose gear still holds a class.

    Parameters
    ----------
    key : str
        A key of `KEYS`.
    number : int
        Flank tolerance class, 1 to 11.
    diameter, module : float
        Of the gear, mm.
    harmonics : sequence of int
        Waves around the gear, of pitch errors; one limit serves all, so that of the tightest counts.

    Returns
    -------
    float
        mm: length of an eccentricity, amplitude of a wave of the pitch.

    Raises
    ------
    InputError
        If the key has no class, or as `gear_tolerance`.

    Notes
    -----
    An eccentricity e makes a runout of 2 e.  A wave of amplitude A makes a cumulative pitch error of 2 A from its
    lowest to its highest tooth, and from tooth to tooth of z it rises by 2 A sin(pi h / z) at most, which the single
    pitch limits.

    Examples
    --------
    >>> round(gear_limit("involute.sun_pitch", 5, diameter=13.5, module=1.5), 6)
    0.0075
    """
    if key not in KEYS:
        raise InputError(
            f"{key}: ISO 1328-1 has no class for it, but for {', '.join(KEYS)}; give a tolerance or an IT grade"
        )
    half = gear_tolerance(KEYS[key], number, diameter=diameter, module=module) / 2
    if KEYS[key] == "runout":
        return half
    single = gear_tolerance("single pitch", number, diameter=diameter, module=module)
    rises = [abs(math.sin(math.pi * h * module / diameter)) for h in harmonics]
    return min([half, *(single / (2 * rise) for rise in rises if rise > 0)])


def _rounded(size: float) -> float:
    """As clause 5.2.3 does, um."""
    step = 1.0 if size > 10 else 0.5 if size >= 5 else 0.1
    return math.floor(size / step + 0.5) * step
