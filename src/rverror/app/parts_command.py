"""Command for measured parts: parts."""

from __future__ import annotations

import argparse
from pathlib import Path

from rverror.app.terminal import command, flag, number, option, output, say_replaced, tell, write_text_output
from rverror.base.directions import DIRECTIONS
from rverror.base.errors import InputError
from rverror.base.numbers import count_of, with_unit
from rverror.model.effects import Model
from rverror.model.model_file import load_model, save_model
from rverror.parts.draft import draft_parts_mapping
from rverror.parts.parts_table import save_parts
from rverror.parts.reading import load_parts
from rverror.parts.unit import mounted_parts, places_in_list, unit_error, unit_of_parts


@command(
    example="discs.csv cranks.csv --model unit.toml --mapping parts.toml -o unit-17.toml",
    options={
        "files": option("FILE", "CSV, xlsx or Q-DAS files, or tables of parts", reads=True, nargs="+"),
        "--model": option("MODEL.toml", "model of the unit that the parts are made for", reads=True, required=True),
        "--mapping": option("MAPPING.toml", "mapping file: which column is which error, with units", reads=True),
        "--draft": flag("write a draft of the mapping for the first file instead"),
        "--place": option("disc=D17,D18", "which serial number goes where", nargs="+", default=[]),
        "--units": option(
            "ASSEMBLY.csv", "list of units that `rverror match --save` wrote, in place of --place", reads=True
        ),
        "--unit": number("number of the unit in that list"),
        **output("OUT", "PARTS.csv (table of parts) or UNIT.toml (model of a unit built from them)"),
    },
)
def _parts(options: argparse.Namespace) -> None:
    """Errors of measured parts, from files of measuring machines.

    Reads the files of measuring machines and writes the errors of the parts, as a table of parts or as the model of
    a unit built from them. A mapping (docs/measured-parts.md) says which column is which error; --draft begins one.
    """
    target, suffix = options.output or "", Path(options.output or "").suffix.lower()
    if options.draft:
        return write_text_output(options.output, draft_parts_mapping(options.files[0]))
    if suffix not in (".csv", ".toml") or (options.place and suffix == ".csv"):
        raise InputError(
            f"-o {target}: give PARTS.csv, a table of parts, or UNIT.toml, a unit with its parts by --place"
        )
    if (options.units is None) != (options.unit is None) or (options.units and (options.place or suffix == ".csv")):
        raise InputError("--units ASSEMBLY.csv and --unit N go together, with -o UNIT.toml and without --place")
    given: tuple[dict[str, tuple[str, ...]], dict[str, tuple[int, ...]]] = (_places(options.place), {})
    places, turns = places_in_list(options.units, options.unit) if options.units else given
    model = load_model(options.model)
    read = load_parts(options.files, model.mechanism, mapping=options.mapping)
    tell(*read.notes)
    if suffix == ".csv":
        say_replaced(target)
        save_parts(target, read.parts, overwrite=True)
    else:
        for kind, serials in mounted_parts(read.parts, model.mechanism, places).items():
            tell(f"{kind}: {', '.join(serials)}" + ("" if kind in places else ", in the order of the files"))
        unit = unit_of_parts(model, read.parts, places, turns=turns)
        say_replaced(target)
        save_model(target, unit, overwrite=True)
        _tell_error(unit)
    tell(f"wrote {target}, {count_of(len(read.parts), 'part')} read")


def _tell_error(unit: Model) -> None:
    for word, direction in DIRECTIONS.items():
        error = unit_error(unit, direction=direction)
        size, low, high = (with_unit(value, "angle") for value in (error.peak_to_peak, *error.interval))
        print(f"transmission error {word}: {size} peak-to-peak, 95 % interval {low} to {high} (closed form)")


def _places(texts: list[str]) -> dict[str, tuple[str, ...]]:
    """Serial numbers by kind, of texts such as ``disc=D17,D18``."""
    pairs = [text.partition("=") for text in texts]
    if len({kind for kind, _, _ in pairs}) < len(pairs) or not all(all(serials.split(",")) for _, _, serials in pairs):
        raise InputError(f"--place {' '.join(texts)}: write each kind once, like disc=D17,D18 crank=C3,C4")
    return {kind: tuple(serials.split(",")) for kind, _, serials in pairs}
