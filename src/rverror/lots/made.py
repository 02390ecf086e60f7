"""The lot: from the runs of many finished units to the processes that made them."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Any

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import count_of
from rverror.lots.amplitudes import Amplitudes, LotUnit, amplitudes_given, variance_of
from rverror.lots.differences import (
    ShiftSource,
    candidates_of,
    changes_over_serial,
    course,
    detection_limit,
    group_differences,
    steady,
)
from rverror.lots.identifiable import Question, question_of
from rverror.lots.members import outsiders
from rverror.lots.moments import STIFFNESS, LotEstimate, MomentMatching, interval, sample_of
from rverror.lots.processes import Process, processes_of
from rverror.lots.result import Change, Difference, Interval, Lot, MadeBy, Outsider, Predicted, Shift
from rverror.lots.simulated import COMPLIANCES, Simulator
from rverror.model.effects import Model
from rverror.statics.loaded_state import SOFTENING, reducer_of
from rverror.tolerances.declared import Tolerance
from rverror.tolerances.distribution import OUTSIDE

#: False alarms of groups, changes and outsiders: in so many of all lots that have none, each.
LEVEL = 0.01
_DRAWN = 200  # units with influences, the same in every step: as many as a lot often has, so that both are as exact
_SPOILT = 0.2  # of the units that may be no members
_LEFT = (30, 0.4)  # units, and share of the lot, from which processes are told without groups and changes
_MEMBERS = 400  # units that show what a member may be
_PREDICTED = 600  # units of which the 95 % quantile is taken: it is then known to 2 % of the spread
_FEW = 12  # instances of a process, up to which each is told by itself
_SETS = 60  # states within the errors that tell how far the prediction is off
_UNMARKED = (
    "zeros are not on the marks (index: unknown): systematic errors are part of the standard deviations, and groups "
    "and changes are not searched"
)
_PRECISE = 0.25  # share of a standard deviation within which its interval settles the matter


@dataclass(frozen=True)
class _Cleaned:
    """What was told of single units and groups, and the amplitudes without it."""

    values: Array
    members: npt.NDArray[np.bool_]
    kept: npt.NDArray[np.bool_]  #: those that the processes are told from
    outsiders: tuple[Outsider, ...] = ()
    differences: tuple[Difference, ...] = ()
    changes: tuple[Change, ...] = ()

    @property
    def same(self) -> tuple[object, ...]:
        """What decides whether it has changed."""
        return (
            tuple(self.kept),
            tuple((d.label, d.value, d.causes[0].key) for d in self.differences),
            tuple((c.since, c.cause.key) for c in self.changes),
        )


def lot(
    model: Model,
    units: Sequence[LotUnit] | Amplitudes,
    *,
    tolerances: Sequence[Tolerance] | None = None,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
) -> Lot:
    """Tell from the runs of many finished units what each process makes.

    Parameters
    ----------
    model : Model
        Of a reducer, with what all units share; stiffnesses need not be known better than to a fifth.
    units : sequence of LotUnit, or Amplitudes
        Each with a run for each condition, over a turn of the output or more; in the order in which they were made.
        Or amplitudes of `lot_inputs`.
    tolerances : sequence of Tolerance, optional
        The drawing: which parts vary.  All sources of the catalogue where left out.
    seed : int
        Of the drawn units.
    progress : callable, optional
        Called with a line of text.

    Returns
    -------
    Lot

    Raises
    ------
    InputError
        If runs do not fit the model or one another, or the units are too few.

    Notes
    -----
    Page ``theory/lots.md``.  Each unit's error is split into orders.  Units are drawn from the processes and solved
    at the load until the covariance of their orders is that of the lot's: the method of simulated moments.
    """
    reducer_of(model.mechanism, "a lot")
    tell = progress or (lambda text: None)
    amplitudes = amplitudes_given(model, units)
    tell(f"{count_of(len(amplitudes.values), 'unit')}, {', '.join(map(str, amplitudes.conditions))}")
    question = question_of(model, amplitudes, processes_of(model, amplitudes.conditions[0], tolerances), seed)
    if not question.simulator.parts.processes:
        raise InputError("no process shows in these runs at this load; measure at another torque, or with less noise")
    simulator = question.simulator
    values = simulator.amplitudes.values * simulator.scale
    everyone = np.ones(len(values), np.bool_)
    cleaned = _Cleaned(values, everyone, everyone)
    estimate: LotEstimate | None = None
    for number in range(3):
        matching = _matching(simulator, question, cleaned, seed, tell)
        estimate = matching.estimate(question.start if estimate is None else estimate.state, again=estimate is not None)
        before, cleaned = cleaned, _clean(simulator, values, estimate, seed, cleaned)
        if cleaned.same == before.same and (number or not estimate.poor):
            break
        tell(
            "once more, without units and groups that differ"
            if cleaned.same != before.same
            else "once more, from elsewhere"
        )
    assert estimate is not None
    predicted = _predicted(simulator, amplitudes, estimate, cleaned, seed)
    chance = float(scipy.special.chdtrc(estimate.freedom, estimate.chi_square))
    orders = simulator.amplitudes.orders
    means, shifts = _means(simulator, estimate, cleaned)
    return Lot(
        model.mechanism.name,
        int(cleaned.kept.sum()),
        tuple(map(str, amplitudes.conditions)),
        _processes(question, estimate, means, int(cleaned.kept.sum())),
        means,
        shifts,
        _stiffness(estimate),
        cleaned.outsiders,
        cleaned.differences,
        cleaned.changes,
        predicted,
        chance,
        orders.astype(np.float64),
        _rms(simulator.amplitudes, cleaned.values[cleaned.kept]),
        _rms(simulator.amplitudes, estimate.draws.values, noise=1.0),
        (*amplitudes.notes, *_used(cleaned), *(() if amplitudes.marked else (_UNMARKED,))),
        amplitudes.marked,
    )


def _used(cleaned: _Cleaned) -> list[str]:
    """Which units the processes are told from, where it is not all members."""
    count, members = int(cleaned.kept.sum()), int(cleaned.members.sum())
    told = f"told from {count} of {members} units: those without the differences and changes that are named"
    return [told] if count < members else []


def _matching(
    simulator: Simulator, question: Question, cleaned: _Cleaned, seed: int, tell: Callable[[str], None]
) -> MomentMatching:
    """The method for units that belong together, with the same draws each time."""
    rng = np.random.default_rng(seed)
    count = len(simulator.parts.process)
    standard, others = rng.standard_normal((2, _DRAWN, count))
    fresh = rng.standard_normal((3 * simulator.scale.size, count))
    sample = sample_of(cleaned.values[cleaned.kept], marked=simulator.amplitudes.marked)
    return MomentMatching(simulator, sample, standard - standard.mean(axis=0), others, fresh, question.least, tell)


def _clean(simulator: Simulator, values: Array, estimate: LotEstimate, seed: int, before: _Cleaned) -> _Cleaned:
    """Find how groups differ and means change, and what is then no member.

    Groups and changes are those of the units that were members before.  Units with either are left out of the
    estimate, where enough remain: influences of the first order do not take all of it off.
    """
    amplitudes, weight, influence = simulator.amplitudes, estimate.weight, estimate.draws.influence
    members = before.members
    candidates = candidates_of(influence, simulator.parts) if amplitudes.marked else ()
    serials = tuple(compress(amplitudes.serials, members))
    labels = {name: tuple(compress(given, members)) for name, given in amplitudes.labels.items()}
    about = values[members] - values[members].mean(axis=0)
    groups = group_differences(about, labels, weight, candidates, level=LEVEL / 2, seed=seed)
    left, alike = values.copy(), np.ones(len(values), np.bool_)
    for group in groups:
        of = np.array([value == group.value for value in amplitudes.labels[group.label]])
        left[of] -= _effect(candidates, group.causes)
        alike &= ~of
    about = left[members] - left[members].mean(axis=0)
    changes = changes_over_serial(about, serials, weight, candidates, level=LEVEL / 2, seed=seed)
    places = np.flatnonzero(members)
    for number, change in enumerate(changes):
        first, end = places[serials.index(change.since)], _end(steady(changes[:number], serials), places, len(values))
        left -= np.outer(course(change.course, first, end, len(values)), _effect(candidates, (change.cause,)))
    part, steady_units = steady(changes, serials), np.zeros(len(values), np.bool_)
    steady_units[places[part.start] if part.start else 0 : _end(part, places, len(values))] = True
    alike &= steady_units
    odd = _outsiders(simulator, left, steady_units, estimate, seed)
    members = ~np.isin(amplitudes.serials, [one.serial for one in odd])
    enough = (members & alike).sum() >= max(_LEFT[0], _LEFT[1] * len(values))
    return _Cleaned(left, members, members & alike if enough else members, odd, groups, changes)


def _outsiders(
    simulator: Simulator, values: Array, some: npt.NDArray[np.bool_], estimate: LotEstimate, seed: int
) -> tuple[Outsider, ...]:
    """Some units that are no members; none where they would be more than a fifth, for then they are the lot.

    After a change what is left of it would make its units no members.
    """
    rng = np.random.default_rng(seed + 1)
    drawn = simulator.values(estimate.state, rng.standard_normal((_MEMBERS, len(simulator.parts.process))))
    marked = simulator.amplitudes.marked
    members = drawn - marked * drawn.mean(axis=0) + rng.standard_normal(drawn.shape)
    found = outsiders(
        values[some] - marked * np.median(values[some], axis=0),
        tuple(compress(simulator.amplitudes.serials, some)),
        members,
        estimate.weight,
        estimate.draws.influence,
        simulator.parts,
        marked=marked,
        level=LEVEL,
    )
    return found if len(found) <= _SPOILT * len(values) else ()


def _effect(candidates: Sequence[ShiftSource], causes: Sequence[Shift]) -> Array:
    """What shifts change of a unit's amplitudes."""
    columns = {
        (c.key, tuple(c.indices.items()), c.parameters[0]): c.columns for c in candidates if len(c.parameters) == 1
    }
    return np.asarray(
        sum(columns[one.key, tuple(one.indices.items()), one.parameter][:, 0] * one.size.value for one in causes)
    )


def _end(part: slice, places: npt.NDArray[np.intp], units: int) -> int:
    """Where a part of the members ends among all units."""
    return int(places[part.stop]) if part.stop < len(places) else units


# --- what is said of it -----------------------------------------------------------------------------------------------


def _processes(question: Question, estimate: LotEstimate, means: Sequence[Shift], units: int) -> tuple[MadeBy, ...]:
    """Processes with their intervals, the largest share first."""
    simulator, state = question.simulator, estimate.state
    noise = simulator.amplitudes.noise
    power = np.einsum("cdd,d->c", estimate.draws.squares, noise) * state.deviation**2
    found, limits = [], _limits(simulator, estimate, units)
    for number, process in enumerate(simulator.parts.processes):
        variance, error = float(state.deviation[number] ** 2), float(estimate.variance_error[number])
        size = Interval(math.sqrt(variance), *interval(variance, error))
        needed = math.ceil(units * (1.96 * error / (2 * variance) / _PRECISE) ** 2) if size.low > 0 else None
        found.append(
            _made(
                process,
                size,
                means,
                share=float(power[number] / power.sum()),
                alike=tuple(one.label for one in question.alike[number]),
                units_needed=needed,
                least_difference=limits[number][0],
                least_error=limits[number][1],
            )
        )
    found.sort(key=lambda one: -one.share)
    return (*found, *(_made(process, None, share=0.0) for process in question.silent))


def _limits(
    simulator: Simulator, estimate: LotEstimate, units: int
) -> list[tuple[float, float]] | list[tuple[None, None]]:
    """Of each process what its least visible part has to be off: between halves of the lot, and in one unit."""
    if not simulator.amplitudes.marked:
        return [(None, None)] * len(simulator.parts.processes)
    columns, parts = estimate.draws.influence, simulator.parts
    information = np.einsum("dp,de,ep->p", columns, estimate.weight, columns)
    least = np.array([information[parts.process == number].min() for number in range(len(parts.processes))])
    differences = detection_limit(least * units / 4, tests=len(information), level=LEVEL / 2)
    errors = detection_limit(least, tests=len(information) * units, level=LEVEL)
    return list(zip(differences.tolist(), errors.tolist(), strict=True))


def _made(process: Process, size: Interval | None, means: Sequence[Shift] = (), **told: Any) -> MadeBy:
    tolerance, above = process.tolerance, size is not None and size.low > 0
    if tolerance is not None and size is not None and above:
        reach = 3.0 if len(process.parameters) < 2 or not tolerance.in_vectors else math.sqrt(-2 * math.log(OUTSIDE))
        own = [m.size.value for m in means if m.key == process.key and m.indices == process.indices]
        wanted = [tolerance.mean.get(parameter.name, 0.0) for parameter in process.parameters]
        told["capability"] = tolerance.width / (reach * size.value)
        if own:
            off = math.hypot(*(mean - middle for mean, middle in zip(own, wanted, strict=True)))
            told["capability_centred"] = (tolerance.width - off) / (reach * size.value)
    return MadeBy(
        key=process.key,
        indices=process.indices,
        parameters=tuple(parameter.name for parameter in process.parameters),
        dimension=process.parameters[0].dimension,
        deviation=size,
        above_zero=above,
        tolerance="" if tolerance is None else tolerance.label,
        **told,
    )


def _means(
    simulator: Simulator, estimate: LotEstimate, cleaned: _Cleaned
) -> tuple[tuple[Shift, ...], tuple[Shift, ...]]:
    """Means of each process' parts together, and of single ones where they are few; and which are told from none.

    At 5 % of all of them together; nothing without known marks.
    """
    if not simulator.amplitudes.marked:
        return (), ()
    parts = simulator.parts
    names, rows = list[tuple[Process, dict[str, int | str], int]](), list[Array]()
    for number, process in enumerate(parts.processes):
        members = np.flatnonzero(parts.process == number).reshape(len(process.instances), -1)
        for k in range(members.shape[1]):
            if len(members) > 1:
                rows.append(np.bincount(members[:, k], minlength=len(parts.process)) / len(members))
                names.append((process, dict(process.indices), k))
            for instance, row in zip(process.instances, members, strict=True) if len(members) <= _FEW else ():
                rows.append(np.eye(1, len(parts.process), row[k])[0])
                names.append((process, dict(instance), k))
    mean = cleaned.values[cleaned.kept].mean(axis=0)
    sizes, errors = estimate.means(np.array(rows), simulator, mean, cleaned.kept.sum())
    far = -float(scipy.special.ndtri(0.025 / len(rows)))
    found = tuple(
        Shift(
            process.key, indices, process.parameters[k].name, process.parameters[k].dimension,
            Interval(float(size), float(size - 1.96 * error), float(size + 1.96 * error)),
        )
        for (process, indices, k), size, error in zip(names, sizes, errors, strict=True)
    )  # fmt: skip
    return found, tuple(
        one
        for one, size, middle, error in zip(found, sizes, np.array(rows) @ parts.middle, errors, strict=True)
        if abs(size - middle) > far * error
    )


def _stiffness(estimate: LotEstimate) -> dict[str, Interval]:
    """Stiffnesses that the lot tells better than their prior, over the model's."""
    errors = np.sqrt(np.diag(estimate.covariance)[-COMPLIANCES:])
    return {
        name: Interval(math.exp(-value), math.exp(-value - 1.96 * error), math.exp(-value + 1.96 * error))
        for name, value, error in zip(SOFTENING, estimate.state.compliance, errors, strict=False)
        if error < 0.75 * STIFFNESS
    }


def _rms(amplitudes: Amplitudes, values: Array, noise: float = 0.0) -> Array:
    """Root mean square of each order about the units' mean, rad, shape (conditions, orders)."""
    power = (variance_of(values, marked=amplitudes.marked) + noise) * amplitudes.noise
    return np.asarray(np.sqrt(power.reshape(len(amplitudes.conditions), 2, -1).sum(axis=1)))


def _predicted(
    simulator: Simulator, amplitudes: Amplitudes, estimate: LotEstimate, cleaned: _Cleaned, seed: int
) -> tuple[Predicted, ...]:
    """Peak-to-peak of units to come, what is systematic as the measured units have it."""
    rng = np.random.default_rng(seed + 2)
    parts = simulator.parts
    lifted = (cleaned.values[cleaned.kept].mean(axis=0) - estimate.draws.mean) * amplitudes.marked
    drawn = rng.standard_normal((_PREDICTED, len(parts.process)))
    waves = simulator.waveforms(estimate.state, drawn)
    common = simulator.amplitudes.waves(lifted[None] / simulator.scale, waves.shape[-1])[0]
    sizes = np.ptp(waves + common, axis=2)
    within = [_p95(simulator, values + lifted, waves.shape[-1]) for values in _within_errors(estimate, rng)]
    spread = np.std(within, axis=0, ddof=1) / np.mean(within, axis=0)
    rows, known = amplitudes.values[cleaned.kept], np.isin(amplitudes.orders, simulator.amplitudes.orders)
    rows[:, np.tile(known, 2 * len(amplitudes.conditions))] = cleaned.values[cleaned.kept] / simulator.scale
    seen = np.ptp(amplitudes.waves(rows, waves.shape[-1]), axis=2)
    found = []
    for number, condition in enumerate(amplitudes.conditions):
        own = np.sort(sizes[:, number])
        value = float(np.quantile(own, _SHARE))
        low, high = own[[math.floor(len(own) * _SHARE - 1.96 * _SIDE), math.ceil(len(own) * _SHARE + 1.96 * _SIDE)]]
        more = 1.96 * value * float(spread[number])
        found.append(
            Predicted(
                str(condition),
                float(own.mean()),
                Interval(value, value - math.hypot(more, value - low), value + math.hypot(more, high - value)),
                (float(seen[:, number].mean()), float(np.quantile(seen[:, number], _SHARE))),
            )
        )
    return tuple(found)


_SHARE = 0.95  # of the units, below whose quantile they are
_SIDE = math.sqrt(_PREDICTED * _SHARE * (1 - _SHARE))  # places that the quantile of so many is off


def _p95(simulator: Simulator, values: Array, angles: int) -> Array:
    """Peak-to-peak that 95 % of units stay below, of their whitened amplitudes, rad, shape (conditions,)."""
    waves = simulator.amplitudes.waves(values / simulator.scale, angles)
    return np.asarray(np.quantile(np.ptp(waves, axis=2), _SHARE, axis=0))


def _within_errors(estimate: LotEstimate, rng: np.random.Generator) -> Iterator[Array]:
    """Amplitudes of the drawn units in states that the lot does not tell from the estimate, by their own changes."""
    draws, state = estimate.draws, estimate.state
    root = np.linalg.cholesky(estimate.covariance + 1e-12 * np.diag(np.diag(estimate.covariance)))
    for _ in range(_SETS):
        change, count = root @ rng.standard_normal(len(root)), len(state.deviation)
        deviation = np.sqrt(np.maximum(state.deviation**2 + change[:count], 0.0)) - state.deviation
        yield (
            draws.values
            + np.tensordot(deviation, draws.by_process, (0, 1))
            + np.tensordot(change[count:], draws.by_compliance, (0, 1))
        )
