"""Simulated runs: read back as written, equal to the model they come from, and physically right."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pint
import pytest

from rverror import (
    Drive,
    InputError,
    Model,
    Stiffness,
    effect,
    equilibrium,
    load_run,
    reducer,
    save_model,
    simulate,
    transmission_error,
    write_run,
)
from rverror.cli import main
from rverror.kinematics import samples_needed
from rverror.units import ARCSEC

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
        (TYPICAL, {"torque": -20e3}, ("torque = -20 N*m", "above 0")),
        (TYPICAL, {"torque": math.nan}, ("torque", "finite")),
        (TYPICAL, {"torque": math.inf}, ("torque", "finite")),
        (TYPICAL, {"torque": 1e200}, ("torque = 1e+197 N*m", "or less")),
        (TYPICAL, {"torque": "20 kg"}, ("torque", "'kg'", "N*m")),
        (TYPICAL, {"torque": "20"}, ("torque", "no unit")),
        (TYPICAL, {"method": "equilibrium"}, ("needs a torque", "20 N*m")),
        (TYPICAL, {"method": "exact"}, ("'exact'", "'closed' or 'equilibrium'")),
        (WORM, {"method": "equilibrium", "torque": 20e3}, ("[drive]", "closed")),
        (Model(RV40E, (effect("sensor.time_offset", offset="1 ms"),)), {}, ("sensor.time_offset", "remove")),
    ],
)
def test_what_cannot_be_simulated_is_refused(model: Model, keywords: dict[str, Any], words: tuple[str, ...]) -> None:
    with pytest.raises(InputError) as caught:
        simulate(model, **keywords)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message
