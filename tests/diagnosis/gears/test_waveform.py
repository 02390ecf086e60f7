"""The gear train under a run's conditions: what is carried from one turn of the crank against what is solved anew."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rverror
from gear_runs import OTHER, TURN, UNIT
from rverror.diagnosis.gears.grid import whole
from rverror.diagnosis.gears.waveform import LoadCase, solve_all
from rverror.geartrain.kinematics import OperatingConditions
from rverror.statics.loaded_state import statics_of

CAM = rverror.effect("crank.eccentricity", crank=0, disc=0, radial="8 um", tangential="-5 um")
PROFILE = rverror.effect("cycloid.disc_profile", disc=1, harmonic=2, cos="4 um", sin="3 um")
PIN = rverror.effect("cycloid.pin_position", pin=5, radial="-12 um", tangential="10 um")


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize(("points", "within"), [(256, 1e-9), (512, 1e-9), (600, 1e-4)])
def test_poses_of_one_turn_of_the_crank_are_those_of_the_whole_turn(
    direction: float, points: int, within: float
) -> None:
    """Turned on with the carrier; 600 angles do not hold whole turns of the crank, between whose angles a spline runs.

    `within` is of how far each unknown moves.
    """
    load_case = LoadCase(direction, 50e3, whole(0.3, TURN, points))
    near = load_case.solve(OTHER, (CAM, PROFILE))
    assert near.grid.points < points
    carried = load_case._carried(near, load_case.turn)
    assert carried is not None
    solved = statics_of(OTHER, OperatingConditions(load_case.turn.theta, direction, 50e3)).predict((CAM, PROFILE)).poses
    assert carried == pytest.approx(solved, rel=0, abs=within * float(np.ptp(solved, axis=0).max()))
    # each unknown by itself, those that move least among them
    assert np.all(np.abs(carried - solved).max(axis=0) <= 10 * within * np.ptp(solved, axis=0))


def test_a_cause_in_the_housing_is_solved_from_poses_without_it() -> None:
    """It does not repeat with the crank; from the turn of the crank that was solved before, or anew, it is the same."""
    load_case = LoadCase(1.0, 50e3, whole(0.3, TURN, 256))
    near = load_case.solve(UNIT, (CAM,))
    after, anew = load_case.solve(UNIT, (CAM, PIN), near), load_case.solve(UNIT, (CAM, PIN))
    assert near.grid != after.grid == anew.grid == load_case.turn
    assert after.error == pytest.approx(anew.error, rel=0, abs=1e-9 * float(np.ptp(anew.error)))
    assert load_case._carried(anew, load_case.turn) is None
    assert load_case._carried(replace(near, poses=None), load_case.turn) is None


def test_both_directions_as_one_system_are_what_each_is_alone() -> None:
    """Under one torque they are solved together, over few angles; contacts that open, another load, from near poses."""
    turn = whole(0.3, TURN, 512)
    conditions = [LoadCase(sense, torque, turn) for torque in (20e3, 50e3) for sense in (1.0, -1.0)]
    loose = rverror.effect("crank.bearing_clearance", clearance="4 um")
    softer = replace(OTHER, stiffness=replace(OTHER.stiffness, pin_contact=1.5e5))
    for effects in ((CAM, loose), (CAM, PIN)):
        alone = [one.solve(softer, effects) for one in conditions]
        near = solve_all(conditions, OTHER, effects, [None] * 4)
        together = solve_all(conditions, softer, effects, near)
        for one, other in zip(together, alone, strict=True):
            assert one.grid == other.grid
            assert one.error == pytest.approx(other.error, rel=0, abs=1e-8 * float(np.ptp(other.error)))
            for row, same in ((one.rows, other.rows), (one.soft, other.soft)):
                assert row == pytest.approx(same, rel=0, abs=1e-6 * float(np.abs(same).max()))
        assert np.all(alone[0].error < alone[1].error)  # a load holds back what moves against it
    assert [sum(beside for _, beside in one._kept) for one in conditions] == [2, 0, 2, 0]  # both grids, once a torque
