"""Phasing: against geometry, symmetries of the gear, enumeration and closed forms."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import rverror
from rverror.base.errors import InputError
from rverror.tolerances.assembly import (
    exchange,
    mounting_choices,
    phasing,
    phasing_gain,
    turn,
)
from rverror.tolerances.distribution import Rayleigh, Ring
from rverror.tolerances.stacking import Block, Component, Stack, stack, tolerance

TURN = 2 * np.pi
THREE = 39 * 3 * 8  # angles that hold a third of a turn and a pitch of the pins
ON_DISCS = ["cycloid.disc_bore_position", "cycloid.disc_pitch", "cycloid.disc_profile"]
ON_PLANETS = ["involute.planet_eccentricity", "involute.planet_pitch"]


def tolerances():
    return [
        tolerance("crank.eccentricity", "5 um"),
        tolerance("involute.planet_eccentricity", "10 um"),
        tolerance("involute.planet_pitch", "5 um", harmonic=[1, 2]),
        tolerance("cycloid.disc_bore_position", "5 um"),
        tolerance("cycloid.disc_pitch", "5 um", harmonic=[1, 2, 3]),
        tolerance("cycloid.disc_profile", "3 um", harmonic=[1, 2]),
        tolerance("coupling.carrier_bore_position", "5 um"),
        tolerance("cycloid.pin_position", "3 um"),
    ]


def two_cranks():
    unit = rverror.Model(rverror.reducer("RV-40E"))
    return stack(unit, tolerances(), theta=TURN * np.arange(1024) / 1024), unit.mechanism


def three_cranks():
    unit = rverror.Model(replace(rverror.reducer("RV-40E"), cranks=3))
    return stack(unit, tolerances(), theta=TURN * np.arange(THREE) / THREE), unit.mechanism


def parts(laid, seed=0):
    """Values of the components of one unit."""
    drawn = laid.standard(np.random.default_rng(seed).random((1, laid.dimensions)))[0]
    return drawn * laid.width[laid.entry]


def places(laid):
    return {(c.key, frozenset(c.indices.items()), c.parameter): row for row, c in enumerate(laid.components)}


def renamed(laid, values, key, **shifts):
    """Values of a source, each index counted on by so many."""
    known = places(laid)
    moved = values.copy()
    for row, c in enumerate(laid.components):
        if c.key == key:
            indices = {i: (v + shifts[i][0]) % shifts[i][1] if i in shifts else v for i, v in c.indices.items()}
            moved[known[key, frozenset(indices.items()), c.parameter]] = values[row]
    return moved


# --- moves ---------------------------------------------------------------------------------------------------------


def test_exchange_puts_each_part_at_each_place():
    laid, _ = three_cranks()
    values = parts(laid)
    known = places(laid)
    choice = exchange(laid, "cranks", ["crank.eccentricity"], "crank")
    assert choice.moves[0].name == "cranks as they are"
    assert np.array_equal(choice.moves[0](values), values)
    seen = set()
    for move in choice.moves:
        moved = move(values)
        order = []
        for place in range(3):
            at = known["crank.eccentricity", frozenset({"crank": place, "disc": 1}.items()), "radial"]
            order += [
                part
                for part in range(3)
                if values[known["crank.eccentricity", frozenset({"crank": part, "disc": 1}.items()), "radial"]]
                == moved[at]
            ]
        seen.add(tuple(order))
        others = np.array([c.key != "crank.eccentricity" for c in laid.components])
        assert np.array_equal(moved[others], values[others])
    assert seen == set(itertools.permutations(range(3)))


@pytest.mark.parametrize("step", [1, 2])
def test_a_turned_disc_carries_its_errors_rigidly(step):
    """By geometry: displacement vectors of the bores, and the profile's height along the disc."""
    laid, _ = three_cranks()
    values = parts(laid)
    angle = TURN / 3
    choice = turn(laid, "disc 1", ON_DISCS, angle=angle, steps=range(3), shifts={"crank": (1, 3)}, disc=1)
    moved = choice.moves[step](values)
    known = places(laid)

    def bores(row):
        """Place of each bore in the disc's frame with its displacement there, as complex numbers."""
        found = {}
        for crank in range(3):
            at = [
                known["cycloid.disc_bore_position", frozenset({"disc": 1, "crank": crank}.items()), p]
                for p in ("radial", "tangential")
            ]
            found[crank] = complex(*row[at]) * np.exp(1j * angle * crank)
        return found

    for crank, displaced in bores(values).items():
        assert bores(moved)[(crank + step) % 3] == pytest.approx(displaced * np.exp(1j * angle * step))

    def height(row, key, phi):
        return sum(
            row[known[key, frozenset({"disc": 1, "harmonic": h}.items()), part]] * wave(h * phi)
            for h in ((1, 2, 3) if key == "cycloid.disc_pitch" else (1, 2))
            for part, wave in (("cos", np.cos), ("sin", np.sin))
        )

    phi = np.linspace(0, TURN, 17)
    for key in ("cycloid.disc_pitch", "cycloid.disc_profile"):
        assert height(moved, key, phi) == pytest.approx(height(values, key, phi - angle * step))
    elsewhere = np.array([c.indices.get("disc") != 1 or c.key == "crank.eccentricity" for c in laid.components])
    assert np.array_equal(moved[elsewhere], values[elsewhere])


def test_turns_add_up_to_none():
    laid, _ = three_cranks()
    values = parts(laid)
    shifts = {"crank": (1, 3)}
    move = turn(laid, "disc 0", ON_DISCS, angle=TURN / 3, steps=[1], shifts=shifts, disc=0).moves[1]
    assert move.name == "disc 0 turned by 1 step"
    assert not np.allclose(move(values), values)
    assert move(move(move(values))) == pytest.approx(values)
    back = turn(laid, "disc 0", ON_DISCS, angle=TURN / 3, steps=[-1], shifts=shifts, disc=0).moves[1]
    assert back(move(values)) == pytest.approx(values)


def test_turning_the_pin_ring_shifts_its_wave():
    """The pins meet the cranks, which turn 39 times a turn against them: k pins further is k / (39 40) of a turn."""
    laid, _ = three_cranks()
    only = [row for row, c in enumerate(laid.components) if c.key == "cycloid.pin_position"]
    values = np.zeros(len(laid.entry))
    values[only] = parts(laid)[only]
    ring = turn(laid, "ring", ["cycloid.pin_position"], angle=TURN / 40, steps=range(40), shifts={"pin": (1, 40)})
    assert len(ring.moves) == 40
    made = values @ laid.influence
    for pins in (5, 20):
        after = ring.moves[pins](values) @ laid.influence
        shift = THREE * pins / (39 * 40)
        assert shift == int(shift)
        # counter-clockwise, against the sense in which the cranks meet the pins
        assert after == pytest.approx(np.roll(made, -int(shift)), abs=1e-15)
    assert not np.allclose(ring.moves[5](values) @ laid.influence, made, atol=1e-7)


def test_a_third_of_a_turn_of_the_whole_gear_changes_nothing():
    """Three cranks: what stands at one place stands at the next a third of a turn later, and 13 pins lie between."""
    laid, _ = three_cranks()
    values = parts(laid)
    moved = values
    for key in ("crank.eccentricity", *ON_PLANETS, "coupling.carrier_bore_position"):
        choice = exchange(laid, key, [key], "crank")
        names = {move.name: move for move in choice.moves}
        moved = names[f"{key} 2 0 1"](moved)
    for disc in (0, 1):
        choice = turn(laid, "disc", ON_DISCS, angle=TURN / 3, steps=[1], shifts={"crank": (1, 3)}, disc=disc)
        before = moved @ laid.influence
        moved = choice.moves[1](moved)
        assert not np.allclose(moved @ laid.influence, before, atol=1e-9)
    made, after = values @ laid.influence, moved @ laid.influence
    assert after == pytest.approx(np.roll(made, -THREE // 3), abs=1e-15)


def test_half_a_turn_of_the_whole_gear_changes_nothing():
    """RV-40E: half a turn later the cranks have made 19 and a half, and each disc stands where the other stood."""
    laid, reducer = two_cranks()
    values = parts(laid)
    moved = renamed(laid, values, "crank.eccentricity", crank=(1, 2), disc=(1, 2))
    moved = renamed(laid, moved, "coupling.carrier_bore_position", crank=(1, 2))
    choices = {choice.name: choice for choice in mounting_choices(laid, reducer)}
    moved = choices["planets"].moves[1](moved)
    for crank in (0, 1):
        moved = turn(laid, "planet", ON_PLANETS, angle=np.pi, steps=[1], crank=crank).moves[1](moved)
    moved = choices["discs"].moves[1](moved)
    made = values @ laid.influence
    assert moved @ laid.influence == pytest.approx(np.roll(made, -512), abs=1e-15)


def test_discs_of_an_rv_40e_change_places_turned_by_half():
    """Place and turn together leave a disc to its eccentric direction as it was, so no wave changes; one alone does."""
    laid, reducer = two_cranks()
    discs = next(choice for choice in mounting_choices(laid, reducer) if choice.name == "discs")
    assert len(discs.moves) == 2
    values = parts(laid)
    assert not np.allclose(discs.moves[1](values), values)
    made = values @ laid.influence
    assert discs.moves[1](values) @ laid.influence == pytest.approx(made, abs=1e-15)
    alone = exchange(laid, "discs", ON_DISCS, "disc").moves[1]
    assert not np.allclose(alone(values) @ laid.influence, made, atol=1e-7)


def test_three_discs_change_places_turned_by_a_third():
    """23 lobes, 3 cranks, 3 discs: every order has one turn of each disc; none changes a wave."""
    reducer = replace(rverror.reducer("RV-40E"), cranks=3, discs=3, pins=24, disc_lobes=23, eccentricity=0.9)
    laid = stack(rverror.Model(reducer), [t for t in tolerances() if "disc_" in t.key], theta=np.linspace(0, 6, 101))
    (discs,) = mounting_choices(laid, reducer)
    assert len(discs.moves) == 6
    values = parts(laid)
    for move in discs.moves:
        assert move(values) @ laid.influence == pytest.approx(values @ laid.influence, abs=1e-15)


def test_discs_between_three_cranks_are_turned_and_stay():
    """Thirteen lobes to a bore's pitch, so every turn is possible; half a lobe apart no disc fits the other's place."""
    laid, reducer = three_cranks()
    discs = next(choice for choice in mounting_choices(laid, reducer) if choice.name == "discs")
    assert len(discs.moves) == 9
    assert all(move.name.startswith("discs as they are") for move in discs.moves)


def misses(reducer, place, angle):
    """How far the pins' centres lie off the trochoid of a disc at a place, turned by an angle."""
    pins, phase = TURN * np.arange(reducer.pins) / reducer.pins, TURN * place / reducer.discs
    offset = reducer.eccentricity * np.exp(1j * phase)
    seen = (reducer.pin_circle_radius * np.exp(1j * pins) - offset) * np.exp(-1j * angle)
    t = pins - angle
    trochoid = reducer.pin_circle_radius * np.exp(1j * t) - reducer.eccentricity * np.exp(1j * reducer.pins * t)
    return np.abs(seen - trochoid).max()


def fits(reducer, p, q, steps):
    """Whether a disc with its bores as place p needs them goes to place q, turned by some pitches of its bores."""
    made_for = -TURN * p / reducer.discs / reducer.disc_lobes
    assert misses(reducer, p, made_for) < 1e-9
    return misses(reducer, q, made_for + TURN * steps / reducer.cranks) < 1e-9


@pytest.mark.parametrize("pins", [24, 28, 40])
@pytest.mark.parametrize(("cranks", "discs"), [(2, 2), (3, 2), (4, 2), (2, 3), (3, 3)])
def test_places_of_discs_follow_from_the_lobes(cranks, discs, pins):
    """A disc fits where its trochoid passes through the centres of the pins."""
    reducer = replace(
        rverror.reducer("RV-40E"), cranks=cranks, discs=discs, pins=pins, disc_lobes=pins - 1, eccentricity=0.9
    )
    laid = stack(rverror.Model(reducer), [tolerance("cycloid.disc_bore_position", "5 um")], theta=np.arange(3.0))
    expected = sum(
        all(fits(reducer, p, q, s) for q, (p, s) in enumerate(zip(order, steps, strict=True)))
        for order in itertools.permutations(range(discs))
        for steps in itertools.product(range(cranks), repeat=discs)
    )
    choices = mounting_choices(laid, reducer)
    assert (len(choices[0].moves) if choices else 1) == expected


# --- the best arrangement ------------------------------------------------------------------------------------------


def test_phasing_is_the_least_of_all_arrangements():
    laid, reducer = three_cranks()
    values = parts(laid, 3)
    choices = mounting_choices(laid, reducer)
    found = phasing(laid, choices, values)
    sizes = {}
    for moves in itertools.product(*(choice.moves for choice in choices)):
        moved = values
        for move in moves:
            moved = move(moved)
        sizes[tuple(move.name for move in moves)] = np.ptp(laid.nominal + moved @ laid.influence)
    assert found.arrangements == len(sizes) == 6 * 6 * 9
    assert found.peak_to_peak == pytest.approx(min(sizes.values()), rel=1e-9)
    assert sizes[found.moves] == pytest.approx(found.peak_to_peak, rel=1e-9)
    assert np.ptp(laid.nominal + found.values @ laid.influence) == pytest.approx(found.peak_to_peak, rel=1e-9)
    assert found.as_is == pytest.approx(np.ptp(laid.nominal + values @ laid.influence), rel=1e-9)
    assert found.mean == pytest.approx(np.mean(list(sizes.values())), rel=1e-9)
    assert found.largest == pytest.approx(max(sizes.values()), rel=1e-9)
    again = phasing(laid, choices, found.values)  # from the best nothing better is left
    assert again.peak_to_peak == pytest.approx(found.peak_to_peak, rel=1e-9)
    assert all("as they are" in name for name in again.moves)


def two_parts(law=None, order=1):
    """Two parts with one vector each on the same order, at fixed places: phases add."""
    theta = TURN * np.arange(360) / 360
    waves = np.array([np.cos(theta), np.sin(theta)] * 2)
    components = tuple(
        Component("involute.planet_eccentricity", {"crank": crank}, p, "length") for crank in (0, 1) for p in ("x", "y")
    )
    block = Block(0, 0, 2, 2, law or Rayleigh())
    return Stack(np.zeros(360), waves, components, np.zeros(4, dtype=np.intp), np.ones(1), ("t",), (block,))


@given(steps=st.integers(2, 24), seed=st.integers(0, 1000))
@settings(max_examples=30)
def test_two_vectors_are_turned_against_one_another(steps, seed):
    """One of two vectors turned by steps: the resultant nearest to opposition, in closed form."""
    laid = two_parts()
    values = np.random.default_rng(seed).normal(size=4)
    choice = turn(laid, "planet 1", ["involute.planet_eccentricity"], angle=TURN / steps, steps=range(steps), crank=1)
    fixed, turned = complex(*values[:2]), complex(*values[2:])
    best = min(abs(fixed + turned * np.exp(1j * TURN * s / steps)) for s in range(steps))
    found = phasing(laid, [choice], values)
    assert found.peak_to_peak == pytest.approx(2 * best, rel=1e-4, abs=1e-3)  # angles one degree apart
    assert found.arrangements == steps


def test_gain_over_random_assembly_in_closed_form():
    """Two vectors of length 1, one of which may be turned by half: |1 + e^ia| = 2 |cos(a/2)| becomes 2 |sin(a/2)|.

    Either is 4/pi in the mean; the smaller is 2 sin(a/2) with a uniform to pi/2.
    """
    laid = two_parts(Ring())
    choice = turn(laid, "planet 1", ["involute.planet_eccentricity"], angle=np.pi, steps=[1], crank=1)
    found = phasing_gain(laid, [choice], units=4000, level=0.9)
    smaller = 2 / (np.pi / 2) * (2 - 2 * math.cos(np.pi / 4))
    assert found.random_mean == pytest.approx(2 * 4 / np.pi, rel=0.02)
    assert found.chosen_mean == pytest.approx(2 * smaller, rel=0.02)
    true = 1 - smaller / (4 / np.pi)
    assert abs(found.gain - true) < 4 * found.gain_error
    assert 0 < found.gain_error < 0.02
    # the smaller is 2 sin(a/2), a uniform to pi/2
    assert found.chosen_quantile == pytest.approx(4 * math.sin(0.9 * np.pi / 4), rel=0.02)
    assert (found.units, found.arrangements) == (4000, 2)


def test_phasing_never_loses_and_gains_for_a_reducer():
    laid, reducer = two_cranks()
    found = phasing_gain(laid, mounting_choices(laid, reducer), units=64)
    assert found.chosen_mean < found.random_mean
    assert found.chosen_quantile <= found.random_quantile
    assert 0.05 < found.gain < 0.6
    assert found.gain_error < 0.1
    discs = [choice for choice in mounting_choices(laid, reducer) if choice.name == "discs"]
    assert phasing_gain(laid, discs, units=16).gain == pytest.approx(0.0, abs=1e-9)


def test_units_without_waves_gain_nothing():
    laid = replace(two_parts(), influence=np.ones((4, 360)))
    choice = exchange(laid, "planets", ["involute.planet_eccentricity"], "crank")
    found = phasing_gain(laid, [choice], units=4)
    assert (found.random_mean, found.gain, found.gain_error) == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)


# --- what is refused -----------------------------------------------------------------------------------------------


def test_too_many_arrangements_are_refused_with_their_number():
    laid, reducer = three_cranks()
    ring = turn(laid, "ring", ["cycloid.pin_position"], angle=TURN / 40, steps=range(40), shifts={"pin": (1, 40)})
    choices = [*mounting_choices(laid, reducer), ring, ring]
    with pytest.raises(InputError, match=r"6 \(planets\) x .* = 518400 arrangements, above 20000; give fewer"):
        phasing(laid, choices, parts(laid))
    with pytest.raises(InputError, match="518400 arrangements"):
        phasing_gain(laid, choices)


def test_values_must_fit():
    laid = two_parts()
    for values in ([1.0], [1.0, 2.0, 3.0, math.nan]):
        with pytest.raises(InputError, match="give a finite one for each of 4 components"):
            phasing(laid, [], values)


def test_parts_without_tolerance_cannot_change_places():
    unit = rverror.Model(rverror.reducer("RV-40E"))
    some = stack(unit, [tolerance("cycloid.disc_bore_position", "5 um", disc=0)], theta=np.arange(3.0))
    with pytest.raises(InputError, match=r"no such component of cycloid\.disc_pitch; add its tolerance"):
        exchange(some, "discs", ["cycloid.disc_pitch"], "disc")
    with pytest.raises(
        InputError, match=r"would get the value of disc=0, crank=2, which has no tolerance; give it one"
    ):
        turn(some, "disc", ["cycloid.disc_bore_position"], angle=1.0, steps=[1], shifts={"crank": (1, 3)}, disc=0)
    with pytest.raises(InputError, match="disc 1: the stack has no such component"):
        mounting_choices(some, unit.mechanism)
    lobe = stack(unit, [tolerance("cycloid.disc_lobe", "5 um")], theta=np.arange(3.0))
    with pytest.raises(InputError, match=r"how cycloid\.disc_lobe.* turns is not known"):
        mounting_choices(lobe, unit.mechanism)
    half = stack(unit, [tolerance("involute.planet_eccentricity", "5 um", parameters=["x"])], theta=np.arange(3.0))
    with pytest.raises(InputError, match="turns with its other component"):
        turn(half, "planet", ["involute.planet_eccentricity"], angle=1.0, steps=[1], crank=0)
    twice = stack(unit, [tolerance("crank.eccentricity", "5 um")] * 2, theta=np.arange(3.0))
    with pytest.raises(InputError, match="two tolerances of the stack hold the same component"):
        exchange(twice, "cranks", ["crank.eccentricity"], "crank")


@pytest.mark.parametrize(
    ("arguments", "says"),
    [({"units": 1}, "units = 1: must be 2 or more"), ({"level": 1.0}, "level = 1: must lie between")],
)
def test_arguments_of_a_gain(arguments, says):
    with pytest.raises(InputError, match=says):
        phasing_gain(two_parts(), [], **arguments)
