"""Jumps of a lightly loaded gear train: where they are, and what a fit gains by moving one."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import rverror
from gear_runs import TURN, UNIT, begin, runs_of
from rverror.base.arrays import Array
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.fit import Fit
from rverror.diagnosis.gears.grid import stretch, whole
from rverror.diagnosis.gears.jumps import fall, jumps
from rverror.diagnosis.gears.waveform import Waveform
from rverror.model.effects import Model

POINTS = 2048
BARE = Model(UNIT)


def wave(error: Array, *, closed: bool = True) -> Waveform:
    grid = whole(0.0, TURN, error.size) if closed else stretch(0.0, 1.0, TURN / POINTS)
    return Waveform(grid, error, np.zeros((0, error.size)), np.zeros((10, error.size)), (), UNIT)


@pytest.mark.parametrize("at", [2, 700, POINTS - 1])
@pytest.mark.parametrize("size", [3.0, -3.0])
def test_a_jump_is_found_in_a_large_ripple_and_where_the_turn_closes(at: int, size: float) -> None:
    """The ripple changes by three times as much between two angles, and bends."""
    angle = TURN / POINTS * np.arange(POINTS)
    ripple = 40 * np.cos(39 * angle) + np.abs(np.sin(78 * angle + 0.3))
    assert not jumps(wave(ripple), 2.0).any()
    found = jumps(wave(ripple + size * np.exp(-((np.arange(POINTS) - at) % POINTS) / 20.0)), 2.0)
    assert set(np.flatnonzero(found)) == {(at + step) % POINTS for step in (-2, -1, 0, 1)}


def test_a_jump_reaches_as_far_on_the_dense_grid_of_a_turn_of_the_crank() -> None:
    """What repeats with the crank is solved at 256 angles of its turn, 10,240 of a turn of the output."""
    step = TURN / 40 / 256
    grid = whole(0.0, TURN / 40, 256)
    error = np.exp(-((np.arange(256) - 100) % 256) / 100.0)
    found = jumps(replace(wave(error), grid=grid), 0.5)
    reached = np.flatnonzero(found) * step
    assert reached[0] == pytest.approx(100 * step - 2 * TURN / POINTS, abs=step)
    assert reached[-1] == pytest.approx(100 * step + 2 * TURN / POINTS, abs=2 * step)


def test_the_ends_of_a_stretch_are_no_jump() -> None:
    angle = TURN / POINTS * np.arange(stretch(0.0, 1.0, TURN / POINTS).points)
    assert not jumps(wave(100 * angle, closed=False), 2.0).any()
    assert jumps(wave(100 * angle), 2.0).any()


def started(turns: float) -> Fit:
    """A fit to one run of a unit without errors, with its wave over a turn of the output."""
    first = begin(BARE, runs_of(BARE, ((1.0, 50e3),), points=POINTS, turns=turns), points=POINTS)
    return replace(first, waves=(replace(first.waves[0], grid=whole(0.0, TURN, POINTS)),))


def seen(fit: Fit, measured: Array, predicted: Array) -> Fit:
    """The state of a fit to one run with another prediction."""
    (record,) = fit.run_set.records
    rest = measured - predicted
    white = record.whiten(rest[None])
    waves = (replace(fit.waves[0], error=predicted[: fit.waves[0].grid.points]),)
    return replace(fit, waves=waves, residual=(rest,), rows=(white,), data=float(np.sum(white**2)))


def test_beyond_noise_a_jump_is_taken_off_as_it_counts() -> None:
    """There squares count as their logarithm: with all of them taken off, moving a jump to its place would lose."""
    first = started(1.0)
    (record,) = first.run_set.records
    jump = 30 * ARCSEC * np.exp(-np.arange(POINTS) / 1000)
    late, right = (np.where(np.arange(POINTS) >= at, jump, 0.0) for at in (1001, 1000))
    before, after = (seen(first, record.error + right, one) for one in (late, right))
    assert before.data > 2 * before.bound
    assert 0 < fall(before, after) < before.objective - after.objective


@pytest.mark.parametrize("ahead", [0.0, 0.4])
def test_a_jump_is_looked_for_where_the_marks_put_it(ahead: float) -> None:
    marks = rverror.effect("sensor.index_offset", offset=f"{ahead} rad")
    first = started(1.0)
    (record,) = first.run_set.records
    grid = replace(first.waves[0].grid, start=ahead)
    first = replace(first, model=Model(UNIT, (marks,)), waves=(replace(first.waves[0], grid=grid),))
    jump = 4 * ARCSEC * np.exp(-np.arange(POINTS) / 1000)
    late, right = (np.where(np.arange(POINTS) >= at, jump, 0.0) for at in (1001, 1000))
    before, after = (seen(first, record.error + right, one) for one in (late, right))
    assert fall(before, after) < 0.1 * (before.objective - after.objective)


@pytest.mark.parametrize("turns", [1.0, 2.0])
@pytest.mark.parametrize("better", [0.0, 0.2])
def test_what_a_jump_gains_by_moving_is_left_out_and_all_else_counts(turns: float, better: float) -> None:
    """Set aside from the first the samples would say the same."""
    first = started(turns)
    (record,) = first.run_set.records
    turn = np.arange(record.theta.size) % POINTS
    jump = 4 * ARCSEC * np.exp(-turn / 1000)  # 1.5 arcsec, five times the noise
    measured = record.error + np.where(turn >= 1000, jump, 0.0)
    late = np.where(turn >= 1001, jump, 0.0) + better * ARCSEC * np.cos(9 * record.theta)
    before, after = (seen(first, measured, one) for one in (late, np.where(turn >= 1000, jump, 0.0)))
    aside = replace(record, kept=record.kept & (turn != 1000))
    white = [np.sum(aside.whiten(fit.residual[0][None]) ** 2) for fit in (before, after)]
    assert fall(before, after) == pytest.approx(white[0] - white[1], rel=1e-6, abs=1e-6)
    assert fall(after, before) == pytest.approx(white[1] - white[0], rel=1e-6, abs=1e-6)
    assert before.data < before.bound
    assert before.objective - after.objective > fall(before, after) + 40 * turns
    assert (fall(before, after) > 10) == (better > 0)


def test_a_jump_that_moves_with_a_line_is_left_out_too() -> None:
    """The set with the line has it as a row of any size: of the samples that are left it takes the same off."""
    first = started(1.0)
    (record,) = first.run_set.records
    lined = replace(record, orders=(23.37,))
    turn = np.arange(record.theta.size)
    jump = 4 * ARCSEC * np.exp(-turn / 1000)
    measured = record.error + np.where(turn >= 1000, jump, 0.0) + 0.08 * ARCSEC * np.cos(23.37 * record.theta)
    before = seen(first, measured, np.where(turn >= 1001, jump, 0.0))
    after = seen(
        replace(first, run_set=first.run_set.with_records([lined])), measured, np.where(turn >= 1000, jump, 0.0)
    )
    kept = record.kept & (turn != 1000)
    white = [
        np.sum(replace(one, kept=kept).whiten(fit.residual[0][None]) ** 2)
        for one, fit in ((record, before), (lined, after))
    ]
    assert before.data < before.bound
    assert fall(before, after) == pytest.approx(white[0] - white[1], rel=1e-6)
    assert before.objective - after.objective > fall(before, after) + 40


def test_what_differs_elsewhere_is_no_jump_that_moved() -> None:
    """One spike less, where no prediction jumps."""
    first = started(1.0)
    (record,) = first.run_set.records
    bump = 5 * ARCSEC * np.exp(-(((np.arange(POINTS) - 1000) / 12.0) ** 2))
    before, after = (seen(first, record.error + bump, one) for one in (np.zeros(POINTS), bump))
    assert fall(before, after) == before.objective - after.objective > 400


def test_what_differs_in_many_samples_is_no_jump_that_moved() -> None:
    first = started(1.0)
    (record,) = first.run_set.records
    square = 5 * ARCSEC * np.sign(np.sin(math.pi / 8 * (np.arange(POINTS) + 0.5)))
    before, after = (seen(first, record.error + square, one) for one in (np.roll(square, 4), square))
    assert fall(before, after) == before.objective - after.objective > 400
