"""Command that says which measured parts to join: match."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence

from rverror.app.terminal import (
    ProgressLine,
    command,
    flag,
    number,
    option,
    results,
    save,
    tell,
    write_output,
    write_results,
)
from rverror.app.tolerance_commands import limit_options, limits_of
from rverror.base.errors import InputError, refusing
from rverror.matching.matched import WAYS, match
from rverror.model.model_file import load_model
from rverror.parts.reading import load_parts
from rverror.views.report import to_csv


@command(
    example='parts.csv --model unit.toml --limit "30 arcsec" --save assembly.csv',
    options={
        "parts": option("PARTS", "tables of parts, or files of measuring machines", reads=True, nargs="+"),
        "--model": option(
            "MODEL.toml", "model of the unit, without the errors of these parts", reads=True, required=True
        ),
        "--mapping": option(
            "MAPPING.toml", "mapping file: which column is which error, as for `rverror parts`", reads=True
        ),
        **limit_options(),
        "--turns": flag("discs may be mounted rotated by one or more crank pitches, and a sun at any tooth"),
        "--cost": option(
            "matching=2.5",
            f"a way to assemble ({', '.join(WAYS)}: docs/theory/matching.md) and its cost per unit; repeat it for more",
            action="append",
            default=[],
        ),
        "--seed": number("seed of the random assemblies (default 0)", default=0),
        **results(),
        **save("ASSEMBLY.csv", "write the list for the assembly shop, a row for each unit"),
    },
)
def _match(options: argparse.Namespace) -> None:
    """Which measured parts to combine so that the most units meet limits.

    Chooses which measured parts in stock to combine, and in which position, so that as many units as possible
    meet limits under load. Compares the yield with that of random assembly. Files of parts: see
    docs/measured-parts.md.
    """
    if all(value is None for value in (options.limit, options.lost_motion, options.backlash)):
        raise InputError("no limit; give --limit '60 arcsec', --lost-motion or --backlash")
    costs = _costs(options.cost)
    model = load_model(options.model)
    with refusing(""):
        limits = [one for one in limits_of(options, model) if one.value is not None]
        read = load_parts(options.parts, model.mechanism, mapping=options.mapping)
    tell(*read.notes)
    with ProgressLine() as progress:
        found = match(model, read.parts, limits, turns=options.turns, costs=costs, seed=options.seed, progress=progress)
    write_results(found, options)
    if options.save:
        write_output(options.save, to_csv(found, units=True))


def _costs(texts: Sequence[str]) -> dict[str, float]:
    """Costs of texts such as ``matching=2.5``."""
    found: dict[str, float] = {}
    for text in texts:
        way, _, number = text.partition("=")
        try:
            cost = float(number)
        except ValueError:
            cost = math.nan
        if way not in WAYS or way in found or not 0 <= cost < math.inf:
            raise InputError(f"--cost: {text!r}; write each way once, like matching=2.5; ways: {', '.join(WAYS)}")
        found[way] = cost
    return found
