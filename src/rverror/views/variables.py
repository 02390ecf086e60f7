"""A result as variables along named dimensions: what its tables, its JSON and its pages are made of."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rverror.base.errors import InputError
from rverror.views.blocks import Sentence
from rverror.views.shown_units import Unit

#: Dimensions that are too long to be told in a report in full.
LONG = frozenset({"theta", "sample", "virtual_unit"})


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
    """

    dims: tuple[str, ...]
    values: Any
    unit: Unit | Each | None = None

    def shown(self, *, display: bool) -> Any:
        """Values in core units, or in those for people."""
        values = np.array(self.values)
        if self.unit is None:
            return values if values.size else values.astype(str)
        if not display:
            return values
        if isinstance(self.unit, Unit):
            return values if self.unit.shown == self.unit.core else self.unit.of(values)
        sizes = np.array([unit.size for unit in self.unit.units])
        return values / sizes.reshape(-1, *[1] * (values.ndim - 1))

    def units_shown(self) -> str | list[str]:
        """Unit for people: one, or one a row where these differ; empty for text."""
        return self.unit.texts(display=True) if isinstance(self.unit, Each) else self.unit_text(display=True)

    def unit_text(self, *, display: bool) -> str:
        """Unit of all values; empty for text, and where rows differ."""
        return self.unit.text(display=display) if isinstance(self.unit, Unit) else ""


@dataclass(frozen=True)
class Table:
    """What a result holds.

    Attributes
    ----------
    variables : mapping of str to Variable
        By name; one that has the name of a dimension labels it.
    about : mapping of str to str, number or mapping
        Where it comes from.
    title : tuple of str
        What the result is of, in a few words.
    verdict : tuple of str
        The outcome in a sentence: the words to be read first, and the rest.
    facts : mapping of str to str
        What people read beside the variables that are single numbers.
    sentences : tuple of str or Sentence
        To be read after the rows.
    remarks : mapping of str to sequence of str
        Sentences to be read after the rows along another dimension.
    shown : mapping of str to sequence of str
        Columns that people read of a dimension, of an empty name the single numbers; all where it is not named.
    rows : str
        Dimension of the rows of its DataFrame; that of the first column where left out.
    links : sequence of str
        Pages to which the rows along `rows` lead, relative to their own; empty for none.
    kind : str
        Name of the result's class, which `describing.table` adds, or of what stands in a row.
    """

    variables: Mapping[str, Variable]
    about: Mapping[str, Any] = field(default_factory=dict)
    title: tuple[str, ...] = ()
    verdict: tuple[str, str] = ("", "")
    facts: Mapping[str, str] = field(default_factory=dict)
    sentences: tuple[str | Sentence, ...] = ()
    remarks: Mapping[str, Sequence[str]] = field(default_factory=dict)
    shown: Mapping[str, Sequence[str]] = field(default_factory=dict)
    rows: str = ""
    links: Sequence[str] = ()
    kind: str = ""

    @property
    def dims(self) -> tuple[str, ...]:
        """Every dimension that can be the rows of a table."""
        return tuple(dict.fromkeys(variable.dims[0] for variable in self.variables.values() if len(variable.dims) == 1))


def columns(table: Table, *, rows: str = "", display: bool = False) -> tuple[dict[str, Any], dict[str, str]]:
    """Variables along one dimension alone as columns.

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
        If there is no such dimension.
    """
    chosen = rows or table.rows
    if chosen not in table.dims:
        raise InputError(f"rows = {rows!r}: a {table.kind} has no such rows; give one of {', '.join(table.dims)}")
    found: dict[str, Any] = {}
    unit_texts: dict[str, str] = {}
    for name, variable in table.variables.items():
        if variable.dims == (chosen,):
            column = name.removeprefix(f"{chosen}_")
            found[column], unit_texts[column] = variable.shown(display=display), variable.unit_text(display=display)
            if isinstance(variable.unit, Each):
                found[variable.unit.name.removeprefix(f"{chosen}_")] = variable.unit.texts(display=display)
    return found, unit_texts
