"""The search's procedure on a likelihood of plain numbers: each step happens when the likelihood asks for it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from rverror.diagnosis.policy import POLICY, Policy
from rverror.diagnosis.result import Line
from rverror.diagnosis.search import Journal, Likelihood, Name, Stage, find_missing

Found = tuple[str, ...]
LINE = Line(7.0, 1.0, 0.5, 1.5, ())


@dataclass(frozen=True, eq=False)
class Told(Likelihood[Found, str]):
    """What each set of names leaves of a hundred, and which of them leave lines of their own."""

    left: dict[Found, float]
    names: tuple[str, ...]
    own: dict[Found, tuple[Line, ...]] = field(default_factory=dict)
    passes: tuple[Stage, ...] = ()
    policy: Policy = POLICY
    journal: Journal = field(default_factory=lambda: Journal(lambda text: None))

    def of(self, found: Found) -> float:
        return self.left.get(tuple(sorted(found)), 100.0)

    def added(self, found: Found) -> Sequence[Name]:
        return [(name, {}) for name in found]

    def rank(self, found: Found) -> list[str]:
        return sorted((n for n in self.names if n not in found), key=lambda n: self.of((*found, n)))

    def refit(self, found: Found, ranking: Sequence[str]) -> Iterator[Found]:
        yield from ((*found, name) for name in ranking)

    def fails(self, found: Found, trial: Found) -> str:
        return "" if self.of(trial) < self.of(found) - 5 else "no gain"

    def better(self, one: Found, other: Found, by: float) -> bool:
        return self.of(one) < self.of(other) - by

    def own_lines(self, found: Found) -> Sequence[Line]:
        return self.own.get(tuple(sorted(found)), ())

    def second_alone(self, settled: Found, found: Found) -> Found:
        return (*settled, found[-1])

    def lighter(self, found: Found) -> Found | None:
        for name in found[:-1]:
            less = tuple(n for n in found if n != name)
            if self.of(less) < self.of(found) + 5:
                return less
        return None

    def stages(self) -> tuple[Stage, ...]:
        return self.passes

    def lines(self, found: Found) -> Sequence[Line]:
        return (LINE,) if self.of(found) > 10 else ()

    def at(self, stage: Stage) -> Told:
        return replace(self, names=(*self.names, "rare")) if stage.rare else self


def test_what_helps_is_added_until_nothing_does() -> None:
    told = Told({("a",): 50, ("b",): 60, ("a", "b"): 20, ("a", "b", "c"): 18}, ("a", "b", "c"))
    _, outcome = find_missing(told, ())
    assert outcome.found == outcome.last == ("a", "b")
    fates = [(f.round, f.key, f.fate) for f in outcome.history]
    assert fates == [(1, "a", "added"), (2, "b", "added"), (3, "c", "fell")]
    assert outcome.history[-1].why == "no gain"


def test_what_later_ones_make_needless_is_dropped() -> None:
    told = Told({("a",): 50, ("a", "b"): 21, ("a", "b", "c"): 0, ("b", "c"): 1}, ("a", "b", "c"))
    _, outcome = find_missing(told, ())
    assert outcome.found == ("b", "c")
    assert [f.key for f in outcome.history if f.fate == "dropped"] == ["a"]


def test_what_leaves_lines_of_its_own_is_not_named() -> None:
    _, outcome = find_missing(Told({("a",): 50}, ("a",), own={("a",): (LINE,)}), ())
    assert (outcome.found, outcome.last, outcome.left) == ((), ("a",), (LINE,))
    assert outcome.history[-1].why == "not named: leaves lines of its own frame at order 7"


def test_two_of_one_frame_are_tried_together_and_the_first_chosen_again() -> None:
    left = {("a",): 50.0, ("b",): 70.0, ("c",): 60.0, ("a", "b"): 20.0, ("b", "c"): 0.0, ("a", "c"): 45.0}
    own = dict.fromkeys([("a",), ("b",), ("c",), ("a", "b"), ("a", "c")], (LINE,))
    stages = (Stage("for two", 2),)
    _, outcome = find_missing(Told(left, ("a", "b", "c"), own, stages), ())
    assert outcome.found == ("b", "c")
    # without doubt about one there is no need for two
    calm = Told({("a",): 50.0}, ("a", "b"), passes=stages)
    assert find_missing(calm, ())[1].history[-1].round == 2


def test_rare_candidates_come_last_and_only_where_they_explain_all() -> None:
    stages = (Stage("with rare ones", 1, restarted=True, rare=True),)
    told = Told({("a",): 50.0, ("a", "rare"): 5.0}, ("a",), passes=stages)
    likelihood, outcome = find_missing(told, ())
    assert outcome.found == ("a", "rare")
    assert isinstance(likelihood, Told)
    assert likelihood.names == ("a", "rare")
    part = Told({("a",): 50.0, ("a", "rare"): 30.0}, ("a",), passes=stages)
    assert find_missing(part, ())[1].found == ("a",)


def test_a_circle_ends() -> None:
    class Circle(Told):
        def shown_way(self, found: Found, trial: Found) -> Found | None:
            return found

        def better(self, one: Found, other: Found, by: float) -> bool:
            return True

    _, outcome = find_missing(Circle({("a",): 50.0}, ("a",), policy=replace(POLICY, rounds=9)), ())
    assert outcome.found == ()
    assert outcome.history[-1].round == 9
