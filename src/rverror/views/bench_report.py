"""What the bench leaves uncertain, beside measured figures: its budget for people and for programs."""

from __future__ import annotations

from typing import Any

from rverror.base.numbers import in_arcsec, rounded
from rverror.base.units import ARCSEC
from rverror.runs.measuring_chain import COVERAGE, BenchUncertainty, Figure
from rverror.views.blocks import Sheet, grid, line

#: What stands in brackets behind a figure's uncertainty.
BESIDE = f"bench, k = {COVERAGE:g}"
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


def bench_sheet(bench: BenchUncertainty | None, *, whole: bool = True) -> Sheet:
    """Budget as a report; `whole` as in `bench_json`."""
    if bench is None:
        return ()
    rows = [
        (one.name, one.distribution, one.divisor, *(size / ARCSEC for size in sizes))
        for one, peak, rms in zip(*(bench.budget(figure) for figure in _FIGURES), strict=True)
        for sizes in [(one.limit, one.standard, peak.limit, rms.limit)]
    ]
    shown = [pair for pair in _TOLD if whole or pair[1] != "peak_to_peak"]
    told = ", ".join(f"{words} ± {bench.of(figure) / ARCSEC:.3f}" for words, figure in shown)
    return (
        *grid(("part, arcsec", *_HEADS), rows),
        *line(f"Combined and expanded, k = {COVERAGE:g}: {told} arcsec; {_SAME}."),
    )
