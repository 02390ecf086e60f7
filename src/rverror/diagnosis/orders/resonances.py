"""Natural frequencies that several orders show over the speed: docs/theory/resonances.md.

Per order, direction, torque and temperature the waves over the speed are z = c + b r^2/(1 - r^2 + 2 i zeta r), r the
order's frequency over the natural one; all orders share frequency and damping.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy

from rverror.base.arrays import Array
from rverror.base.chance import student
from rverror.diagnosis.order_passport import SAME_ORDER, SAME_SETTING, SAME_TEMPERATURE, level_of
from rverror.diagnosis.policy import Policy
from rverror.dynamics.at_speed import CRITICAL, NEAR
from rverror.runs.order_table import OrderCase, Waves

_STEP = 0.005  # of the logarithm of the frequency where peaks are looked for
#: Speeds of an order, in one direction at one load: a parabola over the speed has three sizes, and a resonance beside
#: it leaves two complex values to tell noise by.
_LEAST_SPEEDS = 6
_DAMPINGS = np.geomspace(0.005, 0.15, 10)  # there
_FINE = 31  # dampings, and a third of the frequencies, of a profile
_REACH = 1.3  # times the frequency, up and down, over which it goes
_LIGHTEST, _HEAVIEST = 0.002, 0.3  # dampings over which it goes
_ZOOMS = 4  # of a profile
_SHARES = (0.03, 0.1)  # of an order by which one mode may be off: the likelier of these
_TRIES = 6  # peaks that are looked at in a round


@dataclass(frozen=True, kw_only=True, eq=False)
class ResonantSeries:
    """An order over the speed in one direction, at one torque and temperature, and its law.

    Attributes
    ----------
    order : float
        Per output turn.
    direction : float
        +1 forward, -1 reverse.
    torque : float or None
        Size, N*mm; of the first speed.
    speed : ndarray, shape (n,)
        Of the input, rad/s, growing.
    frequency : ndarray, shape (n,)
        Of the order, Hz.
    waves : ndarray of complex, shape (n,)
        As measured, rad, as in a table.
    sigma : ndarray, shape (n,)
        Noise of real and imaginary part, rad.
    places : tuple of (int, int)
        Case of the table, and place of the order in it.
    static, resonant : complex
        c and b of the law, rad, as time goes on: in reverse of the conjugate waves.
    natural, damping : float
        Of the law: Hz, and damping ratio.
    """

    order: float
    direction: float
    torque: float | None
    speed: Array
    frequency: Array
    waves: Waves
    sigma: Array
    places: tuple[tuple[int, int], ...]
    static: complex = 0j
    resonant: complex = 0j
    natural: float = math.inf
    damping: float = 0.0

    @property
    def in_time(self) -> Waves:
        """The waves as time goes on: in reverse the output angle falls, so that they are the conjugate ones."""
        return self.waves if self.direction > 0 else np.conj(self.waves)

    def part(self, at: Array, *, shifted: float = 1.0) -> Waves:
        """The resonant part at frequencies of the order, rad, as in a table; its natural one times `shifted`."""
        wave = self.resonant * growth(at, shifted * self.natural, self.damping)
        return np.asarray(wave if self.direction > 0 else np.conj(wave))


@dataclass(frozen=True, kw_only=True)
class ForetoldPeak:
    """Where an order should peak by what the others say, and where it does.

    Attributes
    ----------
    order : float
    alone : float
        Natural frequency by this order alone, with the damping of all, Hz.
    differs : bool
        Whether that is another than that of all by more than the noise lets it be.
    speed, low, high : float
        Input speed by the other orders with its interval, rad/s; NaN where there is no other.
    highest : float
        Input speed of the largest wave, rad/s.
    below, above : float
        Its neighbours, rad/s: the peak lies between them.
    gap : bool
        Whether the table has a step there that is larger than usual by half or more.
    """

    order: float
    alone: float
    differs: bool
    speed: float
    low: float
    high: float
    highest: float
    below: float
    above: float
    gap: bool


@dataclass(frozen=True, kw_only=True, eq=False)
class Resonance:
    """A natural frequency that orders show over the speed.

    Attributes
    ----------
    frequency, low, high : float
        Undamped, Hz, with its interval; a bound is NaN where the speeds do not tell it.
    damping_ratio, damping_low, damping_high : float
    confidence : float
        Of the intervals.
    off : float
        Share of an order's size by which it departs from one mode.
    series : tuple of ResonantSeries
        Of the orders that show it.
    peaks : tuple of ForetoldPeak
        One of each of these orders.
    """

    frequency: float
    low: float
    high: float
    damping_ratio: float
    damping_low: float
    damping_high: float
    confidence: float
    off: float
    series: tuple[ResonantSeries, ...]
    peaks: tuple[ForetoldPeak, ...]

    @property
    def orders(self) -> tuple[float, ...]:
        """Orders that show it, growing."""
        return tuple(peak.order for peak in self.peaks)


def growth(frequency: Array, natural: float | Array, damping: float | Array) -> Waves:
    """What inertia adds to a wave of the static error: r^2/(1 - r^2 + 2 i zeta r), r = frequency over the natural one.

    Examples
    --------
    >>> complex(growth(np.array(50.0), 50.0, 0.02)), abs(complex(growth(np.array(0.0), 50.0, 0.02)))
    (-25j, 0.0)
    """
    r = frequency / natural
    square, damped = r**2, 2 * damping * r
    left = 1 - square
    size = square / (left**2 + damped**2)  # of real arrays: complex ones take twice the time to divide
    found = np.empty(np.shape(size), np.complex128)
    found.real, found.imag = size * left, -size * damped
    return found


def magnified(frequency: Array, natural: float, damping: float) -> Array:
    """By how much a mode magnifies what drives it: 1/(1 - r^2 + 2 i zeta r) in size."""
    r = frequency / natural
    return np.asarray(1 / np.abs(1 - r**2 + 2j * damping * r))


def resonances_of(cases: Sequence[OrderCase], *, ratio: float, policy: Policy) -> tuple[Resonance, ...]:
    """Natural frequencies that the orders of a table show over the speed.

    Parameters
    ----------
    cases : sequence of OrderCase
    ratio : float
        Input turns per output turn.
    policy : Policy

    Returns
    -------
    tuple of Resonance
        The best told first; empty where no order has `Policy.speeds` or more in one direction at one load.

    Notes
    -----
    docs/theory/resonances.md: claimed against smooth laws, steps, single speeds that are astray, and peaks of several
    orders at one speed.
    """
    all_series = series_of(cases, ratio=ratio, policy=policy)
    found: list[Resonance] = []
    while (more := _next(all_series, found, policy)) is not None:
        found.append(more)
    return tuple(one for one in found if not any(_at_one_speed(one, other) for other in found if other is not one))


def _at_one_speed(one: Resonance, other: Resonance) -> bool:
    """Tell whether two orders peak at the same speed, each at its own frequency: that is no natural frequency."""
    if len(one.peaks) > 1 or len(other.peaks) > 1:
        return False
    (low, high), (other_low, other_high) = (
        [end / own.peaks[0].order for end in (own.low, own.high)] for own in (one, other)
    )
    return not (high < other_low or other_high < low)


def settings_of(cases: Sequence[OrderCase]) -> list[tuple[float, int, int]]:
    """Direction of each case, and the number of its torque and of its temperature among those that differ.

    Parameters
    ----------
    cases : sequence of OrderCase

    Returns
    -------
    list of (float, int, int)
    """

    def known(value: float | None) -> float:
        return math.nan if value is None else value

    conditions = [case.condition for case in cases]
    torque = np.array([known(one.torque) for one in conditions])
    temperature = np.array([known(one.temperature) for one in conditions])
    torques = level_of(torque, SAME_SETTING * float(np.nanmax(torque, initial=0.0)))
    temperatures = level_of(temperature, SAME_TEMPERATURE)
    return list(zip((one.direction for one in conditions), torques, temperatures, strict=True))


def series_of(cases: Sequence[OrderCase], *, ratio: float, policy: Policy) -> tuple[ResonantSeries, ...]:
    """Orders over the speed, of each direction, torque and temperature; those of `Policy.speeds` speeds or more.

    Parameters
    ----------
    cases : sequence of OrderCase
    ratio : float
    policy : Policy
    """
    groups: dict[tuple[float, ...], list[tuple[float, int, int]]] = {}
    for at, (case, (direction, *level)) in enumerate(zip(cases, settings_of(cases), strict=True)):
        for place, order in enumerate(case.orders.tolist() if case.condition.input_speed else ()):
            key = (round(order / SAME_ORDER) * SAME_ORDER, -direction, *level)
            groups.setdefault(key, []).append((case.condition.input_speed or 0.0, at, place))
    found = []
    for (order, way, *_), group in sorted(groups.items()):
        group.sort()
        speed = np.array([one[0] for one in group])
        if np.unique(speed).size < _LEAST_SPEEDS:
            continue
        waves = np.array([cases[at].waves[place] for _, at, place in group])
        stated = [own[place] for _, at, place in group if (own := cases[at].sigma) is not None]
        # of a Rayleigh law, as in the passport: most steps from speed to speed are noise alone
        steps = float(np.median(np.abs(np.diff(waves)))) / math.sqrt(4 * math.log(2))
        sigma = np.array(stated) if len(stated) == len(group) else np.full(len(group), steps)
        found.append(
            ResonantSeries(
                order=order,
                direction=-way,
                torque=cases[group[0][1]].condition.torque,
                speed=speed,
                frequency=order * speed / (2 * math.pi * abs(ratio)),
                waves=waves,
                sigma=np.hypot(sigma, policy.model_error),
                places=tuple((at, place) for _, at, place in group),
            )
        )
    return tuple(found)


# --- is there one -----------------------------------------------------------------------------------------------------


def _next(all_series: Sequence[ResonantSeries], found: Sequence[Resonance], policy: Policy) -> Resonance | None:
    """One natural frequency more beside those found; None where none is told."""
    if not all_series:
        return None
    beside = [_columns(series, found) for series in all_series]
    lowest, highest = (f([f(s.frequency) for s in all_series]) for f in (np.min, np.max))
    axis = np.exp(np.arange(math.log(lowest), math.log(highest), _STEP))
    natural, damping = (grid.ravel() for grid in np.meshgrid(axis, _DAMPINGS, indexing="ij"))
    orders = sorted({series.order for series in all_series})
    of = np.array([orders.index(series.order) for series in all_series])
    chances = np.zeros((len(orders), natural.size))
    for n, (series, own) in enumerate(zip(all_series, beside, strict=True)):
        inside = (natural > series.frequency[0]) & (natural < series.frequency[-1] * (1 + NEAR))
        chances[of[n]] += np.where(inside, _nested(series, own, natural, damping, policy), 0.0)
    count = np.bincount(of, minlength=len(orders))
    least = scipy.special.gammainccinv(count, policy.false_alarm / len(orders))
    for _ in range(_TRIES):
        best = int(np.argmax(np.maximum(chances - least[:, None], 0).sum(axis=0)))
        seen = np.flatnonzero(chances[:, best] > least)
        trials = natural.size * math.comb(len(orders), seen.size)  # frequencies, dampings, and sets of as many orders
        by_chance = scipy.special.gammaincc(count[seen].sum(), chances[seen, best].sum()) * trials
        if not seen.size or by_chance > policy.false_alarm:
            return None
        near = np.abs(np.log(natural / natural[best])) < math.log1p(NEAR)
        beyond = chances[:, near].max(axis=1) - math.log(np.count_nonzero(near))
        seen = np.union1d(seen, np.flatnonzero(beyond > least))  # a peak at a gap may stand beside
        chosen = [n for n in range(len(all_series)) if of[n] in seen]
        shown, columns = [all_series[n] for n in chosen], [beside[n] for n in chosen]
        about = _likelier(shown, columns, natural[near], damping[near], policy)
        if about is not None:
            for n, (series, own) in enumerate(zip(all_series, beside, strict=True)):
                if n not in chosen and _follows(series, own, *about, policy):
                    shown.append(series)
                    columns.append(own)
            return _fitted(shown, columns, about[0], policy)
        chances[:, np.abs(np.log(natural / natural[best])) < math.log(_REACH) / 2] = 0.0
    return None


def _columns(series: ResonantSeries, found: Sequence[Resonance]) -> Waves:
    """What a series has beside: a constant and the natural frequencies that it shows already, shape (n, k)."""
    shown = [one for one in found if any(own.places == series.places for own in one.series)]
    own = [growth(series.frequency, one.frequency, one.damping_ratio) for one in shown]
    return np.stack([np.ones(series.speed.size, complex), *own], axis=1)


def _smooth(series: ResonantSeries, columns: Waves, degree: int) -> Waves:
    share = series.speed / series.speed.max()
    return np.concatenate([columns, *(share[:, None] ** k for k in range(1, degree + 1))], axis=1)


def _left(columns: Waves, waves: Waves, more: Waves | None = None) -> Array:
    """Squares that columns leave of waves (n,), or that they and one of the rows `more` (g, n) do, shape (g,)."""
    base = np.linalg.qr(columns)[0]
    rest = waves - base @ (base.conj().T @ waves)
    squares = float(np.vdot(rest, rest).real)
    if more is None:
        return np.array([squares])
    own = more - (more @ base.conj()) @ base.T
    parts = np.ascontiguousarray(own).view(np.float64)
    size = np.maximum(np.einsum("gn,gn->g", parts, parts), 1e-12 * (more.real**2 + more.imag**2).max(axis=1))
    return np.asarray(np.maximum(squares - np.abs(own @ rest.conj()) ** 2 / size, 0.0))


def _follows(series: ResonantSeries, columns: Waves, natural: float, damping: float, policy: Policy) -> bool:
    """Tell whether a series follows a natural frequency that others show, and no parabola over the speed as well.

    One that is magnified twice or more, of which a flank may be all that is measured.
    """
    floor, rows = _floor(series, policy), growth(series.frequency, natural, damping)[None]
    with_it = _left(columns, series.in_time, rows)[0] + floor
    plain, smooth = (_left(_smooth(series, columns, degree), series.in_time)[0] + floor for degree in (0, 2))
    spare = series.speed.size - columns.shape[1] - 1
    told = spare * math.log(plain / with_it) > -math.log(policy.false_alarm)
    return bool(told and with_it < smooth and magnified(series.frequency, natural, damping).max() >= CRITICAL)


def _floor(series: ResonantSeries, policy: Policy) -> float:
    """Squares that no law is right to."""
    return float(np.sum((policy.line_share * np.abs(series.waves)) ** 2) + series.speed.size * policy.model_error**2)


def _nested(series: ResonantSeries, columns: Waves, natural: Array, damping: Array, policy: Policy) -> Array:
    """Logarithm of the chance, less its sign, that noise about a smooth law falls as much by a resonance beside it.

    Of m complex values to spare one more column leaves a share of the law beta(m, 1): minus m times its logarithm is
    exponential.
    """
    smooth = _smooth(series, columns, 2)
    spare = series.speed.size - smooth.shape[1] - 1
    if spare < 1:
        return np.zeros(natural.size)
    rows = growth(series.frequency, natural[:, None], damping[:, None])
    floor = _floor(series, policy)
    before = _left(smooth, series.in_time)[0] + floor
    gain = spare * np.log(before / (_left(smooth, series.in_time, rows) + floor))
    return np.asarray(gain)


def _likelier(
    chosen: Sequence[ResonantSeries], beside: Sequence[Waves], natural: Array, damping: Array, policy: Policy
) -> tuple[float, float] | None:
    """Frequency and damping of the best resonance of some series, if it is likelier than what has as many sizes.

    That is a parabola over the speed, or a line with a step, or with one speed astray, the same in all series; or
    peaks of several orders at one speed, wherever their frequencies are then.
    """
    speeds = np.unique(np.round(np.concatenate([s.speed for s in chosen]), 9))
    resonant, others = np.zeros(natural.size), np.zeros(1 + 2 * speeds.size)
    orders = {series.order for series in chosen}
    per_hertz = [series.speed[-1] / series.frequency[-1] for series in chosen]
    at_speed = np.zeros((len(orders), natural.size))
    for series, columns in zip(chosen, beside, strict=True):
        count, floor, line = series.speed.size, _floor(series, policy), _smooth(series, columns, 1)
        rows = growth(series.frequency, natural[:, None], damping[:, None])
        resonant += count * np.log(_left(columns, series.in_time, rows) + floor)
        for row, one in zip(at_speed, sorted(set(per_hertz)), strict=True):
            rows = growth(series.speed, (natural * one)[:, None], damping[:, None])
            row += count * np.log(_left(columns, series.in_time, rows) + floor)
        after = series.speed - speeds[:, None] > -1e-9
        astray = np.abs(series.speed - speeds[:, None]) < 1e-9
        rivals = [_left(line, series.in_time, kind.astype(complex)) for kind in (after, astray)]
        others += count * np.log(np.concatenate([_left(_smooth(series, columns, 2), series.in_time), *rivals]) + floor)
    best = int(np.argmin(resonant))
    if not any(series.frequency[0] < natural[best] < series.frequency[-1] for series in chosen):
        return None  # beyond all that was measured: only one flank
    if len(orders) > 1 and at_speed.min() < resonant[best]:
        return None
    if resonant[best] >= others.min() + math.log(policy.false_alarm):
        return None
    return float(natural[best]), float(damping[best])


# --- how large, and how well told -------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class _Weighted:
    """Series with their weights: squares that one mode leaves of them over frequency and damping.

    Attributes
    ----------
    rows : tuple of (ResonantSeries, Waves, ndarray)
        With the columns beside, and weights, shape (n,).
    near : float
        Hz, about which to look.
    """

    rows: tuple[tuple[ResonantSeries, Waves, Array], ...]
    near: float

    def squares(self, natural: Array, damping: Array) -> Array:
        """Of all series, shape (f, d)."""
        f, d = (grid.ravel()[:, None] for grid in np.meshgrid(natural, damping, indexing="ij"))
        total = np.zeros(f.size)
        for series, columns, weight in self.rows:
            own = growth(series.frequency, f, d) * weight
            total += _left(columns * weight[:, None], series.in_time * weight, own)
        return total.reshape(natural.size, damping.size)

    def only(self, which: Sequence[int]) -> _Weighted:
        """Of some of the series."""
        return replace(self, rows=tuple(self.rows[n] for n in which))

    @property
    def _axes(self) -> tuple[Array, Array]:
        f = np.geomspace(self.near / _REACH, self.near * _REACH, 3 * _FINE)
        return f, np.geomspace(_LIGHTEST, _HEAVIEST, _FINE)

    @cached_property
    def best(self) -> tuple[float, float, float]:
        """Frequency and damping that leave least, and what they leave."""
        axes = self._axes
        for _ in range(_ZOOMS):
            total = self.squares(*axes)
            f, d = map(int, np.unravel_index(int(np.argmin(total)), total.shape))
            least = (float(axes[0][f]), float(axes[1][d]), float(total[f, d]))
            axes = (_between(axes[0], f - 1, f + 1), _between(axes[1], d - 1, d + 1))
        return least

    def placed(self, damping: float) -> float:
        """Frequency that leaves least with a damping."""
        natural = self._axes[0]
        for _ in range(_ZOOMS):
            at = int(np.argmin(self.squares(natural, np.array([damping]))))
            best, natural = float(natural[at]), _between(natural, at - 1, at + 1)
        return best

    def within(self, most: float) -> tuple[tuple[float, float], tuple[float, float]]:
        """Ends of frequency and of damping within which no more is left; NaN beyond what is looked at."""
        edges, axes = self._axes, self._axes
        ends = ((math.nan, math.nan),) * 2
        for _ in range(_ZOOMS):
            total = self.squares(*axes)
            level = max(most, float(total.min()))
            f_ends, f_cells = _crossed(axes[0], total.min(axis=1), level)
            d_ends, d_cells = _crossed(axes[1], total.min(axis=0), level)
            ends = (
                _told(f_ends, axes[0], edges[0]),
                _told(d_ends, axes[1], edges[1]),
            )
            axes = (_between(axes[0], *f_cells), _between(axes[1], *d_cells))
        return ends


def _between(values: Array, first: int, last: int) -> Array:
    """As many values between two of them, as far as there are such."""
    return np.geomspace(values[max(first, 0)], values[min(last, values.size - 1)], values.size)


def _crossed(values: Array, left: Array, level: float) -> tuple[tuple[float, float], tuple[int, int]]:
    """Where squares cross a level on both sides, and the cells about that."""
    inside = np.flatnonzero(left <= level)
    cells = (int(inside[0]) - 1, int(inside[-1]) + 1)
    ends = [
        float(np.interp(level, left[[at, out]], values[[at, out]])) if 0 <= out < values.size else float(values[at])
        for at, out in zip(inside[[0, -1]].tolist(), cells, strict=True)
    ]
    return (ends[0], ends[1]), cells


def _told(ends: tuple[float, float], values: Array, edges: Array) -> tuple[float, float]:
    """Ends that are not those of what is looked at."""
    return (
        math.nan if ends[0] <= edges[0] * (1 + 1e-9) else ends[0],
        math.nan if ends[1] >= edges[-1] * (1 - 1e-9) else ends[1],
    )


def _fitted(chosen: Sequence[ResonantSeries], beside: Sequence[Waves], near: float, policy: Policy) -> Resonance:
    """One mode fitted to the series that show it."""
    numbers = 2 * sum(series.speed.size for series in chosen)

    def weighted(share: float) -> _Weighted:
        weights = [1 / np.hypot(series.sigma, share * np.abs(series.waves)) for series in chosen]
        return _Weighted(tuple(zip(chosen, beside, weights, strict=True)), near)

    def unlikely(share: float) -> float:
        trial = weighted(share)
        return numbers * math.log(trial.best[2]) - 4 * sum(float(np.log(w).sum()) for _, _, w in trial.rows)

    share = min(_SHARES, key=unlikely)
    every = weighted(share)
    frequency, ratio, least = every.best
    groups = _groups(chosen)
    apart = sum(every.only(group).best[2] for group in groups)
    spare = numbers - 2 * sum(columns.shape[1] + 1 for columns in beside) - 2 * len(groups)
    scale = apart / max(spare, 1)
    # orders that are off one common mode by more than their noise lets them widen the interval (Birge's ratio)
    wider = max(1.0, (least - apart) / scale / (2 * (len(groups) - 1))) if len(groups) > 1 else 1.0
    more = student((1 - policy.confidence) / 2, max(spare, 1)) ** 2 * scale * wider
    (low, high), (lighter, heavier) = every.within(least + more)
    peaks, sized = [], []
    for order in sorted({series.order for series in chosen}):
        own = every.only([n for n, series in enumerate(chosen) if series.order == order])
        others = every.only([n for n, series in enumerate(chosen) if series.order != order])
        told = (others.best[0], *others.within(others.best[2] + more)[0]) if others.rows else (math.nan,) * 3
        alone = own.placed(ratio)
        there, here = own.squares(np.array([frequency, alone]), np.array([ratio]))[:, 0]
        differs = bool(there - here > student(policy.false_alarm / 2, max(spare, 1)) ** 2 * scale)
        peaks.append(_peak([series for series, *_ in own.rows], alone, told, differs=differs))
        # an order that disagrees has its own law, so that what it adds is taken off where it peaks
        sized += [_sized(*row, alone if differs else frequency, ratio) for row in own.rows]
    return Resonance(
        frequency=frequency,
        low=low,
        high=high,
        damping_ratio=ratio,
        damping_low=lighter,
        damping_high=heavier,
        confidence=policy.confidence,
        off=share * math.sqrt(scale),
        series=tuple(sized),
        peaks=tuple(peaks),
    )


def _groups(chosen: Sequence[ResonantSeries]) -> list[list[int]]:
    """Series that may differ from one another: those of an order, or of one order each alone."""
    orders = sorted({series.order for series in chosen})
    if len(orders) == 1:
        return [[n] for n in range(len(chosen))]
    return [[n for n, series in enumerate(chosen) if series.order == order] for order in orders]


def _sized(series: ResonantSeries, columns: Waves, weight: Array, natural: float, damping: float) -> ResonantSeries:
    """The series with the sizes of its law."""
    rows = np.concatenate([columns, growth(series.frequency, natural, damping)[:, None]], axis=1)
    sizes = np.linalg.lstsq(rows * weight[:, None], series.in_time * weight, rcond=None)[0]
    return replace(series, static=complex(sizes[0]), resonant=complex(sizes[-1]), natural=natural, damping=damping)


def _peak(own: Sequence[ResonantSeries], alone: float, told: Sequence[float], *, differs: bool) -> ForetoldPeak:
    """Where an order is largest over the speed, of all its series."""
    strongest = max(own, key=lambda series: float(np.abs(series.waves).max()))
    speed = np.unique(strongest.speed)
    top = int(np.searchsorted(speed, strongest.speed[int(np.argmax(np.abs(strongest.waves)))]))
    per_hertz = float(strongest.speed[-1] / strongest.frequency[-1])
    below, above = (float(speed[min(max(top + step, 0), speed.size - 1)]) for step in (-1, 1))
    usual = float(np.median(np.diff(speed)))
    return ForetoldPeak(
        order=strongest.order,
        alone=alone,
        differs=differs,
        speed=told[0] * per_hertz,
        low=told[1] * per_hertz,
        high=told[2] * per_hertz,
        highest=float(speed[top]),
        below=below,
        above=above,
        gap=bool(max(above - speed[top], speed[top] - below) > 1.5 * usual),
    )


# --- what errors are without it ---------------------------------------------------------------------------------------


def resonant_parts(cases: Sequence[OrderCase], found: Sequence[Resonance]) -> tuple[list[Array], list[Array]]:
    """What natural frequencies add to each number of a table, and how well that is known.

    Parameters
    ----------
    cases : sequence of OrderCase
    found : sequence of Resonance
        Of these cases.

    Returns
    -------
    parts, deviations : list of ndarray, each of shape (2 k,)
        Real parts, then imaginary ones, rad: of the law, and what it may be off by: its own misfit, and what it moves
        when the frequency goes from end to end of its interval.
    """
    parts = [np.zeros(2 * case.orders.size) for case in cases]
    variances = [np.zeros(2 * case.orders.size) for case in cases]
    for one in found:
        ends = [end / one.frequency if math.isfinite(end) else 1.0 for end in (one.low, one.high)]
        for series in one.series:
            here = series.part(series.frequency)
            span = np.abs(np.subtract(*(series.part(series.frequency, shifted=end) for end in ends))) / 4
            deviation = np.hypot(one.off * np.abs(here), span)
            for (at, place), wave, off in zip(series.places, here.tolist(), deviation.tolist(), strict=True):
                count = cases[at].orders.size
                for number, value in ((place, wave.real), (place + count, wave.imag)):
                    parts[at][number] += value
                    variances[at][number] += off**2
    return parts, [np.sqrt(variance) for variance in variances]


def without(cases: Sequence[OrderCase], parts: Sequence[Array]) -> tuple[OrderCase, ...]:
    """The cases less what natural frequencies add."""
    counts = [case.orders.size for case in cases]
    return tuple(
        replace(case, waves=case.waves - part[:k] - 1j * part[k:])
        for case, part, k in zip(cases, parts, counts, strict=True)
    )
