"""docs/architecture.md says what the code does: its map has every module, its walks are the calls of a real run.

Run as a script it writes the map and the table of libraries on the page anew.
"""

from __future__ import annotations

import ast
import cProfile
import importlib
import pstats
import re
import sys
from collections import defaultdict
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import rverror
from test_architecture import LAYERS, MODULES, PACKAGE, RANK, TREES, UPWARD, imported

PAGE = Path(__file__).parents[1] / "docs" / "architecture.md"
DEMO = PACKAGE / "data" / "demo"
#: Rooms of the map: title, and the module with whose layer the room begins.
ROOMS = {
    "Ground: units, text, distributions, costs": "errors",
    "The mechanism": "reducer",
    "Files of runs": "reading",
    "Parts and catalogue": "action_line",
    "Model and composer": "model",
    "Loaded equilibrium": "energy",
    "Predictions and runs": "prediction",
    "Tolerances": "tolerance",
    "Diagnosis": "coloured",
    "Reports, pictures, tables": "next_measurement",
    "Command line and package": "cli_tolerances",
}
#: Libraries that come with rverror, and the extra that brings each other one.
NEEDED = ("numpy", "scipy", "pint")
EXTRAS = {"matplotlib": "plot", "pandas": "tables", "xarray": "tables", "h5py": "io", "nptdms": "io"}

Name = tuple[str, str]


def purpose(module: str) -> str:
    """First sentences of a module's docstring, as one line."""
    text = (ast.get_docstring(TREES[module]) or "").split("\n\n")[0]
    return " ".join(text.split()).removesuffix(".").replace("|", r"\|").replace("``", "`")


def map_text() -> str:
    """Every layer in its room."""
    begins = {RANK[module]: title for title, module in ROOMS.items()}
    lines = []
    for rank, layer in enumerate(LAYERS):
        if rank in begins:
            lines += ["", f"### {begins[rank]}", "", "| module | layer | purpose |", "| --- | --- | --- |"]
        lines += [f"| `{module}` | {rank} | {purpose(module)} |" for module in layer]
    return "\n".join([*lines, ""])


def libraries_text() -> str:
    """Which modules import which library."""
    users = defaultdict(list)
    for module in MODULES:
        tops = {name.split(".")[0] for name in imported(TREES[module])}
        for top in tops - set(sys.stdlib_module_names) - {"", "rverror"}:
            users[top].append(module)
    lines = ["", "| library | comes with | used by |", "| --- | --- | --- |"]
    for library in [*NEEDED, *sorted(set(users) - set(NEEDED))]:
        who = ", ".join(f"`{user}`" for user in users[library]) if len(users[library]) < 30 else "most modules"
        extra = "rverror" if library in NEEDED else f"extra `{EXTRAS[library]}`"
        lines.append(f"| {library} | {extra} | {who} |")
    return "\n".join([*lines, ""])


BLOCKS: Mapping[str, Callable[[], str]] = {"map": map_text, "libraries": libraries_text}


def block(page: str, name: str) -> str:
    return page.partition(f"<!-- {name} -->\n")[2].partition(f"<!-- end of {name} -->")[0]


@pytest.mark.parametrize("name", BLOCKS)
def test_block_is_what_the_code_says(name: str) -> None:
    assert block(PAGE.read_text(encoding="utf-8"), name) == BLOCKS[name](), (
        "docs/architecture.md is out of date: python tests/test_architecture_page.py"
    )


def test_every_module_is_on_the_map_once() -> None:
    found = re.findall(r"^\| `(\w+)` \|", block(PAGE.read_text(encoding="utf-8"), "map"), flags=re.MULTILINE)
    assert sorted(found) == MODULES
    assert [RANK[module] for module in ROOMS.values()] == sorted({RANK[module] for module in ROOMS.values()})


def test_the_page_tells_what_calls_upwards() -> None:
    rules = PAGE.read_text(encoding="utf-8").partition("## What may import what")[2].partition("##")[0]
    assert set(UPWARD) == {"views"}
    assert "One room calls upwards: `views`" in rules


def test_optional_libraries_are_imported_inside_functions() -> None:
    for module in MODULES:
        for node in TREES[module].body:
            if isinstance(node, ast.Import | ast.ImportFrom):
                tops = {name.split(".")[0] for name in imported(node)}
                assert not tops & set(EXTRAS), f"{module} imports {tops & set(EXTRAS)} when it is imported"


# --- the walks --------------------------------------------------------------------------------------------------------


def walk(title: str) -> list[tuple[int, str]]:
    """Functions of a walk and how deep each stands."""
    text = PAGE.read_text(encoding="utf-8").partition(f"## {title}")[2].partition("\n## ")[0]
    found = re.findall(r"^( *)- `rverror\.([\w.]+)`", text, flags=re.MULTILINE)
    return [(len(indent) // 2, name) for indent, name in found]


def calls(job: Callable[[], object]) -> dict[Name, set[Name]]:
    """Who called whom in a run of a job, functions as module and plain name."""
    profile = cProfile.Profile()
    profile.runcall(job)
    found: dict[Name, set[Name]] = defaultdict(set)
    for (file, _, name), (*_, callers) in pstats.Stats(profile).stats.items():  # type: ignore[attr-defined]
        if Path(file).parent == PACKAGE:
            for caller_file, _, caller in callers:
                found[Path(caller_file).stem, caller].add((Path(file).stem, name))
    return found


def an_error_vectors_way() -> None:
    model = rverror.load_model(DEMO / "model.toml")
    theta = np.linspace(0, 0.05, 8)
    rverror.transmission_error(model, theta)
    rverror.equilibrium(model, theta, torque="20 N*m")


def a_runs_way() -> None:
    runs = [rverror.load_run(DEMO / f"{name}.csv") for name in ("forward", "reverse")]
    rverror.to_text(rverror.diagnose(rverror.load_model(DEMO / "model.toml"), runs))


WALKS = {
    "First walk: an error vector's way to the output": an_error_vectors_way,
    "Second walk: a run's way to a named cause": a_runs_way,
}


@cache
def calls_of(title: str) -> dict[Name, set[Name]]:
    return calls(WALKS[title])


def plain(name: str) -> Name:
    module, *_, function = name.split(".")
    return module, function


def reaches(graph: Mapping[Name, set[Name]], start: Name, end: Name, *, named: set[Name]) -> bool:
    """Tell whether calls lead from one function to another, through none that the walk names."""
    seen, waiting = {start}, [start]
    while waiting:
        following = graph.get(waiting.pop(), set())
        if end in following:
            return True
        fresh = following - seen - named
        seen |= fresh
        waiting += fresh
    return False


@pytest.mark.parametrize("title", WALKS)
def test_functions_of_a_walk_exist(title: str) -> None:
    assert len(walk(title)) > 10
    for _, name in walk(title):
        module, *path = name.split(".")
        thing = importlib.import_module(f"rverror.{module}")
        for part in path:
            thing = getattr(thing, part)
        assert callable(thing)
        assert thing.__module__ == f"rverror.{module}"


@pytest.mark.parametrize("title", WALKS)
def test_functions_of_a_walk_call_one_another(title: str) -> None:
    graph = calls_of(title)
    called = {callee for callees in graph.values() for callee in callees} | set(graph)
    named = {plain(name) for _, name in walk(title)}
    above: list[str] = []
    for depth, name in walk(title):
        del above[depth:]
        assert len(above) == depth, f"{name} stands too deep"
        assert plain(name) in called, f"{name} was not called"
        if above:
            assert reaches(graph, plain(above[-1]), plain(name), named=named), f"{above[-1]} does not call {name}"
        above.append(name)


if __name__ == "__main__":
    text = PAGE.read_text(encoding="utf-8")
    for name, written in BLOCKS.items():
        text = text.replace(f"<!-- {name} -->\n" + block(text, name), f"<!-- {name} -->\n{written()}")
    PAGE.write_text(text, encoding="utf-8", newline="\n")
