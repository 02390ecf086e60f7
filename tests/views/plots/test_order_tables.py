"""The order table as drawn: its passport over the load, or its amplitudes over the speed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from drawn import alike_in_grey, legend, line, overlapping_texts, units_missing
from recordings import recording
from rverror import InputError
from rverror.base.units import ARCSEC
from rverror.runs import OrderTable, load_orders, orders_from_arrays

RPM = np.pi / 30


def table(**changes: Any) -> OrderTable:
    """Orders 1 and 40 in three conditions both ways; order 40 is 1, 2, 3 arcsec forward and half of it in reverse."""
    torque = np.repeat([300e3, 100e3, 200e3], 4)
    size = np.array([3, 6, 1.5, 5, 1, 4, 0.5, 5, 2, 5, 1, 5]) * ARCSEC
    rows = {"direction": [1, 1, -1, -1] * 3, "order": [40, 1] * 6, "amplitude": size, "phase": np.zeros(12)}
    return orders_from_arrays(**{"torque": torque, **rows} | changes)


def test_loads_are_the_abscissa_where_they_tell_a_law() -> None:
    ax = table(input_speed=np.repeat([30.0, 30.1, 30.2], 4)).plot()
    assert ax.get_xlabel() == "size of the output torque, N*m"
    x, y = line(ax, "order 40, forward")
    assert (list(x), list(y)) == (pytest.approx([100, 200, 300]), pytest.approx([1, 2, 3]))


def test_speeds_are_the_abscissa_of_a_table_of_one_load() -> None:
    ax = table(input_speed=np.repeat([30.0, 10.0, 20.0], 4) * RPM, torque=100e3).plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("input speed, rpm", "amplitude, arcsec")
    for label, sizes in (("order 40, forward", [1, 2, 3]), ("order 40, reverse", [0.5, 1, 1.5])):
        x, y = line(ax, label)
        assert (list(x), list(y)) == (pytest.approx([10, 20, 30]), pytest.approx(sizes))
    assert legend(ax) == [f"order {order}, {way}" for order in (1, 40) for way in ("forward", "reverse")]
    assert ax.get_yscale() == "log"


@pytest.mark.parametrize("known", [{"torque": None}, {"torque": 100e3, "input_speed": [10.0, 10.05]}])
def test_a_table_of_one_condition_is_refused(known: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="no order was measured at two torques or more"):
        orders_from_arrays(direction=[1, 1], order=[1, 40], cos=[3e-5, 1e-5], sin=[0.0, 0.0], **known).plot()


def test_tables_of_a_real_reducer_can_be_read() -> None:
    loads, speeds = (
        load_orders(recording("rv-81to1", f"{name}.csv")) for name in ("loads-100rpm-25degC", "speeds-forward-25degC")
    )
    heaviest = max(case.condition.torque or 0.0 for case in speeds.cases)
    one_load = OrderTable(cases=tuple(case for case in speeds.cases if case.condition.torque == heaviest))
    for table, label in ((loads, "size of the output torque, N*m"), (one_load, "input speed, rpm")):
        ax = table.plot()
        assert ax.get_xlabel() == label
        assert ax.get_yscale() == "log"
        assert units_missing(ax) == []
        assert alike_in_grey(ax) == []
        assert overlapping_texts(ax) == []
