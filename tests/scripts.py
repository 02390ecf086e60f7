"""The scripts of examples/, each run once for all test files that look at it."""

from __future__ import annotations

import contextlib
import io
from functools import cache
from runpy import run_path
from typing import Any

from pages import ROOT


@cache
def run(name: str) -> tuple[str, dict[str, Any]]:
    """What a script prints, and its names."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        names = run_path(str(ROOT / "examples" / f"{name}.py"), run_name="__main__")
    return printed.getvalue(), names
