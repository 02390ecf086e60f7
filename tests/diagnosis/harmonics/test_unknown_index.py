"""Runs whose zero is not on the gear's marks: the same gear train, turned."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import rverror
from rverror import Reducer
from rverror.base.units import ARCSEC
from rverror.diagnosis.harmonics.runs import FitRun, fit_run
from rverror.diagnosis.harmonics.zeros import index_offsets
from rverror.diagnosis.policy import POLICY
from rverror.diagnosis.result import Diagnosis
from rverror.geartrain.kinematics import Conditions, true_period
from rverror.model.catalogue import CATALOGUE
from rverror.model.effects import Effect, Model, effect
from rverror.runs.virtual_bench import coloured_noise, simulate_runs
from rverror.statics.loaded_state import equilibrium
from rverror.statics.prediction import Predictor, predict
from strategies import angles, reducers

Array = np.ndarray
UNIT = rverror.reducer("RV-40E")
TURN = 2 * np.pi
#: What turns with the crank, what is fixed in the housing, and what the bench reads.
CRANK_SIDE = (
    effect("crank.eccentricity", crank=0, disc=1, radial="6 um", tangential="-4 um"),
    effect("cycloid.disc_pitch", disc=0, harmonic=1, cos="5 um", sin="-2 um"),
    effect("coupling.carrier_bore_position", crank=0, radial="2 um", tangential="3 um"),
)
PINS = (
    effect("cycloid.pin_position", pin=5, radial="-5 um", tangential="4 um"),
    effect("cycloid.pin_circle", harmonic=2, radial_cos="5 um"),
)
#: Its mesh keeps its direction on the carrier, so it makes one order and nothing beside.
WAVE = effect("involute.planet_eccentricity", crank=1, x="8 um", y="3 um")
CLEARANCE = (effect("crank.bearing_clearance", clearance="3 um"),)
READINGS = (
    effect("sensor.encoder_eccentricity", cos="9 arcsec", sin="-4 arcsec"),
    effect("sensor.input_coupling", harmonic=1, cos="300 arcsec"),
)


def offset(angle: float) -> Effect:
    return effect("sensor.index_offset", offset=angle)


def turn(points: int, turns: int = 1) -> Array:
    return TURN * turns * np.arange(points) / points


# --- what the offset does -----------------------------------------------------------------------------------------


@given(
    unit=reducers(),
    theta=angles(),
    angle=st.floats(-4, 4),
    direction=st.sampled_from([-1.0, 1.0]),
    seed=st.integers(0, 2**32 - 1),
)
def test_gears_turn_and_readings_stay(unit: Reducer, theta: Array, angle: float, direction: float, seed: int) -> None:
    """Closed form, one random error of every source: the gears stand at theta + phi, the encoders at theta."""
    rng = np.random.default_rng(seed)
    gears, read = [], []
    for key, entry in CATALOGUE.items():
        if not entry.applies_to(unit) or key == "sensor.index_offset":
            continue
        sets = list(entry.candidates(unit))
        sizes = tuple(abs(rng.normal(size=len(entry.parameters))) * [p.plausible for p in entry.parameters])
        part = Effect(key, sets[rng.integers(len(sets))], sizes)
        (read if key.partition(".")[0] in ("sensor", "load", "empirical") else gears).append(part)
    order = rng.permutation(len(gears) + len(read) + 1)
    mixed = tuple(np.array([*gears, *read, offset(angle)], dtype=object)[order])
    state: dict[str, Any] = {"direction": direction, "torque": 20e3, "time": np.linspace(0, 9, theta.size)}
    found = rverror.transmission_error(Model(unit, mixed), theta, **state)
    ahead = rverror.transmission_error(Model(unit, tuple(gears)), theta + angle, **state)
    chain = rverror.transmission_error(Model(unit, tuple(read)), theta, **state)
    scale = float(np.abs(ahead).max() + np.abs(chain).max())
    np.testing.assert_allclose(found, ahead + chain, rtol=0, atol=1e-9 * scale)
    parts = rverror.model.compose.transmission_error_by_effect(Model(unit, mixed), theta, **state)
    np.testing.assert_allclose(parts.sum(axis=0), found, rtol=0, atol=1e-9 * scale)
    assert not parts[[e.key for e in mixed].index("sensor.index_offset")].any()


def test_offsets_add_up() -> None:
    theta = turn(50)
    two, one = (
        rverror.transmission_error(Model(UNIT, (*CRANK_SIDE, *some)), theta, direction=1)
        for some in ((offset(0.3), offset(-1.1)), (offset(-0.8),))
    )
    np.testing.assert_allclose(two, one, rtol=0, atol=1e-9 * ARCSEC)


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("angle", [0.7, -2.9])
def test_the_equilibrium_is_that_of_the_turned_gear_train(angle: float, direction: float) -> None:
    theta = np.array([0.3, 1.1, 2.0, 5.7])
    load: dict[str, Any] = {"torque": 20e3, "direction": direction}
    found = equilibrium(Model(UNIT, (*READINGS, *CRANK_SIDE, offset(angle), *PINS)), theta, **load)
    ahead = equilibrium(Model(UNIT, (*CRANK_SIDE, *PINS)), theta + angle, **load)
    chain = rverror.transmission_error(Model(UNIT, READINGS), theta, direction=direction)
    assert np.ptp(chain) > 5 * ARCSEC
    np.testing.assert_allclose(found.transmission_error, ahead.transmission_error + chain, rtol=0, atol=1e-9 * ARCSEC)
    np.testing.assert_array_equal(found.loaded_pins, ahead.loaded_pins)


def test_what_grows_along_a_run_keeps_to_the_bench() -> None:
    theta = np.array([0.3, 1.1, 2.0, 2.6])
    grows = (effect("sensor.ratio_error", slope="3 arcsec/turn"), effect("sensor.drift", total="6 arcsec"))
    load: dict[str, Any] = {"torque": 20e3, "direction": 1.0}
    found, still = (
        equilibrium(Model(UNIT, (offset(0.7), *some)), theta, **load).transmission_error for some in (grows, ())
    )
    expected = 3 * ARCSEC * theta / TURN + 6 * ARCSEC * np.arange(4) / 3
    np.testing.assert_allclose(found - still, expected, rtol=0, atol=1e-9 * ARCSEC)


# --- predictions --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize(
    ("more", "points"), [(CLEARANCE, 1024), ((*CLEARANCE, *PINS), 2048)], ids=["one repeat", "whole turn"]
)
def test_predictions_are_those_of_the_equilibrium(more: tuple[Effect, ...], points: int, direction: float) -> None:
    """Samples as a run has them: the mesh orders above them fold, and are turned as what they are, not as they look."""
    model = Model(UNIT, (*READINGS, *CRANK_SIDE, *more, offset(1.234)))
    theta = turn(points)
    found = predict(model, Conditions(theta, direction, 20e3, folds=True)).transmission_error
    some = slice(5, None, 37)
    whole = equilibrium(model, theta[some], torque=20e3, direction=direction).transmission_error
    assert np.ptp(whole) > 5 * ARCSEC
    assert np.sqrt(np.mean((found[some] - whole) ** 2)) < 0.02 * ARCSEC


@pytest.mark.parametrize(
    ("some", "torque", "accuracy"),
    [
        pytest.param((WAVE,), None, 1e-6, id="a wave"),
        pytest.param(CRANK_SIDE, 20e3, 0.06, id="one repeat"),
        pytest.param((*CRANK_SIDE, *PINS), 20e3, 0.06, id="whole turn"),
    ],
)
def test_the_row_of_the_offset_is_the_finite_difference(
    some: tuple[Effect, ...], torque: float | None, accuracy: float
) -> None:
    """As a whole: where a pin takes up load the slope jumps, and its Fourier series rings."""

    def at(angle: float) -> Model:
        return Model(UNIT, (*some[:1], offset(angle), *some[1:], *READINGS))

    predictor, angle, step = Predictor(UNIT, Conditions(turn(4096), 1.0, torque)), 0.4, 1e-6
    row = predictor.predict(at(angle)).matrix[2]
    ahead, behind = (predictor.predict(at(angle + h)).transmission_error for h in (step, -step))
    difference = (ahead - behind) / (2 * step)
    size = np.sqrt(np.mean(difference**2))
    assert size > 1e-4
    assert np.sqrt(np.mean((row - difference) ** 2)) < accuracy * size


@pytest.mark.parametrize("torque", [None, 20e3])
def test_every_other_row_is_turned_too(torque: float | None) -> None:
    """Rows of the fit and of candidates are those of runs that begin where the marks are; an encoder's stay."""
    some = (CRANK_SIDE[0], *READINGS)
    theta, angle = turn(2048), 0.9
    sets = [(e.key, e.indices) for e in some]
    still, ahead = (Predictor(UNIT, Conditions(at, 1.0, torque)) for at in (theta, theta + angle))
    model, turned = Model(UNIT, some), Model(UNIT, (*some, offset(angle)))
    for wanted, here, found in (
        (ahead.predict(model).matrix, still.predict(model).matrix, still.predict(turned).matrix[:-1]),
        (ahead.influences(model, sets), still.influences(model, sets), still.influences(turned, sets)),
    ):
        expected = np.concatenate([wanted[:2], here[2:]])
        size = np.sqrt((expected**2).mean(axis=1))
        assert (np.sqrt(((expected - np.concatenate([here[:2], wanted[2:]])) ** 2).mean(axis=1)) > 0.5 * size).all()
        # influences jump where a pin takes up load
        assert (np.sqrt(((found - expected) ** 2).mean(axis=1)) < 0.02 * size).all()


def test_an_offset_is_predicted_over_whole_periods_alone() -> None:
    model = Model(UNIT, (*CRANK_SIDE, offset(0.1)))
    for theta in (turn(64)[:-1], np.sort(np.random.default_rng(0).uniform(0, TURN, 64)), np.array([0.2])):
        with pytest.raises(ValueError, match=r"index_offset.*whole periods; cut the run"):
            predict(model, Conditions(theta, 1.0))


def test_simulated_runs_are_turned() -> None:
    plain, turned = (
        simulate_runs(Model(UNIT, (*CRANK_SIDE, *READINGS, *more)), points=360, revolutions=2)[1]
        for more in ((), (offset(math.radians(13)),))
    )
    gears, chain = (
        rverror.transmission_error(Model(UNIT, some), turned.nominal_angle(121), direction=-1)
        for some in (CRANK_SIDE, READINGS)
    )
    ahead = rverror.transmission_error(
        Model(UNIT, CRANK_SIDE), turned.nominal_angle(121) + math.radians(13), direction=-1
    )
    np.testing.assert_allclose(plain.error(121), gears + chain, rtol=0, atol=1e-6 * ARCSEC)
    np.testing.assert_allclose(turned.error(121), ahead + chain, rtol=0, atol=1e-6 * ARCSEC)


# --- likely offsets -----------------------------------------------------------------------------------------------


def still_runs(unit: Reducer, effects: Sequence[Effect], angle: float, *, noise: float = 0.0) -> list[FitRun]:
    """Closed-form runs of two periods, forward and back, with the marks ahead by an angle."""
    turns = true_period(unit)
    theta, rng = turn(1024 * turns, turns), np.random.default_rng(3)
    model = Model(unit, (*effects, offset(angle)))
    return [
        fit_run(
            "run",
            Predictor(unit, Conditions(theta, way)),
            rverror.transmission_error(model, theta, direction=way) + noise * rng.normal(size=(2, theta.size)),
        )
        for way in (1.0, -1.0)
    ]


def apart(one: float, other: float, period: float) -> float:
    return abs((one - other + period / 2) % period - period / 2)


def first_answer(unit: Reducer, effects: Sequence[Effect], angle: float, noise: float) -> float:
    """Angle that is found first; its waveform must be the one that was measured, whatever else looks like it."""
    found = [
        e.values[0]
        for e in index_offsets(Model(unit, tuple(effects)), unit, still_runs(unit, effects, angle, noise=noise))
    ]
    turns = true_period(unit)
    assert len(found) >= 6
    assert len(set(found)) == len(found)
    assert all(0 <= value < TURN * turns for value in found)
    theta = turn(1024 * turns, turns)
    told, true = (
        rverror.transmission_error(Model(unit, (*effects, offset(at))), theta, direction=1) for at in (found[0], angle)
    )
    step = TURN * turns / 2**15
    slope = np.abs(np.diff(true)).max() / (theta[1] - theta[0])
    assert np.abs(told - true).max() < 2 * slope * (step + 1e4 * noise)
    return found[0]


@pytest.mark.parametrize("noise", [0.0, 0.5 * ARCSEC])
@pytest.mark.parametrize("angle", [0.0, 1.234, 4.5, -0.02])
def test_the_first_answer_is_the_angle(angle: float, noise: float) -> None:
    """Without pins all that is declared is alike after a turn of the crank, with them after half a turn of the output.

    Two discs in antiphase make opposite pins alike as long as no contact opens.
    """
    for pins, period in (((), TURN / 40), (PINS, TURN / 2)):
        found = first_answer(UNIT, (*CRANK_SIDE, *pins, *READINGS), angle, noise)
        assert apart(found, angle, period) < (1e-4 if noise == 0 else 2e-3)
        assert pins or found < period + 1e-3  # the least one


@pytest.mark.parametrize("turns", [0.2, 6.7])
def test_a_reducer_that_closes_after_several_turns(turns: float) -> None:
    """Its sun stands as before after nine turns of the output, over which the angle is sought."""
    unit = rverror.reducer("RV-40E", planet_teeth=25)
    assert true_period(unit) == 9
    sun = effect("involute.sun_pitch", harmonic=2, cos="8 um", sin="3 um")
    first_answer(unit, (*CRANK_SIDE, sun, *PINS), turns * TURN, 0.0)


def test_nothing_declared_tells_nothing() -> None:
    runs = still_runs(UNIT, READINGS, 0.0, noise=ARCSEC)
    for model in (Model(UNIT), Model(UNIT, READINGS), Model(UNIT, (replace(CRANK_SIDE[0], values=(0.0, 0.0)),))):
        (found,) = index_offsets(model, UNIT, runs)
        assert found.key == "sensor.index_offset"
        assert found.values == (0.0,)


# --- the diagnosis ------------------------------------------------------------------------------------------------

CAM = effect("crank.eccentricity", crank=0, disc=0, radial="4 um", tangential="-3 um", uncertainty="0.3 um")
BORE = effect("cycloid.disc_bore_position", disc=0, crank=1, radial="3 um", tangential="-5 um", uncertainty="0.3 um")
POINTS, TURNS, SHIFT = 1024, 3, 1.234


@cache
def shifted_wave(direction: float, *missing: tuple[str, float]) -> Array:
    """Equilibrium of the unit where it stands while the bench reads a turn from 0 on, without any offset's code."""
    off = tuple(replace(e, values=tuple(np.add(e.values, d))) for e, d in ((CAM, (2e-4, -1e-4)), (BORE, (-2e-4, 1e-4))))
    more = tuple(Effect(key, {}, (size,)) for key, size in missing)
    return equilibrium(
        Model(UNIT, (*off, *more)), turn(POINTS) + SHIFT, torque=20e3, direction=direction
    ).transmission_error


def unmarked_runs(*missing: tuple[str, float], index: str = "unknown") -> list[rverror.Run]:
    rng, theta, runs = np.random.default_rng(5), turn(TURNS * POINTS, TURNS), []
    for way in (1.0, -1.0):
        noise = coloured_noise(theta.size, rms=0.44 * ARCSEC, step=1.0, correlation=4.5, random=rng)
        noise = noise + 0.22 * ARCSEC * rng.standard_normal(theta.size)
        error = np.tile(shifted_wave(way, *missing), TURNS) + noise
        back = slice(None, None, int(way))
        runs.append(
            rverror.run_from_arrays(
                input_angle=121 * theta[back],
                output_angle=(theta + error)[back],
                direction="forward" if way > 0 else "reverse",
                torque=20e3,
                index=index,
            )
        )
    return runs


def told_angle(found: Diagnosis) -> tuple[float, float]:
    """Angle of the marks and half of its interval as the notes tell them, deg."""
    (note,) = [note for note in found.notes if "index unknown" in note]
    match = re.search(r"marks are (\S+) \+- (\S+) deg ahead", note)
    assert match, note
    return float(match[1]), float(match[2])


def test_a_turned_unit_lacks_nothing() -> None:
    found = rverror.diagnose(Model(UNIT, (CAM, BORE)), unmarked_runs())
    assert (found.verdict, found.added, found.unexplained) == ("nothing_missing", (), ())
    value, reach = told_angle(found)
    assert apart(value, math.degrees(SHIFT), 9) < max(reach, 0.02)
    assert reach < 1.0
    assert found.model.index_offset == pytest.approx(math.radians(value), abs=math.radians(0.001) + 1e-3 * abs(value))
    assert [e.key for e in found.model.effects] == [CAM.key, BORE.key, "sensor.index_offset"]
    assert found.declared.effects == (CAM, BORE)
    assert found.after.heldout_rms == pytest.approx(found.noise_rms, rel=0.05)


def test_a_clearance_that_a_turned_unit_lacks_is_named() -> None:
    """Among a dozen candidates for speed; at 1024 samples a turn the clearance's orders above 512 fold."""
    tried = ("crank.bearing_clearance", "crank.eccentricity", "cycloid.disc_bore_position", "cycloid.disc_profile")
    found = rverror.diagnose(
        Model(UNIT, (CAM, BORE)), unmarked_runs(("crank.bearing_clearance", 3e-3)), policy=replace(POLICY, keys=tried)
    )
    assert found.verdict == "explained"
    (added,) = found.added
    assert added.effect.key == "crank.bearing_clearance"
    assert added.estimates[0].low < 3e-3 < added.estimates[0].high
    value, reach = told_angle(found)
    assert apart(value, math.degrees(SHIFT), 9) < max(reach, 0.02)
    assert found.after.heldout_rms == pytest.approx(found.noise_rms, rel=0.05)


def test_before_is_told_of_a_gear_train_at_its_marks() -> None:
    """An encoder of 9.4 arcsec is missing and the zero is nowhere: before holds the encoder's error, not the zero's."""
    for angle in (0.05, 1.234):
        cam = replace(CAM, values=(6e-3, -4e-3))
        true = Model(UNIT, (cam, effect("sensor.encoder_eccentricity", cos="5 arcsec", sin="-8 arcsec"), offset(angle)))
        noise: dict[str, Any] = {"noise": "0.5 arcsec", "correlation": "2 deg"}
        runs = [replace(run, index="unknown") for run in simulate_runs(true, points=256, revolutions=3, **noise)]
        found = rverror.diagnose(Model(UNIT, (cam,)), runs)
        assert [a.effect.key for a in found.added] == ["sensor.encoder_eccentricity"]
        rms = math.sqrt((5**2 + 8**2) / 2 + 0.5**2) * ARCSEC
        assert found.before.rms == pytest.approx(rms, rel=0.05)
        assert found.before_refitted.rms == pytest.approx(rms, rel=0.05)
        assert found.after.rms == pytest.approx(0.5 * ARCSEC, rel=0.1)


def test_where_nothing_shows_the_marks_are_nowhere() -> None:
    runs = [
        replace(run, index="unknown") for run in simulate_runs(Model(UNIT), points=256, revolutions=3, noise=ARCSEC)
    ]
    found = rverror.diagnose(Model(UNIT), runs)
    assert (found.verdict, found.added, found.unexplained) == ("nothing_missing", (), ())
    (note,) = [note for note in found.notes if "index unknown" in note]
    assert "cannot be placed" in note


@pytest.mark.parametrize("other", ["", "A"])
def test_some_runs_with_marks_and_some_without_are_refused(other: str) -> None:
    runs = [replace(run, index=index) for run, index in zip(unmarked_runs(), ("unknown", other), strict=True)]
    for order in (runs, runs[::-1]):
        with pytest.raises(rverror.InputError) as refusal:
            rverror.diagnose(Model(UNIT, (CAM,)), order)
        (line,) = str(refusal.value).splitlines()
        for word in ("run 2", "index", "'unknown'", repr(other or "aligned"), "all runs or none"):
            assert word in line
