"""The search of runs on order tables: sets of few causes that account for everything but noise.

Claims are made one after another, so of two causes that make the same orders the first is often what resembles both,
and the next makes up for it.  Where claims come near the noise, whole sets are compared as they are for runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from rverror.diagnosis.gears.fit import Fit, RunSet, evaluated, fitted
from rverror.diagnosis.gears.hunt import Hunt, Node
from rverror.diagnosis.gears.waveform import Named
from rverror.diagnosis.journal import Journal
from rverror.diagnosis.policy import Policy


@dataclass(frozen=True, eq=False)
class TableHunt(Hunt):
    """A search on numbers that are few already, and hold no line that the table does not name."""

    def coarse(self, node: Node) -> RunSet:
        """The conditions themselves."""
        return node.fit.bench

    def _regular(self, node: Node) -> list[Node]:
        return []

    def _settles(self, node: Node) -> bool:
        return False

    def _line_left(self, fit: Fit) -> bool:
        return False


def complete_set(
    root: Fit, claims: Fit, candidates: Sequence[Named], policy: Policy, journal: Journal
) -> tuple[TableHunt, Node] | None:
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
    nodes = [Node(fitted(evaluated(bench, fit.model, fit.declared, fit.waves))) for fit in (claims, root)]
    hunt = TableHunt(tuple(candidates), policy, journal)
    best, done = hunt.best(nodes if claims.added else nodes[1:], policy.expansions)
    return (hunt, best) if done else None
