"""How often the stated uncertainty of measured parts holds: simulated machines, their files, and `load_parts`.

Each machine is simulated as it works, not by what is fitted to its readings: points of a part with errors are placed in
space, the part is moved and turned, and radii are taken along rays, centres and angles about an axis, all with noise.

    python benchmarks/parts_trial.py [PARTS]
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import rverror

UNIT = rverror.reducer("RV-40E")
UM = 1e-3  # mm
Truth = dict[str, np.ndarray[Any, Any]]
#: Truth of a part by the names of its effects, then the lines of its file.
Machine = Callable[[np.random.Generator], tuple[Truth, str]]

LOBES = """
kind = "disc"
[lobes]
angle = { name = "angle", unit = "deg" }
radius = { name = "radius", unit = "mm", uncertainty = "0.3 um" }
datum = "fit"
"""
PINS = """
kind = "housing"
[places]
number = "pin"
x = { name = "x", unit = "mm", uncertainty = "0.5 um" }
y = { name = "y", unit = "mm", uncertainty = "0.5 um" }
diameter = { name = "d", unit = "mm", uncertainty = "0.4 um" }
datum = "fit"
"""
CAMS = """
kind = "crank"
[circles]
number = "cam"
angle = { name = "angle", unit = "deg" }
radius = { name = "radius", unit = "mm", uncertainty = "0.3 um" }
datum = "axis"
"""
TEETH = """
kind = "planet"
[teeth]
number = "tooth"
pitch = { name = "fp", unit = "um", uncertainty = "0.4 um" }
runout = { name = "Fr", unit = "um", uncertainty = "0.8 um" }
"""


def table(heads: str, *columns: Any) -> str:
    """Lines of a file."""
    rows = "\n".join(",".join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True))
    return f"{heads}\n{rows}\n"


def waves(pairs: Any, angle: Any) -> Any:
    """Sum of waves 1, 2, ... with these cosines and sines."""
    return sum(c * np.cos(h * angle) + s * np.sin(h * angle) for h, (c, s) in enumerate(pairs, 1))


def nominal_disc(place: int, steps: int) -> tuple[Any, Any, Any]:
    """Roll angles, points and outward normals of a nominal disc, by moving it past a pin.

    The disc, whose centre goes round at the eccentricity, turns back by a lobe for each turn; seen from it a pin's
    centre draws a curve, and the profile lies a pin's radius inside it.
    """
    lobes = UNIT.disc_lobes
    roll = np.linspace(0, 2 * np.pi * lobes, steps * lobes, endpoint=False)
    centre = (UNIT.pin_circle_radius - UNIT.eccentricity * np.exp(1j * roll)) * np.exp(1j * roll / lobes)
    # derivative by the spectrum: the curve is periodic
    along = np.fft.ifft(np.fft.fft(centre) * np.fft.fftfreq(roll.size, 1 / roll.size) * 1j)
    inward = 1j * along / abs(along)
    # disc k waits half a lobe where it stands opposite: its eccentric leads that of disc 0 by k/n of a turn
    turn = np.exp(2j * np.pi * (-(-place * UNIT.pins // UNIT.discs) - place / UNIT.discs) / lobes)
    return roll, (centre + UNIT.pin_radius * inward) * turn, -inward * turn


_DISCS = [nominal_disc(place, 4000) for place in range(UNIT.discs)]


def lobe_scan(rng: np.random.Generator, *, points: int = 40, noise: float = 0.3 * UM) -> tuple[Truth, str]:
    """A disc with waves of profile and pitch and a common lobe profile, clamped off its axis, radii along rays."""
    roll, curve, outward = _DISCS[rng.integers(UNIT.discs)]
    profile, pitch, lobe = (size * UM * rng.standard_normal((count, 2)) for size, count in ((2, 6), (2, 6), (1, 3)))
    offset = UM * rng.standard_normal()
    psi = np.angle(curve)
    normal = waves(profile, psi) + offset + waves(lobe, roll)
    surface = curve + normal * outward + waves(pitch, psi) * 1j * curve / abs(curve)
    surface = surface * np.exp(0.005j * rng.standard_normal()) + 0.05 * (
        rng.standard_normal() + 1j * rng.standard_normal()
    )
    angle = rng.uniform(0, 0.1) + np.linspace(0, 2 * np.pi, points * UNIT.disc_lobes, endpoint=False)
    seen = np.argsort(np.angle(surface))
    radius = np.interp(angle, np.angle(surface)[seen], abs(surface)[seen], period=2 * np.pi)
    truth = {f"cycloid.disc_profile (harmonic {h})": pair for h, pair in enumerate(profile, 1)}
    truth |= {f"cycloid.disc_pitch (harmonic {h})": pair for h, pair in enumerate(pitch, 1)}
    truth |= {f"cycloid.lobe_profile (harmonic {m})": pair for m, pair in enumerate([[offset, 0.0], *lobe])}
    return truth, table("angle,radius", np.degrees(angle), radius + noise * rng.standard_normal(angle.size))


def pin_table(rng: np.random.Generator) -> tuple[Truth, str]:
    """A housing on a coordinate measuring machine, moved and turned; truth is what the best rigid motion leaves."""
    nominal = UNIT.pin_circle_radius * np.exp(2j * np.pi * np.arange(UNIT.pins) / UNIT.pins)
    errors = 4 * UM * (rng.standard_normal(UNIT.pins) + 1j * rng.standard_normal(UNIT.pins))
    radii = 1 * UM * rng.standard_normal(UNIT.pins)
    real = nominal + errors
    # Kabsch: rotation of the singular vectors of the covariance
    one, other = (np.stack([each.real, each.imag]) for each in (real - real.mean(), nominal - nominal.mean()))
    left, _, right = np.linalg.svd(one @ other.T)
    back = right.T @ np.diag([1.0, np.linalg.det(right.T @ left.T)]) @ left.T
    form = ((back @ one)[0] + 1j * (back @ one)[1] - nominal) * np.conj(nominal) / abs(nominal)
    seen = real * np.exp(2j * np.pi * rng.uniform()) + 100 * (rng.standard_normal() + 1j * rng.standard_normal())
    noise = [0.5 * UM * rng.standard_normal(UNIT.pins) for _ in range(2)]
    diameter = 2 * (UNIT.pin_radius + radii) + 0.4 * UM * rng.standard_normal(UNIT.pins)
    truth = {f"cycloid.pin_position (pin {i})": np.array([e.real, e.imag]) for i, e in enumerate(form)}
    truth |= {f"cycloid.pin_radius (pin {i})": np.array([radius]) for i, radius in enumerate(radii)}
    return truth, table("pin,x,y,d", np.arange(UNIT.pins) + 1, seen.real + noise[0], seen.imag + noise[1], diameter)


def cam_scans(rng: np.random.Generator, *, points: int = 180) -> tuple[Truth, str]:
    """Both cams of a crank, turned in its centres, radii along rays; truth is what a turn of the crank leaves."""
    errors = 3 * UM * rng.standard_normal((UNIT.discs, 2))
    along = np.exp(2j * np.pi * np.arange(UNIT.discs) / UNIT.discs)
    centres = along * (UNIT.eccentricity + errors[:, 0] + 1j * errors[:, 1])
    turn = np.angle(np.sum(centres * np.conj(along)))
    straight = centres * np.exp(-1j * turn) * np.conj(along) - UNIT.eccentricity
    rows = []
    for cam, centre in enumerate(centres * np.exp(1j * rng.normal(0, 0.1))):
        angle = np.linspace(0, 2 * np.pi, points, endpoint=False) + rng.uniform(0, 1)
        beside = (centre * np.exp(-1j * angle)).imag  # distance of the centre from the ray
        radius = (centre * np.exp(-1j * angle)).real + np.sqrt(20.0**2 - beside**2)
        noisy = radius + 0.3 * UM * rng.standard_normal(points)
        rows.append(np.stack([np.full(points, cam), np.degrees(angle), noisy]))
    truth = {f"crank.eccentricity (disc {k})": np.array([e.real, e.imag]) for k, e in enumerate(straight)}
    return truth, table("cam,angle,radius", *np.hstack(rows))


def pitch_chart(rng: np.random.Generator) -> tuple[Truth, str]:
    """A planet on a gear tester, its toothing eccentric to the bore: angles of its teeth, and a ball in its gaps."""
    teeth, radius = UNIT.planet_teeth, UNIT.planet_pitch_radius
    pitch = 2 * UM * rng.standard_normal((6, 2))
    eccentricity = 5 * UM * (rng.standard_normal() + 1j * rng.standard_normal())
    angle = 2 * np.pi * np.arange(teeth) / teeth
    flanks = radius * np.exp(1j * (angle + waves(pitch, angle) / radius)) + eccentricity
    lead = radius * np.angle(flanks * np.exp(-1j * angle))
    single = lead - np.roll(lead, 1) + 0.4 * UM * rng.standard_normal(teeth)
    ball = abs(radius * np.exp(1j * angle) + eccentricity) - radius + 3 * UM + 0.8 * UM * rng.standard_normal(teeth)
    truth = {f"involute.planet_pitch (harmonic {h})": pair for h, pair in enumerate(pitch, 1)}
    truth["involute.planet_eccentricity"] = np.array([eccentricity.real, eccentricity.imag])
    return truth, table("tooth,fp,Fr", np.arange(teeth), single / UM, ball / UM)


MACHINES: dict[str, tuple[str, Machine]] = {
    "lobe scan": (LOBES, lobe_scan),
    "pin table": (PINS, pin_table),
    "cam scans": (CAMS, cam_scans),
    "pitch chart with runout": (TEETH, pitch_chart),
}


def deviations(name: str, count: int, seed: int) -> Iterator[tuple[str, np.ndarray[Any, Any]]]:
    """Error of each component of each part over its stated uncertainty, by effect."""
    mapping, machine = MACHINES[name]
    with tempfile.TemporaryDirectory() as folder:
        rules = Path(folder, "mapping.toml")
        rules.write_text(mapping, encoding="utf-8")
        for number in range(count):
            truth, lines = machine(np.random.default_rng([seed, number]))
            path = Path(folder, f"part {number}.csv")
            path.write_text(lines, encoding="utf-8")
            (part,) = rverror.load_parts(path, UNIT, mapping=rules).parts
            found = {rverror.base.describe(error.key, error.indices): error for error in part.errors}
            assert found.keys() == truth.keys(), found.keys() ^ truth.keys()
            for key, error in found.items():
                told = np.array(error.values) != 0  # what a datum or a source has no component for
                assert error.uncertainty
                yield key, (np.array(error.values) - truth[key])[told] / error.uncertainty


def main(count: int) -> None:
    print(f"{count} parts each: share of components within 2 sigma, rms of error over sigma")
    for name in MACHINES:
        found = np.concatenate([each for _, each in deviations(name, count, 2026)])
        within = np.mean(np.abs(found) <= 2)
        print(
            f"{name:24} {found.size:7} components  {100 * within:.1f} %  {np.sqrt(np.mean(found**2)):.3f}", flush=True
        )


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 300)
