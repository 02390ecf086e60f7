"""Plots of wear: error and lost motion over the hours, and what a lobe has lost by then."""

from __future__ import annotations

import numpy as np

from rverror.statics.duty import duty_words
from rverror.statics.worn_contacts import Wear
from rverror.views.plots import style
from rverror.views.plots.figure import Axes, axes_for, in_shown_unit, legend_beside


def over_hours(found: Wear, *, ax: Axes | None = None) -> Axes:
    """Lost motion and peak-to-peak over the hours of operation.

    Parameters
    ----------
    found : Wear
    """
    ax = axes_for(ax, height=3.6)
    rows = {"lost motion": found.lost_motion, "peak-to-peak under load": found.peak_to_peak}
    for number, (label, row) in enumerate(rows.items()):
        ax.plot(
            found.hours, in_shown_unit(row, "angle"), marker="os"[number], ms=4, label=label, **style.line_style(number)
        )
    ax.set(xlabel="time of operation, h", ylabel="turn of the output, arcsec", title=_duty(found))
    ax.set_ylim(bottom=0)
    ax.margins(x=0)
    legend_beside(ax)
    return ax


def worn_lobe(found: Wear, *, ax: Axes | None = None) -> Axes:
    """Depth that a lobe and the pin on it have lost together over the roll angle, at some of the hours.

    Parameters
    ----------
    found : Wear
    """
    ax = axes_for(ax, height=3.6)
    depth = in_shown_unit(found.lobe_depth + found.pin_depth, "length")
    chosen = np.unique(np.linspace(0, found.hours.size - 1, 4).round().astype(int))[1:]
    for number, at in enumerate(chosen):
        ax.plot(np.degrees(found.roll_angle), depth[at], label=f"{found.hours[at]:.4g} h", **style.line_style(number))
    ax.set(xlabel="roll angle from root over tip to root, deg", ylabel="worn off, um", title=_duty(found))
    ax.margins(x=0)
    legend_beside(ax)
    return ax


def _duty(found: Wear) -> str:
    return f"wear at {duty_words(found.duty)}"
