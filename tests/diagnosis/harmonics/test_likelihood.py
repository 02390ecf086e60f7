"""The search of a reducer: two effects of one frame, and effects that look alike."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import rverror
from rverror.base.units import ARCSEC
from rverror.diagnosis.harmonics.fit import joint_fit
from rverror.diagnosis.harmonics.likelihood import HarmonicLikelihood, PeriodFit, Record
from rverror.diagnosis.harmonics.periods import Periods, residual
from rverror.diagnosis.harmonics.reducers import Searched, searched
from rverror.diagnosis.harmonics.runs import FitRun, fit_run
from rverror.diagnosis.policy import POLICY, Policy
from rverror.diagnosis.result import Addition
from rverror.diagnosis.search import Journal, chosen_again, pruned
from rverror.geartrain.kinematics import Conditions
from rverror.model.catalogue import CATALOGUE
from rverror.model.effects import Effect, Model, effect
from rverror.runs.virtual_bench import coloured_noise
from rverror.statics.loaded_state import equilibrium
from rverror.statics.prediction import Predictor

Array = np.ndarray
UNIT = rverror.reducer("RV-40E")
POINTS, TURNS = 1024, 3
NOISE = 0.49 * ARCSEC
SIGMA = 0.3e-3  # of a declared component, mm
Part = tuple[str, dict[str, Any], float]  # key, indices and what a workshop makes, mm
DECLARED: tuple[Part, ...] = (
    *(("cycloid.disc_pitch", {"disc": disc, "harmonic": 1}, 2e-3) for disc in (0, 1)),
    *(("crank.eccentricity", {"crank": crank, "disc": disc}, 1e-3) for crank in (0, 1) for disc in (0, 1)),
    ("coupling.carrier_bore_position", {"crank": 0}, 1.5e-3),
)
PITCH = effect("involute.planet_pitch", crank=1, harmonic=3, cos="4.5 um", sin="-4.4 um")
CLEARANCE = effect("crank.bearing_clearance", clearance="0.92 um")
CAM = effect("crank.eccentricity", crank=1, disc=0, radial="4 um", tangential="-3 um")
Name = tuple[str, tuple[tuple[str, Any], ...]]


def unit_of(rng: np.random.Generator, parts: Sequence[Part]) -> tuple[tuple[Effect, ...], tuple[Effect, ...]]:
    """True part errors, and what a shop floor measured of them."""
    true, measured = [], []
    for key, indices, sigma in parts:
        values = rng.normal(0, sigma, 2)
        true.append(Effect(key, indices, tuple(values)))
        measured.append(Effect(key, indices, tuple(values + rng.normal(0, SIGMA, 2)), SIGMA))
    return tuple(true), tuple(measured)


def bench(
    missing: Sequence[Effect], *, torque: float | None, parts: Sequence[Part] = DECLARED
) -> tuple[Model, list[FitRun]]:
    """Declared model, and runs of a unit that lacks these, both ways: equilibrium at a torque, else closed form."""
    rng = np.random.default_rng([0, 1])
    true, measured = unit_of(rng, parts)
    model, theta = Model(UNIT, (*true, *missing)), 2 * np.pi * np.arange(POINTS) / POINTS
    runs = []
    for way in (1.0, -1.0):
        if torque is None:
            wave = rverror.transmission_error(model, theta, direction=way)
        else:
            wave = equilibrium(model, theta, torque=torque, direction=way).transmission_error
        noise = coloured_noise(TURNS * POINTS, rms=0.9 * NOISE, step=1.0, correlation=4.5, random=rng)
        noise = noise + 0.44 * NOISE * rng.standard_normal(TURNS * POINTS)
        conditions = Conditions(theta, way, torque, folds=True)
        runs.append(fit_run("run", Predictor(UNIT, conditions), wave + noise.reshape(TURNS, POINTS)))
    return Model(UNIT, measured), runs


def found_in(
    missing: Sequence[Effect],
    policy: Policy = POLICY,
    *,
    torque: float | None,
    parts: Sequence[Part] = DECLARED,
) -> Searched:
    model, runs = bench(missing, torque=torque, parts=parts)
    return searched(Periods(model, UNIT, runs, policy), Journal(lambda text: None))


def trying(*keys: str) -> Policy:
    """Try few sources, for speed: those that turn with the crank and those that are missing."""
    return replace(POLICY, keys=keys)


def likelihood_of(model: Model, runs: Sequence[FitRun], *keys: str) -> HarmonicLikelihood:
    return HarmonicLikelihood.of(Periods(model, UNIT, runs, trying(*keys)), Journal(lambda text: None))


def at_the_noise(outcome: Searched) -> bool:
    """Tell whether what is left is no more than the noise."""
    misfit = outcome.fit.misfit
    return not outcome.lines and misfit.data < misfit.count + 5 * math.sqrt(2 * misfit.count)


def name(key: str, indices: Mapping[str, Any]) -> Name:
    return key, tuple(sorted(indices.items()))


def named(addition: Addition) -> set[Name]:
    """All that an addition may be."""
    return {name(addition.effect.key, addition.effect.indices), *(name(*one) for one in addition.indistinguishable)}


def test_two_effects_of_one_frame_are_both_found() -> None:
    """Order 120 of a planet beside a clearance that makes 80, 160 and, with the cams, 40: each leaves the other's.

    At equal loads of two planets the same pitch error of the other one, turned over, makes nearly the same.
    """
    policy = trying(
        "crank.bearing_clearance",
        "crank.eccentricity",
        "involute.planet_pitch",
        "involute.planet_eccentricity",
        "cycloid.disc_bore_position",
    )
    found = found_in((CLEARANCE, PITCH), policy, torque=20e3)
    assert len(found.added) == 2
    parts = {addition.effect.key: addition for addition in found.added}
    play, pitch = parts[CLEARANCE.key], parts[PITCH.key]
    assert play.indistinguishable == ()
    assert play.estimates[0].value == pytest.approx(CLEARANCE.values[0], abs=0.1e-3)
    assert name(PITCH.key, PITCH.indices) in named(pitch)
    assert named(pitch) <= {name(PITCH.key, {"crank": crank, "harmonic": 3}) for crank in (0, 1)}
    sign = 1 if pitch.effect.indices["crank"] == 1 else -1
    assert pitch.effect.values == pytest.approx([sign * value for value in PITCH.values], abs=0.4e-3)
    assert at_the_noise(found)


def test_two_effects_of_one_frame_are_kept_beside_an_order_that_nothing_explains() -> None:
    policy = trying("crank.bearing_clearance", "crank.eccentricity", "involute.planet_pitch")
    model, runs = bench((CLEARANCE, PITCH), torque=20e3)
    runs = [replace(run, values=run.values + 2 * ARCSEC * np.cos(36 * run.conditions.theta)) for run in runs]
    found = searched(Periods(model, UNIT, runs, policy), Journal(lambda text: None))
    assert {addition.effect.key for addition in found.added} == {CLEARANCE.key, PITCH.key}
    assert [line.order for line in found.lines] == [36.0]


def test_one_large_wave_is_named_alone_before_two_stand_in_for_it() -> None:
    """From nothing the fit ends in the wrong place, another harmonic; from workshop sizes it does not."""
    policy = trying(
        "cycloid.disc_pitch",
        "cycloid.disc_profile",
        "involute.planet_pitch",
        "crank.eccentricity",
        "cycloid.disc_bore_position",
    )
    wave = effect("cycloid.disc_pitch", disc=1, harmonic=2, cos="-12 um", sin="12 um")
    model, runs = bench((wave,), torque=20e3)
    said: list[str] = []
    found = searched(Periods(model, UNIT, runs, policy), Journal(said.append))
    assert [(a.effect.key, dict(a.effect.indices)) for a in found.added] == [(wave.key, dict(wave.indices))]
    assert found.added[0].effect.values == pytest.approx(wave.values, abs=0.4e-3)
    assert at_the_noise(found)
    assert [words for words in said if words.startswith("searching again")] == ["searching again from workshop sizes"]
    # once no line is left, what bends the contacts is not started from workshop sizes any more
    after = said[1 + max(i for i, words in enumerate(said) if words.startswith("added")) :]
    assert sum(words.startswith("refitting candidate") for words in after) < 8


def test_contact_tells_a_cam_from_its_twins() -> None:
    """At light load pins open, and so differ cams whose linear waveforms are one: the true one is in the set."""
    policy = trying("crank.eccentricity", "crank.bearing_clearance", "cycloid.disc_bore_position")
    found = found_in((CAM,), policy, torque=20e3, parts=DECLARED[:2])
    (added,) = found.added
    assert name(CAM.key, CAM.indices) in named(added)
    assert at_the_noise(found)


def alike_cams() -> set[Name]:
    """Cams whose influence, forward and reverse, makes up the waveform of the missing one to rounding."""
    theta = 2 * np.pi * np.arange(POINTS) / POINTS

    def waves(indices: Mapping[str, Any]) -> Array:
        ways = [rverror.influence(UNIT, theta, CAM.key, direction=way, **indices).matrix for way in (1.0, -1.0)]
        return np.concatenate([way - way.mean(axis=1, keepdims=True) for way in ways], axis=1)

    missing, found = CAM.values @ waves(CAM.indices), set()
    for indices in CATALOGUE[CAM.key].candidates(UNIT):
        rows = waves(indices)
        left = missing - np.linalg.lstsq(rows.T, missing, rcond=None)[0] @ rows
        if math.sqrt(left @ left) < 1e-6 * math.sqrt(missing @ missing):
            found.add(name(CAM.key, indices))
    return found


def test_cams_that_no_waveform_tells_apart_are_all_named() -> None:
    """Closed form: the same disc's cam on the other crank, turned over, is the same."""
    (added,) = found_in((CAM,), torque=None, parts=DECLARED[:2]).added
    assert len(alike_cams()) == 2
    assert alike_cams() <= named(added)


def test_one_fit_is_enough_to_name_all_twins() -> None:
    """Where only the leader is fitted with everything, what looks like it comes along."""
    policy = replace(trying(CAM.key, "crank.bearing_clearance"), refitted=1, level=0.0)
    (added,) = found_in((CAM,), policy, torque=None, parts=DECLARED[:2]).added
    assert named(added) == alike_cams()


def test_the_first_of_two_is_chosen_again_beside_the_second() -> None:
    """A disc's bore had to stand for both; beside the planet's pitch the clearance explains what is left."""
    keys = ("crank.bearing_clearance", "crank.eccentricity", "cycloid.disc_bore_position")
    model, runs = bench((CLEARANCE, PITCH), torque=20e3, parts=DECLARED[:3])
    likelihood = likelihood_of(model, runs, *keys)
    wrong = effect("cycloid.disc_bore_position", disc=1, crank=0, radial="1 um", tangential="1 um")
    both = joint_fit(model, (wrong, PITCH), runs)
    settled = PeriodFit(joint_fit(model, (), runs))
    found = PeriodFit(both, both.model.effects[-2:], (Record(0.0, ()), Record(0.0, ())))
    left = likelihood.own_lines(found)
    assert left
    again, rest = chosen_again(likelihood, settled, found, left)
    assert [e.key for e in again.added] == [PITCH.key, CLEARANCE.key]
    assert again.fit.objective < both.objective - 100
    assert rest == []
    # what it found is kept where nothing is better
    kept, same = chosen_again(likelihood, settled, again, left)
    assert again.fit.objective - kept.fit.objective < 1
    assert kept is not again or same is left


def test_declared_sizes_that_moved_too_far_are_put_back_before_the_next_search() -> None:
    """A fit whose declared sizes moved by many times their uncertainty, and one where they did not."""
    model, runs = bench((CAM,), torque=None, parts=DECLARED[:2])
    likelihood = likelihood_of(model, runs)
    strange = tuple(replace(e, values=tuple(v + 5 * SIGMA for v in e.values)) for e in model.effects)
    fixed = Model(UNIT, tuple(replace(e, uncertainty=None) for e in strange))
    fit = joint_fit(fixed, (CAM,), runs)
    moved = replace(fit, model=Model(UNIT, (*strange, fit.model.effects[-1])), free=np.ones(6, dtype=bool))
    near = replace(moved, misfit=replace(fit.misfit, prior=4 + 3 * math.sqrt(8) - 0.1))
    assert likelihood.start(PeriodFit(near, (CAM,))) is near
    far = replace(moved, misfit=replace(fit.misfit, prior=4 + 3 * math.sqrt(8) + 0.1))
    begun = likelihood.start(PeriodFit(far, (CAM,)))
    assert [e.values for e in begun.model.effects[:2]] == [e.values for e in model.effects]
    assert begun.model.effects[-1].values == pytest.approx(CAM.values, abs=0.3e-3)


def test_what_stood_beside_an_effect_that_is_gone_finds_its_own_place() -> None:
    """An effect was chosen beside one that later proved needless: contact then tells which crank and disc it is on."""
    bore = effect("cycloid.disc_bore_position", disc=1, crank=1, radial="-3 um", tangential="5 um")
    model, runs = bench((bore,), torque=20e3)
    likelihood = likelihood_of(model, runs, "cycloid.disc_bore_position", "crank.eccentricity")
    elsewhere = replace(bore, indices={"disc": 0, "crank": 1})
    gone = effect("crank.index", crank=0, angle="1 arcsec")
    fit = joint_fit(model, (elsewhere,), runs)
    both = joint_fit(model, (gone, fit.model.effects[-1]), runs)
    record = Record(0.0, ((gone.key, dict(gone.indices)),))
    found = pruned(likelihood, PeriodFit(both, (gone, elsewhere), (record, record)))
    assert [(e.key, dict(e.indices)) for e in found.added] == [(bore.key, dict(bore.indices))]
    assert found.fit.objective < fit.objective - 50
    assert found.fit.model.effects[-1].values == pytest.approx(bore.values, abs=1e-3)
    (kept,) = found.records
    assert kept.heldout_rms == residual(likelihood.periods, found.fit).heldout_rms
    assert (gone.key, dict(gone.indices)) not in kept.alike
