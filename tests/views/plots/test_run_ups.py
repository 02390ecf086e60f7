"""The plot of a run-up: its lines are the result's, and grey is where contacts would have to pull."""

from __future__ import annotations

import math

import numpy as np
import pytest

from drawn import legend, line
from rverror import ARCSEC, Model, reducer
from rverror.dynamics import RunUp, run_up
from rverror.model import Bench

MODEL = Model(reducer("RV-40E"), bench=Bench(load_inertia="20 kg*m^2"))


def braked(torque: str) -> RunUp:
    """From 300 rpm to rest in 0.05 s: 78 N*m and more of inertia at 20 kg*m^2."""
    speeds = np.array([300, 0, 0]) * math.pi / 30
    return run_up(MODEL, [0, 0.05, 0.2], speeds, torque=torque, samples=401)


def test_lines_are_those_of_the_result() -> None:
    found = braked("412 N*m")
    ax = found.plot()
    for label, row in {"error": found.transmission_error - found.crawl.mean(), "windup": found.windup}.items():
        time, drawn = line(ax, label)
        np.testing.assert_array_equal(time, found.time)
        np.testing.assert_allclose(drawn, row / ARCSEC, atol=1e-9)
    assert "contacts pull" not in legend(ax)
    assert ax.get_title() == "run-up from 300 rpm to 0 rpm, 412 N*m, forward"


def test_where_contacts_would_pull_is_grey() -> None:
    found = braked("50 N*m")
    ax = found.plot()
    assert "contacts pull" in legend(ax)
    (grey,) = ax.collections
    drawn = np.concatenate([path.vertices[:, 0] for path in grey.get_paths()])
    pulls = found.time[found.output_torque < 0]
    assert drawn.min() == pytest.approx(pulls.min(), abs=1e-3)
    assert drawn.max() == pytest.approx(pulls.max(), abs=1e-3)
