"""What the bench leaves uncertain, beside measured figures: its budget for people and for programs."""

from __future__ import annotations

from typing import Any

from rverror.base.numbers import in_arcsec
from rverror.base.units import ARCSEC
from rverror.runs.measuring_chain import COVERAGE, BenchUncertainty, Figure
from rverror.views.blocks import Sheet, grid, line
from rverror.views.fields import Field, entry
from rverror.views.variables import ANGLE, NUMBER

#: What stands in brackets behind a figure's uncertainty.
BESIDE = f"bench, k = {COVERAGE:g}"
_SAME = "the same in every turn and run: no averaging takes it off, and differences between runs are free of it"
_FIGURES: tuple[Figure, ...] = ("reading", "peak_to_peak", "rms")
_ANGLES = ("limit", "standard", "in_a_peak_to_peak", "in_an_rms")


def of_orders(bench: BenchUncertainty | None) -> dict[str, Field]:
    """Column of what the bench leaves uncertain of each order's amplitude; none where nothing is stated."""
    return {} if bench is None else {"bench_uncertainty": (lambda one: bench.of_order(one.order), ANGLE)}


def order_json(bench: BenchUncertainty | None, order: float) -> dict[str, Any]:
    """Entry of JSON of the same."""
    return {"bench_uncertainty_arcsec": None if bench is None else in_arcsec(bench.of_order(order))}


def bench_json(bench: BenchUncertainty | None, *, whole: bool = True) -> dict[str, Any] | None:
    """Budget as plain data for `json.dump`, arcsec; None where nothing is stated.

    Parameters
    ----------
    bench : BenchUncertainty, optional
    whole : bool
        Whether the figures are of waveforms.  Of single orders no peak-to-peak is told: the others are not known.
    """
    if bench is None:
        return None
    parts = zip(*(bench.budget(figure) for figure in _FIGURES), strict=True)
    return {
        "coverage_factor": COVERAGE,
        **{f"{figure}_arcsec": in_arcsec(bench.of(figure)) for figure in _FIGURES},
        **({} if whole else {"peak_to_peak_arcsec": None}),
        "heldout_rms_arcsec": in_arcsec(bench.of("rms")),
        "parts": [
            {
                **entry(one, name=None, distribution=None, divisor=NUMBER, limit=ANGLE, standard=ANGLE),
                "in_a_peak_to_peak": in_arcsec(peak.limit),
                "in_an_rms": in_arcsec(rms.limit),
            }
            for one, peak, rms in parts
        ],
    }


def bench_sheet(bench: BenchUncertainty | None, *, whole: bool = True) -> Sheet:
    """Budget as a report; `whole` as in `bench_json`."""
    content = bench_json(bench, whole=whole)
    if bench is None or content is None:
        return ()
    parts = content["parts"]
    heads = [f"{name.replace('_', ' ')}, arcsec" if name in _ANGLES else name for name in parts[0]]
    return grid(heads, [part.values() for part in parts]) + line(of_figures(bench, whole=whole))


def of_figures(bench: BenchUncertainty, *, whole: bool = True) -> str:
    """What the bench leaves uncertain of each figure; `whole` as in `bench_json`."""
    shown = [figure for figure in _FIGURES if whole or figure != "peak_to_peak"]
    words = {"reading": "one angle", "peak_to_peak": "peak-to-peak", "rms": "rms"}
    figures = ", ".join(f"{words[figure]} ± {bench.of(figure) / ARCSEC:.3f}" for figure in shown)
    return f"Combined and expanded, k = {COVERAGE:g}: {figures} arcsec; {_SAME}."
