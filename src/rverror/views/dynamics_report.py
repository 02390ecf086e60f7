"""Natural modes, the error against speed, run-ups: what is told of each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.numbers import brief, count_of, way, with_unit
from rverror.base.text import describe
from rverror.base.units import ARCSEC
from rverror.dynamics.at_speed import CRITICAL, PULLED, SpeedResponse
from rverror.dynamics.natural_modes import Modes
from rverror.dynamics.running_up import RunUp
from rverror.views.describing import described, entries
from rverror.views.fields import arrays, rows, same_unit
from rverror.views.shown_units import ANGLE, HERTZ, NUMBER, POSITION, SPEED, TIME, TORQUE, Unit
from rverror.views.variables import Each, Table, Variable

#: Units of a shape at a modal mass of 1 kg.
_SHAPE = {"x": NUMBER, "y": NUMBER, "angle": Unit("rad/mm", "arcsec/um", ARCSEC * 1e3)}


def _where(thing: Modes | SpeedResponse | RunUp) -> str:
    return f"{with_unit(thing.torque, 'torque')}, {way(thing.direction)}"


# --- modes ------------------------------------------------------------------------------------------------------------


@described.register
def _modes_table(result: Modes) -> Table:
    moved = [
        (f"{part} {motion}", _SHAPE[motion], row)
        for part, values in result.shape.items()
        for motion, row in zip(("angle",) if len(values) == 1 else ("x", "y", "angle"), values, strict=False)
    ]
    own = Each("shape_unit", tuple(unit for _, unit, _ in moved))
    variables = {
        **arrays(
            "mode",
            result,
            mode=(lambda one: 1 + np.arange(one.frequency.size), NUMBER),
            frequency=HERTZ,
            damping_ratio=NUMBER,
            of_sun_support=None,
            held_by=(lambda one: _most_of(one.strain_energy), None),
            moves=(lambda one: _most_of(one.kinetic_energy), None),
        ),
        **rows("motion", moved, motion="0"),
        **arrays("motion mode", np.array([row for *_, row in moved]), shape=("", own)),
        **_shares("spring", "strain_energy", result.strain_energy, NUMBER),
        **_shares("weight", "kinetic_energy", result.kinetic_energy, NUMBER),
        **_shares("cause", "sensitivity", result.sensitivity, HERTZ),
        **arrays("", result, torque=TORQUE, theta=POSITION),
    }
    noticed = []
    if result.of_sun_support.any():
        noticed.append(
            "a mode of the sun's support is none of the machine: that spring only gives a floating sun a place"
        )
    if result.estimated:
        noticed.append(f"estimated from the geometry, to some 30 %: {', '.join(result.estimated)}")
    about = {"direction": way(result.direction), "estimated": ", ".join(result.estimated), "notes": "\n".join(noticed)}
    return Table(variables, about, title=(_where(result),), verdict=_modes_verdict(result))


def _modes_verdict(result: Modes) -> tuple[str, str]:
    """The lowest mode of the machine, what holds it and what moves in it."""
    if (mode := result.lowest) is None:
        return "", ""
    held, moves = (_most_of(one)[mode].replace("_", " ") for one in (result.strain_energy, result.kinetic_energy))
    strong = f"Lowest mode of the machine: {brief(float(result.frequency[mode]))} Hz"
    return strong, f", mode {1 + mode}; most of its strain energy: {held}; of its kinetic energy: {moves}."


def _shares(dim: str, name: str, values: Mapping[str, Array], unit: Unit) -> dict[str, Variable]:
    """A row over the modes for each of some names."""
    return {dim: Variable((dim,), list(values)), name: Variable((dim, "mode"), np.array(list(values.values())), unit)}


@entries.register
def _modes_content(found: Modes) -> dict[str, Any]:
    """Shapes at a modal mass of 1 kg."""
    return {
        "modes": [
            {
                "frequency_hz": float(frequency),
                "damping_ratio": float(found.damping_ratio[mode]),
                "parts": {part: _motion(values[:, mode]) for part, values in found.shape.items()},
            }
            for mode, frequency in enumerate(found.frequency)
        ]
    }


def _motion(values: Array) -> dict[str, float]:
    """Motion of one part by its coordinates: an angle alone, x and y, or all three."""
    names = ("angle_rad_per_mm",) if values.size == 1 else ("x", "y", "angle_rad_per_mm")
    return dict(zip(names, values.tolist(), strict=False))


def _most_of(shares: Mapping[str, Array]) -> list[str]:
    """What has most of each mode's energy; a free motion is held by nothing."""
    names, rows_of = list(shares), np.array(list(shares.values()))
    most = rows_of.argmax(axis=0)
    return [names[at] if rows_of[at, mode] > 0 else "nothing" for mode, at in enumerate(most)]


# --- error against speed ----------------------------------------------------------------------------------------------


@described.register
def _speeds_table(result: SpeedResponse) -> Table:
    parts: dict[str, Variable] = {}
    if result.by_effect is not None:
        names = [*(describe(e.key, e.indices) for e in result.effects), "load"]
        parts = arrays("effect", names, effect="")
        parts |= arrays(
            "effect speed order",
            result.effect_waves,
            amplitude_by_effect=(np.abs, ANGLE),
            phase_by_effect=(np.angle, POSITION),
        )
    variables = {
        **arrays("speed", result, speed=SPEED, peak_to_peak=ANGLE, rms=ANGLE),
        **{f"pulled_{name}": Variable(("speed",), share, NUMBER) for name, share in result.pulled.items()},
        **arrays("order", result, order=NUMBER),
        **arrays("order", result.crawl_waves, "crawl_", amplitude=(np.abs, ANGLE), phase=(np.angle, POSITION)),
        **arrays("speed order", result.waves, amplitude=(np.abs, ANGLE), phase=(np.angle, POSITION)),
        **parts,
        **rows(
            "critical",
            result.critical_speeds,
            "critical_",
            speed=SPEED,
            order=NUMBER,
            amplitude=ANGLE,
            growth=NUMBER,
            frequency=HERTZ,
            of_sun_support=None,
        ),
        **_natural(result),
        **arrays("theta", result, theta=POSITION, crawl=ANGLE),
        **arrays("speed theta", result, transmission_error=ANGLE),
        **arrays("", result, torque=TORQUE),
    }
    about = {"direction": way(result.direction), "notes": "\n".join(_cautions(result))}
    title = (result.reducer.name, _where(result), count_of(result.speed.size, "input speed"))
    return Table(variables, about, title=title, verdict=_speeds_verdict(result))


def _speeds_verdict(result: SpeedResponse) -> tuple[str, str]:
    """The critical speed with the largest amplitude."""
    if not result.critical_speeds:
        return "No critical speed", f": no order reaches {CRITICAL:g} times its amplitude at very low speed."
    top = max(result.critical_speeds, key=lambda one: one.amplitude)
    strong = f"Order {top.order:g} is largest at {with_unit(top.speed, 'angular_speed')}"
    size = f"{brief(top.amplitude / ARCSEC, 3)} arcsec, {brief(top.growth, 3)} times its amplitude at very low speed"
    return strong, f": {size}; the natural frequency there is {brief(top.frequency, 3)} Hz."


def _natural(result: SpeedResponse | RunUp) -> dict[str, Variable]:
    """Natural frequencies beside an error at speed."""
    return arrays("mode", result, "natural_", frequency=HERTZ, of_sun_support=None)


def _cautions(thing: SpeedResponse) -> list[str]:
    noticed = []
    for name, share in thing.pulled.items():
        over = [brief(units.to_display(float(end), "angular_speed")) for end in np.sort(thing.speed[share > PULLED])]
        if over:
            between = f"at {over[0]} rpm" if len(over) == 1 else f"at {len(over)} speeds of {over[0]} to {over[-1]} rpm"
            noticed.append(
                f"closed {name} would have to pull {between}, by up to {brief(100 * float(share.max()))} % of their "
                "force: they open, and the error there is no prediction"
            )
    if any(one.of_sun_support for one in thing.critical_speeds):
        noticed.append("a peak at a mode of the sun's support is none of the machine")
    return noticed


# --- run-ups ----------------------------------------------------------------------------------------------------------


@described.register
def _run_up_table(result: RunUp) -> Table:
    variables = {
        **arrays(
            "sample",
            result,
            time=TIME,
            theta=POSITION,
            speed=SPEED,
            **same_unit(ANGLE, "transmission_error", "crawl", "windup", "vibration"),
            output_torque=TORQUE,
        ),
        **_natural(result),
        **arrays("", result, torque=TORQUE),
        **{
            f"{name}_peak_to_peak": Variable((), np.ptp(getattr(result, name)), ANGLE)
            for name in ("transmission_error", "vibration", "windup")
        },
    }
    largest = int(np.abs(result.vibration).argmax())
    vibration, speed = float(np.abs(result.vibration[largest])), float(result.speed[largest])
    verdict = (
        f"Peak-to-peak of the error {with_unit(float(np.ptp(result.transmission_error)), 'angle')}",
        f"; the vibration is largest at {with_unit(speed, 'angular_speed')}: {with_unit(vibration, 'angle')}.",
    )
    about = {"direction": way(result.direction)}
    if result.output_torque.min() < 0:
        first = brief(float(result.time[np.argmax(result.output_torque < 0)]))
        about["notes"] = f"from {first} s on contacts would have to pull: they open, and the error is no prediction"
    return Table(
        variables,
        about,
        title=(_where(result), f"{brief(float(np.ptp(result.time)))} s"),
        verdict=verdict,
        shown={"": ("vibration_peak_to_peak", "windup_peak_to_peak")},
    )
