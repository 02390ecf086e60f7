"""The page of everything that the sources print, against the texts themselves where they are at hand."""

import re

import ledger
import published
import pytest
import source_items
from source_items import ITEMS, SOURCES

from pages import DOCS, ROOT
from recordings import source_text

PAGE = DOCS / "sources.md"
LEDGER = {row.key: row.verdict for row in ledger.table()}
#: What the verdicts of published numbers are here.
PUBLISHED = {
    "reproduced": "reproduced",
    "in trend": "corrected",
    "in part": "corrected",
    "not reproducible": "not reproducible",
}
FIGURES = r"following figure|graph below|Figure \d|plotted over time"


def of(source):
    return [item for item in ITEMS if item.source == source]


def page_sections():
    parts = re.split(r"^## (\d{3}) .*$", PAGE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return dict(zip(parts[1::2], parts[2::2], strict=True))


def equations(text):
    return [" ".join(found.split()) for found in re.findall(r"\$\$(.*?)\$\$", text, flags=re.DOTALL)]


def tables(text):
    """Tables, and what is left: runs of lines between bars, else blocks of several lines that are no bullets."""
    text = re.sub(r"\$\$.*?\$\$", "", text, flags=re.DOTALL)
    bars = r"(?:^\|.*\n?)+"
    if found := re.findall(bars, text, flags=re.MULTILINE):
        return found, re.sub(bars, "", text, flags=re.MULTILINE)
    blocks = re.split(r"\n\s*\n", text)
    found = [block for block in blocks if len(block.strip().splitlines()) > 2 and "•" not in block]
    return found, "\n".join(block for block in blocks if block not in found)


def claims(source, kind):
    return [claim for item in of(source) for claim in getattr(item, kind).items()]


@pytest.mark.parametrize(
    ("source", "numbers"), [("000", (15, 5)), ("001", (12, 3)), ("002", (18, 4)), ("003", (5, 4)), ("004", (8, 5))]
)
def test_every_equation_and_table_has_one_row(source, numbers):
    """How many there are is known also where the texts are not at hand."""
    for kind, last in zip(("equations", "tables"), numbers, strict=True):
        assert sorted(place for place, _ in claims(source, kind)) == list(range(1, last + 1)), kind


@pytest.mark.parametrize("source", SOURCES)
def test_every_equation_table_and_figure_of_the_text_is_in_one_row(source):
    text = source_text(source)
    found, prose = tables(text)
    figures = re.findall(FIGURES, prose)
    for kind, printed in (
        ("equations", equations(text)),
        ("tables", [table.strip().splitlines()[0] for table in found]),
        ("figures", figures),
    ):
        claimed = claims(source, kind)
        assert sorted(place for place, _ in claimed) == list(range(1, len(printed) + 1)), kind
        for place, mark in claimed:
            assert mark in printed[place - 1], (kind, place)


@pytest.mark.parametrize("source", SOURCES)
def test_every_number_of_the_prose_is_in_a_row(source):
    """Of two digits and more: single ones number headings, bodies and tables."""
    _, prose = tables(source_text(source))
    numeral = r"(?<![\w.,_^{-])-?\d[\d,]*(?:\.\d+)?(?![\d\w])"
    printed = {found.rstrip(",") for found in re.findall(numeral, prose)}
    printed = {number for number in printed if len(re.sub(r"\D", "", number)) > 1}
    assert len(printed) > 1
    rows = page_sections()[source]
    missing = [number for number in printed if not re.search(rf"(?<![\d.,]){re.escape(number)}(?![\d]|[.,]\d)", rows)]
    assert not missing


@pytest.mark.parametrize("source", SOURCES)
def test_no_sentence_is_that_of_the_source(source):
    def words(text):
        return re.findall(r"[a-z]+|\d+", text.lower())

    printed = words(source_text(source))
    runs = {tuple(printed[n : n + 8]) for n in range(len(printed))}
    for item in of(source):
        for said in (words(item.what), words(item.why)):
            assert runs.isdisjoint(tuple(said[n : n + 8]) for n in range(len(said) - 7)), item.what


@pytest.mark.parametrize("item", ITEMS, ids=lambda item: f"{item.source} {item.what[:40]}")
def test_every_row_leads_somewhere(item):
    assert item.verdict in source_items.VERDICTS
    assert item.why
    assert not item.why.endswith(".")
    assert all((ROOT / "tests" / name).is_file() for name in source_items.tests(item))
    if item.verdict in ("reproduced", "corrected"):
        assert item.held
        assert source_items.tests(item)
    table_verdicts = set()
    for name in item.held:
        kind, _, key = name.partition(" ")
        if kind == "ledger":
            table_verdicts.add(next(v for v in ledger.VERDICTS if LEDGER[key].startswith(v)))
        elif kind == "published":
            page, anchor = DOCS / "published.md", source_items.anchor(key)
            assert anchor in source_items.headings("published.md"), key
            line = re.search(rf"^\| \[.*\]\(#{anchor}\) \| (.*) \|$", page.read_text(encoding="utf-8"), re.MULTILINE)
            table_verdicts.add(PUBLISHED[line[1]])
        else:
            page, _, anchor = name.partition("#")
            assert not anchor or anchor in source_items.headings(page), name
            table_verdicts.add(item.verdict)  # a page has none of its own
    assert not table_verdicts or item.verdict in table_verdicts


def test_every_row_of_the_ledger_and_every_published_table_is_led_to():
    led_to = {name for item in ITEMS for name in item.held}
    assert {f"ledger {key}" for key in LEDGER} <= led_to
    anchors = {f"published {key}" for key in re.findall(r"^\| \[(.*)\]\(#", text_of("published"), re.MULTILINE)}
    assert len(anchors) == len(published.TABLES)
    assert anchors <= led_to


def text_of(name):
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")


def test_verdicts_of_published_numbers_are_all_read():
    assert set(PUBLISHED) == set(published.VERDICTS)


def test_page_is_the_output_of_the_generator():
    assert text_of("sources") == source_items.markdown(), (
        "docs/sources.md is out of date: python docs/_ext/source_items.py > docs/sources.md"
    )


def test_tables_of_the_page_have_the_same_columns_in_every_line():
    columns = None
    for line in source_items.markdown().splitlines():
        if not line.startswith("|"):
            columns = None
            continue
        columns = columns or line.count(" | ")
        assert line.count(" | ") == columns, line
