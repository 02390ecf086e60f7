"""Commands for other tools: reference-cases and compare."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rverror.app.terminal import (
    MAPPING,
    check_outputs,
    choice,
    command,
    make_folder,
    option,
    output,
    results,
    tell,
    write_output,
    write_results,
)
from rverror.base.errors import InputError
from rverror.base.numbers import with_unit
from rverror.model.model_file import load_model
from rverror.reference.cases import METHODS, case_files, pick, read_case, solve
from rverror.reference.comparison import compare
from rverror.runs.measurement import read_run

_FILES = ("case.npz", "case.json")


@command(
    example="--output cases --case one-cam",
    options={
        **output("FOLDER", "where to write, a folder for each case", writes=False, required=True),
        "--case": option("NAME", "one case (docs/test-your-tool.md); repeat it for more", action="append", default=[]),
    },
)
def _reference_cases(options: argparse.Namespace) -> None:
    """Write cases with known answers to test other tools against.

    Writes cases with known answers, one folder each: the model, and its waveforms, influences and contact forces.
    """
    cases = pick(options.case)
    folders = [Path(options.output) / case.name for case in cases]
    for folder in folders:
        make_folder(folder, "choose another with --output")
        check_outputs([str(folder / name) for name in _FILES], [])
    for case, folder in zip(cases, folders, strict=True):
        for name, content in case_files(solve(case)).items():
            write_output(folder / name, content)
        print(f"{folder}: {case.shows}", flush=True)


@command(
    example='theirs.csv cases/one-cam --within "0.1 arcsec"',
    options={
        "theirs": option(
            "THEIR.csv",
            "waveform of the other tool: a run file, or a file of another format with --mapping",
            reads=True,
        ),
        "case": option("CASE", "folder of the case, or its case.json"),
        "--method": choice(METHODS, METHODS[0], "which waveform of the case (default equilibrium)"),
        "--within": option(
            '"0.1 arcsec"',
            "exit with code 1 if the rms of the difference, without its offset, exceeds this",
            size="angle",
            least=0,
        ),
        **MAPPING,
        "--bench": option(
            "MODEL.toml", "if THEIR.csv was measured: model file with the bench's [bench.encoders]", reads=True
        ),
        **results(),
    },
)
def _compare(options: argparse.Namespace) -> None:
    """Deviation of another tool's waveform from a reference case, by order.

    Compares a waveform from another tool with a reference case and lists the difference, in total and by order.
    """
    case_file = Path(options.case) if options.case.endswith(".json") else Path(options.case) / "case.json"
    options.inputs[1:1] = [str(case_file), str(case_file.with_name("case.npz"))]
    check_outputs(options.outputs, options.inputs)
    case = read_case(options.case)
    encoders = load_model(options.bench).encoders if options.bench else None
    if encoders is not None and not encoders.given():
        raise InputError(
            f'{options.bench}: it has no [bench.encoders]; write them, like output_encoder = "1.24 arcsec"'
        )
    run = read_run(options.theirs, case.ratio, options.mapping)
    found = compare(run, case, method=options.method, encoders=encoders)
    write_results(found, options)
    if options.within is not None and found.rms > options.within:
        sys.stdout.flush()
        tell(f"rms of the difference {with_unit(found.rms, 'angle')} is above {options.as_written['within']}")
        raise SystemExit(1)
