"""The benchmark of friction, pressure and uncertainty runs, and its results are those of what it sets them against."""

from __future__ import annotations

import re
import sys

import numpy as np
import pytest

import rverror
from pages import ROOT

sys.path.append(str(ROOT / "benchmarks"))

import friction_and_pressure as benchmark


def test_it_runs_and_says_every_ratio(capsys: pytest.CaptureFixture[str]) -> None:
    benchmark.main(["--angles", "8", "--repeats", "1"])
    head, *lines = capsys.readouterr().out.splitlines()
    assert "8 angles; best of 1 runs" in head
    pattern = r"rverror\.(?:\w+\.)*(\w+) +[\d.]+ ms, +([\d.e-]+) times (\w+)"
    found = {match[1]: (match[3], float(match[2])) for line in lines if (match := re.fullmatch(pattern, line))}
    assert {name: beside for name, (beside, _) in found.items()} == {
        "efficiency": "equilibrium",
        "contact_pressure": "equilibrium",
        "hysteresis": "torsion_curve",
        "bench_uncertainty": "diagnose",
    }
    assert all(ratio > 0 for _, ratio in found.values())


def test_what_is_timed_tells_something() -> None:
    """The friction costs power and holds the branches apart; the uncertainty is that of a stated bench."""
    model = benchmark.model_of(rverror.reducer("RV-40E"), 0.0)
    theta = np.linspace(0, 0.1, 4)
    passed = rverror.statics.efficiency(model, theta, torque=benchmark.TORQUE, friction=benchmark.RUBS, direction=1.0)
    assert 0.5 < passed.mean < 1
    assert benchmark.every_figure()[0] > 0
    assert benchmark.Cost("", "", 3.0, 2.0).ratio == 1.5
