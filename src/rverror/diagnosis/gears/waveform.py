"""The gear train under the conditions of a run, solved where the joint went, with every change that a fit asks for."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rverror.base.arrays import Array
from rverror.diagnosis.gears.grid import AngleGrid, whole
from rverror.geartrain.action_line import ContactForces
from rverror.geartrain.contacts import closed_form_forces, motion
from rverror.geartrain.kinematics import OperatingConditions, Pose, fundamental_orders
from rverror.geartrain.mechanism import LAW_BOUNDS, ContactLaw, Mechanism, Reducer, Stiffness
from rverror.geartrain.torque_over_turn import TorqueWaves
from rverror.model.catalogue import source
from rverror.model.compose import effect_matrix
from rverror.model.effects import Effect
from rverror.statics.loaded_state import SOFTENING, Statics, statics_of
from rverror.statics.prediction import turned

_REPEAT_POINTS = 256  # angles of one turn of the crank: five times as dense as 2048 a turn
_DENSER = 5  # than the grid of the travel, where that is coarse


def conditions_at(
    theta: Array, direction: float | Array, torque: float | TorqueWaves | None, time: Array | None = None
) -> OperatingConditions:
    """Conditions under a torque, or one over the angle."""
    if isinstance(torque, TorqueWaves):
        return OperatingConditions(theta, direction, time=time, load=torque(theta))
    return OperatingConditions(theta, direction, torque, time)


#: Least and largest of each of `SOFTENING`, in the units of `soft_values`.
SOFT_BOUNDS = np.array([(-math.inf, math.inf)] * 6 + [(0.0, math.inf), *(ends[:2] for ends in LAW_BOUNDS.values())])


def soft_values(unit: Mechanism) -> Array:
    """Each of `SOFTENING`: logarithms of six compliances, backlash, contact law, shape (10,); of a drive nothing."""
    if not isinstance(unit, Reducer):
        return np.zeros(len(SOFTENING))
    stiffness, law = vars(unit.stiffness), vars(unit.contact_law)
    compliances = [-math.log(stiffness[name]) for name in SOFTENING[:6]]
    return np.array([*compliances, unit.gear_backlash, *(law[name] for name in SOFTENING[7:])])


def softened(unit: Reducer, change: Array) -> Reducer:
    """The reducer with each of `SOFTENING` changed, within their bounds."""
    values = dict(zip(SOFTENING, np.clip(soft_values(unit) + change, *SOFT_BOUNDS.T).tolist(), strict=True))
    softer = dict(zip(SOFTENING, change, strict=True))
    stiffness = {name: value * math.exp(-softer[name]) for name, value in vars(unit.stiffness).items()}
    law = ContactLaw(**{name: values[name] for name in LAW_BOUNDS})
    return replace(unit, stiffness=Stiffness(**stiffness), contact_law=law, gear_backlash=values["gear_backlash"])


@dataclass(frozen=True, eq=False)
class Waveform:
    """Output error of a gear train over a grid, and its changes.

    Attributes
    ----------
    grid : AngleGrid
    error : ndarray, shape (points,)
        rad.
    rows : ndarray, shape (parameters, points)
        Change per parameter of each effect that the contacts feel.
    soft : ndarray, shape (10, points)
        Change per unit of each of `SOFTENING`.
    effects : tuple of Effect
        Felt by the contacts.
    unit : Reducer
    poses : ndarray, optional
    """

    grid: AngleGrid
    error: Array
    rows: Array
    soft: Array
    effects: tuple[Effect, ...]
    unit: Reducer
    poses: Array | None = None

    @property
    def bare(self) -> Waveform:
        """The error alone."""
        return replace(self, rows=self.rows[:0], soft=self.soft[:0], poses=None)


@dataclass(frozen=True, eq=False)
class LoadCase:
    """One direction and torque, or torque over the angle, in a stretch of travel: what every solution shares.

    Attributes
    ----------
    direction : float
    torque : float or TorqueWaves, optional
        N*mm; None for the closed form.
    turn : AngleGrid
        Over the angles that were travelled, or one turn.
    """

    direction: float
    torque: float | TorqueWaves | None
    turn: AngleGrid
    _kept: dict[AngleGrid, Statics] = field(default_factory=dict, repr=False)
    _coarser: dict[int, LoadCase] = field(default_factory=dict, repr=False)

    def coarser(self, points: int) -> LoadCase:
        """The same on so many angles a turn, if that is fewer; made once."""
        if points not in self._coarser:
            turn = self.turn.coarser(points)
            self._coarser[points] = self if turn == self.turn else LoadCase(self.direction, self.torque, turn)
        return self._coarser[points]

    def repeat(self, unit: Reducer) -> AngleGrid:
        """One turn of the crank against the carrier."""
        period = 2 * math.pi / fundamental_orders(unit)["crank"]
        return whole(self.turn.start, period, min(_REPEAT_POINTS, math.ceil(_DENSER * period / self.turn.step)))

    def grid(self, unit: Reducer, effects: Sequence[Effect]) -> AngleGrid:
        """Where the gear train is solved: over one turn of the crank, if all errors repeat with it."""
        alike = all(source(e.key).repeats_with_crank(unit, e.indices) for e in effects)
        return self.repeat(unit) if alike and isinstance(self.torque, float) else self.turn

    def _statics(self, unit: Reducer, grid: AngleGrid) -> Statics:
        """Statics over a grid: geometry is made once, what the stiffness changes only where it does."""
        made = self._kept.get(grid)
        if made is None:
            made = statics_of(unit, conditions_at(grid.theta, self.direction, self.torque))
        self._kept[grid] = made = made.elastic(unit)
        return made

    def motion(self, unit: Reducer, grid: AngleGrid) -> Pose:
        """Motion over a grid."""
        return motion(unit, conditions_at(grid.theta, self.direction, self.torque))

    def solve(self, unit: Reducer, effects: tuple[Effect, ...], near: Waveform | None = None) -> Waveform:
        """Waveform with these effects, all felt by the contacts; from poses near it where there are."""
        grid = self.grid(unit, effects)
        if self.torque is None:
            where = self.motion(unit, grid)
            rows = effect_matrix(where, closed_form_forces(where), effects)
            values = np.array([v for e in effects for v in e.values])
            return Waveform(grid, values @ rows, rows, np.zeros((len(SOFTENING), grid.points)), effects, unit)
        solved = self._statics(unit, grid).predict(effects, self._near(near, grid))
        assert solved.softening is not None
        return Waveform(grid, solved.transmission_error, solved.matrix, solved.softening, effects, unit, solved.poses)

    def _near(self, near: Waveform | None, grid: AngleGrid) -> Array | None:
        return None if near is None else near.poses if near.grid == grid else self._carried(near, grid)

    def _carried(self, near: Waveform, grid: AngleGrid) -> Array | None:
        """Poses over one turn of the crank at the angles of another grid: after each the gear train stands as it did,
        turned with the carrier."""
        if near.poses is None or not near.grid.closed or near.grid.points == self.turn.points:
            return None
        still = turned(near.unit, near.poses, near.grid.start - near.grid.theta)
        at = grid.theta - near.grid.start
        return turned(near.unit, near.grid.to_samples(grid.theta)(still.T).T, at)

    def forces(self, wave: Waveform) -> tuple[Pose, ContactForces]:
        """Motion and forces per unit torque over the whole grid of travel, in the state of a waveform."""
        where = self.motion(wave.unit, self.turn)
        if self.torque is None:
            return where, closed_form_forces(where)
        statics = self._statics(wave.unit, self.turn)
        start = wave.poses if wave.grid == self.turn else self._carried(wave, self.turn)
        return statics.motion, statics.settled(wave.effects, start, response=True).forces_per_torque()
