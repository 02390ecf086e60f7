"""Threads of the BLAS libraries, which read their number from the environment as numpy is imported."""

from __future__ import annotations

from collections.abc import Collection, MutableMapping, Sequence
from pathlib import Path

#: What the BLAS libraries read.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "VECLIB_MAXIMUM_THREADS")


def one_for_a_diagnosis(
    environment: MutableMapping[str, str], arguments: Sequence[str], loaded: Collection[str]
) -> None:
    """Let `rverror diagnose` and `rverror demo` calculate on one thread, unless their user has said how many.

    A diagnosis makes many small products: two threads take twice the processor's time for them and are done no sooner,
    where two processes are (`side_by_side`).  A program that imports rverror keeps what it has.

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
    said = any(name in environment for name in THREADS)
    if program == "rverror" and command in ("diagnose", "demo") and not said and "numpy" not in loaded:
        environment.update(dict.fromkeys(THREADS, "1"))
