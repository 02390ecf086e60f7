"""Commands on what contacts of a reducer do under load: what friction takes, and how hard they press."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from rverror.app.terminal import (
    add_command,
    add_phases,
    add_results,
    check_results,
    duty_phases,
    quantity,
    rounded,
    say_replaced,
    tell,
    write_results,
)
from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.numbers import with_unit
from rverror.base.text import check_name
from rverror.geartrain.mechanism import Reducer
from rverror.model.effects import Model
from rverror.model.model_file import append_effects, load_model
from rverror.statics.duty import Lubricant, duty_efficiency
from rverror.statics.friction import Efficiency, efficiency, hysteresis
from rverror.statics.hertz import RollerBearing, contact_pressure
from rverror.views.report import to_text

#: Even angles of an output turn: no divisor of the waves that pins and discs make, and for pressures fine enough for
#: what single pins do.
EFFICIENCY_ANGLES, PRESSURE_ANGLES = 101, 800
_WAYS = {"forward": (1.0,), "reverse": (-1.0,), "both": (1.0, -1.0)}
_SIDES = {"input": ("input",), "output": ("output",), "both": ("input", "output")}
#: Of the largest torque of a loop: denser where play and drag bend it.
_SHARES = (0.005, 0.01, 0.02, 0.03, 0.06, 0.12, 0.25, 0.5, 0.75, 1.0)
_LOST_MOTION = 0.03  # of the rated torque, at which makers read it


#: Options of a duty's heat: name, dimension, how it is written, what it is.
_HEAT = (
    (
        "thermal-resistance",
        "thermal_resistance",
        "0.3 K/W",
        "thermal resistance from the housing to the surroundings (default 0)",
    ),
    (
        "inside-resistance",
        "thermal_resistance",
        "0.1 K/W",
        "thermal resistance from the inside to the housing (default 0)",
    ),
    ("ambient", "temperature", "20 degC", "temperature of the surroundings (default 20 degC)"),
    ("temperature", "temperature", "50 degC", "temperature of the whole unit, if it is known"),
)
#: What `--lubricant` takes, in order: dimension, and how it is written.
_OIL = {
    "viscosity_40": ("viscosity", "150 cSt"),
    "viscosity_100": ("viscosity", "15 cSt"),
    "temperature": ("temperature", "20 degC"),
    "speed": ("angular_speed", "1815 rpm"),
}


def add_commands(commands: Any) -> None:
    """Add the commands to a parser's subparsers.

    Parameters
    ----------
    commands : argparse._SubParsersAction
    """
    command = add_command(
        commands,
        "efficiency",
        brief="friction losses by part, and the input torque",
        does="Computes the power lost to friction in pins, gear flanks and bearings, part by part, and the torque"
        " at the input. The coefficients of friction come from [reducer.friction] of the model file.",
        example='unit.toml --torque "412 N*m" --torque "20 N*m"',
    )
    command.add_argument("model", metavar="MODEL.toml", help="with [reducer.friction]")
    command.add_argument(
        "--torque",
        action="append",
        metavar='"20 N*m"',
        help="output torque (default: the rated one); give it again for more",
    )
    command.add_argument(
        "--drives", choices=tuple(_SIDES), default="both", help="side from which the power comes (default both)"
    )
    command.add_argument("--direction", choices=tuple(_WAYS), default="forward")
    add_phases(command)
    for option, _, example, told in _HEAT:
        command.add_argument(f"--{option}", metavar=f'"{example}"', help=f"with --phase: {told}")
    command.add_argument(
        "--lubricant",
        nargs=4,
        metavar=("AT_40", "AT_100", "TEMPERATURE", "SPEED"),
        help="with --phase: viscosity of the oil at 40 and 100 degC, and the temperature and input speed for which the "
        'drag is given; like "150 cSt" "15 cSt" "20 degC" "1815 rpm"',
    )
    command.add_argument("--save", metavar="NEW.toml", help="with --phase: write the model of the warm unit")
    _add_angles(command, EFFICIENCY_ANGLES)
    add_results(command, plot="the friction losses by part")
    command.set_defaults(run=_efficiency)

    command = add_command(
        commands,
        "hysteresis",
        brief="loop of the torsion curve, input held",
        does="Computes how far the output turns as the torque on it rises and falls with the input held: the width of "
        "the loop and the lost motion.",
        example='unit.toml --torque "412 N*m" --plot loop.png',
    )
    command.add_argument("model", metavar="MODEL.toml", help="with [reducer.friction]")
    command.add_argument("--torque", metavar='"412 N*m"', help="largest output torque (default: the rated one)")
    command.add_argument("--angle", default="0 deg", metavar='"12 deg"', help="output angle (default 0 deg)")
    add_results(command, plot="the loop")
    command.set_defaults(run=_hysteresis)

    command = add_command(
        commands,
        "pressure",
        brief="contact pressure of pins, gear flanks and bearings",
        does="Computes the contact pressure of pins, gear flanks and, where their rollers are given, crank bearings, "
        "and at which output angle it is highest.",
        example='unit.toml --disc-width "9 mm" --gear-width "8 mm"',
    )
    command.add_argument("model", metavar="MODEL.toml")
    command.add_argument("--disc-width", required=True, metavar='"9 mm"', help="contact length of a pin on one disc")
    command.add_argument(
        "--gear-width", required=True, metavar='"8 mm"', help="contact length of a planet gear on the sun"
    )
    for bearing, place in (("cam", "discs"), ("carrier", "carrier")):
        command.add_argument(
            f"--{bearing}-bearing",
            nargs=4,
            metavar=("ROLLERS", "DIAMETER", "LENGTH", "RACE"),
            help=f"bearing of the cranks in the {place}: number of rollers, their diameter and length, diameter of the "
            'inner race; like 14 "5 mm" "8 mm" "20 mm"',
        )
    command.add_argument("--torque", metavar='"20 N*m"', help="output torque (default: the rated one)")
    command.add_argument("--direction", choices=("forward", "reverse"), default="forward")
    _add_angles(command, PRESSURE_ANGLES)
    add_results(command, plot="pressure over the output angle")
    command.set_defaults(run=_pressure)


def _add_angles(command: argparse.ArgumentParser, count: int) -> None:
    command.add_argument(
        "--count",
        type=int,
        default=count,
        metavar="N",
        help=f"number of output angles, spread over a turn (default {count})",
    )


def _efficiency(options: argparse.Namespace) -> None:
    theta = _turn(options)
    if options.phase:
        return _of_cycle(options, theta)
    for name in (*(one for one, *_ in _HEAT), "lubricant", "save"):
        if _given(options, name) is not None:
            raise InputError(f"--{name}: for a duty cycle only; give its phases with --phase")
    torques = [_torque(text) for text in options.torque or ()]
    model, unit = _loaded(options)
    found: list[Efficiency] = []
    for torque in torques or [_rated(options, unit)]:
        for side in _SIDES[options.drives]:
            if options.drives == "both" and side == "output" and torque <= unit.friction.drag:
                drag = with_unit(unit.friction.drag, "torque")
                tell(f"{with_unit(torque, 'torque')}: the output drives with more than the drag, {drag}; left out")
                continue
            for sense in _WAYS[options.direction]:
                with _of_file(options.model):
                    found.append(efficiency(model, theta, torque=torque, direction=sense, drives=side))
    print(to_text(found[0] if len(found) == 1 else found), end="")
    write_results(found, options, lambda: found[0].plot(beside=found[1:]), [options.model])


def _of_cycle(options: argparse.Namespace, theta: Array) -> None:
    """Efficiency of a duty cycle, and its heat."""
    if options.torque:
        raise InputError("--torque: the phases of a duty have theirs; give --phase alone")
    phases = duty_phases(options.phase)
    heat: dict[str, Any] = {
        name.replace("-", "_"): quantity(f"--{name}", text, dimension, example=example)
        for name, dimension, example, _ in _HEAT
        if (text := _given(options, name)) is not None
    }
    if options.lubricant:
        sizes = [
            quantity("--lubricant", text, dimension, example=example)
            for text, (dimension, example) in zip(options.lubricant, _OIL.values(), strict=True)
        ]
        with _of_file("--lubricant"):
            heat["lubricant"] = Lubricant(**dict(zip(_OIL, sizes, strict=True)))
    model, _ = _loaded(options)
    way, side = _WAYS[options.direction][0], _SIDES[options.drives][0]
    with _of_file(options.model):
        found = duty_efficiency(model, theta, duty=phases, direction=way, drives=side, **heat)
    print(to_text(found), end="")
    write_results(found, options, lambda: found.phases[0].plot(beside=found.phases[1:]), [options.model])
    if options.save:
        say_replaced(options.save)
        append_effects(options.model, options.save, [rounded(found.growth)], overwrite=True)


def _given(options: argparse.Namespace, name: str) -> Any:
    return getattr(options, name.replace("-", "_"))


def _hysteresis(options: argparse.Namespace) -> None:
    angle = quantity("--angle", options.angle, "angle", example="12 deg")
    largest = None if options.torque is None else _torque(options.torque)
    model, unit = _loaded(options)
    top = _rated(options, unit) if largest is None else largest
    if not top > 0:
        raise InputError(f"--torque: {options.torque!r} gives no loop; give more than 0")
    lost = None if unit.rated_torque is None else _LOST_MOTION * unit.rated_torque
    sizes = {share * top for share in _SHARES} | ({lost} if lost is not None and lost <= top else set())
    torques = [units.InCore(size) for size in sorted({0.0, *sizes, *(-size for size in sizes)})]
    with _of_file(options.model):
        found = hysteresis(model, [angle], torques=torques)
    print(to_text(found), end="")
    marked = lost is not None and lost <= top
    if marked:
        read = with_unit(float(found.lost_motion(lost)[0]), "angle")
        print(f"lost motion at +-{100 * _LOST_MOTION:g} % of the rated torque: {read}")
    write_results(found, options, lambda: found.plot(rated=unit.rated_torque if marked else None), [options.model])


def _pressure(options: argparse.Namespace) -> None:
    theta = _turn(options)
    disc_width = quantity("--disc-width", options.disc_width, "length", example="9 mm")
    gear_width = quantity("--gear-width", options.gear_width, "length", example="8 mm")
    cam_bearing = _bearing("--cam-bearing", options.cam_bearing)
    carrier_bearing = _bearing("--carrier-bearing", options.carrier_bearing)
    torque = None if options.torque is None else _torque(options.torque)
    model, unit = _loaded(options)
    with _of_file(options.model):
        found = contact_pressure(
            model,
            theta,
            torque=_rated(options, unit) if torque is None else torque,
            direction=_WAYS[options.direction][0],
            disc_width=disc_width,
            gear_width=gear_width,
            cam_bearing=cam_bearing,
            carrier_bearing=carrier_bearing,
        )
    print(to_text(found), end="")
    write_results(found, options, found.plot, [options.model])


@contextmanager
def _of_file(path: str) -> Iterator[None]:
    """What a model cannot be asked is an error of its file."""
    try:
        yield
    except InputError:
        raise
    except ValueError as problem:
        raise InputError(f"{path}: {problem}") from problem


def _turn(options: argparse.Namespace) -> Array:
    if options.count < 1:
        raise InputError(f"--count: {options.count} is below 1; give 1 angle or more")
    return np.linspace(0, 2 * math.pi, options.count, endpoint=False)


def _torque(text: str) -> float:
    return quantity("--torque", text, "torque", example="20 N*m")


def _bearing(option: str, given: list[str] | None) -> RollerBearing | None:
    if given is None:
        return None
    try:
        rollers = int(given[0])
    except ValueError as problem:
        raise InputError(f"{option}: {given[0]!r} rollers: must be a whole number, like 14") from problem
    diameter, length, race = (quantity(option, text, "length", example="5 mm") for text in given[1:])
    try:
        return RollerBearing(rollers=rollers, roller_diameter=diameter, roller_length=length, race_diameter=race)
    except ValueError as problem:
        raise InputError(f"{option}: {problem}") from problem


def _loaded(options: argparse.Namespace) -> tuple[Model, Reducer]:
    """Model and reducer, once the outputs are known to be usable."""
    check_name(options.model)
    check_results(options, [options.model])
    model = load_model(options.model)
    if not isinstance(model.mechanism, Reducer):
        raise InputError(f"{options.model}: contacts under load need a [reducer] model")
    return model, model.mechanism


def _rated(options: argparse.Namespace, unit: Reducer) -> float:
    if unit.rated_torque is None:
        raise InputError(f"{options.model}: [reducer] has no rated_torque; give it, or --torque '20 N*m'")
    return unit.rated_torque
