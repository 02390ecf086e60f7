"""Results as small HTML tables for notebooks: what `Viewed` shows where a cell ends with a result.

Colours, letters and background are the notebook's own, so light and dark both fit.
"""

from __future__ import annotations

from typing import Any

from rverror.base.errors import InputError
from rverror.base.text import printable
from rverror.views.blocks import as_html
from rverror.views.describing import kind_in_words
from rverror.views.html import escaped
from rverror.views.kinds import sheet, table

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
    """Result in one line: the title of its report.

    Parameters
    ----------
    thing
        What `kinds.table` knows.

    Returns
    -------
    str

    Examples
    --------
    >>> import rverror
    >>> line(rverror.Model(rverror.reducer("RV-40E")))
    'Model: RV-40E, R = 121, 0 effects'
    """
    told = table(thing)
    return printable(f"{kind_in_words(told)}: {', '.join(filter(None, told.title))}")


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
    try:
        body = as_html(sheet(thing), folded=True)
    except InputError:
        body = f"<pre>{escaped(repr(thing))}</pre>"
    return f'<div class="rverror-page">{_STYLE}\n{body}\n</div>'
