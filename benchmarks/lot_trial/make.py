"""A lot of simulated RV-40E with what a bench reads of them, drawn from a seed.

    python -m benchmarks.lot_trial.make --seed S --out FOLDER [--kind plain] [--units N] [--unmarked]

FOLDER gets model.toml, which declares no part error and whose stiffnesses are not the true ones, units.csv with the
labels of each serial, two runs of one turn for each unit, forward.csv and reverse.csv, and truth.json.  Kinds:

plain     two to five classes of part errors, each with a spread of its own about zero
machine   machine B makes one cam 3 to 12 um off, outwards or along; three units have one part 30 to 90 um off
drift     the pitch of disc 0 goes off, 6 um once a turn at the last unit, from 60 % of the lot on
sound     labels that mean nothing
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from benchmarks.load_trial.kernel import Train
from benchmarks.load_trial.parts import Error, build
from benchmarks.load_trial.planar import Array, train_of
from benchmarks.lot_trial.exact import solve
from scipy.signal import lfilter

import rverror

MODEL = Path(__file__).parent / "model.toml"
UM, ARCSEC = 1e-3, math.pi / 648000
SAMPLES, COUNTS = 512, 2**28  # of one turn of the output
TORQUES = (20, 60, 150, 412)  # N m
WRONG = 0.12  # spread of the logarithm of a true stiffness over that of the model
OFFSET = 30.0  # arcsec: the zero of a run is anywhere within so many of where it should be
SHIFT, SPOILT, DRIFT = (3.0, 12.0), (30.0, 90.0), 6.0  # um
STIFFNESS = {
    "pin_contact": "k_pin",
    "crank_bearing": "k_cam",
    "carrier_bearing": "k_bore",
    "gear_mesh": "k_mesh",
    "sun_support": "k_sun",
    "main_bearing": "k_main",
}


class Class(NamedTuple):
    """Errors that share one standard deviation: their parameters, instances, and least and largest deviation."""

    parameters: tuple[str, ...]
    indices: tuple[str, ...]
    least: float
    most: float
    unit: str = "um"


POLAR, WAVE = ("radial", "tangential"), ("cos", "sin")
ENCODER, CAM, BORE, PIN, PITCH = (
    "sensor.encoder_eccentricity",
    "crank.eccentricity",
    "cycloid.disc_bore_position",
    "cycloid.pin_position",
    "cycloid.disc_pitch",
)
CLASSES = {
    CAM: Class(POLAR, ("crank", "disc"), 1, 3),
    BORE: Class(POLAR, ("disc", "crank"), 1, 3),
    PIN: Class(POLAR, ("pin",), 0.8, 3),
    "cycloid.pin_radius": Class(("deviation",), ("pin",), 0.5, 2),
    PITCH: Class(WAVE, ("disc", "harmonic"), 1, 3),
    "cycloid.disc_profile": Class(WAVE, ("disc", "harmonic"), 0.5, 2),
    ENCODER: Class(WAVE, (), 1, 5, "arcsec"),
}


class Plan(NamedTuple):
    """What all units of a lot share."""

    seed: int
    kind: str
    units: int
    torque: int  # N m
    deviations: Mapping[str, float]  # by key, um or arcsec
    factors: Mapping[str, float]  # true stiffness over that of the model
    noise: float  # arcsec rms
    memory: float  # of the noise, from sample to sample


@dataclass(frozen=True)
class Lot:
    """A lot as its files have it; runs in the order of the bench, forward up and reverse down.

    Attributes
    ----------
    serials : tuple of str
    labels : mapping of str to tuple of str
        Label of each unit.
    torques : tuple of float
        N m.
    inputs : ndarray, shape (2, samples)
        Input angles of forward and reverse runs, deg.
    outputs : ndarray, shape (units, 2 * torques, samples)
        Readings of the output, deg, forward and reverse under one torque after another.
    truth : dict
        What truth.json says.
    errors : tuple of tuple of Error
        Of each unit, mm and rad.
    index : str
        What the head of each run says of its zero.
    """

    serials: tuple[str, ...]
    labels: Mapping[str, tuple[str, ...]]
    torques: tuple[float, ...]
    inputs: Array
    outputs: Array
    truth: dict[str, Any]
    errors: tuple[tuple[Error, ...], ...]
    index: str = ""


def draw_plan(seed: int, kind: str, units: int | None) -> Plan:
    """Draw what the units share; ``units`` changes nothing else."""
    rng = np.random.default_rng([seed, 0])
    drawn = int(rng.integers(60, 301))
    chosen = rng.choice(list(CLASSES), size=int(rng.integers(2, 6)), replace=False).tolist()
    torque = int(rng.choice(TORQUES))
    return Plan(
        seed,
        kind,
        drawn if units is None else units,
        torque,
        {key: float(rng.uniform(CLASSES[key].least, CLASSES[key].most)) for key in CLASSES if key in chosen},
        {name: float(np.exp(WRONG * rng.normal())) for name in STIFFNESS},
        float(rng.uniform(0.2, 0.5)),
        float(rng.uniform(0.0, 0.6)),
    )


def draw_labels(plan: Plan) -> dict[str, tuple[str, ...]]:
    """Labels of all units, half of them each."""
    names = {"machine": {"machine": "AB"}, "sound": {"machine": "AB", "supplier": "XY"}}.get(plan.kind, {})
    rng = np.random.default_rng([plan.seed, 1])
    halves = np.arange(plan.units) % 2
    return {name: tuple(letters[at] for at in rng.permutation(halves)) for name, letters in names.items()}


def instances(key: str, train: Train) -> Iterator[dict[str, int]]:
    """Indices of all parts of a class."""
    every = {"crank": range(train.cranks), "disc": range(train.discs), "pin": range(train.pins), "harmonic": (1,)}
    names = CLASSES[key].indices
    for at in itertools.product(*(every[name] for name in names)):
        yield dict(zip(names, at, strict=True))


def draw_errors(plan: Plan, serial: int, train: Train) -> list[Error]:
    """Errors of a unit of the plain kind."""
    rng, errors = np.random.default_rng([plan.seed, 2, serial]), []
    for key, deviation in plan.deviations.items():
        size = deviation * (ARCSEC if CLASSES[key].unit == "arcsec" else UM)
        for at in instances(key, train):
            values = size * rng.normal(size=len(CLASSES[key].parameters))
            errors.append(Error(key, at, tuple(values.tolist())))
    return errors


def draw_spoilt(plan: Plan, train: Train) -> dict[int, Error]:
    """Three units of a lot of the kind machine and what is wrong with each."""
    if plan.kind != "machine":
        return {}
    rng, spoilt = np.random.default_rng([plan.seed, 3]), {}
    for serial in sorted(rng.choice(plan.units, size=min(3, plan.units), replace=False).tolist()):
        key = str(rng.choice([CAM, PIN, BORE]))
        places = list(instances(key, train))
        turn, size = 0.0 if key == PIN else rng.uniform(0, 2 * math.pi), UM * rng.uniform(*SPOILT)
        at = places[int(rng.integers(len(places)))]
        spoilt[serial] = Error(key, at, (size * math.cos(turn), size * math.sin(turn)))
    return spoilt


def draw_station(plan: Plan, train: Train) -> Error:
    """What machine B does to one cam of all its units."""
    rng = np.random.default_rng([plan.seed, 5])
    at = {"crank": int(rng.integers(train.cranks)), "disc": int(rng.integers(train.discs))}
    size = UM * rng.uniform(*SHIFT)
    return Error(CAM, at, (size, 0.0) if rng.integers(2) else (0.0, size))


def shifted(plan: Plan, serial: int, labels: Mapping[str, tuple[str, ...]], train: Train) -> list[Error]:
    """What the kind of a lot adds to a unit beside the three that are spoilt."""
    if plan.kind == "machine" and labels["machine"][serial] == "B":
        return [draw_station(plan, train)]
    first = drift_from(plan)
    if plan.kind == "drift" and serial >= first:
        grown = (serial - first + 1) / (plan.units - first)
        return [Error(PITCH, {"disc": 0, "harmonic": 1}, (DRIFT * UM * grown, 0.0))]
    return []


def drift_from(plan: Plan) -> int:
    """First unit that the drift has moved."""
    return round(0.6 * plan.units)


def draw_readings(plan: Plan, serial: int, errors: list[Error], train: Train, theta: Array, load: int = 0) -> Array:
    """Readings of the output in both runs under the plan's torque, a unit's first or another, deg, (2, samples)."""
    rng, readings = np.random.default_rng([plan.seed, 4, serial, load]), []
    for sense, output in zip((1, -1), true_outputs(plan, errors, train, theta), strict=True):
        added = rng.uniform(-OFFSET, OFFSET) + draw_noise(plan, rng, theta.size)
        turns = (output[::sense] + ARCSEC * added) / (2 * math.pi)
        readings.append(360 * np.round(COUNTS * turns) / COUNTS)
    return np.array(readings)


def true_outputs(plan: Plan, errors: list[Error], train: Train, theta: Array) -> Array:
    """Output as its encoder has it in both directions, without noise, rad, (2, samples)."""
    unit = build(train, [error for error in errors if error.key != ENCODER])
    cos, sin = np.sum([error.values for error in errors if error.key == ENCODER] or [(0.0, 0.0)], axis=0)
    read = []
    for sense in (1, -1):
        solved = solve(train, unit, theta, sense * 1e3 * plan.torque)
        if not solved.settled.all():
            raise ArithmeticError(f"a unit of seed {plan.seed} has not settled at {plan.torque} N m")
        read.append(theta + solved.output + cos * np.cos(theta) + sin * np.sin(theta))
    return np.array(read)


def draw_noise(plan: Plan, rng: np.random.Generator, count: int) -> Array:
    """Noise of one run, arcsec: each sample keeps a share of the last one."""
    first = plan.noise * rng.normal()
    steps = plan.noise * math.sqrt(1 - plan.memory**2) * rng.normal(size=count)
    noise, _ = lfilter([1.0], [1.0, -plan.memory], steps, zi=[plan.memory * first])
    return np.asarray(noise, dtype=np.float64)


def true_train(plan: Plan) -> Train:
    """Numbers of the model with the true stiffnesses."""
    train = train_of(rverror.load_model(MODEL).mechanism)
    return train._replace(**{at: plan.factors[name] * getattr(train, at) for name, at in STIFFNESS.items()})


def simulate(seed: int, kind: str = "plain", units: int | None = None, torques: Sequence[int] = ()) -> Lot:
    """Draw and solve a lot.

    Parameters
    ----------
    seed : int
    kind : str
        plain, machine, drift or sound.
    units : int, optional
        In place of as many as the seed says; a unit is the same in a lot of any size, but for labels and drift.
    torques : sequence of int, optional
        N m, in place of the one that the seed says.
    """
    plan = draw_plan(seed, kind, units)
    loads = tuple(torques) or (plan.torque,)
    train, labels = true_train(plan), draw_labels(plan)
    spoilt, theta = draw_spoilt(plan, train), 2 * math.pi * np.arange(SAMPLES) / SAMPLES
    errors, outputs = [], []
    for serial in range(plan.units):
        own = draw_errors(plan, serial, train) + shifted(plan, serial, labels, train)
        own += [spoilt[serial]] if serial in spoilt else []
        errors.append(tuple(own))
        read = [draw_readings(plan._replace(torque=t), serial, own, train, theta, at) for at, t in enumerate(loads)]
        outputs.append(np.concatenate(read))
    given = train.ratio * 360 * np.arange(SAMPLES) / SAMPLES
    return Lot(
        tuple(f"{serial:04d}" for serial in range(plan.units)),
        labels,
        loads,
        np.array([given, given[::-1]]),
        np.array(outputs),
        truth_of(plan, spoilt) | ({"torque_Nm": list(loads)} if torques else {}),
        tuple(errors),
    )


def unmarked(lot: Lot) -> Lot:
    """The same units, the runs of each begun at a sample of its own, which nobody knows."""
    begun = np.random.default_rng([lot.truth["seed"], 6]).integers(SAMPLES, size=len(lot.outputs))
    ideal = np.tile(lot.inputs / 121, (len(lot.torques), 1))
    outputs = [
        [
            way + np.roll(error, by if at % 2 == 0 else -by)
            for at, (way, error) in enumerate(zip(ideal, unit - ideal, strict=True))
        ]
        for unit, by in zip(lot.outputs, begun.tolist(), strict=True)
    ]
    return replace(lot, outputs=np.array(outputs), index="unknown")


def name_of(key: str) -> str:
    """Key of a class with its harmonic."""
    return f"{key} (harmonic 1)" if "harmonic" in CLASSES[key].indices else key


def truth_of(plan: Plan, spoilt: Mapping[int, Error]) -> dict[str, Any]:
    """What truth.json says."""
    found: dict[str, Any] = {"simulated": True, "seed": plan.seed, "kind": plan.kind, "units": plan.units}
    for unit in ("um", "arcsec"):
        found[f"sd_{unit}"] = {name_of(key): s for key, s in plan.deviations.items() if CLASSES[key].unit == unit}
    shift: dict[str, Any] | None = None
    if plan.kind == "machine":
        station = draw_station(plan, true_train(plan))
        at = int(np.argmax(station.values))
        shift = {"key": CAM, **station.indices, "parameter": POLAR[at], "machine": "B", "um": station.values[at] / UM}
    if plan.kind == "drift":
        first = drift_from(plan)
        shift = {"key": PITCH, "disc": 0, "harmonic": 1, "parameter": "cos", "from": f"{first:04d}", "last_um": DRIFT}
    found["shift"] = shift
    found["spoilt"] = {f"{serial:04d}": _told(error) for serial, error in spoilt.items()}
    found["torque_Nm"] = plan.torque
    found["noise"] = {"rms_arcsec": plan.noise, "memory": plan.memory, "counts": COUNTS, "offset_arcsec": OFFSET}
    found["stiffness_factors"] = dict(plan.factors)
    return found


def _told(error: Error) -> dict[str, Any]:
    sizes = zip(CLASSES[error.key].parameters, error.values, strict=True)
    return {"key": error.key, **error.indices, **{f"{name}_um": value / UM for name, value in sizes}}


def write(lot: Lot, folder: Path) -> None:
    """Write the files of a lot."""
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(MODEL, folder / "model.toml")
    rows = zip(lot.serials, *lot.labels.values(), strict=True)
    lines = [",".join(row) for row in [("serial", *lot.labels), *rows]]
    (folder / "units.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    for serial, runs in zip(lot.serials, lot.outputs, strict=True):
        (folder / serial).mkdir(exist_ok=True)
        conditions = itertools.product(lot.torques, zip(("forward", "reverse"), lot.inputs, strict=True))
        for (torque, (direction, given)), read in zip(conditions, runs, strict=True):
            head = f"# direction: {direction}\n# output_torque: {torque:g} N*m\n"
            head += f"# index: {lot.index}\n" * bool(lot.index) + "input_angle[deg],output_angle[deg]\n"
            body = "".join(f"{x:.6f},{y:.8f}\n" for x, y in zip(given.tolist(), read.tolist(), strict=True))
            name = direction if len(lot.torques) == 1 else f"{direction}-{torque:g}"
            (folder / serial / f"{name}.csv").write_text(head + body, encoding="utf-8")
    (folder / "truth.json").write_text(json.dumps(lot.truth, indent=1) + "\n", encoding="utf-8")


def main(words: list[str] | None = None) -> None:
    """Write the lot that the words of the command line say."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--kind", choices=("plain", "machine", "drift", "sound"), default="plain")
    parser.add_argument("--units", type=int, help="in place of 60 to 300 by the seed")
    parser.add_argument("--torque", type=int, action="append", default=[], help="N m, in place of the seed's; or more")
    parser.add_argument("--unmarked", action="store_true", help="zeros of the runs are not on the marks")
    given = parser.parse_args(words)
    start = time.perf_counter()
    lot = simulate(given.seed, given.kind, given.units, given.torque)
    lot = unmarked(lot) if given.unmarked else lot
    write(lot, given.out)
    loads = ", ".join(f"{torque:g}" for torque in lot.torques)
    print(f"{given.out}: {len(lot.serials)} units at {loads} N*m in {time.perf_counter() - start:.1f} s")


if __name__ == "__main__":
    main()
