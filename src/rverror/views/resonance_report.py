"""Natural frequencies that orders show over the speed: JSON, text, a section of the HTML report."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from rverror.base.numbers import brief, rounded
from rverror.base.units import ARCSEC
from rverror.diagnosis.orders.resonances import ForetoldPeak, Resonance, ResonantSeries
from rverror.views.html import escaped, scrolled
from rverror.views.svg import Branch, branches

_RPM = 30 / math.pi
_WIDTH, _HEIGHT = 250, 190  # px of a picture, so wide as a tile of the page
_CURVE = 301  # points of a law
_HEADS = ("order", "alone, Hz", "largest at, rpm", "between", "foretold by the others")


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


def resonance_lines(found: Sequence[Resonance]) -> list[str]:
    """Natural frequencies as lines of text.

    Parameters
    ----------
    found : sequence of Resonance
    """
    lines = ["Natural frequencies that orders show over the speed"] if found else []
    for one in found:
        lines += ["", f"  {_sentence(one)}", "    {:>5}  {:>9}  {:>15}  {:>14}  {}".format(*_HEADS)]
        lines += ["    {:>5}  {:>9}  {:>15}  {:>14}  {}".format(*_row(peak)) for peak in one.peaks]
    return lines


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


def _row(peak: ForetoldPeak) -> tuple[str, ...]:
    highest, below, above, speed = (brief(v * _RPM) for v in (peak.highest, peak.below, peak.above, peak.speed))
    told = f"{speed} {_ends(peak.low * _RPM, peak.high * _RPM)}" if math.isfinite(peak.speed) else "-"
    told += ", at a gap of the speeds" if peak.gap else ""
    return f"{peak.order:g}", brief(peak.alone), highest, f"{below} to {above}", told


def resonance_html(found: Sequence[Resonance]) -> str:
    """Natural frequencies as a section of an HTML page: a sentence, a table and a picture of each order.

    Parameters
    ----------
    found : sequence of Resonance

    Returns
    -------
    str
        Elements for `html.document`; empty where none was found.
    """
    parts = ["<h2>Natural frequencies that orders show over the speed</h2>"] if found else []
    for one in found:
        rows = [[escaped(cell) for cell in _row(peak)] for peak in one.peaks]
        tiles = "".join(f'<figure class="tile">{_picture(one, order)}</figure>' for order in one.orders)
        parts.append(
            f"<p>{escaped(_sentence(one))}.</p>\n{scrolled(list(_HEADS), rows, numbers=(0, 1, 2))}\n"
            '<p class="soft">Marks: measured; lines: one mode. Whole: the largest load; dashed: the smallest.</p>\n'
            f'<div class="tiles">{tiles}</div>'
        )
    return "\n".join(parts)


def law_of(series: ResonantSeries, points: int = _CURVE) -> tuple[Any, Any]:
    """Frequencies of an order, Hz, and the size of its law there, rad, for pictures."""
    frequency = np.linspace(float(series.frequency[0]), float(series.frequency[-1]), points)
    static = series.static if series.direction > 0 else series.static.conjugate()
    return frequency, np.abs(static + series.part(frequency))


def _picture(one: Resonance, order: float) -> str:
    own = sorted((s for s in one.series if s.order == order), key=lambda s: (-s.direction, s.torque or 0.0))
    drawn = []
    for series, dashed in ((own[0], True), (own[-1], False))[len(own) == 1 :]:
        frequency, size = law_of(series)
        drawn.append(
            Branch(
                look="before" if dashed else "after",
                dashed=dashed,
                points=(series.frequency, np.abs(series.waves) / ARCSEC),
                line=(frequency, size / ARCSEC),
            )
        )
    return branches(
        drawn,
        width=_WIDTH,
        height=_HEIGHT,
        title=f"Amplitude of order {order:g} over its frequency, with the law of one mode",
        label=f"order {order:g}, arcsec",
        caption="frequency of the order, Hz",
    )
