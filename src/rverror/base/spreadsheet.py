"""Spreadsheets as rows of texts."""

from __future__ import annotations

from rverror.base.errors import InputError
from rverror.base.text import PathLike


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
