"""Cost of very many virtual RV-40E: all linear part errors of the catalogue, all pins, 4096 angles.

    python benchmarks/virtual_units.py [--count 100000] [--repeats 3]

Each unit is drawn, and its peak-to-peak, max and rms computed by orders, which is set against the bare float64 matrix
product of the same size with its maxima and minima, of values that are there already, in the same run: in blocks of the
length that is fastest here, into one buffer.  Times are the best of the repeats, which take turns; in this process they
are processor time, which other work on the machine does not stretch.  BLAS runs on one thread unless the environment
says otherwise.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402
import multiprocessing  # noqa: E402
import platform  # noqa: E402
import resource  # noqa: E402
from concurrent.futures import ProcessPoolExecutor  # noqa: E402
from time import perf_counter, process_time  # noqa: E402

import numpy as np  # noqa: E402
import scipy  # noqa: E402
from catalogue import HARMONICS, KEYS  # noqa: E402

import rverror  # noqa: E402
from rverror import ARCSEC  # noqa: E402
from rverror.tolerances.sampling import chunk_length, sampler, uniforms  # noqa: E402

BLOCKS = (128, 256, 512, 1024, 2048)
#: Angles of the measuring chain, in place of the lengths of parts.
WIDTHS = {"length": "5 um", "angle": "10 arcsec"}


def rv40e() -> rverror.tolerances.Stack:
    """Every source with every index, harmonics 1 to 8, each with a tolerance of 5 um or 10 arcsec."""
    tolerances = []
    for key in KEYS:
        entry = rverror.CATALOGUE[key]
        harmonics = {index.name: tuple(HARMONICS) for index in entry.indices if index.name == "harmonic"}
        mean = "10 um" if entry.parameters[0].least == 0 else None  # a clearance does not come out negative
        tolerances.append(rverror.tolerance(key, WIDTHS[entry.parameters[0].dimension], mean=mean, **harmonics))
    return rverror.tolerances.stack(rverror.Model(rverror.reducer("RV-40E")), tolerances)


def bare(values: np.ndarray, waveforms: np.ndarray, buffer: np.ndarray, count: int) -> float:
    """Time of the matrix product of so many rows and of its maxima and minima, s; the same rows again and again."""
    start, rows = process_time(), len(buffer)
    for block in range(0, count, rows):
        te = np.matmul(values[: min(rows, count - block)], waveforms, out=buffer[: min(rows, count - block)])
        te.max(axis=1)
        te.min(axis=1)
    return process_time() - start


def timed(
    given: rverror.tolerances.Stack, count: int, **settings: object
) -> tuple[float, rverror.tolerances.VirtualUnits]:
    """Processor time of virtual units, draws included, s; and the units."""
    start = process_time()
    units = rverror.tolerances.virtual_units(given, count, **settings)
    return process_time() - start, units


def with_workers(given: rverror.tolerances.Stack, count: int, workers: int) -> float:
    """Elapsed time of virtual units by so many processes that are up and have loaded what they need, s."""
    with ProcessPoolExecutor(workers, mp_context=multiprocessing.get_context("spawn")) as pool:
        rverror.tolerances.virtual_units(given, 64 * workers, executor=pool)
        start = perf_counter()
        rverror.tolerances.virtual_units(given, count, executor=pool)
        return perf_counter() - start


def peak_memory(who: int) -> float:
    """Largest memory in use so far, MiB."""
    return resource.getrusage(who).ru_maxrss / (1024 if platform.system() == "Linux" else 1024**2)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--count", type=int, default=100_000, help="virtual units")
    parser.add_argument("--repeats", type=int, default=3)
    given = parser.parse_args()
    count, whole = given.count, rv40e()
    waveforms = whole.scaled()
    m, n = waveforms.shape
    values = np.random.default_rng(0).normal(size=(max(BLOCKS), m)) / 3
    rows = min(BLOCKS, key=lambda r: min(bare(values, waveforms, np.empty((r, n)), 4096) for _ in range(3)))
    buffer = np.empty((rows, n))

    products, folded = [], []
    for _ in range(given.repeats):
        products.append(bare(values, waveforms, buffer, count))
        folded.append(timed(whole, count))
    product = min(products)
    by_order = folded[0][1]
    memory = peak_memory(resource.RUSAGE_SELF)  # the bare product's included

    start = process_time()
    ready = sampler(whole)
    making = process_time() - start
    start = process_time()
    for block in uniforms(chunk_length(count), whole.dimensions, seed=0, index=0):
        ready.stack.standard(block)
    drawing = (process_time() - start) / chunk_length(count)

    print(f"{count} virtual RV-40E: {m} part errors of {len(KEYS)} sources, {n} angles, {whole.dimensions} variates")
    versions = f"Python {platform.python_version()}, numpy {np.__version__}, scipy {scipy.__version__}"
    print(f"{versions}, BLAS threads {os.environ['OMP_NUM_THREADS']}; best of {given.repeats}")
    print()
    print(f"{'':60s}{'s':>8s}{'us a unit':>11s}{'of bare':>9s}")

    def line(what: str, seconds: float, units: int = count) -> None:
        each = seconds / units
        print(f"{what:60s}{seconds:8.2f}{each * 1e6:11.2f}{each / (product / count):9.3f}", flush=True)

    line(f"bare product, max and min, blocks of {rows}", product)
    line("by orders, draws included", min(time for time, _ in folded))
    line("  of which: draws", drawing * count)
    line("  of which: making the waveforms ready, once", making)
    one, two = (min(with_workers(whole, count, workers) for _ in range(given.repeats)) for workers in (1, 2))
    line("by orders, 1 process, elapsed", one)
    line("by orders, 2 processes, elapsed", two)
    line(f"by orders, {10 * count} units, this process", timed(whole, 10 * count)[0], 10 * count)
    line(f"by orders, {10 * count} units, 2 processes, elapsed", with_workers(whole, 10 * count, 2), 10 * count)
    print()
    ranks = ", ".join(f"{level.shape[0]} on {level.shape[1]}" for level in ready.kernel.levels)
    print(f"waves on angles, level by level: {ranks}")
    print(f"2 processes against 1: {one / two:.2f} times as fast")
    after, child = peak_memory(resource.RUSAGE_SELF), peak_memory(resource.RUSAGE_CHILDREN)
    print(f"peak memory: {memory:.0f} MiB; with {10 * count} units {after:.0f} MiB, largest worker {child:.0f} MiB")
    for probability in (0.5, 0.95, 0.99):
        found = by_order.quantile(probability)
        value, low, high = (size / ARCSEC for size in (found.value, found.low, found.high))
        print(f"P{100 * probability:g} of the peak-to-peak: {value:.2f} arcsec ({low:.2f} to {high:.2f})")


if __name__ == "__main__":
    main()
