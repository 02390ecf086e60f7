"""Loaded states, torsion curves, losses, contact pressures and wear: what is told of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.numbers import brief, count_of, with_unit
from rverror.base.units import ARCSEC
from rverror.model.effects import Model
from rverror.model.results import Equilibrium
from rverror.statics.duty import DutyEfficiency, DutyPhase, duty_words
from rverror.statics.friction import Efficiency, Hysteresis
from rverror.statics.hertz import CONTACT_INDICES, ContactPressure
from rverror.statics.rigidity import TorsionCurve
from rverror.statics.worn_contacts import Wear
from rverror.views.blocks import Ends, Sheet, columns_of, facts, line, notes, title
from rverror.views.describing import own_columns, sheet, shown, table
from rverror.views.fields import Field, arrays, rows
from rverror.views.model_report import angles, inside, load, name_of, ways
from rverror.views.variables import (
    ANGLE,
    FORCE,
    HOURS,
    LENGTH,
    NUMBER,
    PERCENT,
    POSITION,
    PRESSURE,
    SPEED,
    TEMPERATURE,
    TORQUE,
    VOLUME,
    WATT,
    Table,
    Variable,
)

_CONTACTS = {"pin": "disc pin", "cam": "disc crank", "carrier": "crank", "mesh": "crank flank"}


def _angle(value: float) -> str:
    return with_unit(float(value), "angle")


# --- loaded states ----------------------------------------------------------------------------------------------------


@table.register
def _state_table(result: Equilibrium, *, torque: Any | None = None, model: Model | None = None) -> Table:
    variables = {
        **arrays("theta", result, theta=POSITION, transmission_error=ANGLE, steps=NUMBER, residual=NUMBER),
        **arrays("disc theta", result, loaded_pins=NUMBER),
    }
    for part, moved in result.pose.items():
        own = f"{part} " if part in ("disc", "crank") else ""
        variables |= arrays(f"{own}xy theta", moved[..., :2, :], f"{part}_", displacement=("", LENGTH))
        if moved.shape[-2] == 3:
            variables |= arrays(f"{own}theta", moved[..., 2, :], f"{part}_", rotation=("", ANGLE))
    for contact, axes in _CONTACTS.items():
        variables |= arrays(f"{axes} xy theta", result.contact_forces[contact], f"{contact}_", force=("", FORCE))
    spline = result.contact_forces["spline"][:, :, 0]
    variables |= arrays("crank flank theta", spline, spline_torque=("", TORQUE))
    variables |= arrays("xy", ["x", "y"], xy="") | load(torque)
    return Table("Equilibrium", "theta", variables, {} if model is None else {"model": name_of(model)})


@sheet.register
def _state_sheet(thing: Equilibrium) -> Sheet:
    error = thing.transmission_error
    forces = {contact: np.sqrt((force**2).sum(axis=-2)) for contact, force in thing.contact_forces.items()}
    spline = float(np.abs(thing.contact_forces["spline"]).max())
    stated = {
        "transmission error, mean": f"{_angle(error.mean())}, windup and lost motion included",
        "transmission error, peak-to-peak": _angle(np.ptp(error)),
        **{
            f"pins that carry, disc {disc}": f"{row.min()} to {row.max()}" for disc, row in enumerate(thing.loaded_pins)
        },
        **{f"largest {at} force": f"{brief(float(f.max()))} N" for at, f in forces.items() if at != "spline"},
        "largest spline torque": with_unit(spline, "torque"),
        "out of balance": f"{thing.residual.max():.1e} of the load at the most",
    }
    return title("Equilibrium", count_of(error.size, "angle")) + facts(stated)


# --- torsion ----------------------------------------------------------------------------------------------------------


@table.register
def _torsion_table(result: TorsionCurve, *, theta: Any | None = None) -> Table:
    return _over_torque(result, theta, angle=ANGLE)


@table.register
def _loop_table(result: Hysteresis, *, theta: Any | None = None) -> Table:
    return _over_torque(result, theta, rising=ANGLE, falling=ANGLE, width=ANGLE)


def _over_torque(result: TorsionCurve | Hysteresis, theta: Any | None, **turns: Field) -> Table:
    turned = arrays("torque place", result, **turns)
    count = next(iter(turned.values())).values.shape[1]
    variables = {**arrays("torque", result, torque=TORQUE), **angles(theta, count, dim="place"), **turned}
    return Table(type(result).__name__, "torque", variables, {}, frozenset({"theta"}))


@sheet.register
def _torsion_sheet(thing: TorsionCurve) -> Sheet:
    return title("Torsion curve", _held(thing.angle)) + columns_of(
        {
            "torque, N*m": (thing.torque / 1e3).tolist(),
            "turn, arcsec": (thing.angle.mean(axis=1) / ARCSEC).tolist(),
            "over the angles, arcsec": _spread(thing.angle),
        }
    )


@sheet.register
def _loop_sheet(thing: Hysteresis) -> Sheet:
    branches = {"rising": thing.rising, "falling": thing.falling, "width": thing.width}
    listed = {
        "torque, N*m": (thing.torque / 1e3).tolist(),
        **{f"{name}, arcsec": (branch.mean(axis=1) / ARCSEC).tolist() for name, branch in branches.items()},
        "width over the angles, arcsec": _spread(thing.width),
    }
    return title("Hysteresis", _held(thing.width)) + columns_of(listed) + line("turns are means over the angles")


def _held(turns: Any) -> str:
    return f"{count_of(turns.shape[1], 'angle')} of the output"


def _spread(turns: Any) -> list[Ends]:
    """Range over the angles at each torque, arcsec."""
    return [Ends((float(row.min()) / ARCSEC, float(row.max()) / ARCSEC)) for row in turns]


# --- losses -----------------------------------------------------------------------------------------------------------


@table.register
def _efficiency_table(result: Efficiency) -> Table:
    variables = {
        **arrays("theta", result, theta=POSITION, efficiency=PERCENT, input_torque=TORQUE, error_change=ANGLE),
        **rows("part", result.by_part.items(), part="0", share=("1", PERCENT)),
        **arrays("part theta", np.array(list(result.losses.values())), loss=("", TORQUE)),
        **arrays("", result, torque=TORQUE, mean_efficiency=("mean", PERCENT)),
    }
    about = {"drives": result.drives, "direction": ways(result.direction), "self_locking": result.self_locking}
    return Table("Efficiency", "theta", variables, about)


def efficiencies_table(result: Sequence[Efficiency]) -> Table:
    """Efficiencies of several loads, a row for each."""
    shares = [one.by_part for one in result]
    variables = {
        **rows(
            "case",
            result,
            torque=TORQUE,
            drives=None,
            direction=lambda one: ways(one.direction),
            efficiency=("mean", PERCENT),
        ),
        **arrays("part", list(shares[0]), part=""),
        **arrays("case part", np.array([list(one.values()) for one in shares]), lost=("", PERCENT)),
        **rows(
            "case",
            result,
            input_torque=(lambda one: one.input_torque.mean(), TORQUE),
            error_change=(lambda one: one.error_change.mean(), ANGLE),
            self_locking=None,
        ),
    }
    return Table("Efficiencies", "case", variables)


@sheet.register
def _efficiency_sheet(thing: Efficiency) -> Sheet:
    at_input, change = thing.input_torque, thing.error_change
    mean, least, most = (brief(100 * share) for share in (thing.mean, thing.efficiency.min(), thing.efficiency.max()))
    stated = {
        "efficiency": f"{mean} %, {least} to {most} over the angles",
        "torque at the input, mean": with_unit(float(at_input.mean()), "torque"),
        "torque at the input, peak-to-peak": with_unit(float(np.ptp(at_input)), "torque"),
        "added output error, mean": _angle(change.mean()),
        "added output error, peak-to-peak": _angle(np.ptp(change)),
    }
    lost: dict[str, list[Any]] = {
        "lost to": [part.replace("_", " ") for part in thing.losses],
        "torque at the output, N*m": [units.to_display(float(row.mean()), "torque") for row in thing.losses.values()],
        "of the work put in, %": [100 * share for share in thing.by_part.values()],
    }
    where = f"{with_unit(thing.torque, 'torque')}, {ways(thing.direction)}, the {thing.drives} drives"
    noticed = ["self-locking: at some angle the output cannot drive it"] if thing.self_locking else []
    return (
        *title("Efficiency", where, count_of(thing.theta.size, "angle")),
        *facts(stated),
        *columns_of(lost),
        *notes(noticed),
    )


def _duty(duty: Sequence[DutyPhase]) -> dict[str, Variable]:
    """Phases of a duty."""
    return rows("duty_phase", duty, torque=TORQUE, input_speed=("speed", SPEED), duty_hours=("hours", HOURS))


@table.register
def _duty_table(result: DutyEfficiency) -> Table:
    variables = {
        **_duty(result.duty),
        **rows(
            "duty_phase",
            result.phases,
            efficiency=("mean", PERCENT),
            input_torque=(lambda one: one.input_torque.mean(), TORQUE),
            drag=(lambda one: one.losses["drag"].mean(), TORQUE),
        ),
        **rows("part", result.losses.items(), part="0", power_lost=("1", WATT)),
        **arrays(
            "", result, mean_efficiency=("mean", PERCENT), power_out=("power.0", WATT), power_in=("power.1", WATT)
        ),
        **arrays("", result, ambient=TEMPERATURE, housing=TEMPERATURE, inside=TEMPERATURE),
    }
    return Table("DutyEfficiency", "duty_phase", variables, {"drives": result.phases[0].drives})


@sheet.register
def _duty_sheet(thing: DutyEfficiency) -> Sheet:
    stated = {"efficiency of the cycle": f"{brief(100 * thing.mean)} %"}
    stated |= {f"lost to {part.replace('_', ' ')}": f"{brief(power / 1e3)} W" for part, power in thing.losses.items()}
    stated |= {where: with_unit(getattr(thing, where), "temperature") for where in ("ambient", "housing", "inside")}
    listed = own_columns(thing, "torque", "input_speed", "duty_hours", "efficiency", "input_torque", "drag")
    return title("Duty", f"the {thing.phases[0].drives} drives") + facts(stated) + listed


# --- contacts ---------------------------------------------------------------------------------------------------------


@table.register
def _pressure_table(result: ContactPressure) -> Table:
    variables = arrays("theta", result, theta=POSITION)
    sizes = {"pressure": (result.pressure, PRESSURE), "force": (result.force, FORCE)}
    sizes["half_width"] = (result.half_width, LENGTH)
    for contact, axes in CONTACT_INDICES.items():
        for name, (of, unit) in sizes.items() if contact in result.pressure else ():
            variables[f"{contact}_{name}"] = Variable((*axes, "theta"), of[contact], unit)
    variables |= arrays("disc pin theta", result, pin_place=("place", POSITION))
    variables |= rows(
        "peak",
        result.peaks(),
        "peak_",
        contact=None,
        indices=lambda peak: inside(peak.indices),
        pressure=PRESSURE,
        force=FORCE,
        theta=POSITION,
        ripple=PERCENT,
    )
    return Table("ContactPressure", "peak", variables)


@sheet.register
def _pressure_sheet(thing: ContactPressure) -> Sheet:
    found, _ = shown(thing)
    listed = {
        "hardest pressed": [f"{at} ({which})" for at, which in zip(found["contact"], found["indices"], strict=True)],
        "pressure, MPa": found["pressure"],
        "force, N": found["force"],
        "at, deg": found["theta"],
        "ripple, %": found["ripple"],
    }
    note = "ripple: of the hardest pressed contact of each angle, largest less smallest over the mean"
    return title("Contact pressure", count_of(thing.theta.size, "angle")) + columns_of(listed) + line(note)


@table.register
def _wear_table(result: Wear) -> Table:
    variables = {
        **arrays(
            "hour",
            result,
            hours=HOURS,
            peak_to_peak=ANGLE,
            lost_motion=ANGLE,
            deepest_of_lobe=(lambda one: one.lobe_depth.max(axis=1), LENGTH),
            deepest_of_pin=(lambda one: one.pin_depth.max(axis=1), LENGTH),
        ),
        **{
            f"{what}_{name}": Variable(("hour",), row, unit)
            for name, of, unit in (
                ("thinning", result.thinning, LENGTH),
                ("volume", result.volume, VOLUME),
                ("clearance", result.clearance, LENGTH),
            )
            for what, row in of.items()
        },
        **arrays("phase", result, roll_angle=POSITION),
        **arrays("hour phase", result, lobe_depth=LENGTH, pin_depth=LENGTH),
        **arrays("hour pin", result, each_pin=LENGTH),
        **_duty(result.duty),
    }
    return Table("Wear", "hour", variables, {"model": name_of(result.model)}, frozenset({"hours", "roll_angle"}))


@sheet.register
def _wear_sheet(thing: Wear) -> Sheet:
    heads = {"deepest_of_lobe": "lobe", "deepest_of_pin": "pin"}
    heads |= {"sun_thinning": "sun thinner", "planet_thinning": "planets thinner"}
    looser = {
        f"{joint}_clearance": f"{joint.replace('_', ' ')} looser" for joint, row in thing.clearance.items() if row.any()
    }
    names = ("hours", "lost_motion", "peak_to_peak", *heads, *looser)
    return title("Wear", duty_words(thing.duty)) + own_columns(
        thing, *names, heads={"hours": "time", **heads, **looser}
    )
