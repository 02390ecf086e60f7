"""What order tables say to the joint fit: waves under each condition, in place of samples.

Under a condition the gear train is solved over a turn of the output, and its waves of the table's orders are taken by
least squares over that turn, all orders at once, as a bench takes them.  Everything else is the fit of `gears.fit`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.units import ARCSEC
from rverror.diagnosis.causes import Named
from rverror.diagnosis.gears.fit import RunSet, soft_flags
from rverror.diagnosis.gears.grid import AngleGrid, whole
from rverror.diagnosis.gears.observation import Observation
from rverror.diagnosis.gears.record import Record
from rverror.diagnosis.gears.waveform import LoadCase, Waveform
from rverror.diagnosis.order_passport import SAME_SETTING, SAME_TEMPERATURE, Cases, level_of, rows_of
from rverror.diagnosis.policy import Policy
from rverror.diagnosis.size_prior import WORKSHOP, SizePrior
from rverror.geartrain.action_line import ContactForces
from rverror.geartrain.kinematics import Pose
from rverror.geartrain.mechanism import Mechanism, Reducer
from rverror.model.compose import source_matrix
from rverror.runs.order_table import OrderCase, OrderTable

#: Samples of a wave of the highest order on the grid of a turn: waves are taken from it directly.
_SAMPLES_A_WAVE = 4
#: Share of the largest torque below which a reducer is not solved: its own drag loads the contacts as much.  Chosen:
#: makers print no-load running torques that are 5 to 20 % of the rated torque, at the output.
_DRAG = 0.05
#: Loads from which noise is told by how smoothly an order changes over them: a parabola has three sizes.
_LOADS_OF_A_LAW = 5
#: Share of an order's waves that is taken for noise where nothing tells it, and the least.  Chosen: benches repeat an
#: order to some percent, and no better than to 0.05 arcsec.
_GUESSED = 0.05
_LEAST_GUESS = 0.05 * ARCSEC


@dataclass(frozen=True)
class TableRow:
    """What a source asks of a run, of the waves of one condition.

    Attributes
    ----------
    torque : float, optional
        N*mm.
    zero : str
        Empty: a table has no constants that could be shared.
    time, noise : None
        Waves have none that the fit would have to know.
    """

    torque: float | None
    zero: str = ""
    time: None = None
    noise: None = None


@dataclass(frozen=True, eq=False)
class TableObservation(Observation):
    """The waves of one condition: real parts, then imaginary ones.

    Attributes
    ----------
    case : OrderCase
    sigma : ndarray, shape (2 k,)
    under : LoadCase
        Direction and torque at which the gear train is solved over the turn.
    gears : Reducer
    """

    case: OrderCase
    sigma: Array
    under: LoadCase
    gears: Reducer

    @property
    def width(self) -> int:
        """Two numbers of each order."""
        return 2 * self.case.orders.size

    @property
    def measured(self) -> Array:
        """The waves."""
        return np.concatenate([self.case.waves.real, self.case.waves.imag])

    @cached_property
    def _own(self) -> Array:
        """Matrix (points, 2 k) from values on the turn to waves, a constant beside them."""
        angle = np.outer(self.under.turn.theta, self.case.orders)
        design = np.concatenate([np.cos(angle), -np.sin(angle), np.ones((len(angle), 1))], axis=1)
        return np.asarray(np.linalg.pinv(design)[:-1].T)

    def _turned(self, rows: Array, offset: float) -> Array:
        """Waves of a gear train that stands so much further on: each is turned by its order times that angle."""
        if not offset:
            return rows
        count = self.case.orders.size
        waves = (rows[..., :count] + 1j * rows[..., count:]) * np.exp(1j * self.case.orders * offset)
        return np.concatenate([waves.real, waves.imag], axis=-1)

    def of_grid(self, grid: AngleGrid, rows: Array, offset: float) -> Array:
        """Waves of rows on a grid."""
        there = rows if grid == self.under.turn else grid.to_samples(self.under.turn.theta)(rows)
        return self._turned(np.asarray(there @ self._own), offset)

    def change(self, wave: Waveform, offset: float) -> Array:
        """Change with the angle of the marks."""
        row = self.of_wave(wave, wave.error[None], offset)[0]
        count = self.case.orders.size
        return np.concatenate([-row[count:] * self.case.orders, row[:count] * self.case.orders])

    def beyond(self, unit: Mechanism, grid: AngleGrid, named: Named, forces: ContactForces, offset: float) -> Array:
        """Waves of a source that acts beyond the contacts."""
        rows = source_matrix(self._motion, {"output": np.ones((1, self.under.turn.points))}, *named)
        return np.asarray(rows @ self._own)

    @cached_property
    def _motion(self) -> Pose:
        """Over the turn; stiffness plays no part in it."""
        return self.under.motion(self.gears, self.under.turn)

    def whiten(self, rows: Array) -> Array:
        """Rows in units of the noise."""
        return np.asarray(rows / self.sigma)

    @property
    def freedom(self) -> int:
        """Its numbers."""
        return self.width


@dataclass(frozen=True, eq=False)
class TableSet(RunSet):
    """Conditions of order tables, as a joint fit takes them.

    Attributes
    ----------
    cases : tuple of OrderCase
    sigmas : tuple of ndarray, shape (2 k,)
    """

    cases: tuple[OrderCase, ...] = ()
    sigmas: tuple[Array, ...] = ()
    sampled = False

    @cached_property
    def orders(self) -> Array:
        """All orders, shape (n,)."""
        return np.unique(np.round(np.concatenate([case.orders for case in self.cases]), 6))

    @cached_property
    def places(self) -> tuple[npt.NDArray[np.intp], ...]:
        """Of each case, which of the orders each of its numbers is of, shape (2 k,)."""
        return tuple(np.tile(np.searchsorted(self.orders, np.round(case.orders, 6)), 2) for case in self.cases)

    def by_order(self, rows: Iterable[Array]) -> Array:
        """Sum of each order's numbers over all cases, of a row (2 k,) for each; shape (n,)."""
        sums = [np.bincount(at, row, self.orders.size) for at, row in zip(self.places, rows, strict=True)]
        return np.asarray(np.sum(sums, axis=0), dtype=np.float64)

    @cached_property
    def values(self) -> tuple[Array, Array]:
        """Of each order how many numbers there are, and how many a law over the load has.

        Of each direction a constant and a slope, cos and sin: what is not explained yet has few independent values.
        """
        numbers = self.by_order(np.ones(at.size) for at in self.places)
        torques: dict[tuple[int, float], set[float]] = {}
        for case, at in zip(self.cases, self.places, strict=True):
            for place in set(at.tolist()):
                torques.setdefault((place, case.condition.direction), set()).add(case.condition.torque or 0.0)
        own = np.zeros(self.orders.size)
        for (place, _), loads in torques.items():
            own[place] += 2 * min(2, len(loads))
        return numbers, own

    def with_discrepancy(self, share: float) -> TableSet:
        """The same with what a model of part errors is not right to, a share of each order's waves, beside its noise.

        That is the same at neighbouring loads, so it is no noise of each number: all N numbers of an order tell no
        more of it than M independent values, and its variance counts N/M times.
        """
        power = self.by_order(np.tile(np.abs(case.waves) ** 2 / 2, 2) for case in self.cases)
        variance = share**2 * power / np.maximum(self.values[1], 1)  # power/N for each number, N/M times
        both = zip(self.sigmas, self.places, strict=True)
        return replace(self, sigmas=tuple(np.sqrt(sigma**2 + variance[at]) for sigma, at in both))

    @property
    def most_of_noise(self) -> Array:
        """Squares of each order that noise hardly exceeds, shape (n,)."""
        numbers, _ = self.values
        return np.asarray(numbers + self.policy.by_chance * np.sqrt(2 * numbers))

    @cached_property
    def observations(self) -> tuple[Observation, ...]:
        """How each condition is looked at."""
        three = zip(self.cases, self.sigmas, self.which, strict=True)
        return tuple(TableObservation(case, sigma, self.conditions[at], self.gears) for case, sigma, at in three)


def table_set(
    unit: Reducer,
    cases: Sequence[OrderCase],
    sigmas: Sequence[Array],
    *,
    policy: Policy,
    anywhere: bool,
    prior: SizePrior = WORKSHOP,
) -> TableSet:
    """Conditions of order tables, each solved once for its direction and torque.

    Parameters
    ----------
    unit : Reducer
    cases : sequence of OrderCase
    sigmas : sequence of ndarray
        Of each case's numbers, rad.
    policy : Policy
    anywhere : bool
        Whether the gear's marks may be at any angle.
    prior : SizePrior
    """
    highest = max(float(case.orders.max()) for case in cases)
    points = 2 ** math.ceil(math.log2(max(_SAMPLES_A_WAVE * highest, 512)))
    turn = whole(0.0, 2 * math.pi, points)
    torques = [case.condition.torque for case in cases]
    least = _DRAG * max((t for t in torques if t), default=0.0)
    loads = [None if torque is None or not least else max(torque, least) for torque in torques]
    keys = [(case.condition.direction, load) for case, load in zip(cases, loads, strict=True)]
    distinct = list(dict.fromkeys(keys))
    return TableSet(
        unit=unit,
        # of which a fit asks no more than a `TableRow` has
        records=cast("tuple[Record, ...]", tuple(map(TableRow, loads))),
        conditions=tuple(LoadCase(*key, turn) for key in distinct),
        which=tuple(map(distinct.index, keys)),
        policy=policy,
        soft=soft_flags(policy, loaded=bool(least)),
        anywhere=anywhere,
        prior=prior,
        cases=tuple(cases),
        sigmas=tuple(sigmas),
    )


def joined(tables: Sequence[OrderTable]) -> tuple[OrderCase, ...]:
    """All conditions of several tables, which all have one zero."""
    if len({table.index for table in tables}) > 1:
        odd = next(t for t in tables if t.index != tables[0].index)
        raise InputError(
            f"{odd.path or 'a table'}: index is {odd.index or 'aligned'!r}, that of {tables[0].path or 'table 1'} "
            f"{tables[0].index or 'aligned'!r}; tables that are diagnosed together have one zero"
        )
    return tuple(case for table in tables for case in table.cases)


def noise_of_cases(cases: Sequence[OrderCase], *, floor: float) -> tuple[list[Array], list[str]]:
    """Standard deviation of every number, and what is said of where it comes from.

    Where a table states none it is what a parabola over the torque leaves, of each order, all directions, speeds and
    temperatures together: a law over the load is smooth, and noise is not.  With fewer than five loads it is a guess.

    Parameters
    ----------
    cases : sequence of OrderCase
    floor : float
        Least deviation, rad: the model's own error.

    Returns
    -------
    list of ndarray, shape (2 k,)
    list of str
    """
    found: dict[float, float] = {}
    guessed: dict[float, float] = {}
    if any(case.sigma is None for case in cases):
        rows = rows_of(cases)
        places = np.round(rows["order"], 6)
        for order in np.unique(places).tolist():
            series = _over_the_load(rows[places == order])
            squares, freedom = np.sum([_beyond_a_parabola(*one) for one in series], axis=0)
            if freedom:
                found[order] = math.sqrt(squares / freedom)
            else:
                rms = float(np.sqrt(np.mean(np.abs(np.concatenate([waves for _, waves in series])) ** 2)))
                guessed[order] = max(_GUESSED * rms, _LEAST_GUESS)
    notes = []
    for sigmas, how in (
        (found, "taken from how smoothly each order changes over the load"),
        (guessed, f"too few loads to tell it from: guessed as {100 * _GUESSED:g} % of each order"),
    ):
        listed = ", ".join(f"{order:g}: {value / ARCSEC:.2g}" for order, value in sigmas.items())
        notes += [f"the table states no sigma; {how}, {listed} arcsec"] if sigmas else []
    sigmas = found | guessed
    own = [
        np.array([sigmas[round(o, 6)] for o in case.orders.tolist()]) if case.sigma is None else case.sigma
        for case in cases
    ]
    return [np.tile(np.hypot(sigma, floor), 2) for sigma in own], notes


def _over_the_load(rows: Cases) -> list[tuple[Array, Array]]:
    """Torques and waves of one order, of each direction, speed and temperature."""
    speed = level_of(rows["speed"], SAME_SETTING * float(np.nanmax(rows["speed"], initial=0.0)))
    at = np.stack([rows["direction"], speed, level_of(rows["temperature"], SAME_TEMPERATURE)], axis=1)
    alike = [rows[(at == key).all(axis=1)] for key in np.unique(at, axis=0)]
    return [(np.nan_to_num(own["torque"]), own["wave"]) for own in alike]


def _beyond_a_parabola(torque: Array, waves: Array) -> tuple[float, int]:
    """Squares that a parabola over the torque leaves, and of how many numbers; nothing of too few loads."""
    if np.unique(torque).size < _LOADS_OF_A_LAW:
        return 0.0, 0
    design = np.vander(torque / torque.max(), 3)
    rest = waves - design @ np.linalg.lstsq(design, waves, rcond=None)[0]
    return float(np.sum(np.abs(rest) ** 2)), 2 * (torque.size - 3)
