"""A unit whose housing is the output goes through files, the bench and the loop as any other."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rverror
from rverror import effect
from rverror.base.errors import InputError

UNIT = rverror.reducer("RV-40E", output="housing")


def test_model_file_holds_it(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    rverror.save_model(path, rverror.Model(UNIT))
    assert 'output = "housing"' in path.read_text()
    assert rverror.load_model(path).mechanism == UNIT


def test_another_part_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_text('[reducer]\npreset = "RV-40E"\noutput = "sun"\n')
    with pytest.raises(InputError, match=r"3.*output = 'sun': must be one of 'carrier', 'housing'"):
        rverror.load_model(path)


def test_dynamics_refuse_it() -> None:
    with pytest.raises(InputError, match=r"output = 'housing'.*take output = 'carrier'"):
        rverror.dynamics.modes(rverror.Model(UNIT))


def test_input_turns_against_the_housing() -> None:
    run = rverror.simulate(rverror.Model(UNIT), points=256)
    slope = np.polyfit(run.output_angle, run.input_angle, 1)[0]
    assert slope == pytest.approx(-120, abs=1e-6)


def test_named_from_its_runs() -> None:
    """A disc's bore is named, with its size, and no other."""
    true = effect("cycloid.disc_bore_position", disc=0, crank=1, radial="9 um", tangential="-6 um")
    model = rverror.Model(UNIT)
    runs = rverror.runs.simulate_runs(
        model.with_effects(true),
        points=2048,
        revolutions=2,
        torques=["20 N*m"],
        method="equilibrium",
        noise="0.4 arcsec",
        seed=1,
    )
    found = rverror.diagnose(model, runs)
    assert found.verdict == "explained"
    (one,) = found.added
    assert (one.effect.key, one.effect.indices) == (true.key, true.indices)
