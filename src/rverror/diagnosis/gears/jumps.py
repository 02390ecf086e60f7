"""Jumps of a lightly loaded gear train, whose angle no model tells to a sample.

At light load pins and flanks change sides, and the output jumps by some arcsec from one equilibrium to another.  The
equilibrium has the jump, but exact poses have it some tenths of a degree earlier or later, and the samples between are
off by all of it: what moves one jump by one sample takes off as much as a cause does.
"""

from __future__ import annotations

import math

import numpy as np

from rverror.base.arrays import Array, Flags
from rverror.diagnosis.gears.fit import Fit
from rverror.diagnosis.gears.record import Record
from rverror.diagnosis.gears.waveform import Waveform

_BY_NOISE = 4.0  # standard deviations: noise goes beyond once in 16,000 values
_REACH = 4 * math.pi / 2048  # rad, 0.35 deg: beside exact poses a jump was out of place by one or two of 2048 a turn


def jumps(wave: Waveform, least: float) -> Flags:
    """Angles beside which a waveform jumps.

    Parameters
    ----------
    wave : Waveform
    least : float
        By more than this between two angles of the grid, beyond what it changes by to either side, rad.

    Returns
    -------
    ndarray of bool, shape (points,)
        The angles of the grid within `_REACH` of a jump, two to either side at least.
    """
    reach = max(round(_REACH / wave.grid.step), 2)
    change = np.roll(wave.error, -1) - wave.error
    beside = np.sort([np.roll(change, step) for step in (-2, -1, 1, 2)], axis=0)
    found = np.abs(change - (beside[1] + beside[2]) / 2) > least
    if not wave.grid.closed:
        found[-3:] = found[:2] = False
    return np.asarray(np.any([np.roll(found, step) for step in range(1 - reach, 1 + reach)], axis=0))


def fall(before: Fit, after: Fit) -> float:
    """How much lower the objective is after than before, with what moved jumps alone give left out.

    Samples beside a jump of either fit, at which they differ by more than noise, are taken as unknown.

    Parameters
    ----------
    before, after : Fit
        Of the same runs under the same noise.  Where not every sample is looked at, as in a table of orders, or nothing
        jumps, nothing is left out.
    """
    whole, scale = before.objective - after.objective, max(before.scale, after.scale)
    both = list(zip(before.run_set.records, after.run_set.records, strict=True))
    if before.run_set.linear or any(a.noise is None or a.noise is not b.noise or a.kept is not b.kept for a, b in both):
        return whole
    for number, (less, more) in enumerate(both):
        at = _moved(before, after, number)
        if at.any() and at.mean() < before.run_set.policy.jumped:
            first = _made_by(less, at)
            then = first if more is less else _made_by(more, at)
            there = [_squares(less, before, number, first), _squares(more, after, number, then)]
            whole -= (there[0] - there[1]) / scale
    return whole


def _made_by(record: Record, at: Flags) -> Array:
    """All that some samples of a run can make, whitened: an orthonormal basis, shape (n, k)."""
    units = np.flatnonzero(at)[:, None] == np.arange(at.size)
    return np.linalg.qr(record.whiten(units.astype(np.float64)).T)[0]


def _squares(record: Record, fit: Fit, number: int, basis: Array) -> float:
    """Squares of a residual within a basis."""
    return float(np.sum((record.whiten(fit.residual[number][None])[0] @ basis) ** 2))


def _moved(before: Fit, after: Fit, number: int) -> Flags:
    """Samples of a run over which a jump moved from one fit to another."""
    record, which = before.run_set.records[number], before.run_set.which[number]
    least = _BY_NOISE * record.whiten.noise.rms
    differ = np.abs(record.without_nuisance(after.residual[number] - before.residual[number])) > least
    beside = np.zeros_like(differ)
    for fit in (before, after):
        grid = fit.waves[which].grid
        place = np.rint((record.theta + fit.model.index_offset - grid.start) / grid.step).astype(np.intp)
        beside |= jumps(fit.waves[which], least)[place % grid.points]
    return np.asarray(differ & beside & record.kept)
