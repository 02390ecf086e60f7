"""Files of measuring machines: columns that a mapping names, in core units, and the serial number of each row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from rverror.base import units
from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.spreadsheet import sheet_rows
from rverror.base.text import PathLike, read_bytes, shown
from rverror.parts.aqdef import SUFFIXES, open_aqdef
from rverror.parts.mapping import PartsMapping
from rverror.runs.bench.columns import BenchFile, as_samples
from rverror.runs.bench.file import found_entry, left_out_columns
from rverror.runs.bench.mapping import BenchMapping, TextRules, Where
from rverror.runs.bench.text import open_lines, open_text
from rverror.runs.bench.values import core_scale

SHEETS = (".xlsx", ".xlsm")


@dataclass(frozen=True)
class PartRows:
    """Rows of a file.

    Attributes
    ----------
    file : BenchFile
    serials : sequence of str
        Of each row.
    sizes : tuple of mapping of str to ndarray, shape (n,)
        Columns of each error, or of the feature, core units; NaN where a cell holds no number.
    """

    file: BenchFile
    serials: Sequence[str]
    sizes: tuple[Mapping[str, Array], ...]

    def label(self, row: int) -> int:
        """Line of a row."""
        return row if self.file.labels is None else int(self.file.labels[row])

    def place(self, row: int) -> str:
        """File and line of a row, for messages."""
        return f"{self.file.path}, {self.file.noun} {self.label(row)}"


def head_of(path: PathLike) -> str:
    """Beginning of a file as text, whatever it is.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    try:
        with open(path, "rb") as file:
            raw = file.read(1000)
    except (OSError, ValueError):
        raw = read_bytes(path)  # says why not
    return raw.decode("utf-8", errors="replace").removeprefix("\ufeff")


def sheet_lines(path: PathLike) -> list[str]:
    """Lines of a spreadsheet, with tabs between its cells.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    return ["\t".join(" ".join(cell.split()).replace('"', "''") for cell in row) for _, row in sheet_rows(path)]


def read_rows(path: PathLike, rules: PartsMapping, notes: list[str]) -> PartRows:
    """Read the columns that a mapping names.

    Parameters
    ----------
    path : str or path-like
        Text, xlsx, or Q-DAS.
    rules : PartsMapping
    notes : list of str
        Gets what was assumed and what is not used.

    Raises
    ------
    InputError
        If the file cannot be read, has no such column, or says another unit than the mapping.
    """
    file, nominal = _opened(path, rules.text, _wanted(rules))
    notes += file.notes
    bench = BenchMapping(path=rules.path, text=rules.text)
    where = rules.serial or (Where(name="K0014") if Path(path).suffix.lower() in SUFFIXES else None)
    columns = [(name, column) for group in rules.groups() for name, (column, _) in group.items()]
    entries = [found_entry(file, bench, column.rule.where) for _, column in columns]
    arrays = iter(zip(entries, file.read(entries), strict=True))
    sizes: list[dict[str, Array]] = []
    for group in rules.groups():
        sizes.append({})
        for key, (column, dimension) in group.items():
            entry, array = next(arrays)
            samples = as_samples(file.path, f"{key} ({shown(entry.name, 60)})", array)
            if dimension:
                unit = units.DISPLAY_UNITS[dimension]
                factor, zero = core_scale(file, key, column.rule, entry, dimension, unit, notes)
                expected = column.nominal
                if expected is None:
                    expected = _nominal(file.path, entry.name, nominal) * abs(factor)
                samples = column.scale * (samples * factor + zero - column.rule.sign * expected)
            sizes[-1][key] = samples
    serials: Sequence[str] = [Path(path).stem] * sizes[0][next(iter(sizes[0]))].size
    if where is not None:
        entries.append(found_entry(file, bench, where))
        assert file.words is not None  # of a text
        serials = file.words(entries[-1])
    notes += left_out_columns(file, entries)
    return PartRows(file, serials, tuple(sizes))


def _opened(path: PathLike, text: TextRules, wanted: Sequence[str | int]) -> tuple[BenchFile, Mapping[str, str]]:
    """Columns of a file, and the nominal values that it states of them."""
    suffix = Path(path).suffix.lower()
    if suffix in SUFFIXES:
        return open_aqdef(path)
    if suffix in SHEETS:
        return open_lines(str(path), sheet_lines(path), replace(text, separator="\t"), wanted), {}
    if head_of(path).lstrip().startswith("<"):
        raise InputError(f"{path}: this is XML, as GDE of VDI/VDE 2610 is, which is not read; export CSV, xlsx or .dfq")
    return open_text(path, text, wanted), {}


def _wanted(rules: PartsMapping) -> list[str | int]:
    """Names or numbers of all columns that are read."""
    places = [column.rule.where for group in rules.groups() for column, _ in group.values()]
    return [where.column or where.name for where in (*places, *([rules.serial] if rules.serial else []))]


def _nominal(path: str, name: str, nominal: Mapping[str, str]) -> float:
    try:
        return float(nominal[name].replace(",", "."))
    except (KeyError, ValueError) as error:
        raise InputError(
            f"{path}: it states no nominal value (K2101) of {shown(name)}; write it in the mapping, like '6 mm'"
        ) from error
