"""Figures without a window: axes of the right sort, colours, dashes and units that all plots share, and files.

matplotlib comes with the extra ``plot`` and is imported only when a figure is made.
"""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterable, Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Literal, cast

import numpy as np

from rverror.base.arrays import Array, Flags
from rverror.base.errors import InputError, needing
from rverror.views.plots.style import line_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Axes  # that plots need not import it again
    from matplotlib.figure import Figure as Figure
else:
    Axes = Figure = Any

#: Below so many arcsec or N*m there is nothing to be seen.
NOTHING = 1e-6

#: Columns of points of the widest figure as a file: two points in each are all that a line can show there.
COLUMNS = 1200
_DECADES = 3.0  # of the colours of a map, down from the largest

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
    with needing("plots need matplotlib", "plot"):
        from matplotlib.figure import Figure
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


def parted(some: Flags, *looks: tuple[str, ...]) -> Iterator[tuple[Any, ...]]:
    """Rows that are chosen and then the others, each with its look; none of which there is no row."""
    return ((rows, *look) for rows, look in zip((some, ~some), looks, strict=True) if rows.any())


def span_of(largest: float) -> float:
    """What an axis spans for a largest value in the shown unit: that, or 1 where there is nothing to be seen."""
    return largest if largest > NOTHING else 1.0


def for_drawing(x: Array, *rows: Array, columns: int = COLUMNS) -> tuple[Array, ...]:
    """Line, or several over one abscissa, without the samples of a long trace that no picture can show.

    Parameters
    ----------
    x : ndarray, shape (n,)
        Not a number where a line is broken.
    *rows : ndarray, shape (n,)
    columns : int
        Of points, that are to be seen; up to four samples in each are all kept.

    Returns
    -------
    tuple of ndarray
        x and the rows: ends, breaks, and the lowest and the highest of each row in each of as many even stretches of
        samples, so that no peak is lost.

    Examples
    --------
    >>> x = np.linspace(0, 1, 100_000)
    >>> thin, values = for_drawing(x, np.where(x == x[777], 9.0, np.sin(x)))
    >>> thin.size < 5000, float(values.max())
    (True, 9.0)
    """
    if x.size <= 4 * columns:
        return (x, *rows)
    breaks = np.flatnonzero(np.isnan(x))
    kept = [np.array([0, x.size - 1]), breaks - 1, breaks, breaks + 1]
    stretches = np.split(np.arange(x.size), np.ceil(np.linspace(0, x.size - 1, columns + 1)[1:-1]).astype(int))
    for row in rows:
        known = np.where(np.isnan(row), np.nanmedian(row), row)
        kept += [stretch[[known[stretch].argmin(), known[stretch].argmax()]] for stretch in stretches]
    places = np.unique(np.concatenate(kept).clip(0, x.size - 1))
    return tuple(one[places] for one in (x, *rows))


def lines(ax: Axes, x: Array, rows: Iterable[tuple[str, Array]], **look: Any) -> None:
    """Lines over one abscissa with their names, each in the style of its number."""
    for number, (label, row) in enumerate(rows):
        ax.plot(*for_drawing(x, row), label=label, **look, **line_style(number))


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
