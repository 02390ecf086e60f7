"""The policy: every threshold once, on the pages that explain it, and handed down to where it decides."""

from __future__ import annotations

import ast
import math
import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

import rverror
from rverror.base.units import ARCSEC
from rverror.diagnosis.policy import POLICY

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "docs" / "theory" / name for name in ("diagnosis.md", "drives.md")]
DRIVE = rverror.Model(rverror.Drive(ratio=20.0, shafts={"motor": 20.0, "idler": 7.0}))


def run_of(size: float, seed: int = 0) -> rverror.Run:
    theta = 2 * np.pi * np.arange(2048) / 512
    error = size * np.cos(7 * theta) + np.random.default_rng(seed).normal(size=theta.size)
    return rverror.run_from_arrays(input_angle=20 * theta, te=error * ARCSEC, direction="forward")


def test_the_pages_hold_every_threshold_with_its_value() -> None:
    told = {}
    for page in PAGES:
        for name, value in re.findall(r"^\| `(\w+)` \| ([^|]+) \| [^|]+ \|$", page.read_text(encoding="utf-8"), re.M):
            number, _, unit = value.strip().partition(" ")
            told[name] = float(number) * ARCSEC if unit == "arcsec" else ast.literal_eval(value.strip())
    known = {field.name: getattr(POLICY, field.name) for field in fields(POLICY)}
    assert sorted(told) == sorted(known)
    for name, value in known.items():
        assert told[name] == (pytest.approx(value) if isinstance(value, float) else value), name


def test_no_threshold_of_a_verdict_hides_in_a_module() -> None:
    """Private numbers beside an algorithm are its steps and grids; chances and limits are the policy's."""
    allowed = {
        "_TURN", "_SLOW", "_TRACE_POINTS", "_POINTS", "_ANYWHERE", "_LONGEST_PERIOD", "_GRID", "_ANGLES", "_GOLDEN",
        "_LISTED",
        "_MEANS", "_DEGREE", "_MARGIN", "_HIGHEST", "_REPEAT_POINTS", "_TOGETHER", "_DENSER", "_TRUE",  # of the grids
        "_MOST_LAGS", "_LAGS", "_FEWER_WALKS", "_MOST_WAVES", "_LEAST_LAGS",  # of noise
        "_TABLE", "_BANDS", "_LEAST_BINS", "_FAR", "_BELOW_FAR", "_ROUNDS", "_WALKS", "_SHOWN",
        "_MOST_PEAKS", "_BY_NOISE", "_FITTED", "MOST_LINES",  # of noise and lines
        "_OWN", "_MOST_OWN", "TOLD_ORDER", "_SAME", "_LEAST_ROWS",  # of what is listed
        "_ELSEWHERE", "_MARKS_APART", "_RIPPLES", "_SETTLES", "_SHORT_GAP",
        "_LIGHT_LOAD", "TORQUE_SHARE", "_INERTIA_SPREAD",  # of what is known of a bench before
        "_DOUBTED", "_BESIDE", "_SLOWEST", "_ROUNDED",  # of what a run and a contact may be
        "_NOTHING", "_APART", "_TRACE", "_EVEN", "_ROUNDING", "_HALF", "_TORQUE",  # of rounding
        "_BLOCK", "_KEPT", "_ANY",  # of how it is computed
        "_SAMPLES_A_WAVE", "_DRAG", "_GUESSED", "_LEAST_GUESS", "_LOADS_OF_A_LAW", "_LOADS", "_HARMONICS",  # of a table
        "_WAVES",  # of a passport
        "_STEPS", "_MOST",  # of a search that makes claims
        "_STARTS", "_FEW_PLACES", "_NARROW", "_PATIENT", "_NEARLY", "_MOST_MOVES", "_CLOSE", "_OFFERED",
            "_LOOKED_AT", "_AS_GOOD", "_TO_THE_END", "_DOUBT",  # of a search for sets
        "SCALES", "_SHRUNK", "_REGULAR",  # of a ranking
        "_PLACING",  # of unknown marks
        "_LEAST_SPEEDS",
        "_STEP", "_FINE", "_REACH", "_LIGHTEST", "_HEAVIEST", "_ZOOMS", "_MISFIT", "_GAP", "_TRIES",  # of resonances
    }  # fmt: skip
    passport = {"order_passport.py", "passport_kinds.py", "wave_fit.py"}  # names no cause; its levels are on its page
    for file in (ROOT / "src" / "rverror" / "diagnosis").rglob("*.py"):
        if file.name in passport:
            continue
        for line in file.read_text(encoding="utf-8").splitlines():
            if match := re.match(r"([A-Z_]+(?:, [A-Z_]+)*)(?:: [^=]+)? = (?:[-\d.]|\(\(?[-\d.]|math)", line):
                assert set(match[1].split(", ")) <= allowed, (file.name, line)


def test_a_policy_of_fewer_false_alarms_asks_for_more() -> None:
    """A wave of 0.15 arcsec lies 5 standard deviations from nothing: 1e-3 over all candidates take it, 1e-9 do not."""
    run = run_of(0.15)
    assert [a.effect.key for a in rverror.diagnose(DRIVE, [run]).added] == ["shaft.eccentricity"]
    assert rverror.diagnose(DRIVE, [run], policy=replace(POLICY, false_alarm=1e-9)).verdict == "nothing_missing"


def test_intervals_have_the_confidence_of_the_policy() -> None:
    run, widths = run_of(2.0), []
    for confidence in (0.95, 0.68):
        (added,) = rverror.diagnose(DRIVE, [run], policy=replace(POLICY, confidence=confidence)).added
        widths.append(added.estimates[0].high - added.estimates[0].low)
    assert widths[0] / widths[1] == pytest.approx(1.960 / 0.9945, rel=0.02)


def test_intervals_of_a_reducer_are_students() -> None:
    """Order 1 of one run of two turns, 512 samples: an eighth of them, less the noise's own, count as independent."""
    unit, theta = rverror.reducer("RV-40E"), 2 * np.pi * np.arange(2 * 256) / 256
    error = (5 * np.cos(theta) + np.random.default_rng(0).normal(size=theta.size)) * ARCSEC
    run = rverror.run_from_arrays(input_angle=unit.ratio * theta, output_angle=theta + error, direction="forward")
    widths = []
    for confidence in (0.95, 0.5):
        policy = replace(POLICY, confidence=confidence, keys=("sensor.encoder_eccentricity",))
        (added,) = rverror.diagnose(rverror.Model(unit), [run], policy=policy).added
        widths.append(added.estimates[0].high - added.estimates[0].low)
    # Student's, of 60 degrees: 2.000 and 0.6786; the normal's 1.960 / 0.6745 is 1.5 % less
    assert widths[0] / widths[1] == pytest.approx(2.000 / 0.6786, rel=3e-3)
    assert widths[0] / 2 == pytest.approx(2.0 * math.sqrt(2 / theta.size) * ARCSEC, rel=0.3)  # noise of 16 bins
    none = rverror.diagnose(rverror.Model(unit), [run], policy=replace(POLICY, keys=("sensor.drift",)))
    assert (none.verdict, none.tried, none.unexplained[0].order) == ("unexplained", 1, pytest.approx(1, abs=0.05))


def test_only_the_keys_that_are_asked_for_are_tried() -> None:
    run = run_of(2.0)
    found = rverror.diagnose(DRIVE, [run], policy=replace(POLICY, keys=("sensor.encoder_eccentricity",)))
    assert (found.verdict, found.added, found.tried) == ("unexplained", (), 1)
    assert found.unexplained[0].order == 7
    with pytest.raises(ValueError, match=r"did you mean 'sensor\.encoder_eccentricity'"):
        rverror.diagnose(DRIVE, [run], policy=replace(POLICY, keys=("sensor.encoder_ecentricity",)))


def test_the_history_says_what_became_of_every_candidate() -> None:
    found = rverror.diagnose(DRIVE, [run_of(2.0)])
    assert {fate.round for fate in found.history} == {4}  # nothing and the idler, each looked at under two noises
    (added,) = [fate for fate in found.history if fate.fate == "added"]
    assert (added.key, dict(added.indices)) == ("shaft.eccentricity", {"shaft": "idler", "harmonic": 1})
    fell = {(fate.key, tuple(fate.indices.items())) for fate in found.history if fate.fate == "fell"}
    assert len(fell) >= found.tried - 1
    assert all(fate.why for fate in found.history)
