"""The command line: exit codes, one line for wrong input, nothing half-written, and what each command gives."""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
import pytest

import rverror
from diagnosed_example import DEMO, Outcome, outcome, strict_json
from remedy import REMEDY
from rverror import (
    CATALOGUE,
    Drive,
    Model,
    diagnose,
    effect,
    load_model,
    load_run,
    reducer,
    save_model,
    simulate,
    transmission_error,
)
from rverror.app import command_line as cli, diagnosis_commands, model_commands
from rverror.app.terminal import ProgressLine
from rverror.base.spreadsheet import table_rows
from rverror.base.units import ARCSEC, DISPLAY_UNITS
from rverror.diagnosis.policy import POLICY
from rverror.runs import write_run
from rverror.runs.measurement import run_text
from rverror.runs.virtual_bench import run_label, simulate_runs
from rverror.statics import energy
from rverror.statics.loaded_state import NotConvergedError

WORM = Drive(ratio=-14.0, shafts={"motor": 14.0, "idler": 3.5})
MOTOR = effect("shaft.eccentricity", shaft="motor", harmonic=1, cos="30 arcsec", sin="-10 arcsec")
IDLER = effect("shaft.eccentricity", shaft="idler", harmonic=1, cos="12 arcsec", sin="7 arcsec")
GEAR = Model(reducer("RV-40E"), (effect("crank.eccentricity", crank=0, disc=0, radial="5 um"),))

COLUMNS = "input_angle[deg],output_angle[deg]\n"
WORM_RUN = run_text(simulate(Model(WORM, (MOTOR, IDLER)), points=64, revolutions=4))
WORM_BACK = run_text(simulate(Model(WORM, (MOTOR, IDLER)), points=64, revolutions=4, direction=-1.0))
HEAD, _, ROWS = WORM_RUN.partition(COLUMNS)
LINES = ROWS.splitlines()


def run_file(*, head: str = HEAD, columns: str = COLUMNS, lines: list[str] = LINES) -> str:
    return head + columns + "\n".join(lines) + "\n"


def broken(share: float) -> list[str]:
    """Rows of which that share holds no number."""
    bad = round(1 / share)
    return [line if i % bad else line.split(",")[0] + ",n/a" for i, line in enumerate(LINES)]


@pytest.fixture
def bench(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Folder of good files, entered, so that messages name files as they were given."""
    save_model(tmp_path / "worm.toml", Model(WORM, (MOTOR,), "Prüfstand"))
    save_model(tmp_path / "gear.toml", GEAR)
    (tmp_path / "run.csv").write_text(WORM_RUN, encoding="utf-8")
    (tmp_path / "back.csv").write_text(WORM_BACK, encoding="utf-8")
    (tmp_path / "folder").mkdir()
    monkeypatch.chdir(tmp_path)
    return tmp_path


def content(folder: Path) -> dict[str, bytes | None]:
    """Every file of a folder with its bytes."""
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else None for p in sorted(folder.rglob("*"))}


def call(*arguments: str) -> int:
    """Exit code, whether returned or raised by argparse."""
    try:
        return cli.main(list(arguments))
    except SystemExit as stop:
        return int(stop.code or 0)


def refused(folder: Path, capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...]) -> str:
    """Check all that a refusal must be, and give its line."""
    before = content(folder)
    capsys.readouterr()
    assert call(*arguments) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "Traceback" not in err
    assert err.endswith("\n")
    assert err.count("\n") == 1
    assert REMEDY.search(err), err
    assert content(folder) == before
    return err


# --- wrong input ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Wrong:
    """Wrong input: arguments, the words that the line must hold, files to put in place before."""

    arguments: str
    words: tuple[str, ...]
    files: dict[str, str | bytes] = field(default_factory=dict)
    more: tuple[str, ...] = ()  # arguments that hold spaces

    def __str__(self) -> str:
        return " ".join([*self.arguments.split(), *(ascii(m) for m in self.more)])


def model(text: str) -> dict[str, str | bytes]:
    return {"m.toml": text}


def measured(text: str | bytes) -> dict[str, str | bytes]:
    return {"r.csv": text}


RV = '[reducer]\npreset = "RV-40E"\n'
ARGUMENTS = [
    Wrong("", ("COMMAND",)),
    Wrong("predict gear.toml", ("'predict'", "simulate", "diagnose")),
    Wrong("simulate", ("MODEL.toml",)),
    Wrong("simulate gear.toml --point", ("--point",)),
    Wrong("simulate gear.toml --colour red", ("--colour",)),
    Wrong("simulate gear.toml run.csv", ("run.csv",)),
    Wrong("diagnose", ("MODEL.toml", "RUN.csv")),
    Wrong("diagnose worm.toml", ("RUN.csv",)),
    Wrong("diagnose worm.toml run.csv --json", ("--json",)),
    Wrong("sources --format json", ("--format",)),
    Wrong("sources gear.toml", ("gear.toml",)),
]
NUMBERS = [
    Wrong("simulate gear.toml --points 0", ("points = 0", "16")),
    Wrong("simulate gear.toml --points -4096", ("points = -4096", "16")),
    Wrong("simulate gear.toml --points 15", ("points = 15", "16")),
    Wrong("simulate gear.toml --points many", ("--points", "'many'")),
    Wrong("simulate gear.toml --points 4096.5", ("--points", "'4096.5'")),
    Wrong("simulate gear.toml --points nan", ("--points", "'nan'")),
    Wrong("simulate gear.toml --revolutions 0", ("revolutions = 0", "1")),
    Wrong("simulate gear.toml --revolutions -1", ("revolutions = -1", "1")),
    Wrong("simulate gear.toml --revolutions two", ("--revolutions", "'two'")),
    Wrong("simulate gear.toml --revolutions 1000000000000", ("revolutions", "5000000")),
    Wrong("simulate gear.toml --points 100000000000000000000", ("points", "5000000")),
    Wrong("simulate gear.toml --torque 20", ("--torque", "'20'", "N*m")),
    Wrong("simulate gear.toml --torque", ("--torque", "'kg'", "N*m"), more=("20 kg",)),
    Wrong("simulate gear.toml --torque", ("torque = -5 N*m", "must be from 0 N*m to"), more=("-5 N*m",)),
    Wrong("simulate gear.toml --torque", ("torque = 0 N*m", "above 0"), more=("0 N*m",)),
    Wrong("simulate gear.toml --torque", ("--torque", "twenty"), more=("twenty N*m",)),
    Wrong("simulate gear.toml --torque", ("--torque", "nan"), more=("nan N*m",)),
    Wrong("simulate gear.toml --torque", ("--torque", "1e400"), more=("1e400 N*m",)),
    Wrong("simulate gear.toml --torque", ("torque = 1e+200 N*m", "must be from 0 N*m to"), more=("1e200 N*m",)),
    Wrong("simulate gear.toml --torque", ("--torque", "'N*'"), more=("20 N*",)),
    Wrong("simulate gear.toml --torque", ("--torque", "''"), more=("",)),
    Wrong("simulate gear.toml --method exact", ("--method", "'exact'", "equilibrium")),
    Wrong("simulate gear.toml --direction mixed", ("--direction", "'mixed'", "reverse", "both")),
    Wrong("simulate gear.toml --direction both", ("2 runs (forward, reverse)", "-o OUT.csv")),
    Wrong("simulate gear.toml --torque 1N*m --torque 2N*m", ("2 runs (forward-1Nm, forward-2Nm)", "-o OUT.csv")),
    Wrong("simulate gear.toml --torque 1N*m --torque 1000N*mm -o x.csv", ("--torque", "forward-1Nm", "twice")),
    Wrong("simulate gear.toml --torque 1N*m --torque -o x.csv", ("--torque",)),
    Wrong("simulate gear.toml -o x.csv --torque 1N*m --torque", ("torque = -5 N*m", "from 0 N*m to"), more=("-5 N*m",)),
    Wrong("simulate gear.toml --noise 0.3", ("noise", "'0.3'", "no unit", "0.3 arcsec")),
    Wrong("simulate gear.toml --noise", ("noise", "'kg'", "arcsec"), more=("1 kg",)),
    Wrong("simulate gear.toml --noise", ("noise", "from 0 arcsec to 648000 arcsec"), more=("-1 arcsec",)),
    Wrong("simulate gear.toml --noise", ("noise", "1e400"), more=("1e400 arcsec",)),
    Wrong("simulate gear.toml --noise-correlation 2deg", ("correlation", "--noise '0.3 arcsec'")),
    Wrong("simulate gear.toml --noise 1arcsec --noise-correlation 2um", ("correlation", "'um'", "arcsec")),
    Wrong("simulate gear.toml --input-counts 0", ("input_counts = 0", "from 1 to")),
    Wrong("simulate gear.toml --output-counts -1", ("output_counts = -1", "from 1 to")),
    Wrong("simulate gear.toml --output-counts 1e6", ("--output-counts", "'1e6'")),
    Wrong("simulate gear.toml --seed -1", ("seed = -1", "from 0 to")),
    Wrong("simulate gear.toml --seed x", ("--seed", "'x'")),
    Wrong("simulate gear.toml --speed 10deg", ("speed", "'deg'", "rpm")),
    Wrong("simulate gear.toml --speed 10Hz", ("speed", "'Hz'", "rpm")),
    Wrong("simulate gear.toml --speed 0rpm", ("speed = 0 rpm", "must be")),
    Wrong("simulate gear.toml --method equilibrium", ("equilibrium", "torque")),
    Wrong("simulate worm.toml --method equilibrium --torque", ("equilibrium", "[drive]"), more=("20 N*m",)),
    Wrong("simulate m.toml", ("sensor.time_offset",),
          model(RV + '[[effect]]\nkey = "sensor.time_offset"\noffset = "1 ms"\n')),
]  # fmt: skip
MODELS = [
    Wrong("simulate none.toml", ("none.toml", "no such file")),
    Wrong("diagnose none.toml run.csv", ("none.toml", "no such file")),
    Wrong("simulate folder", ("folder", "give a file")),
    Wrong("simulate none/gear.toml", ("none/gear.toml",)),
    Wrong("simulate run.csv/gear.toml", ("run.csv/gear.toml",)),
    Wrong("simulate run.csv", ("run.csv", "line", "TOML")),
    Wrong("simulate m.toml", ("m.toml", "empty"), model("")),
    Wrong("simulate m.toml", ("m.toml", "line 1", "TOML"), model("[reducer\n")),
    Wrong("simulate m.toml", ("m.toml", "line 3", "module", "quotes"), model(RV + "module = 1.5 mm\n")),
    Wrong("simulate m.toml", ("m.toml", "line 2", "'RV-40F'", "RV-40E"), model('[reducer]\npreset = "RV-40F"\n')),
    Wrong("simulate m.toml", ("m.toml", "neither [reducer] nor [drive]"), model('name = "x"\n')),
    Wrong("simulate m.toml", ("m.toml", "line 3", "'pinns'", "'pins'"), model(RV + "pinns = 40\n")),
    Wrong("simulate m.toml", ("m.toml", "line 4", "'crank.excentricity'", "crank.eccentricity"),
          model(RV + '[[effect]]\nkey = "crank.excentricity"\ncrank = 0\ndisc = 0\nradial = "5 um"\n')),
    Wrong("simulate m.toml", ("m.toml", "line 5", "crank = 2"),
          model(RV + '[[effect]]\nkey = "crank.eccentricity"\ncrank = 2\ndisc = 0\nradial = "5 um"\n')),
    Wrong("simulate m.toml", ("m.toml", "line 5", "radial", "'kg'", "um"),
          model(RV + '[[effect]]\nkey = "coupling.carrier_bore_position"\nradial = "5 kg"\ncrank = 0\n')),
    Wrong("simulate m.toml", ("m.toml", "line 1", "0xfc", "UTF-8"), {"m.toml": b'name = "Pr\xfcfstand"\n'}),
    Wrong("simulate m.toml", ("m.toml", "UTF-16"), {"m.toml": RV.encode("utf-16")}),
    Wrong("simulate m.toml", ("m.toml", "zero bytes"), {"m.toml": RV.encode() + b"\0\0"}),
]  # fmt: skip
RUNS = [
    Wrong("diagnose worm.toml none.csv", ("none.csv", "no such file")),
    Wrong("diagnose worm.toml run.csv none.csv", ("none.csv", "no such file")),
    Wrong("diagnose worm.toml folder", ("folder", "give a file")),
    Wrong("diagnose worm.toml r.csv", ("r.csv", "empty"), measured("")),
    Wrong("diagnose worm.toml r.csv", ("r.csv", "52 of 256", "10 %"), measured(run_file(lines=broken(1 / 5)))),
    Wrong("diagnose worm.toml r.csv", ("r.csv", "line 3", "output_angle", "'furlong'"),
          measured(run_file(columns="input_angle[deg],output_angle[furlong]\n"))),
    Wrong("diagnose worm.toml r.csv", ("r.csv", "line 3", "input_angle", "no unit"),
          measured(run_file(columns="input_angle,output_angle[deg]\n"))),
    Wrong("diagnose worm.toml r.csv", ("r.csv", "line 3", "output_angle"),
          measured(run_file(columns="input_angle[deg],motor_angle[deg]\n"))),
    Wrong("diagnose worm.toml r.csv", ("r.csv", "line 13", "1 cell", "2 column"),
          measured(run_file(lines=[*LINES[:9], "12.5", *LINES[10:]]))),
    Wrong("diagnose worm.toml r.csv", ("r.csv", "line 100", "0xb0", "UTF-8"),
          measured(run_file(lines=[*LINES[:96], LINES[96] + "@", *LINES[97:]]).encode().replace(b"@", b"\xb0"))),
    Wrong("diagnose gear.toml run.csv", ("run.csv", "121", "-14", "ratio")),
    Wrong("diagnose m.toml run.csv", ("run.csv", "14", "sign"), model("[drive]\nratio = 14.0\n")),
    Wrong("diagnose m.toml run.csv", ("run.csv", "-140", "units"), model("[drive]\nratio = -140.0\n")),
    Wrong("diagnose worm.toml r.csv", ("r.csv", "usable samples", "16"), measured(run_file(lines=LINES[:9]))),
    Wrong("diagnose worm.toml r.csv", ("r.csv", "line 1", "reverse", "forward"),
          measured(run_file(head="# direction: reverse\n"))),
    Wrong("diagnose worm.toml r.csv", ("r.csv", "line 1", "'sideways'"),
          measured(run_file(head="# direction: sideways\n"))),
    Wrong("diagnose worm.toml r.csv", ("r.csv", "line 2", "'kg'"),
          measured(run_file(head="# direction: forward\n# output_torque: 20 kg\n"))),
    Wrong("diagnose worm.toml r.csv", ("r.csv", "index", "'unknown'", "align"),
          measured(run_file(head="# direction: forward\n# index: unknown\n"))),
    Wrong("diagnose worm.toml run.csv run.csv", ("run.csv", "twice")),
    Wrong("diagnose worm.toml run.csv back.csv ./run.csv", ("./run.csv", "twice")),
]  # fmt: skip
OUTPUTS = [
    *(
        Wrong(f"diagnose worm.toml run.csv {option} none/out", ("none/out", "no folder"))
        for option in ("--json", "--report", "--save", "--plot")
    ),
    *(
        Wrong(f"diagnose worm.toml run.csv {option} {name}", (name, "input", "another name"))
        for option in ("--json", "--report", "--save", "--plot")
        for name in ("worm.toml", "run.csv", "./run.csv", "folder/../run.csv")
    ),
    Wrong("diagnose worm.toml run.csv --json folder", ("folder", "give a file")),
    Wrong("diagnose worm.toml run.csv --json out --save out", ("out", "two outputs")),
    Wrong("diagnose worm.toml run.csv --report ./out --plot folder/../out", ("folder/../out", "two outputs")),
    Wrong("diagnose worm.toml run.csv --json", ("''", "no name"), more=("",)),
    Wrong("simulate gear.toml -o none/out.csv", ("none/out.csv", "no folder")),
    Wrong("simulate gear.toml -o run.csv/out.csv", ("run.csv/out.csv", "no folder")),
    Wrong("simulate gear.toml -o gear.toml", ("gear.toml", "input")),
    Wrong("simulate gear.toml -o ./gear.toml", ("./gear.toml", "input")),
    Wrong("simulate gear.toml -o folder", ("folder", "give a file")),
    Wrong("simulate gear.toml -o folder --direction both", ("folder", "give a file")),
    Wrong("simulate x-reverse.csv --direction both -o x.csv", ("x-reverse.csv", "input"), {"x-reverse.csv": RV}),
    Wrong("simulate gear.toml -o", ("''", "no name"), more=("",)),
    Wrong("simulate gear.toml -o", ("' '", "no name"), more=(" ",)),
    Wrong("sources --json none/out.json", ("none/out.json", "no folder")),
    Wrong("sources --json folder", ("folder", "give a file")),
    Wrong("demo --output run.csv", ("run.csv", "--output")),
    Wrong("demo --output run.csv/demo", ("run.csv/demo", "--output")),
    Wrong("diagnose worm.toml", ("\\n", "rename"), {"a\nb.csv": WORM_RUN}, more=("a\nb.csv",)),
    Wrong("diagnose worm.toml", ("\\udcff", "rename"), more=("a\udcff.csv",)),
]


@pytest.mark.parametrize("wrong", [*ARGUMENTS, *NUMBERS, *MODELS, *RUNS, *OUTPUTS], ids=str)
def test_wrong_input_is_refused_in_one_line(
    bench: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, wrong: Wrong
) -> None:
    for name, text in wrong.files.items():
        (bench / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    line = refused(bench, capsys, (*wrong.arguments.split(), *wrong.more))
    for word in wrong.words:
        assert word in line


@pytest.mark.parametrize("wrong", [*OUTPUTS, *RUNS], ids=str)
def test_wrong_input_is_found_before_the_work(
    bench: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, wrong: Wrong
) -> None:
    """A diagnosis takes long; no one should wait for it to learn that its result has nowhere to go."""
    if not any(word in wrong.words for word in ("one file per direction", "align", "at least 4")):
        monkeypatch.setattr(diagnosis_commands, "diagnose", unreachable)
        monkeypatch.setattr(model_commands, "simulate_runs", unreachable)
    for name, text in wrong.files.items():
        (bench / name).write_bytes(text if isinstance(text, bytes) else text.encode())
    refused(bench, capsys, (*wrong.arguments.split(), *wrong.more))


def unreachable(*_: Any, **__: Any) -> NoReturn:
    raise AssertionError("the work had begun")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with a name on this system")
def test_a_device_or_pipe_is_not_replaced_by_a_file(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    os.mkfifo(bench / "pipe")
    line = refused(bench, capsys, ("simulate", "gear.toml", "-o", "pipe"))
    assert "pipe" in line
    assert (bench / "pipe").is_fifo()


@pytest.mark.skipif(not hasattr(os, "symlink"), reason="no symbolic links on this system")
def test_an_input_is_recognised_behind_a_link(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (bench / "link").symlink_to("gear.toml")
    assert "link" in refused(bench, capsys, ("simulate", "gear.toml", "-o", "link"))
    assert "link" in refused(bench, capsys, ("diagnose", "gear.toml", "run.csv", "--save", "link"))


def test_a_folder_that_cannot_be_written_to_is_found_before_the_work(
    bench: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(diagnosis_commands, "diagnose", unreachable)
    monkeypatch.setattr(os, "access", lambda path, mode: not str(path).endswith("folder"))
    line = refused(bench, capsys, ("diagnose", "worm.toml", "run.csv", "--json", "folder/out.json"))
    assert "folder/out.json" in line
    assert "permission" in line


def test_pictures_without_matplotlib_are_refused_before_the_work(
    bench: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(diagnosis_commands, "diagnose", unreachable)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    line = refused(bench, capsys, ("diagnose", "worm.toml", "run.csv", "--plot", "out.png"))
    assert "matplotlib" in line
    assert "pip install 'rverror[plot]'" in line.replace("install it with", "use")


def test_a_workbook_is_written_or_refused_before_the_work(
    bench: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert call("diagnose", "worm.toml", "run.csv", "--xlsx", "out.xlsx") == 0
    capsys.readouterr()
    assert next(row[:2] for _, row in table_rows("out.xlsx")) == ["name", "value"]
    monkeypatch.setattr(diagnosis_commands, "diagnose", unreachable)
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    line = refused(bench, capsys, ("diagnose", "worm.toml", "run.csv", "--xlsx", "other.xlsx"))
    assert "other.xlsx: spreadsheets need openpyxl; install it with: pip install 'rverror[io]'" in line


@pytest.mark.parametrize("problem", [NotConvergedError("no equilibrium;\n raise the torque"), KeyboardInterrupt()])
def test_work_that_stops_leaves_nothing(
    bench: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, problem: BaseException
) -> None:
    def stop(*_: Any, **__: Any) -> NoReturn:
        raise problem

    monkeypatch.setattr(model_commands, "simulate_runs", stop)
    monkeypatch.setattr(diagnosis_commands, "diagnose", stop)
    before = content(bench)
    for arguments in (
        ("simulate", "gear.toml", "-o", "out.csv"),
        ("diagnose", "worm.toml", "run.csv", "--json", "out.json", "--save", "new.toml"),
    ):
        assert call(*arguments) == (130 if isinstance(problem, KeyboardInterrupt) else 2)
        err = capsys.readouterr().err
        assert err.count("\n") == 1
        assert err.startswith("rverror: ")
        assert content(bench) == before


def test_an_equilibrium_that_is_not_reached_is_said(
    bench: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for limit in ("_MAX_STEPS", "_MAX_STEPS_NEAR", "_MAX_STEPS_UNLOADING"):
        monkeypatch.setattr(energy, limit, 0)
    arguments = ("simulate", "gear.toml", "--method", "equilibrium", "--torque", "20 N*m", "--points", "16")
    assert "no equilibrium" in refused(bench, capsys, arguments)


# --- the real process -------------------------------------------------------------------------------------------------


def process(*arguments: str, **keywords: Any) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, "-m", "rverror", *arguments]
    return subprocess.run(command, stderr=subprocess.PIPE, timeout=120, check=False, **keywords)


@pytest.mark.parametrize("arguments", [("simulate", "none.toml"), ("simulate", "--points", "many", "none.toml")])
def test_the_process_ends_with_2_and_one_line(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    done = process(*arguments, stdout=subprocess.PIPE, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stdout == b""
    assert done.stderr.startswith(b"rverror")
    assert done.stderr.count(b"\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_reader_that_leaves_early_is_no_error(tmp_path: Path) -> None:
    reading, writing = os.pipe()
    os.close(reading)
    try:
        done = process("sources", stdout=writing, cwd=tmp_path)
    finally:
        os.close(writing)
    assert (done.returncode, done.stderr) == (0, b"")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full on this system")
def test_a_full_disk_is_said(tmp_path: Path) -> None:
    with Path("/dev/full").open("wb") as full:
        done = process("sources", stdout=full, cwd=tmp_path)
    assert done.returncode == 2
    assert done.stderr.count(b"\n") == 1
    assert b"standard output" in done.stderr


# --- simulate, diagnose, sources --------------------------------------------------------------------------------------


def test_help_and_version_end_with_0(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("--version") == 0
    assert capsys.readouterr().out == f"rverror {rverror.__version__}\n"
    for command in ((), ("simulate",), ("diagnose",), ("sources",), ("demo",)):
        assert call(*command, "--help") == 0
        out, err = capsys.readouterr()
        assert out.startswith("usage: rverror")
        assert err == ""


@pytest.fixture(scope="module")
def parsers() -> dict[str, argparse.ArgumentParser]:
    """Parser of every command."""
    parser = cli.parser_of("")
    (action,) = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    return dict(action.choices)


def test_every_command_says_what_it_does_and_shows_an_example_that_is_read(
    parsers: dict[str, argparse.ArgumentParser],
) -> None:
    for name, parser in parsers.items():
        sentence = " ".join((parser.description or "").split())
        assert re.match(r"[A-Z].*\w\.$", sentence), name
        title, _, example = (parser.epilog or "").partition("\n")
        assert title == "example:", name
        program, *words = shlex.split(example.replace("\\\n", " "))
        assert (program, words[0]) == ("rverror", name)
        cli.parser_of(name).parse_args(words)  # an option that is none would exit
        assert "%%" not in parser.format_help(), name


def test_options_that_mean_one_thing_have_one_spelling(parsers: dict[str, argparse.ArgumentParser]) -> None:
    """Outputs, pages and JSON; the names that some commands had before are taken by all."""
    spellings = (("-o", "--output", "--out"), ("--html", "--report"), ("--json",), ("--plot",), ("--save",))
    for name, parser in parsers.items():
        of_one = [tuple(action.option_strings) for action in parser._actions]
        for words in spellings:
            assert all(one == words for one in of_one if set(one) & set(words)) or name == "diagnose-batch", (
                name,
                words,
            )
    batch = [tuple(action.option_strings) for action in parsers["diagnose-batch"]._actions]
    assert ("-o", "--output", "--out") in batch
    assert ("--pages", "--html") in batch  # a page of each unit: the folder has their names


def test_scripts_rely_on_these_options(capsys: pytest.CaptureFixture[str]) -> None:
    wanted = {
        "simulate": ("MODEL.toml", "--points N", "--revolutions N", "--torque", "--method {closed,equilibrium}",
                     "-o OUT.csv"),
        "diagnose": ("MODEL.toml", "RUN.csv [RUN.csv ...]", "--json OUT.json", "--report OUT.html", "--save NEW.toml"),
        "sources": ("--json OUT.json",),
        "demo": (),
    }  # fmt: skip
    for command, words in wanted.items():
        call(command, "--help")
        usage = " ".join(capsys.readouterr().out.split())
        for word in words:
            assert word in usage


@pytest.mark.parametrize(("method", "noted"), [("closed", True), ("equilibrium", False)])
def test_simulate_says_that_the_closed_form_knows_no_torque(
    bench: Path, capsys: pytest.CaptureFixture[str], method: str, noted: bool
) -> None:
    assert call("simulate", "gear.toml", "--points", "64", "--torque", "20 N*m", "--method", method) == 0
    assert ("give --method equilibrium" in capsys.readouterr().err) is noted


def test_simulate_writes_the_file_and_says_so(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("simulate", "gear.toml", "--points", "64", "-o", "out.csv") == 0
    out, err = capsys.readouterr()
    assert (out, err) == ("", "rverror: wrote out.csv\n")
    assert set(content(bench)) == {"worm.toml", "gear.toml", "run.csv", "back.csv", "folder", "out.csv"}
    assert load_run("out.csv", GEAR).error(GEAR) == pytest.approx(simulate(GEAR, points=64).error(GEAR), abs=1e-9)


def test_without_a_new_option_a_run_holds_what_it_always_held(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("simulate", "gear.toml", "--points", "64", "--torque", "20 N*m", "--direction", "reverse") == 0
    lines = capsys.readouterr().out.splitlines()
    head = ["# direction: reverse", "# output_torque: 20 N*m", "# simulated: rverror, closed; not a measurement"]
    assert lines[:4] == [*head, COLUMNS.strip()]
    theta = 2 * np.pi - 2 * np.pi * np.arange(64) / 64
    te = transmission_error(GEAR, theta, direction=-1.0)
    assert lines[4:] == [
        f"{a:.15g},{b:.15g}" for a, b in zip(np.rad2deg(theta * 121), np.rad2deg(theta + te), strict=True)
    ]


NOISY = ("--points", "64", "--noise", "0.3 arcsec", "--noise-correlation", "2 deg", "--output-counts", "1048576")


def test_several_runs_become_several_files(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ("simulate", "gear.toml", *NOISY, "--seed", "4", "--speed", "10 deg/s", "--torque", "20 N*m")
    both = (*arguments, "--torque", "2.5 N*m", "--direction", "both", "-o", "folder/b.enc.csv")
    before = set(content(bench))
    assert call(*both) == 0
    names = [f"b.enc-{sense}-{load}Nm.csv" for load in ("20", "2.5") for sense in ("forward", "reverse")]
    out, err = capsys.readouterr()
    assert [Path(line) for line in out.splitlines()] == [Path("folder") / name for name in names]
    assert err.splitlines()[0].endswith("for such a run give --method equilibrium")
    assert set(content(bench)) - before == {str(Path("folder") / name) for name in names}
    runs = {name: load_run(f"folder/{name}", GEAR) for name in names}
    for name, run in runs.items():
        assert run.notes == ()
        assert run.index == "simulated"
        assert run.torque == pytest.approx(20e3 if "-20Nm" in name else 2.5e3)
        assert (run.direction == (1.0 if "forward" in name else -1.0)).all()
        assert run.time is not None
        assert run.metadata["seed"] == "4"

    # same seed, same bytes; and a run does not know of the others but by the zero that it shares with them
    first = content(bench)
    assert call(*both) == 0
    assert content(bench) == first
    told = [f"rverror: {word} {Path('folder') / name}" for name in names for word in ("replacing", "wrote")]
    assert capsys.readouterr().err.splitlines()[1:] == told
    for sense in ("forward", "reverse"):
        assert call(*arguments, "--direction", sense) == 0
        joint = (bench / "folder" / f"b.enc-{sense}-20Nm.csv").read_text(encoding="utf-8")
        assert capsys.readouterr().out == joint.replace("# index: simulated\n", "")


def test_the_seed_decides_the_noise(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    printed = []
    for seed in ((), ("--seed", "0"), ("--seed", "1"), ("--seed", "1")):
        assert call("simulate", "gear.toml", *NOISY, *seed) == 0
        printed.append(capsys.readouterr().out)
    assert printed[0] == printed[1] != printed[2] == printed[3]
    assert "# seed: 0\n" in printed[0]
    assert "# noise: 0.3 arcsec\n# noise correlation: 2 deg\n" in printed[0]


@pytest.mark.skipif(not hasattr(os, "symlink"), reason="no symbolic links on this system")
def test_two_runs_are_not_written_into_one_file(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (bench / "x-forward.csv").write_text("old", encoding="utf-8")
    (bench / "x-reverse.csv").symlink_to("x-forward.csv")
    line = refused(bench, capsys, ("simulate", "gear.toml", "--direction", "both", "-o", "x.csv"))
    assert "x-reverse.csv" in line
    assert "link" in line


def test_what_is_replaced_is_said(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Overwriting is allowed on the command line, as other tools do, but never silent."""
    names = ["out.csv", "found.json", "page.html", "new.toml", "picture.png", "sources.json"]
    for name in names:
        (bench / name).write_text("old", encoding="utf-8")
    assert call("simulate", "worm.toml", "--points", "64", "-o", "out.csv") == 0
    arguments = ["diagnose", "worm.toml", "run.csv", "back.csv", "--json", "found.json", "--report", "page.html"]
    assert call(*arguments, "--save", "new.toml", "--plot", "picture.png") == 0
    assert call("sources", "--json", "sources.json") == 0
    err = capsys.readouterr().err
    for name in names:
        assert err.count(f"replacing {name}\n") == 1
        assert (bench / name).read_bytes() != b"old"
    assert "Traceback" not in err


def test_diagnose_of_a_drive_end_to_end(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Made of the declared motor and an idler of 12 and 7 arcsec that is not declared."""
    arguments = ["diagnose", "worm.toml", "run.csv", "back.csv", "--json", "found.json", "--save", "new.toml"]
    assert call(*arguments) == 0
    out = capsys.readouterr().out
    data = strict_json((bench / "found.json").read_text(encoding="utf-8"))
    (added,) = data["added"]
    assert (added["key"], added["indices"]) == ("shaft.eccentricity", {"shaft": "idler", "harmonic": 1})
    sizes = {name: estimate["value"] for name, estimate in added["parameters"].items()}
    assert sizes == pytest.approx({"cos": 12.0, "sin": 7.0}, abs=1e-4)
    assert "Prüfstand" in out
    new, old = load_model("new.toml"), load_model("worm.toml")
    assert new.effects[:-1] == old.effects
    assert new.name == old.name
    theta = np.linspace(0, 2 * np.pi, 50)
    whole = rverror.transmission_error(Model(WORM, (MOTOR, IDLER)), theta)
    assert rverror.transmission_error(new, theta) == pytest.approx(whole, abs=1e-10)
    # the new model explains the runs: nothing is missing any more
    assert call("diagnose", "new.toml", "run.csv", "back.csv", "--save", "same.toml") == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[1].startswith("Nothing missing: ")
    assert "nothing was added" in err
    assert (bench / "same.toml").read_bytes() == (bench / "new.toml").read_bytes()


def test_saving_says_that_declared_sizes_stay(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    uncertain = effect("shaft.eccentricity", uncertainty="2 arcsec", shaft="motor", harmonic=1, cos="31 arcsec")
    save_model(bench / "m.toml", Model(WORM, (uncertain,)))
    assert call("diagnose", "m.toml", "run.csv", "--save", "new.toml") == 0
    assert load_model("new.toml").effects[0] == load_model("m.toml").effects[0]
    progress = r"\[ *\d+ s\] "  # told on a busy machine
    (line,) = [line for line in capsys.readouterr().err.splitlines() if not re.match(progress, line)]
    assert "declared sizes stand as they were" in line


CAM = effect("crank.eccentricity", crank=0, disc=0, radial="6 um", tangential="-4 um", uncertainty="0.3 um")
ENCODER = effect("sensor.encoder_eccentricity", cos="5 arcsec", sin="-8 arcsec")
#: Gear's marks 20 deg ahead of the bench's zero; a cam is alike after a turn of the crank, 9 deg.
TURNED = Model(GEAR.mechanism, (CAM, ENCODER, effect("sensor.index_offset", offset="20 deg")))


def try_only(patch: pytest.MonkeyPatch, *keys: str) -> None:
    """Let the command try no other causes: which of all is found, the tests of the diagnosis say."""
    patch.setattr(diagnosis_commands, "diagnose", partial(diagnose, policy=replace(POLICY, keys=keys)))


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    """What a diagnosis of runs without the gear's zero saved, `new.toml` beside their files, and those of the runs."""
    folder, names = tmp_path_factory.mktemp("unmarked"), []
    save_model(folder / "m.toml", Model(GEAR.mechanism, (CAM,)))
    for run in simulate_runs(TURNED, points=256, revolutions=3, noise="0.5 arcsec", correlation="2 deg"):
        names.append(f"{run_label(run.direction[0], None)}.csv")
        write_run(folder / names[-1], replace(run, index="unknown"))
    with contextlib.chdir(folder), pytest.MonkeyPatch.context() as patch:
        try_only(patch, ENCODER.key, "sensor.encoder_ellipticity")
        assert call("diagnose", "m.toml", *names, "--save", "new.toml") == 0
    return folder, names


def test_saving_keeps_where_the_gears_marks_are(saved: tuple[Path, list[str]]) -> None:
    """An angle that was found is no missing effect, but without it the new model predicts another waveform."""
    folder, names = saved
    new = load_model(folder / "new.toml")
    assert [e.key for e in new.effects] == [CAM.key, "sensor.index_offset", ENCODER.key]
    assert new.effects[0] == load_model(folder / "m.toml").effects[0]
    assert np.degrees(new.index_offset) % 9 == pytest.approx(20 % 9, abs=0.3)
    assert "index unknown" in new.effects[1].origin
    assert all(name in new.effects[2].origin for name in names)
    theta = np.linspace(0, 2 * np.pi, 400)
    found, true = (transmission_error(m, theta, direction=1) for m in (new, TURNED))
    assert np.std(true) > 10 * ARCSEC
    assert np.std(found - true) < 0.5 * ARCSEC


def test_a_saved_model_knows_its_marks(
    saved: tuple[Path, list[str]], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The same runs again: nothing is missing, and the zero is where the model says, not in a second offset."""
    folder, names = saved
    monkeypatch.chdir(folder)
    try_only(monkeypatch, ENCODER.key, "sensor.encoder_ellipticity")
    assert call("diagnose", "new.toml", *names, "--json", "again.json", "--save", "same.toml") == 0
    out, err = capsys.readouterr()
    assert out.splitlines()[1].startswith("Nothing missing: ")
    again = strict_json(Path("again.json").read_text(encoding="utf-8"))
    assert again["before"]["rms_arcsec"] == pytest.approx(0.5, abs=0.1)
    assert "nothing was added" in err
    assert Path("same.toml").read_bytes() == Path("new.toml").read_bytes()


def test_saving_puts_what_was_found_after_what_was_declared(bench: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A reducer's drift and its encoder, one run of three turns each way; what was declared keeps its place."""
    declared = effect("sensor.ratio_error", slope="3 arcsec/turn")
    drift = effect("sensor.drift", total="20 arcsec")
    save_model(bench / "m.toml", Model(GEAR.mechanism, (declared, *GEAR.effects)))
    names = []
    for run in simulate_runs(
        Model(GEAR.mechanism, (declared, *GEAR.effects, ENCODER, drift)),
        points=256, revolutions=3, noise="0.5 arcsec", correlation="2 deg",
    ):  # fmt: skip
        names.append(f"{run_label(run.direction[0], None)}.csv")
        write_run(bench / names[-1], run)
    try_only(monkeypatch, "sensor.drift", ENCODER.key)
    assert call("diagnose", "m.toml", *names, "--save", "new.toml") == 0
    new = load_model("new.toml")
    assert new.effects[:2] == load_model("m.toml").effects
    found = {e.key: e for e in new.effects[2:]}
    assert sorted(found) == ["sensor.drift", ENCODER.key]
    assert found["sensor.drift"].values[0] == pytest.approx(20 * ARCSEC, abs=ARCSEC)
    assert all(name in e.origin for e in new.effects[2:] for name in names)


def test_a_console_of_few_characters_is_no_error(bench: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding="ascii"))
    assert call("diagnose", "worm.toml", "run.csv") == 0
    sys.stdout.flush()
    assert b"Diagnosis: Pr\\xfcfstand" in raw.getvalue()


def test_the_report_needs_no_matplotlib(bench: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert call("diagnose", "worm.toml", "run.csv", "--report", "page.html") == 0
    text = (bench / "page.html").read_text(encoding="utf-8")
    assert "<svg" not in text
    assert "pictures need matplotlib" in text
    assert "Prüfstand" in text


@pytest.mark.parametrize("name", ["r$_{$.csv", "测试 100%.csv", "<b>&.csv", "-.csv"])
def test_names_of_files_are_only_names(bench: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    """No formula, markup or option is read from a file name."""
    (bench / "run.csv").rename(bench / name)
    given = f"./{name}" if name.startswith("-") else name
    assert call("diagnose", "worm.toml", given, "--plot", "out.png", "--save", "new.toml", "--json", "o.json") == 0
    out, err = capsys.readouterr()
    assert name in out
    assert "Traceback" not in err
    assert "Warning" not in err
    assert name in load_model("new.toml").effects[-1].origin


def test_sources_lists_the_whole_catalogue(capsys: pytest.CaptureFixture[str]) -> None:
    assert call("sources") == 0
    out, err = capsys.readouterr()
    assert err == ""
    heads = [line for line in out.splitlines() if not line.startswith(" ")]
    assert heads == list(CATALOGUE)
    for entry in CATALOGUE.values():
        assert entry.reference in out
        assert entry.summary in out
        for parameter in entry.parameters:
            assert f"{parameter.name} [{DISPLAY_UNITS[parameter.dimension]}]" in out


def test_sources_as_json(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("sources", "--json", "sources.json") == 0
    assert capsys.readouterr().out == ""
    data = json.loads((bench / "sources.json").read_text(encoding="utf-8"))
    assert [item["key"] for item in data] == list(CATALOGUE)
    for item in data:
        entry = CATALOGUE[item["key"]]
        assert item["indices"] == [index.name for index in entry.indices]
        assert [p["name"] for p in item["parameters"]] == [p.name for p in entry.parameters]
        assert [p["unit"] for p in item["parameters"]] == [DISPLAY_UNITS[p.dimension] for p in entry.parameters]
        assert item["frame"]
        assert item["reference"]
    orders = {item["key"]: item["orders_rv40e"] for item in data}
    # orders and frames of the catalogue
    assert orders["crank.eccentricity"] == [40]
    assert orders["sensor.encoder_eccentricity"] == [1]
    assert orders["sensor.encoder_ellipticity"] == [2]
    assert orders["sensor.input_coupling"] == [121]
    assert orders["crank.index"] == []
    assert orders["coupling.carrier_bore_position"] == []


def test_two_threads_find_what_one_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """To the last digit, of every fourth sample of the example."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("NUMBA_NUM_THREADS", "2")
    (tmp_path / "model.toml").write_bytes((DEMO / "model.toml").read_bytes())
    for name in ("forward.csv", "reverse.csv"):
        head, columns, rows = (DEMO / name).read_text(encoding="utf-8").partition(COLUMNS)
        (tmp_path / name).write_text("\n".join([head + columns + rows.splitlines()[0], *rows.splitlines()[4::4], ""]))
    for jobs in ("1", "2"):
        assert call("diagnose", "model.toml", "forward.csv", "reverse.csv", "--json", jobs, "--jobs", jobs) == 0
    assert (tmp_path / "1").read_bytes() == (tmp_path / "2").read_bytes()
    assert strict_json((tmp_path / "2").read_text(encoding="utf-8"))["added"]


@pytest.mark.parametrize("jobs", ["0", "-1"])
def test_no_thread_does_no_work(bench: Path, jobs: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert call("diagnose", "model.toml", "forward.csv", "--jobs", jobs) == 2
    assert f"--jobs: {jobs} is below 1; give 1 or more" in capsys.readouterr().err


# --- the demo ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def found(tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    return outcome(tmp_path_factory.getbasetemp() / "diagnosis-of-the-example")


@pytest.fixture
def demo(bench: Path, found: Outcome, monkeypatch: pytest.MonkeyPatch) -> Callable[[], int]:
    """The demo with the diagnosis that the session has made already."""
    given: list[Any] = []

    def known(model: Model, runs: list[Any], **_: Any) -> Any:
        given[:] = [model, *runs]
        return found.diagnosis

    def run() -> int:
        code = call("demo", "--output", "new/demo")
        assert given[0] == found.diagnosis.declared
        assert [Path(r.path).name for r in given[1:]] == ["forward.csv", "reverse.csv"]
        return code

    monkeypatch.setattr(diagnosis_commands, "diagnose", known)
    return run


def test_the_demo_writes_the_example_and_its_results(
    bench: Path, found: Outcome, demo: Callable[[], int], capsys: pytest.CaptureFixture[str]
) -> None:
    before = content(bench)
    assert demo() == 0
    out, err = capsys.readouterr()
    assert err.count("\n") == 1
    assert "refits them within their uncertainty" in err
    folder = bench / "new" / "demo"
    names = {"model.toml", "forward.csv", "reverse.csv", "diagnosis.json", "model-with-cause.toml",
             "before-and-after.png"}  # fmt: skip
    assert {p.name for p in folder.iterdir()} == names
    assert {k: v for k, v in content(bench).items() if not k.startswith("new")} == before
    for name in ("model.toml", "forward.csv", "reverse.csv"):
        assert (folder / name).read_bytes() == (found.folder / name).read_bytes()
    written, expected = strict_json((folder / "diagnosis.json").read_text(encoding="utf-8")), found.json()
    assert [f["sha256"] for f in written.pop("files")] == [f["sha256"] for f in expected.pop("files")]
    assert written == expected
    assert load_model(folder / "model-with-cause.toml").effects[-1].key == "sensor.encoder_eccentricity"
    assert (folder / "before-and-after.png").read_bytes()[:4] == b"\x89PNG"
    for name in names:
        assert name in out
    assert "simulated" in out.splitlines()[0]
    assert "virtual" in (folder / "forward.csv").read_text(encoding="utf-8").splitlines()[0]
    assert found.out in out
    assert "import rverror" in out


def test_the_notebook_lines_of_the_demo_run(
    bench: Path, demo: Callable[[], int], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    demo()
    monkeypatch.setattr(rverror, "diagnose", diagnosis_commands.diagnose)
    code = [line[4:] for line in capsys.readouterr().out.partition("in a notebook:")[2].splitlines() if line]
    exec("\n".join(code), {})
    assert "\nExplained: the model lacks" in capsys.readouterr().out


def test_the_demo_says_what_it_replaces(
    bench: Path, demo: Callable[[], int], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert demo() == 0
    out = capsys.readouterr().out
    assert "No picture" in out
    assert not (bench / "new" / "demo" / "before-and-after.png").exists()
    assert demo() == 0
    told = [line for line in capsys.readouterr().err.splitlines() if line.startswith("rverror: replacing")]
    said = [Path(line.rpartition(" ")[2]).name for line in told]
    assert sorted(said) == sorted(
        ["model.toml", "forward.csv", "reverse.csv", "diagnosis.json", "model-with-cause.toml"]
    )


def test_progress_is_told_only_once_it_takes_long(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = [100.0]
    monkeypatch.setattr("rverror.app.terminal.time.monotonic", lambda: clock[0])
    with ProgressLine() as progress:
        for now, text in ((101.0, "early"), (102.5, "first"), (103.0, "too soon"), (105.0, "second")):
            clock[0] = now
            progress(text)
    assert capsys.readouterr().err == "[   2 s] first\n[   5 s] second\n"


def test_a_run_of_the_python_interface_is_diagnosed_alike(bench: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_run(bench / "own.csv", simulate(Model(WORM, (MOTOR, IDLER)), points=64, revolutions=4), overwrite=True)
    assert (bench / "own.csv").read_text(encoding="utf-8") == WORM_RUN
    assert call("diagnose", "worm.toml", "own.csv") == 0
    printed = capsys.readouterr().out
    result = rverror.diagnose(load_model("worm.toml"), [load_run("own.csv", WORM)])
    assert rverror.to_text(result) == printed


# --- what is loaded ---------------------------------------------------------------------------------------------------


def commands_of(parser: argparse.ArgumentParser) -> list[str]:
    (action,) = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    return list(action.choices)


def test_a_command_is_found_in_the_file_that_is_said_to_have_it() -> None:
    listed = [name for names in cli.COMMANDS.values() for name in names]
    assert sorted(commands_of(cli.parser_of("--help"))) == sorted(listed)
    for names in cli.COMMANDS.values():
        for name in names:
            assert sorted(commands_of(cli.parser_of(name))) == sorted(names)


def test_a_diagnosis_does_not_wait_for_other_results() -> None:
    """Making their classes takes a third of the time that the package takes to load."""
    code = (
        "import sys\n"
        "from rverror.app.command_line import main\n"
        "try: main(['diagnose', '--help'])\n"
        "except SystemExit: pass\n"
        "rooms = {name.split('.')[1] for name in sys.modules if name.startswith('rverror.')}\n"
        "print('loaded', *sorted(rooms & {'compensation', 'reference', 'tolerances'}))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "loaded"


def test_a_process_of_the_command_keeps_freed_memory_and_a_program_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[bool] = []
    monkeypatch.setattr(cli, "keep_freed_memory", lambda: told.append(True))
    monkeypatch.setattr(sys, "argv", ["rverror", "sources"])
    assert cli.main(["sources"]) == 0
    assert told == []
    assert cli.main() == 0
    assert told == [True]
