"""A drive's runs as the joint fit of `gears.fit` takes them: every source acts at the output, nothing is solved."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, ClassVar, cast

import numpy as np

from rverror.base.arrays import Array
from rverror.base.chance import chi_square
from rverror.base.units import ARCSEC
from rverror.diagnosis.gears.fit import RunSet
from rverror.diagnosis.gears.grid import AngleGrid, whole
from rverror.diagnosis.gears.record import Record
from rverror.diagnosis.gears.score import identity, named
from rverror.diagnosis.gears.sight import EverySample, Sight
from rverror.diagnosis.gears.waveform import Conditioned, Named, Waveform
from rverror.diagnosis.policy import Policy
from rverror.diagnosis.samples.records import LOST, DriveRecord
from rverror.geartrain.action_line import ContactForces
from rverror.geartrain.mechanism import Mechanism, Reducer
from rverror.geartrain.source import Indices
from rverror.model.catalogue import CATALOGUE, source
from rverror.model.effects import Model
from rverror.runs.spectrum import highest_order
from rverror.statics.loaded_state import SOFTENING

_POINTS = 8  # of a waveform of nothing
_ERROR, _OFFSET, _SLOW = "error", "offset", "slow"  # rows of a compressed run that no source makes
_APART = 1e-5  # of a row beside others: what keeps less is one of them, so that no size is enormous
_IN_SPAN = 1e-10  # share of a row beyond what is there that is rounding


@dataclass(frozen=True, eq=False)
class DriveSight(EverySample):
    """A run of a drive, sample by sample: no gear train moves its output."""

    def beyond(self, bench: Any, model: Model, named: Named, forces: ContactForces | None, offset: float) -> Array:
        """Rows of a source, which hang on the angles alone."""
        name, made = (id(self.record.theta), identity(named)), bench.made
        if name not in made:
            made[name] = super().beyond(bench, model, named, forces, offset)
        return np.asarray(made[name])

    def of_wave(self, wave: Waveform, rows: Array, offset: float) -> Array:
        """Nothing of every row."""
        return np.zeros((len(rows), self.width))


class Coordinates:
    """Rows of a run, whitened, as sums of an orthonormal basis that grows with them (QR).

    A fit of rows to a run of any length is one to as many numbers as there are rows, and exact.

    Parameters
    ----------
    record : DriveRecord
        With its noise; its lines and what settles play no part.
    """

    def __init__(self, record: DriveRecord) -> None:
        """No row is known yet."""
        self.record, self.white = record, record.beside(np.zeros((0, record.theta.size)))
        self.basis = np.zeros((0, self.white.usable.size))
        self._known: dict[object, Array] = {}

    def of(self, name: object, make: Callable[[], Array]) -> Array:
        """Coordinates of rows, made and whitened once, shape (k, number of the basis then)."""
        if name not in self._known:
            white = self.white(make())
            inside = white @ self.basis.T
            rest = white - inside @ self.basis
            more = rest @ self.basis.T  # rounding of the first step
            left, size, beyond = np.linalg.svd(rest - more @ self.basis, full_matrices=False)
            new = size > _IN_SPAN * max(float(np.linalg.norm(white, axis=1).max(initial=0.0)), 1e-300)
            self.basis = np.concatenate([self.basis, beyond[new]])
            self._known[name] = np.concatenate([inside + more, left[:, new] * size[new]], axis=1)
        return self._known[name]


@dataclass(frozen=True, eq=False)
class CompressedSight(DriveSight):
    """A run by the `Coordinates` of its rows, all of which were made before.

    Attributes
    ----------
    coordinates : Coordinates
    count : int
        Of them.
    """

    coordinates: Coordinates
    count: int

    @property
    def width(self) -> int:
        """Number of coordinates."""
        return self.count

    @cached_property
    def measured(self) -> Array:
        """The error."""
        return np.asarray(self._of(_ERROR)[0])

    def beyond(self, bench: Any, model: Model, named: Named, forces: ContactForces | None, offset: float) -> Array:
        """Rows of a source."""
        return self._of(identity(named))

    def whiten(self, rows: Array) -> Array:
        """Rows less what offset, lines and what settles make of them."""
        return np.asarray(rows - (rows @ self._taken) @ self._taken.T)

    @property
    def freedom(self) -> int:
        """Independent values."""
        return self.coordinates.white.freedom

    @cached_property
    def _taken(self) -> Array:
        """Orthonormal columns that offset, lines and what settles span."""
        parts = [_OFFSET, *self.record.orders, *([_SLOW] if self.record.slow else [])]
        rows = np.concatenate([self._of(name) for name in parts])
        columns, size, _ = np.linalg.svd((rows / np.linalg.norm(rows, axis=1)[:, None]).T, full_matrices=False)
        return np.asarray(columns[:, size > _IN_SPAN * size[0]])

    def _of(self, name: object) -> Array:
        rows = self.coordinates.of(name, _not_made)
        return np.pad(rows, ((0, 0), (0, self.count - rows.shape[1])))


def _not_made() -> Array:
    raise AssertionError("rows of a compressed run are made with its sight")


@dataclass(frozen=True, eq=False)
class DriveSet(RunSet):
    """All runs of a drive.

    Attributes
    ----------
    candidates : tuple of Named
        All that may be missing.
    sources : tuple of Named
        These, and all that is declared.
    compressed : bool
        Whether the runs are looked at through the `Coordinates` of their rows.
    made : dict
        What was made of angles and recorded errors alone, whatever the noise: rows of sources, sizes before the fit.
    """

    candidates: tuple[Named, ...] = ()
    sources: tuple[Named, ...] = ()
    compressed: bool = False
    made: dict[object, Any] = field(default_factory=dict, repr=False)
    linear: ClassVar[bool] = True

    @property
    def settles(self) -> bool:
        """A bow, or a constant for each direction, is no encoder's error."""
        return True

    def framed(self, order: float, apart: float) -> bool:
        """Tell whether an order is that of a candidate, or lies nearer to one than so much."""
        return bool(np.abs(self._orders - order).min(initial=math.inf) < apart)

    @cached_property
    def _orders(self) -> Array:
        """Of all candidates."""
        return np.array([abs(o) for key, at in self.candidates for o in source(key).orders(self.unit, at)])

    @property
    def few(self) -> RunSet:
        """The same: there is no grid, and a linear step is the fit."""
        return self

    def apart(self, key: str) -> bool:
        """Nothing is solved."""
        return False

    def solve(self, model: Model, near: Sequence[Waveform] | None = None) -> list[Waveform]:
        """A waveform of nothing."""
        nothing, unit = np.zeros((len(SOFTENING), _POINTS)), cast("Reducer", self.unit)  # which nothing asks for
        return [Waveform(c.turn, nothing[0], nothing[:0], nothing, (), unit) for c in self.conditions]

    def influences(self, model: Model, waves: Sequence[Waveform], named: Sequence[Named]) -> list[Array]:
        """Influences of sources at the samples of each record."""

        def seen(number: int) -> Array:
            sight = self.sights[number]
            rows = [sight.beyond(self, model, name, None, 0.0) for name in named]
            return np.concatenate([np.zeros((0, sight.width)), *rows])

        return self.of_each(seen)

    def deviation(self, key: str, indices: Indices) -> tuple[float, ...]:
        """Standard deviation of each parameter before the runs are seen: what a workshop makes, or all that they show.

        A shaft may make a degree, or an arcsecond: no size is usual for it, but none makes more than there is, and no
        wave more than there is beside what drifts.
        """
        name = identity((key, indices))
        if name not in self.made:
            rows = self.every_sample.influences(Model(self.unit), (), [(key, indices)])
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
            if float(sizes[at] @ np.linalg.solve(covariance[at, at], sizes[at])) < chi_square(
                self.policy.false_alarm, len(rows)
            ):
                continue
            if name == LOST:
                value, half = float(sizes[at][0]), self.half_width(float(covariance[at, at][0, 0]))
                told, low, high = (v / ARCSEC for v in (value, value - half, value + half))
                notes.append(
                    f"{record.name}: the output leads by {told:.4g} arcsec more, {100 * self.policy.confidence:g} % "
                    f"[{low:.4g}, {high:.4g}], in forward than in reverse motion: lost motion or friction, a constant "
                    "for each direction; no key of the catalogue, so it is taken off and not added to the model"
                )
                continue
            size, unit = record.in_units(float(np.ptp(sizes[at] @ rows)))
            notes.append(
                f"{record.name}: {name}, {size:.4g} {unit} peak-to-peak, is significant; it is taken off and not named"
            )
        return notes

    @cached_property
    def sights(self) -> tuple[Sight, ...]:
        """How each record is looked at."""
        return tuple(self._compressed(r) if self.compressed else DriveSight(r) for r in self.records)

    @cached_property
    def every_sample(self) -> DriveSet:
        """The same, sample by sample."""
        return replace(self, compressed=False) if self.compressed else self

    def _compressed(self, record: Record) -> CompressedSight:
        assert isinstance(record, DriveRecord)
        name = id(record.theta), id(record.noise)
        if name not in self.made:  # which keeps the noise, and so its identity
            self.made[name] = Coordinates(record)
        known, plain, model = cast("Coordinates", self.made[name]), DriveSight(record), Model(self.unit)
        known.of(_ERROR, lambda: record.error[None])
        known.of(_OFFSET, lambda: np.ones((1, record.theta.size)))
        known.of(_SLOW, lambda: record.settling)
        for one in self.sources:
            known.of(identity(one), partial(plain.beyond, self, model, one, None, 0.0))
        for order in record.orders:
            known.of(order, partial(record.wave, order))
        return CompressedSight(record, known, len(known.basis))


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
    missing = {identity(name): name for name in candidates}
    declared = {named(e): (e.key, e.indices) for e in model.effects}
    return DriveSet(
        unit=model.mechanism,
        records=tuple(records),
        conditions=(Conditioned(1.0, None, turn),),
        which=(0,) * len(records),
        policy=policy,
        soft=np.zeros(len(SOFTENING), dtype=np.bool_),
        candidates=tuple(candidates),
        sources=tuple((missing | declared).values()),
    )


def candidates_of_drive(model: Model, records: Sequence[DriveRecord], policy: Policy) -> list[Named]:
    """Sources of the catalogue that the runs sample densely enough.

    Shafts that the user named go before the measuring chain, where these cannot be told apart.  Of a torque record they
    alone: no encoder's error makes torque.
    """
    unit, found = model.mechanism, list[Named]()
    highest = highest_order([r.theta for r in records])
    for key, entry in CATALOGUE.items():
        if not entry.applies_to(unit) or not policy.tries(entry):
            continue
        if records[0].quantity == "torque" and entry.acts == "reading":
            continue
        if any(entry.lacks(unit, record) for record in records):
            continue
        for indices in entry.candidates(unit):
            orders = [abs(order) for order in entry.orders(unit, indices)]
            if max(orders, default=0.0) < highest:
                found.append((key, indices))
    return sorted(found, key=lambda name: source(name[0]).acts == "reading")


def told_apart(unit: Mechanism, candidates: Sequence[Named], turns: float, policy: Policy) -> list[Named]:
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
        orders = tuple(abs(o) for o in source(name[0]).orders(unit, name[1]))
        if slopes and any(orders) and max(orders) * turns < policy.taken:
            continue
        found.setdefault(orders if any(orders) else identity(name), name)
    return list(found.values())
