"""Parts at their places: against the geometry of the lobes, and symmetries of the whole gear."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

import rverror
from rverror.base.errors import InputError
from rverror.model.catalogue import source
from rverror.parts.measured import KINDS, MeasuredPart, disc_turns, mounted, places_of

TURN = 2 * np.pi
TWO = rverror.reducer("RV-40E")
THREE = replace(TWO, cranks=3)
ALIKE = replace(TWO, cranks=3, discs=3, pins=24, disc_lobes=23, eccentricity=0.9)  # three discs of one kind
ON_DISC = (
    ("cycloid.disc_pitch", "harmonic", (1, 2, 3)),
    ("cycloid.disc_profile", "harmonic", (1, 2, 3)),
    ("cycloid.lobe_profile", "harmonic", (0, 2)),
    ("cycloid.disc_lobe", "lobe", (0, 17)),
)


def drawn(rng, key, **indices):
    return rverror.Effect(key, indices, tuple(rng.normal(0, 4e-3, len(source(key).parameters))))


def part(kind, reducer, seed):
    """A part of a kind with errors of all its sources."""
    rng = np.random.default_rng(seed)
    if kind == "disc":
        errors = [drawn(rng, "cycloid.disc_bore_position", crank=c) for c in range(reducer.cranks)]
        errors += [drawn(rng, key, **{index: n}) for key, index, numbers in ON_DISC for n in numbers]
    elif kind == "crank":
        errors = [drawn(rng, "crank.eccentricity", disc=d) for d in range(reducer.discs)]
    elif kind == "planet":
        errors = [drawn(rng, "involute.planet_eccentricity"), drawn(rng, "involute.planet_pitch", harmonic=2)]
    elif kind == "carrier":
        errors = [drawn(rng, "coupling.carrier_bore_position", crank=c) for c in range(reducer.cranks)]
        errors += [drawn(rng, "involute.center_distance", crank=c) for c in range(reducer.cranks)]
    elif kind == "sun":
        errors = [drawn(rng, "involute.sun_eccentricity")]
    else:
        errors = [drawn(rng, "cycloid.pin_position", pin=n) for n in range(reducer.pins)]
        errors += [drawn(rng, "cycloid.pin_circle", harmonic=2)]
    return MeasuredPart(kind, f"{kind} {seed}", tuple(errors))


def number_of(kind, reducer):
    return {None: None, "crank": reducer.cranks, "disc": reducer.discs, "pin": reducer.pins}[KINDS[kind][1]]


def whole(reducer, *, turn=0):
    """Effects of a unit of all kinds, its housing turned by pins."""
    found = []
    for kind in ("crank", "planet", "disc", "housing", "carrier", "sun"):
        count = number_of(kind, reducer)
        for place in [None] if count is None else range(count):
            found += mounted(part(kind, reducer, place or 0), reducer, place, turn if kind == "housing" else 0)
    return tuple(found)


def misses(reducer, place, angle):
    """How far the pins' centres lie off the trochoid of a disc at a place, turned by an angle."""
    pins, phase = TURN * np.arange(reducer.pins) / reducer.pins, TURN * place / reducer.discs
    offset = reducer.eccentricity * np.exp(1j * phase)
    seen = (reducer.pin_circle_radius * np.exp(1j * pins) - offset) * np.exp(-1j * angle)
    t = pins - angle
    trochoid = reducer.pin_circle_radius * np.exp(1j * t) - reducer.eccentricity * np.exp(1j * reducer.pins * t)
    return np.abs(seen - trochoid).max()


@pytest.mark.parametrize("pins", [24, 28, 40])
@pytest.mark.parametrize(("cranks", "discs"), [(2, 2), (3, 2), (4, 2), (2, 3), (3, 3)])
def test_turns_of_discs_follow_from_the_lobes(cranks, discs, pins):
    """A disc fits where its trochoid passes through the centres of the pins."""
    reducer = replace(TWO, cranks=cranks, discs=discs, pins=pins, disc_lobes=pins - 1, eccentricity=0.9)
    for p, q in itertools.product(range(discs), repeat=2):
        made_for = -TURN * p / discs / reducer.disc_lobes
        fits = [s for s in range(cranks) if misses(reducer, q, made_for + TURN * s / cranks) < 1e-9]
        assert list(disc_turns(reducer, p, q)) == fits


def test_places_and_their_ways():
    assert [(str(p), p.turns, p.made_for) for p in places_of(TWO, "disc", turns=True)] == [
        ("disc 0", (0,), 0),
        ("disc 1", (1,), 0),
    ]
    assert [(p.turns, p.made_for) for p in places_of(THREE, "disc", turns=True)] == [((0, 1, 2), 0), ((0, 1, 2), 1)]
    assert [p.turns for p in places_of(THREE, "disc")] == [(0,), (0,)]
    assert [str(p) for kind in ("crank", "housing") for p in places_of(TWO, kind)] == ["crank 0", "crank 1", "housing"]


@pytest.mark.parametrize("reducer", [TWO, ALIKE], ids=["two discs", "three discs"])
@pytest.mark.parametrize("key", [row[0] for row in ON_DISC] + ["cycloid.disc_bore_position"])
def test_a_disc_at_another_place_makes_the_same_wave(key, reducer):
    """Place and turn together leave a disc that fits both to its eccentric direction as it was: no wave changes."""
    disc = part("disc", reducer, 3)
    disc = replace(disc, errors=tuple(error for error in disc.errors if error.key == key))
    here, *there = (
        rverror.transmission_error(
            rverror.Model(reducer, mounted(disc, reducer, q, disc_turns(reducer, 0, q)[0])), np.linspace(0, TURN, 400)
        )
        for q in range(reducer.discs)
    )
    assert len(there) == reducer.discs - 1
    for wave in there:
        assert wave == pytest.approx(here, abs=1e-15)
    assert np.ptp(here) > 1e-9 or key == "cycloid.lobe_profile"


def test_turning_twice_is_turning_by_two():
    disc = part("disc", THREE, 1)
    for kind, steps in (("disc", 3), ("housing", TWO.pins)):
        one = disc if kind == "disc" else part(kind, THREE, 0)
        place = 0 if kind == "disc" else None
        once = tuple(
            replace(error, indices={name: value for name, value in error.indices.items() if name != "disc"})
            for error in mounted(one, THREE, place, 1)
        )
        twice = mounted(replace(one, errors=once), THREE, place, 1)
        by_two, round_ = mounted(one, THREE, place, 2), mounted(one, THREE, place, steps)
        for found, expected in ((twice, by_two), (round_, one.at(place))):
            for a, b in zip(found, expected, strict=True):
                assert a.indices == b.indices
                assert a.values == pytest.approx(b.values, abs=1e-15)


def test_a_third_of_a_turn_of_the_whole_gear_changes_nothing():
    """Three cranks: what stands at one place stands at the next a third of a turn later."""
    angles = 39 * 3 * 8
    theta = TURN * np.arange(angles) / angles
    effects, moved = [], []
    for kind in ("crank", "planet", "carrier", "disc"):
        for place in range(number_of(kind, THREE) or 1):
            one = part(kind, THREE, place)
            if kind == "carrier":
                effects += one.at()
                moved += [replace(e, indices={"crank": (e.indices["crank"] + 1) % 3}) for e in one.at()]
            else:
                effects += mounted(one, THREE, place)
                moved += mounted(one, THREE, place, 1) if kind == "disc" else one.at((place + 1) % 3)
    before, after = (rverror.transmission_error(rverror.Model(THREE, tuple(e)), theta) for e in (effects, moved))
    assert after == pytest.approx(np.roll(before, -angles // 3), abs=1e-14)
    assert not np.allclose(after, before, atol=1e-7)


@pytest.mark.parametrize("torque", ["412 N*m", "20 N*m"])
def test_a_housing_turned_by_pins_shifts_the_waveform_as_a_whole(torque):
    """All else repeats 40 times a turn against the housing, so the unit is the same, k pins of the turn later."""
    theta = np.array([0.1, 1.7, 4.4])
    for pins in (1, 7):
        turned = rverror.Model(TWO, whole(TWO, turn=pins)).equilibrium(torque, theta=theta)
        as_it_is = rverror.Model(TWO, whole(TWO)).equilibrium(torque, theta=theta - TURN * pins / 40)
        assert turned.transmission_error == pytest.approx(as_it_is.transmission_error, abs=1e-11)


def test_a_sun_put_in_at_another_tooth_is_where_it_comes_to_later():
    """Perfect planets cannot tell a tooth from the next: the wave comes when the sun has made that part of a turn."""
    theta = np.linspace(0, TURN, 500)
    rng = np.random.default_rng(0)
    sun = MeasuredPart(
        "sun",
        "S",
        (drawn(rng, "involute.sun_eccentricity"), *(drawn(rng, "involute.sun_pitch", harmonic=h) for h in (1, 2))),
    )
    for teeth in (1, 4):
        turned = rverror.transmission_error(rverror.Model(TWO, mounted(sun, TWO, None, teeth)), theta)
        later = theta + TURN * teeth / TWO.sun_teeth / 120  # 120 turns of the sun against the carrier
        as_it_is = rverror.transmission_error(rverror.Model(TWO, mounted(sun, TWO)), later)
        assert turned == pytest.approx(as_it_is, abs=1e-14)
        assert np.ptp(turned) > 1e-6
    assert places_of(TWO, "sun", turns=True)[0].turns == tuple(range(9))
    assert places_of(TWO, "sun")[0].turns == (0,)


def test_what_cannot_be_turned_is_refused():
    with pytest.raises(InputError, match="only discs, suns and housings are turned"):
        mounted(part("crank", TWO, 0), TWO, 0, 1)
    reducer = replace(TWO, cranks=3, discs=4, disc_lobes=38, pins=39)  # two thirds of a lobe fit no quarter
    with pytest.raises(InputError, match="no disc fits at place 1, turned by 1"):
        mounted(MeasuredPart("disc", "D", ()), reducer, 1, 1)
