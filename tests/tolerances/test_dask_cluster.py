"""The example on a real local cluster: the same numbers as in this process, and nothing of Dask in the package."""

from __future__ import annotations

import runpy
import sys

import numpy as np
import pytest

from pages import ROOT
from rverror.tolerances.sampling import chunk_length
from scripts import run


@pytest.mark.filterwarnings("ignore")  # of Dask itself
def test_cluster_gives_the_same_numbers() -> None:
    pytest.importorskip("distributed")
    printed, names = run("dask_cluster")
    here, cluster, kept = names["here"], names["cluster"], names["kept"]
    assert cluster is not here
    for units in (cluster, kept):
        for size in ("peak_to_peak", "max", "rms", "offset"):
            np.testing.assert_array_equal(getattr(units, size), getattr(here, size))
    chunks = -(-here.count // chunk_length(here.count))
    assert chunks > 2
    assert (here.kept, cluster.kept, kept.kept) == (0, 0, chunks)
    assert "arcsec" in printed
    assert "the same numbers" in printed


def test_without_dask_the_first_part_runs(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    names = runpy.run_path(str(ROOT / "examples" / "dask_cluster.py"), run_name="__main__")
    assert names["answer"] is None
    printed = capsys.readouterr()
    assert printed.out.count("arcsec") == 4
    assert "pip install" in printed.err


def test_the_package_does_not_know_dask() -> None:
    for path in (ROOT / "src" / "rverror").rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        assert "import dask" not in text
        assert "distributed" not in text
