"""Entries of sources: words that would silently mean something else are refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

import rverror
from rverror.geartrain.kinematics import OperatingConditions

ENCODER = rverror.CATALOGUE["sensor.encoder_eccentricity"]
HERE = OperatingConditions(theta=[0.0], direction=1.0)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("field", "word", "known"),
    [
        ("acts", "readings", "contacts, marks, output, reading"),
        ("follows", "angles", "angle, speed, time"),
        ("needs", ("load",), "time, torque or a parameter of a reducer"),
    ],
)
def test_a_misspelt_word_is_refused(field: str, word: Any, known: str) -> None:
    with pytest.raises(ValueError, match=f"sensor.encoder_eccentricity: {field} = .*; it must be one of {known}"):
        replace(ENCODER, **{field: word})


def test_what_a_source_lacks_is_named() -> None:
    unit = rverror.reducer("RV-40E", spline_radius=None)
    delay, torsion, spline = (
        rverror.CATALOGUE[key] for key in ("sensor.time_offset", "load.torsion", "involute.spline_clearance")
    )
    assert delay.lacks(unit, HERE) == "time"
    assert torsion.lacks(unit, HERE) == torsion.lacks(unit, replace(HERE, torque=0.0)) == "torque"
    assert torsion.lacks(unit, replace(HERE, torque=20e3)) == ENCODER.lacks(unit, HERE) == ""
    assert spline.lacks(unit, HERE) == "spline_radius"
    assert spline.lacks(rverror.reducer("RV-40E", spline_radius="7 mm"), HERE) == ""
