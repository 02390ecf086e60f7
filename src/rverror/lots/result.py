"""What a lot says: processes, units that are no members, groups that differ, and the units to come."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from rverror.base.arrays import Array
from rverror.base.viewed import Viewed
from rverror.diagnosis.result import Diagnosis
from rverror.geartrain.source import IndexValue


@dataclass(frozen=True)
class Interval:
    """A value with its 95 % interval, core units."""

    value: float
    low: float
    high: float

    def __contains__(self, other: float) -> bool:
        """Whether a value is within."""
        return self.low <= other <= self.high


@dataclass(frozen=True)
class MadeBy:
    """A process as the lot shows it.

    Attributes
    ----------
    key : str
        A key of the catalogue.
    indices : mapping of str to int or str
        Of a wave its harmonic.
    parameters : tuple of str
        Components that share the standard deviation.
    dimension : str
        A key of `units.CORE_UNITS`.
    deviation : Interval or None
        Standard deviation of each component; None where the lot does not show it.
    above_zero : bool
        Whether its interval leaves out none: of processes that make none, one in 40 is.
    share : float
        Of the variance of the output error, over orders and conditions; 0 where it is not shown.
    alike : tuple of str
        Processes that no lot tells from it: what is said is of them all together.
    units_needed : int or None
        Units with which its interval would be within a quarter of its value; None where it is not above zero.
    tolerance : str
        Of the drawing, by its name; empty where there is none.
    capability : float or None
        Cp: width of the tolerance over what the process needs, 1 where 0.27 % are beyond.
    capability_centred : float or None
        Cpk: the same, less what the mean is off.
    """

    key: str
    indices: Mapping[str, IndexValue]
    parameters: tuple[str, ...]
    dimension: str
    deviation: Interval | None = None
    above_zero: bool = False
    share: float = 0.0
    alike: tuple[str, ...] = ()
    units_needed: int | None = None
    tolerance: str = ""
    capability: float | None = None
    capability_centred: float | None = None


@dataclass(frozen=True)
class Shift:
    """A systematic error: a mean that all units share, or by which some differ from the others.

    Attributes
    ----------
    key : str
    indices : mapping of str to int or str
        Of the part; of several that are shifted alike, what they have in common.
    parameter : str
    dimension : str
    size : Interval
    """

    key: str
    indices: Mapping[str, IndexValue]
    parameter: str
    dimension: str
    size: Interval


def sizes_of(shifts: Iterable[Shift], key: str, indices: Mapping[str, IndexValue]) -> dict[str, float]:
    """Sizes of those systematic errors that all parts of a process share, by parameter, core units."""
    return {one.parameter: one.size.value for one in shifts if (one.key, one.indices) == (key, indices)}


@dataclass(frozen=True)
class Outsider:
    """A unit that is no member of the lot.

    Attributes
    ----------
    serial : str
    distance : float
        Squared standard deviations by which it is off along its cause; twice the logarithm of the cause's odds where
        the unit's own equilibrium tells it.
    chance : float
        How often a member of the lot is as far off, any cause of any unit.
    causes : tuple of Shift
        The error of one part that makes it so, a shift for each parameter.
    rivals : tuple of str
        Parts that would do it as well.
    diagnosis : Diagnosis or None
        Of its own runs with the lot's stiffness, for causes that are no error of one part.
    """

    serial: str
    distance: float
    chance: float
    causes: tuple[Shift, ...]
    rivals: tuple[str, ...] = ()
    diagnosis: Diagnosis | None = field(default=None, repr=False)


@dataclass(frozen=True)
class Difference:
    """Units of a label that differ from the others.

    Attributes
    ----------
    label, value : str
        Such as machine, B.
    units : int
        That have it.
    chance : float
        How often units that do not differ show as much, over all labels, values and sources.
    causes : tuple of Shift
        One for each parameter of the source.
    rivals : tuple of str
        What would do it as well.
    """

    label: str
    value: str
    units: int
    chance: float
    causes: tuple[Shift, ...]
    rivals: tuple[str, ...] = ()


@dataclass(frozen=True)
class Change:
    """A mean that changes over the serial numbers.

    Attributes
    ----------
    since : str
        Serial number from which on.
    since_interval : tuple of str
        Serial numbers between which it begins, at 95 %.
    course : str
        ``"step"``, or ``"ramp"`` of which the size is that at the last unit.
    chance : float
        How often units in any order show as much.
    cause : Shift
    rivals : tuple of str
    """

    since: str
    since_interval: tuple[str, str]
    course: str
    chance: float
    cause: Shift
    rivals: tuple[str, ...] = ()


@dataclass(frozen=True)
class Predicted:
    """Peak-to-peak error of the units to come, under one condition.

    Attributes
    ----------
    condition : str
    mean : float
        rad.
    quantile : Interval
        Which 95 % stay below, rad.
    seen : tuple of float
        Mean and 95 % quantile of the measured units, rad, noise included, less differences and changes that are named.
    """

    condition: str
    mean: float
    quantile: Interval
    seen: tuple[float, float]


@dataclass(frozen=True)
class Lot(Viewed):
    """Result of `lot`.

    Attributes
    ----------
    model : str
        Name of the unit.
    units : int
        That were used.
    conditions : tuple of str
    processes : tuple of MadeBy
        The largest share first; those that do not show last.
    means : tuple of Shift
        Systematic errors, told from none or not: of all parts of a process together, and of single parts where they
        are few.
    shifts : tuple of Shift
        Those that are told from none, at 5 % of all of them together.
    stiffness : mapping of str to Interval
        Of what the model states, as ratio.
    outsiders : tuple of Outsider
    differences : tuple of Difference
    changes : tuple of Change
    predicted : tuple of Predicted
        For each condition.
    chance : float
        How often a lot of such processes is as far from what they make; below 0.001 the model lacks something.
    orders, amplitudes, made : ndarray
        Orders, root mean squares of the units' amplitudes about their mean, rad, shape (conditions, orders), and the
        same of units that the processes make.
    notes : tuple of str
        What was left out, and what is to be doubted.
    marked : bool
        Whether marks are known; else nothing is told of means: of systematic errors, groups and changes.
    """

    model: str
    units: int
    conditions: tuple[str, ...]
    processes: tuple[MadeBy, ...]
    means: tuple[Shift, ...]
    shifts: tuple[Shift, ...]
    stiffness: Mapping[str, Interval]
    outsiders: tuple[Outsider, ...]
    differences: tuple[Difference, ...]
    changes: tuple[Change, ...]
    predicted: tuple[Predicted, ...]
    chance: float
    orders: Array = field(default_factory=lambda: np.empty(0), repr=False)
    amplitudes: Array = field(default_factory=lambda: np.empty((0, 0)), repr=False)
    made: Array = field(default_factory=lambda: np.empty((0, 0)), repr=False)
    notes: tuple[str, ...] = ()
    marked: bool = True
