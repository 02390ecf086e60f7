"""Periods, harmonics, noise and the frames of an order, against known signals and known noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

import rverror
from rverror.runs.spectrum import (
    frames_of_order,
    harmonics,
    highest_order,
    noise_spectrum,
    revolutions,
)

TURN = 2 * math.pi


def even(points: int, count: float, *, start: float = 0.0, turns: int = 1) -> np.ndarray:
    """Angles of `count` periods on an even grid."""
    return start + turns * TURN / points * np.arange(round(points * count))


def wave(theta: np.ndarray) -> np.ndarray:
    return 3 * np.cos(theta) + np.sin(5 * theta + 0.4) + 2.0


# --- periods ------------------------------------------------------------------------------------------------------


@given(
    points=st.integers(16, 300),
    count=st.integers(2, 5),
    over=st.floats(0, 0.95),
    start=st.floats(-20, 20),
    turns=st.integers(1, 4),
    seed=st.integers(0, 99),
)
def test_an_even_grid_is_only_reshaped(
    points: int, count: int, over: float, start: float, turns: int, seed: int
) -> None:
    theta = even(points, count + math.floor(over * points) / points, start=start, turns=turns)
    values = np.random.default_rng(seed).normal(size=theta.size)
    grid, periods_found = revolutions(theta, values, turns=turns)
    assert periods_found.shape == (count, points)
    np.testing.assert_array_equal(periods_found.ravel(), values[: count * points])
    np.testing.assert_allclose(grid, theta[:points], rtol=0, atol=1e-9)


@given(points=st.integers(16, 100), count=st.integers(2, 4), start=st.floats(-9, 9))
def test_a_reverse_run_is_read_in_growing_angles(points: int, count: int, start: float) -> None:
    theta = even(points, count, start=start)
    values = np.arange(theta.size, dtype=float)
    grid, periods_found = revolutions(theta[::-1], values[::-1])
    np.testing.assert_array_equal(periods_found.ravel(), values)
    assert (np.diff(grid) > 0).all()


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("start", [0.0, 1.234, -17.0])
@pytest.mark.parametrize("count", [2, 3])
def test_uneven_samples_are_interpolated(start: float, count: int, direction: int) -> None:
    rng = np.random.default_rng(4)
    theta = start + count * TURN * 1.01 * np.sort(rng.uniform(0, 1, 4000 * count))
    theta[0] = start
    grid, periods_found = revolutions(theta[::direction], wave(theta)[::direction])
    assert len(periods_found) == count
    np.testing.assert_allclose(np.diff(grid), TURN / grid.size, rtol=1e-9)
    # linear interpolation over the widest gap h: h^2 / 8 times the largest curvature, 3 + 25
    gap = np.diff(theta).max()
    np.testing.assert_allclose(periods_found, np.tile(wave(grid), (count, 1)), rtol=0, atol=gap**2 / 8 * 28)


def test_a_period_of_several_turns() -> None:
    """A third of an order repeats after three turns only."""
    theta = even(300, 2.4, turns=3)
    signal = np.cos(theta / 3)
    _, periods_found = revolutions(theta, signal, turns=3)
    assert periods_found.shape == (2, 300)
    np.testing.assert_allclose(periods_found[0], periods_found[1], rtol=0, atol=1e-9)
    assert abs(harmonics(periods_found))[0, 0] == pytest.approx(1)


@given(over=st.integers(0, 150))
def test_left_over_samples_are_left_out(over: int) -> None:
    theta = even(200, 2)
    theta = np.concatenate([theta, theta[-1] + TURN / 200 * np.arange(1, over + 1)])
    np.testing.assert_array_equal(revolutions(theta, theta)[1].ravel(), theta[:400])
    bent = theta + 1e-3 * np.sin(7 * theta)  # uneven by a 30th of a step, so interpolated
    grid, periods_found = revolutions(bent, wave(bent))
    assert periods_found.shape[0] == 2
    np.testing.assert_allclose(periods_found[0], wave(grid), rtol=0, atol=1e-2)


@pytest.mark.parametrize("turns", [1, 3])
@pytest.mark.parametrize("covered", [0.3, 1.0, 1.5, 1.98])
@pytest.mark.parametrize("uneven", [False, True])
def test_fewer_than_two_periods_are_none(covered: float, turns: int, uneven: bool) -> None:
    theta = even(500, covered, turns=turns)
    if uneven:
        theta = theta + 1e-3 * np.sin(3 * theta)
    assert revolutions(theta, np.zeros(theta.size), turns=turns) is None


@pytest.mark.parametrize("turns", [1, 3])
@pytest.mark.parametrize("count", [2, 3])
@pytest.mark.parametrize("short", [0.6, 1.0, 1.001, 1.2, 1.45])
def test_uneven_runs_that_end_with_the_last_period(short: float, count: int, turns: int) -> None:
    """The last of uneven samples lies about one step before the end: whole periods must not hang on its jitter."""
    step = turns * TURN / 400
    theta = np.linspace(0, count * turns * TURN - short * step, 400 * count)
    theta[1:-1] += 0.2 * step * np.sin(np.arange(400 * count - 2))
    grid, periods_found = revolutions(theta, wave(theta), turns=turns)
    assert len(periods_found) == count
    expected = np.tile(wave(grid), (count, 1)).ravel()
    found = periods_found.ravel()
    # linear interpolation within, at most half a step (slope 8 or less) beyond the last sample
    np.testing.assert_allclose(found[:-1], expected[:-1], rtol=0, atol=28 / 8 * (1.5 * step) ** 2)
    assert abs(found[-1] - expected[-1]) < 8 * 0.5 * step


def test_angles_that_repeat_do_no_harm() -> None:
    """A standstill between samples."""
    theta = np.sort(np.concatenate([even(400, 2.2), even(400, 2.2)[::7]]))
    grid, periods_found = revolutions(theta, wave(theta))
    np.testing.assert_allclose(periods_found, np.tile(wave(grid), (2, 1)), rtol=0, atol=1e-2)


# --- harmonics ----------------------------------------------------------------------------------------------------


@given(n=st.integers(3, 200), rows=st.integers(1, 4), seed=st.integers(0, 99))
def test_harmonics_hold_the_variance(n: int, rows: int, seed: int) -> None:
    """Parseval: all of it at odd n; at even n all but the Nyquist line, which is taken out here by hand."""
    values = np.random.default_rng(seed).normal(size=(rows, n))
    if n % 2 == 0:
        alternating = np.where(np.arange(n) % 2, -1.0, 1.0)
        values -= (values @ alternating)[:, None] / n * alternating
    found = harmonics(values)
    assert found.shape == (rows, (n - 1) // 2)
    np.testing.assert_allclose((abs(found) ** 2).sum(axis=1) / 2, values.var(axis=1), rtol=1e-9, atol=1e-15)


@given(n=st.integers(8, 100), seed=st.integers(0, 99))
def test_harmonics_keep_angles_between_signals(n: int, seed: int) -> None:
    """Orthogonal: scalar products of signals without mean and Nyquist line are those of their waves."""
    rng = np.random.default_rng(seed)
    t = TURN * np.arange(n) / n
    orders = np.arange(1, (n - 1) // 2 + 1)
    c, s = rng.normal(size=(2, 2, orders.size))
    a, b = (c[i] @ np.cos(np.outer(orders, t)) + s[i] @ np.sin(np.outer(orders, t)) for i in range(2))
    product = (harmonics(a) * harmonics(b).conj()).sum().real * n / 2
    assert product == pytest.approx(a @ b, rel=1e-9, abs=1e-9 * n)


@given(
    n=st.integers(5, 300), share=st.floats(0, 1), size=st.floats(1e-6, 10), phase=st.floats(0, 7), mean=st.floats(-5, 5)
)
def test_amplitude_of_a_known_cosine(n: int, share: float, size: float, phase: float, mean: float) -> None:
    last = (n - 1) // 2
    order = 1 + round(share * (last - 1))
    values = mean + size * np.cos(order * TURN * np.arange(n) / n + phase)
    expected = np.where(np.arange(1, last + 1) == order, size, 0.0)
    np.testing.assert_allclose(abs(harmonics(values)), expected, rtol=0, atol=1e-11 * (size + abs(mean) + 1))


def test_harmonics_are_cosine_and_minus_sine() -> None:
    t = TURN * np.arange(64) / 64
    found = harmonics(5 * np.cos(3 * t) + 7 * np.sin(9 * t))
    assert found[2] == pytest.approx(5)
    assert found[8] == pytest.approx(-7j)


# --- noise --------------------------------------------------------------------------------------------------------


def smoothing(m: int) -> np.ndarray:
    """Weights of the documented smoothing, a wider span at higher harmonics: a quarter to either side, 4 to 40."""
    weights = np.zeros((m, m))
    for at in range(m):
        half = min(max(at // 4, 4), 40)
        weights[at, max(at - half, 0) : at + half + 1] = 1
    return weights / weights.sum(axis=1, keepdims=True)


@pytest.mark.parametrize("periods", [2, 3, 8])
def test_white_noise_has_a_flat_spectrum(periods: int) -> None:
    """Unbiased: the mean over 200 draws within four standard errors, harmonic by harmonic smoothed."""
    rng = np.random.default_rng(periods)
    n, sigma, draws = 257, 0.3, 200
    base = wave(TURN * np.arange(n) / n)
    spectra = np.array([noise_spectrum(base + rng.normal(0, sigma, (periods, n))) for _ in range(draws)])
    m = (n - 1) // 2
    # chi-square with 2 (periods - 1) degrees of freedom per harmonic
    error = sigma**2 * np.sqrt((smoothing(m) ** 2).sum(axis=1) / (periods - 1) / draws)
    pulls = (spectra.mean(axis=0) - sigma**2) / error
    assert abs(pulls).max() < 4.5
    assert spectra.mean() == pytest.approx(sigma**2, rel=4 / math.sqrt(draws * m * (periods - 1)))
    single = (spectra[0] - sigma**2) / (error * math.sqrt(draws))
    assert abs(single).max() < 6


def test_coloured_noise_keeps_its_colour() -> None:
    """x_t = 0.9 x_(t-1) + e_t has the spectrum 1 / |1 - 0.9 exp(-i w)|^2, from 100 down to 0.28."""
    phi, n, periods, draws = 0.9, 1025, 4, 60
    m = (n - 1) // 2
    rng = np.random.default_rng(0)
    e = rng.normal(size=(draws, 200 + periods * n))
    x = np.zeros_like(e)
    for t in range(1, e.shape[1]):
        x[:, t] = phi * x[:, t - 1] + e[:, t]
    spectra = np.array([noise_spectrum(row) for row in x[:, 200:].reshape(draws, periods, n)])
    w = TURN * np.arange(1, m + 1) / n
    known = 1 / abs(1 - phi * np.exp(-1j * w)) ** 2
    weights = smoothing(m)
    error = np.sqrt((weights**2) @ known**2 / (periods - 1) / draws)
    pulls = (spectra.mean(axis=0) - weights @ known) / error
    assert abs(pulls).max() < 5
    # what the span itself blurs is little where neighbours lie on both sides
    assert spectra.mean(axis=0)[8:] == pytest.approx(known[8:], rel=0.15)


@given(seed=st.integers(0, 99), periods=st.integers(2, 6), n=st.integers(16, 80))
def test_noise_does_not_see_what_repeats(seed: int, periods: int, n: int) -> None:
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(periods, n))
    repeated = values + 100 * wave(TURN * np.arange(n) / n)
    lifted = values + rng.normal(size=(periods, 1))
    np.testing.assert_allclose(noise_spectrum(repeated), noise_spectrum(values), rtol=1e-6)
    np.testing.assert_allclose(noise_spectrum(lifted), noise_spectrum(values), rtol=1e-6)
    np.testing.assert_allclose(noise_spectrum(3 * values), 9 * noise_spectrum(values), rtol=1e-9)


# --- frames -------------------------------------------------------------------------------------------------------

RV = {
    39: ["housing 39"],
    40: ["carrier, disc or crank 40"],
    78: ["housing 39 x 2"],
    80: ["carrier, disc or crank 40 x 2"],
    120: ["carrier, disc or crank 40 x 3", "sun 120"],
    1: ["output side (encoder, coupling)"],
    2: ["output side (encoder, coupling)"],
    3: [],
    36: [],
    38.9: [],
    39.015: ["housing 39"],
    121: ["input shaft 121"],
    242: ["input shaft 121 x 2"],
    468: ["housing 39 x 12"],
    507: ["housing 39 x 13"],
    1170: ["housing 39 x 30"],
    1209: [],  # 39 x 31: beyond thirty
    480: ["carrier, disc or crank 40 x 12", "sun 120 x 4"],
    1080: ["carrier, disc or crank 40 x 27", "sun 120 x 9", "gear mesh 1080"],
    1560: ["sun 120 x 13", "cycloid mesh 1560"],
    0: [],
}


@pytest.mark.parametrize(("order", "frames"), RV.items())
def test_frames_of_orders_of_the_rv40e(order: float, frames: list[str]) -> None:
    """Table of the design, section 3."""
    assert frames_of_order(rverror.reducer("RV-40E"), order) == frames


@pytest.mark.parametrize(
    ("order", "frames"),
    [
        (14, ["input shaft 14", "motor 14", "wheel 3.5 x 4"]),
        (28, ["input shaft 14 x 2", "motor 14 x 2", "wheel 3.5 x 8"]),
        (3.5, ["wheel 3.5"]),
        (45.5, ["wheel 3.5 x 13"]),
        (108.5, []),  # 3.5 x 31
        (1, ["output side (encoder, coupling)"]),
        (5, []),
    ],
)
def test_frames_of_orders_of_a_drive(order: float, frames: list[str]) -> None:
    drive = rverror.Drive(ratio=-14.0, shafts={"motor": -14.0, "wheel": 3.5})
    assert frames_of_order(drive, order) == frames


def test_a_wider_tolerance_takes_more() -> None:
    unit = rverror.reducer("RV-40E")
    assert frames_of_order(unit, 39.3) == []
    assert frames_of_order(unit, 39.3, tolerance=0.5) == ["housing 39"]


def test_the_coarsest_run_where_it_turns_fastest_says_how_high_an_order_is_sampled() -> None:
    """Half its samples a turn, less a twentieth; a sample read twice is no step."""
    fine, coarse = even(1000, 2), even(200, 1)
    coarse = np.insert(coarse, 20, coarse[20])
    assert highest_order([fine, coarse]) == pytest.approx(0.95 * 100)
    assert highest_order([fine]) == pytest.approx(0.95 * 500)
