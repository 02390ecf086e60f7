"""Pictures of a page as SVG text without any library: colours come from the page's style, so both themes fit.

Classes that the page gives a colour: ``measured``, ``before``, ``after``, ``grid``, ``axis``, ``aside``, ``slip``; of
text ``tick``, ``label`` or ``name``.  Every picture is drawn for one width, so letters keep their size on a desktop and
on a phone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rverror.base.arrays import Array
from rverror.views.html import escaped

_LETTER = 6.4  # px, mean width of a letter of 12 px
_LEFT, _RIGHT = 52, 16
_HEIGHT = 300  # of a spectrum
_PASSES = 8  # over the whole width, that are told apart

#: Shapes that stand on the axis, from their place: a stroke for a sample set aside, a triangle for a slip.
MARKS = {"aside": "v-11", "slip": "l-4.5 0l4.5-8l4.5 8z"}

Place = Callable[[Any], Any]


@dataclass(frozen=True)
class Peak:
    """A named line of a spectrum."""

    order: float
    size: float
    name: str


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


def thinned(x: Array, rows: Sequence[Array], columns: int) -> npt.NDArray[np.intp]:
    """Samples that show what lines of many look like: the lowest and highest of each line in each column.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Not a number where the lines are broken.
    rows : sequence of ndarray, shape (n,)
    columns : int
        Over the span of x.

    Returns
    -------
    ndarray
        Places of the samples, ends and breaks included.
    """
    n = x.size
    if n <= 2 * columns:
        return np.arange(n)
    low, high = float(np.nanmin(x)), float(np.nanmax(x))
    breaks = np.flatnonzero(np.isnan(x))
    at = np.floor(np.nan_to_num((x - low) / (high - low or 1.0), nan=-1.0) * columns)
    column = np.cumsum(np.diff(at, prepend=at[:1]) != 0)
    if column[-1] > _PASSES * columns:  # to and fro on the spot: no columns, so parts of the trace
        column = np.arange(n) * columns // n
    kept = [np.array([0, n - 1]), breaks, breaks[breaks > 0] - 1, breaks[breaks < n - 1] + 1]
    for row in rows:
        order = np.lexsort((np.where(np.isnan(row), np.nanmedian(row), row), column))
        ends = np.flatnonzero(np.diff(column[order], append=-1))
        kept += [order[ends], order[np.append(0, ends[:-1] + 1)]]
    return np.unique(np.concatenate(kept))


def waveforms(
    panels: Sequence[tuple[str, Sequence[tuple[str, Array]]]],
    angle: Array,
    *,
    width: int,
    title: str,
    marks: Sequence[tuple[str, Array]] = (),
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
    marks : sequence of (str, ndarray)
        Key of `MARKS`, and the angles, degrees, at which they stand on the axis of each panel.
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
            kept = thinned(angle, [values], inner)
            points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across(angle[kept]), up(values[kept]), strict=True))
            parts.append(f'<polyline class="{escaped(name)}" points="{points}"/>')
        for name, angles in marks:
            parts.append(_standing(name, across(angles), start + panel_height))
    base = height - bottom
    for value in _angle_ticks(low, high, inner):
        parts.append(_below(across(value), base, f"{value:g}"))
    parts.append(_caption(width, height, "output angle, deg"))
    return _picture(width, height, title, parts)


def spectrum(
    order: Array, before: Array, after: Array, peaks: Sequence[Peak], *, width: int, title: str, unit: str
) -> str:
    """Order spectrum of a residual before and after, strong lines named, as an ``svg`` element.

    Parameters
    ----------
    order, before, after : ndarray, shape (m,)
        Orders per output turn and amplitudes.
    peaks : sequence of Peak
        Lines to name, the most important first; a name that has no room is left out.
    width : int
        px.
    title : str
    unit : str
        Of the amplitudes.
    """
    inner = width - _LEFT - _RIGHT
    highest = float(order[-1]) if order.size else 1.0
    across = _linear(0.0, highest, _LEFT, _LEFT + inner)
    placed = _places(peaks, across, width)
    rows = 1 + max((row for _, row, _ in placed), default=-1)
    top, bottom = 24 + 30 * rows, 36
    base = _HEIGHT - bottom
    floor = max(float(np.median(after)) if after.size else 0.0, 1e-6 * max(float(before.max(initial=0)), 1e-9))
    ceiling = max(float(before.max(initial=0.0)), float(after.max(initial=0.0)), 10 * floor) * 1.2
    decades = math.log10(ceiling / floor)

    def up(value: float) -> float:
        return base - (base - top) * math.log10(max(value, floor) / floor) / decades

    parts = [f'<text class="label" x="{_LEFT}" y="13">amplitude, {escaped(unit)}</text>']
    for power in range(math.ceil(math.log10(floor)), math.floor(math.log10(ceiling)) + 1):
        parts.append(_horizontal(up(10.0**power), width, f"{10.0**power:g}"))
    for name, sizes in (("before", before), ("after", after)):
        stems = "".join(
            f"M{across(o):.1f} {base:.1f}V{up(s):.1f}" for o, s in zip(order, sizes, strict=True) if s > floor
        )
        parts.append(f'<path class="stem {name}" d="{stems}"/>' if stems else "")
    for peak, row, middle in placed:
        y = 38 + 30 * row
        x = across(peak.order)
        parts.append(f'<path class="lead" d="M{middle:.1f} {y + 3}L{x:.1f} {max(up(peak.size) - 3, y + 4):.1f}"/>')
        for look, at, text in (("name strong", y - 13, f"{peak.order:g}"), ("name", y, peak.name)):
            start = f'<text class="{look}" text-anchor="middle" x="{middle:.1f}" y="{at}">'
            parts.append(f"{start}{escaped(text)}</text>")
    parts.append(f'<path class="axis" d="M{_LEFT} {base}H{width - _RIGHT}"/>')
    for value in ticks(0, highest, max(3, inner // 90)):
        parts.append(_below(across(value), base, f"{value:g}"))
    parts.append(_caption(width, _HEIGHT, "order, per output turn"))
    return _picture(width, _HEIGHT, title, parts)


@dataclass(frozen=True, kw_only=True, eq=False)
class Branch:
    """One line of `branches` with the points that it runs through.

    Attributes
    ----------
    look : str
        Class of the page's style.
    dashed : bool
        Dashes and squares in place of a whole line and circles, so that grey print tells two branches apart.
    points, line : tuple of ndarray
        Abscissae and ordinates.
    """

    look: str
    dashed: bool
    points: tuple[Array, Array]
    line: tuple[Array, Array]


def branches(drawn: Sequence[Branch], *, width: int, height: int, title: str, label: str, caption: str) -> str:
    """Points and lines from zero on, as an ``svg`` element.

    Parameters
    ----------
    drawn : sequence of Branch
    width, height : int
        px.
    title : str
        For those who cannot see it.
    label, caption : str
        Of the ordinate and of the abscissa.
    """
    top, bottom = 24, 40
    base, inner = height - bottom, width - _LEFT - _RIGHT
    pairs = [pair for branch in drawn for pair in (branch.points, branch.line)]
    right = max([float(x.max(initial=0.0)) for x, _ in pairs] + [1e-9])
    reach = max([float(y.max(initial=0.0)) for _, y in pairs] + [1e-9]) * 1.08
    across, up = _linear(0.0, right, _LEFT, _LEFT + inner), _linear(0.0, reach, base, top)
    parts = [f'<text class="label" x="{_LEFT}" y="13">{escaped(label)}</text>']
    parts += [_horizontal(up(value), width, f"{value:g}") for value in ticks(0.0, reach, 4)]
    for branch in drawn:
        dashes = ' stroke-dasharray="6 4"' if branch.dashed else ""
        line = " ".join(f"{across(x):.1f},{up(y):.1f}" for x, y in zip(*branch.line, strict=True))
        parts.append(f'<polyline class="{escaped(branch.look)}"{dashes} points="{line}"/>' if line else "")
        mark = "m-3-3h6v6h-6z" if branch.dashed else "m-3 0a3 3 0 1 0 6 0a3 3 0 1 0-6 0z"
        marks = "".join(f"M{across(x):.1f} {up(y):.1f}{mark}" for x, y in zip(*branch.points, strict=True))
        parts.append(f'<path class="{escaped(branch.look)}" d="{marks}"/>' if marks else "")
    parts.append(f'<path class="axis" d="M{_LEFT} {base}H{width - _RIGHT}"/>')
    parts += [_below(across(value), base, f"{value:g}") for value in ticks(0.0, right, max(3, inner // 70))]
    parts.append(_caption(width, height, caption))
    return _picture(width, height, title, parts)


@dataclass(frozen=True, kw_only=True)
class Bar:
    """One bar of `bars`, from zero to a value, with the interval of that value where it has one."""

    look: str  #: class of the page's style
    value: float
    low: float | None = None
    high: float | None = None


def bars(rows: Sequence[tuple[str, Sequence[Bar]]], *, width: int, title: str, caption: str) -> str:
    """Lying bars below the name of each row, as an ``svg`` element.

    Parameters
    ----------
    rows : sequence of (str, sequence of Bar)
        Name and bars, the first at the top.
    width : int
        px.
    title : str
        For those who cannot see it.
    caption : str
        Of the abscissa.
    """
    thick, gap, top, bottom = 10, 9, 6, 40
    ends = [end for _, own in rows for bar in own for end in (bar.value, bar.low, bar.high) if end is not None]
    low, high = min([0.0, *ends]), max([0.0, *ends]) or 1.0
    across = _linear(low, high * 1.02, _RIGHT, width - _RIGHT)
    heights = [16 + (thick + 2) * len(own) + gap for _, own in rows]
    height = top + sum(heights) + bottom
    base = height - bottom
    marks = ticks(low, high, max(3, width // 110))
    parts = [f'<path class="grid" d="M{across(value):.1f} {top}V{base}"/>' for value in marks]
    y = top
    most = int((width - 2 * _RIGHT - 4) / _LETTER)
    for (name, own), tall in zip(rows, heights, strict=True):
        shown = name if len(name) <= most else name[: most - 1] + "…"
        parts.append(f'<text class="name" x="{_RIGHT + 4}" y="{y + 11}">{escaped(shown)}</text>')
        for number, bar in enumerate(own):
            start, end = sorted((across(0.0), across(bar.value)))
            at = y + 16 + (thick + 2) * number
            parts.append(
                f'<rect class="{escaped(bar.look)}" x="{start:.1f}" y="{at}" width="{max(end - start, 0.5):.1f}" '
                f'height="{thick}"/>'
            )
            if bar.low is not None and bar.high is not None:
                middle, left, right = at + thick / 2, across(bar.low), across(bar.high)
                parts.append(
                    f'<path class="whisker" d="M{left:.1f} {middle}H{right:.1f}M{left:.1f} {at + 2}v{thick - 4}'
                    f'M{right:.1f} {at + 2}v{thick - 4}"/>'
                )
        y += tall
    parts.append(f'<path class="axis" d="M{across(0.0):.1f} {top}V{base}"/>')
    parts += [_below(across(value), base, f"{value:g}") for value in marks]
    parts.append(_caption(width, height, caption))
    return _picture(width, height, title, parts)


def histogram(
    values: Array, lines: Sequence[tuple[str, float, str]], *, width: int, title: str, label: str, caption: str
) -> str:
    """Shares of values per unit, with standing lines that are named, as an ``svg`` element.

    Parameters
    ----------
    values : ndarray, shape (n,)
    lines : sequence of (str, float, str)
        Class, place and name of each, names below one another.
    width : int
        px.
    title : str
        For those who cannot see it.
    label, caption : str
        Of the ordinate and of the abscissa.
    """
    top, bottom = 26 + 17 * len(lines), 40
    base, inner = _HEIGHT + top - bottom - 60, width - _LEFT - _RIGHT
    height = base + bottom
    places = [float(values.min()), float(values.max()), *(place for _, place, _ in lines)]
    room = 0.02 * (max(places) - min(places)) or 1.0
    left, right = min(places) - room, max(places) + room
    count, edges = np.histogram(values, bins=max(16, inner // 6), range=(left, right))
    share = count / values.size / (edges[1] - edges[0])
    across, up = _linear(left, right, _LEFT, _LEFT + inner), _linear(0.0, float(share.max()) * 1.05, base, top)
    parts = [f'<text class="label" x="{_LEFT}" y="13">{escaped(label)}</text>']
    parts += [_horizontal(up(value), width, f"{value:g}") for value in ticks(0.0, float(share.max()), 4)]
    steps = "".join(f"V{up(value):.1f}H{across(edge):.1f}" for value, edge in zip(share, edges[1:], strict=True))
    parts.append(f'<path class="area" d="M{_LEFT} {base}{steps}V{base}z"/>')
    names = []
    for row, (look, place, name) in enumerate(lines):
        x, y = across(place), 30 + 17 * row
        parts.append(f'<path class="{escaped(look)}" d="M{x:.1f} {y + 4}V{base}"/>')
        long = len(name) * _LETTER
        side, at = ("start", x + 4) if x + long + 4 < width else ("end", max(x - 4, min(long, width - 1.0)))
        names.append(f'<text class="name" text-anchor="{side}" x="{at:.1f}" y="{y}">{escaped(name)}</text>')
    parts += names  # above all lines
    parts.append(f'<path class="axis" d="M{_LEFT} {base}H{width - _RIGHT}"/>')
    parts += [_below(across(value), base, f"{value:g}") for value in ticks(left, right, max(3, inner // 70))]
    parts.append(_caption(width, height, caption))
    return _picture(width, height, title, parts)


def _linear(low: float, high: float, start: float, end: float) -> Place:
    """Place between `start` and `end` of a value between two bounds."""
    return lambda value: start + (end - start) * (value - low) / ((high - low) or 1.0)


def _places(peaks: Sequence[Peak], across: Place, width: int) -> list[tuple[Peak, int, float]]:
    """Row and middle of each name that finds room in three rows, without overlap."""
    taken: list[list[tuple[float, float]]] = [[], [], []]
    placed = []
    for peak in peaks:
        half = max(len(f"{peak.order:g}"), len(peak.name)) * _LETTER / 2 + 5
        if 2 * half > width - _LEFT - _RIGHT:
            continue
        middle = min(max(across(peak.order), _LEFT + half), width - _RIGHT - half)
        for row, spans in enumerate(taken):
            if all(middle + half < low or middle - half > high for low, high in spans):
                spans.append((middle - half, middle + half))
                placed.append((peak, row, middle))
                break
    return placed


def _angle_ticks(low: float, high: float, inner: int) -> list[float]:
    """Multiples of 15, 30, 45 or 90 degrees up to about a turn, else round numbers."""
    for step in (15, 30, 45, 90):
        if 2 * step <= high - low < 420 and (high - low) / step <= max(3, inner / 80):
            first, last = math.ceil(low / step - 0.02), math.floor(high / step + 0.02)
            return [float(step * k) for k in range(first, last + 1)]
    return ticks(low, high, max(3, inner // 90))


def _standing(name: str, places: Array, base: float) -> str:
    """Marks on an axis, one where several would cover each other."""
    shapes = "".join(f"M{x:g} {base:g}{MARKS[name]}" for x in np.unique(np.round(places)))
    return f'<path class="{name}" d="{shapes}"/>' if shapes else ""


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
