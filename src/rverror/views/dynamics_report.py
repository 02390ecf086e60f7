"""Natural modes, the error against speed, run-ups: what is told of each."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.numbers import brief, count_of, way, with_unit
from rverror.base.quantities import quantities
from rverror.base.text import describe
from rverror.base.units import ARCSEC
from rverror.dynamics.at_speed import CRITICAL, PULLED, SpeedResponse
from rverror.dynamics.natural_modes import Modes
from rverror.dynamics.running_up import RunUp
from rverror.views.blocks import Sheet, columns_of, line, notes, title
from rverror.views.describing import content, own_columns, sheet, shown, table
from rverror.views.fields import alike, arrays, bare, rows
from rverror.views.variables import (
    ANGLE,
    HERTZ,
    NUMBER,
    POSITION,
    SPEED,
    TIME,
    TORQUE,
    Each,
    Table,
    Unit,
    Variable,
)

#: Units of a shape at a modal mass of 1 kg.
_SHAPE = {"x": NUMBER, "y": NUMBER, "angle": Unit("rad/mm", "arcsec/um", ARCSEC * 1e3)}
#: Speeds and orders that are shown of an error against speed: as many as stand on a page.
_SPEEDS, _ORDERS = 20, 5


def _where(thing: Modes | SpeedResponse | RunUp) -> str:
    return f"{with_unit(thing.torque, 'torque')}, {way(thing.direction)}"


def _conditions(thing: Modes | SpeedResponse) -> dict[str, Any]:
    return {"torque_newton_metre": units.to_display(thing.torque, "torque"), "direction": way(thing.direction)}


# --- modes ------------------------------------------------------------------------------------------------------------


@table.register
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
            mode=(lambda one: np.arange(one.frequency.size), NUMBER),
            frequency=HERTZ,
            damping_ratio=NUMBER,
            of_sun_support=None,
        ),
        **rows("motion", moved, motion="0"),
        **bare(arrays("motion mode", np.array([row for *_, row in moved]), shape=("", own))),
        **_shares("spring", "strain_energy", result.strain_energy, NUMBER),
        **_shares("weight", "kinetic_energy", result.kinetic_energy, NUMBER),
        **_shares("cause", "sensitivity", result.sensitivity, HERTZ),
        **arrays("", result, torque=TORQUE, theta=POSITION),
    }
    about = {"direction": way(result.direction), "estimated": ", ".join(result.estimated)}
    return Table("Modes", "mode", variables, about)


def _shares(dim: str, name: str, values: Mapping[str, Array], unit: Unit) -> dict[str, Variable]:
    """A row over the modes for each of some names."""
    return {
        dim: Variable((dim,), list(values)),
        name: Variable((dim, "mode"), np.array(list(values.values())), unit),
    }


@content.register
def _modes_content(found: Modes) -> dict[str, Any]:
    """Shapes at a modal mass of 1 kg, inertias in kg and kg*m^2."""

    def of(values: Mapping[str, Array], mode: int) -> dict[str, float]:
        return {name: float(row[mode]) for name, row in values.items()}

    return {
        **_conditions(found),
        "theta_deg": math.degrees(found.theta),
        "modes": [
            {
                "frequency_hz": float(frequency),
                "damping_ratio": float(found.damping_ratio[mode]),
                "of_sun_support": bool(found.of_sun_support[mode]),
                "parts": {part: _motion(values[:, mode]) for part, values in found.shape.items()},
                "strain_energy": of(found.strain_energy, mode),
                "kinetic_energy": of(found.kinetic_energy, mode),
                "sensitivity_hz": of(found.sensitivity, mode),
            }
            for mode, frequency in enumerate(found.frequency)
        ],
        "inertia": {
            f"{name}_{'kg' if what.dimension == 'mass' else 'kg_m2'}": units.to_display(value, what.dimension)
            for name, what in quantities(found.inertia).items()
            if (value := getattr(found.inertia, name)) is not None
        },
        "estimated": list(found.estimated),
    }


def _motion(values: Array) -> dict[str, float]:
    """Motion of one part by its coordinates: an angle alone, x and y, or all three."""
    names = ("angle_rad_per_mm",) if values.size == 1 else ("x", "y", "angle_rad_per_mm")
    return dict(zip(names, values.tolist(), strict=False))


@sheet.register
def _modes_sheet(thing: Modes) -> Sheet:
    strain, kinetic = (_most_of(shares) for shares in (thing.strain_energy, thing.kinetic_energy))
    listed = {
        "mode": range(thing.frequency.size),
        "frequency, Hz": thing.frequency.tolist(),
        "damping, %": (100 * thing.damping_ratio).tolist(),
        "held by": [name for name, _ in strain],
        "by, %": [share for _, share in strain],
        "what moves": [name for name, _ in kinetic],
        "of it, %": [share for _, share in kinetic],
        "of the machine": ["no" if of else "yes" for of in thing.of_sun_support],
    }
    noticed = []
    if thing.of_sun_support.any():
        noticed.append(
            "a mode of the sun's support is none of the machine: that spring only gives a floating sun a place"
        )
    if thing.estimated:
        noticed.append(f"estimated from the geometry, to some 30 %: {', '.join(thing.estimated)}")
    where = f"{_where(thing)}, at {math.degrees(thing.theta):.6g} deg"
    return title("Modes", where) + columns_of(listed) + notes(noticed)


def _most_of(shares: Mapping[str, Any]) -> list[tuple[str, float]]:
    """What has most of each mode's energy, and how many percent; a free motion is held by nothing."""
    found = []
    for of in zip(*(row.tolist() for row in shares.values()), strict=True):
        share, name = max(zip(of, shares, strict=True))
        found.append((name, round(100 * share, 1)) if share > 0 else ("nothing", math.nan))
    return found


# --- error against speed ----------------------------------------------------------------------------------------------


@table.register
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
    return Table("SpeedResponse", "speed", variables, {"direction": way(result.direction)})


def _natural(result: SpeedResponse | RunUp) -> dict[str, Variable]:
    """Natural frequencies beside an error at speed."""
    return arrays("mode", result, "natural_", frequency=HERTZ, of_sun_support=None)


@content.register
def _speeds_content(found: SpeedResponse) -> dict[str, Any]:
    """Angles in arcsec, speeds in rpm; None where not determined."""

    def of(waves: Array, error: Array | None = None) -> dict[str, Any]:
        sizes = {} if error is None else {"peak_to_peak_arcsec": np.ptp(error), "rms_arcsec": error.std()}
        return {
            **{key: float(size) / ARCSEC for key, size in sizes.items()},
            "amplitude_arcsec": (np.abs(waves) / ARCSEC).tolist(),
            "phase_deg": np.degrees(np.angle(waves)).tolist(),
        }

    parts = {}
    if found.by_effect is not None:
        causes = [*((one.key, dict(one.indices)) for one in found.effects), ("load", {})]
        each = zip(causes, found.effect_waves, strict=True)
        parts["by_effect"] = [{"key": key, "indices": indices, **of(waves)} for (key, indices), waves in each]
    each_speed = zip(found.speed.tolist(), found.transmission_error, found.waves, strict=True)
    return {
        **_conditions(found),
        "natural_frequencies": [
            {"frequency_hz": frequency, "of_sun_support": bool(of_support)}
            for frequency, of_support in zip(found.frequency.tolist(), found.of_sun_support, strict=True)
        ],
        "orders": found.order.tolist(),
        "crawl": of(found.crawl_waves, found.crawl),
        "speeds": [
            {
                "input_speed_rpm": units.to_display(speed, "angular_speed"),
                **of(waves, error),
                "pulled": {name: float(share[at]) for name, share in found.pulled.items()},
            }
            for at, (speed, error, waves) in enumerate(each_speed)
        ],
        **parts,
        "critical_speeds": [
            {
                "input_speed_rpm": units.to_display(one.speed, "angular_speed"),
                "order": one.order,
                "amplitude_arcsec": one.amplitude / ARCSEC,
                "growth": _determined(one.growth),
                "frequency_hz": _determined(one.frequency),
                "of_sun_support": one.of_sun_support,
            }
            for one in found.critical_speeds
        ],
    }


def _determined(value: float) -> float | None:
    return value if math.isfinite(value) else None


@sheet.register
def _speeds_sheet(thing: SpeedResponse) -> Sheet:
    found, _ = shown(thing)
    chosen = _some(thing.speed)
    size = np.abs(np.vstack([thing.crawl_waves, thing.waves])) / ARCSEC
    leading = np.sort(np.argsort(-size.max(axis=0), kind="stable")[:_ORDERS])
    listed: dict[str, list[Any]] = {
        "input speed, rpm": [0.0, *(found["speed"][at] for at in chosen)],
        "peak-to-peak, arcsec": [float(np.ptp(thing.crawl)) / ARCSEC, *(found["peak_to_peak"][at] for at in chosen)],
        **{f"order {thing.order[at]:g}": [size[0, at].item(), *size[1 + chosen, at].tolist()] for at in leading},
    }
    critical = line(f"no critical speed: no order peaks at {CRITICAL:g} times its amplitude at a crawl")
    if thing.critical_speeds:
        heads = {"speed": "critical speed", "growth": "times that at a crawl", "frequency": "natural frequency"}
        names = ("speed", "order", "amplitude", "growth", "frequency")
        critical = own_columns(thing, *names, rows="critical", heads=heads)
    return (
        *title("Error against speed", _where(thing), count_of(thing.speed.size, "input speed")),
        *columns_of(listed),
        *line("amplitudes by order in arcsec; the first line is the equilibrium's, at a crawl"),
        *critical,
        *notes(_cautions(thing)),
    )


def _some(values: Array) -> Any:
    """Places of as many values as are shown, spread evenly."""
    return np.unique(np.linspace(0, values.size - 1, _SPEEDS).round().astype(int))


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


@table.register
def _run_up_table(result: RunUp) -> Table:
    variables = {
        **arrays(
            "sample",
            result,
            time=TIME,
            theta=POSITION,
            speed=SPEED,
            **alike(ANGLE, "transmission_error", "crawl", "windup", "vibration"),
            output_torque=TORQUE,
        ),
        **_natural(result),
        **arrays("", result, torque=TORQUE),
    }
    return Table("RunUp", "sample", variables, {"direction": way(result.direction)})


@sheet.register
def _run_up_sheet(thing: RunUp) -> Sheet:
    names = ("time", "speed", "transmission_error", "windup", "vibration", "output_torque")
    heads = {"speed": "input speed", "transmission_error": "error"}
    whole, shaken, twisted = (
        brief(float(np.ptp(row)) / ARCSEC) for row in (thing.transmission_error, thing.vibration, thing.windup)
    )
    low, high = (with_unit(float(end), "torque") for end in (thing.output_torque.min(), thing.output_torque.max()))
    noticed = []
    if thing.output_torque.min() < 0:
        first = brief(float(thing.time[np.argmax(thing.output_torque < 0)]))
        noticed.append(f"from {first} s on contacts would have to pull: they open, and the error is no prediction")
    return (
        *title("Run-up", _where(thing), f"{brief(float(np.ptp(thing.time)))} s"),
        *own_columns(thing, *names, heads=heads, at=_some(thing.time)),
        *line(f"peak-to-peak {whole} arcsec, of it vibration {shaken}, windup {twisted}"),
        *line(f"the output carries {low} to {high}"),
        *notes(noticed),
    )
