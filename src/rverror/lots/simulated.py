"""Units drawn from processes and solved at the load: amplitudes of their orders, and what each process does to them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from rverror.base.arrays import Array
from rverror.diagnosis.gears.reducers import curved
from rverror.diagnosis.gears.waveform import softened
from rverror.lots.amplitudes import Amplitudes
from rverror.lots.processes import UnitParts
from rverror.model.effects import Model
from rverror.statics.loaded_state import SOFTENING, NotConvergedError, each_solved
from rverror.tolerances.loaded_units import LoadedTurn

#: Stiffnesses that a lot's units share and the model states wrongly: those of `SOFTENING`.
COMPLIANCES = 6
_ANGLES = 512  # of a turn at most; orders above 312, which fold onto those up to 200, are below the noise


@dataclass(frozen=True)
class State:
    """What the processes make, and the stiffness of all units.

    Attributes
    ----------
    deviation : ndarray, shape (processes,)
        Standard deviations, core units.
    compliance : ndarray, shape (6,)
        Logarithms of compliances over those of the model, which it has where left out; all of `SOFTENING` may be given.
    """

    deviation: Array
    compliance: Array = field(default_factory=lambda: np.zeros(COMPLIANCES))


class SolvedUnit(NamedTuple):
    """A unit, whitened, and how it changes."""

    values: Array  # (d,)
    influence: Array  # (components, d), per core unit of each


Solve = Callable[[Array], SolvedUnit | None]  #: of part errors, core units; None where there is no equilibrium


@dataclass(frozen=True)
class Draws:
    """Solved units of a state, whitened: divided by the root of the noise's variance.

    Attributes
    ----------
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
    """

    values: Array
    by_process: Array
    by_compliance: Array
    influence: Array
    squares: Array

    def covariance(self, deviation: Array) -> Array:
        """Covariance, noise included, were all linear: no contact that opens makes it smaller, shape (d, d)."""
        return np.asarray(np.einsum("c,cde->de", deviation**2, self.squares) + np.eye(self.values.shape[1]))

    def mean_covariance(self, units: int) -> Array:
        """Covariance of the mean of so many units with noise, less that of these draws, shape (d, d)."""
        return np.asarray((np.cov(self.values.T) + np.eye(self.values.shape[1])) * (1 / units + 1 / len(self.values)))

    @cached_property
    def mean(self) -> Array:
        """Mean amplitudes, shape (d,); a lot shows them only where marks are known."""
        return np.asarray(self.values.mean(axis=0))


@dataclass(frozen=True)
class Simulator:
    """A lot's units under its conditions.

    Attributes
    ----------
    model : Model
    parts : UnitParts
    amplitudes : Amplitudes
        Whose conditions, orders and noise count.
    """

    model: Model
    parts: UnitParts
    amplitudes: Amplitudes

    @cached_property
    def _turns(self) -> list[LoadedTurn]:
        """A turn under each condition.

        Pins follow the profiles: without that order 77 of an RV-40E with pins of 3 um is 0.2 arcsec off.
        """
        model = replace(self.model, mechanism=curved(self.model.mechanism))
        every, angles = self.parts.effects, min(_ANGLES, self.amplitudes.samples)
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
            replace(turn, statics=turn.statics.elastic(softened(turn.statics.reducer, changes))) for turn in self._turns
        ]

    def waveforms(self, state: State, standard: Array) -> Array:
        """Errors over a turn of units that have an equilibrium, rad, shape (units, conditions, n).

        Raises
        ------
        NotConvergedError
            If none has one.
        """
        turns = self._loaded(state.compliance)
        found = each_solved(lambda errors: self._waves(turns, [errors]), list(self.errors(state, standard)))
        if not found:
            raise NotConvergedError(f"none of {len(standard)} units has an equilibrium; check the model")
        return np.array(found)

    def values(self, state: State, standard: Array) -> Array:
        """Whitened amplitudes of units, of those that have an equilibrium, shape (units, d)."""
        waves = self.waveforms(state, standard)
        return self.amplitudes.of_waves(waves).reshape(len(waves), -1) * self.scale

    def draws(self, state: State, standard: Array) -> Draws:
        """Units with what each process does to them."""
        turns, errors, process = self._loaded(state.compliance), self.errors(state, standard), self.parts.process
        members = [np.flatnonzero(process == number) for number in range(len(self.parts.processes))]

        def solve(number: int) -> tuple[Array, Array, Array, Array]:
            value, influence, by_softening = self._solved(turns, errors[number])
            by_process = np.array([standard[number, some] @ influence[some] for some in members])
            return value, influence, by_process, by_softening[:COMPLIANCES]

        solved = each_solved(solve, range(len(standard)))
        values, rows, by_process, by_compliance = (np.array(column) for column in zip(*solved, strict=True))
        squares = np.empty((len(members), rows.shape[2], rows.shape[2]))
        for square, some in zip(squares, members, strict=True):
            mine = rows[:, some].reshape(-1, rows.shape[2])
            np.divide(mine.T @ mine, len(solved), out=square)
        squares = self.amplitudes.over_turns(squares)
        return Draws(values, by_process, by_compliance, rows.mean(axis=0).T, squares)

    def raised(self, state: State, standard: Array, deviation: Array) -> Array:
        """Whitened amplitudes of units with one process at a time none, and raised with its draws and with minus these.

        Parameters
        ----------
        state : State
        standard : ndarray, shape (units, components)
        deviation : ndarray, shape (processes,)
            To which a process is raised; those of 0 are not.

        Returns
        -------
        ndarray, shape (raised processes, 3, units, d)
            Of units that have an equilibrium in all cases.
        """
        turns = self._loaded(state.compliance)
        every = [
            np.where(np.arange(len(deviation)) == at, sign * deviation, state.deviation)
            for at in np.flatnonzero(deviation)
            for sign in (0.0, 1.0, -1.0)
        ]
        sizes, places = np.unique(every, axis=0, return_inverse=True)  # without a process that is none all are one

        def solve(row: Array) -> Array:
            return self._waves(turns, [self.errors(replace(state, deviation=one), row) for one in sizes])

        waves = np.array(each_solved(solve, list(standard)))
        values = self.amplitudes.of_waves(waves).reshape(len(waves), len(sizes), -1)[:, places] * self.scale
        return np.moveaxis(values.reshape(len(waves), -1, 3, len(self.scale)), 0, 2)

    def shift_effects(self, state: State, standard: Array, shifts: Array, influence: Array) -> Array:
        """What shifts of the parts and their opposites change of units' whitened amplitudes.

        As far as a unit's own influences tell its change, it is that of as many units as the mean influences are of (a
        control variate): of small shifts the mean is as exact as these, where contacts open they are no help.

        Parameters
        ----------
        state : State
        standard : ndarray, shape (units, components)
        shifts : ndarray, shape (shifts, components)
            Core units.
        influence : ndarray, shape (d, components)
            Mean change per core unit of each component, of many units.

        Returns
        -------
        ndarray, shape (units, shifts, 2, d)
            A unit without an equilibrium with a shift has the mean of the others; as influences say where none has one.
        """
        turns, both = self._loaded(state.compliance), np.stack([shifts, -shifts], axis=1)
        expected = both @ influence.T

        def solve(row: Array) -> Array:
            errors = self.errors(state, row)
            values, own, _ = self._solved(turns, errors)
            found = np.full((2, *expected.shape), np.nan)
            for at in np.ndindex(both.shape[:2]):
                with suppress(NotConvergedError):
                    moved = np.maximum(errors + both[at], self.parts.least)
                    found[0][at] = self.amplitudes.of_waves(self._waves(turns, [moved])).ravel() * self.scale - values
                    found[1][at] = (moved - errors) @ own
            return found

        changes, linear = np.moveaxis(np.array(each_solved(solve, list(standard))), 1, 0)
        known = np.isfinite(changes)
        counts = np.maximum(known.sum(axis=0), 1)
        changes, linear = (np.where(known, some - expected, 0.0) for some in (changes, linear))
        means = changes.sum(axis=0) / counts, linear.sum(axis=0) / counts
        changes, linear = ((some - mean) * known for some, mean in zip((changes, linear), means, strict=True))
        alike = np.sum(changes * linear, axis=(0, -1)) / np.maximum(np.sum(linear**2, axis=(0, -1)), 1e-300)
        return np.asarray(expected + changes + means[0] - alike[..., None] * (linear + means[1]))

    def mean_change(self, state: State, standard: Array, shift: Array) -> Array:
        """What a shift of the parts changes of units' whitened amplitudes, in the mean of those that have an
        equilibrium, shape (d,); `NotConvergedError` if none has one."""
        turns = self._loaded(state.compliance)

        def solve(errors: Array) -> Array:
            moved = np.maximum(errors + shift, self.parts.least)
            return self._waves(turns, [moved]) - self._waves(turns, [errors])

        found = each_solved(solve, list(self.errors(state, standard)))
        if not found:
            raise NotConvergedError(f"none of {len(standard)} units has an equilibrium with the shift")
        return np.asarray(self.amplitudes.of_waves(np.mean(found, axis=0)).ravel() * self.scale)

    @staticmethod
    def _waves(turns: Sequence[LoadedTurn], units: Iterable[Array]) -> Array:
        """Errors over a turn of units under each condition, rad, shape (units * conditions, n)."""
        return np.array([turn.read(turn.state(errors), errors) for errors in units for turn in turns])

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
        return self._solved(self._loaded(softening), np.maximum(errors, self.parts.least))

    def linearised_at(self, state: State, root: Array) -> Solve:
        """What solves units of the state with errors given, and stiffnesses that are a little off, to first order.

        Parameters
        ----------
        state : State
        root : ndarray, shape (6, 6)
            Of the covariance of the logarithms of compliances: of its columns the errors have so many, behind those of
            the parts.

        Returns
        -------
        callable
            None is of a unit without equilibrium.
        """
        turns, count = self._loaded(state.compliance), len(self.parts.process)

        def solve(errors: Array) -> SolvedUnit | None:
            try:
                values, influence, by_softening = self._solved(turns, np.maximum(errors[:count], self.parts.least))
            except NotConvergedError:
                return None
            softer = root.T @ by_softening[:COMPLIANCES]
            return SolvedUnit(values + errors[count:] @ softer, np.concatenate([influence, softer]))

        return solve

    def _solved(self, turns: Sequence[LoadedTurn], errors: Array) -> tuple[Array, Array, Array]:
        found = []
        for turn in turns:
            state = turn.state(errors, response=True)
            waves = [turn.read(state, errors)[None], state.influence().T, state.solution.softening.T]
            found.append(self.amplitudes.of_waves(np.concatenate(waves)))
        rows = np.concatenate(found, axis=1) * self.scale
        return rows[0], rows[1 : -len(SOFTENING)], rows[-len(SOFTENING) :]

    def errors(self, state: State, standard: Array) -> Array:
        """Errors of the parts about the drawing's means, core units, shape (units, components)."""
        return np.maximum(self.parts.middle + standard * state.deviation[self.parts.process], self.parts.least)
