"""Write virtual test-bench units of every kind, from a simulator that shares no physics with the package.

    python benchmarks/make_units.py FOLDER [--units 40] [--seed 1000] [--families plain three ...] [--even]
        [--first-order]

Each unit is a folder FAMILY-SEED with a model file, run files and truth.json, in the format of the shared bench.
Families are drawn with weights, or one after another with --even.  A folder that is there already is left as it is.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402
from pathlib import Path  # noqa: E402
from time import perf_counter  # noqa: E402

from real_bench.units import FAMILIES, choose, make  # noqa: E402


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--units", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1000)
    parser.add_argument("--families", nargs="+", choices=FAMILIES, default=list(FAMILIES))
    parser.add_argument("--even", action="store_true", help="families one after another, not by their weights")
    parser.add_argument("--first-order", action="store_true", help="leave out what is quadratic in the pins' errors")
    options = parser.parse_args()
    for seed in range(options.seed, options.seed + options.units):
        family = choose(seed, tuple(options.families), even=options.even)
        folder = options.folder / f"{family}-{seed}"
        if (folder / "truth.json").exists():
            continue
        start = perf_counter()
        truth = make(seed, family, folder, first_order=options.first_order)
        names = [
            f"{effect['key']} ({size:.2f})"
            for effect, size in zip(truth["undeclared"], truth["effect_rms_arcsec"], strict=True)
        ]
        print(f"{folder.name:20s} {perf_counter() - start:5.1f} s  {', '.join(names) or 'nothing'}", flush=True)


if __name__ == "__main__":
    main()
