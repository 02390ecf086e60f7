"""Shape of the code: imports go one way, pint in one place, one name for one thing, docstrings whose examples run.

The order of the rooms is said once: the contract of import-linter in pyproject.toml.
"""

from __future__ import annotations

import ast
import doctest
import graphlib
import importlib
import inspect
from collections import defaultdict
from pathlib import Path

import pytest
from importlinter.cli import lint_imports

import rverror
from modules import IMPORTABLE, MODULES, PACKAGE, PUBLIC, ROOMS, TREES, import_graph, named
from pages import ROOT

PYPROJECT = ROOT / "pyproject.toml"
#: Words by which a container is changed in place.
CHANGING = {"append", "extend", "insert", "add", "update", "setdefault", "pop", "popitem", "clear", "remove", "discard"}


def test_rooms_import_from_the_rooms_below_them(capsys: pytest.CaptureFixture[str]) -> None:
    code = lint_imports(config_filename=str(PYPROJECT), no_cache=True)
    assert code == 0, capsys.readouterr().out


def test_files_import_in_no_circle() -> None:
    """Inside a room as well as between rooms."""
    graph = import_graph()
    order = graphlib.TopologicalSorter({module: graph.find_modules_directly_imported_by(module) for module in MODULES})
    order.prepare()  # names the circle where there is one


def test_nothing_of_the_package_imports_its_front_door() -> None:
    """Modules import one another; `rverror` and the names of its rooms are for users and for examples in docstrings."""
    assert import_graph().find_modules_that_directly_import("rverror") == set()
    for room in ROOMS:
        assert import_graph().find_modules_that_directly_import(f"rverror.{room}") <= {"rverror"}


def test_pint_is_known_to_one_module() -> None:
    assert import_graph().find_modules_that_directly_import("pint") == {"rverror.base.units"}


def test_no_module_has_the_name_of_a_public_function() -> None:
    """A public function hides no module, and the other way round."""
    functions = {name for name, full in PUBLIC.items() if inspect.isfunction(named(full))}
    assert [module for module in MODULES if module.rpartition(".")[2] in functions] == []


def test_a_name_of_a_class_means_one_class() -> None:
    places = defaultdict(list)
    for module, tree in TREES.items():
        for node in ast.walk(tree):
            if isinstance(node, ast.ClassDef):
                places[node.name].append(module)
    assert {name: found for name, found in places.items() if len(found) > 1} == {}


def test_array_is_defined_once() -> None:
    def names(node: ast.stmt) -> list[ast.expr]:
        if isinstance(node, ast.Assign):
            return node.targets
        return [node.target] if isinstance(node, ast.AnnAssign) else []

    defined = [
        module
        for module, tree in TREES.items()
        for node in tree.body
        if any(isinstance(name, ast.Name) and name.id == "Array" for name in names(node))
        or (isinstance(node, getattr(ast, "TypeAlias", ())) and node.name.id == "Array")
    ]
    assert defined == ["rverror.base.arrays"]


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


@pytest.mark.parametrize("name", IMPORTABLE)
def test_examples_in_docstrings(name: str) -> None:
    module = importlib.import_module(name)
    result = doctest.testmod(module, optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert result.failed == 0


def test_some_examples_were_run() -> None:
    found = doctest.DocTestFinder().find(importlib.import_module("rverror.geartrain.kinematics"))
    assert sum(len(test.examples) for test in found) >= 4


def test_types_come_along() -> None:
    assert (PACKAGE / "py.typed").exists()


def test_a_catalogue_key_is_spelled_in_its_own_file_alone() -> None:
    """What is special about a source is a field of it; only reference cases, which are data, name keys elsewhere."""
    spelled = {
        (module, node.value)
        for module, tree in TREES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and node.value in rverror.CATALOGUE
    }
    elsewhere = {
        (module, key)
        for module, key in spelled
        if module.rpartition(".")[2] != key.partition(".")[0] and module != "rverror.reference.cases"
    }
    assert elsewhere == set()
    assert {key for module, key in spelled} == set(rverror.CATALOGUE)


def test_tests_hold_on_to_no_private_name() -> None:
    """What a test needs of a module is passed in or public; a private name may go without a word."""
    found = {path.name: private_names(ast.parse(path.read_text(encoding="utf-8"))) for path in TESTS}
    assert {name: names for name, names in found.items() if names} == {}


TESTS = sorted((Path(__file__).parents[1]).rglob("*.py"))


def private_names(tree: ast.Module) -> list[str]:
    """Private names of the package that a test takes."""
    ours, found = set(), []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("rverror"):
            ours |= {alias.asname or alias.name for alias in node.names}
            found += [alias.name for alias in node.names if is_private(alias.name)]
        elif isinstance(node, ast.Call) and ast.unparse(node.func) == "monkeypatch.setattr":
            found += [a.value for a in node.args if isinstance(a, ast.Constant) and is_private(str(a.value))]
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and is_private(node.attr):
            found += [node.attr] if node.value.id in ours | {"module"} else []
    return found


def is_private(name: str) -> bool:
    return name.startswith("_") and not name.startswith("__")
