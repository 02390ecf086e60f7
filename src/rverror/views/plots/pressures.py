"""Plot of contact pressure over the output angle."""

from __future__ import annotations

import numpy as np

from rverror.base.numbers import brief
from rverror.base.text import describe
from rverror.statics.hertz import ContactPressure
from rverror.views.plots import style
from rverror.views.plots.figure import Axes, axes_for, in_shown_unit, over_angle, shown_unit

_MARKS = ("o", "s", "^", "D")  # one for each kind of contact


def pressures(found: ContactPressure, *, ax: Axes | None = None) -> Axes:
    """Largest pressure among the contacts of each kind at each angle, and thin that of the one which presses hardest.

    A mark stands at the largest of all; beside it in the legend which contact it is, and at which angle.

    Parameters
    ----------
    found : ContactPressure
    """
    ax = axes_for(ax, height=4.2)
    order = np.argsort(found.theta, kind="stable")
    angle = np.degrees(found.theta[order])
    for number, peak in enumerate(found.peaks()):
        look = style.line_style(number)
        pressure = in_shown_unit(found.pressure[peak.contact], "pressure")[..., order]
        hardest = pressure.max(axis=tuple(range(pressure.ndim - 1)))
        ax.plot(angle, hardest, lw=1.6, label=f"{peak.contact}, hardest pressed at each angle", **look)
        ax.plot(angle, pressure[tuple(peak.indices.values())], lw=0.6, color=look["color"])
        at = float(in_shown_unit(np.array([peak.pressure]), "pressure")[0])
        where = f"{describe(peak.contact, peak.indices)}: {brief(at)} MPa at {np.degrees(peak.theta):.4g} deg"
        mark = {"marker": _MARKS[number], "color": look["color"], "mec": "black", "ls": "none", "ms": 7}
        ax.plot(np.degrees([peak.theta]), [at], label=where, **mark)
    return over_angle(
        ax, "contact pressure", y=f"largest pressure, {shown_unit('pressure')}", ylim=(0, None), columns=2
    )
