"""End to end on simulated runs of a small reducer whose stiffness is not the declared one, in coloured noise.

Half a turn on, crank 1 and disc 1 stand as crank 0 and disc 0 did, and each pin as the opposite one: such twins belong
in every answer.
"""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import rverror
from gear_runs import BARE, CAM, OTHER, TURN, UNIT, red, runs_of, search_of
from oracle import REALISTIC
from pages import ROOT
from rverror.base.arrays import Array
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.account import half_widths
from rverror.diagnosis.gears.fit import Fit, RunSet, evaluated, first_state, fitted
from rverror.diagnosis.gears.moves import marked
from rverror.diagnosis.gears.record import records_of
from rverror.diagnosis.gears.reducers import placed, ripples_apart, searched_repeatedly, with_marks
from rverror.diagnosis.gears.search import Search
from rverror.diagnosis.policy import POLICY
from rverror.diagnosis.result import Diagnosis
from rverror.geartrain.kinematics import fundamental_orders
from rverror.model.effects import Effect, Model

sys.path.append(str(ROOT / "benchmarks"))

from real_bench.simulator import Law, PartErrors, Reality, put_effect, transmission_error

#: What the small reducer's cam may be taken for, where it is not asked which of all sources it is.
FEW = replace(POLICY, keys=("crank.eccentricity", "involute.planet_eccentricity", "sensor.encoder_eccentricity"))
#: All that makes waves of the crank, and what is read: its neighbours, without the many sources of single pins.
NEIGHBOURS = replace(POLICY, keys=(*FEW.keys, "cycloid.disc_bore_position", "cycloid.disc_pitch", "cycloid.pin_circle"))
PIN = rverror.effect("cycloid.pin_position", pin=5, radial="-12 um", tangential="10 um")
HERE = ("crank.eccentricity", {"crank": 0, "disc": 0})
TWIN = ("crank.eccentricity", {"crank": 1, "disc": 1})
TRUE = Model(OTHER, (CAM,))


def sets(found: Diagnosis) -> list[list[tuple[str, dict[str, Any]]]]:
    """Of each addition, it and what cannot be told from it."""
    return [
        [(key, dict(indices)) for key, indices in [(a.effect.key, a.effect.indices), *a.indistinguishable]]
        for a in found.added
    ]


def the_cam_is_named(found: Diagnosis) -> None:
    """Alone, with its twin, its size within its interval, and nothing but noise left."""
    (names,) = sets(found)
    assert HERE in names
    assert TWIN in names
    assert len(names) <= 4
    for estimate, size in zip(found.added[0].estimates, CAM.values, strict=True):
        half = (estimate.high - estimate.low) / 2
        assert half < 0.2e-3
        assert abs(estimate.value - size) < 2 * half  # four standard deviations
    assert found.noise_rms == pytest.approx(0.3 * ARCSEC, rel=0.1)
    assert found.after.heldout_rms < 1.15 * 0.3 * ARCSEC


@pytest.fixture(scope="module")
def usual() -> Diagnosis:
    """Of one turn each way."""
    return rverror.diagnose(BARE, runs_of(TRUE))


def test_one_turn_each_way_names_the_cause_and_says_the_stiffness(usual: Diagnosis) -> None:
    found = usual
    assert found.verdict == "explained"
    the_cam_is_named(found)
    assert found.added[0].orders == (16.0,)  # the crank's
    assert found.before.heldout_rms > 0.999 * found.before_refitted.heldout_rms
    assert found.before_refitted.heldout_rms > 3 * found.after.heldout_rms
    soft = {e.name: e for e in found.elastic}
    assert soft["pin_contact"].determined
    assert soft["pin_contact"].low < OTHER.stiffness.pin_contact < soft["pin_contact"].high < 200e3
    for name in ("crank_bearing", "carrier_bearing", "gear_mesh"):
        assert soft[name].low < getattr(OTHER.stiffness, name) < soft[name].high
    assert isinstance(found.model.mechanism, rverror.Reducer)
    assert found.model.mechanism.stiffness.pin_contact == soft["pin_contact"].value


def test_a_search_that_ends_before_it_has_found_anything_says_so(usual: Diagnosis) -> None:
    found = rverror.diagnose(BARE, runs_of(TRUE), policy=replace(POLICY, budget=-1))
    assert (found.verdict, found.added) == ("unexplained", ())
    (note,) = [note for note in found.notes if "ended at its budget of -1" in note]
    assert "may find more" in note
    assert not [note for note in usual.notes if "budget" in note]


def test_a_cause_whose_rivals_were_beyond_the_budget_says_so() -> None:
    found = rverror.diagnose(BARE, runs_of(TRUE), policy=replace(NEIGHBOURS, budget=0))
    assert found.verdict == "explained"
    (note,) = [note for note in found.notes if "ended at its budget of 0" in note]
    assert "rivals may fit as well" in note


def test_other_stiffness_alone_is_no_missing_error() -> None:
    found = rverror.diagnose(BARE, runs_of(Model(OTHER), ((1.0, 50e3), (-1.0, 120e3))))
    assert found.verdict == "nothing_missing"
    assert found.added == found.unexplained == ()


@pytest.mark.parametrize(
    ("start", "turns", "seed"), [(1.0, 0.4, 1), (4.0, 10 / 360, 1), (4.0, 10 / 360, 2), (4.0, 10 / 360, 6)]
)
def test_a_part_of_a_turn_is_diagnosed_from_anywhere(start: float, turns: float, seed: int) -> None:
    """0.4 of a turn names the cam; ten degrees hold a bit less than half a turn of the crank, and say less."""
    points = 4096 if turns < 0.1 else 2048
    runs = runs_of(TRUE, points=points, turns=turns, start=start, seed=seed)
    found = rverror.diagnose(BARE, runs, policy=NEIGHBOURS)
    assert any("alike over a short travel" in note for note in found.notes)
    if turns > 0.1:
        assert found.verdict == "explained"
        the_cam_is_named(found)
    else:
        assert all(HERE in names for names in sets(found))
        assert found.noise_rms < 0.4 * ARCSEC


def test_a_pin_and_its_opposite_one_are_named_together() -> None:
    few = replace(POLICY, keys=(PIN.key, "cycloid.pin_radius", "cycloid.disc_lobe", CAM.key))
    found = rverror.diagnose(BARE, runs_of(Model(OTHER, (PIN,))), policy=few)
    (names,) = sets(found)
    assert ("cycloid.pin_position", {"pin": 5}) in names
    assert ("cycloid.pin_position", {"pin": 13}) in names
    assert found.verdict == "explained"
    for estimate, size in zip(found.added[0].estimates, PIN.values, strict=True):
        assert abs(estimate.value - size) < estimate.high - estimate.low


def test_a_ratio_whose_turns_do_not_close_needs_one_turn_only() -> None:
    """Ratio 44.2: all parts stand as before after five turns, all but the sun after one."""
    odd = replace(UNIT, sun_teeth=10, module=54 / 37)
    assert odd.exact_ratio.denominator == 5
    other = replace(OTHER, sun_teeth=10, module=54 / 37)
    found = rverror.diagnose(Model(odd), runs_of(Model(other, (CAM,)), ratio=odd.ratio), policy=NEIGHBOURS)
    assert found.verdict == "explained"
    the_cam_is_named(found)


@pytest.fixture(scope="module")
def unmarked() -> Diagnosis:
    """A pin's error, read from a zero that is 21.2 degrees behind the gear's marks."""
    few = replace(POLICY, keys=("cycloid.pin_position", "crank.eccentricity"))
    return rverror.diagnose(BARE, runs_of(Model(OTHER, (PIN,)), marks=0.37, index="unknown"), policy=few)


def test_a_cause_is_named_though_the_marks_are_unknown(unmarked: Diagnosis) -> None:
    (names,) = sets(unmarked)
    assert {key for key, _ in names} == {"cycloid.pin_position"}
    assert any("whole turns of the crank, 22.5 deg, from there" in note for note in unmarked.notes)
    assert unmarked.after.heldout_rms < 1.15 * 0.3 * ARCSEC


def test_where_nothing_is_missing_the_marks_alone_are_found() -> None:
    cam = replace(CAM, uncertainty=3e-4)
    runs = runs_of(Model(OTHER, (cam,)), marks=0.21, index="unknown")
    found = rverror.diagnose(Model(UNIT, (cam,)), runs, policy=replace(POLICY, keys=(CAM.key, PIN.key)))
    assert found.verdict == "nothing_missing"
    period = TURN / fundamental_orders(UNIT)["crank"]
    assert (found.model.index_offset - 0.21 + period / 2) % period - period / 2 == pytest.approx(0, abs=0.003)


def test_marks_that_are_declared_exactly_stay_there() -> None:
    """0.371 rad is none of the angles at which free marks begin."""
    stated = Model(UNIT, (CAM,)).with_effects(rverror.effect("sensor.index_offset", offset="0.371 rad"))
    found = rverror.diagnose(
        stated, runs_of(Model(OTHER, (CAM,)), marks=0.371), policy=replace(POLICY, keys=(PIN.key,))
    )
    assert (found.verdict, found.model.index_offset) == ("nothing_missing", 0.371)
    assert found.before_refitted.rms < 1.1 * 0.3 * ARCSEC
    assert not any("index unknown" in note for note in found.notes)


def test_where_the_marks_are_is_found_with_the_rest(unmarked: Diagnosis) -> None:
    """Pins and marks turned together look alike: the error stands at one place of the bench, or half a turn on."""
    pin, offset = dict(unmarked.added[0].effect.indices)["pin"], unmarked.model.index_offset
    assert isinstance(pin, int)
    at = (TURN * (pin - 5) / 16 - (offset - 0.37)) % (TURN / 2)
    assert min(at, TURN / 2 - at) < math.radians(0.1)


RIPPLE = TURN / fundamental_orders(UNIT)["cycloid mesh"]


def at_marks(
    ahead: float, *declared: Effect, added: tuple[Effect, ...] = (), off: float = 0.0, rms: float = 0.3
) -> Fit:
    """Runs whose zero is so far behind the marks, fitted with the marks so far off their place."""
    true = runs_of(Model(UNIT, (*declared, *added)), marks=ahead, rms=rms)
    model, anywhere = with_marks(Model(UNIT, declared), [replace(run, index="unknown") for run in true])
    records, _ = records_of(model, true)
    run_set = RunSet.of(UNIT, records, POLICY, points=512, anywhere=anywhere)
    there = replace(model, effects=(*model.effects, *added))
    known = first_state(run_set, marked(there, ahead), model)
    return fitted(evaluated(known.run_set, marked(there, ahead + off), model), steps=30)


def test_marks_are_looked_for_all_around_the_crank_and_the_likeliest_come_first() -> None:
    """Some ripples of the mesh from their place all fit alike; a declared pin is looked for at every pin."""
    cam, pin = replace(CAM, uncertainty=3e-4), replace(PIN, uncertainty=3e-4)
    for declared, span, count, first in (((cam,), TURN / 16, 24, 1), ((cam, pin), TURN, 192, POLICY.offsets)):
        known = at_marks(0.37, *declared)
        fit, offsets = placed(evaluated(known.run_set, known.declared, known.declared))
        assert sorted(offsets) == pytest.approx(list(span / count * np.arange(count)))
        assert fit.model.index_offset == offsets[0]
        off = (np.array(offsets) - 0.37 + span / 2) % span - span / 2
        assert np.abs(off[:first]).min() < 3 * RIPPLE


SMALL = rverror.effect("crank.eccentricity", crank=0, disc=0, radial="3 um", tangential="-2 um", uncertainty="0.6 um")
BORE = rverror.effect("cycloid.disc_bore_position", disc=1, crank=0, radial="1 um", tangential="3 um")


def test_every_ripple_of_the_mesh_has_marks_that_fit_and_the_best_are_taken() -> None:
    fit = at_marks(0.1, SMALL, added=(BORE,), off=RIPPLE)
    assert (fit.model.index_offset - 0.1) / RIPPLE == pytest.approx(1, abs=0.1)  # a minimum, where no step leads on
    search = search_of(fit)
    best, alike = ripples_apart(search, search.score.of(fit))
    assert best.fit.objective < fit.objective - 4
    assert best.score == pytest.approx(search.score.of(best.fit).score)
    assert (best.fit.model.index_offset - 0.1) / RIPPLE == pytest.approx(0, abs=0.1)
    assert all(0 < other.objective - best.fit.objective < -2 * math.log(POLICY.alike) for other in alike)


def test_waves_of_the_pins_turn_with_the_marks() -> None:
    """A ripple on, a wave of three looks turned by three pitches of the crank; free marks stay where it was fitted."""
    sizes = {"radial_cos": "6 um", "radial_sin": "6 um", "tangential_cos": "0.8 um", "tangential_sin": "1.9 um"}
    for harmonic, ripples in ((2, 2), (3, 2)):
        wave = rverror.effect("cycloid.pin_circle", harmonic=harmonic, **sizes)
        fit = at_marks(0.1, SMALL, added=(wave,), off=ripples * RIPPLE)
        assert abs(fit.model.index_offset - 0.1) > 0.9 * RIPPLE
        search = search_of(fit)
        best, _ = ripples_apart(search, search.score.of(fit))
        assert (best.fit.model.index_offset - 0.1) / RIPPLE == pytest.approx(0, abs=0.1)


def test_intervals_hold_the_sizes_at_marks_that_chance_does_not_tell() -> None:
    """In four times the noise ripples are not told apart: the cam's size, the bore's and the marks go with them."""
    fit = at_marks(0.1, SMALL, added=(BORE,), rms=1.2)
    search = search_of(fit)
    best, alike = ripples_apart(search, search.score.of(fit))
    assert alike
    alone, whole = np.array(half_widths(best.fit)), np.array(half_widths(best.fit, alike))
    assert (whole >= alone).all()
    assert alone[2] < RIPPLE < whole[2]  # the marks, after the cam's two
    for other in alike:
        sizes, those = ([v for e in one.model.effects for v in e.values] for one in (best.fit, other))
        assert (np.abs(np.subtract(those, sizes)) < whole[: len(sizes)]).all()


def test_a_cause_that_comes_with_the_noise_stands_against_noise_as_well(monkeypatch: pytest.MonkeyPatch) -> None:
    """Under the noise that the first set leaves another set may be found, whose causes may be noise too."""
    fit = at_marks(0.1, SMALL, added=(BORE,))
    other = replace(fit.model, effects=(*fit.declared.effects, PIN))
    one, two = (search_of(fit).score.of(f) for f in (fit, fitted(evaluated(fit.run_set, other, fit.declared))))
    for answers, judged in (([one, two, two], [one, two]), ([one, one], [one]), ([one, search_of(fit).root], [one])):
        left, seen = list(answers), []
        monkeypatch.setattr(Search, "best", lambda self, *also, swap=True, left=left: (left.pop(0), True))
        monkeypatch.setattr(
            "rverror.diagnosis.gears.reducers.with_own_noise",
            lambda search, best, fit, parts, seen=seen: seen.append(best) or fit,
        )
        assert searched_repeatedly(search_of(fit))[1:] == (answers[-1], True)
        assert seen == judged
        assert left == []


def test_a_reading_that_settles_is_neither_noise_nor_a_cause() -> None:
    found = rverror.diagnose(
        BARE,
        runs_of(TRUE, turns=2, more=lambda theta, share: 20 * ARCSEC * np.exp(-share / 0.12)),
        policy=FEW,
    )
    assert found.verdict == "explained"
    the_cam_is_named(found)
    assert sum("drifts and settles by 20" in n or "drifts and settles by 19" in n for n in found.notes) == 2


@pytest.mark.parametrize(("seed", "step", "arcsec"), [(0, 0.05, 0.0), (2, 0.01, 0.0), (0, 0.05, 6.0)])
def test_a_reading_that_wanders_makes_no_cause_and_hides_none(seed: int, step: float, arcsec: float) -> None:
    """A random walk over one turn: beside what is left once a drift or order 1 is fitted, each would be a cause.

    Steps of 0.01 arcsec are too small beside the white noise for a few lags to see them.
    """
    rng = np.random.default_rng(seed)

    def wandering(theta: Array, share: Array) -> Array:
        return (np.cumsum(rng.normal(0, step, theta.size)) + arcsec * np.cos(theta)) * ARCSEC

    found = rverror.diagnose(BARE, runs_of(Model(OTHER), points=1024, more=wandering, seed=seed))
    assert [a.effect.key for a in found.added] == ["sensor.encoder_eccentricity"] * (arcsec > 0)
    assert found.verdict == ("explained" if arcsec else "nothing_missing")


def test_a_small_wave_in_white_noise_does_not_pass_for_a_walk() -> None:
    """A walk that has a tenth of an arcsec of order 1 has waves of other orders too."""
    rng = np.random.default_rng(0)

    def read(theta: Array, share: Array) -> Array:
        return (rng.normal(0, 0.3, theta.size) + 0.1 * np.cos(theta)) * ARCSEC

    found = rverror.diagnose(BARE, runs_of(Model(OTHER), points=1024, rms=0.0, more=read))
    assert [a.effect.key for a in found.added] == ["sensor.encoder_eccentricity"]


def test_slips_spikes_and_lost_rows_are_told_and_harm_nothing() -> None:
    def bad(theta: Array, share: Array) -> Array:
        count = np.arange(theta.size)
        return np.asarray((15 * (share > 0.6) + 60 * (count % 331 == 40)) * ARCSEC, dtype=np.float64)

    runs = runs_of(TRUE, points=1024, more=bad)
    lost = np.random.default_rng(0).choice(np.arange(10, 1000), 10, replace=False)
    kept = np.ones(1024, dtype=np.bool_)
    kept[lost] = False
    first = runs[0]
    assert first.input_angle is not None
    assert first.output_angle is not None
    runs[0] = rverror.run_from_arrays(
        input_angle=first.input_angle[kept], output_angle=first.output_angle[kept], direction="forward", torque=50e3
    )
    found = rverror.diagnose(BARE, runs, policy=FEW)
    assert found.verdict == "explained"
    the_cam_is_named(found)
    for word in ("slips by", "spikes set aside", "missing"):
        assert any(word in note for note in found.notes), word
    assert found.traces[1].slips is not None
    assert len(found.traces[1].slips) == 1


def hostile(kind: str) -> list[rverror.Run]:
    """Runs that no bench should make."""
    rng = np.random.default_rng(5)
    if kind == "ten degrees":
        return runs_of(Model(OTHER), points=14400, turns=10 / 360)
    if kind == "spikes":

        def spikes(theta: np.ndarray, share: np.ndarray) -> np.ndarray:
            error = np.zeros_like(theta)
            places = 20 + rng.choice(theta.size - 40, 18, replace=False)
            error[[*places, 3, theta.size - 2]] = rng.uniform(100, 1800, 20) * ARCSEC * rng.choice([-1, 1], 20)
            return error

        return runs_of(Model(OTHER), points=1024, turns=3, more=spikes)
    runs = runs_of(Model(OTHER), points=1024, turns=3)
    if kind == "missing":
        kept = [
            np.sort(rng.choice(r.output_angle.size, round(0.99 * r.output_angle.size), replace=False)) for r in runs
        ]
        return [part(run, at) for run, at in zip(runs, kept, strict=True)]
    twice = np.tile(np.arange(runs[0].output_angle.size), 2)
    return [part(runs[0], twice), runs[1]]


def part(run: rverror.Run, at: np.ndarray) -> rverror.Run:
    """Samples of a run."""
    angles = {name: getattr(run, name)[at] for name in ("input_angle", "output_angle", "direction")}
    return replace(run, **angles)


@pytest.mark.parametrize(
    ("kind", "said"),
    [
        ("spikes", "20 spikes set aside"),
        ("missing", ", 31 samples missing"),
        ("glued", "two runs in one"),
        ("ten degrees", "0.0278 of a turn"),
    ],
)
def test_hostile_runs_get_one_line_of_truth(kind: str, said: str) -> None:
    """Nothing is missing in them, and of each run its fault alone is said."""
    policy = POLICY if kind == "spikes" else NEIGHBOURS  # a spike may look like a pin or a lobe
    found = rverror.diagnose(Model(UNIT), hostile(kind), policy=policy)
    assert found.verdict == "nothing_missing"
    assert found.noise_rms == pytest.approx(0.3 * ARCSEC, rel=0.1)
    assert all(said in note for note in found.notes), found.notes
    assert len(found.notes) == (1 if kind == "glued" else 2)


def test_a_line_of_no_part_is_told_beside_the_cause() -> None:
    """1.5 arcsec at order 23.37, five noises: reported with its order to 0.05, and no cause is made of it."""
    found = rverror.diagnose(
        BARE,
        runs_of(TRUE, turns=2, more=lambda theta, share: 1.5 * ARCSEC * np.cos(23.37 * theta)),
        policy=FEW,
    )
    assert found.verdict == "unexplained"
    (line,) = found.unexplained
    assert line.order == pytest.approx(23.37, abs=0.05)
    assert line.low < 1.5 * ARCSEC < line.high
    assert line.frames == ()
    (names,) = sets(found)
    assert HERE in names


def test_a_declared_size_is_refitted_and_not_blamed() -> None:
    stated = replace(CAM, values=(CAM.values[0] - 0.7e-3, CAM.values[1] + 0.5e-3), uncertainty=0.5e-3)
    found = rverror.diagnose(Model(UNIT, (stated,)), runs_of(TRUE), policy=NEIGHBOURS)
    assert found.verdict == "nothing_missing"
    assert found.model.effects[0].values == pytest.approx(CAM.values, abs=0.15e-3)
    assert found.before.heldout_rms > 2 * found.before_refitted.heldout_rms
    assert found.after == found.before_refitted


@pytest.mark.parametrize("size", [1, 4])
def test_how_far_a_declared_size_is_off_is_no_noise(size: int) -> None:
    """Arc minutes of an encoder over 0.3 of a turn are no line: until it is refitted, they look like more noise.

    Its prior is so wide that where the middle is does not matter: declared right or wrong, the cause promises as much.
    Where they were taken for noise, it promised a ninth to a sixth.  In closed form.
    """
    encoder = rverror.effect("sensor.encoder_eccentricity", cos="200 arcsec", sin="-300 arcsec", uncertainty="1 deg")
    profile = rverror.effect("cycloid.disc_profile", disc=1, harmonic=2, cos=f"{size} um", sin=f"{size / 2} um")
    theta = 1.0 + TURN / 2048 * np.arange(614)
    error = rverror.transmission_error(Model(UNIT, (encoder, profile)), theta, direction=1.0) + red(0, 614)
    run = rverror.run_from_arrays(input_angle=UNIT.ratio * theta, output_angle=theta + error, direction="forward")
    right, wrong = (
        rverror.diagnose(
            Model(UNIT, (replace(encoder, values=values),)),
            [run],
            policy=replace(POLICY, keys=("cycloid.disc_profile",)),
        )
        for values in (encoder.values, (0.0, 0.0))
    )
    assert right.verdict == wrong.verdict == "explained"
    for found in (right, wrong):
        assert {(key, indices["harmonic"]) for names in sets(found) for key, indices in names} == {(profile.key, 2)}
    assert right.candidates[0].heldout_gain > 200
    assert 1 / 1.5 < wrong.candidates[0].heldout_gain / right.candidates[0].heldout_gain < 1.5


def test_only_the_keys_that_are_asked_for_are_tried() -> None:
    """Without the cause among them nothing is named, and what is left is said."""
    few = replace(POLICY, keys=("sensor.encoder_eccentricity",))
    found = rverror.diagnose(BARE, runs_of(TRUE), policy=few)
    assert (found.verdict, found.added) == ("unexplained", ())
    assert found.unexplained
    assert found.unexplained[0].order == pytest.approx(16, abs=0.1)
    assert found.tried == 1


def test_where_every_candidate_is_taken_nothing_more_is_tried() -> None:
    theta = TURN * np.arange(512) / 512
    error = 5 * ARCSEC * np.cos(theta) + red(0, 512)
    run = rverror.run_from_arrays(input_angle=UNIT.ratio * theta, output_angle=theta + error, direction="forward")
    found = rverror.diagnose(BARE, [run], policy=replace(POLICY, keys=("sensor.encoder_eccentricity",)))
    assert [a.effect.key for a in found.added] == ["sensor.encoder_eccentricity"]
    assert found.tried == 1


def test_physics_that_is_not_the_package_s() -> None:
    """Finite bodies of the oracle, contacts that close by a power law, other stiffness: RV-40E, one turn each way."""
    unit = rverror.reducer("RV-40E")
    errors = PartErrors(unit)
    put_effect(errors, unit, "crank.eccentricity", {"crank": 0, "disc": 0}, {"radial": 8e-3, "tangential": -5e-3})
    springs = replace(REALISTIC, pin=1.4e5, cam=3.6e5, carrier=2.7e5)
    real = Reality(springs=springs, pin_law=Law(exponent=10 / 9))
    theta = 2 * math.pi * np.arange(512) / 512
    runs = []
    for number, direction in enumerate((1.0, -1.0)):
        clean, _ = transmission_error(unit, theta, errors, real, sense=int(direction), torque=50e3)
        turned = slice(None) if direction > 0 else slice(None, None, -1)
        error = (clean + red(number, 512))[turned]
        runs.append(
            rverror.run_from_arrays(
                input_angle=unit.ratio * theta[turned], output_angle=theta[turned] + error, direction=direction,
                torque=50e3,
            )
        )  # fmt: skip
    few = replace(POLICY, keys=("crank.eccentricity", "cycloid.disc_bore_position", "cycloid.disc_pitch",
                                "involute.planet_eccentricity", "sensor.encoder_eccentricity"))  # fmt: skip
    found = rverror.diagnose(Model(unit), runs, policy=few)
    (names,) = sets(found)
    assert HERE in names
    assert {key for key, _ in names} == {"crank.eccentricity"}
    assert found.after.heldout_rms < 1.2 * 0.3 * ARCSEC
    assert math.hypot(*found.added[0].effect.values) == pytest.approx(math.hypot(8e-3, 5e-3), rel=0.05)
