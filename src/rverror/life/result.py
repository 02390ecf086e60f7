"""What runs of a unit over its life say: causes that grow, jumps, and how long it will meet a limit."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from rverror.base.arrays import Array
from rverror.base.viewed import Viewed
from rverror.geartrain.source import IndexValue
from rverror.lots.result import Interval


@dataclass(frozen=True)
class Grown:
    """A parameter of a cause that has changed.

    Attributes
    ----------
    name : str
    dimension : str
        A key of `units.CORE_UNITS`.
    change : Interval
        From the first session to the last, core unit.
    rate : Interval
        Per hour or cycle at the last session, core unit; 0 of a jump.
    """

    name: str
    dimension: str
    change: Interval
    rate: Interval


@dataclass(frozen=True)
class Changed:
    """A cause that grows, or that jumped between two sessions.

    Attributes
    ----------
    key : str
        A key of the catalogue.
    indices : mapping of str to int or str
        Of the part; of several that change alike, what they have in common.
    course : str
        ``"linear"``, ``"settling"`` or ``"step"``.
    since : float
        Time of the session from which on it grows, of a jump that of the first session with it, hours or cycles.
    earliest, latest : float
        Sessions between which `since` lies with 95 %.
    settling : float
        Time in which a growth that settles falls to a third, hours or cycles; 0 of others.
    parameters : tuple of Grown
    measuring : bool
        Whether it is of the measuring chain, no part of the unit.
    rivals : tuple of (str, tuple of (str, int or str))
        Keys and indices of causes that would do it as well, the nearest first.
    evidence : float
        By how much minus twice the logarithm of the posterior is lower with it.
    """

    key: str
    indices: Mapping[str, IndexValue]
    course: str
    since: float
    earliest: float
    latest: float
    settling: float
    parameters: tuple[Grown, ...]
    measuring: bool
    rivals: tuple[tuple[str, tuple[tuple[str, IndexValue], ...]], ...]
    evidence: float


@dataclass(frozen=True)
class Remaining:
    """How long a unit will meet a limit, if its causes go on as they do.

    Attributes
    ----------
    quantity : str
        ``"transmission_error"`` or ``"lost_motion"``.
    limit : float
        rad.
    now : float
        At the last session, rad.
    time : Interval or None
        Hours or cycles from the last session on, infinite where it is not reached; None where nothing that grows
        moves it.
    """

    quantity: str
    limit: float
    now: float
    time: Interval | None


@dataclass(frozen=True)
class Trend(Viewed):
    """Result of `trend`.

    Attributes
    ----------
    model : str
        Name of the unit.
    unit : str
        Of the time, ``"hour"`` or ``"cycle"``.
    at : ndarray, shape (sessions,)
        Times.
    conditions : tuple of str
        That all sessions have.
    changed : tuple of Changed
        Causes that grow or jumped, the most evident first.
    remaining : Remaining or None
        None where no limit was asked for.
    peak_to_peak : ndarray, shape (sessions, conditions)
        Of the error by its orders, rad.
    lost_motion : ndarray, shape (sessions, torques)
        Mean over a turn, at the torques that were measured in both directions with one zero, rad.
    explained : ndarray, shape (sessions, torques)
        Lost motion as the named causes make it, about the same mean.
    chance : float
        How often noise leaves as much as they do.
    notes : tuple of str
        What was left out, and what is to be doubted.
    """

    model: str
    unit: str
    at: Array
    conditions: tuple[str, ...]
    changed: tuple[Changed, ...]
    remaining: Remaining | None
    peak_to_peak: Array = field(repr=False)
    lost_motion: Array = field(repr=False)
    explained: Array = field(repr=False)
    chance: float = 1.0
    notes: tuple[str, ...] = ()

    @property
    def growing(self) -> tuple[Changed, ...]:
        """Causes that grow."""
        return tuple(one for one in self.changed if one.course != "step")

    @property
    def jumps(self) -> tuple[Changed, ...]:
        """Causes that jumped, of which nothing is known to grow."""
        return tuple(one for one in self.changed if one.course == "step")


@dataclass(frozen=True)
class OrderChange:
    """An order whose wave differs between two measurements.

    Attributes
    ----------
    order : int
        Waves per output turn.
    condition : str
    before, after : float
        Amplitudes, rad.
    interval : Interval
        Of the amplitude afterwards, rad.
    difference : float
        Amplitude of the wave by which they differ, rad.
    chance : float
        How often noise makes as much, any of all orders.
    """

    order: int
    condition: str
    before: float
    after: float
    interval: Interval
    difference: float
    chance: float


@dataclass(frozen=True)
class RunsCompared(Viewed):
    """Result of `compare_runs`.

    Attributes
    ----------
    conditions : tuple of str
        That both measurements have.
    orders : tuple of OrderChange
        That differ.
    changed : tuple of Changed
        Causes that make it so, where a model of a reducer was given.
    noise : float
        Of an order's amplitude, root mean square over orders, rad.
    notes : tuple of str
    """

    conditions: tuple[str, ...]
    orders: tuple[OrderChange, ...]
    changed: tuple[Changed, ...]
    noise: float
    notes: tuple[str, ...] = ()
