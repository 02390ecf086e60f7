"""Plot of a run-up: error over the time, and what it is made of."""

from __future__ import annotations

import numpy as np

from rverror.base.numbers import with_unit
from rverror.dynamics.running_up import RunUp
from rverror.views.plots import style
from rverror.views.plots.figure import Axes, axes_for, for_drawing, in_shown_unit, labelled, stated


def run_up_waveform(found: RunUp, *, ax: Axes | None = None) -> Axes:
    """Error over the time about its mean at a crawl, windup and vibration; grey where contacts would have to pull.

    Parameters
    ----------
    found : RunUp
    """
    ax = axes_for(ax, height=4.2)
    about = found.crawl.mean()
    rows = (found.transmission_error - about, found.vibration, found.windup)
    time, *drawn = for_drawing(found.time, *(in_shown_unit(row, "angle") for row in rows))
    ax.plot(time, drawn[0], color=style.BLACK, lw=0.8, label="error")
    for number, (label, row) in enumerate(zip(("vibration", "windup"), drawn[1:], strict=True)):
        ax.plot(time, row, lw=1.2, label=label, **style.line_style(number))
    pulls = found.output_torque < 0
    if pulls.any():
        across = ax.get_xaxis_transform()
        ax.fill_between(
            found.time, 0, 1, where=pulls, transform=across, color=style.GREY, alpha=0.4, label="contacts pull"
        )
    last = with_unit(float(found.speed[-1]), "angular_speed")
    title = f"run-up from {with_unit(float(found.speed[0]), 'angular_speed')} to {last}"
    return labelled(
        ax,
        title,
        *stated(torque=found.torque, direction=found.direction),
        x="time, s",
        y="transmission error, arcsec",
        xlim=(float(np.min(found.time)), float(np.max(found.time))),
        legend="beside",
    )
