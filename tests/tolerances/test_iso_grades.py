"""ISO 286-1 widths against the formulas that the standard rounds."""

import itertools
import math

import pytest
from hypothesis import given, strategies as st

from rverror.base.errors import InputError
from rverror.tolerances.grades import BANDS, WIDTHS, it_width

MEANS = [math.sqrt(low * high) for low, high in itertools.pairwise((1.0, *BANDS))]
FACTORS = {"IT5": 7, "IT6": 10, "IT7": 16, "IT8": 25, "IT9": 40, "IT10": 64, "IT11": 100}


def unit(mean):
    """Tolerance factor i, um."""
    return 0.45 * mean ** (1 / 3) + 0.001 * mean


@pytest.mark.parametrize("grade", FACTORS)
@pytest.mark.parametrize("band", range(len(BANDS)))
def test_grades_of_the_tolerance_factor(grade, band):
    """Whole micrometres up to 100 um, steps of 5 and 10 beyond; up to 6 mm rounded up to preferred numbers."""
    formula = FACTORS[grade] * unit(MEANS[band])
    printed = it_width(grade, BANDS[band]) * 1e3
    if BANDS[band] <= 6:
        assert -0.35 <= printed - formula <= max(0.7, 0.16 * formula)
    else:
        step = next(step for end, step in ((100, 1.0), (200, 5.0), (500, 10.0)) if formula <= end * 1.01)
        assert abs(printed - formula) <= max(0.7 * step, 0.03 * formula)


@pytest.mark.parametrize(("grade", "base", "slope"), [("IT01", 0.3, 0.008), ("IT0", 0.5, 0.012), ("IT1", 0.8, 0.020)])
@pytest.mark.parametrize("band", range(len(BANDS)))
def test_finest_grades_are_straight_lines(grade, base, slope, band):
    """Rounded to preferred numbers, whose steps are a quarter."""
    formula = base + slope * MEANS[band]
    assert it_width(grade, BANDS[band]) * 1e3 == pytest.approx(formula, rel=0.3)


@pytest.mark.parametrize("band", range(len(BANDS)))
def test_it2_to_it4_are_between_their_neighbours_in_progression(band):
    """The standard says about, and rounds to preferred numbers."""
    first, *between, last = (it_width(grade, BANDS[band]) for grade in ("IT1", "IT2", "IT3", "IT4", "IT5"))
    for place, width in enumerate(between, 1):
        assert width == pytest.approx(first * (last / first) ** (place / 4), rel=0.25)


def test_from_it6_on_five_grades_are_a_factor_of_ten():
    for grade in range(6, 14):
        for band, (coarse, fine) in enumerate(zip(WIDTHS[f"IT{grade + 5}"], WIDTHS[f"IT{grade}"], strict=True)):
            exception = grade == 6 and BANDS[band] == 6  # 75 um, where the rule makes 80
            assert coarse == (75 if exception else 10 * fine)


def test_widths_grow_with_grade_and_with_size():
    assert all(len(row) == len(BANDS) and list(row) == sorted(row) for row in WIDTHS.values())
    for finer, wider in itertools.pairwise(WIDTHS.values()):
        assert all(a < b for a, b in zip(finer, wider, strict=True))


@given(size=st.floats(1.01, 500.0), grade=st.sampled_from(list(WIDTHS)))
def test_end_of_a_band_belongs_to_it(size, grade):
    end = min(end for end in BANDS if end >= size)
    assert it_width(grade, size) == it_width(grade, end)


@pytest.mark.parametrize(
    ("grade", "size", "says"),
    [
        ("IT19", 30.0, "IT1"),
        ("it 5", 30.0, "did you mean 'IT5'"),
        ("H7", 30.0, "IT"),
        ("IT5", 0.0, "up to 500 mm"),
        ("IT5", 500.1, "up to 500 mm"),
        ("IT5", math.nan, "up to 500 mm"),
        ("IT14", 1.0, "above 1 mm"),
    ],
)
def test_what_the_standard_does_not_give_is_refused(grade, size, says):
    with pytest.raises(InputError, match=says):
        it_width(grade, size)
