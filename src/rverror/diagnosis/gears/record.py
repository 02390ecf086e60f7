"""Runs of a reducer as they are fitted: samples, what may have any size in each, noise, and where the gears stood."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array, Flags
from rverror.base.errors import InputError, refusing
from rverror.base.numbers import count_of
from rverror.diagnosis.gears.grid import AngleGrid, stretch, whole
from rverror.diagnosis.gears.waveform import LoadCase
from rverror.diagnosis.noise import Whitening
from rverror.geartrain.torque_over_turn import TorqueWaves, shared_torques
from rverror.model.effects import Model
from rverror.runs.faults import Faults, find_faults
from rverror.runs.measurement import Run
from rverror.runs.noise import RunNoise
from rverror.statics.loaded_state import equilibrium

_LEAST_ROWS = 48  # samples of a run: the noise of fewer is not told from anything
_SETTLES = (0.03, 0.1, 0.3)  # of a run: time constants a factor of three apart make up for those between
_SHORT_GAP = 8  # samples: the noise remembers across fewer; a longer gap begins a new series
_DOUBTED = 3  # mean and first waves of a torque that are not known better than its sensor
_SLOWEST = 4  # orders up to that which half a turn holds twice
_BESIDE = 12  # samples to either side of a jump that tell it well enough to search for faults
#: Standard deviation of mean and first waves of a torque column, as a share of its largest: sensors have a class of 0.1
#: or 0.2 %, and noise adds to it.  As much of the windup is no news, and no encoder's.
TORQUE_SHARE = 0.002
_LIGHT_LOAD = 0.05  # of the largest torque: makers print no-load running torques from 5 % of the rated one on
_TURN = 2 * math.pi


@dataclass(frozen=True, eq=False)
class Record:
    """One run.

    Attributes
    ----------
    name : str
    theta, error : ndarray, shape (n,)
        Nominal output angle and transmission error in the order of time, rad.
    direction : float or ndarray
        Of a drive that of each sample, shape (n,).
    torque : float or TorqueWaves, optional
        N*mm.
    kept : ndarray of bool, shape (n,)
        Samples that were not set aside.
    starts : tuple of int
        First sample of each series between gaps.
    slips : tuple of int
        First sample after each slip of the reading.
    time : ndarray, optional
    zero : str
        Label of a zero that it shares.
    orders : tuple of float
        Free lines, each of any size in this run.
    slow : bool
        Whether it drifts or settles by itself.
    noise : RunNoise, optional
    absent : tuple of int
        Places of short gaps, where nothing was read.
    more : tuple of str
        What was set aside later, in words.
    sides : tuple of slice
        Where the one side of the contacts carries, and the other, if the torque changes its sign.
    windup : float
        One standard deviation of the windup by what is not known of a torque that changes over the turn, rad.
    made, waves : dict
        What was made of its angles alone, kept for all records of the same samples: motions and readouts, and lines.
    """

    name: str
    theta: Array
    error: Array
    direction: float | Array
    torque: float | TorqueWaves | None
    kept: Flags
    starts: tuple[int, ...] = (0,)
    slips: tuple[int, ...] = ()
    time: Array | None = None
    zero: str = ""
    orders: tuple[float, ...] = ()
    slow: bool = False
    noise: RunNoise | None = None
    absent: tuple[int, ...] = ()
    more: tuple[str, ...] = ()
    sides: tuple[slice, ...] = ()
    windup: float = 0.0
    made: dict[object, Any] = field(default_factory=dict, repr=False)
    waves: dict[float, Array] = field(default_factory=dict, repr=False)

    @cached_property
    def nuisance(self) -> Array:
        """What may have any size: offset unless it is shared, slips, lines; shape (k, n)."""
        n = self.theta.size
        rows = [] if self.zero else [np.ones(n)]
        rows += [(np.arange(n) >= at).astype(np.float64) for at in self.slips]
        rows += [row for order in self.orders for row in self.wave(order)]
        rows += list(self.settling) if self.slow else []
        return np.array(rows, dtype=np.float64).reshape(len(rows), n)

    def wave(self, order: float) -> Array:
        """Cos and sin of an order, shape (2, n)."""
        if order not in self.waves:
            self.waves[order] = np.stack([np.cos(order * self.theta), np.sin(order * self.theta)])
        return self.waves[order]

    @cached_property
    def settling(self) -> Array:
        """Slow changes that any run may have beside its offset: a drift, and three that settle sooner or later."""
        clock = np.arange(self.theta.size, dtype=np.float64) if self.time is None else self.time - self.time[0]
        share = clock / max(float(np.abs(clock).max()), 1e-300)
        return np.stack([share, *(np.exp(-share / within) for within in _SETTLES)])

    @cached_property
    def whiten(self) -> Whitening:
        """Whitening under its noise."""
        assert self.noise is not None
        return Whitening(self.noise, self.kept, self.starts, self.nuisance, self.doubtful)

    @property
    def doubtful(self) -> Array | None:
        """One standard deviation of the windup by mean and first waves of the torque, where its windup is in doubt."""
        waves = self.theta * np.arange(_DOUBTED)[:, None]
        return self.windup * np.concatenate([np.cos(waves), np.sin(waves[1:])]) if self.windup else None

    @cached_property
    def senses(self) -> tuple[float, ...]:
        """Directions in which it turns, forward first."""
        return tuple(np.unique(self.direction)[::-1].tolist())

    @property
    def turns(self) -> float:
        """Output turns that it travels."""
        return float(np.ptp(self.theta)) / _TURN * self.theta.size / max(self.theta.size - 1, 1)

    def slow_part(self, rest: Array) -> Array:
        """What it drifts and settles by, and slips, by least squares on a residual."""
        own = replace(self, slow=False, slips=()).nuisance
        steps = np.array([np.arange(rest.size) >= at for at in self.slips], dtype=np.float64).reshape(-1, rest.size)
        more = np.concatenate([steps, self.settling]) if self.slow else steps
        rows = np.concatenate([more, own])
        sizes = np.linalg.lstsq(rows[:, self.kept].T, rest[self.kept], rcond=1e-10)[0]
        return np.asarray(sizes[: len(more)] @ more)

    def without_nuisance(self, rest: Array) -> Array:
        """A residual less what offset, slips and lines make of it, by least squares."""
        rows = self.nuisance if not self.zero else np.concatenate([np.ones((1, rest.size)), self.nuisance])
        return left_beside(rest, rows, self.kept)

    def told_as_noise(self, rest: Array) -> Array:
        """A residual that noise is told from: `without_nuisance`, and of a run whose contacts change sides without its
        slowest waves, of which no side holds a whole one."""
        clean = self.without_nuisance(rest)
        if not self.sides:
            return clean
        angle = self.theta * np.arange(_SLOWEST + 1)[:, None]
        rows = np.concatenate([np.cos(angle), np.sin(angle[1:])])
        return left_beside(clean, rows, self.kept)


def left_beside(rest: Array, rows: Array, at: Flags) -> Array:
    """What is left of a residual beside rows, by least squares at some samples."""
    sizes = np.linalg.lstsq(rows[:, at].T, rest[at], rcond=1e-10)[0]
    return np.asarray(rest - sizes @ rows)


def records_of(model: Model, runs: Sequence[Run]) -> tuple[list[Record], list[str]]:
    """Runs as they are fitted, without what cannot be, and what was noticed.

    Raises
    ------
    InputError
        If a run cannot be used; the message says why.
    """
    result, notes = [], []
    torques = shared_torques([run.torque_waves(model) for run in runs], 3 * TORQUE_SHARE)
    labels = [run.index if run.index != "unknown" else "" for run in runs]
    for number, (run, label, waves) in enumerate(zip(runs, labels, torques, strict=True)):
        name = run.path or f"run {number + 1}"
        if np.unique(run.direction).size > 1:
            raise InputError(f"{name}: the run turns both ways; write one file per direction")
        run.check_effects(model, name)
        notes += [f"{name}: {note}" for note in run.notes]
        theta, error = run.nominal_angle(model), run.error(model)
        if theta.size < _LEAST_ROWS:
            raise InputError(
                f"{name}: {theta.size} samples; {_LEAST_ROWS} or more are needed to tell noise from error: "
                "measure a longer stretch, or more samples a turn"
            )
        light = _light(waves, theta)
        with refusing(f"{name}: "):
            faults = find_faults(theta, levelled(error, light))
        notes += [f"{name}: {note}" for note in faults.notes()]
        shared = label if labels.count(label) > 1 and label else ""
        torque = waves or run.torque or None
        if shared and not torque:
            notes.append(f"{name}: index {label}: without output_torque its windup is unknown; it has its own offset")
            shared = ""
        made = Record(
            name, theta, error, float(run.direction[0]), torque, np.ones(theta.size, dtype=np.bool_),
            time=run.time, zero=shared, windup=0.0 if waves is None else _doubt(model, waves),
        )  # fmt: skip
        result.append(_loaded(_with_faults(made, faults)))
        if light.any():
            notes.append(
                f"{name}: output_torque changes its sign; {count_of(int(light.sum()), 'sample')} below "
                f"{100 * _LIGHT_LOAD:g} % of its largest left out, where friction decides which side carries"
            )
    return result, notes


def _light(torque: float | TorqueWaves | None, theta: Array) -> Flags:
    """Where a torque that changes its sign is too small to say which side carries."""
    if not isinstance(torque, TorqueWaves) or not torque.crossings():
        return np.zeros(theta.size, dtype=np.bool_)
    return np.asarray(np.abs(torque(theta)) < _LIGHT_LOAD * torque.peak)


def _doubt(model: Model, torque: TorqueWaves) -> float:
    """Windup, rad, by a standard deviation of the torque, as the output turns from half of its peak to the peak."""
    at = [torque.peak, torque.peak / 2]
    most, half = equilibrium(replace(model, effects=()), [0.0, 0.0], torque=at, direction=1.0).transmission_error
    return 2 * TORQUE_SHARE * abs(float(most - half))


def _zones(light: Flags) -> list[tuple[int, int]]:
    """First sample of each stretch, and first after it."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], light, [False]])))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def _loaded(record: Record) -> Record:
    """The record without samples under hardly any load; on the other side of them the noise begins anew."""
    light = _light(record.torque, record.theta)
    ends = [after for _, after in _zones(light) if after < light.size]
    sides = [slice(*ends_of) for ends_of in _zones(~light) if np.diff(ends_of) >= _LEAST_ROWS]
    return replace(
        record,
        kept=record.kept & ~light,
        starts=tuple(sorted({*record.starts, *ends})),
        slips=tuple(at for at in record.slips if not light[at]),
        sides=tuple(sides) if light.any() else (),
    )


def levelled(error: Array, light: Flags) -> Array:
    """The error without its jumps over stretches in which the torque changes its sign, for the search for faults."""
    found = error.copy()
    for first, after in _zones(light):
        if first and after < error.size:
            before = np.median(found[max(first - _BESIDE, 0) : first])
            found[after:] += before - np.median(found[after : after + _BESIDE])
            found[first:after] = np.linspace(found[first - 1], found[after], after - first + 2)[1:-1]
    return found


def _with_faults(record: Record, faults: Faults) -> Record:
    """The record with what was found: rows that say nothing go, spikes and short gaps stay as places without value."""
    used = faults.kept.copy()
    used[faults.spikes] = True
    used[[slip.index for slip in faults.slips]] = True
    short = {gap.index: gap.samples for gap in faults.gaps if 0 < gap.samples <= _SHORT_GAP}
    at = np.repeat(np.array(list(short), dtype=np.intp), list(short.values()))
    share = np.concatenate([np.zeros(0), *(np.arange(1, k + 1) / (k + 1) for k in short.values())])

    def put(row: Array, between: Array) -> Array:
        return np.asarray(np.insert(row, at, between)[chosen])

    def even(row: Array) -> Array:
        return put(row, row[at - 1] + share * (row[at] - row[at - 1]))

    absent = np.insert(np.zeros(used.size, dtype=np.bool_), at, True)
    chosen = np.insert(used, at, True)
    place: npt.NDArray[np.intp] = (np.cumsum(chosen) - chosen)[~absent]  # of each row as read, among those that stay
    breaks = [gap.index for gap in faults.gaps if gap.index not in short] + list(faults.turned)
    return replace(
        record, theta=even(record.theta), error=put(record.error, np.zeros(at.size)),
        kept=np.insert(faults.kept, at, False)[chosen], absent=tuple(np.flatnonzero(absent[chosen]).tolist()),
        starts=tuple(sorted({0, *(int(place[one]) for one in breaks)} - {int(chosen.sum())})),
        slips=tuple(int(place[slip.index]) for slip in faults.slips),
        time=None if record.time is None else even(record.time), made={},
    )  # fmt: skip


def conditions_of(records: Sequence[Record], points: int, *, anywhere: bool) -> tuple[list[LoadCase], list[int]]:
    """Conditions, each once, and which each record has; their grids cover what was travelled, or a turn."""
    low, high = min(r.theta.min() for r in records), max(r.theta.max() for r in records)
    step = _TURN / points
    if anywhere or high - low > 0.8 * _TURN:
        # from a sample on, so that even samples lie on it
        grid: AngleGrid = whole(float(records[0].theta.min()), _TURN, points)
    else:
        grid = stretch(low, high, step)
    # without friction the pose knows a signed torque alone, not the motion
    keys = [(1.0 if isinstance(r.torque, TorqueWaves) else r.senses[0], r.torque) for r in records]
    distinct = [key for at, key in enumerate(keys) if key not in keys[:at]]
    breaks = [torque.crossings() if isinstance(torque, TorqueWaves) else () for _, torque in distinct]
    found = [LoadCase(*key, replace(grid, breaks=own)) for key, own in zip(distinct, breaks, strict=True)]
    return found, [distinct.index(key) for key in keys]
