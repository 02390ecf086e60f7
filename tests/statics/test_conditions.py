"""The conditions of a run as one object say what the keywords say, for every prediction of one model."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import rverror
from rverror.geartrain.contacts import pose
from rverror.geartrain.kinematics import Conditions

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
    "by effect": rverror.transmission_error_by_effect,
    "equilibrium": lambda *given, **keywords: rverror.equilibrium(*given, **keywords).transmission_error,
    "linearise": lambda *given, **keywords: rverror.linearise(*given, **keywords).forces["mesh"],
    "influence": lambda model, *given, **keywords: (
        rverror.influence(model.mechanism, *given, "sensor.time_offset", **keywords).matrix
    ),
}


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("name", PREDICTIONS)
def test_one_object_or_keywords(name: str, direction: float) -> None:
    predict = PREDICTIONS[name]
    one = predict(MODEL, Conditions(THETA, direction, 20e3, TIME))
    np.testing.assert_array_equal(one, predict(MODEL, THETA, direction=direction, torque="20 N*m", time=TIME))


def test_a_run_hands_its_conditions_on() -> None:
    run = rverror.simulate(MODEL, points=64, direction=-1, torque="20 N*m", speed="10 deg/s")
    told = run.conditions(MODEL)
    assert told.torque == 20e3
    np.testing.assert_allclose(
        rverror.transmission_error(MODEL, told), run.error(MODEL), atol=1e-6 * np.ptp(run.error(MODEL))
    )


def test_nothing_is_said_twice() -> None:
    with pytest.raises(ValueError, match="leave these out"):
        pose(MODEL.mechanism, Conditions(THETA, 1.0), torque=20e3)


def test_an_equilibrium_without_a_torque_is_refused() -> None:
    with pytest.raises(ValueError, match="needs a torque"):
        rverror.equilibrium(MODEL, THETA)
    with pytest.raises(ValueError, match="needs a torque"):
        rverror.equilibrium(MODEL, Conditions(THETA, 1.0))
