"""Harmonic balance against the textbook, reciprocity, power, and an integration in time of the same equations."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from rverror import InputError
from rverror.base.arrays import slope
from rverror.dynamics.harmonic_balance import Oscillator
from rverror.dynamics.time_integration import Forced

COUNT = 64
ANGLE = 2 * np.pi * np.arange(COUNT) / COUNT


def steady(*matrices: np.ndarray) -> list[np.ndarray]:
    """Matrices that do not turn, at every angle."""
    return [np.repeat(np.atleast_2d(one)[..., None], COUNT, axis=2) for one in matrices]


def single(frequency: float, ratio: float) -> Oscillator:
    """One degree of freedom."""
    none = np.zeros((1, 1))
    return Oscillator(*steady(frequency**2, 2 * ratio * frequency), none, none, 2 * math.pi)


def random_system(
    seed: int, size: int, *, varying: float = 0.2, turning: float = 1.0, damped: float = 0.05
) -> Oscillator:
    """Frequencies of 1 to 4 rad/s whose stiffness and damping turn with two orders."""
    rng = np.random.default_rng(seed)
    basis = np.linalg.qr(rng.normal(size=(size, size)))[0]
    mean = basis * rng.uniform(1, 16, size) @ basis.T
    stiffness, damping = steady(mean, damped * mean)
    for wave in (np.cos(ANGLE), np.sin(2 * ANGLE)):
        more = rng.normal(size=(size, size))
        more = varying * (more + more.T) / np.abs(np.linalg.eigvalsh(more + more.T)).max()
        stiffness += more[..., None] * wave
        damping += 0.2 * damped * more[..., None] * wave
    skew, bulge = rng.normal(size=(2, size, size)) * 0.05 * turning
    return Oscillator(stiffness, damping, skew - skew.T, -bulge @ bulge.T, 2 * math.pi)


def random_force(seed: int, size: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    waves = np.array([np.cos(ANGLE), np.sin(ANGLE), np.cos(3 * ANGLE), np.ones(COUNT)])
    return np.asarray(rng.normal(size=(size, 4)) @ waves)


# --- the textbook -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("share", [0.1, 0.9, 1.0, 1.4, 5.0])
@pytest.mark.parametrize("ratio", [0.01, 0.3])
def test_one_degree_of_freedom(share: float, ratio: float) -> None:
    """Amplitude 1/k / sqrt((1 - r^2)^2 + (2 zeta r)^2), lagging by atan2(2 zeta r, 1 - r^2)."""
    frequency, order = 7.0, 3
    speed = share * frequency / order
    found = single(frequency, ratio).response(np.cos(order * ANGLE)[None], speed=speed)
    size = 1 / frequency**2 / math.hypot(1 - share**2, 2 * ratio * share)
    lag = math.atan2(2 * ratio * share, 1 - share**2)
    np.testing.assert_allclose(found[0], size * np.cos(order * ANGLE - lag), atol=1e-9 * size)


def test_backwards_the_phase_is_the_other_way() -> None:
    """theta falls: what lags in time leads in angle."""
    forth, back = (single(2.0, 0.1).response(np.cos(ANGLE)[None], speed=sign * 1.5) for sign in (1, -1))
    np.testing.assert_allclose(back[0], forth[0][-np.arange(COUNT)], atol=1e-12)


def test_slopes_of_waves() -> None:
    wave = np.cos(5 * ANGLE) + 0.3 * np.sin(2 * ANGLE)
    np.testing.assert_allclose(slope(wave, 1.0), -5 * np.sin(5 * ANGLE) + 0.6 * np.cos(2 * ANGLE), atol=1e-12)
    np.testing.assert_allclose(slope(wave, 0.5, 2), (-25 * np.cos(5 * ANGLE) - 1.2 * np.sin(2 * ANGLE)) / 4, atol=1e-11)


def test_undamped_at_its_frequency_nothing_is_answered() -> None:
    with pytest.raises(InputError, match=r"undamped at a natural frequency; give a damping ratio above 0"):
        single(2.0, 0.0).response(np.cos(ANGLE)[None], speed=2.0)


# --- what must hold of any system -------------------------------------------------------------------------------------


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), speed=st.floats(0.2, 6))
def test_what_one_part_does_to_another_that_one_does_to_it(seed: int, speed: float) -> None:
    """Reciprocity, at rest: symmetric stiffness and damping that do not turn, no Coriolis force."""
    system = random_system(seed, 4, varying=0.0, turning=0.0)
    force = np.zeros((2, 4, COUNT))
    force[0, 0] = force[1, 3] = np.cos(2 * ANGLE)
    one, other = (system.response(row, speed=speed) for row in force)
    np.testing.assert_allclose(one[3], other[0], atol=1e-6 * np.abs(one).max())


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), size=st.integers(1, 4), speed=st.floats(0.2, 3))
def test_power_in_is_power_lost(seed: int, size: int, speed: float) -> None:
    """Over a period: force times rate = rate C rate less what the turning stiffness does, y K' y / 2.

    Coriolis forces do no work, centrifugal ones none over a period.
    """
    system, force = random_system(seed, size), random_force(seed, size)
    moved = system.response(force, speed=speed)
    rate = speed * slope(moved, 1.0)
    put_in = (force * rate).sum(axis=0).mean()
    lost = np.einsum("in,ijn,jn->n", rate, system.damping, rate).mean()
    driven = speed * np.einsum("in,ijn,jn->n", moved, slope(system.stiffness, 1.0), moved).mean() / 2
    assert put_in + driven == pytest.approx(lost, rel=1e-5, abs=1e-6 * np.abs(force * rate).mean())


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), size=st.integers(1, 4), speed=st.floats(0.3, 3), sign=st.sampled_from([-1.0, 1.0]))
def test_harmonic_balance_is_what_the_integration_in_time_stays_on(
    seed: int, size: int, speed: float, sign: float
) -> None:
    """Started where the periodic motion is, the motion in time keeps to it over three periods."""
    system, force, turn = random_system(seed, size), random_force(seed, size), sign * speed
    moved = system.response(force * turn**2, speed=turn)
    rate = turn * slope(moved, 1.0)
    times = np.arange(0, 3 * COUNT + 1) / COUNT * 2 * math.pi / speed
    driven = Forced(system, force, np.zeros_like(force))
    y, rates = driven.in_time(lambda time: (turn * time, turn, 0.0), times, start=(moved[:, 0], rate[:, 0]))
    places = (int(sign) * np.arange(times.size)) % COUNT
    np.testing.assert_allclose(y, moved[:, places], atol=1e-4 * np.abs(moved).max())
    np.testing.assert_allclose(rates, rate[:, places], atol=1e-4 * np.abs(rate).max())


def left_over(system: Oscillator, force: np.ndarray, moved: np.ndarray, speed: float) -> float:
    """What is left of the equation at the sampled angles, of the force."""
    step = 2 * math.pi / system.period
    pairs = (
        (system.stiffness + speed**2 * system.centrifugal[..., None], moved),
        (system.damping + speed * system.turning[..., None], speed * slope(moved, step)),
    )
    left = speed**2 * slope(moved, step, 2) - force + sum(np.einsum("ijn,jn->in", one, of) for one, of in pairs)
    # a second derivative has the rounding of what it is taken of times the square of the shortest wave
    rounding = np.finfo(float).eps * (speed * step * system.count / 2) ** 2 * np.linalg.norm(moved)
    return float((np.linalg.norm(left) - rounding) / np.linalg.norm(force))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), size=st.integers(1, 4), speed=st.floats(0.2, 3), depth=st.floats(0, 0.95))
def test_the_equation_holds_however_far_the_stiffness_turns(seed: int, size: int, speed: float, depth: float) -> None:
    """Also where nothing is left of it for a while, as of a part that a few contacts hold."""
    system, force = random_system(seed, size), random_force(seed, size)
    system = replace(system, stiffness=system.stiffness * (1 + depth * np.sign(np.cos(3 * ANGLE) + 0.8)))
    assert left_over(system, force, system.response(force, speed=speed), speed) < 1e-10


@pytest.mark.parametrize("speed", [0.07, -0.07, 0.7])
def test_a_stiffness_of_two_steps_is_met_with_the_square_of_the_samples(speed: float) -> None:
    """Meissner's equation under a constant force: each half turn in closed form, put together so that it repeats.

    The stiffness jumps by 400 times, so a series in waves from the mean stiffness on does not settle.
    """
    missed = [meissner(speed, count) for count in (2048, 4096, 8192)]
    assert missed[-1] < 1e-3
    assert missed[0] / missed[1] == pytest.approx(4, rel=0.1)
    assert missed[1] / missed[2] == pytest.approx(4, rel=0.1)


def meissner(speed: float, count: int, *, soft: float = 1.0, stiff: float = 400.0, damping: float = 0.2) -> float:
    """How far the balance is from the closed form, of its peak-to-peak."""
    angle = 2 * np.pi * (np.arange(count) + 0.5) / count
    none, ones = np.zeros((1, 1)), np.ones((1, 1, count))
    system = Oscillator(np.where(angle < np.pi, soft, stiff) * ones, damping * ones, none, none, 2 * math.pi)
    moved = system.response(np.ones((1, count)), speed=speed)
    assert left_over(system, np.ones((1, count)), moved, speed) < 1e-10

    def through(k: float, time: float | np.ndarray) -> np.ndarray:
        """Matrix of distance from rest and rate over a time, (2, 2, ...)."""
        w = math.sqrt(k - damping**2 / 4)
        cos, sin, fading = np.cos(w * time), np.sin(w * time) / w, np.exp(-damping * time / 2)
        return np.asarray(fading * np.array([[cos + damping / 2 * sin, sin], [-k * sin, cos - damping / 2 * sin]]))

    first, second = (soft, stiff) if speed > 0 else (stiff, soft)
    half, shift = math.pi / abs(speed), np.array([1 / first - 1 / second, 0])
    one, other = through(first, half), through(second, half)
    # u from the rest of the first half, at its start: other (one u + shift) - shift = u
    start = np.linalg.solve(np.eye(2) - other @ one, other @ shift - shift)
    time = (angle if speed > 0 else 2 * np.pi - angle) / abs(speed)
    early = np.einsum("jn,j->n", through(first, time)[0], start) + 1 / first
    late = np.einsum("jn,j->n", through(second, time - half)[0], one @ start + shift) + 1 / second
    exact = np.where(time < half, early, late)
    return float(np.abs(moved[0] - exact).max() / np.ptp(exact))


# --- in time ----------------------------------------------------------------------------------------------------------


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6), size=st.integers(1, 4), speed=st.floats(0, 3))
def test_undamped_the_energy_of_a_free_motion_stays(seed: int, size: int, speed: float) -> None:
    """Coriolis forces do no work; centrifugal ones belong to the stiffness."""
    system = random_system(seed, size, varying=0.0, damped=0.0)
    rng, none = np.random.default_rng(seed), np.zeros((size, COUNT))
    start = (rng.normal(size=size), rng.normal(size=size))
    y, rate = Forced(system, none, none).in_time(
        lambda time: (speed * time, speed, 0.0), np.linspace(0, 30, 50), start=start
    )
    stiffness = system.stiffness[..., 0] + speed**2 * system.centrifugal
    energy = (rate**2).sum(axis=0) / 2 + np.einsum("ik,ij,jk->k", y, stiffness, y) / 2
    np.testing.assert_allclose(energy, energy[0], rtol=1e-5)


def test_a_stiffness_that_beats_twice_a_period_swings_the_system_up() -> None:
    """Mathieu: y'' + w^2 (1 + h cos 2 w t) y = 0 grows with exp(h w t / 4), to first order in h."""
    frequency, depth, speed = 1.0, 0.02, 2.0
    stiffness = frequency**2 * (1 + depth * np.cos(ANGLE))[None, None]
    none = np.zeros((1, 1))
    system = Oscillator(stiffness, np.zeros((1, 1, COUNT)), none, none, 2 * math.pi)
    times = 2 * math.pi * np.arange(60, 140)
    silent = np.zeros((1, COUNT))
    start = (np.array([1.0]), np.array([0.0]))
    y, rate = Forced(system, silent, silent).in_time(
        lambda time: (speed * time, speed, 0.0), np.append(0.0, times), start=start
    )
    size = np.log(np.hypot(y[0], rate[0]))[1:]
    assert np.polyfit(times, size, 1)[0] == pytest.approx(depth * frequency / 4, rel=0.02)


def test_a_start_from_rest_is_the_textbooks_step() -> None:
    """y = (1 - exp(-zeta w t) (cos w_d t + zeta w / w_d sin w_d t)) / w^2 under a constant force of 1."""
    frequency, ratio = 3.0, 0.1
    times = np.linspace(0, 8, 81)
    force = Forced(single(frequency, ratio), np.zeros((1, COUNT)), np.ones((1, COUNT)))
    y, _ = force.in_time(lambda time: (time**2 / 2, time, 1.0), times)
    damped = frequency * math.sqrt(1 - ratio**2)
    fading = np.exp(-ratio * frequency * times)
    wave = np.cos(damped * times) + ratio * frequency / damped * np.sin(damped * times)
    np.testing.assert_allclose(y[0], (1 - fading * wave) / frequency**2, atol=1e-6)


def test_a_free_body_goes_straight_on_however_its_frame_turns() -> None:
    """Coriolis, centrifugal and Euler's forces alone, in a frame of 3 turns whose speed grows."""
    turns, quarter = 3.0, np.array([[0.0, -1.0], [1.0, 0.0]])
    none = np.zeros((2, 2, COUNT))
    system = Oscillator(none, none, 2 * turns * quarter, -(turns**2) * np.eye(2), 2 * math.pi)
    silent = np.zeros((2, COUNT))
    times, begin, velocity = np.linspace(0, 3, 31), np.array([1.0, 0.5]), np.array([0.3, -0.2])
    # at rest at first the frame sees the velocity as it is
    y, _ = Forced(system, silent, silent).in_time(
        lambda time: (0.2 * time**2, 0.4 * time, 0.4), times, start=(begin, velocity)
    )
    path = (begin[:, None] + velocity[:, None] * times)[0] + 1j * (begin[:, None] + velocity[:, None] * times)[1]
    seen = path * np.exp(-1j * turns * 0.2 * times**2)
    np.testing.assert_allclose(y[0] + 1j * y[1], seen, atol=1e-6)
