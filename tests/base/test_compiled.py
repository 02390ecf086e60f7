"""Compiled loops: numba comes late, its cache is found again, and where none can be written all works the same."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

KERNEL = '''
"""A small kernel, in a module that could be one of the package's."""
import numpy as np
from rverror.base.compiled import compiled, inlined

@inlined
def square(value):
    return value * value

@compiled
def squares(values, found):
    for i in range(len(values)):
        found[i] = square(values[i])

found = np.empty(3)
squares(np.array([1.0, 2.0, 3.0]), found)
print(found.tolist(), getattr(squares, "stats", None) and sum(squares.stats.cache_hits.values()))
'''
SAID = "rverror: compiling for this machine, once; up to half a minute\n"


def run(folder: Path, **environment: str) -> tuple[str, str]:
    """What a process with that kernel prints, and says on its standard error."""
    kernel = folder / "kernel.py"
    if not kernel.exists():
        kernel.write_text(KERNEL)
    code = f"import runpy; runpy.run_path({str(kernel)!r}, run_name='rverror.kernel')"
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, **environment}, capture_output=True, text=True, check=True
    )
    return done.stdout.strip(), done.stderr


def test_the_first_process_compiles_and_says_so_and_the_next_one_finds_it(tmp_path: Path) -> None:
    cache = str(tmp_path / "cache")
    assert run(tmp_path, NUMBA_CACHE_DIR=cache) == ("[1.0, 4.0, 9.0] 0", SAID)
    assert run(tmp_path, NUMBA_CACHE_DIR=cache) == ("[1.0, 4.0, 9.0] 1", "")


def test_where_no_folder_can_be_written_every_process_compiles(tmp_path: Path) -> None:
    """Files where folders should be: nobody can write there, whatever their rights."""
    for name in ("__pycache__", "none"):
        (tmp_path / name).write_text("")
    nowhere = dict.fromkeys(("HOME", "XDG_CACHE_HOME", "LOCALAPPDATA", "NUMBA_CACHE_DIR"), str(tmp_path / "none"))
    for _ in range(2):
        assert run(tmp_path, **nowhere) == ("[1.0, 4.0, 9.0] 0", SAID)


def test_an_installation_that_cannot_be_written_keeps_its_cache_with_the_user(tmp_path: Path) -> None:
    (tmp_path / "__pycache__").write_text("")  # no folder can be made there
    home = {"HOME": str(tmp_path / "home"), "XDG_CACHE_HOME": str(tmp_path / "home" / "cache")}
    (tmp_path / "home").mkdir()
    assert run(tmp_path, **home) == ("[1.0, 4.0, 9.0] 0", SAID)
    if sys.platform == "linux":
        assert run(tmp_path, **home) == ("[1.0, 4.0, 9.0] 1", "")
        assert list((tmp_path / "home" / "cache").rglob("*.nbc"))


def test_without_compilation_it_runs_as_it_is_written(tmp_path: Path) -> None:
    assert run(tmp_path, NUMBA_DISABLE_JIT="1") == ("[1.0, 4.0, 9.0] None", "")


def test_what_solves_no_equilibrium_does_without_numba() -> None:
    code = "import rverror; rverror.transmission_error(rverror.Model(rverror.reducer('RV-40E')), [0.0, 0.1])"
    subprocess.run([sys.executable, "-c", f"{code}; import sys; assert 'numba' not in sys.modules"], check=True)
