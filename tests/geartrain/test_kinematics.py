"""Angles, orders, sampling and periods."""

from __future__ import annotations

import math
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, strategies as st

import rverror
from rverror import Drive, Reducer
from rverror.geartrain.contacts import pose
from rverror.geartrain.kinematics import (
    folded_order,
    frame_orders,
    fundamental_orders,
    motion_direction,
    samples_needed,
    true_period,
)
from strategies import reducers

UNIT = rverror.reducer("RV-40E")


def test_turns_of_every_part() -> None:
    expected = {"housing": 0, "carrier": 1, "disc": 1, "crank": -39, "planet": -39, "sun": 121}
    assert frame_orders(UNIT) == expected
    relative = {part: turns - 1 for part, turns in frame_orders(UNIT).items()}
    assert relative["crank"] == -40
    assert relative["sun"] == 120
    assert frame_orders(rverror.reducer("RV-003"))["sun"] == 101


def test_orders_by_the_frame_of_the_error() -> None:
    found = fundamental_orders(UNIT)
    assert found["housing"] == 39
    assert {found[part] for part in ("carrier", "disc", "crank", "planet")} == {40}
    assert found["sun"] == 120
    assert found["output"] == 1
    assert found["gear mesh"] == 1080
    assert found["cycloid mesh"] == 1560


@given(reducers())
def test_meshes_count_teeth(unit: Reducer) -> None:
    """Teeth that pass: sun's and planets' alike seen from the carrier, pins and lobes alike seen from the crank."""
    found = fundamental_orders(unit)
    assert found["gear mesh"] == pytest.approx(unit.sun_teeth * found["sun"], rel=1e-12)
    assert found["cycloid mesh"] == pytest.approx(unit.disc_lobes * found["disc"], rel=1e-12)


@given(reducers())
def test_samples_are_enough_and_no_more_than_needed(unit: Reducer) -> None:
    samples, highest = samples_needed(unit), max(fundamental_orders(unit).values())
    assert math.log2(samples).is_integer()
    assert samples / 2 > highest
    assert samples / 4 <= highest + 0.5


def test_thousand_samples_fold_the_meshes() -> None:
    assert samples_needed(UNIT) == 4096
    assert folded_order(1080, 1000) == 80
    assert folded_order(1560, 1000) == 440


@given(st.floats(0, 5000), st.integers(10, 5000))
def test_folded_order_is_what_samples_show(order: float, samples: int) -> None:
    """At the sample places a cosine of the order is the cosine of its folded order."""
    folded = folded_order(order, samples)
    assert 0 <= folded <= samples / 2
    places = np.arange(0, samples, max(1, samples // 10)) / samples
    np.testing.assert_allclose(np.cos(2 * np.pi * order * places), np.cos(2 * np.pi * folded * places), atol=1e-8)


@given(reducers(), st.floats(-4, 4))
def test_everything_stands_as_before_after_the_true_period(unit: Reducer, start: float) -> None:
    turns = true_period(unit)
    for order in frame_orders(unit).values():
        assert math.cos(order * (start + 2 * math.pi * turns)) == pytest.approx(math.cos(order * start), abs=1e-7)
    assert Fraction(turns) * unit.exact_ratio == int(turns * unit.exact_ratio)


@pytest.mark.parametrize(
    ("drive", "turns"),
    [
        (Drive(ratio=14.0), 1),
        (Drive(ratio=-14.5), 2),
        (Drive(ratio=10.0, shafts={"worm": 360.0, "idler": 10 / 3}), 3),
        (Drive(ratio=2.5, shafts={"a": 4 / 3}), 6),
    ],
)
def test_true_period_of_a_drive(drive: Drive, turns: int) -> None:
    assert true_period(drive) == turns


@pytest.mark.parametrize(
    ("angles", "expected"),
    [
        ([0.0, 1.0, 2.0], [1, 1, 1]),
        ([2.0, 1.0, 0.0], [-1, -1, -1]),
        ([0.0, 1.0, 2.0, 1.0, 0.0], [1, 1, 1, -1, -1]),
        ([0.0, 1.0, 1.0, 2.0], [1, 1, 1, 1]),
        ([2.0, 1.0, 1.0, 1.0, 2.0], [-1, -1, -1, -1, 1]),
        ([1.0, 1.0, 0.0], [-1, -1, -1]),
        ([1.0, 1.0, 1.0], [1, 1, 1]),
        ([3.0], [1]),
        ([], []),
    ],
)
def test_direction_from_the_angles(angles: list[float], expected: list[int]) -> None:
    np.testing.assert_array_equal(motion_direction(np.array(angles)), expected)


def test_contacts_stand_where_the_conventions_say() -> None:
    """At theta = 0 disc 0's eccentric and crank 0 lie on +x; others follow counter-clockwise."""
    for unit in (UNIT, rverror.reducer("RV-003", discs=3)):
        motion = pose(unit, [0.0, 0.1])
        np.testing.assert_allclose(motion.crank_position[:, 0], 2 * np.pi * np.arange(unit.cranks) / unit.cranks)  # type: ignore[attr-defined]
        np.testing.assert_allclose(motion.eccentric[:, 0], 2 * np.pi * np.arange(unit.discs) / unit.discs)  # type: ignore[attr-defined]
        np.testing.assert_allclose(np.diff(motion.crank_position), 0.1)  # type: ignore[attr-defined]
        np.testing.assert_allclose(np.diff(motion.eccentric), -3.9)  # type: ignore[attr-defined]
        np.testing.assert_array_equal(motion.direction, 1)


@pytest.mark.parametrize("theta", [[], [[0.0, 1.0]]])
def test_pose_refuses_what_is_no_row(theta: object) -> None:
    with pytest.raises(ValueError, match="give a row of one or more angles"):
        pose(UNIT, theta)


@pytest.mark.parametrize("direction", [0, 2, [1.0, 0.5], float("nan")])
def test_pose_refuses_a_direction_that_is_none(direction: object) -> None:
    with pytest.raises(ValueError, match=r"must be 'forward' or 'reverse', \+1 or -1"):
        pose(UNIT, [0.0, 1.0], direction=direction)


@pytest.mark.parametrize("theta", [[0.0, float("nan")], [0.0, float("inf")], ["a"]])
def test_pose_refuses_what_is_no_number(theta: object) -> None:
    with pytest.raises(ValueError, match=r"finite|no number"):
        pose(UNIT, theta)


@pytest.mark.parametrize(("name", "value"), [("direction", [1, 1, 1]), ("time", [0.0, 1.0, 2.0])])
def test_pose_refuses_rows_of_another_length(name: str, value: object) -> None:
    with pytest.raises(ValueError, match=name):
        pose(UNIT, [0.0, 1.0], **{name: value})


def test_mixed_run_is_forward_and_reverse_in_one() -> None:
    there = np.linspace(0, 1, 50)
    theta = np.concatenate([there, there[-2::-1]])
    both = rverror.influence(UNIT, theta, "crank.eccentricity", crank=0, disc=0).matrix
    forward = rverror.influence(UNIT, there, "crank.eccentricity", crank=0, disc=0).matrix
    reverse = rverror.influence(UNIT, there[::-1], "crank.eccentricity", crank=0, disc=0).matrix
    np.testing.assert_array_equal(both, np.concatenate([forward, reverse[:, 1:]], axis=1))
    assert np.abs(forward - reverse[:, ::-1]).max() > 1e-3
