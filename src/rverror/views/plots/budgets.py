"""Plots of an error budget and of an allocation: axes in, axes out.  matplotlib comes with the extra ``plot``.

Options that are not described here mean what `drawing.draw` says of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.errors import InputError
from rverror.base.units import ARCSEC
from rverror.tolerances.allocation_result import Allocation, FrontPoint
from rverror.tolerances.closed_form import Budget
from rverror.tolerances.full_budget import ErrorBudget
from rverror.tolerances.sampling import VirtualUnits
from rverror.views.describing import described
from rverror.views.plots import style
from rverror.views.plots.figure import Axes, axes_for, axes_of_rows, for_drawing, parted
from rverror.views.plots.labels import OUTPUT_ANGLE, labelled, over_angle, plain, signal_label, stated
from rverror.views.tolerance_report import within
from rverror.views.variables import columns

_DARK, _LIGHT, _LIMIT = style.BLUE, style.ORANGE, style.BLACK  # hatches tell areas apart in grey
_LEVELS = ((0.5, ":"), (0.95, "--"), (0.99, "-."))
_HATCHED: Mapping[str, Any] = {"height": 0.38, "color": _LIGHT, "ec": _LIMIT, "linewidth": 0.4, "hatch": "///"}
_COST = "cost, unit of the cost curves"
_TICKS = 16  # of an axis of powers of 2
_SHOWN = 15  # bars for which there is room


def _unit(found: object) -> list[str]:
    """Unit and direction of a budget, as far as it knows them."""
    return stated(found.model, direction=found.direction) if isinstance(found, ErrorBudget) else []


def contributions(found: ErrorBudget | Budget, *, ax: Axes | None = None) -> Axes:
    """Bars of what each tolerance contributes: share of the variance, and total Sobol index of the peak-to-peak.

    The closed form alone has no Sobol indices.
    """
    told, _ = columns(described(found), rows="tolerance", display=True)
    moving = np.flatnonzero(told["effect"] == "wave")
    order = moving[:_SHOWN][::-1]
    ax, at = axes_of_rows(ax, [plain(label) for label in told["tolerance"][order]])
    ax.barh(at + 0.2, told["share"][order], height=0.38, color=_DARK, label="share of the variance")
    if "sobol_total" in told:
        total, low, high = (100 * told[f"sobol_total{end}"][order] for end in ("", "_low", "_high"))
        label = "total Sobol index of the peak-to-peak, 95 % interval of the estimate"
        bars: dict[str, Any] = {"xerr": (total - low, high - total), "error_kw": {"linewidth": 0.8, "capsize": 2}}
        ax.barh(at - 0.2, total, label=label, **bars, **_HATCHED)
    hidden = moving.size - order.size
    return labelled(
        ax,
        "What each tolerance contributes" + (f" ({hidden} smaller not shown)" if hidden else ""),
        *_unit(found),
        x="contribution, %",
    )


def distribution(found: ErrorBudget | VirtualUnits, *, limit: Any | None = None, ax: Axes | None = None) -> Axes:
    """Histogram of the peak-to-peak of the virtual units with quantiles, and the yield at a limit, rad or with unit."""
    ax = axes_for(ax)
    drawn = found if isinstance(found, VirtualUnits) else found.units
    sizes = drawn.peak_to_peak / ARCSEC
    ax.hist(sizes, bins=80, color=_DARK, alpha=0.35, density=True)
    for level, dashes in _LEVELS:
        value = drawn.quantile(level).value / ARCSEC
        ax.axvline(value, color=_DARK, ls=dashes, lw=1.3, label=f"P{100 * level:g}: {value:.1f} arcsec")
    if limit is not None:
        share, at = drawn.yield_at(limit), units.named_core("limit", limit, "angle") / ARCSEC
        ends = f"95 % interval of the estimate {100 * share.low:.4g} to {100 * share.high:.4g} %"
        label = f"limit {at:g} arcsec: {100 * share.value:.4g} % pass, {ends}"
        ax.axvline(at, color=_LIMIT, lw=1.8, label=label)
    return labelled(
        ax,
        f"{drawn.count} virtual units",
        *_unit(found),
        "closed form",
        x="peak-to-peak transmission error, arcsec",
        y="share of the units per arcsec",
    )


def envelope(found: ErrorBudget | Budget, *, ax: Axes | None = None) -> Axes:
    """Expected transmission error over the output angle, one standard deviation about it, and the worst case.

    Tolerances shift the whole error too.  Where an offset of the edges is more than their peak-to-peak, it would
    flatten all waves: it is taken off, down to the standard deviation of the wave, and the legend states it.
    """
    closed = found if isinstance(found, Budget) else found.closed
    theta = np.arange(float(closed.mean.size)) if closed.theta is None else np.degrees(closed.theta)
    mean, lower, upper = closed.mean, closed.worst.lower, closed.worst.upper
    spread = closed.deviation_standard_deviation
    offset = float(min((upper - mean - spread).min(), (mean - spread - lower).min()))
    if taken := offset > max(float(np.ptp(lower)), float(np.ptp(upper))):
        lower, upper = lower + offset, upper - offset
    else:
        spread = closed.standard_deviation
    rows = (mean, mean - spread, mean + spread, lower, upper)
    angle, mean, below, above, *edges = for_drawing(theta, *(row / ARCSEC for row in rows))
    of_wave = " of the wave" if taken else ""
    said = f" less {offset / ARCSEC:.3g} arcsec either way, the same at all angles" if taken else ""
    ax = axes_for(ax)
    ax.fill_between(angle, below, above, color=style.GREY, alpha=0.5, lw=0, label=f"one standard deviation{of_wave}")
    for edge, label in zip(edges, (f"worst case{said}", None), strict=True):
        ax.plot(angle, edge, color=_LIGHT, ls="--", lw=1.1, label=label)
    ax.plot(angle, mean, color=_DARK, lw=1.2, label="expected")
    title = ["Expected error and what tolerances make of it", *_unit(found)]
    x = "sample, number" if closed.theta is None else OUTPUT_ANGLE
    return over_angle(ax, *title, y=signal_label("angle"), x=x)


def at_load(found: ErrorBudget | Allocation, *, ax: Axes | None = None) -> Axes:
    """Share of the units over what they use of each limit at the load; of a quantity without a limit, of its P99.

    Raises
    ------
    InputError
        If no unit was solved at a load.
    """
    loaded = found.verified if isinstance(found, Allocation) else getattr(found.at_load, "verified", None)
    if loaded is None:
        raise InputError("no unit was solved at a load; give limits, such as limit('transmission_error', '60 arcsec')")
    ax = axes_for(ax)
    for number, one in enumerate(loaded.limits):
        reference = one.quantile(0.99).value if one.limit.value is None else one.limit.value
        known = one.values[np.isfinite(one.values)]
        used = 100 * np.sort(one.limit.turned(known) / one.limit.turned(reference))
        share = 100 * np.arange(1, used.size + 1) / used.size
        known_from = 100 * one.known_from / reference  # of those below only the side of the limit is known
        ends = " to ".join(f"{100 * end:.4g}" for end in one.interval)
        passing = "" if one.limit.value is None else f": {100 * one.share:.4g} % pass, {ends}"
        label = f"{one.limit.label}, {one.limit.shown(reference):.4g} {one.limit.unit}{passing}"
        ax.plot(used[used >= known_from], share[used >= known_from], label=label, **style.line_style(number))
    ax.axvline(100, color=_LIMIT, lw=0.8)
    return labelled(
        ax,
        f"{loaded.limits[0].units} units under load, contacts that open included",
        *_unit(found),
        x="share of the limit (of the P99 where there is no limit), %",
        y="units at or below, %",
    )


def widths(found: Allocation, *, ax: Axes | None = None) -> Axes:
    """Each tolerance over what it was: tighter to the left, wider to the right."""
    ratio = np.divide(found.widths, found.widths_before)
    order = np.argsort(ratio, kind="stable")[::-1]
    ratio = ratio[order]
    held = np.array(found.fixed, dtype=np.bool_)[order]
    ax, at = axes_of_rows(ax, [plain(found.labels[e]) for e in order])
    ax.hlines(at, 1.0, ratio, color=style.GREY, lw=1.5)
    for mask, mark, face, label in parted(~held, ("o", _DARK, "free"), ("s", "white", "fixed")):
        ax.plot(ratio[mask], at[mask], mark, color=_DARK, mfc=face, ms=6, label=label)
    ax.axvline(1.0, color=_LIMIT, lw=0.8)
    from matplotlib.ticker import LogLocator

    ax.set_xscale("log", base=2)
    ax.xaxis.set_major_locator(LogLocator(2, numticks=_TICKS))  # else it skips powers of 2 as it would of 10
    ax.xaxis.set_major_formatter("{x:g}")
    reach = 1.15 * max(float(np.max(np.abs(np.log(ratio)), initial=0.0)), np.log(2.0))
    what = f"Widths of least cost {within(found)}"
    cost = f"cost {found.cost:.4g}, as given {found.cost_before:.4g}"
    x = "width found over width as given (a number)"
    limits = (np.exp(-reach), np.exp(reach))
    return labelled(ax, what, cost, x=x, xlim=limits, legend="below" if held.any() else "")


def cost_against_limit(found: Allocation, *, front: Sequence[FrontPoint] = (), ax: Axes | None = None) -> Axes:
    """Least cost against the limit, with an allocation marked.

    Where a limit cannot be met there is no cost: a cross at the bottom, and no line over it.

    Parameters
    ----------
    found : Allocation
    front : sequence of FrontPoint
        Of `cost_front`.
    ax : Axes, optional

    Raises
    ------
    InputError
        If there is no front.
    """
    if not front:
        raise InputError("a front of cost is computed from the stack; give front=, from cost_front(stack, limits)")
    ax = axes_for(ax)
    ordered = sorted(front, key=lambda point: point.limit)
    limits = np.array([point.limit for point in ordered]) / ARCSEC
    least = np.array([np.nan if point.allocation is None else point.allocation.cost for point in ordered])
    ax.plot(limits, least, color=_DARK, marker="o", ms=4, label="least cost")
    missed = limits[np.isnan(least)]
    if missed.size:
        place: dict[str, Any] = {"transform": ax.get_xaxis_transform(), "clip_on": False}
        crosses = np.full(missed.size, 0.02)
        ax.plot(missed, crosses, "x", color=_LIMIT, label="cannot be met: no cost", **place)
    if found.limit is not None:
        ax.plot(found.limit / ARCSEC, found.cost, "s", color=_LIGHT, ms=8, mec=_LIMIT, label="the limit asked for")
    if np.isfinite(found.cost_before):
        ax.axhline(found.cost_before, color=_LIMIT, lw=0.8, ls="--", label="cost of the tolerances as given")
    return labelled(ax, "Least cost of the tolerances against the limit", x="limit, arcsec", y=_COST)
