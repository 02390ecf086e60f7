"""The front door: what `import rverror` gives, when it loads it, and that users need nothing else."""

from __future__ import annotations

import ast
import pydoc
import re
import subprocess
import sys
from pathlib import Path

import pytest

import rverror
from modules import PUBLIC, ROOMS, named
from rverror.base import lazy

ROOT = Path(__file__).parents[2]
SHOWN = sorted((ROOT / "examples").rglob("*.py"))


def run(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_names_on_top_are_few() -> None:
    assert len(rverror.__all__) <= 40
    assert set(dir(rverror)) == set(rverror.__all__) | set(ROOMS)
    for name in set(rverror.__all__) - {"__version__"}:
        assert getattr(rverror, name) is named(PUBLIC[name])
    with pytest.raises(AttributeError, match="module 'rverror' has no attribute 'diagnoze'"):
        rverror.diagnoze  # noqa: B018


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_gives_its_own_names(room: str) -> None:
    """Of its own modules: a name has one home.  That each can be loaded and has an example, other tests say."""
    package = getattr(rverror, room)
    assert set(dir(package)) >= set(package.__all__)
    for name in package.__all__:
        module, _ = lazy.places(package.__name__)[name]
        assert module.startswith(f"rverror.{room}.")
        assert PUBLIC[name] == f"rverror.{room}.{name}"
    with pytest.raises(AttributeError, match=f"module 'rverror.{room}' has no attribute 'diagnoze'"):
        package.diagnoze  # noqa: B018


FORMER = {name: place for name, place in PUBLIC.items() if name not in rverror.__all__} | {
    "costs": "rverror.tolerances.cost",
    "distributions": "rverror.tolerances.distribution",
    "allocation_json": "rverror.to_json",
    "allocation_text": "rverror.to_text",
    "budget_json": "rverror.to_json",
    "budget_text": "rverror.to_text",
}


@pytest.mark.parametrize("name", FORMER)
def test_a_former_name_says_where_it_is_now(name: str) -> None:
    with pytest.warns(DeprecationWarning, match=rf"rverror\.{name} is {re.escape(FORMER[name])} now") as told:
        former = getattr(rverror, name)
    assert former is named(FORMER[name])
    assert told[0].filename == __file__
    assert name not in dir(rverror)


def test_a_former_name_of_a_room_says_what_it_is_now() -> None:
    now = "rverror.geartrain.OperatingConditions"
    with pytest.warns(DeprecationWarning, match=rf"rverror\.geartrain\.Conditions is {re.escape(now)} now"):
        assert rverror.geartrain.Conditions is named(now)
    assert "Conditions" not in dir(rverror.geartrain)


def test_help_and_stars_have_every_name() -> None:
    for package in (rverror, *(getattr(rverror, room) for room in ROOMS)):
        page = pydoc.plaintext.document(package)
        assert all(re.search(rf"\b{name}\b", page) for name in set(package.__all__) - {"__version__"})
        given: dict[str, object] = {}
        exec(f"from {package.__name__} import *", given)
        assert set(package.__all__) <= set(given)


def test_what_is_slow_or_rare_is_loaded_when_it_is_asked_for() -> None:
    """Of scipy alone its front: a part of it takes longer to load than all of rverror."""
    late = ("matplotlib", "pandas", "xarray", "pint", "rverror.app", "rverror.reference", "rverror.views.plots")
    code = (
        "import rverror, sys\n"
        "parts = [name for name in sys.modules if name.count('.') == 1 and hasattr(sys.modules[name], '__path__')]\n"
        f"print([name for name in {late} if name in sys.modules])\n"
        "print([name for name in parts if name.startswith('scipy.') and not name.startswith('scipy._')])\n"
        "print(rverror.reference.compare.__module__)"
    )
    assert run(code).split("\n") == ["[]", "[]", "rverror.reference.comparison"]


def test_a_program_loads_what_it_asks_for() -> None:
    """Making the classes of all results takes longer than loading numpy."""
    code = (
        "import rverror, sys\n"
        "rooms = {name.split('.')[1] for name in sys.modules if name.startswith('rverror.')}\n"
        "print(*sorted(rooms))\n"
        "print(rverror.Model(rverror.reducer('RV-40E')).equilibrium('78 Nm', theta=[0.0, 0.1]).theta.size)\n"
        "print(rverror.tolerances.cost.__name__)"
    )
    assert run(code).split("\n") == ["base", "2", "rverror.tolerances.cost"]


def test_results_of_the_lowest_rooms_can_be_shown() -> None:
    """Base knows views by name alone, and loads them when one is asked for."""
    code = "from rverror.geartrain.mechanism import reducer; print(reducer('RV-40E')._repr_html_()[:26])"
    assert run(code) == '<div class="rverror-page">'


def imported(path: Path) -> set[str]:
    found: set[str] = set()
    for node in ast.walk(ast.parse(re.sub(r"^%.*", "", path.read_text(encoding="utf-8"), flags=re.M))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            found.add(node.module)
    return found


@pytest.mark.parametrize("path", SHOWN, ids=lambda path: path.name)
def test_examples_need_public_names_alone(path: Path) -> None:
    given = {"rverror", *(f"rverror.{room}" for room in ROOMS)}
    assert {name for name in imported(path) if name.partition(".")[0] == "rverror"} <= given
