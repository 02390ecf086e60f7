"""Lots of drives, of which only orders are known: what all units share, what is one unit's own, units nearly equal.

Page ``theory/lots.md``, section "Lots of drives".
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import scipy

from rverror.base.arrays import Array
from rverror.base.errors import InputError, check_kind
from rverror.base.viewed import Viewed
from rverror.geartrain.mechanism import Drive
from rverror.lots.amplitudes import Amplitudes, LotUnit, amplitudes_of
from rverror.lots.result import Interval
from rverror.model.effects import Model

#: False alarms, each in so many of all lots that have none: orders that are shared, units that differ, pairs.
LEVEL = 0.05
_LEAST = 6  # units: of five all but three decide with two degrees of freedom, and no chance is small
_SPOILT = 1 / 3  # of the units that may differ from the others at an order
_MOST = 20  # orders with more than noise that are told, the strongest
_SHUFFLES = 2000


@dataclass(frozen=True)
class LotOrder:
    """One order of a lot of drives under one condition, over the units that do not differ there.

    Attributes
    ----------
    order : int
        Waves per output turn.
    condition : str
    least, median, most : float
        Amplitudes of the units, rad.
    mean : Interval
        Amplitude of the mean wave, which all units share, rad.
    phase : float
        Of the mean wave, cos(order * theta + phase), rad.
    spread : float
        Standard deviation of the units about it, cosine and sine together, rad.
    chance : float
        How often units that share no wave have such a mean, in any order.
    """

    order: int
    condition: str
    least: float
    median: float
    most: float
    mean: Interval
    phase: float
    spread: float
    chance: float

    @property
    def shared(self) -> bool:
        """Whether units share a wave."""
        return self.chance < LEVEL


@dataclass(frozen=True)
class OwnOrder:
    """An order in which one unit differs from the others.

    Attributes
    ----------
    serial : str
    order : int
    condition : str
    amplitude : float
        Of the unit, rad.
    difference : float
        Amplitude of its difference to the mean of the others, rad.
    distance : float
        The same in standard deviations of the others in that direction.
    chance : float
        How often any unit of a lot is as far off in any order.
    """

    serial: str
    order: int
    condition: str
    amplitude: float
    difference: float
    distance: float
    chance: float


@dataclass(frozen=True)
class LikePair:
    """Two units that are more alike than units of the lot are.

    Attributes
    ----------
    serials : tuple of str
    difference : float
        Root mean square of the difference of their waves, rad.
    usual : float
        Median of the same over all pairs, rad.
    chance : float
        How often the most alike pair of a lot is as alike.
    """

    serials: tuple[str, str]
    difference: float
    usual: float
    chance: float


@dataclass(frozen=True)
class DriveLot(Viewed):
    """Result of `lot_of_drives`.

    Attributes
    ----------
    model : str
        Name of the drive.
    serials : tuple of str
    conditions : tuple of str
    orders : tuple of LotOrder
        With more than noise, the strongest first.
    own : tuple of OwnOrder
        The least likely first.
    pairs : tuple of LikePair
        The least likely first.
    amplitudes : ndarray, shape (units, orders)
        Of each unit, rad.
    notes : tuple of str
    """

    model: str
    serials: tuple[str, ...]
    conditions: tuple[str, ...]
    orders: tuple[LotOrder, ...]
    own: tuple[OwnOrder, ...]
    pairs: tuple[LikePair, ...]
    amplitudes: Array = field(default_factory=lambda: np.empty((0, 0)), repr=False)
    notes: tuple[str, ...] = ()


def lot_of_drives(model: Model, units: Sequence[LotUnit] | Amplitudes, *, seed: int = 0) -> DriveLot:
    """Tell what the drives of a lot share order by order, what is one unit's own, and which two are nearly equal.

    Parameters
    ----------
    model : Model
        Of a drive; orders count from where its nominal output angle is zero.
    units : sequence of LotUnit, or Amplitudes
        Each with a run for each condition, over a turn of the output or more; six or more.
    seed : int
        Of the shuffles that tell how alike units are by chance.

    Returns
    -------
    DriveLot

    Raises
    ------
    InputError
        If the model is none of a drive, runs do not fit it or one another, or the units are too few.

    Examples
    --------
    >>> import numpy as np, rverror
    >>> drive = rverror.Model(rverror.Drive(ratio=1.0))
    >>> theta, rng = np.linspace(0, 2 * np.pi, 256, endpoint=False), np.random.default_rng(1)
    >>> def unit(serial):
    ...     own = 1e-4 * rng.normal(size=2) @ [np.cos(theta), np.sin(theta)]
    ...     te = 3e-4 * np.cos(4 * theta) + own + 1e-6 * rng.normal(size=256)
    ...     return rverror.lots.amplitudes.LotUnit(serial, (rverror.run_from_arrays(output_angle=theta, te=te),))
    >>> found = lot_of_drives(drive, [unit(serial) for serial in "ABCDEFGH"])
    >>> [(one.order, one.shared) for one in found.orders[:2]]
    [(4, True), (1, False)]
    """
    check_kind("model", model, Model, "make one with load_model or Model(Drive(ratio=...))")
    check_kind("model: its mechanism", model.mechanism, Drive, "give a model with [drive]; lot takes reducers")
    amplitudes = amplitudes_of(model, units)
    amplitudes.check_marked()
    count = len(amplitudes.serials)
    if count < _LEAST:
        raise InputError(f"units: {count} of drives, it takes {_LEAST} or more to tell one from the others; add units")
    parts = amplitudes.values.reshape(count, len(amplitudes.conditions), 2, -1) * math.sqrt(2)
    waves = parts[:, :, 0] - 1j * parts[:, :, 1]  # of cos(k theta + phase), (units, conditions, orders)
    noise = 2 * amplitudes.noise.reshape(len(amplitudes.conditions), 2, -1)[:, 0]
    power = np.sum(np.abs(waves) ** 2, axis=0) / np.where(noise > 0, noise, np.inf)
    seen = scipy.stats.chi2.sf(power, 2 * count) * power.size < LEVEL
    places = list(zip(*np.nonzero(seen), strict=True))
    told = sorted(places, key=lambda at: -float(np.median(np.abs(waves[:, *at]))))[:_MOST]
    orders, own = list[LotOrder](), list[OwnOrder]()
    for c, k in told:
        wave, order, condition = waves[:, c, k], int(amplitudes.orders[k]), str(amplitudes.conditions[c])
        members, odd = told_apart(wave, LEVEL / len(told))
        orders.append(_order(wave[members], order, condition, len(told)))
        off = np.abs(wave - wave[members].mean())
        for u, (distance, chance) in odd.items():
            sizes = float(abs(wave[u])), float(off[u]), distance, min(chance * len(told), 1.0)
            own.append(OwnOrder(amplitudes.serials[u], order, condition, *sizes))
    chosen = np.stack([waves[:, c, k] for c, k in told], axis=1) if told else waves[:, 0, :0]
    left = len(places) - len(told)
    return DriveLot(
        model=model.name or model.mechanism.name,
        serials=amplitudes.serials,
        conditions=tuple(map(str, amplitudes.conditions)),
        orders=tuple(orders),
        own=tuple(sorted(own, key=lambda one: one.chance)),
        pairs=_pairs(chosen, amplitudes.serials, seed),
        amplitudes=np.abs(chosen),
        notes=(*amplitudes.notes, *([f"{left} weaker orders above the noise are not listed"] if left else [])),
    )


def told_apart(
    wave: npt.NDArray[np.complex128], level: float
) -> tuple[npt.NDArray[np.bool_], dict[int, tuple[float, float]]]:
    """Members of a lot at one order, and the units that are none, with their distance and chance.

    The unit that is least likely goes, one after another up to a third of them; all are told up to the last whose
    chance is below the level, so that two that are far off do not hide one another (Rosner's generalised test).

    Parameters
    ----------
    wave : ndarray of complex, shape (units,)
    level : float
        Chance that any unit of a lot of normal waves is told.

    Returns
    -------
    members : ndarray of bool, shape (units,)
    odd : dict of int to (float, float)
        Distance from the members in their standard deviations, and chance, by the unit's number.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> wave = rng.normal(size=20) + 1j * rng.normal(size=20)
    >>> wave[[3, 7]] += 30
    >>> members, odd = told_apart(wave, 0.01)
    >>> sorted(odd)
    [3, 7]
    """
    left, gone, chances = np.arange(wave.size), list[int](), list[float]()
    steps = math.ceil(_SPOILT * wave.size)
    while len(gone) < steps and left.size >= _LEAST:
        n = left.size
        share = n * _squares(wave[left], wave[left]) / (n - 1) ** 2  # Beta(1, (n - 3) / 2) of a normal wave
        at = int(np.argmax(share))
        chances.append(steps * n * max(1 - float(share[at]), 0.0) ** ((n - 3) / 2))
        gone.append(int(left[at]))
        left = np.delete(left, at)
    last = max((at + 1 for at, chance in enumerate(chances) if chance < level), default=0)
    members = np.ones(wave.size, np.bool_)
    members[gone[:last]] = False
    far = np.sqrt(_squares(wave, wave[members]) / (1 + 1 / members.sum()))
    return members, {unit: (float(far[unit]), min(chances[at:last])) for at, unit in enumerate(gone[:last])}


def _squares(wave: npt.NDArray[np.complex128], members: npt.NDArray[np.complex128]) -> Array:
    """Squared distances from the members' mean in their covariance, cosine and sine."""
    about, own = (np.stack([x.real, x.imag]) for x in (wave - members.mean(), members - members.mean()))
    rounding = 1e-12 * max(float(np.mean(np.abs(wave) ** 2)), np.finfo(float).tiny) * np.eye(2)
    weight = np.linalg.inv(own @ own.T / (members.size - 1) + rounding)
    return np.asarray(np.einsum("iu,ij,ju->u", about, weight, about))


def _order(wave: npt.NDArray[np.complex128], order: int, condition: str, tests: int) -> LotOrder:
    """What the members share at one order."""
    n, mean, sizes = wave.size, complex(wave.mean()), np.abs(wave)
    about = wave - mean
    together = abs(np.sum(np.exp(1j * np.angle(wave)))) ** 2  # Rayleigh's test of phases, whatever the amplitudes
    chance = math.exp(math.sqrt(1 + 4 * n + 4 * (n**2 - together)) - (1 + 2 * n))
    unit = mean / abs(mean) if mean else 1.0
    error = float(np.std((about * np.conj(unit)).real, ddof=1)) / math.sqrt(n) * float(scipy.stats.t.isf(0.025, n - 1))
    return LotOrder(
        order, condition, float(sizes.min()), float(np.median(sizes)), float(sizes.max()),
        Interval(abs(mean), max(abs(mean) - error, 0.0), abs(mean) + error), float(np.angle(mean)),
        float(np.sqrt(np.sum(np.abs(about) ** 2) / (n - 1))), min(chance * tests, 1.0),
    )  # fmt: skip


def _pairs(waves: npt.NDArray[np.complex128], serials: Sequence[str], seed: int) -> tuple[LikePair, ...]:
    """Pairs that are alike in more orders than chance makes, by units that are shuffled in each order by itself."""
    count, orders = waves.shape
    if orders < 2:
        return ()
    one, other = np.triu_indices(count, 1)
    apart = np.abs(waves[one] - waves[other]) ** 2
    ranks = scipy.stats.rankdata(apart, axis=0)  # of each order
    score = np.zeros((count, count, orders))
    score[one, other] = score[other, one] = -np.log((ranks - 0.5) / one.size)
    alike = score[one, other].sum(axis=1)
    rng, most = np.random.default_rng(seed), np.empty(_SHUFFLES)
    for number in range(_SHUFFLES):
        place = rng.permuted(np.tile(np.arange(count)[:, None], orders), axis=0)
        most[number] = score[place[one], place[other], np.arange(orders)].sum(axis=1).max()
    chances = (1 + np.sum(most[:, None] >= alike - 1e-9, axis=0)) / (1 + _SHUFFLES)
    rms = np.sqrt(apart.sum(axis=1) / 2)
    told = sorted(np.flatnonzero(chances < LEVEL), key=lambda at: -alike[at])
    return tuple(
        LikePair((serials[one[at]], serials[other[at]]), float(rms[at]), float(np.median(rms)), float(chances[at]))
        for at in told
    )
