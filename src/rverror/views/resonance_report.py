"""Natural frequencies that orders show over the speed, for people and for programs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from rverror.base.numbers import brief, rounded
from rverror.diagnosis.orders.resonances import Resonance, ResonantSeries
from rverror.views.blocks import Sheet, grid, line

_RPM = 30 / math.pi
_CURVE = 301  # points of a law
_HEADS = ("order", "alone, Hz", "largest at, rpm")


def resonances_json(found: Sequence[Resonance]) -> list[dict[str, Any]]:
    """Natural frequencies as plain data for `json.dump`: Hz, with 95 % intervals; None where a bound is not told.

    Parameters
    ----------
    found : sequence of Resonance
    """
    return [
        {
            "frequency_hz": rounded(one.frequency),
            "low": rounded(one.low),
            "high": rounded(one.high),
            "damping_ratio": rounded(one.damping_ratio),
        }
        for one in found
    ]


def resonance_sheet(found: Sequence[Resonance]) -> Sheet:
    """Natural frequencies as a report: a sentence and a table of each.

    Parameters
    ----------
    found : sequence of Resonance
    """
    return tuple(block for one in found for block in (*line(f"{_sentence(one)}."), *grid(_HEADS, _rows(one))))


def _sentence(one: Resonance) -> str:
    told = (
        f"{brief(one.frequency)} Hz, {100 * one.confidence:g} % {_ends(one.low, one.high)}; damping ratio "
        f"{brief(one.damping_ratio, 2)} {_ends(one.damping_low, one.damping_high, 2)}"
    )
    orders = [f"{order:g}" for order in one.orders]
    if len(orders) == 1:
        return f"{told}; order {orders[0]} alone: what happens at that speed would look the same"
    return f"{told}; orders {', '.join(orders)}"


def _ends(low: float, high: float, digits: int = 4) -> str:
    return f"[{', '.join(brief(end, digits) if math.isfinite(end) else '?' for end in (low, high))}]"


def _rows(one: Resonance) -> Iterator[tuple[str, ...]]:
    for order, alone in one.alone.items():
        waves = np.concatenate([own.waves for own in one.series if own.order == order])
        speeds = np.concatenate([own.speed for own in one.series if own.order == order])
        yield f"{order:g}", brief(alone), brief(float(speeds[np.argmax(np.abs(waves))]) * _RPM)


def law_of(one: Resonance, series: ResonantSeries, points: int = _CURVE) -> tuple[Any, Any]:
    """Frequencies of an order, Hz, and the size of its law there, rad, for pictures."""
    frequency = np.linspace(float(series.frequency[0]), float(series.frequency[-1]), points)
    return frequency, np.abs(series.static + one.part(series, frequency))
