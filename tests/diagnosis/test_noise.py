"""Noise of one run, and what is left of its samples once they are white: against dense generalised least squares."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from gear_runs import red
from rverror.base.arrays import Array
from rverror.base.units import ARCSEC
from rverror.diagnosis.noise import Whitening, averaged, burg, noise_of, walking
from rverror.runs.noise import RunNoise

FLOOR = 1e-3 * ARCSEC


def covariance(noise: RunNoise, n: int) -> Array:
    """Of so many samples on end, by the correlation of the autoregressive model summed over its impulse response."""
    response = lfilter([noise.sigma], np.concatenate([[1.0], -noise.coefficients]), np.eye(1, 4000)[0])
    return np.asarray(toeplitz([response[: 4000 - lag] @ response[lag:] for lag in range(n)]))


def least_squares(rows: Array, values: Array, spread: Array) -> tuple[Array, Array, float]:
    """Sizes, their covariance and the squares that are left, written out."""
    inverse = np.linalg.inv(spread)
    gram = rows @ inverse @ rows.T
    sizes = np.linalg.solve(gram, rows @ inverse @ values)
    rest = values - sizes @ rows
    return sizes, np.linalg.inv(gram), float(rest @ inverse @ rest)


@given(
    st.integers(0, 2**16),
    st.lists(st.floats(-0.8, 0.8), min_size=0, max_size=3),
    st.sets(st.integers(8, 56), max_size=6),
    st.booleans(),
)
@settings(max_examples=40, deadline=None)
def test_whitened_rows_are_generalised_least_squares(
    seed: int, reflections: list[float], dropped: set[int], offset: bool
) -> None:
    """Given its first samples a series is its innovations; one that is set aside is a row and column that is gone."""
    n, rng = 60, np.random.default_rng(seed)
    coefficients = np.zeros(0)
    for one in reflections:  # Levinson's recursion keeps the model stable
        coefficients = np.append(coefficients - one * coefficients[::-1], one)
    noise, lags = RunNoise(coefficients, 0.7), coefficients.size
    kept = np.ones(n, dtype=np.bool_)
    kept[list(dropped)] = False
    nuisance = np.ones((1, n)) if offset else np.zeros((0, n))
    values, rows = rng.normal(size=n), rng.normal(size=(2, n))
    white = Whitening(noise, kept, (0,), nuisance)(np.concatenate([values[None], rows]))
    sizes = np.linalg.solve(white[1:] @ white[1:].T, white[1:] @ white[0])
    # conditional on the first samples: their covariance and what they foretell are taken off the others'
    whole = covariance(noise, n)
    first, then = np.arange(lags), np.flatnonzero(kept & (np.arange(n) >= lags))
    told = whole[np.ix_(then, first)] @ np.linalg.inv(whole[np.ix_(first, first)])
    spread = whole[np.ix_(then, then)] - told @ whole[np.ix_(first, then)]
    every = np.concatenate([rows, nuisance])
    expected, variance, squares = least_squares(
        every[:, then] - every[:, first] @ told.T, values[then] - told @ values[first], spread
    )
    assert sizes == pytest.approx(expected[:2], rel=1e-6, abs=1e-9)
    assert np.linalg.inv(white[1:] @ white[1:].T) == pytest.approx(variance[:2, :2], rel=1e-6, abs=1e-9)
    rest = white[0] - sizes @ white[1:]
    assert float(rest @ rest) == pytest.approx(squares, rel=1e-6, abs=1e-9)


def test_what_is_doubtful_is_as_noise_of_its_own_covariance() -> None:
    """Generalised least squares under the noise's covariance and that of the doubts, one set aside, an offset free."""
    n, rng, sigma = 40, np.random.default_rng(3), 0.7
    doubtful, rows, values = 4 * rng.normal(size=(3, n)), rng.normal(size=(2, n)), rng.normal(size=n)
    kept = np.arange(n) != 7
    whitening = Whitening(RunNoise(np.zeros(0), sigma), kept, (0,), np.ones((1, n)), doubtful)
    white = whitening(np.concatenate([values[None], rows]))
    spread = sigma**2 * np.eye(n - 1) + doubtful[:, kept].T @ doubtful[:, kept]
    every = np.concatenate([rows, np.ones((1, n))])[:, kept]
    expected, variance, squares = least_squares(every, values[kept], spread)
    sizes = np.linalg.solve(white[1:] @ white[1:].T, white[1:] @ white[0])
    assert sizes == pytest.approx(expected[:2], rel=1e-9)
    assert np.linalg.inv(white[1:] @ white[1:].T) == pytest.approx(variance[:2, :2], rel=1e-9)
    assert float(np.sum((white[0] - sizes @ white[1:]) ** 2)) == pytest.approx(squares, rel=1e-9)


def test_a_wave_that_jumps_where_contacts_change_sides_is_no_noise() -> None:
    """One of 5 arcsec beside noise of 0.3: its phase is another on either side, so that the whole run has no line."""
    n, rng = 2048, np.random.default_rng(5)
    angle, side = 40 * 2 * np.pi * np.arange(n) / n, (np.arange(n) > 500) & (np.arange(n) < 1524)
    values = 0.3 * rng.normal(size=n) + 5 * np.cos(angle + np.where(side, 2.0, 0.0))
    kept = np.min(np.abs(np.arange(n)[:, None] - [500, 1524]), axis=1) > 16
    parts = [slice(0, 484), slice(517, 1508), slice(1541, n)]
    assert noise_of(values, kept, 1.0, floor=FLOOR, parts=parts).rms == pytest.approx(0.3, rel=0.1)
    assert noise_of(values, kept, 1.0, floor=FLOOR).rms > 0.6


def test_a_series_begins_anew_after_a_gap() -> None:
    """Both parts by themselves: no sample of the first foretells one of the second."""
    noise, rng = RunNoise(np.array([0.8]), 1.0), np.random.default_rng(1)
    values = rng.normal(size=(1, 50))
    kept, none = np.ones(50, dtype=np.bool_), np.zeros((0, 50))
    white = Whitening(noise, kept, (0, 20), none)
    parts = [values[:, a:b] for a, b in ((0, 20), (20, 50))]
    apart = [Whitening(noise, np.ones(p.shape[1], dtype=np.bool_), (0,), none[:, : p.shape[1]])(p) for p in parts]
    assert white(values) == pytest.approx(np.concatenate(apart, axis=1))
    assert white.freedom == white(values).shape[1] == 48
    assert list(white.usable[18:20]) == [19, 21]
    assert white.filtered(values)[0, 0] == values[0, 1] - 0.8 * values[0, 0]


@pytest.mark.parametrize(("n", "lags"), [(2000, 32), (513, 1), (40, 7), (33, 32), (20, 0)])
def test_a_run_is_whitened_by_convolution(n: int, lags: int) -> None:
    rng = np.random.default_rng(n)
    noise, rows = RunNoise(rng.normal(size=lags), 0.7), rng.normal(size=(3, n))
    white = Whitening(noise, np.ones(n, dtype=np.bool_), (0,), np.zeros((0, n)))
    same = [np.convolve(row, noise.filter)[lags:n] for row in rows]
    assert white.filtered(rows) == pytest.approx(np.array(same), abs=1e-12)
    assert white.filtered(rows[:, ::-1]) == pytest.approx(
        np.array([np.convolve(r[::-1], noise.filter)[lags:n] for r in rows])
    )


def test_nothing_is_left_of_what_may_have_any_size() -> None:
    noise, n = RunNoise(np.array([0.5, 0.2]), 0.3), 200
    nuisance = np.stack([np.ones(n), np.cos(np.arange(n) / 9)])
    white = Whitening(noise, np.ones(n, dtype=np.bool_), (0,), nuisance)
    assert white(np.array([[3.0, -2.0]]) @ nuisance) == pytest.approx(0, abs=1e-9)
    assert white(np.zeros((0, n))).shape == (0, n - 2)


FREQUENCIES = np.array([0.1, 0.5, 1.5, 2.5])  # rad per sample


def told(memory: float, seed: int, *, lines: float = 0.0, every: int = 0) -> tuple[Array, float]:
    """Spectrum and rms that are found, over the true ones; every so manieth sample is set aside."""
    n = 4096
    theta = 2 * np.pi * np.arange(n) / n
    kept = np.ones(n, dtype=np.bool_)
    residual = red(seed, n, 0.3, memory) + lines * ARCSEC * (3 * np.cos(40 * theta) + np.cos(391.3 * theta + 1))
    if every:
        kept[::every] = False
        residual[::every] = 1.0  # a spike
    true = RunNoise(np.array([memory]), 0.3 * ARCSEC * np.sqrt(1 - memory**2))
    found = noise_of(residual, kept, 2.0, floor=FLOOR)
    return np.asarray(found.spectrum(FREQUENCIES) / true.spectrum(FREQUENCIES)), found.rms / true.rms


@pytest.mark.parametrize(("memory", "every"), [(0.0, 0), (0.7, 0), (0.95, 0), (0.0, 97), (0.7, 97)])
def test_the_colour_of_one_pass_is_found(memory: float, every: int) -> None:
    """One pass of n under a Hann window knows a spectrum of p lags to sqrt(4 p 35 / 18 n), a quarter."""
    shape, size = zip(*(told(memory, seed, every=every) for seed in range(20)), strict=True)
    assert np.mean(shape, axis=0) == pytest.approx(np.ones(4), abs=0.12)
    assert np.std(shape, axis=0).max() < 1.3 * np.sqrt(4 * 32 * 35 / 18 / 4096)
    assert np.mean(size) == pytest.approx(1, abs=0.03)


@pytest.mark.parametrize("memory", [0.0, 0.7, 0.95])
def test_lines_ten_times_the_noise_are_not_taken_for_it(memory: float) -> None:
    """Each fills five bins of a band, which are cut at eight medians: as noise the power would be a hundred times."""
    shape, size = zip(*(told(memory, seed, lines=1.0) for seed in range(12)), strict=True)
    assert np.all(np.mean(shape, axis=0) < 1.5)
    assert np.all(np.mean(shape, axis=0) > 0.9)
    assert np.mean(size) == pytest.approx(1, abs=0.15)


def test_a_slow_wave_in_half_a_turn_of_noise_is_taken_for_chance() -> None:
    """What its two sizes take off the squares of noise that is known has a mean of 2, and of 400 runs one of 0.1."""
    n = 940
    theta = np.pi * np.arange(n) / n
    kept, rows, taken = np.ones(n, dtype=np.bool_), np.stack([np.cos(theta), np.sin(theta)]), []
    for seed in range(400):
        noise = red(seed, n, 0.3, 0.9) + 0.4 * ARCSEC * np.random.default_rng([seed, 1]).normal(size=n)
        white = Whitening(noise_of(noise, kept, 3.0, floor=FLOOR, calm=True), kept, (0,), np.ones((1, n)))
        left, waves = white(noise[None])[0], white(rows)
        taken.append((waves @ left) @ np.linalg.solve(waves @ waves.T, waves @ left))
    assert np.mean(taken) == pytest.approx(2, abs=0.35)
    assert np.mean(np.array(taken) > 9.21) < 0.02  # one in a hundred by chi-square, 0.005 of standard deviation


@pytest.mark.parametrize(("step", "most", "calm"), [(0.05, 4, True), (1.0, 4, True), (0.05, 4, False)])
def test_order_1_of_a_random_walk_is_hardly_beyond_its_noise(step: float, most: float, calm: bool) -> None:
    """Of known noise it takes 2 off the squares; with bins cut beside their neighbours' median it took 80."""
    n = 2048
    theta = 2 * np.pi * np.arange(n) / n
    kept, rows, taken = np.ones(n, dtype=np.bool_), np.stack([np.cos(theta), np.sin(theta)]), []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        walk = (np.cumsum(rng.normal(0, step, n)) + rng.normal(0, 0.3, n)) * ARCSEC
        white = Whitening(noise_of(walk, kept, 1.0, floor=FLOOR, calm=calm), kept, (0,), np.ones((1, n)))
        left, waves = white(walk[None])[0], white(rows)
        taken.append((waves @ left) @ np.linalg.solve(waves @ waves.T, waves @ left))
    assert np.mean(taken) < most


def test_of_a_walk_beside_white_noise_its_steps_are_found() -> None:
    """Its spectrum is (step / frequency)^2 at low frequencies: beside white noise that of their ratio."""
    n, white, none, found = 4000, RunNoise(np.zeros(0), 0.3), [], []
    kept = np.ones(n, dtype=np.bool_)
    for seed in range(40):
        rng = np.random.default_rng(seed)
        noise = rng.normal(0, 0.3, n)
        none.append(walking(white, noise, kept).walk)
        found.append(walking(white, noise + np.cumsum(rng.normal(0, 0.015, n)), kept).walk)
    assert np.median(none) < np.pi / n  # by chance a wave or two are larger than others
    assert np.mean(found) == pytest.approx(0.05, rel=0.1)
    assert RunNoise(np.zeros(0), 0.3, 0.05).spectrum(np.array([0.05, 0.1])) == pytest.approx([0.18, 0.09 * 1.25])


def test_beside_a_walk_rows_are_whitened_by_its_covariance() -> None:
    """Of a walk whose waves count up to five times the one at which it is as large as the noise."""
    n, sigma, walk = 300, 0.4, 4 * np.pi / 300
    white = Whitening(RunNoise(np.zeros(0), sigma, walk), np.ones(n, dtype=np.bool_), (0,), np.zeros((0, n)))
    number = np.arange(1, 21)
    waves = np.sqrt(2 / n) * np.cos(np.pi / n * np.outer(number, np.arange(n) + 0.5))
    covariance = sigma**2 * (np.eye(n) + (waves.T * (4 / number) ** 2) @ waves)
    root = white(np.eye(n))  # of each sample alone
    assert root @ root.T == pytest.approx(np.linalg.inv(covariance), rel=1e-9, abs=1e-9)
    assert white.log_variance == pytest.approx(np.linalg.slogdet(covariance)[1], rel=1e-9)


def test_the_floor_is_white_noise_beside_what_remembers() -> None:
    """It adds to the variance, not to the correlation, so one lag of 0.8 becomes 0.8 / (1 + floor^2 / variance)."""
    n = 20000
    found = burg(red(5, n, 0.3, 0.8), 1, floor=0.6 * ARCSEC)[-1]
    assert found.coefficients == pytest.approx([0.8 / 5], abs=0.01)


@pytest.mark.parametrize("calm", [False, True])
def test_a_perfect_fit_is_no_certainty(calm: bool) -> None:
    found = noise_of(np.zeros(500), np.ones(500, dtype=np.bool_), 1.0, floor=FLOOR, calm=calm)
    assert found.rms == pytest.approx(FLOOR, rel=1e-6)


def test_what_was_fitted_is_not_counted_twice() -> None:
    """A residual of which a tenth was fitted away has the noise of the whole."""
    n, size = 1000, []
    basis = np.linalg.qr(np.random.default_rng(0).normal(size=(n, 100)))[0]
    for seed in range(10):
        white = np.random.default_rng(seed + 1).normal(size=n)
        left = white - basis @ (basis.T @ white)
        size.append(noise_of(left, np.ones(n, dtype=np.bool_), 100.0, floor=1e-6).rms)
    assert np.mean(size) == pytest.approx(1, abs=0.02)


@given(st.lists(st.floats(-0.6, 0.8), min_size=0, max_size=3), st.integers(1, 8))
@settings(max_examples=30, deadline=None)
def test_means_of_samples_have_the_covariance_that_follows_from_the_samples(roots: list[float], together: int) -> None:
    """That of samples, summed over all pairs of two means: of the first lags, which a filter of some lags can have."""
    noise = RunNoise(-np.poly(roots)[1:] if roots else np.zeros(0), 0.7)
    count = 5
    means = np.kron(np.eye(count), np.full((1, together), 1 / together))
    expected = means @ covariance(noise, count * together) @ means.T
    found = covariance(averaged(noise, together), count)
    assert found == pytest.approx(expected, abs=2e-3 * expected[0, 0])


def test_means_of_a_random_walk_wander_by_as_much() -> None:
    """Its waves turn by so many times the angle from one mean to the next."""
    noise = RunNoise(np.array([0.3]), 0.7, walk=0.02)
    slow = np.array([0.001, 0.003])
    assert averaged(noise, 4).spectrum(4 * slow) == pytest.approx(noise.spectrum(slow) / 4, rel=1e-2)
