"""What a model predicts of the error, as waves under any condition; and what of it no table can take."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import brief
from rverror.compensation.correction import wave_sum
from rverror.geartrain.kinematics import Conditions, samples_needed, true_period
from rverror.geartrain.mechanism import Reducer
from rverror.model.catalogue import source
from rverror.model.compensation import WAVE
from rverror.model.effects import Effect, Model
from rverror.runs.order_table import TableCondition, Waves
from rverror.statics.prediction import predict

_TURN = 2 * math.pi
_LONGEST = 12  # output turns over which a model is looked at
_PLAIN = 2048  # samples a turn of a drive's model
_TINY = 1e-3  # of a model's largest wave: smaller ones are in no table


class PredictedWaves:
    """Waves of a model's effects under any condition, each solved once.

    Attributes
    ----------
    model : Model
    old : tuple of Effect
        Waves of a table that the unit has already.
    slow : tuple of Effect
        What no table takes.
    corrected : tuple of Effect
        The others: what a table takes off by their word.
    """

    def __init__(self, model: Model, notes: list[str], *, marked: bool) -> None:
        """Sort the effects; `marked`: whether the zero is on the gear's marks; `notes` take what is left out."""
        self.model = model
        self.old = tuple(e for e in model.effects if e.key == WAVE.key)
        self.slow = tuple(e for e in model.effects if _no_table_takes(e))
        self.corrected = tuple(e for e in model.effects if e not in self.old and e not in self.slow)
        if self.corrected and not marked and not any(source(e.key).acts == "marks" for e in self.corrected):
            notes.append("the zero is not on the gear's marks, so the model's effects predict no phase: left out")
            self.corrected = ()
        for effect in self.slow:
            slope = source(effect.key).follows == "angle"
            why = "an error that grows is mended by the ratio" if slope else "it follows time or speed, not the angle"
            notes.append(f"{effect.key} stays and is not counted: {why}")
        self._waves: dict[tuple[float, float | None], tuple[Array, Waves]] = {}

    @property
    def passive(self) -> tuple[Effect, ...]:
        """Effects that are no part of the correction: an earlier table, and what no table takes."""
        return (*self.old, *self.slow)

    def waves(self, condition: TableCondition) -> tuple[Array, Waves]:
        """Orders and waves of the output error, rad."""
        key = (condition.direction, condition.torque)
        if key not in self._waves:
            self._waves[key] = self._solved(condition) if self.corrected else (np.zeros(0), np.zeros(0, dtype=complex))
        return self._waves[key]

    def _solved(self, condition: TableCondition) -> tuple[Array, Waves]:
        mechanism = self.model.mechanism
        turns = true_period(mechanism)
        if turns > _LONGEST:
            raise InputError(
                f"ratio {brief(mechanism.ratio)}: all parts stand as before after {turns} output turns, more than "
                f"{_LONGEST}; remove the model's effects, so that the runs alone are compensated"
            )
        count = turns * (samples_needed(mechanism) if isinstance(mechanism, Reducer) else _PLAIN)
        theta = turns * _TURN * np.arange(count) / count
        where = Conditions(theta, condition.direction, condition.torque or None, temperature=condition.temperature)
        error = predict(replace(self.model, effects=self.corrected), where).transmission_error
        lines = 2 * np.fft.rfft(error)[1 : count // 2] / count
        strong = np.flatnonzero(np.abs(lines) > max(_TINY * np.abs(lines).max(), 1e-3 * _TINY * units.ARCSEC))
        return (strong + 1) / turns, np.asarray(lines[strong], dtype=np.complex128)

    def __call__(self, where: Conditions, condition: TableCondition) -> tuple[Array, Array]:
        """What the model makes of the error, and what of that no table can take, rad."""
        slow = self._added(self.slow, where)
        return wave_sum(where.theta, *self.waves(condition)) + slow + self._added(self.old, where), slow

    def _added(self, effects: tuple[Effect, ...], where: Conditions) -> Array:
        if not effects:
            return np.zeros(where.theta.size)
        return predict(replace(self.model, effects=effects), where).transmission_error


def _no_table_takes(effect: Effect) -> bool:
    entry = source(effect.key)
    return not entry.periodic or entry.follows != "angle"
