"""Plots of many measurements: what the processes of a lot make, lots of drives, a unit's life, matched parts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from rverror.base.errors import InputError
from rverror.base.numbers import count_of
from rverror.base.text import describe
from rverror.life.result import RunsCompared, Trend
from rverror.lots.of_drives import DriveLot
from rverror.lots.result import Lot
from rverror.matching.result import Matched
from rverror.views.lot_report import lot_table
from rverror.views.plots import style
from rverror.views.plots.figure import Axes, axes_for, axes_of_rows, parted
from rverror.views.plots.labels import ORDER, labelled, plain
from rverror.views.shown_units import ANGLE
from rverror.views.variables import columns

_MOST = 12  # orders that are compared
_MARKS = "x+sd^v"  # of conditions


def lot_processes(found: Lot, *, ax: Axes | None = None) -> Axes:
    """Standard deviation of each process with its 95 % interval, beside what its tolerance allows.

    Parameters
    ----------
    found : Lot
    """
    rows = _shown(found)
    # lengths and angles share an axis: in um and arcsec they are of one size
    units, value = list(dict.fromkeys(rows["unit"])), rows["deviation"]
    named = zip(rows["process"], rows["unit"], strict=True)
    ax, at = axes_of_rows(ax, [plain(name) + (f", {unit}" if len(units) > 1 else "") for name, unit in named])
    ax.hlines(at, rows["deviation_low"], rows["deviation_high"], color=style.BLUE, lw=1.3, zorder=1)
    for some, face, label in _by_evidence(rows):
        ax.plot(value[some], at[some], "o", color=style.BLUE, mfc=face, ms=6, label=label)
    allowed = rows["cp"] * value
    if np.isfinite(allowed).any():
        label = "allowed by the tolerance, Cp = 1"
        ax.plot(allowed, at, "|", color=style.ORANGE, ms=14, mew=2.5, label=label)
    x = f"standard deviation, {' or '.join(units)}"
    return labelled(ax, "What each process makes, with 95 % interval", *_of(found), x=x, xlim=(0, None))


def lot_shares(found: Lot, *, ax: Axes | None = None) -> Axes:
    """Share of each process in the variance of the output error, over orders and conditions.

    Parameters
    ----------
    found : Lot
    """
    rows = _shown(found)
    ax, at = axes_of_rows(ax, [plain(name) for name in rows["process"]])
    for some, face, label in _by_evidence(rows):
        hatch = "///" if face == "white" else ""
        ax.barh(at[some], rows["share"][some], height=0.6, color=face, ec=style.GREY, hatch=hatch, label=label)
    return labelled(ax, "What each process contributes", *_of(found), x="share of the variance of the output error, %")


def _by_evidence(rows: Mapping[str, Any]) -> Iterator[tuple[Any, ...]]:
    """Processes whose scatter is significant, and those of which it is not, with their face and name."""
    looks = (style.BLUE, "significantly above zero"), ("white", "not significant")
    return parted(rows["above_zero"].astype(bool), *looks)


def compared_orders(found: RunsCompared, *, ax: Axes | None = None) -> Axes:
    """Amplitudes before and after of the orders that differ most, in the direction in which they do.

    Parameters
    ----------
    found : RunsCompared
    """
    rows = list({one.order: one for one in reversed(found.orders)}.values())[::-1][:_MOST]
    ax = axes_for(ax, height=3.6)
    place = np.arange(len(rows))
    for shift, colour, name in ((-0.2, style.ORANGE, "before"), (0.2, style.BLUE, "after")):
        sizes = ANGLE.of(np.array([getattr(one, name) for one in rows]))
        ax.bar(place + shift, sizes, 0.4, color=colour, label=name)
    ax.set_xticks(place, [f"{one.order:g}" for one in rows], fontsize=8)
    xlim = (-1, max(len(rows), 1))  # a single order is no wall
    return labelled(ax, "orders that differ", x=ORDER, y="amplitude, arcsec", xlim=xlim)


def drive_lot_orders(found: DriveLot, *, ax: Axes | None = None) -> Axes:
    """Amplitude of each unit by order, units that differ in it marked, and the mean wave with its 95 % interval.

    Parameters
    ----------
    found : DriveLot
    """
    if not found.orders:
        raise InputError("the lot has no order with more than noise to draw")
    ax = axes_for(ax)
    own = {(one.serial, one.order, one.condition) for one in found.own}
    odd = np.array([[(s, o.order, o.condition) in own for o in found.orders] for s in found.serials])
    place, sizes = np.broadcast_to(np.arange(len(found.orders)), odd.shape), ANGLE.of(found.amplitudes)
    ends = np.array([(one.mean.value, one.mean.low, one.mean.high) for one in found.orders])
    mean, low, high = ANGLE.of(ends).T
    ax.vlines(place[0] + 0.2, low, high, color=style.BLUE, lw=1.3)
    ax.plot(place[0] + 0.2, mean, "_", color=style.BLUE, ms=9, label="mean wave, 95 % interval")
    for some, mark, colour, label in (
        (~odd, "o", style.GREY, "a unit"),
        (odd, "D", style.ORANGE, "a unit that differs from the others"),
    ):
        ax.plot(place[some], sizes[some], mark, color=colour, ms=3.5, label=label)
    ax.set_xticks(place[0], [str(one.order) for one in found.orders], fontsize=8)
    ax.set_yscale("symlog", linthresh=max(float(np.median(sizes)), 1e-12))
    top = 2.0 * max(float(sizes.max()), float(high.max()))
    return labelled(
        ax,
        "Units by order",
        plain(found.model),
        count_of(len(found.serials), "unit"),
        x=ORDER,
        y=f"amplitude, {ANGLE.shown}",
        ylim=(0.0, top),
    )


def _shown(found: Lot) -> dict[str, Any]:
    """Columns of the processes that show, the largest share last: at the top of a picture."""
    made, _ = columns(lot_table(found), rows="process", display=True)
    shown = np.flatnonzero(np.isfinite(made["deviation"]))[::-1]
    if not shown.size:
        raise InputError("no process shows in the lot, so there is none to draw")
    return {name: np.asarray(column)[shown] for name, column in made.items()}


def _of(found: Lot) -> list[str]:
    return [plain(found.model), count_of(found.units, "unit")]


# --- a unit's life, matched parts -------------------------------------------------------------------------------------


def trend_courses(found: Trend, *, ax: Axes | None = None) -> Axes:
    """Change of lost motion and peak-to-peak since the first session, with the lost motion that named causes make.

    Parameters
    ----------
    found : Trend
    """
    ax = axes_for(ax, height=3.6)
    for number, condition in enumerate(found.conditions):
        change = ANGLE.of(found.peak_to_peak[:, number] - found.peak_to_peak[0, number])
        look: dict[str, Any] = {"marker": _MARKS[number % len(_MARKS)], "ls": "none", "ms": 5}
        colour = style.line_style(number + 1)["color"]
        ax.plot(found.at, change, color=colour, label=f"peak-to-peak, {condition}", **look)
    first = found.explained[:1]
    labels = ["lost motion", *["_"] * (first.size - 1)]  # one entry of the legend for all
    measured, made = (ANGLE.of(rows - first) for rows in (found.lost_motion, found.explained))
    ax.plot(found.at, measured, "o", color=style.ORANGE, ms=5, mfc="white", label=labels)
    ax.plot(found.at, made, color=style.BLUE, label=["lost motion by the named causes", *labels[1:]])
    for one in found.changed:
        ax.axvline(one.since, color=style.GREY, lw=0.8, ls=":")
    named = dict.fromkeys(plain(describe(one.key, one.indices)) for one in found.changed)
    x = "time, h" if found.unit == "hour" else "number of cycles"
    y = "change since the first session, arcsec"
    return labelled(ax, *(named or ["nothing has changed"]), x=x, y=y, legend="beside")


def matched_errors(found: Matched, *, ax: Axes | None = None) -> Axes:
    """Share of the units up to each error, of every way to build; dotted: the limit.

    Parameters
    ----------
    found : Matched
    """
    ax = axes_for(ax, height=3.6)
    for number, one in enumerate(found.ways):
        known = np.sort(one.errors[np.isfinite(one.errors)])
        share = np.arange(1, known.size + 1) / one.errors.size
        ax.step(100 * known, 100 * share, where="post", label=one.name, **style.line_style(number))
    ax.axvline(100, color=style.GREY, lw=1, ls=":")
    x = "error under load over the limit, %"
    return labelled(ax, "Ways to assemble", plain(found.model), x=x, y="units, %", ylim=(0, 102), legend="beside")
