"""The joint fit against data of known sizes and known noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

import rverror
from rverror.fit import FitRun, coarse, covariance_of, fit_run, joint_fit, priors, with_values
from rverror.model import Effect, Model, effect
from rverror.prediction import Conditions, Predictor, predict
from rverror.spectrum import amplitude, harmonics

ARCSEC = math.pi / 180 / 3600
UNIT = rverror.reducer("RV-40E")
POINTS = 255  # odd, so that there is no Nyquist line: harmonics hold all but the mean


def turn(points: int = POINTS) -> np.ndarray:
    return 0.1 + 2 * np.pi * np.arange(points) / points


def run_of(
    effects: Sequence[Effect],
    rng: np.random.Generator,
    *,
    noise: float,
    direction: float = 1.0,
    periods: int = 4,
    offset: float = 0.0,
    declared_noise: bool = False,
    points: int = POINTS,
) -> FitRun:
    """A closed-form run with white noise; its noise taken from the periods, or given as it is."""
    theta = turn(points)
    truth = rverror.transmission_error(Model(UNIT, tuple(effects)), theta, direction=direction)
    values = offset + truth + noise * rng.normal(size=(periods, points))
    conditions = Conditions(theta, direction)
    if declared_noise:
        return FitRun("run", Predictor(UNIT, conditions), values, np.full((points - 1) // 2, noise**2))
    return fit_run("run", Predictor(UNIT, conditions), values)


def values_of(effects: Sequence[Effect]) -> np.ndarray:
    return np.array([v for e in effects for v in e.values])


TRUTH = (
    effect("crank.eccentricity", crank=0, disc=0, radial="6 um", tangential="-4 um"),
    effect("cycloid.pin_circle", harmonic=2, radial_cos="5 um", radial_sin="2 um", tangential_cos="-3 um"),
    effect("sensor.encoder_eccentricity", cos="5 arcsec", sin="-8 arcsec"),
)
NOTHING = with_values(TRUTH, np.zeros(8))


# --- known sizes come back ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("declared_noise", [True, False], ids=["known noise", "noise from the periods"])
def test_pulls_are_standard_normal(declared_noise: bool) -> None:
    """Forty runs forward and back: (fitted - true) / sigma has mean 0 and deviation 1; 95 % intervals hold 95 %."""
    rng = np.random.default_rng(20)
    truth, pulls, surplus = values_of(TRUTH), [], []
    for _ in range(40):
        runs = [
            run_of(TRUTH, rng, noise=2 * ARCSEC, direction=way, offset=rng.normal(), declared_noise=declared_noise)
            for way in (1.0, -1.0)
        ]
        fit = joint_fit(Model(UNIT), NOTHING, runs)
        assert fit.converged
        assert fit.free.all()
        root = np.linalg.cholesky(fit.covariance)
        pulls.append(np.linalg.solve(root, values_of(fit.model.effects) - truth))  # independent, as sigmas are not
        single = (values_of(fit.model.effects) - truth) / np.sqrt(np.diag(fit.covariance))
        surplus.append(abs(single) > 1.96)
    found = np.array(pulls)
    count = found.size
    # the spectrum's own error widens pulls a little: 3 x 9 degrees of freedom and more behind each harmonic's noise
    assert abs(found.mean()) < 4 / math.sqrt(count)
    assert found.std() == pytest.approx(1.0 if declared_noise else 1.01, abs=4 / math.sqrt(2 * count))
    # columns of one repeat are correlated: count the repeats, not the columns, for the error of the coverage
    assert np.mean(surplus) == pytest.approx(0.05, abs=4 * math.sqrt(0.05 * 0.95 / 40 / 3))


def test_chi_square_counts_the_degrees_of_freedom() -> None:
    rng = np.random.default_rng(3)
    found = []
    for _ in range(20):
        runs = [run_of(TRUTH, rng, noise=ARCSEC, direction=way, declared_noise=True) for way in (1.0, -1.0)]
        fit = joint_fit(Model(UNIT), NOTHING, runs)
        found.append(fit.objective)
        assert fit.prospect.objective == pytest.approx(fit.objective, rel=1e-6)
    degrees = 2 * (POINTS - 1) - len(values_of(TRUTH))
    assert np.mean(found) == pytest.approx(degrees, abs=4 * math.sqrt(2 * degrees / 20))


def test_more_periods_and_less_noise_narrow_the_result() -> None:
    rng = np.random.default_rng(5)
    few, many, quiet = (
        joint_fit(Model(UNIT), NOTHING, [run_of(TRUTH, rng, noise=n, periods=p, declared_noise=True)]).covariance
        for n, p in ((ARCSEC, 2), (ARCSEC, 8), (ARCSEC / 3, 2))
    )
    np.testing.assert_allclose(many, few / 4, rtol=1e-6, atol=1e-9 * few.max())
    np.testing.assert_allclose(quiet, few / 9, rtol=1e-6, atol=1e-9 * few.max())


def test_noise_of_one_order_costs_only_what_shows_there() -> None:
    """An encoder's order 1 buried in noise: its sigma grows as the noise does, that of order 40 stays."""
    rng = np.random.default_rng(6)
    clean = run_of(TRUTH, rng, noise=ARCSEC, declared_noise=True)
    noise = clean.noise.copy()
    noise[0] *= 100
    before, after = (
        np.sqrt(np.diag(joint_fit(Model(UNIT), NOTHING, [r]).covariance)) for r in (clean, replace(clean, noise=noise))
    )
    np.testing.assert_allclose(after[6:], 10 * before[6:], rtol=1e-3)
    np.testing.assert_allclose(after[:6], before[:6], rtol=1e-3)


def test_the_offset_of_each_run_drops_out() -> None:
    runs = [
        [run_of(TRUTH, np.random.default_rng(7), noise=ARCSEC, offset=o, direction=w) for o, w in pairs]
        for pairs in (((0, 1.0), (0, -1.0)), ((0.3, 1.0), (-2, -1.0)))
    ]
    plain, lifted = (values_of(joint_fit(Model(UNIT), NOTHING, r).model.effects) for r in runs)
    np.testing.assert_allclose(lifted, plain, rtol=0, atol=1e-6 * abs(plain).max())


# --- declared sizes -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sigma_um", [0.3, 3.0, 300.0])
@pytest.mark.parametrize("noise_arcsec", [0.5, 5.0])
def test_a_declared_uncertainty_is_a_prior(sigma_um: float, noise_arcsec: float) -> None:
    """One parameter: the fit is the mean of the declared and the measured size, weighted by their precisions."""
    declared, sigma, noise, periods = 3e-3, sigma_um * 1e-3, noise_arcsec * ARCSEC, 3
    pin = effect("cycloid.pin_radius", pin=4, deviation=declared, uncertainty=sigma)
    run = run_of(
        [replace(pin, values=(5e-3,))],
        np.random.default_rng(8),
        noise=noise,
        periods=periods,
        declared_noise=True,
    )
    shape = rverror.influence(UNIT, run.conditions.theta, "cycloid.pin_radius", direction=1, pin=4).matrix[0]
    shape = shape - shape.mean()
    measured = run.values.mean(axis=0) @ shape / (shape @ shape)
    precision = periods * (shape @ shape) / noise**2
    expected = (measured * precision + declared / sigma**2) / (precision + 1 / sigma**2)

    fit = joint_fit(Model(UNIT, (pin,)), (), [run])
    spread = 1 / math.sqrt(precision + 1 / sigma**2)
    # a step that gains less than 0.02 of the sum of squares, a seventh of a standard deviation, is not taken
    left = 1e-4 if abs(expected - declared) > 0.15 * spread else 0.15
    assert fit.model.effects[0].values[0] == pytest.approx(expected, abs=left * spread)
    assert fit.covariance == pytest.approx(np.array([[spread**2]]), rel=1e-6)
    residual = run.values.mean(axis=0) - expected * shape
    residual -= residual.mean()
    chi2 = periods * (residual @ residual) / noise**2 + ((expected - declared) / sigma) ** 2
    assert fit.objective == pytest.approx(chi2, rel=1e-6, abs=0.02)


def test_the_prior_stays_where_it_was_declared_whatever_the_start() -> None:
    pin = effect("cycloid.pin_radius", pin=4, deviation="3 um", uncertainty="1 um")
    run = run_of([replace(pin, values=(5e-3,))], np.random.default_rng(9), noise=ARCSEC)
    plain = joint_fit(Model(UNIT, (pin,)), (), [run])
    other = joint_fit(Model(UNIT, (pin,)), (), [run], start=np.array([0.011]))
    sigma = math.sqrt(plain.covariance[0, 0])
    assert other.model.effects[0].values[0] == pytest.approx(plain.model.effects[0].values[0], abs=0.02 * sigma)
    assert other.objective == pytest.approx(plain.objective, abs=0.02)


def test_what_is_declared_exact_is_not_varied() -> None:
    exact, vague = TRUTH[0], replace(TRUTH[1], uncertainty=1e-3)
    wrong = replace(exact, values=(0.0, 0.0))
    run = run_of(TRUTH, np.random.default_rng(10), noise=ARCSEC)
    fit = joint_fit(Model(UNIT, (wrong, vague)), (NOTHING[2],), [run])
    assert fit.model.effects[0].values == (0.0, 0.0)
    np.testing.assert_array_equal(fit.free, [False] * 2 + [True] * 6)
    assert (fit.covariance[:2] == 0).all()
    assert (fit.covariance[:, :2] == 0).all()
    assert (np.diag(fit.covariance)[2:] > 0).all()
    np.testing.assert_array_equal(priors((wrong, vague), (NOTHING[2],)), [0, 0, *[1e-3] * 4, np.inf, np.inf])


def test_a_model_without_free_sizes_is_only_compared() -> None:
    run = run_of(TRUTH, np.random.default_rng(11), noise=ARCSEC, declared_noise=True)
    fit = joint_fit(Model(UNIT, TRUTH), (), [run])
    assert fit.converged
    assert fit.model.effects == TRUTH
    assert not fit.free.any()
    assert (fit.covariance == 0).all()
    assert fit.objective == pytest.approx(fit.prospect.objective)
    assert fit.objective == pytest.approx(POINTS - 1, abs=4 * math.sqrt(2 * (POINTS - 1)))


def test_only_the_last_added_effect_varies_on_request() -> None:
    vague = replace(TRUTH[0], values=(2e-3, 0.0), uncertainty=2e-3)
    run = run_of(TRUTH, np.random.default_rng(12), noise=ARCSEC, declared_noise=True)
    start = np.array([2e-3, 0.0, *TRUTH[1].values, 0.0, 0.0])
    alone = joint_fit(Model(UNIT, (vague,)), NOTHING[1:], [run], start=start, vary_last=1)
    np.testing.assert_array_equal(values_of(alone.model.effects)[:6], start[:6])
    np.testing.assert_allclose(alone.model.effects[2].values, TRUTH[2].values, rtol=0.1)
    # the prospect is that of all free sizes, which a joint fit then reaches
    both = joint_fit(Model(UNIT, (vague,)), NOTHING[1:], [run], start=values_of(alone.model.effects))
    assert alone.free.all()
    assert alone.objective > both.objective + 10
    assert alone.prospect.objective == pytest.approx(both.objective, abs=0.05)


@pytest.mark.parametrize("extra", [(), (NOTHING[0],)], ids=["alone", "beside another"])
def test_what_the_runs_do_not_determine_has_infinite_variance(extra: tuple[Effect, ...]) -> None:
    """A carrier bore only shifts the output, and the offset of a run is free."""
    bore = effect("coupling.carrier_bore_position", crank=0, radial=0.0, tangential="4 um")
    run = run_of(TRUTH, np.random.default_rng(13), noise=ARCSEC)
    fit = joint_fit(Model(UNIT), (*extra, bore), [run])
    assert np.isinf(np.diag(fit.covariance)[-2:]).all()
    assert np.isfinite(np.diag(fit.covariance)[:-2]).all()
    assert np.isfinite(values_of(fit.model.effects)).all()
    assert fit.model.effects[-1].values[1] == pytest.approx(4e-3, rel=1e-6)


def test_covariance_is_the_inverse_of_the_information() -> None:
    rng = np.random.default_rng(14)
    matrix = rng.normal(size=(50, 4)) * [1e5, 10, 1e8, 3e6]
    found = covariance_of(matrix)
    np.testing.assert_allclose(found @ (matrix.T @ matrix), np.eye(4), rtol=0, atol=1e-4)
    assert np.isinf(covariance_of(np.zeros((9, 2)))).diagonal().all()


def test_steps_are_no_longer_than_a_workshop_would_allow() -> None:
    """Half the plausible 30 um each: a size of 60 um needs at least four steps."""
    far = effect("crank.eccentricity", crank=0, disc=0, radial="60 um")
    run = run_of([far], np.random.default_rng(15), noise=ARCSEC)
    near = replace(far, values=(0.0, 0.0))
    cut = joint_fit(Model(UNIT), (near,), [run], most_steps=2)
    assert not cut.converged
    assert cut.model.effects[0].values[0] == pytest.approx(0.030, rel=1e-6)
    fit = joint_fit(Model(UNIT), (near,), [run])
    assert fit.converged
    assert fit.model.effects[0].values[0] == pytest.approx(0.060, rel=0.02)


# --- runs ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("periods", [1, 3])
def test_whitened_noise_has_unit_variance(periods: int) -> None:
    run = run_of((), np.random.default_rng(16), noise=0.7, periods=400, declared_noise=True)
    groups = run.values[: 400 // periods * periods].reshape(-1, periods, POINTS).mean(axis=1)
    white = run.whiten(groups, periods)
    assert white.shape == (len(groups), POINTS - 1)
    assert white.var() == pytest.approx(1, abs=4 * math.sqrt(2 / white.size))


@pytest.mark.parametrize(("n", "points"), [(1024, 256), (1024, 300), (1000, 200), (990, 110), (4096, 512)])
def test_fewer_angles_keep_the_low_harmonics(n: int, points: int) -> None:
    rng = np.random.default_rng(17)
    theta = 2 * np.pi * np.arange(n) / n
    values = rng.normal(size=(3, n))
    run = fit_run("run", Predictor(UNIT, Conditions(theta, 1.0)), values)
    small = coarse(run, points)
    stride = n // points
    if n % stride:
        assert small is run
        return
    kept = n // stride
    m = (kept - 1) // 2
    assert small.values.shape == (3, kept)
    np.testing.assert_allclose(small.conditions.theta, theta[::stride])
    before, after = harmonics(run.values)[..., :m], harmonics(small.values)
    np.testing.assert_allclose(amplitude(after, kept), amplitude(before, n), rtol=1e-9)
    np.testing.assert_allclose(small.values.mean(axis=1), values.mean(axis=1), rtol=0, atol=1e-12)
    # in units of their noise, which is what a fit sees, they are the same
    np.testing.assert_allclose(after / np.sqrt(small.noise), before / np.sqrt(run.noise[:m]), rtol=1e-9)


def test_a_run_with_few_angles_is_left_alone() -> None:
    run = run_of(TRUTH, np.random.default_rng(18), noise=ARCSEC)
    assert coarse(run, POINTS) is run
    assert coarse(run, 10 * POINTS) is run


def test_fewer_angles_keep_the_times_beside_the_angles() -> None:
    n = 1024
    theta = 2 * np.pi * np.arange(n) / n
    delay = effect("sensor.time_offset", offset="5 ms")
    run = fit_run(
        "run", Predictor(UNIT, Conditions(theta, 1.0, time=40 * theta)), np.random.default_rng(19).normal(size=(2, n))
    )
    small = coarse(run, 256).conditions
    assert small.time is not None
    np.testing.assert_allclose(small.time, 40 * small.theta)
    assert predict(Model(UNIT, (delay,)), small).transmission_error.shape == (256,)


def test_a_fit_on_fewer_angles_is_the_same_fit() -> None:
    """Where all lies below order 128, as an encoder's and a cam's errors do, nothing is lost on 256 of 1024 angles."""
    some = TRUTH[0], TRUTH[2]
    run = run_of(some, np.random.default_rng(21), noise=ARCSEC, points=1024, declared_noise=True)
    fine, small = (joint_fit(Model(UNIT), with_values(some, np.zeros(4)), [r]) for r in (run, coarse(run, 256)))
    sigma = np.sqrt(np.diag(fine.covariance))
    change = (values_of(small.model.effects) - values_of(fine.model.effects)) / sigma
    assert abs(change).max() < 0.05
    np.testing.assert_allclose(np.sqrt(np.diag(small.covariance)), sigma, rtol=1e-3)


@pytest.mark.parametrize("points", [POINTS, 256])
def test_runs_without_noise(points: int) -> None:
    """As simulated runs are: no spread between the periods, and nothing to divide by."""
    rng = np.random.default_rng(22)
    runs = [run_of(TRUTH, rng, noise=0.0, direction=way, points=points, offset=0.1) for way in (1.0, -1.0)]
    assert all((run.noise > 0).all() for run in runs)
    fit = joint_fit(Model(UNIT), NOTHING, runs)
    np.testing.assert_allclose(values_of(fit.model.effects), values_of(TRUTH), rtol=0, atol=1e-9)
    assert np.isfinite(fit.objective)
    assert np.isfinite(fit.covariance).all()
