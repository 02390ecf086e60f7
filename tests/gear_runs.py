"""Runs of a small reducer, simulated with stiffness that is not the declared one and noise that has a colour."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.signal import lfilter

import rverror
from rverror.base.arrays import Array
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.fit import Fit, RunSet, evaluated, first_state, fitted, with_estimated_noise
from rverror.diagnosis.gears.record import Record, records_of
from rverror.diagnosis.gears.reducers import offered
from rverror.diagnosis.gears.search import Search
from rverror.diagnosis.gears.waveform import softened
from rverror.diagnosis.journal import Journal
from rverror.diagnosis.policy import POLICY, Policy
from rverror.model.effects import Effect, Model

TURN = 2 * math.pi
#: Few pins, so that it is solved quickly: ratio 49.
UNIT = rverror.Reducer(
    sun_teeth=9,
    planet_teeth=27,
    module=1.5,
    pressure_angle=math.radians(20),
    disc_lobes=15,
    pins=16,
    pin_circle_radius=64.0,
    pin_radius=5.0,
    eccentricity=2.4,
    cranks=2,
    discs=2,
    spline_radius=7.0,
    gear_backlash=0.02,
)
#: Six compliances, backlash, contact law: off by one or two of what they are uncertain by.
OFF = np.array([0.3, -0.25, 0.2, -0.3, 0.1, 0.0, 0.006, 0.1, 0.0, 0.0])
#: With other stiffness than is declared.
OTHER = softened(UNIT, OFF)
BARE = Model(UNIT)
CAM = rverror.effect("crank.eccentricity", crank=0, disc=0, radial="8 um", tangential="-5 um")
USUAL, LIGHT = ((1.0, 50e3), (-1.0, 50e3)), ((1.0, 20e3), (-1.0, 20e3))


def red(seed: int, n: int, rms: float = 0.3, memory: float = 0.7) -> Array:
    """Coloured noise: each sample remembers the one before; rms in arcsec, result in rad."""
    white = np.random.default_rng(seed).normal(size=n + 200)
    return np.asarray(lfilter([1.0], [1.0, -memory], white)[200:] * rms * ARCSEC * math.sqrt(1 - memory**2))


def runs_of(
    model: rverror.Model,
    conditions: Sequence[tuple[float, float]] = USUAL,
    *,
    points: int = 512,
    turns: float = 1.0,
    start: float = 0.0,
    rms: float = 0.3,
    seed: int = 0,
    marks: float = 0.0,
    more: Callable[[Array, Array], Array] | None = None,
    **told: Any,
) -> list[rverror.Run]:
    """One run for each direction and torque, as a bench would record it.

    `marks` is the angle by which the gear's marks are ahead of the bench's zero; `more` is what is added to the error,
    rad, over angle and share of the run.
    """
    result = []
    for number, (direction, torque) in enumerate(conditions):
        n = round(points * turns)
        theta = start + TURN / points * np.arange(n)
        if direction < 0:
            theta = theta[::-1].copy()
        error = rverror.equilibrium(model, theta + marks, torque=torque, direction=direction).transmission_error
        error = error + red(97 * seed + number, n, rms)
        if more is not None:
            error = error + more(theta, np.arange(n) / n)
        result.append(
            rverror.run_from_arrays(
                input_angle=UNIT.ratio * theta if "ratio" not in told else told["ratio"] * theta,
                output_angle=theta + error,
                direction=direction,
                torque=torque,
                index=told.get("index", ""),
            )
        )
    return result


def begin(model: rverror.Model, runs: Sequence[rverror.Run], *, policy: Policy = POLICY, points: int = 1024) -> Fit:
    """First state of a fit to runs."""
    records, _ = records_of(model, runs)
    return first_state(RunSet.of(model.mechanism, records, policy, points=points, anywhere=False), model, model)


def record_of(error: Array, theta: Array | None = None, **more: Any) -> Record:
    """A record of an error alone, over one turn."""
    n = error.size
    theta = TURN * np.arange(n) / n if theta is None else theta
    return Record("run 1", theta, error, 1.0, 50e3, np.ones(n, dtype=np.bool_), **more)


def settled(
    true: Model,
    *added: Effect,
    declared: Model = BARE,
    conditions: Sequence[tuple[float, float]] = USUAL,
    points: int = 512,
    **more: Any,
) -> Fit:
    """The fit of runs with these effects added, and with the noise that they leave."""
    first = begin(declared, runs_of(true, conditions, points=points, **more), points=points)
    start = replace(first.model, effects=(*declared.effects, *added))
    return fitted(with_estimated_noise(fitted(evaluated(first.run_set, start, declared), steps=30)), steps=30)


def beside(fit: Fit, *added: Effect) -> Fit:
    """What is declared of a fit with other effects added, fitted under the same noise."""
    start = replace(fit.declared, effects=(*fit.declared.effects, *added))
    return fitted(evaluated(fit.run_set, start, fit.declared), steps=30)


def search_of(fit: Fit, keys: Collection[str] = (), *, offsets: Sequence[float] = (), **rules: Any) -> Search:
    """A search from what is declared, under the noise of a fit, for causes of some keys or of all."""
    policy = replace(POLICY, keys=tuple(keys), **rules)
    candidates = offered(fit.declared, fit.run_set.records, policy.tries)
    return Search(beside(fit), candidates, policy, Journal(quiet), offsets)


def quiet(_: str) -> None:
    """Nobody listens."""
