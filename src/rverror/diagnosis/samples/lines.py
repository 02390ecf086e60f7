"""Lines of any order in a residual of samples, which compete with the catalogue."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rverror.base.arrays import Array
from rverror.base.chance import chi_square
from rverror.diagnosis.noise import RunNoise
from rverror.diagnosis.samples.coloured import noise_of_samples
from rverror.diagnosis.samples.fit import SampleFit, fitted, held_out_gain, screened
from rverror.diagnosis.samples.regressors import EFFECT, LINE, line_term
from rverror.diagnosis.samples.runs import RunData

_TURN = 2 * np.pi
#: Cycles a run within which two orders are one, and by which a fitted one may miss a whole one and be told as that.
SAME_ORDER, TOLD_ORDER = 0.25, 0.05
MOST_LINES = 12  # that are put in at the end
_LIKELY = 0.05  # chance at which a maximum of the spectrum is looked at closer
_PEAKS, _FITTED = 6, 3  # how many of them in each run, and how many are then fitted
_EVEN = 1e-6  # of a step: samples nearer to even ones are taken as such


def line_spectrum(theta: Array, residual: Array, noise: RunNoise, lowest: float, highest: float) -> tuple[Array, Array]:
    """Power of a wave of each order in a residual, as the squared distance from 0 in standard deviations.

    Parameters
    ----------
    theta : ndarray, shape (n,)
        rad; any order of samples.
    residual : ndarray, shape (n,)
    noise : RunNoise
    lowest, highest : float
        Order.

    Returns
    -------
    order, power : ndarray, shape (m,)
        Four to each that the travel tells apart.  About chi-square of 2 degrees where there is only the noise.
    """
    span = float(np.ptp(theta))
    step = np.pi / (8 * highest)
    count = int(2 ** np.ceil(np.log2(4 * span / step + 2)))
    place = (theta - theta.min()) / step
    low = np.floor(place).astype(np.intp)
    part = place - low
    grid = np.bincount(low, residual * (1 - part), count) + np.bincount(low + 1, residual * part, count)
    lines = np.abs(np.fft.rfft(grid)) ** 2
    order = _TURN / (count * step) * np.arange(lines.size)
    used = (order >= lowest) & (order <= highest)
    order, lines = order[used], lines[used]
    moves = np.quantile(np.abs(np.diff(theta)), (np.arange(16) + 0.5) / 16)
    if np.ptp(moves) < _EVEN * moves[0]:
        moves = moves[:1]
    variance = np.mean([noise.spectrum(order * move) for move in moves], axis=0) * theta.size / 2
    return np.asarray(order, dtype=np.float64), np.asarray(lines / variance, dtype=np.float64)


def best_line(data: RunData, fit: SampleFit) -> SampleFit | None:
    """Fit with the most significant line of any order.

    Returns
    -------
    SampleFit or None
        None where no line is significant.
    """
    highest = data.highest_order
    orders: list[float] = []
    cells = 1.0
    for at in data.slices:
        lowest = data.policy.least_cycles * _TURN / float(np.ptp(data.theta[at]))
        noise = noise_of_samples(fit.residual[at], floor=data.floor)
        order, power = line_spectrum(data.theta[at], fit.residual[at], noise, lowest, highest)
        if order.size < 3:
            continue
        cells = max(cells, order.size / 2)
        likely = (power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:]) & (power[1:-1] > chi_square(_LIKELY, 2))
        peaks = np.flatnonzero(likely) + 1
        orders += [_sharpened(data, fit, float(order[i])) for i in peaks[np.argsort(-power[peaks])][:_PEAKS]]
    free = [order for order in _distinct(orders, SAME_ORDER / data.turns) if not _is_taken(data, fit, order)]
    accepted = data.policy.false_alarm / cells
    telling, _ = screened(data, fit, [line_term(data, order) for order in free])
    for one in telling[:_FITTED]:
        trial = fitted(data, [*fit.terms, one.term])
        if _is_line(data, trial, accepted) and held_out_gain(data, fit, trial) > 0:
            return trial
    return None


def beats(data: RunData, line: SampleFit, winner: SampleFit) -> bool:
    """Tell whether a cause only looks telling beside a stronger line, which a short run smears over its neighbours.

    Parameters
    ----------
    data : RunData
    line, winner : SampleFit
        With the line, and with the cause, as their last terms.
    """
    own, cause = line.terms[-1], winner.terms[-1]
    apart = [abs(own.orders[0] - order) * data.turns for order in cause.orders or (0.0,)]
    if min(apart) < 1 or min(apart) > data.policy.smeared:
        return False
    return line.distance(own) > winner.distance(cause) + float(chi_square(data.policy.false_alarm, 1))


def add_lines(data: RunData, fit: SampleFit) -> SampleFit:
    """Put in the lines that remain, the strongest first."""
    for _ in range(MOST_LINES):
        more = best_line(data, fit)
        if more is None:
            return fit
        fit = more
    return fit


def _is_line(data: RunData, trial: SampleFit, accepted: float) -> bool:
    line = trial.terms[-1]
    large = data.quantity != "angle" or np.hypot(*trial.values(line)[:2]) > data.policy.accuracy
    return bool(large and trial.significant(line, accepted))


def _distinct(orders: Sequence[float], apart: float) -> list[float]:
    found: list[float] = []
    for order in orders:
        if all(abs(order - other) > apart for other in found):
            found.append(order)
    return found


def _is_taken(data: RunData, fit: SampleFit, order: float) -> bool:
    """Tell whether the runs are too short to tell an order from one that is in the fit."""
    there = [o for t in fit.terms for o in t.orders if t.kind in (EFFECT, LINE)]
    return any(abs(order - other) < data.policy.taken / data.turns for other in there)


def _sharpened(data: RunData, fit: SampleFit, order: float) -> float:
    """Order of the highest power near one, over all runs."""
    near = order + np.linspace(-0.5, 0.5, 41) / data.turns
    power = np.zeros(near.size)
    for at in data.slices:
        wave, step = (np.exp(-1j * o * data.theta[at]) for o in (near[0], near[1] - near[0]))
        pull = fit.residual[at] * wave
        for i in range(near.size):
            power[i] += abs(pull.sum()) ** 2
            pull *= step
    best = int(np.argmax(power))
    if 0 < best < near.size - 1:
        left, top, right = power[best - 1 : best + 2]
        return float(near[best] + 0.5 * (left - right) / (left - 2 * top + right) * (near[1] - near[0]))
    return order
