"""What is told while a search goes on, and what became of each candidate."""

from __future__ import annotations

from dataclasses import dataclass, field

from rverror.base.progress import Progress
from rverror.diagnosis.causes import Named
from rverror.diagnosis.result import Fate


@dataclass
class Journal:
    """What is told while a search goes on, and what became of each candidate.

    Attributes
    ----------
    tell : callable
    round : int
    fates : list of Fate
    """

    tell: Progress
    round: int = 0
    fates: list[Fate] = field(default_factory=list)

    def note(self, fate: str, name: Named, why: str) -> None:
        """Write down what became of a candidate in this round: ``fell``, ``added`` or ``dropped``."""
        self.fates.append(Fate(self.round, name[0], dict(name[1]), fate, why))
