"""Dynamics for programs: natural modes, mode by mode, and the error against speed, speed by speed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.numbers import way
from rverror.base.units import ARCSEC
from rverror.dynamics.at_speed import SpeedResponse
from rverror.dynamics.natural_modes import Modes
from rverror.geartrain.mechanism import INERTIA_DIMENSIONS
from rverror.views.envelope import InputFile, enveloped


def modes_json(found: Modes, *, files: Sequence[InputFile] = ()) -> dict[str, Any]:
    """Natural modes as plain data for `json.dump`: shapes at a modal mass of 1 kg, inertias in kg and kg*m^2."""

    def of(rows: Mapping[str, Array], mode: int) -> dict[str, float]:
        return {name: float(row[mode]) for name, row in rows.items()}

    return enveloped(
        "Modes",
        {
            "torque_newton_metre": units.to_display(found.torque, "torque"),
            "theta_deg": math.degrees(found.theta),
            "direction": way(found.direction),
            "modes": [
                {
                    "frequency_hz": float(frequency),
                    "damping_ratio": float(found.damping_ratio[mode]),
                    "of_sun_support": bool(found.of_sun_support[mode]),
                    "parts": {part: _motion(rows[:, mode]) for part, rows in found.shape.items()},
                    "strain_energy": of(found.strain_energy, mode),
                    "kinetic_energy": of(found.kinetic_energy, mode),
                    "sensitivity_hz": of(found.sensitivity, mode),
                }
                for mode, frequency in enumerate(found.frequency)
            ],
            "inertia": {
                f"{name}_{'kg' if kind == 'mass' else 'kg_m2'}": units.to_display(getattr(found.inertia, name), kind)
                for name, kind in INERTIA_DIMENSIONS.items()
            },
            "estimated": list(found.estimated),
        },
        files,
    )


def speeds_json(found: SpeedResponse, *, files: Sequence[InputFile] = ()) -> dict[str, Any]:
    """Error against speed as plain data for `json.dump`: angles in arcsec, speeds in rpm; None where not determined."""

    def of(error: Array, waves: Array) -> dict[str, Any]:
        return {
            "peak_to_peak_arcsec": float(np.ptp(error)) / ARCSEC,
            "rms_arcsec": float(error.std()) / ARCSEC,
            "amplitude_arcsec": (np.abs(waves) / ARCSEC).tolist(),
            "phase_deg": np.degrees(np.angle(waves)).tolist(),
        }

    def part(number: int) -> dict[str, Any]:
        waves = found.effect_waves[number]
        last = number == len(found.effects)
        key, indices = ("load", {}) if last else (found.effects[number].key, dict(found.effects[number].indices))
        sizes = {
            "amplitude_arcsec": (np.abs(waves) / ARCSEC).tolist(),
            "phase_deg": np.degrees(np.angle(waves)).tolist(),
        }
        return {"key": key, "indices": indices, **sizes}

    asked = found.by_effect is not None
    rows = zip(found.speed.tolist(), found.transmission_error, found.waves, strict=True)
    return enveloped(
        "SpeedResponse",
        {
            "torque_newton_metre": units.to_display(found.torque, "torque"),
            "direction": way(found.direction),
            "natural_frequencies": [
                {"frequency_hz": frequency, "of_sun_support": bool(of_support)}
                for frequency, of_support in zip(found.frequency.tolist(), found.of_sun_support, strict=True)
            ],
            "orders": found.order.tolist(),
            "crawl": of(found.crawl, found.crawl_waves),
            "speeds": [
                {
                    "input_speed_rpm": units.to_display(speed, "angular_speed"),
                    **of(error, waves),
                    "pulled": {name: float(share[at]) for name, share in found.pulled.items()},
                }
                for at, (speed, error, waves) in enumerate(rows)
            ],
            **({"by_effect": [part(number) for number in range(len(found.effects) + 1)]} if asked else {}),
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
        },
        files,
    )


def _determined(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _motion(values: Array) -> dict[str, float]:
    """Motion of one part by its coordinates: an angle alone, x and y, or all three."""
    names = ("angle_rad_per_mm",) if values.size == 1 else ("x", "y", "angle_rad_per_mm")
    return dict(zip(names, values.tolist(), strict=False))
