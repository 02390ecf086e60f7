"""What every kind of result says of itself, once: its table of variables, its report, its JSON where keys are fixed.

Each kind registers these where it is described; `kinds` knows all of them.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Mapping, Sequence
from functools import singledispatch
from typing import Any

import numpy as np

from rverror.base.errors import InputError
from rverror.base.numbers import rounded
from rverror.views.blocks import Sheet, columns_of
from rverror.views.variables import NUMBER, Table, columns


@singledispatch
def table(result: Any) -> Table:
    """Description of a result as variables along named dimensions."""
    kinds = sorted(kind.__name__ for kind in table.registry if kind is not object)
    raise InputError(f"{type(result).__name__}: no table is made of it; give one of {', '.join(kinds)}")


@singledispatch
def sheet(thing: Any, **options: Any) -> Sheet:
    """Report of one kind of result; an `ErrorBudget` takes the `limit` at which its yield is told.

    Raises
    ------
    InputError
        If there is none of such a thing.
    """
    raise InputError(f"a {type(thing).__name__} has no sheet")


@singledispatch
def content(result: Any, /, **options: Any) -> dict[str, Any]:
    """Plain data of a result for JSON: of its table, unless its kind has keys of its own."""
    made = described(result, **options)
    variables = {
        name: {
            "dimensions": list(variable.dims),
            "units": variable.units_shown(),
            "values": _plain(variable.shown(display=True).tolist()),
        }
        for name, variable in made.variables.items()
    }
    return {**_plain(dict(made.about)), "variables": variables, "result": made.kind}


def _plain(value: Any) -> Any:
    """Value of which JSON holds every part; what is not determined is None."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def has_sheet(thing: Any) -> bool:
    """Whether `sheet` knows the kind of a thing."""
    return sheet.dispatch(type(thing)) is not sheet.dispatch(object)


def with_options(told: Any, result: Any, options: Mapping[str, Any]) -> Any:
    """What `table` or `sheet` tells of a result, if its kind takes the options.

    Raises
    ------
    InputError
        If it does not.
    """
    taken = list(inspect.signature(told.dispatch(type(result))).parameters)[1:]
    for name in options:
        if name not in taken:
            takes = f"it takes {', '.join(taken)}" if taken else "it takes none"
            raise InputError(f"{type(result).__name__}: no option {name!r}; {takes}")
    return told(result, **options)


def described(result: Any, /, **options: Any) -> Table:
    """Description of a result, from which every kind of table is made.

    Parameters
    ----------
    result, **options
        As for `to_xarray`.

    Returns
    -------
    Table

    Raises
    ------
    InputError
        If no table is made of such a result, or an option is not one of its.
    """
    found: Table = with_options(table, result, options)
    return found


# --- columns of a table in a report -----------------------------------------------------------------------------------


def shown(thing: Any, rows: str = "") -> tuple[dict[str, list[Any]], dict[str, str]]:
    """Columns of a result's table as people read them, and the unit of each; numbers have none."""
    found, told = columns(described(thing), rows=rows, display=True)
    listed = {name: np.asarray(values).tolist() for name, values in found.items()}
    if "unit" in listed:
        listed["unit"] = [_named(unit) for unit in listed["unit"]]
    return listed, {name: _named(unit) for name, unit in told.items()}


def _named(unit: str) -> str:
    return {NUMBER.core: "", "percent": "%"}.get(unit, unit)


def own_columns(
    thing: Any,
    *names: str,
    rows: str = "",
    heads: Mapping[str, str] | None = None,
    at: Sequence[int] | None = None,
) -> Sheet:
    """Columns of a result's table under their names and units.

    Parameters
    ----------
    thing
    *names : str
        All columns where none is named.
    rows : str
        As for `to_pandas`.
    heads : mapping of str to str, optional
        Other words for some names.
    at : sequence of int, optional
        Rows that are shown; all where left out.
    """
    found, told = shown(thing, rows)
    listed = {}
    for name in names or found:
        words = name.replace("peak_to_peak", "peak-to-peak").replace("_", " ")
        head, unit = (heads or {}).get(name, words), told.get(name, "")
        values = found[name]
        listed[f"{head}, {unit}" if unit else head] = values if at is None else [values[i] for i in at]
    return columns_of(listed)


def entries_of(thing: Any, names: Mapping[str, str]) -> list[dict[str, Any]]:
    """Entries of JSON: rows of a result's table as people read them, columns under other names."""
    found, _ = columns(described(thing), display=True)
    listed = zip(*(np.asarray(found[name]).tolist() for name in names.values()), strict=True)
    return [
        {key: rounded(value) if isinstance(value, float) else value for key, value in zip(names, row, strict=True)}
        for row in listed
    ]
