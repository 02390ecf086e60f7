"""Commands on a model: simulate, and sources, the catalogue of what can be in one."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rverror.app.terminal import (
    MODEL,
    WAYS,
    arm,
    arm_option,
    check_outputs,
    choice,
    command,
    number,
    option,
    output,
    tell,
    write_json,
    write_text_output,
)
from rverror.base import units
from rverror.base.errors import InputError
from rverror.geartrain.mechanism import reducer
from rverror.geartrain.source import Source
from rverror.geartrain.torque_over_turn import GravityArm
from rverror.model.catalogue import CATALOGUE
from rverror.model.model_file import load_model
from rverror.runs.measurement import run_text
from rverror.runs.order_file import orders_text
from rverror.runs.order_fit import checked_orders, order_table_from_runs
from rverror.runs.virtual_bench import DEFAULT_SEED, run_label, simulate_runs

#: Options of the simulated bench that the library takes by the same names.
_BENCH = ("points", "revolutions", "method", "noise", "correlation", "input_counts", "output_counts", "seed")


@command(
    example='unit.toml --method equilibrium --torque "20 N*m" --direction both -o run.csv',
    options={
        **MODEL,
        "--points": number("samples per output turn (default: enough for the mesh orders, 4096 for an RV-40E)"),
        "--revolutions": number("output turns (default 1)", default=1),
        "--torque": option(
            '"20 N*m"', "output torque (default none); repeat it for more runs", size="torque", action="append"
        ),
        **arm_option("a weight as the load", "; the run has a column output_torque"),
        "--method": choice(
            ("closed", "equilibrium"), "closed", "closed form (default), or equilibrium under load: contacts may open"
        ),
        "--direction": choice(WAYS, "forward", "direction of motion (default forward)"),
        "--noise": option('"0.3 arcsec"', "rms of the noise on the transmission error"),
        "--noise-correlation": option(
            '"2 deg"', "output angle over which the noise is correlated (default: white)", dest="correlation"
        ),
        "--input-counts": number("counts per turn of the input encoder"),
        "--output-counts": number("counts per turn of the output encoder"),
        "--seed": number(f"seed of the noise (default {DEFAULT_SEED})"),
        "--speed": option('"10 deg/s"', "OUTPUT speed (other commands: input speed); adds a time column"),
        "--orders": option('"1,39,40"', "write an order table of these orders in place of samples"),
        **output(
            "OUT.csv",
            "file to write (default: standard output); several runs without --orders become OUT-forward-20Nm.csv, ...",
        ),
    },
)
def _simulate(options: argparse.Namespace) -> None:
    """Compute a run from a model file.

    Computes the output error (transmission error) of the unit that a model file describes and writes it as a run file,
    as a test bench would record it.
    """
    model = load_model(options.model)
    torques: list[float | GravityArm | None] = list(options.torque or ())
    if options.arm is not None:
        torques.append(arm(options.arm))
    torques = torques or [None]
    directions = WAYS[options.direction]
    orders = None if options.orders is None else checked_orders(options.orders.split(",")).tolist()
    labels = [run_label(direction, torque) for torque in torques for direction in directions]
    paths = [options.output] if orders else _run_paths(options, labels)
    bench = {name: getattr(options, name) for name in _BENCH}
    runs = simulate_runs(model, directions=directions, torques=torques, output_speed=options.speed, **bench)
    if torques != [None] and options.method == "closed":
        tell(
            "the closed form holds contacts closed at any torque, but diagnose takes a stated torque for the "
            "equilibrium; for such a run give --method equilibrium"
        )
    texts = [run_text(run) for run in runs]
    if orders:
        table = order_table_from_runs(runs, model, orders)
        tell(*table.notes)
        texts = [orders_text(table)]
    for path, text in zip(paths, texts, strict=True):
        write_text_output(path, text)
    if len(paths) > 1:
        print(*paths, sep="\n")  # for diagnose, or whatever reads the runs


def _run_paths(options: argparse.Namespace, labels: Sequence[str]) -> list[str | None]:
    """File of each run: the one asked for, or beside it one for each label; None for standard output."""
    if len(labels) == 1:
        return [options.output]
    if options.output is None:
        raise InputError(f"{len(labels)} runs ({', '.join(labels)}) need a file each; give a name, e.g. -o OUT.csv")
    if twice := [label for i, label in enumerate(labels) if label in labels[:i]]:
        raise InputError(f"--torque: {twice[0]} is given twice; give each torque once")
    base = Path(options.output)
    paths = [str(base.with_name(f"{base.stem}-{label}{base.suffix}")) for label in labels]
    check_outputs(paths, options.inputs)
    return [*paths]


@command(example="--json sources.json", options={"--json": option("OUT.json", "write JSON instead", writes=True)})
def _sources(options: argparse.Namespace) -> None:
    """List the catalogue of error sources.

    Lists all error sources that rverror knows: key, parameters, the frame ("fixed in"), and
    leading orders in an RV-40E.
    """
    rows = [_source_json(entry) for entry in CATALOGUE.values()]
    if options.json:
        write_json(options.json, rows)
        return
    for row in rows:
        indices = ", ".join(row["indices"]) or "-"
        names = ", ".join(f"{p['name']} [{p['unit']}]" for p in row["parameters"])
        orders = ", ".join(f"{order:g}" for order in row["orders_rv40e"]) or "none: constant or cancels"
        print(f"{row['key']}\n    {row['summary']}; {row['reference']}")
        print(f"    fixed in: {row['frame']}; indices: {indices}; parameters: {names}; leading order, RV-40E: {orders}")


def _example_orders(entry: Source) -> tuple[float, ...]:
    """Leading orders in the RV-40E, for the first index set that has any."""
    unit = reducer("RV-40E")
    if not entry.applies_to(unit):
        return ()
    return next((found for indices in entry.candidates(unit) if (found := entry.orders(unit, indices))), ())


def _source_json(entry: Source) -> dict[str, Any]:
    return {
        "key": entry.key,
        "summary": entry.summary,
        "indices": [index.name for index in entry.indices],
        "parameters": [{"name": p.name, "unit": units.DISPLAY_UNITS[p.dimension]} for p in entry.parameters],
        "frame": entry.frame,
        "orders_rv40e": list(_example_orders(entry)),
        "reference": entry.reference,
    }
