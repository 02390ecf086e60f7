"""Plots of many measurements: what the processes of a lot make, lots of drives, a unit's life, matched parts."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import count_of
from rverror.base.text import describe
from rverror.base.units import DISPLAY_UNITS, to_display
from rverror.life.result import RunsCompared, Trend
from rverror.lots.of_drives import DriveLot
from rverror.lots.result import Lot, MadeBy
from rverror.matching.result import Matched
from rverror.views.lot_report import process_name
from rverror.views.plots import style
from rverror.views.plots.figure import ORDER, Axes, axes_for, axes_of_rows, in_shown_unit, labelled, plain, shown_unit

_MEASURED, _MADE = style.ORANGE, style.BLUE
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
    units = list(dict.fromkeys(DISPLAY_UNITS[one.dimension] for one in rows))
    suffixes = [f", {DISPLAY_UNITS[one.dimension]}" if len(units) > 1 else "" for one in rows]
    ax, at = axes_of_rows(ax, [plain(process_name(one)) + unit for one, unit in zip(rows, suffixes, strict=True)])
    value, low, high = np.array([_sizes(one) for one in rows]).T
    allowed = np.array([np.nan if one.capability is None else one.capability for one in rows]) * value
    ax.hlines(at, low, high, color=style.BLUE, lw=1.3, zorder=1)
    for some, face, label in _by_evidence(rows):
        ax.plot(value[some], at[some], "o", color=style.BLUE, mfc=face, ms=6, label=label)
    if np.isfinite(allowed).any():
        label = "allowed by the tolerance, Cp = 1"
        ax.plot(allowed, at, "|", color=_MEASURED, ms=14, mew=2.5, label=label)
    x = f"standard deviation, {' or '.join(units)}"
    return labelled(ax, "What each process makes, with 95 % interval", *_of(found), x=x, xlim=(0, None))


def lot_shares(found: Lot, *, ax: Axes | None = None) -> Axes:
    """Share of each process in the variance of the output error, over orders and conditions.

    Parameters
    ----------
    found : Lot
    """
    rows = _shown(found)
    ax, at = axes_of_rows(ax, [plain(process_name(one)) for one in rows])
    shares = np.array([100 * one.share for one in rows])
    for some, face, label in _by_evidence(rows):
        hatch = "///" if face == "white" else ""
        ax.barh(at[some], shares[some], height=0.6, color=face, ec=style.GREY, hatch=hatch, label=label)
    return labelled(ax, "What each process contributes", *_of(found), x="share of the variance of the output error, %")


def _by_evidence(rows: Sequence[MadeBy]) -> Iterator[tuple[npt.NDArray[np.bool_], str, str]]:
    """Processes whose scatter is significant, and those of which it is not, with their face and name."""
    significant = np.array([one.above_zero for one in rows])
    for some, face, label in (
        (significant, style.BLUE, "significantly above zero"),
        (~significant, "white", "not significant"),
    ):
        if some.any():
            yield some, face, label


def lot_orders(found: Lot, *, run: int = 0, ax: Axes | None = None) -> Axes:
    """Spread of the units about their mean by order, as measured and as the processes make it.

    Parameters
    ----------
    found : Lot
    run : int
        Condition, counted from 0.
    """
    if not found.orders.size:
        raise InputError("the lot holds no orders to draw")
    if not 0 <= run < len(found.conditions):
        raise InputError(f"run = {run}: must be 0 to {len(found.conditions) - 1}")
    bars = {"measured": found.amplitudes[run], "made by the processes, noise included": found.made[run]}
    y = f"rms over the units, {shown_unit('angle')}"
    return _bars(ax, found.orders, bars, "Spread of the units", *_of(found), found.conditions[run], y=y)


def compared_orders(found: RunsCompared, *, ax: Axes | None = None) -> Axes:
    """Amplitudes before and after of the orders that differ most, in the direction in which they do.

    Parameters
    ----------
    found : RunsCompared
    """
    rows = list({one.order: one for one in reversed(found.orders)}.values())[::-1][:_MOST]
    bars = {name: np.array([getattr(one, name) for one in rows]) for name in ("before", "after")}
    return _bars(ax, [one.order for one in rows], bars, "orders that differ", y="amplitude, arcsec")


def _bars(ax: Axes | None, orders: Iterable[float], bars: Mapping[str, Array], *title: str, y: str) -> Axes:
    """Two bars beside each other for each order, of angles."""
    ax = axes_for(ax, height=3.6)
    ticks = [f"{order:g}" for order in orders]
    place = np.arange(len(ticks))
    for shift, colour, (label, sizes) in zip((-0.2, 0.2), (_MEASURED, _MADE), bars.items(), strict=True):
        ax.bar(place + shift, in_shown_unit(sizes, "angle"), 0.4, color=colour, label=label)
    ax.set_xticks(place, ticks, rotation=90 if len(ticks) > 20 else 0, fontsize=8)
    return labelled(ax, *title, x=ORDER, y=y, xlim=(-1, max(len(ticks), 1)))  # a single order is no wall


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
    place, sizes = (np.broadcast_to(np.arange(len(found.orders)), odd.shape), in_shown_unit(found.amplitudes, "angle"))
    ends = np.array([(one.mean.value, one.mean.low, one.mean.high) for one in found.orders])
    mean, low, high = in_shown_unit(ends, "angle").T
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
        found.model,
        count_of(len(found.serials), "unit"),
        x=ORDER,
        y=f"amplitude, {shown_unit('angle')}",
        ylim=(0.0, top),
    )


def lot_predicted(found: Lot, *, ax: Axes | None = None) -> Axes:
    """Mean and 95 % quantile of the peak-to-peak error, of units to come and of the measured ones, by condition.

    Parameters
    ----------
    found : Lot
    """
    if not found.predicted:
        raise InputError("the lot predicts nothing, so there is nothing to draw")
    rows = found.predicted[::-1]
    ax, at = axes_of_rows(ax, [plain(one.condition) for one in rows])
    ends = [(one.quantile.value, one.quantile.low, one.quantile.high) for one in rows]
    value, low, high = in_shown_unit(np.array(ends), "angle").T
    mean, *seen = in_shown_unit(np.array([(one.mean, *one.seen) for one in rows]), "angle").T
    ax.hlines(at + 0.12, low, high, color=_MADE, lw=1.3)
    for x, y, mark, colour, face, label in (
        (value, at + 0.12, "o", _MADE, _MADE, "units to come, 95 % stay below; with 95 % interval"),
        (mean, at + 0.12, "D", _MADE, "white", "units to come, mean"),
        (seen[1], at - 0.12, "s", _MEASURED, _MEASURED, "measured, 95 % are below"),
        (seen[0], at - 0.12, "^", _MEASURED, "white", "measured, mean"),
    ):
        ax.plot(x, y, mark, color=colour, mfc=face, ms=6, label=label)
    return labelled(ax, "Units to come", *_of(found), x="peak-to-peak transmission error, arcsec", xlim=(0, None))


def _shown(found: Lot) -> list[MadeBy]:
    """Processes that show, the largest share last: at the top of a picture."""
    rows = [one for one in found.processes if one.deviation is not None][::-1]
    if not rows:
        raise InputError("no process shows in the lot, so there is none to draw")
    return rows


def _of(found: Lot) -> list[str]:
    return [plain(found.model), count_of(found.units, "unit")]


def _sizes(one: MadeBy) -> tuple[float, float, float]:
    assert one.deviation is not None
    ends = (one.deviation.value, one.deviation.low, one.deviation.high)
    value, low, high = (to_display(x, one.dimension) for x in ends)
    return value, low, high


# --- a unit's life, matched parts -------------------------------------------------------------------------------------


def trend_courses(found: Trend, *, ax: Axes | None = None) -> Axes:
    """Change of lost motion and peak-to-peak since the first session, with the lost motion that named causes make.

    Parameters
    ----------
    found : Trend
    """
    ax = axes_for(ax, height=3.6)
    for number, condition in enumerate(found.conditions):
        change = in_shown_unit(found.peak_to_peak[:, number] - found.peak_to_peak[0, number], "angle")
        look: dict[str, Any] = {"marker": _MARKS[number % len(_MARKS)], "ls": "none", "ms": 5}
        colour = style.line_style(number + 1)["color"]
        ax.plot(found.at, change, color=colour, label=f"peak-to-peak, {condition}", **look)
    first = found.explained[:1]
    labels = ["lost motion", *["_"] * (first.size - 1)]  # one entry of the legend for all
    measured, made = (in_shown_unit(rows - first, "angle") for rows in (found.lost_motion, found.explained))
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
    x = "error at the load over the limit, %"
    return labelled(ax, found.model, x=x, y="units, %", ylim=(0, 102), legend="beside")
