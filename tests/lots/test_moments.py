"""Simulated moments on lots that the model itself makes: what was made is told, whatever the estimate begins with."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy

import rverror
from gear_runs import TURN, UNIT
from rverror.base.arrays import Array
from rverror.base.units import ARCSEC
from rverror.lots.amplitudes import LotUnit, amplitudes_of
from rverror.lots.identifiable import Question, question_of
from rverror.lots.moments import LotEstimate, MomentMatching, Sample, sample_of
from rverror.lots.processes import processes_of
from rverror.lots.simulated import COMPLIANCES, State
from rverror.model.effects import Model

PINS = "cycloid.pin_position"


@pytest.fixture(scope="module")
def question() -> Question:
    """Five processes, of which two do nearly the same, at a load that leaves most pins of 2.5 um without any."""
    tolerances = [
        rverror.tolerance(key, "10 um", **more)
        for key, more in (
            (PINS, {}),
            ("cycloid.disc_pitch", {"harmonic": 1}),
            ("cycloid.disc_pitch", {"harmonic": 2}),
            ("crank.eccentricity", {}),
            ("cycloid.pin_radius", {}),
        )
    ]  # fmt: skip
    theta, rng = TURN * np.arange(128) / 128, np.random.default_rng(0)
    runs = [
        rverror.run_from_arrays(
            input_angle=UNIT.ratio * theta,
            output_angle=theta + 0.02 * ARCSEC * rng.normal(size=128),
            direction=1.0,
            torque="15 N*m",
        )
        for _ in range(40)
    ]
    amplitudes = amplitudes_of(Model(UNIT), [LotUnit(f"{n:03}", (run,)) for n, run in enumerate(runs)])
    return question_of(Model(UNIT), amplitudes, processes_of(Model(UNIT), runs[0], tolerances), 0)


def estimated(question: Question, true: State, seed: int, units: int = 200, drawn: int = 100) -> LotEstimate:
    rng, count = np.random.default_rng(seed), len(question.simulator.parts.process)
    values = question.simulator.values(true, rng.standard_normal((units, count)))
    values = values + rng.standard_normal(values.shape)
    standard, others = rng.standard_normal((2, drawn, count))
    matching = MomentMatching(
        question.simulator, sample_of(values), standard - standard.mean(axis=0), others, question.least, print
    )
    return matching.estimate(true, again=True)


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


def test_statistics_are_made_of_other_units_than_those_they_are_compared_with(question: Question) -> None:
    """A form that holds a unit's own influences is larger for that unit: at 60 N m sizes were two errors too large."""
    true = State(np.maximum(2.5e-3 * np.eye(1, 5)[0], question.least), np.zeros(COMPLIANCES))
    rng, count = np.random.default_rng(1), len(question.simulator.parts.process)
    values = question.simulator.values(true, rng.standard_normal((60, count)))
    sample = sample_of(values + rng.standard_normal(values.shape))
    standard, *others = rng.standard_normal((3, 30, count))
    one, other = (
        MomentMatching(question.simulator, sample, standard, some, question.least, print).estimate(true, again=True)
        for some in others
    )
    assert one.chi_square != other.chi_square
    for found in (one, other):
        drawn = question.simulator.draws(found.state, standard)
        assert found.draws.parts == pytest.approx(drawn.parts, rel=1e-12)
        # the last step, of less than a standard error, is of the first order
        assert found.draws.values == pytest.approx(drawn.values, abs=0.02 * drawn.values.std())


def test_what_a_linear_process_makes_is_known_without_chance(question: Question) -> None:
    """Of cams alone, all pins closed by a heavy load: thirty drawn units make the covariance of the process.

    That of thirty units' cams themselves is off by a tenth.
    """
    simulator, processes = question.simulator, question.simulator.parts.processes
    heavy = tuple(replace(one, torque=400 * one.torque) for one in simulator.amplitudes.conditions)
    simulator = replace(simulator, amplitudes=replace(simulator.amplitudes, conditions=heavy))
    cams = np.array([process.key == "crank.eccentricity" for process in processes])
    state, of = State(np.where(cams, 1e-3, 1e-9), np.zeros(COMPLIANCES)), simulator.parts.process
    rng, size = np.random.default_rng(3), simulator.scale.size
    sample = Sample(np.zeros(size), np.eye(size), 50)  # no more than noise
    others, *standard = rng.standard_normal((3, 30, len(of)))
    for some in standard:
        matching = MomentMatching(
            simulator, sample, some - some.mean(axis=0), others, 1e-12 * np.ones(len(cams)), print
        )
        drawn = simulator.draws(state, others)
        weights = matching._weights(drawn, matching._weight(state, drawn), both=True)
        distance = matching._distance(simulator.draws(state, matching.standard), state, weights)
        made = weights.control @ np.diag(state.deviation[of] ** 2) @ weights.control.T
        known = np.einsum("ade,de->a", weights.forms, made)[np.r_[cams, cams]]
        assert -distance.away[: 2 * len(cams)][np.r_[cams, cams]] == pytest.approx(known, rel=0.01)
        assert distance.slope[: 2 * len(cams), np.argmax(cams)][np.r_[cams, cams]] * 1e-6 == pytest.approx(
            known, rel=0.01
        )


def test_a_unit_is_weighed_as_many_more_units_would_have_it(question: Question) -> None:
    """Of fresh units the weight of forty says as much as that of two hundred, which their covariance alone tells."""
    simulator = question.simulator
    pins = np.array([process.key == PINS for process in simulator.parts.processes])
    state, rng = State(np.where(pins, 2.5e-3, question.least), np.zeros(COMPLIANCES)), np.random.default_rng(5)
    count, size = len(simulator.parts.process), simulator.scale.size
    fresh = [simulator.values(state, rng.standard_normal((200, count))) for _ in range(2)]
    others, noise = rng.standard_normal((40, count)), rng.standard_normal((200, size))
    matching = MomentMatching(simulator, sample_of(fresh[0]), others, others, question.least, print)
    drawn = simulator.draws(state, others)

    def told(weight: Array) -> float:
        left = fresh[0] - fresh[0].mean(axis=0) + noise
        return float(np.linalg.slogdet(weight)[1] - np.mean(np.einsum("ud,ud->u", left @ weight, left))) / 2

    found = told(matching._weight(state, drawn))
    many = told(np.linalg.inv(np.cov(fresh[1].T) + np.eye(size)))
    few = told(np.linalg.inv(np.cov(drawn.values.T) + np.eye(size)))
    assert found > many - 1
    assert found > few + 3
