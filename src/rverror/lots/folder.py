"""A folder of units: a subfolder with runs for each, and beside them a table of labels that may be left out."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from rverror.base.errors import InputError
from rverror.base.numbers import count_of
from rverror.base.spreadsheet import table_rows
from rverror.base.text import PathLike, check_name, check_path, did_you_mean, shown, some
from rverror.lots.amplitudes import LotUnit
from rverror.model.effects import Model, check_model
from rverror.runs.bench.file import RUN_SUFFIXES, folders_of_runs
from rverror.runs.bench.mapping import BenchMapping, given_mapping
from rverror.runs.measurement import read_run

#: Table of the units beside their folders, and its column of their names.
TABLE, SERIAL = "units.csv", "serial"

_EXAMPLE = "write a first line such as 'serial,date,machine'"


def lot_units(
    folder: PathLike, model: Model, mapping: PathLike | BenchMapping | None = None
) -> tuple[tuple[LotUnit, ...], tuple[str, ...]]:
    """Read the units of a lot from a folder.

    A unit is a subfolder with runs, ``FOLDER/<serial>/*.csv``; with a mapping, runs of any format that `load_run`
    reads, by the ending of their name.  Hidden files and folders are left out.  ``FOLDER/units.csv``, where it is
    there, has a first line of names, one of them ``serial``, and a row for each unit: its labels, and by the order of
    the rows the order in which they were made.

    Parameters
    ----------
    folder : str or path-like
    model : Model
        Whose units they are.
    mapping : str, path-like or BenchMapping, optional
        How the bench names its columns.

    Returns
    -------
    units : tuple of LotUnit
        In the order of the table, then in that of their names, in which digits count as numbers.
    notes : tuple of str
        Units that the table or the folder alone has.

    Raises
    ------
    InputError
        If the folder holds no runs, or a run or the table cannot be used; one line that names the file.

    Examples
    --------
    >>> import tempfile
    >>> from importlib import resources
    >>> import rverror
    >>> demo = resources.files("rverror") / "data" / "demo"
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     unit = Path(folder, "A-17")
    ...     unit.mkdir()
    ...     size = (unit / "up.csv").write_text((demo / "forward.csv").read_text())
    ...     units, notes = lot_units(folder, rverror.load_model(demo / "model.toml"))
    >>> units[0].serial, len(units[0].runs), notes
    ('A-17', 1, ())
    """
    check_model(model)
    mapping = given_mapping(mapping)
    found = list_units(folder, mapping)
    return tuple(unit.read(model, mapping) for unit in found.units), found.notes


@dataclass(frozen=True)
class UnitFiles:
    """A unit whose runs are not read yet.

    Attributes
    ----------
    serial : str
    runs : tuple of str
        Files.
    labels : mapping of str to str
    """

    serial: str
    runs: tuple[str, ...]
    labels: Mapping[str, str]

    def read(self, model: Model, mapping: BenchMapping | None = None) -> LotUnit:
        """Read the runs, which then are in memory."""
        return LotUnit(self.serial, tuple(read_run(path, model, mapping) for path in self.runs), self.labels)


@dataclass(frozen=True)
class LotPart:
    """A part of a lot: a folder of units whose runs are not read yet, or a file of units that are split into orders.

    Attributes
    ----------
    path : str
    files : tuple of str
        All that is read: the file; or the table of labels and the runs.
    serials : tuple of str
        In the order in which the units were made.
    notes : tuple of str
        What was noticed.
    units : tuple of UnitFiles
        Of a folder.
    """

    path: str
    files: tuple[str, ...]
    serials: tuple[str, ...]
    notes: tuple[str, ...]
    units: tuple[UnitFiles, ...] = ()


def list_units(folder: PathLike, mapping: BenchMapping | None = None) -> LotPart:
    """Units of a folder as `lot_units` has them, their runs not read.

    Raises
    ------
    InputError
        If the folder holds no runs, or the table cannot be used.
    """
    check_path(folder)
    root = Path(folder)
    found = _runs(root, (".csv",) if mapping is None else RUN_SUFFIXES)
    table = root / TABLE
    labels = _labels(table) if table.is_file() else {}
    order = [serial for serial in labels if serial in found]
    others = sorted(found.keys() - set(order), key=_natural)
    notes = (
        _note("left out", [serial for serial in labels if serial not in found], f"in {table} without a folder of runs"),
        _note("without labels", others if labels else (), f"not in {table}; they stand last"),
    )
    serials = (*order, *others)
    units = tuple(UnitFiles(serial, found[serial], labels.get(serial, {})) for serial in serials)
    files = (*([str(table)] if table.is_file() else []), *(path for unit in units for path in unit.runs))
    return LotPart(str(root), files, serials, tuple(filter(None, notes)), units)


def _runs(root: Path, suffixes: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Runs of each subfolder that has any."""
    found = {folder.name: runs for folder, runs in folders_of_runs(root, suffixes).items() if runs}
    if not found:
        raise InputError(
            f"{root}: no subfolder holds a run ({', '.join(suffixes)}); give a folder with one subfolder for each unit"
        )
    for name in (name for runs in found.values() for name in runs):
        check_name(name)
    return found


def _labels(path: Path) -> dict[str, Mapping[str, str]]:
    """Labels of each unit by its serial, in the order of the rows; cells without text are left out."""
    rows = table_rows(path)
    if not rows:
        raise InputError(f"{path}: the table is empty; {_EXAMPLE}")
    (line, heads), *units = rows
    names = [head.lower() for head in heads if head]
    if SERIAL not in names:
        raise InputError(f"{path}, line {line}: no column {SERIAL!r};{did_you_mean(SERIAL, names)} {_EXAMPLE}")
    if twice := [name for name, count in Counter(names).items() if count > 1]:
        raise InputError(f"{path}, line {line}: two columns {shown(twice[0])}; give each its own name")
    found: dict[str, Mapping[str, str]] = {}
    for number, cells in units:
        if len(cells) > len(heads):
            raise InputError(
                f"{path}, line {number}: {len(cells)} cells for {count_of(len(heads), 'column')}; correct the row"
            )
        labels = {head: cell for head, cell in zip(heads, cells, strict=False) if head and cell}
        serial = next((labels.pop(head) for head in heads if head.lower() == SERIAL and head in labels), "")
        if not serial or serial in found:
            why = f"serial {shown(serial)} stands above too" if serial else f"no {SERIAL}"
            raise InputError(f"{path}, line {number}: {why}; give the folder of each unit one row")
        found[serial] = labels
    return found


def _natural(name: str) -> tuple[list[tuple[int, str]], str]:
    """Key to sort names by, digits as numbers."""
    parts = re.split(r"([0-9]+)", name.lower())
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts], name


def _note(what: str, serials: Sequence[str], why: str) -> str:
    return f"{what}: {count_of(len(serials), 'unit')} {why} ({some(serials)})" if serials else ""
