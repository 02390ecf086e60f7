"""Order tables on the command line: simulate writes one, commands that need samples refuse it in one line."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from remedy import REMEDY
from rverror import Model, effect, reducer, save_model, transmission_error
from rverror.app.command_line import main
from rverror.base.units import ARCSEC
from rverror.reference.cases import pick
from rverror.runs import load_orders, simulate_runs

GEAR = Model(reducer("RV-40E"), (effect("cycloid.pin_circle", harmonic=2, radial_cos="5 um"),))


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    save_model(tmp_path / "gear.toml", GEAR)
    rows = "forward,40,2,30\n"
    (tmp_path / "orders.csv").write_text(f"# kind: orders\ndirection,order,amplitude[arcsec],phase[deg]\n{rows}")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_simulate_writes_one_table_of_all_conditions(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["simulate", "gear.toml", "--points", "512", "--orders", "2, 41,78", "--direction", "both"]
    arguments += ["--torque", "20 N*m", "--torque", "100 N*m", "--method", "equilibrium", "-o", "out.csv"]
    assert main(arguments) == 0
    assert capsys.readouterr() == ("", "rverror: wrote out.csv\n")
    assert {path.name for path in bench.iterdir()} == {"gear.toml", "orders.csv", "out.csv"}
    table = load_orders("out.csv")
    conditions = [(case.condition.direction, case.condition.torque) for case in table.cases]
    assert conditions == [(1.0, 20e3), (-1.0, 20e3), (1.0, 100e3), (-1.0, 100e3)]
    assert table.index == "simulated"
    assert table.metadata["simulated"] == "rverror, equilibrium; not a measurement"
    runs = simulate_runs(GEAR, torques=[20e3, 100e3], points=512, method="equilibrium")
    for case, run in zip(table.cases, runs, strict=True):
        assert case.orders.tolist() == [2, 41, 78]
        # over a whole turn of even samples a wave is the mean of what it is multiplied with
        theta, error = run.nominal_angle(GEAR), run.error(GEAR)
        expected = [2 * np.mean(error * np.exp(-1j * k * theta)) for k in (2, 41, 78)]
        np.testing.assert_allclose(case.waves, expected, atol=1e-9 * ARCSEC)


def test_without_a_file_the_table_is_printed(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "gear.toml", "--points", "512", "--orders", "78", "--direction", "both"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "# kind: orders"
    assert lines[-3] == "direction,order,amplitude[arcsec],phase[deg],sigma[arcsec]"
    theta = 2 * math.pi * np.arange(512) / 512
    for line, sense in zip(lines[-2:], (1.0, -1.0), strict=True):
        wave = 2 * np.mean(transmission_error(GEAR, theta, direction=sense) * np.exp(-78j * theta))
        assert line.split(",")[0] == ("forward" if sense > 0 else "reverse")
        assert float(line.split(",")[2]) == pytest.approx(abs(wave) / ARCSEC, abs=1e-9)


def test_what_is_replaced_is_said(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", "gear.toml", "--points", "512", "--orders", "78", "-o", "orders.csv"]) == 0
    assert capsys.readouterr().err == "rverror: replacing orders.csv\nrverror: wrote orders.csv\n"
    assert load_orders("orders.csv").cases[0].orders.tolist() == [78]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (
            ["simulate", "gear.toml", "--orders", "1,x"],
            "orders = ['1', 'x']: must be numbers, in waves per output turn",
        ),
        (["simulate", "gear.toml", "--orders", ""], "--orders: '' has no name"),
        (["simulate", "gear.toml", "--orders", "1,0"], "orders: 0 must be a number above 0"),
        (["simulate", "gear.toml", "--orders", "1,1"], "orders: 1 is asked for twice"),
        (["simulate", "gear.toml", "--points", "64", "--orders", "40"], "samples a wave, more than 2 are needed"),
        (["simulate", "gear.toml", "--orders", "1", "-o", "gear.toml"], "this output is also an input"),
        (["simulate", "gear.toml", "--orders", "1", "-o", "none/x.csv"], "there is no folder"),
        (["read", "orders.csv"], "orders.csv: an order table holds no samples"),
        (["read", "orders.csv", "--draft"], "orders.csv: an order table holds no samples"),
    ],
)
def test_refused_in_one_line(bench: Path, capsys: pytest.CaptureFixture[str], arguments: list[str], told: str) -> None:
    before = {path: path.read_bytes() for path in bench.iterdir()}
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert told in err
    assert REMEDY.search(err)
    assert {path: path.read_bytes() for path in bench.iterdir()} == before


def test_a_batch_refuses_the_unit(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    unit = bench / "units" / "one"
    unit.mkdir(parents=True)
    (bench / "orders.csv").rename(unit / "orders.csv")
    (bench / "gear.toml").rename(unit / "model.toml")
    assert main(["diagnose-batch", "units", "--out", "out", "--jobs", "1"]) == 2
    assert "orders.csv: an order table holds no samples" in capsys.readouterr().err


def test_a_comparison_refuses_it(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name = pick([])[0].name
    assert main(["reference-cases", "--case", name, "--out", "cases"]) == 0
    capsys.readouterr()
    assert main(["compare", "orders.csv", f"cases/{name}"]) == 2
    assert "orders.csv: an order table holds no samples" in capsys.readouterr().err
