"""Figures without a window: axes of the right sort, colours, dashes and units that all plots share, and files.

matplotlib comes with the extra ``plot`` and is imported only when a figure is made.
"""

from __future__ import annotations

import io
import warnings
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's colours, which stay apart in print and for colour-blind eyes.
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILLION, PURPLE = "#0072B2", "#D55E00", "#CC79A7"
GREY = "#A0A0A0"

#: Dash patterns, in points: what tells lines apart where a page is printed in grey.
DASHES = (
    "solid",
    (0, (5.0, 2.0)),
    (0, (1.2, 1.5)),
    (0, (7.0, 2.0, 1.2, 2.0)),
    (0, (3.0, 1.2, 3.0, 3.5)),
    (0, (7.0, 1.5, 1.2, 1.5, 1.2, 1.5)),
)
DASHED = DASHES[1]
_LINE_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)
_HATCHES = ("", "///", "...", "\\\\\\", "xx", "--")

#: Below so many arcsec or N*m there is nothing to be seen.
NOTHING = 1e-6

OUTPUT_ANGLE = "output angle, deg"
ORDER = "order, per output turn"

Projection = Literal["rectilinear", "polar"]


def line_style(number: int) -> dict[str, Any]:
    """Colour and dashes of the n-th line: neighbours differ in both, and 36 lines in one of them.

    Parameters
    ----------
    number : int
        From 0.

    Returns
    -------
    dict
        Options of matplotlib's ``plot``.

    Examples
    --------
    >>> line_style(0)
    {'color': '#0072B2', 'linestyle': 'solid'}
    """
    count = len(_LINE_COLOURS)
    return {"color": _LINE_COLOURS[number % count], "linestyle": DASHES[(number + number // count) % count]}


def fill_style(number: int) -> dict[str, Any]:
    """Colour and hatch of the n-th area."""
    at = number % len(_LINE_COLOURS)
    return {"facecolor": _LINE_COLOURS[at], "hatch": _HATCHES[at]}


def new_figure(rows: int = 1, *, width: float = 9.0, height: float = 3.2) -> tuple[Figure, list[Axes]]:
    """Figure with its axes one above the other, without a window.

    Parameters
    ----------
    rows : int
    width, height : float
        Of the figure and of each row, inches.

    Returns
    -------
    Figure, list of Axes

    Raises
    ------
    InputError
        If matplotlib is not installed.

    Examples
    --------
    >>> figure, axes = new_figure(2)
    >>> len(axes)
    2
    """
    figure = _figure(width, height * rows)
    return figure, list(figure.subplots(rows, 1, squeeze=False)[:, 0])


def _figure(width: float, height: float) -> Figure:
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InputError("plots need matplotlib; install it with: pip install 'rverror[plot]'") from error
    return Figure(figsize=(width, height), layout="constrained")


def axes_for(
    ax: Axes | None, *, projection: Projection = "rectilinear", width: float = 9.0, height: float = 3.2
) -> Axes:
    """Axes to draw on: those given, if `check_axes` lets them pass, else those of a new figure of a size in inches."""
    if ax is None:
        return _figure(width, height).add_subplot(projection=projection)
    check_axes(ax, projection=projection)
    return ax


def check_axes(ax: Axes | None, *, projection: Projection = "rectilinear") -> None:
    """Refuse axes of the wrong sort, before anything is computed for them.

    Raises
    ------
    InputError
        If `ax` is given and no axes, or of another sort; or if it is not given and matplotlib is not installed.
    """
    if ax is None:
        _figure(1.0, 1.0)
        return
    found = getattr(ax, "name", None)
    if not hasattr(ax, "plot") or not isinstance(found, str):
        raise InputError(f"ax is a {type(ax).__name__}, no axes of matplotlib; give one axes, or leave ax out")
    if found != projection:
        remedy = "figure.add_subplot(projection='polar')" if projection == "polar" else "figure.add_subplot()"
        raise InputError(f"ax has {found} axes, this plot needs {projection} ones; make them with {remedy}")


def shown_unit(quantity: str) -> str:
    """Unit in which a quantity is drawn, such as arcsec for ``angle``."""
    return units.DISPLAY_UNITS[quantity]


def in_shown_unit(values: Array, quantity: str) -> Array:
    """Values in core units as they are drawn.

    Examples
    --------
    >>> in_shown_unit(np.array([412e3]), "torque")
    array([412.])
    """
    return np.asarray(values / units.unit_factor(shown_unit(quantity), quantity), dtype=np.float64)


def span_of(largest: float) -> float:
    """What an axis spans for a largest value in the shown unit: that, or 1 where there is nothing to be seen."""
    return largest if largest > NOTHING else 1.0


def signal_label(quantity: str) -> str:
    """Name and unit of what a model, a run or a diagnosis draws."""
    return f"{'torque' if quantity == 'torque' else 'transmission error'}, {shown_unit(quantity)}"


def over_angle(ax: Axes, *, ylabel: str, title: str) -> None:
    """Label axes over the output angle, from end to end of what is drawn."""
    ax.set(xlabel=OUTPUT_ANGLE, ylabel=ylabel, title=title)
    ax.margins(x=0)


def legend_below(ax: Axes, *, columns: int = 3, **options: Any) -> None:
    """Legend under the axes and their label, where it hides no line."""
    # the pad is in letters, not in parts of the axes, so it clears the label of low axes too
    place = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "borderaxespad": 4.2}
    look = {"ncols": columns, "frameon": False, "fontsize": "small", "handlelength": 3}
    ax.legend(**place, **look, **options)


def legend_beside(ax: Axes, *, title: str | None = None, away: float = 0.0) -> None:
    """Legend right of the axes, for long names; so much of their width away where something stands between."""
    look = {"frameon": False, "fontsize": "x-small", "title_fontsize": "x-small", "handlelength": 4}
    ax.legend(loc="upper left", bbox_to_anchor=(1.01 + away, 1), title=title, **look)


def to_bytes(figure: Figure, kind: str) -> bytes:
    """Figure as the bytes of a PNG or SVG file."""
    from matplotlib import rc_context

    buffer = io.BytesIO()
    # without metadata a picture holds no address and is the same tomorrow
    nameless = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    options: dict[str, Any] = {"dpi": 130} if kind == "png" else {"metadata": nameless}
    with rc_context({"svg.hashsalt": "rverror"}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")  # a box stands for it
        figure.savefig(buffer, format=kind, **options)
    return buffer.getvalue()


def svg_element(figure: Figure) -> str:
    """Figure as an SVG element to put into a page."""
    text = to_bytes(figure, "svg").decode("utf-8")
    return text[text.index("<svg") :]


def plain(text: str) -> str:
    """Text that is drawn as it stands: no formula between dollar signs, nothing that no font can hold."""
    printable = "".join(letter if letter.isprintable() else " " for letter in text)
    return printable.replace("$", r"\$")
