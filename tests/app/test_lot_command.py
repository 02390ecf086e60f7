"""The command that tells what processes made: what it prints and writes, and what it refuses."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import pytest

import rverror
from every_kind import lot as lot_by_hand
from rverror.app import lot_command
from rverror.app.command_line import main
from rverror.lots.amplitudes import Amplitudes

DEMO = resources.files("rverror") / "data" / "demo"


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """What `lot` was called with; it answers with a lot made by hand."""
    got: dict[str, Any] = {}

    def answer(
        model: rverror.Model, units: Amplitudes, *, tolerances: Any, seed: int, progress: Callable[[str], None]
    ) -> rverror.lots.Lot:
        got.update(model=model, units=units, tolerances=tolerances, seed=seed)
        progress("drawing units")
        return replace(lot_by_hand(), notes=(*units.notes, *lot_by_hand().notes))

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
    words = ["lot", "lot", "--model", "model.toml", "--tolerances", "tolerances.toml", "--seed", "3"]
    assert main([*words, *files]) == 0
    assert asked["units"].serials == ("u10", "u1", "u2")
    assert asked["units"].labels == {"machine": ("A", "B", "")}
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
    nothing = rverror.lots.Lot("unit", 3, (), (), (), (), {}, (), (), (), (), 0.5)
    monkeypatch.setattr(lot_command, "lot", lambda *_, **__: nothing)
    assert main(["lot", "lot", "--model", "model.toml", "--save", "made.toml"]) == 0
    assert "not written, no process has a significant scatter" in capsys.readouterr().err
    assert not Path("made.toml").exists()


def test_runs_are_compressed_and_told_of_later(
    place: Path, asked: dict[str, Any], capsys: pytest.CaptureFixture[str]
) -> None:
    """Of a part of the lot, beside a folder with the rest of it."""
    Path("lot/units.csv").write_text("serial\nu10\nu1\ngone\n", encoding="utf-8")
    compress = ["lot", "lot", "--model", "model.toml", "--compress", "march.jsonl"]
    for replacing in ("", "rverror: replacing march.jsonl\n"):
        assert main(compress) == 0
        told = capsys.readouterr()
        assert told.out == "march.jsonl: 3 units, the runs of 3 read now\n"
        assert told.err.startswith(f"{replacing}rverror: left out: 1 unit in ")
    assert asked == {}
    Path("lot").rename("april")
    for serial in ("u1", "u2", "u10"):
        Path("april", serial).rename(Path("april", f"{serial}b"))
    assert main(["lot", "march.jsonl", "april", "--model", "model.toml", "--json", "lot.json"]) == 0
    assert asked["units"].serials == ("u10", "u1", "u2", "u1b", "u2b", "u10b")
    assert "left out: 1 unit in " in capsys.readouterr().out
    names = [Path(one["path"]).as_posix() for one in json.loads(Path("lot.json").read_text("utf-8"))["inputs"]]
    assert names[:4] == ["model.toml", "march.jsonl", "april/units.csv", "april/u1b/forward.csv"]
    assert main(["lot", "march.jsonl", "--model", "model.toml", "--compress", "march.jsonl"]) == 2
    assert "march.jsonl: this output is also an input" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none"], "none: cannot read the folder (No such file or directory)"),
        ([" "], "parts: ' ' has no name"),
        (["lot", "--seed", "-1"], "--seed: -1 is below 0"),
        (["lot", "--json", "model.toml"], "model.toml: this output is also an input"),
        (["lot", "--json", "a", "--csv", "a"], "a: two outputs are this file"),
        (["lot", "--csv", "lot/u1/forward.csv"], "this output is also an input"),
        (["lot", "--csv", "lot/units.csv"], "lot/units.csv: this output is also an input"),
        (["lot", "--csv", "lot/u1/made.csv"], "it would lie in the folder of unit u1"),
        (["lot", "--tolerances", "none.toml"], "none.toml: there is no such file"),
        (["lot", "--save", "none/made.toml"], "there is no folder"),
        (["lot", "--jobs", "0"], "--jobs: 0 is below 1; give 1 or more"),
        (["lot", "--compress", "a.jsonl", "--csv", "a.csv"], "--compress estimates no process"),
        (["lot", "--compress", "lot/u1/a.jsonl"], "it would lie in the folder of unit u1"),
        (["lot", "--compress", "model.toml"], "model.toml: this output is also an input"),
        (["lot", "lot"], "lot: 3 serials (u1, u2, u10) that lot has too"),
        (["none.jsonl"], "none.jsonl: cannot read the folder (No such file or directory)"),
        (["model.toml"], "model.toml: no compressed lot that this rverror reads"),
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
