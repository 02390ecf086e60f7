"""How large part errors are taken to be before the runs are seen: as a workshop makes them, or as a lot was made."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from rverror.diagnosis.causes import Named, identity
from rverror.geartrain.mechanism import Mechanism
from rverror.geartrain.source import Indices
from rverror.model.catalogue import source

CauseKey = tuple[object, ...]


@runtime_checkable
class MadeTo(Protocol):
    """What a prior asks of a tolerance, which this room does not know."""

    @property
    def key(self) -> str:
        """A key of the catalogue."""

    def usual(self, mechanism: Mechanism) -> Sequence[tuple[Indices, Mapping[str, float]]]:
        """Root mean squares of the parameters of each part, core units."""


@dataclass(frozen=True)
class SizePrior:
    """Normal priors of added sizes about their declared value, which is nothing.

    Attributes
    ----------
    covered : tuple of frozenset
        Sources with their indices, of each tolerance.
    usual : mapping
        Standard deviations by source, indices and parameter, core units; the others are a workshop's.
    """

    covered: tuple[frozenset[CauseKey], ...] = ()
    usual: Mapping[CauseKey, Mapping[str, float]] = field(default_factory=dict)

    @staticmethod
    def of(tolerances: Sequence[MadeTo], mechanism: Mechanism) -> SizePrior:
        """As some tolerances state; where two state a size both add to it."""
        covered, merged = [], dict[CauseKey, dict[str, float]]()
        for one in tolerances:
            said = {identity((one.key, at)): sizes for at, sizes in one.usual(mechanism)}
            covered.append(frozenset(said))
            for cause, sizes in said.items():
                own = merged.setdefault(cause, {})
                own |= {name: math.hypot(size, own.get(name, 0.0)) for name, size in sizes.items()}
        return SizePrior(tuple(covered), merged)

    def deviation(self, key: str, indices: Indices, workshop: float) -> tuple[float, ...]:
        """Standard deviation of each parameter; a workshop's is a share of the plausible size."""
        stated = self.usual.get(identity((key, indices)), {}) if self.usual else {}
        return tuple(stated.get(p.name, workshop * p.plausible) for p in source(key).parameters)

    def notes(self, tried: Sequence[Named]) -> list[str]:
        """What is said of the tolerances, beside candidates that are tried."""
        count, names = len(self.covered), set(map(identity, tried))
        unused = sum(map(names.isdisjoint, self.covered))
        left = f"; {unused} of nothing that is tried here, ignored" if unused else ""
        return [f"prior: sizes are expected as {count - unused} of {count} tolerances say{left}"] if count else []


WORKSHOP = SizePrior()
