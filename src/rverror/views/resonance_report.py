"""Natural frequencies that orders show over the speed: their variables, their entries in JSON, their laws."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rverror.diagnosis.orders.resonances import Resonance, ResonantSeries
from rverror.views.fields import alike, entry, rows
from rverror.views.variables import HERTZ, NUMBER, SPEED, Variable

_CURVE = 301  # points of a law


def resonances_json(found: Sequence[Resonance]) -> list[dict[str, Any]]:
    """Natural frequencies as plain data for `json.dump`: Hz, with 95 % intervals; None where a bound is not told.

    Parameters
    ----------
    found : sequence of Resonance
    """
    sizes = alike(NUMBER, "low", "high", "damping_ratio")
    return [entry(one, frequency_hz=("frequency", NUMBER), **sizes) for one in found]


def resonances(found: Sequence[Resonance]) -> dict[str, Variable]:
    """Natural frequencies with their orders, and for each order where it is largest, alone and predicted."""
    peaks = [peak for one in found for peak in one.peaks]
    return {
        **rows(
            "resonance",
            found,
            "resonance_",
            frequency=HERTZ,
            frequency_low=("low", HERTZ),
            frequency_high=("high", HERTZ),
            damping_ratio=NUMBER,
            damping_ratio_low=("damping_low", NUMBER),
            damping_ratio_high=("damping_high", NUMBER),
            orders=None,
        ),
        **rows(
            "peak",
            peaks,
            "peak_",
            order=NUMBER,
            alone=HERTZ,
            largest_at=("highest", SPEED),
            largest_at_low=("below", SPEED),
            largest_at_high=("above", SPEED),
            predicted_by_the_others=("speed", SPEED),
            predicted_by_the_others_low=("low", SPEED),
            predicted_by_the_others_high=("high", SPEED),
        ),
    }


def alone(found: Sequence[Resonance]) -> str:
    """What is to be doubted of a frequency that one order alone shows."""
    orders = ", ".join(f"{one.orders[0]:g}" for one in found if len(one.orders) == 1)
    return f"Order {orders} alone shows it: what happens at that speed would look the same." if orders else ""


def law_of(series: ResonantSeries, points: int = _CURVE) -> tuple[Any, Any]:
    """Frequencies of an order, Hz, and the size of its law there, rad, for pictures."""
    frequency = np.linspace(float(series.frequency[0]), float(series.frequency[-1]), points)
    static = series.static if series.direction > 0 else series.static.conjugate()
    return frequency, np.abs(static + series.part(frequency))
