"""The search for what the model of a geared drive lacks, where every effect is linear in its sizes.

One effect after another: propose and rank, refit, test, compare with free lines, prune, stop.  What the runs say to
each step is the business of a `Likelihood`.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from typing import Protocol, TypeVar

from rverror.base.text import describe
from rverror.diagnosis.policy import Policy
from rverror.diagnosis.result import Fate, Progress
from rverror.geartrain.source import IndexValue

# A fit with what was added so far, and a candidate with its score, as a likelihood has them.
F = TypeVar("F")
C = TypeVar("C")
Name = tuple[str, Mapping[str, IndexValue]]


class Journal:
    """What is told while a search goes on, and what became of each candidate."""

    def __init__(self, tell: Progress) -> None:
        """Begin with an empty history."""
        self.tell, self.round = tell, 0
        self._fates: list[Fate] = []

    def note(self, fate: str, name: Name, why: str) -> None:
        """Write down what became of a candidate in this round: ``fell``, ``added`` or ``dropped``."""
        self._fates.append(Fate(self.round, name[0], dict(name[1]), fate, why))

    @property
    def history(self) -> tuple[Fate, ...]:
        """All that was written down."""
        return tuple(self._fates)


class Likelihood(Protocol[F, C]):
    """What runs say to a search.

    The first four answers every likelihood must give; the others begin as "nothing to do".
    """

    policy: Policy
    journal: Journal

    @abstractmethod
    def added(self, found: F) -> Sequence[Name]:
        """Name what was added, in order."""

    @abstractmethod
    def rank(self, found: F) -> Sequence[C]:
        """Score the candidates beside what was found, the most telling first."""

    @abstractmethod
    def refit(self, found: F, ranking: Sequence[C]) -> Iterable[F]:
        """Refit everything with one leading candidate more, the best first."""

    @abstractmethod
    def fails(self, found: F, trial: F) -> str:
        """Tell why what was added last is not significant, or no help on left-out data; empty where it is both."""

    def rival_line(self, found: F, trial: F) -> F | None:
        """Return the fit with a free line instead, where it explains more than a trial that only lies near it."""
        return None

    def lighter(self, found: F) -> F | None:
        """Return the fit without an effect that later ones have made needless."""
        return None

    def goes_along(self, found: F) -> F | None:
        """Return the fit with what goes along with what was added, significant or not."""
        return None

    def without_lines(self, found: F) -> F | None:
        """Return the fit without the lines that only competed; nothing where there is none."""
        return None


def find_missing(likelihood: Likelihood[F, C], start: F) -> F:
    """Add effects one after another until none is significant.

    What became of every candidate, and why, is in the likelihood's journal.

    Parameters
    ----------
    likelihood : Likelihood
    start : F
        The fit of what was declared.

    Returns
    -------
    F
        The fit with all that holds.
    """
    found = start
    for _ in range(likelihood.policy.rounds):
        more = next_effect(likelihood, found)
        if more is None:
            along = likelihood.goes_along(found)
            if along is None:
                break
            found = along
            continue
        line = likelihood.rival_line(found, more)
        if line is not None:
            _fell(likelihood, more, "a stronger line beside it goes first")
            found = line
            continue
        name = likelihood.added(more)[-1]
        likelihood.journal.tell(f"added {describe(*name)}")
        likelihood.journal.note("added", name, "significant, and better on left-out data")
        found = pruned(likelihood, more)
    plain = likelihood.without_lines(found)
    return found if plain is None else pruned(likelihood, plain)


def next_effect(likelihood: Likelihood[F, C], found: F) -> F | None:
    """Propose and test: the fit with the best candidate that holds.

    Returns
    -------
    F or None
        None where no candidate holds.
    """
    likelihood.journal.round += 1
    for trial in likelihood.refit(found, likelihood.rank(found)):
        if why := likelihood.fails(found, trial):
            _fell(likelihood, trial, why)
        else:
            return trial
    return None


def pruned(likelihood: Likelihood[F, C], found: F) -> F:
    """Drop effects that later ones have made needless."""
    while (less := likelihood.lighter(found)) is not None:
        kept = [(key, dict(indices)) for key, indices in likelihood.added(less)]
        for key, indices in likelihood.added(found):
            if (key, dict(indices)) not in kept:
                likelihood.journal.tell(f"dropped {describe(key, indices)}: needless beside what came later")
                likelihood.journal.note("dropped", (key, indices), "needless beside what came later")
        found = less
    return found


def _fell(likelihood: Likelihood[F, C], trial: F, why: str) -> None:
    likelihood.journal.note("fell", likelihood.added(trial)[-1], why)
