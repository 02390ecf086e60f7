"""Results as small HTML tables for notebooks: what `Viewed` shows where a cell ends with a result.

Colours, letters and background are the notebook's own, so light and dark both fit.
"""

from __future__ import annotations

from functools import singledispatch
from typing import Any

from rverror.base.numbers import count_of
from rverror.base.text import describe, printable
from rverror.diagnosis.result import Diagnosis
from rverror.model.effects import Model
from rverror.runs.measurement import Run
from rverror.runs.order_table import OrderTable
from rverror.views.blocks import Title, as_html
from rverror.views.html import escaped
from rverror.views.kinds import has_sheet, sheet

_STYLE = (
    "<style>"
    ".rverror-page{line-height:1.45;overflow-x:auto}"
    ".rverror-page p,.rverror-page table{margin:.25em 0 .5em}"
    ".rverror-page table{border-collapse:collapse;border:none;width:auto;font-variant-numeric:tabular-nums}"
    ".rverror-page th,.rverror-page td{padding:.15em 1.1em .15em .2em;border:none;text-align:left;"
    "border-bottom:1px solid rgba(128,128,128,.35);max-width:36em;white-space:normal;vertical-align:top}"
    ".rverror-page thead th{border-bottom:2px solid rgba(128,128,128,.55);font-weight:600}"
    ".rverror-page tbody th{font-weight:400}"
    ".rverror-page .n{text-align:right}.rverror-page td.n{white-space:nowrap}.rverror-page th.n{max-width:8em}"
    ".rverror-page .soft{opacity:.85;font-size:.95em}.rverror-page .soft .soft{opacity:1;font-size:1em}"
    "</style>"
)


def line(thing: Any) -> str:
    """Result in one line: the title of its sheet, and how many effects, samples or causes it has.

    Parameters
    ----------
    thing
        What `kinds.sheet` knows.

    Returns
    -------
    str

    Examples
    --------
    >>> import rverror
    >>> line(rverror.Model(rverror.reducer("RV-40E")))
    'Model: RV-40E, R = 121, 0 effects'
    """
    first = sheet(thing)[0]
    assert isinstance(first, Title)
    return printable(f"{first.kind}: {', '.join((*first.rest, *_more(thing)))}")


@singledispatch
def _more(thing: Any) -> tuple[str, ...]:
    """What a line tells beside the title."""
    return ()


@_more.register
def _of_model(thing: Model) -> tuple[str, ...]:
    return (count_of(len(thing.effects), "effect"),)


@_more.register
def _of_run(thing: Run) -> tuple[str, ...]:
    return (count_of(thing.size, "sample"),)


@_more.register
def _of_diagnosis(thing: Diagnosis) -> tuple[str, ...]:
    return (thing.verdict.replace("_", " "), *(describe(one.effect.key, one.effect.indices) for one in thing.added))


@_more.register
def _of_orders(thing: OrderTable) -> tuple[str, ...]:
    return (count_of(len(thing.cases), "condition"),)


def page(thing: Any) -> str:
    """Result as a small piece of HTML: names, values with units and intervals.

    Parameters
    ----------
    thing : Model, Run, Influence, Equilibrium, TorsionCurve, Diagnosis, Budget, ErrorBudget, VirtualUnits, Allocation
        Or anything else that `kinds.sheet` knows; of other things what Python says of them.

    Returns
    -------
    str
        HTML without script, links or colours of its own.

    Examples
    --------
    >>> import rverror
    >>> "<td>eccentricity</td>" in page(rverror.reducer("RV-40E"))
    True
    """
    body = as_html(sheet(thing), folded=True) if has_sheet(thing) else f"<pre>{escaped(repr(thing))}</pre>"
    return f'<div class="rverror-page">{_STYLE}\n{body}\n</div>'
