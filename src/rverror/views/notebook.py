"""Results as small HTML tables for notebooks: what `Viewed` shows where a cell ends with a result.

Colours, letters and background are the notebook's own, so light and dark both fit.
"""

from __future__ import annotations

from typing import Any

from rverror.base.text import printable
from rverror.views.blocks import as_html
from rverror.views.describing import kind_in_words
from rverror.views.html import shipped
from rverror.views.kinds import sheet, table


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
    own_table = table(thing)
    return printable(f"{kind_in_words(own_table)}: {', '.join(filter(None, own_table.title))}")


def page(thing: Any) -> str:
    """Result as a small piece of HTML: names, values with units and intervals.

    Parameters
    ----------
    thing : Model, Run, Influence, Equilibrium, TorsionCurve, Diagnosis, Budget, ErrorBudget, VirtualUnits, Allocation
        Or anything else that `kinds.sheet` knows.

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
    body = as_html(sheet(thing), folded=True)
    return f'<div class="rverror-page"><style>\n{shipped("notebook.css")}</style>\n{body}\n</div>'
