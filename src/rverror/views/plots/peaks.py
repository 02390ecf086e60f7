"""Peaks of a drawn spectrum: which ones stand out, and their names above them, without overlap."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import scipy

from rverror.base.arrays import Array
from rverror.geartrain.kinematics import fundamental_orders
from rverror.geartrain.mechanism import Drive, Mechanism
from rverror.runs.spectrum import frames_of_order
from rverror.views.by_order import short_frame
from rverror.views.plots.figure import Axes, missing_letters, plain, size_in_dots

#: Peaks that are named at the most.
MOST = 6
#: Bins over which the window of a part of a turn spreads a line to either side, and the share of it beside them.
LOBE, SIDELOBES = 5, 0.05
_ROWS = 3
_ALONE = 3.0  # times the resolution, within which no other order of a frame may lie
_FONT = 7.0  # points
_LINE = 1.25  # of the font
_GAP = 5.0  # points, between names
_NAMED = 0.6  # of the height of axes, that names may take
_OVER = 0.04  # of it, left free under them


def resolution(order: Array) -> float:
    """Distance of the bins of a windowed spectrum, which hit no order exactly; 0 for harmonics of whole turns.

    Examples
    --------
    >>> resolution(np.array([0.5, 1.0, 1.5])), resolution(np.array([18.5, 23.1]))
    (0.0, 4.6...)
    """
    step = float(order[1] - order[0]) if order.size > 1 else 0.0
    return 0.0 if abs(order[0] - step) < 1e-6 * step else step


def frame_name(mechanism: Mechanism, order: float, *, within: float = 0.0) -> str:
    """Order, and under it the first frame that it fits, short.

    Parameters
    ----------
    mechanism : Reducer or Drive
    order : float
        Per output turn.
    within : float
        How far the order may be off, `resolution`.  A frame is then named only if its order lies so near, and no other
        one within three times as much.

    Returns
    -------
    str

    Examples
    --------
    >>> from rverror import reducer
    >>> frame_name(reducer("RV-40E"), 78.0)
    '78\\nhousing 39 x 2'
    >>> frame_name(reducer("RV-40E"), 79.2, within=1.5)
    'about 79.2'
    """
    told, exact = f"{order:g}", order
    if within:
        told = f"about {order:.3g}" if order < 1e3 else f"about {order:.0f}"
        multiples = {base * (round(order / base) + k) for base in _bases(mechanism) for k in (-1, 0, 1)}
        near = {round(one, 6) for one in multiples if one > 0 and abs(one - order) <= _ALONE * within}
        exact = min(near, key=lambda one: abs(one - order), default=order)
        if len(near) > 1 or abs(exact - order) > within:
            return told
    frames = frames_of_order(mechanism, exact)
    return f"{told}\n{short_frame(frames[0]) if frames else 'no frame'}"


def _bases(mechanism: Mechanism) -> set[float]:
    if isinstance(mechanism, Drive):
        return {abs(mechanism.ratio), *map(abs, mechanism.shafts.values())}
    return {*fundamental_orders(mechanism).values(), abs(mechanism.ratio)}


def strongest(size: Array, *, floor: float | Array, apart: int = 1, most: int = MOST) -> list[int]:
    """Places of the largest values above a floor, crests that lie far enough apart, the largest first.

    Parameters
    ----------
    size : ndarray, shape (m,)
    floor : float or ndarray, shape (m,)
    apart : int
        Places between two of them at least.
    most : int

    Returns
    -------
    list of int
    """
    crests = size >= scipy.ndimage.maximum_filter1d(size, 2 * apart - 1, mode="nearest")
    chosen: list[int] = []
    for i in np.flatnonzero((size > floor) & crests)[np.argsort(-size[(size > floor) & crests], kind="stable")]:
        if len(chosen) < most and all(abs(int(i) - j) >= apart for j in chosen):
            chosen.append(int(i))
    return chosen


@missing_letters()
def name_peaks(ax: Axes, order: Array, size: Array, name: Callable[[float], str], *, bottom: float, top: float) -> None:
    """Write the names of peaks in rows over a logarithmic spectrum and set the limits of its ordinate.

    A name that finds no room in three rows is left out, so the most important come first.  Rows are points below the
    upper edge, as texts are: they stay apart in axes of any height.

    Parameters
    ----------
    ax : Axes
        With its abscissa's limits set, and with labels, title and legend, which take room from it.
    order, size : ndarray
        Of the peaks.
    name : callable
        Text for an order, lines apart by newlines.
    bottom, top : float
        Smallest and largest value to be shown.
    """
    from matplotlib.transforms import ScaledTranslation

    ax.set_yscale("log")
    ax.set_ylim(bottom, top)
    figure = ax.get_figure(root=True)
    assert figure is not None
    width, height = (72 * size / figure.dpi for size in size_in_dots(ax))
    low, high = ax.get_xlim()
    texts = [[plain(line) for line in name(place).split("\n")] for place in order]
    step = max(map(len, texts), default=1) * _LINE * _FONT + _GAP
    taken: list[list[tuple[float, float]]] = [[] for _ in range(min(_ROWS, int(_NAMED * height / step)))]
    placed: list[tuple[int, int, float]] = []
    for number, place in enumerate(order):
        half = _half_width(texts[number])
        found = _room(taken, (place - low) / (high - low) * width, half, width)
        if found is None:
            continue
        row, middle = found
        taken[row].append((middle - half, middle + half))
        placed.append((row, number, middle / width))
    rows = 1 + max((row for row, *_ in placed), default=-1)
    decades = np.log10(top / bottom) / (1 - (rows * step + _GAP) / height - _OVER)
    ax.set_ylim(bottom, bottom * 10**decades)
    for row, number, middle in sorted(placed):  # lower rows later, over the leaders of those above
        down = ScaledTranslation(0, -(row + 1) * step / 72, figure.dpi_scale_trans)
        ax.annotate(
            "\n".join(texts[number]),
            xy=(order[number], size[number]),
            xytext=(middle, 1.0),
            textcoords=ax.transAxes + down,
            ha="center",
            va="bottom",
            fontsize=_FONT,
            linespacing=_LINE,
            bbox={"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none"},
            arrowprops={"arrowstyle": "-", "lw": 0.4, "color": "0.4", "shrinkA": 0, "shrinkB": 2},
        )


def _half_width(lines: Sequence[str]) -> float:
    from matplotlib.textpath import TextPath

    return max(float(TextPath((0, 0), line, size=_FONT).get_extents().width) for line in lines) / 2 + _GAP


def _room(
    taken: Sequence[Sequence[tuple[float, float]]], wanted: float, half: float, width: float
) -> tuple[int, float] | None:
    """First row with room for a name over its peak, or beside it."""
    if 2 * half > width:
        return None
    for row, spans in enumerate(taken):
        for shift in (0.0, 0.7, -0.7):
            middle = min(max(wanted + shift * half, half), width - half)
            if all(middle + half <= start or middle - half >= end for start, end in spans):
                return row, middle
    return None
