"""States from which sets of causes are fitted: at a workshop's sizes, in places that look alike, each way once."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

import rverror
from gear_runs import BARE, CAM, LIGHT, TURN, UNIT, begin, runs_of
from rverror.base.arrays import Array
from rverror.diagnosis.causes import identity, named
from rverror.diagnosis.gears.fit import Fit, evaluated, fitted
from rverror.diagnosis.gears.moves import equivalents, marked, started, with_offer
from rverror.diagnosis.gears.ranking import Offer
from rverror.diagnosis.gears.score import Score
from rverror.diagnosis.gears.trial import Trial, distinct
from rverror.diagnosis.policy import POLICY
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.statics.loaded_state import NotConvergedError

PROFILE = rverror.effect("cycloid.disc_profile", disc=1, harmonic=2, cos="4 um", sin="-3 um")
PIN = rverror.effect("cycloid.pin_position", pin=5, radial="-12 um", tangential="10 um")
PLAY = rverror.effect("crank.bearing_clearance", clearance="5 um")
BORE = rverror.effect("cycloid.disc_bore_position", disc=0, crank=1, radial="5 um", tangential="3 um")


def offer_of(*effects: Effect) -> Offer:
    return Offer(tuple((e.key, e.indices) for e in effects), tuple(np.array(e.values) for e in effects), 0.0, 0.0, 0.0)


def test_an_offer_enters_at_its_sizes_or_at_those_that_a_workshop_makes() -> None:
    """Each cause by itself is made smaller in proportion, until none of its sizes is beyond 0.7 of a plausible one."""
    declared = Model(UNIT, (replace(PLAY, uncertainty=1e-3),))
    model = with_offer(declared, offer_of(CAM, PROFILE))
    assert model.effects == (*declared.effects, CAM, PROFILE)
    both = offer_of(CAM, replace(PROFILE, values=tuple(100 * value for value in PROFILE.values)))
    small, large = with_offer(declared, both).effects[1:]
    assert small == CAM
    shares = np.array(large.values) / [p.plausible for p in source(PROFILE.key).parameters]
    assert np.abs(shares).max() == pytest.approx(0.7)
    assert shares[0] / shares[1] == pytest.approx(-4 / 3)


def test_a_cause_with_starts_begins_at_each_of_them() -> None:
    """Shares of what is plausible; one that every linear step tells the size of has none."""
    found = started((PIN.key, PIN.indices))
    plausible = np.array([p.plausible for p in source(PIN.key).parameters])
    assert [named(e) for e in found] == [named(PIN)] * len(source(PIN.key).starts)
    assert np.array([e.values for e in found]) == pytest.approx(np.array(source(PIN.key).starts) * plausible)
    assert started((CAM.key, CAM.indices)) == []


def test_places_that_only_contacts_tell_apart() -> None:
    """On the other disc or crank, as it is or the opposite; a pin stands for those beside it and half a turn on."""
    cams = {(named(e), e.values) for e in equivalents(CAM, UNIT)}
    elsewhere = [(0, 1), (1, 0), (1, 1)]
    assert cams == {
        (identity((CAM.key, {"crank": crank, "disc": disc})), tuple(sign * value for value in CAM.values))
        for (crank, disc), sign in product(elsewhere, (1.0, -1.0))
    }
    pins = [e for e in equivalents(PIN, UNIT) if e.values == PIN.values]
    assert sorted(int(e.indices["pin"]) for e in pins) == [4, 6, 13]


@pytest.mark.parametrize("effect", [CAM, PIN, PROFILE, BORE], ids=str)
def test_no_place_is_proposed_twice(effect: Effect) -> None:
    """A sign of each of two indices makes the same sizes twice."""
    found = [(named(e), e.values) for e in equivalents(effect, UNIT)]
    assert len(found) == len(set(found))


def test_what_shows_by_contacts_alone_may_be_its_opposite() -> None:
    """Only of causes that have starts, and never less than no clearance."""
    assert [e.values for e in equivalents(PROFILE, UNIT) if e.indices == PROFILE.indices] == [(-4e-3, 3e-3)]
    assert equivalents(PLAY, UNIT) == []
    encoder = rverror.effect("sensor.encoder_eccentricity", cos="20 arcsec")
    assert equivalents(encoder, UNIT) == []


@pytest.mark.parametrize("effect", [CAM, PROFILE, BORE], ids=str)
def test_in_every_equivalent_place_one_sign_does_what_the_cause_does(effect: Effect) -> None:
    """Nearly, in the closed form, in which all contacts carry."""
    theta = TURN * np.arange(512) / 512

    def wave(one: Effect) -> Array:
        error = rverror.transmission_error(Model(UNIT, (one,)), theta, direction=1.0)
        return np.asarray(error - error.mean())

    true, nearest = wave(effect), dict[object, float]()
    for other in equivalents(effect, UNIT):
        off = float(np.std(wave(other) - true) / np.std(true))
        nearest[named(other)] = min(off, nearest.get(named(other), math.inf))
    nearest.pop(named(effect), None)
    assert nearest
    assert max(nearest.values()) < 0.1


def test_marks_go_to_an_offset_and_all_else_stays() -> None:
    stated = Model(UNIT, (CAM,)).with_effects(rverror.effect("sensor.index_offset", offset="0.1 rad"))
    model = marked(stated, 0.37)
    assert model.index_offset == 0.37
    assert replace(model, effects=model.effects[:1]) == Model(UNIT, (CAM,))
    assert marked(Model(UNIT, (CAM,)), 0.37) == Model(UNIT, (CAM,))


@pytest.fixture(scope="module")
def first() -> Fit:
    return begin(BARE, runs_of(BARE, LIGHT, points=256), points=256)


def trial(first: Fit, *added: Effect, declared: Model = BARE, score: float = 0.0) -> Trial:
    origin = Score([], POLICY).of(evaluated(first.run_set, declared, declared)).without_rows
    return Trial(declared.with_effects(*added), score, origin)


def test_of_one_set_two_ways_are_followed_at_most(first: Fit) -> None:
    """Larger in the same direction it is the same way; the other way, or across, it is another."""
    a, b = CAM.values
    calm, wild, opposite, across, back = (
        trial(first, replace(CAM, values=values)) for values in ((a, b), (3 * a, 3 * b), (-a, -b), (b, -a), (-b, a))
    )
    assert distinct([calm, wild, opposite, across], 4) == [calm, opposite]
    assert distinct([calm, across, back, opposite], 4) == [calm, across]
    assert distinct([wild, calm, opposite], 1) == [wild]
    assert distinct([], 3) == []
    assert len(distinct([trial(first) for _ in range(3)], 3)) == 2  # of no cause, where marks are looked for


def test_sets_are_apart_by_their_causes_and_by_where_the_marks_are(first: Fit) -> None:
    """In whatever order their causes were found."""
    other = replace(PROFILE, indices={"disc": 0, "harmonic": 2})
    one, turned, two = trial(first, CAM, PROFILE), trial(first, PROFILE, CAM), trial(first, CAM, other)
    assert distinct([one, turned, two], 3) == [one, two]
    marks = Model(UNIT).with_effects(rverror.effect("sensor.index_offset", offset="0 rad"))
    here, near, there = (trial(first, CAM, declared=marked(marks, angle)) for angle in (0.0, 0.01, 0.3))
    assert distinct([here, near, there], 3) == [here, there]


def test_a_trial_is_solved_then_stepped_until_it_settles_at_the_score_of_its_fit(first: Fit) -> None:
    """What few angles make of the set that it was made from is taken off, so the score is that over every sample."""
    true = begin(BARE, runs_of(Model(UNIT, (CAM,)), LIGHT, points=2048), points=2048)
    score = Score([(CAM.key, dict(CAM.indices))], POLICY)
    one = Trial(BARE.with_effects(replace(CAM, values=(1e-4, 1e-4))), 0.0, score.of(true).without_rows)
    taken = []
    while not one.finished:
        one = one.further(score)
        taken.append(one.score)
    assert one.added[0].values == pytest.approx(CAM.values, abs=3e-4)
    end = score.of(fitted(evaluated(true.run_set, one.model, BARE))).score
    unseen = true.run_set.freedom - true.run_set.coarse.freedom  # values of which nothing is known but their number
    assert taken[-1] == pytest.approx(end, abs=3 * math.sqrt(2 * unseen))
    assert taken[-1] < score.of(true).score - 100


def test_a_state_without_an_equilibrium_is_no_trial(first: Fit) -> None:
    """A bearing that is stiffer by more than its declared compliance is none."""
    nothing = rverror.effect("crank.bearing_compliance", crank=0, disc=0, compliance="-4 um/kN")  # of 3.3
    with pytest.raises(NotConvergedError):
        trial(first, nothing).further(Score([], POLICY))
