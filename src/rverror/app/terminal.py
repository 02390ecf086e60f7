"""What all commands share: options, outputs that are refused before any work, progress and notes on standard error."""

from __future__ import annotations

import argparse
import inspect
import json
import os
import sys
import textwrap
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

from rverror.base import units
from rverror.base.errors import InputError, refusing
from rverror.base.spreadsheet import openpyxl_for
from rverror.base.text import check_name, shown, write_file
from rverror.geartrain.torque_over_turn import GravityArm
from rverror.model.catalogue import source
from rverror.model.effects import Effect, Model
from rverror.model.model_file import load_model, save_model
from rverror.runs.bench.mapping import given_mapping
from rverror.runs.measurement import Run, load_run
from rverror.runs.order_table import OrderTable
from rverror.statics.duty import DutyPhase

T = TypeVar("T")

_ARM = "20 kg, 0.5 m, 30 deg"
_PHASE = "412 N*m, 1815 rpm, 3 h"


class ProgressLine:
    """Progress on standard error once it takes over two seconds: one line on a terminal, else a line now and then."""

    def __init__(self) -> None:
        """Start the clock."""
        self.start = self.last = time.monotonic()
        self.terminal = sys.stderr.isatty()

    def __call__(self, text: str) -> None:
        """Tell what is being done."""
        now = time.monotonic()
        if now - self.start < 2 or (not self.terminal and now - self.last < 2):
            return
        self.last = now
        line = f"[{now - self.start:4.0f} s] {text}"
        if self.terminal:
            print(f"\r{line[:100]:<100}", end="", file=sys.stderr, flush=True)
        else:
            print(line, file=sys.stderr, flush=True)

    def __enter__(self) -> ProgressLine:
        """Begin."""
        return self

    def __exit__(self, *problem: object) -> None:
        """Clear the line."""
        if self.terminal and self.last > self.start:
            print(f"\r{'':<100}\r", end="", file=sys.stderr, flush=True)


@dataclass(frozen=True)
class Option:
    """One option of a command.

    Attributes
    ----------
    given : mapping of str to object
        For argparse.
    size : str
        Dimension of a quantity, written as the metavar shows: the command gets its value in the core unit.
    least : float or None
        Least number; a size must be above it.
    reads, writes : bool
        Whether it names files that are read, or one that is written: no output may be one of the inputs.
    """

    given: Mapping[str, Any]
    size: str = ""
    least: float | None = None
    reads: bool = False
    writes: bool = False


def option(metavar: str | tuple[str, ...] | None = None, help: str | None = None, **more: Any) -> Option:
    """One entry of the table of options that `add_command` takes; what `Option` does not know is for argparse."""
    own = {name: more.pop(name) for name in ("size", "least", "reads", "writes") if name in more}
    return Option({"metavar": metavar, "help": help, **more}, **own)


def number(help: str, **more: Any) -> Option:
    """Option that is a whole number, with a `least` where no function refuses a smaller one."""
    return option("N", help, type=int, **more)


def flag(help: str) -> Option:
    """Option that is given or not."""
    return Option({"help": help, "action": "store_true"})


def choice(choices: Iterable[str], default: str, help: str | None = None) -> Option:
    """Option that is one of some words."""
    return Option({"help": help, "choices": tuple(choices), "default": default})


def output(metavar: str, help: str, *, writes: bool = True, **more: Any) -> dict[str, Option]:
    """Option for the file or folder that a command is for; a folder is none that `writes`."""
    return {"-o --output --out": option(metavar, help, writes=writes, **more)}


def save(metavar: str, help: str) -> dict[str, Option]:
    """Option for a file that other commands read."""
    return {"--save": option(metavar, help, writes=True)}


def results(*, plot: str | None = None) -> dict[str, Option]:
    """Options that write a result: JSON, its tables as page and workbook, and a picture where `plot` says of what."""
    return {
        "--json": option("OUT.json", "write the result as JSON", writes=True),
        "--html --report": option(
            "OUT.html", "write a self-contained page, with pictures if there are any", writes=True
        ),
        "--xlsx": option("OUT.xlsx", "write the tables as a workbook, a sheet for each", writes=True),
        **({} if plot is None else {"--plot": option("OUT.png", f"draw {plot}", writes=True)}),
    }


#: Options that several commands have, for their tables.
MODEL: Mapping[str, Option] = {"model": option("MODEL.toml", "model file: the unit and its known errors", reads=True)}
RUNS: Mapping[str, Option] = {
    "runs": option("RUN.csv", "a run for each direction and load, or order tables", nargs="+", reads=True),
    "--validate": option(
        "FILE", "runs or order tables kept out of the fit, to test the result on", reads=True, nargs="+", default=[]
    ),
}
MAPPING: Mapping[str, Option] = {
    "--mapping": option("BENCH.toml", "mapping file: the bench's column names and their units", reads=True)
}
WIDTHS: Mapping[str, Option] = {
    "--disc-width": option('"9 mm"', "contact length of a pin on one disc", size="length", required=True),
    "--gear-width": option('"8 mm"', "common face width of sun and planet gear", size="length", required=True),
}
WAYS: Mapping[str, tuple[float, ...]] = {"forward": (1.0,), "reverse": (-1.0,), "both": (1.0, -1.0)}
WAY: Mapping[str, Option] = {
    "--direction": choice(("forward", "reverse"), "forward", "direction of motion (default forward)")
}


@dataclass(frozen=True)
class Command:
    """A command, of the name of the function that does it, whose docstring is its help: a line for the list, the rest.

    Attributes
    ----------
    run : callable
        What does it, of options whose quantities are read and whose outputs can be written; `inputs` of them lists the
        files that are read, `outputs` those to write, and `as_written` has the quantities as given.
    example : str
        Arguments that show it at work, for its help.
    options : mapping of str to Option
        By their names with blanks between them.
    """

    run: Callable[[argparse.Namespace], None]
    example: str
    options: Mapping[str, Option]


def command(
    *, example: str, options: Mapping[str, Option]
) -> Callable[[Callable[[argparse.Namespace], None]], Command]:
    """Make a command of the function below."""
    return lambda run: Command(run, example, options)


def add_commands(commands: Any, module: Any) -> None:
    """Add the commands of a module to a parser's subparsers."""
    for one in vars(module).values():
        if isinstance(one, Command):
            add_command(commands, one)


def add_command(commands: Any, made: Command) -> None:
    """Add a command to a parser's subparsers."""
    name = made.run.__name__.strip("_").replace("_", "-")
    brief, _, does = inspect.cleandoc(made.run.__doc__ or "").partition("\n\n")
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=brief.rstrip(".").replace("%", "%%"),
        description=textwrap.fill(does, 79),
        epilog=f"example:\n  rverror {name} {made.example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    rows = {parser.add_argument(*names.split(), **row.given).dest: (names, row) for names, row in made.options.items()}

    def begin(given: argparse.Namespace) -> None:
        given.inputs, given.outputs, given.as_written = list[str](), list[str](), dict[str, Any]()
        for dest, (names, row) in rows.items():
            value = getattr(given, dest)
            if value is None:
                continue
            values = value if isinstance(value, list) else [value]
            for one in values:
                if isinstance(one, str) and not one.strip():
                    raise InputError(f"{names.split()[0]}: {one!r} has no name; give one")
            given.inputs += values if row.reads else []
            given.outputs += values if row.writes else []
            given.as_written[dest] = value
            read = [_checked(names.split()[0], one, row) for one in values]
            setattr(given, dest, read if isinstance(value, list) else read[0])
        check_outputs(given.outputs, given.inputs)
        if getattr(given, "plot", None):
            from rverror.views.plots.figure import bare_figure

            bare_figure(1.0, 1.0)  # refused where matplotlib is not installed
        if getattr(given, "xlsx", None):
            openpyxl_for(given.xlsx, "leave out --xlsx")
        made.run(given)

    parser.set_defaults(run=begin)


def _checked(name: str, value: Any, row: Option) -> Any:
    """Value of an option in the core unit, refused below the least."""
    if row.size and isinstance(value, str):
        return quantity(name, value, row.size, example=str(row.given["metavar"]).strip('"'), least=row.least)
    if row.least is not None and value < row.least:
        raise InputError(f"{name}: {value} is below {row.least:g}; give {row.least:g} or more")
    return value


def check_outputs(outputs: Sequence[str], inputs: Sequence[str]) -> None:
    """Refuse, before any work, files that no message can name and outputs that cannot be written."""
    for path in inputs:
        check_name(path)
    read = {os.path.realpath(path) for path in inputs}
    for path in outputs:
        folder = os.path.dirname(os.path.abspath(path))
        if os.path.realpath(path) in read:
            raise InputError(f"{path}: this output is also an input; choose another name")
        if not os.path.isdir(folder):
            raise InputError(f"{path}: there is no folder {folder}; make it first")
        if os.path.isdir(path):
            raise InputError(f"{path}: this is a folder; give a file")
        if os.path.exists(path) and not os.path.isfile(path):  # a device would be replaced by a file
            raise InputError(f"{path}: this is a device or pipe, no file; give a file")
        if not os.access(folder, os.W_OK):
            raise InputError(f"{path}: no permission to write in {folder}; choose another place")
    if (twice := given_twice(outputs)) is not None:
        raise InputError(f"{twice}: two outputs are this file, by name or by a link; give each its own")


def read_runs(options: argparse.Namespace, model: Model) -> tuple[list[Run | OrderTable], list[Run | OrderTable]]:
    """Runs to fit and those that no fit sees, of the options `RUNS` and `MAPPING`."""
    if (twice := given_twice([*options.runs, *options.validate])) is not None:
        raise InputError(f"{twice}: this run file is given twice; give each once, to fit or to --validate")
    mapping = given_mapping(options.mapping)
    fitted, unseen = ([load_run(path, model, mapping) for path in paths] for paths in (options.runs, options.validate))
    return fitted, unseen


def write_results(found: Any, options: argparse.Namespace, draw: Callable[[], Any] | None = None, **more: Any) -> None:
    """Print a result, or several of one kind, and write it as the options of `results` ask, with `more` told of it."""
    from rverror.views.report import to_text  # half of all modules

    print(to_text(found, **more), end="")
    save_results(found, options, draw, **more)


def save_results(found: Any, options: argparse.Namespace, draw: Callable[[], Any] | None = None, **more: Any) -> None:
    """Write a result as the options of `results` ask, with `more` told of it; `draw` makes axes of its own picture."""
    html, plot, xlsx = (getattr(options, name, None) for name in ("html", "plot", "xlsx"))
    if options.json or html or xlsx:
        from rverror.views.describing import input_files  # half of all modules
        from rverror.views.report import to_html, to_json, to_xlsx

        files = input_files(options.inputs)
        if options.json:
            write_json(options.json, to_json(found, files=files, **more))
        if html:
            write_output(html, to_html(found, files=files, **more))
        if xlsx:
            write_output(xlsx, to_xlsx(found, path=xlsx))
    if plot:
        from rverror.views.plots.figure import to_bytes  # loads matplotlib
        from rverror.views.plots.page_figures import figure_of

        write_output(plot, to_bytes(draw().figure if draw else figure_of(found, **more), "png"))


def save_with(options: argparse.Namespace, effects: Iterable[Effect]) -> None:
    """Write the model with more effects, as the option --save asks."""
    if options.save:
        say_replaced(options.save)
        save_model(options.save, load_model(options.model).with_effects(*map(rounded, effects)), overwrite=True)


def make_folder(path: str | Path, remedy: str) -> Path:
    """Make a folder for outputs; the remedy is told where that fails."""
    folder = Path(path)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as problem:
        reason = getattr(problem, "strerror", None) or problem
        raise InputError(f"{folder}: cannot make the folder ({reason}); {remedy}") from problem
    return folder


def write_output(path: str | Path, content: str | bytes) -> None:
    """Write an output, and tell where it replaces a file."""
    say_replaced(path)
    write_file(path, content, overwrite=True)


def write_text_output(path: str | None, text: str) -> None:
    """Write a text that a command is for, to standard output where there is no path."""
    if path is None:
        sys.stdout.write(text)
        return
    write_output(path, text)
    tell(f"wrote {path}")


def write_json(path: str | Path, content: Any) -> None:
    """Write a result for programs."""
    write_output(path, json.dumps(content, indent=1) + "\n")


def quantity(option: str, text: str, dimension: str, *, example: str, least: float | None = None) -> float:
    """Value of an option with a unit, in the core unit; refused with the option's name and how it is written."""
    try:
        value = units.InCore(units.parse(text, dimension))
    except ValueError as problem:
        raise InputError(f"{option}: {str(problem).partition(';')[0]}; write it like '{example}'") from problem
    if least is not None and value <= least:
        raise InputError(f"{option}: {text!r} is not above {least:g}; write it like '{example}'")
    return value


def refuse_given(options: argparse.Namespace, names: Iterable[str], why: str) -> None:
    """Refuse options that are given and would not be used."""
    for name in names:
        if getattr(options, name) is not None:
            raise InputError(f"--{name.replace('_', '-')}: {why}")


def made_of(kind: Callable[..., T], option: str, text: str, names: Sequence[str], *, example: str) -> T:
    """What an option says with commas between its sizes, which the kind takes by these names and checks."""
    parts, (*first, last) = text.split(","), names
    if len(parts) != len(names):
        raise InputError(f"{option}: {shown(text)} is not {', '.join(first)} and {last}; write it like '{example}'")
    with refusing(f"{option} {text!r}: ", f"; write it like '{example}'"):
        return kind(**dict(zip(names, parts, strict=True)))


def arm_option(what: str, more: str = "") -> dict[str, Option]:
    """Option that gives a load over the angle."""
    help_text = f"{what}: mass, lever arm, output angle at which the arm is level and forward motion lifts it{more}"
    return {"--arm": option(f'"{_ARM}"', help_text)}


def arm(text: str) -> GravityArm:
    """Arm of the option --arm."""
    return made_of(GravityArm, "--arm", text, ("mass", "lever", "offset"), example=_ARM)


#: Option for phases of a duty.
PHASES: Mapping[str, Option] = {
    "--phase": option(
        f'"{_PHASE}"',
        "phase of a repeated duty cycle, in place of a fixed load: output torque, input speed, time; repeat per phase",
        action="append",
    )
}


def duty_phases(texts: Sequence[str]) -> list[DutyPhase]:
    """Phases of a duty, each torque, speed and hours."""

    def phase(torque: Any, speed: Any, time: str) -> DutyPhase:
        return DutyPhase(torque=torque, speed=speed, hours=units.parse(time, "time") / 3600)

    return [made_of(phase, "--phase", text, ("torque", "speed", "time"), example=_PHASE) for text in texts]


def rounded(effect: Effect) -> Effect:
    """Effect with its sizes as a person would write them, far finer than any interval."""
    values = []
    for parameter, value in zip(source(effect.key).parameters, effect.values, strict=True):
        size = f"{units.to_display(value, parameter.dimension):.6g} {units.DISPLAY_UNITS[parameter.dimension]}"
        values.append(units.parse(size, parameter.dimension))
    return replace(effect, values=tuple(values))


def say_replaced(path: str | Path) -> None:
    """Tell that an output replaces a file."""
    if os.path.exists(path):
        tell(f"replacing {path}")


def tell(*texts: str) -> None:
    """Print notes on standard error."""
    for text in texts:
        print(f"rverror: {text}", file=sys.stderr)


def given_twice(paths: Sequence[str]) -> str | None:
    """First path that names the file of an earlier one."""
    real = [os.path.realpath(path) for path in paths]
    return next((path for i, path in enumerate(paths) if real[i] in real[:i]), None)
