"""Tables as rows, of CSV files and of spreadsheets."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from rverror.base.errors import InputError, needing
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
    openpyxl = openpyxl_for(path, "save the sheet as CSV")
    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        cells = [list(row) for row in book.worksheets[0].iter_rows(values_only=True)]
        book.close()
    except Exception as error:  # whatever a file that is no workbook makes zip and XML readers say
        raise InputError(f"{path}: no workbook that can be read ({error}); save it again as xlsx or CSV") from error
    return [
        (number, ["" if cell is None else str(cell).strip() for cell in row]) for number, row in enumerate(cells, 1)
    ]


def openpyxl_for(path: PathLike, otherwise: str) -> Any:
    """What reads and writes workbooks.

    Raises
    ------
    InputError
        If it is not installed.
    """
    with needing(f"{path}: spreadsheets need openpyxl", "io", f", or {otherwise}"):
        import openpyxl
    return openpyxl


def workbook(path: PathLike, sheets: Mapping[str, Iterable[Sequence[object]]]) -> bytes:
    """Workbook of sheets by their names, as the bytes of a file; a text is no formula, whatever it begins with.

    Parameters
    ----------
    path : str or path-like
        Where it is to be written, for messages.
    sheets : mapping of str to rows
        Cells are numbers, texts that can be printed, or None.
    """
    openpyxl = openpyxl_for(path, "write CSV or JSON")
    book, buffer = openpyxl.Workbook(write_only=True), io.BytesIO()
    for name, rows in sheets.items():
        sheet = book.create_sheet(name[:31])  # Excel takes no more letters
        for row in rows:
            cells = [openpyxl.cell.WriteOnlyCell(sheet, value) for value in row]
            for cell in cells:
                cell.data_type = "s" if cell.data_type == "f" else cell.data_type
            sheet.append(cells)
    book.save(buffer)
    return buffer.getvalue()


#: What reads a table, by the ending of its name.
TABLES = {".csv": _csv_rows, ".xlsx": sheet_rows}
