"""Independent work in copies of this process: what is at hand need not be sent, only what comes of it."""

from __future__ import annotations

import io
import os
import pickle
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

T = TypeVar("T")
R = TypeVar("R")

_NUMBER = 4  # bytes of an item's number: what is read at once is one number, whoever reads
_MOST_ITEMS = 1000  # their numbers lie ready in one pipe, which holds 4096 bytes at the least
_THREADS = Path("/proc/self/task")


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def each(function: Callable[[T], R], items: Sequence[T], *, jobs: int, shared: Sequence[object] = ()) -> list[R]:
    """Results of a function for every item, in their order.

    Copies of the process take one item after another, and so does it itself; what a copy did not send, for whatever
    reason, is done here, so that an error is raised as if there were one process.  A process is copied only where that
    is safe, on Linux while it has one thread; elsewhere all is done here.

    Parameters
    ----------
    function : callable
        Changes nothing but what it keeps for itself: a copy's changes are lost.
    items : sequence
    jobs : int
        Processes, this one among them.
    shared : sequence
        What results hold of what is at hand, and hold as the same object in the end.

    Returns
    -------
    list
    """
    if min(jobs, len(items)) < 2 or len(items) > _MOST_ITEMS or not _may_be_copied():
        return [function(item) for item in items]
    found: dict[int, R] = {}
    with _numbers(len(items)) as waiting, _copies(min(jobs, len(items)) - 1, function, items, waiting, shared) as sent:
        for number in _taken(waiting):
            found[number] = function(items[number])
        for answers in sent:
            found |= _received(answers, shared)
    return [found[number] if number in found else function(item) for number, item in enumerate(items)]


def _may_be_copied() -> bool:
    """Whether nothing but this thread can be in the middle of something."""
    return sys.platform == "linux" and len(list(_THREADS.iterdir())) == 1


@contextmanager
def _numbers(count: int) -> Iterator[int]:
    """The end of a pipe from which every process takes the number of the item that it does next."""
    waiting, filled = os.pipe()
    try:
        with os.fdopen(filled, "wb") as file:
            file.write(b"".join(number.to_bytes(_NUMBER, "big") for number in range(count)))
        yield waiting
    finally:
        os.close(waiting)


def _taken(waiting: int) -> Iterator[int]:
    while number := os.read(waiting, _NUMBER):
        yield int.from_bytes(number, "big")


@contextmanager
def _copies(
    count: int, function: Callable[[T], R], items: Sequence[T], waiting: int, shared: Sequence[object]
) -> Iterator[list[BinaryIO]]:
    """Copies at work, by what each sends in the end; none is left behind."""
    copies: list[int] = []
    sent: list[BinaryIO] = []
    try:
        for _ in range(count):
            here, there = os.pipe()
            sent.append(os.fdopen(here, "rb"))
            try:
                copy = os.fork()
            except OSError:  # no process or memory to be had: the others do it all
                os.close(there)
                break
            if not copy:
                _work(there, function, items, waiting, shared)
            os.close(there)
            copies.append(copy)
        yield sent
    finally:
        for file in sent:
            file.close()
        for copy in copies:
            with suppress(ProcessLookupError):
                os.kill(copy, signal.SIGKILL)
            os.waitpid(copy, 0)


def _work(there: int, function: Callable[[T], R], items: Sequence[T], waiting: int, shared: Sequence[object]) -> None:
    """What a copy does, and nothing of what it is a copy of: it does not come back."""
    try:
        with os.fdopen(there, "wb") as file:
            answers = {number: function(items[number]) for number in _taken(waiting)}
            file.write(_sent(answers, shared))
    finally:
        os._exit(0)


class _Sender(pickle.Pickler):
    """Writes a shared object as its place, which is the same in every copy."""

    def __init__(self, file: BinaryIO, shared: Sequence[object]) -> None:
        super().__init__(file, protocol=pickle.HIGHEST_PROTOCOL)
        self._places = {id(one): place for place, one in enumerate(shared)}

    def persistent_id(self, obj: Any) -> int | None:
        return self._places.get(id(obj))


class _Receiver(pickle.Unpickler):
    def __init__(self, file: BinaryIO, shared: Sequence[object]) -> None:
        super().__init__(file)
        self._shared = shared

    def persistent_load(self, pid: Any) -> object:
        return self._shared[pid]


def _sent(answers: dict[int, R], shared: Sequence[object]) -> bytes:
    file = io.BytesIO()
    _Sender(file, shared).dump(answers)
    return file.getvalue()


def _received(answers: BinaryIO, shared: Sequence[object]) -> dict[int, Any]:
    """What a copy sent; nothing where it ended before."""
    with suppress(EOFError, pickle.UnpicklingError):
        return dict(_Receiver(answers, shared).load())
    return {}
