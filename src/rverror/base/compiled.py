"""Loops that are compiled: numba's ordinary decorator, its cache, and one line while the first compilation lasts."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
from numba.core import event

F = TypeVar("F", bound=Callable[..., Any])

#: Sums may be reordered and products fused: rounding differs, infinities and NaN keep their meaning.  Nothing is
#: allocated, so arrays need not be counted, which takes a third of the time of a short loop.
_OPTIONS: dict[str, Any] = {
    "nogil": True,
    "fastmath": {"reassoc", "contract", "nsz"},
    "error_model": "numpy",
    "_nrt": False,
}
#: Not what would let Python or C call it, which takes a fifth of the time of compiling.
_INLINED: dict[str, Any] = {**_OPTIONS, "forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}


def compiled(function: F) -> F:
    """Compile a function of arrays and numbers when it is first called, or load what an earlier process compiled.

    It releases the interpreter's lock while it runs, so threads run it side by side.  The machine code is kept beside
    the source, or in the user's cache folder where that cannot be written; where neither can, every process compiles
    anew.  With ``NUMBA_DISABLE_JIT=1`` the function runs as it is written.

    Parameters
    ----------
    function : callable
        What it calls must be `inlined` and stand in the same file: the cache knows of changes in that file alone.

    Returns
    -------
    callable
    """
    try:
        made = numba.njit(cache=True, **_OPTIONS)(function)
    except RuntimeError:  # no folder for a cache can be written
        made = numba.njit(**_OPTIONS)(function)
    return cast(F, made)


def inlined(function: F) -> F:
    """Compile a function into those that call it; Python itself cannot call it.

    A call of its own would copy every array's address, shape and strides: 0.2 us for what a kernel holds.

    Parameters
    ----------
    function : callable

    Returns
    -------
    callable
    """
    return cast(F, numba.njit(**_INLINED)(function))


class _Announcement(event.Listener):
    """Says once, on the standard error, that what follows takes long the first time."""

    said = False

    def on_start(self, event: Any) -> None:
        ours = event.data["dispatcher"].py_func.__module__.startswith("rverror.")
        if ours and not self.said:
            self.said = True
            print("rverror: compiling for this machine, once; up to half a minute", file=sys.stderr, flush=True)

    def on_end(self, event: Any) -> None:
        pass


event.register("numba:compile", _Announcement())  # type: ignore[no-untyped-call]
