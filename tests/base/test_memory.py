"""Freed memory: a process of our own keeps it, whatever imports rverror is left alone."""

from __future__ import annotations

import platform
import subprocess
import sys

import pytest

from rverror.base import memory

# faults of pages by ten arrays of 8 MB, made and dropped one after another; Linux gives a page 4 kB
_FAULTS = """
import resource, sys
import numpy as np
from rverror.base.memory import keep_freed_memory
if sys.argv[1:]:
    assert keep_freed_memory()
np.ones(2**20)
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(10):
    np.ones(2**20)
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library cannot be told")
def test_pages_are_cleared_once() -> None:
    def faults(*said: str) -> int:
        done = subprocess.run([sys.executable, "-c", _FAULTS, *said], capture_output=True, text=True, check=True)
        return int(done.stdout)

    # huge pages, where the kernel gives them, are 512 times as large
    assert faults("keep") < min(faults() / 2, 100)


def test_another_system_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "win32")
    assert not memory.keep_freed_memory()


def test_another_c_library_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(memory.ctypes, "CDLL", lambda _: object())
    assert not memory.keep_freed_memory()
