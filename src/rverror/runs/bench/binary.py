"""Binary files of benches: MAT by scipy, HDF5 by h5py, TDMS by npTDMS; these two come with the extra ``io``.

MAT files from version 7.3 on are HDF5.  Of earlier ones scipy trusts the lengths that they state, so that a single
wrong byte may end the process (scipy 1.17: 33 of 3,456 files with one); it reads them in a process of its own.
"""

from __future__ import annotations

import logging
import math
import pickle
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

from rverror.base.errors import needing
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
    with needing(f"{name}: HDF5 files need h5py", "io"):
        import h5py
    found: list[tuple[Entry, str, Any]] = []
    properties: dict[str, str] = {}

    def add(at: str, item: Any) -> None:
        if isinstance(item, h5py.Group):
            properties.update({f"{at}/{key}".lstrip("/"): _text(value) for key, value in item.attrs.items()})
        elif isinstance(item, h5py.Dataset) and not at.startswith("#"):  # where MATLAB keeps what cells refer to
            found.extend((entry, at, place) for entry, place in _of_dataset(at, item))
            if len(found) > MOST_COLUMNS:
                refuse(name, f"more than {MOST_COLUMNS:,} data sets; export fewer")

    with refused_in_one_line(name, kind), h5py.File(name, "r", locking="best-effort") as file:
        add("", file)
        file.visititems(add)  # each once; it follows no link to another place

    def columns(places: Sequence[int]) -> list[RawArray]:
        with refused_in_one_line(name, kind), h5py.File(name, "r", locking="best-effort") as file:
            return [np.asarray(file[at][place]) for _, at, place in map(found.__getitem__, places)]

    return BenchFile(
        path=name, kind=kind, entries=tuple(entry for entry, _, _ in found), columns=columns, properties=properties
    )


def _vectors(name: str, shape: tuple[int, ...]) -> list[tuple[str, Any, tuple[int, ...]]]:
    """Name, place and shape of each channel of a matrix; of what is none those of the whole."""
    axis = channel_axis(shape)
    if axis < 0:
        return [(name, (), shape)]
    places = ((slice(None), number) if axis else number for number in range(shape[axis]))
    return [(f"{name}/{number}", place, (shape[1 - axis],)) for number, place in enumerate(places, 1)]


def _of_dataset(name: str, data: Any) -> Iterator[tuple[Entry, Any]]:
    """Columns of a data set, each with its place in it."""
    if data.dtype.names and set(data.dtype.names) != {"real", "imag"}:
        for column in data.dtype.names:  # a table: one entry for each of its columns
            problem = _problem(data, data.dtype[column], data.shape)
            yield Entry(name=f"{name}/{column}", size=int(data.size), problem=problem), column
        return
    for channel, place, shape in _vectors(name, tuple(data.shape or ())):
        problem = _problem(data, data.dtype, shape)
        yield Entry(name=channel, unit=_unit(data), size=math.prod(shape), problem=problem), place


def _problem(data: Any, dtype: np.dtype[Any], shape: tuple[int, ...]) -> str:
    matlab = _text(data.attrs.get("MATLAB_class", ""))
    if matlab not in _MATLAB_NUMBERS:
        return f"is a MATLAB {matlab}; store it as a plain vector of numbers"
    if data.shape is None or "MATLAB_empty" in data.attrs:
        return "is empty; record it, or take another"
    if data.external or data.is_virtual:
        return "keeps its numbers in another file; copy them into this one"
    if dtype.names:
        return "holds complex numbers; store real and imaginary part apart"
    return kind_problem(dtype) or shape_problem(shape)


def _unit(data: Any) -> str:
    attributes = {str(key).lower(): value for key, value in data.attrs.items()}
    return next((_text(attributes[key]) for key in _UNIT_ATTRIBUTES if key in attributes), "")


def _text(value: Any) -> str:
    """Attribute as a text; empty where it is a list."""
    if isinstance(value, np.ndarray) and value.size == 1:
        value = value.reshape(-1)[0]
    if isinstance(value, np.ndarray):
        return ""
    return (value.decode("utf-8", errors="replace") if isinstance(value, bytes) else str(value)).strip()


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
    if problem := kind_problem(value.dtype):
        yield Entry(name=name, problem=problem), value
        return
    for channel, place, shape in _vectors(name, value.shape):
        yield Entry(name=channel, size=math.prod(shape), problem=shape_problem(shape)), value[place]


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
    with needing(f"{path}: TDMS files need npTDMS", "io"):
        from nptdms import TdmsFile
        from nptdms.log import log_manager as log
    level = log.log_level
    log.set_level(logging.CRITICAL + 1)  # what npTDMS would print of a file that is cut off, a note says
    try:
        with refused_in_one_line(path, "TDMS"), open(path, "rb") as raw:
            yield TdmsFile.open(raw)
    finally:
        log.set_level(level)


def _entry(channel: Any) -> Entry:
    properties = channel.properties
    unit = next((str(properties[key]).strip() for key in _UNIT_PROPERTIES if key in properties), "")
    dtype = np.dtype(channel.dtype)
    increment = properties.get("wf_increment", 0.0)
    return Entry(
        name=f"{channel.group_name}/{channel.name}",
        unit=unit or ("s" if dtype.kind == "M" else ""),  # of time stamps
        size=len(channel),
        problem=shape_problem((len(channel),)) or kind_problem(dtype),
        increment=float(increment) if isinstance(increment, int | float) and increment > 0 else 0.0,
    )
