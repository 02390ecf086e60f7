"""Any result as text, as plain data for JSON, as a page: one function each, one entry a kind that has its own.

What has no entry is told by its sheet or its table, so a new kind of result is told as soon as it has these.
"""

from __future__ import annotations

import csv
import importlib.util
import io
import math
from collections.abc import Mapping, Sequence
from functools import singledispatch
from typing import Any

from rverror.base.errors import InputError
from rverror.base.text import printable
from rverror.base.viewed import Viewed
from rverror.compensation.outcome import Compensation
from rverror.diagnosis.result import Diagnosis
from rverror.dynamics.at_speed import SpeedResponse
from rverror.dynamics.natural_modes import Modes
from rverror.life.result import RunsCompared, Trend
from rverror.lots.result import Lot
from rverror.matching.result import Matched
from rverror.tolerances.allocation import Allocation
from rverror.tolerances.closed_form import Budget
from rverror.tolerances.full_budget import ErrorBudget
from rverror.views.budget_page import allocation_html, budget_html
from rverror.views.budget_report import allocation_json, allocation_text, budget_json, budget_text
from rverror.views.compensation_report import compensation_html, compensation_json
from rverror.views.diagnosis_report import diagnosis_html, diagnosis_json, diagnosis_text
from rverror.views.dynamics_report import modes_json, speeds_json
from rverror.views.envelope import InputFile, enveloped
from rverror.views.html import document, escaped_lines, inputs
from rverror.views.kinds import described
from rverror.views.life_report import compared_json, trend_json
from rverror.views.lot_report import lot_html, lot_json, lot_text
from rverror.views.notebook import page
from rverror.views.plots.figure import svg_element
from rverror.views.sheets import as_text, has_sheet, sheet
from rverror.views.variables import NUMBER, columns


@singledispatch
def to_text(result: Any, /, **options: Any) -> str:
    """Result as text.

    Parameters
    ----------
    result
        A Diagnosis, Lot, Compensation, Budget, ErrorBudget, VirtualUnits, Allocation, Comparison,
        Equilibrium, TorsionCurve, Hysteresis, Efficiency, DutyEfficiency, ContactPressure, Wear, Modes, SpeedResponse,
        RunUp, Influence, Model, Effect, Reducer, Drive, Run, OrderTable, Stack or Tolerance; a list or tuple of Effect,
        Tolerance, FrontPoint or Efficiency.
    **options
        A Diagnosis and a Lot take their `files` (see `input_files`), an ErrorBudget the `limit`, rad or with a unit, at
        which its yield is told, a Comparison how many orders are told, `most`.

    Returns
    -------
    str
        Angles in arcsec.  Ends with a line end; characters that cannot be printed show as their escapes.

    Raises
    ------
    InputError
        If there is no text of such a result, or it takes no such option.

    Examples
    --------
    >>> import rverror
    >>> print(to_text(rverror.effect("crank.index", crank=0, angle="1 arcmin")))
    Effect: crank.index (crank 0)
    <BLANKLINE>
    parameter  size  1 sigma  unit
    angle        60  exact    arcsec
    <BLANKLINE>
    """
    if not has_sheet(result):
        known = {kind.__name__ for of in (to_text, sheet) for kind in of.registry} - {"object"}
        raise InputError(f"a {type(result).__name__} has no text; these have: {', '.join(sorted(known))}")
    _check_no(options, result)
    return as_text(sheet(result))


@singledispatch
def to_json(result: Any, /, *, files: Sequence[InputFile] = (), **options: Any) -> dict[str, Any]:
    """Result as plain data for `json.dump`; keys are only ever added.

    Parameters
    ----------
    result
        Whatever `to_text` or `to_pandas` takes.
    files : sequence of InputFile, optional
        What it was made from: see `input_files`.
    **options
        As for `to_text` or, of what is told by its table, for `to_xarray`.

    Returns
    -------
    dict
        Sizes in arcsec and um, numbers that are not determined None.  ``result`` is the name of its class, ``version``
        that of rverror.  Keys of a torque ripple end in ``newton_metre`` instead of ``arcsec``.  What is told by its
        table has its ``variables``, each with its dimensions, unit and values.

    Raises
    ------
    InputError
        If no table is made of such a result.

    Examples
    --------
    >>> import rverror
    >>> told = to_json(rverror.effect("crank.index", crank=0, angle="1 arcmin"))
    >>> told["result"], told["variables"]["value"]["values"], told["variables"]["value"]["units"]
    ('Effect', [60.0], ['arcsec'])
    """
    table = described(result, **options)
    variables = {
        name: {
            "dimensions": list(variable.dims),
            "units": variable.units_shown(),
            "values": _plain(variable.shown(display=True).tolist()),
        }
        for name, variable in table.variables.items()
    }
    return enveloped(table.kind, {**_plain(dict(table.about)), "variables": variables}, files)


def _plain(value: Any) -> Any:
    """Value of which JSON holds every part; what is not determined is None."""
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@singledispatch
def to_html(result: Any, /, **options: Any) -> str:
    """Result as one HTML page that needs nothing else: no script, no network, no library for its pictures.

    Parameters
    ----------
    result
        Whatever `to_text` takes.
    **options
        A Diagnosis takes its `files`; so do a Lot, an Allocation and an ErrorBudget, which takes its `limit` too, and a
        Compensation, which takes the `table` that was written of it.

    Returns
    -------
    str

    Raises
    ------
    InputError
        If there is no page of such a result, or it takes no such option.

    Examples
    --------
    >>> import rverror
    >>> to_html(rverror.reducer("RV-40E")).startswith("<!doctype html>")
    True
    """
    _check_no(options, result)
    body = page(result) if has_sheet(result) else f"<pre>{escaped_lines(to_text(result))}</pre>"
    return document(f"rverror: {type(result).__name__}", body)


def _pictured(result: Viewed, *, files: Sequence[InputFile] = ()) -> str:
    """Page with the usual picture, where matplotlib is installed, and the files that it was made from."""
    body, told = [page(result)], to_json(result, files=files)
    if importlib.util.find_spec("matplotlib"):
        body.append(f"<figure>{svg_element(result.plot().figure)}</figure>")  # type: ignore[arg-type]
    body.append(inputs(told["inputs"], told["version"]))
    return document(f"rverror: {type(result).__name__}", "\n".join(body))


def to_csv(result: Any, /, *, rows: str = "", units: bool = False) -> str:
    """Result as comma-separated text for a spreadsheet, a row for each of what `to_pandas` has as rows.

    Parameters
    ----------
    result
        Whatever `to_pandas` takes.
    rows : str, optional
        As for `to_pandas`.
    units : bool
        Whether the name of a column tells its unit.

    Returns
    -------
    str
        Sizes in arcsec and um; empty where they are not determined.

    Raises
    ------
    InputError
        If no table is made of such a result, or it has no such rows.

    Examples
    --------
    >>> import rverror
    >>> print(to_csv(rverror.effect("crank.index", crank=0, angle="1 arcmin")), end="")
    number,key,indices,parameter,value,unit,uncertainty,origin
    0,crank.index,crank 0,angle,60,arcsec,,
    """
    found, told = columns(described(result), rows=rows, display=True)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    tagged = {name for name in found if units and told.get(name, "") not in ("", NUMBER.core)}
    writer.writerow([f"{name} [{told[name]}]" if name in tagged else name for name in found])
    for row in zip(*found.values(), strict=True):
        writer.writerow([_csv_cell(value) for value in row])
    return text.getvalue()


def _csv_cell(value: Any) -> str:
    plain = value.item() if hasattr(value, "item") else value
    if isinstance(plain, float):
        return "" if math.isnan(plain) else f"{plain:.6g}"
    if isinstance(plain, bool):
        return "yes" if plain else "no"
    return printable(str(plain))


def _check_no(options: Mapping[str, Any], result: Any) -> None:
    for name in options:
        raise InputError(f"{type(result).__name__}: no option {name!r}; it takes none")


for _kind, _text, _json in (
    (Diagnosis, diagnosis_text, diagnosis_json),
    (Budget, budget_text, budget_json),
    (ErrorBudget, budget_text, budget_json),
    (Allocation, allocation_text, allocation_json),
    (Lot, lot_text, lot_json),
):
    to_text.register(_kind, _text)
    to_json.register(_kind, _json)
to_html.register(Diagnosis, diagnosis_html)
to_html.register(ErrorBudget, budget_html)
to_html.register(Allocation, allocation_html)
to_html.register(Compensation, compensation_html)
to_html.register(Lot, lot_html)
to_json.register(Compensation, compensation_json)
to_html.register(Trend, _pictured)
to_html.register(RunsCompared, _pictured)
to_html.register(Matched, _pictured)
to_json.register(Trend, trend_json)
to_json.register(RunsCompared, compared_json)
to_json.register(Modes, modes_json)
to_json.register(SpeedResponse, speeds_json)
