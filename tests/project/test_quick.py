"""`python run.py test --quick`: of each test file of a room the first test, and nothing that takes long to collect."""

from __future__ import annotations

import re
import subprocess
import sys

from pages import ROOT

#: Two rooms of few tests, and what is left out; to collect all takes long.
CHOSEN = ("base", "reference", "project", "benchmarks")


def test_it_takes_the_first_test_of_each_file_of_a_room() -> None:
    command = [sys.executable, "-m", "pytest", "-p", "no:xdist", "--collect-only", "-q", "--quick"]
    command += [f"--ignore={path}" for path in (ROOT / "tests").iterdir() if path.is_dir() and path.name not in CHOSEN]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:]
    found = re.findall(r"^(tests/\S+\.py)::(\w+)", done.stdout, flags=re.MULTILINE)
    files = [path for folder in CHOSEN[:2] for path in sorted((ROOT / "tests" / folder).glob("test_*.py"))]
    first = [re.findall(r"^def (test_\w+)", path.read_text("utf-8"), flags=re.MULTILINE)[0] for path in files]
    assert found == [(path.relative_to(ROOT).as_posix(), name) for path, name in zip(files, first, strict=True)]
