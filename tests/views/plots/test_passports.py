"""Passports as drawn: measured points, laws as lines, directions and orders that grey print tells apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drawn import legend, line, units_missing
from every_kind import diagnosis
from rverror import InputError
from rverror.base.units import ARCSEC
from rverror.diagnosis.order_passport import passport
from rverror.diagnosis.result import Diagnosis, OrderShare
from rverror.runs.order_table import OrderCase, OrderTable, TableCondition
from rverror.views.plots.order_tables import order_shares, passport_plot
from rverror.views.plots.page_figures import figure_of

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
    ax = passport_plot(passport(table))
    x, y = line(ax, "order 1, forward")
    assert x == pytest.approx([0, 500, 1000])
    assert y == pytest.approx([1, 2, 3])
    assert line(ax, "order 2, reverse")[1] == pytest.approx([0.5, 0.0, 0.5], abs=1e-9)
    laws = [item for item in ax.get_lines() if item.get_linestyle() != "None"]
    assert [law.get_ydata()[-1] for law in laws] == pytest.approx([3, 1, 1.5, 0.5])
    assert units_missing(ax) == []


def test_a_table_draws_its_own_passport() -> None:
    drawn, own = passport_plot(passport(cases())), OrderTable(cases=tuple(cases())).plot(kind="passport")
    for one, other in zip(drawn.get_lines(), own.get_lines(), strict=True):
        assert one.get_label() == other.get_label()
        np.testing.assert_array_equal(one.get_xydata(), other.get_xydata())


def test_grey_print_tells_directions_and_orders_apart() -> None:
    table = cases()
    ax = passport_plot(passport(table))
    marks = [item for item in ax.get_lines() if item.get_linestyle() == "None"]
    looks = {(item.get_marker(), item.get_markerfacecolor() == "white") for item in marks}
    assert len(looks) == len(marks) == 4
    dashes = [item.get_linestyle() for item in ax.get_lines() if item.get_linestyle() != "None"]
    assert dashes == ["-", "--", "-", "--"]


def test_the_strongest_six_are_drawn() -> None:
    table = cases(orders=8)
    assert legend(passport_plot(passport(table)))[::2] == [f"order {k}, forward" for k in range(1, 7)]


def test_no_torque_is_no_plot() -> None:
    table = [OrderCase(condition=TableCondition(direction=1.0), orders=np.array([1.0]), waves=np.array([1e-6 + 0j]))]
    with pytest.raises(InputError, match="torque"):
        passport_plot(passport(table))


def diagnosed(table: list[OrderCase]) -> Diagnosis:
    """Of a table with two orders, of which the second is worked against by part errors."""
    shares = (
        OrderShare(1.0, 60 * ARCSEC, 0.1, 0.2, 0.6, 0.1, 0.0),
        OrderShare(2.0, 0.5 * ARCSEC, -0.25, 0.25, 0.0, 0.4, 0.6),
    )
    return replace(diagnosis(), traces=(), shares=shares, passport=passport(table))


def test_shares_stand_on_one_another_and_what_works_against_them_below_zero() -> None:
    ax = order_shares(diagnosed(cases()))
    assert [text.get_text() for text in ax.get_legend().get_texts()] == [
        "part errors", "compliance", "measuring chain", "law only", "nothing"
    ]  # fmt: skip
    first, second = ([bars[place] for bars in ax.containers] for place in (0, 1))
    assert [bar.get_y() for bar in first] == pytest.approx([0, 10, 30, 90, 100])
    assert [bar.get_height() for bar in first] == pytest.approx([10, 20, 60, 10, 0])
    assert [bar.get_y() for bar in second] == pytest.approx([0, 0, 25, 25, 65])
    assert second[0].get_height() == pytest.approx(-25)
    assert [tick.get_text() for tick in ax.get_xticklabels()] == ["1\n60", "2\n0.5"]
    assert units_missing(ax) == []


def test_a_diagnosis_of_tables_is_drawn_by_its_passport_and_shares() -> None:
    """It has no waveform, and one of a single load no passport over loads."""
    assert [len(figure_of(diagnosed(table)).axes) for table in (cases(), cases()[:1])] == [2, 1]
    (x, y) = line(figure_of(diagnosed(cases())).axes[0], "order 1, forward")
    assert (list(x), list(y)) == (pytest.approx([0.0, 500.0, 1000.0]), pytest.approx([1.0, 2.0, 3.0]))
    with pytest.raises(InputError, match="order tables have no waveform; draw kind='passport'"):
        diagnosed(cases()).plot()
    with pytest.raises(InputError, match="no order table was diagnosed"):
        order_shares(diagnosis())
