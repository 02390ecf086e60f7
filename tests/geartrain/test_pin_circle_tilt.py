"""A tilted pin circle: by hand from the force of the pins on each disc, in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

import rverror

KEY = "cycloid.pin_circle_tilt"
ARCSEC = math.pi / 648000
THETA = 2 * np.pi * np.arange(4096) / 4096


def waves(direction: float) -> tuple[complex, complex]:
    """Order 39 of x and of y in the error of an RV-40E."""
    rows = rverror.influence(rverror.reducer("RV-40E"), THETA, KEY, direction=direction).matrix
    x, y = 2 * np.mean(rows * np.exp(-39j * THETA), axis=1)
    return x, y


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_the_error_is_the_force_of_the_pins_times_their_shift(direction: float) -> None:
    """Two discs push with opposite forces of F/(2 a z_c) across the eccentric, and by tan(delta) of it along."""
    force = 117 / 121 / (1.25 * 39)  # of both discs, per unit of output torque
    k = 1.25 * 40 / 64
    slope = (1 / k - (1 - k**2) / (2 * k**2) * math.log((1 + k) / (1 - k))) / (math.pi / 2)
    x, y = waves(direction)
    assert abs(x) == pytest.approx(force * math.hypot(1, slope), rel=0.01)  # pins in place of an integral
    assert 5e-3 * abs(x) / ARCSEC == pytest.approx(20.456 * math.hypot(1, slope), rel=0.01)
    assert y == pytest.approx(1j * x, rel=0.02)  # the eccentric turns backwards


def test_reversed_torque_mirrors_the_force_in_the_eccentric_direction() -> None:
    """Across the eccentric the force on a disc turns over with the torque, along it it stays."""
    forward, reverse = waves(1.0)[0], waves(-1.0)[0]
    assert forward == pytest.approx(-reverse.conjugate(), rel=0.02)
    assert abs(forward.imag) > 2 * abs(forward.real)  # most of it across, alike in both directions


def test_one_disc_has_none_to_be_tilted_against() -> None:
    unit = rverror.reducer("RV-003", discs=1)
    assert not rverror.influence(unit, THETA[:8], KEY, direction=1.0).matrix.any()
    assert rverror.CATALOGUE[KEY].orders(unit, {}) == ()
