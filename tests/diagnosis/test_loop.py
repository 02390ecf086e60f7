"""The closed loop on the virtual test-bench units: their truth was made by an equilibrium that is not rverror's."""

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import rverror
from recordings import bench
from rverror.base.units import ARCSEC
from rverror.diagnosis.policy import POLICY
from rverror.diagnosis.result import Diagnosis


@pytest.fixture(scope="module")
def diagnosed() -> Any:
    """Diagnose each unit at most once."""
    done: dict[int, Diagnosis] = {}

    def unit(number: int) -> Diagnosis:
        folder = bench(f"train-{number}")
        if number not in done:
            model = rverror.load_model(folder / "model.toml")
            runs = [rverror.load_run(folder / f"{name}.csv", model) for name in ("forward", "reverse")]
            done[number] = rverror.diagnose(model, runs)
        return done[number]

    return unit


def truth(number: int) -> dict[str, Any]:
    text = bench(f"train-{number}", "truth.json").read_text(encoding="utf-8")
    return dict(json.loads(text))


@pytest.mark.parametrize("number", range(1, 7))
def test_noise_is_that_of_the_bench(diagnosed: Any, number: int) -> None:
    found = diagnosed(number)
    assert found.noise_rms / ARCSEC == pytest.approx(truth(number)["noise_rms_arcsec"], rel=0.05)
    assert found.before.heldout_rms >= 0.999 * found.before_refitted.heldout_rms >= 0.99 * found.after.heldout_rms


def test_encoder_eccentricity_is_found_with_its_size(diagnosed: Any) -> None:
    found = diagnosed(1)
    assert found.verdict == "explained"
    assert [a.effect.key for a in found.added] == ["sensor.encoder_eccentricity"]
    size = math.hypot(4.1, -2.7) * ARCSEC
    cos, sin = found.added[0].estimates
    assert math.hypot(cos.value, sin.value) == pytest.approx(size, rel=0.02)
    assert math.hypot(cos.value - 4.1 * ARCSEC, sin.value + 2.7 * ARCSEC) < 0.02 * size
    assert cos.low < 4.1 * ARCSEC < cos.high
    assert sin.low < -2.7 * ARCSEC < sin.high
    assert found.before.heldout_rms / ARCSEC == pytest.approx(3.8, abs=0.1)
    assert found.after.heldout_rms / ARCSEC < 0.6
    assert found.added[0].orders == (1.0,)


@pytest.mark.parametrize("number", [2, 3, 5])
def test_a_part_error_is_named(diagnosed: Any, number: int) -> None:
    """Contacts open here."""
    found = diagnosed(number)
    declared = truth(number)["undeclared"][0]
    indices = {k: v for k, v in declared.items() if isinstance(v, int)}
    sets = [[(a.effect.key, dict(a.effect.indices)), *a.indistinguishable] for a in found.added]
    assert all((declared["key"], indices) in names for names in sets)
    assert len(sets) == 1
    assert found.verdict == "explained"
    assert found.after.heldout_rms < 1.15 * truth(number)["noise_rms_arcsec"] * ARCSEC
    for estimate in found.added[0].estimates:
        size = float(declared[estimate.name].split()[0]) * 1e-3
        # of some six intervals of 95 % one may miss: four standard deviations are a chance of 4e-4
        assert abs(estimate.value - size) < 2.04 * (estimate.high - estimate.low) / 2


def test_nothing_missing_is_a_result(diagnosed: Any) -> None:
    found = diagnosed(4)
    assert found.verdict == "nothing_missing"
    assert found.added == ()
    assert found.unexplained == ()
    assert found.after == found.before_refitted


def test_order_outside_the_catalogue_stays_unexplained(diagnosed: Any) -> None:
    found = diagnosed(6)
    assert found.verdict == "unexplained"
    assert found.added == ()
    line = found.unexplained[0]
    assert line.order == 36
    assert line.frames == ()
    assert line.low < math.hypot(1.9, 1.1) * ARCSEC < line.high
    assert line.cos / ARCSEC == pytest.approx(1.9, abs=0.05)
    assert line.sin / ARCSEC == pytest.approx(1.1, abs=0.05)


def test_the_wave_of_a_line_counts_from_the_zero_of_the_bench() -> None:
    """Runs that start anywhere: cosine and sine are those of the output angle."""
    unit = rverror.reducer("RV-40E")
    theta = 0.7 + 2 * np.pi * np.arange(3 * 512) / 512
    noise = 0.2 * np.random.default_rng(4).standard_normal(theta.size)
    error = (3 * np.cos(36 * theta) - 2 * np.sin(36 * theta) + noise) * ARCSEC
    run = rverror.run_from_arrays(input_angle=unit.ratio * theta, output_angle=theta + error, direction="forward")
    few = replace(POLICY, keys=("sensor.encoder_eccentricity",))
    line = rverror.diagnose(rverror.Model(unit), [run], policy=few).unexplained[0]
    assert line.order == 36
    assert (line.cos / ARCSEC, line.sin / ARCSEC) == pytest.approx((3, -2), abs=0.1)


# --- small drives: the loop's rules without the cost of a gear train --------------------------------------------------
# What noise alone is taken for, and how often intervals hold the truth, samples/test_drives.py says.


def drive() -> rverror.Model:
    return rverror.Model(rverror.Drive(ratio=20.0, shafts={"motor": 20.0, "idler": 7.0}))


def run_of(te: Any, *, turns: int = 4, points: int = 512, noise: float = 1.0, seed: int = 0) -> rverror.Run:
    """Run of a drive: `te(theta)` in arcsec plus white noise."""
    theta = 2 * np.pi * np.arange(turns * points) / points
    error = te(theta) + noise * np.random.default_rng(seed).normal(size=theta.size)
    return rverror.run_from_arrays(input_angle=20 * theta, te=error * ARCSEC, direction="forward")


def test_two_missing_effects_of_different_frames_are_both_found() -> None:
    run = run_of(lambda t: 8 * np.cos(7 * t) - 6 * np.sin(t))
    found = rverror.diagnose(drive(), [run])
    assert found.verdict == "explained"
    assert [(a.effect.key, dict(a.effect.indices)) for a in found.added] == [
        ("shaft.eccentricity", {"shaft": "idler", "harmonic": 1}),
        ("sensor.encoder_eccentricity", {}),
    ]
    assert found.added[0].estimates[0].value == pytest.approx(8 * ARCSEC, abs=0.15 * ARCSEC)
    assert found.added[1].estimates[1].value == pytest.approx(-6 * ARCSEC, abs=0.15 * ARCSEC)
    assert found.before.heldout_rms / ARCSEC == pytest.approx(math.sqrt(8**2 / 2 + 6**2 / 2 + 1), rel=0.03)


def test_orders_above_those_of_the_first_quick_fit_are_found() -> None:
    """Candidates are first fitted on 512 angles a turn, which would fold order 300 onto 212."""
    model = rverror.Model(rverror.Drive(ratio=300.0))
    theta = 2 * np.pi * np.arange(3 * 2048) / 2048
    noise = np.random.default_rng(0).normal(size=theta.size)
    te = (3 * np.cos(300 * theta) + noise) * ARCSEC
    run = rverror.run_from_arrays(input_angle=300 * theta, te=te, direction="forward")
    found = rverror.diagnose(model, [run])
    assert found.verdict == "explained"
    assert [(a.effect.key, dict(a.effect.indices)) for a in found.added] == [("sensor.input_coupling", {"harmonic": 1})]
    # the coupling's size is an angle of the input shaft, a ratio larger
    assert found.added[0].estimates[0].value == pytest.approx(300 * 3 * ARCSEC, rel=0.05)


def test_offset_of_a_run_is_no_error() -> None:
    found = rverror.diagnose(drive(), [run_of(lambda t: 500 + 0 * t)])
    assert found.verdict == "nothing_missing"
    assert found.before.rms / ARCSEC == pytest.approx(1, rel=0.05)


def test_declared_effect_is_refitted_within_its_uncertainty_and_not_blamed() -> None:
    declared = rverror.effect("shaft.eccentricity", shaft="idler", harmonic=1, cos="8 arcsec", uncertainty="1 arcsec")
    model = drive().with_effects(declared)
    found = rverror.diagnose(model, [run_of(lambda t: 8.8 * np.cos(7 * t))])
    assert found.verdict == "nothing_missing"
    assert found.model.effects[0].values[0] == pytest.approx(8.8 * ARCSEC, abs=0.15 * ARCSEC)
    assert found.before.rms > found.before_refitted.rms
    exact = replace(declared, uncertainty=None)
    held = rverror.diagnose(drive().with_effects(exact), [run_of(lambda t: 8.8 * np.cos(7 * t))])
    assert held.model.effects[0].values[0] == declared.values[0]


def test_a_declared_size_that_is_far_off_is_said_to_be_missing() -> None:
    """A refit could take it up, at eight times the stated uncertainty: that is no uncertainty any more."""
    declared = rverror.effect("shaft.eccentricity", shaft="idler", harmonic=1, cos="8 arcsec", uncertainty="0.5 arcsec")
    found = rverror.diagnose(drive().with_effects(declared), [run_of(lambda t: 12 * np.cos(7 * t))])
    assert found.verdict == "explained"
    assert [a.effect.key for a in found.added] == ["shaft.eccentricity"]
    assert found.added[0].effect.indices == {"shaft": "idler", "harmonic": 1}
    assert found.added[0].estimates[0].value == pytest.approx(4 * ARCSEC, abs=1.2 * ARCSEC)


def test_held_out_residual_keeps_declared_sizes_near_what_was_declared() -> None:
    """Declared 0, true 20, and a prior as strong as the data: each fold must stop where precisions say."""
    sigma, noise, turns, points = 0.04, 1.0, 4, 512
    declared = rverror.effect("shaft.eccentricity", shaft="idler", harmonic=1, cos=0, uncertainty=sigma * ARCSEC)
    found = rverror.diagnose(drive().with_effects(declared), [run_of(lambda t: 20 * np.cos(7 * t))])
    data, prior = (turns - 1) * points / 2 / noise**2, sigma**-2
    left = 20 * prior / (data + prior)
    expected = math.sqrt(noise**2 + left**2 / 2)
    assert found.before_refitted.heldout_rms / ARCSEC == pytest.approx(expected, rel=0.05)
    assert 5 < expected < 9


def test_refusals_name_the_run_and_the_remedy() -> None:
    """No run is refused for its travel; one of a few samples, and a reducer's that turns both ways, are."""
    unit = rverror.Model(rverror.reducer("RV-40E"))
    with pytest.raises(rverror.InputError, match="jobs: 0 threads do no work; give 1 or more"):
        rverror.diagnose(rverror.Model(rverror.reducer("RV-40E")), [], jobs=0)
    with pytest.raises(rverror.InputError, match="no run given"):
        rverror.diagnose(drive(), [])
    with pytest.raises(rverror.InputError, match="no run given"):
        rverror.diagnose(unit, [])
    theta = np.linspace(0, 0.2, 40)
    short = rverror.run_from_arrays(input_angle=121 * theta, te=np.sin(theta) * ARCSEC, direction="forward")
    with pytest.raises(rverror.InputError, match=r"run 1: 40 samples; 48 or more are needed.*measure a longer stretch"):
        rverror.diagnose(unit, [short])
    there = np.linspace(0, 100, 900)
    both = rverror.run_from_arrays(input_angle=121 * np.r_[there, there[::-1]], te=np.zeros(1800), direction="mixed")
    with pytest.raises(rverror.InputError, match="run 1: the run turns both ways"):
        rverror.diagnose(unit, [both])


def test_growing_errors_that_are_declared_are_taken_off() -> None:
    slope = rverror.effect("sensor.ratio_error", slope="30 arcsec/turn")
    found = rverror.diagnose(drive().with_effects(slope), [run_of(lambda t: 30 * t / (2 * np.pi))])
    assert found.verdict == "nothing_missing"
    assert found.before.heldout_rms / ARCSEC == pytest.approx(1, rel=0.05)
