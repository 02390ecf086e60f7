"""Observations: a run as a fit takes it, sample by sample or as a sufficient statistic of every smooth waveform.

Of a waveform g on the angles of a grid a run knows ``D = |W (y - B g)|^2``, with B from the grid to the samples and W
the whitening.  With W [B, X, y] = Q R, X what is no waveform of the gear train (drift, encoders), D is ``|R (g, x,
-1)|^2``: R is a sufficient statistic, whatever the length of the run.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol, TypeVar

import numpy as np
import scipy

from rverror.base.arrays import Array, Flags
from rverror.diagnosis.causes import Named
from rverror.diagnosis.gears.grid import AngleGrid, Readout
from rverror.diagnosis.gears.record import Record
from rverror.diagnosis.gears.waveform import Waveform, conditions_at
from rverror.diagnosis.noise import Whitening, averaged
from rverror.geartrain.action_line import ContactForces
from rverror.geartrain.contacts import motion
from rverror.geartrain.kinematics import Pose
from rverror.geartrain.mechanism import Mechanism
from rverror.model.catalogue import source
from rverror.model.compose import source_matrix

T = TypeVar("T")

_KEPT = 8  # readouts and motions of one run, each at its own offset of the marks


class Observation(Protocol):
    """What a fit asks of a run: rows in its own width, and what they are once whitened."""

    @property
    def width(self) -> int:
        """Numbers of a row."""

    @property
    def measured(self) -> Array:
        """The error."""

    def of_grid(self, grid: AngleGrid, rows: Array, offset: float) -> Array:
        """Rows on a grid."""

    def of_wave(self, wave: Waveform, rows: Array, offset: float) -> Array:
        """Rows on the grid of a waveform."""
        return self.of_grid(wave.grid, rows, offset)

    def change(self, wave: Waveform, offset: float) -> Array:
        """Change with the angle."""

    def beyond(self, unit: Mechanism, grid: AngleGrid, named: Named, forces: ContactForces, offset: float) -> Array:
        """Rows of a source that is no waveform of the grid, on which the forces are."""

    def whiten(self, rows: Array) -> Array:
        """Rows under the noise."""

    @property
    def freedom(self) -> int:
        """Independent values."""


def _once(kept: dict[object, Any], key: object, make: Callable[[], T]) -> T:
    """What is made for a key, once; another thread may clear what is kept at any time."""
    found: T | None = kept.get(key)
    if found is None:
        if len(kept) > _KEPT:
            kept.clear()
        found = kept[key] = make()
    return found


@dataclass(frozen=True, eq=False)
class EverySample(Observation):
    """A run sample by sample."""

    record: Record

    @property
    def width(self) -> int:
        """Number of samples."""
        return self.record.theta.size

    @property
    def measured(self) -> Array:
        """The error."""
        return self.record.error

    def readout(self, grid: AngleGrid, offset: float) -> Readout:
        """The way from a grid to the samples."""
        return _once(self.record.made, (grid, offset), lambda: grid.to_samples(self.record.theta + offset))

    def of_grid(self, grid: AngleGrid, rows: Array, offset: float) -> Array:
        """Rows on a grid, at the samples."""
        return self.readout(grid, offset)(rows)

    def change(self, wave: Waveform, offset: float) -> Array:
        """Change with the angle."""
        return self.readout(wave.grid, offset).change(wave.error)

    def beyond(self, unit: Mechanism, grid: AngleGrid, named: Named, forces: ContactForces, offset: float) -> Array:
        """Rows of a source that is projected at the samples themselves: no waveform that repeats."""
        key, indices = named
        if source(key).at_output:
            return source_matrix(self._motion(unit, 0.0), {"output": np.ones((1, self.width))}, key, indices)
        readout = self.readout(grid, offset)
        gears = self._motion(unit, offset)
        mesh = {
            k: readout(v.reshape(-1, v.shape[-1])).reshape(*v.shape[:-1], -1)
            for k, v in forces.items()
            if k in ("mesh", "spline")
        }
        return source_matrix(gears, mesh, key, indices)

    def _motion(self, unit: Mechanism, offset: float) -> Pose:
        """Motion at the samples, made once: stiffness plays no part in it."""
        record = self.record

        def made() -> Pose:
            return motion(unit, conditions_at(record.theta + offset, record.direction, record.torque, record.time))

        return _once(record.made, offset, made)

    @property
    def whitening(self) -> Whitening:
        """Whitening under the noise."""
        return self.record.whiten

    def whiten(self, rows: Array) -> Array:
        """Rows under the noise."""
        return self.whitening(rows)

    @property
    def freedom(self) -> int:
        """Independent values."""
        return self.whitening.freedom


@dataclass(frozen=True, eq=False)
class MeanSamples(EverySample):
    """A run through means of neighbouring samples, which say nearly all of low orders.

    The prediction is averaged as the readings are, and the noise is that of means: what folds onto an order is lost.

    Attributes
    ----------
    together : int
        Samples of each mean.
    """

    together: int
    _ways: dict[object, Any] = field(default_factory=dict, repr=False)

    @cached_property
    def _labels(self) -> tuple[np.ndarray[tuple[int], np.dtype[np.intp]], tuple[int, ...]]:
        """Which mean each sample belongs to, and the first of each series: what is left at its end joins the last."""
        ends, labels, starts = [*self.record.starts[1:], self.record.theta.size], list[Array](), [0]
        for first, last in zip(self.record.starts, ends, strict=True):
            count = max((last - first) // self.together, 1)
            labels.append(starts[-1] + np.minimum(np.arange(last - first) // self.together, count - 1))
            starts.append(starts[-1] + count)
        return np.concatenate(labels), tuple(starts[:-1])

    @cached_property
    def _kept(self) -> Flags:
        return np.asarray(np.bincount(self._labels[0], self.record.kept) > 0)

    @cached_property
    def means(self) -> scipy.sparse.csr_array:
        """From samples to means: of those that were not set aside, where there are any."""
        labels, _ = self._labels
        weight = np.where(self._kept[labels], self.record.kept, True).astype(np.float64)
        share = weight / np.bincount(labels, weight)[labels]
        places = labels, np.arange(labels.size)
        return scipy.sparse.csr_array((share, places), shape=(self._kept.size, labels.size))

    def averaged(self, rows: Array) -> Array:
        """Rows of samples, (k, n), as means, (k, m)."""
        return np.asarray((self.means @ rows.T).T)

    @property
    def width(self) -> int:
        """Number of means."""
        return int(self._kept.size)

    @cached_property
    def measured(self) -> Array:
        """The error."""
        return np.asarray(self.averaged(self.record.error[None])[0])

    def of_grid(self, grid: AngleGrid, rows: Array, offset: float) -> Array:
        """Rows on a grid, as means."""
        way = _once(self._ways, (grid, offset), lambda: self.readout(grid, offset).averaged(self.means))
        return way(rows)

    def change(self, wave: Waveform, offset: float) -> Array:
        """Change with the angle."""
        return np.asarray(self.averaged(super().change(wave, offset)[None])[0])

    def beyond(self, unit: Mechanism, grid: AngleGrid, named: Named, forces: ContactForces, offset: float) -> Array:
        """Rows of a source that is no waveform of the grid."""
        return self.averaged(EverySample(self.record).beyond(unit, grid, named, forces, offset))

    @cached_property
    def whitening(self) -> Whitening:
        """Whitening under the noise of means."""
        record = self.record
        doubtful = None if record.doubtful is None else self.averaged(record.doubtful)
        noise, nuisance = averaged(record.whiten.noise, self.together), self.averaged(record.nuisance)
        return Whitening(noise, self._kept, self._labels[1], nuisance, doubtful)
