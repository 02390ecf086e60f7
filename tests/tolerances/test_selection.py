"""Sorted parts and selected fits: against closed forms, enumeration of the classes, simulation and limit cases."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import scipy
from hypothesis import given, settings, strategies as st

import rverror
from rverror.base.errors import InputError
from rverror.tolerances.closed_form import budget
from rverror.tolerances.declared import SelectedFit, tolerance
from rverror.tolerances.distribution import Lognormal, Normal, Samples, Triangular, TruncatedNormal, Uniform
from rverror.tolerances.sampling_rule import Component, SamplingRule
from rverror.tolerances.sobol import stack_indices
from rverror.tolerances.stacking import Stack, stack
from rverror.tolerances.tolerance_file import load_tolerances
from stack_covariance import of_rule, of_stack

UNIT = rverror.Model(rverror.reducer("RV-40E"))
THETA = 2 * np.pi * np.arange(480) / 480
LAWS = [
    Uniform(),
    Triangular(),
    Normal(),
    Normal(0.7),
    TruncatedNormal(0.5),
    Lognormal(shape=0.4),
    Samples((0.0, 1.0, 1.5, 7.0)),
]
laws, counts = st.sampled_from(LAWS), st.integers(2, 12)


def points(dimensions, count=2**16):
    return scipy.stats.qmc.Sobol(dimensions, seed=3).random(count)


def draws(rule):
    return rule.standard(points(rule.variates.stop))


# --- classes of a distribution -----------------------------------------------------------------------------------


@given(laws, counts)
def test_means_of_the_classes(law, classes):
    """By a million strips of the quantile; each class has as many parts, so they are 0 together."""
    middle = (np.arange(10**6 // classes * classes) + 0.5) / (10**6 // classes * classes)
    strips = law.quantile(middle).reshape(classes, -1).mean(axis=1)
    assert law.class_means(classes) == pytest.approx(strips, abs=2e-4)
    assert law.class_means(classes).sum() == pytest.approx(0.0, abs=1e-9 * classes)


@given(counts)
def test_means_and_correlation_in_closed_form(classes):
    ends = scipy.stats.norm.ppf(np.arange(classes + 1) / classes)
    normal = -classes * np.diff(scipy.stats.norm.pdf(ends)) / 3
    assert Normal().class_means(classes) == pytest.approx(normal, abs=1e-10)
    assert Uniform().class_means(classes) == pytest.approx((2 * np.arange(classes) + 1 - classes) / classes, abs=1e-10)
    assert Uniform().class_correlation(classes) == pytest.approx(1 - 1 / classes**2)


@pytest.mark.parametrize("law", LAWS)
def test_many_classes_are_correlation_one(law):
    assert law.class_correlation(1000) == pytest.approx(1.0, abs=2e-3)
    assert law.widest_class(1) == 1.0
    wide = [law.class_correlation(k) for k in (1, 2, 4, 16, 256)]
    assert wide == sorted(wide)
    assert wide[0] == pytest.approx(0.0, abs=1e-7)


# --- sorted parts of one tolerance -----------------------------------------------------------------------------------


@settings(deadline=None, max_examples=25)
@given(laws, counts)
def test_covariance_is_that_of_the_draws_and_each_size_stays_as_it_was(law, classes):
    rule = SamplingRule(0, 0, 3, 1, law, classes=classes)
    drawn = draws(rule)
    np.testing.assert_allclose(np.cov(drawn.T), of_rule(rule), atol=4e-3 * law.variance)
    np.testing.assert_allclose(drawn.mean(axis=0), 0.0, atol=2e-3)
    for column in drawn.T:
        share = np.searchsorted(np.sort(column), law.quantile(np.array([0.01, 0.3, 0.5, 0.9]))) / len(column)
        wanted = [0.01, 0.3, 0.5, 0.9]
        if not isinstance(law, Samples):  # whose tails are flat
            np.testing.assert_allclose(share, wanted, atol=2e-3)


@pytest.mark.parametrize("law", LAWS)
def test_parts_of_a_unit_are_of_one_class(law):
    """Each class as often, and no part beyond the ends of its class."""
    drawn = draws(SamplingRule(0, 0, 3, 1, law, classes=4))
    ends = law.quantile(np.arange(5) / 4)
    inside = [((drawn >= low - 1e-12) & (drawn <= high + 1e-12)).all(axis=1) for low, high in itertools.pairwise(ends)]
    assert np.any(inside, axis=0).all()
    assert [np.mean(one) for one in inside] == pytest.approx([0.25] * 4, abs=2e-3)


def test_one_class_is_no_sorting():
    rule = SamplingRule(0, 0, 3, 1, Normal(), classes=1)
    assert rule.variates == SamplingRule(0, 0, 3, 1, Normal()).variates
    given_points = points(3, 64)
    unsorted = SamplingRule(0, 0, 3, 1, Normal())
    np.testing.assert_array_equal(rule.standard(given_points), unsorted.standard(given_points))


def test_a_thousand_classes_are_one_size():
    drawn = draws(SamplingRule(0, 0, 3, 1, Uniform(), classes=1000))
    assert np.ptp(drawn, axis=1).max() <= 2e-3


def rollers(**given):
    return tolerance("cycloid.pin_radius", "3 um", **given)


def test_sorted_rollers_lie_between_rollers_as_they_come_and_rollers_of_one_size():
    """Exactly: correlated by rho they have the share rho of the one and 1 - rho of the other in the mean square."""
    mixed, alike = (budget(stack(UNIT, [rollers(**one)], THETA)).mean_square for one in ({}, {"pin": "all"}))
    for classes in (2, 4, 20):
        found = budget(stack(UNIT, [rollers(classes=classes)], THETA))
        rho = Normal().class_correlation(classes)
        assert found.mean_square == pytest.approx((1 - rho) * mixed + rho * alike, rel=1e-9)
    assert found.mean_square < 0.1 * mixed


# --- worst case ------------------------------------------------------------------------------------------------------


def by_classes(law, classes, waves):
    """Largest p-p over all classes, each part anywhere in its class, by the corners of every class and both angles."""
    ends = law.quantile(np.arange(classes + 1) / classes) - law.middle
    ends = np.clip(ends, -1, 1)
    ends[0], ends[-1] = -1, 1
    best = 0.0
    for low, high in itertools.pairwise(ends):
        for corner in itertools.product((low, high), repeat=len(waves)):
            best = max(best, float(np.ptp((np.array(corner) + law.middle) @ waves)))
    return best


def alone(law, classes, waves):
    components = tuple(Component("a.size", {"pin": i}, "size", "length") for i in range(len(waves)))
    rules = (SamplingRule(0, 0, len(waves), 1, law, classes=classes),)
    entry = np.zeros(len(waves), dtype=int)
    return Stack(np.zeros(waves.shape[1]), waves, components, entry, np.ones(1), ("a",), rules)


@settings(deadline=None, max_examples=40)
@given(laws, counts, st.integers(0, 10**6))
def test_worst_case_of_sorted_parts(law, classes, seed):
    """Where the outermost class is the widest it is reached, else it is a bound; unsorted parts do no better."""
    waves = np.random.default_rng(seed).normal(size=(4, 6))
    found = budget(alone(law, classes, waves)).worst
    enumerated = by_classes(law, classes, waves)
    ends = np.clip(law.quantile(np.arange(classes + 1) / classes) - law.middle, -1, 1)
    ends[0], ends[-1] = -1, 1
    outermost = min(ends[1] - ends[0], ends[-1] - ends[-2])
    if outermost >= np.diff(ends).max() * (1 - 1e-12):
        assert found.peak_to_peak == pytest.approx(enumerated, rel=1e-9)
    assert found.peak_to_peak >= enumerated * (1 - 1e-9)
    assert found.peak_to_peak <= budget(alone(law, 1, waves)).worst.peak_to_peak * (1 + 1e-9)
    assert np.ptp(found.peak_to_peak_values @ waves) == pytest.approx(found.peak_to_peak)
    assert np.abs(found.peak_to_peak_values - law.middle).max() <= 1 + 1e-9


def test_worst_case_of_a_thousand_classes_is_that_of_one_size():
    waves = np.random.default_rng(1).normal(size=(5, 7))
    one_size = float(np.ptp(waves.sum(axis=0)))
    assert budget(alone(Uniform(), 1000, waves)).worst.peak_to_peak == pytest.approx(2 * one_size / 2, rel=0.02)


# --- two tolerances --------------------------------------------------------------------------------------------------


def cams_and_bores(law="uniform", **fit):
    cams = tolerance("crank.eccentricity", "5 um", name="cams", parameters=["radial"], distribution=law)
    bores = tolerance(
        "cycloid.disc_bore_position", "5 um", parameters=["radial"], distribution=law, fit={"with": "cams", **fit}
    )
    return [cams, bores]


def standard(laid, seed=1, count=2**16):
    return laid.standard(np.random.default_rng(seed).random((count, laid.dimensions)))


def place(laid, row):
    return tuple(sorted(laid.components[row].indices.items()))


@pytest.mark.parametrize("classes", [2, 3, 10])
@pytest.mark.parametrize("opposite", [False, True])
def test_difference_or_sum_of_uniform_sizes_shrinks_by_the_classes(classes, opposite):
    """|u - v| of one class is the k-th part of that at random, whose mean is 2/3 and quantile 2 (1 - sqrt(1 - q))."""
    laid = stack(UNIT, cams_and_bores(classes=classes, opposite=opposite), THETA)
    drawn = standard(laid)
    for i, j in itertools.product(range(4), range(4, 8)):
        gap = np.abs(drawn[:, i] + (1 if opposite else -1) * drawn[:, j])
        if place(laid, i) == place(laid, j):
            assert gap.mean() == pytest.approx(2 / 3 / classes, rel=0.02)
            assert np.quantile(gap, 0.9) == pytest.approx(2 * (1 - math.sqrt(0.1)) / classes, rel=0.02)
            assert gap.max() <= 2 / classes * (1 + 1e-12)
        else:
            assert gap.mean() == pytest.approx(2 / 3, rel=0.02)


@pytest.mark.parametrize("law", ["uniform", "normal", "triangular"])
@pytest.mark.parametrize("opposite", [False, True])
def test_covariance_of_a_fit_is_that_of_the_draws(law, opposite):
    laid = stack(UNIT, cams_and_bores(law, classes=3, opposite=opposite), THETA)
    size = laid.rules[0].distribution.variance
    np.testing.assert_allclose(np.cov(standard(laid).T), of_stack(laid), atol=0.02 * size)
    found = budget(laid)
    scaled = laid.scaled()
    variance = np.einsum("an,ab,bn->n", scaled, of_stack(laid), scaled)
    np.testing.assert_allclose(found.standard_deviation**2, variance, rtol=1e-9, atol=1e-9 * variance.max())
    assert sum(entry.mean_square for entry in found.contributions) == pytest.approx(found.mean_square)


def test_one_of_two_with_fewer_indices_ties_all_that_share_its_place():
    """A carrier bore has a crank, a cam a crank and a disc: both cams of a crank get parts of its class."""
    bores = tolerance("coupling.carrier_bore_position", "5 um", parameters=["radial"], name="bores")
    cams = tolerance("crank.eccentricity", "5 um", parameters=["radial"], fit={"with": "bores", "classes": 4})
    laid = stack(UNIT, [cams, bores], THETA)
    rho = Normal().class_correlation(4)
    for i, j in itertools.combinations(range(6), 2):
        same = laid.components[i].indices["crank"] == laid.components[j].indices["crank"]
        assert of_stack(laid)[i, j] == pytest.approx(rho / 9 if same else 0.0)
    np.testing.assert_allclose(np.cov(standard(laid).T), of_stack(laid), atol=0.02 / 9)


def test_many_classes_of_a_fit_are_correlation_one_and_minus_one():
    for opposite in (False, True):
        laid = stack(UNIT, cams_and_bores(classes=1000, opposite=opposite), THETA)
        among = of_stack(laid)[:4, 4:] * 3
        rows = [[place(laid, i) == place(laid, j) for j in range(4, 8)] for i in range(4)]
        np.testing.assert_allclose(among, (-1 if opposite else 1) * np.array(rows), atol=1e-5)


def test_the_worst_case_of_a_fit_is_that_without_it():
    """A bound: what a fit ties between two tolerances it leaves free."""
    items = cams_and_bores(classes=3)
    found, free = (budget(stack(UNIT, [items[0], one], THETA)) for one in (items[1], replace(items[1], fit=None)))
    assert found.worst.peak_to_peak == pytest.approx(free.worst.peak_to_peak)


def test_virtual_units_and_sobol_indices():
    """Cams that lead and bores that trail by the same add up; opposite classes leave their difference."""
    items = cams_and_bores("normal", classes=20, opposite=True)
    other = tolerance("involute.planet_eccentricity", "5 um")
    laid = stack(UNIT, [*items, other, rollers(classes=4)], THETA)
    units = rverror.tolerances.virtual_units(laid, 4096, seed=3)
    drawn = standard(laid, seed=2, count=4096) @ laid.scaled() + laid.nominal
    peaks = np.ptp(drawn, axis=1)
    assert units.peak_to_peak.mean() == pytest.approx(peaks.mean(), rel=0.02)
    indices = stack_indices(laid, count=4096)
    assert np.isnan(indices.first).tolist() == [True, True, False, False]


def test_correlated_and_fitted_tolerances_side_by_side():
    items = cams_and_bores(classes=3)
    index = tolerance("crank.index", "10 arcsec", name="index")
    carrier = tolerance(
        "coupling.carrier_bore_position", "4 um", parameters=["tangential"], correlated_with={"index": 0.5}
    )
    laid = stack(UNIT, [items[0], index, carrier, items[1]], THETA)
    size = np.sqrt(np.diag(of_stack(laid)))
    drawn = standard(laid)
    np.testing.assert_allclose(np.cov(drawn.T) / np.outer(size, size), of_stack(laid) / np.outer(size, size), atol=0.02)


# --- files -----------------------------------------------------------------------------------------------------------

TEXT = """\
[[tolerance]]
key = "cycloid.pin_radius"
tolerance = "3 um"
classes = 4

[[tolerance]]
name = "cams"
key = "crank.eccentricity"
parameters = ["radial"]
tolerance = "5 um"

[[tolerance]]
key = "cycloid.disc_bore_position"
parameters = ["radial"]
tolerance = "5 um"
fit = { with = "cams", classes = 3, opposite = true }
"""
TABLE = """\
name,key,parameter,tolerance[um],classes,fit
,cycloid.pin_radius,,3,4,
cams,crank.eccentricity,radial,5,,
,cycloid.disc_bore_position,radial,5,,cams: 3 opposite
"""


def test_a_file_and_a_table_say_the_same(tmp_path: Path) -> None:
    (tmp_path / "t.toml").write_text(TEXT, encoding="utf-8")
    (tmp_path / "t.csv").write_text(TABLE, encoding="utf-8")
    items = load_tolerances(tmp_path / "t.toml", UNIT)
    assert items == load_tolerances(tmp_path / "t.csv", UNIT)
    assert (items[0].classes, items[2].fit) == (4, SelectedFit("cams", classes=3, opposite=True))
    assert stack(UNIT, items, THETA).rules[0].classes == 4


@pytest.mark.parametrize(
    ("before", "after", "says"),
    [
        ("classes = 4", "classes = 2.5", "line 4: classes = 2.5: must be a whole number"),
        ("classes = 4", "classes = 0", "line 4: .*classes = 0: must be a whole number from 1 to 1000"),
        ("classes = 4", "classes = 4\ncorrelation = 0.5", "line 4: .*sorted one by one; leave correlation"),
        ("classes = 3, ", "", "line 16: fit = .*must say with and classes; write fit = { with"),
        ("classes = 3", "classes = 1", "line 16: fit: classes = 1: must be a whole number from 2"),
        ("classes = 3", "classes = 3, by = 1", "line 16: fit = .*must say"),
        ("opposite = true", "opposite = 1", "line 16: fit = .*opposite true or false"),
        ('with = "cams"', 'with = "cam"', "fit 'cam': no other tolerance of this name; did you mean 'cams'"),
        ('with = "cams"', 'with = "cycloid.pin_radius"', "one of them is sorted or matched already"),
        ('["radial"]\ntolerance = "5 um"\nfit', '["radial"]\ntolerance = "5 um"\nclasses = 2\nfit', "beside fit"),
        (
            'parameters = ["radial"]\ntolerance = "5 um"\nfit',
            'tolerance = "5 um"\nfit',
            "line 15: .*sorted by one number",
        ),
        ('key = "crank.eccentricity"\nparameters = ["radial"]', 'key = "crank.eccentricity"', "sorted by one number"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, before: str, after: str, says: str) -> None:
    path = tmp_path / "t.toml"
    assert before in TEXT
    path.write_text(TEXT.replace(before, after, 1), encoding="utf-8")
    with pytest.raises(InputError, match=says) as caught:
        load_tolerances(path, UNIT)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("cell", ["cams 3", "cams: 3 upside", "cams: few"])
def test_a_wrong_cell_of_a_table_is_named(tmp_path: Path, cell: str) -> None:
    path = tmp_path / "t.csv"
    path.write_text(TABLE.replace("cams: 3 opposite", cell), encoding="utf-8")
    with pytest.raises(InputError, match=f"line 4: fit is '{cell}'; write it like 'bores: 3'"):
        load_tolerances(path)


def test_sorted_parts_have_no_other_correlation():
    items = cams_and_bores(classes=3)
    pins = rollers(classes=3, name="pins")
    index = tolerance("crank.index", "10 arcsec", correlated_with={"pins": 0.5})
    with pytest.raises(InputError, match=r"pins: is correlated .*sorted into classes"):
        stack(UNIT, [pins, index], THETA)
    with pytest.raises(InputError, match="matched already; parts are matched in pairs"):
        stack(UNIT, [*items, replace(items[1], name="again")], THETA)
