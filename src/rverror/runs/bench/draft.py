"""A mapping to fill in: what a bench's file holds, which column may be which: the beginning of a mapping file."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from importlib import resources
from itertools import islice, zip_longest

from rverror.base.numbers import count_of
from rverror.base.text import PathLike, decoded, read_bytes, shown, split_lines
from rverror.base.toml import quoted
from rverror.runs.bench.columns import Entry
from rverror.runs.bench.file import is_bench_file, open_bench_file
from rverror.runs.bench.mapping import COUNTS, BenchMapping, meant_unit, unit_scale
from rverror.runs.bench.text import (
    SEPARATORS,
    Undecided,
    column_facts,
    described_columns,
    found_decimal,
    is_number,
    names_in,
    split_cells,
    trimmed,
    unit_in_name,
)
from rverror.runs.reading import DIMENSIONS, refuse

#: Words of a name that tell a column, German compounds such as Antriebswinkel among them.
_SIDES = {
    "input_angle": r"antrieb.*|eingang.*|input.*|motor.*|moteur.*|entr[ée]e.*|输入.*|电机.*|in|an|ein|drive|mot|1",
    "output_angle": r"abtrieb.*|ausgang.*|output.*|sortie.*|输出.*|out|ab|aus|load|joint|2",
    "time": r"zeit.*|uhr.*|time.*|temps.*|时间.*|t",
}
#: Words of a shaft that mean its angle where nothing else is said; a motor's column may be a current, a load a torque.
_PLAIN = re.compile(r"(an|ab)trieb.*|(ein|aus)gang.*|(in|out)(put.*)?|entr[ée]e.*|sortie.*|输入.*|输出.*")
_ANGLE = re.compile(r"(angle|theta|phi|alpha|pos|enc|[θφϕα]).*|.*(winkel|角).*")
#: Of columns that name a shaft, as angles do, but hold something else.
_OTHER = re.compile(
    r"torque|moment|couple|speed|drehzahl|geschw|beschl|vel|accel|freq|current|strom|volt|temp|power|force|kraft|last"
    r"|error|fehler|[扭转]矩|速|电流"
)
_WORD = re.compile(r"[^\W\d_]+|\d+")
_HUMP = re.compile(r"(?<=[a-zäöüß])(?=[A-ZÄÖÜ])")
_BRACKETS = re.compile(r"[\[(][^\[\]()]*[\])]")
_USUAL = {"angle": ("deg", "rad", "turn", "arcmin", "arcsec"), "time": ("s", "ms")}


def guesses(entries: Sequence[Entry]) -> dict[str, list[Entry]]:
    """Columns that may be input angle, output angle and time, by their names and units.

    Parameters
    ----------
    entries : sequence of Entry
        As the file lists them.

    Returns
    -------
    dict of str to list of Entry
        For ``input_angle``, ``output_angle`` and ``time``, where there are any: one is a guess, several are a question.

    Examples
    --------
    >>> found = guesses([Entry(name="Antrieb [°]", unit="°"), Entry(name="phi_out_rad")])
    >>> found["input_angle"][0].name, found["output_angle"][0].name
    ('Antrieb [°]', 'phi_out_rad')
    """
    found: dict[str, list[Entry]] = {key: [] for key in _SIDES}
    for entry in entries:
        sides = [key for key, pattern in _SIDES.items() if _says(re.compile(pattern), entry)]
        if len(sides) == 1 and not entry.problem and _may_be(DIMENSIONS[sides[0]], entry):
            found[sides[0]].append(entry)
    for key in ("input_angle", "output_angle"):  # where some names say that they are angles, a shaft's name says less
        said = [entry for entry in found[key] if unit_of(entry, "angle") or _says(_ANGLE, entry)]
        found[key] = said or [entry for entry in found[key] if _says(_PLAIN, entry)]
    return {key: fitting for key, fitting in found.items() if fitting}


def _says(pattern: re.Pattern[str], entry: Entry) -> bool:
    return any(map(pattern.fullmatch, _words(entry.name)))


def _words(name: str) -> list[str]:
    """Words of a name in lower case, groups before it included, its unit in brackets left out."""
    return [word.lower() for word in _WORD.findall(_HUMP.sub(" ", _BRACKETS.sub(" ", name)))]


def _may_be(dimension: str, entry: Entry) -> bool:
    return bool(unit_of(entry, dimension)) or not (entry.unit or _OTHER.search(entry.name.lower()))


def unit_of(entry: Entry, dimension: str) -> str:
    """Unit of a column in the mapping's words, from its brackets, its attribute or the last word of its name.

    Examples
    --------
    >>> unit_of(Entry(name="Winkel", unit="°"), "angle"), unit_of(Entry(name="theta1_deg"), "angle")
    ('deg', 'deg')
    """
    word = entry.unit or " ".join(_words(entry.name)[1:][-1:])
    if dimension == "angle" and word in COUNTS:
        return COUNTS[0]
    try:
        scale = unit_scale(meant_unit(word), dimension)
    except ValueError:
        return ""
    return next((known for known in _USUAL[dimension] if unit_scale(known, dimension) == scale), meant_unit(word))


#: Rows of numbers by which the beginning of a table is told.
_ROWS = 3
_LOOKED_AT = 1000
_LONGEST_UNIT = 6
_KEYS_OF_NAMES = ("name", "names", "channel", "kanal")
_MOST_VALUES = 20


def draft_mapping(path: PathLike) -> str:
    """Begin a mapping for a file: how it is written, its columns as remarks, and the keys to fill in.

    Columns named after a shaft, such as ``Antrieb [°]``, ``phi_out`` or ``theta1``, are filled in with a remark, where
    one alone fits; it is for the reader to confirm them.

    Parameters
    ----------
    path : str or path-like

    Returns
    -------
    str
        TOML that `load_mapping` refuses until all names are filled in.

    Raises
    ------
    InputError
        If the file cannot be read, or no rows of numbers are found in it.
    """
    return drafted(path)[0]


def drafted(path: PathLike) -> tuple[str, list[str]]:
    """`draft_mapping`, and what was guessed or left open in it, in words."""
    if is_bench_file(path):
        file = open_bench_file(path, BenchMapping())
        head: list[str] = []
        entries: Sequence[Entry] = file.entries
        values = [f"{key} = {value}" for key, value in file.properties.items()]
    else:
        head, entries, values = described_text(path)
    lines = [f"# Mapping for files like {shown(str(path), 80)}.", *head, "", "# Columns of the file:"]
    lines += [f"#   {_described(entry)}" for entry in entries]
    if values:
        lines += ["# Values beside them:", *(f"#   {shown(value, 100)}" for value in values[:_MOST_VALUES])]
    found = guesses(entries)
    to_fill_in = "\n" + (resources.files("rverror") / "data" / "bench-mapping.toml").read_text(encoding="utf-8")
    for key, fitting in found.items():
        line = re.search(rf"^(?:# )?{key} = .*$", to_fill_in, re.MULTILINE)
        assert line is not None  # there is one for every key
        to_fill_in = to_fill_in.replace(line[0], _proposed(key, fitting, line[0]), 1)
    return "\n".join(lines) + "\n" + to_fill_in, [f"{key}: {_guess(key, fitting)}" for key, fitting in found.items()]


def _guess(key: str, fitting: Sequence[Entry]) -> str:
    """In words, for whoever has to confirm it."""
    names = " and ".join(shown(entry.name, 60) for entry in fitting[:4])
    if len(fitting) > 1:
        return f"not guessed, for {names} fit alike"
    unit = unit_of(fitting[0], DIMENSIONS[key])
    return f"guessed from the name {names}, {f'unit {unit}' if unit else 'it states no unit'}"


def _proposed(key: str, fitting: Sequence[Entry], line: str) -> str:
    """Line of a column as guessed, or as it stands where several columns fit."""
    if len(fitting) > 1:
        return f"# {_guess(key, fitting)}:\n{line}"
    word = unit_of(fitting[0], DIMENSIONS[key])
    unit = f"unit = {quoted(word)}" + (", counts_per_turn = 0" if word == COUNTS[0] else "")
    no_unit = "; write its unit" + (", if it is no time of day" if key == "time" else "")
    missing = {"": no_unit, COUNTS[0]: "; write counts_per_turn, 4 * lines of its disc"}.get(word, "")
    return f"{key} = {{ name = {quoted(fitting[0].name)}, {unit} }}  # guessed from its name: confirm it{missing}"


def _described(entry: Entry) -> str:
    facts = [count_of(entry.size, "sample")] if entry.size >= 0 and not entry.problem else []
    facts += [f"unit {entry.unit}"] if entry.unit else []
    facts += [f"every {entry.increment:g} s"] if entry.increment else []
    facts += [entry.problem] if entry.problem else []
    return " ".join(f"{quoted(entry.name)}  {', '.join(facts)}".split("\n")).rstrip()


def described_text(path: PathLike) -> tuple[list[str], list[Entry], list[str]]:
    """`described_lines` of a text file, with its encoding.

    Raises
    ------
    InputError
        If it cannot be read, or no rows of numbers are found.
    """
    raw = read_bytes(path)
    encoding, remark = found_encoding(raw)
    head, entries, above = described_lines(str(path), split_lines(decoded(str(path), raw, encoding)))
    return [*head[:2], f"encoding = {quoted(encoding)}{remark}", *head[2:]], entries, above


def described_lines(path: str, lines: Sequence[str]) -> tuple[list[str], list[Entry], list[str]]:
    """How a table in lines is written, for ``[file]`` of a mapping; its columns; and the lines above it.

    Parameters
    ----------
    path : str
        For messages.
    lines : sequence of str

    Raises
    ------
    InputError
        If no rows of numbers are found.
    """
    separator, first = _table(path, lines)
    top = _described_from(lines, separator, first)
    names = _names_line(lines, separator, first) if top < 0 else top
    rows = [split_cells(line, separator) for line in islice(filter(str.strip, lines[first:]), _LOOKED_AT)]
    sign = found_decimal((cell for row in rows for cell in row), point_is_decimal=separator == ",")
    head = ["", "[file]", f"separator = {quoted(separator)}"]
    if isinstance(sign, Undecided):
        head.append(f'decimal = ""  # {shown(sign.cell)} {sign.why}: write "." or ","')
    else:
        head.append(f"decimal = {quoted(sign or '.')}")
    if names < 0:
        head += [f"skip = {first}", "# No names stand above the numbers: write column = 1, 2, ... instead of name."]
        cells = [f"column {i + 1}" for i in range(len(rows[0]))]
    else:
        cells = names_in(lines[names], separator)
    above = [line.strip() for line in lines[: names if names >= 0 else first] if line.strip()]
    if top >= 0:
        return head, column_facts(cells, [split_cells(line, separator) for line in lines[names + 1 : first]]), above
    below = split_cells(lines[first - 1], separator) if 0 <= names < first - 1 else []  # units in a line of their own
    units = [unit_in_name(cell) or word.strip("[]() ") for cell, word in zip_longest(cells, below, fillvalue="")]
    return head, [Entry(name=cell, unit=unit) for cell, unit in zip(cells, units, strict=False)], above


def found_encoding(raw: bytes) -> tuple[str, str]:
    """Encoding of a text, and a remark where it is a guess.

    Examples
    --------
    >>> found_encoding("30 °".encode())
    ('utf-8', '')
    """
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16", ""
    try:
        raw.decode("utf-8")
    except UnicodeDecodeError:
        return "cp1252", "  # a guess, for it is no UTF-8: see whether the names below are written right"
    return "utf-8", ""


def _table(path: str, lines: Sequence[str]) -> tuple[str, int]:
    """Separator and first row of the widest table of numbers, else of numbers beside words."""
    found = _tables(lines, _is_numbers) or _tables(lines, _has_numbers)
    if not found:
        refuse(path, "no rows of two numbers or more are found in it; give the file that the bench records")
    _, separator, first = max(found, key=lambda each: each[0])  # the first of equals
    return separator, first


def _tables(lines: Sequence[str], fits: Callable[[Sequence[str]], bool]) -> list[tuple[int, str, int]]:
    """Width, separator and first row of the first table of each separator."""
    found = []
    for separator in SEPARATORS:
        for i in range(min(len(lines), _LOOKED_AT)):
            rows = [split_cells(line, separator) for line in islice(filter(str.strip, lines[i:]), _ROWS)]
            widths = {len(trimmed(row)) for row in rows}
            if lines[i].strip() and len(widths) == 1 and max(widths) > 1 and all(map(fits, rows)):
                found.append((max(widths), separator, i))
                break
    return found


def _is_numbers(row: Sequence[str]) -> bool:
    return all(not cell or is_number(cell) for cell in row)


def _has_numbers(row: Sequence[str]) -> bool:
    """Tell a row of a report: numbers, and words such as those for the direction."""
    return sum(map(is_number, row)) > 1


def _described_from(lines: Sequence[str], separator: str, first: int) -> int:
    """Line of the names where lines with keys in front, its own such as Name, tell of the columns; else -1."""
    end = max((i + 1 for i in range(first) if lines[i].strip()), default=0)
    top = max((i + 1 for i in range(end) if not lines[i].strip()), default=0)
    block = [split_cells(line, separator) for line in lines[top:end]]
    if not block or block[0][0].lower() not in _KEYS_OF_NAMES:
        return -1
    return top if described_columns([*block[1:], split_cells(lines[first], separator)]) == len(block) - 1 > 0 else -1


def _names_line(lines: Sequence[str], separator: str, first: int) -> int:
    """Line above the first row that names its cells, or the one above that where it holds units; -1 for none."""
    width = len(trimmed(split_cells(lines[first], separator)))
    nearer, farther = (names_in(lines[first - n], separator) if n <= first else [] for n in (1, 2))
    # a line of units may have none for the last column
    units, letters = ([len(cell.strip("[]()")) for cell in cells] for cells in (nearer, farther))
    has_units = max(units, default=0) <= _LONGEST_UNIT
    if has_units and len(farther) == width and (len(nearer) != width or sum(letters) > sum(units)):
        return first - 2
    return first - 1 if len(nearer) == width else -1
