"""The closed loop for any geared drive: every effect is linear, and runs need neither whole turns nor one direction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from scipy.stats import chi2
from scipy.stats import t as student

from rverror import units
from rverror.action_line import Array
from rverror.catalogue import CATALOGUE, IndexValue, source
from rverror.coloured import (
    Labels,
    Noise,
    burg,
    distance,
    kept_share,
    lengths,
    normal,
    orthonormal,
    significant,
    solve,
    spectrum_freedom,
)
from rverror.compose import pose, source_matrix
from rverror.diagnosis import (
    Addition,
    Alike,
    Candidate,
    Diagnosis,
    Estimate,
    Line,
    Progress,
    Residual,
    Trace,
    describe,
)
from rverror.errors import InputError
from rverror.kinematics import true_period
from rverror.measurement import Run, torque_column
from rverror.model import Effect, Model
from rverror.reducer import Drive
from rverror.sensor import slope
from rverror.spectrum import frames_of_order
from rverror.units import ARCSEC

_TURN = 2 * np.pi
_FALSE_ALARM = 3e-3  # chance that any candidate passes by luck
_FALSE_LINE = 1e-3  # that any order does
_ALIKE = 0.01  # chance that what fits worse by so much is the true one
_MOST = 12  # effects, and lines
_FLOOR = 1e-3 * ARCSEC  # white noise that every reading has: a perfect fit is no certainty
_ACCURACY = 0.03 * ARCSEC  # lines below are not reported: the prediction does not claim to be better
_APART = 1e-4  # a candidate keeps this share of its power beside what is there, or is not tried
_APART_IMPLAUSIBLE = 0.05
_SHARE = 0.5  # of an implausible candidate's gain that lets a plausible one go first
_PEAKS = 6
_LEAST_SAMPLES = 4.0
_TRACE_POINTS = 2048
_SMEARED = 6.0  # cycles a run between a strong line and what it may be mistaken for
_LEAST_CYCLES = 1.5  # less of a wave is no line but a slope or a bow

_OFFSET, _DECLARED, _EFFECT, _NUISANCE, _LINE = "offset", "declared", "effect", "nuisance", "line"
_BESIDE = "beside a drift"
_BOW = "slow curvature over time"


@dataclass(frozen=True, eq=False)
class _Term:
    """Rows that enter a fit as one block."""

    kind: str
    name: str  # a key of the catalogue, or words
    rows: Array  # (k, samples of all runs)
    indices: Mapping[str, IndexValue] = field(default_factory=dict)
    orders: tuple[float, ...] = ()
    sigma: float = np.inf  # how well the values are known beforehand
    means: tuple[float, ...] = ()

    @property
    def size(self) -> int:
        return len(self.rows)

    @property
    def label(self) -> str:
        return describe(self.name, self.indices)


@dataclass(frozen=True, eq=False)
class _Data:
    """All runs, one after another."""

    drive: Drive
    names: tuple[str, ...]
    slices: tuple[slice, ...]
    theta: Array
    direction: Array
    clock: Array  # time, or number of the sample
    signal: Array  # less what is declared as exact
    labels: Labels  # block of samples that is left out together
    blocks_are: tuple[str, ...]
    quantity: str
    floor: float

    @property
    def turns(self) -> float:
        """Output turns that the longest run covers."""
        return max(float(np.ptp(self.theta[at])) for at in self.slices) / _TURN


@dataclass(frozen=True, eq=False)
class _Fit:
    """Terms and their joint fit."""

    terms: tuple[_Term, ...]
    all_values: Array
    spread: Array  # covariance of the values
    residual: Array
    weights: Array  # of each run's squares
    samples: Array  # independent ones, as each value sees the noise

    def at(self, term: _Term) -> slice:
        """Place of a term's values."""
        first = sum(t.size for t in self.terms[: self.terms.index(term)])
        return slice(first, first + term.size)

    def values(self, term: _Term) -> Array:
        return self.all_values[self.at(term)]

    def own_spread(self, term: _Term) -> Array:
        return self.spread[self.at(term), self.at(term)]

    def own_samples(self, term: _Term) -> float:
        return float(self.samples[self.at(term)].min())

    def significant(self, term: _Term, accepted: float) -> bool:
        """Tell whether a term differs from 0 more than it does by chance."""
        return significant(self.values(term), self.own_spread(term), accepted, self.own_samples(term))

    def reach(self, term: _Term, spread: Array) -> Array:
        """Half width of the 95 % interval of a value, or a sum of a term's values, with a variance."""
        return np.asarray(np.sqrt(spread) * student.isf(0.025, self.own_samples(term)), dtype=np.float64)

    def distance(self, term: _Term) -> float:
        """Squared distance of a term from 0 in standard deviations."""
        return distance(self.values(term), self.own_spread(term))


def diagnose_drive(model: Model, runs: Sequence[Run], progress: Progress | None = None) -> Diagnosis:
    """Find the effect that the model of a geared drive lacks in measured runs.

    Every effect is linear in its sizes.  Candidates of the catalogue, slow curvature, lost motion between directions
    and free lines of any order compete; what is significant under the coloured noise of the runs and helps on blocks
    of samples that were left out is added, one after another, and all is refitted together each time.

    Parameters
    ----------
    model : Model
        Of a `Drive`: what was declared, with its uncertainty.
    runs : sequence of Run
        Each may turn both ways, over any travel, unevenly.
    progress : callable, optional
        Called with a line of text as the work goes on.

    Returns
    -------
    Diagnosis
        Of a torque record (one angle and a ``torque[..]`` column) `quantity` is ``torque`` and sizes are in N*mm.

    Raises
    ------
    InputError
        If a run cannot be used; the message says why.

    Notes
    -----
    docs/theory/drives.md.
    """
    tell = progress or (lambda text: None)
    data, notes = _gather(model, runs)
    base = [*_offsets(data), *_declared(model, runs, data)]
    candidates = _candidates(model, runs, data)
    nuisances = _nuisances(data)
    fit, ranking = _search(data, base, candidates, nuisances, tell)
    tell("searching the residual for lines of any order")
    fit = _add_lines(data, fit)
    added = _in_order([t for t in fit.terms if t.kind == _EFFECT])
    declared = [t for t in base if t.kind == _DECLARED]
    as_printed = replace(data, signal=data.signal - _prior_sum(declared, data))
    offsets = [t for t in base if t.kind == _OFFSET]
    additions = tuple(
        _addition(data, model, fit, term, candidates, [*base, *added[: place + 1]]) for place, term in enumerate(added)
    )
    lines = tuple(sorted(_lines(data, fit), key=lambda line: -line.amplitude))
    notes += _told(data, fit)
    if (data.direction > 0).all() or (data.direction < 0).all():
        notes.append("runs in one direction only: lost motion does not show; add a reverse run")
    settled = "explained" if added else "nothing_missing"
    explained = [t for t in fit.terms if t.kind != _LINE]
    before = _residual(as_printed, offsets, fit)
    return Diagnosis(
        verdict="unexplained" if lines else settled,
        noise_rms=float(np.sqrt(np.mean(fit.residual**2))),
        before=before,
        before_refitted=_residual(data, base, fit) if declared else before,
        after=_residual(data, explained, fit),
        added=additions,
        unexplained=lines,
        model=_fitted_model(model, data, fit, additions),
        declared=model,
        candidates=ranking,
        tried=len(candidates),
        traces=_traces(data, base, fit),
        notes=tuple(notes),
        quantity=data.quantity,
    )


# --- runs -------------------------------------------------------------------------------------------------------------


def _gather(model: Model, runs: Sequence[Run]) -> tuple[_Data, list[str]]:
    drive = model.mechanism
    assert isinstance(drive, Drive)
    if not runs:
        raise InputError("no run given; diagnose needs one or more run files")
    kinds = {_is_torque_record(run) for run in runs}
    if len(kinds) > 1:
        raise InputError("some runs are torque records and others hold an error; diagnose them apart")
    quantity = "torque" if kinds.pop() else "angle"
    names, parts, notes, kept = [], [], [], 0
    for number, run in enumerate(runs):
        name = run.path or f"run {number + 1}"
        if run.index == "unknown" and (len(runs) > 1 or model.effects):
            raise InputError(
                f"{name}: index is 'unknown'; runs are compared at the drive's angle, so the bench's zero must stand "
                "on the drive's marks: align them and leave the line out, or diagnose this run alone"
            )
        if run.time is None and any(e.key == "sensor.time_offset" for e in model.effects):
            raise InputError(f"{name}: sensor.time_offset needs a time[s] column; add it or remove the effect")
        notes += [f"{name}: {note}" for note in run.notes]
        theta, signal, first = _signal(run, drive, name, quantity)
        if first:
            notes.append(f"{name}: {first} samples of standstill and run-up left out")
        clock = np.arange(theta.size, dtype=np.float64) if run.time is None else run.time - run.time[0]
        for effect in model.effects:
            if not effect.uncertainty and quantity == "angle":
                signal = signal - np.array(effect.values) @ _rows(run, drive, theta, effect.key, effect.indices)
        labels, what = _blocks(theta[first:], run.direction[first:], drive)
        notes.append(f"{name}: held-out figures leave out one of {labels.max() + 1} blocks at a time, {what}")
        parts.append((theta[first:], run.direction[first:], clock[first:], signal[first:], labels + kept, what))
        kept += int(labels.max()) + 1
        names.append(name)
    ends = np.cumsum([0, *(part[0].size for part in parts)])
    signal = np.concatenate([part[3] for part in parts])
    data = _Data(
        drive=drive,
        names=tuple(names),
        slices=tuple(slice(int(a), int(b)) for a, b in pairwise(ends)),
        theta=np.concatenate([part[0] for part in parts]),
        direction=np.concatenate([part[1] for part in parts]),
        clock=np.concatenate([part[2] for part in parts]),
        signal=signal,
        labels=np.concatenate([part[4] for part in parts]),
        blocks_are=tuple(part[5] for part in parts),
        quantity=quantity,
        floor=_FLOOR if quantity == "angle" else 1e-6 * float(np.std(signal)),
    )
    return data, notes


def _is_torque_record(run: Run) -> bool:
    angles = sum(column is not None for column in (run.input_angle, run.output_angle))
    return run.te_column is None and angles == 1 and torque_column(run.extra) is not None


def _signal(run: Run, drive: Drive, name: str, quantity: str) -> tuple[Array, Array, int]:
    """Nominal output angle and the signal of a run, and how many samples at its start are no steady motion."""
    if quantity == "angle":
        return run.nominal_angle(drive), run.error(drive), 0
    column = torque_column(run.extra)
    assert column is not None
    try:
        factor = units.unit_factor(column.partition("[")[2].rstrip("]"), "torque")
    except ValueError as problem:
        raise InputError(f"{name}: {column}: {problem}") from problem
    values = run.extra[column] * factor
    if not np.isfinite(values).all():
        missing = int(np.count_nonzero(~np.isfinite(values)))
        raise InputError(f"{name}: {column}: {missing} cells hold no number; delete or complete those rows")
    theta = run.output_angle if run.output_angle is not None else run.nominal_angle(drive)
    clock = np.arange(theta.size, dtype=np.float64) if run.time is None else run.time
    speed = np.abs(slope(theta, clock))
    steady = np.flatnonzero(speed > 0.5 * np.median(speed))
    first = int(steady[0]) if steady.size else 0
    # the drive swings about its speed for as long again as it takes to reach it
    return theta, values, min(2 * first, theta.size // 4)


def _rows(run: Run, drive: Drive, theta: Array, key: str, indices: Mapping[str, IndexValue]) -> Array:
    """Influence of one source in one run, shape (terms, n)."""
    motion = pose(drive, theta, direction=run.direction, time=run.time)
    return source_matrix(motion, {"output": np.ones((1, theta.size))}, key, indices)


def _blocks(theta: Array, direction: Array, drive: Drive) -> tuple[Labels, str]:
    """Number of each sample's block, from 0: what is left out together."""
    n = theta.size
    starts = np.flatnonzero((direction[1:] > 0) & (direction[:-1] < 0)) + 1
    if starts.size >= 3:
        return _tidy(np.searchsorted(starts, np.arange(n), side="right")), "cycles of the motion"
    one_way = (direction == direction[0]).all()
    way = np.abs(theta - theta[0])
    travel = float(np.ptp(theta)) * n / (n - 1)
    if one_way:
        whole = _TURN * true_period(drive)
        shafts = {"input": drive.ratio, **drive.shafts}
        periods = {whole: "whole periods of the drive", _TURN: "output turns"}
        periods |= {_TURN / abs(order): f"turns of the {name} shaft" for name, order in shafts.items()}
        for least in (3, 2):
            for period in sorted(periods, reverse=True):
                if travel >= least * period * (1 - 1e-6):
                    return _tidy(np.floor(way / period + 1e-9).astype(np.intp)), periods[period]
    return np.arange(n) * 4 // n, "quarters of the run"


def _tidy(labels: Labels) -> Labels:
    """Labels from 0, a first or last block shorter than half joined to its neighbour, and at most 24 blocks."""
    names, count = np.unique(labels, return_counts=True)
    labels = np.searchsorted(names, labels)
    typical = float(np.median(count))
    if names.size > 2 and count[-1] < typical / 2:
        labels = np.minimum(labels, names.size - 2)
    if names.size > 2 and count[0] < typical / 2:
        labels = np.maximum(labels - 1, 0)
    blocks = int(labels.max()) + 1
    return labels * 24 // blocks if blocks > 24 else labels


# --- terms ------------------------------------------------------------------------------------------------------------


def _offsets(data: _Data) -> list[_Term]:
    return [
        _Term(_OFFSET, f"offset of {name}", _own(data, at, np.ones((1, at.stop - at.start))))
        for name, at in zip(data.names, data.slices, strict=True)
    ]


def _own(data: _Data, at: slice, rows: Array) -> Array:
    """Rows of one run among all samples."""
    result = np.zeros((len(rows), data.theta.size))
    result[:, at] = rows
    return result


def _effect_rows(runs: Sequence[Run], data: _Data, key: str, indices: Mapping[str, IndexValue]) -> Array:
    parts = []
    for run, at in zip(runs, data.slices, strict=True):
        count = at.stop - at.start  # those of the end: a torque record loses its start
        theta = run.nominal_angle(data.drive) if data.quantity == "angle" else data.theta[at]
        if data.quantity == "angle":
            parts.append(_rows(run, data.drive, theta, key, indices)[:, -count:])
        else:
            motion = pose(data.drive, theta, direction=data.direction[at])
            parts.append(source_matrix(motion, {"output": np.ones((1, count))}, key, indices))
    return np.concatenate(parts, axis=1)


def _declared(model: Model, runs: Sequence[Run], data: _Data) -> list[_Term]:
    """Declared effects that were measured with an uncertainty, as changes within it."""
    if data.quantity != "angle":
        return []
    return [
        _Term(
            _DECLARED, e.key, _effect_rows(runs, data, e.key, e.indices), dict(e.indices), (),
            float(e.uncertainty), e.values,
        )
        for e in model.effects
        if e.uncertainty
    ]  # fmt: skip


def _candidates(model: Model, runs: Sequence[Run], data: _Data) -> list[_Term]:
    unit = model.mechanism
    result = []
    for key, entry in CATALOGUE.items():
        if not entry.applies_to(unit) or not entry.tried:
            continue
        if data.quantity == "torque" and not key.startswith("shaft."):
            continue  # no encoder's error makes torque
        if key == "sensor.time_offset" and any(run.time is None for run in runs):
            continue
        for indices in entry.candidates(unit):
            rows = _effect_rows(runs, data, key, indices)
            orders = tuple(abs(order) for order in entry.orders(unit, indices))
            if max(orders, default=0.0) < _highest_order(data):
                result.append(_Term(_EFFECT, key, rows, dict(indices), orders))
    # a shaft that the user named goes before the measuring chain where they cannot be told apart
    return sorted(result, key=lambda term: not term.name.startswith("shaft."))


def _prior_sum(declared: Sequence[_Term], data: _Data) -> Array:
    """What declared terms of an uncertain size predict, as declared."""
    total = np.zeros_like(data.signal)
    for term in declared:
        total += np.array(term.means) @ term.rows
    return total


def _nuisances(data: _Data) -> list[_Term]:
    """What the catalogue has no key for: a bow of a run over time or angle, lost motion between directions."""
    terms = []
    bow = {_BOW: data.clock}
    if data.turns < 1:
        bow["slow curvature over the angle"] = data.theta
    powers = (1, 2, 3) if data.quantity == "torque" else (2, 3)
    for name, over in bow.items():
        rows = [_own(data, at, np.stack([_centred_power(over[at], power) for power in powers])) for at in data.slices]
        terms.append(_Term(_NUISANCE, name, np.concatenate(rows)))
    if np.unique(data.direction).size > 1 and any(np.unique(data.direction[at]).size > 1 for at in data.slices):
        terms.append(_Term(_NUISANCE, "lost motion", data.direction[None] / 2))
    return terms


def _centred_power(values: Array, power: int) -> Array:
    middle, half = (values.max() + values.min()) / 2, max(float(np.ptp(values)) / 2, 1e-300)
    return np.asarray(np.polynomial.legendre.Legendre.basis(power)((values - middle) / half), dtype=np.float64)


# --- fitting ----------------------------------------------------------------------------------------------------------


def _fitted(data: _Data, terms: Sequence[_Term], *, noise: _Fit | None = None) -> _Fit:
    """Fit terms; the noise is that of another fit's residual where one is given."""
    rows, signal = np.concatenate([t.rows for t in terms]), data.signal
    scale = lengths(rows)
    weights = np.ones(len(data.slices)) if noise is None else noise.weights
    if noise is None:
        residual = signal - solve(*_sums(data, rows / scale[:, None], weights)) / scale @ rows
        if len(data.slices) > 1:
            weights = _run_weights(data, residual)
            residual = signal - solve(*_sums(data, rows / scale[:, None], weights)) / scale @ rows
    else:
        residual = noise.residual
    equations = normal(rows, residual, data.slices, weights, floor=data.floor)
    means, sigmas = _priors(terms)
    prior = equations.prior_weights(sigmas)
    gram, moment = _sums(data, rows / scale[:, None], weights)
    values = solve(gram + np.diag(prior), moment + prior * means * scale) / scale
    left = signal - values @ rows
    squares = float((_root_weights(data, weights) * residual) @ (_root_weights(data, weights) * residual))
    most = sum(spectrum_freedom(at.stop - at.start) for at in data.slices)
    samples = np.clip(squares / np.maximum(equations.seen, 1e-300), _LEAST_SAMPLES, most)
    return _Fit(tuple(terms), values, equations.covariance(sigmas), left, weights, samples)


def _sums(data: _Data, rows: Array, weights: Array, used: Labels | None = None) -> tuple[Array, Array]:
    """Normal equations of rows, of all samples or of some of them."""
    of_run = _root_weights(data, weights) ** 2
    part, signal = (rows, data.signal) if used is None else (rows[:, used], data.signal[used])
    weighted = part * (of_run if used is None else of_run[used])
    return weighted @ part.T, weighted @ signal


def _root_weights(data: _Data, weights: Array) -> Array:
    sizes = [at.stop - at.start for at in data.slices]
    return np.asarray(np.repeat(np.sqrt(weights), sizes), dtype=np.float64)


def _run_weights(data: _Data, residual: Array) -> Array:
    """A run counts by the noise that it has, beside the others'."""
    power = np.array([np.mean(residual[at] ** 2) for at in data.slices]) + data.floor**2
    return np.asarray(np.min(power) / power, dtype=np.float64)


def _priors(terms: Sequence[_Term]) -> tuple[Array, Array]:
    """Mean and standard deviation of each value beforehand; infinite where nothing is known."""
    means = np.concatenate([np.array(t.means) if t.means else np.zeros(t.size) for t in terms])
    return means, np.concatenate([np.full(t.size, t.sigma) for t in terms])


def _implausible(term: _Term, values: Array, quantity: str) -> list[str]:
    """Parameters larger than a workshop makes."""
    if term.kind != _EFFECT or quantity != "angle":
        return []
    sizes = zip(source(term.name).parameters, values, strict=True)
    return [p.name for p, value in sizes if abs(value) > p.plausible]


def _search(
    data: _Data, base: Sequence[_Term], candidates: Sequence[_Term], nuisances: Sequence[_Term], tell: Progress
) -> tuple[_Fit, tuple[Candidate, ...]]:
    """Add what is significant, the most telling first, until nothing is."""
    fit = _fitted(data, base)
    pool = [*candidates, *nuisances]
    accepted = _FALSE_ALARM / max(len(pool), 1)
    for _ in range(2 * _MOST):
        tell(f"fitting {len(pool)} candidates beside {len(fit.terms) - len(base)} found")
        winner = _winner(data, fit, pool, accepted)
        if winner is None:
            if (bowed := _bowed(data, fit, nuisances)) is None:
                break
            fit = bowed
            continue
        line = _best_line(data, fit)
        beaten = line is not None and _beats(data, line, winner)
        fit = line if line is not None and beaten else _pruned(data, winner, accepted)
    if lines := [t for t in fit.terms if t.kind == _LINE]:
        fit = _pruned(data, _fitted(data, [t for t in fit.terms if t not in lines]), accepted)
    tell("scoring candidates on left-out blocks")
    scored = [
        (_held_out_gain(data, fit, _fitted(data, [*fit.terms, t])), t)
        for t, _, _ in _screened(data, fit, pool)
        if t.kind == _EFFECT
    ]
    scored.sort(key=lambda pair: -pair[0])
    return fit, tuple(Candidate(t.name, t.indices, gain) for gain, t in scored)


def _bowed(data: _Data, fit: _Fit, nuisances: Sequence[_Term]) -> _Fit | None:
    """Fit with the bow that goes with a drift: in one direction a slope may be one, and no drift is straight."""
    slopes = [t for t in fit.terms if t.kind == _EFFECT and not source(t.name).periodic]
    bow = next(t for t in nuisances if t.name == _BOW)
    if not slopes or np.unique(data.direction).size > 1 or any(t.name == _BOW for t in fit.terms):
        return None
    parabola = bow.rows[::2]  # of each run; the cubic would run away on a left-out end
    return _fitted(data, [*fit.terms, replace(bow, kind=_BESIDE, rows=parabola)])


def _winner(data: _Data, fit: _Fit, pool: Sequence[_Term], accepted: float) -> _Fit | None:
    """Fit with the most telling of the terms that are significant and help on left-out blocks."""
    screened = _screened(data, fit, pool)
    best = max((gain for _, gain, _ in screened), default=0.0)
    # a size that no workshop makes goes after plausible ones that do half as well
    for term, _, _ in sorted(screened, key=lambda s: bool(s[2]) or s[1] < _SHARE * best):
        trial = _fitted(data, [*fit.terms, term])
        if trial.significant(term, accepted) and _held_out_gain(data, fit, trial) > 0:
            return trial
    return None


def _screened(data: _Data, fit: _Fit, pool: Sequence[_Term]) -> list[tuple[_Term, float, list[str]]]:
    """Terms that the runs can tell from what is there, their share of the squares, and what is implausible of them.

    The most telling first.
    """
    root = _root_weights(data, fit.weights)
    # a declared size that was measured wrong is missing too, so declared terms do not bar one of their waveform
    free = orthonormal(root * np.concatenate([t.rows for t in fit.terms if t.kind != _DECLARED]))
    every = orthonormal(root * np.concatenate([t.rows for t in fit.terms]))
    found = []
    for term in pool:
        rows, rest = root * term.rows, root * fit.residual
        if term in fit.terms or kept_share(free, rows) < _APART:
            continue
        left = rows - (rows @ free) @ free.T
        values = np.linalg.lstsq(left.T, rest - free @ (free.T @ rest), rcond=None)[0]
        gain = 1 - float(np.mean((rest - values @ left) ** 2)) / max(float(np.mean(rest**2)), 1e-300)
        too_large = _implausible(term, np.asarray(values, dtype=np.float64), data.quantity)
        if not too_large or kept_share(every, rows) > _APART_IMPLAUSIBLE:
            found.append((term, gain, too_large))
    # rounded, so that of equal ones the first goes first
    return sorted(found, key=lambda s: -round(s[1], 9))


def _gain(fit: _Fit, trial: _Fit) -> float:
    """Share of the residual's power that a trial takes off."""
    return 1 - float(np.mean(trial.residual**2)) / max(float(np.mean(fit.residual**2)), 1e-300)


def _held_out_gain(data: _Data, fit: _Fit, trial: _Fit) -> float:
    """What a trial takes off the squares of blocks of samples that its fit did not see, in noise variances."""
    variance = float(np.mean(trial.residual**2)) + data.floor**2
    before, after = (_held_out_squares(data, f.terms, trial) for f in (fit, trial))
    return (before - after) / variance


def _held_out_squares(data: _Data, terms: Sequence[_Term], noise: _Fit) -> float:
    rows = np.concatenate([t.rows for t in terms])
    means, sigmas = _priors(terms)
    scale, prior = lengths(rows), np.zeros(len(rows))
    if np.isfinite(sigmas).any():
        prior = normal(rows, noise.residual, data.slices, noise.weights, floor=data.floor).prior_weights(sigmas)
    unit = rows / scale[:, None]
    parts = [np.flatnonzero(data.labels == block) for block in range(int(data.labels.max()) + 1)]
    sums = [_sums(data, unit, noise.weights, part) for part in parts]
    gram, moment = sum(g for g, _ in sums) + np.diag(prior), sum(m for _, m in sums) + prior * means * scale
    squares = 0.0
    for (own, seen), part in zip(sums, parts, strict=True):
        values = solve(gram - own, moment - seen)
        squares += float(((data.signal[part] - values @ unit[:, part]) ** 2).sum())
    return squares


def _pruned(data: _Data, fit: _Fit, accepted: float) -> _Fit:
    """The fit without terms that later ones have made needless."""
    while True:
        free = [t for t in fit.terms[:-1] if t.kind in (_EFFECT, _NUISANCE, _LINE)]
        weak = [t for t in free if not fit.significant(t, accepted)]
        if not weak:
            return fit
        fit = _fitted(data, [t for t in fit.terms if t is not weak[0]])


# --- lines of any order -----------------------------------------------------------------------------------------------


def _highest_order(data: _Data) -> float:
    """Order up to which every run has two samples a wave, also where it turns fastest."""
    steps = [np.abs(np.diff(data.theta[at])) for at in data.slices]
    return 0.95 * min(np.pi / float(np.quantile(s[s > 0], 0.9)) for s in steps)


def line_spectrum(theta: Array, residual: Array, noise: Noise, highest: float) -> tuple[Array, Array]:
    """Power of a wave of each order in a residual, as the squared distance from 0 in standard deviations.

    Parameters
    ----------
    theta : ndarray, shape (n,)
        rad; any order of samples.
    residual : ndarray, shape (n,)
    noise : Noise
    highest : float
        Order.

    Returns
    -------
    order, power : ndarray, shape (m,)
        Four to each that the travel tells apart.  About chi-square of 2 degrees where there is only the noise.
    """
    span = float(np.ptp(theta))
    step = np.pi / (8 * highest)
    count = int(2 ** np.ceil(np.log2(4 * span / step + 2)))
    place = (theta - theta.min()) / step
    low = np.floor(place).astype(np.intp)
    part = place - low
    grid = np.bincount(low, residual * (1 - part), count) + np.bincount(low + 1, residual * part, count)
    lines = np.abs(np.fft.rfft(grid)) ** 2
    order = _TURN / (count * step) * np.arange(lines.size)
    used = (order >= _LEAST_CYCLES * _TURN / span) & (order <= highest)
    order, lines = order[used], lines[used]
    moves = np.quantile(np.abs(np.diff(theta)), (np.arange(16) + 0.5) / 16)
    variance = np.mean([noise.spectrum(order * move) for move in moves], axis=0) * theta.size / 2
    return np.asarray(order, dtype=np.float64), np.asarray(lines / variance, dtype=np.float64)


def _best_line(data: _Data, fit: _Fit) -> _Fit | None:
    """Fit with the most significant line of any order, where there is one."""
    highest = _highest_order(data)
    orders: list[float] = []
    cells = 1.0
    for at in data.slices:
        noise = burg(fit.residual[at], floor=data.floor)
        order, power = line_spectrum(data.theta[at], fit.residual[at], noise, highest)
        if order.size < 3:
            continue
        cells = max(cells, order.size / 2)
        likely = (power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:]) & (power[1:-1] > chi2.isf(0.05, 2))
        peaks = np.flatnonzero(likely) + 1
        orders += [_sharpened(data, fit, float(order[i])) for i in peaks[np.argsort(-power[peaks])][:_PEAKS]]
    free = [order for order in _distinct(orders, 0.25 / data.turns) if not _is_taken(data, fit, order)]
    accepted = _FALSE_LINE / cells
    for term, _, _ in _screened(data, fit, [_line_term(data, order) for order in free])[:3]:
        trial = _fitted(data, [*fit.terms, term])
        if _is_line(data, trial, accepted) and _held_out_gain(data, fit, trial) > 0:
            return trial
    return None


def _is_line(data: _Data, trial: _Fit, accepted: float) -> bool:
    line = trial.terms[-1]
    large = data.quantity != "angle" or np.hypot(*trial.values(line)[:2]) > _ACCURACY
    return bool(large and trial.significant(line, accepted))


def _distinct(orders: Sequence[float], apart: float) -> list[float]:
    found: list[float] = []
    for order in orders:
        if all(abs(order - other) > apart for other in found):
            found.append(order)
    return found


def _is_taken(data: _Data, fit: _Fit, order: float) -> bool:
    """Tell whether the runs are too short to tell an order from one that is in the fit."""
    there = [o for t in fit.terms for o in t.orders if t.kind in (_EFFECT, _LINE)]
    return any(abs(order - other) < 0.7 / data.turns for other in there)


def _sharpened(data: _Data, fit: _Fit, order: float) -> float:
    """Order of the highest power near one, over all runs."""
    near = order + np.linspace(-0.5, 0.5, 41) / data.turns
    power = np.zeros(near.size)
    for at in data.slices:
        wave, step = (np.exp(-1j * o * data.theta[at]) for o in (near[0], near[1] - near[0]))
        pull = fit.residual[at] * wave
        for i in range(near.size):
            power[i] += abs(pull.sum()) ** 2
            pull *= step
    best = int(np.argmax(power))
    if 0 < best < near.size - 1:
        left, top, right = power[best - 1 : best + 2]
        return float(near[best] + 0.5 * (left - right) / (left - 2 * top + right) * (near[1] - near[0]))
    return order


def _line_term(data: _Data, order: float) -> _Term:
    """Cosine and sine of an order, of its own size and phase in each run."""
    waves = np.stack([np.cos(order * data.theta), np.sin(order * data.theta)])
    rows = np.concatenate([_own(data, at, waves[:, at]) for at in data.slices])
    return _Term(_LINE, f"order {order:g}", rows, orders=(order,))


def _beats(data: _Data, line: _Fit, winner: _Fit) -> bool:
    """Tell whether a cause only looks telling beside a stronger line, which a short run smears over its neighbours."""
    own, cause = line.terms[-1], winner.terms[-1]
    apart = [abs(own.orders[0] - order) * data.turns for order in cause.orders or (0.0,)]
    if min(apart) < 1 or min(apart) > _SMEARED:
        return False
    return line.distance(own) > winner.distance(cause) + float(chi2.isf(_FALSE_ALARM, 1))


def _add_lines(data: _Data, fit: _Fit) -> _Fit:
    """Put in the lines that remain, the strongest first."""
    for _ in range(_MOST):
        more = _best_line(data, fit)
        if more is None:
            return fit
        fit = more
    return fit


# --- what is said -----------------------------------------------------------------------------------------------------


def _in_order(terms: Sequence[_Term]) -> list[_Term]:
    """Errors that grow along a run first, since without them no other figure means much; then as they were found."""
    return sorted(terms, key=lambda t: source(t.name).periodic)


def _residual(data: _Data, terms: Sequence[_Term], noise: _Fit) -> Residual:
    """Size of the residual, and of blocks that the fit did not see."""
    rest = _fitted(data, terms, noise=noise).residual
    rest = np.concatenate([rest[at] - rest[at].mean() for at in data.slices])
    squares = _held_out_squares(data, terms, noise)
    return Residual(
        float(np.sqrt(np.mean(rest**2))), float(rest.max() - rest.min()), float(np.sqrt(squares / rest.size))
    )


def _addition(
    data: _Data,
    model: Model,
    fit: _Fit,
    term: _Term,
    candidates: Sequence[_Term],
    so_far: Sequence[_Term],
) -> Addition:
    values, reaches = fit.values(term), fit.reach(term, np.diag(fit.own_spread(term)))
    estimates = tuple(
        Estimate(
            p.name,
            p.dimension if data.quantity == "angle" else data.quantity,
            float(value),
            float(value - reach),
            float(value + reach),
        )
        for p, value, reach in zip(source(term.name).parameters, values, reaches, strict=True)
    )
    alike = _alike(data, fit, term, candidates)
    notes = [
        f"{name}: larger than a workshop makes; the cause may be another of the same order"
        for name in _implausible(term, fit.values(term), data.quantity)
    ]
    for other, replaced in alike:
        if too_large := _implausible(other, replaced.values(other), data.quantity):
            parameters = {p.name: p for p in source(other.name).parameters}
            size = np.linalg.norm(replaced.values(other))
            dimension = parameters[too_large[0]].dimension
            notes.append(
                f"in its place {other.label} would have to be {units.to_display(float(size), dimension):.4g} "
                f"{units.DISPLAY_UNITS[dimension]}, larger than a workshop makes"
            )
    effect = Effect(
        term.name,
        dict(term.indices),
        tuple(float(v) for v in values),
        origin="found by rverror diagnose in " + ", ".join(data.names),
    )
    names: Alike = tuple((other.name, dict(other.indices)) for other, _ in alike)
    nuisances = [t for t in fit.terms if t.kind in (_NUISANCE, _BESIDE)]
    residual = _residual(data, [*so_far, *nuisances], fit)
    separate = tuple(dict.fromkeys(_separating(data, term, other) for other, _ in alike))
    return Addition(effect, estimates, names, term.orders, residual.heldout_rms, tuple(notes), separate)


def _alike(data: _Data, fit: _Fit, term: _Term, candidates: Sequence[_Term]) -> list[tuple[_Term, _Fit]]:
    """Candidates beside which a term is not needed any more, and the fit with each of them in its place."""
    without = [t for t in fit.terms if t is not term]
    found = []
    for other in candidates:
        rows = np.concatenate([t.rows for t in without])
        if other in fit.terms:
            continue
        beside = np.concatenate([rows, other.rows])
        needless = kept_share(orthonormal(beside), term.rows) < 1e-9
        if not needless:
            both = _fitted(data, [*without, other, term], noise=fit)
            needless = not both.significant(term, _ALIKE)
        if needless:
            found.append((other, _fitted(data, [*without, other], noise=fit)))
    return found


def _separating(data: _Data, term: _Term, other: _Term) -> str:
    """The measurement that tells two causes apart."""
    pair = {term.name, other.name}
    degrees = 360 * data.turns
    if pair & {"sensor.encoder_eccentricity", "sensor.encoder_ellipticity"}:
        return (
            f"a run over a whole output turn or more: over {degrees:.3g} deg {term.label} and {other.label} have the "
            "same waveform"
        )
    if "sensor.time_offset" in pair and "sensor.drift" not in pair:
        return f"runs at other speeds: {term.label} and {other.label} change differently with the speed"
    if pair <= {"sensor.drift", "sensor.ratio_error", "sensor.time_offset"}:
        return "a run there and back: drift follows the time, a ratio error the angle, a time offset the speed"
    if "sensor.input_coupling" in pair:
        return (
            "the input encoder remounted by 90 degrees against its shaft: an error of encoder or coupling turns with "
            "it, one inside the drive does not"
        )
    return f"a longer run: {term.label} and {other.label} have too nearly the same waveform in this one"


def _lines(data: _Data, fit: _Fit) -> list[Line]:
    lines = []
    for term in fit.terms:
        if term.kind != _LINE:
            continue
        values = fit.values(term).reshape(-1, 2)
        sizes = np.hypot(values[:, 0], values[:, 1])
        toward = (values / np.maximum(sizes, 1e-300)[:, None] / len(values)).ravel()
        reach = float(fit.reach(term, toward @ fit.own_spread(term) @ toward))
        size = float(sizes.mean())
        order = _told_order(data, term.orders[0])
        frames = frames_of_order(data.drive, order, tolerance=max(0.02, 0.25 / data.turns))
        lines.append(Line(order, size, max(size - reach, 0.0), size + reach, tuple(frames)))
    return lines


def _told_order(data: _Data, order: float) -> float:
    """Order with the digits that the travel gives it; whole where it is that near to a whole one."""
    unit = 10.0 ** np.floor(np.log10(0.05 / data.turns))
    near = round(order)
    return float(near) if abs(order - near) < 0.05 / data.turns else float(round(order / unit) * unit)


def _told(data: _Data, fit: _Fit) -> list[str]:
    """What was found that the catalogue has no key for, and what the noise is like."""
    notes = []
    unit = units.DISPLAY_UNITS[data.quantity]
    for term in fit.terms:
        if term.kind not in (_NUISANCE, _BESIDE):
            continue
        if term.name == "lost motion":
            size, half = float(fit.values(term)[0]), float(fit.reach(term, fit.own_spread(term)[0, 0]))
            value, reach = (units.to_display(x, data.quantity) for x in (size, half))
            notes.append(
                f"the output leads by {value:.4g} {unit} more, 95 % [{value - reach:.4g}, {value + reach:.4g}], in "
                "forward than in reverse motion: lost motion or friction, a constant for each direction; no key of "
                "the catalogue, so it is taken off and not added to the model"
            )
            continue
        for name, at in zip(data.names, data.slices, strict=True):
            wave = (fit.values(term) @ term.rows)[at]
            why = "is significant" if term.kind == _NUISANCE else "may go with the drift, significant or not"
            size = units.to_display(float(np.ptp(wave)), data.quantity)
            notes.append(f"{name}: {term.name}, {size:.4g} {unit} peak-to-peak, {why}; it is taken off and not named")
    for name, at in zip(data.names, data.slices, strict=True):
        lags = burg(fit.residual[at], floor=data.floor).coefficients.size
        colour = f"coloured: each sample depends on the {lags} before" if lags else "white"
        notes.append(f"{name}: noise is {colour}")
    return notes


def _fitted_model(model: Model, data: _Data, fit: _Fit, additions: Sequence[Addition]) -> Model:
    if data.quantity != "angle":
        return model
    sizes = iter([tuple(map(float, fit.values(t))) for t in fit.terms if t.kind == _DECLARED])
    effects = [replace(e, values=next(sizes)) if e.uncertainty else e for e in model.effects]
    return replace(model, effects=(*effects, *(a.effect for a in additions)))


def _traces(data: _Data, base: Sequence[_Term], fit: _Fit) -> tuple[Trace, ...]:
    """Waveform of each run and direction on even angles: the mean of its turns, or the travel of a short run."""
    explained = _fitted(data, [t for t in fit.terms if t.kind != _LINE], noise=fit)
    after = data.signal - explained.residual
    declared = _prior_sum([t for t in base if t.kind == _DECLARED], data)
    return tuple(
        _trace(data, name, at, sense, declared, after)
        for name, at in zip(data.names, data.slices, strict=True)
        for sense in (1.0, -1.0)
        if np.count_nonzero(data.direction[at] == sense) > 16
    )


def _trace(data: _Data, name: str, at: slice, sense: float, declared: Array, after: Array) -> Trace:
    used = data.direction[at] == sense
    theta = data.theta[at][used]
    n = theta.size
    travel = float(np.ptp(theta)) * n / (n - 1)
    period = _TURN * true_period(data.drive)
    period = next((p for p in (period, _TURN) if travel > p * (1 - 1e-6)), travel)
    passes = max(travel / period, 1.0) * max(1.0, float(np.abs(np.diff(theta)).sum()) / max(travel, 1e-300))
    points = int(np.clip(round(n / passes), 16, _TRACE_POINTS))
    cell = np.round((theta - theta.min()) / period * points).astype(np.intp)
    cell = np.minimum(cell, points - 1) if period == travel else cell % points  # a part of a turn does not close
    count = np.bincount(cell, minlength=points)
    grid = np.arange(points)

    def mean(values: Array) -> Array:
        total = np.bincount(cell, values[at][used], points)
        row = np.interp(grid, grid[count > 0], total[count > 0] / count[count > 0])
        return np.asarray(row - row.mean(), dtype=np.float64)

    angles = theta.min() + period / points * grid
    return Trace(name, sense, angles, mean(data.signal), mean(declared), mean(after))
