"""Binary files of benches: MAT by scipy, HDF5 by h5py, TDMS by npTDMS; these two come with the extra ``io``.

MAT files from version 7.3 on are HDF5.  Of earlier ones scipy trusts the lengths that they state, so that a single
wrong byte may end the process (scipy 1.17: 33 of 3,456 files with one); it reads them in a process of its own.
"""

from __future__ import annotations

import logging
import pickle
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
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
HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
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


_READER = """
import pickle, sys, warnings
import scipy.io
warnings.simplefilter("error", scipy.io.matlab.MatReadWarning)  # a variable that stands there twice
try:
    content = scipy.io.loadmat(sys.argv[1], appendmat=False)
except Exception as error:
    sys.exit(str(error))
pickle.dump(content, sys.stdout.buffer)
"""
_LONGEST = 120.0  # s: a damaged file may never end


def open_mat(path: PathLike) -> BenchFile:
    """List the variables of a file; those of a structure as ``structure/field``, channels of a matrix as ``matrix/2``.

    Single values are properties too.

    Raises
    ------
    InputError
        If the file is damaged.
    """
    name = str(path)
    with refused_in_one_line(name, "MAT"):
        content = _read(name)
    found = [each for key, value in content.items() if not key.startswith("__") for each in _columns(key, value)]
    return BenchFile(
        path=name,
        kind="MAT",
        properties={entry.name: str(array.item()) for entry, array in found if array.size == 1},
        entries=tuple(entry for entry, _ in found),
        columns=lambda places: [found[place][1] for place in places],
    )


def _read(path: str) -> dict[str, Any]:
    """Variables by name, and what scipy says of the file in names with underscores."""
    command = [sys.executable, "-P", "-c", _READER, path]
    done = subprocess.run(command, capture_output=True, timeout=_LONGEST, check=False)
    if done.returncode:
        raise OSError(done.stderr.decode(errors="replace") or "its lengths contradict one another")
    content: dict[str, Any] = pickle.loads(done.stdout)
    return content


def _columns(name: str, value: Any) -> Iterator[tuple[Entry, RawArray]]:
    """A vector, each channel of a matrix, or what the fields of a structure hold."""
    if not isinstance(value, np.ndarray):
        yield Entry(name=name, problem="is a sparse matrix; store full(...) of it"), np.empty(0)
        return
    if value.dtype.names and value.size == 1:
        for field in value.dtype.names:
            yield from _columns(f"{name}/{field}", value[field].flat[0])
        return
    problem = kind_problem(value.dtype)
    if problem or (axis := channel_axis(value.shape)) < 0:
        yield Entry(name=name, size=value.size, problem=problem or shape_problem(value.shape)), value
        return
    for number, channel in enumerate(np.moveaxis(value, axis, 0), 1):
        yield Entry(name=f"{name}/{number}", size=channel.size, problem=shape_problem(channel.shape)), channel


#: Bytes with which a file begins.
TDMS_SIGNATURE = b"TDSm"
_UNIT_PROPERTIES = ("unit_string", "unit", "units", "NI_UnitDescription")


def open_tdms(path: PathLike) -> BenchFile:
    """List the channels of a file.

    Parameters
    ----------
    path : str or path-like
        An index file beside it is not used, for it may be of another recording.

    Raises
    ------
    InputError
        If npTDMS is not installed, or the file is damaged.
    """
    name = str(path)
    with _opened(name) as file:
        channels = _channels(file)
        if len(channels) > MOST_COLUMNS:
            refuse(name, f"{len(channels):,} channels, at most {MOST_COLUMNS:,} are read; export fewer")
        entries = tuple(_entry(channel) for channel in channels)
        properties = {str(key): str(value) for key, value in file.properties.items()}
        for group in file.groups():
            properties |= {f"{group.name}/{key}": str(value) for key, value in group.properties.items()}
        cut_off = bool(file.file_status.incomplete_final_segment)

    def columns(places: Sequence[int]) -> list[RawArray]:
        with _opened(name) as file:
            again = _channels(file)
            return [np.asarray(again[place][:]) for place in places]

    return BenchFile(
        path=name,
        kind="TDMS",
        entries=entries,
        columns=columns,
        properties=properties,
        notes=("the file ends before its last part is complete; what was written is read",) if cut_off else (),
    )


def _channels(file: Any) -> list[Any]:
    return [channel for group in file.groups() for channel in group.channels()]


@contextmanager
def _opened(path: str) -> Iterator[Any]:
    try:
        from nptdms import TdmsFile
        from nptdms.log import log_manager
    except ImportError as error:
        raise InputError(f"{path}: TDMS files need npTDMS; install it with: pip install 'rverror[io]'") from error
    level = log_manager.log_level
    log_manager.set_level(logging.CRITICAL + 1)  # what npTDMS would print of a file that is cut off, a note says
    try:
        with refused_in_one_line(path, "TDMS"), open(path, "rb") as raw:
            yield TdmsFile.open(raw)
    finally:
        log_manager.set_level(level)


def _entry(channel: Any) -> Entry:
    properties = channel.properties
    unit = next((str(properties[key]).strip() for key in _UNIT_PROPERTIES if key in properties), "")
    dtype = np.dtype(channel.dtype)
    stamps = dtype.kind == "M"
    increment = properties.get("wf_increment", 0.0)
    return Entry(
        name=f"{channel.group_name}/{channel.name}",
        unit="s" if stamps and not unit else unit,
        size=len(channel),
        problem=shape_problem((len(channel),)) or kind_problem(dtype),
        increment=float(increment) if isinstance(increment, int | float) and increment > 0 else 0.0,
    )
