"""HTML without script, network or library: escaped text, tables, a page for light and dark, screen and paper."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from typing import Any

from rverror.base.numbers import brief
from rverror.base.text import printable

_STYLE = """
:root { color-scheme: light dark; --page: #ffffff; --ink: #1b1f24; --soft: #4f5964; --line: #ccd2d9; --panel: #f4f6f8;
  --grid: #e3e7eb; --measured: #9aa1aa; --before: #c25700; --after: #0067a3; --good: #0067a3; --warn: #a34700; }
@media (prefers-color-scheme: dark) { :root { --page: #14171b; --ink: #e8eaed; --soft: #a9b2bd; --line: #3b424b;
  --panel: #1d2127; --grid: #2a3037; --measured: #7d8691; --before: #f0a04b; --after: #62baf0; --good: #62baf0;
  --warn: #f0a04b; } }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 64rem; padding: 1.25rem 1rem 3rem; font: 1rem/1.5 system-ui, sans-serif;
  color: var(--ink); background: var(--page); overflow-wrap: anywhere; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: 0 0 .25rem; }
h2 { font-size: 1.2rem; margin: 2.25rem 0 .5rem; padding-top: .75rem; border-top: 1px solid var(--line); }
h3 { font-size: 1rem; margin: 1.25rem 0 .25rem; }
p, ul, ol { margin: .4rem 0; max-width: 46rem; }
li { margin: .35rem 0; }
.soft, figcaption { color: var(--soft); font-size: .9rem; }
.verdict { border-left: .4rem solid var(--good); background: var(--panel); padding: .7rem 1rem; margin: 1rem 0; }
.verdict.unexplained { border-left-color: var(--warn); border-left-style: double; }
.verdict p { margin: .15rem 0; max-width: none; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(13rem, 1fr)); gap: .75rem; margin: 1rem 0; }
.tile { border: 1px solid var(--line); border-radius: .4rem; padding: .6rem .8rem; }
.tile b { display: block; font-size: 1.15rem; font-variant-numeric: tabular-nums; }
.scroll { overflow-x: auto; margin: .6rem 0; }
table { width: max-content; border-collapse: collapse; font-size: .92rem; font-variant-numeric: tabular-nums;
  overflow-wrap: normal; }
th, td { text-align: left; padding: .3rem .9rem .3rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
td { max-width: 22rem; }
thead th { color: var(--soft); font-weight: 600; border-bottom-width: 2px; }
td.n, th.n { text-align: right; white-space: nowrap; }
code, pre, .mono { font-family: ui-monospace, monospace; font-size: .86em; }
.hash { display: inline-block; min-width: 17rem; overflow-wrap: anywhere; }
pre { overflow-x: auto; background: var(--panel); padding: .8rem; line-height: 1.4; }
figure { margin: .8rem 0; }
svg { display: block; max-width: 100%; height: auto; }
.narrow { display: none; }
@media (max-width: 46rem) { .wide { display: none; } .narrow { display: block; } h1 { font-size: 1.35rem; }
  .units table, .units tbody, .units tr, .units td { display: block; width: auto; max-width: none; text-align: left; }
  .units thead { display: none; } .units tr { border-bottom: 1px solid var(--line); padding: .5rem 0; }
  .units td { border: 0; padding: .05rem 0; overflow-wrap: anywhere; } .units td:empty { display: none; }
  .units td:nth-child(4)::before { content: "rms before "; } .units td:nth-child(5)::before { content: "rms after "; } }
.key { display: flex; flex-wrap: wrap; gap: .2rem 1.2rem; font-size: .88rem; margin: .3rem 0; }
.key svg { display: inline-block; vertical-align: middle; margin-right: .4rem; }
svg text { font: 12px system-ui, sans-serif; fill: var(--ink); }
svg text.tick { fill: var(--soft); }
svg text.name { paint-order: stroke; stroke: var(--page); stroke-width: 4px; stroke-linejoin: round; }
svg text.strong { font-weight: 700; }
svg path, svg polyline { fill: none; stroke-width: 1; stroke-linejoin: round; }
svg .grid { stroke: var(--grid); }
svg .axis, svg .lead { stroke: var(--soft); }
svg .lead { stroke-width: .7; }
svg .measured { stroke: var(--measured); stroke-width: 3; }
svg .before { stroke: var(--before); stroke-width: 1.2; }
svg .after { stroke: var(--after); stroke-width: 1.2; }
svg .aside { stroke: var(--ink); stroke-width: 1.5; }
svg .slip { fill: var(--ink); }
svg .area { fill: var(--measured); fill-opacity: .45; stroke: var(--measured); }
svg .whisker { stroke: var(--ink); stroke-width: 1.2; }
svg .limit { stroke: var(--ink); stroke-width: 2.2; }
svg .level { stroke: var(--after); stroke-width: 1.4; stroke-dasharray: 5 3; }
svg rect.before { fill: var(--before); stroke: none; }
svg rect.after { fill: var(--after); stroke: none; }
svg .stem.before { stroke-width: 3.6; opacity: .55; }
svg .stem.after { stroke-width: 1.3; }
@media print { :root { color-scheme: light; --page: #fff; --ink: #000; --soft: #333; --line: #999; --panel: #fff;
  --grid: #ddd; --measured: #c4c4c4; --before: #7a7a7a; --after: #000; --good: #000; --warn: #000; }
  body { max-width: none; font-size: 10pt; } figure, tr, .verdict, .tile { break-inside: avoid; }
  h2, h3 { break-after: avoid; } .wide { display: block; } .narrow { display: none; }
  table { width: auto; font-size: 8pt; } .scroll, pre { overflow: visible; } pre { white-space: pre-wrap; } }
"""


def escaped(text: str) -> str:
    """`printable`, safe inside HTML, SVG and quoted attributes.

    Examples
    --------
    >>> escaped('<b a="1">')
    '&lt;b a=&quot;1&quot;&gt;'
    """
    return html.escape(printable(text), quote=True)


def escaped_lines(text: str) -> str:
    """`escaped` line by line."""
    return "\n".join(escaped(line) for line in text.split("\n"))


def table(heads: Sequence[str], rows: Sequence[Sequence[str]], *, numbers: Sequence[int] = ()) -> str:
    """Table of cells that are HTML already.

    Parameters
    ----------
    heads : sequence of str
        Plain text.
    rows : sequence of sequence of str
        HTML.
    numbers : sequence of int
        Columns to set flush right.

    Returns
    -------
    str
    """

    def cells(tag: str, row: Sequence[str]) -> str:
        scope = ' scope="col"' if tag == "th" else ""
        marks = [' class="n"' if at in numbers else "" for at in range(len(row))]
        return "".join(f"<{tag}{scope}{mark}>{cell}</{tag}>" for mark, cell in zip(marks, row, strict=True))

    head = cells("th", [escaped(text) for text in heads])
    body = "\n".join(f"<tr>{cells('td', row)}</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table>"


def scrolled(heads: Sequence[str], rows: Sequence[Sequence[str]], *, numbers: Sequence[int] = ()) -> str:
    """`table` within a box that scrolls where it is too wide."""
    return f'<div class="scroll" tabindex="0">{table(heads, rows, numbers=numbers)}</div>'


def number(value: float | None) -> str:
    """Number as in the JSON, to four digits, with its full digits at hand; a dash where there is none."""
    if value is None:
        return "–"
    return f'<data value="{value!r}">{brief(value)}</data>'


def tiles(boxes: Sequence[tuple[str, str]]) -> str:
    """Leading figures side by side: what each is, plain text, and its size, HTML."""
    each = (f'<div class="tile"><span class="soft">{escaped(what)}</span><b>{size}</b></div>' for what, size in boxes)
    return f'<div class="tiles">{"".join(each)}</div>'


def inputs(files: Sequence[Mapping[str, Any]], version: str) -> str:
    """Section of the files that a result was made from, as its JSON lists them, and of the version."""
    rows = [
        [escaped(item["path"]), number(item["bytes"]), f'<code class="hash">{escaped(item["sha256"])}</code>']
        for item in files
    ]
    listed = scrolled(["file", "bytes", "sha256"], rows, numbers=(1,)) if rows else ""
    return f"<h2>Inputs and version</h2>\n{listed}\n<p>rverror {escaped(version)}</p>"


def document(title: str, body: str) -> str:
    """Page that needs nothing else.

    Parameters
    ----------
    title : str
        Plain text.
    body : str
        HTML.

    Returns
    -------
    str
    """
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'">
<title>{escaped(title)}</title>
<style>{_STYLE}</style>
</head>
<body>
<main>
{body}
</main>
</body>
</html>
"""
