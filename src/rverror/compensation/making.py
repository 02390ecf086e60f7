"""Making a compensation: from named causes, as a model predicts, from what repeats in runs, or both; what it leaves."""

from __future__ import annotations

import math
from collections import Counter, defaultdict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.chance import student
from rverror.base.errors import InputError, check_each, check_kind
from rverror.base.numbers import brief, count_of, in_arcsec, way, with_unit
from rverror.compensation.correction import Correction, from_effects, wave_sum, waves_at
from rverror.compensation.outcome import CompensatedOrder, CompensatedTrace, Compensation, HeldError, Unseen
from rverror.compensation.over_conditions import LEAST_CONDITIONS, VARIABLES, ConditionLaw, law_of
from rverror.compensation.repeating import (
    CHANCE,
    DirectedRun,
    RepeatingOrders,
    at_orders,
    condition_of,
    merged,
    records_of,
    repeating_orders,
)
from rverror.geartrain.contacts import motion
from rverror.geartrain.kinematics import OperatingConditions, samples_needed, true_period
from rverror.geartrain.mechanism import Reducer, core_torque
from rverror.model.catalogue import source
from rverror.model.compensation import WAVE
from rverror.model.effects import Model
from rverror.model.readings import added
from rverror.runs.measurement import Run
from rverror.runs.order_table import OrderCase, OrderTable, TableCondition, Waves
from rverror.runs.spectrum import frames_of_order
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
        entries = [(e, source(e.key)) for e in model.effects]
        self.slow = tuple(e for e, entry in entries if not entry.periodic or entry.follows != "angle")
        self.corrected = tuple(e for e in model.effects if e not in self.old and e not in self.slow)
        if self.corrected and not marked and not any(source(e.key).acts == "marks" for e in self.corrected):
            notes.append("the zero is not on the gear's marks, so the model's effects predict no phase: left out")
            self.corrected = ()
        for effect in self.slow:
            slope = source(effect.key).follows == "angle"
            why = "an error that grows is mended by the ratio" if slope else "it follows time or speed, not the angle"
            notes.append(f"{effect.key} stays and is not counted: {why}")
        self._waves: dict[tuple[float, float | None], tuple[Array, Waves]] = {}

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
        where = OperatingConditions(theta, condition.direction, condition.torque or None)
        error = predict(replace(self.model, effects=self.corrected), where).transmission_error
        lines = 2 * np.fft.rfft(error)[1 : count // 2] / count
        strong = np.flatnonzero(np.abs(lines) > max(_TINY * np.abs(lines).max(), 1e-3 * _TINY * units.ARCSEC))
        return (strong + 1) / turns, np.asarray(lines[strong], dtype=np.complex128)

    def __call__(self, where: OperatingConditions, condition: TableCondition) -> tuple[Array, Array]:
        """What the model makes of the error, and what of that no table can take, rad."""
        read = motion(self.model.mechanism, where)
        slow = added(self.slow, read)
        return wave_sum(where.theta, *self.waves(condition)) + slow + added(self.old, read), slow


_MOST_LISTED = 5


def compensate(
    found: Any,
    runs: Sequence[Run | OrderTable],
    *,
    torques: Sequence[Any] = (),
    unseen: Sequence[Run | OrderTable] = (),
) -> Compensation:
    """Correction of the input's command that takes off what repeats, and what it leaves.

    Of samples an order is taken that stands out of the noise between the orders and lowers the squared error of every
    turn, or stretch, left out in its turn.  Of order tables, or of four conditions and more, each order has in each
    direction the polynomial of load, speed and temperature that predicts the conditions left out.  What the model's
    effects predict at the load of a run goes before; they say what loads do that no run has.

    Parameters
    ----------
    found : Model or Diagnosis
        Whose effects are the named causes; one without effects leaves all to the runs.
    runs : sequence of Run or OrderTable
        All with one zero.
    torques : sequence of float, str or quantity
        Output torques for which it is made beside those that were measured; plain numbers are N*mm.
    unseen : sequence of Run or OrderTable
        Held against it and never fitted; it is made for their loads too.

    Returns
    -------
    Compensation
        With an empty correction where nothing survives: its `stays` say why.

    Raises
    ------
    InputError
        If a run cannot be used, contradicts the model, or has another zero, or nothing can be left out.

    Notes
    -----
    docs page ``theory/compensation.md`` has signs, limits and thresholds.

    Examples
    --------
    >>> import numpy as np, rverror
    >>> theta = np.linspace(0, 8 * np.pi, 4001)
    >>> noise = np.random.default_rng(1).normal(size=(2, 4001)) * 1e-6
    >>> runs = [rverror.run_from_arrays(input_angle=14 * theta, te=2e-5 * np.cos(14 * theta) + e) for e in noise]
    >>> model = rverror.Model(rverror.Drive(ratio=14.0, shafts={"motor": 14.0}))
    >>> made = rverror.compensate(model, runs[:1], unseen=runs[1:])
    >>> [one.order for one in made.orders], bool(made.unseen[0].after < 0.1 * made.unseen[0].before)
    ([14.0], True)
    """
    model: Model = getattr(found, "model", found)
    check_kind("found", model, Model, "give a Model, or what diagnose() found")
    check_each("runs", runs, (Run, OrderTable), "give a list of runs, such as [load_run(path)]")
    if not runs:
        raise InputError("compensate: there is no run; give one or more")
    index = _one_zero([*runs, *unseen])
    loads = [core_torque(model.mechanism, torque, name="torques") for torque in torques]
    notes: list[str] = []
    predicted = PredictedWaves(model, notes, marked=index != "unknown")
    data = _gathered(predicted, runs, notes)
    if predicted.corrected and not _helps(data):
        predicted = PredictedWaves(replace(model, effects=(*predicted.old, *predicted.slow)), notes, marked=False)
        data = _gathered(predicted, runs, notes)
        notes.append("the model's effects raise the error of these runs and were left out; diagnose first")
    made = _made(predicted, data, _wanted(model, data, unseen, loads), notes)
    tested = [_tested(predicted, made.correction, one) for one in unseen]
    return replace(
        made,
        index=index,
        unseen=tuple(one for one, _ in tested),
        traces=(*made.traces, *(trace for _, traces in tested for trace in traces)),
    )


# --- what was measured ------------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Data:
    """Records of samples; and cases of tables, each as measured and less what the model predicts."""

    records: list[DirectedRun]
    tables: list[tuple[OrderCase, OrderCase]]

    @property
    def conditions(self) -> list[TableCondition]:
        """Of all of them."""
        return [record.condition for record in self.records] + [case.condition for case, _ in self.tables]


def _gathered(predicted: PredictedWaves, runs: Sequence[Run | OrderTable], notes: list[str]) -> _Data:
    data, old = _Data([], []), from_effects(predicted.model.mechanism.ratio, predicted.old)
    for one in runs:
        if isinstance(one, Run):
            data.records.extend(records_of(one, predicted.model, predicted, notes))
            continue
        for case in one.cases:
            known = sum(waves_at(case.orders, *by.waves(case.condition)) for by in (predicted, old))
            data.tables.append((case, replace(case, waves=case.waves - known)))
    return data


def _helps(data: _Data) -> bool:
    """Whether the model lowers the squared error of the runs, and of the tables."""
    gain = sum(record.measured.var() * record.theta.size for record in data.records)
    gain -= sum(record.error.var() * record.theta.size for record in data.records)
    gain += sum(_power(case) - _power(left) for case, left in data.tables)
    return bool(gain > 0)


def _power(case: OrderCase) -> float:
    return float(np.sum(np.abs(case.waves) ** 2))


def _wanted(
    model: Model, data: _Data, unseen: Sequence[Run | OrderTable], torques: Sequence[float]
) -> list[TableCondition]:
    """Conditions beside those that were measured for which the correction is made."""
    wanted = []
    for one in unseen:
        if isinstance(one, OrderTable):
            wanted += [case.condition for case in one.cases]
        else:
            wanted += [condition_of(one, model, float(sense)) for sense in np.unique(one.direction)]
    wanted += [replace(condition, torque=torque) for torque in torques for condition in data.conditions]
    return list(dict.fromkeys(wanted))


def _one_zero(runs: Sequence[Run | OrderTable]) -> str:
    labels = {one.index: one.path or "a run" for one in runs}
    if len(labels) > 1:
        listed = ", ".join(f"{path} has {label!r}" for label, path in sorted(labels.items()))
        raise InputError(f"the zeros of the runs differ ({listed}); a table is tied to one: give runs of one index")
    return next(iter(labels))


# --- the correction ---------------------------------------------------------------------------------------------------


def _made(predicted: PredictedWaves, data: _Data, wanted: Sequence[TableCondition], notes: list[str]) -> Compensation:
    of_runs = _with_the_others([repeating_orders(record) for record in data.records])
    _check_left_out(data)
    of_records = merged(of_runs)
    rows = of_records + [case for _, case in data.tables]
    cases, sides = list[OrderCase](), list[_Side]()
    for sense in (1.0, -1.0):
        own = [row for row in rows if row.condition.direction == sense]
        if not own:
            notes.append(f"no {way(sense)} run: nothing is corrected in that direction")
            continue
        measured = [row.condition for row in own]
        targets = list(dict.fromkeys([*measured, *(c for c in wanted if c.direction == sense)]))
        notes += _outside(measured, targets, bool(predicted.corrected))
        sides.append(_side(own))
        for condition in targets:
            orders, waves = sides[-1].waves(condition)
            model_orders, model_waves = predicted.waves(condition)
            sides[-1].words.update({k: "predicted" for k in model_orders.tolist() if k not in sides[-1].words})
            every = np.union1d(orders, model_orders)
            total = waves_at(every, orders, waves) + waves_at(every, model_orders, model_waves)
            cases.append(OrderCase(condition=condition, orders=every, waves=-total))
    model = predicted.model
    correction = Correction(model.mechanism.ratio, OrderTable(cases=tuple(cases)), _reach(data))
    left = {row: rest for side in sides for row, rest in side.after.items()}
    of_conditions = {row.condition: left.get(row, 0.0) for row in of_records}
    before, after = _held(of_runs, data, of_conditions, [left.get(case, 0.0) for _, case in data.tables])
    measured_cases = [case for case in cases if case.condition in data.conditions]
    listed = _listed(model, measured_cases, of_runs, sides)
    stays = _stays(data, {one.order for one in listed}, after)
    if not listed or after.rms >= before.rms:
        nothing = replace(correction, table=OrderTable(cases=()))
        return Compensation(nothing, (), before, before, model, stays=stays, notes=tuple(dict.fromkeys(notes)))
    if readings := sorted({e.key for e in predicted.corrected if source(e.key).acts == "reading"}):
        notes.append(
            f"{', '.join(readings)}: what misreads is corrected as it was read; where the joint does not keep the "
            "encoder of the bench, that is an error of its own"
        )
    records = [(one.record, one.left) for one in of_runs]
    traces = tuple(CompensatedTrace(r.name, r.theta, r.measured - r.measured.mean(), rest) for r, rest in records)
    said = tuple(dict.fromkeys(notes))
    return Compensation(correction, listed, before, after, model, stays=stays, notes=said, traces=traces)


def _with_the_others(found: list[RepeatingOrders]) -> list[RepeatingOrders]:
    """Where a law is looked for over conditions, every run has the orders of all of its direction."""
    result = []
    for one in found:
        own = [r for r in found if r.record.condition.direction == one.record.condition.direction]
        if len({r.record.condition for r in own}) >= LEAST_CONDITIONS:
            one = at_orders(one.record, np.unique(np.concatenate([r.orders for r in own])))
        result.append(one)
    return result


def _check_left_out(data: _Data) -> None:
    counts = Counter(case.condition.direction for case, _ in data.tables)
    if counts and min(counts.values()) < LEAST_CONDITIONS:
        raise InputError(
            f"an order table of {count_of(min(counts.values()), 'condition')} in one direction: nothing can be left "
            f"out to see what survives; give {LEAST_CONDITIONS} or more, or the runs themselves"
        )


@dataclass(frozen=True)
class _Side:
    """Waves of one direction under any condition."""

    waves: Callable[[TableCondition], tuple[Array, Waves]]
    words: dict[float, str]  #: law of each order
    left: Mapping[float, list[float]] = field(default_factory=dict)  #: of each order in the conditions left out, rad
    after: Mapping[OrderCase, float] = field(default_factory=dict)  #: mean squares that they leave, rad^2


def _side(own: Sequence[OrderCase]) -> _Side:
    """Laws of every order over the conditions of one direction; of few conditions their own waves."""
    if len(own) < LEAST_CONDITIONS:
        measured = Correction(1.0, OrderTable(cases=tuple(own)))
        return _Side(measured.waves, dict.fromkeys(measured.orders.tolist(), "measured"))
    orders = np.unique(np.concatenate([case.orders for case in own])).tolist()
    laws, after = dict[float, ConditionLaw](), defaultdict[OrderCase, float](float)
    for k in orders:
        having = [case for case in own if k in case.orders]
        waves = np.array([case.waves[case.orders == k][0] for case in having])
        law = law_of(waves, [case.condition for case in having], CHANCE / len(orders))
        for case, rest in zip(having, np.abs(law.left).tolist(), strict=True):
            after[case] += rest**2 / 2
        if law.terms:
            laws[k] = law
    return _Side(
        lambda condition: (np.array(list(laws)), np.array([law(condition) for law in laws.values()], dtype=complex)),
        {k: law.text for k, law in laws.items()},
        {k: np.abs(law.left).tolist() for k, law in laws.items()},
        after,
    )


def _outside(measured: Sequence[TableCondition], targets: Sequence[TableCondition], named: bool) -> list[str]:
    """Warnings of conditions outside of what was measured."""
    notes = []
    for name, dimension in VARIABLES.items():
        known = [v for c in measured if (v := getattr(c, name)) is not None]
        low, high = min(known, default=-math.inf), max(known, default=math.inf)
        values = {v for c in targets if (v := getattr(c, name)) is not None}
        beyond = sorted(v for v in values if not low * (1 - 1e-6) <= v <= high * (1 + 1e-6))
        held = "waves are taken as at the nearest that was"
        if named and name == "torque":
            held = "the causes predict it, orders are taken as at the nearest"
        if beyond:
            notes.append(
                f"{name.replace('input_', '')} {', '.join(with_unit(v, dimension) for v in beyond)} is outside of what "
                f"was measured ({with_unit(low, dimension)} to {with_unit(high, dimension)}): {held}"
            )
    return notes


def _reach(data: _Data) -> tuple[float, float] | None:
    if data.tables or any(record.whole for record in data.records):
        return None
    return max(float(r.theta.min()) for r in data.records), min(float(r.theta.max()) for r in data.records)


# --- what it leaves ---------------------------------------------------------------------------------------------------


def _held(
    found: Sequence[RepeatingOrders], data: _Data, of_records: Mapping[TableCondition, float], of_tables: list[float]
) -> tuple[HeldError, HeldError]:
    """Error of what was left out: stretches, with what a law over the conditions leaves of their waves; conditions."""
    before = [one.before for one in found] + [np.array([_power(case) / 2 for case, _ in data.tables])]
    after = [one.after + of_records[one.record.condition] for one in found] + [np.array(of_tables)]
    return _interval(np.concatenate(before)), _interval(np.concatenate(after))


def _interval(squares: Array) -> HeldError:
    """Root mean square, and where that of one more is expected: the logarithm of mean squares as normal."""
    rms = math.sqrt(float(squares.mean()))
    if squares.size < 2 or not squares.all():
        return HeldError(rms, math.nan, math.nan)
    logs = np.log(squares)
    half = student(0.025, squares.size - 1) * float(logs.std(ddof=1)) * math.sqrt(1 + 1 / squares.size)
    middle = float(logs.mean())
    return HeldError(rms, math.exp((middle - half) / 2), math.exp((middle + half) / 2))


def _listed(
    model: Model, cases: Sequence[OrderCase], found: Sequence[RepeatingOrders], sides: Sequence[_Side]
) -> tuple[CompensatedOrder, ...]:
    """Orders of the measured conditions, the largest first."""
    listed = []
    for k in np.unique(np.concatenate([case.orders for case in cases])).tolist():
        sizes = np.concatenate([np.abs(case.waves[case.orders == k]) for case in cases])
        rest = [size for side in sides for size in side.left.get(k, ())]
        rest += [size for one in found for size in one.lines(k)]
        words = dict.fromkeys(side.words[k] for side in sides if k in side.words)
        if sizes.any():
            amplitude, left = (math.sqrt(float(np.mean(np.square(x)))) if len(x) else math.nan for x in (sizes, rest))
            frames = tuple(frames_of_order(model.mechanism, k))
            listed.append(CompensatedOrder(k, frames, amplitude, left, "; ".join(words)))
    return tuple(sorted(listed, key=lambda one: -one.amplitude))


def _stays(data: _Data, taken: set[float], after: HeldError) -> tuple[str, ...]:
    """What stays, and why."""
    reasons = [
        f"{in_arcsec(after.rms, 3):g} arcsec rms of what was left out: noise, and what differs from time to time"
    ]
    if not taken and data.records:
        count = max(record.candidates.size for record in data.records)
        reasons.append(f"no order of {count} stands out of the noise by more than chance and lowers what was left out")
    if not taken and data.tables:
        reasons.append("no order has a law over the conditions that predicts those left out")
    known = {k for case, _ in data.tables for k in case.orders.tolist()}
    if lost := sorted(known - taken):
        reasons.append(f"orders {', '.join(map(brief, lost))}: no law predicts the conditions left out")
    if known:
        reasons.append("orders that the table does not hold: nothing is known of them")
    if folded := {brief(k) for record in data.records for k in record.folded}:
        images = ", ".join(sorted(folded)[:_MOST_LISTED])
        reasons.append(f"orders {images}: the mesh orders of the gears fold onto them; measure more samples a turn")
    reasons.append("windup and play: a constant for each direction and load, which a run does not tell from its offset")
    return tuple(reasons)


# --- data that no fit saw ---------------------------------------------------------------------------------------------


def _tested(
    predicted: PredictedWaves, correction: Correction, one: Run | OrderTable
) -> tuple[Unseen, tuple[CompensatedTrace, ...]]:
    """Error of a run or table without and with the correction, in place of an earlier one; of a run its traces."""
    old = from_effects(correction.ratio, predicted.old)
    if isinstance(one, OrderTable):
        squares = []
        for case in one.cases:
            new, replaced = (waves_at(case.orders, *table.waves(case.condition)) for table in (correction, old))
            squares.append([_power(case) / 2, _power(replace(case, waves=case.waves + new - replaced)) / 2])
        return Unseen(one.path, *np.sqrt(np.mean(squares, axis=0)).tolist()), ()
    theta, error = one.nominal_angle(predicted.model), one.error(predicted.model)
    traces = []
    for sense in np.unique(one.direction):
        at = one.direction == sense
        condition = condition_of(one, predicted.model, float(sense))
        changed = error[at] + correction.at(theta[at], condition) - old.at(theta[at], condition)
        sides = error[at] - error[at].mean(), changed - changed.mean()
        traces.append(CompensatedTrace(one.path, theta[at], *sides, unseen=True))
    before, after = (np.concatenate([getattr(trace, side) for trace in traces]) for side in ("before", "after"))
    return Unseen(one.path, float(np.std(before)), float(np.std(after))), tuple(traces)
