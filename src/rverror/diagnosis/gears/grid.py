"""Angles at which the gear train is solved, and the way from there to the samples of a run."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import scipy

from rverror.base.arrays import Array

_TURN = 2 * math.pi
_DEGREE = 5  # of the splines: five points a wave are then within 0.1 %
_MARGIN = 12  # nodes beyond either end of an open grid, over which what the ends do to a spline dies away


@dataclass(frozen=True)
class AngleGrid:
    """Even angles, over one period of the waveform or over the stretch that a run travels.

    Attributes
    ----------
    start, step : float
        First angle and distance, rad.
    points : int
    closed : bool
        Whether the waveform goes on at the first angle after the last.
    breaks : tuple of float
        Angles of a turn at which the waveform jumps, rad.
    """

    start: float
    step: float
    points: int
    closed: bool
    breaks: tuple[float, ...] = ()

    @property
    def theta(self) -> Array:
        """The angles, shape (points,), rad."""
        return np.asarray(self.start + self.step * np.arange(self.points), dtype=np.float64)

    def coarser(self, points: int) -> AngleGrid:
        """Grid over the same angles with so many a turn, if that is fewer."""
        step = _TURN / points
        if step <= self.step * (1 + 1e-9):
            return self
        if self.closed:
            fewer = whole(self.start, self.step * self.points, round(self.step * self.points / step))
        else:
            low = self.start + _MARGIN * self.step
            fewer = stretch(low, low + (self.points - 1 - 2 * _MARGIN) * self.step, step)
        return replace(fewer, breaks=self.breaks)

    def side(self, theta: Array) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
        """Between which breaks angles are; what is before the first is after the last."""
        found = np.searchsorted(np.array(self.breaks), np.mod(theta, _TURN))
        return np.asarray(found % max(len(self.breaks), 1), dtype=np.intp)

    def to_samples(self, theta: Array) -> Readout:
        """The way to samples at angles, rad."""
        place = (theta - self.start) / self.step
        nearest = np.rint(place)
        if np.abs(place - nearest).max() < 1e-4:
            at = nearest.astype(np.intp)
            return Readout(self, at % self.points if self.closed else at, None, None, self.side(theta))
        low = np.floor(place).astype(np.intp)
        part = place - low
        columns = low[:, None] + np.arange(-(_DEGREE // 2), _DEGREE // 2 + 2)
        columns = columns % self.points if self.closed else np.clip(columns, 0, self.points - 1)
        first, shape = (_DEGREE + 1) * np.arange(theta.size + 1), (theta.size, self.points)
        values, changes = (
            scipy.sparse.csr_array((of.ravel(), columns.ravel(), first), shape=shape)
            for of in (_basis(part), _basis(part, derivative=True) / self.step)
        )
        return Readout(self, None, values, changes, self.side(theta))


def _basis(part: Array, *, derivative: bool = False) -> Array:
    """Cardinal splines that reach a place, shape (n, degree + 1), or their slopes per node.

    Of each degree from those of the one before (Cox and de Boor); scipy.interpolate takes long to load.
    """
    here = np.ones((1, part.size))
    for degree in range(1, _DEGREE + 1 - derivative):
        at = part + np.arange(degree + 1)[:, None]  # from where the spline of each node begins
        beside = np.pad(here, ((1, 1), (0, 0)))
        here = (at * beside[1:] + (degree + 1 - at) * beside[:-1]) / degree
    if derivative:
        here = np.diff(np.pad(here, ((1, 1), (0, 0))), axis=0)
    return np.ascontiguousarray(here[::-1].T)


@dataclass(frozen=True, eq=False)
class Readout:
    """Values at samples from those at the angles of a grid."""

    grid: AngleGrid
    at: np.ndarray[tuple[int], np.dtype[np.intp]] | None
    values: scipy.sparse.csr_array | None
    slopes: scipy.sparse.csr_array | None
    side: np.ndarray[tuple[int], np.dtype[np.intp]]  # of the samples, between the breaks of the grid

    def __call__(self, rows: Array) -> Array:
        """Rows (k, points) at the samples, (k, n)."""
        if self.at is not None:
            return np.asarray(rows[:, self.at])
        assert self.values is not None
        return self._by_side(self.values, rows)

    def averaged(self, means: scipy.sparse.csr_array) -> Callable[[Array], Array]:
        """The way to means of samples, (m, n), as one sparse product where no break of the grid forbids it."""
        if self.at is not None:
            ones = np.ones(self.at.size), self.at, np.arange(self.at.size + 1)
            both = means @ scipy.sparse.csr_array(ones, shape=(self.at.size, self.grid.points))
            return lambda rows: np.asarray((both @ rows.T).T)
        if self.grid.breaks:
            return lambda rows: np.asarray((means @ self(rows).T).T)
        both = means @ self.values
        return lambda rows: np.asarray((both @ self._coefficients(rows).T).T)

    def change(self, row: Array) -> Array:
        """Change of a row (points,) with the angle, at the samples (n,)."""
        if self.slopes is None:
            grid = self.grid
            return np.asarray(grid.to_samples(grid.theta[self.at] + 1e-3 * grid.step).change(row))
        return np.asarray(self._by_side(self.slopes, row[None])[0])

    def _by_side(self, way: scipy.sparse.csr_array, rows: Array) -> Array:
        """Splines of each side of the breaks, a straight line in place of the others, so that none rings at a jump."""
        found = np.empty((len(rows), self.side.size))
        nodes = self.grid.side(self.grid.theta)
        for side in np.unique(self.side).tolist():
            own, at = nodes == side, self.side == side
            bridged = rows if own.all() else _bridged(rows, own, closed=self.grid.closed)
            found[:, at] = (way @ self._coefficients(bridged).T).T[:, at]
        return found

    def _coefficients(self, rows: Array) -> Array:
        mode = "grid-wrap" if self.grid.closed else "mirror"
        return np.asarray(scipy.ndimage.spline_filter1d(rows, _DEGREE, axis=1, mode=mode), dtype=np.float64)


def _bridged(rows: Array, own: np.ndarray[tuple[int], np.dtype[np.bool_]], *, closed: bool) -> Array:
    """Rows (k, points) with straight lines over all nodes but their own."""
    at, period = np.flatnonzero(own), own.size if closed else None
    if not at.size:
        return rows
    return np.stack([np.interp(np.arange(own.size), at, row[at], period=period) for row in rows])


def whole(start: float, period: float, points: int) -> AngleGrid:
    """Grid over one period."""
    return AngleGrid(start, period / points, points, closed=True)


def stretch(low: float, high: float, step: float) -> AngleGrid:
    """Grid over a stretch of travel, with what a spline needs beyond its ends."""
    points = math.ceil((high - low) / step) + 1 + 2 * _MARGIN
    return AngleGrid(low - _MARGIN * step, step, points, closed=False)
