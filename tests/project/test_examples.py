"""Each script in examples/ runs as it stands."""

from __future__ import annotations

from pathlib import Path

import pytest

from diagnosed_example import found_once
from pages import ROOT
from scripts import run

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
#: What takes long is run where more is asked of it.
ELSEWHERE = {"dask_cluster": "tolerances/test_dask_cluster.py", "extension": "project/test_notebooks.py"}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example_runs(path: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    if path.stem in ELSEWHERE:
        assert f'run("{path.stem}")' in (ROOT / "tests" / ELSEWHERE[path.stem]).read_text(encoding="utf-8")
    else:
        with found_once(tmp_path_factory.getbasetemp() / "diagnosis-of-the-example"):
            assert "arcsec" in run(path.stem)[0]
