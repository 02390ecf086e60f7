"""A direction is a word or a sign, and every public function that takes one takes both."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import rverror
from rverror.base.directions import direction_sign, direction_signs
from rverror.views.plots.labels import stated

MODEL = rverror.Model(rverror.reducer("RV-40E"), (rverror.effect("cycloid.pin_position", pin=3, radial="5 um"),))
CAMS = [rverror.tolerance("crank.eccentricity", "5 um")]
THETA = np.linspace(0, 1, 5)
WIDTHS = {"disc_width": "9 mm", "gear_width": "8 mm"}
WEAR = {"torque": "412 N*m", "input_speed": "1815 rpm", "hours": [0, 1], **WIDTHS}
SOFT = rverror.statics.WearCoefficients(disc=1e-13)

ASKED: dict[str, Callable[[Any], Any]] = {
    "transmission error": lambda way: rverror.transmission_error(MODEL, THETA, direction=way),
    "influence": lambda way: MODEL.influence(THETA, "load.torsion", torque=1e5, direction=way).matrix,
    "equilibrium": lambda way: rverror.equilibrium(MODEL, THETA, direction=way).transmission_error,
    "pressure": lambda way: rverror.statics.contact_pressure(MODEL, THETA, **WIDTHS, direction=way).force["pin"],
    "wear": lambda way: rverror.statics.wear(MODEL, **WEAR, coefficients=SOFT, direction=way).lost_motion,
    "stack": lambda way: rverror.tolerances.stack(MODEL, CAMS, THETA, direction=way).nominal,
    "simulate": lambda way: rverror.simulate(MODEL, points=64, direction=way).direction,
    "simulate runs": lambda way: rverror.runs.simulate_runs(MODEL, points=64, directions=[way])[0].direction,
    "modes": lambda way: rverror.dynamics.modes(MODEL, direction=way).direction,
    "title": lambda way: stated(direction=way),
}


@pytest.mark.parametrize("name", ASKED)
def test_words_are_signs(name: str) -> None:
    for word, sign in (("forward", 1.0), ("reverse", -1.0)):
        np.testing.assert_array_equal(ASKED[name](word), ASKED[name](sign))
    with pytest.raises(rverror.InputError, match="direction = 'backward': must be 'forward' or 'reverse', "):
        ASKED[name]("backward")


def test_rows_of_directions() -> None:
    words = ["forward", "Reverse", 1, -1.0]
    assert direction_signs(words).tolist() == [1.0, -1.0, 1.0, -1.0]
    np.testing.assert_array_equal(
        rverror.transmission_error(MODEL, THETA[:4], direction=words),
        rverror.transmission_error(MODEL, THETA[:4], direction=[1.0, -1.0, 1.0, -1.0]),
    )


@pytest.mark.parametrize("wrong", [0, 2.0, True, None, "", "both", float("nan"), [1, 0], ["forward", "up"], {}])
def test_what_is_no_direction(wrong: Any) -> None:
    with pytest.raises(rverror.InputError, match="must be 'forward' or 'reverse'"):
        direction_signs(wrong)


def test_one_direction_is_no_row() -> None:
    several: Any = [1, -1]
    with pytest.raises(rverror.InputError, match="2 are given; give one"):
        direction_sign(several)
