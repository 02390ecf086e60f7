"""Predictions under the conditions of a run: pins, sensors, and derivatives."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

import rverror
from rverror.geartrain.kinematics import OperatingConditions
from rverror.model.catalogue import source
from rverror.model.effects import Effect, effect
from rverror.statics.loaded_state import equilibrium, statics_of
from rverror.statics.prediction import predict

ARCSEC = math.pi / 180 / 3600

CARRIER_SIDE = (
    effect("cycloid.disc_pitch", disc=0, harmonic=1, cos="5 um", sin="-2 um"),
    effect("cycloid.disc_profile", disc=1, harmonic=2, cos="3 um"),
    effect("crank.eccentricity", crank=0, disc=0, radial="5 um"),
    effect("cycloid.disc_bore_position", disc=1, crank=1, tangential="4 um"),
    effect("coupling.carrier_bore_position", crank=1, radial="5 um", tangential="-3 um"),
    effect("involute.planet_eccentricity", crank=1, x="8 um"),
    effect("involute.tooth_thinning", member="sun", thinning="6 um"),
)
READINGS = (
    effect("sensor.encoder_eccentricity", cos="9 arcsec", sin="-4 arcsec"),
    effect("sensor.input_coupling", harmonic=2, cos="300 arcsec"),
)
PINS = (
    effect("cycloid.pin_position", pin=5, radial="-5 um"),
    effect("cycloid.pin_circle", harmonic=2, radial_cos="5 um"),
)


def spread(values: np.ndarray) -> float:
    return float(np.std(values))


def turn(points: int, *, start: float = 0.3) -> np.ndarray:
    return start + 2 * np.pi * np.arange(points) / points


@pytest.mark.parametrize("clearance", [0.0, 5e-3])
def test_influences_are_forces_times_error_vectors(clearance: float) -> None:
    """What each source of the gear train closes, against its error vector and the forces of `linearise`."""
    unit, theta = rverror.reducer("RV-003"), turn(23)
    effects = [*CARRIER_SIDE, *PINS]
    if clearance:
        effects.append(effect("crank.bearing_clearance", clearance=clearance))
    for key, entry in rverror.CATALOGUE.items():
        if not entry.at_output and entry.applies_to(unit):
            indices = list(entry.candidates(unit))[-1]
            effects.append(Effect(key, indices, tuple(0.02 * p.plausible for p in entry.parameters)))
    model = rverror.Model(unit, tuple(effects))
    found = predict(model, OperatingConditions(theta, -1.0, 412e3)).matrix
    state = rverror.statics.linearise(model, theta, torque=412e3, direction=-1.0)
    expected = rverror.model.compose.effect_matrix(state.motion, state.forces, model.effects)
    scale = np.abs(expected).max(axis=1, keepdims=True)
    np.testing.assert_allclose(found / scale.max(), expected / scale.max(), rtol=0, atol=1e-8)
    assert (np.abs(found - expected) <= 1e-6 * scale + 1e-9 * scale.max()).all()


def test_from_a_prediction_without_a_pin_one_with_it_is_solved_as_from_nothing() -> None:
    model, theta = rverror.Model(rverror.reducer("RV-40E"), CARRIER_SIDE), turn(300)
    statics = statics_of(model.mechanism, OperatingConditions(theta, 1.0, 20e3))
    near, more = statics.predict(CARRIER_SIDE), CARRIER_SIDE + PINS
    cold, warm = statics.predict(more), statics.predict(more, near.poses)
    np.testing.assert_allclose(warm.transmission_error, cold.transmission_error, rtol=0, atol=1e-15)
    np.testing.assert_allclose(warm.matrix, cold.matrix, rtol=0, atol=1e-9 * np.abs(cold.matrix).max())


@pytest.mark.parametrize("direction", [1.0, -1.0])
@pytest.mark.parametrize("gears", [CARRIER_SIDE, CARRIER_SIDE + PINS], ids=["carrier side", "pins"])
def test_it_is_the_equilibrium_at_every_angle(gears: tuple[Effect, ...], direction: float) -> None:
    model = rverror.Model(rverror.reducer("RV-40E"), gears)
    theta = turn(97)
    found = predict(model, OperatingConditions(theta, direction, 20e3))
    whole = equilibrium(model, theta, torque=20e3, direction=direction).transmission_error
    np.testing.assert_allclose(found.transmission_error, whole, rtol=0, atol=1e-15)


@pytest.mark.parametrize("torque", [20e3, 412e3])
@pytest.mark.parametrize("points", [512, 4096])
def test_falling_angles_are_growing_ones_read_backwards(points: int, torque: float) -> None:
    model = rverror.Model(rverror.reducer("RV-40E"), CARRIER_SIDE)
    theta = turn(points, start=0.0)
    growing = predict(model, OperatingConditions(theta, -1.0, torque)).transmission_error
    falling = predict(model, OperatingConditions(theta[0] + 2 * np.pi - theta, -1.0, torque)).transmission_error
    back = np.concatenate([falling[:1], falling[:0:-1]])
    np.testing.assert_allclose(back, growing, rtol=0, atol=1e-6 * ARCSEC)


@pytest.mark.parametrize("planet_teeth", [27, 24])
def test_what_repeats_with_the_crank_is_what_the_equilibrium_repeats(planet_teeth: int) -> None:
    """Beside an error of a disc; a wrong answer would fold order 39 onto 40."""
    unit = rverror.reducer("RV-40E", planet_teeth=planet_teeth)
    theta, again = np.array([0.3, 1.1, 2.0]), 2 * np.pi / 40
    for key, entry in rverror.CATALOGUE.items():
        beyond_the_contacts = ("shaft", "sensor", "empirical", "compensation")
        if key.startswith(beyond_the_contacts) or (entry.in_tables and entry.acts == "output"):
            continue
        for indices in (*list(entry.candidates(unit))[:2], *list(entry.candidates(unit))[-1:]):
            sizes = {p.name: 0.2 * p.plausible for p in entry.parameters}
            model = rverror.Model(unit, (CARRIER_SIDE[0], rverror.effect(key, **indices, **sizes)))
            first, second = (
                equilibrium(model, angles, torque=20e3, direction=1).transmission_error
                for angles in (theta, theta + again)
            )
            same = np.abs(first - second).max() < 1e-5 * ARCSEC
            assert source(key).repeats_with_crank(unit, indices) == same, (key, indices)


@given(
    order=st.permutations(range(len(CARRIER_SIDE) + len(READINGS) + len(PINS))),
    pins=st.booleans(),
    torque=st.sampled_from([None, 20e3, 412e3]),
)
def test_rows_stay_in_the_order_of_the_model(order: list[int], pins: bool, torque: float | None) -> None:
    effects = CARRIER_SIDE + READINGS + PINS
    count = len(effects) if pins else len(effects) - len(PINS)
    shuffled = tuple(effects[i] for i in order if i < count)
    unit = rverror.reducer("RV-40E")
    conditions = OperatingConditions(turn(31), 1.0, torque)
    plain = predict(rverror.Model(unit, effects[:count]), conditions)
    mixed = predict(rverror.Model(unit, shuffled), conditions)
    np.testing.assert_allclose(mixed.transmission_error, plain.transmission_error, rtol=0, atol=1e-6 * ARCSEC)
    rows, at = {}, 0
    for e in effects[:count]:
        rows[id(e)] = plain.matrix[at : at + len(e.values)]
        at += len(e.values)
    expected = np.concatenate([rows[id(e)] for e in shuffled])
    np.testing.assert_allclose(mixed.matrix, expected, rtol=0, atol=1e-9 * abs(expected).max())


@pytest.mark.parametrize("torque", [None, 20e3])
@pytest.mark.parametrize("gears", [(), CARRIER_SIDE, PINS], ids=["none", "carrier side", "pins"])
def test_readings_are_added_exactly(gears: tuple[Effect, ...], torque: float | None) -> None:
    unit = rverror.reducer("RV-40E")
    theta = turn(101)
    time = np.linspace(0, 50, theta.size)
    extra = (
        *READINGS,
        effect("sensor.ratio_error", slope=1e-5),
        effect("sensor.drift", total="12 arcsec"),
        effect("sensor.time_offset", offset="4 ms"),
    )
    conditions = OperatingConditions(theta, 1.0, torque, time)
    without = predict(rverror.Model(unit, gears), conditions)
    found = predict(rverror.Model(unit, gears + extra), conditions)
    speed = (theta[-1] - theta[0]) / 50
    written_out = (
        (9 * np.cos(theta) - 4 * np.sin(theta) + 300 / unit.ratio * np.cos(2 * unit.ratio * theta)) * ARCSEC
        + 1e-5 * theta
        + 12 * ARCSEC * np.linspace(0, 1, theta.size)
        + 4e-3 * speed
    )
    np.testing.assert_allclose(found.transmission_error - without.transmission_error, written_out, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.matrix[len(without.matrix)], np.cos(theta), rtol=0, atol=1e-15)


@pytest.mark.parametrize("gears", [CARRIER_SIDE, PINS], ids=["carrier side", "pins"])
@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_torsion_holds_the_output_back_against_its_motion(gears: tuple[Effect, ...], direction: float) -> None:
    unit = rverror.reducer("RV-40E")
    conditions = OperatingConditions(turn(101), direction, 20e3)
    without = predict(rverror.Model(unit, gears), conditions)
    found = predict(rverror.Model(unit, (effect("load.torsion", compliance="3 arcsec/(N*m)"), *gears)), conditions)
    wound = found.transmission_error - without.transmission_error
    np.testing.assert_allclose(wound, -direction * 60 * ARCSEC, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.matrix[1:], without.matrix, rtol=0, atol=1e-15)


def test_without_torque_the_closed_form_predicts() -> None:
    model = rverror.Model(rverror.reducer("RV-40E"), CARRIER_SIDE + READINGS + PINS)
    theta = turn(64)
    for direction in (1.0, -1.0):
        conditions = OperatingConditions(theta, direction)
        found = predict(model, conditions)
        assert found.softening is found.poses is None
        np.testing.assert_array_equal(
            found.transmission_error, rverror.transmission_error(model, theta, direction=direction)
        )


def test_a_drive_is_never_solved() -> None:
    drive = rverror.Drive(ratio=14.0, shafts={"motor": 14.0, "wheel": 3.5})
    model = rverror.Model(drive, (effect("shaft.eccentricity", shaft="wheel", harmonic=2, cos="5 arcsec"),))
    theta = turn(50)
    found = predict(model, OperatingConditions(theta, 1.0, torque=20e3))
    np.testing.assert_allclose(found.transmission_error, 5 * ARCSEC * np.cos(7 * theta), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.matrix, [np.cos(7 * theta), np.sin(7 * theta)], rtol=0, atol=1e-12)


@pytest.mark.parametrize("torque", [None, 20e3])
def test_a_model_without_effects(torque: float | None) -> None:
    found = predict(rverror.Model(rverror.reducer("RV-40E")), OperatingConditions(turn(40), 1.0, torque))
    assert found.matrix.shape == (0, 40)
    assert spread(found.transmission_error) < 0.01 * ARCSEC


@pytest.mark.parametrize("pins", [(), PINS], ids=["carrier side", "pins"])
@pytest.mark.parametrize("torque", [None, 0.412], ids=["closed form", "equilibrium"])
def test_matrix_is_the_derivative(torque: float | None, pins: tuple[Effect, ...]) -> None:
    """A millionth of all sizes and of the load: contacts carry as at full size, but nothing is of second order."""
    small = tuple(replace(e, values=tuple(v * 1e-6 for v in e.values)) for e in CARRIER_SIDE + pins + READINGS)
    model = rverror.Model(rverror.reducer("RV-40E", gear_backlash=2e-8), small)
    conditions = OperatingConditions(turn(40), 1.0, torque)
    found = predict(model, conditions)
    values = [v for e in model.effects for v in e.values]
    step = 1e-13
    for at, row in enumerate(found.matrix):
        sides = []
        for sign in (1, -1):
            moved, shifted = iter([v + sign * step * (i == at) for i, v in enumerate(values)]), []
            for e in model.effects:
                shifted.append(replace(e, values=tuple(next(moved) for _ in e.values)))
            sides.append(predict(replace(model, effects=tuple(shifted)), conditions).transmission_error)
        slope = (sides[0] - sides[1]) / (2 * step)
        scale = max(abs(row).max(), 1e-5)
        np.testing.assert_allclose(slope, row, rtol=0, atol=1e-3 * scale, err_msg=f"parameter {at}")


def test_what_acts_beyond_the_contacts_keeps_to_the_zero_of_the_bench() -> None:
    """Marks that are ahead turn the gear train under it, in an equilibrium as in a prediction."""
    theta = 2 * np.pi * np.arange(512) / 512
    tilt, ahead = effect("sensor.output_tilt", x="6 arcsec/(kN*m)"), effect("sensor.index_offset", offset="20 deg")
    model = rverror.Model(rverror.reducer("RV-40E"), (tilt, ahead))
    predicted = predict(model, OperatingConditions(theta, 1.0, 200e3)).transmission_error
    solved = rverror.equilibrium(model, theta, torque="200 N*m", direction="forward").transmission_error
    np.testing.assert_allclose(solved, predicted, rtol=0, atol=1e-9)
    turned = rverror.equilibrium(replace(model, effects=(ahead,)), theta, torque="200 N*m", direction="forward")
    read = rverror.influence(model.mechanism, theta, tilt.key, direction="forward", torque="200 N*m").matrix
    np.testing.assert_allclose(solved - turned.transmission_error, tilt.values @ read, rtol=0, atol=1e-9)
