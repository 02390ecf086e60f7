"""The command `compensate`: tables, results for programs, and what it refuses in one line."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import rverror
from gear_runs import red
from recordings import bench, recording
from rverror.app.command_line import main

ARCSEC = np.pi / 648000
MODEL = "[drive]\nratio = 20.0\n[drive.shafts]\nmotor = 20.0\n"


def write_unit(folder: Path, *, size: float = 5.0, seeds: tuple[int, ...] = (1, 2), direction: str = "forward") -> None:
    (folder / "model.toml").write_text(MODEL)
    for seed in seeds:
        theta = 2 * np.pi * np.arange(768) / 256
        theta = theta if direction == "forward" else theta[::-1].copy()
        error = size * ARCSEC * np.cos(20 * theta) + red(seed, theta.size)
        run = rverror.run_from_arrays(input_angle=20 * theta, te=error, direction=direction, torque="20 N*m")
        rverror.runs.write_run(folder / f"{direction}{seed}.csv", run)


def test_a_table_and_results_with_a_run_that_no_fit_saw(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_unit(tmp_path)
    more = ["--json", "o.json", "--report", "o.html", "--plot", "o.png", "--save", "new.toml"]
    assert main(["compensate", "model.toml", "forward1.csv", "-o", "t.csv", "--validate", "forward2.csv", *more]) == 0
    told = json.loads(Path("o.json").read_text())
    (held,) = told["validation"]
    assert held["file"] == "forward2.csv"
    assert held["before"]["rms_arcsec"] == pytest.approx(5 / np.sqrt(2), rel=0.03)
    assert held["after"]["rms_arcsec"] < 0.35
    assert told["after"]["low"] < held["after"]["rms_arcsec"] < told["after"]["high"]
    lines = Path("t.csv").read_text().splitlines()
    assert told["table"]["points"] == sum(line[0].isdigit() for line in lines)
    assert "# reverse: not measured, so nothing is added" in lines
    assert told["table"]["expected_rms_arcsec"] >= told["after"]["heldout_rms_arcsec"]
    out = capsys.readouterr().out
    assert "no reverse run: nothing is corrected in that direction" in out
    assert "If the zero is off by 1 deg" in out
    page = Path("o.html").read_text()
    assert "<h2>Measurements that no fit saw</h2>" in page
    assert "<svg" in page
    assert {e.key for e in rverror.load_model("new.toml").effects} == {"compensation.wave"}


@pytest.mark.parametrize("form", ["json", "linuxcnc"])
def test_other_forms(form: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    write_unit(tmp_path)
    assert main(["compensate", "model.toml", "forward1.csv", "-o", "t", "--format", form]) == 0
    table = rverror.compensation.load_compensation("t", 20.0)
    run = rverror.load_run("forward2.csv", 20.0)
    from rverror.runs.order_table import TableCondition

    rest = run.error(20.0) + table.at(run.nominal_angle(20.0), TableCondition(direction=1.0))
    assert np.std(rest) < 0.4 * ARCSEC


def test_where_nothing_survives_nothing_is_written_and_it_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Done, with nothing to write: 0, no table, and a word of it for programs."""
    monkeypatch.chdir(tmp_path)
    write_unit(tmp_path, size=0.0)
    assert (
        main(["compensate", "model.toml", "forward1.csv", "-o", "t.csv", "--json", "o.json", "--save", "m.toml"]) == 0
    )
    assert not Path("t.csv").exists()
    assert not Path("m.toml").exists()
    told = json.loads(Path("o.json").read_text())
    assert (told["worth"], told["table"], told["variables"]["order"]["values"]) == (False, None, [])
    out, err = capsys.readouterr()
    assert "Nothing to compensate" in out
    assert "stands out of the noise by more than chance" in out
    assert "t.csv: not written, nothing survives on data left out" in err


def refused(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    assert main(["compensate", *arguments]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "Traceback" not in err
    return err


def test_bad_use_is_refused_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    write_unit(tmp_path)
    Path("old.csv").write_text("kept")
    assert "old.csv: this table exists; give another name, or --force to replace it" in refused(
        capsys, "model.toml", "forward1.csv", "-o", "old.csv"
    )
    assert Path("old.csv").read_text() == "kept"
    assert main(["compensate", "model.toml", "forward1.csv", "-o", "old.csv", "--force"]) == 0
    capsys.readouterr()
    Path("other.toml").write_text(MODEL.replace("20.0", "45.0"))
    Path("both.csv").write_text(
        "# direction: forward\ninput_angle[deg],output_angle[deg]\n"
        + "".join(f"{20 * a:.6f},{a:.8f}\n" for a in np.linspace(0, 720, 500))
    )
    assert "the run's ratio is about 20, the model's 45" in refused(capsys, "other.toml", "both.csv", "-o", "t")
    Path("counts.csv").write_text("input_angle[counts],te[arcsec]\n1,2\n2,3\n")
    assert "counts" in refused(capsys, "model.toml", "counts.csv", "-o", "t")
    Path("still.csv").write_text("input_angle[deg],te[arcsec]\n" + "5,1\n" * 40)
    refused(capsys, "model.toml", "still.csv", "-o", "t")
    Path("orders.csv").write_text("# kind: orders\norder,amplitude[arcsec],phase[deg]\n39,2,0\n")
    assert "direction" in refused(capsys, "model.toml", "orders.csv", "-o", "t")
    assert "given twice" in refused(capsys, "model.toml", "forward1.csv", "-o", "t", "--validate", "forward1.csv")
    assert "--format json" in refused(
        capsys, "model.toml", "forward1.csv", "-o", "t", "--torque", "1 N*m", "--torque", "2 N*m"
    )
    assert "output is also an input" in refused(capsys, "model.toml", "forward1.csv", "-o", "model.toml")


def test_the_reducer_of_ratio_81(tmp_path: Path) -> None:
    model = Path(__file__).parents[2] / "examples" / "rv-81" / "model.toml"
    cold, warm = (str(recording("rv-81to1", f"loads-100rpm-{at}degC.csv")) for at in (25, 30))
    arguments = [str(model), cold, "-o", str(tmp_path / "t.json"), "--format", "json", "--validate", warm]
    assert main(["compensate", *arguments, "--json", str(tmp_path / "o.json")]) == 0
    (held,) = json.loads((tmp_path / "o.json").read_text())["validation"]
    assert held["before"]["rms_arcsec"] > 43
    assert held["after"]["rms_arcsec"] < 1.5


def test_a_load_that_no_run_has_is_predicted_by_causes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Fitted at 5 and 200 N*m, held against 60: the causes are looked for, and what is between is no straight line."""
    unit = bench("real-11")
    fit = [str(unit / f"{way}_{load}Nm.csv") for way in ("forward", "reverse") for load in (5, 200)]
    unseen = [str(unit / f"{way}_60Nm.csv") for way in ("forward", "reverse")]
    arguments = [str(unit / "model.toml"), *fit, "-o", str(tmp_path / "t.csv"), "--validate", *unseen]
    assert main(["compensate", *arguments, "--json", str(tmp_path / "o.json")]) == 0
    assert "looking for causes" in capsys.readouterr().err
    for held in json.loads((tmp_path / "o.json").read_text())["validation"]:
        assert held["after"]["rms_arcsec"] < 0.55  # the noise has 0.49
    model = rverror.load_model(unit / "model.toml")
    runs, others = ([rverror.load_run(path, model) for path in paths] for paths in (fit, unseen))
    plain = rverror.compensate(rverror.Model(model.mechanism), runs, unseen=others)
    assert min(one.after for one in plain.unseen) > 1.5 * ARCSEC
