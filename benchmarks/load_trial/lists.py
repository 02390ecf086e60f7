"""Random reducers with random tolerance lists and limits that bind, from a seed, as files for the command line."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.load_trial import draws, parts, sizes
from benchmarks.load_trial.planar import train_of

import rverror

UNITS = 200  # that set the limits


@dataclass(frozen=True)
class Case:
    """One job for the command line: files, limits as strings with a unit, torques in N m."""

    name: str
    model: Path
    tolerances: Path
    limit: str
    torques: tuple[float, ...]
    lost_motion: str | None = None
    stiffness: str | None = None

    def options(self) -> list[str]:
        """Options of ``rverror allocate``."""
        found = ["--limit", self.limit, "--at", ",".join(f"{torque:g} N*m" for torque in self.torques)]
        found += ["--lost-motion", self.lost_motion] if self.lost_motion else []
        return found + (["--stiffness", self.stiffness] if self.stiffness else [])


# key: least and largest width (um; arcsec for an angle), whether it makes much of the error
_WIDTHS = {
    "involute.sun_eccentricity": (5, 20, False),
    "involute.sun_offset": (3, 10, False),
    "involute.planet_eccentricity": (5, 20, False),
    "involute.sun_pitch": (4, 12, False),
    "involute.planet_pitch": (4, 12, False),
    "involute.tooth_thinning": (4, 12, False),
    "involute.center_distance": (5, 15, False),
    "crank.eccentricity": (1.5, 5, True),
    "crank.index": (10, 60, False),
    "cycloid.disc_profile": (1, 4, True),
    "cycloid.disc_pitch": (2, 6, True),
    "cycloid.pin_position": (3, 10, True),
    "cycloid.pin_circle": (1, 4, True),
    "cycloid.pin_radius": (2, 8, True),
    "cycloid.pin_radius all": (1, 4, False),
    "cycloid.disc_bore_position": (2, 6, True),
    "coupling.carrier_bore_position": (3, 8, False),
    "coupling.carrier_runout": (3, 10, False),
}
_CLEARANCES = ("crank.bearing_clearance", "coupling.bearing_clearance")


def _model(rng: np.random.Generator) -> str:
    """Text of a model file: an RV-40E or a neighbour of another size."""
    pins = int(rng.choice([30, 36, 40, 40, 44, 50]))
    circle = float(rng.choice([50.0, 64.0, 64.0, 76.5, 90.0]))
    z1, z2 = (9, 27) if rng.random() < 0.3 else (int(rng.integers(9, 17)), int(rng.integers(24, 43)))
    fit = 2 * 0.42 * circle / (z1 + z2)
    module = float(min((1.0, 1.25, 1.5, 1.75, 2.0, 2.5), key=lambda m: abs(m - fit)))
    eccentricity = round(float(rng.uniform(0.68, 0.85)) * circle / pins, 2)
    width = math.pi * circle / pins
    rated = 412 * (circle / 64) ** 3 * float(rng.uniform(0.8, 1.2))
    scale = circle / 64
    springs = {
        "pin_contact": 2e5,
        "crank_bearing": 3e5,
        "carrier_bearing": 3e5,
        "gear_mesh": 2e5,
        "sun_support": 1e2,
        "main_bearing": 1e6,
    }
    lines = [
        "[reducer]",
        f"sun_teeth = {z1}",
        f"planet_teeth = {z2}",
        f'module = "{module:g} mm"',
        'pressure_angle = "20 deg"',
        f"disc_lobes = {pins - 1}",
        f"pins = {pins}",
        f'pin_circle_radius = "{circle:g} mm"',
        f'pin_radius = "{round(float(rng.uniform(0.5, 0.62)) * width, 2):g} mm"',
        f'eccentricity = "{eccentricity:g} mm"',
        f"cranks = {int(rng.integers(2, 4))}",
        "discs = 2",
        f'rated_torque = "{rated:.0f} N*m"',
        f'gear_backlash = "{rng.uniform(10, 30):.0f} um"',
        "",
        "[reducer.stiffness]",
    ]
    return "\n".join(lines + [f'{k} = "{v * scale * rng.uniform(0.6, 1.4):.4g} N/mm"' for k, v in springs.items()])


def _cost(rng: np.random.Generator, width: str, value: float, unit: str) -> str:
    kind, base = rng.random(), round(float(rng.uniform(0, 5)), 1)
    price = round(float(rng.uniform(3, 20)), 1)
    if kind < 0.2:
        shares = (0.25, 0.5, 1.0, 1.6)
        rows = ", ".join(f'["{share * value:.4g} {unit}", {base + price / share:.2f}]' for share in shares)
        return f"cost = {{ table = [{rows}] }}"
    curve = "reciprocal" if kind < 0.65 else "reciprocal_square"
    return f'cost = {{ curve = "{curve}", price = {price}, at = "{width}", base = {base} }}'


def _entry(rng: np.random.Generator, key: str, cranks: int) -> str:
    """Text of one tolerance table."""
    name, _, every = key.partition(" ")
    kind, lines = parts.KINDS[name], ["[[tolerance]]", f'key = "{name}"']
    if every:
        lines += ['name = "all pins"', 'indices = { pin = "all" }']
    if "harmonic" in kind.indices:
        harmonic = {"involute.sun_pitch": cranks, "cycloid.pin_circle": int(rng.choice([2, 4]))}
        lines.append(f"indices = {{ harmonic = {harmonic.get(name, int(rng.integers(1, 4)))} }}")
    unit = "arcsec" if name == "crank.index" else "um"
    if name in _CLEARANCES:
        mean = float(rng.uniform(3, 12))
        value = float(f"{mean * rng.uniform(0.15, 0.4):.3g}")
        lines.append(f'mean = "{mean:.2f} um"')
    else:
        low, high, _ = _WIDTHS[key]
        value = float(f"{low * (high / low) ** rng.random():.3g}")
    one = len(kind.parameters) == 1
    scalar: tuple[str, ...] = ("normal", "uniform", "triangular")
    if kind.vector and not one and name != "cycloid.pin_circle" and rng.random() < 0.2:
        lines.append(f'parameters = ["{kind.parameters[int(rng.integers(2))]}"]')
        laws = scalar
    else:
        laws = ("rayleigh", *scalar) if kind.vector else scalar
    width = f"{value:g} {unit}"
    if every or name == "involute.tooth_thinning":  # one-sided: it is ground, or worn, below the nominal size
        lines.append(f'tolerance = "0/-{2 * value:g} um"' if every else f'tolerance = "+{2 * value:g}/0 um"')
    else:
        lines.append(f'tolerance = "{width}"')
    if rng.random() < 0.6:
        lines.append(f'distribution = "{rng.choice(laws)}"')
    if rng.random() < 0.2 and not {'"uniform"', '"triangular"'} & set(lines[-1].split()):
        lines.append("capability = 1.33")
    return "\n".join([*lines, _cost(rng, width, value, unit)])


def random_case(seed: int, folder: Path) -> Case:
    """Write a random model and list and choose limits that its widths, as given, do not hold but tighter ones do.

    The limit of the transmission error lies 0.75 to 0.95 of the way from what a unit with all parts at their means
    makes to the 99th percentile of 200 units (of the worse of two torques), that of the lost motion likewise.
    """
    rng = np.random.default_rng([2024, seed])
    model, tolerances = folder / f"model-{seed}.toml", folder / f"tolerances-{seed}.toml"
    while True:
        model.write_text(_model(rng) + "\n", encoding="utf-8")
        try:
            mechanism: Any = rverror.load_model(model).mechanism
            break
        except ValueError:  # an impossible geometry: another one
            continue
    train = train_of(mechanism)
    loud = [key for key, (_, _, much) in _WIDTHS.items() if much]
    quiet = [key for key in _WIDTHS if key not in loud]
    count = int(rng.integers(5, 13))
    keys = list(rng.choice(loud, int(rng.integers(3, min(count, len(loud)) + 1)), replace=False))
    if rng.random() < 0.6:
        keys += list(rng.choice(_CLEARANCES, int(rng.integers(1, 3)), replace=False))
    keys += list(rng.choice(quiet, max(0, count - len(keys)), replace=False))
    text = "\n\n".join([f'name = "list {seed}"', *(_entry(rng, str(key), train.cranks) for key in keys)])
    tolerances.write_text(text + "\n", encoding="utf-8")
    rated = mechanism.rated_torque / 1e3
    torques = [float(f"{rated * rng.uniform(0.04, 0.3):.2g}"), float(f"{rated:.0f}")]
    case = Case(f"random {seed}", model, tolerances, "", tuple(torques if rng.random() < 0.6 else torques[1:]))

    entries = draws.read(tolerances, train)
    like = parts.build(train, draws.middle(entries))
    units = [parts.build(train, errors) for errors in draws.draw(entries, UNITS, seed)]
    limit = 0.0
    share = rng.uniform(0.75, 0.95)
    for torque in case.torques:
        floor = sizes.Turn(train, 1e3 * torque, like).peak_to_peak(like)
        high = float(np.quantile(sizes.transmission_errors(train, units, 1e3 * torque, like), 0.99))
        limit = max(limit, floor + share * (high - floor))
    case = replace(case, limit=f"{limit:.3g} arcsec")
    if rng.random() < 0.4:
        floor = float(sizes.lost_motions(train, [like], 1e3 * rated, like)[0])
        high = float(np.quantile(sizes.lost_motions(train, units, 1e3 * rated, like), 0.99))
        case = replace(case, lost_motion=f"{floor + rng.uniform(0.75, 0.95) * (high - floor):.4g} arcsec")
    return case
