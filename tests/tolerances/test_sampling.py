"""Very many virtual units: known distributions, intervals that hold, equal numbers everywhere, resumption."""

from __future__ import annotations

import importlib
import math
import multiprocessing
import shutil
import tracemalloc
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

import rverror
from rverror import InputError
from rverror.base.units import ARCSEC
from rverror.tolerances.declared import tolerance
from rverror.tolerances.distribution import Normal, Rayleigh, Uniform
from rverror.tolerances.sampling import IntervalEstimate, VirtualUnits, uniforms, virtual_units
from rverror.tolerances.sampling_rule import SamplingRule
from rverror.tolerances.stacking import Stack, stack

module = importlib.import_module("rverror.tolerances.sampling")  # the package has a function of this name
N = 32
THETA = 2 * np.pi * np.arange(N) / N


def made(influence: np.ndarray, *laws: Any) -> Stack:
    """A stack of scalar entries, or vectors of two components, one for each law; width 1."""
    rules: list[SamplingRule] = []
    row = variate = 0
    for law in laws:
        rule = SamplingRule(variate, row, 1, 2 if law.vector else 1, law)
        rules.append(rule)
        row, variate = rule.components.stop, rule.variates.stop
    return Stack(
        nominal=np.zeros(influence.shape[1]),
        influence=influence,
        components=(),
        entry=np.repeat(np.arange(len(laws)), [b.components.stop - b.components.start for b in rules]),
        width=np.ones(len(laws)),
        labels=tuple(f"entry {i}" for i in range(len(laws))),
        rules=tuple(rules),
    )


WAVE = ARCSEC * np.array([np.cos(2 * THETA), np.sin(2 * THETA)])
VECTOR = made(WAVE, Rayleigh())
SCALAR = made(WAVE[:1], Normal())


@pytest.fixture(scope="module")
def rv40e() -> Stack:
    """Some dozen variates, correlated discs, a nominal error."""
    nominal = rverror.Model(
        rverror.reducer("RV-40E"), (rverror.effect("crank.eccentricity", crank=0, disc=1, radial="2 um"),)
    )
    tolerances = (
        tolerance("crank.eccentricity", "4 um"),
        tolerance("cycloid.disc_pitch", "4 um", harmonic=1, correlation=0.6),
        tolerance("cycloid.pin_position", "5 um", parameters=["radial"], distribution="uniform"),
        tolerance("sensor.encoder_eccentricity", "8 arcsec", distribution="ring"),
    )
    return stack(nominal, tolerances, 2 * np.pi * np.arange(512) / 512)


def same(one: VirtualUnits, other: VirtualUnits) -> bool:
    """Bit for bit."""
    names = ("peak_to_peak", "max", "rms", "offset")
    return all(getattr(one, name).tobytes() == getattr(other, name).tobytes() for name in names)


# --- known distributions ----------------------------------------------------------------------------------------------


def test_rayleigh_vector_of_one_order() -> None:
    """Twice its amplitude from peak to peak: a Rayleigh variable, at every quantile."""
    units = virtual_units(VECTOR, 2**14)
    sigma = VECTOR.rules[0].distribution.sigma
    for probability in (0.01, 0.5, 0.95, 0.99):
        true = 2 * ARCSEC * sigma * math.sqrt(-2 * math.log(1 - probability))
        found = units.quantile(probability)
        assert found.low < true * 1.005  # the phase falls between angles: up to 1 - cos(2 pi / 32) = 2 % below
        assert true * 0.98 < found.high
        assert found.value == pytest.approx(true, rel=0.02)
    amplitude = units.rms * math.sqrt(2)
    assert (units.max <= amplitude * (1 + 1e-9)).all()
    assert (units.max >= amplitude * math.cos(2 * math.pi / N)).all()
    np.testing.assert_allclose(units.offset, 0, atol=1e-15)


def test_normal_wave_has_a_half_normal_peak_to_peak() -> None:
    units = virtual_units(SCALAR, 2**14)
    for probability in (0.5, 0.95, 0.99):
        true = half_normal(probability)
        found = units.quantile(probability)
        assert found.low <= true <= found.high
        assert found.value == pytest.approx(true, rel=6e-3)
        share = units.yield_at(true)
        assert share.low <= probability <= share.high
        assert share.value == pytest.approx(probability, abs=2e-3)


def test_sizes_follow_their_definitions(rv40e: Stack) -> None:
    units = virtual_units(rv40e, 300)
    te = []
    chunk = module.chunk_length(300)
    for index in range(-(-units.count // chunk)):
        for block in uniforms(chunk, rv40e.dimensions, seed=0, index=index):
            te.append(rv40e.nominal + (rv40e.standard(block) * rv40e.width[rv40e.entry]) @ rv40e.influence)
    drawn = np.concatenate(te)[:300]
    away = drawn - drawn.mean(axis=1, keepdims=True)
    accuracy = {"rtol": 0, "atol": 1e-8 * ARCSEC}
    np.testing.assert_allclose(units.peak_to_peak, np.ptp(drawn, axis=1), **accuracy)
    np.testing.assert_allclose(units.max, np.abs(away).max(axis=1), **accuracy)
    np.testing.assert_allclose(units.rms, np.sqrt((away**2).mean(axis=1)), **accuracy)
    np.testing.assert_allclose(units.offset, drawn.mean(axis=1), **accuracy)


def test_quasi_random_quantiles_against_ten_times_as_many_plain_ones(rv40e: Stack) -> None:
    quasi = virtual_units(rv40e, 4096)
    drawn = np.concatenate(list(uniforms(40960, rv40e.dimensions, seed=1, index=0, plain=True)))
    sizes = module.sampler(rv40e).sizes(drawn)
    plain = VirtualUnits(sizes.peak_to_peak, sizes.max, sizes.rms, sizes.offset, 1, 0)
    for size in ("peak_to_peak", "max", "rms"):
        for probability in (0.5, 0.95, 0.99):
            one, other = quasi.quantile(probability, size), plain.quantile(probability, size)
            assert abs(one.value - other.value) < max(one.high - one.value, one.value - one.low) + max(
                other.high - other.value, other.value - other.low
            )
            assert one.low <= other.high
            assert other.low <= one.high
    limit = plain.quantile(0.9).value
    assert quasi.yield_at(limit).low <= 0.9 <= quasi.yield_at(limit).high


# --- intervals --------------------------------------------------------------------------------------------------------


def half_normal(probability: float) -> float:
    """Quantile of the peak-to-peak of `SCALAR`."""
    return float(2 * ARCSEC / 3 * stats.norm.ppf((1 + probability) / 2))


def sum_of_six(probability: float) -> float:
    """Quantile of the peak-to-peak of six equal waves of uniform sizes, whose sum has a density by convolution."""
    flat = np.full(2001, 1 / 2001)
    density = flat
    for _ in range(5):
        density = np.convolve(density, flat)
    size = np.abs(np.linspace(-6, 6, density.size))
    order = np.argsort(size)
    return float(2 * ARCSEC * np.interp(probability, np.cumsum(density[order]), size[order]))


SIX = made(ARCSEC * np.array([np.cos(THETA)] * 6), *[Uniform()] * 6)


@pytest.mark.parametrize(("given", "quantile"), [(SCALAR, half_normal), (SIX, sum_of_six)])
def test_intervals_cover(given: Stack, quantile: Callable[[float], float]) -> None:
    """Of 60 runs each at 90 %: at least 46, which a true coverage of 90 % misses once in 1000."""
    runs = [virtual_units(given, 512, seed=seed) for seed in range(60)]
    for probability in (0.5, 0.95):
        true = quantile(probability)
        found = [run.quantile(probability, confidence=0.9) for run in runs]
        assert sum(e.low <= true <= e.high for e in found) >= 46
        shares = [run.yield_at(true, confidence=0.9) for run in runs]
        assert sum(e.low <= probability <= e.high for e in shares) >= 46
    assert len({run.quantile(0.5).value for run in runs}) == 60


def units_of(sizes: np.ndarray) -> VirtualUnits:
    return VirtualUnits(sizes, sizes, sizes, sizes, 0, 0)


@pytest.mark.parametrize("count", [10, 60, 367, 368, 2000])
@pytest.mark.parametrize("probability", [0.05, 0.5, 0.99])
def test_counted_interval_by_its_definition(count: int, probability: float) -> None:
    """Order statistics by a search through the binomial distribution; the sizes are their own ranks."""
    ranks = np.random.default_rng(0).permutation(count) + 1.0
    found = units_of(ranks).quantile(probability)
    below = stats.binom.cdf(np.arange(count + 1), count, probability)  # of k or fewer units below the quantile
    lower = [rank for rank in range(1, count + 1) if below[rank - 1] <= 0.025]
    upper = [rank for rank in range(1, count + 1) if 1 - below[rank - 1] <= 0.025]
    assert found.low == (max(lower) if lower else 0.0)
    assert found.high == (min(upper) if upper else math.inf)


@pytest.mark.parametrize(("good", "count"), [(0, 50), (50, 50), (37, 50), (990, 1000)])
def test_yield_is_that_of_clopper_and_pearson(good: int, count: int) -> None:
    found = units_of(np.arange(count) + 1.0).yield_at(good)
    assert found.value == good / count
    if good:
        assert stats.binom.sf(good - 1, count, found.low) == pytest.approx(0.025)
    if good < count:
        assert stats.binom.cdf(good, count, found.high) == pytest.approx(0.025)
    assert (found.low == 0, found.high == 1) == (good == 0, good == count)


@pytest.mark.parametrize("probability", [0.0, 1.0, -1.0, math.nan])
def test_shares_are_checked(probability: float) -> None:
    units = units_of(np.arange(5.0))
    for call in (
        lambda: units.quantile(probability),
        lambda: units.quantile(0.5, confidence=probability),
        lambda: units.yield_at(1.0, confidence=probability),
    ):
        with pytest.raises(InputError, match="must lie between 0 and 1"):
            call()


# --- draws ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("dimensions", [1, 5, 300])
def test_a_chunk_fills_every_stratum_once(dimensions: int) -> None:
    """2**k points of a scrambled Sobol sequence: one in each interval of 2**-k, in every dimension."""
    points = np.concatenate(list(uniforms(4096, dimensions, seed=5, index=3)))
    cells = np.sort((points * 4096).astype(int), axis=0)
    np.testing.assert_array_equal(cells, np.repeat(np.arange(4096)[:, None], dimensions, axis=1))
    assert (points * 2**31 % 2 == 1).all()  # in the middle of cells of 2**-30: never 0 or 1
    assert 0 < points.min() < points.max() < 1


def test_chunks_are_seeded_by_their_index_alone() -> None:
    def drawn(seed: int, index: int, plain: bool) -> bytes:
        return b"".join(block.tobytes() for block in uniforms(100, 3, seed=seed, index=index, plain=plain))

    for plain in (False, True):
        assert drawn(1, 2, plain) == drawn(1, 2, plain)
        assert len({drawn(seed, index, plain) for seed in range(3) for index in range(3)}) == 9


def test_plain_random_units_are_no_sobol_points() -> None:
    points = np.concatenate(list(uniforms(4096, 2, seed=0, index=0, plain=True)))
    assert len(np.unique((points[:, 0] * 4096).astype(int))) < 3000
    assert stats.kstest(points[:, 1], "uniform").pvalue > 1e-3


def test_more_variates_than_sobol_sequences_have() -> None:
    many = made(np.zeros((21202, 2)), *[Uniform()] * 2)
    wide = replace(many, rules=(SamplingRule(0, 0, 21202, 1, Uniform()),), entry=np.zeros(21202, dtype=int))
    assert virtual_units(wide, 10).count == 10


# --- equal numbers everywhere -----------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def alone(rv40e: Stack) -> VirtualUnits:
    return virtual_units(rv40e, 1100, seed=7)


@pytest.fixture(scope="module")
def processes() -> Iterator[Executor]:
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        yield pool


def test_one_and_two_threads(rv40e: Stack, alone: VirtualUnits) -> None:
    for workers in (1, 2):
        with ThreadPoolExecutor(workers) as pool:
            assert same(virtual_units(rv40e, 1100, seed=7, executor=pool), alone)
    assert alone.count == 1100
    assert not same(virtual_units(rv40e, 1100, seed=8), alone)


def test_two_processes_and_what_an_interrupted_job_left(
    rv40e: Stack, alone: VirtualUnits, processes: Executor, tmp_path: Path
) -> None:
    whole = tmp_path / "whole"
    assert same(virtual_units(rv40e, 1100, seed=7, executor=processes, folder=whole), alone)
    files = sorted(path.name for path in whole.iterdir())
    assert [name[-10:] for name in files] == [f"{i:06d}.npy" for i in range(18)]
    for name in files[::2]:
        (whole / name).unlink()
    again = virtual_units(rv40e, 1100, seed=7, folder=whole)
    assert same(again, alone)
    assert again.kept == 9


def test_interruption_and_resumption(rv40e: Stack, alone: VirtualUnits, tmp_path: Path) -> None:
    told: list[str] = []

    def stop(line: str) -> None:
        told.append(line)
        if len(told) == 5:
            raise KeyboardInterrupt

    with ThreadPoolExecutor(1) as pool, pytest.raises(KeyboardInterrupt):
        virtual_units(rv40e, 1100, seed=7, executor=pool, folder=tmp_path, progress=stop)
    left = len(list(tmp_path.iterdir()))
    assert 0 < left <= 5
    resumed = virtual_units(rv40e, 1100, seed=7, folder=tmp_path)
    assert resumed.kept == left
    assert same(resumed, alone)
    third = virtual_units(rv40e, 1100, seed=7, folder=tmp_path)
    assert third.kept == 18
    assert same(third, alone)


def test_lost_workers_are_one_line(rv40e: Stack) -> None:
    class Broken(ThreadPoolExecutor):
        def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
            raise BrokenProcessPool("a process ended abruptly")

    with Broken() as pool, pytest.raises(InputError, match=r"the workers were lost .*abruptly.*start again"):
        virtual_units(rv40e, 100, executor=pool)


# --- the folder -------------------------------------------------------------------------------------------------------


@pytest.fixture
def done(tmp_path: Path) -> tuple[Path, VirtualUnits]:
    folder = tmp_path / "units"
    return folder, virtual_units(VECTOR, 200, folder=folder)


@pytest.mark.parametrize("left", [0, 1, 100, -1])
def test_half_of_a_file_does_not_count(done: tuple[Path, VirtualUnits], left: int) -> None:
    folder, units = done
    path = sorted(folder.iterdir())[3]
    path.write_bytes(path.read_bytes()[:left])
    again = virtual_units(VECTOR, 200, folder=folder)
    assert same(again, units)
    assert again.kept == 200 // 16  # all but one of 13


CHANGED = {
    "seed": ({"seed": 1}, VECTOR),
    "count": ({"count": 199}, VECTOR),
    "width": ({}, replace(VECTOR, width=np.array([1.1]))),
    "waveforms": ({}, replace(VECTOR, influence=1.1 * VECTOR.influence)),
    "nominal": ({}, replace(VECTOR, nominal=VECTOR.influence[0])),
    "distribution": ({}, replace(VECTOR, rules=(replace(VECTOR.rules[0], distribution=Rayleigh(1.33)),))),
    "phase": ({}, replace(VECTOR, rules=(replace(VECTOR.rules[0], random_phase=True),))),
}


@pytest.mark.parametrize("changed", CHANGED)
def test_chunks_of_other_jobs_do_not_count(done: tuple[Path, VirtualUnits], changed: str) -> None:
    folder, units = done
    settings, other = CHANGED[changed]
    assert virtual_units(other, **{"count": 200, "folder": folder, **settings}).kept == 0
    assert same(virtual_units(VECTOR, 200, folder=folder), units)


def test_chunks_of_another_version_do_not_count(done: tuple[Path, VirtualUnits], monkeypatch: Any) -> None:
    monkeypatch.setattr(module, "__version__", "99.0")
    assert virtual_units(VECTOR, 200, folder=done[0]).kept == 0


def test_labels_and_places_make_no_other_job(done: tuple[Path, VirtualUnits], tmp_path: Path) -> None:
    folder, units = done
    moved = tmp_path / "moved"
    shutil.move(folder, moved)
    again = virtual_units(replace(VECTOR, labels=("renamed",)), 200, folder=moved)
    assert again.kept == 13
    assert same(again, units)


def test_a_file_is_no_folder(tmp_path: Path) -> None:
    path = tmp_path / "file"
    path.write_text("")
    with pytest.raises(InputError, match="cannot use the folder"):
        virtual_units(VECTOR, 200, folder=path)


# --- the rest ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"count": 0}, "count = 0: no unit"),
        ({"seed": -1}, "seed = -1: must be 0 or more"),
    ],
)
def test_settings_are_checked(settings: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        virtual_units(VECTOR, **{"count": 10, **settings})


@pytest.mark.parametrize("count", [1, 15, 16, 17, 191, 192, 100_000, 10**6, 10**8])
def test_chunks(count: int) -> None:
    """Powers of two, twelve or more where there are units for it, none longer than 2**14."""
    chunk = module.chunk_length(count)
    assert chunk & (chunk - 1) == 0
    assert 16 <= chunk <= 2**14
    assert count < 192 or count / chunk >= 12
    assert chunk == 2**14 or count / chunk < 24


@pytest.mark.parametrize("count", [1, 5, 16, 33])
def test_few_units(count: int) -> None:
    units = virtual_units(VECTOR, count)
    assert units.count == units.max.size == count
    assert (units.peak_to_peak > 0).all()
    assert isinstance(units.quantile(0.5), IntervalEstimate)


def test_memory_is_that_of_a_block() -> None:
    """20,000 units of 4096 angles would be 650 MB."""
    theta = 2 * np.pi * np.arange(4096) / 4096
    wide = made(ARCSEC * np.array([np.cos(k * theta) for k in (1, 2, 40, 78)]), *[Normal()] * 4)
    virtual_units(wide, 16)
    tracemalloc.start()
    try:
        virtual_units(wide, 20_000)
        folded = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert folded < 20e6
