"""What is named in one part of a drive's runs, tried on the part that no fit has seen.

First all runs are diagnosed together.  Then they are split by direction of motion, by angle (below and above the middle
of the travel) and by time (first and second half).  Each half is diagnosed, and of every effect that is named there it
is said how much of the squares of the error in the other half it takes off, the others taken off too.  What is slow is
no matter there: each run is less its mean in each direction and, but for effects that are slow themselves, less cubics
of angle and time.

A name holds where every half names it and it lessens the squares of every other half; where it is named in some and
lessens each it is not contradicted.

    python benchmarks/real_machines/held_out.py MODEL.toml RUN.csv [RUN.csv ...] [--mapping BENCH.toml]
"""

from __future__ import annotations

import argparse
from collections import defaultdict

import numpy as np

import rverror

ARCSEC = rverror.ARCSEC


def halves(run: rverror.Run, model: rverror.Model, by: str) -> tuple[np.ndarray, np.ndarray] | None:
    """Samples of both parts of a run; None where one of them is empty."""
    theta = run.nominal_angle(model)
    first = {
        "direction": run.direction > 0,
        "angle": theta < (theta.min() + theta.max()) / 2,
        "time": np.arange(theta.size) < theta.size // 2,
    }[by]
    return (first, ~first) if 0.05 < first.mean() < 0.95 else None


def part(run: rverror.Run, kept: np.ndarray) -> rverror.Run:
    """Some samples of a run, one after another; their angles tell the direction."""
    columns = {"input_angle": run.input_angle, "output_angle": run.output_angle, "te": run.te_column, "time": run.time}
    return rverror.run_from_arrays(**{name: values[kept] for name, values in columns.items() if values is not None})


def without_slow(values: np.ndarray, way: np.ndarray, *courses: np.ndarray) -> np.ndarray:
    """Rows less their mean in each direction and, of courses such as the angle, less cubics."""
    scaled = [2 * (one - one.min()) / max(np.ptp(one), 1e-300) - 1 for one in courses]
    columns = [way == one for one in sorted(set(way))] + [one**power for one in scaled for power in (1, 2, 3)]
    basis = np.linalg.qr(np.stack(columns, axis=1).astype(float))[0]
    return values - (values @ basis) @ basis.T


def tried(model: rverror.Model, effects: list[rverror.Effect], run: rverror.Run, unseen: np.ndarray) -> np.ndarray:
    """Squares of the unseen samples before and after, then what each effect takes off, over those before.

    An effect counts without what is slow, unless that leaves less than half of its squares.
    """
    theta, way = run.nominal_angle(model), run.direction[unseen]
    bare = rverror.Model(model.mechanism, tuple(effects))
    waves = rverror.model.transmission_error_by_effect(bare, theta, direction=run.direction, time=run.time)
    rows = np.vstack([run.error(model)[None], np.reshape(waves, (len(effects), theta.size))])[:, unseen]
    clock = np.arange(theta.size, dtype=float) if run.time is None else run.time
    slow, fast = without_slow(rows, way), without_slow(rows, way, theta[unseen], clock[unseen])
    gains = []
    for number in range(1, len(rows)):
        is_fast = np.sum(fast[number] ** 2) > 0.5 * np.sum(slow[number] ** 2)
        error, *made = fast if is_fast else slow
        left = error - np.sum(made, axis=0)
        gains.append((np.sum((left + made[number - 1]) ** 2) - np.sum(left**2)) / np.sum(error**2))
    left = fast[0] - fast[1:].sum(axis=0)
    return np.array([np.sum(fast[0] ** 2), np.sum(left**2), *gains]) * np.array([1, 1, *[unseen.sum()] * len(gains)])


def name_of(effect: rverror.Effect) -> str:
    """Key and place of an effect."""
    return " ".join([effect.key, *(f"{name} {value}" for name, value in effect.indices.items())])


def main() -> None:
    """Split, diagnose, predict, print."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("model", metavar="MODEL.toml")
    options.add_argument("runs", nargs="+", metavar="RUN.csv")
    options.add_argument("--mapping", metavar="BENCH.toml")
    options.add_argument("--every", type=int, default=1, metavar="N", help="of the samples, one in N (default 1)")
    given = options.parse_args()
    model = rverror.load_model(given.model)
    whole = [rverror.load_run(path, model, mapping=given.mapping) for path in given.runs]
    runs = [part(run, np.arange(run.size) % given.every == 0) for run in whole] if given.every > 1 else whole
    print(rverror.to_text(rverror.diagnose(model, runs)))
    verdicts: dict[str, list[float]] = defaultdict(list)
    halves_tried = 0
    for by in ("direction", "angle", "time"):
        split = [(run, masks) for run in runs if (masks := halves(run, model, by)) is not None]
        if not split:
            print(f"by {by}: one half is empty, nothing to try")
            continue
        for side in (0, 1):
            halves_tried += 1
            found = rverror.diagnose(model, [part(run, masks[side]) for run, masks in split])
            effects = [one.effect for one in found.added]
            sums = sum(tried(model, effects, run, masks[1 - side]) for run, masks in split)
            count = sum(masks[1 - side].sum() for _, masks in split)
            before, after = np.sqrt(sums[:2] / count) / ARCSEC
            print(f"by {by}, half {side + 1} seen: {found.verdict}; arcsec rms of the other half without what is slow: "
                  f"{before:.4g} before, {after:.4g} after", flush=True)  # fmt: skip
            for effect, gain in zip(effects, sums[2:] / count, strict=True):
                print(f"    {name_of(effect)}: {100 * gain:+.1f} % of the unseen squares")
                verdicts[name_of(effect)].append(float(gain))
    print(f"\nHeld out {halves_tried} times:")
    for name, gains in sorted(verdicts.items(), key=lambda item: -len(item[1])):
        worse = sum(gain <= 0 for gain in gains)
        said = f"contradicted {worse} times" if worse else "holds" if len(gains) == halves_tried else "not contradicted"
        print(f"  {name}: named {len(gains)} times, {said}")


if __name__ == "__main__":
    main()
