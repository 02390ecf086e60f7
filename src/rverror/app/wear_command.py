"""Command that tells wear over hours of operation: wear."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any

from rverror.app.terminal import check_outputs, quantity, rounded, say_replaced, write_json, write_picture
from rverror.base.errors import InputError
from rverror.base.text import check_name, did_you_mean
from rverror.model.model_file import append_effects, load_model
from rverror.statics.worn_contacts import BODIES, PINS, WearCoefficients, wear
from rverror.views.envelope import input_files
from rverror.views.report import to_json, to_text

_DIRECTIONS = {"both": None, "forward": 1.0, "reverse": -1.0}


def add_commands(commands: Any) -> None:
    """Add the command to a parser's subparsers.

    Parameters
    ----------
    commands : argparse._SubParsersAction
    """
    command = commands.add_parser(
        "wear", help="wear of pins, discs and gears over hours, and the error that comes of it"
    )
    command.add_argument("model", metavar="MODEL.toml")
    command.add_argument("--torque", required=True, metavar='"412 N*m"', help="output torque of the duty")
    command.add_argument("--speed", required=True, metavar='"1815 rpm"', help="input speed of the duty")
    command.add_argument("--hours", required=True, type=float, metavar="N", help="hours of operation")
    command.add_argument(
        "--coefficient",
        action="append",
        required=True,
        metavar='"1e-10 mm^3/(N*m)"',
        help=f"Archard's, of all bodies; or of one, 'pin=2e-10 mm^3/(N*m)', again for more: {', '.join(BODIES)}",
    )
    command.add_argument("--disc-width", required=True, metavar='"9 mm"', help="length of a pin on one disc")
    command.add_argument("--gear-width", required=True, metavar='"8 mm"', help="length of a planet on the sun")
    command.add_argument("--pins", choices=PINS, default=PINS[0], help=f"in the housing (default {PINS[0]})")
    command.add_argument("--direction", choices=tuple(_DIRECTIONS), default="both", help="of the duty (default both)")
    command.add_argument("--json", metavar="OUT.json", help="write the result for programs")
    command.add_argument("--plot", metavar="OUT.png", help="write error and lost motion over the hours")
    command.add_argument("--save", metavar="NEW.toml", help="write the model as it is worn at the end")
    command.set_defaults(run=_wear)


def _wear(options: argparse.Namespace) -> None:
    check_name(options.model)
    check_outputs([options.json, options.plot, options.save], [options.model])
    model = load_model(options.model)
    try:
        found = wear(
            model,
            torque=quantity("--torque", options.torque, "torque", example="412 N*m"),
            speed=quantity("--speed", options.speed, "angular_speed", example="1815 rpm"),
            hours=options.hours,
            coefficients=_coefficients(options.coefficient),
            disc_width=quantity("--disc-width", options.disc_width, "length", example="9 mm"),
            gear_width=quantity("--gear-width", options.gear_width, "length", example="8 mm"),
            pins=options.pins,
            direction=_DIRECTIONS[options.direction],
        )
    except InputError:
        raise
    except ValueError as problem:
        raise InputError(str(problem)) from problem
    print(to_text(found), end="")
    if options.json:
        write_json(options.json, to_json(found, files=input_files([options.model])))
    if options.plot:
        write_picture(options.plot, found.plot().figure)
    if options.save:
        say_replaced(options.save)
        append_effects(options.model, options.save, [rounded(one) for one in found.effects], overwrite=True)


def _coefficients(given: Sequence[str]) -> WearCoefficients:
    """Coefficients of all bodies, then of those that are named."""
    sizes: dict[str, float] = {}
    for text in sorted(given, key=lambda one: "=" in one):
        body, equals, size = text.rpartition("=")
        if equals and body.strip() not in BODIES:
            hint = did_you_mean(body.strip(), BODIES) or f" give one of {', '.join(BODIES)}"
            raise InputError(f"--coefficient {text!r}: no body {body.strip()!r};{hint}")
        value = quantity("--coefficient", size, "wear_coefficient", example="1e-10 mm^3/(N*m)")
        sizes |= dict.fromkeys([body.strip()] if equals else BODIES, value)
    return WearCoefficients(**sizes)
