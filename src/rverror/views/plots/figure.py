"""Figures without a window: axes of the right sort, colours, dashes and units that all plots share, and files.

matplotlib comes with the extra ``plot`` and is imported only when a figure is made.
"""

from __future__ import annotations

import io
import textwrap
import warnings
from collections.abc import Iterable, Sequence
from functools import cache, partial
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.directions import direction_signs
from rverror.base.errors import InputError
from rverror.base.numbers import way, with_unit
from rverror.views.plots.style import line_style
from rverror.views.variables import unit_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Axes  # that plots need not import it again
    from matplotlib.figure import Figure as Figure
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
_POWERS = "LogFormatterSciNotation"  # matplotlib's own along a logarithmic axis
_DECADES = 3.0  # of the colours of a map, down from the largest
_LETTER = 0.55  # of the size of a font, the width of its letters in the mean
_MARGIN = 1.2  # inches of the width of a cell that labels and ticks take
_KEY = 9  # letters that a legend's line and the gap after it take
_COLUMNS = 4  # of a legend under the axes, at the most
_PAD = 4.2  # letters from axes to the legend under them: ticks and label
_BESIDE = 0.42  # of the width of a cell, for a legend beside the axes
_FEWEST_BESIDE = 33  # letters; where there is no room for them a legend stands under the axes

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
    figure = bare_figure(width, height * rows)
    return figure, [_shown(ax) for ax in figure.subplots(rows, 1, squeeze=False)[:, 0]]


def can_draw() -> bool:
    """Whether matplotlib is installed."""
    try:
        import matplotlib.figure  # noqa: F401
    except ImportError:
        return False
    return True


def bare_figure(width: float, height: float) -> Figure:
    """Figure of a size in inches, without axes or a window."""
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


def axes_for(
    ax: Axes | None, *, projection: Projection = "rectilinear", width: float = 9.0, height: float = 3.2
) -> Axes:
    """Axes to draw on: those given, else those of a new figure of a size in inches.

    Raises
    ------
    InputError
        If `ax` is no axes, or of another sort; or if it is not given and matplotlib is not installed.
    """
    if ax is None:
        return _shown(bare_figure(width, height).add_subplot(projection=projection))
    found = getattr(ax, "name", None)
    if not hasattr(ax, "plot") or not isinstance(found, str):
        raise InputError(f"ax is a {type(ax).__name__}, no axes of matplotlib; give one axes, or leave ax out")
    if found != projection:
        remedy = "figure.add_subplot(projection='polar')" if projection == "polar" else "figure.add_subplot()"
        raise InputError(f"ax has {found} axes, this plot needs {projection} ones; make them with {remedy}")
    return ax


def axes_of_rows(ax: Axes | None, names: Sequence[str], *, upwards: bool = True) -> tuple[Axes, Array]:
    """Axes with a name for each of their rows, as high as these need, and the place of each row."""
    places = np.arange(len(names), dtype=np.float64)
    ax = axes_for(ax, height=1.5 + 0.3 * max(len(names), 4))
    ax.set_yticks(places, names, fontsize="small")
    ends = (-0.6, max(len(names), 1) - 0.4)
    ax.set_ylim(ends if upwards else ends[::-1])
    return ax, places


def span_of(largest: float) -> float:
    """What an axis spans for a largest value in the shown unit: that, or 1 where there is nothing to be seen."""
    return largest if largest > NOTHING else 1.0


def signal_label(quantity: str) -> str:
    """Name and unit of what a model, a run or a diagnosis draws."""
    return f"{'torque' if quantity == 'torque' else 'transmission error'}, {unit_of(quantity).shown}"


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


def titled(ax: Axes, *parts: str) -> None:
    """Title made of parts, with commas between them, in as many lines as the axes' room asks for."""
    from matplotlib.ticker import FixedLocator

    named = isinstance(ax.yaxis.get_major_locator(), FixedLocator)  # names of rows stand left of the title
    names = max((len(label.get_text()) for label in ax.get_yticklabels()), default=0) if named else 0
    text = textwrap.fill(", ".join(filter(None, parts)), max(letters(ax, "large") - names, 1))
    ax.set_title(text, x=0.0, ha="left")


def labelled(
    ax: Axes,
    *title: str,
    x: str,
    y: str = "",
    legend: Literal["below", "beside", ""] = "below",
    legend_title: str | None = None,
    **limits: Any,
) -> Axes:
    """Axes with their labels, limits, title and legend."""
    ax.set(xlabel=x, ylabel=y, **limits)
    for axis in (ax.xaxis, ax.yaxis):
        if type(axis.get_major_formatter()).__name__ == _POWERS:
            axis.set_major_formatter(_log_numbers()())
            axis.set_minor_formatter(_log_numbers()(labelOnlyBase=False))
    titled(ax, *title)
    if legend == "beside":
        legend_beside(ax, title=legend_title)
    elif legend:
        legend_below(ax, title=legend_title)
    return ax


@cache
def _log_numbers() -> type[Any]:
    """Formatter of a logarithmic axis: plain numbers such as 0.5, where matplotlib puts powers of ten."""
    from matplotlib.ticker import LogFormatter

    class LogNumbers(LogFormatter):
        def __call__(self, x: float, pos: int | None = None) -> str:
            return f"{x:g}" if super().__call__(x, pos) else ""

    return LogNumbers


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


def lines(ax: Axes, x: Array, rows: Iterable[tuple[str, Array]], **look: Any) -> None:
    """Lines over one abscissa with their names, each in the style of its number."""
    for number, (label, row) in enumerate(rows):
        ax.plot(*for_drawing(x, row), label=label, **look, **line_style(number))


def legend_below(ax: Axes, *, title: str | None = None) -> None:
    """Legend under the axes and their label, where it hides no line."""
    room = letters(ax, "small")
    longest = max(map(len, ax.get_legend_handles_labels()[1]), default=0)
    columns = max(1, min(_COLUMNS, room // (longest + _KEY)))
    # the pad is in letters, not in parts of the axes, so it clears the label of low axes too
    _legend(ax, room, bbox_to_anchor=(0, 0), borderaxespad=_PAD, ncols=columns, fontsize="small", title=title)


def legend_beside(ax: Axes, *, title: str | None = None) -> None:
    """Legend right of the axes, for long names; in narrow axes it stands under them."""
    room = int(_BESIDE * letters(ax, "x-small"))
    if room < _FEWEST_BESIDE:
        legend_below(ax, title=title)
    else:
        _legend(ax, room, bbox_to_anchor=(1.01, 1), fontsize="x-small", title_fontsize="x-small", title=title)


def _legend(ax: Axes, room: int, **options: Any) -> None:
    handles, labels = ax.get_legend_handles_labels()
    if handles:
        wrapped = [textwrap.fill(label, max(room - _KEY, 1)) for label in labels]
        ax.legend(handles, wrapped, loc="upper left", frameon=False, handlelength=3.5, alignment="left", **options)


def heat_map(ax: Axes, meshes: Sequence[tuple[Array, Array, Array]], *, label: str) -> None:
    """Sizes in colours over three decades, with their bar: across, up and sizes of one or more meshes.

    Across and up are the places of the sizes, or the edges of their cells, one more.
    """
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


def to_bytes(figure: Figure, kind: str) -> bytes:
    """Figure as the bytes of a PNG or SVG file."""
    from matplotlib import rc_context

    buffer = io.BytesIO()
    # without metadata a picture holds no address and is the same tomorrow
    nameless = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    options: dict[str, Any] = {"dpi": 130} if kind == "png" else {"metadata": nameless}
    with rc_context({"svg.hashsalt": "rverror"}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")  # a box stands for each
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
