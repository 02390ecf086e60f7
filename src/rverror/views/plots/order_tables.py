"""Plot of an order table: amplitude of each order over the condition that varies most."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType

import numpy as np

from rverror.base.errors import InputError
from rverror.base.numbers import way, with_unit
from rverror.base.units import to_display
from rverror.runs.order_table import OrderCase, OrderTable
from rverror.views.plots import style
from rverror.views.plots.figure import ORDER, Axes, axes_for, in_shown_unit, legend_beside, shown_unit, titled

_MARKS = "osD^vPX<>*"  # one an order: no more lines are told apart
_WIDTHS = (0.8, 2.8)  # points
_HIDES = 5.0  # an order so many times the middle one's size leaves nothing of the others to be seen
_DIGITS = 6  # of a condition: mean speeds of runs differ beyond
#: Dimension and label of each condition that can be the abscissa.
_BY: Mapping[str, tuple[str, str]] = MappingProxyType(
    {
        "torque": ("torque", "output torque, N*m"),
        "input_speed": ("angular_speed", "input speed, rpm"),
        "temperature": ("temperature", "temperature, degC"),
    }
)


def table_amplitudes(
    table: OrderTable, *, by: str | None = None, most: int = len(_MARKS), ax: Axes | None = None
) -> Axes:
    """Amplitude of each order over the torque, or over the input speed where that takes more values.

    Forward is drawn solid with full marks, reverse dashed with hollow ones.  Where another condition varies too, it is
    told by the width of the lines.  The ordinate is logarithmic where one order would hide the others.

    Parameters
    ----------
    table : OrderTable
    by : {"torque", "input_speed", "temperature", "order"}, optional
        The abscissa.  Where it is left out and the table knows none of the first three, it is the order.
    most : int
        So many orders are drawn over a condition, the largest; the title says of how many.

    Raises
    ------
    InputError
        If the table does not hold what is asked for, or holds no order.
    """
    values = {name: _values(table.cases, name) for name in _BY}
    if by is None:
        by = max(values, key=lambda name: len(values[name])) if any(values.values()) else "order"
    if by not in (*_BY, "order"):
        raise InputError(f"by = {by!r}: must be one of {', '.join((*_BY, 'order'))}")
    if by != "order" and not values[by]:
        raise InputError(f"by = {by!r}: no case of the table has it; choose another")
    if not 1 <= most <= len(_MARKS):
        raise InputError(f"most = {most}: must be 1 to {len(_MARKS)} orders, more are not told apart")
    largest: dict[float, float] = {}
    for case in table.cases:
        for order, size in zip(case.orders.tolist(), np.abs(case.waves).tolist(), strict=True):
            largest[order] = max(size, largest.get(order, 0.0))
    if not largest:
        raise InputError("the table holds no order; give one that does")
    ax = axes_for(ax, height=4.2)
    drawn = sorted(sorted(largest, key=lambda order: -largest[order])[:most])
    varied = [name for name in _BY if name != by and len(values[name]) > 1]
    groups: dict[tuple[float, ...], list[OrderCase]] = {}
    cases = [case for case in table.cases if by == "order" or _value(case, by) is not None]
    for case in cases:
        # what is not known stands before all that is
        rest = tuple(-np.inf if (value := _value(case, name)) is None else value for name in varied)
        groups.setdefault(rest, []).append(case)
    widths = dict(zip(sorted(groups), np.linspace(*_WIDTHS, len(groups)).tolist(), strict=True))
    senses = [sense for sense in (1.0, -1.0) if any(case.condition.direction == sense for case in cases)]
    title = ["order table"]
    if by == "order":
        _over_order(ax, groups, widths, senses)
    else:
        _over_condition(ax, by, drawn, groups, widths, senses)
        if len(drawn) < len(largest):
            title.append(f"the largest {len(drawn)} of {len(largest)} orders")
        if len(cases) < len(table.cases):
            title.append(f"{len(table.cases) - len(cases)} cases without {by.replace('_', ' ')} left out")
    if len(senses) == 1:
        title.append(way(senses[0]))
    if len(groups) > 1:
        first, last = (_told(varied, rest) for rest in (min(groups), max(groups)))
        title.append(f"{'small to large' if by == 'order' else 'thin to thick'}: {first} to {last}")
    label = ORDER if by == "order" else _BY[by][1]
    ax.set(xlabel=label, ylabel=f"amplitude, {shown_unit('angle')}")
    titled(ax, *title)
    sizes = np.array([size for order, size in largest.items() if by == "order" or order in drawn])
    if sizes.max() > _HIDES * np.median(sizes) and all((np.abs(case.waves) > 0).all() for case in cases):
        ax.set_yscale("log")
    else:
        ax.set_ylim(bottom=0)
    legend_beside(ax)
    return ax


def _value(case: OrderCase, name: str) -> float | None:
    """Condition of a case, core unit, to the digits that tell one from another."""
    value = getattr(case.condition, name)
    return None if value is None else float(f"{value:.{_DIGITS}g}")


def _values(cases: Sequence[OrderCase], name: str) -> set[float]:
    return {value for case in cases if (value := _value(case, name)) is not None}


def _told(names: Sequence[str], values: Sequence[float]) -> str:
    """Conditions in words, as the title has them."""
    return ", ".join(
        f"no {name.replace('_', ' ')}" if np.isinf(value) else with_unit(value, _BY[name][0])
        for name, value in zip(names, values, strict=True)
    )


def _over_condition(
    ax: Axes,
    by: str,
    orders: Sequence[float],
    groups: Mapping[tuple[float, ...], Sequence[OrderCase]],
    widths: Mapping[tuple[float, ...], float],
    senses: Sequence[float],
) -> None:
    for number, order in enumerate(orders):
        colour, mark = style.line_style(number)["color"], _MARKS[number]
        # the legend tells orders by full marks without a line, and the senses by lines without a mark
        ax.plot([], [], color=colour, marker=mark, ls="none", ms=5, label=f"order {order:.6g}")
        for rest, cases in groups.items():
            for sense in senses:
                points = sorted(
                    (to_display(value, _BY[by][0]), float(np.abs(wave)))
                    for case in cases
                    if case.condition.direction == sense and (value := _value(case, by)) is not None
                    for wave in case.waves[case.orders == order]
                )
                if not points:
                    continue
                at, size = np.array(points).T
                ax.plot(
                    at,
                    in_shown_unit(size, "angle"),
                    color=colour,
                    marker=mark,
                    ms=4,
                    lw=widths[rest],
                    ls="solid" if sense > 0 else style.DASHED,
                    mfc=colour if sense > 0 else "white",
                )
    if len(senses) > 1:
        for sense in senses:
            ax.plot([], [], color=style.BLACK, ls="solid" if sense > 0 else style.DASHED, label=way(sense))


def _over_order(
    ax: Axes,
    groups: Mapping[tuple[float, ...], Sequence[OrderCase]],
    widths: Mapping[tuple[float, ...], float],
    senses: Sequence[float],
) -> None:
    for sense in senses:
        label = way(sense)
        for rest, cases in groups.items():
            for case in cases:
                if case.condition.direction != sense:
                    continue
                colour = style.line_style(0 if sense > 0 else 1)["color"]
                ax.plot(
                    case.orders,
                    in_shown_unit(np.abs(case.waves), "angle"),
                    ls="none",
                    color=colour,
                    marker="o" if sense > 0 else "s",
                    ms=3 + 2 * widths[rest],
                    mfc=colour if sense > 0 else "none",
                    label=label,
                )
                label = "_"  # one entry of the legend for all
