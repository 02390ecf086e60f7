"""What repeats in a run: orders that stand out of the noise and predict stretches that were left out."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from rverror.base.arrays import Array, Flags, Integers
from rverror.base.chance import student
from rverror.base.errors import refusing
from rverror.base.numbers import way
from rverror.base.units import ARCSEC
from rverror.compensation.correction import waves_at
from rverror.geartrain.kinematics import OperatingConditions, folded_order, fundamental_orders
from rverror.geartrain.mechanism import Mechanism, Reducer
from rverror.model.effects import Model
from rverror.runs.faults import find_faults
from rverror.runs.measurement import Run
from rverror.runs.order_table import OrderCase, TableCondition, Waves

_TURN = 2 * math.pi
#: White noise that every reading has, and an amplitude below which no table needs an order: what is calculated has no
#: noise that would set a bound.
_FLOOR = 0.001 * ARCSEC
#: Chance that any order of a run stands out where all is noise.
CHANCE = 0.01
#: Stretches into which a run is cut that holds no two turns and passes no angle thrice.
_STRETCHES = 6
_PIECES = 60  # of a turn, every sixth of which is left out together
#: Passes over the same angles in one direction from which on slow things are regular too.
_PASSES = 3
#: Degree of what is slow and left out of account over turns: a drift that settles; and over less than a turn at most,
#: where the slowest order leaves room for it: of a wave of order 1 it leaves 1.4e-4.
_DRIFT = 3
_SLOW = 9
#: Half the orders beside one by whose median the noise is told, and degrees of freedom for each of them: the median of
#: exponential variables is as good as 0.48 of as many.
_BESIDE = 25
_FEWEST_BESIDE = 6
_WORTH = 0.96
_SAMPLED = 0.95  # of the Nyquist order
_APART = 0.25  # of a wave over a travel that is passed again and again
_LEAST_CYCLES = 2.0  # of a wave over a travel of less than a turn
_MULTIPLES = 30
_FEW_MULTIPLES = 8  # where every one is tried
_EXTENSION = 4  # slow waves over a travel that is passed again and again
_ROUNDS = 4
_NOISE_AMONG = 0.05  # share of the orders that are taken which may be expected to be noise
_RIDGE = 1e-12  # slow waves over a part of a turn are all but one another
_LEAKS = 0.1  # of the strongest order of a round: below, it may be spilled by it
_MESHES = 3  # multiples of a mesh order that fold


@dataclass(frozen=True, eq=False)
class DirectedRun:
    """One run, or all passes of one run in one direction.

    Attributes
    ----------
    name : str
    condition : TableCondition
    theta, measured : ndarray, shape (n,)
        Nominal output angle and transmission error less what no table can take, rad.
    error : ndarray, shape (n,)
        Transmission error less all that the model predicts, rad.
    block : ndarray of int, shape (n,)
        Stretch of samples that is left out together.
    turns : float
        Output turns between the smallest and the largest angle.
    passed : bool
        Whether the same angles are passed several times.
    candidates : ndarray, shape (m,)
        Orders that may repeat, growing.
    folded : tuple of float
        Orders onto which a mesh folds: they are left out.
    """

    name: str
    condition: TableCondition
    theta: Array
    measured: Array
    error: Array
    block: Integers
    turns: float
    passed: bool
    candidates: Array
    folded: tuple[float, ...]

    @property
    def whole(self) -> bool:
        """Whether it holds a whole turn, so that every whole order is one of its own."""
        return self.turns >= 1 - 1e-9

    def slow(self) -> Array:
        """What has any size in it, shape (n, k): the offset, and a drift or bow where angle and time go together."""
        if self.turns >= 2 - 1e-9:
            degree = _DRIFT
        elif self.whole or self.passed:
            degree = 0
        else:
            slowest = float(self.candidates[0]) if self.candidates.size else 1.0
            degree = min(int(slowest * self.turns), _SLOW)
        middle, half = (self.theta.max() + self.theta.min()) / 2, max(float(np.ptp(self.theta)) / 2, 1e-300)
        return np.asarray(np.polynomial.legendre.legvander((self.theta - middle) / half, degree))


@dataclass(frozen=True, eq=False)
class RepeatingOrders:
    """Orders of a record that survive, and how well they predict what was left out.

    Attributes
    ----------
    record : DirectedRun
    orders : ndarray, shape (k,)
    waves : ndarray of complex, shape (k,)
        rad.
    gains : ndarray, shape (blocks, k)
        What each takes off the mean squared error of each stretch left out, rad^2.
    before, after : ndarray, shape (blocks,)
        Mean squared error of each stretch as measured and with what the others predict, rad^2.
    left : ndarray, shape (n,)
        Residual of every sample with waves from the other stretches, rad.
    """

    record: DirectedRun
    orders: Array
    waves: Waves
    gains: Array
    before: Array
    after: Array
    left: Array

    def lines(self, order: float) -> list[float]:
        """Amplitude of an order in the residual of each stretch, noise included, rad."""
        turning = self.left * np.exp(-1j * order * self.record.theta)
        return [2 * abs(turning[own].mean()) for n in np.unique(self.record.block) for own in [self.record.block == n]]


#: What a model makes of the error under conditions, and what of that no table can take, rad.
PredictsWaves = Callable[[OperatingConditions, TableCondition], tuple[Array, Array]]


def records_of(run: Run, model: Model, predicts: PredictsWaves, notes: list[str]) -> list[DirectedRun]:
    """One for each direction of a run.

    Parameters
    ----------
    run : Run
    model : Model
    predicts : callable
        What a model makes of the error, and what of that no table can take, rad.
    notes : list of str
        What was set aside is added.

    Raises
    ------
    InputError
        If the run holds no error, or more of it is wrong than can be left out.
    """
    name = run.path or "the run"
    theta, error = run.nominal_angle(model), run.error(model)
    run.check_effects(model, name)
    step = float(np.ptp(theta)) / max(np.unique(theta).size - 1, 1)
    turns = (float(np.ptp(theta)) + step) / _TURN
    senses, found = np.unique(run.direction).tolist(), []
    for sense in senses:
        passes = _passes(run.direction, sense)
        longest = max(float(np.ptp(theta[part])) for part in passes)
        passes = [part for part in passes if np.ptp(theta[part]) > 0.5 * longest]
        at = np.concatenate([np.arange(part.start, part.stop) for part in passes])
        label = np.repeat(np.arange(len(passes)), [part.stop - part.start for part in passes])
        if len(passes) == 1:
            with refusing(f"{name}: "):
                faults = find_faults(theta[at], error[at])
            notes += [f"{name}: {note}" for note in faults.notes()]
            at, label = at[faults.kept], label[faults.kept]
            if 1 - 1e-9 <= turns < 2 - 1e-9:
                notes.append(f"{name}: less than two turns, so that nothing shows the next one to be alike")
        condition = condition_of(run, model, sense)
        time = None if run.time is None else run.time[at]
        where = replace(run.conditions(model), theta=theta[at], direction=sense, time=time)
        every, untouched = predicts(where, condition)
        block, passed = _blocks(theta[at], label, turns), turns >= 2 or len(passes) >= _PASSES
        candidates, folded = _candidates(model.mechanism, theta[at], turns, len(np.unique(block)) if passed else 1)
        found.append(
            DirectedRun(
                name=f"{name}, {way(sense)}" if len(senses) > 1 else name,
                condition=condition,
                theta=theta[at],
                measured=error[at] - untouched,
                error=error[at] - every,
                block=block,
                turns=turns,
                passed=passed,
                candidates=candidates,
                folded=folded,
            )
        )
    return found


def condition_of(run: Run, model: Model, sense: float) -> TableCondition:
    """Under what a run was measured in one direction; its speed where it has time and turns once that way."""
    speed, own = None, _passes(run.direction, sense)
    if run.time is not None and len(own) == 1:
        way, lasted = (float(np.ptp(row[own[0]])) for row in (run.nominal_angle(model), run.time))
        # that of two runs differs in its digits
        speed = float(f"{abs(model.mechanism.ratio) * way / lasted:.2g}") if lasted else None
    return TableCondition(direction=sense, torque=run.torque, input_speed=speed, temperature=run.temperature)


def _passes(direction: Array, sense: float) -> list[slice]:
    """Stretches in which a run goes one way."""
    ends = [0, *(np.flatnonzero(np.diff(direction)) + 1).tolist(), direction.size]
    return [slice(first, last) for first, last in pairwise(ends) if direction[first] == sense]


def _blocks(theta: Array, label: Integers, turns: float) -> Integers:
    """Turns; else passes; else even stretches of the travel, of a turn many short ones by turns.

    Over a turn without a sixth of it orders that are neighbours could not be told apart.
    """
    ahead = theta - theta.min()
    if turns >= 2 - 1e-9:
        return np.asarray(np.minimum(ahead // _TURN, math.floor(turns + 1e-6) - 1), dtype=np.intp)
    if label[-1] + 1 >= _PASSES:
        return label
    pieces = _PIECES if turns >= 1 - 1e-9 else _STRETCHES
    share = ahead / (float(np.ptp(theta)) * (1 + 1e-9))
    return np.asarray(np.floor(share * pieces) % _STRETCHES, dtype=np.intp)


def _candidates(mechanism: Mechanism, theta: Array, turns: float, passes: int) -> tuple[Array, tuple[float, ...]]:
    """Orders that may repeat, growing, and the folded ones that are left out.

    Whole orders where the run holds a turn, and multiples of what turns in the mechanism; over a part of a turn the
    latter alone, and slow waves where it is passed several times.
    """
    samples = np.unique(np.round(theta, 9)).size / turns
    whole = turns >= 1 - 1e-9
    highest = _SAMPLED * samples / (1 if whole else passes) / 2
    bases, meshes = [abs(mechanism.ratio)], list[float]()
    if isinstance(mechanism, Reducer):
        turning = fundamental_orders(mechanism)
        bases += [turning[name] for name in ("housing", "crank", "sun")]
        meshes = [turning["gear mesh"], turning["cycloid mesh"]]
    else:
        bases += [abs(order) for order in mechanism.shafts.values()]
    if whole or passes == 1:
        least = 0.0 if whole else _LEAST_CYCLES / turns
        listed = [float(k) for k in range(1, int(highest) + 1)] if whole else []
        more = sorted({base * m for base in bases for m in range(1, _MULTIPLES + 1) if least <= base * m})
        apart = 0.5
    else:
        listed = sorted({base * m for base in bases for m in range(1, _FEW_MULTIPLES + 1)})
        more = [j / (2 * turns) for j in range(1, _EXTENSION + 1)]
        apart = _APART  # two waves that go together over the travel would cancel each other, each of any size
    for order in more:
        if all(abs(order - other) * turns > apart for other in listed):
            listed.append(order)
    folded = tuple(
        folded_order(mesh * m, samples) for mesh in meshes for m in range(1, _MESHES + 1) if mesh * m > samples / 2
    )
    kept = [k for k in listed if k <= highest and all(abs(k - image) > 0.5 for image in folded)]
    return np.array(sorted(kept)), folded


def repeating_orders(record: DirectedRun) -> RepeatingOrders:
    """Orders of a record that stand out of the noise and predict stretches that were left out.

    Parameters
    ----------
    record : DirectedRun

    Returns
    -------
    RepeatingOrders
    """
    # over a part of a turn all that repeats is a line spectrum of its own, and no order between shows the noise
    by_passes = record.passed and not record.whole
    orders = record.candidates if by_passes or not record.candidates.size else _standing_out(record)
    while True:
        found = at_orders(record, orders)
        good = _gains(found.gains, 1.0 if by_passes else 0.0) & (np.abs(found.waves) > _FLOOR)
        if good.all():
            break
        orders = orders[good]
    if by_passes and orders.size:
        beyond_chance = student(CHANCE / record.candidates.size, found.before.size - 1)
        if not _gains(found.before - found.after, beyond_chance):
            return at_orders(record, orders[:0])
    return found


def _gains(each: Array, errors: float) -> Flags:
    """Whether the mean over the stretches is more than so many of its standard errors."""
    return np.asarray(each.mean(axis=0) > errors * each.std(axis=0, ddof=1) / math.sqrt(len(each)))


def _standing_out(record: DirectedRun) -> Array:
    """Orders that stand out of the noise, once one does beyond chance; each round beside those before.

    So many are taken that at most one of twenty is expected to be noise (Benjamini and Hochberg).
    """
    chosen, candidates = np.zeros(0), record.candidates
    ranks = np.arange(1, candidates.size + 1)
    for _ in range(_ROUNDS):
        found = at_orders(record, chosen)
        power, noise, freedom = _power(record, found.left)
        taken = np.isin(candidates, chosen)
        power[taken] = np.abs(found.waves) ** 2
        # of noise as much power has the chance exp(-rarity): an F of 2 and so many degrees of freedom
        rarity = freedom / 2 * np.log1p(2 * power / noise / freedom)
        if not chosen.size and rarity.max() < math.log(candidates.size / CHANCE):
            break
        falling = np.sort(rarity)[::-1]
        rare = falling[falling > np.log(candidates.size / (_NOISE_AMONG * ranks))]
        loud = ~taken & (rarity >= rare.min(initial=math.inf)) & (power > _FLOOR**2)
        if not loud.any():
            break
        if not record.whole:  # over a part of a turn the strong spill over the weak, and neighbours are one line
            loud &= power > _LEAKS * power[loud].max()
            for n in np.flatnonzero(loud).tolist():
                near = (np.abs(candidates - candidates[n]) * record.turns < 1) & ~taken
                loud[n] = power[n] >= power[near].max()
        chosen = np.union1d(chosen, candidates[loud])
    return chosen


def _power(record: DirectedRun, left: Array) -> tuple[Array, Array, Array]:
    """Squared amplitude of the candidates, what noise alone has there, and degrees of freedom of the latter."""
    theta, orders = record.theta, record.candidates
    turns = math.floor(record.turns + 1e-6) or record.turns
    rank, count = np.argsort(theta, kind="stable"), round(theta.size * turns / record.turns)
    even = np.interp(theta.min() + turns * _TURN * np.arange(count) / count, theta[rank], left[rank])
    lines = np.abs(2 * np.fft.rfft(even)[1 : (count + 1) // 2] / count) ** 2
    every = np.arange(1, lines.size + 1) / turns
    # of more turns than one those between whole orders
    between = (np.abs(every - np.round(every)) * turns > 0.5) | (turns <= 1)
    beside, where = lines[between], every[between]
    at = np.rint(orders * turns).astype(np.intp)
    on_line = np.abs(orders * turns - at) < 1e-6
    power = np.empty(orders.size)
    power[on_line] = lines[at[on_line] - 1]
    power[~on_line] = [
        abs(2 / theta.size * complex(left @ np.exp(-1j * k * theta))) ** 2 for k in orders[~on_line].tolist()
    ]
    # the power of noise has an exponential law, whose mean is the median over log 2
    noise, freedom = np.empty(orders.size), np.empty(orders.size)
    for n, middle in enumerate(np.searchsorted(where, orders).tolist()):
        # a narrower span at low orders keeps the noise's colour; over a part of a turn strong orders spill into it
        half = min(max(middle // 4, _FEWEST_BESIDE), _BESIDE) if record.whole else _BESIDE
        near = beside[max(middle - half, 0) : middle + half]
        noise[n] = max(float(np.median(near)) / math.log(2), 4 * _FLOOR**2 / theta.size)
        freedom[n] = max(_WORTH * near.size, 2.0)
    return power, noise, freedom


def at_orders(record: DirectedRun, orders: Array) -> RepeatingOrders:
    """Waves of given orders, and what those of all stretches but one predict of that one, for each.

    Parameters
    ----------
    record : DirectedRun
    orders : ndarray, shape (k,)

    Returns
    -------
    RepeatingOrders
    """
    phase = record.theta[:, None] * orders
    wave = np.hstack([np.cos(phase), np.sin(phase)])
    base = np.hstack([record.slow(), wave])
    slow = base.shape[1] - wave.shape[1]
    labels = np.unique(record.block)
    whole = base.T @ base
    whole += _RIDGE * np.diag(np.diag(whole))
    sizes = np.linalg.solve(whole, base.T @ np.stack([record.error, record.measured], axis=1))
    # what is slow is found beside the waves of all stretches: those of one alone could not tell order 1 from it
    error, measured = (np.stack([record.error, record.measured], axis=1) - base[:, :slow] @ sizes[:slow]).T
    before, after, left = np.zeros(labels.size), np.zeros(labels.size), np.zeros(error.size)
    gains = np.zeros((labels.size, orders.size))
    squares, right = whole[slow:, slow:], wave.T @ error
    for n, label in enumerate(labels.tolist()):
        own = record.block == label
        part = wave[own]
        others = np.linalg.solve(squares - part.T @ part, right - part.T @ error[own])
        rest, raw = error[own] - part @ others, measured[own]
        if record.passed:  # of stretches of one pass the offset is that of the run
            rest, raw = rest - rest.mean(), raw - raw.mean()
        left[own] = rest
        before[n], after[n] = np.mean(raw**2), np.mean(rest**2)
        each = (part * others).reshape(len(part), 2, orders.size).sum(axis=1)
        # squared error without each order less that with it
        gains[n] = (2 * (rest @ each) + (each**2).sum(axis=0)) / rest.size
    found = sizes[slow:, 0]
    return RepeatingOrders(record, orders, found[: orders.size] - 1j * found[orders.size :], gains, before, after, left)


def merged(records: Sequence[RepeatingOrders]) -> list[OrderCase]:
    """One case for each condition: of several runs under one condition the mean wave of each order."""
    found = []
    for condition in dict.fromkeys(one.record.condition for one in records):
        group = [one for one in records if one.record.condition == condition]
        orders = np.unique(np.concatenate([one.orders for one in group]))
        weight = np.array([float(one.record.theta.size) for one in group])
        rows = np.array([waves_at(orders, one.orders, one.waves) for one in group])
        found.append(OrderCase(condition=condition, orders=orders, waves=(weight @ rows) / weight.sum()))
    return found
