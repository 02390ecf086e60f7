"""MAT files as files of a bench: up to version 7 by scipy, later ones are HDF5.

scipy trusts the lengths that such a file states, so that a single wrong byte may end the process (scipy 1.17: 33 of
3,456 files with one).  It therefore reads in a process of its own.
"""

from __future__ import annotations

import pickle
import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

from rverror.base.text import PathLike
from rverror.runs.bench.columns import (
    BenchFile,
    Entry,
    RawArray,
    channel_axis,
    kind_problem,
    refused_in_one_line,
    shape_problem,
)

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
