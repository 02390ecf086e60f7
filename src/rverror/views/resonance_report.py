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
    """Natural frequencies with their orders, and for each order its own one and the speed at which it is largest."""
    peaks = [(order, alone, _largest_at(one, order)) for one in found for order, alone in one.alone.items()]
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
            order=("0", NUMBER),
            alone=("1", HERTZ),
            largest_at=("2", SPEED),
        ),
    }


def _largest_at(one: Resonance, order: float) -> float:
    """Input speed at which an order is largest, rad/s."""
    waves = np.concatenate([own.waves for own in one.series if own.order == order])
    speeds = np.concatenate([own.speed for own in one.series if own.order == order])
    return float(speeds[np.argmax(np.abs(waves))])


def alone(found: Sequence[Resonance]) -> str:
    """What is to be doubted of a frequency that one order alone shows."""
    orders = ", ".join(f"{one.orders[0]:g}" for one in found if len(one.orders) == 1)
    return f"Order {orders} alone shows it: what happens at that speed would look the same." if orders else ""


def law_of(one: Resonance, series: ResonantSeries, points: int = _CURVE) -> tuple[Any, Any]:
    """Frequencies of an order, Hz, and the size of its law there, rad, for pictures."""
    frequency = np.linspace(float(series.frequency[0]), float(series.frequency[-1]), points)
    return frequency, np.abs(series.static + one.part(series, frequency))
