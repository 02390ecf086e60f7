"""Part errors by their catalogue keys, put where they act in a unit; sizes read from strings with a unit."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from benchmarks.load_trial.kernel import Train, Unit
from benchmarks.load_trial.planar import perfect

_UNITS = {
    "nm": 1e-6,
    "um": 1e-3,
    "µm": 1e-3,
    "μm": 1e-3,
    "mm": 1.0,
    "m": 1e3,
    "arcsec": math.pi / 648000,
    "arcmin": math.pi / 10800,
    "deg": math.pi / 180,
    "mrad": 1e-3,
    "rad": 1.0,
}
_NUMBER = r"[+−±-]?\s*(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"


def size(given: str | float) -> float:
    """Value of "5 um" and the like in mm or rad; a plain number is taken as it is.

    Raises
    ------
    ValueError
        If it is no number with a unit of length or angle.
    """
    if isinstance(given, (int, float)):
        return float(given)
    found = re.fullmatch(rf"\s*({_NUMBER})\s*([^\W\d]+)\s*", given)
    if not found or found[2] not in _UNITS:
        raise ValueError(f"{given!r} is no size")
    return float(found[1].replace("−", "-").replace("±", "").replace(" ", "")) * _UNITS[found[2]]


def limits(given: str | float | list[Any]) -> tuple[float, float]:
    """Width and middle, mm or rad, of "5 um", "±5 um", "+7/-3 um" or ["-3 um", "7 um"]."""
    if isinstance(given, list):
        low, high = sorted(size(end) for end in given)
    elif isinstance(given, str) and "/" in given:
        first, second = given.split("/")
        unit = re.sub(r"^[\s\d.eE+−-]*", "", second)
        low, high = sorted((size(first if re.search(r"[^\W\d]\s*$", first) else f"{first} {unit}"), size(second)))
    else:
        return size(given), 0.0
    return (high - low) / 2, (high + low) / 2


class Kind(NamedTuple):
    """Parameters of a source, those that are vectors in pairs, and its indices."""

    parameters: tuple[str, ...]
    indices: tuple[str, ...] = ()
    vector: bool = True


_POLAR, _PLANE, _WAVE = ("radial", "tangential"), ("x", "y"), ("cos", "sin")
KINDS = {
    "involute.center_distance": Kind(_POLAR, ("crank",)),
    "involute.sun_eccentricity": Kind(_PLANE),
    "involute.sun_offset": Kind(_PLANE),
    "involute.planet_eccentricity": Kind(_PLANE, ("crank",)),
    "involute.sun_pitch": Kind(_WAVE, ("harmonic",)),
    "involute.planet_pitch": Kind(_WAVE, ("crank", "harmonic")),
    "involute.spline_clearance": Kind(("clearance",), ("crank",), vector=False),
    "involute.tooth_thinning": Kind(("thinning",), ("member",), vector=False),
    "crank.eccentricity": Kind(_POLAR, ("crank", "disc")),
    "crank.index": Kind(("angle",), ("crank",), vector=False),
    "crank.bearing_clearance": Kind(("clearance",), vector=False),
    "cycloid.disc_profile": Kind(_WAVE, ("disc", "harmonic")),
    "cycloid.disc_pitch": Kind(_WAVE, ("disc", "harmonic")),
    "cycloid.disc_lobe": Kind(("deviation",), ("disc", "lobe"), vector=False),
    "cycloid.pin_position": Kind(_POLAR, ("pin",)),
    "cycloid.pin_circle": Kind(("radial_cos", "radial_sin", "tangential_cos", "tangential_sin"), ("harmonic",)),
    "cycloid.pin_radius": Kind(("deviation",), ("pin",), vector=False),
    "cycloid.profile_modification": Kind(("equidistant", "shift"), vector=False),
    "cycloid.disc_bore_position": Kind(_POLAR, ("disc", "crank")),
    "coupling.carrier_bore_position": Kind(_POLAR, ("crank",)),
    "coupling.bearing_clearance": Kind(("clearance",), vector=False),
    "coupling.carrier_runout": Kind(_PLANE, ()),
}


class Error(NamedTuple):
    """One instance of a source with the size of each of its parameters, mm or rad."""

    key: str
    indices: Mapping[str, Any]
    values: tuple[float, ...]


def build(train: Train, errors: Iterable[Error]) -> Unit:
    """Put the errors together as a unit; a clearance below 0 counts as 0, and takes from the preload."""
    unit = perfect(train)
    unit.clearance[:] = 0.0
    disc_waves, sun_waves, planet_waves = [], [], []
    turn = 2 * np.pi * np.arange(train.pins) / train.pins
    for key, index, values in errors:
        source = key.partition(".")[2]
        value: Any = np.array(values)
        match source if key in KINDS else "":
            case "center_distance":
                unit.centre_distance[index["crank"]] += value
            case "sun_eccentricity":
                unit.sun_eccentricity[:] += value
            case "sun_offset":
                unit.sun_offset[:] += value
            case "planet_eccentricity":
                unit.planet_eccentricity[index["crank"]] += value
            case "sun_pitch":
                sun_waves.append((index["harmonic"], *values))
            case "planet_pitch":
                planet_waves.append((index["crank"], index["harmonic"], *values))
            case "tooth_thinning":
                unit.thinning[:] += value[0]
            case "eccentricity":
                unit.cams[index["crank"], index["disc"]] += value
            case "index":
                unit.crank_lead[index["crank"]] += value[0]
            case "bearing_clearance":
                unit.clearance[0 if key.startswith("crank") else 1] += value[0]
            case "spline_clearance":
                if not train.spline_radius > 0:
                    raise ValueError(f"{key} needs a spline_radius")
                unit.spline[index["crank"]] += value[0]
            case "disc_lobe":
                unit.lobes[index["disc"], index["lobe"]] += value[0]
            case "disc_profile" | "disc_pitch":
                disc_waves.append((index["disc"], source == "disc_pitch", index["harmonic"], *values))
            case "pin_position":
                unit.pin_place[index["pin"]] += value
            case "pin_circle":
                wave = np.array([np.cos(index["harmonic"] * turn), np.sin(index["harmonic"] * turn)]).T
                unit.pin_place[:] += wave @ value.reshape(2, 2).T
            case "pin_radius":
                unit.pin_radius[slice(None) if index["pin"] == "all" else index["pin"]] += value[0]
            case "profile_modification":
                unit.grinding[:] += value
            case "disc_bore_position":
                unit.bores[index["disc"], index["crank"]] += value
            case "carrier_bore_position":
                unit.carrier_bores[index["crank"]] += value
            case "carrier_runout":
                unit.runout[:] += value
            case _:
                raise ValueError(f"{key} is not judged here")
    for clearance in (unit.clearance, unit.spline):
        np.maximum(clearance, 0.0, out=clearance)
    unit.clearance[:] -= train.preload_cam, train.preload_bore
    return unit._replace(
        disc_waves=np.array(disc_waves, dtype=float).reshape(-1, 5),
        sun_waves=np.array(sun_waves, dtype=float).reshape(-1, 3),
        planet_waves=np.array(planet_waves, dtype=float).reshape(-1, 4),
    )


def declared(path: str | Path) -> list[Error]:
    """Effects that a model file declares, in the file's order.

    Raises
    ------
    ValueError
        If one is of a kind that is not judged here.
    """
    errors = []
    for table in tomllib.loads(Path(path).read_text(encoding="utf-8")).get("effect", []):
        kind = KINDS.get(table["key"])
        if kind is None:
            raise ValueError(f"{table['key']} is not judged here")
        index = {name: table[name] for name in kind.indices}
        errors.append(Error(table["key"], index, tuple(size(table.get(name, 0.0)) for name in kind.parameters)))
    return errors
