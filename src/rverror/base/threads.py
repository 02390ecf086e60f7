"""Threads: how many there are, those of the BLAS libraries, and independent work on several of them."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Iterator, MutableMapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar, copy_context
from functools import cache
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    from concurrent.futures import ThreadPoolExecutor

T = TypeVar("T")
R = TypeVar("R")

#: What the BLAS libraries read as numpy is imported.
BLAS_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")
#: What says how many threads compiled loops take.
KERNEL_THREADS = "NUMBA_NUM_THREADS"

_MOST = 16  # threads: more wait for the interpreter between two equilibria
_AT_MOST = ContextVar("threads within `at_most`", default=_MOST)


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def one_for_a_diagnosis(
    environment: MutableMapping[str, str], arguments: Sequence[str], loaded: Collection[str]
) -> None:
    """Let commands that diagnose or tell of a lot multiply matrices on one thread, unless their user has said how many.

    They make many small products: two threads take twice the processor's time for them and are done no sooner.
    Its equilibria run on all cores.  A program that imports rverror keeps what it has.

    Parameters
    ----------
    environment : mutable mapping of str to str
        Of the process; changed.
    arguments : sequence of str
        With which Python was started, as `sys.orig_argv` has them.
    loaded : collection of str
        Modules that are; after numpy it is too late.
    """
    program, command = [*(Path(word).stem for word in arguments[1:] if not word.startswith("-")), "", ""][:2]
    said = any(name in environment for name in BLAS_THREADS)
    if program == "rverror" and command in ("diagnose", "demo", "lot") and not said and "numpy" not in loaded:
        environment.update(dict.fromkeys(BLAS_THREADS, "1"))


def threads() -> int:
    """Threads for compiled loops: as many as ``NUMBA_NUM_THREADS`` says, or as there are cores.

    Returns
    -------
    int
        No more than `at_most` says; 1 on a thread that is one of several already.
    """
    said = os.environ.get(KERNEL_THREADS, "")
    return min(int(said) if said.isdecimal() and int(said) else cores(), _MOST, _AT_MOST.get())


@contextmanager
def at_most(count: int) -> Iterator[None]:
    """Let what is called within a ``with`` block use no more than so many threads.

    Parameters
    ----------
    count : int
    """
    token = _AT_MOST.set(min(count, _AT_MOST.get()))
    try:
        yield
    finally:
        _AT_MOST.reset(token)


def each(function: Callable[[T], R], items: Sequence[T]) -> list[R]:
    """Results of a function for every item, in their order, on several threads where there are.

    It pays where the function spends its time in what releases the interpreter's lock: compiled loops, large arrays.

    Parameters
    ----------
    function : callable
        Changes nothing that another item needs.
    items : sequence

    Returns
    -------
    list
    """
    count = min(threads(), len(items))
    if count < 2:
        return [function(item) for item in items]

    def alone(item: T) -> R:
        with at_most(1):
            return function(item)

    # what is set here, such as sources that were added, holds on the threads
    waiting = [_pool(count).submit(copy_context().run, alone, item) for item in items]
    try:
        return [one.result() for one in waiting]
    finally:
        for one in waiting:
            one.cancel()


def each_part(function: Callable[[slice], None], size: int, block: int) -> None:
    """Call a function for every part of a range, on several threads where it is long.

    Parameters
    ----------
    function : callable
    size : int
        Of the range.
    block : int
        Each part but the last has whole blocks.
    """
    blocks = -(-size // block)
    count = max(min(threads(), blocks), 1)
    ends = [min(block * (blocks * number // count), size) for number in range(count + 1)]
    each(function, [slice(first, last) for first, last in pairwise(ends)])


@cache
def _pool(count: int) -> ThreadPoolExecutor:
    from concurrent.futures import ThreadPoolExecutor  # brings logging

    return ThreadPoolExecutor(count, "rverror")


if hasattr(os, "register_at_fork"):  # a copy of this process has none of its threads
    os.register_at_fork(after_in_child=_pool.cache_clear)
