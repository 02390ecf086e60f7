"""Rollers in classes: against all arrangements, the symmetry of two discs, and units of models made by hand."""

from collections import Counter

import numpy as np
import pytest

import rverror
from rverror.base.errors import InputError
from rverror.matching.matched import match
from rverror.matching.unit_waves import UnitWaves, placed
from rverror.parts.measured import MeasuredPart

UNIT = rverror.Reducer(
    sun_teeth=9, planet_teeth=27, module="1.5 mm", pressure_angle="20 deg", disc_lobes=15, pins=16,
    pin_circle_radius="64 mm", pin_radius="5 mm", eccentricity="2.4 mm", cranks=2, discs=2, name="small unit",
)  # fmt: skip
LIMIT = rverror.limit("transmission_error", "60 arcsec", torque="150 N*m")
TURN = 2 * np.pi


def roller_class(name, deviation, count, sigma=None):
    return MeasuredPart("roller", name, (rverror.Effect("cycloid.pin_radius", {}, (deviation,), sigma),), count=count)


def housings(count, size, seed=0):
    rng = np.random.default_rng(seed)
    return [
        MeasuredPart(
            "housing",
            f"H{n}",
            tuple(rverror.Effect("cycloid.pin_position", {"pin": p}, tuple(rng.normal(0, size, 2))) for p in range(16)),
        )
        for n in range(count)
    ]


def arrangements(counts):
    """All ways to give rollers of some classes to the grooves."""
    if not any(counts):
        return [()]
    return [
        (of, *rest)
        for of, count in enumerate(counts)
        if count
        for rest in arrangements([c - (n == of) for n, c in enumerate(counts)])
    ]


@pytest.mark.parametrize("sizes", [(-0.1, 0.1), (-0.15, 0.0, 0.15)])
@pytest.mark.parametrize("seed", range(6))
def test_placed_against_all_arrangements(seed, sizes):
    """Twelve grooves, waves that go round, two discs in every second case: among the best one in fifty of all."""
    rng, angle, grooves = np.random.default_rng(seed), TURN * np.arange(96) / 96, 12
    at = angle - TURN * np.arange(grooves)[:, None] / grooves
    waves = np.exp(3 * np.cos(at)) + np.exp(-3 * np.cos(at)) * (seed % 2)
    waves *= 0.05
    rest = sum(rng.normal(0, 0.1) * np.cos(h * angle + rng.uniform(0, 7)) for h in (1, 2, 3, 4, 6))
    law = UnitWaves(np.zeros(96), (), (), ((slice(0, 96), True),))
    came = rng.permutation(np.repeat(np.arange(len(sizes)), grooves // len(sizes)))
    own = np.array(sizes)[None, :, None] * waves[:, None]
    found = placed(law, own, came, rest + own[np.arange(grooves), came].sum(axis=0))
    assert Counter(found.tolist()) == Counter(came.tolist())
    every = np.array(arrangements([grooves // len(sizes)] * len(sizes)))
    errors = np.ptp(rest + np.array(sizes)[every] @ waves, axis=1)
    error = np.ptp(rest + np.array(sizes)[found] @ waves)
    assert error < np.quantile(errors, 0.02) + 1e-9
    assert error < 0.85 * np.median(errors)


def test_opposite_rollers_act_as_one():
    """Two discs half a turn apart and pins of an even number: a large roller across from a small one makes no wave."""
    unit, theta = rverror.reducer("RV-40E"), np.linspace(0, TURN, 700)

    def wave(**sizes):
        effects = [rverror.effect("cycloid.pin_radius", pin=int(p[1:]), deviation=s) for p, s in sizes.items()]
        return rverror.transmission_error(rverror.Model(unit, tuple(effects)), theta)

    assert np.ptp(wave(p3=1e-3)) > 1e-7
    assert np.ptp(wave(p3=1e-3, p23=-1e-3)) < 1e-14
    assert wave(p3=2e-3) == pytest.approx(wave(p3=1e-3, p23=1e-3), abs=1e-14)


@pytest.fixture(scope="module")
def found():
    classes = [roller_class("A", -2e-3, 30), roller_class("B", 0.0, 41), roller_class("C", 2e-3, 30)]
    return match(rverror.Model(UNIT), [*housings(6, 3e-3), *classes], [LIMIT])


def test_the_list_says_which_class_in_which_groove(found):
    used = Counter(part.serial for unit in found.units for part in unit.parts if part.kind == "roller")
    for unit in found.units:
        assert [part.place for part in unit.parts if part.kind == "roller"] == list(range(16))
        rebuilt = rverror.parts.unit_of_parts(
            rverror.Model(UNIT),
            [*housings(6, 3e-3), roller_class("A", -2e-3, 30), roller_class("B", 0.0, 41), roller_class("C", 2e-3, 30)],
            {kind: [part.serial for part in unit.parts if part.kind == kind] for kind in ("housing", "roller")},
        )
        assert {str(e).partition(" of ")[0] for e in rebuilt.effects} == {str(e) for e in unit.model.effects}
    assert used + Counter(found.left["roller"]) == {"A": 30, "B": 41, "C": 30}
    assert "roller, 5 left over" in rverror.to_text(found)


def test_classes_by_groove_are_worth_it(found):
    """Grooves 3 um off and rollers of three classes: of units at random a third of the error goes."""
    ways = {way.name: way for way in found.ways}
    assert ways["rollers placed as well"].p95 < 0.75 * ways["put together at random"].p95
    assert ways["rollers placed as well"].p95 < ways["matched"].p95


def test_one_class_in_a_unit():
    """Of each class as many as units take: the unit has all its pins a class too large, solved from a model of that."""
    sizes = (-6e-3, 0.0, 6e-3)
    rng = np.random.default_rng(1)
    cranks = [MeasuredPart("crank", f"C{n}", (rverror.effect("crank.eccentricity", disc=0, radial=r),))
              for n, r in enumerate(rng.normal(0, 1e-4, 6))]  # fmt: skip
    classes = [roller_class(f"K{n}", size, 16) for n, size in enumerate(sizes)]
    found = match(rverror.Model(UNIT), [*cranks, *classes], [LIMIT])
    ways = {way.name: way for way in found.ways}
    alike, random = ways["rollers of one size in a unit, at random"], ways["put together at random"]
    theta = TURN * np.arange(1200) / 1200
    expected = []
    for size in sizes:
        all_pins = rverror.effect("cycloid.pin_radius", pin="all", deviation=size)
        state = rverror.equilibrium(rverror.Model(UNIT, (all_pins,)), theta, torque="150 N*m")
        expected.append(np.ptp(state.transmission_error) / LIMIT.value)
    assert np.abs(alike.errors[:, None] - expected).min(axis=1).max() < 0.02
    assert np.median(alike.errors) < 0.3 * np.median(random.errors)


def test_classes_in_files(tmp_path):
    """From a list of boxes by a mapping to the table of parts and back."""
    (tmp_path / "boxes.csv").write_text("Class;mean [um];pieces\nA;-1,5;400\nB;0,5;380\n")
    (tmp_path / "boxes.toml").write_text(
        'kind = "roller"\nserial = "Class"\ncount = "pieces"\n[[error]]\nkey = "cycloid.pin_radius"\n'
        'deviation = { name = "mean [um]", unit = "um", uncertainty = "0.3 um" }\n'
    )
    read = rverror.load_parts(tmp_path / "boxes.csv", UNIT, mapping=tmp_path / "boxes.toml").parts
    assert [(one.serial, one.count, one.errors[0].uncertainty) for one in read] == [("A", 400, 3e-4), ("B", 380, 3e-4)]
    rverror.parts.save_parts(tmp_path / "parts.csv", [*read, *housings(1, 1e-3)])
    again = rverror.load_parts(tmp_path / "parts.csv", UNIT).parts
    assert [(one.serial, one.count) for one in again] == [("A", 400), ("B", 380), ("H0", 1)]
    (tmp_path / "boxes.csv").write_text("Class;mean [um];pieces\nA;-1,5;0\n")
    with pytest.raises(InputError, match="count of rollers: must be a whole number, 1 or more"):
        rverror.load_parts(tmp_path / "boxes.csv", UNIT, mapping=tmp_path / "boxes.toml")
    with pytest.raises(InputError, match="crank C: count = 2: must be 1, or more of a class of rollers"):
        MeasuredPart("crank", "C", (), count=2)
    few = [roller_class("A", 1e-3, 9), roller_class("B", -1e-3, 6)]
    with pytest.raises(InputError, match="15 rollers: a unit takes 16"):
        match(rverror.Model(UNIT), [*housings(1, 1e-3), *few], [LIMIT])
