"""Error at speed: the equilibrium at a crawl, closed forms, the housing's frame, and what must hold of any train."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, reject, settings, strategies as st

import rverror
from rverror import Model, Reducer, effect
from rverror.app.command_line import main
from rverror.base.arrays import slope
from rverror.base.units import ARCSEC
from rverror.dynamics import modes, speed_response
from rverror.dynamics.loaded_motion import LoadedMotion, driven_frequency, loaded_motion
from rverror.dynamics.train import Train
from rverror.geartrain import Inertia, Stiffness
from rverror.geartrain.contacts import pose
from rverror.geartrain.kinematics import samples_needed
from rverror.model import Bench
from rverror.statics.loaded_state import Settled, statics_of
from strategies import reducers, variant

RPM = math.pi / 30
UNIT = rverror.reducer("RV-40E")
#: A small train of the same kind, whose turn has few samples: 12 pins, ratio 37.
SMALL = variant(UNIT, pins=12, disc_lobes=11, eccentricity=3.0, pin_radius=6.0, name="small")
ERRORS = (
    effect("crank.eccentricity", crank=0, disc=0, tangential="5 um"),
    effect("cycloid.disc_pitch", disc=1, harmonic=1, cos="4 um"),
    effect("cycloid.pin_position", pin=3, radial="3 um"),
)
LOAD = Bench(load_inertia="50 kg*m^2")
SWINGING = Bench(load_inertia="500 kg*m^2", damping_ratio=0.05)
BOTH_ENDS = Bench(
    input_inertia="1e-4 kg*m^2",
    position_control_stiffness="200 N*m/rad",
    input_coupling_stiffness="3000 N*m/rad",
    load_inertia="5 kg*m^2",
    load_coupling_stiffness="1e6 N*m/rad",
)


def deviation(found: rverror.dynamics.SpeedResponse) -> np.ndarray:
    return found.transmission_error - found.crawl


def moving(model: Model, *, torque: float, count: int, direction: float = 1.0) -> tuple[LoadedMotion, Settled]:
    """A train in motion, and its contacts as the housing sees them."""
    assert isinstance(model.mechanism, rverror.Reducer)
    theta = 2 * math.pi * np.arange(count) / count
    where = pose(model.mechanism, theta, torque=torque, direction=direction)
    tangents = statics_of(model.mechanism, where).settled(model.effects)
    return loaded_motion(Train(model.mechanism, model.bench), tangents, theta, 2 * math.pi), tangents


def smooth(rows: np.ndarray, highest: int) -> np.ndarray:
    """Rows without waves above a number of them a period."""
    waves = np.fft.rfft(rows)
    waves[..., highest + 1 :] = 0
    return np.fft.irfft(waves, rows.shape[-1])


# --- at a crawl -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("bench", [LOAD, BOTH_ENDS], ids=["held", "both ends"])
def test_at_a_crawl_it_is_the_equilibriums(bench: Bench, direction: float) -> None:
    # marks that are off, a reading that is wrong, and one that is right
    model = Model(SMALL, (*ERRORS, effect("sensor.index_offset", offset="20 deg")), bench=bench)
    reading = effect("sensor.encoder_eccentricity", cos="9 arcsec", sin="0 arcsec")
    found = speed_response(model.with_effects(reading), ["0.01 rpm"], torque="100 N*m", direction=direction)
    still = rverror.equilibrium(model, found.theta, torque="100 N*m", direction=direction).transmission_error
    np.testing.assert_allclose(found.crawl, still, atol=1e-12 * np.ptp(still))
    np.testing.assert_allclose(found.transmission_error[0], still, atol=1e-6 * np.ptp(still))


def test_far_below_all_frequencies_it_departs_with_the_square_of_the_speed() -> None:
    one, two = deviation(speed_response(Model(SMALL, ERRORS, bench=LOAD), ["0.2 rpm", "0.4 rpm"], torque="100 N*m"))
    assert np.abs(two).max() > 1e-9 * 1e-3
    np.testing.assert_allclose(two, 4 * one, atol=0.02 * np.abs(two).max())


# --- closed forms -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_heavy_load_on_the_train_is_the_textbooks_wavy_base(direction: float) -> None:
    """Input held: J y'' + c y' + k y = -J e'', so the error is e (1 + r^2 / (1 - r^2 + 2 i zeta r)).

    In reverse the angle falls with time, and what lags is ahead of it over the angle.
    """
    model = Model(UNIT, ERRORS[:1], bench=SWINGING)
    found = speed_response(model, ["20 rpm", "400 rpm", "900 rpm", "1500 rpm"], direction=direction)
    first = modes(model, direction=direction).frequency[0]
    at = found.order.tolist().index(40.0)
    share = 40 * found.speed / (2 * math.pi * UNIT.ratio) / first
    expected = 1 + share**2 / (1 - share**2 + 0.1j * direction * share)
    assert share[1] < 1 < share[-1]
    np.testing.assert_allclose(found.waves[:, at] / found.crawl_waves[at], expected, rtol=2e-3)


def test_the_peak_is_told_with_its_frequency_and_its_height() -> None:
    """Of the wavy base: at r = 1 the error is e (1 + 1 / (2 i zeta))."""
    model = Model(UNIT, ERRORS[:1], bench=SWINGING)
    first = modes(model).frequency[0]
    speed = 2 * math.pi * first * UNIT.ratio / 40
    found = speed_response(model, speed * np.linspace(0.8, 1.2, 41))
    top = found.critical_speeds[0]
    assert top.order == 40
    assert top.speed == pytest.approx(speed, rel=0.01)  # r = 1 + zeta^2 / 2
    assert top.growth == pytest.approx(abs(1 + 1 / 0.1j), rel=0.01)
    assert top.frequency == pytest.approx(first, rel=1e-3)
    assert not top.of_sun_support
    assert speed_response(model, speed * np.linspace(0.1, 0.3, 5)).critical_speeds == ()


def test_a_load_that_is_sped_up_winds_the_train_up_like_a_torque() -> None:
    """J Omega' (1 + dTheta/dtheta) more torque at the output."""
    model = Model(SMALL, bench=Bench(load_inertia="500 kg*m^2", damping_ratio=0.5))
    whole, _ = moving(model, torque=1e5, count=512)
    reduced = whole.reduced(99)
    acceleration = 0.01  # rad/s^2: 5 N*m
    wound = np.linalg.solve(reduced.stiffness, acceleration * reduced.forced.by_acceleration.T[..., None])[..., 0].T
    low, high = (
        rverror.equilibrium(Model(SMALL), whole.theta, torque=torque, direction=1.0).transmission_error
        for torque in (1e5, 1e5 + 500e3 * acceleration)
    )
    expected = (high - low) * (1 + slope(low, 1.0))
    # the train's own parts have some 1e-5 of the load's inertia
    np.testing.assert_allclose(reduced.error(wound, 0.0) - reduced.error(0 * wound, 0.0), expected, rtol=5e-5)


# --- the frames, read once more in the housing ------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_newtons_law_holds_in_the_housing(direction: float) -> None:
    """M (X'' + x_s'' + y'') + K y = 0 with centres, poses and stiffness as the housing sees them, undamped."""
    # a heavy load would have most of the answer, of which each part is found to 1e-7
    bench = replace(BOTH_ENDS, damping_ratio=0.0, load_inertia=5.0)
    model, speed = Model(SMALL, ERRORS, bench=bench), direction * 0.4
    whole, tangent = moving(model, torque=3e5, count=1024, direction=direction)
    train, reduced = whole.train, whole.reduced(99)
    moved = reduced.response(speed)
    y = reduced.pose(moved, speed, slice(None))
    centres = nominal_centres(train, whole.theta)
    inertia = train.mass[:, None] * speed**2 * slope(centres + train.pose(tangent.x).T + y, 1.0, 2)
    elastic = np.einsum("nij,jn->in", sum(train.stiffness(tangent).values()), y)
    # within 12 waves of the shortest, what turns with a disc is cut off in the housing
    left, size = np.abs(inertia + elastic).max(axis=1), np.abs(elastic).max(axis=1)
    assert (left < 5e-4 * size).all()


def nominal_centres(train: Train, theta: np.ndarray) -> np.ndarray:
    """Centres of the small train's discs and cranks in the nominal motion, mm, (size, n)."""
    centres = np.zeros((train.size, theta.size))
    for k in range(2):
        disc = SMALL.eccentricity * np.exp(1j * (-SMALL.disc_lobes * theta + math.pi * k))
        crank = SMALL.crank_radius * np.exp(1j * (theta + math.pi * k))
        for name, centre in ((f"disc {k}", disc), (f"crank {k}", crank)):
            centres[list(train.place(name)[:2])] = centre.real, centre.imag
    return centres


def test_accelerations_in_the_frames_are_those_in_the_housing() -> None:
    """With all modes kept a pose is T basis eta, and its acceleration T basis (eta'' + G eta' + S eta)."""
    whole, _ = moving(Model(SMALL, bench=BOTH_ENDS), torque=3e5, count=256)
    reduced = whole.reduced(99)
    own, rng = reduced.oscillator, np.random.default_rng(0)
    waves = np.array([np.cos(whole.theta), np.sin(3 * whole.theta), np.ones(256)])
    eta = rng.normal(size=(own.size, 3)) @ waves
    seen = slope(reduced.pose(eta, 0.0, slice(None)), 1.0, 2)
    told = slope(eta, 1.0, 2) + own.turning @ slope(eta, 1.0) + own.centrifugal @ eta
    np.testing.assert_allclose(reduced.pose(told, 0.0, slice(None)), seen, atol=1e-9 * np.abs(seen).max())


def test_what_is_sped_up_is_the_whole_motion() -> None:
    """Force of inertia per rad/s^2: mass times how poses and nominal places move with the angle."""
    whole, tangent = moving(Model(SMALL, ERRORS, bench=BOTH_ENDS), torque=3e5, count=1024)
    train, reduced = whole.train, whole.reduced(99)
    rate = slope(nominal_centres(train, whole.theta) + train.pose(tangent.x).T, 1.0)
    turns = {"carrier": 1, "disc 0": 1, "disc 1": 1, "load": 1, "crank 0": -11, "crank 1": -11, "sun": 37, "input": 37}
    for part, times in turns.items():
        rate[train.place(part)[-1]] += times
    # in coordinates of mass 1 a force is a motion
    told = reduced.pose(reduced.forced.by_acceleration, 0.0, slice(None))
    # within 12 waves of the shortest, what turns in one frame is cut off in the other
    np.testing.assert_allclose(smooth(told, 490), -smooth(rate, 490), atol=1e-9 * np.abs(rate).max())


def test_the_error_is_read_at_carrier_and_sun() -> None:
    model = Model(SMALL, ERRORS, bench=BOTH_ENDS)
    whole, tangent = moving(model, torque=3e5, count=512)
    reduced = whole.reduced(99)
    moved = reduced.response(2.0)
    y = reduced.pose(moved, 2.0, slice(None))
    sun, carrier = whole.train.place("sun")[2], whole.train.place("carrier")[2]
    expected = tangent.x[:, 2] + y[carrier] - y[sun] / SMALL.ratio
    np.testing.assert_allclose(reduced.error(moved, 2.0), expected, atol=1e-12 * np.ptp(expected))


def test_waves_of_the_equilibrium_that_the_samples_do_not_hold_drive_nothing() -> None:
    """Halfway poses tell a wave above half the samples from the one that it looks like."""
    model, count = Model(SMALL, ERRORS), 128
    fine, tangent = moving(model, torque=1e5, count=8 * count)
    coarse, tangents = moving(model, torque=1e5, count=count)
    whole = loaded_motion(coarse.train, tangents, coarse.theta, coarse.period, tangent.x[4::8])
    waves, folded, kept = (np.abs(np.fft.rfft(one)) / one.shape[-1] for one in (fine.state, coarse.state, whole.course))
    # order 120 shows at 8 in 128 samples; only what is above 192 folds of 256
    seen, left = (np.abs(one - waves[:, : count // 2 + 1])[:, 1:60] for one in (folded, kept))
    beyond = waves[:, 193:].sum(axis=1, keepdims=True)
    assert (left <= 1.01 * beyond).all()
    assert left.max() < 0.3 * seen.max()


def test_what_folds_in_the_stiffness_is_little(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pins lift off at a light load, so the stiffness jumps; with twice as many samples less of it folds."""
    pins = effect("cycloid.pin_position", pin=3, radial="5 um")
    model = Model(UNIT, (*ERRORS, pins), bench=Bench(load_inertia="5 kg*m^2"))
    few = speed_response(model, ["1000 rpm"], torque="20 N*m", kept=3)
    monkeypatch.setattr("rverror.dynamics.loaded_motion.samples_needed", lambda unit: 2 * samples_needed(unit))
    many = speed_response(model, ["1000 rpm"], torque="20 N*m", kept=3)
    assert many.theta.size == 2 * few.theta.size
    change = few.transmission_error - many.transmission_error[:, ::2]
    assert np.abs(change).max() < 0.005 * np.ptp(many.transmission_error)
    assert np.ptp(deviation(many)) > 0.02 * np.ptp(many.crawl)


# --- by effect --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_effects_and_the_load_add_up(direction: float) -> None:
    """Each is solved by itself.  Contacts lift off, a reading is wrong, marks are off."""
    more = (
        effect("crank.bearing_clearance", clearance="2 um"),
        effect("sensor.index_offset", offset="20 deg"),
        effect("sensor.encoder_eccentricity", cos="9 arcsec"),
        effect("load.torsion", compliance="1e-9 rad/(N*mm)"),
    )
    model = Model(SMALL, (*ERRORS, *more), bench=BOTH_ENDS)
    found = speed_response(model, ["0 rpm", "100 rpm", "300 rpm"], torque="20 N*m", direction=direction, by_effect=True)
    assert found.by_effect is not None
    size = np.ptp(found.transmission_error)
    np.testing.assert_allclose(found.by_effect.sum(axis=0), found.transmission_error, atol=1e-9 * size)
    assert np.abs(found.by_effect[:4].mean(axis=2)).max() > 0
    assert not found.by_effect[4:6].any()
    np.testing.assert_allclose(found.by_effect[6], -direction * 20e3 * 1e-9, rtol=1e-9)
    np.testing.assert_allclose(found.effect_waves.sum(axis=0), found.waves, atol=1e-9 * size)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_each_effect_is_what_the_error_is_without_it_less(direction: float) -> None:
    """While no contact opens; at speeds about the natural frequency of the load."""
    tiny = tuple(replace(one, values=tuple(1e-3 * value for value in one.values)) for one in ERRORS)
    first = modes(Model(UNIT, bench=SWINGING), direction=direction).frequency[0]
    given = {"input_speeds": 2 * math.pi * first * UNIT.ratio / 40 * np.array([0.5, 1.0, 1.4]), "direction": direction}
    found = speed_response(Model(UNIT, tiny, bench=SWINGING), by_effect=True, **given)
    assert found.by_effect is not None
    for at in range(len(tiny)):
        less = speed_response(Model(UNIT, (*tiny[:at], *tiny[at + 1 :]), bench=SWINGING), **given)
        own = found.transmission_error - less.transmission_error
        # a few of all pins are about to open somewhere
        np.testing.assert_allclose(found.by_effect[at], own, atol=1e-3 * np.abs(own).max())
    none = speed_response(Model(UNIT, bench=SWINGING), **given)
    np.testing.assert_allclose(found.by_effect[-1], none.transmission_error, atol=1e-3 * np.ptp(own))


def test_effects_that_were_not_asked_for_are_not_there() -> None:
    found = speed_response(Model(SMALL, ERRORS), ["100 rpm"], torque=1e5)
    assert found.by_effect is None
    with pytest.raises(rverror.InputError, match=r"call speed_response with by_effect=True"):
        found.effect_waves  # noqa: B018


# --- what must hold of any train --------------------------------------------------------------------------------------


def test_heavier_parts_do_the_same_at_a_lower_speed() -> None:
    """All inertias times 4: the same error at half the speed, by order and in all."""
    model = Model(SMALL, ERRORS, bench=LOAD)
    own = modes(model, torque=1e5).inertia
    heavy = Inertia(**{name: 4 * getattr(own, name) for name in Inertia.__dataclass_fields__})
    ends = replace(LOAD, load_inertia=4 * LOAD.load_inertia)
    light = speed_response(model, ["80 rpm", "300 rpm"], torque=1e5, kept=8)
    slow = speed_response(
        Model(variant(SMALL, inertia=heavy), ERRORS, bench=ends), ["40 rpm", "150 rpm"], torque=1e5, kept=8
    )
    assert np.abs(deviation(light)).max() > 0.05 * np.ptp(light.crawl)
    np.testing.assert_allclose(slow.transmission_error, light.transmission_error, atol=1e-5 * np.ptp(light.crawl))


@pytest.mark.parametrize("kept", [1, 3, 8])
def test_modes_that_follow_as_springs_are_whole_at_a_crawl(kept: int) -> None:
    """Inertia of the equilibrium's motion bends the train as a force does, however many modes keep theirs."""
    bench = replace(BOTH_ENDS, load_inertia=5.0)  # as light as the parts, so that all are found to as many digits
    whole, _ = moving(Model(SMALL, ERRORS, bench=bench), torque=1e5, count=1024)
    found = []
    for reduced in (whole.reduced(kept), whole.reduced(99)):
        moved = reduced.response(1e-3)
        found.append(
            (reduced.pose(moved, 1e-3, slice(None)), reduced.error(moved, 1e-3) - reduced.error(0 * moved, 0.0))
        )
    (few, few_error), (every, every_error) = found
    size = np.abs(every).max(axis=1, keepdims=True)
    assert (np.abs(few - every) < 1e-3 * size).all()
    np.testing.assert_allclose(few_error, every_error, atol=1e-3 * np.abs(every_error).max())


def test_modes_that_follow_as_springs_change_little() -> None:
    model = Model(SMALL, ERRORS, bench=LOAD)
    every, few = (speed_response(model, ["100 rpm", "250 rpm"], torque=1e5, kept=kept) for kept in (None, 99))
    assert every.frequency.size < few.frequency.size
    size = np.abs(deviation(few)).max(axis=1, keepdims=True)
    assert (np.abs(every.transmission_error - few.transmission_error) < 0.03 * size).all()


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_an_integration_in_time_stays_on_the_harmonic_balance(direction: float) -> None:
    """A quarter of a turn of a train, of whose kinks the samples hold every wave."""
    model, count = Model(SMALL, ERRORS, bench=replace(LOAD, damping_ratio=0.1)), 2048
    whole, _ = moving(model, torque=3e5, count=count, direction=direction)
    reduced, speed = whole.reduced(3), direction * 0.8
    own = reduced.oscillator
    system = replace(own, stiffness=smooth(own.stiffness, 200), damping=smooth(own.damping, 200))
    forced = replace(reduced.forced, oscillator=system, by_speed=smooth(reduced.forced.by_speed, 200))
    moved = system.response(speed**2 * forced.by_speed, speed=speed)
    rate = speed * slope(moved, 1.0)
    steps = np.arange(0, count // 4 + 1, 8)
    y, _ = forced.in_time(
        lambda time: (speed * time, speed, 0.0),
        steps / count * 2 * math.pi / abs(speed),
        start=(moved[:, 0], rate[:, 0]),
    )
    np.testing.assert_allclose(y, moved[:, (int(direction) * steps) % count], atol=1e-4 * np.abs(moved).max())


@pytest.mark.parametrize(("key", "period"), [("involute.sun_eccentricity", 3), ("involute.sun_offset", 1)])
def test_a_broken_ratio_takes_as_many_turns_as_its_errors_do(key: str, period: int) -> None:
    """R = 1 + 28/9 * 12 = 38 1/3: the sun's error comes back after three turns, what is held after one."""
    unit = variant(SMALL, planet_teeth=28)
    model = Model(unit, (*ERRORS, effect(key, x="5 um", y="0 um")), bench=LOAD)
    found = speed_response(model, ["100 rpm"], torque=1e5)
    assert found.period == period
    assert found.theta[-1] < 2 * math.pi * period < found.theta[-1] + 2 * found.theta[1]
    further = found.theta + 2 * math.pi * period
    again = rverror.equilibrium(model, further, torque=1e5, direction=1.0).transmission_error
    np.testing.assert_allclose(again, found.crawl, atol=1e-9 * np.ptp(found.crawl))


def test_errors_that_repeat_after_too_many_turns_are_refused() -> None:
    unit = variant(UNIT, sun_teeth=29, planet_teeth=30)
    model = Model(unit, (effect("involute.sun_eccentricity", x="5 um"),))
    with pytest.raises(rverror.InputError, match=r"ratio = 42\.3793: the error repeats after 29 output turns only"):
        speed_response(model, ["100 rpm"])


@settings(max_examples=5, deadline=None)
@given(unit=reducers(), turn=st.floats(0.2, 4), sign=st.sampled_from([-1.0, 1.0]), kept=st.integers(1, 6))
def test_any_train_has_its_periodic_motion(unit: Reducer, turn: float, sign: float, kept: int) -> None:
    """What is left of M y'' + C y' + K y + M (X'' + x_s'') in the coordinates that are kept.

    An answer is given to 1e-8 of the force, as modes have it; what GMRES does not reach is refused.
    """
    errors = (ERRORS[0], effect("cycloid.disc_pitch", disc=0, harmonic=1, cos="4 um"), ERRORS[2])
    whole, _ = moving(Model(unit, errors, bench=BOTH_ENDS), torque=1e5, count=samples_needed(unit), direction=sign)
    reduced, speed = whole.reduced(kept), sign * turn
    own, force = reduced.oscillator, speed**2 * reduced.forced.by_speed
    try:
        moved = reduced.response(speed)
    except rverror.InputError as refused:
        if "of the force is left" not in str(refused):
            raise
        reject()
    first, second = (speed**power * slope(moved, 1.0, power) for power in (1, 2))
    stiffness = own.stiffness + speed**2 * own.centrifugal[..., None]
    damping = own.damping + speed * own.turning[..., None]
    left = second + np.einsum("ijn,jn->in", damping, first) + np.einsum("ijn,jn->in", stiffness, moved) - force
    # a second derivative has the rounding of what it is taken of times the square of the shortest wave
    rounding = np.finfo(float).eps * (speed * own.count / 2) ** 2 * np.linalg.norm(moved)
    _, modes = own.mean_modes
    least = 1e-8 * np.linalg.norm(modes.T @ force) + np.linalg.norm(modes, 2) * rounding
    assert np.linalg.norm(modes.T @ left) < least


# --- contacts that would have to pull ---------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_contacts_would_have_to_pull_where_the_load_swings_by_more_than_its_torque(direction: float) -> None:
    """The torque of inertia, J (order Omega)^2 amplitude, against the load's."""
    model = Model(UNIT, ERRORS[:1], bench=SWINGING)
    speed = 2 * math.pi * modes(model, direction=direction).frequency[0] * UNIT.ratio / 40
    found = speed_response(model, [0.1 * speed, speed], torque="60 N*m", direction=direction)
    swing = 500e3 * (40 * found.speed / UNIT.ratio) ** 2 * np.abs(found.waves[:, found.order.tolist().index(40.0)])
    assert swing[0] < 0.1 * 60e3
    assert swing[1] > 1.5 * 60e3
    assert found.pulled["flanks"][0] == found.pulled["pins"][0] == 0
    # flanks carry the torque and nothing else: what pulls is what swings beyond it
    assert found.pulled["flanks"][1] == pytest.approx(swing[1] / 60e3 - 1, rel=0.05)
    assert found.pulled["pins"][1] > 0.1


# --- the way in -------------------------------------------------------------------------------------------------------


def test_speeds_that_are_none_are_refused() -> None:
    for speeds in ([], [-1.0], [[1.0]], ["3 m"], ["fast"]):
        with pytest.raises(rverror.InputError, match=r"^input_speeds: "):
            speed_response(Model(UNIT), speeds)
    with pytest.raises(rverror.InputError, match=r"dynamics need a \[reducer\] model"):
        speed_response(Model(rverror.Drive(ratio=14.0)), [1.0])
    stiff = Stiffness(pin_contact=1e6)
    assert speed_response(Model(variant(SMALL, stiffness=stiff)), "100 rpm", torque=1e5).speed == [100 * RPM]


def test_speeds_of_a_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, path, out = Model(UNIT, ERRORS[:1], bench=SWINGING), tmp_path / "m.toml", tmp_path / "o.json"
    rverror.save_model(path, model)
    span = ["--from", "560 rpm", "--to", "760 rpm", "--count", "21"]
    assert (
        main(
            [
                "speeds",
                str(path),
                *span,
                "--torque",
                "60 N*m",
                "--direction",
                "reverse",
                "--by-effect",
                "--json",
                str(out),
                "--plot",
                str(tmp_path / "o.png"),
            ]
        )
        == 0
    )
    assert (tmp_path / "o.png").read_bytes().startswith(b"\x89PNG")
    told, speeds = json.loads(out.read_text())["variables"], np.linspace(560, 760, 21) * RPM
    found = speed_response(model, speeds, torque=60e3, direction=-1.0)

    def waves_of(name: str) -> Any:
        amplitude, phase = (np.array(told[f"{part}{name}"]["values"]) for part in ("amplitude", "phase"))
        return amplitude * np.exp(1j * np.radians(phase))

    assert told["order"]["values"] == found.order.tolist()
    assert told["speed"]["values"] == pytest.approx((speeds / RPM).tolist())
    assert told["peak_to_peak"]["values"] == pytest.approx((np.ptp(found.transmission_error, axis=1) / ARCSEC).tolist())
    for waves, error in zip(waves_of(""), found.transmission_error, strict=True):
        # the waves make the error, but for what is below a hundredth of the largest
        made = (waves[:, None] * np.exp(1j * np.outer(found.order, found.theta))).real.sum(axis=0)
        left = error / ARCSEC - error.mean() / ARCSEC - made
        assert np.abs(left).max() < 0.05 * np.abs(made).max()
    assert told["effect"]["values"][1:] == ["load"]
    whole = found.waves / ARCSEC
    np.testing.assert_allclose(waves_of("_by_effect").sum(axis=0), whole, atol=1e-6 * np.abs(whole).max())
    assert told["critical_order"]["values"][0] == 40
    assert told["critical_speed"]["values"][0] == pytest.approx(found.critical_speeds[0].speed / RPM)
    printed = capsys.readouterr().out
    assert printed.startswith("Speed response: RV-40E, 60 N*m, reverse, 21 input speeds\n")
    assert "Critical speeds\n---------------\nspeed, rpm  order" in printed
    assert re.search(r"closed flanks would have to pull at \d+ speeds of [\d.]+ to [\d.]+ rpm", printed)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--from", "5 rpm", "--to", "5 rpm"], "speeds must grow"),
        (["--from", "5", "--to", "9 rpm"], "--from: '5' has no unit; write it like '100 rpm'"),
        (["--from", "5 rpm", "--to", "9 rpm", "--count", "1"], "--count: 1 is below 2; give 2 or more"),
    ],
)
def test_spans_that_are_none_are_refused(
    options: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    rverror.save_model(tmp_path / "m.toml", Model(UNIT))
    assert main(["speeds", str(tmp_path / "m.toml"), *options]) == 2
    assert said in capsys.readouterr().err


def test_the_meshes_drive_at_most_their_highest_order_at_the_output_s_speed() -> None:
    """6000 rpm of an RV-40E are 100 / 121 turns of the output a second, its cycloid mesh 1560 waves a turn."""
    driven = driven_frequency(rverror.reducer("RV-40E"), 200 * math.pi)
    assert driven == pytest.approx(1560 * 100 / 121)
