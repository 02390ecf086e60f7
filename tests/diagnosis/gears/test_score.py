"""What a set of causes is worth: against probabilities written out, and what keeps it from being named."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import null_space

import rverror
from gear_runs import BARE, CAM, OTHER, TURN, UNIT, USUAL, record_of, runs_of, settled
from rverror.base.arrays import Array
from rverror.base.chance import chi_square
from rverror.base.units import ARCSEC
from rverror.diagnosis.causes import Named, identity, named
from rverror.diagnosis.gears.fit import Fit, RunSet, evaluated, fitted
from rverror.diagnosis.gears.ranking import Columns, Offer, singles
from rverror.diagnosis.gears.record import records_of
from rverror.diagnosis.gears.score import Hypothesis, Score, bent, inexact, strained, unsure
from rverror.diagnosis.policy import POLICY
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.runs.noise import RunNoise

ENCODER = rverror.effect("sensor.encoder_eccentricity", cos="100 arcsec", sin="-60 arcsec")
TWICE = rverror.effect("sensor.encoder_ellipticity", cos="30 arcsec", sin="20 arcsec")
SLOPE = rverror.effect("sensor.ratio_error", slope=1e-4)
STATED = rverror.effect("cycloid.disc_profile", disc=0, harmonic=1, cos="0 um", sin="0 um", uncertainty="20 um")
N, NOISE = 200, 300 * ARCSEC


def white(error: Array, declared: Model, *added: Effect, travel: float = TURN, noise: float = NOISE) -> Fit:
    """The fit of an error in white noise that is known; in closed form, where every prediction is linear."""
    theta = np.asarray(travel / error.size * np.arange(error.size), dtype=np.float64)
    record = replace(record_of(error, theta), torque=None, noise=RunNoise(np.zeros(0), noise))
    run_set = RunSet.of(UNIT, [record], POLICY, points=256, anywhere=False)
    start = replace(declared, effects=(*declared.effects, *(replace(e, values=(0.0,) * len(e.values)) for e in added)))
    return fitted(evaluated(run_set, start, declared), steps=60, enough=1e-9)


def surprise(fit: Fit, error: Array) -> float:
    """Minus twice the logarithm of the chance of an error, whatever its mean: normal, of the noise and all priors."""
    free = np.isfinite(fit.weights)
    rows = fit.raw[0][free]
    known = rows.T @ np.diag(1 / fit.weights[free]) @ rows + NOISE**2 * np.eye(error.size)
    about = null_space(np.ones((1, error.size)))
    inner = about.T @ known @ about
    rest = about.T @ error
    return float(np.linalg.slogdet(inner)[1] + rest @ np.linalg.solve(inner, rest))


@pytest.mark.parametrize("travel", [TURN, 0.6 * TURN])
@pytest.mark.parametrize(
    "added", [(SLOPE,), (ENCODER,), (TWICE,), (SLOPE, TWICE), (ENCODER, TWICE)], ids=lambda es: f"{len(es)}"
)
@pytest.mark.parametrize("declared", [BARE, Model(UNIT, (STATED,))], ids=["bare", "declared"])
def test_the_score_is_the_probability_of_a_set(declared: Model, added: tuple[Effect, ...], travel: float) -> None:
    """Of linear causes in normal noise it is known; beside sizes that are declared, and beside one another.

    Over a part of a turn causes look alike, and what the runs tell of one depends on the other.
    """
    theta = travel / N * np.arange(N)
    error = NOISE * np.random.default_rng(len(added)).normal(size=N) + 100 * ARCSEC * np.cos(theta - 0.4)
    score = Score([(e.key, e.indices) for e in (SLOPE, ENCODER, TWICE)], POLICY)
    with_them, without = (white(error, declared, *one, travel=travel) for one in (added, ()))
    assert with_them.scale == without.scale == 1
    expected = surprise(with_them, error) - surprise(without, error) + len(added) * 2 * math.log(3)
    assert score.of(with_them).score - score.of(without).score == pytest.approx(expected, abs=1e-3)


def test_the_score_of_one_size_is_an_integral_over_it() -> None:
    error = NOISE * np.random.default_rng(5).normal(size=N)
    bare, fit = white(error, BARE), white(error, BARE, SLOPE)
    row, left = fit.rows[0][1], bare.rows[0][0]
    sigma = POLICY.workshop * source(SLOPE.key).parameters[0].plausible

    def ratio(size: float) -> float:
        squares = float(np.sum((left - size * row) ** 2) - np.sum(left**2)) + (size / sigma) ** 2
        return math.exp(-squares / 2) / (sigma * math.sqrt(2 * math.pi))

    width = float(fit.covariance[0, 0]) ** 0.5
    middle = fit.added[0].values[0]
    told = quad(ratio, middle - 12 * width, middle + 12 * width, points=[middle], epsrel=1e-9)[0]
    score = Score([(SLOPE.key, {})], POLICY)
    assert score.of(fit).score - score.of(bare).score == pytest.approx(-2 * math.log(told), abs=1e-6)


def test_sources_are_equally_likely_and_share_it_among_their_places() -> None:
    """Of all single causes together the chance is one."""
    candidates: list[Named] = [("cycloid.pin_position", {"pin": pin}) for pin in range(16)]
    candidates += [("crank.eccentricity", {"crank": c, "disc": d}) for c in (0, 1) for d in (0, 1)]
    candidates.append((ENCODER.key, {}))
    score = Score(candidates, POLICY)
    chance = {identity(name): math.exp(-score.cost(name) / 2) for name in candidates}
    assert sum(chance.values()) == pytest.approx(1)
    for key in {name[0] for name in candidates}:
        own = [chance[identity(name)] for name in candidates if name[0] == key]
        assert own == pytest.approx([1 / 3 / len(own)] * len(own))


def freed(fit: Fit, *lines: float, slow: bool = False) -> Fit:
    """The same sizes and squares beside free lines, and with runs that drift and settle or do not."""
    return replace(fit, run_set=fit.run_set.with_free(lines, slow=slow))


def test_a_line_and_what_settles_cost_so_much_for_each_row() -> None:
    """Cosine and sine of each line, and four of what drifts and settles, in every run."""
    error = NOISE * np.random.default_rng(1).normal(size=N)
    one = white(error, BARE)
    two = replace(one, run_set=replace(one.run_set, records=one.run_set.records * 2))
    score = Score([], POLICY)
    for fit, runs in ((one, 1), (two, 2)):
        bare = fit.objective
        assert score.of(fit).score == pytest.approx(bare)
        assert score.of(freed(fit, 3.3)).score == pytest.approx(bare + 2 * POLICY.row_cost * runs)
        assert score.of(freed(fit, 3.3, 5.1, slow=True)).score == pytest.approx(bare + 8 * POLICY.row_cost * runs)
    assert score.of(freed(one, 3.301, slow=True)).names == {3.3, "slow"}
    assert score.of(white(error, BARE, TWICE)).names == {named(TWICE)}


# --- sure -------------------------------------------------------------------------------------------------------------

PLACES: list[Named] = [
    *((key, {"disc": disc, "harmonic": h}) for key in ("cycloid.disc_pitch", "cycloid.disc_profile")
      for disc in (0, 1) for h in (1, 2, 3, 4)),
    *(("cycloid.pin_position", {"pin": pin}) for pin in range(16)),
    *(("cycloid.disc_lobe", {"disc": disc, "lobe": lobe}) for disc in (0, 1) for lobe in range(15)),
]  # fmt: skip


def drawn(draws: int, noise: float) -> list[tuple[Fit, list[Offer]]]:
    """Of draws of noise, a declared size and nothing else: the fit of what is declared, and all single causes beside.

    `noise` is in units of what the causes make at their usual size, in the mean.
    """
    rng = np.random.default_rng(11)
    first = white(np.zeros(N), Model(UNIT, (STATED,)))
    rows = first.run_set.influences(first.model, first.waves, PLACES)[0]
    sizes = np.array([POLICY.workshop * p.plausible for key, _ in PLACES for p in source(key).parameters])
    made = noise * float(np.sqrt(np.mean(np.sum((rows - rows.mean(axis=1, keepdims=True)) ** 2, axis=1) * sizes**2)))
    records = [replace(r, noise=RunNoise(np.zeros(0), made)) for r in first.run_set.records]
    run_set = first.run_set.with_records(records)
    ends = np.cumsum([0, *(len(source(key).parameters) for key, _ in PLACES)])
    shown = run_set.observations[0].whiten(rows)
    blocks = [
        Columns(name, np.eye(b - a), (shown[a:b],)) for name, a, b in zip(PLACES, ends[:-1], ends[1:], strict=True)
    ]
    found = []
    for _ in range(draws):
        stated = float(STATED.uncertainty or 0.0) * rng.normal(size=2)
        error = made * rng.normal(size=N) + stated @ first.raw[0][:2]
        state = evaluated(run_set.with_records([replace(r, error=error) for r in records]), first.model, first.declared)
        found.append((fitted(state, enough=1e-9), singles(state, blocks, Score(PLACES, POLICY).cost)))
    return found


def test_by_chance_single_causes_are_together_as_probable_as_none() -> None:
    """The mean ratio of two probabilities is 1 where the lower one is true, of any noise and any number of places.

    Of noise that nearly hides what the causes usually make it is a mean of moderate numbers.
    """
    ratios = [sum(math.exp((fit.objective - one.score) / 2) for one in offers) for fit, offers in drawn(200, 1.0)]
    assert np.std(ratios) > 0.1
    assert np.mean(ratios) == pytest.approx(1, abs=4 * float(np.std(ratios)) / math.sqrt(200))


@pytest.mark.parametrize("noise", [0.1, 0.3])
def test_where_nothing_is_missing_something_is_named_as_seldom_as_the_policy_says(noise: float) -> None:
    """Of 62 places one is beyond a 620th of its chance in no more than a tenth of all cases.

    Beyond the tenth of one place it is so in a fifth of them.
    """
    limits = {size: chi_square(0.1 / len(PLACES), size) for size in (1, 2)}
    cases = [
        [
            (fit.objective - one.objective, fit.objective > one.score, limits[one.sizes[0].size])
            for one in offers
        ]
        for fit, offers in drawn(150, noise)
    ]  # fmt: skip
    assert np.mean([any(probable and fallen > limit for fallen, probable, limit in case) for case in cases]) <= 0.1
    assert np.mean([any(fallen > chi_square(0.1, 2) for fallen, *_ in case) for case in cases]) > 0.2


def fallen_by(amount: float, less: Fit, more: Fit) -> Fit:
    """A fit with so much less of an objective than another."""
    return replace(more, data=more.data + less.objective - amount - more.objective)


def test_one_set_is_better_than_another_if_more_probable_and_beyond_chance() -> None:
    """Each beyond what the model's own error counts, but for drift; of two places, or of what settles in one run."""
    noise = 3 * POLICY.model_error
    error = noise * np.random.default_rng(2).normal(size=N)
    less, more = white(error, BARE, noise=noise), white(error, BARE, TWICE, noise=noise)
    score, own = Score([(TWICE.key, {}), (TWICE.key, {"harmonic": 2})], POLICY), inexact(less)
    assert own > 10
    chance, settles = chi_square(POLICY.false_alarm / 2, len(TWICE.values)), chi_square(POLICY.false_alarm, 4)

    def better(fallen: float, gain: float, *, cause: bool = True, exact: bool = False) -> bool:
        trial = Hypothesis(freed(fallen_by(fallen, less, more if cause else less), slow=not cause), -gain)
        return score.better(trial, Hypothesis(less, 0.0), exact=exact)

    for limit, kind in ((chance, {"exact": True}), (settles, {"cause": False}), (chance + own, {})):
        least = own if not kind else 0.0
        assert better(limit + 0.01, least + 0.01, **kind)
        assert not better(limit - 0.01, least + 0.01, **kind)
        assert not better(limit + 0.01, least - 0.01, **kind)


def test_what_moved_jumps_have_gained_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a fall of 60 that jumps alone made 50 are no reason; those that count are asked for in that order."""
    error = NOISE * np.random.default_rng(2).normal(size=N)
    less = white(error, BARE)
    more = fallen_by(60.0, less, white(error, BARE, TWICE))
    asked: list[tuple[Fit, Fit]] = []

    def fall(before: Fit, after: Fit) -> float:
        asked.append((before, after))
        return 10.0

    score = Score([(TWICE.key, {})], POLICY)
    pair = Hypothesis(more, -60.0), Hypothesis(less, 0.0)
    assert score.better(*pair)
    monkeypatch.setattr("rverror.diagnosis.gears.score.fall", fall)
    assert not score.better(*pair)
    assert asked == [(less, more)]


# --- strained ---------------------------------------------------------------------------------------------------------


def declared_off(by: float, added: Sequence[Effect] = ()) -> Fit:
    """A declared encoder, both its sizes so many uncertainties off, beside what was added; closed form."""
    encoder = replace(ENCODER, values=(0.0, 0.0), uncertainty=2 * ARCSEC)
    (run,) = runs_of(BARE, ((1.0, 50e3),), points=512)
    record = replace(records_of(BARE, [run])[0][0], torque=None, noise=RunNoise(np.zeros(0), ARCSEC))
    now = Model(UNIT, (replace(encoder, values=(by * 2 * ARCSEC,) * 2), *added))
    return evaluated(RunSet.of(UNIT, [record], POLICY, points=512, anywhere=False), now, Model(UNIT, (encoder,)))


@pytest.mark.parametrize("added", [(), (CAM,), (replace(CAM, values=(3.0, -2.0)),)])
def test_only_what_was_declared_is_strained(added: tuple[Effect, ...]) -> None:
    """Two sizes' squares exceed -2 ln p by chance p; what was added may be of any size and counts in neither."""
    limit = math.sqrt(-math.log(POLICY.strained))
    assert not strained(declared_off(0.0, added))
    assert not strained(declared_off(0.99 * limit, added))
    assert strained(declared_off(1.01 * limit, added))


# --- what the model is not right to -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def right() -> Fit:
    """The true cause, fitted."""
    return settled(Model(OTHER, (CAM,)), CAM, conditions=(*USUAL, (1.0, 150e3)), points=1024)


def made_by_what_was_added(fit: Fit) -> float:
    """Squares between what is left without what was added and what is left with it."""
    without = evaluated(fit.run_set, replace(fit.model, effects=fit.declared.effects), fit.declared)
    return sum(float(np.sum((less[0] - both[0]) ** 2)) for less, both in zip(without.rows, fit.rows, strict=True))


def test_the_model_s_own_error_is_that_of_all_samples_and_a_share_of_what_was_added(right: Fit) -> None:
    """0.01 arcsec over n samples in 0.3 of noise, a 900th of a square each, and a hundredth of what was added."""
    n = sum(r.theta.size for r in right.run_set.records)
    assert unsure(right, POLICY) == pytest.approx(n / 900, rel=0.1)
    own = unsure(right, POLICY) + 0.01**2 * made_by_what_was_added(right)
    assert own > 2 * unsure(right, POLICY)
    assert inexact(right) == pytest.approx(200 * math.log1p(own / 200))


def test_beside_large_residuals_the_model_s_own_error_counts_as_they_do(right: Fit) -> None:
    """Beyond N squares count by their logarithm: o more beside D are M ln((M + D + o - N) / (M + D - N))."""
    pin = rverror.effect("cycloid.pin_radius", pin="all", deviation="20 um")
    fit = evaluated(right.run_set, Model(UNIT, (pin,)), BARE)
    assert fit.data > 2 * fit.bound
    own = unsure(fit, POLICY) + bent(fit, POLICY)
    beyond = 200 + fit.data - fit.bound
    assert inexact(fit) == pytest.approx(200 * math.log((beyond + own) / beyond), rel=1e-6)
    assert inexact(fit) < 0.5 * own


def test_the_model_is_right_about_what_is_read_at_the_output(right: Fit) -> None:
    """A hundredth of a part's waveform may be the model's own error, of an encoder's nothing."""
    read = evaluated(right.run_set, replace(right.model, effects=(ENCODER,)), BARE)
    both = evaluated(right.run_set, replace(right.model, effects=(*right.model.effects, ENCODER)), BARE)
    assert bent(read, POLICY) == 0
    assert bent(both, POLICY) == pytest.approx(bent(right, POLICY))
    assert bent(right, POLICY) > 0


def test_what_was_added_is_held_against_what_it_makes_not_its_influence(right: Fit) -> None:
    """Where pins are thinner all alike others carry than where they are not: their influence there says too much."""
    pins = rverror.effect("cycloid.pin_radius", pin="all", deviation="-12 um")
    fit = evaluated(right.run_set, Model(UNIT, (pins,)), BARE)
    squares = made_by_what_was_added(fit)
    linear = sum(float(np.sum((pins.values[0] * rows[1]) ** 2)) for rows in fit.rows)
    assert bent(fit, POLICY) == pytest.approx(1e-4 * squares, rel=1e-6)
    assert squares < linear / 10
