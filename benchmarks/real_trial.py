"""Trial of the diagnosis on virtual benches whose physics is not the package's, with what real benches do.

    python benchmarks/real_trial.py FOLDER [NAMES ...] [--jobs N] [--at-most SECONDS] [--out FILE.jsonl]
    python benchmarks/real_trial.py FOLDER --units 100 --seed 7 [--families plain three ...] [--even]

The first form diagnoses the units in a folder, the second writes those of the seeds there first, where they are not.
Judged as the shared bench judges: the causes named, each in a set of four keys at most, none beside them, and held-out
rms within 15 % of the noise; nothing named where nothing is missing; a line of no source reported with its order.
Units whose every effect has twice the noise of a run's mean revolution count as loud.  Simulated, not measured.
Seconds are the processor's, which other work on the machine does not lengthen; one thread does all of a unit.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402
import json  # noqa: E402
import signal  # noqa: E402
import warnings  # noqa: E402
from collections import Counter, defaultdict  # noqa: E402
from collections.abc import Callable, Iterable  # noqa: E402
from concurrent.futures import ProcessPoolExecutor, as_completed  # noqa: E402
from dataclasses import replace  # noqa: E402
from pathlib import Path  # noqa: E402
from statistics import median  # noqa: E402
from time import process_time  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402
from real_bench.judging import OUTSIDE, causes, loud, named_sets, outcome, sizes_inside, stiffness_inside  # noqa: E402
from real_bench.units import FAMILIES, choose, make  # noqa: E402

import rverror  # noqa: E402
from rverror.base.memory import keep_freed_memory  # noqa: E402
from rverror.diagnosis.policy import POLICY, Policy  # noqa: E402

OUTCOMES = ("right", "false", "wrong", "wide", "missed", "line", "poor", "failed")


def _too_long(*_: object) -> None:
    raise TimeoutError("took longer than a unit may")


def trial(folder: str, draw: tuple[int, str, bool] | None, policy: Policy, at_most: float = 0.0) -> dict[str, Any]:
    """Write one unit, if it is to be drawn, diagnose it and judge the answer; what a line of the JSON file holds.

    A unit that takes more than `at_most` seconds of the processor has failed; 0 is no bound.
    """
    path = Path(folder)
    if draw is not None and not (path / "truth.json").exists():
        seed, family, first_order = draw
        make(seed, family, path, first_order=first_order)
    truth = json.loads((path / "truth.json").read_text())
    family = truth.get("family", path.name.split("-")[0])
    row: dict[str, Any] = {
        "unit": path.name,
        "family": family,
        "what": truth.get("what", ""),
        "undeclared": truth["undeclared"],
        "effect_rms_arcsec": truth.get("effect_rms_arcsec", []),
        "noise_rms_arcsec": truth["noise_rms_arcsec"],
    }
    start = process_time()
    if at_most:
        signal.signal(signal.SIGPROF, _too_long)
        signal.setitimer(signal.ITIMER_PROF, at_most)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            runs = [rverror.load_run(file) for file in sorted(path.glob("*.csv"))]
            row["loud"] = loud(truth, float(np.ptp(runs[0].output_angle)) / (2 * np.pi))
            model = rverror.load_model(path / "model.toml")
            found = rverror.to_json(rverror.diagnose(model, runs, policy=policy))
    except Exception as error:  # a trial of many units goes on
        seconds = process_time() - start
        return {"loud": True} | row | {"outcome": "failed", "error": repr(error)[:300], "seconds": seconds}
    finally:
        if at_most:
            signal.setitimer(signal.ITIMER_PROF, 0.0)
    inside, total = sizes_inside(truth, found)
    sets = named_sets(truth, found)
    return row | {
        "outcome": outcome(truth, found),
        "seconds": process_time() - start,
        "verdict": found["verdict"],
        "named": [
            {"key": one["key"], "indices": one["indices"]}
            | {"alike": sorted({other["key"] for other in one.get("indistinguishable_from", [])})}
            for one in found["added"]
        ],
        "false_names": ["|".join(sorted(keys)) for keys in sets if not keys & set(causes(truth))],
        "unexplained_orders": [line["order"] for line in found.get("unexplained_orders", [])],
        "inside": inside,
        "sizes": total,
        "stiffness": stiffness_inside(truth, found),
        "heldout_rms_arcsec": [found[part]["heldout_rms_arcsec"] for part in ("before", "after")],
        "notes": found.get("notes", []),
    }


def table(rows: Iterable[dict[str, Any]], name: str, label: Callable[[dict[str, Any]], str]) -> None:
    """Print outcomes by a label."""
    groups: dict[str, list[dict[str, Any]]] = defaultdict(list)
    for row in rows:
        groups[label(row)].append(row)
        groups["all"].append(row)
    print(f"\n{name:30s} units  loud " + " ".join(f"{o:>6s}" for o in OUTCOMES) + "   inside   s median  max")
    for group, members in sorted(groups.items(), key=lambda item: (item[0] == "all", item[0])):
        counts = Counter(row["outcome"] for row in members)
        loud_rows = [row for row in members if row["loud"]]
        right = sum(row["outcome"] == "right" for row in loud_rows)
        times = [row["seconds"] for row in members]
        sizes = f"{sum(row.get('inside', 0) for row in members)}/{sum(row.get('sizes', 0) for row in members)}"
        print(f"{group:30s} {len(members):5d} {right:2d}/{len(loud_rows):<2d} "
              + " ".join(f"{counts[o] or '-':>6}" for o in OUTCOMES)
              + f" {sizes:>8s} {median(times):9.1f} {max(times):5.1f}")  # fmt: skip


def report(rows: list[dict[str, Any]]) -> None:
    """Print all tables."""
    table(rows, "family", lambda row: row["family"])
    table(rows, "missing", lambda row: missing(row))
    named: dict[str, list[bool]] = defaultdict(list)
    for row in rows:
        got = [{one["key"], *one["alike"]} for one in row.get("named", [])]
        for effect, size in zip(row["undeclared"], row["effect_rms_arcsec"], strict=False):
            if effect["key"] != OUTSIDE and size >= 2 * row["noise_rms_arcsec"] / 3**0.5:
                named[effect["key"]].append(any(effect["key"] in keys for keys in got))
    print("\nkeys of effects of twice the noise or more, alone or beside others: in a set that was named, of how many")
    for key, flags in sorted(named.items()):
        print(f"  {key:34s} {sum(flags)}/{len(flags)}")
    told = [row["stiffness"] for row in rows if "stiffness" in row]
    print(
        f"\nstiffnesses that the runs tell: {sum(i for i, _ in told)} of {sum(n for _, n in told)} in their intervals"
    )
    false = Counter(name for row in rows for name in row.get("false_names", []))
    if false:
        print("\nnames that are no cause: " + ", ".join(f"{name} {count}" for name, count in false.most_common()))
    for row in rows:
        if row["outcome"] == "failed":
            print(f"{row['unit']}: {row['error']}")


def missing(row: dict[str, Any]) -> str:
    """What a unit lacks."""
    keys = [effect["key"] for effect in row["undeclared"]]
    return "(nothing)" if not keys else keys[0] if len(keys) == 1 else f"({len(keys)} effects)"


def line_of(row: dict[str, Any]) -> str:
    """One unit for the screen."""
    lacks = ", ".join(effect["key"] for effect in row["undeclared"]) or "nothing"
    names = ", ".join("|".join([one["key"], *one["alike"]]) for one in row.get("named", [])) or "nothing"
    before, after = row.get("heldout_rms_arcsec", (None, None))
    held_out = "" if after is None else f"; held-out {before:.3f} -> {after:.3f}, noise {row['noise_rms_arcsec']:.3f}"
    quiet = "" if row["loud"] else ", quiet"
    head = f"{row['unit']:20s} {row['outcome']:6s} {row['seconds']:6.1f} s"
    return f"{head}  lacks {lacks}{quiet}; named {names}{held_out}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("names", nargs="*", help="units in the folder; all where none is given")
    parser.add_argument("--units", type=int, default=0, help="write units of so many seeds first")
    parser.add_argument("--seed", type=int, default=1, help="of the first unit")
    parser.add_argument("--families", nargs="+", choices=FAMILIES, default=list(FAMILIES))
    parser.add_argument("--even", action="store_true", help="families one after another, not by their weights")
    parser.add_argument(
        "--first-order", action="store_true", help="units without what is quadratic in the pins' errors"
    )
    parser.add_argument("--exact-stiffness", action="store_true", help="take the declared stiffness as exact")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--at-most", type=float, default=0.0, help="seconds of the processor a unit, else it failed")
    parser.add_argument("--out", type=Path, help="JSON lines, one a unit")
    options = parser.parse_args()
    policy = replace(POLICY, refit_stiffness=not options.exact_stiffness)
    units: dict[str, tuple[int, str, bool] | None] = {}
    for seed in range(options.seed, options.seed + options.units):
        family = choose(seed, tuple(options.families), even=options.even)
        units[str(options.folder / f"{family}-{seed}")] = seed, family, options.first_order
    if not units:
        folders = sorted(path.parent for path in options.folder.glob("*/truth.json"))
        units = {str(path): None for path in folders if not options.names or path.name in options.names}
    rows = []
    with ProcessPoolExecutor(options.jobs, initializer=keep_freed_memory) as executor:
        limit = options.at_most
        waiting = [executor.submit(trial, folder, draw, policy, limit) for folder, draw in units.items()]
        for done in as_completed(waiting):
            rows.append(done.result())
            print(line_of(rows[-1]), flush=True)
            if options.out is not None:
                with options.out.open("a") as file:
                    file.write(json.dumps(rows[-1]) + "\n")
    if rows:
        report(rows)


if __name__ == "__main__":
    main()
