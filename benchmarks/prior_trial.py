"""What a lot as prior is worth: quiet units, one cause each near the noise, diagnosed without it and with it.

    python benchmarks/prior_trial.py --seed S [--units N] [--out FILE.jsonl] [--at-most SECONDS]

Units are those of `real_trial.py` that lack one effect, of keys that its trials often left among others (`KEYS`), at
0.3 to 1 times the sizes that are drawn there.  Their lot spreads five processes, the effect's own so that its size is a
usual draw; the others make next to nothing.  Of these a prior says ``every``: a tenth of what a workshop makes, all
sources of the catalogue; ``told``: as far up as the intervals of trial lots of 80 to 200 units went (`TOLD`), and
nothing of processes that these do not tell.  Every standard deviation is 10 % off.  Units that are named rightly
without a prior are diagnosed with it one time in four, the others always.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402
import json  # noqa: E402
import math  # noqa: E402
import signal  # noqa: E402
import tempfile  # noqa: E402
import warnings  # noqa: E402
from collections import Counter  # noqa: E402
from pathlib import Path  # noqa: E402
from time import process_time  # noqa: E402
from typing import Any  # noqa: E402

import numpy as np  # noqa: E402
from real_bench import units as bench  # noqa: E402
from real_bench.judging import named_sets  # noqa: E402
from real_trial import _too_long  # noqa: E402

import rverror  # noqa: E402
from rverror.model.catalogue import CATALOGUE, source  # noqa: E402

#: Keys of the missing effects, and how often they are drawn.
KEYS = {
    "coupling.carrier_runout": 3, "coupling.carrier_bore_position": 2, "cycloid.profile_modification": 3,
    "cycloid.pin_circle": 2, "cycloid.pin_radius": 1, "cycloid.pin_position": 1, "cycloid.disc_bore_position": 1,
    "crank.bearing_clearance": 1, "involute.planet_pitch": 1, "involute.planet_eccentricity": 1,
    "involute.center_distance": 1, "involute.sun_eccentricity": 1, "involute.sun_pitch": 1,
}  # fmt: skip
#: Upper ends of intervals of processes that make nothing over the search's prior, medians of trial lots.
TOLD: dict[tuple[str, int | None], float] = {
    ("coupling.carrier_runout", None): 0.10, ("crank.eccentricity", None): 0.014,
    ("cycloid.disc_bore_position", None): 0.016, ("cycloid.disc_lobe", None): 0.0064,
    ("cycloid.disc_pitch", 1): 0.026, ("cycloid.disc_pitch", 2): 0.0076, ("cycloid.disc_profile", 1): 0.0097,
    ("cycloid.disc_profile", 2): 0.0046, ("cycloid.pin_position", None): 0.0029, ("cycloid.pin_radius", None): 0.029,
    ("involute.planet_eccentricity", None): 0.32, ("involute.planet_pitch", 1): 0.22,
    ("involute.planet_pitch", 2): 0.023, ("sensor.encoder_eccentricity", None): 0.0006,
    ("sensor.encoder_ellipticity", None): 0.0007, ("sensor.input_coupling", 1): 0.0006,
}  # fmt: skip
VISIBLE = 0.15  # arcsec rms
CORE = {"length": "mm", "angle": "rad"}
Process = tuple[str, int | None]


def drawn(seed: int, attempt: int) -> bench.Unit:
    """A unit that lacks one effect."""
    random = np.random.default_rng([seed, 17, attempt])
    unit = bench.Unit(seed=seed, family="quiet", random=random, what="one small effect is missing")
    key = str(random.choice(list(KEYS), p=np.array(list(KEYS.values())) / sum(KEYS.values())))
    bench.declare(unit, discs_only=random.random() < 0.1)
    bench.both_ways(unit, bench.grid())
    if random.random() < 1 / 3:
        bench.wrong_stiffness(unit)
    unit.undeclared.append(scaled(bench.draw_effect(unit, key), math.exp(random.uniform(math.log(0.3), 0))))
    return unit


def process_of(effect: dict[str, Any]) -> Process:
    return effect["key"], effect.get("harmonic")


def scaled(effect: dict[str, Any], factor: float) -> dict[str, Any]:
    sizes = {name: value.split() for name, value in effect.items() if isinstance(value, str) and " " in value}
    return effect | {name: f"{float(value) * factor:.4f} {unit}" for name, (value, unit) in sizes.items()}


def made(seed: int, folder: Path) -> dict[str, Any]:
    """Write the unit of a seed, of an effect that shows; its truth."""
    for attempt in range(30):
        unit = drawn(seed, attempt)
        try:
            errors, rms = bench.Simulated(unit).shares()
        except ArithmeticError:
            continue
        if rms[0] >= VISIBLE:
            return bench.write(unit, errors, rms, folder)
    raise ArithmeticError(f"{seed}: none of 30 draws can be seen")


def priors(seed: int, truth: dict[str, Any], unit: rverror.Reducer) -> dict[str, list[rverror.tolerances.Tolerance]]:
    """What the lot says, either way."""
    random = np.random.default_rng([seed, 18])
    (effect,) = truth["undeclared"]
    own = process_of(effect)
    sizes = np.array(list(bench.sizes_of(effect).values()))
    usual = max(float(np.sqrt(np.mean(random.normal(size=sizes.size) ** 2))), 0.3)
    spread = {own: float(np.sqrt(np.mean(sizes**2))) / usual}
    every = {
        (key, indices.get("harmonic")): 0.1
        for key, entry in CATALOGUE.items()
        if entry.tried and entry.applies_to(unit) and entry.parameters[0].dimension in CORE
        for indices in entry.candidates(unit)
    }
    others = [process for process in sorted(every, key=str) if process != own and process[0] in bench.KINDS]
    for at in random.choice(len(others), size=4, replace=False):
        kind = bench.KINDS[others[at][0]]
        size = math.exp(random.uniform(math.log(kind.least), math.log(kind.most))) / math.sqrt(2)
        spread[others[at]] = size * (1e-3 if kind.unit == "um" else bench.ARCSEC)
    return {
        name: [as_tolerance(process, spread.get(process), share, float(np.exp(0.1 * random.normal())))
               for process, share in sorted((dict.fromkeys(spread, 1.0) | bounds).items(), key=str)]
        for name, bounds in (("every", every), ("told", TOLD))
    }  # fmt: skip


def as_tolerance(process: Process, spread: float | None, share: float, off: float) -> rverror.tolerances.Tolerance:
    """A process of so much spread, or of none beyond a share of the search's own prior."""
    key, harmonic = process
    parameter = source(key).parameters[0]
    width = 3 * off * (share * 0.5 * parameter.plausible if spread is None else spread)
    indices = {} if harmonic is None else {"harmonic": harmonic}
    size = f"{width!r} {CORE[parameter.dimension]}"
    mean = None if math.isinf(parameter.least) else size  # a clearance is none below nothing
    return rverror.tolerance(key, size, distribution="normal", mean=mean, **indices)


def verdict(truth: dict[str, Any], found: dict[str, Any]) -> str:
    """``right``: its cause and no rival; ``among``: its cause and others as good; ``wrong``; ``none``."""
    key, sets = truth["undeclared"][0]["key"], named_sets(truth, found)
    if not sets:
        return "none"
    if len(sets) > 1 or key not in sets[0]:
        return "wrong"
    return "right" if sets[0] == {key} else "among"


def told_of(
    truth: dict[str, Any], folder: Path, prior: list[rverror.tolerances.Tolerance], limit: float
) -> dict[str, Any]:
    """What the diagnosis says of a unit."""
    start = process_time()
    signal.signal(signal.SIGPROF, _too_long)
    signal.setitimer(signal.ITIMER_PROF, limit)
    try:
        runs = [rverror.load_run(file) for file in sorted(folder.glob("*.csv"))]
        result = rverror.diagnose(rverror.load_model(folder / "model.toml"), runs, jobs=1, prior=prior)
        found = rverror.to_json(result)
    except Exception as error:  # a trial of many units goes on
        return {"verdict": "failed", "error": repr(error)[:300]}
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    names = [[one["key"], one["indices"], sorted({o["key"] for o in one.get("indistinguishable_from", [])})]
             for one in found["added"]]  # fmt: skip
    return {"verdict": verdict(truth, found), "named": names, "seconds": round(process_time() - start, 1)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, required=True, help="of the first unit")
    parser.add_argument("--units", type=int, default=100)
    parser.add_argument("--at-most", type=float, default=100.0, help="seconds of the processor a diagnosis")
    parser.add_argument("--out", type=Path, help="JSON lines, one a unit")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    pairs: Counter[tuple[str, str, str]] = Counter()
    for seed in range(options.seed, options.seed + options.units):
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            truth = made(seed, folder)
            row: dict[str, Any] = {"seed": seed, "missing": truth["undeclared"], "rms": truth["effect_rms_arcsec"]}
            row["stiffness"] = "true_over_declared_stiffness" in truth
            row["without"] = told_of(truth, folder, [], options.at_most)
            if row["without"]["verdict"] != "right" or seed % 4 == 0:
                unit = rverror.load_model(folder / "model.toml").mechanism
                for kind, prior in priors(seed, truth, unit).items():
                    row[kind] = told_of(truth, folder, prior, options.at_most)
                    pairs[kind, row["without"]["verdict"], row[kind]["verdict"]] += 1
        print(seed, row["missing"][0]["key"], row["rms"], *(row[k]["verdict"] for k in ("without", "every", "told")
                                                            if k in row), flush=True)  # fmt: skip
        if options.out is not None:
            with options.out.open("a") as file:
                file.write(json.dumps(row) + "\n")
    for (kind, before, after), count in sorted(pairs.items()):
        print(f"{kind:6s} without {before:6s} with {after:6s} {count:4d}")


if __name__ == "__main__":
    main()
