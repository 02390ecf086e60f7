"""Widths of the standard tolerance grades IT01 to IT18 of ISO 286-1, for sizes up to 500 mm.

Values: ISO 286-1:2010, table 1, and for IT01 and IT0 the table of its annex; the formulas behind them in
ISO 286-1:1988, annex A.  Page ``theory/allocation.md``.
"""

from __future__ import annotations

import difflib
import math

from rverror.base.errors import InputError

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
