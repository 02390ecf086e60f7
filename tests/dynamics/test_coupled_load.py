"""A load behind a coupling: two springs in a row, and a rigid coupling as their limit."""

from __future__ import annotations

import math

import numpy as np
import pytest

import rverror
from rverror import Model, effect
from rverror.dynamics import modes, speed_response
from rverror.model import Bench

UNIT = rverror.reducer("RV-40E")
CAM = effect("crank.eccentricity", crank=0, disc=0, tangential="5 um")
SPEEDS = ["20 rpm", "150 rpm", "600 rpm", "1200 rpm"]


def loaded(coupling: str | None) -> Model:
    bench = Bench(load_inertia="500 kg*m^2", load_coupling_stiffness=coupling, damping_ratio=0.05)
    return Model(UNIT, (CAM,), bench=bench)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_load_on_two_springs_shakes_the_carrier_between_them(direction: float) -> None:
    """Carrier without mass: its error is e (1 + k2 / (k1 + k2) r^2 / (1 - r^2 + 2 i zeta r)).

    k1 and k2 are those of train and coupling, of which the first frequency with either holds J w^2 = k1 k2 / (k1 + k2).
    """
    model, coupling = loaded("2e5 N*m/rad"), 2e8
    first = modes(model, direction=direction).frequency[0]
    both = 500e3 * (2 * math.pi * first) ** 2
    train = 1 / (1 / both - 1 / coupling)
    found = speed_response(model, SPEEDS, direction=direction)
    at = found.order.tolist().index(40.0)
    share = 40 * found.speed / (2 * math.pi * UNIT.ratio) / first
    shaken = share**2 / (1 - share**2 + 0.1j * direction * share)
    assert share[1] < 1 < share[2]
    expected = 1 + coupling / (train + coupling) * shaken
    np.testing.assert_allclose(found.waves[:, at] / found.crawl_waves[at], expected, rtol=3e-3)


def test_a_very_stiff_coupling_is_a_rigid_one() -> None:
    stiff, rigid = (speed_response(loaded(one), SPEEDS) for one in ("1e9 N*m/rad", None))
    departure = rigid.transmission_error - rigid.crawl
    assert np.abs(departure).max() > 0.5 * np.ptp(rigid.crawl)
    np.testing.assert_allclose(stiff.transmission_error, rigid.transmission_error, atol=2e-3 * np.abs(departure).max())
