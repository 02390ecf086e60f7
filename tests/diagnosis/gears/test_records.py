"""Runs as they are fitted: what cannot be is set aside, counted and said; what may have any size gets its rows."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import rverror
from gear_runs import TURN, UNIT, record_of, red
from rverror.base.arrays import Array
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.record import Record, conditions_of, records_of
from rverror.diagnosis.gears.residual_faults import without_residual_faults
from rverror.runs.noise import RunNoise

MODEL = rverror.Model(UNIT)
N = 2048
THETA = TURN / N * np.arange(N)


def read(theta: Array = THETA, error: Array | None = None, **told: Any) -> rverror.Run:
    """A run that reads a wave of an encoder in noise, or an error of its own."""
    error = 5 * ARCSEC * np.cos(theta) + red(0, theta.size) if error is None else error
    direction = told.pop("direction", "forward")
    return rverror.run_from_arrays(
        input_angle=UNIT.ratio * theta, output_angle=theta + error, direction=direction, **({"torque": 50e3} | told)
    )


def one(run: rverror.Run) -> tuple[Record, list[str]]:
    (record,), notes = records_of(MODEL, [run])
    return record, notes


def test_spikes_become_places_without_value() -> None:
    error = 5 * ARCSEC * np.cos(THETA) + red(0, N)
    bad = np.array([77, 600, 601, 1500])
    error[bad] += np.array([200, -150, -160, 90]) * ARCSEC
    record, notes = one(read(error=error))
    assert list(np.flatnonzero(~record.kept)) == list(bad)
    assert record.theta == pytest.approx(THETA)
    assert record.starts == (0,)
    assert len([note for note in notes if "spike" in note]) == 1
    white = replace(record, noise=RunNoise(np.array([0.5]), ARCSEC)).whiten
    assert white.freedom == N - 4 - 1
    # whatever stands there, it does not count
    wild = np.where(record.kept, 0.0, 1e-3)
    assert white(wild[None]) == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize(("lost", "breaks"), [(1, False), (8, False), (9, True), (60, True)])
def test_a_short_gap_is_filled_and_a_long_one_begins_a_new_series(lost: int, breaks: bool) -> None:
    """Eight samples at most, over which the noise still remembers, become places without value, evenly spaced."""
    used = np.ones(N, dtype=np.bool_)
    used[700 : 700 + lost] = False
    error = 5 * ARCSEC * np.cos(THETA) + red(0, N)
    record, notes = one(read(THETA[used], error[used]))
    if breaks:
        assert record.starts == (0, 700)
        assert record.kept.all()
        assert record.theta.size == N - lost
        assert record.absent == ()
    else:
        assert record.starts == (0,)
        assert list(np.flatnonzero(~record.kept)) == list(range(700, 700 + lost))
        assert record.theta == pytest.approx(THETA)
        assert record.absent == tuple(range(700, 700 + lost))
    assert len([note for note in notes if "missing" in note]) == 1
    assert record.turns == pytest.approx(1, rel=0.04)


def test_what_was_never_read_is_told_from_what_was_set_aside() -> None:
    """Both are places without value; only a spike was a reading, and a long gap before them moves their places."""
    used = np.ones(N, dtype=np.bool_)
    used[300:320], used[700:703], used[1500] = False, False, False
    error = 5 * ARCSEC * np.cos(THETA) + red(0, N)
    error[1000] += 200 * ARCSEC
    record, _ = one(read(THETA[used], error[used]))
    assert record.theta[list(record.absent)] == pytest.approx(THETA[[700, 701, 702, 1500]])
    spikes = np.setdiff1d(np.flatnonzero(~record.kept), record.absent)
    assert record.theta[spikes] == pytest.approx(THETA[[1000]])
    assert one(read())[0].absent == ()


def test_one_percent_of_the_samples_missing_costs_one_percent() -> None:
    """Each lost sample is a place without value; sizes and noise are those of the whole run."""
    rng = np.random.default_rng(0)
    used = np.ones(N, dtype=np.bool_)
    used[rng.choice(np.arange(5, N - 5), N // 100, replace=False)] = False
    error = 5 * ARCSEC * np.cos(THETA) + red(0, N)
    record, _ = one(read(THETA[used], error[used]))
    assert record.theta == pytest.approx(THETA, abs=1e-9)
    assert np.array_equal(record.kept, used)
    assert record.starts == (0,)
    noise = RunNoise(np.array([0.7]), 0.3 * ARCSEC * math.sqrt(1 - 0.49))
    rows = np.cos(THETA)[None]
    spread = []
    for r in (record, record_of(error)):
        white = replace(r, noise=noise).whiten(rows)
        spread.append(float((white @ white.T)[0, 0]))
    assert spread[0] / spread[1] == pytest.approx(0.99, abs=0.01)


def test_a_slip_gets_a_level_of_its_own() -> None:
    error = 5 * ARCSEC * np.cos(THETA) + red(0, N) + 40 * ARCSEC * (np.arange(N) >= 1200)
    record, notes = one(read(error=error))
    assert record.slips == (1200,)
    assert record.nuisance.shape == (2, N)
    assert np.array_equal(record.nuisance[1], (np.arange(N) >= 1200).astype(float))
    assert any("slip" in note for note in notes)
    rest = record.without_nuisance(record.error)
    assert np.std(rest - 5 * ARCSEC * np.cos(THETA)) < 2 * ARCSEC  # the wave itself is in part a level


def test_a_slip_after_lost_rows_keeps_its_place() -> None:
    """Places move when rows go and when they are filled in."""
    error = red(0, N) + 40 * ARCSEC * (np.arange(N) >= 1200)
    used = np.ones(N, dtype=np.bool_)
    used[300:303], used[600:620] = False, False
    record, _ = one(read(THETA[used], error[used]))
    (slip,) = record.slips
    assert record.theta[slip] == pytest.approx(THETA[1200])
    assert record.starts == (0, 600)
    assert record.theta[600] == pytest.approx(THETA[620])


def test_what_stands_out_of_the_residual_is_set_aside_later() -> None:
    """A spike of 8 noises hides beside an error of 30 arcsec until that is known."""
    record = record_of(30 * ARCSEC * np.cos(48 * THETA) + red(0, N, 0.3, 0.0))
    record.error[900] += 2.4 * ARCSEC
    rest = record.error - 30 * ARCSEC * np.cos(48 * THETA)
    (changed,) = without_residual_faults([record], [rest]) or [record]
    assert list(np.flatnonzero(~changed.kept)) == [900]
    assert changed.more
    assert without_residual_faults([changed], [rest]) is None


@pytest.mark.parametrize("direction", ["forward", "reverse"])
def test_a_run_of_ten_degrees_is_a_run(direction: str) -> None:
    theta = math.radians(10) / 400 * np.arange(400) + 1.0
    theta = theta if direction == "forward" else theta[::-1].copy()
    record, _ = one(read(theta, red(0, 400), direction=direction))
    assert record.turns == pytest.approx(10 / 360)
    conditions, which = conditions_of([record], 2048, anywhere=False)
    assert which == [0]
    grid = conditions[0].turn
    assert not grid.closed
    assert grid.points < 120
    assert grid.theta[0] < theta.min()
    assert grid.theta[-1] > theta.max()


def test_runs_of_one_condition_share_a_grid_and_others_do_not() -> None:
    runs = [read(), read(direction="reverse", theta=THETA[::-1].copy()), read(torque=90e3), read()]
    records, _ = records_of(MODEL, runs)
    conditions, which = conditions_of(records, 1024, anywhere=False)
    assert which == [0, 1, 2, 0]
    assert all(c.turn.closed for c in conditions)
    assert {c.turn.points for c in conditions} == {1024}


def test_too_few_samples_are_refused_with_the_remedy() -> None:
    with pytest.raises(rverror.InputError, match=r"run 1: 40 samples; 48 or more .* measure a longer stretch"):
        one(read(THETA[:40], red(0, 40)))
    assert one(read(THETA[:48], red(0, 48)))[0].theta.size == 48


def test_a_zero_is_shared_by_label_where_the_load_is_known() -> None:
    labelled = [read(index="A"), read(index="A"), read(index="B"), read()]
    records, _ = records_of(MODEL, labelled)
    assert [r.zero for r in records] == ["A", "A", "", ""]
    assert records[0].nuisance.shape == (0, N)
    assert records[2].nuisance.shape == (1, N)
    records, notes = records_of(MODEL, [read(index="A", torque=None), read(index="A")])
    assert records[0].zero == ""
    assert any("without output_torque its windup is unknown" in note for note in notes)


def test_what_settles_and_lines_are_rows_over_time_and_angle() -> None:
    record = record_of(red(0, N), orders=(11.3,), slow=True)
    assert record.nuisance.shape == (1 + 2 + 4, N)
    assert record.nuisance[1] == pytest.approx(np.cos(11.3 * THETA))
    clock = np.arange(N) / N
    wave = 20 * ARCSEC * np.exp(-clock / 0.15)
    assert record.slow_part(wave) - record.slow_part(wave).mean() == pytest.approx(wave - wave.mean(), abs=0.3 * ARCSEC)
    assert record.without_nuisance(wave + 3 * ARCSEC * np.sin(11.3 * THETA)) == pytest.approx(0, abs=0.3 * ARCSEC)
