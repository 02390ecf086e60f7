"""Plots of an error budget and of an allocation: axes in, axes out.  matplotlib comes with the extra ``plot``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rverror.allocate import Allocation, FrontPoint
from rverror.error_budget import ErrorBudget
from rverror.plot import new_figure
from rverror.units import ARCSEC

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours, which stay apart in print and for colour-blind eyes; hatches tell them apart in grey.
_DARK, _LIGHT, _LIMIT = "#0072B2", "#E69F00", "#000000"
_LEVELS = ((0.5, ":"), (0.95, "--"), (0.99, "-."))
_SHOWN = 15  # bars for which there is room


def budget_figure(found: ErrorBudget, *, limit: float | None = None) -> Figure:
    """Contributions above the distribution of the peak-to-peak.

    Parameters
    ----------
    found : ErrorBudget
    limit : float, optional
        Of the peak-to-peak, rad.

    Returns
    -------
    Figure
    """
    figure, (upper, lower) = new_figure(2, height=3.6)
    contributions(found, ax=upper)
    distribution(found, limit=limit, ax=lower)
    return figure


def contributions(found: ErrorBudget, *, ax: Axes | None = None) -> Axes:
    """Bars of what each tolerance contributes: share of the variance, and total Sobol index of the peak-to-peak.

    Parameters
    ----------
    found : ErrorBudget
    ax : Axes, optional
        Where to draw; a new figure where left out.

    Returns
    -------
    Axes
    """
    ax = ax or new_figure()[1][0]
    entries = found.closed.contributions
    moving = [e for e, entry in enumerate(entries) if entry.effect == "wave"]
    order = sorted(moving, key=lambda e: -entries[e].share)[:_SHOWN][::-1]
    at = np.arange(len(order))
    shares = [100 * entries[e].share for e in order]
    ax.barh(at + 0.2, shares, height=0.38, color=_DARK, label="share of the variance")
    if found.indices is not None:
        total, low, high = (100 * getattr(found.indices, f"total{end}")[order] for end in ("", "_low", "_high"))
        ax.barh(
            at - 0.2,
            total,
            height=0.38,
            color=_LIGHT,
            edgecolor="#000000",
            linewidth=0.4,
            hatch="///",
            xerr=(total - low, high - total),
            error_kw={"linewidth": 0.8, "capsize": 2},
            label="total Sobol index of the peak-to-peak, 95 % interval",
        )
    ax.set_yticks(at, [entries[e].label for e in order], fontsize=8)
    hidden = len(moving) - len(order)
    ax.set(
        xlabel="contribution, %",
        title="What each tolerance contributes" + (f" ({hidden} smaller not shown)" if hidden else ""),
    )
    ax.legend(loc="lower right", fontsize=8, frameon=False)
    return ax


def distribution(found: ErrorBudget, *, limit: float | None = None, ax: Axes | None = None) -> Axes:
    """Histogram of the peak-to-peak of the virtual units with quantiles, and the yield at a limit.

    Parameters
    ----------
    found : ErrorBudget
    limit : float, optional
        rad.
    ax : Axes, optional
        Where to draw; a new figure where left out.

    Returns
    -------
    Axes
    """
    ax = ax or new_figure()[1][0]
    sizes = found.units.peak_to_peak / ARCSEC
    ax.hist(sizes, bins=80, color=_DARK, alpha=0.35, density=True)
    for level, style in _LEVELS:
        value = found.units.quantile(level).value / ARCSEC
        ax.axvline(value, color=_DARK, ls=style, lw=1.3, label=f"P{100 * level:g}: {value:.1f} arcsec")
    if limit is not None:
        share = found.units.yield_at(limit)
        ax.axvline(
            limit / ARCSEC,
            color=_LIMIT,
            lw=1.8,
            label=f"limit {limit / ARCSEC:g} arcsec: {100 * share.value:.4g} % pass",
        )
    ax.set(
        xlabel="peak-to-peak transmission error, arcsec",
        ylabel="units per arcsec",
        title=f"{found.units.count} virtual units, closed form",
    )
    ax.legend(fontsize=8, frameon=False)
    return ax


def front_figure(front: Sequence[FrontPoint], chosen: Allocation | None = None) -> Figure:
    """Least cost against the limit.

    Parameters
    ----------
    front : sequence of FrontPoint
    chosen : Allocation, optional
        The one to mark.

    Returns
    -------
    Figure
    """
    figure, (ax,) = new_figure(1, height=4.0)
    cost_against_limit(front, chosen, ax=ax)
    return figure


def cost_against_limit(
    front: Sequence[FrontPoint], chosen: Allocation | None = None, *, ax: Axes | None = None
) -> Axes:
    """Line of least cost against the limit; limits that cannot be met are marked at the bottom.

    Parameters
    ----------
    front : sequence of FrontPoint
    chosen : Allocation, optional
        The one to mark.
    ax : Axes, optional
        Where to draw; a new figure where left out.

    Returns
    -------
    Axes
    """
    ax = ax or new_figure()[1][0]
    met = [(point.limit / ARCSEC, point.allocation) for point in front if point.allocation is not None]
    ax.plot(
        [limit for limit, _ in met], [found.cost for _, found in met], color=_DARK, marker="o", ms=4, label="least cost"
    )
    missed = [point.limit / ARCSEC for point in front if point.allocation is None]
    if missed:
        ax.plot(
            missed, [0.02] * len(missed), "x", color=_LIMIT, transform=ax.get_xaxis_transform(), label="cannot be met"
        )
    if chosen is not None:
        ax.plot(chosen.limit / ARCSEC, chosen.cost, "s", color=_LIGHT, ms=8, mec=_LIMIT, label="the limit asked for")
        ax.axhline(chosen.cost_before, color=_LIMIT, lw=0.8, ls="--", label="cost of the tolerances as given")
    ax.set(xlabel="limit, arcsec", ylabel="cost", title="Least cost of the tolerances against the limit")
    ax.legend(fontsize=8, frameon=False)
    return ax
