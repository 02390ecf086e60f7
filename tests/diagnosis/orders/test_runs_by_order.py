"""The passport of runs: what a table of their orders would say, or nothing where they cannot tell the orders apart."""

from __future__ import annotations

import numpy as np
import pytest

import rverror
from gear_runs import OTHER, TURN, UNIT, runs_of
from rverror.base.units import ARCSEC
from rverror.diagnosis.orders.runs_by_order import passport_of_runs
from rverror.geartrain.kinematics import OperatingConditions
from rverror.model.effects import Model
from rverror.statics.prediction import predict

HEAD = rverror.effect("sensor.encoder_eccentricity", cos="20 arcsec", sin="-9 arcsec")
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
            error = predict(Model(OTHER, (CAM,)), OperatingConditions(theta, law.direction, load)).transmission_error
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


def test_runs_of_one_condition_have_none() -> None:
    assert passport_of_runs(UNIT, runs_of(Model(OTHER, (CAM,)), [(1.0, 50e3)] * 2)) == ()


def test_over_half_a_turn_orders_that_are_half_a_wave_apart_are_not_told() -> None:
    """Housing and crank, 15 and 16; what the cam makes at 16 would pass for 15's.  An order 1 is slow there."""
    runs = runs_of(Model(OTHER, (CAM, HEAD)), [(1.0, 50e3)], points=2048, turns=0.5)
    assert sorted(one.order for one in passport_of_runs(UNIT, runs)) == [30, 32, 48, 96]


def test_a_drive_over_part_of_a_turn_has_its_shafts_orders() -> None:
    """Beside an order 1 ten times as large, of which the encoder has not seen a turn; three waves are too slow too."""
    drive = rverror.Drive(ratio=14.0, shafts={"motor": 14.0, "planet": 42.0, "arm": 5.0})
    theta, rng = 0.6 * TURN * np.arange(3000) / 3000, np.random.default_rng(3)
    error = (10 * np.cos(14 * theta + 0.5) + 100 * np.cos(theta) + 0.5 * rng.normal(size=3000)) * ARCSEC
    run = rverror.run_from_arrays(input_angle=14 * theta, te=error)
    found = {one.order: one for one in rverror.diagnose(Model(drive), [run]).passport}
    assert set(found) == {10.0, 14.0, 28.0, 42.0, 84.0}
    assert found[14.0].low <= 10 * ARCSEC <= found[14.0].high
    assert found[14.0].high - found[14.0].low < 0.5 * ARCSEC
    assert all(found[order].amplitude < 0.15 * ARCSEC for order in (10.0, 28.0, 42.0, 84.0))
