"""Numbers as instruments print them: what is read, and what leaves the decimal sign open."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, strategies as st

from rverror.runs.bench.text import Undecided, found_decimal, number_in


def printed(value: float, digits: int, decimal: str) -> str:
    return f"{value:.{digits}f}".replace(".", decimal)


@given(value=st.floats(-1e9, 1e9), digits=st.integers(0, 9), decimal=st.sampled_from(".,"))
def test_printed_numbers_read_back(value: float, digits: int, decimal: str) -> None:
    assert number_in(f" {printed(value, digits, decimal)} ", decimal) == float(f"{value:.{digits}f}")


@pytest.mark.parametrize(
    ("decimal", "cell", "value"),
    [
        (".", "1e-3", 1e-3),
        (",", "-1,5E+02", -150.0),
        (".", "nan", math.nan),
        (".", "", None),
        (".", "1,5", None),
        (",", "1.5", None),
        (".", "1_000", None),
        (".", "12:30", None),
        (",", "1.234,5", None),
        (".", "1 2345", None),
    ],
)
def test_cells(decimal: str, cell: str, value: float | None) -> None:
    read = number_in(cell, decimal)
    assert read == value if value is None or not math.isnan(value) else math.isnan(read)  # type: ignore[arg-type]


@given(
    values=st.lists(st.floats(-999, 999), min_size=1, max_size=30), digits=st.integers(1, 8), sign=st.sampled_from(".,")
)
def test_the_sign_is_found_where_the_digits_tell(values: list[float], digits: int, sign: str) -> None:
    """Three digits behind the sign after a leading 1 to 9 tell nothing, everything else does."""
    cells = [printed(value, digits, sign) for value in values]
    telling = digits != 3 or any(cell.lstrip("-").startswith("0") for cell in cells)
    found = found_decimal(["words, and. more", "°", *cells])
    if telling:
        assert found == sign
    else:
        assert isinstance(found, Undecided)
        assert found.cell == cells[0]
        assert found.place == 2
        assert found.why == f"may be {cells[0].replace(sign, '.')} or {cells[0].replace(sign, '')}"


@pytest.mark.parametrize(
    ("cells", "why"),
    [
        (["1.234,5"], "holds a point and a comma"),
        (["1.234.567"], "holds '.' more than once"),
        (["1,5", "2.5"], "holds '.', cells before it ','"),
        (["1.234", "1,5"], "holds ',', cells before it '.'"),
    ],
)
def test_what_contradicts_itself(cells: list[str], why: str) -> None:
    found = found_decimal(cells)
    assert isinstance(found, Undecided)
    assert found.why == why
    assert found.cell == cells[-1]


def test_between_commas_a_point_is_a_decimal_sign() -> None:
    assert found_decimal(["1.234"], point_is_decimal=True) == "."
    assert isinstance(found_decimal(["1,234"], point_is_decimal=True), Undecided)  # as in quotes
    assert found_decimal(["12", "word"]) == ""
