"""Command line: exit 0 done, 2 bad input with one line that names what, where and the remedy."""

from __future__ import annotations

import argparse
import io
import os
import sys
from collections.abc import Sequence
from contextlib import closing
from importlib import import_module, resources
from itertools import chain
from pathlib import Path
from typing import Any, NoReturn

from rverror.app.batch import OVERVIEW, SUMMARY, diagnose_folder, told
from rverror.app.terminal import (
    MAPPING,
    MODEL,
    RUNS,
    WAYS,
    Progress,
    add_command,
    arm,
    arm_option,
    check_jobs,
    check_output,
    choice,
    flag,
    given_twice,
    make_folder,
    option,
    output,
    results,
    rounded,
    say_replaced,
    tell,
    write_json,
    write_output,
    write_picture,
)
from rverror.base import units
from rverror.base.errors import InputError
from rverror.base.text import shown
from rverror.base.version import __version__
from rverror.diagnosis.loop import diagnose
from rverror.diagnosis.result import Diagnosis
from rverror.diagnosis.validation import validated
from rverror.geartrain.mechanism import reducer
from rverror.geartrain.source import Source
from rverror.geartrain.torque_over_turn import GravityArm
from rverror.model.catalogue import CATALOGUE
from rverror.model.effects import Model
from rverror.model.model_file import append_effects, load_model
from rverror.runs.bench.mapping import given_mapping
from rverror.runs.measurement import Run, load_run, read_run, run_text, write_run
from rverror.runs.order_file import orders_text, write_orders
from rverror.runs.order_fit import checked_orders, order_table_from_runs
from rverror.runs.order_table import OrderTable
from rverror.runs.virtual_bench import DEFAULT_SEED, run_label, simulate_runs
from rverror.statics.loaded_state import NotConvergedError
from rverror.views.blocks import as_text
from rverror.views.diagnosis_report import diagnosis_json, diagnosis_sheet
from rverror.views.envelope import input_files

#: Commands of each file of commands, as help lists them.  A file is loaded for its own: a diagnosis would wait for the
#: classes of all other results.
COMMANDS = {
    "compensate_command": ("compensate",),
    "read_command": ("read",),
    "tolerance_commands": ("budget", "allocate"),
    "lot_command": ("lot",),
    "life_command": ("trend", "compare-runs"),
    "wear_command": ("wear",),
    "parts_command": ("parts",),
    "match_command": ("match",),
    "dynamics_commands": ("modes", "speeds"),
    "contact_commands": ("efficiency", "hysteresis", "pressure"),
    "reference_commands": ("reference-cases", "compare"),
}
HERE = ("simulate", "diagnose", "diagnose-batch", "sources", "demo")


class _Parser(argparse.ArgumentParser):
    """Parser whose errors are one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: error: {' '.join(message.split())}; see {self.prog} --help\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments : sequence of str, optional
        Without the program's name; those of the process where left out.

    Returns
    -------
    int
        0 done, 2 bad input, 130 interrupted.
    """
    words = sys.argv[1:] if arguments is None else arguments
    options = parser_of(words[0] if words else "").parse_args(words)
    if isinstance(sys.stdout, io.TextIOWrapper):  # a console of few characters shows the others as escapes
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        options.run(options)
        sys.stdout.flush()
    except (InputError, NotConvergedError) as problem:
        print(f"rverror: error: {' '.join(str(problem).split())}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("rverror: interrupted; nothing half-written was left", file=sys.stderr)
        return 130
    except BrokenPipeError:
        _silence_output()
    except OSError as problem:
        _silence_output()
        print(f"rverror: error: standard output: {problem.strerror}; free the disk or write a file", file=sys.stderr)
        return 2
    return 0


def _silence_output() -> None:
    """Let the interpreter's last flush of an output that takes no more go nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def parser_of(asked: str) -> argparse.ArgumentParser:
    """Parser of the command that is asked for, and those beside it; of all where it is none."""
    known = {*HERE, *chain.from_iterable(COMMANDS.values())}
    parser = _Parser(
        prog="rverror", description="Output error of RV reducers: from part errors, and back to the cause."
    )
    parser.add_argument("--version", action="version", version=f"rverror {__version__}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")

    add_command(
        commands,
        "simulate",
        brief="compute a run from a model file",
        does="Computes the output error of the unit that a model file describes and writes it as a run file, as a test "
        "bench would record it.",
        example='unit.toml --method equilibrium --torque "20 N*m" --direction both -o run.csv',
        run=_simulate,
        options={
            **MODEL,
            "--points": option("N", "samples per output turn (default: what the orders need)", type=int),
            "--revolutions": option("N", "output turns (default 1)", type=int, default=1),
            "--torque": option(
                '"20 N*m"', "output torque; give it again for more runs", size="torque", action="append"
            ),
            **arm_option("in place of a torque a weight", "; the run has a column output_torque"),
            "--method": choice(("closed", "equilibrium"), "closed"),
            "--direction": choice(WAYS, "forward"),
            "--noise": option('"0.3 arcsec"', "rms of the noise on the transmission error"),
            "--noise-correlation": option(
                '"2 deg"', "output angle over which the noise is correlated (default: white)", dest="correlation"
            ),
            "--input-counts": option("N", "counts per turn of the input encoder", type=int),
            "--output-counts": option("N", "counts per turn of the output encoder", type=int),
            "--seed": option("N", f"seed of the noise (default {DEFAULT_SEED})", type=int),
            "--speed": option('"10 deg/s"', "output speed; gives the run a time column"),
            "--orders": option('"1,39,40"', "write an order table of these orders in place of samples"),
            **output(
                "OUT.csv",
                "run file to write (default: standard output); several runs become OUT-forward-20Nm.csv and so on",
            ),
        },
    )
    add_command(
        commands,
        "diagnose",
        brief="find what a model lacks in measured runs",
        does="Compares measured runs with a model and names the part errors that the model lacks: their sizes with 95 %"
        " intervals, what explains the runs equally well, and the error before and after.",
        example="unit.toml forward.csv reverse.csv --html found.html --save with-cause.toml",
        run=_diagnose,
        options={
            **MODEL,
            **RUNS,
            **MAPPING,
            "--prior": option(
                "MADE.toml", "usual sizes of part errors in production, as written by `lot --save`", reads=True
            ),
            **results(plot="waveforms and the spectrum of the residual"),
            "--save": option("NEW.toml", "write the model with what was added"),
            "--jobs": option("N", "threads that fit candidates (default: one for each core)", type=int),
        },
    )
    add_command(
        commands,
        "diagnose-batch",
        brief="diagnose a folder of units, one subfolder each, and resume",
        does="Diagnoses every unit of a folder, one subfolder each. Units that are done are kept, so a batch that was "
        "stopped goes on when the command is given again.",
        example="lot --output lot-found --pages",
        run=_diagnose_batch,
        options={
            "folder": option("FOLDER", "each subfolder with a model.toml and runs is a unit"),
            **output("FOLDER", "folder for UNIT.json of each unit and summary.csv", required=True),
            "--model": option("MODEL.toml", "model of every unit that has no model.toml of its own"),
            **MAPPING,
            "--pages --html": flag("also write UNIT.html of each, and summary.html with links to them, failures first"),
            "--jobs": option("N", "processes (default: one for each core)", type=int),
        },
    )
    for module, names in COMMANDS.items():
        if asked in names or asked not in known:
            import_module(f"rverror.app.{module}").add_commands(commands)

    add_command(
        commands,
        "sources",
        brief="list the catalogue of error sources",
        does="Lists all error sources that rverror knows: key, parameters, the part in which each is fixed, and the "
        "orders that it makes.",
        example="--json sources.json",
        run=_sources,
        options={"--json": option("OUT.json", "write it as JSON instead")},
    )
    add_command(
        commands,
        "demo",
        brief="the whole diagnosis on the shipped example",
        does="Diagnoses the simulated unit that comes with rverror and writes its model, runs and results, so that each"
        " step can be repeated.",
        example="--output my-demo",
        run=_demo,
        options=output("FOLDER", "where to write (default rverror-demo)", default="rverror-demo"),
    )
    return parser


def _simulate(options: argparse.Namespace) -> None:
    model = load_model(options.model)
    check_output(options.output, [options.model])
    torques: list[float | GravityArm | None] = list(options.torque or ())
    if options.arm is not None:
        torques.append(arm(options.arm))
    torques = torques or [None]
    directions = WAYS[options.direction]
    labels = [run_label(direction, torque) for torque in torques for direction in directions]
    orders = None if options.orders is None else _orders(options.orders)
    paths = [] if orders else _run_paths(options, labels)
    names = (
        "points",
        "revolutions",
        "method",
        "noise",
        "correlation",
        "input_counts",
        "output_counts",
        "seed",
    )
    bench = {name: getattr(options, name) for name in names}
    runs = simulate_runs(model, directions=directions, torques=torques, output_speed=options.speed, **bench)
    if torques != [None] and options.method == "closed":
        tell(
            "the closed form holds contacts closed at any torque, but diagnose takes a stated torque for the "
            "equilibrium; for such a run give --method equilibrium"
        )
    if orders:
        table = order_table_from_runs(runs, model, orders)
        for note in table.notes:
            tell(note)
        if options.output is None:
            sys.stdout.write(orders_text(table))
            return
        say_replaced(options.output)
        write_orders(options.output, table, overwrite=True)
        tell(f"wrote {options.output}")
        return
    if options.output is None:
        sys.stdout.write(run_text(runs[0]))
        return
    for path, run in zip(paths, runs, strict=True):
        say_replaced(path)
        write_run(path, run, overwrite=True)
        if len(paths) > 1:
            print(path)  # for diagnose, or whatever reads the runs
        else:
            tell(f"wrote {path}")


def _orders(text: str) -> list[float]:
    """Orders of the option --orders, checked before any work."""
    found: list[float] = []
    for cell in text.split(","):
        try:
            found.append(float(cell))
        except ValueError as problem:
            raise InputError(f"--orders: {shown(cell)} is no number; write it like '1,39,40'") from problem
    checked_orders(found)
    return found


def _run_paths(options: argparse.Namespace, labels: Sequence[str]) -> list[str]:
    """File of each run: the one asked for, or beside it one for each label; none for standard output."""
    if options.output is None:
        if len(labels) > 1:
            raise InputError(f"{len(labels)} runs ({', '.join(labels)}) need a file each; give a name, e.g. -o OUT.csv")
        return []
    if len(labels) == 1:
        return [options.output]
    base = Path(options.output)
    if twice := [label for i, label in enumerate(labels) if label in labels[:i]]:
        raise InputError(f"--torque: {twice[0]} is given twice; give each torque once")
    paths = [str(base.with_name(f"{base.stem}-{label}{base.suffix}")) for label in labels]
    for path in paths:
        check_output(path, [options.model])
    if (same := given_twice(paths)) is not None:
        raise InputError(f"{same}: this file is that of another run too, by a link; remove the link")
    return paths


def _diagnose(options: argparse.Namespace) -> None:
    check_jobs(options.jobs, "threads")
    if (twice := given_twice([*options.runs, *options.validate])) is not None:
        raise InputError(f"{twice}: this run file is given twice; give each once, to fit or to --validate")
    model = load_model(options.model)
    mapping = given_mapping(options.mapping)
    runs = [load_run(path, model, mapping) for path in options.runs]
    unseen = [load_run(path, model, mapping) for path in options.validate]
    prior: Sequence[Any] = ()
    if options.prior is not None:
        from rverror.tolerances.tolerance_file import load_tolerances  # half of all modules, for this option alone

        prior = load_tolerances(options.prior, model)
    result = _diagnose_with_progress(model, runs, jobs=options.jobs, prior=prior)
    if unseen:
        result = validated(result, unseen)
    print(as_text(diagnosis_sheet(result)), end="")
    _write_results(result, options)


def _diagnose_batch(options: argparse.Namespace) -> None:
    for name, path in (("FOLDER", options.folder), ("--output", options.output)):
        if not path.strip():
            raise InputError(f"{name}: {path!r} has no name; give a folder")
    check_jobs(options.jobs, "processes")
    with closing(Progress()) as progress:
        batch = diagnose_folder(
            options.folder,
            out=options.output,
            model=options.model,
            mapping=options.mapping,
            pages=options.pages,
            jobs=options.jobs,
            progress=progress,
        )
    for note in batch.notes:
        tell(note)
    for outcome in batch.outcomes:
        if outcome.state == "failed":
            tell(told(outcome))
        else:
            print(told(outcome))
            if outcome.replaced:
                tell(f"replaced {Path(options.output) / outcome.unit}.json, since {outcome.replaced}")
    counts = ", ".join(f"{len(batch.of(state))} {state}" for state in ("diagnosed", "kept", "failed"))
    print(
        f"{len(batch.outcomes)} units: {counts}; see {Path(options.output) / (OVERVIEW if options.pages else SUMMARY)}"
    )
    if failed := batch.of("failed"):
        names = ", ".join(outcome.unit for outcome in failed[:5]) + (", ..." if len(failed) > 5 else "")
        raise InputError(
            f"{len(failed)} of {len(batch.outcomes)} units could not be diagnosed ({names}); "
            "correct them and start again, the others are kept"
        )


def _write_results(result: Diagnosis, options: argparse.Namespace) -> None:
    files = input_files(options.inputs)
    if options.json:
        write_json(options.json, diagnosis_json(result, files=files))
    if options.plot:
        from rverror.views.plots.drawing import diagnosis_figure

        write_picture(options.plot, diagnosis_figure(result))
    if options.html:
        from rverror.views.report import to_html  # all kinds of results, for this option alone

        write_output(options.html, to_html(result, files=files))
    if options.save:
        say_replaced(options.save)
        # what was found, and where the gear's marks are; none for a torque record, whose ripple is no output error
        effects = [rounded(effect) for effect in result.model.effects[len(result.declared.effects) :]]
        append_effects(options.model, options.save, effects, overwrite=True)
        if not effects:
            tell(f"{options.save}: nothing was added; the file is a copy of {options.model}")
        elif any(effect.uncertainty for effect in result.declared.effects):
            tell(
                f"{options.save}: declared sizes stand as they were; the 'after' of the report refits them within "
                "their uncertainty"
            )


def _sources(options: argparse.Namespace) -> None:
    if options.json:
        write_json(options.json, [_source_json(s) for s in CATALOGUE.values()])
        return
    for entry in CATALOGUE.values():
        indices = ", ".join(index.name for index in entry.indices) or "-"
        names = ", ".join(f"{p.name} [{units.DISPLAY_UNITS[p.dimension]}]" for p in entry.parameters)
        orders = ", ".join(f"{order:g}" for order in _example_orders(entry)) or "none: constant or cancels"
        print(f"{entry.key}\n    {entry.summary}; {entry.reference}")
        print(f"    fixed in: {entry.frame}; indices: {indices}; parameters: {names}; leading order, RV-40E: {orders}")


def _example_orders(entry: Source) -> tuple[float, ...]:
    """Leading orders in the RV-40E, for the first index set that has any."""
    unit = reducer("RV-40E")
    if not entry.applies_to(unit):
        return ()
    return next((found for indices in entry.candidates(unit) if (found := entry.orders(unit, indices))), ())


def _source_json(entry: Source) -> dict[str, Any]:
    return {
        "key": entry.key,
        "summary": entry.summary,
        "indices": [index.name for index in entry.indices],
        "parameters": [{"name": p.name, "unit": units.DISPLAY_UNITS[p.dimension]} for p in entry.parameters],
        "frame": entry.frame,
        "orders_rv40e": list(_example_orders(entry)),
        "reference": entry.reference,
    }


def _demo(options: argparse.Namespace) -> None:
    folder = make_folder(options.output, "choose another with --output")
    shipped = resources.files("rverror") / "data" / "demo"
    for name in ("model.toml", "forward.csv", "reverse.csv"):
        check_output(str(folder / name), [])
        write_output(folder / name, (shipped / name).read_text(encoding="utf-8"))
    model_path, run_paths = folder / "model.toml", [folder / "forward.csv", folder / "reverse.csv"]
    print("An RV-40E as declared by its shop floor, and two simulated test-bench runs, forward and reverse, 20 N*m.")
    print(f"Files: {model_path}, {run_paths[0]}, {run_paths[1]}\n")
    model = load_model(model_path)
    result = _diagnose_with_progress(model, [read_run(path, model) for path in run_paths])
    for trace in result.traces:
        sizes = [float(w.max() - w.min()) / units.ARCSEC for w in (trace.measured, trace.before, trace.after)]
        name = Path(trace.name).name
        print(f"{name}: peak-to-peak over the mean turn, arcsec: bench {sizes[0]:.1f}, declared model {sizes[1]:.1f}, "
              f"with what was added {sizes[2]:.1f}")  # fmt: skip
    print("\n" + as_text(diagnosis_sheet(result)))
    written = [folder / "diagnosis.json", folder / "model-with-cause.toml"]
    write_json(written[0], diagnosis_json(result, files=input_files([model_path, *run_paths])))
    say_replaced(written[1])
    append_effects(model_path, written[1], [rounded(a.effect) for a in result.added], overwrite=True)
    try:
        from rverror.views.plots.drawing import diagnosis_figure, to_bytes

        picture, content = folder / "before-and-after.png", to_bytes(diagnosis_figure(result), "png")
    except InputError as problem:
        print(f"No picture: {problem}")
    else:
        write_output(picture, content)
        written.append(picture)
    print("Wrote " + ", ".join(str(path) for path in written))
    print("\nThe same in a notebook:\n")
    print("    import rverror")
    print(f'    model = rverror.load_model("{model_path.as_posix()}")')
    print(f'    found = rverror.diagnose(model, [rverror.load_run("{folder.as_posix()}/" + f) for f in '
          '("forward.csv", "reverse.csv")])')  # fmt: skip
    print("    print(rverror.to_text(found))")


def _diagnose_with_progress(model: Model, runs: Sequence[Run | OrderTable], **options: Any) -> Diagnosis:
    with closing(Progress()) as progress:
        return diagnose(model, runs, progress=progress, **options)
