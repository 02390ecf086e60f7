"""How a run is looked at: sample by sample, or through as few numbers as say the same of every smooth waveform.

Of a waveform g on the angles of a grid a run knows ``D = |W (y - B g)|^2``, with B from the grid to the samples and W
the whitening.  With W [B, X, y] = Q R, X what is no waveform of the gear train (drift, encoders), D is ``|R (g, x,
-1)|^2``: R says all that the run says, whatever its length.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Protocol, TypeVar

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array
from rverror.diagnosis.gears.grid import AngleGrid, Readout
from rverror.diagnosis.gears.record import Record
from rverror.diagnosis.gears.waveform import Named, Waveform
from rverror.geartrain.action_line import ContactForces
from rverror.geartrain.kinematics import Pose
from rverror.geartrain.mechanism import Reducer
from rverror.model.catalogue import source
from rverror.model.compose import source_matrix
from rverror.model.effects import Model

_HIGHEST = 0.45  # of the samples of a grid: the highest order that a spline through them follows


T = TypeVar("T")

_KEPT = 8  # readouts and motions of one run, each at its own offset of the marks


class Sight(Protocol):
    """What a fit asks of a run: rows in its own width, and what they are once whitened."""

    @property
    def width(self) -> int:
        """Numbers of a row."""

    @property
    def measured(self) -> Array:
        """The error."""

    @property
    def constant(self) -> Array:
        """An offset of one."""

    def of_wave(self, wave: Waveform, rows: Array, offset: float) -> Array:
        """Rows on the grid of a waveform."""

    def of_grid(self, grid: AngleGrid, rows: Array, offset: float) -> Array:
        """Rows on a grid."""

    def change(self, wave: Waveform, offset: float) -> Array:
        """Change with the angle."""

    def beyond(self, bench: Any, model: Model, named: Named, forces: ContactForces | None, offset: float) -> Array:
        """Rows of a source that is no waveform of the grid."""

    def whiten(self, rows: Array) -> Array:
        """Rows under the noise."""


@dataclass(frozen=True, eq=False)
class EverySample:
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

    @property
    def constant(self) -> Array:
        """An offset of one."""
        return np.ones(self.width)

    def readout(self, grid: AngleGrid, offset: float) -> Readout:
        """The way from a grid to the samples."""
        return self._once((grid, offset), lambda: grid.to_samples(self.record.theta + offset))

    def of_wave(self, wave: Waveform, rows: Array, offset: float) -> Array:
        """Rows on the grid of a waveform, at the samples."""
        return self.readout(wave.grid, offset)(rows)

    def of_grid(self, grid: AngleGrid, rows: Array, offset: float) -> Array:
        """Rows on a grid, at the samples."""
        return self.readout(grid, offset)(rows)

    def change(self, wave: Waveform, offset: float) -> Array:
        """Change with the angle."""
        return self.readout(wave.grid, offset).change(wave.error)

    def beyond(self, bench: Any, model: Model, named: Named, forces: ContactForces | None, offset: float) -> Array:
        """Rows of a source that is projected at the samples themselves: no waveform that repeats."""
        unit = model.mechanism
        assert isinstance(unit, Reducer)
        key, indices = named
        if source(key).at_output:
            return source_matrix(self._motion(unit, 0.0), {"output": np.ones((1, self.width))}, key, indices)
        assert forces is not None
        number = next(i for i, r in enumerate(bench.records) if r.name == self.record.name)
        readout = self.readout(bench.conditions[bench.which[number]].turn, offset)
        gears = self._motion(unit, offset)
        mesh = {
            k: readout(v.reshape(-1, v.shape[-1])).reshape(*v.shape[:-1], -1)
            for k, v in forces.items()
            if k in ("mesh", "spline")
        }
        return source_matrix(gears, mesh, key, indices)

    def _motion(self, unit: Reducer, offset: float) -> Pose:
        """Motion at the samples, made once: stiffness plays no part in it."""
        turned = replace(self.record, theta=self.record.theta + offset)
        return self._once(offset, lambda: turned.pose(unit))

    def _once(self, key: object, make: Callable[[], T]) -> T:
        """What the angles of the samples give, made once."""
        kept = self.record.made
        found: T | None = kept.get(key)
        if found is None:
            if len(kept) > _KEPT:
                kept.clear()
            found = kept[key] = make()
        return found

    def whiten(self, rows: Array) -> Array:
        """Rows under the noise."""
        return self.record.whiten(rows)


@dataclass(frozen=True, eq=False)
class Few:
    """A run as few numbers say it: a row is what R makes of a waveform.

    Attributes
    ----------
    grid : AngleGrid
    root : ndarray, shape (m, m)
        R.
    names : mapping
        Place of each source that is no waveform.
    """

    grid: AngleGrid
    root: Array
    names: Mapping[object, slice]
    _maps: dict[AngleGrid, Array] = field(default_factory=dict, repr=False)
    _waves: dict[AngleGrid, tuple[Array, npt.NDArray[np.complex128]]] = field(default_factory=dict, repr=False)

    @property
    def width(self) -> int:
        """Rows of R: angles, sources beyond, and the measured error."""
        return len(self.root)

    @property
    def measured(self) -> Array:
        """The error."""
        return np.asarray(self.root[:, -1])

    @property
    def constant(self) -> Array:
        """An offset of one."""
        return np.asarray(self.root[:, : self.grid.points].sum(axis=1))

    @cached_property
    def _own(self) -> Array:
        """Matrix from the own grid to R's rows."""
        return np.ascontiguousarray(self.root[:, : self.grid.points].T)

    def _harmonics(self, grid: AngleGrid) -> tuple[Array, npt.NDArray[np.complex128]]:
        """Orders that the own grid can follow of a closed one's, and what R makes of a wave of each, exp(i order
        theta), from the closed grid's start."""
        if grid not in self._waves:
            first = 2 * math.pi / (grid.step * grid.points)  # order of the first harmonic
            most = min(grid.points // 2 - 1, int(_HIGHEST * 2 * math.pi / self.grid.step / first))
            order = first * np.arange(most + 1, dtype=np.float64)
            waves = np.exp(1j * np.outer(order, self.grid.theta - grid.start)) @ self._own
            self._waves[grid] = order, np.asarray(waves, dtype=np.complex128)
        return self._waves[grid]

    def _shifted(self, grid: AngleGrid, rows: Array, offset: float, *, slope: bool = False) -> Array:
        """What R makes of rows on a grid, or of how they change, read so much further on."""
        if not grid.closed:
            angle = self.grid.theta + offset
            readout = grid.to_samples(angle + 1e-3 * grid.step)
            return (readout.change(rows[0])[None] if slope else grid.to_samples(angle)(rows)) @ self._own
        order, waves = self._harmonics(grid)
        sizes = np.fft.rfft(rows)[:, : order.size] * np.where(order == 0, 1.0, 2.0) / grid.points
        turned = sizes * np.exp(1j * order * offset) * (1j * order if slope else 1.0)
        return np.asarray((turned @ waves).real)

    def of_wave(self, wave: Waveform, rows: Array, offset: float) -> Array:
        """Rows on the grid of a waveform."""
        return self.of_grid(wave.grid, rows, offset)

    def of_grid(self, grid: AngleGrid, rows: Array, offset: float) -> Array:
        """Rows on a grid."""
        if offset:
            return self._shifted(grid, rows, offset)
        if grid == self.grid:
            return np.asarray(rows @ self._own)
        if grid not in self._maps:
            self._maps[grid] = self._shifted(grid, np.eye(grid.points), 0.0)
        return np.asarray(rows @ self._maps[grid])

    def change(self, wave: Waveform, offset: float) -> Array:
        """Change with the angle."""
        return np.asarray(self._shifted(wave.grid, wave.error[None], offset, slope=True)[0])

    def beyond(self, bench: Any, model: Model, named: Named, forces: ContactForces | None, offset: float) -> Array:
        """Rows of a source that is no waveform of the grid."""
        return np.asarray(self.root[:, self.names[_name(named)]].T)

    def whiten(self, rows: Array) -> Array:
        """Rows as they are: R's are white."""
        return rows


def _name(named: Named) -> object:
    return named[0], tuple(sorted(named[1].items()))


def compressed(bench: Any, full: EverySample, grid: AngleGrid) -> Few:
    """Say a run in few numbers.

    Parameters
    ----------
    bench : RunSet
        Whose `few` names the sources that are no waveforms.
    full : EverySample
    grid : AngleGrid
    """
    names: dict[object, slice] = {}
    end, rows = grid.points, []
    model, wave = bench.plain
    forces = None
    for named in bench.few:
        if not named[0] or _name(named) in names:
            continue
        if not source(named[0]).at_output and forces is None:
            number = next(i for i, r in enumerate(bench.records) if r is full.record)
            condition = bench.conditions[bench.which[number]]
            forces = condition.forces(wave[bench.which[number]])[1]
        block = full.beyond(bench, model, named, forces, model.index_offset)
        names[_name(named)] = slice(end, end + len(block))
        end += len(block)
        rows.append(block)
    rows.append(full.measured[None])
    rows_beyond = np.concatenate(rows)
    gram = _gram(full, full.readout(grid, 0.0), rows_beyond)
    # what an offset makes up for is left with rounding: it counts as nothing beside its size
    # before, which has a square
    before = np.linalg.norm(full.record.whiten.filtered(rows_beyond), axis=1)
    scale = np.concatenate([np.sqrt(np.maximum(np.diag(gram)[: grid.points], 1e-300)), np.maximum(before, 1e-150)])
    gram /= np.outer(scale, scale)
    gram[np.diag_indices_from(gram)] += 1e-11  # a grid finer than what was travelled leaves some of it unseen
    root = scipy.linalg.cholesky(gram, lower=False) * scale
    return Few(grid, np.asarray(root, dtype=np.float64), names)


def _gram(full: EverySample, readout: Readout, rows: Array) -> Array:
    """Products of the whitened [B, X, y], by B's few entries a sample."""
    whitening = full.record.whiten
    nodes = readout.nodes
    filtered = whitening.sparse @ nodes  # (used, points)
    smooth = readout.smoothing  # from values to what the nodes' splines carry
    basis, white = whitening.basis, whitening(rows)
    inner = np.asarray((filtered.T @ filtered).todense())
    across = (filtered.T @ basis.T) if len(basis) else np.zeros((nodes.shape[1], 0))
    inner -= across @ across.T
    if smooth is not None:
        inner = smooth.T @ inner @ smooth
    side = filtered.T @ white.T
    if smooth is not None:
        side = smooth.T @ side
    return np.block([[inner, side], [side.T, white @ white.T]])
