"""Units that are no members: spoilt ones are found and named, and members are not, even where they are not normal."""

from __future__ import annotations

import numpy as np
import pytest

from lot_parts import UM, RandomUnits, parts
from rverror.base.arrays import Array
from rverror.lots.members import MembersTail, outsiders
from rverror.lots.result import Outsider

SOME, UNITS, MEMBERS = RandomUnits(150, 0.5), 200, 150
SERIALS = [f"U{number:04d}" for number in range(UNITS)]
SPOILT = ["U0007", "U0070", "U0170"]


def own_cam() -> int:
    cams = [n for n, e in enumerate(parts().effects) if e.key == "crank.eccentricity" and e.indices["disc"] == 0]
    return int(np.flatnonzero(parts().effect == cams[0])[0])


def units(seed: int, count: int, freedom: float = np.inf) -> Array:
    """Normal, or of Student's distribution: a unit's amplitudes are all as far off as they are."""
    rng = np.random.default_rng(seed)
    found = SOME.drawn(rng, count)
    if np.isfinite(freedom):
        found *= np.sqrt(freedom / rng.chisquare(freedom, (count, 1)))
    return np.asarray(found)


def asked(values: Array, members: Array) -> tuple[Outsider, ...]:
    return outsiders(values - values.mean(axis=0), SERIALS, members, SOME.weight, SOME.influence, parts())


def spoilt(seed: int, size: float, freedom: float = np.inf) -> Array:
    values = units(seed, UNITS, freedom)
    for serial in SPOILT:
        values[SERIALS.index(serial)] += SOME.influence[:, own_cam()] * size
    return values


def test_spoilt_units_are_found_and_named() -> None:
    """Three of 200 with one cam 15 um off: 11 standard errors of a unit."""
    cam = parts().effects[parts().effect[own_cam()]]
    named, single, covered = 0, 0, 0
    for seed in range(5):
        found = asked(spoilt(seed, 15 * UM), units(1000 + seed, MEMBERS))
        assert sorted(one.serial for one in found) == SPOILT
        for one in found:
            named += (one.causes[0].key, one.causes[0].indices) == (cam.key, cam.indices)
            covered += 15 * UM in one.causes[0].size
            single += len(one.causes) == 1
            assert one.causes[0].parameter == parts().parameters[own_cam()].name
            assert one.chance < 0.01
    assert named == 15
    assert single >= 13  # a second parameter is taken in by chance in 1 %
    assert covered >= 11  # of 15 at 95 %: fewer are a chance of 1 in 1600


def test_unit_that_is_off_all_over_has_no_causes() -> None:
    values = units(0, UNITS)
    values[5] *= 4
    (found,) = asked(values, units(1000, MEMBERS))
    assert (found.serial, found.causes) == ("U0005", ())


@pytest.mark.parametrize(("freedom", "most"), [(np.inf, 1), (5.0, 2)], ids=["normal", "heavy"])
def test_members_are_no_outsiders(freedom: float, most: int) -> None:
    """At a level of 1 %, 0.3 of 30 lots; the tail of Student's with 5 degrees is guessed from 38 units: some more."""
    raised = sum(
        len(asked(units(seed, UNITS, freedom), units(1000 + seed, MEMBERS, freedom))) > 0 for seed in range(30)
    )
    assert raised <= most


def test_spoilt_units_are_named_among_heavy_ones_too() -> None:
    """What a unit is off all over does not count against its cause: 25 um are named, and hardly a member is."""
    found = [
        asked(spoilt(seed, 25 * UM, 5.0), units(1000 + seed, MEMBERS, 5.0)) for seed in range(5)
    ]  # fmt: skip
    named = [one.serial for some in found for one in some if one.causes and one.causes[0].key == "crank.eccentricity"]
    assert sum(serial in SPOILT for serial in named) >= 12
    assert sum(one.serial not in SPOILT for some in found for one in some) <= 1


def test_wrong_weight_is_made_good_by_members() -> None:
    """Contacts make units vary twice as much as their linear influences say: they are members all the same."""
    found = asked(2 * units(3, UNITS), 2 * units(1003, MEMBERS))
    assert found == ()
    assert asked(2 * units(3, UNITS), units(1003, MEMBERS)) == ()  # what all units have is no unit's own


@pytest.mark.parametrize("shape", [0.0, 0.4])
def test_tail_of_members(shape: float) -> None:
    """Of an exponential at e^-8 within a factor of ten; of a longer one as well."""
    ratios = []
    for seed in range(20):
        seen = np.random.default_rng(seed).exponential(size=MEMBERS)
        value = 8.0
        if shape:
            seen, value = np.expm1(shape * seen) / shape, float(np.expm1(shape * value) / shape)
        ratios.append(MembersTail(seen).chance(value) / np.exp(-8))
    assert 0.1 < np.median(ratios) < 10


def test_tail_is_never_shorter_than_that_of_chi_squares() -> None:
    seen = 0.01 * np.random.default_rng(0).exponential(size=MEMBERS)
    assert MembersTail(seen).chance(5.0) > 0.25 * np.exp(-5.1)
