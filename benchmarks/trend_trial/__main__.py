"""Judge ``rverror trend`` by simulated lives: python -m benchmarks.trend_trial --first S [--units N] [--kind K].

Each unit is written, told by the command line and compared with its truth: whether the part that changes is named, or
listed as a rival, whether intervals hold the true rate, what else is named, and whether the change is beyond the noise
at all.  Beside it plain monitors of the peak-to-peak, of single orders and of the lost motion, with false alarms in one
sound unit of a hundred: a control chart's limits, and the slope of a straight line.  With --early the first sessions
alone are told as well, which shows when it is found.  One line of JSON a unit; the last line sums up.
"""

from __future__ import annotations

import argparse
import itertools
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from benchmarks.trend_trial import make
from benchmarks.trend_trial.judging import SEEABLE, Row, alarms, beyond, compared

EARLY = (4, 6, 9, 13)  # sessions told beside all of them


def judged(seed: int, kind: str, folder: Path, sessions: int, early: bool) -> Row:
    """What is said of one unit beside what is true."""
    start = time.perf_counter()
    unit = make.simulate(seed, kind, sessions)
    made = time.perf_counter() - start
    truth = unit.truth
    row: Row = {"seed": seed, "kind": kind, "torque": truth["torque_Nm"], "remounted": truth["remounted"]}
    row |= {"change": truth["change"], "beyond": round(beyond(unit, sessions), 1)}
    row["alarms"] = alarms(unit)
    row |= asked(unit, folder / "all", sessions) | {"made_seconds": round(made, 1)}
    if early:
        row["early"] = {}
        for count in (count for count in EARLY if count < sessions):
            row["early"][count] = asked(unit, folder / str(count), count)
            row["early"][count] |= {"beyond": round(beyond(unit, count), 1)}
        found = [count for count, one in [*row["early"].items(), (sessions, row)] if one.get("listed")]
        row["found_at"] = min(found, default=None)
    return row


def asked(unit: make.Life, folder: Path, sessions: int) -> Row:
    """Answer to the first sessions of a unit, compared with the truth."""
    make.write(unit, folder, sessions)
    start, answer = time.perf_counter(), folder.with_suffix(".json")
    command = [sys.executable, "-m", "rverror", "trend", str(folder), "--model", str(folder / "model.toml")]
    done = subprocess.run([*command, "--json", str(answer)], capture_output=True, text=True, check=False)
    row: Row = {"exit": done.returncode, "seconds": round(time.perf_counter() - start, 1)}
    if done.returncode:
        return row | {"error": done.stderr.strip()[-300:]}
    told = json.loads(answer.read_text(encoding="utf-8"))
    return row | compared(told, unit.truth) | {"told": {name: told[name] for name in ("growing", "jumps")}}


def summed(rows: list[Row]) -> Row:
    """Counts over all units."""
    seen = [row for row in rows if row["beyond"] > SEEABLE]
    told = [row for row in rows if not row["exit"]]
    held: dict[str, list[int]] = {}
    for row in told:
        for name, pair in row.get("held", {}).items():
            held[name] = (np.array(held.get(name, [0, 0])) + pair).tolist()
    found: Row = {
        "units": len(rows),
        "failed": len(rows) - len(told),
        "seeable": len(seen),
        "named": sum(row.get("named", False) for row in told),
        "listed": sum(row.get("listed", False) for row in told),
        "listed_of_seeable": sum(row.get("listed", False) for row in seen),
        "crossed": sum(row.get("crossed", False) for row in told),
        "held": held,
        "units_with_false_names": sum(bool(row["false"]) for row in told),
        "alarms": {
            f"{name} by {way}": [sum(at is not None for at in sessions), median(sessions)]
            for name in rows[0]["alarms"]
            for way in ("limits", "line")
            for sessions in [[row["alarms"][name][way] for row in rows]]
        },
        "seconds": [median([row["seconds"] for row in rows]), max(row["seconds"] for row in rows)],
        "made_seconds": median([row["made_seconds"] for row in rows]),
    }
    if "found_at" in rows[0]:
        found["median_found_at"] = median([row["found_at"] for row in rows])
        found["units_with_false_names_early"] = {
            count: sum(bool(row["early"][count].get("false")) for row in rows) for count in rows[0]["early"]
        }
    return found


def median(values: list[float | None]) -> float | None:
    """Median over units, with those where nothing came as never; None if that is never."""
    middle = float(np.median([np.inf if value is None else value for value in values]))
    return middle if np.isfinite(middle) else None


def of_pin(seed: int, given: argparse.Namespace) -> bool:
    """Whether what changes in a unit is a single pin."""
    change = make.draw_change(seed, given.kind, make.draw_hours(seed, given.sessions), make.is_remounted(seed))
    return change is not None and isinstance(change.indices.get("pin"), int)


def main(words: list[str] | None = None) -> None:
    """Run the trial with these words of the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0], allow_abbrev=False)
    parser.add_argument("--first", type=int, required=True, help="seed of the first unit")
    parser.add_argument("--units", type=int, default=30)
    parser.add_argument("--kind", choices=make.KINDS, default="growing")
    parser.add_argument("--sessions", type=int, default=make.SESSIONS)
    parser.add_argument("--early", action="store_true", help="tell the first sessions alone as well")
    parser.add_argument("--no-pins", action="store_true", help="pass over seeds whose change is of a single pin")
    given = parser.parse_args(words)
    rows = []
    seeds = (seed for seed in itertools.count(given.first) if not (given.no_pins and of_pin(seed, given)))
    for seed in itertools.islice(seeds, given.units):
        with tempfile.TemporaryDirectory() as scratch:
            rows.append(judged(seed, given.kind, Path(scratch), given.sessions, given.early))
        print(json.dumps(rows[-1]), flush=True)
    print(json.dumps(summed(rows)), flush=True)


if __name__ == "__main__":
    main()
