"""Blind trial of what leaves no wave: errors that grow along a run, lost motion, and what a run cannot show at all.

    python benchmarks/blind_trial_flat.py [--jobs N] [--seed S]

Units as in blind_trial.py, in both directions.  Drift, ratio error and time offset have sizes in noise of the averaged
run, and runs with time stamps.  What only the reversal shows (thinned teeth, clearances of splines and of the carrier's
bearings, compliance) has its lost motion in standard deviations of what is unknown of it, and runs that share a zero.
The others shift the output by a constant, but for what they do to contacts that open; their sizes are in twentieths of
what a workshop can make, and where nothing shows the right answer is that nothing is missing.  Simulated, not measured.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402
import math  # noqa: E402
from collections import Counter, defaultdict  # noqa: E402
from concurrent.futures import ProcessPoolExecutor  # noqa: E402

import numpy as np  # noqa: E402
from blind_trial import (  # noqa: E402
    CORRELATION,
    DECLARED,
    NOISE,
    POINTS,
    SLOW,
    TORQUE,
    TURNS,
    UNCERTAINTY,
    WHITE,
    spread,
    waves,
)

import rverror  # noqa: E402
from rverror.diagnosis.harmonics.zeros import backlash_lost_motion  # noqa: E402
from rverror.diagnosis.policy import POLICY  # noqa: E402

GROWING = ("sensor.drift", "sensor.ratio_error", "sensor.time_offset")
LOST_MOTION = (
    "involute.tooth_thinning",
    "involute.spline_clearance",
    "coupling.bearing_clearance",
    "load.torsion",
)
FLAT = (
    "involute.center_distance",
    "involute.sun_eccentricity",
    "involute.sun_offset",
    "crank.index",
    "coupling.carrier_bore_position",
    "coupling.carrier_runout",
)
SIZES = (1.0, 2.0, 5.0, 20.0)
SPEED = math.radians(10)  # of the output, a second


def along(effects: tuple, theta: np.ndarray, direction: float) -> tuple[np.ndarray, np.ndarray]:
    """What errors beyond the gear train add to a whole run, and its time stamps."""
    model = rverror.Model(rverror.reducer("RV-40E"), effects)
    time = abs(theta - theta[0]) / SPEED
    uneven = 0.1 * np.sin(0.7 * theta)  # seconds: turns differ in speed, or a delay would be a constant
    time = time + uneven - uneven[0]
    return rverror.transmission_error(model, theta, direction=direction, time=time, torque=TORQUE), time


def unknown(unit: rverror.Reducer) -> float:
    """Standard deviation of the lost motion that the declared model does not know, rad."""
    windup = abs(waves(unit, ())[0].mean())
    backlash = backlash_lost_motion(unit)
    return math.hypot(POLICY.backlash_share * backlash, POLICY.windup_share * (2 * windup - backlash))


def missing_effect(rng: np.random.Generator, unit: rverror.Reducer, key: str, size: float) -> rverror.Effect:
    """Effect of the size asked for, on a crank or member drawn at random."""
    entry = rverror.CATALOGUE[key]
    choices = list(entry.candidates(unit))
    indices = dict(choices[rng.integers(len(choices))])
    plausible = np.array([p.plausible for p in entry.parameters])
    if key in FLAT:
        return rverror.Effect(key, indices, tuple(0.05 * size * rng.choice([-1, 1], plausible.size) * plausible))
    trial = rverror.Effect(key, indices, tuple(0.1 * plausible))
    if key in GROWING:
        theta = 2 * np.pi * np.arange(TURNS * POINTS) / POINTS
        reached = spread(along((trial,), theta, 1.0)[0]) / (NOISE / math.sqrt(TURNS))
        sign = rng.choice([-1, 1])
    else:
        lost = [np.diff(waves(unit, effects).mean(axis=1))[0] for effects in ((), (trial,))]
        reached, sign = abs(lost[1] - lost[0]) / unknown(unit), 1
    return rverror.Effect(key, indices, tuple(sign * size / reached * 0.1 * plausible))


def trial(job: tuple[str, float, int]) -> tuple[str, float, str]:
    """Make a unit, diagnose it, compare."""
    key, size, seed = job
    rng = np.random.default_rng([seed, list(rverror.CATALOGUE).index(key), int(size)])
    unit = rverror.reducer("RV-40E")
    if key == "involute.spline_clearance":
        unit = rverror.reducer("RV-40E", spline_radius=7.0)
    true, declared = [], []
    for name, indices, sigma in DECLARED:
        values = rng.normal(0, sigma, 2)
        true.append(rverror.Effect(name, indices, tuple(values)))
        declared.append(rverror.Effect(name, indices, tuple(values + rng.normal(0, UNCERTAINTY, 2)), UNCERTAINTY))
    effect = missing_effect(rng, unit, key, size)
    beyond = rverror.CATALOGUE[key].at_output
    runs = []
    for direction, wave in zip((1.0, -1.0), waves(unit, (*true, *(() if beyond else (effect,)))), strict=True):
        noise = rverror.coloured_noise(
            TURNS * POINTS, rms=SLOW * NOISE, step=1.0, correlation=CORRELATION, random=rng
        ) + WHITE * NOISE * rng.standard_normal(TURNS * POINTS)
        theta = 2 * np.pi * np.arange(TURNS * POINTS) / POINTS
        theta, error = (theta, np.tile(wave, TURNS)) if direction > 0 else (theta[::-1], np.tile(wave, TURNS)[::-1])
        more, time = along((effect,) if beyond else (), theta, direction)
        runs.append(
            rverror.run_from_arrays(
                input_angle=unit.ratio * theta,
                output_angle=theta + error + more + noise,
                direction="forward" if direction > 0 else "reverse",
                torque=TORQUE,
                time=time,
                index="A",
            )
        )
    found = rverror.diagnose(rverror.Model(unit, tuple(declared)), runs)
    names = [{a.effect.key, *(k for k, _ in a.indistinguishable)} for a in found.added]
    if not names:
        return key, size, "unseen" if key in FLAT and found.verdict == "nothing_missing" else "missed"
    wrong = any(key not in one for one in names)
    return key, size, "wrong" if wrong else "found" if found.added[0].effect.key == key else "set"


def main() -> None:
    """Run the trial and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    jobs = [(key, size, options.seed) for key in (*GROWING, *LOST_MOTION, *FLAT) for size in SIZES]
    table: dict[str, Counter] = defaultdict(Counter)
    with ProcessPoolExecutor(options.jobs) as executor:
        for key, size, result in executor.map(trial, jobs):
            print(f"{key:34s} {size:5g} {result}", flush=True)
            table[key][result] += 1
            if size >= 2:
                table["all that show, 2 and more" if key not in FLAT else "flat, 2 and more"][result] += 1
    print()
    for key, counts in table.items():
        print(f"{key:34s} " + ", ".join(f"{result} {count}" for result, count in counts.items()))


if __name__ == "__main__":
    main()
