"""Blocks of which every report consists, and the two ways to set them: as HTML and as text.

A report is a tuple of blocks.  Every text is escaped here.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from rverror.base.numbers import brief
from rverror.base.text import joined
from rverror.views.html import escaped

#: Rows that a table shows before it says how many more there are.
MOST_ROWS = 24

_NONE = "–"
_NAMED = 6  # names in a sentence
_PAGE, _HEAD = 140, 13  # letters and gaps of a table as wide as a page; letters of a head before it is broken
_STAYING = ("interval", "unit")
_WIDEST = 44  # letters of a fact's name or a text cell that others are lined up with


@dataclass(frozen=True)
class Title:
    """Kind of result, and what it is of, in a few words."""

    kind: str
    rest: tuple[str, ...]


@dataclass(frozen=True)
class Heading:
    """Heading of a section; a notebook folds the section away."""

    text: str


@dataclass(frozen=True)
class Sentence:
    """A sentence, and the words of its beginning that are read first, if any."""

    text: str
    strong: str = ""


@dataclass(frozen=True)
class Listing:
    """Table of texts and numbers; `links` are where the first cell of each row leads, empty for nowhere."""

    heads: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]
    links: tuple[str, ...] = ()

    @property
    def most(self) -> int:
        """Rows that are shown: all of an index."""
        return len(self.rows) if self.links else MOST_ROWS

    def cells(self) -> list[list[str]]:
        """Rows as texts, as many as are shown."""
        return [[_cell(value) for value in row] for row in self.rows[: self.most]]

    def flush(self) -> list[int]:
        """Columns of numbers alone, which are set flush right."""
        numbers = (float, int, Ends, type(None))
        return [at for at in range(len(self.heads)) if all(isinstance(row[at], numbers) for row in self.rows)]

    def parts(self) -> Iterator[list[int]]:
        """Columns of one table after another, each as wide as a page at the most; all begin with the first column.

        An interval stays with what it is of, and a unit with its size.
        """
        groups = list[list[int]]()
        for at, head in enumerate(self.heads):
            if at > 1 and head.endswith(_STAYING):
                groups[-1].append(at)
            elif at:
                groups.append([at])
        cells = [[head[:_HEAD], *(row[at][:_WIDEST] for row in self.cells())] for at, head in enumerate(self.heads)]
        letters = [2 + max(map(len, column)) for column in cells]
        part = [0]
        for group in groups:
            if len(part) > 1 and sum(letters[at] for at in part + group) > _PAGE:
                yield part
                part = [0]
            part += group
        yield part

    def more(self) -> list[str]:
        """How many rows are not shown; nothing where all are."""
        left = len(self.rows) - self.most
        return [f"and {left} more"] if left > 0 else []


@dataclass(frozen=True)
class Facts:
    """Names and texts, one under another."""

    facts: tuple[tuple[str, str], ...]


Block = Title | Heading | Sentence | Listing | Facts
Sheet = tuple[Block, ...]


class Ends(tuple[float | None, float | None]):
    """Ends of an interval; None or not a number where it is not determined."""

    __slots__ = ()


# --- blocks that are left out where they would be empty ---------------------------------------------------------------


def line(*texts: str) -> Sheet:
    """Sentences; those without text are left out."""
    return tuple(Sentence(text) for text in texts if text)


def section(heading: str, *blocks: Block) -> Sheet:
    """Blocks under a heading, nothing where there are none."""
    return (Heading(heading), *blocks) if blocks else ()


def grid(heads: Sequence[str], rows: Iterable[Sequence[Any]], links: Sequence[str] = ()) -> Sheet:
    """Table, nothing where it has no row."""
    listed = tuple(tuple(row) for row in rows)
    return (Listing(tuple(heads), listed, tuple(links)),) if listed else ()


def facts(given: Mapping[str, str]) -> Sheet:
    """Facts; those without text are left out."""
    known = tuple((name, text) for name, text in given.items() if text)
    return (Facts(known),) if known else ()


def some_of(names: Sequence[str]) -> str:
    """The first six of some names, and how many more there are.

    Examples
    --------
    >>> some_of(["a", "b"]), some_of(list("abcdefgh"))
    ('a, b', 'a, b, c, d, e, f and 2 more')
    """
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more


def in_words(value: Any) -> Any:
    """Indices of a place, several texts or several numbers as one text; other values as they are.

    Examples
    --------
    >>> in_words({"crank": 0, "disc": 1}), in_words((1.0, 80.5)), in_words(("a", "b"))
    ('crank 0, disc 1', '1, 80.5', 'a; b')
    """
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {at}" for name, at in value.items())
    if isinstance(value, tuple) and not isinstance(value, Ends):
        numbers = all(isinstance(one, float) for one in value)
        return ", ".join(f"{one:g}" for one in value) if numbers else "; ".join(map(str, value))
    return value


def _cell(value: Any) -> str:
    if isinstance(value, Ends):
        known = [end for end in value if end is not None and not math.isnan(end)]
        return " to ".join(map(_number, known)) if len(known) == 2 else "not determined"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return _number(value) if value is None or isinstance(value, (int, float)) else str(in_words(value))


def _number(value: float | None) -> str:
    if value is None or math.isnan(value):
        return _NONE
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    return brief(float(value))


# --- the two ways to set a report -------------------------------------------------------------------------------------


def as_html(blocks: Sheet, *, folded: bool = False) -> str:
    """Report as HTML without script, links or colours of its own.

    Parameters
    ----------
    blocks : Sheet
    folded : bool
        Whether sections are folded away under their headings.
    """
    parts, closing = list[str](), list[str]()
    for block in blocks:
        if folded and isinstance(block, Heading):
            parts += [*closing, f"<details><summary>{escaped(block.text)}</summary>"]
            closing = ["</details>"]
        else:
            parts.append(_html_of(block))
    return "\n".join(parts + closing)


def _html_of(block: Block) -> str:
    match block:
        case Title():
            return f"<p>{', '.join([f'<strong>{escaped(block.kind)}</strong>', *map(escaped, block.rest)])}</p>"
        case Heading():
            return f"<h2>{escaped(block.text)}</h2>"
        case Sentence(strong=""):
            return _soft(block.text)
        case Sentence():
            return f'<p class="verdict"><strong>{escaped(block.strong)}</strong>{escaped(block.text)}</p>'
        case Listing():
            return "\n".join(_table(block, part) for part in block.parts()) + "".join(map(_soft, block.more()))
        case Facts():
            rows_of = (
                f'<tr><th scope="row">{escaped(name)}</th><td>{escaped(text)}</td></tr>' for name, text in block.facts
            )
            return "<table><tbody>" + "\n".join(rows_of) + "</tbody></table>"


def _table(listing: Listing, part: Sequence[int]) -> str:
    """Some columns as a table within a box that scrolls where it is too wide."""
    rows = [[escaped(cell) for cell in row] for row in listing.cells()]
    for row, target in zip(rows, listing.links, strict=False):
        row[0] = f'<a href="{escaped(target)}">{row[0]}</a>' if target else row[0]
    look = [' class="n"' if at in listing.flush() else "" for at in range(len(listing.heads))]
    head = "".join(f'<th scope="col"{look[at]}>{escaped(listing.heads[at])}</th>' for at in part)
    body = "\n".join("<tr>" + "".join(f"<td{look[at]}>{row[at]}</td>" for at in part) + "</tr>" for row in rows)
    whole = f"<table><thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table>"
    return f'<div class="scroll" tabindex="0">{whole}</div>'


def _soft(text: str) -> str:
    return f'<p class="soft">{escaped(text)}</p>'


def as_text(blocks: Sheet) -> str:
    """Report as text that ends with a line end, its tables lined up."""
    lines: list[str] = []
    for before, block in itertools.pairwise((None, *blocks)):
        apart = isinstance(block, Heading | Listing | Facts) or isinstance(before, Listing | Facts)
        if apart and not isinstance(before, Heading | None):
            lines.append("")
        lines += _text_of(block) if block else ()
    return joined(lines)


def _text_of(block: Block) -> Iterator[str]:
    match block:
        case Title():
            yield f"{block.kind}: {', '.join(block.rest)}" if block.rest else block.kind
        case Heading():
            yield block.text
            yield "-" * len(block.text)
        case Sentence():
            yield block.strong + block.text
        case Listing():
            rows, flush = [list(block.heads), *block.cells()], block.flush()
            widths = [min(_WIDEST, max(map(len, column))) for column in zip(*rows, strict=True)]
            places = [f"{'>' if at in flush else '<'}{width}" for at, width in enumerate(widths)]
            yield from ("  ".join(map(format, row, places)).rstrip() for row in rows)
            yield from block.more()
        case Facts():
            width = min(_WIDEST, max((len(name) for name, _ in block.facts), default=0))
            yield from (f"{name:{width}}  {text}" for name, text in block.facts)
