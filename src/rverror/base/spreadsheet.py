"""Tables as rows of texts, of CSV files and of spreadsheets."""

from __future__ import annotations

import csv
from pathlib import Path

from rverror.base.errors import InputError
from rverror.base.text import PathLike, read_text, split_lines


def table_rows(path: PathLike) -> list[tuple[int, list[str]]]:
    """Rows of a table that hold anything, each with its number, from 1; what begins with # is left out.

    Parameters
    ----------
    path : str or path-like
        CSV, its cells parted by commas or, as spreadsheets may write it, semicolons; or a workbook.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    rows = TABLES.get(Path(path).suffix.lower(), _csv_rows)(path)
    return [(number, row) for number, row in rows if any(row) and not row[0].startswith("#")]


def _csv_rows(path: PathLike) -> list[tuple[int, list[str]]]:
    lines = ["" if line.lstrip().startswith("#") else line for line in split_lines(read_text(path))]
    head = next(filter(str.strip, lines), "")
    rows = csv.reader(lines, delimiter=";" if head.count(";") > head.count(",") else ",", strict=True)
    try:
        return [(rows.line_num, [cell.strip() for cell in row]) for row in rows]
    except csv.Error as error:
        raise InputError(f"{path}, line {rows.line_num}: no row of a table ({error}); correct the quotes") from error


def sheet_rows(path: PathLike) -> list[tuple[int, list[str]]]:
    """Rows of the first sheet of a workbook, each with its number, from 1; an empty cell is an empty text.

    Parameters
    ----------
    path : str or path-like

    Raises
    ------
    InputError
        If openpyxl is not installed, or the file is no workbook.
    """
    try:
        import openpyxl  # extra 'io'
    except ImportError as error:
        raise InputError(
            f"{path}: spreadsheets need openpyxl; install it by pip install 'rverror[io]', or save the sheet as CSV"
        ) from error
    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        cells = [list(row) for row in book.worksheets[0].iter_rows(values_only=True)]
        book.close()
    except Exception as error:  # whatever a file that is no workbook makes zip and XML readers say
        raise InputError(f"{path}: no workbook that can be read ({error}); save it again as xlsx or CSV") from error
    return [
        (number, ["" if cell is None else str(cell).strip() for cell in row]) for number, row in enumerate(cells, 1)
    ]


#: What reads a table, by the ending of its name.
TABLES = {".csv": _csv_rows, ".xlsx": sheet_rows}
