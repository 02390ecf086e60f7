"""Command that tells wear over hours of operation: wear."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from typing import Any

from rverror.app.terminal import (
    add_command,
    add_phases,
    add_results,
    check_results,
    duty_phases,
    quantity,
    rounded,
    say_replaced,
    write_results,
)
from rverror.base.errors import InputError
from rverror.base.text import check_name, did_you_mean
from rverror.model.model_file import append_effects, load_model
from rverror.statics.worn_contacts import BODIES, JOINTS, PINS, RunningIn, WearCoefficients, wear
from rverror.views.report import to_text

_DIRECTIONS = {"both": None, "forward": 1.0, "reverse": -1.0}
_COEFFICIENT = "1e-10 mm^3/(N*m)"


def add_commands(commands: Any) -> None:
    """Add the command to a parser's subparsers.

    Parameters
    ----------
    commands : argparse._SubParsersAction
    """
    command = add_command(
        commands,
        "wear",
        brief="wear of pins, discs and gears over hours of operation",
        does="Computes how pins, discs, gears and bearings wear over hours of operation, and the output error and lost "
        "motion that follow. The wear coefficients are yours to give; none are assumed.",
        example='unit.toml --torque "412 N*m" --speed "1815 rpm" --hours 6000 \\\n'
        '    --coefficient "1e-10 mm^3/(N*m)" --disc-width "9 mm" --gear-width "8 mm"',
    )
    command.add_argument("model", metavar="MODEL.toml")
    command.add_argument("--torque", metavar='"412 N*m"', help="output torque of the duty")
    command.add_argument("--speed", metavar='"1815 rpm"', help="input speed of the duty")
    add_phases(command)
    command.add_argument("--hours", required=True, type=float, metavar="N", help="hours of operation")
    command.add_argument(
        "--coefficient",
        action="append",
        required=True,
        metavar='"1e-10 mm^3/(N*m)"',
        help=f"Archard's wear coefficient of all bodies, or of one as 'pin=2e-10 mm^3/(N*m)' ({', '.join(BODIES)}); of "
        f"a joint the clearance gained per load and turn, 'spline=1e-8 um/kN' ({', '.join(JOINTS)}). Give it again for "
        "more",
    )
    command.add_argument(
        "--running-in",
        action="append",
        default=[],
        metavar='"0.5 um, 1e-8 mm^3/(N*m)"',
        help="running in: depth of the roughness that wears off and wear coefficient of the new surface, of all bodies "
        "or of one as 'pin=0.5 um, 1e-8 mm^3/(N*m)'. Give it again for more",
    )
    command.add_argument("--disc-width", required=True, metavar='"9 mm"', help="contact length of a pin on one disc")
    command.add_argument(
        "--gear-width", required=True, metavar='"8 mm"', help="contact length of a planet gear on the sun"
    )
    command.add_argument(
        "--pins", choices=PINS, default=PINS[0], help=f"whether pins turn in the housing (default {PINS[0]})"
    )
    command.add_argument(
        "--direction", choices=tuple(_DIRECTIONS), default="both", help="direction of the duty (default both)"
    )
    add_results(command, plot="error and lost motion over the hours")
    command.add_argument("--save", metavar="NEW.toml", help="write the model of the worn unit")
    command.set_defaults(run=_wear)


def _wear(options: argparse.Namespace) -> None:
    check_name(options.model)
    check_results(options, [options.model])
    model = load_model(options.model)
    try:
        found = wear(
            model,
            **_duty(options),
            hours=options.hours,
            coefficients=_coefficients(options.coefficient),
            running_in=_running_in(options.running_in),
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
    write_results(found, options, found.plot, [options.model])
    if options.save:
        say_replaced(options.save)
        append_effects(options.model, options.save, [rounded(one) for one in found.effects], overwrite=True)


def _duty(options: argparse.Namespace) -> dict[str, Any]:
    if options.phase and not (options.torque or options.speed):
        return {"duty": duty_phases(options.phase)}
    if options.phase or not (options.torque and options.speed):
        raise InputError("wear: give --torque and --speed, or --phase in place of both")
    return {
        "torque": quantity("--torque", options.torque, "torque", example="412 N*m"),
        "speed": quantity("--speed", options.speed, "angular_speed", example="1815 rpm"),
    }


def _by_body(option: str, given: Sequence[str], known: Sequence[str]) -> Iterator[tuple[list[str], str]]:
    """Bodies and what is said of them, first of all, then of those that are named."""
    for text in sorted(given, key=lambda one: "=" in one):
        body, equals, said = text.rpartition("=")
        if equals and body.strip() not in known:
            hint = did_you_mean(body.strip(), known) or f" give one of {', '.join(known)}"
            raise InputError(f"{option} {text!r}: no body {body.strip()!r};{hint}")
        yield ([body.strip()] if equals else list(BODIES)), said


def _coefficients(given: Sequence[str]) -> WearCoefficients:
    sizes: dict[str, float] = {}
    for names, text in _by_body("--coefficient", given, (*BODIES, *JOINTS)):
        joint = names[0] in JOINTS
        dimension, example = ("contact_compliance", "1e-8 um/kN") if joint else ("wear_coefficient", _COEFFICIENT)
        sizes |= dict.fromkeys(names, quantity("--coefficient", text, dimension, example=example))
    return WearCoefficients(**sizes)


def _running_in(given: Sequence[str]) -> dict[str, RunningIn]:
    rough: dict[str, RunningIn] = {}
    for names, text in _by_body("--running-in", given, BODIES):
        depth, _, speed = text.partition(",")
        example = f"0.5 um, {_COEFFICIENT}"
        one = RunningIn(
            depth=quantity("--running-in", depth, "length", example=example),
            coefficient=quantity("--running-in", speed, "wear_coefficient", example=example),
        )
        rough |= dict.fromkeys(names, one)
    return rough
