"""Units of measured parts: solved anew, counted, and refused where they cannot be made."""

from dataclasses import replace

import numpy as np
import pytest

import rverror
from rverror.base.errors import InputError
from rverror.matching.at_load import UnitsAtLoad, columns_of
from rverror.matching.matched import match
from rverror.parts.measured import MeasuredPart, mounted, places_of
from rverror.tolerances.specification import check_limits

UNIT = rverror.Reducer(
    sun_teeth=9, planet_teeth=27, module="1.5 mm", pressure_angle="20 deg", disc_lobes=15, pins=16,
    pin_circle_radius="64 mm", pin_radius="5 mm", eccentricity="2.4 mm", cranks=2, discs=2, name="small unit",
)  # fmt: skip
MODEL = rverror.Model(UNIT, (rverror.effect("crank.bearing_clearance", clearance="2 um"),), "a unit")
LIMITS = [
    rverror.limit("transmission_error", "40 arcsec", torque="150 N*m"),
    rverror.limit("lost_motion", "60 arcsec", torque="5 N*m"),
]
UNITS = 4
COSTS = {"classes": 1.0, "sorting": 2.0, "matching": 4.0, "turning": 8.0, "rollers": 16.0}


def drawn(rng, key, size, **indices):
    return rverror.Effect(key, indices, tuple(rng.normal(0, size, len(rverror.CATALOGUE[key].parameters))))


def cranks(rng, count):
    return [
        MeasuredPart("crank", f"C{n}", tuple(drawn(rng, "crank.eccentricity", 2e-3, disc=d) for d in range(2)))
        for n in range(count)
    ]


def discs(rng, count):
    """Each second one is told as it stands at place 1."""
    keys = ("cycloid.disc_profile", "cycloid.disc_pitch")
    return [
        MeasuredPart(
            "disc", f"D{n}", tuple(drawn(rng, key, 2e-3, harmonic=h) for key in keys for h in (1, 2)), "", n % 2
        )
        for n in range(count)
    ]


def housings(rng, count):
    return [
        MeasuredPart("housing", f"H{n}", tuple(drawn(rng, "cycloid.pin_position", 3e-3, pin=p) for p in range(16)))
        for n in range(count)
    ]


def rollers(rng, count):
    return [MeasuredPart("roller", f"R{n}", (drawn(rng, "cycloid.pin_radius", 2e-3),)) for n in range(count)]


def parts():
    rng = np.random.default_rng(11)
    return [*cranks(rng, 2 * UNITS), *discs(rng, 2 * UNITS + 1), *housings(rng, UNITS), *rollers(rng, 16 * UNITS + 3)]


@pytest.fixture(scope="module")
def found():
    return match(MODEL, parts(), LIMITS, costs=COSTS)


def by_hand(unit):
    """Model of a unit of the list, its parts looked up by their serial numbers."""
    known = {(part.kind, part.serial): part for part in parts()}
    effects = list(MODEL.effects)
    for one in unit.parts:
        effects += mounted(known[one.kind, one.serial], UNIT, one.place, one.turn)
    return rverror.Model(UNIT, tuple(effects))


def test_units_solved_anew(found):
    """By the equilibrium at all angles, from models made by hand; the closed form knows no windup and is near."""
    assert [one.label for one in found.quantities] == [
        "transmission error at 150 N*m, forward",
        "lost motion at 5 N*m",
        "transmission error at 150 N*m, reverse",
    ]
    theta = 2 * np.pi * np.arange(1200) / 1200
    for unit in found.units[:2]:
        model = by_hand(unit)
        for direction, turn in ((1.0, unit.turns[0]), (-1.0, unit.turns[2])):
            state = rverror.equilibrium(model, theta, torque="150 N*m", direction=direction)
            assert np.ptp(state.transmission_error) == pytest.approx(turn, rel=0.02)
            closed = np.ptp(rverror.transmission_error(model, theta, direction=direction))
            assert 0.4 < closed / turn < 1.6
        play = [
            rverror.equilibrium(model, theta[::25], torque="5 N*m", direction=sense).transmission_error
            for sense in (-1.0, 1.0)
        ]
        assert np.abs(play[0] - play[1]).max() == pytest.approx(unit.turns[1], rel=0.02)
        assert {str(effect) for effect in model.effects} == {str(effect) for effect in unit.model.effects}


def test_waves_are_those_of_the_equilibrium_at_their_load():
    """Largest section of each wave against the poses that `equilibrium` finds; a lost motion is above zero."""
    cams = cranks(np.random.default_rng(5), 2)
    columns = columns_of(UNIT, [(place, cams) for place in places_of(UNIT, "crank")])
    units = UnitsAtLoad(MODEL, columns.components, check_limits(LIMITS, UNIT))
    values = sum(columns.values(place, np.array([place]), np.array([0])) for place in (0, 1))
    (wave,), slope = units.waves(values, slopes=True)
    model = rverror.Model(UNIT, (*MODEL.effects, *(e for n in (0, 1) for e in cams[n].at(n))))
    for quantity, (at, span), allowed in zip(units.quantities, units.sections, units.allowed, strict=True):
        theta = 2 * np.pi * np.arange(at.stop - at.start) / (at.stop - at.start)
        senses = (quantity.direction,) if span else (-1.0, 1.0)
        torque = "150 N*m" if span else "5 N*m"
        error = [
            rverror.equilibrium(model, theta, torque=torque, direction=sense).transmission_error for sense in senses
        ]
        expected = error[0] - np.mean(error[0]) if span else error[0] - error[1]
        found = wave[at] * allowed - (np.mean(wave[at]) * allowed if span else 0)
        assert found == pytest.approx(expected, abs=0.01 * np.ptp(expected) + 0.01 * np.abs(expected).max())
    larger = 1e-3  # share by which all errors of the cams grow: what their waves say, by the poses before and after
    grown = (units.waves((1 + larger) * values)[0][0] - wave) / larger
    parts = sum(columns.waves(place, slope)[0, place] for place in (0, 1))
    assert parts == pytest.approx(grown, abs=0.02 * np.abs(grown).max())


def test_waves_of_a_sun_are_seen_in_every_phase():
    """Order 240, of two waves around the sun: as high however the sun is put in."""
    reducer = rverror.reducer("RV-40E")
    suns = [MeasuredPart("sun", "S", (rverror.effect("involute.sun_pitch", harmonic=2, cos="5 um"),))]
    columns = columns_of(reducer, [(places_of(reducer, "sun")[0], suns)])
    limits = check_limits([rverror.limit("transmission_error", "40 arcsec", torque="412 N*m")], reducer)
    units = UnitsAtLoad(rverror.Model(reducer), columns.components, limits)
    slope = units.waves(np.zeros((1, 2)), slopes=True)[1][:, units.sections[0][0]]
    phases = np.linspace(0, np.pi, 19)
    sizes = np.ptp(np.stack([np.cos(phases), np.sin(phases)], axis=1) @ slope, axis=1)
    assert sizes.min() > 0.97 * sizes.max() > 0


def test_parts_are_used_once_and_none_is_lost(found):
    used = [(part.kind, part.serial) for unit in found.units for part in unit.parts]
    left = [(kind, serial) for kind, serials in found.left.items() for serial in serials]
    assert sorted([*used, *left]) == sorted((part.kind, part.serial) for part in parts())
    for unit in found.units:
        assert [part.place for part in unit.parts if part.kind == "roller"] == list(range(16))
        for part in unit.parts:  # half a turn between the place at which a disc is told and the one where it stands
            if part.kind == "disc":
                assert part.turn == (part.place + int(part.serial[1:])) % 2
        assert (np.array(unit.turns) <= found.allowed).all()


def test_matching_beats_chance(found):
    shares = {way.name: way for way in found.ways}
    random, matched, placed = (shares[name] for name in ("put together at random", "matched", "rollers placed as well"))
    assert random.share < matched.share <= placed.share == found.share
    assert len(found.units) <= found.bound <= found.possible == UNITS
    assert placed.p95 < random.p95


def test_each_way_costs_what_is_done_for_it(found):
    """No part of these is turned; what has no price costs nothing known."""
    costs = {way.name: way.cost for way in found.ways}
    assert costs == {
        "put together at random": None,
        "three classes": 1.0,
        "rollers of one size in a unit, at random": 2.0,
        "parts 20 % more accurate, at random": None,
        "matched": 4.0,
        "rollers placed as well": 20.0,
    }


def test_discs_of_three_cranks_are_turned():
    """Each disc stands where it is made for; a turn is worth what the equilibrium of a model made by hand says."""
    reducer = replace(UNIT, cranks=3)
    rng = np.random.default_rng(0)
    some = [
        MeasuredPart(
            "disc", f"D{n}", tuple(drawn(rng, "cycloid.disc_bore_position", 4e-3, crank=c) for c in range(3)), "", n % 2
        )
        for n in range(2)
    ] + cranks(rng, 3)
    found = match(rverror.Model(reducer), some, LIMITS[:1], turns=True, costs=COSTS)
    (unit,) = found.units
    assert [part.serial for part in unit.parts if part.kind == "disc"] == ["D0", "D1"]
    theta = 2 * np.pi * np.arange(480) / 480
    sizes = {}
    for turn in np.ndindex(3, 3):
        effects = [error for part in unit.parts if part.kind == "crank"
                   for error in next(p for p in some if p.serial == part.serial).at(part.place)]  # fmt: skip
        for disc in (0, 1):
            effects += mounted(some[disc], reducer, disc, turn[disc])
        model = rverror.Model(reducer, tuple(effects))
        sizes[turn] = np.ptp(rverror.equilibrium(model, theta, torque="150 N*m").transmission_error)
    chosen = tuple(part.turn for part in unit.parts if part.kind == "disc")
    assert sizes[chosen] == pytest.approx(unit.turns[0], rel=0.05)
    assert sizes[chosen] < 1.1 * min(sizes.values()) < 0.9 * np.median(list(sizes.values()))
    assert {"turned, not matched": 8.0, "matched and turned": 12.0}.items() <= {
        w.name: w.cost for w in found.ways
    }.items()


def test_serial_numbers_are_names_alone():
    rng = np.random.default_rng(2)
    some = [*cranks(rng, 4), *housings(rng, 2), *(MeasuredPart("sun", f"S{n}", ()) for n in range(2))]
    first, again = (match(MODEL, of, LIMITS[:1]) for of in (some, [replace(p, serial=f"{p.serial}-x") for p in some]))
    assert first.units
    assert [[f"{part.serial}-x" for part in unit.parts] for unit in first.units] == [
        [part.serial for part in unit.parts] for unit in again.units
    ]


def test_a_limit_that_no_unit_meets():
    rng = np.random.default_rng(0)
    few = [*cranks(rng, 2), *housings(rng, 1)]
    with pytest.raises(
        InputError, match="no unit of these parts meets the limits: the best one has transmission"
    ) as told:
        match(MODEL, few, [rverror.limit("transmission_error", "1 arcsec", torque="150 N*m")])
    assert "arcsec, and 1 are allowed" in str(told.value)


def refused(words, some, limits=LIMITS, model=MODEL, **options):
    with pytest.raises(InputError, match=words):
        match(model, some, limits, **options)


def test_what_cannot_be_matched_is_refused():
    rng = np.random.default_rng(0)
    housing, pair = housings(rng, 2), cranks(rng, 2)
    refused("parts: there is none", [])
    refused("1 crank: a unit takes 2", [*pair[:1], *housing])
    refused("15 rollers: a unit takes 16", [*housing, *rollers(rng, 15)])
    refused("parts of the kind housing alone leave nothing to choose", housing)
    twice = [replace(housing[0], origin="one.csv"), replace(housing[0], origin="two.csv"), *pair]
    refused("housing H0: this serial number comes twice, in one.csv and two.csv; keep one", twice)
    refused("no part has an error", [replace(one, errors=()) for one in (*housing, *pair)])
    refused("seed = -1: must be 0 or more", [*housing, *pair], seed=-1)
    far = MeasuredPart("housing", "H9", (rverror.effect("cycloid.pin_radius", pin=55, deviation="1 um"),))
    refused("housing H9: .*pin", [far, *pair])
    declared = replace(MODEL, effects=pair[0].at(0))
    refused("crank.eccentricity: the model declares it", [*pair, *housing], model=declared)
    refused(
        "a .drive. has no parts that are matched", [*pair, *housing], model=rverror.Model(rverror.Drive(ratio=50.0))
    )
    refused("costs: 'luck' is no way to build", [*pair, *housing], costs={"luck": 1.0})
    refused("match takes values of angles", [*pair, *housing], [rverror.limit("stiffness", "100 N*m/arcmin")])
    refused("made_for = 2: must be from 0 to 1", [replace(d, made_for=2) for d in discs(rng, 2)])
    three = rverror.Model(replace(UNIT, cranks=3))
    refused(
        "0 discs made for place 1, where others fit than at place 0 .made_for.: a unit takes 1",
        discs(rng, 3)[::2],
        model=three,
    )
