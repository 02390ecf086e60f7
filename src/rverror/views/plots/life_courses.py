"""Plots of a unit over its life: lost motion and peak-to-peak over the sessions, orders before and after."""

from __future__ import annotations

import numpy as np

from rverror.base.text import describe
from rverror.life.result import RunsCompared, Trend
from rverror.views.plots import style
from rverror.views.plots.figure import ORDER, Axes, axes_for, in_shown_unit, legend_beside, plain

_MOST = 12  # orders
_MARKS = "x+sd^v"  # of conditions


def trend_courses(found: Trend, *, ax: Axes | None = None) -> Axes:
    """Change of lost motion and peak-to-peak since the first session, with the lost motion that named causes make.

    Parameters
    ----------
    found : Trend
    """
    ax = axes_for(ax, height=3.6)
    for number, condition in enumerate(found.conditions):
        row = in_shown_unit(found.peak_to_peak[:, number] - found.peak_to_peak[0, number], "angle")
        ax.plot(
            found.at,
            row,
            _MARKS[number % len(_MARKS)],
            ms=5,
            color=style.line_style(number + 1)["color"],
            label=f"peak-to-peak, {condition}",
        )
    for number in range(found.lost_motion.shape[1]):
        first = found.explained[0, number]
        measured, made = (in_shown_unit(x[:, number] - first, "angle") for x in (found.lost_motion, found.explained))
        ax.plot(
            found.at, measured, "o", color=style.ORANGE, ms=5, mfc="white", label="lost motion" if not number else None
        )
        ax.plot(found.at, made, color=style.BLUE, label="lost motion by the named causes" if not number else None)
    for one in found.changed:
        ax.axvline(one.since, color=style.GREY, lw=0.8, ls=":")
    named = ", ".join(dict.fromkeys(plain(describe(one.key, one.indices)) for one in found.changed))
    ax.set(
        xlabel="time, h" if found.unit == "hour" else "number of cycles",
        ylabel="change since the first session, arcsec",
    )
    ax.set_title(named or "nothing has changed", fontsize=9)
    legend_beside(ax)
    return ax


def compared_orders(found: RunsCompared, *, ax: Axes | None = None) -> Axes:
    """Amplitudes before and after of the orders that differ most, in the direction in which they do.

    Parameters
    ----------
    found : RunsCompared
    """
    ax = axes_for(ax, height=3.6)
    rows = list({one.order: one for one in reversed(found.orders)}.values())[::-1][:_MOST]
    at = np.arange(len(rows))
    for shift, color, label, sizes in (
        (-0.2, style.ORANGE, "before", [one.before for one in rows]),
        (0.2, style.BLUE, "after", [one.after for one in rows]),
    ):
        ax.bar(at + shift, in_shown_unit(np.array(sizes), "angle"), 0.4, color=color, label=label)
    ax.set_xticks(at, [str(one.order) for one in rows])
    ax.set_xlim(-1, max(len(rows), 1))  # a single order is no wall
    ax.set(xlabel=ORDER, ylabel="amplitude, arcsec", title="orders that differ")
    if rows:
        legend_beside(ax)
    return ax
