"""The lot: from the runs of many finished units to the processes that made them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import count_of
from rverror.base.progress import Progress
from rverror.geartrain.source import IndexValue
from rverror.lots.amplitudes import Amplitudes, LotUnit, amplitudes_of, variance_of
from rverror.lots.differences import changes_over_serial, course, group_differences, steady
from rverror.lots.identifiable import Question, question_of
from rverror.lots.members import outsiders
from rverror.lots.moments import STIFFNESS, LotEstimate, MomentMatching, sample_of
from rverror.lots.own_equilibrium import OwnEquilibrium
from rverror.lots.processes import Process, UnitParts, processes_of
from rverror.lots.result import Change, Difference, Interval, Lot, MadeBy, Outsider, Predicted, Shift, sizes_of
from rverror.lots.shifts import ShiftSource, candidates_of
from rverror.lots.simulated import COMPLIANCES, Simulator
from rverror.model.effects import Model
from rverror.statics.loaded_state import SOFTENING, NotConvergedError, reducer_of
from rverror.tolerances.declared import Tolerance
from rverror.tolerances.distribution import OUTSIDE

#: False alarms of groups, changes and outsiders: in so many of all lots that have none, each.
LEVEL = 0.01
_DRAWN = 200  # units with influences, the same in every step: as many as a lot often has, so that both are as exact
_SPOILT = 0.2  # of the units that may be no members
_ASKED = 0.05  # share of the members beyond whose distance suspects are asked for their part: one in 20 in vain
_SUSPECTED = 0.5  # share of sound lots with a unit as far away, below which it is left out of the estimate
_ESTIMATES = 3  # at most, each without the units and groups that the one before tells apart
_ALIKE = 1 / 9  # of the units, without which an estimate moves by the root of that, a third of its standard errors
_BOUND = 10.0  # times the usual power of a unit: two errors that make all of it exceed that in one of 1000
_LEFT = (30, 0.4)  # units, and share of the lot, from which processes are told without groups and changes
# times the amplitudes, and at least: units of which the covariance and the mean influences of an estimate are made.  A
# covariance of n units takes d/n off a chi-square of d amplitudes; noise in the influences of 200 halved shifts
_FRESH = (6, 800)
_MEMBERS = 400  # units that show what a member may be
_PREDICTED = 600  # units of which the 95 % quantile is taken: it is then known to 2 % of the spread
_FEW = 12  # instances of a process, up to which each is told by itself
_SETS = 60  # states within the errors that tell how far the prediction is off
_UNMARKED = (
    "zeros are not on the marks (index: unknown): systematic errors are part of the standard deviations, and groups "
    "and changes are not searched"
)
# states within the errors, and units of each, that tell how far what a shift does is off: its standard deviation is
# then known to a fifth
_UNCERTAIN = (12, 60)
_PRECISE = 0.25  # share of a standard deviation within which its interval settles the matter


@dataclass(frozen=True)
class _Cleaned:
    """What was told of single units and groups, and the amplitudes without it."""

    values: Array
    members: npt.NDArray[np.bool_]  #: without suspects
    kept: npt.NDArray[np.bool_]  #: those that the processes are told from
    suspects: tuple[str, ...] = ()  #: members that are left out as they are far from the others
    outsiders: tuple[Outsider, ...] = ()
    gross: tuple[Outsider, ...] = ()  #: those of them that their own equilibrium tells
    differences: tuple[Difference, ...] = ()
    changes: tuple[Change, ...] = ()

    def like(self, other: _Cleaned) -> bool:
        """Whether the same is found, and the kept units tell the same processes within their errors."""
        found, others = (
            (
                {one.serial for one in some.outsiders}.union(some.suspects),
                [(d.label, d.value, d.causes[0].key) for d in some.differences],
                [(c.course, c.cause.key) for c in some.changes],
            )
            for some in (self, other)
        )
        return found == others and bool(np.mean(self.kept != other.kept) <= _ALIKE * np.mean(other.kept))


def lot(
    model: Model,
    units: Sequence[LotUnit] | Amplitudes,
    *,
    tolerances: Sequence[Tolerance] | None = None,
    seed: int = 0,
    progress: Progress | None = None,
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
    amplitudes = amplitudes_of(model, units)
    tell(f"{count_of(len(amplitudes.values), 'unit')}, {', '.join(map(str, amplitudes.conditions))}")
    question = question_of(model, amplitudes, processes_of(model, amplitudes.conditions[0], tolerances), seed)
    simulator = question.simulator
    if not simulator.parts.processes:
        raise InputError("no process shows in these runs at this load; measure at another torque, or with less noise")
    values = simulator.amplitudes.values * simulator.scale
    everyone = np.ones(len(values), np.bool_)
    bounded = _bounded(values, marked=amplitudes.marked)
    cleaned, state, others = _Cleaned(bounded, everyone, everyone), question.start, tuple[LotEstimate, ...]()
    for number in range(_ESTIMATES):
        matching = _matching(simulator, question, cleaned, seed, tell)
        estimate = matching.estimate(state, again=number > 0)
        others = estimate.others or others  # a fit that begins near asks for no others
        settled, last = number > 0 or not estimate.poor, number == _ESTIMATES - 1
        before, cleaned = cleaned, _clean(matching, estimate, seed, cleaned, settled=settled, last=last)
        state, same = estimate.state, cleaned.like(before)
        if same and settled and (number > 0 or np.array_equal(bounded, values)):
            cleaned = replace(cleaned, kept=before.kept)
            break
        tell("once more" if same else "once more, without units and groups that differ")
    estimate = replace(estimate, others=others)
    means, shifts = _means(simulator, estimate, cleaned)
    return Lot(
        model=model.mechanism.name,
        units=int(cleaned.kept.sum()),
        conditions=tuple(map(str, amplitudes.conditions)),
        processes=_processes(question, estimate, means, int(cleaned.kept.sum())),
        means=means,
        shifts=shifts,
        stiffness=_stiffness(estimate),
        outsiders=cleaned.outsiders,
        differences=cleaned.differences,
        changes=cleaned.changes,
        predicted=_predicted(simulator, amplitudes, estimate, cleaned, seed),
        chance=float(scipy.special.chdtrc(estimate.freedom, estimate.chi_square)),
        orders=simulator.amplitudes.orders.astype(np.float64),
        amplitudes=_rms(simulator.amplitudes, cleaned.values[cleaned.kept]),
        made=_rms(simulator.amplitudes, estimate.draws.values, noise=1.0),
        notes=_notes(amplitudes, cleaned, estimate, simulator),
        marked=amplitudes.marked,
    )


def _notes(amplitudes: Amplitudes, cleaned: _Cleaned, estimate: LotEstimate, simulator: Simulator) -> tuple[str, ...]:
    count, members = int(cleaned.kept.sum()), int(cleaned.members.sum())
    notes = list(amplitudes.notes)
    if cleaned.suspects:
        notes.append(f"far from the other units, and left out of the estimate: {', '.join(cleaned.suspects)}")
    if count < members:
        notes.append(f"told from {count} of {members} units: those without the differences and changes that are named")
    if not amplitudes.marked:
        notes.append(_UNMARKED)
    for at in estimate.more_elsewhere(simulator.amplitudes.noise):
        notes.append(
            f"a fit with more of {simulator.parts.processes[at].label} is as likely, and the intervals hold both; "
            "units measured at another torque may tell them apart"
        )
    return tuple(notes)


def _matching(simulator: Simulator, question: Question, cleaned: _Cleaned, seed: int, tell: Progress) -> MomentMatching:
    """The method for units that belong together, with the same draws each time."""
    rng = np.random.default_rng(seed)
    count = len(simulator.parts.process)
    standard, others = rng.standard_normal((2, _DRAWN, count))
    fresh = rng.standard_normal((max(_FRESH[0] * simulator.scale.size, _FRESH[1]), count))
    sample = sample_of(cleaned.values[cleaned.kept], marked=simulator.amplitudes.marked)
    return MomentMatching(simulator, sample, standard - standard.mean(axis=0), others, fresh, question.least, tell)


def _bounded(values: Array, *, marked: bool) -> Array:
    """Amplitudes, no unit's with more than some times the usual power, lest gross errors widen a process (masking)."""
    middle = np.median(values, axis=0) * marked
    power = np.sum((values - middle) ** 2, axis=1, keepdims=True)
    most = _BOUND * np.median(power)
    return np.where(power > most, middle + np.sqrt(most / np.maximum(power, most)) * (values - middle), values)


@dataclass(frozen=True)
class _ShiftedUnits:
    """Units of an estimate, solved with shifts of their parts."""

    matching: MomentMatching
    estimate: LotEstimate
    seed: int

    def effects(self, sources: Sequence[ShiftSource], sizes: Sequence[Array], units: int) -> Array:
        """What each shift and its opposite do to the amplitudes of so many units, (units, sources, 2, d)."""
        simulator, state = self.matching.simulator, self.estimate.state
        standard = np.random.default_rng(self.seed + 3).standard_normal((units, len(simulator.parts.process)))
        shifts = np.array([_shift(simulator.parts, one, some) for one, some in zip(sources, sizes, strict=True)])
        return simulator.shift_effects(state, standard, shifts, self.estimate.influence)

    def covariance(self, source: ShiftSource, sizes: Array) -> Array:
        """That of the amplitudes of a unit with a shift, (d, d); of one without where none has an equilibrium."""
        with suppress(NotConvergedError):
            parts = self.matching.simulator.parts
            return self.matching.covariance_with(self.estimate.state, _shift(parts, source, sizes))
        return np.asarray(np.linalg.inv(self.estimate.weight))

    def uncertainty(self, source: ShiftSource, sizes: Array) -> Array:
        """What the estimate's errors do to the mean change by a shift, as rows R with the covariance R'R, (k, d); none
        where units of some state have no equilibrium with it."""
        simulator, rng = self.matching.simulator, np.random.default_rng(self.seed + 4)
        standard = rng.standard_normal((_UNCERTAIN[1], len(simulator.parts.process)))
        shift = _shift(simulator.parts, source, sizes)
        states = [self.estimate.state, *self.estimate.states_within(_UNCERTAIN[0], rng)]
        with suppress(NotConvergedError):
            own, *others = (simulator.mean_change(state, standard, shift) for state in states)
            return (np.array(others) - own) / math.sqrt(len(others))
        return np.empty((0, len(self.estimate.weight)))


def _shift(parts: UnitParts, source: ShiftSource, sizes: Array) -> Array:
    """What a shift changes of the errors of all parts, shape (components,)."""
    return parts.shifted(source.key, source.indices, dict(zip(source.parameters, sizes, strict=True)))


def _clean(
    matching: MomentMatching, estimate: LotEstimate, seed: int, before: _Cleaned, *, settled: bool, last: bool
) -> _Cleaned:
    """Find how groups differ and means change, and what is then no member: by its own equilibrium too once the estimate
    has settled and the members are the same as before, or no other estimate follows.

    Groups and changes are those of the units that were members before, and no suspects: one gross error outweighs a
    shift of all.  Units with either are left out of the estimate, where enough remain: what is known of a shift takes
    it off in the mean alone.  Suspects are left out too, lest gross errors widen a process until they are its members.
    Where units by themselves would be more than a fifth, they are the lot, and none is named.
    """
    simulator = matching.simulator
    amplitudes, parts, weight = simulator.amplitudes, simulator.parts, estimate.weight
    candidates = candidates_of(estimate.influence, parts) if amplitudes.marked else ()
    places = np.flatnonzero(before.members)
    serials = [amplitudes.serials[place] for place in places]
    labels = {name: tuple(given[place] for place in places) for name, given in amplitudes.labels.items()}
    values = amplitudes.values * simulator.scale
    left, alike = values.copy(), np.ones(len(values), np.bool_)
    middle = np.tile(parts.middle, (len(values), 1))  # mean errors of each unit's parts

    shifted = _ShiftedUnits(matching, estimate, seed)
    groups = group_differences(
        amplitudes.about_mean(left[places]), labels, weight, candidates, shifted=shifted, level=LEVEL / 2, seed=seed
    )
    for group, effect in groups:
        inside = np.array([value == group.value for value in amplitudes.labels[group.label]])
        left -= effect.of(inside.astype(np.float64))
        middle[inside] += _shifted(parts, group.causes)
        alike &= ~inside

    changed = changes_over_serial(
        amplitudes.about_mean(left[places]), serials, weight, candidates, shifted=shifted, level=LEVEL / 2, seed=seed
    )
    changes = [change for change, _ in changed]
    ends = [0, *places[1:], len(values)]  # of parts of the members among all units
    for number, (change, effect) in enumerate(changed):
        first, end = places[serials.index(change.since)], ends[steady(changes[:number], serials).stop]
        share = course(change.course, first, end, len(values))
        left -= effect.of(share)
        middle += np.outer(share, _shifted(parts, (change.cause,)))
    part = steady(changes, serials)
    unchanged = np.zeros(len(values), np.bool_)
    unchanged[ends[part.start] : ends[part.stop]] = True

    suspects = _outsiders(simulator, left, unchanged, estimate, seed)
    odd = [one for one in suspects if one.chance < LEVEL / (1 + amplitudes.marked)]  # half for their own equilibrium

    def cleaned(gross: tuple[Outsider, ...]) -> _Cleaned:
        told, most = {one.serial: one for one in (*odd, *gross)}, _SPOILT * len(values)
        some = tuple(sorted(told.values(), key=lambda one: one.chance)) if len(told) <= most else ()
        far = sorted({one.serial for one in suspects} - told.keys())
        far = far if len(told) + len(far) <= most else []
        members = ~np.isin(amplitudes.serials, [*(one.serial for one in some), *far])
        kept = alike & members & unchanged
        enough = kept.sum() >= max(_LEFT[0], _LEFT[1] * len(values))
        differences = tuple(difference for difference, _ in groups)
        return _Cleaned(
            left, members, kept if enough else members, tuple(far), some, gross, differences, tuple(changes)
        )

    found = cleaned(before.gross)
    if not amplitudes.marked or not (last or (settled and found.like(before))):
        return found
    asked = unchanged & ~np.isin(amplitudes.serials, [one.serial for one in before.gross])
    away = left[asked] - np.median(left[unchanged], axis=0)
    suspected = np.isin(amplitudes.serials, [*found.suspects, *(one.serial for one in odd)])
    share = np.where(suspected[asked], _ASKED, LEVEL / 2 / asked.sum())
    far = np.einsum("ud,de,ue->u", away, weight, away)
    units, theirs = (values - left)[asked] + away + estimate.draws.mean, tuple(compress(amplitudes.serials, asked))
    own = OwnEquilibrium.of(simulator, estimate, seed)
    more = own.outsiders(theirs, units, middle[asked], far, share, level=LEVEL / 2)
    return cleaned((*before.gross, *more))


def _outsiders(
    simulator: Simulator, values: Array, some: npt.NDArray[np.bool_], estimate: LotEstimate, seed: int
) -> tuple[Outsider, ...]:
    """Some units that may be no members, by influences of the first order and all in all.

    After a change what is left of it would make its units no members.
    """
    rng, marked = np.random.default_rng(seed + 1), simulator.amplitudes.marked
    drawn = simulator.values(estimate.state, rng.standard_normal((_MEMBERS, len(simulator.parts.process))))
    members = simulator.amplitudes.about_mean(drawn) + rng.standard_normal(drawn.shape)
    units, serials = values[some], tuple(compress(simulator.amplitudes.serials, some))
    units = units - marked * np.median(units, axis=0)
    weight, influence, parts = estimate.weight, estimate.influence, simulator.parts
    return outsiders(units, serials, members, weight, influence, parts, marked=marked, level=_SUSPECTED)


def _shifted(parts: UnitParts, causes: Sequence[Shift]) -> Array:
    """What shifts of the same parts change of the errors of all, shape (components,)."""
    return parts.shifted(causes[0].key, causes[0].indices, {one.parameter: one.size.value for one in causes})


# --- what is said of it -----------------------------------------------------------------------------------------------


def _processes(question: Question, estimate: LotEstimate, means: Sequence[Shift], units: int) -> tuple[MadeBy, ...]:
    """Processes with their intervals, the largest share first."""
    shares, found = estimate.shares(question.simulator.amplitudes.noise), []
    for number, process in enumerate(question.simulator.parts.processes):
        variance, error = float(estimate.state.deviation[number] ** 2), float(estimate.variance_error[number])
        size = Interval(math.sqrt(variance), *estimate.interval(number))
        above = size.low > 0
        capability, centred = _capability(process, size.value, means) if above else (None, None)
        found.append(
            replace(
                _not_shown(process),
                deviation=size,
                above_zero=above,
                share=float(shares[number]),
                alike=tuple(one.label for one in question.alike[number]),
                units_needed=math.ceil(units * (1.96 * error / (2 * variance) / _PRECISE) ** 2) if above else None,
                capability=capability,
                capability_centred=centred,
            )
        )
    found.sort(key=lambda one: -one.share)
    return (*found, *map(_not_shown, question.silent))


def _not_shown(process: Process) -> MadeBy:
    """A process of which a lot tells nothing."""
    names = tuple(parameter.name for parameter in process.parameters)
    tolerance = "" if process.tolerance is None else process.tolerance.label
    return MadeBy(process.key, process.indices, names, process.parameters[0].dimension, tolerance=tolerance)


def _capability(process: Process, deviation: float, means: Sequence[Shift]) -> tuple[float | None, float | None]:
    """Cp and Cpk of a process that has a tolerance."""
    tolerance = process.tolerance
    if tolerance is None:
        return None, None
    vectors = len(process.parameters) > 1 and tolerance.in_vectors
    needed = deviation * (math.sqrt(-2 * math.log(OUTSIDE)) if vectors else 3.0)
    own = sizes_of(means, process.key, process.indices)
    if not own:
        return tolerance.width / needed, None
    off = math.hypot(*(own[p.name] - tolerance.mean.get(p.name, 0.0) for p in process.parameters))
    return tolerance.width / needed, (tolerance.width - off) / needed


def _means(
    simulator: Simulator, estimate: LotEstimate, cleaned: _Cleaned
) -> tuple[tuple[Shift, ...], tuple[Shift, ...]]:
    """Means of each process' parts together, and of single ones where they are few; and which are told from none.

    At 5 % of all of them together; nothing without known marks.
    """
    if not simulator.amplitudes.marked:
        return (), ()
    parts = simulator.parts
    found, rows = list[tuple[str, dict[str, IndexValue], str, str]](), list[Array]()
    for process in parts.processes:
        together = [process.indices] if len(process.instances) > 1 else []
        for indices in (*together, *(process.instances if len(process.instances) <= _FEW else ())):
            for parameter in process.parameters:
                found.append((process.key, dict(indices), parameter.name, parameter.dimension))
                alike = parts.shifted(process.key, indices, {parameter.name: 1.0})
                rows.append(alike / alike.sum())
    mean = cleaned.values[cleaned.kept].mean(axis=0)
    sizes, errors = estimate.means(np.array(rows), simulator, mean, cleaned.kept.sum())
    far = -float(scipy.special.ndtri(0.025 / len(rows)))
    means = tuple(
        Shift(*one, Interval(size, size - 1.96 * error, size + 1.96 * error))
        for one, size, error in zip(found, sizes.tolist(), errors.tolist(), strict=True)
    )
    off = np.abs(sizes - np.array(rows) @ parts.middle) > far * errors
    return means, tuple(compress(means, off))


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
    rng, marked, few = np.random.default_rng(seed + 2), amplitudes.marked, simulator.amplitudes
    lifted = (cleaned.values[cleaned.kept].mean(axis=0) - estimate.draws.mean) * marked
    waves = simulator.waveforms(estimate.state, rng.standard_normal((_PREDICTED, len(simulator.parts.process))))
    angles = waves.shape[-1]
    common = few.waves(lifted[None] / simulator.scale, angles)[0]
    to_come = np.sort(np.ptp(waves + common, axis=2), axis=0)
    draws, state, within = estimate.draws, estimate.state, list[Array]()
    for other in estimate.states_within(_SETS, rng):  # the drawn units there, by their own changes
        units = draws.values + np.tensordot(other.deviation - state.deviation, draws.by_process, (0, 1))
        units = units + np.tensordot(other.compliance - state.compliance, draws.by_compliance, (0, 1)) + lifted
        within.append(np.quantile(np.ptp(few.waves(units / simulator.scale, angles), axis=2), _SHARE, axis=0))
    spread = np.std(within, axis=0, ddof=1) / np.mean(within, axis=0)
    rows, known = amplitudes.values[cleaned.kept], np.isin(amplitudes.orders, few.orders)
    rows[:, np.tile(known, 2 * len(amplitudes.conditions))] = cleaned.values[cleaned.kept] / simulator.scale
    seen = np.ptp(amplitudes.waves(rows, angles), axis=2)
    found = []
    for number, condition in enumerate(amplitudes.conditions):
        own, measured = to_come[:, number], seen[:, number]
        value, more = float(np.quantile(own, _SHARE)), float(spread[number])
        places = len(own) * _SHARE + 1.96 * _SIDE * np.array([-1, 1])
        low, high = own[math.floor(places[0])], own[math.ceil(places[1])]
        down, up = (math.hypot(1.96 * value * more, side) for side in (value - low, high - value))
        told = float(measured.mean()), float(np.quantile(measured, _SHARE))
        found.append(Predicted(str(condition), float(own.mean()), Interval(value, value - down, value + up), told))
    return tuple(found)


_SHARE = 0.95  # of the units, below whose quantile they are
_SIDE = math.sqrt(_PREDICTED * _SHARE * (1 - _SHARE))  # places that the quantile of so many is off
