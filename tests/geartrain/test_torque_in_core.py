"""A plain number for a torque is N*mm: those that were meant in N*m are doubted, wherever a reducer bears them."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, strategies as st

import rverror
from rverror.base.units import InCore, to_core
from rverror.geartrain.kinematics import OperatingConditions
from rverror.geartrain.mechanism import Drive, core_torque, doubt_torque

UNIT = rverror.reducer("RV-40E")
SOFT = rverror.effect("load.torsion", compliance="0.05 arcsec/(N*m)")
MODEL = rverror.Model(UNIT, (SOFT,))
PLAIN = rverror.Model(UNIT)
#: Of as much rated torque, but with few pins: its turn has fewer samples.
FEW = rverror.Model(rverror.reducer("RV-40E", pins=12, disc_lobes=11, eccentricity=3.0, pin_radius=6.0))
RUBBING = rverror.geartrain.Friction(pin=0.05)
THETA = [0.0, 0.1]
CAMS = [rverror.tolerance("crank.eccentricity", "5 um")]
RATED = 412e3
WEAR = {"input_speed": "1815 rpm", "hours": [0, 1], "disc_width": "9 mm", "gear_width": "8 mm"}

#: Everything that takes a torque and knows the reducer.
ASKED: dict[str, Callable[[Any], object]] = {
    "equilibrium": lambda torque: rverror.equilibrium(PLAIN, 0, torque=torque),
    "linearise": lambda torque: rverror.statics.linearise(PLAIN, 0, torque=torque),
    "of a model": lambda torque: PLAIN.equilibrium(torque, THETA),
    "transmission error": lambda torque: rverror.transmission_error(MODEL, THETA, torque=torque),
    "influence": lambda torque: rverror.influence(UNIT, THETA, "load.torsion", torque=torque),
    "stack": lambda torque: rverror.tolerances.stack(MODEL, CAMS, torque=torque),
    "stack at speed": lambda torque: rverror.tolerances.stack(FEW, CAMS, input_speed="300 rpm", torque=torque),
    "torsion curve": lambda torque: rverror.statics.torsion_curve(PLAIN, THETA, torques=[-torque, 0.0, torque]),
    "hysteresis": lambda torque: rverror.statics.hysteresis(PLAIN, [0.0], torques=np.array([torque]), friction=RUBBING),
    "efficiency": lambda torque: rverror.statics.efficiency(PLAIN, THETA, torque=torque, friction=RUBBING),
    "pressure": lambda torque: rverror.statics.contact_pressure(
        PLAIN, THETA, torque=torque, disc_width=9.0, gear_width=8.0
    ),
    "modes": lambda torque: rverror.dynamics.modes(PLAIN, torque=torque),
    "running up": lambda torque: rverror.dynamics.run_up(FEW, [0, 0.01], ["60 rpm"] * 2, torque=torque, kept=1),
    "simulation": lambda torque: rverror.simulate(PLAIN, points=64, torque=torque),
}


def told(ask: Callable[[], object]) -> list[str]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        ask()
    return [str(one.message) for one in caught if "rated torque" in str(one.message)]


@pytest.mark.parametrize("name", ASKED)
def test_newton_metres_without_a_unit_are_told_once(name: str) -> None:
    (said,) = told(lambda: ASKED[name](412.0))
    assert "412 is taken as 412 N*mm, 0.001 of the rated torque (412 N*m)" in said
    assert "'412 N*m', or '412 N*mm'" in said
    assert told(lambda: ASKED[name](RATED)) == []


@given(share=st.floats(5e-3, 2.0).filter(lambda share: share not in (5e-3, 2.0)))
def test_no_load_of_a_bench_is_doubted_and_each_of_them_in_newton_metres_is(share: float) -> None:
    """In N*m a thousandth of the number."""
    assert told(lambda: doubt_torque(UNIT, share * RATED)) == []
    assert len(told(lambda: doubt_torque(UNIT, share * RATED / 1e3))) == 1


@pytest.mark.parametrize("torque", [0, 0.0, -0.0, 1e-3, "412 N*mm", "0.4 N*m", InCore(412), 825.0, 1.0])
def test_what_is_believed(torque: Any) -> None:
    assert told(lambda: doubt_torque(UNIT, torque)) == []


@pytest.mark.parametrize("torque", [412, 412.0, np.float64(412), -412, np.array(412.0), [0.0, 412.0, 3.0]])
def test_what_is_doubted(torque: Any) -> None:
    assert len(told(lambda: doubt_torque(UNIT, torque))) == 1


def test_rows_with_units_and_their_zero_are_believed() -> None:
    assert told(lambda: doubt_torque(UNIT, ["-412 N*mm", 0, "412 N*mm"], name="torques")) == []


def test_without_a_rated_torque_nothing_is_known() -> None:
    bare = rverror.Drive(ratio=14.0)
    assert isinstance(bare, Drive)
    for mechanism in (bare, rverror.reducer("RV-40E", rated_torque=None)):
        assert told(lambda mechanism=mechanism: core_torque(mechanism, 412)) == []


def test_small_torques_that_are_computed_are_not_doubted() -> None:
    """A percentage of the rated torque; conditions of a run, whose file has units."""
    assert told(lambda: rverror.lost_motion(PLAIN, THETA, percent=0.1)) == []
    assert told(lambda: rverror.statics.torsional_stiffness(PLAIN, THETA, low=0.1, high=0.2)) == []
    assert told(lambda: rverror.equilibrium(PLAIN, OperatingConditions(np.zeros(1), 1.0, 412.0))) == []


def test_a_number_in_core_is_the_number() -> None:
    assert to_core(InCore(412), "torque") == 412.0
    assert type(to_core(InCore(412), "torque")) is float
