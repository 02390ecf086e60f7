"""What every kind of result says of itself, once: its table of variables, of which report and JSON are made.

Each kind registers its table where it is described; `kinds` knows all of them.  A kind whose report or JSON holds more
registers these as well.
"""

from __future__ import annotations

import hashlib
import math
import os
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import singledispatch
from typing import Any

import numpy as np

from rverror.base.errors import InputError
from rverror.base.numbers import brief, way
from rverror.base.text import read_bytes
from rverror.base.version import __version__
from rverror.views.blocks import Ends, Sentence, Sheet, Title, as_text, facts, grid, line, section
from rverror.views.html import shipped
from rverror.views.shown_units import PERCENT, unit_for_people
from rverror.views.variables import LONG, Table, columns as columns_along

_COURSES = LONG | {"speed"}  # dimensions along which a result runs: some of its rows tell it
_SOME = 20
_SHARE_DIGITS = 2  # decimals of a share in percent, digits of a p-value
_ROUNDING = 1e-12  # of the largest of a column, below which a number is the rounding of zero
_WORDING = tomllib.loads(shipped("words.toml"))  # names and headings as people write them
_WORDS = ("held_by", "moves", "part", "verdict")  # columns of words that the model file joins by underscores


def table(result: Any, **options: Any) -> Table:
    """Description of a result as variables along named dimensions."""
    made = described(result, **options)
    return replace(made, kind=made.kind or type(result).__name__, rows=made.rows or made.dims[0])


@singledispatch
def described(result: Any, /, **options: Any) -> Table:
    """What a kind registers of `table`."""
    kinds = sorted(kind.__name__ for kind in described.registry if kind is not object)
    raise InputError(f"{type(result).__name__}: no table is made of it; give one of {', '.join(kinds)}")


@singledispatch
def sheet(result: Any, /, **options: Any) -> Sheet:
    """Report of a result: of its table, unless its kind says more."""
    return sheet_of(table(result, **options))


@singledispatch
def content(result: Any, /, **options: Any) -> dict[str, Any]:
    """Plain data of a result for JSON: of its table, with the keys that its kind has beside."""
    return {**content_of(table(result)), **entries(result, **options)}


@singledispatch
def entries(result: Any, /) -> dict[str, Any]:
    """Keys of JSON that a kind registers beside its table."""
    return {}


def content_of(result_table: Table) -> dict[str, Any]:
    """Plain data of a table: each variable with its dimensions, unit and values."""
    variables = {
        name: {
            "dimensions": list(variable.dims),
            "units": variable.units_shown(),
            "values": _plain(variable.shown(display=True).tolist()),
        }
        for name, variable in result_table.variables.items()
    }
    return {**_plain(dict(result_table.about)), "variables": variables, "result": result_table.kind}


def _plain(value: Any) -> Any:
    """Value of which JSON holds every part; what is not determined is None."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


# --- a report of a table ----------------------------------------------------------------------------------------------


def sheet_of(result_table: Table) -> Sheet:
    """Report of a table: its single numbers, its rows along one dimension after another, what was noticed."""
    strong, rest = result_table.verdict
    blocks = (
        Title(kind_in_words(result_table), tuple(filter(None, result_table.title))),
        *((Sentence(rest, strong),) if strong else ()),
        *facts({**_single_numbers(result_table), **result_table.facts}),
        *listed(result_table, result_table.rows),
        *(one if isinstance(one, Sentence) else Sentence(one) for one in result_table.sentences),
    )
    sections: Sheet = ()
    for dim in result_table.dims:
        if dim != result_table.rows and dim not in LONG:
            heading = _WORDING["headings"].get(dim, _words(dim).capitalize())
            remarks = result_table.remarks.get(dim, ())
            sections += section(heading, *listed(result_table, dim), *line(*remarks))
    return (
        *blocks,
        *line(_COUNTED if strong and re.search(_INDEX, as_text(blocks + sections)) else ""),
        *sections,
        *section("Notes", *line(*str(result_table.about.get("notes", "")).split("\n"))),
    )


def _single_numbers(result_table: Table) -> dict[str, str]:
    """Numbers that have no dimension, with their units; the ends of an interval in brackets behind what it is of."""
    shown = {name: of.shown(display=True).item() for name, of in result_table.variables.items() if not of.dims}
    facts_of = {}
    for name in result_table.shown.get("", [name for name in shown if not name.endswith(("_low", "_high"))]):
        base = name.removesuffix("_value")
        unit = unit_for_people(result_table.variables[name].unit_text(display=True))
        value, ends = brief(shown[name]), ""
        if f"{base}_low" in shown:
            value, ends = interval_words(shown[name], shown[f"{base}_low"], shown[f"{base}_high"])
        facts_of[_words(base)] = f"{value} {unit}" + f" ({ends})" * bool(ends)
    return facts_of


def kind_in_words(result_table: Table) -> str:
    """Kind of a result as people read it.

    Examples
    --------
    >>> kind_in_words(Table({}, kind="OrderTable"))
    'Order table'
    """
    return _words(re.sub(r"(?<=[a-z])([A-Z])", r" \1", result_table.kind).capitalize())


def listed(result_table: Table, dim: str) -> Sheet:
    """Columns of the rows along a dimension under their names and units, the ends of an interval as one."""
    arrays, units = columns_along(result_table, rows=dim, display=True)
    if set(arrays) <= {dim}:
        return ()
    for own in set(arrays) - set(units):  # units of the rows
        arrays[own] = list(map(unit_for_people, arrays[own]))
    arrays = {name: _readable(name, values, units.get(name, "")) for name, values in arrays.items()}
    columns = _with_intervals({name: values.tolist() for name, values in arrays.items()})
    chosen = [name for name in result_table.shown.get(dim, columns) if any(map(_is_known, columns.get(name, ())))]
    count = len(columns[chosen[0]]) if chosen else 0
    places = list(range(count))
    if dim in _COURSES and count > _SOME:
        places = sorted({round(at * (count - 1) / (_SOME - 1)) for at in range(_SOME)})
    heads = [", ".join(filter(None, (_words(name), unit_for_people(units.get(name, ""))))) for name in chosen]
    links = result_table.links if dim == result_table.rows else ()
    rest = line(f"{len(places)} of {count} rows." if len(places) < count else "")
    return (*grid(heads, [[columns[name][at] for name in chosen] for at in places], links), *rest)


def _readable(name: str, values: Any, unit: str) -> Any:
    """Values of a column as people read them: a share or a rounding of nothing as 0, words without underscores."""
    values = np.asarray(values)
    if name == "direction" and values.dtype.kind == "f":
        return np.array([way(value) for value in values])
    if name in _WORDS:
        return np.array([text.replace("_", " ") for text in values])
    if values.dtype.kind != "f":
        return values
    if unit == PERCENT.shown:
        return np.round(values, _SHARE_DIGITS)
    if name.endswith("chance"):
        return np.array([float(f"{value:.{_SHARE_DIGITS}g}") for value in values])
    return np.where(np.abs(values) < _ROUNDING * np.abs(values[np.isfinite(values)]).max(initial=0.0), 0.0, values)


def _with_intervals(columns: Mapping[str, list[Any]]) -> dict[str, list[Any]]:
    """Columns in which the ends of an interval are one, behind what it is of; values keep the digits that it leaves."""
    joined: dict[str, list[Any]] = {}
    before = list(columns)[: list(columns).index("low")] if "low" in columns else []
    owner = "value" if "value" in before else next(iter(before[::-1]), "")  # bare ends are of what they follow
    for name, values in columns.items():
        of = "" if name == owner else f"{name}_"
        if f"{of}low" in columns:
            each = [_rounded(*row) for row in zip(values, columns[f"{of}low"], columns[f"{of}high"], strict=True)]
            joined[name] = [value for value, *_ in each]
            if any(map(_is_known, values)):
                joined[f"{of}interval"] = [Ends(ends) for _, *ends in each]
        elif name.split("_")[-1] not in ("low", "high"):
            joined[name] = values
    return joined


def _rounded(value: float, low: float, high: float) -> list[float]:
    """Value and interval to two digits of the interval's width, of twice its known half where the other has no end."""
    known = [end for end in (low, high) if math.isfinite(end)]
    width = high - low if len(known) == 2 else max((2 * abs(value - end) for end in known), default=math.nan)
    if not (math.isfinite(width) and width > 0):
        return [value, low, high]
    digits = 1 - math.floor(math.log10(width))
    return [round(one, digits) if math.isfinite(one) else one for one in (value, low, high)]


def interval_words(value: float, low: float, high: float) -> tuple[str, str]:
    """Value and interval as people read them, to the digits that the interval leaves.

    Examples
    --------
    >>> interval_words(39.482, 33.28, math.inf), interval_words(30.171, 30.06, 30.26)
    (('39', '33 or more'), ('30.17', '30.06 to 30.26'))
    """
    shown, least, most = _rounded(value, low, high)
    return brief(shown), f"{brief(least)} or more" if math.isinf(most) else f"{brief(least)} to {brief(most)}"


def _is_known(value: Any) -> bool:
    return value not in (None, "") and not (isinstance(value, float) and math.isnan(value))


def _words(name: str) -> str:
    for written, spoken in _WORDING["names"].items():
        name = name.replace(written, spoken)
    return name.replace("_", " ")


_INDEX = r"\b(crank|disc) \d\b|\bpin \d"  # "crank 40" is a frame, the order of what is fixed in it
_COUNTED = "Cranks, discs and pins are counted from 0."


# --- where a result comes from ----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class InputFile:
    """A file that a result was made from: path as given, SHA-256 of its bytes, size."""

    path: str
    sha256: str
    bytes: int


def input_files(paths: Sequence[str | os.PathLike[str]]) -> tuple[InputFile, ...]:
    """Hash the files of a result, so that a report says what it was made from.

    Parameters
    ----------
    paths : sequence of str or path-like

    Returns
    -------
    tuple of InputFile

    Raises
    ------
    InputError
        If a file cannot be read.

    Examples
    --------
    >>> from importlib import resources
    >>> [file.bytes > 0 for file in input_files([resources.files("rverror") / "data" / "demo" / "model.toml"])]
    [True]
    """
    read = [(os.fspath(path), read_bytes(path)) for path in paths]
    return tuple(InputFile(path, hashlib.sha256(raw).hexdigest(), len(raw)) for path, raw in read)


def enveloped(told: Mapping[str, Any], files: Sequence[InputFile] = ()) -> dict[str, Any]:
    """`content` of a result, its kind first, with its input files and the version.

    Parameters
    ----------
    told : mapping
    files : sequence of InputFile

    Returns
    -------
    dict
    """
    listed = "files" if told["result"] == "Diagnosis" else "inputs"
    return {"result": told["result"], **told, listed: [asdict(file) for file in files], "version": __version__}
