"""What to measure next: against the table of DESIGN's closed loop, and what the physics of each pair says.

The shares are those of an independent statement: crank eccentricity, disc bore, disc pitch and planet eccentricity
leave 11 to 99 % of each other over both directions; another crank or disc of the same source leaves 0 %.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import permutations
from typing import Any

import numpy as np
import pytest

from rverror import CATALOGUE, Drive, Effect, effect, reducer
from rverror.diagnosis.next_run import Coverage, Measurement, folds, to_place, to_separate
from rverror.diagnosis.pairs import Pair, closed_form_states
from rverror.geartrain.kinematics import folded_order

UNIT = reducer("RV-40E")
STATES = closed_form_states(UNIT)
ONE_WAY = Coverage(directions=frozenset({1.0}), samples_per_turn=4096.0, torques=frozenset({20e3}))
BOTH = replace(ONE_WAY, directions=frozenset({1.0, -1.0}))
CRANK = effect("crank.eccentricity", crank=0, disc=0, radial="5 um", tangential="-2 um")
ORDER_40: tuple[tuple[str, dict[str, Any]], ...] = (
    ("crank.eccentricity", {"crank": 0, "disc": 0}),
    ("cycloid.disc_bore_position", {"disc": 0, "crank": 0}),
    ("cycloid.disc_pitch", {"disc": 0, "harmonic": 1}),
    ("involute.planet_eccentricity", {"crank": 0}),
)


def names(found: tuple[Measurement, ...]) -> list[str]:
    return [step.name for step in found]


def sized(key: str, indices: dict[str, Any]) -> Effect:
    return Effect(key, indices, tuple(0.004 / (1 + i) for i, _ in enumerate(CATALOGUE[key].parameters)))


@pytest.mark.parametrize(("first", "second"), list(permutations(ORDER_40, 2)))
def test_both_directions_tell_sources_of_order_40_apart_and_one_does_not(first: Any, second: Any) -> None:
    pair = Pair(sized(*first), second, ONE_WAY, STATES, STATES)
    assert pair.now < 0.03
    assert 0.1 < pair.both < 0.995
    steps = to_separate(UNIT, sized(*first), [second], ONE_WAY)
    assert steps[0].name == "reverse"
    assert steps[0].separates == (second,)
    assert "reverse" in steps[0].what


def test_the_missing_direction_is_asked_for() -> None:
    backwards = replace(ONE_WAY, directions=frozenset({-1.0}))
    assert to_separate(UNIT, CRANK, [ORDER_40[1]], backwards)[0].what == "a run forward at the same load"
    assert "reverse" not in names(to_separate(UNIT, CRANK, [ORDER_40[1]], BOTH))


@pytest.mark.parametrize("other", [{"crank": 1, "disc": 0}, {"crank": 0, "disc": 1}])
@pytest.mark.parametrize("coverage", [ONE_WAY, BOTH])
def test_which_crank_or_disc_needs_light_load(coverage: Coverage, other: dict[str, int]) -> None:
    pair = Pair(CRANK, ("crank.eccentricity", other), coverage, STATES, STATES)
    assert pair.both < 0.01
    steps = to_separate(UNIT, CRANK, [("crank.eccentricity", other)], coverage)
    assert steps[0].name == "light load"
    assert "2 N*m where these had 20 N*m" in steps[0].what
    assert not {"reverse", "heavy load", "longer"} & set(names(steps))


def test_what_differs_in_the_linear_waveforms_is_settled_by_heavy_load_or_patience() -> None:
    steps = to_separate(UNIT, CRANK, [ORDER_40[2]], BOTH)
    assert names(steps)[:2] == ["heavy load", "longer"]
    assert "200 N*m where these had 20 N*m" in steps[0].what


def test_no_load_beyond_the_rated_one_is_asked_for() -> None:
    assert UNIT.rated_torque == 412e3
    near = replace(BOTH, torques=frozenset({100e3}))
    assert "412 N*m where these had 100 N*m" in to_separate(UNIT, CRANK, [ORDER_40[2]], near)[0].what
    at_it = replace(BOTH, torques=frozenset({400e3}))
    assert "N*m" not in to_separate(UNIT, CRANK, [ORDER_40[2]], at_it)[0].what
    unknown = replace(BOTH, torques=frozenset())
    assert "N*m" not in to_separate(UNIT, CRANK, [ORDER_40[2]], unknown)[0].what


@pytest.mark.parametrize(
    ("named", "other", "wanted"),
    [
        ("sensor.encoder_eccentricity", ("cycloid.pin_position", {"pin": 3}), "encoder"),
        ("cycloid.pin_position", ("sensor.encoder_eccentricity", {}), "encoder"),
        ("sensor.encoder_eccentricity", ("sensor.ratio_error", {}), "encoder"),
        ("sensor.input_coupling", ("involute.sun_pitch", {"harmonic": 2}), "input coupling"),
        ("sensor.ratio_error", ("sensor.time_offset", {}), "speed"),
        ("sensor.ratio_error", ("sensor.drift", {}), "return"),
        ("crank.bearing_clearance", ("cycloid.disc_profile", {"disc": 0, "harmonic": 2}), "heavy load"),
        ("load.torsion", ("sensor.drift", {}), "heavy load"),
        ("thermal.growth", ("involute.tooth_thinning", {"member": "sun"}), "temperature"),
    ],
)
def test_each_kind_of_pair_has_its_measurement(named: str, other: tuple[str, dict[str, Any]], wanted: str) -> None:
    indices = {"cycloid.pin_position": {"pin": 11}, "sensor.input_coupling": {"harmonic": 1}}.get(named, {})
    assert wanted in names(to_separate(UNIT, sized(named, indices), [other], BOTH))


def test_which_gear_lost_the_tooth_is_never_visible_in_any_run() -> None:
    sun = effect("involute.tooth_thinning", member="sun", thinning="30 um")
    shared = replace(BOTH, shared_zero=True)
    steps = to_separate(UNIT, sun, [("involute.tooth_thinning", {"member": "planet"})], shared)
    assert names(steps) in (["light load"], ["parts"])


def test_an_unknown_zero_asks_for_the_marks() -> None:
    unknown = replace(BOTH, marks=False)
    twin = ("cycloid.pin_position", {"pin": 12})
    found = effect("cycloid.pin_position", pin=11, radial="9 um")
    assert names(to_separate(UNIT, found, [twin], unknown))[0] == "marks"
    assert "marks" not in names(to_separate(UNIT, found, [twin], BOTH))


# the preset does not tell the spline's radius
@pytest.mark.parametrize("key", [k for k, e in CATALOGUE.items() if e.applies_to(UNIT) and "spline" not in k])
def test_every_pair_of_the_catalogue_gets_an_answer(key: str) -> None:
    """Also those that no run separates: then the parts are to be measured."""
    entry = CATALOGUE[key]
    indices = next(iter(entry.candidates(UNIT)))
    twins = [("crank.eccentricity", {"crank": 1, "disc": 1}), ("sensor.encoder_eccentricity", {})]
    steps = to_separate(UNIT, sized(key, indices), twins, ONE_WAY)
    assert {cause[0] for step in steps for cause in step.separates} == {twin[0] for twin in twins}
    assert all(step.what and step.why for step in steps)


def test_a_lone_cause_of_the_measuring_chain_can_be_proved() -> None:
    (proof,) = to_separate(UNIT, effect("sensor.encoder_eccentricity", cos="4 arcsec"), [], BOTH)
    assert "remounted by 90 degrees" in proof.what
    assert to_separate(UNIT, CRANK, [], BOTH) == ()


# --- geared drives, whose runs may cover a part of a turn -------------------------------------------------------------

DRIVE = Drive(ratio=14.0, shafts={"motor": 14.0, "idler": 14.0, "stage": 15.0, "output": 1.0})
SHORT = Coverage(directions=frozenset({1.0}), samples_per_turn=math.inf, travel=(1.0, 1.7))
TURNS = replace(SHORT, travel=None)
ECCENTRIC, RATIO, DRIFT, DELAY, COUPLING, MOTOR, IDLER, STAGE, OUTPUT = (
    ("sensor.encoder_eccentricity", {}),
    ("sensor.ratio_error", {}),
    ("sensor.drift", {}),
    ("sensor.time_offset", {}),
    ("sensor.input_coupling", {"harmonic": 1}),
    *(("shaft.eccentricity", {"shaft": name, "harmonic": 1}) for name in ("motor", "idler", "stage", "output")),
)


def pair_of(effect: Effect, other: Any, coverage: Coverage) -> Pair:
    return Pair(effect, other, coverage, closed_form_states(DRIVE, coverage.travel), closed_form_states(DRIVE))


@pytest.mark.parametrize("half", [0.2, 0.35, 1.0])
def test_how_much_of_a_slope_an_encoder_makes_over_a_part_of_a_turn(half: float) -> None:
    """By the integrals over -a to a: x sin x to 2 (sin a - a cos a), x^2 to 2 a^3/3, sin^2 x to a - sin a cos a."""

    def left(a: float) -> float:
        product = 2 * (math.sin(a) - a * math.cos(a))
        return math.sqrt(1 - product**2 / (2 * a**3 / 3 * (a - math.sin(a) * math.cos(a))))

    pair = pair_of(sized(*RATIO), ECCENTRIC, replace(SHORT, travel=(2.0 - half, 2.0 + half)))
    assert pair.now == pytest.approx(left(half), rel=0.01)
    assert pair.whole == pytest.approx(left(math.pi), rel=0.01)


def test_a_slope_makes_an_encoder_s_flank_and_not_its_crest() -> None:
    """Where the wave is steep it is nearly straight; about its crest it is even, which a slope is not."""
    steep = Effect("sensor.encoder_eccentricity", {}, (0.0, 0.01))
    flank, crest = (replace(SHORT, travel=(at - 0.35, at + 0.35)) for at in (0.0, math.pi / 2))
    assert pair_of(steep, RATIO, flank).now < 0.03
    assert pair_of(steep, RATIO, crest).now == pytest.approx(1.0, abs=0.01)
    assert names(to_separate(DRIVE, steep, [RATIO], flank)) == ["whole turn", "encoder"]
    assert names(to_separate(DRIVE, steep, [RATIO], crest)) == ["encoder", "longer"]


@pytest.mark.parametrize(
    ("named", "other", "over_a_part", "over_turns"),
    [
        (RATIO, ECCENTRIC, ["whole turn", "encoder"], ["encoder", "longer"]),
        (DRIFT, ECCENTRIC, ["whole turn", "return", "encoder"], ["return", "encoder", "longer"]),
        (DRIFT, RATIO, ["return"], ["return"]),
        (RATIO, DRIFT, ["return"], ["return"]),
        (RATIO, DELAY, ["speed"], ["speed"]),
        (DELAY, RATIO, ["speed"], ["speed"]),
        (DRIFT, DELAY, ["return", "speed"], ["return", "speed"]),
        (MOTOR, COUPLING, ["input coupling"], ["input coupling"]),
        (COUPLING, MOTOR, ["input coupling"], ["input coupling"]),
        (ECCENTRIC, OUTPUT, ["encoder"], ["encoder"]),
        (MOTOR, IDLER, ["parts"], ["parts"]),
        (MOTOR, STAGE, ["whole turn", "longer"], ["longer"]),
    ],
)
def test_each_pair_of_a_drive_has_its_measurement(
    named: Any, other: Any, over_a_part: list[str], over_turns: list[str]
) -> None:
    """No longer run tells two of one waveform apart, and none asks for a whole turn where the runs have it."""
    assert names(to_separate(DRIVE, sized(*named), [other], SHORT)) == over_a_part
    assert names(to_separate(DRIVE, sized(*named), [other], TURNS)) == over_turns


def test_what_a_part_of_a_turn_hides_is_said_with_its_angle() -> None:
    (step, *_) = to_separate(DRIVE, sized(*RATIO), [ECCENTRIC, ("sensor.encoder_ellipticity", {})], SHORT)
    assert step.what == "a run over a whole output turn or more"
    assert (
        f"over {np.degrees(0.7):.3g} deg sensor.ratio_error cannot be distinguished from sensor.encoder_ecc" in step.why
    )
    assert [key for key, _ in step.separates] == ["sensor.encoder_eccentricity", "sensor.encoder_ellipticity"]


def test_the_speed_and_the_direction_that_are_missing_are_asked_for() -> None:
    (one_way,) = to_separate(DRIVE, sized(*RATIO), [DELAY], SHORT)
    (both,) = to_separate(DRIVE, sized(*RATIO), [DELAY], replace(SHORT, directions=frozenset({1.0, -1.0})))
    assert one_way.what == "a run at another speed, and one in reverse"
    assert both.what == "a run at another speed"


# --- lines that nothing explains --------------------------------------------------------------------------------------


def test_folds_are_all_orders_that_would_show_there() -> None:
    """By trial of every order up to twice the sampling."""
    wanted = [float(o) for o in range(501, 2100) if folded_order(o, 1000) == 80]
    assert [fold.order for fold in folds(UNIT, 80, 1000)] == wanted
    frames = {fold.order: fold.frames for fold in folds(UNIT, 80, 1000)}
    assert "gear mesh 1080" in frames[1080.0]
    assert [fold.frames for fold in folds(UNIT, 36, 2048)] == [(), (), (), ()]
    assert folds(UNIT, 36, float("inf")) == ()


def test_a_new_sampling_moves_what_folded() -> None:
    steps = to_place(UNIT, [36.0], replace(BOTH, samples_per_turn=2048.0))
    (count,) = [int(word) for step in steps if step.name == "sampling" for word in step.what.split() if word.isdigit()]
    assert count >= 4096
    assert all(folded_order(fold.order, count) != 36 for fold in folds(UNIT, 36, 2048))


@pytest.mark.parametrize("order", [1.0, 2.0, 3.5, 36.0, 40.0, 121.0])
def test_the_encoder_is_remounted_by_an_odd_number_of_half_periods(order: float) -> None:
    (step,) = [step for step in to_place(UNIT, [order], BOTH) if step.name == "encoder"]
    angle = float(step.what.rpartition(" by ")[2].split()[0])
    assert (angle * order / 180) % 2 == pytest.approx(1.0, abs=0.02)
    assert 0 < angle <= 180


def test_a_line_seen_one_way_asks_for_the_other() -> None:
    assert "reverse" in names(to_place(UNIT, [36.0], ONE_WAY))
    assert "reverse" not in names(to_place(UNIT, [36.0], BOTH))
    assert to_place(UNIT, [], ONE_WAY) == ()
