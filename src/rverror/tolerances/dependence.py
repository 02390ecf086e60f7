"""Correlation between different tolerances: one matrix of all their components.  Page ``theory/budget.md``."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.tolerances.distribution import Scalar, normal_correlation

_ROUNDING = 1e-8  # of an eigenvalue of a correlation matrix: its entries are found to 1e-10
_HALVINGS = 30
_TAKES_PART = 1e-6  # of the square of a direction


@dataclass(frozen=True)
class Dependence:
    """How components of several entries are drawn together.

    Correlated ones: normal variables ``factor @ z``, then their quantiles.  Those matched by classes: the variates that
    choose the classes of the one are those of the other.
    """

    components: npt.NDArray[np.intp]  #: (k,); rows of the stack, entry by entry, the correlated ones first
    #: Square, for the correlated ones; its product with its transpose is the correlation of the normal variables.
    factor: Array
    between: Array  #: (k, k); covariance of the standard draws, 0 within an entry
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
    laws: Mapping[int, Scalar],
    inside: Mapping[int, tuple[slice, float, int]],
    pairs: Mapping[tuple[int, int], float],
    alike: Mapping[tuple[int, int], Sequence[tuple[int, int]]],
    labels: Sequence[str],
) -> Dependence:
    """Lay correlations between entries out as one matrix, and see that there are parts that have them.

    Parameters
    ----------
    laws : mapping of int to Scalar
        Distribution of each entry concerned.
    inside : mapping of int to (slice, float, int)
        Components of each of them, correlation between any two of its instances, parameters of an instance.
    pairs : mapping of (int, int) to float
        Correlation of the values of two entries, Pearson's.
    alike : mapping of (int, int) to sequence of (int, int)
        Components of the two to which it applies.
    labels : sequence of str
        Of all entries, for messages.

    Raises
    ------
    InputError
        If the correlations contradict one another: their matrix has an eigenvalue below 0.
    """
    place: dict[int, int] = {}
    owner: list[int] = []
    for e, (rows, _, _) in inside.items():
        for row in range(rows.start, rows.stop):
            place[row] = len(owner)
            owner.append(e)
    within = np.zeros((len(owner), len(owner)))
    for e, (rows, value, terms) in inside.items():
        own = slice(place[rows.start], place[rows.start] + rows.stop - rows.start)
        count = (own.stop - own.start) // terms
        value = normal_correlation(laws[e], laws[e], value)
        within[own, own] = np.kron((1 - value) * np.eye(count) + value, np.eye(terms))
    across, between = np.zeros_like(within), np.zeros_like(within)
    for (e, f), value in pairs.items():
        try:
            normal = normal_correlation(laws[e], laws[f], value)
        except InputError as error:
            raise InputError(f"{labels[e]} and {labels[f]}: {error}") from error
        covariance = value * math.sqrt(laws[e].variance * laws[f].variance)
        for i, j in alike[e, f]:
            one, other = place[i], place[j]
            across[one, other] = across[other, one] = normal
            between[one, other] = between[other, one] = covariance
    size, directions = np.linalg.eigh(within + across)
    if size[0] < -_ROUNDING:
        _refuse(within, across, directions[:, 0], owner, labels)
    factor = directions * np.sqrt(np.maximum(size, 0.0))
    return Dependence(np.array(list(place), dtype=np.intp), factor, between)


def _refuse(within: Array, across: Array, worst: Array, owner: Sequence[int], labels: Sequence[str]) -> None:
    """Say which correlations cannot be together, and what part of them could."""
    weight = np.bincount(owner, weights=worst**2, minlength=len(labels))
    named = [repr(label) for label, part in zip(labels, weight, strict=True) if part > _TAKES_PART]
    low, high = 0.0, 1.0
    for _ in range(_HALVINGS):
        share = (low + high) / 2
        if np.linalg.eigvalsh(within + share * across)[0] < -_ROUNDING:
            high = share
        else:
            low = share
    raise InputError(
        f"correlated_with: the correlations of {', '.join(named)} contradict one another, their matrix is not positive "
        f"definite; no parts have them together, but {math.floor(100 * low) / 100:g} times each they can have"
    )
