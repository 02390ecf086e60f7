"""What an engineer types in a notebook: units as people write them, angles and torques left out, methods, addition."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pint
import pytest

import rverror
from rverror.base.units import ARCSEC, parse
from rverror.geartrain.kinematics import OVERSAMPLING, fundamental_orders, whole_turn

UNIT = rverror.reducer("RV-40E")
CAM = rverror.effect("crank.eccentricity", crank=0, disc=1, radial="5 um")
GAP = rverror.effect("coupling.bearing_clearance", clearance="3 um")
MODEL = rverror.Model(UNIT, (CAM,))
QUANTITY = pint.UnitRegistry().Quantity
#: Every way to say 30 degrees.
ANGLES = ["30 deg", "1800 arcmin", math.pi / 6, np.float64(math.pi / 6), QUANTITY(30, "deg"), [math.pi / 6]]
TORQUE_WORDS = ["78 Nm", "78 N*m", "78 N·m", "78 N⋅m", "78 N m", "78Nm", "0.078 kNm", "78000 Nmm", QUANTITY(78, "N*m")]


@pytest.mark.parametrize("written", TORQUE_WORDS, ids=str)
def test_newton_metres_in_every_spelling(written: object) -> None:
    assert rverror.base.to_core(written, "torque") == pytest.approx(78e3, rel=1e-14)


@pytest.mark.parametrize(
    ("plain", "spelled", "dimension"),
    [
        ("2 arcsec/(N*m)", "2 arcsec/Nm", "compliance"),
        ("2 N*m/rad", "2 Nm/rad", "torsional_stiffness"),
        ("2 N*m/arcmin", "2 N·m/arcmin", "torsional_stiffness"),
    ],
)
def test_newton_metres_inside_other_units(plain: str, spelled: str, dimension: str) -> None:
    assert parse(spelled, dimension) == parse(plain, dimension)


def test_newtons_per_millimetre_and_nanometres_stay_what_they_are() -> None:
    assert parse("2 N/mm", "stiffness") == 2.0
    assert parse("2 nm", "length") == pytest.approx(2e-6)


def test_torque_in_newton_metres_wherever_a_torque_is_given() -> None:
    reducer, theta = rverror.reducer("RV-40E", rated_torque="412 Nm"), [0.1]
    assert reducer.rated_torque == 412e3
    model = rverror.Model(reducer, (rverror.effect("load.torsion", compliance="2 arcsec/Nm"),))
    friction = rverror.geartrain.Friction(pin=0.1)
    widths = {"disc_width": "9 mm", "gear_width": "8 mm"}
    tolerances, row = [rverror.tolerance("crank.eccentricity", "5 um")], np.linspace(0, 1, 32)
    for ask in (
        lambda t: model.transmission_error(theta, torque=t),
        lambda t: rverror.equilibrium(model, theta, torque=t).transmission_error,
        lambda t: rverror.statics.linearise(model, theta, torque=t).forces["pin"],
        lambda t: rverror.influence(reducer, theta, "load.torsion", torque=t).matrix,
        lambda t: rverror.statics.torsion_curve(model, theta, torques=[t]).angle,
        lambda t: rverror.statics.efficiency(model, theta, torque=t, friction=friction).losses["pin"],
        lambda t: rverror.statics.hysteresis(model, theta, torques=[t], friction=friction).rising,
        lambda t: rverror.statics.contact_pressure(model, theta, torque=t, **widths).pressure["pin"],
        lambda t: rverror.dynamics.modes(model, torque=t).frequency,
        lambda t: rverror.simulate(model, points=16, torque=t).output_angle,
        lambda t: rverror.tolerances.stack(model, tolerances, theta, torque=t).nominal,
        lambda t: rverror.run_from_arrays(input_angle=121 * row, output_angle=row, torque=t).torque,
    ):
        np.testing.assert_array_equal(ask("20 Nm"), ask(20e3))


@pytest.mark.parametrize("theta", ANGLES, ids=repr)
def test_an_angle_in_every_form(theta: object) -> None:
    expected = {"rtol": 1e-12, "atol": 1e-18}
    row = np.array([math.pi / 6])
    np.testing.assert_allclose(rverror.transmission_error(MODEL, theta), MODEL.transmission_error(row), **expected)
    one, other = (rverror.influence(UNIT, at, "cycloid.pin_position", pin=3).matrix for at in (theta, row))
    np.testing.assert_allclose(one, other, **expected)
    one, other = (rverror.model.transmission_error_by_effect(MODEL, at) for at in (theta, row))
    np.testing.assert_allclose(one, other, **expected)


@pytest.mark.parametrize("theta", ANGLES[:1] + ANGLES[-2:-1], ids=repr)
def test_an_angle_in_every_form_in_the_statics(theta: object) -> None:
    row, friction = np.array([math.pi / 6]), rverror.geartrain.Friction(pin=0.1)
    for ask in (
        lambda at: rverror.equilibrium(MODEL, at, torque="20 Nm").transmission_error,
        lambda at: MODEL.equilibrium("20 Nm", at).transmission_error,
        lambda at: rverror.statics.linearise(MODEL, at, torque="20 Nm").forces["pin"],
        lambda at: rverror.statics.backlash(MODEL, at),
        lambda at: rverror.lost_motion(MODEL, at),
        lambda at: rverror.statics.torsional_stiffness(MODEL, at),
        lambda at: rverror.statics.torsion_curve(MODEL, at, torques=["20 Nm"]).angle,
        lambda at: rverror.statics.efficiency(MODEL, at, torque="20 Nm", friction=friction).losses["pin"],
        lambda at: rverror.statics.hysteresis(MODEL, at, torques=["20 Nm"], friction=friction).rising,
        lambda at: rverror.tolerances.stack(MODEL, [rverror.tolerance("crank.eccentricity", "5 um")], at).nominal,
    ):
        np.testing.assert_allclose(ask(theta), ask(row), rtol=1e-9, atol=1e-15)


def test_methods_are_the_functions() -> None:
    theta, torque = [0.1, 0.2], "78 Nm"
    np.testing.assert_array_equal(MODEL.transmission_error(theta), rverror.transmission_error(MODEL, theta))
    asked, given = MODEL.equilibrium(torque, theta), rverror.equilibrium(MODEL, theta, torque=torque)
    np.testing.assert_array_equal(asked.transmission_error, given.transmission_error)
    asked_one = MODEL.influence(theta, "cycloid.pin_position", pin=3, direction=-1)
    given_one = rverror.influence(UNIT, theta, "cycloid.pin_position", pin=3, direction=-1)
    np.testing.assert_array_equal(asked_one.matrix, given_one.matrix)
    reverse = MODEL.equilibrium(torque, theta, direction=-1).transmission_error
    assert (reverse > asked.transmission_error).all()  # the load resists: it lags backwards


def test_the_former_order_of_an_influence_is_told_and_understood() -> None:
    now = MODEL.influence([0.1, 0.2], "crank.index", crank=0)
    with pytest.warns(DeprecationWarning, match=r"model\.influence\(theta, key\) now") as told:
        former = MODEL.influence("crank.index", [0.1, 0.2], crank=0)
    assert told[0].filename == __file__
    np.testing.assert_array_equal(former.matrix, now.matrix)


def test_a_model_and_an_effect_make_a_new_model() -> None:
    more = MODEL + GAP
    assert more.effects == (CAM, GAP)
    assert MODEL.effects == (CAM,)
    assert more == MODEL.with_effects(GAP)
    assert rverror.Model(UNIT, [CAM]) == MODEL  # a list is a row of effects too


def test_angles_left_out_are_a_turn_that_holds_the_highest_order() -> None:
    """A wave of the highest order has at least 2.5 samples, and there is no end that repeats the beginning."""
    highest = max(fundamental_orders(UNIT).values())
    theta = MODEL.angles
    assert theta.size >= 2 * OVERSAMPLING * highest
    np.testing.assert_allclose(np.diff(theta), 2 * math.pi / theta.size, rtol=1e-9)
    assert theta[-1] + theta[1] == pytest.approx(2 * math.pi)
    assert MODEL.transmission_error().shape == theta.shape
    assert MODEL.influence(key="crank.index", crank=0).theta.shape == theta.shape
    # an effect of a higher order asks for more
    fast = rverror.Model(UNIT) + rverror.effect("empirical.order", frame="sun", harmonic=25, cos="1 arcsec")
    assert fast.angles.size >= 2 * OVERSAMPLING * 25 * 120
    wave = fast.transmission_error()
    spectrum = 2 * np.abs(np.fft.rfft(wave)) / wave.size
    assert spectrum[25 * 120] == pytest.approx(ARCSEC, rel=1e-9)
    drive = rverror.Drive(ratio=-50.0, shafts={"motor": 900.0})
    assert whole_turn(drive).size >= 2 * OVERSAMPLING * 4 * 900


def test_torque_left_out_is_the_rated_one_or_asked_for() -> None:
    rated, given = MODEL.equilibrium(theta=0.1), MODEL.equilibrium("412 Nm", 0.1)
    np.testing.assert_array_equal(rated.transmission_error, given.transmission_error)
    with pytest.raises(ValueError, match=r"give torque='20 N\*m', or the reducer its rated_torque"):
        rverror.Model(rverror.reducer("RV-003")).equilibrium(theta=0.1)


BY_NAME = {
    "sun_teeth": 12,
    "planet_teeth": 36,
    "module": "1.25 mm",
    "pressure_angle": QUANTITY(20, "deg"),
    "disc_lobes": 29,
    "pins": 30,
    "pin_circle_radius": "6.5 cm",
    "pin_radius": 3.0,
    "eccentricity": "1200 um",
    "cranks": 3,
    "discs": 2,
}


def test_a_reducer_by_its_parameters_alone() -> None:
    unit = rverror.reducer(**BY_NAME)
    assert unit.ratio == 1 + 36 / 12 * 30
    assert (unit.module, unit.pin_circle_radius, unit.eccentricity) == (1.25, 65.0, 1.2)
    assert unit.pressure_angle == pytest.approx(math.radians(20))
    assert (unit.rated_torque, unit.spline_radius, unit.name) == (None, None, "custom")  # nothing of a preset
    for name in BY_NAME:
        with pytest.raises(rverror.InputError, match=rf"no {name}; give .*reducer\('RV-40E', \.\.\.\)"):
            rverror.reducer(**{key: value for key, value in BY_NAME.items() if key != name})
    with pytest.raises(ValueError, match="did you mean 'pins'"):
        rverror.reducer(**BY_NAME, pin=30)


def test_presets_are_listed() -> None:
    assert [rverror.reducer(name).name for name in rverror.presets()] == list(rverror.presets())
    assert "RV-40E" in rverror.presets()


@pytest.mark.parametrize(
    ("key", "named", "told"),
    [
        ("crank.eccentricity", {"crank": 0, "disc": 0, "radial": 5}, "radial = 5 is taken as 5 mm.*write '5 um'"),
        ("cycloid.pin_circle", {"harmonic": 2, "radial_cos": -2.0}, "radial_cos = -2 is taken as -2 mm"),
        ("crank.index", {"crank": 0, "angle": 3.0}, "angle = 3 is taken as 3 rad.*write '3 arcsec'"),
    ],
)
def test_a_plain_number_that_no_workshop_makes_is_doubted(key: str, named: dict[str, float], told: str) -> None:
    with pytest.warns(UserWarning, match=told):
        rverror.effect(key, **named)


def test_a_size_with_a_unit_or_of_a_workshop_is_believed() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for radial in ("5 mm", QUANTITY(5, "mm"), 0.005, 0.05, 0.3):
            rverror.effect("crank.eccentricity", crank=0, disc=0, radial=radial)
        rverror.effect("sensor.index_offset", offset=2.0)  # marks stand anywhere
        rverror.tolerance("crank.eccentricity", "1 mm")


def test_a_plain_width_that_no_workshop_makes_is_doubted() -> None:
    with pytest.warns(UserWarning, match="tolerance = 5 is taken as 5 mm"):
        rverror.tolerance("crank.eccentricity", 5)
