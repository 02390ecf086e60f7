"""Commands that compare measurements of one unit: trend, compare-runs."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from contextlib import closing
from typing import Any

from rverror.app import read_command
from rverror.app.terminal import Progress, add_command, add_results, check_outputs, write_json, write_output
from rverror.base.errors import InputError
from rverror.base.text import check_name
from rverror.life.compared import compare_runs
from rverror.life.over_life import trend
from rverror.life.sessions import run_files
from rverror.model.model_file import load_model
from rverror.runs.bench.file import RUN_SUFFIXES
from rverror.runs.measurement import read_run
from rverror.tolerances.specification import QUANTITIES, Limit, limit
from rverror.views.envelope import input_files
from rverror.views.report import to_html, to_json, to_text


def add_commands(commands: Any) -> None:
    """Add the commands to a parser's subparsers.

    Parameters
    ----------
    commands : argparse._SubParsersAction
    """
    command = add_command(
        commands,
        "trend",
        brief="what grows or jumps in a unit that is measured repeatedly",
        does="Finds which part errors grow and which jumped in one unit, from runs taken at different times, and how "
        "long a limit will still be met.",
        example='runs --model unit.toml --limit "lost motion 90 arcsec"',
    )
    command.add_argument(
        "runs",
        nargs="+",
        metavar="FOLDER",
        help="runs of one unit, or folders of them, each with '# hours:', '# cycles:' or '# date:' in its header",
    )
    command.add_argument("--model", required=True, metavar="MODEL.toml", help="model of the unit")
    command.add_argument(
        "--limit",
        metavar='"lost motion 90 arcsec"',
        help="limit, also 'transmission error 60 arcsec': how long it will still be met",
    )
    _add_outputs(command)
    command.set_defaults(run=_trend)
    command = add_command(
        commands,
        "compare-runs",
        brief="what changed between two measurements of one unit",
        does="Lists the orders that differ by more than noise between two measurements of one unit and, with a model, "
        "the part errors that changed.",
        example="before.csv after.csv --model unit.toml",
    )
    command.add_argument("before", metavar="BEFORE", help="a run, or a folder of runs")
    command.add_argument("after", metavar="AFTER", help="a run, or a folder of runs")
    command.add_argument("--model", metavar="MODEL.toml", help="model of the unit: also look for the causes")
    _add_outputs(command)
    command.set_defaults(run=_compare)


def _add_outputs(command: argparse.ArgumentParser) -> None:
    read_command.add_mapping(command)
    add_results(command)
    command.add_argument(
        "--progress", action="store_true", help="show progress also where standard error is no terminal"
    )


def _trend(options: argparse.Namespace) -> None:
    wanted = _limit(options.limit)
    given, paths = _files(options, options.runs)
    model, mapping = load_model(options.model), read_command.given_mapping(options.mapping)
    runs = [read_run(path, model, mapping) for path in paths]
    with closing(Progress(terminal_only=not options.progress)) as progress:
        found = trend(model, runs, limit=wanted, progress=progress)
    _write(found, options, given)


def _compare(options: argparse.Namespace) -> None:
    given, _ = _files(options, [options.before, options.after])
    mapping = read_command.given_mapping(options.mapping)
    model = None if options.model is None else load_model(options.model)
    before, after = (
        [read_run(path, model, mapping) for path in run_files([side], _suffixes(options))]
        for side in (options.before, options.after)
    )
    with closing(Progress(terminal_only=not options.progress)) as progress:
        found = compare_runs(before, after, model, progress=progress)
    _write(found, options, given)


def _suffixes(options: argparse.Namespace) -> tuple[str, ...]:
    return RUN_SUFFIXES if options.mapping else (".csv",)


def _files(options: argparse.Namespace, paths: Sequence[str]) -> tuple[list[str], list[str]]:
    """All files that are read, and those of them that are runs; refuses outputs among them."""
    for path in paths:
        check_name(path)
    runs = run_files(paths, _suffixes(options))
    given = [*(path for path in (options.model, options.mapping) if path is not None), *runs]
    for path in given:
        check_name(path)
    check_outputs([options.json, options.html], given)
    return given, runs


def _limit(text: str | None) -> Limit | None:
    """Limit of a text such as ``lost motion 90 arcsec``."""
    if text is None:
        return None
    match = re.match(r"\s*([A-Za-z_ -]+?)\s+([\d.+-].*)$", text)
    name = match[1].lower().replace(" ", "_").replace("-", "_") if match else ""
    if match is None or name not in QUANTITIES:
        raise InputError(f"--limit: {text!r}; write 'lost motion 90 arcsec' or 'transmission error 60 arcsec'")
    try:
        return limit(name, match[2])
    except InputError:
        raise
    except ValueError as problem:
        raise InputError(f"--limit: {problem}") from problem


def _write(found: Any, options: argparse.Namespace, given: Sequence[str]) -> None:
    files = input_files(given)
    print(to_text(found), end="")
    if options.json:
        write_json(options.json, to_json(found, files=files))
    if options.html:
        write_output(options.html, to_html(found, files=files))
