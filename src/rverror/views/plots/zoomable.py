"""Curves of a page that zoom and show the values under the pointer, by mpld3; still pictures where no script runs."""

from __future__ import annotations

import json
import re
from functools import cache
from itertools import count
from pathlib import Path

import numpy as np

from rverror.views.html import shipped
from rverror.views.plots.figure import Figure, svg_element

_LINE = 1.2  # of the size of a font, from one line of a title to the next
_DIGITS = 6  # of what is drawn, as of the still picture: a screen shows four
_TICKS = {"format_string": f".{_DIGITS - 1}~g", "prefix": "", "suffix": ""}  # numbers that leave the label its room


def figure_element(figure: Figure, number: int) -> str:
    """Figure as an SVG element, with the data to draw it anew where all its axes are plain numbers.

    Parameters
    ----------
    figure : Figure
    number : int
        Of the figure on its page.
    """
    zooms = _can_zoom(figure)
    for ax in figure.axes if zooms else ():
        ax.yaxis.labelpad += 30  # numbers have more digits once it is zoomed
        ax.xaxis.labelpad += 3
    still = svg_element(figure)  # which lays the figure out, and is all that is drawn of it
    return still + (_data(figure, number) if zooms else "")


@cache
def scripts() -> tuple[str, ...]:
    """What draws the figures of a page; nothing without mpld3."""
    try:
        from mpld3 import urls
    except ImportError:
        return ()
    library = (Path(path).read_text(encoding="utf-8") for path in (urls.D3_LOCAL, urls.MPLD3MIN_LOCAL))
    return (*library, shipped("figures.js"))


def _can_zoom(figure: Figure) -> bool:
    """Tell whether mpld3 draws and zooms it as matplotlib does.

    It does not know names or logarithms along an axis, equal scales, legends and texts of the whole figure, and shapes
    across the axes, which it would leave where they are.
    """
    from matplotlib.ticker import ScalarFormatter
    from matplotlib.transforms import BlendedGenericTransform

    axes = [axis for ax in figure.axes for axis in (ax.xaxis, ax.yaxis)]
    plain = all(a.get_scale() == "linear" and type(a.get_major_formatter()) is ScalarFormatter for a in axes)
    drawn = [one for ax in figure.axes for one in (*ax.collections, *ax.texts)]
    across = any(isinstance(one.get_transform(), BlendedGenericTransform) for one in drawn)
    across |= any(not one.get_transform().contains_branch(ax.transData) for ax in figure.axes for one in ax.patches)
    whole = [*figure.legends, *figure.texts, *(one for ax in figure.axes for one in ax.artists)]
    equal = any(ax.get_aspect() != "auto" for ax in figure.axes)
    return bool(scripts()) and plain and not (across or whole or equal)


def _data(figure: Figure, number: int) -> str:
    """Data of a figure, which is used up, as a script element that does not run; the same for the same figure."""
    import mpld3

    figure.set_dpi(72)  # mpld3 takes points for pixels
    for ax in figure.axes:
        keys = legend.get_lines() if (legend := ax.get_legend()) else []
        for key in keys:
            if key.get_linestyle() == "None":  # it draws as many marks as there are points
                middle = np.asarray(key.get_xydata(), dtype=np.float64).mean(axis=0)
                key.set(data=middle[:, None], markevery=None)
        for line in (*ax.lines, *keys):  # where it looks for dashes
            line._dashSeq = line._dash_pattern[1]  # type: ignore[attr-defined]
        for line in ax.lines:  # across the axes: through the same points of the data
            line.set_data(*(line.get_transform() - ax.transData).transform(line.get_xydata()).T)
            line.set_transform(ax.transData)
        for label in (ax.xaxis.label, ax.yaxis.label, ax.title):  # as plain texts: mpld3 warns of labels
            x, y = (label.get_transform() - ax.transAxes).transform(label.get_position())
            style = {name: getattr(label, f"get_{name}")() for name in ("ha", "va", "rotation", "size")}
            above = _LINE * float(label.get_fontsize()) / ax.bbox.height
            for above_it, text in enumerate(reversed(label.get_text().split("\n"))):  # it knows texts of one line
                ax.text(x, y + above_it * above, text, transform=ax.transAxes, **style)
            label.set_text("")
    mpld3.plugins.connect(figure, mpld3.plugins.MousePosition(fontsize=10, fmt=f".{_DIGITS}~g"))
    renderer = mpld3.mpld3renderer.MPLD3Renderer()
    mpld3.mplexporter.Exporter(renderer).crawl_fig(figure)  # `mpld3.fig_to_dict` would draw all of it again first
    made = renderer.finished_figures[0][1]
    for axis in (axis for axes in made["axes"] for axis in axes["axes"]):
        axis |= {"tickformat_formatter": "str_method", "tickformat": _TICKS}
    text = json.dumps(made, default=float)
    names, numbers = dict[str, str](), count()
    text = re.sub(r"\bel\d+[0-9a-f-]{36}", lambda one: names.setdefault(one[0], f"f{number}-{next(numbers)}"), text)
    # JSON has no NaN: as a word it is none to a line either, which has a gap there
    brief = json.loads(text, parse_float=lambda text: float(f"{float(text):.{_DIGITS}g}"), parse_constant=str)
    text = json.dumps(brief, allow_nan=False)
    return '<script type="application/json">' + text.replace("<", "\\u003c") + "</script>"
