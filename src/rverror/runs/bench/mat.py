"""MAT files as files of a bench: up to version 7 here, later ones are HDF5."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Sequence

import numpy as np
import scipy

from rverror.base.text import PathLike, read_bytes, shown
from rverror.runs.bench.columns import (
    BenchFile,
    Entry,
    RawArray,
    channel_axis,
    plain_number,
    refused_in_one_line,
    shape_problem,
)
from rverror.runs.bench.mat_file import MatVariable, mat_variables
from rverror.runs.reading import refuse

#: Largest file, which is held in memory.
MOST_BYTES = 2_000_000_000


def open_mat(path: PathLike) -> BenchFile:
    """List the variables of a file; those of a structure as ``structure/field``, channels of a matrix as ``matrix/2``.

    Raises
    ------
    InputError
        If the file is damaged.
    """
    name = str(path)
    raw = read_bytes(path)
    if len(raw) > MOST_BYTES:
        refuse(
            name, f"{len(raw) / 1e9:.1f} GB, at most {MOST_BYTES / 1e9:.0f} GB are read; cut the recording into runs"
        )
    with refused_in_one_line(name, "MAT"):
        # One at a time and without their numbers: only those that are asked for are held together.
        entries = tuple(entry for entry, _ in _walk(raw))
    names = [entry.name for entry in entries]
    if twice := [each for i, each in enumerate(names) if each in names[:i]]:
        refuse(name, f"the variable {shown(twice[0])} stands in it twice; store it again")

    def columns(places: Sequence[int]) -> list[RawArray]:
        wanted = {names[place] for place in places}
        with refused_in_one_line(name, "MAT"):
            arrays = {entry.name: array for entry, array in _walk(raw) if entry.name in wanted and array is not None}
        return [arrays[names[place]] for place in places]

    return BenchFile(path=name, kind="MAT", entries=entries, columns=columns, parse=plain_number)


def _walk(raw: bytes) -> Iterator[tuple[Entry, RawArray | None]]:
    if 0 in raw[:4]:  # version 4
        yield from _version_4(raw)
        return
    for variable in mat_variables(raw):
        if variable.name:  # MATLAB keeps what objects share in a variable without a name
            yield from _columns(variable, "")


def _columns(variable: MatVariable, prefix: str) -> Iterator[tuple[Entry, RawArray | None]]:
    name = f"{prefix}{variable.name}"
    if variable.fields:
        for field in variable.fields:
            yield from _columns(field, f"{name}/")
        return
    if not variable.problem and variable.array is not None:
        yield from _of_array(name, variable.array)
    else:
        yield Entry(name=name, size=math.prod(variable.shape), problem=variable.problem), variable.array


def _of_array(name: str, array: RawArray) -> Iterator[tuple[Entry, RawArray]]:
    """A vector, or each channel of a matrix."""
    if (axis := channel_axis(array.shape)) >= 0:
        size = array.shape[1 - axis]
        for number in range(array.shape[axis]):
            channel = array.take(number, axis)
            yield Entry(name=f"{name}/{number + 1}", size=size, problem=shape_problem((size,))), channel
        return
    yield Entry(name=name, size=array.size, problem=shape_problem(array.shape)), array


def _version_4(raw: bytes) -> Iterator[tuple[Entry, RawArray | None]]:

    for name, value in scipy.io.loadmat(io.BytesIO(raw)).items():
        if not name.startswith("__"):
            array = np.asarray(value)
            if array.dtype.kind in "fiu":
                yield from _of_array(name, array)
            else:
                problem = "holds text or no real numbers; take another column"
                yield Entry(name=name, size=int(array.size), problem=problem), None
