"""Drift, ratio error and time offset against runs whose growth and noise are known."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import rverror
from rverror.base.units import ARCSEC
from rverror.diagnosis.samples.growing import Growth, growing_errors, growth_rows
from rverror.model.effects import Effect, Model, effect
from rverror.runs.spectrum import revolutions
from rverror.runs.virtual_bench import coloured_noise

Array = np.ndarray
UNIT = rverror.reducer("RV-40E")
MODEL = Model(UNIT)
POINTS = 256
TURN = 2 * np.pi
BOTH = (1.0, -1.0)
#: Noise of the bench, arcsec: a part that is correlated over 4.5 samples, and a white one.
COLOURED, WHITE, CORRELATION = 0.9 * 0.49, 0.44 * 0.49, 4.5


def angles(direction: float, turns: int, points: int = POINTS) -> Array:
    """Nominal output angles in the order of time."""
    return TURN * np.arange(turns * points)[:: int(direction)] / points


def clock(direction: float, turns: int, pace: float) -> Array:
    """Times of a run whose speed is pace / (1 + 0.4 cos(theta / 3)) rad/s, so that its turns differ."""
    theta = angles(direction, turns)
    time = (theta + 1.2 * np.sin(theta / 3)) / pace
    return np.abs(time - time[0])


def speed(direction: float, turns: int, pace: float) -> Array:
    """Its output speed, the derivative written out."""
    return direction * pace / (1 + 0.4 * np.cos(angles(direction, turns) / 3))


def run_of(error: Array, direction: float, *, time: Array | None = None, points: int = POINTS) -> rverror.Run:
    """Run whose transmission error is given in the order of time, rad."""
    theta = angles(direction, error.size // points, points)
    return rverror.run_from_arrays(
        input_angle=UNIT.ratio * theta,
        output_angle=theta + error,
        time=time,
        direction="forward" if direction > 0 else "reverse",
    )


@cache
def rows_of(direction: float, turns: int, pace: float) -> Mapping[str, Array]:
    """Influences along a run, which are those of every run on its angles."""
    time = clock(direction, turns, pace) if pace else None
    run = run_of(np.zeros(turns * POINTS), direction, time=time)
    theta = run.nominal_angle(UNIT.ratio)
    return growth_rows(UNIT, run, theta, partial(revolutions, theta))


def grown(errors: Sequence[Array], directions: Sequence[float], model: Model = MODEL, pace: float = 0.0) -> Growth:
    """Growth found in errors in the order of time, rad."""
    turns = [error.size // POINTS for error in errors]
    values = [error[:: int(d)].reshape(n, POINTS) for error, d, n in zip(errors, directions, turns, strict=True)]
    rows = [rows_of(d, n, pace) for d, n in zip(directions, turns, strict=True)]
    return growing_errors(model, [f"run {i}" for i in range(len(errors))], values, rows)


def bench_noise(rng: np.random.Generator, size: int) -> Array:
    coloured = coloured_noise(size, rms=COLOURED, step=1.0, correlation=CORRELATION, random=rng)
    return np.asarray((coloured + WHITE * rng.standard_normal(size)) * ARCSEC)


def slow_power() -> float:
    """Variance of the sum of many samples of that noise over their number: a geometric series of correlations."""
    rho = math.exp(-1 / CORRELATION)
    return (COLOURED**2 * (1 + rho) / (1 - rho) + WHITE**2) * ARCSEC**2


def ramp(size: int) -> Array:
    return np.linspace(0.0, 1.0, size)


def truth(key: str, direction: float, turns: int, pace: float) -> Array:
    """Error per unit of each source, written out, in the order of time."""
    if key == "sensor.drift":
        time = clock(direction, turns, pace) if pace else np.arange(turns * POINTS)
        return np.asarray(time / time[-1])
    if key == "sensor.ratio_error":
        return angles(direction, turns)
    return speed(direction, turns, pace)


def sizes(growth: Growth) -> dict[str, float]:
    return {addition.effect.key: addition.effect.values[0] for addition in growth.added}


# --- what repeats -------------------------------------------------------------------------------------------------


@given(seed=st.integers(0, 2**32 - 1), size=st.floats(1e-3, 3e4), turns=st.integers(2, 5))
def test_whatever_repeats_every_turn_changes_nothing(seed: int, size: float, turns: int) -> None:
    """Arbitrary samples, as large as degrees, different in each run: the sizes move by rounding alone."""
    rng = np.random.default_rng(seed)
    count = turns * POINTS
    declared = effect("sensor.ratio_error", slope="2 arcsec/turn", uncertainty="1 arcsec/turn")
    model = Model(UNIT, (declared,))
    errors = [bench_noise(rng, count) + (9 + d) * ARCSEC * ramp(count) for d in BOTH]
    waves = [np.tile(size * ARCSEC * rng.standard_cauchy(POINTS).clip(-9, 9), turns) for _ in BOTH]
    plain, lifted = grown(errors, BOTH, model), grown([e + w for e, w in zip(errors, waves, strict=True)], BOTH, model)
    assert list(sizes(plain)) == list(sizes(lifted))
    rounding = 1e-9 * (ARCSEC + max(float(abs(w).max()) for w in waves))
    for key, value in sizes(plain).items():
        assert sizes(lifted)[key] == pytest.approx(value, abs=rounding)
    assert lifted.declared[0].values[0] == pytest.approx(plain.declared[0].values[0], abs=rounding)


# --- sizes --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("key", "size", "turns", "pace"),
    [
        ("sensor.drift", 5 * ARCSEC, 3, 0.0),
        ("sensor.drift", -5 * ARCSEC, 3, 0.2),
        ("sensor.ratio_error", 0.5 * ARCSEC, 3, 0.0),
        ("sensor.ratio_error", -3 * ARCSEC, 2, 0.0),
        ("sensor.time_offset", 40 * ARCSEC, 3, 0.2),
    ],
)
def test_sizes_come_back_within_their_intervals(key: str, size: float, turns: int, pace: float) -> None:
    """A hundred units with the bench's noise: 95 % intervals hold the truth in 95 %, and are as wide as they must be.

    Between turns only what differs tells, so the standard deviation is that of a straight line through their means,
    for steps: noise of the mean over the root of the summed squares about the mean turn.
    """
    inside, off, claimed = [], [], []
    waves = [truth(key, d, turns, pace) for d in BOTH]
    for seed in range(100):
        rng = np.random.default_rng([seed, turns])
        growth = grown([size * wave + bench_noise(rng, wave.size) for wave in waves], BOTH, pace=pace)
        assert list(sizes(growth)) == [key]
        (estimate,) = growth.added[0].estimates
        inside.append(estimate.low < size < estimate.high)
        off.append(estimate.value - size)
        claimed.append((estimate.high - estimate.low) / 2 / 1.96)
    steps = [wave.reshape(turns, POINTS) - wave.reshape(turns, POINTS).mean(axis=0) for wave in waves]
    sigma = math.sqrt(slow_power() / sum(float((step**2).sum()) for step in steps))
    assert abs(np.mean(off)) < 4 * sigma / 10
    assert np.std(off) == pytest.approx(sigma, rel=4 / math.sqrt(200))
    assert np.mean(claimed) == pytest.approx(sigma, rel=0.12)
    # fewer than 87 or all 100 inside have a chance of 1e-3 and 6e-3
    assert 87 <= sum(inside) <= 99


def test_two_directions_tell_drift_from_ratio_error() -> None:
    """Drift grows with time, a ratio error with the angle: in reverse they part; in one direction nobody can tell."""
    turns, rng = 6, np.random.default_rng(4)
    for key, other in (("sensor.drift", "sensor.ratio_error"), ("sensor.ratio_error", "sensor.drift")):
        size = 20 * ARCSEC if key == "sensor.drift" else 20 / (TURN * turns) * ARCSEC
        errors = [size * truth(key, d, turns, 0.0) + bench_noise(rng, turns * POINTS) for d in BOTH]
        (both,) = grown(errors, BOTH).added
        assert both.effect.key == key
        assert both.indistinguishable == ()
        (alone,) = grown(errors[:1], BOTH[:1]).added
        named = {alone.effect.key, *(name for name, _ in alone.indistinguishable)}
        assert named == {key, other}


@pytest.mark.parametrize("slope", [-0.3, -2.0, -20.0])
def test_drift_and_ratio_error_together_are_both_found(slope: float) -> None:
    """As where each run drifts by an amount of its own: 6 and 18 arcsec, -26 and 50, -365 and 389."""
    turns, rng = 3, np.random.default_rng(5)
    errors = [
        12 * ARCSEC * truth("sensor.drift", d, turns, 0.0)
        + slope * ARCSEC * truth("sensor.ratio_error", d, turns, 0.0)
        + bench_noise(rng, turns * POINTS)
        for d in BOTH
    ]
    found = {a.effect.key: a.estimates[0] for a in grown(errors, BOTH).added}
    assert set(found) == {"sensor.drift", "sensor.ratio_error"}
    assert found["sensor.drift"].value == pytest.approx(12 * ARCSEC, abs=ARCSEC)
    assert found["sensor.ratio_error"].value == pytest.approx(slope * ARCSEC, abs=0.06 * ARCSEC)


@pytest.mark.parametrize("turns", [2, 3, 6])
def test_one_cause_is_not_split_between_two(turns: int) -> None:
    """One direction: drift and ratio error have one waveform, and both with half the size each would fit as well."""
    for seed in range(10):
        error = 40 * ARCSEC * ramp(turns * POINTS) + bench_noise(np.random.default_rng(seed), turns * POINTS)
        assert len(grown([error], (1.0,)).added) <= 1


def test_a_constant_speed_tells_nothing_of_a_time_offset() -> None:
    """It shifts the whole run, as the zero does."""
    turns, rng = 3, np.random.default_rng(6)
    values, rows = [], []
    for d in BOTH:
        time = np.arange(turns * POINTS) * 0.01
        error = 0.3 * d + 15 * ARCSEC * ramp(time.size) + bench_noise(rng, time.size)
        run = run_of(error, d, time=time)
        theta = run.nominal_angle(UNIT.ratio)
        values.append(revolutions(theta, run.error(UNIT.ratio)).values)
        rows.append(growth_rows(UNIT, run, theta, partial(revolutions, theta)))
    assert "sensor.time_offset" in rows[0]
    (added,) = growing_errors(MODEL, ["a", "b"], values, rows).added
    assert added.effect.key == "sensor.drift"
    assert added.effect.values[0] == pytest.approx(15 * ARCSEC, abs=ARCSEC)
    assert added.indistinguishable == ()


def test_a_run_without_times_keeps_the_time_offset_out() -> None:
    turns = 3
    rows = [rows_of(1.0, turns, 0.2), rows_of(-1.0, turns, 0.0)]
    errors = [40 * ARCSEC * truth("sensor.time_offset", 1.0, turns, 0.2), np.zeros(turns * POINTS)]
    values = [errors[0].reshape(turns, POINTS), errors[1].reshape(turns, POINTS)]
    growth = growing_errors(MODEL, ["a", "b"], values, rows)
    assert "sensor.time_offset" not in growth.rows[0]
    assert "sensor.time_offset" not in sizes(growth)


# --- noise --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("turns", "directions"), [(3, BOTH), (2, BOTH), (3, (1.0,)), (2, (-1.0,))])
def test_noise_grows_nowhere(turns: int, directions: tuple[float, ...]) -> None:
    """At most 1 % of units with nothing missing may get an effect; by its own chance of 1e-3, none of 200 does."""
    wrong = 0
    for seed in range(200):
        rng = np.random.default_rng([seed, 7])
        wrong += bool(grown([bench_noise(rng, turns * POINTS) for _ in directions], directions).added)
    assert wrong <= 1


@pytest.mark.parametrize("turns", [3, 5])
def test_turns_that_wander_do_not_drift(turns: int) -> None:
    """The zero moves between turns, many times the noise of their means, at random: one in a hundred looks straight.

    Two sources compete, so up to 2 % are expected; more than 10 of 200 have a chance of 3e-3.
    """
    wrong = 0
    for seed in range(200):
        rng = np.random.default_rng([seed, 8])
        errors = [
            bench_noise(rng, turns * POINTS) + np.repeat(2 * ARCSEC * rng.normal(size=turns), POINTS) for _ in BOTH
        ]
        wrong += bool(grown(errors, BOTH).added)
    assert wrong <= 10


# --- declared -----------------------------------------------------------------------------------------------------


def through_the_steps(errors: Sequence[Array], waves: Sequence[Array], turns: int) -> tuple[float, float]:
    """Size of a source from what differs between turns, by plain least squares, and the summed squares of its steps."""
    product = squares = 0.0
    for error, wave in zip(errors, waves, strict=True):
        step = wave.reshape(turns, POINTS) - wave.reshape(turns, POINTS).mean(axis=0)
        product += float((error.reshape(turns, POINTS) * step).sum())
        squares += float((step**2).sum())
    return product / squares, squares


def test_a_declared_ratio_error_is_refitted_within_its_uncertainty() -> None:
    """As sure as the measurement: the fit stands halfway between declared and measured; surer or less, with one."""
    turns, noise, declared = 3, 0.5 * ARCSEC, 1.0 * ARCSEC
    waves = [truth("sensor.ratio_error", d, turns, 0.0) for d in BOTH]
    spread = noise / math.sqrt(through_the_steps(waves, waves, turns)[1])
    moved: dict[float, list[float]] = {0.01: [], 1.0: [], 100.0: []}
    off = []
    for seed in range(20):
        rng = np.random.default_rng([seed, 9])
        errors = [(declared + 2 * spread) * w + noise * rng.standard_normal(w.size) for w in waves]
        off.append(through_the_steps(errors, waves, turns)[0] - declared)
        for relative, found in moved.items():
            slope = effect("sensor.ratio_error", slope=declared, uncertainty=relative * spread)
            growth = grown(errors, BOTH, Model(UNIT, (slope,)))
            found.append(growth.declared[0].values[0] - declared)
            assert growth.added == ()
            assert growth.printed == (slope,)
            assert growth.declared[0].uncertainty == relative * spread
    shares = {relative: sum(found) / sum(off) for relative, found in moved.items()}
    # the noise's level in the spectrum, which weighs the two, is known to some 15 % in each unit
    assert shares == pytest.approx({0.01: 1e-4, 1.0: 0.5, 100.0: 1.0}, abs=0.03)


def test_what_is_declared_exact_stays_and_the_rest_is_found() -> None:
    turns, rng = 3, np.random.default_rng(10)
    exact = effect("sensor.drift", total="8 arcsec")
    errors = [20 * ARCSEC * ramp(turns * POINTS) + bench_noise(rng, turns * POINTS) for _ in BOTH]
    growth = grown(errors, BOTH, Model(UNIT, (exact,)))
    assert growth.declared == (exact,)
    assert sizes(growth)["sensor.drift"] == pytest.approx(12 * ARCSEC, abs=ARCSEC)
    enough = grown(errors, BOTH, Model(UNIT, (replace(exact, values=(20 * ARCSEC,)),)))
    assert enough.added == ()


def test_what_was_taken_off_and_what_is_missed_add_up() -> None:
    """Straight lines, written out: everything fitted, what was printed of it, and what the first addition leaves."""
    turns, rng = 3, np.random.default_rng(11)
    drift = effect("sensor.drift", total="8 arcsec", uncertainty="3 arcsec")
    waves = {key: [truth(key, d, turns, 0.0) for d in BOTH] for key in ("sensor.drift", "sensor.ratio_error")}
    errors = [10 * ARCSEC * a + 2 * ARCSEC * b + bench_noise(rng, a.size) for a, b in zip(*waves.values(), strict=True)]
    growth = grown(errors, BOTH, Model(UNIT, (drift,)))
    assert list(sizes(growth)) == ["sensor.ratio_error"]
    refitted, slope = growth.declared[0].values[0], sizes(growth)["sensor.ratio_error"]
    assert refitted == pytest.approx(10 * ARCSEC, abs=ARCSEC)
    for i, d in enumerate(BOTH):
        time, angle = (waves[key][i][:: int(d)].reshape(turns, POINTS) for key in waves)
        expected = {
            "all": (growth.fitted(), refitted * time + slope * angle),
            "printed": (growth.missed(), (refitted - 8 * ARCSEC) * time + slope * angle),
            "refitted": (growth.missed(0), slope * angle),
            "added": (growth.missed(1), 0 * angle),
        }
        for found, wanted in expected.values():
            np.testing.assert_allclose(found[i], wanted, rtol=0, atol=1e-6 * ARCSEC)


# --- the diagnosis ------------------------------------------------------------------------------------------------


CAM = effect("crank.eccentricity", crank=0, disc=0, radial="6 um", tangential="-4 um", uncertainty="0.3 um")


def diagnosis(effects: Sequence[Effect], drift: float, slope: float, seed: int = 0) -> Any:
    """Diagnosis of a unit without torque whose cam is as declared; drift in rad over a run, slope in rad per rad."""
    turns, rng = 3, np.random.default_rng([seed, 12])
    runs = []
    for d in BOTH:
        theta = angles(d, turns)
        te = rverror.transmission_error(Model(UNIT, (CAM,)), theta, direction=d)
        runs.append(run_of(te + drift * ramp(te.size) + slope * theta + bench_noise(rng, te.size), d))
    return rverror.diagnose(Model(UNIT, tuple(effects)), runs)


@pytest.fixture(scope="module")
def drifting() -> Any:
    return diagnosis((CAM,), 30 * ARCSEC, 0.0)


def test_diagnosis_names_the_drift_alone(drifting: Any) -> None:
    """What differs between turns would else be saw teeth of every low order, and noise."""
    assert drifting.verdict == "explained"
    (added,) = drifting.added
    assert added.effect.key == "sensor.drift"
    assert added.estimates[0].low < 30 * ARCSEC < added.estimates[0].high
    assert drifting.unexplained == ()
    assert drifting.noise_rms == pytest.approx(0.49 * ARCSEC, rel=0.15)


def test_before_holds_the_growth_and_after_does_not(drifting: Any) -> None:
    """A line of total T over three turns: variance T^2 / 12; each turn beside the mean of the others, worked out.

    The turns stand at -T/3, 0 and T/3 of the middle one, so against the mean of the two others at -T/2, 0 and T/2;
    within a turn the line's variance is (T/3)^2 / 12.
    """
    total, noise = 30 * ARCSEC, 0.49 * ARCSEC
    assert drifting.before.rms == pytest.approx(math.hypot(total / math.sqrt(12), noise), rel=0.03)
    left_out = math.sqrt(total**2 * (1 / 6 + 1 / 108) + noise**2)
    assert drifting.before.heldout_rms == pytest.approx(left_out, rel=0.03)
    assert drifting.before.peak_to_peak == pytest.approx(total, rel=0.2)
    assert drifting.after.rms == pytest.approx(noise, rel=0.15)
    assert drifting.after.heldout_rms == pytest.approx(noise, rel=0.2)
    assert drifting.added[0].heldout_rms == pytest.approx(drifting.after.heldout_rms, rel=0.01)


def test_before_refitted_lacks_what_was_not_declared(drifting: Any) -> None:
    """Declared sizes refitted explain no drift: only the model with what was added does."""
    assert drifting.before_refitted.heldout_rms == pytest.approx(drifting.before.heldout_rms, rel=0.01)


def test_the_model_keeps_declared_errors_in_their_places() -> None:
    slope = effect("sensor.ratio_error", slope="0.4 arcsec/turn", uncertainty="2 arcsec/turn")
    drift = effect("sensor.drift", total="5 arcsec")
    bore = effect("coupling.carrier_bore_position", crank=1, radial="2 um", tangential="1 um")
    found = diagnosis((slope, CAM, drift, bore), 5 * ARCSEC, 1.5 / TURN * ARCSEC)
    assert found.verdict == "nothing_missing"
    assert found.declared.effects == (slope, CAM, drift, bore)
    assert [e.key for e in found.model.effects] == [e.key for e in found.declared.effects]
    assert [e.uncertainty for e in found.model.effects] == [e.uncertainty for e in found.declared.effects]
    assert found.model.effects[0].values[0] == pytest.approx(1.5 / TURN * ARCSEC, abs=0.2 / TURN * ARCSEC)
    assert found.model.effects[2:] == (drift, bore)
    assert found.before.heldout_rms > 1.2 * found.before_refitted.heldout_rms
    assert found.after.rms == pytest.approx(0.49 * ARCSEC, rel=0.15)


def test_what_grows_goes_first_among_what_was_added() -> None:
    """An undeclared cam beside an undeclared ratio error: the model is the declared one, then both."""
    found = diagnosis((), 0.0, 3 * ARCSEC)
    assert [a.effect.key for a in found.added] == ["sensor.ratio_error", "crank.eccentricity"]
    assert [(e.key, e.values) for e in found.model.effects] == [(a.effect.key, a.effect.values) for a in found.added]
    assert found.before.heldout_rms > found.added[0].heldout_rms > found.added[1].heldout_rms
    assert found.added[1].heldout_rms == pytest.approx(0.49 * ARCSEC, rel=0.2)
    assert found.added[1].effect.values == pytest.approx(CAM.values, abs=0.5e-3)
