"""Wheel and sdist: what they hold, and that the wheel works in an environment without any of the extras."""

from __future__ import annotations

import datetime
import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest
import yaml

import rverror
from pages import DOCS, ROOT, text

#: Packages that only extras bring: importing one of them is refused in the smoke test.
EXTRAS = (
    "matplotlib",
    "pandas",
    "xarray",
    "h5py",
    "nptdms",
    "dask",
    "sphinx",
    "numpydoc",
    "jupytext",
    "cvxpy",
    "pytest",
)
SMOKE = f"""
import importlib.abc, sys

class Refuse(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in {EXTRAS!r}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)

sys.meta_path.insert(0, Refuse())
import numpy as np
import rverror
from importlib.resources import files
from rverror.app.command_line import main

assert sys.argv[1] in rverror.__file__, rverror.__file__
theta = np.linspace(0, 2 * np.pi, 512)
unit = rverror.reducer("RV-40E")
assert rverror.influence(unit, theta, "crank.eccentricity", crank=0, disc=1).matrix.shape == (2, 512)
one = rverror.Model(unit, (rverror.effect("crank.eccentricity", crank=0, disc=0, radial="5 um"),))
assert 18.4 < np.ptp(np.degrees(rverror.transmission_error(one, theta))) * 3600 < 18.6
demo = files("rverror") / "data" / "demo"
model = rverror.load_model(demo / "model.toml")
few = rverror.diagnosis.Policy(keys=("sensor.encoder_eccentricity", "crank.eccentricity"))
found = rverror.diagnose(model, [rverror.load_run(demo / name) for name in ("forward.csv", "reverse.csv")], policy=few)
assert found.added[0].effect.key == "sensor.encoder_eccentricity"
assert "Explained" in found._repr_html_()
for call, extra in ((found.plot, "plot"), (lambda: rverror.to_pandas(found), "tables")):
    try:
        call()
    except rverror.InputError as error:
        assert f"rverror[{{extra}}]" in str(error)
    else:
        raise AssertionError(extra)
assert main(["sources"]) == 0
"""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Wheel and sdist, built from the checkout without a network."""
    pytest.importorskip("build")
    pytest.importorskip("hatchling")
    out = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "build", "--no-isolation", "--wheel", "--sdist", "--outdir", str(out), str(ROOT)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    return {path.suffix: path for path in out.iterdir()}


def test_the_wheel_holds_the_package_and_nothing_else(built: dict[str, Path]) -> None:
    with zipfile.ZipFile(built[".whl"]) as wheel:
        names = wheel.namelist()
        metadata = next(name for name in names if name.endswith("METADATA"))
        words = wheel.read(metadata).decode()
    package = Path(rverror.__file__).parent
    modules = {path.relative_to(package.parent).as_posix() for path in package.rglob("*.py")}
    assert {name for name in names if name.endswith(".py")} == modules
    assert len(modules) > 100
    assert "rverror/py.typed" in names
    assert sum(name.startswith("rverror/data/demo/") for name in names) >= 3
    assert any(name.endswith("LICENSE") for name in names)
    assert {name.partition("/")[0].partition("-")[0] for name in names} == {"rverror"}
    needed = {
        line.partition(":")[2].split(">")[0].strip()
        for line in words.splitlines()
        if line.startswith("Requires-Dist") and "extra" not in line
    }
    assert needed == {"numpy", "scipy", "pint", "numba"}
    assert f"Version: {rverror.__version__}" in words


def test_the_sdist_holds_what_the_repository_holds(built: dict[str, Path]) -> None:
    with tarfile.open(built[".gz"]) as sdist:
        names = {name.partition("/")[2] for name in sdist.getnames()}
    assert {"run.py", ".ci/run", "docs/conf.py", "tests/project/test_packaging.py", "src/rverror/__init__.py"} <= names
    assert not [name for name in names if name.startswith((".venv", "build/", "docs/notebooks/"))]
    if (ROOT / ".git").exists():  # not where the sdist itself is checked
        listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
        tracked = {name for name in listed.split("\0") if name and (ROOT / name).exists()}
        assert names >= tracked, sorted(tracked - names)


def with_machine_code(installed: Path) -> None:
    """Give the wheel's compiled files the machine code of the checkout's, which is that of the same text.

    Its first start would compile for half a minute what run.py has compiled already.
    """
    package = Path(rverror.__file__).parent
    for code in package.rglob("__pycache__/*.nb[ic]"):
        place = code.relative_to(package)
        source = place.parents[1] / f"{place.name.partition('.')[0]}.py"
        if not (package / source).exists():
            continue
        assert (installed / source).read_bytes() == (package / source).read_bytes()
        (installed / place).parent.mkdir(exist_ok=True)
        shutil.copy2(code, installed / place)
        shutil.copystat(package / source, installed / source)  # numba knows a file by its time and size


def test_the_wheel_works_without_the_extras(built: dict[str, Path], tmp_path: Path) -> None:
    with zipfile.ZipFile(built[".whl"]) as wheel:
        wheel.extractall(tmp_path / "installed")
    with_machine_code(tmp_path / "installed" / "rverror")
    code = f"import sys; sys.path.insert(0, {str(tmp_path / 'installed')!r})\n" + SMOKE
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", code, str(tmp_path)],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        check=False,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert "crank.eccentricity" in done.stdout


# --- what says the same in several places -----------------------------------------------------------------------------

PROJECT = tomllib.loads(text(ROOT / "pyproject.toml"))["project"]


def test_the_version_is_the_same_wherever_it_stands() -> None:
    version = rverror.__version__
    citation = yaml.safe_load(text(ROOT / "CITATION.cff"))
    assert citation["version"] == version
    heading, note = re.findall(r"^## (\S+)(?: \((.*)\))?$", text(ROOT / "CHANGELOG.md"), flags=re.MULTILINE)[0]
    assert heading == version
    assert datetime.date.fromisoformat(note) == citation["date-released"]
    for page in [ROOT / "README.md", *DOCS.rglob("*.md")]:
        assert set(re.findall(r"\brverror (\d+\.\d+\.\d+)", text(page))) <= {version}, page.name
    (maturity,) = (line for line in PROJECT["classifiers"] if line.startswith("Development Status"))
    assert maturity.endswith("Production/Stable")


def test_citation_says_what_the_package_says() -> None:
    """The fields that version 1.2.0 of the format asks for; cffconvert checks the whole when a version is released."""
    citation = yaml.safe_load(text(ROOT / "CITATION.cff"))
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert citation["license"] == PROJECT["license"]
    assert citation["keywords"] == PROJECT["keywords"]
    assert citation["authors"] == PROJECT["authors"]


def test_the_pythons_are_the_same_wherever_they_stand() -> None:
    pythons = re.findall(r"Python :: (3\.\d+)$", "\n".join(PROJECT["classifiers"]), flags=re.MULTILINE)
    workflow = yaml.safe_load(text(ROOT / ".github" / "workflows" / "check.yml"))["jobs"]["check"]
    assert workflow["strategy"]["matrix"]["python"] == pythons
    assert {name.partition("-")[0] for name in workflow["strategy"]["matrix"]["system"]} == {
        "ubuntu",
        "macos",
        "windows",
    }
    assert workflow["steps"][-1]["run"] == "python run.py test"
    assert PROJECT["requires-python"] == f">={pythons[0]}"
    assert f"PYTHON_NEEDED = ({pythons[0].replace('.', ', ')})" in text(ROOT / "run.py")
    for page in (ROOT / "README.md", ROOT / "CONTRIBUTING.md"):
        assert f"With Python {pythons[0]} or later" in text(page)
    assert f"Python {', '.join(pythons[:-1])} and {pythons[-1]}." in text(DOCS / "stability.md")


def test_releasing_names_every_extra() -> None:
    part = text(ROOT / "CONTRIBUTING.md").partition("## Releasing")[2]
    for extra in PROJECT["optional-dependencies"]:
        assert f"`{extra}`" in part or f"[{extra}]" in part, extra


def test_the_site_brings_what_its_notebooks_import() -> None:
    """A notebook that is run for the site has no other extras than the site's."""
    extras = PROJECT["optional-dependencies"]
    (own,) = (line for line in extras["docs"] if line.startswith("rverror["))
    brought = [*PROJECT["dependencies"], *extras["docs"]]
    brought += [line for extra in own[len("rverror[") : -1].split(",") for line in extras[extra]]
    names = {re.split(r"[\[<>=]", line)[0].lower() for line in brought}
    for path in (ROOT / "examples" / "notebooks").glob("*.py"):
        for module in re.findall(r"^(?:import|from) (\w+)", text(path), flags=re.MULTILINE):
            assert module in sys.stdlib_module_names or module in names or module == "catalogue_tables", path.name
