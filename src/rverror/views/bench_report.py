"""What the bench leaves uncertain, beside measured figures: its budget for people and for programs."""

from __future__ import annotations

from typing import Any

from rverror.base.numbers import in_arcsec, rounded
from rverror.base.units import ARCSEC
from rverror.runs.measuring_chain import COVERAGE, BenchUncertainty, Figure
from rverror.views.html import escaped, number, scrolled

#: What stands in brackets behind a figure's uncertainty.
BESIDE = f"bench, k = {COVERAGE:g}"
_HEADING = "What the bench leaves uncertain"
_SAME = "the same in every turn and run: no averaging takes it off, and differences between runs are free of it"
_FIGURES: tuple[Figure, ...] = ("reading", "peak_to_peak", "rms")
_TOLD: tuple[tuple[str, Figure], ...] = (("one angle", "reading"), ("peak-to-peak", "peak_to_peak"), ("rms", "rms"))
_HEADS = ("distribution", "divisor", "limit", "standard", "in a peak-to-peak", "in an rms")


def plus_minus(value: float | None, digits: int = 3) -> str:
    """Uncertainty as it stands behind a figure, the value in the figure's unit; nothing where none is stated.

    Examples
    --------
    >>> plus_minus(1.4319), plus_minus(None)
    (' ± 1.432', '')
    """
    return "" if value is None else f" ± {value:.{digits}f}"


def bench_json(bench: BenchUncertainty | None, *, whole: bool = True) -> dict[str, Any] | None:
    """Budget as plain data for `json.dump`, arcsec; None where nothing is stated.

    Parameters
    ----------
    bench : BenchUncertainty, optional
    whole : bool
        Whether the figures are of waveforms.  Of single orders no peak-to-peak is told: the others are not known.

    Returns
    -------
    dict or None
        Expanded uncertainty of each figure, ``heldout_rms_arcsec`` that of an rms; the parts for a reading at one
        angle, with what each may add to the other figures at the most.
    """
    if bench is None:
        return None
    rows = zip(*(bench.budget(figure) for figure in _FIGURES), strict=True)
    return {
        "coverage_factor": COVERAGE,
        **{f"{figure}_arcsec": in_arcsec(bench.of(figure)) for figure in _FIGURES},
        **({} if whole else {"peak_to_peak_arcsec": None}),
        "heldout_rms_arcsec": in_arcsec(bench.of("rms")),
        "parts": [
            {
                "name": one.name,
                "distribution": one.distribution,
                "divisor": rounded(one.divisor),
                "limit_arcsec": in_arcsec(one.limit),
                "standard_arcsec": in_arcsec(one.standard),
                "peak_to_peak_limit_arcsec": in_arcsec(peak.limit),
                "rms_limit_arcsec": in_arcsec(rms.limit),
            }
            for one, peak, rms in rows
        ],
    }


def bench_lines(bench: BenchUncertainty | None, *, whole: bool = True) -> list[str]:
    """Budget as lines of a text report; `whole` as in `bench_json`."""
    if bench is None:
        return []
    widths = (16, 9, 9, 10, 19, 11)
    heads = "".join(f"{head:>{width}}" for head, width in zip(_HEADS, widths, strict=True))
    lines = ["", f"{_HEADING}, arcsec", f"  {'':<15}{heads}"]
    for one, peak, rms in zip(*(bench.budget(figure) for figure in _FIGURES), strict=True):
        sizes = (one.limit, one.standard, peak.limit, rms.limit)
        cells = [one.distribution, f"{one.divisor:.3f}", *(f"{size / ARCSEC:.3f}" for size in sizes)]
        lines.append(f"  {one.name:<15}" + "".join(f"{c:>{width}}" for c, width in zip(cells, widths, strict=True)))
    shown = [pair for pair in _TOLD if whole or pair[1] != "peak_to_peak"]
    told = [f"{words} ± {bench.of(figure) / ARCSEC:.3f}" for words, figure in shown]
    return [*lines, f"  combined and expanded, k = {COVERAGE:g}: {', '.join(told)}", f"  {_SAME}"]


def bench_html(data: dict[str, Any] | None) -> str:
    """Budget as a section of an HTML page, from what `bench_json` makes."""
    if data is None:
        return ""
    sizes = ("divisor", "limit_arcsec", "standard_arcsec", "peak_to_peak_limit_arcsec", "rms_limit_arcsec")
    rows = [
        [escaped(one["name"]), escaped(one["distribution"]), *(number(one[size]) for size in sizes)]
        for one in data["parts"]
    ]
    told = ", ".join(
        f"{words} ± {number(size)}" for words, figure in _TOLD if (size := data[f"{figure}_arcsec"]) is not None
    )
    return (
        f"<h2>{_HEADING}</h2>\n"
        + scrolled(["part, arcsec", *_HEADS], rows, numbers=range(2, 7))
        + f"<p>Combined and expanded, k = {COVERAGE:g}: {told} arcsec; {_SAME}.</p>"
    )
