"""How long a fresh Python takes to `import rverror`, and the command to answer, beside the libraries that it needs.

    python benchmarks/start_up.py [rounds]

Every row is a process by itself, timed by the processor time that it took, and by the clock: the least of some rounds
in which all rows take turns, so that a busy machine is no slower for one of them.  A round before them writes bytecode
and compiles what is compiled, so the equilibrium is that of a later process.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import time

UNIT = (
    "import rverror; "
    "unit = rverror.Model(rverror.reducer('RV-40E'), (rverror.effect('crank.index', crank=0, angle='4 mrad'),))"
)
#: What a fresh interpreter runs.
ROWS = {
    "nothing": "pass",
    "import numpy": "import numpy",
    "import numpy, scipy.linalg, pint": "import numpy, scipy.linalg, pint",
    "import rverror": "import rverror",
    "rverror --help": "from rverror.app.command_line import main; main(['--help'])",
    "every name of rverror": "from rverror import *",
    "the first closed form": f"{UNIT}; rverror.transmission_error(unit, [0.0, 0.1])",
    "the first equilibrium": f"{UNIT}; rverror.equilibrium(unit, [0.0, 0.1])",
}
MEASURE = "import numpy, scipy.linalg, pint"


def taken(code: str) -> tuple[float, float]:
    """Time of an interpreter that runs a line, s: of the processor, and by the clock."""
    before, began = os.times(), time.perf_counter()
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    # what --help prints is no part of the table
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, check=False)
    after, ended = os.times(), time.perf_counter()
    if done.returncode:
        sys.exit(done.stderr.decode())
    used = after.children_user + after.children_system - before.children_user - before.children_system
    return used, ended - began


def main() -> None:
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 7
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in ROWS}
    for turn in range(rounds + 1):
        for name, code in ROWS.items():
            found = taken(code)
            if turn:
                times[name].append(found)
    least = {name: [min(column) for column in zip(*found, strict=True)] for name, found in times.items()}
    print(f"Python {platform.python_version()}, least of {rounds} processes")
    print()
    print(f"{'':36s}{'processor':>11s}{'clock':>10s}")
    for name, (used, passed) in least.items():
        ratio = used / least[MEASURE][0]
        print(f"{name:36s}{used:9.2f} s{passed:8.2f} s{ratio:8.2f} of `{MEASURE}`")


if __name__ == "__main__":
    main()
