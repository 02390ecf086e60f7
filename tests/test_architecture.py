"""Shape of the code: one way for imports, pint in one place, no hidden state, docstrings whose examples run."""

from __future__ import annotations

import ast
import doctest
import importlib
from collections.abc import Iterator
from pathlib import Path

import pytest

import rverror

PACKAGE = Path(rverror.__file__).parent
MODULES = sorted(path.stem for path in PACKAGE.glob("*.py"))
TREES = {name: ast.parse((PACKAGE / f"{name}.py").read_text(encoding="utf-8")) for name in MODULES}

#: Layers from the ground up; a module may import from layers below its own, not from its own.
LAYERS = (
    ("errors", "units", "views"),
    ("textfile", "terminal", "distribution", "cost", "iso_tolerance", "extremes"),
    ("toml_text", "numerals"),
    ("reducer",),
    ("kinematics",),
    ("reading",),
    ("run_checks", "mapping", "bench_columns", "mat_file"),
    ("run_file", "bench_text", "bench_hdf5", "bench_mat", "bench_tdms", "bench_values", "bench_header"),
    ("bench_file",),
    ("bench_draft",),
    ("action_line",),
    ("feedback",),
    ("involute", "crank", "cycloid", "coupling", "sensor", "shaft", "thermal", "load", "empirical"),
    ("catalogue",),
    ("model",),
    ("compose",),
    ("energy",),
    ("condensation",),
    ("equilibrium",),
    ("prediction", "rigidity", "measurement", "model_file"),
    ("chance", "spectrum", "figure", "simulate"),
    ("tolerance",),
    ("worst_pair",),
    ("tolerance_file", "budget", "virtual_units", "least_cost", "assembly"),
    ("sobol", "limited_error", "contact_correction"),
    ("allocate", "error_budget"),
    ("coloured",),
    ("fit", "diagnosis"),
    ("shared_zero", "unknown_index", "reducer_search"),
    ("drive_runs",),
    ("drive_terms",),
    ("drive_fit",),
    ("drive_lines",),
    ("drive_result",),
    ("drive_search", "growing"),
    ("diagnose",),
    ("next_measurement", "by_order", "svg", "peaks", "waveform_plot", "mechanism_plot", "torsion_plot", "budget_plot"),
    ("html_report", "spectrum_plot", "diagnosis_plot", "tables"),
    ("report", "order_map", "ledger", "docs_tables", "published", "notebook"),
    ("batch", "budget_report", "plot", "reference", "docs_pictures"),
    ("comparison",),
    ("cli_tolerances", "cli_reference", "cli_read"),
    ("cli",),
    ("__init__",),
    ("__main__",),
)
#: The one room that calls upwards, when it is asked for a picture or a page, and what it may call.
UPWARD = {"views": {"plot", "notebook"}}
RANK = {module: rank for rank, layer in enumerate(LAYERS) for module in layer}
#: Words by which a container is changed in place.
CHANGING = {"append", "extend", "insert", "add", "update", "setdefault", "pop", "popitem", "clear", "remove", "discard"}


def imported(tree: ast.AST) -> Iterator[str]:
    """Every module that is imported anywhere in the tree, inside functions too, by its full name."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = ".".join(filter(None, ["rverror" if node.level else "", node.module or ""]))
            yield base
            yield from (f"{base}.{alias.name}" for alias in node.names)


def imported_now(node: ast.stmt) -> Iterator[str]:
    """What a statement of a module imports when the module is."""
    return imported(node) if isinstance(node, ast.Import | ast.ImportFrom) else iter(())


def inside(name: str) -> set[str]:
    """Modules of the package that one of them imports."""
    parts = [full.split(".") for full in imported(TREES[name])]
    found = {p[1] for p in parts if p[0] == "rverror" and len(p) > 1 and p[1] in TREES}
    return found - {name} - UPWARD.get(name, set())


def test_pint_is_known_to_one_module() -> None:
    users = {name for name, tree in TREES.items() if any(full.split(".")[0] == "pint" for full in imported(tree))}
    assert users == {"units"}


def test_pictures_are_reached_inside_functions_only() -> None:
    """A call upwards is made when it is asked for: never on import."""
    for name, above in UPWARD.items():
        on_import = {full.split(".")[1] for node in TREES[name].body for full in imported_now(node) if "." in full}
        assert not on_import & above


@pytest.mark.parametrize("name", MODULES)
def test_imports_flow_one_way(name: str) -> None:
    """Layered modules import from below; a module that no layer names may sit anywhere without closing a circle."""
    for other in inside(name):
        if name in RANK and other in RANK:
            assert RANK[other] < RANK[name], f"{name} imports {other}, which is not below it"


def test_imports_make_no_circle() -> None:
    settled: set[str] = set()
    waiting = set(MODULES)
    while waiting:
        ready = {name for name in waiting if inside(name) <= settled}
        assert ready, f"these import each other: {sorted(waiting)}"
        settled |= ready
        waiting -= ready


@pytest.mark.parametrize("name", MODULES)
def test_no_module_state(name: str) -> None:
    """No `global`, and no function changes a name of the module; containers at module level are constants."""
    tree = TREES[name]
    constants = set()
    for node in tree.body:
        targets = (
            node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        )
        constants |= {t.id for t in targets if isinstance(t, ast.Name)}
        value = getattr(node, "value", None)
        if isinstance(value, ast.List | ast.Dict | ast.Set | ast.ListComp | ast.DictComp | ast.SetComp):
            lower = [
                t.id for t in targets if isinstance(t, ast.Name) and not t.id.startswith("__") and not t.id.isupper()
            ]
            assert not lower, f"{name}: {lower} looks like state; constants are upper case"
    for function in (n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef | ast.AsyncFunctionDef)):
        own = {a.arg for a in ast.walk(function) if isinstance(a, ast.arg)}
        own |= {n.id for n in ast.walk(function) if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store)}
        shared = constants - own
        for node in ast.walk(function):
            where = f"{name}.{function.name}, line {getattr(node, 'lineno', '?')}"
            assert not isinstance(node, ast.Global), f"{where}: global"
            if isinstance(node, ast.Subscript) and isinstance(node.ctx, ast.Store | ast.Del):
                changed = node.value
            elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in CHANGING:
                changed = node.func.value
            else:
                continue
            assert not (isinstance(changed, ast.Name) and changed.id in shared), (
                f"{where}: changes {ast.unparse(changed)}"
            )


@pytest.mark.parametrize("name", MODULES)
def test_public_things_have_docstrings(name: str) -> None:
    """Modules, public functions and classes, and public methods; private ones as they like."""
    tree = TREES[name]
    assert ast.get_docstring(tree), f"{name}: no docstring"

    def check(nodes: list[ast.stmt], prefix: str) -> None:
        for node in nodes:
            if not isinstance(node, ast.FunctionDef | ast.ClassDef) or node.name.startswith("_"):
                continue
            assert (ast.get_docstring(node) or "").strip(), f"{prefix}.{node.name}: no docstring"
            if isinstance(node, ast.ClassDef):
                check(node.body, f"{prefix}.{node.name}")

    check(tree.body, name)


@pytest.mark.parametrize("name", [name for name in MODULES if name != "__main__"])
def test_examples_in_docstrings(name: str) -> None:
    module = importlib.import_module("rverror" if name == "__init__" else f"rverror.{name}")
    result = doctest.testmod(module, optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert result.failed == 0


def test_some_examples_were_run() -> None:
    found = doctest.DocTestFinder().find(importlib.import_module("rverror.kinematics"))
    assert sum(len(test.examples) for test in found) >= 4


def test_public_names_exist() -> None:
    assert len(set(rverror.__all__)) == len(rverror.__all__)
    for name in rverror.__all__:
        assert getattr(rverror, name) is not None
    assert (PACKAGE / "py.typed").exists()
