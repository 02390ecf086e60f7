"""The command that tells what processes made: what it prints and writes, and what it refuses."""

from __future__ import annotations

import json
from collections.abc import Callable
from importlib import resources
from pathlib import Path
from typing import Any

import pytest

import rverror
from every_kind import lot as lot_by_hand
from rverror.app import lot_command
from rverror.app.command_line import main

DEMO = resources.files("rverror") / "data" / "demo"


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What `lot` was called with; it answers with a lot made by hand."""
    got: dict[str, Any] = {}

    def answer(
        model: rverror.Model, units: Any, *, tolerances: Any, seed: int, progress: Callable[[str], None]
    ) -> rverror.Lot:
        got.update(model=model, units=units, tolerances=tolerances, seed=seed)
        progress("drawing units")
        return lot_by_hand()

    monkeypatch.setattr(lot_command, "lot", answer)
    return got


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("model.toml").write_text((DEMO / "model.toml").read_text("utf-8"), encoding="utf-8")
    for serial in ("u1", "u2", "u10"):
        Path("lot", serial).mkdir(parents=True)
        Path("lot", serial, "forward.csv").write_text((DEMO / "forward.csv").read_text("utf-8"), encoding="utf-8")
    Path("tolerances.toml").write_text('[[tolerance]]\nkey = "crank.eccentricity"\ntolerance = "5 um"\n', "utf-8")
    return tmp_path


def test_what_it_prints_and_writes(place: Path, asked: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    Path("lot/units.csv").write_text("serial,machine\nu10,A\nu1,B\ngone,B\n", encoding="utf-8")
    files = ["--json", "lot.json", "--html", "lot.html", "--csv", "lot.csv", "--save", "made.toml"]
    words = ["lot", "lot", "--model", "model.toml", "--tolerances", "tolerances.toml", "--seed", "3", "--progress"]
    assert main([*words, *files]) == 0
    assert [unit.serial for unit in asked["units"]] == ["u10", "u1", "u2"]
    assert asked["units"][0].labels == {"machine": "A"}
    assert (asked["seed"], len(asked["tolerances"])) == (3, 1)
    printed = capsys.readouterr().out
    assert printed.startswith("Lot: ")
    assert "left out: 1 unit in" in printed
    data = json.loads(Path("lot.json").read_text("utf-8"))
    assert (data["result"], data["units"]) == ("Lot", 40)
    names = [Path(one["path"]).as_posix() for one in data["inputs"]]
    assert names[:3] == ["model.toml", "tolerances.toml", "lot/units.csv"]
    assert len(names) == 6
    assert Path("lot.html").read_text("utf-8").startswith("<!doctype html>")
    assert Path("lot.csv").read_text("utf-8").count("\n") == 6
    assert len(rverror.load_tolerances("made.toml")) == 3


def test_nothing_above_zero_leaves_no_tolerance_file(
    place: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    nothing = rverror.Lot("unit", 3, (), (), (), (), {}, (), (), (), (), 0.5)
    monkeypatch.setattr(lot_command, "lot", lambda *_, **__: nothing)
    assert main(["lot", "lot", "--model", "model.toml", "--save", "made.toml"]) == 0
    assert "not written, no process is told from none" in capsys.readouterr().err
    assert not Path("made.toml").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none"], "none: cannot read the folder (No such file or directory)"),
        ([" "], "FOLDER: ' ' has no name"),
        (["lot", "--seed", "-1"], "--seed: -1 is below 0"),
        (["lot", "--json", "model.toml"], "model.toml: this output is also an input"),
        (["lot", "--json", "a", "--csv", "a"], "a: two outputs share this name"),
        (["lot", "--csv", "lot/u1/forward.csv"], "this output is also an input"),
        (["lot", "--csv", "lot/units.csv"], "lot/units.csv: this output is also an input"),
        (["lot", "--csv", "lot/u1/made.csv"], "it would lie in the folder of unit u1"),
        (["lot", "--tolerances", "none.toml"], "none.toml: there is no such file"),
        (["lot", "--save", "none/made.toml"], "there is no folder"),
    ],
)
def test_what_is_refused_in_one_line(
    place: Path, asked: dict[str, Any], words: list[str], said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["lot", *words, "--model", "model.toml"]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert asked == {}
