"""Plot of natural frequencies that orders show over the speed."""

from __future__ import annotations

import numpy as np

from rverror.base.errors import InputError
from rverror.base.numbers import brief, with_unit
from rverror.diagnosis.result import Diagnosis
from rverror.views.plots import style
from rverror.views.plots.figure import Axes, axes_for, in_shown_unit, labelled
from rverror.views.plots.waveforms import unit_name
from rverror.views.resonance_report import law_of

_MARKS = ("o", "s", "^", "D", "v", "P")  # tell orders apart in grey
_FRAMED = 3.0  # times the lowest and highest frequency found, that are shown


def resonance_plot(diagnosis: Diagnosis, *, ax: Axes | None = None) -> Axes:
    """Amplitude over its frequency of each order that shows a natural frequency, at its largest load, with the law.

    Parameters
    ----------
    diagnosis : Diagnosis
    ax : Axes, optional
        Where to draw; a new figure where left out.

    Returns
    -------
    Axes
        Natural frequencies as grey bands from end to end of their intervals.

    Raises
    ------
    InputError
        If no natural frequency was found.
    """
    found = diagnosis.resonances
    if not found:
        raise InputError(
            "no order shows a natural frequency; give order tables, or runs with time, at six speeds or more"
        )
    ax = axes_for(ax, height=4.2)
    number = 0
    for one in found:
        low, high = np.nan_to_num([one.low, one.high], nan=one.frequency)
        ax.axvspan(low, high, color=style.GREY, alpha=0.25, lw=0)
        ax.axvline(one.frequency, color=style.GREY, lw=1.2)
        for order in one.orders:
            series = max((s for s in one.series if s.order == order), key=lambda s: (s.torque or 0.0, s.direction))
            frequency, size = law_of(one, series)
            look = style.line_style(number)
            ax.plot(frequency, in_shown_unit(size, "angle"), lw=1.2, **look)
            load = "" if series.torque is None else f", {with_unit(series.torque, 'torque')}"
            ax.plot(
                series.frequency,
                in_shown_unit(np.abs(series.waves), "angle"),
                marker=_MARKS[number % len(_MARKS)],
                color=look["color"],
                ms=5,
                ls="none",
                label=f"order {brief(order, 6)}{load}",
            )
            number += 1
    ends = [end for one in found for series in one.series for end in (series.frequency[0], series.frequency[-1])]
    low, high = (end(one.frequency for one in found) for end in (min, max))
    return labelled(
        ax,
        "orders over the speed",
        unit_name(diagnosis.declared),
        x="frequency of the order, Hz",
        y="amplitude, arcsec",
        xlim=(max(low / _FRAMED, min(ends)), min(high * _FRAMED, max(ends))),
        yscale="log",
        legend="beside",
        legend_title="lines: laws of one mode;\ngrey: its frequency and interval",
    )
