"""Lost motion between runs of one zero, against lags worked out by hand."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

import rverror
from rverror.base.units import ARCSEC
from rverror.diagnosis.harmonics.fit import joint_fit
from rverror.diagnosis.harmonics.runs import FitRun, fit_run
from rverror.diagnosis.harmonics.zeros import backlash_lost_motion, lost_motion_notes, with_shared_zeros
from rverror.diagnosis.policy import POLICY
from rverror.diagnosis.result import Diagnosis
from rverror.geartrain.kinematics import Conditions
from rverror.model.effects import Model, effect
from rverror.runs.virtual_bench import coloured_noise
from rverror.statics.loaded_state import equilibrium
from rverror.statics.prediction import Predictor

Array = np.ndarray
UNIT = rverror.reducer("RV-40E")
MODEL = Model(UNIT)
POINTS, TURNS = 256, 3
#: 5 um of play in the carrier bearings: the carrier lags by play over crank circle, each way, without any ripple.
PLAY = 5e-3
LAG = PLAY / 27


@cache
def wave(direction: float, torque: float) -> Array:
    """Transmission error of the unit over one turn: its windup and backlash, and what its meshes make."""
    theta = 2 * np.pi * np.arange(POINTS) / POINTS
    return equilibrium(MODEL, theta, torque=torque, direction=direction).transmission_error


def bench_run(
    direction: float, torque: float, *, lag: float = 0.0, index: str = "A", told: bool = True, seed: int = 0
) -> rverror.Run:
    """Three turns with the bench's noise; the output lags behind the motion by an angle more than the unit's own."""
    rng = np.random.default_rng([seed, direction > 0, int(torque)])
    theta = 2 * np.pi * np.arange(TURNS * POINTS) / POINTS
    noise = coloured_noise(theta.size, rms=0.44 * ARCSEC, step=1.0, correlation=4.5, random=rng)
    noise = noise + 0.22 * ARCSEC * rng.standard_normal(theta.size)
    error = np.tile(wave(direction, torque), TURNS) - direction * lag + noise
    back = slice(None, None, int(direction))
    return rverror.run_from_arrays(
        input_angle=UNIT.ratio * theta[back],
        output_angle=(theta + error)[back],
        direction="forward" if direction > 0 else "reverse",
        torque=torque if told else None,
        index=index,
    )


def both_ways(torques: Sequence[float] = (20e3,), **options: Any) -> list[rverror.Run]:
    return [bench_run(way, torque, **options) for torque in torques for way in (1.0, -1.0)]


def diagnosed(runs: Sequence[rverror.Run], keys: Sequence[str] = ()) -> Diagnosis:
    return rverror.diagnose(MODEL, runs, policy=replace(POLICY, keys=tuple(keys)))


def named(found: Diagnosis) -> list[set[str]]:
    """Keys that each addition may be."""
    return [{a.effect.key, *(key for key, _ in a.indistinguishable)} for a in found.added]


# --- what the model knows of a lost motion ------------------------------------------------------------------------


@pytest.mark.parametrize("changes", [{}, {"gear_backlash": "35 um"}, {"module": 2, "planet_teeth": 36}])
def test_backlash_makes_the_lost_motion_of_the_unloaded_gear_train(changes: dict[str, Any]) -> None:
    """Without load nothing winds up: what is left between the two directions is the gears' play."""
    unit = rverror.reducer("RV-40E", **changes) if "module" not in changes else rverror.reducer("RV-003", **changes)
    theta = np.array([0.3, 1.1, 2.0])
    ahead, behind = (equilibrium(Model(unit), theta, torque=0, direction=d).transmission_error for d in (1, -1))
    np.testing.assert_allclose(behind - ahead, backlash_lost_motion(unit), rtol=1e-6)


def fit_runs(values: Array, torque: float | None = 20e3) -> list[FitRun]:
    theta = 2 * np.pi * np.arange(values.shape[-1]) / values.shape[-1]
    return [
        fit_run(f"run {i}", Predictor(UNIT, Conditions(theta, way, torque)), values)
        for i, way in enumerate((1.0, -1.0))
    ]


def test_a_lost_motion_is_unknown_by_half_of_the_backlash_and_a_twentieth_of_the_windup() -> None:
    """Quiet runs: the variance of the difference of their means is what the model does not know, written out."""
    rng = np.random.default_rng(0)
    for periods, torque in ((2, 20e3), (5, 20e3), (3, 400e3)):
        runs, notes = with_shared_zeros(UNIT, fit_runs(1e-9 * rng.normal(size=(periods, 64)), torque), ["A", "A"])
        assert notes == []
        theta = np.array([0.3, 1.1, 2.0])
        ways = [equilibrium(MODEL, theta, torque=torque, direction=d).transmission_error.mean() for d in (1, -1)]
        backlash = 0.02 / (121 * 6.75 * math.cos(math.radians(20)))
        windup = ways[1] - ways[0] - backlash
        assert 1 < windup / (30 * ARCSEC * torque / 20e3) < 2.5
        variance = sum(run.mean_variance / run.periods for run in runs)
        expected = (POLICY.backlash_share * backlash) ** 2 + (POLICY.windup_share * windup) ** 2
        assert variance == pytest.approx(expected, rel=1e-3)
    assert (POLICY.backlash_share, POLICY.windup_share) == (1 / 2, 1 / 20)


def test_a_zero_that_wanders_counts_as_it_wanders() -> None:
    """The means of the turns scatter far more than noise within a turn could make them."""
    rng = np.random.default_rng(1)
    wander = 20 * ARCSEC
    values = wander * rng.normal(size=(200, 1)) + 0.1 * ARCSEC * rng.normal(size=(200, 64))
    runs, _ = with_shared_zeros(UNIT, fit_runs(values), ["A", "A"])
    quiet, _ = with_shared_zeros(UNIT, fit_runs(values - values.mean(axis=1, keepdims=True)), ["A", "A"])
    assert runs[0].mean_variance - quiet[0].mean_variance == pytest.approx(wander**2, rel=4 / math.sqrt(100))


def test_labels_of_one_run_or_without_torque_share_nothing() -> None:
    values = ARCSEC * np.random.default_rng(2).normal(size=(3, 64))
    first, second = fit_runs(values)
    (bare, _) = fit_runs(values, None)
    runs, notes = with_shared_zeros(UNIT, [first, second], ["", ""])
    assert (runs, notes) == ([first, second], [])
    runs, notes = with_shared_zeros(UNIT, [first, second, bare], ["A", "A", "A"])
    assert [run.zero for run in runs] == ["A", "A", ""]
    assert runs[2] is bare
    assert len(notes) == 1
    for word in (bare.name, "index A", "output_torque"):
        assert word in notes[0]


# --- the diagnosis ------------------------------------------------------------------------------------------------


def test_play_of_the_carrier_bearings_is_found_by_the_zero_alone() -> None:
    """38.2 arcsec each way and no ripple at all: where runs have zeros of their own, there is nothing to see."""
    found = diagnosed(both_ways(lag=LAG))
    assert found.verdict == "explained"
    (names,) = named(found)
    assert {"coupling.bearing_clearance", "load.torsion"} <= names  # one load cannot tell play from a spring
    assert found.added[0].orders == ()
    assert found.after.heldout_rms == pytest.approx(found.before.heldout_rms, rel=0.05)  # offsets are no residual
    apart = diagnosed(both_ways(lag=LAG, index=""))
    assert (apart.verdict, apart.added) == ("nothing_missing", ())
    other_ways = diagnosed([bench_run(1.0, 20e3, lag=LAG, index="A"), bench_run(-1.0, 20e3, lag=LAG, index="B")])
    assert (other_ways.verdict, other_ways.added) == ("nothing_missing", ())


def test_its_size_is_known_to_what_the_backlash_and_the_windup_leave() -> None:
    """Fitted alone: the lag is c / r6 each way, so the size is half of the difference of the means times r6."""
    runs = both_ways(lag=LAG)
    theta = 2 * np.pi * np.arange(POINTS) / POINTS
    cut = [
        fit_run(
            f"run {i}",
            Predictor(UNIT, Conditions(theta, way, 20e3)),
            (run.output_angle - run.input_angle / UNIT.ratio)[:: int(way)].reshape(TURNS, POINTS),
        )
        for i, (run, way) in enumerate(zip(runs, (1.0, -1.0), strict=True))
    ]
    shared, _ = with_shared_zeros(UNIT, cut, ["A", "A"])
    play = effect("coupling.bearing_clearance", clearance=1e-3)
    fit = joint_fit(MODEL, (play,), shared)
    lost = wave(-1.0, 20e3).mean() - wave(1.0, 20e3).mean()
    backlash = backlash_lost_motion(UNIT)
    sigma = math.hypot(0.5 * backlash, 0.05 * (lost - backlash)) * 27 / 2
    assert math.sqrt(fit.covariance[-1, -1]) == pytest.approx(sigma, rel=0.02)
    assert fit.model.effects[-1].values[0] == pytest.approx(PLAY, abs=0.1 * sigma)
    alone = joint_fit(MODEL, (play,), cut)
    assert np.isinf(alone.covariance[-1, -1])
    notes = lost_motion_notes(shared, joint_fit(MODEL, (), shared), fit)
    assert len(notes) == 1
    measured, declared, added = (f"{size:.3g}" for size in ((lost + 2 * LAG) / ARCSEC, lost / ARCSEC, 113.2))
    for word in ("zero A", f"lost motion {measured}", f"model {declared}", f"added {added}"):
        assert word in notes[0]


def test_two_loads_tell_torsion_from_play() -> None:
    """A lag in proportion to the load is a spring, one that stays is play.  Among few candidates, for speed."""
    tried = ("coupling.bearing_clearance", "load.torsion", "involute.tooth_thinning", "crank.eccentricity")
    torques = (20e3, 100e3)
    compliance = ARCSEC / 1e3  # 1 arcsec/(N*m)
    springy = [run for torque in torques for run in both_ways((torque,), lag=compliance * torque)]
    found = diagnosed(springy, tried)
    assert found.verdict == "explained"
    assert named(found) == [{"load.torsion"}]
    estimate = found.added[0].estimates[0]
    assert estimate.low < compliance < estimate.high
    # 100 arcsec each way at the larger load, of whose windup of 157 a twentieth is unknown, and half of 5.38
    assert estimate.high - estimate.low == pytest.approx(2 * 1.96 * compliance * math.hypot(7.8, 2.7) / 200, rel=0.2)
    loose = diagnosed(both_ways(torques, lag=LAG), tried)
    (names,) = named(loose)
    assert "coupling.bearing_clearance" in names
    assert "load.torsion" not in names


@pytest.mark.parametrize("share", [-0.5, 0.5])
def test_a_worn_backlash_is_no_missing_effect(share: float) -> None:
    """Lost motion that differs by half of the backlash's 5.38 arcsec."""
    found = diagnosed(both_ways(lag=share * 5.38 * ARCSEC / 2))
    assert (found.verdict, found.added, found.unexplained) == ("nothing_missing", (), ())


@pytest.mark.parametrize(
    "runs",
    [
        pytest.param(lambda: [bench_run(1.0, 20e3, lag=LAG)], id="one run"),
        pytest.param(lambda: both_ways(lag=LAG, told=False), id="no torque"),
    ],
)
def test_a_label_that_tells_nothing_does_no_harm(runs: Any) -> None:
    found = diagnosed(runs())
    assert (found.verdict, found.added, found.unexplained) == ("nothing_missing", (), ())
