"""The search for what a model lacks, written once for every kind of run.

One effect after another: propose and rank, refit, test, compare with free lines, choose again, prune, stop.  What the
runs say to each step is the business of a `Likelihood`: harmonics of whole periods, or samples.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from rverror.base.text import describe
from rverror.diagnosis.policy import Policy
from rverror.diagnosis.result import Fate, Line, Progress
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


@dataclass(frozen=True)
class Stage:
    """One pass of a search, with more in play than those before.

    Attributes
    ----------
    words : str
        For people.
    together : int
        Effects that may stand together before it is asked whether they leave lines of their own frames.
    restarted : bool
        Whether candidates also start from workshop sizes.
    rare : bool
        Whether rare candidates are added.
    """

    words: str
    together: int
    restarted: bool = False
    rare: bool = False


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

    def full(self, found: F) -> bool:
        """Tell whether nothing more may be added."""
        return False

    def shown_way(self, found: F, trial: F) -> F | None:
        """Return a better fit of what was found, where the trial only showed the way out of a false minimum."""
        return None

    def better(self, one: F, other: F, by: float) -> bool:
        """Tell whether one fit is better than another by so much of the objective."""
        return False

    def rival_line(self, found: F, trial: F) -> F | None:
        """Return the fit with a free line instead, where it explains more than a trial that only lies near it."""
        return None

    def own_lines(self, found: F) -> Sequence[Line]:
        """Significant lines left in the frames of what was added, which it should have explained."""
        return ()

    def explains_much(self, found: F, trial: F) -> bool:
        """Tell whether a trial explained so much that lines left in its frame may be another effect's."""
        return True

    def second_alone(self, settled: F, found: F) -> F:
        """Return what was settled with the last effect of what was found, so that the one before is chosen again."""
        return found

    def lighter(self, found: F) -> F | None:
        """Return the fit without an effect that later ones have made needless."""
        return None

    def placed_again(self, found: F) -> F:
        """Choose the last effect again among those that look like it: one that stood beside it is gone."""
        return found

    def goes_along(self, found: F) -> F | None:
        """Return the fit with what goes along with what was added, significant or not."""
        return None

    def without_lines(self, found: F) -> F | None:
        """Return the fit without the lines that only competed; nothing where there is none."""
        return None

    def stages(self) -> Sequence[Stage]:
        """Name further passes, for what stays open."""
        return ()

    def suits(self, stage: Stage, lines: Sequence[Line]) -> bool:
        """Tell whether a pass can explain lines that are left."""
        return True

    def at(self, stage: Stage) -> Likelihood[F, C]:
        """Return the likelihood with what a pass puts in play."""
        return self

    def lines(self, found: F) -> Sequence[Line]:
        """Significant lines that are left, the strongest first."""
        return ()


@dataclass(frozen=True)
class Outcome(Generic[F, C]):
    """What a search came to.

    Attributes
    ----------
    found : F
        The fit with all that holds.
    last : F
        The last fit; with more than `found` where its last effects leave lines of their own frames and are not named.
    left : sequence of Line
        Those lines.
    ranking : sequence of C
        Candidates of the last round, the best first.
    history : tuple of Fate
        What became of every candidate, and why.
    """

    found: F
    last: F
    left: Sequence[Line]
    ranking: Sequence[C]
    history: tuple[Fate, ...]


def find_missing(likelihood: Likelihood[F, C], start: F) -> tuple[Likelihood[F, C], Outcome[F, C]]:
    """Search for what a model lacks; what stays open is searched again with more in play.

    Parameters
    ----------
    likelihood : Likelihood
    start : F
        The fit of what was declared.

    Returns
    -------
    Likelihood
        With all that came into play.
    Outcome
    """
    outcome = _passed(likelihood, start, together=1)
    doubtful = {False: outcome.last is not outcome.found}
    for stage in likelihood.stages():
        lines = likelihood.lines(outcome.found)
        if not lines:
            break
        # several together only where one by one, from the same sizes, ended in doubt
        needless = stage.together > 1 and not stage.rare and not doubtful.get(stage.restarted, False)
        if needless or not likelihood.suits(stage, lines):
            continue
        likelihood.journal.tell(f"searching again {stage.words}")
        likelihood = likelihood.at(stage)
        again = _passed(likelihood, start, together=stage.together)
        doubtful.setdefault(stage.restarted, again.last is not again.found)
        if not stage.restarted or not likelihood.lines(again.found):
            outcome = again
    return likelihood, outcome


def _passed(likelihood: Likelihood[F, C], start: F, *, together: int) -> Outcome[F, C]:
    """Add effects one after another until none is significant, or the best one does not explain its own orders."""
    found = settled = start
    ranking: Sequence[C] = ()
    left: Sequence[Line] = ()
    for _ in range(likelihood.policy.rounds):
        if likelihood.full(found):
            break
        step = next_effect(likelihood, found)
        ranking, more = step
        if more is None:
            along = likelihood.goes_along(found)
            if along is None:
                break
            found = settled = along
            continue
        if _count(likelihood, more) == _count(likelihood, found):
            if not likelihood.better(more, found, likelihood.policy.level):
                break
            settled, found = more if settled is found else settled, more
            continue
        line = likelihood.rival_line(found, more)
        if line is not None:
            _fell(likelihood, more, "a stronger line beside it goes first")
            found = settled = line
            continue
        name = likelihood.added(more)[-1]
        likelihood.journal.tell(f"added {describe(*name)}")
        likelihood.journal.note("added", name, "significant, and better on left-out data")
        # what is left may belong to another effect of the same frame
        left = likelihood.own_lines(more)
        unsure = _count(likelihood, more) - _count(likelihood, settled)
        if left and unsure == together > 1:
            both = chosen_again(likelihood, settled, more, left)
            more, left = both
        if left and (unsure == together or not likelihood.explains_much(found, more)):
            found = more
            break
        found = more if left else pruned(likelihood, more)
        settled = settled if left else found
    plain = likelihood.without_lines(settled)
    if plain is not None:
        found = settled = pruned(likelihood, plain)
    if found is not settled:
        orders = ", ".join(f"{line.order:g}" for line in left[:4])
        _fell(likelihood, found, f"not named: leaves lines of its own frame at order {orders}")
    return Outcome(settled, found, left, ranking, likelihood.journal.history)


def next_effect(likelihood: Likelihood[F, C], found: F) -> tuple[Sequence[C], F | None]:
    """Propose and test: the ranking, and the fit with the best candidate that holds.

    That fit has no more effects than before where the candidate only showed the way to a better one.

    Returns
    -------
    sequence of C
    F or None
        None where no candidate holds.
    """
    likelihood.journal.round += 1
    ranking = likelihood.rank(found)
    for trial in likelihood.refit(found, ranking):
        if why := likelihood.fails(found, trial):
            _fell(likelihood, trial, why)
            continue
        way = likelihood.shown_way(found, trial)
        if way is None:
            return ranking, trial
        _fell(likelihood, trial, "not needed: it only showed the other sizes a better place")
        return ranking, way
    return ranking, None


def chosen_again(likelihood: Likelihood[F, C], settled: F, found: F, left: Sequence[Line]) -> tuple[F, Sequence[Line]]:
    """Choose the first of two unsure effects again beside the second: alone it had to stand for both.

    Parameters
    ----------
    likelihood : Likelihood
    settled, found : F
        Before both, and with both.
    left : sequence of Line
        That both leave in their own frames.

    Returns
    -------
    F, sequence of Line
        The better one of both choices, and what it leaves.
    """
    likelihood.journal.tell(f"choosing again beside {describe(*likelihood.added(found)[-1])}")
    step = next_effect(likelihood, likelihood.second_alone(settled, found))
    again = step[1]
    if again is None or not likelihood.better(again, found, 0.0):
        return found, left
    return again, likelihood.own_lines(again)


def pruned(likelihood: Likelihood[F, C], found: F) -> F:
    """Drop effects that later ones have made needless, and choose the place of the last one again."""
    while (less := likelihood.lighter(found)) is not None:
        kept = [(key, dict(indices)) for key, indices in likelihood.added(less)]
        for key, indices in likelihood.added(found):
            if (key, dict(indices)) not in kept:
                likelihood.journal.tell(f"dropped {describe(key, indices)}: needless beside what came later")
                likelihood.journal.note("dropped", (key, indices), "needless beside what came later")
        found = likelihood.placed_again(less)
    return found


def _count(likelihood: Likelihood[F, C], found: F) -> int:
    return len(likelihood.added(found))


def _fell(likelihood: Likelihood[F, C], trial: F, why: str) -> None:
    likelihood.journal.note("fell", likelihood.added(trial)[-1], why)
