"""A result as variables along named dimensions: what its tables, its JSON and its pages are made of."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.errors import InputError
from rverror.base.units import ARCSEC


@dataclass(frozen=True)
class Unit:
    """Core unit, unit for people, both in pint's notation, and how many of the first make one of the second."""

    core: str
    shown: str
    size: float = 1.0

    def text(self, *, display: bool) -> str:
        """Its name, for people or of the core."""
        return self.shown if display else self.core


NUMBER = Unit("dimensionless", "dimensionless")
PERCENT = Unit("dimensionless", "percent", 0.01)
POSITION = Unit("rad", "deg", math.radians(1))
ANGLE = Unit("rad", "arcsec", ARCSEC)
SQUARE = Unit("rad**2", "arcsec**2", ARCSEC**2)
LENGTH = Unit("mm", "um", 1e-3)
SIZE = Unit("mm", "mm")
TORQUE = Unit("N*mm", "N*m", 1e3)
FORCE = Unit("N", "N")
STIFFNESS = Unit("N/mm", "N/mm")
TIME = Unit("s", "s")
TEMPERATURE = Unit("kelvin", "kelvin")
SPEED = Unit("rad/s", "rpm", math.pi / 30)
HERTZ = Unit("Hz", "Hz")
HOURS = Unit("h", "h")
VOLUME = Unit("mm**3", "mm**3")
WATT = Unit("N*mm/s", "W", 1e3)

#: Dimensions that are too long to stand side by side as columns.
LONG = frozenset({"theta", "sample", "virtual_unit"})


def unit_of(dimension: str) -> Unit:
    """Unit of an error of that dimension, a key of `units.CORE_UNITS`."""
    shown = units.DISPLAY_UNITS[dimension]
    return Unit(units.CORE_UNITS[dimension], shown, units.unit_factor(shown, dimension))


PRESSURE = unit_of("pressure")


@dataclass(frozen=True)
class Each:
    """Units of a variable whose rows have units of their own, and the variable that tells them."""

    name: str
    units: tuple[Unit, ...]

    def texts(self, *, display: bool) -> list[str]:
        """Their names."""
        return [unit.text(display=display) for unit in self.units]


@dataclass(frozen=True)
class Variable:
    """Values along named dimensions.

    Attributes
    ----------
    dims : tuple of str
    values : array_like
        Core units.
    unit : Unit or Each, optional
        None for text; the rows of an `Each` are the first dimension.
    bare : bool
        Whether a column that it makes is named by its place alone.
    """

    dims: tuple[str, ...]
    values: Any
    unit: Unit | Each | None = None
    bare: bool = False

    def shown(self, *, display: bool) -> Any:
        """Values in core units, or in those for people."""
        values = np.array(self.values)
        if self.unit is None:
            return values if values.size else values.astype(str)
        if not display:
            return values
        if isinstance(self.unit, Unit):
            return values if self.unit.size == 1 else values / self.unit.size
        sizes = np.array([unit.size for unit in self.unit.units])
        return values / sizes.reshape(-1, *[1] * (values.ndim - 1))

    def spreads(self, rows: str) -> bool:
        """Whether it makes columns along one of its dimensions: not too many of them."""
        return rows in self.dims and not LONG & set(self.dims) - {rows}

    def units_shown(self) -> str | list[str]:
        """Unit for people: one, or one a row where these differ; empty for text."""
        return self.unit.texts(display=True) if isinstance(self.unit, Each) else self.unit_text(display=True)

    def unit_text(self, row: Any = None, *, display: bool) -> str:
        """Unit of all values, or of one row; empty for text, and where rows differ."""
        unit = self.unit
        if isinstance(unit, Each):
            unit = unit.units[row] if isinstance(row, int) else None
        return unit.text(display=display) if unit else ""


@dataclass(frozen=True)
class Table:
    """What a result holds.

    Attributes
    ----------
    kind : str
    rows : str
        Dimension of the rows of its DataFrame.
    variables : mapping of str to Variable
        By name; one that has the name of a dimension labels it.
    about : mapping of str to str, number or mapping
        Where it comes from.
    labels : frozenset of str
        Variables that tell where values belong: coordinates.
    """

    kind: str
    rows: str
    variables: Mapping[str, Variable]
    about: Mapping[str, Any] = field(default_factory=dict)
    labels: frozenset[str] = frozenset()

    @property
    def dims(self) -> tuple[str, ...]:
        """Every dimension that can be the rows of a table."""
        found = (dim for variable in self.variables.values() for dim in variable.dims if variable.spreads(dim))
        return tuple(dict.fromkeys(found))


def columns(table: Table, *, rows: str = "", display: bool = False) -> tuple[dict[str, Any], dict[str, str]]:
    """Variables along one dimension as columns.

    Parameters
    ----------
    table : Table
    rows, display
        As for `to_pandas`.

    Returns
    -------
    columns, units : dict
        Arrays, and the unit of each; empty for text and where the rows have units of their own.

    Raises
    ------
    InputError
        If there is no such dimension, or two columns would have one name.
    """
    chosen = rows or table.rows
    if chosen not in table.dims:
        raise InputError(f"rows = {rows!r}: a {table.kind} has no such rows; give one of {', '.join(table.dims)}")
    found: dict[str, Any] = {}
    told: dict[str, str] = {}
    for name, variable in table.variables.items():
        if not variable.spreads(chosen):
            continue
        values = variable.shown(display=display)
        for column, place in _places(table, name, chosen):
            if column in found:
                raise InputError(f"{table.kind}: two columns have the name {column!r}; rename one, or use to_xarray")
            found[column], told[column] = values[place], variable.unit_text(place[0], display=display)
        if isinstance(variable.unit, Each) and variable.dims[0] == chosen:
            found[variable.unit.name.removeprefix(f"{chosen}_")] = variable.unit.texts(display=display)
    return found, told


def _places(table: Table, name: str, rows: str) -> Iterator[tuple[str, tuple[Any, ...]]]:
    """Name and place of each column that a variable makes."""
    variable = table.variables[name]
    short = [] if variable.bare else [name.removeprefix(f"{rows}_")]
    shape = np.shape(variable.values)
    others = [(dim, size) for dim, size in zip(variable.dims, shape, strict=True) if dim != rows]
    for chosen in itertools.product(*(range(size) for _, size in others)):
        at = iter(chosen)
        place = tuple(slice(None) if dim == rows else next(at) for dim in variable.dims)
        words = [str(_label(table, dim, i)) for (dim, _), i in zip(others, chosen, strict=True)]
        yield "_".join([*short, *words]), place


def _label(table: Table, dim: str, at: int) -> Any:
    return np.asarray(table.variables[dim].values)[at] if dim in table.variables else at
