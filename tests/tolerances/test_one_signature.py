"""Budget, stack, virtual units and allocation are asked alike, and a stack stands for model and tolerances."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

import rverror
from rverror.tolerances.cost import Reciprocal

ASKED = (rverror.tolerances.stack, rverror.error_budget, rverror.tolerances.virtual_units, rverror.allocate)
CONDITIONS = ("direction", "torque", "input_speed")
MODEL = rverror.Model(rverror.reducer("RV-40E"))
CAMS = [rverror.tolerance("crank.eccentricity", "5 um", cost=Reciprocal(12.0, 0.005))]
THETA = 2 * np.pi * np.arange(256) / 256


@pytest.mark.parametrize("function", ASKED)
def test_names_and_order_are_the_same(function: object) -> None:
    names = list(inspect.signature(function).parameters)  # type: ignore[arg-type]
    assert tuple(names[:6]) == ("model", "tolerances", "theta", *CONDITIONS)


def test_virtual_units_of_either() -> None:
    stack = rverror.tolerances.stack(MODEL, CAMS, THETA, direction=-1)
    asked = rverror.tolerances.virtual_units(MODEL, CAMS, THETA, direction=-1, count=64)
    for same in (
        rverror.tolerances.virtual_units(stack, 64),
        rverror.tolerances.virtual_units(stack, count=64),
    ):
        np.testing.assert_array_equal(same.peak_to_peak, asked.peak_to_peak)
    assert rverror.error_budget(MODEL, CAMS, THETA, direction=-1, count=64, index_count=64).units.count == 64


def test_allocation_of_either() -> None:
    stack, how = rverror.tolerances.stack(MODEL, CAMS, THETA), {"limit": "90 arcsec", "kind": "worst", "verify": 1000}
    asked = rverror.allocate(MODEL, CAMS, THETA, **how)
    assert rverror.allocate(stack, **how).widths == asked.widths
    (front,) = rverror.tolerances.cost_front(MODEL, CAMS, THETA, limits=[how["limit"]], kind="worst", verify=1000)
    assert front.allocation is not None
    assert front.allocation.widths == asked.widths
