"""Units of a lot as amplitudes of orders, condition by condition: all that is kept of their runs.

Page ``theory/lots.md``.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array
from rverror.base.chance import chi_square
from rverror.base.errors import InputError, check_each
from rverror.base.numbers import count_of, way
from rverror.base.text import some
from rverror.geartrain.mechanism import Reducer
from rverror.model.effects import Model
from rverror.runs.measurement import Run
from rverror.runs.order_fit import whole_turns

#: Orders that are kept at most: the third harmonic of the pins' meshing with both discs, four times an RV-40E's pins.
HIGHEST = 200
_GAP = 2.0  # steps: over a longer one the waves of the highest orders are anyone's guess
_TURN = 2 * math.pi
_QUARTER = 0.25  # of the orders about one: an RV-40E's parts make 7 of 38 about order 40, 3 of 17 about order 1
_LEAST = 3  # units: of two that differ nobody can say which is the other's
_WIDE, _LEAST_WIDE = 1.6, 16  # range about an order: that many times it, and so many orders at least
_LOUDER = 4.0  # times the usual power over half of the orders: a unit of many orders has 0.5 to 2 by chance
_FLAT = 8  # orders below which noise hardly falls: half of the least range, in which a fall cannot be told from parts


@dataclass(frozen=True)
class LotUnit:
    """A finished unit and its measurement.

    Attributes
    ----------
    serial : str
    runs : tuple of Run
        One for each condition.
    labels : mapping of str to str
        Machine, supplier, shift and the like.
    """

    serial: str
    runs: tuple[Run, ...]
    labels: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Condition:
    """Direction and torque of a run."""

    direction: float  #: +1 forward, -1 reverse
    torque: float  #: N*mm, without a sign

    @property
    def time(self) -> None:
        """Not kept: what follows time repeats with no order of the output."""

    def __str__(self) -> str:
        """For people."""
        return way(self.direction) + (f" at {self.torque / 1e3:.4g} N*m" if self.torque else "")


@dataclass(frozen=True)
class Amplitudes:
    """Units as amplitudes of integer orders: cosines, then sines, of one condition after another.

    An amplitude is divided by the root of two, so that squares add up to the mean square of the error.

    Attributes
    ----------
    serials : tuple of str
    labels : mapping of str to tuple of str
        Of each unit, by name; empty where a unit has none.
    conditions : tuple of Condition
    orders : ndarray of int, shape (k,)
        Waves per output turn.
    values : ndarray, shape (units, conditions * 2 * k)
        rad.
    noise : ndarray, shape (conditions * 2 * k,)
        Variance of each that a unit's noise makes, rad^2.
    samples : int
        Of a turn.  What is above half of that order folds back, in units that are solved as in those that are measured.
    notes : tuple of str
        What was left out.
    marked : bool
        Whether order k has the same phase in all units; else each is turned by k times an angle of its own.
    """

    serials: tuple[str, ...]
    labels: Mapping[str, tuple[str, ...]]
    conditions: tuple[Condition, ...]
    orders: npt.NDArray[np.intp]
    values: Array
    noise: Array
    samples: int
    notes: tuple[str, ...] = ()
    marked: bool = True

    def check_marked(self, noun: str = "unit") -> None:
        """Refuse units whose phases cannot be compared.

        Raises
        ------
        InputError
        """
        if not self.marked:
            raise InputError(
                f"{noun}s: the bench's zero is not on the gear's marks (index: unknown); {noun}s are compared at "
                "aligned zeros: turn each to its marks"
            )

    @cached_property
    def same_order(self) -> npt.NDArray[np.bool_]:
        """Whether two amplitudes are of one order, shape (d, d)."""
        order = np.tile(self.orders, 2 * len(self.conditions))
        return np.asarray(order[:, None] == order)

    def over_turns(self, forms: Array) -> Array:
        """Mean of covariances over all turns of a unit's marks, where these are unknown, shape (..., d, d).

        Of one order it is the mean of a form and the same turned by a quarter of its wave, of two orders none.
        """
        if self.marked:
            return forms
        count = len(self.orders)
        other = np.arange(forms.shape[-1]).reshape(-1, 2, count)[:, ::-1].ravel()  # the sine of each cosine
        sign = np.tile(np.repeat([1.0, -1.0], count), len(self.conditions))
        turned = sign[:, None] * sign * forms[..., other[:, None], other]
        return np.where(self.same_order, (forms + turned) / 2, 0.0)

    def about_mean(self, values: Array) -> Array:
        """Amplitudes of some units about their mean; as they are without marks, which leave no mean."""
        return np.asarray(values - values.mean(axis=0) * self.marked)

    @property
    def variance(self) -> Array:
        """Of each amplitude over the units, shape (d,)."""
        return np.asarray(np.diag(self.over_turns(np.diag(variance_of(self.values, marked=self.marked)))))

    def of_orders(self, kept: npt.NDArray[np.bool_]) -> Amplitudes:
        """The same with some of the orders."""
        chosen = np.tile(kept, 2 * len(self.conditions))
        return replace(self, orders=self.orders[kept], values=self.values[:, chosen], noise=self.noise[chosen])

    def of_waves(self, waves: Array) -> Array:
        """Amplitudes of waves over even angles of a turn, shape (..., n) to (..., 2 k), of one condition."""
        found = np.fft.rfft(waves, axis=-1)[..., self.orders] * (math.sqrt(2) / waves.shape[-1])
        return np.concatenate([found.real, -found.imag], axis=-1)

    def waves(self, values: Array, angles: int) -> Array:
        """Waves over even angles of a turn of some units' amplitudes, rad, shape (units, conditions, angles)."""
        parts = values.reshape(len(values), len(self.conditions), 2, -1)
        spectrum = np.zeros((*parts.shape[:2], angles // 2 + 1), dtype=np.complex128)
        spectrum[..., self.orders] = (parts[:, :, 0] - 1j * parts[:, :, 1]) * (angles / math.sqrt(2))
        return np.asarray(np.fft.irfft(spectrum, angles, axis=-1), dtype=np.float64)


@dataclass(frozen=True)
class UnitAmplitudes:
    """One unit as amplitudes of orders: what is kept of its runs.

    Attributes
    ----------
    serial : str
    labels : mapping of str to str
    values : mapping of Condition to ndarray, shape (2 k,)
        Cosines, then sines, of orders 1 to k, over the root of two, rad.
    samples : int
        Of a turn, of the run that has the fewest; 0 where no run is left.
    notes : tuple of str
        Runs that were left out.
    offsets : mapping of Condition to float
        Mean errors, rad; not kept in compressed files, as a lot has no common zero.
    marked : bool
        Whether orders count from the gear's marks.
    """

    serial: str
    labels: Mapping[str, str]
    values: Mapping[Condition, Array | npt.NDArray[np.float32]]
    samples: int
    notes: tuple[str, ...] = ()
    offsets: Mapping[Condition, float] = field(default_factory=dict)
    marked: bool = True

    @property
    def count(self) -> int:
        """Number of orders: as many as the samples tell."""
        return _orders(self.samples)


def amplitudes_of(model: Model, units: Sequence[LotUnit] | Amplitudes) -> Amplitudes:
    """Amplitudes of the error that the model leaves of each unit's runs; what are amplitudes already stays.

    Parameters
    ----------
    model : Model
    units : sequence of LotUnit, or Amplitudes

    Returns
    -------
    Amplitudes

    Raises
    ------
    InputError
        If there are fewer than three units, a serial number stands twice, or runs do not fit the model.
    """
    if isinstance(units, Amplitudes):
        return units
    check_each("units", units, LotUnit, "give a list of units, such as lot_units(folder, model)[0]")
    return joined_units([split_unit(model, unit) for unit in units])


def joined_units(read: Sequence[UnitAmplitudes], *, least: int = _LEAST, noun: str = "unit") -> Amplitudes:
    """Units that are split into orders as one lot, with the noise that they tell together.

    Parameters
    ----------
    read : sequence of UnitAmplitudes
        In the order in which the units were made.
    least : int
        Units that it takes.
    noun : str
        What they are, for messages.

    Returns
    -------
    Amplitudes
        Of the conditions that most units have, and the orders that all units have.

    Raises
    ------
    InputError
        If fewer units are left, or a serial number stands twice.
    """
    twice = [serial for serial, count in Counter(unit.serial for unit in read).items() if count > 1]
    if twice:
        raise InputError(f"serial {twice[0]!r} stands for {count_of(2, 'unit')}; give each unit a serial of its own")
    conditions = _common(read)
    whole = [one for one in read if conditions and all(c in one.values for c in conditions)]
    kept = {one.serial for one in whole}
    lacking = [one.serial for one in read if one.serial not in kept]
    notes = [note for one in read for note in one.notes]
    if lacking:
        wanted = ", ".join(map(str, conditions))
        notes.append(f"left out: {count_of(len(lacking), noun)} without a run of {wanted} ({some(lacking)})")
    turned = [one.serial for one in whole if not one.marked]
    if 0 < len(turned) < len(whole):
        notes.append(f"no marks are used: those of {count_of(len(turned), noun)} are unknown ({some(turned)})")
    if len(whole) < least:
        wanted = ", ".join(map(str, conditions)) or "of one condition"
        raise InputError(
            f"{count_of(len(whole), noun)} with a run {wanted}: it takes {least} or more; measure more {noun}s"
        )
    count = min(one.count for one in whole)
    kept_orders = [[one.values[c].reshape(2, -1)[:, :count] for c in conditions] for one in whole]
    rows = np.array(kept_orders, dtype=np.float64).reshape(len(whole), -1)
    names = sorted({name for unit in read for name in unit.labels})
    labels = {name: tuple(one.labels.get(name, "") for one in whole) for name in names}
    return Amplitudes(
        tuple(one.serial for one in whole), labels, conditions, np.arange(1, count + 1), rows,
        _noise(rows, len(conditions), marked=not turned), min(one.samples for one in whole), tuple(notes), not turned,
    )  # fmt: skip


def split_unit(model: Model, unit: LotUnit, *, noun: str = "unit") -> UnitAmplitudes:
    """Split the error that the model leaves of a unit's runs into orders.

    Parameters
    ----------
    model : Model
        Its ratio makes the error of the angles; of its effects only what they need to know of a run is asked.
    unit : LotUnit
    noun : str
        What it is, for messages.

    Returns
    -------
    UnitAmplitudes

    Raises
    ------
    InputError
        If runs do not fit the model, or cannot be split.
    """
    found, notes, name = dict[Condition, tuple[Array, Array]](), list[str](), f"{noun} {unit.serial}"
    turned = {run.index == "unknown" for run in unit.runs}
    if len(turned) > 1:
        raise InputError(
            f"{name}: index is 'unknown' in some of its runs; all runs or none of a {noun} may have a zero that is not "
            "on the gear's marks"
        )
    for run in unit.runs:
        run.check_effects(model, name)
        if len(set(run.direction.tolist())) > 1:
            raise InputError(f"{name}: a run turns both ways; give one file for each direction")
        if run.load_column is not None:
            raise InputError(f"{name}: a run's torque changes over the turn; {noun}s are compared under one torque")
        if not run.torque and isinstance(model.mechanism, Reducer):
            raise InputError(f"{name}: a run states no torque; add a line '# output_torque: 20 N*m' to its head")
        condition = condition_of(run)
        theta, error, travel, _ = whole_turns(run.nominal_angle(model), run.error(model))
        step, longest = travel / theta.size, float(np.diff(theta).max())
        if travel < _TURN * (1 - 1e-9):
            raise InputError(f"{name}: a run covers {travel / _TURN:.2f} turns of the output; it takes a whole turn")
        if condition in found:
            notes.append(f"{name}: a second run {condition} is left out")
        elif longest > _GAP * step:
            notes.append(f"{name}: the run {condition} is left out for a gap of {math.degrees(longest):.3g} deg")
        else:
            found[condition] = theta, error
    reach = [(theta.size, np.ptp(theta) * theta.size / (theta.size - 1)) for theta, _ in found.values()]
    samples = min((round(size * _TURN / travel) for size, travel in reach), default=0)
    fits = {condition: _fitted(theta, error, _orders(samples)) for condition, (theta, error) in found.items()}
    values = {condition: waves for condition, (_, waves) in fits.items()}
    offsets = {condition: offset for condition, (offset, _) in fits.items()}
    return UnitAmplitudes(unit.serial, unit.labels, values, samples, tuple(notes), offsets, turned != {True})


def condition_of(run: Run) -> Condition:
    """Condition of a run that turns one way."""
    return Condition(float(run.direction[0]), abs(float(run.torque or 0.0)))


def _orders(samples: int) -> int:
    """Orders that so many samples of a turn tell."""
    return min(HIGHEST, max(samples // 2 - 1, 0))


def _fitted(theta: Array, error: Array, count: int) -> tuple[float, Array]:
    """Least squares over the angles of whole turns: the offset, and orders 1 to `count`.

    Of waves exp(i k theta) the normal equations are Toeplitz, from sums of powers of one: ten times as fast
    as with their matrix, which is never made.
    """
    turn = np.exp(1j * theta)
    wave, sums, given = np.ones_like(turn), np.empty(2 * count + 1, np.complex128), np.empty(count + 1, np.complex128)
    for order in range(2 * count + 1):
        sums[order] = wave.sum()
        if order <= count:
            given[order] = np.vdot(wave, error)
        wave *= turn
    both = np.concatenate([given[:0:-1].conj(), given])  # orders -count to count
    found = scipy.linalg.solve_toeplitz((sums.conj(), sums), both)[count:]
    waves = found[1:] * math.sqrt(2)
    return float(found[0].real), np.concatenate([waves.real, -waves.imag])


def variance_of(values: Array, *, marked: bool = True) -> Array:
    """Variance of each amplitude over units; about none without marks, which leave no mean.

    Parameters
    ----------
    values : ndarray, shape (units, d)
    marked : bool

    Returns
    -------
    ndarray, shape (d,)
    """
    return np.asarray(values.var(axis=0, ddof=1) if marked else np.mean(values**2, axis=0))


def _noise(values: Array, conditions: int, *, marked: bool = True) -> Array:
    """Variance of each amplitude that noise makes: about an order, what a quarter of the orders there stay below.

    Parts make few of the orders of a range; over all units a noise of the bench makes them alike, but for a fall with
    the order: by some power of k^2 + 8^2, as of coloured noise that is flat at low orders.  Units whose orders all vary
    more do not count: gross errors make what looks like noise.
    """
    squares = ((values - marked * np.median(values, axis=0)) ** 2).reshape(len(values), conditions, 2, -1).sum(axis=2)
    louder = np.median(squares / np.maximum(np.median(squares, axis=0), np.finfo(np.float64).tiny), axis=(1, 2))
    alike = louder <= max(_LOUDER, np.partition(louder, 1)[1])  # two at least
    power = variance_of(values[alike], marked=marked).reshape(conditions, 2, -1).mean(axis=1)
    freedom, found = 2 * (int(alike.sum()) - marked), np.empty_like(power)
    level, orders = np.log(np.maximum(power, np.finfo(np.float64).tiny)), np.arange(1, power.shape[1] + 1)
    for at, k in enumerate(orders):
        near = orders_about(orders, k, _LEAST_WIDE)
        fall = np.log((orders[near] ** 2 + _FLAT**2) / (k**2 + _FLAT**2))
        found[:, at] = [_lower_quartile(fall, one) for one in level[:, near]]
    return np.tile((np.exp(found) * freedom / chi_square(1 - _QUARTER, freedom))[:, None], (1, 2, 1)).reshape(-1)


def orders_about(orders: npt.NDArray[np.intp], order: int, least: int) -> npt.NDArray[np.bool_]:
    """Orders beside which an order's noise is told: from 1 / 1.6 to 1.6 times it, some to either side at least.

    Parameters
    ----------
    orders : ndarray of int, shape (k,)
        Order 0 is left out.
    order : int
    least : int
        Orders to either side.

    Returns
    -------
    ndarray of bool, shape (k,)
    """
    return (orders >= min(order / _WIDE, order - least)) & (orders <= max(order * _WIDE, order + least)) & (orders > 0)


def _lower_quartile(at: Array, values: Array) -> float:
    """Where it is at 0, if it changes linearly: quantile regression, as a linear program's dual."""
    rows = np.stack([np.ones_like(at), at])
    program = scipy.optimize.linprog(
        -values, A_eq=rows, b_eq=(1 - _QUARTER) * rows.sum(axis=1), bounds=(0, 1), method="highs"
    )
    return float(-program.eqlin.marginals[0])


def _common(read: Sequence[UnitAmplitudes]) -> tuple[Condition, ...]:
    """Conditions that most of the units have."""
    counts = Counter(condition for one in read for condition in one.values)
    most = [c for c, count in counts.items() if 2 * count > len(read)]
    return tuple(sorted(most, key=lambda c: (c.torque, -c.direction)))
