"""Former names of arguments work for one version, and warn with the new one where the user wrote them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import rverror

UNIT = rverror.reducer("RV-40E")
MODEL = rverror.Model(UNIT, bench=rverror.model.Bench(load_inertia="5 kg*m^2"))
CAMS = [rverror.tolerance("crank.eccentricity", "5 um")]
WEAR = {
    "torque": "412 N*m",
    "hours": [0, 1],
    "coefficients": rverror.statics.WearCoefficients(disc=1e-13),
    "disc_width": "9 mm",
    "gear_width": "8 mm",
    "direction": "forward",
}

FORMER: dict[str, tuple[Any, tuple[Any, ...], dict[str, Any], str, str, Any]] = {
    "simulate": (rverror.simulate, (MODEL,), {"points": 64}, "speed", "output_speed", "36 deg/s"),
    "wear": (rverror.statics.wear, (MODEL,), WEAR, "speed", "input_speed", "1815 rpm"),
    "speed_response": (rverror.dynamics.speed_response, (MODEL,), {}, "speeds", "input_speeds", ["60 rpm"]),
}
SHOWN = {"simulate": "time", "wear": "lost_motion", "speed_response": "transmission_error"}


@pytest.mark.parametrize("name", FORMER)
def test_a_former_argument_is_told_and_understood(name: str) -> None:
    call, given, named, old, new, value = FORMER[name]
    with pytest.warns(DeprecationWarning, match=rf"{name}\(..., {new}=\) now; write that") as told:
        former = call(*given, **named, **{old: value})
    assert told[0].filename == __file__
    now = call(*given, **named, **{new: value})
    np.testing.assert_array_equal(getattr(former, SHOWN[name]), getattr(now, SHOWN[name]))


def test_both_names_are_one_too_many() -> None:
    with (
        pytest.warns(DeprecationWarning, match="input_speed"),
        pytest.raises(rverror.InputError, match="speed and input_speed are the same; give input_speed"),
    ):
        rverror.tolerances.stack(MODEL, CAMS, speed="60 rpm", input_speed="60 rpm")
