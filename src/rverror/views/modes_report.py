"""Natural modes for programs, mode by mode."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.numbers import way
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


def _motion(values: Array) -> dict[str, float]:
    """Motion of one part by its coordinates: an angle alone, x and y, or all three."""
    names = ("angle_rad_per_mm",) if values.size == 1 else ("x", "y", "angle_rad_per_mm")
    return dict(zip(names, values.tolist(), strict=False))
