"""The joint fit against data of known sizes and known noise."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

import rverror
from rverror.diagnosis.harmonics.fit import Misfit, covariance_of, joint_fit, priors, with_values
from rverror.diagnosis.harmonics.runs import FitRun, coarse, fit_run, independent_samples, whitened
from rverror.geartrain.kinematics import Conditions
from rverror.model.effects import Effect, Model, effect
from rverror.runs.spectrum import amplitude, harmonics
from rverror.statics.prediction import Predictor, predict

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


@pytest.mark.parametrize(("periods", "order"), [(2, 0), (3, 0), (3, 40), (2, 100)])
def test_independent_samples_are_those_of_the_smoothed_noise(periods: int, order: int) -> None:
    """The scatter of the noise of one order, and of the mean over many, in runs of white noise: variance 2 / nu."""
    rng = np.random.default_rng([periods, order])
    found, many = [], []
    for _ in range(400):
        run = run_of((), rng, noise=1.0, periods=periods)
        found.append(run.noise[order])
        many.append(run.noise.mean())
    shares = np.zeros(run.noise.size)
    shares[order] = 3.0
    few = independent_samples([run], [shares])
    assert few == pytest.approx(2 / np.var(found), rel=0.3)
    if order == 0:
        assert few == pytest.approx(10 * (periods - 1))  # cosine and sine of five harmonics
        # two runs know it twice as well; what is known beside leaves less to doubt
        assert independent_samples([run, run], [shares, shares]) == pytest.approx(2 * few)
        assert independent_samples([run], [shares], known=3.0) == pytest.approx(4 * few)
    assert independent_samples([run], [np.ones(run.noise.size)]) == pytest.approx(2 / np.var(many), rel=0.3)


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


# --- what is not explained yet ------------------------------------------------------------------------------------

COUNTS = st.integers(2, 20000)


def border(count: int) -> float:
    """Chi-square of so many values, five standard deviations above what is expected."""
    return count + 5 * math.sqrt(2 * count)


@given(count=COUNTS, share=st.floats(0, 1), prior=st.floats(0, 1e4))
def test_a_residual_that_may_be_noise_counts_as_its_chi_square(count: int, share: float, prior: float) -> None:
    misfit = Misfit(share * border(count), prior, count)
    assert misfit.scale == 1
    assert misfit.objective == pytest.approx(misfit.data + prior, rel=1e-12)


@given(count=COUNTS, share=st.floats(0.01, 1e4), prior=st.floats(0, 1e4))
def test_the_objective_is_the_likelihood_at_the_best_variance(count: int, share: float, prior: float) -> None:
    """Minus twice the logarithm over all variances s, of the noise's or more: data / s + values log s, by search."""
    values = border(count)
    data = share * values
    found = minimize_scalar(
        lambda log_s: data * math.exp(-log_s) + values * log_s,
        bounds=(0, 20),
        method="bounded",
        options={"xatol": 1e-7},
    )
    assert Misfit(data, prior, count).objective == pytest.approx(found.fun + prior, rel=1e-6, abs=1e-6 * values)
    assert Misfit(data, prior, count).scale == pytest.approx(math.exp(found.x), rel=1e-3)


@given(count=COUNTS)
def test_the_objective_has_no_step_and_no_kink_at_the_border(count: int) -> None:
    values = border(count)
    step = 1e-6 * values
    below, at, above = (Misfit(values + change, 3.0, count).objective for change in (-step, 0.0, step))
    assert at == pytest.approx(values + 3.0, rel=1e-12)
    assert (at - below) / step == pytest.approx(1, abs=1e-3)
    assert (above - at) / step == pytest.approx(1, abs=1e-3)


@given(count=COUNTS, data=st.floats(0, 1e8), more=st.floats(1e-2, 1e8), prior=st.floats(0, 1e6))
def test_the_objective_grows_with_data_and_prior(count: int, data: float, more: float, prior: float) -> None:
    one = Misfit(data, prior, count).objective
    assert Misfit(data + more, prior, count).objective > one
    assert Misfit(data, prior + more, count).objective == pytest.approx(one + more, rel=1e-9)


def test_declared_sizes_do_not_make_up_for_what_is_missing() -> None:
    """A wave of the declared size's order and more is missing.  The fit must stand at the least of the objective.

    Found by turns: the variance that a size leaves, and the size at that variance.  Plain least squares moves it by
    9 sigma.
    """
    sigma, noise, periods = 0.3e-3, 0.3 * ARCSEC, 4
    cam = effect("crank.eccentricity", crank=0, disc=0, radial="6 um", uncertainty=sigma)
    planet = effect("involute.planet_eccentricity", crank=0, x="40 um", y="25 um")
    pins = effect("cycloid.pin_circle", harmonic=2, radial_cos="20 um")
    run = run_of((cam, planet, pins), np.random.default_rng(23), noise=noise, periods=periods, declared_noise=True)
    influence = rverror.influence(UNIT, run.conditions.theta, cam.key, direction=1, **cam.indices).matrix
    shapes = influence - influence.mean(axis=1, keepdims=True)
    mean = run.values.mean(axis=0) - run.values.mean()

    def squares(values: np.ndarray) -> tuple[float, float]:
        left = mean - values @ shapes
        change = values - np.array(cam.values)
        return float(left @ left) * periods / noise**2, float(change @ change) / sigma**2

    def least(scale: float) -> np.ndarray:
        """Size of least squares for a residual of a given variance."""
        gram = shapes @ shapes.T * periods / noise**2 / scale + np.eye(2) / sigma**2
        moment = shapes @ mean * periods / noise**2 / scale + np.array(cam.values) / sigma**2
        return np.asarray(np.linalg.solve(gram, moment))

    plain, scale = least(1.0), 1.0
    for _ in range(200):  # at the least of the objective the variance is that of the residual
        scale = max(1.0, squares(least(scale))[0] / border(POINTS - 1))
    expected = least(scale)
    assert scale > 20
    assert np.abs(plain - cam.values).max() > max(8 * sigma, 3 * np.abs(expected - cam.values).max())

    fit = joint_fit(Model(UNIT, (cam,)), (), [run])
    assert fit.converged
    np.testing.assert_allclose(fit.model.effects[0].values, expected, rtol=0, atol=0.15 * sigma)
    assert fit.objective == pytest.approx(Misfit(*squares(expected), POINTS - 1).objective, abs=0.05)


# --- runs that share a zero ---------------------------------------------------------------------------------------


def group_of(
    rng: np.random.Generator, variances: Sequence[float], *, zeros: Sequence[str], offset: float = 0.0
) -> list[FitRun]:
    """Runs of a few periods and samples, with means of their own."""
    runs = []
    for i, (variance, zero) in enumerate(zip(variances, zeros, strict=True)):
        values = offset + rng.normal() + rng.normal(size=(2 + i, 15))
        predictor = Predictor(UNIT, Conditions(turn(15), 1.0))
        noise = np.exp(rng.normal(size=7))
        runs.append(FitRun(f"run {i}", predictor, values, noise, zero=zero, mean_variance=variance))
    return runs


@given(
    seed=st.integers(0, 2**32 - 1),
    variances=st.lists(st.floats(1e-4, 1e4), min_size=2, max_size=5),
    offset=st.floats(-100, 100),
)
def test_means_of_one_zero_count_as_generalised_least_squares(seed: int, variances: list[float], offset: float) -> None:
    """Squares of the means about their common offset, which is what makes them least; written out, plus the waves."""
    rng = np.random.default_rng(seed)
    runs = group_of(rng, variances, zeros=["A"] * len(variances), offset=offset)
    rows, periods = [run.values.mean(axis=0) for run in runs], [run.periods for run in runs]
    means = np.array([row.mean() for row in rows])
    weight = np.array(periods) / np.array(variances)
    common = (weight @ means) / weight.sum()
    waves = sum(
        count
        * ((np.cos(k * turn(15) - 0.1) @ row) ** 2 + (np.sin(k * turn(15) - 0.1) @ row) ** 2)
        * 2
        / 15
        / run.noise[k - 1]
        for run, row, count in zip(runs, rows, periods, strict=True)
        for k in range(1, 8)
    )
    found = whitened(runs, rows, periods)
    assert found.shape == (14 * len(runs) + len(runs) - 1,)
    assert found @ found == pytest.approx(waves + weight @ (means - common) ** 2, rel=1e-6)


def test_only_runs_of_one_label_are_compared() -> None:
    """Labels A, none, B, A, C, B: one difference each for A and B, whatever the order and the others."""
    runs = group_of(np.random.default_rng(24), [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], zeros=["A", "", "B", "A", "C", "B"])
    rows, periods = [run.values.mean(axis=0) for run in runs], [run.periods for run in runs]
    found = whitened(runs, rows, periods)
    apart = whitened([replace(run, zero="") for run in runs], rows, periods)
    assert found.size == apart.size + 2
    np.testing.assert_array_equal(found[:-2], apart)
    for value, (i, j) in zip(found[-2:], ((0, 3), (2, 5)), strict=True):
        variance = runs[i].mean_variance / runs[i].periods + runs[j].mean_variance / runs[j].periods
        assert value == pytest.approx((rows[j].mean() - rows[i].mean()) / math.sqrt(variance), rel=1e-9)


def test_rows_of_many_parameters_are_whitened_one_by_one() -> None:
    rng = np.random.default_rng(25)
    runs = group_of(rng, [1.0, 2.0, 3.0], zeros=["A", "A", "A"])
    blocks = [rng.normal(size=(4, 15)) for _ in runs]
    together = whitened(runs, blocks, [1, 2, 3])
    for i, row in enumerate(together):
        np.testing.assert_allclose(row, whitened(runs, [block[i] for block in blocks], [1, 2, 3]), rtol=1e-12)


def test_two_runs_of_one_label_tell_a_lag() -> None:
    """Play in the carrier bearings lags the output by c / r6 each way: its size is in the means of the runs alone."""
    play = effect("coupling.bearing_clearance", clearance="5 um")
    rng, spread = np.random.default_rng(26), 2 * ARCSEC
    runs = [
        run_of((*TRUTH, play), rng, noise=ARCSEC, direction=way, offset=0.3, declared_noise=True) for way in (1.0, -1.0)
    ]
    start = (*NOTHING, replace(play, values=(1e-4,)))
    shared = [replace(run, zero="A", mean_variance=run.periods * spread**2) for run in runs]
    fit, apart = joint_fit(Model(UNIT), start, shared), joint_fit(Model(UNIT), start, runs)
    assert np.isinf(apart.covariance[-1, -1])
    # each of the other effects moves both means alike: a pin circle's lag cancels in the difference
    sigma = math.sqrt(2) * spread * 27 / 2
    assert math.sqrt(fit.covariance[-1, -1]) == pytest.approx(sigma, rel=0.01)
    assert fit.model.effects[-1].values[0] == pytest.approx(5e-3, abs=0.2 * sigma)
    np.testing.assert_allclose(
        values_of(fit.model.effects)[:-1], values_of(apart.model.effects)[:-1], rtol=0, atol=1e-5
    )


def test_fewer_angles_keep_the_zero() -> None:
    run = replace(run_of(TRUTH, np.random.default_rng(27), noise=ARCSEC, points=1024), zero="A", mean_variance=3.0)
    small = coarse(run, 256)
    assert (small.zero, small.mean_variance) == ("A", 3.0)
