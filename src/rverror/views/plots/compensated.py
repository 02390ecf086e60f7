"""Plots of a compensation: orders before and after, and the error of a run; what no fit saw is marked."""

from __future__ import annotations

import numpy as np

from rverror.base.errors import InputError
from rverror.base.numbers import brief
from rverror.base.text import file_name
from rverror.compensation.outcome import Compensation
from rverror.views.plots import style
from rverror.views.plots.figure import (
    ORDER,
    Axes,
    Figure,
    axes_for,
    for_drawing,
    in_shown_unit,
    labelled,
    new_figure,
    over_angle,
    plain,
    shown_unit,
    signal_label,
)
from rverror.views.plots.waveforms import unit_name

_BEFORE, _AFTER = style.ORANGE, style.BLUE


def compensated_orders(made: Compensation, *, most: int = 16, ax: Axes | None = None) -> Axes:
    """Amplitude of the largest orders without the correction, and what data left out keep of them.

    Parameters
    ----------
    made : Compensation
    most : int
        So many orders are drawn; the title says of how many.
    """
    if not made.worth:
        raise InputError("nothing survives on data left out, so there is no order to draw")
    if most < 1:
        raise InputError(f"most = {most}: must be 1 or more")
    ax = axes_for(ax)
    drawn = sorted(made.orders[:most], key=lambda one: one.order)
    place = np.arange(len(drawn))
    before, left = (
        in_shown_unit(np.array([getattr(one, of) for one in drawn]), "angle") for of in ("amplitude", "left")
    )
    ax.plot(place, before, "o", color=_BEFORE, label="measured")
    ax.plot(place, left, "v", color=_AFTER, label="after, on data left out (noise included)")
    for at, high, low in zip(place, before, left, strict=True):
        if np.isfinite(low):
            ax.plot([at, at], [low, high], color=style.BLACK, lw=0.5, zorder=0)
    ax.set_xticks(place, [f"{one.order:.4g}" for one in drawn])
    ax.set_yscale("log")
    of = f"the largest {len(drawn)} of {len(made.orders)}" if len(drawn) < len(made.orders) else ""
    return labelled(ax, "orders compensated", *_unit(made), of, x=ORDER, y=f"amplitude, {shown_unit('angle')}")


def compensated_waveform(made: Compensation, *, run: int | None = None, ax: Axes | None = None) -> Axes:
    """Error of one run without and with the correction: of stretches left out, or of a run that no fit saw.

    Parameters
    ----------
    made : Compensation
    run : int, optional
        Which, counted from 0, the fitted first; the first that no fit saw where left out, else the first.
    """
    if not made.traces:
        raise InputError("the compensation is of order tables and has no waveform; draw kind='orders'")
    if run is None:
        run = next((n for n, trace in enumerate(made.traces) if trace.unseen), 0)
    if not 0 <= run < len(made.traces):
        raise InputError(f"run = {run}: must be 0 to {len(made.traces) - 1}")
    ax = axes_for(ax)
    trace = made.traces[run]
    rank = np.argsort(trace.theta, kind="stable")
    angle, *rows = for_drawing(np.degrees(trace.theta[rank]), trace.before[rank], trace.after[rank])
    what = "seen by no fit" if trace.unseen else "stretches left out"
    for drawn, values, word, colour, dashes in (
        (rows[0], trace.before, "measured", _BEFORE, "solid"),
        (rows[1], trace.after, f"compensated, {what}", _AFTER, style.DASHED if trace.unseen else "solid"),
    ):
        rms = float(in_shown_unit(np.sqrt(np.mean(values**2)), "angle"))
        label = f"{word}: {brief(rms, 3)} {shown_unit('angle')} rms"
        ax.plot(angle, in_shown_unit(drawn, "angle"), color=colour, lw=0.8, ls=dashes, label=label)
    return over_angle(ax, *_unit(made), plain(file_name(trace.name) or "run"), y=signal_label("angle"))


def _unit(made: Compensation) -> list[str]:
    return [] if made.model is None else [unit_name(made.model)]


def compensation_figure(made: Compensation) -> Figure:
    """Orders, and below them the error of a run where there is one: of `compensate --plot`."""
    figure, axes = new_figure(2 if made.traces else 1)
    compensated_orders(made, ax=axes[0])
    if made.traces:
        compensated_waveform(made, ax=axes[1])
    return figure
