"""Plot of passports of orders: amplitudes over the torque, as measured and by their laws."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import brief, way
from rverror.diagnosis.order_passport import SAME_ORDER, OrderPassport, passport
from rverror.runs.order_table import OrderCase, OrderTable
from rverror.views.plots.figure import DASHED, NOTHING, axes_for, in_shown_unit, legend_beside, line_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MARKS = ("o", "s", "^", "D", "v", "P")  # as many orders as colours; marks tell them apart in grey
_CURVE = 121  # points of a law


def passport_plot(passports: Sequence[OrderPassport], cases: Sequence[OrderCase], *, ax: Axes | None = None) -> Axes:
    """Amplitude of the strongest orders over the size of the output torque, with constant and load part as lines.

    Forward is drawn with whole lines and filled marks, reverse with dashes and open ones.

    Parameters
    ----------
    passports : sequence of OrderPassport
        The strongest first; six of them are drawn at the most.
    cases : sequence of OrderCase
        What they were made of.
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
    if not any(case.condition.torque is not None for case in cases):
        raise InputError("no case holds a torque; a passport is drawn over the torque")
    ax = axes_for(ax, height=4.2)
    for number, one in enumerate(passports[: len(_MARKS)]):
        colour = line_style(number)["color"]
        for law in one.laws:
            forward = law.direction > 0
            if law.slope is not None:
                torque = np.linspace(0.0, float(law.torque.max()), _CURVE)
                size = np.abs(law.constant.value + law.slope.value * torque)
                shown = in_shown_unit(torque, "torque"), in_shown_unit(size, "angle")
                ax.plot(*shown, color=colour, ls="solid" if forward else DASHED, lw=1.2)
            look: dict[str, Any] = {
                "marker": _MARKS[number],
                "mfc": colour if forward else "white",
                "ms": 5,
                "ls": "none",
            }
            label = f"order {brief(one.order, 6)}, {way(law.direction)}"
            ax.plot(*_points(one, law.direction, cases), color=colour, label=label, **look)
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


def _points(one: OrderPassport, direction: float, cases: Sequence[OrderCase]) -> tuple[Array, Array]:
    """Torques and amplitudes of an order in one direction, as measured."""
    held = [
        (case.condition.torque, abs(case.waves[place]))
        for case in cases
        if case.condition.direction == direction and case.condition.torque is not None
        for place in np.flatnonzero(np.abs(case.orders - one.order) <= SAME_ORDER)
    ]
    torque, size = np.array(held, dtype=np.float64).reshape(-1, 2).T
    return in_shown_unit(torque, "torque"), in_shown_unit(size, "angle")
