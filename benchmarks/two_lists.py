"""Units of a model and a tolerance list, SIMULATED: error, lost motion and stiffness beside the maker's limits.

    python benchmarks/two_lists.py MODEL.toml TOLERANCES.toml [--units 256] [--seed 1] [--lines]

Each unit is drawn from the list and solved by itself: transmission error forward at two loads over one turn, lost
motion at 3 % of the rated torque and torsional stiffness at 48 angles.  With --lines each tolerance is also drawn
alone, the others at their means: what it does to the lost motion.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence

import numpy as np

import rverror
from rverror import ARCSEC

LOADS = ("20 N*m", "412 N*m")
ANGLES = 1031  # a prime: no mesh order falls on few phases
PLACES = (np.arange(48) + 0.3) / 48 * 2 * np.pi
#: What the maker prints, as docs/theory/rigidity.md quotes it; the stiffness as a share of the nominal 108 N*m/arcmin.
PEAK_TO_PEAK, LOST_MOTION, STIFFNESS = 60.0, 60.0, 0.9 * 108
FIGURES = (
    *(f"TE peak-to-peak at {load}, arcsec" for load in LOADS),
    "lost motion, largest over the turn, arcsec",
    "lost motion, mean over the turn, arcsec",
    "stiffness, mean over the turn, N*m/arcmin",
)
_ARCMIN = 60 * ARCSEC * 1e-3  # of N*mm/rad in N*m/arcmin


def drawn(model: rverror.Model, tolerances: list, count: int, seed: int, alone: int | None = None) -> list:
    """Models of units; with `alone` only that entry is drawn, all others stand at their means."""
    laid_out = rverror.tolerances.stack(model, tolerances, theta=np.array([0.0]))
    uniforms = np.random.default_rng(seed).random((count, laid_out.dimensions))
    sizes = laid_out.standard(uniforms) * laid_out.width[laid_out.entry]
    if alone is not None:
        sizes[:, laid_out.entry != alone] = 0.0
    return [_unit(model, tolerances, laid_out, row) for row in sizes]


def _unit(model: rverror.Model, tolerances: list, laid_out: rverror.tolerances.Stack, row: np.ndarray) -> rverror.Model:
    """The declared model with the sizes of one row added at their components."""
    added: dict[tuple, dict[str, float]] = {}
    for part, entry, size in zip(laid_out.components, laid_out.entry, row, strict=True):
        place = (entry, part.key, tuple(part.indices.items()))
        value = size + tolerances[entry].mean.get(part.parameter, 0.0)
        least = next(p.least for p in rverror.CATALOGUE[part.key].parameters if p.name == part.parameter)
        added.setdefault(place, {})[part.parameter] = max(value, least)
    effects = [rverror.effect(key, **dict(indices), **values) for (_, key, indices), values in added.items()]
    return rverror.Model(model.mechanism, (*model.effects, *effects))


def figures(unit: rverror.Model) -> tuple[float, ...]:
    """`FIGURES` of one unit."""
    theta = np.arange(ANGLES) / ANGLES * 2 * np.pi
    errors = [rverror.equilibrium(unit, theta, torque=load).transmission_error for load in LOADS]
    lost = rverror.lost_motion(unit, PLACES)
    return (
        *(float(np.ptp(te)) / ARCSEC for te in errors),
        float(lost.max()) / ARCSEC,
        float(lost.mean()) / ARCSEC,
        float(rverror.statics.torsional_stiffness(unit, PLACES).mean()) * _ARCMIN,
    )


def shares(found: np.ndarray) -> tuple[float, ...]:
    """Shares of the units that keep each limit, and all of them."""
    kept = np.column_stack([found[:, :2] <= PEAK_TO_PEAK, found[:, 2] <= LOST_MOTION, found[:, 4] >= STIFFNESS])
    return (*kept.mean(axis=0), kept.all(axis=1).mean())


def main(arguments: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("model")
    parser.add_argument("tolerances")
    parser.add_argument("--units", type=int, default=256)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--lines", action="store_true")
    options = parser.parse_args(arguments)
    model = rverror.load_model(options.model)
    tolerances = list(rverror.load_tolerances(options.tolerances, model))
    nominal = figures(model)
    middle = figures(drawn(model, tolerances, 1, 0, alone=-1)[0])
    found = np.array([figures(unit) for unit in drawn(model, tolerances, options.units, options.seed)])
    print(f"SIMULATED: {options.units} units of {options.tolerances}, seed {options.seed}")
    print(f"{'':46}{'declared':>9}{'means':>9}{'least':>9}{'P1':>9}{'P50':>9}{'P95':>9}{'P99':>9}{'largest':>9}")
    for place, name in enumerate(FIGURES):
        values = found[:, place]
        row = (nominal[place], middle[place], values.min(), *np.quantile(values, (0.01, 0.5, 0.95, 0.99)), values.max())
        print(f"{name:46}" + "".join(f"{value:9.2f}" for value in row))
    names = (*(f"TE at {load}" for load in LOADS), "lost motion", "stiffness", "all")
    print("within the limits: " + ", ".join(f"{n} {100 * s:.1f} %" for n, s in zip(names, shares(found), strict=True)))
    if options.lines:
        print(f"lost motion, arcsec, mean and deviation with one line drawn; {middle[2]:.2f} with all at their means")
        for entry, item in enumerate(tolerances):
            units = drawn(model, tolerances, 64, options.seed, alone=entry)
            alone = np.array([rverror.lost_motion(unit, PLACES).max() for unit in units]) / ARCSEC
            print(f"{item.label:60}{alone.mean():8.2f}{alone.std():8.2f}")


if __name__ == "__main__":
    main()
