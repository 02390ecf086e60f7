"""Runs as a table would hold them, by the orders of their frames or shafts: passport, and natural frequencies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rverror.base.errors import InputError
from rverror.diagnosis.order_passport import OrderPassport, passport
from rverror.diagnosis.orders.critical_conditions import critical_notes
from rverror.diagnosis.orders.resonances import Resonance, resonances_of, slowest
from rverror.diagnosis.policy import Policy
from rverror.geartrain.kinematics import fundamental_orders
from rverror.geartrain.mechanism import Mechanism, Reducer
from rverror.model.effects import Model
from rverror.runs.measurement import Run
from rverror.runs.order_fit import order_table_from_runs
from rverror.runs.order_table import OrderTable

_FRAMES = ("output", "housing", "crank", "sun")  # one of each order: carrier and disc have the crank's
_HARMONICS = (1, 2)
_SEEN_AT_SPEED = tuple(range(1, 9))  # the higher a harmonic, the lower the speed at which it meets a frequency
_SAMPLES_A_WAVE = 5  # below it a wave is told by how the samples happen to lie
#: Waves over the travel that an order needs on less than a turn: what is slow is then taken off by a polynomial of
#: degree 4 or more, which of an order 1 over a third of a turn leaves less than a thousandth.
_WAVES = 4


def passport_of_runs(unit: Mechanism, runs: Sequence[Run]) -> tuple[OrderPassport, ...]:
    """Passport of the orders of frames or shafts, once and twice; empty where the runs do not make an order table.

    Parameters
    ----------
    unit : Reducer or Drive
    runs : sequence of Run
        Readings that were set aside by a diagnosis are in them: intervals are then wide.

    Returns
    -------
    tuple of OrderPassport
        The strongest first.
    """
    try:
        return passport(_table(unit, runs, _HARMONICS).cases, ratio=unit.ratio)
    except InputError:  # runs that turn both ways, two of one condition, zeros of several labels
        return ()


def _table(unit: Mechanism, runs: Sequence[Run], harmonics: Sequence[int]) -> OrderTable:
    """Waves of the orders that all runs tell."""
    steps = [max(float(np.ptp(run.nominal_angle(unit))) / max(run.size - 1, 1), 1e-12) for run in runs]
    turns = [step * run.size / (2 * np.pi) for run, step in zip(runs, steps, strict=True)]
    samples = 2 * np.pi / max(steps)  # a turn
    travel, orders = min(turns), {h * order for order in _orders(unit) for h in harmonics}
    least = 1 if travel > 1 - 1e-9 else _WAVES
    distinct = [
        order for order in sorted(orders)
        if order * travel >= least - 1e-9 and order * _SAMPLES_A_WAVE < samples
        if all(abs(order - other) * travel >= 1 - 1e-9 for other in orders - {order})
    ]  # fmt: skip
    return order_table_from_runs(runs, unit, distinct)


def _orders(unit: Mechanism) -> set[float]:
    """Waves per output turn of what turns once."""
    if isinstance(unit, Reducer):
        of_frame = fundamental_orders(unit)
        return {of_frame[frame] for frame in _FRAMES}
    return {1.0, abs(unit.ratio), *map(abs, unit.shafts.values())}


def resonances_of_runs(
    model: Model, runs: Sequence[Run], *, policy: Policy
) -> tuple[tuple[Resonance, ...], tuple[str, ...], list[Run]]:
    """Natural frequencies that runs of several speeds show, what is said of them, and the runs that tell causes.

    Parameters
    ----------
    model : Model
        Of a reducer.
    runs : sequence of Run
        With time, or they have no speed.
    policy : Policy

    Returns
    -------
    tuple of Resonance
        None where the runs do not make an order table.
    tuple of str
    list of Run
        All, or where there is a natural frequency the slowest of those that differ in speed alone: there it adds least.
    """
    unit, every = model.mechanism, list(runs)
    if sum(run.time is not None for run in runs) < 2:
        return (), (), every
    try:
        cases = _table(unit, runs, _SEEN_AT_SPEED).cases
    except InputError:  # as for a passport
        return (), (), every
    found = resonances_of(cases, ratio=unit.ratio, policy=policy)
    notes = critical_notes(model, cases, found)
    if not found:
        return found, tuple(notes), every
    slow = [runs[at] for at in slowest(cases)]
    if len(slow) < len(every):
        notes.append(
            f"runs differ in speed: causes are looked for in the slowest of each direction, load and temperature, "
            f"{len(slow)} of {len(every)}, to which the natural frequency adds least; a table of all runs "
            "(rverror.runs.order_table_from_runs) takes off what it adds"
        )
    return found, tuple(notes), slow
