"""The search of runs on order tables: sets of few causes that account for everything but noise.

Claims are made one after another, so of two causes that make the same orders the first is often what resembles both,
and the next makes up for it.  Where claims come near the noise, whole sets are compared as they are for runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rverror.diagnosis.gears.fit import Fit, RunSet, evaluated, fitted
from rverror.diagnosis.gears.score import Hypothesis
from rverror.diagnosis.gears.search import Search
from rverror.diagnosis.gears.waveform import Named
from rverror.diagnosis.journal import Journal
from rverror.diagnosis.policy import Policy


class TableSearch(Search):
    """A search on numbers that are few already, and hold no line that the table does not name."""

    def coarse(self, one: Hypothesis) -> RunSet:
        """The conditions themselves."""
        return one.fit.bench

    def regular(self, one: Hypothesis) -> list[Hypothesis]:
        """Nothing."""
        return []

    def _settles(self, one: Hypothesis) -> bool:
        return False

    def _line_left(self, fit: Fit) -> bool:
        return False


def complete_set(
    root: Fit, claims: Fit, candidates: Sequence[Named], policy: Policy, journal: Journal
) -> tuple[TableSearch, Hypothesis] | None:
    """A set of causes that leaves nothing but noise, and the search with its rivals; none where there is none.

    Parameters
    ----------
    root : Fit
        Of what is declared.
    claims : Fit
        With the causes that are claimed.
    candidates : sequence of Named
    policy : Policy
        Of runs: what is not explained yet is of any size.
    journal : Journal
    """
    if claims.data > policy.near_claims * claims.bound:
        return None
    bench = replace(root.bench, policy=policy)
    first, then = (fitted(evaluated(bench, fit.model, fit.declared, fit.waves)) for fit in (root, claims))
    search = TableSearch(first, candidates, policy, journal)
    best, done = search.best(*([search.score.of(then)] if claims.added else []))
    return (search, best) if done else None
