"""Memory that was freed, kept for what comes next."""

from __future__ import annotations

import ctypes
import sys

# parameters of glibc's mallopt
_M_TRIM_THRESHOLD, _M_TOP_PAD, _M_MMAP_THRESHOLD = -1, -2, -3
_KEPT = 2**30  # bytes: more than a diagnosis ever holds
_AT_ONCE = 2**26  # bytes that are asked for together
_LARGEST = 2**25  # bytes of an array that is kept: some versions refuse more


def keep_freed_memory() -> bool:
    """Let this process keep the memory that it frees, where its C library can be told so.

    An equilibrium makes and drops arrays of some hundred kilobytes at every step.  glibc gives such back to the kernel,
    which clears every page of the next one: a quarter of the time of an equilibrium without clearance.  Only a process
    of our own is told, the shell's command or a worker of a batch; a program that imports rverror keeps what it has.

    Returns
    -------
    bool
        Whether it was told.
    """
    if not sys.platform.startswith("linux"):
        return False
    tell = getattr(ctypes.CDLL(None), "mallopt", None)
    if tell is None or tell(_M_MMAP_THRESHOLD, _LARGEST) != 1:  # another C library
        return False
    return (tell(_M_TRIM_THRESHOLD, _KEPT), tell(_M_TOP_PAD, _AT_ONCE)) == (1, 1)
