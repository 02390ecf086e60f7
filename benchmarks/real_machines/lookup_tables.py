"""A table of an encoder in the C source of a firmware, as a run file of a drive 1 : 1.

Closed-loop steppers such as the Mechaduino calibrate their magnet encoder by turning the motor step by step, and keep
the shaft's angle at each count in an array of the firmware, ``const float lookup[] = { 0.02, 0.05, ... };``.  The
encoder is then the input of a drive of ratio 1, the motor its output, or with ``--zero motor`` the other way round:
orders count from the zero of the input, where what belongs to the encoder's chip or to the motor's poles has its phase.

    python benchmarks/real_machines/lookup_tables.py LOT Parameters.cpp other/Parameters.cpp
    rverror lot LOT --model LOT/drive.toml

Each array becomes ``LOT/<name>/run.csv``; an array that is equal to one before it is left out, and that is said.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

import numpy as np

import rverror

ARRAY = re.compile(r"(\w+)\s*\[[^\]]*\][^={};]*=\s*(?://[^\n]*)?\s*\{([^{}]*)\}")
REMARK = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
LEAST = 256  # entries of a table: an encoder of eight bits


def tables(text: str) -> list[np.ndarray]:
    """Arrays of a C source that go once around: the angle at each count, in turns, growing, from its first value on."""
    found = []
    for _, body in ARRAY.findall(text):
        cells = [cell.strip().rstrip("fFuUlL") for cell in REMARK.sub("", body).split(",")]
        try:
            values = np.array([float(cell) for cell in cells if cell])
        except ValueError:
            continue  # names or expressions
        if values.size < LEAST:
            continue
        for turn in (360.0, 36000.0, 2 * np.pi):  # degrees, hundredths of them, radians
            angle = np.unwrap(values / turn, period=1.0)
            angle = angle if angle[-1] > angle[0] else -angle
            if values.min() >= 0 and 0.9 < np.ptp(values) / turn <= 1.001 and abs(np.ptp(angle) - 1) < 0.02:
                found.append(angle)
    return found


def main() -> None:
    """Read the files that are named, and write a folder of units and the model of the drive."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("folder", type=Path, metavar="LOT")
    options.add_argument("sources", type=Path, nargs="+", metavar="Parameters.cpp")
    options.add_argument("--zero", choices=("encoder", "motor"), default="encoder")
    given = options.parse_args()
    seen: dict[bytes, str] = {}
    for source in given.sources:
        for number, motor in enumerate(tables(source.read_text("utf-8", errors="replace"))):
            if twin := seen.get(motor.tobytes(), ""):
                print(f"{source}, table {number + 1}: equal to {twin}, left out", file=sys.stderr)
                continue
            stem = f"{source.resolve().parent.name}-{source.stem}"
            name = next(
                n for i in range(len(seen) + 1) if (n := stem + (f"-{i + 1}" if i else "")) not in seen.values()
            )
            seen[motor.tobytes()] = name
            encoder = np.arange(motor.size) / motor.size
            motor = motor - np.round(np.mean(motor - encoder))
            one, other = (encoder, motor) if given.zero == "encoder" else (motor, encoder)
            run = rverror.run_from_arrays(
                input_angle=2 * np.pi * one, output_angle=2 * np.pi * other, direction="forward"
            )
            (given.folder / name).mkdir(parents=True, exist_ok=True)
            rverror.runs.write_run(given.folder / name / "run.csv", run, overwrite=True)
    if not seen:
        sys.exit("no array of a whole turn is found in these files")
    (given.folder / "drive.toml").write_text('name = "encoder against motor"\n\n[drive]\nratio = 1.0\n', "utf-8")
    print(f"{len(seen)} units in {given.folder}")


if __name__ == "__main__":
    main()
