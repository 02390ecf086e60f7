"""Compensation on virtual benches whose physics is not the package's, and on recordings of others.

    python benchmarks/compensation.py [--units 12] [--seed 1] [--noise 400]

Each unit is fitted on two turns in each direction at 20 N*m.  Held against it: a third turn, which no fit saw, and a
turn at 200 N*m.  Beside the orders that survive stand a plain lookup table (the mean of each of 512 bins), all
harmonics, and orders with the causes that a diagnosis of the same runs names.  Units are simulated, not measured.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402
import tempfile  # noqa: E402
import warnings  # noqa: E402
from collections.abc import Sequence  # noqa: E402
from dataclasses import replace  # noqa: E402
from pathlib import Path  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402
from real_bench.units import ARCSEC, Simulated, Unit, both_ways, draw, grid, model_text  # noqa: E402

import rverror  # noqa: E402
from rverror.runs.order_table import TableCondition  # noqa: E402

FAMILIES = ("plain", "stiffness", "law")
LOAD, OTHER = 20.0, 200.0  # N*m
TURNS, POINTS, BINS = 3, 2048, 512
WORDS = ("before", "lookup", "all", "orders", "causes")


def rms(values: np.ndarray) -> float:
    return float(np.std(values)) / ARCSEC


def measured(unit: Unit) -> list[rverror.Run]:
    """Every run of a unit, with noise."""
    simulated = Simulated(unit)
    runs = []
    for recording in unit.runs:
        error = simulated.readings(recording, unit.true + unit.undeclared)
        error = error + unit.noise(recording.theta.size) * ARCSEC
        runs.append(
            rverror.run_from_arrays(
                input_angle=unit.reducer.ratio * recording.theta,
                output_angle=recording.theta + error,
                direction=float(recording.direction),
                torque=recording.torque * 1e3,
            )
        )
    return runs


def cut(run: rverror.Run, kept: np.ndarray) -> rverror.Run:
    return replace(
        run, input_angle=run.input_angle[kept], output_angle=run.output_angle[kept], direction=run.direction[kept]
    )


def lookup(fit: rverror.Run, ratio: float, theta: np.ndarray) -> np.ndarray:
    """Mean of each bin of the turn, straight between their middles."""
    where, error = np.mod(fit.nominal_angle(ratio), 2 * np.pi), fit.error(ratio)
    bins = np.floor(where / (2 * np.pi) * BINS).astype(int) % BINS
    means = np.array([error[bins == k].mean() for k in range(BINS)])
    middle = (np.arange(BINS) + 0.5) / BINS * 2 * np.pi
    return np.interp(np.mod(theta, 2 * np.pi), middle, means, period=2 * np.pi)


def harmonics(fit: rverror.Run, ratio: float, theta: np.ndarray) -> np.ndarray:
    """All orders below the Nyquist order, of the mean of the turns."""
    at = np.argsort(fit.nominal_angle(ratio))
    mean = fit.error(ratio)[at].reshape(-1, POINTS).mean(axis=0)
    start = fit.nominal_angle(ratio).min()
    return np.interp(np.mod(theta - start, 2 * np.pi), 2 * np.pi * np.arange(POINTS) / POINTS, mean, period=2 * np.pi)


def one_unit(seed: int, family: str) -> dict[str, Any] | None:
    """Error that each way leaves, at the load and at another; None where the unit is not as the others."""
    unit = draw(seed, family)
    if unit.reducer.ratio != 121 or unit.counts is not None:
        return None
    unit.runs = []
    both_ways(unit, grid(TURNS), torques=(LOAD,))
    both_ways(unit, grid(1.0), torques=(OTHER,))
    runs = measured(unit)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "model.toml")
        path.write_text(model_text(unit))
        model = rverror.load_model(path)
    ratio = model.mechanism.ratio
    last = 2 * np.pi * (TURNS - 1) - 1e-9
    fits = [cut(run, run.nominal_angle(ratio) < last) for run in runs[:2]]
    unseen = [cut(run, run.nominal_angle(ratio) > last) for run in runs[:2]]
    found = rverror.diagnose(model, fits)
    made = {
        "orders": rverror.compensate(rverror.Model(model.mechanism), fits, unseen=[*unseen, *runs[2:]]),
        "causes": rverror.compensate(found, fits, unseen=[*unseen, *runs[2:]]),
    }
    row: dict[str, Any] = {"unit": f"{family}-{seed}", "verdict": found.verdict, "noise": unit.noise_rms}
    for place, data in (("here", unseen), ("there", runs[2:])):
        left: dict[str, list[np.ndarray]] = {word: [] for word in WORDS}
        for fit, run in zip(fits, data, strict=True):
            theta, error = run.nominal_angle(ratio), run.error(ratio)
            added = {
                "before": 0 * theta,
                "lookup": -lookup(fit, ratio, theta),
                "all": -harmonics(fit, ratio, theta),
            }
            at = TableCondition(direction=float(run.direction[0]), torque=run.torque)
            added |= {word: one.correction.at(theta, at) for word, one in made.items()}
            for word, correction in added.items():
                left[word].append(error + correction - (error + correction).mean())
        row[place] = {word: rms(np.concatenate(parts)) for word, parts in left.items()}
        if place == "here":
            after = made["orders"].after
            row["inside"] = [after.low / ARCSEC <= rms(part) <= after.high / ARCSEC for part in left["orders"]]
    return row


def units(first: int, count: int) -> None:
    rows = []
    for seed in range(first, first + count):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                row = one_unit(seed, FAMILIES[seed % len(FAMILIES)])
            except ArithmeticError as problem:
                print(f"{seed}: {problem}")
                continue
        if row is None:
            continue
        rows.append(row)
        texts = [" ".join(f"{row[place][word]:7.3f}" for word in WORDS) for place in ("here", "there")]
        print(f"{row['unit']:14s} {row['verdict']:12s} {texts[0]}  | {texts[1]}  {row['inside']}", flush=True)
    for place, what in (("here", f"unseen turn at {LOAD:g} N*m"), ("there", f"at {OTHER:g} N*m")):
        middle = {word: float(np.median([row[place][word] for row in rows])) for word in WORDS}
        print(f"median, {what}: " + ", ".join(f"{word} {size:.3f}" for word, size in middle.items()))
    inside = [one for row in rows for one in row["inside"]]
    print(f"noise {np.median([row['noise'] for row in rows]):.3f}; interval covers {sum(inside)} of {len(inside)}")


def false_alarms(count: int) -> None:
    """Runs of coloured noise in which something was found to compensate."""
    model = rverror.Model(rverror.reducer("RV-40E"))
    theta = 2 * np.pi * TURNS * np.arange(TURNS * POINTS) / (TURNS * POINTS)
    worth = 0
    for seed in range(count):
        noise = rverror.coloured_noise(theta.size, rms=0.5 * ARCSEC, correlation=8, seed=seed)
        run = rverror.run_from_arrays(input_angle=121 * theta, te=noise, direction="forward")
        worth += rverror.compensate(model, [run]).worth
    print(f"noise alone: {worth} of {count} runs have an order that is compensated")


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--units", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--noise", type=int, default=400)
    options = parser.parse_args(arguments)
    false_alarms(options.noise)
    units(options.seed, options.units)


if __name__ == "__main__":
    main()
