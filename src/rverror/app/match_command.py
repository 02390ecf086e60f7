"""Command that says which measured parts to join: match."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from contextlib import closing
from typing import Any

from rverror.app.terminal import Progress, add_command, add_results, check_outputs, tell, write_json, write_output
from rverror.app.tolerance_commands import add_limits, limits_of
from rverror.base.errors import InputError
from rverror.base.text import check_name
from rverror.matching.matched import WAYS, match
from rverror.model.model_file import load_model
from rverror.parts.reading import load_parts
from rverror.views.envelope import input_files
from rverror.views.report import to_csv, to_html, to_json, to_text


def add_commands(commands: Any) -> None:
    """Add the command to a parser's subparsers.

    Parameters
    ----------
    commands : argparse._SubParsersAction
    """
    command = add_command(
        commands,
        "match",
        brief="which measured parts to assemble so that most units meet their limits",
        does="Chooses from stocks of measured parts which to assemble and in which position, so that as many units "
        "as possible meet their limits, and compares that with parts taken at random.",
        example='parts.csv --model unit.toml --limit "30 arcsec" --save units.csv',
    )
    command.add_argument("parts", nargs="+", metavar="PARTS", help="tables of parts, or files of measuring machines")
    command.add_argument(
        "--model", required=True, metavar="MODEL.toml", help="model of the unit, without the errors of these parts"
    )
    command.add_argument(
        "--mapping", metavar="MAPPING.toml", help="mapping file: which column is which error, as for `rverror parts`"
    )
    add_limits(command)
    command.add_argument("--turns", action="store_true", help="discs may be turned by pitches of their bores")
    command.add_argument(
        "--cost",
        action="append",
        default=[],
        metavar="matching=2.5",
        help=f"cost of a way of building, for each unit; give it again for others ({', '.join(WAYS)})",
    )
    command.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the random assemblies (default 0)")
    command.add_argument(
        "--progress", action="store_true", help="show progress also where standard error is no terminal"
    )
    add_results(command)
    command.add_argument(
        "--save", metavar="UNITS.csv", help="write the list for the assembly shop, a row for each unit"
    )
    command.set_defaults(run=_match)


def _match(options: argparse.Namespace) -> None:
    given = [path for path in (*options.parts, options.model, options.mapping) if path is not None]
    for path in given:
        check_name(path)
    check_outputs([options.json, options.html, options.save], given)
    if all(value is None for value in (options.limit, options.lost_motion, options.backlash)):
        raise InputError("no limit; give --limit '60 arcsec', --lost-motion or --backlash")
    costs = _costs(options.cost)
    model = load_model(options.model)
    try:
        limits = [one for one in limits_of(options, model) if one.value is not None]
        read = load_parts(options.parts, model.mechanism, mapping=options.mapping)
    except InputError:
        raise
    except ValueError as problem:
        raise InputError(str(problem)) from problem
    for note in read.notes:
        tell(note)
    with closing(Progress(terminal_only=not options.progress)) as progress:
        found = match(model, read.parts, limits, turns=options.turns, costs=costs, seed=options.seed, progress=progress)
    files = input_files(given)
    print(to_text(found), end="")
    if options.json:
        write_json(options.json, to_json(found, files=files))
    if options.html:
        write_output(options.html, to_html(found, files=files))
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
