"""HTML that needs nothing else: escaped text, a page for light and dark, screen and paper."""

from __future__ import annotations

import html
from base64 import b64encode
from collections.abc import Sequence
from functools import cache
from hashlib import sha256
from importlib import resources

from rverror.base.text import printable


@cache
def shipped(name: str) -> str:
    """Style or script that pages hold, a file of the package's data."""
    return (resources.files("rverror") / "data" / name).read_text(encoding="utf-8")


def escaped(text: str) -> str:
    """`printable`, safe inside HTML, SVG and quoted attributes.

    Examples
    --------
    >>> escaped('<b a="1">')
    '&lt;b a=&quot;1&quot;&gt;'
    """
    return html.escape(printable(text), quote=True)


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
    scripted = f"; script-src{allowed}" if scripts else ""
    policy = f"default-src 'none'; img-src data:; style-src 'unsafe-inline'{scripted}"
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<title>{escaped(title)}</title>
<style>
{shipped("page.css")}</style>
</head>
<body>
<main>
{body}
</main>
{run}</body>
</html>
"""
