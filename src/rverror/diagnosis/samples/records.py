"""Runs of a geared drive as they are fitted: any travel, either direction, uneven steps, torque records."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.diagnosis.gears.record import Record
from rverror.diagnosis.noise import Whitening
from rverror.geartrain.mechanism import Drive
from rverror.model.effects import Model
from rverror.model.sensor import slope
from rverror.runs.measurement import Run

BOW, BENT, LOST = "slow curvature over time", "slow curvature over the angle", "lost motion"
_TORQUE = 1e-3  # rms that stands for a torque's, rad: all that is small of an angle is a small share of it
_ROUNDED = 1.5  # times the rms of a rounding: two of them make 1.41


@dataclass(frozen=True, eq=False)
class DriveRecord(Record):
    """One run of a drive, which may turn both ways.

    Attributes
    ----------
    quantity : str
        Dimension of what was recorded, ``angle`` or ``torque``.
    unit : float
        Of the recorded quantity, N*mm in one of `error`: a torque is fitted as if it were an angle of some arcminutes.
    """

    quantity: str = "angle"
    unit: float = 1.0

    @cached_property
    def slowly(self) -> dict[str, Array]:
        """What the catalogue has no key for: a bow over time and over the angle, a constant for each direction."""
        clock = np.arange(self.theta.size, dtype=np.float64) if self.time is None else self.time
        powers = (1, 2, 3) if self.quantity == "torque" else (2, 3)
        found = {BOW: np.stack([_centred_power(clock, power) for power in powers])}
        if len(self.senses) > 1:
            if self.turns < 1:
                found[BENT] = np.stack([_centred_power(self.theta, power) for power in (2, 3)])
            found[LOST] = np.asarray(self.direction)[None] / 2
        return found

    @cached_property
    def whiten(self) -> Whitening:
        """Whitening under its noise; of the two samples beside a reversal no one knows on which side of it they are."""
        assert self.noise is not None
        turned, kept = np.flatnonzero(np.diff(self.direction)), self.kept.copy()
        kept[turned] = kept[turned + 1] = False
        return Whitening(self.noise, kept, self.starts, self.nuisance)

    @cached_property
    def settling(self) -> Array:
        """Slow changes that any run may have beside its offset, and lost motion where it turns both ways."""
        return np.concatenate(list(self.slowly.values()))


def records_of_drive(model: Model, runs: Sequence[Run]) -> tuple[list[DriveRecord], list[str]]:
    """Runs as they are fitted, and what was noticed.

    Parameters
    ----------
    model : Model
        Of a `Drive`.
    runs : sequence of Run

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
    found, notes = [], []
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
        theta, signal, first = _signal(run, drive, quantity)
        if first:
            notes.append(f"{name}: {first} samples of standstill and run-up left out")
        unit = 1.0 if quantity == "angle" else float(np.std(signal)) / _TORQUE or 1.0
        sense = run.direction[first:]
        record = DriveRecord(
            name, theta[first:], signal[first:] / unit, sense, None, np.ones(sense.size, dtype=np.bool_),
            time=None if run.time is None else run.time[first:], quantity=quantity, unit=unit,
        )  # fmt: skip
        found.append(record)
    return found, notes


def _rounding(run: Run, drive: Drive, name: str) -> list[str]:
    """What is to be noted of an error that is no more than the rounding of an angle: uniform, a step wide."""
    found = []
    angles = ("output_angle", run.output_angle, 1.0), ("input_angle", run.input_angle, abs(drive.ratio))
    for what, angle, over in angles:
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
    return run.te_column is None and angles == 1 and run.torque_record is not None


def _signal(run: Run, drive: Drive, quantity: str) -> tuple[Array, Array, int]:
    """Nominal output angle and the signal of a run, and how many samples at its start are no steady motion."""
    if quantity == "angle":
        return run.nominal_angle(drive), run.error(drive), 0
    assert run.torque_record is not None
    theta = run.output_angle if run.output_angle is not None else run.nominal_angle(drive)
    clock = np.arange(theta.size, dtype=np.float64) if run.time is None else run.time
    speed = np.abs(slope(theta, clock))
    steady = np.flatnonzero(speed > 0.5 * np.median(speed))
    first = int(steady[0]) if steady.size else 0
    # the drive swings about its speed for as long again as it takes to reach it
    return theta, run.torque_record, min(2 * first, theta.size // 4)


def _centred_power(values: Array, power: int) -> Array:
    middle, half = (values.max() + values.min()) / 2, max(float(np.ptp(values)) / 2, 1e-300)
    return np.asarray(np.polynomial.legendre.Legendre.basis(power)((values - middle) / half), dtype=np.float64)
