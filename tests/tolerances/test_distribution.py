"""Distributions: moments by integration, tails, the correlation that normal variables need."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.integrate import quad
from scipy.special import ndtr

from rverror.base.errors import InputError
from rverror.tolerances.distribution import (
    OUTSIDE,
    Circle,
    Lognormal,
    Normal,
    Rayleigh,
    Ring,
    SampledAmplitude,
    Samples,
    Scalar,
    Triangular,
    TruncatedNormal,
    Uniform,
    normal_correlation,
    normal_quantile,
    turned,
)

MEASURED = (-3e-3, 1e-3, 1.5e-3, 2e-3, 7e-3, 2.2e-3, 0.0)
SCALARS = (
    Uniform(),
    Triangular(),
    Normal(),
    Normal(1.33),
    TruncatedNormal(),
    TruncatedNormal(0.4),
    Lognormal(shape=0.3),
    Lognormal(1.33, shape=-0.5),
    Rayleigh(),
    Rayleigh(2.0),
    Samples(MEASURED),
)
PLANES = (Circle(), Ring(), SampledAmplitude((1e-3, 2e-3, 2e-3, 5e-3)))
BOUNDED = (Uniform(), Triangular(), TruncatedNormal(), TruncatedNormal(0.4), Samples(MEASURED))


def moment(law: Scalar, power: int) -> float:
    """Integral of the quantile over the shares, piece by piece between kinks."""
    ends = (np.arange(len(MEASURED)) + 0.5) / len(MEASURED)
    pieces = [0.0, *sorted({*ends, 0.5}), 1.0]
    parts = [
        quad(lambda u: float(law.quantile(np.array(u))) ** power, a, b, epsabs=1e-13, epsrel=1e-12, limit=200)[0]
        for a, b in itertools.pairwise(pieces)
    ]
    return math.fsum(parts)


@pytest.mark.parametrize("law", SCALARS, ids=repr)
def test_mean_is_zero_and_variance_is_the_integral(law: Scalar) -> None:
    assert moment(law, 1) == pytest.approx(0, abs=1e-9)
    assert law.variance == pytest.approx(moment(law, 2), rel=1e-8)


@pytest.mark.parametrize("law", SCALARS, ids=repr)
def test_values_grow_with_the_share_and_with_the_normal_variable(law: Scalar) -> None:
    u = np.linspace(0.001, 0.999, 501)
    assert (np.diff(law.quantile(u)) >= 0).all()
    z = np.linspace(-4, 4, 81).reshape(9, 9)
    np.testing.assert_allclose(law.from_normal(z), law.quantile(ndtr(z)), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(("capability", "shape"), [(1.0, 0.3), (1.33, 1.0), (0.9, -0.5)])
def test_limits_of_a_lognormal_size_are_as_far_out_as_those_of_a_normal_one(capability: float, shape: float) -> None:
    """At Cp = 1 the shares beyond the limits are those of 3 sigma; the middle of these quantiles is the limits'."""
    law = Lognormal(capability, shape=shape)
    low, high = law.quantile(np.array([ndtr(-3.0), ndtr(3.0)])) - law.middle
    assert (low, high) == pytest.approx((-1 / capability, 1 / capability), rel=1e-9)
    below, middle, above = law.quantile(np.array([0.2, 0.5, 0.8]))  # a lognormal variable: log of ratios to its start
    start = (middle**2 - below * above) / (2 * middle - below - above)
    ratio = math.log((above - start) / (middle - start))
    assert ratio == pytest.approx(shape * 0.8416212335729143, rel=1e-7)
    z = np.linspace(-12, 14, 4001)  # moments over the normal variable, by the trapezoidal rule: exact to rounding here
    weight = np.exp(-z * z / 2) / math.sqrt(2 * math.pi) * (z[1] - z[0])
    assert weight @ law.from_normal(z) == pytest.approx(0, abs=1e-12)
    assert weight @ law.from_normal(z) ** 2 == pytest.approx(law.variance, rel=1e-12)


def test_a_lognormal_size_of_little_skewness_is_normal() -> None:
    u = np.linspace(0.001, 0.999, 99)
    np.testing.assert_allclose(Lognormal(shape=1e-5).quantile(u), Normal().quantile(u), atol=2e-5)
    assert Lognormal(shape=1e-5).middle == pytest.approx(0, abs=2e-5)


@pytest.mark.parametrize("given_", [{"shape": 0.0}, {"shape": 2.0}, {"shape": 1.5, "capability": 0.5}])
def test_a_lognormal_size_without_sense_is_refused(given_: dict[str, float]) -> None:
    with pytest.raises(InputError, match="give"):
        Lognormal(**given_)


@pytest.mark.parametrize("law", BOUNDED, ids=repr)
def test_nothing_lies_beyond_the_tolerance_and_the_ends_are_reached(law: Scalar) -> None:
    ends = law.quantile(np.array([0.0, 1.0]))
    assert np.abs(ends).max() == pytest.approx(1, rel=1e-12)
    inner = law.quantile(np.linspace(0, 1, 1001))
    assert np.abs(inner).max() <= 1 + 1e-12


@pytest.mark.parametrize("law", [Normal(), Rayleigh()], ids=repr)
def test_capability_one_leaves_27_parts_in_ten_thousand_outside(law: Normal) -> None:
    sigma = law.sigma
    outside = math.erfc(1 / sigma / math.sqrt(2)) if law.name == "normal" else math.exp(-1 / (2 * sigma**2))
    assert outside == pytest.approx(OUTSIDE, rel=1e-3)
    assert replace(law, capability=2.0).sigma == pytest.approx(sigma / 2)


def test_normal_values_are_finite_at_both_ends() -> None:
    z = normal_quantile(np.array([0.0, 0.5, 1.0]))
    assert np.isfinite(z).all()
    assert z[1] == 0
    assert z[0] < -8 < 8 < z[2]


@given(st.floats(0.01, 0.99))
def test_quadrature_finds_the_closed_correlations(correlation: float) -> None:
    """On distributions whose answer is known."""
    known = [
        (Uniform(), 2 * math.sin(math.pi * correlation / 6)),
        (Normal(), correlation),
        (Rayleigh(), correlation),
        (Lognormal(shape=0.5), math.log1p(correlation * math.expm1(0.25)) / 0.25),
        (Lognormal(shape=-1.5), math.log1p(correlation * math.expm1(2.25)) / 2.25),
    ]
    for law, expected in known:
        assert normal_correlation(law, law, correlation) == pytest.approx(expected, abs=1e-7)


@pytest.mark.parametrize("law", SCALARS, ids=repr)
def test_no_and_full_correlation_stay(law: Scalar) -> None:
    assert normal_correlation(law, law, 0.0) == pytest.approx(0)
    assert normal_correlation(law, law, 1.0) == pytest.approx(1)


@pytest.mark.parametrize("law", PLANES, ids=lambda law: law.name)
def test_vectors_have_no_mean_no_correlation_and_the_stated_variance(law: Circle | Ring | SampledAmplitude) -> None:
    steps = (np.arange(600) + 0.5) / 600
    grid = np.stack(np.meshgrid(*[steps] * law.variates, indexing="ij"), axis=-1).reshape(-1, law.variates)
    drawn = law.pairs(grid)
    np.testing.assert_allclose(drawn.mean(axis=0), 0, atol=1e-12)
    np.testing.assert_allclose(np.cov(drawn.T, bias=True), law.variance * np.eye(2), atol=2e-6)
    assert np.hypot(*drawn.T).max() == pytest.approx(1, abs=1e-3)


def test_a_circle_is_filled_evenly() -> None:
    u = np.linspace(0, 1, 10001)
    amplitude = np.hypot(*Circle().pairs(np.stack([u, 0 * u], axis=-1)).T)
    for radius in (0.1, 0.5, 0.9):
        assert (amplitude <= radius).mean() == pytest.approx(radius**2, abs=1e-3)


def test_turning_keeps_the_length_and_adds_the_angle() -> None:
    vectors = np.array([[3.0, 4.0], [1.0, 0.0]])
    found = turned(vectors, np.array([0.25, 0.125]))
    np.testing.assert_allclose(found, [[-4, 3], [math.sqrt(0.5), math.sqrt(0.5)]], atol=1e-15)


@given(st.lists(st.floats(-1, 1), min_size=2, max_size=20).filter(lambda v: max(v) - min(v) > 1e-6))
def test_samples_keep_their_mean_and_follow_hazen(values: list[float]) -> None:
    law = Samples(tuple(values))
    u = np.linspace(0, 1, 41)
    expected = np.quantile(values, u, method="hazen")
    np.testing.assert_allclose(law.quantile(u) * law.width + law.mean, expected, atol=1e-12)
    assert law.variance * law.width**2 <= np.var(values) * (1 + 1e-9)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Normal(0.0), "capability = 0: must be above 0"),
        (lambda: Rayleigh(-1.0), "capability = -1"),
        (lambda: TruncatedNormal(math.nan), "capability = nan"),
        (lambda: Samples(()), "there are none"),
        (lambda: Samples((1.0, 1.0)), "all 2 values are equal"),
        (lambda: Samples((1.0, math.inf)), "not finite"),
        (lambda: SampledAmplitude((1.0, -0.5)), "-0.5 is no length"),
        (lambda: SampledAmplitude((0.0,)), "all values are 0"),
    ],
)
def test_unusable_values_are_refused(make: object, said: str) -> None:
    with pytest.raises(InputError, match=said):
        make()  # type: ignore[operator]
