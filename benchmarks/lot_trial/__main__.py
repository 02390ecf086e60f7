"""Judge what ``rverror lot`` says of simulated lots: python -m benchmarks.lot_trial --first S [--lots N] [--kind K].

Each lot is written, told by the command line and compared with its truth: whether the intervals of standard deviations
hold it (those of processes that were not spread hold 0 where they are not above zero), which processes are said to be
above zero and are not, which units, groups and changes are named beside the limits of detection, and whether the
predicted 95 % quantile is within both errors from that of 200 other units of the same lot, without noise.  One line of
JSON a lot; the last line sums up.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from benchmarks.load_trial.planar import Array
from benchmarks.lot_trial import make
from scipy.stats import nct, norm

Row = dict[str, Any]
OTHERS = 200  # units of the same lot that are not measured


def judged(seed: int, kind: str, folder: Path, units: int | None, *, unmarked: bool = False) -> Row:
    """What is said of one lot beside what is true."""
    made = make.simulate(seed, kind, units)
    made = make.unmarked(made) if unmarked else made
    make.write(made, folder)
    start = time.perf_counter()
    command = [sys.executable, "-m", "rverror", "lot", str(folder), "--model", str(folder / "model.toml")]
    done = subprocess.run(
        [*command, "--json", str(folder.parent / "lot.json")], capture_output=True, text=True, check=False
    )
    row: Row = {"seed": seed, "kind": kind, "seconds": round(time.perf_counter() - start, 1), "exit": done.returncode}
    if done.returncode:
        return row | {"error": done.stderr.strip()[-300:]}
    told = json.loads((folder.parent / "lot.json").read_text(encoding="utf-8"))
    truth = made.truth
    true = truth["sd_um"] | truth["sd_arcsec"]
    row |= {"units": told["units"], "torque": truth["torque_Nm"], "chance": told["chance"]}
    row["processes"] = [
        {
            "key": name,
            "true": true.get(name, 0.0),
            "sd": one["sd"],
            "interval": one["sd_interval"],
            "above": one["above_zero"],
        }
        for name, one in processes(told).items()
        if one["sd"] is not None
    ]
    for name in ("outliers", "groups", "changes"):
        row[name] = told[name]
    row |= {"shift": truth["shift"], "spoilt": truth["spoilt"], "predicted": told["predicted_by_condition"]}
    row["others"] = others(seed, kind, len(made.outputs))
    row["usual"] = usual(made.outputs - made.inputs / 121)
    return row


def usual(errors: Array) -> list[float]:
    """Maker's usual limit of the peak-to-peak, forward and reverse: mean plus k standard deviations, arcsec.

    With k a normal lot's 95 % quantile is below the limit in 97.5 % of lots, as it is below the end of the interval.
    """
    sizes, units = np.ptp(errors, axis=2) * 3600, len(errors)
    k = float(nct.ppf(0.975, units - 1, norm.ppf(0.95) * np.sqrt(units))) / np.sqrt(units)
    return [float(x) for x in sizes.mean(axis=0) + k * sizes.std(axis=0, ddof=1)]


def processes(told: Row) -> dict[str, Row]:
    """Entries by the name of their process: one for all parts, whatever the parameter."""
    found: dict[str, Row] = {}
    for one in told["processes"]:
        part = [key for key in one["indices"] if key != "harmonic"]
        if not part:
            found.setdefault(name_of(one["key"], one["indices"]), one)
    return found


def name_of(key: str, indices: dict[str, Any]) -> str:
    """Key and harmonic as in truth.json."""
    return key + (f" (harmonic {indices['harmonic']})" if "harmonic" in indices else "")


def others(seed: int, kind: str, units: int) -> list[list[float]]:
    """95 % quantiles of the peak-to-peak of the next units, forward and reverse, with their standard errors, arcsec.

    Of units without noise and of no spoilt one; half of those of a lot from two machines are of each.
    """
    plan = make.draw_plan(seed, kind, units + OTHERS)
    train, theta, sizes = make.true_train(plan), 2 * np.pi * np.arange(make.SAMPLES) / make.SAMPLES, []
    labels = make.draw_labels(plan)
    for serial in range(units, units + OTHERS):
        errors = make.draw_errors(plan, serial, train) + make.shifted(plan, serial, labels, train)
        sizes.append(np.ptp(make.true_outputs(plan, errors, train, theta) - theta, axis=1) / make.ARCSEC)
    own = np.sort(sizes, axis=0)
    side = 1.96 * np.sqrt(OTHERS * 0.05 * 0.95)
    low, middle, high = (own[round(OTHERS * 0.95 + by)] for by in (-side, 0, side))
    return [[float(m), float((h - less) / (2 * 1.96))] for less, m, h in zip(low, middle, high, strict=True)]


def near(predicted: Row, other: list[float]) -> bool:
    """Whether a predicted quantile is within the errors of both from that of other units."""
    low, high = predicted["p95_interval"]
    away = predicted["p95_arcsec"] - other[0]
    return bool(abs(away) <= 1.96 * np.hypot((high - low) / (2 * 1.96), other[1]))


def limits(rows: list[Row]) -> list[tuple[float, float]]:
    """Upper ends of the intervals of predicted quantiles, and the usual limits, over quantiles of other units."""
    return [
        (p["p95_interval"][1] / o[0], u / o[0])
        for row in rows
        for p, o, u in zip(row.get("predicted", ()), row.get("others", ()), row.get("usual", ()), strict=False)
    ]


def summed(rows: list[Row]) -> Row:
    """Counts over all lots."""
    of = [one for row in rows for one in row.get("processes", ())]
    spread, none = [one for one in of if one["true"]], [one for one in of if not one["true"]]
    return {
        "lots": len(rows),
        "spread": len(spread),
        "held": sum(one["interval"][0] <= one["true"] <= one["interval"][1] for one in spread),
        "spread_above_zero": sum(one["above"] for one in spread),
        "none": len(none),
        "none_above_zero": sum(one["above"] for one in none),
        "outliers": sum(len(row.get("outliers", ())) for row in rows),
        "groups": sum(len(row.get("groups", ())) for row in rows),
        "changes": sum(len(row.get("changes", ())) for row in rows),
        "doubted": sum(row.get("chance", 1) < 1e-3 for row in rows),
        "predicted": sum(near(p, o) for row in rows
                         for p, o in zip(row.get("predicted", ()), row.get("others", ()), strict=False)),
        "limits": [float(np.mean(x)) for x in zip(*limits(rows), strict=True)],
        "seconds": [round(float(np.median([row["seconds"] for row in rows])), 1), max(row["seconds"] for row in rows)],
    }  # fmt: skip


def main(words: list[str] | None = None) -> None:
    """Run the trial with these words of the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0], allow_abbrev=False)
    parser.add_argument("--first", type=int, required=True, help="seed of the first lot")
    parser.add_argument("--lots", type=int, default=30)
    parser.add_argument("--kind", choices=("plain", "machine", "drift", "sound"), default="plain")
    parser.add_argument("--units", type=int, help="of each lot (default: drawn)")
    parser.add_argument("--unmarked", action="store_true", help="zeros of the runs are not on the marks")
    given = parser.parse_args(words)
    rows = []
    for seed in range(given.first, given.first + given.lots):
        with tempfile.TemporaryDirectory() as scratch:
            rows.append(judged(seed, given.kind, Path(scratch) / "lot", given.units, unmarked=given.unmarked))
        print(json.dumps(rows[-1]), flush=True)
    print(json.dumps(summed(rows)), flush=True)


if __name__ == "__main__":
    main()
