"""Runs of a geared drive, gathered for a joint fit: any travel, either direction, uneven steps, torque records."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.diagnosis.policy import POLICY, Policy
from rverror.diagnosis.samples.coloured import Labels
from rverror.geartrain.contacts import pose
from rverror.geartrain.kinematics import true_period
from rverror.geartrain.mechanism import Drive
from rverror.geartrain.source import IndexValue
from rverror.model.compose import source_matrix
from rverror.model.effects import Model
from rverror.model.sensor import slope
from rverror.runs.measurement import Run, torque_column
from rverror.runs.spectrum import highest_order

_TURN = 2 * np.pi
_ROUNDED = 1.5  # times the rms of a rounding: two of them make 1.41
_TORQUE_FLOOR = 1e-6  # of a torque's deviation: white noise that every reading has


@dataclass(frozen=True, eq=False)
class RunData:
    """All runs, one after another.

    Attributes
    ----------
    drive : Drive
    names : tuple of str
        Of the runs.
    slices : tuple of slice
        Place of each run among the samples.
    theta, direction : ndarray, shape (n,)
        Nominal output angle, rad, and +1 forward or -1 reverse.
    clock : ndarray, shape (n,)
        Time from a run's first sample on, s, or the number of the sample where a run has no time.
    signal : ndarray, shape (n,)
        Error less what is declared as exact, rad, or torque, N*mm.
    labels : ndarray of int, shape (n,)
        Block of samples that is left out together.
    quantity : str
        Dimension of the signal, ``angle`` or ``torque``.
    floor : float
        White noise that every reading has.
    policy : Policy
    """

    drive: Drive
    names: tuple[str, ...]
    slices: tuple[slice, ...]
    theta: Array
    direction: Array
    clock: Array
    signal: Array
    labels: Labels
    quantity: str
    floor: float
    policy: Policy = POLICY

    @property
    def turns(self) -> float:
        """Output turns that the longest run covers."""
        return max(float(np.ptp(self.theta[at])) for at in self.slices) / _TURN

    @property
    def highest_order(self) -> float:
        """Order up to which candidates and lines are tried, per output turn."""
        return highest_order([self.theta[at] for at in self.slices])


def gather(model: Model, runs: Sequence[Run], *, policy: Policy = POLICY) -> tuple[RunData, list[str]]:
    """Put the runs one after another, with their blocks, and note what was noticed.

    Parameters
    ----------
    model : Model
        Of a `Drive`.
    runs : sequence of Run
    policy : Policy

    Raises
    ------
    InputError
        If there is no run, or one that cannot be used beside the others.
    """
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
        run.check_effects(model, name)
        notes += [f"{name}: {note}" for note in run.notes]
        notes += _rounding(run, drive, name) if quantity == "angle" else []
        theta, signal, first = _signal(run, drive, name, quantity)
        if first:
            notes.append(f"{name}: {first} samples of standstill and run-up left out")
        clock = np.arange(theta.size, dtype=np.float64) if run.time is None else run.time - run.time[0]
        for effect in model.effects:
            if not effect.uncertainty and quantity == "angle":
                signal = signal - np.array(effect.values) @ influence_rows(
                    run, drive, theta, effect.key, effect.indices
                )
        labels, what = _blocks(theta[first:], run.direction[first:], drive)
        notes.append(f"{name}: held-out figures leave out one of {labels.max() + 1} blocks at a time, {what}")
        parts.append((theta[first:], run.direction[first:], clock[first:], signal[first:], labels + kept))
        kept += int(labels.max()) + 1
        names.append(name)
    ends = np.cumsum([0, *(part[0].size for part in parts)])
    signal = np.concatenate([part[3] for part in parts])
    data = RunData(
        drive=drive,
        names=tuple(names),
        slices=tuple(slice(int(a), int(b)) for a, b in pairwise(ends)),
        theta=np.concatenate([part[0] for part in parts]),
        direction=np.concatenate([part[1] for part in parts]),
        clock=np.concatenate([part[2] for part in parts]),
        signal=signal,
        labels=np.concatenate([part[4] for part in parts]),
        quantity=quantity,
        floor=policy.floor if quantity == "angle" else _TORQUE_FLOOR * float(np.std(signal)),
        policy=policy,
    )
    return data, notes


def _rounding(run: Run, drive: Drive, name: str) -> list[str]:
    """What is to be noted of an error that is no more than the rounding of an angle: uniform, a step wide."""
    found = []
    for what, angle, over in (
        ("output_angle", run.output_angle, 1.0),
        ("input_angle", run.input_angle, abs(drive.ratio)),
    ):
        step = 0.0 if angle is None or run.te_column is not None else _step(angle) / over
        if float(np.std(run.error(drive))) < _ROUNDED * step / math.sqrt(12):
            found.append(
                f"{name}: the error is no more than the rounding of {what}, which is stored in steps of "
                f"{step / units.ARCSEC:.4g} arcsec; where no drive is that good, both angles are one encoder's"
            )
    return found


def _step(angle: Array) -> float:
    """Step of which all differences are multiples, by Euclid's algorithm; where there is none, their last digits."""
    rounding = 1e-12 * max(1.0, float(np.abs(angle).max()))
    left = np.diff(np.unique(angle))
    left = left[left > rounding]
    step = 0.0
    while left.size:
        step = float(left.min())
        rest = left % step
        left = rest[(rest > rounding) & (rest < step - rounding)]
    return step


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


def influence_rows(run: Run, drive: Drive, theta: Array, key: str, indices: Mapping[str, IndexValue]) -> Array:
    """Influence of one source on the output in one run.

    Parameters
    ----------
    run : Run
    drive : Drive
    theta : ndarray, shape (n,)
        Nominal output angle, rad.
    key : str
    indices : mapping
    """
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
