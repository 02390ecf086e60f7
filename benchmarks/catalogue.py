"""Cost of the whole linear catalogue of an RV-40E: every pin, disc, crank and harmonic, on 4096 angles in one run.

    python benchmarks/catalogue.py [angles of the plain loop]

It is set against the same columns from a plain Python loop over the angles (no arrays, written for this file; timed on
a few angles and scaled up), and against a float64 matrix product whose result has the same size.  The loop also checks
the columns: both must agree.  BLAS runs on one thread unless the environment says otherwise.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(_name, "1")

import math  # noqa: E402
import platform  # noqa: E402
import sys  # noqa: E402
from collections.abc import Callable  # noqa: E402
from time import perf_counter  # noqa: E402

import numpy as np  # noqa: E402

import rverror  # noqa: E402
from rverror.geartrain.contacts import closed_form_forces, pose  # noqa: E402
from rverror.model.compose import effect_matrix, effect_values  # noqa: E402

ANGLES, REPEATS = 4096, 5
HARMONICS = range(1, 9)
#: The sources of the plain loop below: everything that a contact of the gear train carries, and the encoder.
KEYS = (
    "involute.center_distance",
    "involute.sun_eccentricity",
    "involute.sun_offset",
    "involute.planet_eccentricity",
    "involute.sun_pitch",
    "involute.planet_pitch",
    "involute.tooth_thinning",
    "involute.spline_clearance",
    "crank.eccentricity",
    "crank.index",
    "cycloid.disc_profile",
    "cycloid.disc_pitch",
    "cycloid.pin_position",
    "cycloid.pin_circle",
    "cycloid.pin_radius",
    "cycloid.disc_bore_position",
    "coupling.carrier_bore_position",
    "coupling.carrier_runout",
    "sensor.encoder_eccentricity",
    "sensor.encoder_ellipticity",
    "sensor.input_coupling",
)


def all_effects(unit: rverror.Reducer) -> tuple[rverror.Effect, ...]:
    """Every source with every index, harmonics 1 to 8, in the order of `KEYS`, sizes between -5 and 5 um."""
    rng = np.random.default_rng(0)
    effects = []
    for key in KEYS:
        entry = rverror.CATALOGUE[key]
        sets: list[dict[str, int | str]] = [{}]
        for index in entry.indices:
            values = HARMONICS if index.name == "harmonic" else index.allowed(unit)
            sets = [s | {index.name: value} for s in sets for value in values]
        for indices in sets:
            values = tuple(0.005 * rng.uniform(-1, 1, len(entry.parameters)))
            effects.append(rverror.Effect(key, indices, values))
    return tuple(effects)


def plain_columns(unit: rverror.Reducer, effects: tuple[rverror.Effect, ...], theta: float) -> list[float]:
    """Influence of every parameter at one angle, forward motion, in plain Python floats."""
    z_c, z_p, a, r6 = unit.disc_lobes, unit.pins, unit.eccentricity, unit.crank_radius
    discs, cranks, ratio = range(unit.discs), range(unit.cranks), unit.ratio
    stage = unit.planet_teeth / unit.sun_teeth
    feedback = z_c * stage / ratio
    turns = rverror.geartrain.frame_orders(unit)
    ahead = [turns["crank"] * theta + 2 * math.pi * k / unit.discs for k in discs]
    place = [theta + 2 * math.pi * j / unit.cranks for j in cranks]

    # pins: normal, arm, contact angle, then the force that loaded ones carry
    normal, arm, angle, squares = {}, {}, {}, 0.0
    for k in discs:
        ex, ey = math.cos(ahead[k]), math.sin(ahead[k])
        for i in range(z_p):
            gamma = 2 * math.pi * i / z_p
            px, py = unit.pin_circle_radius * math.cos(gamma), unit.pin_circle_radius * math.sin(gamma)
            nx, ny = a * z_p * ex - px, a * z_p * ey - py
            length = math.hypot(nx, ny)
            nx, ny = nx / length, ny / length
            normal[k, i] = (nx, ny)
            arm[k, i] = a * z_c * (ex * ny - ey * nx)
            angle[k, i] = math.atan2(py + unit.pin_radius * ny - a * ey, px + unit.pin_radius * nx - a * ex) - theta
            if arm[k, i] > 0:
                squares += arm[k, i] ** 2
    pin = {c: feedback * max(arm[c], 0.0) / squares for c in arm}

    cam, carrier, mesh = {}, {}, {}
    share = 1 / (ratio * unit.cranks * unit.sun_pitch_radius * math.cos(unit.pressure_angle))
    for j in cranks:
        rx, ry = math.cos(place[j]), math.sin(place[j])
        tx, ty = -ry, rx
        c, s = math.cos(unit.pressure_angle), math.sin(unit.pressure_angle)
        mesh[j] = (share * (c * tx + s * rx), share * (c * ty + s * ry))
        carrier[j] = mesh[j]
        for k in discs:
            qx = sum(pin[k, i] * normal[k, i][0] for i in range(z_p)) / unit.cranks
            qy = sum(pin[k, i] * normal[k, i][1] for i in range(z_p)) / unit.cranks
            couple = sum(pin[k, i] * arm[k, i] for i in range(z_p)) / (unit.cranks * r6)
            cam[k, j] = (qx + couple * tx, qy + couple * ty)
            carrier[j] = (carrier[j][0] + cam[k, j][0], carrier[j][1] + cam[k, j][1])
    spline = -stage / (ratio * unit.cranks)

    def along(force: tuple[float, float], direction: float) -> tuple[float, float]:
        """Force times the radial and the tangential unit vector at an angle."""
        c, s = math.cos(direction), math.sin(direction)
        return force[0] * c + force[1] * s, -force[0] * s + force[1] * c

    columns: list[float] = []
    for effect in effects:
        name, at = effect.key, effect.indices
        j, k, h, i = (at.get(index, 0) for index in ("crank", "disc", "harmonic", "pin"))
        if name in ("involute.center_distance", "involute.planet_eccentricity"):
            x, y = along(mesh[j], place[j] if name.endswith("distance") else turns["planet"] * theta)
            columns += [-x, -y]
        elif name in ("involute.sun_eccentricity", "involute.sun_offset"):
            direction = turns["sun"] * theta if name.endswith("eccentricity") else 0.0
            parts = [along(mesh[c], direction) for c in cranks]
            columns += [sum(p[0] for p in parts), sum(p[1] for p in parts)]
        elif name == "involute.sun_pitch":
            lead = [(place[c] - turns["sun"] * theta, along(mesh[c], place[c])[1]) for c in cranks]
            columns += [sum(f * math.cos(h * chi) for chi, f in lead), sum(f * math.sin(h * chi) for chi, f in lead)]
        elif name == "involute.planet_pitch":
            chi, force = place[j] + math.pi - turns["planet"] * theta, along(mesh[j], place[j])[1]
            columns += [force * math.cos(h * chi), force * math.sin(h * chi)]
        elif name == "involute.tooth_thinning":
            columns.append(-0.5 * sum(along(mesh[c], place[c])[1] for c in cranks))
        elif name == "involute.spline_clearance":
            columns.append(0.5 * spline / unit.spline_radius)
        elif name == "crank.eccentricity":
            x, y = along(cam[k, j], ahead[k])
            columns += [-x, -y]
        elif name == "crank.index":
            columns.append(spline)
        elif name == "cycloid.disc_profile":
            columns += [sum(pin[k, p] * wave(h * angle[k, p]) for p in range(z_p)) for wave in (math.cos, math.sin)]
        elif name == "cycloid.disc_pitch":
            for wave in (math.cos, math.sin):
                total = 0.0
                for p in range(z_p):
                    _, tangential = along(normal[k, p], angle[k, p] + theta)
                    total -= pin[k, p] * tangential * wave(h * angle[k, p])
                columns.append(total)
        elif name == "cycloid.pin_position":
            parts = [along(normal[d, i], 2 * math.pi * i / z_p) for d in discs]
            columns += [sum(pin[d, i] * parts[d][axis] for d in discs) for axis in (0, 1)]
        elif name == "cycloid.pin_circle":
            for axis in (0, 1):
                for wave in (math.cos, math.sin):
                    total = 0.0
                    for d in discs:
                        for p in range(z_p):
                            gamma = 2 * math.pi * p / z_p
                            total += pin[d, p] * along(normal[d, p], gamma)[axis] * wave(h * gamma)
                    columns.append(total)
        elif name == "cycloid.pin_radius":
            columns.append(sum(pin[d, p] for d in discs for p in (range(z_p) if i == "all" else (i,))))
        elif name == "cycloid.disc_bore_position":
            columns += along(cam[k, j], place[j])
        elif name == "coupling.carrier_bore_position":
            x, y = along(carrier[j], place[j])
            columns += [-x, -y]
        elif name == "coupling.carrier_runout":
            parts = [along(carrier[c], theta) for c in cranks]
            columns += [-sum(p[0] for p in parts), -sum(p[1] for p in parts)]
        elif name.startswith("sensor.encoder"):
            order = 1 if name.endswith("eccentricity") else 2
            columns += [math.cos(order * theta), math.sin(order * theta)]
        else:  # sensor.input_coupling
            columns += [math.cos(h * ratio * theta) / ratio, math.sin(h * ratio * theta) / ratio]
    return columns


def best(task: Callable[[], object], repeats: int = REPEATS) -> float:
    """Shortest of several runs, s."""
    times = []
    for _ in range(repeats):
        start = perf_counter()
        task()
        times.append(perf_counter() - start)
    return min(times)


def main() -> None:
    few = int(sys.argv[1]) if len(sys.argv) > 1 else 64
    unit = rverror.reducer("RV-40E")
    effects = all_effects(unit)
    theta = 2 * np.pi * np.arange(ANGLES) / ANGLES
    model = rverror.Model(unit, effects)

    def catalogue() -> np.ndarray:
        motion = pose(unit, theta, direction=1)
        return effect_matrix(motion, closed_form_forces(motion), effects)

    matrix = catalogue()
    columns = matrix.shape[0]
    chosen = np.linspace(0, ANGLES - 1, few).astype(int)
    angles = theta[chosen].tolist()
    looped = np.array([plain_columns(unit, effects, angle) for angle in angles]).T
    size = np.maximum(np.abs(matrix).max(axis=1), 1e-6)  # of each column, where it is not 0
    difference = (np.abs(looped - matrix[:, chosen]).max(axis=1) / size).max()

    run = best(catalogue)
    loop = best(lambda: [plain_columns(unit, effects, angle) for angle in angles], 3) * ANGLES / few
    rng = np.random.default_rng(1)
    left, right = rng.normal(size=(columns, columns)), rng.normal(size=(columns, ANGLES))
    product = best(lambda: left @ right)
    values = effect_values(effects)
    te = best(lambda: values @ matrix, 20)
    whole = best(lambda: rverror.transmission_error(model, theta, direction=1))

    print(f"RV-40E, {len(effects)} errors of {len(KEYS)} sources: {columns} columns on {ANGLES} angles")
    print(f"Python {platform.python_version()}, numpy {np.__version__}, BLAS threads {os.environ['OMP_NUM_THREADS']}")
    print(f"best of {REPEATS} runs; the plain loop ran on {few} angles and is scaled by {ANGLES / few:g}")
    print()
    print(f"{'whole catalogue, one run':44s}{run * 1e3:12.2f} ms{run / columns / ANGLES * 1e9:10.2f} ns an entry")
    print(f"{'plain Python loop over the angles':44s}{loop * 1e3:12.2f} ms{loop / run:10.1f} times the run")
    shape = f"product ({columns} x {columns}) ({columns} x {ANGLES})"
    print(f"{shape:44s}{product * 1e3:12.2f} ms{run / product:10.1f} of it are one run")
    print(f"{'output error from the columns, one product':44s}{te * 1e3:12.3f} ms{run / te:10.1f} of it are one run")
    print(f"{'output error of the model from its errors':44s}{whole * 1e3:12.2f} ms")
    print(f"largest difference of loop and run, relative to its column: {difference:.1e}")


if __name__ == "__main__":
    main()
