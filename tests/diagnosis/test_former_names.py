"""Attributes of results under their former names: the same value, and a warning with the name now."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from rverror.diagnosis.orders.resonances import Resonance
from rverror.diagnosis.result import ElasticEstimate
from rverror.diagnosis.wave_fit import DirectionLaw, WavePart

FORMER = [
    (ElasticEstimate("pin_contact", "stiffness", 2e5, 2.1e5, 2e5, 2.2e5, True), "told", "determined"),
    (WavePart(value=1 + 0j, deviation=0.1, radius=0.3, freedom=5.0), "told", "significant"),
    (
        Resonance(
            frequency=50.0, low=49.0, high=51.0, damping_ratio=0.02, damping_low=0.01, damping_high=0.03,
            confidence=0.95, misfit=0.05, series=(), alone={},
        ),
        "off",
        "misfit",
    ),
    (
        DirectionLaw(
            direction=1.0, cases=1, constant=WavePart(value=1 + 0j, deviation=0.1, radius=0.3, freedom=5.0),
            slope=None, temperature=None, speed=None, not_determined=("load",), bent=False, noise=0.0,
            torque=np.zeros(1), waves=np.ones(1, complex),
        ),
        "not_told",
        "not_determined",
    ),
]  # fmt: skip


@pytest.mark.parametrize(("result", "former", "now"), FORMER)
def test_a_former_name_still_works(result: Any, former: str, now: str) -> None:
    with pytest.warns(DeprecationWarning, match=rf"{type(result).__name__}\.{former} is .*\.{now} now"):
        assert getattr(result, former) == getattr(result, now)
