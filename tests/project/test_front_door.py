"""The front door: what `import rverror` gives, when it loads it, and that users need nothing else."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

import rverror

ROOT = Path(__file__).parents[2]
#: Names that were given before the package had rooms: scripts rely on them.
LONG_GIVEN = """
    CATALOGUE Allocation Budget Diagnosis Drive Effect Equilibrium ErrorBudget InputError Linearisation Model
    Reducer Run Stack Stiffness Tolerance TorsionCurve VirtualUnits __version__ allocate
    append_effects backlash budget cost_front diagnose diagnose_folder
    effect equilibrium error_budget influence linearise load_model load_run load_tolerances lost_motion reducer
    run_from_arrays save_model save_widths simulate simulate_runs stack to_json to_pandas to_text to_xarray
    tolerance torsion_curve torsional_stiffness transmission_error transmission_error_by_effect virtual_units
    write_run
"""
SHOWN = sorted((ROOT / "examples").rglob("*.py"))


def run(code: str) -> str:
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_names_that_were_given_once_are_given_still() -> None:
    assert set(LONG_GIVEN.split()) <= set(rverror.__all__)


@pytest.mark.parametrize("name", ["allocation_json", "allocation_text", "budget_json", "budget_text"])
def test_a_former_name_says_what_took_its_place(name: str) -> None:
    with pytest.warns(DeprecationWarning, match=f"rverror.{name} is rverror.to_"):
        former = getattr(rverror, name)
    assert former in (rverror.to_json, rverror.to_text)
    assert name not in rverror.__all__


def test_names_are_listed_and_others_are_refused() -> None:
    assert dir(rverror) == sorted(rverror.__all__)
    assert all(hasattr(rverror, name) for name in rverror.__all__)
    with pytest.raises(AttributeError, match="module 'rverror' has no attribute 'diagnoze'"):
        rverror.diagnoze  # noqa: B018


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
    assert run(code).split("\n") == ["base geartrain model", "2", "rverror.tolerances.cost"]


def test_type_checkers_are_told_of_every_name_that_comes_late() -> None:
    tree = ast.parse(Path(rverror.__file__).read_text(encoding="utf-8"))
    (block,) = (node for node in tree.body if isinstance(node, ast.If))
    told = {
        alias.asname or alias.name: f"{node.module}.{alias.name}"
        for node in block.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    held = {name: f"rverror.{module}.{name}" for name, module in rverror._LATER.items()}
    assert told == held | {name: f"rverror.{module}" for name, module in rverror._LATER_MODULES.items()}


def test_results_of_the_lowest_rooms_can_be_shown() -> None:
    """Base knows no views: the door, which every import passes, tells it of them."""
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
def test_examples_need_the_door_alone(path: Path) -> None:
    assert {name for name in imported(path) if name.partition(".")[0] == "rverror"} <= {"rverror"}
