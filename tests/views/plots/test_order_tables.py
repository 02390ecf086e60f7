"""The order table as drawn: amplitudes over the condition that varies most, directions told apart, nothing lost."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes

from drawn import alike_in_grey, legend, overlapping_texts, units_missing
from recordings import recording
from rverror import InputError
from rverror.base.units import ARCSEC
from rverror.runs import OrderTable, load_orders, orders_from_arrays


def table(**changes: Any) -> OrderTable:
    """Orders 1 and 40 at three loads both ways; order 40 is 1, 2, 3 arcsec forward and half of it in reverse."""
    torque = np.repeat([300e3, 100e3, 200e3], 4)
    size = np.array([3, 6, 1.5, 5, 1, 4, 0.5, 5, 2, 5, 1, 5]) * ARCSEC
    rows = {"direction": [1, 1, -1, -1] * 3, "order": [40, 1] * 6, "amplitude": size, "phase": np.zeros(12)}
    return orders_from_arrays(**{"torque": torque, **rows} | changes)


def lines(ax: Axes) -> list[tuple[list[float], list[float], str, bool, float]]:
    """Lines with data: abscissa, ordinate, dashes, full marks, width."""
    return [
        (
            np.asarray(one.get_xdata()).tolist(),
            np.asarray(one.get_ydata()).tolist(),
            str(one.get_linestyle()),
            one.get_markerfacecolor() == one.get_color(),
            one.get_linewidth(),
        )
        for one in ax.get_lines()
        if len(np.asarray(one.get_xdata()))
    ]


def test_amplitudes_over_the_torque_in_order_and_by_direction() -> None:
    ax = table().plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("output torque, N*m", "amplitude, arcsec")
    found = {tuple(np.round(y, 9)): (x, dashes, full) for x, y, dashes, full, _ in lines(ax)}
    assert len(found) == 4
    x, dashes, full = found[1, 2, 3]
    assert (x, dashes, full) == (pytest.approx([100, 200, 300]), "-", True)
    x, dashes, full = found[0.5, 1, 1.5]
    assert (x, dashes, full) == (pytest.approx([100, 200, 300]), "--", False)
    assert legend(ax) == ["order 1", "order 40", "forward", "reverse"]
    assert ax.get_yscale() == "log"


def test_the_speed_where_it_varies_more() -> None:
    speed = np.arange(1, 13) * 10.0
    ax = table(input_speed=speed, torque=None).plot()
    assert ax.get_xlabel() == "input speed, rpm"
    assert table(input_speed=np.repeat([1.0, 2.0], 6)).plot().get_xlabel() == "output torque, N*m"
    assert table(temperature=280 + speed, torque=None).plot().get_xlabel() == "temperature, degC"


def test_by_chooses_and_cases_that_differ_otherwise_have_their_own_lines() -> None:
    ax = table(input_speed=np.repeat([30.0, 10.0, 20.0], 4)).plot(by="input_speed")
    assert ax.get_xlabel() == "input speed, rpm"
    assert sorted(round(y[0], 9) for _, y, dashes, _, _ in lines(ax) if dashes == "-" and y[0] < 3.5) == [1, 2, 3]


def test_without_any_condition_the_orders_are_the_abscissa() -> None:
    made = orders_from_arrays(direction=[1, 1, -1], order=[1, 40, 40], cos=[3e-5, 1e-5, 2e-5], sin=[0.0, 0.0, 0.0])
    ax = made.plot()
    assert ax.get_xlabel() == "order, per output turn"
    assert legend(ax) == ["forward", "reverse"]
    assert [x for x, *_ in lines(ax)] == [[1, 40], [40]]


def test_what_is_not_drawn_is_said() -> None:
    many = orders_from_arrays(
        direction=1, torque=np.repeat([1e3, 2e3], 12), order=list(range(1, 13)) * 2, cos=np.arange(1, 25) * 1e-6,
        sin=np.zeros(24),
    )  # fmt: skip
    ax = many.plot()
    assert ax.get_title() == "order table, the largest 10 of 12 orders, forward"
    assert legend(ax) == [f"order {order}" for order in range(3, 13)]
    assert many.plot(most=2).get_title() == "order table, the largest 2 of 12 orders, forward"


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"by": "load"}, "by = 'load': must be one of torque, input_speed, temperature, order"),
        ({"by": "input_speed"}, "no case of the table has it; choose another"),
        ({"most": 0}, "most = 0: must be 1 to 10 orders"),
        ({"most": 11}, "most = 11: must be 1 to 10 orders"),
    ],
)
def test_wrong_options(options: dict[str, Any], told: str) -> None:
    with pytest.raises(InputError, match=told):
        table().plot(**options)


def test_a_table_without_orders_is_refused() -> None:
    with pytest.raises(InputError, match="holds no order; give one that does"):
        OrderTable(cases=()).plot()


@pytest.mark.parametrize(
    ("name", "label"),
    [("loads-100rpm-25degC", "output torque, N*m"), ("speeds-forward-25degC", "input speed, rpm")],
)
def test_tables_of_a_real_reducer_can_be_read(name: str, label: str) -> None:
    ax = load_orders(recording("rv-81to1", f"{name}.csv")).plot()
    assert ax.get_xlabel() == label
    assert ax.get_yscale() == "log"
    assert units_missing(ax) == []
    assert alike_in_grey(ax) == []
    assert overlapping_texts(ax) == []
