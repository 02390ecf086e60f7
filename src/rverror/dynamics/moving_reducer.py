"""A reducer on its bench in motion at a load: its loaded state, and what each of its errors does there."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.dynamics.loaded_motion import ReducedMotion, Share, held_waves, in_frames, loaded_motion
from rverror.dynamics.train import Train, loaded_reducer
from rverror.geartrain.contacts import pose
from rverror.geartrain.kinematics import fundamental_orders, samples_needed, true_period
from rverror.geartrain.mechanism import Reducer
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.model.readings import Stand, stand, unread
from rverror.statics.loaded_state import Settled, statics_of

#: Times the highest frequency that the meshes drive: modes up to there keep their inertia, the machine's first always.
REACH = 2.5
_MOST_ANGLES = 2**16  # of one period: two gigabytes
_AT_ONCE = 32  # parameters whose poses are held together


@dataclass(frozen=True)
class MovingReducer:
    """A reducer in motion about its loaded state.

    Attributes
    ----------
    unit : Reducer
    torque, direction : float
        N*mm; +1 or -1.
    period : int
        Output turns.
    where : Stand
    motion : ReducedMotion
    frequency : ndarray, shape (size,)
        Of the mean stiffness, Hz.
    of_sun_support : ndarray of bool, shape (size,)
    settled, halfway : Settled
        Loaded state at these angles and half a step further on.
    """

    unit: Reducer
    torque: float
    direction: float
    period: int
    where: Stand
    motion: ReducedMotion
    frequency: Array
    of_sun_support: npt.NDArray[np.bool_]
    settled: Settled
    halfway: Settled

    @property
    def theta(self) -> Array:
        """Nominal output angle as it is read, rad, (n,)."""
        return self.where.read.theta

    def turn(self, speed: float) -> float:
        """Speed of the output, signed, at an input speed."""
        return self.direction * speed / self.unit.ratio

    def shares(self, effects: Sequence[Effect]) -> Iterator[Share]:
        """What one unit of each parameter of effects does, the closed contacts held closed; sizes play no part.

        Effects that no contact feels do nothing here.
        """
        batch: list[Effect] = []
        for effect in effects:
            if batch and sum(len(one.values) for one in (*batch, effect)) > _AT_ONCE:
                yield from self._shares(tuple(batch))
                batch = []
            batch.append(effect)
        yield from self._shares(tuple(batch))

    def _shares(self, effects: tuple[Effect, ...]) -> Iterator[Share]:
        at, between = (one.pose_changes(effects) for one in (self.settled, self.halfway))
        whole = self.motion.whole
        for number in range(at.shape[2]):
            state = in_frames(whole.train, whole.train.pose(at[..., number]).T, whole.theta)
            course = held_waves(whole.train, state, between[..., number], whole.theta, whole.period)
            yield self.motion.share(state, course)

    def error(self, share: Share, speed: float) -> Array:
        """Output error of a share at an input speed, rad, (n,)."""
        return self.motion.share_error(share, self.turn(speed))


def moving_reducer(
    model: Model,
    *,
    torque: Any | None,
    direction: float,
    fastest: float,
    kept: int | None = None,
    causes: Sequence[Effect] = (),
) -> MovingReducer:
    """A reducer in motion about its loaded state.

    Parameters
    ----------
    model : Model
    torque : float or quantity, optional
        N*mm; the rated torque where left out.
    direction : float
        +1 or -1.
    fastest : float
        Highest input speed, rad/s: tells how many modes keep their inertia.
    kept : int, optional
        So many do.
    causes : sequence of Effect
        Others that the motion repeats with.

    Returns
    -------
    MovingReducer

    Raises
    ------
    InputError
        If the model is no reducer, there is no torque, or errors of the sun repeat after too many turns.
    NotConvergedError
        If there is no equilibrium at some angle.
    """
    unit, size = loaded_reducer(model, torque)
    period = _period((*unread(model).effects, *causes), unit)
    count = samples_needed(unit) * period
    theta = 2 * math.pi * period * np.arange(count) / count
    load = units.InCore(size)
    where, between = (
        stand(model, pose(unit, angle, torque=load, direction=direction)) for angle in (theta, theta + theta[1] / 2)
    )
    train = Train(unit, model.bench)
    settled, halfway = (statics_of(unit, one.gears).settled(model.effects) for one in (where, between))
    whole = loaded_motion(train, settled, where.gears.theta, 2 * math.pi * period, halfway.x)
    frequency, on_support = whole.mean_modes()
    if kept is None:
        driven = max(fundamental_orders(unit).values()) * fastest / unit.ratio / (2 * math.pi)
        first = int(np.flatnonzero((frequency > 0) & ~on_support)[0])
        kept = max(int((frequency <= REACH * driven).sum()), first + 1)
    motion = whole.reduced(max(kept, 1))
    return MovingReducer(unit, size, direction, period, where, motion, frequency, on_support, settled, halfway)


def _period(effects: Sequence[Effect], unit: Reducer) -> int:
    """Output turns after which the error repeats: one where nothing has a broken order, as the sun's may be."""
    turning = [(source(one.key), one.indices) for one in effects]
    orders = [order for entry, indices in turning for order in entry.orders(unit, indices)]
    # several planets hide some orders of the sun in what is told of it, and not in every error
    whole = all(float(order).is_integer() for order in orders) and all(entry.frame != "sun" for entry, _ in turning)
    period = 1 if whole else true_period(unit)
    if period * samples_needed(unit) > _MOST_ANGLES:
        raise InputError(
            f"ratio = {unit.ratio:g}: the error repeats after {period} output turns only, too many for one balance; "
            "leave out the errors that turn with the sun"
        )
    return period
