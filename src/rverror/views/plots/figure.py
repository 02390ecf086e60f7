"""Figures without a window: axes of the right sort, colours, dashes and units that all plots share, and files.

matplotlib comes with the extra ``plot`` and is imported only when a figure is made.
"""

from __future__ import annotations

import io
import textwrap
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import way, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.transforms import Bbox, Transform

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

#: Columns of points of the widest figure as a file: two points in each are all that a line can show there.
COLUMNS = 1200
_PASSES = 8  # over the whole width, that are told apart
_KEPT_WHOLE = 4 * COLUMNS  # samples that are drawn as they are: no file grows large with them
_INSIDE = 0.96  # of the room of axes in a layout, less what it leaves free
_WIDEST_BESIDE = 0.4  # of the room of axes, that a legend may take from their width
_HIGHEST_BELOW = 0.5  # or from their height
_WIDE = 0.6  # of the room of axes, from which on a legend stands in its middle, not in that of the axes
_INSCRIBED = 2**-0.5  # of the diameter of a circle, the side of a square in it
_PAD = 4.2  # letters from axes to the legend under them: ticks and label
_FEWEST_LETTERS = 12  # of a line of a legend

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
    return figure, [_shown(ax) for ax in figure.subplots(rows, 1, squeeze=False)[:, 0]]


def can_draw() -> bool:
    """Whether matplotlib is installed."""
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError:
        return False
    return True


def _figure(width: float, height: float) -> Figure:
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InputError("plots need matplotlib; install it with: pip install 'rverror[plot]'") from error
    figure = Figure(figsize=(width, height), layout="constrained")
    figure._repr_png_ = partial(to_bytes, figure, "png")  # type: ignore[attr-defined]
    return figure


def _shown(ax: Axes) -> Axes:
    """Axes that a notebook shows as their figure; pyplot does not know that figure, so it is not shown twice."""
    ax._repr_png_ = partial(to_bytes, cast("Figure", ax.figure), "png")  # type: ignore[attr-defined]
    return ax


@contextmanager
def missing_letters() -> Iterator[None]:
    """Let letters that the font lacks be measured and drawn without a warning: a box stands for each."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        yield


def axes_for(
    ax: Axes | None, *, projection: Projection = "rectilinear", width: float = 9.0, height: float = 3.2
) -> Axes:
    """Axes to draw on: those given, if `check_axes` lets them pass, else those of a new figure of a size in inches."""
    if ax is None:
        return _shown(_figure(width, height).add_subplot(projection=projection))
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


def over_angle(ax: Axes, *, ylabel: str, title: list[str]) -> None:
    """Label axes over the output angle, from end to end of what is drawn."""
    ax.set(xlabel=OUTPUT_ANGLE, ylabel=ylabel)
    titled(ax, *title)
    ax.margins(x=0)


def stated(*, torque: Any = None, direction: Any = None) -> list[str]:
    """Torque, N*mm or with its unit, or of many angles, and direction as a title says them; nothing where not known.

    Examples
    --------
    >>> stated(torque=20e3, direction=-1.0)
    ['20 N*m', 'reverse']
    """
    if np.ndim(torque):
        told = [" to ".join(with_unit(float(end), "torque") for end in (np.min(torque), np.max(torque)))]
    else:
        told = [] if torque is None else [with_unit(units.to_core(torque, "torque"), "torque")]
    if direction is not None:
        told.append(" and ".join(way(sense) for sense in (1.0, -1.0) if (np.atleast_1d(direction) == sense).any()))
    return told


@missing_letters()
def titled(ax: Axes, *parts: str) -> None:
    """Title made of parts, with commas between them, in as many lines as the axes' room asks for."""
    room, _ = _room(ax)
    lines: list[str] = []
    for part in filter(None, parts):
        longer = f"{lines[-1]}, {part}" if lines else part
        if not lines or ax.set_title(longer).get_window_extent().width > room:
            lines.append(part)
        else:
            lines[-1] = longer
    for at, text in enumerate(lines):
        letters = len(text)
        while ax.set_title(lines[at]).get_window_extent().width > room and letters > _FEWEST_LETTERS:
            letters -= max(1, letters // 12)
            lines[at] = textwrap.fill(text, letters)
    title = ax.set_title(",\n".join(lines))
    own = ax.transAxes + ax.titleOffsetTrans  # type: ignore[attr-defined]  # as matplotlib places it
    wide = title.get_window_extent().width > _WIDE * room
    title.set_transform(_across_figure(ax, own) if wide else own)
    title.set_x(_middle(ax) if wide else 0.5)
    _make_room(ax)


def thinned(x: Array, rows: Sequence[Array], columns: int) -> np.ndarray[tuple[int], np.dtype[np.intp]]:
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


def for_drawing(x: Array, *rows: Array) -> tuple[Array, ...]:
    """Line, or several over one abscissa, without the samples of a long trace that no picture can show.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Not a number where a line is broken.
    *rows : ndarray, shape (n,)

    Returns
    -------
    tuple of ndarray
        x and the rows: the lowest and the highest of each row in each column of points, so that no peak is lost.

    Examples
    --------
    >>> x = np.linspace(0, 1, 100_000)
    >>> thin, values = for_drawing(x, np.where(x == x[777], 9.0, np.sin(x)))
    >>> thin.size < 5000, float(values.max())
    (True, 9.0)
    """
    if x.size <= _KEPT_WHOLE:
        return (x, *rows)
    kept = thinned(x, rows, COLUMNS)
    return tuple(one[kept] for one in (x, *rows))


def tallest(place: Array, size: Array) -> tuple[Array, Array]:
    """Of very many stems those that a picture can show: in each column of points the tallest.

    Examples
    --------
    >>> place, size = tallest(np.arange(1e5), np.ones(100_000))
    >>> place.size <= COLUMNS
    True
    """
    if place.size <= COLUMNS:
        return place, size
    column = np.floor((place - place[0]) / (place[-1] - place[0]) * (COLUMNS - 1))
    order = np.lexsort((size, column))
    kept = np.sort(order[np.flatnonzero(np.diff(column[order], append=-1))])
    return place[kept], size[kept]


def _room(ax: Axes) -> tuple[float, float]:
    """Width and height, in dots, of what belongs to axes: their cell, or themselves where nothing lays figures out."""
    part = ax.get_figure()
    assert part is not None
    spec = ax.get_subplotspec()
    if spec is None or not _laid_out(ax):
        box = _place(ax)
        return box.width * part.bbox.width, box.height * part.bbox.height
    grid = spec.get_gridspec()
    wide, high = part.bbox.width * len(spec.colspan) / grid.ncols, part.bbox.height * len(spec.rowspan) / grid.nrows
    return _INSIDE * wide, high


def _middle(ax: Axes) -> float:
    """Middle of the cell of axes, or of themselves where nothing lays figures out, in parts of the figure's width."""
    spec = ax.get_subplotspec()
    if spec is None or not _laid_out(ax):
        return float(_place(ax).x0 + _place(ax).width / 2)
    return float(spec.colspan.start + spec.colspan.stop) / 2 / spec.get_gridspec().ncols


def _across_figure(ax: Axes, up: Transform) -> Transform:
    """Across in parts of the figure, up as given."""
    from matplotlib.transforms import blended_transform_factory

    part = cast("Figure", ax.get_figure())
    return blended_transform_factory(getattr(part, "transSubfigure", part.transFigure), up)


def _laid_out(ax: Axes) -> bool:
    figure = ax.get_figure(root=True)
    return figure is not None and figure.get_layout_engine() is not None


def _place(ax: Axes) -> Bbox:
    """Where axes stood before room was made in them, in parts of the figure."""
    spec, part = ax.get_subplotspec(), ax.get_figure()
    return ax.get_position() if spec is None else spec.get_position(cast("Figure", part))


def _make_room(ax: Axes, legend: Legend | None = None, *, beside: bool = False) -> None:
    """Take the room of a title of several lines and of a legend from their axes, where no layout does it."""
    part, spec = ax.get_figure(), ax.get_subplotspec()
    if part is None or _laid_out(ax):
        return
    box, wide, low = _place(ax), 0.0, 0.0
    title = ax.title.get_window_extent().height
    lines = 1 + ax.get_title().count("\n")
    high = title * (lines - 1) / lines
    if legend is not None and beside:
        wide = legend.get_window_extent().width
    elif legend is not None:
        under = box.y0 * part.bbox.height if spec is None or spec.is_last_row() else 0.0
        label = _PAD * legend.prop.get_size_in_points() * part.dpi / 72
        low = legend.get_window_extent().height + max(label - under, 0.0)
    across, up = part.bbox.width, part.bbox.height
    ax.set_position((box.x0, box.y0 + low / up, box.width - wide / across, box.height - (low + high) / up))
    ax.set_in_layout(True)  # who asks for a layout later gets it


@missing_letters()
def legend_below(ax: Axes, *, columns: int = 3, **options: Any) -> None:
    """Legend under the axes and their label, where it hides no line."""
    # the pad is in letters, not in parts of the axes, so it clears the label of low axes too
    place = {"loc": "upper center", "bbox_to_anchor": (0.5, 0.0), "borderaxespad": _PAD}
    look = {"frameon": False, "fontsize": "small", "handlelength": 3}
    wide, high = _room(ax)
    legend, _ = _legend(ax, columns, wide, _HIGHEST_BELOW * high, **place, **look, **options)
    if legend and legend.get_window_extent().width > _WIDE * wide:
        legend.set_bbox_to_anchor((_middle(ax), 0.0), transform=_across_figure(ax, ax.transAxes))
    _make_room(ax, legend)


@missing_letters()
def legend_beside(ax: Axes, *, title: str | None = None, away: float = 0.0) -> None:
    """Legend right of the axes, for long names; so much of their width away where something stands between.

    Where it would take too much of their width, or is too high, it stands under them.
    """
    look = {"frameon": False, "fontsize": "x-small", "title_fontsize": "x-small", "handlelength": 4, "title": title}
    wide, high = _room(ax)
    legend, whole = _legend(ax, 1, wide, high, loc="upper left", bbox_to_anchor=(1.01 + away, 1), **look)
    if legend is None or (whole and legend.get_window_extent().width <= _WIDEST_BESIDE * wide):
        _make_room(ax, legend, beside=True)
    else:
        legend_below(ax, title=title)


@missing_letters()
def legend_in_ring(ax: Axes, *, inner: float) -> None:
    """Legend in the middle of polar axes, or under them where a circle of so much of their radius does not hold it."""
    look = {"frameon": False, "fontsize": "x-small", "handlelength": 3}
    side = _INSCRIBED * inner * min(size_in_dots(ax))
    legend, whole = _legend(ax, 1, side, side, loc="center", **look)
    if not whole or (legend and legend.get_window_extent().width > side):
        legend_below(ax)


def size_in_dots(ax: Axes) -> tuple[float, float]:
    """Width and height of axes in the figure's layout, with what is on them so far."""
    figure = ax.get_figure(root=True)
    layout = None if figure is None else figure.get_layout_engine()
    if figure is not None and layout is not None:
        layout.execute(figure)
    box = ax.get_window_extent()
    return float(box.width), float(box.height)


def _legend(ax: Axes, columns: int, wide: float, high: float, **options: Any) -> tuple[Legend | None, bool]:
    """Legend no wider and no higher than this: with fewer columns, then broken lines, then fewer entries.

    Also whether all entries are in it.
    """
    from matplotlib.lines import Line2D

    handles = options.pop("handles", None) or ax.get_legend_handles_labels()[0]
    labels = [str(handle.get_label()) for handle in handles]
    if not handles:
        return None, True

    def made(labels: Sequence[str], more: int = 0) -> Legend:
        rest = ([Line2D([], [], ls="none")], [f"{more} more"]) if more else ([], [])
        kept = len(labels)
        return ax.legend([*handles[:kept], *rest[0]], [*labels, *rest[1]], ncols=columns, **options)

    legend = made(labels)
    while legend.get_window_extent().width > wide and columns > 1:
        columns -= 1
        legend = made(labels)
    told, letters = labels, max(map(len, labels))
    while legend.get_window_extent().width > wide and letters > _FEWEST_LETTERS:
        letters = min(letters - 1, int(letters * wide / legend.get_window_extent().width))
        told = [textwrap.fill(label, max(letters, _FEWEST_LETTERS), subsequent_indent="  ") for label in labels]
        legend = made(told)
    more = 0
    while legend.get_window_extent().height > high and more < len(told) - 1:
        more += 1
        legend = made(told[: len(told) - more], more)
    return legend, not more


def to_bytes(figure: Figure, kind: str) -> bytes:
    """Figure as the bytes of a PNG or SVG file."""
    from matplotlib import rc_context

    buffer = io.BytesIO()
    # without metadata a picture holds no address and is the same tomorrow
    nameless = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    options: dict[str, Any] = {"dpi": 130} if kind == "png" else {"metadata": nameless}
    with rc_context({"svg.hashsalt": "rverror"}), missing_letters():
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
