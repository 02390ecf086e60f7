"""Peaks of a drawn spectrum: which ones stand out, and their names above the axes."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy

from rverror.base.arrays import Array
from rverror.geartrain.kinematics import fundamental_orders
from rverror.geartrain.mechanism import Drive, Mechanism
from rverror.runs.spectrum import frames_of_order
from rverror.views.by_order import short_frame
from rverror.views.plots.figure import Axes, letters, plain

#: Bins over which the window of a part of a turn spreads a line to either side, and the share of it beside them.
LOBE, SIDELOBES = 5, 0.05
_MOST = 8  # peaks that are named
_ALONE = 3.0  # times the resolution, within which no other order of a frame may lie
_FONT = 7.0  # points
_SLOPE = 35.0  # degrees, of names
_APART = 4.5  # letters, between neighbours of that slope


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
    """Order and the first frame that it fits, short.

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
    '78: housing 39 x 2'
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
    return f"{told}: {short_frame(frames[0]) if frames else 'no frame'}"


def _bases(mechanism: Mechanism) -> set[float]:
    if isinstance(mechanism, Drive):
        return {abs(mechanism.ratio), *map(abs, mechanism.shafts.values())}
    return {*fundamental_orders(mechanism).values(), abs(mechanism.ratio)}


def strongest(size: Array, *, floor: Array, apart: int = 1) -> list[int]:
    """Places of the largest crests above a floor, at least so many places apart, the largest first.

    Parameters
    ----------
    size, floor : ndarray, shape (m,)
    apart : int

    Returns
    -------
    list of int
        Eight at the most.
    """
    crests, _ = scipy.signal.find_peaks(np.pad(size, 1), height=np.pad(floor, 1), distance=apart)
    return sorted((crests - 1).tolist(), key=lambda place: -size[place])[:_MOST]


def name_peaks(
    ax: Axes, order: Array, size: Array, name: Callable[[float], str], *, floor: Array, apart: int = 1
) -> None:
    """Write the names of the strongest lines of a spectrum over its axes.

    Parameters
    ----------
    ax : Axes
    order, size : ndarray, shape (m,)
        Lines that are drawn.
    name : callable
        Text for an order.
    floor : ndarray, shape (m,)
        What a line must exceed to be named.
    apart : int
        Lines between two that are named at least, wherever there is room for the names of neighbours.
    """
    room = int(np.ceil(_APART * order.size / letters(ax, _FONT)))
    chosen = strongest(size, floor=floor, apart=max(apart, room))
    if not chosen:
        return
    ax.vlines(order[chosen], size[chosen], 1e3 * size.max(), colors="0.6", lw=0.4, zorder=0)
    above = ax.secondary_xaxis("top")
    told = [plain(name(place)) for place in order[chosen]]
    above.set_xticks(order[chosen], told, rotation=_SLOPE, ha="left", rotation_mode="anchor", fontsize=_FONT)
