"""The picture of the rooms on the architecture page: `python docs/_ext/rooms_picture.py` writes docs/rooms.svg.

Where a room stands is said here; which arrows lead from it is read from the code.  An arrow is left out where a longer
way says the same.
"""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Mapping
from pathlib import Path

import grimp

import rverror

ROOT = Path(__file__).parents[2]
PICTURE = ROOT / "docs" / "rooms.svg"
#: Middle of a room across the picture, and what is written in it.
PLACES = {
    "app": (340, "command line, batches"),
    "reference": (602, "cases for other tools"),
    "views": (450, "text, pages, tables, plots"),
    "life": (230, "what grows, what jumped"),
    "lots": (230, "what processes made"),
    "matching": (550, "which parts to join"),
    "tolerances": (120, "budget, units, allocation"),
    "compensation": (775, "tables for controllers"),
    "diagnosis": (560, "residual to named cause"),
    "parts": (340, "what machines measure"),
    "runs": (360, "files, checks, virtual bench"),
    "dynamics": (590, "modes, error at speed"),
    "statics": (340, "equilibrium, prediction"),
    "model": (340, "catalogue, effects, closed form"),
    "geartrain": (340, "principle, kinematics, and a file for each sub-assembly:"),
    "base": (340, "arrays, units, errors, text"),
}
#: Files that stand side by side in the room of the gear train, in the order of the power.
PARTS = ("involute", "crank", "cycloid", "coupling", "feedback", "thermal")
WIDTH, ROW, BOX = 886, 76, (200, 44)  # px
WIDE = (560, 74)  # of the gear train

_STYLE = """
  rect { fill: #ffffff; stroke: #44546a; stroke-width: 1.3 }
  .ground { fill: #f6f7f9; stroke: none }
  .part { fill: #e8eef7 }
  .arrow { stroke: #44546a; stroke-width: 1.3; marker-end: url(#head) }
  text { font: 12px sans-serif; fill: #333f50; text-anchor: middle }
  .name { font: bold 14px sans-serif; fill: #1f2a3a }
"""


def layers() -> list[tuple[str, ...]]:
    """Rooms from the top down, as pyproject.toml has them; those of one line stand beside each other."""
    tools = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]
    lines = tools["importlinter"]["contracts"][0]["layers"]
    return [tuple(room.strip() for room in line.split("|")) for line in lines if line != "__main__"]


def rooms() -> list[str]:
    """Every room, from the top down."""
    return [room for layer in layers() for room in layer]


def purpose(room: str) -> str:
    """First sentence of what a room says of itself."""
    text = ast.get_docstring(ast.parse((Path(rverror.__file__).parent / room / "__init__.py").read_text("utf-8"))) or ""
    return " ".join(text.partition("\n\n")[0].split()).removesuffix(".")


def imports() -> dict[str, set[str]]:
    """Rooms that each room imports from."""
    graph = grimp.build_graph("rverror", cache_dir=None)
    found: dict[str, set[str]] = {room: set() for room in rooms()}
    for module in graph.modules:
        for other in graph.find_modules_directly_imported_by(module):
            one, two = (name.partition(".")[2].partition(".")[0] for name in (module, other))
            if one in found and two in found and one != two:
                found[one].add(two)
    return found


def reduced(graph: Mapping[str, set[str]]) -> dict[str, set[str]]:
    """The same without the arrows that a longer way makes superfluous."""

    def below(room: str) -> set[str]:
        return set().union(*({other} | below(other) for other in graph[room]))

    return {
        room: {other for other in others if not any(other in below(way) for way in others)}
        for room, others in graph.items()
    }


def boxes() -> dict[str, tuple[float, float, float, float]]:
    """Left, top, width and height of every room."""
    found, top = {}, 14.0
    for layer in layers():
        height = 0.0
        for room in layer:
            width, height = WIDE if room == "geartrain" else BOX
            found[room] = (PLACES[room][0] - width / 2, top, width, height)
        top += height + ROW - BOX[1]
    return found


def ends(one: str, other: str) -> tuple[float, float, float, float]:
    """Beginning and end of the arrow from a room to one below it."""
    (x, y, w, h), (u, v, s, _) = boxes()[one], boxes()[other]
    start, end = x + w / 2, u + s / 2
    # a quarter of a box aside, towards where it goes, so that arrows do not run into one another
    start += max(-w / 4, min(w / 4, end - start))
    end += max(-s / 4, min(s / 4, start - end))
    return start, y + h, end, v


def svg() -> str:
    """Text of the picture."""
    places, arrows = boxes(), reduced(imports())
    height = max(y + h for _, y, _, h in places.values()) + 14
    words = "; ".join(f"{one} from {', '.join(sorted(arrows[one]))}" for one in rooms() if arrows[one])
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:g}" width="{WIDTH}" role="img">',
        f"<title>Rooms of rverror and what they import: {words}</title>",
        f"<style>{_STYLE}</style>",
        '<defs><marker id="head" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" markerHeight="8" orient="auto">'
        '<path d="M0 0 8 4 0 8z" fill="#44546a"/></marker></defs>',
        f'<rect class="ground" width="{WIDTH}" height="{height:g}" rx="8"/>',
    ]
    for one in rooms():
        for other in sorted(arrows[one]):
            a, b, c, d = ends(one, other)
            lines.append(f'<line class="arrow" x1="{a:g}" y1="{b:g}" x2="{c:g}" y2="{d:g}"/>')
    for room, (x, y, w, h) in places.items():
        middle = x + w / 2
        lines += [
            f'<rect x="{x:g}" y="{y:g}" width="{w:g}" height="{h:g}" rx="5"/>',
            f'<text class="name" x="{middle:g}" y="{y + 18:g}">{room}</text>',
            f'<text x="{middle:g}" y="{y + 35:g}">{PLACES[room][1]}</text>',
        ]
        if room == "geartrain":
            step = (w - 20) / len(PARTS)
            for number, part in enumerate(PARTS):
                left = x + 10 + number * step
                lines += [
                    f'<rect class="part" x="{left + 3:g}" y="{y + 44:g}" width="{step - 6:g}" height="22" rx="3"/>',
                    f'<text x="{left + step / 2:g}" y="{y + 59:g}">{part}</text>',
                ]
    return "\n".join([*lines, "</svg>", ""])


if __name__ == "__main__":
    PICTURE.write_text(svg(), encoding="utf-8", newline="\n")
