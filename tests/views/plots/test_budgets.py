"""Plots of a budget, of virtual units and of an allocation show the numbers that these hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drawn import legend, line
from rverror import InputError, Model, error_budget, reducer, tolerance
from rverror.base.units import ARCSEC
from rverror.tolerances import Allocation, ErrorBudget, cost_front, stack
from rverror.tolerances.allocation_result import FrontPoint
from rverror.tolerances.cost import Reciprocal

MODEL = Model(reducer("RV-40E"))
TOLERANCES = (
    tolerance("crank.eccentricity", "5 um"),
    tolerance("cycloid.pin_radius", "3 um"),
    tolerance("coupling.carrier_bore_position", "4 um"),
)
LIMITS = [limit * ARCSEC for limit in (2.0, 40.0, 60.0)]


@pytest.fixture(scope="module")
def found() -> ErrorBudget:
    return error_budget(MODEL, TOLERANCES, theta=2 * np.pi * np.arange(512) / 512, count=2048, index_count=256)


@pytest.fixture(scope="module")
def least() -> tuple[Allocation, tuple[FrontPoint, ...]]:
    costs = (Reciprocal(10.0, 0.005), Reciprocal(4.0, 0.003), Reciprocal(2.0, 0.004))
    items = [replace(one, cost=cost, bounds=(2e-3, 0.02)) for one, cost in zip(TOLERANCES, costs, strict=True)]
    items[2] = replace(items[2], fixed=True)
    laid_out = stack(MODEL, items, theta=2 * np.pi * np.arange(512) / 512)
    (found,) = cost_front(laid_out, [40 * ARCSEC], kind="worst")
    assert found.allocation is not None
    return found.allocation, cost_front(laid_out, LIMITS, kind="worst")


def bars(ax) -> list[list[float]]:
    return [[bar.get_width() for bar in container] for container in ax.containers if hasattr(container, "patches")]


def test_bars_are_shares_of_the_variance_and_total_indices(found: ErrorBudget) -> None:
    ax = found.plot()
    entries = found.closed.contributions
    words = [tick.get_text() for tick in ax.get_yticklabels()]
    assert words == [e.label for e in sorted(entries, key=lambda e: e.share) if e.effect == "wave"]
    shares, totals = bars(ax)
    assert shares == pytest.approx(
        [100 * e.share for e in sorted(entries, key=lambda e: e.share) if e.effect == "wave"]
    )
    assert sum(shares) == pytest.approx(100)
    assert found.indices is not None
    places = [next(i for i, e in enumerate(entries) if e.label == word) for word in words]
    assert totals == pytest.approx(100 * found.indices.total[places])


def test_the_closed_form_alone_has_no_indices(found: ErrorBudget) -> None:
    ax = found.closed.plot()
    assert legend(ax) == ["share of the variance"]
    assert bars(ax) == [bars(found.plot())[0]]


def test_the_envelope_holds_every_unit_at_its_limits(found: ErrorBudget) -> None:
    ax = found.plot(kind="envelope")
    angle, mean = line(ax, "expected")
    assert angle == pytest.approx(np.degrees(found.closed.theta))
    assert mean == pytest.approx(found.closed.mean / ARCSEC)
    (worst,) = [text for text in legend(ax) if text.startswith("worst case")]
    less = float(worst.split()[3])  # carrier bores shift the whole
    assert less > 30
    assert line(ax, worst)[1] - less == pytest.approx(found.closed.worst.lower / ARCSEC, abs=0.05)
    corners = ax.collections[0].get_paths()[0].vertices[:, 1]
    closed = found.closed
    assert corners.max() == pytest.approx((closed.mean + closed.deviation_standard_deviation).max() / ARCSEC)
    assert found.closed.plot(kind="envelope").get_ylabel() == "transmission error, arcsec"


def test_the_histogram_is_a_share_and_marks_the_limit(found: ErrorBudget) -> None:
    limit = float(np.quantile(found.units.peak_to_peak, 0.8))
    for ax in (found.plot(kind="distribution", limit=limit), found.units.plot(limit=limit)):
        area = sum(bar.get_width() * bar.get_height() for bar in ax.patches)
        assert area == pytest.approx(1.0)
        (passing,) = [text for text in legend(ax) if text.startswith("limit")]
        assert float(passing.split(": ")[1].split(" %")[0]) == pytest.approx(80, abs=0.1)
        assert line(ax, passing)[0][0] == pytest.approx(limit / ARCSEC)


def test_widths_are_drawn_over_what_they_were(least: tuple[Allocation, tuple[FrontPoint, ...]]) -> None:
    found, _ = least
    ax = found.plot()
    ratio = dict(zip(found.labels, np.divide(found.widths, found.widths_before), strict=True))
    words = [tick.get_text() for tick in ax.get_yticklabels()]
    drawn = {words[int(y)]: x for label in ("free", "fixed") for x, y in zip(*line(ax, label), strict=True)}
    assert drawn == pytest.approx(ratio)
    assert [words[int(y)] for y in line(ax, "fixed")[1]] == ["coupling.carrier_bore_position"]
    assert line(ax, "fixed")[0] == pytest.approx([1.0])


def test_the_front_marks_the_allocation_and_what_cannot_be_met(
    least: tuple[Allocation, tuple[FrontPoint, ...]],
) -> None:
    found, front = least
    ax = found.plot(kind="front", front=front)
    x, y = line(ax, "least cost")
    assert x == pytest.approx([2, 40, 60])
    assert np.isnan(y[0])
    assert y[1] == pytest.approx(found.cost)
    assert y[2] < y[1]
    assert line(ax, "cannot be met: no cost")[0] == pytest.approx([2])
    assert [line(ax, "the limit asked for")[0][0], line(ax, "the limit asked for")[1][0]] == pytest.approx(
        [40, found.cost]
    )
    with pytest.raises(InputError, match=r"give front=, from cost_front"):
        found.plot(kind="front")
