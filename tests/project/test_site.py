"""The site builds without a warning, whole and offline: pages are reachable, sources pictured, names found."""

from __future__ import annotations

import ast
import inspect
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

import rverror
from modules import IMPORTABLE, PUBLIC, ROOMS, TREES, named
from pages import ROOT
from rverror.model.catalogue import CATALOGUE

for needed in ("sphinx", "furo", "numpydoc", "myst_nb", "jupytext", "matplotlib"):
    pytest.importorskip(needed)
image = pytest.importorskip("matplotlib.image")

DOCS = ROOT / "docs"
NOTEBOOKS = sorted(path.stem for path in (ROOT / "examples" / "notebooks").glob("*.py"))
#: Attributes that fetch when a page is opened, by tag; a link is followed by hand.
FETCHES = {
    "script": ("src",),
    "link": ("href",),
    "img": ("src", "srcset"),
    "iframe": ("src",),
    "source": ("src", "srcset"),
    "object": ("data",),
    "use": ("href", "xlink:href"),
    "image": ("href", "xlink:href"),
}


#: Looking for garbage takes a sixth of the time, and the process ends soon.  For a picture stand the words beside it.
BUILD = f"""
import gc, sys
gc.disable()
sys.path.insert(0, {str(DOCS / "_ext")!r})
import published_pictures, site_pages, speed_page
names = {{*published_pictures.SWEEPS, *speed_page.PICTURES}}
site_pages.picture = {{name: f'<span role="img" aria-label="{{name}}"></span>' for name in names}}.__getitem__
from sphinx.cmd.build import main
sys.exit(main(sys.argv[1:]))
"""


class Page(HTMLParser):
    """What a page of the site has: anchors, links, what it fetches, pictures and their words."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.ids: set[str] = set()
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.unnamed: list[str] = []
        self.pictures: list[str] = []
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        if "id" in given:
            self.ids.add(given["id"])
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        self.fetched += [given[name] for name in FETCHES.get(tag, ()) if name in given]
        named = given.get("alt") or given.get("aria-label")
        if tag == "img" or given.get("role") == "img":
            (self.pictures if named else self.unnamed).append(named or str(given))


def local(page: Page, link: str) -> tuple[Path, str] | None:
    """File and anchor that a link of the site leads to; None where it leads out of it."""
    parts = urlsplit(link)
    if parts.scheme or parts.netloc:
        return None
    target = (page.path.parent / unquote(parts.path)).resolve() if parts.path else page.path.resolve()
    return target, unquote(parts.fragment)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built once as anyone builds it, but without what is tested elsewhere: notebooks, pictures."""
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-c", BUILD, "-W", "--keep-going", "-j", "1", "-b", "html", "-d", str(out / "doctrees")]
    command += ["-D", "nb_execution_mode=off"]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(
        [*command, str(DOCS), str(out / "html")],
        env=environment,
        capture_output=True,
        encoding="utf-8",
        errors="replace",
        check=False,
    )
    assert done.returncode == 0, done.stderr[-4000:]
    assert "warning:" not in done.stdout.lower(), done.stdout[-2000:]
    return out / "html"


@pytest.fixture(scope="module")
def pages(built: Path) -> dict[str, Page]:
    return {path.relative_to(built).as_posix(): Page(path) for path in sorted(built.rglob("*.html"))}


def test_every_page_became_one_of_the_site(pages: dict[str, Page]) -> None:
    for path in DOCS.rglob("*.md"):
        if "_" not in {part[0] for part in path.relative_to(DOCS).parts}:
            assert path.relative_to(DOCS).with_suffix(".html").as_posix() in pages
    for name in NOTEBOOKS:
        assert f"notebooks/{name}.html" in pages


def test_every_page_is_reached_from_the_first(built: Path, pages: dict[str, Page]) -> None:
    reached, waiting = {"index.html"}, ["index.html"]
    while waiting:
        page = pages[waiting.pop()]
        for link in page.links:
            target = local(page, link)
            name = target[0].relative_to(built.resolve()).as_posix() if target else ""
            if name in pages and name not in reached:
                reached.add(name)
                waiting.append(name)
    assert set(pages) - reached <= {"search.html", "genindex.html", "py-modindex.html"}


def test_links_lead_to_files_and_anchors(pages: dict[str, Page]) -> None:
    known = {page.path.resolve(): page for page in pages.values()}
    for name, page in pages.items():
        for link in page.links:
            target = local(page, link)
            if target is None or link == "#":
                continue
            path, anchor = target
            assert path.exists(), f"{name}: {link}"
            if anchor and path in known:
                assert anchor in known[path].ids, f"{name}: {link}"


def test_nothing_is_fetched_from_elsewhere(built: Path, pages: dict[str, Page]) -> None:
    for name, page in pages.items():
        for address in page.fetched:
            if not address.startswith(("#", "data:")):
                target = local(page, address)
                assert target is not None, f"{name} fetches {address}"
                assert target[0].exists(), f"{name} lacks {address}"
    for sheet in built.rglob("*.css"):
        text = sheet.read_text(encoding="utf-8")
        assert not re.search(r"""(?:url\(|@import)\s*["']?(?:https?:)?//""", text), sheet.name


def test_pictures_have_words(pages: dict[str, Page]) -> None:
    for name, page in pages.items():
        # a notebook's figures come from its cells, whose text says what they show
        assert not page.unnamed or name.startswith("notebooks/"), f"{name}: {page.unnamed[:3]}"


def test_pictures_bring_their_ground() -> None:
    """Drawn dark on nothing they would be lost on a dark page."""
    for path in DOCS.rglob("*.svg"):
        words = re.sub(r"<defs>.*?</defs>", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
        width, height = re.findall(r'viewBox="0 0 (\d+) (\d+)"', words)[0]
        first = re.findall(r"<(?:rect|line|path|circle|text|g)\b[^>]*", words)[0]
        assert first.startswith("<rect"), path.name
        assert f'width="{width}" height="{height}"' in first, path.name
    for path in DOCS.rglob("*.png"):
        shape = image.imread(path)
        assert shape.shape[-1] == 3 or shape[..., 3].min() == 1, path.name


def test_every_source_is_pictured(pages: dict[str, Page]) -> None:
    page = pages["catalogue.html"]
    text = page.path.read_text(encoding="utf-8")
    for key in CATALOGUE:
        assert key.replace(".", "-").replace("_", "-") in page.ids
        told = [words for words in page.pictures if re.search(rf"\b{re.escape(key)}\b", words)]
        assert [words.split()[0] for words in told] in (["Where", "Influence"], ["Where"]), key
        if len(told) == 1:
            after = text.partition(f"Where {key}")[2].partition("<section")[0]
            assert "Nothing of it reaches the output" in after, key


def test_keys_and_sources_lead_to_their_places(pages: dict[str, Page]) -> None:
    linked: dict[str, set[str]] = {}
    for name, page in pages.items():
        text = re.sub(r"<(pre|title|script|h\d)\b.*?</\1>", "", page.path.read_text(encoding="utf-8"), flags=re.DOTALL)
        for link, words in re.findall(r'<a [^>]*href="([^"]+)"[^>]*>(.*?)</a>', text, flags=re.DOTALL):
            target = local(page, link)
            if target is not None and target[0].name in ("catalogue.html", "bibliography.html"):
                linked.setdefault(re.sub(r"<.*?>", "", words), set()).add(f"{target[0].name}#{target[1]}")
        bare = re.sub(r"<(a|dt)\b.*?</\1>", "", text, flags=re.DOTALL)
        keys = re.findall(r'<code[^>]*><span class="pre">([\w.]+)</span></code>', bare)
        assert not set(keys) & set(CATALOGUE), name
        if name.startswith(("theory/", "api/")):
            assert not re.search(r"\b[Ss]ource 00[0-4]\b", bare), name
    for key in CATALOGUE:
        assert linked[key] == {"catalogue.html#" + key.replace(".", "-").replace("_", "-")}, key
    text = pages["bibliography.html"].path.read_text(encoding="utf-8")
    entries = re.findall(r'<section id="(\w+)">\s*(?:<span id="\w+"></span>)?<h2>(00\d)', text)
    assert [number for _, number in entries] == ["000", "001", "002", "003", "004"]
    for anchor, number in entries:
        assert linked[number] == {f"bibliography.html#{anchor}"}, number


def test_what_is_wide_scrolls_in_its_own_box(built: Path, pages: dict[str, Page]) -> None:
    sheet = (built / "_static" / "rverror.css").read_text(encoding="utf-8")
    theme = (built / "_static" / "styles" / "furo.css").read_text(encoding="utf-8")
    assert re.search(r"\.formula \{[^}]*overflow-x: auto", sheet)
    assert re.search(r"#gallery tbody \{[^}]*display: grid", sheet)
    assert re.search(r"\.table-wrapper\.container\{[^}]*overflow-x:auto", theme)
    for name, page in pages.items():
        text = page.path.read_text(encoding="utf-8")
        assert "_static/rverror.css" in text, name
        free = re.sub(r'<div class="[^"]*formula[^"]*"[^>]*>.*?</div>', "", text, flags=re.DOTALL)
        assert 'display="block"' not in free, name
        framed = re.findall(r'<div class="table-wrapper[^"]*container"[^>]*>\s*<table class="docutils', text)
        assert len(framed) == len(re.findall(r'<table class="docutils', text)), name


def test_every_public_name_is_listed_and_described(pages: dict[str, Page]) -> None:
    index = pages["api/index.html"]
    described = {name: page for page in pages.values() for name in page.ids if re.match(r"(module-)?rverror\.", name)}
    for name, public_name in PUBLIC.items():
        room = public_name.split(".")[1]
        thing = named(public_name)
        if inspect.isclass(thing) or inspect.isfunction(thing):
            full = f"{thing.__module__}.{name}"
        else:  # a constant, described where it is defined
            (full,) = [entry for entry in described if entry.endswith(f".{name}")]
        assert full in described, full
        listing = [(pages[f"api/{room}.html"], public_name)]
        listing += [(index, f"rverror.{name}")] if name in rverror.__all__ else []
        for page, written in listing:
            assert any(link.endswith(f"#{full}") for link in page.links), full
            assert f">{written}<" in page.path.read_text(encoding="utf-8")


def test_the_names_of_a_first_program_stand_on_one_screen(pages: dict[str, Page]) -> None:
    text = pages["api/index.html"].path.read_text(encoding="utf-8")
    assert len(re.findall(r">rverror\.\w+<", text)) - len(ROOMS) <= 40


def public(module: str) -> Iterator[str]:
    """Public functions and classes that the text of a module defines."""
    for node in TREES[module].body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef) and not node.name.startswith("_"):
            yield f"{module}.{node.name}"


def test_every_module_is_described_once(pages: dict[str, Page]) -> None:
    for module in IMPORTABLE:
        if module == "rverror":  # its names are on the first page of the reference
            continue
        places = [name for name, page in pages.items() if f"module-{module}" in page.ids]
        assert len(places) == 1, module
        for name in public(module):
            assert name in pages[places[0]].ids, name


def test_formulas_are_written_for_browsers(pages: dict[str, Page]) -> None:
    text = pages["theory/principle.html"].path.read_text(encoding="utf-8")
    assert text.count("<math") > 20
    for name, page in pages.items():
        words = re.sub(r"<(pre|code|script).*?</\1>", "", page.path.read_text(encoding="utf-8"), flags=re.DOTALL)
        assert not re.search(r"\\(?:frac|sum|lambda|theta|Theta|cdot|delta)\b", words), name
        # an index stands beside its letter, and a mean has a line over all of it
        assert not re.search(r"<munderover>\s*<mi[^>]*>.</mi>\s*<mi[^>]*>.</mi>\s*<mo", words), name
        assert ">_</mo>" not in words, name
        # a unit such as N*m, twice in a line, is no emphasis
        assert not re.search(r"\w<em>\w|\w</em>\w", words), name
    # TeX takes one digit for each half of a fraction
    assert re.search(r"<mfrac[^>]*>\s*<mn>1</mn>\s*<mn>2</mn>", pages["theory/involute.html"].path.read_text("utf-8"))


def test_notebooks_show_their_cells(pages: dict[str, Page]) -> None:
    for name in NOTEBOOKS:
        text = pages[f"notebooks/{name}.html"].path.read_text(encoding="utf-8")
        assert text.count("cell_input") >= 4, name
