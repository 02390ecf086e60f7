"""Colours, dashes and hatches that all plots share: told apart in print and by colour-blind eyes."""

from __future__ import annotations

from typing import Any

# Okabe and Ito's colours, which stay apart in print and for colour-blind eyes.
BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILLION, PURPLE = "#0072B2", "#D55E00", "#CC79A7"
GREY = "#A0A0A0"

#: Dash patterns, in points: what tells lines apart where a page is printed in grey.
DASHES = (
    "solid",
    (0, (5.0, 2.0)),
    (0, (1.2, 1.5)),
    (0, (7.0, 2.0, 1.2, 2.0)),
    (0, (3.0, 1.2, 3.0, 3.5)),
    (0, (7.0, 1.5, 1.2, 1.5, 1.2, 1.5)),
)
DASHED = DASHES[1]
_LINE_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY)
_HATCHES = ("", "///", "...", "\\\\\\", "xx", "--")


def line_style(number: int) -> dict[str, Any]:
    """Colour and dashes of the n-th line: neighbours differ in both, and 36 lines in one of them.

    Parameters
    ----------
    number : int
        From 0.

    Returns
    -------
    dict
        Options of matplotlib's ``plot``.

    Examples
    --------
    >>> line_style(0)
    {'color': '#0072B2', 'linestyle': 'solid'}
    """
    count = len(_LINE_COLOURS)
    return {"color": _LINE_COLOURS[number % count], "linestyle": DASHES[(number + number // count) % count]}


def fill_style(number: int) -> dict[str, Any]:
    """Colour and hatch of the n-th area."""
    at = number % len(_LINE_COLOURS)
    return {"facecolor": _LINE_COLOURS[at], "hatch": _HATCHES[at]}
