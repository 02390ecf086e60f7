"""Budget: propagation against `uncertainties`, worst case against corners and angles, cases with exact answers."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.stats import qmc

import rverror
from rverror.base.units import ARCSEC
from rverror.tolerances.closed_form import GroupWaves, budget
from rverror.tolerances.declared import tolerance
from rverror.tolerances.distribution import (
    Circle,
    Distribution,
    Normal,
    Rayleigh,
    Ring,
    Triangular,
    TruncatedNormal,
    Uniform,
)
from rverror.tolerances.sampling_rule import Component, SamplingRule
from rverror.tolerances.stacking import Stack, stack
from stack_covariance import of_stack

UNIT = rverror.Model(rverror.reducer("RV-40E"))
MIXED = (
    tolerance("crank.eccentricity", "5 um", correlation=0.4),
    tolerance("cycloid.disc_bore_position", "4 um", phase="random", correlation=0.9),
    tolerance("cycloid.disc_pitch", "3 um", harmonic=[1, 2], distribution="uniform", correlation=0.7),
    tolerance("cycloid.pin_radius", "2 um", distribution="truncated_normal", correlation=0.3),
    tolerance("crank.bearing_clearance", "2 um", mean="8 um"),
    tolerance("coupling.carrier_bore_position", "5 um", distribution="ring"),
    tolerance("involute.planet_eccentricity", "9 um", distribution="circle", correlation=1),
)


def made(
    entries: list[tuple[Distribution, float, bool, int, int]], n: int, seed: int, *, nominal: float = 0.0
) -> Stack:
    """Stack of random waves: (distribution, correlation, random phase, instances, terms) of each entry."""
    rng = np.random.default_rng(seed)
    rules: list[SamplingRule] = []
    components: list[Component] = []
    for e, (law, correlation, phase, instances, terms) in enumerate(entries):
        first = rules[-1].variates.stop if rules else 0
        rules.append(SamplingRule(first, len(components), instances, terms, law, correlation, phase))
        components += [
            Component(f"entry{e}", {"i": i}, f"p{p}", "length") for i in range(instances) for p in range(terms)
        ]
    entry = np.repeat(np.arange(len(rules)), [b.instances * b.terms for b in rules])
    return Stack(
        nominal * rng.standard_normal(n),
        rng.standard_normal((len(components), n)),
        tuple(components),
        entry,
        rng.uniform(0.2, 3, len(rules)),
        tuple(f"entry {e}" for e in range(len(rules))),
        tuple(rules),
    )


SCALARS = st.sampled_from([Normal(), Uniform(), Triangular(), TruncatedNormal(0.7)])
BOXES = st.tuples(SCALARS, st.sampled_from([0.0, 0.6, 1.0]), st.just(False), st.integers(1, 2), st.integers(1, 2))
CIRCLES = st.tuples(
    st.sampled_from([Rayleigh(), Circle(), Ring()]),
    st.sampled_from([0.0, 1.0]),
    st.booleans(),
    st.integers(1, 2),
    st.just(2),
)
TURNED = st.tuples(SCALARS, st.sampled_from([0.0, 0.6, 1.0]), st.just(True), st.integers(1, 2), st.just(2))
STACKS = {
    "entries": st.lists(st.one_of(BOXES, CIRCLES, TURNED), min_size=1, max_size=4),
    "n": st.integers(2, 40),
    "seed": st.integers(0, 999),
    "nominal": st.sampled_from([0.0, 2.0]),
}
BOX_STACKS = {**STACKS, "entries": st.lists(BOXES, min_size=1, max_size=3)}


def peak_to_peak(te: np.ndarray) -> np.ndarray:
    return np.ptp(te, axis=-1)


def maximum(te: np.ndarray) -> np.ndarray:
    return np.abs(te - te.mean(axis=-1, keepdims=True)).max(axis=-1)


# --- mean and variance ------------------------------------------------------------------------------------------------


def correlated(rule: SamplingRule, width: float):  # type: ignore[no-untyped-def]
    """Values of an entry for `uncertainties`: by its own covariance matrix."""
    uncertainties = pytest.importorskip("uncertainties")
    rho, count = (0.0 if rule.random_phase else rule.correlation), rule.instances * rule.terms
    sigma = width * math.sqrt(rule.distribution.variance)
    if rho == 1:  # a singular matrix costs it half its digits; a shared variable does not
        one = [uncertainties.ufloat(0, sigma) for _ in range(rule.terms)]
        return one * rule.instances
    same = np.array([[i % rule.terms == j % rule.terms for j in range(count)] for i in range(count)])
    matrix = sigma**2 * np.where(same, rho, 0.0)
    np.fill_diagonal(matrix, sigma**2)
    return list(uncertainties.correlated_values([0.0] * count, matrix))


@pytest.mark.parametrize("kind", ["reducer", "random"])
def test_propagation_is_that_of_uncertainties(kind: str) -> None:
    pytest.importorskip("uncertainties")
    if kind == "reducer":
        model = UNIT.with_effects(rverror.effect("cycloid.pin_position", pin=3, radial="8 um"))
        given_stack = stack(model, MIXED, np.linspace(0, 2 * np.pi, 24, endpoint=False))
    else:
        laws = [Normal(), Uniform(), Triangular(), TruncatedNormal(0.8), Rayleigh(1.4), Circle(), Ring()]
        cases = itertools.cycle([(0.0, False), (1.0, False), (1.0, True)])
        entries = [(law, *next(cases), 3, 2) for law in laws] + [
            (Uniform(), 0.55, False, 4, 2),
            (Rayleigh(), 0.9, True, 2, 2),
        ]
        given_stack = made(entries, 24, 4, nominal=3.0)
    x = [v for e, rule in enumerate(given_stack.rules) for v in correlated(rule, given_stack.width[e])]
    te = [
        nu + sum(v * w for v, w in zip(x, row, strict=True))
        for nu, row in zip(given_stack.nominal, given_stack.influence.T, strict=True)
    ]
    offset = sum(te) / len(te)
    deviation = [value - offset for value in te]
    found = budget(given_stack)

    def close(got, expected) -> None:  # type: ignore[no-untyped-def]
        np.testing.assert_allclose(got, expected, rtol=1e-12, atol=1e-12 * np.abs(expected).max())

    close(found.mean, np.array([v.nominal_value for v in te]))
    close(found.standard_deviation, np.array([v.std_dev for v in te]))
    close(found.deviation_standard_deviation, np.array([v.std_dev for v in deviation]))
    close(found.offset_mean, np.array(offset.nominal_value))
    close(found.offset_deviation, np.array(offset.std_dev))
    square = np.mean([v.nominal_value**2 + v.std_dev**2 for v in deviation])
    close(found.mean_square, np.array(square))
    close(found.rms, np.sqrt(square))


@given(**STACKS)  # type: ignore[arg-type]
@settings(max_examples=40, deadline=None)
def test_variance_is_that_of_the_covariance_of_the_draws(entries, n: int, seed: int, nominal: float) -> None:  # type: ignore[no-untyped-def]
    given_stack = made(entries, n, seed, nominal=nominal)
    scaled = given_stack.scaled()
    expected = np.diag(scaled.T @ of_stack(given_stack) @ scaled)
    np.testing.assert_allclose(budget(given_stack).standard_deviation ** 2, expected, rtol=1e-9)


def test_moments_are_those_of_many_units() -> None:
    given_stack = stack(UNIT, MIXED, np.linspace(0, 2 * np.pi, 96, endpoint=False))
    drawn = given_stack.standard(qmc.Sobol(given_stack.dimensions, seed=3).random_base2(14))
    te = given_stack.nominal + drawn @ given_stack.scaled()
    found = budget(given_stack)
    np.testing.assert_allclose(te.std(axis=0), found.standard_deviation, rtol=0.02)
    np.testing.assert_allclose(te.mean(axis=0), found.mean, atol=0.01 * found.standard_deviation.max())
    assert np.mean(te.var(axis=1)) == pytest.approx(found.mean_square, rel=0.01)
    assert te.mean(axis=1).std() == pytest.approx(found.offset_deviation, rel=0.02)
    for e, part in enumerate(found.contributions):
        rows = given_stack.entry == e
        alone = drawn[:, rows] @ given_stack.scaled()[rows]
        sizes = peak_to_peak(alone)
        assert sizes.max() <= part.worst_peak_to_peak * 1.5 + 1e-15  # normal draws go beyond the tolerance


@given(**STACKS)  # type: ignore[arg-type]
@settings(max_examples=40, deadline=None)
def test_shares_add_up(entries, n: int, seed: int, nominal: float) -> None:  # type: ignore[no-untyped-def]
    found = budget(made(entries, n, seed, nominal=nominal))
    assert sum(c.share for c in found.contributions) == pytest.approx(1)
    assert found.nominal_mean_square + sum(c.mean_square for c in found.contributions) == pytest.approx(
        found.mean_square
    )
    assert np.mean(found.deviation_standard_deviation**2) + found.nominal_mean_square == pytest.approx(
        found.mean_square
    )
    assert found.rss**2 == pytest.approx(sum(c.rss**2 for c in found.contributions))
    assert found.worst.peak_to_peak == pytest.approx(
        found.worst.peak_to_peak_nominal + sum(c.worst_part for c in found.contributions)
    )


# --- worst case -------------------------------------------------------------------------------------------------------


def corners(given_stack: Stack) -> np.ndarray:
    """Every corner of the box, instances of full correlation as one, shape (corners, m)."""
    groups = given_stack.worst_groups
    values = np.zeros((2 ** len(groups), len(given_stack.components)))
    for row, signs in zip(values, itertools.product((-1.0, 1.0), repeat=len(groups)), strict=True):
        for group, sign in zip(groups, signs, strict=True):
            row[group.components.ravel()] = sign
    return values


@given(**BOX_STACKS)  # type: ignore[arg-type]
@settings(max_examples=150, deadline=None)
def test_worst_case_of_boxes_is_the_worst_corner(entries, n: int, seed: int, nominal: float) -> None:  # type: ignore[no-untyped-def]
    given_stack = made(entries, n, seed, nominal=nominal)
    te = given_stack.nominal + corners(given_stack) @ given_stack.scaled()
    worst = budget(given_stack).worst
    assert worst.peak_to_peak == pytest.approx(peak_to_peak(te).max(), rel=1e-12)
    assert worst.maximum == pytest.approx(maximum(te).max(), rel=1e-12)
    np.testing.assert_allclose(worst.upper, te.max(axis=0), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(worst.lower, te.min(axis=0), rtol=1e-12, atol=1e-12)
    assert worst.offset == pytest.approx((te.mean(axis=1).min(), te.mean(axis=1).max()), rel=1e-9, abs=1e-12)


@given(
    entries=st.lists(st.one_of(CIRCLES, TURNED), min_size=1, max_size=2),
    n=st.integers(2, 12),
    seed=st.integers(0, 999),
    nominal=st.sampled_from([0.0, 2.0]),
)
@settings(max_examples=60, deadline=None)
def test_worst_case_of_circles_is_reached_from_below_by_dense_angles(
    entries, n: int, seed: int, nominal: float
) -> None:  # type: ignore[no-untyped-def]
    """Of K directions the nearest to the best one is off by at most pi / K, so cos(pi / K) is kept."""
    given_stack = made(entries, n, seed, nominal=nominal)
    groups = given_stack.worst_groups
    count = {1: 360, 2: 360, 3: 40, 4: 16}[len(groups)]
    angles = 2 * np.pi * np.arange(count) / count
    scaled = given_stack.scaled()
    te = given_stack.nominal[None]
    for group in groups:
        x, y = group.radius * scaled[group.components].sum(axis=0)
        waves = np.cos(angles)[:, None] * x + np.sin(angles)[:, None] * y
        te = (te[:, None] + waves).reshape(-1, n)
    worst = budget(given_stack).worst
    for exact, tried in ((worst.peak_to_peak, peak_to_peak(te).max()), (worst.maximum, maximum(te).max())):
        assert exact * math.cos(math.pi / count) <= tried * (1 + 1e-9)
        assert tried <= exact * (1 + 1e-12)
    assert (worst.upper >= te.max(axis=0) - 1e-12).all()
    kept = given_stack.nominal + (worst.upper - given_stack.nominal) * math.cos(math.pi / count)
    assert (kept <= te.max(axis=0) + 1e-12).all()


@given(**STACKS)  # type: ignore[arg-type]
@settings(max_examples=60, deadline=None)
def test_the_worst_unit_is_within_its_tolerances_and_reaches_the_worst_case(
    entries, n: int, seed: int, nominal: float
) -> None:  # type: ignore[no-untyped-def]
    given_stack = made(entries, n, seed, nominal=nominal)
    worst = budget(given_stack).worst
    values = worst.peak_to_peak_values
    made_so = peak_to_peak(given_stack.nominal + values @ given_stack.influence)
    assert made_so == pytest.approx(worst.peak_to_peak, rel=1e-12)
    for group in given_stack.worst_groups:
        limit = group.radius * given_stack.width[given_stack.entry[group.components[0, 0]]]
        for instance in values[group.components]:
            assert np.hypot.reduce(instance) <= limit * (1 + 1e-12)
            np.testing.assert_array_equal(instance, values[group.components][0])
    high, low = worst.peak_to_peak_angles
    te = given_stack.nominal + worst.peak_to_peak_values @ given_stack.influence
    assert te[high] - te[low] == pytest.approx(worst.peak_to_peak, rel=1e-12)


def test_no_unit_within_the_tolerances_does_worse() -> None:
    entries = [
        (Uniform(), 0.5, False, 3, 2),
        (Circle(), 0.0, False, 2, 2),
        (Ring(), 1.0, True, 2, 2),
        (Uniform(), 0.3, True, 2, 2),
    ]
    given_stack = made(entries, 200, 8, nominal=1.0)
    te = (
        given_stack.nominal
        + given_stack.standard(np.random.default_rng(0).random((4000, given_stack.dimensions))) @ given_stack.scaled()
    )
    worst = budget(given_stack).worst
    assert peak_to_peak(te).max() < worst.peak_to_peak
    assert maximum(te).max() < worst.maximum
    assert (te <= worst.upper).all()
    assert (te >= worst.lower).all()


def test_search_of_all_pairs_finds_what_summing_every_pair_finds() -> None:
    """Where the walk along farthest angles does not get there by itself."""
    missed = 0
    for seed in range(40):
        given_stack = made([(Uniform(), 0.0, False, 30, 1), (Rayleigh(), 0.0, False, 10, 2)], 300, seed, nominal=1.0)
        groups = GroupWaves(given_stack.worst_groups, given_stack.scaled(), given_stack.nominal)
        every = np.arange(300)
        summed = max(float(groups.distance(np.full(300, i), every).max()) for i in range(300))
        missed += groups.walk()[0] < summed
        assert groups.farthest()[0] == summed
    assert missed > 0


def test_pairs_of_a_whole_revolution_of_the_reducer() -> None:
    """4096 angles, a few hundred components, against the plain sum over all pairs."""
    items = [
        tolerance("cycloid.pin_position", "5 um"),
        tolerance("crank.eccentricity", "3 um"),
        tolerance("cycloid.disc_lobe", "3 um"),
    ]
    given_stack = stack(UNIT, items)
    groups = GroupWaves(given_stack.worst_groups, given_stack.scaled())
    found, high, low = groups.farthest()
    rng = np.random.default_rng(0)
    i, j = rng.integers(0, 4096, (2, 20000))
    assert groups.distance(i, j).max() <= found
    assert groups.distance(np.array([high]), np.array([low]))[0] == found
    near = (np.array([high, low])[:, None] + np.arange(-40, 41)) % 4096
    around = groups.distance(np.repeat(near[0], 81), np.tile(near[1], 81))
    assert around.max() == found


# --- cases with exact answers -----------------------------------------------------------------------------------------


def wave(order: int, n: int, law: Distribution, *, a: float = 1.3, width: float = 0.7) -> Stack:
    """One vector with the waves a cos and a sin of an order."""
    angle = 2 * np.pi * order * np.arange(n) / n
    components = tuple(Component("wave", {}, name, "length") for name in ("cos", "sin"))
    rule = SamplingRule(0, 0, 1, 2, law)
    return Stack(
        np.zeros(n),
        a * np.stack([np.cos(angle), np.sin(angle)]),
        components,
        np.zeros(2, dtype=np.intp),
        np.array([width]),
        ("wave",),
        (rule,),
    )


@pytest.mark.parametrize("capability", [1.0, 1.5])
def test_a_rayleigh_wave(capability: float) -> None:
    law = Rayleigh(capability)
    sigma = 0.7 / (capability * math.sqrt(-2 * math.log(0.0027)))
    found = budget(wave(1, 4096, law))
    assert found.rms == pytest.approx(1.3 * sigma, rel=1e-12)
    assert found.worst.peak_to_peak == pytest.approx(2 * 1.3 * 0.7, rel=1e-12)
    assert found.worst.maximum == pytest.approx(1.3 * 0.7, rel=1e-12)
    assert found.rss == pytest.approx(found.worst.peak_to_peak, rel=1e-4)  # by directions


def test_amplitude_of_a_rayleigh_wave_is_a_rayleigh_variable() -> None:
    given_stack = wave(3, 960, Rayleigh())
    sizes = peak_to_peak(given_stack.standard(qmc.Sobol(2, seed=1).random_base2(13)) @ given_stack.scaled())
    sigma = 0.7 * math.sqrt(Rayleigh().variance)
    for probability in (0.1, 0.5, 0.9, 0.99):
        exact = 2 * 1.3 * sigma * math.sqrt(-2 * math.log(1 - probability))
        assert np.quantile(sizes, probability) == pytest.approx(exact, rel=5e-3)


def test_single_cam_of_an_rv40e() -> None:
    """DESIGN: 5 um at one cam, order 40, 18.467 arcsec; all four at worst four times that."""
    one, four = (
        budget(stack(UNIT, [tolerance("crank.eccentricity", "5 um", **which)]))
        for which in ({"crank": 0, "disc": 0}, {})
    )
    assert one.worst.peak_to_peak / ARCSEC == pytest.approx(18.467, rel=3e-3)
    assert four.worst.peak_to_peak == pytest.approx(4 * one.worst.peak_to_peak, rel=3e-3)
    assert four.rss == pytest.approx(2 * one.rss, rel=3e-3)


def test_discs_ground_together_cancel() -> None:
    """Equal pitch errors of two discs, equally oriented, make nothing."""
    apart, alike, same = (
        budget(stack(UNIT, [tolerance("cycloid.disc_pitch", "5 um", harmonic=1, correlation=rho)]))
        for rho in (0, 0.75, 1)
    )
    assert alike.mean_square == pytest.approx(apart.mean_square / 4, rel=1e-9)
    assert alike.worst.peak_to_peak == apart.worst.peak_to_peak  # correlation below 1 is no promise
    assert same.worst.peak_to_peak < 1e-9 * apart.worst.peak_to_peak
    assert same.mean_square < 1e-18 * apart.mean_square


def test_offsets_count_nowhere_else() -> None:
    items = [
        tolerance("coupling.carrier_bore_position", "5 um"),
        tolerance("crank.index", "1 arcmin"),
        tolerance("involute.sun_offset", "5 um"),
    ]
    found = budget(stack(UNIT, items))
    assert [c.effect for c in found.contributions] == ["offset", "offset", "nothing"]
    assert found.mean_square == 0
    assert found.worst.peak_to_peak == found.worst.maximum == found.rss == 0
    assert [c.share for c in found.contributions] == [0, 0, 0]
    both = budget(stack(UNIT, [*items, tolerance("crank.eccentricity", "5 um")]))
    assert [c.share for c in both.contributions] == [0, 0, 0, 1]
    assert both.offset_deviation > found.offset_deviation > 0
    bore = found.contributions[0]
    # 000's delta_41: tangential e at all bores turns the output by e / r6; the mesh's radial share adds the rest
    assert bore.worst_offset == pytest.approx(math.hypot(5e-3 / 27, 2 * 0), rel=0.01)
    assert found.worst.offset[1] == pytest.approx(sum(c.worst_offset for c in found.contributions))


@given(**STACKS, factor=st.floats(0.1, 10))  # type: ignore[arg-type]
@settings(max_examples=40, deadline=None)
def test_everything_is_linear_in_the_widths(entries, n: int, seed: int, nominal: float, factor: float) -> None:  # type: ignore[no-untyped-def]
    given_stack = made(entries, n, seed)
    one, scaled = budget(given_stack), budget(replace(given_stack, width=factor * given_stack.width))
    for read in (
        lambda b: b.worst.peak_to_peak,
        lambda b: b.worst.maximum,
        lambda b: b.rms,
        lambda b: b.rss,
        lambda b: b.offset_deviation,
        lambda b: np.abs(b.worst.peak_to_peak_values).sum(),
    ):
        assert read(scaled) == pytest.approx(factor * read(one), rel=1e-9)
    shares = [[c.share for c in b.contributions] for b in (one, scaled)]
    assert shares[0] == pytest.approx(shares[1])


def test_nominal_error_is_in_the_worst_case_and_not_in_the_shares() -> None:
    model = UNIT.with_effects(rverror.effect("crank.eccentricity", crank=0, disc=0, radial="5 um"))
    items = [tolerance("crank.eccentricity", "5 um", crank=0, disc=0)]
    bare, declared = (budget(stack(m, items)) for m in (UNIT, model))
    assert declared.worst.peak_to_peak == pytest.approx(2 * bare.worst.peak_to_peak, rel=1e-3)
    assert declared.nominal_peak_to_peak == pytest.approx(bare.worst.peak_to_peak, rel=1e-3)
    assert declared.worst.peak_to_peak_nominal == pytest.approx(declared.nominal_peak_to_peak, rel=1e-3)
    without = [[replace(c, worst_part=0.0) for c in b.contributions] for b in (declared, bare)]
    assert without[0] == without[1]
    assert declared.rss == bare.rss
