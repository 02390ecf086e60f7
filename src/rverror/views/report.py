"""Any result as text, as plain data for JSON, as a page, as a table for a spreadsheet.

Text and page are made of its report, JSON of its table unless its keys are fixed: see `describing`.  So a new kind of
result has all of them as soon as it has these two.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from rverror.base.spreadsheet import workbook
from rverror.base.text import PathLike, printable
from rverror.base.version import __version__
from rverror.views.blocks import Heading, Sheet, Title, as_html, as_text, grid, line, section
from rverror.views.describing import InputFile, enveloped
from rverror.views.html import document, escaped
from rverror.views.kinds import content, sheet, table
from rverror.views.plots.figure import can_draw
from rverror.views.plots.page_figures import figures_of
from rverror.views.plots.zoomable import scripts
from rverror.views.shown_units import NUMBER
from rverror.views.variables import LONG, Table, columns


def to_text(result: Any, /, *, files: Sequence[InputFile] = (), **options: Any) -> str:
    """Result as text.

    Parameters
    ----------
    result
        A Diagnosis, Lot, DriveLot, Trend, RunsCompared, Matched, Compensation, Budget, ErrorBudget, VirtualUnits,
        Allocation, Comparison, Equilibrium, TorsionCurve, Hysteresis, Efficiency, DutyEfficiency, ContactPressure,
        Wear, Modes, SpeedResponse, RunUp, Influence, Model, Effect, Reducer, Drive, Run, OrderTable or
        Tolerance; a list or tuple of Effect, Tolerance, FrontPoint or Efficiency.
    files : sequence of InputFile, optional
        What it was made from: see `input_files`.
    **options
        An ErrorBudget takes the `limit`, rad or with a unit, at which its yield is given, a Compensation the `table`
        that was written of it.

    Returns
    -------
    str
        Angles in arcsec.  Ends with a line end; characters that cannot be printed show as their escapes.

    Raises
    ------
    InputError
        If there is no text of such a result.

    Examples
    --------
    >>> import rverror
    >>> print(to_text(rverror.effect("crank.index", crank=0, angle="1 arcmin")))
    Effect: crank.index (crank 0)
    <BLANKLINE>
    number  key          indices  parameter  value  unit
         0  crank.index  crank 0  angle         60  arcsec
    <BLANKLINE>
    """
    return as_text((*sheet(result, **options), *_origin(files)))


def _origin(files: Sequence[InputFile]) -> Sheet:
    """What a result was made from."""
    rows = [(file.path, file.bytes, file.sha256) for file in files]
    return section("Inputs", *grid(("file", "bytes", "sha256"), rows), *line(f"rverror {__version__}" if rows else ""))


def to_json(result: Any, /, *, files: Sequence[InputFile] = (), **options: Any) -> dict[str, Any]:
    """Result as plain data for `json.dump`; keys are only ever added.

    Parameters
    ----------
    result
        Whatever `to_text` or `to_pandas` takes.
    files : sequence of InputFile, optional
        What it was made from: see `input_files`.
    **options
        As for `to_text`.

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
    return enveloped(content(result, **options), files)


def to_html(result: Any, /, *, files: Sequence[InputFile] = (), **options: Any) -> str:
    """Result as one HTML page that needs nothing else, with pictures by matplotlib; they zoom if mpld3 is installed.

    Parameters
    ----------
    result
        Whatever `to_text` takes.
    files, **options
        As for `to_text`.

    Returns
    -------
    str
        Without pictures where matplotlib is not installed, which the page then says.

    Raises
    ------
    InputError
        If there is no page of such a result.

    Examples
    --------
    >>> import rverror
    >>> to_html(rverror.reducer("RV-40E")).startswith("<!doctype html>")
    True
    """
    first, *rest = sheet(result, **options)
    assert isinstance(first, Title)
    name = f"{first.kind}: {first.rest[0]}" if first.rest else first.kind
    lead = next((at for at, block in enumerate(rest) if isinstance(block, Heading)), len(rest))
    lacking = [escaped("Its pictures need matplotlib; install it by pip install 'rverror[plot]'.")]
    figures = figures_of(result, **options) if can_draw() else lacking
    drawn = "\n".join(f'<figure><div class="scroll">{one}</div></figure>' for one in figures)
    parts = [
        f"<h1>{escaped(name)}</h1>",
        as_html((*line(", ".join(first.rest[1:])), *rest[:lead])),
        drawn,
        as_html((*rest[lead:], *_origin(files))),
    ]
    return document(f"rverror: {name}", "\n".join(parts), scripts() if "<script" in drawn else ())


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
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for row in _rows(table(result), rows, units=units):
        writer.writerow([f"{cell:.6g}" if isinstance(cell, float) else cell for cell in row])
    return text.getvalue()


def to_xlsx(result: Any, /, *, path: PathLike = "workbook") -> bytes:
    """Result as a workbook: its single numbers, and a sheet for each of what `to_pandas` has as rows.

    Angles, samples and virtual units have a sheet where they are what `to_pandas` has as rows if nothing else is asked.

    Parameters
    ----------
    result
        Whatever `to_pandas` takes.
    path : str or path-like, optional
        Where it is to be written, for messages.

    Returns
    -------
    bytes
        Of an xlsx file.  Sizes in arcsec and um, the unit behind the name of a column; empty where not determined.

    Raises
    ------
    InputError
        If no table is made of such a result, or openpyxl is not installed.

    Examples
    --------
    >>> import rverror
    >>> to_xlsx(rverror.effect("crank.index", crank=0, angle="1 arcmin"))[:2]  # a workbook is a zip file
    b'PK'
    """
    result_table = table(result)
    single = ((name, of) for name, of in result_table.variables.items() if not of.dims)
    numbers = [(name, _cell(of.shown(display=True)), of.unit_text(display=True)) for name, of in single]
    sheets: dict[str, Iterable[Sequence[object]]] = {"numbers": [("name", "value", "unit"), *numbers]}
    dims = [dim for dim in result_table.dims if dim == result_table.rows or dim not in LONG]
    return workbook(path, sheets | {dim: _rows(result_table, dim, units=True) for dim in dims})


def _rows(result_table: Table, rows: str, *, units: bool) -> Iterator[list[float | int | str | None]]:
    """Heads and rows of a table along one dimension; `units` as in `to_csv`."""
    found, unit_of = columns(result_table, rows=rows, display=True)
    tagged = {name for name in found if units and unit_of.get(name, "") not in ("", NUMBER.core)}
    yield [f"{name} [{unit_of[name]}]" if name in tagged else name for name in found]
    for row in zip(*found.values(), strict=True):
        yield [_cell(value) for value in row]


def _cell(value: Any) -> float | int | str | None:
    plain = value.item() if hasattr(value, "item") else value
    if isinstance(plain, bool):
        return "yes" if plain else "no"
    if isinstance(plain, float) and not math.isfinite(plain):
        return None if math.isnan(plain) else str(plain)
    return plain if isinstance(plain, int | float) else printable(str(plain))
