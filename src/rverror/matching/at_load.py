"""Units of measured parts at the load: the errors of their components, true sizes, and waves that add up."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate, pairwise
from typing import Any

import numpy as np

from rverror.base.arrays import Array
from rverror.base.numbers import way
from rverror.base.threads import each
from rverror.geartrain.mechanism import Reducer
from rverror.geartrain.source import IndexValue
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.parts.measured import MeasuredPart, Place, mounted
from rverror.statics.loaded_state import NotConvergedError
from rverror.tolerances.loaded_units import POSITIONS, LoadedTurn, LoadedUnits
from rverror.tolerances.sampling_rule import Component
from rverror.tolerances.specification import Limit
from rverror.tolerances.stacking import Stack

#: Angles of a turn at which waves are added; a prime, so that each order of an RV reducer meets them in all its phases.
ANGLES = 487


@dataclass(frozen=True)
class Quantity:
    """What of a unit is limited: a limit, and the direction of motion of a transmission error."""

    limit: Limit
    direction: float

    @property
    def span(self) -> bool:
        """Whether the peak-to-peak of its wave counts, or the largest value."""
        return not self.limit.loads

    @property
    def label(self) -> str:
        """For people."""
        return f"{self.limit.label}, {way(self.direction)}" if self.span else self.limit.label


@dataclass(frozen=True)
class PlacedErrors:
    """Components that the parts of a lot have at any place, and where each stands.

    Attributes
    ----------
    components : tuple of Component
    sizes : tuple of ndarray, shape (parts, errors)
        Of the parts for each place, core units.
    sigmas : tuple of ndarray, shape (parts, errors)
        Uncertainty of each size, 1 sigma; 0 where none is stated.
    moved : tuple of ndarray, shape (turns, errors, components)
        What an error of size 1 is at each place, its part turned by each of its ways.
    """

    components: tuple[Component, ...]
    sizes: tuple[Array, ...]
    sigmas: tuple[Array, ...]
    moved: tuple[Array, ...]

    def values(self, place: int, part: Any, turn: Any) -> Array:
        """Components of parts at a place, shape (units, components)."""
        return np.asarray(np.einsum("ub,ubc->uc", self.sizes[place][part], self.moved[place][turn]), dtype=np.float64)

    @cached_property
    def _shrinkage(self) -> tuple[Array, ...]:
        """Share of each size's distance from its mean over the lot that is the part's, not the measurement's.

        By Lindley's form of the estimator of James and Stein; 1 of errors that not all parts have with an uncertainty.
        """
        found = []
        for sizes, sigmas in zip(self.sizes, self.sigmas, strict=True):
            noise = max(len(sizes) - 3, 0) * np.mean(sigmas**2, axis=0) * (sigmas > 0).all(axis=0)
            scatter = np.sum((sizes - sizes.mean(axis=0)) ** 2, axis=0)
            found.append(1 - np.minimum(noise, scatter) / np.where(scatter > 0, scatter, 1))
        return tuple(found)

    @cached_property
    def regression(self) -> PlacedErrors:
        """What true sizes differ by in the mean from the measured ones: these scatter more than the parts do."""
        sizes = tuple((k - 1) * (own - own.mean(axis=0)) for k, own in zip(self._shrinkage, self.sizes, strict=True))
        return replace(self, sizes=sizes)

    @cached_property
    def variances(self) -> PlacedErrors:
        """Variances of true sizes about that mean; those of a pair that turns are alike, so they add up by squares."""
        sizes = tuple(k * own**2 for k, own in zip(self._shrinkage, self.sigmas, strict=True))
        return replace(self, sizes=sizes, moved=tuple(one**2 for one in self.moved))

    def waves(self, place: int, slope: Array) -> Array:
        """Waves of all parts at a place, turned by each of its ways, shape (turns, parts, samples)."""
        return np.asarray(self.sizes[place] @ (self.moved[place] @ slope), dtype=np.float32)


def columns_of(reducer: Reducer, lots: Sequence[tuple[Place, Sequence[MeasuredPart]]]) -> PlacedErrors:
    """Lay out the errors of parts at places.

    Parameters
    ----------
    reducer : Reducer
    lots : sequence of (Place, parts)
        Parts that may stand at each place.

    Returns
    -------
    PlacedErrors

    Notes
    -----
    What turning does is linear, so each error of size 1 is mounted once in every way, and all parts follow.
    """
    known: dict[tuple[str, frozenset[tuple[str, IndexValue]], str], Component] = {}

    def named(error: Effect) -> list[tuple[str, frozenset[tuple[str, IndexValue]], int]]:
        return [(error.key, frozenset(error.indices.items()), p) for p in range(len(error.values))]

    built = []
    for place, parts in lots:
        every = dict.fromkeys(name for part in parts for error in part.errors for name in named(error))
        terms = {term: number for number, term in enumerate(every)}
        sizes, sigmas = np.zeros((2, len(parts), len(terms)))
        for number, part in enumerate(parts):
            for error in part.errors:
                own = [terms[name] for name in named(error)]
                sizes[number, own], sigmas[number, own] = error.values, error.uncertainty or 0.0
        entries = []  # of `moved`: way that it is turned, term, component, value
        for turned, turn in enumerate(place.turns):
            for (key, at, p), number in terms.items():
                unit = tuple(float(p == other) for other in range(len(source(key).parameters)))
                alone = MeasuredPart(place.kind, "", (Effect(key, dict(at), unit),))
                (error,) = mounted(alone, reducer, place.number, turn)
                for parameter, value in zip(source(key).parameters, error.values, strict=True):
                    name = (key, frozenset(error.indices.items()), parameter.name)
                    known.setdefault(name, Component(key, error.indices, parameter.name, parameter.dimension))
                    entries.append((turned, number, name, value))
        built.append((sizes, sigmas, len(place.turns), entries))
    moves, column = [], {name: number for number, name in enumerate(known)}
    for sizes, _, ways, entries in built:
        moved = np.zeros((ways, sizes.shape[1], len(known)))
        for turned, number, name, value in entries:
            moved[turned, number, column[name]] += value
        moves.append(moved)
    every_size, every_sigma, *_ = zip(*built, strict=True)
    return PlacedErrors(tuple(known.values()), every_size, every_sigma, tuple(moves))


@dataclass(frozen=True)
class UnitsAtLoad:
    """A model and the components of its parts at the loads of some limits, prepared once.

    Attributes
    ----------
    model : Model
    components : tuple of Component
    limits : tuple of Limit
        With values and torques.
    """

    model: Model
    components: tuple[Component, ...]
    limits: tuple[Limit, ...]

    @property
    def quantities(self) -> tuple[Quantity, ...]:
        """All limits forward, then those of the transmission error in reverse."""
        every = [Quantity(one, 1.0) for one in self.limits]
        return (*every, *(Quantity(one, -1.0) for one in self.limits if not one.loads))

    @cached_property
    def allowed(self) -> Array:
        """Largest turn of each quantity, rad."""
        return np.array([one.limit.allowed for one in self.quantities])

    @cached_property
    def _solver(self) -> LoadedUnits:
        """Of the components as those of one tolerance of width 1 a source, of which nothing is drawn."""
        keys = list(dict.fromkeys(component.key for component in self.components))
        entry = np.array([keys.index(component.key) for component in self.components], dtype=np.intp)
        none = np.zeros((len(self.components), 1))
        stack = Stack(np.zeros(1), none, self.components, entry, np.ones(len(keys)), tuple(keys), ())
        limits, directions = zip(*((one.limit, one.direction) for one in self.quantities), strict=True)
        return LoadedUnits(self.model, stack, np.zeros(len(self.components)), limits, directions)

    def solved(self, values: Array, *, progress: Callable[[int], None] | None = None) -> Array:
        """Turn of each quantity, rad, shape (units, quantities), by the equilibrium; infinite where there is none.

        Parameters
        ----------
        values : ndarray, shape (units, components)
        progress : callable, optional
            Called with the number of a unit as it is done.
        """
        return self._solver.solved(values, self._solver.stack.width, progress=progress).turns

    @cached_property
    def _lines(self) -> tuple[tuple[tuple[LoadedTurn, float], ...], ...]:
        """Motions of each quantity and their weights."""
        return tuple(
            ((self._solver.line(one.limit.torque or 0.0, one.direction, ANGLES, reads=True), 1.0),)
            if one.span
            else tuple(self._solver.between(one.limit))
            for one in self.quantities
        )

    @cached_property
    def sections(self) -> tuple[tuple[slice, bool], ...]:
        """Samples of each quantity in a wave."""
        ends = accumulate((ANGLES if one.span else POSITIONS for one in self.quantities), initial=0)
        return tuple((slice(*at), one.span) for at, one in zip(pairwise(ends), self.quantities, strict=True))

    def waves(self, values: Array, *, slopes: bool = False) -> tuple[Array, Array]:
        """Waves of units at the load, each quantity over its limit, and their mean change per component.

        Parameters
        ----------
        values : ndarray, shape (units, components)
        slopes : bool
            Whether the change is wanted.

        Returns
        -------
        waves : ndarray, shape (units, samples)
            Not a number where a unit has no equilibrium.
        slope : ndarray, shape (components, samples)
            Mean over the units that have one.
        """

        def unit(own: Array) -> tuple[Array, Array] | None:
            waves, changes = [], []
            try:
                for lines, allowed in zip(self._lines, self.allowed, strict=True):
                    states = [(line.state(own, np.arange(len(line.nominal)), response=slopes), w) for line, w in lines]
                    waves.append(sum(w * state.line.read(state, own) for state, w in states) / allowed)
                    if slopes:
                        changes.append(sum(w * state.influence().T for state, w in states) / allowed)
            except NotConvergedError:
                return None
            return np.concatenate(waves), np.concatenate(changes, axis=1) if slopes else np.empty((0, 0))

        _ = self._lines, self.sections  # before several threads ask for them
        found = each(unit, list(values))
        size = self.sections[-1][0].stop
        waves = np.array([np.full(size, np.nan) if one is None else one[0] for one in found])
        known = [one[1] for one in found if one is not None]
        return waves, np.mean(known, axis=0) if slopes and known else np.empty((0, 0))
