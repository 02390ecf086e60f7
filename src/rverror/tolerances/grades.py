"""Standard grades: widths of IT01 to IT18 of ISO 286-1, to 500 mm, and flank classes 1 to 11 of ISO 1328-1.

ISO 286-1:2010, table 1, and for IT01 and IT0 the table of its annex; the formulas behind them in ISO 286-1:1988,
annex A.  Page ``theory/allocation.md``.

ISO 1328-1:2013 was not at hand.  The formulas of single and cumulative pitch stand alike in three public programs, two
of which cite the standard's formula numbers; the rounding stands in two of them, that of runout and the range of
application in one.  Class 5 is the reference, each further class is wider by sqrt(2).  Page ``theory/budget.md``.
"""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Mapping, Sequence
from typing import Literal

from rverror.base.errors import InputError
from rverror.geartrain.involute import PLANET_ECCENTRICITY, PLANET_PITCH, SUN_ECCENTRICITY, SUN_PITCH

#: Upper end of each band of sizes, mm; a size on the end belongs to the band below.
BANDS = (3.0, 6.0, 10.0, 18.0, 30.0, 50.0, 80.0, 120.0, 180.0, 250.0, 315.0, 400.0, 500.0)

#: Width of each grade in each band, um.
WIDTHS = {
    "IT01": (0.3, 0.4, 0.4, 0.5, 0.6, 0.6, 0.8, 1, 1.2, 2, 2.5, 3, 4),
    "IT0": (0.5, 0.6, 0.6, 0.8, 1, 1, 1.2, 1.5, 2, 3, 4, 5, 6),
    "IT1": (0.8, 1, 1, 1.2, 1.5, 1.5, 2, 2.5, 3.5, 4.5, 6, 7, 8),
    "IT2": (1.2, 1.5, 1.5, 2, 2.5, 2.5, 3, 4, 5, 7, 8, 9, 10),
    "IT3": (2, 2.5, 2.5, 3, 4, 4, 5, 6, 8, 10, 12, 13, 15),
    "IT4": (3, 4, 4, 5, 6, 7, 8, 10, 12, 14, 16, 18, 20),
    "IT5": (4, 5, 6, 8, 9, 11, 13, 15, 18, 20, 23, 25, 27),
    "IT6": (6, 8, 9, 11, 13, 16, 19, 22, 25, 29, 32, 36, 40),
    "IT7": (10, 12, 15, 18, 21, 25, 30, 35, 40, 46, 52, 57, 63),
    "IT8": (14, 18, 22, 27, 33, 39, 46, 54, 63, 72, 81, 89, 97),
    "IT9": (25, 30, 36, 43, 52, 62, 74, 87, 100, 115, 130, 140, 155),
    "IT10": (40, 48, 58, 70, 84, 100, 120, 140, 160, 185, 210, 230, 250),
    "IT11": (60, 75, 90, 110, 130, 160, 190, 220, 250, 290, 320, 360, 400),
    "IT12": (100, 120, 150, 180, 210, 250, 300, 350, 400, 460, 520, 570, 630),
    "IT13": (140, 180, 220, 270, 330, 390, 460, 540, 630, 720, 810, 890, 970),
    "IT14": (250, 300, 360, 430, 520, 620, 740, 870, 1000, 1150, 1300, 1400, 1550),
    "IT15": (400, 480, 580, 700, 840, 1000, 1200, 1400, 1600, 1850, 2100, 2300, 2500),
    "IT16": (600, 750, 900, 1100, 1300, 1600, 1900, 2200, 2500, 2900, 3200, 3600, 4000),
    "IT17": (1000, 1200, 1500, 1800, 2100, 2500, 3000, 3500, 4000, 4600, 5200, 5700, 6300),
    "IT18": (1400, 1800, 2200, 2700, 3300, 3900, 4600, 5400, 6300, 7200, 8100, 8900, 9700),
}

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
        close = difflib.get_close_matches(grade.upper().replace(" ", ""), WIDTHS, n=1, cutoff=0.5)
        hint = f"did you mean {close[0]!r}?" if close else "grades are IT01, IT0, IT1 to IT18"
        raise InputError(f"no tolerance grade {grade!r}; {hint}")
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
    _check(number, diameter, module)
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


def _check(number: int, diameter: float, module: float) -> None:
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


def _rounded(size: float) -> float:
    """As clause 5.2.3 does, um."""
    step = 1.0 if size > 10 else 0.5 if size >= 5 else 0.1
    return math.floor(size / step + 0.5) * step
