"""What all tests share: profiles of hypothesis, collection without looking for garbage, and the quick choice."""

from __future__ import annotations

import gc
import os
from collections.abc import Iterator
from pathlib import Path

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):  # small products wait on each other
    os.environ.setdefault(_name, "1")

import pytest  # noqa: E402
from hypothesis import HealthCheck, settings  # noqa: E402

from rverror.base.memory import keep_freed_memory  # noqa: E402

keep_freed_memory()  # as the command does: one second in thirty

# no deadline on shared machines, the same examples every time in continuous integration
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


@pytest.fixture
def few_angles(monkeypatch: pytest.MonkeyPatch) -> None:
    """Solve units at the load at angles enough for waves of order 16 or 40, and for a lost motion alike all around.

    What is tested with them is how a turn spreads over the units.  The first 45 angles see nine phases of order 40 and
    45 of order 16; the last ones stand 20 deg of order 40 apart.
    """
    monkeypatch.setattr("rverror.tolerances.loaded_units.FINE", 720)
    monkeypatch.setattr("rverror.tolerances.loaded_units.POSITIONS", 6)


# --- `--quick` --------------------------------------------------------------------------------------------------------

#: Folders without tests of a room: pages, notebooks and packaging, and simulators of trials, which compile for long.
SLOW = tuple(Path(__file__).parent / name for name in ("benchmarks", "project"))


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--quick", action="store_true", help="of each test file of a room the first test alone")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    return True if config.getoption("--quick") and collection_path in SLOW else None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("--quick"):
        first = list({item.path: item for item in reversed(items)}.values())[::-1]
        config.hook.pytest_deselected(items=[item for item in items if item not in first])
        items[:] = first
