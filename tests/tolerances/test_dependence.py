"""Correlation between tolerances: the closed form's variance, draws, what cancels, what contradicts itself."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import qmc

import rverror
from rverror.base.errors import InputError
from rverror.tolerances.allocation import cost_front
from rverror.tolerances.closed_form import budget
from rverror.tolerances.constraints import WorstPeakToPeak
from rverror.tolerances.cost import Choice, Reciprocal
from rverror.tolerances.declared import tolerance
from rverror.tolerances.distribution import Lognormal, Normal, Scalar, Uniform, normal_correlation
from rverror.tolerances.sampling_rule import Component, SamplingRule
from rverror.tolerances.sobol import stack_indices
from rverror.tolerances.stacking import Stack, stack
from stack_covariance import of_stack

UNIT = rverror.Model(rverror.reducer("RV-40E"))
THETA = 2 * np.pi * np.arange(240) / 240


def pair(value: float, one: dict[str, object], other: dict[str, object]) -> Stack:
    """Cams and bores, four instances each; instances of one crank and disc go together."""
    cams = tolerance("crank.eccentricity", "5 um", name="cams", **one)  # type: ignore[arg-type]
    given = {"name": "bores", "correlated_with": {"cams": value}, **other}
    bores = tolerance("cycloid.disc_bore_position", "4 um", **given)  # type: ignore[arg-type]
    return stack(UNIT, [bores, cams], THETA)


LAWS = [
    ({}, {}),
    ({"distribution": "normal", "correlation": 0.5}, {"capability": 1.33}),
    ({"distribution": "uniform"}, {"distribution": "lognormal", "shape": 0.4}),
    ({"distribution": "uniform", "correlation": 0.4}, {"distribution": "triangular", "correlation": 0.3}),
]


@pytest.mark.parametrize(("one", "other"), LAWS)
@pytest.mark.parametrize("value", [0.45, -0.45])
def test_variance_is_that_of_the_correlated_values_and_draws_have_it(
    one: dict[str, object], other: dict[str, object], value: float
) -> None:
    """a^T C a with C written out component by component, and the same of 16384 units."""
    given = pair(value, one, other)
    covariance = np.zeros((len(given.components),) * 2)
    for (i, a), (j, b) in itertools.product(enumerate(given.components), repeat=2):
        laws = [given.rules[given.entry[k]] for k in (i, j)]
        alike = a.indices == b.indices
        rho = float(i == j)
        if i != j and a.parameter == b.parameter:
            rho = laws[0].correlation if given.entry[i] == given.entry[j] else value * alike
        sigmas = [
            given.width[given.entry[k]] * math.sqrt(law.distribution.variance)
            for k, law in zip((i, j), laws, strict=True)
        ]
        covariance[i, j] = rho * sigmas[0] * sigmas[1]
    waves = given.influence
    expected = np.einsum("in,ij,jn->n", waves, covariance, waves)
    closed = budget(given)
    np.testing.assert_allclose(closed.standard_deviation**2, expected, rtol=1e-9)
    assert sum(entry.share for entry in closed.contributions) == pytest.approx(1)
    deviating = waves - waves.mean(axis=1, keepdims=True)
    mean_square = np.einsum("in,ij,jn->n", deviating, covariance, deviating).mean()
    assert closed.mean_square - closed.nominal_mean_square == pytest.approx(mean_square, rel=1e-9)

    points = qmc.Sobol(given.dimensions, seed=1, bits=30).random(2**14)
    drawn = given.standard(points) * given.width[given.entry]
    sizes = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)))
    # 3.5 standard errors of a correlation of so many units; quasi-random draws are nearer
    np.testing.assert_allclose(np.cov(drawn.T) / sizes, covariance / sizes, atol=3.5 / 2**7)
    np.testing.assert_allclose(np.var(drawn @ waves, axis=0), expected, rtol=0.05)
    np.testing.assert_allclose(of_stack(given) * np.outer(*[given.width[given.entry]] * 2), covariance, atol=1e-15)


def test_errors_that_are_each_others_opposite_cancel() -> None:
    """Two tolerances of one value, wholly and negatively correlated: nothing is left of any unit."""
    opposite = stack(
        UNIT,
        [
            tolerance("cycloid.pin_radius", "5 um", pin="all", name="roller"),
            tolerance("cycloid.pin_radius", "5 um", pin="all", name="groove", correlated_with={"roller": -1.0}),
        ],
        THETA,
    )
    assert np.abs(budget(opposite).standard_deviation).max() < 1e-7 * np.abs(opposite.scaled()).max()
    drawn = opposite.standard(np.random.default_rng(2).random((64, opposite.dimensions)))
    np.testing.assert_allclose(drawn[:, 0], -drawn[:, 1], atol=1e-9)


def test_instances_go_together_whose_common_indices_are_alike() -> None:
    """A disc has one pitch error and two bores: each bore goes with its own disc."""
    pitch = tolerance("cycloid.disc_pitch", "4 um", harmonic=1, parameters=["sin"])
    bores = tolerance(
        "cycloid.disc_bore_position", "4 um", parameters=["radial"], correlated_with={"cycloid.disc_pitch": 0.5}
    )
    given = stack(UNIT, [pitch, bores], THETA)
    for i, j in itertools.product(range(2), range(2, 6)):
        same = given.components[i].indices["disc"] == given.components[j].indices["disc"]
        assert of_stack(given)[i, j] == pytest.approx(0.5 / 9 if same else 0)


def three(value: float) -> list[rverror.tolerances.Tolerance]:
    keys = ("involute.sun_eccentricity", "coupling.carrier_runout", "involute.sun_offset")
    made = [tolerance(key, "5 um", parameters=["x"], name=name) for key, name in zip(keys, "abc", strict=True)]
    said = [{}, {"a": value}, {"a": value, "b": value}]
    return [
        rverror.tolerances.Tolerance(**{**vars(item), "correlated_with": own})
        for item, own in zip(made, said, strict=True)
    ]


def test_correlations_that_contradict_one_another_are_named() -> None:
    """Three values cannot all be opposites: the least eigenvalue of three is 1 - 2 * 0.8."""
    with pytest.raises(InputError, match=r"'a', 'b', 'c' contradict one another"):
        stack(UNIT, three(-0.8), THETA)
    assert stack(UNIT, three(-0.5), THETA).dependence is not None  # singular, but there are such parts


@pytest.mark.parametrize(
    ("said", "match"),
    [
        ({"cam": 0.5}, "no other tolerance of this name.* did you mean 'cams'"),
        ({"cams": 1.5}, "from -1 to 1"),
        ({"cycloid.pin_radius": 0.5}, "2 tolerances of this name; give each a name"),
        ({"discs": 0.5}, "1 and 2 parameters"),
        ({"ring": 0.5}, "'rayleigh' or 'normal'"),
    ],
)
def test_correlation_with_what_has_none_is_refused(said: dict[str, float], match: str) -> None:
    with pytest.raises(InputError, match=match):
        stack(
            UNIT,
            [
                tolerance("crank.eccentricity", "5 um", name="cams", parameters=["radial"]),
                tolerance("cycloid.pin_radius", "5 um"),
                tolerance("cycloid.pin_radius", "5 um", pin="all"),
                tolerance("cycloid.disc_pitch", "5 um", harmonic=1, name="discs", parameters=["cos"]),
                tolerance("coupling.carrier_bore_position", "5 um", distribution="ring", name="ring"),
                tolerance("cycloid.disc_bore_position", "5 um", correlated_with=said),
            ],
            THETA,
        )


def test_two_that_say_different_things_are_refused() -> None:
    one = tolerance("crank.eccentricity", "5 um", name="cams", correlated_with={"bores": 0.2})
    other = tolerance("cycloid.disc_bore_position", "5 um", name="bores", correlated_with={"cams": 0.3})
    with pytest.raises(InputError, match=r"0\.3 here and 0\.2 there"):
        stack(UNIT, [one, other], THETA)


def test_what_is_correlated_has_no_sobol_index_of_its_own() -> None:
    given = stack(UNIT, [*three(0.3), tolerance("crank.eccentricity", "5 um")])
    indices = stack_indices(given, count=256)
    assert np.isnan(indices.first[:3]).all()
    assert indices.total[3] > 0.9  # the others only move the offset


def test_normal_variables_between_two_laws() -> None:
    """Uniform with normal: E[z (2 Phi(z) - 1)] = 1/sqrt(pi), so the images have r sqrt(3/pi)."""
    r = normal_correlation(Uniform(), Normal(), 0.6)
    assert r == pytest.approx(0.6 * math.sqrt(math.pi / 3), rel=1e-6)
    with pytest.raises(InputError, match=r"only -0\.977 to 0\.977"):
        normal_correlation(Uniform(), Normal(), 0.98)


# --- limits that are not alike to both sides of the mean --------------------------------------------------------------


def skewed(seed: int) -> Stack:
    """Four numbers, two of them lognormal to either side, over a few angles and a nominal error."""
    laws: list[Scalar] = [Lognormal(shape=0.6), Normal(), Lognormal(0.9, shape=-0.4)]
    rules = [SamplingRule(0, 0, 2, 1, laws[0]), SamplingRule(2, 2, 1, 1, laws[1]), SamplingRule(3, 3, 1, 1, laws[2])]
    rng = np.random.default_rng(seed)
    entry = np.array([0, 0, 1, 2])
    waves, width = rng.standard_normal((4, 12)), rng.uniform(0.5, 2, 3)
    return Stack(rng.standard_normal(12), waves, (), entry, width, ("a", "b", "c"), tuple(rules))


def corners(given: Stack, width: np.ndarray) -> np.ndarray:
    """Errors with every value at one of its limits: half a span to either side of their middle."""
    ends = np.array(list(itertools.product((-1.0, 1.0), repeat=given.entry.size)))
    middle = np.array([given.rules[e].distribution.middle for e in given.entry])
    return given.nominal + ((ends + middle) * width[given.entry]) @ given.influence


@pytest.mark.parametrize("seed", range(3))
def test_no_corner_of_skewed_limits_is_beyond_the_worst_case_and_one_is_there(seed: int) -> None:
    given = skewed(seed)
    units = corners(given, given.width)
    worst = budget_of_numbers(given)
    assert worst.peak_to_peak == pytest.approx(np.ptp(units, axis=1).max())
    np.testing.assert_allclose(worst.upper, units.max(axis=0))
    np.testing.assert_allclose(worst.lower, units.min(axis=0))
    away = units - units.mean(axis=1, keepdims=True)
    assert worst.maximum == pytest.approx(np.abs(away).max())
    assert worst.offset == pytest.approx((units.mean(axis=1).min(), units.mean(axis=1).max()))
    unit = given.nominal + worst.peak_to_peak_values @ given.influence
    assert np.ptp(unit) == pytest.approx(worst.peak_to_peak)


def budget_of_numbers(given: Stack):  # type: ignore[no-untyped-def]
    named = tuple(Component("any", {"i": i}, "p", "length") for i in range(given.entry.size))
    full = Stack(**{**vars(given), "components": named})
    closed = budget(full)
    parts = sum(entry.worst_part for entry in closed.contributions) + closed.worst.peak_to_peak_nominal
    assert parts == pytest.approx(closed.worst.peak_to_peak)
    for e, entry in enumerate(closed.contributions):
        own = np.where(np.arange(3) == e, given.width, 0.0)
        alone = Stack(**{**vars(given), "nominal": np.zeros(12)})
        units = corners(alone, own)
        assert entry.worst_peak_to_peak == pytest.approx(np.ptp(units, axis=1).max())
        assert entry.worst_offset == pytest.approx(np.abs(units.mean(axis=1)).max())
        law = given.rules[e].distribution
        farther = given.width[e] * max(abs(law.middle - 1), abs(law.middle + 1))  # limit from the mean
        waves = given.influence[given.entry == e]
        assert entry.rss == pytest.approx(math.hypot(*(farther * np.ptp(waves, axis=1))))
    return closed.worst


@pytest.mark.parametrize("seed", range(3))
def test_allocation_at_the_worst_case_holds_skewed_limits(seed: int) -> None:
    given = skewed(seed)
    row, offset = WorstPeakToPeak(given).measure(given.width)[1]
    assert (row >= 0).all()
    assert row @ given.width + offset == pytest.approx(np.ptp(corners(given, given.width), axis=1).max())
    limit = 0.6 * np.ptp(corners(given, given.width), axis=1).max() + 0.4 * np.ptp(given.nominal)
    costs = [Reciprocal(1.0, 1.0), Reciprocal(2.0, 1.0), Reciprocal(0.5, 1.0)]
    given = replace(given, choices=tuple(map(Choice, costs)))
    found = cost_front(given, [limit], kind="worst")[0].allocation
    assert found is not None
    assert np.ptp(corners(given, np.array(found.widths)), axis=1).max() == pytest.approx(limit, rel=1e-9)
