"""Command line: exit 0 done, 2 bad input with one line that names what, where and the remedy."""

from __future__ import annotations

import argparse
import io
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from itertools import chain
from typing import NoReturn

from rverror.app.terminal import add_commands
from rverror.base.errors import InputError
from rverror.base.memory import keep_freed_memory
from rverror.base.version import __version__
from rverror.statics.loaded_state import NotConvergedError

#: Commands of each file of commands, as help lists them.  A file is loaded for its own: a diagnosis would wait for the
#: classes of all other results.
COMMANDS = {
    "model_commands": ("simulate", "sources"),
    "diagnosis_commands": ("diagnose", "diagnose-batch", "demo"),
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
    if arguments is None:  # the process is the command's own
        keep_freed_memory()
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


def parser_of(name: str) -> argparse.ArgumentParser:
    """Parser of the command that is asked for, and those beside it; of all where it is none."""
    known = set(chain.from_iterable(COMMANDS.values()))
    parser = _Parser(
        prog="rverror",
        description="Predict the output error (transmission error) of RV reducers from part errors, and find "
        "the causes of a measured output error.",
    )
    parser.add_argument("--version", action="version", version=f"rverror {__version__}")
    commands = parser.add_subparsers(title="commands", required=True, metavar="COMMAND")

    for module, names in COMMANDS.items():
        if name in names or name not in known:
            add_commands(commands, import_module(f"rverror.app.{module}"))

    return parser
