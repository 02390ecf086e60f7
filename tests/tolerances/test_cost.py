"""Cost curves: values, slopes against differences, refusals."""

import math

import pytest
from hypothesis import given, strategies as st

from rverror import tolerance
from rverror.base.errors import InputError
from rverror.tolerances.cost import Grades, Reciprocal, ReciprocalSquare

AMOUNT = st.floats(0.01, 1e4)
WIDTH = st.floats(1e-4, 1.0)
TABLE = Grades((0.010, 0.003, 0.005), (9.0, 30.0, 18.0), ("IT6", "IT4", "IT5"))


@pytest.mark.parametrize(("curve", "power"), [(Reciprocal, 1), (ReciprocalSquare, 2)])
@given(price=AMOUNT, at=WIDTH, base=AMOUNT, factor=st.floats(0.1, 10.0))
def test_cost_above_the_base_is_a_power_of_the_width(curve, power, price, at, base, factor):
    cost = curve(price=price, at=at, base=base)
    assert cost.cost(at) == pytest.approx(base + price)
    assert cost.cost(at * factor) - base == pytest.approx(price / factor**power, rel=1e-6, abs=1e-9 * base)


def test_grades_are_kept_finest_first():
    assert TABLE.widths == (0.003, 0.005, 0.010)
    assert TABLE.prices == (30.0, 18.0, 9.0)
    assert TABLE.names == ("IT4", "IT5", "IT6")


@pytest.mark.parametrize(
    ("width", "price"),
    [
        (0.003, 30.0),
        (0.0049, 30.0),
        (0.005, 18.0),
        (0.005 * (1 - 1e-12), 18.0),
        (0.009, 18.0),
        (0.010, 9.0),
        (1.0, 9.0),
    ],
)
def test_a_width_costs_what_the_next_finer_grade_costs(width, price):
    assert TABLE.cost(width) == price


def test_a_width_finer_than_all_grades_is_refused():
    with pytest.raises(InputError, match=r"0\.002 is finer than the finest grade IT4, 0\.003; add a finer grade"):
        TABLE.cost(0.002)


@pytest.mark.parametrize("curve", [Reciprocal, ReciprocalSquare])
@pytest.mark.parametrize(
    ("values", "says"),
    [
        ({"price": -1.0, "at": 1.0}, "price of a cost is -1; give a finite number 0 or more"),
        ({"price": 1.0, "at": 0.0}, r"width of a cost \('at'\) is 0; give a finite number above 0"),
        ({"price": 1.0, "at": math.inf}, "'at'"),
        ({"price": 1.0, "at": 1.0, "base": math.nan}, "base of a cost is nan"),
    ],
)
def test_curves_refuse_what_is_no_cost(curve, values, says):
    with pytest.raises(InputError, match=says):
        curve(**values)


@pytest.mark.parametrize("cost", [Reciprocal(1.0, 1.0), ReciprocalSquare(1.0, 1.0), TABLE])
@pytest.mark.parametrize("width", [0.0, -1.0, math.nan, math.inf])
def test_no_cost_of_no_width(cost, width):
    with pytest.raises(InputError, match="give a finite width above 0"):
        cost.cost(width)


@pytest.mark.parametrize(
    ("widths", "prices", "names", "says"),
    [
        ((), (), (), "at least one grade"),
        ((1.0,), (1.0, 2.0), ("a",), "widths 1, prices 2, names 1"),
        ((1.0, 0.0), (1.0, 2.0), ("a", "b"), "width of the grade b is 0"),
        ((1.0, 2.0), (1.0, math.nan), ("a", "b"), "price of the grade b is nan"),
        ((1.0, 1.0), (2.0, 1.0), ("a", "b"), "grades a and b have one width, 1; keep one"),
        ((2.0, 1.0), (5.0, 4.0), ("wide", "fine"), "wide is wider than fine and costs more, 5 against 4"),
    ],
)
def test_grades_refuse_what_is_no_table(widths, prices, names, says):
    with pytest.raises(InputError, match=says):
        Grades(widths, prices, names)


@pytest.mark.parametrize("bounds", [("1 um", "20 um", "30 um"), ("1 um",), 5.0])
def test_bounds_of_a_width_are_two(bounds):
    with pytest.raises(InputError, match="bounds: give the least and the largest width"):
        tolerance("crank.eccentricity", "10 um", bounds=bounds)
