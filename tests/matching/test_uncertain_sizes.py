"""Sizes that are known within an uncertainty: what is told of units, against true parts that are drawn and solved."""

from dataclasses import replace

import numpy as np
import pytest

import rverror
from rverror.base.errors import InputError
from rverror.matching.at_load import columns_of
from rverror.matching.matched import match
from rverror.matching.unit_waves import UnitWaves
from rverror.parts.measured import MeasuredPart, places_of

UNIT = rverror.Reducer(
    sun_teeth=9, planet_teeth=27, module="1.5 mm", pressure_angle="20 deg", disc_lobes=15, pins=16,
    pin_circle_radius="64 mm", pin_radius="5 mm", eccentricity="2.4 mm", cranks=2, discs=2, name="small unit",
)  # fmt: skip
MODEL = rverror.Model(UNIT)
SIGMA = 5e-4


def drawn(rng, key, size, sigma=SIGMA, **indices):
    return rverror.Effect(key, indices, tuple(rng.normal(0, size, len(rverror.CATALOGUE[key].parameters))), sigma)


def lot(units, sigma=SIGMA, seed=4):
    rng = np.random.default_rng(seed)
    cranks = [
        MeasuredPart("crank", f"C{n}", tuple(drawn(rng, "crank.eccentricity", 2e-3, sigma, disc=d) for d in (0, 1)))
        for n in range(2 * units)
    ]
    housings = [
        MeasuredPart(
            "housing", f"H{n}", tuple(drawn(rng, "cycloid.pin_position", 3e-3, sigma, pin=p) for p in range(16))
        )
        for n in range(units)
    ]
    return [*cranks, *housings]


def in_truth(model, rng):
    """A unit whose parts are what they may be."""
    effects = [
        replace(
            e, values=tuple((np.array(e.values) + (e.uncertainty or 0) * rng.standard_normal(len(e.values))).tolist())
        )
        for e in model.effects
    ]
    return rverror.Model(UNIT, tuple(effects))


def test_the_yield_that_is_told_is_counted():
    """True parts = measured + error, solved by the equilibrium both ways; matching saw no true part."""
    limit = rverror.limit("transmission_error", "27 arcsec", torque="150 N*m")
    found = match(MODEL, lot(6), [limit])
    chances = np.array([unit.chance for unit in found.units])
    assert len(found.units) >= 4
    assert chances.min() < 0.9 < 0.97 < chances.max()  # some are sure, some are not
    rng, theta, draws = np.random.default_rng(12), 2 * np.pi * np.arange(480) / 480, 40
    good = []
    for unit in found.units:
        for _ in range(draws):
            true = in_truth(unit.model, rng)
            sizes = [
                np.ptp(rverror.equilibrium(true, theta, torque="150 N*m", direction=sense).transmission_error)
                for sense in (1.0, -1.0)
            ]
            good.append(max(sizes) <= limit.value)
    counted = np.reshape(good, (len(chances), draws)).mean(axis=1)
    scatter = np.sqrt((chances * (1 - chances)).sum() / draws) / len(chances)
    assert counted.mean() == pytest.approx(chances.mean(), abs=3 * scatter + 0.02)
    assert counted.mean() < 0.99  # what measured sizes alone would tell
    assert np.corrcoef(counted, chances)[0, 1] > 0.8
    assert found.share == pytest.approx(chances.sum() / 6)
    told = rverror.to_text(found)
    assert "With the uncertainty of the sizes" in told
    assert "probability, %" in told


def test_uncertainty_of_a_mounted_part_is_that_of_drawn_ones():
    """Components of discs that are drawn, mounted and turned: their scatter is what the lot has for its variances."""
    rng = np.random.default_rng(0)
    errors = (
        drawn(rng, "cycloid.disc_bore_position", 3e-3, 2e-4, crank=0),
        drawn(rng, "cycloid.disc_pitch", 3e-3, 7e-4, harmonic=2),
        drawn(rng, "cycloid.lobe_profile", 3e-3, None, harmonic=0),
    )
    discs = [MeasuredPart("disc", "D", errors)]
    for number in range(3000):
        values = [np.array(e.values) + (e.uncertainty or 0) * rng.standard_normal(len(e.values)) for e in errors]
        true = tuple(replace(e, values=tuple(v.tolist())) for e, v in zip(errors, values, strict=True))
        discs.append(replace(discs[0], serial=f"D{number}", errors=true))
    unit = replace(UNIT, cranks=3)
    place = places_of(unit, "disc", turns=True)[0]
    columns = columns_of(unit, [(place, discs)])
    assert len(place.turns) == 3
    for way in range(3):
        scattered = columns.values(0, np.arange(1, len(discs)), np.full(len(discs) - 1, way)).std(axis=0)
        alone = columns_of(unit, [(place, discs[:1])])  # a lot of one says nothing of its scatter
        sigma = np.sqrt(alone.variances.values(0, np.array([0]), np.array([way]))[0])
        assert sigma == pytest.approx(scattered, rel=0.06, abs=1e-15)
        assert sorted(sigma[sigma > 0]) == pytest.approx([2e-4, 2e-4, 7e-4, 7e-4])


def test_true_sizes_scatter_less_than_measured_ones():
    """Parts that are drawn and then measured: what is left of their sizes has mean 0 and the scatter that is told."""
    rng, count = np.random.default_rng(5), 2000
    true = rng.normal(1e-3, 8e-4, (count, 2))
    measured = true + rng.normal(0, 6e-4, true.shape)
    cranks = [
        MeasuredPart("crank", f"C{n}", (rverror.Effect("crank.eccentricity", {"disc": 0}, tuple(row), 6e-4),))
        for n, row in enumerate(measured.tolist())
    ]
    columns = columns_of(UNIT, [(places_of(UNIT, "crank")[0], cranks)])
    every, as_it_is = np.arange(count), np.zeros(count, dtype=int)
    rest = true - measured - columns.regression.values(0, every, as_it_is)
    sigma = np.sqrt(columns.variances.values(0, every, as_it_is))
    assert np.std(rest / sigma) == pytest.approx(1, abs=0.05)
    assert sigma.max() < 0.85 * 6e-4  # 0.8 by both variances
    for component in (0, 1):  # large readings are no longer too large
        assert abs(np.corrcoef(rest[:, component], measured[:, component])[0, 1]) < 3.5 / count**0.5
        assert abs(np.corrcoef((true - measured)[:, component], measured[:, component])[0, 1]) > 0.5
    few = columns_of(UNIT, [(places_of(UNIT, "crank")[0], cranks[:3])])
    assert not few.regression.values(0, every[:3], as_it_is[:3]).any()
    unstated = [*cranks, MeasuredPart("crank", "X", (rverror.Effect("crank.eccentricity", {"disc": 0}, (0.0, 0.0)),))]
    partly = columns_of(UNIT, [(places_of(UNIT, "crank")[0], unstated)])
    assert not partly.regression.values(0, every, as_it_is).any()


def test_chance_of_a_unit():
    """At the limit half of the units are good where nothing is shifted; the doubts add up by squares."""
    waves = UnitWaves(np.zeros(1), (), (), (), doubt=0.03, shift=0.0, unsure=0.04)
    assert waves.bad(np.array([1.0, 1.05])) == pytest.approx([0.5, 0.8413], abs=1e-4)
    assert replace(waves, shift=0.05).bad(np.array([0.95])) == pytest.approx([0.5])
    assert waves.solved.bad(np.array([1.04])) == pytest.approx([0.8413], abs=1e-4)
    exact = replace(waves, doubt=0.0, unsure=0.0)
    assert exact.bad(np.array([0.999, 1.0, 1.001])).tolist() == [0, 0, 1]


def test_sizes_too_uncertain_for_the_limit():
    limit = rverror.limit("transmission_error", "30 arcsec", torque="150 N*m")
    with pytest.raises(InputError, match=r"by sizes so uncertain that .*% is the best chance, and 30 are allowed"):
        match(MODEL, lot(3, sigma=2e-2), [limit])
