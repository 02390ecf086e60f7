"""A lot as prior: what it says of each size, and that it tells what runs do not."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

import rverror
from gear_runs import BARE, TURN, UNIT, record_of
from rverror.app.command_line import main
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.fit import RunSet, evaluated, fitted
from rverror.diagnosis.gears.score import Score
from rverror.diagnosis.policy import POLICY
from rverror.diagnosis.size_prior import SizePrior
from rverror.model.catalogue import CATALOGUE
from rverror.runs.noise import RunNoise

ENCODER, SLOPE = "sensor.encoder_eccentricity", "sensor.ratio_error"
ONLY = replace(POLICY, keys=(ENCODER, SLOPE))


def prior_of(*tolerances: rverror.tolerances.Tolerance) -> SizePrior:
    return SizePrior.of(tolerances, UNIT)


def short_run() -> rverror.Run:
    """A tenth of a turn with an error in proportion to the angle, which is all that an encoder's looks like there."""
    theta = 0.1 * TURN * np.arange(512) / 512
    error = 1e-4 * theta + np.random.default_rng(1).normal(size=512) * 2 * ARCSEC
    return rverror.run_from_arrays(input_angle=UNIT.ratio * theta, te=error, direction="forward")


def says(key: str, deviation: float, unit: str = "") -> rverror.tolerances.Tolerance:
    width = f"{3 * deviation} {unit}" if unit else 3 * deviation
    return rverror.tolerance(key, width, distribution="normal")


def named(*prior: rverror.tolerances.Tolerance) -> tuple[list[str], list[str]]:
    """What is named, and what does as well."""
    (added,) = rverror.diagnose(BARE, [short_run()], policy=ONLY, prior=prior).added
    return [added.effect.key], [key for key, _ in added.indistinguishable]


@pytest.mark.parametrize(
    ("law", "deviation"),
    [("normal", 60 * ARCSEC / 3), ("rayleigh", 60 * ARCSEC / math.sqrt(-2 * math.log(math.erfc(3 / math.sqrt(2)))))],
    ids=["normal", "rayleigh"],
)
def test_what_the_score_counts_of_a_size_is_the_density_that_the_lot_says(law: str, deviation: float) -> None:
    """Beside the squares of the data and what the runs leave open of the sizes: minus twice its logarithm."""
    theta = TURN * np.arange(200) / 200
    error = 100 * ARCSEC * np.cos(theta) + 300 * ARCSEC * np.random.default_rng(2).normal(size=200)
    record = replace(record_of(error, theta), torque=None, noise=RunNoise(np.zeros(0), 300 * ARCSEC))
    prior = prior_of(rverror.tolerance(ENCODER, "60 arcsec", distribution=law))
    run_set = replace(RunSet.of(UNIT, [record], POLICY, points=256, anywhere=False), prior=prior)
    start = BARE.with_effects(rverror.effect(ENCODER, cos="0 arcsec", sin="0 arcsec"))
    fit, score = fitted(evaluated(run_set, start, BARE), enough=1e-9), Score([(ENCODER, {})], POLICY)
    assert fit.scale == 1
    density = norm.logpdf(fit.added[0].values, 0, deviation).sum() + math.log(TURN)  # the posterior's is without too
    told = score.of(fit).score - fit.data + float(np.linalg.slogdet(fit.covariance[:2, :2])[1])
    assert told == pytest.approx(-2 * density, abs=1e-5)


def test_causes_that_runs_do_not_tell_apart_are_told_by_the_prior() -> None:
    first, others = named()
    assert {*first, *others} == {ENCODER, SLOPE}
    assert named(says(SLOPE, 1e-4), says(ENCODER, 0.1, "arcsec")) == ([SLOPE], [])
    assert named(says(SLOPE, 1e-7), says(ENCODER, 20, "arcsec")) == ([ENCODER], [])


def test_what_is_in_no_tolerance_is_as_a_workshop_makes_it() -> None:
    """To the digit: with some tolerances too, of what they do not name."""
    cams = rverror.tolerance("crank.eccentricity", "3 um", crank=0, parameters=["radial"], distribution="normal")
    for prior in (SizePrior(), prior_of(cams)):
        for key, entry in CATALOGUE.items():
            for indices in entry.candidates(UNIT) if entry.applies_to(UNIT) else ():
                if (key, indices.get("crank")) != ("crank.eccentricity", 0):
                    workshop = tuple(POLICY.workshop * p.plausible for p in entry.parameters)
                    assert prior.deviation(key, indices, POLICY.workshop) == workshop
    stated = prior_of(cams).deviation("crank.eccentricity", {"crank": 0, "disc": 1}, POLICY.workshop)
    assert stated == (pytest.approx(1e-3), POLICY.workshop * 0.03)


def test_the_mean_counts_two_tolerances_add_and_pins_share_a_root_of_their_number() -> None:
    """Runout of 3 and 4 um is as one of 5; 16 pins of 4 um share 1 um, and the mean of 3 um whole."""
    runout = [says("coupling.carrier_runout", size, "um") for size in (3, 4)]
    pins = rverror.tolerance("cycloid.pin_radius", "12 um", distribution="normal", mean="3 um")
    alike = replace(pins, correlation=1.0)
    for tolerances, indices, expected in (
        (runout, {}, (5e-3, 5e-3)),
        ([pins], {"pin": 7}, (5e-3,)),
        ([pins], {"pin": "all"}, (math.hypot(1e-3, 3e-3),)),
        ([alike], {"pin": "all"}, (5e-3,)),
    ):
        found = prior_of(*tolerances).deviation(tolerances[0].key, indices, POLICY.workshop)
        assert found == pytest.approx(expected)


def test_the_notes_count_what_is_of_no_candidate() -> None:
    """Other keys than those that are tried, and what is declared."""
    prior = [says(SLOPE, 1e-4), says("coupling.carrier_runout", 3, "um")]
    notes = rverror.diagnose(BARE, [short_run()], policy=ONLY, prior=prior).notes
    (note,) = [note for note in notes if note.startswith("prior")]
    assert "1 of 2 tolerances" in note
    assert "1 of nothing that is tried here, ignored" in note
    assert not any("prior" in note for note in rverror.diagnose(BARE, [short_run()], policy=ONLY).notes)


GEAR = '[reducer]\npreset = "RV-40E"\n'
WORM = "[drive]\nratio = 121\nshafts = { motor = 121.0 }\n"
RUNOUT, SHAFT = (
    f'[[tolerance]]\nkey = "{key}"\ntolerance = "{size}"\n{more}\n'
    for key, size, more in (
        ("coupling.carrier_runout", "9 um", ""),
        ("shaft.eccentricity", "9 arcsec", 'indices = { shaft = "motor", harmonic = 1 }'),
    )
)


@pytest.mark.parametrize(
    ("unit", "prior", "said"),
    [
        (GEAR, None, "made.toml"),
        (GEAR, "", "the file is empty"),
        (GEAR, SHAFT, "shaft.eccentricity does not act in a [reducer]"),
        (GEAR, RUNOUT.replace("9 um", "9 kg"), "kg"),
        (WORM, SHAFT, "prior: the search for a drive's causes knows none"),
        (WORM, RUNOUT, "coupling.carrier_runout does not act in a [drive]"),
    ],
    ids=["no file", "empty", "of a drive", "no length", "drive", "drive, of a reducer"],
)
def test_a_prior_that_cannot_be_used_is_refused_in_one_line(
    unit: str,
    prior: str | None,
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("model.toml").write_text(unit, encoding="utf-8")
    theta = TURN * np.arange(64) / 64
    rverror.runs.write_run(
        "run.csv", rverror.run_from_arrays(input_angle=121 * theta, te=0 * theta, direction="forward")
    )
    if prior is not None:
        Path("made.toml").write_text(prior, encoding="utf-8")
    assert main(["diagnose", "model.toml", "run.csv", "--prior", "made.toml"]) == 2
    lines = capsys.readouterr().err.splitlines()
    problem = [line for line in lines if "error" in line]
    assert len(problem) == 1
    assert said in problem[0]


@pytest.mark.parametrize("wrong", ["made.toml", 3.0, [0.005], [rverror.effect(SLOPE, slope=1e-4)]])
def test_what_is_no_tolerance_is_refused(wrong: Sequence[rverror.tolerances.Tolerance]) -> None:
    with pytest.raises(rverror.InputError, match="load_tolerances"):
        rverror.diagnose(BARE, [short_run()], prior=wrong)
