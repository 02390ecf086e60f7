"""A mapping of parts to fill in: what a measuring machine's file holds, and what its columns look like."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from rverror.base.text import PathLike, read_bytes, shown, split_lines
from rverror.base.toml import quoted
from rverror.parts.aqdef import SUFFIXES, open_aqdef
from rverror.parts.machine_file import SHEETS, sheet_lines
from rverror.parts.mapping import FEATURES
from rverror.parts.measured import KINDS
from rverror.runs.bench.columns import Entry
from rverror.runs.bench.draft import described_lines, found_encoding
from rverror.runs.bench.mapping import meant_unit
from rverror.runs.bench.text import decoded, unit_in_name

#: What a column may be, by the words of its name in lower case, without its unit.
_WORDS = {
    "serial": r"serial.*|serien.*|sn|s/n|id|part.*|teil.*|werkst.*|k0014",
    "number": r"(pin|bore|bohrung|cam|nocken|tooth|zahn|stift|bolzen)s?( ?(no|nr|number|index)\.?)?|no\.?|nr\.?|index",
    "angle": r"angle|winkel|phi|theta|azimuth",
    "radius": r"r|rad|radius",
    "deviation": r"dev|deviation|abweichung|form",
    "x": r"x", "y": r"y",
    "diameter": r"d|dia|diameter|durchmesser",
    "pitch": r"f_?p|single pitch|pitch|teilung|teilungseinzelabweichung",
    "cumulative": r"f_?p_?k|cumulative( pitch)?|summenteilung|teilungssummenabweichung",
    "runout": r"f_?r|run-?out|rundlauf",
}  # fmt: skip
#: Columns by which a feature is told, the kind of part that has it most, and what is to be filled in beside them.
_FEATURES = {
    "circles": ({"number", "angle", "radius"}, "crank", ('datum = "axis"  # scanned about the journals',)),
    "lobes": (
        {"angle", "radius"},
        "disc",
        (
            'datum = "fit"  # the axis is fitted; "bores": scanned about the bores',
            "harmonics = 6",
            "lobe_harmonics = 3",
        ),
    ),
    "places": (
        {"number", "x", "y"},
        "housing",
        ('datum = "fit"  # moved and turned; "axis": turned alone; "given": these are the axes of the part',),
    ),
    "teeth": (
        {"number", "pitch"},
        "planet",
        ('zero = "0 deg"  # angle of the first tooth', "sense = 1  # -1: counted clockwise", "harmonics = 6"),
    ),
}


def draft_parts_mapping(path: PathLike) -> str:
    """Begin a mapping for a file of measured parts.

    Parameters
    ----------
    path : str or path-like

    Returns
    -------
    str
        TOML; what was guessed from the names of the columns is marked.

    Raises
    ------
    InputError
        If the file cannot be read, or no rows of numbers are found in it.
    """
    name, suffix = str(path), Path(path).suffix.lower()
    head: list[str] = []
    if suffix in SUFFIXES:
        entries: Sequence[Entry] = open_aqdef(path)[0].entries
    elif suffix in SHEETS:
        entries = described_lines(name, sheet_lines(path))[1]
    else:
        raw = read_bytes(path)
        encoding, remark = found_encoding(raw)
        head, entries, _ = described_lines(name, split_lines(decoded(name, raw, encoding)))
        head.insert(2, f"encoding = {quoted(encoding)}{remark}")
    found = _guessed(entries)
    lines = [f"# Mapping for files of parts like {shown(name, 80)}.", "# Columns of the file:"]
    lines += [f"#   {quoted(entry.name)}" + (f"  unit {entry.unit}" if entry.unit else "") for entry in entries]
    feature = next((each for each, (columns, _, _) in _FEATURES.items() if columns <= found.keys()), "")
    kind = _FEATURES[feature][1] if feature else "crank"
    lines += ["", f'kind = "{kind}"  # confirm it: one of {", ".join(KINDS)}']
    if "serial" in found:
        lines.append(f"serial = {quoted(found['serial'].name)}  # guessed from its name: confirm it")
    else:
        lines.append('# serial = "..."  # column of the serial numbers; without it the name of the file is one')
    head += ["", '# uncertainty: 1 sigma of a reading, such as "0.5 um"; leave it out where nothing is known']
    return "\n".join([*lines, *head, *(_feature(feature, found) if feature else _errors(entries, found))]) + "\n"


def _guessed(entries: Sequence[Entry]) -> Mapping[str, Entry]:
    """The first column that may be each of `_WORDS`."""
    found: dict[str, Entry] = {}
    for entry in entries:
        word = re.sub(r"\s*[\[(][^\[\]()]*[\])]\s*$", "", entry.name).strip().lower()
        match = next((key for key, pattern in _WORDS.items() if key not in found and re.fullmatch(pattern, word)), None)
        if match:
            found[match] = entry
    return found


def _feature(name: str, found: Mapping[str, Entry]) -> list[str]:
    """Table of a feature, guessed from the names of its columns."""
    lines = [f"[{name}]"]
    for column, dimension in FEATURES[name][0].items():
        if column in found:
            lines.append(f"{column} = {_column(found[column], dimension)}  # guessed from its name: confirm it")
    return [*lines, *_FEATURES[name][2]]


def _errors(entries: Sequence[Entry], found: Mapping[str, Entry]) -> list[str]:
    """A table for each column that may be a component of an error."""
    lines = ["# One table for each error, with the index that says where on the part it is; keys: rverror sources"]
    for entry in entries:
        if entry is not found.get("serial") and not entry.name.startswith("K0"):
            lines += [
                "[[error]]",
                'key = ""',
                f"radial = {_column(entry, 'length')}  # or another of its parameters",
                "",
            ]
    return lines


def _column(entry: Entry, dimension: str) -> str:
    unit = meant_unit(entry.unit or unit_in_name(entry.name)) if dimension else ""
    more = f", unit = {quoted(unit)}" if dimension else ""
    more += ', uncertainty = ""' if dimension == "length" else ""
    return f"{{ name = {quoted(entry.name)}{more} }}"
