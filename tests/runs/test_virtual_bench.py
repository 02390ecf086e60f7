"""Simulated runs: read back as written, equal to the model they come from, physically right, noisy as stated."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pint
import pytest
from scipy import stats

import rverror
from rverror import (
    Drive,
    InputError,
    Model,
    diagnose,
    effect,
    equilibrium,
    load_run,
    reducer,
    save_model,
    simulate,
    transmission_error,
)
from rverror.app.command_line import main
from rverror.base.units import ARCSEC
from rverror.geartrain import Stiffness
from rverror.geartrain.kinematics import samples_needed
from rverror.runs import write_run
from rverror.runs.virtual_bench import coloured_noise, quantised, run_label, simulate_runs

RV40E = reducer("RV-40E")
DRIVE = Drive(ratio=-14.0, shafts={"motor": 14.0, "idler": 3.5})
TYPICAL = Model(
    RV40E,
    (
        effect("cycloid.disc_pitch", disc=0, harmonic=1, cos="3 um", sin="-2 um"),
        effect("crank.eccentricity", crank=0, disc=1, radial="4 um", tangential="1 um"),
        effect("cycloid.pin_position", pin=7, radial="-3 um", tangential="2 um"),
        effect("involute.planet_eccentricity", crank=1, x="5 um", y="-4 um"),
        effect("involute.tooth_thinning", member="sun", thinning="20 um"),
        effect("sensor.encoder_eccentricity", cos="4 arcsec", sin="-3 arcsec"),
    ),
    "typical",
)
#: The same without the pin: what is left repeats with every turn of a crank, and solves quickly.
QUICK = Model(RV40E, tuple(e for e in TYPICAL.effects if not e.key.startswith("cycloid.pin")))
WORM = Model(DRIVE, (effect("shaft.eccentricity", shaft="motor", harmonic=1, cos="30 arcsec", sin="-10 arcsec"),))
SOLVED = 1e-10  # rad: two solutions of one equilibrium, and the rounding of the angles
LOAD = "20 N*m"
PERFECT = Model(DRIVE)
TURN = 2 * math.pi
#: Chance of a false alarm of each statistical check; the seeds are fixed, so it is met once or never.
RARE = 1e-5


def arcsec(run: Any, model: Model) -> Any:
    return run.error(model) / ARCSEC


# --- through the command line -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", ["forward", "reverse"])
@pytest.mark.parametrize("model", [TYPICAL, WORM], ids=["reducer", "drive"])
def test_a_written_run_reads_back_as_the_model(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], model: Model, direction: str
) -> None:
    save_model(tmp_path / "m.toml", model)
    arguments = ["simulate", str(tmp_path / "m.toml"), "--points", "300", "--revolutions", "2"]
    arguments += ["--direction", direction, "--torque", "412 N*m"]
    assert main(arguments) == 0
    printed = capsys.readouterr().out
    assert main([*arguments, "-o", str(tmp_path / "run.csv")]) == 0
    assert capsys.readouterr().out == ""
    assert (tmp_path / "run.csv").read_text(encoding="utf-8") == printed
    assert sorted(p.name for p in tmp_path.iterdir()) == ["m.toml", "run.csv"]

    run = load_run(tmp_path / "run.csv", model)
    sign = 1.0 if direction == "forward" else -1.0
    theta = run.nominal_angle(model)
    assert run.notes == ()
    assert (run.direction == sign).all()
    assert run.torque == pytest.approx(412e3)
    assert np.diff(theta) == pytest.approx(np.full(599, sign * 2 * np.pi / 300), abs=1e-11)
    # angles are printed with 15 digits: 4 turns of 14 digits behind the comma
    assert np.abs(run.error(model) - transmission_error(model, theta, direction=sign)).max() < 1e-11


def test_a_printed_run_says_that_it_is_simulated(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    save_model(tmp_path / "m.toml", QUICK)
    for method in ("closed", "equilibrium"):
        assert main(["simulate", str(tmp_path / "m.toml"), "--points", "64", "--torque", LOAD, "--method", method]) == 0
        head = [line for line in capsys.readouterr().out.splitlines() if line.startswith("#")]
        assert "# direction: forward" in head
        assert "# output_torque: 20 N*m" in head
        assert any("simulated" in line and method in line and "not a measurement" in line for line in head)


def test_the_command_line_solves_the_equilibrium(tmp_path: Path) -> None:
    save_model(tmp_path / "m.toml", QUICK)
    out = tmp_path / "run.csv"
    for direction, sign in (("forward", 1.0), ("reverse", -1.0)):
        arguments = ["simulate", str(tmp_path / "m.toml"), "--points", "50", "--torque", LOAD, "-o", str(out)]
        assert main([*arguments, "--method", "equilibrium", "--direction", direction]) == 0
        run = load_run(out, QUICK)
        solved = equilibrium(QUICK, run.nominal_angle(QUICK), torque=LOAD, direction=sign).transmission_error
        assert np.abs(run.error(QUICK) - solved).max() < SOLVED


# --- closed form against hand calculation -----------------------------------------------------------------------------


def test_a_carrier_bore_is_a_constant() -> None:
    bores = [effect("coupling.carrier_bore_position", crank=j, tangential="5 um") for j in (0, 1)]
    wave = arcsec(simulate(Model(RV40E, tuple(bores)), points=64), TYPICAL)
    assert wave == pytest.approx(np.full(64, -0.005 / 27 / ARCSEC), abs=1e-6)  # -38.197


def test_one_cam_makes_order_40() -> None:
    cam = effect("crank.eccentricity", crank=0, disc=0, radial="5 um")
    wave = arcsec(simulate(Model(RV40E, (cam,))), TYPICAL)
    assert wave.size == samples_needed(RV40E)
    lines = 2 * np.abs(np.fft.rfft(wave)) / wave.size
    assert 2 * lines[40] == pytest.approx(18.467, rel=1e-3)  # peak-to-peak
    assert lines[1:40].max() < 1e-4
    assert lines[41:].max() < 0.01 * lines[40]


def test_play_lags_behind_the_motion() -> None:
    play = Model(RV40E, (effect("involute.tooth_thinning", member="sun", thinning="20 um"),))
    forward, reverse = (simulate(play, points=64, direction=d) for d in (1.0, -1.0))
    assert (forward.error(play) < 0).all()
    assert reverse.error(play) == pytest.approx(-forward.error(play), rel=1e-9)


def test_reverse_visits_the_same_angles_backwards() -> None:
    encoder = Model(DRIVE, (effect("sensor.encoder_eccentricity", cos="4 arcsec", sin="-3 arcsec"),))
    theta = simulate(encoder, points=64, direction=-1.0).nominal_angle(encoder)
    assert (np.diff(theta) < 0).all()
    assert theta[0] == pytest.approx(2 * np.pi)
    wave = arcsec(simulate(encoder, points=64, direction=-1.0), encoder)
    assert wave == pytest.approx(4 * np.cos(theta) - 3 * np.sin(theta), abs=1e-6)


@pytest.mark.parametrize("model", [TYPICAL, WORM], ids=["reducer", "drive"])
def test_revolutions_repeat_exactly(model: Model) -> None:
    waves = simulate(model, points=128, revolutions=4).error(model).reshape(4, 128)
    assert np.abs(waves - waves[0]).max() < 1e-12
    assert np.abs(waves[0] - simulate(model, points=128).error(model)).max() < 1e-12


def test_an_error_that_grows_does_not_repeat() -> None:
    slope = 2 * ARCSEC / (2 * math.pi)
    for mechanism in (RV40E, DRIVE):
        model = Model(mechanism, (effect("sensor.ratio_error", slope=slope),))
        wave = arcsec(simulate(model, points=32, revolutions=3), model)
        assert wave == pytest.approx(2 * np.arange(96) / 32, abs=1e-6)


def test_without_effects_there_is_no_error() -> None:
    for mechanism in (RV40E, DRIVE):
        assert np.abs(simulate(Model(mechanism), points=64).error(mechanism)).max() < 1e-14


# --- equilibrium ------------------------------------------------------------------------------------------------------


def test_the_equilibrium_winds_up_and_the_closed_form_does_not() -> None:
    """Lag = backlash + torque / stiffness, against the motion.

    Half the backlash of 20 um stands open at each of two meshes, each of which moves the output by
    (z2 / z1) / (R cranks r2 cos alpha) per mm: 2.687 arcsec together.  Perfect parts keep the same contacts closed at
    any load, so the rest is proportional to it.
    """
    model = Model(RV40E)
    r2 = 1.5 * 27 / 2
    play = 2 * 0.01 * (27 / 9) / (121 * 2 * r2 * math.cos(math.radians(20))) / ARCSEC
    loads = (20e3, 40e3, 60e3)
    lags = []
    for load in loads:
        waves = [
            arcsec(simulate(model, points=64, torque=load, method="equilibrium", direction=d), model) for d in (1, -1)
        ]
        assert waves[0].mean() < 0 < waves[1].mean()
        assert waves[0].mean() == pytest.approx(-waves[1].mean(), rel=1e-6)
        assert np.ptp(waves) < 2.1 * waves[1].mean()
        lags.append(waves[1].mean())
        closed = simulate(model, points=64, torque=load)
        assert np.abs(closed.error(model)).max() < 1e-14
        assert closed.torque == load
    assert lags[2] - lags[1] == pytest.approx(lags[1] - lags[0], rel=1e-6)
    assert 2 * lags[0] - lags[1] == pytest.approx(play, rel=1e-4)


def test_the_windup_is_the_compliance() -> None:
    """All stiffness ten times as large: a tenth of the windup, the same play."""
    soft = RV40E.stiffness
    names = ("pin_contact", "crank_bearing", "carrier_bearing", "gear_mesh", "sun_support", "main_bearing")
    stiff = Stiffness(**{name: 10 * getattr(soft, name) for name in names})
    lags = []
    for stiffness in (soft, stiff):
        model = Model(reducer("RV-40E", stiffness=stiffness, gear_backlash=0.0))
        wave = simulate(model, points=64, torque=LOAD, method="equilibrium").error(model)
        lags.append(wave.mean())
    assert lags[0] / lags[1] == pytest.approx(10, rel=1e-6)


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("points", [16, 63, 200])
def test_few_points_are_points_of_the_true_waveform(points: int, direction: float) -> None:
    """A bench that samples seldom folds what it cannot hold; it does not leave it out."""
    run = simulate(QUICK, points=points, torque=LOAD, method="equilibrium", direction=direction)
    theta = run.nominal_angle(QUICK)
    solved = equilibrium(QUICK, theta, torque=LOAD, direction=direction).transmission_error
    assert np.abs(run.error(QUICK) - solved).max() < SOLVED
    closed = simulate(QUICK, points=points, direction=direction).error(QUICK)
    assert np.abs(solved - closed).max() > 5 * ARCSEC


def test_a_pin_is_solved_over_the_whole_turn() -> None:
    run = simulate(TYPICAL, points=64, torque=LOAD, method="equilibrium", revolutions=2)
    wave = run.error(TYPICAL)
    solved = equilibrium(TYPICAL, run.nominal_angle(TYPICAL)[:64], torque=LOAD, direction=1.0).transmission_error
    assert np.abs(wave[:64] - solved).max() < SOLVED
    assert np.abs(wave[64:] - wave[:64]).max() < 1e-12


def test_readings_come_on_top_of_the_equilibrium() -> None:
    drifting = QUICK.with_effects(effect("sensor.drift", total="30 arcsec"))
    keywords = {"points": 40, "revolutions": 2, "torque": LOAD, "method": "equilibrium"}
    with_drift, without = (simulate(model, **keywords).error(QUICK) for model in (drifting, QUICK))
    assert (with_drift - without) / ARCSEC == pytest.approx(30 * np.arange(80) / 79, abs=1e-6)


def test_a_ratio_that_is_no_whole_number_is_solved_over_every_turn() -> None:
    unit = reducer("RV-40E", sun_teeth=11, planet_teeth=30, module=1.5)
    assert unit.exact_ratio.denominator != 1
    cam = effect("involute.planet_eccentricity", crank=0, x="5 um", y="1 um")
    model = Model(unit, (cam, effect("involute.sun_eccentricity", x="10 um", y="0 um")))
    run = simulate(model, points=24, revolutions=2, torque=LOAD, method="equilibrium")
    solved = equilibrium(model, run.nominal_angle(model), torque=LOAD, direction=1.0).transmission_error
    assert np.abs(run.error(model) - solved).max() < SOLVED


# --- the measuring chain ----------------------------------------------------------------------------------------------

READINGS = {
    "sensor.encoder_eccentricity": (
        {"cos": "4 arcsec", "sin": "-3 arcsec"},
        lambda t, _: 4 * np.cos(t) - 3 * np.sin(t),
    ),
    "sensor.encoder_ellipticity": (
        {"cos": "2 arcsec", "sin": "5 arcsec"},
        lambda t, _: 2 * np.cos(2 * t) + 5 * np.sin(2 * t),
    ),
    # the sun leads its reading, so the output moves ahead by a ratio-th; two waves per input turn
    "sensor.input_coupling": (
        {"harmonic": 2, "cos": "121 arcsec", "sin": "242 arcsec"},
        lambda t, _: np.cos(242 * t) + 2 * np.sin(242 * t),
    ),
    "sensor.ratio_error": ({"slope": 6 * ARCSEC / TURN}, lambda t, _: 6 * t / TURN),
    "sensor.drift": ({"total": "30 arcsec"}, lambda t, _: 30 * np.arange(t.size) / (t.size - 1)),
    # read 2 ms late at 36 deg/s the output is ahead by 259.2 arcsec along the motion
    "sensor.time_offset": ({"offset": "2 ms"}, lambda t, direction: direction * 0.002 * 36 * 3600 + 0 * t),
}


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("method", ["closed", "equilibrium"])
@pytest.mark.parametrize("key", READINGS)
def test_every_sensor_effect_shows_with_its_sign(key: str, method: str, direction: float) -> None:
    parameters, wave = READINGS[key]
    keywords: dict[str, Any] = {
        "points": 20,
        "revolutions": 2,
        "torque": LOAD,
        "method": method,
        "output_speed": "36 deg/s",
    }
    gear = Model(RV40E)
    with_it, without = (
        simulate(m, direction=direction, **keywords) for m in (gear.with_effects(effect(key, **parameters)), gear)
    )
    theta = with_it.nominal_angle(gear)
    assert (with_it.error(gear) - without.error(gear)) / ARCSEC == pytest.approx(wave(theta, direction), abs=1e-6)


@pytest.mark.parametrize("method", ["closed", "equilibrium"])
def test_the_torque_reaches_the_effects_that_need_it(method: str) -> None:
    """0.1 arcsec/(N*m) at 20 N*m: 2 arcsec behind, each way."""
    gear = Model(RV40E)
    twisted = gear.with_effects(effect("load.torsion", compliance="0.1 arcsec/(N*m)"))
    for direction in (1.0, -1.0):
        waves = [
            arcsec(simulate(m, points=16, torque=LOAD, method=method, direction=direction), gear)
            for m in (twisted, gear)
        ]
        assert waves[0] - waves[1] == pytest.approx(np.full(16, -2 * direction), abs=1e-6)
    with pytest.raises(InputError, match=r"load\.torsion needs the torque; give"):
        simulate(twisted, points=16)


def test_the_speed_gives_the_time(tmp_path: Path) -> None:
    for speed in ("36 deg/s", "6 rpm", "0.1 turn/s", 0.2 * math.pi, pint.UnitRegistry().Quantity(6.0, "rpm")):
        run = simulate(PERFECT, points=20, revolutions=2, output_speed=speed)
        assert run.time == pytest.approx(0.5 * np.arange(40))
        assert run.metadata["speed"] == "36 deg/s"
    write_run(tmp_path / "r.csv", run)
    assert load_run(tmp_path / "r.csv").time == pytest.approx(run.time)
    assert simulate(PERFECT, points=20).time is None


# --- noise ------------------------------------------------------------------------------------------------------------


def drawn(**keywords: Any) -> Any:
    """Noise of a run without any other error, arcsec."""
    return arcsec(simulate(PERFECT, **keywords), PERFECT)


@pytest.mark.parametrize("correlation", ["0 deg", "3 deg", "40 deg"])
def test_noise_has_the_stated_covariance_from_the_first_sample_on(correlation: str) -> None:
    """Whitened by the stated covariance, all samples of all seeds are independent standard normals."""
    points, seeds = 60, 300
    noise = np.array([drawn(points=points, noise="0.5 arcsec", correlation=correlation, seed=s) for s in range(seeds)])
    apart = np.abs(np.subtract.outer(np.arange(points), np.arange(points))) * 360 / points
    length = float(correlation.split()[0])
    covariance = 0.25 * (np.exp(-apart / length) if length else np.eye(points))
    white = np.linalg.solve(np.linalg.cholesky(covariance), noise.T)
    assert stats.kstest(white.ravel(), "norm").pvalue > RARE
    assert RARE < stats.chi2.cdf((white**2).sum(), white.size) < 1 - RARE
    neighbours = (white[1:] * white[:-1]).sum() / math.sqrt(white[1:].size)
    assert abs(neighbours) < stats.norm.isf(RARE)
    # nothing settles: the first sample alone has the mean and spread of all others
    for k in (0, 1, points - 1):
        assert RARE < stats.chi2.cdf((noise[:, k] ** 2).sum() / 0.25, seeds) < 1 - RARE
        assert abs(noise[:, k].mean()) < stats.norm.isf(RARE) * 0.5 / math.sqrt(seeds)


def test_noise_follows_the_recursion_it_states() -> None:
    drawn = np.random.default_rng(3).standard_normal(50)
    found = coloured_noise(50, rms=2.0, step=0.1, correlation=0.4, random=np.random.default_rng(3))
    rho = math.exp(-0.25)
    expected = [2 * drawn[0]]
    for e in drawn[1:]:
        expected.append(rho * expected[-1] + 2 * math.sqrt(1 - rho**2) * e)
    assert found == pytest.approx(expected, rel=1e-12)


def test_a_correlation_far_above_the_run_is_a_constant() -> None:
    noise = drawn(points=64, noise="1 arcsec", correlation="36000 deg")
    # rms of a step over the whole turn: sqrt(2 * 360 / 36000) of the noise's
    assert np.ptp(noise) < 5 * math.sqrt(2 * 360 / 36000)
    assert abs(noise.mean()) > 0.01


def test_noise_lasts_over_turns_and_comes_on_top() -> None:
    keywords: dict[str, Any] = {"points": 64, "revolutions": 3, "noise": "0.5 arcsec", "correlation": "2 deg"}
    quiet = simulate(TYPICAL, points=64, revolutions=3).error(TYPICAL)
    noise = simulate(TYPICAL, **keywords).error(TYPICAL) - quiet
    assert noise / ARCSEC == pytest.approx(drawn(**keywords), abs=1e-8)
    assert not np.allclose(noise[:64], noise[64:128])
    # a longer run goes on where a shorter one ends
    assert (drawn(**keywords)[:64] == drawn(**keywords | {"revolutions": 1})).all()


def test_same_seed_same_run_and_other_seeds_other_runs() -> None:
    keywords: dict[str, Any] = {"points": 2048, "noise": "1 arcsec"}
    default = drawn(**keywords)
    assert (default == drawn(**keywords, seed=0)).all()
    assert simulate(PERFECT, **keywords).metadata["seed"] == "0"
    others = [drawn(**keywords, seed=s) for s in (1, 2, 2**64, 2**128 - 1)]
    correlations = np.corrcoef([default, *others])[np.triu_indices(5, 1)]
    assert np.abs(correlations).max() < stats.norm.isf(RARE) / math.sqrt(2048)


def test_runs_of_one_call_have_noise_of_their_own_whatever_else_is_asked_for() -> None:
    keywords: dict[str, Any] = {"points": 2048, "noise": "1 arcsec", "correlation": "0 deg", "seed": 5}
    torques = ("20 N*m", "40 N*m", 20.5e3)
    runs = simulate_runs(PERFECT, torques=torques, **keywords)
    noise = [arcsec(run, PERFECT) for run in runs]
    correlations = np.corrcoef(noise)[np.triu_indices(6, 1)]
    assert np.abs(correlations).max() < stats.norm.isf(RARE) / math.sqrt(2048)
    for run in runs:
        alone = simulate(PERFECT, torque=run.torque, direction=run.direction[0], **keywords)
        assert (alone.output_angle == run.output_angle).all()
    turned = simulate_runs(PERFECT, torques=torques[::-1], directions=(-1.0, 1.0), **keywords)
    for run, other in zip(runs, turned[::-1], strict=True):
        assert (run.output_angle == other.output_angle).all()
    # the same load written otherwise is the same condition
    same = simulate(PERFECT, torque="20000.0 N*mm", **keywords)
    assert (same.output_angle == runs[0].output_angle).all()


def test_both_methods_get_the_same_noise() -> None:
    keywords: dict[str, Any] = {"points": 32, "torque": LOAD}
    for method in ("closed", "equilibrium"):
        quiet = simulate(QUICK, method=method, **keywords).error(QUICK)
        noisy = simulate(QUICK, method=method, noise="1 arcsec", seed=3, **keywords).error(QUICK)
        assert (noisy - quiet) / ARCSEC == pytest.approx(
            drawn(points=32, torque=LOAD, noise="1 arcsec", seed=3), abs=1e-8
        )


# --- counts -----------------------------------------------------------------------------------------------------------


def test_readings_are_whole_counts_no_further_off_than_half_of_one() -> None:
    exact = simulate(TYPICAL, points=512, revolutions=2, direction=-1.0)
    run = simulate(TYPICAL, points=512, revolutions=2, direction=-1.0, input_counts=4096, output_counts=100_003)
    for name, counts in (("input_angle", 4096), ("output_angle", 100_003)):
        read, true = getattr(run, name) / TURN * counts, getattr(exact, name) / TURN * counts
        assert read == pytest.approx(np.round(read), abs=1e-6)
        assert np.abs(read - true).max() <= 0.5 + 1e-6
    # what the input rounds counts a ratio-th in the error
    bound = (TURN / 100_003 + TURN / 4096 / 121) / 2
    error = run.error(TYPICAL) - exact.error(TYPICAL)
    assert 0.8 * bound < np.abs(error).max() <= bound * (1 + 1e-6)


def test_each_encoder_has_its_own_counts() -> None:
    exact = simulate(TYPICAL, points=64)
    one = simulate(TYPICAL, points=64, input_counts=1000)
    other = simulate(TYPICAL, points=64, output_counts=1000)
    assert (one.output_angle == exact.output_angle).all()
    assert (other.input_angle == exact.input_angle).all()
    assert (one.input_angle != exact.input_angle).any()
    assert (other.output_angle != exact.output_angle).any()


def test_rounding_is_uniform() -> None:
    """Even steps of 121 * 1001 / 64 counts, 64 and 121 * 1001 coprime: every 64th of a count once a turn."""
    read = quantised(TURN * 121 * np.arange(64) / 64, 1001) / TURN * 1001
    left = np.sort(read - 121 * 1001 * np.arange(64) / 64) * 64
    inner = np.sort(left)[1:-1]
    assert inner == pytest.approx(np.round(inner), abs=1e-6)
    assert np.unique(np.round(inner)).size >= 62
    # noise of many counts wipes out the pattern of the angles: independent, uniform within a count
    exact, run = (simulate(PERFECT, points=4096, noise="300 arcsec", output_counts=c, seed=2) for c in (10**12, 36_000))
    assert run.output_angle is not None
    assert exact.output_angle is not None
    rest = (run.output_angle - exact.output_angle) / TURN * 36_000
    assert stats.kstest(rest, "uniform", (-0.5, 1)).pvalue > RARE
    assert abs((rest[1:] * rest[:-1]).sum() * 12) < stats.norm.isf(RARE) * math.sqrt(4095)


def test_counts_without_number_are_exact() -> None:
    angle = np.linspace(-40, 40, 999)
    assert quantised(angle, 10**12) == pytest.approx(angle, abs=TURN / 10**12)
    assert not np.signbit(quantised(np.array([-1e-9]), 360)).any()  # -0 would be printed


# --- several runs -----------------------------------------------------------------------------------------------------


def test_runs_of_one_call_share_their_zero_and_lose_motion_between_them() -> None:
    play = Model(RV40E, (effect("involute.tooth_thinning", member="sun", thinning="20 um"),))
    runs = simulate_runs(play, torques=("20 N*m", "100 N*m"), points=16, method="equilibrium")
    assert [run_label(run.direction[0], run.torque) for run in runs] == [
        "forward-20Nm", "reverse-20Nm", "forward-100Nm", "reverse-100Nm",
    ]  # fmt: skip
    assert {run.index for run in runs} == {"simulated"}
    means = [arcsec(run, play).mean() for run in runs]
    assert means[2] < means[0] < 0 < means[1] < means[3]
    assert simulate(play, points=16).index == ""
    assert simulate_runs(play, directions=(-1.0,), points=16)[0].index == ""


def test_no_load_is_a_load_of_the_equilibrium() -> None:
    run = simulate(QUICK, points=16, torque="0 N*m", method="equilibrium", direction=-1.0)
    assert run.torque == 0
    assert run_label(-1.0, run.torque) == "reverse-0Nm"
    solved = equilibrium(QUICK, run.nominal_angle(QUICK), torque=0, direction=-1.0).transmission_error
    assert np.abs(run.error(QUICK) - solved).max() < SOLVED


def test_what_is_written_tells_how_it_was_made(tmp_path: Path) -> None:
    run = simulate(
        QUICK, points=32, torque=LOAD, noise="0.3 arcsec", correlation="2 deg", seed=7, input_counts=4096,
        output_counts=2**20, output_speed="10 deg/s",
    )  # fmt: skip
    write_run(tmp_path / "r.csv", run)
    back = load_run(tmp_path / "r.csv", QUICK)
    assert back.notes == ()
    said = {
        "simulated": "rverror, closed; not a measurement", "noise": "0.3 arcsec", "noise correlation": "2 deg",
        "seed": "7", "input counts": "4096", "output counts": "1048576", "speed": "10 deg/s",
    }  # fmt: skip
    assert {key: back.metadata[key] for key in said} == said
    assert set(simulate(QUICK, points=32, seed=7).metadata) == {"simulated"}


def test_a_hidden_part_error_is_named_from_simulated_files(tmp_path: Path) -> None:
    """Bench to cause: written, read, diagnosed; the interval is 95 %, so twice its half-width is four sigma."""
    declared = Model(RV40E, (effect("coupling.carrier_bore_position", crank=0, radial="1 um", tangential="2 um"),))
    hidden = effect("crank.eccentricity", crank=0, disc=1, radial="3 um", tangential="-4 um")
    runs = simulate_runs(
        declared.with_effects(hidden), torques=(LOAD,), points=256, revolutions=3, method="equilibrium",
        noise="0.3 arcsec", correlation="2 deg", seed=1, output_counts=2**23,
    )  # fmt: skip
    paths = [tmp_path / "forward.csv", tmp_path / "reverse.csv"]
    for path, run in zip(paths, runs, strict=True):
        write_run(path, run)
    waves_of_the_crank = ("crank.eccentricity", "cycloid.disc_bore_position", "cycloid.disc_pitch",
                          "involute.planet_eccentricity", "sensor.encoder_eccentricity")  # fmt: skip
    found = diagnose(
        declared, [load_run(path, declared) for path in paths], policy=rverror.diagnosis.Policy(keys=waves_of_the_crank)
    )
    assert found.verdict == "explained"
    (added,) = found.added
    named = [(added.effect.key, dict(added.effect.indices)), *added.indistinguishable]
    assert (hidden.key, dict(hidden.indices)) in named
    for estimate, size in zip(added.estimates, (0.003, -0.004), strict=True):
        assert abs(estimate.value - size) < estimate.high - estimate.low
    # 1080 deg in two runs hold 1080 independent squares of noise correlated over 2 deg, two thirds of which differ
    # between turns: four standard deviations of their rms are 4 / sqrt(2 * 720), and the counts add 1 %
    assert found.noise_rms / ARCSEC == pytest.approx(0.3, rel=0.12)


# --- arguments --------------------------------------------------------------------------------------------------------


def test_the_torque_is_a_number_a_text_or_a_quantity() -> None:
    quantity = pint.UnitRegistry().Quantity(20.0, "newton * meter")
    runs = [simulate(QUICK, points=16, torque=t, method="equilibrium") for t in (20e3, LOAD, "20000 N*mm", quantity)]
    for run in runs:
        assert run.torque == pytest.approx(20e3, rel=1e-12)
        assert run.error(QUICK) == pytest.approx(runs[0].error(QUICK), abs=1e-15)


def test_default_points_hold_the_highest_mesh() -> None:
    assert simulate(QUICK).size == samples_needed(RV40E) == 4096  # above twice the order 1560
    assert simulate(WORM).size == 4096


def test_the_same_call_gives_the_same_run_and_the_model_stays() -> None:
    before = tuple(e.values for e in TYPICAL.effects)
    first, second = (simulate(TYPICAL, points=64, revolutions=2) for _ in range(2))
    assert (first.error(TYPICAL) == second.error(TYPICAL)).all()
    assert tuple(e.values for e in TYPICAL.effects) == before


def test_a_run_can_be_written_from_python(tmp_path: Path) -> None:
    run = simulate(TYPICAL, points=64)
    write_run(tmp_path / "r.csv", run)
    assert load_run(tmp_path / "r.csv").error(TYPICAL) == pytest.approx(run.error(TYPICAL), abs=1e-11)


@pytest.mark.parametrize(
    ("model", "keywords", "words"),
    [
        (TYPICAL, {"points": 15}, ("points = 15", "16 or more")),
        (TYPICAL, {"points": -64}, ("points = -64", "16 or more")),
        (TYPICAL, {"revolutions": 0}, ("revolutions = 0", "1 or more")),
        (TYPICAL, {"points": 4096, "revolutions": 10**9}, ("points * revolutions", "fewer")),
        (TYPICAL, {"torque": 0.0}, ("torque = 0 N*m", "above 0")),
        (TYPICAL, {"torque": -20e3}, ("torque = -20 N*m", "must be from 0 N*m to")),
        (TYPICAL, {"torque": math.nan}, ("torque", "finite")),
        (TYPICAL, {"torque": math.inf}, ("torque", "finite")),
        (TYPICAL, {"torque": 1e200}, ("torque = 1e+197 N*m", "must be from 0 N*m to 1e+09 N*m")),
        (TYPICAL, {"torque": "20 kg"}, ("torque", "'kg'", "N*m")),
        (TYPICAL, {"torque": "20"}, ("torque", "no unit")),
        (TYPICAL, {"method": "equilibrium"}, ("needs a torque", "20 N*m")),
        (TYPICAL, {"method": "exact"}, ("'exact'", "'closed' or 'equilibrium'")),
        (WORM, {"method": "equilibrium", "torque": 20e3}, ("[drive]", "closed")),
        (Model(RV40E, (effect("sensor.time_offset", offset="1 ms"),)), {}, ("sensor.time_offset", "--speed", "remove")),
        (TYPICAL, {"torque": 0.0}, ("no load", "--method equilibrium")),
        (TYPICAL, {"torque": -1.0, "method": "equilibrium"}, ("torque = -0.001 N*m", "must be from 0 N*m to")),
        (TYPICAL, {"direction": 0.5}, ("direction = 0.5", "+1", "-1")),
        (TYPICAL, {"noise": "0.3 um"}, ("noise", "'um'", "'arcsec'")),
        (TYPICAL, {"noise": "0.3"}, ("noise", "no unit")),
        (TYPICAL, {"noise": -ARCSEC}, ("noise = -1 arcsec", "from 0 arcsec to 648000 arcsec")),
        (TYPICAL, {"noise": math.nan}, ("noise", "finite")),
        (TYPICAL, {"noise": "400 deg"}, ("noise = 1.44e+06 arcsec", "648000 arcsec")),
        (TYPICAL, {"correlation": "2 deg"}, ("correlation", "--noise")),
        (TYPICAL, {"noise": 0.0, "correlation": "-2 deg"}, ("correlation = -7200 arcsec", "1.296e+08 arcsec")),
        (TYPICAL, {"noise": 0.0, "correlation": "2 s"}, ("correlation", "'s'", "'arcsec'")),
        (TYPICAL, {"seed": -1}, ("seed = -1", "from 0 to")),
        (TYPICAL, {"seed": 2**128}, ("seed = ", "from 0 to")),
        (TYPICAL, {"seed": 1.5}, ("seed = 1.5", "whole number")),
        (TYPICAL, {"input_counts": 0}, ("input_counts = 0", "from 1 to")),
        (TYPICAL, {"output_counts": -4096}, ("output_counts = -4096", "from 1 to")),
        (TYPICAL, {"output_counts": "many"}, ("output_counts = 'many'", "whole number")),
        (WORM, {"input_counts": 10**13}, ("input_counts", "1e+12")),
        (WORM, {"output_speed": "10 deg"}, ("output_speed", "'deg'", "'rpm'")),
        (WORM, {"output_speed": "10 Hz"}, ("output_speed", "'Hz'", "'rpm'")),
        (WORM, {"output_speed": "10"}, ("output_speed", "'10'", "'10 rpm'")),
        (WORM, {"output_speed": [1.0, 2.0]}, ("output_speed", "[1.0, 2.0]")),
        (WORM, {"output_speed": pint.UnitRegistry().Quantity(5.0, "mm/s")}, ("output_speed", "'rpm'")),
        (WORM, {"output_speed": "0 rpm"}, ("output_speed = 0 rpm", "9.5493e-08 rpm")),
        (WORM, {"output_speed": "-1 rpm"}, ("output_speed = -1 rpm", "must be from 9.5493e-08 rpm to")),
    ],
)
def test_what_cannot_be_simulated_is_refused(model: Model, keywords: dict[str, Any], words: tuple[str, ...]) -> None:
    with pytest.raises(InputError) as caught:
        simulate(model, **keywords)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message


@pytest.mark.parametrize("keywords", [{"torques": (LOAD, "20000 N*mm")}, {"directions": (1.0, 1.0)}])
def test_a_run_asked_for_twice_is_refused(keywords: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=r"forward.*twice; give each"):
        simulate_runs(PERFECT, **keywords)


def test_a_reading_of_ones_own_is_simulated_on_a_reducer() -> None:
    """It adds what it says to the output, whether or not it could act in a drive too."""
    encoder = rverror.CATALOGUE["sensor.encoder_eccentricity"]
    own = replace(encoder, key="sensor.tape_joint", in_drives=False)
    with rverror.model.extended(own):
        unit = rverror.Model(rverror.reducer("RV-40E"), (rverror.effect(own.key, cos="9 arcsec"),))
        error = rverror.simulate(unit, points=64, revolutions=2).error(unit)
    expected = 9 * np.pi / 648000 * np.cos(2 * np.pi * np.arange(128) / 64)
    np.testing.assert_allclose(error, expected, atol=1e-12)
