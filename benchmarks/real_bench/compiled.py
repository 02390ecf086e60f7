"""The poses of `simulator` by the compiled simulator of lots, written independently and six times as fast."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).resolve().parents[2]))

from benchmarks.load_trial.parts import KINDS, Error, build
from benchmarks.load_trial.planar import train_of
from benchmarks.lot_trial import exact

from .simulator import Reality


def transmission_error(
    unit: Any,
    theta: np.ndarray,
    effects: Iterable[tuple[str, dict[str, Any], dict[str, float]]],
    reality: Reality,
    *,
    sense: int,
    torque: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Turn of the carrier beyond `theta`, rad; and at which angles no pose is found.

    Effects are key, indices, and sizes in mm and rad.  Pins and discs meet at their exact poses: what `Reality` says of
    the first order is for `simulator` alone.
    """
    springs = reality.springs
    train = train_of(unit)._replace(
        k_pin=springs.pin,
        k_cam=springs.cam,
        k_bore=springs.carrier,
        k_mesh=springs.mesh,
        k_sun=springs.sun,
        k_main=springs.main,
        backlash=reality.backlash,
    )
    errors = [
        Error(key, indices, tuple(sizes.get(name, 0.0) for name in KINDS[key].parameters))
        for key, indices, sizes in effects
    ]
    pins, flanks = (exact.Law(law.exponent, law.reference) for law in (reality.pin_law, reality.flank_law))
    solved = exact.solve(train, build(train, errors), theta, sense * torque, pins, flanks)
    return solved.output, ~solved.settled
