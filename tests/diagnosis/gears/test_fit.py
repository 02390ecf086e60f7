"""The joint fit: its derivatives against differences, its covariance against scatter, its bounds."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import lsq_linear
from scipy.stats import chi2

import rverror
from gear_runs import OTHER, UNIT, begin, red, runs_of
from rverror.base.arrays import Array
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.fit import (
    Fit,
    RunSet,
    as_declared,
    bounds,
    evaluated,
    fitted,
    onto,
    promised,
    proposed,
    soft_spread,
    stepped,
    with_estimated_noise,
    without_effect,
)
from rverror.diagnosis.gears.record import records_of
from rverror.diagnosis.gears.waveform import softened
from rverror.diagnosis.policy import POLICY
from rverror.geartrain.mechanism import LAW_SPREAD, ContactLaw, Stiffness
from rverror.model.catalogue import source
from rverror.model.effects import Effect
from rverror.runs.noise import RunNoise
from rverror.statics.loaded_state import SOFTENING

CAM = rverror.effect("crank.eccentricity", crank=0, disc=0, radial="8 um", tangential="-5 um")
PLAY = rverror.effect("crank.bearing_clearance", clearance="6 um", uncertainty="3 um")
PROFILE = rverror.effect("cycloid.disc_profile", disc=1, harmonic=2, cos="4 um", sin="3 um")
ENCODER = rverror.effect("sensor.encoder_eccentricity", cos="2 arcsec", sin="-1 arcsec", uncertainty="1 arcsec")
SOFT = replace(UNIT, contact_law=ContactLaw(pin_exponent=1.1, flank_exponent=1.08))
CURVED = 3 + 4 + SOFTENING.index("profile_curvature")
LOADS = ((1.0, 30e3), (-1.0, 30e3), (1.0, 150e3), (-1.0, 150e3))


@pytest.fixture(scope="module")
def state() -> Fit:
    """Somewhere beside the minimum, with declared, added, felt and read effects, and a zero that two runs share."""
    declared = rverror.Model(SOFT, (PLAY, ENCODER))
    runs = runs_of(rverror.Model(OTHER, (PLAY, CAM)), LOADS[:3], points=512)
    runs = [*runs[:2], replace(runs[2])]
    records, _ = records_of(declared, runs)
    records = [replace(r, zero="A" if i < 2 else "", noise=RunNoise(np.array([0.5]), 2 * ARCSEC))
               for i, r in enumerate(records)]  # fmt: skip
    run_set = RunSet.of(SOFT, records, POLICY, points=512, anywhere=False)
    start = rverror.Model(SOFT, (PLAY, ENCODER, CAM, PROFILE))
    step = np.concatenate(
        [[1e-3, 1e-6, 1e-6], 1e-3 * np.ones(4), [0.1, -0.1, 0.05, 0.1, 0.1, 0.1, 2e-3, 0.02, 0.03, 0.0]]
    )
    return evaluated(run_set, stepped(start, np.append(step, 0.0)), declared)


@pytest.mark.parametrize(
    ("key", "indices", "size"),
    [
        ("cycloid.disc_lobe", {"disc": 1, "lobe": 3}, 2e-5),
        ("crank.eccentricity", {"crank": 1, "disc": 0}, 2e-5),
        ("involute.sun_pitch", {"harmonic": 2}, 2e-5),
        ("sensor.encoder_ellipticity", {}, 1e-6),
        ("sensor.input_coupling", {"harmonic": 1}, 1e-6),
    ],
)
def test_what_a_candidate_does_is_the_difference_that_its_size_makes(
    state: Fit, key: str, indices: dict[str, Any], size: float
) -> None:
    """Beside those of the model, felt by the contacts or read at the output."""
    others = [("cycloid.pin_position", {"pin": 2}), (key, indices), ("sensor.ratio_error", {})]
    told = state.run_set.influences(state.model, state.waves, others)
    first = len(source(others[0][0]).parameters)
    for at in range(len(source(key).parameters)):
        values = size * np.eye(len(source(key).parameters))[at]
        one, other = (
            evaluated(
                state.run_set, state.model.with_effects(Effect(key, indices, tuple(way * values))), state.declared
            )
            for way in (1, -1)
        )
        for number, rows in enumerate(told):
            change = (other.residual[number] - one.residual[number]) / (2 * size)
            own = rows[first + at] - rows[first + at].mean()
            assert np.linalg.norm(change - change.mean() - own) < 1e-3 * np.linalg.norm(own)


def nudged(state: Fit, at: int, by: float) -> Fit:
    step = np.zeros(state.moment.size)
    step[at] = by
    return evaluated(state.run_set, stepped(state.model, step), state.declared, state.waves)


def both_ways(state: Fit, at: int, by: float) -> tuple[Fit, Fit, float]:
    return nudged(state, at, by), nudged(state, at, -by), by


def steps(state: Fit) -> Array:
    """Of each value, small beside what matters."""
    sizes = [1e-5 * p.plausible for e in state.model.effects for p in source(e.key).parameters]
    return np.array([*sizes, *[1e-4] * 6, 1e-5, 1e-4, 1e-4, 1e-4])


def test_every_change_of_the_prediction_is_that_of_differences(state: Fit) -> None:
    """Each row, whitened, of every run: sizes that are felt and read, compliances, backlash and contact law."""
    assert state.moment.size == 3 + 4 + 10 + 1
    zero = np.concatenate([white[-1] for white in state.rows])
    zero /= np.linalg.norm(zero)

    def beside(parts: list[Array]) -> Array:
        """All runs, less what the shared zero makes of it."""
        every = np.concatenate(parts)
        return np.asarray(every - (every @ zero) * zero)

    for at, by in enumerate(steps(state)):
        # straight profiles cannot be straighter
        up, down, by = (nudged(state, at, by), state, by / 2) if at == CURVED else both_ways(state, at, by)
        change = beside([(low[0] - high[0]) / (2 * by) for high, low in zip(up.rows, down.rows, strict=True)])
        row = beside([white[1 + at] for white in state.rows])
        assert np.linalg.norm(row - change) < 2e-3 * max(float(np.linalg.norm(change)), 1e-6 / by), at
    assert not state.rows[2][-1].any()


def test_gradient_and_curvature_of_the_objective(state: Fit) -> None:
    """As the step takes them: of the squares over their scale, and of the priors about what was declared."""
    assert state.scale > 2  # beyond what noise makes: the logarithm counts
    weights, off = state.weights[:-1], state.departure
    for at, by in enumerate(steps(state)[:CURVED]):
        up, down, by = both_ways(state, at, by)
        slope = (up.objective - down.objective) / (2 * by)
        middle = state.moment[at] / state.scale
        prior = (up.prior - down.prior) / (2 * by)
        assert slope - prior == pytest.approx(-2 * middle, rel=5e-3, abs=1e-3 * math.sqrt(state.gram[at, at])), at
        assert prior == pytest.approx(2 * weights[at] * off[at], rel=1e-3, abs=1e-6 * weights[at] * by), at
        curvature = (up.prior - 2 * state.prior + down.prior) / by**2
        assert curvature == pytest.approx(2 * weights[at], rel=1e-2), at


def test_a_zero_that_runs_share_is_taken_off_once(state: Fit) -> None:
    """Readings moved together change nothing, and a step says truly what it leaves."""
    assert state.moment[-1] == pytest.approx(0, abs=1e-6 * math.sqrt(state.gram[-1, -1] * state.data))
    records = [replace(r, error=r.error + (90 * ARCSEC if r.zero else 0.0)) for r in state.run_set.records]
    moved_zero = evaluated(state.run_set.with_records(records), state.model, state.declared, state.waves)
    assert moved_zero.data == pytest.approx(state.data, rel=1e-6)
    assert moved_zero.moment[:-1] == pytest.approx(state.moment[:-1], rel=1e-4, abs=1e-4 * np.abs(state.moment).max())
    step = np.zeros(state.moment.size)
    step[3:5] = 1e-5  # of the cam
    after = evaluated(moved_zero.run_set, stepped(state.model, step), state.declared, state.waves)
    zero = -(state.gram[-1, :-1] @ step[:-1]) / state.gram[-1, -1]
    step[-1] = zero
    left = moved_zero.data - 2 * step @ moved_zero.moment + step @ moved_zero.gram @ step
    assert after.data == pytest.approx(left, rel=1e-4)


def test_priors_are_those_of_the_declaration(state: Fit) -> None:
    """3 um, 1 arcsec twice, workshop sizes, a quarter of the stiffness, half the backlash, a tenth of an exponent."""
    plausible = [p.plausible for e in (CAM, PROFILE) for p in source(e.key).parameters]
    sigma = [3e-3, ARCSEC, ARCSEC, *(0.5 * p for p in plausible), *[0.25] * 6, 0.01, 0.1, 0.1, 0.5]
    assert 1 / np.sqrt(state.weights[:-1]) == pytest.approx(sigma)
    assert state.weights[-1] == 0
    exact = replace(SOFT, stiffness_uncertainty=replace(SOFT.stiffness_uncertainty, gear_mesh=0.0))
    assert soft_spread(exact)[SOFTENING.index("gear_mesh")] == 0


def test_squares_beyond_noise_count_by_their_logarithm(state: Fit) -> None:
    """Those of 200 values of any size; a square more counts by one over `scale`, and where noise ends by one."""
    n = state.run_set.freedom
    assert state.bound == pytest.approx(n + 5 * math.sqrt(2 * n))
    beyond = state.data - state.bound
    assert beyond > 0
    assert state.objective - state.prior == pytest.approx(state.bound + 200 * math.log(1 + beyond / 200))
    assert replace(state, data=0.9 * n).objective - state.prior == pytest.approx(0.9 * n)
    for data in (0.5 * n, state.bound * (1 - 1e-9), state.bound + 3, 2 * n, 50 * n):
        near = [replace(state, data=data + d).objective for d in (-1e-3, 1e-3)]
        assert (near[1] - near[0]) / 2e-3 == pytest.approx(1 / replace(state, data=data).scale, rel=1e-4)


@pytest.mark.parametrize("seed", [1, 2])
def test_stiffness_and_sizes_come_back_within_their_uncertainty(seed: int) -> None:
    """Two loads and both directions, stiffness a third off, noise with a colour; the errors of all values together."""
    true = rverror.Model(OTHER, (CAM, PROFILE))
    declared = rverror.Model(UNIT)
    runs = runs_of(true, LOADS, seed=seed, rms=0.5)
    first = begin(declared, runs)
    fit = evaluated(first.run_set, rverror.Model(UNIT, (CAM, PROFILE)), declared)
    fit = fitted(with_estimated_noise(fitted(fit, steps=40)), steps=40)
    assert fit.converged
    assert fit.data < fit.bound
    now = fit.model.mechanism
    assert isinstance(now, rverror.Reducer)
    pairs = zip(fit.model.effects, true.effects, strict=True)
    off = [float(d) for e, x in pairs for d in np.subtract(e.values, x.values)]
    off += [-math.log(getattr(now.stiffness, k) / getattr(OTHER.stiffness, k)) for k in SOFTENING[:6]]
    off += [now.gear_backlash - OTHER.gear_backlash]
    off += [getattr(now.contact_law, k) - getattr(OTHER.contact_law, k) for k in SOFTENING[7:]]
    sigma = np.sqrt(np.diag(fit.covariance))
    assert np.abs(off / sigma).max() < 4
    distance = float(np.array(off) @ np.linalg.solve(fit.covariance, np.array(off)))
    assert distance < chi2.isf(1e-3, len(off))
    told = sigma[4:10] < 0.5 * 0.25
    assert told[SOFTENING.index("pin_contact")]
    # the declared stiffness itself lies outside
    assert math.log(200e3 / now.stiffness.pin_contact) / sigma[4] > 4


def test_the_covariance_is_that_of_many_draws(monkeypatch: pytest.MonkeyPatch) -> None:
    """Linear at the truth: noise and declared stiffness drawn anew, the step back is as long as the covariance says."""
    monkeypatch.setattr("rverror.diagnosis.gears.fit.BACKLASH_SPREAD", 0.2)
    for name in ("pin_exponent", "flank_exponent"):
        monkeypatch.setitem(LAW_SPREAD, name, 0.03)
    truth = replace(UNIT, contact_law=ContactLaw(pin_exponent=1.15, flank_exponent=1.15))
    model = rverror.Model(truth, (CAM,))
    runs = runs_of(model, LOADS, points=512, rms=1e-6)
    records, _ = records_of(rverror.Model(truth), runs)
    noise = RunNoise(np.array([0.7]), 0.5 * ARCSEC * math.sqrt(1 - 0.7**2))
    records = [replace(r, noise=noise) for r in records]
    run_set = RunSet.of(truth, records, POLICY, points=512, anywhere=False)
    waves = evaluated(run_set, model, rverror.Model(truth)).waves
    distances, inside = [], []
    for seed in range(24):
        z = np.random.default_rng(seed).normal(size=11)
        names = SOFTENING[:6]
        stated = replace(
            truth,
            stiffness=Stiffness(
                **{k: getattr(truth.stiffness, k) * math.exp(0.25 * s) for k, s in zip(names, z[:6], strict=True)}
            ),
            gear_backlash=truth.gear_backlash / max(1 + 0.2 * z[6], 0.3),
            contact_law=ContactLaw(
                pin_exponent=max(1.15 - 0.03 * z[7], 1.0), flank_exponent=max(1.15 - 0.03 * z[8], 1.0)
            ),
        )
        middle = np.array([CAM.values[0], CAM.values[1]])
        drawn = [replace(r, error=r.error + red(seed * 10 + i, r.error.size, 0.5)) for i, r in enumerate(records)]
        own = replace(run_set.with_records(drawn), unit=stated)
        fit = evaluated(own, model, rverror.Model(stated), waves)
        step, _ = proposed(fit)
        # the prior of a size is about nothing: what it pulls is known, 8 and 5 um of its 0.5 * plausible
        pull = fit.covariance[:, :2] @ (fit.weights[:2] * middle)
        error = step + pull
        keep = np.isfinite(fit.weights)
        distances.append(float(error[keep] @ np.linalg.solve(fit.covariance[np.ix_(keep, keep)], error[keep])))
        inside += list(np.abs(error[keep]) < 1.96 * np.sqrt(np.diag(fit.covariance)[keep]))
    total, freedom = sum(distances), 24 * int(keep.sum())
    assert chi2.isf(0.9995, freedom) < total < chi2.isf(5e-4, freedom)
    assert 0.90 < np.mean(inside) < 0.99


def test_a_clearance_never_falls_below_nothing() -> None:
    """Runs without play, a declared play of 6 +- 3 um: it ends at 0 or above, and other sizes are no worse for it."""
    true = rverror.Model(UNIT, (CAM,))
    declared = rverror.Model(UNIT, (PLAY,))
    first = begin(declared, runs_of(true, LOADS, points=512, rms=0.1))
    fit = fitted(evaluated(first.run_set, rverror.Model(UNIT, (PLAY, CAM)), declared), steps=40)
    assert 0 <= fit.model.effects[0].values[0] < 3e-3
    at = replace(PLAY, values=(0.0,))
    bound = evaluated(first.run_set, rverror.Model(UNIT, (at, CAM)), declared)
    step, gain = proposed(bound)
    assert step[0] >= 0
    assert gain >= -1e-6
    assert stepped(bound.model, -np.ones(step.size) * 1e-3).effects[0].values == (0.0,)


def test_steps_never_raise_the_objective_and_end() -> None:
    true = rverror.Model(OTHER, (CAM, PROFILE))
    declared = rverror.Model(UNIT)
    fit = begin(declared, runs_of(true, LOADS[:2], points=512))
    fit = evaluated(fit.run_set, rverror.Model(UNIT, (CAM, PROFILE)), declared)
    objectives = [fit.objective]
    for _ in range(8):
        fit = fitted(fit, steps=1)
        objectives.append(fit.objective)
    assert np.all(np.diff(objectives) <= 0)
    assert objectives[-1] < objectives[0] - 100


def test_a_step_stays_within_bounds_and_the_others_make_the_best_of_it() -> None:
    """Exponents below 1 and clearances below nothing cannot be: as bounded least squares by another method."""
    soft = np.array([0.2, 0.1, *[0.0] * 8])
    true, declared = rverror.Model(softened(UNIT, soft), (CAM,)), rverror.Model(UNIT, (PLAY,))
    first = begin(declared, runs_of(true, LOADS, points=512, rms=0.5))
    low_play = replace(PLAY, values=(2e-4,))
    fit = evaluated(first.run_set, rverror.Model(softened(UNIT, 0.8 * soft), (low_play, CAM)), declared)
    assert fit.scale == 1
    step, gain = proposed(fit)
    low, high = bounds(fit)
    assert np.all(step >= low - 1e-12)
    assert np.all(step <= high + 1e-12)
    free = np.isfinite(fit.weights)
    root = np.sqrt(fit.weights[free])
    white = np.concatenate([w[1:] for w in fit.rows], axis=1)[free]
    left = np.concatenate([w[0] for w in fit.rows])
    off = fit.departure[free]
    size = np.linalg.norm(np.concatenate([white, np.diag(root)], axis=1), axis=1)
    other = lsq_linear(
        (np.concatenate([white, np.diag(root)], axis=1) / size[:, None]).T,
        np.concatenate([left, -root * off]),
        bounds=(low[free] * size - 1e-12, high[free] * size + 1e-12),
        tol=1e-13,
    )
    assert np.any(np.isclose(step, low, atol=1e-12) & free & (low > -np.inf))  # one of them is at its bound
    assert step[free] * size == pytest.approx(other.x, abs=0.05)  # in standard deviations, nearly
    reached = float(2 * other.cost)
    now = fit.data + float(fit.weights[free] @ off**2)
    assert gain == pytest.approx(now - reached, rel=1e-3)


def test_what_a_linear_effect_promises_it_keeps_at_any_share_of_its_step() -> None:
    """An encoder is exact to first order: the fall of the objective is foretold, near noise and far beyond it."""
    read = rverror.effect("sensor.encoder_eccentricity", cos="30 arcsec", sin="-20 arcsec")
    declared = rverror.Model(UNIT)
    first = begin(declared, runs_of(rverror.Model(UNIT, (read,)), LOADS[:2], points=512))
    for size in (0.0, 0.99):
        start = replace(read, values=tuple(size * v for v in read.values))
        fit = evaluated(first.run_set, rverror.Model(UNIT, (start,)), declared)
        step, gain = proposed(fit, free=np.arange(fit.moment.size) < 2)
        assert promised(fit, step) == gain
        for share in (0.1, 0.5, 1.0):
            then = evaluated(first.run_set, stepped(fit.model, share * step), declared, fit.waves)
            assert promised(fit, share * step) == pytest.approx(fit.objective - then.objective, abs=1e-5)


def test_no_step_goes_farther_than_half_of_what_a_workshop_makes() -> None:
    """Three times as much is found in seven steps of half each, all values moving in proportion."""
    parameter = source("sensor.encoder_eccentricity").parameters[0]
    read = rverror.effect("sensor.encoder_eccentricity", cos=3 * parameter.plausible)
    declared = rverror.Model(UNIT)
    first = begin(declared, runs_of(rverror.Model(UNIT, (read,)), LOADS[:2], points=512))
    fit = evaluated(first.run_set, rverror.Model(UNIT, (replace(read, values=(0.0, 0.0)),)), declared)
    sizes = [fit.model.effects[0].values[0] / parameter.plausible]
    for _ in range(8):
        fit = fitted(fit, steps=1)
        sizes.append(fit.model.effects[0].values[0] / parameter.plausible)
    assert np.max(np.diff(sizes)) <= 0.5 + 1e-9
    assert sizes[1] == pytest.approx(0.5, abs=0.01)
    assert sizes[-1] == pytest.approx(3, rel=0.01)


def test_where_grids_begin_at_a_sample_under_the_marks_a_contact_that_opens_is_followed() -> None:
    """Against the equilibrium at the samples; splines go through angles between which pins begin to carry."""
    pin, ahead = rverror.effect("cycloid.pin_radius", pin=5, deviation="5 um"), 0.1317
    model = rverror.Model(UNIT, (pin,)).with_effects(rverror.effect("sensor.index_offset", offset=f"{ahead} rad"))
    run = runs_of(rverror.Model(UNIT, (pin,)), ((1.0, 20e3),), marks=ahead)[0]
    records, _ = records_of(model, [replace(run, index="unknown")])
    records = [replace(r, noise=RunNoise(np.zeros(0), ARCSEC)) for r in records]
    run_set = RunSet.of(UNIT, records, POLICY, points=1024, anywhere=True)
    exact = rverror.equilibrium(
        rverror.Model(UNIT, (pin,)), records[0].theta + ahead, torque=20e3, direction=1.0
    ).transmission_error
    off = []
    for one in (run_set, run_set.anchored(ahead)):
        fit = evaluated(one, model, model)
        off.append(float(np.abs(records[0].error - fit.residual[0] - exact).max()) / ARCSEC)
    assert off[0] > 0.01
    assert off[1] < 1e-4
    assert replace(run_set, anywhere=False).anchored(ahead).conditions == run_set.conditions


def test_on_fewer_angles_the_same_sizes_make_nearly_the_same_state(state: Fit) -> None:
    """Every condition has so many angles over the same travel, and no more than before."""
    coarser = state.run_set.coarser(256)
    for few, many in zip(coarser.conditions, state.run_set.conditions, strict=True):
        assert (few.turn.points, few.turn.start) == (256, many.turn.start)
        assert few.turn.points * few.turn.step == pytest.approx(many.turn.points * many.turn.step)
    assert (coarser.records, coarser.which) == (state.run_set.records, state.run_set.which)
    assert state.run_set.coarser(4096) is state.run_set
    moved_there = onto(coarser, state)
    assert (moved_there.run_set, moved_there.model, moved_there.declared) == (coarser, state.model, state.declared)
    assert moved_there.data == pytest.approx(state.data, rel=0.02)
    assert onto(state.run_set, state) is state
    assert onto(state.run_set, moved_there).data == pytest.approx(state.data, rel=1e-9)


def test_what_was_declared_goes_back_and_what_was_added_stays(state: Fit) -> None:
    plain = as_declared(state)
    assert plain.model.mechanism == SOFT
    assert plain.model.effects == (*state.declared.effects, *state.added)
    assert plain.prior == pytest.approx(float(plain.pull[3:7] @ plain.departure[3:7] ** 2))


def test_stiffness_that_something_stands_on_stays() -> None:
    """A bearing stiffer by more than its declared compliance: only on the stiffness that was fitted with it."""
    added = rverror.effect("crank.bearing_compliance", crank=0, disc=0, compliance="-4 um/kN")  # of 3.3
    soft = np.zeros(10)
    soft[1] = math.log(2)
    bare = rverror.Model(UNIT)
    run_set = begin(bare, runs_of(bare, LOADS[:2], points=512)).run_set
    fit = evaluated(run_set, rverror.Model(softened(UNIT, soft), (added,)), bare)
    assert as_declared(fit) is fit
    other = evaluated(run_set, rverror.Model(softened(UNIT, soft), (CAM,)), bare)
    assert as_declared(other).model.mechanism == UNIT


def test_deviance_is_that_of_normal_noise(state: Fit) -> None:
    """Of white noise: the squares over its variance, and twice its logarithm for each sample that counts."""
    sigma = 0.4 * ARCSEC
    noisy = [replace(r, noise=RunNoise(np.zeros(0), sigma)) for r in state.run_set.records]
    run_set = state.run_set.with_records(noisy)
    fit = onto(run_set, state)
    expected = 0.0
    for record, rest in zip(run_set.records, fit.residual, strict=True):
        rows, left = record.nuisance[:, record.kept].T, rest[record.kept]
        left = left - rows @ np.linalg.lstsq(rows, left)[0]
        expected += float(left @ left) / sigma**2 + 2 * left.size * math.log(sigma)
    assert fit.deviance == pytest.approx(expected + fit.prior, rel=1e-9)


def test_what_is_lifted_is_the_residual_with_it_back_in(state: Fit) -> None:
    """Its linear part at the contacts as they are; a step from there puts it back to where a whole step does."""
    rest = without_effect(state, 0)
    assert rest.added == state.added[1:]
    for white, now in zip(rest.rows, state.rows, strict=True):
        assert white[0] == pytest.approx(now[0] + np.array(state.added[0].values) @ now[4:6])
        assert white[1:] == pytest.approx(np.delete(now[1:], [3, 4], axis=0))
    for left, residual, raw in zip(rest.residual, state.residual, state.raw, strict=True):
        assert left - residual == pytest.approx(np.array(state.added[0].values) @ raw[3:5])
    assert rest.data == pytest.approx(sum(float(white[0] @ white[0]) for white in rest.rows))
    assert rest.moment == pytest.approx(sum(white[1:] @ white[0] for white in rest.rows))
    assert rest.gram == pytest.approx(sum(white[1:] @ white[1:].T for white in rest.rows))


def test_without_its_rows_a_fit_scores_the_same_and_gets_them_back(state: Fit) -> None:
    slim = state.without_rows
    assert (slim.rows, slim.raw) == ((), ())
    assert (slim.objective, slim.prior) == (state.objective, state.prior)
    assert np.array_equal(slim.covariance, state.covariance)
    again = onto(state.run_set, slim)
    for one, other in zip(again.rows, state.rows, strict=True):
        assert one == pytest.approx(other, abs=1e-6 * np.abs(other).max())
