"""Commands that work on the dynamics of a reducer: modes and speeds."""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from rverror.app.terminal import check_outputs, quantity, write_json
from rverror.base.errors import InputError
from rverror.base.text import check_name
from rverror.dynamics.at_speed import speed_response
from rverror.dynamics.natural_modes import modes
from rverror.model.effects import Model
from rverror.model.model_file import load_model
from rverror.views.envelope import input_files
from rverror.views.report import to_json, to_text

COUNT = 100  # speeds


def add_commands(commands: Any) -> None:
    """Add the commands to a parser's subparsers.

    Parameters
    ----------
    commands : argparse._SubParsersAction
    """
    command = commands.add_parser("modes", help="natural frequencies about a loaded state")
    _add_state(command)
    command.add_argument("--angle", default="0 deg", metavar='"12 deg"', help="output angle (default 0 deg)")
    command.set_defaults(run=_modes)

    command = commands.add_parser("speeds", help="output error against input speed, by order, and critical speeds")
    _add_state(command)
    command.add_argument("--from", dest="first", required=True, metavar='"100 rpm"', help="lowest input speed")
    command.add_argument("--to", dest="last", required=True, metavar='"1800 rpm"', help="highest input speed")
    command.add_argument("--count", type=int, default=COUNT, metavar="N", help=f"of even speeds (default {COUNT})")
    command.add_argument(
        "--by-effect", action="store_true", help="with --json: what each effect does, by order at each speed"
    )
    command.set_defaults(run=_speeds)


def _add_state(command: argparse.ArgumentParser) -> None:
    command.add_argument("model", metavar="MODEL.toml")
    command.add_argument("--torque", metavar='"20 N*m"', help="output torque (default: the rated one)")
    command.add_argument("--direction", choices=("forward", "reverse"), default="forward")
    command.add_argument("--json", metavar="OUT.json", help="write the result for programs")


def _modes(options: argparse.Namespace) -> None:
    model, state = _state(options)
    found = modes(model, theta=quantity("--angle", options.angle, "angle", example="12 deg"), **state)
    _tell(found, options)


def _speeds(options: argparse.Namespace) -> None:
    first, last = (
        quantity(name, text, "angular_speed", example="100 rpm")
        for name, text in (("--from", options.first), ("--to", options.last))
    )
    if not 0 <= first < last:
        raise InputError(f"--from {options.first!r} --to {options.last!r}: speeds must grow from 0 or more")
    if options.count < 2:
        raise InputError(f"--count: {options.count} is below 2; give 2 speeds or more")
    model, state = _state(options)
    speeds = np.linspace(first, last, options.count)
    _tell(speed_response(model, speeds, by_effect=options.by_effect, **state), options)


def _state(options: argparse.Namespace) -> tuple[Model, dict[str, Any]]:
    """Model, torque and direction, once the output is known to be usable."""
    check_name(options.model)
    check_outputs([options.json], [options.model])
    torque = None if options.torque is None else quantity("--torque", options.torque, "torque", example="20 N*m")
    return load_model(options.model), {"torque": torque, "direction": 1.0 if options.direction == "forward" else -1.0}


def _tell(found: Any, options: argparse.Namespace) -> None:
    print(to_text(found), end="")
    if options.json:
        write_json(options.json, to_json(found, files=input_files([options.model])))
