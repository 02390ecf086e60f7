"""Commands that work on tolerances: budget and allocate."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import closing, contextmanager
from typing import Any

from rverror.app.terminal import (
    MODEL,
    PROGRESS,
    WAY,
    Progress,
    add_command,
    arm,
    arm_option,
    choice,
    option,
    quantity,
    results,
    save_results,
    say_replaced,
    tell,
)
from rverror.base.errors import InputError
from rverror.base.threads import at_most, one_thread
from rverror.base.units import InCore
from rverror.geartrain.mechanism import Reducer
from rverror.geartrain.torque_over_turn import TorqueLaw
from rverror.model.effects import Model
from rverror.model.model_file import load_model
from rverror.statics.loaded_state import reducer_of
from rverror.tolerances.allocation import allocate_at_load, cost_front
from rverror.tolerances.allocation_result import CLOSED_UNITS, Allocation, FrontPoint
from rverror.tolerances.declared import Tolerance
from rverror.tolerances.full_budget import error_budget
from rverror.tolerances.loaded_yield import COUNT as LOADED_COUNT
from rverror.tolerances.sampling import COUNT
from rverror.tolerances.specification import BENCH_TORQUE, LEVEL, QUANTITIES, Limit
from rverror.tolerances.stacking import stack
from rverror.tolerances.tolerance_file import load_tolerances, save_widths
from rverror.views.report import to_text

_FRONT = (0.7, 0.85, 1.0, 1.2, 1.5)  # limits of the plotted front, of the one asked for


def add_commands(commands: Any) -> None:
    """Add the commands to a parser's subparsers.

    Parameters
    ----------
    commands : argparse._SubParsersAction
    """
    add_command(
        commands,
        "budget",
        brief="output error that the tolerances allow",
        does="Computes what part tolerances do to the output error: how much each contributes, the peak-to-peak of many"
        " virtual units, and with --at how many units solved under load stay within the limits.",
        example='unit.toml tolerances.toml --limit "60 arcsec" --at "20 N*m,412 N*m"',
        run=_budget,
        options={
            **_inputs(plot="contributions and the distribution"),
            **_LIMITS,
            "--units": option("N", "virtual units (default 65536)", type=int, default=COUNT),
            "--loaded-units": option("N", "units solved at the load (default 2000)", type=int),
            "--resume": option("FOLDER", "store finished parts of the work there, and resume from them"),
        },
    )
    add_command(
        commands,
        "allocate",
        brief="the tolerances of least cost within limits",
        does="Finds the tolerances of least cost that keep the output error, lost motion or stiffness of a given share "
        "of units within limits, and verifies them on units solved under load.",
        example='unit.toml tolerances.toml --limit "30 arcsec" --save new.toml',
        run=_allocate,
        options={
            **_inputs(plot="least cost against the limit; with --kind load the costs"),
            **_LIMITS,
            "--kind": choice(
                ("load", "yield", "worst"),
                "load",
                "what the limit is for: units solved under load (default), or in closed form, all contacts closed: "
                "a quantile of the peak-to-peak (yield; the default for a drive and with --speed), or its worst case",
            ),
            "--units": option("N", "units to verify with (default 2000; closed form: 32768)", type=int),
            "--save": option("NEW.toml", "write the tolerance file with the widths found"),
        },
    )


def limit_options(beside: str = "") -> dict[str, Any]:
    """Options of limits on angles; `beside` is what else ``--at`` gives there."""
    return {
        "--limit": option('"60 arcsec"', "limit of the transmission error, peak-to-peak"),
        "--lost-motion": option('"60 arcsec"', "limit of the lost motion at 3 %% of the rated torque"),
        "--backlash": option('"60 arcsec"', "limit of the backlash, the play without load"),
        "--at --torque": option(
            '"20 N*m,412 N*m"',
            f"output torques of the transmission error (default: the rated torque and 20 N*m){beside}",
        ),
    }


_LIMITS = {
    **limit_options("; with --speed the load"),
    "--stiffness": option('"100 N*m/arcmin"', "least torsional stiffness between 50 and 100 %% of the rated torque"),
    **arm_option("a weight as a load of the transmission error"),
    "--yield": option('"99 %"', "least share of the units within the limits (default 99 %%)", dest="level"),
}


def _inputs(*, plot: str) -> dict[str, Any]:
    return {
        **MODEL,
        "tolerances": option("TOLERANCES.toml", reads=True),
        **WAY,
        "--speed": option('"600 rpm"', "input speed at which the error is computed (default: very low speed)"),
        "--seed": option("N", "seed of the virtual units (default 0)", type=int, default=0),
        "--jobs": option(
            "N",
            "processes for units in closed form (default 1), threads for units under load (default: all cores)",
            type=int,
        ),
        **PROGRESS,
        **results(plot=plot),
    }


def _budget(options: argparse.Namespace) -> None:
    model, tolerances = _read(options)
    limit = _above_zero("--limit", options.limit, "angle", "60 arcsec")
    speed = _speed(options)
    still = _of_load(options) + ["--arm"] * (options.arm is not None)
    if speed is not None and still:
        raise InputError(f"{still[0]}: units at the load stand still; leave it out, or leave out --speed")
    asked = speed is None and bool(options.at or still)
    if options.level is not None and not asked:
        raise InputError("--yield: the share that limits at the load ask for; leave it out, or give --at '20 N*m'")
    if options.loaded_units is not None and not asked:
        raise InputError("--loaded-units: no unit is solved at a load; leave it out, or give --at '20 N*m'")
    limits = limits_of(options, model) if asked else ()
    count, loaded = _count("--units", options.units), _count("--loaded-units", options.loaded_units, LOADED_COUNT)
    with _executor(options.jobs) as executor, closing(_progress(options)) as progress:
        found = error_budget(
            model,
            tolerances,
            direction=options.direction,
            torque=_load_of_speed(options, speed) or max((one.largest for one in limits), default=None) or None,
            input_speed=speed,
            count=count,
            limits=limits,
            loaded_count=loaded,
            seed=options.seed,
            executor=executor,
            folder=options.resume,
            progress=progress,
        )
    print(to_text(found, limit=limit), end="")
    if found.units.kept:
        tell(f"{options.resume}: {found.units.kept} chunks were there from before")

    def picture() -> Any:
        from rverror.views.plots.budgets import budget_figure

        return budget_figure(found, limit=limit)

    save_results(found, options, picture, limit=limit)


def _allocate(options: argparse.Namespace) -> None:
    model, tolerances = _read(options)
    if options.kind == "load" and (options.speed is not None or not isinstance(model.mechanism, Reducer)):
        options.kind = "yield"
    front: tuple[FrontPoint, ...] = ()
    if options.kind == "load":
        found = _allocated_at_load(options, model, tolerances)
    else:
        found, front = _allocated_in_closed_form(options, model, tolerances)
    print(to_text(found), end="")
    if options.save:
        say_replaced(options.save)
        save_widths(options.tolerances, options.save, found.widths, grades=found.grades, overwrite=True)

    def picture() -> Any:
        from rverror.views.plots.budgets import allocation_figure, front_figure

        return front_figure(front, found) if front else allocation_figure(found)

    save_results(found, options, picture)


def _allocated_at_load(options: argparse.Namespace, model: Model, tolerances: tuple[Tolerance, ...]) -> Allocation:
    if options.limit is None and not _of_load(options):
        raise InputError("no limit; give --limit '60 arcsec', --lost-motion, --backlash or --stiffness")
    loads = ["--at"] * bool(options.at) + ["--arm"] * (options.arm is not None)
    if loads and options.limit is None:
        raise InputError(
            f"{loads[0]}: loads of the transmission error, which has no limit; give --limit '60 arcsec' as well"
        )
    count = _count("--units", options.units, LOADED_COUNT)
    with _executor(options.jobs), closing(_progress(options)) as progress:
        return allocate_at_load(
            model,
            tolerances,
            limits_of(options, model),
            direction=options.direction,
            verify=count,
            seed=options.seed,
            progress=progress,
        )


def _allocated_in_closed_form(
    options: argparse.Namespace, model: Model, tolerances: tuple[Tolerance, ...]
) -> tuple[Allocation, tuple[FrontPoint, ...]]:
    speed = _speed(options)
    unused = _of_load(options) + ["--at"] * bool(options.at and speed is None) + ["--arm"] * (options.arm is not None)
    if unused:
        raise InputError(
            f"{unused[0]}: the closed form knows no load; leave it out, or leave out --kind {options.kind}"
            if isinstance(model.mechanism, Reducer)
            else f"{unused[0]}: a [drive] has no contacts to be loaded; leave it out"
        )
    limit = _above_zero("--limit", options.limit, "angle", "60 arcsec")
    if limit is None:
        raise InputError("no limit; give --limit '60 arcsec'")
    count = _count("--units", options.units, CLOSED_UNITS)
    factors = _FRONT if options.plot else (1.0,)
    laid = stack(
        model,
        tolerances,
        direction=options.direction,
        torque=_load_of_speed(options, speed),
        input_speed=speed,
    )
    with _executor(options.jobs), closing(_progress(options)) as progress:
        front = cost_front(
            laid,
            [limit * factor for factor in factors],
            kind=options.kind,
            level=_share(options.level),
            verify=count,
            seed=options.seed,
            progress=progress,
        )
    asked = front[factors.index(1.0)]
    if asked.allocation is None:
        raise InputError(asked.reason)
    return asked.allocation, front


def _of_load(options: argparse.Namespace) -> list[str]:
    """Options that limit what only the load tells."""
    names = ("--lost-motion", "--backlash", "--stiffness")
    return [name for name in names if getattr(options, name[2:].replace("-", "_"), None) is not None]


def limits_of(options: argparse.Namespace, model: Model) -> tuple[Limit, ...]:
    """Limits at the load: of the transmission error at each torque, and of what makers sell by."""
    level = _share(getattr(options, "level", None))
    unit = reducer_of(model.mechanism, "a limit at the load")
    torques: list[float | TorqueLaw | None] = [
        _above_zero("--at", text.strip(), "torque", "20 N*m") for text in (options.at or "").split(",") if text.strip()
    ]
    weight = getattr(options, "arm", None)
    if weight is not None:
        torques.append(arm(weight))
    if not torques and unit.rated_torque is None:
        raise InputError("--at: at which torque? the reducer has no rated_torque; give --at '20 N*m'")
    error = _above_zero("--limit", options.limit, "angle", "60 arcsec")
    found = []
    if error is not None or options.at or torques:
        found += [
            Limit("transmission_error", error, torque if callable(torque) else InCore(torque or 0.0), level)
            for torque in dict.fromkeys(torques or (unit.rated_torque, min(BENCH_TORQUE, unit.rated_torque or 0.0)))
        ]
    for name in _of_load(options):
        quantity = name[2:].replace("-", "_")
        example = "100 N*m/arcmin" if quantity == "stiffness" else "60 arcsec"
        value = _above_zero(name, getattr(options, quantity), QUANTITIES[quantity], example)
        found.append(Limit(quantity, value, None, level))
    return tuple(found)


def _load_of_speed(options: argparse.Namespace, speed: float | None) -> float | None:
    """Load of a reducer in motion."""
    return _above_zero("--at", options.at, "torque", "20 N*m") if speed is not None else None


def _read(options: argparse.Namespace) -> tuple[Model, tuple[Tolerance, ...]]:
    """Model and tolerances."""
    if options.seed < 0:
        raise InputError(f"--seed: {options.seed} is below 0; give 0 or more")
    model = load_model(options.model)
    return model, load_tolerances(options.tolerances, model)


def _progress(options: argparse.Namespace) -> Progress:
    return Progress(terminal_only=not options.progress)


def _speed(options: argparse.Namespace) -> float | None:
    value = None if options.speed is None else quantity("--speed", options.speed, "angular_speed", example="600 rpm")
    if value is not None and value < 0:
        raise InputError(f"--speed: {options.speed!r} is below 0; the direction is said by --direction")
    return value


def _above_zero(name: str, text: str | None, dimension: str, example: str) -> float | None:
    if text is None:
        return None
    value = quantity(name, text, dimension, example=example)
    if value <= 0:
        raise InputError(f"{name}: {text!r} is not above 0; write it like '{example}'")
    return value


def _share(text: str | None) -> float:
    """Share from 0.99 or '99 %'."""
    if text is None:
        return LEVEL
    try:
        value = float(text.rstrip().removesuffix("%")) / (100 if text.rstrip().endswith("%") else 1)
    except ValueError:
        value = -1.0
    if not 0 < value < 1:
        raise InputError(f"--yield: {text!r} is no share between 0 and 1; write it like '99 %' or 0.99")
    return value


def _count(name: str, given: int | None, default: int = 1) -> int:
    """Number that is given, or the usual one."""
    number = default if given is None else given
    if number < 1:
        raise InputError(f"{name}: {number} is below 1; give 1 or more")
    return number


@contextmanager
def _executor(jobs: int | None) -> Iterator[Executor | None]:
    """Processes for the virtual units, none for one job; and as many threads at the most."""
    if jobs is None:
        yield None
        return
    _count("--jobs", jobs)
    if jobs == 1:
        with at_most(1):
            yield None
        return
    with at_most(jobs), ProcessPoolExecutor(jobs, initializer=one_thread) as executor:
        yield executor
