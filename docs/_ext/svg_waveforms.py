"""Waveforms of the catalogue page as SVG text, whose colours come from the page's style.

Classes that the page gives a colour: those of the lines, ``grid``, ``axis``; of text ``tick`` and ``label``.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from rverror.base.arrays import Array
from rverror.views.html import escaped
from rverror.views.plots.figure import for_drawing

_LEFT, _RIGHT = 52, 16

Place = Callable[[Any], Any]


def ticks(low: float, high: float, most: int) -> list[float]:
    """Round numbers between two bounds, `most` or fewer.

    Examples
    --------
    >>> ticks(0, 360, 5)
    [0.0, 100.0, 200.0, 300.0]
    >>> ticks(0, 0, 5)
    [0.0]
    """
    if not high > low:
        return [float(low)]
    rough = (high - low) / most
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(f * power for f in (1, 2, 5, 10) if f * power * (1 + 1e-9) >= rough)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [float(f"{k * step:.12g}") for k in range(first, last + 1)]


def waveforms(
    panels: Sequence[tuple[str, Sequence[tuple[str, Array]]]],
    angle: Array,
    *,
    width: int,
    title: str,
    panel_height: int = 150,
) -> str:
    """Waveforms over the output angle, panels one above the other, as an ``svg`` element.

    Parameters
    ----------
    panels : sequence of (str, sequence of (str, ndarray))
        Label of the ordinate, and the class and values of each line, the lowest first.
    angle : ndarray, shape (n,)
        Degrees.
    width : int
        Of the picture, px.
    title : str
        For those who cannot see it.
    """
    top, gap, bottom = 20, 30, 36
    height = top + len(panels) * panel_height + (len(panels) - 1) * gap + bottom
    inner = width - _LEFT - _RIGHT
    low, high = float(angle.min()), float(angle.max())
    across = _linear(low, high, _LEFT, _LEFT + inner)
    parts = []
    for number, (label, lines) in enumerate(panels):
        start = top + number * (panel_height + gap)
        reach = max([float(np.abs(values).max(initial=0.0)) for _, values in lines] + [1e-9]) * 1.05
        up = _linear(-reach, reach, start + panel_height, start)
        parts.append(f'<text class="label" x="{_LEFT}" y="{start - 7}">{escaped(label)}</text>')
        for value in ticks(-reach, reach, 5):
            parts.append(_horizontal(up(value), width, f"{value:g}"))
        for name, values in lines:
            x, y = for_drawing(angle, values, columns=inner)
            points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across(x), up(y), strict=True))
            parts.append(f'<polyline class="{escaped(name)}" points="{points}"/>')
    base = height - bottom
    for value in _angle_ticks(low, high, inner):
        parts.append(_below(across(value), base, f"{value:g}"))
    parts.append(_caption(width, height, "output angle, deg"))
    return _picture(width, height, title, parts)


def _linear(low: float, high: float, start: float, end: float) -> Place:
    """Place between `start` and `end` of a value between two bounds."""
    return lambda value: start + (end - start) * (value - low) / ((high - low) or 1.0)


def _angle_ticks(low: float, high: float, inner: int) -> list[float]:
    """Multiples of 15, 30, 45 or 90 degrees up to about a turn, else round numbers."""
    for step in (15, 30, 45, 90):
        if 2 * step <= high - low < 420 and (high - low) / step <= max(3, inner / 80):
            first, last = math.ceil(low / step - 0.02), math.floor(high / step + 0.02)
            return [float(step * k) for k in range(first, last + 1)]
    return ticks(low, high, max(3, inner // 90))


def _horizontal(y: float, width: int, text: str) -> str:
    return (
        f'<path class="grid" d="M{_LEFT} {y:.1f}H{width - _RIGHT}"/>'
        f'<text class="tick" text-anchor="end" x="{_LEFT - 6}" y="{y + 4:.1f}">{text}</text>'
    )


def _below(x: float, base: float, text: str) -> str:
    return (
        f'<path class="axis" d="M{x:.1f} {base:.1f}v4"/>'
        f'<text class="tick" text-anchor="middle" x="{x:.1f}" y="{base + 16:.1f}">{text}</text>'
    )


def _caption(width: int, height: int, text: str) -> str:
    middle = (_LEFT + width - _RIGHT) / 2
    return f'<text class="label" text-anchor="middle" x="{middle:.0f}" y="{height - 5}">{escaped(text)}</text>'


def _picture(width: int, height: int, title: str, parts: Sequence[str]) -> str:
    return (
        f'<svg role="img" viewBox="0 0 {width} {height}" width="{width}" height="{height}" '
        f'aria-label="{escaped(title)}">' + "\n".join(part for part in parts if part) + "</svg>"
    )
