"""HTML that needs nothing else: escaped text, tables, a page for light and dark, screen and paper."""

from __future__ import annotations

import html
from base64 import b64encode
from collections.abc import Sequence
from hashlib import sha256

from rverror.base.text import printable

_STYLE = """
:root { color-scheme: light dark; --page: #ffffff; --ink: #1b1f24; --soft: #4f5964; --line: #ccd2d9; --panel: #f4f6f8;
  --good: #0067a3; }
@media (prefers-color-scheme: dark) { :root { --page: #14171b; --ink: #e8eaed; --soft: #a9b2bd; --line: #3b424b;
  --panel: #1d2127; --good: #62baf0; } }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 72rem; padding: 1.25rem 1rem 3rem; font: 1rem/1.5 system-ui, sans-serif;
  color: var(--ink); background: var(--page); overflow-wrap: anywhere; }
h1 { font-size: 1.6rem; line-height: 1.25; margin: 0 0 .25rem; }
h2 { font-size: 1.2rem; margin: 2.25rem 0 .5rem; padding-top: .75rem; border-top: 1px solid var(--line); }
h3 { font-size: 1rem; margin: 1.25rem 0 .25rem; }
p, ul, ol { margin: .4rem 0; max-width: 46rem; }
li { margin: .35rem 0; }
.soft, figcaption { color: var(--soft); font-size: .9rem; }
.verdict { border-left: .4rem solid var(--good); background: var(--panel); padding: .7rem 1rem; margin: 1rem 0; }
.scroll { overflow-x: auto; margin: .6rem 0; }
table { width: max-content; border-collapse: collapse; font-size: .92rem; font-variant-numeric: tabular-nums;
  overflow-wrap: normal; }
th, td { text-align: left; padding: .3rem .9rem .3rem 0; border-bottom: 1px solid var(--line); vertical-align: top; }
td { max-width: 22rem; overflow-wrap: break-word; }
thead th { color: var(--soft); font-weight: 600; border-bottom-width: 2px; }
td.n, th.n { text-align: right; }
td.n { white-space: nowrap; } th.n { max-width: 8em; }
code, pre { font-family: ui-monospace, monospace; font-size: .86em; }
pre { overflow-x: auto; background: var(--panel); padding: .8rem; line-height: 1.4; }
figure { margin: .8rem 0; }
svg { display: block; max-width: 100%; min-width: 34rem; height: auto; background: #fff; }
@media (max-width: 46rem) { h1 { font-size: 1.35rem; }
  .units table, .units tbody, .units tr, .units td { display: block; width: auto; max-width: none; text-align: left; }
  .units thead { display: none; } .units tr { border-bottom: 1px solid var(--line); padding: .5rem 0; }
  .units td { border: 0; padding: .05rem 0; overflow-wrap: anywhere; } .units td:empty { display: none; }
  .units td:nth-child(4)::before { content: "rms before "; } .units td:nth-child(5)::before { content: "rms after "; } }
@media print { :root { font-size: 10pt; color-scheme: light; --page: #fff; --ink: #000; --soft: #333; --line: #999;
  --panel: #fff; --good: #000; }
  body { max-width: none; padding: 0; } figure, tr, .verdict { break-inside: avoid; }
  h2, h3 { break-after: avoid; } .mpld3-toolbar, .mpld3-coordinates { display: none; }
  details::details-content { content-visibility: visible; }
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


def document(title: str, body: str, scripts: Sequence[str] = ()) -> str:
    """Page that needs nothing else and may reach nothing: only the scripts given run, told by their hashes.

    Parameters
    ----------
    title : str
        Plain text.
    body : str
        HTML.
    scripts : sequence of str
        Run once the page is there.

    Returns
    -------
    str
    """
    run = "".join(f"<script>{one}</script>\n" for one in scripts)
    allowed = "".join(f" 'sha256-{b64encode(sha256(one.encode()).digest()).decode()}'" for one in scripts)
    scripted = f"; img-src data:; script-src{allowed}" if scripts else ""
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'{scripted}">
<title>{escaped(title)}</title>
<style>{_STYLE}</style>
</head>
<body>
<main>
{body}
</main>
{run}</body>
</html>
"""
