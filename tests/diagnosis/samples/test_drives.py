"""The closed loop on geared drives: truth made here, coloured noise, and recordings that nobody here made."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.signal import lfilter

import rverror
from recordings import recording
from rverror.app import command_line as cli
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.account import blocks
from rverror.diagnosis.gears.spectrum import line_spectrum
from rverror.diagnosis.samples.drives import diagnose_drive
from rverror.diagnosis.samples.records import records_of_drive
from rverror.model.model_file import load_model
from rverror.model.sensor import slope
from rverror.runs.measurement import Run, load_run
from rverror.runs.noise import RunNoise

ARCMIN = 60 * ARCSEC
DRIVE = rverror.Model(rverror.Drive(ratio=20.0, shafts={"motor": 20.0, "idler": 7.0}))


def red(seed: int, n: int, memory: float) -> np.ndarray:
    """Autoregressive noise of standard deviation 1."""
    steps = np.random.default_rng(seed).normal(size=n + 2000)
    return np.asarray(lfilter([math.sqrt(1 - memory**2)], [1, -memory], steps)[2000:])


def turns(n: int = 2048, count: float = 4) -> tuple[np.ndarray, np.ndarray]:
    """Time and output angle of one direction at constant speed."""
    return 0.01 * np.arange(n), 2 * np.pi * count * np.arange(n) / n


def sine(seed: int = 0, n: int = 1500) -> tuple[np.ndarray, np.ndarray]:
    """Eight cycles of 57 deg peak-to-peak, with times that jitter."""
    time = np.sort(np.linspace(0, 16, n) + np.random.default_rng(1000 + seed).uniform(-1e-3, 1e-3, n))
    return time, 0.5 * np.sin(np.pi * time)


def record(time: np.ndarray, theta: np.ndarray, error: np.ndarray) -> Run:
    """Run of an error in arcsec."""
    return rverror.run_from_arrays(input_angle=20 * theta, te=error * ARCSEC, time=time, direction="mixed")


def keys(found: rverror.Diagnosis) -> list[str]:
    return [addition.effect.key for addition in found.added]


# --- noise alone ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("memory", [0.0, 0.9, 0.99])
@pytest.mark.parametrize("motion", [turns, lambda: turns(800, 0.3), sine], ids=["turns", "short", "sine"])
def test_noise_alone_seldom_gets_an_effect(motion: Any, memory: float) -> None:
    """Each is allowed 0.2 %: two of eight have a chance of 1e-4."""
    time, theta = motion()
    found = [diagnose_drive(DRIVE, [record(time, theta, red(seed, time.size, memory))]) for seed in range(8)]
    assert sum(d.verdict != "nothing_missing" for d in found) <= 1
    quiet = next(d for d in found if d.verdict == "nothing_missing")
    assert quiet.added == ()
    assert quiet.after == quiet.before
    assert quiet.before.rms / ARCSEC == pytest.approx(np.std(red(found.index(quiet), time.size, memory)), rel=1e-6)


def walk(seed: int, n: int, step: float, white: float = 0.3) -> np.ndarray:
    """A random walk beside white noise."""
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.normal(0, step, n)) + rng.normal(0, white, n)


@pytest.mark.parametrize("step", [0.005, 0.05, 1.0])
def test_a_random_walk_alone_seldom_gets_an_effect(step: float) -> None:
    """Over one turn a slope and a wave of order 1 are the walk's: beside noise without them most had one."""
    time, theta = turns(1500, 1)
    found = [diagnose_drive(DRIVE, [record(time, theta, walk(seed, time.size, step))]) for seed in range(8)]
    assert sum(d.added != () for d in found) <= 1
    quiet = next(d for d in found if d.verdict == "nothing_missing")
    assert quiet.noise_rms == pytest.approx(quiet.after.rms, rel=0.25)


def test_samples_that_say_the_same_are_not_counted_twice() -> None:
    """The same noise, read ten times as densely, must not make an interval tighter."""
    time, theta = turns(400)
    error = 3 * np.cos(20 * theta) + red(5, 400, 0.5)
    dense = np.linspace(0, time[-1], 4000)
    once = diagnose_drive(DRIVE, [record(time, theta, error)])
    often = diagnose_drive(DRIVE, [record(dense, np.interp(dense, time, theta), np.interp(dense, time, error))])
    few, many = once.added[0], often.added[0]
    assert few.effect.indices == many.effect.indices == {"shaft": "motor", "harmonic": 1}
    widths = [a.estimates[0].high - a.estimates[0].low for a in (few, many)]
    assert widths[1] > 0.6 * widths[0]


# --- known truth ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("memory", [0.0, 0.9])
@pytest.mark.parametrize("motion", [turns, sine], ids=["turns", "sine"])
def test_intervals_cover_the_truth(motion: Any, memory: float) -> None:
    inside = []
    for seed in range(12):
        time, theta = motion()
        error = 2 * np.cos(20 * theta) - np.sin(20 * theta) + red(seed, time.size, memory)
        (added,) = diagnose_drive(DRIVE, [record(time, theta, error)]).added
        assert added.effect.indices == {"shaft": "motor", "harmonic": 1}
        assert ("sensor.input_coupling", {"harmonic": 1}) in added.indistinguishable
        cos, sin = added.estimates
        inside += [cos.low < 2 * ARCSEC < cos.high, sin.low < -ARCSEC < sin.high]
    # 95 % of 24: fewer than 19 inside have a chance of 1e-3
    assert sum(inside) >= 19


def test_an_effect_that_the_noise_hides_is_missed_and_a_larger_one_found() -> None:
    time, theta = turns()
    found = {}
    for size in (0.02, 1.0):
        runs = [record(time, theta, size * np.cos(7 * theta) + red(seed, time.size, 0.9)) for seed in range(6)]
        found[size] = sum(keys(diagnose_drive(DRIVE, [run])) == ["shaft.eccentricity"] for run in runs)
    # the noise's spectrum is 19 times white at low orders, sqrt(2 * 19 / 2048) = 0.14: 0.15 and 7 standard deviations
    assert found == {0.02: 0, 1.0: 6}


def test_growing_errors_of_a_mixed_run_are_told_apart() -> None:
    """Ratio error follows the angle, a time offset the speed, drift the time: sine motion tells all three."""
    time, theta = sine()
    speed = 0.5 * np.pi * np.cos(np.pi * time)
    error = 200 * theta + 1e-3 * speed / ARCSEC + 30 * time / 16 + red(2, time.size, 0.8)
    found = diagnose_drive(DRIVE, [record(time, theta, error)])
    assert set(keys(found)) == {"sensor.ratio_error", "sensor.time_offset", "sensor.drift"}
    truth = {"sensor.ratio_error": 200 * ARCSEC, "sensor.time_offset": 1e-3, "sensor.drift": 30 * ARCSEC}
    for addition in found.added:
        (estimate,) = addition.estimates
        low, high = estimate.low, estimate.high
        reach = 1.6 * (high - low) / 2  # three standard deviations
        assert abs(estimate.value - truth[addition.effect.key]) < reach


@pytest.mark.parametrize("size", [4.0, 30.0])
def test_a_worm_is_told_beside_a_drift_over_a_small_part_of_a_turn(size: float) -> None:
    """Over a fortieth of a turn an encoder's order is no more than the slope, which goes first in the answer.

    Noise that is told before the slope is out would be a walk, which hides it.
    """
    drive = rverror.Model(rverror.Drive(ratio=225.0, shafts={"worm": 225.0}))
    time, theta = turns(500, 1 / 40)
    share = time / time[-1]
    error = 12 * share + 1.2 * share**2 + size * np.cos(225 * theta) + 0.45 * red(0, time.size, 0.9)
    run = rverror.run_from_arrays(input_angle=225 * theta, te=error * ARCSEC, time=time, direction="forward")
    growing, worm = diagnose_drive(drive, [run]).added
    assert growing.effect.key in ("sensor.drift", "sensor.ratio_error")
    assert worm.orders == (225.0,)
    assert worm.estimates[0].value == pytest.approx(size * ARCSEC, abs=0.3 * ARCSEC)


def test_what_bends_over_the_angle_is_said_of_a_part_of_a_turn() -> None:
    time, theta = sine()
    found = diagnose_drive(DRIVE, [record(time, theta, 40 * (theta / 0.5) ** 2 + red(9, time.size, 0.8))])
    assert found.added == ()
    assert any("slow curvature over the angle, 40" in note or "over the angle, 39" in note for note in found.notes)


def test_a_cause_that_shows_has_no_rival_of_another_waveform() -> None:
    """0.3 arcsec of the idler lie ten standard deviations from nothing."""
    time, theta = turns()
    found = diagnose_drive(DRIVE, [record(time, theta, 0.3 * np.cos(7 * theta) + red(10, time.size, 0.0))])
    (idler,) = found.added
    assert idler.effect.indices == {"shaft": "idler", "harmonic": 1}
    assert idler.indistinguishable == ()


def test_traces_of_a_run_that_turns_both_ways_are_means_of_its_passes() -> None:
    """Eight cycles pass each angle eight times in each direction: noise of 1 becomes one of 0.35."""
    time, theta = sine()
    found = diagnose_drive(DRIVE, [record(time, theta, 5 * np.cos(20 * theta) + red(11, time.size, 0.0))])
    assert [trace.direction for trace in found.traces] == [1.0, -1.0]
    for trace in found.traces:
        assert np.diff(trace.theta) == pytest.approx(np.full(trace.theta.size - 1, np.diff(trace.theta).mean()))
        wave = 5 * np.cos(20 * trace.theta)
        off = trace.measured / ARCSEC - (wave - wave.mean())
        assert np.std(off) < 0.5


def test_stretches_of_a_run_that_turns_both_ways_follow_one_another_in_time() -> None:
    time, theta = sine()
    (own,), _ = records_of_drive(DRIVE, [record(time, theta, red(12, time.size, 0.0))])
    assert blocks(own).tolist() == np.minimum(np.arange(1500) * 6 // 1499, 5).tolist()


def test_over_whole_turns_ratio_error_and_encoder_are_told_apart() -> None:
    time, theta = turns(count=3)
    error = 5 * theta + 8 * np.cos(theta) + red(3, time.size, 0.8)
    found = diagnose_drive(DRIVE, [record(time, theta, error)])
    assert "sensor.encoder_eccentricity" in keys(found)
    assert not any("sensor.encoder_eccentricity" in dict(a.indistinguishable) for a in found.added)


def test_lost_motion_is_said_with_its_size() -> None:
    time, theta = sine()
    error = 6 * np.sign(np.cos(np.pi * time)) + red(4, time.size, 0.5)
    found = diagnose_drive(DRIVE, [record(time, theta, error)])
    assert "sensor.time_offset" not in keys(found)
    (said,) = (note for note in found.notes if "lost motion" in note)
    assert float(said.split("lost motion, ")[1].split()[0]) == pytest.approx(12, rel=0.05)


def test_a_line_outside_the_catalogue_is_unexplained_and_not_blamed_on_a_neighbour() -> None:
    """Its power leaks over all orders of so short a run; the idler's 14 is 3 cycles away, the motor's 20 is 4.2."""
    time, theta = turns(1600, 1.2)
    error = 5 * np.cos(16.5 * theta + 1) + red(6, time.size, 0.8)
    found = diagnose_drive(DRIVE, [record(time, theta, error)])
    assert found.verdict == "unexplained"
    assert found.added == ()
    line = found.unexplained[0]
    assert line.order == pytest.approx(16.5, abs=0.1)
    assert line.low < 5 * ARCSEC < line.high
    assert line.frames == ()


def test_a_worm_is_named_beside_a_second_line_on_a_random_walk() -> None:
    """8.7 arcsec of the shaft and 4.5 at 8/3 of its order, over four turns: a line is no noise of its neighbours.

    By the walk alone both waves of the shaft have a standard deviation of 1.1 arcsec, so nearly all recordings tell it.
    """
    drive, named = rverror.Model(rverror.Drive(ratio=360.0, shafts={"worm": 360.0})), 0
    for seed in range(20, 30):
        rng = np.random.default_rng(seed)
        turned = np.linspace(0, 4.13 * 2 * np.pi, 3520)
        walk = np.cumsum(rng.normal(0, 0.35, turned.size)) + rng.normal(0, 0.4, turned.size)
        first, second = rng.uniform(0, 2 * np.pi, 2)
        error = 8.7 * np.cos(turned + first) + 4.5 * np.cos(8 / 3 * turned + second) + walk
        run = rverror.run_from_arrays(input_angle=turned, output_angle=turned / 360 + error * ARCSEC, direction=1.0)
        found = rverror.diagnose(drive, [run])
        assert {a.effect.key for a in found.added} <= {"shaft.eccentricity", "sensor.ratio_error"}
        named += any(a.effect.indices.get("harmonic") == 1 for a in found.added)
    assert named >= 8


def test_a_size_that_no_workshop_makes_gives_way_to_a_plausible_cause() -> None:
    """Over 40 deg a slope of 4 % could be an encoder eccentricity of degrees."""
    time, theta = turns(1000, 0.11)
    found = diagnose_drive(DRIVE, [record(time, theta, 0.04 * theta / ARCSEC + 100 * red(7, time.size, 0.9))])
    assert keys(found)[0] in ("sensor.ratio_error", "sensor.drift")
    assert "sensor.encoder_eccentricity" in [key for key, _ in found.added[0].indistinguishable]
    assert "a run over a whole output turn or more: over 39.6 deg" in rverror.to_text(found)


@pytest.mark.parametrize(("size", "said"), [(0.0, True), (60.0, False)])
def test_an_error_that_is_the_rounding_of_one_encoder_is_said(size: float, said: bool) -> None:
    """A controller that divides the motor's encoder by the ratio and rounds to 16 bits calls that its output."""
    time, theta = turns(600, 1.3)
    theta = theta + 0.02 * np.sin(3 * theta)
    step = 2 * np.pi / 2**16
    output = np.round((theta + size * ARCSEC * np.cos(20 * theta)) / step) * step
    found = rverror.diagnose(DRIVE, [rverror.run_from_arrays(input_angle=20 * theta, output_angle=output, time=time)])
    assert any("rounding of output_angle, which is stored in steps of 19.78 arcsec" in n for n in found.notes) == said


def test_runs_are_weighted_by_their_own_noise() -> None:
    time, theta = turns(1024)
    quiet = record(time, theta, np.cos(7 * theta) + 0.1 * red(8, 1024, 0.5))
    loud = record(time, theta, np.cos(7 * theta) + 10 * red(9, 1024, 0.5))
    one = diagnose_drive(DRIVE, [quiet]).added[0].estimates[0]
    both = diagnose_drive(DRIVE, [loud, quiet]).added[0].estimates[0]
    assert both.high - both.low == pytest.approx(one.high - one.low, rel=0.15)
    with pytest.raises(rverror.InputError, match="run 1: index is 'unknown'"):
        diagnose_drive(DRIVE, [replace(quiet, index="unknown"), loud])


def test_a_declared_growing_error_is_refitted_within_its_uncertainty() -> None:
    time, theta = sine()
    declared = rverror.effect("sensor.time_offset", offset="1 ms", uncertainty="0.2 ms")
    error = 1.1e-3 * 0.5 * np.pi * np.cos(np.pi * time) / ARCSEC + red(1, time.size, 0.5)
    found = diagnose_drive(DRIVE.with_effects(declared), [record(time, theta, error)])
    assert found.verdict == "nothing_missing"
    assert found.model.effects[0].values[0] == pytest.approx(1.1e-3, rel=0.01)
    assert found.before.rms > 5 * found.before_refitted.rms


def torque_record(seed: int) -> Run:
    time, theta = turns(6000, 9.3)
    torque = 7 + 1.3 * np.cos(20 * theta) + 0.7 * np.sin(7 * theta) + 0.4 * np.cos(33 * theta) + red(seed, 6000, 0.5)
    return Run(output_angle=theta, direction=np.ones(6000), time=time, torque_record=1e3 * torque)


def test_a_torque_record_is_told_by_its_lines_and_adds_nothing_to_the_model() -> None:
    found = diagnose_drive(DRIVE, [torque_record(0)])
    assert found.quantity == "torque"
    assert found.model == DRIVE
    assert [a.orders for a in found.added] == [(20.0,), (7.0,)]
    for addition, size in zip(found.added, (1.3e3, 0.7e3), strict=True):
        values = [e.value for e in addition.estimates]
        assert math.hypot(*values) == pytest.approx(size, rel=0.1)
        assert {e.dimension for e in addition.estimates} == {"torque"}
    (line,) = found.unexplained
    assert line.order == 33
    assert line.low < 0.4e3 < line.high
    assert line.low < line.amplitude < line.high
    (trace,) = found.traces
    for row in (trace.measured, trace.residual[0]):
        assert np.std(row) == pytest.approx(1e3 * math.sqrt((1.3**2 + 0.7**2 + 0.4**2) / 2), rel=0.1)
    with pytest.raises(rverror.InputError, match="torque records"):
        diagnose_drive(DRIVE, [torque_record(0), record(*turns(), red(0, 2048, 0.5))])


# --- the parts --------------------------------------------------------------------------------------------------------


def test_speed_from_jittering_times_is_not_too_small() -> None:
    """Differences of neighbours would have errors as large as themselves, and attenuate the fitted offset."""
    time, theta = sine(3, 6000)
    read = theta + 1e-3 * np.random.default_rng(0).normal(size=6000)
    true = 0.5 * np.pi * np.cos(np.pi * time)

    def factor(speed: np.ndarray) -> float:
        return float(speed @ true / (speed @ speed))

    assert factor(slope(read, time)) == pytest.approx(1, abs=0.02)
    assert factor(np.gradient(read, time)) < 0.9


def test_line_spectrum_is_that_of_the_sums_written_out() -> None:
    rng = np.random.default_rng(0)
    theta = np.sort(rng.uniform(0, 9, 700))
    signal = rng.normal(size=700)
    noise = RunNoise(np.zeros(0), float(np.std(signal)))
    order, power = line_spectrum(theta, signal, noise, 1.0, 100.0)
    for i in (5, 50, 300):
        direct = abs(np.exp(-1j * order[i] * theta) @ signal) ** 2 / (noise.sigma**2 * 700 / 2)
        assert power[i] == pytest.approx(direct, rel=0.1, abs=0.05)
    assert np.mean(power) == pytest.approx(2, rel=0.1)


def test_line_spectrum_of_a_run_that_stands_still_at_times() -> None:
    """A walk has no bound at frequency 0, where its runs hold no wave: lines of the motion show all the same."""
    theta = np.concatenate([np.zeros(200), np.linspace(0, 9, 800)])
    noise = RunNoise(np.zeros(0), 1.0, walk=0.01)
    _, power = line_spectrum(theta, np.cos(40 * theta), noise, 1.0, 100.0)
    assert power.max() > 50


# --- recordings -------------------------------------------------------------------------------------------------------


def on_the_command_line(name: str, tmp_path: Path) -> dict[str, Any]:
    folder = recording(name)
    out = tmp_path / "found.json"
    assert cli.main(["diagnose", str(folder / "model.toml"), str(folder / "run.csv"), "--json", str(out)]) == 0
    return dict(json.loads(out.read_text(encoding="utf-8")))


def test_planetary_actuator(tmp_path: Path) -> None:
    found = on_the_command_line("planetary-14to1", tmp_path)
    ratio, offset, *rest = found["added"]
    assert ratio["key"] == "sensor.ratio_error"
    slope = ratio["parameters"]["slope"]
    assert 14 / (1 + slope["value"] / 1_296_000) == pytest.approx(13.16, abs=0.05)
    alike = [other["key"] for other in ratio["indistinguishable_from"]]
    assert "sensor.encoder_eccentricity" in alike
    assert offset["key"] == "sensor.time_offset"
    delay = offset["parameters"]["offset"]
    assert delay["unit"] == "ms"
    assert 0 < delay["low"] < 0.70 < delay["high"] + 0.02
    assert delay["value"] == pytest.approx(0.70, abs=0.05)
    assert offset["heldout_rms_arcsec"] / 60 < 7.1
    motor = [a["indices"] for a in rest if a["key"] == "shaft.eccentricity"]
    assert motor[:2] == [{"shaft": "motor", "harmonic": 1}, {"shaft": "motor", "harmonic": 2}]
    assert found["after"]["rms_arcsec"] / 60 < 2.5
    assert found["before"]["rms_arcsec"] / 60 > 50
    assert any("slow curvature" in note for note in found["notes"])


def test_planetary_actuator_says_what_would_separate_its_ratio_from_its_encoder() -> None:
    folder = recording("planetary-14to1")
    model = load_model(folder / "model.toml")
    found = diagnose_drive(model, [load_run(folder / "run.csv", model)])
    (step,) = (step for step in rverror.to_json(found)["next_measurements"] if step["name"] == "whole turn")
    assert "over 40 deg sensor.ratio_error cannot be distinguished from sensor.encoder_eccentricity" in step["why"]
    assert step["about"]["key"] == "sensor.ratio_error"


@pytest.mark.parametrize(("name", "order", "rms"), [("worm-225", 225, 0.55), ("worm-360", 360, 1.75)])
def test_worm_drive(name: str, order: int, rms: float, tmp_path: Path) -> None:
    found = on_the_command_line(name, tmp_path)
    worm = next(a for a in found["added"] if a["key"] == "shaft.eccentricity")
    assert worm["indices"] == {"shaft": "worm", "harmonic": 1}
    assert worm["orders"] == [order]
    assert found["after"]["rms_arcsec"] < rms


@pytest.mark.parametrize(("name", "order", "rms"), [("worm-225", 225, 0.55), ("worm-360", 360, 1.75)])
def test_worm_drive_with_one_order_beside_its_drift(name: str, order: int, rms: float) -> None:
    """The size that was found, and a parabola over time for the drift, leave what the careful analysis says."""
    folder = recording(name)
    model = load_model(folder / "model.toml")
    run = load_run(folder / "run.csv", model)
    found = diagnose_drive(model, [run])
    (effect,) = (a.effect for a in found.added if a.orders == (order,))
    left = run.error(model) - rverror.transmission_error(
        rverror.Model(model.mechanism, (effect,)), run.nominal_angle(model), time=run.time
    )
    drift = np.polynomial.Polynomial.fit(run.time, left, 2)
    assert np.std(left - drift(run.time)) / ARCSEC < rms


def test_cycloidal_drive_torque() -> None:
    folder = recording("cycloidal-13to1")
    time, turned, torque = np.loadtxt(folder / "run.csv", delimiter=",", skiprows=3).T
    angle, ahead = 2 * np.pi * turned, np.ones(time.size)
    run = Run(output_angle=angle, direction=ahead, time=time, torque_record=1e3 * torque)
    found = diagnose_drive(load_model(folder / "model.toml"), [run])
    sizes = {a.orders[0]: math.hypot(*(e.value for e in a.estimates)) / 1e3 for a in found.added}
    shafts = {a.orders[0]: a.effect.indices["shaft"] for a in found.added}
    assert shafts[13] == shafts[26] == shafts[39] == "crank"
    assert shafts[14] == "crank_to_disc"
    for order, size in {13: 1.36, 14: 0.70, 26: 0.55, 39: 0.31}.items():
        assert sizes[order] == pytest.approx(size, abs=0.04)
    poles = next(line for line in found.unexplained if line.order == 273)
    assert poles.amplitude / 1e3 == pytest.approx(0.52, abs=0.02)
    assert "crank 13 x 21" in poles.frames
