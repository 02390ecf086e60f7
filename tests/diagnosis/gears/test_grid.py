"""From the angles at which the gear train is solved to the samples: against waves that are known everywhere."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from rverror.diagnosis.gears.grid import AngleGrid, stretch, whole

TURN = 2 * math.pi


def wave(order: float, theta: np.ndarray) -> np.ndarray:
    return np.stack([np.cos(order * theta), np.sin(order * theta)])


@given(st.floats(-9, 9), st.integers(1, 100), st.integers(0, 2**16))
@settings(max_examples=30, deadline=None)
def test_a_closed_grid_follows_waves_at_any_angle(start: float, order: int, seed: int) -> None:
    """512 angles a turn, order 100 at most: five points a wave are within 0.1 %, also turns away from the grid."""
    grid = whole(start, TURN, 512)
    theta = np.random.default_rng(seed).uniform(-20, 20, 300)
    found = grid.to_samples(theta)
    assert found(wave(order, grid.theta)) == pytest.approx(wave(order, theta), abs=1e-3)
    assert found.change(wave(order, grid.theta)[0]) == pytest.approx(-order * np.sin(order * theta), abs=5e-3 * order)


@pytest.mark.parametrize("order", [1.0, 11.3, 40.0, 90.7])
def test_an_open_grid_follows_waves_up_to_its_ends(order: float) -> None:
    low, high = 0.3, 0.3 + math.radians(10)
    grid = stretch(low, high, TURN / 512)
    assert not grid.closed
    assert grid.theta[0] < low
    assert grid.theta[-1] > high
    theta = np.linspace(low, high, 777)
    found = grid.to_samples(theta)
    assert found(wave(order, grid.theta)) == pytest.approx(wave(order, theta), abs=1e-3)
    slope = found.change(wave(order, grid.theta)[1])
    assert slope == pytest.approx(order * np.cos(order * theta), abs=5e-3 * order)


@pytest.mark.parametrize("turns", [1, 3])
def test_samples_on_the_grid_are_its_values_exactly(turns: int) -> None:
    grid = whole(0.7, TURN, 256)
    theta = 0.7 + TURN / 256 * np.arange(256 * turns)
    values = np.random.default_rng(0).normal(size=(2, 256))
    found = grid.to_samples(theta)
    assert np.array_equal(found(values), np.tile(values, turns))
    row = np.cos(20 * grid.theta)
    assert found.change(row) == pytest.approx(-20 * np.sin(20 * theta), abs=0.02)


def test_a_coarser_grid_covers_the_same_angles() -> None:
    """A period closes, a stretch keeps its margins beyond what is travelled; fewer angles are never made more."""
    period, part = whole(0.1, TURN, 1024), stretch(0.2, 1.0, TURN / 1024)
    few = period.coarser(256)
    assert (few.start, few.points, few.closed) == (0.1, 256, True)
    assert few.step * few.points == pytest.approx(TURN)
    crank = whole(0.1, TURN / 40, 100)  # 4000 a turn
    assert crank.coarser(400) == whole(0.1, TURN / 40, 10)
    theta = np.linspace(0.2, 1.0, 33)
    wide = part.coarser(256)
    assert (wide.start, wide.step) == pytest.approx((0.2 - (0.2 - part.start) * 4, TURN / 256))
    assert wide.to_samples(theta)(wave(30, wide.theta)) == pytest.approx(wave(30, theta), abs=1e-3)
    assert period.coarser(1024) is period
    assert part.coarser(2048) is part


def test_a_grid_of_one_turn_of_the_crank_repeats() -> None:
    grid = AngleGrid(0.0, TURN / 40 / 64, 64, closed=True)
    theta = np.linspace(0, TURN, 999)
    assert grid.to_samples(theta)(np.cos(80 * grid.theta)[None])[0] == pytest.approx(np.cos(80 * theta), abs=1e-6)


@pytest.mark.parametrize("closed", [True, False])
def test_no_spline_rings_at_a_jump_of_the_waveform(closed: bool) -> None:
    """Either side is a wave of its own; beside the jump an even spline is off by a share of it."""
    breaks = (1.0003, 4.2)
    whole_grid = whole(0.1, TURN, 2048) if closed else stretch(0.3, 5.9, TURN / 2048)

    def error(theta: np.ndarray) -> np.ndarray:
        side = (np.mod(theta, TURN) > breaks[0]) & (np.mod(theta, TURN) < breaks[1])
        return np.cos(40 * theta) + np.where(side, 20.0 + np.sin(39 * theta), 0.0)

    theta = np.linspace(0.35, 5.8, 4001)
    away = np.min([np.abs(theta - at) for at in breaks], axis=0) > 4 * TURN / 2048
    rings, rests = (
        np.abs(grid.to_samples(theta)(error(grid.theta)[None])[0] - error(theta))[away].max()
        for grid in (whole_grid, dataclasses.replace(whole_grid, breaks=breaks))
    )
    assert rests < 1e-3
    assert rings > 0.05
