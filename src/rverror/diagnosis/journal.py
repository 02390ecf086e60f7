"""What is told while a search goes on, and what became of each candidate."""

from __future__ import annotations

from collections.abc import Mapping

from rverror.base.progress import Progress
from rverror.diagnosis.result import Fate
from rverror.geartrain.source import IndexValue

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
