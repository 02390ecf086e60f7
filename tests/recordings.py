"""Where the recordings, the virtual test bench and the source texts lie: beside the repository, never in it.

The folder of the recordings is that of the environment variable RVERROR_DATA, else ``../shared/data`` beside the
repository; the bench is the folder ``bench`` beside it, the texts are the folder ``sources``.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

_BESIDE = Path(__file__).parents[2] / "shared" / "data"


def recording(*parts: str) -> Path:
    """Path below the recordings; skips the test where there are none."""
    return _existing(_data(), parts)


def bench(*parts: str) -> Path:
    """Path below the virtual test bench; skips the test where there is none."""
    return _existing(_data().parent / "bench", parts)


def source_text(number: str) -> str:
    """Text of one of the five sources, by its number; skips the test where the texts are not there."""
    folder = _existing(_data().parent / "sources", ())
    (found,) = folder.glob(f"{number}_*.txt")
    return found.read_text(encoding="utf-8")


def _data() -> Path:
    return Path(os.environ.get("RVERROR_DATA") or _BESIDE)


def _existing(root: Path, parts: tuple[str, ...]) -> Path:
    path = root.joinpath(*parts)
    if not path.exists():
        pytest.skip(f"no data in {root} (set RVERROR_DATA to the folder of the recordings)")
    return path
