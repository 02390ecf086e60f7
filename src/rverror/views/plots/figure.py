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
from rverror.base.directions import direction_signs
from rverror.base.errors import InputError
from rverror.base.numbers import way, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Axes  # that plots need not import it again
    from matplotlib.figure import Figure as Figure
    from matplotlib.legend import Legend
    from matplotlib.transforms import Transform
else:
    Axes = Figure = Any

#: Below so many arcsec or N*m there is nothing to be seen.
NOTHING = 1e-6

OUTPUT_ANGLE = "output angle, deg"
ORDER = "order, per output turn"

#: Columns of points of the widest figure as a file: two points in each are all that a line can show there.
COLUMNS = 1200
_PASSES = 8  # over the whole width, that are told apart
_KEPT_WHOLE = 4 * COLUMNS  # samples that are drawn as they are: no file grows large with them
_FREE = 1.0  # inches of the width of a cell, that are left free beside texts over and under axes
_WIDEST_BESIDE = 0.42  # of the room of axes, that a legend may take from their width
_HIGHEST_BELOW = 0.42  # or from their height
_INSCRIBED = 2**-0.5  # of the diameter of a circle, the side of a square in it
_DECADES = 3.0  # of the colours of a map, down from the largest
_EDGE = 0.3  # inches from the edge of a cell to the texts over and under axes: a label that sticks out stays free
_OVER_TICKS = 9.0  # points from axes to the title: half of a tick's number sticks out at their corner
_PAD = 4.2  # letters from axes to the legend under them: ticks and label
_FEWEST_LETTERS = 12  # of a line of a legend

Projection = Literal["rectilinear", "polar"]


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


def axes_of_rows(ax: Axes | None, names: Sequence[str], *, upwards: bool = True) -> tuple[Axes, Array]:
    """Axes with a name for each of their rows, as high as these need, and the place of each row."""
    places = np.arange(len(names), dtype=np.float64)
    ax = axes_for(ax, height=1.5 + 0.3 * max(len(names), 4))
    ax.set_yticks(places, names, fontsize="small")
    ends = (-0.6, max(len(names), 1) - 0.4)
    ax.set_ylim(ends if upwards else ends[::-1])
    return ax, places


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


def over_angle(ax: Axes, *title: str, y: str, x: str = OUTPUT_ANGLE, **look: Any) -> Axes:
    """Axes over the output angle, from end to end of what is drawn, `labelled`."""
    ax.margins(x=0)
    return labelled(ax, *title, x=x, y=y, **look)


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
        told.append(" and ".join(way(sense) for sense in (1.0, -1.0) if (direction_signs(direction) == sense).any()))
    return told


@missing_letters()
def titled(ax: Axes, *parts: str) -> None:
    """Title made of parts, with commas between them, from the left edge in as many lines as the axes' room asks for."""
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
    title = ax.set_title(",\n".join(lines), ha="left", pad=_OVER_TICKS)
    left, across = _left(ax, ax.transAxes + ax.titleOffsetTrans)  # type: ignore[attr-defined]  # as matplotlib does
    title.set(x=left, transform=across)


def labelled(
    ax: Axes,
    *title: str,
    x: str,
    y: str = "",
    legend: Literal["below", "beside", ""] = "below",
    columns: int = 3,
    legend_title: str | None = None,
    **limits: Any,
) -> Axes:
    """Axes with their labels, limits, title and legend."""
    ax.set(xlabel=x, ylabel=y, **limits)
    titled(ax, *title)
    if legend == "beside":
        legend_beside(ax, title=legend_title)
    elif legend:
        legend_below(ax, columns=columns)
    return ax


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
    """Width and height, in dots, for texts in the cell of axes; a figure without a layout gets one."""
    figure, part, spec = ax.get_figure(root=True), ax.get_figure(), ax.get_subplotspec()
    assert figure is not None
    assert part is not None
    if figure.get_layout_engine() is None:
        figure.set_layout_engine("constrained")
    if spec is None:
        return ax.bbox.width, ax.bbox.height
    grid = spec.get_gridspec()
    wide, high = part.bbox.width * len(spec.colspan) / grid.ncols, part.bbox.height * len(spec.rowspan) / grid.nrows
    return wide - _FREE * figure.dpi, high


def _left(ax: Axes, up: Transform) -> tuple[float, Transform]:
    """Left edge of the cell of axes, and a transform across in parts of the figure, up as given."""
    from matplotlib.transforms import blended_transform_factory

    part, spec = cast("Figure", ax.get_figure()), ax.get_subplotspec()
    if spec is None:
        return 0.0, up
    across = blended_transform_factory(getattr(part, "transSubfigure", part.transFigure), up)
    return spec.colspan.start / spec.get_gridspec().ncols + _EDGE * part.figure.dpi / part.bbox.width, across


@missing_letters()
def legend_below(ax: Axes, *, columns: int = 3, **options: Any) -> None:
    """Legend under the axes and their label, where it hides no line."""
    # the pad is in letters, not in parts of the axes, so it clears the label of low axes too
    left, across = _left(ax, ax.transAxes)
    place = {"loc": "upper left", "bbox_to_anchor": (left, 0.0), "bbox_transform": across, "borderaxespad": _PAD}
    look = {"frameon": False, "fontsize": "small", "handlelength": 3}
    wide, high = _room(ax)
    _legend(ax, columns, wide, _HIGHEST_BELOW * high, **place, **look, **options)


@missing_letters()
def legend_beside(ax: Axes, *, title: str | None = None, away: float = 0.0) -> None:
    """Legend right of the axes, for long names; so much of their width away where something stands between.

    Where it would take too much of their width, or is too high, it stands under them.
    """
    look = {"frameon": False, "fontsize": "x-small", "title_fontsize": "x-small", "handlelength": 4, "title": title}
    wide, high = _room(ax)
    legend, whole = _legend(ax, 1, wide, high, loc="upper left", bbox_to_anchor=(1.01 + away, 1), **look)
    if legend and not (whole and legend.get_window_extent().width <= _WIDEST_BESIDE * wide):
        legend_below(ax, title=title)


@missing_letters()
def legend_in_ring(ax: Axes, *, inner: float) -> None:
    """Legend in the middle of polar axes, or under them where a circle of so much of their radius does not hold it."""
    look = {"frameon": False, "fontsize": "x-small", "handlelength": 3}
    side = _INSCRIBED * inner * min(size_in_dots(ax))
    legend, whole = _legend(ax, 1, side, side, loc="center", **look)
    if not whole or (legend and legend.get_window_extent().width > side):
        legend_below(ax)


def heat_map(ax: Axes, meshes: Sequence[tuple[Array, Array, Array]], *, label: str) -> None:
    """Sizes in colours over three decades, with their bar: edges across and up, and sizes, of one or more meshes."""
    if not meshes:
        return
    from matplotlib.colors import LogNorm

    largest = span_of(max(float(size.max()) for *_, size in meshes))
    least = largest / 10**_DECADES
    scale = LogNorm(least, largest)
    for across, up, size in meshes:
        # of even lightness, large is dark: the same order in grey and for colour-blind eyes
        drawn = ax.pcolormesh(
            across, up, np.maximum(size, least), norm=scale, cmap="YlGnBu", rasterized=size.shape[0] > 1
        )
    ax.figure.colorbar(drawn, ax=ax, label=label, extend="min")


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
