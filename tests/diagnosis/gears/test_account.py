"""What is said of a fit: its intervals, what it leaves of stretches that it did not see, and its lines."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

import rverror
from gear_runs import CAM, OTHER, TURN, UNIT, begin, record_of, red, runs_of, search_of, settled
from rverror.base.arrays import Array, Flags
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.account import (
    account,
    elastic_within,
    half_widths,
    left_out,
    line_estimates,
    offset_note,
    spread,
)
from rverror.diagnosis.gears.fit import Fit, RunSet, evaluated, first_state, fitted
from rverror.diagnosis.gears.record import records_of
from rverror.diagnosis.gears.reducers import with_marks
from rverror.diagnosis.gears.spectrum import best_lines
from rverror.diagnosis.policy import POLICY, Policy
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.runs.noise import RunNoise

N = 600
THETA = TURN / N * np.arange(N)
ENCODER = rverror.effect("sensor.encoder_eccentricity", cos="0 arcsec", sin="0 arcsec", uncertainty="100 arcsec")


def encoded(error: Array, noise: float, *, uncertainty: float = 100.0, zero: str = "") -> Fit:
    """An encoder fitted to one turn in white noise (both in arcsec); linear and in closed form."""
    record = replace(record_of(error, zero=zero), torque=None, noise=RunNoise(np.zeros(0), noise * ARCSEC))
    declared = Model(UNIT, (replace(ENCODER, uncertainty=uncertainty * ARCSEC),))
    return fitted(evaluated(RunSet.of(UNIT, [record], POLICY, points=512, anywhere=False), declared, declared))


@pytest.mark.parametrize("noise", [1e-4, 1e-3])
def test_where_noise_is_little_an_interval_is_as_wide_as_the_model_s_own_error(noise: float) -> None:
    """A wave of that rms, whatever its phase, moves cosine and sine together by sqrt(2) of it: once it for each.

    Student's factor at 95 % is 2 % above that of a normal distribution with 75 samples.
    """
    own = POLICY.model_error
    for phase in (0.3, 1.1, 2.0):
        fit = encoded(math.sqrt(2) * own * np.cos(THETA - phase), noise)
        half = [fit.run_set.half_width(float(variance)) for variance in spread(fit)[:2]]
        assert half == pytest.approx([1.96 * own] * 2, rel=0.03)
        assert math.hypot(*fit.model.effects[0].values) == pytest.approx(math.sqrt(2) * own, rel=1e-3)
        assert np.all(np.abs(fit.model.effects[0].values) < half)


def test_where_noise_is_much_an_interval_is_that_of_least_squares() -> None:
    """A cosine of n samples is known to sqrt(2 / n) of the noise, of which the model's own error is a hundredth."""
    noise = 100 * POLICY.model_error / ARCSEC
    fit = encoded(np.zeros(N), noise, uncertainty=1e4)
    half = fit.run_set.half_width(float(spread(fit)[0]))
    assert half == pytest.approx(1.96 * noise * ARCSEC * math.sqrt(2 / N), rel=0.05)


def test_what_comes_of_a_prior_does_not_grow_with_the_model_s_error() -> None:
    """In noise of a hundredth of the model's own error: told by the run, and by its uncertainty alone.

    Two values share N (0.01 / 1e-4)^2 squares; a prior of 1e-9 arcsec lets (1e-9)^2 N/2 / (1e-4)^2 of its own through.
    """
    noise, narrow = 1e-4, 1e-9
    told, kept = encoded(np.zeros(N), noise), encoded(np.zeros(N), noise, uncertainty=narrow)
    assert np.all(spread(told)[:2] > 100 * np.diag(told.covariance)[:2])
    grown = (N * 1e4 / 2) * (narrow**2 * (N / 2) / noise**2)
    assert spread(kept)[:2] / (narrow * ARCSEC) ** 2 == pytest.approx([1 + grown] * 2, rel=1e-3)
    assert grown < 0.1


@pytest.fixture(scope="module")
def right() -> Fit:
    """The true cause, fitted to runs at the load."""
    return settled(Model(OTHER, (CAM,)), CAM)


def test_intervals_hold_what_the_model_is_not_right_to_about_what_was_added(right: Fit) -> None:
    """Squares of a share of the cam's waves, shared by all values: of 5 % they are 25 times those of 1 %."""
    without = evaluated(right.run_set, replace(right.model, effects=()), right.declared)
    squares = sum(float(np.sum((less[0] - both[0]) ** 2)) for less, both in zip(without.rows, right.rows, strict=True))
    through = np.diag(right.covariance @ right.gram @ right.covariance) / right.scale
    for share in (0.01, 0.05):
        policy = replace(POLICY, model_error=1e-9 * ARCSEC, added_share=share)
        told = spread(replace(right, run_set=replace(right.run_set, policy=policy)))
        grown = share**2 * squares / right.free.sum() * through[:2]
        assert told[:2] == pytest.approx(np.diag(right.covariance)[:2] + grown, rel=1e-3)
        assert told[0] > 1.05 * right.covariance[0, 0]


def test_a_cause_that_leaves_more_than_noise_is_not_named(right: Fit) -> None:
    """A wave of twice its order that is left beside a cam is said, and nothing is named; without it the cam is."""
    for wave, names in ((0.0, [CAM.key]), (2.0, [])):
        records = [replace(r, error=r.error + wave * ARCSEC * np.cos(32 * r.theta)) for r in right.run_set.records]
        runs = [
            rverror.run_from_arrays(
                input_angle=UNIT.ratio * r.theta, output_angle=r.theta + r.error, direction=r.direction, torque=r.torque
            )
            for r in records
        ]
        fit = fitted(evaluated(right.run_set.with_records(records), right.model, right.declared))
        search = search_of(fit, [CAM.key])
        best = search.score.of(fit)
        done = search.complete(best)
        told = account(right.declared, runs, search, best, done, [])
        assert done is bool(names)
        assert [one.effect.key for one in told.added] == names
        assert told.verdict == ("explained" if names else "unexplained")
        assert any("leaves more than noise: not named" in note for note in told.notes) is (not done)
        assert {fate.fate for fate in told.history} == {"added" if names else "fell"}


def least_squares(error: Array, used: Flags, noise: float, sigma: float) -> Array:
    """What the used samples leave of all, an offset free and a wave about nothing by so much: written out."""
    rows = np.stack([np.ones(N), np.cos(THETA), np.sin(THETA)])
    weighted = rows[:, used] / noise
    gram = weighted @ weighted.T + np.diag([0.0, sigma**-2, sigma**-2])
    return np.asarray(error - np.linalg.solve(gram, weighted @ error[used] / noise) @ rows)


@pytest.mark.parametrize("uncertainty", [0.02, 0.05, 100.0])
def test_a_stretch_that_is_left_out_has_the_sizes_of_the_others_and_of_the_priors(uncertainty: float) -> None:
    """Sixths of a turn, each against a fit of its own to the other five; a prior as narrow holds it back."""
    noise = 0.3 * ARCSEC
    error = red(3, N, 0.3, 0.0) + 0.08 * ARCSEC * np.cos(THETA - 0.5)
    fit = encoded(error, 0.3, uncertainty=uncertainty, zero="A")
    assert fit.scale == 1
    (found,) = left_out(fit)
    expected = np.zeros(N)
    for out in np.arange(N).reshape(6, -1):
        used = np.ones(N, dtype=np.bool_)
        used[out] = False
        expected[out] = least_squares(error, used, noise, uncertainty * ARCSEC)[out]
    assert found == pytest.approx(expected, abs=1e-5 * noise)
    # the whole fit has seen them, and leaves less
    whole = least_squares(error, np.ones(N, dtype=np.bool_), noise, uncertainty * ARCSEC)
    assert fit.residual[0] == pytest.approx(whole, abs=1e-5 * noise)
    assert float(found @ found) > float(whole @ whole)


def lined(seed: int, runs: int, policy: Policy) -> Fit:
    """Runs of 1.5 arcsec at an order of no part in white noise of 0.3, which is known."""
    records = [
        replace(
            record_of(1.5 * ARCSEC * np.cos(23.37 * THETA + 0.4) + red(100 * seed + i, N, 0.3, 0.0)),
            name=f"run {i}",
            torque=None,
            noise=RunNoise(np.zeros(0), 0.3 * ARCSEC),
        )
        for i in range(runs)
    ]
    return evaluated(RunSet.of(UNIT, records, policy, points=512, anywhere=False), Model(UNIT), Model(UNIT))


@pytest.mark.parametrize("runs", [1, 2])
def test_a_line_s_interval_is_that_of_a_wave_in_white_noise(runs: int) -> None:
    """1.96 sqrt(2 / n) of the noise either way, for the mean of two runs sqrt(2) less; and so lines are scattered."""
    policy = replace(POLICY, model_error=1e-4 * ARCSEC)
    expected = 0.3 * ARCSEC * math.sqrt(2 / N / runs)
    off = []
    for seed in range(24):
        fit = lined(seed, runs, policy)
        (line,) = line_estimates(fit, best_lines(fit, policy, outside=True))
        assert line.high - line.amplitude == pytest.approx(1.96 * expected, rel=0.05)
        assert line.amplitude - line.low == pytest.approx(1.96 * expected, rel=0.05)
        off.append((line.amplitude - 1.5 * ARCSEC) / expected)
    assert chi2.isf(0.999, 24) < float(np.sum(np.square(off))) < chi2.isf(0.001, 24)


@pytest.mark.parametrize("runs", [1, 2])
def test_a_line_s_interval_holds_the_model_s_own_error(runs: int) -> None:
    """A model that is off by m leaves n (m / 0.3)^2 squares, all of which may be the line's where nothing is free."""
    halves = []
    for size in (1e-6, 0.02):
        policy = replace(POLICY, model_error=size * ARCSEC)
        fit = lined(1, runs, policy)
        (line,) = line_estimates(fit, best_lines(fit, policy, outside=True))
        assert np.isfinite(fit.weights).sum() <= 1
        halves.append(line.high - line.amplitude)
    assert (halves[1] / halves[0]) ** 2 == pytest.approx(1 + runs * N * (0.02 / 0.3) ** 2, rel=1e-3)


def test_a_line_that_was_freed_is_told_as_one_that_was_left() -> None:
    fit = lined(1, 2, POLICY)
    (found,) = best_lines(fit, POLICY, outside=True)
    (left,) = line_estimates(fit, [found])
    records = [replace(r, orders=(found.order,)) for r in fit.run_set.records]
    (free,) = line_estimates(replace(fit, run_set=fit.run_set.with_records(records)), [])
    for one, other in zip(
        (free.order, free.amplitude, free.low, free.high),
        (left.order, left.amplitude, left.low, left.high),
        strict=True,
    ):
        assert one == pytest.approx(other, rel=1e-3)


def test_runs_that_are_all_noise_leave_stiffness_what_was_known_before() -> None:
    """A quarter of the logarithm either way, half the backlash, a tenth of an exponent: times 1.96, within bounds."""
    (run,) = runs_of(Model(UNIT), ((1.0, 50e3),), points=512)
    first = begin(Model(UNIT), [run], points=512)
    loud = [replace(r, noise=RunNoise(np.zeros(0), 1.0)) for r in first.run_set.records]
    fit = evaluated(first.run_set.with_records(loud), Model(UNIT), Model(UNIT))
    soft = {e.name: e for e in elastic_within(fit, half_widths(fit))}
    for name in ("pin_contact", "crank_bearing", "gear_mesh", "carrier_bearing"):
        one, stated = soft[name], getattr(UNIT.stiffness, name)
        assert one.value == one.declared == pytest.approx(stated)
        assert math.log(one.high / stated) == pytest.approx(1.96 * 0.25, rel=0.05)
        assert math.log(stated / one.low) == pytest.approx(1.96 * 0.25, rel=0.05)
        assert not one.determined
    backlash = soft["gear_backlash"]
    assert backlash.high - 0.02 == pytest.approx(1.96 * 0.01, rel=0.05)
    assert 0.02 - backlash.low == pytest.approx(1.96 * 0.01, rel=0.05)
    exponent = soft["pin_exponent"]
    assert exponent.high - 1 == pytest.approx(1.96 * 0.1, rel=0.05)
    assert exponent.low == 1


def test_what_an_interval_leaves_of_the_prior_decides_whether_a_stiffness_is_determined() -> None:
    """Whatever made it wide: the noise, or a rival's fit.  No interval goes beyond what can be."""
    (run,) = runs_of(Model(UNIT), ((1.0, 50e3),), points=512)
    fit = begin(Model(UNIT), [run], points=512)
    count = fit.moment.size
    for share, determined in ((0.68, True), (0.75, False)):
        (pins, *_) = elastic_within(fit, [share * 1.96 * 0.25] * count)
        assert pins.name == "pin_contact"
        assert pins.determined == determined
    wide = {e.name: e for e in elastic_within(fit, [10.0] * count)}
    assert (wide["pin_exponent"].low, wide["pin_exponent"].high) == (1.0, 1.5)
    assert wide["gear_backlash"].low == 0.0


@pytest.mark.parametrize(("fixed", "again"), [(False, True), (True, False)])
def test_marks_are_known_but_for_turns_of_the_crank_unless_a_pin_is_declared(fixed: bool, again: bool) -> None:
    """After one the gear train stands as before, turned with the carrier: a cam is alike then, a pin is not."""
    cam = rverror.effect("crank.eccentricity", crank=0, disc=0, radial="8 um", tangential="-5 um", uncertainty="0.3 um")
    pin = rverror.effect("cycloid.pin_position", pin=5, radial="-9 um", uncertainty="0.3 um")
    declared = Model(UNIT, (cam, pin) if fixed else (cam,))
    runs = [replace(run, index="unknown") for run in runs_of(declared, points=512)]
    model, anywhere = with_marks(declared, runs)
    records, _ = records_of(model, runs)
    fit = fitted(first_state(RunSet.of(UNIT, records, POLICY, points=512, anywhere=anywhere), model, model))
    note = offset_note(fit, declared, np.full(fit.moment.size, 1e-3))
    assert "the gear's marks are " in note
    assert ("or whole turns of the crank, 22.5 deg, from there" in note) == again


def test_marks_are_not_placed_where_nothing_of_the_gear_train_shows() -> None:
    """An encoder turns with the bench, and rigid gears without errors make none: neither says where the marks are."""
    declared = Model(UNIT, (replace(ENCODER, uncertainty=ARCSEC),))
    angle = THETA + red(0, N)
    run = rverror.run_from_arrays(input_angle=UNIT.ratio * THETA, output_angle=angle, direction="forward")
    runs = [replace(run, index="unknown")]
    model, anywhere = with_marks(declared, runs)
    records, _ = records_of(model, runs)
    fit = fitted(first_state(RunSet.of(UNIT, records, POLICY, points=512, anywhere=anywhere), model, model))
    assert "cannot be placed" in offset_note(fit, declared, np.full(fit.moment.size, 1e-3))


@pytest.mark.parametrize(("share", "told"), [(0.9, True), (1.1, False)])
def test_a_size_is_told_where_less_than_half_of_its_variance_is_left(share: float, told: bool) -> None:
    """What the runs know by themselves and what a workshop makes are then alike: sqrt(2 / n) of the noise, and that."""
    usual = POLICY.workshop * source(ENCODER.key).parameters[0].plausible
    noise = share * usual / math.sqrt(2 / N)
    run = rverror.run_from_arrays(input_angle=UNIT.ratio * THETA, output_angle=THETA, direction="forward")
    record = replace(records_of(Model(UNIT), [run])[0][0], noise=RunNoise(np.zeros(0), noise))
    root = evaluated(RunSet.of(UNIT, [record], POLICY, points=512, anywhere=False), Model(UNIT), Model(UNIT))
    search = search_of(root, [ENCODER.key])
    best = search.score.of(evaluated(root.run_set, Model(UNIT, (ENCODER,)), Model(UNIT)))
    (one,) = account(Model(UNIT), [run], search, best, True, []).added
    assert any("do not tell" in note for note in one.notes) != told
