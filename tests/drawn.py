"""What a reader sees of a plot: labels, lines, texts that overlap, and what is left of it in grey."""

from __future__ import annotations

import re
from itertools import pairwise
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.quiver import Quiver

#: A label ends with its unit, after a comma, or says that it has none.
UNIT = re.compile(
    r", (arcsec|deg|mm|um|MPa|s|h|N\*m|rpm|Hz|degC|%|number|um or arcsec|per output turn|unit of the cost curves|"
    r"rad per mm or rad|arcsec per \w+)$"
    r"|\(a number\)$|^share of the units per arcsec$|^output angle, deg; \S+ (arcsec|N\*m) from circle to circle$"
)


def line(ax: Axes, label: str) -> tuple[Any, Any]:
    """Data of the one line with a label."""
    (found,) = [item for item in ax.get_lines() if item.get_label() == label]
    return np.asarray(found.get_xdata()), np.asarray(found.get_ydata())


def stems(ax: Axes, label: str) -> tuple[Any, Any]:
    """Places and heights of vertical lines, or of rings at their ends."""
    if any(item.get_label() == label for item in ax.get_lines()):
        return line(ax, label)
    (found,) = [c for c in ax.collections if isinstance(c, LineCollection) and c.get_label() == label]
    ends = np.array([segment[1] for segment in found.get_segments()])
    return ends[:, 0], ends[:, 1]


def legend(ax: Axes) -> list[str]:
    """Texts of the legend."""
    box = ax.get_legend()
    return [] if box is None else [text.get_text() for text in box.get_texts()]


def arrows(ax: Axes, gid: str) -> tuple[Any, Any]:
    """Tails and vectors of the arrows of one name, shape (n, 2), as they lie on the paper."""
    found = [c for c in ax.collections if isinstance(c, Quiver) and c.get_gid() == gid]
    assert all(q.scale == 1 and q.angles == "xy" and q.scale_units == "xy" for q in found)
    tails = np.concatenate([np.zeros((0, 2)), *(q.XY for q in found)])
    return tails, np.concatenate([np.zeros((0, 2)), *(np.stack([q.U, q.V], axis=1) for q in found)])


def luminance(colour: Any) -> float:
    """Grey of a colour in print, 0 black to 1 white."""
    red, green, blue = mpl.colors.to_rgb(colour)
    return 0.299 * red + 0.587 * green + 0.114 * blue


def units_missing(ax: Axes) -> list[str]:
    """Axes whose label has no unit, but for those whose ticks are words."""
    missing = []
    for axis in (ax.xaxis, ax.yaxis):
        label = axis.get_label().get_text()
        ticks = "".join(tick.get_text() for tick in axis.get_ticklabels())
        words = any(letter.isalpha() for letter in ticks) or not ticks
        if not UNIT.search(label) and not (words and not label):
            missing.append(label)
    return missing


def alike_in_grey(ax: Axes) -> list[tuple[str, str]]:
    """Pairs of legend entries that a grey print does not tell apart: same grey, dashes, width, marker and hatch."""
    box = ax.get_legend()
    if box is None:
        return []
    looks = [(text.get_text(), _look(handle)) for text, handle in zip(box.get_texts(), box.legend_handles, strict=True)]
    return [
        (one, other)
        for at, (one, first) in enumerate(looks)
        for other, second in looks[at + 1 :]
        if first[1:] == second[1:] and abs(first[0] - second[0]) < 0.12
    ]


def _look(handle: Any) -> tuple[Any, ...]:
    if isinstance(handle, mpl.lines.Line2D):
        grey = luminance(handle.get_markerfacecolor() if handle.get_linestyle() == "None" else handle.get_color())
        return grey, str(handle._unscaled_dash_pattern), round(handle.get_linewidth() * 2), handle.get_marker()
    if isinstance(handle, LineCollection):
        return luminance(handle.get_color()[0]), str(handle.get_linestyle()), round(handle.get_linewidth()[0] * 2), ""
    face = handle.get_facecolor()
    return luminance(np.atleast_2d(face)[0][:3]), "area", handle.get_hatch() or "", ""


def overlapping_texts(ax: Axes) -> list[tuple[str, str]]:
    """Pairs of texts that lie over one another once drawn, legend and labels included."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()
    texts = [*ax.texts, ax.title, ax.xaxis.label, ax.yaxis.label]
    for axis in (ax.xaxis, ax.yaxis):
        low, high = sorted(axis.get_view_interval())
        texts += [t.label1 for t in axis.get_major_ticks() if low <= t.get_loc() <= high]
    boxes = [(t.get_text(), mpl.text.Text.get_window_extent(t)) for t in texts if t.get_text() and t.get_visible()]
    if ax.get_legend() is not None:
        boxes.append(("the legend", ax.get_legend().get_window_extent()))
    return [
        (one, other)
        for at, (one, first) in enumerate(boxes)
        for other, second in boxes[at + 1 :]
        if first.x0 < second.x1 and second.x0 < first.x1 and first.y0 < second.y1 and second.y0 < first.y1
    ]


def cut_off(ax: Axes) -> list[str]:
    """Title, labels and texts of the legend, which has no frame, that reach over the figure's edge once drawn."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    named = [(t.get_text(), t) for t in (ax.title, ax.xaxis.label, ax.yaxis.label)]
    if ax.get_legend() is not None:
        named += [(t.get_text(), t) for t in ax.get_legend().get_texts()]
    boxes = [(name, thing.get_window_extent()) for name, thing in named if name]
    outer = figure.bbox
    return [
        name for name, box in boxes if box.x0 < outer.x0 or box.x1 > outer.x1 or box.y0 < outer.y0 or box.y1 > outer.y1
    ]


def neighbours_differ(values: Any) -> bool:
    """Whether values grow or fall from each to the next."""
    steps = np.array([b - a for a, b in pairwise(values)])
    return bool((steps > 0).all() or (steps < 0).all())
