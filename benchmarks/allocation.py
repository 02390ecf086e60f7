"""Cost of an allocation: the shipped RV-40E tolerances, 99 % of the units within 60 arcsec, and a front of five limits.

    python benchmarks/allocation.py [--limit 60] [--sample 16384] [--verify 65536]

A front asks for least costs at five limits: as one task, which draws its units once and
starts each limit from the nearest one, and as five allocations.  Processor time, which other work on the machine does
not stretch; BLAS runs on one thread unless the environment says otherwise.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402
from collections.abc import Callable  # noqa: E402
from pathlib import Path  # noqa: E402
from time import process_time  # noqa: E402
from typing import Any  # noqa: E402

import rverror  # noqa: E402
from rverror import ARCSEC  # noqa: E402

TOLERANCES = Path(__file__).parents[1] / "examples" / "rv40e-tolerances.toml"
FRONT = (0.7, 0.85, 1.0, 1.2, 1.5)


def timed(work: Callable[[], Any]) -> tuple[float, Any]:
    """Processor time of some work, s, and its result."""
    start = process_time()
    result = work()
    return process_time() - start, result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--limit", type=float, default=60.0, help="arcsec")
    parser.add_argument("--verify", type=int, default=2**15)
    options = parser.parse_args()
    model = rverror.Model(rverror.reducer("RV-40E"))
    tolerances = rverror.load_tolerances(TOLERANCES, model)
    stack = rverror.tolerances.stack(model, tolerances)
    settings = {"verify": options.verify}

    limits = [factor * options.limit * ARCSEC for factor in FRONT]
    singly = [
        timed(lambda limit=limit: rverror.allocate(model, tolerances, limit=limit, **settings)) for limit in limits
    ]
    together, front = timed(lambda: rverror.tolerances.cost_front(stack, limits, **settings))
    alone = sum(seconds for seconds, _ in singly)
    print(f"one allocation {singly[2][0]:.1f} s; five {alone:.1f} s, as one front {together:.1f} s")
    print(f"ratio {alone / together:.2f}")
    for (_, one), point in zip(singly, front, strict=True):
        assert point.allocation is not None
        print(
            f"  {point.limit / ARCSEC:6.1f} arcsec: cost {one.cost:.4f} alone, {point.allocation.cost:.4f} in the front"
        )


if __name__ == "__main__":
    main()
