"""Units that are no members of their lot, and the parts that make them so.

Page ``theory/lots.md``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rverror.base.arrays import Array
from rverror.lots.processes import UnitParts
from rverror.lots.result import Outsider
from rverror.lots.shifts import Fits, single_parts

_TAIL = 0.25  # of the members, to which a tail is fitted: of 150 units 38
_RATE = 1.0  # at most of a tail, for the largest of many chi-squares has it; contacts that open make tails longer
_SHAPES = np.linspace(0.0, 1.0, 21)  # of a tail: none is an exponential, a half has no variance
#: Mean shape beforehand.  The root of a distance is Lipschitz in normal errors, so its tail is no longer than normal;
#: an exponential would do, and a little more is for parts whose errors are not normal.
_ALONG, _ALL_OVER = 0.1, 0.06
_SCALES = np.exp(np.linspace(-1.2, 1.0, 45))  # of a tail, over its mean: a fifth of 38 units' is their error
_NORMAL = 1.96  # standard errors to either side of 95 %


@dataclass(frozen=True)
class MembersTail:
    """How often a member exceeds a value: a generalised Pareto tail, over all that the members leave possible.

    Its shape is no less than an exponential's, its rate no more than that of the largest of many chi-squares.

    Attributes
    ----------
    seen : ndarray
        What members make: minus the logarithm of a chance, or the root of a distance.
    usual_shape : float
        Mean of the shapes that are likely beforehand, none the most.
    """

    seen: Array
    usual_shape: float = _ALONG

    @cached_property
    def start(self) -> float:
        """Where the tail begins."""
        return float(np.quantile(self.seen, 1 - _TAIL))

    @cached_property
    def _likely(self) -> tuple[Array, Array]:
        """Scales, and how likely each of them is with each shape, (shapes, scales)."""
        beyond = self.seen[self.seen > self.start] - self.start
        scales = max(float(beyond.mean()) if beyond.size else 0.0, 1e-9) * _SCALES
        exponent = _exponent(beyond, scales)
        density = -(exponent * (1 + _SHAPES[:, None, None])).sum(axis=-1) - beyond.size * np.log(scales)
        logarithm = density - _SHAPES[:, None] / self.usual_shape
        likely = np.exp(logarithm - logarithm.max())
        return np.maximum(scales, 1 / _RATE), likely / likely.sum()

    def chance(self, value: float) -> float:
        """Chance that one member exceeds a value."""
        if value <= self.start:
            return float((1 + np.sum(self.seen >= value)) / (1 + len(self.seen)))
        scales, likely = self._likely
        beyond = np.exp(-_exponent(np.array([value - self.start]), scales)[..., 0])
        return float(_TAIL * np.sum(likely * beyond))


def _exponent(beyond: Array, scales: Array) -> Array:
    """Minus the logarithm of the chance of what is so far beyond a start, shape (shapes, scales, beyond)."""
    ratio, shape = beyond / scales[:, None], _SHAPES[:, None, None]
    return np.asarray(np.where(shape > 0, np.log1p(shape * ratio) / np.where(shape > 0, shape, 1.0), ratio))


def outsiders(
    values: Array,
    serials: Sequence[str],
    members: Array,
    weight: Array,
    influence: Array,
    parts: UnitParts,
    *,
    marked: bool = True,
    level: float = 0.01,
) -> tuple[Outsider, ...]:
    """Units that no member of the lot is like, and for each the part whose error makes it so.

    Of each part the chi-square of its fit to a unit, over what members make of it; the most surprising part's, and the
    unit's distance all in all, are compared with those of members.

    Parameters
    ----------
    values : ndarray, shape (units, d)
        Whitened amplitudes about the lot's mean.
    serials : sequence of str
    members : ndarray, shape (n, d)
        The same of simulated units, with noise.
    weight : ndarray, shape (d, d)
        Inverse covariance of a unit's amplitudes.
    influence : ndarray, shape (d, components)
        Change of the amplitudes per core unit of each component.
    parts : UnitParts
    marked : bool
        Whether marks are known; else units are known all in all only, and values are about none.
    level : float
        Chance of an outsider in a lot without any.

    Returns
    -------
    tuple of Outsider
        The least likely first; without causes where only its whole distance is too large.
    """
    total, theirs = (_distances(weight, some) for some in (values, members))
    ways = [(MembersTail(np.sqrt(theirs), _ALL_OVER), np.sqrt(total / _more(total, theirs)))]  # all in all
    if marked:
        fits = Fits.of(single_parts(influence, parts), weight)
        chi, along, tail = _along(fits, weight, values, members)
        ways.append((tail, along))
    found = []
    for unit, serial in enumerate(serials):
        chances = [len(ways) * len(serials) * t.chance(float(x[unit])) for t, x in ways]
        chance = min(chances)
        if marked and chances[1] < level:
            best = fits.best(chi[unit])
            sizing = fits.sizing[best]
            errors = np.sqrt(np.mean((members @ sizing) ** 2, axis=0))  # those that a member's sizes have
            sizes = values[unit] @ sizing
            causes = fits.candidates[best].shifts(sizes, sizes - _NORMAL * errors, sizes + _NORMAL * errors)
            rivals = fits.rivals(chi[unit], best)
            found.append(Outsider(serial, float(chi[unit, best]), chance, causes, rivals))
        elif chance < level:
            found.append(Outsider(serial, float(total[unit]), chance, ()))
    return tuple(sorted(found, key=lambda one: one.chance))


def _along(fits: Fits, weight: Array, values: Array, members: Array) -> tuple[Array, Array, MembersTail]:
    """Chi-squares of parts as members make them, (units, candidates); the largest surprise of each unit; members'."""
    (chi, left), (theirs, usual) = (_left(fits, weight, some) for some in (values, members))
    # over what is left, where this is more than usual: who is off all over has no one cause
    chi, theirs = (x / np.maximum(rest / usual.mean(axis=0), 1.0) for x, rest in ((chi, left), (theirs, usual)))
    label = np.array([one.label for one in fits.candidates])
    alike = label[:, None] == label  # parameters of a part are compared with one another: one scale for all of them
    of_part = alike / (alike @ fits.freedom)
    chi = chi / (theirs.mean(axis=0) @ of_part) / _more(chi @ of_part, theirs @ of_part)
    # a member is no better known than a unit: its own chi-square is not in what it is compared with
    without = (theirs.sum(axis=0) - theirs) / (len(members) - 1) @ of_part
    return chi, fits.surprise(chi), MembersTail(fits.surprise(theirs / without))


def _left(fits: Fits, weight: Array, some: Array) -> tuple[Array, Array]:
    """Chi-square of each candidate's fit to units, and of what it leaves, (units, candidates) each."""
    chi = fits.chi_squares(some @ fits.basis)
    return chi, _distances(weight, some)[:, None] - chi


def _more(units: Array, members: Array) -> Array:
    """Usual chi-square of units over members', where it is more: what a model lacks, all units have."""
    return np.maximum(np.median(units, axis=0) / np.median(members, axis=0), 1.0)


def _distances(weight: Array, some: Array) -> Array:
    return np.asarray(np.einsum("ud,ud->u", some @ weight, some))
