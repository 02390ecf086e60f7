"""Simulated moments on lots that the model itself makes: what was made is told, whatever the estimate begins with."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import pytest
import scipy

import rverror
from gear_runs import TURN, UNIT
from rverror.base.arrays import Array
from rverror.base.units import ARCSEC
from rverror.lots.amplitudes import LotUnit, amplitudes_of
from rverror.lots.differences import changes_over_serial, course, group_differences
from rverror.lots.identifiable import Question, question_of
from rverror.lots.moments import Likelihood, LotEstimate, MomentMatching, Sample, interval, sample_of
from rverror.lots.processes import processes_of
from rverror.lots.shifts import ShiftSource, candidates_of
from rverror.lots.simulated import COMPLIANCES, Draws, Simulator, State
from rverror.model.effects import Model
from rverror.statics.loaded_state import SOFTENING

PINS = "cycloid.pin_position"


@pytest.fixture(scope="module")
def question() -> Question:
    """Five processes, of which two do nearly the same, at a load that leaves most pins of 2.5 um without any."""
    return asked(
        (PINS, "cycloid.pin_radius", "crank.eccentricity", "cycloid.disc_pitch 1", "cycloid.disc_pitch 2"), "15 N*m"
    )


def asked(sources: Sequence[str], torque: str, tolerance: str = "10 um") -> Question:
    """Processes of some sources, each with its harmonic behind it, in 40 units that are quiet."""
    tolerances = [
        rverror.tolerance(key, tolerance, **({"harmonic": int(harmonic)} if harmonic else {}))
        for key, _, harmonic in (source.partition(" ") for source in sources)
    ]
    theta, rng = TURN * np.arange(128) / 128, np.random.default_rng(0)
    runs = [
        rverror.run_from_arrays(
            input_angle=UNIT.ratio * theta,
            output_angle=theta + 0.02 * ARCSEC * rng.normal(size=128),
            direction=1.0,
            torque=torque,
        )
        for _ in range(40)
    ]
    amplitudes = amplitudes_of(Model(UNIT), [LotUnit(f"{n:03}", (run,)) for n, run in enumerate(runs)])
    return question_of(Model(UNIT), amplitudes, processes_of(Model(UNIT), runs[0], tolerances), 0)


def estimated(
    question: Question,
    true: State,
    seed: int,
    drawn: int = 100,
    fresh: int = 240,
    units: float = 200,
    start: State | None = None,
) -> LotEstimate:
    """Of a lot of 200 units, beginning with what is true, or for the first time with a start."""
    rng, count = np.random.default_rng(seed), len(question.simulator.parts.process)
    values = question.simulator.values(true, rng.standard_normal((200, count)))
    values = values + rng.standard_normal(values.shape)
    standard, others, further = (rng.standard_normal((n, count)) for n in (drawn, drawn, fresh))
    sample = replace(sample_of(values), units=units)
    matching = MomentMatching(
        question.simulator, sample, standard - standard.mean(axis=0), others, further, question.least, print
    )
    return matching.estimate(start or true, again=start is None)


def test_what_made_a_lot_is_told_where_most_pins_carry_nothing(question: Question) -> None:
    """By weights of units that vary much, those that hardly do fit any lot: a start from them must not win (here)."""
    made = np.array([2.5e-3 if p.key == PINS else 0.0 for p in question.simulator.parts.processes])
    true = State(np.maximum(made, question.least), np.zeros(COMPLIANCES))
    found = estimated(question, true, seed=1)
    assert np.all(np.abs(found.state.deviation**2 - made**2) < 4 * found.variance_error)
    assert found.chi_square < scipy.stats.chi2.isf(1e-4, found.freedom)
    assert not replace(found, chi_square=float(found.freedom)).poor  # as large as chance makes it in the mean
    assert replace(found, chi_square=2.5 * found.freedom).poor
    pins = question.simulator.parts.processes[0]
    assert pins.key == PINS
    assert found.state.deviation[0] == pytest.approx(2.5e-3, rel=0.3)


def test_mean_influences_size_what_moves_the_mean_of_units_solved_exactly(question: Question) -> None:
    """Noise of a mean influence is a regressor's error: of 100 units it took a fifth off the size of a shift."""
    made = [{PINS: 2.5e-3, "cycloid.disc_pitch": 1e-3}.get(p.key, 0.0) for p in question.simulator.parts.processes]
    found = estimated(question, State(np.maximum(made, question.least), np.zeros(COMPLIANCES)), seed=2, fresh=800)
    parts, rng = question.simulator.parts, np.random.default_rng(9)
    standard = rng.standard_normal((1000, len(parts.process)))
    before = question.simulator.values(found.state, standard)
    for at in range(0, len(parts.process), 16):
        more = standard.copy()
        more[:, at] += 0.3e-3 / found.state.deviation[parts.process[at]]
        moved = (question.simulator.values(found.state, more) - before).mean(axis=0)
        along = found.weight @ found.influence[:, at]
        assert along @ moved / (along @ found.influence[:, at]) == pytest.approx(0.3e-3, rel=0.1)


@dataclass(frozen=True)
class Solved:
    """Units of a state solved with shifts of their parts."""

    simulator: Simulator
    state: State
    standard: Array

    @cached_property
    def influence(self) -> Array:
        return self.simulator.draws(self.state, self.standard).influence

    def effects(self, sources: Sequence[ShiftSource], sizes: Sequence[Array], units: int) -> Array:
        shifts = [self.shift(one, some) for one, some in zip(sources, sizes, strict=True)]
        return self.simulator.shift_effects(self.state, self.standard[:units], np.array(shifts), self.influence)

    def covariance(self, source: ShiftSource, sizes: Array) -> Array:
        return self.of(self.shift(source, sizes))

    def uncertainty(self, *_: object) -> Array:
        return np.empty((0, len(self.influence)))

    def of(self, shift: Array | float = 0.0) -> Array:
        values = self.simulator.values(
            self.state, self.standard + shift / self.state.deviation[self.simulator.parts.process]
        )
        return np.asarray(np.cov(values.T) + np.eye(values.shape[1]))

    def shift(self, one: ShiftSource, sizes: Array) -> Array:
        return self.simulator.parts.shifted(one.key, one.indices, dict(zip(one.parameters, sizes, strict=True)))


class Linear:
    """Units that do nothing beyond influences, and scatter no more."""

    def __init__(self, covariance: Array) -> None:
        self.known = covariance

    def effects(self, sources: Sequence[ShiftSource], sizes: Sequence[Array], _: int) -> Array:
        return np.array([[[one.columns @ size, -one.columns @ size] for one, size in zip(sources, sizes, strict=True)]])

    def covariance(self, *_: object) -> Array:
        return self.known

    def uncertainty(self, *_: object) -> Array:
        return np.empty((0, len(self.known)))


@pytest.mark.parametrize("torque", ["60 N*m", "200 N*m"])
def test_a_large_shift_of_units_solved_exactly_is_told_with_its_size(torque: str) -> None:
    """A pitch 6 um off moves the ends of the loaded zone: influences tell second harmonics, where no disc has any."""
    simulator = asked(("cycloid.disc_pitch 1", "cycloid.disc_pitch 2", "crank.eccentricity"), torque).simulator
    parts, rng = simulator.parts, np.random.default_rng(5)
    state = State(np.array([1e-3, 1e-9, 1e-9]), np.zeros(COMPLIANCES))
    solved = Solved(simulator, state, rng.standard_normal((600, len(parts.process))))
    weight, influence = np.linalg.inv(solved.of()), solved.influence
    pitch = parts.shifted("cycloid.disc_pitch", {"disc": 0, "harmonic": 1}, {"cos": 6e-3})
    rows = simulator.errors(state, rng.standard_normal((80, len(parts.process))))
    soft = np.zeros(len(SOFTENING))
    values = np.array([simulator.linearised(row + pitch * (at % 2), soft)[0] for at, row in enumerate(rows)])
    values += rng.standard_normal(values.shape) - values.mean(axis=0)
    labels, candidates = {"machine": ("A", "B") * 40}, candidates_of(influence, parts)
    ((first, _), *_) = group_differences(values, labels, weight, candidates, shifted=Linear(np.linalg.inv(weight)))
    assert first.causes[0].indices["harmonic"] == 2
    ((found, _),) = group_differences(values, labels, weight, candidates, shifted=solved)
    cause, size = found.causes[0], {one.parameter: one.size for one in found.causes}
    assert (cause.key, cause.indices["harmonic"]) == ("cycloid.disc_pitch", 1)
    assert found.rivals == (f"cycloid.disc_pitch (disc {1 - int(cause.indices['disc'])}, harmonic 1)",)
    own = 6e-3 if cause.indices["disc"] == 0 else -6e-3  # the mirror image, beside it, has the other sign
    assert own in size["cos"]
    assert "sin" not in size or 0.0 in size["sin"]
    assert 0.0 not in size["cos"]


@pytest.mark.parametrize(("torque", "size"), [("60 N*m", 10e-3), ("412 N*m", 6e-3)])
def test_a_large_drift_of_units_solved_exactly_is_told_with_its_beginning(torque: str, size: float) -> None:
    """At 412 N m half of the drift does a thirtieth of the whole in chi-square, and units with it scatter eight times
    as much in one direction.  As a square, by the scatter of units without it, both begin 17 and 25 units off."""
    sources = (PINS, "cycloid.disc_pitch 1", "cycloid.disc_pitch 2", "crank.eccentricity")
    simulator = asked(sources, torque).simulator
    parts, rng = simulator.parts, np.random.default_rng(5)
    state = State(np.array([2.2e-3, 1.4e-3, 1e-9, 1.7e-3]), np.zeros(COMPLIANCES))
    solved = Solved(simulator, state, rng.standard_normal((800, len(parts.process))))
    weight, influence = np.linalg.inv(solved.of()), solved.influence
    pitch = parts.shifted("cycloid.disc_pitch", {"disc": 0, "harmonic": 1}, {"cos": size})
    serials, rng = [f"{number:03d}" for number in range(160)], np.random.default_rng(2)
    first = int(rng.uniform(0.3, 0.7) * len(serials))
    drift = course("ramp", first, len(serials), len(serials))[:, None] * pitch
    standard = rng.standard_normal((len(serials), len(parts.process))) + drift / state.deviation[parts.process]
    values = simulator.values(state, standard)
    values += rng.standard_normal(values.shape) - values.mean(axis=0)
    ((found, _), *_) = changes_over_serial(values, serials, weight, candidates_of(influence, parts), shifted=solved)
    cause = found.cause
    assert (cause.key, cause.indices["harmonic"], found.course) == ("cycloid.disc_pitch", 1, "ramp")
    assert (size if cause.indices["disc"] == 0 else -size) in cause.size
    assert found.since_interval[0] <= serials[first] <= found.since_interval[1]
    assert abs(int(found.since) - first) <= 10


def test_the_covariance_with_a_shift_is_that_of_the_shifted_units(question: Question) -> None:
    """Noise included, and of one order to the letter: each unit by its own equilibrium."""
    simulator, state = question.simulator, State(np.full(len(question.simulator.parts.processes), 1e-3))
    rng, count = np.random.default_rng(4), len(simulator.parts.process)
    standard, others, fresh = (rng.standard_normal((n, count)) for n in (30, 30, 40))
    sample = sample_of(simulator.values(state, standard))
    matching = MomentMatching(simulator, sample, standard, others, fresh, question.least, print)
    shift = simulator.parts.shifted("cycloid.disc_pitch", {"disc": 1, "harmonic": 1}, {"sin": 8e-3})
    rows, soft = simulator.errors(state, fresh), np.zeros(len(SOFTENING))
    expected = np.cov([simulator.linearised(row + shift, soft)[0] for row in rows], rowvar=False)
    found = matching.covariance_with(state, shift) - np.eye(len(expected))
    same = simulator.amplitudes.same_order
    np.testing.assert_allclose(found[same], expected[same], atol=1e-6 * expected.max())
    assert (
        np.abs(matching.covariance_with(state, -shift) - np.eye(len(expected)) - expected).max() > 0.01 * expected.max()
    )


def test_how_well_a_process_is_known_to_vanish_is_no_matter_of_what_is_drawn_in_its_place(question: Question) -> None:
    """None has no slope and is drawn as small: half as large, its interval ends no nearer to none."""
    made = [{PINS: 2.5e-3, "crank.eccentricity": 1e-3}.get(p.key, 0.0) for p in question.simulator.parts.processes]
    radius = [p.key for p in question.simulator.parts.processes].index("cycloid.pin_radius")
    ends = []
    for part in (question, replace(question, least=question.least / 2)):
        found = estimated(part, State(np.maximum(made, part.least), np.zeros(COMPLIANCES)), seed=4)
        assert found.state.deviation[radius] < 4 * part.least[radius]
        ends.append(interval(float(found.state.deviation[radius] ** 2), float(found.variance_error[radius]))[1])
    assert ends[1] > 0.7 * ends[0]


def test_a_fit_that_begins_with_the_wrong_process_does_not_end_there() -> None:
    """Disc pitch alone, where cams and a profile are more likely: one step after another only makes it larger."""
    sources = ("crank.eccentricity", "cycloid.disc_pitch 1", "cycloid.disc_profile 1", "cycloid.disc_bore_position")
    question = asked(sources, "60 N*m")
    key = [p.key for p in question.simulator.parts.processes]
    sizes = {"crank.eccentricity": 1.8e-3, "cycloid.disc_pitch": 1.5e-3, "cycloid.disc_profile": 0.7e-3}
    made, begun = ([some.get(one, 0.0) for one in key] for some in (sizes, {"cycloid.disc_pitch": 1.5e-3}))
    true, start = (State(np.maximum(some, question.least), np.zeros(COMPLIANCES)) for some in (made, begun))
    found = estimated(question, true, seed=1, drawn=160, fresh=400, start=start)
    assert not found.poor
    assert found.state.deviation[key.index("cycloid.disc_pitch")] < 2e-3


def test_chance_of_a_difference_of_likelihoods_is_what_lots_and_drawn_units_make() -> None:
    """Two covariances of twelve amplitudes: how much deviances differ over 200 lots of the first, each with drawn units
    of its own, against what each pair tells of itself, two standard errors."""
    rng, d = np.random.default_rng(6), 12
    roots = [np.diag(np.linspace(0.5, 2.0, d)), np.diag(np.linspace(0.5, 2.0, d) * np.linspace(1.15, 0.85, d))]

    def told(sample: Sample, root: Array) -> Likelihood:
        return Likelihood.of(sample, rng.standard_normal((600, d)) @ root, lambda some: np.asarray(np.cov(some.T)))

    differences, chances = [], []
    for _ in range(200):
        lot = rng.standard_normal((100, d)) @ roots[0] + rng.standard_normal((100, d))
        one, other = (told(sample_of(lot), root) for root in roots)
        above, chance = other.above(one)
        differences.append(above)
        chances.append(chance)
    made, none = (np.square(root) + np.eye(d) for root in roots)
    expected = np.trace(np.linalg.solve(none, made)) - d + np.linalg.slogdet(none)[1] - np.linalg.slogdet(made)[1]
    assert np.mean(differences) == pytest.approx(100 * expected, abs=4 * np.std(differences) / math.sqrt(200))
    ratio = math.sqrt(np.mean(np.square(chances))) / 2 / np.std(differences)
    assert 1.0 < ratio < 1.5  # a jackknife's variance is too large in the mean (Efron, Stein 1981)


def test_an_interval_holds_what_a_state_as_likely_has(question: Question) -> None:
    """Of two states one without the pins, the other without the disc's pitch, either may be none."""
    key = [p.key for p in question.simulator.parts.processes]
    pins, pitch = key.index(PINS), key.index("cycloid.disc_pitch")
    known, none = np.eye(len(key) + COMPLIANCES) * 1e-14, np.full(len(key), 1e-9)
    blank: Any = dict.fromkeys(("draws", "influence", "weight"))  # no interval asks for these
    one, other = (
        LotEstimate(State(np.where(np.arange(len(key)) == at, size, none)), known, 1.0, 1, **blank)
        for at, size in ((pins, 2e-3), (pitch, 1e-3))
    )
    assert one.interval(pins)[0] > 1.8e-3
    both = replace(one, others=(other,))
    assert both.interval(pins) == (0.0, one.interval(pins)[1])
    assert both.interval(pitch) == (0.0, other.interval(pitch)[1])


def test_states_within_the_errors_are_those_that_the_covariance_has() -> None:
    """Of variances, none of which is negative, and of logarithms of compliances, which go together."""
    rng = np.random.default_rng(8)
    root = (
        rng.standard_normal((2 + COMPLIANCES, 2 + COMPLIANCES)) * np.r_[1e-7, 1e-6, np.full(COMPLIANCES, 0.1)][:, None]
    )
    state = State(np.array([3e-3, 1e-6]), np.linspace(-0.2, 0.2, COMPLIANCES))
    blank: Any = dict.fromkeys(("draws", "influence", "weight"))  # not asked for
    found = LotEstimate(state, root @ root.T, 1.0, 1, **blank).states_within(4000, rng)
    rows = np.array([[one.deviation[0] ** 2, *one.compliance] for one in found])
    known = np.delete(np.delete(root @ root.T, 1, 0), 1, 1)
    size = np.sqrt(np.diag(known))
    np.testing.assert_allclose((rows.mean(axis=0) - [9e-6, *state.compliance]) / size, 0.0, atol=4 / 4000**0.5)
    np.testing.assert_allclose(np.cov(rows.T) / np.outer(size, size), known / np.outer(size, size), atol=0.1)
    assert np.mean([one.deviation[1] == 0 for one in found]) == pytest.approx(0.5, abs=0.05)


def test_what_another_fit_has_more_of_is_told_where_it_is_none_here() -> None:
    """Shares of the variance, not of the noise: 2 um at 3 per um with a noise of 1, and 1 um at 1 per um with 4."""
    squares, noise = np.array([np.diag([9.0, 0.0]), np.diag([0.0, 1.0])]), np.array([1.0, 4.0])
    draws = Draws(np.empty((1, 2)), np.empty((1, 2, 2)), np.empty((1, 6, 2)), np.empty((2, 2)), squares)

    def told(first: float, second: float, *others: LotEstimate) -> LotEstimate:
        state, known = State(np.array([first, second])), 1e-4 * np.eye(2 + COMPLIANCES)
        return LotEstimate(state, known, 1.0, 1, draws, draws.influence, np.eye(2), others)

    np.testing.assert_allclose(told(2.0, 1.0).shares(noise), [0.9, 0.1], rtol=1e-12)
    without = told(2.0, 1e-3)
    assert told(2.0, 1e-3, told(1e-3, 1.0), told(1.5, 1.0), without).more_elsewhere(noise) == [1]
    assert told(1e-3, 1.0, without).more_elsewhere(noise) == [0]
    assert told(2.0, 1.0, told(1.0, 2.0)).more_elsewhere(noise) == []  # either is above zero in both


def test_no_variance_is_known_worse_than_by_its_prior(question: Question) -> None:
    """Minus twice the logarithm of it is v / w^2, w a workshop's deviation: an exponential.  One unit has no
    covariance; its mean says next to nothing of some processes."""
    found = estimated(question, State(question.least, np.zeros(COMPLIANCES)), seed=3, units=1 + 1e-12)
    workshop = np.array([process.plausible for process in question.simulator.parts.processes])
    known = found.variance_error / scipy.stats.expon(scale=2 * workshop**2).std()
    assert 0.9 < known.max() < 1


def test_how_well_a_linear_process_is_known_to_vanish_is_what_fisher_says() -> None:
    """An eccentric encoder is one wave a turn, a / sqrt 2 in cosine and sine, in units of the noise.  U units inform on
    its variance by U a^4 / 4; the drawn ones, with which they are compared, are n."""
    question = asked(["sensor.encoder_eccentricity"], "60 N*m", "10 arcsec")
    drawn, none = 400, State(question.least, np.zeros(COMPLIANCES))
    found = estimated(question, none, seed=1, drawn=drawn, fresh=4000)
    few = question.simulator.amplitudes
    wave = few.noise.reshape(2, -1)[:, list(few.orders).index(1)].mean() ** -0.5
    known = float(found.variance_error[0]) / (2 / wave**2 * (1 / 199 + 1 / drawn) ** 0.5)
    assert known == pytest.approx(1.0, abs=0.1)


def test_a_process_may_be_as_large_as_units_solved_exactly_say(question: Question) -> None:
    """Beside pins of 2.5 um at this load units change with the radii by less than a tenth of what influences at none
    say, by which none of four lots allows more than 0.15 um."""
    key = [p.key for p in question.simulator.parts.processes]
    at, made = key.index("cycloid.pin_radius"), [2.5e-3 * (one == PINS) for one in key]
    found = estimated(question, State(np.maximum(made, question.least), np.zeros(COMPLIANCES)), seed=1)
    standard = np.random.default_rng(7).standard_normal((200, len(question.simulator.parts.process)))
    size = 0.5e-3 * (np.arange(len(key)) == at)
    none, plus, minus = (np.cov(some.T) for some in question.simulator.raised(found.state, standard, size)[0])
    said = found.draws.squares[at] * size[at] ** 2
    form = found.weight @ said @ found.weight
    assert np.sum(form * ((plus + minus) / 2 - none)) < 0.1 * np.sum(form * said)
    assert interval(float(found.state.deviation[at] ** 2), float(found.variance_error[at]))[1] > 0.3e-3


def test_a_raised_process_has_its_draws_with_either_sign(question: Question) -> None:
    """Of a small size the changes are opposite, and as influences say."""
    key = [p.key for p in question.simulator.parts.processes]
    at, made = key.index("crank.eccentricity"), [1e-3 * (one == "cycloid.disc_pitch") for one in key]
    parts, state = question.simulator.parts, State(np.array(made), np.zeros(COMPLIANCES))
    standard = np.random.default_rng(3).standard_normal((4, len(parts.process)))
    size = 1e-7 * (np.arange(len(key)) == at)
    none, plus, minus = question.simulator.raised(state, standard, size)[0]
    said = question.simulator.draws(state, standard).by_process[:, at] * size[at]
    np.testing.assert_allclose(plus - none, said, atol=0.01 * np.abs(said).max())
    np.testing.assert_allclose(minus - none, -said, atol=0.01 * np.abs(said).max())


def test_statistics_are_made_of_other_units_than_those_they_are_compared_with(question: Question) -> None:
    """A form that holds a unit's own influences is larger for that unit: at 60 N m sizes were two errors too large."""
    true = State(np.maximum(2.5e-3 * np.eye(1, 5)[0], question.least), np.zeros(COMPLIANCES))
    rng, count = np.random.default_rng(1), len(question.simulator.parts.process)
    values = question.simulator.values(true, rng.standard_normal((60, count)))
    sample = sample_of(values + rng.standard_normal(values.shape))
    standard, *others = rng.standard_normal((3, 30, count))
    fresh = rng.standard_normal((60, count))
    one, other = (
        MomentMatching(question.simulator, sample, standard, some, fresh, question.least, print).estimate(
            true, again=True
        )
        for some in others
    )
    assert one.chi_square != other.chi_square
    for found in (one, other):
        np.testing.assert_array_equal(
            found.draws.values, question.simulator.draws(found.state, standard).values
        )  # fmt: skip
