"""Assemblies of sums of waves: against all assemblies of small lots, listed."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from rverror.matching.unit_waves import Assembly, UnitWaves

SAMPLES = 24
SECTIONS = ((slice(0, 16), True), (slice(16, 24), False))
POOLS = (0, 0, 1, 2)  # two cranks, a disc, a housing
NUMBERS = (6, 6, 4, 3)


def waves(seed, *, scale=1.0, turns=1):
    rng = np.random.default_rng(seed)
    parts = [rng.normal(0, scale, (turns, number, SAMPLES)) / 4 for number in NUMBERS]
    return UnitWaves(rng.normal(0, 0.05, SAMPLES), parts, POOLS, SECTIONS)


def error(lot, unit, turn=(0, 0, 0, 0)):
    """Error of one unit, said anew."""
    wave = lot.base + sum(lot.parts[place][t, part] for place, (part, t) in enumerate(zip(unit, turn, strict=True)))
    return max(np.ptp(wave[:16]), wave[16:].max())


def all_assemblies(lot):
    """Errors of every unit of every assembly, shape (assemblies, 3)."""
    sizes = {unit: error(lot, unit) for unit in itertools.product(*map(range, NUMBERS)) if unit[0] != unit[1]}
    rows = []
    for cranks in itertools.permutations(range(6)):
        for discs in itertools.permutations(range(4), 3):
            rows.append([sizes[cranks[2 * u], cranks[2 * u + 1], discs[u], u] for u in range(3)])
    return np.array(rows)


def good(lot, assembly):
    return int((lot.errors(lot.whole(assembly)) <= 1).sum())


@pytest.mark.parametrize("seed", range(4))
def test_best_and_bound_against_all_assemblies(seed):
    every = all_assemblies(waves(seed))
    for limit in np.quantile(every, [0.02, 0.05, 0.2]):
        lot = waves(seed)
        lot = replace(lot, base=lot.base / limit, parts=[part / limit for part in lot.parts])
        counts = (every <= limit).sum(axis=1)
        searched = good(lot, lot.searched(np.random.default_rng(0)))
        assert counts.max() - 1 <= searched <= counts.max()
        assert counts.max() <= lot.bound() <= 3


@pytest.mark.parametrize("seed", range(3))
def test_among_equals_the_least_error(seed):
    """Where all units are good the errors' sum is what is left to lessen: never below the least of all assemblies."""
    lot = waves(seed, scale=0.3)
    every = all_assemblies(lot)
    assert (every <= 1).all()
    found = lot.errors(lot.whole(lot.searched(np.random.default_rng(0)))).sum()
    least = every.sum(axis=1).min()
    assert least - 1e-9 <= found <= 1.03 * least


def test_a_part_that_no_good_unit_has_lowers_the_bound():
    lot = waves(1, scale=0.1)
    parts = [part.copy() for part in lot.parts]
    parts[3][0, 1] += 5 * np.sin(np.arange(SAMPLES))  # no other part can take so much away
    spoilt = replace(lot, parts=parts)
    assert lot.bound() == 3
    assert spoilt.bound() == 2 == (all_assemblies(spoilt) <= 1).sum(axis=1).max()


def test_one_assignment_is_the_best_of_all_permutations():
    lot = waves(5, scale=2)
    begun = lot.shuffled(np.random.default_rng(1))
    found = lot.assigned(begun, (2,))
    assert np.array_equal(found.part[:, [0, 1, 3]], begun.part[:, [0, 1, 3]])
    prices = []
    for discs in itertools.permutations(range(4), 3):
        part = begun.part.copy()
        part[:, 2] = discs
        prices.append(lot.cost(lot.errors(lot.whole(Assembly(part, begun.turn)))).sum())
    assert lot.cost(lot.errors(lot.whole(found))).sum() == pytest.approx(min(prices))


def test_known_errors_stand_in_for_the_sums():
    """A unit that is known to be good is not broken up for one that is foreseen to be as good."""
    lot = replace(waves(5, scale=2), doubt=0.1)
    begun = lot.shuffled(np.random.default_rng(1))
    assert not np.array_equal(lot.assigned(begun, (2,)).part, begun.part)
    known = dict.fromkeys(begun.names(), 0.0)
    assert np.array_equal(lot.assigned(begun, (2,), known=known).part, begun.part)
    worse = lot.assigned(begun, (2,))
    known = dict.fromkeys(worse.names(), 9.0)  # solved in vain: looked for elsewhere
    assert not set(lot.assigned(begun, (2,), known=known).names()) & set(known)


def test_parts_turned_best():
    lot = waves(2, turns=3)
    begun = lot.shuffled(np.random.default_rng(0))
    turned = lot.turned(begun)
    assert np.array_equal(turned.part, begun.part)
    before, after = lot.errors(lot.whole(begun)), lot.errors(lot.whole(turned))
    assert (after <= before + 1e-12).all()
    for unit, turn, size in zip(turned.part, turned.turn, after, strict=True):
        assert size == pytest.approx(error(lot, unit, turn))
        others = [error(lot, unit, (*turn[:3], way)) for way in range(3)]
        assert size == pytest.approx(min(others))  # the last place was turned last


def test_order_of_parts_does_not_matter():
    """Renumbered parts: the same bound, and as many good units."""
    lot = waves(3)
    order = [np.random.default_rng(7).permutation(number) for number in NUMBERS]
    order[1] = order[0]
    other = replace(lot, parts=[part[:, of] for part, of in zip(lot.parts, order, strict=True)])
    assert lot.bound() == other.bound()
    counts = [good(one, one.searched(np.random.default_rng(0))) for one in (lot, other)]
    assert abs(counts[0] - counts[1]) <= 1


def test_every_part_is_used_once():
    lot = waves(4)
    found = lot.searched(np.random.default_rng(0))
    assert len(set(found.part[:, :2].ravel())) == 6
    assert all(len(set(found.part[:, place])) == 3 for place in (2, 3))
