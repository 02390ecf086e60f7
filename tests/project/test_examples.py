"""What is in examples/ runs as it stands, and shows what its words and the pages say."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest

from pages import ROOT
from scripts import run

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
NUMBER = re.compile(r"-?\d+\.\d+")


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
    """On left-out stretches both ways end in the noise; at another load the written effect alone does."""
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
