"""Large lots: seconds and memory of compressing units' runs, and of reading compressed units as one lot.

    python benchmarks/lot_scale.py [--units 1000] [--parts 10] [--folder FOLDER]

Units with two runs of 512 samples each are written, waves of all orders at angles that are not even; no equilibrium is
solved.  Their runs are compressed with one worker and with two, and half of them too: memory must be that of the whole.
Then so many copies of the file, with other serials, are read as the parts of one lot.  Last, lots of 100 and of so many
units that follow a model to the first order are estimated.  Every step is a process of its own, whose peak memory is
that of itself and of its largest worker, less what a process has that does nothing.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402
import json  # noqa: E402
import math  # noqa: E402
import resource  # noqa: E402
import subprocess  # noqa: E402
import sys  # noqa: E402
import tempfile  # noqa: E402
from dataclasses import replace  # noqa: E402
from pathlib import Path  # noqa: E402
from time import perf_counter, process_time  # noqa: E402

import numpy as np  # noqa: E402

import rverror  # noqa: E402
from rverror.app.batch import processes  # noqa: E402
from rverror.base.units import ARCSEC  # noqa: E402
from rverror.lots.amplitudes import HIGHEST, Amplitudes, Condition  # noqa: E402
from rverror.lots.compressed import lot_inputs  # noqa: E402
from rverror.lots.made import lot  # noqa: E402
from rverror.lots.processes import UnitParts, processes_of  # noqa: E402
from rverror.lots.simulated import Simulator  # noqa: E402

SAMPLES, ORDERS = 512, 120
MADE = ("crank.eccentricity", "cycloid.disc_bore_position", "cycloid.disc_pitch")
MODEL = rverror.Model(rverror.reducer("RV-40E"))


def write_units(folder: Path, first: int, count: int) -> None:
    """Write units with a run forward and a run back."""
    for number in range(first, first + count):
        rng = np.random.default_rng(number)
        unit = folder / f"{number:06}"
        unit.mkdir(parents=True)
        for name, way in (("forward", 1.0), ("reverse", -1.0)):
            theta = 2 * math.pi * (np.arange(SAMPLES) + rng.uniform(-0.2, 0.2, SAMPLES)) / SAMPLES
            waves = np.exp(1j * np.arange(1, ORDERS) * theta[:, None])
            error = (waves @ rng.normal(size=(ORDERS - 1, 2)) @ [1, 1j]).real * ARCSEC
            order = slice(None, None, int(way))
            run = rverror.run_from_arrays(
                input_angle=MODEL.mechanism.ratio * theta[order], te=error[order], direction=way, torque="60 N*m"
            )
            rverror.runs.write_run(unit / f"{name}.csv", run)


def linear_lot(count: int) -> Amplitudes:
    """Units of two machines at 412 N m: cams, bores and pitch of 1 um by the influences of the perfect unit, noise."""
    rng, conditions = np.random.default_rng(count), (Condition(1.0, 412e3), Condition(-1.0, 412e3))
    processes = processes_of(MODEL, conditions[0])
    width = len(conditions) * 2 * HIGHEST
    noise = np.full(width, (0.3 * ARCSEC) ** 2 / SAMPLES)
    orders, serials = np.arange(1, HIGHEST + 1), tuple(f"{n:06}" for n in range(count))
    labels = {"machine": tuple("AB"[n % 2] for n in range(count))}
    empty = Amplitudes(serials, labels, conditions, orders, np.empty((0, width)), noise, SAMPLES)
    simulator = Simulator(MODEL, UnitParts(processes), empty)
    parts = simulator.parts
    influence = simulator.linearised(np.zeros(len(parts.process)), np.zeros(10))[1]
    spread = [1e-3 * (p.key in MADE and p.indices.get("harmonic", 1) == 1) for p in processes]
    errors = rng.standard_normal((count, len(parts.process))) * np.array(spread)[parts.process]
    values = (errors @ influence + rng.standard_normal((count, width))) / simulator.scale
    return replace(empty, values=values)


def step(words: list[str]) -> None:
    """One measured step, told as JSON."""
    amplitudes = linear_lot(int(words[1])) if words[0] == "lot" else None
    start, worked = perf_counter(), process_time()
    if amplitudes is not None:
        done = lot(MODEL, amplitudes).units
    elif words[0] == "compress":
        if int(words[3]) > 1:
            with processes(int(words[3])) as executor:
                done = lot_inputs(words[1], MODEL).compressed(words[2], executor=executor).units
        else:
            done = lot_inputs(words[1], MODEL).compressed(words[2]).units
    elif words[0] == "read":
        done = len(lot_inputs(words[1:], MODEL).amplitudes().values)
    else:
        done = 0
    seconds, processor = perf_counter() - start, process_time() - worked
    peaks = [resource.getrusage(who).ru_maxrss / 1024 for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    print(json.dumps({"units": done, "seconds": seconds, "processor": processor, "here": peaks[0], "worker": peaks[1]}))


def measured(*words: object, idle: float = 0.0) -> dict[str, float]:
    """Result of a step in a fresh process."""
    command = [sys.executable, __file__, "--step", *map(str, words)]
    found: dict[str, float] = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    if words[0] != "idle":
        worker = f", {found['worker']:.0f} MB in a worker" if found["worker"] else ""
        more = found["here"] - idle
        print(
            f"{words[0]} {found['units']} units: {found['seconds']:.1f} s, {more:.1f} MB above idle{worker}", flush=True
        )
    return found


def with_other_serials(path: Path, out: Path, number: int) -> Path:
    """Copy of a file whose serials begin with a number."""
    out.write_text(path.read_text().replace('"serial": "', f'"serial": "{number}-'))
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--units", type=int, default=1000)
    parser.add_argument("--parts", type=int, default=10)
    parser.add_argument("--folder", type=Path, help="where it is all written, and kept (default: a temporary folder)")
    parser.add_argument("--step", nargs="+", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.step:
        step(options.step)
        return
    with tempfile.TemporaryDirectory() as temporary:
        root = options.folder or Path(temporary)
        half = options.units // 2
        write_units(root / "half", 0, half)
        write_units(root / "lot", 0, options.units)
        idle = measured("idle")["here"]
        print(f"idle: {idle:.0f} MB")
        measured("compress", root / "half", root / "half.jsonl", 1, idle=idle)
        measured("compress", root / "lot", root / "one.jsonl", 1, idle=idle)
        measured("compress", root / "lot", root / "two.jsonl", 2, idle=idle)
        print(f"file: {(root / 'two.jsonl').stat().st_size / options.units / 1e3:.2f} kB a unit")
        parts = [with_other_serials(root / "one.jsonl", root / f"part-{n}.jsonl", n) for n in range(options.parts)]
        measured("read", *parts, idle=idle)
    few, many = (measured("lot", count, idle=idle)["processor"] for count in (100, options.units * options.parts))
    print(f"processor's time of the larger lot over that of the other: {many / few:.2f}")


if __name__ == "__main__":
    main()
