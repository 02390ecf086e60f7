"""Plots of passports of orders, amplitudes over the torque as measured and by their laws, and of diagnosed tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import brief, way
from rverror.base.units import ARCSEC
from rverror.diagnosis.order_passport import SAME_ORDER, OrderPassport, passport
from rverror.diagnosis.result import Diagnosis
from rverror.runs.order_table import OrderCase, OrderTable
from rverror.views.plots import style
from rverror.views.plots.figure import (
    NOTHING,
    Axes,
    Figure,
    axes_for,
    in_shown_unit,
    labelled,
    legend_beside,
    new_figure,
)
from rverror.views.plots.resonances import resonance_plot

_MARKS = ("o", "s", "^", "D", "v", "P")  # as many orders as colours; marks tell them apart in grey
_CURVE = 121  # points of a law
_SHARES = {
    "parts": "part errors",
    "compliance": "compliance",
    "measuring_chain": "measuring chain",
    "empirical": "law only",
    "left": "nothing",
}
_FACES = (
    (style.BLUE, ""),
    (style.ORANGE, "//"),
    (style.GREY, ".."),
    ("white", "xx"),
    ("white", ""),
)  # hatched, for grey print


def passport_plot(
    passports: Sequence[OrderPassport], cases: Sequence[OrderCase] | None = None, *, ax: Axes | None = None
) -> Axes:
    """Amplitude of the strongest orders over the size of the output torque, with constant and load part as lines.

    Forward is drawn with whole lines and filled marks, reverse with dashes and open ones.

    Parameters
    ----------
    passports : sequence of OrderPassport
        The strongest first; six of them are drawn at the most.
    cases : sequence of OrderCase, optional
        What they were made of; where left out, what their laws were read from is drawn.
    ax : Axes, optional
        Where to draw; a new figure where left out.

    Returns
    -------
    Axes

    Raises
    ------
    InputError
        If no case holds a torque.
    """
    if not any(np.isfinite(law.torque).any() for one in passports for law in one.laws):
        raise InputError("no case holds a torque; a passport is drawn over the torque")
    ax = axes_for(ax, height=4.2)
    for number, one in enumerate(passports[: len(_MARKS)]):
        colour = style.line_style(number)["color"]
        for law in one.laws:
            forward = law.direction > 0
            if law.slope is not None:
                torque = np.linspace(0.0, float(law.torque.max()), _CURVE)
                size = np.abs(law.constant.value + law.slope.value * torque)
                shown = in_shown_unit(torque, "torque"), in_shown_unit(size, "angle")
                ax.plot(*shown, color=colour, ls="solid" if forward else style.DASHED, lw=1.2)
            look: dict[str, Any] = {
                "marker": _MARKS[number],
                "mfc": colour if forward else "white",
                "ms": 5,
                "ls": "none",
            }
            label = f"order {brief(one.order, 6)}, {way(law.direction)}"
            points = _shown(law.torque, np.abs(law.waves)) if cases is None else _points(one, law.direction, cases)
            ax.plot(*points, color=colour, label=label, **look)
    sizes = np.concatenate([np.asarray(item.get_ydata()) for item in ax.get_lines() if item.get_linestyle() == "None"])
    ax.set(xlabel="size of the output torque, N*m", ylabel="amplitude, arcsec", title="orders over the load")
    if (sizes > NOTHING).any():
        ax.set_yscale("log")  # the strongest order is often tens of times the next
        ax.set_ylim(bottom=0.7 * float(sizes[sizes > NOTHING].min()))
    legend_beside(ax, title="lines: constant and load part")
    return ax


def table_passport(table: OrderTable, *, ax: Axes | None = None) -> Axes:
    """Passports of a table's strongest orders, as `passport_plot` draws them.

    Raises
    ------
    InputError
        If no case holds a torque.
    """
    return passport_plot(passport(table.cases), table.cases, ax=ax)


def order_shares(diagnosis: Diagnosis, *, ax: Axes | None = None) -> Axes:
    """What accounts for the power of each order of diagnosed tables, as bars that make 100 % together.

    A part that works against the others stands below zero.

    Raises
    ------
    InputError
        If no table was diagnosed.
    """
    if not diagnosis.shares:
        raise InputError("no order table was diagnosed, so no order has shares; give order tables to diagnose")
    ax = axes_for(ax, height=4.2)
    at = np.arange(len(diagnosis.shares))
    up, down = np.zeros(at.size), np.zeros(at.size)
    for (name, label), (face, hatch) in zip(_SHARES.items(), _FACES, strict=True):
        part = 100 * np.array([getattr(share, name) for share in diagnosis.shares])
        look: dict[str, Any] = {"color": face, "hatch": hatch, "edgecolor": "black", "linewidth": 0.5}
        ax.bar(at, part, bottom=np.where(part < 0, down, up), label=label, **look)
        up, down = up + np.maximum(part, 0), down + np.minimum(part, 0)
    ax.set_xticks(
        at, [f"{brief(one.order, 6)}\n{one.amplitude / ARCSEC:.3g}" for one in diagnosis.shares], size="x-small"
    )
    ax.axhline(0, color="black", lw=0.8)
    return labelled(
        ax,
        "what accounts for each order",
        x="order, per output turn, and its amplitude, arcsec",
        y="share of the power, %",
        legend="beside",
    )


def table_figure(diagnosis: Diagnosis) -> Figure:
    """Passport of diagnosed tables, where they tell loads, natural frequencies, and what accounts for their orders."""
    loads = any(np.isfinite(law.torque).any() for one in diagnosis.passport for law in one.laws)
    speeds = bool(diagnosis.resonances)
    figure, axes = new_figure(1 + loads + speeds, width=10.0, height=4.2)
    if loads:
        passport_plot(diagnosis.passport, ax=axes[0])
    if speeds:
        resonance_plot(diagnosis, ax=axes[-2])
    order_shares(diagnosis, ax=axes[-1])
    return figure


def _points(one: OrderPassport, direction: float, cases: Sequence[OrderCase]) -> tuple[Array, Array]:
    """Torques and amplitudes of an order in one direction, as measured."""
    held = [
        (case.condition.torque, abs(case.waves[place]))
        for case in cases
        if case.condition.direction == direction and case.condition.torque is not None
        for place in np.flatnonzero(np.abs(case.orders - one.order) <= SAME_ORDER)
    ]
    return _shown(*np.array(held, dtype=np.float64).reshape(-1, 2).T)


def _shown(torque: Array, size: Array) -> tuple[Array, Array]:
    return in_shown_unit(torque, "torque"), in_shown_unit(size, "angle")
