"""Words of plots: titles, labels with their units, legends that hide nothing, numbers along logarithmic axes."""

from __future__ import annotations

import textwrap
from functools import cache
from typing import Any, Literal

import numpy as np

from rverror.base import units
from rverror.base.directions import direction_signs
from rverror.base.numbers import way, with_unit
from rverror.views.plots.figure import Axes
from rverror.views.shown_units import unit_of

OUTPUT_ANGLE = "output angle, deg"
ORDER = "order, per output turn"

_POWERS = "LogFormatterSciNotation"  # matplotlib's own along a logarithmic axis
_LETTER = 0.55  # of the size of a font, the width of its letters in the mean
_MARGIN = 1.2  # inches of the width of a cell that labels and ticks take
_KEY = 9  # letters that a legend's line and the gap after it take
_COLUMNS = 4  # of a legend under the axes, at the most
_PAD = 4.2  # letters from axes to the legend under them: ticks and label
_BESIDE = 0.42  # of the width of a cell, for a legend beside the axes
_FEWEST_BESIDE = 33  # letters; where there is no room for them a legend stands under the axes


def signal_label(quantity: str, about: str = "") -> str:
    """Name and unit of what a model, a run or a diagnosis draws, and what it is told about."""
    return f"{'torque' if quantity == 'torque' else 'transmission error'}{about}, {unit_of(quantity).shown}"


def over_angle(ax: Axes, *title: str, y: str, x: str = OUTPUT_ANGLE, **look: Any) -> Axes:
    """Axes over the output angle, from end to end of what is drawn, `labelled`."""
    ax.margins(x=0)
    return labelled(ax, *title, x=x, y=y, **look)


def stated(unit: Any = None, *, torque: Any = None, direction: Any = None) -> list[str]:
    """Name of a unit, torque, N*mm or with its unit, or of many angles, and direction for a title, as far as known.

    Examples
    --------
    >>> stated(torque=20e3, direction=-1.0)
    ['20 N*m', 'reverse']
    """
    name = getattr(unit, "name", "") or getattr(getattr(unit, "mechanism", None), "name", "")
    if np.ndim(torque):
        words = [" to ".join(with_unit(float(end), "torque") for end in (np.min(torque), np.max(torque)))]
    else:
        words = [] if torque is None else [with_unit(units.to_core(torque, "torque"), "torque")]
    if direction is not None:
        words.append(" and ".join(way(sense) for sense in (1.0, -1.0) if (direction_signs(direction) == sense).any()))
    return [plain(name), *words] if name else words


def letters(ax: Axes, size: float | str) -> int:
    """Letters of a font size that a line has room for in the cell of axes."""
    from matplotlib.font_manager import FontProperties

    figure, spec = ax.get_figure(root=True), ax.get_subplotspec()
    assert figure is not None
    if figure.get_layout_engine() is None:
        figure.set_layout_engine("constrained")
    share = 1.0 if spec is None else len(spec.colspan) / spec.get_gridspec().ncols
    room = share * float(figure.get_size_inches()[0]) - _MARGIN
    return max(int(72 * room / (_LETTER * FontProperties(size=size).get_size_in_points())), 1)


def labelled(
    ax: Axes,
    *title: str,
    x: str,
    y: str = "",
    legend: Literal["below", "beside", ""] = "below",
    legend_title: str | None = None,
    **limits: Any,
) -> Axes:
    """Axes with their labels, limits, legend and a title of parts, in as many lines as the axes' room asks for."""
    from matplotlib.ticker import FixedLocator

    ax.set(xlabel=x, ylabel=y, **limits)
    for axis in (ax.xaxis, ax.yaxis):
        if type(axis.get_major_formatter()).__name__ == _POWERS:
            axis.set_major_formatter(_log_numbers()())
            axis.set_minor_formatter(_log_numbers()(labelOnlyBase=False))
    named = isinstance(ax.yaxis.get_major_locator(), FixedLocator)  # names of rows stand left of the title
    names = max((len(label.get_text()) for label in ax.get_yticklabels()), default=0) if named else 0
    text = textwrap.fill(", ".join(filter(None, title)), max(letters(ax, "large") - names, 1))
    ax.set_title(text, x=0.0, ha="left")
    if legend:
        _legend(ax, legend, legend_title)
    return ax


@cache
def _log_numbers() -> type[Any]:
    """Formatter of a logarithmic axis: plain numbers such as 0.5, where matplotlib puts powers of ten."""
    from matplotlib.ticker import LogFormatter

    class LogNumbers(LogFormatter):
        def __call__(self, x: float, pos: int | None = None) -> str:
            return f"{x:g}" if super().__call__(x, pos) else ""

    return LogNumbers


def _legend(ax: Axes, place: Literal["below", "beside"], title: str | None) -> None:
    """Legend under the axes and their label, where it hides no line, or right of them where there is room."""
    handles, labels = ax.get_legend_handles_labels()
    if not handles:
        return
    look: dict[str, Any] = {"loc": "upper left", "frameon": False, "handlelength": 3.5, "alignment": "left"}
    room = int(_BESIDE * letters(ax, "x-small"))
    if place == "beside" and room >= _FEWEST_BESIDE:
        look |= {"bbox_to_anchor": (1.01, 1), "fontsize": "x-small", "title_fontsize": "x-small"}
    else:
        room = letters(ax, "small")
        columns = max(1, min(_COLUMNS, room // (max(map(len, labels)) + _KEY)))
        # the pad is in letters, not in parts of the axes, so it clears the label of low axes too
        look |= {"bbox_to_anchor": (0, 0), "borderaxespad": _PAD, "ncols": columns, "fontsize": "small"}
    wrapped = [textwrap.fill(label, max(room - _KEY, 1)) for label in labels]
    ax.legend(handles, wrapped, title=title, **look)


def plain(text: str) -> str:
    """Text that is drawn as it stands: no formula between dollar signs, nothing that no font can hold."""
    printable = "".join(letter if letter.isprintable() else " " for letter in text)
    return printable.replace("$", r"\$")
