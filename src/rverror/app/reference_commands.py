"""Commands for other tools: reference-cases and compare."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from rverror.app import read_command
from rverror.app.terminal import (
    add_command,
    add_output,
    add_results,
    check_output,
    make_folder,
    quantity,
    tell,
    write_json,
    write_output,
)
from rverror.base.errors import InputError
from rverror.base.text import check_name
from rverror.base.units import ARCSEC
from rverror.model.ends import Encoders
from rverror.model.model_file import load_model
from rverror.reference.cases import METHODS, case_files, pick, read_case, solve
from rverror.reference.comparison import compare
from rverror.runs.measurement import read_run
from rverror.views.envelope import input_files
from rverror.views.report import to_json, to_text

_FILES = ("case.npz", "case.json")


def add_commands(commands: Any) -> None:
    """Add the commands to a parser's subparsers.

    Parameters
    ----------
    commands : argparse._SubParsersAction
    """
    command = add_command(
        commands,
        "reference-cases",
        brief="write cases with known answers to test other tools against",
        does="Writes cases with known answers, one folder each: the model, and its output error by rverror.",
        example="--output cases --case one-cam",
    )
    add_output(command, "FOLDER", "where to write; each case has a folder in it", required=True)
    command.add_argument(
        "--case", action="append", default=[], metavar="NAME", help="write only this case; give it again for more"
    )
    command.set_defaults(run=_reference_cases)

    command = add_command(
        commands,
        "compare",
        brief="deviation of another tool's waveform from a reference case, by order",
        does="Compares a waveform from another tool with a reference case and lists how far it is off, in total and by "
        "order.",
        example='theirs.csv cases/one-cam --within "0.1 arcsec"',
    )
    command.add_argument("theirs", metavar="THEIR.csv", help="run file of the other tool, or any file with --mapping")
    command.add_argument("case", metavar="CASE", help="folder of the case, or its case.json")
    command.add_argument(
        "--method",
        choices=METHODS,
        default=METHODS[0],
        help="which waveform of the case (default equilibrium)",
    )
    command.add_argument(
        "--within", metavar='"0.1 arcsec"', help="exit with 1 if the rms of the difference, offset removed, is larger"
    )
    command.add_argument(
        "--bench",
        metavar="MODEL.toml",
        help="model file with the [bench.encoders] that measured the run, for its uncertainty",
    )
    read_command.add_mapping(command)
    add_results(command, html=False)
    command.set_defaults(run=_compare)


def _reference_cases(options: argparse.Namespace) -> None:
    if not options.output.strip():
        raise InputError(f"--output: {options.output!r} has no name; give a folder")
    cases = pick(options.case)
    folders = [Path(options.output) / case.name for case in cases]
    for folder in folders:
        make_folder(folder, "choose another with --output")
        for name in _FILES:
            check_output(str(folder / name), [])
    for case, folder in zip(cases, folders, strict=True):
        for name, content in case_files(solve(case)).items():
            write_output(folder / name, content)
        print(f"{folder}: {case.shows}", flush=True)


def _compare(options: argparse.Namespace) -> None:
    check_name(options.theirs)
    check_name(options.case)
    told = Path(options.case) if options.case.endswith(".json") else Path(options.case) / "case.json"
    mapping = read_command.given_mapping(options.mapping)
    inputs = [options.theirs, str(told), str(told.with_name("case.npz"))]
    inputs += [given for given in (options.mapping, options.bench) if given]
    check_output(options.json, [*inputs, options.case, str(told.with_name("case.json"))])
    limit = None if options.within is None else _limit(options.within)
    case = read_case(options.case)
    encoders = _encoders(options.bench) if options.bench else None
    run = read_run(options.theirs, case.ratio, mapping)
    found = compare(run, case, method=options.method, encoders=encoders)
    print(to_text(found), end="")
    if options.json:
        write_json(options.json, to_json(found, files=input_files(inputs)))
    if limit is not None and found.rms > limit:
        sys.stdout.flush()
        tell(f"rms of the difference {found.rms / ARCSEC:.4g} arcsec is above {options.within}")
        raise SystemExit(1)


def _encoders(path: str) -> Encoders:
    stated = load_model(path).encoders
    if not stated.given():
        raise InputError(f'{path}: it has no [bench.encoders]; write them, like output_encoder = "1.24 arcsec"')
    return stated


def _limit(text: str) -> float:
    value = quantity("--within", text, "angle", example="0.1 arcsec")
    if value < 0:
        raise InputError(f"--within: {text!r} is below 0; write it like '0.1 arcsec'")
    return value
