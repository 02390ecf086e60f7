"""Command that tells of many measured units what their processes made: lot."""

from __future__ import annotations

import argparse
import os
from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace

from rverror.app.batch import processes
from rverror.app.terminal import (
    MAPPING,
    ProgressLine,
    check_outputs,
    command,
    number,
    option,
    refuse_given,
    results,
    save,
    say_replaced,
    tell,
    write_output,
    write_results,
)
from rverror.base.errors import InputError
from rverror.base.numbers import count_of
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
from rverror.runs.bench.mapping import given_mapping
from rverror.tolerances.tolerance_file import load_tolerances
from rverror.views.report import to_csv

_MANY = 256  # units, of which runs of 512 samples take this process 1.5 s: as long as others take to start


@command(
    example="measured --model unit.toml --save made.toml",
    options={
        "parts": option(
            "FOLDER",
            "folder in which each subfolder with runs is a unit (units.csv, if any, gives build sequence and labels), "
            "or a file that --compress wrote; all are one lot",
            nargs="+",
        ),
        "--model": option("MODEL.toml", "model of all units", reads=True, required=True),
        "--tolerances": option(
            "TOL.toml", "drawing tolerances: evaluate only the processes in this file, with Cp and Cpk", reads=True
        ),
        **MAPPING,
        "--compress": option(
            "OUT.jsonl",
            "only read the runs and write a condensed file that `rverror lot` takes in their place; if interrupted, "
            "rerun the command to continue",
            writes=True,
        ),
        "--jobs": number("parallel jobs reading runs (default: one per core from 256 units on)", least=1),
        **save("MADE.toml", "write the scatter of the processes as a tolerance file"),
        **results(),
        "--csv": option("OUT.csv", "write a row for each process or order", writes=True),
        "--diagnose": number("diagnose up to N outliers (default 3; half a minute each)", least=0),
        "--seed": number("seed of the random virtual units (default 0)", least=0, default=0),
    },
)
def _lot(options: argparse.Namespace) -> None:
    """Scatter of each manufacturing process, or orders common to many drives, from measured units.

    Estimates the scatter and the systematic error of each manufacturing process from the runs of many finished units,
    and names outliers: units whose errors do not fit that scatter. For [drive] models it finds the orders that
    drives share.
    """
    if options.compress is not None and len(options.outputs) > 1:
        raise InputError("--compress estimates no process, so there is no result to write; leave out the other outputs")
    model = load_model(options.model)
    drive = isinstance(model.mechanism, Drive)
    if drive:
        unused = f"{options.model} is of a drive, whose lot has orders and no processes; leave it out"
        refuse_given(options, ("tolerances", "save", "diagnose"), unused)
    tolerances = None if options.tolerances is None else load_tolerances(options.tolerances, model)
    inputs = lot_inputs(options.parts, model, given_mapping(options.mapping))
    tables = [os.path.join(part, TABLE) for part in options.parts]  # there or not: the next call would read it
    options.inputs += inputs.files
    check_outputs(options.outputs, [*options.inputs, *tables])
    _check_apart(options.outputs, inputs)
    if options.compress is not None:
        _compress(inputs, options)
        return
    with ProgressLine() as progress:
        with _workers(options.jobs, inputs) as executor:
            amplitudes = inputs.amplitudes(executor=executor, progress=progress)
        if drive:
            result: Lot | DriveLot = lot_of_drives(model, amplitudes, seed=options.seed)
        else:
            found = lot(model, amplitudes, tolerances=tolerances, seed=options.seed, progress=progress)
            result = _diagnosed(found, inputs, 3 if options.diagnose is None else options.diagnose, progress)
    write_results(result, options)
    if options.csv:
        write_output(options.csv, to_csv(result, rows="process" if isinstance(result, Lot) else "place"))
    if options.save and isinstance(result, Lot):
        if text := tolerances_as_made(result):
            write_output(options.save, text)
        else:
            tell(f"{options.save}: not written, no process has a significant scatter; measure more units")


def _diagnosed(found: Lot, inputs: LotInputs, most: int, progress: ProgressLine) -> Lot:
    """The least likely members with their own diagnosis, where their runs are at hand."""
    wanted, model = {one.serial for one in found.outsiders[:most]}, inputs.model
    runs = {unit.serial: unit.read(model, inputs.mapping).runs for unit in inputs.unread if unit.serial in wanted}
    if lacking := len(wanted) - len(runs):
        note = f"not diagnosed: {count_of(lacking, 'unit')} of which a compressed file has no runs"
        found = replace(found, notes=(*found.notes, note))
    return diagnose_outsiders(model, found, runs, progress=progress)


def _compress(inputs: LotInputs, options: argparse.Namespace) -> None:
    say_replaced(options.compress)
    with ProgressLine() as progress, _workers(options.jobs, inputs) as executor:
        done = inputs.compressed(options.compress, overwrite=True, executor=executor, progress=progress)
    tell(*inputs.notes)
    print(f"{options.compress}: {count_of(done.units, 'unit')}, the runs of {done.read} read now")


def _workers(jobs: int | None, inputs: LotInputs) -> AbstractContextManager[Executor | None]:
    """Processes that read runs; none where this one does, or where they would take longer to start."""
    units = len(inputs.unread)
    count = min(jobs or (cores() if units >= _MANY else 1), -(-units // TOGETHER))
    return processes(count) if count > 1 else nullcontext()


def _check_apart(outputs: Sequence[str], inputs: LotInputs) -> None:
    """Refuse outputs among a unit's runs, for one of which the next call would take them."""
    places = {os.path.realpath(os.path.dirname(run)): unit.serial for unit in inputs.unread for run in unit.runs}
    for output in outputs:
        place = os.path.dirname(os.path.realpath(output))
        if place in places:
            raise InputError(f"{output}: it would lie in the folder of unit {places[place]}; choose another folder")
