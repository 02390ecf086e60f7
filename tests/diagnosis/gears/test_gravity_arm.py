"""Runs under an arm's weight, whose torque changes its sign in the turn: causes are named as under a brake."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rverror
from gear_runs import BARE, CAM, OTHER, red
from rverror.diagnosis.gears.record import TORQUE_SHARE, levelled, records_of
from rverror.geartrain.torque_over_turn import TorqueWaves

ARM = rverror.geartrain.GravityArm(mass="20 kg", lever="0.4 m", offset="30 deg")
POINTS = 1024
#: Among them the wave that looks like the windup of a weight.
FEW = rverror.diagnosis.Policy(keys=("crank.eccentricity", "sensor.encoder_eccentricity"))


def arm_runs(*effects: rverror.Effect) -> list[rverror.Run]:
    """Of a unit of other stiffness than declared; the sensor reads 1 % too much, and has noise."""
    model, runs = rverror.Model(OTHER, effects), []
    for number, run in enumerate(
        rverror.runs.simulate_runs(model, torques=(ARM,), points=POINTS, method="equilibrium")
    ):
        assert run.output_angle is not None
        assert run.load_column is not None
        rng = np.random.default_rng(number)
        column = 1.01 * run.load_column + 0.02 * 78e3 * rng.normal(size=POINTS)
        angle = run.output_angle + red(number, POINTS)
        runs.append(replace(run, output_angle=angle, load_column=column))
    return runs


def test_a_cam_is_named_and_sized() -> None:
    found = rverror.diagnose(BARE, arm_runs(CAM), policy=FEW)
    (added,) = found.added
    assert added.effect.key == "crank.eccentricity"
    assert np.allclose(np.abs(added.effect.values), np.abs(CAM.values), atol=1e-3)
    assert any("changes its sign" in note for note in found.notes)


def test_nothing_is_named_where_nothing_is_missing() -> None:
    found = rverror.diagnose(BARE, arm_runs(), policy=FEW)
    assert found.verdict == "nothing_missing"


def test_samples_under_hardly_any_load_are_left_out() -> None:
    """Five per cent of a cosine to either side of its two zeros are 4 asin(0.05) of the turn; the jump is no slip."""
    (record, _), notes = records_of(BARE, arm_runs())
    assert record.theta.size == POINTS
    assert np.count_nonzero(~record.kept) == pytest.approx(4 * np.arcsin(0.05) / (2 * np.pi) * POINTS, abs=3)
    assert record.slips == ()
    assert len(record.starts) == 3
    assert not any("slips" in note for note in notes)


def test_what_a_torque_sensor_leaves_open_is_windup_by_the_torsion_curve() -> None:
    """A share of the peak torque times the compliance between half of the peak and the peak."""
    (record, _), _ = records_of(BARE, arm_runs())
    assert isinstance(record.torque, TorqueWaves)
    peak = record.torque.peak
    assert peak == pytest.approx(1.01 * 20e-3 * 400 * 9806.65, rel=0.01)  # m l g, read 1 % too high
    half, most = rverror.statics.torsion_curve(BARE, [0.0], torques=[peak / 2, peak]).angle[:, 0]
    assert record.windup == pytest.approx(TORQUE_SHARE * peak * abs(most - half) / (peak / 2), rel=0.02)


def test_a_jump_over_a_stretch_is_levelled() -> None:
    error, light = np.zeros(100), np.zeros(100, dtype=np.bool_)
    error[50:], light[48:52] = 40.0, True
    np.testing.assert_allclose(levelled(error, light), 0.0, atol=1e-12)


def test_marks_that_are_not_known_are_refused() -> None:
    runs = [replace(run, index="unknown") for run in arm_runs()]
    with pytest.raises(rverror.InputError, match="marks are not known"):
        rverror.diagnose(BARE, runs, policy=FEW)
