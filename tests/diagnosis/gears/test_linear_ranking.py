"""What linear steps promise: against least squares under all priors, written out, and minima of what squares count."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest
from scipy.optimize import minimize

import rverror
from gear_runs import CAM, OFF, OTHER, UNIT, begin, runs_of, search_of
from rverror.base.arrays import Array
from rverror.diagnosis.causes import Named, identity
from rverror.diagnosis.gears.fit import Fit, evaluated, fitted, proposed
from rverror.diagnosis.gears.ranking import SCALES, Columns, Offer, pairs, singles
from rverror.diagnosis.gears.waveform import softened
from rverror.geartrain.mechanism import ContactLaw
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.runs.noise import RunNoise

PLAY = rverror.effect("crank.bearing_clearance", clearance="4 um", uncertainty="2 um")
STATED = rverror.effect("cycloid.disc_profile", disc=1, harmonic=2, cos="2 um", sin="1 um", uncertainty="1 um")
PROFILE = rverror.effect("cycloid.disc_profile", disc=0, harmonic=3, cos="5 um", sin="2 um")
#: Whose contact law can change either way.
INSIDE = replace(UNIT, contact_law=ContactLaw(pin_exponent=1.1, flank_exponent=1.08, profile_curvature=1.0))
HERE = Offer(((CAM.key, CAM.indices),), (np.array(CAM.values),), 0.0, 0.0, 0.0)
KEYS = ("crank.eccentricity", "cycloid.disc_profile", "cycloid.disc_lobe", "involute.planet_eccentricity",
        "cycloid.pin_circle", "sensor.encoder_eccentricity", "crank.index")  # fmt: skip


def free_of_cost(_: Named) -> float:
    """Of every candidate alike."""
    return 0.0


def louder(fit: Fit, times: float) -> Fit:
    """The same state under so many times the noise."""
    records = [
        replace(r, noise=RunNoise(r.noise.coefficients, times * r.noise.sigma)) for r in fit.run_set.records if r.noise
    ]
    return evaluated(fit.run_set.with_records(records), fit.model, fit.declared, fit.waves)


@pytest.fixture(scope="module")
def far() -> Fit:
    """Of runs in which a cam and a wave of a disc are missing: what is declared, beside its minimum."""
    true = Model(OTHER, (PLAY, STATED, CAM, PROFILE))
    now = Model(INSIDE, (PLAY, replace(STATED, values=(1.5e-3, 2e-3))))
    first = begin(now, runs_of(true, points=512), points=512)
    off = Model(softened(INSIDE, 0.3 * OFF), (replace(PLAY, values=(3e-3,)), STATED))
    return evaluated(first.run_set, off, now)


@pytest.fixture(scope="module")
def near(far: Fit) -> Fit:
    """The same in so much noise that squares count as they are."""
    fit = louder(far, 20.0)
    assert fit.data < fit.bound
    assert fit.prior > 1
    return fit


def blocks_of(fit: Fit, keys: Sequence[str] = KEYS) -> list[Columns]:
    search = search_of(fit, keys)
    return search.moves.blocks(fit)


class Linear:
    """What is free in a fit, and some columns, as one linear problem: rows a column, prior precision, how far off."""

    def __init__(self, fit: Fit, blocks: Sequence[Columns]) -> None:
        """Put all runs in a row."""
        self.fit, policy = fit, fit.run_set.policy
        free = np.isfinite(fit.weights)
        own = np.concatenate([np.concatenate(block.rows, axis=1) for block in blocks])
        self.rows = np.concatenate([np.concatenate([w[1:] for w in fit.rows], axis=1)[free], own])
        self.rest = np.concatenate([w[0] for w in fit.rows])
        sigmas = [policy.workshop * np.array([p.plausible for p in source(b.name[0]).parameters]) for b in blocks]
        parts = [(b.directions / s) @ (b.directions / s).T for b, s in zip(blocks, sigmas, strict=True)]
        self.count, first = [len(part) for part in parts], int(free.sum())
        self.prior = np.zeros((first + len(own), first + len(own)))
        self.prior[:first, :first] = np.diag(fit.weights[free])
        for part, end in zip(parts, np.cumsum(self.count), strict=True):
            at = slice(first + int(end) - len(part), first + int(end))
            self.prior[at, at] = part
        self.departure = np.concatenate([fit.departure[free], np.zeros(len(own))])
        self.held = fit.prior - float(fit.weights[free] @ fit.departure[free] ** 2)
        self.sigmas = sigmas

    def step(self, scale: float = 1.0) -> Array:
        """The minimum of the squares, each over a scale, and the priors: a square root of their matrix, stacked."""
        root = np.linalg.cholesky(self.prior + 1e-300 * np.eye(len(self.prior))).T
        size = np.sqrt(np.sum(self.rows**2, axis=1) / scale + np.diag(self.prior))
        stacked = np.concatenate([self.rows.T / math.sqrt(scale), root]) / size
        aim = np.concatenate([self.rest / math.sqrt(scale), -root @ self.departure])
        return np.asarray(np.linalg.lstsq(stacked, aim, rcond=None)[0] / size)

    def objective(self, step: Array) -> float:
        """What a step leaves, as squares count."""
        data = float(np.sum((self.rest - step @ self.rows) ** 2))
        n, m = self.fit.bound, self.fit.run_set.policy.regular
        known = data if data < n else n + m * math.log(1 + (data - n) / m)
        at = self.departure + step
        return known + float(at @ self.prior @ at) + self.held

    def least(self) -> tuple[float, float]:
        """The least that any step leaves, and the scale of squares there, by descent from several steps."""
        known = self.fit.run_set.policy.regular
        size = np.sqrt(np.sum(self.rows**2, axis=1) / self.fit.scale + np.diag(self.prior))

        def scale(rest: Array) -> float:
            return max(1.0, 1 + (float(rest @ rest) - self.fit.bound) / known)

        def gradient(x: Array) -> Array:
            rest = self.rest - (x / size) @ self.rows
            return np.asarray(
                (2 * self.prior @ (self.departure + x / size) - 2 * self.rows @ rest / scale(rest)) / size
            )

        def value(x: Array) -> float:
            return self.objective(x / size)

        starts = [self.step(), 0.0 * self.step(), self.step(self.fit.scale)]
        ends = [minimize(value, size * one, jac=gradient, method="BFGS", options={"gtol": 1e-6}) for one in starts]
        best = min(ends, key=lambda end: float(end.fun))
        return float(best.fun), scale(self.rest - (best.x / size) @ self.rows)

    def worth(self) -> float:
        """ln det of what was known of the added sizes before over that of what is, all together."""
        whole = self.rows @ self.rows.T + self.prior
        first = len(whole) - sum(self.count)
        size = np.sqrt(np.diag(whole))
        inner = np.linalg.inv(whole / np.outer(size, size))[first:, first:] / np.outer(size[first:], size[first:])
        return float(-np.linalg.slogdet(inner)[1] - np.linalg.slogdet(self.prior[first:, first:])[1])


def own_sizes(blocks: Sequence[Columns], step: Array) -> list[Array]:
    """The step's last values as sizes of each block."""
    counts = [len(block.directions) for block in blocks]
    parts = np.split(step[len(step) - sum(counts) :], np.cumsum(counts)[:-1])
    return [part @ block.directions for part, block in zip(parts, blocks, strict=True)]


def called(blocks: Sequence[Columns]) -> frozenset[object]:
    return frozenset(identity(block.name) for block in blocks)


def told(offers: Sequence[Offer]) -> dict[frozenset[object], Offer]:
    return {frozenset(map(identity, offer.names)): offer for offer in offers}


def in_order(offer: Offer, blocks: Sequence[Columns]) -> list[Columns]:
    """The blocks of an offer."""
    places = {identity(block.name): block for block in blocks}
    return [places[identity(name)] for name in offer.names]


def beyond_tangents(fit: Fit, scale: float) -> float:
    """By how much the nearest of the tangents that are tried is above the count of squares at a scale.

    At a scale q times that of the squares themselves a tangent is M (ln q + 1/q - 1) above them.
    """
    q = np.geomspace(1.0, fit.scale, SCALES) / scale
    return float(fit.run_set.policy.regular * np.min(np.log(q) + 1 / q - 1))


def test_an_offer_leaves_what_least_squares_under_all_priors_leave(near: Fit) -> None:
    """Its sizes, what it leaves, and what its sizes must be worth; all others free."""
    blocks = blocks_of(near)
    offers = told(singles(near, blocks, free_of_cost))
    assert len(offers) == len(blocks) > 50
    for block in blocks:
        exact = Linear(near, [block])
        step, offer = exact.step(), offers[called([block])]
        assert offer.objective == pytest.approx(exact.objective(step), abs=1e-5)
        assert offer.score - offer.objective == pytest.approx(exact.worth(), abs=1e-5)
        (sizes,) = own_sizes([block], step)
        assert offer.sizes[0] == pytest.approx(sizes, abs=1e-6 * exact.sigmas[0].max())


def test_offers_come_by_score_with_what_each_candidate_costs(near: Fit) -> None:
    blocks = blocks_of(near)
    plain = told(singles(near, blocks, free_of_cost))
    offers = singles(near, blocks, lambda name: 1e3 if name[0] == CAM.key else 1.0)
    assert [offer.score for offer in offers] == sorted(offer.score for offer in offers)
    for names, offer in told(offers).items():
        assert offer.score == pytest.approx(plain[names].score + (1e3 if offer.names[0][0] == CAM.key else 1.0))
    assert [offer.names[0][0] for offer in offers[-4:]] == [CAM.key] * 4
    assert singles(near, [], free_of_cost) == pairs(near, blocks[:1], free_of_cost, most=3) == []


def test_beyond_noise_an_offer_leaves_nearly_the_least_that_squares_count(far: Fit) -> None:
    """Found by descent of their count itself, of which the ranking knows some tangents: by so much above at most."""
    assert far.data > 5 * far.bound
    blocks = blocks_of(far)
    offers, above = told(singles(far, blocks, free_of_cost)), []
    for block in blocks:
        offer, (least, scale) = offers[called([block])], Linear(far, [block]).least()
        assert -1e-3 < offer.objective - least < beyond_tangents(far, scale) + 1e-3
        above.append((offer.objective - least) / (far.objective - least))
    assert np.median(above) < 0.05
    best = min(blocks, key=lambda block: Linear(far, [block]).least()[0])
    assert min(offers.values(), key=lambda offer: offer.objective).names == (best.name,)


PAIRED = ("crank.eccentricity", "cycloid.disc_profile", "sensor.encoder_eccentricity", "crank.index")


def test_pairs_leave_what_least_squares_of_all_pairs_leave(near: Fit) -> None:
    """Each pair at its sizes, the best of all first: by what they leave, and what all their sizes must be worth."""
    blocks = blocks_of(near, PAIRED)
    exact = {called(both): Linear(near, both) for both in combinations(blocks, 2)}
    by_score = {names: one.objective(one.step()) + one.worth() for names, one in exact.items()}
    offers = pairs(near, blocks, free_of_cost, most=len(exact))
    assert [offer.score for offer in offers] == sorted(offer.score for offer in offers)
    assert len(told(offers)) == len(offers) > len(exact) / 2
    assert next(iter(told(offers))) == min(by_score, key=by_score.__getitem__)
    assert {name[0] for name in offers[0].names} == {CAM.key, PROFILE.key}
    for offer in offers:
        one = Linear(near, in_order(offer, blocks))
        step = one.step()
        assert offer.objective == pytest.approx(one.objective(step), abs=1e-4)
        for given, sizes, sigma in zip(offer.sizes, own_sizes(in_order(offer, blocks), step), one.sigmas, strict=True):
            assert given == pytest.approx(sizes, abs=1e-4 * sigma.max())


def test_a_pair_is_worth_what_both_are_together(near: Fit) -> None:
    """Of two cams that look alike the runs tell the sum, and of the difference nothing."""
    blocks = blocks_of(near, PAIRED)
    for offer in pairs(near, blocks, free_of_cost, most=20):
        worth = Linear(near, in_order(offer, blocks)).worth()
        assert offer.score - offer.objective == pytest.approx(worth, abs=1e-3)


def test_beyond_noise_a_pair_leaves_nearly_the_least_that_squares_count(far: Fit) -> None:
    """The first of them is a cam with a wave of a disc, which are missing; alone neither does as well."""
    blocks = blocks_of(far, PAIRED)
    offers = pairs(far, blocks, free_of_cost, most=12)
    for offer in offers:
        least, scale = Linear(far, in_order(offer, blocks)).least()
        assert -1e-3 < offer.objective - least < beyond_tangents(far, scale) + 1e-3
    assert {name[0] for name in offers[0].names} == {CAM.key, PROFILE.key}
    assert singles(far, blocks, free_of_cost)[0].score > offers[0].score + 50


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_start_is_offered_with_its_own_sign_alone(near: Fit, sign: float) -> None:
    """The change that a cam makes stands for itself at any share of it, and for no cam the other way."""
    (cam,) = [
        block for block in blocks_of(near, (CAM.key,)) if identity(block.name) == identity((CAM.key, CAM.indices))
    ]
    others = blocks_of(near, ("cycloid.disc_profile", "sensor.encoder_eccentricity"))
    direction = sign * np.array([CAM.values])
    start = Columns(cam.name, direction, tuple(direction @ rows for rows in cam.rows), start=True)
    exact = Linear(near, [start])
    assert sign * exact.step()[-1] > 0
    offers, both = singles(near, [start], free_of_cost), pairs(near, [*others, start], free_of_cost, most=50)
    of_it = [offer for offer in both if cam.name in offer.names]
    assert both
    if sign > 0:
        assert offers[0].objective == pytest.approx(exact.objective(exact.step()), abs=1e-5)
        assert offers[0].score - offers[0].objective == pytest.approx(exact.worth(), abs=1e-5)
        assert offers[0].sizes[0] == pytest.approx(exact.step()[-1] * np.array(CAM.values))
        for offer in of_it:
            one = Linear(near, in_order(offer, [*others, start]))
            assert offer.objective == pytest.approx(one.objective(one.step()), abs=1e-4)
            (size,) = [size for name, size in zip(offer.names, offer.sizes, strict=True) if name == cam.name]
            assert size @ np.array(CAM.values) > 0
    else:
        assert offers == []
    assert bool(of_it) is (sign > 0)


def test_of_a_pair_the_better_start_counts_and_nothing_is_paired_with_itself(near: Fit) -> None:
    (cam,) = [
        block for block in blocks_of(near, (CAM.key,)) if identity(block.name) == identity((CAM.key, CAM.indices))
    ]
    ways = [np.array([CAM.values]), np.array([[CAM.values[0], 0.0]]), np.array([[0.0, CAM.values[1]]])]
    starts = [Columns(cam.name, way, tuple(way @ rows for rows in cam.rows), start=True) for way in ways]
    others = blocks_of(near, ("cycloid.disc_profile",))
    offers = pairs(near, [cam, *starts, *others], free_of_cost, most=200)
    names = [frozenset(map(identity, offer.names)) for offer in offers]
    assert len(names) == len(set(names))
    assert all(len(pair) == 2 for pair in names)
    assert {called([cam, other]) for other in others} <= set(names)


@pytest.mark.parametrize("size", [5e-3, -5e-3])
def test_a_size_that_cannot_be_is_not_offered(size: float) -> None:
    """Play is never negative: where runs with one zero ask for less it is no candidate, alone or with another."""
    play: Named = ("coupling.bearing_clearance", {})
    first = begin(Model(UNIT), runs_of(Model(UNIT), points=512, index="A"), points=512)
    made = first.run_set.influences(first.model, first.waves, [play])
    records = [replace(r, error=r.error + size * rows[0]) for r, rows in zip(first.run_set.records, made, strict=True)]
    fit = evaluated(first.run_set.with_records(records), first.model, first.declared)
    found = blocks_of(fit, (play[0], "sensor.encoder_eccentricity", "crank.eccentricity"))
    for offers in (singles(fit, found, free_of_cost), pairs(fit, found, free_of_cost, most=50)):
        assert offers
        assert any(play in offer.names for offer in offers) is (size > 0)


def test_what_a_bound_stops_promises_nothing() -> None:
    """Runs that ask for less than no play: no candidate is offered the squares that this would take."""
    play = rverror.effect("crank.bearing_clearance", clearance="0 um", uncertainty="3 um")
    declared = Model(UNIT, (play,))
    first = fitted(begin(declared, runs_of(Model(UNIT), points=512), points=512))
    both = zip(first.run_set.records, first.raw, strict=True)
    records = [replace(r, error=r.error - 2e-3 * raw[0]) for r, raw in both]
    fit = evaluated(first.run_set.with_records(records), declared, declared)
    assert fit.moment[0] < -3 * math.sqrt(fit.gram[0, 0])
    step, gain = proposed(fit)
    (idle,) = singles(fit, blocks_of(fit, ("sensor.encoder_ellipticity",)), free_of_cost)
    assert step[0] >= 0
    assert idle.objective > fit.objective - gain - 15  # of an encoder's two sizes, by chance
