"""Lots of drives without anything shared or odd: how often something is told all the same, where 5 % are stated.

python benchmarks/lot_of_drives.py
"""

from __future__ import annotations

import numpy as np

import rverror
from rverror.lots.amplitudes import LotUnit

LOTS, ORDERS, SAMPLES = 200, 60, 122
MODEL = rverror.Model(rverror.Drive(ratio=1.0))


def waves(rng: np.random.Generator, count: int, kind: str) -> np.ndarray:
    """Amplitudes that fall as 1/k with phases at random, normal or log-normal ones of 50 %."""
    if kind == "normal":
        own = rng.standard_normal((count, ORDERS)) + 1j * rng.standard_normal((count, ORDERS))
    else:
        phase = 2 * np.pi * rng.random((count, ORDERS))
        own = np.exp(1j * phase + 0.5 * rng.standard_normal((count, ORDERS)))
    return own * 1e-3 / np.arange(1, ORDERS + 1)


def lot(seed: int, count: int, kind: str) -> rverror.lots.DriveLot:
    """A simulated lot, told."""
    rng = np.random.default_rng([seed, count])
    theta = 2 * np.pi * np.arange(SAMPLES) / SAMPLES
    turns = np.exp(1j * np.outer(np.arange(1, ORDERS + 1), theta))
    te = (waves(rng, count, kind) @ turns).real + 1.6e-4 * rng.standard_normal((count, SAMPLES))
    runs = [rverror.run_from_arrays(output_angle=theta, te=row, direction="forward") for row in te]
    return rverror.lots.lot_of_drives(MODEL, [LotUnit(str(number), (run,)) for number, run in enumerate(runs)])


if __name__ == "__main__":
    print("waves       units  a unit differs  a pair  a shared order, % of lots")
    for kind in ("normal", "log-normal"):
        for count in (8, 12, 30):
            found = [lot(seed, count, kind) for seed in range(LOTS)]
            told = [(bool(one.own), bool(one.pairs), any(order.shared for order in one.orders)) for one in found]
            own, pairs, shared = 100 * np.mean(told, axis=0)
            print(f"{kind:10} {count:6} {own:15.1f} {pairs:7.1f} {shared:15.1f}", flush=True)
