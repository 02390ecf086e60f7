"""Trials: sets of causes at sizes from which they are fitted, each with the score that it is expected to reach."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rverror.base.arrays import Array
from rverror.diagnosis.causes import named
from rverror.diagnosis.gears.fit import Fit, as_compared, evaluated, fitted
from rverror.diagnosis.gears.score import Hypothesis, Score
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model

_STEPS = (1, 2, 3, 6)  # of a trial each time that it is taken further, once it is solved


@dataclass(frozen=True, eq=False)
class Trial:
    """A set of causes at sizes from which it is fitted.

    Attributes
    ----------
    model : Model
    score : float
        That the set is expected to reach over every sample.
    origin : Hypothesis
        The set that it was made from, whose lines and drift it has.
    fit : Fit, optional
        Its state on few angles.
    taken : int
        How often it was taken up.
    first : bool
        Whether it was among those that promised most when it was raced.
    """

    model: Model
    score: float
    origin: Hypothesis
    fit: Fit | None = None
    taken: int = 0
    first: bool = False

    @property
    def ahead(self) -> bool:
        """Whether it is among the most promising, and took too few steps to be compared."""
        return self.first and self.taken < len(_STEPS) - 1

    @property
    def added(self) -> tuple[Effect, ...]:
        """Causes beside what is declared."""
        return self.model.effects[len(self.origin.fit.declared.effects) :]

    @property
    def finished(self) -> bool:
        """Whether more steps change little."""
        return self.taken > len(_STEPS) or (self.fit is not None and self.taken > 1 and self.fit.converged)

    @property
    def place(self) -> tuple[object, ...]:
        """Its set and where the marks are, to compare."""
        marks = round(self.model.index_offset / 0.1)
        return frozenset(map(named, self.added)), marks, self.origin.lines, self.origin.slow

    @property
    def way(self) -> Array:
        """Sizes in units of what a workshop makes, as a direction, the causes in an order of their own."""
        causes = sorted(self.added, key=lambda e: str(named(e)))
        shares = [np.array(e.values) / [p.plausible for p in source(e.key).parameters] for e in causes]
        sizes = np.concatenate([np.zeros(0), *shares])
        return np.asarray(sizes / max(float(np.linalg.norm(sizes)), 1e-300))

    @property
    def spent(self) -> int:
        """Solutions that taking it so far last took."""
        return _STEPS[self.taken - 2] if self.taken > 1 else 1

    def further(self, score: Score) -> Trial:
        """The trial solved, or a few steps further.

        Raises
        ------
        NotConvergedError
            If there is no equilibrium.
        """
        origin = self.origin
        if self.fit is None:
            fit = evaluated(origin.coarse.run_set, self.model, origin.coarse.declared, origin.coarse.waves)
        else:
            fit = fitted(self.fit, steps=_STEPS[self.taken - 1], enough=0.5)
        promised = score.of(fit).score - fit.proposal[1]
        # what few angles and means make of the origin is common to both
        reached = as_compared(promised + (origin.score - score.of(origin.coarse).score))
        return replace(self, model=fit.model, fit=fit.without_rows, score=reached, taken=self.taken + 1)


def distinct(trials: Sequence[Trial], most: int) -> list[Trial]:
    """So many trials, in order, of each set no more than two, whose sizes point elsewhere."""
    ahead: dict[object, list[Array]] = {}
    kept: list[Trial] = []
    for trial in trials:
        if len(kept) == most:
            break
        others, way = ahead.setdefault(trial.place, []), trial.way
        if len(others) < 2 and all(way @ other < 0.5 for other in others):
            others.append(way)
            kept.append(trial)
    return kept
