"""Fields of results, declared once: the values of a column, of an entry in JSON, of a column that people read.

A field is where its value stands and in which unit: ``ANGLE`` is the attribute of the field's own name,
``("mean.low", ANGLE)`` that of another, ``"condition"`` a text, a function what it makes of a row.  Numbers in a path
count places, as in ``"seen.0"``.  `OWN` is the unit of each row's own dimension.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from rverror.base.numbers import rounded
from rverror.base.text import printable
from rverror.views.blocks import in_words
from rverror.views.shown_units import NUMBER, PERCENT, Unit, unit_of
from rverror.views.variables import Each, Variable

#: Whole numbers, kept as such.
COUNT = Unit("dimensionless", "dimensionless")
#: Stands for the unit of a row's own dimension, and for the name of that unit.
OWN, OWN_NAME = Unit("own", "own"), Unit("own name", "own name")

Getter = str | Callable[[Any], Any]
Field = Unit | Getter | None | tuple[Getter, Unit | Each | None]


def value_at(row: Any, getter: Getter) -> Any:
    """Value of a row at a path of attributes, keys and places, None where a part of it is None.

    Examples
    --------
    >>> value_at((3 + 4j, "x"), "0.imag"), value_at((None, "x"), "0.imag")
    (4.0, None)
    """
    if callable(getter):
        return getter(row)
    for part in filter(None, getter.split(".")):
        if isinstance(row, Mapping):
            row = row.get(part)
        elif row is not None:
            row = row[int(part)] if part.isdigit() else getattr(row, part)
    return row


def _own(dimension: str | Unit) -> Unit:
    return dimension if isinstance(dimension, Unit) else unit_of(dimension)


def rows(
    dim: str, things: Iterable[Any], prefix: str = "", own: tuple[str, Getter] | None = None, /, **fields: Field
) -> dict[str, Variable]:
    """Variables along one dimension of things that stand in a row.

    Parameters
    ----------
    dim : str
    things : iterable
    prefix : str
        Of the variables' names.
    own : tuple of str and getter, optional
        Column of the units of `OWN`, and where a row has its dimension or unit.
    **fields
        Variables by name; None is not determined.
    """
    listed, made = list(things), {}
    units = Each(own[0], tuple(_own(value_at(row, own[1])) for row in listed)) if own else None
    for name, (getter, unit) in _each(fields):
        values: Any = [in_words(value_at(row, getter)) for row in listed]
        if unit is not None:
            values = np.array(values, dtype=int if unit is COUNT else np.float64)
        made[f"{prefix}{name}"] = Variable((dim,), values, units if unit is OWN else unit)
    return made


def arrays(dims: str, thing: Any, prefix: str = "", /, **fields: Field) -> dict[str, Variable]:
    """Variables of a thing that holds whole arrays; those that are None are left out.

    Parameters
    ----------
    dims : str
        Names of the dimensions with blanks between them; none of a single value.
    thing
    prefix : str
        Of the variables' names.
    **fields
        Variables by name; ``("", unit)`` is the thing itself.
    """
    made = {}
    for name, (getter, unit) in _each(fields):
        values = value_at(thing, getter)
        if unit is not None and dims and not isinstance(values, np.ndarray | None):
            values = np.array(list(values), dtype=np.float64)
        if values is not None:
            made[f"{prefix}{name}"] = Variable(tuple(dims.split()), values, unit)
    return made


def about(thing: Any, *names: str, **others: Any) -> dict[str, Any]:
    """Where a result comes from: attributes of it, several texts as lines of one, and what else is known."""
    found = {name: getattr(thing, name) for name in names}
    return {
        **others,
        **{name: "\n".join(map(printable, one)) if isinstance(one, tuple) else one for name, one in found.items()},
    }


def same_unit(unit: Unit | Each | None, *names: str, within: str = "") -> dict[str, Field]:
    """Fields of one unit, of the row itself or of a part of it."""
    return {name: (f"{within}{name}", unit) for name in names}


def sized(name: str, unit: Unit, path: str = "", value: str = "value") -> dict[str, Field]:
    """Fields of a value and of the ends of its interval."""
    return {f"{name}{end}": (f"{path}.{of}", unit) for end, of in (("", value), ("_low", "low"), ("_high", "high"))}


def _each(fields: Mapping[str, Field]) -> Iterator[tuple[str, tuple[Getter, Any]]]:
    """Names of fields, where the value of each stands, and its unit."""
    for name, field in fields.items():
        if field is None or isinstance(field, Unit):
            field = (name, field)
        yield name, field if isinstance(field, tuple) else (field, None)


def entry(row: Any, dimension: str | Unit = "", /, **fields: Field) -> dict[str, Any]:
    """Entry of JSON: numbers in the unit for people to six digits, an interval as its ends; None is not determined.

    Parameters
    ----------
    row
    dimension : str or Unit
        That of `OWN`.  Shares stay parts of 1.
    **fields
        By key.

    Examples
    --------
    >>> from rverror.views.shown_units import LENGTH
    >>> entry(3 + 4j, real=None, size=(abs, LENGTH))
    {'real': 3.0, 'size': 5000.0}
    """
    own = _own(dimension) if dimension else NUMBER
    made: dict[str, Any] = {}
    for key, (getter, unit) in _each(fields):
        chosen = {OWN: own, PERCENT: NUMBER}.get(unit, unit)
        made[key] = own.shown if unit is OWN_NAME else _plain(value_at(row, getter), chosen)
    return made


def _plain(value: Any, unit: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _plain(one, unit) for key, one in value.items()}
    if isinstance(value, tuple | list | np.ndarray):
        return [_plain(one, unit) for one in value]
    if value is None or unit is None:
        return value
    if hasattr(value, "low"):
        return [_plain(end, unit) for end in (value.low, value.high)]
    return rounded(unit.of(float(value)))
