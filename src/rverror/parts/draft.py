"""A mapping of parts to fill in: what a measuring machine's file holds, and what its columns look like."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

from rverror.base.text import PathLike, shown
from rverror.base.toml import quoted
from rverror.parts.aqdef import SUFFIXES, open_aqdef
from rverror.parts.mapping import DATUMS, FEATURES
from rverror.parts.measured import KINDS
from rverror.parts.reading import SHEETS, check_no_xml, sheet_lines
from rverror.runs.bench.columns import Entry
from rverror.runs.bench.draft import described_lines, described_text
from rverror.runs.bench.mapping import meant_unit
from rverror.runs.bench.text import unit_in_name

#: What a column may be, by the words of its name in lower case, without its unit.
_WORDS = {
    "serial": r"serial.*|serien.*|sn|s/n|id|part.*|teil.*|werkst.*|k0014",
    "number": r"(pin|bore|bohrung|cam|nocken|tooth|zahn|stift|bolzen)s?( ?(no|nr|number|index)\.?)?|no\.?|nr\.?|index",
    "angle": r"angle|winkel|phi|theta|azimuth",
    "radius": r"r|rad|radius", "deviation": r"dev|deviation|abweichung", "x": r"x", "y": r"y",
    "diameter": r"d|dia|diameter|durchmesser",
    "pitch": r"f_?p|single pitch|pitch|teilung|teilungseinzelabweichung",
    "cumulative": r"f_?p_?k|cumulative( pitch)?|summenteilung|teilungssummenabweichung",
    "runout": r"f_?r|run-?out|rundlauf",
}  # fmt: skip


def draft_parts_mapping(path: PathLike) -> str:
    """Begin a mapping for a file of measured parts.

    Parameters
    ----------
    path : str or path-like

    Returns
    -------
    str
        TOML; what was guessed from the names of the columns is marked, what is to be filled in is empty.

    Raises
    ------
    InputError
        If the file cannot be read, or no rows of numbers are found in it.
    """
    name, suffix = str(path), Path(path).suffix.lower()
    check_no_xml(path)
    head: list[str] = []
    if suffix in SUFFIXES:
        entries: Sequence[Entry] = open_aqdef(path)[0].entries
    elif suffix in SHEETS:
        entries = described_lines(name, sheet_lines(path))[1]
    else:
        head, entries, _ = described_text(path)
    found: dict[str, Entry] = {}
    for entry in entries:
        word = re.sub(r"\s*[\[(][^\[\]()]*[\])]\s*$", "", entry.name).strip().lower()
        key = next((key for key, words in _WORDS.items() if key not in found and re.fullmatch(words, word)), "")
        found |= {key: entry} if key else {}
    fitting = [each for each, (_, needed, _, _) in FEATURES.items() if all(found.keys() & set(one) for one in needed)]
    fitting = [] if suffix in SUFFIXES else fitting  # whose rows are pieces
    kinds = FEATURES[fitting[0]][2] if fitting else tuple(KINDS)
    serial = f"serial = {quoted(found['serial'].name)}" if "serial" in found else '# serial = "..."'
    lines = [f"# Mapping for files of parts like {shown(name, 80)}; confirm what is guessed from its columns:"]
    lines += [f"#   {quoted(entry.name)}" + (f"  unit {entry.unit}" if entry.unit else "") for entry in entries]
    lines += ["", f'kind = "{kinds[0]}"  # one of {", ".join(kinds)}']
    lines += [f"{serial}  # column of serial numbers; without it the name of the file is one", *head, ""]
    lines += ['# uncertainty: 1 sigma of a reading, such as "0.5 um"; leave it out where nothing is known']
    return "\n".join([*lines, *(_feature(fitting[0], found) if fitting else _errors(entries, found))]) + "\n"


def _feature(name: str, found: Mapping[str, Entry]) -> list[str]:
    dimensions, _, _, more = FEATURES[name]
    columns = [f"{key} = {_column(found[key], dimensions[key])}" for key in dimensions if key in found]
    datum = [f'datum = ""  # one of {", ".join(DATUMS[name])}'] if name in DATUMS else []
    return [f"[{name}]", *columns, *datum, f"# more keys: {', '.join(more)}"]


def _errors(entries: Sequence[Entry], found: Mapping[str, Entry]) -> list[str]:
    """A table for each column that may be a component of an error."""
    sizes = [entry for entry in entries if entry is not found.get("serial") and not entry.name.startswith(("K0", "K1"))]
    remark = "# one table for each error; `rverror sources` lists the keys, with their indices and parameters"
    return [remark, *(f'[[error]]\nkey = ""\nradial = {_column(entry, "length")}\n' for entry in sizes)]


def _column(entry: Entry, dimension: str) -> str:
    unit = f", unit = {quoted(meant_unit(entry.unit or unit_in_name(entry.name)))}" if dimension else ""
    return f"{{ name = {quoted(entry.name)}{unit}" + (', uncertainty = "" }' if dimension == "length" else " }")
