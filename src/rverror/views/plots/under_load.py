"""Plots of what a reducer does under load: torsion curve and loop, losses to friction, pressure, wear."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import brief
from rverror.base.text import describe
from rverror.statics.duty import duty_words
from rverror.statics.friction import Efficiency, Hysteresis
from rverror.statics.hertz import ContactPressure
from rverror.statics.rigidity import MAKERS_SHARE, TorsionCurve, on_its_branch
from rverror.statics.worn_contacts import Wear
from rverror.views.model_report import ways
from rverror.views.plots import style
from rverror.views.plots.figure import Axes, axes_for, lines
from rverror.views.plots.labels import labelled, over_angle
from rverror.views.shown_units import ANGLE, PRESSURE, TORQUE

_PERCENT = 100 * MAKERS_SHARE
_WITHOUT_TURNING = 7  # bars whose texts fit beside one another
_ROOM = 1.35  # times the highest bar, with the efficiency written above it
_MARKS = "os^D"  # one for each kind of contact

# --- torsion ----------------------------------------------------------------------------------------------------------


def torsion(curve: TorsionCurve, *, rated: float | str | None = None, ax: Axes | None = None) -> Axes:
    """Turn of the output over the torque on it, mean of the angles at which the input was held, and its spread.

    The branches of either sense are drawn apart: between them lies the play, which torques other than zero do not show.

    Parameters
    ----------
    curve : TorsionCurve
    rated : float or str or quantity, optional
        Rated torque, N*mm: marks the lost motion between +-3 % of it.

    Raises
    ------
    InputError
        If the curve does not reach +-3 % of the rated torque.
    """
    order = np.argsort(curve.torque, kind="stable")
    torque, angle = (TORQUE.of(curve.torque[order]), ANGLE.of(curve.angle[order]))
    middle = angle.mean(axis=1)
    branches = [one for one in (("counter-clockwise", torque > 0), ("clockwise", torque < 0)) if one[1].any()]
    lost = _lost_motion(torque, middle, rated)
    ax = axes_for(ax, height=3.8)
    for number, (word, at) in enumerate(branches):
        ax.fill_between(torque[at], angle[at].min(axis=1), angle[at].max(axis=1), color=style.GREY, alpha=0.3, lw=0)
        look = {"marker": _MARKS[number], **style.line_style(number)}
        ax.plot(torque[at], middle[at], ms=4, lw=1.2, label=f"torque {word}", **look)
    if (torque == 0).any():
        ax.plot([0.0], [0.0], "o", color=style.BLACK, mfc="white", ms=5, label="no torque: middle of the play")
    return _torsion_axes(ax, "torsion", "mean and range", angle.shape[1], lost)


def loop(found: Hysteresis, *, rated: float | str | None = None, ax: Axes | None = None) -> Axes:
    """Turn of the output as the torque rises and as it falls, mean of the angles at which the input was held.

    Parameters
    ----------
    found : Hysteresis
    rated : float or str or quantity, optional
        Rated torque, N*mm: marks the lost motion between +-3 % of it, at the midpoints of the loop's width.  The
        reducer's own where left out, as far as the loop reaches.

    Raises
    ------
    InputError
        If the loop does not reach +-3 % of the rated torque.
    """
    order = np.argsort(found.torque, kind="stable")
    torque = TORQUE.of(found.torque[order])
    rising, falling = (ANGLE.of(branch[order].mean(axis=1)) for branch in (found.rising, found.falling))
    if rated is None and found.rated_lost_motion is not None:
        rated = found.rated_torque
    lost = _lost_motion(torque, (rising + falling) / 2, rated)
    ax = axes_for(ax, height=5.0)
    ax.fill_between(torque, rising, falling, color=style.GREY, alpha=0.3, lw=0)
    lines(ax, torque, (("torque rises", rising), ("torque falls", falling)), marker="o", ms=3, lw=1.2)
    return _torsion_axes(ax, "hysteresis loop", "mean", found.rising.shape[1], lost)


def _torsion_axes(ax: Axes, what: str, shown: str, angles: int, lost: tuple[Array, Array] | None) -> Axes:
    """Words, and the lost motion where it is asked for."""
    if lost is not None:
        label = f"lost motion at ±{_PERCENT:g} %: {np.ptp(lost[1]):.3g} arcsec"
        ax.plot(*lost, "D", color=style.BLACK, ms=4, label=label)
    ax.axhline(0, color=style.BLACK, lw=0.4)
    ax.axvline(0, color=style.BLACK, lw=0.4)
    held = f"{shown} over {angles} angles" if angles > 1 else ""
    x, y = "torque on the output, N*m", "turn of the output, arcsec"
    return labelled(ax, what, "input held", held, x=x, y=y)


def _lost_motion(torque: Array, angle: Array, rated: Any) -> tuple[Array, Array] | None:
    """Torques, N*m, and the curve there, each read on its own branch; none where no torque is rated."""
    if rated is None:
        return None
    ends = units.to_core(rated, "torque") / 1e3 * _PERCENT / 100 * np.array([-1.0, 1.0])
    try:
        return ends, np.array([on_its_branch(torque, angle, end) for end in ends.tolist()])
    except ValueError as problem:
        raise InputError(
            f"the curve holds no torques on both sides of +-{ends[1]:g} N*m, {_PERCENT:g} % of the rated torque; "
            "compute it for more torques"
        ) from problem


# --- friction, pressure, wear -----------------------------------------------------------------------------------------


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
    place, top = np.arange(len(listed)), np.zeros(len(listed))
    for number, part in enumerate(found.losses):
        height = np.array([100 * one.by_part[part] for one in listed])
        ax.bar(place, height, 0.8, top, label=part.replace("_", " "), ec="black", lw=0.4, **style.fill_style(number))
        top += height
    for x, high, one in zip(place.tolist(), top, listed, strict=True):
        ax.text(x, high, f" {100 * one.mean:.1f} %", ha="center", va="bottom", rotation=90, fontsize="small")
    cases = [[f"{one.drives} drives" for one in listed], [ways(one.direction) for one in listed]]
    loads = [brief(TORQUE.of(one.torque)) for one in listed]
    differing = [words for words in cases if len(set(words)) > 1]
    joint, turned = ("\n", 0) if len(listed) <= _WITHOUT_TURNING or not differing else (", ", 90)
    ticks = [joint.join(words) for words in zip(loads, *differing, strict=True)]
    ax.set_xticks(place, ticks, fontsize="small", rotation=turned)
    return labelled(
        ax,
        "losses to friction, above them the efficiency",
        *(words[0] for words in cases if words not in differing),
        x="torque on the output, N*m",
        y="lost of the work put in, %",
        xlim=(-1.0, len(listed)),
        ylim=(0, _ROOM * max(float(top.max()), 1.0)),
        legend="beside",
    )


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
        pressure = PRESSURE.of(found.pressure[peak.contact])[..., order]
        hardest = pressure.max(axis=tuple(range(pressure.ndim - 1)))
        ax.plot(angle, hardest, lw=1.6, label=f"{peak.contact}, hardest pressed at each angle", **look)
        ax.plot(angle, pressure[tuple(peak.indices.values())], lw=0.6, color=look["color"])
        at = PRESSURE.of(peak.pressure)
        where = f"{describe(peak.contact, peak.indices)}: {brief(at)} MPa at {np.degrees(peak.theta):.4g} deg"
        mark = {"marker": _MARKS[number], "color": look["color"], "mec": "black", "ls": "none", "ms": 7}
        ax.plot(np.degrees([peak.theta]), [at], label=where, **mark)
    y = f"largest pressure, {PRESSURE.shown}"
    return over_angle(ax, "contact pressure", y=y, ylim=(0, None))


def over_hours(found: Wear, *, ax: Axes | None = None) -> Axes:
    """Lost motion and peak-to-peak over the hours of operation.

    Parameters
    ----------
    found : Wear
    """
    ax = axes_for(ax, height=3.6)
    lost, error = (ANGLE.of(row) for row in (found.lost_motion, found.peak_to_peak))
    lines(ax, found.hours, (("lost motion", lost), ("peak-to-peak under load", error)), marker="o", ms=4)
    x, y = "time of operation, h", "turn of the output, arcsec"
    return labelled(ax, f"wear at {duty_words(found.duty)}", x=x, y=y, ylim=(0, None), legend="beside")
