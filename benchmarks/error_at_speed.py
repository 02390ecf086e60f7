"""Cost of the error against speed of an RV-40E: all orders of 4096 samples, against speeds and modes that are kept.

    python benchmarks/error_at_speed.py

Six errors of all frames lift pins off at 20 N*m, so every order drives and the stiffness turns with all of them.  BLAS
runs on one thread unless the environment says otherwise.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(_name, "1")

import math  # noqa: E402
import platform  # noqa: E402
from time import perf_counter  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402

import rverror  # noqa: E402

RPM = math.pi / 30
REPEATS = 3
ERRORS = (
    rverror.effect("crank.eccentricity", crank=0, disc=1, tangential="5 um"),
    rverror.effect("cycloid.pin_position", pin=3, radial="5 um"),
    rverror.effect("cycloid.disc_pitch", disc=0, harmonic=1, cos="5 um"),
    rverror.effect("involute.sun_eccentricity", x="5 um"),
    rverror.effect("involute.planet_eccentricity", crank=1, y="5 um"),
    rverror.effect("coupling.carrier_bore_position", crank=0, tangential="5 um"),
)
ENDS = {
    "input held, load of 5 kg*m^2": rverror.model.Bench(load_inertia="5 kg*m^2"),
    "control, couplings and inertias on both ends": rverror.model.Bench(
        input_inertia="1e-4 kg*m^2",
        position_control_stiffness="200 N*m/rad",
        input_coupling_stiffness="3000 N*m/rad",
        load_inertia="5 kg*m^2",
        load_coupling_stiffness="1e6 N*m/rad",
    ),
}


def seconds(model: rverror.Model, speeds: np.ndarray, torque: str, **options: Any) -> tuple[float, int]:
    """Least time of some repeats, and how many modes keep their inertia."""
    taken = []
    for _ in range(REPEATS):
        start = perf_counter()
        found = rverror.dynamics.speed_response(model, speeds, torque=torque, **options)
        taken.append(perf_counter() - start)
    return min(taken), found.frequency.size


def main() -> None:
    """Print the table."""
    print(f"RV-40E, 100 to 1800 rpm, Python {platform.python_version()}, numpy {np.__version__}")
    for name, bench in ENDS.items():
        model = rverror.Model(rverror.reducer("RV-40E"), ERRORS, bench=bench)
        for torque in ("20 N*m", "412 N*m"):
            for count in (10, 100, 400):
                taken, kept = seconds(model, np.linspace(100, 1800, count) * RPM, torque)
                print(f"{name}, {torque}: {count:4d} speeds, {kept:2d} modes kept: {taken:6.2f} s")
    speeds = np.linspace(100, 1800, 10) * RPM
    for modes in (3, 6, 10, 99):
        taken, kept = seconds(model, speeds, "412 N*m", kept=modes)
        print(f"{name}, 412 N*m:   10 speeds, {kept:2d} modes kept: {taken:6.2f} s")
    taken, kept = seconds(model, speeds, "412 N*m", by_effect=True)
    print(f"{name}, 412 N*m:   10 speeds, {kept:2d} modes kept, by effect: {taken:6.2f} s")
    # contacts and meshes beat near the modes of the discs: the mean stiffness does not do
    fast = rverror.Model(rverror.reducer("RV-40E"), ERRORS[:2], bench=rverror.model.Bench(load_inertia="100 kg*m^2"))
    taken, kept = seconds(fast, np.linspace(6000, 9000, 10) * RPM, "100 N*m")
    print(f"load of 100 kg*m^2, 100 N*m, 6000 to 9000 rpm:   10 speeds, {kept:2d} modes kept: {taken:6.2f} s")


if __name__ == "__main__":
    main()
