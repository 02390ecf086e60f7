"""How a run is looked at, sample by sample: waveforms of the gear train, and what is no waveform that repeats."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rverror
from gear_runs import CAM, TURN, UNIT, record_of, runs_of
from rverror.base.arrays import Array
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.fit import RunSet, evaluated
from rverror.diagnosis.gears.grid import AngleGrid, whole
from rverror.diagnosis.gears.observation import EverySample, MeanSamples
from rverror.diagnosis.gears.record import records_of
from rverror.diagnosis.gears.waveform import Waveform
from rverror.diagnosis.policy import POLICY
from rverror.model.effects import Model
from rverror.runs.noise import RunNoise

#: Ratio 44.2: all but the sun stand as before after one turn of the output, the sun after five.
ODD = replace(UNIT, sun_teeth=10, module=54 / 37)


def wave_of(grid: AngleGrid, error: Array) -> Waveform:
    return Waveform(grid, error, np.zeros((0, grid.points)), np.zeros((10, grid.points)), (), UNIT)


@pytest.mark.parametrize("offset", [0.0, 0.37])
@pytest.mark.parametrize("period", [TURN, TURN / 16])
def test_a_waveform_is_read_at_the_samples_and_turns_with_the_marks(offset: float, period: float) -> None:
    """Over a turn of the output or one of the crank, which repeats; its change is the derivative."""
    theta = np.sort(np.random.default_rng(7).uniform(0, 2 * TURN, 700))
    observation = EverySample(record_of(np.zeros(theta.size), theta))
    grid = whole(0.1, period, round(1024 * period / TURN) * (1 if period == TURN else 2))
    waves = [np.cos(16 * grid.theta) + np.sin(48 * grid.theta), np.sin(32 * grid.theta)]
    at = theta + offset
    expected = [np.cos(16 * at) + np.sin(48 * at), np.sin(32 * at)]
    wave = wave_of(grid, waves[0])
    for rows in (
        observation.of_wave(wave, np.array(waves), offset),
        observation.of_grid(grid, np.array(waves), offset),
    ):
        assert rows == pytest.approx(np.array(expected), abs=1e-4)
    assert observation.change(wave, offset) == pytest.approx(-16 * np.sin(16 * at) + 48 * np.cos(48 * at), abs=0.02)
    assert observation.measured.size == observation.width == theta.size


@pytest.mark.parametrize("kept", ["made", "_ways"])
def test_what_another_thread_clears_meanwhile_is_made_and_given_all_the_same(kept: str) -> None:
    """The ways from grids to samples that are kept are few, and threads share them: one may drop what one has made."""

    class Dropped(dict[object, object]):
        def __setitem__(self, key: object, value: object) -> None:
            """Another thread clears all at once."""

    grid, theta = whole(0.0, TURN, 256), TURN * np.arange(300) / 300
    observation = MeanSamples(record_of(np.zeros(theta.size), theta), 4)
    rows = np.cos(3 * grid.theta)[None]
    expected = observation.of_grid(grid, rows, 0.2)
    other = MeanSamples(replace(observation.record, made=Dropped()) if kept == "made" else observation.record, 4)
    if kept == "_ways":
        vars(other)[kept] = Dropped()
    assert np.array_equal(other.of_grid(grid, rows, 0.2), expected)


def test_what_is_read_at_the_output_keeps_to_the_bench_s_zero() -> None:
    """An encoder's waves stand in the bench, wherever the marks of the gear are."""
    theta = TURN * np.arange(300) / 300
    record = record_of(np.zeros(theta.size), theta)
    rows = EverySample(record).beyond(UNIT, whole(0.0, TURN, 256), ("sensor.encoder_eccentricity", {}), {}, 0.37)
    assert rows == pytest.approx(np.stack([np.cos(theta), np.sin(theta)]), abs=1e-12)


@pytest.mark.parametrize("turns", [1.0, 5.0])
@pytest.mark.parametrize("unit", [UNIT, ODD], ids=["closes", "open"])
def test_a_sun_s_waves_are_followed_over_all_turns(unit: rverror.Reducer, turns: float) -> None:
    """The influence at the samples themselves where its turns do not close: noise alone is left, and it is linear."""
    sun = rverror.effect("involute.sun_pitch", harmonic=2, cos="6 um", sin="-4 um")
    bare, true = Model(unit), Model(unit, (sun,))
    runs = runs_of(true, ((1.0, 50e3),), points=1024, turns=turns, ratio=unit.ratio)
    noise = RunNoise(np.array([0.7]), 0.3 * ARCSEC * np.sqrt(1 - 0.7**2))
    records = [replace(r, noise=noise) for r in records_of(bare, runs)[0]]
    run_set = RunSet.of(unit, records, POLICY, points=1024, anywhere=False)
    fit, without = evaluated(run_set, true, bare), evaluated(run_set, bare, bare)
    assert fit.data < fit.bound
    assert without.data > 50 * fit.data
    moment, gram, values = fit.moment[:2], fit.gram[:2, :2], np.array(sun.values)
    assert fit.data + 2 * moment @ values + values @ gram @ values == pytest.approx(without.data, rel=1e-2)


def test_only_a_sun_is_added_by_its_influence_and_only_where_it_must() -> None:
    """Where its turns do not close with the output's."""
    effects = (
        rverror.effect("involute.sun_pitch", harmonic=2, cos="6 um"),
        CAM,
        rverror.effect("sensor.encoder_eccentricity", cos="1 arcsec"),
    )
    for unit, apart in ((UNIT, False), (ODD, True)):
        run_set = RunSet.of(unit, [record_of(np.zeros(64))], POLICY, points=64, anywhere=False)
        assert run_set.apart("involute.sun_pitch") is apart
        assert run_set.around(Model(unit, effects)) == (effects[1:2] if apart else effects[:2])
        assert not any(run_set.apart(effect.key) for effect in effects[1:])


@pytest.mark.parametrize("breaks", [(), (1.0, 3.0)])
@pytest.mark.parametrize("period", [TURN, TURN / 16])
def test_means_are_those_of_the_samples_that_count_and_begin_anew_after_gaps(
    period: float, breaks: tuple[float, ...]
) -> None:
    """Of readings and predictions alike; what is left at the end of a series joins its last mean."""
    theta = np.linspace(0, TURN, 403, endpoint=False)
    kept = np.ones(theta.size, dtype=np.bool_)
    kept[[7, 20, 21, 22, 23]] = False
    record = record_of(np.random.default_rng(3).normal(size=theta.size), theta)
    record = replace(record, kept=kept, starts=(0, 202), noise=RunNoise(np.array([0.5]), ARCSEC))
    every, means = EverySample(record), MeanSamples(record, 4)
    series = [*range(0, 200, 4), *range(202, 402, 4)]
    ends = [*series[1:50], 202, *series[51:], 403]

    def averaged(row: Array) -> Array:
        used = [
            np.arange(a, b)[kept[a:b]] if kept[a:b].any() else np.arange(a, b)
            for a, b in zip(series, ends, strict=True)
        ]
        return np.array([row[at].mean() for at in used])

    grid = replace(whole(0.1, period, 256), breaks=breaks)
    rows = np.random.default_rng(4).normal(size=(2, grid.points))
    assert means.width == len(series)
    assert means.measured == pytest.approx(averaged(every.measured))
    for offset in (0.0, 0.21):
        read = every.of_grid(grid, rows, offset)
        assert means.of_grid(grid, rows, offset) == pytest.approx(np.array([averaged(row) for row in read]), abs=1e-9)
    assert means.freedom == len(series) - 1 - 2 * means.whitening.noise.coefficients.size  # one has no sample left


def test_means_say_of_a_wave_what_the_samples_say_but_for_the_noise_that_folds_onto_it() -> None:
    """Of white noise that leaves the share by which means keep the power of a wave, in closed form."""
    theta = np.arange(6144) * TURN / 2048
    record = replace(record_of(np.zeros(theta.size), theta), slow=True, noise=RunNoise(np.zeros(0), ARCSEC))
    orders = np.array([1, 40, 100, 156])
    rows = ARCSEC * np.cos(np.outer(orders, theta))
    every, means = EverySample(record), MeanSamples(record, 4)
    told, few = (np.sum(one**2, axis=1) for one in (every.whiten(rows), means.whiten(means.averaged(rows))))
    half = orders * TURN / 2048 / 2
    kept = (np.sin(4 * half) / (4 * np.sin(half))) ** 2
    assert few / told == pytest.approx(kept, rel=0.01)
    assert kept == pytest.approx([1, 0.98, 0.89, 0.74], abs=0.01)
