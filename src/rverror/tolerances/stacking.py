"""Tolerances of a model, and the stack of influences and draws that budget and allocation compute with.

A unit's output error over a revolution is TE(theta) = nominal(theta) + sum_c x_c W_c(theta), one term per toleranced
component c: one parameter of one instance of a source.  x_c = mean + T s_c with the width T of the component's
tolerance and a standard draw s_c of width 1, so all that follows is linear in the widths.  Page ``theory/budget.md``.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from itertools import product
from typing import Any, Literal, NoReturn, cast

import numpy as np
import numpy.typing as npt

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError, check_each, check_kind
from rverror.base.viewed import OneLine
from rverror.dynamics.at_speed import influences_at_speed
from rverror.geartrain.contacts import closed_form_forces, pose
from rverror.geartrain.mechanism import Mechanism, Reducer
from rverror.geartrain.source import Index, IndexValue, Parameter
from rverror.model.catalogue import source
from rverror.model.compose import source_matrix, transmission_error
from rverror.model.effects import Effect, Model, check_model
from rverror.model.readings import stand
from rverror.tolerances.cost import SAME_WIDTH, Cost
from rverror.tolerances.dependence import Dependence, dependence
from rverror.tolerances.distribution import (
    Circle,
    Distribution,
    Lognormal,
    Normal,
    Planar,
    Rayleigh,
    Ring,
    SampledAmplitude,
    Samples,
    Scalar,
    Triangular,
    TruncatedNormal,
    Uniform,
    normal_correlation,
    normal_quantile,
    turned,
)
from rverror.tolerances.limits import width_and_centre
from rverror.tolerances.selection import Matching, SelectedFit, Side, check_classes, fit_of, with_fit

Instances = IndexValue | tuple[IndexValue, ...]

#: Distributions by the name that tolerance files use; samples are given by their values.
DISTRIBUTIONS: Mapping[str, type[Distribution]] = {
    law.name: law for law in (Uniform, Triangular, Normal, TruncatedNormal, Lognormal, Rayleigh, Circle, Ring)
}

#: Angles of one revolution where none are given: the mesh orders of an RV-40E need them.
ANGLES = 4096

_ROUNDING = 1e-12  # relative
_SOLVED = 1e-9  # relative: the pose at a load and the motion about it are found to some 1e-10

#: Names of parameters that are the two components of one vector.
PAIRS = (
    ("x", "y"),
    ("radial", "tangential"),
    ("cos", "sin"),
    ("radial_cos", "radial_sin"),
    ("tangential_cos", "tangential_sin"),
)


@dataclass(frozen=True)
class Component:
    """One toleranced parameter of one instance of a source."""

    key: str  #: a key of the catalogue
    indices: Mapping[str, IndexValue]  #: which crank, disc, pin, harmonic
    parameter: str
    dimension: str  #: a key of `units.CORE_UNITS`

    def __str__(self) -> str:
        """Key, indices and parameter in one word: ``crank.eccentricity(crank=0, disc=1).radial``."""
        return f"{self.key}{_listed(self.indices)}.{self.parameter}"


@dataclass(frozen=True)
class WorstGroup:
    """Components whose values the worst case chooses together."""

    #: ``"box"``: one number, within +-`radius` widths.  ``"circle"``: a vector, no longer than `radius` widths.
    kind: Literal["box", "circle"]
    #: (instances, 1) or (instances, 2); instances that move as one, the columns are the components of the vector.
    components: npt.NDArray[np.intp]
    radius: float = 1.0  #: in widths of the tolerance


@dataclass(frozen=True)
class Block:
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
        if isinstance(self.distribution, Planar):
            alone = self._vectors * self.distribution.variates
            return alone if self.correlation else self.instances * alone
        if self.correlation == 1:
            return self.terms
        return self.terms * (self.instances + (1 if self.correlation else 0))

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
        """Standard draws, shape (units, instances * terms), from the block's columns of the uniform variates.

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

    def covariance(self) -> Array:
        """Covariance of the standard draws, shape (instances * terms, instances * terms).

        Random phases leave the variance of a component, for it is half the mean square length.
        """
        same = np.equal.outer(self.alike, self.alike)
        among = (1 - self.remaining_correlation) * np.eye(self.instances) + self.remaining_correlation * same
        return np.asarray(self.distribution.variance * np.kron(among, np.eye(self.terms)), dtype=np.float64)

    def worst_groups(self) -> tuple[WorstGroup, ...]:
        """Components that the worst case chooses together, in widths; correlation counts where it is exactly 1.

        Parts of one class: what they have in common, and what the widest class leaves to each.
        """
        rows = np.arange(self.components.start, self.components.stop, dtype=np.intp)
        circles = self.distribution.vector or self.random_phase
        by_vector = rows.reshape(self.instances, -1, 2 if circles else 1)
        as_one = self.correlation == 1 and not self.random_phase
        kept = [by_vector[:, v] for v in range(by_vector.shape[1])]
        if self.classes > 1:
            return self._worst_of_classes(rows)
        groups = kept if as_one else [vector[i : i + 1] for i in range(self.instances) for vector in kept]
        radius = 1.0 if self.distribution.vector or not circles else math.sqrt(2)  # a box turned about its corner
        return tuple(WorstGroup("circle" if circles else "box", group, radius) for group in groups)

    def _worst_of_classes(self, rows: npt.NDArray[np.intp]) -> tuple[WorstGroup, ...]:
        assert isinstance(self.distribution, Scalar)
        own = self.distribution.widest_class(self.classes)
        groups: list[WorstGroup] = []
        for place in dict.fromkeys(self.alike):
            members = rows[np.equal(self.alike, place)]
            if members.size == 1:
                groups.append(WorstGroup("box", members[:, None]))
                continue
            groups.append(WorstGroup("box", members[:, None], 1 - own))
            groups += [WorstGroup("box", members[i : i + 1, None], own) for i in range(members.size)]
        return tuple(groups)


@dataclass(frozen=True)
class Stack(OneLine):
    """A model and its tolerances as arrays.

    Attributes
    ----------
    nominal : ndarray, shape (n,)
        rad; output error of the declared model with all toleranced values at their means.
    influence : ndarray, shape (m, n)
        rad per core unit (mm, rad) of each component.
    components : tuple of Component, length m
    entry : ndarray of int, shape (m,)
        Tolerance to which each component belongs.
    width : ndarray, shape (entries,)
        Widths T as given, core units.
    labels : tuple of str
        Name of each entry.
    blocks : tuple of Block
        How each entry is drawn.
    theta : ndarray, shape (n,), optional
        Nominal output angle, rad.
    speed : float, optional
        Input speed, rad/s; None for the closed form at a crawl.
    dependence : Dependence, optional
        Correlation between entries; None where all are independent.
    model : str
        Name of the unit, for people.
    """

    nominal: Array
    influence: Array
    components: tuple[Component, ...]
    entry: npt.NDArray[np.intp]
    width: Array
    labels: tuple[str, ...]
    blocks: tuple[Block, ...]
    theta: Array | None = field(default=None)
    speed: float | None = field(default=None)
    dependence: Dependence | None = field(default=None)
    model: str = ""

    def scaled(self, width: Array | None = None) -> Array:
        """Influence of the standard draws, rad, shape (m, n): `influence` times the width of each component.

        Widths, one for each entry, are in core units; those as given where left out.
        """
        used = self.width if width is None else np.asarray(width, dtype=np.float64)
        return self.influence * used[self.entry][:, None]

    @property
    def dimensions(self) -> int:
        """Uniform variates that one unit takes."""
        return self.blocks[-1].variates.stop if self.blocks else 0

    @property
    def variate_entry(self) -> npt.NDArray[np.intp]:
        """Entry to which each variate belongs, shape (dimensions,)."""
        counts = [block.variates.stop - block.variates.start for block in self.blocks]
        return np.repeat(np.arange(len(self.blocks), dtype=np.intp), counts)

    def standard(self, uniforms: Array) -> Array:
        """Standard draws s, shape (units, m), width 1 and mean 0, from variates in 0..1, shape (units, dimensions)."""
        drawn = np.empty((uniforms.shape[0], self.influence.shape[0]))
        if self.dependence is not None:
            uniforms = self.dependence.matched(uniforms)
        for block in self.blocks:
            if not block.joined:
                drawn[:, block.components] = block.standard(uniforms[:, block.variates])
        together = [block for block in self.blocks if block.joined]
        if self.dependence is not None and together:
            normal = normal_quantile(np.concatenate([uniforms[:, block.variates] for block in together], axis=1))
            normal = normal @ self.dependence.factor.T
            for block in together:
                assert isinstance(block.distribution, Scalar)
                count = block.instances * block.terms
                drawn[:, block.components] = block.distribution.from_normal(normal[:, :count])
                normal = normal[:, count:]
        return drawn

    @property
    def covariance(self) -> Array:
        """Covariance of the standard draws, shape (m, m)."""
        matrix = np.zeros((self.influence.shape[0],) * 2)
        for block in self.blocks:
            matrix[block.components, block.components] = block.covariance()
        if self.dependence is not None:
            matrix[np.ix_(self.dependence.components, self.dependence.components)] += self.dependence.between
        return matrix

    @property
    def middle(self) -> Array:
        """Middle of the limits of each standard draw, whose mean is 0, shape (m,)."""
        counts = [block.instances * block.terms for block in self.blocks]
        return np.repeat([block.distribution.middle for block in self.blocks], counts)

    def at_middle(self, width: Array | None = None) -> Array:
        """Output error with all toleranced values in the middle of their limits, rad, shape (n,)."""
        middle = self.middle
        return self.nominal + middle @ self.scaled(width) if middle.any() else self.nominal

    @property
    def worst_groups(self) -> tuple[WorstGroup, ...]:
        """Components that the worst case chooses together."""
        return tuple(group for block in self.blocks for group in block.worst_groups())


@dataclass(frozen=True)
class Tolerance:
    """How far one source's parameters may be from their declared values, in all instances or some.

    `tolerance` makes one from texts with units.

    Attributes
    ----------
    key : str
        A key of the catalogue.
    width : float
        T, core unit, above 0.
    distribution : Scalar or Planar
    indices : mapping of str to int, str or tuple
        Which instances; of an index that is left out, all.
    parameters : tuple of str
        Which parameters; all where empty.
    mean : mapping of str to float
        Shift of the centre by parameter, core unit; 0 where left out.
    correlation : float
        Pearson correlation of the values of one parameter between any two instances, 0 to 1.
    random_phase : bool
        Whether each vector is turned by an angle of its own at assembly.
    fixed : bool
        Whether allocation leaves it.
    bounds : tuple of float, optional
        Least and largest width for allocation; `span` where left out.
    cost : Reciprocal or ReciprocalSquare or Grades, optional
    name : str
        What people call it; key, indices and parameters where empty.
    correlated_with : mapping of str to float
        Correlation of its values with those of other tolerances, by their name or key, -1 to 1: of instances whose
        common indices are alike, and of parameters in their order.  Said at one of the two.
    classes : int
        Parts are sorted by size into so many classes of equal number, and a unit takes all of them from one class.
    fit : SelectedFit, optional
        Parts are matched by classes with those of another tolerance.  Said at one of the two.

    Raises
    ------
    InputError
        If the values do not go together; the message says which.
    """

    key: str
    width: float
    distribution: Distribution
    indices: Mapping[str, Instances] = field(default_factory=dict)
    parameters: tuple[str, ...] = ()
    mean: Mapping[str, float] = field(default_factory=dict)
    correlation: float = 0.0
    random_phase: bool = False
    fixed: bool = False
    bounds: tuple[float, float] | None = None
    cost: Cost | None = None
    name: str = ""
    correlated_with: Mapping[str, float] = field(default_factory=dict)
    classes: int = 1
    fit: SelectedFit | None = None

    def __post_init__(self) -> None:
        """Check that the values go together."""
        entry = source(self.key)
        if entry.acts == "marks":
            self._refuse("it turns the waveforms of others and adds none of its own; leave it out")
        for problem, given, what, allowed in (
            ("no parameter", self.parameters, "parameters", entry.parameters),
            ("no index", self.indices, "indices", entry.indices),
            ("mean of", self.mean, "parameters", self.chosen),
        ):
            known = [item.name for item in allowed]
            for name in given:
                if name not in known:
                    self._refuse(f"{problem} {name!r};{_names(what, known, name)}")
        if not 0 < self.width < math.inf:
            self._refuse(f"tolerance = {self.width:g}: must be above 0; give half the allowed spread")
        if not 0 <= self.correlation <= 1:
            self._refuse(
                f"correlation = {self.correlation:g}: must be from 0 to 1; 1 is the same value in all instances"
            )
        for other, value in self.correlated_with.items():
            if not -1 <= value <= 1:
                self._refuse(f"correlated_with {other!r}: {value:g}: a correlation must be from -1 to 1")
        if self.correlated_with and (self.random_phase or not isinstance(self.distribution, Scalar)):
            self._refuse(
                "correlated_with beside vectors of random phase, whose components have no correlation; leave it out, "
                "or use 'rayleigh' or 'normal' without phase"
            )
        self._check_vectors()
        self._check_bounds()
        if self.fit is not None and self.classes != 1:
            self._refuse("classes beside fit, which says them itself; leave it out")
        check_classes(self.key, self.classes)
        if self.classes > 1 or self.fit is not None:
            self.check_sorted("fit" if self.fit else "classes")

    def check_sorted(self, what: str) -> None:
        """Refuse what cannot be sorted by size.

        Parameters
        ----------
        what : str
            Key that asks for it.

        Raises
        ------
        InputError
        """
        if len(self.chosen) > 1 or not isinstance(self.distribution, Scalar):
            self._refuse(
                f"{what}: parts are sorted by one number, and {', '.join(p.name for p in self.chosen)} with the "
                f"distribution {self.distribution.name!r} is none; add parameters = [{self.chosen[0].name!r}]"
            )
        if self.correlation or self.random_phase or self.correlated_with:
            self._refuse(f"{what}: parts are sorted one by one; leave correlation, correlated_with and phase out")

    def _check_vectors(self) -> None:
        law = self.distribution
        if not self.in_vectors:
            names = ", ".join(p.name for p in self.chosen)
            if law.vector:
                self._refuse(
                    f"distribution = {law.name!r} is for vectors, and {names} is none; use 'normal' or 'uniform', or "
                    "all parameters"
                )
            if self.random_phase:
                self._refuse(f"phase = 'random' turns vectors, and {names} is none; leave phase out")
        if self.random_phase and any(self.mean.values()):
            self._refuse("a mean that is turned at random is no mean; leave mean out, or use the distribution 'ring'")
        if isinstance(law, Planar) and self.correlation not in (0, 1):
            self._refuse(
                f"correlation = {self.correlation:g}: the distribution {law.name!r} takes 0 or 1; use 'rayleigh' for "
                "what lies between"
            )

    def _check_bounds(self) -> None:
        """Clearances and the like have a least value."""
        law = self.distribution
        for item in self.chosen:
            unit = units.DISPLAY_UNITS[item.dimension]
            lowest = min(law.values) - law.mean if isinstance(law, Samples) else self.width * (law.middle - 1)
            low = self.mean.get(item.name, 0.0) + lowest
            if low < item.least - SAME_WIDTH * self.width:
                self._refuse(
                    f"{item.name} would come down to {units.to_display(low, item.dimension):g} {unit}, below "
                    f"{item.least:g}; give a mean of {units.to_display(item.least - lowest, item.dimension):g} {unit} "
                    "or more"
                )
        if self.bounds is not None:
            low, high = self.bounds
            if not 0 < low <= high < math.inf:
                self._refuse(f"bounds = {low:g}, {high:g}: must be above 0, the smaller first")
            if high > self._room * (1 + SAME_WIDTH):
                unit = units.DISPLAY_UNITS[self.chosen[0].dimension]
                size = units.to_display(self._room, self.chosen[0].dimension)
                self._refuse(f"bounds: the larger would let a clearance vanish; give {size:g} {unit} or less")

    def _refuse(self, message: str) -> NoReturn:
        raise InputError(f"{self.key}: {message}")

    @property
    def _room(self) -> float:
        """Largest width that keeps every parameter at its least value or above."""
        if isinstance(self.distribution, Samples):
            return math.inf  # what was measured is there
        below = 1 - self.distribution.middle  # of the mean to the lower limit, in widths
        return min(self.mean.get(item.name, 0.0) - item.least for item in self.chosen) / below

    @property
    def chosen(self) -> tuple[Parameter, ...]:
        """The source's parameters that are toleranced, in the order of the catalogue."""
        return tuple(p for p in source(self.key).parameters if not self.parameters or p.name in self.parameters)

    @property
    def in_vectors(self) -> bool:
        """Whether the toleranced parameters are the components of vectors, two and two."""
        return _in_vectors([p.name for p in self.chosen])

    @property
    def span(self) -> tuple[float, float]:
        """Least and largest width for allocation: `bounds`, else a tenth to ten times the width.

        What is wider than a workshop's parts are, nobody asked for.
        """
        plausible = max(self.width, min(item.plausible for item in self.chosen))
        return self.bounds or (self.width / 10, min(10 * self.width, self._room, plausible))

    @property
    def label(self) -> str:
        """Its name, or its key with the indices and parameters where not all are meant."""
        if self.name:
            return self.name
        few = f".{','.join(p.name for p in self.chosen)}" if self.parameters else ""
        return f"{self.key}{_listed(self.indices)}{few}"

    def instances(self, mechanism: Mechanism) -> tuple[dict[str, IndexValue], ...]:
        """Index sets that the tolerance covers in a mechanism; each must be one of the mechanism's."""
        entry = source(self.key)
        entry.check_mechanism(mechanism)
        values = [self._index_values(index, mechanism) for index in entry.indices]
        names = [index.name for index in entry.indices]
        sets = tuple(dict(zip(names, chosen, strict=True)) for chosen in product(*values))
        for indices in sets:
            entry.check_indices(mechanism, indices)
        return sets

    def usual(self, mechanism: Mechanism) -> list[tuple[dict[str, IndexValue], dict[str, float]]]:
        """Root mean square of each parameter about its declared value, the mean included, of each part; core units.

        Where all parts have an index together, what they share: of that the variance is the mean's.
        """
        parts, indices = self.instances(mechanism), source(self.key).indices
        shares = [(at, 1.0) for at in parts]
        allowed = indices[0].allowed(mechanism) if len(indices) == 1 else ()
        if "all" in allowed and len(parts) == len(allowed) - 1:
            shares.append(({indices[0].name: "all"}, self.correlation + (1 - self.correlation) / len(parts)))
        means, variance = {p.name: self.mean.get(p.name, 0.0) for p in self.chosen}, self.distribution.variance
        roots = [(at, self.width * math.sqrt(share * variance)) for at, share in shares]
        return [(at, {name: math.hypot(root, mean) for name, mean in means.items()}) for at, root in roots]

    def _index_values(self, index: Index, mechanism: Mechanism) -> tuple[IndexValue, ...]:
        given = self.indices.get(index.name)
        if given is not None:
            return given if isinstance(given, tuple) else (given,)
        if index.name == "harmonic":
            self._refuse("no harmonic; give which ones among the indices, like harmonic = 1 or harmonic = [1, 2]")
        return tuple(value for value in index.allowed(mechanism) if value != "all")  # "all" is each with correlation 1


def tolerance(
    key: str,
    width: Any = None,
    *,
    distribution: str | None = None,
    capability: float | None = None,
    shape: float | None = None,
    samples: Sequence[Any] | None = None,
    mean: Any = None,
    correlation: float = 0.0,
    phase: str | None = None,
    parameters: Sequence[str] = (),
    fixed: bool = False,
    bounds: tuple[Any, Any] | None = None,
    cost: Cost | None = None,
    name: str = "",
    correlated_with: Mapping[str, float] | None = None,
    classes: int = 1,
    fit: SelectedFit | Mapping[str, Any] | None = None,
    **indices: IndexValue | Sequence[IndexValue],
) -> Tolerance:
    """Make a tolerance from texts with units, quantities or plain numbers in core units.

    Parameters
    ----------
    key : str
        A key of the catalogue.
    width : float or str or quantity or pair of these
        T: half the allowed spread of a scalar, the longest allowed vector.  Also ``"±5 um"``; ``"+0.02/-0.01 mm"``, or
        the lower and the upper limit, of one parameter that is no vector.  Left out with `samples`.
    distribution : str, optional
        A key of `DISTRIBUTIONS`.  Left out: rayleigh where all parameters are vectors, else normal.
    capability : float, optional
        Process capability Cp of normal, truncated_normal, lognormal and rayleigh; 1 where left out.
    shape : float, optional
        Of lognormal: standard deviation of the logarithm.  Left out beside a lower limit above 0: the value itself is
        lognormal, without a shift.
    samples : sequence of float, str or quantity, optional
        Measured values, in place of width and distribution; of vectors with `phase` measured lengths.
    mean : float or str or quantity, or a mapping of these by parameter, optional
        Shift of the centre; two limits say it themselves.
    correlation : float, optional
        As in `Tolerance`.
    phase : str, optional
        ``"random"``: each vector is turned by an angle of its own at assembly.
    parameters, fixed, bounds, cost, name, correlated_with, classes, fit, **indices
        As in `Tolerance`; an index may have several values, and a fit may be a mapping, such as
        ``{"with": "cams", "classes": 3, "opposite": True}``.

    Returns
    -------
    Tolerance

    Raises
    ------
    ValueError
        If the key is unknown, a value has the wrong unit, or the values do not go together.

    Warns
    -----
    UserWarning
        If a plain width is far beyond what a workshop makes: 5 is 5 mm, not 5 um.

    Examples
    --------
    >>> cams = tolerance("crank.eccentricity", "5 um", disc=0)
    >>> cams.distribution, cams.label
    (Rayleigh(capability=1.0), 'crank.eccentricity(disc=0)')
    """
    entry = source(key)
    # an unknown parameter is refused by Tolerance
    chosen = [p for p in entry.parameters if p.name in parameters] or list(entry.parameters)
    dimension = chosen[0].dimension
    if phase not in (None, "random"):
        raise InputError(f"{key}: phase = {phase!r}: must be 'random' or left out")
    means = _means(key, chosen, mean)
    law: Distribution
    if samples is None:
        if width is None:
            raise InputError(f"{key}: no tolerance; give a width like '5 {units.DISPLAY_UNITS[dimension]}', or samples")
        size, centre = _size(key, width, dimension)
        chosen[0].doubt(f"{key}: tolerance", width, size)
        least = None if centre is None else centre - size
        given = {"capability": capability, "shape": shape}
        law = _law(key, distribution, given, size, least, vectors=_in_vectors([p.name for p in chosen]))
        if centre is not None:
            if mean is not None:
                raise InputError(f"{key}: mean beside two limits, which say it themselves; leave it out")
            if law.vector or len(chosen) > 1:
                raise InputError(
                    f"{key}: two limits are of one number, and {', '.join(p.name for p in chosen)} are "
                    f"{len(chosen)}; add parameters = [{chosen[0].name!r}], or give the longest allowed vector"
                )
            means = {chosen[0].name: centre - size * law.middle}
    else:
        said = {"tolerance": width, "distribution": distribution, "capability": capability, "shape": shape}
        beside = [name for name, value in {**said, "mean": mean}.items() if value is not None]
        if beside:
            raise InputError(f"{key}: {beside[0]} beside samples; samples say it themselves, leave it out")
        measured = tuple(_core(f"{key}: samples", value, dimension) for value in samples)
        law = SampledAmplitude(measured) if phase else Samples(measured)
        size = law.width
        if isinstance(law, Samples):
            means = {p.name: law.mean for p in chosen}
    limits = None if bounds is None else tuple(_core(f"{key}: bounds", value, dimension) for value in bounds)
    return Tolerance(
        key,
        size,
        law,
        {name: tuple(v) if isinstance(v, Sequence) and not isinstance(v, str) else v for name, v in indices.items()},
        tuple(parameters),
        means,
        correlation,
        phase == "random",
        fixed,
        None if limits is None else (limits[0], limits[1]),
        cost,
        name,
        dict(correlated_with or {}),
        classes,
        None if fit is None else fit_of(fit),
    )


def _size(key: str, width: Any, dimension: str) -> tuple[float, float | None]:
    try:
        return width_and_centre(width, dimension)
    except ValueError as error:
        raise InputError(f"{key}: tolerance: {error}") from error


def _law(
    key: str, name: str | None, given: Mapping[str, float | None], width: float, least: float | None, *, vectors: bool
) -> Distribution:
    """Distribution by name; `least` is the lower one of two limits."""
    used = name or (Rayleigh.name if vectors else Normal.name)
    if used not in DISTRIBUTIONS:
        raise InputError(f"{key}: no distribution {used!r};{_names('distributions', list(DISTRIBUTIONS), used)}")
    kind = DISTRIBUTIONS[used]
    values = {what: value for what, value in given.items() if value is not None}
    for what in values:
        if what not in {item.name for item in fields(kind)}:  # type: ignore[arg-type]
            raise InputError(f"{key}: {what} beside the distribution {used!r}, which has none; leave it out")
    if kind is Lognormal and "shape" not in values:
        values["shape"] = _own_shape(key, width, least, values.get("capability", 1.0))
    return kind(**values)


def _own_shape(key: str, width: float, least: float | None, capability: float) -> float:
    """Shape of a lognormal value without a shift: quantiles of -3 and +3 sigma in the ratio exp(6 shape)."""
    lower = None if least is None else least + width * (1 - 1 / capability)
    if lower is None or lower <= 0:
        raise InputError(
            f"{key}: lognormal without a shape needs a lower limit above 0; add shape = 0.3, the standard deviation of "
            "the logarithm"
        )
    return math.log1p(2 * width / capability / lower) / 6


def _means(key: str, chosen: Sequence[Parameter], mean: Any) -> dict[str, float]:
    if mean is None:
        return {}
    if isinstance(mean, Mapping):
        known = {p.name: p.dimension for p in chosen}
        for name in mean:
            if name not in known:
                raise InputError(f"{key}: mean of {name!r};{_names('parameters', list(known), name)}")
        return {name: _core(f"{key}: mean of {name}", value, known[name]) for name, value in mean.items()}
    if len(chosen) > 1:
        raise InputError(
            f"{key}: mean = {mean!r}: which parameter? give a table, like {{ {chosen[0].name} = {mean!r} }}"
        )
    return {chosen[0].name: _core(f"{key}: mean", mean, chosen[0].dimension)}


def stack(
    model: Model,
    tolerances: Sequence[Tolerance],
    theta: Any = None,
    *,
    direction: float = 1.0,
    torque: Any = None,
    speed: Any = None,
) -> Stack:
    """Lay a model and its tolerances out as arrays.

    Parameters
    ----------
    model : Model
    tolerances : sequence of Tolerance
    theta : array_like or quantity, shape (n,), optional
        Nominal output angle, rad; `ANGLES` over one revolution where left out.
    direction : float, optional
        +1 forward, -1 reverse.
    torque : float or quantity, optional
        Needed by ``load.torsion``; at a speed the load, the rated one where left out.
    speed : float or quantity, optional
        Of the input, rad/s: influences are then those of the loaded reducer in motion, over the angles of one period.

    Returns
    -------
    Stack

    Raises
    ------
    ValueError
        If there is no tolerance, one does not fit the mechanism, or the angles are unusable.
    InputError
        If there are angles beside a speed, or as `influences_at_speed`.

    Examples
    --------
    >>> import rverror
    >>> unit = rverror.Model(rverror.reducer("RV-40E"))
    >>> cams = stack(unit, [tolerance("crank.eccentricity", "5 um")])
    >>> cams.influence.shape, cams.dimensions, str(cams.components[0])
    ((8, 4096), 8, 'crank.eccentricity(crank=0, disc=0).radial')
    """
    check_model(model)
    check_tolerances(tolerances)
    if not tolerances:
        raise InputError("no tolerance; give at least one")
    if speed is None:
        theta = 2 * np.pi * np.arange(ANGLES) / ANGLES if theta is None else theta
        where = stand(model, pose(model.mechanism, theta, direction=direction, torque=torque))
        forces = closed_form_forces(where.gears)
        load = None if where.read.torque is None else units.InCore(where.read.torque)
        nominal = transmission_error(model, where.read.theta, direction=direction, torque=load, forces=forces)
        angles, rounding = where.read.theta, _ROUNDING
        sources = (
            source_matrix(where.of(item.key), forces, item.key, indices)
            for item in tolerances
            for indices in item.instances(model.mechanism)
        )
    else:
        if theta is not None:
            raise InputError("theta: at a speed the angles are those of one period; leave them out")
        every = [
            Effect(item.key, indices, (0.0,) * len(source(item.key).parameters))
            for item in tolerances
            for indices in item.instances(model.mechanism)
        ]
        moving = influences_at_speed(model, speed, every, torque=torque, direction=direction)
        angles, nominal, speed, rounding = moving.theta, moving.transmission_error, moving.speed, _SOLVED
        sources = (matrix for matrix in moving.matrices)
    pairs, fitted = correlations(tolerances), fits(tolerances)
    classes = {e: fit for pair, fit in fitted.items() for e in pair}
    joined = {e for pair in pairs for e in pair}
    components: list[Component] = []
    blocks: list[Block] = []
    rows: list[Array] = []
    means: list[float] = []
    for e, item in enumerate(tolerances):
        entry = source(item.key)
        chosen = [i for i, p in enumerate(entry.parameters) if p in item.chosen]
        instances = item.instances(model.mechanism)
        first = blocks[-1].variates.stop if blocks else 0
        law = item.distribution, item.correlation, item.random_phase
        sorted_ = (classes[e].classes, _places(instances, classes[e].by)) if e in classes else (item.classes,)
        blocks.append(Block(first, len(components), len(instances), len(chosen), *law, e in joined, *sorted_))
        for indices in instances:
            least = _least(model.mechanism, item.chosen, rounding)
            rows.append(_without_rounding(next(sources)[chosen], least, rounding))
            components += [Component(item.key, indices, p.name, p.dimension) for p in item.chosen]
            means += [item.mean.get(p.name, 0.0) for p in item.chosen]
    influence = np.concatenate(rows)
    counts = [block.instances * block.terms for block in blocks]
    return Stack(
        nominal=nominal + np.array(means) @ influence,
        influence=influence,
        components=tuple(components),
        entry=np.repeat(np.arange(len(blocks), dtype=np.intp), counts),
        width=np.array([item.width for item in tolerances]),
        labels=_distinct([item.label for item in tolerances]),
        blocks=tuple(blocks),
        theta=angles,
        speed=speed,
        dependence=_with_fits(
            _dependence(pairs, tolerances, blocks, components) if pairs else None, fitted, blocks, components
        ),
        model=model.name or model.mechanism.name or "the model",
    )


def laid_out(
    model: Model | Stack | None,
    tolerances: Any,
    theta: Any,
    laid: Stack | None,
    *,
    direction: float,
    torque: Any,
    speed: Any,
) -> Stack:
    """Stack of a model and its tolerances, or the one that was given in their place.

    Raises
    ------
    InputError
        If both are given, or neither.
    """
    if model is None and laid is None:
        raise InputError("no model; give a model and its tolerances, or their stack")
    if laid is None and not isinstance(model, (Stack, type(None))):
        return stack(model, tolerances, theta, direction=direction, torque=torque, speed=speed)
    given = model if laid is None else laid
    check_kind("stack", given, Stack, "make it with stack(model, tolerances)")
    beside = {"theta": theta, "torque": torque, "speed": speed, "direction": None if direction == 1.0 else direction}
    if laid is not None and model is not None:
        beside["model"] = model
    for name, value in beside.items():
        if value is not None:
            raise InputError(f"{name} beside a stack, which says it itself; leave it out, or give model and tolerances")
    return cast("Stack", given)


def check_tolerances(tolerances: object) -> None:
    """Refuse what is no row of tolerances.

    Raises
    ------
    InputError
    """
    remedy = "give load_tolerances(path), or a list such as [tolerance('crank.eccentricity', '5 um')]"
    check_each("tolerances", tolerances, Tolerance, remedy)


def correlations(tolerances: Sequence[Tolerance]) -> dict[tuple[int, int], float]:
    """Correlations between tolerances by their numbers, the smaller first; 0 is left out.

    Parameters
    ----------
    tolerances : sequence of Tolerance

    Raises
    ------
    InputError
        If one names no other tolerance or several, or two say different things of one pair.

    Examples
    --------
    >>> cams = tolerance("crank.eccentricity", "5 um", name="cams")
    >>> correlations([cams, tolerance("cycloid.disc_bore_position", "5 um", correlated_with={"cams": 0.5})])
    {(0, 1): 0.5}
    """
    pairs: dict[tuple[int, int], float] = {}
    for e, item in enumerate(tolerances):
        for name, value in item.correlated_with.items():
            other = _other(tolerances, e, "correlated_with", name)
            pair = (min(e, other), max(e, other))
            if pairs.setdefault(pair, value) != value:
                raise InputError(
                    f"{item.label}: correlated_with {name!r} is {value:g} here and {pairs[pair]:g} there; say it once"
                )
    return {pair: value for pair, value in pairs.items() if value}


def fits(tolerances: Sequence[Tolerance]) -> dict[tuple[int, int], Matching]:
    """Tolerances whose parts are matched by classes, by their numbers, the one that says it first.

    Parameters
    ----------
    tolerances : sequence of Tolerance

    Raises
    ------
    InputError
        If one names no other tolerance or several, the other's parts cannot be sorted, or one is matched twice.

    Examples
    --------
    >>> cams = tolerance("crank.eccentricity", "5 um", name="cams", parameters=["radial"])
    >>> fit = {"with": "cams", "classes": 3}
    >>> fits([cams, tolerance("cycloid.disc_bore_position", "5 um", parameters=["radial"], fit=fit)])
    {(1, 0): Matching(classes=3, opposite=False, by=('disc', 'crank'))}
    """
    found: dict[tuple[int, int], Matching] = {}
    for e, item in enumerate(tolerances):
        if item.fit is None:
            continue
        other = _other(tolerances, e, "fit", item.fit.other)
        tolerances[other].check_sorted(f"fit of {item.label}")
        if tolerances[other].classes > 1 or any(n in (e, other) for pair in found for n in pair):
            raise InputError(
                f"{item.label}: fit with {item.fit.other!r}: one of them is sorted or matched already; parts are "
                "matched in pairs, say it once"
            )
        own, theirs = ([i.name for i in source(tolerances[n].key).indices] for n in (e, other))
        by = tuple(name for name in own if name in theirs)
        found[e, other] = Matching(item.fit.classes, item.fit.opposite, by)
    return found


def _other(tolerances: Sequence[Tolerance], e: int, what: str, name: str) -> int:
    """Number of the other tolerance of a name or key."""
    item = tolerances[e]
    found = [f for f, other in enumerate(tolerances) if f != e and name in (other.label, other.key)]
    if len(found) != 1:
        others = [other.label for other in tolerances if other is not item]
        known = _names("tolerances", others, name) if others else " add it"
        said = "no other tolerance" if not found else f"{len(found)} tolerances"
        raise InputError(
            f"{item.label}: {what} {name!r}: {said} of this name;"
            + (" give each a name of its own" if found else known)
        )
    return found[0]


def _places(instances: Sequence[Mapping[str, IndexValue]], by: Sequence[str]) -> tuple[int, ...]:
    """Number of the class of each instance: instances whose indices of these names are alike share one."""
    places = [tuple(indices[name] for name in by) for indices in instances]
    order = list(dict.fromkeys(places))
    return tuple(order.index(place) for place in places)


def _with_fits(
    correlated: Dependence | None,
    fitted: Mapping[tuple[int, int], Matching],
    blocks: Sequence[Block],
    components: Sequence[Component],
) -> Dependence | None:
    """Dependence with what matching by classes adds."""
    for (e, f), matching in fitted.items():
        laws = cast("tuple[Scalar, Scalar]", (blocks[e].distribution, blocks[f].distribution))
        sides = []
        for block in (blocks[e], blocks[f]):
            rows = range(block.components.start, block.components.stop)
            places = [tuple(components[row].indices[name] for name in matching.by) for row in rows]
            columns = [block.class_variates.start + number for number in block.alike]
            sides.append(Side(tuple(rows), tuple(places), tuple(columns)))
        correlated = with_fit(correlated, laws, matching, sides[0], sides[1])
    return correlated


def _dependence(
    pairs: Mapping[tuple[int, int], float],
    tolerances: Sequence[Tolerance],
    blocks: Sequence[Block],
    components: Sequence[Component],
) -> Dependence:
    """Correlation of all components of the tolerances that are drawn together."""
    laws: dict[int, Scalar] = {}
    for e in sorted({e for pair in pairs for e in pair}):
        item, law = tolerances[e], tolerances[e].distribution
        if item.random_phase or not isinstance(law, Scalar):
            raise InputError(
                f"{item.label}: is correlated with another tolerance, and its vectors have a random phase; use "
                "'rayleigh' or 'normal' without phase"
            )
        if blocks[e].classes > 1:
            raise InputError(
                f"{item.label}: is correlated with another tolerance, and its parts are sorted into classes, one by "
                "one; leave one of them out"
            )
        laws[e] = law
    alike: dict[tuple[int, int], list[tuple[int, int]]] = {}
    for e, f in pairs:
        if blocks[e].terms != blocks[f].terms:
            raise InputError(
                f"{tolerances[e].label} and {tolerances[f].label}: correlated, with {blocks[e].terms} and "
                f"{blocks[f].terms} parameters; give both as many by parameters = [...]"
            )
        terms = blocks[e].terms
        alike[e, f] = [
            (i, j)
            for i in range(blocks[e].components.start, blocks[e].components.stop)
            for j in range(blocks[f].components.start, blocks[f].components.stop)
            if (i - blocks[e].first_component) % terms == (j - blocks[f].first_component) % terms
            and _together(components[i].indices, components[j].indices)
        ]
    inside = {e: (blocks[e].components, blocks[e].correlation, blocks[e].terms) for e in laws}
    return dependence(laws, inside, pairs, alike, [item.label for item in tolerances])


def _together(one: Mapping[str, IndexValue], other: Mapping[str, IndexValue]) -> bool:
    """Whether the indices that two instances have in common are alike."""
    return all(one[name] == other[name] for name in one.keys() & other.keys())


def _least(mechanism: Mechanism, chosen: Sequence[Parameter], rounding: float) -> float:
    """Influence that is rounding, rad per core unit."""
    if isinstance(mechanism, Reducer) and chosen[0].dimension == "length":
        return rounding / mechanism.crank_radius
    return rounding


def _without_rounding(rows: Array, least: float, rounding: float) -> Array:
    """Rows of which only rounding is left, or of which only rounding is no constant, made exactly so."""
    size = np.abs(rows).max(axis=1, keepdims=True)
    steady = np.ptp(rows, axis=1, keepdims=True) <= rounding * size + least
    return np.where(size <= least, 0.0, np.where(steady, rows.mean(axis=1, keepdims=True), rows))


def _distinct(labels: Sequence[str]) -> tuple[str, ...]:
    """Number labels that come more than once."""
    return tuple(f"{t} #{labels[: i + 1].count(t)}" if labels.count(t) > 1 else t for i, t in enumerate(labels))


def _in_vectors(names: Sequence[str]) -> bool:
    return all(pair in PAIRS for pair in zip(names[::2], names[1::2], strict=False)) and len(names) % 2 == 0


def _core(what: str, value: Any, dimension: str) -> float:
    try:
        return units.to_core(value, dimension)
    except ValueError as error:
        raise InputError(f"{what}: {error}") from error


def _names(what: str, known: Sequence[str], word: str) -> str:
    close = difflib.get_close_matches(word.lower(), known, n=1, cutoff=0.6)
    hint = f" did you mean {close[0]!r}?" if close else ""
    return f"{hint} the {what} are {', '.join(known)}" if known else " it has none"


def _listed(indices: Mapping[str, Any]) -> str:
    return f"({', '.join(f'{name}={value}' for name, value in indices.items())})" if indices else ""
