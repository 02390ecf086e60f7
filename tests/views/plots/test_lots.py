"""Plots of a lot: what is drawn is what the lot tells, in the units of people."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drawn import legend, line
from every_kind import lot
from rverror import InputError


def test_processes_stand_beside_what_their_tolerances_allow() -> None:
    """Cp is 1.25 for cams of 2 um: 2.5 um would fit."""
    ax = lot().plot()
    value, row = line(ax, "significantly above zero")
    np.testing.assert_allclose(value, [1.0, 4.0, 2.0])
    np.testing.assert_allclose(row, [1, 2, 3])
    np.testing.assert_allclose(np.array(line(ax, "allowed by the tolerance, Cp = 1"))[:, 3], [2.5, 3])
    np.testing.assert_allclose(line(ax, "not significant"), [[1.0], [0]])
    ends = np.array([segment[:, 0] for c in ax.collections for segment in c.get_segments()])
    np.testing.assert_allclose(sorted(map(tuple, ends)), [(0.8, 1.3), (0.8, 1.3), (1.6, 2.6), (3.2, 5.2)])
    names = [label.get_text() for label in ax.get_yticklabels()]
    assert names[2:] == ["crank.index, arcsec", "crank.eccentricity, um"]
    assert ax.get_xlabel() == "standard deviation, um or arcsec"


def test_one_unit_stands_on_the_axis_alone() -> None:
    whole = lot()
    ax = replace(whole, processes=tuple(one for one in whole.processes if one.dimension == "length")).plot()
    assert ax.get_xlabel() == "standard deviation, um"
    assert ax.get_yticklabels()[-1].get_text() == "crank.eccentricity"


def test_shares_are_of_all_processes_that_show() -> None:
    ax = lot().plot(kind="shares")
    assert sorted(bar.get_width() for bar in ax.patches) == pytest.approx([0, 5, 20, 75])
    assert legend(ax) == ["significantly above zero", "not significant"]


def test_orders_are_those_of_a_condition() -> None:
    ax = lot().plot(kind="orders", run=1)
    assert [bar.get_height() for bar in ax.patches] == pytest.approx([3.5, 1.5, 2.5, 3.0, 1.25, 2.0])
    assert [label.get_text() for label in ax.get_xticklabels()] == ["1", "39", "40"]
    assert "reverse at 20 N*m" in ax.get_title()


def test_units_to_come_stand_beside_those_measured() -> None:
    ax = lot().plot(kind="predicted")
    np.testing.assert_allclose(line(ax, "units to come, 95 % stay below; with 95 % interval")[0], [54, 50])
    np.testing.assert_allclose(line(ax, "measured, mean")[0], [33, 31])


def test_what_cannot_be_drawn_is_refused() -> None:
    whole = lot()
    silent = replace(whole, processes=whole.processes[-1:])
    for wrong, words, options in (
        (silent, "no process shows", {}),
        (silent, "no process shows", {"kind": "shares"}),
        (whole, "run = 2: must be 0 to 1", {"kind": "orders", "run": 2}),
        (replace(whole, orders=np.empty(0)), "no orders to draw", {"kind": "orders"}),
        (replace(whole, predicted=()), "predicts nothing", {"kind": "predicted"}),
    ):
        with pytest.raises(InputError, match=words):
            wrong.plot(**options)
