"""Commands that work on the dynamics of a reducer: modes and speeds."""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from rverror.app.terminal import add_command, add_results, check_results, quantity, write_results
from rverror.base.errors import InputError
from rverror.base.text import check_name
from rverror.dynamics.at_speed import speed_response
from rverror.dynamics.natural_modes import modes
from rverror.model.effects import Model
from rverror.model.model_file import load_model
from rverror.views.report import to_text

COUNT = 100  # speeds


def add_commands(commands: Any) -> None:
    """Add the commands to a parser's subparsers.

    Parameters
    ----------
    commands : argparse._SubParsersAction
    """
    command = add_command(
        commands,
        "modes",
        brief="natural frequencies of the loaded gear train",
        does="Computes the natural frequencies of the loaded gear train with the inertia at its ends, their damping, "
        "the contact that holds each mode and the part that moves most in it.",
        example='unit.toml --torque "100 N*m" --plot modes.png',
    )
    _add_state(command, plot="the shape of the lowest mode of the machine")
    command.add_argument("--angle", default="0 deg", metavar='"12 deg"', help="output angle (default 0 deg)")
    command.set_defaults(run=_modes)

    command = add_command(
        commands,
        "speeds",
        brief="output error against input speed, by order, and critical speeds",
        does="Computes the output error against the input speed, by order, and the speeds at which an order meets a "
        "natural frequency. Orders are per output turn and reach up to half the samples of a turn (2048 for an "
        "RV-40E). Higher ones appear folded: 976, 584 and 1952 are the waves 3120, 4680 and 6240 of its cycloid "
        "mesh.",
        example='unit.toml --from "60 rpm" --to "1800 rpm" --plot speeds.png',
    )
    _add_state(command, plot="the amplitudes of the largest orders against the speed")
    command.add_argument("--from", dest="first", required=True, metavar='"100 rpm"', help="lowest input speed")
    command.add_argument("--to", dest="last", required=True, metavar='"1800 rpm"', help="highest input speed")
    command.add_argument("--count", type=int, default=COUNT, metavar="N", help=f"number of speeds (default {COUNT})")
    command.add_argument(
        "--by-effect",
        action="store_true",
        help="with --json: also what each declared error does, by order at each speed",
    )
    command.set_defaults(run=_speeds)


def _add_state(command: argparse.ArgumentParser, *, plot: str) -> None:
    command.add_argument("model", metavar="MODEL.toml")
    command.add_argument("--torque", metavar='"20 N*m"', help="output torque (default: the rated one)")
    command.add_argument("--direction", choices=("forward", "reverse"), default="forward")
    add_results(command, plot=plot)


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
    check_results(options, [options.model])
    torque = None if options.torque is None else quantity("--torque", options.torque, "torque", example="20 N*m")
    return load_model(options.model), {"torque": torque, "direction": 1.0 if options.direction == "forward" else -1.0}


def _tell(found: Any, options: argparse.Namespace) -> None:
    print(to_text(found), end="")
    write_results(found, options, found.plot, [options.model])
