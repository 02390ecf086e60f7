"""What is in examples/ runs as it stands, and shows what its words and the pages say."""

from __future__ import annotations

import contextlib
import io
import json
import math
import re
import runpy
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))
NUMBER = re.compile(r"-?\d+\.\d+")


@cache
def run(name: str) -> tuple[str, dict[str, Any]]:
    """What a script prints, and its names."""
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed):
        names = runpy.run_path(str(ROOT / "examples" / f"{name}.py"), run_name="__main__")
    return printed.getvalue(), names


def assert_alike(found: str, stored: str) -> None:
    """The same words and, but for the last digits, the same numbers."""
    words = [" ".join(NUMBER.sub("#", text).split()) for text in (found, stored)]
    assert words[0] == words[1]
    numbers = [[float(number) for number in NUMBER.findall(text)] for text in (found, stored)]
    np.testing.assert_allclose(numbers[0], numbers[1], rtol=0.02, atol=0.011)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example_runs(path: Path) -> None:
    assert "arcsec" in run(path.stem)[0]


# --- the extension ----------------------------------------------------------------------------------------------------


def test_extension_goes_from_unexplained_to_explained() -> None:
    printed, names = run("extension")
    first, described, explained = (names[name] for name in ("first", "described", "explained"))
    assert "SIMULATED" in printed
    assert (first.verdict, first.added) == ("unexplained", ())
    assert [(line.order, line.frames) for line in first.unexplained] == [(36.0, ())]
    assert "empirical.order" not in {candidate.key for candidate in first.candidates}
    assert (described.verdict, described.added) == ("nothing_missing", ())
    assert (explained.verdict, [a.effect.key for a in explained.added]) == ("explained", ["load.cogging"])
    assert explained.added[0].indistinguishable == ()


def test_extension_finds_the_torque_that_the_bench_was_given() -> None:
    names = run("extension")[1]
    cos, sin = names["explained"].added[0].estimates
    given = names["COGGING"], names["PHASE"]
    assert cos.low < given[0] * math.cos(given[1]) < cos.high
    assert sin.low < given[0] * math.sin(given[1]) < sin.high
    assert cos.high - cos.low < 0.05 * given[0]


def test_extension_before_and_after_on_what_no_fit_has_seen() -> None:
    """On left-out revolutions both ways end in the noise; at another load the written effect alone does."""
    printed, names = run("extension")
    before, described, explained = (names[name] for name in ("first", "described", "explained"))
    assert before.after.heldout_rms > 5 * before.noise_rms
    for found in (described, explained):
        assert found.after.heldout_rms < 1.1 * found.noise_rms
    table = [line.split() for line in printed.splitlines()[-3:]]
    declared, empirical, cogging = (float(words[-1]) for words in table)
    assert declared > 10 * empirical > 30 * cogging


def test_the_page_shows_what_the_extension_prints() -> None:
    page = (ROOT / "docs" / "adding-an-effect.md").read_text(encoding="utf-8")
    assert_alike(run("extension")[0], page.partition("```text\n")[2].partition("```")[0])


# --- the notebook -----------------------------------------------------------------------------------------------------


def cells(path: Path, kind: str) -> list[dict[str, Any]]:
    notebook = json.loads(path.read_text(encoding="utf-8"))
    return [cell for cell in notebook["cells"] if cell["cell_type"] == kind]


def joined(text: str | list[str]) -> str:
    return text if isinstance(text, str) else "".join(text)


def printed_in(cell: dict[str, Any]) -> str:
    return "".join(joined(output["text"]) for output in cell["outputs"] if output["output_type"] == "stream")


@pytest.mark.filterwarnings("ignore:FigureCanvasAgg is non-interactive")
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_notebook_runs_without_jupyter(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its cells in order, as plain code; every cell prints something where one was stored to print."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("Agg")
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {"__name__": "__main__"}
    with pyplot.rc_context():
        for number, cell in enumerate(cells(path, "code"), 1):
            printed, drawn = io.StringIO(), len(pyplot.get_fignums())
            with contextlib.redirect_stdout(printed):
                exec(compile(joined(cell["source"]), f"{path.name}, cell {number}", "exec"), names)
            assert bool(printed.getvalue()) == bool(printed_in(cell))
            pictures = [output for output in cell["outputs"] if "image/png" in output.get("data", {})]
            assert len(pyplot.get_fignums()) - drawn == len(pictures)
            if "peak-to-peak" in joined(cell["source"]):
                assert_alike(printed.getvalue(), printed_in(cell))
        pyplot.close("all")
    assert names["found"].verdict == "explained"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda p: p.stem)
def test_notebook_is_stored_whole_and_names_no_machine(path: Path) -> None:
    notebook = json.loads(path.read_text(encoding="utf-8"))
    assert path.stat().st_size < 500_000
    assert set(notebook["metadata"]) == {"kernelspec", "language_info"}
    assert notebook["metadata"]["language_info"] == {"name": "python"}
    assert [cell["execution_count"] for cell in cells(path, "code")] == list(range(1, len(cells(path, "code")) + 1))
    assert all(cell["metadata"] == {} for cell in notebook["cells"])
    assert "SIMULATED" in joined(cells(path, "markdown")[0]["source"])
    outputs = [output for cell in cells(path, "code") for output in cell["outputs"]]
    assert any("image/png" in output.get("data", {}) for output in outputs)
    assert not [output for output in outputs if output["output_type"] == "error" or output.get("name") == "stderr"]
    words = "".join(joined(cell["source"]) + printed_in(cell) for cell in cells(path, "code"))
    assert not re.search(r"(?<![\w.])/\w+/\w|[A-Z]:\\", words)
