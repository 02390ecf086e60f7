"""Lines of any order in what is left of the runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from rverror.base.arrays import Array
from rverror.base.chance import chi_square
from rverror.base.threads import each
from rverror.diagnosis.gears.fit import Fit
from rverror.diagnosis.gears.record import Record
from rverror.diagnosis.noise import walking
from rverror.diagnosis.policy import Policy
from rverror.runs.noise import RunNoise
from rverror.runs.spectrum import highest_order

#: Cycles a run by which a fitted order may miss a whole one and be told as that, and how many lines are told.
TOLD_ORDER, MOST_LINES = 0.05, 12
_MOST_PEAKS = 24  # that are looked at closer
_TURN = 2 * np.pi
_SLOW = 1.0  # order of a turn: no part of a reducer makes a slower wave, and readings that wander do
_EVEN = 1e-6  # of a step: samples nearer to even ones are taken as such
_OWN, _MOST_OWN = 0.3, 4  # orders of an effect: share of its strongest, and how many are listed


@dataclass(frozen=True)
class LineFound:
    """A line of the residual.

    Attributes
    ----------
    order : float
    power : float
        Squared distance from nothing in standard deviations, of all runs.
    waves : tuple of complex
        cos - i sin of each run, rad.
    """

    order: float
    power: float
    waves: tuple[complex, ...]


def leading(orders: Array, sizes: Array, strongest: float) -> tuple[float, ...]:
    """Orders of a wave that are its own, the strongest first: four at most, of a share of the strongest or more."""
    strong = np.flatnonzero(sizes > _OWN * strongest)
    return tuple(float(orders[n]) for n in strong[np.argsort(-sizes[strong])][:_MOST_OWN])


def best_lines(fit: Fit, policy: Policy, *, outside: bool, most: int = 1) -> list[LineFound]:
    """Significant lines of the residual, the strongest first; each is taken out before the next is looked for.

    Parameters
    ----------
    fit : Fit
    policy : Policy
    outside : bool
        Only orders that no part of the reducer has.
    most : int
    """
    records, rests = list(fit.run_set.records), fit.residual
    turns, found = max(r.turns for r in fit.run_set.records), list[LineFound]()
    # nearer than one wave more or less over the travel a line is the part's, with a swell
    apart = max(policy.order_tolerance, 1 / turns)
    bent = policy.line_share * max(float(np.std(part)) for part in fit.added_parts)
    is_framed = partial(fit.run_set.framed, apart=apart)
    for _ in range(_MOST_PEAKS):
        line = _strongest(records, rests, policy, is_framed if outside else None, _SLOW * (not fit.run_set.linear))
        if line is None or len(found) == most:
            break
        records = [replace(r, orders=(*r.orders, line.order)) for r in records]
        framed, least = is_framed(line.order), policy.least_line
        if framed:
            least = max(least, policy.line_share * _predicted(records, rests, line.order), bent)
        if np.mean(np.abs(line.waves)) > least and not (framed and outside):
            found.append(line)
    return found


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
    slowest = np.pi / theta.size  # half a cycle a run: of a walk that is slower nothing is left beside an offset
    variance = np.mean([noise.spectrum(np.maximum(order * move, slowest)) for move in moves], axis=0) * theta.size / 2
    return np.asarray(order, dtype=np.float64), np.asarray(lines / variance, dtype=np.float64)


def _strongest(
    records: Sequence[Record], rests: Sequence[Array], policy: Policy, uncalled_for: Callable[[float], bool] | None,
    slow: float,
) -> LineFound | None:  # fmt: skip
    """The strongest significant line of any order, if there is one; none where all are of orders not called for.

    One below the order `slow` stands against the random walk that is likeliest in the runs.
    """
    turns = max(r.turns for r in records)
    highest = highest_order([r.theta for r in records])
    lowest = policy.least_cycles / turns

    def seen(both: tuple[Record, Array]) -> tuple[Array, Array]:
        record, rest = both
        clean = np.where(record.kept, record.without_nuisance(rest), 0.0)
        return line_spectrum(record.theta, clean, record.whiten.noise, lowest, highest)

    (orders, total), *others = each(seen, list(zip(records, rests, strict=True)))
    for order, power in others:
        total = total + np.interp(orders, order, power)
    if orders.size < 3:
        return None
    cells = orders.size / 2
    limit = chi_square(policy.false_alarm / cells, 2 * len(records))
    peak = np.flatnonzero((total[1:-1] >= total[:-2]) & (total[1:-1] > total[2:]) & (total[1:-1] > 0.8 * limit)) + 1
    if uncalled_for is not None and all(map(uncalled_for, orders[peak])):
        return None
    for at in peak[np.argsort(-total[peak])][:40]:
        if any(abs(orders[at] - o) < policy.taken / turns for r in records for o in r.orders):
            continue
        line = _sharpened(records, rests, float(orders[at]), turns)
        if line.power > limit and (line.order > slow or _beside_a_walk(records, rests, line.order) > limit):
            return line
    return None


def _beside_a_walk(records: Sequence[Record], rests: Sequence[Array], order: float) -> float:
    """Power of one line where the random walk that is likeliest in each run adds to the noise at its order."""
    total = 0.0
    for record, rest in zip(records, rests, strict=True):
        wanders = walking(record.whiten.noise, record.without_nuisance(rest), record.kept)
        move = float(np.ptp(record.theta)) / (record.theta.size - 1)
        total += line_at([record], [rest], order).power / (1 + float(wanders.excess(np.array([order * move]))[0]))
    return total


def _sharpened(records: Sequence[Record], rests: Sequence[Array], order: float, turns: float) -> LineFound:
    """Order of the highest power near one, over all runs."""
    near = order + np.linspace(-0.4, 0.4, 9) / turns
    powers = [line_at(records, rests, float(at)).power for at in near]
    best = int(np.argmax(powers))
    top = near[best]
    if 0 < best < near.size - 1:
        left, middle, right = powers[best - 1 : best + 2]
        top = near[best] + 0.5 * (left - right) / (left - 2 * middle + right) * (near[1] - near[0])
    return line_at(records, rests, float(top))


def line_at(records: Sequence[Record], rests: Sequence[Array], order: float) -> LineFound:
    """The line of an order by its own fit in each whitened run."""
    rows = [np.stack([np.cos(order * record.theta), np.sin(order * record.theta)]) for record in records]
    power, sizes = explained(records, rests, rows)
    return LineFound(order, power, tuple(complex(size[0], -size[1]) for size in sizes))


def explained(records: Sequence[Record], rests: Sequence[Array], rows: Sequence[Array]) -> tuple[float, list[Array]]:
    """Squares that rows of each run take off its whitened residual, and their sizes."""
    total, sizes = 0.0, []
    for record, rest, own in zip(records, rests, rows, strict=True):
        white = record.whiten(np.concatenate([rest[None], own]))
        squares, size = taken_off(white[0], white[1:])
        total += squares
        sizes.append(size)
    return total, sizes


def taken_off(rest: Array, rows: Array) -> tuple[float, Array]:
    """Squares that whitened rows take off a residual, and their sizes."""
    scale = np.maximum(np.linalg.norm(rows, axis=1), 1e-300)
    unit = rows / scale[:, None]
    moment = unit @ rest
    size = np.linalg.pinv(unit @ unit.T, rcond=1e-12, hermitian=True) @ moment
    return float(size @ moment), size / scale


def _predicted(records: Sequence[Record], rests: Sequence[Array], order: float) -> float:
    """Amplitude of the prediction about an order, mean of all runs, rad."""
    sizes = []
    for record, rest in zip(records, rests, strict=True):
        near = order + np.linspace(-1, 1, 5) / record.turns
        wave = (record.error - rest)[record.kept]
        wave = (wave - wave.mean()) * np.exp(-1j * np.outer(near, record.theta[record.kept]))
        sizes.append(2 * float(np.abs(wave.mean(axis=1)).max()))
    return float(np.mean(sizes))
