"""The control variate against known distributions, and the correction against the equilibrium of every unit."""

from __future__ import annotations

import json
import math
import multiprocessing
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ndtri

import rverror
from rverror.base.errors import InputError
from rverror.base.units import ARCSEC
from rverror.geartrain.mechanism import Stiffness
from rverror.statics.loaded_state import NotConvergedError
from rverror.statics.prediction import Predictor
from rverror.tolerances import control_variate as module
from rverror.tolerances.control_variate import ContactCorrection, ControlVariate, contact_correction
from rverror.tolerances.sampling import VirtualUnits, uniforms, virtual_units
from rverror.tolerances.stacking import stack, tolerance

LEVELS = (0.5, 0.95, 0.99)
ANGLES = 2 * np.pi * np.arange(128) / 128

# --- the estimator, on functions whose distribution is known ----------------------------------------------------------


def normals(rng: np.random.Generator, count: int) -> np.ndarray:
    """Cheap quantities: normal, mean 20, deviation 3."""
    return 20 + 3 * rng.normal(size=count)


def straight(x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Normal again: mean 30, deviation 5, correlation 0.6."""
    return 30 + 1.0 * (x - 20) + 4 * rng.normal(size=x.size)


def floor(x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """What never gets below 19, as if contacts were open in good units: its quantiles are those of x, or 19."""
    return np.maximum(x, 19.0)


def bent(x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Grows faster and faster."""
    return 10 + 0.03 * x**2


def skewed(x: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """With an exponential rest of mean 4: a long tail, correlation 0.6."""
    return x + 4 * rng.exponential(size=x.size)


def below(z: float) -> float:
    """Normal distribution function."""
    return 0.5 * math.erfc(-z / math.sqrt(2))


def below_skewed(t: float) -> float:
    """Distribution of the sum of a normal and an exponential variable."""
    u = (t - 20) / 3
    return below(u) - math.exp(-(t - 20) / 4 + 9 / 32) * below(u - 3 / 4)


QUANTILES = 20 + 3 * ndtri(np.array(LEVELS))
LIMIT = float(QUANTILES[1])
#: Function; quantiles, mean, and share up to the cheap P95, by hand.
KNOWN: dict[str, tuple[Callable[..., np.ndarray], list[float]]] = {
    "straight": (straight, [*(30 + 5 * ndtri(LEVELS)), 30.0, below((LIMIT - 30) / 5)]),
    # E max(z, a) = phi(a) + a Phi(a)
    "floor": (
        floor,
        [
            *np.maximum(QUANTILES, 19),
            20 + 3 * (math.exp(-1 / 18) / math.sqrt(2 * math.pi) - below(-1 / 3) / 3),
            0.95,
        ],
    ),
    "skewed": (
        skewed,
        [*(brentq(lambda t, p=p: below_skewed(t) - p, 0, 90) for p in LEVELS), 24.0, below_skewed(LIMIT)],
    ),
    "bent": (bent, [*(10 + 0.03 * QUANTILES**2), 10 + 0.03 * 409, below((math.sqrt((LIMIT - 10) / 0.03) - 20) / 3)]),
}


def estimates(function: Callable[..., np.ndarray], seed: int, count: int = 64) -> list[module.Corrected]:
    rng = np.random.default_rng(seed)
    many, cheap = normals(rng, 4000), normals(rng, count)
    found = ControlVariate(many, cheap, function(cheap, rng))
    return [*(found.quantile(p) for p in LEVELS), found.mean(), found.yield_at(LIMIT)]


@pytest.mark.parametrize("name", KNOWN)
def test_intervals_cover_what_is_known(name: str) -> None:
    """95 % intervals of 20 seeds; fewer than 16 hits have a probability of 0.3 %."""
    function, truth = KNOWN[name]
    found = [estimates(function, seed) for seed in range(20)]
    for ones, true in zip(zip(*found, strict=True), truth, strict=True):
        assert sum(one.low <= true <= one.high for one in ones) >= 16
        # and not by being wide: the estimates lie about the truth
        half = np.mean([(one.high - one.low) / 2 for one in ones])
        assert abs(np.mean([one.value for one in ones]) - true) < 0.5 * half


def test_mean_scatters_as_little_as_the_variance_reduction_says() -> None:
    rng = np.random.default_rng(1)
    plain, corrected, said = [], [], []
    many = normals(rng, 100_000)
    for _ in range(300):
        cheap = normals(rng, 64)
        dear = 2 * cheap + 3 * rng.normal(size=64)  # 6 and 3 sigma: correlation 2 / sqrt 5, so 5 times the units
        found = ControlVariate(many, cheap, dear)
        plain.append(dear.mean())
        corrected.append(found.mean().value)
        said.append(found.variance_reduction)
    assert np.median(said) == pytest.approx(5, rel=0.1)
    assert np.var(plain) / np.var(corrected) == pytest.approx(5, rel=0.35)  # 300 runs: 12 % standard error each


def test_regression_is_that_of_numpy() -> None:
    rng = np.random.default_rng(2)
    cheap = normals(rng, 50)
    found = ControlVariate(normals(rng, 3000), cheap, straight(cheap, rng))
    slope, intercept = np.polyfit(cheap, found.dear, 1)
    assert found.slope == pytest.approx(slope)
    assert found.correlation == pytest.approx(np.corrcoef(cheap, found.dear)[0, 1])
    assert found.mean().value == pytest.approx(intercept + slope * found.many.mean())
    assert found.mean().linear == pytest.approx(found.many.mean())
    left = np.sum((found.dear - intercept - slope * cheap) ** 2) / 48 / found.dear.var(ddof=1)
    assert found.unexplained == pytest.approx(left)


def test_a_straight_line_without_rest_is_carried_over_exactly() -> None:
    rng = np.random.default_rng(3)
    many, cheap = normals(rng, 20_000), normals(rng, 32)
    found = ControlVariate(many, cheap, 1.5 * cheap + 4)
    mean = found.mean()
    assert mean.value == pytest.approx(1.5 * many.mean() + 4)
    assert mean.high - mean.value == pytest.approx(2.042 * 1.5 * many.std() / math.sqrt(20_000), rel=1e-3)  # t of 30
    for level in (0.01, *LEVELS):
        one = found.quantile(level)
        assert one.value == pytest.approx(1.5 * np.quantile(many, level) + 4, abs=0.02)
        # what is left is the scatter of the many: the interval of a share known from 20,000
        spread = 2.2 * math.sqrt(level * (1 - level) / 20_000)
        low, high = np.quantile(many, [max(level - spread, 0), min(level + spread, 1)])
        assert (one.low, one.high) == pytest.approx((1.5 * low + 4, 1.5 * high + 4), abs=0.1)


def test_the_same_quantity_needs_no_correction() -> None:
    rng = np.random.default_rng(4)
    many, cheap = normals(rng, 5000), normals(rng, 16)
    found = ControlVariate(many, cheap, cheap.copy())
    assert found.mean().correction == pytest.approx(0, abs=1e-12)
    assert found.yield_at(23.0).correction == pytest.approx(0, abs=1e-12)
    for level in LEVELS:
        assert found.quantile(level).correction == pytest.approx(0, abs=0.05)  # neighbouring units
    assert found.variance_reduction == pytest.approx(5000 / 16, rel=0.5)  # the many themselves scatter
    assert found.unexplained == pytest.approx(0, abs=1e-12)


def test_a_control_that_knows_nothing_leaves_the_sample() -> None:
    """The interval of a yield is then no narrower than that of the sample's own count."""
    rng = np.random.default_rng(5)
    many, cheap = normals(rng, 5000), normals(rng, 100)
    dear = np.sort(rng.normal(size=100))[rng.permutation(100)]
    dear -= np.polyval(np.polyfit(cheap, dear, 1), cheap)  # exactly uncorrelated
    found = ControlVariate(many, cheap, dear)
    assert found.slope == pytest.approx(0, abs=1e-12)
    share = found.yield_at(0.0)
    assert share.value == pytest.approx((dear <= 0).mean(), abs=0.03)
    assert (share.high - share.low) / 2 > 0.95 * 1.96 * 0.05
    assert found.variance_reduction == pytest.approx(1, abs=0.02)


def test_nothing_is_known_beyond_the_sample() -> None:
    """No unit of the sample exceeds the limit: the interval is that of as many good units as the sample is worth."""
    rng = np.random.default_rng(9)
    many, cheap = normals(rng, 1000), normals(rng, 64)
    found = ControlVariate(many, cheap, straight(cheap, rng))
    share = found.yield_at(1000.0)
    worth = 1 / (found.unexplained / 64 + 1 / 1000)
    assert 64 < worth < 150
    assert (share.value, share.high) == pytest.approx((1, 1))
    assert share.low == pytest.approx(0.025 ** (1 / worth), rel=1e-6)  # Clopper and Pearson
    assert found.yield_at(-1000.0).high == pytest.approx(1 - share.low, rel=1e-6)


def test_what_falls_as_the_control_grows_is_not_turned_round() -> None:
    rng = np.random.default_rng(6)
    cheap = normals(rng, 64)
    found = ControlVariate(normals(rng, 5000), cheap, -cheap)
    assert found.slope == 0
    assert found.correlation == pytest.approx(-1)
    assert found.quantile(0.5).value == pytest.approx(np.median(-cheap), abs=1.0)


@pytest.mark.parametrize("seed", range(4))
def test_quantiles_are_monotone_and_yields_their_inverse(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cheap = normals(rng, 24)
    found = ControlVariate(normals(rng, 500), cheap, straight(cheap, rng) * rng.lognormal(0, 1, 24))
    levels = np.linspace(0.005, 0.995, 21)
    ones = [found.quantile(p) for p in levels]
    assert (np.diff([one.value for one in ones]) >= 0).all()
    assert all(one.low <= one.value <= one.high for one in ones)
    far = np.ptp(found.dear)
    sizes = np.linspace(found.dear.min() - 9 * far, found.dear.max() + 9 * far, 49)
    shares = [found.yield_at(size) for size in sizes]
    assert (np.diff([share.value for share in shares]) >= 0).all()
    assert (shares[0].value, shares[-1].value) == pytest.approx((0, 1), abs=1e-12)
    assert all(0 <= share.low <= share.value + 1e-12 and share.value - 1e-12 <= share.high <= 1 for share in shares)
    for level, one in zip(levels, ones, strict=True):
        step = 1e-9 * far
        assert found.yield_at(one.value - step).value <= level <= found.yield_at(one.value + step).value


def test_wider_with_more_confidence() -> None:
    rng = np.random.default_rng(7)
    cheap = normals(rng, 64)
    found = ControlVariate(normals(rng, 500), cheap, straight(cheap, rng))
    questions: list[Callable[[float], module.Corrected]] = [
        lambda c: found.mean(confidence=c),
        lambda c: found.quantile(0.95, confidence=c),
        lambda c: found.yield_at(35.0, confidence=c),
    ]
    for ask in questions:
        usual, sure = ask(0.95), ask(0.999)
        assert sure.low < usual.low < usual.value == sure.value < usual.high < sure.high


def test_quantities_that_do_not_vary() -> None:
    rng = np.random.default_rng(8)
    cheap, same = normals(rng, 20), np.full(20, 7.0)
    still = ControlVariate(normals(rng, 100), cheap, same)
    assert (still.mean().value, still.quantile(0.99).value) == pytest.approx((7, 7))
    assert math.isnan(still.correlation)
    assert math.isnan(still.variance_reduction)
    assert still.unexplained == 0
    unmoved = ControlVariate(np.full(100, 7.0), same, cheap)
    assert unmoved.mean().value == pytest.approx(cheap.mean())
    # the sample alone, its variance by the degrees of freedom
    spread = np.var([unmoved.quantile(p).value for p in (np.arange(20) + 0.5) / 20])
    assert spread == pytest.approx(cheap.var(ddof=1), rel=1e-6)
    assert np.sort(cheap)[8] < unmoved.quantile(0.5).value < np.sort(cheap)[11]
    assert math.isnan(ControlVariate(np.zeros(9), np.zeros(20), np.zeros(20)).mean().relative)


@pytest.mark.parametrize(
    ("many", "cheap", "dear", "message"),
    [
        (np.ones(9), np.ones(15), np.ones(15), "15 units are too few"),
        (np.ones(9), np.ones(16), np.ones(17), "one number of each"),
        (np.ones(9), np.ones(16), np.full(16, np.nan), "not finite"),
        (np.ones(0), np.ones(16), np.ones(16), "no linear units"),
    ],
)
def test_samples_are_checked(many: np.ndarray, cheap: np.ndarray, dear: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message):
        ControlVariate(many, cheap, dear)


@pytest.mark.parametrize("probability", [0.0, 1.0, -1.0, math.nan])
def test_probabilities_are_checked(probability: float) -> None:
    found = ControlVariate(np.ones(9), np.ones(16), np.ones(16))
    with pytest.raises(InputError, match=r"probability = .* between 0 and 1"):
        found.quantile(probability)
    asked: list[Callable[[float], Any]] = [
        lambda c: found.mean(confidence=c),
        lambda c: found.quantile(0.5, confidence=c),
        lambda c: found.yield_at(1.0, confidence=c),
    ]
    for ask in asked:
        with pytest.raises(InputError, match=r"confidence = .* between 0 and 1"):
            ask(probability)


# --- the equilibrium --------------------------------------------------------------------------------------------------

#: Vectors, scalars, all pins and each, a mean, a clearance, a batch, one entry beside another of the same source.
TOLERANCES = [
    tolerance("crank.eccentricity", "5 um"),
    tolerance("crank.eccentricity", "3 um", parameters=["radial"], disc=0, distribution="uniform"),
    tolerance("cycloid.pin_position", "6 um", correlation=0.3),
    tolerance("cycloid.pin_radius", "2 um", mean="-2 um", pin="all"),
    tolerance("cycloid.disc_pitch", "4 um", harmonic=(1, 2), mean={"sin": "3 um"}),
    tolerance("crank.bearing_clearance", "2 um", mean="5 um"),
    tolerance("sensor.encoder_eccentricity", "4 arcsec"),
]
UNIT = rverror.Model(
    rverror.reducer("RV-40E"),
    (
        rverror.effect("cycloid.disc_bore_position", disc=1, crank=0, radial="4 um"),
        rverror.effect("sensor.encoder_ellipticity", cos="3 arcsec"),
        rverror.effect("sensor.index_offset", offset="2 deg"),
        rverror.effect("load.torsion", compliance="1 arcsec/(N*m)"),
    ),
)


def drawn(
    tolerances: list[rverror.tolerances.stacking.Tolerance], linear: Any, uniform: np.ndarray
) -> list[rverror.Model]:
    """Models of the drawn units by the words that people use: one effect for each component."""
    found = []
    for row in linear.standard(uniform):
        effects = []
        for s, component, e in zip(row, linear.components, linear.entry, strict=True):
            mean = tolerances[e].mean.get(component.parameter, 0.0)
            value = {component.parameter: mean + linear.width[e] * s}
            effects.append(rverror.effect(component.key, **component.indices, **value))
        found.append(UNIT.with_effects(*effects))
    return found


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_units_are_those_that_are_drawn(direction: float) -> None:
    """Against the equilibrium of each unit, made effect by effect; the linear sample against the closed form."""
    theta = direction * ANGLES
    linear = stack(UNIT, TOLERANCES, theta, direction=direction, torque="20 N*m")
    found = contact_correction(
        UNIT, TOLERANCES, linear, virtual_units(linear, 64), torque="20 N*m", direction=direction, count=16, seed=3
    )
    assert found.points == 128
    rows = np.concatenate(list(uniforms(16, linear.dimensions, seed=3, index=module.SAMPLE_CHUNK, draws="random")))
    lags = []
    for i, unit in enumerate(drawn(TOLERANCES, linear, rows)):
        closed = rverror.transmission_error(unit, theta, direction=direction, torque="20 N*m")
        loaded = rverror.equilibrium(unit, theta, torque="20 N*m", direction=direction).transmission_error
        lags.append(loaded.mean() - closed.mean())
        for row, sample in ((closed, "cheap"), (loaded, "dear")):
            away = row - row.mean()
            assert getattr(found.peak_to_peak, sample)[i] == pytest.approx(np.ptp(row), rel=1e-6)
            assert getattr(found.max, sample)[i] == pytest.approx(np.abs(away).max(), rel=1e-6)
            assert getattr(found.rms, sample)[i] == pytest.approx(away.std(), rel=1e-6)
    assert found.lag == pytest.approx(np.mean(lags), rel=1e-6)


def few(reducer: rverror.Reducer | None = None, *tolerances: rverror.tolerances.stacking.Tolerance) -> Any:
    """A model, its tolerances and their stack at 128 angles."""
    unit = rverror.Model(reducer or rverror.reducer("RV-40E"))
    chosen = list(tolerances) or [
        tolerance("cycloid.pin_position", "8 um"),
        tolerance("cycloid.disc_pitch", "5 um", harmonic=1),
    ]
    return unit, chosen, stack(unit, chosen, ANGLES)


def test_interval_holds_what_all_units_give() -> None:
    """Brute force: the equilibrium of each of the units that were computed linearly."""
    unit, tolerances, linear = few()
    units = virtual_units(linear, 128, draws="random", seed=5)
    chunks = range(128 // units.chunk)
    rows = [next(uniforms(units.chunk, linear.dimensions, seed=5, index=i, draws="random")) for i in chunks]
    values = linear.standard(np.concatenate(rows)) * linear.width[linear.entry]
    solve = Predictor(unit.mechanism, rverror.statics.prediction.Conditions(ANGLES, 1.0, 10e3))
    all_of_them = []
    for row in values:
        pins = [
            rverror.effect("cycloid.pin_position", pin=p, radial=row[2 * p], tangential=row[2 * p + 1])
            for p in range(40)
        ]
        discs = [
            rverror.effect("cycloid.disc_pitch", disc=d, harmonic=1, cos=row[80 + 2 * d], sin=row[81 + 2 * d])
            for d in range(2)
        ]
        all_of_them.append(np.ptp(solve.predict(unit.with_effects(*pins, *discs)).transmission_error))
    truth = np.array(all_of_them)
    assert truth.mean() < 0.9 * units.peak_to_peak.mean()  # pins with large errors lift off
    for seed in range(2):
        found = contact_correction(unit, tolerances, linear, units, torque="10 N*m", count=40, seed=seed).peak_to_peak
        mean = found.mean(confidence=0.99)
        assert mean.low <= truth.mean() <= mean.high
        assert (mean.high - mean.low) / 2 < 0.5 * abs(mean.correction)  # and says something
        for level in LEVELS:
            one = found.quantile(level, confidence=0.99)
            assert one.low <= np.quantile(truth, level) <= one.high
        limit = float(np.quantile(truth, 0.8))
        share = found.yield_at(limit, confidence=0.99)
        assert share.low <= 0.8 <= share.high


def test_heavily_loaded_stiff_units_need_no_correction() -> None:
    """The limit of the closed form: rigid bearings and no pin that opens; what is left is the load's own ripple."""
    rigid = Stiffness(crank_bearing=2e9, carrier_bearing=2e12, gear_mesh=2e8, sun_support=1e3, main_bearing=2e12)
    unit, tolerances, linear = few(
        rverror.reducer("RV-40E", stiffness=rigid),
        tolerance("cycloid.pin_position", "1 um", parameters=["tangential"]),
        tolerance("cycloid.disc_pitch", "5 um", harmonic=1),
    )
    units = virtual_units(linear, 256)
    found = contact_correction(unit, tolerances, linear, units, torque="2000 N*m", count=16)
    ripple = np.ptp(rverror.equilibrium(unit, ANGLES, torque="2000 N*m", direction=1).transmission_error)
    assert ripple < 0.02 * units.peak_to_peak.mean()
    for size in ("peak_to_peak", "max", "rms"):
        one: ControlVariate = getattr(found, size)
        assert (np.abs(one.dear - one.cheap) <= ripple + 1e-3 * one.cheap).all()
        for estimate in (one.mean(), *(one.quantile(level) for level in LEVELS)):
            assert estimate.low - ripple <= estimate.linear <= estimate.high + ripple
        assert abs(one.mean().correction) < 1.1 * ripple
    light = contact_correction(unit, tolerances, linear, units, torque="10 N*m", count=16)
    assert light.peak_to_peak.mean().relative < -0.1


def test_windup_of_perfect_units_is_a_lag_and_the_ripple_of_the_mesh() -> None:
    unit, tolerances, linear = few(None, tolerance("crank.eccentricity", "1e-6 um"))
    units = virtual_units(linear, 64)
    found = contact_correction(unit, tolerances, linear, units, torque="412 N*m", count=16)
    windup = rverror.equilibrium(unit, ANGLES, torque="412 N*m").transmission_error
    assert found.lag == pytest.approx(windup.mean(), rel=1e-6)
    assert found.lag < -100 * ARCSEC
    np.testing.assert_allclose(found.peak_to_peak.dear, np.ptp(windup), rtol=1e-3)
    assert np.ptp(windup) < 0.03 * ARCSEC


def test_left_out_angles_come_from_the_fourier_series() -> None:
    """Order 2 of the encoder is there at any angles; order 40 of the cams needs more than 80.

    What the mesh of a perfect unit ripples folds onto them, at few angles otherwise than at many.
    """
    cams = [tolerance("crank.eccentricity", "5 um"), tolerance("sensor.encoder_ellipticity", "5 arcsec")]
    unit = rverror.Model(rverror.reducer("RV-40E"))
    linear = stack(unit, cams, 2 * np.pi * np.arange(512) / 512)
    units = virtual_units(linear, 64)
    every, fourth = (
        contact_correction(unit, cams, linear, units, torque="4120 N*m", count=16, points=points)
        for points in (512, 100)
    )
    assert (every.points, fourth.points) == (512, 128)
    ripple = np.ptp(rverror.equilibrium(unit, ANGLES, torque="4120 N*m").transmission_error)
    assert ripple < 0.02 * every.peak_to_peak.dear.mean()
    np.testing.assert_allclose(fourth.peak_to_peak.dear, every.peak_to_peak.dear, rtol=0, atol=ripple)
    assert every.thinning_most < ripple


def test_thinning_tells_what_the_number_of_angles_does() -> None:
    unit, tolerances, linear = few()
    found = contact_correction(
        unit, tolerances, linear, virtual_units(linear, 64), torque="10 N*m", count=16, points=64
    )
    every = contact_correction(unit, tolerances, linear, virtual_units(linear, 64), torque="10 N*m", count=16)
    assert (found.points, every.points) == (64, 128)
    change = found.peak_to_peak.dear - every.peak_to_peak.dear
    assert every.thinning == pytest.approx(change.mean(), abs=1e-6 * ARCSEC)
    assert every.thinning_most == pytest.approx(np.abs(change).max(), abs=1e-6 * ARCSEC)


@pytest.mark.parametrize(
    "theta",
    [ANGLES + 0.01 * np.sin(np.pi * np.arange(128) / 127), 1.5 * ANGLES, 2 * np.pi * np.arange(127) / 127],
    ids=["uneven", "a turn and a half", "odd number"],
)
def test_angles_that_cannot_be_thinned_are_all_solved(theta: np.ndarray) -> None:
    unit = rverror.Model(rverror.reducer("RV-40E"))
    pins = [tolerance("cycloid.pin_position", "8 um")]
    linear = stack(unit, pins, theta)
    found = contact_correction(
        unit, pins, linear, virtual_units(linear, 64), torque="412 N*m", count=16, points=64, seed=1
    )
    assert found.points == theta.size
    rows = next(uniforms(1, linear.dimensions, seed=1, index=module.SAMPLE_CHUNK, draws="random"))
    values = (linear.standard(rows) * linear.width[0])[0].reshape(40, 2)
    one = unit.with_effects(
        *(rverror.effect("cycloid.pin_position", pin=p, radial=x, tangential=y) for p, (x, y) in enumerate(values))
    )
    loaded = rverror.equilibrium(one, theta, torque="412 N*m", direction=1.0).transmission_error
    assert found.peak_to_peak.dear[0] == pytest.approx(np.ptp(loaded), rel=1e-6)
    assert found.thinning <= 0


@pytest.mark.parametrize("points", [8, 9])
def test_fourier_series_goes_through_all_that_was_solved(points: int) -> None:
    """Any row keeps its values; up to the highest order that the points hold, it is the row itself."""
    rng = np.random.default_rng(points)
    row = rng.normal(size=points)
    np.testing.assert_allclose(module.between(row, 4 * points)[::4], row, atol=1e-12)
    few, many = (2 * np.pi * np.arange(n) / n for n in (points, 5 * points))
    np.testing.assert_allclose(module.between(np.cos(3 * few + 1), 5 * points), np.cos(3 * many + 1), atol=1e-12)


@pytest.fixture(scope="module")
def alone() -> tuple[Any, VirtualUnits, ContactCorrection]:
    case = few()
    units = virtual_units(case[2], 64)
    return case, units, contact_correction(*case, units, torque="10 N*m", count=18)


def same(one: ContactCorrection, other: ContactCorrection) -> None:
    for size in ("peak_to_peak", "max", "rms"):
        for sample in ("many", "cheap", "dear"):
            np.testing.assert_array_equal(getattr(getattr(one, size), sample), getattr(getattr(other, size), sample))
    assert (one.lag, one.thinning, one.failures) == (other.lag, other.thinning, other.failures)


def test_numbers_do_not_depend_on_the_workers(alone: tuple[Any, VirtualUnits, ContactCorrection]) -> None:
    case, units, found = alone
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as pool:
        same(found, contact_correction(*case, units, torque="10 N*m", count=18, executor=pool))
    with ThreadPoolExecutor(3) as threads:
        same(found, contact_correction(*case, units, torque="10 N*m", count=18, executor=threads))


def test_more_units_begin_with_the_same(alone: tuple[Any, VirtualUnits, ContactCorrection]) -> None:
    case, units, found = alone
    more = contact_correction(*case, units, torque="10 N*m", count=21)
    np.testing.assert_array_equal(more.peak_to_peak.dear[:18], found.peak_to_peak.dear)
    other = contact_correction(*case, units, torque="10 N*m", count=18, seed=1)
    assert not np.isin(other.peak_to_peak.dear, found.peak_to_peak.dear).any()


def test_units_without_equilibrium_are_counted(
    alone: tuple[Any, VirtualUnits, ContactCorrection], monkeypatch: pytest.MonkeyPatch
) -> None:
    case, units, found = alone
    solved, calls = Predictor.predict, []

    def fails_sometimes(self: Predictor, model: rverror.Model, near: Any = None) -> Any:
        calls.append(model)
        if len(calls) - 1 in failing:
            raise NotConvergedError("no equilibrium after 40 steps")
        return solved(self, model, near)

    monkeypatch.setattr(Predictor, "predict", fails_sometimes)
    failing = {3, 10}
    partly = contact_correction(*case, units, torque="10 N*m", count=18)
    assert partly.failures == tuple(f"unit {i}: no equilibrium after 40 steps" for i in (3, 10))
    assert partly.count == 18
    left = np.delete(np.arange(18), [3, 10])
    np.testing.assert_array_equal(partly.peak_to_peak.dear, found.peak_to_peak.dear[left])
    np.testing.assert_array_equal(partly.rms.cheap, found.rms.cheap[left])
    text = rverror.to_text(partly)
    assert "16 of 18 units" in text
    assert "2 of 18 units have no equilibrium" in text
    assert "unit 10: no equilibrium" in text
    assert rverror.to_json(partly)["failed"] == 2
    calls.clear()
    failing = {0, 1, 2}
    with pytest.raises(InputError, match=r"only 15 of 18 units have an equilibrium.*unit 0: no equilibrium"):
        contact_correction(*case, units, torque="10 N*m", count=18)


def test_text_and_json_say_the_same(alone: tuple[Any, VirtualUnits, ContactCorrection]) -> None:
    _, _, found = alone
    limit = 10 * ARCSEC
    text, data = rverror.to_text(found, limit=limit), json.loads(json.dumps(rverror.to_json(found, limit=limit)))
    mean = found.peak_to_peak.mean()
    assert f"{mean.value / ARCSEC:.4g} [{mean.low / ARCSEC:.4g}, {mean.high / ARCSEC:.4g}]" in text
    assert f"({100 * mean.relative:+.3g} %)" in text
    told = data["peak_to_peak_arcsec"]["mean"]
    assert told["correction"] == pytest.approx((mean.value - found.peak_to_peak.many.mean()) / ARCSEC)
    assert data["max_arcsec"]["p95"]["value"] == pytest.approx(found.max.quantile(0.95).value / ARCSEC)
    assert data["yield"]["value"] == found.peak_to_peak.yield_at(limit).value
    assert "Yield at 10 arcsec" in text
    assert "Yield" not in rverror.to_text(found)
    assert rverror.to_json(found)["yield"] is None
    assert (data["units"], data["failed"], data["angles"], data["torque_nm"]) == (18, 0, 128, 10.0)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"torque": 0}, "torque = 0 N.m: must be above 0"),
        ({"torque": "-3 N*m"}, "must be above 0"),
        ({"count": 15}, "count = 15.*16 or more"),
        ({"points": 10}, "points = 10.*64 or more"),
        ({"seed": -1}, "seed = -1"),
    ],
)
def test_settings_are_checked(
    alone: tuple[Any, VirtualUnits, ContactCorrection], change: dict[str, Any], message: str
) -> None:
    case, units, _ = alone
    with pytest.raises(InputError, match=message):
        contact_correction(*case, units, **({"torque": "10 N*m"} | change))


def test_what_does_not_go_together_is_refused(alone: tuple[Any, VirtualUnits, ContactCorrection]) -> None:
    (unit, tolerances, linear), units, _ = alone
    with pytest.raises(InputError, match="1 tolerances for a stack of 2"):
        contact_correction(unit, tolerances[:1], linear, units, torque="10 N*m")
    with pytest.raises(InputError, match="no angles"):
        contact_correction(unit, tolerances, replace(linear, theta=None), units, torque="10 N*m")
    drive = rverror.Model(rverror.Drive(ratio=10.0, shafts={"motor": 10.0}))
    with pytest.raises(InputError, match=r"\[drive\] has no contacts"):
        contact_correction(drive, tolerances, linear, units, torque="10 N*m")
