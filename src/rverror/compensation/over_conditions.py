"""Waves of an order over load, speed and temperature: the smooth law that predicts conditions that were left out."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rverror.base.arrays import Array
from rverror.base.chance import variance_ratio
from rverror.runs.order_table import TableCondition, Waves

#: What a law may hang on, as in `TableCondition`, with its dimension.
VARIABLES = {"torque": "torque", "input_speed": "angular_speed", "temperature": "temperature"}
_DEGREE = 2
#: Conditions in one direction from which on a law is looked for: fewer are taken as they are.
LEAST_CONDITIONS = 4

Exponents = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class ConditionLaw:
    """Wave of one order in one direction as a polynomial of the conditions.

    Attributes
    ----------
    terms : tuple of tuple of int
        Exponents of torque, speed and temperature of each term; empty where no law predicts what was left out.
    sizes : ndarray of complex, shape (terms,)
        rad, of variables over their largest size.
    low, high : ndarray, shape (3,)
        Between which each variable was measured.
    left : ndarray of complex, shape (conditions,)
        Wave of each condition less what the others predict, rad.
    """

    terms: tuple[Exponents, ...]
    sizes: Waves
    low: Array
    high: Array
    left: Waves

    def __call__(self, condition: TableCondition) -> complex:
        """Wave under a condition, rad; beyond what was measured as at its end."""
        given = [getattr(condition, name) for name in VARIABLES]
        values = [low if value is None else value for value, low in zip(given, self.low, strict=True)]
        x = np.clip(values, self.low, self.high) / _scales(self.low, self.high)
        return complex(_columns(x[None], self.terms)[0] @ self.sizes)

    @property
    def text(self) -> str:
        """Terms in words, ``constant + torque``."""
        names = [name.replace("input_", "") for name in VARIABLES]
        powers = ("", "{}", "{}^2")
        words = [
            " ".join(powers[p].format(name) for name, p in zip(names, exponents, strict=True) if p)
            for exponents in self.terms
        ]
        return " + ".join(word or "constant" for word in words) or "none"


def law_of(waves: Waves, conditions: Sequence[TableCondition], chance: float) -> ConditionLaw:
    """The law of one order in one direction.

    Parameters
    ----------
    waves : ndarray of complex, shape (n,)
    conditions : sequence of TableCondition
        Each is left out in its turn.
    chance : float
        That a term which means nothing is taken.

    Returns
    -------
    ConditionLaw

    Notes
    -----
    One term after another, of those up to the second degree that of all conditions left out takes most squares off,
    as long as that is beyond chance: F of 2 and 2 (n - p) degrees of freedom.  A variable has a power only where it
    took two values more than that.
    """
    values = [[getattr(c, name) for c in conditions] for name in VARIABLES]
    table = np.array([row if None not in row else [0.0] * len(row) for row in values]).T
    low, high = table.min(axis=0), table.max(axis=0)
    x = table / _scales(low, high)
    powers = [min(_DEGREE, max(np.unique(column).size - 2, 0)) for column in table.T]
    open_ = [e for e in itertools.product(*(range(p + 1) for p in powers)) if sum(e) <= _DEGREE]
    terms: tuple[Exponents, ...] = ()
    left = np.array(waves, dtype=np.complex128)
    level = chance / len(open_)
    while len(terms) < len(open_) and len(terms) + 2 < len(waves):
        trials = {e: _without_each(_columns(x, (*terms, e)), waves) for e in open_ if e not in terms}
        best = min(trials, key=lambda e: float(np.sum(np.abs(trials[e]) ** 2)))
        squares = float(np.sum(np.abs(trials[best]) ** 2))
        freedom = 2 * (len(waves) - len(terms) - 1)
        gain = float(np.sum(np.abs(left) ** 2)) - squares
        if gain / 2 <= variance_ratio(level, 2, freedom) * squares / freedom:
            break
        terms, left = (*terms, best), trials[best]
    sizes = np.linalg.lstsq(_columns(x, terms), waves, rcond=None)[0] if terms else np.zeros(0, dtype=np.complex128)
    return ConditionLaw(terms, np.asarray(sizes, dtype=np.complex128), low, high, left)


def _scales(low: Array, high: Array) -> Array:
    """Largest size of each variable, 1 of none."""
    size = np.maximum(np.abs(low), np.abs(high))
    return np.where(size > 0, size, 1.0)


def _columns(x: Array, terms: Sequence[Exponents]) -> Array:
    return np.array([np.prod(x ** np.array(e), axis=1) for e in terms]).reshape(len(terms), len(x)).T


def _without_each(columns: Array, waves: Waves) -> Waves:
    """Residual of each wave with sizes from the others."""
    inverse = np.linalg.pinv(columns)
    rest = waves - columns @ (inverse @ waves)
    lever = np.einsum("ij,ji->i", columns, inverse)
    return np.asarray(rest / np.maximum(1 - lever, 1e-9), dtype=np.complex128)
