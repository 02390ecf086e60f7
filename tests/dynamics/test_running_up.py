"""Running up: the textbook's ramp, step and sweep, harmonic balance at both ends, energy, Newton's law at the load."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.special import fresnel

import rverror
from rverror import InputError, Model, effect
from rverror.base.arrays import slope
from rverror.base.units import ARCSEC
from rverror.dynamics import RunUp, modes, run_up, speed_response
from rverror.dynamics.harmonic_balance import Oscillator
from rverror.dynamics.time_integration import Forced, periodic
from rverror.model import Bench
from strategies import variant

RPM = math.pi / 30
UNIT = rverror.reducer("RV-40E")
#: A small train of the same kind, whose turn has few samples: 12 pins, ratio 37.
SMALL = variant(UNIT, pins=12, disc_lobes=11, eccentricity=3.0, pin_radius=6.0, name="small")
ERRORS = (
    effect("crank.eccentricity", crank=0, disc=0, tangential="5 um"),
    effect("cycloid.disc_pitch", disc=1, harmonic=1, cos="4 um"),
    effect("cycloid.pin_position", pin=3, radial="3 um"),
)
LOAD = Bench(load_inertia="50 kg*m^2", damping_ratio=0.1)
BOTH_ENDS = Bench(
    input_inertia="1e-4 kg*m^2",
    position_control_stiffness="20000 N*m/rad",
    input_coupling_stiffness="30000 N*m/rad",
    load_inertia="50 kg*m^2",
    load_coupling_stiffness="1e6 N*m/rad",
    damping_ratio=0.1,
)
COUNT = 64
ANGLE = 2 * np.pi * np.arange(COUNT) / COUNT


def steady(value: float) -> np.ndarray:
    return np.full((1, 1, COUNT), value)


def single(frequency: float, ratio: float) -> Oscillator:
    """One degree of freedom."""
    none = np.zeros((1, 1))
    return Oscillator(steady(frequency**2), steady(2 * ratio * frequency), none, none, 2 * math.pi)


def balanced(model: Model, found: RunUp, speed: float) -> np.ndarray:
    """Error of the harmonic balance at the angles of a run-up."""
    still = speed_response(model, [speed], torque=found.torque, direction=found.direction)
    period = 2 * math.pi * still.period
    return np.asarray(periodic(still.transmission_error, period)(found.theta).T[0])


def settled(frequency: float, ratio: float, time: np.ndarray) -> np.ndarray:
    """The textbook's step response of one degree of freedom over its last value."""
    damped = frequency * math.sqrt(1 - ratio**2)
    swing = np.cos(damped * time) + ratio * frequency / damped * np.sin(damped * time)
    return np.asarray(1 - np.exp(-ratio * frequency * time) * swing)


# --- the textbook -----------------------------------------------------------------------------------------------------


def test_an_undamped_sweep_is_lewiss() -> None:
    """At rate a through w: (w/2) sqrt(pi/a) times the largest Fresnel integral, 3.67 sqrt(w^2/(2 pi a)) static sags."""
    frequency, rate = 1.0, 5e-4
    times = np.linspace(0, 1.2 * frequency / rate, 30001)
    swept = Forced(single(frequency, 0.0), np.zeros((1, COUNT)), np.cos(ANGLE)[None] / rate)
    y, _ = swept.in_time(lambda t: (rate * t**2 / 2, rate * t, rate), times)
    sine, cosine = fresnel(np.linspace(-40, 3, 43001))
    most = frequency / 2 * math.sqrt(math.pi / rate) * np.hypot(cosine + 0.5, sine + 0.5).max()
    assert most == pytest.approx(3.67 * frequency / math.sqrt(2 * math.pi * rate), rel=0.005)
    assert np.abs(y).max() * frequency**2 == pytest.approx(most, rel=0.02)


def test_a_slow_sweep_has_the_amplitude_of_constant_speed() -> None:
    """Static sag over 2 zeta sqrt(1 - zeta^2) where the rate is far below (zeta w)^2, less and later else."""
    ratio, none = 0.2, np.zeros((1, COUNT))
    tops, at = [], []
    for rate in (8e-4, 8e-2):
        times = np.linspace(0, 1.5 / rate, 20001)
        swept = Forced(single(1.0, ratio), none, np.cos(ANGLE)[None] / rate)
        y, _ = swept.in_time(lambda t, rate=rate: (rate * t**2 / 2, rate * t, rate), times)
        tops.append(np.abs(y).max())
        at.append(rate * times[np.abs(y[0]).argmax()])
    still = 1 / (2 * ratio * math.sqrt(1 - ratio**2))
    assert tops[0] == pytest.approx(still, rel=0.01)
    assert tops[1] < 0.85 * still
    assert at[0] == pytest.approx(math.sqrt(1 - 2 * ratio**2), abs=0.02)
    assert at[1] > 1.05


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_load_that_is_sped_up_evenly_winds_up_like_the_textbooks_step(direction: float) -> None:
    """Heavy load on a train without errors: windup of T + J Omega' less that of T, times the step response."""
    model = Model(UNIT, bench=Bench(load_inertia="500 kg*m^2", damping_ratio=0.05))
    found = run_up(model, [0, 1], ["0 rpm", "200 rpm"], torque="100 N*m", direction=direction, smooth=False)
    more = 500e3 * 200 * RPM / UNIT.ratio
    low, high = (
        rverror.equilibrium(Model(UNIT), [0.0], torque=torque, direction=direction).transmission_error[0]
        for torque in (100e3, 100e3 + more)
    )
    first = 2 * math.pi * modes(model, torque="100 N*m", direction=direction).frequency[0]
    expected = (high - low) * settled(first, 0.05, found.time)
    assert abs(high - low) > 50 * ARCSEC
    np.testing.assert_allclose(found.transmission_error - found.crawl, expected, atol=3e-3 * abs(high - low))
    np.testing.assert_allclose(found.windup, high - low, rtol=2e-3)
    # what the train carries is its twist and what damps it
    damped = first * math.sqrt(1 - 0.05**2)
    rate = first**2 / damped * np.exp(-0.05 * first * found.time) * np.sin(damped * found.time)
    carried = settled(first, 0.05, found.time) + 2 * 0.05 / first * rate
    np.testing.assert_allclose(found.output_torque, 100e3 + more * carried, rtol=5e-3)


# --- what must hold of any system -------------------------------------------------------------------------------------


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_energy_is_what_was_put_in_less_what_was_lost(seed: int) -> None:
    """Of a stiffness that turns, as the speed grows: dE/dt = F y' - y' C y' + y K' y / 2."""
    rng = np.random.default_rng(seed)
    size = 3
    basis = np.linalg.qr(rng.normal(size=(size, size)))[0]
    mean = basis * rng.uniform(1, 16, size) @ basis.T
    wave = rng.normal(size=(size, size))
    stiffness = mean[..., None] + 0.1 * (wave + wave.T)[..., None] * np.cos(2 * ANGLE)
    damping = np.repeat(0.05 * mean[..., None], COUNT, axis=2)
    none = np.zeros((size, size))
    forces = [rng.normal(size=(size, 2)) @ np.array([np.cos(ANGLE), np.sin(3 * ANGLE)]) for _ in range(2)]
    system = Oscillator(stiffness, damping, none, none, 2 * math.pi)
    forced = Forced(system, *forces)
    times = np.linspace(0, 6, 6001)
    theta, speed = 0.2 * times**2, 0.4 * times
    y, rate = forced.in_time(lambda t: (0.2 * t**2, 0.4 * t, 0.4), times)
    (now, lost), (by_speed, by_acceleration) = (np.moveaxis(one, 1, 0) for one in forced.at(theta))
    force = (speed**2 * by_speed.T) + 0.4 * by_acceleration.T
    turns = periodic(slope(stiffness.reshape(9, -1), 1.0), 2 * math.pi)(theta).T.reshape(3, 3, -1)
    power = (force * rate).sum(axis=0) - np.einsum("in,nij,jn->n", rate, lost, rate)
    power += speed * np.einsum("in,ijn,jn->n", y, turns, y) / 2
    energy = (rate**2).sum(axis=0) / 2 + np.einsum("in,nij,jn->n", y, now, y) / 2
    work = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 2) * (times[1] - times[0])])
    np.testing.assert_allclose(energy, work, atol=1e-4 * np.abs(power).sum() * (times[1] - times[0]))


def test_waves_between_the_samples_are_those_of_the_series() -> None:
    wave = np.cos(5 * ANGLE) + 0.3 * np.sin(24 * ANGLE)
    angle = np.random.default_rng(0).uniform(0, 2 * math.pi, 99)
    found = periodic(wave[None], 2 * math.pi)(angle).T[0]
    np.testing.assert_allclose(found, np.cos(5 * angle) + 0.3 * np.sin(24 * angle), atol=3e-3)


def test_stiffness_that_jumps_stays_above_nothing_between_the_samples() -> None:
    """As flanks close; its series alone would fall to -0.07 of the jump."""
    stiffness = np.where(ANGLE < 2, 400.0, 1.0)[None, None]
    none = np.zeros((1, 1))
    jumping = Forced(Oscillator(stiffness, 0.1 * stiffness, none, none, 2 * math.pi), *np.zeros((2, 1, COUNT)))
    series = periodic(stiffness[0], 2 * math.pi)
    angle = np.linspace(0, 2 * math.pi, 5001)
    assert series(angle).min() < -10
    found = jumping.at(angle)[0]
    assert 1 - 1e-9 <= found[:, 0].min() <= found[:, 0].max() <= 400 + 1e-9
    np.testing.assert_allclose(jumping.at(ANGLE)[0][:, 0, 0, 0], stiffness[0, 0])


# --- a train beside its harmonic balance ------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("bench", [LOAD, BOTH_ENDS], ids=["held", "both ends"])
def test_at_constant_speed_it_stays_on_the_harmonic_balance(bench: Bench, direction: float) -> None:
    model = Model(SMALL, ERRORS, bench=bench)
    found = run_up(model, ["0 ms", "300 ms"], ["250 rpm"] * 2, torque="300 N*m", direction=direction)
    still = balanced(model, found, 250 * RPM)
    assert np.abs(still - found.crawl).max() > 0.01 * np.ptp(still)
    np.testing.assert_allclose(found.transmission_error, still, atol=0.02 * np.abs(still - found.crawl).max())
    assert found.theta[-1] == pytest.approx(direction * 0.3 * 250 * RPM / SMALL.ratio)


def test_after_a_ramp_it_settles_on_the_harmonic_balance() -> None:
    model = Model(SMALL, ERRORS, bench=LOAD)
    found = run_up(model, [0, 0.1, 1.2], ["0 rpm", "250 rpm", "250 rpm"], torque="300 N*m")
    still = balanced(model, found, 250 * RPM)
    left = np.abs(found.transmission_error - still) / np.abs(still - found.crawl).max()
    first = 2 * math.pi * found.frequency[0]
    shaken = left[found.time < 0.15].max()
    assert shaken > 10  # by the ramp
    assert left[found.time > 1].max() < 0.02 + 1.5 * shaken * math.exp(-0.1 * first * 0.85)


def test_a_slow_run_up_passes_a_resonance_as_constant_speeds_do_and_a_fast_one_by_less() -> None:
    """Beside Duhamel's integral of a wavy base that is swept, -e'' by the step response of one degree of freedom."""
    ratio = 0.05
    model = Model(SMALL, ERRORS[:1], bench=replace(LOAD, damping_ratio=ratio))
    first = 2 * math.pi * modes(model, torque="3000 N*m").frequency[0]
    peak = first / 12 * SMALL.ratio  # of the cam's order, 12
    bare = Model(SMALL, bench=model.bench)
    still, calm = (
        speed_response(one, peak * np.linspace(0.9, 1.1, 21), torque="3000 N*m", kept=1) for one in (model, bare)
    )
    # mesh and ramp shake the load, with errors or without
    resonant = np.abs((still.transmission_error - still.crawl) - (calm.transmission_error - calm.crawl)).max()
    pole, tops = first * complex(-ratio, math.sqrt(1 - ratio**2)), []
    for long in (2.0, 0.4):
        course, same = ([0, long], [0.6 * peak, 1.4 * peak]), {"smooth": False, "kept": 1, "samples": 4001}
        found, shaken = (run_up(one, *course, torque="3000 N*m", **same) for one in (model, bare))
        tops.append(np.abs(found.vibration - shaken.vibration).max() / resonant)
        time, rate = np.linspace(0, long, 40001), 0.8 * first / long
        turning = 0.6 * first + rate * time
        phase = np.angle(still.crawl_waves[0]) + 0.6 * first * time + rate * time**2 / 2
        force = turning**2 * np.cos(phase) + rate * np.sin(phase)
        # from the steady motion at the first speed on
        steady = 0.36 / (1 - 0.36 + 1.2j * ratio) * np.exp(1j * phase[0])
        begin, rate_then = steady.real, (0.6j * first * steady).real
        free = complex((rate_then - pole.real * begin) / pole.imag, begin)
        moved = (np.exp(pole * time) * (free + np.cumsum(np.exp(-pole * time) * force) * time[1] / pole.imag)).imag
        assert tops[-1] == pytest.approx(np.abs(moved).max() * 2 * ratio * math.sqrt(1 - ratio**2), rel=0.02), long
    assert tops[0] > 0.8
    assert tops[1] < 0.75


# --- the load ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("bench", [LOAD, replace(LOAD, load_coupling_stiffness=2e9)], ids=["rigid", "coupled"])
def test_the_torque_at_the_output_is_newtons(bench: Bench, direction: float) -> None:
    """The input held, the error is the carrier's angle: d T_out = T + J (Omega' + TE'')."""
    model = Model(SMALL, ERRORS[:1], bench=bench)
    found = run_up(model, [0, 0.2, 0.3], [0, 20, 20], torque="700 N*m", direction=direction, samples=30001)
    inertia = 50e6 / 1e3 + modes(model, torque="700 N*m").inertia.carrier_inertia
    angle = found.theta + found.transmission_error
    step = found.time[1]
    turning = (angle[2:] - 2 * angle[1:-1] + angle[:-2]) / step**2
    expected = 700e3 + direction * inertia * turning
    # a coupling of 2e6 N*m/rad passes on what is below its own 30 Hz and more of what is slow
    smooth = np.ones(301) / 301
    told, newton = (np.convolve(row, smooth, "valid") for row in (found.output_torque[1:-1], expected))
    if bench.load_coupling_stiffness is None:
        np.testing.assert_allclose(told, newton, atol=2e-3 * np.ptp(newton))
    else:
        assert told.mean() == pytest.approx(newton.mean(), rel=5e-3)
    assert np.ptp(found.output_torque) > 250e3


# --- the way in -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("times", "speeds", "options", "said"),
    [
        ([0], [1], {}, "times: give two or more that grow"),
        ([0, 1, 0.5], [1, 1, 1], {}, "times: give two or more that grow"),
        (["0 s", "1 mm"], [1, 1], {}, "times: "),
        ([0, 1], [1], {}, "input_speeds: give as many as times"),
        ([0, 1], [1, -1], {}, "input_speeds: give as many as times, each 0 or more"),
        ([0, 1, 1], [1, 1, 1], {}, "times: give two or more that grow"),
        ([0, 1], [1, 2], {"samples": 1}, "samples = 1: give 2 times or more"),
    ],
)
def test_courses_that_are_none_are_refused(
    times: list[float], speeds: list[float], options: dict[str, object], said: str
) -> None:
    with pytest.raises(InputError, match="^" + said):
        run_up(Model(SMALL), times, speeds, **{"torque": "100 N*m", **options})


def test_an_input_that_nothing_holds_follows_no_speed() -> None:
    model = Model(SMALL, bench=Bench(input_inertia="1e-4 kg*m^2", position_control_stiffness=0))
    with pytest.raises(InputError, match=r"^position_control_stiffness = 0: nothing makes the input follow a speed"):
        run_up(model, [0, 1], [0, 10])
    with pytest.raises(InputError, match=r"dynamics need a \[reducer\] model"):
        run_up(Model(rverror.Drive(ratio=14.0)), [0, 1], [0, 10])


def test_smooth_and_straight_ramps_travel_as_far() -> None:
    smooth, straight = (run_up(Model(SMALL), [0, 0.1], [0, 40], smooth=way, samples=101) for way in (True, False))
    assert smooth.theta[-1] == pytest.approx(0.1 * 20 / SMALL.ratio) == pytest.approx(straight.theta[-1])
    np.testing.assert_allclose(straight.speed, 400 * straight.time, atol=1e-9)
    share = smooth.time / 0.1
    np.testing.assert_allclose(smooth.speed, 40 * share**2 * (3 - 2 * share), atol=1e-9)
    np.testing.assert_allclose(
        np.gradient(smooth.theta, smooth.time)[1:-1] * SMALL.ratio, smooth.speed[1:-1], rtol=2e-3, atol=2e-2
    )


def test_a_run_up_is_told_with_where_contacts_would_pull() -> None:
    """Braking a heavy load by more than its torque: 50 kg m^2 at 30 rad/s^2 against 300 N*m."""
    model = Model(SMALL, bench=LOAD)
    found = run_up(model, [0, 0.02], [40, 0], torque="300 N*m")
    assert found.output_torque.min() < 0
    told = rverror.to_text(found)
    assert told.startswith("Run-up: 300 N*m, forward, 0.02 s\n")
    assert "contacts would have to pull" in told
    calm = run_up(model, [0, 0.02], [40, 40], torque="300 N*m")
    assert "contacts would have to pull" not in rverror.to_text(calm)
