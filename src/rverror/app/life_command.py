"""Commands that compare measurements of one unit: trend, compare-runs."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence

from rverror.app.terminal import MAPPING, ProgressLine, check_outputs, command, option, results, write_results
from rverror.base.errors import InputError, refusing
from rverror.base.text import check_name
from rverror.life.compared import compare_runs
from rverror.life.over_life import trend
from rverror.life.sessions import run_files
from rverror.model.model_file import load_model
from rverror.runs.bench.file import RUN_SUFFIXES
from rverror.runs.bench.mapping import given_mapping
from rverror.runs.measurement import read_run
from rverror.tolerances.specification import QUANTITIES, Limit, limit

_OUTPUTS = {**MAPPING, **results()}


@command(
    example='runs --model unit.toml --limit "lost motion 90 arcsec"',
    options={
        "runs": option(
            "FOLDER",
            "runs of one unit, with '# hours:', '# cycles:' or '# date:' in their headers, or folders of them",
            nargs="+",
        ),
        "--model": option("MODEL.toml", "model of the unit", reads=True, required=True),
        "--limit": option(
            '"lost motion 90 arcsec"',
            "limit of the lost motion, or of the error: 'transmission error 60 arcsec'",
        ),
        **_OUTPUTS,
    },
)
def _trend(options: argparse.Namespace) -> None:
    """What grows or jumps in a unit that is measured repeatedly.

    Finds which part errors of one unit grow or jump, from runs taken at different times, and how long the unit
    will meet a limit.
    """
    wanted = _limit(options.limit)
    paths = _listed(options, options.runs)
    model, mapping = load_model(options.model), given_mapping(options.mapping)
    runs = [read_run(path, model, mapping) for path in paths]
    with ProgressLine() as progress:
        found = trend(model, runs, limit=wanted, progress=progress)
    write_results(found, options)


@command(
    example="before.csv after.csv --model unit.toml",
    options={
        "before": option("BEFORE", "a run, or a folder of runs"),
        "after": option("AFTER", "a run, or a folder of runs"),
        "--model": option("MODEL.toml", "model of the unit: also look for the causes", reads=True),
        **_OUTPUTS,
    },
)
def _compare_runs(options: argparse.Namespace) -> None:
    """What changed between two measurements of one unit.

    Lists the orders that differ significantly between two measurements of one unit and, with a model, the part
    errors that changed.
    """
    sides = [_listed(options, [side]) for side in (options.before, options.after)]
    mapping = given_mapping(options.mapping)
    model = None if options.model is None else load_model(options.model)
    before, after = ([read_run(path, model, mapping) for path in side] for side in sides)
    with ProgressLine() as progress:
        found = compare_runs(before, after, model, progress=progress)
    write_results(found, options)


def _listed(options: argparse.Namespace, paths: Sequence[str]) -> list[str]:
    """Files of runs that were given or lie in folders, which are inputs then."""
    for path in paths:
        check_name(path)
    runs = run_files(paths, RUN_SUFFIXES if options.mapping else (".csv",))
    options.inputs += runs
    check_outputs(options.outputs, options.inputs)
    return runs


def _limit(text: str | None) -> Limit | None:
    """Limit of a text such as ``lost motion 90 arcsec``."""
    if text is None:
        return None
    match = re.match(r"\s*([A-Za-z_ -]+?)\s+([\d.+-].*)$", text)
    name = match[1].lower().replace(" ", "_").replace("-", "_") if match else ""
    if match is None or name not in QUANTITIES:
        raise InputError(f"--limit: {text!r}; write 'lost motion 90 arcsec' or 'transmission error 60 arcsec'")
    with refusing("--limit: "):
        return limit(name, match[2])
