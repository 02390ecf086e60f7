"""The search for what a model lacks, move by move: what is needless goes, what bends is begun, no wrong set ends it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest

import rverror
from gear_runs import BARE, CAM, LIGHT, OTHER, TURN, UNIT, USUAL, begin, beside, quiet, red, runs_of, search_of, settled
from rverror.base.arrays import Array
from rverror.base.units import ARCSEC
from rverror.diagnosis.causes import identity, named
from rverror.diagnosis.gears.account import half_widths
from rverror.diagnosis.gears.fit import Fit, RunSet, evaluated, first_state, fitted, with_estimated_noise
from rverror.diagnosis.gears.moves import marked
from rverror.diagnosis.gears.ranking import Offer, singles
from rverror.diagnosis.gears.record import records_of
from rverror.diagnosis.gears.reducers import with_marks
from rverror.diagnosis.gears.residual_faults import nearly_noise
from rverror.diagnosis.gears.score import Hypothesis, inexact, strained
from rverror.diagnosis.gears.search import Search
from rverror.diagnosis.gears.spectrum import best_lines
from rverror.diagnosis.gears.trial import Trial
from rverror.diagnosis.journal import Journal
from rverror.diagnosis.policy import POLICY
from rverror.geartrain.action_line import Contacts
from rverror.geartrain.kinematics import fundamental_orders
from rverror.geartrain.source import AROUND, Source
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.runs.noise import RunNoise

HEAD = rverror.effect("sensor.encoder_eccentricity", cos="3 arcsec", sin="-2 arcsec")
TWICE = rverror.effect("sensor.encoder_ellipticity", cos="2 arcsec", sin="2 arcsec")
PLANET = rverror.effect("involute.planet_eccentricity", crank=0, x="3 um", y="-2 um")
PIN = rverror.effect("cycloid.pin_position", pin=5, radial="5.5 um", tangential="7.8 um")
PINS = rverror.effect("cycloid.pin_radius", pin="all", deviation="6 um")
LOBE = rverror.effect("cycloid.disc_lobe", disc=1, lobe=5, deviation="10 um")
PROFILE = rverror.effect("cycloid.profile_modification", equidistant="8 um", shift="-6 um")
PLAY = rverror.effect("crank.bearing_clearance", clearance="7 um")
RUNOUT = rverror.effect("coupling.carrier_runout", x="-3.7 um", y="3.8 um")
WAVE = rverror.effect(
    "cycloid.pin_circle", harmonic=1, radial_cos="-1.7 um", radial_sin="-4 um", tangential_cos="-6.3 um",
    tangential_sin="-2.3 um",
)  # fmt: skip

#: Where it is not asked which of all sources it is, which the tests of whole diagnoses do: what looks much alike.
NEAR_CAMS = (CAM.key, "cycloid.disc_bore_position", "cycloid.disc_pitch", PLANET.key, HEAD.key)
NEAR_PROFILES = (PROFILE.key, PINS.key, WAVE.key, "cycloid.disc_profile", CAM.key)
NEAR_PINS = (PIN.key, PINS.key, WAVE.key, LOBE.key, CAM.key)
NEAR_AXES = (RUNOUT.key, "coupling.carrier_bore_position", "cycloid.disc_bore_position", "cycloid.disc_pitch")


def linear_offers(search: Search, fit: Fit) -> list[Offer]:
    """Single causes by a linear step over every sample."""
    return singles(fit, search.moves.blocks(fit), search.score.cost)


def moved(search: Search, one: Hypothesis) -> list[Hypothesis]:
    """The set with its causes moved, and begun anew."""
    return raced(search, search.moves.other_places(one.without_rows))


def rivals(search: Search, one: Hypothesis, number: int = 0) -> list[Hypothesis]:
    """Other causes in one's place, once the set has stood beside all that comes near it."""
    stood(search, one)
    return search.rivals(one, number)


def stood(search: Search, one: Hypothesis) -> list[Hypothesis]:
    """Sets that were fitted to stand beside one."""
    before = {*search.known, one.names}
    search.keep([one])
    search.expand(one.without_rows, search.challengers)
    while search.compare(one):
        pass
    return sorted((h for names, h in search.known.items() if names not in before), key=lambda h: h.score)


def complete_ones(search: Search, found: Sequence[Hypothesis]) -> list[Hypothesis]:
    return [one for one in found if search.complete(one)]


def sizes(one: Hypothesis, of: Effect) -> Array:
    """Of the cause of a key, but for a sign that only contacts tell."""
    (found,) = [e for e in one.fit.added if e.key == of.key]
    sign = math.copysign(1.0, float(np.dot(found.values, of.values)))
    return sign * np.array(found.values)


# --- the loop ---------------------------------------------------------------------------------------------------------


THETA = np.asarray(TURN * np.arange(1024) / 512)


class Watched(Search):
    """A search that writes down which sets it expands, by which kind of move."""

    expanded: list[tuple[frozenset[object], str]]

    def expand(self, one: Hypothesis, kind: Any) -> bool:
        made = super().expand(one, kind)
        if made:
            self.expanded.append((one.names, kind.__name__))
        return made


def raced(search: Search, trials: Iterable[Trial]) -> list[Hypothesis]:
    """Sets that a race of trials adds to those that are known, the best first."""
    before = dict(search.known)
    search.race(list(trials))
    found = [one for names, one in search.known.items() if before.get(names) is not one]
    return sorted(found, key=lambda one: one.score)


def read(*true: Effect, more: Array | float = 0.0, **rules: Any) -> Watched:
    """A search over one run that states no torque, of 0.3 arcsec of white noise: every prediction is linear."""
    error = rverror.transmission_error(Model(UNIT, true), THETA, direction=1.0) + more + red(3, THETA.size, 0.3, 0.0)
    run = rverror.run_from_arrays(input_angle=UNIT.ratio * THETA, output_angle=THETA + error, direction="forward")
    keys = [e.key for e in (HEAD, TWICE, PLANET)]
    known = search_of(fitted(with_estimated_noise(fitted(begin(BARE, [run], points=512)))), keys, **rules)
    found = Watched(known.root.fit, known.candidates, known.policy, Journal(quiet))
    found.expanded = []
    return found


def test_three_causes_are_found_and_no_set_is_expanded_twice() -> None:
    search = read(HEAD, TWICE, PLANET)
    best, done = search.best()
    assert done
    assert search.complete(best)
    assert {e.key for e in best.fit.added} == {HEAD.key, TWICE.key, PLANET.key}
    for effect in (HEAD, TWICE):
        assert sizes(best, effect) == pytest.approx(effect.values, abs=0.1 * ARCSEC)
    assert len(search.expanded) == len(set(search.expanded))
    assert best.score == min(one.score for one in search.known.values())


def test_where_nothing_is_missing_nothing_is_expanded() -> None:
    search = read()
    best, done = search.best()
    assert (best.fit.added, done) == ((), True)
    assert {kind for _, kind in search.expanded} <= {"challengers"}


@pytest.mark.parametrize("most", [0, 1, 2])
def test_no_more_causes_are_looked_for_than_are_named(most: int) -> None:
    search = read(HEAD, TWICE, PLANET, most_effects=most)
    best, done = search.best()
    assert not done
    assert max(len(one.fit.added) for one in search.known.values()) == most
    assert len(best.fit.added) <= most


def test_a_set_that_is_worth_less_than_what_is_declared_is_not_expanded() -> None:
    """What it leads to is found from the root."""
    search = read(HEAD)
    right, less = (search.score.of(beside(search.root.fit, effect)) for effect in (HEAD, PLANET))
    assert right.score < search.root.score < less.score
    search.keep([less])
    search.expand_beam()
    assert {names for names, _ in search.expanded} == {frozenset()}
    search.keep([right])
    search.expand_beam()
    assert {names for names, _ in search.expanded} == {frozenset(), right.names}


def test_a_full_set_that_nearly_fits_has_a_cause_exchanged() -> None:
    """Beside fewer causes one more is added; where there is no room, another takes the place of each."""
    weak = replace(HEAD, values=tuple(0.16 * v for v in HEAD.values))
    search = read(weak, TWICE, most_effects=2)
    wrong = search.score.of(beside(search.root.fit, TWICE, PLANET))
    assert search.moves.nearly(wrong)
    assert not search.complete(wrong)
    trials = list(search.moves.exchanges(wrong))
    first = min(trials, key=lambda trial: trial.score)
    assert {named(e) for e in first.added} == {named(HEAD), named(TWICE)}
    assert first.score < wrong.score
    kept = [[t for t in trials if named(one) in {named(e) for e in t.added}] for one in (TWICE, PLANET)]
    others = len(search.candidates) - 2
    assert [len(some) for some in kept] == [others] * 2  # whatever each promises beside the cause's own step
    search.keep([wrong])
    search.expand_beam()
    assert (wrong.names, "_exchanges") in search.expanded
    assert (wrong.names, "_other_places") in search.expanded
    assert frozenset({named(HEAD), named(TWICE)}) in search.known  # raced at once


def test_a_set_that_leaves_half_has_its_cause_moved_though_much_is_left() -> None:
    """The pin beside the true one takes off most, and leaves 78 times what noise makes."""
    pin = rverror.effect("cycloid.pin_position", pin=5, radial="-12 um", tangential="10 um")
    fit = settled(Model(OTHER, (pin,)), pin, conditions=LIGHT, rms=0.05)
    search = search_of(fit, [pin.key])
    wrong = search.score.of(beside(fit, replace(pin, indices={"pin": 6})))
    assert not search.moves.nearly(wrong)
    assert wrong.fit.data < search.root.fit.data / 2
    search.keep([wrong])
    search.expand_beam()
    assert search.complete(search.known[frozenset({named(pin)})])


def test_a_cause_is_exchanged_for_starts_too() -> None:
    """A linear step gives a modified profile no size worth a trial; its starts give it others."""
    fit = settled(Model(OTHER, (PROFILE,)), PROFILE, conditions=LIGHT)
    search = search_of(fit, [PROFILE.key, CAM.key, PLANET.key], most_effects=1)
    wrong = search.score.of(beside(fit, CAM))
    found = [t.added[0].values for t in search.moves.exchanges(wrong) if t.added[0].key == PROFILE.key]
    linear, *begun = sorted(found, key=lambda values: abs(values[0]))
    starts = np.array(source(PROFILE.key).starts) / 0.17  # shares of two sizes that are equally plausible
    assert max(starts @ linear) < 1e-3
    assert begun
    for values in begun:
        assert max(starts @ values) == pytest.approx(np.linalg.norm(values))


def test_two_causes_that_fit_as_well_elsewhere_together_are_told() -> None:
    """The bore of the other disc and the other disc's wave, both opposite: either alone fits far worse."""
    bore = rverror.effect("cycloid.disc_bore_position", disc=1, crank=0, radial="3.8 um", tangential="-0.2 um")
    wave = rverror.effect("cycloid.disc_profile", disc=0, harmonic=3, cos="-2 um", sin="3 um")
    places = [{("disc", 1), ("crank", 0)}, {("disc", 0), ("crank", 1)}], [{("disc", 0)}, {("disc", 1)}]
    fit = settled(Model(OTHER, (bore, wave)), bore, wave, points=1024)
    search = search_of(fit, [bore.key, wave.key])
    best, done = search.best()
    assert done
    for number, effect in enumerate(best.fit.added):
        told = [dict(effect.indices), *(indices for _, indices in search.as_good(best, number))]
        of_bore = effect.key == bore.key
        for place in places[0 if of_bore else 1]:
            assert any(place <= set(indices.items()) for indices in told)


def test_another_place_is_told_of_the_cause_that_has_moved_alone() -> None:
    """Of two harmonics of one planet the second fits as well on the other planet."""
    first, second = (
        rverror.effect("involute.planet_pitch", crank=0, harmonic=h, cos="3 um", sin="1 um") for h in (1, 2)
    )
    moved = replace(second, indices={**second.indices, "crank": 1})
    search = search_of(read(HEAD).root.fit, [first.key])
    one, other = (
        replace(search.score.of(beside(search.root.fit, first, effect)), score=0.0) for effect in (second, moved)
    )
    search.keep([one, other])
    assert search.as_good(one, 0) == ()
    assert search.as_good(one, 1) == ((moved.key, dict(moved.indices)),)


def test_a_set_that_nearly_fits_is_raced_elsewhere_and_has_one_cause_more_in_one_round() -> None:
    weak = replace(HEAD, values=tuple(0.16 * v for v in HEAD.values))
    search = read(weak, TWICE)
    near = search.score.of(beside(search.root.fit, TWICE, PLANET))
    assert search.moves.nearly(near)
    assert not search.complete(near)
    search.keep([near])
    search.expand_beam()
    assert [kind for names, kind in search.expanded if names == near.names] == ["_other_places", "_one_more"]


@pytest.mark.parametrize("true", [(HEAD,), (HEAD, PLANET)])
def test_of_a_complete_set_several_causes_are_moved_at_once_last(true: tuple[Effect, ...]) -> None:
    """A full set, of which the beam moves none; a single cause has been swapped for its equivalents already."""
    search = read(*true, most_effects=len(true))
    best, done = search.best()
    assert done
    assert best.names == {named(e) for e in true}
    last = "challengers" if len(true) == 1 else "_other_places"
    assert search.expanded[-1] == (best.names, last)


def test_where_no_set_is_complete_the_beam_widens_to_its_end() -> None:
    """A wave of the crank's order, which no candidate makes and which is no line of its own."""
    search = read(HEAD, more=3 * ARCSEC * np.cos(32 * THETA), budget=10**6)
    best, done = search.best()
    assert not done
    assert best.names == {named(HEAD)}
    assert len(search.expanded) == len(set(search.expanded))
    assert {kind for _, kind in search.expanded} > {"_one_more", "from_all_starts", "_with_late_line"}
    begun, other = (
        {names for names, kind in search.expanded if (kind == "_single_place_sources") == is_it} for is_it in (1, 0)
    )
    assert begun - other  # beside sets that leave as much as those of the beam, and are not in it


def test_a_search_ends_after_as_many_solutions_as_the_policy_allows() -> None:
    expanded = []
    for budget in (-1, 0, 10**6):
        search = read(HEAD, more=3 * ARCSEC * np.cos(32 * THETA), budget=budget)
        best, done = search.best()
        assert not done
        assert best.score == min(one.score for one in search.known.values())
        expanded.append(len(search.expanded))
    assert expanded[0] == 0
    assert expanded[1] == 1
    assert expanded[2] > 2


def test_of_every_set_the_best_fit_is_kept_and_what_settled_as_well_changes_nothing() -> None:
    search = read(HEAD)
    first = search.score.of(beside(search.root.fit, HEAD))
    search.keep([replace(first, score=10.0)])
    for score, kept in ((9.5, 10.0), (12.0, 10.0), (8.5, 8.5)):
        search.keep([replace(first, score=score)])
        assert search.known[first.names].score == kept


# --- complete ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def right() -> Fit:
    """The true cause, fitted."""
    return settled(Model(OTHER, (CAM,)), CAM, conditions=(*USUAL, (1.0, 150e3)), points=1024)


def test_nothing_is_complete_without_the_cause_and_all_is_with_it(right: Fit) -> None:
    search = search_of(right, NEAR_CAMS)
    assert search.complete(search.score.of(right))
    assert not search.complete(search.root)


def test_a_strained_fit_is_never_complete() -> None:
    """A declared size that is off by 8 of its uncertainties; with five times the uncertainty it is not."""
    wrong = replace(CAM, values=(CAM.values[0] - 8e-4, CAM.values[1]), uncertainty=1e-4)
    fit = settled(Model(UNIT, (CAM,)), declared=Model(UNIT, (wrong,)))
    none = "sensor.encoder_ellipticity"
    assert fit.data < fit.bound
    assert strained(fit)
    assert not search_of(fit, [none]).complete(search_of(fit, [none]).score.of(fit))
    run_set = replace(fit.run_set, policy=replace(POLICY, strained=1e-200))
    search = search_of(replace(fit, run_set=run_set), [none])
    assert search.complete(search.score.of(replace(fit, run_set=run_set)))  # nothing but the strain is against it
    calm = settled(Model(UNIT, (CAM,)), declared=Model(UNIT, (replace(wrong, uncertainty=5e-4),)))
    assert not strained(calm)


@pytest.mark.parametrize(("arcsec", "complete"), [(0.14, True), (0.2, False)])
def test_a_line_that_chance_makes_now_and_then_overthrows_no_cause(right: Fit, arcsec: float, complete: bool) -> None:
    """It is told all the same; one that noise hardly ever makes leaves a set incomplete."""
    wave = arcsec * ARCSEC
    records = [replace(r, error=r.error + wave * np.cos(23.37 * r.theta)) for r in right.run_set.records]
    fit = fitted(evaluated(right.run_set.with_records(records), right.model, right.declared))
    (line,) = best_lines(fit, POLICY, outside=False)
    assert line.order == pytest.approx(23.37, abs=0.3)
    search = search_of(fit, NEAR_CAMS)
    assert search.complete(search.score.of(fit)) == complete


def test_what_a_linear_step_promises_too_little_of_is_fitted_before_nothing_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A pin that is pushed in takes load from others: fitted it lowers the objective by more than a step promises."""
    pin = rverror.effect("cycloid.pin_position", pin=5, radial="0.6 um")
    fit = settled(Model(OTHER, (pin,)), conditions=(*USUAL, (1.0, 150e3)), points=1024)
    (step,) = [o for o in linear_offers(search_of(fit, [pin.key]), fit) if dict(o.names[0][1]) == dict(pin.indices)]
    search = search_of(fit, [pin.key])
    promised = fit.objective - step.score
    fitted_pin = beside(fit, pin)
    beyond = search.score.of(fit).score - search.score.of(fitted_pin).score - promised
    assert beyond > 4

    def asking(gain: float) -> Search:
        """A search that asks for so much, the model's own error included."""
        return search_of(fit, [pin.key], false_alarm=math.exp(-(gain - inexact(fit)) / 2), most_effects=1)

    some, all_of_it = promised + beyond / 2, fit.objective - fitted_pin.objective  # of 16 pins one must fall by more
    for gain, gains, added in ((some, True, True), (some, False, False), (all_of_it, True, False)):
        with monkeypatch.context() as patch:
            if not gains:  # as where only a jump has moved
                patch.setattr("rverror.diagnosis.gears.score.fall", lambda before, after: 0.0)
            best, done = asking(gain).best()
            assert done
            assert bool(best.fit.added) is added
    below, above = asking(promised - beyond / 2), asking(some)
    assert not below.complete(below.root)
    assert above.complete(above.root)


def test_what_settles_is_told_though_the_model_s_error_about_a_large_cause_is_larger() -> None:
    """No error of the model settles: beside a cam 120 um off its place 1.5 arcsec that does is left to be found.

    Over one turn it may be an encoder's error.
    """
    cam = replace(CAM, values=(0.1, -0.06))
    short, fit = (
        settled(Model(OTHER, (cam,)), cam, points=512, turns=turns,
                more=lambda theta, share: 1.5 * ARCSEC * np.exp(-share / 0.1))
        for turns in (1.0, 3.0)
    )  # fmt: skip
    search = search_of(fit, [CAM.key])
    one = search.score.of(fit)
    assert not any(other.slow for other in search_of(short, [CAM.key]).with_settling(search.score.of(short)))
    (settling,) = search.with_settling(one)
    search.expand(one, search._one_more)  # with the first causes: what settles hides smaller ones
    assert any(other.slow for other in search.known.values())
    assert settling.slow
    assert 50 < fit.objective - settling.fit.objective < inexact(fit)
    assert not search.complete(one)
    assert search.complete(settling)
    assert search.pruned(settling).slow
    assert search.score.better(settling, one)
    full = search_of(fit, [CAM.key, HEAD.key], most_effects=1)
    sizes = {len(trial.added) for trial in full.challengers(settling)}
    assert sizes == {1}  # what stands in the place of settling is one cause more only where there is room


@pytest.mark.parametrize(("share", "looked"), [(1.05, False), (1.5, True)])
def test_where_hardly_more_than_noise_is_left_no_further_cause_is_looked_for(
    right: Fit, share: float, looked: bool
) -> None:
    """Noise that was taken for too little by so much: small faults of the readings may leave the former."""
    down = math.sqrt(right.data / (share * right.bound))
    records = [
        replace(r, noise=RunNoise(r.noise.coefficients, r.noise.sigma * down)) for r in right.run_set.records if r.noise
    ]
    fit = fitted(evaluated(right.run_set.with_records(records), right.model, right.declared))
    assert fit.data == pytest.approx(share * fit.bound, rel=0.01)
    assert nearly_noise(fit) is not looked
    search = search_of(fit, [CAM.key, HEAD.key], budget=300)
    best, done = search.best(search.score.of(fit))
    assert not done
    assert best.names == {named(CAM)}
    assert bool(search.journal.round) is looked


def test_a_large_fault_of_one_sample_is_no_further_cause(right: Fit) -> None:
    """It doubles the squares, as something that is missing would, but in as few values as the noise remembers."""
    first, *others = right.run_set.records
    error = first.error.copy()
    error[error.size // 3] += 12 * ARCSEC
    run_set = right.run_set.with_records([replace(first, error=error), *others])
    fit = evaluated(run_set, right.model, right.declared)
    assert fit.data > 2 * fit.bound
    assert nearly_noise(fit)
    search = search_of(fit)
    best, done = search.best(search.score.of(fit))
    assert best.names == {named(CAM)}
    assert (done, search.journal.round) == (False, 0)
    assert not nearly_noise(search.root.fit)


# --- what is needless -------------------------------------------------------------------------------------------------


def test_pruning_drops_what_is_needless_and_keeps_what_is_not(right: Fit) -> None:
    """The true cause beside one that is needless, a line that is none, and drift."""
    profile = rverror.effect("cycloid.disc_profile", disc=1, harmonic=3, cos="0.5 um")
    run_set = right.run_set.with_free((23.37,), slow=True)
    start = replace(right.model, effects=(CAM, profile))
    search = search_of(right, NEAR_CAMS)
    crowded = search.score.of(fitted(evaluated(run_set, start, BARE)))
    left = search.pruned(crowded)
    assert left.names == {named(CAM)}
    assert (left.lines, left.slow) == ((), False)
    assert all(r.orders == () and not r.slow for r in left.fit.run_set.records)
    assert left.score < crowded.score
    assert left.fit.added[0].values == pytest.approx(CAM.values, abs=3e-4)


def test_a_cause_is_needed_however_large_it_is() -> None:
    """A hundredth of a wave of 40 arcsec is many squares, but as squares count what it explains is more."""
    cam = replace(CAM, values=(0.04, 0.0))
    search = search_of(fit := settled(Model(OTHER, (cam,)), cam), NEAR_CAMS)
    assert search.pruned(search.score.of(fit)).names == {named(CAM)}


@pytest.mark.parametrize("gained", [0.0, 1e4])
def test_nothing_counts_that_only_moved_jumps_have_gained(
    right: Fit, gained: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The cause is needed where its fall counts, and nowhere else."""
    monkeypatch.setattr("rverror.diagnosis.gears.score.fall", lambda before, after: gained)
    search = search_of(right, NEAR_CAMS)
    assert bool(search.pruned(search.score.of(right)).fit.added) == (gained > 0)


def test_what_fits_only_by_straining_gives_way() -> None:
    """A cam does what a planet does only beside the cam's declared twin, moved by 18 of its uncertainties."""
    cam = replace(CAM, values=(2e-3, -1e-3))
    stated = rverror.effect(CAM.key, crank=1, disc=1, radial="0 um", uncertainty="0.1 um")
    planet = replace(PLANET, values=(1e-3, 0.0))
    fit = settled(Model(OTHER, (cam,)), planet, declared=Model(UNIT, (stated,)), conditions=(*USUAL, (1.0, 150e3)))
    assert fit.data < fit.bound
    assert strained(fit)
    search = search_of(fit, [cam.key, planet.key], most_effects=1)
    best, done = search.best(search.score.of(fit))
    assert done
    assert best.names == {named(CAM)}
    assert not strained(best.fit)


# --- what is added ----------------------------------------------------------------------------------------------------


def test_from_what_is_declared_a_linear_step_finds_what_is_missing() -> None:
    search = search_of(settled(Model(OTHER, (CAM,)), CAM))
    best = raced(search, search.moves.one_more(search.root))[0]
    assert search.complete(best)
    assert {e.key for e in best.fit.added} == {CAM.key}
    assert best.fit.added[0].values == pytest.approx(CAM.values, abs=3e-4)


def test_a_damaged_lobe_that_declared_sizes_hide_is_found() -> None:
    """Free to move, what was declared makes up for a raised lobe until no more than noise is left of it."""
    cams = [
        Effect(CAM.key, {"crank": crank, "disc": disc}, (0.0, 0.0), 3e-4) for crank, disc in product((0, 1), (0, 1))
    ]
    waves = [Effect("cycloid.disc_pitch", {"disc": disc, "harmonic": 1}, (0.0, 0.0), 3e-4) for disc in (0, 1)]
    fit = settled(Model(OTHER, (LOBE,)), declared=Model(UNIT, (*cams, *waves)), conditions=LIGHT, points=1024)
    search = search_of(fit, [LOBE.key, "cycloid.pin_position", "cycloid.pin_radius"])
    assert search.root.fit.data < search.root.fit.bound
    assert not search.complete(search.root)
    best, done = search.best()
    assert done
    assert {e.key for e in best.fit.added} == {LOBE.key}
    assert best.fit.added[0].values == pytest.approx(LOBE.values, abs=5e-4)


def test_a_clearance_is_found_though_a_linear_step_makes_less_than_nothing_of_it() -> None:
    """Cams that are declared wrong by up to three uncertainties take the place of what it does to first order."""
    true, said = (
        ((1.4, -2.0), (-0.7, 2.5), (2.0, -1.8), (0.7, 5.5)),
        ((0.8, -3.1), (-0.7, 2.7), (3.1, -2.1), (0.7, 5.5)),
    )
    made, declared = (
        tuple(
            Effect(CAM.key, {"crank": crank, "disc": disc}, (1e-3 * x, 1e-3 * y), 4e-4)
            for (crank, disc), (x, y) in zip(product((0, 1), (0, 1)), sizes, strict=True)
        )
        for sizes in (true, said)
    )
    stated = Model(UNIT, declared)
    first = begin(stated, runs_of(Model(OTHER, (*made, PLAY)), LIGHT, points=512), points=512)
    search = search_of(fitted(with_estimated_noise(fitted(first))), [PLAY.key, "cycloid.disc_pitch"])
    offers = linear_offers(search, evaluated(first.run_set, stated, stated))
    assert all(offer.names[0][0] != PLAY.key for offer in offers)
    found = complete_ones(
        search, raced(search, [*search.moves.one_more(search.root), *search.moves.from_all_starts(search.root)])
    )
    assert [e.key for e in found[0].fit.added] == [PLAY.key]
    assert found[0].fit.added[0].values[0] == pytest.approx(7e-3, abs=3e-4)


def test_a_wave_of_the_pins_is_found_from_its_starts() -> None:
    """A linear step from nothing ranks it behind waves of other orders, and steps from there end elsewhere."""
    fit = settled(Model(OTHER, (WAVE,)), WAVE, conditions=LIGHT)
    search = search_of(fit, [WAVE.key, "cycloid.disc_profile"])
    assert not complete_ones(
        search, raced(search, [t for t in search.moves.one_more(search.root) if t.added[0].key != WAVE.key])
    )
    (found,) = complete_ones(
        search, raced(search, [*search.moves.one_more(search.root), *search.moves.from_all_starts(search.root)])
    )[:1]
    assert found.names == {named(WAVE)}
    assert sizes(found, WAVE) == pytest.approx(WAVE.values, abs=5e-4)


@pytest.mark.parametrize("side", [1, -1])
def test_a_pin_out_of_the_circle_and_to_one_side_leads_by_its_starts(side: int) -> None:
    """Discs touch it where it lies beside its radius; a linear step from nothing ranks it behind another cause."""
    pin = rverror.effect("cycloid.pin_position", pin=12, radial="9 um", tangential=f"{17 * side} um")
    fit = settled(Model(OTHER, (pin,)), pin, conditions=LIGHT)
    search = search_of(fit, ["cycloid.pin_position", "cycloid.pin_radius"])
    (leading,) = next(search.moves.from_all_starts(search.root)).added
    assert (leading.key, leading.indices["pin"] % 8) == (pin.key, 4)  # the other disc meets pin 4 as one meets pin 12
    (linear,) = next(search.moves.one_more(search.root)).added
    assert linear.indices["pin"] % 8 != 4


def test_starts_of_single_lobes_are_solved_at_once_and_those_of_single_pins_when_all_are() -> None:
    """A lobe repeats with the crank, so that all of them cost less than a wave of the pins; a pin takes a turn."""
    fit = settled(Model(OTHER, (LOBE,)), LOBE, conditions=LIGHT)
    moves = search_of(fit, NEAR_PINS).moves
    offered = {of: {key for key, _ in moves.starting(with_crank=of)} for of in (True, False, None)}
    assert LOBE.key in offered[True]
    assert PIN.key not in offered[True]
    assert {key for key, _ in moves.starting(with_crank=False)} == {WAVE.key}
    assert offered[None] == {LOBE.key, WAVE.key, PIN.key, PINS.key}
    hidden = [trial for trial in moves.masked(moves.root) if trial.added[0].key == LOBE.key]
    assert {named(trial.added[0]) for trial in hidden} >= {named(LOBE)}


def test_a_source_of_one_place_is_solved_beside_a_set_at_each_of_its_starts_whatever_a_linear_step_says() -> None:
    true = (CAM, PLAY)
    search = search_of(settled(Model(OTHER, true), *true, conditions=LIGHT), [effect.key for effect in true])
    cam = search.score.of(beside(search.root.with_rows.fit, CAM)).without_rows
    trials = list(search.moves.single_place_sources(cam))
    assert {trial.added[-1].key for trial in trials} == {PLAY.key}  # a cam has several places
    assert len(trials) == len(source(PLAY.key).starts)
    (found,) = complete_ones(search, raced(search, trials))
    assert found.names == frozenset(map(named, true))
    assert not list(search.moves.single_place_sources(search.root))  # alone they are among the starts of one cause more


def test_a_clearance_and_what_only_it_shows_are_found_together() -> None:
    """Alone each is driven back to nothing: the carrier moves what is tight by little, the clearance by too much.

    An ellipticity of the encoder opens no contact: beside it they are found as beside nothing.
    """
    true = (replace(TWICE, values=(-3 * ARCSEC, 2 * ARCSEC)), replace(RUNOUT, values=(0.010, -0.020)), PLAY)
    fit = settled(Model(OTHER, true), *true, conditions=LIGHT)
    search = search_of(fit, [effect.key for effect in true])
    for cause in true[1:]:
        alone = beside(fit, true[0], cause)
        assert alone.data > 2 * alone.bound
    best, done = search.best()
    assert done
    assert best.names == frozenset(map(named, true))
    for effect in true[1:]:
        assert sizes(best, effect) == pytest.approx(effect.values, abs=2e-3)


def test_beside_a_profile_that_was_ground_off_the_pin_that_then_carries_is_found() -> None:
    """The profile alone takes off less than half of what both make."""
    profile = replace(PROFILE, values=(0.020, 0.010))
    pin = rverror.effect("cycloid.pin_radius", pin=5, deviation="6.5 um")
    fit = settled(Model(OTHER, (profile, pin)), profile, pin, conditions=(*USUAL, (1.0, 150e3)))
    search = search_of(fit, [profile.key, pin.key])
    both, alone = frozenset(map(named, (profile, pin))), search.score.of(beside(fit, profile))
    assert alone.fit.objective > (search.root.fit.objective + fit.objective) / 2
    best = raced(search, search.moves.one_more(alone))[0]
    assert search.complete(best)
    assert best.names == both
    assert sizes(best, pin) == pytest.approx(pin.values, abs=5e-4)


def test_a_profile_is_named_without_its_twins() -> None:
    """A wave of the pins of no harmonic is a part of it: both together can do no more, and share its size."""
    cam = replace(CAM, uncertainty=3e-4)
    fit = settled(Model(OTHER, (cam, PROFILE)), PROFILE, declared=Model(UNIT, (cam,)), conditions=LIGHT)
    search = search_of(fit)
    best, done = search.best()
    assert done
    assert best.names == {named(PROFILE)}
    assert sizes(best, PROFILE) == pytest.approx(PROFILE.values, abs=1e-3)


# --- a new source -----------------------------------------------------------------------------------------------------


def bores_off_the_axis(contacts: Contacts) -> rverror.geartrain.ErrorVector:
    """All bores of a carrier whose bearings run about another axis, fixed in the carrier."""
    cos, sin = np.cos(contacts.theta), np.sin(contacts.theta)
    across = np.stack([np.stack([cos, sin]), np.stack([-sin, cos])])
    return rverror.geartrain.ErrorVector(contact="carrier", vector=-across[:, None])


def written(starts: tuple[tuple[float, ...], ...]) -> Source:
    """The source as its author would enter it, but for its starts."""
    return rverror.geartrain.Source(
        "coupling.bores_off_the_axis", bores_off_the_axis, (),
        (rverror.geartrain.Parameter("x", "length", 0.05), rverror.geartrain.Parameter("y", "length", 0.05)),
        "carrier", lambda mechanism, indices: (), "a test", "bores about another axis than the bearings",
        starts=starts,
    )  # fmt: skip


def test_of_a_new_source_that_no_linear_step_tells_starts_are_all_that_a_search_needs() -> None:
    """Its forces cancel while the discs balance: twice the error makes four times the wave, of either sign."""
    keys, found = ("coupling.bores_off_the_axis", CAM.key, PLANET.key), {}
    for starts in ((), AROUND):
        with rverror.model.extended(written(starts)):
            true = Effect(keys[0], {}, (-6e-3, 5e-3))
            fit = settled(Model(OTHER, (true,)), true, conditions=LIGHT)
            search = search_of(fit, keys, budget=500)  # with starts 64 are enough
            assert search.complete(search.score.of(fit))
            (linear,) = [o for o in linear_offers(search, search.root.with_rows.fit) if o.names[0][0] == true.key]
            assert search.root.fit.objective - linear.objective < 10
            found[len(starts)] = *search.best(), true
    best, done, true = found[6]
    assert done
    assert best.names == {named(true)}
    assert sizes(best, true) == pytest.approx(true.values, abs=5e-4)
    assert not found[0][1]


# --- what is moved ----------------------------------------------------------------------------------------------------


def test_a_pin_that_stands_for_the_one_beside_it_gives_way() -> None:
    """Pushed in by 5 um at light load a pin carries for those beside it, which look much like it."""
    fit = settled(Model(OTHER, (PIN,)), PIN, conditions=LIGHT)
    search = search_of(fit, NEAR_PINS)
    wrong = search.score.of(beside(fit, Effect(PIN.key, {"pin": 4}, (0.0, 2e-3))))
    (found,) = [one for one in moved(search, wrong) if one.names == {named(PIN)}]
    assert search.complete(found)
    assert found.score < wrong.score - search.score.sure
    best, done = search.best(wrong)
    assert done
    assert [e.key for e in best.fit.added] == [PIN.key]
    assert best.fit.added[0].indices["pin"] in (5, 13)  # it, or the one half a turn on


def test_what_bends_is_begun_anew_where_its_fit_ended_elsewhere() -> None:
    """From these sizes of a profile no step leads to the true ones: other pins carry."""
    cam = replace(CAM, uncertainty=3e-4)
    fit = settled(Model(OTHER, (cam, PROFILE)), PROFILE, declared=Model(UNIT, (cam,)), conditions=LIGHT)
    search = search_of(fit, NEAR_PROFILES)
    wrong = search.score.of(beside(fit, replace(PROFILE, values=(-5e-3, 5e-3))))
    assert not search.complete(wrong)
    (found,) = complete_ones(search, moved(search, wrong))[:1]
    assert found.names == {named(PROFILE)}
    assert found.fit.added[0].values == pytest.approx(PROFILE.values, abs=1e-3)


def test_causes_that_hold_one_another_in_a_wrong_place_change_it_together() -> None:
    """On the other disc, all opposite, both look alike but for the contacts; one of them alone cannot follow."""
    here = [
        Effect("cycloid.disc_profile", {"disc": 1, "harmonic": 1}, (2.6e-3, 2.5e-3)),
        Effect("coupling.carrier_bore_position", {"crank": 1}, (3.5e-3, 15.6e-3)),
    ]
    there = [replace(here[0], indices={"disc": 0, "harmonic": 1}), here[1]]
    known = (
        Effect("cycloid.disc_pitch", {"disc": 0, "harmonic": 1}, (0.8e-3, -5e-3), 3e-4),
        Effect("cycloid.disc_pitch", {"disc": 1, "harmonic": 1}, (-1e-3, -0.2e-3), 3e-4),
        Effect(CAM.key, {"crank": 0, "disc": 1}, (-1.4e-3, -1.4e-3), 3e-4),
    )
    fit = settled(
        Model(OTHER, (*known, *here)), *here, declared=Model(UNIT, known), conditions=LIGHT, seed=4, points=1024
    )
    search = search_of(fit, [*NEAR_AXES, "cycloid.disc_profile", CAM.key])
    wrong = search.score.of(beside(fit, *(replace(e, values=tuple(-value for value in e.values)) for e in there)))
    assert wrong.fit.data < 2 * wrong.fit.bound
    assert not search.complete(wrong)
    found = min(complete_ones(search, moved(search, wrong)), key=lambda one: one.score)
    assert [e.key for e in found.fit.added] == [e.key for e in here]
    assert found.fit.added[0].values == pytest.approx(here[0].values, abs=1e-3)
    assert wrong.score > found.score + 100


def test_no_move_puts_a_cause_into_a_set_twice() -> None:
    """Waves of one harmonic on both discs: begun anew in an equivalent place the one would stand where the other is."""
    waves = [rverror.effect("cycloid.disc_pitch", disc=d, harmonic=2, cos=f"{1 + d} um") for d in (0, 1)]
    fit = settled(Model(OTHER, tuple(waves)), *waves, conditions=LIGHT)
    search = search_of(fit, ["cycloid.disc_pitch"])
    seen = [trial.added for trial in search.moves.other_places(search.score.of(fit))]
    assert len(seen) > 10
    assert all(len(set(map(named, effects))) == len(effects) for effects in seen)
    assert len({frozenset((named(e), e.values) for e in effects) for effects in seen}) == len(seen)


@pytest.mark.parametrize(
    ("true", "ahead", "off"),
    [
        (replace(PLANET, values=(0.03, -0.02)), 0.21, 0.08),
        (Effect(WAVE.key, {"harmonic": 2}, (-6.4e-3, 2.4e-3, -3.8e-3, 6e-3)), 0.03, 0.05),
    ],
    ids=["planet", "wave"],
)
def test_marks_are_placed_anew_where_one_cause_is_none(true: Effect, ahead: float, off: float) -> None:
    """Turned by wrong marks a planet's wave fits as well, but not the declared cam's, which is known to 0.3 um.

    At light load no linear step finds a wave of the pins; its sizes that were fitted at wrong marks are nearly right,
    but with no other marks to try no start leads to the right ones.
    """
    period = TURN / fundamental_orders(UNIT)["crank"]
    cam = replace(CAM, uncertainty=3e-4)
    runs = [replace(r, index="unknown") for r in runs_of(Model(UNIT, (cam, true)), LIGHT, points=1024, marks=ahead)]
    model, anywhere = with_marks(Model(UNIT, (cam,)), runs)
    records, _ = records_of(model, runs)
    first = first_state(RunSet.of(UNIT, records, POLICY, points=1024, anywhere=anywhere), model, model)
    both = replace(model, effects=(*model.effects, true))
    known = with_estimated_noise(fitted(evaluated(first.run_set, marked(both, ahead), model), steps=30))
    wrong = evaluated(known.run_set, marked(both, ahead + off), model)
    free = np.ones(wrong.moment.size, dtype=np.bool_)
    free[2] = False  # the marks, after the cam's two
    fit = fitted(wrong, free=free, steps=40)
    offsets = tuple(np.arange(POLICY.offsets) * period / POLICY.offsets)
    search = search_of(fit, [true.key], offsets=offsets)
    one = search.score.of(fit)
    assert not search.complete(one)
    (found,) = complete_ones(search, moved(search, one))[:1]
    assert {e.key for e in found.fit.added} == {true.key}
    assert abs((found.fit.model.index_offset - ahead + period / 2) % period - period / 2) < 0.003
    if true.key == PLANET.key:  # the set as it stands, with the marks elsewhere
        search = search_of(fit, [true.key], offsets=offsets)
        (again,) = complete_ones(search, raced(search, search.moves.other_marks(one)))[:1]
        assert abs((again.fit.model.index_offset - ahead + period / 2) % period - period / 2) < 0.003


# --- what fits as well ------------------------------------------------------------------------------------------------


def test_rivals_hold_the_exact_twin_at_another_place(right: Fit) -> None:
    """Half a turn on, crank 1 stands as crank 0 did and disc 1 as disc 0: no run tells the two apart."""
    search = search_of(right, NEAR_CAMS)
    one = search.score.of(right)
    found = rivals(search, one)
    twin = next(r for r in found if dict(r.fit.added[0].indices) == {"crank": 1, "disc": 1})
    assert twin.fit.added[0].key == CAM.key
    assert twin.fit.objective == pytest.approx(right.objective, abs=0.2)
    assert twin.fit.added[0].values == pytest.approx(right.added[0].values, abs=1e-5)
    assert (CAM.key, {"crank": 1, "disc": 1}) in search.as_good(one, 0)
    assert all(rival.fit.run_set is right.run_set for rival in found)


@pytest.mark.parametrize("alike", [1e-30, 0.01, 0.9])
def test_what_fits_as_well_is_what_comes_near_by_score_or_by_objective(right: Fit, alike: float) -> None:
    search = search_of(right, [CAM.key, "cycloid.disc_bore_position", PLANET.key], alike=alike)
    one = search.score.of(right)
    near = {
        rival.names
        for rival in rivals(search, one)
        if min(rival.score - one.score, rival.fit.objective - right.objective) < -2 * math.log(alike)
    }
    assert {frozenset([named(Effect(key, indices, ()))]) for key, indices in search.as_good(one, 0)} == near


def test_rivals_hold_the_exact_twin_of_another_key() -> None:
    """A disc ground smaller all around is pins that are all larger."""
    fit = settled(Model(UNIT, (PINS, CAM)), PINS, declared=Model(UNIT, (CAM,)), rms=0.1)
    search = search_of(fit, NEAR_PROFILES)
    found = {rival.fit.added[0].key: rival for rival in rivals(search, search.score.of(fit))}
    assert PROFILE.key in found, sorted(found)
    assert found[PROFILE.key].fit.objective == pytest.approx(fit.objective, abs=1.0)


def test_a_profile_is_among_the_rivals_of_pins_that_stand_for_it() -> None:
    """No linear step from there tells its sizes, not even where they are the exact twin of one of its parts."""
    cam = replace(CAM, uncertainty=3e-4)
    fit = settled(Model(OTHER, (cam, PROFILE)), PROFILE, declared=Model(UNIT, (cam,)), conditions=LIGHT, points=1024)
    search = search_of(fit, NEAR_PROFILES)
    one = search.score.of(beside(fit, PINS))
    found = rivals(search, one)
    assert one.names not in [rival.names for rival in found]
    assert found[0].names == {named(PROFILE)}
    assert sizes(found[0], PROFILE) == pytest.approx(PROFILE.values, abs=1e-3)


def test_a_runout_stands_beside_the_one_bore_that_makes_as_much() -> None:
    """A bore closes half of what the runout of both does, by squares, and shows twice as large."""
    bore = rverror.effect("coupling.carrier_bore_position", crank=1, radial="-7 um", tangential="-1.2 um")
    runout = rverror.effect("coupling.carrier_runout", x="-3.5 um", y="-0.6 um")
    fit = settled(Model(OTHER, (bore,)), bore, conditions=LIGHT)
    search = search_of(fit, [bore.key, runout.key])
    both = search.score.of(beside(fit, runout))
    sources = [trial.added[0].key for trial in search.moves.same_gaps(both)]
    assert sources.count(bore.key) == 2
    search.expand(both, search.challengers)
    assert frozenset({named(bore)}) in search.known  # raced at once, whatever it promises
    best, done = search.best(both)
    assert done
    assert best.names == {named(bore)}


def test_two_causes_that_share_the_sizes_of_one_give_way_to_it() -> None:
    """A wave of the pins of no harmonic opens gaps as a profile's shift does, which alone falls to a local minimum."""
    cam = replace(CAM, uncertainty=3e-4)
    fit = settled(Model(OTHER, (cam, PROFILE)), PROFILE, declared=Model(UNIT, (cam,)), conditions=LIGHT)
    search = search_of(fit, ["cycloid.pin_circle", PROFILE.key])
    shift = Effect("cycloid.pin_circle", {"harmonic": 0}, (-3e-3, 0.0, 0.0, 0.0))
    both = search.score.of(beside(fit, shift, replace(PROFILE, values=(8e-3, -3e-3))))
    assert both.fit.data < both.fit.bound
    assert all(search.score.better(both, part) for part in search.parts(both))
    trials = [trial for trial in search.moves.same_gaps(both) if len(trial.added) == 1]
    best = raced(search, trials)[0]
    assert best.names == {named(PROFILE)}
    assert sizes(best, PROFILE) == pytest.approx(PROFILE.values, abs=1e-3)


def test_a_complete_set_gives_way_to_a_better_one_with_another_cause_in_one_s_place() -> None:
    """Pins that are all thinner fit what a profile does but for what it does besides."""
    cam = replace(CAM, uncertainty=3e-4)
    ground = replace(PROFILE, values=(6e-3, 0.0))
    fit = settled(Model(OTHER, (cam, ground)), ground, declared=Model(UNIT, (cam,)), conditions=LIGHT)
    search = search_of(fit, [PINS.key, PROFILE.key])
    pins, profile = (search.score.of(beside(fit, cause)) for cause in (replace(PINS, values=(-6e-3,)), ground))
    best, done = search.best(max(pins, profile, key=lambda one: one.score))
    assert done
    assert best.score == pytest.approx(min(pins.score, profile.score), abs=1)


def test_what_shows_by_its_square_is_a_rival_and_has_either_sign() -> None:
    """No linear step tells of a carrier's runout, its starts do; and its opposite makes the same, unlike a wave's."""
    fit = settled(Model(OTHER, (RUNOUT,)), RUNOUT, conditions=LIGHT)
    search = search_of(fit)
    wave = search.score.of(beside(fit, Effect("cycloid.disc_pitch", {"disc": 1, "harmonic": 2}, (-5e-4, -4e-4))))
    (linear,) = [o for o in linear_offers(search, search.root.with_rows.fit) if o.names[0][0] == RUNOUT.key]
    assert search.root.fit.objective - linear.objective < 10
    (rival,) = [one for one in rivals(search, wave) if one.names == {named(RUNOUT)}]
    assert search.complete(rival)
    assert sizes(rival, RUNOUT) == pytest.approx(RUNOUT.values, abs=3e-4)
    opposites = search.opposites(search.score.of(fit))
    assert [np.sign(one.added[0].values) for one in opposites] == [pytest.approx(-np.sign(fit.added[0].values))]
    assert (np.array(half_widths(fit, opposites)[:2]) > 2 * np.abs(fit.added[0].values)).all()
    assert search.opposites(wave) == []


def test_a_runout_is_a_rival_of_a_bore_that_stands_for_it() -> None:
    """They share a frame; no linear step tells of the runout, so that it is begun at all its starts."""
    true = replace(RUNOUT, values=(-2.14e-3, 1.66e-3))
    fit = settled(Model(OTHER, (true,)), true, conditions=LIGHT, seed=10)
    bore = rverror.effect("coupling.carrier_bore_position", crank=0, radial="3 um", tangential="1 um")
    search = search_of(fit, NEAR_AXES)
    one = search.score.of(beside(fit, bore))
    assert search.complete(one)
    stood(search, one)
    assert named(RUNOUT) in map(identity, search.as_good(one, 0))


def test_one_cause_that_shows_by_its_square_replaces_two_that_stand_for_it() -> None:
    """Two bores make much of a runout, which no linear step tells of; its starts are followed to their end."""
    fit = settled(Model(OTHER, (RUNOUT,)), RUNOUT, conditions=LIGHT)
    search = search_of(fit, NEAR_AXES)
    bores = [
        rverror.effect("cycloid.disc_bore_position", disc=disc, crank=0, radial="2 um", tangential="1 um")
        for disc in (0, 1)
    ]
    two = search.score.of(beside(fit, *bores))
    found = {other.names: other for other in stood(search, two)}
    (other,) = [found[names] for names in found if names == {named(RUNOUT)}]
    assert search.complete(other)
    assert other.score < two.score
    assert sizes(other, RUNOUT) == pytest.approx(RUNOUT.values, abs=3e-4)


def test_what_hides_behind_declared_sizes_is_seen_from_where_they_were_declared() -> None:
    """Over a quarter of a turn a cam and the stiffness make up for a ground profile, and nothing is left to be seen."""
    cam = replace(CAM, uncertainty=3e-3)
    ground = replace(PROFILE, values=(-2e-3, -15e-3))
    fit = settled(Model(OTHER, (cam, ground)), ground, declared=Model(UNIT, (cam,)), turns=0.25)
    search = search_of(fit, NEAR_PROFILES)
    assert search.complete(search.root)
    assert {named(PROFILE)} in [one.names for one in stood(search, search.root)]
    search = search_of(fit, NEAR_PROFILES)
    best, done = search.best()
    assert done
    assert best.names == {named(PROFILE)}
    assert best.score < search.score.of(fit).score + 1
    none = search_of(fit, NEAR_PROFILES, most_effects=0)
    assert stood(none, none.root) == []


def test_what_declared_sizes_may_hide_is_fitted_whatever_it_promises_at_first(
    right: Fit, monkeypatch: pytest.MonkeyPatch
) -> None:
    """From sizes as declared it takes some steps until a promise says anything."""
    search = search_of(right, NEAR_CAMS)
    (cause,) = right.added
    trial = Trial(search.root.fit.model.with_effects(cause), math.inf, search.root.without_rows)
    monkeypatch.setattr(search.moves, "masked", lambda one: iter([trial]))
    list(search.challengers(search.root))
    assert frozenset({named(cause)}) in search.known


@pytest.mark.parametrize(("behind", "followed"), [(50.0, True), (70.0, False)])
def test_a_rival_is_followed_where_its_promise_may_be_off_by_what_it_lacks(
    right: Fit, behind: float, followed: bool
) -> None:
    """A linear step may be off by 60: of 90 units one lost a rival that fits as well where promises were believed."""
    search = search_of(right, NEAR_CAMS)
    best = search.score.of(right)
    search.keep([best])
    trial = Trial(right.model, best.score + search.margin + behind, search.root.without_rows)
    search.expand(search.root, lambda one: iter([trial]))
    assert search.compare(best) == followed


def test_what_promises_most_is_compared_once_it_took_three_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where jumps moved, a state at the size of a linear step says little of what that promised."""
    search = read(HEAD)
    model, root = search.root.fit.model, search.root
    pins = [replace(PIN, indices={"pin": pin}) for pin in range(UNIT.pins)]
    promising = Trial(model.with_effects(HEAD), root.score - 50, root, first=True)
    others = [Trial(model.with_effects(pin), root.score - 10, root, first=pin in pins[:7]) for pin in pins]

    def further(trial: Trial, score: object) -> Trial:
        falls = (800.0, -300.0, -600.0) if trial.added == (HEAD,) else (0.0,)
        later = replace(trial, taken=trial.taken + 1, score=trial.score + dict(enumerate(falls)).get(trial.taken, 0.0))
        return replace(later, fit=root.fit) if later.finished else later

    monkeypatch.setattr(Trial, "further", further)
    behind = search.race([promising, *others])
    assert len(behind) == len(others) - 2  # three are followed to their end
    assert all(trial.added != (HEAD,) for trial in behind)


def test_a_set_that_the_last_round_completes_has_rivals_too(right: Fit) -> None:
    """Other crank and disc, which only contacts distinguish."""
    search = search_of(right, NEAR_CAMS)
    search.widest = 0  # no beam is left
    best, complete = search.best(search.score.of(right))
    assert complete
    assert search.as_good(best, 0)


def test_every_end_of_a_race_that_comes_near_a_complete_set_is_fitted(right: Fit) -> None:
    """Half a turn on, the other crank and disc do the same: whichever ends a little ahead, both are fitted."""
    search = search_of(right, NEAR_CAMS)
    one = search.score.of(right)
    search.keep([one])
    twin = replace(right.added[0], indices={"crank": 1, "disc": 1})
    both = [right.model, replace(right.model, effects=(*right.declared.effects, twin))]
    fitted_sets = list[frozenset[object]]()
    search.keep = lambda found: fitted_sets.extend(h.names for h in found)  # type: ignore[method-assign]
    search.race([Trial(model, one.score, search.root.without_rows) for model in both])
    assert set(fitted_sets) == {one.names, frozenset({named(twin)})}
