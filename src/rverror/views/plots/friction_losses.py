"""Plot of what friction takes: losses by part, over the load, in both directions of motion and of power."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rverror.base.errors import InputError
from rverror.base.numbers import brief, way
from rverror.base.units import to_display
from rverror.statics.friction import Efficiency
from rverror.views.plots import style
from rverror.views.plots.figure import Axes, axes_for, labelled

_ROOM = 1.35  # times the highest bar, with the efficiency written above it


def losses(found: Efficiency, *, beside: Sequence[Efficiency] = (), ax: Axes | None = None) -> Axes:
    """Bars of the work put in that each kind of contact takes, with the efficiency above; loads grow to the right.

    Parameters
    ----------
    found : Efficiency
    beside : sequence of Efficiency
        Of other loads, of the other direction or with power from the other side; each has a bar.

    Raises
    ------
    InputError
        If something beside it is no efficiency.
    """
    for one in beside:
        if not isinstance(one, Efficiency):
            raise InputError(f"beside holds a {type(one).__name__}, no Efficiency; give results of efficiency()")
    ax = axes_for(ax, height=4.6)
    listed = sorted([found, *beside], key=lambda one: one.torque)
    cases = [_case(one) for one in listed]
    loads = np.array([to_display(one.torque, "torque") for one in listed])
    starts = np.concatenate([[0.0], np.diff(loads) > 0])
    place = np.arange(len(listed)) + 0.6 * np.cumsum(starts)  # bars of one load stand together
    top = np.zeros(len(listed))
    for number, part in enumerate(found.losses):
        height = np.array([100 * one.by_part[part] for one in listed])
        ax.bar(place, height, 0.8, top, label=part.replace("_", " "), ec="black", lw=0.4, **style.fill_style(number))
        top += height
    for x, high, one in zip(place, top, listed, strict=True):
        ax.text(x, high, f" {100 * one.mean:.1f} %", ha="center", va="bottom", rotation=90, fontsize="small")
    same = [len({case[at] for case in cases}) == 1 for at in range(2)]
    words = [[word.split()[0] for word, alike in zip(case, same, strict=True) if not alike] for case in cases]
    ax.set_xticks(place, [", ".join([brief(load), *more]) for load, more in zip(loads, words, strict=True)])
    ax.tick_params(axis="x", labelsize="small", labelrotation=0 if all(same) else 90)
    ax.set_xlim(-1.0, place[-1] + 1.0)
    common = [word for word, alike in zip(cases[0], same, strict=True) if alike]
    told = "torque on the output, N*m" if same[0] else "what drives, under a torque on the output, N*m"
    return labelled(
        ax,
        ", ".join(["losses to friction, above them the efficiency", *common]),
        x=told,
        y="lost of the work put in, %",
        ylim=(0, _ROOM * max(float(top.max()), 1.0)),
        legend="beside",
    )


def _case(one: Efficiency) -> tuple[str, str]:
    """What drives, and which way it goes."""
    ways = {way(sense) for sense in one.direction.tolist()}
    return f"{one.drives} drives", ways.pop() if len(ways) == 1 else "mixed"
