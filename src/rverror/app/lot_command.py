"""Command that tells of many measured units what their processes made: lot."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from rverror.app import read_command
from rverror.app.terminal import Progress, check_outputs, tell, write_json, write_output
from rverror.base.errors import InputError
from rverror.base.text import check_name
from rverror.lots.amplitudes import LotUnit
from rverror.lots.as_made import tolerances_as_made
from rverror.lots.folder import TABLE, lot_units
from rverror.lots.made import lot
from rverror.lots.result import Lot
from rverror.model.model_file import load_model
from rverror.tolerances.tolerance_file import load_tolerances
from rverror.views.envelope import InputFile, input_files
from rverror.views.lot_report import lot_csv
from rverror.views.report import to_html, to_json, to_text


def add_commands(commands: Any) -> None:
    """Add the command to a parser's subparsers.

    Parameters
    ----------
    commands : argparse._SubParsersAction
    """
    command = commands.add_parser("lot", help="what each process makes, from the measured errors of many units")
    command.add_argument(
        "folder", metavar="FOLDER", help="each subfolder with runs is a unit; units.csv has their order and labels"
    )
    command.add_argument("--model", required=True, metavar="MODEL.toml", help="of all units")
    command.add_argument("--tolerances", metavar="TOL.toml", help="of the drawing: processes to tell, and Cp, Cpk")
    read_command.add_mapping(command)
    command.add_argument("--save", metavar="MADE.toml", help="write the processes as a tolerance file, as made")
    command.add_argument("--json", metavar="OUT.json", help="write the result for programs")
    command.add_argument("--html", "--report", metavar="OUT.html", help="write one page with tables and pictures")
    command.add_argument("--csv", metavar="OUT.csv", help="write a row for each process")
    command.add_argument("--seed", type=int, default=0, metavar="N", help="of the drawn units (default 0)")
    command.add_argument(
        "--progress", action="store_true", help="tell what is being done also where standard error is no terminal"
    )
    command.set_defaults(run=_lot)


def _lot(options: argparse.Namespace) -> None:
    if not options.folder.strip():
        raise InputError(f"FOLDER: {options.folder!r} has no name; give a folder")
    if options.seed < 0:
        raise InputError(f"--seed: {options.seed} is below 0; give 0 or more")
    outputs = [options.save, options.json, options.html, options.csv]
    inputs = [path for path in (options.model, options.tolerances, options.mapping) if path is not None]
    check_outputs(outputs, inputs)
    for path in inputs:
        check_name(path)
    model = load_model(options.model)
    tolerances = None if options.tolerances is None else load_tolerances(options.tolerances, model)
    units, notes = lot_units(options.folder, model, read_command.given_mapping(options.mapping))
    runs = [run.path for unit in units for run in unit.runs]
    table = os.path.join(options.folder, TABLE)
    check_outputs(outputs, [*inputs, table, *runs])
    _check_apart(outputs, options.folder, units)
    files = input_files([*inputs, *([table] if os.path.isfile(table) else []), *runs])
    with closing(Progress(terminal_only=not options.progress)) as progress:
        found = lot(model, units, tolerances=tolerances, seed=options.seed, progress=progress)
    found = replace(found, notes=(*notes, *found.notes))
    print(to_text(found), end="")
    _write(found, options, files)


def _check_apart(outputs: Sequence[str | None], folder: str, units: Sequence[LotUnit]) -> None:
    """Refuse outputs among a unit's runs, for one of which the next call would take them."""
    places = {os.path.realpath(Path(folder) / unit.serial): unit.serial for unit in units}
    for output in outputs:
        place = None if output is None else os.path.dirname(os.path.realpath(output))
        if place in places:
            raise InputError(f"{output}: it would lie in the folder of unit {places[place]}; choose another folder")


def _write(found: Lot, options: argparse.Namespace, files: Sequence[InputFile]) -> None:
    if options.json:
        write_json(options.json, to_json(found, files=files))
    if options.html:
        write_output(options.html, to_html(found, files=files))
    if options.csv:
        write_output(options.csv, lot_csv(found))
    if options.save:
        text = tolerances_as_made(found)
        if text:
            write_output(options.save, text)
        else:
            tell(f"{options.save}: not written, no process is told from none; measure more units")
