"""What is named in one part of a drive's runs, tried on the part that no fit has seen.

The runs are split by direction of motion, by angle (below and above the middle of the travel) and by time (first and
second half).  Each half is diagnosed, and of every effect that is named there it is said how much of the squares of the
error in the other half it takes off, the others taken off too, each run less its own mean in each direction.  A name
holds where every half names it and it lessens the squares of every other half.

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


def centred(values: np.ndarray, way: np.ndarray) -> np.ndarray:
    """Values less their mean in each direction."""
    out = values.copy()
    for one in set(way):
        out[way == one] -= out[way == one].mean()
    return out


def name_of(effect: rverror.Effect) -> str:
    """Key and place of an effect."""
    return " ".join([effect.key, *(f"{name} {value}" for name, value in effect.indices.items())])


def main() -> None:
    """Split, diagnose, predict, print."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("model", metavar="MODEL.toml")
    options.add_argument("runs", nargs="+", metavar="RUN.csv")
    options.add_argument("--mapping", metavar="BENCH.toml")
    given = options.parse_args()
    model = rverror.load_model(given.model)
    runs = [rverror.load_run(path, model, mapping=given.mapping) for path in given.runs]
    verdicts: dict[str, list[float]] = defaultdict(list)
    tried = 0
    for by in ("direction", "angle", "time"):
        split = [(run, masks) for run in runs if (masks := halves(run, model, by)) is not None]
        if not split:
            print(f"by {by}: one half is empty, nothing to try")
            continue
        for side in (0, 1):
            tried += 1
            found = rverror.diagnose(model, [part(run, masks[side]) for run, masks in split])
            added = [one.effect for one in found.added]
            before, total, alone = 0.0, 0.0, np.zeros(len(added))
            count = 0
            for run, masks in split:
                unseen, way = masks[1 - side], run.direction[masks[1 - side]]
                error = centred(run.error(model)[unseen], way)
                bare = rverror.Model(model.mechanism, tuple(added))
                waves = rverror.transmission_error_by_effect(
                    bare, run.nominal_angle(model), direction=run.direction, time=run.time
                )
                made = [centred(wave[unseen], way) for wave in waves]
                left = error - sum(made, np.zeros_like(error))
                before += float(error @ error)
                total += float(left @ left)
                alone += [float((left + wave) @ (left + wave) - left @ left) for wave in made]
                count += error.size
            rms = [np.sqrt(each / count) / ARCSEC for each in (before, total)]
            print(
                f"by {by}, half {side + 1} seen: {found.verdict}; the other half, arcsec rms: "
                f"{rms[0]:.4g} before, {rms[1]:.4g} after"
            )
            for effect, gain in zip(added, alone / before, strict=True):
                print(f"    {name_of(effect)}: {100 * gain:+.1f} % of the unseen squares")
                verdicts[name_of(effect)].append(float(gain))
    print(f"\nHeld out {tried} times:")
    for name, gains in sorted(verdicts.items(), key=lambda item: -len(item[1])):
        worse = sum(gain <= 0 for gain in gains)
        said = "holds" if len(gains) == tried and not worse else "does not hold"
        print(f"  {name}: named {len(gains)} times, contradicted {worse} times: {said}")


if __name__ == "__main__":
    main()
