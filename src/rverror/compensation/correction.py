"""The correction: waves over the output angle, by direction and condition; tables and models are views of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rverror.base.arrays import Array
from rverror.base.directions import Direction, direction_sign
from rverror.model.compensation import WAVE, order_index
from rverror.model.effects import Effect, effect
from rverror.runs.order_table import OrderCase, OrderTable, TableCondition, Waves

_TURN = 2 * math.pi
_FINE = 8  # samples a wave of the highest order, to see what waves leave between the points of a table
FEWEST = 4  # points a wave of the highest order: below, a table leaves 1 - cos(pi/4) = 29 % of it and more
_MOST = 1 << 17
_SETTLES = 8  # each takes off all but the slope of the correction, a few per cent


@dataclass(frozen=True, eq=False)
class Correction:
    """Waves of what is added to the command, as an angle of the output: the input is told R (theta + c) for theta.

    Attributes
    ----------
    ratio : float
        R, input turns per output turn.
    table : OrderTable
        Waves over the output angle, one case for each direction and condition for which they were made.
    reach : tuple of two float, optional
        Output angles between which it holds, rad; None: over whole turns.

    Examples
    --------
    >>> at = TableCondition(direction=1.0)
    >>> case = OrderCase(condition=at, orders=np.array([40.0]), waves=np.array([1e-5 + 0j]))
    >>> Correction(121.0, OrderTable(cases=(case,))).at(np.array([0.0, np.pi / 40]), at)
    array([ 1.e-05, -1.e-05])
    """

    ratio: float
    table: OrderTable
    reach: tuple[float, float] | None = None

    @property
    def orders(self) -> Array:
        """Every order of any case, growing."""
        return np.unique(np.concatenate([np.zeros(0), *(case.orders for case in self.table.cases)]))

    def waves(self, condition: TableCondition) -> tuple[Array, Waves]:
        """Orders and waves under a condition.

        Parameters
        ----------
        condition : TableCondition

        Returns
        -------
        orders : ndarray, shape (k,)
        waves : ndarray of complex, shape (k,)
            rad; c = sum of Re(z exp(i order theta)).  Zero in a direction that no case has.

        Notes
        -----
        From the cases of the direction that come nearest in speed and temperature, straight from load to load, and
        beyond the smallest and largest load as there.
        """
        orders, cases = self.orders, [c for c in self.table.cases if c.condition.direction == condition.direction]
        if not cases:
            return orders, np.zeros(orders.size, dtype=np.complex128)
        distances = [_distance(case.condition, condition) for case in cases]
        near = [case for case, far in zip(cases, distances, strict=True) if far == min(distances)]
        loads = {case.condition.torque: waves_at(orders, case.orders, case.waves) for case in near}
        if condition.torque in loads or condition.torque is None or None in loads:
            return orders, loads.get(condition.torque, next(iter(loads.values())))
        torques = sorted(torque for torque in loads if torque is not None)
        share = float(np.interp(condition.torque, torques, np.arange(len(torques))))
        low, high = (loads[torques[at]] for at in (math.floor(share), math.ceil(share)))
        return orders, low + (share - math.floor(share)) * (high - low)

    def at(self, theta: Array, condition: TableCondition) -> Array:
        """Sum of the waves at output angles, rad, shape (n,): what is added, to first order."""
        return wave_sum(theta, *self.waves(condition))

    def of_orders(self, orders: Array) -> Correction:
        """The same with some of its orders."""
        kept = [(case, np.isin(case.orders, orders)) for case in self.table.cases]
        cases = tuple(replace(case, orders=case.orders[at], waves=case.waves[at]) for case, at in kept)
        return replace(self, table=replace(self.table, cases=cases))

    def points(self, condition: TableCondition, allowed: float) -> int:
        """Even points a turn between which straight lines leave no more than so much rms, rad, four a wave at least."""
        highest = float(self.orders.max(initial=1.0))
        count: int = 2 ** math.ceil(math.log2(max(FEWEST * highest, 16)))
        while count < _MOST and self.between(count, condition) > allowed:
            count *= 2
        return count

    def between(self, points: int, condition: TableCondition) -> float:
        """What straight lines between so many even points a turn leave of the waves, rms, rad.

        Notes
        -----
        At worst 1 - cos(pi k / N) of order k, halfway between two points at its crest.
        """
        theta = self._angles(points)
        step = _TURN / points
        knots = theta[0] + step * np.arange(math.ceil(float(np.ptp(theta)) / step) + 2)
        left = self.at(theta, condition) - np.interp(theta, knots, self.at(knots, condition))
        return float(np.sqrt(np.mean(left**2)))

    def rms(self, condition: TableCondition) -> float:
        """Root mean square about the mean, over a turn or what it reaches over, rad."""
        return float(np.std(self.at(self._angles(), condition)))

    def slipped(self, angle: float, condition: TableCondition) -> float:
        """What the waves leave of themselves where the table's zero slips by an angle: rms, rad.

        Notes
        -----
        2 sin(k angle / 2) of order k: more than the whole of it from a sixth of its wave on.
        """
        theta = self._angles()
        theta = theta if self.reach is None else theta[theta + angle <= self.reach[1]]
        return float(np.sqrt(np.mean((self.at(theta + angle, condition) - self.at(theta, condition)) ** 2)))

    def settled(self, theta: Array, condition: TableCondition) -> Array:
        """Solution of c = w(theta + c), w the sum of the waves: what leads to where the waves cancel the error.

        Parameters
        ----------
        theta : ndarray, shape (n,)
            Commanded output angles, rad.
        condition : TableCondition

        Returns
        -------
        ndarray, shape (n,)
            rad.
        """
        added, (low, high) = self.at(theta, condition), self.reach or (-math.inf, math.inf)
        for _ in range(_SETTLES):
            added = self.at(np.clip(theta + added, low, high), condition)
        return added

    def _angles(self, points: int = 0) -> Array:
        """Even angles over a turn, or what it reaches over: some to each wave, and between so many points a turn."""
        highest = max(float(self.orders.max(initial=1.0)), 16.0, points)
        count = _FINE * 2 ** math.ceil(math.log2(highest))
        low, high = self.reach or (0.0, _TURN)
        number = max(math.ceil((high - low) / _TURN * count - 1e-9), 2)
        return np.asarray(low + _TURN / count * np.arange(number), dtype=np.float64)

    def effects(self, torque: float | None = None) -> tuple[Effect, ...]:
        """The correction at one load as effects of a model: of a unit in whose controller the table is.

        Parameters
        ----------
        torque : float, optional
            N*mm; of those for which it was made the first, where left out.

        Returns
        -------
        tuple of Effect
            Waves of every order, alike and opposite in the two directions.
        """
        orders, forward = self.waves(self.condition(1.0, torque))
        _, reverse = self.waves(self.condition(-1.0, torque))
        halves = (("alike", (forward + reverse) / 2), ("opposite", (forward - reverse) / 2))
        return tuple(
            effect(WAVE.key, order=order_index(k), sense=sense, cos=z.real, sin=-z.imag)
            for sense, waves in halves
            for k, z in zip(orders.tolist(), waves.tolist(), strict=True)
            if z
        )

    def condition(self, direction: Direction, torque: float | None = None) -> TableCondition:
        """Condition in a direction at a load; of those for which it was made the middle one, where left out."""
        direction = direction_sign(direction)
        at = [case.condition for case in self.table.cases if case.condition.direction == direction]
        at = at or [case.condition for case in self.table.cases]
        if torque is None:
            loads = sorted(c.torque for c in at if c.torque is not None)
            torque = loads[len(loads) // 2] if loads else None
        first = next((c for c in at if c.torque == torque), at[0])
        return replace(first, direction=direction, torque=torque)


def wave_sum(theta: Array, orders: Array, waves: Waves) -> Array:
    """Sum of Re(z exp(i order theta)), shape (n,)."""
    total = np.zeros(theta.size)
    for order, z in zip(orders.tolist(), waves.tolist(), strict=True):
        phase = order * theta
        total += z.real * np.cos(phase) - z.imag * np.sin(phase)
    return total


def from_effects(ratio: float, effects: Sequence[Effect]) -> Correction:
    """The correction that a model's waves of a table hold: `Correction.effects`, back again.

    Parameters
    ----------
    ratio : float
    effects : sequence of Effect
        Others are passed over.

    Returns
    -------
    Correction
    """
    own = [e for e in effects if e.key == WAVE.key]
    orders = np.unique([float(e.indices["order"]) for e in own])
    halves = {sense: np.zeros(orders.size, dtype=np.complex128) for sense in ("alike", "opposite")}
    alike, opposite = halves.values()
    for e in own:
        halves[str(e.indices["sense"])][orders == float(e.indices["order"])] += complex(e.values[0], -e.values[1])
    cases = tuple(
        OrderCase(condition=TableCondition(direction=sense), orders=orders, waves=alike + sense * opposite)
        for sense in (1.0, -1.0)
    )
    return Correction(ratio, OrderTable(cases=cases if own else ()))


def _distance(one: TableCondition, other: TableCondition) -> int:
    """How far two conditions are apart beside their load: in twentieths of the speed and in steps of 2 K."""
    distance = 0.0
    if one.input_speed and other.input_speed:
        distance += abs(math.log(one.input_speed / other.input_speed)) // 0.05
    if one.temperature is not None and other.temperature is not None:
        distance += abs(one.temperature - other.temperature) // 2
    return int(distance)


def waves_at(wanted: Array, orders: Array, waves: Waves) -> Waves:
    """Waves at wanted orders, zero where there is none."""
    found = np.zeros(wanted.size, dtype=np.complex128)
    _, here, there = np.intersect1d(wanted, orders, assume_unique=True, return_indices=True)
    found[here] = waves[there]
    return found
