"""Suspected units by their own equilibrium: members are near, gross errors are far and are told."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
import scipy

import rverror
from gear_runs import TURN, UNIT
from rverror.base.arrays import Array
from rverror.base.text import describe
from rverror.base.units import ARCSEC
from rverror.lots.amplitudes import Amplitudes, Condition
from rverror.lots.own_equilibrium import FittedUnit, GrossError, OwnEquilibrium, Prior, hopped, nearest
from rverror.lots.processes import UnitParts, processes_of
from rverror.lots.simulated import COMPLIANCES, Simulator, Solve, SolvedUnit, State
from rverror.model.effects import Model

CAM, BORE, PIN = "crank.eccentricity", "cycloid.disc_bore_position", "cycloid.pin_position"
DEVIATION = {CAM: 2e-3, BORE: 2e-3, PIN: 2e-3}
AMPLITUDES = 60
SEED = 4
CHANCE = 0.005 / 200  # of a unit, where a lot of 200 may name one in 200


def test_of_linear_units_the_distance_is_that_of_their_covariance() -> None:
    """The truth is that of generalised least squares: y' (1 + S S')^-1 y."""
    rng = np.random.default_rng(0)
    influence, middle, values = (
        rng.standard_normal((30, 12)) * 20,
        rng.standard_normal(30),
        rng.standard_normal(12) * 50,
    )
    spread = np.exp(rng.standard_normal(30))
    slopes = (influence * spread[:, None]).T
    away = values - middle @ influence
    expected = away @ np.linalg.solve(np.eye(12) + slopes @ slopes.T, away)

    def solve(errors: Array) -> SolvedUnit:
        return SolvedUnit(errors @ influence, influence)

    found = nearest(solve, values, Prior(middle, spread), rng.standard_normal(30))
    assert found is not None
    assert found.distance == pytest.approx(expected, rel=1e-6)
    assert nearest(lambda errors: None, values, Prior(middle, spread), np.zeros(30)) is None


@pytest.mark.parametrize("seed", range(6))
def test_the_unit_is_found_among_the_local_minima_of_contacts_that_open(seed: int) -> None:
    """Amplitudes of 24 contacts that carry on one side alone: the unit itself is at its errors and noise, and 17
    draws from the prior lead to none as near."""
    rng = np.random.default_rng(seed)
    carried, errors, noise = 20 * rng.standard_normal((24, 24)), rng.standard_normal(24), rng.standard_normal(24)
    usual, itself = Prior(np.zeros(24), np.ones(24)), float(errors @ errors + noise @ noise)

    def solve(errors: Array) -> SolvedUnit:
        return SolvedUnit(np.maximum(errors, 0) @ carried, carried * (errors > 0)[:, None])

    values = solve(errors).values + noise
    starts = rng.standard_normal((17, 24))
    assert min(one.distance for one in (nearest(solve, values, usual, start) for start in starts) if one) > itself
    found = hopped(solve, values, usual, itself, np.random.default_rng(1))
    assert found is not None
    assert found.distance < itself


def test_draws_about_a_unit_have_its_posterior_with_three_times_the_noise_that_is_left() -> None:
    """Of the covariance S' (S S' + s)^-1 S less than the prior's, s three times the mean square that is left; with no
    more left than noise three times that."""
    rng = np.random.default_rng(2)
    slopes, sizes = 2 * rng.standard_normal((3, 5)), rng.standard_normal(5)
    for left, noise in ((np.array([4.0, -2.0, 2.0]), 3 * 8.0), (np.array([0.1, 0.2, 0.3]), 3.0)):
        unit = FittedUnit(sizes, left, slopes)
        drawn = np.array([unit.drawn(rng) for _ in range(20_000)]) - sizes
        expected = np.eye(5) - slopes.T @ np.linalg.solve(slopes @ slopes.T + noise * np.eye(3), slopes)
        assert np.abs(drawn.mean(axis=0)).max() < 0.03
        assert np.abs(drawn.T @ drawn / len(drawn) - expected).max() < 0.05


@cache
def lot_at_light_load() -> OwnEquilibrium:
    """At 20 N*m most pins of such units carry nothing."""
    theta = TURN * np.arange(128) / 128
    run = rverror.run_from_arrays(
        input_angle=UNIT.ratio * theta, output_angle=theta, direction="forward", torque="20 N*m"
    )
    tolerances = [rverror.tolerance(key, "10 um") for key in DEVIATION]
    parts = UnitParts(processes_of(Model(UNIT), run, tolerances))
    orders = np.array([1, 2, 3, 13, 14, 15, 16, 17, 18, 19, 30, 31, 32, 33, 48])
    conditions = tuple(Condition(way, 20e3) for way in (1.0, -1.0))
    lot = Amplitudes(
        (), {}, conditions, orders, np.zeros((0, AMPLITUDES)), np.full(AMPLITUDES, (0.05 * ARCSEC) ** 2), 128
    )
    state = State(np.array([DEVIATION[process.key] for process in parts.processes]), np.zeros(COMPLIANCES))
    simulator = Simulator(Model(UNIT), parts, lot)
    return OwnEquilibrium(simulator, state, np.zeros((COMPLIANCES, COMPLIANCES)), seed=1)


def spread() -> Array:
    own = lot_at_light_load()
    return own.state.deviation[own.simulator.parts.process]


def drawn(count: int) -> tuple[Array, Array]:
    """Part errors of members, and the noise of their amplitudes, of unit variance."""
    rng = np.random.default_rng(SEED)
    return spread() * rng.standard_normal((count, len(spread()))), rng.standard_normal((count, AMPLITUDES))


def measured(errors: Array, noise: Array, compliance: float = 0.0) -> Array:
    simulator = lot_at_light_load().simulator
    return simulator.values(State(np.ones(len(DEVIATION)), np.full(COMPLIANCES, compliance)), errors) + noise


@dataclass(frozen=True)
class LinearSimulator:
    """Units whose amplitudes are sums of what each error makes."""

    parts: UnitParts
    influence: Array

    def linearised_at(self, state: State, root: Array) -> Solve:
        return lambda errors: SolvedUnit(errors @ self.influence, self.influence)


@dataclass(frozen=True)
class LinearLot:
    """A lot of such units: under each hypothesis amplitudes are normal, with a covariance of their own."""

    own: OwnEquilibrium
    values: Array
    influence: Array
    part: int = 1  # that is gross

    def spread(self, gross: int | None = None) -> Array:
        """Of the errors of a unit, or of one of which an effect may be of any plausible size."""
        parts, state = self.own.simulator.parts, self.own.state
        usual, wide = state.deviation[parts.process], np.array([p.plausible for p in parts.parameters])
        return np.concatenate([np.where(parts.effect == gross, wide, usual), np.ones(COMPLIANCES)])

    def covariance(self, spread: Array) -> Array:
        slopes = (self.influence * spread[:, None]).T
        return np.eye(self.values.size) + slopes @ slopes.T

    def density(self, gross: int | None = None) -> float:
        """Minus twice the logarithm of the density of the amplitudes, but for a constant."""
        covariance = self.covariance(self.spread(gross))
        return float(self.values @ np.linalg.solve(covariance, self.values) + np.linalg.slogdet(covariance)[1])

    def misfit(self, gross: int | None = None) -> float:
        covariance = self.covariance(self.spread(gross))
        return max(1.0, float(self.values @ np.linalg.solve(covariance, self.values)) / self.values.size)

    def found(self, chance: float) -> tuple[GrossError, ...]:
        return self.own.gross_errors(
            self.values, np.zeros(len(self.own.simulator.parts.process)), chance=chance, usual=chance
        )


@cache
def linear_lot() -> LinearLot:
    """Its model lacks noise of the size of the scatter; of the gross part one parameter hardly shows, and
    another part does nearly the same."""
    rng, lot = np.random.default_rng(5), lot_at_light_load()
    parts = lot.simulator.parts
    influence = rng.standard_normal((len(parts.process) + COMPLIANCES, 24)) * 2e3
    influence[-COMPLIANCES:] *= 1e-4
    gross = np.flatnonzero(parts.effect == LinearLot.part)
    influence[gross[1]] *= 1e-5
    influence[np.flatnonzero(parts.effect == 5)[0]] += 3 * influence[gross[0]]
    own = replace(lot, simulator=LinearSimulator(parts, influence))  # type: ignore[arg-type]
    errors = spread() * rng.standard_normal(len(spread()))
    errors[gross[0]] = 0.08
    return LinearLot(own, errors @ influence[: len(errors)] + 35 * rng.standard_normal(24), influence)


def test_of_linear_units_the_gain_is_that_of_two_normal_densities() -> None:
    """Less twice the logarithm of how many kinds and parts of the kind there are."""
    lot = linear_lot()
    process = [p for p in lot.own.simulator.parts.processes for _ in p.instances][lot.part]
    odds = lot.density() - lot.density(lot.part) - 2 * math.log(len(DEVIATION) * len(process.instances))
    first, *_ = lot.found(0.01)
    assert first.effect == lot.part
    assert first.gain == pytest.approx(odds, rel=1e-6)
    assert first.unit.misfit == pytest.approx(lot.misfit(lot.part), rel=1e-6)
    assert first.unit.misfit > 1.1


def test_of_linear_units_sizes_are_conditional_means_with_errors_as_much_larger_as_the_model_lacks() -> None:
    lot = linear_lot()
    parts, spread_of = lot.own.simulator.parts, lot.spread(lot.part)
    at = np.concatenate([parts.effect, np.full(COMPLIANCES, -1)]) == lot.part
    gain = (spread_of**2)[at, None] * lot.influence[at] @ np.linalg.inv(lot.covariance(spread_of))
    left = (spread_of**2)[at] - np.einsum("pd,pd->p", gain, (spread_of**2)[at, None] * lot.influence[at])
    first, *_ = lot.found(0.01)
    assert first.sizes == pytest.approx(gain @ lot.values, rel=1e-5, abs=1e-6)
    assert first.errors == pytest.approx(np.sqrt(left * lot.misfit(lot.part)), rel=1e-6)
    assert first.known.tolist() == [True, False]
    assert (left / (spread_of**2)[at] < 0.5).tolist() == [True, False]


def test_a_gross_error_is_told_from_the_odds_on_that_the_chance_asks_for() -> None:
    """Counted in units of what the model lacks of a member, and rivals in units of what it lacks of them."""
    lot = linear_lot()
    first, *_ = lot.found(0.01)
    least = math.exp(-first.gain / 2 / lot.misfit())
    assert lot.found(1.1 * least)
    assert not lot.found(0.9 * least)
    few = [n for n, p in enumerate(p for p in lot.own.simulator.parts.processes for _ in p.instances) if p.key != PIN]
    other = min((n for n in few if n != lot.part), key=lot.density)
    ahead = math.exp(-(lot.density(other) - lot.density(lot.part)) / 2 / lot.misfit(other))
    named = [{one.effect for one in lot.found(chance)} for chance in (0.9 * ahead, 1.1 * ahead)]
    assert other in named[0]
    assert other not in named[1]


def test_of_the_farthest_units_a_part_is_told_with_its_interval_or_several_kinds_without_a_cause() -> None:
    lot = linear_lot()
    members = np.random.default_rng(1).standard_normal((21, lot.values.size))
    values, far = np.concatenate([lot.values[None], members]), np.arange(22.0)[::-1]
    serials = [f"unit {number}" for number in range(22)]
    middle = np.zeros((22, len(lot.own.simulator.parts.process)))
    (unclear,) = lot.own.outsiders(serials, values, middle, far, np.full(22, 0.01), level=22 * 0.01)
    assert unclear.serial == "unit 0"
    assert unclear.causes == ()  # a cam or a bore
    assert {name.split(" ")[0] for name in unclear.rivals} == {CAM, BORE}
    (found,) = lot.own.outsiders(serials, values, middle, far, np.full(22, 0.3), level=22 * 0.3)
    first, *_ = lot.found(0.3)
    (shift,) = found.causes
    assert shift.size.value == pytest.approx(first.sizes[0])
    assert shift.size.high - shift.size.value == pytest.approx(1.96 * first.errors[0])
    # it is the nearest now, and then suspected all the same
    assert not lot.own.outsiders(serials, values, middle, -far, np.full(22, 0.3), level=22 * 0.3)
    assert lot.own.outsiders(serials, values, middle, -far, np.where(far == 21, 0.4, 0.3), level=22 * 0.3)


def test_parts_are_asked_for_beyond_the_distance_that_a_share_of_the_members_exceeds() -> None:
    """A chi-square; a member that is nearer needs no part, whatever the odds are."""
    lot = linear_lot()
    share = float(scipy.stats.chi2.sf(lot.misfit() * lot.values.size, lot.values.size))
    asked = [
        lot.own.gross_errors(lot.values, np.zeros(len(spread())), chance=0.3, usual=times * share)
        for times in (0.9, 1.1)
    ]
    assert [bool(some) for some in asked] == [False, True]


def test_a_suspect_is_asked_where_others_are_near_enough() -> None:
    """At a chance that fewer members exceed than its distance, and that its part's odds do."""
    lot = replace(linear_lot(), values=0.45 * linear_lot().values)  # at which the odds say more than the distance
    first, *_ = lot.found(0.04)
    share = float(scipy.stats.chi2.sf(lot.misfit() * lot.values.size, lot.values.size))
    chance = math.sqrt(share * math.exp(-first.gain / 2 / lot.misfit()))
    one = ("unit",), lot.values[None], np.zeros((1, len(spread())))
    named = [bool(lot.own.outsiders(*one, np.ones(1), np.array([beyond]), level=chance)) for beyond in (chance, 0.05)]
    assert named == [False, True]


@dataclass(frozen=True)
class OneSidedPins:
    """Units as of `LinearSimulator`, but that pins carry on one side alone."""

    parts: UnitParts
    influence: Array

    def linearised_at(self, state: State, root: Array) -> Solve:
        pins = np.array([self.parts.effects[effect].key == PIN for effect in self.parts.effect])
        pins = np.concatenate([pins, np.zeros(COMPLIANCES, np.bool_)])

        def solve(errors: Array) -> SolvedUnit:
            carries = ~pins | (errors > 0)
            return SolvedUnit(errors * carries @ self.influence, self.influence * carries[:, None])

        return solve


@pytest.mark.parametrize("seed", range(8))
def test_a_part_is_sought_as_thoroughly_as_a_member(seed: int) -> None:
    """It is named, and its unit as near as the true one, which the fits from sizes all round are far from: with these
    alone three of twenty such parts are named."""
    rng, lot = np.random.default_rng(seed), lot_at_light_load()
    parts, gross = lot.simulator.parts, 1
    influence = rng.standard_normal((len(parts.process) + COMPLIANCES, 30)) * 1e3
    influence[-COMPLIANCES:] *= 1e-5
    own = replace(lot, simulator=OneSidedPins(parts, influence))  # type: ignore[arg-type]
    errors = spread() * rng.standard_normal(len(spread()))
    errors[parts.effect == gross] = (0.05, 0.03)
    solve = own.simulator.linearised_at(own.state, own.root)
    solved = solve(np.concatenate([errors, np.zeros(COMPLIANCES)]))
    assert solved is not None
    noise = rng.standard_normal(30)
    wide = np.where(parts.effect == gross, [p.plausible for p in parts.parameters], spread())
    first, *_ = own.gross_errors(solved.values + noise, np.zeros(len(errors)), chance=0.01, usual=0.01)
    assert first.effect == gross
    assert first.unit.distance < np.sum((errors / wide) ** 2) + noise @ noise
    errors[parts.effect == gross] = spread()[parts.effect == gross]
    member = solve(np.concatenate([errors, np.zeros(COMPLIANCES)]))
    assert member is not None
    assert own.gross_errors(member.values + noise, np.zeros(len(errors)), chance=0.01, usual=0.01) == ()


def test_errors_of_an_estimate_are_no_gross_errors() -> None:
    """A variance of 4 um^2 that may as well be 9."""
    lot, soft = lot_at_light_load(), np.diag(np.arange(1.0, 10.0)) ** 2
    estimate = SimpleNamespace(
        state=State(np.full(3, 2e-3), np.zeros(COMPLIANCES)), variance_error=5e-6, covariance=soft
    )
    own = OwnEquilibrium.of(lot.simulator, estimate)  # type: ignore[arg-type]
    assert own.state.deviation == pytest.approx(3e-3)
    assert own.root @ own.root.T == pytest.approx(soft[-COMPLIANCES:, -COMPLIANCES:])


def test_members_are_no_farther_than_they_are_made() -> None:
    """A unit's own errors and noise are one unit that has its amplitudes: of some starts one comes as near."""
    own, (errors, noise) = lot_at_light_load(), drawn(4)
    solve = own.simulator.linearised_at(own.state, own.root)
    starts = np.random.default_rng(1).standard_normal((6, len(spread()) + COMPLIANCES))
    usual = Prior(np.zeros(starts.shape[1]), np.concatenate([spread(), np.ones(COMPLIANCES)]))
    values = measured(errors, noise)
    made = np.sum((errors / spread()) ** 2, axis=1) + np.sum(noise**2, axis=1)
    for unit, most in zip(values, made, strict=True):
        assert min(one.distance for one in (nearest(solve, unit, usual, start) for start in starts) if one) < most


@pytest.mark.parametrize("key", [CAM, BORE])
def test_a_gross_error_is_told_though_contacts_open(key: str) -> None:
    """It or its mirror image, which no run tells from it; no part of another kind is nearly as likely."""
    own, (errors, noise) = lot_at_light_load(), drawn(1)
    parts, truth = own.simulator.parts, (0.04, -0.03)
    effect = next(number for number, one in enumerate(parts.effects) if one.key == key)
    errors[:, parts.effect == effect] = truth
    found = own.gross_errors(measured(errors, noise)[0], np.zeros(len(spread())), chance=CHANCE, usual=CHANCE)
    mirror = {name: 1 - int(at) for name, at in parts.effects[effect].indices.items()}
    there = [parts.effects[one.effect].indices for one in found]
    assert there[0] in (parts.effects[effect].indices, mirror)
    assert parts.effects[effect].indices in there
    assert mirror in there
    assert {parts.effects[one.effect].key for one in found} == {key}
    assert np.all(abs(found[0].sizes - truth) < 4 * found[0].errors)
    assert np.all(found[0].known)


def test_the_mirror_image_is_told_whatever_its_odds() -> None:
    """At a chance that leaves the likeliest part alone."""
    own, (errors, noise) = lot_at_light_load(), drawn(1)
    parts = own.simulator.parts
    errors[:, parts.effect == 0] = (0.04, -0.03)
    first, *others = own.gross_errors(measured(errors, noise)[0], np.zeros(len(spread())), chance=0.99, usual=0.99)
    (mirror,) = [parts.effects[one.effect] for one in others]
    assert mirror.key == parts.effects[first.effect].key
    assert mirror.indices == {name: 1 - int(at) for name, at in parts.effects[first.effect].indices.items()}


def test_a_unit_is_named_with_its_part_and_with_those_that_do_the_same() -> None:
    """Of a member and a unit with a gross cam the latter: cam and mirror image are named, one beside the other."""
    own, (errors, noise) = lot_at_light_load(), drawn(2)
    parts = own.simulator.parts
    errors[1, parts.effect == 0] = (0.04, -0.03)
    found = own.outsiders(
        ("sound", "spoilt"),
        measured(errors, noise),
        0 * errors,
        np.array([1.0, 2.0]),
        np.full(2, CHANCE),
        level=2 * CHANCE,
    )
    assert [one.serial for one in found] == ["spoilt"]
    assert found[0].chance < 2 * CHANCE
    assert {one.key for one in found[0].causes} == {CAM}
    cams = {describe(CAM, {"crank": crank, "disc": crank}) for crank in (0, 1)}
    assert cams <= {describe(CAM, found[0].causes[0].indices), *found[0].rivals}


def test_a_member_has_no_gross_error() -> None:
    own, (errors, noise) = lot_at_light_load(), drawn(4)
    for unit in measured(errors, noise):
        assert own.gross_errors(unit, np.zeros(len(spread())), chance=CHANCE, usual=CHANCE) == ()


def test_the_means_of_a_unit_are_where_its_group_has_them() -> None:
    own, (errors, noise) = lot_at_light_load(), drawn(1)
    shift = np.where(own.simulator.parts.effect == 0, 0.05, 0.0)  # one cam's
    values = measured(errors + shift, noise)[0]
    assert own.gross_errors(values, shift, chance=CHANCE, usual=CHANCE) == ()
    assert own.gross_errors(values, 0 * shift, chance=CHANCE, usual=CHANCE)


def test_stiffnesses_are_uncertain_to_first_order() -> None:
    """A unit whose compliances are 1 % and 2 % larger is that of a state that has them."""
    own, (errors, _) = lot_at_light_load(), drawn(1)
    compliance = np.array([0.01, 0.02, 0.0, 0.01, 0.0, 0.02])
    root = np.diag(compliance)
    solve, bare = (own.simulator.linearised_at(own.state, some) for some in (root, 0 * root))
    both = np.concatenate([errors[0], np.ones(COMPLIANCES)])
    near, away, softer = solve(both), bare(both), own.simulator.values(State(np.ones(3), compliance), errors)
    assert near is not None
    assert away is not None
    assert np.linalg.norm(near.values - softer[0]) < 0.1 * np.linalg.norm(away.values - softer[0])
    assert near.influence[-COMPLIANCES:].sum(axis=0) == pytest.approx(near.values - away.values)
