"""The diagnosis of the shipped example as the command gives it, run once for all test files that look at it.

The truth is the virtual bench's own: it added an encoder eccentricity to a unit that declares none, and noise.
"""

from __future__ import annotations

import contextlib
import functools
import io
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import pytest

import rverror
from rverror import Diagnosis, diagnose
from rverror.app import command_line as cli, diagnosis_commands

DEMO = Path(rverror.__file__).parent / "data" / "demo"


COS, SIN = 4.1, -2.7  # arcsec, undeclared


@dataclass(frozen=True)
class Outcome:
    """What one `rverror diagnose` of the shipped example gave."""

    folder: Path
    code: int
    out: str
    err: str
    diagnosis: Diagnosis

    def json(self) -> dict[str, Any]:
        return strict_json((self.folder / "found.json").read_text(encoding="utf-8"))


@functools.cache
def outcome(folder: Path) -> Outcome:
    """Run it, once in a session for all test files: it takes some ten seconds."""
    folder.mkdir()
    for name in ("model.toml", "forward.csv", "reverse.csv"):
        (folder / name).write_bytes((DEMO / name).read_bytes())
    found: list[Diagnosis] = []

    def keep(*args: Any, **keywords: Any) -> Diagnosis:
        found.append(diagnose(*args, **keywords))
        return found[0]

    named = {"--json": "found.json", "--save": "new.toml", "--report": "page.html", "--plot": "picture.png"}
    arguments = ["diagnose", "model.toml", "forward.csv", "reverse.csv", "--jobs", "1"]
    for option, name in named.items():
        arguments += [option, name]
    out, err = io.StringIO(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        patch.setattr(diagnosis_commands, "diagnose", keep)
        patch.chdir(folder)
        code = cli.main(arguments)
    return Outcome(folder, code, out.getvalue(), err.getvalue(), found[0])


@contextlib.contextmanager
def found_once(folder: Path) -> Iterator[None]:
    """Whoever diagnoses the example's files, in a program or by the command, is told the outcome; others diagnose."""

    def told(model: rverror.Model, runs: Sequence[rverror.Run], **options: Any) -> Diagnosis:
        asked = {name for name, value in options.items() if value is not None} - {"jobs", "progress"}
        if asked or model != rverror.load_model(DEMO / "model.toml"):
            return diagnose(model, runs, **options)
        files = [rverror.load_run(DEMO / name, model) for name in ("forward.csv", "reverse.csv")]
        angles = [[run.output_angle.tobytes() for run in given] for given in (runs, files)]
        if angles[0] != angles[1]:
            return diagnose(model, runs, **options)
        return outcome(folder).diagnosis

    with pytest.MonkeyPatch.context() as patch:
        for place in (rverror, diagnosis_commands):
            patch.setattr(place, "diagnose", told)
        yield


def strict_json(text: str) -> dict[str, Any]:
    """JSON as every program reads it: NaN and Infinity are Python's own."""

    def refuse(word: str) -> NoReturn:
        raise AssertionError(f"{word} is no JSON")

    loaded: dict[str, Any] = json.loads(text, parse_constant=refuse)
    return loaded
