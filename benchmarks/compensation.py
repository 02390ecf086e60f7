"""Compensation on virtual benches whose physics is not the package's, and on recordings of others.

    python benchmarks/compensation.py [--units 12] [--seed 1] [--noise 400]
    python benchmarks/compensation.py --recordings FOLDER

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

FAMILIES = ("plain", "stiffness", "power_law")
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
        chance = np.random.default_rng(seed)
        noise = rverror.runs.coloured_noise(theta.size, rms=0.5 * ARCSEC, step=1.0, correlation=8.0, random=chance)
        run = rverror.run_from_arrays(input_angle=121 * theta, te=noise, direction="forward")
        worth += rverror.compensate(model, [run]).worth
    print(f"noise alone: {worth} of {count} runs have an order that is compensated")


#: What is left out of each recording; period of a plain table, rad, and waves of it; degree of what is slow in all of
#: it, taken off beforehand, in what the table and all harmonics are fitted to, and in what is left out.
RECORDINGS = {
    "planetary-14to1": ("last 4 s", 2 * np.pi, 60, None, 0, 0),
    "worm-225": ("each worm turn", 2 * np.pi / 225, 24, 2, 0, 0),
    "worm-360": ("each worm turn", 2 * np.pi / 360, 24, 2, 0, 0),
    "strain-wave-101": ("last fifth", 2 * np.pi / 101, 8, None, 9, 5),
}


def recordings(folder: Path) -> None:
    """Recordings of others: what no fit saw, before and after, with what is slow in it taken off alike."""
    for name, (what, period, count, drift, within, slow) in RECORDINGS.items():
        model = rverror.load_model(folder / name / "model.toml")
        run = rverror.load_run(folder / name / "run.csv", model)
        theta, error = run.nominal_angle(model), run.error(model)
        error = error if drift is None else without_slow(theta, error, drift)
        if what == "last 4 s":
            folds = [run.time > run.time.max() - 4.0]
        elif what == "last fifth":
            folds = [theta > theta.max() - np.ptp(theta) / 5]
        else:
            turn = np.floor((theta - theta.min()) / period)
            folds = [turn == k for k in range(int((np.ptp(theta) + 1e-9) / period))]
        left: dict[str, list[np.ndarray]] = {word: [] for word in ("before", "lookup", "all", "orders")}
        for out in folds:
            columns = {n: getattr(run, n) for n in ("input_angle", "output_angle", "te_column", "direction", "time")}
            fit = replace(run, **{n: None if v is None else v[~out] for n, v in columns.items()})
            made = rverror.compensate(model, [fit])
            for sense in np.unique(run.direction):
                new, old = out & (run.direction == sense), ~out & (run.direction == sense)
                flat = without_slow(theta[old], error[old], within)
                k = 2 * np.pi / period * np.arange(1, count + 1)
                waves = np.hstack([np.cos(np.outer(theta, k)), np.sin(np.outer(theta, k))])
                sizes = np.linalg.lstsq(waves[old], flat, rcond=None)[0]
                bins = np.floor(np.mod(theta, period) / period * 2 * count).astype(int)
                means = [flat[bins[old] == n].mean() if (bins[old] == n).any() else 0.0 for n in range(2 * count)]
                middle = (np.arange(2 * count) + 0.5) / (2 * count) * period
                table = np.interp(np.mod(theta[new], period), middle, means, period=period)
                at = TableCondition(direction=float(sense), torque=run.torque)
                added = {"before": 0.0, "lookup": -table, "all": -waves[new] @ sizes}
                added["orders"] = made.correction.at(theta[new], at)
                for word, correction in added.items():
                    left[word].append(without_slow(theta[new], error[new] + correction, slow))
        texts = ", ".join(f"{word} {rms(np.concatenate(parts)):.3f}" for word, parts in left.items())
        print(f"{name}, {what} unseen: {texts}")


def without_slow(theta: np.ndarray, values: np.ndarray, degree: int) -> np.ndarray:
    """Values less a polynomial of the angle."""
    base = np.polynomial.legendre.legvander((theta - theta.mean()) / np.ptp(theta) * 2, degree)
    return values - base @ np.linalg.lstsq(base, values, rcond=None)[0]


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--units", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--noise", type=int, default=400)
    parser.add_argument("--recordings", type=Path, help="folder of the recordings: those alone")
    options = parser.parse_args(arguments)
    if options.recordings:
        recordings(options.recordings)
        return
    false_alarms(options.noise)
    units(options.seed, options.units)


if __name__ == "__main__":
    main()
