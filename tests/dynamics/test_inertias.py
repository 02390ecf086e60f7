"""Estimated masses and moments: summed over a grid of the shapes that the page on dynamics names."""

from __future__ import annotations

import numpy as np
import pytest

import rverror
from rverror.dynamics.train import whole_inertia

STEEL = 7850 * 1e-3 / 1e9  # tonne/mm^3


def summed(radius: float, width: float, holes: list[tuple[complex, float]]) -> tuple[float, float]:
    """Mass and moment about the axis of a plate less its holes."""
    step = radius / 500
    row = np.arange(-radius + step / 2, radius, step)
    place = row + 1j * row[:, None]
    inside = abs(place) < radius
    for centre, size in holes:
        inside &= abs(place - centre) > size
    area = step**2 * STEEL * width
    return area * inside.sum(), area * (abs(place) ** 2 * inside).sum()


@pytest.mark.parametrize("cranks", [2, 3, 5])
def test_a_disc_is_a_plate_with_bores_and_a_hole(cranks: int) -> None:
    unit = rverror.reducer("RV-40E", cranks=cranks)
    bore = 27 / 2 * np.sin(np.pi / max(cranks, 3))
    holes = [(27 * np.exp(2j * np.pi * j / cranks), bore) for j in range(cranks)]
    mass, moment = summed(64 - 3, 0.15 * 64, [*holes, (0j, 6.75 + 2 * 1.5)])
    own = whole_inertia(unit)
    assert (own.disc_mass, own.disc_inertia) == pytest.approx((mass, moment), rel=2e-3)


def test_carrier_crank_and_sun_are_plates_and_cylinders() -> None:
    own, bore = whole_inertia(rverror.reducer("RV-40E")), 27 / 2 * np.sin(np.pi / 3)
    assert (own.carrier_mass, own.carrier_inertia) == pytest.approx(summed(64 - 3 - 2.5, 2 * 0.25 * 64, []), rel=2e-3)
    assert (own.sun_mass, own.sun_inertia) == pytest.approx(summed(6.75, 64, []), rel=2e-3)
    shaft, gear = summed(0.7 * bore, 4 * 0.15 * 64, []), summed(20.25, 8 * 1.5, [])
    assert own.crank_mass == pytest.approx(shaft[0] + gear[0], rel=2e-3)
    assert own.crank_inertia == pytest.approx(shaft[1] + gear[1], rel=2e-3)
