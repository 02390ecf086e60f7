"""Widths that a tolerance file states as a grade: of ISO 286-1 by size, of ISO 1328-1:2013 by diameter and module."""

from __future__ import annotations

import math
import re
from typing import Any

from benchmarks.load_trial.parts import size

# Largest size of each band, mm, and the widths of IT1, IT2, .. IT18 in it, um, as printed in the standard.
_BANDS = """
3    0.8 1.2 2 3 4 6 10 14 25 40 60 100 140 250 400 600 1000 1400
6    1 1.5 2.5 4 5 8 12 18 30 48 75 120 180 300 480 750 1200 1800
10   1 1.5 2.5 4 6 9 15 22 36 58 90 150 220 360 580 900 1500 2200
18   1.2 2 3 5 8 11 18 27 43 70 110 180 270 430 700 1100 1800 2700
30   1.5 2.5 4 6 9 13 21 33 52 84 130 210 330 520 840 1300 2100 3300
50   1.5 2.5 4 7 11 16 25 39 62 100 160 250 390 620 1000 1600 2500 3900
80   2 3 5 8 13 19 30 46 74 120 190 300 460 740 1200 1900 3000 4600
120  2.5 4 6 10 15 22 35 54 87 140 220 350 540 870 1400 2200 3500 5400
180  3.5 5 8 12 18 25 40 63 100 160 250 400 630 1000 1600 2500 4000 6300
250  4.5 7 10 14 20 29 46 72 115 185 290 460 720 1150 1850 2900 4600 7200
315  6 8 12 16 23 32 52 81 130 210 320 520 810 1300 2100 3200 5200 8100
400  7 9 13 18 25 36 57 89 140 230 360 570 890 1400 2300 3600 5700 8900
500  8 10 15 20 27 40 63 97 155 250 400 630 970 1550 2500 4000 6300 9700
"""
_TABLE = [[float(word) for word in line.split()] for line in _BANDS.strip().splitlines()]


def iso_286(grade: int, at: float) -> float:
    """Width of ITn, mm, of a size in mm.

    Raises
    ------
    ValueError
        If the table has no such grade or size.
    """
    if not (1 <= grade <= 18 and 0 < at <= 500):
        raise ValueError(f"IT{grade} of {at:g} mm is not in the table")
    return next(row for row in _TABLE if at <= row[0])[grade] / 1000


def _rounded(value: float) -> float:
    """A width of a toothing in um, rounded as ISO 1328-1 says."""
    step = 1.0 if value > 10 else 0.5 if value >= 5 else 0.1
    return round(value / step) * step


def iso_1328(key: str, grade: int, diameter: float, module: float, harmonic: int) -> float:
    """Largest amplitude that a class leaves to an eccentricity or a wave of pitch, mm.

    Raises
    ------
    ValueError
        If the source is none of these.
    """
    finer = math.sqrt(2) ** (grade - 5)
    cumulative = (0.002 * diameter + 0.55 * math.sqrt(diameter) + 0.7 * module + 12) * finer
    if key.endswith("_eccentricity"):
        return _rounded(0.9 * cumulative) / 2000
    if not key.endswith("_pitch"):
        raise ValueError(f"a class of ISO 1328 at {key} is not judged here")
    single = _rounded((0.001 * diameter + 0.4 * module + 5) * finer)
    rises = 2 * abs(math.sin(math.pi * harmonic * module / diameter))  # from tooth to tooth, of an amplitude of 1
    return min(_rounded(cumulative) / 2, single / rises if rises > 0 else math.inf) / 1000


def width(table: dict[str, Any]) -> float:
    """Width of one tolerance table with a grade, mm.

    Raises
    ------
    ValueError
        If the grade is none of the two standards', or its waves have more than one width.
    """
    grade = str(table["grade"])
    if found := re.fullmatch(r"IT\s*(\d+)", grade):
        return iso_286(int(found[1]), size(table["size"])) / 2
    found = re.fullmatch(r"ISO 1328 (\d+)", grade)
    harmonic = table.get("indices", {}).get("harmonic", 1)
    if not found or not isinstance(harmonic, int):
        raise ValueError(f"{table['key']}: the grade {grade} is not judged here")
    return iso_1328(table["key"], int(found[1]), size(table["diameter"]), size(table["module"]), harmonic)
