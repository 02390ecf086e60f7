"""How the errors of one tolerance are drawn: instances, their correlation, classes, and what the worst case chooses."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from rverror.base.arrays import Array, Integers
from rverror.geartrain.source import IndexValue
from rverror.tolerances.distribution import Distribution, Planar, Scalar, normal_correlation, normal_quantile, turned


@dataclass(frozen=True)
class Component:
    """One toleranced parameter of one instance of a source."""

    key: str  #: a key of the catalogue
    indices: Mapping[str, IndexValue]  #: which crank, disc, pin, harmonic
    parameter: str
    dimension: str  #: a key of `units.CORE_UNITS`

    def __str__(self) -> str:
        """Key, indices and parameter in one word: ``crank.eccentricity(crank=0, disc=1).radial``."""
        return f"{self.key}{listed(self.indices)}.{self.parameter}"


@dataclass(frozen=True)
class WorstGroup:
    """Components whose values the worst case chooses together."""

    #: Of instances that move as one, (instances, 1): a number, within +-`radius` widths; or (instances, 2): those of a
    #: vector, no longer than `radius` widths.
    components: Integers
    radius: float = 1.0  #: in widths of the tolerance


@dataclass(frozen=True)
class SamplingRule:
    """How the standard draws of one entry come about."""

    first_variate: int  #: where the entry's uniform variates begin
    first_component: int  #: where its components begin, ordered by instance, then by parameter
    instances: int
    terms: int  #: parameters of an instance; the two of a vector stand side by side
    distribution: Distribution
    correlation: float = 0.0  #: Pearson correlation of the values of one parameter between any two instances, 0 to 1
    #: Whether each vector is turned by an angle of its own at assembly, after the correlation.
    random_phase: bool = False
    #: Whether it is drawn together with other entries, by `Stack.dependence`, which holds its correlation too.
    joined: bool = False
    #: Into how many classes of equal number its parts, of one parameter, are sorted by size; 1 is no sorting.
    classes: int = 1
    #: Which instances get parts of one class, by the number of the class variate; all where empty.
    class_of: tuple[int, ...] = ()

    @property
    def variates(self) -> slice:
        """Columns of the uniform variates."""
        return slice(self.first_variate, self.class_variates.stop)

    @property
    def class_variates(self) -> slice:
        """Those of them that choose the classes, after all others."""
        first = self.first_variate + self._drawn + self._turns
        return slice(first, first + (max(self.alike) + 1 if self.classes > 1 else 0))

    @property
    def alike(self) -> tuple[int, ...]:
        """Group of each instance within which values are correlated."""
        return self.class_of or (0,) * self.instances

    @property
    def components(self) -> slice:
        """Rows of the influence."""
        return slice(self.first_component, self.first_component + self.instances * self.terms)

    @property
    def _vectors(self) -> int:
        """Vectors of one instance."""
        return self.terms // 2

    @property
    def _drawn(self) -> int:
        """Variates before any turning."""
        if self.joined:
            return self.instances * self.terms
        alone = self._vectors * self.distribution.variates if isinstance(self.distribution, Planar) else self.terms
        if self.correlation == 1:
            return alone
        return alone * (self.instances + (1 if self.correlation else 0))

    @property
    def _turns(self) -> int:
        """Variates that turn vectors; none where all phases are independent and uniform without."""
        free = self.distribution.vector and not self.correlation
        return self.instances * self._vectors if self.random_phase and not free else 0

    @cached_property
    def _normal_correlation(self) -> float:
        assert isinstance(self.distribution, Scalar)
        return normal_correlation(self.distribution, self.distribution, self.correlation)

    def standard(self, uniforms: Array) -> Array:
        """Standard draws, shape (units, instances * terms), from the rule's columns of the uniform variates.

        Of an entry by itself: of one that is `joined` the stack draws.
        """
        number = uniforms.shape[0]
        drawn = self._values(self._sorted(uniforms))
        if self._turns:
            angles = uniforms[:, self._drawn :].reshape(number, self.instances, self._vectors)
            vectors = np.broadcast_to(drawn, (number, self.instances, self.terms)).reshape(*angles.shape, 2)
            drawn = turned(vectors, angles)
        shape = (number, self.instances, self.terms)
        return np.broadcast_to(drawn.reshape(number, -1, self.terms), shape).reshape(number, -1)

    def _sorted(self, uniforms: Array) -> Array:
        """Variates of the values: those of parts of one class lie within one of its `classes` shares."""
        own = uniforms[:, : self._drawn]
        if self.classes == 1:
            return own
        chosen = np.minimum(np.floor(self.classes * uniforms[:, self._drawn :]), self.classes - 1)
        return np.asarray((chosen[:, self.alike] + own) / self.classes, dtype=np.float64)

    def _values(self, uniforms: Array) -> Array:
        """Values before turning, shape (units, instances or 1 for all, terms)."""
        number, law = uniforms.shape[0], self.distribution
        if isinstance(law, Planar):
            return law.pairs(uniforms.reshape(number, -1, self._vectors, law.variates)).reshape(number, -1, self.terms)
        assert isinstance(law, Scalar)
        if self.correlation in (0, 1):
            return law.quantile(uniforms).reshape(number, -1, self.terms)
        r = self._normal_correlation
        z = normal_quantile(uniforms).reshape(number, self.instances + 1, self.terms)
        return law.from_normal(math.sqrt(r) * z[:, :1] + math.sqrt(1 - r) * z[:, 1:])

    @cached_property
    def remaining_correlation(self) -> float:
        """Correlation of one component between two `alike` instances: none where each vector is turned by itself."""
        if self.classes > 1:
            assert isinstance(self.distribution, Scalar)
            return self.distribution.class_correlation(self.classes)
        return 0.0 if self.random_phase else self.correlation

    def worst_groups(self) -> tuple[WorstGroup, ...]:
        """Components that the worst case chooses together, in widths; correlation counts where it is exactly 1.

        Parts of one class: what they have in common, and what the widest class leaves to each.
        """
        rows = np.arange(self.components.start, self.components.stop, dtype=np.intp)
        if self.classes > 1:
            return self._worst_of_classes(rows)
        circles = self.distribution.vector or self.random_phase
        by_vector = rows.reshape(self.instances, -1, 2 if circles else 1)
        as_one = self.correlation == 1 and not self.random_phase
        groups = by_vector.swapaxes(0, 1) if as_one else by_vector.reshape(-1, 1, by_vector.shape[2])
        radius = 1.0 if self.distribution.vector or not circles else math.sqrt(2)  # a box turned about its corner
        return tuple(WorstGroup(group, radius) for group in groups)

    def _worst_of_classes(self, rows: Integers) -> tuple[WorstGroup, ...]:
        assert isinstance(self.distribution, Scalar)
        own = self.distribution.widest_class(self.classes)
        groups: list[WorstGroup] = []
        for place in dict.fromkeys(self.alike):
            members = rows[np.equal(self.alike, place)][:, None]
            alone = len(members) == 1
            groups.append(WorstGroup(members, 1.0 if alone else 1 - own))
            groups += [] if alone else [WorstGroup(member, own) for member in members[:, None]]
        return tuple(groups)


def listed(indices: Mapping[str, Any]) -> str:
    """Indices in brackets for people; nothing of none."""
    return f"({', '.join(f'{name}={value}' for name, value in indices.items())})" if indices else ""
