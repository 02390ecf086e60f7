"""Plots of order tables: amplitudes over a condition, passports of orders, what accounts for each."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any

import numpy as np

from rverror.base.errors import InputError
from rverror.base.numbers import brief, way
from rverror.base.units import ARCSEC, to_display
from rverror.diagnosis.order_passport import OrderPassport, passport
from rverror.diagnosis.result import Diagnosis
from rverror.runs.order_table import OrderCase, OrderTable
from rverror.views.plots import style
from rverror.views.plots.figure import ORDER, Axes, axes_for, in_shown_unit, labelled, shown_unit

_MARKS = "osD^vPX<>*"  # one an order: no more lines are told apart
_DIGITS = 6  # of a condition: mean speeds of runs differ beyond
_MOST = 6  # orders whose passports are drawn
_CURVE = 121  # points of a law
#: Dimension and label of each condition that can be the abscissa.
CONDITIONS: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "torque": ("torque", "output torque, N*m"),
        "input_speed": ("angular_speed", "input speed, rpm"),
        "temperature": ("temperature", "temperature, degC"),
    }
)
#: Share of an order's power: its name, colour and hatch.
_SHARES: Mapping[str, tuple[str, str, str]] = MappingProxyType(
    {
        "parts": ("part errors", style.BLUE, ""),
        "compliance": ("compliance", style.ORANGE, "//"),
        "measuring_chain": ("measuring chain", style.GREY, ".."),
        "empirical": ("law only", "white", "xx"),
        "left": ("nothing", "white", ""),
    }
)


def table_amplitudes(
    table: OrderTable, *, by: str | None = None, most: int = len(_MARKS), ax: Axes | None = None
) -> Axes:
    """Amplitude of each order over the torque, or over the input speed where that takes more values.

    Forward is drawn solid with full marks, reverse dashed with hollow ones.  Cases that differ in another condition
    have lines of their own.

    Parameters
    ----------
    table : OrderTable
    by : {"torque", "input_speed", "temperature", "order"}, optional
        The abscissa.  Where it is left out and the table knows none of the first three, it is the order.
    most : int
        So many orders are drawn, the largest; the title says of how many.

    Raises
    ------
    InputError
        If the table does not hold what is asked for, or holds no order.
    """
    known = {name: {_value(case, name) for case in table.cases} - {None} for name in CONDITIONS}
    if by is None:
        by = max(known, key=lambda name: len(known[name])) if any(known.values()) else "order"
    if by not in (*CONDITIONS, "order"):
        raise InputError(f"by = {by!r}: must be one of {', '.join((*CONDITIONS, 'order'))}")
    if by != "order" and not known[by]:
        raise InputError(f"by = {by!r}: no case of the table has it; choose another")
    if not 1 <= most <= len(_MARKS):
        raise InputError(f"most = {most}: must be 1 to {len(_MARKS)} orders, more are not told apart")
    sizes = defaultdict[float, float](float)
    for case in table.cases:
        for order, size in zip(case.orders.tolist(), np.abs(case.waves).tolist(), strict=True):
            sizes[order] = max(size, sizes[order])
    if not sizes:
        raise InputError("the table holds no order; give one that does")
    ax = axes_for(ax, height=4.2)
    drawn = sorted(sorted(sizes, key=lambda order: -sizes[order])[:most])
    lines = _lines(table.cases, by)
    for (order, sense, _), points in lines.items():
        if order is None:
            ax.plot(*np.array(points).T, ms=4, **_look(0, sense) | {"ls": "none"})
        elif order in drawn:
            ax.plot(*np.array(sorted(points)).T, ms=4, lw=1.2, **_look(drawn.index(order), sense))
    # the legend tells orders by full marks without a line, and the senses by their lines
    for number, order in enumerate(() if by == "order" else drawn):
        ax.plot([], [], **_look(number, 1.0) | {"ls": "none"}, ms=5, label=f"order {order:.6g}")
    senses = sorted({sense for _, sense, _ in lines}, reverse=True)
    for sense in senses if len(senses) > 1 else ():
        ax.plot([], [], ms=4, **_look(0, sense) | {"color": style.BLACK}, label=way(sense))
    return labelled(
        ax,
        "order table",
        f"the largest {len(drawn)} of {len(sizes)} orders" if by != "order" and len(drawn) < len(sizes) else "",
        way(senses[0]) if len(senses) == 1 else "",
        x=ORDER if by == "order" else CONDITIONS[by][1],
        y=f"amplitude, {shown_unit('angle')}",
        yscale="log",
        legend="beside",
    )


def _value(case: OrderCase, name: str) -> float | None:
    """Condition of a case, core unit, to the digits that tell one from another."""
    value = getattr(case.condition, name)
    return None if value is None else float(f"{value:.{_DIGITS}g}")


def _lines(cases: Sequence[OrderCase], by: str) -> Mapping[tuple[Any, ...], list[tuple[float, float]]]:
    """Points of each order, direction and setting of what is not the abscissa, in the units shown."""
    lines = defaultdict[tuple[Any, ...], list[tuple[float, float]]](list)
    for case in cases:
        at = None if by == "order" else _value(case, by)
        if by != "order" and at is None:
            continue
        rest = tuple(_value(case, name) for name in CONDITIONS if name != by)
        for order, size in zip(case.orders.tolist(), in_shown_unit(np.abs(case.waves), "angle"), strict=True):
            place = order if at is None else to_display(at, CONDITIONS[by][0])
            lines[None if at is None else order, case.condition.direction, rest].append((place, float(size)))
    return lines


def _look(number: int, sense: float) -> dict[str, Any]:
    """Look of the n-th order in one direction."""
    colour = style.line_style(number)["color"]
    return {
        "color": colour,
        "marker": _MARKS[number],
        "ls": "solid" if sense > 0 else style.DASHED,
        "mfc": colour if sense > 0 else "white",
    }


def strongest_orders(found: OrderTable | Diagnosis, *, ax: Axes | None = None) -> Axes:
    """Passports of the strongest orders of a table or a diagnosis, as `passport_plot` draws them."""
    return passport_plot(found.passport if isinstance(found, Diagnosis) else passport(found.cases), ax=ax)


def passport_plot(passports: Sequence[OrderPassport], *, ax: Axes | None = None) -> Axes:
    """Amplitude of the six strongest orders over the size of the output torque, with constant and load part as lines.

    Forward is drawn with whole lines and filled marks, reverse with dashes and open ones.

    Parameters
    ----------
    passports : sequence of OrderPassport
        The strongest first.
    ax : Axes, optional

    Raises
    ------
    InputError
        If no order was measured at several torques.
    """
    if not any(law.slope is not None for one in passports for law in one.laws):
        raise InputError("no order was measured at two torques or more; a passport is drawn over the torque")
    ax = axes_for(ax, height=4.2)
    for number, one in enumerate(passports[:_MOST]):
        for law in one.laws:
            look = _look(number, law.direction)
            if law.slope is not None:
                torque = np.linspace(0.0, float(law.torque.max()), _CURVE)
                size = np.abs(law.constant.value + law.slope.value * torque)
                line = look | {"marker": ""}
                ax.plot(in_shown_unit(torque, "torque"), in_shown_unit(size, "angle"), lw=1.2, **line)
            label = f"order {brief(one.order, 6)}, {way(law.direction)}"
            measured = in_shown_unit(np.abs(law.waves), "angle")
            ax.plot(in_shown_unit(law.torque, "torque"), measured, ms=5, label=label, **look | {"ls": "none"})
    return labelled(
        ax,
        "orders over the load",
        x="size of the output torque, N*m",
        y="amplitude, arcsec",
        yscale="log",  # the strongest order is often tens of times the next
        legend="beside",
        legend_title="lines: constant and load part",
    )


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
    for name, (label, face, hatch) in _SHARES.items():
        part = 100 * np.array([getattr(share, name) for share in diagnosis.shares])
        look: dict[str, Any] = {"color": face, "hatch": hatch, "edgecolor": "black", "linewidth": 0.5}
        ax.bar(at, part, bottom=np.where(part < 0, down, up), label=label, **look)
        up, down = up + np.maximum(part, 0), down + np.minimum(part, 0)
    ticks = [f"{brief(one.order, 6)}\n{one.amplitude / ARCSEC:.3g}" for one in diagnosis.shares]
    ax.set_xticks(at, ticks, size="x-small")
    ax.axhline(0, color="black", lw=0.8)
    return labelled(
        ax,
        "what accounts for each order",
        x="order, per output turn, and its amplitude, arcsec",
        y="share of the power, %",
        legend="beside",
    )
