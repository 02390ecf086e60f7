"""What the bench leaves uncertain, beside measured figures: its budget for people and for programs."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rverror.base.numbers import in_arcsec
from rverror.base.units import ARCSEC
from rverror.runs.measuring_chain import COVERAGE, BenchUncertainty, Figure
from rverror.views.fields import Field, entry, rows, same_unit
from rverror.views.shown_units import ANGLE, NUMBER
from rverror.views.variables import Variable

#: What stands in brackets behind a figure's uncertainty.
BESIDE = f"bench, k = {COVERAGE:g}"
_SAME = "the same in every turn and run: no averaging takes it off, and differences between runs are free of it"
_FIGURES: tuple[Figure, ...] = ("reading", "peak_to_peak", "rms")
#: Of a part of the budget, which stands in the budget of each figure.
_PART: dict[str, Field] = {
    **same_unit(None, "name", "distribution", within="0."),
    "divisor": ("0.divisor", NUMBER),
    **same_unit(ANGLE, "limit", "standard", within="0."),
    "in_a_peak_to_peak": ("1.limit", ANGLE),
    "in_an_rms": ("2.limit", ANGLE),
}


def _parts(bench: BenchUncertainty) -> Iterable[Any]:
    return zip(*(bench.budget(figure) for figure in _FIGURES), strict=True)


def budget_of(bench: BenchUncertainty | None) -> dict[str, Variable]:
    """Budget as variables, a row for each part; none where nothing is stated."""
    return {} if bench is None else rows("bench", _parts(bench), "bench_", **_PART)


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
    return {
        "coverage_factor": COVERAGE,
        **{f"{figure}_arcsec": in_arcsec(bench.of(figure)) for figure in _FIGURES},
        **({} if whole else {"peak_to_peak_arcsec": None}),
        "heldout_rms_arcsec": in_arcsec(bench.of("rms")),
        "parts": [entry(one, **_PART) for one in _parts(bench)],
    }


def of_figures(bench: BenchUncertainty, *, whole: bool = True) -> str:
    """What the bench leaves uncertain of each figure; `whole` as in `bench_json`."""
    shown = [figure for figure in _FIGURES if whole or figure != "peak_to_peak"]
    words = {"reading": "one angle", "peak_to_peak": "peak-to-peak", "rms": "rms"}
    figures = ", ".join(f"{words[figure]} ± {bench.of(figure) / ARCSEC:.3f}" for figure in shown)
    return f"Combined and expanded, k = {COVERAGE:g}: {figures} arcsec; {_SAME}."
