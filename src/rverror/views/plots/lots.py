"""Plots of a lot: what each process makes beside what its tolerance allows, its share, orders, units to come."""

from __future__ import annotations

import numpy as np

from rverror.base.errors import InputError
from rverror.base.numbers import count_of
from rverror.base.units import DISPLAY_UNITS, to_display
from rverror.lots.of_drives import DriveLot
from rverror.lots.result import Lot, MadeBy
from rverror.views.lot_report import process_name
from rverror.views.plots import style
from rverror.views.plots.figure import ORDER, Axes, axes_for, axes_of_rows, in_shown_unit, labelled, plain, shown_unit

_MEASURED, _MADE = style.ORANGE, style.BLUE


def lot_processes(found: Lot, *, ax: Axes | None = None) -> Axes:
    """Standard deviation of each process with its 95 % interval, beside what its tolerance allows.

    Parameters
    ----------
    found : Lot
    """
    rows = _shown(found)
    units = list(dict.fromkeys(DISPLAY_UNITS[one.dimension] for one in rows))
    # lengths and angles share an axis: in um and arcsec they are of one size
    told = [f", {DISPLAY_UNITS[one.dimension]}" if len(units) > 1 else "" for one in rows]
    ax, _ = axes_of_rows(ax, [plain(process_name(one)) + unit for one, unit in zip(rows, told, strict=True)])
    for above, face, label in ((True, style.BLUE, "made, 95 % interval"), (False, "white", "not told from none")):
        chosen = [at for at, one in enumerate(rows) if one.above_zero == above]
        value, low, high = np.array([_sizes(rows[at]) for at in chosen]).reshape(-1, 3).T
        if chosen:
            ax.hlines(chosen, low, high, color=style.BLUE, lw=1.3, zorder=1)
            ax.plot(value, chosen, "o", color=style.BLUE, mfc=face, ms=6, label=label)
    allowed = [(at, _allowed(one)) for at, one in enumerate(rows)]
    drawn = np.array([(size, at) for at, size in allowed if size is not None]).reshape(-1, 2).T
    if drawn.size:
        ax.plot(*drawn, "|", color=_MEASURED, ms=14, mew=2.5, label="allowed by the tolerance, Cp = 1")
    x = f"standard deviation, {' or '.join(units)}"
    return labelled(ax, "What each process makes", *_of(found), x=x, xlim=(0, None))


def lot_shares(found: Lot, *, ax: Axes | None = None) -> Axes:
    """Share of each process in the variance of the output error, over orders and conditions.

    Parameters
    ----------
    found : Lot
    """
    rows = _shown(found)
    ax, at = axes_of_rows(ax, [plain(process_name(one)) for one in rows])
    shares = np.array([100 * one.share for one in rows])
    told = np.array([one.above_zero for one in rows])
    ax.barh(at[told], shares[told], height=0.6, color=style.BLUE, label="told from none")
    if not told.all():
        ax.barh(
            at[~told], shares[~told], height=0.6, color="white", ec=style.GREY, hatch="///", label="not told from none"
        )
    return labelled(ax, "What each process contributes", *_of(found), x="share of the variance of the output error, %")


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
    ax = axes_for(ax)

    place = np.arange(found.orders.size)
    for rows, width, colour, label in (
        (found.amplitudes, 0.8, _MEASURED, "measured"),
        (found.made, 0.3, _MADE, "made by the processes, noise included"),
    ):
        ax.bar(place, in_shown_unit(rows[run], "angle"), width=width, color=colour, label=label)
    labels = [f"{order:g}" for order in found.orders]
    ax.set_xticks(place, labels, rotation=90 if len(labels) > 20 else 0, fontsize=8)
    return labelled(
        ax,
        "Spread of the units",
        *_of(found),
        found.conditions[run],
        x=ORDER,
        y=f"rms over the units, {shown_unit('angle')}",
    )


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
    place, sizes = np.broadcast_to(np.arange(len(found.orders)), odd.shape), in_shown_unit(found.amplitudes, "angle")
    ends = np.array([(one.mean.value, one.mean.low, one.mean.high) for one in found.orders])
    mean, low, high = in_shown_unit(ends, "angle").T
    ax.vlines(place[0] + 0.2, low, high, color=style.BLUE, lw=1.3)
    ax.plot(place[0] + 0.2, mean, "_", color=style.BLUE, ms=9, label="mean wave, 95 % interval")
    for some, mark, colour, label in (
        (~odd, "o", style.GREY, "a unit"),
        (odd, "D", style.ORANGE, "a unit that is off the others"),
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
        raise InputError("the lot foretells nothing, so there is nothing to draw")
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
    return labelled(
        ax,
        "Units to come",
        *_of(found),
        x="peak-to-peak transmission error, arcsec",
        xlim=(0, None),
        columns=2,
    )


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


def _allowed(one: MadeBy) -> float | None:
    """Standard deviation that just fills the tolerance; None where there is none."""
    return None if one.capability is None else one.capability * _sizes(one)[0]
