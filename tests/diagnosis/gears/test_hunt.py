"""The search's steps, each by itself: what is needless goes, what fits as well is named, what is strained is no end."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

import rverror
from gear_runs import OTHER, UNIT, begin, runs_of
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.account import half_widths, spread
from rverror.diagnosis.gears.fit import Fit, RunSet, begun, evaluated, fitted, proposed, renoised
from rverror.diagnosis.gears.hunt import (
    Hunt,
    Node,
    Trial,
    as_declared,
    begun_at,
    bent,
    distinct,
    explains_most,
    identity,
    inexact,
    leading_of_each,
    lifted,
    marked,
    mirrored,
    named,
    nearly_noise,
    onto,
    outlook,
    places,
    strained,
    tried,
    unsure,
)
from rverror.diagnosis.gears.record import records_of
from rverror.diagnosis.gears.reducers import candidates_of, placed, with_marks
from rverror.diagnosis.gears.screen import Proposal, screened
from rverror.diagnosis.gears.spectrum import best_lines
from rverror.diagnosis.gears.waveform import softened
from rverror.diagnosis.journal import Journal
from rverror.diagnosis.noise import RunNoise
from rverror.diagnosis.policy import POLICY
from rverror.geartrain.kinematics import fundamental_orders
from rverror.model.effects import Effect, Model
from rverror.statics.loaded_state import NotConvergedError

BARE = Model(UNIT)
CAM = rverror.effect("crank.eccentricity", crank=0, disc=0, radial="8 um", tangential="-5 um")
PINS = rverror.effect("cycloid.pin_radius", pin="all", deviation="6 um")
BOTH_WAYS = ((1.0, 50e3), (-1.0, 50e3), (1.0, 150e3))
LIGHT = ((1.0, 20e3), (-1.0, 20e3))


def settled(true: Model, *effects: Effect, declared: Model = BARE, **more: Any) -> Node:
    """The fit of runs with these effects added."""
    runs = runs_of(true, BOTH_WAYS, points=1024, **more)
    first = begin(declared, runs)
    start = replace(first.model, effects=(*declared.effects, *effects))
    return Node(fitted(renoised(fitted(evaluated(first.bench, start, declared), steps=30)), steps=30))


def hunt_of(node: Node) -> Hunt:
    candidates = candidates_of(node.fit.declared, node.fit.bench.records, POLICY)
    return Hunt(candidates, POLICY, Journal(lambda text: None))


@pytest.fixture(scope="module")
def right() -> Node:
    """The true cause, fitted."""
    return settled(Model(OTHER, (CAM,)), CAM)


@pytest.fixture(scope="module")
def crowded() -> Node:
    """The true cause beside one that is needless, and a line that is none."""
    profile = rverror.effect("cycloid.disc_profile", disc=1, harmonic=3, cos="0.5 um")
    node = settled(Model(OTHER, (CAM,)), CAM, profile)
    records = [replace(r, orders=(23.37,)) for r in node.fit.bench.records]
    fit = fitted(evaluated(node.fit.bench.with_records(records), node.fit.model, BARE, node.fit.waves))
    return Node(fit, (23.37,))


def test_pruning_drops_what_is_needless_and_keeps_what_is_not(crowded: Node) -> None:
    hunt = hunt_of(crowded)
    left = hunt.pruned(crowded)
    assert [e.key for e in left.fit.added] == ["crank.eccentricity"]
    assert left.lines == ()
    assert all(r.orders == () for r in left.fit.bench.records)
    assert left.score < crowded.score
    assert left.fit.added[0].values == pytest.approx(CAM.values, abs=3e-4)


def test_evidence_asks_more_of_more_sizes(right: Node, crowded: Node) -> None:
    """The score of a needless cause is worse by about the logarithm of how much better its sizes are known."""
    fit = crowded.fit
    covariance = fit.covariance
    own = covariance[2:4, 2:4]
    plausible = [p.plausible for p in rverror.CATALOGUE["cycloid.disc_profile"].parameters]
    expected = -math.log(np.linalg.det(own) / np.prod([(0.5 * p) ** 2 for p in plausible]))
    hunt = hunt_of(crowded)
    less = hunt.without_line(hunt.without(crowded, 1), 23.37)
    lines = 2 * POLICY.row_cost * len(fit.bench.records)
    cam = [np.linalg.slogdet(f.covariance[:2, :2])[1] for f in (fit, less.fit)]
    whole = np.linalg.slogdet(covariance[:2, :2])[1]
    assert crowded.score - less.score == pytest.approx(
        fit.objective - less.fit.objective + expected + lines - (whole - cam[1]), abs=1e-6
    )
    assert less.score == pytest.approx(right.score, abs=20)


def test_nothing_is_complete_without_the_cause_and_all_is_with_it(right: Node) -> None:
    assert hunt_of(right).complete(right)
    without = Node(fitted(evaluated(right.fit.bench, BARE, BARE)))
    assert not hunt_of(without).complete(without)


@pytest.mark.parametrize("gained", [0.0, 1e4])
def test_nothing_counts_that_only_moved_jumps_have_gained(
    right: Node, gained: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The cause is needed, looked beside and missed where its fall counts, and nowhere else."""
    asked: list[tuple[Fit, Fit]] = []

    def fall(before: Fit, after: Fit) -> float:
        asked.append((before, after))
        return gained

    monkeypatch.setattr("rverror.diagnosis.gears.hunt.fall", fall)
    bare = Node(fitted(evaluated(right.fit.bench, BARE, BARE)))
    assert bool(hunt_of(right).pruned(right).fit.added) == (gained > 0)
    assert bool(hunt_of(right).beside(bare, [])) == (gained > 0)
    assert all(before.objective > after.objective for before, after in asked)


def test_what_a_linear_step_promises_too_little_is_fitted_before_nothing_is_said_to_be_left(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A pin that is pushed in takes load from others: fitted it lowers the objective by more than a step promises."""
    pin = rverror.effect("cycloid.pin_position", pin=5, radial="0.6 um")
    node = settled(Model(OTHER, (pin,)))
    hunt = hunt_of(node)
    others = tuple(c for c in hunt.candidates if c[0] != "cycloid.pin_radius")
    (step,) = screened(node.fit, [(pin.key, pin.indices)])
    start = tried(node.fit, step)
    assert start is not None
    promised = node.fit.objective - step.objective
    fallen = node.fit.objective - fitted(start.fit, steps=30).objective
    assert fallen > promised + 5
    for share, complete in ((-0.5, False), (0.5, False), (1.5, True)):  # below the promise, between, above the fall
        asked = promised + share * (fallen - promised) - inexact(node.fit)
        policy = replace(POLICY, false_alarm=len(others) * math.exp(-asked / 2))  # chi-square of two sizes
        asking = replace(hunt, candidates=others, policy=policy)
        for gains in (not complete, False):
            with monkeypatch.context() as patch:
                if not gains:  # as where only a jump has moved
                    patch.setattr("rverror.diagnosis.gears.hunt.fall", lambda before, after: 0.0)
                now = replace(asking, _ranked={}, _completed={}).complete(node)
            assert now == (not gains if share > 0 else complete)


def test_a_strained_fit_is_never_complete() -> None:
    """A declared size that is off by 8 of its uncertainties; with five times the uncertainty it is not."""
    wrong = replace(CAM, values=(CAM.values[0] - 8e-4, CAM.values[1]), uncertainty=1e-4)
    node = settled(Model(UNIT, (CAM,)), declared=Model(UNIT, (wrong,)))
    assert node.fit.data < node.fit.bound
    assert strained(node.fit)
    nobody = replace(hunt_of(node), candidates=())
    assert not nobody.complete(node)
    bench = replace(node.fit.bench, policy=replace(POLICY, strained=1e-200))
    assert nobody.complete(Node(replace(node.fit, bench=bench)))  # nothing but the strain is against it
    calm = settled(Model(UNIT, (CAM,)), declared=Model(UNIT, (replace(wrong, uncertainty=5e-4),)))
    assert not strained(calm.fit)


def declared_off(by: float, added: tuple[Effect, ...] = ()) -> Fit:
    """A declared encoder, both its sizes so many uncertainties off, beside what was added; closed form."""
    encoder = rverror.effect("sensor.encoder_eccentricity", cos="0 arcsec", sin="0 arcsec", uncertainty="2 arcsec")
    (run,) = runs_of(BARE, ((1.0, 50e3),), points=512)
    record = replace(records_of(BARE, [run], POLICY)[0][0], torque=None, noise=RunNoise(np.zeros(0), ARCSEC))
    declared = Model(UNIT, (encoder,))
    now = Model(UNIT, (replace(encoder, values=(by * 2 * ARCSEC,) * 2), *added))
    return evaluated(RunSet.of(UNIT, [record], POLICY, points=512, anywhere=False), now, declared)


@pytest.mark.parametrize("added", [(), (CAM,), (replace(CAM, values=(3.0, -2.0)),)])
def test_only_what_was_declared_is_strained(added: tuple[Effect, ...]) -> None:
    """Two sizes' squares exceed -2 ln p by chance p; what was added may be of any size and counts in neither."""
    limit = math.sqrt(-math.log(POLICY.strained))
    assert not strained(declared_off(0.0, added))
    assert not strained(declared_off(0.99 * limit, added))
    assert strained(declared_off(1.01 * limit, added))


def test_the_opposite_of_what_was_fitted_is_offered_where_fits_may_end_there() -> None:
    """Once and twice, along what it was: of pins and discs, which unload, and only where they still are candidates."""
    profile = rverror.effect("cycloid.disc_profile", disc=0, harmonic=2, cos="4 um", sin="-3 um")
    other = replace(profile, indices={"disc": 1, "harmonic": 2})
    nodes = [Node(declared_off(0.0, (CAM, effect))) for effect in (profile, other, CAM)]
    named_alike = [
        Proposal(("cycloid.disc_profile", {"harmonic": 2, "disc": 0}), 1.0, np.array([1.0, 2.0]), np.zeros(3)),
        Proposal(("crank.eccentricity", dict(CAM.indices)), 2.0, np.array([1.0, 2.0]), np.zeros(3)),
    ]
    found = mirrored(nodes, [(nodes[0].fit, one) for one in named_alike])
    assert [one.name for one in found] == [named_alike[0].name] * 2
    assert [list(one.sizes) for one in found] == [pytest.approx([-0.004, 0.003]), pytest.approx([-0.008, 0.006])]


def test_rivals_hold_the_exact_twin_at_another_place(right: Node) -> None:
    """Half a turn on, crank 1 stands as crank 0 did and disc 1 as disc 0: no run tells the two apart."""
    rivals = hunt_of(right).rivals(right, 0)
    twin = next(r for r in rivals if dict(r.fit.added[0].indices) == {"crank": 1, "disc": 1})
    assert twin.fit.added[0].key == CAM.key
    assert twin.fit.objective == pytest.approx(right.fit.objective, abs=0.2)
    assert twin.fit.added[0].values == pytest.approx(right.fit.added[0].values, abs=1e-5)


def test_a_cause_does_not_give_way_to_its_exact_twin_that_was_fitted_further(right: Node) -> None:
    fit = right.fit
    nearly = replace(fit.added[0], values=tuple(0.97 * value for value in fit.added[0].values))
    model = replace(fit.model, effects=(*fit.declared.effects, nearly))
    behind = Node(evaluated(fit.bench, model, fit.declared))
    assert behind.score > right.score + 10
    assert hunt_of(behind).swapped(behind).names == right.names


def test_rivals_hold_the_exact_twin_of_another_key() -> None:
    """A disc ground smaller all around is pins that are all larger."""
    node = settled(Model(UNIT, (PINS, CAM)), PINS, declared=Model(UNIT, (CAM,)), rms=0.1)
    rivals = hunt_of(node).rivals(node, 0)
    keys = {r.fit.added[0].key: r for r in rivals}
    assert "cycloid.profile_modification" in keys, sorted(keys)
    twin = keys["cycloid.profile_modification"]
    assert twin.fit.objective == pytest.approx(node.fit.objective, abs=1.0)


def test_what_is_lifted_is_the_residual_with_it_back_in(right: Node) -> None:
    """Its linear part at the contacts as they are; then the screen finds it again at its size."""
    rest = lifted(right.fit, 0)
    assert rest.added == ()
    assert rest.data > 20 * right.fit.data
    for white, now in zip(rest.rows, right.fit.rows, strict=True):
        assert white[0] == pytest.approx(now[0] + np.array(right.fit.added[0].values) @ now[1:3])
    assert rest.moment == pytest.approx(sum(w[1:] @ w[0] for w in rest.rows))
    (one,) = screened(rest, [(CAM.key, dict(CAM.indices))])
    assert one.sizes == pytest.approx(right.fit.added[0].values, abs=3e-4)
    assert one.objective == pytest.approx(right.fit.objective, abs=5)


def test_the_screen_says_what_a_linear_refit_reaches(right: Node) -> None:
    """Against generalised least squares under the priors, written out; the true cause comes first."""
    start = as_declared(Node(fitted(evaluated(right.fit.bench, BARE, BARE))).fit)
    hunt = hunt_of(right)
    ranking = screened(start, hunt.candidates)
    assert ranking[0].name[0] == "crank.eccentricity"
    one = next(r for r in ranking if r.name == ("cycloid.disc_pitch", {"disc": 0, "harmonic": 1}))
    rows = start.bench.influences(start.model, start.waves, [one.name])
    white = [np.concatenate([w, s.whiten(r)]) for w, s, r in zip(start.rows, start.bench.sights, rows, strict=True)]
    every = np.concatenate(white, axis=1)
    prior = np.array([0.5 * p.plausible for p in rverror.CATALOGUE[one.name[0]].parameters])
    weights = np.concatenate([start.weights, prior**-2])
    step = np.concatenate([one.step, one.sizes])
    left = every[0] - step @ every[1:]
    scale = max(1.0, 1 + (float(left @ left) - start.bound) / 200)
    gradient = every[1:] @ left / scale - weights * step  # as declared: every prior is about where it stands
    size = np.sqrt(np.sum(every[1:] ** 2, axis=1) / scale + weights)
    assert np.abs(gradient / size).max() < 0.02 * math.sqrt(start.bound)
    data = float(left @ left)
    counted = data if data < start.bound else start.bound + 200 * math.log(1 + (data - start.bound) / 200)
    assert one.objective == pytest.approx(counted + float(weights @ step**2), rel=1e-6)


def test_a_size_that_cannot_be_is_not_offered() -> None:
    """Play is never negative: where the runs ask for less it is no candidate."""
    play = rverror.effect("crank.bearing_clearance", clearance="5 um")
    node = settled(Model(UNIT), declared=Model(UNIT, (play,)))
    exact = evaluated(node.fit.bench, Model(UNIT, (play,)), Model(UNIT, (play,)))
    names = {one.name[0]: one for one in screened(exact, [("coupling.bearing_clearance", {})])}
    assert all(one.sizes[0] >= 0 for one in names.values())


def test_a_clearance_is_tried_though_a_linear_step_makes_less_than_nothing_of_it() -> None:
    """Cams that are declared wrong by up to three uncertainties take the place of what it does to first order."""
    true, said = (
        ((1.4, -2.0), (-0.7, 2.5), (2.0, -1.8), (0.7, 5.5)),
        ((0.8, -3.1), (-0.7, 2.7), (3.1, -2.1), (0.7, 5.5)),
    )
    places = list(product((0, 1), (0, 1)))
    made, declared = (
        tuple(
            rverror.effect("crank.eccentricity", crank=crank, disc=disc, radial=f"{x} um", tangential=f"{y} um",
                           uncertainty="0.4 um")
            for (crank, disc), (x, y) in zip(places, sizes, strict=True)
        )
        for sizes in (true, said)
    )  # fmt: skip
    clearance = rverror.effect("crank.bearing_clearance", clearance="6 um")
    light = ((1.0, 20e3), (-1.0, 20e3))
    first = begin(Model(UNIT, declared), runs_of(Model(OTHER, (*made, clearance)), light, points=512))
    assert not screened(first, [(clearance.key, clearance.indices)])
    waves = (("cycloid.disc_pitch", {"disc": 0, "harmonic": 2}), ("cycloid.disc_profile", {"disc": 1, "harmonic": 2}))
    hunt = Hunt((*waves, (clearance.key, {})), POLICY, Journal(lambda text: None))
    best = hunt.children(Node(fitted(renoised(fitted(first)))))[0]
    assert [e.key for e in best.fit.added] == [clearance.key]
    assert best.fit.added[0].values[0] == pytest.approx(0.006, abs=3e-4)


def test_trials_start_at_sizes_that_a_workshop_makes(right: Node) -> None:
    without = fitted(evaluated(right.fit.bench, BARE, BARE))
    (one,) = screened(without, [("crank.eccentricity", {"crank": 0, "disc": 0})])
    plausible = np.array([p.plausible for p in rverror.CATALOGUE["crank.eccentricity"].parameters])
    wild = tried(without, replace(one, sizes=100 * one.sizes))
    calm = tried(without, one)
    assert wild is not None
    assert calm is not None
    assert np.abs(wild.fit.added[0].values / plausible).max() == pytest.approx(0.7)
    assert calm.fit.added[0].values == pytest.approx(one.sizes)
    assert calm.prospect < without.objective
    opposite = tried(without, replace(one, sizes=-one.sizes))
    aside = tried(without, replace(one, sizes=one.sizes[::-1] * np.array([1, -1])))
    assert opposite is not None
    assert aside is not None
    # larger in the same direction it is the same start; the other way, or across, it is another
    assert distinct([calm, wild, opposite, aside], 3) == [calm, opposite, aside]
    assert distinct([calm, wild, opposite, aside], 2) == [calm, opposite]
    assert distinct([wild, calm, opposite], 1) == [wild]
    assert named(calm.fit.added[0]) == ("crank.eccentricity", ("crank", 0), ("disc", 0))


def test_a_cause_is_needed_however_large_it_is() -> None:
    """A hundredth of a wave of 40 arcsec is many squares, but as squares count what it explains is more."""
    cam = replace(CAM, values=(0.04, 0.0))
    node = settled(Model(OTHER, (cam,)), cam)
    assert [e.key for e in hunt_of(node).pruned(node).fit.added] == [CAM.key]


def made_by_what_was_added(fit: Fit) -> list[Any]:
    """Filtered samples of each run: what is left without what was added, less what is left with it."""
    model = replace(fit.model, effects=fit.declared.effects)
    without = evaluated(fit.bench, model, fit.declared)
    return [less[0] - both[0] for less, both in zip(without.rows, fit.rows, strict=True)]


def test_what_the_equilibrium_is_not_right_to_is_not_significant(right: Node) -> None:
    """0.01 arcsec over n samples in 0.3 of noise, a 900th of a square each, and a hundredth of what was added."""
    fit: Fit = right.fit
    n = sum(r.theta.size for r in fit.bench.records)
    assert unsure(fit, POLICY) == pytest.approx(n / 900, rel=0.1)
    hunt = hunt_of(right)
    own = unsure(fit, POLICY) + 0.01**2 * sum(float(p @ p) for p in made_by_what_was_added(fit))
    assert inexact(fit) == pytest.approx(200 * math.log1p(own / 200))
    least = inexact(fit)
    assert not hunt.significant(fit, least + 10, 2)
    assert hunt.significant(fit, least + 40, 2)


def test_beside_large_residuals_the_model_s_own_error_counts_as_they_do() -> None:
    """Beyond N squares count by their logarithm: o more beside D are M ln((M + D + o - N) / (M + D - N))."""
    fit = settled(Model(OTHER, (CAM,))).fit
    assert fit.data > 2 * fit.bound
    own = unsure(fit, POLICY) + bent(fit, POLICY)
    beyond = 200 + fit.data - fit.bound
    assert inexact(fit) == pytest.approx(200 * math.log((beyond + own) / beyond), rel=1e-6)
    assert inexact(fit) < 0.2 * own


def test_intervals_hold_what_the_model_is_not_right_to_about_what_was_added(right: Node) -> None:
    """Squares of a share of the cam's waves, shared by all values: of 5 % they are 25 times those of 1 %."""
    fit = right.fit
    squares = sum(float(p @ p) for p in made_by_what_was_added(fit)) / np.isfinite(fit.weights).sum()
    through = np.diag(fit.covariance @ fit.gram @ fit.covariance) / fit.scale
    for share in (0.01, 0.05):
        policy = replace(POLICY, model_error=1e-9 * ARCSEC, added_share=share)
        told = spread(replace(fit, bench=replace(fit.bench, policy=policy)))
        assert told[:2] == pytest.approx(np.diag(fit.covariance)[:2] + share**2 * squares * through[:2], rel=1e-3)
        assert told[0] > 1.05 * fit.covariance[0, 0]


def test_nothing_is_said_of_a_fit_under_other_candidates() -> None:
    """Half a micron of one pin shows in no order by itself: without candidates nothing is left, with them it is."""
    node = settled(Model(OTHER, (rverror.effect("cycloid.pin_position", pin=5, radial="-0.5 um"),)))
    hunt = hunt_of(node)
    few = hunt.with_candidates(())
    assert few.ranking(node.fit) == []
    assert few.complete(node)
    assert hunt.ranking(node.fit)[0].name[0] == "cycloid.pin_position"
    assert not hunt.complete(node)


def test_the_model_is_right_about_what_is_read_at_the_output(right: Node) -> None:
    """A hundredth of a part's waveform may be the model's own error, of an encoder's nothing."""
    encoder = rverror.effect("sensor.encoder_eccentricity", cos="40 arcsec")
    bench = right.fit.bench
    read = evaluated(bench, replace(right.fit.model, effects=(encoder,)), BARE)
    both = evaluated(bench, replace(right.fit.model, effects=(*right.fit.model.effects, encoder)), BARE)
    assert bent(read, POLICY) == 0
    assert bent(both, POLICY) == pytest.approx(bent(right.fit, POLICY))
    assert bent(right.fit, POLICY) > 0


def test_what_was_added_is_held_against_what_it_makes_not_its_influence() -> None:
    """Where pins are thinner all alike others carry than where they are not: their influence there says too much."""
    pins = replace(PINS, values=(-0.012,))
    fit = evaluated(settled(Model(OTHER, (pins,))).fit.bench, Model(UNIT, (pins,)), BARE)
    squares = sum(float(p @ p) for p in made_by_what_was_added(fit))
    linear = sum(float(np.sum((pins.values[0] * rows[1]) ** 2)) for rows in fit.rows)
    assert bent(fit, POLICY) == pytest.approx(1e-4 * squares, rel=1e-6)
    assert squares < linear / 10


def test_two_causes_give_way_to_one_that_does_as_well() -> None:
    """A bore of the carrier moved one way is the bores of both discs on its crank moved the other: one is likelier."""
    bore = rverror.effect("coupling.carrier_bore_position", crank=0, radial="22 um", tangential="-14 um")
    both = [
        rverror.effect("cycloid.disc_bore_position", disc=disc, crank=0, radial="-22 um", tangential="14 um")
        for disc in (0, 1)
    ]
    node = settled(Model(OTHER, (bore,)), *both)
    assert node.fit.data < node.fit.bound
    keys = {bore.key, both[0].key, "crank.eccentricity", "cycloid.disc_profile"}
    hunt = hunt_of(node)
    hunt = replace(hunt, candidates=tuple(c for c in hunt.candidates if c[0] in keys))
    one = hunt.swapped(node)
    assert [e.key for e in one.fit.added] == [bore.key]
    assert one.score < node.score - 5
    # the bore of the other crank, moved the other way, is hardly told from it by contacts, nor is its own opposite
    true = next(n for n in (one, *hunt.rivals(one, 0)) if n.fit.added[0].indices == bore.indices)
    assert true.fit.objective < one.fit.objective + 9
    own = fitted(evaluated(one.fit.bench, replace(one.fit.model, effects=(bore,)), BARE), steps=30)
    assert own.objective < one.fit.objective + 1
    assert np.all(np.abs(np.subtract(own.added[0].values, bore.values)) < 3.5 * np.sqrt(np.diag(own.covariance)[:2]))


def test_what_fits_only_by_straining_is_swapped_before_it_is_given_up() -> None:
    """A cam does what a planet does only beside the cam's declared twin, moved by 18 of its uncertainties."""
    cam = replace(CAM, values=(2e-3, -1e-3))
    stated = rverror.effect(CAM.key, crank=1, disc=1, radial="0 um", uncertainty="0.1 um")
    planet = rverror.effect("involute.planet_eccentricity", crank=0, x="1 um")
    node = settled(Model(OTHER, (cam,)), planet, declared=Model(UNIT, (stated,)))
    assert node.fit.data < node.fit.bound
    assert strained(node.fit)
    hunt = hunt_of(node)
    few = tuple(c for c in hunt.candidates if c[0] in {cam.key, planet.key})
    best, done = replace(hunt, candidates=few, policy=replace(POLICY, most_effects=1)).best([node], 1)
    assert done
    assert [e.key for e in best.fit.added] == [cam.key]
    assert not strained(best.fit)


def test_what_no_workshop_makes_is_looked_beside_last(right: Node) -> None:
    """Twice the plausible size and more, while it is no fit; where it is one it is as good as any."""
    plausible = rverror.CATALOGUE[CAM.key].parameters[0].plausible
    states = [
        Node(evaluated(right.fit.bench, replace(right.fit.model, effects=(replace(CAM, values=(size, 0.0)),)), BARE))
        for size in (1.9 * plausible, 2.1 * plausible)
    ]
    assert [outlook(node)[0] for node in states] == [False, True]
    assert outlook(states[0])[1] == states[0].score
    assert sorted([states[1], right, states[0]], key=outlook) == [right, states[0], states[1]]


def test_with_everything_else_held_the_screen_gives_a_candidates_own_least_squares(right: Node) -> None:
    """Ridge regression of the residual on its rows alone, under its prior, written out."""
    start = Node(fitted(evaluated(right.fit.bench, BARE, BARE))).fit
    name = ("crank.eccentricity", {"crank": 0, "disc": 0})
    (one,) = screened(start, [name], hold=True)
    rows = start.bench.influences(start.model, start.waves, [name])
    white = np.concatenate([s.whiten(r) for s, r in zip(start.bench.sights, rows, strict=True)], axis=1)
    left = np.concatenate([w[0] for w in start.rows])
    prior = np.array([0.5 * p.plausible for p in rverror.CATALOGUE[name[0]].parameters])
    rest = left - one.sizes @ white
    scale = max(1.0, 1 + (float(rest @ rest) - start.bound) / 200)
    expected = np.linalg.solve(white @ white.T / scale + np.diag(prior**-2), white @ left / scale)
    assert one.sizes == pytest.approx(expected, rel=0.02)  # the scale is told to 1 %
    assert not one.step.any()


@pytest.mark.parametrize("sizes_um", [(0.8, -0.7, 0.3, -0.6), (-7.2, 3.0, -4.4, 9.2)])
def test_a_wave_of_the_pins_is_begun_anew_where_its_fit_ended_elsewhere(sizes_um: tuple[float, ...]) -> None:
    """From these sizes a fit ends far from the truth, since pins that are drawn back carry nothing."""
    true = rverror.effect(
        "cycloid.pin_circle", harmonic=3, radial_cos="3.8 um", radial_sin="7.3 um", tangential_cos="2.6 um",
        tangential_sin="-3.1 um",
    )  # fmt: skip
    first = begin(BARE, runs_of(Model(OTHER, (true,)), LIGHT, points=1024))
    known = renoised(fitted(evaluated(first.bench, Model(UNIT, (true,)), BARE), steps=30))
    other = replace(true, values=tuple(1e-3 * size for size in sizes_um))
    node = Node(fitted(evaluated(known.bench, Model(UNIT, (other,)), BARE), steps=30))
    assert node.fit.data > node.fit.bound
    found = hunt_of(node).restarted(node)
    assert hunt_of(found).complete(found)
    assert [e.key for e in found.fit.added] == [true.key]
    signs = np.sign(found.fit.added[0].values[0])  # of a train without other errors both signs of order 3 are alike
    assert signs * np.array(found.fit.added[0].values) == pytest.approx(true.values, abs=3e-4)


def test_over_a_part_of_a_turn_a_wave_of_the_pins_gives_way_to_one_of_another_harmonic() -> None:
    """There they look alike."""
    sizes = {"radial_cos": "3.8 um", "radial_sin": "7.3 um", "tangential_cos": "2.6 um", "tangential_sin": "-3.1 um"}
    true, other = (rverror.effect("cycloid.pin_circle", harmonic=harmonic, **sizes) for harmonic in (3, 2))
    first = begin(BARE, runs_of(Model(OTHER, (true,)), LIGHT, points=1024, turns=0.4))
    node = Node(fitted(renoised(fitted(evaluated(first.bench, Model(UNIT, (other,)), BARE))), steps=30))
    waves = [(true.key, {"harmonic": harmonic}) for harmonic in (2, 3, 5)]
    hunt = Hunt(tuple(waves), POLICY, Journal(lambda text: None))
    assert not hunt.complete(node)
    found = hunt.restarted(node)
    assert [e.indices for e in found.fit.added] == [true.indices]
    assert hunt.complete(found)


def test_over_a_whole_turn_a_wave_of_the_pins_begins_anew_as_itself() -> None:
    wave = rverror.effect("cycloid.pin_circle", harmonic=2, radial_cos="5 um")
    pin = ("cycloid.pin_position", {"pin": 3})
    free = [(wave.key, {"harmonic": 3}), ("cycloid.disc_pitch", {"disc": 0, "harmonic": 3}), pin]
    assert places(wave, UNIT, free, whole_turn=True) == [(wave.key, wave.indices)]
    assert places(wave, UNIT, free, whole_turn=False) == [(wave.key, wave.indices), free[0]]


@pytest.mark.parametrize(
    "beside",
    [
        rverror.effect("cycloid.pin_position", pin=4, tangential="2 um"),
        rverror.effect("cycloid.pin_position", pin=6, tangential="2 um"),
        rverror.effect("cycloid.pin_radius", pin=6, deviation="2 um"),
    ],
    ids=str,
)
def test_a_pin_that_stands_for_the_one_beside_it_gives_way(beside: Effect) -> None:
    """Pushed in by 5 um at light load a pin carries for those beside it, which look much like it."""
    pin = rverror.effect("cycloid.pin_position", pin=5, radial="5.5 um", tangential="7.8 um")
    first = begin(BARE, runs_of(Model(OTHER, (pin,)), LIGHT, points=1024))
    node = Node(fitted(renoised(fitted(evaluated(first.bench, Model(UNIT, (beside,)), BARE))), steps=30))
    hunt = hunt_of(node)
    assert not hunt.complete(node)
    found = hunt.restarted(node)
    assert [e.indices for e in found.fit.added] == [pin.indices]
    assert hunt.complete(found)


RUNOUT = rverror.effect("coupling.carrier_runout", x="-3.7 um", y="3.8 um")


def test_a_carrier_whose_discs_balance_is_found_though_no_linear_step_tells_of_it() -> None:
    """Its forces cancel: twice the runout makes four times the error, and either sign the same."""
    first = begin(BARE, runs_of(Model(OTHER, (RUNOUT,)), LIGHT, points=1024))
    wave = rverror.effect("cycloid.disc_pitch", disc=1, harmonic=2, cos="-0.5 um", sin="-0.4 um")
    node = Node(fitted(renoised(fitted(evaluated(first.bench, Model(UNIT, (wave,)), BARE))), steps=30))
    hunt = hunt_of(node)
    (linear,) = screened(first, [(RUNOUT.key, {})])
    assert np.abs(linear.sizes).max() < 1e-9
    rival = hunt.rivals(node, 0)[0]
    assert rival.names == frozenset([named(RUNOUT)])
    signed = math.copysign(1, rival.fit.added[0].values[1]) * np.array(rival.fit.added[0].values)
    assert signed == pytest.approx(RUNOUT.values, abs=3e-4)
    opposites = hunt.opposites(rival)
    assert [np.sign(fit.added[0].values[1]) for fit in opposites] == [-np.sign(rival.fit.added[0].values[1])]
    whole = half_widths(rival.fit, opposites)[:2]
    assert (np.array(whole) > 2 * np.abs(rival.fit.added[0].values)).all()
    assert hunt.opposites(node) == []  # of a wave the sign shows


class Chained(Hunt):
    """A search in which each of two causes ends at a better place once the other has, from X Y to A B."""

    ways: ClassVar = {("XY", "pin_position"): "XZ", ("XZ", "pin_circle"): "AZ", ("AZ", "pin_position"): "AB"}

    def complete(self, node: Any) -> bool:
        return node.names == "AB"

    def _begun_anew(self, node: Any, effect: Any) -> Any:
        key = effect.key.split(".")[1]
        self.journal.tell(key)
        other = self.ways.get((node.names, key))
        return self.set_of(other, last=effect.key) if other else node

    @staticmethod
    def set_of(names: str, *, last: str = "") -> Any:
        keys = sorted(("cycloid.pin_circle", "cycloid.pin_position", "crank.eccentricity"), key=last.__eq__)
        return SimpleNamespace(names=names, fit=SimpleNamespace(added=[SimpleNamespace(key=key) for key in keys]))


def test_what_one_cause_has_found_lets_another_go_on() -> None:
    """The pin moves, then the wave, then the pin again; the cam, which turns, was begun in every race."""
    told: list[str] = []
    hunt = Chained((), POLICY, Journal(told.append))
    assert hunt.restarted(Chained.set_of("XY")).names == "AB"
    assert told == ["pin_circle", "pin_position", "pin_circle", "pin_position"]
    told.clear()
    other = Chained.set_of("Q")
    assert hunt.restarted(other) is other
    assert told == ["pin_circle", "pin_position"]
    told.clear()
    assert hunt.restarted(Chained.set_of("AZ")).names == "AB"
    assert told == ["pin_circle", "pin_position"]


def test_a_cause_beside_which_nothing_has_moved_is_not_begun_again() -> None:
    """The wave moves, the pin does not follow: from the same others the wave would end where it is."""
    told: list[str] = []
    hunt = Chained((), POLICY, Journal(told.append))
    hunt.ways = {("XY", "pin_circle"): "AY"}  # type: ignore[misc]
    assert hunt.restarted(Chained.set_of("XY")).names == "AY"
    assert told == ["pin_circle", "pin_position"]


def test_causes_that_hold_one_another_in_a_wrong_place_change_it_together() -> None:
    """On the other disc, all opposite, both look alike but for the contacts; one of them alone cannot follow."""
    here = [
        rverror.effect("cycloid.disc_profile", disc=1, harmonic=1, cos="2.6 um", sin="2.5 um"),
        rverror.effect("coupling.carrier_bore_position", crank=1, radial="3.5 um", tangential="15.6 um"),
    ]
    there = [replace(here[0], indices={"disc": 0, "harmonic": 1}), here[1]]
    known = (
        rverror.effect("cycloid.disc_pitch", disc=0, harmonic=1, cos="0.8 um", sin="-5 um"),
        rverror.effect("cycloid.disc_pitch", disc=1, harmonic=1, cos="-1 um", sin="-0.2 um"),
        rverror.effect("crank.eccentricity", crank=0, disc=1, radial="-1.4 um", tangential="-1.4 um"),
    )
    declared = Model(UNIT, tuple(replace(effect, uncertainty=3e-4) for effect in known))
    first = begin(declared, runs_of(Model(OTHER, (*known, *here)), LIGHT, points=1024))
    noise = renoised(fitted(evaluated(first.bench, replace(declared, effects=(*declared.effects, *here)), declared)))
    opposite = [replace(effect, values=tuple(-value for value in effect.values)) for effect in there]
    start = replace(declared, effects=(*declared.effects, *opposite))
    node = Node(fitted(evaluated(noise.bench, start, declared), steps=30))
    hunt = hunt_of(node)
    assert not hunt.complete(node)
    found = hunt.transposed(node)
    assert hunt.complete(found)
    assert found.names == frozenset(map(named, here))
    for effect, true in zip(found.fit.added, here, strict=True):
        assert effect.values == pytest.approx(true.values, abs=1e-3)
    assert all(rival.score > found.score + 100 for at in (0, 1) for rival in hunt.rivals(node, at))
    assert hunt.transposed(found) is found


@pytest.fixture(scope="module")
def ground_off() -> Node:
    """The declared cam alone, where the profile of all discs was ground off as well."""
    profile = rverror.effect("cycloid.profile_modification", equidistant="8 um", shift="-6 um")
    cam = replace(CAM, uncertainty=3e-4)
    first = begin(Model(UNIT, (cam,)), runs_of(Model(OTHER, (cam, profile)), LIGHT, points=1024))
    return Node(fitted(renoised(fitted(first)), steps=30))


def test_a_profile_is_fitted_to_the_end_from_sizes_that_a_workshop_makes(ground_off: Node) -> None:
    """It opens contacts, or does not: from what a linear step makes of it a fit ends elsewhere."""
    hunt, fit = hunt_of(ground_off), ground_off.fit
    found = hunt.hidden(ground_off)
    assert found is not None
    (profile,) = found.fit.added
    assert profile.key == "cycloid.profile_modification"
    assert profile.values == pytest.approx((8e-3, -6e-3), abs=1e-3)
    (linear,) = [one for one in hunt.ranking(fit) if one.name[0] == profile.key]
    trial = tried(fit, linear)
    assert trial is not None
    assert fitted(trial.fit, steps=30).objective > found.fit.objective + 100
    assert hunt.hidden(found) is None  # once


def test_what_promises_nothing_near_is_not_followed_to_its_end(ground_off: Node) -> None:
    """The profile that is there ends where it did without a bound that it comes below; below half of it none stays."""
    hunt = hunt_of(ground_off)
    plain = as_declared(onto(hunt.coarse(ground_off), ground_off.fit))
    ends = hunt.alike(plain)
    best = ends[0].fit
    bounded = hunt.alike(plain, below=best.objective + 1)
    assert [trial.fit.added for trial in bounded] == [best.added]
    assert len(ends) > 1
    assert not hunt.alike(plain, below=best.objective / 2)


LOBE = rverror.effect("cycloid.disc_lobe", disc=0, lobe=3, deviation="5 um")


@pytest.mark.parametrize("instead", [PINS, LOBE], ids=["pins", "lobe"])
def test_a_profile_is_among_the_rivals_of_what_stands_for_it(ground_off: Node, instead: Effect) -> None:
    """No linear step from there tells its sizes, not even where it is the exact twin of one of its parts."""
    fit = ground_off.fit
    model = replace(fit.model, effects=(*fit.model.effects, instead))
    node = Node(fitted(evaluated(fit.bench, model, fit.declared), steps=30))
    rivals = hunt_of(node).rivals(node, 0)
    names = [rival.names for rival in rivals]
    assert len(names) == len(set(names))
    assert node.names not in names
    assert rivals[0].fit.added[0].key == "cycloid.profile_modification"
    assert rivals[0].fit.added[0].values == pytest.approx((8e-3, -6e-3), abs=1e-3)


def test_what_settles_is_told_though_the_model_s_error_about_a_large_cause_is_larger() -> None:
    """No error of the model settles: beside a cam 60 um off its place 0.9 arcsec that does is left to be found."""
    cam = replace(CAM, values=(0.05, -0.03))
    runs = runs_of(
        Model(OTHER, (cam,)), points=512, turns=3.0,
        more=lambda theta, share: 0.9 * ARCSEC * np.exp(-share / 0.1),
    )  # fmt: skip
    first = begin(BARE, runs)
    node = Node(fitted(renoised(fitted(evaluated(first.bench, Model(UNIT, (cam,)), BARE), steps=30)), steps=30))
    hunt = hunt_of(node)
    (settling,) = hunt._regular(node)
    gained = node.fit.objective - settling.fit.objective
    assert settling.slow
    assert 50 < gained < inexact(node.fit)
    assert not hunt.complete(node)
    assert hunt.complete(settling)
    assert hunt.pruned(settling).slow
    assert hunt._better(node, settling, node.fit)


@pytest.mark.parametrize(("arcsec", "complete"), [(0.14, True), (0.2, False)])
def test_a_line_that_chance_makes_now_and_then_overthrows_no_cause(right: Node, arcsec: float, complete: bool) -> None:
    """It is told all the same; one that noise hardly ever makes leaves a set incomplete."""
    wave = arcsec * ARCSEC
    records = [replace(r, error=r.error + wave * np.cos(23.37 * r.theta)) for r in right.fit.bench.records]
    node = Node(fitted(evaluated(right.fit.bench.with_records(records), right.fit.model, right.fit.declared)))
    (line,) = best_lines(node.fit, POLICY, outside=False)
    assert line.order == pytest.approx(23.37, abs=0.3)
    assert hunt_of(node).complete(node) == complete


def test_marks_are_placed_anew_where_one_cause_is_none() -> None:
    """Turned by wrong marks a planet's wave fits as well, but not the declared cam's, which is known to 0.3 um."""
    cam = replace(CAM, uncertainty=3e-4)
    planet = rverror.effect("involute.planet_eccentricity", crank=0, x="30 um", y="-20 um")
    declared, ahead = Model(UNIT, (cam,)), 0.21
    runs = [replace(r, index="unknown") for r in runs_of(Model(UNIT, (cam, planet)), BOTH_WAYS, marks=ahead)]
    model, anywhere = with_marks(declared, runs)
    records, _ = records_of(model, runs, POLICY)
    bench = RunSet.of(UNIT, records, POLICY, points=1024, anywhere=anywhere)
    first = begun(bench, model, model)
    hunt, first = placed(Hunt(candidates_of(model, records, POLICY), POLICY, Journal(lambda text: None)), first)
    both = replace(model, effects=(*model.effects, planet))
    wrong = evaluated(bench.with_records(first.bench.records), marked(both, ahead + 0.08), model)
    free = np.ones(wrong.moment.size, dtype=np.bool_)
    free[2] = False  # the marks, after the cam's two
    node = Node(fitted(wrong, free=free, steps=40))
    assert not hunt.complete(node)
    found = hunt.remarked(node)
    assert hunt.complete(found)
    period = 2 * math.pi / fundamental_orders(UNIT)["crank"]
    off = (found.fit.model.index_offset - ahead + period / 2) % period - period / 2
    assert abs(off) < 0.003
    known = replace(hunt, offsets=())
    assert known.remarked(node) is node


def test_a_wave_of_the_pins_keeps_its_sizes_while_marks_are_placed_anew() -> None:
    """At light load no linear step finds its four sizes; those that were fitted at wrong marks are nearly right."""
    cam = replace(CAM, uncertainty=3e-4)
    wave = rverror.effect(
        "cycloid.pin_circle", harmonic=2, radial_cos="-6.4 um", radial_sin="2.4 um", tangential_cos="-3.8 um",
        tangential_sin="6.0 um",
    )  # fmt: skip
    declared, ahead, light = Model(UNIT, (cam,)), 0.03, ((1.0, 20e3), (-1.0, 20e3))
    runs = [replace(r, index="unknown") for r in runs_of(Model(UNIT, (cam, wave)), light, points=1024, marks=ahead)]
    model, anywhere = with_marks(declared, runs)
    records, _ = records_of(model, runs, POLICY)
    first = begun(RunSet.of(UNIT, records, POLICY, points=1024, anywhere=anywhere), model, model)
    period = 2 * math.pi / fundamental_orders(UNIT)["crank"]
    offsets = tuple(np.arange(24) * period / 24)
    hunt = Hunt(((wave.key, wave.indices),), POLICY, Journal(lambda text: None), offsets=offsets)
    wrong = marked(replace(model, effects=(*model.effects, wave)), ahead + 0.05)
    free = np.ones(len(first.moment) + 4, dtype=np.bool_)
    free[2] = False  # the marks, after the cam's two
    known = renoised(fitted(evaluated(first.bench, marked(wrong, ahead), model), steps=30))
    node = Node(fitted(evaluated(known.bench, wrong, model), free=free, steps=40))
    assert not hunt.complete(node)
    found = hunt.remarked(node)
    assert hunt.complete(found)
    assert abs((found.fit.model.index_offset - ahead + period / 2) % period - period / 2) < 0.003


def test_a_pin_is_tried_with_the_next_marks_that_fit_in_the_place_that_it_then_has() -> None:
    """The pin beside the true one fits at marks that are one ripple off, where no step leads on."""
    cam, ahead = replace(CAM, uncertainty=3e-4), 0.13
    ripple = 2 * math.pi / fundamental_orders(UNIT)["cycloid mesh"]
    pin, beside = (rverror.effect("cycloid.pin_radius", pin=number, deviation="5 um") for number in (5, 4))
    runs = [replace(r, index="unknown") for r in runs_of(Model(UNIT, (cam, pin)), LIGHT, points=1024, marks=ahead)]
    model, anywhere = with_marks(Model(UNIT, (cam,)), runs)
    records, _ = records_of(model, runs, POLICY)
    first = begun(RunSet.of(UNIT, records, POLICY, points=1024, anywhere=anywhere), model, model)
    there = marked(replace(model, effects=(*model.effects, pin)), ahead)
    known = renoised(fitted(evaluated(first.bench.anchored(ahead), there, model), steps=30))
    wrong = marked(replace(model, effects=(*model.effects, beside)), ahead + ripple)
    node = Node(fitted(evaluated(known.bench, wrong, model), steps=30))
    assert node.fit.model.index_offset == pytest.approx(ahead + ripple, abs=0.1 * ripple)
    pins = tuple((pin.key, {"pin": number}) for number in range(UNIT.pins))
    hunt = Hunt(pins, POLICY, Journal(lambda text: None), offsets=(ahead + ripple,))
    assert not hunt.complete(node)
    found = hunt.remarked(node)
    assert hunt.complete(found)
    assert found.fit.added[0].indices == pin.indices
    assert found.fit.model.index_offset == pytest.approx(ahead, abs=0.1 * ripple)
    planet = rverror.effect("involute.planet_eccentricity", crank=0, x="3 um", y="-2 um")
    turning = Node(fitted(evaluated(known.bench, replace(model, effects=(*model.effects, planet)), model)))
    assert hunt._rippled(turning, [(planet.key, planet.indices)]) is turning


def fitted_at_marks(ripples: int, **noise: float) -> tuple[Node, float, float]:
    """A bore beside a declared cam, fitted so many ripples off the marks; how many it is off then, and one ripple."""
    cam = rverror.effect("crank.eccentricity", crank=0, disc=0, radial="3 um", tangential="-2 um")
    cam = replace(cam, uncertainty=6e-4)
    bore = rverror.effect("cycloid.disc_bore_position", disc=1, crank=0, radial="1 um", tangential="3 um")
    ahead, ripple = 0.1, 2 * math.pi / fundamental_orders(UNIT)["cycloid mesh"]
    true = runs_of(Model(UNIT, (cam, bore)), ((1.0, 50e3), (-1.0, 50e3)), points=1024, marks=ahead, **noise)
    runs = [replace(r, index="unknown") for r in true]
    model, anywhere = with_marks(Model(UNIT, (cam,)), runs)
    records, _ = records_of(model, runs, POLICY)
    bench = RunSet.of(UNIT, records, POLICY, points=1024, anywhere=anywhere)
    there = marked(replace(model, effects=(*model.effects, bore)), ahead + ripples * ripple)
    known = begun(bench, marked(there, ahead), model)
    fit = fitted(evaluated(known.bench, there, model), steps=30)
    return Node(fit), (fit.model.index_offset - ahead) / ripple, ripple


def test_every_ripple_of_the_mesh_has_marks_that_fit_and_the_best_are_taken() -> None:
    node, off, ripple = fitted_at_marks(1)
    assert off == pytest.approx(1, abs=0.1)  # a minimum, where no step leads on
    best, alike = Hunt((), POLICY, Journal(lambda text: None)).ripples_apart(node)
    assert best.fit.objective < node.fit.objective - 4
    assert (best.fit.model.index_offset - node.fit.model.index_offset) / ripple == pytest.approx(-off, abs=0.1)
    assert alike == []


def test_intervals_hold_the_sizes_at_marks_that_chance_does_not_tell() -> None:
    """In four times the noise ripples are not told apart: the cam's size, the bore's and the marks go with them."""
    node, _, ripple = fitted_at_marks(0, rms=1.2)
    best, alike = Hunt((), POLICY, Journal(lambda text: None)).ripples_apart(node)
    assert alike
    alone, whole = np.array(half_widths(best.fit)), np.array(half_widths(best.fit, alike))
    assert (whole >= alone).all()
    marks = 2
    assert alone[marks] < ripple < whole[marks]
    for other in alike:
        sizes, those = ([v for e in fit.model.effects for v in e.values] for fit in (best.fit, other))
        assert (np.abs(np.subtract(those, sizes)) < whole[: len(sizes)]).all()


def test_marks_at_every_angle_are_tried_with_every_candidate() -> None:
    """A cam far off its place turns the match of what was declared: the right marks may come last by that."""
    profile = rverror.effect("cycloid.disc_profile", disc=0, harmonic=2, cos="2 um", uncertainty="0.3 um")
    cam = rverror.effect("crank.eccentricity", crank=0, disc=0, radial="9 um", tangential="-4 um")
    declared, ahead = Model(UNIT, (profile,)), 0.03
    runs = [replace(r, index="unknown") for r in runs_of(Model(UNIT, (profile, cam)), BOTH_WAYS, marks=ahead)]
    model, anywhere = with_marks(declared, runs)
    records, _ = records_of(model, runs, POLICY)
    first = begun(RunSet.of(UNIT, records, POLICY, points=1024, anywhere=anywhere), model, model)
    period = 2 * math.pi / fundamental_orders(UNIT)["crank"]
    offsets = sorted(np.arange(12) * period / 12, key=lambda offset: -abs(offset - ahead))
    candidates = ((cam.key, cam.indices), ("involute.planet_eccentricity", {"crank": 0}))
    hunt = Hunt(candidates, POLICY, Journal(lambda text: None), offsets=tuple(offsets))
    best = hunt.children(Node(fitted(first)))[0]
    assert [e.key for e in best.fit.added] == [cam.key]
    assert abs((best.fit.model.index_offset - ahead + period / 2) % period - period / 2) < 0.003


def test_with_patience_a_runout_is_found_at_unknown_marks() -> None:
    """At marks that are a little off its linear step promises less than that of many others, and a race drops it."""
    sizes = ((0, 0, 0.8, -0.6), (0, 1, -1.0, 0.5), (1, 0, 0.4, 1.1), (1, 1, -0.7, -0.2))
    cams = tuple(
        Effect("crank.eccentricity", {"crank": j, "disc": k}, (1e-3 * r, 1e-3 * t), 3e-4) for j, k, r, t in sizes
    )
    runout = rverror.effect("coupling.carrier_runout", x="-25 um", y="-15 um")
    runs = [replace(r, index="unknown") for r in runs_of(Model(OTHER, (*cams, runout)), LIGHT, marks=0.05)]
    model, anywhere = with_marks(Model(UNIT, cams), runs)
    records, _ = records_of(model, runs, POLICY)
    first = begun(RunSet.of(UNIT, records, POLICY, points=1024, anywhere=anywhere), model, model)
    keys = (runout.key, "cycloid.disc_profile", "cycloid.disc_pitch", "involute.planet_pitch")
    names = tuple(c for c in candidates_of(model, records, POLICY) if c[0] in keys)
    hunt, first = placed(Hunt(names, POLICY, Journal(lambda text: None), patient=True), first)
    best = hunt.children(Node(fitted(renoised(fitted(first)))))[0]
    assert hunt.complete(best)
    assert [e.key for e in best.fit.added] == [runout.key]
    assert best.fit.added[0].values == pytest.approx(runout.values, abs=2e-3)
    assert best.fit.model.index_offset == pytest.approx(0.05, abs=0.002)


def test_a_clearance_and_what_only_it_shows_are_found_together() -> None:
    """Alone each is driven back to nothing: the carrier moves what is tight by little, the clearance by too much.

    An ellipticity of the encoder that was found first opens no contact: beside it they are found as beside nothing.
    """
    ellipticity = rverror.effect("sensor.encoder_ellipticity", cos="-3 arcsec", sin="2 arcsec")
    clearance = rverror.effect("crank.bearing_clearance", clearance="7 um")
    runout = replace(RUNOUT, values=(0.010, -0.020))
    first = begin(BARE, runs_of(Model(OTHER, (ellipticity, runout, clearance)), LIGHT, points=1024))
    hunt = Hunt(((clearance.key, {}), (runout.key, {}), (ellipticity.key, {})), POLICY, Journal(lambda text: None))
    node = Node(fitted(evaluated(renoised(fitted(first)).bench, Model(UNIT, (ellipticity,)), BARE)))
    plain = begun_at(hunt.coarse(node), node.fit.model, BARE)
    assert plain is not None
    for patient in (False, True):
        end = replace(hunt, patient=patient).loosened(plain)[0]
        assert {e.key for e in end.fit.added} == {ellipticity.key, clearance.key, runout.key}
    for cause in (clearance, runout):
        one = fitted(evaluated(node.fit.bench, Model(UNIT, (ellipticity, cause)), BARE), steps=30)
        assert not explains_most(one, node.fit)
    best = hunt.children(node)[0]
    assert hunt.complete(best)
    sizes = {e.key: e.values for e in best.fit.added}
    assert sizes[clearance.key] == pytest.approx((0.007,), abs=5e-4)
    assert np.abs(sizes[runout.key]) == pytest.approx((0.010, 0.020), abs=2e-3)


def test_a_profile_that_was_ground_off_and_the_pin_that_then_carries_are_found_together() -> None:
    """Neither takes off half of what both make; with the profile at any size of a workshop the pin leads."""
    profile = rverror.effect("cycloid.profile_modification", equidistant="20 um", shift="10 um")
    pin = rverror.effect("cycloid.pin_radius", pin=5, deviation="6.5 um")
    node = settled(Model(OTHER, (profile, pin)))
    keys = {profile.key, pin.key, "cycloid.pin_circle", "cycloid.pin_position"}
    hunt = Hunt(tuple(c for c in hunt_of(node).candidates if c[0] in keys), POLICY, Journal(lambda text: None))
    for alone in (profile, pin):
        one = fitted(evaluated(node.fit.bench, Model(UNIT, (alone,)), BARE), steps=30)
        assert not explains_most(one, node.fit)
    best = hunt.children(node)[0]
    assert best.names == frozenset(map(named, (profile, pin)))
    assert best.fit.data < best.fit.bound
    sizes = {e.key: e.values for e in best.fit.added}
    assert sizes[pin.key] == pytest.approx(pin.values, abs=5e-4)


def test_a_wave_of_the_pins_starts_from_workshop_sizes_where_nothing_explains_most() -> None:
    """A linear step from nothing ranks it behind waves of other orders, and a race drops it."""
    wave = rverror.effect(
        "cycloid.pin_circle", harmonic=1, radial_cos="-1.7 um", radial_sin="-4 um", tangential_cos="-6.3 um",
        tangential_sin="-2.3 um",
    )  # fmt: skip
    first = begin(BARE, runs_of(Model(OTHER, (wave,)), LIGHT, points=1024))
    node = Node(fitted(renoised(fitted(first)), steps=30))
    names = tuple(c for c in hunt_of(node).candidates if c[0] in (wave.key, "cycloid.disc_profile"))
    best = Hunt(names, POLICY, Journal(lambda text: None)).children(node)[0]
    assert best.names == frozenset([named(wave)])
    assert best.fit.data < best.fit.bound
    sign = np.sign(best.fit.added[0].values[0] * wave.values[0])  # half a turn on the other disc meets its opposite
    assert sign * np.array(best.fit.added[0].values) == pytest.approx(wave.values, abs=5e-4)


@pytest.mark.parametrize(("far", "noise", "count"), [(4.0, 1.0, 2), (6.0, 1.0, 1), (6.0, 0.2, 2)])
def test_what_lies_far_behind_a_set_that_leaves_noise_is_not_fitted(far: float, noise: float, count: int) -> None:
    """Five times `close` behind: were it to leave as little, few angles would not put it so far."""
    known = renoised(settled(Model(OTHER, (CAM,)), CAM).fit)
    records = [
        replace(r, noise=RunNoise(r.noise.coefficients, noise * r.noise.sigma)) for r in known.bench.records if r.noise
    ]
    node = Node(evaluated(known.bench.with_records(records), BARE, BARE))
    ahead = Trial.of(evaluated(node.fit.bench, Model(UNIT, (CAM,)), BARE))
    behind = Trial.of(evaluated(node.fit.bench, Model(UNIT, (replace(CAM, values=(0.0, 0.0)),)), BARE))
    close = (behind.fit.objective - ahead.fit.objective) / far
    hunt = Restless((), replace(POLICY, close=close), Journal(lambda text: None))
    assert len(hunt._fine(node, [ahead, behind])) == count


class Restless(Hunt):
    """A search to which nothing is complete."""

    def complete(self, node: Node) -> bool:
        return False


def test_of_each_source_the_leading_offers_are_taken(right: Node) -> None:
    offers = [(right.fit, one) for one in hunt_of(right).ranking(right.fit)]
    taken = leading_of_each(offers, 4)
    keys = [one.name[0] for _, one in offers]
    assert Counter(one.name[0] for _, one in taken) == {key: min(keys.count(key), 4) for key in keys}
    places = [[id(one) for _, one in offers].index(id(one)) for _, one in taken]
    assert places == sorted(places)


def test_what_leads_over_every_sample_is_fitted_at_once() -> None:
    """Half a micron of one pin, lost in noise: the first three candidates are enough, no race is run."""
    node = settled(Model(OTHER, (rverror.effect("cycloid.pin_position", pin=5, radial="-0.5 um"),)))
    hunt = hunt_of(node)
    children = hunt.children(node)
    assert len(children) <= POLICY.direct
    assert children[0].fit.added[0].indices["pin"] in (5, 13)  # the opposite one stands where it stood half a turn on
    assert hunt.complete(children[0])


def test_a_damaged_lobe_is_tried_before_any_pair() -> None:
    """Bores, cams and waves imitate it two or three at a time; alone it explains all."""
    lobe = rverror.effect("cycloid.disc_lobe", disc=0, lobe=5, deviation="3 um")
    node = settled(Model(OTHER, (lobe,)))
    keys = {"cycloid.disc_bore_position", "crank.eccentricity", "cycloid.disc_profile"}
    hunt, late = hunt_of(node), candidates_of(BARE, node.fit.bench.records, POLICY, late=True)
    assert {key for key, _ in late} == {lobe.key}
    hunt = replace(hunt, candidates=tuple(c for c in hunt.candidates if c[0] in keys), late=late)
    found, complete = hunt.best([node], POLICY.expansions)
    assert complete
    assert [e.key for e in found.fit.added] == [lobe.key]
    assert found.fit.added[0].indices["lobe"] in (5, 12, 13)  # or one half a turn on


def test_what_was_declared_is_held_where_it_has_moved_for_what_is_missing() -> None:
    """Free to move, what was declared makes up for a raised lobe and hides it from a linear step; held it does not.

    Where the fit leaves more than noise, a rare cause that has many places waits.
    """
    lobe = rverror.effect("cycloid.disc_lobe", disc=1, lobe=5, deviation="10 um")
    cams = [
        Effect(CAM.key, {"crank": crank, "disc": disc}, (0.0, 0.0), 3e-4) for crank, disc in product((0, 1), (0, 1))
    ]
    waves = [Effect("cycloid.disc_pitch", {"disc": disc, "harmonic": 1}, (0.0, 0.0), 3e-4) for disc in (0, 1)]
    declared = Model(UNIT, (*cams, *waves))
    first = begin(declared, runs_of(Model(OTHER, (lobe,)), LIGHT, points=1024))
    node = Node(fitted(renoised(fitted(first)), steps=30))
    keys = {"cycloid.pin_position", "cycloid.pin_radius", "cycloid.disc_profile"}
    late = candidates_of(declared, node.fit.bench.records, POLICY, late=True)
    hunt = Hunt(tuple(c for c in hunt_of(node).candidates if c[0] in keys), POLICY, Journal(lambda text: None), late)
    fit = onto(hunt.coarse(node), node.fit)
    plain = as_declared(fit)

    def place(offers: Sequence[Proposal]) -> int:
        return [identity(one.name) for one in offers].index(named(lobe))

    assert fit.data < fit.bound
    assert not hunt.complete(node)
    free = hunt.free(fit, late=True)
    assert 2 * min(place(screened(state, free)) for state in (plain, fit)) > POLICY.evaluated
    offers = hunt.proposals(fit, [plain])
    at = place([one for _, one in offers])
    assert at < POLICY.evaluated
    assert offers[at][0] is plain
    loud = replace(fit, data=2 * fit.bound)
    assert {one.name[0] for _, one in hunt.proposals(loud, [plain])} <= keys


def test_no_more_causes_are_looked_for_than_are_named() -> None:
    """A wave of a disc beside the cam: found where two causes may be named, and not where one may."""
    profile = rverror.effect("cycloid.disc_profile", disc=1, harmonic=2, cos="4 um", sin="3 um")
    node = settled(Model(OTHER, (CAM, profile)), CAM)
    hunt = hunt_of(node)
    hunt = replace(hunt, candidates=tuple(c for c in hunt.candidates if c[0] == profile.key))
    for most, keys in ((1, []), (2, [profile.key])):
        found = replace(hunt, policy=replace(POLICY, most_effects=most)).beside(node, [node])
        assert [child.fit.added[1].key for child in found if len(child.fit.added) == 2][:1] == keys


def test_rivals_are_held_against_the_node_that_they_are_asked_for(right: Node) -> None:
    """Under noise that is known anew what was found stands in the same samples under the same noise."""
    hunt = hunt_of(right)
    before = hunt.rivals(right, 0)
    again = Node(fitted(renoised(right.fit)))
    after = hunt.rivals(again, 0)
    assert before
    assert [n.names for n in after] == [n.names for n in before]
    assert all(n.fit.bench is again.fit.bench for n in after)


def test_what_a_bound_stops_promises_nothing() -> None:
    """Runs that ask for less than no play: no candidate is offered the squares that this would take."""
    play = rverror.effect("crank.bearing_clearance", clearance="0 um", uncertainty="3 um")
    declared = Model(UNIT, (play,))
    node = settled(Model(UNIT), declared=declared)
    rows = [raw[0] for raw in node.fit.raw]
    records = [replace(r, error=r.error - 2e-3 * row) for r, row in zip(node.fit.bench.records, rows, strict=True)]
    fit = evaluated(node.fit.bench.with_records(records), declared, declared)
    assert fit.moment[0] < -3 * math.sqrt(fit.gram[0, 0])
    idle = screened(fit, [("sensor.encoder_ellipticity", {})])
    step, gain = proposed(fit)
    assert step[0] >= 0
    assert idle[0].objective > fit.objective - gain - 15  # of an encoder's two sizes, by chance


def test_stiffness_that_something_stands_on_stays() -> None:
    """A bearing stiffer by more than its declared compliance: only on the stiffness that was fitted with it."""
    added = rverror.effect("crank.bearing_compliance", crank=0, disc=0, compliance="-4 um/kN")  # of 3.3
    soft = np.zeros(10)
    soft[1] = math.log(2)
    bench = begin(BARE, runs_of(BARE, BOTH_WAYS, points=512)).bench
    fit = evaluated(bench, Model(softened(UNIT, soft), (added,)), BARE)
    assert as_declared(fit) is fit
    other = evaluated(bench, Model(softened(UNIT, soft), (CAM,)), BARE)
    assert as_declared(other).model.mechanism == UNIT


@pytest.mark.parametrize(("share", "looked"), [(1.05, False), (1.5, True)])
def test_where_hardly_more_than_noise_is_left_no_further_cause_is_looked_for(
    right: Node, share: float, looked: bool
) -> None:
    """Noise that was taken for too little by so much: small faults of the readings may leave the former."""
    bench = right.fit.bench
    down = math.sqrt(right.fit.data / (share * right.fit.bound))
    records = [replace(r, noise=RunNoise(r.noise.coefficients, r.noise.sigma * down)) for r in bench.records if r.noise]
    node = Node(fitted(evaluated(bench.with_records(records), right.fit.model, right.fit.declared)))
    assert node.fit.data == pytest.approx(share * node.fit.bound, rel=0.01)
    assert nearly_noise(node.fit) is not looked
    told: list[str] = []
    hunt = replace(hunt_of(node), journal=Journal(told.append))
    hunt = replace(
        hunt, candidates=tuple(c for c in hunt.candidates if c[0] in (CAM.key, "sensor.encoder_eccentricity"))
    )
    best, done = hunt.best([node], 1)
    assert not done
    assert [e.key for e in best.fit.added] == [CAM.key]
    assert bool(told) is looked


def test_a_large_fault_of_one_sample_is_no_further_cause(right: Node) -> None:
    """It doubles the squares, as something that is missing would, but in as few values as the noise remembers."""
    first, *others = right.fit.bench.records
    error = first.error.copy()
    error[error.size // 3] += 12 * ARCSEC
    bench = right.fit.bench.with_records([replace(first, error=error), *others])
    node = Node(evaluated(bench, right.fit.model, right.fit.declared))
    assert node.fit.data > 2 * node.fit.bound
    assert nearly_noise(node.fit)
    told: list[str] = []
    best, done = replace(hunt_of(node), journal=Journal(told.append)).best([node], 1)
    assert (best, done, told) == (node, False, [])
    missing = Node(evaluated(right.fit.bench, right.fit.declared, right.fit.declared))
    assert not nearly_noise(missing.fit)


class Tree(Hunt):
    """A search whose sets are words: a child has a letter more, and only one of them leaves nothing."""

    def pruned(self, node: Any) -> Any:
        return node

    def swapped(self, node: Any) -> Any:
        return node

    def only_faults(self, node: Any) -> bool:
        return False

    def hidden(self, node: Any) -> Any:
        return None

    def complete(self, node: Any) -> bool:
        return node.names == frozenset("CDE")

    def beside(self, node: Any, seen: list[Any]) -> list[Any]:
        self.journal.tell("".join(sorted(node.names)))
        return [] if len(node.names) == 3 else [self.set_of(*node.names, letter) for letter in "ABCDEF"]

    @staticmethod
    def set_of(*letters: str) -> Any:
        """The later its letters, the worse a set: a search must go past all that begin with A or B."""
        names = frozenset(letters)
        score = float(sum(map(ord, names))) - 1000.0 * len(names)
        return SimpleNamespace(names=names, score=score, fit=SimpleNamespace(added=(), data=2.0, bound=1.0))


def test_a_set_is_looked_beside_once_however_many_ways_lead_to_it() -> None:
    """Of three letters out of six there are 42 sets; six ways lead to each of three, and would take all looks."""
    told: list[str] = []
    tree = Tree((), replace(POLICY, branches=1000), Journal(told.append))
    best, done = tree.best([tree.set_of()], 42)
    assert done
    assert best.names == frozenset("CDE")
    assert len(told) == len(set(told))


def test_in_a_wider_search_single_causes_go_before_pairs_that_leave_more_than_noise() -> None:
    tree = Tree((), POLICY, Journal(lambda text: None))
    pair, single, fits = tree.set_of("A", "B"), tree.set_of("A"), tree.set_of("E", "F")
    fits.fit.data = fits.fit.bound
    sets = [single, fits, pair]

    def first(patient: bool, looked: int) -> list[Any]:
        names = [tree.set_of(letter).names for letter in "ABCDEF"[:looked]]
        return replace(tree, patient=patient)._in_turn(sets, names)

    assert first(False, 0) == [pair, fits, single]
    assert first(True, 0) == [fits, single, pair]
    assert first(True, POLICY.breadth) == [pair, fits, single]


class Needless(Hunt):
    """A search in which B in the place of A leaves nothing to C."""

    def _refitted(self, fits: Any, node: Any) -> Any:
        return [node]

    def remarked(self, node: Any) -> Any:
        return node

    def rivals(self, node: Any, *numbers: int) -> Any:
        return [self.set_of("BC", 10.0)] if (node.names, numbers) == ("AC", (0,)) else []

    def pruned(self, node: Any) -> Any:
        return self.set_of("B", 9.0) if node.names == "BC" else node

    @staticmethod
    def set_of(names: str, score: float) -> Any:
        return SimpleNamespace(names=names, score=score, fit=SimpleNamespace(added=list(names)))


def test_what_a_swap_makes_needless_is_taken_out() -> None:
    hunt = Needless((), POLICY, Journal(lambda text: None))
    assert hunt.swapped(Needless.set_of("AC", 50.0)).names == "B"
    kept = Needless.set_of("AC", 10.5)  # as good, but for where fits have settled
    assert hunt.swapped(kept) is kept


class Misplaced(Tree):
    """A search that ends with D, E and F, of which one has a wrong place; but for the set's size nothing shows."""

    left = 0.1

    def complete(self, node: Any) -> bool:
        return node.names == frozenset("ABC")

    def beside(self, node: Any, seen: list[Any]) -> list[Any]:
        seen.append(self.set_of("D", "E", "F"))
        seen[-1].fit.data = 1.0 + self.left
        return []

    def swapped(self, node: Any) -> Any:
        return self.set_of("A", "B", "C")


def test_a_search_that_ends_with_little_left_swaps_what_may_have_a_wrong_place() -> None:
    """Where most is left a cause is missing, and no swap helps: the search that follows has the time."""
    misplaced = Misplaced((), POLICY, Journal(lambda text: None))
    best, done = misplaced.best([misplaced.set_of()], 42)
    assert (best.names, done) == (frozenset("ABC"), True)
    misplaced.left = 0.6
    best, done = misplaced.best([misplaced.set_of()], 42)
    assert (best.names, done) == (frozenset("DEF"), False)


class Anew(Tree):
    """A search in which the set of A alone, begun anew, is the one that leaves nothing."""

    def restarted(self, node: Any) -> Any:
        return self.set_of("C", "D", "E") if node.names == frozenset("A") else node


def test_a_set_that_is_not_complete_begins_anew_before_one_looks_beside_it() -> None:
    told: list[str] = []
    tree = Anew((), POLICY, Journal(told.append))
    best, done = tree.best([tree.set_of("A")], 42)
    assert (best.names, done, told) == (frozenset("CDE"), True, [])


class Hiding(Tree):
    """A search in which F stands behind C, D and E, which leave nothing that a linear step would show."""

    def complete(self, node: Any) -> bool:
        return node.names >= frozenset("CDE")

    def hidden(self, node: Any) -> Any:
        return None if "F" in node.names else self.set_of(*node.names, "F")


def test_what_stands_behind_a_complete_set_is_looked_for() -> None:
    hiding = Hiding((), POLICY, Journal(lambda text: None))
    best, done = hiding.best([hiding.set_of("C", "D", "E")], 42)
    assert (best.names, done) == (frozenset("CDEF"), True)


class Unsettled(Hunt):
    """A search that finds no equilibrium without a cause."""

    def coarse(self, node: Node) -> Any:
        raise NotConvergedError("no equilibrium")


def test_a_cause_on_which_others_stand_does_not_begin_anew() -> None:
    node = settled(Model(OTHER, (PINS,)), PINS)
    known = hunt_of(node)
    assert Unsettled(known.candidates, POLICY, known.journal).restarted(node) is node


def test_a_wider_search_tries_more_and_judges_alike() -> None:
    wide = Hunt((), POLICY, Journal(lambda text: None)).widened().policy
    for name in ("evaluated", "stepped", "refitted"):
        assert getattr(wide, name) == POLICY.wider * getattr(POLICY, name) > getattr(POLICY, name)
    assert Hunt((), POLICY, Journal(lambda text: None)).widened().patient
    assert replace(wide, evaluated=POLICY.evaluated, stepped=POLICY.stepped, refitted=POLICY.refitted) == POLICY
