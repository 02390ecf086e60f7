"""Torque over the output angle: each angle is that of its own constant torque, and a turn gives back what it takes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from tests.oracle import Errors, Oracle, Springs, put

import rverror
from rverror.geartrain.torque_over_turn import TorqueWaves, fitted_torque
from rverror.model.effects import Effect
from rverror.statics.loaded_state import statics_of

UNIT = rverror.reducer("RV-40E")
ARM = rverror.geartrain.GravityArm(mass="20 kg", lever="0.5 m", offset="30 deg")
#: Level, lifted, beyond the top, coming down, and close to where the weight turns from one side to the other.
THETA = np.radians([30.0, 71.3, 118.0, 122.0, 163.7, 210.0, 251.9, 298.0, 305.2])
ERRORS: tuple[Effect, ...] = (
    rverror.effect("cycloid.pin_position", pin=3, radial="5 um", tangential="-4 um"),
    rverror.effect("crank.eccentricity", crank=0, disc=1, radial="3 um", tangential="2 um"),
    rverror.effect("cycloid.disc_pitch", disc=0, harmonic=1, cos="4 um", sin="1 um"),
)
ARCSEC = rverror.ARCSEC


def turned(model: rverror.Model, theta: Any, **conditions: Any) -> np.ndarray:
    return rverror.equilibrium(model, theta, **conditions).transmission_error


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_every_angle_is_that_of_its_own_constant_torque(direction: float) -> None:
    """Of either way of the motion: without friction the pose knows the torque alone."""
    clearance = rverror.effect("crank.bearing_clearance", clearance="3 um")
    model = rverror.Model(UNIT, (*ERRORS, clearance, rverror.effect("load.torsion", compliance="0.3 arcsec/(N*m)")))
    found, load = turned(model, THETA, torque=ARM, direction=direction), ARM(THETA)
    alone = [
        turned(model, [angle], torque=f"{abs(size)} N*mm", direction=math.copysign(1.0, size))[0]
        for angle, size in zip(THETA, load, strict=True)
    ]
    np.testing.assert_allclose(found, alone, atol=1e-7 * ARCSEC)
    np.testing.assert_array_equal(found, turned(model, THETA, torque=load, direction=direction))


def test_a_housing_that_turns_is_loaded_alike() -> None:
    unit = rverror.reducer("RV-40E", output="housing")
    found = turned(rverror.Model(unit, ERRORS), THETA, torque=ARM, direction=-1.0)
    for angle, size, one in zip(THETA, ARM(THETA), found, strict=True):
        alone = turned(
            rverror.Model(unit, ERRORS), [angle], torque=f"{abs(size)} N*mm", direction=math.copysign(1, size)
        )
        np.testing.assert_allclose(one, alone[0], atol=1e-7 * ARCSEC)


def test_the_weight_keeps_to_the_angle_of_the_bench() -> None:
    """Of gears whose marks are ahead of it: they stand elsewhere, the arm does not."""
    marked = rverror.Model(UNIT, (*ERRORS, rverror.effect("sensor.index_offset", offset="20 deg")))
    there = turned(rverror.Model(UNIT, ERRORS), THETA + math.radians(20), torque=ARM(THETA), direction=1.0)
    np.testing.assert_allclose(turned(marked, THETA, torque=ARM, direction=1.0), there, atol=1e-7 * ARCSEC)


def test_each_angle_is_that_of_the_oracle() -> None:
    """One angle at a time, at its own torque; a quarter of errors, play and load opens the same contacts.

    What the kinematics of first order leave out is quadratic in the errors, so that a quarter leaves a sixteenth.
    """
    left_out = {}
    for scale in (1.0, 0.25):
        unit = rverror.reducer("RV-40E", gear_backlash=scale * 0.02)
        small = tuple(Effect(e.key, e.indices, tuple(scale * v for v in e.values)) for e in ERRORS)
        load = scale * ARM(THETA)
        found, stiff = turned(rverror.Model(unit, small), THETA, torque=load, direction=1.0), unit.stiffness
        springs = Springs(
            pin=stiff.pin_contact, cam=stiff.crank_bearing, carrier=stiff.carrier_bearing,
            mesh=stiff.gear_mesh, sun=stiff.sun_support, main=stiff.main_bearing,
        )  # fmt: skip
        errors = Errors(unit, 1)
        for item in small:
            for name, size in zip([p.name for p in rverror.CATALOGUE[item.key].parameters], item.values, strict=True):
                put(errors, unit, 0, (item.key, dict(item.indices), name), size)
        errors.thinning[:] += unit.gear_backlash / math.cos(unit.pressure_angle)
        other = [
            Oracle(unit, [angle], sense=int(np.sign(size)), torque=abs(size), springs=springs).solve(errors)[0, 0, 2]
            for angle, size in zip(THETA, load, strict=True)
        ]
        left_out[scale] = np.abs(found - other).max() / ARCSEC
    assert left_out[0.25] < 0.03
    assert left_out[1.0] < 24 * left_out[0.25]


def test_the_sides_are_the_backlash_apart_where_the_torque_vanishes() -> None:
    """Of a unit without errors: the flanks' play over R r1 cos(alpha), half of it to either side, and no windup."""
    top = math.radians(120.0)
    near = turned(rverror.Model(UNIT), [top - 1e-9, top + 1e-9], torque=ARM, direction=1.0)
    free = UNIT.gear_backlash / (UNIT.ratio * UNIT.sun_pitch_radius * math.cos(UNIT.pressure_angle))
    np.testing.assert_allclose(near, [-free / 2, free / 2], rtol=1e-4)
    # no torque at all: the side of the motion, as in the limit
    none = turned(rverror.Model(UNIT), [top, top], torque=[0.0, 0.0], direction=[1.0, -1.0])
    np.testing.assert_allclose(none, [-free / 2, free / 2], rtol=1e-4)


def test_a_turn_gives_back_what_it_takes() -> None:
    """Energy over a turn: E(theta, T), the least of elastic energy less the work of the load, is the same after it.

    It changes with the torque by the output's error, and with the angle by what the input gives beyond T/R (virtual
    work): over a turn the input gives what the load takes by way of the error.  The load has a wave of order 40, as the
    error of the disc, or either would be nearly nothing.
    """
    n, h = 9973, 1e-5  # a prime: no order of the gears folds onto the mean
    theta = 2 * np.pi * np.arange(n) / n
    load = ARM(theta) + 4e4 + 2e4 * np.cos(40 * theta)
    change = -ARM.mass * ARM.gravity * ARM.lever * np.sin(theta - ARM.offset) - 8e5 * np.sin(40 * theta)

    def least(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = statics_of(UNIT, rverror.geartrain.OperatingConditions(at, 1.0, load=load)).settled(ERRORS)
        return found.solution.energy, found.transmission_error

    by_input = np.mean(least(theta + h)[0] - least(theta - h)[0]) * 2 * np.pi / (2 * h)
    by_load = np.mean(least(theta)[1] * change) * 2 * np.pi
    assert abs(by_load) > 20  # N*mm
    assert abs(by_input + by_load) < 3e-4 * abs(by_load)


def test_compliance_beyond_the_contacts_follows_the_weight() -> None:
    soft = rverror.Model(UNIT, (rverror.effect("load.torsion", compliance="0.5 arcsec/(N*m)"),))
    for predict in (turned, rverror.transmission_error):
        more = predict(soft, THETA, torque=ARM, direction=-1.0) - predict(
            rverror.Model(UNIT), THETA, torque=ARM, direction=-1.0
        )
        np.testing.assert_allclose(more, -0.5 * ARCSEC * ARM(THETA) / 1e3, rtol=1e-6, atol=1e-12)


def test_the_closed_form_takes_the_side_that_the_torque_closes() -> None:
    model = rverror.Model(UNIT, ERRORS)
    found = rverror.transmission_error(model, THETA, torque=ARM, direction=1.0)
    sides = [rverror.transmission_error(model, THETA, direction=side) for side in (1.0, -1.0)]
    np.testing.assert_array_equal(found, np.where(ARM(THETA) > 0, *sides))
    assert np.ptp(np.subtract(*sides)) > ARCSEC  # or no side would show


def test_forces_of_an_arm_are_those_of_its_side() -> None:
    """The sun's turn is held, so that its flanks bear T/R at its base circle, on the side of the torque's sign."""
    force = rverror.equilibrium(rverror.Model(UNIT), THETA, torque=ARM, direction=1.0).contact_forces["mesh"]
    size = np.linalg.norm(force, axis=2).sum(axis=0)
    at_sun = ARM(THETA) / (UNIT.ratio * UNIT.sun_pitch_radius * math.cos(UNIT.pressure_angle))
    np.testing.assert_allclose(size[0] - size[1], at_sun, rtol=1e-6)


@pytest.mark.parametrize(
    ("given", "what"),
    [
        ({"mass": "0 kg"}, "mass"),
        ({"lever": "-1 m"}, "lever"),
        ({"mass": "2 m"}, "mass"),
        ({"gravity": 0.0}, "gravity"),
    ],
)
def test_an_arm_that_is_none_is_refused(given: dict[str, Any], what: str) -> None:
    with pytest.raises(ValueError, match=what):
        rverror.geartrain.GravityArm(**{"mass": "20 kg", "lever": "0.5 m", **given})


@pytest.mark.parametrize("torque", [[1e3, 2e3], lambda theta: theta[:2], [1e3] * 8 + [np.nan]])
def test_a_torque_of_another_shape_is_refused(torque: Any) -> None:
    with pytest.raises(ValueError, match=r"torque|finite"):
        rverror.equilibrium(rverror.Model(UNIT), THETA, torque=torque)


def test_losses_are_not_found_at_a_torque_that_changes() -> None:
    where = rverror.geartrain.OperatingConditions(THETA, 1.0, load=ARM(THETA))
    with pytest.raises(ValueError, match="changes over the turn"):
        rverror.statics.efficiency(
            rverror.Model(UNIT), where, torque=None, friction=rverror.geartrain.Friction(pin=0.1)
        )


def test_a_column_without_its_noise() -> None:
    """A weight has three sizes, and three sizes of n samples hold sigma sqrt(3 / n) of white noise."""
    theta, sigma = np.linspace(0, 4 * np.pi, 4000, endpoint=False), 3e3
    left = []
    for seed in range(20):
        noise = sigma * np.random.default_rng(seed).normal(size=theta.size)
        left.append(np.mean((fitted_torque(theta, ARM(theta) + noise)(theta) - ARM(theta)) ** 2))
    assert math.sqrt(np.mean(left)) == pytest.approx(sigma * math.sqrt(3 / theta.size), rel=0.25)


def test_a_part_of_a_turn_keeps_to_the_weight_between_its_ends() -> None:
    theta = np.linspace(1.0, 2.0, 500)
    np.testing.assert_allclose(fitted_torque(theta, ARM(theta))(theta), ARM(theta), rtol=1e-9, atol=1e-3)


def test_a_load_that_is_changed_within_the_run_is_no_function_of_the_angle() -> None:
    theta = np.linspace(0, 4 * np.pi, 1000)
    with pytest.raises(ValueError, match="split the run"):
        fitted_torque(theta, np.where(theta < 2 * np.pi, 1.0, 3.0) * ARM(theta))


def test_where_waves_cross() -> None:
    """3 + 5 cos + 4 sin of an angle crosses where the cosine of its distance from atan2(4, 5) is -3 / sqrt(41)."""
    waves, middle, away = TorqueWaves((3.0, 5.0), (4.0,)), math.atan2(4, 5), math.acos(-3 / math.sqrt(41))
    np.testing.assert_allclose(waves.crossings(), [middle + away, middle - away + 2 * np.pi], atol=1e-5)
    assert waves.peak == pytest.approx(3 + math.sqrt(41), rel=1e-6)
