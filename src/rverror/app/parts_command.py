"""Command for measured parts: parts."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from rverror.app.terminal import check_output, say_replaced, tell, write_output
from rverror.base.errors import InputError
from rverror.base.numbers import with_unit
from rverror.base.text import check_name
from rverror.geartrain.source import rv
from rverror.model.model_file import append_effects, load_model
from rverror.parts.draft import draft_parts_mapping
from rverror.parts.parts_table import save_parts
from rverror.parts.reading import load_parts
from rverror.parts.unit import mounted_parts, unit_error, unit_of_parts


def add_commands(commands: Any) -> None:
    """Add the command to a parser's subparsers.

    Parameters
    ----------
    commands : argparse._SubParsersAction
    """
    command = commands.add_parser(
        "parts", help="errors of measured parts, from files of measuring machines (CSV, xlsx, Q-DAS)"
    )
    command.add_argument("files", nargs="+", metavar="FILE", help="of a measuring machine, or tables of parts")
    command.add_argument("--model", required=True, metavar="MODEL.toml", help="of the unit that the parts are made for")
    command.add_argument("--mapping", metavar="MAPPING.toml", help="which column is which error, with units")
    command.add_argument(
        "--draft", action="store_true", help="write the beginning of a mapping for the first file instead"
    )
    command.add_argument(
        "--place", nargs="+", default=[], metavar="disc=D17,D18", help="serial numbers, in the order of their places"
    )
    command.add_argument(
        "-o", "--output", metavar="OUT", help="PARTS.csv: a table of parts; UNIT.toml: the model of their unit"
    )
    command.set_defaults(run=_parts)


def _parts(options: argparse.Namespace) -> None:
    inputs = [*options.files, options.model, *([options.mapping] if options.mapping else [])]
    for path in inputs:
        check_name(path)
    check_output(options.output, inputs)
    if options.draft:
        _draft(options)
        return
    suffix = Path(options.output or "").suffix.lower()
    if suffix not in (".csv", ".toml"):
        raise InputError(f"-o {options.output or ''}: must end in .csv (a table of parts) or .toml (a unit); give it")
    if options.place and suffix != ".toml":
        raise InputError("--place is for the model of a unit; give -o UNIT.toml, or leave --place out")
    model = load_model(options.model)
    read = load_parts(options.files, model.mechanism, mapping=options.mapping)
    for note in read.notes:
        tell(note)
    if suffix == ".csv":
        say_replaced(options.output)
        save_parts(options.output, read.parts, overwrite=True)
        tell(f"wrote {options.output}: {len(read.parts)} parts")
        return
    places = _places(options.place)
    unit = unit_of_parts(model, read.parts, places)
    mounted = mounted_parts(read.parts, rv(model.mechanism), places)
    for kind, serials in mounted.items():
        tell(f"{kind}: {', '.join(serials)}" + ("" if kind in places else ", in the order of the files"))
    say_replaced(options.output)
    append_effects(options.model, options.output, unit.effects[len(model.effects) :], overwrite=True)
    for word, direction in (("forward", 1.0), ("reverse", -1.0)):
        error = unit_error(unit, direction=direction)
        size, low, high = (with_unit(value, "angle") for value in (error.peak_to_peak, *error.interval))
        print(f"transmission error {word}: {size} peak-to-peak, 95 % interval {low} to {high} (closed form)")
    tell(f"wrote {options.output}")


def _draft(options: argparse.Namespace) -> None:
    if options.mapping or options.place:
        raise InputError("--draft begins a mapping; leave out --draft, or --mapping and --place")
    text = draft_parts_mapping(options.files[0])
    if options.output is None:
        sys.stdout.write(text)
        return
    write_output(options.output, text)
    tell(f"wrote {options.output}")


def _places(texts: list[str]) -> dict[str, tuple[str, ...]]:
    """Serial numbers by kind, of texts such as ``disc=D17,D18``."""
    found: dict[str, tuple[str, ...]] = {}
    for text in texts:
        kind, sign, serials = text.partition("=")
        if not sign or kind in found or not all(serials.split(",")):
            raise InputError(f"--place {text!r}: write each kind once, like disc=D17,D18")
        found[kind] = tuple(serials.split(","))
    return found
