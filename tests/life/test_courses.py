"""Courses of causes: none before they begin, one at the last session, and the rate is their slope there."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from rverror.life.growth import courses_of


@settings(max_examples=30)
@given(st.lists(st.floats(0.5, 300), min_size=2, max_size=12))
def test_a_course_goes_from_none_to_one(steps: list[float]) -> None:
    at = np.cumsum(steps)
    for course in courses_of(at, fine=True):
        grown = course.grown(at)
        assert grown[0] == 0
        assert grown[-1] == pytest.approx(1)
        assert np.all(np.diff(grown) >= -1e-12)
        assert course.centred(at).sum() == pytest.approx(0, abs=1e-9)
        if course.kind != "step":
            step = 1e-5 * (at[-1] - course.since)
            before = course.grown(np.array([at[-1] - step]))[0]
            assert course.rate == pytest.approx((1 - before) / step, rel=1e-2, abs=1e-6 / (at[-1] - course.since))
            # a growth needs two sessions that have it, so that one odd session is no growth
            assert np.count_nonzero(grown > 0) >= 2


def test_all_that_are_tried_are_one_in_all() -> None:
    """Prior probabilities of the courses that are tried add up to one."""
    for count in (2, 3, 4, 9):
        found = courses_of(np.arange(float(count)))
        assert sum(math.exp(-one.cost / 2) for one in found) == pytest.approx(1)


def test_of_two_sessions_a_jump_alone_is_told() -> None:
    assert [one.kind for one in courses_of(np.array([0.0, 1.0]))] == ["step"]
