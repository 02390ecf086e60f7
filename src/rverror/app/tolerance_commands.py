"""Commands that work on tolerances: budget and allocate."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from rverror.app.terminal import (
    MODEL,
    WAY,
    Option,
    ProgressLine,
    arm,
    arm_option,
    choice,
    command,
    number,
    option,
    quantity,
    refuse_given,
    results,
    save,
    say_replaced,
    write_results,
)
from rverror.base.errors import InputError, refusing
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

_LIMITED = ("lost_motion", "backlash", "stiffness")  # what only the load tells
_AT_LOAD = (*_LIMITED, "arm")
_FRONT = (0.7, 0.85, 1.0, 1.2, 1.5)  # limits of the plotted front, of the one asked for


def limit_options(beside: str = "") -> dict[str, Option]:
    """Options of limits on angles; `beside` is what else ``--at`` gives there."""
    torques = (
        "output torques for the transmission error of any units under load (default with --limit: "
        f"rated and 20 N*m){beside}"
    )
    return {
        "--limit": _limit("transmission_error", "60 arcsec", "limit of the transmission (output) error, peak-to-peak"),
        "--lost-motion": _limit("lost_motion", "60 arcsec", "limit of the lost motion at 3 %% of the rated torque"),
        "--backlash": _limit("backlash", "60 arcsec", "limit of the backlash, the play without load"),
        "--at --torque": option('"20 N*m,412 N*m"', torques),
    }


def _limit(quantity: str, example: str, what: str) -> Option:
    return option(f'"{example}"', what, size=QUANTITIES[quantity], least=0)


_LIMITS = {
    **limit_options("; with --arm no default; with --speed one torque, the load in motion (default: rated)"),
    "--stiffness": _limit(
        "stiffness",
        "100 N*m/arcmin",
        "lower limit of the torsional stiffness between 50 and 100 %% of the rated torque",
    ),
    **arm_option("a weight as a load, for the transmission error only"),
    "--yield": option('"99 %"', "required yield: share of the units that must meet the limits (default 99 %%)"),
}


def _inputs(*, plot: str) -> dict[str, Option]:
    return {
        **MODEL,
        "tolerances": option("TOLERANCES.toml", "widths, distributions, costs: see docs/theory/budget.md", reads=True),
        **WAY,
        "--speed": option(
            '"600 rpm"',
            "input speed at which the error is computed (default: very low speed)",
            size="angular_speed",
            least=0,
        ),
        "--seed": number("seed of the virtual units (default 0)", least=0, default=0),
        **results(plot=plot),
    }


@command(
    example='unit.toml tolerances.toml --limit "60 arcsec" --at "20 N*m,412 N*m"',
    options={
        **_inputs(plot="contributions and the distribution"),
        **_LIMITS,
        "--units": number("virtual units (default 65536)", least=1, default=COUNT),
        "--loaded-units": number("virtual units computed under load, if any (default 2000)", least=1),
    },
)
def _budget(options: argparse.Namespace) -> None:
    """Distribution of the error, and yield, of part tolerances.

    Computes the output error that part tolerances cause: their contributions and, in closed form, the peak-to-peak
    (with --limit also the yield) of many virtual units. With --arm, --lost-motion, --backlash, --stiffness or (without
    --speed) --at, it also computes units under load and how many of these stay within the limits.
    """
    model, tolerances = _read(options)
    if options.speed is not None:
        refuse_given(options, _AT_LOAD, "units under load stand still; leave it out, or leave out --speed")
    at_load = options.speed is None and any(_given(options, name) for name in ("at", *_AT_LOAD))
    if not at_load:
        unused = "no unit is solved under load; leave it out, or give --at '20 N*m'"
        refuse_given(options, ("yield", "loaded_units"), unused)
    limits = limits_of(options, model) if at_load else ()
    with ProgressLine() as progress:
        found = error_budget(
            model,
            tolerances,
            direction=options.direction,
            torque=max((one.largest for one in limits), default=_load_at_speed(options)) or None,
            input_speed=options.speed,
            count=options.units,
            limits=limits,
            loaded_count=options.loaded_units or LOADED_COUNT,
            seed=options.seed,
            progress=progress,
        )
    write_results(found, options, limit=options.limit)


@command(
    example='unit.toml tolerances.toml --limit "30 arcsec" --save new.toml',
    options={
        **_inputs(plot="the widths found; for --kind yield or worst, least cost against the limit"),
        **_LIMITS,
        "--kind": choice(
            ("load", "yield", "worst"),
            "load",
            "what must meet the limit: load = units under load (default); yield = closed-form quantile of the "
            "peak-to-peak (default for a [drive] model and with --speed); worst = closed-form worst case",
        ),
        "--units": number("units to verify with (default 2000; closed form: 32768)", least=1),
        **save("NEW.toml", "write the tolerance file with the widths found"),
    },
)
def _allocate(options: argparse.Namespace) -> None:
    """The cheapest tolerances that keep units within limits.

    Finds the cheapest tolerances that keep a given share of units within limits (error, lost motion, backlash,
    stiffness), and verifies them on new virtual units.
    """
    model, tolerances = _read(options)
    if options.kind == "load" and (options.speed is not None or not isinstance(model.mechanism, Reducer)):
        options.kind = "yield"
    front: Sequence[FrontPoint] = ()
    with ProgressLine() as progress:
        if options.kind == "load":
            found = _allocated_at_load(options, model, tolerances, progress)
        else:
            found, front = _allocated_in_closed_form(options, model, tolerances, progress)
    write_results(found, options, (lambda: found.plot(kind="front", front=front)) if front else None)
    if options.save:
        say_replaced(options.save)
        save_widths(options.tolerances, options.save, found.widths, grades=found.grades, overwrite=True)


def _allocated_at_load(
    options: argparse.Namespace, model: Model, tolerances: Sequence[Tolerance], progress: ProgressLine
) -> Allocation:
    if options.limit is None:
        if not any(_given(options, name) for name in _LIMITED):
            raise InputError("no limit; give --limit '60 arcsec', --lost-motion, --backlash or --stiffness")
        unused = "loads of the transmission error, which has no limit; give --limit '60 arcsec' as well"
        refuse_given(options, ("at", "arm"), unused)
    return allocate_at_load(
        model,
        tolerances,
        limits_of(options, model),
        direction=options.direction,
        verify=options.units or LOADED_COUNT,
        seed=options.seed,
        progress=progress,
    )


def _allocated_in_closed_form(
    options: argparse.Namespace, model: Model, tolerances: Sequence[Tolerance], progress: ProgressLine
) -> tuple[Allocation, Sequence[FrontPoint]]:
    unused = f"the closed form knows no load; leave it out, or leave out --kind {options.kind}"
    if not isinstance(model.mechanism, Reducer):
        unused = "a [drive] has no contacts to be loaded; leave it out"
    refuse_given(options, _AT_LOAD if options.speed is not None else ("at", *_AT_LOAD), unused)
    if options.limit is None:
        raise InputError("no limit; give --limit '60 arcsec'")
    factors = _FRONT if options.plot else (1.0,)
    laid = stack(
        model, tolerances, direction=options.direction, torque=_load_at_speed(options), input_speed=options.speed
    )
    front = cost_front(
        laid,
        [options.limit * factor for factor in factors],
        kind=options.kind,
        level=_share(getattr(options, "yield")),
        verify=options.units or CLOSED_UNITS,
        seed=options.seed,
        progress=progress,
    )
    at_limit = front[factors.index(1.0)]
    if at_limit.allocation is None:
        raise InputError(at_limit.reason)
    return at_limit.allocation, front


def _given(options: argparse.Namespace, name: str) -> bool:
    return getattr(options, name, None) is not None


def limits_of(options: argparse.Namespace, model: Model) -> tuple[Limit, ...]:
    """Limits at the load: of the transmission error at each torque, and of what makers sell by."""
    level = _share(getattr(options, "yield", None))
    with refusing(f"{options.model}: "):
        unit = reducer_of(model.mechanism, "a limit under load")
    torques: list[float | TorqueLaw] = [*_torques(options)]
    if _given(options, "arm"):
        torques.append(arm(options.arm))
    if not torques and unit.rated_torque is None:
        raise InputError("--at: at which torque? the reducer has no rated_torque; give --at '20 N*m'")
    found = []
    if torques or options.limit is not None:
        rated = unit.rated_torque or 0.0
        usual = (InCore(rated), InCore(min(BENCH_TORQUE, rated)))
        found += [
            Limit("transmission_error", options.limit, torque, level) for torque in dict.fromkeys(torques or usual)
        ]
    found += [Limit(name, getattr(options, name), None, level) for name in _LIMITED if _given(options, name)]
    return tuple(found)


def _torques(options: argparse.Namespace) -> list[float]:
    """Torques of the option --at."""
    texts = [text.strip() for text in (options.at or "").split(",")]
    return [quantity("--at", text, "torque", example="20 N*m", least=0) for text in texts if text]


def _load_at_speed(options: argparse.Namespace) -> float | None:
    """Load of a reducer in motion."""
    torques = _torques(options) if options.speed is not None else []
    if len(torques) > 1:
        raise InputError(f"--at: {len(torques)} torques; at a speed give one")
    return torques[0] if torques else None


def _read(options: argparse.Namespace) -> tuple[Model, tuple[Tolerance, ...]]:
    """Model and tolerances."""
    model = load_model(options.model)
    return model, load_tolerances(options.tolerances, model)


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
