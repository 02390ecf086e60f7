"""The search's procedure on a likelihood of plain numbers: each step happens when the likelihood asks for it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

from rverror.diagnosis.policy import POLICY, Policy
from rverror.diagnosis.search import Journal, Likelihood, Name, find_missing

Found = tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Told(Likelihood[Found, str]):
    """What each set of names leaves of a hundred; `line` competes, and `bow` goes along with `slope`."""

    left: dict[Found, float]
    names: tuple[str, ...]
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

    def rival_line(self, found: Found, trial: Found) -> Found | None:
        line = (*found, "line")
        return line if "line" not in found and self.of(line) < self.of(trial) else None

    def lighter(self, found: Found) -> Found | None:
        for name in found[:-1]:
            less = tuple(n for n in found if n != name)
            if self.of(less) < self.of(found) + 5:
                return less
        return None

    def goes_along(self, found: Found) -> Found | None:
        return (*found, "bow") if "slope" in found and "bow" not in found else None

    def without_lines(self, found: Found) -> Found | None:
        return tuple(n for n in found if n != "line") if "line" in found else None


def test_what_helps_is_added_until_nothing_does() -> None:
    told = Told({("a",): 50, ("b",): 60, ("a", "b"): 20, ("a", "b", "c"): 18}, ("a", "b", "c"))
    assert find_missing(told, ()) == ("a", "b")
    fates = [(f.round, f.key, f.fate) for f in told.journal.history]
    assert fates == [(1, "a", "added"), (2, "b", "added"), (3, "c", "fell")]
    assert told.journal.history[-1].why == "no gain"


def test_what_later_ones_make_needless_is_dropped() -> None:
    told = Told({("a",): 50, ("a", "b"): 21, ("a", "b", "c"): 0, ("b", "c"): 1}, ("a", "b", "c"))
    assert find_missing(told, ()) == ("b", "c")
    assert [f.key for f in told.journal.history if f.fate == "dropped"] == ["a"]


def test_the_next_candidate_is_tried_where_the_leading_one_fails() -> None:
    class Barred(Told):
        def fails(self, found: Found, trial: Found) -> str:
            return "barred" if trial[-1] == "a" else super().fails(found, trial)

    told = Barred({("a",): 10, ("b",): 40}, ("a", "b"))
    assert find_missing(told, ()) == ("b",)
    assert [(f.key, f.fate, f.why) for f in told.journal.history[:1]] == [("a", "fell", "barred")]


def test_a_stronger_line_goes_first_and_is_gone_in_the_end() -> None:
    """Beside the line the candidate that it smeared over is needless, and another one shows."""
    left = {("a",): 60, ("line",): 40, ("b", "line"): 10, ("b",): 50, ("a", "line"): 39}
    told = Told(left, ("a", "b"))
    assert find_missing(told, ()) == ("b",)
    first = told.journal.history[0]
    assert (first.fate, first.why) == ("fell", "a stronger line beside it goes first")
    without = replace(told, left=left | {("line",): 70}, journal=Journal(lambda text: None))
    assert find_missing(without, ())[0] in ("a", "b")
    assert all(f.why != first.why for f in without.journal.history)


def test_what_goes_along_is_put_in_at_the_end_and_the_search_goes_on() -> None:
    told = Told({("slope",): 50, ("bow", "slope"): 49, ("a", "bow", "slope"): 10}, ("slope", "a"))
    assert find_missing(told, ()) == ("slope", "bow", "a")


def test_a_circle_ends() -> None:
    class Circle(Told):
        def rival_line(self, found: Found, trial: Found) -> Found | None:
            return found

    told = Circle({("a",): 50.0}, ("a",), policy=replace(POLICY, rounds=9))
    assert find_missing(told, ()) == ()
    assert told.journal.history[-1].round == 9
