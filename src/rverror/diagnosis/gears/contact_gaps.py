"""Causes that no run can tell from one, but by what the one can do and the other cannot: they close the same gaps."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from rverror.base.arrays import Array
from rverror.diagnosis.causes import Named, caused, identity, named
from rverror.geartrain.action_line import Clearance, Compliance, Contacts
from rverror.geartrain.contacts import pose
from rverror.geartrain.mechanism import Reducer
from rverror.model.catalogue import source
from rverror.model.effects import Effect
from rverror.statics.energy import Geometry, error_closing

_ANGLES, _GOLDEN = 16, 0.6180339887  # irregular against every order
_ROUNDING = 1e-6  # share of the gaps, in the root of their squares, that is none
_HALF = math.sqrt(0.5)  # half of the squares: one of two carrier bores closes so much of what a runout of both closes


@dataclass(frozen=True, eq=False)
class ContactGaps:
    """What sources close at all contacts of a gear train.

    Attributes
    ----------
    unit : Reducer
    """

    unit: Reducer
    _made: dict[object, Array | None] = field(default_factory=dict, repr=False)

    def equivalents(self, effect: Effect, candidates: Sequence[Named]) -> list[Effect]:
        """Other sources that close the gaps of an effect, or of which its source can do all; in the nearest size."""
        own = self.of((effect.key, effect.indices))
        return [
            other
            for other, rows, share in self._sized(effect, candidates)
            if share < _ROUNDING or (own is not None and _nearest(rows, own)[1] < _ROUNDING)
        ]

    def near(self, effect: Effect, candidates: Sequence[Named]) -> list[Effect]:
        """Other sources that close half of the squares of an effect's gaps or more, in the nearest size.

        Pins that are all thinner, and a profile modified by as much, open all gaps nearly alike: next to nothing shows
        but what this does to contacts under load, and no small change of one tells the size of the other.
        """
        return [other for other, _, share in self._sized(effect, candidates) if share < _HALF + _ROUNDING]

    def _sized(self, effect: Effect, candidates: Sequence[Named]) -> Iterator[tuple[Effect, Array, float]]:
        """Other sources in the sizes that come nearest to an effect's gaps, their gaps, and the share they lack."""
        own = self.of((effect.key, effect.indices))
        for name in candidates:
            rows = self.of(name)
            if own is None or rows is None or identity(name) == named(effect):
                continue
            sizes, share = _nearest(np.array(effect.values) @ own, rows)
            yield caused(name, sizes), rows, share

    def of(self, cause: Named) -> Array | None:
        """Gaps per parameter of a source, at some angles; None where it closes none of its own."""
        name = identity(cause)
        if name not in self._made:
            self._made[name] = self._rows(cause)
        return self._made[name]

    def _rows(self, cause: Named) -> Array | None:
        (key, indices), entry = cause, source(cause[0])
        if entry.at_output:
            return None
        units = [Effect(key, indices, tuple(row)) for row in np.eye(len(entry.parameters))]
        if isinstance(self._contacts.closings(units[0]), (Clearance, Compliance)):
            return None
        closings = [error_closing(self._contacts, (unit,)) for unit in units]
        return np.array([np.concatenate([errors.pin.ravel(), errors.row.ravel()]) for errors in closings])

    @cached_property
    def _contacts(self) -> Geometry:
        motion = pose(self.unit, 2 * np.pi * np.mod(_GOLDEN * np.arange(_ANGLES), 1), direction=1.0, torque="1 N*mm")
        assert isinstance(motion, Contacts)
        return Geometry(motion)


def _nearest(gaps: Array, rows: Array) -> tuple[Array, float]:
    """Sizes of rows that come nearest to some gaps, (n,) or (k, n), and the share of these that no sizes make."""
    sizes = np.asarray(np.linalg.lstsq(rows.T, gaps.T, rcond=1e-9)[0].T, dtype=np.float64)
    return sizes, float(np.linalg.norm(gaps - sizes @ rows) / max(float(np.linalg.norm(gaps)), 1e-300))
