"""Units drawn from processes and solved at the load: amplitudes of their orders, and what each process does to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from rverror.base.arrays import Array
from rverror.base.threads import each
from rverror.diagnosis.gears.reducers import curved
from rverror.diagnosis.gears.waveform import softened
from rverror.geartrain.source import rv
from rverror.lots.amplitudes import Amplitudes
from rverror.lots.processes import UnitParts
from rverror.model.effects import Model
from rverror.statics.loaded_state import SOFTENING, NotConvergedError
from rverror.tolerances.loaded_units import LoadedTurn

#: Stiffnesses that a lot's units share and the model states wrongly: those of `SOFTENING`.
COMPLIANCES = 6
#: Of a turn at most; orders above 312, which fold onto those up to 200, are below the noise.
ANGLES = 512
_FOLDED = 0.05  # of the variance of an order and its noise that half of the angles may change: a hundred units tell 7 %
_LEFT = 0.95  # of the orders, that half of the angles must tell


@dataclass(frozen=True)
class State:
    """What the processes make, and the stiffness of all units.

    Attributes
    ----------
    deviation : ndarray, shape (processes,)
        Standard deviations, core units.
    compliance : ndarray, shape (6,)
        Logarithms of compliances over those of the model; all of `SOFTENING` may be given.
    """

    deviation: Array
    compliance: Array


@dataclass(frozen=True)
class Draws:
    """Solved units of a state, whitened: divided by the root of the noise's variance.

    Attributes
    ----------
    waves : ndarray, shape (units, conditions, n)
        Errors over a turn, rad.
    poses : ndarray, shape (units, conditions, n, unknowns)
        Settled poses: where the same units of a state near by are sought.
    parts : ndarray, shape (units, components)
        Errors of the parts about the drawing's means, normal: none is cut at its least value, core units.
    values : ndarray, shape (units, d)
        Amplitudes.
    by_process : ndarray, shape (units, processes, d)
        Change per core unit of a process' standard deviation.
    by_compliance : ndarray, shape (units, 6, d)
        Change per logarithm of each compliance.
    influence : ndarray, shape (d, components)
        Mean change per core unit of each component.
    squares : ndarray, shape (processes, d, d)
        Mean of J J', the changes with all components of a process.
    marked : bool
        Whether units have a mean that a lot shows: they do not where each is turned by an angle of its own.
    """

    waves: Array
    poses: Array
    parts: Array
    values: Array
    by_process: Array
    by_compliance: Array
    influence: Array
    squares: Array
    marked: bool

    def covariance(self, deviation: Array) -> Array:
        """Covariance, noise included, were all linear: no contact that opens makes it smaller, shape (d, d)."""
        return np.asarray(np.einsum("c,cde->de", deviation**2, self.squares) + np.eye(self.values.shape[1]))

    def beyond(self, control: Array) -> Array:
        """Amplitudes about their mean, less what the parts' errors make by influences (d, components), (units, d)."""
        return np.asarray(self.about_mean - self.parts @ control.T)

    def mean_covariance(self, units: int) -> Array:
        """Covariance of the mean of so many units with noise, less that of these draws, shape (d, d).

        The draws' errors have no mean, so theirs is only of what is beyond the influences.
        """
        of_lot = np.cov(self.values.T) + np.eye(self.values.shape[1])
        return np.asarray(of_lot / units + np.cov(self.beyond(self.influence).T) / len(self.values))

    def moved(self, change: State) -> Array:
        """Amplitudes of the same units where the state has changed by so much, to the first order."""
        return np.asarray(
            self.values
            + np.tensordot(change.deviation, self.by_process, (0, 1))
            + np.tensordot(change.compliance, self.by_compliance, (0, 1))
        )

    @cached_property
    def mean(self) -> Array:
        """Mean amplitudes that a lot shows, shape (d,)."""
        return np.asarray(self.values.mean(axis=0) * self.marked)

    @cached_property
    def about_mean(self) -> Array:
        """Amplitudes about their mean, shape (units, d)."""
        return self.values - self.mean


@dataclass(frozen=True)
class Simulator:
    """A lot's units under its conditions.

    Attributes
    ----------
    model : Model
    parts : UnitParts
    amplitudes : Amplitudes
        Whose conditions, orders and noise count.
    angles : int
        Of a turn, if it has so many samples.
    """

    model: Model
    parts: UnitParts
    amplitudes: Amplitudes
    angles: int = ANGLES

    @cached_property
    def _turns(self) -> list[LoadedTurn]:
        """A turn under each condition.

        Pins follow the profiles: without that order 77 of an RV-40E with pins of 3 um is 0.2 arcsec off.
        """
        model = replace(self.model, mechanism=curved(self.model.mechanism))
        every, angles = self.parts.placed, min(self.angles, self.amplitudes.samples)
        return [
            LoadedTurn.of(model, every, angles=angles, direction=c.direction, torque=c.torque, reads=True)
            for c in self.amplitudes.conditions
        ]

    @cached_property
    def scale(self) -> Array:
        """What whitens amplitudes, 1/rad, shape (d,)."""
        return 1 / np.sqrt(self.amplitudes.noise)

    def _loaded(self, compliance: Array) -> list[LoadedTurn]:
        """The turns with other stiffnesses."""
        changes = np.concatenate([compliance, np.zeros(len(SOFTENING) - len(compliance))])
        return [
            replace(turn, model=replace(turn.model, mechanism=softened(rv(turn.model.mechanism), changes)))
            for turn in self._turns
        ]

    def thinned(self, waves: Array) -> Simulator:
        """The same at every other angle, where these tell nearly all orders of such waveforms; and of those orders.

        Onto an order k folds what units have at n - k, n the angles: next to nothing between harmonics of the meshes.
        """
        amplitudes = self.amplitudes
        if waves.shape[-1] % 2 or waves.shape[-1] < ANGLES:
            return self
        full, half = (amplitudes.of_waves(some).reshape(len(some), -1) for some in (waves, waves[..., ::2]))
        own, off = full.var(axis=0) + amplitudes.noise, np.mean((half - full) ** 2, axis=0)
        clear = (amplitudes.of_order(off) < _FOLDED * amplitudes.of_order(own))[: len(amplitudes.orders)]
        if clear.mean() < _LEFT:
            return self
        return replace(self, amplitudes=amplitudes.of_orders(clear), angles=waves.shape[-1] // 2)

    def waveforms(self, state: State, standard: Array) -> Array:
        """Errors over a turn of units that have an equilibrium, rad, shape (units, conditions, n)."""
        turns = self._loaded(state.compliance)

        def solve(values: Array) -> Array | None:
            try:
                return np.array([turn.read(turn.state(values), values) for turn in turns])
            except NotConvergedError:
                return None

        return np.array([one for one in each(solve, list(self.errors(state, standard))) if one is not None])

    def values(self, state: State, standard: Array) -> Array:
        """Whitened amplitudes of units, of those that have an equilibrium, shape (units, d)."""
        return self.whitened(self.waveforms(state, standard))

    def whitened(self, waves: Array) -> Array:
        """Whitened amplitudes of waveforms, shape (units, conditions, n) to (units, d)."""
        return self.amplitudes.of_waves(waves).reshape(len(waves), -1) * self.scale

    def draws(self, state: State, standard: Array, near: Draws | None = None) -> Draws:
        """Units with what each process does to them; sought near those of the same standard draws, if given."""
        turns, errors, process = self._loaded(state.compliance), self.errors(state, standard), self.parts.process
        parts = standard * state.deviation[process]
        poses = near.poses if near is not None and len(near.poses) == len(standard) else [None] * len(standard)
        members = [np.flatnonzero(process == number) for number in range(len(self.parts.processes))]

        def solve(number: int) -> tuple[Array, ...] | None:
            try:
                waves, settled, value, influence, by_softening = self._solved(turns, errors[number], poses[number])
            except NotConvergedError:
                return None
            by_process = np.array([standard[number, some] @ influence[some] for some in members])
            return waves, settled, parts[number], value, influence, by_process, by_softening[:COMPLIANCES]

        solved = [one for one in each(solve, range(len(standard))) if one is not None]
        waves, poses, parts, values, rows, by_process, by_compliance = map(np.array, zip(*solved, strict=True))
        squares = np.empty((len(members), rows.shape[2], rows.shape[2]))
        for square, some in zip(squares, members, strict=True):
            mine = rows[:, some].reshape(-1, rows.shape[2])
            np.divide(mine.T @ mine, len(solved), out=square)
        squares = self.amplitudes.over_turns(squares)
        influence, marked = rows.mean(axis=0).T, self.amplitudes.marked
        return Draws(waves, poses, parts, values, by_process, by_compliance, influence, squares, marked)

    def linearised(self, errors: Array, softening: Array) -> tuple[Array, Array, Array]:
        """One unit with what each of its part errors does to it, and each of `SOFTENING`.

        Parameters
        ----------
        errors : ndarray, shape (components,)
            Core units.
        softening : ndarray, shape (10,)
            Changes of `SOFTENING` over the model.

        Returns
        -------
        values : ndarray, shape (d,)
            Whitened amplitudes.
        influence : ndarray, shape (components, d)
            Change per core unit of each component.
        by_softening : ndarray, shape (10, d)

        Raises
        ------
        NotConvergedError
            If it has no equilibrium.
        """
        return self._solved(self._loaded(softening), np.maximum(errors, self.parts.least))[2:]

    def _solved(
        self, turns: Sequence[LoadedTurn], errors: Array, near: Array | None = None
    ) -> tuple[Array, Array, Array, Array, Array]:
        """Waveforms and poses, and amplitudes as `linearised`."""
        found, waves, poses = [], [], []
        for number, turn in enumerate(turns):
            state = turn.state(errors, near=None if near is None else near[number], response=True)
            waves.append(turn.read(state, errors))
            poses.append(state.solution.x)
            changes = [waves[-1][None], state.influence().T, state.solution.softening.T]
            found.append(self.amplitudes.of_waves(np.concatenate(changes)))
        rows = np.concatenate(found, axis=1) * self.scale
        return np.array(waves), np.array(poses), rows[0], rows[1 : -len(SOFTENING)], rows[-len(SOFTENING) :]

    def errors(self, state: State, standard: Array) -> Array:
        """Errors of the parts about the drawing's means, core units, shape (units, components)."""
        return np.maximum(self.parts.middle + standard * state.deviation[self.parts.process], self.parts.least)


def as_stated(deviation: Array) -> State:
    """A state of the model's stiffness."""
    return State(deviation, np.zeros(COMPLIANCES))
