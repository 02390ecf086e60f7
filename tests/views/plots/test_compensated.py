"""Plots of a compensation: what is drawn is what was left out, and what no fit saw is marked."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from every_kind import HOSTILE, compensation
from rverror import InputError
from rverror.compensation import Correction
from rverror.runs import OrderTable


def test_orders_before_and_after() -> None:
    ax = compensation().plot()
    before, left = ax.lines[:2]
    np.testing.assert_allclose(before.get_ydata(), [5, 2])
    np.testing.assert_allclose(left.get_ydata(), [0.25, np.nan])
    assert [label.get_text() for label in ax.get_xticklabels()] == ["1", "40"]
    assert "the largest 1 of 2" in compensation().plot(most=1).get_title()


def test_a_run_that_no_fit_saw_is_drawn_first_and_marked() -> None:
    ax = compensation().plot(kind="waveform")
    assert ax.get_title().replace("\n", " ") == f"{HOSTILE}, unseen.csv"
    assert "seen by no fit: 0 arcsec rms" in ax.lines[1].get_label()
    assert "3.54 arcsec rms" in ax.lines[0].get_label()
    fitted = compensation().plot(kind="waveform", run=0)
    assert "stretches left out" in fitted.lines[1].get_label()


def test_what_cannot_be_drawn_is_refused() -> None:
    made = compensation()
    for wrong, words, options in (
        (made, "most = 0", {"most": 0}),
        (made, "run = 2: must be 0 to 1", {"kind": "waveform", "run": 2}),
        (replace(made, traces=()), "no waveform", {"kind": "waveform"}),
        (replace(made, orders=(), correction=Correction(121.0, OrderTable(cases=()))), "no order to draw", {}),
    ):
        with pytest.raises(InputError, match=words):
            wrong.plot(**options)
