"""A run in few numbers says the same as its samples of every waveform on the grid."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rverror
from gear_runs import TURN, UNIT, record_of, red, runs_of
from rverror.base.arrays import Array
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.fit import RunSet, evaluated, fitted
from rverror.diagnosis.gears.grid import AngleGrid
from rverror.diagnosis.gears.record import Record, records_of
from rverror.diagnosis.gears.sight import EverySample, Few, compressed
from rverror.diagnosis.gears.waveform import Named, Waveform
from rverror.diagnosis.noise import RunNoise
from rverror.diagnosis.policy import POLICY

BEYOND: tuple[Named, ...] = (
    ("sensor.encoder_eccentricity", {}),
    ("sensor.ratio_error", {}),
    ("involute.sun_pitch", {"harmonic": 1}),
)


def seen(
    seed: int, *, travel: float = TURN, n: int = 900, uneven: bool = True, points: int = 96, memory: float = 0.6
) -> tuple[RunSet, EverySample, Few]:
    """A run with samples set aside, a slip, a gap and a line, and what it looks like in few numbers."""
    rng = np.random.default_rng(seed)
    theta = np.sort(rng.uniform(0, travel, n)) if uneven else travel / n * np.arange(n)
    kept = np.ones(n, dtype=np.bool_)
    kept[rng.integers(0, n, 9)] = False
    error = red(seed, n) + 4 * ARCSEC * np.cos(theta)
    noise = RunNoise(np.array([memory, 0.1]), 0.2 * ARCSEC)
    record = Record("run 1", theta, error, 1.0, 50e3, kept, (0, n // 2), (n // 3,), orders=(11.3,), noise=noise)
    bench = replace(RunSet.of(UNIT, [record], POLICY, points=points, anywhere=False), few=BEYOND)
    full = EverySample(record)
    few = compressed(bench, full, bench.conditions[0].turn)
    return bench, full, few


def rows_of(bench: RunSet, full: EverySample) -> Array:
    """Influences of what is no waveform of the gear train, sample by sample."""
    model, waves = bench.plain
    forces = bench.conditions[0].forces(waves[0])[1]
    return np.concatenate([full.beyond(bench, model, named, forces, 0.0) for named in BEYOND])


@pytest.mark.parametrize(("travel", "uneven"), [(TURN, True), (3 * TURN, False), (math.radians(30), True)])
def test_few_numbers_say_what_the_samples_say_of_any_waveform(travel: float, uneven: bool) -> None:
    bench, full, few = seen(3, travel=travel, uneven=uneven)
    grid, beyond = bench.conditions[0].turn, rows_of(bench, full)
    assert few.grid == grid
    assert few.width == grid.points + len(beyond) + 1
    readout = full.readout(grid, 0.0)
    at_once = np.concatenate([few.beyond(bench, bench.plain[0], named, None, 0.0) for named in BEYOND])

    @given(st.integers(0, 2**20), st.floats(0, 30), st.booleans())
    @settings(max_examples=25, deadline=None)
    def same(seed: int, size: float, near: bool) -> None:
        rng = np.random.default_rng(seed)
        order = rng.integers(1, 20, 4)
        wave = size * ARCSEC * (rng.normal(size=8) @ np.concatenate([np.cos(np.outer(order, grid.theta)),
                                                                     np.sin(np.outer(order, grid.theta))]))  # fmt: skip
        wave += 0.0 if near else rng.normal(size=grid.points) * ARCSEC
        sizes = rng.normal(size=len(beyond)) * np.array([3, 3, 2, 1e5, 1e5][: len(beyond)]) * ARCSEC
        by_samples = full.whiten((full.measured - readout(wave[None])[0] - sizes @ beyond)[None])
        by_few = few.whiten(few.of_grid(grid, wave[None], 0.0) + sizes @ at_once - few.measured)
        expected = float(by_samples[0] @ by_samples[0])
        assert float(by_few[0] @ by_few[0]) == pytest.approx(expected, rel=1e-5, abs=1e-3)

    same()


def test_products_of_rows_are_those_of_the_samples() -> None:
    bench, full, few = seen(5)
    grid = bench.conditions[0].turn
    rows = np.stack([np.cos(7 * grid.theta), np.sin(7 * grid.theta), np.ones(grid.points)])
    white, alike = full.whiten(full.of_grid(grid, rows, 0.0)), few.whiten(few.of_grid(grid, rows, 0.0))
    scale = float(np.max(white @ white.T))
    assert alike @ alike.T == pytest.approx(white @ white.T, abs=1e-6 * scale)
    measured = few.whiten(few.measured[None])[0]
    assert alike @ measured == pytest.approx(white @ full.whiten(full.measured[None])[0], abs=1e-6 * scale * ARCSEC)
    # an offset is free in this run: nothing is seen of it
    assert few.whiten(few.constant[None]) == pytest.approx(0, abs=1e-3 * math.sqrt(scale))


@pytest.mark.parametrize("offset", [0.0, 0.37])
def test_a_waveform_of_one_turn_of_the_crank_is_turned_onto_the_grid(offset: float) -> None:
    """Also where the marks stand elsewhere: then it is read that much further on."""
    bench, full, few = seen(7, points=512)
    repeat = bench.conditions[0].repeat(UNIT)
    assert repeat.points * repeat.step == pytest.approx(TURN / 16)
    error = 5 * ARCSEC * np.cos(16 * repeat.theta) + ARCSEC * np.sin(64 * repeat.theta)
    wave = _wave(repeat, error)
    angle = few.grid.theta + offset
    expected = 5 * ARCSEC * np.cos(16 * angle) + ARCSEC * np.sin(64 * angle)
    scale = np.abs(few.root).max() * ARCSEC
    seen_wave = few.of_wave(wave, error[None], offset)
    assert seen_wave == pytest.approx(few.of_grid(few.grid, expected[None], 0.0), abs=1e-5 * scale)
    slope = -80 * ARCSEC * np.sin(16 * angle) + 64 * ARCSEC * np.cos(64 * angle)
    by_slope = few.of_grid(few.grid, slope[None], 0.0)[0]
    assert few.change(wave, offset) == pytest.approx(by_slope, abs=1e-4 * scale)
    angle = full.record.theta + offset
    expected = -80 * ARCSEC * np.sin(16 * angle) + 64 * ARCSEC * np.cos(64 * angle)
    assert full.change(wave, offset) == pytest.approx(expected, abs=1e-3 * ARCSEC)


def _wave(grid: AngleGrid, error: Array) -> Waveform:
    return Waveform(grid, error, np.zeros((0, grid.points)), np.zeros((9, grid.points)), (), UNIT)


def test_a_fit_to_few_numbers_is_the_fit_to_the_samples() -> None:
    """Objective, gradient, curvature and sizes, stiffness free: nearly, as the mesh has orders above any grid's."""
    model = rverror.Model(UNIT, (rverror.effect("crank.eccentricity", crank=0, disc=0, radial="1 um"),))
    bench, _, _ = seen(9, points=2048, n=5000, memory=0.3)
    declared = rverror.Model(UNIT)
    few, full = evaluated(bench, model, declared), evaluated(replace(bench, few=()), model, declared)
    assert few.data == pytest.approx(full.data, rel=1e-4)
    scale = np.sqrt(np.diag(full.gram) + np.where(np.isfinite(full.weights), full.weights, 0.0))
    assert few.gram / np.outer(scale, scale) == pytest.approx(full.gram / np.outer(scale, scale), abs=0.03)
    assert few.moment / scale == pytest.approx(full.moment / scale, abs=0.03 * math.sqrt(full.data))
    after, same = fitted(few), fitted(full)
    assert after.objective == pytest.approx(same.objective, abs=0.5)
    assert after.model.effects[0].values == pytest.approx(
        same.model.effects[0].values, abs=0.1 * math.sqrt(full.covariance[0, 0])
    )


@pytest.mark.parametrize("points", [96, 128])
def test_a_sun_s_waves_are_seen_though_the_angles_of_the_gears_are_too_few_for_them(points: int) -> None:
    """Order 96: two or fewer angles a wave say nothing of it, the samples all, whose noise alone is left."""
    sun = rverror.effect("involute.sun_pitch", harmonic=2, cos="6 um", sin="-4 um")
    bare, true = rverror.Model(UNIT), rverror.Model(UNIT, (sun,))
    records, _ = records_of(bare, runs_of(true, ((1.0, 50e3),)), POLICY)
    noise = RunNoise(np.array([0.7]), 0.3 * ARCSEC * math.sqrt(1 - 0.7**2))
    bench = RunSet.of(UNIT, [replace(r, noise=noise) for r in records], POLICY, points=points, anywhere=False)
    few = replace(bench, few=((sun.key, dict(sun.indices)),))
    fit, without = evaluated(few, true, bare), evaluated(few, bare, bare)
    assert fit.data < few.freedom + 5 * math.sqrt(2 * few.freedom)
    assert without.data > 50 * fit.data
    # the change that a fit reckons with is the whole of it: it is linear
    moment, gram = fit.moment[:2], fit.gram[:2, :2]
    assert np.abs(np.linalg.solve(gram, moment)).max() < 0.2e-3
    assert fit.data + 2 * moment @ sun.values + np.array(sun.values) @ gram @ sun.values == pytest.approx(
        without.data, rel=1e-3
    )


def test_only_a_sun_is_added_by_its_influence_and_only_where_it_must() -> None:
    """Where runs are compressed, or where its turns do not close with the output's."""
    odd = replace(UNIT, sun_teeth=10, module=54 / 37, crank_circle_radius=None)
    for unit, few, apart in ((UNIT, (), False), (UNIT, BEYOND, True), (odd, (), True), (odd, BEYOND, True)):
        bench = replace(RunSet.of(unit, [record_of(np.zeros(64))], POLICY, points=64, anywhere=False), few=few)
        assert bench.apart("involute.sun_pitch") is apart
        effects = (
            rverror.effect("involute.sun_pitch", harmonic=2, cos="6 um"),
            rverror.effect("crank.eccentricity", crank=0, disc=0, radial="1 um"),
            rverror.effect("sensor.encoder_eccentricity", cos="1 arcsec"),
        )
        assert bench.around(rverror.Model(unit, effects)) == (effects[1:2] if apart else effects[:2])
        assert not any(bench.apart(effect.key) for effect in effects[1:])
