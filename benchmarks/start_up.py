"""How long a fresh Python takes to `import rverror`, and the command to answer, beside the libraries that it needs.

    python benchmarks/start_up.py [rounds]

Every row is a process by itself, timed by the processor time that it took: the least of some rounds in which all rows
take turns, so that a busy machine is no slower for one of them.  Bytecode is written first.
"""

from __future__ import annotations

import os
import platform
import subprocess
import sys

#: What a fresh interpreter runs.
ROWS = {
    "nothing": "pass",
    "import numpy": "import numpy",
    "import numpy, scipy.linalg, pint": "import numpy, scipy.linalg, pint",
    "import rverror": "import rverror",
    "rverror --help": "from rverror.app.command_line import main; main(['--help'])",
    "the first closed form": (
        "import rverror; rverror.transmission_error(rverror.Model(rverror.reducer('RV-40E'), "
        "(rverror.effect('crank.index', crank=0, angle='4 mrad'),)), [0.0, 0.1])"
    ),
}
MEASURE = "import numpy, scipy.linalg, pint"


def taken(code: str) -> float:
    """Processor time of an interpreter that runs a line, s."""
    before = os.times()
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    # what --help prints is no part of the table
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, check=False)
    after = os.times()
    if done.returncode:
        sys.exit(done.stderr.decode())
    return after.children_user + after.children_system - before.children_user - before.children_system


def main() -> None:
    rounds = int(sys.argv[1]) if len(sys.argv) > 1 else 7
    times: dict[str, list[float]] = {name: [] for name in ROWS}
    for turn in range(rounds + 1):
        for name, code in ROWS.items():
            time = taken(code)
            if turn:  # the first writes bytecode
                times[name].append(time)
    least = {name: min(found) for name, found in times.items()}
    print(f"Python {platform.python_version()}, processor time, least of {rounds} processes")
    print()
    for name, time in least.items():
        print(f"{name:36s}{time:8.2f} s{time / least[MEASURE]:8.2f} of `{MEASURE}`")


if __name__ == "__main__":
    main()
