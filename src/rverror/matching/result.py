"""What matching found: units with their parts and errors, what is left, and what each way gains."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rverror.base.arrays import Array
from rverror.base.viewed import OneLine, Viewed
from rverror.matching.at_load import Quantity
from rverror.model.effects import Model


@dataclass(frozen=True)
class MountedPart:
    """A part at its place of a unit."""

    kind: str
    place: int | None  #: which crank, planet, disc or groove
    serial: str
    turn: int = 0  #: pitches of its bores by which a disc is turned counter-clockwise, teeth of a sun


@dataclass(frozen=True)
class MatchedUnit:
    """A unit to be built.

    Attributes
    ----------
    parts : tuple of MountedPart
    model : Model
        With the errors of its parts.
    turns : tuple of float
        rad; of each quantity that is limited, by the equilibrium at the load.
    chance : float
        That the unit is within all limits, as its parts' sizes are known within their uncertainty.
    """

    parts: tuple[MountedPart, ...]
    model: Model
    turns: tuple[float, ...]
    chance: float = 1.0


@dataclass(frozen=True)
class WayToBuild(OneLine):
    """What one way to put the same parts together gives.

    Attributes
    ----------
    name : str
    turns : ndarray, shape (units, quantities)
        rad, by the equilibrium at the load; infinite where none was found.
    errors : ndarray, shape (units,)
        Largest of a unit's quantities, each over its limit, by the measured sizes of its parts.
    outcomes : ndarray, shape (units, draws)
        The same with the sizes drawn within their uncertainty; one draw where all are exact.
    cost : float, optional
        Of the way, for each unit that is tried.
    """

    name: str
    turns: Array
    errors: Array
    outcomes: Array
    cost: float | None = None

    @property
    def chances(self) -> Array:
        """That each unit is within all limits."""
        return np.asarray((self.outcomes <= 1).mean(axis=1))

    @property
    def share(self) -> float:
        """Yield: units within all limits that are expected, of those that the parts allow."""
        return float(self.chances.mean())

    @property
    def p95(self) -> float:
        """Error over the limit that 95 % of the units do not exceed."""
        return float(np.quantile(self.outcomes, 0.95, method="higher"))


@dataclass(frozen=True)
class Matched(Viewed):
    """Which parts to join.

    Attributes
    ----------
    model : str
        Name of the unit, for people.
    quantities : tuple of Quantity
        What is limited.
    allowed : tuple of float
        rad; the limit of each.
    units : tuple of MatchedUnit
        Those within all limits by the measured sizes, and more likely so than not with their uncertainty.
    left : mapping of str to tuple of str
        Serial numbers of the parts that stay, by kind.
    possible : int
        Units that the numbers of parts allow.
    bound : int
        Units within the limits that no assembly of these parts can exceed, by the linear influences.
    ways : tuple of WayToBuild
        At random, in three classes, matched, and those that turns and rollers add.
    doubt : float
        Standard deviation of true errors about the linear ones, over the limit.
    notes : tuple of str
    """

    model: str
    quantities: tuple[Quantity, ...]
    allowed: tuple[float, ...]
    units: tuple[MatchedUnit, ...]
    left: Mapping[str, tuple[str, ...]]
    possible: int
    bound: int
    ways: tuple[WayToBuild, ...]
    doubt: float
    notes: tuple[str, ...] = ()

    @property
    def share(self) -> float:
        """Yield: units of the list within all limits that are expected, of those that the parts allow."""
        return sum(unit.chance for unit in self.units) / self.possible
