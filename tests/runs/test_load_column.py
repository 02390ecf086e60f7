"""A column of the output torque: read, kept, smoothed over the angle, or one size where it stays; an arm writes one."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import rverror
from rverror.app.command_line import main

MODEL = rverror.Model(rverror.reducer("RV-40E"), (rverror.effect("cycloid.pin_position", pin=3, radial="5 um"),))
ARM = rverror.geartrain.GravityArm(mass="20 kg", lever="0.5 m", offset="30 deg")
THETA = 2 * np.pi * np.arange(600) / 600


def run_of(torque: object, direction: float = 1.0) -> rverror.Run:
    theta = THETA if direction > 0 else THETA[::-1]
    return rverror.run_from_arrays(input_angle=121 * theta, output_angle=theta, direction=direction, torque=torque)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_an_arm_writes_its_weight_and_the_run_hands_it_on(direction: float, tmp_path: Path) -> None:
    run = rverror.simulate(MODEL, points=512, torque=ARM, method="equilibrium", direction=direction)
    rverror.runs.write_run(tmp_path / "run.csv", run)
    read = rverror.load_run(tmp_path / "run.csv")
    assert isinstance(read, rverror.Run)
    assert read.torque is None
    theta = read.nominal_angle(MODEL)
    where = read.conditions(MODEL)
    assert where.load is not None
    np.testing.assert_allclose(where.load, ARM(theta), atol=1e-3)
    np.testing.assert_allclose(
        read.error(MODEL), rverror.equilibrium(MODEL, where).transmission_error, atol=1e-4 * rverror.ARCSEC
    )


def test_the_equilibrium_sees_the_column_without_its_noise() -> None:
    """3 % of noise would be as much of the windup at every sample; three sizes of 600 samples hold a fourteenth."""
    noise = 0.03 * 98e3 * np.random.default_rng(1).normal(size=THETA.size)
    run = run_of(ARM(THETA) + noise)
    load = run.conditions(MODEL).load
    assert load is not None
    assert np.sqrt(np.mean((load - ARM(THETA)) ** 2)) < 3 * 0.03 * 98e3 * np.sqrt(3 / 600)
    np.testing.assert_array_equal(run.load_column, ARM(THETA) + noise)  # kept as read


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_column_that_stays_is_one_torque(sign: float) -> None:
    """Of a brake, whose sign is the sensor's; the noise is averaged before it is judged."""
    noise = np.random.default_rng(2).normal(size=THETA.size)
    run = run_of(sign * (20e3 + 400 * noise))
    assert run.torque == pytest.approx(20e3, rel=3e-3)
    assert run.load_column is None
    assert any("keeps to" in note for note in run.notes)
    assert run.conditions(MODEL).load is None


def test_a_sensor_without_a_load_is_no_load_that_changes() -> None:
    run = run_of(500 * np.random.default_rng(4).normal(size=THETA.size))
    assert run.load_column is None
    assert run.torque is not None
    assert run.torque < 100


def test_the_column_counts_before_the_header(tmp_path: Path) -> None:
    rows = "".join(f"{121 * a:.9f},{a:.9f},{20 + a:.3f}\n" for a in range(30))
    head = "# direction: forward\n# output_torque: 5 N*m\ninput_angle[deg],output_angle[deg],output_torque[N*m]\n"
    (tmp_path / "run.csv").write_text(head + rows)
    run = rverror.load_run(tmp_path / "run.csv")
    assert isinstance(run, rverror.Run)
    assert run.torque is None
    assert run.load_column is not None
    np.testing.assert_allclose(run.load_column, 1e3 * (20 + np.arange(30)), rtol=1e-12)
    assert any("the column counts" in note for note in run.notes)


def test_a_torque_makes_no_error_of_one_angle() -> None:
    with pytest.raises(rverror.InputError, match="transmission error cannot be told"):
        rverror.run_from_arrays(output_angle=THETA, torque=ARM(THETA))


def test_a_table_of_orders_has_one_torque() -> None:
    with pytest.raises(rverror.InputError, match="changes over the turn"):
        rverror.runs.order_table_from_runs([run_of(ARM(THETA))], MODEL, [40])


def test_the_command_writes_the_column(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    rverror.save_model("unit.toml", MODEL)
    words = ["simulate", "unit.toml", "--method", "equilibrium", "--points", "64", "-o", "out.csv"]
    assert main([*words, "--arm", "20 kg, 0.5 m, 30 deg"]) == 0
    run = rverror.load_run("out.csv")
    assert isinstance(run, rverror.Run)
    assert run.load_column is not None
    np.testing.assert_allclose(run.load_column, ARM(run.nominal_angle(MODEL)), atol=1e-6)


@pytest.mark.parametrize("arm", ["20 kg, 0.5 m", "20, 0.5 m, 30 deg", "20 kg, 0.5 m, 30 N", "0 kg, 0.5 m, 30 deg"])
def test_an_arm_that_is_not_told_is_refused(
    arm: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    rverror.save_model("unit.toml", MODEL)
    assert main(["simulate", "unit.toml", "--arm", arm, "--points", "64", "-o", "out.csv"]) == 2
    told = capsys.readouterr().err
    assert "--arm" in told
    assert told.count("\n") == 1


def test_a_bench_of_the_other_sign_says_so_in_its_mapping(tmp_path: Path) -> None:
    rows = "".join(f"{121 * a:.9f};{a:.9f};{-a:.3f}\n" for a in range(1, 31))
    (tmp_path / "bench.txt").write_text("An;Ab;M\n" + rows)
    columns = "".join(
        f'{key} = {{ name = "{name}", unit = "{unit}"{more} }}\n'
        for key, name, unit, more in (
            ("input_angle", "An", "deg", ""),
            ("output_angle", "Ab", "deg", ""),
            ("output_torque", "M", "kN*m", ", sign = -1"),
        )
    )
    (tmp_path / "map.toml").write_text(f"[columns]\n{columns}")
    run = rverror.load_run(tmp_path / "bench.txt", mapping=tmp_path / "map.toml")
    assert isinstance(run, rverror.Run)
    assert run.load_column is not None
    np.testing.assert_allclose(run.load_column, 1e6 * np.arange(1, 31), rtol=1e-12)
