"""Making a compensation: from named causes, from what repeats in runs, or from both; and what it leaves."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.chance import student
from rverror.base.errors import InputError, check_each, check_kind
from rverror.base.numbers import brief, count_of, in_arcsec, with_unit
from rverror.compensation.correction import Correction, from_effects, waves_at
from rverror.compensation.outcome import CompensatedOrder, CompensatedTrace, Compensation, HeldError, Unseen
from rverror.compensation.over_conditions import LEAST_CONDITIONS, VARIABLES, ConditionLaw, law_of
from rverror.compensation.predicted_waves import PredictedWaves
from rverror.compensation.repeating import (
    CHANCE,
    DirectedRun,
    RepeatingOrders,
    at_orders,
    candidates_of,
    condition_of,
    merged,
    records_of,
    repeating_orders,
)
from rverror.geartrain.mechanism import core_torque
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.runs.measurement import Run
from rverror.runs.order_table import OrderCase, OrderTable, TableCondition, Waves
from rverror.runs.spectrum import frames_of_order

_MOST_LISTED = 5


class HasModel(Protocol):
    """What has a model: a diagnosis."""

    @property
    def model(self) -> Model:
        """With the causes that were found."""
        ...


def compensate(
    found: Model | HasModel,
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
    model: Model = found if isinstance(found, Model) else getattr(found, "model", found)  # type: ignore[arg-type]
    check_kind("found", model, Model, "give a Model, or what diagnose() found")
    check_each("runs", runs, (Run, OrderTable), "give a list of runs, such as [load_run(path)]")
    if not runs:
        raise InputError("compensate: there is no run; give one or more")
    index = _one_zero([*runs, *unseen])
    asked = [core_torque(model.mechanism, torque, name="torques") for torque in torques]
    notes: list[str] = []
    predicted = PredictedWaves(model, notes, marked=index != "unknown")
    data = _gathered(predicted, runs, notes)
    if predicted.corrected and not _helps(data):
        predicted = PredictedWaves(replace(model, effects=predicted.passive), notes, marked=False)
        data = _gathered(predicted, runs, notes)
        notes.append("the model's effects raise the error of these runs and were left out; diagnose first")
    made = _made(predicted, data, _wanted(model, data, unseen, asked), notes)
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
    """Records of samples with their candidates, and cases of tables less what the model predicts."""

    records: list[DirectedRun]
    candidates: list[Array]
    folded: set[float]
    cases: list[OrderCase]
    measured: list[Waves]


def _gathered(predicted: PredictedWaves, runs: Sequence[Run | OrderTable], notes: list[str]) -> _Data:
    model = predicted.model
    data = _Data([], [], set(), [], [])
    old = from_effects(model.mechanism.ratio, predicted.old)
    for one in runs:
        if isinstance(one, OrderTable):
            for case in one.cases:
                known = [waves_at(case.orders, *one.waves(case.condition)) for one in (predicted, old)]
                data.cases.append(replace(case, waves=case.waves - sum(known)))
                data.measured.append(case.waves)
            continue
        fresh: list[str] = []
        for record in records_of(one, model, predicted, fresh):
            candidates, folded = candidates_of(model.mechanism, record)
            data.records.append(replace(record, slowest=float(candidates[0])) if candidates.size else record)
            data.candidates.append(candidates)
            data.folded.update(folded)
        notes += [note for note in fresh if note not in notes]
    return data


def _helps(data: _Data) -> bool:
    """Whether the model lowers the squared error of the runs, and of the tables."""
    samples = [(record.measured, record.error) for record in data.records]
    with_model = sum(float(np.sum((e - e.mean()) ** 2)) for _, e in samples)
    without = sum(float(np.sum((m - m.mean()) ** 2)) for m, _ in samples)
    with_model += sum(float(np.sum(np.abs(case.waves) ** 2)) for case in data.cases)
    without += sum(float(np.sum(np.abs(waves) ** 2)) for waves in data.measured)
    return with_model < without


def _wanted(
    model: Model, data: _Data, unseen: Sequence[Run | OrderTable], torques: Sequence[float]
) -> list[TableCondition]:
    """Conditions beside those that were measured for which the correction is made."""
    wanted = []
    for one in unseen:
        if isinstance(one, OrderTable):
            wanted += [case.condition for case in one.cases]
        else:
            theta, ratio = one.nominal_angle(model), abs(model.mechanism.ratio)
            wanted += [condition_of(one, theta, float(sense), ratio) for sense in np.unique(one.direction)]
    measured = [r.condition for r in data.records] + [case.condition for case in data.cases]
    wanted += [replace(condition, torque=torque) for torque in torques for condition in measured]
    return list(dict.fromkeys(wanted))


def _one_zero(runs: Sequence[Run | OrderTable]) -> str:
    labels = {one.index: one.path or "a run" for one in runs}
    if len(labels) > 1:
        listed = ", ".join(f"{path} has {label!r}" for label, path in sorted(labels.items()))
        raise InputError(f"the zeros of the runs differ ({listed}); a table is tied to one: give runs of one index")
    return next(iter(labels))


# --- the correction ---------------------------------------------------------------------------------------------------


def _made(predicted: PredictedWaves, data: _Data, wanted: Sequence[TableCondition], notes: list[str]) -> Compensation:
    of_runs = [repeating_orders(record, c) for record, c in zip(data.records, data.candidates, strict=True)]
    of_runs = _with_the_others(of_runs)
    rows = [(one.record.condition, one.orders, one.waves) for one in merged(of_runs)]
    rows += [(case.condition, case.orders, case.waves) for case in data.cases]
    _check_left_out(data)
    cases: list[OrderCase] = []
    words: dict[float, list[str]] = {}
    left: dict[float, list[float]] = {}
    after_tables: dict[TableCondition, float] = {}
    for sense in sorted({condition.direction for condition, _, _ in rows}, reverse=True):
        own = [row for row in rows if row[0].direction == sense]
        asked = dict.fromkeys([*(c for c, _, _ in own), *(c for c in wanted if c.direction == sense)])
        notes += _outside([c for c, _, _ in own], asked, bool(predicted.corrected))
        laws = _laws_of(own)
        after_tables |= laws.after
        for k, rest in laws.left.items():
            left.setdefault(k, []).extend(rest)
        said = dict(laws.words)
        for condition in asked:
            orders, values = laws.waves(condition)
            told, model_waves = predicted.waves(condition)
            every = np.union1d(orders, told)
            total = waves_at(every, orders, values) + waves_at(every, told, model_waves)
            cases.append(OrderCase(condition=condition, orders=every, waves=-total))
            said = dict.fromkeys(told.tolist(), "predicted") | said
        for k, word in said.items():
            words.setdefault(k, []).append(word)
    senses = {condition.direction for condition, _, _ in rows}
    notes += [
        f"no {'forward' if sense > 0 else 'reverse'} run: nothing is corrected in that direction"
        for sense in (1.0, -1.0)
        if sense not in senses
    ]
    correction = Correction(
        predicted.model.mechanism.ratio,
        OrderTable(cases=tuple(cases)),
        _reach(data.records) if not data.cases else None,
    )
    before, after = _held(of_runs, data, after_tables)
    listed = _listed(predicted.model, correction, of_runs, words, left, [c for c, _, _ in rows])
    stays = _stays(data, of_runs, listed, after)
    if not listed or after.rms >= before.rms:
        correction = replace(correction, table=OrderTable(cases=()))
        return Compensation(correction, (), before, before, predicted.model, stays=stays, notes=tuple(notes))
    records = [(one.record, one.left) for one in of_runs]
    traces = tuple(CompensatedTrace(r.name, r.theta, r.measured - r.measured.mean(), rest) for r, rest in records)
    return Compensation(
        correction, listed, before, after, predicted.model, stays=stays, notes=_said(predicted, notes), traces=traces
    )


def _with_the_others(found: list[RepeatingOrders]) -> list[RepeatingOrders]:
    """Where a law is looked for over conditions, every run has the orders of all of its direction."""
    result = []
    for one in found:
        own = [r for r in found if r.record.condition.direction == one.record.condition.direction]
        if len({r.record.condition for r in own}) < LEAST_CONDITIONS:
            result.append(one)
            continue
        every = np.unique(np.concatenate([r.orders for r in own]))
        result.append(at_orders(one.record, every))
    return result


def _check_left_out(data: _Data) -> None:
    by_sense: dict[float, int] = {}
    for case in data.cases:
        by_sense[case.condition.direction] = by_sense.get(case.condition.direction, 0) + 1
    if by_sense and min(by_sense.values()) < LEAST_CONDITIONS:
        raise InputError(
            f"an order table of {count_of(min(by_sense.values()), 'condition')} in one direction: nothing can be left "
            f"out to see what survives; give {LEAST_CONDITIONS} or more, or the runs themselves"
        )


_Row = tuple[TableCondition, Array, Waves]


@dataclass(frozen=True)
class _Laws:
    """What the waves of one direction are under any condition."""

    waves: Callable[[TableCondition], tuple[Array, Waves]]
    words: dict[float, str]  # by order
    left: dict[float, list[float]] = field(default_factory=dict)  # of each order in the conditions left out, rad
    after: dict[TableCondition, float] = field(default_factory=dict)  # squares that they leave, rad^2


def _laws_of(own: Sequence[_Row]) -> _Laws:
    """Laws of every order over the conditions of one direction; of few conditions their own waves."""
    conditions = [c for c, _, _ in own]
    if len(own) < LEAST_CONDITIONS:
        cases = tuple(OrderCase(condition=c, orders=k, waves=z) for c, k, z in own)
        measured = Correction(1.0, OrderTable(cases=cases))
        return _Laws(measured.waves, dict.fromkeys(measured.orders.tolist(), "measured"))
    orders = np.unique(np.concatenate([k for _, k, _ in own]))
    found: dict[float, ConditionLaw] = {}
    after: dict[TableCondition, float] = {}
    for k in orders.tolist():
        having = [n for n, (_, known, _) in enumerate(own) if k in known]
        waves = np.array([own[n][2][np.searchsorted(own[n][1], k)] for n in having])
        law = law_of(waves, [conditions[n] for n in having], CHANCE / orders.size)
        for n, rest in zip(having, np.abs(law.left).tolist(), strict=True):
            after[conditions[n]] = after.get(conditions[n], 0.0) + 0.5 * rest**2
        if law.terms:
            found[k] = law

    def of_laws(condition: TableCondition) -> tuple[Array, Waves]:
        return np.array(list(found)), np.array([law(condition) for law in found.values()], dtype=np.complex128)

    left = {k: np.abs(law.left).tolist() for k, law in found.items()}
    return _Laws(of_laws, {k: law.text for k, law in found.items()}, left, after)


def _outside(measured: Sequence[TableCondition], asked: Any, named: bool) -> list[str]:
    """Warnings of conditions outside of what was measured."""
    notes = []
    dimensions = dict(zip(VARIABLES, ("torque", "angular_speed", "temperature"), strict=True))
    for name, dimension in dimensions.items():
        known = [v for c in measured if (v := getattr(c, name)) is not None]
        beyond = sorted({v for c in asked if (v := getattr(c, name)) is not None and known}) if known else []
        beyond = [v for v in beyond if not min(known) * (1 - 1e-6) <= v <= max(known) * (1 + 1e-6)]
        if beyond:
            what = name.replace("input_", "")
            held = (
                "the causes predict it, orders are taken as at the nearest"
                if named and name == "torque"
                else ("waves are taken as at the nearest that was")
            )
            notes.append(
                f"{what} {', '.join(with_unit(v, dimension) for v in beyond)} is outside of what was measured "
                f"({with_unit(min(known), dimension)} to {with_unit(max(known), dimension)}): {held}"
            )
    return notes


def _reach(records: Sequence[DirectedRun]) -> tuple[float, float] | None:
    if not records or any(record.whole for record in records):
        return None
    return max(float(r.theta.min()) for r in records), min(float(r.theta.max()) for r in records)


# --- what it leaves ---------------------------------------------------------------------------------------------------


def _held(
    found: Sequence[RepeatingOrders], data: _Data, after: dict[TableCondition, float]
) -> tuple[HeldError, HeldError]:
    """Error of what was left out: stretches, with what a law over the conditions leaves of their waves; conditions."""
    before_squares = np.concatenate([np.zeros(0), *(one.before for one in found)])
    after_squares = np.concatenate([np.zeros(0), *(one.after + after.get(one.record.condition, 0.0) for one in found)])
    if data.cases:
        table_before = [0.5 * float(np.sum(np.abs(waves) ** 2)) for waves in data.measured]
        before_squares = np.concatenate([before_squares, table_before])
        after_squares = np.concatenate([after_squares, [after[case.condition] for case in data.cases]])
    return _interval(before_squares), _interval(after_squares)


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
    model: Model,
    correction: Correction,
    found: Sequence[RepeatingOrders],
    words: dict[float, list[str]],
    left: dict[float, list[float]],
    measured: Sequence[TableCondition],
) -> tuple[CompensatedOrder, ...]:
    squares: dict[float, list[float]] = {}
    for case in correction.table.cases:
        if case.condition in measured:
            for k, size in zip(case.orders.tolist(), np.abs(case.waves).tolist(), strict=True):
                squares.setdefault(k, []).append(size**2)
    rest = dict(left)
    for k in squares:
        for one in found:
            rest.setdefault(k, []).extend(one.lines(k))
    listed = []
    for k, values in squares.items():
        size = math.sqrt(float(np.mean(values)))
        remains = math.sqrt(float(np.mean(np.square(rest[k])))) if k in rest else math.nan
        if size > 0:
            frames = tuple(frames_of_order(model.mechanism, k))
            listed.append(CompensatedOrder(k, frames, size, remains, "; ".join(dict.fromkeys(words.get(k, ())))))
    return tuple(sorted(listed, key=lambda one: -one.amplitude))


def _stays(
    data: _Data, found: Sequence[RepeatingOrders], listed: Sequence[CompensatedOrder], after: HeldError
) -> tuple[str, ...]:
    """What stays, and why."""
    told = [f"{in_arcsec(after.rms, 3):g} arcsec rms of what was left out: noise, and what differs from time to time"]
    taken = {one.order for one in listed}
    lines = [line for one in found if (line := one.between())]
    if lines:
        order, size = max(lines, key=lambda line: line[1])
        told.append(
            f"a line of order {brief(order, 5)}, {brief(size / units.ARCSEC, 2)} arcsec: no whole order, so that "
            "no table over a turn holds it"
        )
    if not taken and found:
        count = max(c.size for c in data.candidates)
        told.append(f"no order of {count} stands out of the noise by more than chance and lowers what was left out")
    if not taken and data.cases:
        told.append("no order has a law over the conditions that predicts those left out")
    known = {k for case in data.cases for k in case.orders.tolist()}
    if lost := sorted(known - taken):
        told.append(f"orders {', '.join(map(brief, lost))}: no law predicts the conditions left out")
    if known:
        told.append("orders that the table does not hold: nothing is known of them")
    if data.folded:
        listed_images = ", ".join(sorted({brief(k) for k in data.folded})[:_MOST_LISTED])
        told.append(f"orders {listed_images}: the mesh orders of the gears fold onto them; measure more samples a turn")
    told.append("windup and play: a constant for each direction and load, which a run does not tell from its offset")
    return tuple(told)


def _said(predicted: PredictedWaves, notes: list[str]) -> tuple[str, ...]:
    readings = sorted({e.key for e in predicted.corrected if source(e.key).acts == "reading"})
    more = []
    if readings:
        more.append(
            f"{', '.join(readings)}: what misreads is corrected as it was read; where the joint does not keep the "
            "encoder of the bench, that is an error of its own"
        )
    return tuple(dict.fromkeys([*notes, *more]))


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
            squares.append([0.5 * np.sum(np.abs(waves) ** 2) for waves in (case.waves, case.waves + new - replaced)])
        return Unseen(one.path, *np.sqrt(np.mean(squares, axis=0)).tolist()), ()
    theta, error = one.nominal_angle(predicted.model), one.error(predicted.model)
    traces = []
    for sense in np.unique(one.direction):
        at = one.direction == sense
        condition = condition_of(one, theta, float(sense), abs(correction.ratio))
        changed = error[at] + correction.at(theta[at], condition) - old.at(theta[at], condition)
        sides = error[at] - error[at].mean(), changed - changed.mean()
        traces.append(CompensatedTrace(one.path, theta[at], *sides, unseen=True))
    errors = (np.concatenate([getattr(trace, side) for trace in traces]) for side in ("before", "after"))
    return Unseen(one.path, *(math.sqrt(float(np.mean(error**2))) for error in errors)), tuple(traces)
