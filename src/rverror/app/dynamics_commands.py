"""Commands that work on the dynamics of a reducer: modes and speeds."""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from rverror.app.terminal import MODEL, WAY, WAYS, command, flag, number, option, results, write_results
from rverror.base.errors import InputError
from rverror.dynamics.at_speed import speed_response
from rverror.dynamics.natural_modes import modes
from rverror.model.model_file import load_model

COUNT = 100  # speeds
_STATE = {**MODEL, "--torque": option('"20 N*m"', "output torque (default: the rated one)", size="torque"), **WAY}


@command(
    example='unit.toml --torque "100 N*m" --plot modes.png',
    options={
        **_STATE,
        "--angle": option('"12 deg"', "output angle (default 0 deg)", size="angle", default="0 deg"),
        **results(plot="the shape of the lowest elastic mode, leaving out the sun support's"),
    },
)
def _modes(options: argparse.Namespace) -> None:
    """Natural frequencies of the loaded gear train.

    Computes natural frequencies and damping of the loaded gear train with the inertias at input and output and, for
    each mode, the contact or spring with most strain energy and the part with most kinetic energy.
    """
    found = modes(load_model(options.model), theta=options.angle, **_state(options))
    write_results(found, options)


@command(
    example='unit.toml --from "60 rpm" --to "1800 rpm" --plot speeds.png',
    options={
        **_STATE,
        "--from": option('"100 rpm"', "lowest input speed", size="angular_speed", dest="first", required=True),
        "--to": option('"1800 rpm"', "highest input speed", size="angular_speed", dest="last", required=True),
        "--count": number(f"number of speeds (default {COUNT})", least=2, default=COUNT),
        "--by-effect": flag("with --json: also the contribution of each known error, by order and speed"),
        **results(plot="the Campbell diagram and the amplitude of orders against the speed"),
    },
)
def _speeds(options: argparse.Namespace) -> None:
    """Output error against input speed, by order, and critical speeds.

    Computes the output error against the input speed, by order, and the critical speeds, where an order's amplitude
    peaks. Orders are per output turn, up to half the samples per turn: for an RV-40E, 4096 / 2 =
    2048. Higher orders alias: 2, 3 and 4 times the cycloid mesh order 1560 of an RV-40E, that is 3120, 4680 and 6240,
    appear at 976, 584 and 1952.
    """
    if not 0 <= options.first < options.last:
        given = "--from {first!r} --to {last!r}".format(**options.as_written)
        raise InputError(f"{given}: speeds must grow from 0 or more")
    speeds = np.linspace(options.first, options.last, options.count)
    found = speed_response(load_model(options.model), speeds, by_effect=options.by_effect, **_state(options))
    write_results(found, options)


def _state(options: argparse.Namespace) -> dict[str, Any]:
    """Load and direction that the model is computed for."""
    return {"torque": options.torque, "direction": WAYS[options.direction][0]}
