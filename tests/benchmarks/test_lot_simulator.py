"""The simulator of lots: its poses are those of the exact bench, and its files say what was drawn."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rverror
from pages import ROOT

sys.path.append(str(ROOT))

from benchmarks.load_trial.parts import KINDS, Error, build
from benchmarks.load_trial.planar import train_of
from benchmarks.lot_trial import exact, make
from benchmarks.real_bench.simulator import Bench, Law, PartErrors, Reality, Springs, put_effect

ARCSEC = math.pi / 648000
UNIT: Any = rverror.load_model(make.MODEL).mechanism
TRAIN = train_of(UNIT)
SPRINGS = Springs(
    pin=TRAIN.k_pin, cam=TRAIN.k_cam, carrier=TRAIN.k_bore, mesh=TRAIN.k_mesh, sun=TRAIN.k_sun, main=TRAIN.k_main
)
#: Golden-ratio steps: irregular against every order, and the same each time.
ANGLES = 2 * np.pi * np.mod(0.05 + 0.6180339887 * np.arange(24), 1)
UM = 1e-3

#: Standard deviations, um, beside cams, bores, pins and pitch; and what a unit has beside its random errors.
UNITS: list[tuple[dict[str, float], list[Error]]] = [
    ({}, []),
    ({"cycloid.pin_radius": 2, "cycloid.disc_profile": 2}, []),
    (
        {"cycloid.pin_radius": 1},
        [
            Error("cycloid.disc_lobe", {"disc": 1, "lobe": 20}, (0.015,)),
            Error("cycloid.disc_pitch", {"disc": 0, "harmonic": 3}, (0.004, -0.003)),
            Error("coupling.carrier_bore_position", {"crank": 1}, (0.006, -0.004)),
            Error("crank.bearing_clearance", {}, (0.004,)),
        ],
    ),
    (
        {"involute.planet_eccentricity": 40, "involute.center_distance": 50},
        [
            Error("involute.sun_eccentricity", {}, (0.05, -0.03)),
            Error("involute.sun_offset", {}, (-0.04, 0.06)),
            Error("involute.sun_pitch", {"harmonic": 2}, (0.02, 0.03)),
            Error("involute.planet_pitch", {"crank": 1, "harmonic": 3}, (0.03, -0.02)),
            Error("involute.tooth_thinning", {"member": "sun"}, (0.01,)),
            Error("crank.index", {"crank": 0}, (1e-4,)),
        ],
    ),
]
#: Laws of pins and flanks by unit, and torques, N mm.
LAWS = [(exact.LINEAR, exact.LINEAR)] * 2 + [
    (exact.Law(10 / 9, 300.0), flanks) for flanks in (exact.LINEAR, exact.Law(1.2, 40.0))
]
TORQUES = [60e3, 60e3, 60e3, 200e3]


def drawn(number: int) -> list[Error]:
    rng, (more, errors) = np.random.default_rng(number), UNITS[number]
    deviations = {make.CAM: 3.0, make.BORE: 3.0, make.PIN: 3.0, make.PITCH: 2.5} | more
    return errors + [
        Error(key, at, tuple(rng.normal(size=len(KINDS[key].parameters)) * size * UM))
        for key, size in deviations.items()
        for at in places(key)
    ]


def places(key: str) -> Iterator[dict[str, int]]:
    return make.instances(key, TRAIN) if key in make.CLASSES else ({"crank": j} for j in range(TRAIN.cranks))


def by_the_bench(errors: list[Error], sense: int, torque: float, laws: tuple[exact.Law, exact.Law]) -> Any:
    put = PartErrors(UNIT)
    for key, indices, values in errors:
        put_effect(put, UNIT, key, dict(indices), dict(zip(KINDS[key].parameters, values, strict=True)))
    pins, flanks = (Law(**law._asdict()) for law in laws)
    reality = Reality(springs=SPRINGS, backlash=TRAIN.backlash, pin_law=pins, flank_law=flanks)
    return Bench(UNIT, ANGLES, put, reality, sense=sense, torque=torque).poses()[:, 2]


@pytest.mark.parametrize("sense", [1, -1])
@pytest.mark.parametrize("number", range(len(UNITS)))
def test_poses_are_those_of_the_exact_bench(number: int, sense: int) -> None:
    errors, laws, torque = drawn(number), LAWS[number], TORQUES[number]
    own = exact.solve(TRAIN, build(TRAIN, errors), ANGLES, sense * torque, *laws)
    assert own.settled.all()
    assert abs(own.output - by_the_bench(errors, sense, torque, laws)).max() < 0.003 * ARCSEC


def test_runs_are_the_pose_the_encoder_an_offset_and_noise(tmp_path: Path) -> None:
    make.main(["--seed", "10", "--out", str(tmp_path), "--units", "2"])
    truth = json.loads((tmp_path / "truth.json").read_text(encoding="utf-8"))
    model, plan = rverror.load_model(tmp_path / "model.toml"), make.draw_plan(10, "plain", 2)
    assert not model.effects
    train, errors = make.true_train(plan), make.simulate(10, units=2).errors[1]
    for name, at in make.STIFFNESS.items():
        stated = getattr(model.mechanism.stiffness, name)
        assert getattr(train, at) == pytest.approx(truth["stiffness_factors"][name] * stated)
    (encoder,) = (error.values for error in errors if error.key == make.ENCODER)
    reading = rverror.Model(UNIT, [rverror.effect(make.ENCODER, cos=encoder[0], sin=encoder[1])])
    unit = build(train, [error for error in errors if error.key != make.ENCODER])
    for direction, sense in (("forward", 1), ("reverse", -1)):
        run = rverror.load_run(tmp_path / "0001" / f"{direction}.csv")
        assert run.torque == 1e3 * truth["torque_Nm"]
        assert np.all(run.direction == sense)
        theta = run.nominal_angle(UNIT)
        own = exact.solve(train, unit, theta, sense * 1e3 * truth["torque_Nm"]).output
        left = (run.error(UNIT) - own - rverror.transmission_error(reading, theta)) / ARCSEC
        assert abs(left.mean()) < make.OFFSET
        assert left.std() == pytest.approx(truth["noise"]["rms_arcsec"], rel=0.15)
        again = np.corrcoef(left[1:], left[:-1])[0, 1]
        assert again == pytest.approx(truth["noise"]["memory"], abs=0.15)
        assert math.hypot(*encoder) > 5 * ARCSEC  # so that its sign counts


def test_the_noise_keeps_its_size() -> None:
    plan = make.draw_plan(10, "plain", 2)._replace(noise=0.3, memory=0.6)
    noise = np.array([make.draw_noise(plan, np.random.default_rng(n), 40) for n in range(2000)])
    np.testing.assert_allclose(noise.std(0), 0.3, rtol=0.08)
    assert np.mean(noise[:, 1:] * noise[:, :-1]) == pytest.approx(0.6 * 0.3**2, rel=0.05)


def test_errors_have_the_deviations_that_are_told() -> None:
    for seed in range(20):
        plan = make.draw_plan(seed, "plain", None)
        assert 60 <= plan.units <= 300
        assert 2 <= len(plan.deviations) <= 5
        units = [make.draw_errors(plan, serial, TRAIN) for serial in range(plan.units)]
        truth = make.truth_of(plan, {})
        for key in plan.deviations:
            values = np.array([error.values for errors in units for error in errors if error.key == key])
            name, size = make.name_of(key), ARCSEC if key == make.ENCODER else UM
            told = truth["sd_arcsec" if key == make.ENCODER else "sd_um"][name]
            assert make.CLASSES[key].least <= told <= make.CLASSES[key].most
            assert values.std() / size == pytest.approx(told, rel=4 / math.sqrt(2 * values.size))


def test_what_the_kinds_add() -> None:
    plain, machine, drift, sound = (make.simulate(3, kind, units=10) for kind in ("plain", "machine", "drift", "sound"))
    assert sorted(machine.labels["machine"]) == ["A"] * 5 + ["B"] * 5
    assert {name: set(labels) for name, labels in sound.labels.items()} == {"machine": set("AB"), "supplier": set("XY")}
    assert plain.labels == drift.labels == {}
    np.testing.assert_array_equal(plain.outputs, sound.outputs)
    assert len(machine.truth["spoilt"]) == 3
    for at, serial in enumerate(plain.serials):
        more = list(machine.errors[at][len(plain.errors[at]) :])
        if serial in machine.truth["spoilt"]:
            assert 0.03 <= math.hypot(*more.pop().values) <= 0.09
        told = machine.truth["shift"]
        moved = [(error.key, *error.indices.values(), sum(error.values)) for error in more]
        cam = [("crank.eccentricity", told["crank"], told["disc"], pytest.approx(told["um"] * UM))]
        assert moved == (cam if machine.labels["machine"][at] == "B" else [])
        assert 3 <= told["um"] <= 12
        gone = [error.values[0] for error in drift.errors[at][len(plain.errors[at]) :]]
        assert gone == pytest.approx([0.006 * (at - 5) / 4] if at >= 6 else [])
