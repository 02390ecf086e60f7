"""Command that tells of many measured units what their processes made: lot."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, closing, nullcontext
from dataclasses import replace
from typing import Any

from rverror.app import read_command
from rverror.app.batch import processes
from rverror.app.terminal import (
    Progress,
    add_command,
    add_results,
    check_jobs,
    check_outputs,
    say_replaced,
    tell,
    write_json,
    write_output,
)
from rverror.base.errors import InputError
from rverror.base.numbers import count_of
from rverror.base.text import check_name
from rverror.base.threads import cores
from rverror.geartrain.mechanism import Drive
from rverror.lots.as_made import tolerances_as_made
from rverror.lots.compressed import TOGETHER, LotInputs, lot_inputs
from rverror.lots.folder import TABLE
from rverror.lots.made import lot
from rverror.lots.of_drives import DriveLot, lot_of_drives
from rverror.lots.outsider_diagnosis import diagnose_outsiders
from rverror.lots.result import Lot
from rverror.model.model_file import load_model
from rverror.tolerances.tolerance_file import load_tolerances
from rverror.views.envelope import InputFile, input_files
from rverror.views.report import to_csv, to_html, to_json, to_text

_MANY = 256  # units, of which runs of 512 samples take this process 1.5 s: as long as others take to start


def add_commands(commands: Any) -> None:
    """Add the command to a parser's subparsers.

    Parameters
    ----------
    commands : argparse._SubParsersAction
    """
    command = add_command(
        commands,
        "lot",
        brief="scatter of each process, or orders that drives share, from many measured units",
        does="Estimates from the runs of many finished units how far each manufacturing process scatters and how far "
        "its mean is off, and names units that do not belong to the lot.",
        example="measured --model unit.toml --save made.toml",
    )
    command.add_argument(
        "parts",
        nargs="+",
        metavar="FOLDER",
        help="each subfolder with runs is a unit, units.csv has their order and labels; or a file of --compress; "
        "several are parts of one lot",
    )
    command.add_argument("--model", required=True, metavar="MODEL.toml", help="model of all units")
    command.add_argument(
        "--tolerances", metavar="TOL.toml", help="tolerances of the drawing: which processes to estimate, and Cp, Cpk"
    )
    read_command.add_mapping(command)
    command.add_argument(
        "--compress",
        metavar="OUT.npz",
        help="only read the runs and write what `lot` needs of them; if interrupted, run it again to continue",
    )
    command.add_argument(
        "--jobs",
        type=int,
        metavar="N",
        help="processes that read runs (default: one for each core if there are many runs)",
    )
    command.add_argument("--save", metavar="MADE.toml", help="write the scatter of the processes as a tolerance file")
    add_results(command)
    command.add_argument("--csv", metavar="OUT.csv", help="write a row for each process")
    command.add_argument(
        "--diagnose",
        type=int,
        default=3,
        metavar="N",
        help="diagnose up to N units that do not belong to the lot (default 3; half a minute each)",
    )
    command.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the drawn units (default 0)")
    command.add_argument(
        "--progress", action="store_true", help="show progress also where standard error is no terminal"
    )
    command.set_defaults(run=_lot)


def _lot(options: argparse.Namespace) -> None:
    for path in options.parts:
        if not path.strip():
            raise InputError(f"FOLDER: {path!r} has no name; give a folder")
    if options.seed < 0:
        raise InputError(f"--seed: {options.seed} is below 0; give 0 or more")
    if options.diagnose < 0:
        raise InputError(f"--diagnose: {options.diagnose} is below 0; give 0 or more")
    check_jobs(options.jobs, "processes")
    outputs = [options.save, options.json, options.html, options.csv, options.compress]
    if options.compress is not None and any(output is not None for output in outputs[:-1]):
        raise InputError("--compress: it tells of no process, so no result is written; leave out the other outputs")
    given = [path for path in (options.model, options.tolerances, options.mapping) if path is not None]
    check_outputs(outputs, given)
    for path in given:
        check_name(path)
    model = load_model(options.model)
    drive = isinstance(model.mechanism, Drive)
    for name in ("tolerances", "save") if drive else ():
        if getattr(options, name) is not None:
            raise InputError(
                f"--{name}: {options.model} is of a drive, whose lot has orders and no processes; leave it out"
            )
    tolerances = None if options.tolerances is None else load_tolerances(options.tolerances, model)
    inputs = lot_inputs(options.parts, model, read_command.given_mapping(options.mapping))
    tables = [os.path.join(part, TABLE) for part in options.parts]  # there or not: the next call would read it
    check_outputs(outputs, [*given, *tables, *inputs.files])
    _check_apart(outputs, inputs)
    if options.compress is not None:
        _compress(inputs, options)
        return
    files = input_files([*given, *inputs.files])
    with closing(Progress(terminal_only=not options.progress)) as progress:
        with _workers(options.jobs, inputs) as executor:
            amplitudes = inputs.amplitudes(executor=executor, progress=progress)
        if drive:
            told: Lot | DriveLot = lot_of_drives(model, amplitudes, seed=options.seed)
        else:
            found = lot(model, amplitudes, tolerances=tolerances, seed=options.seed, progress=progress)
            told = _diagnosed(found, inputs, options.diagnose, progress)
    _write(told, options, files)


def _diagnosed(found: Lot, inputs: LotInputs, most: int, progress: Progress) -> Lot:
    """The least likely members with their own diagnosis, where their runs are at hand."""
    wanted, model = {one.serial for one in found.outsiders[:most]}, inputs.model
    runs = {unit.serial: unit.read(model, inputs.mapping).runs for unit in inputs.unread if unit.serial in wanted}
    if lacking := len(wanted) - len(runs):
        note = f"not diagnosed: {count_of(lacking, 'unit')} of which a compressed file has no runs"
        found = replace(found, notes=(*found.notes, note))
    return diagnose_outsiders(model, found, runs, progress=progress)


def _compress(inputs: LotInputs, options: argparse.Namespace) -> None:
    say_replaced(options.compress)
    with (
        closing(Progress(terminal_only=not options.progress)) as progress,
        _workers(options.jobs, inputs) as executor,
    ):
        done = inputs.compressed(options.compress, overwrite=True, executor=executor, progress=progress)
    for note in done.notes:
        tell(note)
    print(f"{options.compress}: {count_of(done.units, 'unit')}, the runs of {done.read} read now")


def _workers(jobs: int | None, inputs: LotInputs) -> AbstractContextManager[Executor | None]:
    """Processes that read runs; none where this one does, or where they would take longer to start."""
    units = len(inputs.unread)
    count = min(jobs or (cores() if units >= _MANY else 1), -(-units // TOGETHER))
    return processes(count) if count > 1 else nullcontext()


def _check_apart(outputs: Sequence[str | None], inputs: LotInputs) -> None:
    """Refuse outputs among a unit's runs, for one of which the next call would take them."""
    places = {os.path.realpath(os.path.dirname(run)): unit.serial for unit in inputs.unread for run in unit.runs}
    for output in outputs:
        place = None if output is None else os.path.dirname(os.path.realpath(output))
        if place in places:
            raise InputError(f"{output}: it would lie in the folder of unit {places[place]}; choose another folder")


def _write(found: Lot | DriveLot, options: argparse.Namespace, files: Sequence[InputFile]) -> None:
    print(to_text(found), end="")
    if options.json:
        write_json(options.json, to_json(found, files=files))
    if options.html:
        write_output(options.html, to_html(found, files=files))
    if options.csv:
        write_output(options.csv, to_csv(found, rows="process" if isinstance(found, Lot) else "place"))
    if options.save and isinstance(found, Lot):
        text = tolerances_as_made(found)
        if text:
            write_output(options.save, text)
        else:
            tell(f"{options.save}: not written, no process is told from none; measure more units")
