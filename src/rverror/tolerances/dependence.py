"""What ties different tolerances: correlation, and parts matched by classes.  Page ``theory/budget.md``."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from rverror.base.arrays import Array, Flags
from rverror.base.errors import InputError, refusing
from rverror.base.text import did_you_mean
from rverror.geartrain.source import IndexValue
from rverror.tolerances.declared import SelectedFit, Tolerance
from rverror.tolerances.distribution import Scalar, normal_correlation
from rverror.tolerances.sampling_rule import Component, SamplingRule

_ROUNDING = 1e-8  # of an eigenvalue of a correlation matrix: its entries are found to 1e-10
_TAKES_PART = 1e-6  # of the square of a direction


@dataclass(frozen=True)
class Dependence:
    """How components of several entries are drawn together.

    Correlated ones: normal variables ``factor @ z``, then their quantiles.  Those matched by classes: the variates that
    choose the classes of the one are those of the other.
    """

    #: Square, for the components of correlated entries; its product with its transpose is the correlation of the normal
    #: variables.
    factor: Array
    between: Array  #: (m, m); covariance of the standard draws of different entries
    #: Columns of the uniform variates: to, from, and whether turned about 1/2; no column is both.
    classes: tuple[tuple[int, int, bool], ...] = ()

    def matched(self, uniforms: Array) -> Array:
        """Uniform variates, shape (units, dimensions), in which matched parts choose their classes together."""
        if not self.classes:
            return uniforms
        together = uniforms.copy()
        for to, origin, opposite in self.classes:
            together[:, to] = 1 - uniforms[:, origin] if opposite else uniforms[:, origin]
        return together


def dependence(
    tolerances: Sequence[Tolerance], rules: Sequence[SamplingRule], components: Sequence[Component]
) -> Dependence | None:
    """Lay out what ties the tolerances of a stack; None where all are independent.

    Parameters
    ----------
    tolerances : sequence of Tolerance
    rules : sequence of SamplingRule
        Of each tolerance.
    components : sequence of Component
        Of all of them.

    Raises
    ------
    InputError
        If two cannot be tied, or the correlations contradict one another: their matrix has an eigenvalue below 0.

    Notes
    -----
    Two values of one class are independent but for it, so their covariance is that of the means of their classes.
    """
    pairs, fitted = correlations(tolerances), fits(tolerances)
    if not pairs and not fitted:
        return None
    labels = [item.label for item in tolerances]
    laws = cast("list[Scalar]", [rule.distribution for rule in rules])
    across, between = np.zeros((2, len(components), len(components)))
    joined = sorted({e for pair in pairs for e in pair})
    for e in joined:
        _check_joined(tolerances[e], rules[e])
    for (e, f), value in pairs.items():
        one, other = rules[e], rules[f]
        if one.terms != other.terms:
            raise InputError(
                f"{labels[e]} and {labels[f]}: correlated, with {one.terms} and {other.terms} parameters; give both as "
                "many by parameters = [...]"
            )
        with refusing(f"{labels[e]} and {labels[f]}: "):
            normal = normal_correlation(laws[e], laws[f], value)
        alike = _alike(one, other, components)
        across[one.components, other.components] = normal * alike
        between[one.components, other.components] = value * math.sqrt(laws[e].variance * laws[f].variance) * alike
    columns: set[tuple[int, int, bool]] = set()
    for (e, f), fit in fitted.items():
        one, other = rules[e], rules[f]
        means, theirs = (laws[n].class_means(fit.classes) for n in (e, f))
        alike = _alike(one, other, components)
        between[one.components, other.components] = np.mean(means * (theirs[::-1] if fit.opposite else theirs)) * alike
        for i, j in np.argwhere(alike):
            to, origin = (rule.class_variates.start + rule.alike[at] for rule, at in ((one, i), (other, j)))
            columns.add((to, origin, fit.opposite))
    correlation = across + across.T
    for e in joined:
        alike_by = normal_correlation(laws[e], laws[e], rules[e].correlation)
        own = (1 - alike_by) * np.eye(rules[e].instances) + alike_by
        correlation[rules[e].components, rules[e].components] = np.kron(own, np.eye(rules[e].terms))
    rows = [row for e in joined for row in range(rules[e].components.start, rules[e].components.stop)]
    owner = [e for e in joined for _ in range(rules[e].instances * rules[e].terms)]
    factor = _root(correlation[np.ix_(rows, rows)], owner, labels) if rows else np.empty((0, 0))
    return Dependence(factor, between + between.T, tuple(sorted(columns)))


def _check_joined(item: Tolerance, rule: SamplingRule) -> None:
    if item.random_phase or not isinstance(item.distribution, Scalar):
        raise InputError(
            f"{item.label}: is correlated with another tolerance, and its vectors have a random phase; use "
            "'rayleigh' or 'normal' without phase"
        )
    if rule.classes > 1:
        raise InputError(
            f"{item.label}: is correlated with another tolerance, and its parts are sorted into classes, one by "
            "one; leave one of them out"
        )


def _alike(one: SamplingRule, other: SamplingRule, components: Sequence[Component]) -> Flags:
    """Which components of two entries go together: of one place among the parameters, their common indices alike."""
    mine, theirs = components[one.components], components[other.components]
    return np.array(
        [[i % one.terms == j % other.terms and _meet(a, b) for j, b in enumerate(theirs)] for i, a in enumerate(mine)]
    )


def _meet(one: Component, other: Component) -> bool:
    return all(one.indices[name] == other.indices[name] for name in one.indices.keys() & other.indices.keys())


def _root(matrix: Array, owner: Sequence[int], labels: Sequence[str]) -> Array:
    """Square root of a correlation matrix; refused where there is none."""
    size, directions = np.linalg.eigh(matrix)
    if size[0] >= -_ROUNDING:
        return np.asarray(directions * np.sqrt(np.maximum(size, 0.0)))
    weight = np.bincount(owner, weights=directions[:, 0] ** 2, minlength=len(labels))
    named = [repr(label) for label, part in zip(labels, weight, strict=True) if part > _TAKES_PART]
    raise InputError(
        f"correlated_with: the correlations of {', '.join(named)} contradict one another, no parts have them together: "
        "their matrix is not positive definite; give smaller ones"
    )


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
    >>> from rverror.tolerances.declared import tolerance
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


def fits(tolerances: Sequence[Tolerance]) -> dict[tuple[int, int], SelectedFit]:
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
    >>> from rverror.tolerances.declared import tolerance
    >>> cams = tolerance("crank.eccentricity", "5 um", name="cams", parameters=["radial"])
    >>> fit = {"with": "cams", "classes": 3}
    >>> fits([cams, tolerance("cycloid.disc_bore_position", "5 um", parameters=["radial"], fit=fit)])
    {(1, 0): SelectedFit(other='cams', classes=3, opposite=False)}
    """
    found: dict[tuple[int, int], SelectedFit] = {}
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
        found[e, other] = item.fit
    return found


def _other(tolerances: Sequence[Tolerance], e: int, what: str, name: str) -> int:
    """Number of the other tolerance of a name or key."""
    item = tolerances[e]
    found = [f for f, other in enumerate(tolerances) if f != e and name in (other.label, other.key)]
    if len(found) != 1:
        others = [other.label for other in tolerances if other is not item]
        known = f"{did_you_mean(name, others)} the tolerances are {', '.join(others)}" if others else " add it"
        said = f"{len(found)} tolerances" if found else "no other tolerance"
        remedy = " give each a name of its own" if found else known
        raise InputError(f"{item.label}: {what} {name!r}: {said} of this name;{remedy}")
    return found[0]


def places(instances: Sequence[Mapping[str, IndexValue]], by: Sequence[Mapping[str, IndexValue]]) -> tuple[int, ...]:
    """Number of the class of each instance matched with others: those whose common indices are alike share one."""
    common = [name for name in instances[0] if name in by[0]]
    found = [tuple(indices[name] for name in common) for indices in instances]
    order = list(dict.fromkeys(found))
    return tuple(order.index(place) for place in found)
