"""What the gears do and what the bench reads: each public function of a model puts the gear train at its marks.

A model whose marks are ahead by an angle does at theta what the same model on its marks does at theta plus that angle;
what only misreads the output neither turns with the marks nor moves the output.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import rverror
from modules import PUBLIC, named
from rverror.geartrain.contacts import pose
from rverror.model.readings import added, beyond, felt, misread, stand, unread
from rverror.tolerances.loaded_yield import loaded_units, standard_draws

ARCSEC = np.pi / 648000
N = 64
STEPS = 7  # of 2 pi / N: the marks are ahead by whole steps, so that whole turns are rows rolled on
AHEAD = 2 * np.pi * STEPS / N
THETA = 2 * np.pi * np.arange(N) / N

PARTS = (
    rverror.effect("cycloid.pin_position", pin=11, radial="-20 um", tangential="30 um", uncertainty="1 um"),
    rverror.effect("crank.eccentricity", crank=0, disc=1, radial="8 um", uncertainty="1 um"),
    rverror.effect("coupling.bearing_clearance", clearance="3 um"),
)
READ = rverror.effect("sensor.encoder_eccentricity", cos="9 arcsec")
MARKS = rverror.effect("sensor.index_offset", offset=AHEAD)
UNIT = rverror.reducer("RV-40E")
ON_MARKS = rverror.Model(UNIT, PARTS)
AHEAD_OF_ZERO = rverror.Model(UNIT, (*PARTS, MARKS))


def waveform(function: Callable[..., Any], **options: Any) -> Callable[[rverror.Model], np.ndarray]:
    """What a function of a model and angles gives, samples last."""
    return lambda model: np.asarray(function(model, THETA, **options))


def of_runs(runs: tuple[rverror.Run, ...]) -> np.ndarray:
    return np.stack([run.error(UNIT)[:: int(run.direction[0])] for run in runs])


def at_speed(model: rverror.Model) -> np.ndarray:
    """Every so many of the angles that it solves."""
    found = rverror.dynamics.speed_response(model, [0.0, 100.0], torque=20e3)
    return found.transmission_error[:, :: found.theta.size // N]


def in_time(model: rverror.Model) -> np.ndarray:
    """One output turn at an even speed, which begins on the periodic motion."""
    turn = 2 * np.pi * 121 / 500.0
    return rverror.dynamics.run_up(
        model, [0, turn], [500.0] * 2, torque=20e3, kept=1, samples=N + 1
    ).transmission_error[:-1]


def rolled_stack(model: rverror.Model) -> np.ndarray:
    made = rverror.tolerances.stack(model, [rverror.tolerance("cycloid.disc_bore_position", "5 um")], THETA)
    return np.concatenate([made.nominal[None], made.influence])


#: How each public function that takes a model is asked for rows of samples over one turn.
ROWS: dict[str, Callable[[rverror.Model], np.ndarray]] = {
    "transmission_error": waveform(rverror.transmission_error, torque=20e3),
    "transmission_error_by_effect": lambda model: rverror.model.transmission_error_by_effect(model, THETA)[
        : len(PARTS)
    ],
    "equilibrium": lambda model: rverror.equilibrium(model, THETA, torque=20e3).transmission_error,
    "linearise": lambda model: (
        rverror.statics.linearise(model, THETA, torque=20e3).forces["pin"].sum(axis=0).reshape(-1, N)
    ),
    "contact_pressure": lambda model: (
        rverror.statics.contact_pressure(model, THETA, torque=20e3, disc_width=9.0, gear_width=8.0)
        .pressure["pin"]
        .sum(axis=1)
    ),
    "efficiency": lambda model: (
        rverror.statics.efficiency(
            model, THETA, torque=20e3, friction=rverror.geartrain.Friction(pin=0.1, mesh=0.1)
        ).error_change
    ),
    "duty_efficiency": lambda model: (
        rverror.statics.duty_efficiency(
            model,
            THETA,
            duty=rverror.statics.DutyPhase(torque=20e3, speed=1.0),
            friction=rverror.geartrain.Friction(pin=0.1, mesh=0.1),
        )
        .phases[0]
        .error_change
    ),
    "hysteresis": lambda model: (
        rverror.statics.hysteresis(
            model, THETA, torques=[-20e3, 20e3], friction=rverror.geartrain.Friction(pin=0.1)
        ).rising
    ),
    "lost_motion": waveform(rverror.lost_motion),
    "backlash": waveform(rverror.statics.backlash),
    "torsion_curve": lambda model: rverror.statics.torsion_curve(model, THETA, torques=[-20e3, 20e3]).angle,
    "torsional_stiffness": waveform(rverror.statics.torsional_stiffness),
    "simulate": lambda model: of_runs((rverror.simulate(model, points=N, method="equilibrium", torque=20e3),)),
    "simulate_runs": lambda model: of_runs(rverror.runs.simulate_runs(model, points=N)),
    "stack": rolled_stack,
    "speed_response": at_speed,
    "run_up": in_time,
}
#: Those that no row of samples comes of: tested elsewhere, or they hold no angle.
OTHERS = {
    "diagnose_outsiders": "each by `diagnose`: tests/lots/test_outsider_diagnosis.py",
    "match": "of units at the load: below",
    "trend": "of sessions as `lot` of units: tests/life/test_over_life.py",
    "lot_of_drives": "of drives, which have no marks",
    "lot": "of units whose orders are told from the marks on: tests/lots/test_made.py",
    "modes": "at one angle: below",
    "fit_running_in": "by `wear`: tests/statics/test_running_in.py",
    "wear": "over whole turns: tests/statics/test_wear.py",
    "diagnose": "test_unknown_index: marks off are found again",
    "unit_error": "by `transmission_error_by_effect`, which is above",
    "unit_of_parts": "it adds effects and asks for nothing",
    "allocate": "of a stack, which is above",
    "allocate_at_load": "of units at the load: below",
    "error_budget": "of a stack, which is above, and of units at the load: below",
}


def test_every_public_function_that_takes_a_model_is_here() -> None:
    takes = set()
    for name, full in PUBLIC.items():
        thing = named(full)
        if inspect.isfunction(thing) and next(iter(inspect.signature(thing).parameters), "") == "model":
            takes.add(name)
    assert takes == set(ROWS) | set(OTHERS)


@pytest.mark.parametrize("name", ROWS)
def test_the_gear_train_stands_at_its_marks(name: str) -> None:
    shifted, plain = ROWS[name](AHEAD_OF_ZERO), ROWS[name](ON_MARKS)
    assert np.ptp(plain, axis=-1).max() > 1e-3 * np.abs(plain).max()  # or no turn of it would show
    np.testing.assert_allclose(shifted, np.roll(plain, -STEPS, axis=-1), rtol=1e-6, atol=1e-9 * np.abs(plain).max())


def test_modes_are_those_of_the_gear_train_at_its_marks() -> None:
    at_zero, ahead = (rverror.dynamics.modes(ON_MARKS, theta=angle, torque=20e3).frequency for angle in (0.0, AHEAD))
    assert np.abs(ahead / at_zero - 1).max() > 1e-3
    np.testing.assert_allclose(
        rverror.dynamics.modes(AHEAD_OF_ZERO, theta=0.0, torque=20e3).frequency, ahead, rtol=1e-6
    )


@pytest.mark.parametrize("name", ["lost_motion", "backlash", "torsion_curve", "torsional_stiffness", "hysteresis"])
def test_misreading_is_no_turn_of_the_output(name: str) -> None:
    read = AHEAD_OF_ZERO.with_effects(READ)
    np.testing.assert_array_equal(ROWS[name](read), ROWS[name](AHEAD_OF_ZERO))


def test_compliance_beyond_the_contacts_is_a_turn_of_the_output() -> None:
    """A compliance c adds 2 T c to the turn between a torque of either sense."""
    soft = AHEAD_OF_ZERO.with_effects(rverror.effect("load.torsion", compliance=1e-9))
    torque = 0.03 * 412e3
    more = rverror.lost_motion(soft, THETA) - rverror.lost_motion(AHEAD_OF_ZERO, THETA)
    np.testing.assert_allclose(more, 2 * torque * 1e-9, rtol=1e-6)


@pytest.mark.parametrize("name", ["transmission_error", "equilibrium", "simulate", "stack"])
def test_the_measuring_chain_keeps_to_the_zero_of_the_bench(name: str) -> None:
    more = ROWS[name](AHEAD_OF_ZERO.with_effects(READ)) - ROWS[name](AHEAD_OF_ZERO)
    np.testing.assert_allclose(np.atleast_2d(more)[0], 9 * ARCSEC * np.cos(THETA), atol=1e-12)


def test_units_at_the_load_stand_at_their_marks() -> None:
    """Over whole turns the sizes of a turned waveform are those of the waveform, of the same angles."""
    width = [rverror.tolerance("cycloid.disc_bore_position", "5 um")]
    ahead = rverror.Model(UNIT, (*PARTS, rverror.effect("sensor.index_offset", offset=2 * np.pi / 16)))
    limits = [rverror.limit("transmission_error", torque="20 N*m"), rverror.limit("lost_motion")]
    sizes = []
    for model in (ON_MARKS, ahead):
        units = loaded_units(model, width, limits)
        drawn = standard_draws(units.stack, 8, seed=0, stream=0)
        sizes.append(units.solved(drawn, units.stack.width).turns)
    np.testing.assert_allclose(sizes[1], sizes[0], rtol=1e-6)


def test_an_effect_is_either_felt_or_beyond_or_on_the_marks() -> None:
    effects = (*PARTS, MARKS, READ, rverror.effect("load.torsion", compliance=1e-9))
    model = rverror.Model(UNIT, effects)
    assert felt(effects) == PARTS
    assert beyond(effects) == (READ, effects[-1])
    assert misread(model) == (READ,)
    assert unread(model).effects == (*PARTS, MARKS, effects[-1])
    read = pose(UNIT, THETA, direction=1, torque=20e3)
    where = stand(model, read)
    assert where.read is read
    np.testing.assert_allclose(where.gears.theta, THETA + AHEAD)
    assert where.of("cycloid.pin_position") is where.gears
    assert where.of("sensor.encoder_eccentricity") is read
    np.testing.assert_allclose(added(effects, read), 9 * ARCSEC * np.cos(THETA) - 20e3 * 1e-9, rtol=1e-12)
