"""The search of a drive, step by step, on fits that are plain numbers, and the noise by which it tests."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from rverror.diagnosis.journal import Journal
from rverror.diagnosis.policy import POLICY, Policy
from rverror.diagnosis.result import Fate
from rverror.diagnosis.samples.coloured import smooth_spectrum
from rverror.diagnosis.samples.fit import ScreenedTerm
from rverror.diagnosis.samples.regressors import BESIDE, BOW, EFFECT, LINE, NUISANCE, Term
from rverror.diagnosis.samples.search import DriveSearch
from rverror.model.catalogue import source

A, B, C = "sensor.encoder_eccentricity", "sensor.encoder_ellipticity", "sensor.input_coupling"
SLOPE, FREE = "sensor.drift", "order 7"
MODULE = "rverror.diagnosis.samples.search"


def term(kind: str, name: str, count: int = 1) -> Term:
    return Term(kind, name, np.arange(4.0 * count).reshape(count, 4))


@dataclass
class Numbers:
    """What each set of names leaves of a hundred, and what the search asks of it."""

    left: dict[tuple[str, ...], float]
    worse: frozenset[str] = frozenset()  # on what was left out
    too_large: frozenset[str] = frozenset()
    barred: frozenset[str] = frozenset()
    line: bool = False
    chances: set[float] = field(default_factory=set)
    asked: list[tuple[Term, ...]] = field(default_factory=list)

    def of(self, terms: Sequence[Term]) -> float:
        return self.left.get(tuple(sorted(t.name for t in terms)), 100.0)

    def fitted(self, data: Any, terms: Sequence[Term]) -> Found:
        self.asked.append(tuple(terms))
        return Found(self, tuple(terms))

    def screened(self, data: Any, found: Found, pool: Sequence[Term]) -> tuple[list[ScreenedTerm], list[Term]]:
        free = [t for t in pool if t.name not in {one.name for one in found.terms}]
        ranked = [
            ScreenedTerm(t, 1 - self.of([*found.terms, t]) / 100, ["cos"] * (t.name in self.too_large))
            for t in free if t.name not in self.barred
        ]  # fmt: skip
        return sorted(ranked, key=lambda one: -one.gain), [t for t in free if t.name in self.barred]

    def held_out_gain(self, data: Any, found: Found, trial: Found) -> float:
        return -1.0 if trial.terms[-1].name in self.worse else 1.0

    def best_line(self, data: Any, found: Found) -> Found | None:
        lined = Found(self, (*found.terms, term(LINE, FREE)))
        return lined if self.line and FREE not in {t.name for t in found.terms} else None

    def beats(self, data: Any, line: Found, winner: Found) -> bool:
        return self.of(line.terms) < self.of(winner.terms)


@dataclass
class Found:
    """A fit of terms: one is significant if more than five of the hundred are left without it."""

    numbers: Numbers
    terms: tuple[Term, ...]

    def significant(self, one: Term, chance: float) -> bool:
        self.numbers.chances.add(chance)
        return self.numbers.of([t for t in self.terms if t is not one]) > self.numbers.of(self.terms) + 5


Searched = Callable[..., tuple[list[str], tuple[Fate, ...]]]


def bow_rows(numbers: Numbers) -> set[int]:
    """Number of rows with which a bow beside a drift was fitted."""
    return {t.size for terms in numbers.asked for t in terms if t.kind == BESIDE}


@pytest.fixture
def searched(monkeypatch: pytest.MonkeyPatch) -> Searched:
    """Names that a search ends with, and its history."""

    def search(
        numbers: Numbers, names: Sequence[str], policy: Policy = POLICY, direction: Sequence[float] = (1, 1, 1, 1)
    ) -> tuple[list[str], tuple[Fate, ...]]:
        for name in ("fitted", "screened", "held_out_gain", "best_line", "beats"):
            monkeypatch.setattr(f"{MODULE}.{name}", getattr(numbers, name))
        data: Any = SimpleNamespace(direction=np.array(direction))
        candidates, bows = tuple(term(EFFECT, name) for name in names), (term(NUISANCE, BOW, 2),)
        drive = DriveSearch(data, candidates, bows, policy, Journal(lambda text: None))
        found = drive.best(drive.fitted([]))
        return [t.name for t in found.terms], drive.journal.history

    return search


def told(history: Sequence[Fate]) -> list[tuple[int, str, str]]:
    return [(f.round, f.key, f.fate) for f in history if f.key != BOW]


def test_what_helps_is_added_until_nothing_does(searched: Searched) -> None:
    """Each is tested at the chance that all candidates and nuisances share."""
    numbers = Numbers({(A,): 50, (B,): 60, (A, B): 20, (A, B, C): 18})
    names, history = searched(numbers, (A, B, C))
    assert names == [A, B]
    assert told(history) == [(1, A, "added"), (2, B, "added"), (3, C, "fell")]
    assert next(f for f in history if f.key == C).why == "not significant under the noise of the runs"
    assert next(f for f in history if f.key == A).why == "significant, and better on left-out data"
    assert numbers.chances == {POLICY.false_alarm / 4}


def test_what_later_ones_make_needless_is_dropped(searched: Searched) -> None:
    names, history = searched(Numbers({(A,): 50, (A, B): 21, (A, B, C): 0, (B, C): 1}), (A, B, C))
    assert names == [B, C]
    assert [(f.key, f.why) for f in history if f.fate == "dropped"] == [(A, "needless beside what came later")]


def test_the_next_candidate_is_tried_where_the_leading_one_fails(searched: Searched) -> None:
    """On what was left out it does worse."""
    names, history = searched(Numbers({(A,): 10, (B,): 40}, worse=frozenset({A})), (A, B))
    assert names == [B]
    assert [(f.key, f.fate, f.why) for f in history][:1] == [(A, "fell", "left-out blocks fit worse with it")]


def test_what_the_runs_cannot_tell_is_not_tried(searched: Searched) -> None:
    names, history = searched(Numbers({(A,): 10, (B,): 40}, barred=frozenset({A})), (A, B))
    assert names == [B]
    assert (history[0].key, history[0].why) == (A, "the runs cannot tell it from what is there")


@pytest.mark.parametrize(("plausible", "first"), [(54.0, B), (56.0, A)])
def test_a_size_that_no_workshop_makes_goes_after_one_that_does_half_as_well(
    searched: Searched, plausible: float, first: str
) -> None:
    """Of the hundred the one takes off 90, the other 46 or 44."""
    _, history = searched(Numbers({(A,): 10, (B,): plausible}, too_large=frozenset({A})), (A, B))
    assert next(f.key for f in history if f.fate == "added") == first


def test_a_stronger_line_goes_first_and_is_gone_in_the_end(searched: Searched) -> None:
    """Beside the line the candidate that it smeared over is needless, and another one shows."""
    left = {(A,): 60.0, (FREE,): 40.0, tuple(sorted((B, FREE))): 10.0, (B,): 50.0, tuple(sorted((A, FREE))): 39.0}
    names, history = searched(Numbers(left, line=True), (A, B))
    assert names == [B]
    why = "a stronger line beside it goes first"
    assert any((f.round, f.fate, f.why) == (1, "fell", why) for f in history)
    names, history = searched(Numbers(left | {(FREE,): 70.0}, line=True), (A, B))
    assert names[0] in (A, B)
    assert all(f.why != why for f in history)


def test_what_held_only_beside_a_line_goes_with_it(searched: Searched) -> None:
    """Without the line the first of the two that are left is needless."""
    left = {
        (B,): 60.0, (FREE,): 40.0, tuple(sorted((B, FREE))): 30.0, tuple(sorted((A, FREE))): 20.0,
        tuple(sorted((A, B, FREE))): 5.0, tuple(sorted((A, B))): 58.0,
    }  # fmt: skip
    names, history = searched(Numbers(left, line=True), (A, B))
    assert names == [B]
    assert [f.key for f in history if f.fate == "dropped"] == [A]


def test_a_drift_s_bow_goes_along_and_the_search_goes_on(searched: Searched) -> None:
    """Of one direction alone; its cubic stays away."""
    assert not source(SLOPE).periodic
    left = {(SLOPE,): 50.0, tuple(sorted((BOW, SLOPE))): 49.0, tuple(sorted((A, BOW, SLOPE))): 10.0}
    numbers, both = Numbers(left), Numbers(left)
    names, _ = searched(numbers, (SLOPE, A))
    assert names == [SLOPE, BOW, A]
    assert bow_rows(numbers) == {1}
    names, _ = searched(both, (SLOPE, A), direction=(1, 1, -1, -1))
    assert names == [SLOPE]
    assert bow_rows(both) == set()


def test_a_circle_ends(searched: Searched) -> None:
    class Circle(Numbers):
        def best_line(self, data: Any, found: Found) -> Found | None:
            return found

        def beats(self, data: Any, line: Found, winner: Found) -> bool:
            return True

    names, history = searched(Circle({(A,): 50.0}), (A,), replace(POLICY, rounds=9))
    assert names == []
    assert history[-1].round == 9


# --- the noise --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("variance", [1.0, 3.0])
def test_the_smoothed_spectrum_is_the_variance_of_white_noise_and_no_line_s(variance: float) -> None:
    """A line of a hundred times the noise is cut to eight medians of one bin, and a value is the mean of 129."""
    n = 16384
    white = np.sqrt(variance) * np.random.default_rng(4).normal(size=n)
    assert smooth_spectrum(white).mean() == pytest.approx(variance, rel=4 * np.sqrt(2 / n))
    line = 100 * np.cos(2 * np.pi * 1000 * np.arange(n) / n)
    change = smooth_spectrum(white + line) - smooth_spectrum(white)
    assert np.abs(change).max() < 8 * variance / 129
