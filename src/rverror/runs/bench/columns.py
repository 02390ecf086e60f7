"""What every reader of a bench's files hands over: its columns, what the file says of them, and their numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from rverror.base.arrays import Array
from rverror.base.errors import InputError
from rverror.base.text import shown, some
from rverror.runs.reading import OfFile, Stated, refuse

#: Most samples of a column: a size that a file claims is refused before memory is asked for.
MOST_SAMPLES = 20_000_000
#: Most columns of a file.
MOST_COLUMNS = 10_000
_MOST_LISTED = 8
_EXACT = 2**53  # whole numbers beyond it have no float64 of their own

#: Why values of a kind of numpy's are no column, with the remedy; empty where they are.
_KINDS = {
    **dict.fromkeys("fiuMm", ""),
    "c": "holds complex numbers; store real and imaginary part apart",
    "b": "holds true and false; take a column of numbers",
    **dict.fromkeys("SUT", "holds text; take a column of numbers"),
}

RawArray = np.ndarray[Any, np.dtype[Any]]


@dataclass(frozen=True, kw_only=True, eq=False)
class Entry:
    """A column as its file lists it; two may be alike.

    Attributes
    ----------
    name : str
        With the groups before it, as in ``group/channel``.
    unit : str
        As the file says it; empty where it does not.
    size : int
        Number of samples; -1 where it shows only on reading.
    problem : str
        Why it can be no column, with the remedy; empty where it can.
    increment : float
        Time between samples as the file says it, s; 0 where it does not.
    """

    name: str
    unit: str = ""
    size: int = -1
    problem: str = ""
    increment: float = 0.0


@dataclass(frozen=True, kw_only=True)
class BenchFile(OfFile):
    """What a bench's file holds, and how its columns are read.

    Attributes
    ----------
    kind : str
        ``text``, ``MAT``, ``HDF5`` or ``TDMS``.
    properties : mapping of str to str
        Attributes, properties, or lines of the preamble.
    header : mapping of str to Stated
        What it says of itself as a run file does.
    notes : tuple of str
        What was assumed.
    place : str
        Where the names stand, for messages; empty where that says nothing.
    noun : str
        What `labels` count: ``line`` or ``sample``.
    labels : ndarray of int, optional
        Line of each row; None where samples are counted from 0.
    decimal : str
        Decimal sign of its numbers.
    columns : callable
        From the places of some entries to their arrays, as stored.
    cells : callable, optional
        From the place of an entry to its cells as written; None where the format holds numbers alone.
    """

    path: str
    kind: str
    entries: tuple[Entry, ...]
    columns: Callable[[Sequence[int]], list[RawArray]]
    properties: Mapping[str, str] = field(default_factory=dict)
    header: Mapping[str, Stated] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    place: str = ""
    noun: str = "sample"
    labels: RawArray | None = None
    decimal: str = "."
    cells: Callable[[int], list[str]] | None = None

    def read(self, chosen: Iterable[Entry]) -> list[RawArray]:
        """Arrays of some of the entries, as stored."""
        return self.columns([self.entries.index(entry) for entry in chosen])

    def words(self, chosen: Entry) -> list[str]:
        """Cells of an entry as text."""
        if self.cells is not None:
            return self.cells(self.entries.index(chosen))
        (array,) = self.read([chosen])
        return [f"{value:.15g}" for value in as_samples(self.path, shown(chosen.name, 60), array).tolist()]


def some_names(names: Iterable[str]) -> str:
    """The first of some names, for messages."""
    return some((shown(name, 60) for name in names), _MOST_LISTED) or "none"


@contextmanager
def refused_in_one_line(path: str, kind: str) -> Iterator[None]:
    """Turn whatever a format's library raises at a damaged file into one line."""
    try:
        yield
    except InputError:
        raise
    except Exception as error:  # a damaged file makes the libraries raise anything, from KeyError to OSError
        reason = " ".join(f"{type(error).__name__}: {error}".split())[:120].rstrip(": ")
        raise InputError(
            f"{path}: cannot be read as {kind}, it is damaged or cut off ({reason}); copy or export it again"
        ) from error


def shape_problem(shape: tuple[int, ...]) -> str:
    """Why an array of that shape is no column, with the remedy; empty where it is one.

    Examples
    --------
    >>> shape_problem((100, 1)), shape_problem((1, 100))
    ('', '')
    >>> shape_problem((100, 100))
    'is a matrix of 100 x 100; store a channel in each column, or as a vector of its own'
    """
    size = int(np.prod(shape, dtype=object)) if shape else 1
    if size > MOST_SAMPLES:
        return f"claims {size:,} samples, at most {MOST_SAMPLES:,} are read; cut the recording into runs"
    if size == 0:
        return "is empty; record it, or take another"
    if max(shape, default=1) != size:
        return (
            f"is a matrix of {' x '.join(map(str, shape))}; store a channel in each column, or as a vector of its own"
        )
    return ""


def channel_axis(shape: tuple[int, ...]) -> int:
    """Axis along which the channels of a matrix are counted, which is its shorter side; -1 of anything else.

    Examples
    --------
    >>> channel_axis((1000, 4)), channel_axis((4, 1000)), channel_axis((1000, 1)), channel_axis((9, 9))
    (1, 0, -1, -1)
    """
    if len(shape) != 2 or not 1 < min(shape) <= MOST_COLUMNS or shape[0] == shape[1]:
        return -1
    return int(shape[1] < shape[0])


def kind_problem(dtype: np.dtype[Any]) -> str:
    """Why values of that kind are no column, with the remedy; empty where they are.

    Examples
    --------
    >>> kind_problem(np.dtype(np.complex128))
    'holds complex numbers; store real and imaginary part apart'
    """
    return _KINDS.get(dtype.kind, "holds objects, cells or structures; store it as a plain vector of numbers")


def as_samples(path: str, what: str, array: RawArray, *, time: bool = False) -> Array:
    """One column as float64.

    Parameters
    ----------
    what : str
        Name of the column, for messages.
    array : ndarray
        As stored.
    time : bool
        Whether it is the time: time stamps are counted from the first one, s.

    Returns
    -------
    ndarray, shape (n,)

    Raises
    ------
    InputError
        If it is no column of numbers.
    """
    problem = kind_problem(array.dtype) or shape_problem(array.shape)
    if problem:
        refuse(path, f"{what} {problem}")
    flat = array.reshape(-1)
    if flat.dtype.kind in "Mm":
        if not time:
            refuse(path, f"{what} holds time stamps; only time can be read from them")
        since = flat - flat[0] if flat.dtype.kind == "M" else flat
        seconds = since / np.timedelta64(1, "s")
        return np.asarray(np.where(np.isnat(since), np.nan, seconds), dtype=np.float64)
    if flat.dtype.kind in "iu" and flat.dtype.itemsize == 8:
        largest = max(abs(int(flat.min())), abs(int(flat.max())))
        if largest > _EXACT:
            if not time:
                refuse(path, f"{what} holds {largest}, at most 2**53 is exact; store the difference to its first value")
            flat = flat - flat[0]
    with np.errstate(invalid="ignore"):  # of odd NaN in damaged files
        return flat.astype(np.float64)
