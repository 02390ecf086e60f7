"""Budget, stack and allocation are asked alike."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

import rverror
from rverror.tolerances.cost import Reciprocal

ASKED = (rverror.tolerances.stack, rverror.error_budget, rverror.allocate)
CONDITIONS = ("direction", "torque", "input_speed")
MODEL = rverror.Model(rverror.reducer("RV-40E"))
CAMS = [rverror.tolerance("crank.eccentricity", "5 um", cost=Reciprocal(12.0, 0.005))]
THETA = 2 * np.pi * np.arange(256) / 256


@pytest.mark.parametrize("function", ASKED)
def test_names_and_order_are_the_same(function: object) -> None:
    names = list(inspect.signature(function).parameters)  # type: ignore[arg-type]
    assert tuple(names[:6]) == ("model", "tolerances", "theta", *CONDITIONS)


def test_allocation_is_that_of_the_stack() -> None:
    asked = rverror.allocate(MODEL, CAMS, THETA, limit="90 arcsec", kind="worst")
    stack = rverror.tolerances.stack(MODEL, CAMS, THETA)
    (front,) = rverror.tolerances.cost_front(stack, ["90 arcsec"], kind="worst")
    assert front.allocation is not None
    assert front.allocation.widths == asked.widths
