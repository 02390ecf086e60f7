"""Command that tells wear over hours of operation: wear."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from typing import Any

from rverror.app.terminal import (
    MODEL,
    PHASES,
    WIDTHS,
    choice,
    command,
    duty_phases,
    made_of,
    option,
    results,
    save,
    save_with,
    write_results,
)
from rverror.base.directions import DIRECTIONS
from rverror.base.errors import InputError, refusing
from rverror.base.text import did_you_mean
from rverror.model.model_file import load_model
from rverror.statics.worn_contacts import BODIES, JOINTS, PINS, RunningIn, WearCoefficients, wear

_COEFFICIENT = "1e-10 mm^3/(N*m)"
_ROUGHNESS = f"0.5 um, {_COEFFICIENT}"


@command(
    example='unit.toml --torque "412 N*m" --speed "1815 rpm" --hours 6000 \\\n'
    '    --coefficient "1e-10 mm^3/(N*m)" --disc-width "9 mm" --gear-width "8 mm"',
    options={
        **MODEL,
        "--torque": option('"412 N*m"', "output torque of the duty", size="torque"),
        "--speed": option('"1815 rpm"', "input speed of the duty", size="angular_speed"),
        **PHASES,
        "--hours": option("N", "hours of operation in all, shared by the phases", required=True, type=float),
        "--coefficient": option(
            f'"{_COEFFICIENT}"',
            f"Archard's wear coefficient of all bodies ({', '.join(BODIES)}) or of one: 'pin=2e-10 mm^3/(N*m)'. A "
            f"bearing or spline ({', '.join(JOINTS)}) wears only if you give the clearance that it gains per unit "
            "load and crank turn: 'spline=1e-8 um/kN'. Repeat the option for more",
            action="append",
            required=True,
        ),
        "--running-in": option(
            '"0.5 um, 1e-8 mm^3/(N*m)"',
            "running in: depth of roughness that wears off, and by how much the wear coefficient is higher at first; "
            "for all bodies or for one: 'pin=0.5 um, 1e-8 mm^3/(N*m)'. Repeat it for more",
            action="append",
            default=[],
        ),
        **WIDTHS,
        "--pins": choice(PINS, PINS[0], f"whether pins turn in the housing (default {PINS[0]})"),
        "--direction": choice(("both", *DIRECTIONS), "both", "direction of motion (default both)"),
        **results(plot="error and lost motion over the hours"),
        **save("NEW.toml", "write the model of the worn unit"),
    },
)
def _wear(options: argparse.Namespace) -> None:
    """Wear of pins, discs, gears and bearings over hours of operation.

    Computes how pins, discs, gears and bearings wear over hours of operation, and the output error and lost motion
    that follow. You give the wear coefficients; none are assumed.
    """
    model = load_model(options.model)
    with refusing(""):
        found = wear(
            model,
            **_duty(options),
            hours=options.hours,
            coefficients=_coefficients(options.coefficient),
            running_in=_running_in(options.running_in),
            disc_width=options.disc_width,
            gear_width=options.gear_width,
            pins=options.pins,
            direction=None if options.direction == "both" else options.direction,
        )
    write_results(found, options)
    save_with(options, found.effects)


def _duty(options: argparse.Namespace) -> dict[str, Any]:
    """What the duty options give to `wear`."""
    both = options.torque is not None and options.speed is not None
    if options.phase and options.torque is options.speed is None:
        return {"duty": duty_phases(options.phase)}
    if options.phase or not both:
        raise InputError("wear: give --torque and --speed, or --phase in place of both")
    return {"torque": options.torque, "input_speed": options.speed}


def _by_body(option: str, given: Sequence[str], known: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Bodies and what is said of each, first of all, then of those that are named."""
    for text in sorted(given, key=lambda one: "=" in one):
        body, equals, said = text.rpartition("=")
        if equals and body.strip() not in known:
            hint = did_you_mean(body.strip(), known) or f" give one of {', '.join(known)}"
            raise InputError(f"{option} {text!r}: no body {body.strip()!r};{hint}")
        yield from ((name, said) for name in ([body.strip()] if equals else BODIES))


def _coefficients(given: Sequence[str]) -> WearCoefficients:
    sizes: dict[str, Any] = dict(_by_body("--coefficient", given, (*BODIES, *JOINTS)))
    with refusing("--coefficient: "):
        return WearCoefficients(**sizes)


def _running_in(given: Sequence[str]) -> dict[str, RunningIn]:
    option, parts = "--running-in", ("depth", "coefficient")
    return {
        body: made_of(RunningIn, option, text, parts, example=_ROUGHNESS)
        for body, text in _by_body(option, given, BODIES)
    }
