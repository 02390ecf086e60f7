"""Loops that are compiled: numba's ordinary decorator, its cache, and one line while the first compilation lasts."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any, TypeVar

import numba
from numba.core import event

F = TypeVar("F", bound=Callable[..., Any])

#: Sums may be reordered and products fused: rounding differs, infinities and NaN keep their meaning.
_OPTIONS = {"nogil": True, "fastmath": {"reassoc", "contract", "nsz"}, "error_model": "numpy", "_nrt": False}


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
        made: F = numba.njit(cache=True, **_OPTIONS)(function)
    except RuntimeError:  # no folder for a cache can be written
        made = numba.njit(**_OPTIONS)(function)
    return made


def inlined(function: F) -> F:
    """Compile a function into those that call it.

    A call of its own would copy every array's address, shape and strides: 0.2 us for what a kernel holds.

    Parameters
    ----------
    function : callable

    Returns
    -------
    callable
    """
    made: F = numba.njit(forceinline=True, **_OPTIONS)(function)
    return made


class _Announcement(event.Listener):  # type: ignore[misc]  # numba has no types
    """Says once, on the standard error, that a first run compiles."""

    said = False

    def on_start(self, event: Any) -> None:
        if not self.said:
            self.said = True
            print("rverror: compiling for this machine, once; up to 20 s", file=sys.stderr, flush=True)

    def on_end(self, event: Any) -> None:
        pass


event.register("numba:compile", _Announcement())
