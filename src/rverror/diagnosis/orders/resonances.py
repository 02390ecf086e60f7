"""Natural frequencies that several orders show over the speed: docs/theory/resonances.md.

Per order, direction, torque and temperature the waves over the speed are z = c + b r^2/(1 - r^2 + 2 i zeta r), r the
order's frequency over the natural one; all orders share frequency and damping.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy

from rverror.base.arrays import Array
from rverror.base.chance import student
from rverror.base.errors import former_name
from rverror.diagnosis.order_passport import SAME_ORDER, SAME_SETTING, SAME_TEMPERATURE, level_of, rows_of
from rverror.diagnosis.policy import Policy
from rverror.dynamics.at_speed import CRITICAL, NEAR
from rverror.runs.order_table import OrderCase, Waves

_STEP = 0.005  # of the logarithm of the frequency where peaks are looked for
#: Speeds of an order, in one direction at one load: a parabola over the speed has three sizes, and a resonance beside
#: it leaves two complex values to tell noise by.
_LEAST_SPEEDS = 6
_DAMPINGS = np.geomspace(0.005, 0.15, 10)  # there
_REACH = 1.3  # times the frequency, up and down, over which its profile goes
_LIGHTEST, _HEAVIEST = 0.002, 0.3  # dampings over which it goes
_FINE, _ZOOMS = 71, 4  # values of a minimum, and how often they close in
_MISFIT = 0.05  # share of an order's size by which it may depart from one mode
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
        As time goes on, rad: in reverse the output angle falls, so that they are the conjugates of a table's.
    sigma : ndarray, shape (n,)
        Noise of real and imaginary part, rad.
    places : tuple of (int, int)
        Case of the table, and place of the order in it.
    beside : ndarray of complex, shape (n, k)
        What its law has beside the resonance: a constant, and the resonances that were found before.
    static, resonant : complex
        c and b of the law, rad.
    """

    order: float
    direction: float
    torque: float | None
    speed: Array
    frequency: Array
    waves: Waves
    sigma: Array
    places: tuple[tuple[int, int], ...]
    beside: Waves
    static: complex = 0j
    resonant: complex = 0j

    def smooth(self, degree: int) -> Waves:
        """`beside`, and powers of the speed up to a degree."""
        share = self.speed / self.speed.max()
        return np.concatenate([self.beside, *(share[:, None] ** k for k in range(1, degree + 1))], axis=1)


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
    misfit : float
        Share of an order's size by which it departs from one mode.
    series : tuple of ResonantSeries
        Of the orders that show it.
    alone : mapping of float to float
        Frequency by each of these orders alone, with the damping of all, Hz.
    """

    frequency: float
    low: float
    high: float
    damping_ratio: float
    damping_low: float
    damping_high: float
    confidence: float
    misfit: float
    series: tuple[ResonantSeries, ...]
    alone: dict[float, float]

    @property
    def orders(self) -> tuple[float, ...]:
        """Orders that show it, growing."""
        return tuple(self.alone)

    off = former_name("off", "misfit")

    def part(self, series: ResonantSeries, *, shifted: float = 1.0) -> Waves:
        """What it adds to a series, rad, as time goes on; its own frequency times `shifted`."""
        return np.asarray(series.resonant * growth(series.frequency, shifted * self.frequency, self.damping_ratio))


def growth(frequency: Array, natural: float | Array, damping: float | Array) -> Waves:
    """What inertia adds to a wave of the static error: r^2/(1 - r^2 + 2 i zeta r), r = frequency over the natural one.

    Examples
    --------
    >>> complex(growth(np.array(50.0), 50.0, 0.02)), abs(complex(growth(np.array(0.0), 50.0, 0.02)))
    (-25j, 0.0)
    """
    r = frequency / natural
    return np.asarray(r**2 / (1 - r**2 + 2j * damping * r))


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
        The best told first; empty where no order has six speeds or more in one direction at one load.

    Notes
    -----
    docs/theory/resonances.md: claimed against smooth laws, steps, single speeds that are astray, and peaks of several
    orders at one speed.
    """
    series, found = series_of(cases, ratio=ratio, policy=policy), list[Resonance]()
    while (more := _next(series, policy)) is not None:
        found.append(more)
        shown = [own.places for own in more.series]
        series = [_beside(own, more) if own.places in shown else own for own in series]
    return tuple(one for one in found if not any(_at_one_speed(one, other) for other in found if other is not one))


def _beside(series: ResonantSeries, found: Resonance) -> ResonantSeries:
    """The series with a resonance that it shows already in its law."""
    column = growth(series.frequency, found.frequency, found.damping_ratio)
    return replace(series, beside=np.column_stack([series.beside, column]))


def _at_one_speed(one: Resonance, other: Resonance) -> bool:
    """Tell whether two orders peak at the same speed, each at its own frequency: that is no natural frequency."""
    if len(one.orders) > 1 or len(other.orders) > 1:
        return False
    (low, high), (other_low, other_high) = (
        [end / own.orders[0] for end in (own.low, own.high)] for own in (one, other)
    )
    return not (high < other_low or other_high < low)


def series_of(cases: Sequence[OrderCase], *, ratio: float, policy: Policy) -> list[ResonantSeries]:
    """Orders over the speed, of each direction, torque and temperature; those of six speeds or more.

    Parameters
    ----------
    cases : sequence of OrderCase
    ratio : float
    policy : Policy
    """
    rows = rows_of(cases)
    rows, found = rows[rows["speed"] > 0], []
    torque = level_of(rows["torque"], SAME_SETTING * float(np.nanmax(rows["torque"], initial=0.0)))
    order = np.round(rows["order"] / SAME_ORDER) * SAME_ORDER
    keys = np.stack([order, -rows["direction"], torque, level_of(rows["temperature"], SAME_TEMPERATURE)], axis=1)
    for key in np.unique(keys, axis=0):
        own = np.sort(rows[(keys == key).all(axis=1)], order="speed")
        if np.unique(own["speed"]).size < _LEAST_SPEEDS:
            continue
        # the median of a Rayleigh law is its deviation times sqrt(2 ln 2), a difference has twice the variance: most
        # steps from speed to speed are noise alone
        steps = float(np.median(np.abs(np.diff(own["wave"])))) / math.sqrt(4 * math.log(2))
        sigma = own["sigma"] if np.isfinite(own["sigma"]).all() else np.full(own.size, steps)
        found.append(
            ResonantSeries(
                order=float(key[0]),
                direction=-float(key[1]),
                torque=cases[own["case"][0]].condition.torque,
                speed=own["speed"],
                frequency=key[0] * own["speed"] / (2 * math.pi * abs(ratio)),
                waves=own["wave"] if key[1] < 0 else np.conj(own["wave"]),
                sigma=np.hypot(sigma, policy.model_error),
                places=tuple(zip(own["case"].tolist(), own["place"].tolist(), strict=True)),
                beside=np.ones((own.size, 1), complex),
            )
        )
    return found


# --- is there one -----------------------------------------------------------------------------------------------------


def _next(every: Sequence[ResonantSeries], policy: Policy) -> Resonance | None:
    """One natural frequency more beside those found; None where none is told."""
    if not every:
        return None
    ends = [(own.frequency[0], own.frequency[-1]) for own in every]
    axis = np.exp(np.arange(math.log(min(low for low, _ in ends)), math.log(max(high for _, high in ends)), _STEP))
    natural, damping = (grid.ravel() for grid in np.meshgrid(axis, _DAMPINGS, indexing="ij"))
    orders = sorted({own.order for own in every})
    of = np.array([orders.index(own.order) for own in every])
    chances = np.zeros((len(orders), natural.size))
    for at, series in zip(of, every, strict=True):
        inside = (natural > series.frequency[0]) & (natural < series.frequency[-1] * (1 + NEAR))
        chances[at] += np.where(inside, _nested(series, natural, damping, policy), 0.0)
    # a sum of exponentials, one of each series; of all orders, frequencies and dampings the largest
    least = scipy.special.gammainccinv(np.bincount(of), policy.false_alarm / chances.size)
    for _ in range(_TRIES):
        best = int(np.argmax(np.maximum(chances - least[:, None], 0).sum(axis=0)))
        near = np.abs(np.log(natural / natural[best])) < math.log1p(NEAR)
        seen = chances[:, near].max(axis=1) > least  # a peak at a gap may stand beside
        if not seen.any():
            return None
        shown = [own for at, own in zip(of, every, strict=True) if seen[at]]
        about = _likelier(shown, natural[near], damping[near], policy)
        if about is not None:
            joined = [*shown, *(own for own in every if own not in shown and _follows(own, *about, policy))]
            at_one_frequency = _likelier(joined, natural[near], damping[near], policy) is not None
            return one_mode(joined if at_one_frequency else shown, about[0], policy)
        chances[:, np.abs(np.log(natural / natural[best])) < math.log(_REACH) / 2] = 0.0
    return None


def _left(columns: Waves, waves: Waves, more: Waves | None = None) -> Array:
    """Squares that columns leave of waves (n,), or that they and one of the rows `more` (g, n) do, shape (g,)."""
    base = np.linalg.qr(columns)[0]
    rest = waves - base @ (base.conj().T @ waves)
    squares = float(np.vdot(rest, rest).real)
    if more is None:
        return np.array([squares])
    whole, inside = (np.einsum("gn,gn->g", rows, rows.conj()).real for rows in (more, more @ base.conj()))
    own = np.maximum(whole - inside, 1e-12 * whole)  # squares of a row beside the columns
    return np.asarray(np.maximum(squares - np.abs(more @ rest.conj()) ** 2 / own, 0.0))


def _floor(series: ResonantSeries, policy: Policy) -> float:
    """Squares that no law is right to."""
    return float(np.sum((policy.line_share * np.abs(series.waves)) ** 2) + series.speed.size * policy.model_error**2)


def _nested(series: ResonantSeries, natural: Array, damping: Array, policy: Policy) -> Array:
    """Logarithm of the chance, less its sign, that noise about a smooth law falls as much by a resonance beside it.

    Of m complex values to spare one more column leaves a share of the law beta(m, 1): minus m times its logarithm is
    exponential.
    """
    smooth, floor = series.smooth(2), _floor(series, policy)
    spare = max(series.speed.size - smooth.shape[1] - 1, 0)
    rows = growth(series.frequency, natural[:, None], damping[:, None])
    return np.asarray(
        spare * np.log((_left(smooth, series.waves)[0] + floor) / (_left(smooth, series.waves, rows) + floor))
    )


def _follows(series: ResonantSeries, natural: float, damping: float, policy: Policy) -> bool:
    """Tell whether a series follows a natural frequency that others show, and no parabola over the speed as well.

    One that is magnified twice or more, of which a flank may be all that is measured.
    """
    rows = growth(series.frequency, natural, damping)[None]
    with_it = _left(series.beside, series.waves, rows)[0] + _floor(series, policy)
    plain, smooth = (_left(series.smooth(degree), series.waves)[0] + _floor(series, policy) for degree in (0, 2))
    spare = series.speed.size - series.beside.shape[1] - 1
    significant = spare * math.log(plain / with_it) > -math.log(policy.false_alarm)
    return bool(significant and with_it < smooth and magnified(series.frequency, natural, damping).max() >= CRITICAL)


def _likelier(
    chosen: Sequence[ResonantSeries], natural: Array, damping: Array, policy: Policy
) -> tuple[float, float] | None:
    """Frequency and damping of the best resonance of some series, if it is likelier than what has as many sizes.

    That is a parabola over the speed, or a line with a step, or with one speed astray, the same in all series; or
    peaks of several orders at one speed, wherever their frequencies are then.
    """

    def unlikely(own: ResonantSeries, left: Array) -> Array:
        return own.speed.size * np.log(left + _floor(own, policy))

    speeds = np.unique(np.round(np.concatenate([own.speed for own in chosen]), 9))[:, None]
    orders = {own.order for own in chosen}
    resonant, others = np.zeros(natural.size), np.zeros(1 + 2 * speeds.size)
    at_speed = np.zeros((len(orders), natural.size))
    per_hertz = sorted({own.speed[-1] / own.frequency[-1] for own in chosen})[: len(orders)]
    for own in chosen:
        line, rows = own.smooth(1), growth(own.frequency, natural[:, None], damping[:, None])
        resonant += unlikely(own, _left(own.beside, own.waves, rows))
        for row, factor in zip(at_speed, per_hertz, strict=True):
            there = growth(own.speed, factor * natural[:, None], damping[:, None])
            row += unlikely(own, _left(own.beside, own.waves, there))
        steps = [own.speed - speeds > -1e-9, np.abs(own.speed - speeds) < 1e-9]
        rivals = [_left(own.smooth(2), own.waves), *(_left(line, own.waves, kind.astype(complex)) for kind in steps)]
        others += unlikely(own, np.concatenate(rivals))
    best = int(np.argmin(resonant))
    between = any(own.frequency[0] < natural[best] < own.frequency[-1] for own in chosen)  # else it is only one flank
    likelier = resonant[best] < others.min() + math.log(policy.false_alarm)
    if not between or not likelier or (len(orders) > 1 and at_speed.min() < resonant[best]):
        return None
    return float(natural[best]), float(damping[best])


# --- how large, and how well told -------------------------------------------------------------------------------------


def _squares(chosen: Sequence[ResonantSeries], natural: Array | float, damping: Array | float) -> Array:
    """Weighted squares that one mode leaves of some series, over frequencies or dampings."""
    f, d = np.broadcast_arrays(natural, damping)
    total = np.zeros(f.size)
    for own in chosen:
        weight = _weight(own)
        rows = growth(own.frequency, f.reshape(-1, 1), d.reshape(-1, 1)) * weight
        total += _left(own.beside * weight[:, None], own.waves * weight, rows)
    return total


def _weight(series: ResonantSeries) -> Array:
    return np.asarray(1 / np.hypot(series.sigma, _MISFIT * np.abs(series.waves)))


def _minimum(left: Callable[..., Array], *ranges: tuple[float, float]) -> tuple[tuple[float, ...], float]:
    """Values within ranges that leave least, and what they leave."""
    for _ in range(_ZOOMS):
        axes = [np.geomspace(*ends, _FINE) for ends in ranges]
        total = left(*(grid.ravel() for grid in np.meshgrid(*axes, indexing="ij")))
        least = [int(at) for at in np.unravel_index(int(np.argmin(total)), (_FINE,) * len(axes))]
        both = list(zip(axes, least, strict=True))
        ranges = tuple((float(axis[max(at - 1, 0)]), float(axis[min(at + 1, _FINE - 1)])) for axis, at in both)
    return tuple(float(axis[at]) for axis, at in both), float(total.min())


def _ends(left: Callable[[float], float], best: float, most: float, edges: tuple[float, float]) -> list[float]:
    """Where more is left than `most` on both sides of the best value; NaN beyond what is looked at."""
    return [
        float(scipy.optimize.brentq(lambda value: left(value) - most, best, edge, xtol=1e-6 * best))
        if left(edge) > most
        else math.nan
        for edge in edges
    ]


def one_mode(chosen: Sequence[ResonantSeries], near: float, policy: Policy) -> Resonance:
    """One mode fitted to the series that show it.

    Parameters
    ----------
    chosen : sequence of ResonantSeries
    near : float
        Hz, about which its frequency is looked for.
    policy : Policy
    """
    frequencies, dampings = (near / _REACH, near * _REACH), (_LIGHTEST, _HEAVIEST)

    def best(some: Sequence[ResonantSeries]) -> tuple[tuple[float, ...], float]:
        return _minimum(partial(_squares, some), frequencies, dampings)

    (frequency, ratio), least = best(chosen)
    orders = sorted({own.order for own in chosen})
    of_order = {order: [own for own in chosen if own.order == order] for order in orders}
    groups = list(of_order.values()) if len(orders) > 1 else [[own] for own in chosen]
    apart = sum(best(group)[1] for group in groups)
    spare = max(sum(2 * (own.speed.size - own.beside.shape[1] - 1) for own in chosen) - 2 * len(groups), 1)
    scale = apart / spare
    # series that are off one common mode by more than their noise lets them widen the interval (Birge's ratio)
    wider = max(1.0, (least - apart) / scale / (2 * (len(groups) - 1))) if len(groups) > 1 else 1.0
    most = least + student((1 - policy.confidence) / 2, spare) ** 2 * scale * wider
    low, high = _ends(lambda f: _minimum(partial(_squares, chosen, f), dampings)[1], frequency, most, frequencies)
    lighter, heavier = _ends(
        lambda d: _minimum(partial(_squares, chosen, damping=d), frequencies)[1], ratio, most, dampings
    )
    return Resonance(
        frequency=frequency,
        low=low,
        high=high,
        damping_ratio=ratio,
        damping_low=lighter,
        damping_high=heavier,
        confidence=policy.confidence,
        misfit=_MISFIT * math.sqrt(scale),
        series=tuple(_sized(own, frequency, ratio) for own in chosen),
        alone={
            order: _minimum(partial(_squares, own, damping=ratio), frequencies)[0][0] for order, own in of_order.items()
        },
    )


def _sized(series: ResonantSeries, natural: float, damping: float) -> ResonantSeries:
    """The series with the sizes of its law."""
    rows, weight = np.column_stack([series.beside, growth(series.frequency, natural, damping)]), _weight(series)
    sizes = np.linalg.lstsq(rows * weight[:, None], series.waves * weight, rcond=None)[0]
    return replace(series, static=complex(sizes[0]), resonant=complex(sizes[-1]))


# --- what errors are without it ---------------------------------------------------------------------------------------


def resonant_parts(cases: Sequence[OrderCase], found: Sequence[Resonance]) -> tuple[list[Waves], list[Array]]:
    """What natural frequencies add to each number of a table, and how well that is known.

    Parameters
    ----------
    cases : sequence of OrderCase
    found : sequence of Resonance
        Of these cases.

    Returns
    -------
    parts : list of ndarray of complex, shape (k,)
        Of the law, rad.
    deviations : list of ndarray, shape (2 k,)
        What real parts, then imaginary ones may be off by, rad: its own misfit, and what it moves when the frequency
        goes from end to end of its interval.
    """
    parts = [np.zeros(case.orders.size, complex) for case in cases]
    variances = [np.zeros(case.orders.size) for case in cases]
    for one in found:
        ends = [end / one.frequency if math.isfinite(end) else 1.0 for end in (one.low, one.high)]
        for series in one.series:
            here = one.part(series)
            span = np.abs(np.subtract(*(one.part(series, shifted=end) for end in ends))) / 4
            deviation = np.hypot(one.misfit * np.abs(here), span)
            waves = here if series.direction > 0 else np.conj(here)
            for (at, place), wave, sigma in zip(series.places, waves, deviation, strict=True):
                parts[at][place] += wave
                variances[at][place] += sigma**2
    return parts, [np.tile(np.sqrt(variance), 2) for variance in variances]


def without(cases: Sequence[OrderCase], parts: Sequence[Waves]) -> tuple[OrderCase, ...]:
    """The cases less what natural frequencies add."""
    return tuple(replace(case, waves=case.waves - part) for case, part in zip(cases, parts, strict=True))


def slowest(cases: Sequence[OrderCase]) -> list[int]:
    """Numbers of the cases of the least speed among those alike in direction, load and temperature.

    Parameters
    ----------
    cases : sequence of OrderCase
        A case without a speed is kept.

    Returns
    -------
    list of int
    """
    at = [case.condition for case in cases]
    direction, torque, speed, temperature = np.array(
        [(one.direction, one.torque, one.input_speed, one.temperature) for one in at], dtype=np.float64
    ).T
    torques = level_of(torque, SAME_SETTING * float(np.nanmax(torque, initial=0.0)))
    alike = np.stack([direction, torques, level_of(temperature, SAME_TEMPERATURE)], axis=1)
    speed = np.nan_to_num(speed)
    least = np.array([speed[(alike == own).all(axis=1)].min() for own in alike])
    return np.flatnonzero(speed <= least * (1 + SAME_SETTING)).tolist()
