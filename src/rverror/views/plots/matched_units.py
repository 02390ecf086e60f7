"""Plot of matched units: their errors against those of units put together otherwise, and the limit."""

from __future__ import annotations

import numpy as np

from rverror.matching.result import Matched
from rverror.views.plots import style
from rverror.views.plots.figure import Axes, axes_for, labelled


def matched_errors(found: Matched, *, ax: Axes | None = None) -> Axes:
    """Share of the units up to each error, of every way to build; dotted: the limit.

    Parameters
    ----------
    found : Matched
    """
    ax = axes_for(ax, height=3.6)
    for number, way in enumerate(found.ways):
        known = np.sort(way.errors[np.isfinite(way.errors)])
        share = np.arange(1, known.size + 1) / way.errors.size
        ax.step(100 * known, 100 * share, where="post", label=way.name, **style.line_style(number))
    ax.axvline(100, color=style.GREY, lw=1, ls=":")
    return labelled(
        ax, found.model, x="error at the load over the limit, %", y="units, %", ylim=(0, 102), legend="beside"
    )
