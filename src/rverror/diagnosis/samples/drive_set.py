"""A drive's runs as the joint fit of `gears.fit` takes them: every source acts at the output, nothing is solved."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, cast

import numpy as np

from rverror.base.arrays import Array
from rverror.base.chance import chi_square
from rverror.base.units import DISPLAY_UNITS, to_display
from rverror.diagnosis.causes import Named, identity
from rverror.diagnosis.gears.fit import RunSet
from rverror.diagnosis.gears.grid import AngleGrid, whole
from rverror.diagnosis.gears.observation import EverySample, Observation
from rverror.diagnosis.gears.record import Record
from rverror.diagnosis.gears.reducers import offered
from rverror.diagnosis.gears.waveform import LoadCase, Waveform
from rverror.diagnosis.policy import Policy
from rverror.diagnosis.samples.records import DriveRecord
from rverror.geartrain.action_line import ContactForces
from rverror.geartrain.mechanism import Mechanism, Reducer
from rverror.geartrain.source import Indices, Source
from rverror.model.catalogue import source
from rverror.model.effects import Model
from rverror.runs.spectrum import highest_order
from rverror.statics.loaded_state import SOFTENING

_POINTS = 8  # of a waveform of nothing
_APART = 1e-5  # of a row beside others: what keeps less is one of them, so that no size is enormous


@dataclass(frozen=True, eq=False)
class DriveObservation(EverySample):
    """A run of a drive, sample by sample: no gear train moves its output.

    Attributes
    ----------
    rows : dict
        Rows of sources at these angles, kept for all records of them.
    """

    rows: dict[object, Array]

    def beyond(self, unit: Mechanism, grid: AngleGrid, named: Named, forces: ContactForces, offset: float) -> Array:
        """Rows of a source, which hang on the angles alone."""
        name = id(self.record.theta), identity(named)
        if name not in self.rows:
            self.rows[name] = super().beyond(unit, grid, named, forces, offset)
        return self.rows[name]

    def of_wave(self, wave: Waveform, rows: Array, offset: float) -> Array:
        """Nothing of every row."""
        return np.zeros((len(rows), self.width))


@dataclass(frozen=True, eq=False)
class DriveSet(RunSet):
    """All runs of a drive.

    Attributes
    ----------
    candidates : tuple of Named
        All that may be missing.
    made : dict
        What was made of angles and recorded errors alone, whatever the noise: rows of sources, sizes before the fit.
    """

    candidates: tuple[Named, ...] = ()
    made: dict[object, Any] = field(default_factory=dict, repr=False)
    linear: ClassVar[bool] = True

    def framed(self, order: float, apart: float) -> bool:
        """Tell whether an order is that of a candidate, or lies nearer to one than so much."""
        return bool(np.abs(self._every_order - order).min(initial=math.inf) < apart)

    @cached_property
    def _every_order(self) -> Array:
        """Of all candidates."""
        return np.array([order for name in self.candidates for order in _orders(self.unit, name)])

    def solve(self, model: Model, near: Sequence[Waveform] | None = None) -> list[Waveform]:
        """A waveform of nothing."""
        nothing, unit = np.zeros((len(SOFTENING), _POINTS)), cast("Reducer", self.unit)  # which nothing asks for
        return [Waveform(c.turn, nothing[0], nothing[:0], nothing, (), unit) for c in self.conditions]

    def deviation(self, key: str, indices: Indices) -> tuple[float, ...]:
        """Standard deviation of each parameter before the runs are seen: what a workshop makes, or all that they show.

        A shaft may make a degree, or an arcsecond: no size is usual for it, but none makes more than there is, and no
        wave more than there is beside what drifts.
        """
        name = identity((key, indices))
        if name not in self.made:
            rows = self.influences(Model(self.unit), (), [(key, indices)])
            swings = source(key).periodic
            there = sum(float(np.sum(_beside(r, swings=swings) ** 2)) for r in self.records)
            made = sum(np.sum((row - row.mean(axis=1, keepdims=True)) ** 2, axis=1) for row in rows)
            most = np.sqrt(there / np.maximum(made, 1e-300))
            usual = super().deviation(key, indices)
            self.made[name] = tuple(float(max(min(s, m), 1e-300)) for s, m in zip(usual, most, strict=True))
        return cast("tuple[float, ...]", self.made[name])

    def slow_notes(self, record: Record, rest: Array) -> list[str]:
        """Each slow part of a residual that is significant, in words."""
        assert isinstance(record, DriveRecord)
        white = replace(record, slow=False).whiten(np.concatenate([rest[None], record.settling]))
        covariance = np.linalg.pinv(white[1:] @ white[1:].T, rcond=1e-12, hermitian=True)
        sizes, notes, first = covariance @ white[1:] @ white[0], list[str](), 0
        for name, rows in record.slowly.items():
            at = slice(first, first + len(rows))
            first += len(rows)
            squares = float(sizes[at] @ np.linalg.solve(covariance[at, at], sizes[at]))
            if squares < chi_square(self.policy.false_alarm, len(rows)):
                continue
            size = to_display(float(np.ptp(sizes[at] @ rows)) * record.unit, record.quantity)
            notes.append(
                f"{record.name}: {name}, {size:.4g} {DISPLAY_UNITS[record.quantity]} peak-to-peak, is significant; "
                "it is taken off and not named"
            )
        return notes

    @cached_property
    def observations(self) -> tuple[Observation, ...]:
        """How each record is looked at."""
        return tuple(DriveObservation(record, self.made) for record in self.records)


def _beside(record: Record, *, swings: bool) -> Array:
    """The error of a run about its mean, or beside all that drifts and bends."""
    if not swings:
        return np.asarray(record.error - record.error.mean())
    clock = np.arange(record.theta.size) if record.time is None else record.time
    plain = [np.ones(clock.size), clock - clock.mean(), record.theta - record.theta.mean()]
    return less(record.error, np.stack([*plain, *record.settling]))[0]


def less(values: Array, rows: Array) -> tuple[Array, int]:
    """Values less what rows make of them by least squares, and how many of the rows are apart."""
    columns = (rows / np.maximum(np.linalg.norm(rows, axis=1), 1e-300)[:, None]).T
    sizes, _, rank, _ = np.linalg.lstsq(columns, values, rcond=_APART)
    return np.asarray(values - columns @ sizes), int(rank)


def drive_set(model: Model, records: Sequence[DriveRecord], policy: Policy, candidates: Sequence[Named]) -> DriveSet:
    """Runs of a drive, with what may be missing.

    Parameters
    ----------
    model : Model
        Of a `Drive`.
    records : sequence of DriveRecord
    policy : Policy
    candidates : sequence of Named
    """
    turn: AngleGrid = whole(0.0, 2 * math.pi, _POINTS)
    return DriveSet(
        unit=model.mechanism,
        records=tuple(records),
        conditions=(LoadCase(1.0, None, turn),),
        which=(0,) * len(records),
        policy=policy,
        soft=np.zeros(len(SOFTENING), dtype=np.bool_),
        candidates=tuple(candidates),
    )


def candidates_of_drive(model: Model, records: Sequence[DriveRecord], policy: Policy) -> list[Named]:
    """Sources of the catalogue that the runs sample densely enough.

    Shafts that the user named go before the measuring chain, where these cannot be told apart.  Of a torque record they
    alone: no encoder's error makes torque.
    """
    unit, highest = model.mechanism, highest_order([r.theta for r in records])

    def wanted(entry: Source) -> bool:
        return policy.tries(entry) and not (records[0].quantity == "torque" and entry.acts == "reading")

    # those that are declared too
    found = [name for name in offered(Model(unit), records, wanted) if max(_orders(unit, name), default=0.0) < highest]
    return sorted(found, key=lambda name: source(name[0]).acts == "reading")


def _orders(unit: Mechanism, name: Named) -> tuple[float, ...]:
    """Orders of a source, per output turn and without their signs."""
    return tuple(abs(order) for order in source(name[0]).orders(unit, name[1]))


def distinguishable(unit: Mechanism, candidates: Sequence[Named], turns: float, policy: Policy) -> list[Named]:
    """Candidates without those that make the waves of one before them, or no more than a slope.

    Parameters
    ----------
    unit : Drive
    candidates : sequence of Named
    turns : float
        That the longest run travels: less of a wave than the travel tells from an offset is a slope, where that is one.
    policy : Policy
    """
    found: dict[object, Named] = {}
    slopes = any(not source(key).periodic for key, _ in candidates)
    for name in candidates:
        orders = _orders(unit, name)
        if slopes and any(orders) and max(orders) * turns < policy.taken:
            continue
        found.setdefault(orders if any(orders) else identity(name), name)
    return list(found.values())
