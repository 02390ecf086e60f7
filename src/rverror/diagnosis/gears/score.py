"""What a set of causes is worth: its posterior probability, and what keeps it from being named.

The score is minus twice the logarithm of a set's posterior probability, by Laplace's approximation: the objective of
its fit, what each added size must be worth (ln det of its prior over that of its posterior), and how unlikely its
causes were before the runs were seen.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rverror.base.chance import chi_square
from rverror.diagnosis.causes import Named, named
from rverror.diagnosis.gears.fit import Fit, as_compared, counted, onto
from rverror.diagnosis.gears.jumps import fall
from rverror.diagnosis.policy import Policy


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A set of causes, fitted.

    Attributes
    ----------
    fit : Fit
        Of runs with the free lines of the set, which drift and settle by themselves or do not.
    score : float
        Minus twice the logarithm of its posterior probability, but for a constant: the less, the better.
    """

    fit: Fit
    score: float

    @property
    def lines(self) -> tuple[float, ...]:
        """Orders of free lines."""
        return self.fit.run_set.lines

    @property
    def slow(self) -> bool:
        """Whether each run drifts and settles by itself."""
        return self.fit.run_set.slow

    @property
    def without_rows(self) -> Hypothesis:
        """The same with a fit without its rows."""
        return replace(self, fit=self.fit.without_rows) if self.fit.rows else self

    @property
    def with_rows(self) -> Hypothesis:
        """The same with the rows of its fit."""
        return replace(self, fit=onto(self.fit.run_set, self.fit))

    @cached_property
    def coarse(self) -> Fit:
        """Its state on few angles, without rows."""
        return onto(self.fit.run_set.coarse, self.fit).without_rows

    @property
    def names(self) -> frozenset[object]:
        """Causes, to compare."""
        return (
            frozenset(named(e) for e in self.fit.added)
            | frozenset(round(o, 2) for o in self.lines)
            | ({"slow"} if self.slow else set())
        )


def _rows(fit: Fit, lines: int, slow: int) -> int:
    """Rows of so many lines, cos and sin, and of drift and settling, in all runs."""
    records = fit.run_set.records
    return 2 * lines * len(records) + (slow * sum(len(r.settling) for r in records) if slow else 0)


class Score:
    """The scores of sets of some candidates.

    Parameters
    ----------
    candidates : sequence of Named
    policy : Policy
    """

    def __init__(self, candidates: Sequence[Named], policy: Policy) -> None:
        """Count the places of each source."""
        self.policy, self.places = policy, Counter(key for key, _ in candidates)

    def cost(self, name: Named) -> float:
        """Minus twice the logarithm of the chance that a candidate is missing, before the runs are seen.

        Every source is as likely as every other, and each of its places as the others.
        """
        return 2 * math.log(max(len(self.places), 1) * max(self.places[name[0]], 1))

    def of(self, fit: Fit) -> Hypothesis:
        """A fit and its score."""
        total = fit.objective
        first = sum(len(e.values) for e in fit.declared.effects)
        prior = np.array([sigma for e in fit.added for sigma in fit.run_set.deviation(e.key, e.indices)])
        at = slice(first, first + prior.size)
        total -= np.linalg.slogdet(fit.covariance[at, at] / np.outer(prior, prior))[1]
        total += sum(self.cost((e.key, e.indices)) for e in fit.added)
        total += self.regular(fit, len(fit.run_set.lines), slow=fit.run_set.slow)
        return Hypothesis(fit, as_compared(float(total)))

    def regular(self, fit: Fit, lines: int, *, slow: bool) -> float:
        """What free lines, cos and sin, and the rows of drift and settling must be worth in every run."""
        return self.policy.row_cost * _rows(fit, lines, slow)

    @property
    def sure(self) -> float:
        """Score by which a set that is 1/`false_alarm` times as probable is lower."""
        return -2 * math.log(self.policy.false_alarm)

    def by_chance(self, more: Hypothesis, less: Hypothesis) -> float:
        """Fall of the objective that noise alone makes at `false_alarm`, with the best of all candidates or with a line
        or settling.

        Parameters
        ----------
        more, less : Hypothesis
            A set, and the same without a cause, a line or settling.
        """
        causes = len(more.fit.added) - len(less.fit.added)
        sizes = sum(len(e.values) for e in more.fit.added) - sum(len(e.values) for e in less.fit.added)
        freedom = sizes + _rows(more.fit, len(more.lines) - len(less.lines), more.slow - less.slow)
        return chi_square(self.policy.false_alarm / (sum(self.places.values()) if causes else 1), freedom)

    def better(self, more: Hypothesis, less: Hypothesis, *, exact: bool = False) -> bool:
        """Tell whether a set with more in it is more probable, and fits better by more than chance makes it.

        Both by more than what the model's own error makes, unless it is taken as `exact`.  What moved jumps alone take
        off does not count, and no error of the model settles as a drift does.
        """
        fallen = fall(less.fit, more.fit)
        gain = less.score - more.score - (less.fit.objective - more.fit.objective) + fallen
        own = 0.0 if exact or more.slow > less.slow else inexact(less.fit)
        return gain > own and fallen > self.by_chance(more, less) + own


def strained(fit: Fit) -> bool:
    """Tell whether sizes and stiffnesses lie farther from where they were declared than chance would put them."""
    first = sum(len(e.values) for e in fit.declared.effects)
    weights = fit.pull.copy()
    weights[first : sum(len(e.values) for e in fit.model.effects)] = 0.0
    return float(weights @ fit.departure**2) > chi_square(fit.run_set.policy.strained, max(int((weights > 0).sum()), 1))


def unsure(fit: Fit, policy: Policy) -> float:
    """Squares that the errors of the equilibrium itself leave."""
    return sum(float(r.kept.sum()) * (policy.model_error / r.noise.rms) ** 2 for r in fit.run_set.records if r.noise)


def inexact(fit: Fit) -> float:
    """What the squares that the model's own errors leave count where a fit stands."""
    policy, data = fit.run_set.policy, max(fit.data, fit.bound)
    own = unsure(fit, policy) + bent(fit, policy)
    return counted(data + own, fit.bound, policy) - counted(data, fit.bound, policy)


def bent(fit: Fit, policy: Policy) -> float:
    """Squares that the model's error about what was added leaves, a share of what it makes through the gear train."""
    seen = zip(fit.run_set.observations, fit.added_parts, strict=True)
    return policy.added_share**2 * sum(float(np.sum(observation.whiten(part[None]) ** 2)) for observation, part in seen)
