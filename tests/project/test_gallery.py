"""The gallery of plots: a picture of every kind, small, beside the line that draws it; pictures that pages show."""

from __future__ import annotations

import ast
import re

import pytest

pytest.importorskip("matplotlib")

import gallery

from pages import DOCS, ROOT
from rverror.views.plots.drawing import PICTURES

_MOST = 60_000  # bytes of a picture
#: Kinds that are not in it: drawn as another result draws them, or of measurements that take too long to simulate.
WITHOUT = {
    "budget-contributions",
    "budget-envelope",
    "virtualunits-distribution",
    "allocation-at_load",
    "diagnosis-passport",
    "diagnosis-shares",
}


def test_every_kind_has_its_picture() -> None:
    kinds = {f"{kind.lower()}-{plot}" for kind, plots in PICTURES.items() for plot in plots}
    assert kinds - set(gallery.LINES) == WITHOUT


def test_each_line_draws_the_kind_that_it_is_named_after() -> None:
    for name, line in gallery.LINES.items():
        options = {word.arg: word.value for call in ast.walk(ast.parse(line)) if isinstance(call, ast.Call)
                   for word in call.keywords}  # fmt: skip
        plot = name.partition("-")[2]
        if "kind" in options:
            assert ast.literal_eval(options["kind"]) == plot, name


def test_pictures_are_small_and_all_shown() -> None:
    pictures = {path.stem: path.read_bytes() for path in (DOCS / gallery.FOLDER).iterdir()}
    assert set(pictures) == set(gallery.LINES)
    others = {name: (DOCS / f"{name}.png").read_bytes() for name in gallery.OTHERS}
    assert {f"theory/{path.stem}" for path in (DOCS / "theory").glob("*.png")} <= set(others)
    for name, content in (pictures | others).items():
        assert content[:4] == b"\x89PNG", name
        assert len(content) < _MOST, name


def test_the_page_has_the_gallery_as_it_is_drawn() -> None:
    page = (DOCS / "plots.md").read_text(encoding="utf-8")
    assert gallery.written(page) == page


def test_pictures_that_pages_show_are_there() -> None:
    for path in [ROOT / "README.md", *DOCS.rglob("*.md")]:
        for words, target in re.findall(r"!\[([^]]*)\]\(([^)]+)\)", path.read_text(encoding="utf-8")):
            assert words, f"{path}: {target}"
            assert (path.parent / target).is_file(), f"{path}: {target}"
