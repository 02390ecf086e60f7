"""Runs whose zero is not on the gear's marks: angles at which the declared errors would stand as they were measured."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rverror.base.arrays import Array
from rverror.diagnosis.fit import FitRun
from rverror.geartrain.kinematics import fundamental_orders, true_period
from rverror.geartrain.mechanism import Reducer
from rverror.model import sensor
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.model.readings import beyond, felt

_POINTS = 2**15  # angles a period at which the declared waveform is laid over the measured one
_AROUND = 6  # angles a turn of the crank
_ANYWHERE = math.pi  # uncertainty of an offset of which nothing is known, rad


def index_offsets(model: Model, unit: Reducer, runs: Sequence[FitRun]) -> list[Effect]:
    """Likely offsets of the gear's marks from the bench's zero, the likeliest first.

    The declared waveform is turned against the measured one; the sum of squares over all runs, in units of their
    noise, has a minimum at each likely angle:

        sum_k w_k |Y_k - G_k exp(i k phi)|^2 = const - 2 Re sum_k w_k conj(Y_k) G_k exp(i k phi).

    Parameters
    ----------
    model : Model
        Declared, with its zero on the marks.
    unit : Reducer
    runs : sequence of FitRun
        All of one zero.

    Returns
    -------
    list of Effect
        ``sensor.index_offset``; one of 0 where nothing that is declared shows.

    Notes
    -----
    The gear train has one degree of freedom, so one angle is all that can be unknown.  Where all that is declared
    repeats with the crank it is known but for whole turns of the crank against the carrier, which differ in no
    declared waveform: the least one is given.
    """
    gears = replace(model, effects=felt(model.effects))
    read = replace(model, effects=beyond(model.effects))
    turns = true_period(unit)
    match = np.zeros(_POINTS)
    for run in runs:
        wave = run.predictor.predict(gears).transmission_error
        rest = run.values.mean(axis=0) - run.predictor.predict(read).transmission_error
        count = min(run.noise.size, _POINTS // 2 - 1)
        product = np.conj(np.fft.rfft(rest))[1 : count + 1] * np.fft.rfft(wave)[1 : count + 1]
        lines = np.zeros(_POINTS, dtype=np.complex128)
        lines[1 : count + 1] = product * run.periods / run.noise[:count] * 2 / wave.size
        match += (np.fft.ifft(lines) * _POINTS).real
    if np.ptp(match) < 1.0:
        return [_offset(0.0)]
    repeat = math.ceil(_POINTS / fundamental_orders(unit)["crank"] / turns)
    if all(source(e.key).repeats_with_crank(unit, e.indices) for e in gears.effects):
        match = match[:repeat]
    # what is missing may turn the match: angles around the best one compete too
    around = [(_peaks(match)[0] + i * repeat // _AROUND) % match.size for i in range(1, _AROUND)]
    places = list(dict.fromkeys([*_peaks(match)[:_AROUND], *around]))
    return [_offset(2 * math.pi * turns * at / _POINTS) for at in places]


def _peaks(match: Array) -> list[int]:
    """Places of the local maxima of a row that closes on itself, the highest first."""
    high = np.flatnonzero((match >= np.roll(match, 1)) & (match > np.roll(match, -1)))
    return [int(at) for at in high[np.argsort(-match[high], kind="stable")]]


def _offset(angle: float) -> Effect:
    return Effect(sensor.MARKS.key, {}, (angle,), _ANYWHERE, "found by rverror diagnose: index unknown")
