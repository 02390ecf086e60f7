"""Assemblies of units as sums of waves, and the search for the one in which the most units are within limits.

A unit's error wave is a base plus one wave a place, each over the limit: its largest section is 1 at the limit.
Page ``theory/matching.md``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
import scipy

from rverror.base.arrays import Array, Flags, Integers
from rverror.base.progress import Progress

_STARTS, _SMALL = 6, 120  # of the search; and of few units, times their number
_CHANGE = 0.02  # cost of changing a unit that was solved: smaller gains are not worth it
_CAP = 4.0  # of limits: worse units are alike
_SWEEPS = 12  # at the most; the search ends when one brings nothing
_SWAPS = 12  # of two rollers of a unit, at the most
_BLOCK = 2**22  # samples of a block: 16 MB


@dataclass(frozen=True)
class Assembly:
    """Which part stands at which place of which unit.

    Attributes
    ----------
    part, turn : ndarray of int, shape (units, places)
        Number of the part in its pool, and by which of the place's ways it is turned.
    """

    part: Integers
    turn: Integers

    def of(self, rows: Any) -> Assembly:
        """Some of the units."""
        return Assembly(self.part[rows], self.turn[rows])

    def with_some(self, other: Assembly, better: Flags) -> Assembly:
        """These units, and those of another assembly where these are better."""
        chosen = better[:, None]
        return Assembly(np.where(chosen, other.part, self.part), np.where(chosen, other.turn, self.turn))

    def names(self) -> list[tuple[int, ...]]:
        """Parts of each unit, then their turns."""
        return [tuple(row) for row in np.concatenate([self.part, self.turn], axis=1).tolist()]


def section_sizes(waves: Array, sections: Sequence[tuple[slice, bool]]) -> Array:
    """Peak-to-peak, or largest value, of each section of waves, as `UnitWaves` has them, shape (sections, ...)."""
    return np.array([(np.ptp if span else np.max)(waves[..., at], axis=-1) for at, span in sections])


@dataclass(frozen=True)
class UnitWaves:
    """Waves of all parts at all places.

    Attributes
    ----------
    base : ndarray, shape (samples,)
        Of a unit without errors of parts, over the limits.
    parts : sequence of ndarray, shape (turns, parts, samples)
        Of each place.
    pools : tuple of int
        From which pool each place takes its parts.
    sections : tuple of (slice, bool)
        Samples of each quantity, and whether its peak-to-peak counts, or its largest value.
    doubt : float
        Standard deviation of a unit's true error about the sum of its waves, both over the limit.
    shift, unsure : float
        Mean and standard deviation of what the uncertainty of the parts' sizes adds to a unit's error, over the limit.
    """

    base: Array
    parts: Sequence[Array]
    pools: tuple[int, ...]
    sections: tuple[tuple[slice, bool], ...]
    doubt: float = 0.0
    shift: float = 0.0
    unsure: float = 0.0

    @cached_property
    def sizes(self) -> dict[int, int]:
        """Parts of each pool."""
        return {pool: waves.shape[1] for pool, waves in zip(self.pools, self.parts, strict=True)}

    @cached_property
    def most(self) -> int:
        """Units that the numbers of parts allow."""
        return min(self.sizes[pool] // self.pools.count(pool) for pool in self.sizes)

    @cached_property
    def _alike(self) -> list[tuple[int, int]]:
        """Pairs of places that take their parts from one pool."""
        return [(a, b) for a, b in combinations(range(len(self.parts)), 2) if self.pools[a] == self.pools[b]]

    def errors(self, waves: Array) -> Array:
        """Largest section of each wave, over the limit, shape (...)."""
        return np.asarray(section_sizes(waves, self.sections).max(axis=0))

    def of(self, assembly: Assembly, places: Sequence[int]) -> Array:
        """Sum of the waves at some places, without the base, shape (units, samples)."""
        total = np.zeros((len(assembly.part), self.base.size), dtype=self.base.dtype)
        for place in places:
            total += self.parts[place][assembly.turn[:, place], assembly.part[:, place]]
        return total

    def whole(self, assembly: Assembly, residual: Array | None = None) -> Array:
        """Wave of each unit, shape (units, samples), with its residual if there is one."""
        total = self.base + self.of(assembly, range(len(self.parts)))
        return total if residual is None else total + residual

    def pairs(self, rows: Array, columns: Array) -> Array:
        """Errors of all sums of a row and a column, shape (rows, columns)."""
        found = np.empty((len(rows), len(columns)))
        step = max(1, _BLOCK // max(1, columns.size))
        for first in range(0, len(rows), step):
            some = slice(first, first + step)
            found[some] = self.errors(rows[some, None] + columns)
        return found

    def bad(self, errors: Array) -> Array:
        """Chance that units of such errors are bad."""
        excess, sigma = errors + self.shift - 1, math.hypot(self.doubt, self.unsure)
        return np.asarray(scipy.special.ndtr(excess / sigma) if sigma else (excess > 0) * 1.0)

    def cost(self, errors: Array) -> Array:
        """Cost of units: the chance that each is bad, and with far less weight its error, to decide between equals."""
        equals = np.minimum(errors, _CAP) / (2 * _CAP * self.most)
        return np.asarray(self.bad(errors) + equals, dtype=np.float64)

    @property
    def solved(self) -> UnitWaves:
        """These waves where units are solved, and errors those of the measured sizes: only these are in doubt."""
        return replace(self, doubt=0.0)

    # --- assemblies ---------------------------------------------------------------------------------------------------

    def shuffled(self, rng: np.random.Generator) -> Assembly:
        """As many units as can be made, put together at random, parts turned as they come."""
        part = np.empty((self.most, len(self.pools)), dtype=np.intp)
        for pool, size in self.sizes.items():
            places = [place for place, of in enumerate(self.pools) if of == pool]
            part[:, places] = rng.permutation(size)[: self.most * len(places)].reshape(self.most, -1)
        return Assembly(part, np.zeros_like(part))

    def searched(self, rng: np.random.Generator, *, progress: Progress | None = None) -> Assembly:
        """The best assembly that is found: from random starts, by exact assignments until none brings anything.

        Parameters
        ----------
        rng : Generator
        progress : callable, optional
            Called with a line of text at each start.

        Returns
        -------
        Assembly

        Notes
        -----
        Every other start is at random; in those between, parts of a kind change their places in half of the units of
        the best so far, so that others come together.
        """
        starts = max(_STARTS, _SMALL // self.most)
        best = self._descended(self.shuffled(rng))
        for start in range(1, starts):
            if progress is not None:
                progress(f"assemblies: start {start + 1} of {starts}")
            initial = self.shuffled(rng) if start % 2 else Assembly(best.part.copy(), best.turn.copy())
            for pair in self._alike:
                some = rng.random(len(initial.part)) < 0.5
                initial.part[:, pair] = np.where(some[:, None], initial.part[:, pair[::-1]], initial.part[:, pair])
            found = self._descended(initial)
            best = found if self._total(found) < self._total(best) else best
        return best

    def _total(self, assembly: Assembly) -> float:
        return float(self.cost(self.errors(self.whole(assembly))).sum())

    def _descended(self, assembly: Assembly) -> Assembly:
        count, now = len(self.parts), self._total(assembly)
        some = [few for size in (1, 2) if 2 * size <= count for few in combinations(range(count), size)]
        for _ in range(_SWEEPS):
            for pair in self._alike:
                assembly = self._exchanged(assembly, pair)
            for few in some:
                assembly = self.assigned(assembly, few)
            before, now = now, self._total(assembly)
            if now > before - 1e-6:
                break
        return assembly

    def _exchanged(self, assembly: Assembly, pair: tuple[int, int]) -> Assembly:
        """Parts at two places of a unit change them where that is better; each is turned as it comes."""
        other = Assembly(assembly.part.copy(), assembly.turn.copy())
        other.part[:, pair] = assembly.part[:, pair[::-1]]
        other.turn[:, pair] = 0
        return assembly.with_some(other, self.errors(self.whole(other)) < self.errors(self.whole(assembly)) - 1e-9)

    def turned(self, assembly: Assembly) -> Assembly:
        """Each part of a unit turned where the unit's error is least, a place after another."""
        turn = assembly.turn.copy()
        for place in range(len(self.parts)):
            rest = self.base + self.of(Assembly(assembly.part, turn), [p for p in range(len(self.parts)) if p != place])
            errors = [self.errors(rest + way[assembly.part[:, place]]) for way in self.parts[place]]
            turn[:, place] = np.argmin(errors, axis=0)
        return Assembly(assembly.part, turn)

    def assigned(
        self,
        assembly: Assembly,
        places: Sequence[int],
        *,
        residual: Array | None = None,
        known: Mapping[tuple[int, ...], float] | None = None,
    ) -> Assembly:
        """Give the units the parts of some places anew, all else left as it is, by an exact assignment.

        Parameters
        ----------
        assembly : Assembly
        places : sequence of int
            One, whose parts come from the units and from what is left of the pool, in any way that they can be turned;
            or several, whose parts stay together as they are.
        residual : ndarray, shape (units, samples), optional
            True wave of each unit less the sum of its parts' waves; it stays with the other places.
        known : mapping of tuple of int to float, optional
            True errors of units that were solved, by `Assembly.names`; for one place only.

        Returns
        -------
        Assembly
        """
        one = places[0]
        rows = self.base + self.of(assembly, [p for p in range(len(self.parts)) if p not in places])
        if residual is not None:
            rows += residual
        part, turn = assembly.part.copy(), assembly.turn.copy()
        if len(places) > 1:
            options = self.of(assembly, places)[None]
        else:
            alike = [p for p, pool in enumerate(self.pools) if pool == self.pools[one]]
            left = np.setdiff1d(np.arange(self.sizes[self.pools[one]]), assembly.part[:, alike])
            offered = np.concatenate([assembly.part[:, one], left])
            options = self.parts[one][:, offered]
        errors = np.array([self.pairs(rows, option) for option in options])
        way, cost = errors.argmin(axis=0), self.cost(errors.min(axis=0))
        if known is not None:
            cost += _CHANGE
            count = len(self.parts)
            units = {_rest(name, one, count): number for number, name in enumerate(assembly.names())}
            for name, error in known.items():
                number, of, turned = units.get(_rest(name, one, count)), name[one], name[count + one]
                if number is None:
                    continue
                for column in np.flatnonzero(offered == of):
                    as_it_is = (of, turned) == (part[number, one], turn[number, one])
                    if as_it_is or way[number, column] == turned:
                        way[number, column] = turned
                        cost[number, column] = self.solved.cost(np.asarray(error)) + (0 if as_it_is else _CHANGE)
        unit, chosen = scipy.optimize.linear_sum_assignment(cost)
        if len(places) > 1:
            part[:, places], turn[:, places] = part[np.ix_(chosen, places)], turn[np.ix_(chosen, places)]
        else:
            part[:, one], turn[:, one] = offered[chosen], way[unit, chosen]
        return Assembly(part, turn)

    # --- the bound ----------------------------------------------------------------------------------------------------

    def bound(self) -> int:
        """Units within their limits that no assembly can exceed: a part is of no use where no unit with it is good.

        The difference of a unit's wave at two samples is no more than its peak-to-peak, and the parts of all other
        places together can take no more from it than the best of each.
        """
        possible = {pool: np.zeros(size, dtype=bool) for pool, size in self.sizes.items()}
        for place, waves in enumerate(self.parts):
            others = [other for other in range(len(self.parts)) if other != place]
            for own in self.base + waves:
                within = np.ones(len(own), dtype=bool)
                for at, span in self.sections:
                    high, low = (at.start + place_of(own[:, at], axis=1) for place_of in (np.argmax, np.argmin))
                    every = np.arange(len(own))
                    least = own[every, high] - (own[every, low] if span else 0)
                    for other in others:
                        flat = self.parts[other].reshape(-1, self.base.size)
                        least = least + (flat[:, high] - (flat[:, low] if span else 0)).min(axis=0)
                    within &= least <= 1 + 1e-6
                possible[self.pools[place]] |= within
        return int(min(possible[pool].sum() // self.pools.count(pool) for pool in self.sizes))


def placed(waves: UnitWaves, grooves: Array, came: Integers, wave: Array) -> Integers:
    """Rollers of one unit by groove: assigned by what each does to the mean square, then exchanged two by two.

    The exchange also begins with the rollers as they came, and the better end counts.

    Parameters
    ----------
    waves : UnitWaves
        For the sections of a wave.
    grooves : ndarray, shape (grooves, rollers, samples)
        Waves of all rollers in all grooves.
    came : ndarray of int, shape (grooves,)
        Rollers of the unit in the order in which they came.
    wave : ndarray, shape (samples,)
        Of the unit with them so.

    Returns
    -------
    ndarray of int, shape (grooves,)
    """
    every = np.arange(len(came))
    own = grooves[:, came]  # (grooves, rollers, samples)
    rest = wave - own[every, every].sum(axis=0)
    order = every
    weight = np.concatenate([np.full(at.stop - at.start, 1 / (at.stop - at.start)) for at, _ in waves.sections])
    for at, span in waves.sections:  # of a peak-to-peak the mean does not count
        if span:
            rest[at] -= rest[at].mean()
            own[:, :, at] -= own[:, :, at].mean(axis=2, keepdims=True)
    for _ in range(3):
        total = rest + own[every, order].sum(axis=0)
        others = total - own[every, order]  # of each groove, all but its roller
        price = 2 * np.einsum("gs,grs->gr", others * weight, own) + np.einsum("grs,s->gr", own**2, weight)
        order = scipy.optimize.linear_sum_assignment(price)[1]
    return came[min(_swapped(waves, own, rest, start) for start in (order, every))[1]]


def _swapped(waves: UnitWaves, own: Array, rest: Array, order: Integers) -> tuple[float, list[int]]:
    """Error of a unit, and its rollers by groove, when no exchange of two makes it less."""
    every = np.arange(len(order))
    first, second = np.triu_indices(len(order), 1)
    for _ in range(_SWAPS):
        total = rest + own[every, order].sum(axis=0)
        a, b = order[first], order[second]
        errors = waves.errors(total + own[first, b] + own[second, a] - own[first, a] - own[second, b])
        best = int(errors.argmin())
        if errors[best] >= waves.errors(total) - 1e-6:
            break
        order = order.copy()
        order[[first[best], second[best]]] = order[[second[best], first[best]]]
    return float(waves.errors(rest + own[every, order].sum(axis=0))), order.tolist()


def _rest(name: tuple[int, ...], place: int, count: int) -> tuple[int, ...]:
    """Name of a unit without its part at one place."""
    return tuple(number for at, number in enumerate(name) if at % count != place)
