"""Commands that diagnose: one unit, a folder of them, the shipped example."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from rverror.app.batch import OVERVIEW, SUMMARY, diagnose_folder, one_line
from rverror.app.terminal import (
    MAPPING,
    MODEL,
    RUNS,
    ProgressLine,
    check_outputs,
    command,
    flag,
    make_folder,
    number,
    option,
    output,
    read_runs,
    results,
    save,
    save_results,
    save_with,
    tell,
    write_output,
)
from rverror.base.errors import InputError
from rverror.base.text import some
from rverror.diagnosis.loop import diagnose
from rverror.diagnosis.validation import validated
from rverror.model.model_file import load_model
from rverror.views.blocks import as_text
from rverror.views.diagnosis_report import diagnosis_sheet
from rverror.views.plots.figure import can_draw


@command(
    example="unit.toml forward.csv reverse.csv --html found.html --save with-cause.toml",
    options={
        **MODEL,
        **RUNS,
        **MAPPING,
        "--prior": option(
            "MADE.toml", "scatter of part errors in production, as written by `rverror lot --save`", reads=True
        ),
        **results(plot="waveforms and the residual spectrum"),
        **save("NEW.toml", "write the model with the causes found added"),
        "--jobs": number("threads that test causes (default: one for each core)", least=1),
    },
)
def _diagnose(options: argparse.Namespace) -> None:
    """Find what a model lacks, from measured runs.

    Compares measured runs with a model and gives the part and bench errors that the model lacks, their sizes with
    95 % intervals, other causes that the runs cannot rule out, and what is left of the error.
    """
    model = load_model(options.model)
    runs, unseen = read_runs(options, model)
    prior: Sequence[Any] = ()
    if options.prior is not None:
        from rverror.tolerances.tolerance_file import load_tolerances  # half of all modules, for this option alone

        prior = load_tolerances(options.prior, model)
    with ProgressLine() as progress:
        result = diagnose(model, runs, jobs=options.jobs, prior=prior, progress=progress)
    if unseen:
        result = validated(result, unseen)
    print(as_text(diagnosis_sheet(result)), end="")
    save_results(result, options)
    # what was found, and where the gear's marks are; none for a torque record, whose ripple is no output error
    effects = result.model.effects[len(result.declared.effects) :]
    save_with(options, effects)
    if options.save and not effects:
        tell(f"{options.save}: nothing was added; the file holds the model of {options.model}")
    elif options.save and any(effect.uncertainty for effect in result.declared.effects):
        tell(
            f"{options.save}: declared sizes stand as they were; the report's row 'with what was added' refits "
            "them within their uncertainty"
        )


@command(
    example="lot --output lot-found --pages",
    options={
        "folder": option("FOLDER", "each subfolder with runs is a unit; it needs a model.toml unless --model is given"),
        **output("FOLDER", "folder for UNIT.json of each unit and summary.csv", writes=False, required=True),
        "--model": option("MODEL.toml", "model of every unit that has no model.toml of its own"),
        **MAPPING,
        "--pages --html": flag("also write UNIT.html of each and summary.html with links, failed units first"),
        "--jobs": number("processes (default: one for each core)", least=1),
    },
)
def _diagnose_batch(options: argparse.Namespace) -> None:
    """Diagnose every unit of a folder, one subfolder each; run again to resume.

    Diagnoses every unit of a folder, one subfolder each. Finished units are kept: to continue a batch that was
    stopped, run the command again.
    """
    with ProgressLine() as progress:
        batch = diagnose_folder(
            options.folder,
            out=options.output,
            model=options.model,
            mapping=options.mapping,
            pages=options.pages,
            jobs=options.jobs,
            progress=progress,
        )
    tell(*batch.notes)
    for outcome in batch.outcomes:
        (tell if outcome.state == "failed" else print)(one_line(outcome))
    counts = ", ".join(f"{len(batch.of(state))} {state}" for state in ("diagnosed", "kept", "failed"))
    overview = Path(options.output) / (OVERVIEW if options.pages else SUMMARY)
    print(f"{len(batch.outcomes)} units: {counts}; see {overview}")
    if failed := batch.of("failed"):
        names = some(outcome.unit for outcome in failed)
        raise InputError(
            f"{len(failed)} of {len(batch.outcomes)} units could not be diagnosed ({names}); "
            "correct them and start again, the others are kept"
        )


@command(
    example="--output my-demo",
    options=output("FOLDER", "where to write (default rverror-demo)", writes=False, default="rverror-demo"),
)
def _demo(options: argparse.Namespace) -> None:
    """Diagnose the shipped, simulated example.

    Diagnoses the simulated unit that comes with rverror and writes its model, runs and results, so that each step
    can be repeated.
    """
    folder = make_folder(options.output, "choose another with --output")
    shipped = resources.files("rverror") / "data" / "demo"
    given = ["model.toml", "forward.csv", "reverse.csv"]
    check_outputs([str(folder / name) for name in given], [])
    for name in given:
        write_output(folder / name, (shipped / name).read_text(encoding="utf-8"))
    print("An RV-40E as declared by its shop floor, and two simulated test-bench runs, forward and reverse, 20 N*m.")
    made = {"--json": "diagnosis.json", "--save": "model-with-cause.toml"}
    if can_draw():
        made["--plot"] = "before-and-after.png"
    else:
        print("No picture: it needs matplotlib; install it with: pip install 'rverror[plot]'")
    words = ["diagnose", *(str(folder / name) for name in given)]
    for name, file in made.items():
        words += [name, str(folder / file)]
    print(f"\nrverror {shlex.join(words)}\n")
    from rverror.app.command_line import parser_of  # which loads this module

    diagnosis = parser_of("diagnose").parse_args(words)
    diagnosis.run(diagnosis)
    print("\nThe same in a notebook:\n")
    print("    import rverror")
    print(f'    model = rverror.load_model("{(folder / given[0]).as_posix()}")')
    print(f'    runs = [rverror.load_run("{folder.as_posix()}/" + name) for name in ("{given[1]}", "{given[2]}")]')
    print("    found = rverror.diagnose(model, runs)")
    print("    print(rverror.to_text(found))")
