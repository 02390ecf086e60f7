"""The conditions of a run as one object say what the keywords say, for every prediction of one model."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import rverror
from rverror.geartrain.contacts import pose
from rverror.geartrain.kinematics import OperatingConditions
from rverror.statics import prediction

THETA = np.linspace(0.2, 1.0, 9)
TIME = THETA / 0.3
MODEL = rverror.Model(
    rverror.reducer("RV-40E"),
    (
        rverror.effect("crank.eccentricity", crank=0, disc=1, radial="8 um"),
        rverror.effect("load.torsion", compliance=1e-9),
        rverror.effect("sensor.time_offset", offset=1e-4),
    ),
)
PREDICTIONS: dict[str, Callable[..., Any]] = {
    "transmission_error": rverror.transmission_error,
    "by effect": rverror.model.transmission_error_by_effect,
    "equilibrium": lambda *given, **keywords: rverror.equilibrium(*given, **keywords).transmission_error,
    "linearise": lambda *given, **keywords: rverror.statics.linearise(*given, **keywords).forces["mesh"],
    "influence": lambda model, *given, **keywords: (
        rverror.influence(model.mechanism, *given, "sensor.time_offset", **keywords).matrix
    ),
}

REFUSED = {**PREDICTIONS, "closed prediction": prediction.predict}


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("name", PREDICTIONS)
def test_one_object_or_keywords(name: str, direction: float) -> None:
    predict = PREDICTIONS[name]
    one = predict(MODEL, OperatingConditions(THETA, direction, 20e3, TIME))
    np.testing.assert_array_equal(one, predict(MODEL, THETA, direction=direction, torque="20 N*m", time=TIME))


def test_a_run_hands_its_conditions_on() -> None:
    run = rverror.simulate(MODEL, points=64, direction=-1, torque="20 N*m", output_speed="10 deg/s")
    told = run.conditions(MODEL)
    assert told.torque == 20e3
    np.testing.assert_allclose(
        rverror.transmission_error(MODEL, told), run.error(MODEL), atol=1e-6 * np.ptp(run.error(MODEL))
    )


def test_nothing_is_said_twice() -> None:
    with pytest.raises(ValueError, match="leave these out"):
        pose(MODEL.mechanism, OperatingConditions(THETA, 1.0), torque=20e3)


def test_an_equilibrium_without_a_torque_is_that_of_the_rated_one_or_refused() -> None:
    rated = rverror.equilibrium(MODEL, THETA, torque="412 N*m", time=TIME).transmission_error
    np.testing.assert_array_equal(rverror.equilibrium(MODEL, THETA, time=TIME).transmission_error, rated)
    with pytest.raises(ValueError, match="needs a torque"):
        rverror.equilibrium(rverror.Model(rverror.reducer("RV-003")), THETA)
    with pytest.raises(ValueError, match="needs a torque"):
        rverror.equilibrium(MODEL, OperatingConditions(THETA, 1.0))


@pytest.mark.parametrize("name", REFUSED)
@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"direction": 0.0}, "direction = 0.0: must be"),
        ({"direction": np.full(9, 2.0)}, "direction = 2.0: must be"),
        ({"direction": np.ones(3)}, "direction has the shape"),
        ({"theta": np.append(THETA[1:], np.nan)}, "must be finite"),
        ({"theta": THETA[None]}, "theta has the shape"),
        ({"theta": THETA[:0]}, "theta has the shape"),
        ({"time": TIME[:3]}, "time has the shape"),
        ({"time": TIME * np.nan}, "must be finite"),
        ({"torque": np.inf}, "must be finite"),
    ],
)
def test_conditions_at_which_nothing_can_be_are_refused(name: str, wrong: dict[str, Any], message: str) -> None:
    """A direction of 0 would otherwise leave the load out, and a number that is not finite would go on into results."""
    sound: dict[str, Any] = {"theta": THETA, "direction": 1.0, "torque": 20e3, "time": TIME}
    if name == "closed prediction":
        sound["torque"] = None
    with pytest.raises(ValueError, match=message):
        REFUSED[name](MODEL, OperatingConditions(**(sound | wrong)))


def test_whole_numbers_of_rad_are_angles() -> None:
    angles = np.arange(9) ** 2  # at a rate that is no whole number
    one = rverror.transmission_error(MODEL, OperatingConditions(angles, 1, 20000, TIME))
    np.testing.assert_array_equal(
        one, rverror.transmission_error(MODEL, angles, direction=1, torque="20 N*m", time=TIME)
    )


def test_a_drive_has_no_equilibrium_whatever_the_torque_is() -> None:
    with pytest.raises(ValueError, match=r"a \[drive\] has no geometry"):
        rverror.equilibrium(rverror.Model(rverror.Drive(ratio=3.0)), THETA, torque="5 mm")
