"""Hypothesis profiles: no deadline on shared machines, the same examples every time in continuous integration."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):  # small products wait on each other
    os.environ.setdefault(_name, "1")

import pytest  # noqa: E402
from hypothesis import HealthCheck, settings  # noqa: E402

from rverror.base.memory import keep_freed_memory  # noqa: E402

keep_freed_memory()  # as the command does: one second in thirty

# speed is no test: a busy machine is no failure
_ANY_SPEED = [HealthCheck.too_slow]
settings.register_profile("rverror", deadline=None, max_examples=25, suppress_health_check=_ANY_SPEED)
settings.register_profile(
    "ci", deadline=None, max_examples=25, derandomize=True, database=None, suppress_health_check=_ANY_SPEED
)
settings.load_profile("ci" if os.environ.get("CI") else "rverror")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Collect ten thousand tests without looking for garbage among them, then or later."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()
