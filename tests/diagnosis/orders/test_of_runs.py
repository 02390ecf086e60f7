"""The passport of runs: what a table of their orders would say, or nothing where they cannot tell the orders apart."""

from __future__ import annotations

import numpy as np
import pytest

import rverror
from gear_runs import OTHER, TURN, UNIT, runs_of
from rverror.base.units import ARCSEC
from rverror.diagnosis.orders.of_runs import passport_of_runs
from rverror.geartrain.kinematics import Conditions
from rverror.model.effects import Model
from rverror.statics.prediction import predict

CAM = rverror.effect("crank.eccentricity", crank=0, disc=0, radial="8 um", tangential="-5 um")
LOADS = (40e3, 120e3, 240e3)


def test_runs_at_three_loads_tell_a_constant_and_a_slope() -> None:
    """The cam's order against the straight line through Fourier's sums of the prediction at the three loads."""
    conditions = [(way, load) for way in (1.0, -1.0) for load in LOADS]
    passports = passport_of_runs(UNIT, runs_of(Model(OTHER, (CAM,)), conditions, points=2048))
    assert {round(one.order) for one in passports} == {1, 2, 15, 30, 16, 32, 48, 96}
    strongest = passports[0]
    assert strongest.order == 16
    theta = TURN * np.arange(2048) / 2048
    for law in strongest.laws:
        waves = []
        for load in LOADS:
            error = predict(Model(OTHER, (CAM,)), Conditions(theta, law.direction, load)).transmission_error
            waves.append(2 * np.mean(error * np.exp(-16j * theta)))
        slope, constant = np.polyfit(LOADS, waves, 1)
        assert law.constant is not None
        assert law.slope is not None
        assert law.constant.value == pytest.approx(constant, abs=0.1 * ARCSEC)
        assert law.slope.value == pytest.approx(slope, abs=0.1 * ARCSEC / 2e5)


def test_a_diagnosis_of_runs_holds_their_passport() -> None:
    found = rverror.diagnose(Model(UNIT, (CAM,)), runs_of(Model(OTHER, (CAM,)), points=1024))
    assert found.passport[0].order == 16
    assert rverror.to_json(found)["passport"][0]["order"] == 16
    assert "per 1000 N*m of load" not in rverror.to_text(found)  # one load tells no slope


@pytest.mark.parametrize("why", ["half a turn", "twice one condition"])
def test_runs_that_cannot_tell_orders_apart_have_none(why: str) -> None:
    turns, conditions = (0.5, [(1.0, 50e3)]) if why == "half a turn" else (1.0, [(1.0, 50e3)] * 2)
    assert passport_of_runs(UNIT, runs_of(Model(OTHER, (CAM,)), conditions, turns=turns)) == ()
