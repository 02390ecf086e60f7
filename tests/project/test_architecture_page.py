"""docs/architecture.md says what the code does: its picture and table are the rooms, its walks the calls of a real run.

`python docs/_ext/rooms_picture.py` draws the picture anew.
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
from unittest import mock

import numpy as np
import pytest
import rooms_picture

import rverror
from modules import MODULES, PACKAGE, TREES, import_graph, imported, named, split
from pages import DOCS, text
from rverror.statics import kernel

PAGE = DOCS / "architecture.md"
DEMO = PACKAGE / "data" / "demo"
ROWS = re.findall(r"^\| `(\w+)` \| (.+) \| (.+) \|$", text(PAGE), flags=re.MULTILINE)

Name = tuple[str, str]


# --- the rooms --------------------------------------------------------------------------------------------------------


def test_the_picture_is_that_of_the_code() -> None:
    assert text(rooms_picture.PICTURE) == rooms_picture.svg(), (
        "docs/rooms.svg is out of date: python docs/_ext/rooms_picture.py"
    )


def test_arrows_of_the_picture_say_all_that_is_imported() -> None:
    """What they leave out is on a longer way, and they lead down."""
    imports, arrows = rooms_picture.imports(), rooms_picture.reduced(rooms_picture.imports())
    order = [set(layer) for layer in rooms_picture.layers()]
    depth = {room: number for number, layer in enumerate(order) for room in layer}

    def reached(room: str) -> set[str]:
        return set().union(*({other} | reached(other) for other in arrows[room]))

    for room, others in imports.items():
        assert others <= reached(room)
        assert all(depth[other] > depth[room] for other in others)


def test_arrows_of_the_picture_cross_no_room() -> None:
    boxes = rooms_picture.boxes()
    for one, others in rooms_picture.reduced(rooms_picture.imports()).items():
        for other in others:
            x, y, u, v = rooms_picture.ends(one, other)
            for room, (left, top, width, height) in boxes.items():
                if room not in (one, other):
                    share = np.linspace(0, 1, 200)
                    across, down = x + share * (u - x), y + share * (v - y)
                    within = (left < across) & (across < left + width) & (top < down) & (down < top + height)
                    assert not within.any(), f"{one} to {other} crosses {room}"


def test_the_table_has_every_room_with_its_purpose() -> None:
    assert {path.parent.name for path in PACKAGE.glob("*/__init__.py")} == set(rooms_picture.rooms())
    assert [(room, purpose) for room, purpose, _ in ROWS] == [
        (room, rooms_picture.purpose(room)) for room in rooms_picture.rooms()
    ]


@pytest.mark.parametrize(("room", "told"), [(room, told) for room, _, told in ROWS])
def test_files_that_the_table_names_are_there(room: str, told: str) -> None:
    named = re.findall(r"`([\w/]+(?:\.py|/))`", told)
    assert named
    for name in named:
        assert (PACKAGE / room / name).exists(), name
    for name in re.findall(r"`([A-Za-z]\w*)`", told):
        assert any(f" {name}" in (PACKAGE / room / file).read_text("utf-8") for file in named if file.endswith(".py"))


def test_parts_of_the_picture_are_files_of_the_gear_train() -> None:
    for part in rooms_picture.PARTS:
        assert (PACKAGE / "geartrain" / f"{part}.py").exists()


def test_a_key_is_found_where_the_page_says() -> None:
    told = text(PAGE).partition("## Where is a catalogue key?")[2].partition("\n## ")[0]
    parts, others = (set(re.findall(r"`(\w+)`", half)) for half in told.partition("So do all keys")[2].split("; those"))
    others &= {path.stem for path in (PACKAGE / "model").glob("*.py")}
    for key, entry in rverror.CATALOGUE.items():
        family = key.partition(".")[0]
        room = "geartrain" if family in parts else "model"
        assert family in parts | others
        module = importlib.import_module(f"rverror.{room}.{family}")
        assert entry in module.SOURCES, f"{key} is not in rverror.{room}.{family}.SOURCES"


# --- libraries --------------------------------------------------------------------------------------------------------

#: By library: the extra that brings it, and where it is used, as the page has it.
LIBRARIES = {
    library: (extra, re.findall(r"`([\w.]+)`", places))
    for library, extra, places in re.findall(r"^  - (\w+), extra `(\w+)`: (.+)[;.]$", text(PAGE), flags=re.MULTILINE)
}


def test_the_page_names_every_library_and_who_uses_it() -> None:
    graph = import_graph()
    outside = {module for module in graph.modules if graph.is_module_squashed(module)}
    assert outside - set(sys.stdlib_module_names) == {"numpy", "scipy", "pint", "numba"} | set(LIBRARIES)
    for library, (_, places) in LIBRARIES.items():
        users = graph.find_modules_that_directly_import(library)
        for user in users:
            assert any(f"{user}.".startswith(f"rverror.{place}.") for place in places), f"{user} imports {library}"
        for place in places:
            assert any(f"{user}.".startswith(f"rverror.{place}.") for user in users), f"{place} is without {library}"


def test_optional_libraries_are_imported_inside_functions() -> None:
    for module in MODULES:
        for node in TREES[module].body:
            if isinstance(node, ast.Import | ast.ImportFrom):
                tops = set(imported(node))
                assert not tops & set(LIBRARIES), f"{module} imports {tops & set(LIBRARIES)} when it is imported"


# --- the walks --------------------------------------------------------------------------------------------------------


def plain(name: str) -> Name:
    module, path = split(name)
    return module, path[-1]


def walk(title: str) -> list[tuple[int, str]]:
    """Functions of a walk and how deep each stands."""
    told = text(PAGE).partition(f"## {title}")[2].partition("\n## ")[0]
    found = re.findall(r"^( *)- `(rverror\.[\w.]+)`", told, flags=re.MULTILINE)
    return [(len(indent) // 2, name) for indent, name in found]


def module_of(file: str) -> str:
    """Module of the package that a file holds; empty where it is none."""
    path = Path(file)
    return ".".join(path.relative_to(PACKAGE.parent).with_suffix("").parts) if PACKAGE in path.parents else ""


def calls(job: Callable[[], object]) -> dict[Name, set[Name]]:
    """Who called whom in a run of a job, functions as module and plain name."""
    profile = cProfile.Profile()
    profile.runcall(job)
    found: dict[Name, set[Name]] = defaultdict(set)
    for (file, _, name), (*_, callers) in pstats.Stats(profile).stats.items():  # type: ignore[attr-defined]
        if module_of(file):
            for caller_file, _, caller in callers:
                found[module_of(caller_file), caller].add((module_of(file), name))
    return found


def an_error_vectors_way() -> None:
    model = rverror.load_model(DEMO / "model.toml")
    theta = np.linspace(0, 0.05, 2)
    rverror.transmission_error(model, theta)
    # what is compiled has no profile; and called from what is not, each part would be compiled by itself
    as_written = {name: thing.py_func for name, thing in vars(kernel).items() if hasattr(thing, "py_func")}
    with mock.patch.dict(vars(kernel), as_written):
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
        thing = named(name)
        assert callable(thing)
        assert thing.__module__ == split(name)[0]


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
