"""Passports as drawn: measured points, laws as lines, directions and orders that grey print tells apart."""

from __future__ import annotations

import numpy as np
import pytest

from drawn import legend, line, units_missing
from rverror import InputError
from rverror.base.units import ARCSEC
from rverror.diagnosis.order_passport import passport
from rverror.runs.order_table import OrderCase, OrderTable, TableCondition
from rverror.views.plots.passports import passport_plot

TORQUES = (0.0, 5e5, 1e6)


def cases(orders: int = 2) -> list[OrderCase]:
    return [
        OrderCase(
            condition=TableCondition(direction=direction, torque=torque),
            orders=np.arange(1.0, orders + 1),
            waves=(1.0 + 2.0 * torque / 1e6 * direction) * ARCSEC / np.arange(1.0, orders + 1) + 0j,
        )
        for direction in (1.0, -1.0)
        for torque in TORQUES
    ]


def test_points_and_lines_are_the_amplitudes() -> None:
    table = cases()
    ax = passport_plot(passport(table), table)
    x, y = line(ax, "order 1, forward")
    assert x == pytest.approx([0, 500, 1000])
    assert y == pytest.approx([1, 2, 3])
    assert line(ax, "order 2, reverse")[1] == pytest.approx([0.5, 0.0, 0.5], abs=1e-9)
    laws = [item for item in ax.get_lines() if item.get_linestyle() != "None"]
    assert [law.get_ydata()[-1] for law in laws] == pytest.approx([3, 1, 1.5, 0.5])
    assert units_missing(ax) == []


def test_a_table_draws_its_own_passport() -> None:
    drawn, own = passport_plot(passport(cases()), cases()), OrderTable(cases=tuple(cases())).plot(kind="passport")
    for one, other in zip(drawn.get_lines(), own.get_lines(), strict=True):
        assert one.get_label() == other.get_label()
        np.testing.assert_array_equal(one.get_xydata(), other.get_xydata())


def test_grey_print_tells_directions_and_orders_apart() -> None:
    table = cases()
    ax = passport_plot(passport(table), table)
    marks = [item for item in ax.get_lines() if item.get_linestyle() == "None"]
    looks = {(item.get_marker(), item.get_markerfacecolor() == "white") for item in marks}
    assert len(looks) == len(marks) == 4
    dashes = [item.get_linestyle() for item in ax.get_lines() if item.get_linestyle() != "None"]
    assert dashes == ["-", "--", "-", "--"]


def test_the_strongest_six_are_drawn() -> None:
    table = cases(orders=8)
    assert legend(passport_plot(passport(table), table))[::2] == [f"order {k}, forward" for k in range(1, 7)]


def test_no_torque_is_no_plot() -> None:
    table = [OrderCase(condition=TableCondition(direction=1.0), orders=np.array([1.0]), waves=np.array([1e-6 + 0j]))]
    with pytest.raises(InputError, match="torque"):
        passport_plot(passport(table), table)
