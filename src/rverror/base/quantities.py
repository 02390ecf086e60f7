"""Fields of dataclasses that are quantities: their unit, their bounds and how a file writes them, each said once."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError, refusing

COUNT = "count"  # in place of a dimension: a whole number


@dataclass(frozen=True)
class NumberField:
    """What a number must be.

    Parameters
    ----------
    dimension : str
        A key of `units.CORE_UNITS`, or ``"count"``.
    example : str
        As a model file writes it; a percentage where percentages are allowed.
    least, most : float
        Bounds in the core unit, allowed themselves.
    above : float
        Bound that is not.
    remedy : str
        Said behind the bounds.
    """

    dimension: str
    example: str = ""
    least: float = -math.inf
    most: float = math.inf
    above: float = -math.inf
    remedy: str = ""

    def core(self, name: str, value: Any) -> float:
        """Value in the core unit.

        Raises
        ------
        ValueError
            If it is out of bounds, in a line that begins with the name.
        """
        if self.dimension == COUNT and (isinstance(value, bool) or not isinstance(value, int)):
            raise ValueError(f"{name} = {value!r}: must be a whole number, {self._bounds()}")
        size: float = value if self.dimension == COUNT else units.named_core(name, value, self.dimension)
        if not (self.least <= size <= self.most and size > self.above):
            raise ValueError(f"{name} = {self._shown(size)}: must be {self._bounds()}{self.remedy}")
        return size

    def _shown(self, size: float) -> str:
        """As people read it; sizes of parts in mm."""
        if self.dimension in ("number", COUNT):
            return f"{size:g}"
        if self.dimension == "length":
            return f"{size:g} mm"
        return f"{units.to_display(size, self.dimension):g} {units.DISPLAY_UNITS[self.dimension]}"

    def _bounds(self) -> str:
        if self.most < math.inf:
            return f"from {self._shown(self.least)} to {self._shown(self.most)}"
        return f"above {self.above:g}" if self.above > -math.inf else f"{self.least:g} or more"


def quantity(dimension: str, example: str = "", **bounds: Any) -> dict[str, NumberField]:
    """Metadata of a field that is a quantity; parameters as of `NumberField`.

    Examples
    --------
    >>> quantity("length", above=0.0)["quantity"].core("width", "5 um")
    0.005
    """
    return {"quantity": NumberField(dimension, example, **bounds)}


def quantities(kind: Any) -> Mapping[str, NumberField]:
    """Fields of a dataclass that are quantities, by name."""
    return {item.name: item.metadata["quantity"] for item in fields(kind) if "quantity" in item.metadata}


@dataclass(frozen=True)
class Checked:
    """Base of frozen dataclasses whose quantities are converted to core units and checked; None stays if allowed."""

    def __post_init__(self) -> None:
        """Convert and check."""
        for item in fields(self):
            value = getattr(self, item.name)
            if "quantity" in item.metadata and not (value is None and item.default is None):
                object.__setattr__(self, item.name, item.metadata["quantity"].core(item.name, value))

    def given(self) -> dict[str, float]:
        """Values of its quantities that are not those of one of which nothing is said."""
        held = ((item, getattr(self, item.name)) for item in fields(self) if "quantity" in item.metadata)
        return {item.name: value for item, value in held if value is not None and value != item.default}


def above_zero(name: str, value: Any, dimension: str) -> float:
    """Size in the core unit, refused where it is not above 0."""
    return NumberField(dimension, above=0.0).core(name, value)


def row(name: str, values: Any, dimension: str) -> Array:
    """Values in a row, in the core unit; each may have a unit of its own, and a single one is a row of one.

    Raises
    ------
    InputError
        If they are no row, or have no such unit.
    """
    with refusing(f"{name}: "):
        if isinstance(values, Sequence) and not isinstance(values, str):
            found = np.array([units.to_core(one, dimension) for one in values], dtype=np.float64)
        else:
            found = np.atleast_1d(units.to_core_array(values, dimension))
    if found.ndim != 1 or not found.size:
        raise InputError(f"{name}: the shape is {found.shape}; give a row")
    return found
