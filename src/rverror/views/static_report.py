"""Loaded states, torsion curves, losses, contact pressures and wear: what is told of each."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from rverror.base.arrays import Array
from rverror.base.numbers import brief, count_of, with_unit
from rverror.model.results import Equilibrium
from rverror.statics.duty import DutyEfficiency, DutyPhase, duty_words
from rverror.statics.friction import Efficiency, Hysteresis
from rverror.statics.hertz import CONTACT_INDICES, ContactPressure
from rverror.statics.rigidity import MAKERS_SHARE, TorsionCurve
from rverror.statics.worn_contacts import Wear
from rverror.views.blocks import in_words
from rverror.views.describing import described
from rverror.views.fields import COUNT, arrays, rows
from rverror.views.model_report import name_of, ways
from rverror.views.shown_units import (
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
)
from rverror.views.variables import Table, Variable

_CONTACTS = {"pin": "disc pin", "cam": "disc crank", "carrier": "crank", "mesh": "crank flank"}


@described.register
def _state_table(result: Equilibrium) -> Table:
    error = result.transmission_error
    variables = {
        **arrays("", result, mean=(lambda _: error.mean(), ANGLE), peak_to_peak=(lambda _: np.ptp(error), ANGLE)),
        **arrays("theta", result, theta=POSITION, transmission_error=ANGLE, steps=NUMBER, residual=NUMBER),
        **arrays("disc theta", result, loaded_pins=NUMBER),
        **arrays(
            "disc",
            result.loaded_pins,
            disc=(lambda pins: np.arange(len(pins)), COUNT),
            fewest_loaded_pins=(lambda pins: pins.min(axis=1), NUMBER),
            most_loaded_pins=(lambda pins: pins.max(axis=1), NUMBER),
        ),
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
    variables |= arrays("xy", ["x", "y"], xy="")
    largest = [(contact, np.linalg.norm(result.contact_forces[contact], axis=-2).max()) for contact in _CONTACTS]
    variables |= rows("contact", largest, contact="0", largest_force=("1", FORCE))
    contact, force = max(largest, key=lambda one: one[1])
    verdict = (
        f"Peak-to-peak {with_unit(np.ptp(error), 'angle')}",
        f"; largest contact force {brief(force, 3)} N ({contact}).",
    )
    return Table(variables, title=(count_of(error.size, "angle"),), verdict=verdict)


# --- torsion ----------------------------------------------------------------------------------------------------------


@described.register
def _torsion_table(result: TorsionCurve) -> Table:
    turn, top = result.angle.mean(axis=1), int(np.abs(result.torque).argmax())
    verdict = f"Output turns by {with_unit(turn[top], 'angle')} at {with_unit(result.torque[top], 'torque')}", "."
    return _over_torque(result, verdict, angle=result.angle)


@described.register
def _loop_table(result: Hysteresis) -> Table:
    return _over_torque(result, _loop_verdict(result), rising=result.rising, falling=result.falling, width=result.width)


def _loop_verdict(result: Hysteresis) -> tuple[str, str]:
    """The lost motion as makers read it, where it is known, and where the loop is widest."""
    width, lost = result.width.mean(axis=1), result.rated_lost_motion
    widest = int(width.argmax())
    where = f"{with_unit(width[widest], 'angle')} at {with_unit(result.torque[widest], 'torque')}"
    if lost is None:
        return f"Largest width of the loop {where}", "."
    at = f"at ±{100 * MAKERS_SHARE:g} % of the rated torque"
    return f"Lost motion {with_unit(lost.mean(), 'angle')}", f" {at}; largest width of the loop {where}."


def _over_torque(result: TorsionCurve | Hysteresis, verdict: tuple[str, str], **turns: Array) -> Table:
    """Turns at each torque: their means over the angles of the output, and each."""
    variables = arrays("torque", result, torque=TORQUE)
    for name, turned in turns.items():
        variables |= arrays("torque", turned.mean(axis=1), **{f"mean_{name}": ("", ANGLE)})
        variables |= arrays("torque place", turned, **{name: ("", ANGLE)})
    return Table(variables, title=(f"{count_of(turned.shape[1], 'angle')} of the output",), verdict=verdict)


# --- losses -----------------------------------------------------------------------------------------------------------


@described.register
def _efficiency_table(result: Efficiency) -> Table:
    lost = np.array(list(result.losses.values()))
    variables = {
        **arrays("theta", result, theta=POSITION, efficiency=PERCENT, input_torque=TORQUE, error_change=ANGLE),
        **rows("part", result.by_part.items(), part="0", share=("1", PERCENT)),
        **arrays("part", lost.mean(axis=1), mean_loss=("", TORQUE)),
        **arrays("part theta", lost, loss=("", TORQUE)),
        **arrays("", result, torque=TORQUE, mean_efficiency=("mean", PERCENT)),
        **arrays("", result.input_torque.mean(), mean_input_torque=("", TORQUE)),
    }
    about = {"drives": result.drives, "direction": ways(result.direction), "self_locking": result.self_locking}
    where = f"{with_unit(result.torque, 'torque')}, {ways(result.direction)}, the {result.drives} drives"
    locked = ("self-locking: at some angle the output cannot drive it",) if result.self_locking else ()
    angles = count_of(result.theta.size, "angle")
    part, share = max(result.by_part.items(), key=lambda one: one[1])
    most = f"; largest loss: {part.replace('_', ' ')}, {brief(100 * share, 2)} %."
    verdict = f"Mean efficiency {brief(100 * result.mean, 3)} %", most
    return Table(variables, about, title=(where, angles), verdict=verdict, sentences=locked)


def efficiencies_table(result: Sequence[Efficiency]) -> Table:
    """Efficiencies of several loads, a row for each."""
    variables = rows(
        "case",
        result,
        torque=TORQUE,
        drives=None,
        direction=lambda one: ways(one.direction),
        efficiency=("mean", PERCENT),
        input_torque=(lambda one: one.input_torque.mean(), TORQUE),
        error_change=(lambda one: one.error_change.mean(), ANGLE),
        self_locking=None,
        **{f"lost_{part}": (f"by_part.{part}", PERCENT) for part in result[0].by_part},
    )
    return Table(variables, kind="Efficiencies")


def _duty(duty: Sequence[DutyPhase]) -> dict[str, Variable]:
    """Phases of a duty."""
    return rows("duty_phase", duty, torque=TORQUE, input_speed=("speed", SPEED), duty_hours=("hours", HOURS))


@described.register
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
    drives = result.phases[0].drives
    verdict = (
        f"Mean efficiency {brief(100 * result.mean, 3)} %",
        f"; housing at {brief(TEMPERATURE.of(result.housing), 3)} degC.",
    )
    return Table(variables, {"drives": drives}, title=(f"the {drives} drives",), verdict=verdict)


# --- contacts ---------------------------------------------------------------------------------------------------------


@described.register
def _pressure_table(result: ContactPressure) -> Table:
    variables = arrays("theta", result, theta=POSITION)
    sizes = {"pressure": PRESSURE, "force": FORCE, "half_width": LENGTH}
    for contact, axes in CONTACT_INDICES.items():
        places = {f"{contact}_{name}": (f"{name}.{contact}", unit) for name, unit in sizes.items()}
        variables |= arrays(" ".join((*axes, "theta")), result, **places)
    variables |= arrays("disc pin theta", result, pin_place=("place", POSITION))
    peaks = {"contact": None, "indices": None, "pressure": PRESSURE, "force": FORCE, "theta": POSITION}
    variables |= rows("peak", result.peaks(), "peak_", **peaks, ripple=PERCENT)
    note = "Ripple: range over mean, over the angles, of the highest pressure at each angle."
    angles = count_of(result.theta.size, "angle")
    top = result.peaks()[0]
    where = f" at the {top.contact} ({in_words(top.indices)}), output angle {brief(math.degrees(top.theta))} deg."
    verdict = f"Highest pressure {with_unit(top.pressure, 'pressure')}", where
    return Table(variables, title=(angles,), verdict=verdict, sentences=(note,), rows="peak")


@described.register
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
            f"{part}_{name}": Variable(("hour",), row, unit)
            for name, unit in (("thinning", LENGTH), ("volume", VOLUME), ("clearance", LENGTH))
            for part, row in getattr(result, name).items()
        },
        **arrays("phase", result, roll_angle=POSITION),
        **arrays("hour phase", result, lobe_depth=LENGTH, pin_depth=LENGTH),
        **arrays("hour pin", result, each_pin=LENGTH),
        **_duty(result.duty),
    }
    new, worn = (with_unit(float(result.lost_motion[at]), "angle") for at in (0, -1))
    return Table(
        variables,
        {"model": name_of(result.model)},
        verdict=(f"Lost motion {new} new, {worn} after {brief(float(result.hours[-1]))} h", "."),
        title=(duty_words(result.duty),),
        shown={"phase": (), "duty_phase": ()},
    )
