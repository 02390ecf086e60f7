"""Sweeps of the page of published numbers as pictures: what is printed as marks, what rverror gives as lines.

Every number is a cell of a table of ``docs/published.md``, which `published` writes and a test holds to the code; what
lies between marks and lines stands as a sentence on the page.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from rverror.views.plots.figure import new_figure, svg_element
from rverror.views.plots.style import BLACK, line_style

PAGE = Path(__file__).parents[1] / "published.md"

Row = Sequence[str]
Points = tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """What is printed and what is computed over one quantity.

    Attributes
    ----------
    across, up : str
        Labels of the axes.
    printed, computed : mapping of str to tuple of (float, float)
        Points by their name.
    against : mapping of str to str
        Which of the printed each of the computed is held against; the only one where left out.
    log : bool
        Whether the abscissa is one of ratios.
    """

    across: str
    up: str
    printed: Mapping[str, Points]
    computed: Mapping[str, Points]
    against: Mapping[str, str] = field(default_factory=dict)
    log: bool = False

    def differences(self) -> str:
        """Sentence with the least and the largest of printed less computed, of each line."""
        told = []
        for name, points in self.computed.items():
            marks = dict(self.printed[self.against.get(name, next(iter(self.printed)))])
            off = [(marks[x] - y, x) for x, y in points if x in marks]
            low, high = min(off)[0], max(off)[0]
            at = max(off, key=lambda pair: abs(pair[0]))[1]
            span = f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}, most at {at:g}"
            told.append(f"{name} {span}")
        return f"Printed less computed: {'; '.join(told)}."


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None


def _points(x: Sequence[str], y: Sequence[str]) -> Points:
    pairs = ((_number(a), _number(b)) for a, b in zip(x, y, strict=True))
    return tuple((a, b) for a, b in pairs if a is not None and b is not None)


def _down(
    across: str, up: str, *, log: bool = False, rows: slice = slice(None)
) -> Callable[[Row, Sequence[Row]], Sweep]:
    """Sweep of a table whose first column is the abscissa, whose second is printed, and whose others are computed."""

    def made(columns: Row, cells: Sequence[Row]) -> Sweep:
        first, second, *others = zip(*cells[rows], strict=True)
        named = {name: _points(first, each) for name, each in zip(columns[2:], others, strict=True)}
        printed = {columns[1]: _points(first, second)}
        return Sweep(across=across, up=up, printed=printed, computed=named, log=log)

    return made


def _of_wear(columns: Row, cells: Sequence[Row]) -> Sweep:
    return _down("wear, mm", "rise over no wear, arcsec")(columns, cells)


def _of_friction(columns: Row, cells: Sequence[Row]) -> Sweep:
    """All but the efficiency; of the printed law what the source says of it, from 0.01 on."""
    sweep = _down("coefficient of friction", "arcsec")(columns[:-1], [row[:-1] for row in cells])
    law = {name: points[1:] for name, points in sweep.printed.items()}
    return Sweep(across=sweep.across, up=sweep.up, printed=law, computed=sweep.computed)


def _of_spline(columns: Row, cells: Sequence[Row]) -> Sweep:
    """Without the first mark, which is the printed line drawn back to no clearance, and the last row, a difference."""
    sweep = _down("spline clearance, mm", "arcsec", rows=slice(0, -1))(columns, cells)
    marks = {name: points[1:] for name, points in sweep.printed.items()}
    return Sweep(across=sweep.across, up=sweep.up, printed=marks, computed=sweep.computed)


def _of_loads(columns: Row, cells: Sequence[Row]) -> Sweep:
    """Source 002's width over the torque, a line for each clearance."""
    torques = ("10", "20")
    return Sweep(
        across="output torque, N m",
        up="peak-to-peak, arcsec",
        printed={cells[0][0]: _points(torques, cells[0][1:3])},
        computed={row[0]: _points(torques, row[1:3]) for row in cells if row[0].startswith("clearance")},
    )


def _of_speeds(columns: Row, cells: Sequence[Row]) -> Sweep:
    """Source 002's width over the speed, as a share of that at 1600 rpm; below 0 N m contacts would have to pull."""
    speeds, printed, computed, against = ("1600", "2000"), {}, {}, {}
    for load, ratio, least in (("20 N m", 3, 4), ("10 N m", 5, 6)):
        mark = f"printed, {load}"
        printed[mark] = _points(speeds, ("1", cells[0][ratio]))
        for row in cells[1:]:
            name = f"{load}, {row[0]}, least torque {row[least]} N m"
            computed[name], against[name] = _points(speeds, ("1", row[ratio])), mark
    return Sweep(
        across="input speed, rpm", up="range over that at 1600 rpm", printed=printed, computed=computed, against=against
    )


#: Sections of the page that have a picture, and how their table is read.
SWEEPS: dict[str, Callable[[Row, Sequence[Row]], Sweep]] = {
    "002 load": _of_loads,
    "002 speed": _of_speeds,
    "003 sun wear": _of_wear,
    "003 planet wear": _of_wear,
    "003 spline clearance": _of_spline,
    "003 contact stiffness": _down("stiffness of the pin contacts, N/mm", "arcsec", log=True),
    "003 friction": _of_friction,
}


def picture_lines(key: str, columns: Row, cells: Sequence[Row]) -> list[str]:
    """Lines of the page for the picture of a table, and what it differs by; none where the table has no picture."""
    if key not in SWEEPS:
        return []
    return ["", f"<!-- picture: {key} -->", "", SWEEPS[key](columns, cells).differences()]


def sweep_on_page(key: str) -> Sweep:
    """The sweep as the cells of the page have it."""
    section = PAGE.read_text(encoding="utf-8").split(f"\n## {key}\n")[1].split("\n## ")[0]
    head, _, *rows = (line for line in section.splitlines() if line.startswith("|"))
    columns, *cells = ([cell.strip() for cell in line.strip("|").split("|")] for line in (head, *rows))
    return SWEEPS[key](columns, cells)


def picture(key: str) -> str:
    """A picture as a piece of HTML."""
    sweep = sweep_on_page(key)
    figure, (ax,) = new_figure(1, width=7.5, height=4.0)
    for number, (name, points) in enumerate(sweep.computed.items()):
        ax.plot(*zip(*points, strict=True), **line_style(number), label=name)
    for marker, (name, points) in zip("os", sweep.printed.items(), strict=False):
        said = name if name.startswith("printed") else f"printed: {name}"
        ax.plot(*zip(*points, strict=True), marker, color=BLACK, fillstyle="none", label=said)
    ax.set_xlabel(sweep.across)
    ax.set_ylabel(sweep.up)
    ax.set_xscale("log" if sweep.log else "linear")
    ax.grid(visible=True, alpha=0.3)
    figure.legend(loc="outside lower center", ncols=2, fontsize=8)
    words = f"{key}: marks as printed, lines as computed here"
    drawn = svg_element(figure).replace("<svg ", f'<svg role="img" aria-label="{words}" ', 1)
    return f'<figure class="drawn">{drawn}<figcaption>{words}</figcaption></figure>'
