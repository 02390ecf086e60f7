"""Matching a lot of simulated parts: yield against chance, classes and the bound, judged by an independent solver.

    python benchmarks/match_trial.py [--list maker|source] [--units 100] [--limit 22] [--at 412] [--seed 3]
        [--rollers 1] [--classes 4] [--uncertainty 0.2]

Parts are drawn from a list of the examples: two cranks, two discs and a housing for each unit; sun, planets, carrier
and clearances have their means.  With --rollers these are parts too, of so many times the list's scatter, measured one
by one or sorted into classes of equal width.  With --uncertainty what matching is told of a part is its true sizes and
an error of measurement.  The units of the list that comes out, of true parts, and fresh units put together at random,
are solved anew by the solver of benchmarks/load_trial, which shares no line with rverror.  Processor time, which other
work on the machine does not stretch.
"""

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS"):
    os.environ.setdefault(_name, "1")

import argparse  # noqa: E402
import sys  # noqa: E402
from collections.abc import Iterable  # noqa: E402
from dataclasses import replace  # noqa: E402
from pathlib import Path  # noqa: E402
from time import process_time  # noqa: E402

import numpy as np  # noqa: E402

sys.path.append(str(Path(__file__).parents[1]))

from benchmarks.load_trial.parts import Error, build  # noqa: E402
from benchmarks.load_trial.planar import train_of  # noqa: E402
from benchmarks.load_trial.sizes import transmission_errors  # noqa: E402

import rverror  # noqa: E402
from rverror.model.catalogue import source  # noqa: E402
from rverror.parts.measured import mounted, places_of  # noqa: E402

EXAMPLES = Path(__file__).parents[1] / "examples"
LISTS = {
    "maker": ("rv40e-maker.toml", "rv40e-maker-tolerances.toml"),
    "source": ("rv40e.toml", "rv40e-tolerances.toml"),
}
KINDS = {"crank": "crank", "disc": "disc", "housing": ""}
COMMON = ("cycloid.profile_modification", "involute.sun_offset")  # of no part that is matched


def lot_of(which: str, units: int, seed: int, *, rollers: float = 0.0) -> tuple[rverror.Model, list]:
    """Model with all that is not matched at its mean, and parts for so many units."""
    model_file, tolerance_file = (EXAMPLES / name for name in LISTS[which])
    model = rverror.load_model(model_file)
    every = rverror.load_tolerances(tolerance_file, model)
    drawn = [one for one in every if source(one.key).frame in KINDS and one.key not in COMMON]
    means = [
        rverror.Effect(one.key, at, tuple(one.mean.get(p.name, 0.0) for p in source(one.key).parameters))
        for one in every
        if one not in drawn and any(one.mean.values())
        for at in one.instances(model.mechanism)
    ]
    model = rverror.Model(model.mechanism, (*model.effects, *means), model.name)
    laid = rverror.tolerances.stack(model, drawn, theta=[0.0])
    uniform = np.random.default_rng(seed).random((units, laid.dimensions))
    middle = [drawn[e].mean.get(c.parameter, 0.0) for c, e in zip(laid.components, laid.entry, strict=True)]
    values = np.array(middle) + laid.standard(uniform) * laid.width[laid.entry]
    parts = []
    for unit in range(units):
        found: dict[tuple[str, object], dict[tuple, list[float]]] = {}
        for component, entry, value in zip(laid.components, laid.entry, values[unit], strict=True):
            at, kind = dict(component.indices), source(component.key).frame
            if rollers and drawn[entry].name == "rollers of one set":
                kind, place, value = "roller", at.pop("pin"), rollers * value
            else:
                place = at.pop(KINDS[kind], None)
            names = [parameter.name for parameter in source(component.key).parameters]
            errors = found.setdefault((kind, place), {})
            errors.setdefault((component.key, *at.items()), [0.0] * len(names))[names.index(component.parameter)] += (
                value
            )
        for (kind, place), errors in found.items():
            effects = tuple(rverror.Effect(key, dict(at), tuple(sizes)) for (key, *at), sizes in errors.items())
            serial = f"{kind[0].upper()}{unit}" + ("" if place is None else f"-{place}")
            parts.append(rverror.parts.MeasuredPart(kind, serial, effects))
    return model, parts


def in_classes(parts: list, classes: int) -> tuple[list, dict]:
    """Rollers sorted into classes of equal width, and all true parts by their names, or that of their class."""
    rollers = [part for part in parts if part.kind == "roller"]
    true = {(part.kind, part.serial): [part] for part in parts if not classes or part.kind != "roller"}
    if not classes:
        return parts, true
    sizes = np.array([part.errors[0].values[0] for part in rollers])
    edges = np.linspace(sizes.min(), sizes.max(), classes + 1)
    width, found = edges[1] - edges[0], [part for part in parts if part.kind != "roller"]
    for number in range(classes):
        of = np.flatnonzero(np.clip(np.searchsorted(edges, sizes, "right") - 1, 0, classes - 1) == number)
        middle = rverror.Effect("cycloid.pin_radius", {}, (edges[number] + width / 2,), width / 12**0.5)
        name = f"class {number + 1}"
        true["roller", name] = [rollers[at] for at in of]
        if of.size:
            found.append(rverror.parts.MeasuredPart("roller", name, (middle,), count=of.size))
    return found, true


def as_measured(part: rverror.parts.MeasuredPart, sigma: float, rng: np.random.Generator) -> rverror.parts.MeasuredPart:
    """A part as a machine of so much uncertainty, mm, tells it; its angles are lengths at the crank circle."""
    errors = []
    for error in part.errors:
        own = sigma / (27.0 if source(error.key).parameters[0].dimension == "angle" else 1.0)
        read = np.array(error.values) + own * rng.standard_normal(len(error.values))
        errors.append(replace(error, values=tuple(read.tolist()), uncertainty=own))
    return replace(part, errors=tuple(errors))


def as_built(model: rverror.Model, unit: rverror.matching.result.MatchedUnit, true: dict) -> rverror.Model:
    """A unit of the list of true parts; of a class of rollers, the next one in its box."""
    effects = list(model.effects)
    for one in unit.parts:
        box = true[one.kind, one.serial]
        part = box.pop() if one.kind == "roller" else box[0]
        effects += mounted(part, model.mechanism, one.place, one.turn)
    return rverror.Model(model.mechanism, tuple(effects))


def judged(models: Iterable[rverror.Model], torque: float) -> np.ndarray:
    """Peak-to-peak of each unit forward, arcsec, by the independent solver."""
    models = list(models)
    train = train_of(models[0].mechanism)
    units = [build(train, [Error(e.key, e.indices, e.values) for e in model.effects]) for model in models]
    return transmission_errors(train, units, torque, build(train, []))


def within(model: rverror.Model, limit: rverror.tolerances.Limit, direction: float) -> bool:
    """Whether a unit keeps a limit of the transmission error."""
    theta = 2 * np.pi * np.arange(960) / 960
    state = rverror.equilibrium(model, theta, torque=limit.torque, direction=direction)
    return bool(np.ptp(state.transmission_error) <= limit.value)


def at_random(model: rverror.Model, parts: list, units: int) -> list[rverror.Model]:
    """Units of parts in the order in which they come; discs turned so that their lobes stand right."""
    found = []
    for unit in range(units):
        effects = list(model.effects)
        for kind in dict.fromkeys(part.kind for part in parts):
            some = [part for part in parts if part.kind == kind]
            places = places_of(model.mechanism, kind)
            for number, place in enumerate(places):
                effects += mounted(some[unit * len(places) + number], model.mechanism, place.number, place.turns[0])
        found.append(rverror.Model(model.mechanism, tuple(effects)))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--list", choices=tuple(LISTS), default="maker")
    parser.add_argument("--units", type=int, default=100)
    parser.add_argument("--limit", type=float, default=22.0, help="arcsec, of both directions")
    parser.add_argument("--lost-motion", type=float, help="arcsec")
    parser.add_argument("--at", default="412", help="N*m, one or more with commas")
    parser.add_argument("--rollers", type=float, default=0.0, help="of the maker's list, times its scatter: parts too")
    parser.add_argument("--classes", type=int, default=0, help="into which the rollers are sorted")
    parser.add_argument("--uncertainty", type=float, default=0.0, help="um, of each measured size, 1 sigma")
    parser.add_argument("--seed", type=int, default=3)
    options = parser.parse_args()
    torques = [float(text) for text in options.at.split(",")]
    model, parts = lot_of(options.list, options.units, options.seed, rollers=options.rollers)
    told, true = in_classes(parts, options.classes)
    if options.uncertainty:
        rng = np.random.default_rng(options.seed)
        told = [part if part.count > 1 else as_measured(part, options.uncertainty * 1e-3, rng) for part in told]
    limits = [
        rverror.limit("transmission_error", f"{options.limit} arcsec", torque=f"{torque} N*m") for torque in torques
    ]
    if options.lost_motion:
        limits.append(rverror.limit("lost_motion", f"{options.lost_motion} arcsec"))
    begun = process_time()
    found = rverror.match(model, told, limits)
    taken = process_time() - begun
    print(rverror.to_text(found).partition("\nunit ")[0])
    print(f"{taken:.1f} s of processor time; linear errors are off by {100 * found.doubt:.1f} % of the limit (1 sigma)")
    gap = 1 - len(found.units) / found.bound
    print(
        f"below the bound by {100 * gap:.1f} %; of {len(found.units)} listed "
        f"{sum(unit.chance for unit in found.units):.1f} are expected to be good"
    )
    built = [as_built(model, unit, true) for unit in found.units]
    if options.uncertainty or options.classes:
        good = [
            all(within(one, limit, sense) for limit in limits[: len(torques)] for sense in (1.0, -1.0)) for one in built
        ]
        print(f"of true parts {sum(good)} keep the transmission error both ways (rverror's equilibrium)")
    _, fresh = lot_of(options.list, options.units, options.seed + 1, rollers=options.rollers)
    chance = at_random(model, fresh, options.units)
    for torque in torques:
        sizes = judged(built, torque * 1e3)
        forward = next(
            n for n, q in enumerate(found.quantities) if q.span and q.direction > 0 and q.limit.torque == torque * 1e3
        )
        claimed = np.array([unit.turns[forward] for unit in found.units]) / rverror.ARCSEC
        others = judged(chance, torque * 1e3)
        stated = np.mean(found.ways[0].turns[:, forward] <= options.limit * rverror.ARCSEC)
        print(
            f"independent solver, {torque:g} N*m forward: {np.mean(sizes <= options.limit):.0%} of those listed are "
            f"within {options.limit:g} arcsec (largest {sizes.max():.2f}), off from the list by "
            f"{np.abs(claimed / sizes - 1).max():.2%} at the most; fresh units put together at random: "
            f"{np.mean(others <= options.limit):.0%}, rverror {stated:.0%}"
        )


if __name__ == "__main__":
    main()
