"""The simulator of lives: its changes are those of rverror's equilibrium, its files and its judge are right."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rverror
from pages import ROOT

sys.path.append(str(ROOT))

from benchmarks.load_trial.parts import Error, build
from benchmarks.load_trial.planar import train_of
from benchmarks.lot_trial import exact, make as lots
from benchmarks.trend_trial import make
from benchmarks.trend_trial.judging import SEEABLE, beyond, compared

ARCSEC = math.pi / 648000
UNIT: Any = rverror.load_model(lots.MODEL).mechanism
TRAIN = train_of(UNIT)
ANGLES = make.THETA[::16] + 0.003


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("cause", make.CAUSES[:-1], ids=lambda cause: cause.key)
def test_a_small_change_is_that_of_the_equilibrium(cause: make.Cause, sense: int) -> None:
    values = (0.3e-3, 0.4e-3) if len(cause.parameters) == 2 else (cause.sign * 0.5e-3,)
    indices, torque = cause.indices[-1], sense * 412e3

    def own(errors: list[Error]) -> Any:
        return exact.solve(TRAIN, build(TRAIN, errors), ANGLES, torque).output

    def package(effects: list[Any]) -> Any:
        model = rverror.Model(UNIT, effects)
        return rverror.equilibrium(model, ANGLES, torque=412e3, direction=sense).transmission_error

    change = own([Error(cause.key, indices, values)]) - own([])
    sizes = dict(zip(cause.parameters, values, strict=True))
    expected = package([rverror.effect(cause.key, **indices, **sizes)]) - package([])
    # poses are exact in one and of the first order in the other: most where one pin of 40 goes in and out of contact
    assert np.linalg.norm(change - expected) < 0.05 * np.linalg.norm(expected)
    assert np.linalg.norm(expected) > 0.02 * ARCSEC * math.sqrt(ANGLES.size)


def test_files_of_a_sound_unit_are_its_errors_mounting_zero_and_noise(tmp_path: Path) -> None:
    unit = make.simulate(2, "sound", 3)
    make.write(unit, tmp_path)
    truth = json.loads((tmp_path / "truth.json").read_text(encoding="utf-8"))
    assert truth["change"] is None
    assert truth["remounted"]
    means = {}
    for session, hours in enumerate(truth["hours"]):
        for way, direction in enumerate(("forward", "reverse")):
            file = tmp_path / f"{session + 1:02d}-{direction}.csv"
            run = rverror.load_run(file)
            assert run.torque == 1e3 * truth["torque_Nm"]
            assert np.all(run.direction == 1 - 2 * way)
            assert run.index == f"S{session + 1:02d}"
            assert f"# hours: {hours:.1f}\n" in file.read_text(encoding="utf-8")
            error = (run.error(UNIT)[:: 1 - 2 * way] - unit.true[session, way]) / ARCSEC
            waves = np.fft.rfft(error) / error.size
            means[session, way] = waves[0].real, 2 * abs(waves[1])
            left = error - waves[0].real - 2 * (waves[1] * np.exp(1j * make.THETA)).real
            assert left.std() == pytest.approx(truth["noise"]["rms_arcsec"], rel=0.15)
        assert means[session, 0] == pytest.approx(means[session, 1], abs=0.2)  # zero and mounting of both ways are one
    assert np.ptp([size for _, size in means.values()]) > 0.5
    assert beyond(unit, 3) == pytest.approx(0, abs=1e-9)


def test_a_change_is_beyond_the_noise_by_what_it_adds() -> None:
    sound, jump = (make.simulate(4, kind, 20) for kind in ("sound", "jump"))
    np.testing.assert_array_equal(sound.true[0], jump.true[0])
    low, high = jump.truth["change"]["between"]
    after = jump.hours >= high
    np.testing.assert_array_equal(after, jump.hours > low)
    assert beyond(jump, int(np.sum(~after))) == pytest.approx(0, abs=1e-9)
    assert beyond(jump, 20) > SEEABLE
    # white noise, no zero and no mounting of its own: the variance between sessions, by hand
    white = jump.plan._replace(memory=0.0)
    alone = make.Life(
        jump.hours, jump.labels, jump.true, jump.outputs, white, {"shared_zero": True, "remounted": False}
    )
    step = (jump.true[-1] - jump.true[0]) / ARCSEC
    share = after.mean() * (1 - after.mean()) * 20
    assert beyond(alone, 20) == pytest.approx(share * np.sum(step**2) / white.noise**2, rel=1e-6)


def entry(**more: Any) -> dict[str, Any]:
    return {"key": "crank.eccentricity", "indices": {"crank": 0, "disc": 1}, "parameter": "radial"} | more


def test_the_judge() -> None:
    truth = make.simulate(1, "sound", 2).truth | {"remounted": False}
    right = entry(interval=[0.01, 0.03])
    change = {"key": right["key"], "indices": right["indices"], "course": "linear", "since": 0.0}
    change |= {"sizes": {"radial": 20.0, "tangential": 0.0}, "rate_per_hour": {"radial": 0.02, "tangential": 0.0}}
    told = compared({"growing": [right], "jumps": []}, truth | {"change": change})
    assert (told["named"], told["listed"], told["false"], told["held"]) == (True, True, [], {"mean": [1, 1]})
    rival = entry(indices={"crank": 0, "disc": 0}, interval=[0.01, 0.03], indistinguishable_from=[right])
    told = compared({"growing": [rival], "jumps": []}, truth | {"change": change})
    assert (told["named"], told["listed"], told["false"], told["rivals"]) == (False, True, [], 1)
    other = entry(key="cycloid.disc_pitch", interval=[0.01, 0.03])
    told = compared({"growing": [other], "jumps": [right]}, truth | {"change": change})
    assert (told["listed"], told["crossed"], told["false"]) == (False, True, ["cycloid.disc_pitch"])
    assert compared({"growing": [], "jumps": [other]}, truth)["false"] == ["cycloid.disc_pitch"]
