"""What all commands share: options, outputs that are refused before any work, progress and notes on standard error."""

from __future__ import annotations

import argparse
import json
import os
import sys
import textwrap
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

from rverror.base import units
from rverror.base.errors import InputError
from rverror.base.text import check_name, shown, write_bytes, write_text
from rverror.geartrain.torque_over_turn import GravityArm
from rverror.model.catalogue import source
from rverror.model.effects import Effect
from rverror.model.model_file import append_effects
from rverror.statics.duty import DutyPhase

_ARM = "20 kg, 0.5 m, 30 deg"
_PHASE = "412 N*m, 1815 rpm, 3 h"
#: Options that name a file to write.
_OUTPUTS = ("json", "html", "plot", "save", "csv", "compress")


class Progress:
    """Progress on standard error once it takes over two seconds: one line on a terminal, else a line now and then.

    With `terminal_only` nothing is told where standard error is no terminal.
    """

    def __init__(self, *, terminal_only: bool = False) -> None:
        """Start the clock."""
        self.start = self.last = time.monotonic()
        self.terminal = sys.stderr.isatty()
        self.silent = terminal_only and not self.terminal

    def __call__(self, text: str) -> None:
        """Tell what is being done."""
        now = time.monotonic()
        if self.silent or now - self.start < 2 or (not self.terminal and now - self.last < 2):
            return
        self.last = now
        line = f"[{now - self.start:4.0f} s] {text}"
        if self.terminal:
            print(f"\r{line[:100]:<100}", end="", file=sys.stderr, flush=True)
        else:
            print(line, file=sys.stderr, flush=True)

    def close(self) -> None:
        """Clear the line."""
        if self.terminal and self.last > self.start:
            print(f"\r{'':<100}\r", end="", file=sys.stderr, flush=True)


def option(
    metavar: str | tuple[str, ...] | None = None,
    help: str | None = None,
    *,
    size: str = "",
    reads: bool = False,
    **more: Any,
) -> dict[str, Any]:
    """One entry of the table of options that `add_command` takes.

    Parameters
    ----------
    metavar, help
        For argparse.
    size : str
        Dimension of a quantity, written as `metavar` shows: the command gets its value in the core unit.
    reads : bool
        Whether it names files that are read: no output may be one of them.
    **more
        For argparse.
    """
    return {"metavar": metavar, "help": help, "size": size, "reads": reads, **more}


def flag(help: str) -> dict[str, Any]:
    """Option that is given or not."""
    return {"help": help, "action": "store_true"}


def choice(choices: Iterable[str], default: str, help: str | None = None) -> dict[str, Any]:
    """Option that is one of some words."""
    return {"help": help, "choices": tuple(choices), "default": default}


def output(metavar: str, help: str, **more: Any) -> dict[str, Any]:
    """Option for the file or folder that a command is for."""
    return {"-o --output --out": option(metavar, help, **more)}


def results(*, plot: str | None = None, html: bool = True) -> dict[str, Any]:
    """Options that write a result: JSON, a page, and a picture where `plot` says of what."""
    found = {"--json": option("OUT.json", "write the result as JSON")}
    if html:
        found["--html --report"] = option("OUT.html", "write one self-contained page with tables and pictures")
    if plot is not None:
        found["--plot"] = option("OUT.png", f"draw {plot}")
    return found


#: Options that several commands have, for their tables.
MODEL: Mapping[str, Any] = {"model": option("MODEL.toml", reads=True)}
RUNS: Mapping[str, Any] = {
    "runs": option("RUN.csv", nargs="+", reads=True),
    "--validate": option(
        "FILE", "runs or order tables kept out of the fit, to test the result on", reads=True, nargs="+", default=[]
    ),
}
MAPPING: Mapping[str, Any] = {
    "--mapping": option("BENCH.toml", "mapping file: the bench's names of its columns, and their units", reads=True)
}
PROGRESS: Mapping[str, Any] = {"--progress": flag("show progress also where standard error is no terminal")}
WIDTHS: Mapping[str, Any] = {
    "--disc-width": option('"9 mm"', "contact length of a pin on one disc", size="length", required=True),
    "--gear-width": option('"8 mm"', "contact length of a planet gear on the sun", size="length", required=True),
}
WAYS: Mapping[str, tuple[float, ...]] = {"forward": (1.0,), "reverse": (-1.0,), "both": (1.0, -1.0)}
WAY: Mapping[str, Any] = {"--direction": choice(("forward", "reverse"), "forward")}


def add_command(
    commands: Any,
    name: str,
    *,
    brief: str,
    does: str,
    example: str,
    run: Callable[[argparse.Namespace], None],
    options: Mapping[str, Mapping[str, Any]],
) -> None:
    """Add a command.

    Parameters
    ----------
    commands : argparse._SubParsersAction
    name : str
    brief : str
        A line for the list of all commands.
    does : str
        What it does, in sentences, for its own help.
    example : str
        Arguments that show it at work, for its own help.
    run : callable
        What does it, of options whose quantities are read and whose outputs can be written; `inputs` of them lists the
        files that are read, and `as_written` has the quantities as given.
    options : mapping of str to mapping
        Each as `option` makes it, by its names with blanks between them.
    """
    parser: argparse.ArgumentParser = commands.add_parser(
        name,
        help=brief,
        description=textwrap.fill(does, 79),
        epilog=f"example:\n  rverror {name} {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    read, sized = list[str](), dict[str, tuple[str, str, str]]()
    for names, row in options.items():
        said = dict(row)
        size, reads = said.pop("size", ""), said.pop("reads", False)
        action = parser.add_argument(*names.split(), **said)
        read += [action.dest] if reads else []
        if size:
            sized[action.dest] = names.split()[0], size, str(action.metavar).strip('"')

    def begin(given: argparse.Namespace) -> None:
        files = [getattr(given, dest) or () for dest in read]
        given.inputs = [path for some in files for path in ([some] if isinstance(some, str) else some)]
        check_results(given, given.inputs)
        given.as_written = {dest: getattr(given, dest) for dest in sized}
        for dest, (named, dimension, written) in sized.items():
            text = given.as_written[dest]
            if isinstance(text, str):
                setattr(given, dest, quantity(named, text, dimension, example=written))
            elif text:
                setattr(given, dest, [quantity(named, one, dimension, example=written) for one in text])
        run(given)

    parser.set_defaults(run=begin)


def check_results(options: argparse.Namespace, inputs: Sequence[str]) -> None:
    """Refuse, before any work, files that no message can name, outputs that cannot be written, and a picture without
    what draws it.
    """
    for path in inputs:
        check_name(path)
    check_outputs([getattr(options, name, None) for name in _OUTPUTS], inputs)
    if getattr(options, "plot", None):
        from rverror.views.plots.figure import check_axes

        check_axes(None)


def write_results(found: Any, options: argparse.Namespace, draw: Callable[[], Any] | None = None) -> None:
    """Print a result, or several of one kind, and write it as the options of `results` ask."""
    from rverror.views.report import to_text  # half of all modules

    print(to_text(found), end="")
    save_results(found, options, draw)


def save_results(found: Any, options: argparse.Namespace, draw: Callable[[], Any] | None = None, **more: Any) -> None:
    """Write a result, or several of one kind, as the options of `results` ask; with `more` told of it."""
    from rverror.views.envelope import input_files  # half of all modules
    from rverror.views.report import to_html, to_json

    files = input_files(options.inputs) if options.json or getattr(options, "html", None) else ()
    if options.json:
        write_json(options.json, to_json(found, files=files, **more))
    if getattr(options, "html", None):
        write_output(options.html, to_html(found, files=files, **more))
    if draw is not None and options.plot:
        write_picture(options.plot, draw().figure)


def save_model(options: argparse.Namespace, effects: Iterable[Effect]) -> None:
    """Write the model with more effects, as the option --save asks."""
    if options.save:
        say_replaced(options.save)
        append_effects(options.model, options.save, [rounded(effect) for effect in effects], overwrite=True)


@contextmanager
def named(what: str = "") -> Iterator[None]:
    """Turn a refused value into a line that begins with the file or option it came from."""
    try:
        yield
    except InputError:
        raise
    except ValueError as problem:
        raise InputError(f"{what}: {problem}" if what else str(problem)) from problem


def check_output(path: str | None, inputs: Sequence[str]) -> None:
    """Refuse, before any work, an output that is an input or has no folder."""
    if path is None:
        return
    if not path.strip():
        raise InputError(f"{path!r}: this output has no name; give a file")
    if os.path.realpath(path) in {os.path.realpath(item) for item in inputs}:
        raise InputError(f"{path}: this output is also an input; choose another name")
    folder = os.path.dirname(os.path.abspath(path))
    if not os.path.isdir(folder):
        raise InputError(f"{path}: there is no folder {folder}; make it first")
    if os.path.isdir(path):
        raise InputError(f"{path}: this is a folder; give a file")
    if os.path.exists(path) and not os.path.isfile(path):  # a device would be replaced by a file
        raise InputError(f"{path}: this is a device or pipe, no file; give a file")
    if not os.access(folder, os.W_OK):
        raise InputError(f"{path}: no permission to write in {folder}; choose another place")


def check_jobs(jobs: int | None, what: str) -> None:
    """Refuse a number of threads or processes that do no work."""
    if jobs is not None and jobs < 1:
        raise InputError(f"--jobs: {jobs} {what} cannot work; give 1 or more")


def check_outputs(outputs: Sequence[str | None], inputs: Sequence[str]) -> None:
    """Refuse, before any work, outputs that cannot be written, or that share a name."""
    for output in outputs:
        check_output(output, inputs)
    if (twice := given_twice([output for output in outputs if output is not None])) is not None:
        raise InputError(f"{twice}: two outputs share this name; give each its own")


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
    if isinstance(content, str):
        write_text(path, content, overwrite=True)
    else:
        write_bytes(path, content, overwrite=True)


def write_json(path: str | Path, content: Any) -> None:
    """Write a result for programs."""
    write_output(path, json.dumps(content, indent=1) + "\n")


def write_picture(path: str | Path, figure: Any) -> None:
    """Write a figure as PNG."""
    from rverror.views.plots.figure import to_bytes  # loads matplotlib

    write_output(path, to_bytes(figure, "png"))


def quantity(option: str, text: str, dimension: str, *, example: str) -> float:
    """Value of an option with a unit, in the core unit; refused with the option's name and how it is written."""
    try:
        return units.InCore(units.parse(text, dimension))
    except ValueError as problem:
        raise InputError(f"{option}: {str(problem).partition(';')[0]}; write it like '{example}'") from problem


def arm_option(what: str, more: str = "") -> dict[str, Any]:
    """Option that gives a load over the angle."""
    told = f"{what}: mass, lever arm, output angle at which the arm is level and forward motion lifts it{more}"
    return {"--arm": option(f'"{_ARM}"', told)}


def arm(text: str) -> GravityArm:
    """Arm of the option --arm."""
    try:
        mass, lever, offset = text.split(",")
        return GravityArm(
            mass=units.parse(mass.strip(), "mass"),
            lever=units.parse(lever.strip(), "length"),
            offset=units.parse(offset.strip(), "angle"),
        )
    except ValueError as problem:
        what = str(problem).partition(";")[0] if text.count(",") == 2 else f"{shown(text)} has not three parts"
        raise InputError(f"--arm: {what}; write mass, lever and angle like '{_ARM}'") from problem


#: Option for phases of a duty.
PHASES: Mapping[str, Any] = {
    "--phase": option(
        f'"{_PHASE}"',
        "one phase of a duty cycle, in place of --torque: output torque, input speed, hours; give it again for each "
        "phase",
        action="append",
    )
}


def duty_phases(texts: Sequence[str]) -> list[DutyPhase]:
    """Phases of a duty, each torque, speed and hours."""
    phases = []
    for text in texts:
        parts = text.split(",")
        if len(parts) != 3:
            raise InputError(f"--phase: {text!r} is not torque, speed and time; write it like '{_PHASE}'")
        torque, speed, time_ = (
            quantity("--phase", part, dimension, example=_PHASE)
            for part, dimension in zip(parts, ("torque", "angular_speed", "time"), strict=True)
        )
        try:
            phases.append(DutyPhase(torque=torque, speed=speed, hours=time_ / 3600))
        except ValueError as problem:
            raise InputError(f"--phase {text!r}: {problem}; write it like '{_PHASE}'") from problem
    return phases


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


def tell(text: str) -> None:
    """Print a note on standard error."""
    print(f"rverror: {text}", file=sys.stderr)


def given_twice(paths: Sequence[str]) -> str | None:
    """First path that names the file of an earlier one."""
    real = [os.path.realpath(path) for path in paths]
    return next((path for i, path in enumerate(paths) if real[i] in real[:i]), None)
