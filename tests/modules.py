"""The package as its tests read it: every module with its syntax tree, and what it imports."""

from __future__ import annotations

import ast
import functools
import importlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import grimp

import rverror
from rverror.base import lazy

PACKAGE = Path(rverror.__file__).parent


def _full_name(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


#: Syntax tree of every module, by its full name.
TREES = {
    _full_name(path): ast.parse(path.read_text(encoding="utf-8"), filename=str(path))
    for path in sorted(PACKAGE.rglob("*.py"))
}
MODULES = sorted(TREES)
#: All that can be imported without anything being run.
IMPORTABLE = [name for name in MODULES if name != "rverror.__main__"]


#: Rooms that have public names, as they stand after `rverror.`.
ROOMS = lazy.modules("rverror")
#: Every public name with its room: `equilibrium` is `rverror.statics.equilibrium`, on top as well or not.
PUBLIC = {
    name: f"rverror.{room}.{name}" for room in ROOMS for name in importlib.import_module(f"rverror.{room}").__all__
}


@functools.cache
def import_graph() -> grimp.ImportGraph:
    """Who imports whom, inside functions too, with the libraries from elsewhere."""
    return grimp.build_graph("rverror", include_external_packages=True, cache_dir=None)


def imported(tree: ast.AST) -> Iterator[str]:
    """Top names of what is imported anywhere in a tree."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield (node.module or "").partition(".")[0]


def split(name: str) -> tuple[str, list[str]]:
    """Module and what stands in it, of a full name."""
    parts = name.split(".")
    size = max(n for n in range(1, len(parts) + 1) if ".".join(parts[:n]) in TREES)
    return ".".join(parts[:size]), parts[size:]


def named(name: str) -> Any:
    """What a full name stands for."""
    module, path = split(name)
    return functools.reduce(getattr, path, importlib.import_module(module))
