"""Commands on what contacts of a reducer do under load: what friction takes, and how hard they press."""

from __future__ import annotations

import argparse
import math
from typing import Any

import numpy as np

from rverror.app.terminal import (
    MODEL,
    PHASES,
    WAY,
    WAYS,
    WIDTHS,
    choice,
    command,
    duty_phases,
    number,
    option,
    refuse_given,
    results,
    save,
    save_with,
    tell,
    write_results,
)
from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError, refusing
from rverror.base.numbers import with_unit
from rverror.geartrain.mechanism import Reducer
from rverror.model.effects import Model
from rverror.model.model_file import load_model
from rverror.statics.duty import Lubricant, duty_efficiency
from rverror.statics.friction import Efficiency, efficiency, hysteresis
from rverror.statics.hertz import RollerBearing, contact_pressure
from rverror.statics.rigidity import MAKERS_SHARE

#: Even angles of an output turn: no divisor of the waves that pins and discs make, and for pressures fine enough for
#: what single pins do.
EFFICIENCY_ANGLES, PRESSURE_ANGLES = 101, 800
_SIDES = {"input": ("input",), "output": ("output",), "both": ("input", "output")}
#: Of the largest torque of a loop: denser where play and drag bend it.
_SHARES = (0.005, 0.01, 0.02, 0.03, 0.06, 0.12, 0.25, 0.5, 0.75, 1.0)


#: Options of a duty's heat, by what the library calls them: how each is written, its dimension, and what it is.
_HEAT = {
    "thermal_resistance": ("0.3 K/W", "thermal_resistance", "thermal resistance, housing to surroundings (default 0)"),
    "inside_resistance": ("0.1 K/W", "thermal_resistance", "thermal resistance, inside to housing (default 0)"),
    "ambient": ("20 degC", "temperature", "temperature of the surroundings (default 20 degC)"),
    "temperature": ("50 degC", "temperature", "temperature of the whole unit, if it is known"),
}
_OIL = ("viscosity_40", "viscosity_100", "temperature", "speed")  # what `--lubricant` takes, in order
_LUBRICANT = (
    "with --phase: viscosity of the oil at 40 and 100 degC, then the temperature and input speed at which `drag` in "
    '[reducer.friction] is given; like "150 cSt" "15 cSt" "20 degC" "1815 rpm"'
)
_ROLLERS = 'number of rollers, their diameter and length, diameter of the inner race; like 14 "5 mm" "8 mm" "20 mm"'
_RATED = "output torque (default: the rated one)"


_OF_FRICTION = {"model": option("MODEL.toml", "with [reducer.friction]", reads=True)}


def _angles(count: int) -> dict[str, Any]:
    help_text = f"output angles, evenly spaced over a turn (default {count})"
    return {"--count": number(help_text, least=1, default=count)}


@command(
    example='unit.toml --torque "412 N*m" --torque "20 N*m"',
    options={
        **_OF_FRICTION,
        "--torque": option('"20 N*m"', f"{_RATED}; repeat it for more", size="torque", action="append"),
        "--drives": choice(_SIDES, "both", "driving side (default both; with --phase: input)"),
        "--direction": choice(WAYS, "forward", "direction of motion (default forward)"),
        **PHASES,
        **{
            f"--{name.replace('_', '-')}": option(f'"{example}"', f"with --phase: {what}", size=dimension)
            for name, (example, dimension, what) in _HEAT.items()
        },
        "--lubricant": option(("AT_40", "AT_100", "TEMPERATURE", "SPEED"), _LUBRICANT, nargs=4),
        **save("NEW.toml", "with --phase: write the model of the warm unit"),
        **_angles(EFFICIENCY_ANGLES),
        **results(plot="the friction losses by part"),
    },
)
def _efficiency(options: argparse.Namespace) -> None:
    """Friction losses by part, and the input torque.

    Computes the friction losses in pins, gear flanks and bearings, part by part, and the torque at the
    input. The coefficients of friction come from [reducer.friction] of the model file.
    """
    theta = _turn(options)
    if options.phase:
        return _of_cycle(options, theta)
    refuse_given(options, (*_HEAT, "lubricant", "save"), "for a duty cycle only; give its phases with --phase")
    model, unit = _loaded(options)
    found: list[Efficiency] = []
    for torque in options.torque or [_rated(options, unit)]:
        for side in _SIDES[options.drives]:
            if options.drives == "both" and side == "output" and torque <= unit.friction.drag:
                drag = with_unit(unit.friction.drag, "torque")
                tell(f"{with_unit(torque, 'torque')}: the output drives with more than the drag, {drag}; left out")
                continue
            for sense in WAYS[options.direction]:
                with refusing(f"{options.model}: "):
                    found.append(efficiency(model, theta, torque=torque, direction=sense, drives=side))
    write_results(found[0] if len(found) == 1 else found, options, lambda: found[0].plot(beside=found[1:]))


def _of_cycle(options: argparse.Namespace, theta: Array) -> None:
    """Efficiency of the phases of a duty, each at its speed and the temperature that its losses make."""
    refuse_given(options, ["torque"], "the phases of a duty have theirs; give --phase alone")
    if options.direction == "both":
        raise InputError("--direction: a duty cycle has one direction; give forward or reverse")
    phases = duty_phases(options.phase)
    heat: dict[str, Any] = {name: size for name in _HEAT if (size := getattr(options, name)) is not None}
    if options.lubricant:
        with refusing("--lubricant: "):
            heat["lubricant"] = Lubricant(**dict(zip(_OIL, options.lubricant, strict=True)))
    model, _ = _loaded(options)
    sense, side = WAYS[options.direction][0], _SIDES[options.drives][0]
    with refusing(f"{options.model}: "):
        found = duty_efficiency(model, theta, duty=phases, direction=sense, drives=side, **heat)
    write_results(found, options, lambda: found.phases[0].plot(beside=found.phases[1:]))
    save_with(options, [found.growth])


@command(
    example='unit.toml --torque "412 N*m" --plot loop.png',
    options={
        **_OF_FRICTION,
        "--torque": option('"412 N*m"', "largest output torque (default: the rated one)", size="torque", least=0),
        "--angle": option('"12 deg"', "output angle (default 0 deg)", size="angle", default="0 deg"),
        **results(plot="the loop"),
    },
)
def _hysteresis(options: argparse.Namespace) -> None:
    """Hysteresis loop of the torsion, input held.

    Computes how far the output turns as the torque on it rises and falls with the input held: the width of the loop
    and the lost motion.
    """
    model, unit = _loaded(options)
    top = _rated(options, unit) if options.torque is None else options.torque
    lost = MAKERS_SHARE * (unit.rated_torque or 0.0)
    sizes = {0.0, *(share * top for share in _SHARES), *([lost] if lost <= top else [])}
    torques = [units.InCore(size) for size in sorted(sizes | {-size for size in sizes})]
    with refusing(f"{options.model}: "):
        found = hysteresis(model, [options.angle], torques=torques)
    write_results(found, options)


@command(
    example='unit.toml --disc-width "9 mm" --gear-width "8 mm"',
    options={
        **MODEL,
        **WIDTHS,
        **{
            f"--{bearing}-bearing": option(
                ("ROLLERS", "DIAMETER", "LENGTH", "RACE"), f"bearing of the cranks in the {place}: {_ROLLERS}", nargs=4
            )
            for bearing, place in (("cam", "discs"), ("carrier", "carrier"))
        },
        "--torque": option('"20 N*m"', _RATED, size="torque"),
        **WAY,
        **_angles(PRESSURE_ANGLES),
        **results(plot="pressure over the output angle"),
    },
)
def _pressure(options: argparse.Namespace) -> None:
    """Contact pressure of pins, gear flanks and bearings.

    Computes the contact pressure of pins, gear flanks and crank bearings (if their rollers are given), and at
    which output angle it is highest.
    """
    cam_bearing = _bearing("--cam-bearing", options.cam_bearing)
    carrier_bearing = _bearing("--carrier-bearing", options.carrier_bearing)
    model = load_model(options.model)
    with refusing(f"{options.model}: "):
        found = contact_pressure(
            model,
            _turn(options),
            torque=options.torque,
            direction=WAYS[options.direction][0],
            disc_width=options.disc_width,
            gear_width=options.gear_width,
            cam_bearing=cam_bearing,
            carrier_bearing=carrier_bearing,
        )
    write_results(found, options)


def _turn(options: argparse.Namespace) -> Array:
    return np.linspace(0, 2 * math.pi, options.count, endpoint=False)


def _bearing(name: str, given: list[Any] | None) -> RollerBearing | None:
    if given is None:
        return None
    try:
        rollers = int(given[0])
    except ValueError as problem:
        raise InputError(f"{name}: {given[0]!r} rollers: must be a whole number, like 14") from problem
    _, diameter, length, race = given
    with refusing(f"{name}: "):
        return RollerBearing(rollers=rollers, roller_diameter=diameter, roller_length=length, race_diameter=race)


def _loaded(options: argparse.Namespace) -> tuple[Model, Reducer]:
    """Model and reducer, once the outputs are known to be usable."""
    model = load_model(options.model)
    if not isinstance(model.mechanism, Reducer):
        raise InputError(f"{options.model}: contacts under load need a [reducer] model")
    return model, model.mechanism


def _rated(options: argparse.Namespace, unit: Reducer) -> float:
    if unit.rated_torque is None:
        raise InputError(f"{options.model}: [reducer] has no rated_torque; give it, or --torque '20 N*m'")
    return unit.rated_torque
