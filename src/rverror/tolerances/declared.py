"""Tolerances: how far the parameters of an error source may be from their declared values."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields
from itertools import product
from typing import Any, NoReturn

from rverror.base import units
from rverror.base.errors import InputError, refusing
from rverror.base.text import did_you_mean, shown
from rverror.geartrain.mechanism import Mechanism
from rverror.geartrain.source import VECTORS, Index, IndexValue, Parameter
from rverror.model.catalogue import source
from rverror.tolerances.cost import SAME_WIDTH, Choice, Cost, Grades
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
)
from rverror.tolerances.sampling_rule import listed

_NUMBER = r"(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_BOTH_WAYS = re.compile(rf"\s*(?:±|\+/?-)\s*({_NUMBER}.*)$")
#: A unit behind the first number alone holds no digit, so the slash of ``arcsec/turn`` is not taken for that of limits.
_TWO = re.compile(rf"\s*([-+]?{_NUMBER})\s*([^\d/+-]*)/\s*([-+]?{_NUMBER})\s*([^\d\s].*)?$")


def width_and_centre(value: Any, dimension: str) -> tuple[float, float | None]:
    """Width T of a tolerance, half of what its limits leave, and where their middle is.

    Parameters
    ----------
    value : float, str, quantity or sequence of two
        T itself; ``"±5 um"``, ``"+-5 um"``, ``"+/-5 um"``; ``"+0.02/-0.01 mm"``, the upper limit first or last; or the
        lower and the upper limit.
    dimension : str
        A key of `units.CORE_UNITS`.

    Returns
    -------
    width : float
        Core unit.
    centre : float or None
        Middle of two limits, core unit; None where the limits are alike to both sides.

    Raises
    ------
    ValueError
        If a number or unit cannot be read, or the limits leave nothing.

    Examples
    --------
    >>> width_and_centre("±5 um", "length")
    (0.005, None)
    >>> [round(size, 9) for size in width_and_centre("+0.02/-0.01 mm", "length")]
    [0.015, 0.005]
    """
    if isinstance(value, str):
        text = value.replace("\N{MINUS SIGN}", "-")
        if match := _BOTH_WAYS.match(text):
            return units.to_core(match[1], dimension), None
        if match := _TWO.match(text):
            unit = match[4] or ""
            texts = f"{match[1]} {match[2].strip() or unit}", f"{match[3]} {unit}"
            return _of(sorted(units.to_core(one.strip(), dimension) for one in texts), value)
        return units.to_core(text, dimension), None
    if isinstance(value, Sequence):
        if len(value) != 2:
            raise InputError(f"{value!r}: {len(value)} limits; give two, the lower one first")
        return _of([units.to_core(one, dimension) for one in value], value)
    return units.to_core(value, dimension), None


def _of(pair: Sequence[float], value: Any) -> tuple[float, float]:
    low, high = pair
    if not low < high:
        raise InputError(f"{value!r}: the limits leave nothing between them; give the lower one, then a larger one")
    return (high - low) / 2, (high + low) / 2


#: Most classes; at so many two parts of one class are the same size but for a thousandth.
MOST_CLASSES = 1000


@dataclass(frozen=True)
class SelectedFit:
    """Parts that are matched with those of another tolerance: a place of a unit gets both from one class.

    Attributes
    ----------
    other : str
        Name or key of the other tolerance; places are matched by the indices that both have.
    classes : int
        Classes of equal number into which the parts of either are sorted by size, 2 or more.
    opposite : bool
        Whether the largest go with the smallest.

    Raises
    ------
    InputError
        If there are too few or too many classes.
    """

    other: str
    classes: int
    opposite: bool = False

    def __post_init__(self) -> None:
        """Check the classes."""
        check_classes("fit", self.classes, least=2)


def fit_of(said: Any) -> SelectedFit:
    """Make a fit from ``{"with": "bores", "classes": 3, "opposite": True}``, as tolerance files have it.

    Raises
    ------
    InputError
        If it is neither that nor a `SelectedFit`.
    """
    if isinstance(said, SelectedFit):
        return said
    example = "write fit = { with = 'bores', classes = 3 }, and opposite = true where the largest go with the smallest"
    if not isinstance(said, Mapping) or not {"with", "classes"} <= said.keys() <= {"with", "classes", "opposite"}:
        raise InputError(f"fit = {shown(said)}: must say with and classes; {example}")
    other, opposite = said["with"], said.get("opposite", False)
    if not isinstance(other, str) or not isinstance(opposite, bool):
        raise InputError(f"fit = {shown(said)}: with is a name or a key, opposite true or false; {example}")
    return SelectedFit(other, said["classes"], opposite)


def check_classes(what: str, classes: int, *, least: int = 1) -> None:
    """Refuse what is no number of classes.

    Parameters
    ----------
    what : str
        What has them, for the message.
    classes : int
    least : int

    Raises
    ------
    InputError
    """
    whole = isinstance(classes, int) and not isinstance(classes, bool)
    if not whole or not least <= classes <= MOST_CLASSES:
        raise InputError(
            f"{what}: classes = {classes}: must be a whole number from {least} to {MOST_CLASSES}; beyond that give "
            "correlation = 1"
        )


Instances = IndexValue | tuple[IndexValue, ...]

#: Distributions by the name that tolerance files use; samples are given by their values.
DISTRIBUTIONS: Mapping[str, type[Distribution]] = {
    law.name: law for law in (Uniform, Triangular, Normal, TruncatedNormal, Lognormal, Rayleigh, Circle, Ring)
}

#: Names of parameters that are the two components of one vector, in the directions of its place too.
PAIRS = (("radial", "tangential"), *VECTORS)


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
            ("parameters: no parameter", self.parameters, "parameters", entry.parameters),
            ("no index", self.indices, "indices", entry.indices),
            ("mean of", self.mean, "parameters", self.chosen),
        ):
            known = [item.name for item in allowed]
            for name in given:
                if name not in known:
                    self._refuse(f"{problem} {name!r};{known_names(what, known, name)}")
        if not 0 < self.width < math.inf:
            self._refuse(f"tolerance = {self.width:g}: must be above 0; give half the allowed spread")
        if not 0 <= self.correlation <= 1:
            self._refuse(
                f"correlation = {self.correlation:g}: must be from 0 to 1; 1 is the same value in all instances"
            )
        for other, value in self.correlated_with.items():
            if not -1 <= value <= 1:
                self._refuse(f"correlated_with {other!r}: {value:g}: a correlation must be from -1 to 1")
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
    def choice(self) -> Choice:
        """What may be bought; grades without bounds may all be, but for clearances that would vanish."""
        low, high = self.span
        if self.bounds is None and isinstance(self.cost, Grades):
            room = high if high < 10 * self.width else math.inf
            low, high = self.cost.widths[0], min(max(self.cost.widths), room)
        return Choice(self.cost, (low, high), self.fixed)

    @property
    def label(self) -> str:
        """Its name, or its key with the indices and parameters where not all are meant."""
        if self.name:
            return self.name
        few = f".{','.join(p.name for p in self.chosen)}" if self.parameters else ""
        return f"{self.key}{listed(self.indices)}{few}"

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
        Of lognormal: standard deviation of the logarithm.
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
        with refusing(f"{key}: tolerance: "):
            size, centre = width_and_centre(width, dimension)
        chosen[0].doubt(f"{key}: tolerance", width, size)
        given = {"capability": capability, "shape": shape}
        law = _law(key, distribution, given, vectors=_in_vectors([p.name for p in chosen]))
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
        measured = tuple(units.named_core(f"{key}: samples", value, dimension) for value in samples)
        law = SampledAmplitude(measured) if phase else Samples(measured)
        size = law.width
        if isinstance(law, Samples):
            means = {p.name: law.mean for p in chosen}
    limits = None
    if bounds is not None:
        try:
            least, most = bounds
        except (TypeError, ValueError) as problem:
            raise InputError(
                f"{key}: bounds: give the least and the largest width, such as ('5 um', '20 um')"
            ) from problem
        named = f"{key}: bounds"
        limits = units.named_core(named, least, dimension), units.named_core(named, most, dimension)
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
        limits,
        cost,
        name,
        dict(correlated_with or {}),
        classes,
        None if fit is None else fit_of(fit),
    )


def _law(key: str, name: str | None, given: Mapping[str, float | None], *, vectors: bool) -> Distribution:
    """Distribution by name."""
    used = name or (Rayleigh.name if vectors else Normal.name)
    if used not in DISTRIBUTIONS:
        raise InputError(f"{key}: no distribution {used!r};{known_names('distributions', DISTRIBUTIONS, used)}")
    kind = DISTRIBUTIONS[used]
    values = {what: value for what, value in given.items() if value is not None}
    for what in values:
        if what not in {item.name for item in fields(kind)}:  # type: ignore[arg-type]
            raise InputError(f"{key}: {what} beside the distribution {used!r}, which has none; leave it out")
    if kind is Lognormal and "shape" not in values:
        raise InputError(f"{key}: lognormal needs a shape; add shape = 0.3, the standard deviation of the logarithm")
    return kind(**values)


def _means(key: str, chosen: Sequence[Parameter], mean: Any) -> dict[str, float]:
    if mean is None:
        return {}
    if isinstance(mean, Mapping):
        known = {p.name: p.dimension for p in chosen}
        for name in mean:
            if name not in known:
                raise InputError(f"{key}: mean of {name!r};{known_names('parameters', known, name)}")
        return {name: units.named_core(f"{key}: mean of {name}", value, known[name]) for name, value in mean.items()}
    if len(chosen) > 1:
        raise InputError(
            f"{key}: mean = {mean!r}: which parameter? give a table, like {{ {chosen[0].name} = {mean!r} }}"
        )
    return {chosen[0].name: units.named_core(f"{key}: mean", mean, chosen[0].dimension)}


def _in_vectors(names: Sequence[str]) -> bool:
    return all(pair in PAIRS for pair in zip(names[::2], names[1::2], strict=False)) and len(names) % 2 == 0


def known_names(what: str, known: Collection[str], word: str) -> str:
    """Said behind a name that is not known: the nearest one that is, and all of them."""
    return f"{did_you_mean(word, known)} the {what} are {', '.join(known)}" if known else " it has none"
