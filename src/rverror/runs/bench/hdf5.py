"""HDF5 files, among them MAT files from version 7.3 on.  h5py comes with the extra ``io``."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from rverror.base.errors import InputError
from rverror.base.text import PathLike
from rverror.runs.bench.columns import (
    MOST_COLUMNS,
    BenchFile,
    Entry,
    RawArray,
    channel_axis,
    kind_problem,
    refused_in_one_line,
    shape_problem,
)
from rverror.runs.reading import refuse

_UNIT_ATTRIBUTES = ("unit", "units", "unit_string")
#: Bytes with which a file begins.
SIGNATURE = b"\x89HDF\r\n\x1a\n"
_MATLAB_NUMBERS = ("", "double", "single", *(f"{kind}{bits}" for kind in ("int", "uint") for bits in (8, 16, 32, 64)))


def open_hdf5(path: PathLike, kind: str = "HDF5") -> BenchFile:
    """List the data sets of a file; links, external and virtual data are never followed.

    Parameters
    ----------
    kind : str
        ``HDF5`` or ``MAT``, for messages.

    Raises
    ------
    InputError
        If h5py is not installed, or the file is damaged.
    """
    name = str(path)
    h5py = _h5py(name)
    with refused_in_one_line(name, kind), h5py.File(name, "r", locking="best-effort") as file:
        entries = tuple(_entries(name, h5py, file))
        properties = _properties(file)

    def columns(places: Sequence[int]) -> list[RawArray]:
        with refused_in_one_line(name, kind), h5py.File(name, "r", locking="best-effort") as file:
            return [_array(h5py, file, entries[place].name) for place in places]

    return BenchFile(path=name, kind=kind, entries=entries, columns=columns, properties=properties)


def _h5py(path: str) -> Any:
    try:
        import h5py
    except ImportError as error:
        raise InputError(f"{path}: HDF5 files need h5py; install it with: pip install 'rverror[io]'") from error
    return h5py


def _entries(path: str, h5py: Any, file: Any) -> list[Entry]:
    """Data sets of all groups; h5py visits each once, and follows no link to another place."""
    found: list[Entry] = []

    def add(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset) and not name.startswith("#"):  # where MATLAB keeps what cells refer to
            found.extend(_of_dataset(name, item))
            if len(found) > MOST_COLUMNS:
                refuse(path, f"more than {MOST_COLUMNS:,} data sets; export fewer")

    file.visititems(add)
    return found


def _of_dataset(name: str, data: Any) -> Iterator[Entry]:
    if data.dtype.names and set(data.dtype.names) != {"real", "imag"}:
        for column in data.dtype.names:  # a table: one entry for each of its columns
            yield Entry(name=f"{name}/{column}", size=int(data.size), problem=_problem(data, data.dtype[column]))
        return
    shape = tuple(data.shape or ())
    if (axis := channel_axis(shape)) >= 0:  # a matrix: one entry for each of its channels
        size = shape[1 - axis]
        problem = _problem(data, data.dtype, (size,))
        for number in range(shape[axis]):
            yield Entry(name=f"{name}/{number + 1}", unit=_unit(data), size=size, problem=problem)
        return
    yield Entry(
        name=name,
        unit=_unit(data),
        size=-1 if data.size is None else int(data.size),
        problem=_problem(data, data.dtype),
    )


def _problem(data: Any, dtype: np.dtype[Any], shape: tuple[int, ...] | None = None) -> str:
    matlab = _text(data.attrs.get("MATLAB_class", ""))
    if matlab not in _MATLAB_NUMBERS:
        return f"is a MATLAB {matlab}; store it as a plain vector of numbers"
    if data.shape is None or "MATLAB_empty" in data.attrs:
        return "is empty; record it, or take another"
    if data.external or data.is_virtual:
        return "keeps its numbers in another file; copy them into this one"
    if dtype.names:
        return "holds complex numbers; store real and imaginary part apart"
    return kind_problem(dtype) or shape_problem(data.shape if shape is None else shape)


def _array(h5py: Any, file: Any, name: str) -> RawArray:
    if name in file and isinstance(file[name], h5py.Dataset):
        return np.asarray(file[name][()])
    table, _, column = name.rpartition("/")
    data = file[table]
    if data.dtype.names:
        return np.asarray(data.fields(column)[()])
    at = int(column) - 1
    return np.asarray(data[:, at] if channel_axis(data.shape) else data[at, :])


def _unit(data: Any) -> str:
    attributes = {str(key).lower(): value for key, value in data.attrs.items()}
    return next((_text(attributes[key]) for key in _UNIT_ATTRIBUTES if key in attributes), "")


def _properties(file: Any) -> dict[str, str]:
    """Attributes of the file, and those of its groups with the group's name before them."""
    found = {str(key): _text(value) for key, value in file.attrs.items()}

    def add(name: str, item: Any) -> None:
        if hasattr(item, "keys"):
            found.update({f"{name}/{key}": _text(value) for key, value in item.attrs.items()})

    file.visititems(add)
    return found


def _text(value: Any) -> str:
    """Attribute as a text; empty where it is a list."""
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.reshape(-1)[0]
    if isinstance(value, np.ndarray):
        return ""
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="replace").strip()
    return str(value).strip()
