"""A simulated RV-40E measured again and again over its life, drawn from a seed.

    python -m benchmarks.trend_trial.make --seed S --out FOLDER [--kind growing] [--sessions 20]

FOLDER gets model.toml, which declares no part error and whose stiffnesses are not the true ones, two runs of one turn
for each session, 01-forward.csv and so on, and truth.json.  Parts have errors of all classes of `lot_trial`, cams a
clearance, pins a power law.  In half of the units the bench's encoder is mounted anew for each session.  Kinds:

growing   one part changes in proportion to the hours, from the start or from some hour on
settling  one part changes as 1 - exp(-hours / tau)
jump      one part is another between two sessions
sound     no part changes
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from benchmarks.load_trial.kernel import Train
from benchmarks.load_trial.parts import Error, build
from benchmarks.load_trial.planar import Array, train_of
from benchmarks.lot_trial import make as lots
from benchmarks.lot_trial.exact import Law, solve
from benchmarks.lot_trial.make import ARCSEC, COUNTS, ENCODER, OFFSET, SAMPLES, STIFFNESS, UM, Plan

import rverror

KINDS = ("growing", "settling", "jump", "sound")
SESSIONS, LIFE = 20, (500.0, 2000.0)  # h
WRONG = 0.25  # spread of the logarithm of a true stiffness over that of the model
REFERENCE = (20.0, 2000.0)  # N: at which force a pin of the power law has its stiffness
CLEARANCE = 3.0  # um, of cams of a new unit, at most
MOUNTING = 4.0  # arcsec, standard deviation of both components of the encoder's eccentricity after a mounting
POLAR, WAVE = lots.POLAR, lots.WAVE


class Cause(NamedTuple):
    """What may change: instances, parameters, and least and largest change in a life; a single one has a sign."""

    key: str
    indices: tuple[dict[str, Any], ...]
    parameters: tuple[str, ...]
    least: float
    most: float
    sign: int = 1
    unit: str = "um"


DISCS = tuple({"disc": disc, "harmonic": 1} for disc in (0, 1))
CAUSES = (
    Cause("involute.tooth_thinning", ({"member": "sun"}, {"member": "planet"}), ("thinning",), 1, 30),
    Cause("crank.bearing_clearance", ({},), ("clearance",), 1, 15),
    Cause("cycloid.pin_radius", tuple({"pin": pin} for pin in range(40)), ("deviation",), 1, 30, -1),
    Cause("cycloid.pin_radius", ({"pin": "all"},), ("deviation",), 0.3, 10, -1),
    Cause("cycloid.disc_profile", DISCS, WAVE, 0.3, 10),
    Cause("cycloid.disc_pitch", DISCS, WAVE, 0.3, 10),
    Cause(lots.CAM, tuple({"crank": j, "disc": k} for j in (0, 1) for k in (0, 1)), POLAR, 0.5, 20),
    Cause("involute.planet_pitch", tuple({"crank": j, "harmonic": 1} for j in (0, 1)), WAVE, 1, 30),
    Cause(ENCODER, ({},), WAVE, 0.3, 10, unit="arcsec"),  # of units whose encoder stays mounted
)


class Course(NamedTuple):
    """What changes in one unit: sizes at a share of 1, um or arcsec, and the share at each session."""

    cause: Cause
    indices: dict[str, Any]
    sizes: tuple[float, ...]
    course: str
    since: float  # h; of a jump the session before it
    until: float  # h; of a jump the session after it, of what settles the hours of one tau, else the last session
    shares: Array


@dataclass(frozen=True)
class Life:
    """A unit's life as its files have it.

    Attributes
    ----------
    hours : ndarray, shape (sessions,)
    labels : tuple of str
        Index of each session: sessions of one label share their zero.
    true : ndarray, shape (sessions, 2, samples)
        Output error over the angle of the output, forward and reverse, rad, as an encoder without error has it.
    outputs : ndarray, shape (sessions, 2, samples)
        Readings of the output, deg, over the same angles.
    plan : Plan
        Torque, noise and stiffness, as a lot has them.
    truth : dict
        What truth.json says.
    """

    hours: Array
    labels: tuple[str, ...]
    true: Array
    outputs: Array
    plan: Plan
    truth: dict[str, Any]


THETA = 2 * math.pi * np.arange(SAMPLES) / SAMPLES


def draw_plan(seed: int) -> Plan:
    """Torque, noise, stiffnesses and deviations of a unit; each class of errors has one."""
    rng = np.random.default_rng([seed, 10])
    sizes = {key: float(rng.uniform(one.least, one.most)) for key, one in lots.CLASSES.items()}
    factors = {name: float(np.exp(WRONG * rng.normal())) for name in STIFFNESS}
    return lots.draw_plan(seed, "plain", 1)._replace(deviations=sizes, factors=factors)


def draw_hours(seed: int, sessions: int) -> Array:
    """Hours of the sessions, the first at 0, in irregular steps."""
    rng = np.random.default_rng([seed, 11])
    steps = rng.gamma(2.0, size=sessions)
    hours = np.cumsum(steps) - steps[0]
    return np.asarray(np.round(rng.uniform(*LIFE) * hours / hours[-1], 1), dtype=np.float64)


def is_remounted(seed: int) -> bool:
    """Whether the encoder of a unit's bench is mounted anew for each session."""
    return bool(np.random.default_rng([seed, 15]).integers(2))


def draw_change(seed: int, kind: str, hours: Array, remounted: bool) -> Course | None:
    """What changes, how far and in which course; None in a sound unit."""
    if kind == "sound":
        return None
    rng = np.random.default_rng([seed, 12])
    cause = CAUSES[int(rng.integers(len(CAUSES) - remounted))]
    indices = cause.indices[int(rng.integers(len(cause.indices)))]
    size, turn = math.exp(rng.uniform(math.log(cause.least), math.log(cause.most))), rng.uniform(0, 2 * math.pi)
    pair = len(cause.parameters) == 2
    sizes = (size * math.cos(turn), size * math.sin(turn)) if pair else (cause.sign * size,)
    last = float(hours[-1])
    if kind == "jump":
        at = int(rng.integers(hours.size // 4, 1 + 3 * hours.size // 4))
        shares = np.where(np.arange(hours.size) < at, 0.0, 1.0)
        return Course(cause, indices, sizes, kind, float(hours[at - 1]), float(hours[at]), shares)
    if kind == "settling":
        tau = last * rng.uniform(0.1, 0.4)
        return Course(cause, indices, sizes, kind, 0.0, tau, 1 - np.exp(-hours / tau))
    since = float(rng.choice([0.0, rng.uniform(0.2, 0.6) * last]))
    return Course(cause, indices, sizes, "linear", since, last, np.maximum(hours - since, 0) / (last - since))


def draw_errors(plan: Plan, train: Train) -> list[Error]:
    """Errors that a unit has from the start."""
    clearance = UM * np.random.default_rng([plan.seed, 13]).uniform(0, CLEARANCE)
    return [*lots.draw_errors(plan, 0, train), Error("crank.bearing_clearance", {}, (clearance,))]


def draw_law(seed: int) -> Law:
    """Law of the pins, that of a line's contact."""
    return Law(10 / 9, math.exp(np.random.default_rng([seed, 14]).uniform(*np.log(REFERENCE))))


def true_train(plan: Plan) -> Train:
    """Numbers of the model with the true stiffnesses."""
    train = train_of(rverror.load_model(lots.MODEL).mechanism)
    return train._replace(**{at: plan.factors[name] * getattr(train, at) for name, at in STIFFNESS.items()})


def true_errors(train: Train, errors: list[Error], torque: float, law: Law) -> Array:
    """Output error as the encoder has it over `THETA` in both directions, without noise, rad, (2, samples)."""
    unit = build(train, [error for error in errors if error.key != ENCODER])
    read = [error.values for error in errors if error.key == ENCODER]
    chain = sum((cos * np.cos(THETA) + sin * np.sin(THETA) for cos, sin in read), np.zeros(SAMPLES))
    solved = [solve(train, unit, THETA, sense * 1e3 * torque, law) for sense in (1, -1)]
    if not all(one.settled.all() for one in solved):
        raise ArithmeticError(f"a unit has not settled at {torque:g} N m")
    return np.array([one.output + chain for one in solved])


def changed(change: Course | None, session: int) -> list[Error]:
    """What the change adds to the errors at a session."""
    if change is None:
        return []
    by = float(change.shares[session]) * (UM if change.cause.unit == "um" else ARCSEC)
    return [Error(change.cause.key, change.indices, tuple(by * size for size in change.sizes))]


def simulate(seed: int, kind: str = "growing", sessions: int = SESSIONS) -> Life:
    """Draw and solve a unit's life; with other sessions its parts, load and noise are the same, its hours not."""
    plan, hours = draw_plan(seed), draw_hours(seed, sessions)
    remounted, rng = is_remounted(seed), np.random.default_rng([seed, 15, 0])
    shared = bool(rng.integers(2)) and not remounted  # one zero for all sessions
    train, law, change = true_train(plan), draw_law(seed), draw_change(seed, kind, hours, remounted)
    errors, solved = draw_errors(plan, train), dict[float, Array]()
    for session, share in enumerate([0.0] * sessions if change is None else change.shares.tolist()):
        if share not in solved:
            solved[share] = true_errors(train, errors + changed(change, session), plan.torque, law)
    true = np.array([solved[share] for share in ([0.0] * sessions if change is None else change.shares.tolist())])
    zero, outputs = rng.uniform(-OFFSET, OFFSET), []
    for one in true:
        cos, sin = MOUNTING * rng.normal(size=2) * remounted
        zero = zero if shared else rng.uniform(-OFFSET, OFFSET)
        bench = zero + cos * np.cos(THETA) + sin * np.sin(THETA)
        noise = [lots.draw_noise(plan, rng, SAMPLES)[::sense] for sense in (1, -1)]
        turns = (THETA + one + ARCSEC * (bench + np.array(noise))) / (2 * math.pi)
        outputs.append(360 * np.round(COUNTS * turns) / COUNTS)
    labels = tuple("A" if shared else f"S{session + 1:02d}" for session in range(sessions))
    truth = {
        "simulated": True,
        "seed": seed,
        "kind": kind,
        "torque_Nm": plan.torque,
        "hours": hours.tolist(),
        "remounted": remounted,
        "shared_zero": shared,
        "change": None if change is None else told(change, hours),
        "errors_from_the_start": [{"key": e.key, **e.indices, "mm_or_rad": list(e.values)} for e in errors],
        "noise": {"rms_arcsec": plan.noise, "memory": plan.memory},
        "stiffness_factors": dict(plan.factors),
        "pin_law": law._asdict(),
    }
    return Life(hours, labels, true, np.array(outputs), plan, truth)


def told(change: Course, hours: Array) -> dict[str, Any]:
    """What truth.json says of a change; the rate is that of a mean from its beginning to the last session."""
    sizes = dict(zip(change.cause.parameters, change.sizes, strict=True))
    found: dict[str, Any] = {"key": change.cause.key, "indices": change.indices, "unit": change.cause.unit}
    found |= {"course": change.course, "sizes": sizes}
    if change.course == "jump":
        return found | {"between": [change.since, change.until]}
    mean = float(change.shares[-1] / (hours[-1] - change.since))
    found |= {"since": change.since, "rate_per_hour": {name: mean * size for name, size in sizes.items()}}
    return found | ({"tau_hours": change.until} if change.course == "settling" else {})


def write(unit: Life, folder: Path, sessions: int | None = None) -> None:
    """Write the files of a unit, or of its first sessions alone."""
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(lots.MODEL, folder / "model.toml")
    ratio = rverror.load_model(lots.MODEL).mechanism.ratio
    for at, (hours, label, runs) in enumerate(zip(unit.hours, unit.labels, unit.outputs, strict=True)):
        if at == sessions:
            break
        for direction, sense, read in zip(("forward", "reverse"), (1, -1), runs, strict=True):
            head = [f"# hours: {hours:.1f}", f"# direction: {direction}", f"# output_torque: {unit.plan.torque:g} N*m"]
            head += ["# temperature: 20 degC", f"# index: {label}", "input_angle[deg],output_angle[deg]"]
            given = np.degrees(ratio * THETA)
            rows = zip(given[::sense].tolist(), read[::sense].tolist(), strict=True)
            text = "\n".join([*head, *(f"{x:.6f},{y:.8f}" for x, y in rows)]) + "\n"
            (folder / f"{at + 1:02d}-{direction}.csv").write_text(text, encoding="utf-8")
    (folder / "truth.json").write_text(json.dumps(unit.truth, indent=1) + "\n", encoding="utf-8")


def main(words: list[str] | None = None) -> None:
    """Write the unit that the words of the command line say."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--kind", choices=KINDS, default="growing")
    parser.add_argument("--sessions", type=int, default=SESSIONS)
    given = parser.parse_args(words)
    start = time.perf_counter()
    unit = simulate(given.seed, given.kind, given.sessions)
    write(unit, given.out)
    print(f"{given.out}: {unit.hours.size} sessions at {unit.plan.torque:g} N*m in {time.perf_counter() - start:.1f} s")


if __name__ == "__main__":
    main()
