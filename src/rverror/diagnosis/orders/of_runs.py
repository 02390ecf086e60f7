"""Runs as a table would hold them, by the orders of their frames or shafts: passport, and natural frequencies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.diagnosis.order_passport import OrderPassport, passport
from rverror.diagnosis.orders.critical_conditions import critical_notes
from rverror.diagnosis.orders.resonances import Resonance, resonances_of, resonant_parts
from rverror.diagnosis.policy import Policy
from rverror.diagnosis.result import Diagnosis, Residual, Trace
from rverror.geartrain.kinematics import fundamental_orders
from rverror.geartrain.mechanism import Mechanism, Reducer
from rverror.model.effects import Model
from rverror.runs.measurement import Run
from rverror.runs.order_fit import order_table_from_runs
from rverror.runs.order_table import OrderTable, Waves

_FRAMES = ("output", "housing", "crank", "sun")  # one of each order: carrier and disc have the crank's
_HARMONICS = (1, 2)
_SEEN_AT_SPEED = (1, 2, 3, 4, 5, 6)  # the higher a harmonic, the lower the speed at which it meets a frequency
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
    told = [
        order for order in sorted(orders)
        if order * travel >= least - 1e-9 and order * _SAMPLES_A_WAVE < samples
        if all(abs(order - other) * travel >= 1 - 1e-9 for other in orders - {order})
    ]  # fmt: skip
    return order_table_from_runs(runs, unit, told)


def _orders(unit: Mechanism) -> set[float]:
    """Waves per output turn of what turns once."""
    if isinstance(unit, Reducer):
        of_frame = fundamental_orders(unit)
        return {of_frame[frame] for frame in _FRAMES}
    return {1.0, abs(unit.ratio), *map(abs, unit.shafts.values())}


@dataclass(frozen=True, eq=False)
class RunsAtSpeed:
    """Runs of several speeds, and what natural frequencies add to them.

    Attributes
    ----------
    runs : tuple of Run
        Without it.
    found : tuple of Resonance
    orders : ndarray, shape (k,)
    waves : tuple of ndarray of complex, shape (k,)
        What is taken off each run, rad.
    notes : tuple of str
    """

    runs: tuple[Run, ...]
    found: tuple[Resonance, ...]
    orders: Array
    waves: tuple[Waves, ...]
    notes: tuple[str, ...]

    def added(self, number: int, theta: Array) -> Array:
        """What natural frequencies add to a run at output angles, rad."""
        return np.asarray((self.waves[number] @ np.exp(1j * np.outer(self.orders, theta))).real)

    def as_measured(self, result: Diagnosis) -> Diagnosis:
        """The diagnosis of `runs` as one of the runs as measured: the declared model lacks what was taken off."""
        if not self.found:
            return replace(result, notes=(*result.notes, *self.notes))
        rows = [self.added(number, trace.theta) for number, trace in enumerate(result.traces)]
        traces = tuple(map(_with, result.traces, rows))
        return replace(
            result,
            before=_larger(result.before, result.traces, traces),
            before_refitted=_larger(result.before_refitted, result.traces, traces),
            traces=traces,
            resonances=self.found,
            notes=(*result.notes, *self.notes),
        )


def _with(trace: Trace, row: Array) -> Trace:
    left = trace.left_out and (trace.left_out[0] + row, trace.left_out[1])
    return replace(trace, measured=trace.measured + row, after=trace.after + row, left_out=left)


def _larger(size: Residual, without: Sequence[Trace], traces: Sequence[Trace]) -> Residual:
    """Sizes of a residual with what was taken off, by what that changes of the means over the turns."""

    def sizes(those: Sequence[Trace]) -> tuple[float, float]:
        rests = [trace.measured - trace.before for trace in those]
        return float(np.mean([np.mean(rest**2) for rest in rests])), max(float(np.ptp(rest)) for rest in rests)

    (power, peak), (whole, high) = sizes(without), sizes(traces)
    rms, held = (float(np.sqrt(max(one**2 + whole - power, 0.0))) for one in (size.rms, size.heldout_rms))
    return Residual(rms, size.peak_to_peak + high - peak, held)


def runs_at_speed(model: Model, runs: Sequence[Run], *, policy: Policy) -> RunsAtSpeed:
    """Find natural frequencies that runs of several speeds show, and take off what they add.

    Parameters
    ----------
    model : Model
        Of a reducer.
    runs : sequence of Run
        With time, or they have no speed.
    policy : Policy
    """
    none = RunsAtSpeed(tuple(runs), (), np.zeros(0), (), ())
    if sum(run.time is not None for run in runs) < 2:
        return none
    unit = model.mechanism
    try:
        cases = _table(unit, runs, _SEEN_AT_SPEED).cases
    except InputError:  # as for a passport
        return none
    found = resonances_of(cases, ratio=unit.ratio, policy=policy)
    notes = critical_notes(model, cases, found, policy=policy)
    if not found:
        return replace(none, notes=tuple(notes))
    notes.append(
        "runs differ in speed: what the natural frequencies add by their laws is taken off before causes are looked "
        "for; the model as declared does not know it"
    )
    count = cases[0].orders.size
    parts, _ = resonant_parts(cases, found)
    waves = tuple(part[:count] + 1j * part[count:] for part in parts)
    state = RunsAtSpeed(tuple(runs), found, cases[0].orders, waves, tuple(notes))
    return replace(state, runs=tuple(_less(run, state.added(n, run.nominal_angle(unit))) for n, run in enumerate(runs)))


def _less(run: Run, row: Array) -> Run:
    """The run without a part of its error; its nominal angle stays."""
    return replace(
        run,
        output_angle=None if run.output_angle is None else run.output_angle - row,
        te_column=None if run.te_column is None else run.te_column - row,
    )
